#pragma once
#include <cstdint>
#include <gsp/core/check.hpp>
#include <gsp/core/detail/views.hpp>
#include <gsp/core/exec.hpp>
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/parallel/detail/scan_cuda.hpp>
#endif

namespace gsp {

/// Memory of exclusive_scan on a device, reused from call to call.
template <class Mem>
struct ScanScratch {
  using memory_space = Mem;
  Kokkos::View<char*, Mem> temporary;  // device only
};

namespace detail {
template <class In, class Out>
struct ExclusiveScan {
  using value_type = std::int64_t;
  In in;
  Out out;
  std::int64_t n;
  KOKKOS_FUNCTION void operator()(std::int64_t i, value_type& sum, bool last) const {
    if (last) out(i) = static_cast<typename Out::value_type>(sum);
    if (i < n) sum += static_cast<value_type>(in(i));
  }
};
template <class Functor>
struct ScanInTurn {
  Functor functor;
  std::int64_t n;
  void operator()(int) const {
    typename Functor::value_type sum{};
    for (std::int64_t i = 0; i < n; ++i) functor(i, sum, true);
  }
};
/// scan_items of few items, by a block of a GPU: one launch where Kokkos takes two (scan_cuda.hpp).
template <class Exec, class Functor>
void scan_by_block(char const* label, Exec const& exec, int n, Functor const& functor);
inline constexpr int most_by_block = 1024;
/// Kokkos::parallel_scan of items 0 ... n - 1, whose sums, of whole numbers, begin at value_type{}: functor(item, sum, last). On a host
/// with one thread, where Kokkos' goes through them twice, once, with last = true.
template <ExecutionSpace Exec, class Functor>
void scan_items(char const* label, Exec const& exec, std::int64_t n, Functor const& functor) {
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  if constexpr (is_device<Exec>)
    if (n <= most_by_block) return scan_by_block(label, exec, int(n), functor);
  if constexpr (!is_device<Exec>)
    if (host_threads(exec) == 1) return Kokkos::parallel_for(label, Kokkos::RangePolicy<Exec>(exec, 0, 1), ScanInTurn<Functor>{functor, n});
  Kokkos::parallel_scan(label, lightweight(Range(exec, 0, n)), functor);
}
}  // namespace detail

/// Scratch for sums over up to n numbers on `exec`.
template <ExecutionSpace Exec>
ScanScratch<typename Exec::memory_space> make_scan_scratch([[maybe_unused]] Exec const& exec, [[maybe_unused]] std::int64_t n) {
  ScanScratch<typename Exec::memory_space> s;
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
  if constexpr (is_device<Exec>)
    s.temporary =
        detail::allocate<Kokkos::View<char*, typename Exec::memory_space>>("gsp::ScanScratch::temporary", detail::cuda_scan_bytes(exec, n));
#endif
  return s;
}

/// Exclusive prefix sum: out(i) = in(0) + ... + in(i-1); out(n) is the total. Sums are taken in 64 bits.
/// @param in   (n) whole numbers: a View, or anything with in(i) and in.extent(0); fewer than 2^31 on a device
/// @param out  (n+1), may not overlap `in`; choose 64-bit values where the total can pass 2^31
/// @param scratch  of make_scan_scratch(exec, >= n)
/// Host: Kokkos' scan. CUDA: CUB's DeviceScan on the instance's stream. Neither allocates nor fences; the total stays on the device.
/// Integers, so the order of summation does not matter.
template <ExecutionSpace Exec, class In, class Out, class Mem>
void exclusive_scan(Exec const& exec, In const& in, Out& out, [[maybe_unused]] ScanScratch<Mem> const& scratch) {
  static_assert(can_access<Exec, Out>, "gsp::exclusive_scan: `out` is not accessible from this execution space");
  static_assert(std::is_integral_v<typename Out::value_type>, "gsp::exclusive_scan: `out` must hold whole numbers");
  std::int64_t const n = static_cast<std::int64_t>(in.extent(0));
  expects(static_cast<std::int64_t>(out.extent(0)) == n + 1, "gsp::exclusive_scan: `out` must be one longer than `in`, for the total");
  if constexpr (is_device<Exec>) {
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
    detail::cuda_scan(exec, in, n, out, scratch.temporary);
#else
    static_assert(!is_device<Exec>, "gsp::exclusive_scan: this device has no scan here; compile with nvcc for CUDA");
#endif
  } else {
    detail::scan_items("gsp::parallel::exclusive_scan", exec, n + 1, detail::ExclusiveScan<In, Out>{in, out, n});
  }
}

}  // namespace gsp
