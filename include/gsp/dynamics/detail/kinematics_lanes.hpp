#pragma once
#include <gsp/dynamics/lanes.hpp>

/// Kernels of gsp/dynamics/kinematics.hpp, where the contract stands.
namespace gsp::detail {

/// Pose of a body that is fixed to the world or to a mocap body; `body` are world indices, one a lane.
template <class L, class State>
KOKKOS_FORCEINLINE_FUNCTION auto lanes_static_pose(L const& l, State const& state, int const (&body)[L::W], bool on_mocap) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  Field<typename L::R> const fixed{l.model.static_pose.data(), 0};
  auto const get = [&](int c) { return l.constant(fixed, body, 0, 7, c); };
  Transform<T> const own{{get(0), get(1), get(2)}, {get(3), get(4), get(5), get(6)}};
  if (!on_mocap) return own;
  int index[L::W];
  for (int i = 0; i < L::W; ++i) index[i] = l.model.body_mocap(body[i]);
  auto const pos = [&](int c) { return l.load(state.mocap_pos, index, 0, 3, c); };
  auto const quat = [&](int c) { return l.load(state.mocap_quat, index, 0, 4, c); };
  return Transform<T>{{pos(0), pos(1), pos(2)}, normalized(Quat<T>{quat(0), quat(1), quat(2), quat(3)})} * own;
}

/// Writes xpos, xquat, xanchor, xaxis of the lane's tree. The pose of a static parent is folded into that of a root body.
///   x_b = x_parent * body pose, then for each joint: slide x += axis (q - q0); hinge, ball R *= rotation, about the anchor; free x = q.
template <class L, class State>
KOKKOS_FORCEINLINE_FUNCTION void lanes_kinematics(L const& l, State const& state) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& qpos = state.qpos;
  l.down([&](int b) {
    int const parent = l.index(a.body_parent, b);
    Vec3<T> p = l.constant3(l.model.body_pos, l.body0, b);
    Quat<T> q = l.constant4(l.model.body_quat, l.body0, b);
    if (parent >= 0) {
      Quat<T> const pq = l.items.quat(l.at.xquat + 4 * parent);
      p = l.items.vec3(l.at.xpos + 3 * parent) + rotate(pq, p);
      q = pq * q;
    } else if (parent == parent_of::mocap) {
      int body[L::W];
      for (int i = 0; i < L::W; ++i)  // body_pos is in its frame already
        body[i] = l.model.mocap_body(l.model.body_mocap(l.model.body_parent(l.body0[i] + b)));
      Transform<T> const pose = lanes_static_pose(l, state, body, true);
      p = pose * p;
      q = pose.q * q;
    }
    int const j0 = l.index(a.body_jntadr, b);
    for (int j = j0, end = j0 + l.index(a.body_jntnum, b); j < end; ++j) {
      int const adr = l.index(a.jnt_qposadr, j);
      auto const type = JointType(l.index(a.jnt_type, j));
      if (type == JointType::free) {
        p = {l.load(qpos, l.qpos0, adr), l.load(qpos, l.qpos0, adr + 1), l.load(qpos, l.qpos0, adr + 2)};
        q = normalized(Quat<T>{l.load(qpos, l.qpos0, adr + 3), l.load(qpos, l.qpos0, adr + 4), l.load(qpos, l.qpos0, adr + 5),
                               l.load(qpos, l.qpos0, adr + 6)});
        l.items.put(l.at.xanchor + 3 * j, p);
        l.items.put(l.at.xaxis + 3 * j, Vec3<T>{T(0), T(0), T(1)});
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
      l.items.put(l.at.xanchor + 3 * j, anchor);
      l.items.put(l.at.xaxis + 3 * j, axis);
    }
    l.items.put(l.at.xpos + 3 * b, p);
    l.items.put(l.at.xquat + 4 * b, q);
  });
}

/// Velocities, and what rounding took from the positions (State::qpos_low) as a motion of the dofs: poses are of qpos alone, what a length
/// or a gap lacks by it is J low. Of rotations about the body's axes: q_low = q x / 2.
template <class L, class State>
KOKKOS_FORCEINLINE_FUNCTION void lanes_load_velocity(L const& l, State const& state) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  l.each_batched(
      l.a.nv, [&](int i) { return l.load(state.qvel, l.dof0, i); }, [&](int i, auto const& v) { l.items[l.at.qvel + i] = v; });
  l.each(l.a.njnt, [&](int j) {
    int q = l.index(l.a.jnt_qposadr, j), low = l.at.low + l.index(l.a.jnt_dofadr, j);
    auto const type = JointType(l.index(l.a.jnt_type, j));
    if (type == JointType::hinge || type == JointType::slide) {
      l.items[low] = l.load(state.qpos_low, l.qpos0, q);
      return;
    }
    if (type == JointType::free) {
      for (int c = 0; c < 3; ++c) l.items[low + c] = l.load(state.qpos_low, l.qpos0, q + c);
      q += 3;
      low += 3;
    }
    auto const quat = [&](auto const& view) {
      return Quat<T>{l.load(view, l.qpos0, q), l.load(view, l.qpos0, q + 1), l.load(view, l.qpos0, q + 2), l.load(view, l.qpos0, q + 3)};
    };
    Quat<T> const turn = conjugate(quat(state.qpos)) * quat(state.qpos_low);
    l.items.put(low, T(2) * Vec3<T>{turn.x, turn.y, turn.z});
  });
}

template <class L, class Poses>
KOKKOS_FORCEINLINE_FUNCTION void lanes_store_poses(L const& l, Poses const& poses, bool joints = true) {
  auto const any = [](int) { return true; };
  bool const whole = l.a.nroot == 1 && store_block(l, l.at.xpos, 3 * l.a.nbody, poses.xpos, 3 * l.body0[0], any) &&
                     store_block(l, l.at.xquat, 4 * l.a.nbody, poses.xquat, 4 * l.body0[0], any);
  l.each(whole ? 0 : l.a.nbody, [&](int b) {
    if (l.index(l.a.body_parent, b) == parent_of::none) return;
    for (int c = 0; c < 3; ++c) l.store(poses.xpos, l.body0, b, l.items[l.at.xpos + 3 * b + c], 3, c);
    for (int c = 0; c < 4; ++c) l.store(poses.xquat, l.body0, b, l.items[l.at.xquat + 4 * b + c], 4, c);
  });
  if (!joints) return;
  l.each(l.a.njnt, [&](int j) {
    for (int c = 0; c < 3; ++c) {
      l.store(poses.xanchor, l.jnt0, j, l.items[l.at.xanchor + 3 * j + c], 3, c);
      l.store(poses.xaxis, l.jnt0, j, l.items[l.at.xaxis + 3 * j + c], 3, c);
    }
  });
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

template <class L, class State, class Poses>
KOKKOS_FORCEINLINE_FUNCTION void lanes_poses(L const& l, State const& state, Poses const& poses, bool joints = true) {
  lanes_kinematics(l, state);
  lanes_store_poses(l, poses, joints);
}

template <class State, class Poses>
struct KinematicsStage {
  static constexpr int shared_blocks = 4;
  State state;
  Poses poses;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    lanes_poses(l, state, poses);
  }
};

/// Poses of bodies that no joint moves. mocap views empty: those of the model's initial state.
template <class R, class Mem, class View>
struct StaticPoses {
  Model<R, Mem> model;
  Poses<R, Mem> poses;
  View mocap_pos, mocap_quat;
  KOKKOS_FUNCTION void operator()(int i) const {
    int const w = i / model.nbody, b = i % model.nbody;
    if (model.body_tree(b) >= 0) return;
    auto const at = [](auto const& pose, int k) {
      return Transform<R>{{pose(7 * k), pose(7 * k + 1), pose(7 * k + 2)},
                          {pose(7 * k + 3), pose(7 * k + 4), pose(7 * k + 5), pose(7 * k + 6)}};
    };
    Transform<R> t = at(model.static_pose, b);
    if (int const m = model.body_mocap(b); m >= 0) {
      Transform<R> own = at(model.mocap_pose0, m);
      if (mocap_pos.data())
        own = {{mocap_pos(w, m, 0), mocap_pos(w, m, 1), mocap_pos(w, m, 2)},
               {mocap_quat(w, m, 0), mocap_quat(w, m, 1), mocap_quat(w, m, 2), mocap_quat(w, m, 3)}};
      own.q = normalized(own.q);
      t = own * t;
    }
    poses.xpos(w, b, 0) = t.p.x;
    poses.xpos(w, b, 1) = t.p.y;
    poses.xpos(w, b, 2) = t.p.z;
    poses.xquat(w, b, 0) = t.q.w;
    poses.xquat(w, b, 1) = t.q.x;
    poses.xquat(w, b, 2) = t.q.y;
    poses.xquat(w, b, 3) = t.q.z;
  }
};
template <ExecutionSpace Exec, class R, class Mem, class View>
void static_poses(Exec const& exec, Model<R, Mem> const& model, View const& pos, View const& quat, Poses<R, Mem>& poses) {
  Kokkos::parallel_for("gsp::dynamics::static_poses", Kokkos::RangePolicy<Exec>(exec, 0, int(poses.xpos.extent(0)) * model.nbody),
                       StaticPoses<R, Mem, View>{model, poses, pos, quat});
}

}  // namespace gsp::detail
