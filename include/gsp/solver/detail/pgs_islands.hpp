#pragma once
#include <gsp/constraint/impulses.hpp>
#include <gsp/parallel/detail/thread_room.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/solver/detail/list_islands.hpp>
#include <gsp/solver/detail/pgs_delassus.hpp>
#include <gsp/solver/detail/pgs_grouped.hpp>
#include <gsp/solver/detail/take_element.hpp>

/// Projected Gauss-Seidel over large islands: on a host a thread each, over rows in groups of dofs (pgs_grouped.hpp); on a GPU a warp for
/// what no shared memory holds (pgs_sparse_cuda.hpp), whose threads share the entries of sparse rows. Threads or warps share the islands of
/// a world where there are enough.
namespace gsp::detail {

template <class R, class Mem>
struct PgsIslands {
  static constexpr int N = most_element_rows;
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Solution<R, Mem> solution;
  Progress<Mem> progress;
  PgsOptions options;
  int parts = 1;    // threads or warps that share a world's islands
  bool any = true;  // whether there are large ones; hosts know

  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank / parts, part = world.rank % parts;
    if (progress.halt()) {
      if (world.rank == 0) world.single([&] { ++progress.skipped(); });
      return;
    }
    if (world.rank == 0) world.single([&] { impulses.solved() = 1; });
    if (part == 0) world.single([&] { solution.residual(w) = Kokkos::Experimental::quiet_NaN_v<R>; });  // PgsResidual finds it
    R* const z = solution.z.data() + std::int64_t(w) * rows.nv;
    R* const p = impulses.p[impulses.parity()].data() + rows.first(w);
    for (int i = part; any && is_island(rows, w, i); i += parts) {
      if (!takes(w, i)) continue;
      int const sweeps = solve(world, detail::island_of(rows, w, i), z, p);
      world.single([&] { tell_sweeps(rows, solution, w, sweeps); });
    }
  }
  KOKKOS_INLINE_FUNCTION bool takes(int w, int i) const {
    Island const island = detail::island_of(rows, w, i);
#ifdef __CUDA_ARCH__
    return !delassus_takes(rows, island) && solution.left(w * islands_of_world(rows) + i) != 0;
#else
    return !is_small(island.rows, island.dofs);
#endif
  }
  /// Whether any island of a world is left to this kernel.
  KOKKOS_INLINE_FUNCTION bool takes_any(int w) const {
    for (int i = 0; is_island(rows, w, i); ++i)
      if (takes(w, i)) return true;
    return false;
  }

  [[gnu::noinline]] void on_host(RoomyWorld const& world) const { (*this)(world); }  // one copy of the code for all host backends

 private:
  /// f(r) for the rows of an island, shared by the world's threads.
  template <class World, class F>
  KOKKOS_INLINE_FUNCTION void each_row(World const& world, Island const& e, F const& f) const {
    world.each(e.elements, [&](int k) {
      for (int r = e.begin(k), end = e.end(rows, k); r < end; ++r) f(r);
    });
  }
  /// Where a sweep is in an island's list: elements of one row and of more take turns, each kind in its order.
  struct Turn {
    int single, several;  // the next place where one of a kind may be
    int singles_end;
    bool of_several = false;  // whose turn it is
  };
  /// A list of elements has those of one row first; in a list of rows both kinds are looked for from its first to its last.
  KOKKOS_INLINE_FUNCTION Turn first_turn(Island const& e) const {
    if (!e.element) return {0, 0, e.elements};
    int low = 0, high = e.elements;
    while (low < high) {
      int const middle = (low + high) / 2;
      bool const several = rows.element_rows(e.first_row + e.element[middle]) > 1;
      (several ? high : low) = several ? middle : middle + 1;
    }
    return {0, low, low};
  }
  /// Goes to the next element of a sweep, of n rows from r on. False after the last.
  KOKKOS_INLINE_FUNCTION bool next_element(Island const& e, Turn& turn, int& r, int& n) const {
    for (int kinds = 0; kinds < 2; ++kinds) {
      bool const several = turn.of_several;
      turn.of_several = !several;
      int const end = several ? e.elements : turn.singles_end;
      for (int& place = several ? turn.several : turn.single; place < end;) {
        r = e.begin(place);
        n = rows.element_rows(e.first_row + r);
        place += e.element ? 1 : n;
        if ((n > 1) == several && (e.element || !rows.row(e.first_row + r).eliminated)) return true;
      }
    }
    return false;
  }
  /// f(r, n) for the elements of a sweep, n rows from r on.
  template <class F>
  KOKKOS_INLINE_FUNCTION void each_element(Island const& e, F const& f) const {
    int r, n;
    for (Turn turn = first_turn(e); next_element(e, turn, r, n);) f(r, n);
  }
  /// Sweeps until it rests; their number.
  template <class World>
  KOKKOS_INLINE_FUNCTION int solve(World const& world, Island const& e, R* z, R* p) const {
    R const tolerance = R(options.tolerance) * rows.rate_scale(e.world);
    if constexpr (std::is_same_v<World, RoomyWorld>) {
      auto const dof = [&](int k) { return e.dof(k); };
      int count = 0;
      each_element(e, [&](int, int n) { count += n; });
      GroupedIsland<R, Mem> island(rows, e.world, R(options.relaxation), world.room, p, count, e.dofs, dof,
                                   [&](auto const& f) { each_element(e, f); });
      int const sweeps = sweep_until_rest<R>(island, options, tolerance, e.elements > 0);
      island.store(e.dofs, dof, z, p);
      return sweeps;
    } else {
      sum_island(world, e, z, p);
      return sweep_until_rest<R>(SparseIsland<World>{*this, world, e, first_turn(e), z, p}, options, tolerance, e.elements > 0);
    }
  }
  /// An island on a GPU, in the pools, for sweep_until_rest. (Hosts copy it to a thread's own memory: GroupedIsland.)
  template <class World>
  struct SparseIsland {
    PgsIslands const& solver;
    World const& world;
    Island const& e;
    Turn const first;
    R *z, *p;
    KOKKOS_INLINE_FUNCTION SweepOutcome<R> sweep(bool) const { return solver.sweep(world, e, first, z, p); }
    KOKKOS_INLINE_FUNCTION void keep(bool leaps) const { solver.keep(world, e, z, p, leaps); }
    KOKKOS_INLINE_FUNCTION void sum() const { solver.sum_island(world, e, z, p); }
    KOKKOS_INLINE_FUNCTION LeapSums<R> leap_sums() const { return solver.leap_sums(world, e, z, p); }
    KOKKOS_INLINE_FUNCTION MixingSums<R> mixing_sums(bool both) const { return solver.mixing_sums(world, e, p, both); }
    KOKKOS_INLINE_FUNCTION void go_on(int side, Leap<R> const& leap, Mixing<R> const& mixing, bool both) const {
      solver.go_on(world, e, p, side, leap, mixing, both);
    }
    KOKKOS_INLINE_FUNCTION void take_back() const {
      solver.each_row(world, e, [&](int at) { p[at] = solver.impulses.mixing[0](e.first_row + at); });
      world.sync();
      sum();
    }
  };
  template <class World>
  KOKKOS_INLINE_FUNCTION SweepOutcome<R> sweep(World const& world, Island const& e, Turn turn, R* z, R* p) const {
    SweepOutcome<R> to;
    int r, n;
    while (next_element(e, turn, r, n)) {
      Row<R> const* const row = &rows.row(e.first_row + r);
      if (n == 1)
        to.change = max(to.change, sweep_element<1>(world, row, 1, z, p + r, to.misses, to.work));
      else if (n == 3 && row->same_segments)
        to.change = max(to.change, sweep_element<3>(world, row, 3, z, p + r, to.misses, to.work));
      else
        to.change = max(to.change, sweep_element<N>(world, row, n, z, p + r, to.misses, to.work));
    }
    return to;
  }
  /// Sum of f(r) over the rows of an island.
  template <class World, class F>
  KOKKOS_INLINE_FUNCTION R sum_of_rows(World const& world, Island const& e, F const& f) const {
    return world.template sum<R>(e.elements, [&](int k) {
      R own(0);
      for (int r = e.begin(k), end = e.end(rows, k); r < end; ++r) own += f(r);
      return own;
    });
  }
  template <class World>
  KOKKOS_INLINE_FUNCTION MixingSums<R> mixing_sums(World const& world, Island const& e, R const* p, bool both) const {
    auto const of_row = [&](int r) {
      int const at = e.first_row + r;
      R const inverse = rows.row(at).inverse_diagonal;
      MixingSums<R> own{};
      own.add_row(inverse > R(0) ? R(1) / inverse : R(0), p[r] - impulses.before(at), impulses.mixing[3](at), impulses.mixing[1](at), both);
      return own;
    };
    MixingSums<R> s{};
    for (auto const part : {&MixingSums<R>::dd11, &MixingSums<R>::dd12, &MixingSums<R>::dd22, &MixingSums<R>::df1, &MixingSums<R>::df2})
      s.*part = sum_of_rows(world, e, [&](int r) { return of_row(r).*part; });
    return s;
  }
  /// Keeps p and d of the last sweep; p goes on to where a leap or a mixture leads.
  template <class World>
  KOKKOS_INLINE_FUNCTION void go_on(World const& world, Island const& e, R* p, int side, Leap<R> const& leap, Mixing<R> const& mixing,
                                    bool both) const {
    world.sync();  // all have read p and z
    each_row(world, e, [&](int r) {
      int const at = e.first_row + r;
      R const now = p[r], d = now - impulses.before(at);
      if (leap.goes()) p[r] = leap.of(now, d);
      if (mixing.helps()) p[r] = mixing.of(now, impulses.mixing[2](at), impulses.mixing[0](at), both);
      impulses.mixing[2 * side](at) = now;
      impulses.mixing[2 * side + 1](at) = d;
    });
    world.sync();
  }
  /// z = Y^T p of an island.
  template <class World>
  KOKKOS_INLINE_FUNCTION void sum_island(World const& world, Island const& e, R* z, R const* p) const {
    world.each(e.dofs, [&](int k) { z[e.dof(k)] = R(0); });
    if (!e.element) return push_rows(world, rows, e.first_row, e.elements, z, p);
    for (int k = 0; k < e.elements; ++k) push_rows(world, rows, e.first_row + e.begin(k), e.end(rows, k) - e.begin(k), z, p + e.begin(k));
  }
  /// Impulses before a sweep, and z where a leap follows on it.
  template <class World>
  KOKKOS_INLINE_FUNCTION void keep(World const& world, Island const& e, R const* z, R const* p, bool leaps) const {
    if (leaps) world.each(e.dofs, [&](int k) { solution.z_before(e.world, e.dof(k)) = z[e.dof(k)]; });
    each_row(world, e, [&](int r) { impulses.before(e.first_row + r) = p[r]; });
    world.sync();
  }
  template <class World>
  KOKKOS_INLINE_FUNCTION LeapSums<R> leap_sums(World const& world, Island const& e, R const* z, R const* p) const {
    LeapSums<R> s;
    for (auto const part : {&LeapSums<R>::pp, &LeapSums<R>::pd, &LeapSums<R>::dd, &LeapSums<R>::bp, &LeapSums<R>::yy})
      s.*part = world.template sum<R>(e.dofs, [&](int k) {
        LeapSums<R> own{};
        own.add_dof(z[e.dof(k)], z[e.dof(k)] - solution.z_before(e.world, e.dof(k)));
        return own.*part;
      }) + world.template sum<R>(e.elements, [&](int k) {
        LeapSums<R> own{};
        for (int r = e.begin(k), end = e.end(rows, k); r < end; ++r) {
          auto const& row = rows.row(e.first_row + r);
          own.add_row(p[r], p[r] - impulses.before(e.first_row + r), row.compliance, row.bias, row.inverse_diagonal);
        }
        return own.*part;
      });
    return s;
  }
  /// One pass over an element; the largest change of a rate. M = 1 or 3: so many rows, which have the same segments; M = N: any.
  /// @param misses  grows by sum d^2 (|Y|^2 + C);   @param work  by what the pass does (leap.hpp)
  template <int M, class World>
  KOKKOS_INLINE_FUNCTION R sweep_element(World const& world, Row<R> const* row, int n, R* z, R* p, R& misses, SweepWork<R>& work) const {
    ElementLaw<R, M> law;
    R rate[M], before[M], now[M], d[M];
    take_element<M>(world, rows, row, n, z, p, law, rate, now);
    R const* const couplings = rows.Y.data() + row->first_entry - (M < N ? M * (M - 1) / 2 : n * (n - 1) / 2);
    auto const coupling = [&](int b, int a) { return M < N || b < n ? couplings[b * (b - 1) / 2 + a] : R(0); };
    unrolled<M>([&](auto b) { before[b] = rate[b]; });
    project_element<M>(law, 0, coupling, R(options.relaxation), rate, now, d);
    world.sync();  // all have read p and z
    R change(0);
    bool any = false;
    unrolled<M>([&](auto b) {
      if (!(M < N || b < n)) return;  // places without a row may hold NaN
      bool const moves = d[b] != R(0);
      R const of_row = moves ? d[b] / law.inverse_diagonal[b] : R(0);  // d is 0 where this is
      for (int a = 0; a < b; ++a) before[b] = fma(coupling(b, a), d[a], before[b]);
      int const last = b > 0 ? b - 1 : 0;
      bool const with_last = b > 0 && law.with_next[last] > R(0);
      work.template add_row<R>(now[b], d[b], before[b], of_row, law.inverse_diagonal[b], with_last ? coupling(b, last) * d[last] : R(0));
      if (!moves) return;
      any = true;
      change = max(change, abs(of_row));
      misses = fma(d[b], of_row, misses);
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
};

/// Hosts: a thread's own room for each that needs it.
template <class Exec, class R, class Mem>
struct RoomyLoop {
  PgsIslands<R, Mem> solver;
  ThreadRoom<Exec> room;
  void operator()(int rank) const {
    if (solver.progress.halt() || !solver.any || !solver.takes_any(rank / solver.parts)) return solver.on_host({{rank}, nullptr});
    room([&](int thread) {
      solver.on_host({{rank}, reinterpret_cast<char*>(solver.solution.island_items.data() + thread * solver.solution.island_stride)});
    });
  }
};
/// Enlarges the threads' room where an island may need more: for a world's share of the pools of rows, so that it grows as they do, or by
/// half where a world has more than its share. On a host the kernels that have written `rows` have ended.
template <class R, class Mem>
void grow_island_room(PgsIslands<R, Mem> const& solver, Solution<R, Mem>& solution) {
  if (solver.progress.halt() || !solver.any) return;
  auto const& rows = solver.rows;
  int most_tree_dofs = 0, largest_element = 0;
  for (int t = 0; t < rows.islands.ntree; ++t) most_tree_dofs = std::max(most_tree_dofs, rows.islands.tree_dofnum(t));
  for (int w = 0; w < rows.worlds; ++w) largest_element = std::max(largest_element, rows.largest_element(w));
  auto const reals_of = [&](std::int64_t row_count, std::int64_t entries) {
    return grouped_bytes(rows, row_count, entries, largest_element, most_tree_dofs) / std::int64_t(sizeof(R));
  };
  std::int64_t least = 0, share = 0;
  for (int w = 0; w < rows.worlds; ++w)
    if (solver.takes_any(w)) least = std::max(least, reals_of(rows.count(w), rows.entries(w)));
  if (int const rows_each = rows.capacity() / rows.worlds; rows.nv > lockstep_most_dofs || rows_each > lockstep_most_rows)
    share = reals_of(rows_each, std::int64_t(rows.Y.extent(0)) / rows.worlds);
  std::int64_t const threads = solution.thread_rooms;
  std::int64_t stride = solution.island_stride;
  if (std::max(least, share) > stride) stride = ((least > share ? least + least / 2 : share) + 63) / 64 * 64;
  if (std::int64_t(solution.island_items.extent(0)) < stride * threads) {
    solution.island_items = {};
    solution.island_items = allocate<decltype(solution.island_items)>("gsp::Solution::island_items", stride * threads);
  }
  solution.island_stride = stride;  // now that there is room: allocating may throw
}

/// solution.residual: the largest violation in each world.
template <class R, class Mem>
struct PgsResidual {
  PgsIslands<R, Mem> solver;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    constexpr int N = PgsIslands<R, Mem>::N;
    auto const& rows = solver.rows;
    int const w = world.rank, first = rows.first(w), count = rows.count(w);
    if (solver.progress.halt()) return;
    R const* const z = solver.solution.z.data() + std::int64_t(w) * rows.nv;
    R const* const p = solver.impulses.p[solver.impulses.parity()].data() + first;
    R worst(0);
    for (int r = 0; r < count; r += rows.element_rows(first + r)) {
      if (rows.row(first + r).eliminated) continue;
      ElementLaw<R, N> law;
      R rate[N], now[N];
      take_element<N>(world, rows, &rows.row(first + r), rows.element_rows(first + r), z, p + r, law, rate, now);
      worst = max_or_nan(worst, element_residual<N>(law, 0, rate, now));
    }
    world.single([&] { solver.solution.residual(w) = worst; });
  }
};

}  // namespace gsp::detail
