#pragma once
#include <gsp/constraint/detail/couple_rows.hpp>
#include <gsp/constraint/impulses.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/solver/detail/row_vectors.hpp>
#include <gsp/solver/solution.hpp>

/// The kernel of `noslip` (solver/noslip.hpp): a thread or a warp a world, island by island.
namespace gsp::detail {

inline constexpr int most_friction_rows = most_element_rows - 1;

/// s <- the least of  s . H s / 2 + g . s  over |s| <= radius, H positive definite. s = -(H + l)^-1 g; where l = 0 is too long, |s| =
/// radius by Newton's method on 1 / |s(l)|, nearly straight and concave, so that it comes from below (More, Sorensen 1983).
template <class R>
KOKKOS_INLINE_FUNCTION void least_in_ball(R const (&H)[most_friction_rows][most_friction_rows], R const* g, int n, R radius, R* s) {
  constexpr int most_steps = 30;  // of which the last ones double the digits
  R const close = R(8) * Kokkos::Experimental::epsilon_v<R>;
  R shift(0), length(0);
  for (int step = 0; step < most_steps; ++step) {
    R L[most_friction_rows][most_friction_rows], q[most_friction_rows];
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) {
        R x = H[i][j] + (i == j ? shift : R(0));
        for (int k = 0; k < j; ++k) x = fma(-L[i][k], L[j][k], x);
        L[i][j] = i == j ? sqrt(max(x, R(0.25) * close * H[i][i])) : x / L[j][j];
      }
    auto const forward = [&](R const* from) {
      for (int i = 0; i < n; ++i) {
        R x = from[i];
        for (int k = 0; k < i; ++k) x = fma(-L[i][k], q[k], x);
        q[i] = x / L[i][i];
      }
    };
    forward(g);
    for (int i = n - 1; i >= 0; --i) {
      R x = -q[i];
      for (int k = i + 1; k < n; ++k) x = fma(-L[k][i], s[k], x);
      s[i] = x / L[i][i];
    }
    R sum(0);
    for (int i = 0; i < n; ++i) sum = fma(s[i], s[i], sum);
    length = sqrt(sum);
    if (!(length > radius * (R(1) + close))) break;
    forward(s);
    R slope(0);  // s . (H + l)^-1 s
    for (int i = 0; i < n; ++i) slope = fma(q[i], q[i], slope);
    shift += sum / slope * (length - radius) / radius;
  }
  if (length > radius)
    for (int i = 0; i < n; ++i) s[i] *= radius / length;
}

template <class R, class Mem>
struct NoslipWorld {
  static constexpr int N = most_friction_rows;
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Solution<R, Mem> solution;
  Progress<Mem> progress;
  int iterations;
  R least_gain;

  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    if (progress.halt()) return;
    each_island(world, rows, world.rank, [&](IslandRows const& e) { sweep(world, e); });
  }

 private:
  template <class World>
  KOKKOS_INLINE_FUNCTION void sweep(World const& world, IslandRows const& e) const {
    int const first = rows.first(world.rank);
    Row<R> const* const row = &rows.row(first);
    R* const z = solution.z.data() + std::int64_t(world.rank) * rows.nv;
    R* const p = impulses.p[impulses.parity()].data() + first;
    R const least = least_gain * (R(e.dofs) / R(rows.nv));
    // The first sweep gains what the softness cost, too: as in MuJoCo.
    R gain = world.template sum<R>(e.count, [&](int k) { return R(0.5) * row[e.row(k)].compliance * square(p[e.row(k)]); });
    for (int sweep = 0; sweep < iterations; ++sweep) {
      for (int k = 0, n; k < e.count; k += n) {
        int const r = e.row(k);
        n = rows.element_rows(first + r);
        for (int b = r; b < r + n; ++b) {
          bool const next = b + 1 < r + n || (n == 1 && k + 1 < e.count && e.row(k + 1) == b + 1 && rows.element_rows(first + b + 1) == 1);
          if (is_edge(row[b]) && next && is_edge(row[b + 1]) && has_segments_of(row[b], row[b + 1])) {
            gain += stick_edges(world, row + b, p + b, z);
            ++b;
            n += b == r + n;
          } else if (row[b].dry && !is_edge(row[b])) {
            gain += stick(world, row[b], p + b, z);
          }
        }
        for (int a = 0; a < n; ++a)
          if (row[r + a].friction_of < 0) gain += stick_in_cone(world, row + r, n, a, p + r, z);
      }
      if (gain < least) break;
      gain = R(0);
    }
  }
  /// Of a pyramid: it pushes alone.
  KOKKOS_INLINE_FUNCTION static bool is_edge(Row<R> const& row) { return row.dry && is_no_bound(row.upper); }
  template <class World>
  KOKKOS_INLINE_FUNCTION R rate(World const& world, Row<R> const& row, R const* z) const {
    return dot_row(world, rows, row, z) + row.bias;
  }
  template <class World>
  KOKKOS_INLINE_FUNCTION R diagonal(World const& world, Row<R> const& row) const {
    R const* const y = rows.Y.data() + row.first_entry;
    return world.template sum<R>(row.segment[0].count + row.segment[1].count, [&](int i) { return square(y[i]); });
  }
  /// One row between its bounds. All three return by how much the cost is less.
  template <class World>
  KOKKOS_FUNCTION R stick(World const& world, Row<R> const& row, R* p, R* z) const {
    world.sync();
    R const A = diagonal(world, row), w = rate(world, row, z), before = *p;
    if (!(A > R(0))) return R(0);
    R const now = clamp(before - w / A, row.lower, row.upper), d = now - before;
    set(world, row, p, before, now, z);
    return -d * fma(R(0.5) * A, d, w);
  }
  /// Two opposing edges, p + y and p - y: their sum is that of the normal.
  template <class World>
  KOKKOS_FUNCTION R stick_edges(World const& world, Row<R> const* row, R* p, R* z) const {
    world.sync();
    R const* const a = rows.Y.data() + row[0].first_entry;
    R const* const b = rows.Y.data() + row[1].first_entry;
    R const A = world.template sum<R>(row[0].segment[0].count + row[0].segment[1].count, [&](int i) { return square(a[i] - b[i]); });
    R const w = rate(world, row[0], z) - rate(world, row[1], z);
    R const p0 = p[0], p1 = p[1], middle = R(0.5) * (p0 + p1), before = R(0.5) * (p0 - p1);
    if (!(A > R(0))) return R(0);
    R const y = clamp(before - w / A, -middle, middle), d = y - before;
    set(world, row[0], p, p0, middle + y, z);
    set(world, row[1], p + 1, p1, middle - y, z);
    return -d * fma(R(0.5) * A, d, w);
  }
  /// All friction of row a of an element of n rows, in s = p / mu, where its ellipsoid is the ball of radius p_a. The diagonal is a little
  /// more than it is, by rounding of its trace: some direction may be one that nothing can move along, and where sweeps come to rest does
  /// not depend on it.
  template <class World>
  KOKKOS_FUNCTION R stick_in_cone(World const& world, Row<R> const* row, int n, int a, R* p, R* z) const {
    int friction[N], m = 0;
    for (int b = 0; b < n; ++b)
      if (row[b].friction_of == a && row[b].mu > R(0)) friction[m++] = b;
    if (m == 0) return R(0);
    world.sync();
    R const* const couplings = rows.Y.data() + row[0].first_entry - couplings_of(n);
    R H[N][N], w[N], g[N], s[N], old[N], before[N], trace(0);
    for (int i = 0; i < m; ++i) {
      Row<R> const& own = row[friction[i]];
      w[i] = own.mu * rate(world, own, z);
      old[i] = p[friction[i]];
      s[i] = before[i] = old[i] / own.mu;
      H[i][i] = square(own.mu) * diagonal(world, own);
      trace += H[i][i];
      for (int j = 0; j < i; ++j)  // friction ascends
        H[i][j] = H[j][i] = own.mu * row[friction[j]].mu * couplings[couplings_of(friction[i]) + friction[j]];
    }
    R const radius = p[a];
    if (!(trace > R(0))) return R(0);
    for (int i = 0; i < m; ++i) H[i][i] += (sizeof(R) == 4 ? R(1e-6) : R(1e-12)) * trace;
    if (radius > R(0)) {
      for (int i = 0; i < m; ++i) {
        g[i] = w[i];
        for (int j = 0; j < m; ++j) g[i] = fma(-H[i][j], before[j], g[i]);
      }
      least_in_ball(H, g, m, radius, s);
    } else {
      for (int i = 0; i < m; ++i) s[i] = R(0);
    }
    R less(0);
    for (int i = 0; i < m; ++i) {
      R sum = w[i];
      for (int j = 0; j < m; ++j) sum = fma(R(0.5) * H[i][j], s[j] - before[j], sum);
      less = fma(before[i] - s[i], sum, less);
    }
    for (int i = 0; i < m; ++i) set(world, row[friction[i]], p + friction[i], old[i], row[friction[i]].mu * s[i], z);
    return less;
  }
  /// p <- now, and z what that makes of it: by the difference of the numbers as they are rounded, so that they stay together.
  template <class World>
  KOKKOS_INLINE_FUNCTION void set(World const& world, Row<R> const& row, R* p, R before, R now, R* z) const {
    world.sync();
    world.single([&] { *p = now; });
    push_row(world, rows, row, z, now - before);
  }
};

}  // namespace gsp::detail
