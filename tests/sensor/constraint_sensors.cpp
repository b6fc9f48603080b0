// Sensors of contacts and limits in closed form. (Against MuJoCo: tests/oracle/constraint_sensors.cpp.)
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/sensor/constraint_sensors.hpp>
#include <gsp_test_execs.hpp>

#include "sensor/sensor_scene.hpp"
#include "support/kokkos_tools.hpp"

namespace {
using gsp_test::away;
using gsp_test::SensedWorld;
constexpr gsp::Profile profiles[] = {gsp::Profile::stable, gsp::Profile::mujoco};
constexpr double g = 9.81;
}  // namespace

// At rest after 4 s, which is 100 and more of the contacts' time constants: forces are the weight as far as the solver goes, below 1e-12 of
// gravity, and what is left of the fall, e^-100; what is left are 1e-7 in profile mujoco, whose Newton stops by its own tolerance.
TEST_CASE_TEMPLATE("four corners carry a box, touch and contact sensors say so", Exec, GSP_TEST_EXECS) {
  for (auto const profile : profiles) {
    SensedWorld<Exec> s(
        R"(<mujoco><option timestep="0.002" tolerance="1e-14"/><worldbody><geom name="floor" type="plane" size="2 2 1"/><body name="box" pos="0 0 .1"><freejoint/><geom name="box" type="box" size=".2 .15 .1" mass="3"/>
      <site name="pp" type="box" size=".05 .05 .05" pos=".2 .15 -.1"/><site name="pm" type="sphere" size=".05" pos=".2 -.15 -.1"/>
      <site name="mp" type="cylinder" size=".05 .05" pos="-.2 .15 -.2"/><site name="mm" type="ellipsoid" size=".05 .05 .05" pos="-.2 -.15 -.1"/><site name="all" type="box" size=".3 .3 .01" pos="0 0 -.5"/>
      <site name="above" type="box" size=".3 .3 .01" pos="0 0 .5"/></body></worldbody>
      <sensor><touch name="pp" site="pp"/><touch name="pm" site="pm"/><touch name="mp" site="mp"/><touch name="mm" site="mm"/><touch name="all" site="all"/><touch name="above" site="above"/><touch name="cut" site="all" cutoff="2"/>
        <contact name="net" body1="world" body2="box" reduce="netforce" data="found force torque pos"/><contact name="back" body1="box" body2="world" reduce="netforce" data="found force"/>
        <contact name="each" geom1="floor" num="6" reduce="maxforce" data="found force pos normal tangent"/><contact name="mine" subtree1="box" subtree2="box" data="found"/></sensor></mujoco>)",
        profile, 2);
    s.settle(2000);
    s.read();
    double const weight = 3 * g;
    double sum = 0;
    for (char const* corner : {"pp", "pm", "mp", "mm"}) {
      CHECK(s(corner, 1)[0] > 0);
      if (profile == gsp::Profile::mujoco) CHECK(std::abs(s(corner, 1)[0] - weight / 4) < 1e-6 * weight);  // its law has one solution
      sum += s(corner, 1)[0];
    }
    CHECK(std::abs(sum - weight) < 1e-7 * weight);
    CHECK(std::abs(s("all", 1)[0] - weight) < 1e-7 * weight);
    CHECK(s("above", 1)[0] == 0);
    CHECK(s("cut", 1)[0] == 2);
    auto const net = s("net", 1), back = s("back", 1), each = s("each", 1);
    CHECK(net[0] == 4);
    CHECK(away({net[1], net[2], net[3]}, {0, 0, weight}) < 1e-7 * weight);  // on the box, which is side 2
    CHECK(away(back, {4, -net[1], -net[2], -net[3]}) == 0);
    using V = gsp::Vec3<double>;  // about the centre of mass: zero
    V const torque = V{net[4], net[5], net[6]} + gsp::cross(V{net[7], net[8], net[9]}, V{net[1], net[2], net[3]});
    CHECK(gsp::norm(torque) < 1e-7 * weight);
    double normal = 0;
    for (int slot = 0; slot < 4; ++slot) {
      auto const* x = each.data() + 13 * slot;
      CHECK(x[0] == 4);
      normal += x[1];
      CHECK(away({x[7], x[8], x[9]}, {0, 0, 1}) < 1e-6);
      CHECK(std::abs(std::abs(x[4]) - 0.2) < 1e-3);
      if (slot > 0) {
        auto const* before = x - 13;
        CHECK(before[1] * before[1] + before[2] * before[2] + before[3] * before[3] >= x[1] * x[1] + x[2] * x[2] + x[3] * x[3]);
      }
    }
    CHECK(std::abs(normal - weight) < 1e-7 * weight);
    for (int c = 4 * 13; c < 6 * 13; ++c) CHECK(each[std::size_t(c)] == 0);
    CHECK(s("mine", 1)[0] == 0);
  }
}

// found of whole subtrees: what touches a tree is what touches the world, the other tree and itself.
TEST_CASE_TEMPLATE("counts of contacts of subtrees add up", Exec, GSP_TEST_EXECS) {
  SensedWorld<Exec> s(R"(<mujoco><worldbody><geom type="plane" size="2 2 1"/>
    <body name="one" pos="0 0 .1"><freejoint/><geom size=".1"/><body pos=".15 0 0"><joint axis="0 1 0"/><geom size=".1"/><body pos=".03 0 .03"><joint axis="0 1 0"/><geom size=".1"/></body></body></body>
    <body name="two" pos=".1 .15 .1"><freejoint/><geom size=".1"/><body pos="0 .05 .1"><joint axis="1 0 0"/><geom size=".05"/></body></body></worldbody>
    <sensor><contact name="1" subtree1="one" data="found"/><contact name="2" subtree1="two" data="found"/><contact name="11" subtree1="one" subtree2="one" data="found"/><contact name="22" subtree1="two" subtree2="two" data="found"/>
      <contact name="12" subtree1="one" subtree2="two" data="found"/><contact name="21" subtree1="two" subtree2="one" data="found"/><contact name="1w" subtree1="one" body2="world" data="found"/><contact name="w2" body1="world" subtree2="two" data="found"/><contact name="all" data="found"/></sensor></mujoco>)",
                      gsp::Profile::stable);
  s.read();
  auto const n = [&](char const* name) { return s(name)[0]; };
  CHECK(n("1") == n("11") + n("12") + n("1w"));
  CHECK(n("2") == n("22") + n("12") + n("w2"));
  CHECK(n("12") == n("21"));
  CHECK(n("all") == n("11") + n("22") + n("12") + n("1w") + n("w2"));
  CHECK(n("11") > 0);
  CHECK(n("12") > 0);
  CHECK(n("1w") > 0);
  CHECK(n("w2") > 0);
}

// At rest against a stop, as above.
TEST_CASE_TEMPLATE("limits carry what leans on them", Exec, GSP_TEST_EXECS) {
  for (auto const profile : profiles) {
    SensedWorld<Exec> s(
        R"(<mujoco><option timestep="0.002" tolerance="1e-14"/><worldbody><body><joint name="h" axis="0 1 0" range="-30 0" damping=".5"/><geom size=".05" mass="2" pos=".4 0 0"/></body>
      <body pos="0 1 1"><joint name="s" type="slide" axis="0 0 1" damping="5"/><geom size=".1" mass="1.5"/></body></worldbody><tendon><fixed name="t" range="-.1 .1"><joint joint="s" coef="2"/></fixed></tendon>
      <sensor><jointlimitfrc name="f" joint="h"/><jointlimitpos name="x" joint="h"/><jointlimitvel name="v" joint="h"/><jointlimitfrc name="cut" joint="h" cutoff="1"/><jointpos name="q" joint="h"/>
        <tendonlimitfrc name="tf" tendon="t"/><tendonlimitpos name="tx" tendon="t"/><tendonlimitvel name="tv" tendon="t"/></sensor></mujoco>)",
        profile);
    s.read();
    if (profile == gsp::Profile::mujoco) CHECK(away(s("tf"), {0}) == 0);  // it does not act yet
    s.settle(3000);
    s.read();
    double const q = s("q")[0], load = 2 * g * 0.4 * std::cos(q);
    CHECK(std::abs(s("f")[0] - load) < 1e-7 * load);
    CHECK(std::abs(s("x")[0] - (0 - q)) < 1e-12);
    CHECK(s("x")[0] < 0);
    CHECK(std::abs(s("v")[0]) < 1e-9);
    CHECK(s("cut")[0] == 1);
    CHECK(std::abs(s("tf")[0] - 1.5 * g / 2) < 1e-7 * g);
    CHECK(s("tx")[0] < 0);
    CHECK(std::abs(s("tv")[0]) < 1e-9);
  }
}

// The same bits: no tolerance.
TEST_CASE_TEMPLATE("a world's numbers are its own, whatever stands beside it", Exec, GSP_TEST_EXECS) {
  std::string const text = R"(<mujoco><worldbody><geom type="plane" size="2 2 1"/>
    <body name="a" pos="0 0 .1"><freejoint/><geom type="box" size=".2 .1 .1"/><site name="s" size=".2"/><body name="b" pos=".3 0 0"><joint name="h" axis="0 1 0" range="-5 5"/><geom name="g" size=".1"/><site name="t"/></body></body></worldbody>
    <sensor><touch site="s"/><contact num="4" reduce="maxforce" data="found force torque dist pos normal tangent linvel angvel"/><contact subtree1="a" reduce="netforce" data="force torque pos"/><jointlimitfrc joint="h"/>
      <accelerometer site="t"/><force site="t"/><torque site="t"/><frameangacc objtype="geom" objname="g"/><insidesite site="s" objtype="body" objname="b"/></sensor></mujoco>)";
  for (auto const profile : profiles) {
    int const worlds = 7;
    SensedWorld<Exec> all(text, profile, worlds);
    auto const begin = [](auto& s, int first) {
      auto const qpos = s.qpos(), qvel = s.qvel();
      for (int w = 0; w < s.state.worlds; ++w)
        for (int i = 0; i < s.model.nv; ++i) {
          qvel(w, i) = std::sin(3. * (w + first) + i);
          qpos(w, 2) = 0.1 + 0.01 * (w + first);
        }
      Kokkos::deep_copy(s.state.qpos, qpos);
      Kokkos::deep_copy(s.state.qvel, qvel);
      gsp::step(s.exec, s.model, s.state, s.sim, {.steps = 60});
      s.read();
    };
    begin(all, 0);
    auto const found = gsp_test::host(all.data);
    for (int w : {0, 3, 6}) {
      SensedWorld<Exec> one(text, profile);
      begin(one, w);
      auto const own = gsp_test::host(one.data);
      int different = 0;
      double largest = 0;
      for (int c = 0; c < all.compiled.nsensordata; ++c) {
        different += own(0, c) != found(w, c);
        largest = std::fmax(largest, std::abs(own(0, c)));
      }
      CHECK(different == 0);
      CHECK(largest > 1);
    }
  }
}

TEST_CASE_TEMPLATE("sensors of a stage that has not run are an error, not a zero", Exec, GSP_TEST_EXECS) {
  SensedWorld<Exec> s(
      R"(<mujoco><worldbody><geom type="plane" size="1 1 1"/><body pos="0 0 .1"><freejoint/><geom size=".1"/><site name="s" size=".2"/></body></worldbody>
    <sensor><touch name="touch" site="s"/><contact data="found force linvel" num="3"/><rangefinder name="ray" site="s"/><user name="mine" dim="2" cutoff="1"/><user dim="1" datatype="positive" cutoff="2"/><clock/></sensor></mujoco>)",
      gsp::Profile::stable, 2);
  CHECK(s.sensors.left_out == std::vector<int>{3, 4});
  REQUIRE(s.sensors.why.size() == 2);
  CHECK(s.sensors.why[0].find("sensor 3 'mine' (user) is yours to compute") == 0);
  Kokkos::deep_copy(s.data, -3.);
  auto const constraints = [&] {
    gsp::constraint_sensors(s.exec, s.model, s.state, s.sim.poses, s.sim.dynamics, s.sim.collision, s.sim.contacts, s.sim.rows,
                            s.sim.impulses, s.sensors, s.data);
  };
  auto const refuses = [&](auto const& f, char const* part) { CHECK_THROWS_WITH_AS(f(), doctest::Contains(part), std::invalid_argument); };
  refuses(constraints, "gsp::constraint_sensors: ");
  gsp::step(s.exec, s.model, s.state, s.sim);
  refuses(constraints, "gsp::constraint_sensors: ");
  gsp::smooth_dynamics(s.exec, s.model, s.state, s.sim.poses, s.sim.dynamics);
  refuses(constraints, "the forces of the constraints are of the state before its last step or reset: call forward first");
  gsp::forward(s.exec, s.model, s.state, s.sim);
  gsp_test::check_algorithm(s.exec, gsp_test::watch(constraints));
  gsp::read_sensors(s.exec, s.model, s.state, s.sim, s.sensors, s.data);
  CHECK(s("ray") == std::vector<double>{-1});  // nothing is above
  CHECK(s("mine") == std::vector<double>{-3, -3});
  gsp::limit_user_sensors(s.exec, s.model, s.sensors, s.data);
  CHECK(s("mine") == std::vector<double>{-1, -1});
  CHECK(gsp_test::host(s.data)(1, s.compiled.sensor_adr[4]) == -3);  // positive: cut above
  CHECK(s("touch", 1)[0] > 0);
  gsp::collide(s.exec, s.sim.collision, s.sim.poses, s.sim.contacts);
  refuses(constraints, "the contacts are not those that were assembled");
  gsp::forward(s.exec, s.model, s.state, s.sim);
  gsp::reset(s.exec, s.model, s.state);
  refuses(constraints, "gsp::constraint_sensors: ");
  Kokkos::View<double**, Kokkos::LayoutRight, typename Exec::memory_space> narrow("narrow", 2, 1);
  gsp::forward(s.exec, s.model, s.state, s.sim);
  refuses([&] { gsp::read_sensors(s.exec, s.model, s.state, s.sim, s.sensors, narrow); },
          "data is (2, 1) and must be (worlds, nsensordata)");
}

TEST_CASE("settings of contact sensors that mean nothing are refused") {
  auto const refuses = [](std::string const& attributes, char const* part) {
    std::string const text =
        "<mujoco><worldbody><body name=\"b\"><freejoint/><geom name=\"g\" size=\".1\"/></body></worldbody><sensor><contact name=\"c\" " +
        attributes + "/></sensor></mujoco>";
    CHECK_THROWS_WITH_AS(gsp::compile(gsp::io::parse_mjcf(text, "scene.xml")), doctest::Contains(part), gsp::Error);
  };
  refuses("data=\"force found\"", "in the order found force torque dist pos normal tangent linvel angvel");
  refuses("data=\"found found\"", "name each once");
  refuses("data=\"weight\"", "has data 'weight'");
  refuses("num=\"0\"", "which must be a whole number, 1 or more");
  refuses("reduce=\"best\"", "reduce");
  refuses("reduce=\"netforce\" data=\"force linvel\"", "asks for velocities of a net force");
  refuses("geom1=\"g\" body1=\"b\"", "one object too many");
  gsp::ContactSensorSettings const settings =
      gsp::contact_settings({.settings = {{"num", "3"}, {"data", "found force pos"}, {"reduce", "maxforce"}}});
  CHECK(settings.fault.empty());
  CHECK(settings.slots == 3);
  CHECK(settings.size() == 7);
  CHECK(settings.has(gsp::ContactField::pos));
  CHECK(!settings.has(gsp::ContactField::torque));
  CHECK(settings.reduce == gsp::ContactReduce::maxforce);
}

// Where MuJoCo counts what the library does not, a sensor is left out with a sentence: never a number that is something else. Limits of a
// ball joint are told as others are: at rest beyond its limit, nothing else holds the rod, so the limit's force is the torque of its
// weight, m g r over the unit axis, within the softness of a step.
TEST_CASE_TEMPLATE("what a model does not let be told is left out, and a ball joint's limit is told", Exec, GSP_TEST_EXECS) {
  std::string const text =
      R"(<mujoco><worldbody><geom type="plane" size="1 1 1"/><site name="a" pos="0 0 2"/><body pos="0 0 1"><joint name="b" type="ball" limited="true" range="0 20" damping=".2"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass="1" contype="0" conaffinity="0"/><site name="s" pos=".3 0 0"/></body><body name="c" pos="1 0 1"><freejoint/><geom size=".1"/></body></worldbody>
    <tendon><spatial name="t"><site site="a"/><site site="s"/></spatial></tendon><actuator><adhesion name="k" body="c" ctrlrange="0 1"/></actuator>
    <sensor><force name="f" site="s"/><actuatorvel name="v" actuator="k"/><jointlimitfrc name="l" joint="b"/><jointlimitpos name="p" joint="b"/></sensor></mujoco>)";
  SensedWorld<Exec> stable(text, gsp::Profile::stable), s(text, gsp::Profile::mujoco);
  CHECK(stable.sensors.left_out == std::vector<int>{0});
  REQUIRE(stable.sensors.why.size() == 1);
  CHECK(stable.sensors.why[0] ==
        "sensor 0 'f' (force) is not evaluated: what spatial tendons pull at bodies within a step is not known in profile stable");
  CHECK(s.sensors.left_out.empty());
  gsp::step(s.exec, s.model, s.state, s.sim, {.steps = 2000});
  s.read();
  double const angle = 20 * M_PI / 180 - s("p")[0];  // about y
  CHECK(s("p")[0] < 0);
  CHECK(s("l")[0] == doctest::Approx(9.81 * 0.15 * std::cos(angle)).epsilon(1e-4));
  auto const held = s("f");  // at rest the joint bears the rod, which nothing else pulls
  CHECK(std::sqrt(held[0] * held[0] + held[1] * held[1] + held[2] * held[2]) == doctest::Approx(9.81).epsilon(1e-4));
}
