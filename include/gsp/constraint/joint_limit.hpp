#pragma once
#include <gsp/constraint/softness.hpp>

/// Limits of hinge, slide and ball joints: gap x = q - lower or upper - q (ball: upper - angle), force >= 0, active where x < margin. Rigid
/// ones (jnt_rigid, profile stable) stop what comes within the step: from x < margin + h (|u| + |g| h) on.
namespace gsp {

/// Element 2 i is the lower, 2 i + 1 the upper end of the i-th limited joint (ball: the upper alone).
template <class R, class Mem>
struct JointLimits {
  static constexpr bool rests = true;
  using Indices = typename Model<R, Mem>::template Array<int>;
  Indices limited_joints, jnt_type, jnt_qposadr, jnt_dofadr;
  Field<R> jnt_range, jnt_margin, jnt_solref, jnt_solimp, jnt_rigid, dof_invweight0, gravity;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> qpos, qvel;
  R timestep;
  bool may_be_rigid, bounce;
  Refsafe refsafe;
  JointLimits(Model<R, Mem> const& m, State<R, Mem> const& s)
      : limited_joints(m.limited_joints),
        jnt_type(m.jnt_type),
        jnt_qposadr(m.jnt_qposadr),
        jnt_dofadr(m.jnt_dofadr),
        jnt_range(m.jnt_range),
        jnt_margin(m.jnt_margin),
        jnt_solref(m.jnt_solref),
        jnt_solimp(m.jnt_solimp),
        jnt_rigid(m.jnt_rigid),
        dof_invweight0(m.dof_invweight0),
        gravity(m.gravity),
        qpos(s.qpos),
        qvel(s.qvel),
        timestep(m.timestep),
        may_be_rigid(detail::may_be_rigid(m, m.jnt_rigid)),
        bounce(m.limits_bounce),
        refsafe(refsafe_of(m)) {}

  KOKKOS_INLINE_FUNCTION int count(int) const { return 2 * int(limited_joints.extent(0)); }
  KOKKOS_INLINE_FUNCTION int rows(int world, int k) const {
    int const j = limited_joints(k / 2);
    bool const ball = jnt_type(j) == int(JointType::ball);
    if (ball && k % 2 == 0) return 0;
    R early(0);
    if (rigid(world, j).hard) {
      R rate2(0);
      for (int c = 0, dof = jnt_dofadr(j); c < (ball ? 3 : 1); ++c) rate2 += square(qvel(world, dof + c));
      early = timestep * (sqrt(rate2) + gravity_rate(gravity, world, timestep));
    }
    return !(gap(world, k) >= jnt_margin(world, j) + early);  // also of a range that is none: its row stops the world
  }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    int const j = limited_joints(k / 2), dof = jnt_dofadr(j);
    if (jnt_type(j) == int(JointType::ball)) {
      Vec3<R> const axis = normalized(rotation(world, j));
      for (int c = 0; c < 3; ++c) J.set_dof(dof + c, -axis[c]);
    } else {
      J.set_dof(dof, k % 2 == 0 ? R(1) : R(-1));
    }
    return gap(world, k);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int, R x, R u, R h) const {
    int const j = limited_joints(k / 2);
    R const diag = dof_invweight0(world, jnt_dofadr(j));
    x -= jnt_margin(world, j);
    if (auto const r = rigid(world, j); r.hard) return hard_law(x, h, r.erp, r.restitution, diag);
    return soft_law(detail::softness(jnt_solref, jnt_solimp, world, j, refsafe), x, u, h, diag);
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int, int, int) const { return {R(0), Kokkos::Experimental::infinity_v<R>}; }
  KOKKOS_INLINE_FUNCTION RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
  bool bounces() const { return bounce; }

 private:
  KOKKOS_INLINE_FUNCTION detail::Rigidity<R> rigid(int world, int j) const { return {jnt_rigid, world, j, may_be_rigid}; }
  KOKKOS_INLINE_FUNCTION Vec3<R> rotation(int world, int j) const {
    int const q = jnt_qposadr(j);
    return log_rotation(normalized(Quat<R>{qpos(world, q), qpos(world, q + 1), qpos(world, q + 2), qpos(world, q + 3)}));
  }
  KOKKOS_INLINE_FUNCTION R gap(int world, int k) const {
    int const j = limited_joints(k / 2);
    R const lower = jnt_range(world, 2 * j), upper = jnt_range(world, 2 * j + 1);
    if (jnt_type(j) == int(JointType::ball)) return max(lower, upper) - norm(rotation(world, j));
    R const q = qpos(world, jnt_qposadr(j));
    return k % 2 == 0 ? q - lower : upper - q;
  }
};

}  // namespace gsp
