#pragma once
#include <algorithm>
#include <gsp/collision/contacts.hpp>
#include <gsp/constraint/assemble.hpp>
#include <gsp/constraint/contact_adhesion.hpp>
#include <gsp/constraint/contact_rows.hpp>
#include <gsp/constraint/equality.hpp>
#include <gsp/constraint/joint_friction.hpp>
#include <gsp/constraint/joint_limit.hpp>
#include <gsp/constraint/stiff_forces.hpp>
#include <gsp/constraint/tendon.hpp>
#include <gsp/dynamics/runge_kutta.hpp>
#include <gsp/dynamics/smooth.hpp>
#include <gsp/model/model_refusals.hpp>
#include <gsp/parallel/detail/side_queue.hpp>
#include <gsp/solver/impacts.hpp>
#include <gsp/solver/newton.hpp>
#include <gsp/solver/noslip.hpp>
#include <gsp/solver/pgs.hpp>
#include <gsp/step/sleep.hpp>
#include <optional>
#include <tuple>
#include <utility>

/// A ready-made simulation loop. To be changed: examples/06_own_loop.cpp, which has the same bits of public functions alone.
namespace gsp {

/// Everything that a step needs besides the model and the state.
template <class R, class Mem>
struct Simulation {
  CollisionModel<R, Mem> collision;
  Dynamics<R, Mem> dynamics;
  Poses<R, Mem> poses;  // after `step`: of the state that it left; after `launch_step`: of the state before
  Contacts<R, Mem> contacts;
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Solution<R, Mem> solution;
  Progress<Mem> progress;
  Newton<R, Mem> newton = {};           // profile mujoco, else empty
  RungeKutta<R, Mem> runge_kutta = {};  // integrator RK4 of profile mujoco, else empty
  Sleep<R, Mem> sleep = {};             // where islands sleep, else empty
  FrictionCone cone = FrictionCone::elliptic;
  NoslipOptions noslip = {};         // profile mujoco: as the file says
  detail::SideQueue<Mem> side = {};  // GPUs: for what a step does side by side; of one host thread at a time, as all of this
};

/// The constraint types of MJCF, in the order of their rows, the springs and servos that are too stiff for a step, and yours: what `step`
/// assembles.
/// @param cone  of friction: elliptic where none is given, in profile stable; profile mujoco takes the file's, compiled.option.cone
/// Errors: std::invalid_argument where none is given in profile mujoco.
template <class R, class Mem, class... More>
auto model_constraints(Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses, Dynamics<R, Mem> const& dynamics,
                       CollisionModel<R, Mem> const& collision, Contacts<R, Mem> const& contacts, std::optional<FrictionCone> cone = {},
                       More const&... more) {
  expects(cone || model.profile == Profile::stable,
          "gsp::model_constraints: profile mujoco has the file's cone of friction: give compiled.option.cone");
  return constraints(Equalities(model, state, poses, dynamics), JointFriction(model), TendonFriction(model, dynamics),
                     JointLimits(model, state), TendonLimits(model, dynamics), ContactAdhesion(model, contacts, dynamics),
                     ContactRows(model, state, collision, contacts, cone.value_or(FrictionCone::elliptic)),
                     StiffForces(model, state, dynamics), more...);
}
template <class R, class Mem>
using ModelConstraints = decltype(model_constraints(std::declval<Model<R, Mem>&>(), std::declval<State<R, Mem>&>(),
                                                    std::declval<Poses<R, Mem>&>(), std::declval<Dynamics<R, Mem>&>(),
                                                    std::declval<CollisionModel<R, Mem>&>(), std::declval<Contacts<R, Mem>&>()));

struct SimulationOptions {
  int worlds = 1;
  std::optional<FrictionCone> cone = {};  // as the file says in profile mujoco, else elliptic
  std::optional<bool> sleep = {};         // islands that rest sleep (step/sleep.hpp); empty: as the file says (<flag sleep>), so not
  bool impacts = false;                   // rows of your own may have a restitution; whether contacts have, the model says
  double friction_time = 0;               // of contacts, as a spring [s] (RowsOptions)
};

/// The contacts and rows that `make_simulation` makes, for loops of your own, which have the same bits then.
template <class R, class Mem>
ContactsOptions contacts_options(Model<R, Mem> const& model, int worlds) {
  bool const stable = model.profile == Profile::stable;
  return {.worlds = worlds, .points_per_box_pair = stable ? 4 : 8, .steady = stable};
}
/// @param impacts  rows of your own may have a restitution
template <class R, class Mem>
RowsOptions rows_options(Model<R, Mem> const& model, CollisionModel<R, Mem> const& collision, int worlds, bool impacts = false) {
  return {.worlds = worlds, .impacts = impacts || collision.bounces || model.limits_bounce};
}

/// How rows are solved for: each profile has its solver.
struct LaunchOptions {
  PgsOptions solver = {};     // profile stable
  NewtonOptions newton = {};  // profile mujoco; ends_step is launch_step's own
};

struct StepOptions {
  int steps = 1;
  PgsOptions solver = {};  // as in LaunchOptions
  NewtonOptions newton = {};
  bool poses = true;  // leave simulation.poses of the end: one launch of forward_kinematics a call
};

namespace detail {
/// Of what a user gives a step besides: the actuator laws, and the rest.
template <bool laws, class One>
auto one_of_laws(One const& one) {
  if constexpr (ActuatorLaw<One> == laws)
    return std::tuple<One>(one);
  else
    return std::tuple<>();
}
template <bool laws, class... More>
auto all_of_laws(More const&... more) {
  return std::tuple_cat(one_of_laws<laws>(more)...);
}
/// The host does not know whether the step has fitted before it waits.
template <class R, class Mem>
void leaves_launched(Simulation<R, Mem> const& sim) {
  if (sim.impulses.stamp.data()) sim.impulses.stamp().launched = true;
}
template <class R, class Mem>
bool has_runge_kutta(Model<R, Mem> const& model) {
  return model.profile == Profile::mujoco && model.integrator == Integrator::rk4;
}
/// Edges of a pyramid are soft.
inline void expects_soft_contacts(CompiledModel const& compiled) {
  auto const is_hard = [](auto const& pair) { return pair.rigid.hard; };
  bool const geoms = std::any_of(compiled.geom_hard.begin(), compiled.geom_hard.end(), [](int hard) { return hard != 0; });
  if (geoms || std::any_of(compiled.named_pairs.begin(), compiled.named_pairs.end(), is_hard))
    throw Error(
        "gsp::make_simulation: some geoms or pairs are hard, and pyramids of friction are soft: choose FrictionCone::elliptic or box, or "
        "leave hard out");
}
/// impacts and pgs in profile stable; Newton's method in profile mujoco, and noslip where the file asks for it.
template <class Exec, class R, class Mem>
void solve(Exec const& exec, Model<R, Mem> const& model, Simulation<R, Mem>& sim, LaunchOptions const& options, bool warm, bool ends_step) {
  if (model.profile == Profile::stable) {
    impacts(exec, sim.progress, sim.rows, sim.impulses, sim.solution);
    return pgs(exec, sim.rows, sim.impulses, sim.solution, sim.progress, options.solver);
  }
  NewtonOptions own = options.newton;
  own.warm = own.warm && warm;
  own.ends_step = ends_step;
  newton(exec, sim.rows, sim.impulses, sim.solution, sim.newton, sim.progress, own);
  if (sim.noslip.iterations > 0) noslip(exec, sim.rows, sim.impulses, sim.solution, sim.progress, sim.noslip);
}
template <class R, class Mem>
bool has_stiff_rows(Model<R, Mem> const& model) {
  return any_archetype(model, [](Archetype const& a) { return a.stiff; });  // profile stable alone
}
/// Of a step without rows: those of an earlier one are not its own.
template <class Exec, class R, class Mem>
void forget_rows(char const* where, Exec const& exec, State<R, Mem> const& state, Simulation<R, Mem> const& sim) {
  expects_settled(where, sim.impulses);
  if (sim.rows.stamp.data() && sim.rows.stamp().made)
    Kokkos::parallel_for("gsp::step::forget_rows", Kokkos::RangePolicy<Exec>(exec, 0, state.worlds), ForgetRows<Mem>{state.status});
}
/// Smooth dynamics, contacts, rows, solver.
/// @param laws, types  tuples of what a user gives besides
template <class Exec, class R, class Mem, class Laws, class... Types>
void find_impulses(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Simulation<R, Mem>& sim,
                   LaunchOptions const& options, Laws const& laws, std::tuple<Types...> const& types, bool warm, bool ends_step,
                   bool keep_all) {
  SmoothOptions const smooth{.keep_all = keep_all, .stiff_rows = has_stiff_rows(model)};
  auto const find_forces = [&](bool placed) {
    std::apply([&](auto const&... law) { launch_smooth(exec, model, state, sim.poses, sim.dynamics, smooth, placed, law...); }, laws);
  };
  auto const types_now = [&] {
    auto const list = std::apply(
        [&](auto const&... type) {
          return model_constraints(model, state, sim.poses, sim.dynamics, sim.collision, sim.contacts, sim.cone, type...);
        },
        types);
    static_assert(sizeof...(Types) > 0 || std::is_same_v<decltype(list), ModelConstraints<R, Mem> const>,
                  "gsp::kernels holds assemble for these types");
    return list;
  };
  if constexpr (is_device<Exec> && std::tuple_size_v<Laws> == 0)  // a law may read what the last step has left
    if (sim.side && sim.sleep.worlds == 0) {
      // Contacts, and which rows there are, hang on poses and velocities; forces are found beside them: neither fills a device.
      launch_place(exec, model, state, sim.poses, sim.dynamics, smooth);
      typename SideQueue<Mem>::Fork const fork(sim.side, exec);
      find_forces(true);
      act_early(model, sim.collision);
      collide(fork.exec(), sim.collision, sim.poses, sim.contacts);
      auto const list = types_now();
      Quantities reads = reads_of(list);
      if (!any_archetype(model, [](Archetype const& a) { return a.spatial; })) reads.bits &= ~set_of(Quantity::tendon_length).bits;
      if (sizeof...(Types) > 0 || smooth.stiff_rows || reads.bits != 0) {  // rows hang on forces, or may
        fork.join();
        fork.begin();
      }
      auto const join = [&] { fork.join(); };
      // So are the islands that they make of trees, where no row is eliminated and pgs is the first to list them; types of a user's may
      // read what the last step's has left.
      bool const find = sizeof...(Types) == 0 && model.profile == Profile::stable && sim.rows.islands.ntree > 1 &&
                        sim.rows.most_eliminated == 0 && !sim.rows.impact.data();
      if (find) expects_solution("gsp::step", sim.rows, sim.solution);
      auto const find_islands = [&] {
        if (find) launch_find_islands(fork.exec(), sim.rows, sim.solution, sim.progress);
      };
      assemble_in(exec, fork.exec(), join, find_islands, model, state, sim.dynamics, list, sim.rows, sim.impulses, sim.progress,
                  sim.sleep.islands);
      if (find) return pgs_in(exec, sim.rows, sim.impulses, sim.solution, sim.progress, options.solver, true);
      return solve(exec, model, sim, options, warm, ends_step);
    }
  find_forces(false);
  wake_changed(exec, model, state, sim.dynamics, sim.sleep);
  act_early(model, sim.collision);
  collide(exec, sim.collision, sim.poses, sim.contacts, still_trees(model, sim.contacts, sim.sleep));
  assemble(exec, model, state, sim.dynamics, types_now(), sim.rows, sim.impulses, sim.progress, sim.sleep.islands);
  solve(exec, model, sim, options, warm, ends_step);
}
/// The state moves on by what find_impulses has found.
template <class Exec, class R, class Mem>
void end_step(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Simulation<R, Mem>& sim) {
  integrate(exec, model, state, sim.dynamics, sim.progress, sim.solution);
  if (has_stiff_rows(model))
    subtract_stiff_forces(exec, StiffForces(model, state, sim.dynamics), sim.rows, sim.impulses, sim.progress,
                          sim.solution.qfrc_constraint);
  fall_asleep(exec, model, sim.rows, sim.progress, state, sim.dynamics, sim.solution.qfrc_constraint, sim.sleep);
}
template <class R, class Mem>
void expects_can_step(Model<R, Mem> const& model, CompiledModel const& compiled, SimulationOptions const& options) {
  expects_made_of("gsp::make_simulation", model, compiled);
  auto const refusals = model_refusals(compiled);
  if (!refusals.empty()) throw Error(refusals.front());
  bool const stable = model.profile == Profile::stable;
  if (!stable && options.cone == FrictionCone::box)
    throw Error(
        "gsp::make_simulation: profile mujoco has no box of friction: choose FrictionCone::elliptic or pyramidal, or profile stable");
  if (stable && options.cone == FrictionCone::pyramidal) expects_soft_contacts(compiled);
}
template <class R, class Mem>
void expects_worlds(char const* where, State<R, Mem> const& state, Simulation<R, Mem> const& sim) {
  expects_room(where, sim.rows);
  if (sim.rows.worlds != state.worlds)
    throw std::invalid_argument(std::string(where) + ": the state has " + std::to_string(state.worlds) + " worlds, the simulation " +
                                std::to_string(sim.rows.worlds) + ": make them with the same {.worlds = n}");
}
/// What a step finds and the next one finds anew: dynamics, contacts, rows, room of the solvers; and what it finds them with.
template <class R, class Exec, class Mem>
void make_found(Exec const& exec, Model<R, Mem> const& model, SimulationOptions const& options, Simulation<R, Mem>& sim) {
  int const n = options.worlds;
  sim.dynamics = make_dynamics(exec, model, {.worlds = n});
  sim.contacts = make_contacts(exec, sim.collision, contacts_options(model, n));
  RowsOptions rows = rows_options(model, sim.collision, n, options.impacts);
  rows.friction_time = options.friction_time;
  sim.rows = make_rows(exec, model, rows);
  sim.solution = make_solution(exec, model, {.worlds = n});
  if (model.profile != Profile::stable) sim.newton = make_newton(exec, sim.rows);
  sim.side = make_side_queue(exec);
}
/// The rest, for such rows.
template <class R, class Exec, class Mem>
void make_kept(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled, SimulationOptions const& options,
               Rows<R, Mem> const& rows, Simulation<R, Mem>& sim) {
  int const n = options.worlds;
  bool const stable = model.profile == Profile::stable;
  sim.poses = make_poses(exec, model, {.worlds = n});
  sim.impulses = make_impulses(exec, rows);
  sim.progress = make_progress(exec);
  sim.cone = options.cone.value_or(stable ? FrictionCone::elliptic : compiled.option.cone);
  if (!stable) sim.noslip = noslip_options(compiled);
  if (options.sleep.value_or(compiled.option.sleep)) sim.sleep = make_sleep(exec, model, compiled, {.worlds = n});
  if (has_runge_kutta(model)) sim.runge_kutta = make_runge_kutta(exec, model, {.worlds = n});
}
}  // namespace detail

/// Buffers for stepping `worlds` worlds of `model`, which was made from `compiled`. Allocates.
/// @param collision  the shapes of `compiled` (make_collision_model), which several simulations may share
/// Errors: gsp::Error for what make_model refuses too, for the box of friction in profile mujoco, and in profile stable for pyramids beside
/// contacts that are hard.
template <class R, ExecutionSpace Exec, class Mem>
Simulation<R, Mem> make_simulation(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled, SimulationOptions options,
                                   CollisionModel<R, Mem> const& collision) {
  static_assert(Scalar<R>,
                "gsp::make_simulation: contacts have no slopes: of duals call smooth_dynamics and integrate (docs/math/dual.md)");
  detail::expects_can_step(model, compiled, options);
  Simulation<R, Mem> sim;
  sim.collision = collision;
  detail::make_found(exec, model, options, sim);
  detail::make_kept(exec, model, compiled, options, sim.rows, sim);
  return sim;
}

/// With shapes of its own.
template <class R, ExecutionSpace Exec, class Mem>
Simulation<R, Mem> make_simulation(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled,
                                   SimulationOptions options = {}) {
  detail::expects_can_step(model, compiled, options);  // before shapes are made of it
  return make_simulation(exec, model, compiled, options, make_collision_model<R>(exec, compiled));
}

/// Launches one step of all worlds and does not wait: smooth dynamics, contacts, rows, solver, integration. Where a pool is too small it
/// and all steps launched after it do nothing; `settle` says how many, and lets the pools grow. Poses are left of the state before the
/// step; `forward_kinematics` gives those of its end. On a GPU collision, and what says which rows and islands there are, go beside forces
/// in `sim.side`.
/// @param more  of your own: constraint types (constraint_type.hpp), which act also where the model's constraints are disabled, and
///              actuator laws (dynamics/actuator_law.hpp)
/// In profile stable what bounces is solved for first (solver/impacts.hpp). In profile mujoco rows are solved by Newton's method
/// (solver/newton.hpp), and friction again by sim.noslip (solver/noslip.hpp), with RK4 four times a step, from nothing each time, so that a
/// repeated step is the same. Does not fence, nor allocate (on a CPU pgs may, as rows grow). Errors: laws without actuators; options that
/// the solvers refuse, those of the other profile too. Until `settle` nothing of the step is to be saved, no force to be read, and nothing
/// to be written or reset: steps that did not fit are repeated.
template <ExecutionSpace Exec, class R, class Mem, class... More>
void launch_step(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Simulation<R, Mem>& sim,
                 LaunchOptions const& options = {}, More const&... more) {
  Region const region("gsp::step::launch_step");
  detail::expects_worlds("gsp::step", state, sim);
  detail::expects_options("gsp::step: solver (PgsOptions)", options.solver);  // of both, whichever solver this model has
  detail::expects_options("gsp::step: newton (NewtonOptions)", options.newton);
  auto const laws = detail::all_of_laws<true>(more...);
  auto const types = detail::all_of_laws<false>(more...);
  constexpr bool own_types = (!ActuatorLaw<More> || ...);
  detail::leaves_no_rows(sim.rows, sim.impulses);  // assemble says otherwise where the step has some
  bool const runge_kutta_steps = detail::has_runge_kutta(model);
  if (!model.constraints && !own_types && !detail::has_stiff_rows(model)) {
    detail::forget_rows("gsp::step", exec, state, sim);
    return std::apply(
        [&](auto const&... law) {
          if (runge_kutta_steps)
            runge_kutta(exec, model, state, sim.poses, sim.dynamics, sim.runge_kutta, law...);
          else
            smooth_step(exec, model, state, sim.poses, sim.dynamics, law...);
        },
        laws);
  }
  if (!runge_kutta_steps) {
    detail::find_impulses(exec, model, state, sim, options, laws, types, true, true, false);
    detail::end_step(exec, model, state, sim);
    detail::leaves_launched(sim);
    return;
  }
  int evaluation = 0;
  runge_kutta(
      exec, model, state, sim.dynamics,
      [&] {
        detail::find_impulses(exec, model, state, sim, options, laws, types, false, ++evaluation == 4, false);
        new_velocity(exec, model, state, sim.dynamics, {sim.solution.z, sim.solution.qfrc_constraint, sim.progress.halt});
      },
      sim.runge_kutta, Kokkos::View<int const, Mem>(sim.progress.halt));
  detail::leaves_launched(sim);
}

/// Waits for the steps that were launched, and enlarges the pools that were too small.
/// @return  how many of the steps launched since the last call did nothing and have to be launched again
/// Fences; allocates where a pool grows. Errors: gsp::Error where a step did not fit though nothing has to grow.
template <ExecutionSpace Exec, class R, class Mem>
int settle(Exec const& exec, Simulation<R, Mem>& sim) {
  Region const region("gsp::step::settle");
  detail::expects_room("gsp::settle", sim.rows);
  int halt = 0, skipped = 0;
  detail::download_bytes(exec, &halt, sim.progress.halt.data(), sizeof halt);
  detail::download_bytes(exec, &skipped, sim.progress.skipped.data(), sizeof skipped);
  exec.fence("gsp::settle: the host reads whether all has fitted");
  if (sim.impulses.stamp.data()) sim.impulses.stamp().launched = false;
  if (!halt) return 0;
  detail::zero(exec, sim.progress.skipped);
  if (sim.impulses.stamp.data()) sim.impulses.stamp().solved = false;  // the steps that are left say so again
  bool const contacts = grow(exec, sim.contacts), rows = grow(exec, sim.rows, sim.impulses, sim.progress);
  if (sim.newton.worlds > 0) grow(exec, sim.rows, sim.newton);
  if (!contacts && !rows) throw Error("gsp::settle: a step did not fit, and no pool needs to grow: this is a defect of the library");
  return skipped;
}

/// Steps all worlds `options.steps` times and leaves the poses of the end in sim.poses. No result depends on a capacity: what did not fit
/// is done again with larger pools. Fences once at its end, and where a pool grew; allocates only then, and where pgs
/// does.
/// @param more  constraint types and actuator laws of your own, as for launch_step
template <ExecutionSpace Exec, class R, class Mem, class... More>
void step(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Simulation<R, Mem>& sim, StepOptions options = {},
          More const&... more) {
  expects(options.steps >= 0, "gsp::step: steps must not be negative");
  if (options.steps == 0 && options.poses) forward_kinematics(exec, model, state, sim.poses, sim.dynamics);
  for (int left = options.steps; left > 0; left = settle(exec, sim)) {
    for (int i = 0; i < left; ++i) launch_step(exec, model, state, sim, {.solver = options.solver, .newton = options.newton}, more...);
    if (options.poses) forward_kinematics(exec, model, state, sim.poses, sim.dynamics);
  }
}

/// All that a step finds out before it moves anything, of the state as it is: poses, smooth dynamics with keep_all, contacts, rows and
/// their impulses (MuJoCo's mj_forward). After it forces are read (contact_forces, joint_forces), accelerations, and sensors of every
/// stage. `advance` makes a step of it; `step` begins anew, from the impulses found here, so that it is the same step within the solver's
/// tolerance. With RK4 it is the first of the four evaluations.
/// @param more  constraint types and actuator laws of your own, as for launch_step
/// Fences once at its end, and where a pool grew; allocates only then, and where pgs does. Errors: those of launch_step; steps that were
/// launched and not settled.
template <ExecutionSpace Exec, class R, class Mem, class... More>
void forward(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Simulation<R, Mem>& sim, LaunchOptions const& options = {},
             More const&... more) {
  Region const region("gsp::step::forward");
  detail::expects_worlds("gsp::forward", state, sim);
  detail::expects_options("gsp::forward: solver (PgsOptions)", options.solver);
  detail::expects_options("gsp::forward: newton (NewtonOptions)", options.newton);
  detail::expects_settled("gsp::forward", sim.impulses);
  auto const laws = detail::all_of_laws<true>(more...);
  auto const types = detail::all_of_laws<false>(more...);
  constexpr bool own_types = (!ActuatorLaw<More> || ...);
  detail::leaves_no_rows(sim.rows, sim.impulses);
  if (!model.constraints && !own_types && !detail::has_stiff_rows(model)) {
    detail::forget_rows("gsp::forward", exec, state, sim);
    std::apply([&](auto const&... law) { smooth_dynamics(exec, model, state, sim.poses, sim.dynamics, {.keep_all = true}, law...); }, laws);
    return;
  }
  do {
    detail::find_impulses(exec, model, state, sim, options, laws, types, !detail::has_runge_kutta(model), true, true);
    detail::leaves_launched(sim);
  } while (settle(exec, sim) > 0);
}

/// Ends the step that `forward` has begun: the two together are launch_step, with the same bits, and between them is where MuJoCo's mj_step
/// reads its sensors: at the start of the step. Poses stay those of the start. Does not fence, does not allocate. Errors:
/// std::invalid_argument where forward was not called with this state as it is now; the integrator RK4, which evaluates more than once.
template <ExecutionSpace Exec, class R, class Mem>
void advance(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Simulation<R, Mem>& sim) {
  Region const region("gsp::step::advance");
  detail::expects_worlds("gsp::advance", state, sim);
  expects(!detail::has_runge_kutta(model), "gsp::advance: RK4 evaluates a step four times, and forward has done so once: call step");
  bool const rows = sim.rows.stamp.data() && sim.rows.stamp().made && sim.impulses.stamp().solved;
  if (!rows) return integrate(exec, model, state, sim.dynamics);
  detail::end_step(exec, model, state, sim);
}

}  // namespace gsp

#include <gsp/step/detail/kernels.hpp>
