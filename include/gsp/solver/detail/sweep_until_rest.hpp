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
/// @param island  sweep, keep, take_back, leap, mixing_sums, remember and sum, as GroupedIsland has them
/// @param any     whether there is any element
template <class R, class Island>
KOKKOS_INLINE_FUNCTION int sweep_until_rest(Island const& island, PgsOptions const& options, R tolerance, bool any) {
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
    bool const leapt = leaps && leaping && island.leap(done.work);
    Mixing<R> to{R(0), R(0)};
    bool const may_mix = memory.after(sweep, options, leapt), both = memory.knows_both();
    if (may_mix) to = best_mixing<R>(island.mixing_sums(both), done.misses);
    bool const mixes = memory.takes(to.helps());
    if (is_remembered(sweep, options)) island.remember(sweep % 2, mixes, to, both);
    if (mixes || begins_anew(sweep, options)) island.sum();
  }
  return sweep;
}

}  // namespace gsp::detail
