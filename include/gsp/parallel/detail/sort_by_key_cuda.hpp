#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>
#include <cub/device/device_radix_sort.cuh>
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <utility>

namespace gsp {
template <class Key, class Mem>
struct SortScratch;
}

/// sort_by_key on CUDA by CUB's radix sort (stable), on the instance's stream.
namespace gsp::detail {

/// CUB counts in 32 bits, which its kernels are faster with.
inline int cuda_sort_count(std::int64_t n) {
  expects(n < std::int64_t(1) << 31, "gsp::sort_by_key: a device sorts fewer than 2^31 keys at once; sort them in parts");
  return static_cast<int>(n);
}
/// Bytes of scratch that any sort of up to n keys needs.
template <class Key>
std::size_t cuda_sort_bytes(std::int64_t n) {
  cub::DoubleBuffer<Key> keys(nullptr, nullptr);
  cub::DoubleBuffer<int> values(nullptr, nullptr);
  std::size_t bytes = 0;
  cuda_expects(cub::DeviceRadixSort::SortPairs(nullptr, bytes, keys, values, cuda_sort_count(n)), "gsp::make_sort_scratch");
  return bytes;
}

template <class Key, class Mem>
void cuda_sort(Kokkos::Cuda const& exec, Kokkos::View<Key*, Mem>& keys, Kokkos::View<int*, Mem>& values, SortScratch<Key, Mem>& scratch,
               int bits) {
  cuda_expects(cudaSetDevice(exec.cuda_device()), "gsp::sort_by_key");
  cub::DoubleBuffer<Key> k(keys.data(), scratch.keys.data());
  cub::DoubleBuffer<int> v(values.data(), scratch.values.data());
  std::size_t bytes = scratch.temporary.extent(0);
  cuda_expects(cub::DeviceRadixSort::SortPairs(scratch.temporary.data(), bytes, k, v, cuda_sort_count(std::int64_t(keys.extent(0))), 0,
                                               bits, exec.cuda_stream()),
               "gsp::sort_by_key");
  if (k.Current() != keys.data()) std::swap(keys, scratch.keys);
  if (v.Current() != values.data()) std::swap(values, scratch.values);
}

}  // namespace gsp::detail
