#pragma once
#include <gsp/collision/narrowphase/capsule_box.hpp>
#include <gsp/collision/narrowphase/capsule_capsule.hpp>
#include <gsp/collision/narrowphase/convex.hpp>
#include <gsp/collision/narrowphase/sphere_box.hpp>
#include <gsp/collision/narrowphase/sphere_capsule.hpp>
#include <gsp/collision/narrowphase/sphere_cylinder.hpp>
#include <gsp/collision/narrowphase/sphere_sphere.hpp>

/// How far two shapes are apart, and where.
namespace gsp {

/// The nearest points of two shapes. Where the shapes overlap they are where it is deepest, each inside of the other shape.
template <class T>
struct ShapeDistance {
  bool near;         // dist < cutoff; else dist is the cutoff and the points are 0
  T dist;            // [m], negative inside: the least displacement that parts them
  Vec3<T> from, to;  // on the surfaces of a and b: |to - from| = |dist|
};

namespace detail {
/// Keeps the nearest of the points of a pair (`add` as narrow-phase functions call it).
template <class T>
struct NearestPoint {
  ShapeDistance<T> best;
  KOKKOS_INLINE_FUNCTION void add(Vec3<T> const& pos, T dist, Vec3<T> const& normal, int) {
    if (!(dist < best.dist)) return;
    Vec3<T> const half = (T(0.5) * dist) * normal;
    best = {true, dist, pos - half, pos + half};
  }
};

/// Whether a shape is somewhere: no NaN, nothing infinite.
template <class T>
KOKKOS_INLINE_FUNCTION bool is_there(Shape<T> const& s) {
  T sum = s.p.x + s.p.y + s.p.z + s.size.x + s.size.y + s.size.z;
  for (int k = 0; k < 9; ++k) sum = sum + s.R.m[k];
  return sum - sum == T(0);
}

/// The point of b that lies deepest below plane a, and the plane's point above it.
template <class T>
KOKKOS_INLINE_FUNCTION void plane_distance(Shape<T> const& a, ShapeType type_b, Shape<T> const& b, NearestPoint<T>& nearest) {
  Vec3<T> const n = column(a.R, 2);
  ConvexShape<T> core = make_convex_shape(type_b, b, a.p);
  // of a box's corners as low, that of MuJoCo: as core_support chooses above
  Vec3<T> const far = type_b == ShapeType::box ? T(2) * core.p - core_support(core, n) : core_support(core, -n);
  Vec3<T> const low = far - core.radius * n;
  T const dist = dot(n, low);
  nearest.add(a.p + low - (T(0.5) * dist) * n, dist, n, 0);
}

/// The nearest points of a pair whose types are in order.
template <class T>
KOKKOS_INLINE_FUNCTION void find_nearest(ShapeType type_a, Shape<T> const& a, ShapeType type_b, Shape<T> const& b, T cutoff,
                                         NearestPoint<T>& nearest) {
  PairKind const kind = pair_kind(type_a, type_b);
  if (kind == PairKind::none || type_a == ShapeType::hfield || !is_there(a) || !is_there(b)) return;
  if (type_a == ShapeType::plane) return plane_distance(a, type_b, b, nearest);
  switch (kind) {
    case PairKind::sphere_sphere:
      return sphere_sphere(a, b, cutoff, nearest);
    case PairKind::sphere_capsule:
      return sphere_capsule(a, b, cutoff, nearest);
    case PairKind::sphere_cylinder:
      return sphere_cylinder(a, b, cutoff, nearest);
    case PairKind::sphere_box:
      return sphere_box(a, b, cutoff, nearest);
    case PairKind::capsule_capsule:
      return capsule_capsule(a, b, cutoff, nearest);
    case PairKind::capsule_box:
      return capsule_box(a, b, cutoff, nearest);
    default:
      break;
  }
  ConvexDistance<T> const d = convex_distance(type_a, a, type_b, b, cutoff, true);
  if (d.near) nearest.add(d.pos, d.dist, d.normal, 0);
}
}  // namespace detail

/// The distance of two shapes, in any order of types, if it is less than `cutoff`: as MuJoCo's mj_geomDistance. Planes are infinite and
/// solid below, meshes are their hulls. Not near is what has no distance: planes and height fields to each other, height fields to
/// anything, and what has a pose or size that is not finite.
/// Exact to rounding between planes and anything, spheres, capsules and boxes (but two that are boxes, and where the segment of a capsule
/// enters a box: 1e-7 of the size, 2e-6 in float); the others by `convex_distance` (narrowphase/convex.hpp), fine. Where many points are as
/// near, as between parallel faces, one of them. Round shapes that overlap about one middle or axis: up to 1 % too deep. Does not allocate;
/// 7 kB of stack in float, 13 kB in double. Cost: that of the pair in the narrow phase (docs/collision/narrowphase.md, convex.md).
template <class T>
KOKKOS_FUNCTION ShapeDistance<T> shape_distance(ShapeType type_a, Shape<T> const& a, ShapeType type_b, Shape<T> const& b, T cutoff) {
  bool const turned = type_a > type_b;
  detail::NearestPoint<T> nearest{{false, cutoff, {T(0), T(0), T(0)}, {T(0), T(0), T(0)}}};
  detail::find_nearest(turned ? type_b : type_a, turned ? b : a, turned ? type_a : type_b, turned ? a : b, cutoff, nearest);
  ShapeDistance<T> const& d = nearest.best;
  return turned ? ShapeDistance<T>{d.near, d.dist, d.to, d.from} : d;
}

}  // namespace gsp
