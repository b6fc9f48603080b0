// Late sensors on every backend, in float: tables of clocks, batches, copies, errors. tests/oracle/sensor_history.cpp has all rules.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/sensor/sensor_history.hpp>
#include <gsp/step/snapshot.hpp>
#include <gsp_test_execs.hpp>

#include "sensor/sensor_scene.hpp"
#include "support/kokkos_tools.hpp"

namespace {
char const* const clocks =
    R"(<mujoco><option timestep=".01"/><worldbody><body><joint name="h" axis="0 1 0"/><geom size=".1" pos=".3 0 0"/></body></worldbody>
  <sensor><clock name="held" delay=".02" nsample="4"/><clock name="line" delay=".015" nsample="4" interp="linear"/><clock name="seldom" interval=".03 -.01" nsample="2"/>
  <jointpos name="angle" joint="h" delay=".037" nsample="7" interp="cubic"/></sensor></mujoco>)";

template <class Exec>
struct Late : gsp_test::SensedWorld<Exec, float> {
  using gsp_test::SensedWorld<Exec, float>::SensedWorld;
  /// A step; what was said at its start of world w.
  std::vector<double> step(int w) {
    this->read();
    std::vector<double> said;
    for (char const* const name : {"held", "line", "seldom", "angle"}) said.push_back((*this)(name, w)[0]);
    gsp::record_sensors(this->exec, this->state, this->sensors.history);
    gsp::advance(this->exec, this->model, this->state, this->sim);
    return said;
  }
};
}  // namespace

TEST_CASE_TEMPLATE("late clocks; any batch, worlds that are reset, copies", Exec, GSP_TEST_EXECS) {
  Late<Exec> s(clocks, gsp::Profile::stable, 3), alone(clocks, gsp::Profile::stable);
  using Mem = typename Exec::memory_space;
  // 1e-6: floats of times below a second
  std::vector<std::vector<double>> const table{{0, 0, 0}, {0, 0, 0}, {0, .005, .02}, {.01, .015, .02}, {.02, .025, .02}, {.03, .035, .05}};
  for (auto const& row : table) {
    auto said = s.step(2);
    CHECK(said == alone.step(0));
    said.pop_back();
    CHECK(gsp_test::away(said, row) < 1e-6);
  }
  Kokkos::View<bool*, Mem> const mask("mask", 3);
  Kokkos::deep_copy(Kokkos::subview(mask, 1), true);
  gsp_test::check_algorithm(s.exec, gsp_test::watch([&] {
                              gsp::reset(s.exec, s.model, s.state, mask);
                              gsp::reset_sensor_history(s.exec, s.sensors.history, mask);
                            }));
  for (auto const& row : table) {
    auto said = s.step(1);
    said.pop_back();
    CHECK(gsp_test::away(said, row) < 1e-6);
    s.exec.fence();
  }
  auto const snapshot = gsp::make_snapshot(s.exec, s.state, s.sim);
  auto saved = gsp::make_sensor_history<float>(s.exec, s.compiled, {.worlds = 3});
  gsp_test::check_algorithm(s.exec,
                            gsp_test::watch([&] { gsp::copy_sensor_history(s.exec, s.sensors.history, saved, gsp::detail::AllWorlds{}); }));
  std::vector<std::vector<double>> first, again;
  for (int k = 0; k < 10; ++k) first.push_back(s.step(2));
  gsp::restore(s.exec, snapshot, s.state, s.sim);
  gsp::copy_sensor_history(s.exec, saved, s.sensors.history, gsp::detail::AllWorlds{});
  for (int k = 0; k < 10; ++k) again.push_back(s.step(2));
  CHECK(first == again);

  s.read();
  gsp_test::check_algorithm(s.exec, gsp_test::watch([&] {
                              gsp::say_late(s.exec, s.state, s.sensors.history, s.data);
                              gsp::record_sensors(s.exec, s.state, s.sensors.history);
                            }));
  gsp::advance(s.exec, s.model, s.state, s.sim);
  CHECK_THROWS_WITH_AS(
      gsp::record_sensors(s.exec, s.state, s.sensors.history),
      "gsp::record_sensors: the sensors' numbers are of the state before its last step or reset: call read_sensors before it",
      std::invalid_argument);
  CHECK_THROWS_AS(gsp::copy_sensor_history(s.exec, alone.sensors.history, s.sensors.history, Kokkos::View<bool*, Mem>("m", 2)),
                  std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_sensor_history<float>(s.exec, s.compiled, {.worlds = 0}), std::invalid_argument);
  auto broken = s.compiled;
  broken.sensors[0].settings = {{"delay", ".02"}};
  CHECK_THROWS_AS(gsp::make_sensor_history<float>(s.exec, broken), gsp::Error);
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
