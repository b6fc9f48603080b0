#pragma once
#include <gsp/collision/shapes.hpp>

namespace gsp {

/// Plane a, cylinder b: the deepest rim point (feature 0), the point opposite to it along the axis (1), and on the deeper cap the two rim
/// points at
/// +-120 degrees from the deepest (2, 3). The deepest direction is the steepest descent within the cap, or the cylinder's own x axis where
/// the cap is parallel to the plane, so that a standing cylinder keeps its points.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void plane_cylinder(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  Vec3<T> const n = column(a.R, 2);
  Vec3<T> axis = column(b.R, 2);
  T slope = dot(n, axis);
  if (slope > T(0)) {  // towards the plane
    axis = -axis;
    slope = -slope;
  }
  // -n without its part along the axis; its length is the sine of the tilt. slope axis - n leaves rounding of 1 along n, by which depths at
  // the rim of what stands on a slope jumped by a third.
  Vec3<T> down = cross(axis, cross(axis, n));
  T const sine = norm(down);
  T const level = sizeof(T) == 4 ? T(1e-5) : T(1e-12);  // below, the direction is rounding
  down = sine < level ? b.size.x * column(b.R, 0) : (b.size.x / sine) * down;
  axis = b.size.y * axis;
  T const height = dot(n, b.p - a.p), drop = dot(n, down), along = b.size.y * slope;
  auto const add = [&](T dist, Vec3<T> const& p, int feature) {
    if (dist <= margin) out.add(p - T(0.5) * dist * n, dist, n, feature);
  };
  add(height + along + drop, b.p + axis + down, 0);
  add(height - along + drop, b.p - axis + down, 1);
  T const dist = height + along - T(0.5) * drop;
  Vec3<T> const side = (T(0.8660254037844386) * b.size.x) * normalized(cross(down, axis)), p = b.p + axis - T(0.5) * down;
  add(dist, p + side, 2);
  add(dist, p - side, 3);
}

}  // namespace gsp
