#pragma once
#include <gsp/constraint/rows.hpp>
#include <utility>

/// The projection of one element: what every path of the solver, and its residual, do with the rows of a contact, a limit, or an element of
/// a user's own.
namespace gsp {

/// The laws of up to N rows, as numbers of type T: a plain one, or a pack with a world a lane.
template <class T, int N>
struct ElementLaw {
  T inverse_diagonal[N];  // 1 / (|Y|^2 + C); 0: the row cannot move, and its bounds are 0
  T lower[N], upper[N];   // where mu < 0
  T mu[N];                // friction: +-mu times the absolute impulse of row `normal` of the element
  T normal[N];
  unsigned char normals[N];  // bits of the rows that `normal` names in any of the lanes
};

/// Place b of a law: no row.
template <class T, int N>
KOKKOS_INLINE_FUNCTION void clear_law(ElementLaw<T, N>& law, int b) {
  law.inverse_diagonal[b] = law.lower[b] = law.upper[b] = law.normal[b] = T(0);
  law.mu[b] = T(-1);
  law.normals[b] = 0;
}
/// Takes a row's law to place b; set(place, value) writes one lane.
template <class T, int N, class R, class Set>
KOKKOS_INLINE_FUNCTION void set_law(ElementLaw<T, N>& law, int b, Row<R> const& row, Set const& set) {
  bool const friction = row.friction_of >= 0;
  set(law.inverse_diagonal[b], row.inverse_diagonal);
  set(law.lower[b], row.lower);
  set(law.upper[b], row.upper);
  set(law.mu[b], row.mu);
  set(law.normal[b], R(row.friction_of));
  if (friction) law.normals[b] |= static_cast<unsigned char>(1 << row.friction_of);
}

namespace detail {
/// A number that the compiler knows, on a GPU too (std::integral_constant is the host's).
template <int i>
struct Index {
  KOKKOS_INLINE_FUNCTION constexpr operator int() const { return i; }
};
template <class F, int... i>
KOKKOS_FORCEINLINE_FUNCTION void unroll(F const& f, std::integer_sequence<int, i...>) {
  (f(Index<i>{}), ...);
}
/// f(0), ..., f(n - 1); on a GPU with numbers known to the compiler, so that what the rows of an element need stays in registers.
template <int n, class F>
KOKKOS_FORCEINLINE_FUNCTION void unrolled(F const& f) {
#ifdef __CUDA_ARCH__
  unroll(f, std::make_integer_sequence<int, n>{});
#else
  for (int i = 0; i < n; ++i) f(i);
#endif
}
}  // namespace detail

/// The impulse that takes row b of an element of (at most) `rows` rows to its bounds or to rest, where its rate is w and the impulses of
/// the element are p:   p_b <- clamp(p_b - relaxation w / (|Y_b|^2 + C_b)).
/// @param first  place of the element in `law` and p
template <int rows, int N, class T>
KOKKOS_FORCEINLINE_FUNCTION T project_row(ElementLaw<T, N> const& law, int first, int b, T const& w, T const* p, T const& relaxation) {
  int const at = first + b;
  T const step = fma(-relaxation * law.inverse_diagonal[at], w, p[at]);
  unsigned const normals = law.normals[at];
  if (normals == 0) return clamp(step, law.lower[at], law.upper[at]);
  T bound(0);
  detail::unrolled<rows>([&](auto a) {
    if (normals == 1u << a)
      bound = abs(p[first + a]);
    else if ((normals >> a) & 1u)
      bound = select(law.normal[at] == T(int(a)), abs(p[first + a]), bound);
  });
  bound = law.mu[at] * bound;
  auto const friction = law.mu[at] >= T(0);
  return clamp(step, select(friction, -bound, law.lower[at]), select(friction, bound, law.upper[at]));
}

/// One pass over the rows of the element that begins at place `first` of `law`: each sees what those before it have done.
/// @param coupling  coupling(b, a) = Y_b . Y_a of the rows b > a of the element
/// @param w         in: rates J v+ + C p - zeta of the rows before the pass
/// @param p         in, out: impulses [N s];   @param d  out: their changes.   All three are indexed as the law is
/// Cost rows^2 flop.
template <int rows, int N, class T, class Coupling>
KOKKOS_FORCEINLINE_FUNCTION void project_element(ElementLaw<T, N> const& law, int first, Coupling const& coupling, T const& relaxation,
                                                 T* w, T* p, T* d) {
  detail::unrolled<rows>([&](auto b) {
    for (int a = 0; a < b; ++a) w[first + b] = fma(coupling(b, a), d[first + a], w[first + b]);
    T const next = project_row<rows>(law, first, b, w[first + b], p, relaxation);
    d[first + b] = next - p[first + b];
    p[first + b] = next;
  });
}

/// By how much the rows of an element miss their conditions at the impulses p and rates w: the largest change of rate that one more
/// projection of any of them would make [m/s, rad/s].
template <int rows, int N, class T>
KOKKOS_FORCEINLINE_FUNCTION T element_residual(ElementLaw<T, N> const& law, int first, T const* w, T const* p) {
  T worst(0);
  detail::unrolled<rows>([&](auto b) {
    int const at = first + b;
    auto const movable = law.inverse_diagonal[at] > T(0);
    T const miss = abs(project_row<rows>(law, first, b, w[at], p, T(1)) - p[at]);
    worst = max(worst, select(movable, miss / select(movable, law.inverse_diagonal[at], T(1)), T(0)));
  });
  return worst;
}

}  // namespace gsp
