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
  /// The same; others see it after the next sync. (Not of BlockWorld.)
  template <class F>
  KOKKOS_INLINE_FUNCTION void one(F const& f) const {
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
  /// put(i, sum of own(j) of all j < i); a thread calls own(i), then put(i), before it comes to the next i.
  template <class T, class Own, class Put>
  KOKKOS_INLINE_FUNCTION void scan(int n, Own const& own, Put const& put) const {
    T before(0);
    for (int i = 0; i < n; ++i) {
      T const part = own(i);
      put(i, before);
      before += part;
    }
  }
  /// The numbers i < n where is(i), in order, to `to`; returns how many. Others see them after a sync. (Not of BlockWorld.)
  template <class Index, class F>
  KOKKOS_INLINE_FUNCTION int list(int n, Index* to, F const& is) const {
    int count = 0;
    for (int i = 0; i < n; ++i)
      if (is(i)) to[count++] = static_cast<Index>(i);
    return count;
  }
  /// f(warp, i) for i < n, by a warp each, which is as a world. (Of SomeWarps.)
  template <class F>
  KOKKOS_INLINE_FUNCTION void each_warp(int n, F const& f) const {
    for (int i = 0; i < n; ++i) f(*this, i);
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
template <class F>
struct HostWorlds {
  F f;
  [[gnu::noinline]] void operator()(int w) const { f(SerialWorld{w}); }  // one copy of the code for all host backends
};
/// f(world), a warp each, with what SerialWorld has (worlds_cuda.hpp).
template <class Exec, class F>
void launch_worlds(std::string const& label, Exec const& exec, int worlds, F const& f);
}  // namespace detail

/// Runs f(world) for world.rank = 0 ... worlds - 1. `f` has a template <class World> operator()(World const&) const and uses what
/// detail::SerialWorld has; docs/parallel/for_worlds.md has the table. Each, sum, scan, list, place, single and sync must be reached by all
/// threads of a world: never in a branch that some of them take, nor inside of one another.
template <ExecutionSpace Exec, class F>
void for_worlds(std::string const& label, Exec const& exec, int worlds, F const& f) {
  if constexpr (is_device<Exec>)
    detail::launch_worlds(label, exec, worlds, f);
  else
    Kokkos::parallel_for(label, Kokkos::RangePolicy<Exec>(exec, 0, worlds), detail::HostWorlds<F>{f});
}

}  // namespace gsp

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/parallel/detail/worlds_cuda.hpp>
#endif
