#pragma once
#include <gsp/core/detail/views.hpp>

namespace gsp {

/// Whether the steps that were launched went through, on the device. Where a pool is too small in any world, `halt` is set, and all
/// launches after that do nothing until the host has let the pools grow: no world is ahead of another, and no result depends on a capacity.
template <class Mem>
struct Progress {
  using memory_space = Mem;
  Kokkos::View<int, Mem> halt;     // not zero: something did not fit, the step has to be repeated
  Kokkos::View<int, Mem> skipped;  // steps that were launched since the last `settle` and did nothing
};

/// Allocates.
template <ExecutionSpace Exec>
Progress<typename Exec::memory_space> make_progress(Exec const& exec) {
  using View = Kokkos::View<int, typename Exec::memory_space>;
  return {detail::allocate_zero<View>(exec, "gsp::Progress::halt"), detail::allocate_zero<View>(exec, "gsp::Progress::skipped")};
}

}  // namespace gsp
