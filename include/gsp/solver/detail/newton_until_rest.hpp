#pragma once
#include <Kokkos_Core.hpp>
#include <gsp/math/scalar.hpp>

/// When the iterations of `newton` over an island go on, how far, and when they end, however they are done.
namespace gsp::detail {

// An island whose decrement no longer falls, near what it should be or what rounding makes of the sum that the gradient is, so often:
// rounding alone is left. (Rows that press against each other leave a z of nothing but rounding.)
inline constexpr double newton_near = 1e6;  // of the square of a step: a thousand times the tolerance, or epsilon
inline constexpr int newton_most_stalls = 3;
// The line is searched until its slope is this share of that at its start: a closer search costs more than the next iteration gains.
inline constexpr double newton_slope = 0.01;
inline constexpr int newton_most_secants = 40;  // each halves the bracket at least every other time: the digits of a double
inline constexpr double newton_widen = 4;       // by how much the line is followed while it still falls

/// alpha > 0 with |slope| <= newton_slope of the slope at 0, of a convex function along the line: secants inside of a bracket.
/// @param decrement  minus the slope at 0
template <class R, class Slope>
KOKKOS_FORCEINLINE_FUNCTION R search_line(R decrement, Slope const& slope) {
  R low(0), at_low = -decrement, high(0), at_high(0), alpha(1);
  for (int i = 0; i < newton_most_secants; ++i) {
    R const now = slope(alpha);
    if (!(abs(now) > R(newton_slope) * decrement)) break;
    if (now < R(0)) {
      if (high > R(0)) at_high = at_high * R(0.5);  // so that no end of the bracket stays for ever (the Illinois rule)
      low = alpha;
      at_low = now;
    } else {
      if (high > R(0)) at_low = at_low * R(0.5);
      high = alpha;
      at_high = now;
    }
    R const next = high > R(0) ? low + (high - low) * (at_low / (at_low - at_high)) : R(newton_widen) * alpha;
    if (next == alpha || !(next > R(0))) break;
    alpha = next;
  }
  return alpha;
}

/// Iterates until a step would change z by less than the tolerance, or than rounding allows. Returns how often.
/// @param island  begin (z and w to start from), gradient (d <- -g; |d|^2), solve (d <- H^-1 d; d . H d, an upper bound of |d|^2), size
///                (|z|^2), summed (| |Y^T| |p| |^2), look_along (Y d; what the slope hangs on), slope(alpha), go(alpha) (z += alpha d)
template <class R, class Island>
KOKKOS_FORCEINLINE_FUNCTION int newton_until_rest(Island& island, int iterations, R tolerance) {
  island.begin();
  int iteration = 0, stalls = 0;
  R best = Kokkos::Experimental::infinity_v<R>;
  while (iteration < iterations) {
    if (island.gradient() == R(0)) break;
    R const decrement = island.solve(), least = square(tolerance) * island.size();
    bool const last = !(decrement > least);  // one whole step more
    if (!last && decrement >= best) {
      bool const is_near =
          decrement < R(newton_near) * least || decrement < R(newton_near) * square(Kokkos::Experimental::epsilon_v<R>) * island.summed();
      if (is_near && ++stalls == newton_most_stalls) break;
    }
    best = min(best, decrement);
    island.look_along();
    island.go(last ? R(1) : search_line(decrement, [&](R alpha) { return island.slope(alpha); }));
    if (last) break;
    ++iteration;
  }
  return iteration;
}

}  // namespace gsp::detail
