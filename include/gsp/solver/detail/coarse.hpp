#pragma once
#include <gsp/core/exec.hpp>
#include <gsp/math/scalar.hpp>

namespace gsp::detail {

// Of mixtures of what converges fast, whose quotients are good; of all others, and of leaps.
inline constexpr double fine_share = 1.0 / 256, coarse_share = 1.0 / 16;

/// x on a grid that grows with it: the nearest multiple of `share` of the greatest of 1/256, 1/16, 1, 16, 256 that is no greater than |x|.
/// How far mixtures and leaps go comes from quotients of small differences, which enlarge what rounding has left of the state by as much as
/// they hurry the sweeps: two runs that differ by it part, step by step. On a grid both go equally far, to the bit, but for what rounding
/// carries over an edge: seldom in double (docs/decisions/0024), and float has no such margin.
template <class R, class T>
KOKKOS_INLINE_FUNCTION T coarse(T const& x, T const& share) {
  T const size = abs(x);
  T grid(R(1) / R(256));
  for (R least : {R(1) / R(16), R(1), R(16), R(256)}) grid = select(size >= T(least), T(least), grid);
  T const shift = T(R(1.5) / Kokkos::Experimental::epsilon_v<R>) * share * grid;  // the sum with it has no finer bits
  return (x + shift) - shift;
}

}  // namespace gsp::detail
