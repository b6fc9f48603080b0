#pragma once
#include <exception>
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <memory>
#include <optional>

/// SideQueue of a CUDA GPU: an instance with a stream of its own, which waits for no legacy stream.
namespace gsp::detail {

template <>
struct SideQueue<Kokkos::CudaSpace> {
  struct Queue {
    cudaStream_t stream = nullptr;
    cudaEvent_t begin = nullptr, end = nullptr;
    std::optional<Kokkos::Cuda> exec;
    explicit Queue(Kokkos::Cuda const& main) {
      cuda_expects(cudaSetDevice(main.cuda_device()), "gsp: a stream");
      cuda_expects(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "gsp: a stream");
      for (auto* const event : {&begin, &end}) cuda_expects(cudaEventCreateWithFlags(event, cudaEventDisableTiming), "gsp: an event");
      exec.emplace(stream);
    }
    ~Queue() {  // CUDA may be gone: what it says then is of no use
      exec.reset();
      for (auto const event : {begin, end}) static_cast<void>(cudaEventDestroy(event));
      static_cast<void>(cudaStreamDestroy(stream));
    }
    Queue(Queue const&) = delete;
    Queue& operator=(Queue const&) = delete;
  };
  std::shared_ptr<Queue> queue;
  explicit operator bool() const { return queue != nullptr; }

  /// What is launched in exec() comes after all that has been launched in `main` before `begin`, which this begins with, and beside what is
  /// after it; what is launched in `main` after `join`, or where something throws, comes after all in exec().
  class Fork {
   public:
    Fork(SideQueue const& side, Kokkos::Cuda const& main) : queue_(*side.queue), main_(main) {
      cuda_expects(cudaSetDevice(main.cuda_device()), "gsp: an event");
      begin();
    }
    void begin() const {
      cuda_expects(cudaEventRecord(queue_.begin, main_.cuda_stream()), "gsp: an event");
      cuda_expects(cudaStreamWaitEvent(queue_.stream, queue_.begin), "gsp: an event");
    }
    Kokkos::Cuda const& exec() const { return *queue_.exec; }
    void join() const { cuda_expects(tie(), "gsp: an event"); }
    ~Fork() {  // where something has thrown
      if (std::uncaught_exceptions() > exceptions_) static_cast<void>(tie());
    }
    Fork(Fork const&) = delete;
    Fork& operator=(Fork const&) = delete;

   private:
    cudaError_t tie() const {
      cudaError_t const recorded = cudaEventRecord(queue_.end, queue_.stream);
      return recorded == cudaSuccess ? cudaStreamWaitEvent(main_.cuda_stream(), queue_.end) : recorded;
    }
    Queue& queue_;
    Kokkos::Cuda const& main_;
    int exceptions_ = std::uncaught_exceptions();
  };
};

inline SideQueue<Kokkos::CudaSpace> make_side_queue(Kokkos::Cuda const& main) {
  return {std::make_shared<SideQueue<Kokkos::CudaSpace>::Queue>(main)};
}

}  // namespace gsp::detail
