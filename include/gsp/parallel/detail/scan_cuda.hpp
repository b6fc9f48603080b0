#pragma once
#include <thrust/iterator/counting_iterator.h>
#include <thrust/iterator/transform_iterator.h>

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
/// Bytes of scratch that any scan of up to n numbers needs.
inline std::int64_t cuda_scan_bytes(std::int64_t n) {
  std::size_t bytes = 0;
  cuda_expects(cub::DeviceScan::ExclusiveSum(nullptr, bytes, static_cast<std::int64_t*>(nullptr), static_cast<std::int64_t*>(nullptr),
                                             static_cast<int>(n + 1)),
               "gsp::make_scan_scratch");
  return static_cast<std::int64_t>(bytes);
}
template <class In, class Out, class Temporary>
void cuda_scan(Kokkos::Cuda const& exec, In const& in, std::int64_t n, Out const& out, Temporary const& temporary) {
  expects(n < (std::int64_t(1) << 31) - 1, "gsp::exclusive_scan: a device takes fewer than 2^31 numbers");
  auto const items = thrust::make_transform_iterator(thrust::counting_iterator<int>(0), ScanItem<In>{in, static_cast<int>(n)});
  std::size_t needed = 0, bytes = temporary.extent(0);
  cuda_expects(cub::DeviceScan::ExclusiveSum(nullptr, needed, items, out.data(), static_cast<int>(n + 1)), "gsp::exclusive_scan");
  expects(needed <= bytes, "gsp::exclusive_scan: the scratch is too small: make it by make_scan_scratch(exec, n), n: the numbers");
  launch_on_cuda("gsp::parallel::exclusive_scan", exec, [&](cudaStream_t stream) {
    cuda_expects(cub::DeviceScan::ExclusiveSum(temporary.data(), bytes, items, out.data(), static_cast<int>(n + 1), stream),
                 "gsp::exclusive_scan");
  });
}

}  // namespace gsp::detail
