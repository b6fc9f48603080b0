#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>
#include <gsp/core/check.hpp>
#include <map>
#include <string>
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
