#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/actuator_forces.hpp>
#include <gsp/dynamics/detail/factor_lanes.hpp>

/// Sparse factorisation M = L^T D L, without fill (Featherstone 2008, ch. 6.5; MuJoCo's mj_factorI), solves, and the velocity without
/// constraints.
namespace gsp {

struct FactorOptions {
  bool stiff_rows = false;  // profile stable: leave stiff springs and servos to rows, which assemble then gets as StiffForces
};

namespace detail {
template <class R, class Mem>
LeftForces left_forces(Dynamics<R, Mem> const& dynamics, State<R, Mem> const& state, bool stiff_rows) {
  if (!stiff_rows) return {};
  return {dynamics.left_step.data(), state.steps.data()};
}
}  // namespace detail

/// Factors the matrix that moves every tree (M, or with implicit terms in profile `stable`) and gives the velocities without constraints.
/// After mass_matrix, bias_forces, passive_forces, actuator_forces; all of it stays in dynamics.items.
/// Of a tree that is one rigid body, profile `stable`, it is the new velocity in the axes of the start (docs/dynamics/factor.md).
/// Cost 2 sum d^2 + 4 nM flop (d: ancestors of a dof), three times that where nothing damps a joint. Does not allocate, does not fence.
/// Errors: std::invalid_argument where the stages before have not run for this state as it is now, each once.
template <ExecutionSpace Exec, class R, class Mem>
void factor(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem>& dynamics,
            FactorOptions options = {}) {
  Region const region("gsp::dynamics::factor");
  detail::expects_fit("gsp::factor", model, state, dynamics);
  detail::expects_of("gsp::factor", dynamics, state,
                     detail::set_of(Quantity::velocity, Quantity::mass, Quantity::bias, Quantity::passive, Quantity::actuator));
  bool const adds = model.profile == Profile::stable;  // its matrix takes what actuators have begun, and adds to it
  if (adds && dynamics.stamps(int(Quantity::implicit)).level != 1)
    throw std::invalid_argument(
        "gsp::factor: the implicit stiffness and damping are in the matrix already: call actuator_forces again first");
  for_lanes("gsp::dynamics::factor", exec, model, dynamics,
            detail::FactorStage<State<R, Mem>>{state, detail::left_forces(dynamics, state, options.stiff_rows)});
  detail::leaves(dynamics, state, detail::set_of(Quantity::factor, Quantity::free_velocity, Quantity::force, Quantity::acceleration));
  detail::set_leaves_stiff_forces(dynamics, options.stiff_rows && detail::any_archetype(model, [](Archetype const& a) { return a.stiff; }));
  detail::continues(dynamics, state, Quantity::implicit, 1);
}

}  // namespace gsp
