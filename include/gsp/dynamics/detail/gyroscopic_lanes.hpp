#pragma once
#include <gsp/dynamics/mass_matrix.hpp>

/// How the bias forces change with the velocity, for trees that nothing damps: profile stable takes them at the middle of the step.
/// Source: D(q, v) = d bias / d v by Singh, Russo and Wensing, Efficient Analytical Derivatives of Rigid-Body Dynamics Using Spatial Vector
/// Algebra (IEEE RA-L, 2022); in world axes the matrix B of a body has the closed form below.
namespace gsp::detail {

/// Of each dof sigma_j = v_before x S_j + v_after x S_j, v before and after its joint; of each body
///   2 B = v x* I - I (v x) + (I v) xbar* = [W 0; -2 [p]x 0],   W = [w]x (2 I_c - tr(I_c)) - 2 [c]x [p]x,
/// where p = m v_c, I_c about its centre of mass c; then sums over subtrees. After lanes_bias, before the inertias become composite.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_gyroscopic_terms(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  if (!a.gyroscopic) return;
  Vec3<T> const zero{T(0), T(0), T(0)};
  l.down([&](int b) {
    int const parent = l.index(a.body_parent, b);
    if (parent == parent_of::none) return;
    Spatial<T> v = parent >= 0 ? s.spatial(l.at.cvel + 6 * parent) : Spatial<T>{zero, zero};
    int const j0 = l.index(a.body_jntadr, b);
    for (int j = j0, end = j0 + l.index(a.body_jntnum, b); j < end; ++j) {
      int i = l.index(a.jnt_dofadr, j);
      auto const type = JointType(l.index(a.jnt_type, j));
      if (type == JointType::free)
        for (int c = 0; c < 3; ++c, ++i) {
          v = fma(s[l.at.qvel + i], s.spatial(l.at.cdof + 6 * i), v);
          s.put(l.at.gyro_sigma + 6 * i, Spatial<T>{zero, zero});  // world axes do not turn
        }
      int const n = type == JointType::free || type == JointType::ball ? 3 : 1;
      Spatial<T> const before = v;
      for (int c = 0; c < n; ++c) v = fma(s[l.at.qvel + i + c], s.spatial(l.at.cdof + 6 * (i + c)), v);
      for (int c = 0; c < n; ++c) s.put(l.at.gyro_sigma + 6 * (i + c), cross_motion(before + v, s.spatial(l.at.cdof + 6 * (i + c))));
    }
    SpatialInertia<T> const inertia = s.inertia(l.at.cinert + 10 * b);
    Vec3<T> const& c = inertia.center;
    Vec3<T> const p = inertia.mass * (v.linear + cross(v.angular, c));
    T const trace = inertia.xx + inertia.yy + inertia.zz, two(2), along = two * dot(c, p);
    Vec3<T> const x = cross(v.angular, Vec3<T>{two * inertia.xx - trace, two * inertia.xy, two * inertia.xz}) - (two * c.x) * p,
                  y = cross(v.angular, Vec3<T>{two * inertia.xy, two * inertia.yy - trace, two * inertia.yz}) - (two * c.y) * p,
                  z = cross(v.angular, Vec3<T>{two * inertia.xz, two * inertia.yz, two * inertia.zz - trace}) - (two * c.z) * p;
    int const at = l.at.gyro_body + 12 * b;  // W column by column, then p
    s.put(at, Vec3<T>{x.x + along, x.y, x.z});
    s.put(at + 3, Vec3<T>{y.x, y.y + along, y.z});
    s.put(at + 6, Vec3<T>{z.x, z.y, z.z + along});
    s.put(at + 9, p);
  });
  l.up([&](int b) {
    l.children(b, [&](int c) {
      each_batched(
          12, [&](int k) { return s[l.at.gyro_body + 12 * b + k] + s[l.at.gyro_body + 12 * c + k]; },
          [&](int k, T const& sum) { s[l.at.gyro_body + 12 * b + k] = sum; });
    });
  });
}

/// gyro <- D, the lower triangle as M, then the upper by rows of the transpose: for the dof i that dof j moves, or i = j,
///   D_ij = S_i (2 B S_j + I sigma_j),   D_ji = S_j (2 B S_i + I sigma_i),
/// with B and I of all that hangs on dof i. After the inertias have become composite.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_gyroscopic_matrix(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  if (!a.gyroscopic) return;
  l.each(a.nv, [&](int i) {
    int const body = l.index(a.dof_body, i), at = l.at.gyro_body + 12 * body;
    SpatialInertia<T> const inertia = s.inertia(l.at.cinert + 10 * body);
    Spatial<T> const dof = s.spatial(l.at.cdof + 6 * i), force = inertia * dof, own = inertia * s.spatial(l.at.gyro_sigma + 6 * i);
    Vec3<T> const x = s.vec3(at), y = s.vec3(at + 3), z = s.vec3(at + 6), p = s.vec3(at + 9);
    Vec3<T> const turn = dof.angular.x * x + dof.angular.y * y + dof.angular.z * z;
    Spatial<T> const above{own.angular + turn, own.linear - T(2) * cross(p, dof.angular)};
    Vec3<T> const below = Vec3<T>{dot(x, dof.angular), dot(y, dof.angular), dot(z, dof.angular)} - T(2) * cross(dof.linear, p);
    int const row = l.index(a.row_adr, i), n = l.index(a.row_adr, i + 1) - row;
    for (int q = 0; q < n; ++q) {
      int const j = l.index(a.row_col, row + q);
      Spatial<T> const other = s.spatial(l.at.cdof + 6 * j);
      s[l.at.gyro + row + q] = dot(below, other.angular) + dot(s.spatial(l.at.gyro_sigma + 6 * j), force);
      s[l.at.gyro + a.nM + row + q] = dot(other, above);
    }
  });
}

/// x <- A^-1 x, A with the sparsity of M: its lower triangle, and its upper by rows of the transpose. Elimination from the leaves up keeps
/// the sparsity, as for the symmetric factor: row and column k reach the ancestors of k alone. Overwrites both, and inverse (nv).
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_solve_both_triangles(L const& l, int lower, int upper, int inverse_diagonal, int x) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  for (int k = a.nv - 1; k >= 0; --k) {
    int const adr = l.index(a.row_adr, k), n = l.index(a.row_adr, k + 1) - adr;
    T const inverse = T(1) / s[lower + adr + n - 1];
    s[inverse_diagonal + k] = inverse;
    for (int p = 0; p < n - 1; ++p) {
      int const ancestor = l.index(a.row_col, adr + p), row = l.index(a.row_adr, ancestor);
      T const up = s[upper + adr + p] * inverse, down = s[lower + adr + p] * inverse;
      for (int q = 0; q <= p; ++q) s[lower + row + q] = fma(-up, s[lower + adr + q], s[lower + row + q]);
      for (int q = 0; q < p; ++q) s[upper + row + q] = fma(-down, s[upper + adr + q], s[upper + row + q]);
      s[x + ancestor] = fma(-up, s[x + k], s[x + ancestor]);
    }
  }
  for (int k = 0; k < a.nv; ++k) {
    int const adr = l.index(a.row_adr, k), n = l.index(a.row_adr, k + 1) - adr;
    T value = s[x + k];
    for (int p = 0; p < n - 1; ++p) value = fma(-s[lower + adr + p], s[x + l.index(a.row_col, adr + p)], value);
    s[x + k] = value * s[inverse_diagonal + k];
  }
}

/// acceleration <- (M + h B + h^2 K + h/2 D)^-1 acceleration: the bias forces that v and v+ have together, by
///   M (v+ - v) = h (f - bias(v, v+)),   bias(v, v+) = bias(v) + D (v+ - v) / 2,
/// a map that is its own inverse with h and -h: the energy swings and does not grow. Source: Kahan, Unconventional Numerical Methods for
/// Trajectory Calculations (1993); Celledoni, McLachlan, Owren and Quispel, Geometric Properties of Kahan's Method (J. Phys. A, 2013).
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_solve_gyroscopic(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  T const h(l.model.timestep), half = T(0.5) * h;
  int const lower = l.at.gyro_scratch, upper = lower + a.nM, inverse = upper + a.nM;
  for (int e = 0; e < a.nM; ++e) {
    T const m = a.drag ? fma(h, s[l.at.drag + e], s[l.at.mass + e]) : s[l.at.mass + e];
    s[lower + e] = fma(half, s[l.at.gyro + e], m);
    s[upper + e] = fma(half, s[l.at.gyro + a.nM + e], m);
  }
  for (int i = 0; i < a.nv; ++i) {
    int const diagonal = lower + l.index(a.row_adr, i + 1) - 1;
    s[diagonal] = fma(h, fma(h, s[l.at.stiffness + i], s[l.at.damping + i]), s[diagonal]);
  }
  lanes_solve_both_triangles(l, lower, upper, inverse, l.at.acceleration);
}

}  // namespace gsp::detail
