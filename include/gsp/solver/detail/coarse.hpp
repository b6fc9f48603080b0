#pragma once
#include <gsp/core/exec.hpp>
#include <gsp/math/scalar.hpp>

namespace gsp::detail {

/// The nearest multiple of 1/65536 or, from 1/16 on, of 1/4096 to 1/256 of its size (1 at most). How far mixtures and leaps go comes from
/// quotients of small differences, which enlarge what rounding has left of the state by as much as they hurry the sweeps: two runs that
/// differ by it part, step by step. On a grid both go equally far, to the bit, but for what rounding carries over an edge: in double one in
/// a billion.
template <class R, class T>
KOKKOS_INLINE_FUNCTION T coarse(T const& x) {
  T const size = abs(x);
  T grid(R(1) / R(65536));
  for (R least : {R(1) / R(16), R(1), R(16), R(256)}) grid = select(size >= T(least), T(least / R(256)), grid);
  T const shift = T(R(1.5) / Kokkos::Experimental::epsilon_v<R>) * grid;  // the sum with it has no finer bits
  return (x + shift) - shift;
}

}  // namespace gsp::detail
