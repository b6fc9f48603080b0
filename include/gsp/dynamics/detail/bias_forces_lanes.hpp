#pragma once
#include <gsp/dynamics/detail/gyroscopic_lanes.hpp>
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

/// v_b = v_parent + cdof qdot;  a_b = a_parent + (v x cdof) qdot;  f_b = I a_b + v_b x* I v_b, summed towards the root;  bias_i = cdof_i .
/// f. Needs the bodies' own inertias: call it before lanes_mass_matrix, which makes them composite.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_bias(L const& l, bool gravity_only = false) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
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
        for (int c = 0; c < 3; ++c, ++i) v = fma(s[l.at.qvel + i], s.spatial(l.at.cdof + 6 * i), v);  // world axes do not turn
      Spatial<T> const before = v;  // the three axes of a ball turn with the frame before it moves
      for (int c = 0, n = type == JointType::free || type == JointType::ball ? 3 : 1; c < n; ++c, ++i) {
        Spatial<T> const dof = s.spatial(l.at.cdof + 6 * i);
        T const qdot = s[l.at.qvel + i];
        acc = fma(qdot, cross_motion(before, dof), acc);
        v = fma(qdot, dof, v);
      }
    }
    SpatialInertia<T> const inertia = s.inertia(l.at.cinert + 10 * b);
    s.put(l.at.cvel + 6 * b, v);
    s.put(l.at.cacc + 6 * b, acc);
    s.put(l.at.cfrc + 6 * b, inertia * acc + cross_force(v, inertia * v));
  });
  l.up([&](int b) {
    if (l.index(a.body_child, b) < 0) return;
    Spatial<T> f = s.spatial(l.at.cfrc + 6 * b);
    l.children(b, [&](int c) { f = f + s.spatial(l.at.cfrc + 6 * c); });
    s.put(l.at.cfrc + 6 * b, f);
  });
  l.each_batched(
      a.nv, [&](int i) { return dot(s.spatial(l.at.cdof + 6 * i), s.spatial(l.at.cfrc + 6 * l.index(a.dof_body, i))); },
      [&](int i, T const& x) { s[l.at.bias + i] = x; });
}

/// True where the integrator takes all of the derivative of body b's forces: always (implicit), or as it is a lone free body
/// (implicitfast).
template <class L>
KOKKOS_INLINE_FUNCTION bool lanes_full_derivative(L const& l, int b) {
  return l.model.integrator == Integrator::implicit || l.index(l.a.body_lone, b) != 0;
}

/// derivative <- - d bias / d qvel (both triangles), column by column: the recursion of lanes_bias, differentiated in direction k,
///   dv_b = dv_parent + cdof_k,   da_b = da_parent + (dv x cdof) qdot + v x cdof_k,   df_b = I da + dv x* I v + v x* I dv,
/// over the bodies that dof k moves. After lanes_bias, before lanes_mass_matrix.
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_bias_derivative_by_columns(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  Vec3<T> const zero{T(0), T(0), T(0)};
  Spatial<T> const nothing{zero, zero};
  auto const depth = [&](int dof) { return l.index(a.row_adr, dof + 1) - l.index(a.row_adr, dof) - 1; };
  for (int k = 0; k < a.nv; ++k) {
    int const top = l.index(a.dof_body, k);
    if (!lanes_full_derivative(l, top)) continue;
    int end = top + 1;
    while (end < a.nbody && l.index(a.body_parent, end) >= top) ++end;
    for (int b = top; b < end; ++b) {
      int const parent = l.index(a.body_parent, b);
      Spatial<T> v = parent >= 0 ? s.spatial(l.at.cvel + 6 * parent) : nothing;
      Spatial<T> dv = b > top ? s.spatial(l.at.dvel + 6 * parent) : nothing, da = b > top ? s.spatial(l.at.dacc + 6 * parent) : nothing;
      int const j0 = l.index(a.body_jntadr, b);
      for (int j = j0, last = j0 + l.index(a.body_jntnum, b); j < last; ++j) {
        int i = l.index(a.jnt_dofadr, j);
        auto const type = JointType(l.index(a.jnt_type, j));
        if (type == JointType::free)
          for (int c = 0; c < 3; ++c, ++i) {
            Spatial<T> const dof = s.spatial(l.at.cdof + 6 * i);
            v = fma(s[l.at.qvel + i], dof, v);
            if (i == k) dv = dv + dof;
          }
        Spatial<T> const before = v, dbefore = dv;
        for (int c = 0, n = type == JointType::free || type == JointType::ball ? 3 : 1; c < n; ++c, ++i) {
          Spatial<T> const dof = s.spatial(l.at.cdof + 6 * i);
          T const qdot = s[l.at.qvel + i];
          da = fma(qdot, cross_motion(dbefore, dof), da);
          v = fma(qdot, dof, v);
          if (i == k) {
            da = da + cross_motion(before, dof);
            dv = dv + dof;
          }
        }
      }
      SpatialInertia<T> const inertia = s.inertia(l.at.cinert + 10 * b);
      s.put(l.at.dvel + 6 * b, dv);
      s.put(l.at.dacc + 6 * b, da);
      s.put(l.at.cfrc + 6 * b, inertia * da + cross_force(dv, inertia * v) + cross_force(v, inertia * dv));
    }
    for (int b = end - 1; b >= top; --b) {
      Spatial<T> const f = s.spatial(l.at.cfrc + 6 * b);
      int const d0 = l.index(a.body_dofadr, b);
      for (int i = d0, last = d0 + l.index(a.body_dofnum, b); i < last; ++i) {
        T const entry = -dot(s.spatial(l.at.cdof + 6 * i), f);
        if (i >= k) s[l.at.derivative + l.index(a.row_adr, i) + depth(k)] = entry;
        if (i <= k) s[l.at.derivative + a.nM + l.index(a.row_adr, k) + depth(i)] = entry;
      }
      if (b > top) s.put(l.at.cfrc + 6 * l.index(a.body_parent, b), s.spatial(l.at.cfrc + 6 * l.index(a.body_parent, b)) + f);
    }
    Spatial<T> const f = s.spatial(l.at.cfrc + 6 * top);  // what the bodies above carry
    for (int p = 0, adr = l.index(a.row_adr, k); p < depth(k); ++p) {
      int const i = l.index(a.row_col, adr + p);
      if (l.index(a.dof_body, i) != top) s[l.at.derivative + a.nM + adr + p] = -dot(s.spatial(l.at.cdof + 6 * i), f);
    }
  }
}

template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_bias_derivative(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  l.each(l.a.derivative * l.a.nM, [&](int e) { l.items[l.at.derivative + e] = T(0); });
  if (l.a.derivative == 2) l.single([](auto const& one) { lanes_bias_derivative_by_columns(one); });
}

template <class State, class Poses>
struct BiasStage {
  State state;
  Poses poses;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    lanes_load_poses(l, poses);
    lanes_load_velocity(l, state.qvel);
    lanes_inertia(l);
    if (l.a.tendon_armature) lanes_tendons(l, state);
    lanes_bias(l, carries_momentum(l));
    lanes_tendon_bias(l, state);
    lanes_bias_derivative(l);
    if (!l.a.gyroscopic) return;
    lanes_gyroscopic_terms(l);
    lanes_composite(l);
    lanes_gyroscopic_matrix(l);
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
    for (int i = 0; i < l.a.nv; ++i) l.store(out, l.dof0, i, l.items[l.at.*item + i]);
  }
};

}  // namespace gsp::detail
