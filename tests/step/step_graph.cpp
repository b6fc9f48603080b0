// Steps that are launched as a graph are those of `step`, to the bit, whatever changes between them.
#include <doctest/doctest.h>

#include <gsp/constraint/contact_forces.hpp>
#include <gsp/model/world_values.hpp>
#include <gsp/step/step_graph.hpp>
#include <gsp_test_execs.hpp>

#include "step/everything.hpp"

namespace test_types {
/// Pulls dof `dof` back to where `place` says, of a user's own.
template <class R, class Mem>
struct Spring : gsp::OneFreeRow {
  int dof;
  Kokkos::View<R*, Mem> place;
  KOKKOS_FUNCTION int count(int) const { return 1; }
  template <class T>
  KOKKOS_FUNCTION T lambda(int, int, int, T x, T u) const {
    return -T(200) * x - T(20) * u;
  }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int, int, int, Row&& J) const {
    J.set_dof(dof, R(1));
    return place(0);
  }
};
}  // namespace test_types

namespace {

template <class R, class Exec>
struct World : gsp_test::World<R, Exec> {
  using Base = gsp_test::World<R, Exec>;
  using Base::exec, Base::model, Base::sim, Base::state;
  World(gsp::CompiledModel const& c, int worlds, bool sleep, gsp::Profile profile) : Base(c, worlds, {.profile = profile}) {
    sim = gsp::make_simulation(exec, model, c, {.worlds = worlds, .sleep = sleep});
    sim.rows = gsp::make_rows(exec, model, {.worlds = worlds, .rows_per_world = 1, .entries_per_world = 1});  // pools that grow
    sim.impulses = gsp::make_impulses(exec, sim.rows);
    if (sim.newton.worlds > 0) sim.newton = gsp::make_newton(exec, sim.rows);
    gsp_test::start(*this);
  }
  auto all() const {
    std::vector<std::vector<R>> out;
    auto const add = [&](auto const& view) {
      auto const h = gsp_test::snapshot(view);
      out.emplace_back(h.data(), h.data() + h.size());
    };
    for (auto const& view : {state.qpos, state.qvel, state.qpos_low, state.act, sim.solution.qfrc_constraint}) add(view);
    add(sim.poses.xpos);
    auto const steps = gsp_test::host(state.steps);
    out.push_back({R(steps(0))});
    return out;
  }
};

/// What may happen between steps, the same for both.
template <class W>
void change(W& w, int part) {
  using R = typename decltype(w.state)::real_type;
  if (part == 1) {  // values alone
    auto const ctrl = gsp_test::snapshot(w.state.ctrl);
    for (int i = 0; i < int(ctrl.extent(1)); ++i) ctrl(0, i) = R(0.1 * i);
    Kokkos::deep_copy(w.state.ctrl, ctrl);
  } else if (part == 2) {  // the model's numbers lie elsewhere
    gsp::make_per_world(w.exec, w.model, {gsp::ModelField::dof_damping}, w.state.worlds);
  } else if (part == 3) {
    w.model.timestep *= R(0.5);
  } else if (part == 4) {
    gsp::reset(w.exec, w.model, w.state);
  }
}

template <class R, class Exec>
void equals_step(bool sleep, gsp::Profile profile) {
  CAPTURE(sleep);
  CAPTURE(int(profile));
  auto const compiled = gsp_test::everything();
  World<R, Exec> a(compiled, 3, sleep, profile), b(compiled, 3, sleep, profile);
  gsp::StepGraph graph(b.exec, b.model, b.state, b.sim);
  int recorded = 0;
  for (int part = 0; part < 5; ++part) {
    CAPTURE(part);
    change(a, part);
    change(b, part);
    for (int const steps : {1, 30, 2}) {
      gsp::step(a.exec, a.model, a.state, a.sim, {.steps = steps});
      graph.step(steps);
      CHECK(a.all() == b.all());
    }
    if constexpr (gsp::is_device<Exec>) {
      CHECK(graph.recorded() > recorded == (part != 1 && part != 4));  // values do not ask for another
      recorded = graph.recorded();
    } else {
      CHECK(graph.recorded() == 0);
    }
  }
}

}  // namespace

TEST_CASE_TEMPLATE("steps of a graph are those of step, to the bit", Exec, GSP_TEST_EXECS) {
  for (bool const sleep : {false, true})
    for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
      equals_step<float, Exec>(sleep, profile);
      equals_step<double, Exec>(sleep, profile);
    }
}

TEST_CASE_TEMPLATE("a graph takes types of one's own and options, and reads what their views show", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  auto const compiled = gsp_test::everything();
  World<double, Exec> a(compiled, 2, false, gsp::Profile::stable), b(compiled, 2, false, gsp::Profile::stable);
  gsp::LaunchOptions const options{.solver = {.iterations = 7}};
  Kokkos::View<double*, Mem> const place("place", 1);
  test_types::Spring<double, Mem> const spring{{}, 2, place};
  gsp::StepGraph graph(b.exec, b.model, b.state, b.sim, options, spring);
  for (int part = 0; part < 3; ++part) {
    Kokkos::deep_copy(place, 0.1 * part);
    gsp::step(a.exec, a.model, a.state, a.sim, {.steps = 20, .solver = options.solver}, spring);
    graph.step(20);
    CHECK(a.all() == b.all());
  }
  World<double, Exec> without(compiled, 2, false, gsp::Profile::stable);
  gsp::step(without.exec, without.model, without.state, without.sim, {.steps = 60, .solver = options.solver});
  CHECK(a.all() != without.all());
}

// The host knows of which state everything is, as after `launch_step`.
TEST_CASE_TEMPLATE("what a graph leaves is stamped", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  auto const compiled = gsp_test::everything();
  World<float, Exec> w(compiled, 2, false, gsp::Profile::stable);
  gsp::StepGraph graph(w.exec, w.model, w.state, w.sim);
  graph.step(100);
  int const most = w.sim.contacts.capacity();
  Kokkos::View<float* [6], Kokkos::LayoutRight, Mem> force("force", most);
  auto const read = [&] { gsp::contact_forces(w.exec, w.model, w.sim.collision, w.sim.contacts, w.sim.rows, w.sim.impulses, force); };
  auto const assembles = [&] {
    gsp::assemble(w.exec, w.model, w.state, w.sim.dynamics, gsp::constraints(gsp::JointFriction(w.model)), w.sim.rows, w.sim.impulses,
                  w.sim.progress);
  };
  CHECK_NOTHROW(read());
  gsp::smooth_dynamics(w.exec, w.model, w.state, w.sim.poses, w.sim.dynamics);
  CHECK_NOTHROW(assembles());
  graph.launch(3);
  CHECK_THROWS_WITH_AS(read(), doctest::Contains("call settle"), std::invalid_argument);
  CHECK(gsp::settle(w.exec, w.sim) == 0);
  CHECK_NOTHROW(read());
  CHECK_THROWS_WITH_AS(assembles(), doctest::Contains("before its last step"), std::invalid_argument);
  CHECK_THROWS_AS(graph.launch(-1), std::invalid_argument);
}
