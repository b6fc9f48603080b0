#pragma once
#include <thrust/iterator/counting_iterator.h>
#include <thrust/iterator/transform_iterator.h>

#include <algorithm>
#include <cub/device/device_scan.cuh>
#include <gsp/parallel/detail/launch_cuda.hpp>

/// exclusive_scan on CUDA by CUB's scan, on the instance's stream.
namespace gsp::detail {

/// Item i of a scan's input; 0 behind the last, which makes the total.
template <class In>
struct ScanItem {
  In in;
  int n;
  KOKKOS_FUNCTION std::int64_t operator()(int i) const { return i < n ? static_cast<std::int64_t>(in(i)) : 0; }
};
/// Bytes of scratch that a scan of up to n numbers needs, of such items into such sums: CUB takes other tiles for other types.
template <class Items, class Sum>
std::size_t cuda_scan_bytes(Items const& items, Sum* out, std::int64_t n) {
  expects(n < (std::int64_t(1) << 31) - 1, "gsp::exclusive_scan: a device takes fewer than 2^31 - 1 numbers");
  std::size_t bytes = 0;
  cuda_expects(cub::DeviceScan::ExclusiveSum(nullptr, bytes, items, out, static_cast<int>(n + 1)), "gsp::exclusive_scan");
  return bytes;
}
struct NoItem {
  KOKKOS_FUNCTION int operator()(std::int64_t) const { return 0; }
};
/// Of any items, into sums of 32 or 64 bits.
inline std::int64_t cuda_scan_bytes(Kokkos::Cuda const& exec, std::int64_t n) {
  cuda_expects(cudaSetDevice(exec.cuda_device()), "gsp::make_scan_scratch");
  auto const items = thrust::make_transform_iterator(thrust::counting_iterator<int>(0), ScanItem<NoItem>{{}, 0});
  return static_cast<std::int64_t>(
      std::max(cuda_scan_bytes(items, static_cast<std::int64_t*>(nullptr), n), cuda_scan_bytes(items, static_cast<int*>(nullptr), n)));
}
template <class In, class Out, class Temporary>
void cuda_scan(Kokkos::Cuda const& exec, In const& in, std::int64_t n, Out const& out, Temporary const& temporary) {
  cuda_expects(cudaSetDevice(exec.cuda_device()), "gsp::exclusive_scan");
  auto const items = thrust::make_transform_iterator(thrust::counting_iterator<int>(0), ScanItem<In>{in, static_cast<int>(n)});
  std::size_t bytes = temporary.extent(0);
  expects(cuda_scan_bytes(items, out.data(), n) <= bytes,
          "gsp::exclusive_scan: the scratch is too small: make it by make_scan_scratch(exec, n), n: the numbers");
  launch_on_cuda("gsp::parallel::exclusive_scan", exec, [&](cudaStream_t stream) {
    cuda_expects(cub::DeviceScan::ExclusiveSum(temporary.data(), bytes, items, out.data(), static_cast<int>(n + 1), stream),
                 "gsp::exclusive_scan");
  });
}

}  // namespace gsp::detail
