// Friction of profile stable with its default settings, beside closed forms. Bars of the project: deceleration and heading 1 %, slip
// thresholds 1 %, spins 3 %.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>

#include "step/world.hpp"

namespace {

using gsp::Double3;
using gsp::Double4;

Double4 times(Double4 const& a, Double4 const& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}
Double3 rotate(Double4 const& q, Double3 const& v) {
  auto const r = times(times(q, {0, v[0], v[1], v[2]}), {q[0], -q[1], -q[2], -q[3]});
  return {r[1], r[2], r[3]};
}
Double4 about(Double3 const& axis, double angle) {
  return {std::cos(angle / 2), axis[0] * std::sin(angle / 2), axis[1] * std::sin(angle / 2), axis[2] * std::sin(angle / 2)};
}

/// A free body on a plane, all of it turned by `turn`, also gravity. friction: of both geoms.
struct Scene {
  gsp::ShapeType type = gsp::ShapeType::box;
  Double3 size{0.1, 0.1, 0.05};
  double height = 0.05;
  std::array<double, 3> friction{0.5, 0.005, 0.0001};
  int condim = 3;
  Double4 turn{1, 0, 0, 0};
  double slope = 0;  // of gravity against the plane's normal, down along +x turned by `heading`
  double heading = 0;
  bool on_box = false;  // on a large box in place of the plane
};
gsp::CompiledModel make(Scene const& s) {
  gsp::Description d;
  d.option.gravity = rotate(
      s.turn, {9.81 * std::sin(s.slope) * std::cos(s.heading), 9.81 * std::sin(s.slope) * std::sin(s.heading), -9.81 * std::cos(s.slope)});
  gsp::GeomDescription plane, geom;
  plane.type = gsp::ShapeType::plane;
  plane.size = {0, 0, 1};
  plane.quat = s.turn;
  if (s.on_box) {
    plane.type = gsp::ShapeType::box;
    plane.size = {20, 20, 1};
    plane.pos = rotate(s.turn, {0, 0, -1});
  }
  geom.type = s.type;
  geom.size = s.size;
  plane.friction = geom.friction = s.friction;
  geom.condim = s.condim;
  d.bodies[0].geoms.push_back(plane);
  gsp::BodyDescription b;
  b.parent = 0;
  b.pos = rotate(s.turn, {0, 0, s.height});
  b.quat = s.turn;
  b.joints.emplace_back().type = gsp::JointType::free;
  b.geoms.push_back(geom);
  d.bodies.push_back(b);
  return gsp::compile(d);
}

template <class R, class Exec>
struct World : gsp_test::World<R, Exec> {
  using Base = gsp_test::World<R, Exec>;
  using Base::state;
  Double4 turn;
  World(Scene const& s, double timestep = 0) : Base(make(s), 1, {.timestep = timestep}), turn(s.turn) {}
  /// Velocity in the scene's frame, then angular velocity in the body's.
  void set(Double3 const& v, Double3 const& w) {
    auto const h = gsp_test::host(state.qvel);
    auto const u = rotate(turn, v);
    for (int c = 0; c < 3; ++c) {
      h(0, c) = R(u[c]);
      h(0, 3 + c) = R(w[c]);
    }
    Kokkos::deep_copy(state.qvel, h);
  }
  Double3 velocity() const {
    auto const h = gsp_test::host(state.qvel);
    return rotate({turn[0], -turn[1], -turn[2], -turn[3]}, {double(h(0, 0)), double(h(0, 1)), double(h(0, 2))});
  }
  Double3 spin() const {
    auto const h = gsp_test::host(state.qvel);
    return {double(h(0, 3)), double(h(0, 4)), double(h(0, 5))};
  }
};

}  // namespace

// v(t) = v0 - mu g t along the heading. The body first sinks into its soft contact: 0.3 s to come to rest in the normal direction.
TEST_CASE_TEMPLATE("a block that slides decelerates by mu g and keeps its heading", Exec, GSP_TEST_EXECS) {
  double const mu = 0.5, g = 9.81, t = 0.2;
  for (Double4 const& turn : {Double4{1, 0, 0, 0}, about({0, 0, 1}, 0.7), about({0.6, 0.8, 0}, 1.1), about({0, 1, 0}, 3)})
    for (int k = 0; k < 8; ++k) {
      double const heading = 2 * M_PI * k / 8 + 0.1;
      World<double, Exec> w({.turn = turn});
      w.step(150);
      w.set({2 * std::cos(heading), 2 * std::sin(heading), 0}, {0, 0, 0});
      w.step(int(t / 0.002));
      auto const v = w.velocity();
      CAPTURE(heading);
      double const along = v[0] * std::cos(heading) + v[1] * std::sin(heading);
      double const across = v[1] * std::cos(heading) - v[0] * std::sin(heading);
      CHECK(std::abs((2 - along) / (mu * g * t) - 1) < 0.01);
      CHECK(std::abs(across) < 0.01 * along);
    }
}

// It holds where tan(slope) < mu and slides where it is more, whatever the direction down the slope.
TEST_CASE_TEMPLATE("a block slips at its friction", Exec, GSP_TEST_EXECS) {
  for (int k = 0; k < 8; ++k)
    for (double excess : {0.99, 1.01}) {
      double const heading = 2 * M_PI * k / 8 + 0.1;
      World<double, Exec> w({.slope = std::atan(0.5 * excess), .heading = heading});
      w.step(1000);
      auto const v = w.velocity();
      double const along = v[0] * std::cos(heading) + v[1] * std::sin(heading), slope = std::atan(0.5 * excess);
      CAPTURE(heading);
      CAPTURE(excess);
      if (excess < 1)
        CHECK(std::abs(along) < 1e-6);
      else
        CHECK(along == doctest::Approx(9.81 * 2 * (std::sin(slope) - 0.5 * std::cos(slope))).epsilon(0.1));
    }
}

// A box that spins on its four corners, r from the axis, and a disc on points of its rim: I dw/dt = -mu m g r. A ball with torsion:
// -mu_t m g. Its rolling: dv/dt = -mu_r g / (1.4 r).
TEST_CASE_TEMPLATE("spins and rolls slow down as their closed forms say", Exec, GSP_TEST_EXECS) {
  double const g = 9.81, mu = 0.5;
  SUBCASE("box") {
    World<double, Exec> w({});
    w.step(150);
    double const r = std::hypot(0.1, 0.1), inertia = (0.04 + 0.04) / 12, before = 20;  // of 1 kg
    w.set({0, 0, 0}, {0, 0, before});
    w.step(50);
    CHECK((before - w.spin()[2]) / (0.1 * mu * g * r / inertia) == doctest::Approx(1).epsilon(0.03));
  }
  SUBCASE("coin") {
    double const r = 0.1;
    World<double, Exec> w({.type = gsp::ShapeType::cylinder, .size = {r, 0.01, 0}, .height = 0.01});
    w.step(150);
    double const before = 20;
    w.set({0, 0, 0}, {0, 0, before});
    w.step(50);
    CHECK((before - w.spin()[2]) / (0.1 * mu * g * r / (0.5 * r * r)) == doctest::Approx(1).epsilon(0.03));
  }
  SUBCASE("torsion of a ball") {
    double const r = 0.1, torsion = 0.02;
    World<double, Exec> w({.type = gsp::ShapeType::sphere, .size = {r, 0, 0}, .height = r, .friction = {mu, torsion, 0.0001}, .condim = 4});
    w.step(150);
    double const before = 20;
    w.set({0, 0, 0}, {0, 0, before});
    w.step(50);
    CHECK((before - w.spin()[2]) / (0.1 * torsion * g / (0.4 * r * r)) == doctest::Approx(1).epsilon(0.03));
  }
  SUBCASE("rolling ball, in four directions") {
    double const r = 0.1, rolling = 0.01;
    for (int k = 0; k < 4; ++k) {
      World<double, Exec> w(
          {.type = gsp::ShapeType::sphere, .size = {r, 0, 0}, .height = r, .friction = {mu, 0.005, rolling}, .condim = 6});
      w.step(150);
      double const heading = 0.3 + 1.5 * k, c = std::cos(heading), s = std::sin(heading);
      w.set({2 * c, 2 * s, 0}, {-2 / r * s, 2 / r * c, 0});
      w.step(200);
      auto const v = w.velocity();
      CHECK((2 - (v[0] * c + v[1] * s)) / (0.4 * rolling * g / (1.4 * r)) == doctest::Approx(1).epsilon(0.03));
      CHECK(std::abs(v[1] * c - v[0] * s) < 0.01);
    }
  }
  SUBCASE("a ball that rolls and does not slip loses nothing") {
    double const r = 0.1;
    World<double, Exec> w({.type = gsp::ShapeType::sphere, .size = {r, 0, 0}, .height = r});
    w.step(150);
    w.set({2, 0, 0}, {0, 2 / r, 0});
    w.step(50);  // the contact lies half of the ball's depth in the floor above its lowest point: it first slips by that share
    double const before = w.velocity()[0];
    w.step(500);
    MESSAGE("rolls at " << before << " m/s and loses " << before - w.velocity()[0] << " in 1 s");
    CHECK(before == doctest::Approx(2).epsilon(1e-3));
    CHECK(std::abs(w.velocity()[0] - before) < 1e-4);
  }
}

// A round ellipsoid on a box is a ball on a plane, though the convex routine finds its contact: rounding of the normal, 1e-8, times 10 m.
TEST_CASE_TEMPLATE("a round ellipsoid rolls straight on a box", Exec, GSP_TEST_EXECS) {
  double const r = 0.1;
  World<double, Exec> w({.type = gsp::ShapeType::ellipsoid, .size = {r, r, r}, .height = r, .on_box = true});
  w.step(150);
  w.set({1, 0, 0}, {0, 1 / r, 0});
  w.step(1000);
  auto const v = w.velocity();
  CHECK(v[0] == doctest::Approx(1).epsilon(1e-3));
  CHECK(std::abs(v[1]) < 1e-3);
}

// Friction only takes energy, however strong: a cube that is thrown and tumbles has at most what it had.
TEST_CASE_TEMPLATE("strong friction makes no energy", Exec, GSP_TEST_EXECS) {
  double const g = 9.81, inertia = 0.04 / 6;  // of 1 kg
  for (double mu : {20., 300., 1000.}) {
    World<double, Exec> w({.size = {0.1, 0.1, 0.1}, .height = 0.4, .friction = {mu, 0.005, 0.0001}});
    w.set({0.7, -0.4, 0.2}, {3, -5, 2});
    auto const energy = [&] {
      auto const v = w.velocity(), s = w.spin();
      double const mass = w.compiled.body_mass[1];
      double const height = gsp_test::host(w.state.qpos)(0, 2);
      return (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + inertia * (s[0] * s[0] + s[1] * s[1] + s[2] * s[2])) * mass / 2 + mass * g * height;
    };
    double const start = energy();
    double most = 0;
    for (int i = 0; i < 60; ++i) {
      w.step(10);
      most = std::fmax(most, energy());
    }
    CAPTURE(mu);
    CHECK(most < 1.02 * start);
  }
}
