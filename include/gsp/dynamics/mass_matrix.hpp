#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/detail/mass_matrix_lanes.hpp>
#include <gsp/dynamics/tendon.hpp>

/// Mass matrix by the composite rigid body algorithm (Featherstone 2008, ch. 6; MuJoCo's mj_crb).
/// Spatial vectors are in world axes about the centre of mass of all bodies on the same root, as MuJoCo has them: cdof is the motion that a
/// unit velocity of a dof gives. M is lower triangular by rows: row i holds the entries of i's ancestor dofs from the root down, then the
/// diagonal. As ancestors nest, the row of an ancestor at place p lists exactly the first p + 1 columns: no column index is ever read in a
/// factorisation.
namespace gsp {

/// Mass matrix of every tree at `poses`, in dynamics.items (blocked; `dense_mass_matrix` copies it out); also com and cdof, which Jacobians
/// need. Cost about 60 flop a dof and 11 an entry. Does not allocate, does not fence. Errors: std::invalid_argument for poses of another
/// moment than the state (stamps.hpp).
template <ExecutionSpace Exec, class R, class Mem>
void mass_matrix(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                 Dynamics<R, Mem>& dynamics) {
  Region const region("gsp::dynamics::mass_matrix");
  detail::expects_fit("gsp::mass_matrix", model, state, dynamics, poses);
  detail::expects_poses_of("gsp::mass_matrix", poses, state, true);
  for_lanes("gsp::dynamics::mass_matrix", exec, model, dynamics, detail::MassMatrixStage<State<R, Mem>, Poses<R, Mem>>{state, poses});
  detail::leaves(dynamics, state, detail::set_of(Quantity::motion, Quantity::mass));
  if (detail::any_archetype(model, [](Archetype const& a) { return a.tendon_armature; }))
    detail::writes_some(dynamics, state, detail::set_of(Quantity::velocity, Quantity::tendon_length, Quantity::tendon_velocity));
}

/// Copies the mass matrices to M (world, nv, nv), symmetric; entries between trees are set to zero. They are of the state that they were
/// computed for, also when it has moved on since. Errors: std::invalid_argument where no stage has left them.
template <ExecutionSpace Exec, class R, class Mem, class View>
void dense_mass_matrix(Exec const& exec, Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, View& M) {
  Region const region("gsp::dynamics::dense_mass_matrix");
  detail::expects_fit("gsp::dense_mass_matrix", model, dynamics);
  detail::expects_rows("gsp::dense_mass_matrix", "M", M, dynamics.worlds, model.nv, model.nv);
  detail::expects_held("gsp::dense_mass_matrix", dynamics, detail::set_of(Quantity::mass));
  detail::zero(exec, M);
  for_lanes("gsp::dynamics::dense_mass_matrix", exec, model, dynamics, detail::DenseMassMatrixStage<View>{M});
}

}  // namespace gsp
