#pragma once
#include <gsp/dynamics/factor.hpp>

/// All of the smooth dynamics in one kernel: a block of lanes goes through every stage while it is in cache.
namespace gsp {

namespace detail {
template <class State, class Poses> struct SmoothStage {
  State state;
  Poses poses;
  template <class L> KOKKOS_FUNCTION void operator()(L const& l) const {
    lanes_kinematics(l, state.qpos), lanes_store_poses(l, poses);
    lanes_load_velocity(l, state.qvel);
    lanes_inertia(l);
    lanes_bias(l, l.model.profile == Profile::stable && is_free_body(l));
    lanes_mass_matrix(l);
    lanes_passive(l, state.qpos);
    lanes_actuators(l, state);
    lanes_factor_profile(l);
    lanes_free_velocity(l, state.qfrc_applied);
  }
};
}  // namespace detail

/// forward_kinematics, mass_matrix, bias_forces, passive_forces, actuator_forces and factor, fused: the same numbers in one launch.
/// Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem>
void smooth_dynamics(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics, Poses<R, Mem> const& poses) {
  for_lanes("gsp::dynamics::smooth_dynamics", exec, model, dynamics, detail::SmoothStage<State<R, Mem>, Poses<R, Mem>>{state, poses});
}

}  // namespace gsp
