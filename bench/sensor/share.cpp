// What sensors cost beside a step of physics, float: a height scan of 187 points (17 x 11, 0.1 m apart, turned with the base) on a
// quadruped that stands on a height field, and on the same ground as triangles; and all sensors of a quadruped and of a humanoid, as
// MuJoCo's step reads them, once a step. 8,192 worlds on a GPU, 256 on a host. Shares are of one step; a scan or a reading at every n-th
// costs an n-th.
//   bench_sensor_share [FIELD.xml ROBOT.xml HUMANOID.xml] [WORLDS]
// FIELD: a scene with a height field, a robot whose first body is its base, and a keyframe. Without files those of GSP_DATA_DIR: go1, go2,
// G1.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <gsp/io/file.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/keyframe.hpp>
#include <gsp/ray/ray_mount.hpp>
#include <gsp/sensor/read_sensors.hpp>
#include <gsp/step/snapshot.hpp>
#include <gsp/step/step.hpp>
#include <vector>

#include "support/bench.hpp"

namespace {

constexpr int field_group = 4, mesh_group = 5;

/// The first height field of a model as triangles, parted as rays part its cells.
gsp::MeshDescription triangles_of(gsp::HeightFieldDescription const& f) {
  gsp::MeshDescription mesh;
  mesh.name = "ground as triangles";
  for (int r = 0; r < f.rows; ++r)
    for (int c = 0; c < f.columns; ++c)
      mesh.vertices.push_back({float(f.size[0] * (2. * c / (f.columns - 1) - 1)), float(f.size[1] * (2. * r / (f.rows - 1) - 1)),
                               float(f.size[2] * f.elevation[std::size_t(r * f.columns + c)])});
  for (int r = 0; r + 1 < f.rows; ++r)
    for (int c = 0; c + 1 < f.columns; ++c) {
      int const n = r * f.columns + c;
      mesh.faces.push_back({n, n + 1, n + f.columns + 1});
      mesh.faces.push_back({n, n + f.columns + 1, n + f.columns});
    }
  return mesh;
}

/// Files that are not where the text says are looked for in the folder `assets` beside it.
gsp::Description read(std::filesystem::path const& path) {
  gsp::io::MjcfOptions options{.skip_visuals = true};
  options.read = [&](std::filesystem::path const& file) {
    return gsp::io::read_file(std::filesystem::exists(file) ? file : path.parent_path() / "assets" / file.filename());
  };
  return gsp::io::read_mjcf(path, options);
}

/// The scene with its ground twice: the field, which carries the robot, and triangles that touch nothing.
gsp::Description ground_of(std::string const& path) {
  auto d = read(path);
  auto const compiled = gsp::compile(d);
  auto& fixed = d.bodies[0].geoms;
  auto const field = std::find_if(fixed.begin(), fixed.end(), [](auto const& g) { return g.type == gsp::ShapeType::hfield; });
  gsp::expects(field != fixed.end() && !compiled.hfields.empty(), path + ": has no height field on its world; give a scene that has one");
  field->group = field_group;
  gsp::GeomDescription mesh;
  mesh.name = "ground as triangles";
  mesh.type = gsp::ShapeType::mesh;
  mesh.mesh = "ground as triangles";
  mesh.pos = field->pos;
  mesh.quat = field->quat;
  mesh.group = mesh_group;
  mesh.contype = mesh.conaffinity = 0;
  d.meshes.push_back(triangles_of(compiled.hfields[0]));
  fixed.push_back(mesh);
  return d;
}

/// A robot on a floor; where the file has no floor, one is put under it. Servos hold what the keyframe says.
gsp::Description robot_of(std::string const& path) {
  auto d = read(path);
  auto& fixed = d.bodies[0].geoms;
  if (std::none_of(fixed.begin(), fixed.end(), [](auto const& g) { return g.type == gsp::ShapeType::plane; }))
    fixed.push_back({.name = "floor under it", .type = gsp::ShapeType::plane, .size = {0, 0, 1}});
  return d;
}

/// What the makers' simulation of this robot measures: of each joint its position, velocity and torque, and an IMU on the base; where the
/// file itself has nothing.
void add_sensors(gsp::Description& d) {
  if (d.sensors.size() > 12) return;
  d.sensors.clear();
  int base = 0;
  for (auto const& body : d.bodies)
    for (auto const& joint : body.joints)
      if (joint.type == gsp::JointType::hinge) {
        for (char const* const type : {"jointpos", "jointvel", "jointactuatorfrc"})
          d.sensors.push_back({.name = joint.name + type, .type = type, .object_type = "joint", .object = joint.name});
      } else if (joint.type == gsp::JointType::free && base == 0) {
        base = int(&body - d.bodies.data());
      }
  gsp::SiteDescription imu;
  imu.name = "imu of the bench";
  d.bodies[std::size_t(base)].sites.push_back(imu);
  for (char const* const type : {"framequat", "framepos", "framelinvel"})
    d.sensors.push_back({.name = type, .type = type, .object_type = "site", .object = imu.name});
  for (char const* const type : {"gyro", "accelerometer"})
    d.sensors.push_back({.name = type, .type = type, .object_type = "site", .object = imu.name});
}

template <class Exec>
struct Worlds {
  Exec exec;
  gsp::CompiledModel compiled;
  gsp::Model<float, typename Exec::memory_space> model;
  gsp::State<float, typename Exec::memory_space> state;
  gsp::Simulation<float, typename Exec::memory_space> sim;

  Worlds(gsp::Description const& d, int worlds, int settle)
      : compiled(gsp::compile(d)),
        model(gsp::make_model<float>(exec, compiled)),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        sim(gsp::make_simulation(exec, model, compiled, {.worlds = worlds})) {
    if (!compiled.keyframes.empty()) gsp::set_keyframe(exec, model, compiled, 0, state);
    auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
    for (int w = 0; w < worlds; ++w) {  // all over the ground, turned all ways
      qpos(w, 0) += 4 * std::sin(2.4f * float(w));
      qpos(w, 1) += 4 * std::cos(1.7f * float(w));
      qpos(w, 2) += 0.1f;
      qpos(w, 3) = std::cos(0.37f * float(w));
      qpos(w, 6) = std::sin(0.37f * float(w));
    }
    Kokkos::deep_copy(state.qpos, qpos);
    gsp::step(exec, model, state, sim, {.steps = settle});
  }
};

gsp_bench::MeasureOptions const few{.samples = 5, .seconds = 0.2};

template <class Exec>
void height_scan(std::string const& path, int worlds) {
  Worlds<Exec> all(ground_of(path), worlds, 100);
  Exec const& exec = all.exec;
  auto const step = gsp_bench::measure(
      exec, [&] { gsp::step(exec, all.model, all.state, all.sim); }, few);
  auto const pattern = gsp::height_scan_pattern(1.6, 1, 0.1);
  auto const mount =
      gsp::make_ray_mount<float>(exec, all.compiled, pattern, {.body_id = 1, .pos = {0, 0, 20}, .alignment = gsp::RayAlignment::yaw});
  gsp::RaysOptions const many{.worlds = worlds, .count = mount.count(), .normals = false};
  auto rays = gsp::make_rays<float>(exec, many);
  auto hits = gsp::make_ray_hits<float>(exec, many);
  double first = 0;  // mean height of the field
  for (int const group : {field_group, mesh_group}) {
    auto scene = gsp::make_ray_scene<float>(exec, all.model, all.compiled, {.worlds = worlds, .groups = 1u << group});
    auto const place = gsp_bench::measure(
        exec, [&] { gsp::place_ray_geoms(exec, all.model, all.sim.poses, scene); }, few);
    auto const send = gsp_bench::measure(
        exec, [&] { gsp::mount_rays(exec, all.sim.poses, mount, rays); }, few);
    auto const cast = gsp_bench::measure(
        exec, [&] { gsp::cast_rays(exec, scene, rays, hits); }, few);
    auto const distance = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, hits.distance);
    double sum = 0;
    long met = 0;
    for (std::size_t k = 0; k < distance.size(); ++k) {
      met += distance.data()[k] >= 0;
      sum += distance.data()[k];
    }
    if (group == field_group) first = sum;
    double const scan = place.median + send.median + cast.median;
    gsp_bench::Line("sensor/share", exec)
        .add("what", group == field_group ? "height scan, field" : "height scan, triangles")
        .add("worlds", worlds)
        .add("rays", mount.count())
        .add("precision", "float")
        .add("hits", double(met) / double(distance.size()))
        .add("off_the_field", (sum - first) / double(distance.size()))
        .add("step_seconds", step.median)
        .add("place_seconds", place.median)
        .add("rays_seconds", send.median)
        .add("cast_seconds", cast.median)
        .add("mrays_per_second", 1e-6 * double(distance.size()) / cast.median)
        .add("scan_seconds", scan)
        .add("share_of_a_step", scan / step.median)
        .print();
  }
}

template <class Exec>
void sensors(char const* name, std::string const& path, int worlds) {
  auto d = robot_of(path);
  add_sensors(d);
  Worlds<Exec> all(d, worlds, 300);
  Exec const& exec = all.exec;
  auto table = gsp::make_sensors(exec, all.model, all.compiled, {.worlds = worlds});
  Kokkos::View<float**, Kokkos::LayoutRight, typename Exec::memory_space> data("data", worlds, all.compiled.nsensordata);
  // Each way takes the same steps from the same moment, in turn: what a step costs depends on how the robot lies.
  auto const start = gsp::make_snapshot(exec, all.state, all.sim);
  constexpr int steps = 25, rounds = 7;
  std::vector<double> seconds[3];
  for (int k = 0; k <= 3 * rounds; ++k) {  // the first warms up
    gsp::restore(exec, start, all.state, all.sim);
    exec.fence("sensor/share: restored");
    auto const begin = std::chrono::steady_clock::now();
    for (int n = 0; n < steps; ++n) {
      if (k % 3 == 0) {
        gsp::step(exec, all.model, all.state, all.sim, {.poses = false});
        continue;
      }
      gsp::forward(exec, all.model, all.state, all.sim);
      if (k % 3 == 2) gsp::read_sensors(exec, all.model, all.state, all.sim, table, data);
      gsp::advance(exec, all.model, all.state, all.sim);
    }
    exec.fence("sensor/share: stepped");
    if (k > 0) seconds[k % 3].push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / steps);
  }
  for (auto& list : seconds) std::sort(list.begin(), list.end());
  auto const median = [&](int way) { return seconds[way][rounds / 2]; };
  double const step = median(0), in_two = median(1), with = median(2);
  gsp::forward(exec, all.model, all.state, all.sim);
  auto const read = gsp_bench::measure(
      exec, [&] { gsp::read_sensors(exec, all.model, all.state, all.sim, table, data); }, few);
  gsp_bench::Line("sensor/share", exec)
      .add("what", name)
      .add("worlds", worlds)
      .add("sensors", long(all.compiled.sensor_adr.size()))
      .add("numbers", all.compiled.nsensordata)
      .add("left_out", long(table.left_out.size()))
      .add("precision", "float")
      .add("step_seconds", step)
      .add("forward_advance_seconds", in_two)
      .add("with_sensors_seconds", with)
      .add("read_seconds", read.median)
      .add("read_share_of_a_step", read.median / step)
      .add("added_to_forward_advance", with / in_two - 1)
      .print();
}

template <class Exec>
void run(std::string const (&path)[3], int worlds) {
  height_scan<Exec>(path[0], worlds);
  sensors<Exec>("sensors, quadruped", path[1], worlds);
  sensors<Exec>("sensors, humanoid", path[2], worlds);
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  std::string const folder = gsp_bench::model_folder();
  std::string path[3] = {folder + "mujoco_playground/go1/scene_mjx_feetonly_rough_terrain.xml", folder + "unitree/go2/go2.xml",
                         folder + "mjlab/unitree_g1/g1.xml"};
  for (int k = 1; argc > 3 && k < 4; ++k) path[k - 1] = argv[k];
  int const given = argc == 2 || argc == 5 ? std::atoi(argv[argc - 1]) : 0;
#ifdef KOKKOS_ENABLE_CUDA
  run<Kokkos::Cuda>(path, given > 0 ? given : 8192);
  if (given > 0) return 0;
#endif
  run<Kokkos::DefaultHostExecutionSpace>(path, given > 0 ? given : 256);
}
