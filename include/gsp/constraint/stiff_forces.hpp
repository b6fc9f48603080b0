#pragma once
#include <gsp/constraint/constraint_type.hpp>
#include <gsp/constraint/detail/subtract_stiff_forces.hpp>
#include <gsp/constraint/detail/tree_reader.hpp>
#include <gsp/core/region.hpp>

/// Springs, dampers and servos that are too stiff for a step, as soft rows with their own laws, bounded by their ranges of force (the
/// paper's form). Which they are, and when: docs/constraint/stiff_forces.md.
namespace gsp {

/// Element k is the model's k-th actuator, element nu + t the spring and damper of its t-th tendon, active where smooth_dynamics (or
/// factor) with stiff_rows has left it out of the free velocity in this step. The row's rate is that of its length, its impulse h times its
/// force.
///   f+ = f - h k u+ - b (u+ - u),   lower <= f+ <= upper,   so C = 1 / (h (h k + b)) and zeta = (f + b u) / (h k + b)
/// f, k, b: force, and its slopes by length and rate, at the state.
template <class R, class Mem>
struct StiffForces {
  static constexpr bool rests = true;
  detail::TreeReader<R, Mem> trees;
  std::int64_t const *left_step, *steps;
  int const *act_tree, *act_place, *tendon_tree, *tendon_place;
  Field<R> act_gear;
  R timestep;
  int nu, ntendon;
  detail::Stamps stamps;  // host: those of the dynamics
  StiffForces(Model<R, Mem> const& m, State<R, Mem> const& s, Dynamics<R, Mem> const& d)
      : trees(m, d),
        left_step(d.left_step.data()),
        steps(s.steps.data()),
        act_tree(m.act_tree.data()),
        act_place(m.act_place.data()),
        tendon_tree(m.tendon_tree.data()),
        tendon_place(m.tendon_place.data()),
        act_gear(m.act_gear),
        timestep(m.timestep),
        nu(m.nu),
        ntendon(m.ntendon),
        stamps(d.stamps) {}

  detail::Quantities reads() const { return ntendon > 0 ? detail::set_of(Quantity::tendon_length) : detail::Quantities{}; }

  KOKKOS_INLINE_FUNCTION int count(int world) const { return left_step[world] == steps[world] ? nu + ntendon : 0; }
  KOKKOS_INLINE_FUNCTION int rows(int world, int k) const {
    int const t = tree_of(k);
    return t >= 0 && trees.archetype(t).stiff && number(world, k, 0) > R(0);
  }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    if (k < nu)
      trees.add_actuator(world, act_tree[k], act_place[k], act_gear(world, 6 * k), J);
    else
      trees.add_tendon(world, tendon_tree[k - nu], tendon_place[k - nu], R(1), J);
    return R(0) * number(world, k, 1);  // not finite where the force is not: the state's fault, not the law's
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int, R, R, R h) const {
    R const slope = number(world, k, 0);
    return {R(1) / (h * slope), number(world, k, 1) / slope};
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int world, int k, int) const {
    if (k >= nu) return {-Kokkos::Experimental::infinity_v<R>, Kokkos::Experimental::infinity_v<R>};
    return {timestep * number(world, k, 2), timestep * number(world, k, 3)};
  }
  KOKKOS_INLINE_FUNCTION RowId id(int, int k) const { return {std::uint32_t(k), 0}; }

 private:
  KOKKOS_INLINE_FUNCTION int tree_of(int k) const { return k < nu ? act_tree[k] : tendon_tree[k - nu]; }
  KOKKOS_INLINE_FUNCTION R number(int world, int k, int i) const {  // of act_row, tendon_row
    TreeItems<R> const items = trees.tree(world, tree_of(k));
    return k < nu ? items[items.at.act_row + 4 * act_place[k] + i] : items[items.at.tendon_row + 2 * tendon_place[k - nu] + i];
  }
};

/// Takes what stiff springs and servos did out of qfrc_constraint (world, nv), the sum over all rows that `integrate` leaves: what they do
/// counts as passive and as the actuators' [N, N m]. After `integrate`, before the next `assemble`.
/// Does not allocate, does not fence. Errors: std::invalid_argument where nothing has been solved since the rows were last assembled.
template <ExecutionSpace Exec, class R, class Mem>
void subtract_stiff_forces(Exec const& exec, StiffForces<R, Mem> const& types, Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses,
                           Progress<Mem> const& progress, Kokkos::View<R**, Kokkos::LayoutRight, Mem>& qfrc_constraint) {
  Region const region("gsp::constraint::subtract_stiff_forces");
  expects(int(qfrc_constraint.extent(0)) == rows.worlds && int(qfrc_constraint.extent(1)) == rows.nv,
          "gsp::subtract_stiff_forces: qfrc_constraint must be (worlds, nv)");
  if (rows.nv == 0) return;
  detail::expects_solved("gsp::subtract_stiff_forces", rows, impulses);  // a part of a step: nobody has waited for it
  ElementImpulses<R, Mem> const own{rows, impulses, detail::nth_name(detail::type_name<StiffForces<R, Mem>>(), 0)};
  for_worlds("gsp::constraint::subtract_stiff_forces", exec, rows.worlds,
             detail::SubtractStiffForces<StiffForces<R, Mem>, R, Mem>{types, own, progress.halt, qfrc_constraint});
}

}  // namespace gsp
