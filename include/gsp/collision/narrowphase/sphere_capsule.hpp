#pragma once
#include <gsp/collision/detail/solids.hpp>

namespace gsp {

/// Sphere a, capsule b: the sphere against the sphere at the nearest point of the capsule's segment.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void sphere_capsule(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  Vec3<T> const axis = column(b.R, 2);
  T const x = clamp(dot(axis, a.p - b.p), -b.size.y, b.size.y);
  detail::add_sphere_sphere(a.p, a.size.x, b.p + x * axis, b.size.x, column(b.R, 0), margin, 0, out);
}

}  // namespace gsp
