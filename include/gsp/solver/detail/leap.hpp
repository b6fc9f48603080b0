#pragma once
#include <gsp/core/exec.hpp>
#include <gsp/math/scalar.hpp>

/// What hurries sweeps that are slow: every few of them, the best point of the plane through the impulses p, their own direction and that
/// of the last sweep, d = p - p_before. Gauss-Seidel passes a load on by one body a sweep, and what a heavy body lays on a light one by the
/// share of the light: p grows along itself, or keeps on going as it went.
namespace gsp::detail {

// A leap goes on for so many sweeps at most, and grows p by so much along itself at most; it keeps half of p, since what bounds and
// friction say is left to the next sweep.
inline constexpr double leap_most_sweeps = 10000, leap_most_growth = 1000, leap_most_shrinking = 0.5;
inline constexpr int leap_from = 16, leap_every = 4;  // sweeps: before the first one, and from one to the next

/// Whether a leap follows on sweep number `sweep` (from 0): then p and z before it are kept.
KOKKOS_INLINE_FUNCTION constexpr bool leaps_after(int sweep) { return sweep >= leap_from && sweep % leap_every == 0; }

/// Friction is no minimum of an energy, and a leap may spoil what sweeps have found: a world whose sweeps change it by more than half of
/// what they did before its last leap leaps no more in this step.
template <class R>
KOKKOS_INLINE_FUNCTION bool leap_helped(R change, R change_before) {
  return change <= R(0.5) * change_before;
}

/// Sums over dofs and rows of a world.
///   energy  E(p) = 1/2 (z.z + p.Cp) + b.p,   z = Y^T p
///   pp = z.z + p.Cp,   pd, dd: the same of p and d, and of d alone,   bp = b.p,   bd = b.d
template <class T>
struct LeapSums {
  T pp, pd, dd, bp, bd;
  KOKKOS_INLINE_FUNCTION void add_dof(T const& z, T const& dz) {
    pp = fma(z, z, pp);
    pd = fma(z, dz, pd);
    dd = fma(dz, dz, dd);
  }
  KOKKOS_INLINE_FUNCTION void add_row(T const& p, T const& d, T const& compliance, T const& bias) {
    T const cp = compliance * p, cd = compliance * d;
    pp = fma(cp, p, pp);
    pd = fma(cp, d, pd);
    dd = fma(cd, d, dd);
    bp = fma(bias, p, bp);
    bd = fma(bias, d, bd);
  }
};
/// p <- p + growth p + sweeps d, and z likewise.
template <class T>
struct Leap {
  T growth, sweeps;
};
/// Where E is least in that plane:
///   pp growth + pd sweeps = -(pp + bp),   pd growth + dd sweeps = -(pd + bd)
/// Where p and d point the same way, along p alone. Never back (sweeps >= 0). z is found anew, Y^T p, as what rounding makes of d is
/// enlarged.
template <class R, class T>
KOKKOS_INLINE_FUNCTION Leap<T> best_leap(LeapSums<T> const& s) {
  T const zero(R(0)), one(R(1)), p = s.pp + s.bp, d = s.pd + s.bd, det = s.pp * s.dd - s.pd * s.pd;
  auto const plane = det > T(R(64) * Kokkos::Experimental::epsilon_v<R>) * s.pp * s.dd;
  auto const some = s.pp > zero;
  T const inverse = one / select(plane, det, one);
  T growth = select(plane, (s.pd * d - s.dd * p) * inverse, -p / select(some, s.pp, one));
  T sweeps = select(plane, (s.pd * p - s.pp * d) * inverse, zero);
  auto const back = sweeps < zero;
  growth = select(back, -p / select(some, s.pp, one), growth);
  return {select(some, clamp(growth, T(R(-leap_most_shrinking)), T(R(leap_most_growth))), zero),
          select(some, clamp(sweeps, zero, T(R(leap_most_sweeps))), zero)};
}

}  // namespace gsp::detail
