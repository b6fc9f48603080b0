// A turn of a rotating unit of 64 rings by 1,719 columns, float, on a body among 40 shapes, in 50 steps of 2 ms: cast as one (mount_rays,
// cast_rays), scanned at once, scanned as the unit moves, and with noise of ranges and angles. On a GPU 256 worlds. And environments for
// learning: a robot among objects on ground of 20,000 triangles, 20,000 rays a world; 4,096 worlds on a GPU.
//   bench_ray_ray_scan
#include <algorithm>
#include <cmath>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/model/attach.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/ray/ray_scan.hpp>

#include "support/bench.hpp"

namespace {

gsp::Description shapes() {
  gsp::Description d;
  d.bodies[0].geoms.push_back({.type = gsp::ShapeType::plane, .size = {0, 0, 1}});
  gsp::ShapeType const type[] = {gsp::ShapeType::box, gsp::ShapeType::sphere, gsp::ShapeType::capsule, gsp::ShapeType::cylinder};
  for (int k = 0; k < 40; ++k) {
    double const angle = 2.4 * k, away = 2 + 0.25 * k;
    d.bodies[0].geoms.push_back(
        {.type = type[k % 4], .size = {0.3, 0.4, 0.5}, .pos = {away * std::cos(angle), away * std::sin(angle), 0.5}});
  }
  int const robot = gsp::add_body(d, 0, "robot", {0, 0, 1});
  d.bodies[robot].joints.push_back({.type = gsp::JointType::free});
  d.bodies[robot].geoms.push_back({.size = {0.1, 0, 0}});
  return d;
}

template <class Exec>
void run(int worlds) {
  Exec const exec;
  auto const compiled = gsp::compile(shapes());
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  gsp::forward_kinematics(exec, model, state, poses, dynamics);
  auto scene = gsp::make_ray_scene<float>(exec, model, compiled, {.worlds = worlds});
  gsp::place_ray_geoms(exec, model, poses, scene);
  auto const line = [&](char const* what, int rays, gsp_bench::Time const& time) {
    gsp_bench::Line("ray/ray_scan", exec)
        .add("what", what)
        .add("worlds", worlds)
        .add("precision", "float")
        .add(time)
        .add("mrays_per_second", 1e-6 * double(worlds) * rays / time.median)
        .print();
  };
  auto const scan = [&](char const* what, gsp::RayPattern const& pattern, int steps, gsp::RayNoise const& noise) {
    auto unit = gsp::make_ray_scan<float>(exec, compiled, pattern, {.body = "robot"}, {.worlds = worlds, .noise = noise});
    gsp::begin_ray_scan(exec, poses, unit);
    std::int64_t step = 0;
    line(what, int(pattern.direction.size()), gsp_bench::measure(exec, [&] {
           for (int k = 0; k < steps; ++k) gsp::scan_rays(exec, scene, poses, unit, step++);
         }));
  };
  auto const turn = gsp::hdl64e_pattern(), at_once = gsp::hdl64e_pattern(1719, 0);
  int const count = int(turn.direction.size());
  auto const mount = gsp::make_ray_mount<float>(exec, compiled, turn, {.body = "robot"});
  auto rays = gsp::make_rays<float>(exec, {.worlds = worlds, .count = count});
  auto hits = gsp::make_ray_hits<float>(exec, {.worlds = worlds, .count = count, .normals = false});
  auto const hidden = gsp::hide_self(compiled, mount.body, gsp::SelfFilter::body);
  line("cast_rays", count, gsp_bench::measure(exec, [&] {
         gsp::mount_rays(exec, poses, mount, rays);
         gsp::cast_rays(exec, scene, rays, hits, hidden);
       }));
  scan("at once", at_once, 1, {});
  scan("in 50 steps", turn, 50, {});
  scan("in 50 steps, ranges with noise", turn, 50, {.range_sigma = 0.02, .dropout = 0.01});
  scan("in 50 steps, ranges and angles with noise", turn, 50, {.range_sigma = 0.02, .angle_sigma = 0.0026, .dropout = 0.01});
}

/// A robot among twelve objects on hilly ground of 20,000 triangles, in each of so many worlds, with a unit that sends 20,000 rays at once.
gsp::Description environment() {
  gsp::Description d = gsp::samples::quadruped_scene();
  auto& fixed = d.bodies[0].geoms;
  fixed.erase(std::remove_if(fixed.begin(), fixed.end(), [](auto const& g) { return g.type == gsp::ShapeType::plane; }), fixed.end());
  gsp::MeshDescription hills;
  hills.name = "hills";
  int const cells = 100;
  for (int i = 0; i <= cells; ++i)
    for (int j = 0; j <= cells; ++j) {
      float const x = 0.2f * float(i - cells / 2), y = 0.2f * float(j - cells / 2), away = std::min(1.f, 0.2f * std::hypot(x, y));
      hills.vertices.push_back(
          {x, y, away * (0.4f * std::sin(1.3f * x) * std::cos(0.9f * y) + 0.15f * std::sin(4.1f * x + 2.7f * y)) - 0.05f});
    }
  for (int i = 0; i < cells; ++i)
    for (int j = 0; j < cells; ++j) {
      int const n = i * (cells + 1) + j, right = n + cells + 1;
      hills.faces.push_back({n, right, right + 1});
      hills.faces.push_back({n, right + 1, n + 1});
    }
  d.meshes.push_back(hills);
  fixed.push_back({.name = "hills", .type = gsp::ShapeType::mesh, .contype = 0, .conaffinity = 0, .mesh = "hills"});
  return d;
}

template <class Exec>
void run_environments(int worlds) {
  Exec const exec;
  auto const compiled = gsp::compile(environment());
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  gsp::forward_kinematics(exec, model, state, poses, dynamics);
  dynamics = {};
  auto scene = gsp::make_ray_scene<float>(exec, model, compiled, {.worlds = worlds});
  auto const pattern = gsp::spherical_pattern(200, 100);  // all at once, half of them down
  auto unit = gsp::make_ray_scan<float>(exec, compiled, pattern, {.body = "trunk", .pos = {0.25, 0, 0.1}},
                                        {.worlds = worlds, .geoms = false, .points = false});
  gsp::begin_ray_scan(exec, poses, unit);
  std::int64_t step = 0;
  auto const time = gsp_bench::measure(exec, [&] {
    gsp::place_ray_geoms(exec, model, poses, scene);
    gsp::scan_rays(exec, scene, poses, unit, step++);
  });
  auto const range = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, unit.range);
  long hits = 0;
  for (std::size_t k = 0; k < range.size(); ++k) hits += range.data()[k] >= 0;
  auto const bytes = [](auto const&... view) {
    return (0. + ... + double(view.span() * sizeof(typename std::decay_t<decltype(view)>::value_type)));
  };
  gsp_bench::Line("ray/ray_scan", exec)
      .add("what", "environments")
      .add("worlds", worlds)
      .add("rays", unit.options.rays)
      .add("geoms", scene.count())
      .add("triangles", long(scene.triangles.extent(0)))
      .add("precision", "float")
      .add(time)
      .add("mrays_per_second", 1e-6 * double(range.size()) / time.median)
      .add("hits", double(hits) / double(range.size()))
      .add("megabytes",
           1e-6 * bytes(unit.range, unit.before, scene.nodes, scene.triangles, scene.turn, scene.place, poses.xpos, poses.xquat))
      .print();
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
#ifdef KOKKOS_ENABLE_CUDA
  run<Kokkos::Cuda>(256);
  run_environments<Kokkos::Cuda>(4096);
#endif
  run<Kokkos::DefaultHostExecutionSpace>(1);
  run_environments<Kokkos::DefaultHostExecutionSpace>(16);
}
