#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/parallel/detail/launch_threads.hpp>

/// launch_threads on a CUDA GPU.
namespace gsp::detail {

/// Numbers of a thread near it, among those of the other threads of its warp.
template <class T>
struct Near {
  static constexpr int stride = 32;
  T* at;
  __device__ T& operator[](int i) const { return at[i * stride]; }
};

/// Memory near the threads that a kernel asks for [bytes a thread].
template <class F>
inline constexpr int near_bytes_of = 0;
template <class F>
requires(F::near_bytes > 0) inline constexpr int near_bytes_of<F> = F::near_bytes;

/// A thread by itself.
template <int bytes>
struct OwnThread {
  char* memory;  // of its warp
  /// How many numbers it has room for near it, and where.
  template <class T>
  static constexpr int room = bytes / int(sizeof(T));
  template <class T>
  __device__ Near<T> near() const {
    return {reinterpret_cast<T*>(memory) + threadIdx.x % 32};
  }
};

// Kernels that work near their threads wait for memory most of the time: three blocks of 256 threads at a time, with 80 registers a thread,
// are faster than two with all that they want (four: about the same, docs/decisions/0017).
inline constexpr int threads_of_block = 256, blocks_at_a_time = 3;
template <class F, int bytes = near_bytes_of<F>>
__global__ void __launch_bounds__(threads_of_block, blocks_at_a_time) threads_kernel(F const __grid_constant__ f) {
  follow();
  __shared__ alignas(8) char memory[bytes > 0 ? threads_of_block * bytes : 1];
  OwnThread<bytes> const thread{memory + int(threadIdx.x) / 32 * 32 * bytes};
  int const n = f.count(), all = int(gridDim.x * blockDim.x), own = int(threadIdx.x);
  int begin = int(blockIdx.x * blockDim.x) + own;
  if (n <= all / (threads_of_block / 32))
    begin = own < 32 ? 32 * int(blockIdx.x) + own : n;  // few: a warp a block, for more multiprocessors
  for (int i = begin; i < n; i += all) f(thread, i);
}

template <class Exec, class F>
void launch_threads(std::string const& label, Exec const& exec, F const& f) {
  int const blocks = blocks_at_a_time * exec.cuda_device_prop().multiProcessorCount;
  launch_on_cuda(label, exec, [&](cudaStream_t stream) { launch_kernel(stream, threads_kernel<F>, blocks, threads_of_block, 0, f); });
}

}  // namespace gsp::detail
