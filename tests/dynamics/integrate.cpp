#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/dynamics/integrate.hpp>
#include <gsp/dynamics/smooth.hpp>
#include <gsp_test_execs.hpp>
#include <limits>

#include "dynamics/random_tree.hpp"

namespace {
template <class R, class Exec>
struct Worlds {
  using Mem = typename Exec::memory_space;
  Exec exec;
  gsp::Model<R, Mem> model;
  gsp::State<R, Mem> state;
  gsp::Dynamics<R, Mem> dynamics;
  gsp::Poses<R, Mem> poses;
  Worlds(gsp::CompiledModel const& c, int worlds, gsp::ModelOptions options)
      : model(gsp::make_model<R>(exec, c, options)),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        dynamics(gsp::make_dynamics(exec, model, {.worlds = worlds})),
        poses(gsp::make_poses(exec, model, {.worlds = worlds})) {}
  void step(int n) {
    for (int i = 0; i < n; ++i) gsp::smooth_dynamics(exec, model, state, poses, dynamics), gsp::integrate(exec, model, state, dynamics);
    exec.fence();
  }
  void set(std::vector<R> const& qpos, std::vector<R> const& qvel) {
    auto const q = gsp_test::host(state.qpos), v = gsp_test::host(state.qvel);
    for (int w = 0; w < state.worlds; ++w) {
      for (std::size_t i = 0; i < qpos.size(); ++i) q(w, i) = qpos[i];
      for (std::size_t i = 0; i < qvel.size(); ++i) v(w, i) = qvel[i];
    }
    Kokkos::deep_copy(state.qpos, q), Kokkos::deep_copy(state.qvel, v);
  }
};

/// One body with one joint, 2 kg, three different moments, centre of mass off the origin.
gsp::Description lone(gsp::JointType type) {
  gsp::Description d;
  d.option.gravity = {0, 0, 0};
  gsp::BodyDescription b;
  b.parent = 0, b.name = "body", b.has_inertial = true;
  b.inertial.mass = 2, b.inertial.pos = {0.1, -0.2, 0.05}, b.inertial.inertia = {0.3, 0.2, 0.12, 0, 0, 0},
  b.inertial.quat = {0.8, 0.6, 0, 0};
  b.joints.emplace_back().type = type, b.joints[0].name = "joint", b.joints[0].axis = {1, 0, 0};
  d.bodies.push_back(b);
  return d;
}

/// Momentum, and angular momentum about the centre of mass, in the world.
void momentum(gsp::CompiledModel const& c, double const* q, double const* v, double (&out)[6]) {
  using V = gsp::Vec3<double>;
  gsp::Quat<double> const r{q[3], q[4], q[5], q[6]};
  auto const &ip = c.body_ipos[1], &i = c.body_inertia[1];
  auto const& iq = c.body_iquat[1];
  V const w = rotate(r, V{v[3], v[4], v[5]}), u = V{v[0], v[1], v[2]} + cross(w, rotate(r, V{ip[0], ip[1], ip[2]}));
  auto const frame = r * gsp::Quat<double>{iq[0], iq[1], iq[2], iq[3]};
  V const b = rotate_inverse(frame, w), L = rotate(frame, V{i[0] * b.x, i[1] * b.y, i[2] * b.z});
  for (int k = 0; k < 3; ++k) out[k] = c.body_mass[1] * u[k], out[3 + k] = L[k];
}
}  // namespace

// Profile stable, no forces: both are constant whatever the step (here 20 ms at 9 rad/s).
// A step is some 100 roundings of numbers below 10: 1,000 steps, 1e-10. Euler with explicit gyroscopic forces (profile mujoco) is off by
// O(h).
TEST_CASE("a thrown body keeps its momentum and angular momentum") {
  auto const c = gsp::compile(lone(gsp::JointType::free));
  for (auto profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    Worlds<double, Kokkos::DefaultHostExecutionSpace> s(c, 2, {.profile = profile, .timestep = 0.02});
    s.set({0, 0, 0, 1, 0, 0, 0}, {0.3, 0.1, -0.2, 5, 7, -2});
    double start[6], end[6], off = 0;
    auto const q = gsp_test::host(s.state.qpos), v = gsp_test::host(s.state.qvel);
    momentum(c, &q(1, 0), &v(1, 0), start);
    s.step(1000);
    auto const q2 = gsp_test::host(s.state.qpos), v2 = gsp_test::host(s.state.qvel);
    momentum(c, &q2(1, 0), &v2(1, 0), end);
    for (int k = 0; k < 3; ++k) off = std::fmax(off, std::abs(end[k] - start[k]));
    if (profile == gsp::Profile::stable)
      CHECK(off < 1e-10);
    else
      CHECK(off > 1e-6);
  }
}

// One hinge, no gravity: closed forms of one step. mujoco: damping implicit, servo explicit; stable: all of them implicit.
TEST_CASE_TEMPLATE("implicit terms of one joint", Exec, GSP_TEST_EXECS) {
  auto d = lone(gsp::JointType::slide);
  auto& joint = d.bodies[1].joints[0];
  double const m = 2 + 0.5, k = 300, b = 4, kp = 500, kv = 20, h = 0.01, x = 0.3, v = -1.2, u = 0.7;
  joint.stiffness = k, joint.damping = b, joint.armature = 0.5;
  gsp::ActuatorDescription a;
  a.name = "servo", a.target_name = "joint", a.gainprm[0] = kp, a.bias_type = gsp::ActuatorBias::affine, a.biasprm = {0, -kp, -kv};
  d.actuators.push_back(a);
  auto const c = gsp::compile(d);
  double const f = -k * x - b * v + kp * (u - x) - kv * v;
  double const expected[2] = {v + h * (f - h * (k + kp) * v) / (m + h * (b + kv) + h * h * (k + kp)), v + h * f / (m + h * b)};
  for (int p = 0; p < 2; ++p) {
    Worlds<double, Exec> s(c, 3, {.profile = gsp::Profile(p), .timestep = h});
    s.set({x}, {v});
    Kokkos::deep_copy(s.state.ctrl, u);
    s.step(1);
    auto const q2 = gsp_test::host(s.state.qpos), v2 = gsp_test::host(s.state.qvel);
    CHECK(std::abs(v2(2, 0) - expected[p]) < 1e-14);
    CHECK(std::abs(q2(2, 0) - (x + h * expected[p])) < 1e-14);
  }
}

// float has 8e-3 of a millimetre at 100 m: a step of 2e-8 m would be lost. With the second number the way is right to a part in 10^4.
TEST_CASE_TEMPLATE("positions of free bodies carry what rounding takes", Exec, GSP_TEST_EXECS) {
  Worlds<float, Exec> s(gsp::compile(lone(gsp::JointType::free)), 1, {.timestep = 0.002});
  s.set({100, 0, 0, 1, 0, 0, 0}, {1e-5f, 0, 0, 0, 0, 0});
  s.step(10000);
  auto const q = gsp_test::host(s.state.qpos), low = gsp_test::host(s.state.qpos_low);
  CHECK(std::abs((double(q(0, 0)) - 100 + low(0, 0)) / 2e-4 - 1) < 1e-4);
}

// A world that is not finite stays as it was, keeps its bit, and does not touch its neighbours: those have the bits of a batch without it.
TEST_CASE_TEMPLATE("a world that is not finite stops alone", Exec, GSP_TEST_EXECS) {
  auto const c = gsp::compile(gsp_test::random_model({gsp::JointType::free, gsp::JointType::hinge}, 5));
  int const worlds = 19, bad = 7, worse = 8;
  Worlds<float, Exec> a(c, worlds, {}), b(c, worlds, {});
  for (auto* s : {&a, &b}) gsp_test::randomise(c, s->state);
  auto const q = gsp_test::snapshot(b.state.qpos), v = gsp_test::snapshot(b.state.qvel), force = gsp_test::host(b.state.qfrc_applied);
  force(bad, 3) = std::numeric_limits<float>::quiet_NaN(), v(worse, 0) = std::numeric_limits<float>::infinity();
  Kokkos::deep_copy(b.state.qfrc_applied, force), Kokkos::deep_copy(b.state.qvel, v);
  a.step(5), b.step(5);
  auto const qa = gsp_test::host(a.state.qpos), qb = gsp_test::host(b.state.qpos), vb = gsp_test::host(b.state.qvel);
  auto const status = gsp_test::host(b.state.status);
  auto const steps = gsp_test::host(b.state.steps);
  auto const same = [&](auto const& x, auto const& y, int w) { return std::memcmp(&x(w, 0), &y(w, 0), sizeof(float) * x.extent(1)) == 0; };
  for (int w = 0; w < worlds; ++w) {
    bool const stopped = w == bad || w == worse;
    CHECK(status(w) == (stopped ? gsp::status::not_finite : 0u));
    CHECK(steps(w) == (stopped ? 0 : 5));
    CHECK(same(qb, stopped ? q : qa, w));
    if (stopped) CHECK(same(vb, v, w));
  }
  // mended and cleared, it goes on
  force(bad, 3) = 0;
  Kokkos::deep_copy(b.state.qfrc_applied, force), Kokkos::deep_copy(b.state.status, 0u);
  b.step(5);
  CHECK(gsp_test::host(b.state.steps)(bad) == 5);
  CHECK(same(gsp_test::host(b.state.qpos), qa, bad));
}
