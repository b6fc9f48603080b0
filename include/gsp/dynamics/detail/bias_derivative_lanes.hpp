#pragma once
#include <gsp/dynamics/mass_matrix.hpp>

/// How the bias forces change with the velocity: for profile stable, which takes those of the middle of the step in trees that nothing
/// damps, and for the implicit integrators of profile mujoco. What few models have stands out of line on a GPU (Lane::seldom).
/// Source: D(q, v) = d bias / d v by Singh, Russo and Wensing, Efficient Analytical Derivatives of Rigid-Body Dynamics Using Spatial Vector
/// Algebra (IEEE RA-L, 2022); in world axes the matrix B of a body has the closed form below.
namespace gsp::detail {

/// True where the integrator takes all of the derivative of body b's forces: always (implicit, stable), or as it is a lone free body
/// (implicitfast).
template <class L>
KOKKOS_INLINE_FUNCTION bool lanes_full_derivative(L const& l, int b) {
  return l.model.profile == Profile::stable || l.model.integrator == Integrator::implicit || l.index(l.a.body_lone, b) != 0;
}

/// Of each dof sigma_j = v_before x S_j + v_after x S_j, v before and after its joint; of each body
///   2 B = v x* I - I (v x) + (I v) xbar* = [W 0; -2 [p]x 0],   W = [w]x (2 I_c - tr(I_c)) - 2 [c]x [p]x,
/// where p = m v_c, I_c about its centre of mass c; then sums over subtrees.
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_velocity_terms(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
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
          s.put(l.at.sigma + 6 * i, Spatial<T>{zero, zero});  // world axes do not turn
        }
      int const n = type == JointType::free || type == JointType::ball ? 3 : 1;
      Spatial<T> const before = v;
      for (int c = 0; c < n; ++c) v = fma(s[l.at.qvel + i + c], s.spatial(l.at.cdof + 6 * (i + c)), v);
      for (int c = 0; c < n; ++c) s.put(l.at.sigma + 6 * (i + c), cross_motion(before + v, s.spatial(l.at.cdof + 6 * (i + c))));
    }
    SpatialInertia<T> const inertia = s.inertia(l.at.cinert + 10 * b);
    Vec3<T> const& c = inertia.center;
    Vec3<T> const p = inertia.mass * (v.linear + cross(v.angular, c));
    T const trace = inertia.xx + inertia.yy + inertia.zz, two(2), along = two * dot(c, p);
    Vec3<T> const x = cross(v.angular, Vec3<T>{two * inertia.xx - trace, two * inertia.xy, two * inertia.xz}) - (two * c.x) * p,
                  y = cross(v.angular, Vec3<T>{two * inertia.xy, two * inertia.yy - trace, two * inertia.yz}) - (two * c.y) * p,
                  z = cross(v.angular, Vec3<T>{two * inertia.xz, two * inertia.yz, two * inertia.zz - trace}) - (two * c.z) * p;
    int const at = l.at.velocity_terms + 12 * b;  // W column by column, then p
    s.put(at, Vec3<T>{x.x + along, x.y, x.z});
    s.put(at + 3, Vec3<T>{y.x, y.y + along, y.z});
    s.put(at + 6, Vec3<T>{z.x, z.y, z.z + along});
    s.put(at + 9, p);
  });
  l.up([&](int b) {
    int const at = l.at.velocity_terms + 12 * b;
    l.children(b, [&](int c) {
      each_batched<12>(
          12, [&](int k) { return s[at + k] + s[l.at.velocity_terms + 12 * c + k]; }, [&](int k, T const& sum) { s[at + k] = sum; });
    });
  });
}

/// derivative <- -D, of the dof i that dof j moves, or i = j, with B and I of all that hangs on dof i,
///   D_ij = S_i (2 B S_j + I sigma_j),   D_ji = S_j (2 B S_i + I sigma_i).
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_velocity_derivative(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  struct Entries {
    T lower, upper;
  };
  l.each(a.nv, [&](int i) {
    int const body = l.index(a.dof_body, i), at = l.at.velocity_terms + 12 * body;
    T const sign(lanes_full_derivative(l, body) ? -1 : 0);
    SpatialInertia<T> const inertia = s.inertia(l.at.cinert + 10 * body);
    Spatial<T> const dof = s.spatial(l.at.cdof + 6 * i), force = inertia * dof, own = inertia * s.spatial(l.at.sigma + 6 * i);
    Vec3<T> const x = s.vec3(at), y = s.vec3(at + 3), z = s.vec3(at + 6), p = s.vec3(at + 9);
    Vec3<T> const turn = dof.angular.x * x + dof.angular.y * y + dof.angular.z * z;
    Spatial<T> const above{own.angular + turn, own.linear - T(2) * cross(p, dof.angular)};
    Vec3<T> const below = Vec3<T>{dot(x, dof.angular), dot(y, dof.angular), dot(z, dof.angular)} - T(2) * cross(dof.linear, p);
    int const row = l.index(a.row_adr, i), n = l.index(a.row_adr, i + 1) - row, entry = l.at.derivative + row;
    each_batched<4>(
        n,
        [&](int q) {
          int const j = l.index(a.row_col, row + q);
          Spatial<T> const other = s.spatial(l.at.cdof + 6 * j);
          return Entries{dot(below, other.angular) + dot(s.spatial(l.at.sigma + 6 * j), force), dot(other, above)};
        },
        [&](int q, Entries const& e) {
          s[entry + q] = sign * e.lower;
          s[entry + a.nM + q] = sign * e.upper;
        });
  });
}

/// What lanes_bias_derivative needs of single bodies: after lanes_bias, before the inertias become composite.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_bias_derivative_terms(L const& l) {
  if (takes_bias_derivative(l.a)) l.seldom([](auto const& rare) { lanes_velocity_terms(rare); });
}
/// derivative <- - d bias / d qvel where it is taken, else 0: the lower triangle as M, then the upper by rows of the transpose. After the
/// inertias have become composite.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_bias_derivative(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  if (takes_bias_derivative(l.a))
    l.seldom([](auto const& rare) { lanes_velocity_derivative(rare); });
  else
    l.each(l.a.derivative * l.a.nM, [&](int e) { l.items[l.at.derivative + e] = T(0); });
}

/// x <- A^-1 x, A with the sparsity of M: its lower triangle, and its upper by rows of the transpose. Elimination from the leaves up keeps
/// the sparsity, as for the symmetric factor: row and column k reach the ancestors of k alone. Overwrites both, and inverse_diagonal (nv).
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_solve_both_triangles(L const& l, int lower, int upper, int inverse_diagonal, int x) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  for (int k = a.nv - 1; k >= 0; --k) {
    int const adr = l.index(a.row_adr, k), n = l.index(a.row_adr, k + 1) - adr;
    T const inverse = T(1) / s[lower + adr + n - 1], own = s[x + k];
    l.each(n - 1, [&](int p) {
      int const ancestor = l.index(a.row_col, adr + p), row = l.index(a.row_adr, ancestor);
      T const up = s[upper + adr + p] * inverse, down = s[lower + adr + p] * inverse;
      each_batched(
          p + 1, [&](int q) { return fma(-up, s[lower + adr + q], s[lower + row + q]); },
          [&](int q, T const& y) { s[lower + row + q] = y; });
      each_batched(
          p, [&](int q) { return fma(-down, s[upper + adr + q], s[upper + row + q]); }, [&](int q, T const& y) { s[upper + row + q] = y; });
      s[x + ancestor] = fma(-up, own, s[x + ancestor]);
    });
    if (l.worker == 0) s[inverse_diagonal + k] = inverse;
  }
  l.sync();
  l.down([&](int b) {
    for (int k = l.index(a.body_dofadr, b), end = k + l.index(a.body_dofnum, b); k < end; ++k) {
      int const adr = l.index(a.row_adr, k), n = l.index(a.row_adr, k + 1) - adr;
      T value = s[x + k];
      for (int p = 0; p < n - 1; ++p) value = fma(-s[lower + adr + p], s[x + l.index(a.row_col, adr + p)], value);
      s[x + k] = value * s[inverse_diagonal + k];
    }
  });
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
  int const lower = l.at.both_triangles, upper = lower + a.nM, inverse = upper + a.nM;
  for (int triangle = 0; triangle < 2; ++triangle)
    l.each_batched(
        a.nM,
        [&](int e) {
          T const m = a.drag ? fma(h, s[l.at.drag + e], s[l.at.mass + e]) : s[l.at.mass + e];
          return fma(-half, s[l.at.derivative + triangle * a.nM + e], m);
        },
        [&](int e, T const& y) { s[lower + triangle * a.nM + e] = y; });
  l.each(a.nv, [&](int i) {
    int const diagonal = lower + l.index(a.row_adr, i + 1) - 1;
    s[diagonal] = fma(h, fma(h, s[l.at.stiffness + i], s[l.at.damping + i]), s[diagonal]);
  });
  lanes_solve_both_triangles(l, lower, upper, inverse, l.at.acceleration);
}

}  // namespace gsp::detail
