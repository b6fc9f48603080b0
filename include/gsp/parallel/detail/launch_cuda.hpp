#pragma once
#include <Kokkos_Core.hpp>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <gsp/core/check.hpp>
#include <map>
#include <string>
#include <type_traits>
#include <unordered_map>
#include <vector>

/// Launch of a kernel on a CUDA GPU by hand: what Kokkos cannot say is that the kernel's arguments, some kB with the model in them, stay
/// where they are (__grid_constant__). A function that is not inlined and takes their address would else move all of them to every thread's
/// local memory, and all that reads them with it: three times the time (docs/decisions/0004); and beyond 4 kB Kokkos copies them from the
/// host's stack before each launch.
namespace gsp::detail {

inline void cuda_expects(cudaError_t code, std::string const& what) {
  if (code != cudaSuccess) throw Error(what + ": " + cudaGetErrorString(code));
}

/// launch(stream) on the instance's device, which need not be the calling thread's, between the calls that Kokkos' tools expect of a
/// parallel_for. Errors: gsp::Error with CUDA's sentence.
template <class Exec, class Launch>
void launch_on_cuda(std::string const& label, Exec const& exec, Launch const& launch) {
  std::uint64_t id = 0;
  bool const tools = Kokkos::Tools::profileLibraryLoaded();
  if (tools) Kokkos::Tools::beginParallelFor(label, Kokkos::Tools::Experimental::device_id(exec), &id);
  cuda_expects(cudaSetDevice(exec.cuda_device()), label);
  launch(exec.cuda_stream());
  cuda_expects(cudaGetLastError(), label);
  if (tools) Kokkos::Tools::endParallelFor(id);
}

/// Kernels of a stream on each other's heels (programmatic dependent launch): a kernel is brought to the device when all blocks of the one
/// before it have begun, takes what room they leave, and waits there until that one has ended, which saves a launch's way of 2 us. What is
/// launched by `launch_kernel` calls `follow` before all else, in all of its threads: a kernel's end then says that all before it have
/// ended.
/// @param beside  the kernel reads nothing of what the one before it writes, begins while that one runs, and ends with `end_beside`. Of
///                several in a row the first is not `beside`: it waits for all that was before, and lets the next begin after that alone,
///                which sees what was written behind a fence.
__device__ __forceinline__ void follow(bool beside = false) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  if (beside)
    __threadfence();
  else
    cudaGridDependencySynchronize();
  cudaTriggerProgrammaticLaunchCompletion();
#endif
}
__device__ __forceinline__ void end_beside(bool beside) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  if (beside && blockIdx.x == 0) cudaGridDependencySynchronize();  // the other blocks leave their room
#endif
}
/// What there is to know of a kernel's code.
struct KernelCode {
  bool follows = false;              // it waits in `follow`: what was compiled for older GPUs does not, and newer ones run it too
  int shared_bytes = 0, blocks = 0;  // of a block; of a multiprocessor, where they were asked for
  int shared_percent = -1;           // what it was said to prefer
};
inline KernelCode& code_of(void const* kernel) {
  thread_local std::unordered_map<void const*, KernelCode> known;
  auto const found = known.find(kernel);
  if (found != known.end()) return found->second;
  cudaFuncAttributes attributes{};
  bool const there = cudaFuncGetAttributes(&attributes, kernel) == cudaSuccess;
  return known[kernel] = {.follows = there && attributes.ptxVersion >= 90, .shared_bytes = int(attributes.sharedSizeBytes)};
}
/// Leaves as much of a multiprocessor's memory to its cache as so many blocks of a kernel can: by itself CUDA sets apart what as many as
/// fit would take.
template <class Exec>
void leave_cache(Exec const& exec, void const* kernel, int threads, int blocks) {
  auto const& device = exec.cuda_device_prop();
  KernelCode& code = code_of(kernel);
  if (code.blocks == 0) cuda_expects(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&code.blocks, kernel, threads, 0), "gsp: a kernel");
  std::int64_t const each = std::min((blocks + device.multiProcessorCount - 1) / device.multiProcessorCount, code.blocks),
                     bytes = each * (code.shared_bytes + std::int64_t(device.reservedSharedMemPerBlock)),
                     most = std::int64_t(device.sharedMemPerMultiprocessor);
  int const percent = int(std::min<std::int64_t>((100 * bytes + most - 1) / most, 100));
  if (percent == code.shared_percent) return;
  cuda_expects(cudaFuncSetAttribute(kernel, cudaFuncAttributePreferredSharedMemoryCarveout, percent), "gsp: a kernel");
  code.shared_percent = percent;
}
/// How many blocks of so much shared memory a device holds at a time.
inline int blocks_at_once(cudaDeviceProp const& device, std::int64_t bytes) {
  std::int64_t const each = bytes + std::int64_t(device.reservedSharedMemPerBlock);
  return device.multiProcessorCount * std::clamp(int(std::int64_t(device.sharedMemPerMultiprocessor) / each), 1, 32);
}
/// Lets a kernel be launched with so many bytes of shared memory.
/// @param most  of any launch of it: the limit is the kernel's, and another thread's launch may need all
template <class... P>
void allow_shared(cudaDeviceProp const& device, void (*kernel)(P...), std::int64_t bytes, std::int64_t most) {
  if (code_of(reinterpret_cast<void const*>(kernel)).shared_bytes + bytes > std::int64_t(device.sharedMemPerBlock))
    cuda_expects(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, int(most)), "gsp: shared memory of a kernel");
}
/// kernel<<<blocks, threads, shared, stream>>>(args...), without a copy of the arguments on the host. What goes wrong launch_on_cuda says.
template <class... P>
void launch_kernel(cudaStream_t stream, void (*kernel)(P...), dim3 blocks, dim3 threads, std::size_t shared,
                   std::type_identity_t<P> const&... args) {
  auto const* const code = reinterpret_cast<void const*>(kernel);
  cudaLaunchAttribute attribute{};
  attribute.id = cudaLaunchAttributeProgrammaticStreamSerialization;
  attribute.val.programmaticStreamSerializationAllowed = 1;
  cudaLaunchConfig_t config{};
  config.gridDim = blocks;
  config.blockDim = threads;
  config.dynamicSmemBytes = shared;
  config.stream = stream;
  config.attrs = &attribute;
  config.numAttrs = code_of(code).follows ? 1 : 0;
  void* all[] = {const_cast<void*>(static_cast<void const*>(&args))...};
  static_cast<void>(cudaLaunchKernelExC(&config, code, all));
}

/// Streams beside those of the instances: of a thread, since events that two threads record are no one's, and of a device.
class SideStreams {
 public:
  SideStreams(SideStreams const&) = delete;
  SideStreams& operator=(SideStreams const&) = delete;
  static SideStreams& of(int device, int count) {
    thread_local std::map<int, SideStreams> all;
    SideStreams& own = all.try_emplace(device).first->second;
    while (int(own.stream_.size()) < count) own.add();
    return own;
  }
  SideStreams() { cuda_expects(cudaEventCreateWithFlags(&begin_, cudaEventDisableTiming), "gsp: an event"); }
  ~SideStreams() {  // CUDA may be gone: what it says then is of no use
    for (auto const stream : stream_) static_cast<void>(cudaStreamDestroy(stream));
    for (auto const event : done_) static_cast<void>(cudaEventDestroy(event));
    static_cast<void>(cudaEventDestroy(begin_));
  }
  /// launch(i, stream) for i < count, each in a stream of its own, the first in `main`, after all that is in `main` and before what will
  /// be.
  template <class Launch>
  void launch(cudaStream_t main, int count, Launch const& launch) {
    cuda_expects(cudaEventRecord(begin_, main), "gsp: an event");
    launch(0, main);
    for (int i = 1; i < count; ++i) {
      cuda_expects(cudaStreamWaitEvent(stream_[i - 1], begin_), "gsp: an event");
      launch(i, stream_[i - 1]);
      cuda_expects(cudaEventRecord(done_[i - 1], stream_[i - 1]), "gsp: an event");
    }
    for (int i = 1; i < count; ++i) cuda_expects(cudaStreamWaitEvent(main, done_[i - 1]), "gsp: an event");
  }

 private:
  void add() {
    stream_.emplace_back();
    cuda_expects(cudaStreamCreateWithFlags(&stream_.back(), cudaStreamNonBlocking), "gsp: a stream");
    done_.emplace_back();
    cuda_expects(cudaEventCreateWithFlags(&done_.back(), cudaEventDisableTiming), "gsp: an event");
  }
  cudaEvent_t begin_ = nullptr;
  std::vector<cudaStream_t> stream_;
  std::vector<cudaEvent_t> done_;
};

/// Kernels that do not need each other, side by side: launch(i, stream) for i < count. What follows in the instance's stream waits for all.
template <class Exec, class Launch>
void launch_side_by_side(std::string const& label, Exec const& exec, int count, Launch const& launch) {
  launch_on_cuda(label, exec, [&](cudaStream_t main) { SideStreams::of(exec.cuda_device(), count - 1).launch(main, count, launch); });
}

}  // namespace gsp::detail
