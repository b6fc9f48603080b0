#pragma once
#include <gsp/collision/detail/solids.hpp>

namespace gsp {

/// Two spheres: dist = |p_b - p_a| - r_a - r_b. Coincident centres: the normal is the cross product of the two x axes, or the world's x
/// axis.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void sphere_sphere(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  detail::add_sphere_sphere(a.p, a.size.x, b.p - a.p, b.size.x, cross(column(a.R, 0), column(b.R, 0)), margin, 0, out);
}

}  // namespace gsp
