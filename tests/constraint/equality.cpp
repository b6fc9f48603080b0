#include <doctest/doctest.h>

#include <cmath>
#include <gsp/constraint/equality.hpp>
#include <gsp/constraint/tendon.hpp>
#include <gsp/model/world_values.hpp>
#include <gsp_test_execs.hpp>

#include "constraint/four_bar.hpp"
#include "constraint/loop.hpp"
#include "support/kokkos_tools.hpp"

using gsp_test::Loop;
using gsp_test::sliders;

// Against MuJoCo: tests/oracle/equality.cpp. Here: closed forms, invariants and switches, on every backend.
// Kernels: at namespace scope, as nvcc wants them.
namespace test_types {
template <class Mem>
struct SwitchOdd {
  typename gsp::State<double, Mem>::template View<int**> active;
  KOKKOS_FUNCTION void operator()(int w) const { active(w, 0) = w % 2 == 0; }
};
template <class Values>
struct Place {
  Values values;
  KOKKOS_FUNCTION void operator()(int w) const { values(w, 0) = 0.1 * w; }
};
template <class Mem>
struct ReadForces {  // (element, 3)
  gsp::ElementImpulses<double, Mem> impulses;
  Kokkos::View<double* [3], Mem> out;
  double timestep;
  KOKKOS_FUNCTION void operator()(int k) const {
    for (int r = 0; r < 3; ++r) out(k, r) = impulses(0, k, r) / timestep;
  }
};
}  // namespace test_types

namespace {

/// The softness of an equality by default: solref 0.02 1, solimp 0.9 0.95 0.001 0.5 2, beyond the width: K = 1/(dw T)^2, impedance dw.
constexpr double most = 0.95, K = 1 / (most * 0.02) / (most * 0.02);
/// The gap at which an equality at rest carries the force f, where it is wider than solimp's width: R f = K d x, R = (1 - d)/d diag.
double rest(double f, double diag) { return (1 - most) / most * diag * f / (K * most); }

/// Rates change by less than 1e-9 of what gravity does in a step.
constexpr gsp::PgsOptions converged{.iterations = 300, .tolerance = 1e-9f};

gsp::EqualityDescription equality(std::string name, gsp::EqualityType type, std::string first, std::string second = "") {
  gsp::EqualityDescription e;
  e.name = std::move(name), e.type = type, e.name1 = std::move(first), e.name2 = std::move(second);
  if (type == gsp::EqualityType::joint || type == gsp::EqualityType::tendon) e.data = {0, 1, 0, 0, 0};
  return e;
}
/// A free box of 2 kg, without gravity, at `pos`.
gsp::BodyDescription box(std::string name, gsp::Double3 pos) {
  gsp::BodyDescription b;
  b.parent = 0, b.name = std::move(name), b.pos = pos, b.has_inertial = true;
  b.inertial.mass = 2, b.inertial.inertia = {0.02, 0.03, 0.04, 0, 0, 0};
  b.joints.emplace_back().type = gsp::JointType::free;
  return b;
}
/// Force at each of the points, in world axes.
template <class R, class Exec>
auto forces(Loop<R, Exec> const& s) {
  using Mem = typename Exec::memory_space;
  Kokkos::View<double* [3], Mem> out("forces", s.model.neq);
  Kokkos::parallel_for(Kokkos::RangePolicy<Exec>(s.exec, 0, s.model.neq),
                       test_types::ReadForces<Mem>{gsp::impulses_of<gsp::Equalities<R, Mem>>(s.rows, s.impulses), out, s.model.timestep});
  return gsp_test::host(out);
}
template <class Loop>
auto equalities(Loop const& s) {
  return gsp::Equalities(s.model, s.state, s.poses, s.dynamics);
}

}  // namespace

// Two slides of 2 kg, x0 = 0.1 + 2 x1, the first pushed by F, the second by G: at rest the row carries f = -F = G / 2 where G = -2 F, and
// the gap is what the law says for that force, with diag = 1/2 + 1/2 (not 1/2 + 4/2: the approximation knows of no slope). Damping 20 over
// 2 kg for 8 s leaves e^-80; double.
TEST_CASE_TEMPLATE("a joint equality at rest under load", Exec, GSP_TEST_EXECS) {
  for (auto profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    auto d = sliders(2, 2);
    for (auto& b : d.bodies)
      if (!b.joints.empty()) b.joints[0].damping = 20;
    d.equalities = {equality("ratio", gsp::EqualityType::joint, "j0", "j1")};
    d.equalities[0].data = {0.1, 2, 0, 0, 0};
    Loop<double, Exec> s(gsp::compile(d), 2, {.profile = profile});
    s.solver = converged;
    double const force = 100;
    s.push(1, {force, -2 * force});
    s.step(4000, equalities(s));
    auto const q = gsp_test::host(s.state.qpos);
    CHECK(std::abs(q(0, 0) - 0.1 - 2 * q(0, 1)) < 1e-12);
    double const gap = q(1, 0) - 0.1 - 2 * q(1, 1);
    REQUIRE(rest(force, 1) > 0.001);  // beyond the width, as the closed form has it
    CHECK(std::abs(gap - rest(force, 1)) < 1e-10);
  }
}

// A box hangs on the world by a point off its centre: at rest the point is above the centre by the arm, and sags by what the law says for m
// g; a box that is welded sags as much, and turns nowhere where the point is its centre.
TEST_CASE_TEMPLATE("a box hangs on a point, or is welded", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  d.option.gravity = {0, 0, -100};
  d.bodies.push_back(box("hung", {0, 0, 1}));
  d.bodies.push_back(box("welded", {1, 0, 1}));
  auto hang = equality("hang", gsp::EqualityType::connect, "hung");
  hang.data[2] = 0.2;
  auto weld = equality("weld", gsp::EqualityType::weld, "welded");
  weld.data = {1, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1};  // the point in the world
  d.equalities = {hang, weld};
  auto const compiled = gsp::compile(d);
  Loop<double, Exec> s(compiled, 1);
  s.solver = converged;
  s.step(5000, equalities(s));
  auto const q = gsp_test::host(s.state.qpos);
  // translational weights: of the connect, too, that of the body's centre, 1/m
  double const sag = rest(2 * 100, 0.5);
  REQUIRE(sag > 0.001);
  CHECK(std::abs(1 - q(0, 2) - sag) < 1e-9);
  CHECK(std::abs(1 - q(0, 7 + 2) - sag) < 1e-9);
  for (int i : {0, 1, 7 + 1}) CHECK(std::abs(q(0, i)) < 1e-9);
  for (int i : {4, 5, 6, 7 + 4, 7 + 5, 7 + 6}) CHECK(std::abs(q(0, i)) < 1e-9);
  auto const force = forces(s);
  for (int k = 0; k < 2; ++k) CHECK(std::abs(force(k, 2) - 200) < 1e-6);
}

// Forces between two bodies leave their momentum alone: p at a point of one, -p at a point of the other, or a torque and its reaction.
// Sum of 500 steps' rounding in double: 500 * 1e-16 of 10 kg m/s. The pair turns and is thrown: the points stay together within what the
// law gives way to the centripetal force, here m w^2 r = 2 * 25 * 0.3 = 15 N: rest(15, 1) = 0.3 mm at impedances between 0.9 and 0.95, so
// twice that bounds it.
TEST_CASE_TEMPLATE("two bodies that are joined keep their momentum and stay together", Exec, GSP_TEST_EXECS) {
  for (auto type : {gsp::EqualityType::connect, gsp::EqualityType::weld}) {
    gsp::Description d;
    d.option.gravity = {0, 0, 0};
    d.bodies.push_back(box("a", {0, 0, 0}));
    d.bodies.push_back(box("b", {0.6, 0, 0}));
    auto joined = equality("joined", type, "a", "b");
    joined.data = {0.3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
    if (type == gsp::EqualityType::weld) joined.data[0] = -0.3;  // in the second body's frame
    d.equalities = {joined};
    Loop<double, Exec> s(gsp::compile(d), 1, {.profile = gsp::Profile::mujoco});
    s.solver = converged;
    double const w = 5;
    s.set(0, {0, 0, 0, 1, 0, 0, 0, 0.6, 0, 0, 1, 0, 0, 0}, {1, -0.3 * w, 0.2, 0, 0, w, 1, 0.3 * w, 0.2, 0, 0, w});
    double worst = 0;
    for (int t = 0; t < 500; ++t) {
      s.step(1, equalities(s));
      auto const q = gsp_test::host(s.state.qpos);
      auto const v = gsp_test::host(s.state.qvel);
      CHECK(std::abs(v(0, 0) + v(0, 6) - 2) < 1e-12);
      CHECK(std::abs(v(0, 1) + v(0, 7)) < 1e-12);
      gsp::Vec3<double> const arm{0.3, 0, 0};
      gsp::Quat<double> const q1{q(0, 3), q(0, 4), q(0, 5), q(0, 6)}, q2{q(0, 10), q(0, 11), q(0, 12), q(0, 13)};
      gsp::Vec3<double> const p1 = gsp::Vec3<double>{q(0, 0), q(0, 1), q(0, 2)} + gsp::rotate(q1, arm);
      gsp::Vec3<double> const p2 = gsp::Vec3<double>{q(0, 7), q(0, 8), q(0, 9)} - gsp::rotate(q2, arm);
      worst = std::fmax(worst, gsp::norm(p1 - p2));
    }
    CHECK(worst < 2 * rest(15, 1));
  }
}

// On in even worlds, off in odd ones, by a kernel; reset gives the model's own switch back. One falls by g h^2 n (n + 1)/2, exactly as
// far as one without; the bits of the others are those of a batch in which all are on.
TEST_CASE_TEMPLATE("a switch per world", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  d.option.gravity = {0, 0, -10};
  d.bodies.push_back(box("b", {0, 0, 1}));
  auto weld = equality("weld", gsp::EqualityType::weld, "b");
  weld.data = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
  d.equalities = {weld};
  auto const compiled = gsp::compile(d);
  Loop<double, Exec> s(compiled, 4), all(compiled, 4);
  s.solver = all.solver = converged;
  Kokkos::parallel_for(Kokkos::RangePolicy<Exec>(s.exec, 0, 4), test_types::SwitchOdd<typename Exec::memory_space>{s.state.eq_active});
  int const n = 50;
  s.step(n, equalities(s));
  all.step(n, equalities(all));
  auto const q = gsp_test::host(s.state.qpos), held = gsp_test::host(all.state.qpos);
  double const h = 0.002;
  for (int w = 0; w < 4; ++w) {
    if (w % 2)
      CHECK(std::abs(1 - q(w, 2) - 10 * h * h * n * (n + 1) / 2) < 1e-14);
    else
      CHECK(q(w, 2) == held(w, 2));
  }
  gsp::reset(s.exec, s.model, s.state);
  auto const active = gsp_test::host(s.state.eq_active);
  for (int w = 0; w < 4; ++w) CHECK(active(w, 0) == 1);
  CHECK(s.model.eq_active0.extent(0) == 1);
}

// Per world: the place to which a slide is tied, at rest without a load: exactly there.
TEST_CASE_TEMPLATE("what an equality asks for may differ from world to world", Exec, GSP_TEST_EXECS) {
  auto d = sliders(1, 2);
  d.bodies[1].joints[0].damping = 20;
  d.equalities = {equality("place", gsp::EqualityType::joint, "j0")};
  auto const compiled = gsp::compile(d);
  Loop<double, Exec> s(compiled, 3);
  s.solver = converged;
  gsp::make_per_world(s.exec, s.model, {gsp::ModelField::eq_data, gsp::ModelField::eq_solref}, 3);
  auto const values = gsp::world_values(s.model, gsp::ModelField::eq_data);
  Kokkos::parallel_for(Kokkos::RangePolicy<Exec>(s.exec, 0, 3), test_types::Place<decltype(values)>{values});
  s.step(3000, equalities(s));
  auto const q = gsp_test::host(s.state.qpos);
  for (int w = 0; w < 3; ++w) CHECK(std::abs(q(w, 0) - 0.1 * w) < 1e-12);
}

namespace {
/// How far the loop is open.
template <class Angles>
double opening(Angles const& q) {
  auto const at = [](double length, double a) { return gsp::Vec3<double>{length * std::cos(a), 0, length * std::sin(a)}; };
  return gsp::norm(at(0.1, q(0, 0)) + at(0.3, double(q(0, 0)) + q(0, 1)) - gsp::Vec3<double>{0.3, 0, 0} - at(0.25, q(0, 2)));
}
}  // namespace

// A four-bar whose loop is closed by an equality as stiff as the timestep allows (time
// constant 2 h), turned by a motor for 10 s at h = 2 ms. A gap that has settled has two parts. The force f holds it open by R f/(K d) =
// (1 - d)/d^2 (dw T)^2 diag f. And a step moves the points by h J v+ + h^2 J'v/2, while the law asks J v+ + h J'v for their rate: of what
// settles u = h J'v/2 is left, against which stands x = -B u/(K d) = 2 h^2 J'v dw/d. J'v: at most what the two points' centripetal
// accelerations are together. The sum of both at their greatest is the bound.
TEST_CASE_TEMPLATE("a stiff loop stays closed", Exec, GSP_TEST_EXECS) {
  auto const compiled = gsp_test::four_bar();
  Loop<double, Exec> s(compiled, 1);
  s.solver = converged;
  s.set(0, gsp_test::four_bar_closed(), {});
  s.push(0, {0.3, 0, 0});
  double worst = 0, most_force = 0, most_drift = 0, turned = 0;
  double const h = s.model.timestep;
  for (int t = 0; t < 1000; ++t) {
    s.step(5, equalities(s));
    auto const q = gsp_test::host(s.state.qpos);
    worst = std::fmax(worst, opening(q));
    auto const f = forces(s);
    most_force = std::fmax(most_force, std::sqrt(f(0, 0) * f(0, 0) + f(0, 2) * f(0, 2)));
    turned = q(0, 0);
    auto const v = gsp_test::host(s.state.qvel);
    double const w1 = v(0, 0), w2 = v(0, 0) + v(0, 1), w3 = v(0, 2);
    most_drift = std::fmax(most_drift, 0.1 * w1 * w1 + 0.3 * w2 * w2 + 0.25 * w3 * w3);
    REQUIRE(gsp_test::host(s.state.status)(0) == 0);
  }
  double const diag = compiled.body_invweight0[2][0] + compiled.body_invweight0[3][0];
  double const least = 0.9, held = (1 - least) / (least * least) * (most * 0.004) * (most * 0.004) * diag * most_force;
  double const bound = held + 2 * h * h * most_drift * most / least;
  MESSAGE("largest gap " << worst << " m, bound " << bound << " (" << held << " of " << most_force << " N); turned " << turned << " rad");
  CHECK(worst < bound);
  CHECK(worst < 1e-3);
  CHECK(turned > 20);
}

// The same loop, rigid, which swings under gravity for a minute, at up to 19 rad/s. A step takes back what is open, and the second order
// of what it opens; the third is left, h^3 times the change of J'v: points at rates w on arms l have J'v = l w^2 and its change about
// 3 l w^3, of which h^3 / 2 is left: at 1 ms 1/2 * 1e-9 * 3 * 0.3 * 19^3 = 3e-6. The bar of the project is 1e-6 m; measured 1.6e-7, in
// float 2.9e-7, and 1.3e-6 at 2 ms.
TEST_CASE_TEMPLATE("a rigid loop stays closed", R, float, double) {
  for (double const h : {0.001, 0.002}) {
    Loop<R, Kokkos::DefaultHostExecutionSpace> s(gsp_test::four_bar({.damping = 0, .rigid = true, .timestep = h}), 1);
    s.solver = {};
    s.set(0, gsp_test::four_bar_closed(), {});
    double worst = 0, fastest = 0;
    for (int t = 0; t < int(60 / h); ++t) {
      s.step(1, equalities(s));
      worst = std::fmax(worst, opening(s.state.qpos));
      for (int i = 0; i < 3; ++i) fastest = std::fmax(fastest, std::abs(double(s.state.qvel(0, i))));
    }
    CAPTURE(h);
    CHECK(fastest > 15);
    CHECK(worst < (h == 0.001 ? 1e-6 : 2e-6));
  }
}

// Rigid equalities of each kind that start open close by x / h within a step, and what that has opened in the next, and stay closed. A weld
// between two bodies that float is swept for, like all that joins two trees. In double, converged.
TEST_CASE_TEMPLATE("rigid equalities close at once", Exec, GSP_TEST_EXECS) {
  auto d = sliders(2, 2);
  d.equalities = {equality("gear", gsp::EqualityType::joint, "j0", "j1")};
  d.equalities[0].data = {0.01, 2, 3, 0, 0};
  d.equalities[0].rigid.hard = true;
  Loop<double, Exec> s(gsp::compile(d), 1);
  s.solver = converged;
  s.set(0, {0, 0}, {0, 0.4});
  s.push(0, {0, 1});
  double most = 0;
  for (int t = 0; t < 500; ++t) {
    s.step(1, equalities(s));
    auto const q = gsp_test::host(s.state.qpos);
    if (t > 2) most = std::fmax(most, std::abs(q(0, 0) - 0.01 - q(0, 1) * (2 + 3 * q(0, 1))));
  }
  // y'' = 6 v^2 and its change 12 v a, of which h^3 / 2 is left: v < 1, a < 1 m/s^2
  CHECK(most < 0.5 * 8e-9 * 12);

  gsp::Description two;
  two.bodies.push_back(box("a", {0, 0, 0}));
  two.bodies.push_back(box("b", {0.3, 0, 0}));
  two.equalities = {equality("glue", gsp::EqualityType::weld, "a", "b")};
  two.equalities[0].rigid.hard = true;
  Loop<double, Exec> w(gsp::compile(two), 1);
  w.solver = converged;
  auto q = gsp_test::host(w.state.qpos);
  q(0, 7) = 0.302;  // 2 mm open
  Kokkos::deep_copy(w.state.qpos, q);
  w.set(0, {}, {0, 0, 0, 1, 0, 0.5});
  for (int t = 0; t < 500; ++t) w.step(1, equalities(w));
  auto const end = gsp_test::host(w.state.qpos);
  gsp::Quat<double> const turn{end(0, 3), end(0, 4), end(0, 5), end(0, 6)}, other{end(0, 10), end(0, 11), end(0, 12), end(0, 13)};
  gsp::Vec3<double> const a{end(0, 0), end(0, 1), end(0, 2)}, b{end(0, 7), end(0, 8), end(0, 9)};
  CHECK(gsp::norm(gsp::rotate(turn, gsp::Vec3<double>{0.3, 0, 0}) - (b - a)) < 1e-6);
  gsp::Quat<double> const apart = gsp::conjugate(turn) * other;
  CHECK(std::sqrt(apart.x * apart.x + apart.y * apart.y + apart.z * apart.z) < 1e-6);
}

// Two rigid equalities that want x = 0 and x = 1: the second follows from the first and is left out; the body is neither thrown nor NaN.
TEST_CASE_TEMPLATE("rigid contradictions stay finite", Exec, GSP_TEST_EXECS) {
  auto d = sliders(1, 2);
  d.equalities = {equality("here", gsp::EqualityType::joint, "j0"), equality("there", gsp::EqualityType::joint, "j0")};
  d.equalities[1].data[0] = 1;
  for (auto& e : d.equalities) e.rigid.hard = true;
  gsp::Description far;
  far.bodies.push_back(box("b", {0, 0, 1}));
  for (double x : {-5., 5.}) {
    auto e = equality(x < 0 ? "left" : "right", gsp::EqualityType::connect, "b");
    e.rigid.hard = true;
    far.equalities.push_back(e);
  }
  auto impossible = gsp::compile(far);
  impossible.eq_data[0][3] = -5, impossible.eq_data[1][3] = 5;
  for (auto const& compiled : {gsp::compile(d), impossible}) {
    Loop<float, Exec> f(compiled, 1);
    f.solver = {.iterations = 100};
    f.step(500, equalities(f));
    auto const q = gsp_test::host(f.state.qpos), v = gsp_test::host(f.state.qvel);
    CHECK(gsp_test::host(f.state.status)(0) == 0);
    for (int i = 0; i < compiled.nq; ++i) CHECK(std::abs(q(0, i)) < 5.1f);
    for (int i = 0; i < compiled.nv; ++i) CHECK(std::abs(v(0, i)) < 1e3f * 9.81f * 0.002f);
  }
}

// What cannot be done: two equalities that want x = 0 and x = 1 meet half way (equal softness); one that joins what cannot move does
// nothing; both are said. A loop that is far too short stretches, and stays finite, in float, with the stiffest numbers.
TEST_CASE_TEMPLATE("contradictions stay finite and are said", Exec, GSP_TEST_EXECS) {
  auto d = sliders(1, 2);
  d.bodies[1].joints[0].damping = 20;
  d.equalities = {equality("here", gsp::EqualityType::joint, "j0"), equality("there", gsp::EqualityType::joint, "j0")};
  d.equalities[1].data[0] = 1;
  gsp::BodyDescription still;
  still.parent = 0, still.name = "still";
  d.bodies.push_back(still);
  d.equalities.push_back(equality("idle", gsp::EqualityType::connect, "still"));
  auto const compiled = gsp::compile(d);
  bool said = false, idle = false;
  for (auto const& line : compiled.report) {
    said |= line.text.find("'there' and 'here' ask different things") != std::string::npos;
    idle |= line.text.find("'idle' joins 'still' and the world, which do not move") != std::string::npos;
  }
  CHECK(said);
  CHECK(idle);
  Loop<double, Exec> s(compiled, 1);
  s.solver = converged;
  s.step(3000, equalities(s));
  CHECK(std::abs(gsp_test::host(s.state.qpos)(0, 0) - 0.5) < 1e-9);

  gsp::Description far;
  far.bodies.push_back(box("b", {0, 0, 1}));
  for (double x : {-5., 5.}) {
    auto e = equality(x < 0 ? "left" : "right", gsp::EqualityType::connect, "b");
    e.softness.solref = {1e-9, 1}, e.softness.solimp = {1, 1, 0, 0.5, 1};
    far.equalities.push_back(e);
  }
  auto impossible = gsp::compile(far);
  impossible.eq_data[0][3] = -5, impossible.eq_data[1][3] = 5;  // as relpose and a keyframe may ask for
  Loop<float, Exec> f(impossible, 1);
  f.solver = {.iterations = 100};
  f.step(500, equalities(f));
  auto const q = gsp_test::host(f.state.qpos);
  CHECK(gsp_test::host(f.state.status)(0) == 0);
  for (int i = 0; i < 7; ++i) CHECK(std::isfinite(q(0, i)));
  CHECK(std::abs(q(0, 0)) < 1e-3f);
}

// A body on an arm about a pin, described from its centre and from the pin: the same motion as h goes to 0. Before, what turned about the
// frame's origin was taken for what turns about the centre of mass: 9.18 rad/s and a gap of 6.5 mm, at any timestep.
TEST_CASE_TEMPLATE("a free body turns about its centre of mass, wherever its frame is", Exec, GSP_TEST_EXECS) {
  double const arm = 0.2, turn = 10, give = rest(2 * turn * turn * arm, 0.5);  // what the pin gives to m w^2 r
  for (double const h : {1e-3, 2e-4}) {
    double rate[2];
    for (int at_pin = 0; at_pin < 2; ++at_pin) {
      gsp::Description d;
      d.option.gravity = {0, 0, 0};
      d.option.timestep = h;
      auto b = box("b", {at_pin ? 0 : arm, 0, 0});
      b.inertial.pos = {at_pin ? arm : 0, 0, 0};
      d.bodies.push_back(b);
      d.equalities = {equality("pin", gsp::EqualityType::connect, "b")};
      d.equalities[0].data[0] = at_pin ? 0 : -arm;
      Loop<double, Exec> s(gsp::compile(d), 1);
      s.set(0, {}, {0, at_pin ? 0 : arm * turn, 0, 0, 0, turn});
      s.solver = converged;
      s.step(int(0.5 / h), equalities(s));
      auto const q = gsp_test::host(s.state.qpos), v = gsp_test::host(s.state.qvel);
      double const yaw = 2 * std::atan2(q(0, 6), q(0, 3)), to_pin = at_pin ? 0 : -arm;
      double const gap = std::hypot(q(0, 0) + to_pin * std::cos(yaw), q(0, 1) + to_pin * std::sin(yaw));
      rate[at_pin] = v(0, 5);
      MESSAGE(h << " s: gap " << gap << " m, give " << give << ", rate " << rate[at_pin] << " rad/s");
      CHECK(gap < 2 * give);
    }
    CHECK(std::abs(rate[0] - turn) < 4 * give / arm * turn);   // the moment about the pin stays: w r^2
    CHECK(std::abs(rate[1] - rate[0]) < 2 * h * turn * turn);  // schemes of first order
  }
}

TEST_CASE_TEMPLATE("equalities and tendons neither allocate nor wait; stale tendons are refused", Exec, GSP_TEST_EXECS) {
  auto d = sliders(2, 2);
  gsp::TendonDescription t;
  t.name = "t", t.terms = {{"j0", 1}, {"j1", -2}};
  d.tendons = {t};
  d.equalities = {equality("e", gsp::EqualityType::tendon, "t")};
  Loop<double, Exec> s(gsp::compile(d), 2);
  s.solver = converged;
  s.step(2, equalities(s));
  gsp_test::check_algorithm(s.exec, gsp_test::watch([&] { s.assemble(equalities(s)); }));
  s.solve({});
  gsp::integrate(s.exec, s.model, s.state, s.dynamics, s.progress, s.solution);
  CHECK_THROWS_AS(gsp::assemble(s.exec, s.model, s.state, s.dynamics, gsp::constraints(equalities(s)), s.rows, s.impulses, s.progress),
                  std::invalid_argument);
}
