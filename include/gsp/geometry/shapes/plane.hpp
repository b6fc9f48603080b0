#pragma once
#include <gsp/geometry/shape.hpp>
#include <limits>

namespace gsp {

/// The half space z <= 0; its surface z = 0 is a patch of half sizes size.x, size.y where these are positive (rays and pictures alone).
struct PlaneShape {
  static constexpr ShapeType type = ShapeType::plane;
  static constexpr char const* name = "plane";
  static constexpr int positive_sizes = 0;
  static constexpr bool has_surface = true;

  /// Farther than any scene, and finite, so that the middle of a union of boxes is a number.
  template <class T>
  GSP_FUNCTION static T far() {
    return T(1e30);
  }
  template <class T>
  GSP_FUNCTION static Vec3<T> support(ShapeData<T> const&, Vec3<T> const& d) {
    T const across = far<T>();
    if (d.x == T(0) && d.y == T(0)) return {T(0), T(0), d.z < T(0) ? -across : T(0)};
    return {d.x < T(0) ? -across : across, d.y < T(0) ? -across : across, d.z < T(0) ? -across : T(0)};
  }
  template <class T>
  GSP_FUNCTION static Vec3<T> half_extents(ShapeData<T> const&, Mat3<T> const&) {
    return {far<T>(), far<T>(), far<T>()};
  }
  /// From above alone.
  template <class T>
  GSP_FUNCTION static T ray(ShapeData<T> const& s, Vec3<T> const& p, Vec3<T> const& v) {
    if (v.z > T(-1e-15)) return T(-1);
    T const x = -p.z / v.z;
    bool const on_patch = (s.size.x <= T(0) || abs(p.x + x * v.x) <= s.size.x) && (s.size.y <= T(0) || abs(p.y + x * v.y) <= s.size.y);
    return x >= T(0) && on_patch ? x : T(-1);
  }
  template <class T>
  GSP_FUNCTION static Vec3<T> half_axes(Vec3<T> const& size) {
    return size;
  }

  static ShapeInertia inertia(std::array<double, 3> const&, bool) { return {}; }  // weighs nothing
  static double bounding_radius(std::array<double, 3> const&) { return 0; }       // MuJoCo's mark of what is not bounded
  static double area(std::array<double, 3> const& s) { return 4 * s[0] * s[1]; }
  static double thickness(std::array<double, 3> const&) { return std::numeric_limits<double>::infinity(); }
  static SurfacePoint surface_point(std::array<double, 3> const& s, double t, double w) {
    return {{s[0] * (2 * t - 1), s[1] * (2 * w - 1), 0}, {0, 0, 1}};
  }
};

}  // namespace gsp
