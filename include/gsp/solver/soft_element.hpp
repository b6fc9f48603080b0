#pragma once
#include <gsp/constraint/rows.hpp>
#include <type_traits>

/// What the rows of one element answer to their rates where all of them are soft, as in MuJoCo's convex problem:
///   p(w) = argmax over the impulses allowed of  -p . w - p . C p / 2,   its value the cost s(w),   p = -ds/dw
///   a row with bounds              p = clamp(-w / C, lower, upper)
///   a normal a and its friction b  p in the cone  |p_b / mu_b| <= p_a.   With U_b = mu_b w_b, T = |U|, N = mu w_a, mu = mu_1 sqrt(C_1 /
///   C_a):
///     N >= mu T       p = 0
///     mu N + T <= 0   p = -w / C
///     else            p_a = -D mu (N - mu T),  p_b = -p_a mu_b U_b / T,   D = 1 / (C_a mu^2 (1 + mu^2))
/// The cone's projection is that simple where C_b mu_b^2 is the same for all of its friction rows: the first row's counts for all.
/// Source: MuJoCo's documentation, "Computation: constraint model", "Computation: primal problem".
namespace gsp {

/// The least compliance of a rigid row: this share of the sum, over the dofs that it moves, of the largest Y^2 that any row has there.
/// What is rigid (C < rigid_softness |Y|^2), or of leverage too small to tell from none, is this soft: rows between which a dof cannot
/// choose weigh by Y^2, as in MuJoCo, whose least is 1e-15 for all.
template <class R>
inline constexpr R least_softness = R(sizeof(R) == 4 ? 1e-7 : 1e-10);

template <class R>
struct SoftElement {
  static constexpr int N = most_element_rows;
  int rows = 0;
  R compliance[N], lower[N], upper[N];
  R mu[N];                // of friction
  signed char normal[N];  // the row that this is friction of, -1: bounds
  R cone_mu[N];           // of a normal: mu of its cone; 0: it has none
};

/// The rows `row` ... `row + rows - 1` of one element.
/// @param least  the least compliance of each
template <class R>
KOKKOS_INLINE_FUNCTION SoftElement<R> soft_element(Row<R> const* row, int rows, R const* least) {
  SoftElement<R> e;
  e.rows = rows;
  for (int b = 0; b < rows; ++b) {
    e.compliance[b] = max(row[b].compliance, least[b]);
    e.lower[b] = row[b].lower;
    e.upper[b] = row[b].upper;
    e.mu[b] = row[b].mu;
    e.normal[b] = row[b].friction_of;
    e.cone_mu[b] = R(0);
  }
  for (int b = 0; b < rows; ++b) {
    int const a = e.normal[b];
    if (a < 0 || !(e.mu[b] > R(0))) continue;
    if (e.cone_mu[a] == R(0)) e.cone_mu[a] = e.mu[b] * sqrt(e.compliance[b] / e.compliance[a]);
    e.compliance[b] = e.compliance[a] * square(e.cone_mu[a] / e.mu[b]);
  }
  return e;
}

namespace detail {
enum class ConeZone : int { free, sticks, slides };
/// Where the rates of normal `a` and its friction lie.
template <class R>
struct ConePoint {
  R N, T;
  ConeZone zone;
  template <class Element>
  KOKKOS_INLINE_FUNCTION ConePoint(Element const& e, int a, R const* w) {
    R const mu = e.cone_mu[a];
    R square_sum(0);
    for (int b = 0; b < e.rows; ++b)
      if (e.normal[b] == a && e.mu[b] > R(0)) square_sum += square(e.mu[b] * w[b]);
    N = mu * w[a];
    T = sqrt(square_sum);
    zone = N >= mu * T ? ConeZone::free : mu * N + T <= R(0) ? ConeZone::sticks : ConeZone::slides;
  }
};
template <class Element>
KOKKOS_INLINE_FUNCTION auto cone_stiffness(Element const& e, int a) {
  using R = std::remove_cvref_t<decltype(e.cone_mu[a])>;
  R const mu2 = square(e.cone_mu[a]);
  return R(1) / (e.compliance[a] * mu2 * (R(1) + mu2));
}
}  // namespace detail

/// p(w) [N s] of rates w [m/s, rad/s].
/// @param e  a SoftElement, or what has its members
template <class Element, class R>
KOKKOS_INLINE_FUNCTION void soft_impulses(Element const& e, R const* w, R* p) {
  for (int a = 0; a < e.rows; ++a)
    if (e.normal[a] >= 0 && !(e.mu[a] > R(0))) p[a] = R(0);
  for (int a = 0; a < e.rows; ++a) {
    if (e.normal[a] >= 0) continue;
    if (e.cone_mu[a] == R(0)) {
      p[a] = clamp(-w[a] / e.compliance[a], e.lower[a], e.upper[a]);
      continue;
    }
    detail::ConePoint<R> const at(e, a, w);
    R const mu = e.cone_mu[a];
    p[a] = at.zone == detail::ConeZone::free     ? R(0)
           : at.zone == detail::ConeZone::sticks ? -w[a] / e.compliance[a]
                                                 : -detail::cone_stiffness(e, a) * mu * (at.N - mu * at.T);
    for (int b = 0; b < e.rows; ++b) {
      if (e.normal[b] != a || !(e.mu[b] > R(0))) continue;
      p[b] = at.zone == detail::ConeZone::free     ? R(0)
             : at.zone == detail::ConeZone::sticks ? -w[b] / e.compliance[b]
                                                   : -p[a] * square(e.mu[b]) * w[b] / at.T;
    }
  }
}

/// s(w) of the impulses p = p(w) [J]
template <class Element, class R>
KOKKOS_INLINE_FUNCTION R soft_cost(Element const& e, R const* w, R const* p) {
  R cost(0);
  for (int b = 0; b < e.rows; ++b) cost -= p[b] * fma(R(0.5) * e.compliance[b], p[b], w[b]);
  return cost;
}

/// -ds / dalpha of s(w + alpha c)
template <class Element, class R>
KOKKOS_INLINE_FUNCTION R soft_pull(Element const& e, R const* w, R const* c, R alpha) {
  R at[most_element_rows], p[most_element_rows], sum(0);
  for (int b = 0; b < e.rows; ++b) at[b] = fma(alpha, c[b], w[b]);
  soft_impulses(e, at, p);
  for (int b = 0; b < e.rows; ++b) sum = fma(p[b], c[b], sum);
  return sum;
}

/// B = d2s / dw2, symmetric, positive semidefinite; false where it is zero.
/// Sliding, with g = grad (N - mu T):   B = D (g g^T - mu (N - mu T) d2T / dw2)
template <class Element, class R>
KOKKOS_INLINE_FUNCTION bool soft_curvature(Element const& e, R const* w, R (&B)[most_element_rows][most_element_rows]) {
  bool any = false;
  for (int a = 0; a < e.rows; ++a)
    for (int b = 0; b < e.rows; ++b) B[a][b] = R(0);
  for (int a = 0; a < e.rows; ++a) {
    if (e.normal[a] >= 0) continue;
    if (e.cone_mu[a] == R(0)) {
      R const p = -w[a] / e.compliance[a];
      if (!(p > e.lower[a] && p < e.upper[a])) continue;
      B[a][a] = R(1) / e.compliance[a];
      any = true;
      continue;
    }
    detail::ConePoint<R> const at(e, a, w);
    if (at.zone == detail::ConeZone::free) continue;
    any = true;
    if (at.zone == detail::ConeZone::sticks) {
      for (int b = 0; b < e.rows; ++b)
        if (b == a || (e.normal[b] == a && e.mu[b] > R(0))) B[b][b] = R(1) / e.compliance[b];
      continue;
    }
    R const mu = e.cone_mu[a], D = detail::cone_stiffness(e, a), bend = -D * mu * (at.N - mu * at.T) / at.T;
    R u[most_element_rows];  // dT / dw
    for (int b = 0; b < e.rows; ++b) u[b] = e.normal[b] == a && e.mu[b] > R(0) ? square(e.mu[b]) * w[b] / at.T : R(0);
    B[a][a] = D * square(mu);
    for (int b = 0; b < e.rows; ++b) {
      if (e.normal[b] != a || !(e.mu[b] > R(0))) continue;
      B[a][b] = B[b][a] = -D * square(mu) * u[b];
      for (int c = 0; c < e.rows; ++c)
        if (e.normal[c] == a && e.mu[c] > R(0))
          B[b][c] = D * square(mu) * u[b] * u[c] + bend * ((b == c ? square(e.mu[b]) : R(0)) - u[b] * u[c]);
    }
  }
  return any;
}

}  // namespace gsp
