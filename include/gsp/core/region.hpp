#pragma once
#include <Kokkos_Core.hpp>

namespace gsp {

/// A stretch of the host's time under a name, "gsp::<area>::<function>", from here to the end of the scope, for the profilers that Kokkos
/// Tools connects (a timer, NVTX for Nsight). One a stage; regions nest. Without a tool it costs one test and allocates nothing. On a
/// device it covers the launch, not the kernels, unless the tool asks Kokkos to wait.
class Region {
 public:
  [[gnu::noinline]] explicit Region(char const* name) : open_(Kokkos::Profiling::profileLibraryLoaded()) {
    if (open_) Kokkos::Profiling::pushRegion(name);
  }
  [[gnu::noinline]] ~Region() {
    if (open_) Kokkos::Profiling::popRegion();
  }
  Region(Region const&) = delete;
  Region& operator=(Region const&) = delete;

 private:
  bool open_;  // a tool that comes later does not see the end of what it has not seen begin
};

}  // namespace gsp
