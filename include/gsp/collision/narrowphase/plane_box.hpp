#pragma once
#include <gsp/collision/shapes.hpp>

namespace gsp {

/// Plane a, box b: the corners of the lower half (those not above the box's centre), at most four, in the order of their number; feature =
/// corner number, bit i set where the corner is at +size[i].
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void plane_box(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  Vec3<T> const n = column(a.R, 2);
  Vec3<T> const x = b.size.x * column(b.R, 0), y = b.size.y * column(b.R, 1), z = b.size.z * column(b.R, 2);
  T const height = dot(n, b.p - a.p), nx = dot(n, x), ny = dot(n, y), nz = dot(n, z);
  int count = 0;
  for (int corner = 0; corner < 8 && count < 4; ++corner) {
    T const sx = corner & 1 ? T(1) : T(-1), sy = corner & 2 ? T(1) : T(-1), sz = corner & 4 ? T(1) : T(-1);
    T const below = sx * nx + sy * ny + sz * nz, dist = height + below;
    if (below > T(0) || !(dist <= margin)) continue;
    out.add(b.p + (sx * x + sy * y + sz * z) - T(0.5) * dist * n, dist, n, corner);
    ++count;
  }
}

}  // namespace gsp
