#pragma once
#include <Kokkos_Core.hpp>

/// A second queue of a device: what is launched there runs beside what an instance of the execution space runs, as far as either leaves
/// room. Hosts have none.
namespace gsp::detail {

template <class Mem>
struct SideQueue {
  explicit operator bool() const { return false; }
};
template <class Exec>
SideQueue<typename Exec::memory_space> make_side_queue(Exec const&) {
  return {};
}

}  // namespace gsp::detail

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/parallel/detail/side_queue_cuda.hpp>
#endif
