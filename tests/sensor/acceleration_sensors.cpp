// Accelerometers, force and torque sensors, and accelerations, in closed form. (Against MuJoCo: tests/oracle/constraint_sensors.cpp.)
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/sensor/acceleration_sensors.hpp>
#include <gsp/sensor/accelerations.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"
#include "sensor/sensor_scene.hpp"
#include "support/kokkos_tools.hpp"

namespace {
using gsp_test::away;
using gsp_test::SensedWorld;
constexpr gsp::Profile profiles[] = {gsp::Profile::stable, gsp::Profile::mujoco};
constexpr double g = 9.81;
}  // namespace

// Ten roundings of numbers below 20.
TEST_CASE_TEMPLATE("an accelerometer on an arm that turns feels w^2 r inward, and gravity", Exec, GSP_TEST_EXECS) {
  for (auto const profile : profiles) {
    SensedWorld<Exec> s(R"(<mujoco><worldbody><body><joint name="j" axis="0 0 1"/><geom type="box" size=".3 .1 .05" mass="2" pos=".3 0 0"/>
      <site name="a" pos=".5 0 0"/><site name="turned" pos=".5 0 0" euler="0 0 90"/></body></worldbody>
      <sensor><accelerometer name="a" site="a"/><accelerometer name="turned" site="turned"/><framelinacc name="world" objtype="site" objname="a"/>
        <frameangacc name="turns" objtype="site" objname="a"/><accelerometer name="cut" site="a" cutoff="5"/></sensor></mujoco>)",
                        profile, 3);
    auto const qvel = s.qvel(), qpos = s.qpos();
    for (int w = 0; w < 3; ++w) qvel(w, 0) = 1.5 + w, qpos(w, 0) = 0.7 * w;
    Kokkos::deep_copy(s.state.qvel, qvel), Kokkos::deep_copy(s.state.qpos, qpos);
    s.read();
    for (int w = 0; w < 3; ++w) {
      double const in = (1.5 + w) * (1.5 + w) * 0.5, angle = 0.7 * w;
      CHECK(away(s("a", w), {-in, 0, g}) < 4e-14);
      CHECK(away(s("turned", w), {0, in, g}) < 4e-14);
      CHECK(away(s("world", w), {-in * std::cos(angle), -in * std::sin(angle), g}) < 4e-14);
      CHECK(away(s("turns", w), {0, 0, 0}) < 4e-14);
      CHECK(away(s("cut", w), {-std::fmin(in, 5), 0, 5}) < 4e-14);
    }
  }
}

// A ball turns at a constant rate: what a point of it feels is w x (w x r). Rounding: 10 times 2e-16 times |w|^2 r + g.
TEST_CASE_TEMPLATE("what falls feels how it turns, and nothing else", Exec, GSP_TEST_EXECS) {
  for (auto const profile : profiles) {
    SensedWorld<Exec> s(
        R"(<mujoco><worldbody><body pos="0 0 5"><freejoint/><geom size=".2" mass="2"/><site name="c"/><site name="p" pos=".1 .2 -.05"/></body></worldbody>
      <sensor><accelerometer name="c" site="c"/><accelerometer name="p" site="p"/><force name="f" site="p"/><torque name="t" site="p"/></sensor></mujoco>)",
        profile);
    auto const qvel = s.qvel();
    double const v[] = {1, 2, 3, 2, -1, 4};
    for (int i = 0; i < 6; ++i) qvel(0, i) = v[i];
    Kokkos::deep_copy(s.state.qvel, qvel);
    s.read();
    using V = gsp::Vec3<double>;
    V const w{2, -1, 4}, a = gsp::cross(w, gsp::cross(w, V{.1, .2, -.05}));
    CHECK(away(s("c"), {0, 0, 0}) < 1e-13);
    CHECK(away(s("p"), {a.x, a.y, a.z}) < 1e-13);
    CHECK(away(s("f"), {0, 0, 0}) < 1e-12);
    CHECK(away(s("t"), {0, 0, 0}) < 1e-12);
  }
}

// Hanging straight down at rest: nothing moves, joints carry what hangs on them, bodies that are fixed to others too. Numbers below 100:
// ten roundings.
TEST_CASE_TEMPLATE("force sensors of a chain say the weight of the rest", Exec, GSP_TEST_EXECS) {
  for (auto const profile : profiles) {
    SensedWorld<Exec> s(
        R"(<mujoco><option><flag contact="disable"/></option><worldbody><site name="world" pos="1 0 0"/><body name="post" pos="0 0 3"><geom type="box" size=".1 .1 .1" mass="4"/><site name="post" pos=".2 0 0"/>
      <body><joint axis="0 1 0" damping="2"/><geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1"/><site name="one" euler="90 0 0"/>
        <body pos="0 0 -.4"><joint axis="1 0 0"/><geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="2"/><site name="two"/>
          <body pos="0 0 -.4"><geom size=".1" mass="3"/><site name="fixed"/><site name="aside" pos=".5 0 0"/></body></body></body></body>
      <body name="mover" mocap="true" pos="5 0 0"><geom size=".1" mass="7" contype="0" conaffinity="0"/><site name="mover"/></body></worldbody>
      <sensor><force name="one" site="one"/><force name="two" site="two"/><torque name="t2" site="two"/><force name="fixed" site="fixed"/><torque name="aside" site="aside"/>
        <force name="post" site="post"/><torque name="tpost" site="post"/><force name="world" site="world"/><torque name="tworld" site="world"/><force name="mover" site="mover"/><accelerometer name="still" site="post"/></sensor></mujoco>)",
        profile);
    s.read();
    CHECK(away(s("one"), {0, 6 * g, 0}) < 1e-12);
    CHECK(away(s("two"), {0, 0, 5 * g}) < 1e-12);
    CHECK(away(s("t2"), {0, 0, 0}) < 1e-12);
    CHECK(away(s("fixed"), {0, 0, 3 * g}) < 1e-12);
    CHECK(away(s("aside"), {0, 3 * g * 0.5, 0}) < 1e-12);  // -(0.5, 0, 0) x (0, 0, 3 g)
    CHECK(away(s("post"), {0, 0, 10 * g}) < 1e-12);
    CHECK(away(s("tpost"), {0, 10 * g * 0.2, 0}) < 1e-12);
    CHECK(away(s("world"), {0, 0, 17 * g}) < 1e-12);
    CHECK(away(s("tworld"), {0, 10 * g * 1 - 7 * g * 4, 0}) < 1e-12);  // about the site, which MuJoCo's is not
    CHECK(away(s("mover"), {0, 0, 7 * g}) < 1e-12);
    CHECK(away(s("still"), {0, 0, g}) < 1e-14);
  }
}

// Nothing holds a free body but what touches it, whatever acts inside and however far the solver has gone: what is left between world and
// root is rounding of the largest force, in a hundred sweeps and sums: 400 of 2e-16, in each of the steps of a fall and of rest, with soft
// and rigid contacts and equalities, with adhesion and surfaces that move. In profile stable joints that nothing damps have Coriolis forces
// of the middle of the step (docs/decisions/0012): these are damped.
TEST_CASE_TEMPLATE("momentum: contacts and equalities are all that acts on free robots", Exec, GSP_TEST_EXECS) {
  struct Variant {
    char const *geom, *equality;
  };
  for (auto const [geom, equality] :
       {Variant{"", "<connect body1=\"b\" body2=\"brick\" anchor=\".3 0 0\"/>"},
        Variant{"hard=\"true\" restitution=\".4\"", "<connect body1=\"b\" body2=\"brick\" anchor=\".3 0 0\" hard=\"true\"/>"},
        Variant{"adhesion=\"5\" margin=\".02\" gap=\".01\"", "<weld body1=\"b\" body2=\"brick\" hard=\"true\"/>"},
        Variant{"surfacevel=\"0 .3 0 .2 0 0\" condim=\"4\"", "<weld body1=\"b\" body2=\"a\" torquescale=\".5\" hard=\"true\"/>"}}) {
    std::string const text = "<mujoco><option timestep=\"0.002\"/><default><geom " + std::string(geom) +
                             R"(/></default><worldbody><geom type="plane" size="3 3 1"/>
      <body name="a" pos="0 0 .3" euler="20 10 0"><freejoint/><geom type="box" size=".2 .1 .05" mass="2"/>
        <body name="b" pos=".2 0 0"><joint axis="0 1 0" damping=".5" stiffness="3" range="-20 20"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".04" mass=".5"/></body></body>
      <body name="brick" pos=".1 .5 .4" euler="30 0 70"><freejoint/><geom type="box" size=".1 .05 .15" mass="1" friction=".4 .02 .01"/></body></worldbody>
      <equality>)" + equality +
                             "</equality></mujoco>";
    for (auto const profile : profiles) {
      CAPTURE(text);
      SensedWorld<Exec> s(text, profile);
      auto a = gsp::make_accelerations(s.exec, s.model);
      double worst = 0, largest = 0;
      auto const qvel = s.qvel();
      for (int i = 0; i < s.model.nv; ++i) qvel(0, i) = std::sin(i + 1.);
      Kokkos::deep_copy(s.state.qvel, qvel);
      for (int step = 0; step < 150; ++step) {
        gsp::forward(s.exec, s.model, s.state, s.sim);
        auto const run = [&] {
          gsp::accelerations(s.exec, s.model, s.state, s.sim.poses, s.sim.dynamics, s.sim.collision, s.sim.contacts, s.sim.rows,
                             s.sim.impulses, s.sim.solution, a);
        };
        if (step == 0)
          gsp_test::check_algorithm(s.exec, gsp_test::watch(run));
        else
          run();
        auto const inside = gsp_test::host(a.inside), outside = gsp_test::host(a.outside);
        for (int b : {1, 3})
          for (int c = 0; c < 6; ++c) {
            worst = std::fmax(worst, std::isfinite(inside(0, b, c)) ? std::abs(inside(0, b, c)) : INFINITY);
            largest = std::fmax(largest, std::abs(outside(0, b, c)));
          }
        gsp::advance(s.exec, s.model, s.state, s.sim);
      }
      CHECK(gsp_test::host(s.state.status)(0) == 0);
      CHECK(largest > 10);
      CHECK(worst < 1e-13 * largest);
    }
  }
}

// qacc of profile stable is what the step makes of the rates: of joints to rounding of v / h, 1e3 times 2e-16 of them.
TEST_CASE_TEMPLATE("in profile stable accelerations are those of the step, with its implicit springs and servos", Exec, GSP_TEST_EXECS) {
  SensedWorld<Exec> s(
      R"(<mujoco><option timestep="0.005"/><worldbody><body><joint axis="0 1 0" damping="1" stiffness="2000" springref="40"/><geom type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass="1"/>
    <body pos=".4 0 0"><joint name="h" axis="0 1 0" damping=".1" range="-10 10"/><geom type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass="1"/></body></body></worldbody>
    <actuator><position joint="h" kp="5000" kv="20"/></actuator></mujoco>)",
      gsp::Profile::stable);
  auto a = gsp::make_accelerations(s.exec, s.model);
  for (int step = 0; step < 50; ++step) {
    double const before[] = {s.qvel()(0, 0), s.qvel()(0, 1)};
    gsp::forward(s.exec, s.model, s.state, s.sim);
    gsp::accelerations(s.exec, s.model, s.state, s.sim.poses, s.sim.dynamics, s.sim.collision, s.sim.contacts, s.sim.rows, s.sim.impulses,
                       s.sim.solution, a);
    gsp::advance(s.exec, s.model, s.state, s.sim);
    auto const after = s.qvel(), qacc = gsp_test::host(a.qacc);
    for (int i = 0; i < 2; ++i)
      CHECK(std::abs(qacc(0, i) - (after(0, i) - before[i]) / 0.005) < 1e-12 * (std::abs(qacc(0, i)) + std::abs(after(0, i)) / 0.005 + 1));
  }
}

// What sleeps stands still to the bit: gravity is felt, and what carries it is what it was when it fell asleep, below 1e-4 m/s for some
// steps: within the force that makes twice that in a step, 2 kg 2e-4 m/s / 5 ms.
TEST_CASE_TEMPLATE("what sleeps feels gravity and is carried", Exec, GSP_TEST_EXECS) {
  SensedWorld<Exec> s(
      R"(<mujoco><option timestep="0.005"><flag sleep="enable"/></option><worldbody><geom type="plane" size="2 2 1"/><body pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="2"/><site name="s" size=".5"/></body>
    <body pos="1 0 9"><freejoint/><geom size=".1"/><site name="falls"/></body></worldbody>
    <sensor><accelerometer name="a" site="s"/><accelerometer name="falls" site="falls"/><force name="f" site="s"/><touch name="t" site="s"/></sensor></mujoco>)",
      gsp::Profile::stable);
  gsp::step(s.exec, s.model, s.state, s.sim, {.steps = 200});
  REQUIRE(gsp_test::host(s.sim.sleep.asleep)(0) == 1);
  s.read();
  CHECK(gsp_test::host(s.sim.sleep.asleep)(0) == 1);
  auto const a = s("a");
  CHECK(std::abs(std::hypot(a[0], a[1], a[2]) - g) < 1e-12);  // it may lean a little
  CHECK(away(s("falls"), {0, 0, 0}) < 1e-12);
  CHECK(std::abs(s("t")[0] - 2 * g) < 0.08);
  CHECK(away(s("f"), {0, 0, 0}) < 0.08);
}

// Sensors follow the dofs of their own body; arrays of all bodies come from one pass over the tree. Rounding: a dozen operations a dof on
// numbers below 1e3, 16 dofs: 1e3 x 200 x 1e-16. With qacc alone nothing else is found, and qacc has the same bits.
TEST_CASE_TEMPLATE("accelerations at sensors are those of the arrays of bodies; qacc alone has the same bits", Exec, GSP_TEST_EXECS) {
  std::string const
      bodies = R"(<body pos="0 0 2"><freejoint/><geom type="box" size=".1 .2 .05" mass="3"/><site name="a" pos=".1 .05 0" euler="20 30 40"/>
      <body pos=".1 0 0"><joint type="ball"/><geom type="capsule" size=".03 .1" mass="1"/><site name="b" pos="0 0 .1"/>
        <body pos="0 0 .2"><joint axis="0 1 0"/><joint type="slide" axis="1 0 0" range="-.1 .1" limited="true"/><geom size=".05" mass=".5"/><site name="c" pos=".02 .03 .04"/>
          <body pos=".1 0 0"><geom size=".02" mass=".1"/><site name="d" pos="0 .1 0"/></body></body></body></body>)",
      sensors = R"(<framelinacc name="a" objtype="site" objname="a"/><framelinacc name="b" objtype="site" objname="b"/>
      <framelinacc name="c" objtype="site" objname="c"/><framelinacc name="d" objtype="site" objname="d"/><frameangacc name="wa" objtype="site" objname="a"/>
      <frameangacc name="wb" objtype="site" objname="b"/><frameangacc name="wc" objtype="site" objname="c"/><frameangacc name="wd" objtype="site" objname="d"/>)";
  using V = gsp::Vec3<double>;
  V const at[] = {{.1, .05, 0}, {0, 0, .1}, {.02, .03, .04}, {0, .1, 0}};
  char const* const names[] = {"a", "b", "c", "d"};
  for (auto const profile : profiles) {
    auto const world = [&](char const* force) {
      return SensedWorld<Exec>("<mujoco><worldbody><geom type=\"plane\" size=\"5 5 1\"/>" + bodies + "</worldbody><sensor>" + sensors +
                                   force + "</sensor></mujoco>",
                               profile, 9);
    };
    auto alone = world(""), all = world("<force site=\"a\"/>");
    CHECK(alone.sensors.accelerations.velocity.data() == nullptr);
    auto const qpos = all.qpos(), qvel = all.qvel();
    gsp_test::Random r;
    for (int w = 0; w < 9; ++w) {
      qpos(w, 2) = 0.1 * w;
      for (int i = 3; i < 11; ++i) qpos(w, i) += 0.3 * r();
      for (int i = 0; i < int(qvel.extent(1)); ++i) qvel(w, i) = 4 * r();
    }
    for (auto* const s : {&alone, &all}) {
      Kokkos::deep_copy(s->state.qpos, qpos), Kokkos::deep_copy(s->state.qvel, qvel);
      s->read();
    }
    auto const& of = all.sensors.accelerations;
    auto const qacc = gsp_test::host(of.qacc), qacc_alone = gsp_test::host(alone.sensors.accelerations.qacc);
    auto const xquat = gsp_test::host(all.sim.poses.xquat);
    auto const velocity = gsp_test::host(of.velocity), acceleration = gsp_test::host(of.acceleration);
    for (int w = 0; w < 9; ++w) {
      for (int i = 0; i < int(qacc.extent(1)); ++i) CHECK(qacc(w, i) == qacc_alone(w, i));
      for (int b = 1; b < 5; ++b) {
        auto const part = [&](auto const& view, int first) { return V{view(w, b, first), view(w, b, first + 1), view(w, b, first + 2)}; };
        V const arm = gsp::rotate(gsp::Quat<double>{xquat(w, b, 0), xquat(w, b, 1), xquat(w, b, 2), xquat(w, b, 3)}, at[b - 1]);
        V const turns = part(acceleration, 3), rate = part(velocity, 3);
        V const a = part(acceleration, 0) + gsp::cross(turns, arm) + gsp::cross(rate, gsp::cross(rate, arm));
        for (auto* const s : {&alone, &all}) {
          CHECK(away((*s)(names[b - 1], w), {a.x, a.y, a.z}) < 2e-11);
          CHECK(away((*s)((std::string("w") + names[b - 1]).c_str(), w), {turns.x, turns.y, turns.z}) < 2e-11);
        }
      }
    }
  }
}

TEST_CASE_TEMPLATE("accelerations of another moment, model or number of worlds are refused", Exec, GSP_TEST_EXECS) {
  std::string const text =
      R"(<mujoco><worldbody><body><freejoint/><geom size=".1"/><site name="s"/></body></worldbody><sensor><accelerometer site="s"/></sensor></mujoco>)";
  SensedWorld<Exec> s(text, gsp::Profile::stable, 2);
  auto const refuses = [&](auto const& f, char const* part) { CHECK_THROWS_WITH_AS(f(), doctest::Contains(part), std::invalid_argument); };
  auto& of = s.sensors.accelerations;
  auto const find = [&] {
    gsp::accelerations(s.exec, s.model, s.state, s.sim.poses, s.sim.dynamics, s.sim.collision, s.sim.contacts, s.sim.rows, s.sim.impulses,
                       s.sim.solution, of);
  };
  auto const read = [&] { gsp::acceleration_sensors(s.exec, s.model, s.state, s.sim.poses, s.sim.dynamics, s.sensors, s.data); };
  refuses(find, "gsp::accelerations: ");
  gsp::forward(s.exec, s.model, s.state, s.sim);
  refuses(read, "gsp::acceleration_sensors: the accelerations have not been written: call accelerations(");
  find();
  gsp_test::check_algorithm(s.exec, gsp_test::watch(read));
  gsp::advance(s.exec, s.model, s.state, s.sim);
  refuses(read, "the accelerations are of the state before its last step or reset: call accelerations(");
  refuses(find, "are of the state before its last step or reset");
  gsp::step(s.exec, s.model, s.state, s.sim);
  refuses(find, "gsp::accelerations: ");
  gsp::smooth_dynamics(s.exec, s.model, s.state, s.sim.poses, s.sim.dynamics, {.keep_all = true});
  refuses(find, "the forces of the constraints are of the state before its last step or reset: call forward first");
  auto three = gsp::make_accelerations(s.exec, s.model, {.worlds = 3});
  gsp::forward(s.exec, s.model, s.state, s.sim);
  refuses(
      [&] {
        gsp::accelerations(s.exec, s.model, s.state, s.sim.poses, s.sim.dynamics, s.sim.collision, s.sim.contacts, s.sim.rows,
                           s.sim.impulses, s.sim.solution, three);
      },
      "worlds");
  refuses([&] { gsp::make_accelerations(s.exec, s.model, {.worlds = 0}); }, "worlds must be positive and is 0");
}
