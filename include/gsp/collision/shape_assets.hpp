#pragma once
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
  Kokkos::View<int*, Mem> triangles, hulls;
  Kokkos::View<R*, Mem> elevations;

  /// Asset number `i`; none for -1.
  KOKKOS_INLINE_FUNCTION ShapeAsset<R> const* at(int i) const { return i < 0 ? nullptr : assets.data() + i; }
};

/// The assets of these geoms, each once; `index` (one for each geom of the list) says which asset is whose, -1 for primitives. A mesh whose
/// hull was not computed has all its vertices as its hull. Allocates; fences. Cost O(vertices + triangles + elevations).
template <class R, ExecutionSpace Exec>
ShapeAssets<R, typename Exec::memory_space> make_shape_assets(Exec const& exec, CompiledModel const& m, std::vector<int> const& geoms,
                                                              std::vector<int>& index) {
  ShapeAssets<R, typename Exec::memory_space> pool;
  index.assign(geoms.size(), -1);
  std::vector<ShapeAsset<R>> assets;
  struct Begin {
    std::size_t vertices, triangles, hulls, elevations;
  };
  std::vector<Begin> begins;
  std::vector<Vec3<R>> vertices;
  std::vector<int> triangles;
  std::vector<int> hulls;
  std::vector<R> elevations;
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
    begins.push_back({vertices.size(), triangles.size(), hulls.size(), elevations.size()});
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
  for (std::size_t i = 0; i < assets.size(); ++i) {
    assets[i].vertices = pool.vertices.data() + begins[i].vertices;
    assets[i].triangles = pool.triangles.data() + begins[i].triangles;
    assets[i].hull = pool.hulls.data() + begins[i].hulls;
    assets[i].elevation = pool.elevations.data() + begins[i].elevations;
  }
  pool.assets = detail::to_device<decltype(pool.assets)>(exec, "gsp::ShapeAssets::assets", assets);
  return pool;
}

}  // namespace gsp
