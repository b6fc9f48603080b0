#pragma once
#include <gsp/constraint/detail/eliminate_rows.hpp>
#include <gsp/core/region.hpp>

/// Rows without bounds (equality constraints, springs) inside of one tree are taken out of the problem before it is solved (the paper's
/// Schur complement), one after the other. Such a row e has p_e = -(b_e + y_e z_c) / s, s = |y_e|^2 + C, z_c = sum of Y^T p of the others,
/// so that for these
///   w = y (1 - y_e^T y_e / s) z_c + C p + b - (y . y_e) b_e / s
/// and with 1 - y_e^T y_e / s = Q^2, Q = 1 - g y_e^T y_e, g = (1 - sqrt(C / s)) / |y_e|^2, they become rows like others:
///   y' = y Q = y - g (y . y_e) y_e,   b' = b - (y . y_e) b_e / s,   z' = Q z_c
/// (Potter's square root update). When z' is known:   z = Q z' - y_e^T b_e / s,   p_e = -(b_e + sum (y . y_e) p) / s,   from the last.
/// Solvers see a robot whose loops are closed exactly: none of their sweeps goes into closing them.
namespace gsp {

/// Takes the rows without bounds inside of trees that the model's equality constraints close (Model::tree_closed) out of the problem, at
/// most rows.most_eliminated a world: Row::eliminated; the others change as above. `assemble` ends with it.
/// Cost: 4 n a pair of an eliminated row and another on a tree of n degrees of freedom. Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem>
void eliminate_rows(Exec const& exec, Model<R, Mem> const& model, Progress<Mem> const& progress, Rows<R, Mem>& rows,
                    Impulses<R, Mem>& impulses) {
  Region const region("gsp::constraint::eliminate_rows");
  if (rows.most_eliminated == 0) return;
  for_worlds("gsp::constraint::eliminate_rows", exec, rows.worlds,
             detail::EliminateRows<R, Mem>{rows, impulses, progress.halt, model.tree_closed, model.dof_tree});
}

/// Finds the impulses of eliminated rows, and z with them. `pgs` ends with it; call it after a solver of your own, which leaves eliminated
/// rows out.
/// @param progress  nothing happens while progress.halt is set
/// @param impulses  in: of the other rows;   out: of all [N s]
/// @param z         in: Y^T p of the other rows (world, nv);   out: of all
template <ExecutionSpace Exec, class R, class Mem>
void restore_rows(Exec const& exec, Rows<R, Mem> const& rows, Progress<Mem> const& progress, Impulses<R, Mem>& impulses,
                  Kokkos::View<R**, Kokkos::LayoutRight, Mem>& z) {
  Region const region("gsp::constraint::restore_rows");
  if (rows.most_eliminated == 0) return;
  for_worlds("gsp::constraint::restore_rows", exec, rows.worlds, detail::RestoreRows<R, Mem>{rows, impulses, z, progress.halt});
}

}  // namespace gsp
