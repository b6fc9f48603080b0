#pragma once
#include <gsp/constraint/detail/couple_rows.hpp>
#include <gsp/constraint/impulses.hpp>
#include <gsp/parallel/for_worlds.hpp>

/// The kernels of constraint/eliminate.hpp, where the equations stand.
namespace gsp::detail {

/// What rows do to eliminated row k of a world, by row of the world.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION R* elimination_of(Rows<R, Mem> const& rows, int w, int k) {
  int const count = rows.count(w);
  return rows.Y.data() + rows.first_entry(w) + rows.entries(w) - std::int64_t(rows.most_eliminated - k) * count;
}
/// g and 1 / s of an eliminated row.
template <class R>
struct Elimination {
  R g = R(0), inverse;
  KOKKOS_INLINE_FUNCTION Elimination(Row<R> const& row, R norm2) : inverse(row.inverse_diagonal) {
    if (norm2 > R(0) && inverse > R(0)) g = (R(1) - sqrt(row.compliance * inverse)) / norm2;
  }
};

template <class R, class Mem>
struct EliminateRows {
  using Indices = typename Model<R, Mem>::template Array<int>;
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Kokkos::View<int, Mem> halt;
  Indices tree_closed, dof_tree;

  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank, first = rows.first(w), count = rows.count(w);
    if (halt()) return;
    R* const p = impulses.p[impulses.parity()].data() + first;
    int k = 0;
    for (int r = 0, n; r < count; r += n) {
      n = rows.element_rows(first + r);
      if (k + n > rows.most_eliminated || !free_inside(&rows.row(first + r), n)) continue;
      for (int b = 0; b < n; ++b, ++k) eliminate(world, first, count, first + r + b, elimination_of(rows, w, k), p[r + b]);
    }
    world.single([&] { rows.eliminated(w) = k; });
    if (k == 0) return;
    world.each(count, [&](int r) {
      int const n = rows.element_rows(first + r);
      if (n == 0 || rows.row(first + r).eliminated) return;
      bool changed = false;
      for (int b = 0; b < n; ++b) changed = refresh(rows.row(first + r + b)) || changed;
      if (changed) couple(rows, &rows.row(first + r), n, rows.row(first + r).first_entry - couplings_of(n));
    });
  }

 private:
  KOKKOS_INLINE_FUNCTION bool closed(RowSegment const& s) const { return s.count > 0 && tree_closed(dof_tree(s.dof0)) != 0; }
  KOKKOS_INLINE_FUNCTION bool free_inside(Row<R> const* row, int n) const {
    bool free = true;
    for (int b = 0; b < n; ++b)
      free = free && RowBounds<R>{row[b].lower, row[b].upper, row[b].friction_of}.is_free() && row[b].segment[1].count == 0 &&
             closed(row[b].segment[0]);
    return free;
  }
  /// Where the entries of a row on the tree of dof0 begin, null: it has none.
  KOKKOS_INLINE_FUNCTION R* entries_on(Row<R> const& row, int dof0) const {
    R* y = rows.Y.data() + row.first_entry;
    for (int s = 0; s < 2; ++s) {
      if (row.segment[s].count > 0 && row.segment[s].dof0 == dof0) return y;
      y += row.segment[s].count;
    }
    return nullptr;
  }
  template <class World>
  KOKKOS_INLINE_FUNCTION void eliminate(World const& world, int first, int count, int at, R* coupling, R& impulse) const {
    Row<R>& row = rows.row(at);
    R const* const y = rows.Y.data() + row.first_entry;
    int const n = row.segment[0].count, dof0 = row.segment[0].dof0;
    R const norm2 = world.template sum<R>(n, [&](int i) { return y[i] * y[i]; });
    // Its size before the others were taken out: what is left of a row that follows from them is rounding.
    R const before = row.inverse_diagonal, s = norm2 + row.compliance, least = R(16) * Kokkos::Experimental::epsilon_v<R>;
    bool const dead = before == R(0) || !(s * before > least);
    world.sync();
    world.single([&] {
      row.eliminated = true;
      row.inverse_diagonal = dead ? R(0) : R(1) / s;
      impulse = R(0);
    });
    world.sync();
    Elimination<R> const e(row, norm2);
    world.each(count, [&](int q) {
      Row<R>& other = rows.row(first + q);
      R* const z = other.eliminated || dead ? nullptr : entries_on(other, dof0);
      R d(0);
      for (int i = 0; i < n && z; ++i) d = fma(z[i], y[i], d);
      coupling[q] = d;
      if (d == R(0)) return;
      other.bias = fma(-d * e.inverse, row.bias, other.bias);
      for (int i = 0; i < n; ++i) z[i] = fma(-e.g * d, y[i], z[i]);
    });
    world.sync();
  }
  /// The diagonal of a row that may have changed; what cannot move any more has no impulse.
  KOKKOS_INLINE_FUNCTION bool refresh(Row<R>& row) const {
    if (row.inverse_diagonal == R(0) || !(closed(row.segment[0]) || closed(row.segment[1]))) return false;
    R const* const y = rows.Y.data() + row.first_entry;
    R norm2(0);
    for (int i = 0, n = row.segment[0].count + row.segment[1].count; i < n; ++i) norm2 = fma(y[i], y[i], norm2);
    R const s = norm2 + row.compliance;
    if (s * row.inverse_diagonal > R(16) * Kokkos::Experimental::epsilon_v<R>) {
      row.inverse_diagonal = R(1) / s;
      return true;
    }
    row.inverse_diagonal = R(0);
    row.friction_of = -1;
    row.mu = R(-1);
    row.lower = row.upper = R(0);
    return true;
  }
};

template <class R, class Mem>
struct RestoreRows {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  View<R**> all_z;
  Kokkos::View<int, Mem> halt;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank, first = rows.first(w), count = rows.count(w);
    if (halt()) return;
    R* const p = impulses.p[impulses.parity()].data() + first;
    R* const z = all_z.data() + std::int64_t(w) * rows.nv;
    for (int k = rows.eliminated(w) - 1, r = count - 1; k >= 0; --r) {
      Row<R> const& row = rows.row(first + r);
      if (!row.eliminated) continue;
      R const* const coupling = elimination_of(rows, w, k);
      R const* const y = rows.Y.data() + row.first_entry;
      R* const own = z + row.segment[0].dof0;
      int const n = row.segment[0].count;
      R const sum = coupled(world, coupling, p, count, rows.islands.keys.data() + first);
      R const norm2 = world.template sum<R>(n, [&](int i) { return y[i] * y[i]; });
      R const yz = world.template sum<R>(n, [&](int i) { return y[i] * own[i]; });
      Elimination<R> const e(row, norm2);
      R const back = fma(e.g, yz, row.bias * e.inverse);
      world.sync();
      world.each(n, [&](int i) { own[i] = fma(-back, y[i], own[i]); });
      world.single([&] { p[r] = -(row.bias + sum) * e.inverse; });
      world.sync();
      --k;
    }
  }

 private:
  /// coupling . p. Threads that share a sum take its items by their places, so where rows of other trees may be missing, as they sleep or
  /// are far away, the rows that are coupled are listed first.
  template <class World>
  KOKKOS_INLINE_FUNCTION R coupled(World const& world, R const* coupling, R const* p, int count, int* list) const {
    if (rows.islands.ntree <= 1) return world.template sum<R>(count, [&](int q) { return coupling[q] * p[q]; });
    auto const has = [&](int q) { return int(coupling[q] != R(0)); };
    world.template scan<int>(count, has, [&](int q, int at) {
      if (has(q)) list[at] = q;
    });
    int const own = world.template sum<int>(count, has);
    world.sync();
    return world.template sum<R>(own, [&](int i) { return coupling[list[i]] * p[list[i]]; });
  }
};

}  // namespace gsp::detail
