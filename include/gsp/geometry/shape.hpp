#pragma once
#include <array>
#include <gsp/math/quat.hpp>
#include <stdexcept>
#include <string>

/// The types of shapes, and what all of them have: sizes, and for meshes and height fields an asset. Each shape is one header in shapes/;
/// shapes.hpp lists them. No Kokkos: the compiler of models reads them, too.
namespace gsp {

enum class ShapeType : int { plane = 0, hfield = 1, sphere = 2, capsule = 3, ellipsoid = 4, cylinder = 5, box = 6, mesh = 7 };
inline constexpr int shape_types = 8;

/// What a mesh or a height field consists of, in the frame of its geom. Views of memory that others own.
template <class T>
struct ShapeAsset {
  // mesh
  Vec3<T> const* vertices = nullptr;  // [m]
  int const* triangles = nullptr;     // (triangle_count, 3) vertices, counter-clockwise seen from outside
  int const* hull = nullptr;          // (hull_count) vertices of its convex hull
  int vertex_count = 0, triangle_count = 0, hull_count = 0;
  // its hull's faces and edges, where they are known (face_count > 0)
  int const* face_first = nullptr;    // (face_count + 1) where a face's corners begin
  int const* face_corners = nullptr;  // vertices, 3 to 8 a face, counter-clockwise seen from outside; triangles of one plane are one face
  Vec3<T> const* face_normal = nullptr;  // (face_count) unit, outward
  int const* neighbor_first = nullptr;   // (hull_count + 1) where the neighbors of a vertex of the hull begin
  int const* neighbors = nullptr;        // numbers in `hull`
  int face_count = 0;
  // height field
  T const* elevation = nullptr;  // (rows, columns) 0..1: row along y, column along x
  int rows = 0, columns = 0;
  T extent[4] = {};  // half x, half y, top, base [m]: from z = -base up to top times elevation
};

/// Sizes as in GeomDescription, and the asset of a mesh or height field.
template <class T>
struct ShapeData {
  Vec3<T> size;
  ShapeAsset<T> const* asset = nullptr;
};

/// A shape in the world. A plane goes through p, normal = column 2 of R; its extent is not used by contacts: planes are infinite there.
template <class T>
struct Shape {
  Vec3<T> p;     // [m]
  Mat3<T> R;     // shape frame to world
  Vec3<T> size;  // [m]
  ShapeAsset<T> const* asset = nullptr;
};
template <class T>
GSP_FUNCTION Shape<T> make_shape(Transform<T> const& pose, Vec3<T> const& size, ShapeAsset<T> const* asset = nullptr) {
  return {pose.p, to_matrix(pose.q), size, asset};
}

/// Volume and moments of inertia of a shape about its centre along its own axes, per unit of density and of mass.
struct ShapeInertia {
  double measure = 0;               // volume [m^3]; of a shell its area [m^2]
  std::array<double, 3> moments{};  // of one kilogram [m^2]
};

/// A point of a surface and what part of the points drawn there to keep, so that they are even by area.
struct SurfacePoint {
  Vec3<double> p, n;  // in the shape's frame; n unit, outward
  double keep = 1;
};

namespace detail {

/// The nearer of two distances along a ray, where a negative one means none (-1).
template <class T>
GSP_FUNCTION T nearer(T a, T b) {
  if (a < T(0)) return b < T(0) ? T(-1) : b;
  return b < T(0) || a < b ? a : b;
}
/// Distances x with a x^2 + 2 b x + c = 0, near <= far; false where there are none.
template <class T>
struct RayRoots {
  bool real;
  T near, far;
};
template <class T>
GSP_FUNCTION RayRoots<T> ray_roots(T a, T b, T c) {
  T const determinant = b * b - a * c;
  if (!(a > T(1e-15)) || determinant < T(0)) return {false, T(-1), T(-1)};
  T const root = sqrt(determinant);
  return {true, (-b - root) / a, (-b + root) / a};
}
/// The first distance at which the ray p + x v meets the triangle a b c from either side, -1: it does not (Moeller and Trumbore, 1997).
template <class T>
GSP_FUNCTION T ray_triangle(Vec3<T> const& p, Vec3<T> const& v, Vec3<T> const& a, Vec3<T> const& b, Vec3<T> const& c) {
  Vec3<T> const e1 = b - a;
  Vec3<T> const e2 = c - a;
  Vec3<T> const h = cross(v, e2);
  T const determinant = dot(e1, h);
  if (determinant == T(0)) return T(-1);
  Vec3<T> const s = p - a;
  T const u = dot(s, h) / determinant;
  Vec3<T> const q = cross(s, e1);
  T const w = dot(v, q) / determinant;
  T const x = dot(e2, q) / determinant;
  return u >= T(0) && w >= T(0) && u + w <= T(1) && x >= T(0) ? x : T(-1);
}
/// The first distance at which the ray p + x v meets the box of half sizes s about the origin, from outside or inside; -1: it does not.
template <class T>
GSP_FUNCTION T ray_box(Vec3<T> const& s, Vec3<T> const& p, Vec3<T> const& v) {
  T best(-1);
  for (int i = 0; i < 3; ++i) {
    if (abs(v[i]) < T(1e-15)) continue;
    int const j = i == 2 ? 0 : i + 1;
    int const k = i == 0 ? 2 : i - 1;
    for (int side = -1; side <= 1; side += 2) {
      T const x = (T(side) * s[i] - p[i]) / v[i];
      bool const on_face = abs(p[j] + x * v[j]) <= s[j] && abs(p[k] + x * v[k]) <= s[k];
      if (x >= T(0) && on_face) best = nearer(best, x);
    }
  }
  return best;
}
/// Half extents of the axis-aligned box about a box that R turns: e_i = sum_k s_k |R_ik|.
template <class T>
GSP_FUNCTION Vec3<T> box_extents(Vec3<T> const& s, Mat3<T> const& m) {
  Vec3<T> e{T(0), T(0), T(0)};
  for (int i = 0; i < 3; ++i) e[i] = s.x * abs(m(i, 0)) + s.y * abs(m(i, 1)) + s.z * abs(m(i, 2));
  return e;
}

inline constexpr double pi = 3.14159265358979323846;
/// A point of the unit circle, x in [0, 1).
inline Vec3<double> on_circle(double x) { return {std::cos(2 * pi * x), std::sin(2 * pi * x), 0}; }
/// A point of the unit ball's surface, even by area in (t, w).
inline Vec3<double> on_ball(double t, double w) {
  double const z = 1 - 2 * t;
  double const r = std::sqrt(z * z < 1 ? 1 - z * z : 0);
  Vec3<double> const c = on_circle(w);
  return {r * c.x, r * c.y, z};
}
[[noreturn]] inline void has_none(char const* what, char const* name) {
  throw std::logic_error(std::string("gsp: a ") + name + " has no " + what + " that follows from its sizes");
}

}  // namespace detail

}  // namespace gsp
