#pragma once
#include <gsp/core/region.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/solver/detail/noslip_world.hpp>
#include <numeric>

/// MuJoCo's noslip: after the solution of soft rows friction is solved for once more, rigid, with all else as it stands:
///   minimise  |Y_f^T p_f + z_n|^2 / 2 + b_f . p_f   over the impulses p_f of friction,   z_n = Y_n^T p_n of all other rows
///   dry rows              lower <= p <= upper
///   friction of a normal  in the ellipsoid |p_b / mu_b| <= p_a, p_a as it is
///   edges of a pyramid    p_1 + p_2 as it is, both >= 0
/// by sweeps, each block to its least cost in turn: dry rows, a contact's friction together, pairs of edges; island by island. What holds
/// then holds without creeping; that normals no longer fit to it is not mended. Source: MuJoCo's documentation, "Computation: algorithms",
/// NoSlip.
namespace gsp {

struct NoslipOptions {
  int iterations = 0;        // sweeps, at most
  double least_gain = 1e-9;  // of a world [J]: an island stops after a sweep that lowers the cost by less than its dofs' share of it; below
                             // zero: after all of them
};

/// As a file says: noslip_iterations and noslip_tolerance, of the mean inertia of a dof in qpos0, times the dofs, times h^2 (MuJoCo's
/// units of cost are those of one step).
inline NoslipOptions noslip_options(CompiledModel const& m) {
  double const inertia = std::accumulate(m.dof_M0.begin(), m.dof_M0.end(), 0.);  // mean times dofs
  return {m.option.noslip_iterations, m.option.noslip_tolerance * inertia * m.option.timestep * m.option.timestep};
}

/// Solves for the impulses of friction again, without its softness. After newton.
/// @param rows      what `assemble` wrote, in profile mujoco; friction is what names a normal, and rows that are `dry`
/// @param impulses  in: of all rows;   out: those of friction are new
/// @param solution  in: z = Y^T p;   out: the same with the new ones
/// @param progress  nothing happens while progress.halt is set
/// Cost a sweep: 8 flop an entry of friction. An island's result depends on nothing but its own rows. Does not allocate, does not fence.
/// Errors: std::invalid_argument for sizes of different models or worlds, for iterations < 0, a least_gain that is NaN, for rows of
/// profile stable, and where the impulses are not the solution of these rows.
template <ExecutionSpace Exec, class R, class Mem>
void noslip(Exec const& exec, Rows<R, Mem> const& rows, Impulses<R, Mem>& impulses, Solution<R, Mem>& solution,
            Progress<Mem> const& progress, NoslipOptions options) {
  Region const region("gsp::solver::noslip");
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::noslip: the rows are not accessible from this execution space");
  expects(options.iterations >= 0, "gsp::noslip: iterations must not be negative");
  expects(options.least_gain == options.least_gain, "gsp::noslip: least_gain is NaN: give a number (below 0: all sweeps are done)");
  detail::expects_as_many("gsp::noslip", "worlds", "make them for one model and the same {.worlds = n}", detail::Count{"rows", rows.worlds},
                          detail::Count{"impulses", impulses.worlds}, detail::Count{"solution", solution.worlds});
  detail::expects_as_many("gsp::noslip", "degrees of freedom", "make them for one model and the same {.worlds = n}",
                          detail::Count{"rows", rows.nv}, detail::Count{"solution", solution.nv});
  expects(rows.profile == Profile::mujoco, "gsp::noslip: the rows are of profile stable, whose friction does not slip: leave the call out");
  detail::expects_solved("gsp::noslip", rows, impulses);
  for_worlds("gsp::solver::noslip", exec, rows.worlds,
             detail::NoslipWorld<R, Mem>{rows, impulses, solution, progress, options.iterations, R(options.least_gain)});
}

}  // namespace gsp
