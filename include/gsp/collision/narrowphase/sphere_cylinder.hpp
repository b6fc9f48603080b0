#pragma once
#include <gsp/collision/detail/solids.hpp>

namespace gsp {

/// Sphere a, cylinder b: signed distance of the centre to side, cap or rim, minus the radius.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void sphere_cylinder(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  Vec3<T> const q = transpose_times(b.R, a.p - b.p);
  detail::add_sphere_contact(b, q, a.size.x, detail::cylinder_distance(q, b.size.x, b.size.y), margin, 0, out);
}

}  // namespace gsp
