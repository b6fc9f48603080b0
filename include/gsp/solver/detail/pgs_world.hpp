#pragma once
#include <gsp/constraint/impulses.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/solver/detail/pgs_options.hpp>
#include <gsp/solver/project_element.hpp>
#include <gsp/solver/solution.hpp>

/// Projected Gauss-Seidel over sparse rows, one world after the other: a thread a world, or a warp whose threads share the entries of a
/// row.
namespace gsp::detail {

template <class R, class Mem>
struct PgsWorld {
  static constexpr int N = most_element_rows;
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Solution<R, Mem> solution;
  Progress<Mem> progress;
  PgsOptions options;
  int least_rows = 0;  // worlds with fewer go in lockstep

  /// One element as the solver sees it: its first row, how many, their laws.
  struct Element {
    Row<R> const* row;
    R const* coupling;
    int rows;
    ElementLaw<R, N> law;
  };

  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank;
    if (progress.halt()) {
      if (w == 0) world.once([&] { ++progress.skipped(); });
      return;
    }
    if (w == 0) world.once([&] { impulses.solved() = 1; });
    int const first = rows.first(w), count = rows.count(w);
    if (count < least_rows) return;
    R* const z = solution.z.data() + std::int64_t(w) * rows.nv;
    R* const p = impulses.p[impulses.parity()].data() + first;
    world.each(rows.nv, [&](int i) { z[i] = R(0); });
    for (int r = 0; r < count; ++r) {
      world.sync();
      if (p[r] != R(0)) push(world, rows.row(first + r), z, p[r]);
    }
    world.sync();
    int sweep = 0;
    for (R change = R(1); sweep < options.iterations && count > 0 && change > R(options.tolerance); ++sweep) {
      change = R(0);
      for (int r = 0; r < count; r += rows.row(first + r).element_rows) {
        Element e;
        R rate[N], now[N], d[N];
        take(world, rows.row(first + r), z, p + r, e, rate, now);
        auto const coupling = [&](int b, int a) { return e.coupling[b * (b - 1) / 2 + a]; };
        project_element(e.law, 0, e.rows, coupling, R(options.relaxation), rate, now, d);
        world.sync();  // all have read p and z
        for (int b = 0; b < e.rows; ++b) {
          if (d[b] == R(0)) continue;
          world.once([&] { p[r + b] = now[b]; });
          push(world, e.row[b], z, d[b]);
          change = max(change, abs(d[b]) / e.law.inverse_diagonal[b]);
          world.sync();  // before the next row of the element adds to z
        }
      }
      if (options.tolerance == 0) change = R(1);
    }
    R worst(0);
    for (int r = 0; options.residual && r < count; r += rows.row(first + r).element_rows) {
      Element e;
      R rate[N], now[N];
      take(world, rows.row(first + r), z, p + r, e, rate, now);
      worst = max(worst, element_residual(e.law, 0, e.rows, rate, now));
    }
    world.once([&] {
      solution.iterations(w) = sweep;
      solution.residual(w) = worst;
    });
  }

 private:
  KOKKOS_INLINE_FUNCTION int const* list_of(RowSegment const& s) const { return s.list < 0 ? nullptr : rows.dof_lists.data() + s.list; }

  /// Loads an element, its impulses, and the rates w = Y z + C p + b of its rows.
  template <class World>
  KOKKOS_INLINE_FUNCTION void take(World const& world, Row<R> const& row, R const* z, R const* p, Element& e, R* rate, R* now) const {
    e.row = &row;
    e.rows = row.element_rows;
    e.coupling = rows.Y.data() + row.Y + row.coupling;
    for (int b = 0; b < e.rows; ++b) {
      Row<R> const& mine = e.row[b];
      e.law.normals[b] = 0;
      set_law(e.law, b, mine, [](R& to, R value) { to = value; });
      now[b] = p[b];
      rate[b] = fma(mine.compliance, now[b], mine.bias);
      R const* y = rows.Y.data() + mine.Y;
      for (int s = 0; s < mine.segments; ++s) {
        auto const& segment = mine.segment[s];
        int const* const list = list_of(segment);
        R const* const part = z + segment.dof0;
        rate[b] += world.template sum<R>(segment.count, [&](int i) { return y[i] * part[list ? list[i] : i]; });
        y += segment.count;
      }
    }
  }
  /// z += Y^T d
  template <class World>
  KOKKOS_INLINE_FUNCTION void push(World const& world, Row<R> const& row, R* z, R d) const {
    R const* y = rows.Y.data() + row.Y;
    for (int s = 0; s < row.segments; ++s) {
      auto const& segment = row.segment[s];
      int const* const list = list_of(segment);
      R* const part = z + segment.dof0;
      world.each(segment.count, [&](int i) { part[list ? list[i] : i] = fma(y[i], d, part[list ? list[i] : i]); });
      y += segment.count;
    }
  }
};

}  // namespace gsp::detail
