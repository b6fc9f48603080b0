#pragma once
#include <gsp/core/exec.hpp>
#include <gsp/math/scalar.hpp>
#include <gsp/solver/detail/coarse.hpp>
#include <gsp/solver/detail/pgs_options.hpp>

/// What hurries sweeps that are slow, where loads go far: now and then, the best point of the plane through the impulses p, their own
/// direction and that of the last sweep, d = p - p_before. Gauss-Seidel passes a load on by one body a sweep, and what a heavy body lays on
/// a light one by the share of the light: p grows along itself, or keeps on going as it went.
namespace gsp::detail {

// A leap goes on for so many sweeps at most, and grows p by so much along itself at most; it keeps half of p, since what bounds and
// friction say is left to the next sweep. What is wedged presses against itself, and such a p does not leap: where sum |Y_r p_r|^2 is more
// than 100,000 times |Y^T p|^2 (a weight of 10,000 on a light body: 20,000 times).
inline constexpr double leap_most_sweeps = 10000, leap_most_growth = 1000, leap_most_shrinking = 0.5, leap_most_stress = 1e5;
// Or it is none: it lowers E by more than so many times what the last sweep has. Leaps are for loads that sweeps do not carry on; where
// sweeps get on, each only throws what they have settled over bounds and friction again.
inline constexpr double leap_least_gain = 16;
// By how much |f|^2 (mixing.hpp) may grow in the sweep after, or the leap is taken back: those that settle loads take 2,000 at most.
inline constexpr double leap_most_misses = 1e4;
// What grows p by more than itself asks only the rows that no bound holds (best_leap).
inline constexpr double leap_held_growth = 1;
inline constexpr int leap_from = 8;        // sweeps before the first one; the next ones come after 16, 32, 64, ...
inline constexpr int leap_least_left = 4;  // sweeps to settle what it has thrown over bounds and friction

/// Whether a leap follows on sweep number `sweep` (from 0): then p and z before it are kept.
KOKKOS_INLINE_FUNCTION constexpr bool leaps_after(int sweep, PgsOptions const& options) {
  return options.accelerate && sweep >= leap_from && (sweep & (sweep - 1)) == 0 && sweep + leap_least_left < options.iterations;
}

/// Sweeps lower E, except where friction, which is no minimum of an energy, follows a normal: an island whose last sweep has raised E leaps
/// no more in this step, as the least E lies far off.
/// @param raised  by how much the sweep has raised E (SweepWork)
template <class R>
KOKKOS_INLINE_FUNCTION bool leaps_again(R raised) {
  return raised <= R(0);
}

/// What a sweep tells of E, summed row by row as they move.
///   raised  its change,   d (w + Y_b . sum Y_a d_a) + 1/2 d^2 (|Y|^2 + C), where row b of an element moves by d after the rows a < b have:
///           no difference of large numbers, as two values of E are
///   held_p  sum p w, held_d  sum d w:   slopes of E along p and d of rows that a bound holds, w the row's rate right after it has moved,
///           which is 0 for all others, but for rounding of p
template <class T>
struct SweepWork {
  T raised, held_p, held_d;
  /// @param p         impulse after the row has moved by d
  /// @param rate      w of the row before the element moves, + the products with the rows a < b
  /// @param change    d (|Y|^2 + C), what its rate changes by
  /// @param inverse_diagonal  1 / (|Y|^2 + C)
  /// @param together  of `rate`, what the row before has done, where both move together in an ellipse; or 0
  template <class R>
  KOKKOS_INLINE_FUNCTION void add_row(T const& p, T const& d, T const& rate, T const& change, T const& inverse_diagonal,
                                      T const& together) {
    T const w = rate - together + change;
    auto const held = abs(w) * inverse_diagonal > T(R(4) * Kokkos::Experimental::epsilon_v<R>) * abs(p);
    T const left = select(held, w, T(R(0)));
    raised = raised + fma(d, rate, T(0.5f) * d * change);
    held_p = fma(p, left, held_p);
    held_d = fma(d, left, held_d);
  }
};

/// Sums over dofs and rows of an island.
///   energy  E(p) = 1/2 (z.z + p.Cp) + b.p,   z = Y^T p
///   pp = z.z + p.Cp,   pd, dd: the same of p and d, and of d alone,   bp = b.p,   yy = sum p_r^2 (|Y_r|^2 + C_r)
template <class T>
struct LeapSums {
  T pp, pd, dd, bp, yy;
  KOKKOS_INLINE_FUNCTION void add_dof(T const& z, T const& dz) {
    pp = fma(z, z, pp);
    pd = fma(z, dz, pd);
    dd = fma(dz, dz, dd);
  }
  KOKKOS_INLINE_FUNCTION void add_row(T const& p, T const& d, T const& compliance, T const& bias, T const& inverse_diagonal) {
    T const zero(0.0f), one(1.0f), cp = compliance * p, cd = compliance * d;
    auto const movable = inverse_diagonal > zero;
    yy = fma(p, select(movable, p / select(movable, inverse_diagonal, one), zero), yy);
    pp = fma(cp, p, pp);
    pd = fma(cp, d, pd);
    dd = fma(cd, d, dd);
    bp = fma(bias, p, bp);
  }
};
/// p <- p + growth p + sweeps d, and z likewise.
template <class T>
struct Leap {
  T growth, sweeps;
  KOKKOS_INLINE_FUNCTION auto goes() const { return abs(growth) + sweeps > T(0.0f); }
  KOKKOS_INLINE_FUNCTION T of(T const& p, T const& d) const { return p + fma(growth, p, sweeps * d); }
};
/// Where a function with the curvature of E and the slopes p, d is least in that plane:
///   pp growth + pd sweeps = -p,   pd growth + dd sweeps = -d
/// Where both point the same way, along p alone. Never back (sweeps >= 0).
template <class R, class T>
KOKKOS_INLINE_FUNCTION Leap<T> least_in_plane(LeapSums<T> const& s, T const& p, T const& d) {
  T const zero(R(0)), one(R(1)), det = s.pp * s.dd - s.pd * s.pd;
  // of what weighs little det vanishes among the least numbers, whose inverse is none
  T const rounding = T(R(64) * Kokkos::Experimental::epsilon_v<R>) * s.pp * s.dd, least(R(8) * Kokkos::Experimental::norm_min_v<R>);
  auto const plane = det > max(rounding, least);
  auto const some = s.pp > zero;
  T const inverse = one / select(plane, det, one);
  T growth = select(plane, (s.pd * d - s.dd * p) * inverse, -p / select(some, s.pp, one));
  T sweeps = select(plane, (s.pd * p - s.pp * d) * inverse, zero);
  auto const back = sweeps < zero;
  growth = select(back, -p / select(some, s.pp, one), growth);
  auto const wedged = s.yy > T(R(leap_most_stress)) * s.pp;
  growth = select(wedged, zero, growth);
  sweeps = select(wedged, zero, sweeps);
  T const share{R(coarse_share)};
  return {coarse<R>(select(some, clamp(growth, T(R(-leap_most_shrinking)), T(R(leap_most_growth))), zero), share),
          coarse<R>(select(some, clamp(sweeps, zero, T(R(leap_most_sweeps))), zero), share)};
}
/// The leap to the least E of that plane, or none where that lowers E by little. Slopes:
///   grad E . p = pp + bp,   grad E . d = raised + dd / 2, since E(p) - E(p - d) = grad E . d - dd / 2
/// pd + b.d is the latter in exact arithmetic, but near rest it is a difference of large numbers, and leaps along it, up to 10,000 times as
/// far, throw what holds still off. z is found anew, Y^T p, as what rounding makes of d is enlarged.
/// Friction that slides lowers E as it grows, by what it dissipates, but grows with its normal alone: asked for its slope, a leap presses
/// what is squeezed between others tens of times harder than any normal needs (thrown, where the sweeps left are too few to take it back).
/// So a leap that would grow p by more than itself leaves out the slopes of rows that a bound holds, if it is a smaller one then. Smaller
/// growths keep them: near rest it is what settles friction.
/// @param work  of the sweep that made d
template <class R, class T>
KOKKOS_INLINE_FUNCTION Leap<T> best_leap(LeapSums<T> const& s, SweepWork<T> const& work) {
  T const p = s.pp + s.bp, d = fma(T(R(0.5)), s.dd, work.raised);
  Leap<T> const all = least_in_plane<R>(s, p, d), unheld = least_in_plane<R>(s, p - work.held_p, d - work.held_d);
  auto const far = all.growth > max(T(R(leap_held_growth)), unheld.growth);
  T const zero(R(0)), growth = select(far, unheld.growth, all.growth), sweeps = select(far, unheld.sweeps, all.sweeps);
  T const lowers = T(R(-0.5)) * fma(growth, p - select(far, work.held_p, zero), sweeps * (d - select(far, work.held_d, zero)));
  auto const worth = lowers > T(R(-leap_least_gain)) * work.raised;
  return {select(worth, growth, zero), select(worth, sweeps, zero)};
}

}  // namespace gsp::detail
