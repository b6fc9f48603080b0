#pragma once
#include <gsp/geometry/shape.hpp>

namespace gsp {

/// size: radius, half length of the segment along z.
struct CapsuleShape {
  static constexpr ShapeType type = ShapeType::capsule;
  static constexpr char const* name = "capsule";
  static constexpr int positive_sizes = 2;
  static constexpr bool has_surface = true;

  template <class T>
  GSP_FUNCTION static Vec3<T> support(ShapeData<T> const& s, Vec3<T> const& d) {
    Vec3<T> const n = normalized(d);
    return {s.size.x * n.x, s.size.x * n.y, s.size.x * n.z + (d.z < T(0) ? -s.size.y : s.size.y)};
  }
  /// r + h |R_i2|
  template <class T>
  GSP_FUNCTION static Vec3<T> half_extents(ShapeData<T> const& s, Mat3<T> const& m) {
    Vec3<T> e{T(0), T(0), T(0)};
    for (int i = 0; i < 3; ++i) e[i] = s.size.x + s.size.y * abs(m(i, 2));
    return e;
  }
  /// The side between the ends, and the half balls beyond them.
  template <class T>
  GSP_FUNCTION static T ray(ShapeData<T> const& s, Vec3<T> const& p, Vec3<T> const& v) {
    T const r = s.size.x;
    T const h = s.size.y;
    T best(-1);
    auto const side = detail::ray_roots(v.x * v.x + v.y * v.y, v.x * p.x + v.y * p.y, p.x * p.x + p.y * p.y - r * r);
    if (side.near >= T(0) && abs(p.z + side.near * v.z) <= h) best = side.near;
    if (side.far >= T(0) && abs(p.z + side.far * v.z) <= h) best = detail::nearer(best, side.far);
    for (int end = -1; end <= 1; end += 2) {
      Vec3<T> const q{p.x, p.y, p.z - T(end) * h};
      auto const ball = detail::ray_roots(dot(v, v), dot(v, q), dot(q, q) - r * r);
      if (ball.near >= T(0) && T(end) * (q.z + ball.near * v.z) >= T(0)) best = detail::nearer(best, ball.near);
      if (ball.far >= T(0) && T(end) * (q.z + ball.far * v.z) >= T(0)) best = detail::nearer(best, ball.far);
    }
    return best;
  }
  template <class T>
  GSP_FUNCTION static Vec3<T> half_axes(Vec3<T> const& size) {
    return {size.x, size.x, size.x + size.y};
  }

  /// A cylinder and two half balls, moved by the parallel axis theorem (com of a half ball 3r/8 from its base, of a half sphere r/2).
  static ShapeInertia inertia(std::array<double, 3> const& s, bool shell) {
    double constexpr pi = detail::pi;
    double const a = s[0];
    double const h = 2 * s[1];
    double const ball = shell ? 4 * pi * a * a : pi * a * a * a * 4 / 3, tube = shell ? 2 * pi * a * h : pi * a * a * h;
    double const whole = ball + tube, mb = ball / whole, mt = tube / whole;
    double const along_ball = shell ? a * a * 2 / 3 : a * a * 2 / 5, along_tube = shell ? a * a : a * a / 2;
    double const away = shell ? h * (h + 2 * a) / 4 : h * (2 * h + 3 * a) / 8;
    double const across = mb * (along_ball + away) + mt * (along_tube / 2 + h * h / 12);
    return {whole, {across, across, mb * along_ball + mt * along_tube}};
  }
  static double bounding_radius(std::array<double, 3> const& s) { return s[0] + s[1]; }
  static double area(std::array<double, 3> const& s) { return 4 * detail::pi * s[0] * (s[0] + s[1]); }
  static double thickness(std::array<double, 3> const& s) { return s[0]; }
  static SurfacePoint surface_point(std::array<double, 3> const& s, double t, double w) {
    double const side = s[1] / (s[0] + s[1]);  // share of the area
    if (t < side) {
      Vec3<double> const n = detail::on_circle(w);
      return {{s[0] * n.x, s[0] * n.y, s[1] * (2 * t / side - 1)}, n};
    }
    Vec3<double> const n = detail::on_ball((t - side) / (1 - side), w);
    return {{s[0] * n.x, s[0] * n.y, s[0] * n.z + (n.z < 0 ? -s[1] : s[1])}, n};
  }
};

}  // namespace gsp
