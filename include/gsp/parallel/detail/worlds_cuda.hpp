#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>

/// Worlds on a CUDA GPU: a warp each.
namespace gsp::detail {

// A multiprocessor holds 32 blocks, and more warps than that where registers allow it. Kernels that work in columns read what the dynamics
// keep of their worlds, eight of which share each sector of memory: eight neighbours a block find it in their L1 cache. They wait for
// memory most of the time: three blocks at a time, with 80 registers a thread, are faster than two with all that they want (four: about
// the same, docs/decisions/0017).
template <bool has_columns>
inline constexpr int warps_of_block = has_columns ? 8 : 2;
template <bool has_columns>
inline constexpr int blocks_at_a_time = has_columns ? 3 : 1;

/// Numbers of a thread among those of the other threads of its warp.
template <class T>
struct Column {
  T* at;
  int stride;
  __device__ T& operator[](int i) const { return at[i * stride]; }
};

/// Memory near the threads that a kernel asks for [bytes a thread].
template <class F>
inline constexpr int column_bytes_of = 0;
template <class F>
requires(F::column_bytes > 0) inline constexpr int column_bytes_of<F> = F::column_bytes;

template <int column_bytes>
struct WarpWorld {
  int rank;
  char* columns;  // of the warp
  static __device__ int lane() { return int(threadIdx.x); }
  __device__ void sync() const { __syncwarp(); }
  template <class F>
  __device__ void single(F const& f) const {
    if (lane() == 0) f();
    __syncwarp();
  }
  template <class F>
  __device__ void each(int n, F const& f) const {
    for (int i = lane(); i < n; i += 32) f(i);
    __syncwarp();
  }
  /// The same sum in all threads.
  template <class T, class F>
  __device__ T sum(int n, F const& f) const {
    T total(0);
    for (int i = lane(); i < n; i += 32) total += f(i);
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) total += __shfl_xor_sync(0xffffffffu, total, stride);
    return total;
  }
  template <class T, class F>
  __device__ void scan(int n, F const& f) const {
    T before(0);
    for (int begin = 0; begin < n; begin += 32) {
      int const i = begin + lane();
      T own(0);
      if (i < n) f(i, own, false);
      __syncwarp();
      T sum = own;
#pragma unroll
      for (int stride = 1; stride < 32; stride *= 2) {
        T const below = __shfl_up_sync(0xffffffffu, sum, stride);
        if (lane() >= stride) sum += below;
      }
      T running = before + (sum - own);
      if (i < n) f(i, running, true);
      before += __shfl_sync(0xffffffffu, sum, 31);
    }
  }
  template <class T>
  __device__ void add(T& to, T x) const {
    Kokkos::atomic_add(&to, x);
  }
  template <class Key, class Put>
  __device__ void place(int n, Key const& key, int* next, Put const& put) const {
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
  template <class T>
  __device__ Column<T> column(int n, T* there) const {
    if (n * int(sizeof(T)) <= column_bytes) return {reinterpret_cast<T*>(columns) + lane(), 32};
    return {there, 1};
  }
};

template <class F, int bytes = column_bytes_of<F>>
__global__ void __launch_bounds__(32 * warps_of_block<(bytes > 0)>, blocks_at_a_time<(bytes > 0)>)
    worlds_kernel(F const __grid_constant__ f, int worlds) {
  int const world = int(blockIdx.x * blockDim.y + threadIdx.y);
  if constexpr (bytes > 0) {
    __shared__ alignas(8) char columns[warps_of_block<true>][32 * bytes];
    if (world < worlds) f(WarpWorld<bytes>{world, columns[threadIdx.y]});
  } else {
    if (world < worlds) f(WarpWorld<0>{world, nullptr});
  }
}

template <class Exec, class F>
void launch_worlds(std::string const& label, Exec const& exec, int worlds, F const& f) {
  if (worlds == 0) return;
  constexpr int warps = warps_of_block<(column_bytes_of < F >> 0)>;
  launch_on_cuda(label, exec,
                 [&](cudaStream_t stream) { worlds_kernel<<<(worlds + warps - 1) / warps, dim3(32, warps), 0, stream>>>(f, worlds); });
}

}  // namespace gsp::detail
