#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/actuator_law.hpp>
#include <gsp/dynamics/detail/actuator_forces_lanes.hpp>
#include <gsp/dynamics/passive_forces.hpp>
#include <gsp/dynamics/transmission.hpp>

/// Actuators (MuJoCo's mj_fwdActuation): force = gain(length, velocity) u + bias(length, velocity), u the control or an activation that
/// follows it; then clamped, and mapped to the dofs by the moment arms of the transmission.
namespace gsp {

/// Actuator forces [N, N m] on every dof at state.ctrl (world, nu) and state.act (world, na), in dynamics.items
/// (`copy_dofs(..., &DynamicsLayout::actuator, out)`); the rate of the activations, which integrate takes. `poses` as forward_kinematics
/// left them; after passive_forces, where a joint counts gravity compensation as its actuator's. Controls and forces are clamped to their
/// ranges, tendons' and joints' sums to their actuatorfrcrange. The force of an actuator on a body (adhesion) is for its
/// contacts (constraint/contact_adhesion.hpp).
/// Does not allocate, does not fence. Errors: std::invalid_argument for poses of another moment than the state, where they are read.
/// @param laws  of your own (actuator_law.hpp), in the place of gain and bias of the actuators that they drive
template <ExecutionSpace Exec, class R, class Mem, class... Laws>
void actuator_forces(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                     Dynamics<R, Mem>& dynamics, Laws const&... laws) {
  Region const region("gsp::dynamics::actuator_forces");
  detail::expects_fit("gsp::actuator_forces", model, state, dynamics, poses);
  detail::expects_actuators("gsp::actuator_forces", model, sizeof...(Laws));
  if (model.nu > 0 && detail::any_archetype(model, [](Archetype const& a) { return a.gravcomp; }))  // an actuator may carry it
    detail::expects_of("gsp::actuator_forces", dynamics, state, detail::set_of(Quantity::passive));
  bool const reads_poses = detail::any_archetype(model, [](Archetype const& a) { return a.nmoment > 0 || a.spatial; });
  if (reads_poses) detail::expects_poses_of("gsp::actuator_forces", poses, state, true);
  using Stage = detail::ActuatorStage<State<R, Mem>, Poses<R, Mem>, detail::ActuatorLaws<Laws...>>;
  for_lanes("gsp::dynamics::actuator_forces", exec, model, dynamics, Stage{state, poses, detail::actuator_laws(laws...)});
  detail::leaves(dynamics, state,
                 detail::set_of(Quantity::velocity, Quantity::tendon_length, Quantity::tendon_velocity, Quantity::act_length,
                                Quantity::activation_rate, Quantity::actuator));
  detail::begins(dynamics, state, Quantity::implicit);
  detail::continues(dynamics, state, Quantity::derivative, 2);
  if (reads_poses) detail::writes_some(dynamics, state, detail::set_of(Quantity::motion));
}

}  // namespace gsp
