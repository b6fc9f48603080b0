#pragma once
#include <gsp/collision/shapes.hpp>

namespace gsp {

/// Plane a, capsule b: the spheres at the two ends (feature 0: end at +axis, 1: end at -axis).
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void plane_capsule(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  Vec3<T> const n = column(a.R, 2), half = b.size.y * column(b.R, 2);
  T const r = b.size.x;
  for (int end = 0; end < 2; ++end) {
    Vec3<T> const p = end == 0 ? b.p + half : b.p - half;
    T const dist = dot(n, p - a.p) - r;
    if (dist <= margin) out.add(p - (r + T(0.5) * dist) * n, dist, n, end);
  }
}

}  // namespace gsp
