#pragma once
#include <gsp/collision/detail/solids.hpp>

namespace gsp {

/// Sphere a, capsule b: the sphere against the sphere at the nearest point of the capsule's segment. Centre on the axis: the normal is the
/// capsule's x axis, or whichever rounding leaves at right angles to the axis.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void sphere_capsule(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  Vec3<T> const axis = column(b.R, 2), side = column(b.R, 0), d = a.p - b.p;
  T const x = clamp(dot(axis, d), -b.size.y, b.size.y);
  Vec3<T> way = b.p + x * axis - a.p;
  if (abs(x) < b.size.y) way = detail::across_axes(way, side, column(b.R, 1), norm(d) + b.size.y);
  detail::add_sphere_sphere(a.p, a.size.x, way, b.size.x, side, margin, 0, out);
}

}  // namespace gsp
