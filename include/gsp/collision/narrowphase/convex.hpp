#pragma once
#include <gsp/collision/detail/patch.hpp>
#include <gsp/collision/detail/penetration.hpp>
#include <gsp/collision/manifold.hpp>

namespace gsp {

/// How two convex shapes lie to each other.
template <class T>
struct ConvexDistance {
  bool near;       // the distance is at most `reach`; else nothing below is set
  T dist;          // [m], negative inside: the least displacement that parts them
  Vec3<T> normal;  // unit, from a to b
  Vec3<T> pos;     // midway between the two surfaces where they are nearest, or deepest
};

namespace detail {

template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION ConvexDistance<T> core_distance(ConvexShape<T>& a, ConvexShape<T>& b, T reach, bool fine = false) {
  bool const single = sizeof(T) == 4;
  T const round = a.radius + b.radius;
  T const size = a.extent + b.extent + round;
  T const tolerance = (single ? T(1e-6) : T(1e-12)) * size;
  // Nearer than this a direction between two points says little, and faces of the difference say it better.
  T const touch = (single ? T(3e-5) : T(1e-9)) * size;
  auto const separation = gjk(a, b, reach + round, touch, tolerance);
  if (separation.answer == CoreDistance<T>::beyond) return {false, T(0), {T(1), T(0), T(0)}, {T(0), T(0), T(0)}};
  Vec3<T> n = separation.n;
  Vec3<T> at = separation.a;
  T dist = separation.dist;
  bool const is_curved = is_curved_core(a.type) || is_curved_core(b.type);
  if (separation.answer == CoreDistance<T>::apart && is_curved && separation.length - dist > tolerance) {
    CorePenetration<T> best{-dist, n, at};
    polish(a, b, best, tolerance);
    n = best.n;
    dist = -best.depth;
  }
  if (separation.answer == CoreDistance<T>::near_or_inside) {
    auto const overlap = penetration(a, b, size, tolerance, single ? 128 : 256, fine);
    n = overlap.n;
    at = overlap.a;
    dist = -overlap.depth;
  }
  // An ellipsoid's point is known as exactly as the normal is; the search's own is of a flat piece of the polytope.
  if (a.type == ShapeType::ellipsoid)
    at = core_support(a, n);
  else if (b.type == ShapeType::ellipsoid)
    at = core_support(b, -n) - dist * n;
  dist = dist - round;
  return {dist <= reach, dist, n, at + (a.radius + T(0.5) * dist) * n};
}

/// Where two overlapping cores are deepest: B moved out along n, and a little farther, is nearest to A there. The search in depth knows the
/// depth, but of many points as deep, as on a wide side of a prism, any: it need not be of both.
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION void find_deepest(ConvexShape<T>& a, ConvexShape<T> b, ConvexDistance<T>& d) {
  bool const single = sizeof(T) == 4;
  T const round = a.radius + b.radius, depth = -(d.dist + round);
  if (!(depth > T(0)) || a.type == ShapeType::ellipsoid || b.type == ShapeType::ellipsoid) return;
  T const size = a.extent + b.extent + round, touch = (single ? T(3e-5) : T(1e-9)) * size;
  Vec3<T> const at = b.p;
  for (T gap = T(4) * touch; gap < T(0.01) * size; gap = T(16) * gap) {  // too near, and rounding takes them for touching
    b.p = at + (depth + gap) * d.normal;
    auto const parted = gjk(a, b, size, touch, (single ? T(1e-6) : T(1e-12)) * size);
    if (parted.answer != CoreDistance<T>::apart) continue;
    d.pos = parted.a + (a.radius + T(0.5) * d.dist) * d.normal;
    return;
  }
}

/// The patch of the faces that meet along d's normal. Returns whether one of its points is as deep as the shapes overlap along it, or there
/// is no room for one.
template <class T>
KOKKOS_INLINE_FUNCTION bool meet_patch(ConvexShape<T> const& a, ConvexShape<T> const& b, ConvexDistance<T> const& d, T margin,
                                       Patch<T>& patch) {
  T const size = a.extent + b.extent + a.radius + b.radius;
  patch.margin = margin;
  patch.same2 = square((sizeof(T) == 4 ? T(1e-5) : T(1e-7)) * size);
  SupportFace<T> face_a, face_b;
  support_face(a, d.normal, face_a);
  support_face(b, -d.normal, face_b);
  meet_faces(face_a, face_b, d.normal, patch);
  T const slack = (sizeof(T) == 4 ? T(2e-6) : T(5e-7)) * size;
  bool deep = false;
  for (int i = 0; i < patch.count; ++i) {
    deep = deep || patch.point[i].dist <= d.dist + slack;
    patch.point[i].dist = max(patch.point[i].dist, d.dist);  // faces are flat but for rounding
  }
  return deep || patch.count == Patch<T>::most;
}

/// The points of two convex shapes: the patch of the faces that meet, and the deepest point where the patch has none that is as deep.
/// Returns how many there are, at most four, those that support best.
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION int find_patch(ConvexShape<T>& a, ConvexShape<T>& b, T margin, Patch<T>& patch) {
  ConvexDistance<T> d = core_distance(a, b, margin);
  if (!d.near) return 0;
  if (!meet_patch(a, b, d, margin, patch)) {
    find_deepest(a, b, d);
    patch.point[patch.count] = {d.pos, d.dist, d.normal, 0};
    ++patch.count;
  }
  return reduce_points(patch.point, patch.count);
}
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void add_convex_points(ConvexShape<T>& a, ConvexShape<T>& b, Vec3<T> const& origin, T margin, Out& out) {
  Patch<T> patch;
  int const count = find_patch(a, b, margin, patch);
  for (int i = 0; i < count; ++i) {
    auto const& p = patch.point[i];
    out.add(origin + p.pos, p.dist, p.normal, p.feature);
  }
}

}  // namespace detail

/// The distance of two convex shapes, or how deep they overlap: any of sphere, capsule, ellipsoid, cylinder, box and mesh (its hull), posed
/// in one frame. Beyond `reach` the search ends as soon as a plane shows it.
/// The normal n is such that the overlap of the shapes along it,  max n.x over a - min n.y over b,  is the least there is to within 1e-6
/// (float) or 1e-12 (double) of their size, with cylinders and ellipsoids to within 1e-6 in both; it is never less than the true depth, so
/// that no overlap is missed. Where the polytope is exhausted (deep ellipsoids in meshes of hundreds of vertices) it is an upper bound.
/// With `fine` cylinders and ellipsoids that overlap are searched as far as polyhedra are, which contacts do not need.
/// Round parts are exact: spheres and capsules count as their centers or segments, and a shallow contact needs no search in depth. No
/// allocation, no recursion; about 7 kB of stack in float, 13 kB in double. Cost 5 to 20 supports apart, 15 to 260 inside. Source: Gilbert,
/// Johnson, Keerthi (1988); van den Bergen (2001); docs/collision/convex.md.
template <class T>
KOKKOS_INLINE_FUNCTION ConvexDistance<T> convex_distance(ShapeType type_a, Shape<T> const& a, ShapeType type_b, Shape<T> const& b, T reach,
                                                         bool fine = false) {
  auto ca = detail::make_convex_shape(type_a, a, a.p);
  auto cb = detail::make_convex_shape(type_b, b, a.p);
  ConvexDistance<T> d = detail::core_distance(ca, cb, reach, fine);
  if (d.near) detail::find_deepest(ca, cb, d);
  d.pos = d.pos + a.p;
  return d;
}

/// Contact points of two convex shapes, at most four with one normal: `convex_distance`'s, and the patch of the faces that meet along it
/// (flat faces of boxes and meshes, caps and side lines of cylinders, capsules' lines), clipped by each other and thinned to the four that
/// support best. Ellipsoids and spheres give one point. Features: faces and edges that meet; 0 the deepest point, where the patch has none
/// as deep.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void convex_convex(ShapeType type_a, Shape<T> const& a, ShapeType type_b, Shape<T> const& b, T margin, Out& out) {
  auto ca = detail::make_convex_shape(type_a, a, a.p);
  auto cb = detail::make_convex_shape(type_b, b, a.p);
  detail::add_convex_points(ca, cb, a.p, margin, out);
}

}  // namespace gsp
