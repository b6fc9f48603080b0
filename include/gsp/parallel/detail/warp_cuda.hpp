#pragma once

/// What the lanes of a warp do together on a CUDA GPU.
namespace gsp::detail {

/// Sum of x over this lane and those before it.
__device__ __forceinline__ int sum_upto_lane(int x) {
  int const lane = int(threadIdx.x) % 32;
#pragma unroll
  for (int step = 1; step < 32; step *= 2) {
    int const other = __shfl_up_sync(0xffffffffu, x, step);
    if (lane >= step) x += other;
  }
  return x;
}

}  // namespace gsp::detail
