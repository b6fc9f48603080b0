#pragma once
#include <cstdint>
#include <gsp/runtime/array.hpp>
#include <string>

namespace gsp::runtime {

/// Most threads of the CPU that Kokkos' OpenMP backend has room for (its pool is an array of that length, which more would overrun).
inline constexpr int most_threads = 512;

/// Kokkos runs while this lives; one at a time. threads: of the CPU, 0: what OMP_NUM_THREADS or KOKKOS_NUM_THREADS say, else all.
/// Errors: gsp::Error where that is more than most_threads.
class Session {
 public:
  explicit Session(int threads = 0);
  ~Session();
  Session(Session const&) = delete;
  Session& operator=(Session const&) = delete;
};

/// Whether this library was built with CUDA, and how many GPUs there are; before a Session too.
bool has_cuda();
int gpu_count();
/// Begins to start the GPU on a thread of its own, which takes 0.1 to 0.3 s, so that a program reads its files meanwhile; a Session waits
/// for it. From one thread; nothing without CUDA, without a GPU, and where the environment says that another GPU than the first is taken.
void start_gpu();

/// "CPU, 2 threads" or the GPU's name. threads: of the CPU, 0: all of the Session.
std::string device_name(Device device, int threads = 0);
/// Of the CPU, of the Session that is there.
int cpu_threads();
/// Waits until all that was launched is done.
void wait(Device device);
/// What the library launches on a GPU from now on comes after what is on this stream of CUDA's by now, and the other way round, without the
/// host's waiting. A stream by its number in CUDA's array interface: 1 the legacy default one, 2 that of the thread, else a cudaStream_t's.
/// Nothing of the CPU.
void wait_for_stream(Device device, std::uintptr_t stream);
void let_stream_wait(Device device, std::uintptr_t stream);
/// Peak memory so far: CUDA: greatest sum of all allocations on the GPU; CPU: greatest resident size of the process.
std::uint64_t peak_bytes(Device device);
/// Memory that can still be had: CUDA: of the GPU; CPU: what the system says is available, within the limits of the process and of the
/// control groups (containers) that it runs in.
std::uint64_t free_bytes(Device device);

}  // namespace gsp::runtime
