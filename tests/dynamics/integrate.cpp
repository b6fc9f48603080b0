#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/dynamics/integrate.hpp>
#include <gsp/dynamics/runge_kutta.hpp>
#include <gsp/dynamics/smooth.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp_test_execs.hpp>
#include <limits>

#include "dynamics/random_tree.hpp"
#include "reference/rigid_bodies.hpp"
#include "support/data.hpp"
#include "support/kernels.hpp"
#include "support/skip.hpp"

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
/// Energy, and angular momentum about the common centre of mass in the world, of all bodies: sums over the bodies, in double.
struct Motion {
  double energy = 0;
  gsp::Vec3<double> spin{0, 0, 0};
};
template <class View>
Motion motion(gsp::CompiledModel const& c, View const& qpos, View const& qvel, int w) {
  using V = gsp::Vec3<double>;
  std::vector<double> q(c.nq), v(c.nv);
  for (int i = 0; i < c.nq; ++i) q[i] = qpos(w, i);
  for (int i = 0; i < c.nv; ++i) v[i] = qvel(w, i);
  for (int j = 0; j < c.njnt; ++j) {
    auto const type = gsp::JointType(c.jnt_type[j]);
    if (type == gsp::JointType::hinge || type == gsp::JointType::slide) continue;
    int const at = c.jnt_qposadr[j] + (type == gsp::JointType::free ? 3 : 0);
    double const n = std::sqrt(q[at] * q[at] + q[at + 1] * q[at + 1] + q[at + 2] * q[at + 2] + q[at + 3] * q[at + 3]);
    for (int k = 0; k < 4; ++k) q[at + k] /= n;
  }
  gsp_reference::RigidBodies const at(c, q);
  Motion m;
  for (int i = 0; i < c.nv; ++i) m.energy += 0.5 * c.dof_armature[i] * v[i] * v[i];
  for (int j = 0; j < c.njnt; ++j) {
    int const k = c.jnt_qposadr[j];
    if (c.jnt_type[j] >= int(gsp::JointType::slide)) m.energy += 0.5 * c.jnt_stiffness[j] * std::pow(q[k] - c.qpos_spring[k], 2);
  }
  std::vector<V> u(c.nbody, V{0, 0, 0}), turn(u);
  V center{0, 0, 0}, flow{0, 0, 0};
  double mass = 0;
  for (int b = 1; b < c.nbody; ++b) {
    for (int i = 0; i < c.nv; ++i) u[b] += v[i] * at.Jv[b][i], turn[b] += v[i] * at.Jw[b][i];
    center += c.body_mass[b] * at.center[b], flow += c.body_mass[b] * u[b], mass += c.body_mass[b];
  }
  center = (1 / mass) * center, flow = (1 / mass) * flow;
  for (int b = 1; b < c.nbody; ++b) {
    auto const& g = c.option.gravity;
    V const own = at.inertia_times(c, b, turn[b]);
    m.energy += 0.5 * (c.body_mass[b] * dot(u[b], u[b]) + dot(turn[b], own)) - c.body_mass[b] * dot(V{g[0], g[1], g[2]}, at.center[b]);
    m.spin += own + c.body_mass[b] * cross(at.center[b] - center, u[b] - flow);
  }
  return m;
}

/// A disc of 1 kg on a ball joint, 0.1 m from the point that it turns about; `extra` bodies that stand still in it make a part of its mass.
gsp::Description top(int extra = 0) {
  gsp::Description d;
  gsp::BodyDescription b;
  b.parent = 0, b.name = "top", b.has_inertial = true;
  b.inertial.mass = 1 - 0.2 * extra, b.inertial.pos = {0, 0, 0.1}, b.inertial.inertia = {1e-2, 1e-2, 2e-2, 0, 0, 0};
  b.joints.emplace_back().type = gsp::JointType::ball;
  d.bodies.push_back(b);
  for (int i = 0; i < extra; ++i) {
    gsp::BodyDescription part;
    part.name = "part" + std::to_string(i), part.parent = 1, part.pos = {0, 0, 0.1}, part.has_inertial = true;
    part.inertial.mass = 0.2, part.inertial.inertia = {1e-3, 1e-3, 2e-3, 0, 0, 0};
    d.bodies.push_back(part);
  }
  return d;
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

// Bodies that stand still in a free body are part of it: the angular momentum of all of them together stays, for 10,000 steps, wherever
// they sit and however their frames are turned. A step rounds each number some 100 times, at random: 1e-16 x 10 x sqrt(10,000) = 1e-13.
TEST_CASE_TEMPLATE("a thrown body keeps its angular momentum with bodies that stand still in it", Exec, GSP_TEST_EXECS) {
  gsp_test::Random r;
  for (int trial = 0; trial < 3; ++trial) {
    auto d = lone(gsp::JointType::free);
    for (int i = 0; i < 4; ++i) {
      gsp::BodyDescription part;
      part.name = "part" + std::to_string(i), part.parent = i < 3 ? 1 + i : 1;  // a chain of three, and one beside it
      part.pos = {r(), r(), r()}, part.quat = gsp_test::random_quat(r);
      if (i != 1) {  // the second is a mere frame
        part.has_inertial = true, part.inertial.mass = 1 + 0.5 * r(), part.inertial.pos = {0.1 * r(), 0.1 * r(), 0.1 * r()};
        part.inertial.inertia = {0.05, 0.04, 0.03, 0, 0, 0}, part.inertial.quat = gsp_test::random_quat(r);
      }
      d.bodies.push_back(part);
    }
    auto const c = gsp::compile(d);
    Worlds<double, Exec> s(c, 2, {.profile = gsp::Profile::stable, .timestep = 0.002});
    auto const turn = gsp_test::random_quat(r);
    s.set({3, -2, 5, turn[0], turn[1], turn[2], turn[3]}, {0.3, 0.1, -0.2, 20 * r(), 20 * r(), 20 * r()});
    auto const start = motion(c, gsp_test::host(s.state.qpos), gsp_test::host(s.state.qvel), 1);
    s.step(10000);
    auto const end = motion(c, gsp_test::host(s.state.qpos), gsp_test::host(s.state.qvel), 1);
    CHECK(norm(end.spin - start.spin) < 1e-12 * norm(start.spin));
    CHECK(std::abs(end.energy / start.energy - 1) < 1e-2);  // of the midpoint rule: O(h w)^2, and it does not grow
  }
}

// A rod with another across it, free and without gravity, thrown about two axes as in the gyroscope scene of MotrixSim: float, 60 s. A step
// rounds some 100 numbers at random: 6e-8 x 10 x sqrt(30,000) = 1e-4 at the most.
TEST_CASE_TEMPLATE("a gyroscope without gravity keeps energy and angular momentum for a minute", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  d.option.gravity = {0, 0, 0};
  for (int k = 0; k < 2; ++k) {
    gsp::BodyDescription b;
    b.name = k ? "across" : "rod", b.parent = k, b.pos = {k ? 0.2 : 0., 0, k ? 0. : 0.02};
    b.quat = {std::cos(k ? 0.785 : 0.436), 0, std::sin(k ? 0.785 : 0.436), 0};
    auto& g = b.geoms.emplace_back();
    g.type = gsp::ShapeType::cylinder, g.size = {k ? 0.07 : 0.1, k ? 0.1 : 0.5, 0};
    if (k == 0) b.joints.emplace_back().type = gsp::JointType::free;
    d.bodies.push_back(b);
  }
  auto const c = gsp::compile(d);
  Worlds<float, Exec> s(c, 1, {.timestep = 0.002});
  s.set({}, {0, 0, 0, 10, 0, 5});
  auto const start = motion(c, gsp_test::host(s.state.qpos), gsp_test::host(s.state.qvel), 0);
  s.step(30000);
  auto const end = motion(c, gsp_test::host(s.state.qpos), gsp_test::host(s.state.qvel), 0);
  CHECK(std::abs(end.energy / start.energy - 1) < 1e-4);
  CHECK(norm(end.spin - start.spin) < 1e-4 * norm(start.spin));
}

// A heavy top in steady precession: A Omega^2 cos(theta) - C s Omega + m g l = 0 for the spin s about its axis (Goldstein, ch. 5.7), the
// slow root. The axis keeps its angle and goes round by Omega t. Gravity turns the axis by
// Omega h a step, which is second order; the spin, however fast, is exact. So h s = 1.5 (300 rad/s, 5 ms) is well too.
TEST_CASE_TEMPLATE("a heavy top precesses as theory has it, and keeps its energy", Exec, GSP_TEST_EXECS) {
  for (int extra : {0, 2})
    for (double spin : {100., 300.})
      for (double h : {0.001, 0.005}) {
        auto const c = gsp::compile(top(extra));
        double const m = 1, l = 0.1, g = 9.81, tilt = 0.5;
        double const A = 1e-2 + m * l * l + extra * 1e-3, C = 2e-2 + extra * 2e-3;
        double const half = C * spin / (2 * A * std::cos(tilt)), omega = half - std::sqrt(half * half - m * g * l / (A * std::cos(tilt)));
        Worlds<double, Exec> s(c, 1, {.profile = gsp::Profile::stable, .timestep = h});
        // tilted about x; the axis turns about the vertical, which the body sees at (0, sin, cos) of the tilt
        s.set({std::cos(tilt / 2), std::sin(tilt / 2), 0, 0}, {0, omega * std::sin(tilt), spin});
        auto const start = motion(c, gsp_test::host(s.state.qpos), gsp_test::host(s.state.qvel), 0);
        double worst = 0, angle = 0, last = 0;
        for (int i = 0, n = int(std::lround(2 / h)); i < n; ++i) {
          s.step(1);
          auto const q = gsp_test::host(s.state.qpos);
          auto const now = motion(c, q, gsp_test::host(s.state.qvel), 0);
          worst = std::fmax(worst, std::abs(now.energy / start.energy - 1));
          auto const axis = rotate(gsp::Quat<double>{q(0, 0), q(0, 1), q(0, 2), q(0, 3)}, gsp::Vec3<double>{0, 0, 1});
          double const heading = std::atan2(axis.x, -axis.y);
          angle += std::remainder(heading - last, 2 * 3.14159265358979), last = heading;
        }
        MESSAGE(spin << " rad/s, " << h << " s: energy " << worst << ", precession " << angle / (2 * omega) - 1);
        CHECK(worst < 1e-4);
        CHECK(std::abs(angle / (2 * omega) - 1) < 0.01);
      }
}

// What a step of an undamped tree solves, densely: (M + h/2 D) (v+ - v) = -h bias(v), D column by column from bias(v + e) - bias(v - e),
// exact for a quadratic; the reference's bias has 1e-9 of numbers up to 100.
TEST_CASE_TEMPLATE("undamped trees take the bias forces of the middle of the step", Exec, GSP_TEST_EXECS) {
  for (auto type : {gsp::JointType::free, gsp::JointType::ball, gsp::JointType::hinge}) {
    auto d = gsp_test::random_model({type}, 7);
    for (auto& body : d.bodies)
      for (auto& joint : body.joints) joint.damping = joint.stiffness = 0, joint.frictionloss = 0.1;  // which is no damping
    auto const c = gsp::compile(d);
    double const h = 0.02;
    int const n = c.nv;
    Worlds<double, Exec> s(c, 3, {.timestep = h});
    gsp_test::randomise(c, s.state);
    auto const q = gsp_test::snapshot(s.state.qpos), v0 = gsp_test::snapshot(s.state.qvel);
    std::vector<double> const qpos(&q(2, 0), &q(2, 0) + c.nq), v(&v0(2, 0), &v0(2, 0) + n);
    auto const M = gsp_reference::mass_matrix(c, gsp_reference::RigidBodies(c, qpos));
    auto A = M, x = gsp_reference::bias_forces(c, qpos, v);
    for (int k = 0; k < n; ++k) {
      auto more = v, less = v;
      more[k] += 1, less[k] -= 1;
      auto const a = gsp_reference::bias_forces(c, qpos, more), b = gsp_reference::bias_forces(c, qpos, less);
      for (int i = 0; i < n; ++i) A[i * n + k] += h / 2 * (a[i] - b[i]) / 2;
    }
    for (int k = 0; k < n; ++k)  // Gauss: M leads
      for (int i = k + 1; i < n; ++i) {
        double const f = A[i * n + k] / A[k * n + k];
        for (int j = k; j < n; ++j) A[i * n + j] -= f * A[k * n + j];
        x[i] -= f * x[k];
      }
    for (int k = n - 1; k >= 0; --k) {
      for (int j = k + 1; j < n; ++j) x[k] -= A[k * n + j] * x[j];
      x[k] /= A[k * n + k];
    }
    s.step(1);
    auto const v1 = gsp_test::host(s.state.qvel);
    for (int i = 0; i < n; ++i) CHECK(std::abs(v1(2, i) - (v[i] - h * x[i])) < 1e-8);
  }
}

// Two rotors on a body that tumbles, 300 and 200 rad/s: explicit bias forces make it explode within 2 s.
TEST_CASE_TEMPLATE("rotors on a free body keep their energy", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  d.option.gravity = {0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    gsp::BodyDescription b;
    b.name = "b" + std::to_string(k), b.parent = k > 0, b.has_inertial = true;
    b.inertial.mass = k > 0 ? 0.2 : 2, b.pos = {k == 1 ? 0.2 : k == 2 ? -0.2 : 0., 0, k == 2 ? 0.1 : 0.};
    b.inertial.inertia = {k > 0 ? 0.001 : 0.02, k == 0 ? 0.03 : k == 1 ? 0.001 : 0.002, k == 0 ? 0.04 : k == 1 ? 0.002 : 0.001, 0, 0, 0};
    b.joints.emplace_back().type = k > 0 ? gsp::JointType::hinge : gsp::JointType::free;
    b.joints[0].axis = {0, k == 2 ? 1. : 0., k == 2 ? 0. : 1.};
    d.bodies.push_back(b);
  }
  auto const c = gsp::compile(d);
  for (double h : {0.001, 0.005}) {
    Worlds<double, Exec> s(c, 1, {.timestep = h});
    s.set({0, 0, 0, 1, 0, 0, 0, 0, 0}, {0, 0, 0, 10, 20, 3, 300, 200});
    double const start = motion(c, gsp_test::host(s.state.qpos), gsp_test::host(s.state.qvel), 0).energy;
    s.step(int(std::lround(2 / h)));
    CHECK(std::abs(motion(c, gsp_test::host(s.state.qpos), gsp_test::host(s.state.qvel), 0).energy / start - 1) < 0.05);
  }
}

// The humanoid without damping, thrown with up to 10 rad/s in every joint: 5 % of its kinetic energy in 2 s, at 5 ms no explosion.
TEST_CASE("an undamped humanoid keeps its energy" * doctest::test_suite("data")) {
  auto const path = gsp_test::data("models/mujoco/humanoid/humanoid.xml");
  if (!path) return gsp_test::skip("models/mujoco/humanoid is missing from GSP_DATA_DIR");
  auto d = gsp::io::read_mjcf(*path, {.skip_visuals = true});
  for (auto& body : d.bodies)
    for (auto& joint : body.joints) joint.damping = 0;
  auto const c = gsp::compile(d);
  for (double h : {0.001, 0.005}) {
    Worlds<double, Kokkos::DefaultHostExecutionSpace> s(c, 1, {.timestep = h});
    double const still = motion(c, gsp_test::host(s.state.qpos), gsp_test::host(s.state.qvel), 0).energy;
    gsp_test::Random r;
    auto const v = gsp_test::host(s.state.qvel);
    for (int i = 0; i < c.nv; ++i) v(0, i) = 10 * r();
    Kokkos::deep_copy(s.state.qvel, v);
    double const start = motion(c, gsp_test::host(s.state.qpos), v, 0).energy;
    double worst = 0;
    for (int i = 0; i < 20; ++i) {
      s.step(int(std::lround(0.1 / h)));
      double const now = motion(c, gsp_test::host(s.state.qpos), gsp_test::host(s.state.qvel), 0).energy;
      worst = std::fmax(worst, std::abs(now - start) / (start - still));
    }
    MESSAGE("humanoid, " << h << " s: " << worst);
    CHECK(worst < (h < 0.002 ? 0.05 : 0.5));
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

// Joints too. In profile stable what moves steadily by less than 16 epsilon keeps its qpos to the bit, and so all of its poses; in profile
// mujoco qpos is what the position rounds to. The position, qpos + qpos_low, goes its way in both: v t to a part in 10^4.
TEST_CASE_TEMPLATE("what rests keeps its qpos to the bit", Exec, GSP_TEST_EXECS) {
  using J = gsp::JointType;
  for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco})
    for (auto const type : {J::hinge, J::slide, J::ball, J::free}) {
      CAPTURE(int(type));
      Worlds<float, Exec> s(gsp::compile(lone(type)), 1, {.profile = profile, .timestep = 0.002});
      bool const turns = type == J::ball || type == J::free;
      std::vector<float> start{0.75f}, rate{1e-5f};
      if (type == J::ball) start = {0.6f, 0, 0.8f, 0}, rate = {0, 1e-5f, 0};
      if (type == J::free) start = {0.75f, 0, 0, 1, 0, 0, 0}, rate = {1e-5f, 0, 0, 0, 0, 0};
      s.set(start, rate);
      auto const position = [&](int i) { return double(gsp_test::host(s.state.qpos)(0, i)) + gsp_test::host(s.state.qpos_low)(0, i); };
      int const moving = type == J::ball ? 2 : 0;
      double const way = type == J::ball ? 0.5 * 0.6 * 1e-5 : 1e-5;  // of that number in a second
      s.step(40);                                                    // 8e-7
      bool same = true;
      for (std::size_t i = 0; i < start.size(); ++i) same = same && gsp_test::host(s.state.qpos)(0, int(i)) == start[i];
      CHECK(same == (profile == gsp::Profile::stable));
      CHECK(std::abs(position(moving) - start[std::size_t(moving)] - way * 0.08) < (turns ? 1e-10 : 1e-11));
      s.step(9960);
      CHECK(std::abs((position(moving) - start[std::size_t(moving)]) / (way * 20) - 1) < 2e-4);
      CHECK(std::abs(gsp_test::host(s.state.qpos_low)(0, moving)) < 16 * 1.2e-7);
    }
}

// A quaternion of float has 6e-8 rad: a step of 2e-9 rad would be lost, about any axis, in any orientation. It stays a unit one.
// The step of Runge and Kutta does as much, also for places.
TEST_CASE_TEMPLATE("orientations of free bodies carry what rounding takes", Exec, GSP_TEST_EXECS) {
  for (int const kind : {0, 1, 2}) {
    CAPTURE(kind);
    bool const runge_kutta = kind == 2;
    auto const profile = kind == 0 ? gsp::Profile::stable : gsp::Profile::mujoco;
    Worlds<float, Exec> s(gsp::compile(lone(gsp::JointType::free)), 1, {.profile = profile, .timestep = 0.002});
    float const start[4] = {0.1f, -0.7f, 0.5f, 0.5f};
    s.set({100, 0, 0, start[0], start[1], start[2], start[3]}, {1e-5f, 0, 0, 1e-6f, -2e-6f, 0.5e-6f});
    if (runge_kutta) {
      auto rk = gsp::make_runge_kutta(s.exec, s.model);
      for (int i = 0; i < 10000; ++i) gsp::runge_kutta(s.exec, s.model, s.state, s.poses, s.dynamics, rk);
      s.exec.fence();
    } else {
      s.step(10000);
    }
    CHECK(std::abs((double(gsp_test::host(s.state.qpos)(0, 0)) - 100 + gsp_test::host(s.state.qpos_low)(0, 0)) / 2e-4 - 1) < 1e-3);
    auto const q = gsp_test::host(s.state.qpos), low = gsp_test::host(s.state.qpos_low), v = gsp_test::host(s.state.qvel);
    double now[4], norm = 0;
    for (int c = 0; c < 4; ++c) now[c] = double(q(0, 3 + c)) + low(0, 3 + c), norm += now[c] * now[c];
    CHECK(std::abs(norm - 1) < 1e-6);
    // 2 Im(conj(start) now) of 20 s
    float const* const a = start;
    double const* const b = now;
    double const turned[3] = {2 * (a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2]),
                              2 * (a[0] * b[2] + a[1] * b[3] - a[2] * b[0] - a[3] * b[1]),
                              2 * (a[0] * b[3] - a[1] * b[2] + a[2] * b[1] - a[3] * b[0])};
    for (int c = 0; c < 3; ++c) {
      CAPTURE(c);
      CHECK(std::abs(turned[c] - 20 * v(0, 3 + c)) < 1e-4 * 20 * 2e-6 + 1.2e-7);  // a start that is a unit one to 6e-8
    }
  }
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

// Where MuJoCo warns (1e10) a world stops with a bit, and is left as it was: angles, velocities, quaternions that only their length spoils.
TEST_CASE_TEMPLATE("a world beyond 1e10 stops alone", Exec, GSP_TEST_EXECS) {
  auto const c = gsp::compile(gsp_test::random_model({gsp::JointType::free, gsp::JointType::hinge}, 3));
  int const hinge = c.tree_qposadr[1];
  Worlds<float, Exec> s(c, 6, {});
  gsp_test::randomise(c, s.state);
  auto const q = gsp_test::snapshot(s.state.qpos), v = gsp_test::snapshot(s.state.qvel);
  q(1, hinge) = 1e22f, v(2, c.nv - 1) = -1e11f, q(3, hinge) = std::numeric_limits<float>::infinity();
  for (int k = 3; k < 7; ++k) q(4, k) = 1e30f;
  Kokkos::deep_copy(s.state.qpos, q), Kokkos::deep_copy(s.state.qvel, v);
  s.step(3);
  auto const q2 = gsp_test::host(s.state.qpos), v2 = gsp_test::host(s.state.qvel);
  auto const status = gsp_test::host(s.state.status);
  auto const steps = gsp_test::host(s.state.steps);
  for (int w = 0; w < 6; ++w) {
    bool const good = w == 0 || w == 5;
    CHECK(steps(w) == (good ? 3 : 0));
    CHECK(bool(status(w) & (gsp::status::unbounded | gsp::status::not_finite)) == !good);
    if (!good) CHECK(std::memcmp(&q2(w, 0), &q(w, 0), sizeof(float) * c.nq) == 0);
    if (!good) CHECK(std::memcmp(&v2(w, 0), &v(w, 0), sizeof(float) * c.nv) == 0);
  }
  CHECK(status(1) == gsp::status::unbounded);
  CHECK(status(2) == gsp::status::unbounded);
}
