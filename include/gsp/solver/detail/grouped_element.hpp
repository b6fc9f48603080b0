#pragma once
#include <gsp/math/pack.hpp>
#include <gsp/solver/project_element.hpp>

/// Elements whose entries come by groups of dofs, for islands that a CPU sweeps by themselves (pgs_grouped.hpp).
namespace gsp::detail {

/// Dofs of a group: a free body's are one, in float.
template <class R>
inline constexpr int group_dofs = native_width<R> < 8 ? native_width<R> : 8;

/// Sum over the lanes, by halves.
template <class R, int W>
KOKKOS_INLINE_FUNCTION R sum_of_lanes(Pack<R, W> const& x) {
  if constexpr (W == 1) {
    return x[0];
  } else {
    Pack<R, W / 2> low, high;
    __builtin_memcpy(&low, &x, sizeof low);
    __builtin_memcpy(&high, reinterpret_cast<char const*>(&x) + sizeof low, sizeof high);
    return sum_of_lanes(low + high);
  }
}

/// An element of M rows; behind it lie its groups, and from the next whole pack on the entries, by group, then by row.
template <class R, int M>
struct alignas(Pack<R, group_dofs<R>>) GroupedElement {
  using T = Pack<R, group_dofs<R>>;
  int rows, groups;
  ElementLaw<R, M> law;
  R coupling[M > 1 ? M*(M - 1) / 2 : 1];  // Y_b . Y_a, a < b
  /// Places in z where they begin.
  KOKKOS_INLINE_FUNCTION int* group() const { return reinterpret_cast<int*>(const_cast<GroupedElement*>(this) + 1); }
  KOKKOS_INLINE_FUNCTION T* entries() const {
    return reinterpret_cast<T*>(group()) + (groups * int(sizeof(int)) + int(sizeof(T)) - 1) / int(sizeof(T));
  }
  /// w = Y z
  KOKKOS_INLINE_FUNCTION void product(R const* z, R (&w)[M]) const {
    T sum[M];
    unrolled<M>([&](auto b) { sum[b] = T(R(0)); });
    T const* y = entries();
    int const* const place = group();
    for (int g = 0; g < groups; ++g, y += M) {
      T const x = *reinterpret_cast<T const*>(z + place[g]);
      unrolled<M>([&](auto b) { sum[b] = fma(y[b], x, sum[b]); });
    }
    unrolled<M>([&](auto b) { w[b] = sum_of_lanes(sum[b]); });
  }
  /// z += Y^T d
  KOKKOS_INLINE_FUNCTION void push(R* z, R const* d) const {
    T of_row[M];
    unrolled<M>([&](auto b) { of_row[b] = T(d[b]); });
    T const* y = entries();
    int const* const place = group();
    for (int g = 0; g < groups; ++g, y += M) {
      T& to = *reinterpret_cast<T*>(z + place[g]);
      T x = to;
      unrolled<M>([&](auto b) { x = fma(y[b], of_row[b], x); });
      to = x;
    }
  }
};

/// f(Index<n>) for an element of n rows.
template <class F>
KOKKOS_INLINE_FUNCTION void of_rows(int n, F const& f) {
  static_assert(most_element_rows == 6);
  switch (n) {
    case 1:
      return f(Index<1>{});
    case 2:
      return f(Index<2>{});
    case 3:
      return f(Index<3>{});
    case 4:
      return f(Index<4>{});
    case 5:
      return f(Index<5>{});
    default:
      return f(Index<6>{});
  }
}

}  // namespace gsp::detail
