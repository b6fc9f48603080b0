#pragma once
#include <gsp/constraint/rows.hpp>
#include <utility>

/// The projection of one element: what every path of the solver, and its residual, do with the rows of a contact, a limit, or an element of
/// a user's own.
namespace gsp {

/// In which lanes something holds.
enum class InLanes : unsigned char { none, some, all };

/// The laws of up to N rows, as numbers of type T: a plain one, or a pack with an island a lane.
template <class T, int N>
struct ElementLaw {
  T inverse_diagonal[N];  // 1 / (|Y|^2 + C), or the step of two rows together; 0: the row cannot move (profile stable: its bounds are 0)
  T lower[N], upper[N];   // where mu < 0
  T mu[N];                // friction: +-mu times the absolute impulse of row `normal` of the element
  T normal[N];
  T with_next[N];            // 1: this row and the next are bounded together, in an ellipse (RowBounds)
  unsigned char normals[N];  // bits of the rows that `normal` names in any of the lanes
  InLanes ellipse[N];        // where with_next is 1
};

/// Place b of a law: no row.
template <class T, int N>
KOKKOS_INLINE_FUNCTION void clear_law(ElementLaw<T, N>& law, int b) {
  law.inverse_diagonal[b] = law.lower[b] = law.upper[b] = law.normal[b] = law.with_next[b] = T(0);
  law.mu[b] = T(-1);
  law.normals[b] = 0;
  law.ellipse[b] = InLanes::none;
}
/// A row's law at place b.
/// @param row  a Row, or what has its numbers and bounds
template <int N, class R, class RowLike>
KOKKOS_INLINE_FUNCTION void set_law(ElementLaw<R, N>& law, int b, RowLike const& row) {
  law.inverse_diagonal[b] = row.inverse_diagonal;
  law.lower[b] = row.lower;
  law.upper[b] = row.upper;
  law.mu[b] = row.mu;
  law.normal[b] = R(row.friction_of);
  law.with_next[b] = R(row.with_next);
  law.normals[b] = static_cast<unsigned char>(row.friction_of >= 0 ? 1 << row.friction_of : 0);
  law.ellipse[b] = row.with_next ? InLanes::all : InLanes::none;
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
/// f(0), ..., f(n - 1), numbers known to the compiler, so that what the rows of an element need stays in registers.
template <int n, class F>
KOKKOS_FORCEINLINE_FUNCTION void unrolled(F const& f) {
  unroll(f, std::make_integer_sequence<int, n>{});
}

/// Absolute impulse of the row that row b's friction hangs on: one of rows a... of the element. A fold: through a lambda g++ 12 keeps p in
/// memory, and sweeps take 15 % longer.
template <int N, class T, int... a>
KOKKOS_FORCEINLINE_FUNCTION T normal_impulse(ElementLaw<T, N> const& law, int first, int b, T const* p, std::integer_sequence<int, a...>) {
  T impulse(0);
  unsigned const normals = law.normals[first + b];
  ((impulse = normals == 1u << a    ? abs(p[first + a])
              : (normals >> a) & 1u ? select(law.normal[first + b] == T(int(a)), abs(p[first + a]), impulse)
                                    : impulse),
   ...);
  return impulse;
}
template <int rows, int N, class T>
KOKKOS_FORCEINLINE_FUNCTION T normal_impulse(ElementLaw<T, N> const& law, int first, int b, T const* p) {
  return normal_impulse(law, first, b, p, std::make_integer_sequence<int, rows>{});
}
/// p_b - relaxation w / (|Y_b|^2 + C_b), where w is the row's rate.
template <int N, class T>
KOKKOS_FORCEINLINE_FUNCTION T unbounded(ElementLaw<T, N> const& law, int at, T const& w, T const* p, T const& relaxation) {
  return fma(-relaxation * law.inverse_diagonal[at], w, p[at]);
}
}  // namespace detail

/// The impulse that takes row b of an element of (at most) `rows` rows to its bounds or to rest, where its rate is w and the impulses of
/// the element are p:   p_b <- clamp(p_b - relaxation w / (|Y_b|^2 + C_b)).
/// @param first  place of the element in `law` and p
template <int rows, int N, class T>
KOKKOS_FORCEINLINE_FUNCTION T project_row(ElementLaw<T, N> const& law, int first, int b, T const& w, T const* p, T const& relaxation) {
  int const at = first + b;
  T const step = detail::unbounded(law, at, w, p, relaxation);
  if (law.normals[at] == 0) return clamp(step, law.lower[at], law.upper[at]);
  T const bound = law.mu[at] * detail::normal_impulse<rows>(law, first, b, p);
  auto const friction = law.mu[at] >= T(0);
  return clamp(step, select(friction, -bound, law.lower[at]), select(friction, bound, law.upper[at]));
}

/// The same for rows b and b + 1 whose impulses lie in an ellipse: one step for both, so that friction opposes slip, then back along the
/// ray to the centre of (p_1 / mu_1)^2 + (p_2 / mu_2)^2 <= p_normal^2 in p / mu, which is the nearest point there. At rest mu_i w_i is
/// antiparallel to p_i / mu_i: the law of largest dissipation.
/// @param w1, w2  rates of the two rows, of the same impulses
/// @param p1, p2  out: their impulses
template <int rows, int N, class T>
KOKKOS_FORCEINLINE_FUNCTION void project_ellipse(ElementLaw<T, N> const& law, int first, int b, T const& w1, T const& w2, T const* p,
                                                 T const& relaxation, T& p1, T& p2) {
  int const at = first + b, to = b + 1 < rows ? at + 1 : at;
  p1 = detail::unbounded(law, at, w1, p, relaxation);
  p2 = detail::unbounded(law, to, w2, p, relaxation);
  T const x = p1 * law.mu[to], y = p2 * law.mu[at], r2 = fma(x, x, y * y);  // mu_1 mu_2 p / mu: no division by a small mu
  T const radius = law.mu[at] * law.mu[to] * detail::normal_impulse<rows>(law, first, b, p);
  auto const outside = r2 > radius * radius;
  T const scale = select(outside, radius / sqrt(select(outside, r2, T(1))), T(1));
  p1 = scale * p1;
  p2 = scale * p2;
}

namespace detail {
/// What project_element takes from row to row. The rows' numbers are known to the compiler, so that impulses and rates stay in registers:
/// through memory, each row would wait for what the one before has stored.
template <int rows, int N, class T, class Coupling>
struct ElementPass {
  ElementLaw<T, N> const& law;
  int first;
  Coupling const& coupling;
  T const& relaxation;
  T *w, *p, *d;
  T second = T(0);  // impulse of this row where it has been found together with the row before

  /// Rate of row b after the rows a... before it.
  template <int... a>
  KOKKOS_FORCEINLINE_FUNCTION T after(T rate, [[maybe_unused]] int b, std::integer_sequence<int, a...>) const {
    ((rate = fma(coupling(b, a), d[first + a], rate)), ...);
    return rate;
  }
  template <int b>
  KOKKOS_FORCEINLINE_FUNCTION void row() {
    constexpr std::make_integer_sequence<int, b> before;
    int const at = first + b;
    InLanes found = InLanes::none, ellipse = InLanes::none;
    if constexpr (b > 0) found = law.ellipse[at - 1];
    if constexpr (b + 1 < rows) ellipse = law.ellipse[at];
    T next = second;
    if (found != InLanes::all) {
      w[at] = after(w[at], b, before);
      if (ellipse != InLanes::all) next = project_row<rows>(law, first, b, w[at], p, relaxation);
      if constexpr (b > 0)
        if (found == InLanes::some) next = select(law.with_next[at - 1] > T(0), second, next);
    }
    if constexpr (b + 1 < rows) {
      if (ellipse != InLanes::none) {
        T p1, p2;
        project_ellipse<rows>(law, first, b, w[at], after(w[at + 1], b + 1, before), p, relaxation, p1, p2);
        next = ellipse == InLanes::all ? p1 : select(law.with_next[at] > T(0), p1, next);
        second = p2;
      }
    }
    d[at] = next - p[at];
    p[at] = next;
  }
  template <int... b>
  KOKKOS_FORCEINLINE_FUNCTION void all(std::integer_sequence<int, b...>) {
    (row<b>(), ...);
  }
};
}  // namespace detail

/// One pass over the rows of the element that begins at place `first` of `law`: each sees what those before it have done.
/// @param coupling  coupling(b, a) = Y_b . Y_a of the rows b > a of the element
/// @param w         in, lost: rates J v+ + C p - zeta of the rows before the pass
/// @param p         in, out: impulses [N s];   @param d  out: their changes.   All three are indexed as the law is
/// Cost rows^2 flop.
template <int rows, int N, class T, class Coupling>
KOKKOS_FORCEINLINE_FUNCTION void project_element(ElementLaw<T, N> const& law, int first, Coupling const& coupling, T const& relaxation,
                                                 T* w, T* p, T* d) {
  detail::ElementPass<rows, N, T, Coupling> pass{law, first, coupling, relaxation, w, p, d};
  pass.all(std::make_integer_sequence<int, rows>{});
}

/// By how much each row of an element misses its conditions at the impulses p and rates w: f(b, miss), miss >= 0 the change of its rate
/// that one more projection would make [m/s, rad/s], 0 of rows that cannot move. It is the natural map (p - proj(p - w / A)) A, A = |Y|^2 +
/// C.
template <int rows, int N, class T, class F>
KOKKOS_FORCEINLINE_FUNCTION void element_misses(ElementLaw<T, N> const& law, int first, T const* w, T const* p, F const& f) {
  T second(0);
  detail::unrolled<rows>([&](auto b) {
    int const at = first + b, before = b > 0 ? at - 1 : at, to = b + 1 < rows ? at + 1 : at;
    T next = project_row<rows>(law, first, b, w[at], p, T(1));
    if (b > 0 && law.ellipse[before] != InLanes::none) next = select(law.with_next[before] > T(0), second, next);
    if (b + 1 < rows && law.ellipse[at] != InLanes::none) {
      T p1;
      project_ellipse<rows>(law, first, b, w[at], w[to], p, T(1), p1, second);
      next = select(law.with_next[at] > T(0), p1, next);
    }
    auto const movable = law.inverse_diagonal[at] > T(0);
    T const miss = abs(next - p[at]) + (w[at] - w[at]);  // bounds have taken what is no number for one of them
    f(b, select(movable, miss / select(movable, law.inverse_diagonal[at], T(1)), T(0)));
  });
}

/// By how much the rows of an element miss their conditions at the impulses p and rates w: the largest change of rate that one more
/// projection of any of them would make [m/s, rad/s].
template <int rows, int N, class T>
KOKKOS_FORCEINLINE_FUNCTION T element_residual(ElementLaw<T, N> const& law, int first, T const* w, T const* p) {
  T worst(0);
  element_misses<rows>(law, first, w, p, [&](int, T const& miss) { worst = max_or_nan(worst, miss); });
  return worst;
}

}  // namespace gsp
