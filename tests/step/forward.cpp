#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/constraint/contact_forces.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"
#include "support/kokkos_tools.hpp"

namespace {
template <class View>
bool same_bits(View const& a, View const& b) {
  auto const x = gsp_test::host(a), y = gsp_test::host(b);
  return x.span() == y.span() && std::memcmp(x.data(), y.data(), x.span() * sizeof(*x.data())) == 0;
}
gsp::Description falling_robot() {
  auto d = gsp::samples::quadruped_scene();
  return d;
}
}  // namespace

// The same launches in the same order: no tolerance.
TEST_CASE_TEMPLATE("forward and advance are a step, with the same bits", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 5;
  for (bool const constraints : {true, false})
    for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
      auto d = falling_robot();
      d.option.constraint = constraints;
      auto const compiled = gsp::compile(d);
      auto const model = gsp::make_model<double>(exec, compiled, {.profile = profile});
      auto const begin = [&] {
        auto state = gsp::make_state(exec, model, {.worlds = worlds});
        auto const qvel = gsp_test::host(state.qvel);
        for (int w = 0; w < worlds; ++w) qvel(w, 2) = -0.3 * w;
        Kokkos::deep_copy(state.qvel, qvel);
        return state;
      };
      auto state = begin(), other = begin();
      auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds}),
           theirs = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
      CHECK_THROWS_AS(gsp::advance(exec, model, state, sim), std::invalid_argument);
      for (int i = 0; i < 150; ++i) {
        gsp::forward(exec, model, state, sim);
        gsp::advance(exec, model, state, sim);
        gsp::step(exec, model, other, theirs, {.poses = false});
      }
      CHECK(same_bits(state.qpos, other.qpos));
      CHECK(same_bits(state.qvel, other.qvel));
      CHECK(same_bits(sim.solution.qfrc_constraint, theirs.solution.qfrc_constraint));
      CHECK_THROWS_AS(gsp::advance(exec, model, state, sim), std::invalid_argument);  // the state has moved on
      auto const q = gsp_test::host(state.qpos);
      CHECK(std::isfinite(q(worlds - 1, 2)));
      if (constraints) CHECK(q(0, 2) > 0.05);  // it lies on the floor
    }
}

TEST_CASE_TEMPLATE("forward moves nothing, waits for its pools, and leaves forces that may be read", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const compiled = gsp::compile(falling_robot());
  auto const model = gsp::make_model<double>(exec, compiled);
  int const worlds = 3;
  auto state = gsp::make_state(exec, model, {.worlds = worlds}), before = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::step(exec, model, state, sim, {.steps = 400});
  Kokkos::deep_copy(before.qpos, state.qpos), Kokkos::deep_copy(before.qvel, state.qvel);
  sim.contacts =
      gsp::make_contacts(exec, sim.collision, {.worlds = worlds, .contacts_per_world = 1, .points_per_box_pair = 4, .steady = true});
  sim.rows = gsp::make_rows(exec, model, {.worlds = worlds, .rows_per_world = 1, .entries_per_world = 1});
  sim.impulses = gsp::make_impulses(exec, sim.rows);
  gsp::forward(exec, model, state, sim);
  CHECK(same_bits(before.qpos, state.qpos));
  CHECK(same_bits(before.qvel, state.qvel));
  Kokkos::View<double* [6], Kokkos::LayoutRight, typename Exec::memory_space> force("force", sim.contacts.dist.extent(0));
  gsp::contact_forces(exec, model, sim.collision, sim.contacts, sim.rows, sim.impulses, force);
  exec.fence();
  CHECK(sim.contacts.dist.extent(0) > worlds);  // it has grown
  gsp::launch_step(exec, model, state, sim);
  CHECK_THROWS_WITH_AS(gsp::forward(exec, model, state, sim), doctest::Contains("gsp::forward: steps were launched"),
                       std::invalid_argument);
  CHECK(gsp::settle(exec, sim) == 0);
  auto four = gsp::make_state(exec, model, {.worlds = 4});
  CHECK_THROWS_WITH_AS(gsp::forward(exec, model, four, sim), doctest::Contains("gsp::forward: the state has 4 worlds, the simulation 3"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::forward(exec, model, state, sim, {.solver = {.iterations = -1}}), doctest::Contains("gsp::forward: solver"),
                       std::invalid_argument);
}

// MuJoCo's RK4 has its forces of the start of the step too. The first evaluation is one of Euler's: the same accelerations.
TEST_CASE_TEMPLATE("with RK4 forward is the first evaluation, and a step goes on by itself", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto d = falling_robot();
  auto const euler = gsp::compile(d);
  d.option.integrator = gsp::Integrator::rk4;
  auto const rk4 = gsp::compile(d);
  gsp::Profile const profile = gsp::Profile::mujoco;
  auto const model = gsp::make_model<double>(exec, rk4, {.profile = profile}),
             plain = gsp::make_model<double>(exec, euler, {.profile = profile});
  auto state = gsp::make_state(exec, model), other = gsp::make_state(exec, plain);
  auto sim = gsp::make_simulation(exec, model, rk4), theirs = gsp::make_simulation(exec, plain, euler);
  gsp::step(exec, model, state, sim, {.steps = 300});
  Kokkos::deep_copy(other.qpos, state.qpos), Kokkos::deep_copy(other.qvel, state.qvel);
  Kokkos::deep_copy(other.qpos_low, state.qpos_low);
  gsp::forward(exec, model, state, sim);
  gsp::forward(exec, plain, other, theirs);
  auto const a = gsp_test::host(sim.solution.z), b = gsp_test::host(theirs.solution.z);
  for (int i = 0; i < model.nv; ++i) CHECK(a(0, i) == doctest::Approx(b(0, i)).epsilon(1e-9));
  CHECK_THROWS_WITH_AS(gsp::advance(exec, model, state, sim), doctest::Contains("RK4"), std::invalid_argument);
  gsp::step(exec, model, state, sim);
  CHECK(gsp_test::host(state.status)(0) == 0);
}
