#pragma once
#include <gsp/collision/shapes.hpp>

namespace gsp {

/// Plane a, sphere b: dist = n . (p_b - p_a) - r. One point; branch-free but for the margin.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void plane_sphere(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  Vec3<T> const n = column(a.R, 2);
  T const r = b.size.x, dist = dot(n, b.p - a.p) - r;
  if (dist <= margin) out.add(b.p - (r + T(0.5) * dist) * n, dist, n, 0);
}

}  // namespace gsp
