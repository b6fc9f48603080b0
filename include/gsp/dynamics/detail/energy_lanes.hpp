#pragma once
#include <gsp/dynamics/passive_forces.hpp>
#include <gsp/dynamics/world_lanes.hpp>

/// Kernels of gsp/dynamics/energy.hpp, where the contract stands.
namespace gsp::detail {

/// The integral of x (k + k1 x + k2 x^2).
template <class T>
KOKKOS_INLINE_FUNCTION T polynomial_energy(T k, T k1, T k2, T x) {
  return x * x * fma(fma(T(0.25) * k2, x, T(1. / 3) * k1), x, T(0.5) * k);
}

/// Energies of one tree: weight and springs; 1/2 qvel^T M qvel.
template <class State, class Poses>
struct EnergyStage {
  State state;
  Poses poses;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    auto const& a = l.a;
    auto const& s = l.items;
    auto const& m = l.model;
    T potential(0), kinetic(0);
    Vec3<T> const g = l.gravity();
    for (int b = 0; b < a.nbody; ++b) {
      if (l.index(a.body_parent, b) == parent_of::none) continue;
      auto const x = [&](int c) { return l.load(poses.xpos, l.body0, b, 3, c); };
      auto const q = [&](int c) { return l.load(poses.xquat, l.body0, b, 4, c); };
      Vec3<T> const center = Vec3<T>{x(0), x(1), x(2)} + rotate(Quat<T>{q(0), q(1), q(2), q(3)}, l.constant3(m.body_ipos, l.body0, b));
      potential = potential - l.constant(m.body_mass, l.body0, b) * dot(g, center);
    }
    for (int j = 0; j < a.njnt && m.springs; ++j) {
      auto const add = [&](T const& x) {
        auto const poly = [&](int c) { return l.constant(m.jnt_stiffnesspoly, l.jnt0, j, 2, c); };
        potential = potential + polynomial_energy(l.constant(m.jnt_stiffness, l.jnt0, j), poly(0), poly(1), x);
      };
      lanes_joint_spring(
          l, state.qpos, j, [&](int, T const& x) { add(x); }, [&](int, Vec3<T> const& x) { add(norm(x)); });
    }
    for (int k = 0; k < a.ntendon && m.springs; ++k) {
      auto const get = [&](auto const& f, int n, int c) { return l.listed(f, a.instance_tendon, a.ntendon, k, n, c); };
      potential = potential + polynomial_energy(get(m.tendon_stiffness, 1, 0), get(m.tendon_stiffnesspoly, 2, 0),
                                                get(m.tendon_stiffnesspoly, 2, 1), lanes_tendon_stretch(l, k));
    }
    for (int i = 0; i < a.nv; ++i)
      for (int e = l.index(a.row_adr, i), end = l.index(a.row_adr, i + 1); e < end; ++e) {
        int const c = l.index(a.row_col, e);
        kinetic = fma((c == i ? T(0.5) : T(1)) * s[l.at.mass + e], s[l.at.qvel + i] * s[l.at.qvel + c], kinetic);
      }
    s[l.at.energy] = potential;
    s[l.at.energy + 1] = kinetic;
  }
};
template <class R, class Mem, class View>
struct SumEnergies {
  Model<R, Mem> model;
  Poses<R, Mem> poses;
  Dynamics<R, Mem> dynamics;
  View energy;
  template <class T>
  KOKKOS_FUNCTION void operator()(WorldLane<T> const& l, int) const {
    T potential(0), kinetic(0);
    for (int t = 0; t < model.ntree; ++t) {
      int const at = dynamics.layouts(model.tree_archetype(t)).energy;
      potential = potential + l.item(model, dynamics, t, at);
      kinetic = kinetic + l.item(model, dynamics, t, at + 1);
    }
    Vec3<T> const g = l.constant3(model.gravity, 0);
    for (int b = 1; b < model.nbody; ++b)
      if (model.body_tree(b) < 0)
        potential = potential - l.constant(model.body_mass, b) *
                                    dot(g, l.load3(poses.xpos, b) + rotate(l.load4(poses.xquat, b), l.constant3(model.body_ipos, b)));
    l.store(energy, 0, potential);
    l.store(energy, 1, kinetic);
  }
};

}  // namespace gsp::detail
