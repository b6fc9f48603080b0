#pragma once
#include <algorithm>
#include <cstdint>
#include <gsp/core/region.hpp>
#include <gsp/solver/detail/newton_world.hpp>
#include <limits>
#include <string>

/// Newton's method for rows that are all soft: MuJoCo's convex problem, in the whitened coordinates of constraint/rows.hpp, where the mass
/// matrix is the identity:
///   minimise  |z|^2 / 2 + sum over the elements of s(w),   w = Y z + b              (s, p, B: solver/soft_element.hpp)
///   gradient  g = z - Y^T p(w),   Hessian  H = 1 + Y^T B Y
/// which has one solution. Islands (constraint/islands.hpp) are problems of their own, and solved one by one. Each iteration factors H and
/// goes along -H^-1 g to the least cost on that line. The number of iterations does not grow with masses or stiffness: where p is linear
/// around the start it is one. Source: Todorov 2014, "Convex and analytically-invertible dynamics with contacts and constraints"; MuJoCo's
/// documentation, "Computation: algorithms".
namespace gsp {

struct NewtonOptions {
  int iterations = 100;      // at most
  float tolerance = 1e-10f;  // an island stops when a step would change z by less than this times |z|, or than rounding allows
  bool warm = true;          // start from the impulses given, where that costs less than none
  bool residual = false;     // also measure solution.residual, which is NaN otherwise
  bool ends_step = true;     // a launch that does nothing counts as a step (Progress::skipped): of several in a step, the last one alone
};

namespace detail {
inline void expects_options(char const* where, NewtonOptions const& o) {
  expects(o.iterations > 0, where, "iterations must be positive");
  expects(o.tolerance >= 0, where, "tolerance must be a number, 0 or more");
}
}  // namespace detail

/// Buffers of `newton`: three numbers a row, and what a thread of a host or a block of a GPU works in.
template <class R, class Mem>
struct Newton {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0, nv = 0;
  View<R*> rate, rate_change, least;  // (capacity of the rows) w, Y times the direction, and the least compliance (least_softness)
  View<R*> work;       // a thread's, or that of a GPU's block, which takes islands that no shared memory holds (detail/newton_sparse.hpp)
  View<int*> by_tree;  // GPUs: (2 capacity of the rows) rows of each tree of such an island
  View<int*> listed;   // GPUs: islands by what they take (detail/newton_island.hpp)
  std::int64_t stride = 0;      // numbers of one
  std::int64_t near_bytes = 0;  // what an island may take to be solved in near memory, as far as there is any (detail/newton_island.hpp)
  int thread_rooms = 0;         // threads, or blocks, that it has room for
};

/// Buffers for the worlds of `rows`: three numbers for each row of the pool; 0.63 nv^2 + 25 nv + 1,200 for each thread of a host, with
/// 65,536 of near memory, or for each block of 1,024 threads that a device holds at a time, but beyond one a world no more than 2^24 in
/// all; on a device two ints for each row and 15 for each tree of each world. Allocates. Errors: std::invalid_argument for more than 32,768
/// degrees of freedom.
template <ExecutionSpace Exec, class R, class Mem>
Newton<R, Mem> make_newton(Exec const& exec, Rows<R, Mem> const& rows) {
  expects(rows.nv <= detail::NewtonSparseSizes::most_dofs,
          "gsp::make_newton: a world of " + std::to_string(rows.nv) +
              " degrees of freedom has more than 32,768, of which newton cannot factor a matrix: use profile stable");
  Newton<R, Mem> n;
  n.worlds = rows.worlds;
  n.nv = rows.nv;
  n.stride = detail::NewtonSparseSizes::all(rows.nv);
  std::int64_t const islands = std::int64_t(rows.worlds) * detail::islands_of_world(rows);
  if constexpr (is_device<Exec>) {
    n.near_bytes = std::numeric_limits<std::int64_t>::max();
    std::int64_t const rooms = std::max<std::int64_t>(rows.worlds, detail::NewtonSparseSizes::most_numbers / n.stride);
    n.thread_rooms = int(std::max<std::int64_t>(std::min<std::int64_t>({rooms, islands, detail::newton_sparse_blocks(exec)}), 1));
    n.listed = detail::allocate_zero<decltype(n.listed)>(exec, "gsp::Newton::listed", detail::NewtonLists<Mem>::size(islands));
    n.by_tree = detail::allocate_zero<decltype(n.by_tree)>(exec, "gsp::Newton::by_tree", 2 * std::int64_t(rows.capacity()));
  } else {
    n.near_bytes = detail::newton_near_numbers * std::int64_t(sizeof(R));
    n.thread_rooms = detail::thread_rooms(exec);
    n.stride += detail::newton_near_numbers;
  }
  using View = typename Newton<R, Mem>::template View<R*>;
  n.work = detail::allocate_zero<View>(exec, "gsp::Newton::work", n.thread_rooms * n.stride);
  n.rate = detail::allocate_zero<View>(exec, "gsp::Newton::rate", rows.capacity());
  n.rate_change = detail::allocate_zero<View>(exec, "gsp::Newton::rate_change", rows.capacity());
  n.least = detail::allocate_zero<View>(exec, "gsp::Newton::least", rows.capacity());
  return n;
}

/// Enlarges the buffers where the pool of `rows` has grown beyond them (after grow(exec, rows, impulses, progress)). Returns whether it
/// had: then it allocates, and fences `exec`.
template <ExecutionSpace Exec, class R, class Mem>
bool grow(Exec const& exec, Rows<R, Mem> const& rows, Newton<R, Mem>& buffers) {
  if (std::int64_t(buffers.rate.extent(0)) >= rows.capacity()) return false;
  exec.fence("gsp::grow: what was launched uses the buffers as they were");
  detail::enlarge(exec, buffers.rate_change, "gsp::Newton::rate_change", rows.capacity());
  detail::enlarge(exec, buffers.least, "gsp::Newton::least", rows.capacity());
  if constexpr (is_device<Exec>) detail::enlarge(exec, buffers.by_tree, "gsp::Newton::by_tree", 2 * std::int64_t(rows.capacity()));
  detail::enlarge(exec, buffers.rate, "gsp::Newton::rate", rows.capacity());  // last: it says how much room there is
  exec.fence("gsp::grow: the old buffers may go");
  return true;
}

/// Solves for the impulses of all rows. Friction of an element is the elliptic cone of its rows and their normal, which must push alone
/// (lower 0, no upper bound); what is rigid is taken as soft as `least_softness` has it.
/// @param rows       what `assemble` wrote, in profile mujoco
/// @param impulses   in: start;   out: p(w) of the solution [N s]
/// @param solution   z (world, nv), Y^T p but for rounding; iterations (world), the most of any island; residual: largest change of a rate
/// between z and that sum
/// @param buffers    of make_newton
/// @param progress   nothing happens while progress.halt is set
/// Cost an iteration: n^2 / 2 a row of n entries, m^3 / 6 for the factor of an island of m dofs, and a few passes over the rows. An
/// island's result depends on nothing but its own rows. Does not allocate, does not fence.
/// Errors: std::invalid_argument for sizes of different models or worlds, for iterations < 1, a tolerance below 0 or NaN, for rows
/// that nobody has assembled, of profile stable, which may be eliminated, or of laws that are no convex problem, and where the rows' pool
/// has grown beyond the buffers.
template <ExecutionSpace Exec, class R, class Mem>
void newton(Exec const& exec, Rows<R, Mem> const& rows, Impulses<R, Mem>& impulses, Solution<R, Mem>& solution, Newton<R, Mem>& buffers,
            Progress<Mem>& progress, NewtonOptions options = {}) {
  Region const region("gsp::solver::newton");
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::newton: the rows are not accessible from this execution space");
  detail::expects_options("gsp::newton", options);
  detail::expects_as_many("gsp::newton", "worlds", "make them for one model and the same {.worlds = n}", detail::Count{"rows", rows.worlds},
                          detail::Count{"impulses", impulses.worlds}, detail::Count{"solution", solution.worlds},
                          detail::Count{"buffers", buffers.worlds});
  detail::expects_as_many("gsp::newton", "degrees of freedom", "make them for one model and the same {.worlds = n}",
                          detail::Count{"rows", rows.nv}, detail::Count{"solution", solution.nv}, detail::Count{"buffers", buffers.nv});
  detail::expects_assembled("gsp::newton", rows);
  expects(rows.profile == Profile::mujoco,
          "gsp::newton: the rows are of profile stable, and those need not be the convex problem that this solver solves: call pgs, or "
          "make_model with {.profile = Profile::mujoco}");
  expects(std::int64_t(buffers.rate.extent(0)) >= rows.capacity(),
          "gsp::newton: the pool of rows has grown, and the buffers have not: call grow(exec, rows, buffers)");
  std::int64_t const near_bytes =
      is_device<Exec> ? buffers.near_bytes : std::min(buffers.near_bytes, detail::newton_near_numbers * std::int64_t(sizeof(R)));
  detail::NewtonWorld<R, Mem> const solve{{.rows = rows,
                                           .impulses = impulses,
                                           .solution = solution,
                                           .progress = progress,
                                           .rate = buffers.rate,
                                           .rate_change = buffers.rate_change,
                                           .least = buffers.least,
                                           .work = buffers.work,
                                           .by_tree = buffers.by_tree,
                                           .stride = buffers.stride,
                                           .near_bytes = near_bytes,
                                           .iterations = options.iterations,
                                           .tolerance = max(R(options.tolerance), R(32) * Kokkos::Experimental::epsilon_v<R>),
                                           .warm = options.warm,
                                           .residual = options.residual,
                                           .ends_step = options.ends_step},
                                          {buffers.listed, rows.worlds * detail::islands_of_world(rows)}};
  if constexpr (is_device<Exec>)
    detail::launch_newton(exec, solve, buffers.thread_rooms);
  else
    Kokkos::parallel_for("gsp::solver::newton", Kokkos::RangePolicy<Exec>(exec, 0, rows.worlds),
                         detail::NewtonThread<Exec, R, Mem>{solve, {"gsp::newton", exec, buffers.thread_rooms}});
  set_solved(rows, impulses, solution);
}

}  // namespace gsp
