#pragma once
#include <gsp/constraint/rows.hpp>
#include <gsp/dynamics/dynamics.hpp>

/// Y = J L^-1 D^-1/2 where M = L^T D L (dynamics/factor.hpp), of one row, on a host, which makes most of them together (row_lanes.hpp).
/// Devices: whiten_trees.hpp.
namespace gsp::detail {

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

/// y <- y L^-1 D^-1/2 on one segment, of tree `tree`: from the leaves, each leaves its share to its ancestors.
/// @param y     J, and Y then
/// @param sums  grow by what is on the segment
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION void whiten(Model<R, Mem> const& model, FactorItems<R> const& s, int tree, RowSegment const& segment, R* y,
                                   RowSums<R>& sums) {
  Archetype const& a = model.archetypes(model.tree_archetype(tree));
  int const* const ints = model.ints.data();
  auto const number = [&](int i) { return segment.list < 0 ? i : ints[segment.list + i]; };
  for (int i = 0; i < segment.count; ++i) {
    int const dof = number(i);
    sums.gap = fma(y[i], s[s.at.low + dof], sums.gap);
    sums.rate = fma(y[i], s[s.at.qvel + dof], sums.rate);
    sums.free_rate = fma(y[i], s[s.at.velocity + dof], sums.free_rate);
  }
  for (int i = segment.count - 1; i >= 0; --i) {
    int const dof = number(i), adr = ints[a.row_adr + dof], n = ints[a.row_adr + dof + 1] - adr - 1;
    R const value = y[i];
    for (int p = 0; p < n; ++p) {
      R& to = y[n == i ? p : ints[a.row_col + adr + p]];  // of a chain its ancestors are the entries before
      to = fma(-s[s.at.factor + adr + p], value, to);
    }
    y[i] = value * sqrt(s[s.at.inverse_diagonal + dof]);
    sums.diagonal = fma(y[i], y[i], sums.diagonal);
  }
}

}  // namespace gsp::detail
