#pragma once
#include <gsp/collision/detail/hull_faces.hpp>
#include <gsp/core/detail/views.hpp>
#include <gsp/geometry/shape.hpp>
#include <gsp/model/compiled.hpp>
#include <map>
#include <utility>
#include <vector>

/// The pool of meshes and height fields that shapes point into (ShapeData::asset), on the device.
namespace gsp {

template <class R, class Mem>
struct ShapeAssets {
  Kokkos::View<ShapeAsset<R>*, Mem> assets;
  Kokkos::View<Vec3<R>*, Mem> vertices;
  Kokkos::View<Vec3<R>*, Mem> normals;
  Kokkos::View<int*, Mem> triangles, hulls;
  Kokkos::View<int*, Mem> face_first, face_corners, neighbor_first, neighbors;
  Kokkos::View<R*, Mem> elevations;

  /// Asset number `i`; none for -1.
  KOKKOS_INLINE_FUNCTION ShapeAsset<R> const* at(int i) const { return i < 0 ? nullptr : assets.data() + i; }
};

/// The assets of these geoms, each once; `index` (one for each geom of the list) says which asset is whose, -1 for primitives. A mesh whose
/// hull was not computed has all its vertices as its hull, and no faces: its contacts are single points. Allocates; fences. Cost
/// O(vertices + triangles + elevations), n log n for the n triangles of a hull.
template <class R, ExecutionSpace Exec>
ShapeAssets<R, typename Exec::memory_space> make_shape_assets(Exec const& exec, CompiledModel const& m, std::vector<int> const& geoms,
                                                              std::vector<int>& index) {
  ShapeAssets<R, typename Exec::memory_space> pool;
  index.assign(geoms.size(), -1);
  std::vector<ShapeAsset<R>> assets;
  struct Begin {
    std::size_t vertices, triangles, hulls, elevations, normals, face_first, face_corners, neighbor_first, neighbors;
  };
  std::vector<Begin> begins;
  std::vector<Vec3<R>> vertices;
  std::vector<int> triangles;
  std::vector<int> hulls;
  std::vector<R> elevations;
  std::vector<Vec3<R>> normals;
  std::vector<int> face_first, face_corners, neighbor_first, neighbors;
  std::map<std::pair<int, int>, int> known;  // (type, number of the mesh or height field)
  for (std::size_t i = 0; i < geoms.size(); ++i) {
    int const g = geoms[i];
    ShapeType const type{m.geom_type[g]};
    if (type != ShapeType::mesh && type != ShapeType::hfield) continue;
    int const number = m.geom_data[g];
    auto const [entry, fresh] = known.try_emplace({int(type), number}, int(assets.size()));
    index[i] = entry->second;
    if (!fresh) continue;
    ShapeAsset<R> asset;
    begins.push_back({vertices.size(), triangles.size(), hulls.size(), elevations.size(), normals.size(), face_first.size(),
                      face_corners.size(), neighbor_first.size(), neighbors.size()});
    if (type == ShapeType::mesh) {
      auto const& points = m.mesh_vertices[number];
      auto const& hull = m.mesh_hull[number];
      for (auto const& v : points) vertices.push_back({R(v[0]), R(v[1]), R(v[2])});
      for (auto const& t : m.mesh_faces[number]) triangles.insert(triangles.end(), t.begin(), t.end());
      hulls.insert(hulls.end(), hull.begin(), hull.end());
      for (int v = 0; hull.empty() && v < int(points.size()); ++v) hulls.push_back(v);
      asset.vertex_count = int(points.size());
      asset.triangle_count = int(m.mesh_faces[number].size());
      asset.hull_count = int(hulls.size() - begins.back().hulls);
      if (std::size_t(number) < m.mesh_hull_faces.size() && !m.mesh_hull_faces[number].empty()) {
        auto const faces = detail::hull_faces(points, hull, m.mesh_hull_faces[number]);
        asset.face_count = int(faces.normal.size());
        for (auto const& n : faces.normal) normals.push_back({R(n.x), R(n.y), R(n.z)});
        face_first.insert(face_first.end(), faces.first.begin(), faces.first.end());
        face_corners.insert(face_corners.end(), faces.corners.begin(), faces.corners.end());
        neighbor_first.insert(neighbor_first.end(), faces.neighbor_first.begin(), faces.neighbor_first.end());
        neighbors.insert(neighbors.end(), faces.neighbors.begin(), faces.neighbors.end());
      }
    } else {
      auto const& field = m.hfields[number];
      for (float e : field.elevation) elevations.push_back(R(e));
      asset.rows = field.rows;
      asset.columns = field.columns;
      for (int k = 0; k < 4; ++k) asset.extent[k] = R(field.size[k]);
    }
    assets.push_back(asset);
  }
  pool.vertices = detail::to_device<decltype(pool.vertices)>(exec, "gsp::ShapeAssets::vertices", vertices);
  pool.triangles = detail::to_device<decltype(pool.triangles)>(exec, "gsp::ShapeAssets::triangles", triangles);
  pool.hulls = detail::to_device<decltype(pool.hulls)>(exec, "gsp::ShapeAssets::hulls", hulls);
  pool.elevations = detail::to_device<decltype(pool.elevations)>(exec, "gsp::ShapeAssets::elevations", elevations);
  pool.normals = detail::to_device<decltype(pool.normals)>(exec, "gsp::ShapeAssets::normals", normals);
  pool.face_first = detail::to_device<decltype(pool.face_first)>(exec, "gsp::ShapeAssets::face_first", face_first);
  pool.face_corners = detail::to_device<decltype(pool.face_corners)>(exec, "gsp::ShapeAssets::face_corners", face_corners);
  pool.neighbor_first = detail::to_device<decltype(pool.neighbor_first)>(exec, "gsp::ShapeAssets::neighbor_first", neighbor_first);
  pool.neighbors = detail::to_device<decltype(pool.neighbors)>(exec, "gsp::ShapeAssets::neighbors", neighbors);
  for (std::size_t i = 0; i < assets.size(); ++i) {
    assets[i].vertices = pool.vertices.data() + begins[i].vertices;
    assets[i].triangles = pool.triangles.data() + begins[i].triangles;
    assets[i].hull = pool.hulls.data() + begins[i].hulls;
    assets[i].elevation = pool.elevations.data() + begins[i].elevations;
    assets[i].face_normal = pool.normals.data() + begins[i].normals;
    assets[i].face_first = pool.face_first.data() + begins[i].face_first;
    assets[i].face_corners = pool.face_corners.data() + begins[i].face_corners;
    assets[i].neighbor_first = pool.neighbor_first.data() + begins[i].neighbor_first;
    assets[i].neighbors = pool.neighbors.data() + begins[i].neighbors;
  }
  pool.assets = detail::to_device<decltype(pool.assets)>(exec, "gsp::ShapeAssets::assets", assets);
  return pool;
}

}  // namespace gsp
