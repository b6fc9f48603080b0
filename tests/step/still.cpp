// Profile stable holds still: contacts that act before they touch, loads that do not sink, stacks and rigid contacts. Bars of the project.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/world_values.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>
#include <limits>
#include <random>

#include "step/scenes.hpp"
#include "step/world.hpp"

namespace {

using gsp_test::add_free;
using gsp_test::geom;

gsp::Description on_floor(double timestep) {
  gsp::Description d;
  d.option.timestep = timestep;
  d.bodies[0].geoms.push_back(geom(gsp::ShapeType::plane, {0, 0, 1}));
  return d;
}
/// Cubes of half size `half`, exactly touching and aligned, of these masses from below.
gsp::Description tower(double half, std::vector<double> const& masses, double timestep) {
  gsp::Description d = on_floor(timestep);
  for (std::size_t i = 0; i < masses.size(); ++i)
    add_free(d, {0, 0, half + 2 * half * double(i)}, geom(gsp::ShapeType::box, {half, half, half}, masses[i]));
  return d;
}

template <class R, class Exec>
struct World : gsp_test::World<R, Exec> {
  using Base = gsp_test::World<R, Exec>;
  using Base::compiled, Base::model, Base::qpos, Base::qvel, Base::sim, Base::state;
  explicit World(gsp::Description const& d) : Base(gsp::compile(d)) {}
  int sweeps() const { return gsp_test::host(sim.solution.iterations)(0); }
  /// Mean of so many steps.
  double mean_sweeps(int steps) {
    int sum = 0;
    for (int i = 0; i < steps; ++i) {
      this->step(1);
      sum += sweeps();
    }
    return double(sum) / steps;
  }
  double speed() const {
    auto const v = qvel();
    double most = 0;
    for (int i = 0; i < model.nv; ++i) most = std::fmax(most, std::abs(double(v(0, i))));
    return most;
  }
  /// Farthest that a free body is from where it was compiled; sideways: in x and y alone.
  double moved(bool sideways = false) const {
    auto const q = qpos();
    double most = 0;
    for (int b = 0; 7 * b < model.nq; ++b) {
      double sum = 0;
      for (int c = 0; c < (sideways ? 2 : 3); ++c) sum += std::pow(double(q(0, 7 * b + c)) - compiled.qpos0[7 * b + c], 2);
      most = std::fmax(most, std::sqrt(sum));
    }
    return most;
  }
  void set_velocity(int dof, double value) {
    auto const v = qvel();
    v(0, dof) = R(value);
    Kokkos::deep_copy(state.qvel, v);
  }
};

}  // namespace

// A rigid contact closes a gap within the step and no more: a sphere x above the floor that falls with u is at the floor after the step
// where x + h u < 0 (u+ = -x / h), else where free fall takes it; it never is pushed away. Tolerance: rounding of one step.
TEST_CASE_TEMPLATE("a gap closes within the step and no more", Exec, GSP_TEST_EXECS) {
  double const h = 0.002, g = 9.81;
  for (double const gap : {0.0, 1e-6, 1e-5, 3e-5})
    for (double const u : {0.0, -0.01, 0.015}) {
      gsp::Description d = on_floor(h);
      auto ball = geom(gsp::ShapeType::sphere, {0.1, 0, 0});
      ball.hard = true;
      add_free(d, {0, 0, 0.1 + gap}, ball);
      World<double, Exec> w(d);
      w.set_velocity(2, u);
      w.step(1);
      double const free = u - g * h;
      CAPTURE(gap);
      CAPTURE(u);
      CHECK(std::abs(w.qvel()(0, 2) - std::fmax(free, -gap / h)) < 1e-12);
    }
}

// A soft contact at a gap is not a spring yet: what moves away from it moves freely.
TEST_CASE_TEMPLATE("what leaves a contact leaves freely", Exec, GSP_TEST_EXECS) {
  double const h = 0.002, u = 0.03;
  gsp::Description d = on_floor(h);
  add_free(d, {0, 0, 0.1 + 1e-6}, geom(gsp::ShapeType::sphere, {0.1, 0, 0}));
  World<double, Exec> w(d);
  w.set_velocity(2, u);
  w.step(1);
  CHECK(gsp_test::host(w.sim.rows.count)(0) == 3);  // it is there
  CHECK(std::abs(w.qvel()(0, 2) - (u - 9.81 * h)) < 1e-12);
}

// Two aligned cubes: their corners lie on each other, and which of them are found changes with the last bit. Before points were found again
// by their place they never rested (1e-3 m/s and 50 sweeps a step for ever); and while a crossing of two edges in line could stand for a
// corner, those of every third stiffness did not (5e-4 m/s).
TEST_CASE_TEMPLATE("aligned cubes come to rest", Exec, GSP_TEST_EXECS) {
  for (double const time : {0.02, 0.0101, 0.0105, 0.0126, 0.0147, 0.0185}) {
    CAPTURE(time);
    gsp::Description d = tower(0.1, {1, 1}, 0.002);
    for (auto& body : d.bodies) body.geoms[0].softness.solref = {time, 1};
    World<double, Exec> w(d);
    w.step(1000);
    CHECK(w.speed() < 1e-9);
    CHECK(w.sweeps() < 10);
    World<float, Exec> f(d);
    f.step(1000);
    CHECK(f.speed() < 1e-5);
    CHECK(f.sweeps() < 10);
  }
}

// Rigid boxes on each other keep the points that they stand on, however rounding tilts them. Before, at a gap of rounding, two edges seemed
// to part them better than their faces did, one point was left of four, and they were kicked by 0.27 rad/s every 41 steps of 10 ms. What is
// left is what sweeps leave: 10 of their tolerances, 1e-4 |g| h, a cube.
TEST_CASE_TEMPLATE("rigid cubes stand on each other", R, float, double) {
  for (int count : {2, 3, 6}) {
    CAPTURE(count);
    auto d = tower(0.1, std::vector<double>(std::size_t(count), 8.), 0.01);
    for (auto& b : d.bodies)
      for (auto& g : b.geoms) g.hard = true;
    World<R, Kokkos::DefaultHostExecutionSpace> w(d);
    double most = 0;
    for (int step = 0; step < 300; ++step) {
      w.step(1);
      most = std::fmax(most, w.speed());
    }
    CHECK(most < count * 10 * 1e-4 * 9.81 * 0.01);
  }
}

// A ball on a floor 1,000 m up, where float knows places to 6e-5 m. Its gap is known closer (what rounding took is in State::qpos_low), so
// that it comes to rest: its spring would be K h 6e-5 m = 3e-4 m/s to and fro otherwise. Tolerance: rounding of what gravity does in a
// step.
TEST_CASE_TEMPLATE("what rests far from the origin rests in float", Exec, GSP_TEST_EXECS) {
  gsp::Description d = on_floor(0.002);
  d.bodies[0].geoms[0].pos = {0, 0, 1000};
  add_free(d, {0, 0, 1000.1}, geom(gsp::ShapeType::sphere, {0.1, 0, 0}, 1));
  World<float, Exec> w(d);
  w.step(1000);
  double fastest = 0;
  for (int i = 0; i < 100; ++i) {
    w.step(1);
    fastest = std::fmax(fastest, w.speed());
  }
  CHECK(fastest < 4 * double(std::numeric_limits<float>::epsilon()) * 9.81 * 0.002);
  CHECK(w.sweeps() < 10);
}

// Cans on a shelf 2 m from the origin: all eight points of a rim are as deep, and rounding does not choose among them.
TEST_CASE("cans come to rest on a shelf") {
  gsp::Description d;
  d.option.timestep = 0.01;
  auto shelf = geom(gsp::ShapeType::box, {1, 0.5, 0.02});
  shelf.pos = {1.5, 0.8, 1.25};
  d.bodies[0].geoms.push_back(shelf);
  for (int i = 0; i < 12; ++i) {
    add_free(d, {0.9 + 0.1 * i, 0.6 + 0.03 * (i % 5), 1.25 + 0.02 + 0.05}, geom(gsp::ShapeType::cylinder, {0.03, 0.05, 0}, 0.35));
    d.bodies.back().quat = {std::cos(0.4 * i), 0, 0, std::sin(0.4 * i)};
  }
  World<float, Kokkos::DefaultHostExecutionSpace> w(d);
  w.step(200);
  int sweeps = 0;
  for (int i = 0; i < 50; ++i) {
    w.step(1);
    sweeps += w.sweeps();
  }
  MESSAGE("cans in float: " << sweeps / 50. << " sweeps a step, " << w.speed() << " m/s or rad/s");
  CHECK(sweeps < 50 * 10);
  CHECK(w.speed() < 1e-4);
}

// A cylinder on a slope stands deeper at its lower rim, askew by 1e-4 to 6e-4 rad. In float its depth there was what 1 - cos^2 leaves of
// that, off by 6e-5 of 1.9e-4 m; and below 3e-4 the points on its rim began at its own x axis, above at the deepest, to and fro. Both
// rocked it for ever, by 3e-3 to 9e-3 rad/s.
TEST_CASE_TEMPLATE("a cylinder stands still on a slope", R, float, double) {
  for (double const tilt : {0.06, 0.1, 0.2, 0.44})
    for (double const heading : {0.0, 0.7, 2.0}) {
      CAPTURE(tilt);
      CAPTURE(heading);
      gsp::Description d = on_floor(0.01);
      double const g = 9.81, side = g * std::sin(tilt);
      d.option.gravity = {side * std::cos(heading), side * std::sin(heading), -g * std::cos(tilt)};
      auto can = geom(gsp::ShapeType::cylinder, {0.1, 0.05, 0});
      can.friction[0] = d.bodies[0].geoms[0].friction[0] = 0.5;
      add_free(d, {0, 0, 0.05}, can);
      World<R, Kokkos::DefaultHostExecutionSpace> w(d);
      w.step(700);
      double fastest = 0, sweeps = 0;
      for (int i = 0; i < 100; ++i) {
        w.step(1);
        fastest = std::fmax(fastest, w.speed());
        sweeps += w.sweeps() / 100.0;
      }
      CHECK(fastest < 1e-5);
      CHECK(sweeps < 10);
    }
}

// MuJoCo's tower of 20 buckles: 21 mm of give, 44 mm sideways after 6 s from a start moved by 1e-6, fallen at 8 s. Ours from aligned: what
// rounding moves sways (docs/decisions/0013: 0.25 mm in 10 s), within a 50th of half a box. As it sways it takes 9 to 51 sweeps a step,
// which hangs on rounding alone, so that they are printed and no bar (the project's for what rests is 10).
TEST_CASE("an aligned tower of 20 stands") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  World<double, Exec> w(tower(0.05, std::vector<double>(20, 1.0), 0.005));
  w.step(1800);
  double const sweeps = w.mean_sweeps(200);
  MESSAGE("sideways " << w.moved(true) << " m in 10 s, " << sweeps << " sweeps a step");
  CHECK(w.moved(true) < 1e-3);
  World<float, Exec> f(tower(0.05, std::vector<double>(20, 1.0), 0.005));
  f.step(1800);
  double const rounded = f.mean_sweeps(200);
  MESSAGE("sideways " << f.moved(true) << " m in 10 s in float, " << rounded << " sweeps a step");
  CHECK(f.moved(true) < 1e-3);
}

// The give of a contact is that of the mass that it carries: d^2 K x = (1 - d) |g| with the impedance d(x) of the defaults, 0.15 mm for
// each of the two contacts, as a body alone has it, whatever stands on it; and no more in a minute than at once. Before: sunk through
// (0.2 m). 1e-6 m: a 300th of it. What is left unsolved moves it in a minute, by up to 1e-5 m as rounding has it, in float, where all of
// 100 sweeps are done, and 1:10,000 in double: 2e-5 m (the project's bar: 1 mm).
TEST_CASE("a heavy box stays on a light one") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  double x = 3e-4;
  for (int i = 0; i < 50; ++i) {  // solimp 0.9 0.95 0.001 0.5 2, below the middle; K of solref 0.0125 1
    double const d = 0.9 + 0.05 * 2 * std::pow(x / 0.001, 2), K = 1 / std::pow(0.95 * 0.0125, 2);
    x = (1 - d) * 9.81 / (d * d * K);
  }
  CHECK(x < 0.0005);
  for (double const heavy : {100.0, 10000.0}) {
    CAPTURE(heavy);
    World<double, Exec> w(tower(0.1, {1, heavy}, 0.002));
    w.step(1000);
    double const after = w.moved();
    w.step(29000);
    MESSAGE("1:" << heavy << " " << after << " m after 2 s, " << w.moved() << " m after 60 s, sweeps " << w.sweeps());
    CHECK(std::abs(after - 2 * x) < 1e-6);
    CHECK(std::abs(w.moved() - 2 * x) < (heavy > 1000 ? 2e-5 : 1e-6));
    World<float, Exec> f(tower(0.1, {1, heavy}, 0.002));
    f.step(30000);
    MESSAGE("float " << f.moved() << " m after 60 s, sweeps " << f.sweeps());
    CHECK(std::abs(f.moved() - 2 * x) < 2e-5);
  }
}

// What cannot give way is pressed by its spring, K d x / R, whatever it was pressed with before. MuJoCo: 209 N, 228 N. Before, contacts
// that carried much were hardened for it, so that they carried more: 1e27 N after 50 steps.
TEST_CASE("what is squeezed is pressed no harder each step") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  double const r = 0.1, depth = 1e-3, mass = 1000 * 4.0 / 3.0 * M_PI * r * r * r, d = 0.95, time = 0.0125;
  double const spring = depth / (d * d * time * time) * d / ((1 - d) / d / mass);
  for (bool const cart : {true, false}) {
    CAPTURE(cart);
    gsp::Description scene;
    scene.option.timestep = 0.002;
    auto plane = geom(gsp::ShapeType::plane, {0, 0, 1});
    double const tilt = cart ? 0.001 * M_PI / 180 : 0;
    plane.quat = {std::cos(tilt / 2), 0, std::sin(tilt / 2), 0};
    scene.bodies[0].geoms.push_back(plane);
    if (!cart) {  // a slot, as much too narrow above
      auto lid = geom(gsp::ShapeType::box, {1, 1, 0.1});
      lid.pos = {0, 0, 2 * r - 2 * depth + 0.1};
      scene.bodies[0].geoms.push_back(lid);
    }
    gsp::BodyDescription body;
    body.parent = 0;
    body.pos = {0, 0, r - depth};
    body.joints.emplace_back();
    body.joints[0].type = cart ? gsp::JointType::slide : gsp::JointType::free;
    body.joints[0].axis = {1, 0, 0};
    body.geoms.push_back(geom(gsp::ShapeType::sphere, {r, 0, 0}));
    scene.bodies.push_back(body);
    World<double, Exec> w(scene);
    w.step(400);
    double most = 0;
    auto const p = gsp_test::host(w.sim.impulses.p[gsp_test::host(w.sim.impulses.parity)()]);
    for (int i = 0; i < gsp_test::host(w.sim.rows.count)(0); ++i) most = std::max(most, p(i) / 0.002);
    MESSAGE(most << " N, spring " << spring);
    CHECK(std::abs(most / (spring + (cart ? 0 : 0.5 * mass * 9.81)) - 1) < 0.02);  // it slides and sinks by micrometres meanwhile
    CHECK(w.speed() < 1e-3);
  }
}

// Bar of the project: within 1e-4 m for 60 s, once it has sunk into its contacts. In double, where rounding never makes axes parallel
// again, it rocked for ever, from one end to the other, with 0.06 rad/s at 2 ms and 0.28 at 10 ms. Dropped askew it comes to rest askew.
TEST_CASE_TEMPLATE("a capsule in a V lies still", R, float, double) {
  struct Start {
    double timestep, tilt, yaw, seconds;
  };
  for (Start const start : {Start{0.002, 0, 0, 60},
                            {0.01, 0, 0, 60},
                            {0.01, 0.02, 0, 9},
                            {0.002, 0, 0.02, 9},
                            {0.01, 0.01, 0.05, 9},
                            {0.01, 0.02, 0.05, 9},
                            {0.01, 0.03, 0.05, 9},
                            {0.01, 0.04, 0.05, 9},
                            {0.01, 0.05, 0.05, 9},
                            {0.01, 0.06, 0.05, 9},
                            {0.005, 0.05, 0.05, 9}}) {
    World<R, Kokkos::DefaultHostExecutionSpace> w(gsp_test::capsule_in_v(start.timestep, start.tilt));
    w.state.qpos(0, 4) = R(start.tilt / 2), w.state.qpos(0, 6) = R(start.yaw / 2);
    bool const askew = start.tilt != 0 || start.yaw != 0;
    w.step(int((askew ? 8 : 1) / start.timestep));
    auto const before = w.qpos();
    double const place[3] = {before(0, 0), before(0, 1), before(0, 2)};
    w.step(int((start.seconds - (askew ? 8 : 1)) / start.timestep));
    auto const q = w.qpos();
    CAPTURE(start.timestep);
    CAPTURE(start.tilt);
    CAPTURE(start.yaw);
    for (int c = 0; c < 3; ++c) CHECK(std::abs(q(0, c) - place[c]) < 1e-4);
    CHECK(w.speed() < 1e-4);
  }
}

// Eight bodies of four jointed legs that begin up to 10 cm inside of each other, jammed: they part, and fall, and lie. Contacts that were
// hardened for the weight of all pushed each with a thousand times its weight, and five of eight such starts ended at 1e10 rad/s. What they
// may have: what their springs hold, 1/2 K d^2 with K = 7,000 / s^2 and d = 0.1 m, 8 m/s, on limbs of 0.1 m.
gsp::Description jammed_crawlers(double shift) {
  gsp::Description d = on_floor(0.005);
  for (int i = 0; i < 8; ++i) {
    add_free(d, {(i == 0 ? shift : 0) + 0.2 * (i % 2) + 0.03 * i, 0.17 * (i / 2 % 2), 0.3 + 0.25 * (i / 4) + 0.04 * (i % 3)},
             geom(gsp::ShapeType::box, {0.16, 0.08, 0.05}, 4));
    d.bodies.back().quat = {std::cos(0.3 * i), 0, 0, std::sin(0.3 * i)};
    int const torso = int(d.bodies.size()) - 1;
    for (int leg = 0; leg < 4; ++leg)
      for (int part = 0; part < 2; ++part) {
        auto& b = d.bodies.emplace_back();
        b.parent = part == 0 ? torso : int(d.bodies.size()) - 2;
        b.pos = part == 0 ? gsp::Double3{leg < 2 ? 0.14 : -0.14, leg % 2 == 0 ? 0.1 : -0.1, 0} : gsp::Double3{0, 0, -0.14};
        auto& joint = b.joints.emplace_back();
        joint.type = gsp::JointType::hinge;
        joint.axis = part == 0 ? gsp::Double3{1, 0.2 * leg, 0} : gsp::Double3{0, 1, 0};
        joint.damping = 0.3;
        b.geoms.push_back(geom(gsp::ShapeType::capsule, {0.025, 0.05, 0}, 0.4));
        b.geoms.back().pos = {0, 0, -0.07};
      }
  }
  return d;
}
TEST_CASE_TEMPLATE("what is jammed deeply parts", R, float, double) {
  double fastest = 0;
  for (int k = 0; k < 8; ++k) {
    CAPTURE(k);
    World<R, Kokkos::DefaultHostExecutionSpace> w(jammed_crawlers(0.001 * k));
    for (int i = 0; i < 400; ++i) {
      w.step(1);
      fastest = std::fmax(fastest, w.speed());
    }
    CHECK(w.speed() < 80);
  }
  MESSAGE("up to " << fastest << " rad/s on the way");
}

// A rigid sphere comes back with e times its speed in the middle of the step, whatever the sub-step at which it lands: u+ + g h / 2 =
// -e (u- - g h / 2) to rounding, so that with e = 1 it is as fast as it was, and climbs as high. Slower than |g| h it rests; with e = 0 it
// lands on the floor, and lies.
TEST_CASE_TEMPLATE("rigid spheres bounce", Exec, GSP_TEST_EXECS) {
  for (double const e : {0.0, 0.5, 1.0}) {
    gsp::Description d = on_floor(0.001);
    auto ball = geom(gsp::ShapeType::sphere, {0.1, 0, 0});
    ball.hard = true;
    ball.restitution = e;
    ball.erp = 0;  // what it has sunk in by when it is found is not given back
    add_free(d, {0, 0, 0.3}, ball);
    World<double, Exec> w(d);
    double down = 0;
    int left = 1000;
    for (; left > 0 && w.qvel()(0, 2) <= down; --left) {
      down = w.qvel()(0, 2);
      w.step(1);
    }
    CAPTURE(e);
    CHECK(down < -1.9);
    double const half = 9.81 * 0.001 / 2;
    if (e > 0) CHECK(std::abs(w.qvel()(0, 2) + half + e * (down - half)) < 1e-9);
    if (e == 0) {
      CHECK(std::abs(w.qpos()(0, 2) - 0.1) < 0.001 * std::abs(down));
      w.step(1);
      CHECK(std::abs(w.qvel()(0, 2)) < 1e-9);
    }
    if (e == 1) {
      double top = 0;
      for (int bounces = 0; bounces < 50; ++bounces) {
        w.step(100);
        top = std::fmax(top, 0.5 * std::pow(w.qvel()(0, 2), 2) + 9.81 * (w.qpos()(0, 2) - 0.1));
      }
      CHECK(std::abs(top / (9.81 * 0.2) - 1) < 0.02);  // less what half a step's fall is worth, which the scheme swings by
    } else {
      w.step(5000);
      CHECK(std::abs(w.qvel()(0, 2)) < 1e-9);
    }
  }
}

// A named pair may be rigid, whatever its geoms are: it comes back with half its speed, half a step's fall apart as above; and the geoms
// may be, and the pair is soft.
TEST_CASE_TEMPLATE("a named pair is rigid by itself", Exec, GSP_TEST_EXECS) {
  for (bool const hard : {true, false}) {
    gsp::Description d = on_floor(0.001);
    d.bodies[0].geoms[0].name = "floor";
    auto ball = geom(gsp::ShapeType::sphere, {0.1, 0, 0});
    ball.name = "ball";
    ball.hard = !hard;
    ball.restitution = 1;
    add_free(d, {0, 0, 0.3}, ball);
    d.pairs.emplace_back();
    d.pairs[0].geom1 = "floor", d.pairs[0].geom2 = "ball";
    d.pairs[0].rigid = {.hard = hard, .restitution = 0.5, .erp = 0};
    World<double, Exec> w(d);
    double down = 0, up = 0;
    for (int left = 1000; left > 0; --left) {
      w.step(1);
      double const v = w.qvel()(0, 2);
      if (up == 0) down = std::fmin(down, v);
      up = std::fmax(up, v);
    }
    double const half = 9.81 * 0.001 / 2;
    CAPTURE(hard);
    CHECK(down < -1.9);
    if (hard) CHECK(std::abs(up + half + 0.5 * (down - half)) < 1e-9);
    if (!hard) CHECK(up < 0.5);  // a soft one gives back a little; rigid by its geoms it would have 2 m/s
  }
}

// Newton's cradle (shared/data: newton_cradle_mt.xml): five touching spheres on arms, the first falls from the horizontal, and stops as the
// last one flies. A round of impacts conserves energy; what is left is what steps of 1 ms make of pendula: below 0.2 %. Bar of the project:
// 1 % in 30 s, 0.99 of the rate passed on. The spheres keep their order but for the way of a step, h v, v^2 = 2 g L, by which one is in the
// next when it is found.
TEST_CASE("Newton's cradle keeps its energy") {
  World<double, Kokkos::DefaultHostExecutionSpace> w(gsp_test::cradle());
  auto const q0 = w.qpos();
  q0(0, 0) = M_PI / 2;
  Kokkos::deep_copy(w.state.qpos, q0);
  double const m = 1000 * 4 / 3. * M_PI * 0.125, inertia = m * (16 + 0.4 * 0.25), start = m * 9.8 * 4;
  double worst = 0, order = 0, before = 0;
  for (int k = 0; k < 2000 && std::abs(w.qvel()(0, 4)) < 0.1; ++k) {
    before = w.qvel()(0, 0);
    w.step(1);
  }
  for (int i = 0; i < 5; ++i) CHECK(std::abs(w.qvel()(0, i) / before - (i == 4)) < 0.01);
  for (int k = 0; k < 300; ++k) {
    w.step(100);
    auto const q = w.qpos(), v = w.qvel();
    double energy = 0;
    for (int i = 0; i < 5; ++i) energy += 0.5 * inertia * v(0, i) * v(0, i) + m * 9.8 * 4 * (1 - std::cos(q(0, i)));
    worst = std::fmax(worst, std::abs(energy / start - 1));
    // a positive angle swings to -x: sphere i + 1 is on the +x side of sphere i
    for (int i = 0; i + 1 < 5; ++i) order = std::fmax(order, q(0, i + 1) - q(0, i));
  }
  MESSAGE("energy within " << worst << " of the start's, spheres overlap by at most " << 4 * order << " m");
  CHECK(worst < 0.002);
  CHECK(4 * order < 0.001 * std::sqrt(2 * 9.8 * 4));
}

// Contacts act from |g| h^2 on, of the gravity of their world now: 9.81, 4 x 9.81 and none, which counts as 9.81. Spheres at rest at 0.9
// and 1.1 times that, in all worlds; one normal and two tangents each.
TEST_CASE_TEMPLATE("contacts act as early as the gravity of their world says", Exec, GSP_TEST_EXECS) {
  double const h = 0.002, early = 9.81 * h * h;
  gsp::Description d = on_floor(h);
  d.option.gravity = {0, 0, 0};
  for (double const gap : {0.9 * early, 1.1 * early, 3.6 * early, 4.4 * early})
    add_free(d, {gap * 1e5, 0, 0.1 + gap}, geom(gsp::ShapeType::sphere, {0.1, 0, 0}));
  auto const compiled = gsp::compile(d);
  Exec const exec;
  auto model = gsp::make_model<double>(exec, compiled);
  gsp::make_per_world(exec, model, {gsp::ModelField::gravity}, 3);
  auto const g = Kokkos::create_mirror_view(gsp::world_values(model, gsp::ModelField::gravity));
  for (int w = 0; w < 3; ++w) g(w, 0) = g(w, 1) = 0, g(w, 2) = w == 0 ? -9.81 : w == 1 ? -4 * 9.81 : 0;
  Kokkos::deep_copy(gsp::world_values(model, gsp::ModelField::gravity), g);
  auto state = gsp::make_state(exec, model, {.worlds = 3});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = 3});
  gsp::step(exec, model, state, sim);
  auto const rows = gsp_test::host(sim.rows.count);
  CHECK(rows(0) == 3);
  CHECK(rows(1) == 9);
  CHECK(rows(2) == 3);
}

// A rigid ball in the corner of a floor and a wall whose friction is 1 or more: the two may hold each other's impulses up without bound. It
// comes from 64 sides; what it has of energy (and of rounding) it had at the start. With leaps of wedged impulses: up to 60,000 times that.
TEST_CASE_TEMPLATE("what is wedged is not thrown out", R, float, double) {
  constexpr int worlds = 64;
  auto d = on_floor(0.005);
  d.bodies[0].geoms.push_back(d.bodies[0].geoms[0]);
  d.bodies[0].geoms[1].quat = {std::sqrt(0.5), 0, std::sqrt(0.5), 0};
  add_free(d, {0.2, 0, 0.2}, geom(gsp::ShapeType::sphere, {0.1, 0, 0}, 1));
  for (auto& body : d.bodies)
    for (auto& g : body.geoms) {
      g.hard = true;
      g.friction = {1.5, 0.005, 0.0001};
    }
  using Exec = Kokkos::DefaultHostExecutionSpace;
  gsp_test::World<R, Exec> w(gsp::compile(d), worlds);
  auto const energy = [&](int i) {
    double sum = 9.81 * w.state.qpos(i, 2);
    for (int k = 0; k < 6; ++k) sum += 0.5 * (k < 3 ? 1 : 0.004) * std::pow(double(w.state.qvel(i, k)), 2);
    return sum;
  };
  std::mt19937 random(1);
  std::uniform_real_distribution<double> side(-1, 1);
  double start[worlds], worst = 0;
  for (int i = 0; i < worlds; ++i) {
    for (int k = 0; k < 6; ++k) w.state.qvel(i, k) = R((k < 3 ? 3 : 20) * side(random));
    start[i] = energy(i);
  }
  for (int n = 0; n < 300; ++n) {
    w.step(1);
    for (int i = 0; i < worlds; ++i) worst = std::fmax(worst, energy(i) / start[i]);
  }
  CHECK(worst < 1 + 1e-4);
}

// A capsule in a V of two others needs the points that make_simulation asks for; a loop without them has other bits.
TEST_CASE("a loop of one's own has the bits of step") {
  using World = gsp_test::World<double, Kokkos::DefaultHostExecutionSpace>;
  auto const c = gsp::compile(gsp_test::capsule_in_v(0.01));
  World step(c);
  step.step(100);
  auto const own = [&](gsp::ContactsOptions options) {
    World w(c);
    auto& s = w.sim;
    s.contacts = gsp::make_contacts(w.exec, s.collision, options);
    s.rows = gsp::make_rows(w.exec, w.model, gsp::rows_options(w.model, s.collision, 1));
    s.impulses = gsp::make_impulses(w.exec, s.rows);
    for (int t = 0; t < 100;) {
      gsp::smooth_dynamics(w.exec, w.model, w.state, s.poses, s.dynamics);
      gsp::act_early(w.model, s.collision);
      gsp::collide(w.exec, s.collision, s.poses, s.contacts);
      auto const types = gsp::model_constraints(w.model, w.state, s.poses, s.dynamics, s.collision, s.contacts);
      gsp::assemble(w.exec, w.model, w.state, s.dynamics, types, s.rows, s.impulses, s.progress);
      gsp::impacts(w.exec, s.progress, s.rows, s.impulses, s.solution);
      gsp::pgs(w.exec, s.rows, s.impulses, s.solution, s.progress);
      gsp::integrate(w.exec, w.model, w.state, s.dynamics, s.progress, s.solution);
      bool const more_contacts = gsp::grow(w.exec, s.contacts), more_rows = gsp::grow(w.exec, s.rows, s.impulses, s.progress);
      t += !more_contacts && !more_rows;
    }
    double difference = 0;
    for (int i = 0; i < w.model.nq; ++i) difference = std::fmax(difference, std::abs(w.state.qpos(0, i) - step.state.qpos(0, i)));
    return difference;
  };
  CHECK(own(gsp::contacts_options(step.model, 1)) == 0);
  CHECK(own({.worlds = 1, .points_per_box_pair = 4}) > 0);
}

// A box and a capsule that overlap by 1 mm and are welded rigidly, dropped by 0.35 m: what squeezes them has no end, and they were thrown
// (254 m/s in float; NaN with a heavy body 900 m away, as the weight of all was what a contact is hardened for). They land at 8.8 rad/s, as
// two that overlap no more, and come to rest; the mass of what lies far away does not change a bit.
TEST_CASE_TEMPLATE("what is welded and overlaps is not thrown", R, float, double) {
  auto const text = [](char const* far) {
    return std::string(R"(<mujoco><option timestep="0.002"/><worldbody><geom type="plane" size="50 50 .1"/>
      <body name="a" pos="0 0 .5" euler="30 20 0"><freejoint/><geom type="box" size=".05 .05 .05"/></body>
      <body name="b" pos="0 0 .65" euler="10 0 0"><freejoint/><geom type="capsule" size=".03 .05" mass="3"/></body>)") +
           far + R"(</worldbody><equality><weld body1="a" body2="b" hard="true"/></equality></mujoco>)";
  };
  using World = gsp_test::World<R, Kokkos::DefaultHostExecutionSpace>;
  World alone(gsp::compile(gsp::io::parse_mjcf(text(""), "welded.xml")));
  World beside(gsp::compile(gsp::io::parse_mjcf(
      text(R"(<body pos="-9 -9 900"><freejoint/><geom type="sphere" size=".1" mass="100000"/></body>)"), "welded.xml")));
  double most = 0, last = 0;
  for (int step = 0; step < 1500; ++step) {
    alone.step(1), beside.step(1);
    auto const v = alone.qvel(), u = beside.qvel();
    last = 0;
    for (int i = 0; i < 12; ++i) last = std::fmax(last, std::abs(double(v(0, i))));
    most = std::fmax(most, last);
    for (int i = 0; i < 12; ++i) REQUIRE(v(0, i) == u(0, i));
  }
  CHECK(most < 10);
  CHECK(last < 1e-3);

  // and side by side, 10 mm in each other, the one 10,000 times as heavy (they gained 1e15 J)
  World heavy(gsp::compile(gsp::io::parse_mjcf(R"(<mujoco><option timestep="0.002"/><worldbody><geom type="plane" size="20 20 .1"/>
      <body name="a" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/></body>
      <body name="b" pos=".19 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="10000"/></body></worldbody>
      <equality><weld body1="a" body2="b" hard="true"/></equality></mujoco>)",
                                               "welded.xml")));
  for (int step = 0; step < 1000; ++step) {
    heavy.step(1);
    auto const v = heavy.qvel();
    for (int i = 0; i < 12; ++i) REQUIRE(std::abs(double(v(0, i))) < 0.02);
  }
}

// Boxes in a row that are welded rigidly, each to the next, are one body: their trees are taken as one (model/archetypes.hpp), and the
// welds eliminated. Of 1,000 and 1 kg in turn and thrown at the floor, at first they lose m g^2 h^2 / 2 a step, as a point does (what h^2
// opens is closed in the first step, at 0.005 J); no step gains a hundredth of what the blow takes (31 J of 5.5 kJ; 38 J of 5.2 kJ where
// the boxes are geoms of one body; 2 kJ as rows that are swept), and they rest with the least sweeps.
TEST_CASE_TEMPLATE("boxes that are welded rigidly are one body", R, float, double) {
  int const n = 4;
  double const mass[n] = {1000, 1, 1000, 1}, inertia = 2 * 0.2 * 0.2 / 12;
  std::string bodies, welds;
  for (int b = 0; b < n; ++b) {
    bodies += "<body name='b" + std::to_string(b) + "' pos='" + std::to_string(0.2 * b) + " 0 .5'><freejoint/>" +
              "<geom type='box' size='.1 .1 .1' mass='" + std::to_string(mass[b]) + "'/></body>";
    if (b > 0) welds += "<weld body1='b" + std::to_string(b - 1) + "' body2='b" + std::to_string(b) + "' hard='true'/>";
  }
  gsp_test::World<R, Kokkos::DefaultHostExecutionSpace> w(gsp::compile(gsp::io::parse_mjcf(
      "<mujoco><option timestep='0.0025'/><worldbody><geom type='plane' size='20 20 .1'/>" + bodies + "</worldbody><equality>" + welds +
          "</equality><contact><exclude body1='b0' body2='b1'/><exclude body1='b1' body2='b2'/><exclude body1='b2' "
          "body2='b3'/></contact></mujoco>",
      "row.xml")));
  REQUIRE(w.model.ntree == 1);
  auto const energy = [&] {
    auto const q = w.qpos();
    auto const v = w.qvel();
    double e = 0;
    for (int b = 0; b < n; ++b) {
      e += mass[b] * 9.81 * double(q(0, 7 * b + 2));
      for (int i = 0; i < 6; ++i) e += 0.5 * mass[b] * (i < 3 ? 1 : inertia) * gsp::square(double(v(0, 6 * b + i)));
    }
    return e;
  };
  {  // they turn about y at 3 rad/s, and one end comes down first
    auto v = w.qvel();
    for (int b = 0; b < n; ++b) v(0, 6 * b + 4) = 3, v(0, 6 * b + 2) = R(-3 * 0.2 * b), v(0, 6 * b) = 2;
    Kokkos::deep_copy(w.state.qvel, v);
  }
  double const energy_rounding = 1e4 * 8 * std::numeric_limits<R>::epsilon();  // of 10 kJ
  double last = energy(), gained = 0, lost = 0, open = 0;
  auto before = w.qpos();
  double speed[6 * n] = {};  // mean of the last hundred steps
  for (int step = 0; step < 4000; ++step) {
    if (step == 3000) before = w.qpos();
    w.step(1);
    if (step >= 3900) {
      auto const v = w.qvel();
      for (int i = 0; i < 6 * n; ++i) speed[i] += std::abs(double(v(0, i))) / 100;
    }
    double const now = energy();
    if (step < 40) CHECK(std::abs(last - now - 2002 * gsp::square(9.81 * 0.0025) / 2) < 0.01 + energy_rounding);
    gained = std::fmax(gained, now - last);
    lost = std::fmax(lost, last - now);
    last = now;
    auto const q = w.qpos();
    for (int b = 1; b < n; ++b) {
      double d2 = 0;
      for (int i = 0; i < 3; ++i) d2 += gsp::square(double(q(0, 7 * b + i) - q(0, 7 * b - 7 + i)));
      open = std::fmax(open, std::abs(std::sqrt(d2) - 0.2));
    }
  }
  CHECK(gained < 0.01 * lost);
  CHECK(open < 1e-4);
  CHECK(gsp_test::host(w.sim.solution.iterations)(0) == 4);
  // In float one step in some sixty turns by what rounding took of a quaternion near 1, up to epsilon / 4, which is 1.2e-5 rad/s; the mean
  // is a tenth of 1e-5 at most, and nothing goes anywhere.
  auto const q = w.qpos();
  for (double const mean : speed) CHECK(mean < 1e-6);
  for (int i = 0; i < 7 * n; ++i) CHECK(std::abs(double(q(0, i) - before(0, i))) < 4 * std::numeric_limits<R>::epsilon());
}

// What fingers hold yields by little, however much harder than its weight they press: two of 0.1 kg with 10 and 20 N on a ball of 10 g, at
// 2 ms. The contacts are hardened for their load, up to the weight of the three (2 N), and as stiff from there on.
TEST_CASE_TEMPLATE("what is gripped sinks in by less than a millimetre", R, float, double) {
  for (char const* force : {"10", "20"}) {
    auto const text = std::string(R"(<mujoco><option timestep="0.002"/><worldbody><geom type="plane" size="20 20 .1"/>
      <body pos=".06 0 .3"><joint name="r" type="slide" axis="-1 0 0"/><geom type="box" size=".01 .02 .03" mass=".1"/></body>
      <body pos="-.06 0 .3"><joint name="l" type="slide" axis="1 0 0"/><geom type="box" size=".01 .02 .03" mass=".1"/></body>
      <body pos="0 0 .3"><freejoint/><geom type="sphere" size=".04" mass=".01"/></body></worldbody><actuator>
      <motor joint="r" gear=")") +
                      force + R"("/><motor joint="l" gear=")" + force + R"("/></actuator></mujoco>)";
    gsp_test::World<R, Kokkos::DefaultHostExecutionSpace> w(gsp::compile(gsp::io::parse_mjcf(text, "grip.xml")));
    Kokkos::deep_copy(w.state.ctrl, R(1));
    w.step(1000);
    auto const q = w.qpos();
    for (int finger = 0; finger < 2; ++finger) CHECK(std::abs(double(q(0, finger)) - 0.0105) < 0.0005);
  }
}

TEST_CASE("pyramids beside contacts that are hard are refused") {
  auto d = gsp_test::capsule_in_v(0.01);
  auto const make = [&](gsp::FrictionCone cone) {
    gsp_test::World<float, Kokkos::DefaultHostExecutionSpace> const w(gsp::compile(d));
    return gsp::make_simulation(w.exec, w.model, w.compiled, {.cone = cone});
  };
  CHECK_NOTHROW(make(gsp::FrictionCone::pyramidal));
  d.bodies.back().geoms.at(0).hard = true;
  CHECK_NOTHROW(make(gsp::FrictionCone::box));
  CHECK_THROWS_WITH_AS(make(gsp::FrictionCone::pyramidal), doctest::Contains("some geoms or pairs are hard"), gsp::Error);
}

// Sixteen cans that overlap by 5 mm, in steps of 0.5 ms: sweeps that end early leave overlaps, but throw nothing. With 12 sweeps nothing
// leaps; with a few more the bodies are never faster than with these (before: up to twice the energy, with 16 sweeps, as leaps pressed
// harder for what friction of others took away). Measured: within 1.1 %.
TEST_CASE_TEMPLATE("too few sweeps throw nothing", R, float, double) {
  auto d = on_floor(0.0005);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> off(-0.003, 0.003);
  for (int i = 0; i < 16; ++i) {
    double const x = 0.065 * (i % 4) + off(random), y = 0.065 * (i / 4) + off(random);
    add_free(d, {x, y, 0.0999}, geom(gsp::ShapeType::cylinder, {0.035, 0.1, 0}, 0.5));
  }
  auto const compiled = gsp::compile(d);
  auto const most_energy = [&](int sweeps) {
    gsp_test::World<R, Kokkos::DefaultHostExecutionSpace> w(compiled);
    double most = 0;
    for (int n = 0; n < 60; ++n) {
      w.step(1, {.iterations = sweeps});
      double sum = 0;
      for (int i = 0; i < 6 * 16; ++i)
        if (i % 6 < 3) sum += 0.25 * std::pow(double(w.state.qvel(0, i)), 2);
      most = std::fmax(most, sum);
    }
    return most;
  };
  double const without = most_energy(12);
  for (int sweeps : {16, 20, 30}) {
    CAPTURE(sweeps);
    double const ratio = most_energy(sweeps) / without;
    MESSAGE(sweeps << " sweeps: " << ratio << " of the energy with 12");
    CHECK(ratio < 1.1);
  }
}

// A door that a rigid connect holds at a point of its own hinge, elsewhere on the axis: it moves as without, for the connect's lever is
// rounding. Before, 30 of 30 stood still or were thrown, as the row bore zeta / |Y|^2.
TEST_CASE_TEMPLATE("a rigid connect on a hinge's own axis holds nothing", R, float, double) {
  std::mt19937 random(3);
  std::normal_distribution<double> any(0, 1);
  double worst = 0;
  for (int k = 0; k < 20; ++k) {
    gsp::Description d;
    d.option.timestep = 0.002;
    gsp::BodyDescription door;
    door.parent = 0;
    door.name = "door";
    door.pos = {any(random), any(random), any(random)};
    door.quat = {any(random), any(random), any(random), any(random)};
    auto& hinge = door.joints.emplace_back();
    hinge.axis = {any(random), any(random), any(random)};
    hinge.pos = {0.3 * any(random), 0.3 * any(random), 0.3 * any(random)};
    door.geoms.push_back(geom(gsp::ShapeType::box, {0.4, 0.03, 0.5}, 2));
    d.bodies.push_back(door);
    auto const moved = [&] {
      gsp_test::World<R, Kokkos::DefaultHostExecutionSpace> w(gsp::compile(d));
      w.step(200);
      return double(w.state.qpos(0, 0));
    };
    double const free = moved();
    gsp::EqualityDescription connect;
    connect.name1 = "door";
    connect.rigid.hard = true;
    for (int i = 0; i < 3; ++i) connect.data[std::size_t(i)] = hinge.pos[i] + 0.9 * hinge.axis[i];
    d.equalities = {connect};
    worst = std::fmax(worst, std::abs(moved() - free));
  }
  MESSAGE("angles after 0.4 s differ by " << worst);
  CHECK(worst < (sizeof(R) == 4 ? 1e-4 : 1e-10));
}
