#pragma once
#include <gsp/constraint/constraint_type.hpp>
#include <gsp/constraint/detail/whiten_rows.hpp>
#include <gsp/constraint/softness.hpp>
#include <gsp/core/status.hpp>
#include <gsp/dynamics/dynamics.hpp>
#include <gsp/model/state.hpp>

/// What a row's law and bounds become, once its entries are known.
namespace gsp::detail {

template <class R>
KOKKOS_INLINE_FUNCTION bool is_finite(R const& x) {
  return x - x == R(0);
}
// A rigid row that pushes bears  p <= |u| / |Y|^2 + m (1e3 |g| h + |zeta|),  m the mass of its island: what is jammed asks for zeta /
// |Y|^2, any number, or, between two that do not yield, for more with every sweep, and would be thrown by its overlap or by rounding of its
// load.
inline constexpr double most_weights = 1e3;
// |Y|^2 mass is 1 but for leverage; the square of so many epsilon is what rounding has left of 0.
inline constexpr double jammed_rounding = 32;
// MuJoCo's least compliance, of what nothing moves in the initial pose (soft_law). Such a row bears zeta / C, 1e14 and more, and a rigid
// one zeta / |Y|^2, by which entries that are rounding would throw or hold what they touch (a tendon between bodies that are one: 1e7 m/s
// in float; a door that a rigid connect holds on its own hinge). They are 0 then: of |Y|^2 less than the square of so many epsilon, for
// joints that move the row by 1 a radian or metre.
inline constexpr double no_softness = 2e-15;
template <class R, class Mem>
struct RowLaws {
  Model<R, Mem> const& model;
  State<R, Mem> const& state;
  Dynamics<R, Mem> const& dynamics;
  Rows<R, Mem> const& rows;
  R most_inverse_inertia;  // inverse_inertia of any row of the world is no more: rows that move enough are not asked for theirs

  /// What an element asks for row r, of this gap and rate. Members are made in their places: what is copied right after it was written
  /// number by number waits until those are in the cache.
  struct Asked {
    RowBounds<R> bounds{};
    RowLaw<R> law{};
    bool known = false;  // its impulse, whatever the rate: bounds that meet (a cone of profile mujoco goes by its law, not by bounds)
    Asked() = default;
    template <class Element>
    KOKKOS_INLINE_FUNCTION Asked(RowLaws const& laws, Element const& element, int r, R gap, R rate)
        : bounds(in_precision(element.bounds(r))), law(element.law(r, gap, rate, laws.model.timestep, bounds)) {
      known =
          bounds.lower == bounds.upper && bounds.friction_of < 0 && (laws.model.profile == Profile::stable || !bears_friction(element, r));
    }
    template <class Bounds>
    KOKKOS_INLINE_FUNCTION static RowBounds<R> in_precision(Bounds const& b) {
      return {R(b.lower), R(b.upper), b.friction_of, R(b.mu), b.with_next, b.dry};
    }
  };
  /// Law and bounds of a row, number `at` of the pool. Returns what it may yield to its load (RowLaw).
  KOKKOS_INLINE_FUNCTION R set(Asked const& asked, int w, int at, RowSums<R> const& sums, Row<R>& row) const {
    R const rate = sums.rate, free_rate = sums.free_rate;
    R diagonal = sums.diagonal;
    RowLaw<R> law = asked.law;
    RowBounds<R> const& bounds = asked.bounds;
    bool const bounces =
        law.restitution > R(0) && law.restitution <= R(1) && law.compliance == R(0) && bounds.pushes_alone() && rows.impact.data();
    bool const is_law = is_finite(law.zeta) && is_finite(law.compliance) && law.compliance >= R(0) && (bounces || law.restitution == R(0));
    if (!is_law && is_finite(sums.gap) && is_finite(rate)) {  // of a state that is none it need not be one
      Kokkos::atomic_or(&state.status(w), status::row_refused | status::refused_law);
      law.compliance = R(0);
      law.zeta = free_rate;
      law.restitution = R(0);
    }
    // J of such a state, or of a type that gives such: nothing can be said of the row, and the world stays as it is.
    if (!is_finite(diagonal)) Kokkos::atomic_or(&state.status(w), status::not_finite);
    if (asked.known) {
      law.compliance = R(0);
      law.zeta = rate;
    }
    R const rounding = square(R(jammed_rounding) * Kokkos::Experimental::epsilon_v<R>);
    if (law.compliance <= R(no_softness) && bounds.friction_of < 0 && diagonal > R(0) && !(diagonal > rounding * most_inverse_inertia) &&
        diagonal <= rounding * inverse_inertia(w, row)) {
      for (int i = 0; i < row.segment[0].count + row.segment[1].count; ++i) rows.Y(row.first_entry + i) = R(0);
      diagonal = R(0);
    }
    row.bias = free_rate - law.zeta;
    row.compliance = law.compliance;
    // What nothing can move bears what its softness makes of its gap, p = -b / C; rigid, or without a dof, it bears nothing.
    bool const jammed = law.compliance == R(0) && diagonal * law.mass <= rounding;
    R const size = row.segment[0].count > 0 && !jammed ? diagonal + law.compliance : R(0);
    row.inverse_diagonal = size > R(0) ? R(1) / size : R(0);
    row.friction_of = static_cast<signed char>(bounds.friction_of);
    row.lower = bounds.lower;
    row.upper = min(bounds.upper, most_push(law, w, row, max(abs(rate), abs(free_rate)) * row.inverse_diagonal));
    row.mu = bounds.friction_of < 0 ? R(-1) : bounds.mu;
    row.with_next = bounds.with_next;
    row.dry = bounds.dry;
    if (rows.impact.data()) rows.impact(at) = RowImpact<R>{diagonal > R(0) ? law.restitution : R(0), rate, law.zeta, R(0)};
    if (row.inverse_diagonal == R(0)) {
      row.bias = R(0);
      if (model.profile == Profile::stable) {
        row.friction_of = -1;
        row.mu = R(-1);
      }
      if (model.profile == Profile::stable || !(row.lower <= R(0) && row.upper >= R(0))) row.lower = row.upper = R(0);
    }
    // What cannot sink in carries the same however hard it is, or more.
    if (!(diagonal > Kokkos::Experimental::epsilon_v<R> * law.compliance)) return Kokkos::Experimental::infinity_v<R>;
    return law.most_yield;
  }

 private:
  /// Whether friction of the element hangs on its row r.
  template <class Element>
  KOKKOS_INLINE_FUNCTION static bool bears_friction(Element const& element, int r) {
    for (int b = 0, n = element.rows(); b < n; ++b)
      if (element.bounds(b).friction_of == r) return true;
    return false;
  }
  /// Sum of 1 / D over the dofs of a row: |Y|^2 of a row that each of them moves by 1.
  KOKKOS_INLINE_FUNCTION R inverse_inertia(int w, Row<R> const& row) const {
    R sum(0);
    for (int s = 0; s < 2 && row.segment[s].count > 0; ++s) {
      auto const& segment = row.segment[s];
      TreeItems<R> const items = dynamics.tree(model, w, model.dof_tree(segment.dof0));
      for (int i = 0; i < segment.count; ++i)
        sum += items[items.at.inverse_diagonal + (segment.list < 0 ? i : model.ints(segment.list + i))];
    }
    return sum;
  }
  /// What a rigid row that says what it moves may push (RowLaw::mass): what stops it, which makes no energy however little it moves; and
  /// for the overlap and for others no more than all bodies of its island ask for (most_weights).
  KOKKOS_INLINE_FUNCTION R most_push(RowLaw<R> const& law, int w, Row<R> const& row, R stops) const {
    R const mass = max(law.mass, rows.island_mass(w, row));
    return stops + mass * (R(most_weights) * rows.rate_scale(w) + abs(law.zeta));
  }
};

}  // namespace gsp::detail
