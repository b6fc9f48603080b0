#pragma once
#include <gsp/constraint/rows.hpp>
#include <gsp/math/quat.hpp>
#include <gsp/model/model.hpp>
#include <gsp/model/state.hpp>

/// What rounding has taken from the pose of a body that floats (State::qpos_low). Poses of bodies are without it: a gap that they give
/// jumps by the last digit of a place or an orientation, and what lies far from the origin, or turns slowly, would never rest in float.
namespace gsp::detail {

/// f(first dof, motion) of each body of a tree that floats: what is left of its pose as a motion of its six dofs, along, and about the
/// body's axes, q_low = q x / 2.
template <class R, class Mem, class F>
KOKKOS_INLINE_FUNCTION void each_low_pose(Model<R, Mem> const& model, State<R, Mem> const& state, int w, int tree, F const& f) {
  Archetype const& a = model.archetypes(model.tree_archetype(tree));
  int const* const ints = model.ints.data();
  for (int j = 0, n = a.nroot == 1 ? 1 : a.njnt; j < n; ++j) {  // of a tree with one root, its first joint if any
    if (JointType(ints[a.jnt_type + j]) != JointType::free) continue;
    int const q = ints[a.instance_qpos + model.tree_instance(tree)] + ints[a.jnt_qposadr + j];
    auto const high = [&](int i) { return state.qpos(w, q + i); };
    auto const low = [&](int i) { return state.qpos_low(w, q + i); };
    Quat<R> const turn = conjugate(Quat<R>{high(3), high(4), high(5), high(6)}) * Quat<R>{low(3), low(4), low(5), low(6)};
    R const motion[6] = {low(0), low(1), low(2), R(2) * turn.x, R(2) * turn.y, R(2) * turn.z};
    f(ints[a.jnt_dofadr + j], motion);
  }
}

/// J x of a segment's entries, from `begin` on, x that motion of all of them.
template <class R, class Mem, class Entries>
KOKKOS_INLINE_FUNCTION R low_part(Model<R, Mem> const& model, State<R, Mem> const& state, int w, int tree, RowSegment const& segment,
                                  Entries const& J, int begin) {
  R sum(0);
  each_low_pose(model, state, w, tree, [&](int dof, R const* motion) {
    int const at = segment.list < 0 ? dof : 0;  // a chain begins at its root
    if (segment.list >= 0 && model.ints(segment.list) != dof) return;
    for (int i = 0; i < 6 && at + i < segment.count; ++i) sum = fma(J[begin + at + i], motion[i], sum);
  });
  return sum;
}

}  // namespace gsp::detail
