#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>

/// for_items on a CUDA GPU.
namespace gsp::detail {

inline constexpr int threads_of_items = 128;  // of a block
template <int threads, class F>
__global__ void __launch_bounds__(threads_of_items) items_kernel(F const __grid_constant__ f, std::int64_t n) {
  follow();
  constexpr int of_block = threads_of_items / threads;
  std::int64_t const item = std::int64_t(blockIdx.x) * of_block + threadIdx.x / threads;
  if (item < n) f(item);
}

template <int threads, class Exec, class F>
void launch_items(std::string const& label, Exec const& exec, std::int64_t n, F const& f) {
  if (n == 0) return;
  constexpr int of_block = threads_of_items / threads;
  launch_on_cuda(label, exec, [&](cudaStream_t stream) {
    launch_kernel(stream, items_kernel<threads, F>, unsigned((n + of_block - 1) / of_block), threads_of_items, 0, f, n);
  });
}
template <class Exec>
bool has_warps(Exec const& exec, std::int64_t n) {
  auto const& device = exec.cuda_device_prop();
  return n <= std::int64_t(device.multiProcessorCount) * device.maxThreadsPerMultiProcessor / 32;
}

}  // namespace gsp::detail
