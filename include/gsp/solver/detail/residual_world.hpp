#pragma once
#include <gsp/constraint/detail/eliminate_rows.hpp>
#include <gsp/solver/detail/take_element.hpp>

/// The kernel of `residuals` (solver/residual.hpp), where the definitions stand: a thread or a warp a world.
namespace gsp::detail {

/// What one world leaves unsolved.
template <class R>
struct ResidualParts {
  R equality = R(0), complementarity = R(0), friction = R(0), bounds = R(0), cone = R(0), energy = R(0);
};
/// worst <- the greater one. NaN stays.
template <class R>
KOKKOS_INLINE_FUNCTION void raise(R& worst, R x) {
  worst = max_or_nan(worst, x);
}

template <class R, class Mem>
struct ResidualWorld {
  static constexpr int N = most_element_rows;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Kokkos::View<int, Mem> halt;
  View<R**> z_of;
  View<R*> rate, equality, complementarity, friction, bounds, cone, energy;

  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    if (halt()) return;
    int const w = world.rank, first = rows.first(w), count = rows.count(w);
    R* const z = z_of.data() + std::int64_t(w) * rows.nv;
    R const* const p = impulses.p[impulses.parity()].data() + first;
    sum_swept(world, first, count, z, p);
    ResidualParts<R> parts;
    parts.energy = R(0.5) * world.template sum<R>(rows.nv, [&](int i) { return z[i] * z[i]; });
    int gone = 0;
    for (int r = 0, n; r < count; r += n) {
      n = rows.element_rows(first + r);
      Row<R> const* const row = &rows.row(first + r);
      if (row->eliminated) {
        for (int b = 0; b < n; ++b, ++gone) add_eliminated(world, row[b], elimination_of(rows, w, gone), count, p, p[r + b], parts);
      } else if (n == 1) {
        add_element<1>(world, row, n, z, p + r, parts);
      } else if (n == 3) {
        add_element<3>(world, row, n, z, p + r, parts);
      } else {
        add_element<N>(world, row, n, z, p + r, parts);
      }
    }
    world.single([&] {
      R worst = parts.equality;
      raise(worst, parts.complementarity);
      raise(worst, parts.friction);
      rate(w) = worst;
      equality(w) = parts.equality;
      complementarity(w) = parts.complementarity;
      friction(w) = parts.friction;
      bounds(w) = parts.bounds;
      cone(w) = parts.cone;
      energy(w) = parts.energy;
    });
  }

 private:
  /// z = Y^T p of the rows that are not eliminated: what is eliminated has changed their Y and b, and has no part in their z.
  template <class World>
  KOKKOS_INLINE_FUNCTION void sum_swept(World const& world, int first, int count, R* z, R const* p) const {
    world.each(rows.nv, [&](int i) { z[i] = R(0); });
    for (int r = 0; r < count; ++r) {
      world.sync();
      if (p[r] != R(0) && !rows.row(first + r).eliminated) push_row(world, rows, rows.row(first + r), z, p[r]);
    }
    world.sync();
  }
  /// With s = |y_e|^2 + C:   w_e = s p_e + b_e + sum (y . y_e) p   of an eliminated row, and to the energy of what is left of the problem
  /// without it comes  (w_e^2 - b_e^2) / (2 s).
  template <class World>
  KOKKOS_INLINE_FUNCTION void add_eliminated(World const& world, Row<R> const& row, R const* coupling, int count, R const* p, R own,
                                             ResidualParts<R>& parts) const {
    R const sum = world.template sum<R>(count, [&](int q) { return coupling[q] * p[q]; });
    if (!(row.inverse_diagonal > R(0))) return;  // follows from the others
    R const rate = own / row.inverse_diagonal + row.bias + sum;
    raise(parts.equality, abs(rate));
    parts.energy += R(0.5) * row.inverse_diagonal * (rate - row.bias) * (rate + row.bias);
  }
  template <int M, class World>
  KOKKOS_INLINE_FUNCTION void add_element(World const& world, Row<R> const* row, int n, R const* z, R const* p,
                                          ResidualParts<R>& parts) const {
    ElementLaw<R, M> law;
    R w[M], now[M], miss[M];
    take_element<M>(world, rows, row, n, z, p, law, w, now);
    element_misses<M>(law, 0, w, now, [&](int b, R x) { miss[b] = x; });
    bool const convex = rows.profile == Profile::mujoco;
    if (convex)
      for (int a = 0; a < n; ++a) cone_misses(row, n, a, w, now, miss);
    for (int b = 0; b < n; ++b) {
      RowBounds<R> const law_of_row{row[b].lower, row[b].upper, row[b].friction_of};
      R& part = row[b].friction_of >= 0 ? parts.friction : law_of_row.is_free() ? parts.equality : parts.complementarity;
      raise(part, w[b] == w[b] ? miss[b] : w[b]);
      raise(parts.bounds, outside_bounds(row[b], now[b]));
      // 1/2 C p^2 + b p; that of Y comes from z
      parts.energy = fma(now[b], fma(R(0.5) * row[b].compliance, now[b], row[b].bias), parts.energy);
    }
    for (int b = 0; b < n; ++b) raise(parts.cone, convex ? outside_ellipsoid(row, n, b, now) : outside_friction<M>(row, b, now));
  }
  KOKKOS_INLINE_FUNCTION static R outside_bounds(Row<R> const& row, R p) {
    if (row.friction_of >= 0) return row.mu > R(0) ? R(0) : abs(p);
    R const below = row.lower - p, above = p - row.upper;
    R out(0);
    raise(out, below);
    raise(out, above);
    return out;
  }
  /// Friction row b by itself, or b and b + 1 in their ellipse.
  template <int M>
  KOKKOS_INLINE_FUNCTION static R outside_friction(Row<R> const* row, int b, R const* p) {
    if (row[b].friction_of < 0 || !(row[b].mu > R(0)) || (b > 0 && row[b - 1].with_next)) return R(0);
    R out = abs(p[b]) / row[b].mu;
    if (b + 1 < M && row[b].with_next) out = sqrt(square(out) + square(p[b + 1] / row[b + 1].mu));
    out -= abs(p[row[b].friction_of]);
    return out > R(0) || out != out ? out : R(0);
  }
  /// All friction of row a together.
  KOKKOS_INLINE_FUNCTION static R outside_ellipsoid(Row<R> const* row, int n, int a, R const* p) {
    R sum(0);
    for (int b = 0; b < n; ++b)
      if (row[b].friction_of == a && row[b].mu > R(0)) sum += square(p[b] / row[b].mu);
    R const out = sqrt(sum) - (p[a] < R(0) ? R(0) : p[a]);
    return sum > R(0) && !(out <= R(0)) ? out : R(0);
  }
  /// The natural map of normal a and its friction: x = p - w / A, projected on the cone |y_b / mu_b| <= y_a to the nearest y where
  /// distances count as A (y - x)^2 (which |w| is of what sticks). Inside of the cone y = x; where the conditions of y = 0 hold, A_a x_a <=
  /// -|mu_b A_b x_b|, that; else on its surface, with one u >= 0 for all rows,
  ///   y_b = x_b / (1 + k_b u),   k_b = A_a / (A_b mu_b^2),   y_a = |y_b / mu_b|,   (1 - u) y_a = x_a
  /// whose left side falls with u. Sliding asks the normal for w_a > 0, other than where friction follows it (profile stable).
  KOKKOS_INLINE_FUNCTION static void cone_misses(Row<R> const* row, int n, int a, R const* w, R const* p, R* miss) {
    if (!(row[a].inverse_diagonal > R(0))) return;
    R x[N], k[N], radius2(0), polar2(0);  // x / mu; k < 0: no friction of a
    R const normal = fma(-row[a].inverse_diagonal, w[a], p[a]);
    bool any = false;
    for (int b = 0; b < n; ++b) {
      R const mu = row[b].mu, inverse = row[b].inverse_diagonal;
      bool const own = row[b].friction_of == a && mu > R(0) && inverse > R(0);
      x[b] = own ? fma(-inverse, w[b], p[b]) / mu : R(0);
      k[b] = own ? inverse / (row[a].inverse_diagonal * square(mu)) : R(-1);
      any = any || own;
      radius2 += square(x[b]);
      if (own) polar2 += square(x[b] / k[b]);
    }
    if (!any) return;
    auto const radius = [&](R u) {
      R sum(0);
      for (int b = 0; b < n; ++b) sum += square(x[b] / fma(max(k[b], R(0)), u, R(1)));
      return sqrt(sum);
    };
    bool const inside = sqrt(radius2) <= normal, none = !inside && sqrt(polar2) <= -normal;
    R low(0), high(1), u(0);  // of u / (1 + u)
    for (int digit = 0; digit < (inside || none ? 0 : int(8 * sizeof(R))); ++digit) {
      R const middle = R(0.5) * (low + high);
      u = middle / (R(1) - middle);
      bool const before = (R(1) - u) * radius(u) > normal;
      low = before ? middle : low;
      high = before ? high : middle;
      if (R(0.5) * (low + high) <= low || R(0.5) * (low + high) >= high) break;
    }
    miss[a] = abs(p[a] - (inside ? normal : none ? R(0) : radius(u))) / row[a].inverse_diagonal;
    for (int b = 0; b < n; ++b) {
      if (k[b] < R(0)) continue;
      R const y = none ? R(0) : row[b].mu * x[b] / fma(k[b], u, R(1));
      miss[b] = abs(p[b] - y) / row[b].inverse_diagonal;
    }
  }
};

}  // namespace gsp::detail
