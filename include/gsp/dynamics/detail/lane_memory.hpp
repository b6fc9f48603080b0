#pragma once
#include <gsp/dynamics/dynamics.hpp>

/// How the lanes of gsp/dynamics/lanes.hpp, where the contract stands, read and write memory.
namespace gsp::detail {

template <class T>
KOKKOS_INLINE_FUNCTION T get_lane(T const& x, int) {
  return x;
}
template <class R, int W>
KOKKOS_INLINE_FUNCTION R get_lane(Pack<R, W> const& x, int i) {
  return x[i];
}

// Packs from and to plain memory. Not inlined: they are called often, and are loops.
// Lane i at data[world[i] * stride + first[i] * components + offset]:
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION T gather(real_t<T> const* data, std::int64_t stride, int const* world, int const* first, int components,
                                           int offset) {
  return T::of([&](int i) { return data[world[i] * stride + first[i] * components + offset]; });
}
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION void scatter(real_t<T>* data, std::int64_t stride, int const* world, int const* first, int components,
                                               int offset, T const& x, int count) {
  for (int i = 0; i < count; ++i) data[world[i] * stride + first[i] * components + offset] = x[i];
}
// Lane i at data[i * stride], where a block is one instance in consecutive worlds:
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION T gather_consecutive(real_t<T> const* data, std::int64_t stride) {
  return T::of([&](int i) { return data[i * stride]; });
}
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION void scatter_consecutive(real_t<T>* data, std::int64_t stride, T const& x) {
  alignas(T) real_t<T> values[T::width];
  *reinterpret_cast<T*>(values) = x;
  for (int i = 0; i < T::width; ++i, data += stride) *data = values[i];
}

/// put(i, get(i)) for i < n. On a GPU `batch` at a time: the compiler cannot know that what is put is not what is got next, and a thread
/// would wait for memory item by item.
template <int batch = 8, class Get, class Put>
KOKKOS_FORCEINLINE_FUNCTION void each_batched(int n, Get const& get, Put const& put) {
#ifdef __CUDA_ARCH__
  for (int i = 0; i < n; i += batch) {
    decltype(get(0)) v[batch];
#pragma unroll
    for (int k = 0; k < batch; ++k)
      if (i + k < n) v[k] = get(i + k);
#pragma unroll
    for (int k = 0; k < batch; ++k)
      if (i + k < n) put(i + k, v[k]);
  }
#else
  for (int i = 0; i < n; ++i) put(i, get(i));
#endif
}
template <class L, class F>
[[gnu::noinline]] KOKKOS_FUNCTION void out_of_line(L const& l, F const& f) {
  f(l);
}

}  // namespace gsp::detail
