#pragma once
#include <gsp/dynamics/detail/bias_derivative_lanes.hpp>
#include <gsp/dynamics/mass_matrix.hpp>

/// Kernels of gsp/dynamics/bias_forces.hpp, where the contract stands.
namespace gsp::detail {

/// True where the tree moves as one rigid body, free or on a ball joint, with whatever stands still in it: the stable profile carries its
/// angular momentum.
template <class L>
KOKKOS_INLINE_FUNCTION bool carries_momentum(L const& l) {
  if (l.model.profile != Profile::stable || l.a.njnt != 1) return false;
  auto const type = JointType(l.index(l.a.jnt_type, 0));
  return type == JointType::free || type == JointType::ball;
}

/// Where no joint accelerates.
struct NoAcceleration {};
/// v_b = v_parent + cdof qdot;  a_b = a_parent + (v x cdof) qdot + cdof qacc;  f_b = I a_b + v_b x* I v_b - external_b, summed towards the
/// root: what a body's parent exerts on it. Needs the bodies' own inertias: call it before lanes_mass_matrix, which makes them composite.
/// @param qacc      qacc(i) of the tree's dofs, or NoAcceleration
/// @param external  external(b, f): f less what acts on a body from outside
template <class L, class Acceleration, class External>
KOKKOS_FORCEINLINE_FUNCTION void lanes_newton_euler(L const& l, bool gravity_only, Acceleration const& qacc, External const& external) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  constexpr bool accelerates = !std::is_same_v<Acceleration, NoAcceleration>;
  Vec3<T> const zero{T(0), T(0), T(0)};
  Vec3<T> const g = l.gravity();
  l.down([&](int b) {
    int const parent = l.index(a.body_parent, b);
    if (parent == parent_of::none) return;
    Spatial<T> v = parent >= 0 ? s.spatial(l.at.cvel + 6 * parent) : Spatial<T>{zero, zero};
    Spatial<T> acc = parent >= 0 ? s.spatial(l.at.cacc + 6 * parent) : Spatial<T>{zero, -g};
    int const j0 = l.index(a.body_jntadr, b);
    for (int j = gravity_only ? a.njnt : j0, end = j0 + l.index(a.body_jntnum, b); j < end; ++j) {
      int i = l.index(a.jnt_dofadr, j);
      auto const type = JointType(l.index(a.jnt_type, j));
      if (type == JointType::free)
        for (int c = 0; c < 3; ++c, ++i) {  // world axes do not turn
          v = fma(s[l.at.qvel + i], s.spatial(l.at.cdof + 6 * i), v);
          if constexpr (accelerates) acc = fma(qacc(i), s.spatial(l.at.cdof + 6 * i), acc);
        }
      Spatial<T> const before = v;  // the three axes of a ball turn with the frame before it moves
      for (int c = 0, n = type == JointType::free || type == JointType::ball ? 3 : 1; c < n; ++c, ++i) {
        Spatial<T> const dof = s.spatial(l.at.cdof + 6 * i);
        T const qdot = s[l.at.qvel + i];
        acc = fma(qdot, cross_motion(before, dof), acc);
        if constexpr (accelerates) acc = fma(qacc(i), dof, acc);
        v = fma(qdot, dof, v);
      }
    }
    SpatialInertia<T> const inertia = s.inertia(l.at.cinert + 10 * b);
    s.put(l.at.cvel + 6 * b, v);
    s.put(l.at.cacc + 6 * b, acc);
    s.put(l.at.cfrc + 6 * b, external(b, inertia * acc + cross_force(v, inertia * v)));
  });
  l.up([&](int b) {
    if (l.index(a.body_child, b) < 0) return;
    Spatial<T> f = s.spatial(l.at.cfrc + 6 * b);
    l.children(b, [&](int c) { f = f + s.spatial(l.at.cfrc + 6 * c); });
    s.put(l.at.cfrc + 6 * b, f);
  });
}
/// bias_i = cdof_i . f_b at zero acceleration.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_bias(L const& l, bool gravity_only = false) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  lanes_newton_euler(l, gravity_only, NoAcceleration{}, [](int, Spatial<T> const& f) { return f; });
  l.each_batched(
      a.nv, [&](int i) { return dot(s.spatial(l.at.cdof + 6 * i), s.spatial(l.at.cfrc + 6 * l.index(a.dof_body, i))); },
      [&](int i, T const& x) { s[l.at.bias + i] = x; });
}

/// The bias that the step takes, with that of tendons' armature: of a tree that carries its momentum gravity alone. What is left out,
/// Coriolis and gyroscopic forces, stays beside it where somebody may read it (`kept`).
template <class L, class State>
KOKKOS_FORCEINLINE_FUNCTION void lanes_bias_of_step(L const& l, State const& state, bool kept) {
  auto const& s = l.items;
  bool const carries = carries_momentum(l);
  for (int pass = carries && kept ? 0 : 1; pass < 2; ++pass) {
    lanes_bias(l, carries && pass == 1);
    lanes_tendon_bias(l, state);
    if (!carries || !kept) continue;
    int const out = l.at.turning_bias, bias = l.at.bias;
    l.each(l.a.nv, [&](int i) { s[out + i] = pass == 0 ? s[bias + i] : s[out + i] - s[bias + i]; });
  }
}
/// All of a dof's bias.
template <class L>
KOKKOS_INLINE_FUNCTION auto whole_bias(L const& l, int i) {
  auto const& s = l.items;
  return carries_momentum(l) ? s[l.at.bias + i] + s[l.at.turning_bias + i] : s[l.at.bias + i];
}

template <class State, class Poses>
struct BiasStage {
  State state;
  Poses poses;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    lanes_load_poses(l, poses);
    lanes_load_velocity(l, state);
    lanes_inertia(l);
    if (l.a.tendon_armature) lanes_tendons(l, state);
    lanes_bias_of_step(l, state, true);
    lanes_bias_derivative_terms(l);
    if (takes_bias_derivative(l.a)) lanes_composite(l);
    lanes_bias_derivative(l);
  }
};
using DofItems = int DynamicsLayout::*;  // one of the vectors of dofs
inline Quantity quantity_of(DofItems item) {
  using L = DynamicsLayout;
  if (item == &L::force) return Quantity::force;
  if (item == &L::passive) return Quantity::passive;
  if (item == &L::actuator) return Quantity::actuator;
  if (item == &L::bias) return Quantity::bias;
  if (item == &L::stiffness || item == &L::damping) return Quantity::implicit;
  if (item == &L::acceleration) return Quantity::acceleration;
  if (item == &L::qvel) return Quantity::velocity;
  if (item == &L::velocity) return Quantity::free_velocity;
  if (item == &L::inverse_diagonal) return Quantity::factor;
  throw std::invalid_argument(
      "gsp::copy_dofs: this item is no vector of dofs that a stage leaves: give force, passive, actuator, bias, stiffness, damping, "
      "acceleration, qvel, velocity or inverse_diagonal");
}
template <class View>
struct CopyDofsStage {
  View out;
  DofItems item;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    bool const bias = item == &DynamicsLayout::bias;
    for (int i = 0; i < l.a.nv; ++i) l.store(out, l.dof0, i, bias ? whole_bias(l, i) : l.items[l.at.*item + i]);
  }
};

}  // namespace gsp::detail
