#pragma once
#include <gsp/constraint/rows.hpp>

/// What the rows of an element do to each other.
namespace gsp::detail {

KOKKOS_INLINE_FUNCTION constexpr int couplings_of(int rows) { return rows * (rows - 1) / 2; }

template <class R>
KOKKOS_INLINE_FUNCTION bool has_segments_of(Row<R> const& a, Row<R> const& b) {
  bool same = true;
  for (int s = 0; s < 2; ++s)
    same = same && a.segment[s].dof0 == b.segment[s].dof0 && a.segment[s].list == b.segment[s].list &&
           a.segment[s].count == b.segment[s].count;
  return same;
}
/// Y_a . Y_b of two rows. `dofs`: what their lists lie in.
template <class R>
KOKKOS_INLINE_FUNCTION R row_product(Row<R> const& a, Row<R> const& b, R const* Y, int const* dofs) {
  R sum(0);
  R const* y = Y + a.first_entry;
  for (int s = 0; s < 2; ++s) {
    RowSegment const& own = a.segment[s];
    R const* z = Y + b.first_entry;
    for (int t = 0; t < 2; ++t) {
      RowSegment const& other = b.segment[t];
      if (own.dof0 == other.dof0 && own.list == other.list && own.count == other.count) {
        for (int i = 0; i < own.count; ++i) sum = fma(y[i], z[i], sum);
      } else if (own.dof0 == other.dof0) {  // both lists ascend
        for (int i = 0, j = 0; i < own.count && j < other.count;) {
          int const dof = own.list < 0 ? i : dofs[own.list + i], with = other.list < 0 ? j : dofs[other.list + j];
          if (dof == with) sum = fma(y[i], z[j], sum);
          i += dof <= with;
          j += with <= dof;
        }
      }
      z += other.count;
    }
    y += own.count;
  }
  return sum;
}

/// Two rows that share an ellipse take one step in the coordinates q = p / mu, where it is a disc: a projected gradient step
/// contracts there for a step of 1 / (largest eigenvalue of the two rows' matrix diag(mu) A diag(mu)). Where one of them cannot move, or
/// has no friction, the other is alone.
template <class R>
KOKKOS_INLINE_FUNCTION void step_together(Row<R>& first, Row<R>& second, R coupling) {
  first.with_next = first.mu > R(0) && second.mu > R(0);
  if (!first.with_next) return;
  R const ratio = second.mu / first.mu, a = R(1) / first.inverse_diagonal, b = square(ratio) / second.inverse_diagonal;
  R const half = R(0.5) * (a - b), root = sqrt(square(half) + square(ratio * coupling));
  first.inverse_diagonal = R(1) / (R(0.5) * (a + b) + root);
  second.inverse_diagonal = square(ratio) * first.inverse_diagonal;
}
/// Products of n rows of the same segments, whose entries lie one row's after the other's: each waits for its own last sum alone.
template <int n, class R>
KOKKOS_FORCEINLINE_FUNCTION void products_of(R const* Y, int entries, R* to) {
  R sum[couplings_of(n)];
  for (R& s : sum) s = R(0);
  for (int i = 0; i < entries; ++i) {
    R y[n];
    for (int b = 0; b < n; ++b) y[b] = Y[b * entries + i];
    for (int b = 1; b < n; ++b)
      for (int a = 0; a < b; ++a) sum[couplings_of(b) + a] = fma(y[a], y[b], sum[couplings_of(b) + a]);
  }
  for (int k = 0; k < couplings_of(n); ++k) to[k] = sum[k];
}
/// Products of the rows of an element, to `couplings` in Y, and the steps of those that share an ellipse.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION void couple(Rows<R, Mem> const& rows, Row<R>* row, int n, std::int64_t couplings) {
  R* const coupling = rows.Y.data() + couplings;
  int const entries = row->segment[0].count + row->segment[1].count;
  R const* const Y = rows.Y.data() + row->first_entry;
  if (row->same_segments && n == 2) {
    products_of<2>(Y, entries, coupling);
  } else if (row->same_segments && n == 3) {
    products_of<3>(Y, entries, coupling);
  } else if (row->same_segments && n == 4) {
    products_of<4>(Y, entries, coupling);
  } else {
    for (int b = 1; b < n; ++b)
      for (int a = 0; a < b; ++a) coupling[couplings_of(b) + a] = row_product(row[a], row[b], rows.Y.data(), rows.dof_lists.data());
  }
  for (int r = 0; r + 1 < n; ++r)
    if (row[r].with_next) step_together(row[r], row[r + 1], coupling[couplings_of(r + 1) + r]);
}

}  // namespace gsp::detail
