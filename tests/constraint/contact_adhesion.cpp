#include <doctest/doctest.h>

#include <cmath>
#include <gsp/constraint/contact_forces.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>

#include "step/world.hpp"

// Adhesion and moving surfaces in profile stable, beside closed forms. (In profile mujoco: tests/oracle/constraints.cpp.)

namespace {

constexpr double g = 9.81, mu = 0.5;

gsp::GeomDescription shape(gsp::ShapeType type, gsp::Double3 const& size, gsp::Double3 const& pos = {0, 0, 0}) {
  gsp::GeomDescription geom;
  geom.type = type;
  geom.size = size;
  geom.pos = pos;
  geom.friction = {mu, 0.05, 0.0001};
  return geom;
}
gsp::Description scene(gsp::GeomDescription const& still, gsp::GeomDescription const& moving, gsp::Double3 const& pos, double mass) {
  gsp::Description d;
  d.bodies[0].geoms.push_back(still);
  gsp::BodyDescription body;
  body.name = "body";
  body.parent = 0;
  body.pos = pos;
  body.joints.emplace_back().type = gsp::JointType::free;
  body.geoms.push_back(moving);
  body.geoms[0].has_mass = true;
  body.geoms[0].mass = mass;
  d.bodies.push_back(body);
  return d;
}

template <class Exec>
struct World : gsp_test::World<double, Exec> {
  using Base = gsp_test::World<double, Exec>;
  using Base::exec, Base::model, Base::sim, Base::state;
  explicit World(gsp::Description const& d) : Base(gsp::compile(d)) {}
  double speed(int i) const { return gsp_test::host(state.qvel)(0, i); }
  double height() const { return gsp_test::host(state.qpos)(0, 2); }
  /// Normal forces of all contacts together.
  double normal() {
    Kokkos::View<double* [6], Kokkos::LayoutRight, typename Exec::memory_space> force("force", sim.contacts.dist.extent(0));
    gsp::contact_forces(exec, model, sim.collision, sim.contacts, sim.rows, sim.impulses, force);
    auto const f = gsp_test::host(force);
    double sum = 0;
    for (int c = 0, n = int(sim.contacts.demand(exec).contacts); c < n; ++c) sum += f(c, 0);
    return sum;
  }
};

}  // namespace

// A ball below a ceiling: it hangs where the adhesion exceeds its weight, a little below (soft), and falls freely where it does not.
TEST_CASE_TEMPLATE("what is pulled more than it weighs hangs", Exec, GSP_TEST_EXECS) {
  double const m = 2;
  for (double const share : {1.02, 0.98}) {
    auto ball = shape(gsp::ShapeType::sphere, {0.1, 0, 0});
    auto ceiling = shape(gsp::ShapeType::box, {1, 1, 0.1}, {0, 0, 1.1});
    ball.adhesion = 0.25 * share * m * g;
    ceiling.adhesion = 0.75 * share * m * g;
    ball.gap = 0.01;
    World<Exec> w(scene(ceiling, ball, {0, 0, 0.9}, m));
    w.step(1000);
    CAPTURE(share);
    if (share > 1) {
      CHECK(std::abs(w.speed(2)) < 1e-6);
      CHECK(w.height() < 0.9);
      CHECK(w.height() > 0.895);
      CHECK(std::abs(w.normal() + m * g) < 1e-6 * m * g);
    } else {
      CHECK(w.height() < -10);  // 2 s, of which it takes 0.3 to cross the gap
    }
  }
}

// Friction is bounded by mu (N + a) of all contacts: a block under gravity (t, 0, -g) holds where m t < mu (m g + 4 a) and else slides with
// what is left; contacts rest as deep as without adhesion.
TEST_CASE_TEMPLATE("adhesion adds to what friction may take, and not to the depth", Exec, GSP_TEST_EXECS) {
  double const m = 2, a = 3;
  double depth[2];
  for (int const pulls : {0, 1}) {
    double const most = mu * (m * g + 4 * a * pulls) / m;  // [m/s2]
    for (double const share : {0.98, 1.02}) {
      auto d = scene(shape(gsp::ShapeType::plane, {0, 0, 1}), shape(gsp::ShapeType::box, {0.2, 0.2, 0.02}), {0, 0, 0.02}, m);
      d.bodies[1].geoms[0].adhesion = a * pulls;
      d.option.gravity = {share * most, 0, -g};
      World<Exec> w(d);
      w.step(250);  // it sinks in first, when less bears it
      double const before = w.speed(0);
      w.step(250);
      CAPTURE(share);
      if (share < 1)
        CHECK(std::abs(w.speed(0)) < 1e-6);
      else
        CHECK(std::abs((w.speed(0) - before) / (0.5 * (share - 1) * most) - 1) < 0.03);
      if (share < 1) depth[pulls] = w.height();
    }
  }
  CHECK(std::abs(depth[0] - depth[1]) < 1e-6);  // of 1e-4, to the solver's tolerance
}

// An actuator on the block presses it to a wall with F, shared by its contacts: mu F bears the weight or does not.
TEST_CASE_TEMPLATE("an actuator presses the contacts of its body", Exec, GSP_TEST_EXECS) {
  double const m = 2;
  for (double const share : {1.02, 0.98})
    for (bool const on_wall : {false, true}) {
      auto d = scene(shape(gsp::ShapeType::box, {0.1, 1, 1}, {-0.1, 0, 0}), shape(gsp::ShapeType::box, {0.02, 0.2, 0.2}), {0.02, 0, 0}, m);
      gsp::ActuatorDescription pull;
      pull.target = gsp::Transmission::body;
      pull.target_name = on_wall ? "world" : "body";
      pull.gainprm[0] = share * m * g / mu;
      d.actuators.push_back(pull);
      World<Exec> w(d);
      Kokkos::deep_copy(w.state.ctrl, 1.);
      w.step(500);
      CAPTURE(share);
      if (share > 1) {
        CHECK(std::abs(w.speed(2)) < 1e-6);
        CHECK(std::abs(w.normal() / (share * m * g / mu) - 1) < 1e-6);  // what the wall bears
      } else {
        CHECK(std::abs(w.speed(2) / ((share - 1) * g) - 1) < 0.03);
      }
    }
}

// A belt of speed v: mu g t, then v. A turntable: a block in its middle ends with its spin.
TEST_CASE_TEMPLATE("surfaces that move take along what lies on them", Exec, GSP_TEST_EXECS) {
  double const v = 0.6;
  auto belt = shape(gsp::ShapeType::plane, {0, 0, 1});
  belt.surface_velocity = {v * 0.8, v * 0.6, 5, 0, 0, 0};  // no push along the normal
  World<Exec> w(scene(belt, shape(gsp::ShapeType::box, {0.2, 0.2, 0.02}), {0, 0, 0.02}, 2));
  w.step(20);
  double const early = std::hypot(w.speed(0), w.speed(1));
  CHECK(std::abs(early / (mu * g * 0.04) - 1) < 0.03);
  CHECK(std::abs(w.speed(1) / w.speed(0) - 0.75) < 0.01);
  w.step(480);
  CHECK(std::abs(w.speed(0) - 0.8 * v) < 1e-6);
  CHECK(std::abs(w.speed(1) - 0.6 * v) < 1e-6);
  CHECK(std::abs(w.speed(2)) < 1e-6);

  auto table = shape(gsp::ShapeType::plane, {0, 0, 1});
  table.surface_velocity = {0, 0, 0, 0, 0, 2};
  for (int const condim : {3, 4}) {  // four points that go round, or one that turns
    auto block = condim == 3 ? shape(gsp::ShapeType::box, {0.2, 0.2, 0.02}) : shape(gsp::ShapeType::sphere, {0.02, 0, 0});
    block.condim = condim;
    World<Exec> turning(scene(table, block, {0, 0, 0.02}, 2));
    turning.step(1000);
    CAPTURE(condim);
    CHECK(std::abs(turning.speed(5) - 2) < 1e-3);
  }
}

// The force of an actuator is read of the dynamics: of this state, as it is now, whatever dynamics assemble is given.
TEST_CASE_TEMPLATE("forces of actuators are of the state that rows are made for", Exec, GSP_TEST_EXECS) {
  auto d = scene(shape(gsp::ShapeType::plane, {0, 0, 1}), shape(gsp::ShapeType::box, {0.2, 0.2, 0.02}), {0, 0, 0.02}, 2);
  gsp::ActuatorDescription press;
  press.target = gsp::Transmission::body;
  press.target_name = "body";
  d.actuators.push_back(press);
  World<Exec> w(d);
  auto old = gsp::make_dynamics(w.exec, w.model);
  gsp::smooth_dynamics(w.exec, w.model, w.state, w.sim.poses, old);
  w.step(1);
  auto const refused = [&](auto const& dynamics) {
    try {
      gsp::assemble(w.exec, w.model, w.state, w.sim.dynamics, gsp::constraints(gsp::ContactAdhesion(w.model, w.sim.contacts, dynamics)),
                    w.sim.rows, w.sim.impulses, w.sim.progress);
    } catch (std::invalid_argument const& e) { return std::string(e.what()); }
    return std::string();
  };
  gsp::smooth_dynamics(w.exec, w.model, w.state, w.sim.poses, w.sim.dynamics);
  gsp::collide(w.exec, w.sim.collision, w.sim.poses, w.sim.contacts);
  CHECK(refused(old).find("gsp::assemble: ") == 0);
  CHECK(refused(old).find("are of the state before its last step or reset") != std::string::npos);
  CHECK(refused(w.sim.dynamics).empty());
}
