#pragma once
#include <gsp/geometry/shape.hpp>

namespace gsp {

/// Triangles. Contacts see its convex hull, rays the triangles. size: half sizes of the box about the origin that holds it. Its inertia is
/// that of its volume (model/detail/mesh_inertia.hpp).
struct MeshShape {
  static constexpr ShapeType type = ShapeType::mesh;
  static constexpr char const* name = "mesh";
  static constexpr int positive_sizes = 0;
  static constexpr bool has_surface = false;

  /// Of the hull: the first of its vertices that lies farthest. Cost O(vertices of the hull).
  template <class T>
  GSP_FUNCTION static Vec3<T> support(ShapeData<T> const& s, Vec3<T> const& d) {
    ShapeAsset<T> const& a = *s.asset;
    Vec3<T> best = a.vertices[a.hull[0]];
    T most = dot(best, d);
    for (int i = 1; i < a.hull_count; ++i) {
      Vec3<T> const& v = a.vertices[a.hull[i]];
      T const along = dot(v, d);
      if (along > most) {
        most = along;
        best = v;
      }
    }
    return best;
  }
  /// Of its box, in constant time: it holds the mesh, and touches it where R is the identity.
  template <class T>
  GSP_FUNCTION static Vec3<T> half_extents(ShapeData<T> const& s, Mat3<T> const& m) {
    return detail::box_extents(s.size, m);
  }
  /// Cost O(triangles).
  template <class T>
  GSP_FUNCTION static T ray(ShapeData<T> const& s, Vec3<T> const& p, Vec3<T> const& v) {
    ShapeAsset<T> const& a = *s.asset;
    T best(-1);
    for (int i = 0; i < a.triangle_count; ++i) {
      int const* const t = a.triangles + 3 * i;
      best = detail::nearer(best, detail::ray_triangle(p, v, a.vertices[t[0]], a.vertices[t[1]], a.vertices[t[2]]));
    }
    return best;
  }
  template <class T>
  GSP_FUNCTION static Vec3<T> half_axes(Vec3<T> const& size) {
    return size;
  }

  static ShapeInertia inertia(std::array<double, 3> const&, bool) { detail::has_none("inertia", name); }
  static double bounding_radius(std::array<double, 3> const& s) { return std::sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]); }
  static double area(std::array<double, 3> const&) { detail::has_none("area", name); }
  static double thickness(std::array<double, 3> const&) { detail::has_none("thickness", name); }
  static SurfacePoint surface_point(std::array<double, 3> const&, double, double) { detail::has_none("surface", name); }
};

}  // namespace gsp
