#pragma once
#include <gsp/constraint/softness.hpp>

/// Limits and dry friction of fixed tendons, whose length is sum of coef * q.
namespace gsp {

namespace detail {
/// The terms coef * q of fixed tendons.
template <class R, class Mem>
struct TendonTerms {
  typename Model<R, Mem>::template Array<int> tendon_termadr, term_jnt, jnt_dofadr, jnt_qposadr;
  Field<R> term_coef;
  explicit TendonTerms(Model<R, Mem> const& m)
      : tendon_termadr(m.tendon_termadr),
        term_jnt(m.term_jnt),
        jnt_dofadr(m.jnt_dofadr),
        jnt_qposadr(m.jnt_qposadr),
        term_coef(m.term_coef) {}
  template <class Row>
  KOKKOS_INLINE_FUNCTION void jacobian(int world, int t, R sign, Row&& J) const {
    for (int e = tendon_termadr(t); e < tendon_termadr(t + 1); ++e) J.set_dof(jnt_dofadr(term_jnt(e)), sign * term_coef(world, e));
  }
  template <class View>
  KOKKOS_INLINE_FUNCTION R length(int world, int t, View const& qpos) const {
    R sum(0);
    for (int e = tendon_termadr(t); e < tendon_termadr(t + 1); ++e) sum += term_coef(world, e) * qpos(world, jnt_qposadr(term_jnt(e)));
    return sum;
  }
};
}  // namespace detail

/// Element 2 i is the lower, 2 i + 1 the upper end of the i-th limited tendon.
template <class R, class Mem>
struct TendonLimits {
  detail::TendonTerms<R, Mem> terms;
  typename Model<R, Mem>::template Array<int> limited_tendons;
  Field<R> tendon_range, tendon_margin, tendon_solref, tendon_solimp, tendon_invweight0;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> qpos;
  TendonLimits(Model<R, Mem> const& m, State<R, Mem> const& s)
      : terms(m),
        limited_tendons(m.limited_tendons),
        tendon_range(m.tendon_range),
        tendon_margin(m.tendon_margin),
        tendon_solref(m.tendon_solref),
        tendon_solimp(m.tendon_solimp),
        tendon_invweight0(m.tendon_invweight0),
        qpos(s.qpos) {}

  KOKKOS_INLINE_FUNCTION int count(int) const { return 2 * int(limited_tendons.extent(0)); }
  KOKKOS_INLINE_FUNCTION int rows(int world, int k) const { return gap(world, k) < tendon_margin(world, limited_tendons(k / 2)); }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    terms.jacobian(world, limited_tendons(k / 2), k % 2 == 0 ? R(1) : R(-1), J);
    return gap(world, k);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int, R x, R u, R h) const {
    int const t = limited_tendons(k / 2);
    return soft_law(detail::softness(tendon_solref, tendon_solimp, world, t), x - tendon_margin(world, t), u, h,
                    tendon_invweight0(world, t));
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int, int, int) const { return {R(0), Kokkos::Experimental::infinity_v<R>}; }
  KOKKOS_INLINE_FUNCTION RowId id(int, int k) const { return {std::uint32_t(k), 0}; }

 private:
  KOKKOS_INLINE_FUNCTION R gap(int world, int k) const {
    int const t = limited_tendons(k / 2);
    R const length = terms.length(world, t, qpos);
    return k % 2 == 0 ? length - tendon_range(world, 2 * t) : tendon_range(world, 2 * t + 1) - length;
  }
};

template <class R, class Mem>
struct TendonFriction {
  detail::TendonTerms<R, Mem> terms;
  typename Model<R, Mem>::template Array<int> friction_tendons;
  Field<R> tendon_frictionloss, tendon_friction_solref, tendon_friction_solimp, tendon_invweight0;
  R timestep;
  bool rigid;
  explicit TendonFriction(Model<R, Mem> const& m)
      : terms(m),
        friction_tendons(m.friction_tendons),
        tendon_frictionloss(m.tendon_frictionloss),
        tendon_friction_solref(m.tendon_friction_solref),
        tendon_friction_solimp(m.tendon_friction_solimp),
        tendon_invweight0(m.tendon_invweight0),
        timestep(m.timestep),
        rigid(m.profile == Profile::stable) {}

  KOKKOS_INLINE_FUNCTION int count(int) const { return int(friction_tendons.extent(0)); }
  KOKKOS_INLINE_FUNCTION int rows(int, int) const { return 1; }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    terms.jacobian(world, friction_tendons(k), R(1), J);
    return R(0);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int, R x, R u, R h) const {
    if (rigid) return {R(0), R(0)};
    int const t = friction_tendons(k);
    return soft_law(detail::softness(tendon_friction_solref, tendon_friction_solimp, world, t), x, u, h, tendon_invweight0(world, t), true);
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int world, int k, int) const {
    R const most = timestep * tendon_frictionloss(world, friction_tendons(k));
    return {-most, most};
  }
  KOKKOS_INLINE_FUNCTION RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};

}  // namespace gsp
