// gsp quickstart: the main job from end to end. A robot and a scene (of the library's own making, or of the user's files), many worlds,
// steps with contact, pictures of every world from its own camera, and how fast that was.
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <gsp/io/apng.hpp>
#include <gsp/io/colormap.hpp>
#include <gsp/io/npy.hpp>
#include <gsp/io/ply.hpp>
#include <gsp/io/png.hpp>
#include <gsp/io/video.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/samples.hpp>
#include <thread>

#include "commands.hpp"
#include "placement.hpp"
#include "progress.hpp"
#include "run.hpp"
#include "view.hpp"

namespace gsp_cli {
namespace {

using Clock = std::chrono::steady_clock;
double since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

std::string text(char const* format, auto... values) {
  char out[256];
  std::snprintf(out, sizeof out, format, values...);
  return out;
}

/// 1234567 -> "1.23 M"
std::string short_count(double x) {
  char const* const unit[] = {"", " k", " M", " G"};
  int k = 0;
  for (; x >= 1000 && k < 3; ++k) x /= 1000;
  return text("%.3g%s", x, unit[k]);
}

/// What is shown: the middle of the model's moving bodies, and how far they reach from it.
struct Subject {
  std::array<double, 3> center{0, 0, 0.25};
  double radius = 1;
};

/// The moving bodies of the first world: middle of their geoms and reach.
Subject subject_of(gsp::CompiledModel const& m, gsp::runtime::PoseArrays const& poses) {
  std::vector<double> pos(3 * static_cast<std::size_t>(m.nbody));
  std::vector<double> quat(4 * static_cast<std::size_t>(m.nbody));
  gsp::runtime::copy(poses.xpos.rows(0, 1), gsp::runtime::host_array(pos.data(), {1, m.nbody, 3}));
  gsp::runtime::copy(poses.xquat.rows(0, 1), gsp::runtime::host_array(quat.data(), {1, m.nbody, 4}));
  std::array<double, 3> low{INFINITY, INFINITY, INFINITY};
  std::array<double, 3> high{-INFINITY, -INFINITY, -INFINITY};
  for (std::size_t g = 0; g < m.geom_body.size(); ++g) {
    std::size_t const b = static_cast<std::size_t>(m.geom_body[g]);
    if (m.body_tree[b] < 0) continue;
    auto const x = gsp::detail::rotate({quat[4 * b], quat[4 * b + 1], quat[4 * b + 2], quat[4 * b + 3]}, m.geom_pos[g]);
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], pos[3 * b + k] + x[k] - m.geom_rbound[g]);
      high[k] = std::max(high[k], pos[3 * b + k] + x[k] + m.geom_rbound[g]);
    }
  }
  if (!(low[0] <= high[0])) return {};
  return {{(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2},
          std::max(0.1, 0.5 * std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]))};
}

/// Where camera `w` stands: in the sample room, else on a ring about the model, in directions where nothing stands between (clear: metres
/// in 72 of them).
std::array<double, 3> eye_of(int w, Subject const& s, std::vector<double> const& clear) {
  if (clear.empty()) return eye_in_room(w);
  double const wanted = 2.2 * s.radius, most = *std::max_element(clear.begin(), clear.end());
  std::vector<std::size_t> open;
  for (std::size_t k = 0; k < clear.size(); ++k)
    if (clear[k] >= std::min(wanted, 0.8 * most)) open.push_back(k);
  std::size_t const k = open[static_cast<std::size_t>(w) * 29 % open.size()];
  double const turn = 2 * std::numbers::pi * double(k) / double(clear.size()), r = std::clamp(0.9 * clear[k] - 0.1, 0.6 * s.radius, wanted);
  double const height = std::sqrt(std::max(0., 1.3 * wanted * wanted - r * r)) * (0.55 + 0.12 * scatter(w, 77));  // near cameras look down
  return {s.center[0] + r * std::cos(turn), s.center[1] + r * std::sin(turn), s.center[2] + height};
}

/// Starts: the keyframe, and in the sample scene objects that roll and slide towards the robot, in each world otherwise.
States starts(gsp::CompiledModel const& model, States const& one, int worlds, bool sample) {
  if (!sample) return one;  // for all
  States all = spread(one, worlds);
  for (int w = 0; w < worlds; ++w)
    for (int j = 1; j < model.njnt; ++j) {  // joint 0 is the robot's own
      if (model.jnt_type[static_cast<std::size_t>(j)] != int(gsp::JointType::free)) continue;
      double* const q = &all.qpos[static_cast<std::size_t>(w) * model.nq + model.jnt_qposadr[static_cast<std::size_t>(j)]];
      double* const v = &all.qvel[static_cast<std::size_t>(w) * model.nv + model.jnt_dofadr[static_cast<std::size_t>(j)]];
      double const x = q[0], y = q[1], r = std::hypot(x, y), speed = 0.7 + 0.5 * scatter(w, 10 * j), aside = 0.35 * scatter(w, 10 * j + 1),
                   turn = 0.3 * scatter(w, 10 * j + 2);
      q[0] = (std::cos(turn) * x - std::sin(turn) * y) * (1 + 0.08 * scatter(w, 10 * j + 3));
      q[1] = (std::sin(turn) * x + std::cos(turn) * y) * (1 + 0.08 * scatter(w, 10 * j + 4));
      q[2] += 0.15 + 0.15 * scatter(w, 10 * j + 5);
      v[0] = (-x - aside * y) / r * speed;
      v[1] = (-y + aside * x) / r * speed;
      for (int k = 3; k < 6; ++k) v[k] = 2.5 * scatter(w, 10 * j + k + 3);
    }
  return all;
}

/// The scene as files: what `gsp sim` and `gsp render` need to step and draw the same worlds.
void write_scene(std::string const& folder, gsp::Description const& description, gsp::CompiledModel const& model,
                 gsp::io::SplatSet const& scan, States const& start, CameraFile const& cameras, long long steps) {
  make_folder(folder, "--files");
  std::filesystem::path const at(folder);
  gsp::io::write_mjcf(at / "model.xml", description);
  gsp::io::write_ply(at / "scene.ply", scan);
  std::size_t const worlds = static_cast<std::size_t>(start.worlds), nu = static_cast<std::size_t>(model.nu);
  write_trace((at / "start.npz").string(), {1, worlds, {start.time}, start.qpos, start.qvel, start.act}, model);
  std::vector<double> ctrl(static_cast<std::size_t>(steps) * nu);  // one row a step
  if (!start.ctrl.empty())
    for (std::size_t i = 0; i < ctrl.size(); ++i) ctrl[i] = start.ctrl[i % nu];
  gsp::io::write_npy(at / "ctrl.npy", {{static_cast<std::size_t>(steps), nu}, ctrl});
  gsp::io::write_npz(at / "cameras.npz", {{"viewmats", {{worlds, 4, 4}, cameras.viewmats}}, {"Ks", {{worlds, 3, 3}, cameras.Ks}}});
}

int run(Arguments const& a) {
  bool const own = a.has("--model") || a.has("--splat");
  if (own && !a.has("--model"))
    a.fail("--splat needs --model FILE.xml: give both files, or none for the robot and room that the library makes");
  if (own && !a.has("--splat"))
    a.fail("--model needs --splat FILE: give both files, or none for the robot and room that the library makes");
  a.needs("--splat-pose", "--splat", "it places that scene");
  a.needs("--keyframe", "--model", "it is one of that model");
  a.needs("--skip-visuals", "--model", "it is about that model");
  std::string const out = a.text("--out").value_or("out");
  int const threads = threads_of(a);
  Device const device = choose_device(a);
  bool const gpu = device == Device::cuda;
  int const worlds = static_cast<int>(
      a.integer("--worlds", gpu ? 1024 : std::clamp(16 * static_cast<int>(std::thread::hardware_concurrency()), 16, 128), 1, 1 << 20));
  double const seconds = a.real("--seconds", 2, 0, 3600);
  int const width = static_cast<int>(a.integer("--width", 320, 16, 4096)), height = static_cast<int>(a.integer("--height", 240, 16, 4096));

  std::vector<NamedFile> inputs, outputs;
  for (char const* option : {"--model", "--splat"})
    for (auto const& file : a.all(option)) inputs.push_back({option, file});
  for (auto const& folder : a.all("--files"))
    for (char const* name : {"model.xml", "scene.ply", "start.npz", "ctrl.npy", "cameras.npz"})
      outputs.push_back({"--files", (std::filesystem::path(folder) / name).string()});
  expect_apart(inputs, outputs);

  auto const begin = Clock::now();
  gsp::Description description;
  gsp::CompiledModel model;
  States one;
  Subject subject;
  gsp::io::SplatSet scan;
  std::vector<double> clear;
  std::string const model_name = a.text("--model").value_or("sample quadruped"), splat_name = a.text("--splat").value_or("");
  bool floor_added = false;
  int servos = 0;
  std::string turned;
  if (own) {
    description = describe_model(model_name, a, false);
    floor_added = add_floor(description);
    servos = motors_to_servos(description);
    model = compile_model(description);
    auto const first = model.keyframes.empty() ? std::nullopt : std::optional<std::string>("0");
    one = initial_state(model, model_name, a.has("--keyframe") ? a.text("--keyframe") : first);
    hold(model, servos, one);
  } else {
    description = gsp::samples::quadruped_scene();
    model = compile_model(description);
    one = initial_state(model, model_name, "stand");
  }
  gsp::runtime::Session const session(threads);
  StepperOptions stepping;
  stepping.worlds = worlds;
  stepping.threads = threads;
  expect_memory(std::to_string(worlds) + " worlds of " + model_name, device,
                static_cast<std::uint64_t>(gsp::runtime::bytes_needed(device, model, stepping)), 2 * bytes_of_states(model, worlds),
                "fewer --worlds");
  auto const stepper = gsp::runtime::make_stepper(device, model, stepping);
  auto start = starts(model, one, worlds, !own);
  set_states(*stepper, start, model);
  if (own) {
    subject = subject_of(model, stepper->poses());
    if (a.has("--splat-pose")) {
      scan = load_splats(splat_name, gsp::io::parse_splat_pose(*a.text("--splat-pose")));
    } else {
      scan = load_splats(splat_name, {});
      auto pose = standing_pose(scan);
      for (std::size_t k = 0; k < 2; ++k) pose.position[k] += subject.center[k];
      turned = text("%.6g %.6g %.6g %.7g %.7g %.7g %.7g %.6g", pose.position[0], pose.position[1], pose.position[2], pose.quat[0],
                    pose.quat[1], pose.quat[2], pose.quat[3], pose.scale);
      gsp::io::transform(scan, gsp::io::parse_splat_pose(turned));  // what is said is what is done
    }
    clear = clear_directions(scan, subject.center, 0.1, 1.2);
  }
  gsp::runtime::Scene scene;
  bool linked = false;
  if (own)
    linked = scene.add_set(scan, splat_name, model);
  else
    scene.add_room();
  if (!linked) scene.add_surface(model);
  gsp::runtime::RendererOptions pictures;
  pictures.width = width;
  pictures.height = height;
  pictures.alpha = false;
  auto const renderer = gsp::runtime::make_renderer(device, scene, pictures);
  int const portion = std::min(worlds, gpu ? 1024 : 64);
  expect_memory(std::to_string(portion) + " pictures of " + std::to_string(width) + " x " + std::to_string(height), device,
                static_cast<std::uint64_t>(renderer->bytes_needed(portion)), 0, "a smaller --width and --height");
  CameraFile cameras;
  for (int w = 0; w < worlds; ++w) add_camera(cameras, eye_of(w, subject, clear), subject.center, 1.05, width, height);
  long long const steps = std::max(1LL, static_cast<long long>(std::llround(seconds / stepper->timestep())));
  if (auto const folder = a.text("--files")) {
    start = spread(start, worlds);
    write_scene(*folder, description, model, own ? scan : gsp::runtime::room_set(), start, cameras, steps);
  }
  scan = {};
  start = {};
  double const load = since(begin);
  std::FILE* const say = a.has("--json") ? stderr : stdout;
  if (auto const s = summary(model); own && !s.empty() && !quiet(a))
    std::fprintf(say, "%s: %s ('gsp info' lists them)\n", model_name.c_str(), s.c_str());
  if (floor_added) std::fprintf(say, "%s: nothing in it stands still to be touched, so a floor at z = 0 is added\n", model_name.c_str());
  if (servos > 0)
    std::fprintf(say, "%s: its %d motors are taken as servos that hold the start, since there is no policy\n", model_name.c_str(), servos);
  if (!turned.empty())
    std::fprintf(say,
                 "%s: taken as a capture with y down and turned upright, its floor put at z = 0 and the widest free piece of it below the "
                 "robot, as --splat-pose \"%s\" does\n",
                 splat_name.c_str(), turned.c_str());
  std::fprintf(say, "%s, %s Gaussians, %d worlds, on %s\n",
               own ? model_name.c_str() : "a quadruped among boxes and balls in a furnished room",
               short_count(double(scene.count())).c_str(), worlds, device_name(device).c_str());

  // Steps, all worlds; the first world's poses are kept for the animation. All stays on the device.
  long long const every = std::max(1LL, static_cast<long long>(std::llround(0.04 / stepper->timestep())));
  std::int64_t const most_frames = steps / every + 1;
  auto const film_xpos = gsp::runtime::make_buffer(device, stepping.precision, {most_frames, model.nbody, 3});
  auto const film_xquat = gsp::runtime::make_buffer(device, stepping.precision, {most_frames, model.nbody, 4});
  std::int64_t frames = 0;
  auto const film_world = [&](long long) {
    auto const poses = stepper->poses();
    gsp::runtime::copy(poses.xpos.rows(0, 1), film_xpos.array.rows(frames, 1));
    gsp::runtime::copy(poses.xquat.rows(0, 1), film_xquat.array.rows(frames, 1));
    ++frames;
  };
  film_world(0);
  Progress stepping_bar("stepping", quiet(a));
  RunOptions run;
  run.steps = steps;
  run.every = every;
  run.record = film_world;
  auto const timing = run_steps(*stepper, run, stepping_bar);
  double const steps_per_second = double(worlds) * double(timing.steps) / timing.seconds;
  auto const counts = stepper->counts();
  stepping_bar.finish(text("%lld steps of %d worlds in %.2f s", steps, worlds, timing.seconds));

  // One picture of every world, RGB and depth, where the steps have left its bodies.
  Progress drawing_bar("drawing every world", quiet(a));
  auto const poses = stepper->poses();
  renderer->render(poses.of_worlds(0, portion), cameras.arrays(0, static_cast<std::size_t>(portion)));  // untimed: buffers find their size
  double drawing = 0;
  int const shown = std::min(worlds, 16);
  int const columns = std::min(shown, 4);
  std::size_t const pixels = static_cast<std::size_t>(width) * height;
  std::vector<float> sheet_rgb(3 * pixels * shown);
  std::vector<float> sheet_depth(pixels * shown);
  for (int first = 0; first < worlds; first += portion) {
    int const n = std::min(portion, worlds - first);
    auto const views = cameras.arrays(static_cast<std::size_t>(first), static_cast<std::size_t>(n));
    auto const start_of_drawing = Clock::now();
    renderer->render(poses.of_worlds(first, n), views);
    drawing += since(start_of_drawing);
    if (first == 0) {
      auto const there = renderer->frames();
      gsp::runtime::copy(there.rgb.rows(0, shown), gsp::runtime::host_array(sheet_rgb.data(), {shown, height, width, 3}));
      gsp::runtime::copy(there.depth.rows(0, shown), gsp::runtime::host_array(sheet_depth.data(), {shown, height, width}));
    }
    drawing_bar.show(double(first + n) / worlds);
  }
  double const frames_per_second = worlds / drawing;
  drawing_bar.finish(text("%d pictures of %d x %d in %.2f s", worlds, width, height, drawing));

  // A loop as learning runs it: a step of all worlds, then a picture of each, on the device throughout.
  int const rounds = 3;
  auto const start_of_loop = Clock::now();
  for (int k = 0; k < rounds; ++k) {
    stepper->step({.steps = 1});
    for (int first = 0; first < worlds; first += portion) {
      int const n = std::min(portion, worlds - first);
      renderer->render(stepper->poses().of_worlds(first, n), cameras.arrays(static_cast<std::size_t>(first), static_cast<std::size_t>(n)));
    }
  }
  double const loop_seconds = since(start_of_loop) / rounds;
  double const loop_frames_per_second = worlds / loop_seconds;
  double const share_of_slower = std::max(drawing, timing.seconds / double(timing.steps)) / loop_seconds;

  // The animation: one world, a camera that stands still; as an mp4 too, where there is ffmpeg.
  make_folder(out, "--out");
  auto const file = [&](char const* name) { return (std::filesystem::path(out) / name).string(); };
  Progress film_bar("animation", quiet(a));
  double const rate = 1 / (double(every) * stepper->timestep());  // as fast as it is
  std::optional<gsp::io::VideoWriter> video;
  std::string no_video = "no animation.mp4, since there is no ffmpeg in PATH: install it (Debian, Ubuntu: apt-get install ffmpeg)";
  auto const to_video = [&](auto const& f) {  // without it all else is done
    try {
      f();
    } catch (Error const& error) {
      video.reset();
      no_video = error.what();
    }
  };
  to_video([&] {
    if (!gsp::io::find_ffmpeg().empty()) video.emplace(file("animation.mp4"), gsp::io::VideoOptions{.frames_per_second = rate});
  });
  gsp::io::ApngWriter animation({.frames_per_second = rate});
  std::int64_t const together = std::min<std::int64_t>(frames, gpu ? 64 : 8);
  CameraFile still;
  for (int k = 0; k < together; ++k) add_camera(still, eye_of(0, subject, clear), subject.center, 0.9, width, height);
  std::vector<float> film(3 * pixels * static_cast<std::size_t>(together));
  for (std::int64_t first = 0; first < frames; first += together) {
    std::int64_t const n = std::min(together, frames - first);
    renderer->render({film_xpos.array.rows(first, n), film_xquat.array.rows(first, n), {}, {}},
                     still.arrays(0, static_cast<std::size_t>(n)));
    gsp::runtime::copy(renderer->frames().rgb, gsp::runtime::host_array(film.data(), {n, height, width, 3}));
    for (std::int64_t k = 0; k < n; ++k) {
      auto const frame = gsp::io::to_bitmap8(&film[3 * pixels * static_cast<std::size_t>(k)], width, height, 3);
      animation.add(frame);
      to_video([&] {
        if (video) video->write(frame);
      });
    }
    film_bar.show(double(first + n) / double(frames));
  }
  to_video([&] {
    if (video) video->finish();
  });
  film_bar.finish(text("%lld frames", static_cast<long long>(frames)));

  // Files, once all is done.
  std::vector<gsp::io::Bitmap8> rgb, color;
  std::vector<gsp::io::Bitmap16> depth;
  float near = INFINITY, far = 0;
  for (std::size_t i = 0; i < pixels * shown; ++i) {
    if (!(sheet_depth[i] > 0)) continue;
    near = std::min(near, sheet_depth[i]);
    far = std::max(far, sheet_depth[i]);
  }
  for (int k = 0; k < shown; ++k) {
    rgb.push_back(gsp::io::to_bitmap8(&sheet_rgb[3 * pixels * k], width, height, 3));
    color.push_back(gsp::io::depth_to_color(&sheet_depth[pixels * k], width, height, {.near = near, .far = far}));
    depth.push_back(gsp::io::depth_to_bitmap16(&sheet_depth[pixels * k], width, height));
  }
  gsp::io::write_png(file("worlds.png"), gsp::io::contact_sheet<std::uint8_t>(rgb, columns, 4, 255));
  gsp::io::write_png(file("depth_color.png"), gsp::io::contact_sheet<std::uint8_t>(color, columns, 4, 255));
  gsp::io::write_png(file("depth_mm.png"), gsp::io::contact_sheet<std::uint16_t>(depth, columns));
  gsp::io::write_file(file("animation.png"), animation.finish());

  if (a.has("--json")) {
    auto json = steps_json(*stepper, device, worlds, timing, load);
    json.update({{"frames_per_second", frames_per_second},
                 {"loop_frames_per_second", loop_frames_per_second},
                 {"loop_share_of_slower", share_of_slower},
                 {"steps", steps},
                 {"gaussians", scene.count()},
                 {"device", device_name(device)},
                 {"video", video ? nlohmann::json(file("animation.mp4")) : nlohmann::json()}});
    std::puts(json.dump().c_str());
  } else {
    std::puts("");
    auto const row = [](char const* name, std::string const& value) { std::printf("  %-10s %s\n", name, value.c_str()); };
    row("load", text("%.2f s", load));
    row("steps/s",
        short_count(steps_per_second) + text("  (%d worlds x %lld steps of %g s, float, profile stable; last step: %.1f contacts a world)",
                                             worlds, steps, stepper->timestep(), double(counts.contacts) / worlds));
    row("frames/s", short_count(frames_per_second) + text("  (%d x %d, RGB and depth, %s Gaussians, every world its own camera)", width,
                                                          height, short_count(double(scene.count())).c_str()));
    row("loop", short_count(loop_frames_per_second) +
                    text(" frames/s  (a step and a picture of every world in turn: %.0f %% of the slower alone)", 100 * share_of_slower));
    row("memory", short_count(double(peak_bytes(device))) + "B at most" + (gpu ? " on the GPU" : ""));
    std::printf(
        "\n  %s  %d worlds\n  %s  their depth in colour, %.2f m (red) to %.2f m (blue)\n  %s  the same in millimetres, 16 bits\n  %s  the "
        "first world, %.2f s\n",
        file("worlds.png").c_str(), shown, file("depth_color.png").c_str(), near, far, file("depth_mm.png").c_str(),
        file("animation.png").c_str(), double(steps) * stepper->timestep());
    if (video)
      std::printf("  %s  the same\n", file("animation.mp4").c_str());
    else
      std::printf("  %s\n", no_video.c_str());
  }
  say_stopped("quickstart", *stepper, model, worlds, "'gsp sim --timestep' takes smaller steps");
  return 0;
}

}  // namespace

Command quickstart_command() {
  return {"quickstart",
          "",
          "robot and Gaussian scene to pictures: steps many worlds, draws each from its own camera, writes a contact sheet, depth and an "
          "animation, as an mp4 too where there is ffmpeg",
          0,
          0,
          {{"--out", "DIR", "where the pictures go: out"},
           {"--model", "FILE.xml", "your robot instead of the sample quadruped; with --splat"},
           {"--splat", "FILE", "your Gaussians instead of the sample room; with --model"},
           {"--splat-pose", "\"x y z qw qx qy qz scale\"",
            "where they stand; without it they are taken as y-down captures, turned upright, their floor put at z = 0 and its widest free "
            "piece below the model"},
           {"--keyframe", "NAME|INDEX", "where your robot starts; its first keyframe, if there is one"},
           skip_visuals_option(),
           decompose_option(),
           approximate_option(),
           floating_base_option(),
           package_option(),
           {"--worlds", "N", "16 a core of the CPU, at most 128; 1024 on a GPU"},
           {"--seconds", "S", "of simulated time, 2"},
           {"--files", "DIR",
            "also write the scene as files that gsp sim and gsp render take: model.xml, scene.ply, start.npz, ctrl.npy, cameras.npz"},
           {"--width", "W", "of a picture, 320"},
           {"--height", "H", "of a picture, 240"},
           device_option(),
           threads_option(),
           quiet_option(),
           {"--json", "", "print one JSON object instead of the table"}},
          run};
}

}  // namespace gsp_cli
