#pragma once
#include <gsp/constraint/impulses.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/solver/detail/leap.hpp>
#include <gsp/solver/detail/pgs_options.hpp>
#include <gsp/solver/detail/row_vectors.hpp>
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
  bool lockstep = false;  // worlds that can have been solved in lockstep

  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank;
    if (progress.halt()) {
      if (w == 0) world.single([&] { ++progress.skipped(); });
      return;
    }
    if (w == 0) world.single([&] { impulses.solved() = 1; });
    int const first = rows.first(w), count = rows.count(w);
    if (lockstep && goes_in_lockstep(rows, w)) return;
    R* const z = solution.z.data() + std::int64_t(w) * rows.nv;
    R* const p = impulses.p[impulses.parity()].data() + first;
    sum_rows(world, rows, first, count, z, p);
    R const tolerance = R(options.tolerance) * rows.rate_scale(w);
    int sweep = 0;
    bool leaping = true;
    R before_leap = Kokkos::Experimental::infinity_v<R>;
    for (bool again = count > 0; again; ++sweep) {
      R change(0);
      if (leaps_after(sweep)) keep(world, w, first, count, z, p);
      for (int kind = 0; kind < 2; ++kind)  // elements of one row first: the order of the lockstep (pgs_lockstep.hpp)
        for (int r = 0, n; r < count; r += n) {
          Row<R> const* const row = &rows.row(first + r);
          n = rows.element_rows(first + r);
          if ((n > 1) != kind || row->eliminated) continue;
          if (n == 1)
            change = max(change, sweep_element<1>(world, row, 1, z, p + r));
          else if (n == 3 && row->same_segments)
            change = max(change, sweep_element<3>(world, row, 3, z, p + r));
          else
            change = max(change, sweep_element<N>(world, row, n, z, p + r));
        }
      again = sweep + 1 < options.iterations && (options.tolerance == 0 || sweep + 1 < options.least || change > tolerance);
      if (again && leaps_after(sweep)) {
        leaping = leaping && leap_helped(change, before_leap);
        before_leap = change;
        if (leaping) leap(world, w, first, count, z, p);
      }
    }
    R worst(0);
    for (int r = 0; options.residual && r < count; r += rows.element_rows(first + r)) {
      if (rows.row(first + r).eliminated) continue;
      ElementLaw<R, N> law;
      R rate[N], now[N];
      take<N>(world, &rows.row(first + r), rows.element_rows(first + r), z, p + r, law, rate, now);
      worst = max(worst, element_residual<N>(law, 0, rate, now));
    }
    world.single([&] {
      solution.iterations(w) = sweep;
      solution.residual(w) = options.residual ? worst : Kokkos::Experimental::quiet_NaN_v<R>;
    });
  }

 private:
  /// Impulses and z before a sweep that a leap follows on.
  template <class World>
  KOKKOS_INLINE_FUNCTION void keep(World const& world, int w, int first, int count, R const* z, R const* p) const {
    world.each(rows.nv, [&](int i) { solution.z_before(w, i) = z[i]; });
    world.each(count, [&](int r) { impulses.before(first + r) = p[r]; });
    world.sync();
  }
  /// Leaves p and z where the energy is least (leap.hpp).
  template <class World>
  KOKKOS_INLINE_FUNCTION void leap(World const& world, int w, int first, int count, R* z, R* p) const {
    LeapSums<R> s;
    auto const dz = [&](int i) { return z[i] - solution.z_before(w, i); };
    auto const d = [&](int r) { return p[r] - impulses.before(first + r); };
    for (R LeapSums<R>::*part : {&LeapSums<R>::pp, &LeapSums<R>::pd, &LeapSums<R>::dd, &LeapSums<R>::bp, &LeapSums<R>::bd})
      s.*part = world.template sum<R>(rows.nv, [&](int i) {
        LeapSums<R> own{};
        own.add_dof(z[i], dz(i));
        return own.*part;
      }) + world.template sum<R>(count, [&](int r) {
        LeapSums<R> own{};
        own.add_row(p[r], d(r), rows.row(first + r).compliance, rows.row(first + r).bias);
        return own.*part;
      });
    Leap<R> const to = best_leap<R>(s);
    world.sync();  // all have read p and z
    world.each(count, [&](int r) { p[r] += to.growth * p[r] + to.sweeps * d(r); });
    sum_rows(world, rows, first, count, z, p);
  }
  /// One pass over an element; the largest change of a rate. M = 1 or 3: so many rows, which have the same segments; M = N: any.
  template <int M, class World>
  KOKKOS_INLINE_FUNCTION R sweep_element(World const& world, Row<R> const* row, int n, R* z, R* p) const {
    ElementLaw<R, M> law;
    R rate[M], now[M], d[M];
    take<M>(world, row, n, z, p, law, rate, now);
    R const* const couplings = rows.Y.data() + row->first_entry - (M < N ? M * (M - 1) / 2 : n * (n - 1) / 2);
    auto const coupling = [&](int b, int a) { return M < N || b < n ? couplings[b * (b - 1) / 2 + a] : R(0); };
    project_element<M>(law, 0, coupling, R(options.relaxation), rate, now, d);
    world.sync();  // all have read p and z
    R change(0);
    bool any = false;
    unrolled<M>([&](auto b) {
      if (d[b] == R(0)) return;
      any = true;
      change = max(change, abs(d[b]) / law.inverse_diagonal[b]);  // d is 0 where this is
      world.single([&] { p[b] = now[b]; });
    });
    if (!any) return change;
    if constexpr (M < N) {  // z += sum Y^T d at once
      R const* y[M];
      unrolled<M>([&](auto b) { y[b] = rows.Y.data() + row[b].first_entry; });
      for (int s = 0; s < 2 && row->segment[s].count > 0; ++s) {
        auto const& segment = row->segment[s];
        int const* const list = list_of(rows, segment);
        R* const part = z + segment.dof0;
        world.each(segment.count, [&](int i) {
          R& to = part[list ? list[i] : i];
          R x = to;
          unrolled<M>([&](auto b) { x = fma(y[b][i], d[b], x); });
          to = x;
        });
        unrolled<M>([&](auto b) { y[b] += segment.count; });
      }
      world.sync();
    } else {
      for (int b = 0; b < n; ++b) {
        push_row(world, rows, row[b], z, d[b]);
        world.sync();  // before the next row of the element adds to z
      }
    }
    return change;
  }
  /// Laws of an element, its impulses, and the rates w = Y z + C p + b of its rows.
  template <int M, class World>
  KOKKOS_INLINE_FUNCTION void take(World const& world, Row<R> const* row, int n, R const* z, R const* p, ElementLaw<R, M>& law,
                                   R (&rate)[M], R (&now)[M]) const {
    unrolled<M>([&](auto b) {
      if (M < N || b < n) {
        set_law(law, b, row[b]);
        now[b] = p[b];
        rate[b] = fma(row[b].compliance, now[b], row[b].bias) + dot_row(world, rows, row[b], z);
      } else {
        clear_law(law, b);
        now[b] = rate[b] = R(0);
      }
    });
  }
};

}  // namespace gsp::detail
