#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/detail/bias_forces_lanes.hpp>
#include <gsp/dynamics/mass_matrix.hpp>

/// Coriolis, centrifugal and gravity forces by recursive Newton-Euler at zero acceleration (Featherstone 2008, ch. 5; MuJoCo's mj_rne).
namespace gsp {

/// Bias forces c(q, v) - J^T m g of every tree, in dynamics.items (`copy_dofs` copies them out), so that M qacc + bias = applied forces.
/// In profile `stable` the gyroscopic part of a tree that is one rigid body is left out, as factor carries its angular momentum; trees that
/// nothing damps also get the derivative by velocity (docs/dynamics/factor.md). Cost about 250 flop a body. Does not allocate, does not
/// fence. Errors: std::invalid_argument for poses of another moment than the state.
template <ExecutionSpace Exec, class R, class Mem>
void bias_forces(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                 Dynamics<R, Mem>& dynamics) {
  Region const region("gsp::dynamics::bias_forces");
  detail::expects_fit("gsp::bias_forces", model, state, dynamics, poses);
  detail::expects_poses_of("gsp::bias_forces", poses, state, true);
  for_lanes("gsp::dynamics::bias_forces", exec, model, dynamics, detail::BiasStage<State<R, Mem>, Poses<R, Mem>>{state, poses});
  detail::leaves(dynamics, state, detail::set_of(Quantity::motion, Quantity::velocity, Quantity::bias));
  detail::begins(dynamics, state, Quantity::derivative);
  if (detail::any_archetype(model, [](Archetype const& a) { return a.tendon_armature; }))
    detail::writes_some(dynamics, state, detail::set_of(Quantity::tendon_length, Quantity::tendon_velocity));
}

/// Copies one kind of dof vector, e.g. &DynamicsLayout::bias, to `out` (world, nv): force, passive, actuator, bias, stiffness, damping,
/// acceleration, qvel, velocity or inverse_diagonal. In profile stable `acceleration` is that of the implicit step, and of a single rigid
/// body `force` and it are without gyroscopic forces, which its momentum carries. It is of the state that it was computed for, also when
/// that has moved on since. Errors: std::invalid_argument where no stage has left it, and for other items.
template <ExecutionSpace Exec, class R, class Mem, class View>
void copy_dofs(Exec const& exec, Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, detail::DofItems item, View& out) {
  Region const region("gsp::dynamics::copy_dofs");
  detail::expects_fit("gsp::copy_dofs", model, dynamics);
  detail::expects_rows("gsp::copy_dofs", "out", out, dynamics.worlds, model.nv);
  Quantity const quantity = detail::quantity_of(item);
  detail::expects_held("gsp::copy_dofs", dynamics, detail::set_of(quantity));
  if (quantity == Quantity::implicit && model.profile == Profile::stable && dynamics.stamps(int(quantity)).level != detail::implicit_stages)
    detail::refuse_quantity("gsp::copy_dofs", quantity, "are not complete");
  for_lanes("gsp::dynamics::copy_dofs", exec, model, dynamics, detail::CopyDofsStage<View>{out, item});
}

}  // namespace gsp
