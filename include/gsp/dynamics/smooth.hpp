#pragma once
#include <gsp/dynamics/factor.hpp>

/// All of the smooth dynamics in one kernel: a block of lanes goes through every stage while it is in cache.
namespace gsp {

struct SmoothOptions {
  bool keep_all = false;     // also leave M and all dof vectors in dynamics.items, as the single functions do
  bool joint_poses = false;  // also write poses.xanchor and xaxis
};

namespace detail {
template <class State, class Poses>
struct SmoothStage {
  State state;
  Poses poses;
  SmoothOptions options;
  bool keep_mass;
  static constexpr int shared_blocks = 4;
  template <class L>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(L const& l) const {
    lanes_kinematics(l, state), lanes_store_poses(l, poses, options.joint_poses);
    lanes_load_velocity(l, state.qvel);
    lanes_inertia(l);
    lanes_tendons(l, state);
    lanes_bias(l, l.model.profile == Profile::stable && is_free_body(l));
    lanes_tendon_bias(l, state);
    lanes_bias_derivative(l);
    lanes_mass_matrix(l);
    lanes_tendon_armature(l);
    lanes_passive(l, state.qpos);
    lanes_actuators(l, state);
    lanes_factor_profile(l);
    lanes_free_velocity(l, state.qfrc_applied);
  }
  KOKKOS_INLINE_FUNCTION int kept(Archetype const&, DynamicsLayout const& at) const {
    return options.keep_all ? at.xpos : keep_mass ? at.passive : at.mass;
  }
};
}  // namespace detail

/// forward_kinematics, mass_matrix, bias_forces, passive_forces, actuator_forces and factor, fused: the same numbers in one launch, with
/// the block in cache. It leaves what constraints and integrate need (centre of mass, cdof, factor, velocities). Does not allocate, does
/// not fence.
template <ExecutionSpace Exec, class R, class Mem>
void smooth_dynamics(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics,
                     Poses<R, Mem> const& poses, SmoothOptions options = {}) {
  bool const keep_mass = model.profile == Profile::mujoco;  // its integrator takes M again, with joint damping
  if (model.nmocap > 0) detail::static_poses(exec, model, state.mocap_pos, state.mocap_quat, poses);
  for_lanes("gsp::dynamics::smooth_dynamics", exec, model, dynamics,
            detail::SmoothStage<State<R, Mem>, Poses<R, Mem>>{state, poses, options, keep_mass});
}

}  // namespace gsp
