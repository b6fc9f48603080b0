#pragma once
#include <gsp/constraint/detail/write_joint_forces.hpp>
#include <gsp/constraint/joint_friction.hpp>
#include <gsp/constraint/joint_limit.hpp>
#include <gsp/core/region.hpp>

namespace gsp {

/// What limits and dry friction did to the joints in the last step.
/// @param rows, impulses  after `pgs` (or `step`), before the next `assemble`
/// @param limit           out (world, joint): force of the joint's limit, >= 0, away from the end that was reached (MuJoCo's
///                        jointlimitfrc) [N, N m]
/// @param friction        out (world, nv): force of dry friction on each degree of freedom [N, N m]
/// Cost: a binary search a limit and a degree of freedom with friction. Does not allocate, does not fence.
/// Errors: std::invalid_argument where nothing has been solved since the rows were last assembled, where steps were launched and not
/// settled, and for rows of another model.
template <ExecutionSpace Exec, class R, class Mem>
void joint_forces(Exec const& exec, Model<R, Mem> const& model, Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses,
                  Kokkos::View<R**, Kokkos::LayoutRight, Mem>& limit, Kokkos::View<R**, Kokkos::LayoutRight, Mem>& friction) {
  Region const region("gsp::constraint::joint_forces");
  if (rows.nv != model.nv)
    throw std::invalid_argument("gsp::joint_forces: the rows have " + std::to_string(rows.nv) + " degrees of freedom and the model " +
                                std::to_string(model.nv) + ": give the model that they were assembled for");
  auto const expects_size = [&](char const* name, auto const& view, char const* items, int count) {
    if (int(view.extent(0)) != rows.worlds || int(view.extent(1)) != count)
      throw std::invalid_argument("gsp::joint_forces: " + std::string(name) + " is (" + std::to_string(view.extent(0)) + ", " +
                                  std::to_string(view.extent(1)) + ") and must be (worlds, " + items + "), here (" +
                                  std::to_string(rows.worlds) + ", " + std::to_string(count) + ")");
  };
  expects_size("limit", limit, "njnt", model.njnt);
  expects_size("friction", friction, "nv", model.nv);
  detail::expects_readable("gsp::joint_forces", rows, impulses);
  for_worlds("gsp::constraint::joint_forces", exec, rows.worlds,
             detail::WriteJointForces<R, Mem>{model.limited_joints, model.friction_dofs, impulses_of<JointLimits<R, Mem>>(rows, impulses),
                                              impulses_of<JointFriction<R, Mem>>(rows, impulses), limit, friction, R(1) / model.timestep});
}

}  // namespace gsp
