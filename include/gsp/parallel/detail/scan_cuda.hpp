#pragma once
#include <thrust/iterator/counting_iterator.h>
#include <thrust/iterator/transform_iterator.h>

#include <algorithm>
#include <cub/block/block_scan.cuh>
#include <cub/device/device_scan.cuh>
#include <gsp/parallel/detail/launch_cuda.hpp>

/// exclusive_scan and scan_items on CUDA by CUB's scans, on the instance's stream.
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

inline constexpr int threads_of_scan = 512;
template <class Sum>
struct Together {
  __device__ Sum operator()(Sum a, Sum const& b) const {
    a += b;
    return a;
  }
};
template <class Functor>
__global__ void __launch_bounds__(threads_of_scan) scan_by_block_kernel(Functor const __grid_constant__ functor, int n) {
  follow();
  using Sum = typename Functor::value_type;
  using Scan = cub::BlockScan<Sum, threads_of_scan>;
  __shared__ typename Scan::TempStorage memory;
  int const each = (n + threads_of_scan - 1) / threads_of_scan, begin = int(threadIdx.x) * each, end = begin + each < n ? begin + each : n;
  Sum sum{};
  for (int i = begin; i < end; ++i) functor(i, sum, false);
  Scan(memory).ExclusiveScan(sum, sum, Sum{}, Together<Sum>{});
  for (int i = begin; i < end; ++i) functor(i, sum, true);
}
template <class Exec, class Functor>
void scan_by_block(char const* label, Exec const& exec, int n, Functor const& functor) {
  if (n == 0) return;
  launch_on_cuda(label, exec,
                 [&](cudaStream_t stream) { launch_kernel(stream, scan_by_block_kernel<Functor>, 1, threads_of_scan, 0, functor, n); });
}

}  // namespace gsp::detail
