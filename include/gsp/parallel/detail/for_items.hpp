#pragma once
#include <cstdint>
#include <gsp/core/exec.hpp>
#include <string>

/// One work item a thread.
namespace gsp::detail {

/// The same on a device (for_items_cuda.hpp).
template <class Exec, class F>
void launch_items(std::string const& label, Exec const& exec, std::int64_t n, F const& f);

/// f(item) for items 0 ... n - 1, an std::int64_t.
template <class Exec, class F>
void for_items(std::string const& label, Exec const& exec, std::int64_t n, F const& f) {
  if constexpr (is_device<Exec>)
    launch_items(label, exec, n, f);
  else
    Kokkos::parallel_for(label, Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, n), f);
}

}  // namespace gsp::detail

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/parallel/detail/for_items_cuda.hpp>
#endif
