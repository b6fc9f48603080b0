#pragma once
#include <gsp/core/exec.hpp>
#include <string>

/// One small team a world: on a device a warp whose lanes share the world's loops, on a host one thread with plain loops.
namespace gsp {

namespace detail {
/// One thread alone, with plain loops: a world on a host, or a part of one on a device. What every kernel by world is written with.
struct SerialWorld {
  int rank;
  KOKKOS_INLINE_FUNCTION void sync() const {}
  template <class F>
  KOKKOS_INLINE_FUNCTION void single(F const& f) const {
    f();
  }
  template <class F>
  KOKKOS_INLINE_FUNCTION void each(int n, F const& f) const {
    for (int i = 0; i < n; ++i) f(i);
  }
  /// Sum of f(i), in order.
  template <class T, class F>
  KOKKOS_INLINE_FUNCTION T sum(int n, F const& f) const {
    T total(0);
    for (int i = 0; i < n; ++i) total += f(i);
    return total;
  }
  /// f(i, running, last): adds its part to `running`; in the last pass `running` holds what came before.
  template <class T, class F>
  KOKKOS_INLINE_FUNCTION void scan(int n, F const& f) const {
    T running(0);
    for (int i = 0; i < n; ++i) f(i, running, true);
  }
  /// to += x, from several threads.
  template <class T>
  KOKKOS_INLINE_FUNCTION void add(T& to, T x) const {
    to += x;
  }
  /// put(i, next[key(i)]++) in the order of i, where key(i) >= 0: what a counting sort ends with.
  template <class Key, class Put>
  KOKKOS_INLINE_FUNCTION void place(int n, Key const& key, int* next, Put const& put) const {
    for (int i = 0; i < n; ++i)
      if (int const k = key(i); k >= 0) put(i, next[k]++);
  }
};
/// The same for a warp of a device.
template <class Member>
struct DeviceWorld {
  Member const& member;
  int rank;
  KOKKOS_INLINE_FUNCTION void sync() const {
#ifdef __CUDA_ARCH__
    __syncwarp();  // a block is this one warp
#else
    member.team_barrier();
#endif
  }
  template <class F>
  KOKKOS_INLINE_FUNCTION void single(F const& f) const {
    Kokkos::single(Kokkos::PerThread(member), f);
  }
  template <class F>
  KOKKOS_INLINE_FUNCTION void each(int n, F const& f) const {
    Kokkos::parallel_for(Kokkos::ThreadVectorRange(member, n), f);
  }
  template <class T, class F>
  KOKKOS_INLINE_FUNCTION T sum(int n, F const& f) const {
    T total(0);
#ifdef __CUDA_ARCH__
    for (int i = threadIdx.x; i < n; i += 32) total += f(i);
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) total += __shfl_xor_sync(0xffffffffu, total, stride);  // the same sum in all threads
    return total;
#endif
    Kokkos::parallel_reduce(
        Kokkos::ThreadVectorRange(member, n), [&](int i, T& s) { s += f(i); }, total);
    return total;
  }
  template <class T, class F>
  KOKKOS_INLINE_FUNCTION void scan(int n, F const& f) const {
    Kokkos::parallel_scan(Kokkos::ThreadVectorRange(member, n), [&](int i, T& running, bool last) { f(i, running, last); });
  }
  template <class T>
  KOKKOS_INLINE_FUNCTION void add(T& to, T x) const {
    Kokkos::atomic_add(&to, x);
  }
  template <class Key, class Put>
  KOKKOS_INLINE_FUNCTION void place(int n, Key const& key, int* next, Put const& put) const {
#ifdef __CUDA_ARCH__
    for (int begin = 0; begin < n; begin += 32) {
      int const i = begin + int(threadIdx.x), k = i < n ? key(i) : -1;
      unsigned const equal = __match_any_sync(0xffffffffu, k), before = equal & ((1u << threadIdx.x) - 1u);
      int const at = k >= 0 ? next[k] + __popc(before) : 0;
      __syncwarp();
      if (k >= 0 && (equal >> threadIdx.x) == 1u) next[k] = at + 1;  // the last of those that are equal
      __syncwarp();
      if (k >= 0) put(i, at);
    }
#else
    single([&] {
      for (int i = 0; i < n; ++i)
        if (int const k = key(i); k >= 0) put(i, next[k]++);
    });
#endif
  }
};

template <class F>
struct HostWorlds {
  F f;
  [[gnu::noinline]] void operator()(int w) const { f(SerialWorld{w}); }  // one copy of the code for all host backends
};
template <class F>
struct DeviceWorlds {
  F f;
  template <class Member>
  KOKKOS_FUNCTION void operator()(Member const& member) const {
    f(DeviceWorld<Member>{member, member.league_rank()});
  }
};
}  // namespace detail

/// Runs f(world) for world.rank = 0 ... worlds - 1. `f` has a template <class World> operator()(World const&) const and uses world.each,
/// sum, scan, single, sync.
template <ExecutionSpace Exec, class F>
void for_worlds(std::string const& label, Exec const& exec, int worlds, F const& f) {
  if constexpr (is_device<Exec>)
    Kokkos::parallel_for(label, lightweight(Kokkos::TeamPolicy<Exec>(exec, worlds, 1, 32)), detail::DeviceWorlds<F>{f});
  else
    Kokkos::parallel_for(label, Kokkos::RangePolicy<Exec>(exec, 0, worlds), detail::HostWorlds<F>{f});
}

}  // namespace gsp
