#pragma once
#include <gsp/collision/shapes.hpp>
#include <gsp/geometry/shapes/ellipsoid.hpp>

namespace gsp {

/// Plane a, ellipsoid b with half axes s: the lowest point,  p_b - R S S d / |S d|  with d the plane's normal in the ellipsoid's frame.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void plane_ellipsoid(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  Vec3<T> const n = column(a.R, 2);
  Vec3<T> const p = b.p + b.R * EllipsoidShape::support(ShapeData<T>{b.size}, -transpose_times(b.R, n));
  T const dist = dot(n, p - a.p);
  if (dist <= margin) out.add(p - T(0.5) * dist * n, dist, n, 0);
}

}  // namespace gsp
