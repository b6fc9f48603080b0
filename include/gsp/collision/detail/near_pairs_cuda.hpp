#pragma once
#include <gsp/collision/broadphase.hpp>
#include <gsp/parallel/detail/launch_cuda.hpp>

/// Near pairs of few worlds on a CUDA GPU: a warp a chunk, whose threads look at a box of a span each. One thread went through the boxes of
/// a crowd in 50 to 80 us.
namespace gsp::detail {

inline constexpr int warps_of_items = 4;  // of a block

template <class Exec>
bool has_warps(Exec const& exec, std::int64_t items) {
  auto const& device = exec.cuda_device_prop();
  return items <= std::int64_t(device.multiProcessorCount) * device.maxThreadsPerMultiProcessor / 32;
}
template <class F>
__global__ void __launch_bounds__(32 * warps_of_items) warps_kernel(F const __grid_constant__ f, std::int64_t items) {
  follow();
  std::int64_t const item = std::int64_t(blockIdx.x) * warps_of_items + threadIdx.x / 32;
  if (item < items) f(item);
}
template <class Exec, class F>
void launch_warps(std::string const& label, Exec const& exec, std::int64_t items, F const& f) {
  if (items == 0) return;
  launch_on_cuda(label, exec, [&](cudaStream_t stream) {
    launch_kernel(stream, warps_kernel<F>, unsigned((items + warps_of_items - 1) / warps_of_items), 32 * warps_of_items, 0, f, items);
  });
}

}  // namespace gsp::detail
