#pragma once
#include <gsp/geometry/shape.hpp>
#include <gsp/geometry/shapes/box.hpp>

namespace gsp {

/// The solid below a grid of heights, down to z = -base. size (half x, half y, top / 4 + base / 2) is MuJoCo's: it weighs as that box.
struct HfieldShape {
  static constexpr ShapeType type = ShapeType::hfield;
  static constexpr char const* name = "hfield";
  static constexpr int positive_sizes = 0;
  static constexpr bool has_surface = false;

  /// Where the grid's point (row, column) stands.
  template <class T>
  GSP_FUNCTION static Vec3<T> point(ShapeAsset<T> const& a, int row, int column) {
    T const x = a.columns > 1 ? T(2) * T(column) / T(a.columns - 1) - T(1) : T(0);
    T const y = a.rows > 1 ? T(2) * T(row) / T(a.rows - 1) - T(1) : T(0);
    return {a.extent[0] * x, a.extent[1] * y, a.extent[2] * a.elevation[row * a.columns + column]};
  }
  /// Of its convex hull: the heights and the corners of the base. Cost O(rows columns).
  template <class T>
  GSP_FUNCTION static Vec3<T> support(ShapeData<T> const& s, Vec3<T> const& d) {
    ShapeAsset<T> const& a = *s.asset;
    Vec3<T> best{d.x < T(0) ? -a.extent[0] : a.extent[0], d.y < T(0) ? -a.extent[1] : a.extent[1], -a.extent[3]};
    T most = dot(best, d);
    for (int r = 0; r < a.rows; ++r)
      for (int c = 0; c < a.columns; ++c) {
        Vec3<T> const v = point(a, r, c);
        T const along = dot(v, d);
        if (along > most) {
          most = along;
          best = v;
        }
      }
    return best;
  }
  /// Of the box about the origin that holds it, in constant time.
  template <class T>
  GSP_FUNCTION static Vec3<T> half_extents(ShapeData<T> const& s, Mat3<T> const& m) {
    ShapeAsset<T> const& a = *s.asset;
    return detail::box_extents(Vec3<T>{a.extent[0], a.extent[1], max(a.extent[2], a.extent[3])}, m);
  }
  /// The base as a box, two triangles a cell of the grid, and the four sides below its edges. Cost O(rows columns).
  template <class T>
  GSP_FUNCTION static T ray(ShapeData<T> const& s, Vec3<T> const& p, Vec3<T> const& v) {
    ShapeAsset<T> const& a = *s.asset;
    T const half_base = T(0.5) * a.extent[3];
    T best = detail::ray_box(Vec3<T>{a.extent[0], a.extent[1], half_base}, Vec3<T>{p.x, p.y, p.z + half_base}, v);
    auto const triangle = [&](Vec3<T> const& x, Vec3<T> const& y, Vec3<T> const& z) {
      best = detail::nearer(best, detail::ray_triangle(p, v, x, y, z));
    };
    for (int r = 0; r + 1 < a.rows; ++r)
      for (int c = 0; c + 1 < a.columns; ++c) {
        Vec3<T> const low = point(a, r, c);
        Vec3<T> const high = point(a, r + 1, c + 1);
        triangle(low, high, point(a, r, c + 1));
        triangle(low, high, point(a, r + 1, c));
      }
    auto const wall = [&](Vec3<T> const& x, Vec3<T> const& y) {
      Vec3<T> const below_x{x.x, x.y, T(0)};
      Vec3<T> const below_y{y.x, y.y, T(0)};
      triangle(x, y, below_x);
      triangle(below_x, y, below_y);
    };
    for (int c = 0; c + 1 < a.columns; ++c) {
      wall(point(a, 0, c), point(a, 0, c + 1));
      wall(point(a, a.rows - 1, c), point(a, a.rows - 1, c + 1));
    }
    for (int r = 0; r + 1 < a.rows; ++r) {
      wall(point(a, r, 0), point(a, r + 1, 0));
      wall(point(a, r, a.columns - 1), point(a, r + 1, a.columns - 1));
    }
    return best;
  }
  template <class T>
  GSP_FUNCTION static Vec3<T> half_axes(Vec3<T> const& size) {
    return size;
  }

  static ShapeInertia inertia(std::array<double, 3> const& s, bool shell) { return BoxShape::inertia(s, shell); }
  static double bounding_radius(std::array<double, 3> const&) { detail::has_none("bounding sphere", name); }  // its asset has
  static double area(std::array<double, 3> const&) { detail::has_none("area", name); }
  static double thickness(std::array<double, 3> const&) { detail::has_none("thickness", name); }
  static SurfacePoint surface_point(std::array<double, 3> const&, double, double) { detail::has_none("surface", name); }
};

}  // namespace gsp
