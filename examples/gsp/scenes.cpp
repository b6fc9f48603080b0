#include "scenes.hpp"

#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <gsp/io/file.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/attach.hpp>
#include <gsp/model/samples.hpp>

#include "files.hpp"

namespace gsp_cli {
namespace {

using gsp::Description;

std::string path_of(Arguments const& a, std::string const& file) {
  char const* const folder = std::getenv("GSP_DATA_DIR");
  if (!folder) a.fail("the scene is made of models/" + file + " below $GSP_DATA_DIR, which is not set; set it, or give --model FILE");
  return std::string(folder) + "/models/" + file;
}
Description read(Arguments const& a, std::string const& file) { return describe_model(path_of(a, file), a, false, true); }

gsp::GeomDescription infinite_floor() {
  gsp::GeomDescription floor;
  floor.name = "floor";
  floor.type = gsp::ShapeType::plane;
  floor.size = {0, 0, 0.05};
  return floor;
}

Description sample_quadruped(Arguments const&) { return gsp::samples::quadruped_scene(); }
Description humanoid(Arguments const& a) { return read(a, "mujoco/humanoid/humanoid.xml"); }
Description three_humanoids(Arguments const& a) { return read(a, "mujoco_warp/humanoid/three_humanoids.xml"); }
Description go1(Arguments const& a) { return read(a, "mujoco_playground/go1/scene_mjx_feetonly_flat_terrain.xml"); }
Description g1(Arguments const& a) { return read(a, "mujoco_warp/unitree_g1/scene_flat.xml"); }

/// force = stiffness (ctrl - q) - damping q'
void make_servo(gsp::ActuatorDescription& motor, double stiffness, double damping) {
  if (!motor.force_limited) {
    motor.force_limited = motor.ctrl_limited;
    motor.force_range = motor.ctrl_range;
  }
  motor.ctrl_limited = false;
  motor.gainprm[0] = stiffness;
  motor.bias_type = gsp::ActuatorBias::affine;
  motor.biasprm = {0, -stiffness, -damping};
}

/// Its motors made servos, so that it stands at its keyframe without a policy.
Description go2(Arguments const& a) {
  Description d = read(a, "unitree/go2/go2.xml");
  d.option.timestep = 0.004;
  d.bodies[0].geoms.push_back(infinite_floor());
  for (auto& motor : d.actuators) make_servo(motor, 40, 1);
  for (auto& key : d.keyframes) key.ctrl.assign(key.qpos.begin() + 7, key.qpos.end());
  return d;
}

struct Crowd {
  int count = 10, layers = 4;
  double pitch = 0.4;        // between columns and rows [m]
  double layer_pitch = 2.1;  // [m]
  double row_offset = 0.35;  // of every second row, so that arms do not cross [m]
  double turn = 0;           // of each beside the one before [rad]
};

/// Humanoids in one world above a floor, layer on layer, each shifted by (0.10, 0.07) m so that the towers topple.
Description crowd(Arguments const& a, Crowd const& o) {
  Description piece = humanoid(a);
  piece.keyframes.clear();
  piece.bodies[0].geoms.clear();
  piece.bodies[0].cameras.clear();
  Description d;
  d.option = piece.option;
  d.bodies[0].geoms.push_back(infinite_floor());
  int const in_layer = (o.count + o.layers - 1) / o.layers;
  int const columns = static_cast<int>(std::ceil(std::sqrt(in_layer)));
  int const rows = (in_layer + columns - 1) / columns;
  for (int i = 0; i < o.count; ++i) {
    int const layer = i / in_layer;
    int const column = i % in_layer % columns;
    int const row = i % in_layer / columns;
    double const x = (column - 0.5 * (columns - 1)) * o.pitch + 0.10 * layer;
    double const y = (row - 0.5 * (rows - 1)) * o.pitch + 0.07 * layer;
    double const z = o.layer_pitch * layer + o.row_offset * (row % 2);
    double const half = 0.5 * o.turn * i;
    std::string prefix = "h";
    prefix += std::to_string(i);
    prefix += "_";
    gsp::attach(d, piece, {.prefix = prefix, .pos = {x, y, z}, .quat = {std::cos(half), 0, 0, std::sin(half)}});
  }
  return d;
}
double constexpr degree = 0.017453292519943295;
Description heap_of_10(Arguments const& a) { return crowd(a, {.count = 10}); }
Description heap_of_50(Arguments const& a) { return crowd(a, {.count = 50}); }
Description apart_50(Arguments const& a) { return crowd(a, {.count = 50, .layers = 1, .pitch = 2, .row_offset = 0, .turn = 20 * degree}); }

/// Volume of a box or cylinder [m^3].
double volume(gsp::GeomDescription const& g) {
  if (g.type == gsp::ShapeType::box) return 8 * g.size[0] * g.size[1] * g.size[2];
  return 2 * 3.141592653589793 * g.size[0] * g.size[0] * g.size[1];
}

/// A tetrahedron as a mesh of this kind of file.
std::vector<std::byte> tetrahedron(std::string const& extension) {
  if (extension == ".obj") {
    std::string const text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    auto const* bytes = reinterpret_cast<std::byte const*>(text.data());
    return {bytes, bytes + text.size()};
  }
  std::array<std::array<float, 3>, 4> const corners{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  std::array<std::array<std::size_t, 3>, 4> const faces{{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
  std::uint32_t const count = faces.size();
  std::vector<std::byte> out(84 + 50 * faces.size());
  std::memcpy(&out[80], &count, 4);
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) std::memcpy(&out[84 + 50 * f + 12 * (k + 1)], corners[faces[f][k]].data(), 12);
  return out;
}
/// With something in the place of meshes, for a scene that drops them.
Description read_without_meshes(std::string const& path) {
  gsp::io::MjcfOptions options;
  options.read = [](std::filesystem::path const& file) {
    auto const extension = file.extension().string();
    return extension == ".obj" || extension == ".stl" ? tetrahedron(extension) : gsp::io::read_file(file);
  };
  return gsp::io::read_mjcf(path, options);
}

/// Goods on a shelf: boxes and cylinders without meshes, each body 0.35 kg, shared among its geoms by volume.
Description shelf(Arguments const& a) {
  double const mass = 0.35;
  Description d = read_without_meshes(path_of(a, "motrix/store/store.xml"));
  d.option = {};
  d.option.timestep = 0.01;
  d.option.gravity = {0, 0, -9.8};
  d.meshes.clear();
  for (auto& body : d.bodies) {
    std::vector<gsp::GeomDescription> kept;
    double total = 0;
    for (auto const& from : body.geoms) {
      if (from.visual() || (from.type != gsp::ShapeType::box && from.type != gsp::ShapeType::cylinder)) continue;
      gsp::GeomDescription g;
      g.type = from.type;
      g.size = from.size;
      g.pos = from.pos;
      g.quat = from.quat;
      kept.push_back(g);
      total += volume(g);
    }
    for (auto& g : kept) {
      g.has_mass = true;
      g.mass = mass * volume(g) / total;
    }
    body.geoms = kept;
    body.has_inertial = false;
  }
  d.bodies[0].geoms.push_back(infinite_floor());
  return d;
}

/// Boxes of 1 m and 1,000 kg: layers of k x k that touch, neighbours 2 cm apart.
Description pyramid(Arguments const&) {
  int const height = 15;
  double const pitch = 1.02;
  Description d;
  d.option.timestep = 1.0 / 60;
  d.bodies[0].geoms.push_back(infinite_floor());
  gsp::GeomDescription box;
  box.type = gsp::ShapeType::box;
  box.size = {0.5, 0.5, 0.5};
  gsp::JointDescription free;
  free.type = gsp::JointType::free;
  for (int layer = 0; layer < height; ++layer) {
    int const k = height - layer;
    for (int i = 0; i < k * k; ++i) {
      double const x = (i / k - 0.5 * (k - 1)) * pitch;
      double const y = (i % k - 0.5 * (k - 1)) * pitch;
      int const b = gsp::add_body(d, 0, "box" + std::to_string(d.bodies.size()), {x, y, 0.5 + layer});
      d.bodies[static_cast<std::size_t>(b)].joints.push_back(free);
      d.bodies[static_cast<std::size_t>(b)].geoms.push_back(box);
    }
  }
  return d;
}

}  // namespace

std::vector<PhysicsScene> physics_scenes() {
  return {
      {.name = "quadruped",
       .what = "the library's, among boxes and balls",
       .make = sample_quadruped,
       .keyframe = "stand",
       .worlds = 256,
       .from = 100},
      {.name = "pyramid", .what = "1,240 boxes", .make = pyramid, .from = 60, .steps = 20, .peers = "cg"},
      {.name = "humanoid",
       .what = "MuJoCo's",
       .needs_files = true,
       .make = humanoid,
       .keyframe = "0",
       .worlds = 1024,
       .from = 500,
       .steps = 500,
       .noise = 0.01},
      {.name = "three_humanoids",
       .what = "three of them in a world",
       .needs_files = true,
       .make = three_humanoids,
       .worlds = 256,
       .from = 500,
       .steps = 500,
       .noise = 0.01},
      {.name = "go1", .what = "feet on a floor", .needs_files = true, .make = go1, .keyframe = "home", .worlds = 1024, .from = 100},
      {.name = "go2", .what = "with servos, on a floor", .needs_files = true, .make = go2, .keyframe = "home", .worlds = 1024, .from = 100},
      {.name = "g1", .what = "fallen on a floor", .needs_files = true, .make = g1, .keyframe = "home", .worlds = 1024, .from = 300},
      {.name = "heap_10", .what = "10 humanoids in a heap", .needs_files = true, .make = heap_of_10, .from = 400},
      {.name = "heap_50", .what = "50 humanoids in a heap", .needs_files = true, .make = heap_of_50, .from = 400, .peers = "newton,cg"},
      {.name = "apart_50", .what = "50 humanoids, 2 m apart", .needs_files = true, .make = apart_50, .from = 400, .peers = "newton,cg"},
      {.name = "shelf", .what = "a store's shelf, 548 bodies", .needs_files = true, .make = shelf, .from = 50},
  };
}

}  // namespace gsp_cli
