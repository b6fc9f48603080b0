#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>

/// for_items on a CUDA GPU.
namespace gsp::detail {

inline constexpr int items_of_block = 128;
template <class F>
__global__ void __launch_bounds__(items_of_block) items_kernel(F const __grid_constant__ f, std::int64_t n) {
  follow();
  std::int64_t const item = std::int64_t(blockIdx.x) * items_of_block + threadIdx.x;
  if (item < n) f(item);
}

template <class Exec, class F>
void launch_items(std::string const& label, Exec const& exec, std::int64_t n, F const& f) {
  if (n == 0) return;
  launch_on_cuda(label, exec, [&](cudaStream_t stream) {
    launch_kernel(stream, items_kernel<F>, unsigned((n + items_of_block - 1) / items_of_block), items_of_block, 0, f, n);
  });
}

}  // namespace gsp::detail
