#pragma once
#include <concepts>
#include <gsp/parallel/detail/launch_cuda.hpp>

/// Worlds on a CUDA GPU: a warp each; or, where there are few of them, a block each, in kernels that say so (F::wide): those
/// that sum whole numbers, which have no order. The same results.
namespace gsp::detail {

inline constexpr int warps_of_block = 2;  // a multiprocessor holds 32 blocks, and more warps than that where registers allow it

/// @tparam of_block  one of several of a block, whose threads are counted on
template <bool of_block>
struct WarpThreads {
  static constexpr int threads = 32;
  int rank;
  static __device__ int lane() { return of_block ? int(threadIdx.x) % 32 : int(threadIdx.x); }
  __device__ void sync() const { __syncwarp(); }
  template <class F>
  __device__ __forceinline__ void single(F const& f) const {
    if (lane() == 0) f();
    __syncwarp();
  }
  template <class F>
  __device__ __forceinline__ void one(F const& f) const {
    if (lane() == 0) f();
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
  template <class Index, class F>
  __device__ __forceinline__ int list(int n, Index* to, F const& is) const {
    int count = 0;
    for (int begin = 0; begin < n; begin += 32) {
      int const i = begin + lane();
      bool const own = i < n && is(i);
      unsigned const all = __ballot_sync(0xffffffffu, own);
      if (own) to[count + __popc(all & ((1u << lane()) - 1u))] = static_cast<Index>(i);
      count += __popc(all);
    }
    return count;
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

using WarpWorld = WarpThreads<false>;

/// sync, single, one, each, sum and list of WarpWorld, by some warps, which are a block; and a warp each of what each_warp counts.
template <int warps>
struct SomeWarps {
  static constexpr int threads = 32 * warps;
  int rank;
  __device__ void sync() const { __syncthreads(); }
  template <class F>
  __device__ __forceinline__ void single(F const& f) const {
    if (threadIdx.x == 0) f();
    __syncthreads();
  }
  template <class F>
  __device__ __forceinline__ void one(F const& f) const {
    if (threadIdx.x == 0) f();
  }
  template <class F>
  __device__ __forceinline__ void each(int n, F const& f) const {
    for (int i = int(threadIdx.x); i < n; i += threads) f(i);
    __syncthreads();
  }
  template <class F>
  __device__ __forceinline__ void each_warp(int n, F const& f) const {
    for (int i = int(threadIdx.x) / 32; i < n; i += warps) f(WarpThreads<true>{rank}, i);
    __syncthreads();
  }
  template <class T, class F>
  __device__ __forceinline__ T sum(int n, F const& f) const {
    __shared__ T of_warp[warps];
    T own(0), total(0);
    for (int i = int(threadIdx.x); i < n; i += threads) own += f(i);
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) own += __shfl_xor_sync(0xffffffffu, own, stride);
    if (threadIdx.x % 32 == 0) of_warp[threadIdx.x / 32] = own;
    __syncthreads();
#pragma unroll
    for (int w = 0; w < warps; ++w) total += of_warp[w];
    __syncthreads();
    return total;
  }
  template <class Index, class F>
  __device__ __forceinline__ int list(int n, Index* to, F const& is) const {
    int count = 0;  // each warp finds all, and the first one writes
    for (int begin = 0; begin < n; begin += 32) {
      int const lane = int(threadIdx.x) % 32, i = begin + lane;
      bool const own = i < n && is(i);
      unsigned const all = __ballot_sync(0xffffffffu, own);
      if (own && threadIdx.x < 32) to[count + __popc(all & ((1u << lane) - 1u))] = static_cast<Index>(i);
      count += __popc(all);
    }
    return count;
  }
};

/// What WarpWorld has but one and list, by a block.
struct BlockWorld {
  static constexpr int warps = 16, threads = 32 * warps;
  int rank;
  static __device__ int thread() { return int(threadIdx.x); }
  static __device__ int lane() { return thread() % 32; }
  __device__ void sync() const { __syncthreads(); }
  template <class F>
  __device__ __forceinline__ void single(F const& f) const {
    if (thread() == 0) f();
    __syncthreads();
  }
  template <class F>
  __device__ __forceinline__ void each(int n, F const& f) const {
    for (int i = thread(); i < n; i += threads) f(i);
    __syncthreads();
  }
  template <class T, class F>
  __device__ __forceinline__ T sum(int n, F const& f) const {
    T total(0);
    if constexpr (std::integral<T>) {
      T own(0);
      for (int i = thread(); i < n; i += threads) own += f(i);
      add_up(own, total);
    } else {  // in the order of a warp
      if (thread() < 32) total = WarpWorld{rank}.sum<T>(n, f);
      __shared__ T of_all;
      __syncthreads();
      if (thread() == 0) of_all = total;
      __syncthreads();
      total = of_all;
    }
    return total;
  }
  template <class T, class Own, class Put>
  __device__ __forceinline__ void scan(int n, Own const& own, Put const& put) const {
    if constexpr (std::integral<T>) {
      T before(0);
      for (int begin = 0; begin < n; begin += threads) {
        int const i = begin + thread();
        T const part = i < n ? own(i) : T(0), mine = add_up(part, before);
        if (i < n) put(i, mine);
      }
    } else {
      if (thread() < 32) WarpWorld{rank}.scan<T>(n, own, put);
      __syncthreads();
    }
  }
  template <class T>
  __device__ __forceinline__ void add(T& to, T x) const {
    Kokkos::atomic_add(&to, x);
  }
  template <class Key, class Put>
  __device__ __forceinline__ void place(int n, Key const& key, int* next, Put const& put) const {
    for (int begin = 0; begin < n; begin += threads) {
      int const i = begin + thread(), k = i < n ? key(i) : -1;
      unsigned const equal = __match_any_sync(0xffffffffu, k), before = equal & ((1u << lane()) - 1u);
      int at = 0;
      for (int warp = 0; warp < warps && begin + 32 * warp < n; ++warp) {  // one after the other, in order
        if (thread() / 32 == warp) {
          at = k >= 0 ? next[k] + __popc(before) : 0;
          __syncwarp();
          if (k >= 0 && (equal >> lane()) == 1u) next[k] = at + 1;
        }
        __syncthreads();
      }
      if (k >= 0) put(i, at);
    }
  }

 private:
  /// Sum of x over the threads before this one, and `total`, which grows by that over all.
  template <class T>
  static __device__ __forceinline__ T add_up(T x, T& total) {
    __shared__ T of_warp[warps];
    T sum = x;
#pragma unroll
    for (int stride = 1; stride < 32; stride *= 2) {
      T const below = __shfl_up_sync(0xffffffffu, sum, stride);
      if (lane() >= stride) sum += below;
    }
    __syncthreads();  // what was there before is read
    if (lane() == 31) of_warp[thread() / 32] = sum;
    __syncthreads();
    T const begin = total;
    T before = begin;
#pragma unroll
    for (int w = 0; w < warps; ++w) {
      if (w < thread() / 32) before += of_warp[w];
      total += of_warp[w];
    }
    return before + (sum - x);
  }
};

template <class F>
__global__ void __launch_bounds__(32 * warps_of_block) worlds_kernel(F const __grid_constant__ f, int worlds) {
  follow();
  int const world = int(blockIdx.x * blockDim.y + threadIdx.y);
  if (world < worlds) f(WarpWorld{world});
}
template <class F>
__global__ void __launch_bounds__(BlockWorld::threads) wide_worlds_kernel(F const __grid_constant__ f) {
  follow();
  f(BlockWorld{int(blockIdx.x)});
}

template <class Exec, class F>
void launch_worlds(std::string const& label, Exec const& exec, int worlds, F const& f) {
  if (worlds == 0) return;
  launch_on_cuda(label, exec, [&](cudaStream_t stream) {
    if constexpr (requires { requires F::wide; })
      if (worlds <= exec.cuda_device_prop().multiProcessorCount)
        return launch_kernel(stream, wide_worlds_kernel<F>, worlds, BlockWorld::threads, 0, f);
    launch_kernel(stream, worlds_kernel<F>, (worlds + warps_of_block - 1) / warps_of_block, dim3(32, warps_of_block), 0, f, worlds);
  });
}

}  // namespace gsp::detail
