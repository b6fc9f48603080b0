// Rangefinders and sensors of distances in closed form, world by world. (Beside MuJoCo: tests/oracle/read_sensors.cpp.)
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <gsp/sensor/distance_sensors.hpp>
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

// A camera looks down from z, at another height in each world: all of its pixels are as deep, whatever the ray's length. A ball above the
// floor and beside a box, which hangs on a body of two geoms: the nearest is measured. Within 1e-12 of numbers of the size of 1.
TEST_CASE_TEMPLATE("pixels of a camera, and distances between bodies", Exec, GSP_TEST_EXECS) {
  int const worlds = 19;
  SensedWorld<Exec> s(
      R"(<mujoco><worldbody><geom name="floor" type="plane" size="0 0 1"/><body name="ball" pos="0 0 1.5"><joint type="slide" axis="0 0 1"/><geom name="g" size=".25" contype="0" conaffinity="0"/>
    <camera name="c" pos="0 0 1" resolution="5 3" fovy="20"/></body><body name="other" pos="1.25 0 0"><geom type="box" size=".5 1 1" contype="0" conaffinity="0"/><geom size=".25" pos="5 0 0" contype="0" conaffinity="0"/></body>
    </worldbody><sensor><rangefinder name="depth" camera="c" data="dist depth"/><rangefinder name="cut" camera="c" data="depth" cutoff="2"/>
    <distance name="above" geom1="floor" geom2="g" cutoff="9"/><fromto name="way" geom1="floor" geom2="g" cutoff="9"/><normal name="up" geom1="floor" geom2="g" cutoff="9"/>
    <distance name="deep" geom1="floor" geom2="g"/><fromto name="beside" body1="ball" body2="other" cutoff="9"/><distance name="far" body1="other" body2="ball" cutoff=".3"/></sensor></mujoco>)",
      gsp::Profile::stable, worlds);
  CHECK(s.sensors.left_out.empty());
  auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, s.state.qpos);
  for (int w = 0; w < worlds; ++w) qpos(w, 0) = 0.1 * w - 1.4;
  Kokkos::deep_copy(s.state.qpos, qpos);
  gsp::forward(s.exec, s.model, s.state, s.sim);
  gsp_test::check_algorithm(s.exec, gsp_test::watch([&] {
                              gsp::range_sensors(s.exec, s.model, s.state, s.sim.poses, s.sensors, s.data);
                              gsp::distance_sensors(s.exec, s.model, s.state, s.sim.poses, s.sensors, s.data);
                            }));
  auto const near = [](double x, double y) { return std::abs(x - y) < 1e-12; };
  for (int w = 0; w < worlds; ++w) {
    CAPTURE(w);
    double const z = 0.1 * w + 0.1, dist = z - 0.25, focal = 1.5 / std::tan(M_PI / 18);
    auto const depth = s("depth", w), cut = s("cut", w);
    REQUIRE(depth.size() == 30);
    for (int k = 0; k < 15; ++k) {
      double const x = (k % 5 - 2) / focal, y = (k / 5 - 1) / focal;
      CHECK(near(depth[std::size_t(2 * k)], (z + 1) * std::sqrt(1 + x * x + y * y)));
      CHECK(near(depth[std::size_t(2 * k + 1)], z + 1));
      CHECK(near(cut[std::size_t(k)], std::fmin(z + 1, 2)));
    }
    CHECK(near(s("above", w)[0], dist));
    CHECK(near(s("deep", w)[0], std::fmin(dist, 0)));
    CHECK(gsp_test::away(s("way", w), {0, 0, 0, 0, 0, dist}) < 1e-12);
    CHECK(gsp_test::away(s("up", w), {0, 0, dist < 0 ? -1. : 1.}) < 1e-12);
    double const above = std::fmax(z - 1, 0), apart = std::hypot(0.75, above);  // of the ball's middle from the box, whose side is at .75
    CHECK(gsp_test::away(s("beside", w), {0.25 * 0.75 / apart, 0, z - 0.25 * above / apart, 0.75, 0, std::fmin(z, 1)}) < 1e-12);
    CHECK(near(s("far", w)[0], 0.3));
  }
  gsp::step(s.exec, s.model, s.state, s.sim, {.poses = false});
  CHECK_THROWS_AS(gsp::distance_sensors(s.exec, s.model, s.state, s.sim.poses, s.sensors, s.data), std::invalid_argument);
}

// A camera that tracks a subtree's centre of mass measures how far it sees and how it is accelerated: one sum over the trees does for all
// that is read at once, and what is read part by part is the same.
TEST_CASE_TEMPLATE("centres of mass are summed once for all sensors", Exec, GSP_TEST_EXECS) {
  SensedWorld<Exec> s(
      R"(<mujoco><worldbody><geom type="plane" size="0 0 1"/><body name="a" pos="0 0 2"><joint type="hinge" axis="0 1 0"/><geom size=".1" pos=".3 0 0"/>
    <camera name="c" mode="trackcom" pos="0 0 1" resolution="4 2"/></body></worldbody>
    <sensor><rangefinder name="depth" camera="c"/><framelinacc name="acc" objtype="camera" objname="c"/><subtreecom name="com" body="a"/></sensor></mujoco>)",
      gsp::Profile::stable, 3);
  CHECK(s.sensors.left_out.empty());
  auto const qpos = s.qpos();
  for (int w = 0; w < 3; ++w) qpos(w, 0) = 0.3 * w;
  Kokkos::deep_copy(s.state.qpos, qpos);
  gsp::forward(s.exec, s.model, s.state, s.sim);
  auto const seen = gsp_test::watch([&] { gsp::read_sensors(s.exec, s.model, s.state, s.sim, s.sensors, s.data); });
  int sums = 0;
  for (auto const& kernel : seen.kernels) sums += kernel.label == "gsp::dynamics::subtree_com";
  CHECK(sums == 1);
  auto const depth = s("depth", 2), acc = s("acc", 2);
  Kokkos::deep_copy(s.data, 0.), Kokkos::deep_copy(s.sensors.subtrees.com, 0.);
  gsp::range_sensors(s.exec, s.model, s.state, s.sim.poses, s.sensors, s.data);
  Kokkos::deep_copy(s.sensors.subtrees.com, 0.);
  gsp::acceleration_sensors(s.exec, s.model, s.state, s.sim.poses, s.sim.dynamics, s.sensors, s.data);
  CHECK(s("depth", 2) == depth);
  CHECK(s("acc", 2) == acc);
  CHECK(*std::max_element(depth.begin(), depth.end()) > 2);
}

TEST_CASE("sensors of distances that mean nothing are refused, or left out") {
  auto const text = [](std::string const& sensor) {
    return R"(<mujoco><asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1" elevation="0 1 0 0"/></asset><worldbody><geom name="ground" type="hfield" hfield="h"/>
    <body name="b" pos="0 0 3"><freejoint/><geom name="g" size=".1"/><site name="s"/><camera name="c" resolution="50000 50000"/></body></worldbody><sensor>)" +
           sensor + "</sensor></mujoco>";
  };
  auto const refuses = [&](std::string const& sensor, char const* part) {
    CHECK_THROWS_WITH_AS(gsp::compile(gsp::io::parse_mjcf(text(sensor), "scene.xml")), doctest::Contains(part), gsp::Error);
  };
  refuses("<distance geom1='ground' geom2='g'/>", "names the height field 'ground', which has no distance: name another geom");
  refuses("<fromto geom1='g' geom2='g'/>", "names 'g' twice");
  refuses("<normal body1='b' body2='b'/>", "names 'b' twice");
  refuses("<distance geom1='g'/>", "needs two objects");
  refuses("<distance site='s' geom2='g'/>", "site");
  refuses("<rangefinder camera='c'/>", "makes 1e9 numbers or more of all sensors: lower the resolution of its camera");
  SensedWorld<Kokkos::DefaultHostExecutionSpace> s(text("<distance body1='world' body2='b' cutoff='1'/>"), gsp::Profile::stable);
  CHECK(s.sensors.left_out == std::vector<int>{0});
  CHECK(s.sensors.why[0].find("one of its bodies has a height field") != std::string::npos);
}
