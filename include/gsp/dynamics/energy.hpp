#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/detail/energy_lanes.hpp>
#include <gsp/dynamics/passive_forces.hpp>
#include <gsp/dynamics/world_lanes.hpp>

/// Potential and kinetic energy (MuJoCo's mj_energyPos, mj_energyVel).
namespace gsp {

/// energy (world, 2) [J]: potential (weight of all bodies, springs of joints and tendons), kinetic (with armature). After smooth_dynamics
/// with keep_all, or the single functions up to passive_forces. Uses scratch of the dynamics. Does not allocate, does not fence. Errors:
/// std::invalid_argument where the dynamics do not hold what it needs of this state as it is now, or the poses are of another moment.
template <ExecutionSpace Exec, class R, class Mem, class View>
void energies(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
              Dynamics<R, Mem>& dynamics, View& energy) {
  Region const region("gsp::dynamics::energies");
  detail::expects_fit("gsp::energies", model, state, dynamics, poses);
  detail::expects_rows("gsp::energies", "energy", energy, dynamics.worlds, 2);
  detail::expects_of("gsp::energies", dynamics, state, detail::set_of(Quantity::velocity, Quantity::mass));
  if (model.ntendon > 0) detail::expects_of("gsp::energies", dynamics, state, detail::set_of(Quantity::tendon_length));
  detail::expects_poses_of("gsp::energies", poses, state);
  for_lanes("gsp::dynamics::tree_energies", exec, model, dynamics, detail::EnergyStage<State<R, Mem>, Poses<R, Mem>>{state, poses});
  for_world_lanes<R>("gsp::dynamics::energies", exec, dynamics.worlds, 1,
                     detail::SumEnergies<R, Mem, View>{model, poses, dynamics, energy});
}

}  // namespace gsp
