#pragma once
#include <gsp/core/exec.hpp>
#include <gsp/math/scalar.hpp>

/// What hurries sweeps that are slow: every few of them, the best point of the plane through the impulses p, their own direction and that
/// of the last sweep, d = p - p_before. Gauss-Seidel passes a load on by one body a sweep, and what a heavy body lays on a light one by the
/// share of the light: p grows along itself, or keeps on going as it went.
namespace gsp::detail {

// A leap goes on for so many sweeps at most, and grows p by so much along itself at most; it keeps half of p, since what bounds and
// friction say is left to the next sweep. What is wedged presses against itself, and such a p does not leap: where sum |Y_r p_r|^2 is more
// than 100,000 times |Y^T p|^2 (a weight of 10,000 on a light body: 20,000 times).
inline constexpr double leap_most_sweeps = 10000, leap_most_growth = 1000, leap_most_shrinking = 0.5, leap_most_stress = 1e5;
inline constexpr int leap_from = 8, leap_every = 4;  // sweeps: before the first one, and from one to the next

/// Whether a leap follows on sweep number `sweep` (from 0) of at most `sweeps`: then p and z before it are kept. The sweeps to the next one
/// must be there to settle what it has thrown over bounds and friction.
KOKKOS_INLINE_FUNCTION constexpr bool leaps_after(int sweep, int sweeps) {
  return sweep >= leap_from && sweep % leap_every == 0 && sweep + leap_every < sweeps;
}

/// Sweeps lower E, except where friction, which is no minimum of an energy, follows a normal that a leap has changed: there they take back
/// what it gained. A world whose sweeps raise E after a leap leaps no more in this step.
/// @param raised  by how much the sweeps since the last leap have raised E (energy_of_step)
template <class R>
KOKKOS_INLINE_FUNCTION bool leaps_again(int sweep, R raised) {
  return sweep == leap_from || raised <= R(0);
}
/// Change of E where row b of an element moves by d, after the rows before it have:   d (w + Y_b . sum Y_a d_a) + 1/2 d^2 (|Y|^2 + C)
/// No difference of large numbers, as two values of E are.
/// @param rate    w of the row before the element moves, + the products with the rows a < b
/// @param change  |d| (|Y|^2 + C), what the row's rate changes by
template <class T>
KOKKOS_INLINE_FUNCTION T energy_of_step(T const& d, T const& rate, T const& change) {
  return fma(d, rate, T(0.5f) * abs(d) * change);
}

/// Sums over dofs and rows of a world.
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
};
/// Where E is least in that plane:
///   pp growth + pd sweeps = -grad E . p = -(pp + bp),   pd growth + dd sweeps = -grad E . d = -(raised + dd / 2)
/// since E(p) - E(p - d) = grad E . d - dd / 2. pd + b.d is the same in exact arithmetic, but near rest it is a difference of large
/// numbers, and leaps along it, up to 10,000 times as far, throw what holds still off. Where p and d point the same way, along p alone.
/// Never back (sweeps >= 0). z is found anew, Y^T p, as what rounding makes of d is enlarged.
/// @param raised  by how much the sweep that made d has raised E
template <class R, class T>
KOKKOS_INLINE_FUNCTION Leap<T> best_leap(LeapSums<T> const& s, T const& raised) {
  T const zero(R(0)), one(R(1)), p = s.pp + s.bp, d = fma(T(R(0.5)), s.dd, raised), det = s.pp * s.dd - s.pd * s.pd;
  auto const plane = det > T(R(64) * Kokkos::Experimental::epsilon_v<R>) * s.pp * s.dd;
  auto const some = s.pp > zero;
  T const inverse = one / select(plane, det, one);
  T growth = select(plane, (s.pd * d - s.dd * p) * inverse, -p / select(some, s.pp, one));
  T sweeps = select(plane, (s.pd * p - s.pp * d) * inverse, zero);
  auto const back = sweeps < zero;
  growth = select(back, -p / select(some, s.pp, one), growth);
  auto const wedged = s.yy > T(R(leap_most_stress)) * s.pp;
  growth = select(wedged, zero, growth);
  sweeps = select(wedged, zero, sweeps);
  return {select(some, clamp(growth, T(R(-leap_most_shrinking)), T(R(leap_most_growth))), zero),
          select(some, clamp(sweeps, zero, T(R(leap_most_sweeps))), zero)};
}

}  // namespace gsp::detail
