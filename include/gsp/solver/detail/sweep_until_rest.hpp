#pragma once
#include <gsp/solver/detail/leap.hpp>
#include <gsp/solver/detail/mixing.hpp>

/// When the sweeps over an island are mixed, leap and end, however they are done.
namespace gsp::detail {

/// What one sweep finds.
template <class R>
struct SweepOutcome {
  R change = R(0), misses = R(0);  // largest change of a rate; sum d^2 (|Y|^2 + C)
  SweepWork<R> work{};             // where a leap follows
};

/// Sweeps until no rate changes by more than the tolerance; their number.
/// @param island  sweep, keep, take_back, leap_sums, mixing_sums, go_on and sum, as GroupedIsland has them
/// @param any     whether there is any element
template <class R, class Island>
KOKKOS_INLINE_FUNCTION int sweep_until_rest(Island&& island, PgsOptions const& options, R tolerance, bool any) {
  int sweep = 0;
  bool leaping = true;
  MixingMemory<R> memory;
  for (bool again = any; again; ++sweep) {
    bool const leaps = leaping && leaps_after(sweep, options);
    if (is_remembered(sweep, options)) island.keep(leaps);
    SweepOutcome<R> const done = island.sweep(leaps);
    again = sweep + 1 < options.iterations && (options.tolerance == 0 || sweep + 1 < options.least || done.change > tolerance);
    if (!again) continue;
    if (is_remembered(sweep, options) && memory.is_worse(done.misses)) island.take_back();
    if (leaps) leaping = leaps_again(done.work.raised);
    Leap<R> leap{R(0), R(0)};
    if (leaps && leaping) leap = best_leap<R>(island.leap_sums(), done.work);
    bool const may_mix = memory.after(sweep, options, leap.goes(), done.misses), both = memory.knows_both();
    Mixing<R> mixing{R(0), R(0)};
    if (may_mix) mixing = best_mixing<R>(island.mixing_sums(both), done.misses);
    if (mixing.helps()) memory.mixes();
    if (is_remembered(sweep, options)) island.go_on(sweep % 2, leap, mixing, both);
    if (leap.goes() || mixing.helps() || begins_anew(sweep, options)) island.sum();
  }
  return sweep;
}

}  // namespace gsp::detail
