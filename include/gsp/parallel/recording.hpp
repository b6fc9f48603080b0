#pragma once
#include <gsp/core/exec.hpp>

namespace gsp {

/// Launches of an instance, recorded once and then launched together with one call: a CUDA graph. On hosts, and where they cannot be
/// recorded, there is none, and what would have been recorded is launched as usual.
template <ExecutionSpace Exec>
class Recording {
 public:
  /// Whether there is one to launch.
  bool exists() const { return false; }
  /// Records what f() launches on `exec`, which is not run; f must neither wait nor allocate, nor launch what copies from the host. Returns
  /// whether there is a recording then: not where a profiling tool listens, or f has launched what reads the host's memory.
  template <class F>
  bool record(Exec const&, F const&) {
    return false;
  }
  /// Launches it on `exec`, in order with all else there. Does not wait.
  void launch(Exec const&) const {}
  void clear() {}
};

}  // namespace gsp

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/parallel/detail/recording_cuda.hpp>
#endif
