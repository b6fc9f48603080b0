#pragma once
#include <gsp/constraint/eliminate.hpp>
#include <gsp/core/region.hpp>
#include <gsp/solver/detail/pgs_islands.hpp>
#include <gsp/solver/detail/pgs_lockstep.hpp>

namespace gsp {

namespace detail {
template <class R, class Mem>
void expects_solution(char const* where, Rows<R, Mem> const& rows, Solution<R, Mem> const& solution) {
  expects_as_many(where, "worlds", "make them for one model and the same {.worlds = n}", Count{"rows", rows.worlds},
                  Count{"solution", solution.worlds});
  expects_as_many(where, "degrees of freedom", "make them for one model and the same {.worlds = n}", Count{"rows", rows.nv},
                  Count{"solution", solution.nv});
}
/// @param islands_found  launch_find_islands has been called for these rows, and what it wrote is as it was
template <class Exec, class R, class Mem>
void pgs_in(Exec const& exec, Rows<R, Mem> const& rows, Impulses<R, Mem>& impulses, Solution<R, Mem>& solution, Progress<Mem>& progress,
            PgsOptions const& options, bool islands_found);
}  // namespace detail

/// Projected Gauss-Seidel over whitened rows (paper, eq. 6-8), element by element.
///   w = Y z + C p + b,   z = sum Y^T p,   lo <= p <= hi,   w complementary to the bounds
///   b = J v^ - zeta, so that Y z + b + C p = J v+ + C p - zeta vanishes where p is inside of its bounds.
/// Two rows of friction together (RowBounds::with_next) lie in an ellipse instead, and slide against the slip.
/// Slow sweeps leap: docs/solver/pgs.md.
/// An element: its rows' rates w from z, project_element (solver/project_element.hpp), z <- z + sum Y^T dp.
/// @param rows       what `assemble` wrote
/// @param impulses   in: start (warm: those of the last step); out: the solution [N s, N m s]
/// @param solution   z (world, nv), residual, iterations (world): out
/// @param progress   nothing happens while progress.halt is set
/// @param options    an island stops by itself: at a share of what gravity does in a step, after so many sweeps at least and at most
/// Errors: std::invalid_argument for sizes of different models or worlds, for iterations < 1, a tolerance below 0 or NaN, a relaxation
/// outside of 0 to 2, for rows that nobody has assembled, and for rows with room for a restitution without a call of impacts. Each island
/// (constraint/islands.hpp) is solved by itself, for as long as it needs, to the same bits whatever else is in its batch, or in its world
/// of several trees. On a CPU, islands of at most 128 rows and 128 dofs go in lockstep, a pack at a time, and larger ones in their thread's
/// own memory. On a GPU these small islands (in double of up to 96 rows) stay in shared memory, a warp each, over their Delassus matrix;
/// larger ones over their rows there, a block each; what no block has room for is swept in the pools, by a warp each. Cost 4
/// entries iterations flop an island, of small ones on a GPU 2 rows^2 iterations. Does not fence. Allocates on a CPU alone, room of a
/// thread for large islands (solution.island_items): at its first call for a world's share of the pools, again when these grow or a world
/// has more.
template <ExecutionSpace Exec, class R, class Mem>
void pgs(Exec const& exec, Rows<R, Mem> const& rows, Impulses<R, Mem>& impulses, Solution<R, Mem>& solution, Progress<Mem>& progress,
         PgsOptions options = {}) {
  detail::pgs_in(exec, rows, impulses, solution, progress, options, false);
}

namespace detail {
template <class Exec, class R, class Mem>
void pgs_in(Exec const& exec, Rows<R, Mem> const& rows, Impulses<R, Mem>& impulses, Solution<R, Mem>& solution, Progress<Mem>& progress,
            PgsOptions const& options, bool islands_found) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::pgs: the rows are not accessible from this execution space");
  expects_options("gsp::pgs", options);
  expects_as_many("gsp::pgs", "worlds", "make them for one model and the same {.worlds = n}", Count{"rows", rows.worlds},
                  Count{"impulses", impulses.worlds});
  expects_solution("gsp::pgs", rows, solution);
  expects_assembled("gsp::pgs", rows);
  expects(!rows.stamp.data() || !rows.stamp().impacts_left, "gsp::pgs: some rows may have a restitution: call impacts first");
  Region const region("gsp::solver::pgs");
  if (rows.islands.ntree > 1 && !islands_found) launch_find_islands(exec, rows, solution, progress);
  // more threads or warps than worlds share the islands of each
  int const busy = is_device<Exec> ? 2048 : host_threads(exec), parts = std::clamp(busy / rows.worlds, 1, std::max(1, rows.islands.ntree));
  PgsIslands<R, Mem> solver{rows, impulses, solution, progress, options, parts};
  if constexpr (is_device<Exec>) {
    launch_pgs_delassus(exec, PgsDelassus<R, Mem>{rows, impulses, solution, options, progress.halt});
    for_worlds("gsp::solver::pgs", exec, rows.worlds * parts, solver);
  } else {
    if (!progress.halt()) {
      auto const found = list_islands(exec, rows, solution);
      solver.any = found.large > 0;
      launch_lockstep(exec, rows, impulses, solution, options, found.small);
    }
    grow_island_room(solver, solution);
    solver.solution = solution;
    Kokkos::parallel_for("gsp::solver::pgs", Kokkos::RangePolicy<Exec>(exec, 0, rows.worlds * parts),
                         RoomyLoop<Exec, R, Mem>{solver, {"gsp::pgs", exec, solution.thread_rooms}});
  }
  if (options.residual) for_worlds("gsp::solver::pgs_residual", exec, rows.worlds, PgsResidual<R, Mem>{solver});
  restore_rows(exec, rows, progress, impulses, solution.z);
  set_solved(rows, impulses, solution);
}
}  // namespace detail

}  // namespace gsp
