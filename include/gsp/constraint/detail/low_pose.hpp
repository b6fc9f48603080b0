#pragma once
#include <gsp/math/quat.hpp>
#include <gsp/model/model.hpp>
#include <gsp/model/state.hpp>

/// What rounding has taken from the pose of a body that floats (State::qpos_low). Poses of bodies are without it: a gap that they give
/// jumps by the last digit of a place or an orientation, and what lies far from the origin, or turns slowly, would never rest in float.
namespace gsp::detail {

/// As a motion of the first six dofs of a tree: along, and about the body's axes, q_low = q x / 2.
template <class R>
struct LowPose {
  R motion[6];
  bool floats;  // else there is none
};
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION LowPose<R> low_pose(Model<R, Mem> const& model, State<R, Mem> const& state, int w, int tree) {
  Archetype const& a = model.archetypes(model.tree_archetype(tree));
  int const* const ints = model.ints.data();
  int const joint = ints[a.dof_jnt];
  LowPose<R> pose{{R(0), R(0), R(0), R(0), R(0), R(0)}, JointType(ints[a.jnt_type + joint]) == JointType::free};
  if (!pose.floats) return pose;
  int const q = ints[a.instance_qpos + model.tree_instance(tree)] + ints[a.jnt_qposadr + joint];
  auto const high = [&](int i) { return state.qpos(w, q + i); };
  auto const low = [&](int i) { return state.qpos_low(w, q + i); };
  Quat<R> const turn = conjugate(Quat<R>{high(3), high(4), high(5), high(6)}) * Quat<R>{low(3), low(4), low(5), low(6)};
  for (int c = 0; c < 3; ++c) pose.motion[c] = low(c);
  pose.motion[3] = R(2) * turn.x;
  pose.motion[4] = R(2) * turn.y;
  pose.motion[5] = R(2) * turn.z;
  return pose;
}

}  // namespace gsp::detail
