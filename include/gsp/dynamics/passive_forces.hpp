#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/detail/passive_forces_lanes.hpp>
#include <gsp/dynamics/fluid.hpp>

/// Springs and dampers of joints and tendons, gravity compensation, and a fluid (MuJoCo's mj_passive).
namespace gsp {

/// Forces of springs, dampers, gravity compensation and fluid [N, N m] on every dof, in dynamics.items
/// (`copy_dofs(..., &DynamicsLayout::passive, out)`). `poses` as forward_kinematics left them. Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem>
void passive_forces(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                    Dynamics<R, Mem>& dynamics) {
  Region const region("gsp::dynamics::passive_forces");
  detail::expects_fit("gsp::passive_forces", model, state, dynamics, poses);
  for_lanes("gsp::dynamics::passive_forces", exec, model, dynamics, detail::PassiveStage<State<R, Mem>, Poses<R, Mem>>{state, poses});
  detail::leaves(dynamics, state,
                 detail::set_of(Quantity::velocity, Quantity::tendon_length, Quantity::tendon_velocity, Quantity::passive));
  detail::continues(dynamics, state, Quantity::derivative, 1);
  if (detail::any_archetype(model, [](Archetype const& a) { return a.fluid || a.gravcomp || a.spatial; }))
    detail::writes_some(dynamics, state, detail::set_of(Quantity::motion));
}

}  // namespace gsp
