#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>

/// Worlds on a CUDA GPU: a warp each.
namespace gsp::detail {

inline constexpr int warps_of_block = 2;  // a multiprocessor holds 32 blocks, and more warps than that where registers allow it

struct WarpWorld {
  int rank;
  static __device__ int lane() { return int(threadIdx.x); }
  __device__ void sync() const { __syncwarp(); }
  template <class F>
  __device__ __forceinline__ void single(F const& f) const {
    if (lane() == 0) f();
    __syncwarp();
  }
  template <class F>
  __device__ __forceinline__ void each(int n, F const& f) const {
    for (int i = lane(); i < n; i += 32) f(i);
    __syncwarp();
  }
  /// The same sum in all threads.
  template <class T, class F>
  __device__ __forceinline__ T sum(int n, F const& f) const {
    T total(0);
    for (int i = lane(); i < n; i += 32) total += f(i);
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) total += __shfl_xor_sync(0xffffffffu, total, stride);
    return total;
  }
  template <class T, class Own, class Put>
  __device__ __forceinline__ void scan(int n, Own const& own, Put const& put) const {
    T before(0);
    for (int begin = 0; begin < n; begin += 32) {
      int const i = begin + lane();
      T const part = i < n ? own(i) : T(0);
      __syncwarp();
      T sum = part;
#pragma unroll
      for (int stride = 1; stride < 32; stride *= 2) {
        T const below = __shfl_up_sync(0xffffffffu, sum, stride);
        if (lane() >= stride) sum += below;
      }
      if (i < n) put(i, before + (sum - part));
      before += __shfl_sync(0xffffffffu, sum, 31);
    }
  }
  template <class T>
  __device__ __forceinline__ void add(T& to, T x) const {
    Kokkos::atomic_add(&to, x);
  }
  template <class Key, class Put>
  __device__ __forceinline__ void place(int n, Key const& key, int* next, Put const& put) const {
    for (int begin = 0; begin < n; begin += 32) {
      int const i = begin + lane(), k = i < n ? key(i) : -1;
      unsigned const equal = __match_any_sync(0xffffffffu, k), before = equal & ((1u << lane()) - 1u);
      int const at = k >= 0 ? next[k] + __popc(before) : 0;
      __syncwarp();
      if (k >= 0 && (equal >> lane()) == 1u) next[k] = at + 1;  // the last of those that are equal
      __syncwarp();
      if (k >= 0) put(i, at);
    }
  }
};

template <class F>
__global__ void __launch_bounds__(32 * warps_of_block) worlds_kernel(F const __grid_constant__ f, int worlds) {
  int const world = int(blockIdx.x * blockDim.y + threadIdx.y);
  if (world < worlds) f(WarpWorld{world});
}

template <class Exec, class F>
void launch_worlds(std::string const& label, Exec const& exec, int worlds, F const& f) {
  if (worlds == 0) return;
  launch_on_cuda(label, exec, [&](cudaStream_t stream) {
    worlds_kernel<<<(worlds + warps_of_block - 1) / warps_of_block, dim3(32, warps_of_block), 0, stream>>>(f, worlds);
  });
}

}  // namespace gsp::detail
