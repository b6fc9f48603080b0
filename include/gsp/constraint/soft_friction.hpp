#pragma once
#include <gsp/collision/collision_model.hpp>
#include <gsp/constraint/softness.hpp>

/// MuJoCo's contact friction: soft, with the impedance d of the contact's gap and the compliance R = (1 - d) / d diag of its normal.
///   elliptic   R_1 = R / impratio, R_k = R_1 (mu_1 / mu_k)^2; a rate to damp and no position to hold (K = 0), with the pair's
///              solreffriction where it has one: two positive numbers, or two that are not and not both 0
///   pyramidal  every edge J_n +- mu_k J_k: R = 2 mu^2 (1 - d) / d (1 + mu_1^2) diag, mu^2 = mu_1^2 / impratio; else as the normal
/// Source: MuJoCo's documentation, "Computation: friction cones", "Computation: parameters".
namespace gsp {

/// solref and solimp of a contact.
template <class R>
KOKKOS_INLINE_FUNCTION Softness<R> softness_of(ContactParameters<R> const& p, Refsafe refsafe) {
  Softness<R> s;
  s.refsafe = refsafe;
  for (int i = 0; i < 2; ++i) s.solref[i] = p.solref[i];
  for (int i = 0; i < 5; ++i) s.solimp[i] = p.solimp[i];
  return s;
}

template <class R>
struct SoftFriction {
  bool as_mujoco = false;  // contacts as in profile mujoco; else friction rows are rigid, but edges of a pyramid
  R impratio = R(1);
  Refsafe refsafe = Refsafe::two_steps;

  /// Friction row k (0, 1 sliding, 2 torsional, 3, 4 rolling) of an elliptic contact.
  /// @param gap   distance less margin [m];   @param u  rate of the row
  /// @param diag  of the normal (invweight0)
  KOKKOS_INLINE_FUNCTION RowLaw<R> tangent(ContactParameters<R> const& p, int k, R gap, R u, R h, R diag) const {
    Softness<R> s = softness_of(p, refsafe);
    R const impedance = impedance_of(s, gap);
    R const first = p.solreffriction[0], second = p.solreffriction[1];
    bool const own = (first > R(0)) == (second > R(0)) && (first != R(0) || second != R(0));
    for (int i = 0; i < 2 && own; ++i) s.solref[i] = p.solreffriction[i];
    RowLaw<R> law = soft_law(s, impedance, R(0), u, h, diag, true);
    law.compliance *= square(p.friction[0] / p.friction[k]) / impratio;
    return law;
  }
  /// Any edge of a pyramidal contact.
  KOKKOS_INLINE_FUNCTION RowLaw<R> edge(ContactParameters<R> const& p, R gap, R u, R h, R diag) const {
    Softness<R> const s = softness_of(p, refsafe);
    R const mu2 = square(p.friction[0]);
    RowLaw<R> law = soft_law(s, impedance_of(s, gap), gap, u, h, diag * (R(1) + mu2), false);
    law.compliance *= R(2) * mu2 / impratio;
    return law;
  }
};

}  // namespace gsp
