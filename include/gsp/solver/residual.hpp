#pragma once
#include <gsp/core/region.hpp>
#include <gsp/solver/detail/residual_world.hpp>

/// What a solver has left unsolved, by parts, read from rows and impulses alone: of `pgs`, `newton`, `noslip`, or a solver of one's own.
///   w = Y Y^T p + C p + b,   A = |Y|^2 + C of a row
///   natural map   (p - proj(p - w / A)) A   [m/s, rad/s]
/// It is 0 where a row's conditions hold, |w| inside of its bounds, and what p has to give way there at a bound. The parts:
///   equality         of rows without bounds, |w|
///   complementarity  of rows with bounds of their own: normals, limits, dry friction, edges of pyramids
///   friction         of rows whose friction is bounded by a normal
///   rate             the greatest of the three
///   bounds           how far p is outside of [lower, upper]
///   cone             how far friction is outside of its cone, as the normal that it lacks, |p_t / mu| - p_n
///   energy           1/2 p^T (Y Y^T + C) p + b . p, which falls towards the solution where there is no friction
/// The law is that of the profile. stable: friction lies within +-mu |p_n| of the normal as it is, two rows in their ellipse together
/// (project_element). mujoco: a normal and all of its friction lie in one cone and are projected on it together (soft_element).
namespace gsp {

/// Parts of the residual of each world, and room to find them.
template <class R, class Mem>
struct Residuals {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0, nv = 0;
  View<R*> rate;             // (worlds) [m/s, rad/s], with z summed anew; solution.residual of pgs has that of its sweeps
  View<R*> equality;         // (worlds) [m/s, rad/s]
  View<R*> complementarity;  // (worlds) [m/s, rad/s]
  View<R*> friction;         // (worlds) [m/s, rad/s]
  View<R*> bounds;           // (worlds) [N s, N m s]
  View<R*> cone;             // (worlds) [N s] of the normal
  View<R*> energy;           // (worlds) [J]
  View<R**> z;               // (world, nv) its own: Y^T p of rows that are not eliminated
};

/// Room for the worlds of `rows`. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
Residuals<R, Mem> make_residuals(Exec const& exec, Rows<R, Mem> const& rows) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::make_residuals: the rows are not accessible from this execution space");
  Residuals<R, Mem> out;
  out.worlds = rows.worlds;
  out.nv = rows.nv;
  auto const make = [&](auto& v, char const* label, auto... items) {
    v = detail::allocate_zero<std::decay_t<decltype(v)>>(exec, label, items...);
  };
  make(out.rate, "gsp::Residuals::rate", out.worlds);
  make(out.equality, "gsp::Residuals::equality", out.worlds);
  make(out.complementarity, "gsp::Residuals::complementarity", out.worlds);
  make(out.friction, "gsp::Residuals::friction", out.worlds);
  make(out.bounds, "gsp::Residuals::bounds", out.worlds);
  make(out.cone, "gsp::Residuals::cone", out.worlds);
  make(out.energy, "gsp::Residuals::energy", out.worlds);
  make(out.z, "gsp::Residuals::z", out.worlds, out.nv);
  return out;
}

/// Finds what is left unsolved. After the solver (or step), before the next `assemble`. Rows of islands that sleep are left out, rows that
/// are eliminated are not.
/// @param rows      what `assemble` wrote
/// @param impulses  of all rows: after `restore_rows`, which `pgs` ends with
/// @param progress  nothing happens while progress.halt is set
/// @param residuals of make_residuals; out. NaN where a world's rows or impulses are
/// Cost: two passes over the rows, 4 flop an entry. Computed in R: rates to a few epsilon of |Y| |z| + |b|. A world's result depends on
/// nothing but its own rows and impulses. Does not allocate, does not fence. Errors: std::invalid_argument for other numbers of worlds or
/// degrees of freedom, and where the impulses are not the solution of these rows (a solver of one's own: `set_solved`).
template <ExecutionSpace Exec, class R, class Mem>
void residuals(Exec const& exec, Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses, Progress<Mem> const& progress,
               Residuals<R, Mem>& residuals) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::residuals: the rows are not accessible from this execution space");
  detail::expects_as_many("gsp::residuals", "worlds", "make them for one model and the same {.worlds = n}",
                          detail::Count{"rows", rows.worlds}, detail::Count{"impulses", impulses.worlds},
                          detail::Count{"residuals", residuals.worlds});
  detail::expects_as_many("gsp::residuals", "degrees of freedom", "make them for one model and the same {.worlds = n}",
                          detail::Count{"rows", rows.nv}, detail::Count{"residuals", residuals.nv});
  detail::expects_solved("gsp::residuals", rows, impulses);
  Region const region("gsp::solver::residuals");
  for_worlds(
      "gsp::solver::residuals", exec, rows.worlds,
      detail::ResidualWorld<R, Mem>{rows, impulses, progress.halt, residuals.z, residuals.rate, residuals.equality,
                                    residuals.complementarity, residuals.friction, residuals.bounds, residuals.cone, residuals.energy});
}

}  // namespace gsp
