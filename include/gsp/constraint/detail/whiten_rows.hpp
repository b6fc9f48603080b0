#pragma once
#include <gsp/constraint/rows.hpp>
#include <gsp/dynamics/dynamics.hpp>
#include <gsp/math/pack.hpp>

/// Y = J L^-1 D^-1/2 where M = L^T D L (dynamics/factor.hpp), row by row, or on hosts a row of one tree a lane.
namespace gsp::detail {

/// y <- y L^-1 D^-1/2 on one segment, of tree `tree`, entries from `begin` on: from the leaves, each leaves its share to its ancestors.
template <class R, class Mem, class Entries>
KOKKOS_INLINE_FUNCTION void whiten(Model<R, Mem> const& model, TreeItems<R> const& s, int tree, RowSegment const& segment, Entries const& y,
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

/// Rows of a world that a host whitens together, one a lane of a pack, all segments of one tree. A lane has what whiten would have made of
/// its row, to the bit: dofs that are not its own stay 0. One by one, each entry would wait for the one before to come back from memory.
/// Until a row has its law, three of its fields hold sums over its entries: lower J v, upper J v of the free velocity, mu |Y|^2.
template <class R, class Mem>
class RowBatch {
 public:
  static constexpr int W = native_width<R>;
  using T = Pack<R, W>;
  static constexpr int most_dofs = 128;

  KOKKOS_INLINE_FUNCTION RowBatch(Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, R* entries, int world)
      : model_(model), dynamics_(dynamics), entries_(entries), world_(world) {}
  /// Takes segment s of a row in; its entries are those of J in the pool.
  KOKKOS_INLINE_FUNCTION void add(Row<R>& row, int s) {
    int const tree = model_.dof_tree(row.segment[s].dof0);
    if (count_ == W || (count_ > 0 && tree != tree_)) finish();
    tree_ = tree;
    segment_[count_] = row.segment[s];
    y_[count_] = entries_ + row.first_entry + (s > 0 ? row.segment[0].count : 0);
    row_[count_++] = &row;
  }
  /// What was taken in: entries are those of Y then, and sums are complete.
  KOKKOS_INLINE_FUNCTION void finish() {
    if (count_ == 0) return;
    TreeItems<R> const items = dynamics_.tree(model_, world_, tree_);
    Archetype const& a = model_.archetypes(model_.tree_archetype(tree_));
    if (count_ < 3 || a.nv > most_dofs)
      for (int k = 0; k < count_; ++k) one(items, k);
    else
      together(items, a);
    count_ = 0;
  }

 private:
  KOKKOS_INLINE_FUNCTION int dof(RowSegment const& segment, int i) const { return segment.list < 0 ? i : model_.ints(segment.list + i); }
  KOKKOS_INLINE_FUNCTION void one(TreeItems<R> const& items, int k) const {
    R* const y = y_[k];
    Row<R>& to = *row_[k];
    for (int i = 0; i < segment_[k].count; ++i) {
      int const d = dof(segment_[k], i);
      to.lower = fma(y[i], items[items.at.qvel + d], to.lower);
      to.upper = fma(y[i], items[items.at.velocity + d], to.upper);
    }
    whiten(model_, items, tree_, segment_[k], y, 0);
    for (int i = 0; i < segment_[k].count; ++i) to.mu = fma(y[i], y[i], to.mu);
  }
  KOKKOS_INLINE_FUNCTION void together(TreeItems<R> const& items, Archetype const& a) {
    T y[most_dofs], rate(R(0)), free_rate(R(0)), diagonal(R(0));
    bool touched[most_dofs];
    for (int d = 0; d < a.nv; ++d) touched[d] = false;
    for (int k = 0; k < count_; ++k) {
      rate.set(k, row_[k]->lower);
      free_rate.set(k, row_[k]->upper);
      diagonal.set(k, row_[k]->mu);
      for (int i = 0; i < segment_[k].count; ++i) {
        int const d = dof(segment_[k], i);
        if (!touched[d]) y[d] = T(R(0));
        touched[d] = true;
        y[d].set(k, y_[k][i]);
      }
    }
    for (int d = 0; d < a.nv; ++d) {
      if (!touched[d]) continue;
      rate = fma(y[d], T(items[items.at.qvel + d]), rate);
      free_rate = fma(y[d], T(items[items.at.velocity + d]), free_rate);
    }
    int const* const ints = model_.ints.data();
    for (int d = a.nv; d-- > 0;) {
      if (!touched[d]) continue;  // and so are its ancestors, where it is
      int const adr = ints[a.row_adr + d], n = ints[a.row_adr + d + 1] - adr - 1;
      T const value = y[d];
      for (int p = 0; p < n; ++p) {
        T& to = y[ints[a.row_col + adr + p]];
        to = fma(T(-items[items.at.factor + adr + p]), value, to);
      }
      y[d] = value * T(sqrt(items[items.at.inverse_diagonal + d]));
    }
    for (int d = 0; d < a.nv; ++d)
      if (touched[d]) diagonal = fma(y[d], y[d], diagonal);
    for (int k = 0; k < count_; ++k) {
      for (int i = 0; i < segment_[k].count; ++i) y_[k][i] = y[dof(segment_[k], i)][k];
      row_[k]->lower = rate[k];
      row_[k]->upper = free_rate[k];
      row_[k]->mu = diagonal[k];
    }
  }

  Model<R, Mem> const& model_;
  Dynamics<R, Mem> const& dynamics_;
  R* entries_;
  int world_, count_ = 0, tree_ = -1;
  RowSegment segment_[W];
  R* y_[W];
  Row<R>* row_[W];
};

}  // namespace gsp::detail
