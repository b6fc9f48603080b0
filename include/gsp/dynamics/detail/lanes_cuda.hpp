#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>

/// Launch of a kernel over lanes on a CUDA GPU.
namespace gsp::detail {

template <int Workers, int Lanes, int Blocks, class Kernel>
__global__ void __launch_bounds__(Lanes* Workers, Blocks) lanes_kernel(Kernel const __grid_constant__ kernel) {
  follow();
  kernel.template run<Workers>(int(blockIdx.x) * Lanes + int(threadIdx.x) % Lanes, nullptr, int(threadIdx.x) / Lanes);
}

template <int Workers, int Lanes, int Blocks, class Exec, class Kernel>
void launch_lanes(char const* label, Exec const& exec, int blocks, Kernel const& kernel) {
  if (blocks == 0) return;
  launch_on_cuda(label, exec, [&](cudaStream_t stream) {
    auto* const lanes = lanes_kernel<Workers, Lanes, Blocks, Kernel>;
    leave_cache(exec, reinterpret_cast<void const*>(lanes), Lanes * Workers, blocks);
    launch_kernel(stream, lanes, blocks, Lanes * Workers, 0, kernel);
  });
}

}  // namespace gsp::detail
