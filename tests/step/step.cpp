#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <gsp/constraint/contact_forces.hpp>
#include <gsp/constraint/joint_forces.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>

#include "step/random_scene.hpp"
#include "step/world.hpp"

namespace test_types {
/// Spring on dof `dof`, of a user's own.
template <class Mem>
struct Tether : gsp::OneFreeRow {
  double stiffness, damping;
  int dof;
  typename gsp::State<double, Mem>::template View<double**> qpos;
  KOKKOS_FUNCTION int count(int) const { return 1; }
  template <class T>
  KOKKOS_FUNCTION T lambda(int, int, int, T x, T u) const {
    return -(stiffness * x + damping * u);
  }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int world, int, int, Row&& J) const {
    J.set_dof(dof, 1.);
    return qpos(world, dof);
  }
};
/// A rope on dof 0 that pulls below -length alone: its law has a slope there, and none above, where a constant force is left.
template <class R, class Mem>
struct Rope : gsp::OneFreeRow {
  R stiffness, damping, length, lift;
  typename gsp::State<R, Mem>::template View<R**> qpos;
  KOKKOS_FUNCTION int count(int) const { return 1; }
  template <class T>
  KOKKOS_FUNCTION T lambda(int, int, int, T x, T u) const {
    return x < T(-length) ? lift - (stiffness * (x + length) + damping * u) : T(lift);
  }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int world, int, int, Row&& J) const {
    J.set_dof(0, R(1));
    return qpos(world, 0);
  }
};
/// Pushes with `factor` times the control.
struct Push {
  double factor;
  template <class T>
  KOKKOS_FUNCTION T force(gsp::WorldLane<T> const&, int, T control, T, T) const {
    return T(factor) * control;
  }
};
}  // namespace test_types

namespace {
/// A body of 2 kg with these joints, and what it has on top of a plane.
gsp::Description one_body(std::vector<gsp::JointDescription> const& joints) {
  gsp::Description d;
  gsp::BodyDescription b;
  b.parent = 0;
  b.name = "b";
  b.has_inertial = true;
  b.inertial.mass = 2;
  b.inertial.inertia = {0.1, 0.1, 0.1, 0, 0, 0};
  b.joints = joints;
  d.bodies.push_back(b);
  return d;
}
gsp::JointDescription joint(gsp::JointType type, std::array<double, 3> const& axis) {
  gsp::JointDescription j;
  j.type = type;
  j.axis = axis;
  return j;
}
template <class View>
void set(View const& view, int world, std::vector<double> const& values) {
  auto const h = gsp_test::host(view);
  for (std::size_t i = 0; i < values.size(); ++i) h(world, i) = values[i];
  Kokkos::deep_copy(view, h);
}

template <class R, class Exec>
struct World : gsp_test::World<R, Exec> {
  using Base = gsp_test::World<R, Exec>;
  using Base::Base;
  using Base::compiled, Base::model, Base::qpos, Base::qvel, Base::state;
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

// tan 0.25, mu 0.5: between 2 s and 10 s the box creeps slower than 1e-9 m/s, in float (the project's bar for double).
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
  CHECK(creep < 1e-9);
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
    auto small = gsp::contacts_options(one.model, 1);
    small.candidates_per_world = small.points_per_world = small.contacts_per_world = 1;
    one.sim.contacts = gsp::make_contacts(one.exec, one.sim.collision, small);
    one.sim.rows = gsp::make_rows(one.exec, one.model, {.worlds = 1, .rows_per_world = 1, .entries_per_world = 1});
    one.sim.impulses = gsp::make_impulses(one.exec, one.sim.rows);
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

// The poses that a step leaves are those of the state that it leaves, to the bit, whether or not anything had to be repeated.
TEST_CASE_TEMPLATE("a step leaves poses of the state that it leaves", Exec, GSP_TEST_EXECS) {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  for (bool contacts : {true, false}) {
    auto c = compiled;
    c.option.constraint = contacts;
    World<float, Exec> w(c, 3);
    w.start(0);
    w.sim.rows = gsp::make_rows(w.exec, w.model, {.worlds = 3, .rows_per_world = 1, .entries_per_world = 1});
    w.sim.impulses = gsp::make_impulses(w.exec, w.sim.rows);
    w.step(5);
    auto const left = gsp_test::snapshot(w.sim.poses.xpos), turned = gsp_test::snapshot(w.sim.poses.xquat);
    gsp::forward_kinematics(w.exec, w.model, w.state, w.sim.poses, w.sim.dynamics);
    auto const now = gsp_test::host(w.sim.poses.xpos), rotation = gsp_test::host(w.sim.poses.xquat);
    CHECK(std::memcmp(left.data(), now.data(), left.size() * sizeof(float)) == 0);
    CHECK(std::memcmp(turned.data(), rotation.data(), turned.size() * sizeof(float)) == 0);
    CHECK(gsp_test::host(w.state.steps)(2) == 5);
  }
}

// On a GPU contacts and rows are found beside forces where nothing forbids it: tendons, springs, mocap bodies, servos, of random scenes.
TEST_CASE_TEMPLATE("the side queue of a GPU changes no bit", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int scenes = 0;
  for (std::uint64_t seed = 1; seed <= (gsp::is_device<Exec> ? 24 : 3); ++seed) {
    CAPTURE(seed);
    gsp::CompiledModel compiled;
    try {
      compiled = gsp::compile(gsp_test::random_scene(seed));
    } catch (gsp::Error const&) { continue; }
    for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco})
      for (int const worlds : {1, 3}) {
        auto const run = [&](bool beside) {
          auto const model = gsp::make_model<float>(exec, compiled, {.profile = profile});
          auto state = gsp::make_state(exec, model, {.worlds = worlds});
          auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
          if (!beside) sim.side = {};
          auto const qvel = Kokkos::create_mirror_view(Kokkos::HostSpace{}, state.qvel);
          for (int w = 0; w < worlds; ++w)
            for (int i = 0; i < model.nv; ++i) qvel(w, i) = 0.1f * float((7 * i + 3 * w) % 11 - 5);
          Kokkos::deep_copy(state.qvel, qvel);
          gsp::step(exec, model, state, sim, {.steps = 25});
          if (!gsp::detail::has_runge_kutta(model)) {
            gsp::forward(exec, model, state, sim);
            gsp::advance(exec, model, state, sim);
          }
          std::vector<float> bits;
          std::array const views{state.qpos, state.qvel, state.qpos_low};
          for (auto const& view : views) {
            auto const h = gsp_test::host(view);
            for (int w = 0; w < worlds; ++w)
              for (int i = 0; i < int(h.extent(1)); ++i) bits.push_back(h(w, i));
          }
          return bits;
        };
        try {
          auto const a = run(true), b = run(false);
          CHECK(a.size() == b.size());
          CHECK(std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0);
          ++scenes;
        } catch (gsp::Error const&) {}  // what a profile refuses
      }
  }
  CHECK(scenes >= (gsp::is_device<Exec> ? 40 : 4));
}

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
// Steps that a stream has recorded are those that it takes (docs/gpu.md): of few islands, of many, of one tree, of more rows than fit in a
// Delassus matrix.
TEST_CASE("a CUDA graph of steps changes no bit") {
  cudaStream_t stream;
  REQUIRE(cudaStreamCreate(&stream) == cudaSuccess);
  auto const check = [&](gsp::Description const& description, int worlds) {
    CAPTURE(worlds);
    Kokkos::Cuda const exec(stream);
    auto const compiled = gsp::compile(description);
    auto const run = [&](bool recorded) {
      auto const model = gsp::make_model<float>(exec, compiled);
      auto state = gsp::make_state(exec, model, {.worlds = worlds});
      auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
      gsp::step(exec, model, state, sim, {.steps = 200});  // pools have grown
      int const each = 10, times = 5;
      if (recorded) {
        cudaGraph_t graph;
        cudaGraphExec_t program;
        REQUIRE(cudaStreamBeginCapture(stream, cudaStreamCaptureModeRelaxed) == cudaSuccess);
        for (int i = 0; i < each; ++i) gsp::launch_step(exec, model, state, sim);
        REQUIRE(cudaStreamEndCapture(stream, &graph) == cudaSuccess);
        REQUIRE(cudaGraphInstantiate(&program, graph, 0) == cudaSuccess);
        for (int i = 0; i < times; ++i) REQUIRE(cudaGraphLaunch(program, stream) == cudaSuccess);
        exec.fence();
        cudaGraphExecDestroy(program);
        cudaGraphDestroy(graph);
      } else {
        for (int i = 0; i < each * times; ++i) gsp::launch_step(exec, model, state, sim);
      }
      CHECK(gsp::settle(exec, sim) == 0);
      return std::pair{gsp_test::snapshot(state.qpos), gsp_test::snapshot(state.qvel)};
    };
    auto const a = run(true), b = run(false);
    int wrong = 0;
    for (int w = 0; w < worlds; ++w) wrong += !same_bits(a.first, b.first, w, w) || !same_bits(a.second, b.second, w, w);
    CHECK(wrong == 0);
  };
  check(gsp::samples::quadruped_scene(), 1);
  check(gsp::samples::quadruped_scene(), 64);
  check(gsp::samples::quadruped_scene(), 400);
  check(gsp::samples::quadruped(), 64);
  check(gsp::samples::stack(20), 8);
  cudaStreamDestroy(stream);
}
#endif

// `step` is launch_step and settle: the same bits, the steps that did not fit told by settle.
TEST_CASE_TEMPLATE("launch and settle", Exec, GSP_TEST_EXECS) {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  World<float, Exec> a(compiled, 4), b(compiled, 4);
  a.start(0);
  b.start(0);
  b.sim.rows = gsp::make_rows(b.exec, b.model, {.worlds = 4, .rows_per_world = 1, .entries_per_world = 1});
  b.sim.impulses = gsp::make_impulses(b.exec, b.sim.rows);
  a.step(12);
  int repeated = 0, launched = 0;
  for (int left = 12; left > 0;) {
    for (int i = 0; i < left; ++i) gsp::launch_step(b.exec, b.model, b.state, b.sim);
    launched += left;
    left = gsp::settle(b.exec, b.sim);
    repeated += left;
  }
  CHECK(repeated > 0);
  CHECK(launched == 12 + repeated);
  auto const q = a.qpos(), q2 = b.qpos();
  for (int w = 0; w < 4; ++w) CHECK(same_bits(q, q2, w, w));
  CHECK(gsp_test::host(b.state.steps)(3) == 12);
}

// Whose cone of friction a loop of one's own has is said, where the file has one.
TEST_CASE("a loop of one's own names the cone of profile mujoco") {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    World<float, Kokkos::DefaultHostExecutionSpace> w(compiled, 1, {.profile = profile});
    auto const types = [&](auto... cone) {
      return gsp::model_constraints(w.model, w.state, w.sim.poses, w.sim.dynamics, w.sim.collision, w.sim.contacts, cone...);
    };
    if (profile == gsp::Profile::stable)
      CHECK_NOTHROW((void)types());
    else
      CHECK_THROWS_WITH_AS((void)types(), doctest::Contains("give compiled.option.cone"), std::invalid_argument);
    CHECK_NOTHROW((void)types(compiled.option.cone));
  }
}

// Options that no solver can keep are refused also where the profile has the other solver.
TEST_CASE_TEMPLATE("options of the solvers are checked in both profiles", Exec, GSP_TEST_EXECS) {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    World<float, Exec> w(compiled, 1, {.profile = profile});
    w.start(0);
    auto const refused = [&](gsp::LaunchOptions const& options, char const* why) {
      CHECK_THROWS_WITH_AS(gsp::launch_step(w.exec, w.model, w.state, w.sim, options), doctest::Contains(why), std::invalid_argument);
      CHECK_THROWS_AS(gsp::step(w.exec, w.model, w.state, w.sim, {.solver = options.solver, .newton = options.newton}),
                      std::invalid_argument);
    };
    refused({.solver = {.iterations = -3}}, "gsp::step: solver (PgsOptions): iterations must be positive");
    refused({.solver = {.tolerance = NAN}}, "solver (PgsOptions): tolerance must be a number, 0 or more");
    refused({.solver = {.relaxation = 2}}, "solver (PgsOptions): relaxation must be above 0 and below 2");
    refused({.solver = {.relaxation = NAN}}, "relaxation must be above 0 and below 2");
    refused({.newton = {.iterations = 0}}, "gsp::step: newton (NewtonOptions): iterations must be positive");
    refused({.newton = {.tolerance = -1}}, "newton (NewtonOptions): tolerance must be a number, 0 or more");
    CHECK(gsp_test::host(w.state.steps)(0) == 0);
    w.step(1);
    CHECK(gsp_test::host(w.state.steps)(0) == 1);
  }
}

// The same of profile mujoco, where a step may be cut off after one of RK4's evaluations: its state goes back to where the step began.
TEST_CASE_TEMPLATE("steps of profile mujoco that do not fit are done again", Exec, GSP_TEST_EXECS) {
  auto description = gsp::samples::quadruped_scene();
  for (auto const integrator : {gsp::Integrator::euler, gsp::Integrator::rk4}) {
    description.option.integrator = integrator;
    auto const compiled = gsp::compile(description);
    World<double, Exec> a(compiled, 4, {.profile = gsp::Profile::mujoco}), b(compiled, 4, {.profile = gsp::Profile::mujoco});
    a.start(0);
    b.start(0);
    a.step(60);
    for (int left = 60, rows = 1; left > 0;) {
      if (rows <= 60) {  // pools that the next landing outgrows, in whichever evaluation
        b.sim.rows = gsp::make_rows(b.exec, b.model, {.worlds = 4, .rows_per_world = rows, .entries_per_world = 10 * rows});
        b.sim.impulses = gsp::make_impulses(b.exec, b.sim.rows);
        rows += 12;
      }
      int const now = std::min(left, 7);
      for (int i = 0; i < now; ++i) gsp::launch_step(b.exec, b.model, b.state, b.sim);
      left -= now - gsp::settle(b.exec, b.sim);
    }
    auto const q = a.qpos(), q2 = b.qpos();
    CHECK(gsp_test::host(b.state.steps)(3) == 60);
    // Pools that are made anew have no impulses to start from; both solve to rounding.
    for (int w = 0; w < 4; ++w)
      for (int i = 0; i < a.model.nq; ++i) CHECK(q(w, i) == doctest::Approx(q2(w, i)).epsilon(1e-9));
  }
}

// A user's constraint acts where the model's own are disabled (closed form: the spring at rest), with RK4 too.
TEST_CASE_TEMPLATE("a constraint of one's own never disappears", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  auto d = one_body({joint(gsp::JointType::slide, {0, 0, 1})});
  d.option.constraint = false;
  World<double, Exec> w(gsp::compile(d), 2);
  double const k = 500;
  gsp::step(w.exec, w.model, w.state, w.sim, {.steps = 4000}, test_types::Tether<Mem>{{}, k, 60., 0, w.state.qpos});
  CHECK(std::abs(w.qpos()(1, 0) + 2 * 9.81 / k) < 1e-12);
  d.option.integrator = gsp::Integrator::rk4;
  World<double, Exec> rk(gsp::compile(d), 2, {.profile = gsp::Profile::mujoco});
  gsp::step(rk.exec, rk.model, rk.state, rk.sim, {.steps = 4000}, test_types::Tether<Mem>{{}, k, 60., 0, rk.state.qpos});
  CHECK(std::abs(rk.qpos()(1, 0) + 2 * 9.81 / k) < 1e-12);
}

// Slack, it lets fall, and a constant force lifts; taut, it holds the weight. 100 sums of 1e-2 in double: 1e-14; in float, of places: 1e-6.
TEST_CASE_TEMPLATE("a rope of one's own hangs slack, then taut", Exec, GSP_TEST_EXECS) {
  auto const c = gsp::compile(one_body({joint(gsp::JointType::slide, {0, 0, 1})}));
  double const k = 500, length = 0.3, h = c.option.timestep;
  auto const check = [&](auto zero, double rounding, gsp::Profile profile, double lift) {
    using R = decltype(zero);
    World<R, Exec> w(c, 2, {.profile = profile});
    test_types::Rope<R, typename Exec::memory_space> const rope{{}, R(k), R(60), R(length), R(lift), w.state.qpos};
    gsp::StepOptions options{.steps = 100};
    options.solver.residual = options.newton.residual = true;
    gsp::step(w.exec, w.model, w.state, w.sim, options, rope);
    CHECK(std::abs(w.qpos()(1, 0) - (lift / 2 - 9.81) * h * h * 5050) < rounding);
    CHECK(gsp_test::host(w.sim.solution.residual)(1) < 100 * rounding);
    options.steps = 4000;
    gsp::step(w.exec, w.model, w.state, w.sim, options, rope);
    CHECK(std::abs(w.qpos()(1, 0) + length + (2 * 9.81 - lift) / k) < 100 * rounding);
  };
  for (auto profile : {gsp::Profile::stable, gsp::Profile::mujoco})
    for (double lift : {0., 3.}) {
      check(0., 1e-14, profile, lift);
      check(0.f, 1e-6, profile, lift);
    }
}

TEST_CASE_TEMPLATE("disabled constraints stay disabled beside one of one's own", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  auto d = one_body({joint(gsp::JointType::slide, {0, 0, 1})});
  d.bodies[1].joints[0].frictionloss = 1e3;
  d.option.constraint = false;
  World<double, Exec> w(gsp::compile(d), 2);
  double const k = 500;
  gsp::step(w.exec, w.model, w.state, w.sim, {.steps = 4000}, test_types::Tether<Mem>{{}, k, 60., 0, w.state.qpos});
  CHECK(std::abs(w.qpos()(1, 0) + 2 * 9.81 / k) < 1e-12);  // dry friction would hold it at 0
}

// What is not finite, a control of an actuator with activation too, stops its world as it was, with all integrators; mended, it goes on.
TEST_CASE_TEMPLATE("a world that stops stays as it was before the step", Exec, GSP_TEST_EXECS) {
  auto d = one_body({joint(gsp::JointType::slide, {0, 0, 1}), joint(gsp::JointType::ball, {0, 0, 1})});
  d.bodies[1].joints[0].name = "lift";
  d.actuators.push_back({.name = "lift", .target_name = "lift", .dynamics = gsp::ActuatorDynamics::filter});
  d.actuators[0].dynprm[0] = 0.1;
  for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco})
    for (auto const integrator : {gsp::Integrator::euler, gsp::Integrator::implicitfast, gsp::Integrator::rk4}) {
      d.option.integrator = integrator;
      for (bool const control : {true, false}) {
        World<double, Exec> w(gsp::compile(d), 3, {.profile = profile});
        w.may_stop = true;
        Kokkos::deep_copy(w.state.ctrl, 0.5);
        w.step(10);
        auto const q = gsp_test::snapshot(w.state.qpos), v = gsp_test::snapshot(w.state.qvel), a = gsp_test::snapshot(w.state.act);
        set(control ? w.state.ctrl : w.state.qfrc_applied, 1, {NAN});
        w.step(3);
        auto const status = gsp_test::host(w.state.status);
        auto const steps = gsp_test::host(w.state.steps);
        CHECK(status(1) == gsp::status::not_finite);
        CHECK(steps(1) == 10);
        CHECK(steps(2) == 13);
        CHECK(same_bits(q, gsp_test::snapshot(w.state.qpos), 1, 1));
        CHECK(same_bits(v, gsp_test::snapshot(w.state.qvel), 1, 1));
        CHECK(same_bits(a, gsp_test::snapshot(w.state.act), 1, 1));
        set(control ? w.state.ctrl : w.state.qfrc_applied, 1, {control ? 0.5 : 0.});
        Kokkos::deep_copy(w.state.status, 0u);
        w.step(3);
        CHECK(gsp_test::host(w.state.steps)(1) == 13);
      }
    }
}

// What stops a world may lie in its last tree, after others are through.
TEST_CASE_TEMPLATE("a world of several trees stops as a whole", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  for (int k = 0; k < 3; ++k) gsp_test::add_free(d, {2. * k, 0, 1}, gsp_test::geom(gsp::ShapeType::sphere, {0.1, 0, 0}, 1));
  for (bool const constraint : {true, false})
    for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco})
      for (auto const integrator : {gsp::Integrator::euler, gsp::Integrator::implicitfast, gsp::Integrator::rk4}) {
        d.option.integrator = integrator;
        d.option.constraint = constraint;
        World<double, Exec> w(gsp::compile(d), 3, {.profile = profile});
        w.may_stop = true;
        w.step(10);
        auto const q = gsp_test::snapshot(w.state.qpos), v = gsp_test::snapshot(w.state.qvel);
        std::vector<double> last(std::size_t(w.model.nv), 0.);
        last.back() = NAN;
        auto const force = gsp_test::host(w.state.qfrc_applied);
        for (int i = 0; i < w.model.nv; ++i) force(1, i) = last[std::size_t(i)];
        Kokkos::deep_copy(w.state.qfrc_applied, force);
        w.step(2);
        CAPTURE(constraint);
        CAPTURE(int(profile));
        CAPTURE(int(integrator));
        CHECK(gsp_test::host(w.state.status)(1) == gsp::status::not_finite);
        CHECK(gsp_test::host(w.state.steps)(2) == 12);
        CHECK(same_bits(q, gsp_test::snapshot(w.state.qpos), 1, 1));
        CHECK(same_bits(v, gsp_test::snapshot(w.state.qvel), 1, 1));
      }
}

// Constraints of one's own come and go: without them nobody asks what their rows were.
TEST_CASE_TEMPLATE("a step without constraints after one with them", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  auto d = one_body({joint(gsp::JointType::slide, {0, 0, 1})});
  d.option.constraint = false;
  World<double, Exec> w(gsp::compile(d), 2);
  w.may_stop = true;
  test_types::Tether<Mem> tether{{}, 500., 60., 0, w.state.qpos}, refused = tether;
  refused.stiffness = NAN;
  gsp::launch_step(w.exec, w.model, w.state, w.sim, {}, tether);
  CHECK_THROWS_WITH_AS(gsp::launch_step(w.exec, w.model, w.state, w.sim), doctest::Contains("call settle(exec, sim) first"),
                       std::invalid_argument);
  CHECK(gsp::settle(w.exec, w.sim) == 0);
  gsp::step(w.exec, w.model, w.state, w.sim, {}, refused);
  CHECK(gsp_test::host(w.state.status)(0) == (gsp::status::row_refused | gsp::status::refused_law));
  w.step(3);
  CHECK(gsp_test::host(w.state.status)(0) == 0);
  CHECK(gsp_test::host(w.state.steps)(0) == 4);
}

// NaN in any one number of qpos: a rotation is no exception.
TEST_CASE_TEMPLATE("a place that is no number stops its world", Exec, GSP_TEST_EXECS) {
  for (auto type : {gsp::JointType::free, gsp::JointType::ball, gsp::JointType::hinge})
    for (auto profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
      World<double, Exec> w(gsp::compile(one_body({joint(type, {0, 0, 1})})), 9, {.profile = profile});
      w.may_stop = true;
      int const nq = w.model.nq;
      auto const q = gsp_test::host(w.state.qpos);
      for (int i = 0; i < nq; ++i) q(i, i) = NAN;
      Kokkos::deep_copy(w.state.qpos, q);
      auto const before = gsp_test::snapshot(w.state.qpos);
      w.step(2);
      auto const status = gsp_test::host(w.state.status);
      for (int i = 0; i < 9; ++i) {
        CAPTURE(i);
        CHECK(status(i) == (i < nq ? gsp::status::not_finite : 0u));
        if (i < nq) CHECK(same_bits(before, gsp_test::snapshot(w.state.qpos), i, i));
      }
    }
}

TEST_CASE_TEMPLATE("no step leaves poses of the state too", Exec, GSP_TEST_EXECS) {
  World<double, Exec> w(gsp::compile(one_body({joint(gsp::JointType::slide, {0, 0, 1})})), 2);
  set(w.state.qpos, 1, {0.25});
  w.step(0);
  CHECK(gsp_test::host(w.sim.poses.xpos)(1, 1, 2) == 0.25);
}

// An actuator law acts with a constraint of one's own beside it (closed form: k q = 3 u - m g at rest), before or behind it, and alone in
// the ways of a step without constraints: v = h (3 u / m - g) after the first, the same to h^4 for RK4 under constant forces.
TEST_CASE_TEMPLATE("an actuator law of one's own in a step", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  auto d = one_body({joint(gsp::JointType::slide, {0, 0, 1})});
  d.bodies[1].joints[0].name = "lift";
  d.actuators.push_back({.name = "lift", .target_name = "lift"});
  double const k = 500, u = 2;
  test_types::Push const push{3};
  {
    World<double, Exec> w(gsp::compile(d), 2);
    test_types::Tether<Mem> const tether{{}, k, 60., 0, w.state.qpos};
    Kokkos::deep_copy(w.state.ctrl, u);
    gsp::step(w.exec, w.model, w.state, w.sim, {.steps = 2000}, push, tether);
    gsp::step(w.exec, w.model, w.state, w.sim, {.steps = 2000}, tether, push);
    CHECK(std::abs(w.qpos()(1, 0) - (3 * u - 2 * 9.81) / k) < 1e-12);
  }
  d.option.constraint = false;
  for (auto integrator : {gsp::Integrator::euler, gsp::Integrator::rk4}) {
    d.option.integrator = integrator;
    World<double, Exec> w(gsp::compile(d), 2, {.profile = gsp::Profile::mujoco});
    Kokkos::deep_copy(w.state.ctrl, u);
    gsp::step(w.exec, w.model, w.state, w.sim, {}, push);
    CHECK(w.qvel()(1, 0) == doctest::Approx(w.model.timestep * (3 * u / 2 - 9.81)).epsilon(1e-14));
  }
}

// Worlds of the mask go back, the others keep every bit; what is reset starts without the impulses of before: it repeats its first steps to
// the bit.
TEST_CASE_TEMPLATE("reset of single worlds", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  World<float, Exec> w(compiled, 5), start(compiled, 1), many(compiled, 5);
  start.start(0);
  many.start(0);
  w.start(0);
  Kokkos::View<bool*, Mem> const mask("mask", 5);
  auto const chosen = Kokkos::create_mirror_view(mask);
  for (int i = 0; i < 5; ++i) chosen(i) = i == 1 || i == 3;
  Kokkos::deep_copy(mask, chosen);
  w.step(10);
  auto const q10 = gsp_test::snapshot(w.state.qpos);
  w.step(20);
  auto const before = gsp_test::snapshot(w.state.qpos);
  SUBCASE("to one state each") {
    gsp::reset(w.exec, w.model, w.state, mask, many.state);
    auto const now = gsp_test::snapshot(w.state.qpos);
    auto const s = w.qpos();
    auto const began = many.qpos();
    for (int i = 0; i < 5; ++i) {
      bool const back = i == 1 || i == 3;
      CHECK(std::memcmp(&now(i, 0), back ? &began(i, 0) : &before(i, 0), sizeof(float) * now.extent(1)) == 0);
      CHECK(gsp_test::host(w.state.steps)(i) == (back ? 0 : 30));
    }
    w.step(10);
    auto const again = w.qpos();
    for (int i : {1, 3}) CHECK(std::memcmp(&again(i, 0), &q10(i, 0), sizeof(float) * again.extent(1)) == 0);
  }
  SUBCASE("to one state for all, and to the model's") {
    gsp::reset(w.exec, w.model, w.state, mask, start.state);
    auto const s = start.qpos(), now = w.qpos();
    CHECK(same_bits(now, s, 1, 0));
    CHECK(same_bits(now, s, 3, 0));
    gsp::reset(w.exec, w.model, w.state, mask);
    auto const q = w.qpos();
    for (std::size_t i = 0; i < compiled.qpos0.size(); ++i) CHECK(q(3, i) == float(compiled.qpos0[i]));
    CHECK(gsp_test::host(w.state.ctrl)(3, 0) == 0);
    CHECK(std::memcmp(&q(2, 0), &before(2, 0), sizeof(float) * q.extent(1)) == 0);
  }
  SUBCASE("sizes") {
    CHECK_THROWS_AS(gsp::reset(w.exec, w.model, w.state, Kokkos::View<bool*, Mem>("short", 4)), std::invalid_argument);
    World<float, Exec> const two(compiled, 2);
    CHECK_THROWS_AS(gsp::reset(w.exec, w.model, w.state, mask, two.state), std::invalid_argument);
  }
}

// A point mass that slides over a plane, at rest in the normal direction: the normal force is the weight; friction is mu N against the slip
// (J = body 2 - body 1), in every direction, so that a slide keeps its heading to rounding; what acts on the joints is the frame times the
// force.
TEST_CASE_TEMPLATE("contact forces in every direction", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  auto d =
      one_body({joint(gsp::JointType::slide, {1, 0, 0}), joint(gsp::JointType::slide, {0, 1, 0}), joint(gsp::JointType::slide, {0, 0, 1})});
  d.bodies[1].pos = {0, 0, 0.1};
  gsp::GeomDescription ball, plane;
  ball.size = {0.1, 0, 0};
  d.bodies[1].geoms.push_back(ball);
  plane.type = gsp::ShapeType::plane;
  plane.size = {0, 0, 1};
  d.bodies[0].geoms.push_back(plane);
  for (auto* body : {&d.bodies[0], &d.bodies[1]}) body->geoms[0].friction = std::array{0.4, 0.005, 0.0001};
  int const worlds = 17;
  World<double, Exec> w(gsp::compile(d), worlds);
  w.step(5000);
  auto const start = gsp_test::host(w.state.qvel);
  for (int i = 0; i < worlds - 1; ++i) {
    double const heading = 2 * M_PI * (i + 0.3) / (worlds - 1);
    start(i, 0) = std::cos(heading), start(i, 1) = std::sin(heading);  // the last world stays at rest, and is pushed below
  }
  Kokkos::deep_copy(w.state.qvel, start);
  auto const v = gsp_test::snapshot(w.state.qvel);
  set(w.state.qfrc_applied, worlds - 1, {3, -2, 0});
  w.step(1);
  Kokkos::View<double* [6], Kokkos::LayoutRight, Mem> force("force", w.sim.contacts.dist.extent(0));
  gsp::contact_forces(w.exec, w.model, w.sim.collision, w.sim.contacts, w.sim.rows, w.sim.impulses, force);
  auto const f = gsp_test::host(force);
  auto const after = gsp_test::host(w.state.qvel), qfrc = gsp_test::host(w.sim.solution.qfrc_constraint);
  auto const frame = gsp_test::host(w.sim.contacts.frame);
  double const m = 2, N = m * 9.81, h = 0.002;
  for (int i = 0; i < worlds; ++i) {
    int const c = gsp_test::host(w.sim.contacts.first)(i);
    CAPTURE(i);
    CHECK(f(c, 0) == doctest::Approx(N).epsilon(1e-9));  // 10 s of a critically damped contact of 0.02 s
    for (int t = 0; t < 2; ++t) {
      double slip = 0;
      for (int k = 0; k < 3; ++k) slip += frame(c, 3 * (t + 1) + k) * v(i, k);
      if (i < worlds - 1) CHECK(f(c, 1 + t) == doctest::Approx(-0.4 * f(c, 0) * slip).epsilon(1e-9));  // slip: of length 1
    }
    for (int k = 0; k < 3; ++k) {
      double world = 0;
      for (int r = 0; r < 3; ++r) world += frame(c, 3 * r + k) * f(c, r);
      CHECK(qfrc(i, k) == doctest::Approx(world).epsilon(1e-9));
      double const applied = i < worlds - 1 || k == 2 ? 0 : k == 0 ? 3 : -2;
      CHECK(std::abs(after(i, k) - v(i, k) - h * (world + applied - (k == 2 ? N : 0)) / m) < 1e-13);
      if (i == worlds - 1 && k < 2) CHECK(std::abs(world + applied) < 1e-9);  // sticks
    }
    for (int r = 3; r < 6; ++r) CHECK(f(c, r) == 0);
  }
}

// Forces read back at rest: a limit carries what is pressed against it, dry friction what it holds, a spring its own law, in both profiles;
// qfrc_constraint is their sum.
TEST_CASE_TEMPLATE("forces of limits, dry friction and a constraint of one's own", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  auto d = one_body({joint(gsp::JointType::slide, {1, 0, 0}), joint(gsp::JointType::slide, {0, 1, 0}),
                     joint(gsp::JointType::slide, {0, 0, 1}), joint(gsp::JointType::ball, {1, 0, 0})});
  d.option.gravity = {0, 0, 0};
  auto& joints = d.bodies[1].joints;
  joints[0].limited = true, joints[0].range = {-0.1, 0.2}, joints[0].damping = 30;
  joints[1].frictionloss = 5;
  joints[2].damping = 10;
  joints[3].limited = true, joints[3].range = {0, 0.3}, joints[3].damping = 1;
  double const k = 400;
  for (auto profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    World<double, Exec> w(gsp::compile(d), 3, {.profile = profile});
    set(w.state.qfrc_applied, 1, {7, 3, 2, 0.4, 0.3, 0});
    set(w.state.qfrc_applied, 2, {-6, -2, -1, 0, 0, 0});
    test_types::Tether<Mem> const tether{{}, k, 5., 2, w.state.qpos};
    gsp::step(w.exec, w.model, w.state, w.sim, {.steps = 6000, .solver = {.iterations = 1000, .tolerance = 5e-13f}}, tether);
    Kokkos::View<double**, Kokkos::LayoutRight, Mem> limit("limit", 3, w.model.njnt), friction("friction", 3, w.model.nv);
    gsp::joint_forces(w.exec, w.model, w.sim.rows, w.sim.impulses, limit, friction);
    Kokkos::View<double*, Mem> const spring("spring", 3);
    auto const read = gsp::impulses_of<test_types::Tether<Mem>>(w.sim.rows, w.sim.impulses);
    auto const absent = gsp::impulses_of<test_types::Rope<double, Mem>>(w.sim.rows, w.sim.impulses);
    Kokkos::parallel_for(
        "gsp::test::read", Kokkos::RangePolicy<Exec>(w.exec, 0, 3),
        KOKKOS_LAMBDA(int i) { spring(i) = read(i, 0) + absent(i, 0) + read(i, 0, 1); });
    auto const l = gsp_test::host(limit), f = gsp_test::host(friction), q = gsp_test::host(w.sim.solution.qfrc_constraint);
    auto const s = gsp_test::host(spring);
    double const h = 0.002;
    CHECK(l(0, 0) == 0);
    CHECK(l(1, 0) == doctest::Approx(7).epsilon(1e-9));
    CHECK(l(2, 0) == doctest::Approx(6).epsilon(1e-9));
    CHECK(f(1, 1) == doctest::Approx(-3).epsilon(1e-6));
    CHECK(f(2, 1) == doctest::Approx(2).epsilon(1e-6));
    CHECK(f(1, 0) == 0);
    CHECK(s(0) / h == doctest::Approx(0));
    CHECK(s(1) / h == doctest::Approx(-2).epsilon(1e-9));
    CHECK(s(2) / h == doctest::Approx(1).epsilon(1e-9));
    CHECK(l(1, 3) == doctest::Approx(0.5).epsilon(1e-6));  // |(0.4, 0.3, 0)|, about the axis of the rotation
    CHECK(l(2, 3) == 0);
    for (int i = 0; i < 3; ++i) {
      double const applied[6] = {i == 1 ? 7. : i == 2 ? -6. : 0.,
                                 i == 1 ? 3. : i == 2 ? -2. : 0.,
                                 i == 1 ? 2. : i == 2 ? -1. : 0.,
                                 i == 1 ? 0.4 : 0.,
                                 i == 1 ? 0.3 : 0.,
                                 0};
      for (int dof = 0; dof < 6; ++dof) CHECK(std::abs(q(i, dof) + applied[dof]) < 1e-5);
    }
  }
}
