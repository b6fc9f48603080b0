#pragma once
// The machine that does the work, without a word of Kokkos, so that files without kernels stay plain C++ in a CUDA build.
#include <cstdint>
#include <memory>
#include <string>

#include "arguments.hpp"

namespace gsp_cli {

enum class Device { cpu, cuda };

Option device_option();
Option threads_option();

/// --device, or CUDA where the program was built with it. Throws where the build has no CUDA or the machine no GPU.
Device choose_device(Arguments const& arguments);

/// Kokkos runs while this lives. threads: of the CPU, 0: as many as there are. Starts to count memory.
class Session {
 public:
  Session(Device device, int threads);
  ~Session();
  Session(Session const&) = delete;
  Session& operator=(Session const&) = delete;
};

/// "CPU, 2 threads" or the GPU's name.
std::string device_name(Device device);
/// Peak memory: CUDA: greatest sum of all allocations on the GPU; CPU: greatest resident size of the process.
std::uint64_t peak_bytes(Device device);
/// Since the process started [s].
double seconds_since_start();

}  // namespace gsp_cli
