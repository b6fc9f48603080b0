#pragma once
#include <array>
#include <cmath>
#include <gsp/core/check.hpp>
#include <gsp/ray/detail/box_tree.hpp>
#include <gsp/ray/detail/ray_triangle.hpp>
#include <string>
#include <vector>

/// A tree of boxes over the triangles of a mesh (ray/detail/box_tree.hpp), made once on the host: a ray looks at the triangles near its way
/// alone. No Kokkos.
namespace gsp {

struct alignas(16) RayTriangle {
  Vec3<float> a;
  int face;  // of the mesh
  Vec3<float> b;
  int unused_b;
  Vec3<float> c;
  int unused_c;
};
/// Triangles in the order of the leaves. The first node is the root.
struct MeshTree {
  std::vector<RayNode> nodes;
  std::vector<RayTriangle> triangles;
};
/// The tree over a mesh's faces, corners in `vertices`. Host. A face with a number that is not finite is left out: nothing meets it.
/// Errors: std::invalid_argument for a vertex that is not there, and for 2^28 faces or more.
inline MeshTree make_mesh_tree(std::vector<std::array<float, 3>> const& vertices, std::vector<std::array<int, 3>> const& faces) {
  expects(faces.size() < most_ray_items, "gsp::make_mesh_tree: a mesh of 2^28 faces or more: take it apart");
  detail::BoxTreeBuilder builder(faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    detail::RayBox box;
    bool finite = true;
    for (int const v : faces[f]) {
      expects(v >= 0 && std::size_t(v) < vertices.size(), "gsp::make_mesh_tree: face " + std::to_string(f) + " has a vertex " +
                                                              std::to_string(v) + ", and there are " + std::to_string(vertices.size()));
      auto const& p = vertices[std::size_t(v)];
      box.add({p[0], p[1], p[2]});
      finite = finite && std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
    }
    if (finite) builder.add(box, int(f));  // else nothing meets it
  }
  MeshTree tree;
  tree.nodes = builder.build([&](int face) {
    auto const corner = [&](int i) {
      auto const& p = vertices[std::size_t(faces[std::size_t(face)][std::size_t(i)])];
      return Vec3<float>{p[0], p[1], p[2]};
    };
    tree.triangles.push_back({corner(0), face, corner(1), 0, corner(2), 0});
  });
  return tree;
}

/// The nearest hit of a mesh: x, infinity where there is none, and which face; of faces at one x the first of the mesh.
template <class T>
struct MeshHit {
  T x = detail::no_hit<T>();
  int face = -1;
  int triangle = -1;  // its place in the tree
};

namespace detail {
/// Which triangles rays meet, in the order of a tree's leaves: T is one ray's number or those of a pack of rays, which go through the tree
/// together.
template <class T>
struct TrianglesMet {
  T x;
  LaneIndex<T> face{}, triangle{};  // -1: none
};
/// ray_mesh of rays that are scaled, with x < most.
template <class T>
GSP_FUNCTION TrianglesMet<T> meet_triangles(RayNode const* nodes, RayTriangle const* triangles, Ray<T> const& ray, T const& most) {
  TriangleRay<T> const through(ray);
  TrianglesMet<T> best{most};
  auto const take_leaf = [&](int first, int end) {
    for (int t = first; t < end; ++t) {
      RayTriangle const& triangle = triangles[t];
      T const x = through.hit(triangle.a, triangle.b, triangle.c);
      auto const nearer = x < best.x || (x == best.x && best.face.is_above(triangle.face));
      if (!any(nearer)) continue;
      best.x = select(nearer, x, best.x);
      best.face.set(nearer, triangle.face);
      best.triangle.set(nearer, t);
    }
  };
  visit_leaves(
      nodes, BoxRay<T>(ray), [&] { return best.x; }, take_leaf);
  return best;
}
}  // namespace detail

/// The nearest hit of the ray, in the mesh's frame. NaN, infinity and a direction of 0 miss. Cost: of a mesh of thousands of triangles
/// about 20 nodes and 4 triangles.
template <class T>
GSP_FUNCTION MeshHit<T> ray_mesh(RayNode const* nodes, RayTriangle const* triangles, Ray<T> const& ray) {
  if (!detail::is_ray(ray)) return {};
  detail::ScaledRay<T> const scaled(ray);
  auto const met = detail::meet_triangles(nodes, triangles, scaled.ray, detail::no_hit<T>());
  return {scaled.back(met.x), met.face[0], met.triangle[0]};
}

}  // namespace gsp
