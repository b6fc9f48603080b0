// gsp bench physics: robots, heaps and piles over the same window of steps again and again, beside MuJoCo in turn with --peers.
#include "physics.hpp"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <gsp/runtime/stage_times.hpp>
#include <random>
#include <thread>

#include "peer.hpp"
#include "run.hpp"
#include "scenes.hpp"

namespace gsp_cli {
namespace {

using gsp::runtime::Array;
using gsp::runtime::Buffer;
using gsp::runtime::host_array;
using nlohmann::ordered_json;

constexpr double start_noise = 0.05;   // of hinges and slides where there are several worlds [rad, m]
constexpr long long noise_steps = 64;  // then it comes again

struct Setup {
  PhysicsScene scene;
  Device device = Device::cpu;
  StepperOptions options;
  gsp::Description description;
  gsp::CompiledModel model;
  States start;
  std::vector<double> ctrl;  // (worlds + noise_steps - 1, nu), world w at step k has row w + k % noise_steps; or empty
  int repeats = 5;
};

/// Uniform in [-1, 1), the same with every compiler.
class Uniform {
 public:
  double operator()() { return 0x1p-52 * double(bits_() >> 11) - 1; }

 private:
  std::mt19937_64 bits_{1};
};

/// One world's state for all, with hinges and slides moved a little.
States scattered(States const& one, gsp::CompiledModel const& model, int worlds) {
  States out = spread(one, worlds);
  if (worlds == 1) return out;
  Uniform uniform;
  for (std::size_t w = 0; w < std::size_t(worlds); ++w)
    for (std::size_t j = 0; j < model.jnt_type.size(); ++j) {
      auto const type = gsp::JointType(model.jnt_type[j]);
      if (type != gsp::JointType::hinge && type != gsp::JointType::slide) continue;
      out.qpos[w * std::size_t(model.nq) + std::size_t(model.jnt_qposadr[j])] += start_noise * uniform();
    }
  return out;
}

/// The controls of the start with noise of this standard deviation: a world has what the one before it has a step later.
std::vector<double> noisy_controls(States const& start, gsp::CompiledModel const& model, double deviation) {
  if (deviation == 0 || model.nu == 0) return {};
  std::size_t const nu = std::size_t(model.nu);
  std::vector<double> out((std::size_t(start.worlds) + noise_steps - 1) * nu);
  Uniform uniform;
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = (start.ctrl.empty() ? 0 : start.ctrl[i % nu]) + std::sqrt(3.) * deviation * uniform();
  return out;
}

Setup set_up(PhysicsScene const& scene, Device device, Arguments const& a) {
  Setup s;
  s.scene = scene;
  s.scene.from = a.integer("--from", scene.from, 0, 1LL << 40);
  s.scene.steps = a.integer("--steps", scene.steps, 1, 1LL << 40);
  s.device = device;
  s.repeats = static_cast<int>(a.integer("--repeats", 5, 1, 10000));
  s.description = scene.make(a);
  s.description.sensors.clear();  // neither program senses
  s.model = compile_model(s.description);
  bool const many = device == Device::cuda && scene.worlds > 1;
  s.options.worlds = static_cast<int>(a.integer("--worlds", scene.worlds * (many ? 8 : 1), 1, 1 << 24));
  s.options.threads = threads_of(a);
  s.options.iterations = static_cast<int>(a.integer("--iterations", 0, 1, 1000000));
  s.options.friction_time = a.real("--friction-time", 0, 0, 1);
  if (a.has("--tolerance")) s.options.tolerance = a.real_from("--tolerance", 0, 0, 1);
  s.options.mujoco = a.choice("--profile", {"mujoco", "stable"}, "stable") == "mujoco";
  if (a.choice("--precision", {"float", "double"}, "float") == "double") s.options.precision = gsp::runtime::Dtype::float64;
  auto const keyframe = scene.keyframe.empty() ? a.text("--keyframe") : std::optional(a.text("--keyframe").value_or(scene.keyframe));
  s.start = scattered(initial_state(s.model, scene.name, keyframe), s.model, s.options.worlds);
  s.ctrl = noisy_controls(s.start, s.model, scene.noise);
  return s;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  std::size_t const n = values.size();
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}
double seconds_of(std::function<void()> const& work) {
  auto const start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// How fast windows of `seconds` were.
ordered_json rates_json(Setup const& s, std::vector<double> const& seconds) {
  double const steps = double(s.options.worlds) * double(s.scene.steps);
  auto const [least, most] = std::minmax_element(seconds.begin(), seconds.end());
  return {{"steps_per_second", steps / median(seconds)}, {"fastest", steps / *least}, {"slowest", steps / *most}};
}

/// How deep shapes that touch are in each other in the last step [m].
ordered_json penetration_json(Stepper& stepper) {
  auto const dist = stepper.contacts().dist;
  std::vector<double> host(std::size_t(dist.size()));
  if (!host.empty()) gsp::runtime::copy(dist, host_array(host.data(), {dist.extents[0]}));
  double sum = 0;
  double most = 0;
  long long count = 0;
  for (double const d : host) {
    if (d >= 0) continue;
    sum -= d;
    most = std::max(most, -d);
    ++count;
  }
  return {{"mean", count > 0 ? sum / double(count) : 0}, {"max", most}, {"contacts", count}};
}

/// How far free bodies went between two states of all worlds [m].
ordered_json drift_json(gsp::CompiledModel const& model, std::vector<double> const& from, std::vector<double> const& to) {
  double sum = 0;
  double most = 0;
  long long count = 0;
  for (std::size_t row = 0; row < from.size(); row += std::size_t(model.nq))
    for (std::size_t j = 0; j < model.jnt_type.size(); ++j) {
      if (gsp::JointType(model.jnt_type[j]) != gsp::JointType::free) continue;
      std::size_t const q = row + std::size_t(model.jnt_qposadr[j]);
      double const way = std::hypot(to[q] - from[q], to[q + 1] - from[q + 1], to[q + 2] - from[q + 2]);
      sum += way;
      most = std::max(most, way);
      ++count;
    }
  return {{"mean", count > 0 ? sum / double(count) : 0}, {"max", most}};
}

/// gsp's worlds, and the state in which the window begins.
class Own {
 public:
  explicit Own(Setup const& s) : setup_(&s), stepper_(gsp::runtime::make_stepper(s.device, s.model, s.options)) {
    set_states(*stepper_, s.start, s.model);
    if (s.ctrl.empty()) return;
    std::int64_t const rows = s.options.worlds + noise_steps - 1;
    controls_ = gsp::runtime::make_buffer(s.device, s.options.precision, {rows, s.model.nu});
    gsp::runtime::copy(host_array(s.ctrl.data(), {rows, s.model.nu}), controls_.array);
  }
  void begin_window() {
    step(setup_->scene.from);
    start_ = stepper_->save();
    std::vector<double> qvel;
    get_states(*stepper_, first_, qvel);
  }
  void run_window() {
    stepper_->restore(start_);
    seconds_.push_back(seconds_of([&] { step(setup_->scene.steps); }));
  }
  /// Once more, with a clock at each stage.
  ordered_json stages() {
    stepper_->restore(start_);
    double seconds = 0;
    auto const times = gsp::runtime::stage_times(setup_->device, [&] { seconds = seconds_of([&] { step(setup_->scene.steps); }); });
    ordered_json out = ordered_json::object();
    double const steps = double(setup_->options.worlds) * double(setup_->scene.steps);
    for (auto const& t : times) {
      out[t.name] = t.seconds / steps;
      seconds -= t.seconds;
    }
    out["other"] = seconds / steps;
    return out;
  }
  ordered_json json(double startup) {
    auto const& s = *setup_;
    auto const stage_seconds = stages();  // ends in the state of the window's end, as each of them
    auto out = steps_json(*stepper_, s.device, s.options.worlds, {median(seconds_), s.scene.steps}, startup);
    out.update(rates_json(s, seconds_));
    auto const counts = stepper_->counts();
    std::vector<double> qpos, qvel;
    get_states(*stepper_, qpos, qvel);
    out.update({{"stages", stage_seconds},
                {"row_sweeps", double(counts.rows) / s.options.worlds * counts.mean_iterations},
                {"penetration", penetration_json(*stepper_)},
                {"drift", drift_json(s.model, first_, qpos)},
                {"bytes_per_world", gsp::runtime::bytes_needed(s.device, s.model, s.options) / s.options.worlds},
                {"timestep", stepper_->timestep()},
                {"device", device_name(s.device, stepper_->threads())}});
    return out;
  }
  Stepper const& stepper() const { return *stepper_; }
  std::vector<double> const& seconds() const { return seconds_; }

 private:
  void step(long long steps) {
    for (long long k = 0; k < steps;) {
      if (controls_.array) gsp::runtime::copy(controls_.array.rows(k % noise_steps, setup_->options.worlds), stepper_->state().ctrl);
      bool const last = k + 1 == steps;  // whose residual is measured
      long long const at_once = last || controls_.array ? 1 : std::min(steps - 1 - k, 100000LL);
      stepper_->step({.steps = static_cast<int>(at_once), .measure_residual = last});
      k += at_once;
    }
  }

  Setup const* setup_;
  std::unique_ptr<Stepper> stepper_;
  Buffer controls_;
  std::vector<gsp::runtime::NamedArray> start_;
  std::vector<double> first_, seconds_;
};

/// MuJoCo's worlds with one of its solvers.
class Beside {
 public:
  Beside(Setup const& s, std::string const& library, std::string const& solver, int threads)
      : setup_(&s), solver_(solver), threads_(threads) {
    peer_ = make_mujoco(library, s.description, s.options.worlds, {.solver = solver, .threads = threads});
    peer_->start(s.start);
  }
  void begin_window() {
    peer_->step(setup_->scene.from, setup_->ctrl, noise_steps);
    peer_->save();
    std::vector<double> qvel;
    peer_->get(first_, qvel);
  }
  void run_window() {
    peer_->restore();
    seconds_.push_back(seconds_of([&] { peer_->step(setup_->scene.steps, setup_->ctrl, noise_steps); }));
  }
  /// ours: windows of gsp, each timed just before the one of MuJoCo.
  ordered_json json(std::vector<double> const& ours) const {
    std::vector<double> ratios;
    for (std::size_t i = 0; i < seconds_.size(); ++i) ratios.push_back(seconds_[i] / ours[i]);
    std::vector<double> qpos, qvel;
    peer_->get(qpos, qvel);
    ordered_json out{{"name", "MuJoCo 4.0.1"}, {"solver", solver_}, {"threads", threads_}};
    out.update(rates_json(*setup_, seconds_));
    auto const [least, most] = std::minmax_element(ratios.begin(), ratios.end());
    out.update({{"times_as_fast", {{"median", median(ratios)}, {"least", *least}, {"most", *most}}},
                {"penetration", penetration_of(qpos, qvel)},
                {"drift", drift_json(setup_->model, first_, qpos)},
                {"warning", peer_->warning()}});
    return out;
  }

 private:
  /// Of states of MuJoCo's, by gsp's shapes in double, so that both are measured alike.
  ordered_json penetration_of(std::vector<double> const& qpos, std::vector<double> const& qvel) const {
    auto const& m = setup_->model;
    StepperOptions options;
    options.worlds = setup_->options.worlds;
    options.precision = gsp::runtime::Dtype::float64;
    options.iterations = 1;
    auto const stepper = gsp::runtime::make_stepper(Device::cpu, m, options);
    stepper->set(host_array(qpos.data(), {options.worlds, m.nq}), host_array(qvel.data(), {options.worlds, m.nv}), {});
    stepper->step({.steps = 1});
    return penetration_json(*stepper);
  }

  Setup const* setup_;
  std::string solver_;
  int threads_;
  std::unique_ptr<Peer> peer_;
  std::vector<double> first_, seconds_;
};

std::vector<std::string> solvers(PhysicsScene const& scene, Arguments const& a) {
  if (!a.has("--peers")) return {};
  std::vector<std::string> const all{"newton", "cg", "pgs"};
  if (a.has("--peer-solver")) return a.list("--peer-solver", all, {});
  std::vector<std::string> out;
  for (auto const& name : all)
    if (scene.peers.find(name) != std::string::npos) out.push_back(name);
  return out;
}

int peer_threads(Own const& own, Arguments const& a) {
  if (own.stepper().threads() > 0) return own.stepper().threads();
  int const given = threads_of(a);
  return given > 0 ? given : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
}

ordered_json run_scene(PhysicsScene const& scene, Device device, Arguments const& a) {
  Setup const s = set_up(scene, device, a);
  expect_memory(std::to_string(s.options.worlds) + " worlds of " + scene.name, device,
                static_cast<std::uint64_t>(gsp::runtime::bytes_needed(device, s.model, s.options)),
                bytes_of_states(s.model, s.options.worlds) + 8 * s.ctrl.size(), "fewer --worlds");
  Own own(s);
  std::vector<Beside> beside;
  for (auto const& solver : solvers(scene, a)) beside.emplace_back(s, mujoco_file(a), solver, peer_threads(own, a));
  double const startup = seconds_since_start();
  own.begin_window();
  for (auto& peer : beside) peer.begin_window();
  Progress progress(scene.name, quiet(a));
  for (int r = 0; r < s.repeats; ++r) {
    own.run_window();
    for (auto& peer : beside) peer.run_window();
    progress.show(double(r + 1) / s.repeats);
  }
  progress.finish();
  ordered_json json{{"bench", "physics"}, {"scene", scene.name}};
  json.update(own.json(startup));
  json.update({{"dofs", s.model.nv},
               {"from", s.scene.from},
               {"steps", s.scene.steps},
               {"repeats", s.repeats},
               {"profile", s.options.mujoco ? "mujoco" : "stable"},
               {"precision", s.options.precision == gsp::runtime::Dtype::float64 ? "double" : "float"}});
  auto list = ordered_json::array();
  for (auto const& peer : beside) list.push_back(peer.json(own.seconds()));
  json["peers"] = list;
  return json;
}

double number(ordered_json const& json, char const* a) { return json[a].is_number() ? json[a].get<double>() : std::nan(""); }

void show(ordered_json const& j) {
  std::printf("%s: %d worlds, %lld steps of %g s after %lld, %s, on %s\n", j["scene"].get<std::string>().c_str(), j["worlds"].get<int>(),
              j["steps"].get<long long>(), number(j, "timestep"), j["from"].get<long long>(), j["precision"].get<std::string>().c_str(),
              j["device"].get<std::string>().c_str());
  auto const line = [](std::string const& name, ordered_json const& of) {
    std::printf("  %-20s %10.4g steps/s (%.4g to %.4g); mean penetration %.3g mm, drift %.3g mm\n", name.c_str(),
                number(of, "steps_per_second"), number(of, "slowest"), number(of, "fastest"), 1e3 * number(of["penetration"], "mean"),
                1e3 * number(of["drift"], "mean"));
  };
  line("gsp", j);
  for (auto const& peer : j["peers"]) {
    line("MuJoCo, " + peer["solver"].get<std::string>(), peer);
    auto const& ratio = peer["times_as_fast"];
    std::printf("    gsp is %.3g times as fast (%.3g to %.3g)%s\n", number(ratio, "median"), number(ratio, "least"), number(ratio, "most"),
                peer["warning"] == "" ? "" : ("; MuJoCo warned: " + peer["warning"].get<std::string>()).c_str());
  }
  std::printf("  last step: %lld contacts, %lld rows, %.3g sweeps a world, residual %.3g; %lld bytes a world\n",
              j["contacts"].get<long long>(), j["rows"].get<long long>(), number(j, "mean_iterations"), number(j, "residual"),
              j["bytes_per_world"].get<long long>());
  for (auto const& [stage, seconds] : j["stages"].items())
    std::printf("  %10.3f us a world  %s\n", 1e6 * seconds.get<double>(), stage.c_str());
}

/// The user's own file as a scene.
PhysicsScene scene_of_file(std::string const& path) {
  PhysicsScene out;
  out.name = path;
  out.make = +[](Arguments const& a) { return describe_model(*a.text("--model"), a, false, true); };
  return out;
}

std::vector<PhysicsScene> chosen(Arguments const& a) {
  a.exclusive("--scene", "--model", "both say what is stepped");
  if (auto const path = a.text("--model")) return {scene_of_file(*path)};
  auto const all = physics_scenes();
  if (a.text("--scene") == "all") return all;
  std::vector<std::string> names;
  for (auto const& s : all) names.push_back(s.name);
  std::vector<PhysicsScene> out;
  for (auto const& name : a.list("--scene", names, {names.front()}))
    for (auto const& s : all)
      if (s.name == name) out.push_back(s);
  return out;
}

std::string scene_help() {
  std::string made, read;
  for (auto const& s : physics_scenes()) (s.needs_files ? read : made) += s.name + " (" + s.what + "), ";
  return "with physics: of " + made + "and of files below $GSP_DATA_DIR/models: " + read + "with commas, or all; quadruped";
}

}  // namespace

std::vector<Option> physics_options() {
  return {{"--scene", "LIST", scene_help()},
          {"--model", "FILE", "with physics: a file of yours instead of a scene, from its initial pose or --keyframe"},
          {"--keyframe", "NAME|INDEX", "with physics: where all worlds start"},
          {"--from", "S", "with physics: steps before the window that is timed"},
          {"--steps", "K", "with physics: steps of the window"},
          {"--repeats", "R", "with physics: windows, each from the same state; the median counts, 5"},
          {"--iterations", "I", "with physics: as of gsp sim"},
          {"--tolerance", "T", "with physics: as of gsp sim"},
          {"--friction-time", "S", "with physics: as of gsp sim"},
          {"--profile", "mujoco|stable", "with physics: as of gsp sim"},
          {"--peers", "", "with physics: MuJoCo 4.0.1 in turn with gsp, on as many threads"},
          {"--peer-solver", "LIST", "of newton, cg (100 iterations), pgs (10), with commas; without it as suits the scene"},
          {"--mujoco", "FILE", "libmujoco.so.4.0.1; without it $GSP_MUJOCO"}};
}

int bench_physics(Arguments const& a) {
  a.needs("--peer-solver", "--peers", "it says how MuJoCo solves");
  a.needs("--mujoco", "--peers", "it says which library steps beside gsp");
  auto const scenes = chosen(a);
  if (a.has("--peers")) mujoco_file(a);
  Device const device = choose_device(a);
  gsp::runtime::Session const session(threads_of(a));
  for (auto const& scene : scenes) {
    auto const json = run_scene(scene, device, a);
    if (a.has("--json"))
      std::puts(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
    else
      show(json);
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace gsp_cli
