#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>
#include <gsp/core/check.hpp>
#include <string>

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

}  // namespace gsp::detail
