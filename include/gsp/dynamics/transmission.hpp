#pragma once
#include <gsp/dynamics/tendon.hpp>

/// Transmissions: length and velocity of an actuator, and its moment arm dlength/dq (MuJoCo's mj_transmission).
namespace gsp {

namespace detail {
/// f(dof, arm) for every entry of the k-th actuator's moment.
template <class L, class F>
KOKKOS_INLINE_FUNCTION void lanes_for_moment(L const& l, int k, F const& f) {
  auto const& a = l.a;
  auto const kind = ActuatorKind(l.index(a.act_kind, k));
  if (kind == ActuatorKind::scalar_joint) {
    f(l.index(a.jnt_dofadr, l.index(a.act_id, k)), l.listed(l.model.act_gear, a.instance_act, a.nact, k, 6, 0));
  } else if (kind == ActuatorKind::tendon) {
    auto const gear = l.listed(l.model.act_gear, a.instance_act, a.nact, k, 6, 0);
    lanes_for_tendon_arm(l, l.index(a.act_id, k), [&](int dof, auto const& J) { f(dof, gear * J); });
  } else {
    for (int e = l.index(a.act_madr, k), end = l.index(a.act_madr, k + 1); e < end; ++e)
      f(l.index(a.act_mdof, e), l.items[l.at.act_moment + e]);
  }
}

/// A slider-crank: a rod of length r joins the crank's pin to a slider on a line; v: from the slider's origin to the pin, a: the line.
///   length = a.v - sqrt((a.v)^2 + r^2 - v.v)
template <class T>
struct SliderCrank {
  T length;
  Vec3<T> by_v, by_a;  // derivatives
  KOKKOS_INLINE_FUNCTION SliderCrank(Vec3<T> const& v, Vec3<T> const& a, T rod) {
    T const along = dot(a, v), square_root = along * along + rod * rod - dot(v, v);
    auto const reaches = square_root > T(0);
    T const root = sqrt(select(reaches, square_root, T(1))), ratio = T(1) - along / root;
    length = select(reaches, along - root, along);
    by_v = select(reaches, ratio * a + (T(1) / root) * v, a);
    by_a = select(reaches, ratio * v, v);
  }
};

/// act_length and act_velocity of the k-th actuator, which is on a hinge or slide.
template <class L, class State>
KOKKOS_FORCEINLINE_FUNCTION void lanes_joint_transmission(L const& l, State const& state, int k) {
  auto const g = l.listed(l.model.act_gear, l.a.instance_act, l.a.nact, k, 6, 0);
  int const joint = l.index(l.a.act_id, k), dof = l.index(l.a.jnt_dofadr, joint);
  l.items[l.at.act_length + k] = g * (l.load(state.qpos, l.qpos0, l.index(l.a.jnt_qposadr, joint)) + l.items[l.at.low + dof]);
  l.items[l.at.act_velocity + k] = g * l.items[l.at.qvel + dof];
}

/// act_length, act_velocity, act_moment of the k-th actuator. After lanes_tendons.
template <class L, class State>
KOKKOS_INLINE_FUNCTION void lanes_transmission(L const& l, State const& state, int k) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  auto const gear = [&](int c) { return l.listed(l.model.act_gear, a.instance_act, a.nact, k, 6, c); };
  auto const kind = ActuatorKind(l.index(a.act_kind, k));
  int const id = l.index(a.act_id, k);
  if (kind == ActuatorKind::scalar_joint) return lanes_joint_transmission(l, state, k);
  if (kind == ActuatorKind::tendon) {
    T const g = gear(0);
    s[l.at.act_length + k] = g * (s[l.at.tendon_length + id] + lanes_tendon_rate(l, id, l.at.low));
    s[l.at.act_velocity + k] = g * s[l.at.tendon_velocity + id];
    return;
  }
  int const M = l.at.act_moment + l.index(a.act_madr, k), n = l.index(a.act_madr, k + 1) - l.index(a.act_madr, k);
  Vec3<T> const linear{gear(0), gear(1), gear(2)}, angular{gear(3), gear(4), gear(5)};
  T length(0);
  for (int e = 0; e < n; ++e) s[M + e] = T(0);
  if (kind == ActuatorKind::ball || kind == ActuatorKind::ball_in_parent || kind == ActuatorKind::free ||
      kind == ActuatorKind::free_in_parent) {
    bool const ball = kind == ActuatorKind::ball || kind == ActuatorKind::ball_in_parent;
    int const q = l.index(a.jnt_qposadr, id) + (ball ? 0 : 3);
    Quat<T> const turn = normalized(Quat<T>{l.load(state.qpos, l.qpos0, q), l.load(state.qpos, l.qpos0, q + 1),
                                            l.load(state.qpos, l.qpos0, q + 2), l.load(state.qpos, l.qpos0, q + 3)});
    Vec3<T> axis = ball ? linear : angular;
    if (kind == ActuatorKind::ball_in_parent || kind == ActuatorKind::free_in_parent) axis = rotate_inverse(turn, axis);
    if (ball) {
      length = dot(log_rotation(turn), axis);
      s.put(M, axis);
    } else {
      s.put(M, linear);
      s.put(M + 3, axis);  // a free body has no length
    }
  } else if (kind != ActuatorKind::contacts) {
    int const ref1 = l.index(a.act_ref1, k), ref2 = l.index(a.act_ref2, k);
    auto const first = lanes_site_pose(l, state, ref1, a.instance_object1, a.nact, k);
    auto const add = [&](int ref, Vec3<T> const& point, int last, int chain, Vec3<T> const& force, Vec3<T> const& torque) {
      if (ref < 0) return;
      auto wrench = lanes_wrench(l, ref, point, force);
      wrench.angular += torque;
      lanes_add_to_row(l, M, l.index(last, k), l.index(chain, k), wrench);
    };
    auto const add1 = [&](Vec3<T> const& force, Vec3<T> const& torque) { add(ref1, first.p, a.act_last1, a.act_chain1, force, torque); };
    if (kind == ActuatorKind::site) {
      add1(rotate(first.q, linear), rotate(first.q, angular));
    } else {
      auto const second = lanes_site_pose(l, state, ref2, a.instance_object2, a.nact, k);
      auto const add2 = [&](Vec3<T> const& force, Vec3<T> const& torque) { add(ref2, second.p, a.act_last2, a.act_chain2, force, torque); };
      if (kind == ActuatorKind::site_in_reference) {
        length = dot(rotate_inverse(second.q, first.p - second.p), linear) + dot(log_rotation(conjugate(second.q) * first.q), angular);
        Vec3<T> const force = rotate(second.q, linear), torque = rotate(second.q, angular);
        add1(force, torque);
        add2(-force, -torque);
      } else {  // the first site is the crank's pin, the second the slider, along its z axis
        Vec3<T> const line = rotate(second.q, Vec3<T>{T(0), T(0), T(1)}), zero{T(0), T(0), T(0)};
        SliderCrank<T> const crank(first.p - second.p, line, l.listed(l.model.act_cranklength, a.instance_act, a.nact, k));
        length = linear.x * crank.length;
        add1(linear.x * crank.by_v, zero);
        add2(-(linear.x * crank.by_v), linear.x * cross(line, crank.by_a));
      }
    }
  }
  T velocity(0), low(0);
  for (int e = 0; e < n; ++e) {
    int const dof = l.index(a.act_mdof, l.index(a.act_madr, k) + e);
    velocity = fma(s[M + e], s[l.at.qvel + dof], velocity);
    low = fma(s[M + e], s[l.at.low + dof], low);
  }
  bool const has_length = kind == ActuatorKind::ball || kind == ActuatorKind::ball_in_parent || kind == ActuatorKind::site_in_reference ||
                          kind == ActuatorKind::slider_crank;
  if (has_length) length = length + low;
  s[l.at.act_length + k] = length;
  s[l.at.act_velocity + k] = velocity;
}
}  // namespace detail

}  // namespace gsp
