#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/integrate.hpp>

/// All of the smooth dynamics in one kernel, or all of a step without constraints: a block of lanes goes through every stage while it is in
/// cache.
namespace gsp {

struct SmoothOptions {
  bool keep_all = false;     // also leave M and all dof vectors in dynamics.items, as the single functions do
  bool joint_poses = false;  // also write poses.xanchor and xaxis
  bool stiff_rows = false;   // profile stable: leave stiff springs and servos to rows, which assemble then gets as StiffForces
};

namespace detail {
/// What contacts, and which rows there are, hang on: poses, velocities, lengths of tendons that are fixed.
template <class State, class Poses>
struct PlaceStage {
  static constexpr int shared_blocks = 4;
  State state;
  Poses poses;
  bool joints;
  template <class L>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(L const& l) const {
    lanes_poses(l, state, poses, joints);
    lanes_load_velocity(l, state);
    lanes_fixed_tendons(l, state);
  }
};
/// Inertias, M, and all forces.
/// @param placed  PlaceStage has gone before
template <class L, class State, class Laws>
KOKKOS_FORCEINLINE_FUNCTION void lanes_forces(L const& l, State const& state, SmoothOptions options, bool placed, Laws const& laws) {
  if (!placed) lanes_load_velocity(l, state);
  lanes_inertia(l);
  lanes_tendons(l, state, placed);
  lanes_bias_of_step(l, state, options.keep_all);
  lanes_bias_derivative_terms(l);
  lanes_mass_matrix(l);
  lanes_bias_derivative(l);
  lanes_tendon_armature(l);
  lanes_passive(l, state.qpos);
  lanes_actuators(l, state, laws);
}

template <class State, class Poses, class Laws = ActuatorLaws<>>
struct SmoothStage {
  State state;
  Poses poses;
  SmoothOptions options;
  bool keep_mass;
  bool placed;  // PlaceStage has gone before
  LeftForces left = {};
  Laws laws = {};
  static constexpr int shared_blocks = 4;
  template <class L>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(L const& l) const {
    if (!placed) lanes_poses(l, state, poses, options.joint_poses);
    lanes_forces(l, state, options, placed, laws);
    lanes_factor_profile(l, left);
    lanes_free_velocity(l, state.qfrc_applied);
  }
  KOKKOS_INLINE_FUNCTION int kept(Archetype const&, DynamicsLayout const& at) const {
    return options.keep_all ? at.xpos : keep_mass ? at.passive : at.mass;
  }
};
template <class State, class Poses, class Laws>
struct SmoothStepStage {
  static constexpr int shared_blocks = 4;
  State state;
  Poses poses;
  Laws laws;
  template <class L>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(L const& l) const {
    typename State::template View<typename State::real_type**> const none;
    lanes_poses(l, state, poses, false);
    lanes_forces(l, state, SmoothOptions{}, false, laws);
    if (lanes_factors_again(l)) {  // what M itself gives is not asked for
      lanes_total_force(l, state.qfrc_applied);
      lanes_new_velocity(l, none, none);
    } else {
      if (l.a.gyroscopic)  // the velocity comes from a matrix of its own
        lanes_implicit_forces(l);
      else
        lanes_factor_profile(l);
      lanes_free_velocity(l, state.qfrc_applied);
    }
    lanes_end_step(l, state);
  }
  KOKKOS_INLINE_FUNCTION int kept(Archetype const&, DynamicsLayout const&) const { return 0; }
};

template <class R, class Mem>
void expects_smooth(Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses, Dynamics<R, Mem> const& dynamics,
                    std::size_t laws) {
  expects_fit("gsp::smooth_dynamics", model, state, dynamics, poses);
  expects_actuators("gsp::smooth_dynamics", model, laws);
}
/// The first part of `smooth_dynamics` on a device, for what goes beside the rest of it.
template <class Exec, class R, class Mem>
void launch_place(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem>& poses,
                  Dynamics<R, Mem>& dynamics, SmoothOptions options);
/// All of it, or the rest.
/// @param placed  launch_place has been called with the same, and nothing else with these dynamics since
template <class Exec, class R, class Mem, class... Laws>
void launch_smooth(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem>& poses,
                   Dynamics<R, Mem>& dynamics, SmoothOptions options, bool placed, Laws const&... laws);
}  // namespace detail

/// forward_kinematics, mass_matrix, bias_forces, passive_forces, actuator_forces and factor, fused: the same numbers in one launch, with
/// the block in cache. It leaves what constraints and integrate need (centre of mass, cdof, factor, velocities). Does not allocate, does
/// not fence. Errors: std::invalid_argument where model, state, poses and dynamics do not fit together, for laws without actuators.
/// @param laws  of actuators, of your own (actuator_law.hpp)
template <ExecutionSpace Exec, class R, class Mem, class... Laws>
void smooth_dynamics(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem>& poses,
                     Dynamics<R, Mem>& dynamics, SmoothOptions options = {}, Laws const&... laws) {
  detail::launch_smooth(exec, model, state, poses, dynamics, options, false, laws...);
}

namespace detail {
template <class Exec, class R, class Mem>
void launch_place(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem>& poses,
                  Dynamics<R, Mem>& dynamics, SmoothOptions options) {
  Region const region("gsp::dynamics::smooth_dynamics");
  expects_smooth(model, state, poses, dynamics, 0);
  if (model.nmocap > 0) static_poses(exec, model, state.mocap_pos, state.mocap_quat, poses);
  loses(dynamics, all_quantities);
  for_lanes("gsp::dynamics::place_bodies", exec, model, dynamics,
            PlaceStage<State<R, Mem>, Poses<R, Mem>>{state, poses, options.joint_poses});
  leaves_poses(poses, state, options.joint_poses);
}
template <class Exec, class R, class Mem, class... Laws>
void launch_smooth(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem>& poses,
                   Dynamics<R, Mem>& dynamics, SmoothOptions options, bool placed, Laws const&... laws) {
  Region const region("gsp::dynamics::smooth_dynamics");
  expects_smooth(model, state, poses, dynamics, sizeof...(Laws));
  bool const keep_mass = model.profile == Profile::mujoco;  // its integrator takes M again, with joint damping
  if (!placed && model.nmocap > 0) static_poses(exec, model, state.mocap_pos, state.mocap_quat, poses);
  using Stage = SmoothStage<State<R, Mem>, Poses<R, Mem>, ActuatorLaws<Laws...>>;
  for_lanes("gsp::dynamics::smooth_dynamics", exec, model, dynamics,
            Stage{state, poses, options, keep_mass, placed, left_forces(dynamics, state, options.stiff_rows), actuator_laws(laws...)});
  loses(dynamics, all_quantities);
  leaves(dynamics, state, left_by_smooth(options.keep_all, keep_mass));
  set_leaves_stiff_forces(dynamics, options.stiff_rows && any_archetype(model, [](Archetype const& a) { return a.stiff; }));
  if (!placed) leaves_poses(poses, state, options.joint_poses);
  completes(dynamics);
}
}  // namespace detail

/// smooth_dynamics and integrate without constraints, with the integrator Euler or an implicit one: the same state and poses of bodies.
/// Where a world is one tree it is one launch that leaves nothing in `dynamics` (which it takes as scratch) and, where the integrator has a
/// matrix of its own, factors that alone. Does not allocate, does not fence. Errors: those of smooth_dynamics.
/// @param laws  of actuators, of your own (actuator_law.hpp)
template <ExecutionSpace Exec, class R, class Mem, class... Laws>
void smooth_step(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Poses<R, Mem>& poses, Dynamics<R, Mem>& dynamics,
                 Laws const&... laws) {
  Region const region("gsp::dynamics::smooth_step");
  detail::expects_fit("gsp::smooth_step", model, state, dynamics, poses);
  detail::expects_actuators("gsp::smooth_step", model, sizeof...(Laws));
  if (model.ntree != 1) {  // a world stops as a whole
    smooth_dynamics(exec, model, state, poses, dynamics, {}, laws...);
    integrate(exec, model, state, dynamics);
    return detail::loses(dynamics, detail::all_quantities);  // as below
  }
  if (model.nmocap > 0) detail::static_poses(exec, model, state.mocap_pos, state.mocap_quat, poses);
  using Stage = detail::SmoothStepStage<State<R, Mem>, Poses<R, Mem>, detail::ActuatorLaws<Laws...>>;
  for_lanes("gsp::dynamics::smooth_step", exec, model, dynamics, Stage{state, poses, detail::actuator_laws(laws...)});
  detail::loses(dynamics, detail::all_quantities);
  detail::leaves_poses(poses, state, false);
  detail::moves_on(state);
}

}  // namespace gsp
