#pragma once
#include <Kokkos_Core.hpp>
#include <gsp/core/check.hpp>
#include <string>

/// Launch of a kernel over lanes on a CUDA GPU, by hand: what Kokkos cannot say is that the kernel's arguments, some 4 kB with the model in
/// them, stay where they are (__grid_constant__). A function that is not inlined and takes their address would else move all of them to
/// every thread's local memory, and all that reads them with it: three times the time (docs/decisions/0004).
namespace gsp::detail {

template <int Workers, int Lanes, int Blocks, class Kernel>
__global__ void __launch_bounds__(Lanes* Workers, Blocks) lanes_kernel(Kernel const __grid_constant__ kernel) {
  kernel.template run<Workers>(int(blockIdx.x) * Lanes + int(threadIdx.x) % Lanes, nullptr, int(threadIdx.x) / Lanes);
}

template <int Workers, int Lanes, int Blocks, class Exec, class Kernel>
void launch_lanes(char const* label, Exec const& exec, int blocks, Kernel const& kernel) {
  if (blocks == 0) return;
  std::uint64_t id = 0;
  bool const tools = Kokkos::Tools::profileLibraryLoaded();
  if (tools) Kokkos::Tools::beginParallelFor(label, Kokkos::Tools::Experimental::device_id(exec), &id);
  lanes_kernel<Workers, Lanes, Blocks><<<blocks, Lanes * Workers, 0, exec.cuda_stream()>>>(kernel);
  cudaError_t const error = cudaGetLastError();
  if (error != cudaSuccess) throw Error(std::string(label) + ": " + cudaGetErrorString(error));
  if (tools) Kokkos::Tools::endParallelFor(id);
}

}  // namespace gsp::detail
