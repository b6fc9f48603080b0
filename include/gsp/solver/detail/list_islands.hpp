#pragma once
#include <gsp/constraint/islands.hpp>
#include <gsp/solver/solution.hpp>

/// Islands are what `pgs` solves: each by itself, on a path that its own rows and dofs choose, for as long as it needs. Here they are
/// found, and the small ones listed by their size, so that those that share a pack or a launch are alike. Nothing that is computed hangs on
/// the order of a list.
namespace gsp::detail {

inline constexpr int long_solve = 33;  // sweeps: about the mean of humanoids that lie

/// Worlds of several trees: their islands, and what `solution` says where nothing is solved.
template <class R, class Mem>
struct FindIslands {
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
      if (device) solution.goes_on(w) = solution.iterations(w) >= long_solve;
      solution.iterations(w) = 0;
    });
  }
};
/// What an island has taken: of worlds with several the most.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION void tell_sweeps(Rows<R, Mem> const& rows, Solution<R, Mem> const& solution, int w, int sweeps) {
  if (rows.islands.ntree > 1)
    Kokkos::atomic_max(&solution.iterations(w), sweeps);
  else
    solution.iterations(w) = sweeps;
}

/// The list that an island belongs to; -1: there is none of that number, or it is not small.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION int list_of_island(Rows<R, Mem> const& rows, int number) {
  int const w = number / islands_of_world(rows), i = number % islands_of_world(rows);
  if (!is_island(rows, w, i)) return -1;
  Island const island = island_of(rows, w, i);
  return is_small(island.rows, island.dofs) ? list_of_rows(island.rows) : -1;
}

/// Hosts: how many islands are in each list, to Solution::list_counts(list, 0); then where they stand, list by list.
struct ListSizes {
  int of[island_lists] = {};
  KOKKOS_INLINE_FUNCTION ListSizes& operator+=(ListSizes const& other) {
    for (int k = 0; k < island_lists; ++k) of[k] += other.of[k];
    return *this;
  }
};
template <class R, class Mem>
struct ListSmallIslands {
  using value_type = ListSizes;
  Rows<R, Mem> rows;
  Solution<R, Mem> solution;
  ListSizes begin;
  bool place;
  int count;  // of all numbers
  void operator()(int number, ListSizes& sum, bool last) const {
    int list = list_of_island(rows, number);
    // Worlds of one tree are alike as they are, and neighbours lie side by side in memory.
    if (list >= 0 && rows.islands.ntree <= 1) list = 0;
    if (list >= 0) {
      if (last && place) solution.listed(0, begin.of[list] + sum.of[list]) = number;
      ++sum.of[list];
    }
    for (int k = 0; last && !place && number + 1 == count && k < island_lists; ++k) solution.list_counts(k, 0) = sum.of[k];
  }
};
/// Those of many rows first. Their number.
template <class Exec, class R, class Mem>
int list_small_islands(Exec const& exec, Rows<R, Mem> const& rows, Solution<R, Mem> const& solution) {
  int const numbers = rows.worlds * islands_of_world(rows);
  Kokkos::RangePolicy<Exec> const all(exec, 0, numbers);
  Kokkos::parallel_scan("gsp::solver::count_islands", all, ListSmallIslands<R, Mem>{rows, solution, {}, false, numbers});
  ListSizes begin;
  int count = 0;
  for (int list = island_lists; list-- > 0; count += solution.list_counts(list, 0)) begin.of[list] = count;
  Kokkos::parallel_scan("gsp::solver::list_islands", all, ListSmallIslands<R, Mem>{rows, solution, begin, true, numbers});
  return count;
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
  Kokkos::parallel_scan("gsp::solver::list_going", Kokkos::RangePolicy<Exec>(exec, 0, count), ListGoing<R, Mem>{solution, side, count});
  return solution.list_counts(0, 0);
}

}  // namespace gsp::detail
