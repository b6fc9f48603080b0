#pragma once
#include <gsp/math/quat.hpp>
#include <gsp/model/description.hpp>

/// Shapes in the world, the points where two of them touch, and which pairs of shapes are covered.
namespace gsp {

/// A geometric primitive in place. `size` as in GeomDescription: sphere (radius), capsule and cylinder (radius, half length; axis = column
/// 2 of R), box (half sizes), plane (through p, normal = column 2 of R; its extent is not used: planes are infinite).
template <class T>
struct Shape {
  Vec3<T> p;     // [m]
  Mat3<T> R;     // shape frame to world
  Vec3<T> size;  // [m]
};
template <class T>
KOKKOS_INLINE_FUNCTION Shape<T> make_shape(Transform<T> const& pose, Vec3<T> const& size) {
  return {pose.p, to_matrix(pose.q), size};
}

/// One point of contact of shapes a and b.
template <class T>
struct ContactPoint {
  Vec3<T> pos;     // midway between the two surfaces along the normal [m]
  T dist;          // distance of the surfaces there [m], negative inside
  Vec3<T> normal;  // unit, from a to b
  int feature;     // which features of the two shapes meet: the same number while they do, from step to step; unique among the points of a
                   // pair
};

/// A sink for contact points with room for N; further points are counted but not kept. Narrow-phase functions take any type with such an
/// `add`.
template <class T, int N>
struct ContactPoints {
  int count = 0;
  ContactPoint<T> point[N];
  KOKKOS_INLINE_FUNCTION void add(Vec3<T> const& pos, T dist, Vec3<T> const& normal, int feature) {
    if (count < N) point[count] = {pos, dist, normal, feature};
    ++count;
  }
};

/// The pairs of shapes that have a narrow-phase function, in the order of their types (MuJoCo's numbering, type of a <= type of b).
enum class PairKind : int {
  plane_sphere,
  plane_capsule,
  plane_cylinder,
  plane_box,
  sphere_sphere,
  sphere_capsule,
  sphere_cylinder,
  sphere_box,
  capsule_capsule,
  capsule_cylinder,
  capsule_box,
  box_box,
  none
};
inline constexpr int pair_kinds = int(PairKind::none);

/// The kind of a pair, or `none`: the pair is not covered, or its order is not that of the types.
KOKKOS_INLINE_FUNCTION constexpr PairKind pair_kind(ShapeType a, ShapeType b) {
  using S = ShapeType;
  using K = PairKind;
  if (a == S::plane)
    return b == S::sphere     ? K::plane_sphere
           : b == S::capsule  ? K::plane_capsule
           : b == S::cylinder ? K::plane_cylinder
           : b == S::box      ? K::plane_box
                              : K::none;
  if (a == S::sphere)
    return b == S::sphere     ? K::sphere_sphere
           : b == S::capsule  ? K::sphere_capsule
           : b == S::cylinder ? K::sphere_cylinder
           : b == S::box      ? K::sphere_box
                              : K::none;
  if (a == S::capsule)
    return b == S::capsule ? K::capsule_capsule : b == S::cylinder ? K::capsule_cylinder : b == S::box ? K::capsule_box : K::none;
  return a == S::box && b == S::box ? K::box_box : K::none;
}

/// The most points that a pair of this kind gives.
KOKKOS_INLINE_FUNCTION constexpr int max_points(PairKind kind) {
  switch (kind) {
    case PairKind::plane_capsule:
    case PairKind::capsule_capsule:
      return 2;
    case PairKind::capsule_cylinder:
    case PairKind::capsule_box:
      return 3;
    case PairKind::plane_cylinder:
    case PairKind::plane_box:
      return 4;
    case PairKind::box_box:
      return 8;
    case PairKind::none:
      return 0;
    default:
      return 1;
  }
}

/// Contact frame as rows (normal, t1, t2), right-handed: t1 is `hint` made orthogonal to the normal; without a usable hint the y axis, or
/// the z axis where the normal is within 60 degrees of y (MuJoCo's mju_makeFrame).
template <class T>
KOKKOS_INLINE_FUNCTION Mat3<T> contact_frame(Vec3<T> const& n, Vec3<T> const& hint = {T(0), T(0), T(0)}) {
  Vec3<T> t = dot(hint, hint) < T(0.25) ? (n.y < T(0.5) && n.y > T(-0.5) ? Vec3<T>{T(0), T(1), T(0)} : Vec3<T>{T(0), T(0), T(1)}) : hint;
  t = normalized(t - dot(n, t) * n);
  Vec3<T> const b = cross(n, t);
  return {{n.x, n.y, n.z, t.x, t.y, t.z, b.x, b.y, b.z}};
}

}  // namespace gsp
