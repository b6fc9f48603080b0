#pragma once
#include <Kokkos_Core.hpp>
#include <gsp/geometry/shape_pairs.hpp>

/// The points where two shapes touch, and the frame of a contact.
namespace gsp {

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
