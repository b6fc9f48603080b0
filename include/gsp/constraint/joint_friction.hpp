#pragma once
#include <gsp/constraint/softness.hpp>

/// Dry friction of joints: |force| <= frictionloss against any motion of the dof. `stable`: rigid (sticks exactly); `mujoco`: as soft as
/// solreffriction says.
namespace gsp {

template <class R, class Mem>
struct JointFriction {
  static constexpr bool rests = true;
  typename Model<R, Mem>::template Array<int> friction_dofs;
  Field<R> dof_frictionloss, dof_invweight0, dof_solref, dof_solimp;
  R timestep;
  bool rigid;
  Refsafe refsafe;
  explicit JointFriction(Model<R, Mem> const& m)
      : friction_dofs(m.friction_dofs),
        dof_frictionloss(m.dof_frictionloss),
        dof_invweight0(m.dof_invweight0),
        dof_solref(m.dof_solref),
        dof_solimp(m.dof_solimp),
        timestep(m.timestep),
        rigid(m.profile == Profile::stable),
        refsafe(refsafe_of(m)) {}

  KOKKOS_INLINE_FUNCTION int count(int) const { return int(friction_dofs.extent(0)); }
  KOKKOS_INLINE_FUNCTION int rows(int, int) const { return 1; }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int, int k, int, Row&& J) const {
    J.set_dof(friction_dofs(k), R(1));
    return R(0);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int, R x, R u, R h) const {
    if (rigid) return {R(0), R(0)};
    int const i = friction_dofs(k);
    return soft_law(detail::softness(dof_solref, dof_solimp, world, i, refsafe), x, u, h, dof_invweight0(world, i), true);
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int world, int k, int) const {
    R const most = timestep * dof_frictionloss(world, friction_dofs(k));
    return RowBounds<R>::dry_between(-most, most);
  }
  KOKKOS_INLINE_FUNCTION RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};

}  // namespace gsp
