// gsp bench: timings of models and a scene that the library makes itself, so that two machines or versions can be compared without files;
// `physics` is in physics.cpp.
#include <chrono>
#include <cstdio>
#include <gsp/model/samples.hpp>

#include "commands.hpp"
#include "physics.hpp"
#include "run.hpp"
#include "view.hpp"

namespace gsp_cli {
namespace {

struct Scenario {
  char const *name, *what;
  gsp::Description (*make)();
  char const* keyframe;
  int worlds;       // on a CPU; a GPU gets 16 times as many
  long long steps;  // after as many that are not timed
};
std::vector<Scenario> scenarios() {
  using namespace gsp::samples;
  return {{"pendulum", "a double pendulum, no contact", +[] { return double_pendulum(); }, nullptr, 4096, 200},
          {"arm", "a six-axis arm with servos", +[] { return arm(); }, "home", 1024, 200},
          {"quadruped", "the quadruped among boxes and balls", +[] { return quadruped_scene(); }, "stand", 256, 100},
          {"stack", "ten boxes, one on the other", +[] { return stack(); }, nullptr, 256, 100},
          {"objects", "boxes and balls on a floor", +[] { return boxes_and_balls(); }, nullptr, 512, 100}};
}

nlohmann::ordered_json step_scenario(Scenario const& s, Device device, Arguments const& a) {
  auto const model = compile_model(s.make());
  StepperOptions options;
  options.worlds = static_cast<int>(a.integer("--worlds", s.worlds * (device == Device::cuda ? 16 : 1), 1, 1 << 24));
  options.threads = threads_of(a);
  bool const in_double = a.choice("--precision", {"float", "double"}, "float") == "double";
  if (in_double) options.precision = gsp::runtime::Dtype::float64;
  expect_memory(std::to_string(options.worlds) + " worlds of " + s.name, device,
                static_cast<std::uint64_t>(gsp::runtime::bytes_needed(device, model, options)), bytes_of_states(model, options.worlds),
                "fewer --worlds");
  auto const stepper = gsp::runtime::make_stepper(device, model, options);
  set_states(*stepper, initial_state(model, s.name, s.keyframe ? std::optional<std::string>(s.keyframe) : std::nullopt), model);
  double const startup = seconds_since_start();
  RunOptions run;
  run.steps = 2 * s.steps;
  run.time_from = s.steps;
  Progress progress(s.name, quiet(a));
  auto const timing = run_steps(*stepper, run, progress);
  progress.finish();
  nlohmann::ordered_json json{{"bench", s.name}};
  json.update(steps_json(*stepper, device, options.worlds, timing, startup));
  json.update({{"steps", timing.steps},
               {"profile", "stable"},
               {"precision", in_double ? "double" : "float"},
               {"device", device_name(device, stepper->threads())}});
  return json;
}

nlohmann::ordered_json draw_room(Device device, Arguments const& a) {
  gsp::runtime::Scene scene;
  scene.add_room();
  gsp::runtime::RendererOptions options;
  options.alpha = false;
  auto const renderer = gsp::runtime::make_renderer(device, scene, options);
  CameraFile cameras;
  int const count = static_cast<int>(a.integer("--worlds", device == Device::cuda ? 256 : 8, 1, 4096));
  for (int c = 0; c < count; ++c) add_camera(cameras, eye_in_room(c), {0, 0, 0.25}, 1.15, options.width, options.height);
  expect_memory(std::to_string(count) + " pictures", device, static_cast<std::uint64_t>(renderer->bytes_needed(count)), 0,
                "fewer --worlds");
  double const startup = seconds_since_start();
  int const repeat = 5;
  auto const there = cameras.arrays(0, cameras.count);
  renderer->render({}, there);  // buffers find their size
  auto const start = std::chrono::steady_clock::now();
  for (int r = 0; r < repeat; ++r) renderer->render({}, there);
  double const seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return {{"bench", "room"},
          {"seconds", seconds},
          {"frames_per_second", double(count) * repeat / seconds},
          {"startup_seconds", startup},
          {"peak_bytes", peak_bytes(device)},
          {"images", count},
          {"width", options.width},
          {"height", options.height},
          {"gaussians", scene.count()},
          {"device", device_name(device)}};
}

int run(Arguments const& a) {
  std::string const name = a.operands().front();
  std::vector<std::string> names{"all", "physics", "room"};
  for (auto const& s : scenarios()) names.push_back(s.name);
  if (std::find(names.begin(), names.end(), name) == names.end()) {
    std::string all;
    for (auto const& n : names) all += (all.empty() ? "" : ", ") + n;
    a.fail("there is no bench " + in_quotes(name) + "; there are " + all);
  }
  if (name == "physics") return bench_physics(a);
  for (auto const& option : physics_options())
    if (a.has(option.name)) a.fail(option.name + " is of bench physics; leave it out, or give physics instead of " + name);
  Device const device = choose_device(a);
  gsp::runtime::Session const session(threads_of(a));
  auto const show = [&](nlohmann::ordered_json const& json) {
    if (a.has("--json"))
      std::puts(json.dump().c_str());
    else if (json.contains("frames_per_second"))
      std::printf("%-10s %10.4g frames/s  (%d pictures of %d x %d, %d Gaussians)\n", "room", json["frames_per_second"].get<double>(),
                  json["images"].get<int>(), json["width"].get<int>(), json["height"].get<int>(), json["gaussians"].get<int>());
    else
      std::printf("%-10s %10.4g steps/s   (%d worlds, %lld contacts, %s)\n", json["bench"].get<std::string>().c_str(),
                  json["steps_per_second"].get<double>(), json["worlds"].get<int>(), json["contacts"].get<long long>(),
                  json["precision"].get<std::string>().c_str());
    std::fflush(stdout);
  };
  for (auto const& s : scenarios())
    if (name == s.name || name == "all") show(step_scenario(s, device, a));
  if (name == "room" || name == "all") show(draw_room(device, a));
  return 0;
}

}  // namespace

Command bench_command() {
  std::string names;
  for (auto const& s : scenarios()) names += std::string(s.name) + " (" + s.what + "), ";
  std::vector<Option> options{{"--worlds", "N", "worlds, or pictures of the room; without it a number that suits the device"},
                              {"--precision", "float|double", "float without the option"}};
  for (auto const& option : physics_options()) options.push_back(option);
  for (auto const& option : {device_option(), threads_option(), quiet_option()}) options.push_back(option);
  options.push_back({"--json", "", "print one JSON object a bench, or a scene"});
  return {
      "bench",
      "NAME",
      "times models that the library makes itself: " + names +
          "room (its pictures), all of these; and physics: robots, heaps and piles over one window of steps, beside MuJoCo with --peers",
      1,
      1,
      options,
      run};
}

}  // namespace gsp_cli
