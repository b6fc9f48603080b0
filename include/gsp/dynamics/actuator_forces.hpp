#pragma once
#include <gsp/dynamics/passive_forces.hpp>

/// Motors and servos without dynamics of their own (MuJoCo's motor, position, velocity, and general with affine bias).
namespace gsp {

namespace detail {
template <class T>
struct ActuatorForce {
  T force, gear;
  T stiffness, damping;  // -d force / d length, velocity; zero where the force is clamped
};

/// force = clamp(gain clamp(ctrl) + b0 + b1 length + b2 velocity), length = gear * (q or tendon length).
template <class L, class State>
KOKKOS_INLINE_FUNCTION auto lanes_actuator(L const& l, State const& state, int k) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& m = l.model;
  auto const get = [&](auto const& field, int n, int c) { return l.listed(field, a.instance_act, a.nact, k, n, c); };
  int item[L::W];
  for (int i = 0; i < (l.uniform ? 1 : L::W); ++i) item[i] = l.index(a.instance_act, l.instance[i] * a.nact + k);
  for (int i = 1; i < L::W && l.uniform; ++i) item[i] = item[0];
  T ctrl = l.load(state.ctrl, item, 0);
  if (m.clampctrl) ctrl = clamp(ctrl, get(m.act_ctrlrange, 2, 0), get(m.act_ctrlrange, 2, 1));
  T const gear = get(m.act_gear, 1, 0);
  int const target = l.index(a.act_id, k);
  T length, velocity;
  if (l.index(a.act_target, k) == 0) {
    length = l.load(state.qpos, l.qpos0, l.index(a.jnt_qposadr, target)), velocity = l.items[l.at.qvel + l.index(a.jnt_dofadr, target)];
  } else {
    length = lanes_tendon(l, target, [&](int j) { return l.load(state.qpos, l.qpos0, l.index(a.jnt_qposadr, j)); });
    velocity = lanes_tendon(l, target, [&](int j) { return l.items[l.at.qvel + l.index(a.jnt_dofadr, j)]; });
  }
  T const b1 = get(m.act_bias, 3, 1), b2 = get(m.act_bias, 3, 2);
  T const free = fma(get(m.act_gain, 1, 0), ctrl, fma(b2, gear * velocity, fma(b1, gear * length, get(m.act_bias, 3, 0))));
  T const force = clamp(free, get(m.act_forcerange, 2, 0), get(m.act_forcerange, 2, 1));
  auto const inside = force == free;
  return ActuatorForce<T>{force, gear, select(inside, -b1, T(0)), select(inside, -b2, T(0))};
}

/// Also sums the slopes of the joints' servos into stiffness and damping, for those who take them implicitly.
template <class L, class State>
KOKKOS_INLINE_FUNCTION void lanes_actuators(L const& l, State const& state) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  auto const& m = l.model;
  for (int i = 0; i < a.nv; ++i) s[l.at.actuator + i] = s[l.at.stiffness + i] = s[l.at.damping + i] = T(0);
  if (!m.actuation || a.nact == 0) return;
  for (int k = 0; k < a.nact; ++k) {
    auto const u = lanes_actuator(l, state, k);
    T const force = u.gear * u.force;
    int const target = l.index(a.act_id, k);
    if (l.index(a.act_target, k) == 0) {
      int const i = l.at.actuator + l.index(a.jnt_dofadr, target);
      s[i] = s[i] + force;
      int const dof = l.index(a.jnt_dofadr, target);
      s[l.at.stiffness + dof] = fma(square(u.gear), u.stiffness, s[l.at.stiffness + dof]);
      s[l.at.damping + dof] = fma(square(u.gear), u.damping, s[l.at.damping + dof]);
    } else {  // a tendon's servo couples branches, which the sparsity of M has no room for: it stays explicit
      for (int e = l.index(a.tendon_termadr, target), end = l.index(a.tendon_termadr, target + 1); e < end; ++e) {
        int const i = l.at.actuator + l.index(a.jnt_dofadr, l.index(a.term_jnt, e));
        s[i] = fma(l.listed(m.term_coef, a.instance_term, a.nterm, e), force, s[i]);
      }
    }
  }
  for (int j = 0; j < a.njnt; ++j) {
    auto const type = JointType(l.index(a.jnt_type, j));
    if (type != JointType::hinge && type != JointType::slide) continue;
    int const dof = l.index(a.jnt_dofadr, j);
    T const force = s[l.at.actuator + dof];
    T const clamped = clamp(force, l.constant(m.jnt_actfrcrange, l.jnt0, j, 2, 0), l.constant(m.jnt_actfrcrange, l.jnt0, j, 2, 1));
    auto const inside = force == clamped;
    s[l.at.actuator + dof] = clamped;
    s[l.at.stiffness + dof] = select(inside, s[l.at.stiffness + dof], T(0));
    s[l.at.damping + dof] = select(inside, s[l.at.damping + dof], T(0));
  }
}

template <class State>
struct ActuatorStage {
  State state;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    lanes_load_velocity(l, state.qvel), lanes_actuators(l, state);
  }
};
}  // namespace detail

/// Actuator forces [N, N m] on every dof at state.ctrl (world, nu), in dynamics.items (`copy_dofs(..., &DynamicsLayout::actuator, out)`).
/// Controls and forces are clamped to their ranges, then the sum at a joint to its actuatorfrcrange. Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem>
void actuator_forces(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics) {
  for_lanes("gsp::dynamics::actuator_forces", exec, model, dynamics, detail::ActuatorStage<State<R, Mem>>{state});
}

}  // namespace gsp
