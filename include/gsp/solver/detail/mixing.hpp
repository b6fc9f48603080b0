#pragma once
#include <gsp/core/exec.hpp>
#include <gsp/math/scalar.hpp>
#include <gsp/solver/detail/coarse.hpp>
#include <gsp/solver/detail/leap.hpp>
#include <gsp/solver/detail/pgs_options.hpp>

/// Anderson's mixing of sweeps: a sweep takes the impulses p to g = p + f, and f vanishes at the solution. From the fifth sweep on, every
/// second time, the two differences that the last three sweeps have made say where f would:
///   p <- g - sum gamma_k dg_k,   gamma the least of |f - sum gamma_k df_k|^2 + e |gamma|^2,   |f|^2 = sum f_r^2 (|Y_r|^2 + C_r)
/// What it weighs by is what makes f a rate. e keeps differences that are nearly the same from large weights of opposite sign. Friction has
/// several solutions, and a mixture may leave where sweeps would go: one whose sweep has a larger f is taken back. So that starts that
/// differ by rounding stay together, gamma lies on a grid (coarse.hpp), and where f hardly changes, so that gamma is made of rounding, none
/// is made. (Walker and Ni, Anderson acceleration for fixed-point iterations, 2011; every second time: Banerjee,
/// Suryanarayana and Pask, periodic Pulay method, 2016)
namespace gsp::detail {

// Of the trace of the differences' products; by how much |f|^2 may grow in the sweep after; of |f|^2, what that of the
// differences is at least, or no mixture is made; and from where on gamma lies on the fine grid; as many sweeps far it goes at most, or is
// not made.
inline constexpr double mixing_softness = 1e-4, mixing_most_growth = 4, mixing_least_change = 2e-4, mixing_fine_change = 1,
                        mixing_most_weight = 100;
// Sweeps: the first one that is mixed, and from one to the next. What rests takes four and is left alone.
inline constexpr int mixing_from = 4, mixing_every = 2;
// Sweeps that must be left to settle what a mixture has thrown over bounds and friction.
inline constexpr int mixing_least_left = 4;

/// Whether a mixture follows on sweep number `sweep` (from 0).
KOKKOS_INLINE_FUNCTION constexpr bool mixes_after(int sweep, PgsOptions const& options) {
  return options.accelerate && sweep >= mixing_from && sweep % mixing_every == 0 && sweep + mixing_least_left < options.iterations;
}
/// Whether a mixture after it asks what it did, or it begins from one: then impulses before it are kept, and what it missed is looked at.
/// (Leaps ask for them too, and follow on such sweeps alone.)
KOKKOS_INLINE_FUNCTION constexpr bool is_remembered(int sweep, PgsOptions const& options) {
  return options.accelerate && sweep + 2 >= mixing_from && sweep + mixing_least_left <= options.iterations;
}

/// Whether what is known is dropped after sweep number `sweep` (from 0), the 16th and the 40th, and z is summed anew, Y^T p: hosts pack the
/// islands that go on together then (pgs_lockstep.hpp), which start as if from new, and all paths do the same.
KOKKOS_INLINE_FUNCTION constexpr bool begins_anew(int sweep, PgsOptions const& options) {
  return options.tolerance > 0 && (sweep == 15 || sweep == 39) && sweep + mixing_least_left < options.iterations;
}

/// What is known of the sweeps of an island.
template <class R>
struct MixingMemory {
  static constexpr R any = Kokkos::Experimental::infinity_v<R>;
  int known = 0;                                                         // sweeps in a row, with the last one
  R least = any;                                                         // |f|^2 of the sweeps since a leap or a beginning
  R most = any;                                                          // of the next one, or what it begins from is taken back
  KOKKOS_INLINE_FUNCTION bool knows_both() const { return known >= 3; }  // differences
  /// Whether a mixture may follow on sweep number `sweep`, which misses by `misses`, |f|^2; leaps: a leap does.
  KOKKOS_INLINE_FUNCTION bool after(int sweep, PgsOptions const& options, bool leaps, R misses) {
    ++known;
    if (leaps || begins_anew(sweep, options)) {
      known = 0;
      least = any;
    }
    most = leaps ? R(leap_most_misses) * misses : any;
    return known >= 2 && mixes_after(sweep, options);
  }
  /// It is made.
  KOKKOS_INLINE_FUNCTION void mixes() { most = R(mixing_most_growth) * least; }
  /// Whether the sweep that began from a mixture or a leap missed by too much more than the best: it is taken back. Both follow on even
  /// sweeps, so that none follows on what is taken back.
  KOKKOS_INLINE_FUNCTION bool is_worse(R misses) {
    bool const worse = misses > most;
    if (worse) known = -1;
    least = misses < least ? misses : least;
    return worse;
  }
};

/// Products of the differences df_1 = f - f_1, df_2 = f_1 - f_2 and of f, where f_1, f_2 are of the sweeps before.
template <class T>
struct MixingSums {
  T dd11, dd12, dd22, df1, df2;
  /// @param weight  |Y|^2 + C of the row, 0 where it cannot move
  /// @param both    whether the second difference is known: f2 may be anything where it is not
  template <class Condition>
  KOKKOS_INLINE_FUNCTION void add_row(T const& weight, T const& f, T const& f1, T const& f2, Condition const& both) {
    T const d1 = f - f1, d2 = select(both, f1 - f2, T(0.0f)), w1 = weight * d1, w2 = weight * d2;
    dd11 = fma(w1, d1, dd11);
    dd12 = fma(w1, d2, dd12);
    dd22 = fma(w2, d2, dd22);
    df1 = fma(w1, f, df1);
    df2 = fma(w2, f, df2);
  }
  KOKKOS_INLINE_FUNCTION MixingSums& operator+=(MixingSums const& o) {
    dd11 += o.dd11;
    dd12 += o.dd12;
    dd22 += o.dd22;
    df1 += o.df1;
    df2 += o.df2;
    return *this;
  }
};
/// gamma of the two.
template <class T>
struct Mixing {
  T gamma1, gamma2;
  KOKKOS_INLINE_FUNCTION auto helps() const { return abs(gamma1) + abs(gamma2) > T(0.0f); }
  /// The mixture of p, p_1 and p_2, the latter of the sweeps before.
  template <class Condition>
  KOKKOS_INLINE_FUNCTION T of(T const& p, T const& p1, T const& p2, Condition const& both) const {
    return p - fma(gamma1, p - p1, gamma2 * select(both, p1 - p2, T(0.0f)));
  }
};
/// gamma, 0 where f hardly changes or it would go too far.
/// @param misses  |f|^2 of the last sweep
template <class R, class T>
KOKKOS_INLINE_FUNCTION Mixing<T> best_mixing(MixingSums<T> const& s, T const& misses) {
  T const soft = T(R(mixing_softness)) * (s.dd11 + s.dd22), a = s.dd11 + soft, b = s.dd22 + soft, zero(R(0)), one(R(1));
  T const det = fma(a, b, -s.dd12 * s.dd12), least(R(8) * Kokkos::Experimental::norm_min_v<R>);
  auto const any = det > least;  // of what weighs little it vanishes among the least numbers
  T const inverse = one / select(any, det, one);
  T const gamma1 = (b * s.df1 - s.dd12 * s.df2) * inverse, gamma2 = (a * s.df2 - s.dd12 * s.df1) * inverse;
  T const changes = s.dd11 + s.dd22;
  auto const helps = any && changes > T(R(mixing_least_change)) * misses && abs(gamma1) + abs(gamma2) < T(R(mixing_most_weight));
  // where f changes little, what rounding has made of the state is a larger share of gamma
  T const share = select(changes > T(R(mixing_fine_change)) * misses, T(R(fine_share)), T(R(coarse_share)));
  return {select(helps, coarse<R>(gamma1, share), zero), select(helps, coarse<R>(gamma2, share), zero)};
}

}  // namespace gsp::detail
