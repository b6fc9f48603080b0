#pragma once
#include <gsp/constraint/rows.hpp>

/// The projection of one element: what every path of the solver, and its residual, do with the rows of a contact, a limit, or an element of
/// a user's own.
namespace gsp {

/// The laws of up to N rows, as numbers of type T: a plain one, or a pack with a world a lane.
template <class T, int N>
struct ElementLaw {
  T inverse_diagonal[N];  // 1 / (|Y|^2 + C), 0: the row cannot move
  T lower[N], upper[N];   // where mu < 0
  T mu[N];                // friction: +-mu times the absolute impulse of row `normal` of the element
  T normal[N];
  unsigned char normals[N];  // bits of the rows that `normal` names in any of the lanes
};

/// Takes a row's law into lane `lane` of place b.
template <class T, int N, class R, class Set>
KOKKOS_INLINE_FUNCTION void set_law(ElementLaw<T, N>& law, int b, Row<R> const& row, Set const& set) {
  bool const friction = row.friction_of >= 0;
  set(law.inverse_diagonal[b], row.inverse_diagonal);
  set(law.lower[b], row.lower);
  set(law.upper[b], row.upper);
  set(law.mu[b], friction ? row.mu : R(-1));
  set(law.normal[b], R(row.friction_of));
  if (friction) law.normals[b] |= static_cast<unsigned char>(1 << row.friction_of);
}

/// The impulse that takes row b of an element to its bounds or to rest, where its rate is w and the impulses of the element are p (of N
/// rows at most):   p_b <- clamp(p_b - relaxation w / (|Y_b|^2 + C_b)).
template <int N, class T>
KOKKOS_FORCEINLINE_FUNCTION T project_row(ElementLaw<T, N> const& law, int first, int b, int rows, T const& w, T const* p,
                                          T const& relaxation) {
  T bound(0);
  int const at = first + b;
  if (law.normals[at] != 0) {
    for (int a = 0; a < rows; ++a)
      if ((law.normals[at] >> a) & 1) bound = select(law.normal[at] == T(a), abs(p[first + a]), bound);
    bound = law.mu[at] * bound;
  }
  auto const friction = law.mu[at] >= T(0);
  T const lower = select(friction, -bound, law.lower[at]), upper = select(friction, bound, law.upper[at]);
  T const next = clamp(fma(-relaxation * law.inverse_diagonal[at], w, p[at]), lower, upper);
  return select(law.inverse_diagonal[at] > T(0), next, p[at]);
}

/// One pass over the `rows` rows of the element that begins at place `first` of `law`: each sees what those before it have done.
/// @param coupling  coupling(b, a) = Y_b . Y_a of the rows b > a of the element
/// @param w         in: rates J v+ + C p - zeta of the rows before the pass
/// @param p         in, out: impulses [N s];   @param d  out: their changes.   All three are indexed as the law is
/// Cost rows^2 flop.
template <int N, class T, class Coupling>
KOKKOS_FORCEINLINE_FUNCTION void project_element(ElementLaw<T, N> const& law, int first, int rows, Coupling const& coupling,
                                                 T const& relaxation, T* w, T* p, T* d) {
  for (int b = 0; b < rows; ++b) {
    for (int a = 0; a < b; ++a) w[first + b] = fma(coupling(b, a), d[first + a], w[first + b]);
    T const next = project_row(law, first, b, rows, w[first + b], p, relaxation);
    d[first + b] = next - p[first + b];
    p[first + b] = next;
  }
}

/// By how much the rows of an element miss their conditions at the impulses p and rates w: the largest change of rate that one more
/// projection of any of them would make [m/s, rad/s].
template <int N, class T>
KOKKOS_FORCEINLINE_FUNCTION T element_residual(ElementLaw<T, N> const& law, int first, int rows, T const* w, T const* p) {
  T worst(0);
  for (int b = 0; b < rows; ++b) {
    int const at = first + b;
    auto const movable = law.inverse_diagonal[at] > T(0);
    T const miss = abs(project_row(law, first, b, rows, w[at], p, T(1)) - p[at]);
    worst = max(worst, select(movable, miss / select(movable, law.inverse_diagonal[at], T(1)), T(0)));
  }
  return worst;
}

}  // namespace gsp
