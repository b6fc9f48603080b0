// The programs of docs/tutorial.md: their code, their model and what they print are those of the page. With GSP_WRITE_SNIPPETS=1 what they
// print is written into it.
#include <doctest/doctest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <gsp/gsp.hpp>
#include <string>
#include <vector>

namespace {
namespace fs = std::filesystem;

/// The page as lines, and its blocks behind marks such as <!-- prints: pendulum -->.
struct Page {
  fs::path path = fs::path(GSP_TEST_DIR).parent_path() / "docs/tutorial.md";
  std::vector<std::string> lines;
  Page() {
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);) lines.push_back(line);
  }
  /// First line and end of the block.
  std::pair<std::size_t, std::size_t> block(std::string const& mark) const {
    for (std::size_t i = 0; i + 2 < lines.size(); ++i) {
      if (lines[i] != "<!-- " + mark + " -->") continue;
      std::size_t end = i + 2;
      while (end < lines.size() && lines[end] != "```") ++end;
      return {i + 2, end};
    }
    FAIL("the page has no block behind <!-- " << mark << " -->");
    return {};
  }
  std::string text(std::string const& mark) const {
    auto const [first, end] = block(mark);
    std::string out;
    for (std::size_t i = first; i < end; ++i) out += lines[i] + "\n";
    return out;
  }
};

/// Takes what is printed to stdout since the last `is`, and compares it with a block of the page.
class Printed {
 public:
  Printed() : kept_(::dup(1)), file_(std::tmpfile()) {
    std::fflush(stdout);
    ::dup2(::fileno(file_), 1);
  }
  ~Printed() {
    std::fflush(stdout);
    ::dup2(kept_, 1);
    ::close(kept_);
    std::fclose(file_);
  }
  void is(std::string const& name) {
    std::fflush(stdout);
    std::string text;
    std::rewind(file_);
    for (int c; (c = std::fgetc(file_)) != EOF;) text += char(c);
    std::rewind(file_);
    REQUIRE(::ftruncate(::fileno(file_), 0) == 0);
    Page page;
    if (std::getenv("GSP_WRITE_SNIPPETS")) {
      auto const [first, end] = page.block("prints: " + name);
      std::ofstream out(page.path);
      for (std::size_t i = 0; i < first; ++i) out << page.lines[i] << "\n";
      out << text;
      for (std::size_t i = end; i < page.lines.size(); ++i) out << page.lines[i] << "\n";
    } else {
      CHECK_MESSAGE(text == page.text("prints: " + name), "docs/tutorial.md, " << name << "; GSP_WRITE_SNIPPETS=1 writes it");
    }
  }

 private:
  int kept_;
  std::FILE* file_;
};

/// A folder of the test's own, where it stands while this lives.
struct Inside {
  fs::path before = fs::current_path(), path = fs::temp_directory_path() / ("gsp_tutorial_" + std::to_string(::getpid()));
  Inside() {
    fs::create_directories(path);
    fs::current_path(path);
  }
  ~Inside() {
    if (char const* const keep = std::getenv("GSP_KEEP_PICTURES"))
      for (auto const& file : fs::directory_iterator(path)) fs::copy(file, keep, fs::copy_options::overwrite_existing);
    fs::current_path(before);
    fs::remove_all(path);
  }
};
}  // namespace

TEST_CASE("pendulum") {
  Printed printed;
  // example-begin pendulum_start
  Kokkos::DefaultExecutionSpace const exec;

  gsp::Description description;
  int const rod = gsp::add_body(description, 0, "rod", {0, 0, 1});
  description.bodies[rod].joints.push_back({.name = "hinge", .axis = {0, 1, 0}});
  gsp::GeomDescription ball;
  ball.size = {0.05, 0, 0};  // [m]
  ball.pos = {0, 0, -0.5};   // below the hinge
  description.bodies[rod].geoms.push_back(ball);

  auto const compiled = gsp::compile(description);
  std::printf("%d bodies (the world is one), %d degree of freedom, %.3f kg\n", compiled.nbody, compiled.nv, compiled.body_mass[rod]);
  // example-end pendulum_start
  printed.is("pendulum_start");

  // example-begin pendulum_steps
  auto const model = gsp::make_model<float>(exec, compiled, {.timestep = 0.002});
  auto state = gsp::make_state(exec, model, {.worlds = 1});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = 1});

  Kokkos::deep_copy(state.qpos, 0.3f);  // [rad]
  for (int k = 0; k < 5; ++k) {
    auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
    std::printf("after %.1f s: %6.3f rad\n", 0.002 * 100 * k, qpos(0, 0));
    gsp::step(exec, model, state, sim, {.steps = 100});
  }
  // example-end pendulum_steps
  printed.is("pendulum_steps");

  // example-begin pendulum_worlds
  int const worlds = 1000;
  auto many = gsp::make_state(exec, model, {.worlds = worlds});
  auto buffers = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  Kokkos::View<float*> const period("period", worlds);
  auto const qpos = many.qpos, qvel = many.qvel;
  Kokkos::parallel_for(
      "start", Kokkos::RangePolicy<>(exec, 0, worlds), KOKKOS_LAMBDA(int w) { qpos(w, 0) = 0.002f * float(w + 1); });

  for (int t = 1; t <= 1000; ++t) {
    gsp::launch_step(exec, model, many, buffers);
    Kokkos::parallel_for(
        "watch", Kokkos::RangePolicy<>(exec, 0, worlds), KOKKOS_LAMBDA(int w) {  // at the far side: half a period
          if (period(w) == 0 && qvel(w, 0) > 0) period(w) = 0.004f * (float(t) - 0.5f);
        });
  }
  std::printf("%d steps to be launched again\n", gsp::settle(exec, buffers));  // waits; nothing collides, so no pool is too small

  auto const seconds = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, period);
  double const d = 0.5, small = 2 * std::acos(-1.) * std::sqrt((d + 0.4 * 0.05 * 0.05 / d) / 9.81);
  for (int w : {99, 499, 749}) {
    double const a = 0.002 * (w + 1);  // amplitude
    std::printf("from %.1f rad: a period of %.3f s, in closed form %.3f s\n", a, seconds(w),
                small * (1 + a * a / 16 + 11 * std::pow(a, 4) / 3072 + 173 * std::pow(a, 6) / 737280));
  }
  // example-end pendulum_worlds
  printed.is("pendulum_worlds");
}

#if defined(GSP_IO)
TEST_CASE("rover") {
  Inside const folder;
  std::ofstream("rover.xml") << Page().text("file: rover.xml");
  Printed printed;
  // example-begin rover_read
  Kokkos::DefaultExecutionSpace const exec;

  auto const description = gsp::io::read_mjcf("rover.xml");
  for (auto const& line : description.report)
    std::printf("%s:%d: %s: %s\n", line.file.c_str(), line.line, gsp::text(line.kind), line.text.c_str());
  auto const compiled = gsp::compile(description);
  std::printf("%d bodies, %d degrees of freedom, %d motors\n", compiled.nbody, compiled.nv, compiled.nu);
  // example-end rover_read
  printed.is("rover_read");

  // example-begin rover_drive
  int const worlds = 4;
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  auto const qvel = state.qvel, ctrl = state.ctrl;

  Kokkos::parallel_for(
      "drive", Kokkos::RangePolicy<>(exec, 0, worlds), KOKKOS_LAMBDA(int w) {
        ctrl(w, 0) = 5 - 0.5f * float(w);  // left and right wheel [rad/s]: world 0 straight on, the others ever more to the left
        ctrl(w, 1) = 5 + 0.5f * float(w);
      });
  gsp::step(exec, model, state, sim, {.steps = 500});

  auto const v = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, qvel);  // free joint: velocity, then angular velocity
  std::printf("world 0: %.2f m/s, wheels of 0.08 m at 5 rad/s\n", std::hypot(v(0, 0), v(0, 1)));
  std::printf("world 2: turns by %.2f rad/s\n", v(2, 5));
  // example-end rover_drive
  printed.is("rover_drive");

  // example-begin rover_scene
  auto const room = gsp::sample_room<gsp::GaussianSet>();             // or a capture of yours
  auto const skin = gsp::sample_surface(compiled, {.world = false});  // the room has a floor of its own
  auto const cloud = gsp::make_gaussians(exec, {room, skin});         // once for all worlds
  std::printf("%zu Gaussians of the room, %zu of the rover\n", room.size(), skin.size());
  // example-end rover_scene
  printed.is("rover_scene");

  // example-begin rover_pictures
  int const width = 320, height = 240;
  auto mounts = gsp::make_camera_mounts(
      exec, model, compiled,
      {{.body = "world", .pos = {-0.3, -0.8, 0.5}, .look_at = gsp::Double3{0.45, 0.1, 0.05}, .fovy = 0.9}, {.camera = "eye"}},
      {.worlds = worlds, .width = width, .height = height});
  auto cameras = gsp::make_cameras(exec, mounts.images());
  auto frames = gsp::make_frames(exec, cloud, {.images = mounts.images(), .width = width, .height = height});

  gsp::cameras_of(exec, model, sim.poses, mounts, cameras);
  gsp::render(exec, cloud, sim.poses, cameras, frames);  // image 2 w: from outside, 2 w + 1: the rover's eye

  auto const rgb = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, frames.rgb);
  std::vector<gsp::io::Bitmap8> pictures;
  for (int i : {0, 1, 6, 7}) pictures.push_back(gsp::io::to_bitmap8(&rgb(i, 0, 0, 0), width, height, 3));  // worlds 0 and 3
  gsp::io::write_png("rover.png", gsp::io::contact_sheet(pictures, 2));
  auto const depth = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, frames.depth);
  std::printf("rover.png: %d pictures drawn, 4 kept; straight ahead of world 0: %.1f m\n", mounts.images(),
              depth(1, height / 2, width / 2));
  // example-end rover_pictures
  printed.is("rover_pictures");

  // example-begin rover_loop
  int const small = 32;
  auto eyes = gsp::make_camera_mounts(exec, model, compiled, {{.camera = "eye"}}, {.worlds = worlds, .width = small, .height = small});
  auto views = gsp::make_cameras(exec, worlds);
  auto seen = gsp::make_frames(exec, cloud, {.images = worlds, .width = small, .height = small});
  auto const ahead = seen.depth;

  gsp::reset(exec, model, state);
  gsp::forward_kinematics(exec, model, state, sim.poses, sim.dynamics);
  for (int t = 0; t < 60; ++t) {  // 12.5 pictures a second
    gsp::cameras_of(exec, model, sim.poses, eyes, views);
    gsp::render(exec, cloud, sim.poses, views, seen);
    Kokkos::parallel_for(
        "policy", Kokkos::RangePolicy<>(exec, 0, worlds), KOKKOS_LAMBDA(int w) {
          float nearest = 100;
          for (int column = 8; column < 24; ++column) nearest = Kokkos::fmin(nearest, ahead(w, small / 2, column));
          float const speed = Kokkos::fmin(10.f, 8 * Kokkos::fmax(0.f, nearest - 0.6f));  // slower when something is near
          ctrl(w, 0) = speed * (1 - 0.04f * float(w + 1));
          ctrl(w, 1) = speed * (1 + 0.04f * float(w + 1));
        });
    gsp::step(exec, model, state, sim, {.steps = 40});
  }
  auto const stopped = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, seen.depth);
  auto const place = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
  for (int w = 0; w < worlds; ++w)
    std::printf("world %d: at (%.1f, %.1f) m, %.1f m before what it sees\n", w, place(w, 0), place(w, 1), stopped(w, small / 2, small / 2));
  // example-end rover_loop
  printed.is("rover_loop");
}

// The README's program: pictures of every world by the robot's own camera. What it sees of a wall is where the wall is.
TEST_CASE("readme") {
  Inside const folder;
  gsp::io::write_mjcf("robot.xml", gsp::samples::quadruped_scene());
  auto wall = gsp::io::make_splat_set(1, 0);
  wall.positions = {4, 0, 0.5f};
  wall.scales = {0.001f, 100, 100};
  wall.opacities = {0.99f};
  gsp::io::write_ply("kitchen.ply", wall);
  Kokkos::DefaultExecutionSpace const exec;
  int const n = 3;
  // example-begin readme
  auto const robot = gsp::compile(gsp::io::read_mjcf("robot.xml"));  // host: flat arrays by MuJoCo's rules
  auto const model = gsp::make_model<float>(exec, robot);            // device, constant
  auto state = gsp::make_state(exec, model, {.worlds = n});
  auto simulation = gsp::make_simulation(exec, model, robot, {.worlds = n});
  gsp::step(exec, model, state, simulation, {.steps = 100});

  auto const room = gsp::io::to_gaussian_set(gsp::io::read_splats("kitchen.ply"), robot, "kitchen.ply");
  auto const cloud = gsp::make_gaussians(exec, {room, gsp::sample_surface(robot, {.world = false})});
  auto mounts = gsp::make_camera_mounts(exec, model, robot, {{.camera = "head"}}, {.worlds = n, .width = 128, .height = 96});
  auto cameras = gsp::make_cameras(exec, mounts.images());
  auto frames = gsp::make_frames(exec, cloud, {.images = n, .width = 128, .height = 96});
  gsp::cameras_of(exec, model, simulation.poses, mounts, cameras);
  gsp::render(exec, cloud, simulation.poses, cameras, frames);  // RGB, expected depth, alpha of every world
  // example-end readme
  auto const depth = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, frames.depth);
  auto const views = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, cameras.viewmats);
  for (int w = 0; w < n; ++w) {
    float z = views(w, 2, 3);  // of the wall's Gaussian in the camera
    for (int c = 0; c < 3; ++c) z += views(w, 2, c) * wall.positions[c];
    CHECK(z > 3);
    CHECK(depth(w, 48, 64) == doctest::Approx(z).epsilon(1e-5));  // one Gaussian: its depth, to rounding
  }
}
#endif
