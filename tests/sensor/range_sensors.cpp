// Rangefinders of sites in closed form, world by world. (Beside MuJoCo: tests/oracle/read_sensors.cpp.)
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/sensor/range_sensors.hpp>
#include <gsp_test_execs.hpp>

#include "sensor/sensor_scene.hpp"
#include "support/kokkos_tools.hpp"

using gsp_test::SensedWorld;

// A unit looks down from z, turned by `a` about y: the floor is z / cos a away. Its own body is not seen, of its child the ball is; the
// place of the joint differs from world to world. Within 1e-12 of numbers of the size of 1.
TEST_CASE_TEMPLATE("a rangefinder says how far the floor is, and all of its fields", Exec, GSP_TEST_EXECS) {
  int const worlds = 19;
  SensedWorld<Exec> s(
      R"(<mujoco><worldbody><geom name="floor" type="plane" size="0 0 1"/><body pos="0 0 1.5"><joint axis="0 1 0"/><geom size=".1" mass="1" contype="0" conaffinity="0"/>
    <site name="down" quat="0 1 0 0"/><body pos="0 0 .6"><geom size=".1" contype="0" conaffinity="0"/></body><site name="up"/></body></worldbody>
    <sensor><rangefinder name="all" site="down" data="dist dir origin point normal depth"/><rangefinder name="near" site="down" cutoff="1"/><rangefinder name="up" site="up"/></sensor></mujoco>)",
      gsp::Profile::stable, worlds);
  CHECK(s.sensors.left_out.empty());
  auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, s.state.qpos);
  for (int w = 0; w < worlds; ++w) qpos(w, 0) = 0.05 * w - 0.4;
  Kokkos::deep_copy(s.state.qpos, qpos);
  gsp::forward(s.exec, s.model, s.state, s.sim);
  gsp_test::check_algorithm(s.exec, gsp_test::watch([&] { gsp::range_sensors(s.exec, s.model, s.state, s.sim.poses, s.sensors, s.data); }));
  for (int w = 0; w < worlds; ++w) {
    CAPTURE(w);
    double const a = 0.05 * w - 0.4, away = 1.5 / std::cos(a), dir[3] = {-std::sin(a), 0, -std::cos(a)};
    auto const all = s("all", w);
    REQUIRE(all.size() == 14);
    auto const near = [](double x, double y) { return std::abs(x - y) < 1e-12; };
    CHECK(near(all[0], away));
    CHECK(near(all[13], away));
    for (std::size_t c = 0; c < 3; ++c) {
      CHECK(near(all[1 + c], dir[c]));
      CHECK(near(all[4 + c], c == 2 ? 1.5 : 0));
      CHECK(near(all[7 + c], (c == 2 ? 1.5 : 0) + away * dir[c]));
      CHECK(near(all[10 + c], c == 2 ? 1 : 0));
    }
    CHECK(s("near", w)[0] == 1);
    CHECK(near(s("up", w)[0], 0.5));
  }
  gsp::step(s.exec, s.model, s.state, s.sim, {.poses = false});
  CHECK_THROWS_AS(gsp::range_sensors(s.exec, s.model, s.state, s.sim.poses, s.sensors, s.data), std::invalid_argument);
}
