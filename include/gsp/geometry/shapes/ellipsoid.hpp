#pragma once
#include <gsp/geometry/shape.hpp>

namespace gsp {

/// size: half axes.
struct EllipsoidShape {
  static constexpr ShapeType type = ShapeType::ellipsoid;
  static constexpr char const* name = "ellipsoid";
  static constexpr int positive_sizes = 3;
  static constexpr bool has_surface = true;

  /// A ball stretched by S: S S d / |S d|.
  template <class T>
  GSP_FUNCTION static Vec3<T> support(ShapeData<T> const& s, Vec3<T> const& d) {
    Vec3<T> const n = normalized(Vec3<T>{s.size.x * d.x, s.size.y * d.y, s.size.z * d.z});
    return {s.size.x * n.x, s.size.y * n.y, s.size.z * n.z};
  }
  /// e_i = sqrt(sum_k (s_k R_ik)^2)
  template <class T>
  GSP_FUNCTION static Vec3<T> half_extents(ShapeData<T> const& s, Mat3<T> const& m) {
    Vec3<T> e{T(0), T(0), T(0)};
    for (int i = 0; i < 3; ++i) e[i] = norm(Vec3<T>{s.size.x * m(i, 0), s.size.y * m(i, 1), s.size.z * m(i, 2)});
    return e;
  }
  template <class T>
  GSP_FUNCTION static T ray(ShapeData<T> const& s, Vec3<T> const& p, Vec3<T> const& v) {
    Vec3<T> const q{p.x / s.size.x, p.y / s.size.y, p.z / s.size.z};  // the ball of radius 1
    Vec3<T> const w{v.x / s.size.x, v.y / s.size.y, v.z / s.size.z};
    auto const x = detail::ray_roots(dot(w, w), dot(w, q), dot(q, q) - T(1));
    return detail::nearer(x.near, x.far);
  }
  template <class T>
  GSP_FUNCTION static Vec3<T> half_axes(Vec3<T> const& size) {
    return size;
  }

  static ShapeInertia inertia(std::array<double, 3> const& s, bool) {
    double const a = s[0] * s[0], b = s[1] * s[1], c = s[2] * s[2];
    return {detail::pi * s[0] * s[1] * s[2] * 4 / 3, {(b + c) / 5, (a + c) / 5, (a + b) / 5}};
  }
  static double bounding_radius(std::array<double, 3> const& s) { return std::fmax(s[0], std::fmax(s[1], s[2])); }
  /// Thomsen's formula, within 1.1 %.
  static double area(std::array<double, 3> const& s) {
    double const k = 1.6075, a = std::pow(s[0] * s[1], k), b = std::pow(s[1] * s[2], k), c = std::pow(s[2] * s[0], k);
    return 4 * detail::pi * std::pow((a + b + c) / 3, 1 / k);
  }
  static double thickness(std::array<double, 3> const& s) { return std::fmin(s[0], std::fmin(s[1], s[2])); }
  /// Even over the ball of directions; `keep` is the ratio of areas, ellipsoid over ball, against its largest.
  static SurfacePoint surface_point(std::array<double, 3> const& s, double t, double w) {
    Vec3<double> const d = detail::on_ball(t, w);
    double const widest = std::fmax(s[0] * s[1], std::fmax(s[1] * s[2], s[2] * s[0]));
    return {{s[0] * d.x, s[1] * d.y, s[2] * d.z},
            normalized(Vec3<double>{d.x / s[0], d.y / s[1], d.z / s[2]}),
            norm(Vec3<double>{s[1] * s[2] * d.x, s[2] * s[0] * d.y, s[0] * s[1] * d.z}) / widest};
  }
};

}  // namespace gsp
