#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/detail/set_constants_lanes.hpp>
#include <gsp/dynamics/factor.hpp>
#include <gsp/model/world_values.hpp>

/// What follows from masses and geometry in the initial pose, over lanes (MuJoCo's mj_setConst).
namespace gsp {

/// Recomputes what masses, inertias, armature and geometry decide in the initial pose, for the worlds of the mask: body_invweight0,
/// dof_invweight0 (which soften constraints), dof_M0, tendon_invweight0, tendon_length0, act_acc0 (the acceleration that an actuator's unit
/// force gives, which scales muscles). After set_world_values, with the same mask: without one all worlds get constants of the model's
/// precision, which differ by rounding from those of the compiled model. It takes `dynamics` as scratch, whose results are lost. Cost of
/// one world: the mass matrix and its factor, and for each body six solves with its ancestors. Does not allocate, does not fence. Errors:
/// std::invalid_argument where the model has no per-world masses (make_per_world with body_mass or the like), or where `dynamics` or
/// the mask is of another number of worlds.
/// @param mask  (worlds) callable with a world, such as a View<bool*>; the others keep every bit
template <ExecutionSpace Exec, class R, class Mem, class Mask = AllWorlds>
void set_constants(Exec const& exec, Model<R, Mem>& model, Dynamics<R, Mem>& dynamics, Mask const& mask = {}) {
  Region const region("gsp::dynamics::set_constants");
  expects(model.body_invweight0.stride > 0,
          "gsp::set_constants: no field that constants follow from is per world; call make_per_world, with body_mass for one");
  if (dynamics.worlds != model.value_worlds)
    throw std::invalid_argument("gsp::set_constants: dynamics have " + std::to_string(dynamics.worlds) + " worlds and the model's values " +
                                std::to_string(model.value_worlds) + ": make both with the same number");
  detail::expects_mask("gsp::set_constants", mask, "dynamics", dynamics.worlds);
  detail::loses(dynamics, detail::all_quantities);
  auto const out = [&](ModelField field, int items) {  // a tree without tendons has nothing to write
    return items > 0 ? world_values(model, field).data() : nullptr;
  };
  for_lanes(
      "gsp::dynamics::set_constants", exec, model, dynamics,
      detail::ConstantsStage<R, Mem, Mask>{out(ModelField::body_invweight0, model.nbody), out(ModelField::dof_invweight0, model.nv),
                                           out(ModelField::dof_M0, model.nv), out(ModelField::tendon_invweight0, model.ntendon),
                                           out(ModelField::tendon_length0, model.ntendon), out(ModelField::act_acc0, model.nu), mask});
}

}  // namespace gsp
