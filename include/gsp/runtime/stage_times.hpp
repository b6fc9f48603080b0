#pragma once
#include <functional>
#include <gsp/runtime/array.hpp>
#include <string>
#include <vector>

namespace gsp::runtime {

/// Time of the stages of one name, without the stages inside of them.
struct StageTime {
  std::string name;    // "dynamics::smooth_dynamics": the region's (core/region.hpp), without "gsp::"
  double seconds = 0;  // of all calls
  long calls = 0;
};

/// Calls work() and says how long each stage of it took, the longest first. On a GPU it waits at both ends of each stage, so that the whole
/// takes longer than without; on the CPU that costs two clock reads a stage. One call at a time; a tool that Kokkos calls for regions is
/// not called meanwhile.
std::vector<StageTime> stage_times(Device device, std::function<void()> const& work);

}  // namespace gsp::runtime
