#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/detail/passive_forces_lanes.hpp>
#include <gsp/dynamics/fluid.hpp>

/// Springs and dampers of joints and tendons, gravity compensation, and a fluid (MuJoCo's mj_passive).
namespace gsp {

/// Forces of springs, dampers, gravity compensation and fluid [N, N m] on every dof, in dynamics.items
/// (`copy_dofs(..., &DynamicsLayout::passive, out)`). `poses` as forward_kinematics left them. Does not allocate, does not fence.
/// Errors: std::invalid_argument for poses of another moment than the state, where they are read.
template <ExecutionSpace Exec, class R, class Mem>
void passive_forces(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                    Dynamics<R, Mem>& dynamics) {
  Region const region("gsp::dynamics::passive_forces");
  detail::expects_fit("gsp::passive_forces", model, state, dynamics, poses);
  bool const reads_poses = detail::any_archetype(model, [](Archetype const& a) { return a.fluid || a.gravcomp || a.spatial; });
  if (reads_poses) detail::expects_poses_of("gsp::passive_forces", poses, state, true);
  for_lanes("gsp::dynamics::passive_forces", exec, model, dynamics, detail::PassiveStage<State<R, Mem>, Poses<R, Mem>>{state, poses});
  detail::leaves(dynamics, state,
                 detail::set_of(Quantity::velocity, Quantity::tendon_length, Quantity::tendon_velocity, Quantity::passive));
  detail::continues(dynamics, state, Quantity::derivative, 1);
  if (reads_poses) detail::writes_some(dynamics, state, detail::set_of(Quantity::motion));
}

}  // namespace gsp
