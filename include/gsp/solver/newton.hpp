#pragma once
#include <gsp/core/region.hpp>
#include <gsp/solver/detail/newton_world.hpp>

/// Newton's method for rows that are all soft: MuJoCo's convex problem, in the whitened coordinates of constraint/rows.hpp, where the mass
/// matrix is the identity:
///   minimise  |z|^2 / 2 + sum over the elements of s(w),   w = Y z + b              (s, p, B: solver/soft_element.hpp)
///   gradient  g = z - Y^T p(w),   Hessian  H = 1 + Y^T B Y
/// which has one solution. Each iteration factors H and goes along -H^-1 g to the least cost on that line. The number of iterations does
/// not grow with masses or stiffness: where p is linear around the start it is one. Source: Todorov 2014, "Convex and
/// analytically-invertible dynamics with contacts and constraints"; MuJoCo's documentation, "Computation: algorithms".
namespace gsp {

struct NewtonOptions {
  int iterations = 100;      // at most
  float tolerance = 1e-10f;  // a world stops when a step would change z by less than this times |z|, or than rounding allows
  bool warm = true;          // start from the impulses given, where that costs less than none
  bool residual = false;     // also measure solution.residual, which is 0 otherwise
};

/// Buffers of `newton`: the Hessian of each world (of each thread on a host) and two numbers a row.
template <class R, class Mem>
struct Newton {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0, nv = 0;
  View<R*> rate, rate_change;  // (rows) w, and Y times the direction; they grow with the rows
  View<R*> work;               // a world's or thread's: lower triangle of H by columns, direction
  std::int64_t stride = 0;     // numbers of one
};

struct NewtonBufferOptions {
  int worlds = 1;
};

/// Buffers for `worlds` worlds: (nv + 3) nv / 2 numbers each on a device, a thread on a host. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
Newton<R, Mem> make_newton(Exec const& exec, Model<R, Mem> const& model, NewtonBufferOptions options = {}) {
  expects(options.worlds > 0, "gsp::make_newton: worlds must be positive");
  Newton<R, Mem> n;
  n.worlds = options.worlds;
  n.nv = model.nv;
  n.stride = detail::newton_work(model.nv);
  std::int64_t const parts = is_device<Exec> ? options.worlds : Kokkos::DefaultHostExecutionSpace().concurrency();
  n.work = detail::allocate_zero<typename Newton<R, Mem>::template View<R*>>(exec, "gsp::Newton::work", parts * n.stride);
  return n;
}

namespace detail {
/// @param ends_step  whether a launch that does nothing counts as a step (Progress::skipped)
template <class Exec, class R, class Mem>
void newton(Exec const& exec, Rows<R, Mem> const& rows, Impulses<R, Mem>& impulses, Solution<R, Mem>& solution, Newton<R, Mem>& buffers,
            Progress<Mem>& progress, NewtonOptions options, bool ends_step) {
  Region const region("gsp::solver::newton");
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::newton: the rows are not accessible from this execution space");
  expects(options.iterations > 0, "gsp::newton: iterations must be positive");
  expects(impulses.worlds == rows.worlds && solution.worlds == rows.worlds && solution.nv == rows.nv && buffers.worlds == rows.worlds &&
              buffers.nv == rows.nv,
          "gsp::newton: rows, impulses, solution and buffers have different numbers of worlds or degrees of freedom: make them for one "
          "model and the same {.worlds = n}");
  expects(rows.most_eliminated == 0,
          "gsp::newton: equality rows are eliminated, and this solver takes them itself: choose profile mujoco, or make_rows(exec, model, "
          "{.eliminate = false})");
  enlarge(exec, buffers.rate, "gsp::Newton::rate", rows.capacity());
  enlarge(exec, buffers.rate_change, "gsp::Newton::rate_change", rows.capacity());
  NewtonWorld<R, Mem> const solve{rows,
                                  impulses,
                                  solution,
                                  progress,
                                  buffers.rate,
                                  buffers.rate_change,
                                  buffers.work,
                                  buffers.stride,
                                  options.iterations,
                                  max(R(options.tolerance), R(32) * Kokkos::Experimental::epsilon_v<R>),
                                  options.warm,
                                  options.residual,
                                  ends_step};
  if constexpr (is_device<Exec>)
    for_worlds("gsp::solver::newton", exec, rows.worlds, solve);
  else
    Kokkos::parallel_for("gsp::solver::newton", Kokkos::RangePolicy<Exec>(exec, 0, rows.worlds), NewtonThread<Exec, R, Mem>{solve});
  set_solved(rows, impulses);
}
}  // namespace detail

/// Solves for the impulses of all rows. Friction of an element is the elliptic cone of its rows and their normal, which must push alone
/// (lower 0, no upper bound); what is rigid is taken as soft as `least_softness`.
/// @param rows       what `assemble` wrote
/// @param impulses   in: start;   out: p(w) of the solution [N s]
/// @param solution   z = Y^T p (world, nv), iterations (world), residual: largest change of a rate between the solution and that z
/// @param buffers    of make_newton
/// @param progress   nothing happens while progress.halt is set
/// Cost an iteration: n^2 / 2 a row of n entries, nv^3 / 6 for the factor where trees touch, and a few passes over the rows. A world's
/// result depends on nothing but its own rows. Does not fence; allocates where the rows' pool has grown since the last call.
/// Errors: std::invalid_argument for sizes of different models or worlds, and for iterations < 1.
template <ExecutionSpace Exec, class R, class Mem>
void newton(Exec const& exec, Rows<R, Mem> const& rows, Impulses<R, Mem>& impulses, Solution<R, Mem>& solution, Newton<R, Mem>& buffers,
            Progress<Mem>& progress, NewtonOptions options = {}) {
  detail::newton(exec, rows, impulses, solution, buffers, progress, options, true);
}

}  // namespace gsp
