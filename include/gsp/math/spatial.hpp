#pragma once
#include <gsp/math/quat.hpp>

/// Spatial algebra about a common point, in world axes (Featherstone, Rigid Body Dynamics Algorithms, 2008; MuJoCo's "com-based" vectors).
namespace gsp {

/// A motion (angular velocity, velocity of the body's point at the reference) or a force (torque about the reference, force).
template <class T>
struct Spatial {
  Vec3<T> angular, linear;
};
template <class T>
GSP_FUNCTION Spatial<T> operator+(Spatial<T> const& a, Spatial<T> const& b) {
  return {a.angular + b.angular, a.linear + b.linear};
}
template <class T>
GSP_FUNCTION T dot(Spatial<T> const& a, Spatial<T> const& b) {
  return fma(a.linear.z, b.linear.z, fma(a.linear.y, b.linear.y, fma(a.linear.x, b.linear.x, dot(a.angular, b.angular))));
}
/// a + s b
template <class T>
GSP_FUNCTION Spatial<T> fma(T s, Spatial<T> const& b, Spatial<T> const& a) {
  return {fma(s, b.angular, a.angular), fma(s, b.linear, a.linear)};
}
/// Rate of change of the motion m that is carried along by the motion v: v x m.
template <class T>
GSP_FUNCTION Spatial<T> cross_motion(Spatial<T> const& v, Spatial<T> const& m) {
  return {cross(v.angular, m.angular), cross(v.angular, m.linear) + cross(v.linear, m.angular)};
}
/// The same for a force: v x* f.
template <class T>
GSP_FUNCTION Spatial<T> cross_force(Spatial<T> const& v, Spatial<T> const& f) {
  return {cross(v.angular, f.angular) + cross(v.linear, f.linear), cross(v.angular, f.linear)};
}

/// Inertia of a rigid body: rotational inertia about its centre of mass, the centre of mass from the reference, mass. Not about the
/// reference: a finger of 1 cm that is 1 m away from it would lose four digits.
template <class T>
struct SpatialInertia {
  T xx, yy, zz, xy, xz, yz;
  Vec3<T> center;
  T mass;
};
/// Of both bodies as one: parallel axes with the reduced mass, mu (|r|^2 1 - r r^T), r from one centre to the other.
template <class T>
GSP_FUNCTION SpatialInertia<T> operator+(SpatialInertia<T> const& a, SpatialInertia<T> const& b) {
  T const mass = a.mass + b.mass, part = b.mass / max(mass, T(1e-30));
  Vec3<T> const r = b.center - a.center, s = (a.mass * part) * r;
  return {a.xx + fma(s.y, r.y, fma(s.z, r.z, b.xx)),
          a.yy + fma(s.x, r.x, fma(s.z, r.z, b.yy)),
          a.zz + fma(s.x, r.x, fma(s.y, r.y, b.zz)),
          a.xy + fma(-s.x, r.y, b.xy),
          a.xz + fma(-s.x, r.z, b.xz),
          a.yz + fma(-s.y, r.z, b.yz),
          fma(part, r, a.center),
          mass};
}
/// Momentum of the motion v (or force of the acceleration v): (I w + c x p, p) with p = m (u + w x c).
template <class T>
GSP_FORCEINLINE_FUNCTION Spatial<T> operator*(SpatialInertia<T> const& i, Spatial<T> const& v) {
  Vec3<T> const& w = v.angular;
  Vec3<T> const iw{fma(i.xx, w.x, fma(i.xy, w.y, i.xz * w.z)), fma(i.xy, w.x, fma(i.yy, w.y, i.yz * w.z)),
                   fma(i.xz, w.x, fma(i.yz, w.y, i.zz * w.z))};
  Vec3<T> const p = i.mass * (v.linear + cross(w, i.center));
  return {iw + cross(i.center, p), p};
}
/// Inertia of a body whose principal moments are `principal` in axes turned by q, and whose centre of mass lies at `c`.
template <class T>
GSP_FUNCTION SpatialInertia<T> spatial_inertia(T mass, Vec3<T> const& principal, Quat<T> const& q, Vec3<T> const& c) {
  Mat3<T> const r = to_matrix(q);
  auto const entry = [&](int i, int j) {
    return fma(r(i, 2) * principal.z, r(j, 2), fma(r(i, 1) * principal.y, r(j, 1), (r(i, 0) * principal.x) * r(j, 0)));
  };
  return {entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2), c, mass};
}

}  // namespace gsp
