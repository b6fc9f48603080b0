// Scenes of the paper with default settings of profile `stable`, in float and double: a shelf of 548 bodies, grasps that are shaken, a
// pyramid of 1,240 boxes, a gyroscope on its tip. Bars of the project; what misses its bar says so. Minutes to hours each, so CTest runs
// none of the suite "long": OMP_NUM_THREADS=1 test_step_scenes --no-skip -ts=long -tc="*shelf*float*"
#include "step/scenes.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>
#include <random>

#include "step/scene_files.hpp"
#include "step/world.hpp"
#include "support/data.hpp"
#include "support/skip.hpp"

namespace {
using Host = Kokkos::DefaultHostExecutionSpace;

/// Angle between two turns; by the vector part of p^-1 q, as the scalar part of float says nothing below 5e-4.
double angle(double const* p, double const* q) {
  double const x = p[0] * q[1] - p[1] * q[0] - p[2] * q[3] + p[3] * q[2], y = p[0] * q[2] + p[1] * q[3] - p[2] * q[0] - p[3] * q[1],
               z = p[0] * q[3] - p[1] * q[2] + p[2] * q[1] - p[3] * q[0];
  return 2 * std::asin(std::fmin(1, std::sqrt(x * x + y * y + z * z)));
}

template <class R>
struct Scene : gsp_test::World<R, Host> {
  using Base = gsp_test::World<R, Host>;
  using Base::compiled, Base::model, Base::sim, Base::state;
  double sweeps = 0;  // of all steps
  explicit Scene(gsp::Description const& d, double timestep = 0) : Base(gsp::compile(d), 1, {.timestep = timestep}) {}
  void run(int steps) {
    for (int i = 0; i < steps; ++i) {
      this->step(1);
      sweeps += sim.solution.iterations(0);
    }
  }
  /// Of free bodies, in the order of their joints.
  int bodies() const { return model.nq / 7; }
  double moved(int b) const {
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += std::pow(double(state.qpos(0, 7 * b + c)) - compiled.qpos0[7 * b + c], 2);
    return std::sqrt(sum);
  }
  /// Angle between now and the start.
  double turned(int b) const {
    double const q[4] = {state.qpos(0, 7 * b + 3), state.qpos(0, 7 * b + 4), state.qpos(0, 7 * b + 5), state.qpos(0, 7 * b + 6)};
    return angle(&compiled.qpos0[7 * b + 3], q);
  }
  /// Mean over the bodies of sqrt(dp^2 + dtheta^2) [m, rad], and of the speed [m/s].
  double error() const {
    double sum = 0;
    for (int b = 0; b < bodies(); ++b) sum += std::hypot(moved(b), turned(b));
    return sum / bodies();
  }
  double speed() const {
    double sum = 0;
    for (int b = 0; b < bodies(); ++b)
      sum += std::hypot(double(state.qvel(0, 6 * b)), double(state.qvel(0, 6 * b + 1)), double(state.qvel(0, 6 * b + 2)));
    return sum / bodies();
  }
};

template <class R>
std::string name_of() {
  return sizeof(R) == 4 ? "float" : "double";
}

}  // namespace

// MotrixSim's Spot on soft feet (solref 4 ms), from home with its controls, without meshes, which are missing. At 10 ms it stands where
// steps of 1 ms put it, turned by less than 5e-4 from there and from its start, at rest and solved in a few sweeps: bars of the project.
// (With time constants of 2 h and MuJoCo's compliance it sank 7 mm deeper, and took 54 sweeps a step at 4 ms.) It stands at 20 ms, and from
// qpos0 with controls of 0.
TEST_CASE_TEMPLATE("Spot stands where small steps put it", R, float, double) {
  auto const path = gsp_test::data("models/motrix/spot/spot.xml");
  if (!path) return gsp_test::skip("models/motrix/spot is missing from GSP_DATA_DIR");
  auto const d = gsp_test::spot(*path);
  std::vector<double> fine(7);
  for (auto const& [h, home] : {std::pair{0.001, true}, {0.01, true}, {0.02, true}, {0.01, false}}) {
    CAPTURE(h);
    CAPTURE(home);
    Scene<R> w(d, h);
    auto const& key = w.compiled.keyframes.at(0);
    for (int i = 0; home && i < w.model.nq; ++i) w.state.qpos(0, i) = R(key.qpos[i]);
    for (int i = 0; home && i < w.model.nu; ++i) w.state.ctrl(0, i) = R(key.ctrl[i]);
    std::vector<double> const start(w.state.qpos.data(), w.state.qpos.data() + 7);
    w.run(int(3.5 / h));
    w.sweeps = 0;
    int const last = int(0.5 / h);
    w.run(last);
    std::vector<double> const q(w.state.qpos.data(), w.state.qpos.data() + 7);
    double const speed = std::hypot(double(w.state.qvel(0, 0)), double(w.state.qvel(0, 1)), double(w.state.qvel(0, 2)));
    auto const far = [&](std::vector<double> const& p) { return std::hypot(q[0] - p[0], q[1] - p[1], q[2] - p[2]); };
    MESSAGE(name_of<R>() << ", " << h << " s" << std::string(home ? "" : ", all joints at 0") << ": " << far(fine) << " m and "
                         << angle(&q[3], &fine[3]) << " rad from steps of 1 ms, " << angle(&q[3], &start[3]) << " rad from its start, "
                         << speed << " m/s, " << w.sweeps / last << " sweeps a step");
    if (h == 0.001) fine = q;
    CHECK(q[2] > 0.3);
    CHECK(speed < 1e-4);
    if (!home || h != 0.01) continue;
    CHECK(far(fine) < 2e-3);
    CHECK(angle(&q[3], &fine[3]) < 5e-4);
    CHECK(angle(&q[3], &start[3]) < 5e-4);
    CHECK(w.sweeps < 10 * last);
  }
}

// At 10 ms: error at 10 s at most 4.3e-3, a tenth above the 3.9e-3 that MuJoCo's contact law with Coulomb's friction gives with small steps
// (3.7e-3 to 4.0e-3 at 1 ms, here and in MuJoCo; the project's bar, 3.5e-3, is below that). Bottles overlap by up to 13 mm in the file and
// turn as they are pushed apart: docs/decisions/0022. Flat from 0.5 s on, mean speed below 1e-5 m/s, fewer than 10 sweeps a step. Measured:
// error 4.10e-3 in float and 4.00e-3 in double, flat; 4.0 and 4.1 sweeps a step.
// MuJoCo at 10 ms: 3.60e-3 with pyramids and 3.35e-3 with elliptic cones, 2e-5 m/s; at 0.5 ms 4.4e-3 and 4.6e-3.
TEST_CASE_TEMPLATE("a shelf of 548 bodies stands still" * doctest::test_suite("long") * doctest::skip(), R, float, double) {
  auto const path = gsp_test::data("models/motrix/store/store.xml");
  if (!path) return gsp_test::skip("models/motrix/store is missing from GSP_DATA_DIR");
  Scene<R> w(gsp_test::store(*path));
  w.run(50);
  double const early = w.error();
  w.sweeps = 0;
  w.run(950);
  MESSAGE(name_of<R>() << ": error " << early << " at 0.5 s, " << w.error() << " at 10 s, mean speed " << w.speed() << " m/s, "
                       << w.sweeps / 950 << " sweeps a step");
  CHECK(w.error() < 4.3e-3);
  CHECK(std::abs(w.error() - early) < 5e-5);
  CHECK(w.speed() < 1e-5);
}

// Loads of a pyramid go far, and what a step leaves unsolved moves boxes, which is more to solve: it rests where leaps go on (100 sweeps a
// step and 2e-5 m/s for ever where they ended early). Within 1.7 s: fewer than 10 sweeps a step and below 1e-5 m/s, the project's bars.
TEST_CASE("a pyramid of 204 boxes comes to rest") {
  Scene<double> w(gsp_test::pyramid(8));
  w.run(100);
  w.sweeps = 0;
  w.run(20);
  double const sweeps = w.sweeps / 20;
  MESSAGE(sweeps << " sweeps a step, mean speed " << w.speed() << " m/s");
  CHECK(sweeps < 10);
  CHECK(w.speed() < 1e-5);
}

// No box further than 0.5 m in 60 s. Measured for 10 s: 6.3 mm, at rest within a second; in double 4 to 7 sweeps a step then, in float 70
// to 100.
TEST_CASE_TEMPLATE("a pyramid of 1,240 boxes stands" * doctest::test_suite("long") * doctest::skip(), R, float, double) {
  Scene<R> w(gsp_test::pyramid(15));
  for (int second = 10; second <= 60; second += 10) {
    w.sweeps = 0;
    w.run(600);
    double far = 0;
    for (int b = 0; b < w.bodies(); ++b) far = std::fmax(far, w.moved(b));
    MESSAGE(name_of<R>() << ", " << second << " s: farthest " << far << " m, mean speed " << w.speed() << " m/s, " << w.sweeps / 600
                         << " sweeps a step");
    CHECK(far < 0.5);
  }
}

namespace {
// phys-bench's protocol: to the lifted pose (1 s), down to the object (1 s), close (1 s), lift (1 s), then targets of the seven joints that
// are off by N(0, 0.025 rad), drawn anew every second step, until 20 s. It passes where the object is above 3 cm all the time. Measured:
// all six, in float and double; 20 to 90 sweeps a step while shaken.
template <class R>
void grasp_and_shake(std::string const& object, double h) {
  using Pose = std::array<double, 8>;
  Pose const home{0, 0, 0, -1.57079, 0, 1.57079, -0.7853, 0.04}, low{-1.0104, 1.5623, 1.3601, -1.6840, -1.5863, 1.7810, 1.4598, 0.04},
      high{-1.0426, 1.4028, 1.5634, -1.7114, -1.4055, 1.6015, 1.4510, 0};
  auto const path = gsp_test::data("models/phys_bench/grasp_xml/mjx_pick_" + object + ".xml");
  if (!path) return gsp_test::skip("models/phys_bench is missing from GSP_DATA_DIR");
  Scene<R> w(gsp_test::grasp(*path), h);
  for (int j = 0; j < 7; ++j) w.state.qpos(0, j) = home[j];
  w.state.qpos(0, 7) = w.state.qpos(0, 8) = home[7];
  std::mt19937 random(1);
  std::normal_distribution<double> shake(0, 0.025);
  Pose noise{};
  double dropped = -1, lowest = 1;
  for (int i = 0; i * h < 20; ++i) {
    double const t = i * h;
    Pose open = high;
    open[7] = 0.04;
    Pose closed = low;
    closed[7] = 0;
    Pose const legs[5] = {home, open, low, closed, high};
    int const leg = std::min(int(t), 3);
    double const share = std::fmin(1, t - leg);
    if (t >= 4 && i % 2 == 0)
      for (int j = 0; j < 7; ++j) noise[j] = shake(random);
    for (int j = 0; j < 8; ++j) w.state.ctrl(0, j) = (1 - share) * legs[leg][j] + share * legs[leg + 1][j] + noise[j];
    w.run(1);
    double const z = w.state.qpos(0, 11);
    if (t > 4.5) lowest = std::fmin(lowest, z);
    if (t > 4.5 && dropped < 0 && !(z > 0.03)) dropped = t;
  }
  MESSAGE(name_of<R>() << ", " << object << ", " << h << " s: lowest " << lowest << " m, dropped at " << dropped << " s (-1: never), "
                       << w.sweeps * h / 20 << " sweeps a step");
  CHECK(dropped < 0);
}
}  // namespace

// A hundred humanoids that lie on and beside each other, up to 7 m from the origin, come to rest in float as in double: 4 sweeps a step,
// where the rounding of poses kept 14 to 17 (docs/decisions/0031). The project's bar: fewer than ten.
TEST_CASE("a hundred humanoids come to rest" * doctest::test_suite("data")) {
  auto const path = gsp_test::data("models/mujoco/humanoid/100_humanoids.xml");
  if (!path) return;
  Scene<float> w(gsp::io::read_mjcf(*path));
  w.run(8000);
  w.sweeps = 0;
  w.run(20);
  double squares = 0;
  for (int i = 0; i < w.model.nv; ++i) squares += std::pow(double(w.state.qvel(0, i)), 2);
  double const rms = std::sqrt(squares / w.model.nv);
  MESSAGE(double(w.sweeps / 20) << " sweeps a step, rates of " << rms << " (rms)");
  CHECK(w.sweeps < 10 * 20);
  CHECK(rms < 1e-4);
}

TEST_CASE("three objects are grasped and shaken, in float" * doctest::test_suite("data")) {
  for (std::string const object : {"cube", "ball", "bottle"})
    for (double const h : {0.002, 0.01}) grasp_and_shake<float>(object, h);
}
TEST_CASE("three objects are grasped and shaken, in double" * doctest::test_suite("long") * doctest::skip()) {
  for (std::string const object : {"cube", "ball", "bottle"})
    for (double const h : {0.002, 0.01}) grasp_and_shake<double>(object, h);
}

// A top on a smooth floor in steady precession: its centre of mass stands still, N = m g, and about it  m g l = Omega (C s - A Omega cos)
// (Goldstein, ch. 5.7), slow root. It goes round by Omega t. It also rises or falls, first order in h: the turn that an impulse of the
// floor adds to the frame, h dw, keeps the velocity that the solver has found and so takes h s (C - A) dw x axis from the momentum, where
// A dw is the impulse's own: the axis tilts by Omega sin(tilt) h s (C - A) / A = 0.02 rad/s (measured 0.024), 0.12 rad in 5 s.
TEST_CASE_TEMPLATE("a gyroscope on its tip precesses as theory has it", R, float, double) {
  double const m = 50, l = 0.3, A = 2.1, C = 4, g = 9.8, tilt = 0.314159, spin = 50, radius = 0.01;
  double const half = C * spin / (2 * A * std::cos(tilt)), omega = half - std::sqrt(half * half - m * g * l / (A * std::cos(tilt)));
  Scene<R> w(gsp_test::gyroscope(1, m, l, A, C, tilt, radius));
  double const start[6] = {-l * omega * std::sin(tilt), 0, 0, 0, omega * std::sin(tilt), spin};
  for (int i = 0; i < 6; ++i) w.state.qvel(0, i) = start[i];
  double angle = 0, last = 0, nods = 0;
  for (int i = 0; i < 2500; ++i) {
    w.run(1);
    double const q0 = w.state.qpos(0, 3), q1 = w.state.qpos(0, 4), q2 = w.state.qpos(0, 5), q3 = w.state.qpos(0, 6);
    double const x = 2 * (q1 * q3 + q0 * q2), y = 2 * (q2 * q3 - q0 * q1), heading = std::atan2(x, -y);
    angle += std::remainder(heading - last, 2 * M_PI);
    last = heading;
    nods = std::fmax(nods, std::abs(std::asin(std::hypot(x, y)) - tilt));
  }
  MESSAGE(name_of<R>() << ": precession " << angle / (5 * omega) - 1 << " off, nods by " << nods << " rad, " << w.sweeps / 2500
                       << " sweeps a step");
  CHECK(std::abs(angle / (5 * omega) - 1) < 0.01);
  CHECK(nods < 0.15);
}
