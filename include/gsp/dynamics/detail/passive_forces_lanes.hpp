#pragma once
#include <gsp/dynamics/fluid.hpp>

/// Kernels of gsp/dynamics/passive_forces.hpp, where the contract stands.
namespace gsp::detail {

/// k + k1 x + k2 x^2, and its derivative with x in front: d(x (k + k1 x + k2 x^2))/dx = k + 2 k1 x + 3 k2 x^2. Dampers take |v|.
template <class T>
KOKKOS_INLINE_FUNCTION T polynomial(T k, T k1, T k2, T x) {
  return fma(fma(k2, x, k1), x, k);
}
template <class T>
KOKKOS_INLINE_FUNCTION T polynomial_slope(T k, T k1, T k2, T x) {
  return fma(fma(T(3) * k2, x, T(2) * k1), x, k);
}
/// Damping of dof i at its velocity: force per velocity, or the slope of the force.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION auto lanes_damping(L const& l, int i, bool slope) {
  auto const& m = l.model;
  auto const b = l.constant(m.dof_damping, l.dof0, i);
  if (!m.poly_damping) return b;
  auto const b1 = l.constant(m.dof_dampingpoly, l.dof0, i, 2, 0), b2 = l.constant(m.dof_dampingpoly, l.dof0, i, 2, 1);
  auto const v = abs(l.items[l.at.qvel + i]);
  return slope ? polynomial_slope(b, b1, b2, v) : polynomial(b, b1, b2, v);
}
template <class L>
KOKKOS_INLINE_FUNCTION auto lanes_tendon_damping(L const& l, int k, bool slope) {
  auto const& m = l.model;
  auto const get = [&](auto const& f, int n, int c) { return l.listed(f, l.a.instance_tendon, l.a.ntendon, k, n, c); };
  auto const b = get(m.tendon_damping, 1, 0);
  if (!m.poly_damping) return b;
  auto const b1 = get(m.tendon_dampingpoly, 2, 0), b2 = get(m.tendon_dampingpoly, 2, 1), v = abs(l.items[l.at.tendon_velocity + k]);
  return slope ? polynomial_slope(b, b1, b2, v) : polynomial(b, b1, b2, v);
}
/// How far the k-th tendon is beyond the dead band of its spring.
template <class L>
KOKKOS_INLINE_FUNCTION auto lanes_tendon_stretch(L const& l, int k) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const get = [&](int c) { return l.listed(l.model.tendon_lengthspring, l.a.instance_tendon, l.a.ntendon, k, 2, c); };
  T const length = l.items[l.at.tendon_length + k] + lanes_tendon_rate(l, k, l.at.low);
  return max(length - get(1), T(0)) + min(length - get(0), T(0));
}
/// Force of the k-th tendon's spring and damper.
template <class L>
KOKKOS_INLINE_FUNCTION auto lanes_tendon_force(L const& l, int k) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& m = l.model;
  T force(0);
  if (m.springs) {
    auto const get = [&](auto const& f, int n, int c) { return l.listed(f, a.instance_tendon, a.ntendon, k, n, c); };
    T const stretch = lanes_tendon_stretch(l, k), linear = get(m.tendon_stiffness, 1, 0);
    force =
        -(stretch *
          (m.poly_stiffness ? polynomial(linear, get(m.tendon_stiffnesspoly, 2, 0), get(m.tendon_stiffnesspoly, 2, 1), stretch) : linear));
  }
  if (m.dampers) force = fma(-lanes_tendon_damping(l, k, false), l.items[l.at.tendon_velocity + k], force);
  return force;
}
/// -d force / d length, -d force / d velocity of these, as far as they hold back.
template <class T>
struct Slopes {
  T stiffness, damping;
};
template <class L>
KOKKOS_INLINE_FUNCTION auto lanes_tendon_slopes(L const& l, int k) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& m = l.model;
  Slopes<T> slopes{T(0), T(0)};
  if (m.springs) {
    auto const get = [&](auto const& f, int n, int c) { return l.listed(f, a.instance_tendon, a.ntendon, k, n, c); };
    T const stretch = lanes_tendon_stretch(l, k);
    T slope = get(m.tendon_stiffness, 1, 0);
    if (m.poly_stiffness) slope = polynomial_slope(slope, get(m.tendon_stiffnesspoly, 2, 0), get(m.tendon_stiffnesspoly, 2, 1), stretch);
    slopes.stiffness = select(stretch != T(0), max(slope, T(0)), T(0));
  }
  if (m.dampers) slopes.damping = max(lanes_tendon_damping(l, k, true), T(0));
  return slopes;
}
/// Displacement of joint j's spring: one(dof, number) of a hinge or slide, three(first dof, vector) of places and of rotations.
template <class L, class View, class One, class Three>
KOKKOS_FORCEINLINE_FUNCTION void lanes_joint_spring(L const& l, View const& qpos, int j, One const& one, Three const& three) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& m = l.model;
  int q = l.index(a.jnt_qposadr, j), i = l.index(a.jnt_dofadr, j);
  auto const type = JointType(l.index(a.jnt_type, j));
  auto const difference = [&](int c) {
    return (l.load(qpos, l.qpos0, q + c) - l.constant(m.qpos_spring, l.qpos0, q + c)) + l.items[l.at.low + i + c];
  };
  if (type == JointType::hinge || type == JointType::slide) return one(i, difference(0));
  if (type == JointType::free) {
    three(i, Vec3<T>{difference(0), difference(1), difference(2)});
    q += 3;
    i += 3;
  }
  auto const quat = [&](auto const& get) { return normalized(Quat<T>{get(q), get(q + 1), get(q + 2), get(q + 3)}); };
  Quat<T> const rest = quat([&](int e) { return l.constant(m.qpos_spring, l.qpos0, e); }),
                now = quat([&](int e) { return l.load(qpos, l.qpos0, e); });
  three(i, log_rotation(conjugate(rest) * now) + l.items.vec3(l.at.low + i));
}

/// The spatial velocity of every body.
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_body_velocity(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  Vec3<T> const zero{T(0), T(0), T(0)};
  for (int b = 0; b < a.nbody; ++b) {
    int const parent = l.index(a.body_parent, b), d0 = l.index(a.body_dofadr, b);
    Spatial<T> v = parent >= 0 ? s.spatial(l.at.cvel + 6 * parent) : Spatial<T>{zero, zero};
    for (int i = d0, end = d0 + l.index(a.body_dofnum, b); i < end; ++i) v = fma(s[l.at.qvel + i], s.spatial(l.at.cdof + 6 * i), v);
    s.put(l.at.cvel + 6 * b, v);
  }
}

/// Forces that carry a share of each body's weight, at its centre of mass; kept apart, as a joint may count them as an actuator's.
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_gravity_compensation(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  Vec3<T> const g = l.gravity();
  for (int b = 0; b < a.nbody; ++b) {
    if (l.index(a.body_parent, b) == parent_of::none) continue;
    T const share = l.constant(l.model.body_gravcomp, l.body0, b) * l.constant(l.model.body_mass, l.body0, b);
    Vec3<T> const center = s.vec3(l.at.xpos + 3 * b) + rotate(s.quat(l.at.xquat + 4 * b), l.constant3(l.model.body_ipos, l.body0, b));
    s.put(l.at.cfrc + 6 * b, lanes_wrench(l, b, center, -(share * g)));
  }
  for (int i = 0; i < a.nv; ++i) s[l.at.gravcomp + i] = T(0);
  lanes_project_forces(l, l.at.gravcomp);
}

/// What few models have: springs and dampers of tendons, gravity compensation, a fluid.
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_rare_passive(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  auto const& m = l.model;
  if (a.tendon_passive)
    for (int k = 0; k < a.ntendon; ++k) {
      T const force = lanes_tendon_force(l, k);
      lanes_for_tendon_arm(l, k, [&](int i, T const& J) { s[l.at.passive + i] = fma(J, force, s[l.at.passive + i]); });
    }
  if (a.gravcomp) {
    lanes_gravity_compensation(l);
    for (int j = 0; j < a.njnt; ++j) {
      auto const type = JointType(l.index(a.jnt_type, j));
      int const i0 = l.index(a.jnt_dofadr, j), n = type == JointType::free ? 6 : type == JointType::ball ? 3 : 1;
      if (l.index(a.jnt_actgravcomp, j)) continue;  // the actuators take it
      for (int i = i0; i < i0 + n; ++i) s[l.at.passive + i] = s[l.at.passive + i] + s[l.at.gravcomp + i];
    }
  }
  if (a.fluid) {
    lanes_body_velocity(l);
    lanes_fluid(l);
  }
  if (a.derivative == 0 || !m.dampers) return;
  for (int k = 0; k < a.ntendon && a.tendon_passive; ++k)
    lanes_add_derivative(l, -lanes_tendon_damping(l, k, true), [&](auto const& f) { lanes_for_tendon_arm(l, k, f); });
}

/// joint: -x (k + k1 x + k2 x^2), x = q - q_spring, and -v (b + b1 |v| + b2 v^2); ball and free: a vector takes the place of x, and its
/// length that of x in the polynomial. tendon: the spring pulls outside of its dead band; forces reach the joints by J^T.
/// With integrators that need it, derivative gets that of these forces by velocity.
template <class L, class View>
KOKKOS_FORCEINLINE_FUNCTION void lanes_passive(L const& l, View const& qpos) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  auto const& m = l.model;
  l.each_batched(
      a.nv, [&](int i) { return m.dampers ? -(lanes_damping(l, i, false) * s[l.at.qvel + i]) : T(0); },
      [&](int i, T const& f) { s[l.at.passive + i] = f; });
  l.each(m.springs ? a.njnt : 0, [&](int j) {
    T const k = l.constant(m.jnt_stiffness, l.jnt0, j);
    if constexpr (Scalar<typename L::R>)  // (not of duals: the slope by k remains)
      if (!m.poly_stiffness && !any(k != T(0))) return;
    auto const force = [&](T const& x) {
      if (!m.poly_stiffness) return k;
      return polynomial(k, l.constant(m.jnt_stiffnesspoly, l.jnt0, j, 2, 0), l.constant(m.jnt_stiffnesspoly, l.jnt0, j, 2, 1), x);
    };
    lanes_joint_spring(
        l, qpos, j, [&](int i, T const& x) { s[l.at.passive + i] = fma(-force(x), x, s[l.at.passive + i]); },
        [&](int i, Vec3<T> const& x) {
          T const f = force(norm(x));
          for (int c = 0; c < 3; ++c) s[l.at.passive + i + c] = fma(-f, x[c], s[l.at.passive + i + c]);
        });
  });
  if (a.tendon_passive || a.gravcomp || a.fluid) l.single([](auto const& one) { lanes_rare_passive(one); });
  if (a.derivative == 0 || !m.dampers) return;
  l.each(a.nv, [&](int i) {
    int const diagonal = l.index(a.row_adr, i + 1) - 1;
    T const b = lanes_damping(l, i, true);
    s[l.at.derivative + diagonal] = s[l.at.derivative + diagonal] - b;
    if (a.derivative == 2) s[l.at.derivative + a.nM + diagonal] = s[l.at.derivative + a.nM + diagonal] - b;
  });
}

template <class State, class Poses>
struct PassiveStage {
  State state;
  Poses poses;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    lanes_load_velocity(l, state);
    if (l.a.fluid || l.a.gravcomp || l.a.spatial) {
      lanes_load_poses(l, poses);
      lanes_inertia(l);
    }
    lanes_tendons(l, state);
    lanes_passive(l, state.qpos);
  }
};

}  // namespace gsp::detail
