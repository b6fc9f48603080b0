#pragma once
#include <gsp/dynamics/bias_forces.hpp>

/// Springs and dampers of joints and fixed tendons (MuJoCo's mj_passive).
namespace gsp {

namespace detail {
/// Length of the tree's k-th tendon, sum of coef * q, or its velocity where `load` gives velocities.
template <class L, class Load>
KOKKOS_INLINE_FUNCTION auto lanes_tendon(L const& l, int k, Load const& load) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  T sum(0);
  for (int e = l.index(l.a.tendon_termadr, k), end = l.index(l.a.tendon_termadr, k + 1); e < end; ++e)
    sum = fma(l.listed(l.model.term_coef, l.a.instance_term, l.a.nterm, e), load(l.index(l.a.term_jnt, e)), sum);
  return sum;
}

/// joint: -k (q - q_spring) - b v; ball and free: the rotation vector of q_spring^-1 q takes the place of the difference.
/// tendon: the spring pulls outside of its dead band; its force reaches the joints by J^T, the coefficients.
template <class L, class View>
KOKKOS_INLINE_FUNCTION void lanes_passive(L const& l, View const& qpos) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  auto const& m = l.model;
  for (int i = 0; i < a.nv; ++i) s[l.at.passive + i] = m.dampers ? -(l.constant(m.dof_damping, l.dof0, i) * s[l.at.qvel + i]) : T(0);
  for (int j = 0; j < a.njnt && m.springs; ++j) {
    int q = l.index(a.jnt_qposadr, j), i = l.at.passive + l.index(a.jnt_dofadr, j);
    auto const type = JointType(l.index(a.jnt_type, j));
    T const k = l.constant(m.jnt_stiffness, l.jnt0, j);
    auto const translation = [&](int c) {
      s[i + c] = fma(-k, l.load(qpos, l.qpos0, q + c) - l.constant(m.qpos_spring, l.qpos0, q + c), s[i + c]);
    };
    if (type == JointType::hinge || type == JointType::slide) {
      translation(0);
      continue;
    }
    if (type == JointType::free) {
      for (int c = 0; c < 3; ++c) translation(c);
      q += 3, i += 3;
    }
    auto const quat = [&](auto const& get) { return normalized(Quat<T>{get(q), get(q + 1), get(q + 2), get(q + 3)}); };
    Quat<T> const rest = quat([&](int e) { return l.constant(m.qpos_spring, l.qpos0, e); }),
                  now = quat([&](int e) { return l.load(qpos, l.qpos0, e); });
    Vec3<T> const difference = log_rotation(conjugate(rest) * now);
    for (int c = 0; c < 3; ++c) s[i + c] = fma(-k, difference[c], s[i + c]);
  }
  for (int k = 0; k < a.ntendon; ++k) {
    T const length = lanes_tendon(l, k, [&](int j) { return l.load(qpos, l.qpos0, l.index(a.jnt_qposadr, j)); });
    T const velocity = lanes_tendon(l, k, [&](int j) { return s[l.at.qvel + l.index(a.jnt_dofadr, j)]; });
    T const lower = l.listed(m.tendon_lengthspring, a.instance_tendon, a.ntendon, k, 2, 0),
            upper = l.listed(m.tendon_lengthspring, a.instance_tendon, a.ntendon, k, 2, 1);
    T const stretch = max(length - upper, T(0)) + min(length - lower, T(0));
    T force(0);
    if (m.springs) force = -(l.listed(m.tendon_stiffness, a.instance_tendon, a.ntendon, k) * stretch);
    if (m.dampers) force = fma(-l.listed(m.tendon_damping, a.instance_tendon, a.ntendon, k), velocity, force);
    for (int e = l.index(a.tendon_termadr, k), end = l.index(a.tendon_termadr, k + 1); e < end; ++e) {
      int const i = l.at.passive + l.index(a.jnt_dofadr, l.index(a.term_jnt, e));
      s[i] = fma(l.listed(m.term_coef, a.instance_term, a.nterm, e), force, s[i]);
    }
  }
}

template <class State>
struct PassiveStage {
  State state;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    lanes_load_velocity(l, state.qvel), lanes_passive(l, state.qpos);
  }
};
}  // namespace detail

/// Spring and damper forces [N, N m] on every dof, in dynamics.items (`copy_dofs(..., &DynamicsLayout::passive, out)`).
/// Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem>
void passive_forces(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics) {
  for_lanes("gsp::dynamics::passive_forces", exec, model, dynamics, detail::PassiveStage<State<R, Mem>>{state});
}

}  // namespace gsp
