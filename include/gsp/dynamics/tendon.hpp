#pragma once
#include <gsp/dynamics/detail/wrap.hpp>
#include <gsp/dynamics/kinematics.hpp>

/// Tendons: length, velocity and moment arms J = dlength/dq. Fixed: length = sum of coef q. Spatial: the shortest way through sites and
/// round geoms (MuJoCo's mj_tendon, mju_wrap), whose straight pieces from a point p on one body to a point p' on the next give
/// J = u . (J_p' - J_p), u the unit vector from p to p'. J is stored for the dofs that can move the tendon alone.
namespace gsp {

namespace detail {
/// Pose, or point, of a site or geom of a list, on the body `ref` (attachment) in the world.
template <class L, class State, class R, class Bodies>
KOKKOS_INLINE_FUNCTION auto lanes_object_pose(L const& l, State const& state, int ref, int const (&item)[L::W], Field<R> const& pos,
                                              Field<R> const& quat, Bodies const& body_of, bool point_only = false) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  Transform<T> const own{l.constant3(pos, item, 0), point_only ? identity_quat<T>() : l.constant4(quat, item, 0)};
  Transform<T> body;
  if (ref >= 0) {
    body = {l.items.vec3(l.at.xpos + 3 * ref), l.items.quat(l.at.xquat + 4 * ref)};
  } else {
    int index[L::W];
    for (int i = 0; i < L::W; ++i) index[i] = body_of(item[i]);
    body = lanes_static_pose(l, state, index, ref == attachment::mocap);
  }
  return Transform<T>{body * own.p, body.q * own.q};
}
template <class L, class State>
KOKKOS_INLINE_FUNCTION auto lanes_site_pose(L const& l, State const& state, int ref, int list, int n, int k, bool point_only = false) {
  int item[L::W];
  l.listed_items(list, n, k, item);
  return lanes_object_pose(l, state, ref, item, l.model.site_pos, l.model.site_quat, l.model.site_body, point_only);
}

/// J (items from `J` on) += cdof . wrench, for the dofs that move an attachment; `last`, `chain` as the archetype lists them.
template <class L, class T>
KOKKOS_INLINE_FUNCTION void lanes_add_to_row(L const& l, int J, int last, int chain, Spatial<T> const& wrench) {
  if (last < 0) return;
  int const adr = l.index(l.a.row_adr, last), n = l.index(l.a.row_adr, last + 1) - adr;
  for (int p = 0; p < n; ++p) {
    int const place = l.index(l.a.chain, chain + p);
    if (place < 0) continue;
    int const dof = l.index(l.a.row_col, adr + p);
    l.items[J + place] = l.items[J + place] + dot(wrench, l.items.spatial(l.at.cdof + 6 * dof));
  }
}
/// The wrench of a force at a point of body `ref` of the tree, about that body's reference point.
template <class L, class T>
KOKKOS_INLINE_FUNCTION Spatial<T> lanes_wrench(L const& l, int ref, Vec3<T> const& point, Vec3<T> const& force) {
  return {cross(point - l.com_of_body(ref), force), force};
}

/// f(dof, J) for every entry of the k-th tendon's moment arm.
template <class L, class F>
KOKKOS_INLINE_FUNCTION void lanes_for_tendon_arm(L const& l, int k, F const& f) {
  auto const& a = l.a;
  for (int e = l.index(a.tendon_termadr, k), end = l.index(a.tendon_termadr, k + 1); e < end; ++e)
    f(l.index(a.jnt_dofadr, l.index(a.term_jnt, e)), l.listed(l.model.term_coef, a.instance_term, a.nterm, e));
  for (int e = l.index(a.tendon_jadr, k), end = l.index(a.tendon_jadr, k + 1); e < end; ++e)
    f(l.index(a.tendon_jdof, e), l.items[l.at.tendon_J + e]);
}
template <class L>
KOKKOS_INLINE_FUNCTION auto lanes_tendon_rate(L const& l, int k, int vector) {  // J times a vector of dofs
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  T sum(0);
  lanes_for_tendon_arm(l, k, [&](int dof, T const& J) { sum = fma(J, l.items[vector + dof], sum); });
  return sum;
}

/// Length of one spatial tendon, along straight pieces between sites and round the geoms that it wraps; pull(j, point, force) for what it
/// would do to what item j of the path is on if it pushed with 1 N.
template <class L, class State, class Pull>
KOKKOS_INLINE_FUNCTION auto lanes_tendon_path(L const& l, State const& state, int k, Pull const& pull) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  int const end = l.index(a.tendon_pathadr, k + 1);
  auto const site = [&](int j) { return lanes_site_pose(l, state, l.index(a.path_ref, j), a.instance_path, a.npath, j, true).p; };
  T length(0), share(1);
  for (int j = l.index(a.tendon_pathadr, k); j < end - 1;) {
    auto const type = WrapType(l.index(a.path_type, j)), next = WrapType(l.index(a.path_type, j + 1));
    if (type == WrapType::pulley || next == WrapType::pulley) {
      if (type == WrapType::pulley) share = T(1) / l.listed(l.model.wrap_divisor, a.instance_path, a.npath, j);
      ++j;
      continue;
    }
    bool const sphere = next == WrapType::sphere, geom = sphere || next == WrapType::cylinder;
    int const other = j + (geom ? 2 : 1);
    Vec3<T> const x0 = site(j), x1 = site(other);
    Vec3<T> const straight = normalized(x1 - x0);
    if (!geom) {
      length = fma(share, norm(x1 - x0), length);
      if (l.index(a.path_ref, j) != l.index(a.path_ref, other)) {
        pull(j, x0, -(share * straight));
        pull(other, x1, share * straight);
      }
    } else {
      int item[L::W];
      l.listed_items(a.instance_path, a.npath, j + 1, item);
      Transform<T> const frame =
          lanes_object_pose(l, state, l.index(a.path_ref, j + 1), item, l.model.geom_pos, l.model.geom_quat, l.model.geom_body);
      int const side = l.index(a.path_side, j + 1);
      auto const local = [&](Vec3<T> const& x) { return rotate_inverse(frame.q, x - frame.p); };
      Vec3<T> side_point{T(0), T(0), T(0)};
      if (side != ArchetypeDescription::no_side)
        side_point = local(lanes_site_pose(l, state, side, a.instance_side, a.npath, j + 1, true).p);
      auto const way = lanes_wrap(local(x0), local(x1), l.constant(l.model.geom_size, item, 0, 3, 0), sphere,
                                  side != ArchetypeDescription::no_side, side_point);
      Vec3<T> const t0 = frame * way.t0, t1 = frame * way.t1;
      Vec3<T> const u0 = select(way.wrapped, normalized(t0 - x0), straight), u1 = select(way.wrapped, normalized(x1 - t1), straight);
      length = fma(share, select(way.wrapped, norm(t0 - x0) + way.length + norm(x1 - t1), norm(x1 - x0)), length);
      pull(j, x0, -(share * u0));
      pull(other, x1, share * u1);
      T const on = select(way.wrapped, share, T(0));
      pull(j + 1, t0, on * u0);
      pull(j + 1, t1, -(on * u1));
    }
    j = other;
  }
  return length;
}

/// Length and moment arm of one spatial tendon.
template <class L, class State>
KOKKOS_INLINE_FUNCTION void lanes_spatial_tendon(L const& l, State const& state, int k) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  int const J = l.at.tendon_J + l.index(a.tendon_jadr, k);
  for (int e = l.index(a.tendon_jadr, k); e < l.index(a.tendon_jadr, k + 1); ++e) l.items[l.at.tendon_J + e] = T(0);
  l.items[l.at.tendon_length + k] = lanes_tendon_path(l, state, k, [&](int j, Vec3<T> const& point, Vec3<T> const& force) {
    int const ref = l.index(a.path_ref, j);
    if (ref >= 0) lanes_add_to_row(l, J, l.index(a.path_last, j), l.index(a.path_chain, j), lanes_wrench(l, ref, point, force));
  });
}

/// Length of one fixed tendon.
template <class L, class State>
KOKKOS_INLINE_FUNCTION void lanes_fixed_tendon(L const& l, State const& state, int k) {
  auto const& a = l.a;
  std::remove_cvref_t<decltype(l.items[0])> length(0);
  for (int e = l.index(a.tendon_termadr, k), end = l.index(a.tendon_termadr, k + 1); e < end; ++e)
    length = fma(l.listed(l.model.term_coef, a.instance_term, a.nterm, e),
                 l.load(state.qpos, l.qpos0, l.index(a.jnt_qposadr, l.index(a.term_jnt, e))), length);
  l.items[l.at.tendon_length + k] = length;
}
/// Those of all fixed tendons of the tree, which hang on qpos alone.
template <class L, class State>
KOKKOS_FORCEINLINE_FUNCTION void lanes_fixed_tendons(L const& l, State const& state) {
  l.each(l.a.ntendon, [&](int k) {
    if (l.index(l.a.tendon_kind, k) == int(TendonKind::fixed)) lanes_fixed_tendon(l, state, k);
  });
}

/// tendon_length, tendon_J, tendon_velocity of all tendons of the tree. After lanes_inertia (and lanes_load_velocity).
template <class L, class State>
KOKKOS_INLINE_FUNCTION void serial_tendons(L const& l, State const& state, bool fixed_are_known) {
  auto const& a = l.a;
  for (int k = 0; k < a.ntendon; ++k) {
    if (l.index(a.tendon_kind, k) != int(TendonKind::fixed))
      lanes_spatial_tendon(l, state, k);
    else if (!fixed_are_known)
      lanes_fixed_tendon(l, state, k);
    l.items[l.at.tendon_velocity + k] = lanes_tendon_rate(l, k, l.at.qvel);
  }
}
/// @param fixed_are_known  lanes_fixed_tendons has found them
template <class L, class State>
KOKKOS_FORCEINLINE_FUNCTION void lanes_tendons(L const& l, State const& state, bool fixed_are_known = false) {
  if (l.a.ntendon > 0) l.single([&](auto const& one) { serial_tendons(one, state, fixed_are_known); });
}

/// to_i += cdof_i . (the wrenches of cfrc of all bodies that dof i moves), for all dofs; cfrc becomes their sums.
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_project_forces(L const& l, int to) {
  auto const& a = l.a;
  auto const& s = l.items;
  for (int b = a.nbody - 1; b >= 0; --b) {
    int const d0 = l.index(a.body_dofadr, b), parent = l.index(a.body_parent, b);
    if (parent == parent_of::none) continue;
    auto const f = s.spatial(l.at.cfrc + 6 * b);
    for (int i = d0, end = d0 + l.index(a.body_dofnum, b); i < end; ++i) s[to + i] = s[to + i] + dot(s.spatial(l.at.cdof + 6 * i), f);
    if (parent >= 0) s.put(l.at.cfrc + 6 * parent, s.spatial(l.at.cfrc + 6 * parent) + f);
  }
}

/// derivative += slope J^T J within the sparsity of M; row(f) gives f(dof, J) for every entry of J.
template <class L, class T, class Row>
KOKKOS_INLINE_FUNCTION void lanes_add_derivative(L const& l, T const& slope, Row const& row) {
  auto const& a = l.a;
  auto const& s = l.items;
  row([&](int i, T const& Ji) {
    T const scaled = slope * Ji;
    row([&](int j, T const& Jj) {
      for (int e = l.index(a.row_adr, i), end = l.index(a.row_adr, i + 1); e < end; ++e) {
        if (l.index(a.row_col, e) != j) continue;
        s[l.at.derivative + e] = fma(scaled, Jj, s[l.at.derivative + e]);
        if (a.derivative == 2) s[l.at.derivative + a.nM + e] = fma(scaled, Jj, s[l.at.derivative + a.nM + e]);
      }
    });
  });
}

/// M += armature J^T J, in M's sparsity (as MuJoCo has it: entries between branches are left out).
template <class L>
KOKKOS_INLINE_FUNCTION void serial_tendon_armature(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  for (int k = 0; k < a.ntendon; ++k) {
    T const armature = l.listed(l.model.tendon_armature, a.instance_tendon, a.ntendon, k);
    lanes_for_tendon_arm(l, k, [&](int row, T const& Ji) {
      T const scaled = armature * Ji;
      lanes_for_tendon_arm(l, k, [&](int column, T const& Jj) {
        for (int e = l.index(a.row_adr, row), end = l.index(a.row_adr, row + 1); e < end; ++e)
          if (l.index(a.row_col, e) == column) s[l.at.mass + e] = fma(scaled, Jj, s[l.at.mass + e]);
      });
    });
  }
}
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_tendon_armature(L const& l) {
  if (l.a.tendon_armature) l.single([](auto const& one) { serial_tendon_armature(one); });
}

/// bias += armature (dJ/dt qvel) J. For a straight piece of length d between points with velocities v, v' and accelerations a, a' at
/// qacc = 0:  dJ/dt qvel = u . (a' - a) + |v' - v - u (u . (v' - v))|^2 / d.  After lanes_bias.
template <class L, class State>
KOKKOS_INLINE_FUNCTION void serial_tendon_bias(L const& l, State const& state) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  struct Motion {
    Vec3<T> x, v, acc;
  };
  Vec3<T> const zero{T(0), T(0), T(0)}, g = l.gravity();
  auto const motion = [&](int j) {
    int const ref = l.index(a.path_ref, j);
    Motion m{lanes_site_pose(l, state, ref, a.instance_path, a.npath, j, true).p, zero, zero};
    if (ref >= 0) {
      Vec3<T> const arm = m.x - l.com_of_body(ref);
      Spatial<T> const v = s.spatial(l.at.cvel + 6 * ref), acc = s.spatial(l.at.cacc + 6 * ref);
      m.v = v.linear + cross(v.angular, arm);
      m.acc = acc.linear + g + cross(acc.angular, arm) + cross(v.angular, m.v);  // cacc has -g in it
    }
    return m;
  };
  for (int k = 0; k < a.ntendon; ++k) {
    if (l.index(a.tendon_kind, k) != int(TendonKind::sites)) continue;  // make_model refuses armature of wrapped tendons
    T rate(0), share(1);
    for (int j = l.index(a.tendon_pathadr, k), end = l.index(a.tendon_pathadr, k + 1); j < end - 1; ++j) {
      auto const type = WrapType(l.index(a.path_type, j)), next = WrapType(l.index(a.path_type, j + 1));
      if (type == WrapType::pulley) share = T(1) / l.listed(l.model.wrap_divisor, a.instance_path, a.npath, j);
      if (type == WrapType::pulley || next == WrapType::pulley || l.index(a.path_ref, j) == l.index(a.path_ref, j + 1)) continue;
      Motion const m0 = motion(j), m1 = motion(j + 1);
      Vec3<T> const d = m1.x - m0.x, u = normalized(d), w = m1.v - m0.v, across = w - dot(u, w) * u;
      T const distance = norm(d);
      rate = fma(share, dot(u, m1.acc - m0.acc) + select(distance > T(1e-15), dot(across, across) / max(distance, T(1e-15)), T(0)), rate);
    }
    T const force = rate * l.listed(l.model.tendon_armature, a.instance_tendon, a.ntendon, k);
    lanes_for_tendon_arm(l, k, [&](int dof, T const& J) { s[l.at.bias + dof] = fma(J, force, s[l.at.bias + dof]); });
  }
}
template <class L, class State>
KOKKOS_FORCEINLINE_FUNCTION void lanes_tendon_bias(L const& l, State const& state) {
  if (l.a.tendon_armature) l.single([&](auto const& one) { serial_tendon_bias(one, state); });
}
}  // namespace detail

}  // namespace gsp
