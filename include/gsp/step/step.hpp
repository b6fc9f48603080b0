#pragma once
#include <gsp/collision/contacts.hpp>
#include <gsp/constraint/assemble.hpp>
#include <gsp/constraint/contact_rows.hpp>
#include <gsp/constraint/joint_friction.hpp>
#include <gsp/constraint/joint_limit.hpp>
#include <gsp/constraint/tendon.hpp>
#include <gsp/dynamics/runge_kutta.hpp>
#include <gsp/dynamics/smooth.hpp>
#include <gsp/solver/pgs.hpp>
#include <gsp/step/simulation_refusals.hpp>

/// A ready-made simulation loop, written with public functions alone: copy it and change it.
namespace gsp {

/// Everything that a step needs besides the model and the state.
template <class R, class Mem>
struct Simulation {
  CollisionModel<R, Mem> collision;
  Dynamics<R, Mem> dynamics;
  Poses<R, Mem> poses;  // of the start of the last step; forward_kinematics brings them up to date
  Contacts<R, Mem> contacts;
  Rows<R, Mem> rows;
  RungeKutta<R, Mem> runge_kutta = {};  // integrator RK4 of profile mujoco, else empty
};

namespace detail {
template <class R, class Mem>
bool has_runge_kutta(Model<R, Mem> const& model) {
  return model.profile == Profile::mujoco && model.integrator == Integrator::rk4 && !model.constraints;
}
}  // namespace detail

struct SimulationOptions {
  int worlds = 1;
  bool approximate = false;  // equalities are left out; profile mujoco: box friction stands in for the cones, and Euler for RK4
};

/// Buffers for stepping `worlds` worlds of `model`, which was made from `compiled`. Allocates.
/// Errors: gsp::Error where profile `mujoco` is asked for what it does not cover yet (friction cones, integrator RK4 with constraints), and
/// in all profiles for active equality constraints (unless approximate), and limits and dry friction of spatial tendons.
template <class R, ExecutionSpace Exec, class Mem>
Simulation<R, Mem> make_simulation(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled,
                                   SimulationOptions options = {}) {
  auto const refusals = simulation_refusals(compiled, {.profile = model.profile, .approximate = options.approximate});
  if (!refusals.empty()) throw Error(refusals.front());
  int const n = options.worlds;
  auto collision = make_collision_model<R>(exec, compiled);
  auto contacts = make_contacts(exec, collision, {.worlds = n});
  return {collision,
          make_dynamics(exec, model, {.worlds = n}),
          make_poses(exec, model, {.worlds = n}),
          contacts,
          make_rows(exec, model, {.worlds = n}),
          detail::has_runge_kutta(model) ? make_runge_kutta(exec, model, {.worlds = n}) : RungeKutta<R, Mem>{}};
}

struct StepOptions {
  int steps = 1;
  PgsOptions solver = {};
};

namespace detail {
/// One step, launched; it does nothing where something did not fit (rows.halt).
template <ExecutionSpace Exec, class R, class Mem, class... More>
void launch_step(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Simulation<R, Mem> const& sim,
                 PgsOptions const& solver, More const&... more) {
  if (has_runge_kutta(model)) return runge_kutta(exec, model, state, sim.dynamics, sim.poses, sim.runge_kutta);
  if (!model.constraints) return smooth_step(exec, model, state, sim.dynamics, sim.poses);
  smooth_dynamics(exec, model, state, sim.dynamics, sim.poses);
  collide(exec, sim.collision, sim.poses, sim.contacts);
  assemble(exec, model, state, sim.dynamics, sim.rows, JointFriction(model), TendonFriction(model), JointLimits(model, state),
           TendonLimits(model, state), ContactRows(model, sim.collision, sim.contacts), more...);
  pgs(exec, model, sim.rows, solver);
  integrate(exec, model, sim.dynamics, sim.rows, state);
}
}  // namespace detail

/// Steps all worlds `options.steps` times: smooth dynamics, contacts, rows, solver, integration.
/// @param more  constraint types of your own (constraint_type.hpp)
/// Where a pool is too small, the launches after that do nothing, the pool grows, and the rest is repeated: so the function fences once at
/// its end, and no result depends on a capacity. Allocates only then.
template <ExecutionSpace Exec, class R, class Mem, class... More>
void step(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Simulation<R, Mem>& sim, StepOptions options = {},
          More const&... more) {
  expects(options.steps >= 0, "gsp::step: steps must not be negative");
  expects(sim.rows.worlds == state.worlds, "gsp::step: state and simulation have different numbers of worlds");
  for (int left = options.steps; left > 0;) {
    // the number of steps done is counted where the rows are: a launch that halted has done nothing
    detail::zero(exec, sim.rows.completed);
    for (int i = 0; i < left; ++i) detail::launch_step(exec, model, state, sim, options.solver, more...);
    if (!model.constraints) {
      exec.fence("gsp::step: done");
      return;
    }
    int halt = 0, completed = 0;
    detail::download_bytes(exec, &halt, sim.rows.halt.data(), sizeof halt);
    detail::download_bytes(exec, &completed, sim.rows.completed.data(), sizeof completed);
    exec.fence("gsp::step: the host reads whether all has fitted");
    left -= completed;
    if (!halt) continue;
    bool const contacts = grow(exec, sim.contacts), rows = grow(exec, sim.rows);
    if (!contacts && !rows) throw Error("gsp::step: a step did not fit, and no pool needs to grow: this is a defect of the library");
  }
}

}  // namespace gsp
