#pragma once
#include <algorithm>
#include <gsp/geometry/shape.hpp>

namespace gsp {

/// size: half sizes.
struct BoxShape {
  static constexpr ShapeType type = ShapeType::box;
  static constexpr char const* name = "box";
  static constexpr int positive_sizes = 3;
  static constexpr bool has_surface = true;

  template <class T>
  GSP_FUNCTION static Vec3<T> support(ShapeData<T> const& s, Vec3<T> const& d) {
    return {d.x < T(0) ? -s.size.x : s.size.x, d.y < T(0) ? -s.size.y : s.size.y, d.z < T(0) ? -s.size.z : s.size.z};
  }
  template <class T>
  GSP_FUNCTION static Vec3<T> half_extents(ShapeData<T> const& s, Mat3<T> const& m) {
    return detail::box_extents(s.size, m);
  }
  template <class T>
  GSP_FUNCTION static T ray(ShapeData<T> const& s, Vec3<T> const& p, Vec3<T> const& v) {
    return detail::ray_box(s.size, p, v);
  }
  template <class T>
  GSP_FUNCTION static Vec3<T> half_axes(Vec3<T> const& size) {
    return size;
  }

  static ShapeInertia inertia(std::array<double, 3> const& s, bool shell) {
    double const a = s[0], b = s[1], c = s[2];
    if (!shell) return {8 * a * b * c, {(b * b + c * c) / 3, (a * a + c * c) / 3, (a * a + b * b) / 3}};
    double const x = 8 * b * c, y = 8 * a * c, z = 8 * a * b, whole = x + y + z;  // areas of the faces across x, y, z
    double const xx = a * a * (x + (y + z) / 3) / whole, yy = b * b * (y + (x + z) / 3) / whole, zz = c * c * (z + (x + y) / 3) / whole;
    return {whole, {yy + zz, xx + zz, xx + yy}};
  }
  static double bounding_radius(std::array<double, 3> const& s) { return std::hypot(s[0], s[1], s[2]); }
  static double area(std::array<double, 3> const& s) { return 8 * (s[0] * s[1] + s[1] * s[2] + s[2] * s[0]); }
  static double thickness(std::array<double, 3> const& s) { return std::min({s[0], s[1], s[2]}); }
  static SurfacePoint surface_point(std::array<double, 3> const& s, double t, double w) {
    double const areas[3] = {s[1] * s[2], s[2] * s[0], s[0] * s[1]};
    double u = t * (areas[0] + areas[1] + areas[2]);
    int axis = 0;
    while (axis < 2 && u >= areas[axis]) u -= areas[axis++];
    u = std::min(2 * u / areas[axis], std::nextafter(2., 0.));  // [0, 2): the two faces
    double const side = u < 1 ? 1 : -1;
    SurfacePoint r{{0, 0, 0}, {0, 0, 0}};
    int const b = (axis + 1) % 3;
    int const c = (axis + 2) % 3;
    r.p[axis] = side * s[axis];
    r.n[axis] = side;
    r.p[b] = s[b] * (2 * (u - std::floor(u)) - 1);
    r.p[c] = s[c] * (2 * w - 1);
    return r;
  }
};

}  // namespace gsp
