#pragma once
#include <gsp/geometry/shape.hpp>

namespace gsp {

/// size: radius.
struct SphereShape {
  static constexpr ShapeType type = ShapeType::sphere;
  static constexpr char const* name = "sphere";
  static constexpr int positive_sizes = 1;
  static constexpr bool has_surface = true;

  template <class T>
  GSP_FUNCTION static Vec3<T> support(ShapeData<T> const& s, Vec3<T> const& d) {
    return s.size.x * normalized(d);
  }
  template <class T>
  GSP_FUNCTION static Vec3<T> half_extents(ShapeData<T> const& s, Mat3<T> const&) {
    return {s.size.x, s.size.x, s.size.x};
  }
  template <class T>
  GSP_FUNCTION static T ray(ShapeData<T> const& s, Vec3<T> const& p, Vec3<T> const& v) {
    auto const x = detail::ray_roots(dot(v, v), dot(v, p), dot(p, p) - s.size.x * s.size.x);
    return detail::nearer(x.near, x.far);
  }
  template <class T>
  GSP_FUNCTION static Vec3<T> half_axes(Vec3<T> const& size) {
    return {size.x, size.x, size.x};
  }

  static ShapeInertia inertia(std::array<double, 3> const& s, bool shell) {
    double const a = s[0];
    double const moment = shell ? a * a * 2 / 3 : a * a * 2 / 5;
    return {shell ? 4 * detail::pi * a * a : detail::pi * a * a * a * 4 / 3, {moment, moment, moment}};
  }
  static double bounding_radius(std::array<double, 3> const& s) { return s[0]; }
  static double area(std::array<double, 3> const& s) { return 4 * detail::pi * s[0] * s[0]; }
  static double thickness(std::array<double, 3> const& s) { return s[0]; }
  static SurfacePoint surface_point(std::array<double, 3> const& s, double t, double w) {
    Vec3<double> const n = detail::on_ball(t, w);
    return {s[0] * n, n};
  }
};

}  // namespace gsp
