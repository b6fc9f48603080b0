#pragma once
#include <gsp/geometry/shape.hpp>

namespace gsp {

/// size: radius, half length along z.
struct CylinderShape {
  static constexpr ShapeType type = ShapeType::cylinder;
  static constexpr char const* name = "cylinder";
  static constexpr int positive_sizes = 2;
  static constexpr bool has_surface = true;

  template <class T>
  GSP_FUNCTION static Vec3<T> support(ShapeData<T> const& s, Vec3<T> const& d) {
    Vec3<T> const n = normalized(Vec3<T>{d.x, d.y, T(0)});
    return {s.size.x * n.x, s.size.x * n.y, d.z < T(0) ? -s.size.y : s.size.y};
  }
  /// r sqrt(1 - R_i2^2) + h |R_i2|
  template <class T>
  GSP_FUNCTION static Vec3<T> half_extents(ShapeData<T> const& s, Mat3<T> const& m) {
    Vec3<T> e{T(0), T(0), T(0)};
    for (int i = 0; i < 3; ++i) e[i] = s.size.x * sqrt(max(T(0), T(1) - m(i, 2) * m(i, 2))) + s.size.y * abs(m(i, 2));
    return e;
  }
  template <class T>
  GSP_FUNCTION static T ray(ShapeData<T> const& s, Vec3<T> const& p, Vec3<T> const& v) {
    T const r = s.size.x;
    T const h = s.size.y;
    T best(-1);
    auto const side = detail::ray_roots(v.x * v.x + v.y * v.y, v.x * p.x + v.y * p.y, p.x * p.x + p.y * p.y - r * r);
    if (side.near >= T(0) && abs(p.z + side.near * v.z) <= h) best = side.near;
    if (side.far >= T(0) && abs(p.z + side.far * v.z) <= h) best = detail::nearer(best, side.far);
    if (abs(v.z) < T(1e-15)) return best;
    for (int end = -1; end <= 1; end += 2) {
      T const x = (T(end) * h - p.z) / v.z;
      T const a = p.x + x * v.x;
      T const b = p.y + x * v.y;
      if (x >= T(0) && a * a + b * b <= r * r) best = detail::nearer(best, x);
    }
    return best;
  }
  template <class T>
  GSP_FUNCTION static Vec3<T> half_axes(Vec3<T> const& size) {
    return {size.x, size.x, size.y};
  }

  static ShapeInertia inertia(std::array<double, 3> const& s, bool shell) {
    double constexpr pi = detail::pi;
    double const a = s[0];
    double const h = 2 * s[1];
    if (!shell) return {pi * a * a * h, {(3 * a * a + h * h) / 12, (3 * a * a + h * h) / 12, a * a / 2}};
    double const tube = 2 * pi * a * h, caps = 2 * pi * a * a, whole = tube + caps, mt = tube / whole, mc = caps / whole;
    double const across = mt * (a * a / 2 + h * h / 12) + mc * (a * a / 4 + h * h / 4);
    return {whole, {across, across, mt * a * a + mc * a * a / 2}};
  }
  static double bounding_radius(std::array<double, 3> const& s) { return std::hypot(s[0], s[1]); }
  static double area(std::array<double, 3> const& s) { return 2 * detail::pi * s[0] * (s[0] + 2 * s[1]); }
  static double thickness(std::array<double, 3> const& s) { return s[0]; }
  static SurfacePoint surface_point(std::array<double, 3> const& s, double t, double w) {
    double const side = 2 * s[1] / (s[0] + 2 * s[1]);  // share of the area
    if (t < side) {
      Vec3<double> const n = detail::on_circle(w);
      return {{s[0] * n.x, s[0] * n.y, s[1] * (2 * t / side - 1)}, n};
    }
    double const u = 2 * (t - side) / (1 - side), end = u < 1 ? 1 : -1, r = s[0] * std::sqrt(u - std::floor(u));
    Vec3<double> const c = detail::on_circle(w);
    return {{r * c.x, r * c.y, end * s[1]}, {0, 0, end}};
  }
};

}  // namespace gsp
