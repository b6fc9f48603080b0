#pragma once
#include <cstdlib>
#include <gsp/geometry/shapes/box.hpp>
#include <gsp/geometry/shapes/capsule.hpp>
#include <gsp/geometry/shapes/cylinder.hpp>
#include <gsp/geometry/shapes/ellipsoid.hpp>
#include <gsp/geometry/shapes/hfield.hpp>
#include <gsp/geometry/shapes/mesh.hpp>
#include <gsp/geometry/shapes/plane.hpp>
#include <gsp/geometry/shapes/sphere.hpp>

/// The list of shapes, and what each can be asked for by its type. A number that is no type stops the program: nothing is guessed.
namespace gsp {

/// f(S{}) for the struct S of the type. The one list of shapes: the compiler names a type that is missing here.
#if defined(__CUDACC__)
#pragma nv_exec_check_disable  // f may be the host's alone
#endif
template <class F>
GSP_FUNCTION decltype(auto) visit_shape(ShapeType type, F const& f) {
  switch (type) {
    case ShapeType::plane:
      return f(PlaneShape{});
    case ShapeType::hfield:
      return f(HfieldShape{});
    case ShapeType::sphere:
      return f(SphereShape{});
    case ShapeType::capsule:
      return f(CapsuleShape{});
    case ShapeType::ellipsoid:
      return f(EllipsoidShape{});
    case ShapeType::cylinder:
      return f(CylinderShape{});
    case ShapeType::box:
      return f(BoxShape{});
    case ShapeType::mesh:
      return f(MeshShape{});
  }
#if defined(__CUDA_ARCH__)
  __trap();
  __builtin_unreachable();
#else
  std::abort();
#endif
}

/// A point of the shape (of its convex hull) that lies farthest along d, in the shape's frame; d of any length. A plane's lies 1e30 m away,
/// or in its surface.
template <class T>
GSP_FUNCTION Vec3<T> support(ShapeType type, ShapeData<T> const& s, Vec3<T> const& d) {
  return visit_shape(type, [&](auto shape) { return shape.support(s, d); });
}
/// Half extents of an axis-aligned box about the shape's origin, for a shape that R turns. Tight for primitives; of the local box for
/// meshes and height fields; 1e30 m for a plane.
template <class T>
GSP_FUNCTION Vec3<T> half_extents(ShapeType type, ShapeData<T> const& s, Mat3<T> const& R) {
  return visit_shape(type, [&](auto shape) { return shape.half_extents(s, R); });
}
/// The least x >= 0 at which p + x v (in the shape's frame) meets its surface, from outside or inside; -1: it does not. As MuJoCo's
/// mju_rayGeom, mj_rayMesh and mj_rayHfield.
template <class T>
GSP_FUNCTION T ray(ShapeType type, ShapeData<T> const& s, Vec3<T> const& p, Vec3<T> const& v) {
  return visit_shape(type, [&](auto shape) { return shape.ray(s, p, v); });
}
/// Half axes of the ellipsoid that stands for the shape in a fluid, as MuJoCo has them.
template <class T>
GSP_FUNCTION Vec3<T> half_axes(ShapeType type, Vec3<T> const& size) {
  return visit_shape(type, [&](auto shape) { return shape.half_axes(size); });
}

inline char const* shape_name(ShapeType type) {
  return visit_shape(type, [](auto shape) { return shape.name; });
}
/// How many of the sizes must be positive.
inline int positive_sizes(ShapeType type) {
  return visit_shape(type, [](auto shape) { return shape.positive_sizes; });
}
/// Whether points can be drawn on its surface by `surface_point`.
inline bool has_surface(ShapeType type) {
  return visit_shape(type, [](auto shape) { return shape.has_surface; });
}
/// Closed forms; std::logic_error for meshes. Planes weigh nothing.
inline ShapeInertia shape_inertia(ShapeType type, std::array<double, 3> const& size, bool shell) {
  return visit_shape(type, [&](auto shape) { return shape.inertia(size, shell); });
}
/// Radius of the bounding sphere about the origin; 0 for planes; std::logic_error for height fields.
inline double bounding_radius(ShapeType type, std::array<double, 3> const& size) {
  return visit_shape(type, [&](auto shape) { return shape.bounding_radius(size); });
}
/// Area of the surface [m^2]; this and the next two throw std::logic_error where `has_surface` is false.
inline double surface_area(ShapeType type, std::array<double, 3> const& size) {
  return visit_shape(type, [&](auto shape) { return shape.area(size); });
}
/// Half of the least width, about [m].
inline double thickness(ShapeType type, std::array<double, 3> const& size) {
  return visit_shape(type, [&](auto shape) { return shape.thickness(size); });
}
/// The point of the surface for (t, w) in [0, 1)^2, even by area after thinning by `keep`: t also chooses the face.
inline SurfacePoint surface_point(ShapeType type, std::array<double, 3> const& size, double t, double w) {
  return visit_shape(type, [&](auto shape) { return shape.surface_point(size, t, w); });
}

}  // namespace gsp
