#pragma once
#include <gsp/constraint/detail/tree_reader.hpp>
#include <gsp/constraint/softness.hpp>

/// Limits and dry friction of tendons, fixed and spatial: lengths and moment arms J = dlength/dq are those of the dynamics.
namespace gsp {

/// Element 2 i is the lower, 2 i + 1 the upper end of the i-th limited tendon. Rigid ones (tendon_rigid) as those of joints.
template <class R, class Mem>
struct TendonLimits {
  static constexpr bool rests = true;
  detail::TreeReader<R, Mem> trees;
  detail::Stamps stamps;  // host: those of the dynamics
  typename Model<R, Mem>::template Array<int> limited_tendons, tendon_tree, tendon_place;
  Field<R> tendon_range, tendon_margin, tendon_solref, tendon_solimp, tendon_rigid, tendon_invweight0, gravity;
  R timestep;
  bool may_be_rigid, bounce;
  Refsafe refsafe;
  TendonLimits(Model<R, Mem> const& m, Dynamics<R, Mem> const& d)
      : trees(m, d),
        stamps(d.stamps),
        limited_tendons(m.limited_tendons),
        tendon_tree(m.tendon_tree),
        tendon_place(m.tendon_place),
        tendon_range(m.tendon_range),
        tendon_margin(m.tendon_margin),
        tendon_solref(m.tendon_solref),
        tendon_solimp(m.tendon_solimp),
        tendon_rigid(m.tendon_rigid),
        tendon_invweight0(m.tendon_invweight0),
        gravity(m.gravity),
        timestep(m.timestep),
        may_be_rigid(detail::may_be_rigid(m, m.tendon_rigid)),
        bounce(m.limits_bounce),
        refsafe(refsafe_of(m)) {}

  detail::Quantities reads() const {
    return limited_tendons.extent(0) > 0 ? detail::set_of(Quantity::tendon_length) : detail::Quantities{};
  }
  KOKKOS_INLINE_FUNCTION int count(int) const { return 2 * int(limited_tendons.extent(0)); }
  KOKKOS_INLINE_FUNCTION int rows(int world, int k) const {
    int const t = limited_tendons(k / 2);
    if (tendon_tree(t) < 0) return 0;
    R early(0);
    if (rigid(world, t).hard)
      early = timestep * (abs(trees.tendon_rate(world, tendon_tree(t), tendon_place(t))) + gravity_rate(gravity, world, timestep));
    return !(gap(world, k) >= tendon_margin(world, t) + early);  // also of a range that is none: its row stops the world
  }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    int const t = limited_tendons(k / 2);
    trees.add_tendon(world, tendon_tree(t), tendon_place(t), k % 2 == 0 ? R(1) : R(-1), J);
    return gap(world, k);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int, R x, R u, R h) const {
    int const t = limited_tendons(k / 2);
    R const diag = tendon_invweight0(world, t);
    x -= tendon_margin(world, t);
    if (auto const r = rigid(world, t); r.hard) return hard_law(x, h, r.erp, r.restitution, diag);
    return soft_law(detail::softness(tendon_solref, tendon_solimp, world, t, refsafe), x, u, h, diag);
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int, int, int) const { return {R(0), Kokkos::Experimental::infinity_v<R>}; }
  KOKKOS_INLINE_FUNCTION RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
  bool bounces() const { return bounce; }

 private:
  KOKKOS_INLINE_FUNCTION detail::Rigidity<R> rigid(int world, int t) const { return {tendon_rigid, world, t, may_be_rigid}; }
  KOKKOS_INLINE_FUNCTION R gap(int world, int k) const {
    int const t = limited_tendons(k / 2);
    R const length = trees.tendon_length(world, tendon_tree(t), tendon_place(t));
    return k % 2 == 0 ? length - tendon_range(world, 2 * t) : tendon_range(world, 2 * t + 1) - length;
  }
};

/// |force| <= frictionloss against any change of length. `stable`: rigid (sticks exactly); `mujoco`: as soft as solreffriction says.
template <class R, class Mem>
struct TendonFriction {
  static constexpr bool rests = true;
  detail::TreeReader<R, Mem> trees;
  detail::Stamps stamps;  // host: those of the dynamics
  typename Model<R, Mem>::template Array<int> friction_tendons, tendon_tree, tendon_place;
  Field<R> tendon_frictionloss, tendon_friction_solref, tendon_friction_solimp, tendon_invweight0;
  R timestep;
  bool rigid;
  Refsafe refsafe;
  TendonFriction(Model<R, Mem> const& m, Dynamics<R, Mem> const& d)
      : trees(m, d),
        stamps(d.stamps),
        friction_tendons(m.friction_tendons),
        tendon_tree(m.tendon_tree),
        tendon_place(m.tendon_place),
        tendon_frictionloss(m.tendon_frictionloss),
        tendon_friction_solref(m.tendon_friction_solref),
        tendon_friction_solimp(m.tendon_friction_solimp),
        tendon_invweight0(m.tendon_invweight0),
        timestep(m.timestep),
        rigid(m.profile == Profile::stable),
        refsafe(refsafe_of(m)) {}

  detail::Quantities reads() const {
    return friction_tendons.extent(0) > 0 ? detail::set_of(Quantity::tendon_length) : detail::Quantities{};
  }
  KOKKOS_INLINE_FUNCTION int count(int) const { return int(friction_tendons.extent(0)); }
  KOKKOS_INLINE_FUNCTION int rows(int, int k) const { return tendon_tree(friction_tendons(k)) >= 0; }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    int const t = friction_tendons(k);
    trees.add_tendon(world, tendon_tree(t), tendon_place(t), R(1), J);
    return R(0);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int, R x, R u, R h) const {
    if (rigid) return {R(0), R(0)};
    int const t = friction_tendons(k);
    return soft_law(detail::softness(tendon_friction_solref, tendon_friction_solimp, world, t, refsafe), x, u, h,
                    tendon_invweight0(world, t), true);
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int world, int k, int) const {
    R const most = timestep * tendon_frictionloss(world, friction_tendons(k));
    return RowBounds<R>::dry_between(-most, most);
  }
  KOKKOS_INLINE_FUNCTION RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};

}  // namespace gsp
