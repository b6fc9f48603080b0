#pragma once
#include <gsp/dynamics/actuator_law.hpp>
#include <gsp/dynamics/passive_forces.hpp>
#include <gsp/dynamics/transmission.hpp>

/// Kernels of gsp/dynamics/actuator_forces.hpp, where the contract stands.
namespace gsp::detail {

/// MuJoCo's muscle curves (docs: "Muscle actuators"): active force -F FL(L) FV(V), passive force -F FP(L), at normalised length L and
/// velocity V. p: range (2), force (< 0: scale / acc0), scale, lmin, lmax, vmax, fpmax, fvmax.
template <class T>
struct Muscle {
  T force, L, V, velocity_scale, lmin, lmax, fpmax, fvmax;
  template <class Get, class Length>
  KOKKOS_INLINE_FUNCTION Muscle(Get const& p, Length const& range, T acc0, T length, T velocity) {
    T const least(1e-15);
    force = select(p(2) < T(0), p(3) / max(least, acc0), p(2));
    T const optimum = (range(1) - range(0)) / max(least, p(1) - p(0));
    L = p(0) + (length - range(0)) / max(least, optimum);
    velocity_scale = T(1) / max(least, optimum * p(6));
    V = velocity * velocity_scale;
    lmin = p(4);
    lmax = p(5);
    fpmax = p(7);
    fvmax = p(8);
  }
  KOKKOS_INLINE_FUNCTION T length_curve() const {  // four parabolas between lmin, the middle to 1, 1, the middle to lmax, lmax
    T const least(1e-15), a = T(0.5) * (lmin + T(1)), b = T(0.5) * (T(1) + lmax);
    T const x0 = (L - lmin) / max(least, a - lmin), x1 = (T(1) - L) / max(least, T(1) - a), x2 = (L - T(1)) / max(least, b - T(1)),
            x3 = (lmax - L) / max(least, lmax - b);
    T const up = select(L <= a, T(0.5) * x0 * x0, T(1) - T(0.5) * x1 * x1),
            down = select(L <= b, T(1) - T(0.5) * x2 * x2, T(0.5) * x3 * x3);
    return select((lmin <= L) && (L <= lmax), select(L <= T(1), up, down), T(0));
  }
  KOKKOS_INLINE_FUNCTION T velocity_curve() const {
    T const y = fvmax - T(1), rest = y - V;
    return select(V <= T(-1), T(0), select(V <= T(0), square(V + T(1)), select(V <= y, fvmax - rest * rest / max(T(1e-15), y), fvmax)));
  }
  KOKKOS_INLINE_FUNCTION T velocity_slope() const {
    T const y = fvmax - T(1);
    return select(V <= T(-1), T(0), select(V <= T(0), T(2) * V + T(2), select(V <= y, T(2) * (y - V) / max(T(1e-15), y), T(0))));
  }
  KOKKOS_INLINE_FUNCTION T gain() const { return -(force * length_curve() * velocity_curve()); }
  KOKKOS_INLINE_FUNCTION T gain_slope() const { return -(force * length_curve() * velocity_slope() * velocity_scale); }
  KOKKOS_INLINE_FUNCTION T bias() const {  // half a parabola up to the middle between 1 and lmax, then straight on
    T const half = T(0.5) * (T(1) + lmax) - T(1), x = (L - T(1)) / max(T(1e-15), half);
    return select(L <= T(1), T(0), -(force * fpmax * select(x <= T(1), T(0.5) * x * x, x - T(0.5))));
  }
};

/// d(activation)/dt of a muscle: first order, faster up than down; the two time constants are blended over a width (Millard et al. 2013).
template <class T>
KOKKOS_INLINE_FUNCTION T muscle_rate(T ctrl, T act, T up, T down, T width) {
  T const excess = clamp(ctrl, T(0), T(1)) - act, slow = fma(T(1.5), clamp(act, T(0), T(1)), T(0.5));
  T const activate = up * slow, deactivate = down / slow, x = clamp(excess / max(width, T(1e-15)) + T(0.5), T(0), T(1));
  T const smooth = x * x * x * fma(T(3) * x, fma(T(2), x, T(-5)), T(10));
  T const tau = select(width < T(1e-15), select(excess > T(0), activate, deactivate), deactivate + (activate - deactivate) * smooth);
  return excess / max(T(1e-15), tau);
}

/// The activation at the end of the step (MuJoCo's mj_nextActivation).
template <class L, class T>
KOKKOS_INLINE_FUNCTION T lanes_next_activation(L const& l, int k, T const& act, T const& rate) {
  auto const& m = l.model;
  auto const get = [&](auto const& field, int n, int c) { return l.listed(field, l.a.instance_act, l.a.nact, k, n, c); };
  T const h(m.timestep);
  T change = h * rate;
  if (l.index(l.a.act_dyn, k) == int(ActuatorDynamics::filter_exact)) {
    T const tau = max(T(1e-15), get(m.act_dyn, 10, 0));
    change = rate * tau * (T(1) - exp(-(h / tau)));
  }
  return clamp(act + change, get(m.act_actrange, 2, 0), get(m.act_actrange, 2, 1));
}

/// Nearest integer (ties to even): adding 1.5 2^52 (2^23) leaves no digits behind the point.
template <class T>
KOKKOS_INLINE_FUNCTION T nearest(T const& x) {
  T const magic(sizeof(real_t<T>) == 4 ? 12582912. : 6755399441055744.);
  return (x + magic) - magic;
}
/// Setpoints of servos of a rotation are taken modulo a full turn, the one nearest to x: to the length, or, of a control that a filter
/// follows, to the activation.
template <class L, class T>
KOKKOS_INLINE_FUNCTION T lanes_wrap_setpoint(L const& l, int k, T const& u, T const& x) {
  int const wrap = l.index(l.a.act_wrap, k);
  if (wrap == 0) return u;
  auto const gear = [&](int c) { return l.listed(l.model.act_gear, l.a.instance_act, l.a.nact, k, 6, c); };
  int const c = wrap == 1 ? 0 : 3;
  T const period = T(6.28318530717958647693) * norm(Vec3<T>{gear(c), gear(c + 1), gear(c + 2)});
  return u - period * nearest((u - x) / max(period, T(1e-15)));
}
template <class L, class T>
KOKKOS_INLINE_FUNCTION T lanes_wrap_setpoint(L const& l, int k, T const& u) {
  return lanes_wrap_setpoint(l, k, u, T(l.items[l.at.act_length + k]));
}

/// The k-th actuator's force before clamping, and the rate of its activation (act_dot). After lanes_transmission. `plain`: without
/// activation, and no muscle.
template <bool plain = false, class L, class State, class Laws>
KOKKOS_FORCEINLINE_FUNCTION auto lanes_actuator(L const& l, State const& state, Laws const& laws, int k) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& m = l.model;
  auto const get = [&](auto const& field, int n, int c) { return l.listed(field, a.instance_act, a.nact, k, n, c); };
  int item[L::W];
  l.listed_items(a.instance_act, a.nact, k, item);
  T u = l.load(state.ctrl, item, 0);
  if (m.clampctrl) u = clamp(u, get(m.act_ctrlrange, 2, 0), get(m.act_ctrlrange, 2, 1));
  T const length = l.items[l.at.act_length + k], velocity = l.items[l.at.act_velocity + k];
  if (int const own = plain ? -1 : l.index(a.act_state, k); own >= 0) {
    auto const dyn = ActuatorDynamics(l.index(a.act_dyn, k));
    int where[L::W];
    for (int i = 0; i < L::W; ++i) where[i] = m.act_state(item[i]);
    T const act = l.load(state.act, where, 0);
    T rate = u;  // integrator
    if (dyn == ActuatorDynamics::filter || dyn == ActuatorDynamics::filter_exact)
      rate = (lanes_wrap_setpoint(l, k, u, act) - act) / max(T(1e-15), get(m.act_dyn, 10, 0));
    else if (dyn == ActuatorDynamics::muscle)
      rate = muscle_rate(u, act, get(m.act_dyn, 10, 0), get(m.act_dyn, 10, 1), get(m.act_dyn, 10, 2));
    if (l.index(a.act_disabled, k)) rate = T(0);
    l.items[l.at.act_dot + own] = rate;
    u = l.index(a.act_early, k) ? lanes_next_activation(l, k, act, rate) : act;
  }
  ActuatorForce<T> f{T(0), T(0), T(0)};
  if (l.index(a.act_disabled, k)) return f;
  T const control = u;
  if constexpr (!plain) u = lanes_wrap_setpoint(l, k, u);
  auto const range = [&](int c) { return get(m.act_lengthrange, 2, c); };
  auto const gain = ActuatorGain(l.index(a.act_gain, k));
  auto const bias = ActuatorBias(l.index(a.act_bias, k));
  if (gain == ActuatorGain::fixed) {
    f.force = get(m.act_gain, 10, 0) * u;
  } else if (gain == ActuatorGain::affine) {
    T const g1 = get(m.act_gain, 10, 1), g2 = get(m.act_gain, 10, 2);
    f.force = fma(g2, velocity, fma(g1, length, get(m.act_gain, 10, 0))) * u;
    f.stiffness = -(g1 * u);
    f.damping = -(g2 * u);
  } else if constexpr (!plain) {
    Muscle<T> const muscle([&](int c) { return get(m.act_gain, 10, c); }, range, get(m.act_acc0, 1, 0), length, velocity);
    f.force = muscle.gain() * u;
    f.damping = -(muscle.gain_slope() * u);
  }
  if (bias == ActuatorBias::affine) {
    T const b1 = get(m.act_bias, 10, 1), b2 = get(m.act_bias, 10, 2);
    f.force = f.force + fma(b2, velocity, fma(b1, length, get(m.act_bias, 10, 0)));
    f.stiffness = f.stiffness - b1;
    f.damping = f.damping - b2;
  } else if constexpr (!plain) {
    if (bias == ActuatorBias::muscle) {
      Muscle<T> const muscle([&](int c) { return get(m.act_bias, 10, c); }, range, get(m.act_acc0, 1, 0), length, velocity);
      f.force = f.force + muscle.bias();
    }
  }
  laws.apply(l, item, k, control, f);
  return f;
}

/// The k-th actuator's force before its limits, and its slopes, for what may be left to rows (stiff_forces_lanes.hpp).
template <class L, class T>
KOKKOS_FORCEINLINE_FUNCTION void lanes_keep_law(L const& l, int k, ActuatorForce<T> const& f) {
  int const at = l.at.act_law + 3 * k;
  l.items[at] = f.force;
  l.items[at + 1] = f.stiffness;
  l.items[at + 2] = f.damping;
}

KOKKOS_INLINE_FUNCTION bool is_of_ball(ActuatorKind kind) { return kind == ActuatorKind::ball || kind == ActuatorKind::ball_in_parent; }
/// t / sin t of a ball joint that is turned by t, at most 8: how much stiffer its servos are taken for a step. Their length, a part of the
/// rotation vector r, changes by J w, not by w, where J has the eigenvalues t/2 cot t/2 +- i t/2 across r. A stiff implicit servo leaves
/// 1 - J / s of an error, which falls for s > t / (2 sin t) alone.
template <class L, class State>
KOKKOS_INLINE_FUNCTION auto lanes_ball_stiffening(L const& l, State const& state, int k) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  int const q = l.index(l.a.jnt_qposadr, l.index(l.a.act_id, k));
  auto const part = [&](int c) { return l.load(state.qpos, l.qpos0, q + c); };
  Quat<T> const turn = normalized(Quat<T>{part(0), part(1), part(2), part(3)});
  T const angle = norm(log_rotation(turn)), sine = T(2) * abs(turn.w) * norm(Vec3<T>{turn.x, turn.y, turn.z});
  return select(angle > T(1e-3), angle / max(sine, T(0.125) * max(angle, T(1e-3))), T(1));
}

/// Scales the forces of all actuators of a tendon so that their sum stays within its actuatorfrcrange.
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_clamp_tendon_actuators(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  auto const drives = [&](int k, int t) { return l.index(a.act_kind, k) == int(ActuatorKind::tendon) && l.index(a.act_id, k) == t; };
  for (int t = 0; t < a.ntendon; ++t) {
    T const lo = l.listed(l.model.tendon_actfrcrange, a.instance_tendon, a.ntendon, t, 2, 0),
            hi = l.listed(l.model.tendon_actfrcrange, a.instance_tendon, a.ntendon, t, 2, 1);
    T total(0);
    for (int k = 0; k < a.nact; ++k)
      if (drives(k, t)) total = total + s[l.at.act_force + k];
    auto const outside = ((total < lo) || (total > hi)) && (total != T(0));
    if (!any(outside)) continue;
    T const scale = select(outside, clamp(total, lo, hi) / select(outside, total, T(1)), T(1));
    for (int k = 0; k < a.nact; ++k) {
      if (!drives(k, t)) continue;
      s[l.at.act_force + k] = scale * s[l.at.act_force + k];
      if (a.derivative) s[l.at.act_slope + k] = select(outside, T(0), s[l.at.act_slope + k]);
    }
  }
}

/// Actuators that each drive a hinge or slide of their own, without activation.
template <class L, class State, class Laws>
KOKKOS_FORCEINLINE_FUNCTION void lanes_plain_actuators(L const& l, State const& state, Laws const& laws) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  auto const& m = l.model;
  l.each(a.nact, [&](int k) {
    lanes_joint_transmission(l, state, k);
    if (!m.actuation) {
      s[l.at.act_force + k] = T(0);
      return;
    }
    auto const get = [&](auto const& field, int n, int c) { return l.listed(field, a.instance_act, a.nact, k, n, c); };
    auto const f = lanes_actuator<true>(l, state, laws, k);
    if (a.stiff) lanes_keep_law(l, k, f);
    T const gear = get(m.act_gear, 6, 0), lo = get(m.act_forcerange, 2, 0), hi = get(m.act_forcerange, 2, 1),
            force = clamp(f.force, lo, hi);
    int const dof = l.index(a.jnt_dofadr, l.index(a.act_id, k));
    auto const inside = (f.force >= lo) && (f.force <= hi);
    s[l.at.act_force + k] = force;
    s[l.at.actuator + dof] = gear * force;
    s[l.at.stiffness + dof] = square(gear) * select(inside, f.stiffness, T(0));
    s[l.at.damping + dof] = square(gear) * select(inside, f.damping, T(0));
    if (a.derivative) s[l.at.act_slope + k] = select((force > lo) && (force < hi), -f.damping, T(0));
  });
}

/// Transmissions and forces of any actuators.
template <class L, class State, class Laws>
KOKKOS_INLINE_FUNCTION void lanes_any_actuators(L const& l, State const& state, Laws const& laws) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  auto const& m = l.model;
  for (int k = 0; k < a.nact; ++k) lanes_transmission(l, state, k);
  for (int k = 0; k < a.nstate; ++k) s[l.at.act_dot + k] = T(0);
  if (!m.actuation || m.nu == 0) {
    for (int k = 0; k < a.nact; ++k) s[l.at.act_force + k] = T(0);
    return;
  }
  auto const get = [&](auto const& field, int k, int n, int c) { return l.listed(field, a.instance_act, a.nact, k, n, c); };
  for (int k = 0; k < a.nact; ++k) {
    auto const f = lanes_actuator(l, state, laws, k);
    if (a.stiff) lanes_keep_law(l, k, f);
    if (a.stiff && is_of_ball(ActuatorKind(l.index(a.act_kind, k))))
      s[l.at.act_law + 3 * k + 1] = lanes_ball_stiffening(l, state, k) * f.stiffness;
    s[l.at.act_force + k] = f.force;
    if (a.derivative) s[l.at.act_slope + k] = -f.damping;
    if (l.index(a.act_kind, k) != int(ActuatorKind::scalar_joint)) continue;
    T const gear = get(m.act_gear, k, 6, 0);
    int const dof = l.index(a.jnt_dofadr, l.index(a.act_id, k));
    auto const inside = (f.force >= get(m.act_forcerange, k, 2, 0)) && (f.force <= get(m.act_forcerange, k, 2, 1));
    s[l.at.stiffness + dof] = fma(square(gear), select(inside, f.stiffness, T(0)), s[l.at.stiffness + dof]);
    s[l.at.damping + dof] = fma(square(gear), select(inside, f.damping, T(0)), s[l.at.damping + dof]);
  }
  if (a.tendon_clamped) lanes_clamp_tendon_actuators(l);
  for (int k = 0; k < a.nact; ++k) {
    T const free = s[l.at.act_force + k], lo = get(m.act_forcerange, k, 2, 0), hi = get(m.act_forcerange, k, 2, 1);
    T const force = clamp(free, lo, hi);
    s[l.at.act_force + k] = force;
    if (a.derivative) s[l.at.act_slope + k] = select((force > lo) && (force < hi), s[l.at.act_slope + k], T(0));
    lanes_for_moment(l, k, [&](int dof, T const& arm) { s[l.at.actuator + dof] = fma(arm, force, s[l.at.actuator + dof]); });
  }
}

/// Transmissions, then forces. Also sums the slopes of the joints' servos into stiffness and damping, for those who take them implicitly,
/// and adds to derivative where the integrator needs it.
template <class L, class State, class Laws>
KOKKOS_FORCEINLINE_FUNCTION void lanes_actuators(L const& l, State const& state, Laws const& laws) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  auto const& m = l.model;
  l.each(a.nv, [&](int i) { s[l.at.actuator + i] = s[l.at.stiffness + i] = s[l.at.damping + i] = T(0); });
  if (a.plain_actuators)
    lanes_plain_actuators(l, state, laws);
  else
    l.single([&](auto const& one) { lanes_any_actuators(one, state, laws); });
  if (!m.actuation || m.nu == 0) return;
  l.each(a.njnt, [&](int j) {
    auto const type = JointType(l.index(a.jnt_type, j));
    int const dof = l.index(a.jnt_dofadr, j);
    if (a.gravcomp && l.index(a.jnt_actgravcomp, j))
      for (int i = dof, n = dof + (type == JointType::free ? 6 : type == JointType::ball ? 3 : 1); i < n; ++i)
        s[l.at.actuator + i] = s[l.at.actuator + i] + s[l.at.gravcomp + i];
    if (type != JointType::hinge && type != JointType::slide) return;
    T const force = s[l.at.actuator + dof], lo = l.constant(m.jnt_actfrcrange, l.jnt0, j, 2, 0),
            hi = l.constant(m.jnt_actfrcrange, l.jnt0, j, 2, 1);
    T const clamped = clamp(force, lo, hi);
    auto const inside = force == clamped;
    s[l.at.actuator + dof] = clamped;
    s[l.at.stiffness + dof] = select(inside, s[l.at.stiffness + dof], T(0));
    s[l.at.damping + dof] = select(inside, s[l.at.damping + dof], T(0));
    if (a.derivative)  // a saturated joint's actuators have no slope (MuJoCo 4.0)
      for (int k = 0; k < a.nact; ++k)
        if (l.index(a.act_kind, k) == int(ActuatorKind::scalar_joint) && l.index(a.act_id, k) == j)
          s[l.at.act_slope + k] = select((force > lo) && (force < hi), s[l.at.act_slope + k], T(0));
  });
  if (a.derivative && a.plain_actuators)
    l.each(a.nact, [&](int k) {
      int const dof = l.index(a.jnt_dofadr, l.index(a.act_id, k)), diagonal = l.at.derivative + l.index(a.row_adr, dof + 1) - 1;
      T const slope = square(l.listed(m.act_gear, a.instance_act, a.nact, k, 6, 0)) * s[l.at.act_slope + k];
      s[diagonal] = s[diagonal] + slope;
      if (a.derivative == 2) s[diagonal + a.nM] = s[diagonal + a.nM] + slope;
    });
  else if (a.derivative)
    l.single([](auto const& one) {
      for (int k = 0; k < one.a.nact; ++k)
        lanes_add_derivative(one, one.items[one.at.act_slope + k], [&](auto const& f) { lanes_for_moment(one, k, f); });
    });
}

template <class State, class Poses, class Laws>
struct ActuatorStage {
  State state;
  Poses poses;
  Laws laws;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    lanes_load_velocity(l, state);
    if (l.a.nmoment > 0 || l.a.spatial) {
      lanes_load_poses(l, poses);
      lanes_inertia(l);
    }
    lanes_tendons(l, state);
    lanes_actuators(l, state, laws);
  }
};

}  // namespace gsp::detail
