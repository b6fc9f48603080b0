#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/constraint/joint_friction.hpp>
#include <gsp/constraint/joint_limit.hpp>
#include <gsp/constraint/tendon.hpp>
#include <gsp/dynamics/smooth.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/solver/impacts.hpp>
#include <gsp_test_execs.hpp>
#include <limits>
#include <random>

#include "constraint/loop.hpp"
#include "support/kokkos_tools.hpp"

using gsp_test::Loop;
using gsp_test::sliders;

// Types of a user's own: at namespace scope, as nvcc wants them.
namespace test_types {

/// Spring and damper on dof 0, with a cubic part.
template <class Mem>
struct Spring : gsp::OneFreeRow {
  double linear, cubic, damping;
  typename gsp::State<double, Mem>::template View<double**> qpos;
  KOKKOS_FUNCTION int count(int) const { return 1; }
  template <class T>
  KOKKOS_FUNCTION T lambda(int, int, int, T x, T u) const {
    return -(linear * x + cubic * x * x * x + damping * u);
  }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int world, int, int, Row&& J) const {
    J.set_dof(0, 1.);
    return qpos(world, 0);
  }
};

/// A force on dof 0 that no rate changes; of a rope that is taut where x > 0, none beside it.
template <class Mem>
struct Constant : gsp::OneFreeRow {
  double force, rope, most;
  typename gsp::State<double, Mem>::template View<double**> qpos;
  KOKKOS_FUNCTION int count(int) const { return 1; }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int, int, int) const { return {-most, most}; }
  template <class T>
  KOKKOS_FUNCTION T lambda(int, int, int, T x, T) const {
    return x > T(0) ? force - rope * x : T(force);
  }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int world, int, int, Row&& J) const {
    J.set_dof(0, 1.);
    return qpos(world, 0);
  }
};

/// Ties the dofs 0, 1 and (in odd worlds) 2 to a common velocity sum of zero.
struct Tie : gsp::OneFreeRow {
  KOKKOS_FUNCTION int count(int) const { return 1; }
  KOKKOS_FUNCTION gsp::RowLaw<float> law(int, int, int, float, float, float) const { return {0.f, 0.f}; }
  template <class Row>
  KOKKOS_FUNCTION float jacobian(int world, int, int, Row&& J) const {
    J.set_dof(0, 1.f), J.set_dof(1, 1.f);
    if (world % 2) J.set_dof(2, 1.f);
    return 0.f;
  }
};

/// Names a dof (odd worlds) or a body (every third) that the model does not have.
struct Nowhere : gsp::OneFreeRow {
  KOKKOS_FUNCTION int count(int) const { return 1; }
  KOKKOS_FUNCTION gsp::RowLaw<float> law(int, int, int, float, float, float) const { return {0.f, 0.f}; }
  template <class Row>
  KOKKOS_FUNCTION float jacobian(int world, int, int, Row&& J) const {
    J.set_dof(world % 2 ? 3 : 0, 1.f);
    if (world % 3 == 0) J.add_point(world == 0 ? 999 : -1, {0.f, 0.f, 0.f}, {1.f, 0.f, 0.f});
    return 0.f;
  }
};

/// 70,000 soft rows on dof 0.
struct Many : gsp::OneFreeRow {
  KOKKOS_FUNCTION int count(int) const { return 70000; }
  KOKKOS_FUNCTION gsp::RowLaw<float> law(int, int, int, float, float, float) const { return {1e6f, 0.f}; }
  template <class Row>
  KOKKOS_FUNCTION float jacobian(int, int, int, Row&& J) const {
    J.set_dof(0, 1.f);
    return 0.f;
  }
};

/// Element k pushes dof `dof(k)` to the velocity dof(k) + 1; its identity is the dof. Elements come and go as the list changes.
template <class Mem>
struct Movers {
  Kokkos::View<int*, Mem> dof;
  int n;
  bool minor;  // identity in the minor part, which need not be sorted
  KOKKOS_FUNCTION int count(int) const { return n; }
  KOKKOS_FUNCTION int rows(int, int) const { return 2; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int k, int row, Row&& J) const {
    J.set_dof(dof(k), row + 1.);
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<double> law(int, int k, int row, double, double, double) const { return {0.1 + row, dof(k) + 1.}; }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int, int, int) const { return {-1e9, 1e9}; }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const {
    return minor ? gsp::RowId{0, std::uint32_t(dof(k))} : gsp::RowId{std::uint32_t(dof(k)), 0};
  }
};

/// One element, which is known after prepare.
template <class Mem>
struct Prepared : gsp::OneFreeRow {
  Kokkos::View<int*, Mem> found;
  template <class World>
  KOKKOS_FUNCTION void prepare(World const& world) const {
    world.single([&] { found(world.rank) = 1; });
  }
  KOKKOS_FUNCTION int count(int world) const { return found(world); }
  KOKKOS_FUNCTION gsp::RowLaw<float> law(int, int, int, float, float, float) const { return {0.5f, 0.f}; }
  template <class Row>
  KOKKOS_FUNCTION float jacobian(int, int, int, Row&& J) const {
    J.set_dof(0, 1.f);
    return 0.f;
  }
};

/// Forces and moments on one body or two, of one tree or two, and rates of dofs: entries of every kind.
template <class R, class Mem>
struct Pulls : gsp::OneFreeRow {
  gsp::Model<R, Mem> model;
  KOKKOS_FUNCTION int count(int) const { return 40; }
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int, int, int, R x, R u, R) const { return {R(1), x + R(2) * u}; }
  KOKKOS_FUNCTION int pick(int world, int k, int i, int n) const { return int(0.5 * (gsp_test::hashed(world, k, 7, i) + 1) * n) % n; }
  KOKKOS_FUNCTION gsp::Vec3<R> vector(int world, int k, int i) const {
    return {R(gsp_test::hashed(world, k, 1, i)), R(gsp_test::hashed(world, k, 2, i)), R(gsp_test::hashed(world, k, 3, i))};
  }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    int const a = 1 + pick(world, k, 0, model.nbody - 1), b = 1 + pick(world, k, 1, model.nbody - 1);
    int const tree = model.dof_tree(model.body_last_dof(a)), nv = model.archetypes(model.tree_archetype(tree)).nv;
    if (k % 4 < 2) J.add_point(a, vector(world, k, 0), vector(world, k, 1));
    if (k % 4 == 1) J.add_point(b, vector(world, k, 0), vector(world, k, 1), R(-0.75));
    if (k % 4 == 2) J.add_rotation(a, vector(world, k, 2), R(2));
    for (int i = 0; i < (k % 4 == 3 ? 3 : k % 8 == 2 ? 1 : 0); ++i)
      J.set_dof(model.tree_dof(tree) + pick(world, k, 2 + i, nv), R(gsp_test::hashed(world, k, 4, i)));
    return R(gsp_test::hashed(world, k, 5, 0));
  }
};

/// World 2 has so many elements, so many rows each.
struct WrongSize : gsp::OneFreeRow {
  int elements, rows_each;
  KOKKOS_FUNCTION int count(int world) const { return world == 2 ? elements : 1; }
  KOKKOS_FUNCTION int rows(int world, int) const { return world == 2 ? rows_each : 1; }
  KOKKOS_FUNCTION gsp::RowLaw<float> law(int, int, int, float, float, float) const { return {0.5f, 0.f}; }
  template <class Row>
  KOKKOS_FUNCTION float jacobian(int, int, int, Row&& J) const {
    J.set_dof(0, 1.f);
    return 0.f;
  }
};
}  // namespace test_types

namespace {
/// MuJoCo's documentation, "Solver parameters": impedance d(r) for power 2 and midpoint 1/2, stiffness and damping of aref = -b u - k d r,
/// R = (1 - d)/d diag.
struct Soft {
  double imp, K, B;
  explicit Soft(double r, gsp::SoftnessDescription const& s = {}) {
    double const y = std::fmin(std::abs(r) / s.solimp[2], 1), f = y < 0.5 ? 2 * y * y : 1 - 2 * (1 - y) * (1 - y);
    imp = s.solimp[0] + f * (s.solimp[1] - s.solimp[0]);
    K = 1 / std::pow(s.solimp[1] * s.solref[0] * s.solref[1], 2), B = 2 / (s.solimp[1] * s.solref[0]);
  }
  double R(double diag) const { return (1 - imp) / imp * diag; }
};
/// The violation r < 0 at which a soft limit at rest carries the force f: R f = -K d r.
double rest(double f, double diag) {
  double low = -1, high = 0;
  for (int i = 0; i < 200; ++i) {
    double const r = (low + high) / 2;
    Soft const s(r);
    (-s.K * s.imp * r > s.R(diag) * f ? low : high) = r;
  }
  return low;
}
}  // namespace

// At rest at a limit: upper end, lower end, and with a margin, in both profiles; in profile stable also where the time constant of 20 ms is
// less than two timesteps. Convergence: damping 20 over 2 kg for 4 s leaves e^-40; double.
TEST_CASE_TEMPLATE("a joint rests at its soft limit where MuJoCo's law says", Exec, GSP_TEST_EXECS) {
  double const force = 3;
  for (double margin : {0., 0.01})
    for (auto const& [profile, h] : {std::pair{gsp::Profile::stable, 0.002}, {gsp::Profile::mujoco, 0.002}, {gsp::Profile::stable, 0.02}}) {
      CAPTURE(h);
      auto d = sliders(2, 2);
      d.option.timestep = h;
      for (auto& b : d.bodies)
        if (!b.joints.empty())
          b.joints[0].limited = true, b.joints[0].range = {-0.1, 0.2}, b.joints[0].margin = margin, b.joints[0].damping = 20;
      Loop<double, Exec> s(gsp::compile(d), 2, {.profile = profile});
      s.push(1, {force, -force});
      s.step(2000, gsp::JointLimits(s.model, s.state));
      auto const q = gsp_test::host(s.state.qpos);
      double const r = rest(force, 0.5);
      CHECK(std::abs(0.2 - q(1, 0) - margin - r) < 1e-10);
      CHECK(std::abs(q(1, 1) + 0.1 - margin - r) < 1e-10);
      CHECK(q(0, 0) == 0);
    }
}

// One step of one soft row: p = max(0, (zeta - u^) / (1/m + R)), zeta = u + h aref.
// MuJoCo's solimp in numbers of 80 bits; a power of n enlarges the rounding of its base n times.
TEST_CASE("impedance of high powers is finite in float") {
  for (float mid : {1e-4f, 0.1f, 0.5f, 0.9999f})
    for (float power : {1.f, 2.f, 14.f, 40.f, 300.f})
      for (float r : {0.f, 1e-5f, 0.05f, 0.3f, 0.7f, 0.9999f, 1.f}) {
        gsp::Softness<float> const s{{0.02f, 1}, {0.5f, 0.95f, 1, mid, power}};
        long double const m = mid, x = r, y = r <= mid ? m * std::pow(x / m, power) : 1 - (1 - m) * std::pow((1 - x) / (1 - m), power);
        CAPTURE(mid);
        CAPTURE(power);
        CAPTURE(r);
        CHECK(gsp::impedance_of(s, r) == doctest::Approx(double(0.5L + 0.45L * y)).epsilon(4 * (power + 4) * 6e-8));
      }
}

TEST_CASE_TEMPLATE("one step into a limit", Exec, GSP_TEST_EXECS) {
  auto d = sliders(1, 2);
  d.bodies[1].joints[0].limited = true, d.bodies[1].joints[0].range = {-1, 0.2};
  Loop<double, Exec> s(gsp::compile(d), 40);
  double const h = 0.002, force = -7;
  for (int w = 0; w < 40; ++w) s.set(w, {0.1999 + 0.0001 * w}, {-0.3 + 0.02 * w}), s.push(w, {force});
  auto const q = gsp_test::snapshot(s.state.qpos), v = gsp_test::snapshot(s.state.qvel);
  s.step(1, gsp::JointLimits(s.model, s.state));
  auto const v2 = gsp_test::host(s.state.qvel);
  int active = 0;
  for (int w = 0; w < 40; ++w) {
    double const x = 0.2 - q(w, 0), u = -v(w, 0), free = u - h * force / 2;
    Soft const soft(x);
    double const p = x < 0 ? std::fmax(0, (u + h * (-soft.B * u - soft.K * soft.imp * x) - free) / (0.5 + soft.R(0.5))) : 0;
    active += p > 0;
    CHECK(std::abs(-v2(w, 0) - (free + p / 2)) < 1e-14);
  }
  CHECK(active > 10);
  CHECK(active < 40);
}

// Impedances below a half with time constants below two timesteps: what is pressed against its limit comes to rest, as in profile mujoco.
// (Where compliance alone shrank each step turned the rate round and enlarged it: 7e9 m/s.)
TEST_CASE_TEMPLATE("weak limits with short time constants come to rest", Exec, GSP_TEST_EXECS) {
  for (double const impedance : {0.02, 0.1, 0.5, 0.9})
    for (double const share : {0.01, 0.1, 0.5, 1.}) {
      auto d = sliders(1, 2);
      auto& joint = d.bodies[1].joints[0];
      joint.limited = true, joint.range = {-1, 0.2}, joint.damping = 5;
      joint.limit.solref = {share * 2 * d.option.timestep, 1}, joint.limit.solimp = {impedance, impedance, 0.001, 0.5, 2};
      Loop<double, Exec> s(gsp::compile(d), 1);
      s.set(0, {0.19}, {0.3});
      s.push(0, {3});
      s.step(3000, gsp::JointLimits(s.model, s.state));
      CAPTURE(impedance);
      CAPTURE(share);
      CHECK(std::abs(gsp_test::host(s.state.qvel)(0, 0)) < 1e-6);
      CHECK(gsp_test::host(s.state.qpos)(0, 0) < 0.21);
    }
}

// Rigid limits of a slide and of a fixed tendon, in profile stable: what comes at v stops at the end or, with a restitution, comes back
// with e times what it had (no force acts); what is pushed against the end rests there, where a soft one gives. The end is not overstepped.
TEST_CASE_TEMPLATE("rigid limits stop and bounce", Exec, GSP_TEST_EXECS) {
  for (bool const tendon : {false, true})
    for (double const e : {0., 0.5, 1.}) {
      auto d = sliders(1, 2);
      gsp::RigidDescription const rigid{.hard = true, .restitution = e, .erp = 0.2};
      if (tendon) {
        d.tendons.emplace_back();
        d.tendons[0].terms = {{"j0", 2.}};
        d.tendons[0].limited = true, d.tendons[0].range = {-2, 0.4}, d.tendons[0].rigid_limit = rigid;
      } else {
        d.bodies[1].joints[0].limited = true, d.bodies[1].joints[0].range = {-1, 0.2}, d.bodies[1].joints[0].rigid_limit = rigid;
      }
      Loop<double, Exec> s(gsp::compile(d), 1);
      s.forget({.impacts = true});
      CHECK(s.model.limits_bounce == (e > 0));
      auto const limits = [&](int n) {
        for (int i = 0; i < n; ++i) {
          s.assemble(gsp::JointLimits(s.model, s.state), gsp::TendonLimits(s.model, s.dynamics));
          gsp::impacts(s.exec, s.progress, s.rows, s.impulses, s.solution);
          s.finish();
        }
      };
      double const v = 0.6;
      s.set(0, {0.15}, {v});
      limits(100);
      auto const q = gsp_test::host(s.state.qpos), u = gsp_test::host(s.state.qvel);
      CAPTURE(tendon);
      CAPTURE(e);
      CHECK(std::abs(u(0, 0) + e * v) < 1e-12);
      if (e == 0) CHECK(std::abs(q(0, 0) - 0.2) < 1e-12);
      s.set(0, {0.1999}, {0});
      s.push(0, {50});
      limits(2000);
      auto const end = gsp_test::host(s.state.qpos);
      CHECK(std::abs(end(0, 0) - 0.2) < (e == 1 ? 1.1e-4 : 1e-9));  // with e = 1 it falls and comes back for ever
    }
  auto d = sliders(1, 2);
  auto& joint = d.bodies[1].joints[0];
  joint.limited = true, joint.range = {-1, 0.2}, joint.rigid_limit = {.hard = true, .erp = 2};
  CHECK_THROWS_WITH_AS(gsp::compile(d), doctest::Contains("erp that is not between 0 and 1"), gsp::Error);
  joint.rigid_limit = {.hard = true, .restitution = -1};
  CHECK_THROWS_WITH_AS(gsp::compile(d), doctest::Contains("restitution that is not between 0 and 1"), gsp::Error);
}

// A ball joint at its limit is pushed back about its own rotation axis: for an isotropic body the change of velocity is parallel to it, and
// the new rate is u+ = zeta - R p with the change itself as p / I.
TEST_CASE_TEMPLATE("limit of a ball joint", Exec, GSP_TEST_EXECS) {
  auto d = sliders(1, 2);
  auto& j = d.bodies[1].joints[0];
  j.type = gsp::JointType::ball, j.limited = true, j.range = {0, 0.8};
  double const I = 0.1, angle = 0.9, h = 0.002;
  Loop<double, Exec> s(gsp::compile(d), 3);
  double const axis[3] = {2. / 3, -1. / 3, 2. / 3}, v[3] = {0.3, -0.2, 0.5}, sine = std::sin(angle / 2);
  s.set(2, {-std::cos(angle / 2), -sine * axis[0], -sine * axis[1], -sine * axis[2]},
        {v[0], v[1], v[2]});  // the other sign of the quaternion is the same rotation
  s.step(1, gsp::JointLimits(s.model, s.state));
  auto const v2 = gsp_test::host(s.state.qvel);
  double u = 0, after = 0;
  for (int k = 0; k < 3; ++k) u -= axis[k] * v[k], after -= axis[k] * v2(2, k);
  Soft const soft(0.8 - angle);
  double const p = (h * (-soft.B * u - soft.K * soft.imp * (0.8 - angle))) / (1 / I + soft.R(1 / I));
  for (int k = 0; k < 3; ++k) CHECK(std::abs(v2(2, k) - (v[k] - axis[k] * p / I)) < 1e-13);
  CHECK(after > u);
}

// Friction loss F: below F a joint sticks exactly (stable) or creeps at v = R f / B (mujoco); above it slips with (f - F) / m; a moving
// joint is stopped.
TEST_CASE_TEMPLATE("dry friction sticks and slips at its force", Exec, GSP_TEST_EXECS) {
  double const F = 5, m = 2, h = 0.002;
  auto d = sliders(1, m);
  d.bodies[1].joints[0].frictionloss = F;
  auto const c = gsp::compile(d);
  for (auto profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    Loop<double, Exec> s(c, 4, {.profile = profile});
    s.push(0, {0.99 * F}), s.push(1, {-1.01 * F}), s.push(3, {2 * F});
    s.set(2, {0}, {1});
    int const n = 500;  // 1 s; world 2 stops after m v / F = 0.4 s
    s.step(n, gsp::JointFriction(s.model));
    auto const v = gsp_test::host(s.state.qvel), q = gsp_test::host(s.state.qpos);
    Soft const soft(0);
    double const creep = profile == gsp::Profile::stable ? 0 : soft.R(1 / m) * 0.99 * F / soft.B;
    CHECK(std::abs(v(0, 0) - creep) < 1e-12);
    if (profile == gsp::Profile::stable) {
      CHECK(std::abs(v(1, 0) + n * h * 0.01 * F / m) < 1e-12);
      CHECK(std::abs(q(2, 0) - (m / (2 * F) - h / 2)) < 1e-12);  // v^2 m / 2 F less half a step's way
    }
    CHECK(std::abs(v(2, 0)) < 1e-12);
    CHECK(std::abs(v(3, 0) - n * h * F / m) < 1e-12 + (profile == gsp::Profile::mujoco ? 0.02 : 0.));  // mujoco: less than F until it slips
  }
}

// A tendon over two slides of one tree: length q0 - 2 q1. J M^-1 J^T with both on one body: x and y slides.
TEST_CASE_TEMPLATE("tendon: limit and dry friction", Exec, GSP_TEST_EXECS) {
  double const m = 2, force = 3, diag = (1 + 4) / m;
  auto d = sliders(1, m);
  auto second = d.bodies[1].joints[0];
  second.name = "second", second.axis = {0, 1, 0};
  d.bodies[1].joints.push_back(second);
  gsp::TendonDescription t;
  t.name = "t", t.terms = {{"j0", 1}, {"second", -2}};
  SUBCASE("limit") {
    for (auto& j : d.bodies[1].joints) j.damping = 20;
    t.limited = true, t.range = {-0.1, 0.3};
    d.tendons = {t};
    Loop<double, Exec> s(gsp::compile(d), 2);
    for (int w = 0; w < 2; ++w) s.push(w, {w ? -force : force, w ? 2 * force : -2 * force});
    s.step(3000, gsp::TendonLimits(s.model, s.dynamics));
    auto const q = gsp_test::host(s.state.qpos);
    CHECK(std::abs(0.3 - (q(0, 0) - 2 * q(0, 1)) - rest(force, diag)) < 1e-10);
    CHECK(std::abs(q(1, 0) - 2 * q(1, 1) + 0.1 - rest(force, diag)) < 1e-10);
  }
  SUBCASE("dry friction") {
    t.frictionloss = force;
    d.tendons = {t};
    Loop<double, Exec> s(gsp::compile(d), 3);
    s.push(0, {0.99 * force, -1.98 * force}), s.push(1, {1.5 * force, -3 * force}),
        s.push(2, {2, 1});  // 2: across the tendon, which does not resist
    s.step(100, gsp::TendonFriction(s.model, s.dynamics));
    auto const v = gsp_test::host(s.state.qvel);
    CHECK(std::abs(v(0, 0)) < 1e-12);
    CHECK(std::abs(v(0, 1)) < 1e-12);
    CHECK(std::abs(v(1, 0) - 0.2 * 0.5 * force / m) < 1e-12);
    CHECK(std::abs(v(2, 0) - 0.2 * 2 / m) < 1e-12);
    CHECK(std::abs(v(2, 1) - 0.2 * 1 / m) < 1e-12);
  }
}

// A law on dual numbers. Linear: the implicit Euler step m (v+ - v) = h (f - k (x + h v+) - d v+). Cubic: linear at the predicted gap x + h
// v.
TEST_CASE_TEMPLATE("a spring as a law gives the implicit Euler step", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  double const m = 2, h = 0.002, f = 11;
  Loop<double, Exec> s(gsp::compile(sliders(1, m)), 17);
  for (auto [k, c, d] : {std::array{900., 0., 12.}, std::array{1e8, 0., 0.}, std::array{50., 4000., 3.}}) {
    for (int w = 0; w < 17; ++w) s.set(w, {0.1 * w - 0.7}, {1 - 0.2 * w}), s.push(w, {f});
    auto const q = gsp_test::snapshot(s.state.qpos), v = gsp_test::snapshot(s.state.qvel);
    s.step(1, test_types::Spring<Mem>{{}, k, c, d, s.state.qpos});
    auto const v2 = gsp_test::host(s.state.qvel);
    for (int w = 0; w < 17; ++w) {
      double const x = q(w, 0), u = v(w, 0), at = x + h * u, force = -(k * at + c * at * at * at + d * u), slope = -(k + 3 * c * at * at);
      // m (v+ - u) = h (f + force + slope h (v+ - u) - d (v+ - u))
      double const expected = u + h * (f + force) / (m + h * d - h * h * slope);
      CHECK(std::abs(v2(w, 0) - expected) < 1e-13 * (1 + std::abs(h * force / m)));
    }
  }
}

// A law without a slope is a force: m (v+ - v) = h (f + lambda), within the bounds of its impulse; where it has one, the implicit
// step. Rates of 10, impulses of 0.1: 1e-13.
TEST_CASE_TEMPLATE("a law that no rate changes is a force", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  double const m = 2, h = 0.002, f = 11, k = 900;
  Loop<double, Exec> s(gsp::compile(sliders(1, m)), 17);
  for (auto [force, rope, most] :
       {std::array{0., k, 1e300}, std::array{5., 0., 1e300}, std::array{-7e6, 0., 1e300}, std::array{5., 0., 0.004}}) {
    for (int w = 0; w < 17; ++w) s.set(w, {0.1 * w - 0.75}, {1 - 0.2 * w}), s.push(w, {f});
    auto const q = gsp_test::snapshot(s.state.qpos), v = gsp_test::snapshot(s.state.qvel);
    s.solver.residual = true;
    s.step(1, test_types::Constant<Mem>{{}, force, rope, most, s.state.qpos});
    auto const v2 = gsp_test::host(s.state.qvel);
    for (int w = 0; w < 17; ++w) {
      double const x = q(w, 0), u = v(w, 0), at = x + h * u, slope = at > 0 ? rope : 0;
      double const push = std::clamp(h * (force - slope * at), -most, most) / h;
      CHECK(gsp_test::host(s.state.status)(w) == 0);
      CHECK(std::abs(v2(w, 0) - u - h * (f + push) / (m + h * h * slope)) < 1e-13 * (1 + std::abs(h * push / m)));
      CHECK(gsp_test::host(s.solution.residual)(w) < 1e-12);
    }
  }
}

// A stage that a loop of one's own leaves out is told.
TEST_CASE_TEMPLATE("a solution that nobody has made for this state is refused", Exec, GSP_TEST_EXECS) {
  Loop<float, Exec> s(gsp::compile(sliders(3, 1)), 3);
  auto const integrate = [&] { gsp::integrate(s.exec, s.model, s.state, s.dynamics, s.progress, s.solution); };
  auto const smooth = [&] { gsp::smooth_dynamics(s.exec, s.model, s.state, s.poses, s.dynamics); };
  smooth();
  CHECK_THROWS_WITH_AS(integrate(), doctest::Contains("the impulses of the solution have not been written: call assemble and pgs"),
                       std::invalid_argument);
  s.assemble(test_types::Tie{});
  CHECK_THROWS_AS(integrate(), std::invalid_argument);
  s.solve(s.solver);
  integrate();
  smooth();
  CHECK_THROWS_WITH_AS(integrate(), doctest::Contains("are of the state before its last step"), std::invalid_argument);
  gsp::integrate(s.exec, s.model, s.state, s.dynamics);  // without constraints
  // rows of one's own, without a stamp
  auto const stamp = s.rows.stamp;
  s.rows.stamp = {};
  smooth();
  s.solve(s.solver);
  integrate();
  s.rows.stamp = stamp;
  s.forget({.worlds = 3});
  s.rows.stamp = {};  // none, of one's own
  smooth();
  s.solve(s.solver);
  integrate();
  CHECK(gsp_test::host(s.state.steps)(2) == 4);
}

// A row over three trees is refused: that world stays, and says why; the others (two trees) are solved.
TEST_CASE_TEMPLATE("a row of three trees is refused, its world alone stays", Exec, GSP_TEST_EXECS) {
  Loop<float, Exec> s(gsp::compile(sliders(3, 2)), 6);
  for (int w = 0; w < 6; ++w) s.set(w, {0, 0, 0}, {1, 2, 3});
  s.step(3, test_types::Tie{});
  auto const v = gsp_test::host(s.state.qvel), q = gsp_test::host(s.state.qpos);
  auto const status = gsp_test::host(s.state.status);
  auto const steps = gsp_test::host(s.state.steps);
  for (int w = 0; w < 6; ++w) {
    bool const refused = w % 2;
    CHECK(status(w) == (refused ? gsp::status::row_refused | gsp::status::refused_place : 0u));
    CHECK(steps(w) == (refused ? 0 : 3));
    if (refused) {
      for (int i = 0; i < 3; ++i) {
        CHECK(q(w, i) == 0);
        CHECK(v(w, i) == i + 1);
      }
    } else {
      CHECK(std::abs(v(w, 0) + 0.5f) < 1e-6f);
      CHECK(std::abs(v(w, 1) - 0.5f) < 1e-6f);
      CHECK(v(w, 2) == 3);
    }
  }
  CHECK(gsp::status::text(gsp::status::row_refused | gsp::status::refused_place).find("two kinematic trees") != std::string::npos);
}

TEST_CASE_TEMPLATE("a row about a body or dof that is not there is refused, and its world stays", Exec, GSP_TEST_EXECS) {
  Loop<float, Exec> s(gsp::compile(sliders(3, 1)), 6);
  for (int w = 0; w < 6; ++w) s.set(w, {0, 0, 0}, {1, 2, 3});
  s.step(2, test_types::Nowhere{});
  auto const status = gsp_test::host(s.state.status);
  auto const steps = gsp_test::host(s.state.steps);
  for (int w = 0; w < 6; ++w) {
    bool const refused = w % 2 || w % 3 == 0;
    CHECK(status(w) == (refused ? gsp::status::row_refused | gsp::status::refused_place : 0u));
    CHECK(steps(w) == (refused ? 0 : 2));
  }
}

// What is counted below zero would take elements of another type away, and room is made for the largest element that there is.
TEST_CASE_TEMPLATE("fewer elements or rows than none, and too many rows, are refused, and the world stays", Exec, GSP_TEST_EXECS) {
  Kokkos::View<int*, typename Exec::memory_space> const found("found", 4);
  for (auto const& [elements, rows_each] : std::vector<std::pair<int, int>>{{-1, 1}, {1, -1}, {1, 7}, {1, 100000}}) {
    CAPTURE(elements);
    CAPTURE(rows_each);
    Loop<float, Exec> s(gsp::compile(sliders(3, 1)), 4);
    for (int w = 0; w < 4; ++w) s.set(w, {0, 0, 0}, {1, 2, 3});
    s.step(2, test_types::WrongSize{{}, elements, rows_each}, test_types::Prepared<typename Exec::memory_space>{{}, found});
    auto const status = gsp_test::host(s.state.status);
    auto const steps = gsp_test::host(s.state.steps);
    for (int w = 0; w < 4; ++w) {
      bool const refused = w == 2;
      CHECK(status(w) == (refused ? gsp::status::row_refused | gsp::status::refused_size : 0u));
      CHECK(steps(w) == (refused ? 0 : 2));
      CHECK(gsp_test::host(s.rows.largest_element)(w) == 3);
    }
  }
}
TEST_CASE_TEMPLATE("what prepare counts is asked for after it", Exec, GSP_TEST_EXECS) {
  Loop<float, Exec> s(gsp::compile(sliders(3, 1)), 2);
  Kokkos::View<int*, typename Exec::memory_space> const found("found", 2);
  Kokkos::deep_copy(found, -1);
  s.step(1, test_types::Prepared<typename Exec::memory_space>{{}, found});
  CHECK(gsp_test::host(s.state.status)(1) == 0);
  CHECK(gsp_test::host(s.rows.count)(1) == 1);
}

// A heap of 1,000 boxes has 120,000 rows in one world.
TEST_CASE("a world may have more than 65,536 rows") {
  Loop<float, Kokkos::DefaultHostExecutionSpace> s(gsp::compile(sliders(1, 2)), 2);
  s.solver.iterations = 1;
  s.assemble(test_types::Many{});
  s.finish();
  CHECK(!(s.state.status(0) & gsp::status::row_refused));
  s.step(1, test_types::Many{});
  CHECK(s.rows.count(1) == 70000);
  CHECK(s.state.status(0) == 0);
}

// Warm starts go by identity: after the order of elements, and which of them there are, have changed, every row finds its own last impulse,
// new ones none.
TEST_CASE_TEMPLATE("impulses are found again after the order of elements changes", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  for (bool minor : {false, true}) {
    int const worlds = 3;
    Loop<double, Exec> s(gsp::compile(sliders(6, 2)), worlds);
    test_types::Movers<Mem> movers{Kokkos::View<int*, Mem>("dof", 6), 0, minor};
    auto const list = [&](std::vector<int> const& dofs) {
      movers.n = int(dofs.size());
      auto const h = Kokkos::create_mirror_view(movers.dof);
      for (int i = 0; i < movers.n; ++i) h(i) = dofs[i];
      Kokkos::deep_copy(movers.dof, h);
    };
    std::vector<int> const before = minor ? std::vector{4, 1, 3, 0} : std::vector{0, 1, 3, 4},
                           after = minor ? std::vector{3, 5, 0, 4, 2} : std::vector{0, 2, 3, 4, 5};
    std::vector<double> last(2 * 6, 0.);
    list(before);
    s.step(1, movers);
    int const parity = gsp_test::host(s.impulses.parity)();
    auto const p = gsp_test::snapshot(s.impulses.p[parity]);
    auto const first = gsp_test::snapshot(s.rows.first);
    for (std::size_t k = 0; k < before.size(); ++k)
      for (int r = 0; r < 2; ++r) last[2 * before[k] + r] = p(first(1) + 2 * k + r);
    for (int dof : before) CHECK(last[2 * dof] != 0);
    list(after);
    s.assemble(movers);
    REQUIRE(gsp_test::host(s.impulses.parity)() != parity);
    auto const start = gsp_test::host(s.impulses.p[1 - parity]);
    auto const now = gsp_test::host(s.rows.first);
    for (int w = 0; w < worlds; ++w)
      for (std::size_t k = 0; k < after.size(); ++k)
        for (int r = 0; r < 2; ++r) CHECK(start(now(w) + 2 * k + r) == last[2 * after[k] + r]);
  }
}

// A type is known by itself, not by its place: after others have come, gone and changed places, each finds its own impulses.
TEST_CASE_TEMPLATE("impulses are found again after the list of types changes", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Loop<double, Exec> s(gsp::compile(sliders(6, 2)), 2);
  for (int w = 0; w < 2; ++w) s.set(w, {0.1, 0.2, 0.3, 0.4, 0.5, 0.6}, {});
  test_types::Movers<Mem> movers{Kokkos::View<int*, Mem>("dof", 6), 2, false};
  auto const h = Kokkos::create_mirror_view(movers.dof);
  for (int i = 0; i < 6; ++i) h(i) = i + 2;
  Kokkos::deep_copy(movers.dof, h);
  test_types::Spring<Mem> const spring{{}, 900., 0., 12., s.state.qpos}, other{{}, 300., 0., 2., s.state.qpos};
  auto const read = [&](int count) {      // world 1: so many springs, then the rows of the movers
    gsp::set_solved(s.rows, s.impulses);  // what a solver starts from is read as if it were a solution
    std::vector<double> values;
    Kokkos::View<double[6], Mem> const out("out");
    auto const springs = gsp::impulses_of<test_types::Spring<Mem>>(s.rows, s.impulses);
    auto const second = gsp::impulses_of<test_types::Spring<Mem>>(s.rows, s.impulses, count - 1);
    auto const moved = gsp::impulses_of<test_types::Movers<Mem>>(s.rows, s.impulses);
    Kokkos::parallel_for(
        "gsp::test::read", Kokkos::RangePolicy<Exec>(s.exec, 0, 6), KOKKOS_LAMBDA(int i) {
          out(i) = i == 0 ? springs(1, 0) : i == 1 ? (count > 1 ? second(1, 0) : 0.) : moved(1, (i - 2) / 2, i % 2);
        });
    auto const on_host = gsp_test::host(out);
    for (int i = 0; i < 6; ++i) values.push_back(on_host(i));
    return values;
  };
  s.step(1, spring, movers, other);
  auto const before = read(2);
  for (double p : before) CHECK(p != 0);
  s.assemble(movers, spring);
  CHECK(read(1) == std::vector<double>{before[0], 0, before[2], before[3], before[4], before[5]});
  s.assemble(movers, spring, other);  // not solved for in between: the impulses of the step before
  CHECK(read(2) == before);
}

// Pools that are too small: nothing moves until they have grown; then the result has the bits of a run with room from the start.
TEST_CASE_TEMPLATE("a capacity does not change a result", Exec, GSP_TEST_EXECS) {
  auto d = gsp_test::random_model({gsp::JointType::free, gsp::JointType::hinge}, 6);
  for (auto& b : d.bodies)
    for (auto& j : b.joints)
      if (j.type != gsp::JointType::free) j.frictionloss = 0.3, j.limited = j.type != gsp::JointType::ball, j.range = {-0.3, 0.3};
  auto const c = gsp::compile(d);
  Loop<float, Exec> a(c, 5), b(c, 5);
  b.forget({.worlds = 5, .rows_per_world = 1, .entries_per_world = 1});
  for (auto* s : {&a, &b}) gsp_test::randomise(c, s->state);
  auto const q = gsp_test::snapshot(b.state.qpos);
  b.assemble(gsp::JointFriction(b.model), gsp::JointLimits(b.model, b.state));
  CHECK((gsp_test::host(b.state.status)(4) & gsp::status::row_overflow) != 0);
  CHECK(b.finish());
  auto const still = gsp_test::host(b.state.qpos);
  CHECK(std::memcmp(still.data(), q.data(), q.size() * sizeof(float)) == 0);
  for (auto* s : {&a, &b}) s->step(20, gsp::JointFriction(s->model), gsp::JointLimits(s->model, s->state));
  auto const qa = gsp_test::host(a.state.qpos), qb = gsp_test::host(b.state.qpos);
  CHECK(std::memcmp(qa.data(), qb.data(), qa.size() * sizeof(float)) == 0);
  CHECK(gsp_test::host(b.state.status)(4) == 0);
  CHECK(gsp_test::host(b.state.steps)(4) == 20);
}

TEST_CASE_TEMPLATE("assemble and pgs neither allocate nor fence", Exec, GSP_TEST_EXECS) {
  auto d = sliders(2, 2);
  d.bodies[1].joints[0].frictionloss = 1;
  Loop<float, Exec> s(gsp::compile(d), 4, {}, gsp_test::other_instance(Exec{}));
  s.step(2, gsp::JointFriction(s.model));
  gsp_test::check_algorithm(s.exec, gsp_test::watch([&] { s.assemble(gsp::JointFriction(s.model)), s.solve({}); }));
}

// A row in doubles, from the numbers that the dynamics hold in whatever precision: J and its whitening by substitution. Beside each number
// the sum of the sizes of its terms, which rounding is measured by.
template <class R, class Mem>
struct WhitenedRow {
  using Numbers = std::vector<double>;
  gsp::Model<double, Kokkos::HostSpace> const& model;
  Kokkos::View<R*, Kokkos::HostSpace> items;
  Kokkos::View<std::int64_t*, Kokkos::HostSpace> block_offset;
  Kokkos::View<int*, Kokkos::HostSpace> archetype_block;
  int padded_worlds, world;
  Numbers J, J_size;  // (nv)
  double item(int tree, int at) const {
    constexpr int width = gsp::Dynamics<R, Mem>::width;
    int const lane = model.tree_instance(tree) * padded_worlds + world;
    return double(
        items(block_offset(archetype_block(model.tree_archetype(tree)) + lane / width) + lane % width + std::int64_t(at) * width));
  }
  gsp::Archetype const& archetype(int tree) const { return model.archetypes(model.tree_archetype(tree)); }
  void add(int dof, double value, double size) {
    J[std::size_t(dof)] += value;
    J_size[std::size_t(dof)] += size;
  }
  void set_dof(int dof, R value) { add(dof, double(value), std::abs(double(value))); }
  void add_force(int body, double const (&force)[6], double scale) {
    int const dof = model.body_last_dof(body), tree = model.dof_tree(dof), last = dof - model.tree_dof(tree);
    auto const& a = archetype(tree);
    gsp::FactorLayout const at(a);
    for (int p = model.ints(a.row_adr + last); p < model.ints(a.row_adr + last + 1); ++p) {
      int const i = model.ints(a.row_col + p);
      double value = 0, size = 0;
      for (int c = 0; c < 6; ++c) {
        double const term = scale * force[c] * item(tree, at.cdof + 6 * i + c);
        value += term;
        size += std::abs(term);
      }
      add(model.tree_dof(tree) + i, value, size);
    }
  }
  void add_point(int body, gsp::Vec3<R> const& point, gsp::Vec3<R> const& direction, R scale = R(1)) {
    int const tree = model.dof_tree(model.body_last_dof(body)), com = gsp::FactorLayout(archetype(tree)).com + 3 * model.body_root(body);
    double arm[3], f[3];
    for (int c = 0; c < 3; ++c) arm[c] = double(point[c]) - item(tree, com + c), f[c] = double(direction[c]);
    add_force(body, {arm[1] * f[2] - arm[2] * f[1], arm[2] * f[0] - arm[0] * f[2], arm[0] * f[1] - arm[1] * f[0], f[0], f[1], f[2]},
              double(scale));
  }
  void add_rotation(int body, gsp::Vec3<R> const& direction, R scale = R(1)) {
    add_force(body, {double(direction[0]), double(direction[1]), double(direction[2]), 0, 0, 0}, double(scale));
  }
  /// Y, and the sizes, of the dofs of a tree.
  std::pair<Numbers, Numbers> whitened(int tree) const {
    auto const& a = archetype(tree);
    gsp::FactorLayout const at(a);
    auto const begin = model.tree_dof(tree);
    Numbers y(J.begin() + begin, J.begin() + begin + a.nv), size(J_size.begin() + begin, J_size.begin() + begin + a.nv);
    for (int i = a.nv; i-- > 0;) {
      int const adr = model.ints(a.row_adr + i), n = model.ints(a.row_adr + i + 1) - adr - 1;
      for (int p = 0; p < n; ++p) {
        auto const above = std::size_t(model.ints(a.row_col + adr + p));
        double const factor = item(tree, at.factor + adr + p);
        y[above] -= factor * y[std::size_t(i)];
        size[above] += std::abs(factor) * size[std::size_t(i)];
      }
      double const root = std::sqrt(item(tree, at.inverse_diagonal + i));
      y[std::size_t(i)] *= root;
      size[std::size_t(i)] *= root;
    }
    return {y, size};
  }
};

// Y = J L^-1 D^-1/2, and a row's bias of what J makes of its gap and rates. Chains of more than 40 dofs: more than a GPU's
// thread keeps near it of a column. Each number is a sum of products of products: rounding is an epsilon of the sum of their sizes for each
// of the n factors that one may go through, and for the few before them.
TEST_CASE_TEMPLATE("rows are whitened with the factored matrix", Exec, GSP_TEST_EXECS) {
  auto const check = [](auto zero) {
    using R = decltype(zero);
    using Mem = typename Exec::memory_space;
    int const worlds = 35;  // a block of a GPU's lanes, and some of another
    auto const compiled = gsp::compile(gsp_test::random_model({gsp::JointType::free, gsp::JointType::hinge, gsp::JointType::free}, 48));
    Loop<R, Exec> s(compiled, worlds);
    gsp_test::randomise(compiled, s.state);
    auto const model = gsp::make_model<double>(Kokkos::DefaultHostExecutionSpace(), compiled);
    test_types::Pulls<R, Mem> const pulls{{}, s.model};
    s.assemble(pulls);
    while (s.grow()) s.assemble(pulls);
    auto const host_model = gsp::make_model<R>(Kokkos::DefaultHostExecutionSpace(), compiled);
    test_types::Pulls<R, Kokkos::HostSpace> const expected{{}, host_model};
    WhitenedRow<R, Mem> reference{model,
                                  gsp_test::host(s.dynamics.items),
                                  gsp_test::host(s.dynamics.block_offset),
                                  gsp_test::host(s.dynamics.archetype_block),
                                  s.dynamics.padded_worlds,
                                  0,
                                  {},
                                  {}};
    auto const first = gsp_test::host(s.rows.first), count = gsp_test::host(s.rows.count);
    auto const rows = gsp_test::host(s.rows.row);
    auto const Y = gsp_test::host(s.rows.Y);
    double const epsilon = double(std::numeric_limits<R>::epsilon());
    for (int w = 0; w < worlds; ++w) {
      REQUIRE(count(w) == 40);
      for (int at = first(w); at < first(w) + count(w); ++at) {
        auto const& row = rows(at);
        reference.world = w;
        reference.J.assign(std::size_t(model.nv), 0.);
        reference.J_size = reference.J;
        double const gap = double(expected.jacobian(w, row.element, 0, reference));
        double bias = -gap, bias_size = std::abs(gap);
        std::int64_t entry = row.first_entry;
        std::vector<bool> moved(std::size_t(model.nv), false);  // dofs that it has entries of
        for (auto const& segment : row.segment) {
          if (segment.count == 0) continue;
          int const tree = model.dof_tree(segment.dof0), nv = reference.archetype(tree).nv;
          gsp::FactorLayout const layout(reference.archetype(tree));
          auto const [y, size] = reference.whitened(tree);
          for (int i = 0; i < segment.count; ++i, ++entry) {
            auto const dof = std::size_t(segment.list < 0 ? i : model.ints(segment.list + i));
            CHECK(std::abs(double(Y(entry)) - y[dof]) <= (nv + 16) * epsilon * size[dof]);
            moved[dof + std::size_t(segment.dof0)] = true;
          }
          for (int i = 0; i < nv; ++i) {
            auto const dof = std::size_t(segment.dof0 + i);
            double const v = reference.item(tree, layout.qvel + i), free = reference.item(tree, layout.velocity + i);
            bias += reference.J[dof] * (free - 2 * v - reference.item(tree, layout.low + i));
            bias_size += reference.J_size[dof] * (std::abs(free) + 2 * std::abs(v));
          }
        }
        for (int i = 0; i < model.nv; ++i) CHECK((moved[std::size_t(i)] || reference.J[std::size_t(i)] == 0));
        CHECK(std::abs(double(row.bias) - bias) <= (model.nv + 16) * epsilon * bias_size);
      }
    }
  };
  check(0.f);
  check(0.);
}

// Hosts make rows of a tree together, a row a lane of a pack: each has the bits that it has alone, whoever is beside it. Forces, entries
// and both; chains of all dofs, whole trees and two trees in turn, more of them than a pack has lanes, and a pack of two.
TEST_CASE_TEMPLATE("rows that are made together have the bits that they have alone", R, float, double) {
  using Mem = Kokkos::HostSpace;
  Kokkos::DefaultHostExecutionSpace const exec;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<R>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = 3});
  auto poses = gsp::make_poses(exec, model, {.worlds = 3});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = 3});
  std::mt19937 engine(3);
  std::normal_distribution<double> random;
  for (int w = 0; w < 3; ++w)
    for (int i = 0; i < model.nv; ++i) state.qvel(w, i) = R(random(engine));
  gsp::smooth_dynamics(exec, model, state, poses, dynamics);
  int const w = 1;
  for (int length : {2, 3, 7, 100}) {
    std::vector<gsp::Row<R>> rows;
    std::vector<gsp::detail::RowForces<R, Mem>> forces;
    std::vector<R> together;
    while (int(rows.size()) < length) {
      int const place = int(rows.size()), tree = place % 9 == 4 ? 1 : 0, nv = model.archetypes(model.tree_archetype(tree)).nv;
      gsp::Archetype const& a = model.archetypes(model.tree_archetype(tree));
      int const dof = (7 * place) % nv, adr = model.ints(a.row_adr + dof), n = model.ints(a.row_adr + dof + 1) - adr;
      gsp::Row<R> row{};
      row.segment[0] = {place % 5 == 3 || n == nv ? -1 : a.row_col + adr, place % 5 == 3 ? nv : n, model.tree_dof(tree)};
      row.first_entry = std::int64_t(together.size());
      row.bias = row.lower = row.upper = row.mu = R(0.25 * place);  // sums of another segment
      for (int i = 0; i < row.segment[0].count; ++i) together.push_back(R(random(engine)));
      rows.push_back(row);
      gsp::detail::RowForces<R, Mem> own;
      own.entries = place % 4 != 2;
      for (; own.count < (own.entries ? place % 3 : 2); ++own.count) {
        int const last = own.count == 0 ? dof : model.ints(a.row_col + adr);  // of the chain: its end, its root
        own.force[own.count].dof = model.tree_dof(tree) + last;
        for (auto* v : {&own.force[own.count].force.angular, &own.force[own.count].force.linear})
          *v = {R(random(engine)), R(random(engine)), R(random(engine))};
      }
      forces.push_back(own);
    }
    auto alone = together;
    auto of_alone = rows;
    gsp::detail::RowLanes<R, Mem> lanes(model, dynamics, together.data(), w);
    for (std::size_t k = 0; k < rows.size(); ++k) lanes.add(rows[k], 0, forces[k]);
    lanes.finish();
    for (std::size_t k = 0; k < rows.size(); ++k) {
      gsp::detail::RowLanes<R, Mem> one(model, dynamics, alone.data(), w);
      one.add(of_alone[k], 0, forces[k]);
      one.finish();
    }
    CHECK(std::memcmp(together.data(), alone.data(), alone.size() * sizeof(R)) == 0);
    for (int k = 0; k < length; ++k) {
      CAPTURE(k);
      CHECK(rows[k].bias == of_alone[k].bias);
      CHECK(rows[k].lower == of_alone[k].lower);
      CHECK(rows[k].upper == of_alone[k].upper);
      CHECK(rows[k].mu == of_alone[k].mu);
      CHECK(rows[k].mu > R(0.25 * k));
    }
  }
}
