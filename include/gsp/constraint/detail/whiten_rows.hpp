#pragma once
#include <gsp/constraint/rows.hpp>
#include <gsp/dynamics/dynamics.hpp>

/// Y = J L^-1 D^-1/2 where M = L^T D L (dynamics/factor.hpp), of one row. Hosts make a row a lane (row_lanes.hpp).
namespace gsp::detail {

/// y <- y L^-1 D^-1/2 on one segment, of tree `tree`, entries from `begin` on: from the leaves, each leaves its share to its ancestors.
/// @param s  TreeItems or FactorItems of it
template <class R, class Mem, class Items, class Entries>
KOKKOS_INLINE_FUNCTION void whiten(Model<R, Mem> const& model, Items const& s, int tree, RowSegment const& segment, Entries const& y,
                                   int begin) {
  Archetype const& a = model.archetypes(model.tree_archetype(tree));
  int const* const ints = model.ints.data();
  constexpr int batch = 4;  // loads after a store to y would wait for it, as they might be of the same place: so many at a time
  for (int i = segment.count - 1; i >= 0; --i) {
    int const dof = segment.list < 0 ? i : ints[segment.list + i], adr = ints[a.row_adr + dof], n = ints[a.row_adr + dof + 1] - adr;
    R const value = y[begin + i], scale = sqrt(s[s.at.inverse_diagonal + dof]);
    auto const place = [&](int p) {  // in a chain the ancestors are the entries before
      return begin + (segment.list < 0 ? ints[a.row_col + adr + p] : p);
    };
    int p = 0;
    for (; p + batch < n; p += batch) {
      int at[batch];
      R next[batch];
      for (int k = 0; k < batch; ++k) at[k] = place(p + k);
      for (int k = 0; k < batch; ++k) next[k] = fma(-s[s.at.factor + adr + p + k], value, y[at[k]]);
      for (int k = 0; k < batch; ++k) y[at[k]] = next[k];
    }
    for (; p < n - 1; ++p) y[place(p)] = fma(-s[s.at.factor + adr + p], value, y[place(p)]);
    y[begin + i] = value * scale;
  }
}

}  // namespace gsp::detail
