#pragma once
#include <gsp/dynamics/factor.hpp>
#include <gsp/model/world_values.hpp>

/// Kernels of gsp/dynamics/set_constants.hpp, where the contract stands.
namespace gsp::detail {

/// Initial positions, as lanes load a state: shared by all worlds where the stride is 0.
template <class R>
struct StartView {
  R const* values;
  int stride;
  KOKKOS_INLINE_FUNCTION R const* data() const { return values; }
  KOKKOS_INLINE_FUNCTION int extent(int) const { return stride; }
};
template <class R>
struct StartState {
  StartView<R> qpos, mocap_pos, mocap_quat;
};

/// a^T M^-1 a of a row `a` in the items from `x` on that has entries in row_col[adr .. adr + n) alone, a dof and its ancestors:
/// |D^-1/2 L^-T a|^2, where L^-T fills nothing but the ancestors. The items are lost.
template <class L>
KOKKOS_INLINE_FUNCTION auto lanes_chain_weight(L const& l, int adr, int n, int x) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  T sum(0);
  for (int p = n - 1; p >= 0; --p) {
    int const k = l.index(l.a.row_col, adr + p), row = l.at.factor + l.index(l.a.row_adr, k);
    T const value = s[x + k];
    sum = fma(value * value, s[l.at.inverse_diagonal + k], sum);
    for (int q = 0; q < p; ++q) {
      int const i = x + l.index(l.a.row_col, adr + q);
      s[i] = fma(-s[row + q], value, s[i]);
    }
  }
  return sum;
}
/// The same for any row.
template <class L>
KOKKOS_INLINE_FUNCTION auto lanes_row_weight(L const& l, int x) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  lanes_solve_transposed(l, x);
  T sum(0);
  for (int i = 0; i < l.a.nv; ++i) sum = fma(l.items[x + i] * l.items[x + i], l.items[l.at.inverse_diagonal + i], sum);
  return sum;
}

template <class R, class Mem, class Mask>
struct ConstantsStage {
  R *body_invweight0, *dof_invweight0, *dof_M0, *tendon_invweight0, *tendon_length0, *act_acc0;
  Mask mask;

  template <class L, class T>
  KOKKOS_INLINE_FUNCTION void put(L const& l, R* out, int row, int const* first, int i, T const& x, int components = 1,
                                  int component = 0) const {
    for (int k = 0; k < l.count; ++k)
      if (mask(l.world[k])) out[std::int64_t(l.world[k]) * row + (first[k] + i) * components + component] = get_lane(x, k);
  }

  template <class L>
  KOKKOS_INLINE_FUNCTION void bodies(L const& l) const {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    auto const& a = l.a;
    auto const& s = l.items;
    int const x = l.at.acceleration, row = 2 * l.model.nbody;
    for (int b = 0; b < a.nbody; ++b) {
      if (l.index(a.body_parent, b) == parent_of::none) continue;
      int mover = b;
      while (l.index(a.body_dofnum, mover) == 0) mover = l.index(a.body_parent, mover);  // a tree's root has dofs
      int const last = l.index(a.body_dofadr, mover) + l.index(a.body_dofnum, mover) - 1;
      int const adr = l.index(a.row_adr, last), n = l.index(a.row_adr, last + 1) - adr;
      Vec3<T> const point =
          s.vec3(l.at.xpos + 3 * b) + rotate(s.quat(l.at.xquat + 4 * b), l.constant3(l.model.body_ipos, l.body0, b)) - l.com_of_body(b);
      T const slider = l.constant(l.model.body_slider, l.body0, b), mass = l.constant(l.model.body_mass, l.body0, b);
      for (int turns = 0; turns < 2; ++turns) {
        T mean(0);
        for (int c = 0; c < 3; ++c) {
          for (int p = 0; p < n; ++p) {
            int const i = l.index(a.row_col, adr + p);
            Spatial<T> const motion = s.spatial(l.at.cdof + 6 * i);
            s[x + i] = turns ? motion.angular[c] : (motion.linear + cross(motion.angular, point))[c];
          }
          mean = mean + lanes_chain_weight(l, adr, n, x);
        }
        mean = (T(1) / T(3)) * mean;
        put(l, body_invweight0, row, l.body0, b, select(slider > T(0), turns ? T(0) : T(1) / max(mass, T(1e-15)), mean), 2, turns);
      }
    }
  }
  template <class L>
  KOKKOS_INLINE_FUNCTION void dofs(L const& l) const {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    auto const& a = l.a;
    auto const& s = l.items;
    int const x = l.at.acceleration, nv = l.model.nv;
    for (int j = 0; j < a.njnt; ++j) {
      auto const type = JointType(l.index(a.jnt_type, j));
      int const first = l.index(a.jnt_dofadr, j), n = type == JointType::free ? 6 : type == JointType::ball ? 3 : 1, group = n == 1 ? 1 : 3;
      int const b = l.index(a.jnt_body, j);
      T const slider = l.constant(l.model.body_slider, l.body0, b), mass = l.constant(l.model.body_mass, l.body0, b);
      for (int g = first; g < first + n; g += group) {  // the three of a translation or a rotation share their mean
        T mean(0);
        for (int i = g; i < g + group; ++i) {
          int const adr = l.index(a.row_adr, i), end = l.index(a.row_adr, i + 1);
          for (int e = adr; e < end; ++e) s[x + l.index(a.row_col, e)] = T(0);
          s[x + i] = T(1);
          mean = mean + lanes_chain_weight(l, adr, end - adr, x);
        }
        mean = T(1) / T(group) * mean;
        for (int i = g; i < g + group; ++i) put(l, dof_invweight0, nv, l.dof0, i, select(slider > T(0), T(1) / max(mass, T(1e-15)), mean));
      }
    }
  }
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    auto const& a = l.a;
    auto const& s = l.items;
    auto const& m = l.model;
    StartState<R> const start{{m.qpos0.data, m.qpos0.stride}, {m.mocap_pos0.data(), 0}, {m.mocap_quat0.data(), 0}};
    for (int i = 0; i < a.nv; ++i) s[l.at.qvel + i] = T(0);
    lanes_kinematics(l, start);
    lanes_inertia(l);
    if (a.ntendon > 0) lanes_tendons(l, start);
    lanes_mass_matrix(l);
    for (int i = 0; i < a.nv; ++i) put(l, dof_M0, m.nv, l.dof0, i, s[l.at.mass + l.index(a.row_adr, i + 1) - 1]);
    lanes_tendon_armature(l);
    lanes_factor(l, [](int) { return T(0); });
    bodies(l);
    dofs(l);
    int const x = l.at.acceleration;
    int item[L::W];
    for (int k = 0; k < a.ntendon; ++k) {
      for (int i = 0; i < a.nv; ++i) s[x + i] = T(0);
      lanes_for_tendon_arm(l, k, [&](int dof, T const& J) { s[x + dof] = s[x + dof] + J; });
      l.listed_items(a.instance_tendon, a.ntendon, k, item);
      put(l, tendon_invweight0, m.ntendon, item, 0, lanes_row_weight(l, x));
      put(l, tendon_length0, m.ntendon, item, 0, s[l.at.tendon_length + k]);
    }
    for (int k = 0; k < a.nact; ++k) lanes_transmission(l, start, k);
    for (int k = 0; k < a.nact; ++k) {
      for (int i = 0; i < a.nv; ++i) s[x + i] = T(0);
      lanes_for_moment(l, k, [&](int dof, T const& J) { s[x + dof] = s[x + dof] + J; });
      lanes_solve(l, x);
      T sum(0);
      for (int i = 0; i < a.nv; ++i) sum = fma(s[x + i], s[x + i], sum);
      l.listed_items(a.instance_act, a.nact, k, item);
      put(l, act_acc0, m.nu, item, 0, sqrt(sum));
    }
  }
};

}  // namespace gsp::detail
