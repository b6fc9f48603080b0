#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"

namespace {

template <class R, class Exec>
struct World {
  using Mem = typename Exec::memory_space;
  Exec exec;
  gsp::CompiledModel compiled;
  gsp::Model<R, Mem> model;
  gsp::State<R, Mem> state;
  gsp::Simulation<R, Mem> sim;
  World(gsp::CompiledModel const& c, int worlds, gsp::ModelOptions options = {})
      : compiled(c),
        model(gsp::make_model<R>(exec, c, options)),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        sim(gsp::make_simulation(exec, model, c, {.worlds = worlds})) {}
  void step(int n, gsp::PgsOptions solver = {}) { gsp::step(exec, model, state, sim, {.steps = n, .solver = solver}); }
  auto qpos() const { return gsp_test::host(state.qpos); }
  auto qvel() const { return gsp_test::host(state.qvel); }
  /// The keyframe in all worlds, and a small push that differs from world to world.
  void start(int keyframe, int first_world = 0) {
    auto const q = qpos(), v = qvel(), u = gsp_test::host(state.ctrl);
    for (int w = 0; w < state.worlds; ++w) {
      auto const& k = compiled.keyframes.at(keyframe);
      for (std::size_t i = 0; i < k.qpos.size(); ++i) q(w, i) = R(k.qpos[i]);
      for (std::size_t i = 0; i < k.ctrl.size(); ++i) u(w, i) = R(k.ctrl[i]);
      for (int i = 0; i < model.nv; ++i) v(w, i) = R(0.3 * std::sin(1.7 * i + 0.9 * (w + first_world)));
    }
    Kokkos::deep_copy(state.qpos, q), Kokkos::deep_copy(state.qvel, v), Kokkos::deep_copy(state.ctrl, u);
  }
};

template <class View>
bool same_bits(View const& a, View const& b, int row_a, int row_b) {
  return std::memcmp(&a(row_a, 0), &b(row_b, 0), sizeof(a(0, 0)) * a.extent(1)) == 0;
}

}  // namespace

// Semi-implicit Euler in closed form: after n steps v = -g n h, z = z0 - g h^2 n (n + 1) / 2. Rounding: n additions of relative eps each.
TEST_CASE_TEMPLATE("free fall", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  gsp::BodyDescription ball;
  ball.parent = 0, ball.pos = {0, 0, 5};
  ball.joints.emplace_back().type = gsp::JointType::free;
  ball.geoms.emplace_back().size = {0.1, 0, 0};
  d.bodies.push_back(ball);
  World<double, Exec> w(gsp::compile(d), 3);
  int const n = 400;
  w.step(n);
  double const h = 0.002, v = -9.81 * n * h, z = 5 - 9.81 * h * h * n * (n + 1) / 2;
  for (int k = 0; k < 3; ++k) {
    CHECK(std::abs(w.qvel()(k, 2) - v) < n * 1e-15 * 10);
    CHECK(std::abs(w.qpos()(k, 2) - z) < n * 1e-15 * 10);
    CHECK(gsp_test::host(w.state.steps)(k) == n);
  }
}

// Bar of the project: ten boxes, profile stable, 5 ms, float: between 2 s and 60 s they drift less than 1 mm, and none falls.
TEST_CASE("a stack of ten boxes rests") {
  World<float, Kokkos::DefaultHostExecutionSpace> w(gsp::compile(gsp::samples::stack(10)), 1, {.timestep = 0.005});
  w.step(400);
  auto const before = gsp_test::host(w.state.qpos);
  std::vector<float> start(before.data(), before.data() + before.size());
  w.step(58 * 200);
  auto const after = w.qpos();
  double drift = 0;
  for (int b = 0; b < 10; ++b)
    for (int c = 0; c < 3; ++c) drift = std::fmax(drift, std::abs(double(after(0, 7 * b + c)) - start[7 * b + c]));
  MESSAGE("drift " << drift << " m, top at " << after(0, 65) << " m");
  CHECK(drift < 1e-3);
  CHECK(after(0, 65) > 1.85);
}

// Bar of the project: tan 0.25, mu 0.5: between 2 s and 10 s the box creeps slower than 1e-7 m/s, in float.
TEST_CASE("a box on a ramp does not creep") {
  World<float, Kokkos::DefaultHostExecutionSpace> w(gsp::compile(gsp::samples::ramp(0.25, 0.5)), 1);
  w.step(1000);
  auto const q = w.qpos();
  auto const low = gsp_test::host(w.state.qpos_low);
  double start[3];
  for (int c = 0; c < 3; ++c) start[c] = double(q(0, c)) + low(0, c);
  w.step(4000);
  auto const q2 = w.qpos();
  auto const low2 = gsp_test::host(w.state.qpos_low);
  double creep = 0;
  for (int c = 0; c < 3; ++c) creep += std::pow(double(q2(0, c)) + low2(0, c) - start[c], 2);
  creep = std::sqrt(creep) / 8;
  MESSAGE("creep " << creep << " m/s");
  CHECK(creep < 1e-7);
  // it slides where friction is too small: a = g (sin - mu cos)
  World<double, Kokkos::DefaultHostExecutionSpace> s(gsp::compile(gsp::samples::ramp(0.25, 0.1)), 1);
  s.step(1000);
  double const angle = std::atan(0.25), speed = 9.81 * 2 * (std::sin(angle) - 0.1 * std::cos(angle));
  auto const v = s.qvel();
  CHECK(std::sqrt(v(0, 0) * v(0, 0) + v(0, 1) * v(0, 1) + v(0, 2) * v(0, 2)) == doctest::Approx(speed).epsilon(0.02));
}

// A world's result depends on nothing but its own state: not on the batch, on how steps are split over calls, on pool sizes or on threads.
TEST_CASE_TEMPLATE("same bits for any batch, split and capacity", Exec, GSP_TEST_EXECS) {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  World<float, Exec> all(compiled, 21);
  all.start(0);
  all.step(40);
  auto const q = all.qpos(), v = all.qvel();
  for (int w : {0, 7, 20}) {
    World<float, Exec> one(compiled, 1);
    one.start(0, w);
    one.sim.contacts = gsp::make_contacts(one.exec, one.sim.collision,
                                          {.worlds = 1, .candidates_per_world = 1, .points_per_world = 1, .contacts_per_world = 1});
    one.sim.rows = gsp::make_rows(one.exec, one.model, {.worlds = 1, .rows_per_world = 1, .entries_per_world = 1});
    for (int i = 0; i < 40; i += 8) one.step(8);
    auto const q1 = one.qpos(), v1 = one.qvel();
    CHECK(same_bits(q1, q, 0, w));
    CHECK(same_bits(v1, v, 0, w));
    CHECK(gsp_test::host(one.state.status)(0) == 0);
  }
}

TEST_CASE_TEMPLATE("the quadruped stands", Exec, GSP_TEST_EXECS) {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  World<float, Exec> w(compiled, 2);
  auto const& k = compiled.keyframes.at(0);
  auto const q = w.qpos(), u = gsp_test::host(w.state.ctrl);
  for (int i = 0; i < 2; ++i) {
    for (std::size_t j = 0; j < k.qpos.size(); ++j) q(i, j) = float(k.qpos[j]);
    for (std::size_t j = 0; j < k.ctrl.size(); ++j) u(i, j) = float(k.ctrl[j]);
  }
  Kokkos::deep_copy(w.state.qpos, q), Kokkos::deep_copy(w.state.ctrl, u);
  w.step(1500);
  auto const after = w.qpos();
  MESSAGE("trunk from " << k.qpos[2] << " to " << after(0, 2));
  CHECK(std::abs(after(0, 2) - k.qpos[2]) < 0.05);
  CHECK(std::abs(after(0, 3)) > 0.98);
}
