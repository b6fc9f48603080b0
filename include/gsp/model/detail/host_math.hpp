#pragma once
#include <array>
#include <cmath>
#include <gsp/model/description.hpp>

/// The little geometry that readers and `compile` need, on the host in double, so that they compile without Kokkos. Kernels use gsp/math.
namespace gsp::detail {

inline Double3 operator+(Double3 const& a, Double3 const& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
inline Double3 operator-(Double3 const& a, Double3 const& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Double3 operator*(double s, Double3 const& a) { return {s * a[0], s * a[1], s * a[2]}; }
inline double dot(Double3 const& a, Double3 const& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline double norm(Double3 const& a) { return std::sqrt(dot(a, a)); }
inline Double3 cross(Double3 const& a, Double3 const& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Hamilton product, w x y z: the rotation b followed by a.
inline Double4 times(Double4 const& a, Double4 const& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}
inline Double3 rotate(Double4 const& q, Double3 const& v) {
  Double3 const u{q[1], q[2], q[3]}, t = cross(u, v) + q[0] * v;
  return v + 2. * cross(u, t);
}
inline Double3 rotate_inverse(Double4 const& q, Double3 const& v) { return rotate({q[0], -q[1], -q[2], -q[3]}, v); }
/// q / |q|; the identity where |q| < 1e-15.
inline Double4 normalized(Double4 const& q) {
  double const n = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return n >= 1e-15 ? Double4{q[0] / n, q[1] / n, q[2] / n, q[3] / n} : Double4{1, 0, 0, 0};
}
inline Double4 axis_angle(Double3 const& unit, double angle) {
  double const s = std::sin(angle / 2);
  return {std::cos(angle / 2), s * unit[0], s * unit[1], s * unit[2]};
}
/// The smallest rotation that takes z to v: about z x v, by atan2(|z x v|, v_z); about x where v points down.
inline Double4 quat_of_z(Double3 const& v) {
  Double3 const axis = cross({0, 0, 1}, v);
  double const s = norm(axis);
  return s < 1e-10 ? axis_angle({1, 0, 0}, std::atan2(s, v[2])) : axis_angle((1 / s) * axis, std::atan2(s, v[2]));
}
/// Quaternion of the rotation whose columns are x, y, z (unit, right-handed). The largest of w, x, y, z is taken first, so that no root of
/// a small number is.
inline Double4 quat_of_axes(Double3 const& x, Double3 const& y, Double3 const& z) {
  double const four[4] = {1 + x[0] + y[1] + z[2], 1 + x[0] - y[1] - z[2], 1 - x[0] + y[1] - z[2], 1 - x[0] - y[1] + z[2]};
  int k = 0;
  for (int i = 1; i < 4; ++i)
    if (four[i] > four[k]) k = i;
  double const m = 0.5 * std::sqrt(four[k]), f = 0.25 / m;
  double const a = f * (y[2] - z[1]), b = f * (z[0] - x[2]), c = f * (x[1] - y[0]);
  double const xy = f * (y[0] + x[1]), xz = f * (z[0] + x[2]), yz = f * (z[1] + y[2]);
  if (k == 0) return normalized({m, a, b, c});
  if (k == 1) return normalized({a, m, xy, xz});
  if (k == 2) return normalized({b, xy, m, yz});
  return normalized({c, xz, yz, m});
}

/// Rigid transform x -> p + rotate(q, x).
struct Pose {
  Double3 p{0, 0, 0};
  Double4 q{1, 0, 0, 0};
};
inline Double3 operator*(Pose const& t, Double3 const& x) { return t.p + rotate(t.q, x); }
inline Pose operator*(Pose const& a, Pose const& b) { return {a * b.p, times(a.q, b.q)}; }

}  // namespace gsp::detail
