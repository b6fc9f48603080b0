#pragma once
#include <gsp/constraint/assemble.hpp>
#include <gsp/solver/detail/pgs_lockstep.hpp>

/// Projected Gauss-Seidel over whitened rows (paper, eq. 6-8), one world after the other.
///   w = Y z + C p + b,   z = sum Y^T p,   lo <= p <= hi,   w complementary to the bounds
///   b = J v^ - zeta, so that Y z + b + C p = J v+ + C p - zeta vanishes where p is inside of its bounds.
/// A row: p <- clamp(p - w / (|Y|^2 + C)), z <- z + Y^T dp. Friction rows are bounded by +-mu times the present impulse of their normal
/// row.
namespace gsp {

struct PgsOptions {
  int iterations = 100;     // sweeps at most
  float tolerance = 1e-6f;  // a world stops when no row changed its rate by more than this in a sweep [m/s, rad/s]; 0: after all sweeps
  float relaxation = 1;
  bool residual = false;  // also measure rows.residual after the last sweep: the largest violation of the conditions above, as a rate
};

namespace detail {
template <class R, class Mem>
struct Pgs {
  Model<R, Mem> model;
  Rows<R, Mem> rows;
  PgsOptions options;
  int least_rows = 0;  // worlds with fewer go in lockstep

  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    if (rows.halt()) return;
    int const w = world.rank, first = rows.first(w), count = rows.count(w);
    R* const z = rows.z.data() + std::int64_t(w) * model.nv;
    R* const p = rows.impulse[rows.parity()].data() + first;
    if (w == 0) world.once([&] { rows.solved() = 1, ++rows.completed(); });
    if (count < least_rows) return;
    world.each(model.nv, [&](int i) { z[i] = R(0); });
    for (int r = 0; r < count; ++r) {
      world.sync();
      if (p[r] != R(0)) push(world, rows.row(first + r), z, p[r]);
    }
    world.sync();
    int sweep = 0;
    for (R change = R(1); sweep < options.iterations && count > 0 && change > R(options.tolerance); ++sweep) {
      change = R(0);
      for (int r = 0; r < count; ++r) {
        Row<R> const& row = rows.row(first + r);
        R const old = p[r], next = project(world, row, z, p, r, R(options.relaxation)), d = next - old;
        world.sync();  // all have read p and z
        if (d != R(0)) {
          world.once([&] { p[r] = next; });
          push(world, row, z, d);
          change = max(change, abs(d) / row.inverse_diagonal);
          world.sync();
        }
      }
      if (options.tolerance == 0) change = R(1);
    }
    R worst(0);
    if (options.residual)
      for (int r = 0; r < count; ++r) {
        Row<R> const& row = rows.row(first + r);
        if (row.inverse_diagonal > R(0)) worst = max(worst, abs(project(world, row, z, p, r, R(1)) - p[r]) / row.inverse_diagonal);
      }
    world.once([&] { rows.iterations(w) = sweep, rows.residual(w) = worst; });
  }

 private:
  KOKKOS_INLINE_FUNCTION int const* list_of(RowSegment const& s) const { return s.list < 0 ? nullptr : model.ints.data() + s.list; }

  template <class World>
  KOKKOS_INLINE_FUNCTION R project(World const& world, Row<R> const& row, R const* z, R const* p, int r, R relaxation) const {
    R w = fma(row.compliance, p[r], row.bias);
    R const* y = rows.Y.data() + row.Y;
    for (int s = 0; s < row.segments; ++s) {
      auto const& segment = row.segment[s];
      int const* const list = list_of(segment);
      R const* const part = z + segment.dof0;
      w += world.template sum<R>(segment.count, [&](int i) { return y[i] * part[list ? list[i] : i]; });
      y += segment.count;
    }
    R lower = row.lower, upper = row.upper;
    if (row.friction_of >= 0) upper = row.upper * p[row.friction_of], lower = -upper;
    return clamp(fma(-relaxation * row.inverse_diagonal, w, p[r]), lower, upper);
  }
  template <class World>
  KOKKOS_INLINE_FUNCTION void push(World const& world, Row<R> const& row, R* z, R d) const {
    R const* y = rows.Y.data() + row.Y;
    for (int s = 0; s < row.segments; ++s) {
      auto const& segment = row.segment[s];
      int const* const list = list_of(segment);
      R* const part = z + segment.dof0;
      world.each(segment.count, [&](int i) { part[list ? list[i] : i] = fma(y[i], d, part[list ? list[i] : i]); });
      y += segment.count;
    }
  }
};
}  // namespace detail

/// Solves for the impulses of the rows, from those that they hold (warm start).
/// @param rows  impulses: in and out [N s, N m s];  z (world, nv): out;  residual, iterations (world): out
/// On a CPU, worlds of at most 128 rows in models of at most 128 dofs go in lockstep, a pack at a time; larger ones, and on a GPU all, over
/// sparse rows. Cost 4 entries iterations flop a world. A world's result depends on nothing but its own rows. Does not allocate, does not
/// fence.
template <ExecutionSpace Exec, class R, class Mem>
void pgs(Exec const& exec, Model<R, Mem> const& model, Rows<R, Mem> const& rows, PgsOptions options = {}) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::pgs: the rows are not accessible from this execution space");
  expects(options.iterations > 0, "gsp::pgs: iterations must be positive");
  detail::expects_rows("gsp::pgs", "rows.z", rows.z, rows.worlds, model.nv);
  int least_rows = 0;
  if constexpr (!is_device<Exec>)
    if (detail::lockstep_packs(model.nv) > 0) {  // before the other kernel, which marks the step as solved
      using Solver = detail::PgsLockstep<R, Mem, PgsOptions>;
      Kokkos::parallel_for("gsp::solver::pgs_lockstep", Kokkos::RangePolicy<Exec>(exec, 0, (rows.worlds + Solver::W - 1) / Solver::W),
                           detail::LockstepLoop<Exec, Solver>{{model, rows, options}});
      least_rows = detail::lockstep_most_rows + 1;
    }
  for_worlds("gsp::solver::pgs", exec, rows.worlds, detail::Pgs<R, Mem>{model, rows, options, least_rows});
}

}  // namespace gsp
