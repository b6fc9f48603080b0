#pragma once
#include <gsp/math/vec3.hpp>

namespace gsp {

/// Rotation as a unit quaternion, order w, x, y, z (MuJoCo's and gsplat's). `rotate(q, v)` takes v from the frame that q describes to its
/// parent.
template <class T>
struct Quat {
  T w, x, y, z;
};
/// Rotation matrix, row-major: m[3 r + c].
template <class T>
struct Mat3 {
  T m[9];
  GSP_FUNCTION T& operator()(int r, int c) { return m[3 * r + c]; }
  GSP_FUNCTION T const& operator()(int r, int c) const { return m[3 * r + c]; }
};

template <class T>
GSP_FUNCTION Quat<T> identity_quat() {
  return {T(1), T(0), T(0), T(0)};
}
template <class T>
GSP_FUNCTION Quat<T> conjugate(Quat<T> const& q) {
  return {q.w, -q.x, -q.y, -q.z};
}
/// Hamilton product: the rotation b followed by a.
template <class T>
GSP_FUNCTION Quat<T> operator*(Quat<T> const& a, Quat<T> const& b) {
  return {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
          a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}
/// q v q^-1 = v + 2 u x (u x v + w v), u the vector part.
template <class T>
GSP_FUNCTION Vec3<T> rotate(Quat<T> const& q, Vec3<T> const& v) {
  Vec3<T> const u{q.x, q.y, q.z};
  Vec3<T> const t = cross(u, v) + q.w * v;
  return v + T(2) * cross(u, t);
}
template <class T>
GSP_FUNCTION Vec3<T> rotate_inverse(Quat<T> const& q, Vec3<T> const& v) {
  return rotate(conjugate(q), v);
}

/// q / |q|; the identity where |q| < 1e-15; NaN where q holds one.
template <class T>
GSP_FUNCTION Quat<T> normalized(Quat<T> const& q) {
  T const n = sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  auto const none = n < T(1e-15);  // not of NaN, which stays
  T const s = T(1) / select(none, T(1), n);
  return {select(none, T(1), q.w * s), select(none, T(0), q.x * s), select(none, T(0), q.y * s), select(none, T(0), q.z * s)};
}
/// Rotation by `angle` [rad] about the unit vector `axis`.
template <class T>
GSP_FUNCTION Quat<T> axis_angle(Vec3<T> const& axis, T angle) {
  T s, c;
  sincos(T(0.5) * angle, s, c);
  return {c, s * axis.x, s * axis.y, s * axis.z};
}
/// exp of the rotation vector w t: the rotation that an angular velocity w makes in the time t.
template <class T>
GSP_FUNCTION Quat<T> exp_rotation(Vec3<T> const& rotation) {
  T const angle = norm(rotation);
  auto const ok = angle >= T(1e-15);
  T const inverse = T(1) / select(ok, angle, T(1));
  T s, c;
  sincos(T(0.5) * angle, s, c);
  s = select(ok, s * inverse, T(0.5));
  return {c, s * rotation.x, s * rotation.y, s * rotation.z};
}
/// Rotation vector of a unit quaternion, angle in [-pi, pi].
template <class T>
GSP_FUNCTION Vec3<T> log_rotation(Quat<T> const& q) {
  Vec3<T> const u{q.x, q.y, q.z};
  T const s = norm(u);
  auto const ok = s >= T(1e-15);
  T angle = T(2) * atan2(s, q.w);
  angle = select(angle > T(3.14159265358979323846), angle - T(6.28318530717958647693), angle);
  T const k = select(ok, angle / select(ok, s, T(1)), T(0));
  return k * u;
}
template <class T>
GSP_FUNCTION Mat3<T> to_matrix(Quat<T> const& q) {
  T const two(2);
  T const xx = q.x * q.x, yy = q.y * q.y, zz = q.z * q.z, ww = q.w * q.w;
  T const xy = q.x * q.y, xz = q.x * q.z, yz = q.y * q.z, wx = q.w * q.x, wy = q.w * q.y, wz = q.w * q.z;
  return {{ww + xx - yy - zz, two * (xy - wz), two * (xz + wy), two * (xy + wz), ww - xx + yy - zz, two * (yz - wx), two * (xz - wy),
           two * (yz + wx), ww - xx - yy + zz}};
}
template <class T>
GSP_FUNCTION Vec3<T> operator*(Mat3<T> const& r, Vec3<T> const& v) {
  return {r.m[0] * v.x + r.m[1] * v.y + r.m[2] * v.z, r.m[3] * v.x + r.m[4] * v.y + r.m[5] * v.z,
          r.m[6] * v.x + r.m[7] * v.y + r.m[8] * v.z};
}
/// R^T v
template <class T>
GSP_FUNCTION Vec3<T> transpose_times(Mat3<T> const& r, Vec3<T> const& v) {
  return {r.m[0] * v.x + r.m[3] * v.y + r.m[6] * v.z, r.m[1] * v.x + r.m[4] * v.y + r.m[7] * v.z,
          r.m[2] * v.x + r.m[5] * v.y + r.m[8] * v.z};
}
template <class T>
GSP_FUNCTION Vec3<T> column(Mat3<T> const& r, int c) {
  return {r(0, c), r(1, c), r(2, c)};
}

/// Rigid transform: x -> p + rotate(q, x).
template <class T>
struct Transform {
  Vec3<T> p;
  Quat<T> q;
};
template <class T>
GSP_FUNCTION Vec3<T> operator*(Transform<T> const& t, Vec3<T> const& x) {
  return t.p + rotate(t.q, x);
}
template <class T>
GSP_FUNCTION Transform<T> operator*(Transform<T> const& a, Transform<T> const& b) {
  return {a * b.p, a.q * b.q};
}
template <class T>
GSP_FUNCTION Transform<T> inverse(Transform<T> const& t) {
  return {rotate_inverse(t.q, -t.p), conjugate(t.q)};
}

}  // namespace gsp
