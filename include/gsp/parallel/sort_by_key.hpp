#pragma once
#include <bit>
#include <cstdint>
#include <gsp/core/check.hpp>
#include <gsp/core/detail/views.hpp>
#include <string>
#include <utility>
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/parallel/detail/sort_by_key_cuda.hpp>
#endif

namespace gsp {

/// Second buffers of a sort, reused from call to call. `make_sort_scratch` allocates them.
template <class Key, class Mem>
struct SortScratch {
  using memory_space = Mem;
  Kokkos::View<Key*, Mem> keys;
  Kokkos::View<int*, Mem> values;
  Kokkos::View<std::int64_t**, Kokkos::LayoutRight, Mem> histograms;  // (chunk, 256), host only
  Kokkos::View<char*, Mem> temporary;                                 // device only
};

struct SortOptions {
  int bits = 0;  // keys are compared by their lowest `bits`; 0: all. Fewer bits are fewer passes of 8
};

namespace detail {

// Least significant digit first, 8 bits a pass: count digits by chunk, sum over (digit, chunk), scatter each chunk in order. Every pass
// keeps the order of equal digits, so the whole is stable and its result does not depend on how the input is cut into chunks.
template <class Key, class Mem>
struct RadixPass {
  Kokkos::View<Key*, Mem> keys_in, keys_out;
  Kokkos::View<int*, Mem> values_in, values_out;
  Kokkos::View<std::int64_t**, Kokkos::LayoutRight, Mem> histograms;
  Kokkos::View<std::int64_t const, Mem> count;
  std::int64_t capacity;
  int chunks, shift;

  struct Histogram {};
  struct Offsets {};
  struct Scatter {};

  std::int64_t size() const { return count() < capacity ? count() : capacity; }
  int digit(Key key) const { return static_cast<int>(key >> shift & 255); }

  void operator()(Histogram, int chunk) const {
    std::int64_t const n = size(), begin = n * chunk / chunks, end = n * (chunk + 1) / chunks;
    std::int64_t* const h = &histograms(chunk, 0);
    for (int d = 0; d < 256; ++d) h[d] = 0;
    for (std::int64_t i = begin; i < end; ++i) ++h[digit(keys_in(i))];
  }
  void operator()(Offsets, int) const {
    std::int64_t sum = 0;
    for (int d = 0; d < 256; ++d)
      for (int c = 0; c < chunks; ++c) sum += std::exchange(histograms(c, d), sum);
  }
  void operator()(Scatter, int chunk) const {
    std::int64_t const n = size(), begin = n * chunk / chunks, end = n * (chunk + 1) / chunks;
    std::int64_t* const h = &histograms(chunk, 0);
    for (std::int64_t i = begin; i < end; ++i) {
      Key const key = keys_in(i);
      std::int64_t const to = h[digit(key)]++;
      keys_out(to) = key;
      values_out(to) = values_in(i);
    }
  }
};

}  // namespace detail

/// Scratch for sorting up to n keys on `exec`.
template <class Key, ExecutionSpace Exec>
SortScratch<Key, typename Exec::memory_space> make_sort_scratch(Exec const& exec, std::int64_t n) {
  using Mem = typename Exec::memory_space;
  SortScratch<Key, Mem> s;
  s.keys = detail::allocate<Kokkos::View<Key*, Mem>>("gsp::SortScratch::keys", n);
  s.values = detail::allocate<Kokkos::View<int*, Mem>>("gsp::SortScratch::values", n);
  if constexpr (is_device<Exec>) {
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
    s.temporary = detail::allocate<Kokkos::View<char*, Mem>>("gsp::SortScratch::temporary", detail::cuda_sort_bytes<Key>(n));
#endif
  } else {
    s.histograms =
        detail::allocate<Kokkos::View<std::int64_t**, Kokkos::LayoutRight, Mem>>("gsp::SortScratch::histograms", exec.concurrency(), 256);
  }
  return s;
}

/// Stable sort of (key, value) by ascending key, the first `count` of them.
/// @param keys, values  (capacity) unsigned keys and their values, sorted on return; their buffers change places with the scratch's, so
///                      views that the caller copied before show the old buffers
/// @param count         View<std::int64_t>, rank 0, in `Mem`: how many there are. A device sorts the whole capacity: there, entries from
/// `count` on must have keys
///                      that no other key passes (in the compared bits), so that they stay behind
/// @param scratch       of make_sort_scratch(exec, >= capacity)
/// Host: radix sort over chunks, one a thread, the same result for any number of threads. CUDA: CUB's DeviceRadixSort on the instance's
/// stream. Neither allocates nor fences. Cost: bits/8 passes over keys and values.
template <ExecutionSpace Exec, class Key, class Mem, class Count>
void sort_by_key(Exec const& exec, Kokkos::View<Key*, Mem>& keys, Kokkos::View<int*, Mem>& values, SortScratch<Key, Mem>& scratch,
                 Count const& count, SortOptions options = {}) {
  static_assert(std::is_unsigned_v<Key>, "gsp::sort_by_key: keys are unsigned numbers");
  static_assert(can_access<Exec, Kokkos::View<Key*, Mem>>, "gsp::sort_by_key: the keys are not accessible from this execution space");
  std::int64_t const n = static_cast<std::int64_t>(keys.extent(0));
  expects(keys.extent(0) == values.extent(0), "gsp::sort_by_key: keys and values must be equally many");
  expects(scratch.keys.extent(0) == keys.extent(0) && scratch.values.extent(0) == values.extent(0),
          "gsp::sort_by_key: the scratch must be as long as the keys (make_sort_scratch)");
  expects(options.bits >= 0 && options.bits <= 8 * int(sizeof(Key)), "gsp::sort_by_key: bits must be 0 (all) to the width of a key");
  int const bits = options.bits == 0 ? 8 * int(sizeof(Key)) : options.bits;
  if (n == 0) return;
  if constexpr (is_device<Exec>) {
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
    detail::cuda_sort(exec, keys, values, scratch, bits);
#else
    static_assert(!is_device<Exec>, "gsp::sort_by_key: this device has no sort here; compile with nvcc for CUDA");
#endif
  } else {
    using Pass = detail::RadixPass<Key, Mem>;
    int const chunks = n < 4096 ? 1 : static_cast<int>(scratch.histograms.extent(0));
    for (int shift = 0; shift < bits; shift += 8) {
      Pass const pass{keys, scratch.keys, values, scratch.values, scratch.histograms, count, n, chunks, shift};
      Kokkos::parallel_for("gsp::parallel::sort_by_key_histogram",
                           Kokkos::RangePolicy<Exec, typename Pass::Histogram>(exec, 0, chunks, Kokkos::ChunkSize(1)), pass);
      Kokkos::parallel_for("gsp::parallel::sort_by_key_offsets", Kokkos::RangePolicy<Exec, typename Pass::Offsets>(exec, 0, 1), pass);
      Kokkos::parallel_for("gsp::parallel::sort_by_key_scatter",
                           Kokkos::RangePolicy<Exec, typename Pass::Scatter>(exec, 0, chunks, Kokkos::ChunkSize(1)), pass);
      std::swap(keys, scratch.keys);
      std::swap(values, scratch.values);
    }
  }
}

}  // namespace gsp
