#pragma once
#include <gsp/constraint/softness.hpp>

/// Dry friction of joints: |force| <= frictionloss against any motion of the dof. `stable`: rigid (sticks exactly); `mujoco`: as soft as
/// solreffriction says.
namespace gsp {

template <class R, class Mem>
struct JointFriction {
  Model<R, Mem> model;
  explicit JointFriction(Model<R, Mem> const& m) : model(m) {}

  KOKKOS_INLINE_FUNCTION int count(int) const { return int(model.friction_dofs.extent(0)); }
  KOKKOS_INLINE_FUNCTION int rows(int, int) const { return 1; }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int, int k, int, Row&& J) const {
    J.set_dof(model.friction_dofs(k), R(1));
    return R(0);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int, R x, R u, R h) const {
    if (model.profile == Profile::stable) return {R(0), R(0)};
    int const i = model.friction_dofs(k);
    return soft_law(detail::softness(model.dof_solref, model.dof_solimp, world, i), x, u, h, model.dof_invweight0(world, i), true);
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int world, int k, int) const {
    R const most = model.timestep * model.dof_frictionloss(world, model.friction_dofs(k));
    return {-most, most};
  }
  KOKKOS_INLINE_FUNCTION RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};

}  // namespace gsp
