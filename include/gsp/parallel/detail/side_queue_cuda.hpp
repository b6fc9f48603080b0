#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <memory>
#include <vector>

/// SideQueue of a CUDA GPU: an instance with a stream of its own.
namespace gsp::detail {

template <>
struct SideQueue<Kokkos::CudaSpace> {
  struct Queue {
    std::vector<Kokkos::Cuda> exec;  // one
    cudaEvent_t begin = nullptr, end = nullptr;
    explicit Queue(Kokkos::Cuda const& main) : exec(Kokkos::Experimental::partition_space(main, std::vector<int>{1})) {
      cuda_expects(cudaSetDevice(main.cuda_device()), "gsp: an event");
      for (auto* const event : {&begin, &end}) cuda_expects(cudaEventCreateWithFlags(event, cudaEventDisableTiming), "gsp: an event");
    }
    ~Queue() {  // CUDA may be gone: what it says then is of no use
      for (auto const event : {begin, end}) static_cast<void>(cudaEventDestroy(event));
    }
    Queue(Queue const&) = delete;
    Queue& operator=(Queue const&) = delete;
  };
  std::shared_ptr<Queue> queue;
  explicit operator bool() const { return queue != nullptr; }

  /// What is launched in exec() comes after all that has been launched in `main` before `begin`, which this begins with, and beside what is
  /// after it; what is launched in `main` after `join`, or after the end of this, comes after all in exec().
  class Fork {
   public:
    Fork(SideQueue const& side, Kokkos::Cuda const& main) : queue_(*side.queue), main_(main) {
      cuda_expects(cudaSetDevice(main.cuda_device()), "gsp: an event");
      begin();
    }
    void begin() const {
      cuda_expects(cudaEventRecord(queue_.begin, main_.cuda_stream()), "gsp: an event");
      cuda_expects(cudaStreamWaitEvent(exec().cuda_stream(), queue_.begin), "gsp: an event");
    }
    Kokkos::Cuda const& exec() const { return queue_.exec.front(); }
    void join() const { cuda_expects(tie(), "gsp: an event"); }
    ~Fork() { static_cast<void>(tie()); }
    Fork(Fork const&) = delete;
    Fork& operator=(Fork const&) = delete;

   private:
    cudaError_t tie() const {
      cudaError_t const recorded = cudaEventRecord(queue_.end, exec().cuda_stream());
      return recorded == cudaSuccess ? cudaStreamWaitEvent(main_.cuda_stream(), queue_.end) : recorded;
    }
    Queue& queue_;
    Kokkos::Cuda const& main_;
  };
};

inline SideQueue<Kokkos::CudaSpace> make_side_queue(Kokkos::Cuda const& main) {
  return {std::make_shared<SideQueue<Kokkos::CudaSpace>::Queue>(main)};
}

}  // namespace gsp::detail
