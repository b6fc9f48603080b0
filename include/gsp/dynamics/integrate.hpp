#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/detail/integrate_lanes.hpp>
#include <gsp/dynamics/factor.hpp>
#include <gsp/parallel/detail/for_items.hpp>

/// Semi-implicit Euler: new velocities from the constraints' impulses, then positions with the new velocities.
namespace gsp {

/// What the constraints leave for the end of a step.
template <class R, class Mem>
struct ConstraintOutcome {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R**> z = {};                        // (world, nv) whitened impulses; empty: none
  View<R**> qfrc_constraint = {};          // (world, nv) out: J^T p / h [N, N m]; empty: not asked for
  Kokkos::View<int const, Mem> halt = {};  // nothing happens while it holds non-zero, as the step has to be repeated; empty: never
};

namespace detail {
/// Free velocities of this state as it is now, and sizes of what constraints leave.
template <class R, class Mem>
void expects_end(char const* where, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics,
                 ConstraintOutcome<R, Mem> const& constraints) {
  auto const& [z, qfrc_constraint, halt] = constraints;
  expects_fit(where, model, state, dynamics);
  if (z.data()) expects_rows(where, "z", z, state.worlds, model.nv);
  if (qfrc_constraint.data()) expects_rows(where, "qfrc_constraint", qfrc_constraint, state.worlds, model.nv);
  expects_of(where, dynamics, state, set_of(Quantity::velocity, Quantity::factor, Quantity::free_velocity, Quantity::activation_rate));
  expects_without_impulses(where, dynamics);
  if (!z.data() && leaves_stiff_forces(dynamics))
    throw std::invalid_argument(std::string(where) +
                                ": stiff springs and servos were left to rows (stiff_rows), and no rows have been solved: call assemble "
                                "and pgs, or smooth_dynamics without stiff_rows");
}
}  // namespace detail

/// Ends the step: state.qvel and state.qpos become those of the end, state.steps goes up by one. A world whose new velocity is not finite
/// stays as it was, and says so in state.status (status::not_finite), and so does one with a velocity or position beyond state_bound
/// (status::unbounded); clear the bit to try again.
/// After factor (or smooth_dynamics) and, where there are constraints, pgs. What the dynamics hold is then of the state before the step.
/// @param constraints  what enters of the constraints; {}: none
/// Does not allocate, does not fence. Errors: std::invalid_argument where the dynamics hold nothing of this state as it is now.
template <ExecutionSpace Exec, class R, class Mem>
void integrate(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Dynamics<R, Mem>& dynamics,
               ConstraintOutcome<R, Mem> constraints = {}) {
  Region const region("gsp::dynamics::integrate");
  auto const& [z, qfrc_constraint, halt] = constraints;
  detail::expects_end("gsp::integrate", model, state, dynamics, constraints);
  bool const again = detail::factors_again(model);
  if (again) detail::expects_of("gsp::integrate", dynamics, state, detail::set_of(Quantity::mass, Quantity::force));
  if (again && detail::any_archetype(model, [](Archetype const& a) { return a.derivative > 0; }))
    detail::expects_complete("gsp::integrate", dynamics, state, Quantity::derivative, 3);
  if (again) detail::loses(dynamics, detail::set_of(Quantity::factor, Quantity::derivative));  // another matrix takes their place
  detail::moves_on(state);
  if (model.ntree == 1) {
    for_lanes("gsp::dynamics::integrate", exec, model, dynamics, detail::OneTreeStage<State<R, Mem>>{state, z, qfrc_constraint, halt});
    return;
  }
  for_lanes("gsp::dynamics::new_velocity", exec, model, dynamics, detail::NewVelocityStage<State<R, Mem>>{state, z, qfrc_constraint, halt});
  for_lanes("gsp::dynamics::integrate", exec, model, dynamics, detail::IntegrateStage<State<R, Mem>>{state, halt});
  detail::for_items("gsp::dynamics::count_step", exec, state.worlds, detail::CountStep<Mem>{state.steps, state.status, halt});
}

/// The first half of `integrate`: what the dynamics hold as velocity without constraints becomes the new velocity; the state stays. For
/// integrators of your own (runge_kutta.hpp). Sets the status of worlds whose new velocity is not finite or not bounded. Does not allocate,
/// does not fence. Errors: those of integrate; profile mujoco's implicit integrators.
template <ExecutionSpace Exec, class R, class Mem>
void new_velocity(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Dynamics<R, Mem>& dynamics,
                  ConstraintOutcome<R, Mem> constraints) {
  Region const region("gsp::dynamics::new_velocity");
  auto const& [z, qfrc_constraint, halt] = constraints;
  expects(!detail::factors_again(model),
          "gsp::new_velocity: this integrator factors a matrix of its own: call integrate, or choose RK4 or profile stable");
  detail::expects_end("gsp::new_velocity", model, state, dynamics, constraints);
  detail::set_has_impulses(dynamics);
  for_lanes("gsp::dynamics::new_velocity", exec, model, dynamics, detail::NewVelocityStage<State<R, Mem>>{state, z, qfrc_constraint, halt});
}

/// The same with what a solver found (solver/solution.hpp) and the progress of the step (constraint/progress.hpp);
/// solution.qfrc_constraint: out, J^T p / h [N, N m]. Errors also: a solution that is not of this state as it is now.
template <ExecutionSpace Exec, class R, class Mem, class Solution, class Progress>
requires requires(Solution const& s, Progress const& p) {
  s.z;
  s.qfrc_constraint;
  p.halt;
}
void integrate(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Dynamics<R, Mem>& dynamics, Progress const& progress,
               Solution& solution) {
  if constexpr (requires { solution.stamp().own; })
    if (solution.stamp.data() && !solution.stamp().own && !solution.stamp().state.is_of(state))
      throw std::invalid_argument(std::string("gsp::integrate: the impulses of the solution ") +
                                  solution.stamp().state.fault(state.qpos.data()) +
                                  ": call assemble and pgs (profile mujoco: newton) first, or integrate without a solution");
  integrate(exec, model, state, dynamics, ConstraintOutcome<R, Mem>{solution.z, solution.qfrc_constraint, progress.halt});
}

}  // namespace gsp
