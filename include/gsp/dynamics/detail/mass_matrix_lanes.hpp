#pragma once
#include <gsp/dynamics/tendon.hpp>

/// Kernels of gsp/dynamics/mass_matrix.hpp, where the contract stands.
namespace gsp::detail {

/// Centres of mass of the bodies, kept in cinert until those of the roots are known.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_centers(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  l.each(l.a.nbody, [&](int b) {
    if (l.index(l.a.body_parent, b) == parent_of::none) return;
    Vec3<T> const center = s.vec3(l.at.xpos + 3 * b) + rotate(s.quat(l.at.xquat + 4 * b), l.constant3(l.model.body_ipos, l.body0, b));
    s.put(l.at.cinert + 10 * b + 6, center);
  });
}
/// Spatial inertias of the bodies about the centres of mass of their roots, after lanes_centers.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_body_inertias(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  l.each(l.a.nbody, [&](int b) {
    if (l.index(l.a.body_parent, b) == parent_of::none) return;
    Vec3<T> const center = s.vec3(l.at.cinert + 10 * b + 6) - l.com_of_body(b);
    Quat<T> const q = s.quat(l.at.xquat + 4 * b) * l.constant4(l.model.body_iquat, l.body0, b);
    s.put(l.at.cinert + 10 * b,
          spatial_inertia(l.constant(l.model.body_mass, l.body0, b), l.constant3(l.model.body_inertia, l.body0, b), q, center));
  });
}
/// Centres of mass (one a root), spatial inertias of the bodies about them, and cdof.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_inertia(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  lanes_centers(l);
  l.each(a.nroot, [&](int root) {
    Vec3<T> com{T(0), T(0), T(0)};
    T total(0);
    for (int b = 0; b < a.nbody; ++b) {
      if (l.index(a.body_parent, b) == parent_of::none || l.index(a.body_root, b) != root) continue;
      T const mass = l.constant(l.model.body_mass, l.body0, b);
      com = fma(mass, s.vec3(l.at.cinert + 10 * b + 6), com);
      total = total + mass;
    }
    s.put(l.at.com + 3 * root, (T(1) / max(total, T(1e-15))) * com);
  });
  lanes_body_inertias(l);
  Vec3<T> const zero{T(0), T(0), T(0)};
  l.each(a.njnt, [&](int j) {
    int i = l.index(a.jnt_dofadr, j);
    auto const type = JointType(l.index(a.jnt_type, j));
    Vec3<T> const offset = l.com_of_body(l.index(a.jnt_body, j)) - s.vec3(l.at.xanchor + 3 * j);
    if (type == JointType::hinge || type == JointType::slide) {
      Vec3<T> const axis = s.vec3(l.at.xaxis + 3 * j);
      s.put(l.at.cdof + 6 * i, type == JointType::hinge ? Spatial<T>{axis, cross(axis, offset)} : Spatial<T>{zero, axis});
      return;
    }
    if (type == JointType::free) {
      s.put(l.at.cdof + 6 * i, Spatial<T>{zero, {T(1), T(0), T(0)}});
      s.put(l.at.cdof + 6 * i + 6, Spatial<T>{zero, {T(0), T(1), T(0)}});
      s.put(l.at.cdof + 6 * i + 12, Spatial<T>{zero, {T(0), T(0), T(1)}});
      i += 3;
    }
    Mat3<T> const r = to_matrix(s.quat(l.at.xquat + 4 * l.index(a.jnt_body, j)));  // rotations about the body's own axes
    for (int c = 0; c < 3; ++c) {
      Vec3<T> const axis = column(r, c);
      s.put(l.at.cdof + 6 * (i + c), Spatial<T>{axis, cross(axis, offset)});
    }
  });
}

/// cinert <- composite inertias: of each body with all that hangs on it.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_composite(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  l.up([&](int b) {
    if (l.index(l.a.body_child, b) < 0) return;
    SpatialInertia<T> composite = s.inertia(l.at.cinert + 10 * b);
    l.children(b, [&](int c) { composite = composite + s.inertia(l.at.cinert + 10 * c); });
    s.put(l.at.cinert + 10 * b, composite);
  });
}

/// M from cdof and the bodies' inertias, which become composite inertias on the way.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_mass_matrix(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  lanes_composite(l);
  l.each(a.nv, [&](int i) {
    Spatial<T> const f = s.inertia(l.at.cinert + 10 * l.index(a.dof_body, i)) * s.spatial(l.at.cdof + 6 * i);
    int const row = l.index(a.row_adr, i), n = l.index(a.row_adr, i + 1) - row;
    each_batched(
        n, [&](int p) { return dot(s.spatial(l.at.cdof + 6 * l.index(a.row_col, row + p)), f); },
        [&](int p, T const& m) { s[l.at.mass + row + p] = p < n - 1 ? m : m + l.constant(l.model.dof_armature, l.dof0, i); });
  });
}

template <class State, class Poses>
struct MassMatrixStage {
  State state;
  Poses poses;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    lanes_load_poses(l, poses);
    lanes_inertia(l);
    lanes_mass_matrix(l);
    if (l.a.tendon_armature) {
      lanes_load_velocity(l, state);
      lanes_tendons(l, state);
      lanes_tendon_armature(l);
    }
  }
};
template <class View>
struct DenseMassMatrixStage {
  View M;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    auto const& a = l.a;
    for (int i = 0; i < a.nv; ++i)
      for (int e = l.index(a.row_adr, i), end = l.index(a.row_adr, i + 1); e < end; ++e) {
        auto const value = l.items[l.at.mass + e];
        for (int k = 0; k < l.count; ++k) {
          int const r = l.dof0[k] + i, c = l.dof0[k] + l.index(a.row_col, e);
          M(l.world[k], r, c) = M(l.world[k], c, r) = get_lane(value, k);
        }
      }
  }
};

}  // namespace gsp::detail
