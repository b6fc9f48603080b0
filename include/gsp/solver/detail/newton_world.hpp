#pragma once
#include <gsp/parallel/detail/thread_room.hpp>
#include <gsp/solver/detail/newton_island.hpp>
#include <gsp/solver/detail/newton_sparse.hpp>
#include <gsp/solver/detail/newton_until_rest.hpp>

/// The kernel of `newton` (solver/newton.hpp): a host's thread solves a world island by island, in near memory (newton_island.hpp) or where
/// that does not hold one (newton_sparse.hpp); a GPU's warp finds a world's islands and lists them.
namespace gsp::detail {

template <class R, class Mem>
struct NewtonWorld : NewtonProblem<R, Mem> {
  using Problem = NewtonProblem<R, Mem>;
  using Problem::rows, Problem::impulses, Problem::solution, Problem::progress, Problem::rate, Problem::near_bytes, Problem::iterations,
      Problem::tolerance, Problem::residual, Problem::ends_step, Problem::lists_of;
  using typename Problem::Lists;
  NewtonLists<Mem> lists{};  // GPUs

  /// On a GPU.
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    solve(world, nullptr);
  }
  /// Of one world.
  /// @param near  hosts: near memory, and after it what NewtonSparse works in
  template <class World>
  KOKKOS_FUNCTION void solve(World const& world, R* near) const {
    int const id = world.rank;
    if (progress.halt()) {
      if (id == 0 && ends_step) world.single([&] { ++progress.skipped(); });
      return;
    }
    if (id == 0) world.single([&] { impulses.solved() = 1; });
    R* const z = solution.z.data() + std::int64_t(id) * rows.nv;
    world.each(rows.nv, [&](int i) { z[i] = R(0); });
    world.single([&] {
      solution.iterations(id) = 0;
      solution.residual(id) = residual ? R(0) : Kokkos::Experimental::quiet_NaN_v<R>;
    });
    int number = id * islands_of_world(rows) - 1;
    each_island(world, rows, id, [&](IslandRows const& island) {
      ++number;
      constexpr bool one_thread = std::is_same_v<World, SerialWorld>;
      bool const cones = this->has_cones(world, lists_of(id, island));
      NewtonSizes<R, one_thread ? native_width<R> : 1> const size(island.count, island.dofs, cones);
      bool const is_near = size.fits(near_bytes);
      if constexpr (one_thread) {
        auto const finish = [&](auto own) {
          int const done = newton_until_rest<R>(own, iterations, tolerance);
          R const worst = own.write();
          solution.iterations(id) = Kokkos::max(solution.iterations(id), done);
          if (residual) solution.residual(id) = max_or_nan(solution.residual(id), worst);
        };
        if (is_near)
          finish(NewtonIsland<R, Mem, World>(*this, world, island, cones, near));
        else
          finish(NewtonSparse<R, Mem, World>(*this, world, island, near + newton_near_numbers, near, near_bytes / std::int64_t(sizeof(R))));
      } else {
        world.single([&] { lists.add(is_near ? newton_list_of(size.bytes()) : newton_sparse_list, number, cones); });
      }
    });
    auto const& islands = rows.islands;
    if (int const count = rows.count(id); islands.ntree > 1 && count > 0 && islands.first_element(id, islands.count(id)) < count)
      set_without_trees(world, lists_of(id, {nullptr, count, nullptr, rows.nv}));
  }

  /// Rows that touch no tree bear what they are asked for: no one solves for them.
  template <class World>
  KOKKOS_FUNCTION void set_without_trees(World const& world, Lists const& l) const {
    R *const w = rate.data() + l.first, *const p = impulses.p[impulses.parity()].data() + l.first;
    world.each(l.island.count, [&](int r) {
      int const n = l.element_rows[r];
      if (n == 0 || rows.islands.keys(l.first + r) >= 0) return;
      for (int b = r; b < r + n; ++b) {
        l.least[b] = R(least_compliance);
        w[b] = l.row[b].bias;
      }
      soft_impulses(soft_element(l.row + r, n, l.least + r), w + r, p + r);
    });
  }
};

/// On hosts the work belongs to a thread.
template <class Exec, class R, class Mem>
struct NewtonThread {
  NewtonWorld<R, Mem> solver;
  ThreadRoom<Exec> room;
  void operator()(int w) const {
    room([&](int thread) { solver.solve(SerialWorld{w}, solver.work.data() + thread * solver.stride); });
  }
};

/// GPUs: all islands.
/// @param rooms  blocks that there is room for, of islands that no near memory holds
template <class Exec, class R, class Mem>
void launch_newton(Exec const& exec, NewtonWorld<R, Mem> solver, int rooms);
/// And how many such blocks a GPU holds at a time.
template <class Exec>
int newton_sparse_blocks(Exec const& exec);

}  // namespace gsp::detail

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/solver/detail/newton_island_cuda.hpp>
#endif
