#pragma once
#include <gsp/dynamics/actuator_forces.hpp>
#include <gsp/dynamics/detail/bias_derivative_lanes.hpp>
#include <gsp/dynamics/detail/rigid_tree_lanes.hpp>
#include <gsp/dynamics/detail/stiff_forces_lanes.hpp>

/// Kernels of gsp/dynamics/factor.hpp, where the contract stands.
namespace gsp::detail {

/// In place: for k from the leaves, rows of k's ancestors lose L_k^T D_k L_k. L_k overwrites row k; 1/D_k is kept.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_factor_in_place(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  for (int k = a.nv - 1; k >= 0; --k) {
    int const adr = l.index(a.row_adr, k), row = l.at.factor + adr, n = l.index(a.row_adr, k + 1) - adr;
    T const inverse = T(1) / max(s[row + n - 1], T(1e-15));  // a singular M stays finite, as MuJoCo has it
    l.each(n - 1, [&](int p) {
      int const ancestor = l.at.factor + l.index(a.row_adr, l.index(a.row_col, adr + p));
      T const entry = s[row + p] * inverse;
      each_batched(
          p + 1, [&](int q) { return fma(-entry, s[row + q], s[ancestor + q]); }, [&](int q, T const& y) { s[ancestor + q] = y; });
    });
    for (int p = l.worker; p < n - 1; p += L::workers) s[row + p] = s[row + p] * inverse;
    if (l.worker == 0) s[l.at.inverse_diagonal + k] = inverse;
  }
  l.sync();
}
/// factor <- M + h drag + diag(extra(i)), factored.
template <class L, class Extra>
KOKKOS_FORCEINLINE_FUNCTION void lanes_factor(L const& l, Extra const& extra) {
  auto const& a = l.a;
  auto const& s = l.items;
  l.each_batched(
      a.nM, [&](int e) { return s[l.at.mass + e]; }, [&](int e, auto const& m) { s[l.at.factor + e] = m; });
  if (a.drag) {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    T const h(l.model.timestep);
    l.each(a.nM, [&](int e) { s[l.at.factor + e] = fma(h, s[l.at.drag + e], s[l.at.factor + e]); });
  }
  l.each(a.nv, [&](int i) {
    int const diagonal = l.at.factor + l.index(a.row_adr, i + 1) - 1;
    s[diagonal] = s[diagonal] + extra(i);
  });
  lanes_factor_in_place(l);
}

/// x <- L^-T x, from the leaves to the root: x_i loses the sum of L_ki x_k over the dofs k that i moves, i + 1 .. of its body's subtree.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_solve_transposed(L const& l, int x) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  l.up([&](int b) {
    int const d0 = l.index(a.body_dofadr, b), end = l.index(a.body_dofend, b);
    for (int i = d0 + l.index(a.body_dofnum, b) - 1; i >= d0; --i) {
      int const place = l.index(a.row_adr, i + 1) - l.index(a.row_adr, i) - 1;
      T value = s[x + i];
      for (int k = end - 1; k > i; --k) value = fma(-s[l.at.factor + l.index(a.row_adr, k) + place], s[x + k], value);
      s[x + i] = value;
    }
  });
}
/// x <- L^-1 x, from the root to the leaves
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_solve_lower(L const& l, int x) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  l.down([&](int b) {
    for (int k = l.index(l.a.body_dofadr, b), end = k + l.index(l.a.body_dofnum, b); k < end; ++k) {
      int const adr = l.index(l.a.row_adr, k), n = l.index(l.a.row_adr, k + 1) - adr;
      T value = s[x + k];
      for (int p = 0; p < n - 1; ++p) value = fma(-s[l.at.factor + adr + p], s[x + l.index(l.a.row_col, adr + p)], value);
      s[x + k] = value;
    }
  });
}
/// x <- (L^T D L)^-1 x
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_solve(L const& l, int x) {
  lanes_solve_transposed(l, x);
  l.each_batched(
      l.a.nv, [&](int i) { return l.items[x + i] * l.items[l.at.inverse_diagonal + i]; },
      [&](int i, auto const& y) { l.items[x + i] = y; });
  lanes_solve_lower(l, x);
}

/// damping, stiffness <- what the matrix of profile stable takes implicitly: what the actuators have begun, and the dampers and springs of
/// the joints.
/// @param left  stiff forces go to rows; {}: nothing does
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_implicit_forces(L const& l, LeftForces const& left = {}) {
  auto const& s = l.items;
  auto const& m = l.model;
  lanes_leave_forces(l, left);
  l.each(l.a.nv, [&](int i) {
    if (m.dampers) s[l.at.damping + i] = s[l.at.damping + i] + lanes_damping(l, i, true);
    if (m.springs) s[l.at.stiffness + i] = s[l.at.stiffness + i] + l.constant(m.jnt_stiffness, l.jnt0, l.index(l.a.dof_jnt, i));
  });
}
/// The matrix that moves the robot. mujoco: M itself (joint damping enters when velocities are integrated); stable: M + h B + h^2 K with
/// lanes_implicit_forces, and what a fluid damps.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_factor_profile(L const& l, LeftForces const& left = {}) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  if (l.model.profile == Profile::mujoco) return lanes_factor(l, [](int) { return T(0); });
  T const h(l.model.timestep);
  lanes_implicit_forces(l, left);
  lanes_factor(l, [&](int i) { return h * fma(h, s[l.at.stiffness + i], s[l.at.damping + i]); });
}

/// force, acceleration <- passive - bias + actuator + applied forces; velocity <- qvel.
template <class L, class View>
KOKKOS_FORCEINLINE_FUNCTION void lanes_total_force(L const& l, View const& qfrc_applied) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  l.each_batched(
      l.a.nv, [&](int i) { return s[l.at.passive + i] - s[l.at.bias + i] + s[l.at.actuator + i] + l.load(qfrc_applied, l.dof0, i); },
      [&](int i, T const& f) {
        s[l.at.force + i] = s[l.at.acceleration + i] = f;
        s[l.at.impulse + i] = T(0);
      });
  l.each_batched(
      l.a.nv, [&](int i) { return s[l.at.qvel + i]; }, [&](int i, T const& v) { s[l.at.velocity + i] = v; });
}

/// velocity <- what the tree would have at the end of the step without constraints.
///   mujoco: v + h M^-1 f.   stable: v + M^^-1 (h f - h^2 K v), f without what is left to rows, its angular momentum then carried over
///   where the tree is one rigid body; M^ + h/2 d bias / d v in place of M^ where the tree is one that nothing damps
///   (lanes_solve_gyroscopic).
template <class L, class View>
KOKKOS_FORCEINLINE_FUNCTION void lanes_free_velocity(L const& l, View const& qfrc_applied) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  T const h(l.model.timestep);
  int const nv = l.a.nv;
  lanes_total_force(l, qfrc_applied);
  if (l.model.profile == Profile::stable)
    l.each(nv, [&](int i) { s[l.at.acceleration + i] = fma(-h * s[l.at.stiffness + i], s[l.at.velocity + i], s[l.at.acceleration + i]); });
  if (l.a.stiff) l.single([](auto const& one) { lanes_subtract_left(one, one.at.acceleration); });
  if (l.a.gyroscopic)
    l.seldom([](auto const& rare) { lanes_solve_gyroscopic(rare); });
  else
    lanes_solve(l, l.at.acceleration);
  l.each_batched(
      nv, [&](int i) { return fma(h, s[l.at.acceleration + i], s[l.at.velocity + i]); },
      [&](int i, T const& v) { s[l.at.velocity + i] = v; });
  if (carries_momentum(l)) {
    if (l.worker == 0) lanes_carry_momentum(l, lanes_leaves_any(l));
    l.sync();
  }
}

template <class State>
struct FactorStage {
  State state;
  LeftForces left;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    lanes_factor_profile(l, left);
    lanes_free_velocity(l, state.qfrc_applied);
  }
};

}  // namespace gsp::detail
