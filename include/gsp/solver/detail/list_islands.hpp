#pragma once
#include <gsp/constraint/islands.hpp>
#include <gsp/constraint/progress.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/parallel/scan.hpp>
#include <gsp/solver/solution.hpp>

/// Islands are what `pgs` solves: each by itself, on a path that its own rows and dofs choose, for as long as it needs. Here they are
/// found, and the small ones listed by their size, so that those that share a pack or a launch are alike. Nothing that is computed hangs on
/// the order of a list.
namespace gsp::detail {

inline constexpr int long_solve = 33;  // sweeps: about the mean of humanoids that lie

/// Worlds of several trees: their islands, and what `solution` says where nothing is solved.
template <class R, class Mem>
struct FindIslands {
  static constexpr bool wide = true;  // for_worlds: sums are of whole numbers
  Rows<R, Mem> rows;
  Solution<R, Mem> solution;
  Kokkos::View<int const, Mem> halt;
  bool device;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    if (halt()) return;
    int const w = world.rank;
    auto const& s = rows.islands;
    find_islands(world, rows, s, w);
    int const still = s.first_dof(w, s.count(w));
    world.each(rows.nv - still, [&](int k) { solution.z(w, s.dofs(w, still + k)) = R(0); });
    world.single([&] {
      if (device) solution.was_long(w) = solution.iterations(w) >= long_solve;
      solution.iterations(w) = 0;
    });
  }
};
/// Of all worlds.
template <class Exec, class R, class Mem>
void launch_find_islands(Exec const& exec, Rows<R, Mem> const& rows, Solution<R, Mem> const& solution, Progress<Mem> const& progress) {
  for_worlds("gsp::solver::find_islands", exec, rows.worlds, FindIslands<R, Mem>{rows, solution, progress.halt, is_device<Exec>});
}
/// What an island has taken: of worlds with several the most.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION void tell_sweeps(Rows<R, Mem> const& rows, Solution<R, Mem> const& solution, int w, int sweeps) {
  if (rows.islands.ntree > 1)
    Kokkos::atomic_max(&solution.iterations(w), sweeps);
  else
    solution.iterations(w) = sweeps;
}

inline constexpr int no_island = -1, large_island = island_lists;
/// The list that island `number` belongs to, or large_island, or no_island: there is none of that number.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION int list_of_island(Rows<R, Mem> const& rows, int number) {
  int const w = number / islands_of_world(rows), i = number % islands_of_world(rows);
  if (!is_island(rows, w, i)) return no_island;
  Island const island = island_of(rows, w, i);
  return is_small(island.rows, island.dofs) ? list_of_rows(island.rows) : large_island;
}

/// Hosts: how many islands are in each list, and how many are large.
struct ListSizes {
  int of[island_lists + 1] = {};
  KOKKOS_INLINE_FUNCTION ListSizes& operator+=(ListSizes const& other) {
    for (int k = 0; k <= island_lists; ++k) of[k] += other.of[k];
    return *this;
  }
};
/// Their numbers, to Solution::list_counts(list, 0) and of large ones to list_counts(0, 1).
template <class R, class Mem>
struct CountIslands {
  using value_type = ListSizes;
  Rows<R, Mem> rows;
  Solution<R, Mem> solution;
  int numbers;
  void operator()(int number, ListSizes& sum, bool last) const {
    int list = list_of_island(rows, number);
    if (list != no_island) ++sum.of[list_on_host(rows, list)];
    if (!last || number + 1 < numbers) return;
    for (int k = 0; k < island_lists; ++k) solution.list_counts(k, 0) = sum.of[k];
    solution.list_counts(0, 1) = sum.of[large_island];
  }
  /// Worlds of one tree are alike as they are, and neighbours lie side by side in memory.
  static int list_on_host(Rows<R, Mem> const& rows, int list) { return rows.islands.ntree <= 1 && list != large_island ? 0 : list; }
};
/// Then where they stand, list by list.
template <class R, class Mem>
struct PlaceIslands {
  using value_type = ListSizes;
  Rows<R, Mem> rows;
  Solution<R, Mem> solution;
  ListSizes begin;
  void operator()(int number, ListSizes& sum, bool last) const {
    int list = list_of_island(rows, number);
    if (list == no_island || list == large_island) return;
    list = CountIslands<R, Mem>::list_on_host(rows, list);
    if (last) solution.listed(0, begin.of[list] + sum.of[list]) = number;
    ++sum.of[list];
  }
};
struct IslandCounts {
  int small, large;
};
/// Small ones of many rows first.
template <class Exec, class R, class Mem>
IslandCounts list_islands(Exec const& exec, Rows<R, Mem> const& rows, Solution<R, Mem> const& solution) {
  int const numbers = rows.worlds * islands_of_world(rows);
  if (!any_small(rows.islands.ntree, rows.nv)) return {0, numbers};
  scan_items("gsp::solver::count_islands", exec, numbers, CountIslands<R, Mem>{rows, solution, numbers});
  ListSizes begin;
  int small = 0;
  for (int list = island_lists; list-- > 0; small += solution.list_counts(list, 0)) begin.of[list] = small;
  if (small > 0) scan_items("gsp::solver::place_islands", exec, numbers, PlaceIslands<R, Mem>{rows, solution, begin});
  return {small, solution.list_counts(0, 1)};
}
/// Those of a list that go on, in its order, to the other list. Their number.
template <class R, class Mem>
struct ListGoing {
  using value_type = int;
  Solution<R, Mem> solution;
  int side, count;
  void operator()(int at, int& sum, bool last) const {
    int const number = solution.listed(side, at);
    if (solution.goes_on(number) != 0) {
      if (last) solution.listed(1 - side, sum) = number;
      ++sum;
    }
    if (last && at + 1 == count) solution.list_counts(0, 0) = sum;
  }
};
template <class Exec, class R, class Mem>
int list_going(Exec const& exec, Solution<R, Mem> const& solution, int side, int count) {
  scan_items("gsp::solver::list_going", exec, count, ListGoing<R, Mem>{solution, side, count});
  return solution.list_counts(0, 0);
}

}  // namespace gsp::detail
