#pragma once
#include <gsp/constraint/softness.hpp>

/// Limits and dry friction of fixed tendons, whose length is sum of coef * q.
namespace gsp {

namespace detail {
template <class R, class Mem, class Row>
KOKKOS_INLINE_FUNCTION void tendon_jacobian(Model<R, Mem> const& model, int world, int t, R sign, Row&& J) {
  for (int e = model.tendon_termadr(t); e < model.tendon_termadr(t + 1); ++e)
    J.set_dof(model.jnt_dofadr(model.term_jnt(e)), sign * model.term_coef(world, e));
}
}  // namespace detail

/// Element 2 i is the lower, 2 i + 1 the upper end of the i-th limited tendon.
template <class R, class Mem>
struct TendonLimits {
  Model<R, Mem> model;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> qpos;
  TendonLimits(Model<R, Mem> const& m, State<R, Mem> const& s) : model(m), qpos(s.qpos) {}

  KOKKOS_INLINE_FUNCTION int count(int) const { return 2 * int(model.limited_tendons.extent(0)); }
  KOKKOS_INLINE_FUNCTION int rows(int world, int k) const {
    return gap(world, k) < model.tendon_margin(world, model.limited_tendons(k / 2));
  }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    detail::tendon_jacobian(model, world, model.limited_tendons(k / 2), k % 2 == 0 ? R(1) : R(-1), J);
    return gap(world, k);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int, R x, R u, R h) const {
    int const t = model.limited_tendons(k / 2);
    return soft_law(detail::softness(model.tendon_solref, model.tendon_solimp, world, t), x - model.tendon_margin(world, t), u, h,
                    model.tendon_invweight0(world, t));
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int, int, int) const { return {R(0), Kokkos::Experimental::infinity_v<R>}; }
  KOKKOS_INLINE_FUNCTION RowId id(int, int k) const { return {std::uint32_t(k), 0}; }

 private:
  KOKKOS_INLINE_FUNCTION R gap(int world, int k) const {
    int const t = model.limited_tendons(k / 2);
    R length(0);
    for (int e = model.tendon_termadr(t); e < model.tendon_termadr(t + 1); ++e)
      length += model.term_coef(world, e) * qpos(world, model.jnt_qposadr(model.term_jnt(e)));
    return k % 2 == 0 ? length - model.tendon_range(world, 2 * t) : model.tendon_range(world, 2 * t + 1) - length;
  }
};

template <class R, class Mem>
struct TendonFriction {
  Model<R, Mem> model;
  explicit TendonFriction(Model<R, Mem> const& m) : model(m) {}

  KOKKOS_INLINE_FUNCTION int count(int) const { return int(model.friction_tendons.extent(0)); }
  KOKKOS_INLINE_FUNCTION int rows(int, int) const { return 1; }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    detail::tendon_jacobian(model, world, model.friction_tendons(k), R(1), J);
    return R(0);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int, R x, R u, R h) const {
    if (model.profile == Profile::stable) return {R(0), R(0)};
    int const t = model.friction_tendons(k);
    return soft_law(detail::softness(model.tendon_friction_solref, model.tendon_friction_solimp, world, t), x, u, h,
                    model.tendon_invweight0(world, t), true);
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int world, int k, int) const {
    R const most = model.timestep * model.tendon_frictionloss(world, model.friction_tendons(k));
    return {-most, most};
  }
  KOKKOS_INLINE_FUNCTION RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};

}  // namespace gsp
