// Frames per second of many worlds, each with a robot of its own pose in one captured scene that all share: kitchen.spz
// (GSP_DATA_DIR/splats), RGB + expected depth + alpha, one image a world, every camera different and every robot before its camera.
//   bench_splat_robots [--worlds N] [--dynamic GAUSSIANS] [--width W --height H] [--batch B] [--scene FILE] [--scenes N] [--fixed VIEWS]
// --scenes: so many copies of the scene in one cloud, of which world w shows the (w % N)-th: what show_sets costs.
// --fixed: cameras that stand still, at so many places in turn, drawn by render_fixed; peak_minus_outputs has what they keep in it.
// Robots take four poses in turn, another each call. peak_minus_outputs: the most bytes that were allocated at once on the device
// (Gaussians, poses, cameras, buffers of waves; not CUDA's own), without the pictures themselves. Each backend that was compiled in runs;
// on a device as many worlds as fit its memory well.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/io/gaussians.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/splat/fixed_frames.hpp>
#include <gsp/splat/sample_surface.hpp>
#include <gsp/splat/show_sets.hpp>
#include <numbers>
#include <random>
#include <support/bench.hpp>
#include <support/peak_bytes.hpp>

namespace {

struct Arguments {
  int worlds = 0, dynamic = 5000, width = 640, height = 480, batch = 0, scenes = 1, fixed = 0;
  std::string scene;
};

struct Random {
  std::mt19937 generator;
  double uniform(double a, double b) { return a + (b - a) * (generator() / 4294967296.); }
};

/// Random places in a box of a y-down room, looking around, a little down: as a robot's cameras in the kitchen.
std::vector<gsp::CameraPose<double>> room_cameras(int count) {
  Random random{std::mt19937(7)};
  std::vector<gsp::CameraPose<double>> out;
  for (int c = 0; c < count; ++c) {
    gsp::Vec3<double> const eye{random.uniform(-1, 1), random.uniform(-1.7, -1), random.uniform(-.5, .5)};
    double const yaw = random.uniform(0, 2 * std::numbers::pi), pitch = random.uniform(-.1, .5);
    gsp::Vec3<double> const ahead{std::cos(yaw) * std::cos(pitch), std::sin(pitch), std::sin(yaw) * std::cos(pitch)};
    out.push_back(gsp::look_at<double>(eye, eye + ahead, {0, -1, 0}));
  }
  return out;
}

/// Poses of a robot a world: joints about its stance, the trunk turned at random, 0.5 to 1 m before the world's camera.
template <class Exec, class Model, class State, class Dynamics>
auto robot_poses(Exec const& exec, Model const& model, std::vector<double> const& stance, State& state, Dynamics& dynamics,
                 std::vector<gsp::CameraPose<double>> const& cameras, int seed) {
  int const worlds = int(state.qpos.extent(0));
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  exec.fence();
  auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
  Random random{std::mt19937(unsigned(seed))};
  for (int w = 0; w < worlds; ++w) {
    auto const& camera = cameras[std::size_t(w) % cameras.size()];
    double const z = random.uniform(.5, 1);
    gsp::Vec3<double> const before{random.uniform(-.3, .3) * z, random.uniform(-.2, .2) * z, z};
    gsp::Vec3<double> const place = gsp::transpose_times(camera.r, before - camera.t);
    gsp::Quat<double> const turn =
        gsp::normalized(gsp::Quat<double>{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)});
    double const base[7] = {place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z};
    for (int i = 0; i < model.nq; ++i) qpos(w, i) = float(i < 7 ? base[i] : stance[std::size_t(i)] + random.uniform(-.3, .3));
  }
  Kokkos::deep_copy(exec, state.qpos, qpos);
  gsp::forward_kinematics(exec, model, state, poses, dynamics);
  exec.fence();
  return poses;
}

template <class Exec>
auto scenes_and_robot(Exec const& exec, gsp::GaussianSet const& scene, gsp::GaussianSet const& robot, int scenes, int worlds) {
  std::vector<gsp::GaussianSet> sets(std::size_t(scenes), scene);
  sets.push_back(robot);
  auto const all = gsp::make_gaussians(exec, sets);
  if (scenes == 1) return all;
  std::vector<std::vector<int>> table;
  for (int w = 0; w < worlds; ++w) table.push_back({w % scenes, scenes});
  return gsp::show_sets(exec, all, table);
}

/// Which share of the 8 x 8 blocks (of a CPU: of the tiles) shows what moves.
template <class Mem, class View>
double share_of_blocks(gsp::Frames<Mem> const& frames, View const& drawn) {
  auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, drawn);
  bool const by_block = frames.wave.block_masks.extent(0) > 0;
  double count = 0;
  for (std::size_t i = 0; i < host.span(); ++i) count += by_block ? std::popcount(host.data()[i]) : int(host.data()[i] != 0);
  int const side = by_block ? 8 : 16, columns = (frames.width + side - 1) / side, rows = (frames.height + side - 1) / side;
  return count / (double(columns) * rows * frames.images);
}

template <class Exec>
void run(Exec const& exec, Arguments const& a, gsp::GaussianSet const& scene) {
  using Mem = typename Exec::memory_space;
  int const worlds = a.worlds > 0 ? a.worlds : gsp::is_device<Exec> ? 2048 : 8;
  gsp_bench::PeakBytes<Mem> peak;
  auto const compiled = gsp::compile(gsp::samples::quadruped());
  auto const robot = gsp::sample_surface(compiled, {.count = a.dynamic, .world = false});
  auto const cloud = scenes_and_robot(exec, scene, robot, a.scenes, worlds);
  auto places = room_cameras(a.fixed > 0 ? std::min(a.fixed, worlds) : worlds);
  for (std::size_t w = places.size(); w < std::size_t(worlds); ++w) places.push_back(places[w - std::size_t(a.fixed)]);
  std::vector<float> viewmats, Ks;
  auto const K = gsp::pinhole(a.width, a.height, {.fovy = std::numbers::pi / 3});
  for (auto const& place : places) {
    auto const view = place.matrix();
    viewmats.insert(viewmats.end(), view.begin(), view.end());
    Ks.insert(Ks.end(), K.begin(), K.end());
  }
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  auto const model = gsp::make_model<float>(exec, compiled);
  std::vector<gsp::Poses<float, Mem>> poses;
  {
    auto state = gsp::make_state(exec, model, {.worlds = worlds});
    auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
    for (int k = 0; k < 4; ++k) poses.push_back(robot_poses(exec, model, compiled.keyframes.at(0).qpos, state, dynamics, places, 11 + k));
  }
  gsp::FrameOptions const options{.images = worlds, .width = a.width, .height = a.height, .batch = a.batch};
  gsp::FixedFrames<Mem> fixed;
  if (a.fixed > 0)
    fixed = gsp::make_fixed_frames(exec, cloud, poses[0], cameras, options);
  else
    fixed.frames = gsp::make_frames(exec, cloud, options);
  auto& frames = fixed.frames;
  std::size_t turn = 0;
  auto const draw = [&] {
    auto const& now = poses[turn++ % poses.size()];
    if (a.fixed > 0)
      gsp::render_fixed(exec, now, fixed);
    else
      gsp::render(exec, cloud, now, cameras, frames);
  };
  for (std::size_t k = 0; k < poses.size(); ++k) draw();
  std::int64_t const bytes = peak.stop(), outputs = 4 * std::int64_t(frames.rgb.span() + frames.depth.span() + frames.alpha.span());
  auto const time = gsp_bench::measure(exec, draw, {.seconds = 0.5});
  turn = 0;
  draw();  // the hash is of the first poses, and of 64 worlds at most
  auto const first = Kokkos::subview(frames.rgb, Kokkos::make_pair(0, std::min(worlds, 64)), Kokkos::ALL, Kokkos::ALL, Kokkos::ALL);
  gsp_bench::Line("splat/robots", exec)
      .add("scene", std::filesystem::path(a.scene).filename().string())
      .add("scenes", a.scenes)
      .add("static_gaussians", scene.size())
      .add("dynamic_gaussians", robot.size())
      .add("worlds", worlds)
      .add("cameras", a.fixed > 0 ? "fixed" : "moving")
      .add("views", a.fixed > 0 ? fixed.still.images : worlds)
      .add("blocks_drawn", a.fixed > 0 ? share_of_blocks(frames, fixed.drawn) : 1.)
      .add("batch", frames.wave.batch)
      .add("width", a.width)
      .add("height", a.height)
      .add("precision", "float")
      .add(time)
      .add("frames_per_second", worlds / time.median)
      .add("output_bytes", outputs)
      .add("peak_minus_outputs", bytes - outputs)
      .add_hash(first)
      .print();
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard kokkos(argc, argv);
  Arguments a;
  a.scene = gsp_bench::data_file("splats/kitchen.spz");
  for (int i = 1; i + 1 < argc; i += 2) {
    std::string const key = argv[i], value = argv[i + 1];
    if (key == "--worlds") a.worlds = std::atoi(value.c_str());
    if (key == "--dynamic") a.dynamic = std::atoi(value.c_str());
    if (key == "--width") a.width = std::atoi(value.c_str());
    if (key == "--height") a.height = std::atoi(value.c_str());
    if (key == "--scenes") a.scenes = std::atoi(value.c_str());
    if (key == "--fixed") a.fixed = std::atoi(value.c_str());
    if (key == "--batch") a.batch = std::atoi(value.c_str());
    if (key == "--scene") a.scene = value;
  }
  if (!std::filesystem::exists(a.scene)) {
    std::printf("skipped: %s is missing; set GSP_DATA_DIR\n", a.scene.c_str());
    return 0;
  }
  auto const scene = gsp::io::to_gaussian_set(gsp::io::read_splats(a.scene), a.scene);
#if defined(KOKKOS_ENABLE_CUDA)
  run(Kokkos::Cuda{}, a, scene);
  if (a.worlds > 16) return 0;  // that many are meant for the device
#endif
  run(Kokkos::OpenMP{}, a, scene);
}
