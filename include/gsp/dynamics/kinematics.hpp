#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/detail/kinematics_lanes.hpp>
#include <gsp/dynamics/lanes.hpp>

/// Forward kinematics: joint positions to the world poses of all bodies.
namespace gsp {

struct PosesOptions {
  int worlds = 1;
};

/// Poses for `worlds` worlds of the model; bodies fixed to the world get their pose here, once. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
Poses<R, Mem> make_poses(Exec const& exec, Model<R, Mem> const& model, PosesOptions options = {}) {
  expects(options.worlds > 0, "gsp::make_poses: worlds must be positive and is " + std::to_string(options.worlds));
  auto poses = make_poses<R>(exec, options.worlds, model.nbody, model.njnt);
  typename Poses<R, Mem>::template View<R***> const none;
  detail::static_poses(exec, model, none, none, poses);
  return poses;
}

/// World poses of all bodies and joints from state.qpos (MuJoCo's mj_kinematics).
/// @param dynamics  scratch
/// @param poses     out: xpos, xquat (world, body, 3 | 4), xanchor, xaxis (world, joint, 3), in the world frame [m]
/// Cost about 100 flop a body. Does not allocate, does not fence. Errors: std::invalid_argument where model, state, poses and dynamics do
/// not fit together.
template <ExecutionSpace Exec, class R, class Mem>
void forward_kinematics(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem>& poses,
                        Dynamics<R, Mem>& dynamics) {
  Region const region("gsp::dynamics::forward_kinematics");
  detail::expects_fit("gsp::forward_kinematics", model, state, dynamics, poses);
  if (model.nmocap > 0) detail::static_poses(exec, model, state.mocap_pos, state.mocap_quat, poses);
  for_lanes("gsp::dynamics::forward_kinematics", exec, model, dynamics,
            detail::KinematicsStage<State<R, Mem>, Poses<R, Mem>>{state, poses});
  detail::leaves_poses(poses, state, true);
}

}  // namespace gsp
