#pragma once
#include <cstdint>
#include <gsp/core/exec.hpp>
#include <string>

/// Work items, each by a thread, or by several of a device.
namespace gsp::detail {

/// f(item) on a device, by so many neighbouring threads each, up to a warp (for_items_cuda.hpp).
template <int threads = 1, class Exec, class F>
void launch_items(std::string const& label, Exec const& exec, std::int64_t n, F const& f);
/// Whether a device has a warp for each of n items at once.
template <class Exec>
bool has_warps(Exec const& exec, std::int64_t n);

/// f(item) for items 0 ... n - 1, an std::int64_t, a thread each.
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
