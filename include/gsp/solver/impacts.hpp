#pragma once
#include <gsp/core/region.hpp>
#include <gsp/solver/detail/impacts_world.hpp>

/// Impacts pass on: Generalized Reflections (Smith, Kaufman, Vouga, Tamstorf, Grinspun: Reflections on Simultaneous Impact, SIGGRAPH 2012).
/// Of all contacts with a restitution e those that approach are solved alone, and what they part with brings the next ones to approach:
///   u = (J v + J v^) / 2 + Y z0    rates, in the middle of what the step's forces do;   z0 = 0, p0 = 0
///   S = rows that close within the step, faster than what gravity does in one, |g| h
///   0 <= p  _|_  u_S + Y_S Y_S^T p >= 0
///   z0 += (1 + e) Y_S^T p,   p0 += (1 + e) p,   and again, until S is empty
/// A round adds no energy, as all rows that it solves together have one e: of rows that share a tree those of the greatest e go first. Rows
/// without bounds (equalities, springs) take part as far as their softness lets them. Momentum is kept. Each island has its own rounds.
/// Then p0 is the least that the solver may give these rows: friction and what reads forces see the whole impulse.
namespace gsp {

struct ImpactOptions {
  // Rounds at most; 0: 50 and two for each row of an island with a restitution, as a blow passes one contact a round. What then still
  // approaches is stopped by the solver, without restitution.
  int rounds = 0;
  int sweeps = 200;         // of Gauss-Seidel in a round, at most
  float tolerance = 1e-6f;  // a round ends when no rate changed in a sweep by more than this share of its fastest approach
};

/// Finds what rows with a restitution give back. After assemble, before pgs.
/// @param progress  nothing happens while progress.halt is set
/// @param rows      what `assemble` wrote, in profile stable, made with {.impacts = true}; without it nothing is launched. Out: `lower` of
///                  rows that have been hit is p0
/// @param impulses  start of the solver; out: at least p0 [N s]
/// @param solution  scratch
/// Cost: where nothing approaches a pass over the rows; else a round costs 4 flop an entry and sweep. A world's result depends on nothing
/// but its own rows. Does not allocate, does not fence. Errors: std::invalid_argument for sizes of different models or worlds, for
/// rows that nobody has assembled and for negative options.
template <ExecutionSpace Exec, class R, class Mem>
void impacts(Exec const& exec, Progress<Mem> const& progress, Rows<R, Mem>& rows, Impulses<R, Mem>& impulses, Solution<R, Mem>& solution,
             ImpactOptions options = {}) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::impacts: the rows are not accessible from this execution space");
  expects(options.rounds >= 0 && options.sweeps > 0 && options.tolerance >= 0,
          "gsp::impacts: rounds and tolerance must not be negative, and sweeps must be positive");
  detail::expects_as_many("gsp::impacts", "worlds", "make them for one model and the same {.worlds = n}",
                          detail::Count{"rows", rows.worlds}, detail::Count{"impulses", impulses.worlds},
                          detail::Count{"solution", solution.worlds});
  detail::expects_as_many("gsp::impacts", "degrees of freedom", "make them for one model and the same {.worlds = n}",
                          detail::Count{"rows", rows.nv}, detail::Count{"solution", solution.nv});
  if (!rows.impact.data()) return;
  detail::expects_assembled("gsp::impacts", rows);
  Region const region("gsp::solver::impacts");
  for_worlds("gsp::solver::impacts", exec, rows.worlds,
             detail::ImpactsWorld<R, Mem>{rows, impulses, solution, progress.halt, options.rounds, options.sweeps, R(options.tolerance)});
  if (rows.stamp.data()) rows.stamp().impacts_left = false;
}

}  // namespace gsp
