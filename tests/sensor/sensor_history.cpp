// Late sensors on every backend, in float: tables of clocks, batches, copies, errors. tests/oracle/read_sensors.cpp has all rules.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/io/mjcf.hpp>
#include <gsp/sensor/read_sensors.hpp>
#include <gsp/sensor/sensor_delay.hpp>
#include <gsp/sensor/sensor_history.hpp>
#include <gsp/step/snapshot.hpp>
#include <gsp_test_execs.hpp>
#include <iterator>
#include <map>

#include "step/world.hpp"
#include "support/kernels.hpp"
#include "support/kokkos_tools.hpp"

namespace {
double away(std::vector<double> const& a, std::vector<double> const& b) {
  REQUIRE(a.size() == b.size());
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::fmax(worst, std::abs(a[i] - b[i]));
  return worst;
}
char const* const clocks =
    R"(<mujoco><option timestep=".01"/><worldbody><body><joint name="h" axis="0 1 0"/><geom size=".1" pos=".3 0 0"/></body></worldbody>
  <sensor><clock name="held" delay=".02" nsample="4"/><clock name="line" delay=".015" nsample="4" interp="linear"/><clock name="seldom" interval=".03 -.01" nsample="2"/>
  <jointpos name="angle" joint="h" delay=".037" nsample="7" interp="cubic"/></sensor></mujoco>)";

template <class Exec>
struct Late : gsp_test::World<float, Exec> {
  gsp::SensorHistory<float, typename Exec::memory_space> history;
  Kokkos::View<float**, Kokkos::LayoutRight, typename Exec::memory_space> data;
  explicit Late(int worlds)
      : gsp_test::World<float, Exec>(gsp::compile(gsp::io::parse_mjcf(clocks, "clocks.xml")), worlds),
        history(gsp::make_sensor_history<float>(this->exec, this->compiled, {.worlds = worlds})),
        data("data", worlds, this->compiled.nsensordata) {}
  /// What is true, and then what is said of it in world w.
  std::vector<double> read(int w) {
    this->exec.fence();
    auto const now = Kokkos::create_mirror_view(data);
    auto const steps = gsp_test::host(this->state.steps);
    auto const qpos = this->qpos();
    for (int world = 0; world < this->state.worlds; ++world) {
      for (int c = 0; c < 3; ++c) now(world, c) = 0.01F * float(steps(world));
      now(world, 3) = qpos(world, 0);
    }
    Kokkos::deep_copy(data, now);
    gsp::say_late(this->exec, this->state, history, data);
    this->exec.fence();
    Kokkos::deep_copy(now, data);
    std::vector<double> said;
    for (int c = 0; c < 4; ++c) said.push_back(now(w, c));
    return said;
  }
  /// A step; what was said at its start.
  std::vector<double> step(int w) {
    auto const said = read(w);
    gsp::record_sensors(this->exec, this->state, history);
    gsp::step(this->exec, this->model, this->state, this->sim);
    return said;
  }
};
}  // namespace

TEST_CASE_TEMPLATE("late clocks; any batch, worlds that are reset, copies", Exec, GSP_TEST_EXECS) {
  Late<Exec> s(3), alone(1);
  using Mem = typename Exec::memory_space;
  // 1e-6: floats of times below a second
  std::vector<std::vector<double>> const table{{0, 0, 0}, {0, 0, 0}, {0, .005, .02}, {.01, .015, .02}, {.02, .025, .02}, {.03, .035, .05}};
  for (auto const& row : table) {
    auto said = s.step(2);
    CHECK(said == alone.step(0));
    said.pop_back();
    CHECK(away(said, row) < 1e-6);
  }
  Kokkos::View<bool*, Mem> const mask("mask", 3);
  Kokkos::deep_copy(Kokkos::subview(mask, 1), true);
  gsp_test::check_algorithm(s.exec, gsp_test::watch([&] {
                              gsp::reset(s.exec, s.model, s.state, mask);
                              gsp::reset_sensor_history(s.exec, s.history, mask);
                            }));
  for (auto const& row : table) {
    auto said = s.step(1);
    said.pop_back();
    CHECK(away(said, row) < 1e-6);
    s.exec.fence();
  }
  auto const snapshot = gsp::make_snapshot(s.exec, s.state, s.sim);
  auto saved = gsp::make_sensor_history<float>(s.exec, s.compiled, {.worlds = 3});
  gsp_test::check_algorithm(s.exec, gsp_test::watch([&] { gsp::copy_sensor_history(s.exec, s.history, saved, gsp::detail::AllWorlds{}); }));
  std::vector<std::vector<double>> first, again;
  for (int k = 0; k < 10; ++k) first.push_back(s.step(2));
  gsp::restore(s.exec, snapshot, s.state, s.sim);
  gsp::copy_sensor_history(s.exec, saved, s.history, gsp::detail::AllWorlds{});
  for (int k = 0; k < 10; ++k) again.push_back(s.step(2));
  CHECK(first == again);

  s.read(0);
  gsp_test::check_algorithm(s.exec, gsp_test::watch([&] {
                              gsp::say_late(s.exec, s.state, s.history, s.data);
                              gsp::record_sensors(s.exec, s.state, s.history);
                            }));
  gsp::step(s.exec, s.model, s.state, s.sim);
  CHECK_THROWS_WITH_AS(
      gsp::record_sensors(s.exec, s.state, s.history),
      "gsp::record_sensors: the sensors' numbers are of the state before its last step or reset: call read_sensors before it",
      std::invalid_argument);
  CHECK_THROWS_AS(gsp::copy_sensor_history(s.exec, alone.history, s.history, Kokkos::View<bool*, Mem>("m", 2)), std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_sensor_history<float>(s.exec, s.compiled, {.worlds = 0}), std::invalid_argument);
  Kokkos::View<float**, Kokkos::LayoutRight, Mem> narrow("narrow", 3, 3);
  CHECK_THROWS_WITH_AS(gsp::say_late(s.exec, s.state, s.history, narrow),
                       "gsp::say_late: data has 3 columns, and 4 are read: give the view that the columns were chosen for",
                       std::invalid_argument);
  auto many = s.compiled;  // refused before anything is allocated
  many.sensor_dim[0] = 128;
  many.sensors[0].settings = {{"nsample", "16777216"}};
  CHECK_THROWS_AS(gsp::make_sensor_history<float>(s.exec, many), gsp::Error);
  auto broken = s.compiled;
  broken.sensors[0].settings = {{"delay", ".02"}};
  CHECK_THROWS_AS(gsp::make_sensor_history<float>(s.exec, broken), gsp::Error);
}

// Beside a loop of sums, whose bits they are: timesteps of decimals, of a float, of a power of two, and some whose sums are ties.
TEST_CASE_TEMPLATE("the clock of late sensors is the sum of all timesteps, however many came since it was read", Exec, GSP_TEST_EXECS) {
  for (double const h : {.01, .002, double(.002F), 1. / 64, 3. / 7, 1 + std::ldexp(1., -52), 1 + 3 * std::ldexp(1., -52)}) {
    Late<Exec> s(2);
    s.history.timestep = h;
    double clock = 0;
    std::int64_t steps = 0;
    for (std::int64_t const now : {std::int64_t(5), std::int64_t(1) << 20, (std::int64_t(1) << 21) + 7, (std::int64_t(1) << 24) + 3}) {
      for (; steps < now; ++steps) clock += h;
      Kokkos::deep_copy(Kokkos::subview(s.state.steps, 1), now);
      gsp::say_late(s.exec, s.state, s.history, s.data);
      s.exec.fence();
      CHECK_MESSAGE(gsp_test::host(s.history.clock)(1) == clock, "timestep " << h << ", step " << now);
      CHECK(gsp_test::host(s.history.clock)(0) == 0);
    }
  }
}

namespace {
/// A ramp of slope 1, 2, 3 ... in worlds 0, 1, 2 ...; column 1 has its negative.
template <class Exec>
struct Ramp {
  using Mem = typename Exec::memory_space;
  using View = Kokkos::View<double**, Kokkos::LayoutRight, Mem>;
  Exec exec;
  View x, y;
  double t = 0;
  int first;
  explicit Ramp(int worlds, int first_world = 0) : x("x", worlds, 2), y("y", worlds, 2), first(first_world) {}
  template <class Delay>
  std::vector<double> read(Delay& delay, double dt) {
    auto const host = Kokkos::create_mirror_view(x);
    for (int w = 0; w < int(x.extent(0)); ++w) {
      host(w, 0) = (w + first + 1) * t;
      host(w, 1) = -host(w, 0);
    }
    Kokkos::deep_copy(x, host);
    gsp::delay_sensor(exec, delay, dt, x, y);
    exec.fence();
    t += dt;
    auto const said = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace(), y);
    std::vector<double> out;
    for (int w = 0; w < int(y.extent(0)); ++w) {
      CHECK(said(w, 1) == -said(w, 0));
      out.push_back(said(w, 0) / (w + first + 1));
    }
    return out;
  }
};
}  // namespace

// A line is interpolated without error but for rounding, 1e-13.
TEST_CASE_TEMPLATE("latency of a ramp: held, on a line, of worlds' own, with jitter, reset; any batch", Exec, GSP_TEST_EXECS) {
  double const dt = 0.01;
  Exec const exec;
  Ramp<Exec> held(2), line(2), own(3), shaken(4), part(2, 2);
  auto hold = gsp::make_sensor_delay<double>(exec, {.worlds = 2, .numbers = 2, .latency = .034, .samples = 5});
  auto straight = gsp::make_sensor_delay<double>(
      exec, {.worlds = 2, .numbers = 2, .latency = .034, .samples = 5, .interpolation = gsp::Interpolation::linear});
  auto each = gsp::make_sensor_delay<double>(
      exec, {.worlds = 3, .numbers = 2, .samples = 9, .interpolation = gsp::Interpolation::linear, .per_world = true});
  auto const latencies = Kokkos::create_mirror_view(each.latency);
  for (int w = 0; w < 3; ++w) latencies(w, 0) = .013 * w;
  Kokkos::deep_copy(each.latency, latencies);
  gsp::SensorDelayOptions jitter{.worlds = 4,
                                 .numbers = 2,
                                 .latency = .02,
                                 .jitter = .03,
                                 .samples = 6,
                                 .interpolation = gsp::Interpolation::linear,
                                 .seed = 5,
                                 .sensor = 7};
  auto shake = gsp::make_sensor_delay<double>(exec, jitter);
  jitter.worlds = 2;
  jitter.first_world = 2;
  auto rest = gsp::make_sensor_delay<double>(exec, jitter);
  std::vector<double> last(4, 0);
  double least = 1, most = 0;
  for (int k = 0; k < 200; ++k) {
    double const t = k * dt;
    for (double const x : held.read(hold, dt)) CHECK(std::abs(x - std::fmax(0, (k - 4) * dt)) < 1e-13);
    for (double const x : line.read(straight, dt)) CHECK(std::abs(x - std::fmax(0, t - .034)) < 1e-13);
    auto const said = own.read(each, dt);
    for (int w = 0; w < 3; ++w) CHECK(std::abs(said[w] - std::fmax(0, t - .013 * w)) < 1e-13);
    auto const late = shaken.read(shake, dt), same = part.read(rest, dt);
    CHECK(same == std::vector<double>{late[2], late[3]});
    for (int w = 0; w < 4; ++w) {
      CHECK(late[w] >= last[w]);
      last[w] = late[w];
      if (k < 10) continue;
      least = std::fmin(least, t - late[w]);
      most = std::fmax(most, t - late[w]);
    }
    CHECK((k < 10 || late[0] != late[1]));
  }
  // 800 uniform numbers in 30 ms, at the longer end cut by what was read before: both ends within 1 ms and 5 ms
  CHECK(least >= .02 - 1e-13);
  CHECK(least < .021);
  CHECK(most <= .05 + 1e-13);
  CHECK(most > .045);

  Kokkos::View<bool*, typename Exec::memory_space> const mask("mask", 2);
  Kokkos::deep_copy(Kokkos::subview(mask, 1), true);
  gsp_test::check_algorithm(exec, gsp_test::watch([&] {
                              gsp::reset_sensor_delay(exec, hold, mask);
                              gsp::delay_sensor(exec, hold, dt, held.x, held.y);
                            }));
  auto const after = held.read(hold, dt);
  CHECK(std::abs(after[0] - (held.t - dt - .04)) < .0101);  // the last sample came twice
  CHECK(std::abs(after[1] - 199 * dt) < 1e-13);             // its first sample

  CHECK_THROWS_WITH_AS(gsp::delay_sensor(exec, hold, .005, held.x, held.y),
                       "gsp::delay_sensor: 5 samples are kept, and latency and jitter need 8: make_sensor_delay with {.samples = ...}",
                       std::invalid_argument);
  CHECK_THROWS_AS(gsp::delay_sensor(exec, hold, 0, held.x, held.y), std::invalid_argument);
  CHECK_THROWS_AS(gsp::delay_sensor(exec, hold, dt, own.x, own.y), std::invalid_argument);
  CHECK_THROWS_AS(gsp::delay_sensor(exec, hold, dt, held.x, typename Ramp<Exec>::View("z", 2, 1)), std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_sensor_delay<double>(exec, {.latency = -1}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_sensor_delay<double>(exec, {.numbers = 2, .columns = {1}}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_sensor_delay<double>(exec, {.numbers = 2, .columns = {1, 1}}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_sensor_delay<double>(exec, {.numbers = 1 << 16, .samples = 1 << 15}), std::invalid_argument);

  // save, and go on from there: the same again
  jitter.worlds = 4;
  jitter.first_world = 0;
  auto saved = gsp::make_sensor_delay<double>(exec, jitter);
  gsp::copy_sensor_delay(exec, shake, saved);
  double const t = shaken.t;
  std::vector<std::vector<double>> first, again;
  for (int k = 0; k < 20; ++k) first.push_back(shaken.read(shake, dt));
  gsp::copy_sensor_delay(exec, saved, shake);
  shaken.t = t;
  for (int k = 0; k < 20; ++k) again.push_back(shaken.read(shake, dt));
  CHECK(first == again);
  CHECK_THROWS_AS(gsp::copy_sensor_delay(exec, hold, shake), std::invalid_argument);
}

namespace {
/// World w is late by w readings; how often it said another reading than that.
template <class Exec>
int readings_missed(double dt, double latency, int worlds, int readings) {
  using Mem = typename Exec::memory_space;
  using View = Kokkos::View<double**, Kokkos::LayoutRight, Mem>;
  Exec const exec;
  View const x("x", worlds, 1), y("y", worlds, 1);
  Kokkos::View<int*, Mem> const missed("missed", worlds);
  auto delay = gsp::make_sensor_delay<double>(exec, {.worlds = worlds, .samples = worlds + 8, .per_world = true});
  auto const latencies = Kokkos::create_mirror_view(delay.latency);
  for (int w = 0; w < worlds; ++w) latencies(w, 0) = w * latency;
  Kokkos::deep_copy(delay.latency, latencies);
  for (int k = 0; k < readings; ++k) {
    Kokkos::deep_copy(exec, x, double(k));
    gsp::delay_sensor(exec, delay, dt, x, y);
    Kokkos::parallel_for(
        "count", Kokkos::RangePolicy<Exec>(exec, 0, worlds), KOKKOS_LAMBDA(int w) { missed(w) += y(w, 0) != (k > w ? k - w : 0); });
  }
  exec.fence();
  int sum = 0;
  auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace(), missed);
  for (int w = 0; w < worlds; ++w) sum += host(w);
  return sum;
}
}  // namespace

// Whole readings: which one it is leaves no error. The last: a step of a float, whose latency is the decimal's.
TEST_CASE_TEMPLATE("a latency of w readings is that of w readings, whatever its multiple of dt rounds", Exec, GSP_TEST_EXECS) {
  for (double const dt : {.001, .002, .01, 1. / 60}) CHECK_MESSAGE(readings_missed<Exec>(dt, dt, 24, 100000) == 0, "dt " << dt);
  CHECK(readings_missed<Exec>(double(.01F), .01, 24, 100000) == 0);
}

// Beside a sorted list: a sample of a time that is there takes its place, any other that of the oldest.
TEST_CASE("samples in any order of their times") {
  gsp_test::Random r{11};
  constexpr int n = 7;
  double time[n], value[n];
  int cursor = n - 1;
  std::map<double, double> list;
  for (int i = 0; i < n; ++i) {
    time[i] = i - n;
    value[i] = r();
    list[time[i]] = value[i];
  }
  gsp::detail::SampleRing<double> const ring{time, value, &cursor, n, 1, 1e-15};
  for (int k = 0; k < 3000; ++k) {
    double const newest = list.rbegin()->first, t = k % 3 == 0 ? newest + std::abs(r()) : std::floor(8 * (newest + 4 * r())) / 8, x = r();
    if (list.find(t) == list.end()) list.erase(list.begin());
    list[t] = *ring.insert(t) = x;
    double const at = newest + 5 * r();
    auto const after = list.lower_bound(at);
    double line = after == list.end() ? list.rbegin()->second : after->second, held = line;
    if (after != list.end() && after != list.begin() && after->first != at) {
      auto const before = std::prev(after);
      held = before->second;
      line = held + (after->second - held) * (at - before->first) / (after->first - before->first);
    }
    ring.read(at, gsp::Interpolation::hold, [&](int, double said) { CHECK(said == held); });
    ring.read(at, gsp::Interpolation::linear, [&](int, double said) { CHECK(std::abs(said - line) < 1e-13); });
  }
}

TEST_CASE("settings of late sensors, as a description has them") {
  auto const settings = [](std::vector<std::array<std::string, 2>> const& given) {
    return gsp::history_settings({.type = "clock", .settings = given});
  };
  auto const all = settings({{"delay", "0.02"}, {"interval", ".5 -.1"}, {"nsample", "7"}, {"interp", "cubic"}});
  CHECK(all.fault.empty());
  CHECK(std::vector<double>{all.delay, all.period, all.phase} == std::vector<double>{.02, .5, -.1});
  CHECK(all.samples == 7);
  CHECK(all.interpolation == gsp::Interpolation::cubic);
  CHECK(settings({{"interval", ".5"}}).fault.empty());
  for (auto const& bad : std::vector<std::array<std::string, 2>>{{"delay", "x"},
                                                                 {"delay", "1 2"},
                                                                 {"delay", "-1"},
                                                                 {"interval", "1 2 3"},
                                                                 {"interval", ".5 x"},
                                                                 {"nsample", "-1"},
                                                                 {"nsample", "nan"},
                                                                 {"interp", "spline"}})
    CHECK_MESSAGE(!settings({bad}).fault.empty(), bad[0] << ' ' << bad[1]);
}

// A clock that is two steps late.
TEST_CASE("late sensors, as docs/sensor/sensor_history.md has them") {
  Kokkos::DefaultExecutionSpace const exec;
  gsp::Description robot;
  robot.option.timestep = 0.01;
  robot.sensors.push_back({.name = "late", .type = "clock", .settings = {{"delay", "0.02"}, {"nsample", "4"}}});
  auto const compiled = gsp::compile(robot);
  auto const model = gsp::make_model<double>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = 1});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = 1});
  auto sensors = gsp::make_sensors(exec, model, compiled, {.worlds = 1});
  Kokkos::View<double**, Kokkos::LayoutRight, Kokkos::DefaultExecutionSpace::memory_space> data("data", 1, compiled.nsensordata);
  for (int k = 0; k < 6; ++k) {
    // example-begin sensor_history
    gsp::forward(exec, model, state, sim);
    gsp::read_sensors(exec, model, state, sim, sensors, data);  // late sensors say what they have measured
    gsp::record_sensors(exec, state, sensors.history);          // they measure what is true now, once a step
    gsp::advance(exec, model, state, sim);
    // example-end sensor_history
    CHECK(std::abs(gsp_test::host(data)(0, 0) - (k < 2 ? 0 : 0.01 * (k - 2))) < 1e-12);
  }
}
