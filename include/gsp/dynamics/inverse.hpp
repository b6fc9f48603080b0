#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/bias_forces.hpp>
#include <gsp/dynamics/passive_forces.hpp>

/// Inverse dynamics: the forces that make given accelerations, without constraints.
namespace gsp {

namespace detail {
template <class In, class Out>
struct InverseStage {
  In qacc;
  Out qfrc;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    auto const& a = l.a;
    auto const& s = l.items;
    int const f = l.at.impulse;
    for (int i = 0; i < a.nv; ++i) s[f + i] = whole_bias(l, i) - s[l.at.passive + i];
    for (int i = 0; i < a.nv; ++i) {
      T const own = l.load(qacc, l.dof0, i);
      for (int e = l.index(a.row_adr, i), end = l.index(a.row_adr, i + 1); e < end; ++e) {
        int const c = l.index(a.row_col, e);
        s[f + i] = fma(s[l.at.mass + e], l.load(qacc, l.dof0, c), s[f + i]);
        if (c != i) s[f + c] = fma(s[l.at.mass + e], own, s[f + c]);
      }
    }
    for (int i = 0; i < a.nv; ++i) l.store(qfrc, l.dof0, i, s[f + i]);
  }
};
}  // namespace detail

/// qfrc = M qacc + bias - passive (world, nv) [N, N m]: what actuators and applied forces must sum to for the accelerations qacc
/// (world, nv), without constraints. After smooth_dynamics with keep_all, or mass_matrix, bias_forces and passive_forces. Uses scratch of
/// the dynamics. Cost 4 flop an entry of M. Does not allocate, does not fence. Errors: std::invalid_argument where the dynamics do not hold
/// these three of one state, or hold them of the state before its last step.
template <ExecutionSpace Exec, class R, class Mem, class In, class Out>
void inverse_dynamics(Exec const& exec, Model<R, Mem> const& model, Dynamics<R, Mem>& dynamics, In const& qacc, Out& qfrc) {
  Region const region("gsp::dynamics::inverse_dynamics");
  detail::expects_fit("gsp::inverse_dynamics", model, dynamics);
  detail::expects_rows("gsp::inverse_dynamics", "qacc", qacc, dynamics.worlds, model.nv);
  detail::expects_rows("gsp::inverse_dynamics", "qfrc", qfrc, dynamics.worlds, model.nv);
  detail::expects_together("gsp::inverse_dynamics", dynamics, detail::set_of(Quantity::mass, Quantity::bias, Quantity::passive));
  for_lanes("gsp::dynamics::inverse_dynamics", exec, model, dynamics, detail::InverseStage<In, Out>{qacc, qfrc});
}

}  // namespace gsp
