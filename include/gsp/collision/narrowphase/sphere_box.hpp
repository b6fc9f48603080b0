#pragma once
#include <gsp/collision/detail/solids.hpp>

namespace gsp {

/// Sphere a, box b: signed distance of the centre to the box (inside: to the nearest face), minus the radius.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void sphere_box(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  Vec3<T> const q = transpose_times(b.R, a.p - b.p);
  detail::add_sphere_contact(b, q, a.size.x, detail::box_distance(q, b.size), margin, 0, out);
}

}  // namespace gsp
