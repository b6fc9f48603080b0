#pragma once
#include <gsp/dynamics/lanes.hpp>

/// Forward kinematics: joint positions to the world poses of all bodies.
namespace gsp {

namespace detail {
/// Writes xpos, xquat, xanchor, xaxis of the lane's tree. Root bodies hang on static bodies, whose pose is folded into theirs.
///   x_b = x_parent * body pose, then for each joint: slide x += axis (q - q0); hinge, ball R *= rotation, about the anchor; free x = q.
template <class L, class View>
KOKKOS_INLINE_FUNCTION void lanes_kinematics(L const& l, View const& qpos) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  for (int b = 0; b < a.nbody; ++b) {
    int const parent = l.index(a.body_parent, b);
    Vec3<T> p = l.constant3(l.model.body_pos, l.body0, b);
    Quat<T> q = l.constant4(l.model.body_quat, l.body0, b);
    if (parent >= 0) {
      Quat<T> const pq = l.items.quat(l.at.xquat + 4 * parent);
      p = l.items.vec3(l.at.xpos + 3 * parent) + rotate(pq, p);
      q = pq * q;
    }
    int const j0 = l.index(a.body_jntadr, b);
    for (int j = j0, end = j0 + l.index(a.body_jntnum, b); j < end; ++j) {
      int const adr = l.index(a.jnt_qposadr, j);
      auto const type = JointType(l.index(a.jnt_type, j));
      if (type == JointType::free) {
        p = {l.load(qpos, l.qpos0, adr), l.load(qpos, l.qpos0, adr + 1), l.load(qpos, l.qpos0, adr + 2)};
        q = normalized(Quat<T>{l.load(qpos, l.qpos0, adr + 3), l.load(qpos, l.qpos0, adr + 4), l.load(qpos, l.qpos0, adr + 5),
                               l.load(qpos, l.qpos0, adr + 6)});
        l.items.put(l.at.xanchor + 3 * j, p), l.items.put(l.at.xaxis + 3 * j, Vec3<T>{T(0), T(0), T(1)});
        continue;
      }
      Vec3<T> const local_axis = l.constant3(l.model.jnt_axis, l.jnt0, j), local_anchor = l.constant3(l.model.jnt_pos, l.jnt0, j);
      Vec3<T> const axis = rotate(q, local_axis), anchor = p + rotate(q, local_anchor);
      if (type == JointType::slide) {
        p = fma(l.load(qpos, l.qpos0, adr) - l.constant(l.model.qpos0, l.qpos0, adr), axis, p);
      } else {
        if (type == JointType::hinge)
          q = q * axis_angle(local_axis, l.load(qpos, l.qpos0, adr) - l.constant(l.model.qpos0, l.qpos0, adr));
        else
          q = q * normalized(Quat<T>{l.load(qpos, l.qpos0, adr), l.load(qpos, l.qpos0, adr + 1), l.load(qpos, l.qpos0, adr + 2),
                                     l.load(qpos, l.qpos0, adr + 3)});
        p = anchor - rotate(q, local_anchor);
      }
      l.items.put(l.at.xanchor + 3 * j, anchor), l.items.put(l.at.xaxis + 3 * j, axis);
    }
    l.items.put(l.at.xpos + 3 * b, p), l.items.put(l.at.xquat + 4 * b, q);
  }
}

template <class L, class Poses>
KOKKOS_INLINE_FUNCTION void lanes_store_poses(L const& l, Poses const& poses, bool joints = true) {
  for (int b = 0; b < l.a.nbody; ++b) {
    for (int c = 0; c < 3; ++c) l.store(poses.xpos, l.body0, b, l.items[l.at.xpos + 3 * b + c], 3, c);
    for (int c = 0; c < 4; ++c) l.store(poses.xquat, l.body0, b, l.items[l.at.xquat + 4 * b + c], 4, c);
  }
  for (int j = 0; j < l.a.njnt && joints; ++j)
    for (int c = 0; c < 3; ++c) {
      l.store(poses.xanchor, l.jnt0, j, l.items[l.at.xanchor + 3 * j + c], 3, c);
      l.store(poses.xaxis, l.jnt0, j, l.items[l.at.xaxis + 3 * j + c], 3, c);
    }
}
template <class L, class Poses>
KOKKOS_INLINE_FUNCTION void lanes_load_poses(L const& l, Poses const& poses) {
  for (int b = 0; b < l.a.nbody; ++b) {
    for (int c = 0; c < 3; ++c) l.items[l.at.xpos + 3 * b + c] = l.load(poses.xpos, l.body0, b, 3, c);
    for (int c = 0; c < 4; ++c) l.items[l.at.xquat + 4 * b + c] = l.load(poses.xquat, l.body0, b, 4, c);
  }
  for (int j = 0; j < l.a.njnt; ++j)
    for (int c = 0; c < 3; ++c) {
      l.items[l.at.xanchor + 3 * j + c] = l.load(poses.xanchor, l.jnt0, j, 3, c);
      l.items[l.at.xaxis + 3 * j + c] = l.load(poses.xaxis, l.jnt0, j, 3, c);
    }
}

template <class State, class Poses>
struct KinematicsStage {
  State state;
  Poses poses;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    lanes_kinematics(l, state.qpos), lanes_store_poses(l, poses);
  }
};
}  // namespace detail

struct PosesOptions {
  int worlds = 1;
};

/// Poses for `worlds` worlds of the model; bodies fixed to the world get their pose here, once. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
Poses<R, Mem> make_poses(Exec const& exec, Model<R, Mem> const& model, PosesOptions options = {}) {
  expects(options.worlds > 0, "gsp::make_poses: worlds must be positive");
  auto const poses = make_poses<R>(exec, options.worlds, model.nbody, model.njnt);
  auto const fixed = model.static_pose;
  auto const tree = model.body_tree;
  int const nbody = model.nbody;
  Kokkos::parallel_for(
      "gsp::dynamics::static_poses", Kokkos::RangePolicy<Exec>(exec, 0, options.worlds * nbody), KOKKOS_LAMBDA(int i) {
        int const w = i / nbody, b = i % nbody;
        if (tree(b) >= 0) return;
        for (int c = 0; c < 3; ++c) poses.xpos(w, b, c) = fixed(7 * b + c);
        for (int c = 0; c < 4; ++c) poses.xquat(w, b, c) = fixed(7 * b + 3 + c);
      });
  return poses;
}

/// World poses of all bodies and joints from state.qpos (MuJoCo's mj_kinematics).
/// @param dynamics  scratch
/// @param poses     out: xpos, xquat (world, body, 3 | 4), xanchor, xaxis (world, joint, 3), in the world frame [m]
/// Cost about 100 flop a body. Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem>
void forward_kinematics(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics,
                        Poses<R, Mem> const& poses) {
  for_lanes("gsp::dynamics::forward_kinematics", exec, model, dynamics,
            detail::KinematicsStage<State<R, Mem>, Poses<R, Mem>>{state, poses});
}

}  // namespace gsp
