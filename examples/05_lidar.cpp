// A LiDAR on a four-legged robot that trots among rolling balls, in four worlds with strides of their own. The unit turns while its robot
// walks, and its ranges have noise. Its last turn is drawn as a cloud in colours of range, from above and around the unit.
//   example_05_lidar [SCENE.xml]    a scene of MJCF with a floor, a robot of four legs and twelve position servos, and a keyframe
#include <cmath>
#include <cstdio>
#include <gsp/io/draw_points.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/png.hpp>
#include <gsp/model/attach.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/keyframe.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/ray/ray_scan.hpp>
#include <gsp/step/step.hpp>
#include <numbers>

namespace {
using Exec = Kokkos::DefaultExecutionSpace;

/// The robot, eight balls on a ring about it that are free to roll, and four walls. The robot's floor carries all.
gsp::Description scene_of(gsp::Description robot) {
  gsp::Description things;
  for (int k = 0; k < 4; ++k) {
    double const turn = std::numbers::pi / 2 * k, away = k % 2 == 0 ? 4 : 3;
    things.bodies[0].geoms.push_back({.name = "wall" + std::to_string(k),
                                      .type = gsp::ShapeType::box,
                                      .size = {0.05, 4, 0.6},
                                      .pos = {away * std::cos(turn), away * std::sin(turn), 0.6},
                                      .quat = {std::cos(turn / 2), 0, 0, std::sin(turn / 2)}});
  }
  for (int k = 0; k < 8; ++k) {
    double const turn = std::numbers::pi / 4 * k, radius = k % 2 == 0 ? 0.3 : 0.2;
    int const ball = gsp::add_body(things, 0, "ball" + std::to_string(k), {2 * std::cos(turn), 2 * std::sin(turn), radius});
    things.bodies[ball].joints.push_back({.type = gsp::JointType::free});
    things.bodies[ball].geoms.push_back({.size = {radius, 0, 0}, .density = 100});
  }
  gsp::attach(robot, things);
  return robot;
}

/// Balls go round the ring at 0.6 rad/s: all free bodies but the first, which is the robot.
template <class Views>
void push_balls(gsp::CompiledModel const& compiled, Views& state) {
  auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
  auto const qvel = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qvel);
  for (int j = 1; j < compiled.njnt; ++j) {
    if (gsp::JointType(compiled.jnt_type[j]) != gsp::JointType::free) continue;
    int const q = compiled.jnt_qposadr[j], v = compiled.jnt_dofadr[j];
    for (int w = 0; w < int(qpos.extent(0)); ++w) {
      qvel(w, v) = -0.6f * qpos(w, q + 1);
      qvel(w, v + 1) = 0.6f * qpos(w, q);
    }
  }
  Kokkos::deep_copy(state.qvel, qvel);
}

int run(char const* file) {
  Exec const exec;
  int const worlds = 4;
  double const seconds = 0.9;

  auto const robot = file ? gsp::io::read_mjcf(file, {.skip_visuals = true}) : gsp::samples::quadruped_scene({.boxes = 0, .balls = 0});
  gsp::expects(robot.actuators.size() == 12 && !robot.keyframes.empty(),
               "the scene has " + std::to_string(robot.actuators.size()) + " actuators and " + std::to_string(robot.keyframes.size()) +
                   " keyframes: give one with a robot of four legs, twelve position servos and a keyframe in which it stands");
  auto const compiled = gsp::compile(scene_of(robot));
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::set_keyframe(exec, model, compiled, 0, state);
  push_balls(compiled, state);

  // example-begin lidar
  // 64 rings, 10 turns a second, on the robot's back; it does not see its own robot
  gsp::RayMountOptions const mount{.body_id = 1, .pos = {0, 0, 0.15}};
  auto lidar = gsp::make_ray_scan<float>(exec, compiled, gsp::ouster_pattern(64, 1024, std::numbers::pi / 2), mount,
                                         {.worlds = worlds,
                                          .timestep = compiled.option.timestep,
                                          .min_range = 0.2,
                                          .max_range = 30,
                                          .self = gsp::SelfFilter::subtree,
                                          .noise = {.range_sigma = 0.01, .angle_sigma = 0.001, .dropout = 0.02}});
  auto scene = gsp::make_ray_scene<float>(exec, model, compiled, {.worlds = worlds});
  gsp::forward_kinematics(exec, model, state, sim.poses, sim.dynamics);
  gsp::begin_ray_scan(exec, sim.poses, lidar);
  // example-end lidar

  auto const stand = Kokkos::create_mirror(Exec::memory_space{}, state.ctrl);  // of the keyframe
  Kokkos::deep_copy(stand, state.ctrl);
  auto const ctrl = state.ctrl;
  int const steps = int(seconds / compiled.option.timestep + 0.5);
  for (int k = 0; k < steps; ++k) {
    float const beat = 2 * std::numbers::pi_v<float> * 3 * float(k * compiled.option.timestep);
    Kokkos::parallel_for(
        "trot", Kokkos::RangePolicy<Exec>(exec, 0, 4 * worlds), KOKKOS_LAMBDA(int i) {
          int const w = i / 4, leg = i % 4;  // legs in front, then behind: those across from each other swing together
          float const phase = beat + (leg == 0 || leg == 3 ? 0.f : 3.14159265f), stride = 0.1f * float(w), swing = Kokkos::cos(phase);
          ctrl(w, 3 * leg + 1) = stand(w, 3 * leg + 1) - stride * Kokkos::sin(phase) + (swing > 0 ? 0.2f * swing : 0.f);
          ctrl(w, 3 * leg + 2) = stand(w, 3 * leg + 2) - (swing > 0 ? 0.4f * swing : 0.f);
        });
    // example-begin lidar_step
    gsp::step(exec, model, state, sim);
    gsp::place_ray_geoms(exec, model, sim.poses, scene);
    gsp::scan_rays(exec, scene, sim.poses, lidar, k);  // the rays that leave in this step, from where the unit is then
    // example-end lidar_step
  }

  auto const host = [](auto const& view) { return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, view); };
  auto const range = host(lidar.range);
  auto const point = host(lidar.point);
  auto const geom = host(lidar.geom);
  auto const xpos = host(sim.poses.xpos), xquat = host(sim.poses.xquat);
  std::vector<gsp::io::Bitmap8> clouds;
  bool right = true;
  for (int w = 0; w < worlds; ++w) {
    std::vector<std::array<float, 3>> points;
    std::vector<float> ranges;
    double floor_height = 0;
    int on_floor = 0, on_things = 0;
    for (int k = 0; k < lidar.options.rays; ++k) {
      int const g = geom(w, k);
      if (g < 0) continue;
      points.push_back({point(w, k, 0), point(w, k, 1), point(w, k, 2)});
      ranges.push_back(range(w, k));
      if (gsp::ShapeType(compiled.geom_type[g]) == gsp::ShapeType::plane) {
        floor_height += point(w, k, 2);
        ++on_floor;
      }
      on_things += compiled.geom_body[g] > 0;
    }
    gsp::Transform<double> const trunk{{xpos(w, 1, 0), xpos(w, 1, 1), xpos(w, 1, 2)},
                                       {xquat(w, 1, 0), xquat(w, 1, 1), xquat(w, 1, 2), xquat(w, 1, 3)}};
    gsp::Transform<double> const unit = trunk * gsp::Transform<double>{{0, 0, 0.15}, {1, 0, 0, 0}};
    clouds.push_back(gsp::io::draw_points(points, ranges, unit, 400));
    floor_height /= std::fmax(1, on_floor);
    std::printf(
        "world %d: after %.1f s the robot is at x = %.2f m; of %d rays %d came back, %d of them from other bodies; the floor's points are "
        "at a mean height of %.2f mm\n",
        w, seconds, trunk.p.x, lidar.options.rays, int(points.size()), on_things, 1000 * floor_height);
    // with 1 cm of noise the mean of tens of thousands of points is within 1 mm, where each came from its own moment's pose
    right = right && on_floor > 10000 && on_things > 500 && std::fabs(floor_height) < 1e-3;
  }
  gsp::io::write_png("05_lidar.png", gsp::io::contact_sheet(clouds, 2, 8));
  std::printf("05_lidar.png: each world's last turn from above, and around its unit\n");
  if (!right) std::fprintf(stderr, "example_05_lidar: the floor or the balls were hardly seen, or the floor is not at height 0\n");
  return right ? 0 : 1;
}
}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  try {
    return run(argc > 1 ? argv[1] : nullptr);
  } catch (std::exception const& e) {
    std::fprintf(stderr, "example_05_lidar: %s\n", e.what());
    return 2;
  }
}
