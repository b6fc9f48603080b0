#pragma once
#include <algorithm>
#include <cmath>
#include <gsp/collision/shape_assets.hpp>
#include <gsp/core/region.hpp>
#include <gsp/geometry/shapes.hpp>
#include <gsp/model/detail/sizes.hpp>
#include <gsp/model/detail/stamp.hpp>
#include <gsp/model/model.hpp>
#include <gsp/model/poses.hpp>
#include <gsp/ray/mesh_tree.hpp>
#include <gsp/ray/ray_height_field.hpp>
#include <map>
#include <string>
#include <vector>

/// What rays may meet: the geoms of a model, also those that touch nothing, in all worlds. Meshes are their triangles, not their hulls, and
/// turned as in their file: what was drawn along axes, as floors and walls are, has small boxes there, which it has not along its principal
/// axes of inertia.
namespace gsp {

struct RaySceneOptions {
  int worlds = 1;
  std::uint32_t groups = 0x3f;  // bit g: geoms of group g, 0 to 5
  bool statics = true;          // geoms that are fixed to the world
};

/// A geom of the scene. Those that are transparent (alpha 0 of the material, or of the geom where it has none) are not in it.
template <class R>
struct RayGeom {
  ShapeType type;
  int geom, body;
  Vec3<R> size;
  RayNode const* nodes;          // mesh
  RayTriangle const* triangles;  // mesh
  ShapeAsset<R> const* height_field;
  Quat<R> turn;  // from the frame here to the model's frame of the geom, about one origin
};
namespace detail {
struct PlacedStamp {
  bool placed = false;  // place_ray_geoms has been called
  Stamp poses;          // with these
};
}  // namespace detail

/// `make_ray_scene` makes it, `place_ray_geoms` says where its geoms are.
template <class R, class Mem>
struct RayScene {
  using real_type = R;
  using memory_space = Mem;
  int worlds = 0;
  detail::ModelSizes model{};  // host: of which model
  Kokkos::View<RayGeom<R>*, Mem> geoms;
  Kokkos::View<R*, Mem> radius;  // (geoms + room) of a ball about its frame that it lies in [m]; infinite: a plane
  Kokkos::View<Mat3<R>**, Kokkos::LayoutRight, Mem> turn;  // (worlds, geoms) from its frame to the world's
  Kokkos::View<R***, Kokkos::LayoutRight, Mem> place;      // (worlds, 3, geoms + room) origin of its frame [m]
  static constexpr int room = is_device<typename Mem::execution_space> ? 0 : native_width<R> - 1;  // hosts look at a vector of them
  Kokkos::View<RayNode*, Mem> nodes;                                                               // of all meshes
  Kokkos::View<RayTriangle*, Mem> triangles;
  ShapeAssets<R, Mem> height_fields;
  bool moves = false;                               // host: one of its geoms is on a body that is not fixed to the world
  detail::SharedStamp<detail::PlacedStamp> placed;  // host: of which poses places are (dynamics/stamps.hpp)
  KOKKOS_INLINE_FUNCTION int count() const { return int(geoms.extent(0)); }
};

/// The geoms of the model that was made from `compiled`, with their sizes there: what a collision model has of its own by world is not
/// seen. Allocates; fences. Cost: n log n of the triangles of meshes. Errors: std::invalid_argument for worlds < 1, another compiled model.
template <class R, ExecutionSpace Exec, class Mem>
RayScene<R, Mem> make_ray_scene(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled, RaySceneOptions options = {}) {
  expects(options.worlds > 0, "gsp::make_ray_scene: worlds must be positive and is " + std::to_string(options.worlds));
  static_assert(std::is_same_v<Mem, typename Exec::memory_space>,
                "gsp::make_ray_scene: the model lies in another memory space than exec's");
  detail::expects_made_of("gsp::make_ray_scene", model, compiled);
  RayScene<R, Mem> scene;
  scene.worlds = options.worlds;
  scene.model = detail::sizes_of(model);
  std::vector<int> shown, fields;
  for (int g = 0; g < int(compiled.geom_type.size()); ++g) {
    std::size_t const i = std::size_t(g);
    int const group = std::clamp(compiled.geom_group[i], 0, 5);
    float const of_material = compiled.geom_material_alpha.empty() ? -1 : compiled.geom_material_alpha[i];
    if ((of_material < 0 ? compiled.geom_rgba[i][3] : of_material) == 0 || (options.groups >> group & 1u) == 0) continue;
    if (!options.statics && compiled.body_weld[std::size_t(compiled.geom_body[i])] == 0) continue;
    shown.push_back(g);
    scene.moves = scene.moves || compiled.body_weld[std::size_t(compiled.geom_body[i])] != 0;
    if (ShapeType(compiled.geom_type[i]) == ShapeType::hfield) fields.push_back(g);
  }
  std::vector<int> index;
  scene.height_fields = make_shape_assets<R>(exec, compiled, fields, index);
  struct Begin {
    std::size_t nodes, triangles;
  };
  std::vector<RayNode> nodes;
  std::vector<RayTriangle> triangles;
  std::map<int, Begin> meshes;
  for (int const g : shown) {
    std::size_t const i = std::size_t(g), mesh = std::size_t(compiled.geom_data[i]);
    if (ShapeType(compiled.geom_type[i]) != ShapeType::mesh || meshes.count(int(mesh)) > 0) continue;
    meshes[int(mesh)] = {nodes.size(), triangles.size()};
    auto vertices = compiled.mesh_vertices[mesh];
    auto const& q = compiled.mesh_quat[mesh];
    for (auto& v : vertices) {
      auto const turned = rotate(Quat<double>{q[0], q[1], q[2], q[3]}, Vec3<double>{v[0], v[1], v[2]});
      for (int k = 0; k < 3; ++k) v[std::size_t(k)] = float(turned[k]);
    }
    auto const tree = make_mesh_tree(vertices, compiled.mesh_faces[mesh]);
    nodes.insert(nodes.end(), tree.nodes.begin(), tree.nodes.end());
    triangles.insert(triangles.end(), tree.triangles.begin(), tree.triangles.end());
  }
  scene.nodes = detail::to_device<decltype(scene.nodes)>(exec, "gsp::RayScene::nodes", nodes);
  scene.triangles = detail::to_device<decltype(scene.triangles)>(exec, "gsp::RayScene::triangles", triangles);
  std::vector<RayGeom<R>> geoms;
  std::vector<R> radii;
  std::size_t field = 0;
  for (int const g : shown) {
    std::size_t const i = std::size_t(g);
    auto const& s = compiled.geom_size[i];
    RayGeom<R> geom{ShapeType(compiled.geom_type[i]),
                    g,
                    compiled.geom_body[i],
                    {R(s[0]), R(s[1]), R(s[2])},
                    nullptr,
                    nullptr,
                    nullptr,
                    identity_quat<R>()};
    double radius = 0;
    if (geom.type == ShapeType::plane) {
      radius = detail::no_hit<double>();
    } else if (geom.type == ShapeType::mesh) {
      std::size_t const mesh = std::size_t(compiled.geom_data[i]);
      for (auto const& v : compiled.mesh_vertices[mesh]) radius = std::max(radius, std::hypot(double(v[0]), double(v[1]), double(v[2])));
      auto const& q = compiled.mesh_quat[mesh];
      geom.turn = {R(q[0]), R(-q[1]), R(-q[2]), R(-q[3])};
      geom.nodes = scene.nodes.data() + meshes.at(int(mesh)).nodes;
      geom.triangles = scene.triangles.data() + meshes.at(int(mesh)).triangles;
    } else if (geom.type == ShapeType::hfield) {
      auto const& e = compiled.hfields[std::size_t(compiled.geom_data[i])].size;
      radius = std::hypot(e[0], e[1], std::max(e[2], e[3]));
      geom.height_field = scene.height_fields.at(index[field++]);
    } else {
      radius = bounding_radius(geom.type, s);
    }
    radii.push_back(R(radius * (1 + 1e-6)));
    geoms.push_back(geom);
  }
  radii.resize(geoms.size() + scene.room);
  scene.geoms = detail::to_device<decltype(scene.geoms)>(exec, "gsp::RayScene::geoms", geoms);
  scene.radius = detail::to_device<decltype(scene.radius)>(exec, "gsp::RayScene::radius", radii);
  scene.turn = detail::allocate_zero<decltype(scene.turn)>(exec, "gsp::RayScene::turn", options.worlds, int(geoms.size()));
  scene.place = detail::allocate_zero<decltype(scene.place)>(exec, "gsp::RayScene::place", options.worlds, 3, int(radii.size()));
  scene.placed = detail::make_stamp<detail::PlacedStamp>("gsp::RayScene::placed");
  return scene;
}

namespace detail {
template <class R, class Mem>
void expects_placed(char const* where, RayScene<R, Mem> const& scene) {
  expects(scene.count() == 0 || !scene.placed.data() || scene.placed().placed,
          std::string(where) + ": where the scene's geoms are is not known: call place_ray_geoms(exec, model, poses, scene) first");
}
/// Geoms stand as these poses say. Poses that gsp has not written, and geoms that do not move, are taken as they are.
template <class R, class Mem>
void expects_placed_with(char const* where, RayScene<R, Mem> const& scene, Poses<R, Mem> const& poses) {
  expects_placed(where, scene);
  if (!scene.moves || !scene.placed.data() || !poses.stamp.data()) return;
  Stamp const &then = scene.placed().poses, &now = poses.stamp().bodies;
  expects(!then.qpos || !now.qpos || then.is_same(now),
          std::string(where) +
              ": the scene's geoms stand as poses of another state, or of another moment, say: call "
              "place_ray_geoms(exec, model, poses, scene) with these poses first");
}
template <class R, class Mem>
struct PlaceRayGeoms {
  Poses<R, Mem> poses;
  Field<R> pos, quat;
  RayScene<R, Mem> scene;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const n = int(scene.geoms.extent(0)), w = int(i / n), g = int(i % n);
    RayGeom<R> const& geom = scene.geoms(g);
    auto const vec = [](R const* v) { return Vec3<R>{v[0], v[1], v[2]}; };
    auto const turn = [](R const* q) { return Quat<R>{q[0], q[1], q[2], q[3]}; };
    Transform<R> const body{vec(&poses.xpos(w, geom.body, 0)), turn(&poses.xquat(w, geom.body, 0))};
    Transform<R> const place = body * Transform<R>{vec(pos.row(w) + 3 * geom.geom), turn(quat.row(w) + 4 * geom.geom)};
    scene.turn(w, g) = to_matrix(place.q * geom.turn);
    for (int c = 0; c < 3; ++c) scene.place(w, c, g) = place.p[c];
  }
};
}  // namespace detail

/// Where the scene's geoms are in these poses, in all worlds. Does not allocate, does not fence. Cost about 120 flop a geom. Errors:
/// std::invalid_argument for a scene or poses of another model or another number of worlds.
template <ExecutionSpace Exec, class R, class Mem>
void place_ray_geoms(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, RayScene<R, Mem>& scene) {
  Region const region("gsp::ray::place_ray_geoms");
  static_assert(can_access<Exec, Mem>, "gsp::place_ray_geoms: the scene is not accessible from this execution space");
  expects(scene.model == detail::sizes_of(model), "gsp::place_ray_geoms: the scene was made for another model: make_ray_scene with this");
  expects(int(poses.xpos.extent(0)) == scene.worlds && int(poses.xpos.extent(1)) == model.nbody,
          "gsp::place_ray_geoms: the scene has " + std::to_string(scene.worlds) + " worlds of " + std::to_string(model.nbody) +
              " bodies, the poses " + std::to_string(poses.xpos.extent(0)) + " of " + std::to_string(poses.xpos.extent(1)));
  detail::expects_values("gsp::place_ray_geoms", model, scene.worlds);
  if (scene.placed.data()) {
    scene.placed().placed = true;
    scene.placed().poses = poses.stamp.data() ? poses.stamp().bodies : detail::Stamp{};
  }
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  Kokkos::parallel_for("gsp::ray::place_ray_geoms", lightweight(Range(exec, 0, std::int64_t(scene.worlds) * scene.count())),
                       detail::PlaceRayGeoms<R, Mem>{poses, model.geom_pos, model.geom_quat, scene});
}

}  // namespace gsp
