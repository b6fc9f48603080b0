#pragma once
#include <gsp/constraint/rows.hpp>
#include <gsp/dynamics/dynamics.hpp>

/// Y = J L^-1 D^-1/2 where M = L^T D L (dynamics/factor.hpp), of one row. Hosts make a row a lane (row_lanes.hpp).
namespace gsp::detail {

/// x, which nothing writes while a kernel is at work (from `follow` on): a load that need not wait for the stores before it.
template <class T>
KOKKOS_FORCEINLINE_FUNCTION T read_only(T const& x) {
#ifdef __CUDA_ARCH__
  return __ldg(&x);
#else
  return x;
#endif
}

/// What is summed over the entries of a row. Until it has its law, four of its fields hold them.
template <class R>
struct RowSums {
  R gap = R(0);                     // its gap + J x, x what rounding has taken from the positions (FactorLayout::low)
  R rate = R(0), free_rate = R(0);  // J v, v the velocity; the free velocity
  R diagonal = R(0);                // |Y|^2
  KOKKOS_INLINE_FUNCTION static RowSums of(Row<R> const& row) { return {row.bias, row.lower, row.upper, row.mu}; }
  KOKKOS_INLINE_FUNCTION void leave_in(Row<R>& row) const {
    row.bias = gap;
    row.lower = rate;
    row.upper = free_rate;
    row.mu = diagonal;
  }
};

/// y <- y L^-1 D^-1/2 on one segment, of tree `tree`, entries from `begin` on: from the leaves, each leaves its share to its ancestors.
/// @param s     TreeItems or FactorItems of the tree
/// @param y     J, and Y then
/// @param sums  grow by what is on the segment
template <class R, class Mem, class Items, class Entries>
KOKKOS_INLINE_FUNCTION void whiten(Model<R, Mem> const& model, Items const& s, int tree, RowSegment const& segment, Entries const y,
                                   int begin, RowSums<R>& sums) {
  Archetype const& a = model.archetypes(model.tree_archetype(tree));
  int const* const ints = model.ints.data();
  auto const number = [&](int i) { return segment.list < 0 ? i : read_only(ints[segment.list + i]); };
  for (int i = 0; i < segment.count; ++i) {
    int const dof = number(i);
    R const J = y[begin + i];
    sums.gap = fma(J, read_only(s[s.at.low + dof]), sums.gap);
    sums.rate = fma(J, read_only(s[s.at.qvel + dof]), sums.rate);
    sums.free_rate = fma(J, read_only(s[s.at.velocity + dof]), sums.free_rate);
  }
  // What loads wait for is loaded a turn before, and four at a time: a load after a store to y would wait for it, as they might be of the
  // same place.
  struct Dof {
    int number, adr, n;  // where its row of L begins, its ancestors there
  };
  auto const dof_at = [&](int i) {
    int const dof = number(i), adr = read_only(ints[a.row_adr + dof]);
    return Dof{dof, adr, read_only(ints[a.row_adr + dof + 1]) - adr - 1};
  };
  constexpr int batch = 4;
  Dof next = dof_at(segment.count - 1);
  for (int i = segment.count - 1; i >= 0; --i) {
    Dof const dof = next;
    R const value = y[begin + i], scale = sqrt(read_only(s[s.at.inverse_diagonal + dof.number]));
    if (i > 0) next = dof_at(i - 1);
    auto const leave = [&](auto const& place) {
      R coming[batch], factor[batch], left[batch];
      auto const take = [&](int p) {
        for (int k = 0; k < batch; ++k)
          if (p + k < dof.n) coming[k] = read_only(s[s.at.factor + dof.adr + p + k]);
      };
      take(0);
      for (int p = 0; p < dof.n; p += batch) {
        for (int k = 0; k < batch; ++k) factor[k] = -coming[k];
        take(p + batch);
        for (int k = 0; k < batch; ++k)
          if (p + k < dof.n) left[k] = fma(factor[k], value, y[place(p + k)]);
        for (int k = 0; k < batch; ++k)
          if (p + k < dof.n) y[place(p + k)] = left[k];
      }
    };
    if (dof.n == i)  // a chain: its ancestors are the entries before
      leave([&](int p) { return begin + p; });
    else
      leave([&](int p) { return begin + read_only(ints[a.row_col + dof.adr + p]); });
    R const whitened = value * scale;
    y[begin + i] = whitened;
    sums.diagonal = fma(whitened, whitened, sums.diagonal);
  }
}

}  // namespace gsp::detail
