#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <gsp_test_execs.hpp>
#include <limits>

#include "constraint/loop.hpp"
#include "support/kokkos_tools.hpp"

using gsp_test::Loop;

namespace test_types {
/// Random rows over random dofs, fixed by the world, the element and the row: contacts of three rows (a soft normal, two of friction), or
/// single rows between bounds. Laws are random too.
struct RandomRows {
  int n;
  bool contacts;
  int dofs;
  double mu;
  int more;                                                                 // in odd worlds
  KOKKOS_FUNCTION static double random(int world, int k, int row, int i) {  // in [-1, 1)
    std::uint64_t s = 0x9e3779b97f4a7c15u *
                      (1 + std::uint64_t(world) + 1000 * std::uint64_t(k) + 100000 * std::uint64_t(row) + 10000000 * std::uint64_t(i));
    for (int j = 0; j < 4; ++j) s ^= s << 13, s ^= s >> 7, s ^= s << 17;
    return double(s >> 11) / 4503599627370496. - 1;
  }
  KOKKOS_FUNCTION int count(int world) const { return n + (world % 2 ? more : 0); }
  KOKKOS_FUNCTION int rows(int, int) const { return contacts ? 3 : 1; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int world, int k, int row, Row&& J) const {
    for (int i = 0; i < dofs; ++i) J.set_dof(i, random(world, k, row, i));
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<double> law(int world, int k, int row, double, double, double) const {
    return {row == 0 ? 0.02 * (1 + random(world, k, 5, 0)) : 0., row == 0 ? random(world, k, 5, 1) : 0.};
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int k, int row) const {
    if (contacts && row > 0) return {0, 0, 0, mu};
    if (contacts) return {0, 1e300};
    double const a = random(world, k, 6, 0) - 0.5;
    return {a, a + 1.5 * (1 + random(world, k, 6, 1))};
  }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
}  // namespace test_types

namespace {
/// The rows of one world as a dense problem: A = Y Y^T + diag C, w = A p + b.
struct Dense {
  int n = 0;
  std::vector<double> A, b, lower, upper, p;
  std::vector<int> friction_of;
  double w(std::vector<double> const& x, int i) const {
    double sum = b[i];
    for (int j = 0; j < n; ++j) sum += A[i * n + j] * x[j];
    return sum;
  }
  double low(std::vector<double> const& x, int i) const { return friction_of[i] < 0 ? lower[i] : -upper[i] * x[friction_of[i]]; }
  double high(std::vector<double> const& x, int i) const { return friction_of[i] < 0 ? upper[i] : upper[i] * x[friction_of[i]]; }
};

template <class S>
Dense dense(S const& s, int world) {
  auto const row = gsp_test::host(s.rows.row);
  auto const Y = gsp_test::host(s.rows.Y);
  auto const first = gsp_test::host(s.rows.first), count = gsp_test::host(s.rows.count);
  auto const ints = gsp_test::host(s.model.ints);
  auto const p = gsp_test::host(s.rows.impulse[gsp_test::host(s.rows.parity)()]);
  Dense d;
  d.n = count(world);
  std::vector<std::vector<double>> y(d.n, std::vector<double>(s.model.nv, 0.));
  for (int i = 0; i < d.n; ++i) {
    auto const& r = row(first(world) + i);
    std::int64_t at = r.Y;
    for (int k = 0; k < r.segments; ++k)
      for (int e = 0; e < r.segment[k].count; ++e, ++at)
        y[i][r.segment[k].dof0 + (r.segment[k].list < 0 ? e : ints(r.segment[k].list + e))] = Y(at);
    d.b.push_back(r.bias), d.lower.push_back(r.lower), d.upper.push_back(r.upper), d.friction_of.push_back(r.friction_of),
        d.p.push_back(p(first(world) + i));
  }
  d.A.resize(std::size_t(d.n) * d.n);
  for (int i = 0; i < d.n; ++i)
    for (int j = 0; j < d.n; ++j) {
      for (int k = 0; k < s.model.nv; ++k) d.A[i * d.n + j] += y[i][k] * y[j][k];
      if (i == j) d.A[i * d.n + j] += row(first(world) + i).compliance;
    }
  return d;
}

/// Solves M x = r by elimination with pivots; false where M is singular to 1e-9.
bool solve(std::vector<double> M, std::vector<double>& r) {
  int const n = int(r.size());
  for (int k = 0; k < n; ++k) {
    int best = k;
    for (int i = k + 1; i < n; ++i)
      if (std::abs(M[i * n + k]) > std::abs(M[best * n + k])) best = i;
    if (std::abs(M[best * n + k]) < 1e-9) return false;
    for (int j = 0; j < n; ++j) std::swap(M[k * n + j], M[best * n + j]);
    std::swap(r[k], r[best]);
    for (int i = 0; i < n; ++i) {
      double const f = i == k ? 0 : M[i * n + k] / M[k * n + k];
      for (int j = k; j < n && f != 0; ++j) M[i * n + j] -= f * M[k * n + j];
      r[i] -= f * r[k];
    }
  }
  for (int k = 0; k < n; ++k) r[k] /= M[k * n + k];
  return true;
}

/// All solutions: every row is inside (w = 0), at its lower or at its upper bound.
std::vector<std::vector<double>> enumerate(Dense const& d) {
  std::vector<std::vector<double>> solutions;
  int sets = 1;
  for (int i = 0; i < d.n; ++i) sets *= 3;
  for (int set = 0; set < sets; ++set) {
    std::vector<double> M(std::size_t(d.n) * d.n, 0.), x(d.n);
    std::vector<int> state(d.n);
    bool possible = true;
    for (int i = 0, s = set; i < d.n; ++i, s /= 3) {
      state[i] = s % 3;
      if (state[i] == 0) {
        for (int j = 0; j < d.n; ++j) M[i * d.n + j] = d.A[i * d.n + j];
        x[i] = -d.b[i];
      } else {
        M[i * d.n + i] = 1;
        double const bound = state[i] == 1 ? (d.friction_of[i] < 0 ? d.lower[i] : -d.upper[i]) : d.upper[i];
        possible &= std::abs(bound) < 1e200;
        if (d.friction_of[i] < 0)
          x[i] = bound;
        else
          x[i] = 0, M[i * d.n + d.friction_of[i]] -= bound;
      }
    }
    if (!possible || !solve(M, x)) continue;
    for (int i = 0; i < d.n && possible; ++i) {
      double const w = d.w(x, i), e = 1e-9;
      possible = x[i] >= d.low(x, i) - e && x[i] <= d.high(x, i) + e && (state[i] == 0 || (state[i] == 1 ? w >= -e : w <= e));
    }
    if (possible) solutions.push_back(x);
  }
  return solutions;
}

/// Largest change that one more projection of a row would make to its rate.
double violation(Dense const& d) {
  double worst = 0;
  for (int i = 0; i < d.n; ++i)
    worst = std::fmax(
        worst, std::abs(std::clamp(d.p[i] - d.w(d.p, i) / d.A[i * d.n + i], d.low(d.p, i), d.high(d.p, i)) - d.p[i]) * d.A[i * d.n + i]);
  return worst;
}

gsp::CompiledModel two_trees() { return gsp::compile(gsp_test::random_model({gsp::JointType::free, gsp::JointType::hinge}, 4)); }
}  // namespace

// 20 worlds of random problems, each solved by trying all active sets. Rows between fixed bounds have one solution (A is positive
// definite); contacts with friction can have several, and ours must be one of them. Sweeps until nothing changes; tolerance: the
// enumeration's own 1e-9 over the least pivot.
TEST_CASE_TEMPLATE("impulses are those of the enumeration of active sets", Exec, GSP_TEST_EXECS) {
  int const worlds = 20;
  auto const c = two_trees();
  Loop<double, Exec> s(c, worlds);
  gsp_test::randomise(c, s.state);
  int inside = 0, bound = 0;
  for (bool contacts : {false, true}) {
    s.solver = {.iterations = 200000, .tolerance = 1e-13f, .residual = true};
    test_types::RandomRows const type{contacts ? 2 : 6, contacts, 6, 0.5, 0};
    s.assemble(type);
    gsp::pgs(s.exec, s.model, s.rows, s.solver);
    s.exec.fence();
    auto const residual = gsp_test::host(s.rows.residual);
    for (int w = 0; w < worlds; ++w) {
      auto const d = dense(s, w);
      REQUIRE(d.n == 6);
      auto const solutions = enumerate(d);
      CAPTURE(contacts);
      CAPTURE(w);
      REQUIRE(!solutions.empty());
      double nearest = 1e9;
      for (auto const& x : solutions) {
        double off = 0;
        for (int i = 0; i < d.n; ++i) off = std::fmax(off, std::abs(x[i] - d.p[i]) / std::fmax(1, std::abs(x[i])));
        nearest = std::fmin(nearest, off);
      }
      CHECK(nearest < 1e-7);
      CHECK(residual(w) < 1e-12);
      for (int i = 0; i < d.n; ++i) (d.p[i] > d.low(d.p, i) + 1e-9 && d.p[i] < d.high(d.p, i) - 1e-9 ? inside : bound)++;
    }
    s.rows = gsp::make_rows(s.exec, s.model, {.worlds = worlds});
  }
  MESSAGE(inside << " rows inside their bounds, " << bound << " at a bound");
  CHECK(inside > 30);
  CHECK(bound > 30);
}

// After few sweeps: the residual is the largest violation, measured densely; more sweeps, and a warm start, make it smaller.
TEST_CASE_TEMPLATE("residual", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  Loop<double, Exec> s(c, 3);
  gsp_test::randomise(c, s.state);
  test_types::RandomRows const type{8, false, 10, 0, 0};
  double before = std::numeric_limits<double>::infinity();
  for (int sweeps : {1, 8, 64, 512}) {
    s.rows = gsp::make_rows(s.exec, s.model, {.worlds = 3});
    s.assemble(type);
    gsp::pgs(s.exec, s.model, s.rows, {.iterations = sweeps, .tolerance = 0, .residual = true});
    double const residual = gsp_test::host(s.rows.residual)(1);
    CHECK(residual == doctest::Approx(violation(dense(s, 1))).epsilon(1e-9));
    CHECK(residual < before);
    CHECK(gsp_test::host(s.rows.iterations)(1) == sweeps);
    before = residual + 1e-14;
  }
}

// Few rows and many (which a CPU solves on another path) side by side, after some sweeps: the residuals are those of the
// dense problem. Rates are sums of 200 terms below 10^3: 1e-10.
TEST_CASE_TEMPLATE("worlds of few and of many rows", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  Loop<double, Exec> s(c, 5);
  gsp_test::randomise(c, s.state);
  for (bool contacts : {false, true}) {
    test_types::RandomRows const type{5, contacts, 10, 0.6, 40 + 30 * !contacts};
    s.rows = gsp::make_rows(s.exec, s.model, {.worlds = 5});
    s.assemble(type);
    if (gsp::grow(s.exec, s.rows)) s.assemble(type);
    gsp::pgs(s.exec, s.model, s.rows, {.iterations = 30, .tolerance = 0, .residual = true});
    auto const residual = gsp_test::host(s.rows.residual);
    for (int w = 0; w < 5; ++w) {
      auto const d = dense(s, w);
      REQUIRE(d.n == (contacts ? 3 : 1) * (5 + (w % 2 ? type.more : 0)));
      CHECK(std::abs(residual(w) - violation(d)) < 1e-10);
    }
  }
}

// The stop is each world's own, and a converged warm start needs one sweep.
TEST_CASE_TEMPLATE("a world stops when it has converged", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  Loop<double, Exec> s(c, 4);
  gsp_test::randomise(c, s.state);
  test_types::RandomRows const type{5, false, 8, 0, 0};
  gsp::PgsOptions const options{.iterations = 100000, .tolerance = 1e-9f};
  s.assemble(type);
  gsp::pgs(s.exec, s.model, s.rows, options);
  auto const cold = gsp_test::snapshot(s.rows.iterations);
  gsp::pgs(s.exec, s.model, s.rows, options);  // from the impulses that it left
  auto const warm = gsp_test::host(s.rows.iterations);
  bool differ = false;
  for (int w = 0; w < 4; ++w) {
    CHECK(cold(w) > 1);
    CHECK(cold(w) < 100000);
    CHECK(warm(w) == 1);
    differ |= cold(w) != cold(0);
  }
  CHECK(differ);
  CHECK_THROWS_AS(gsp::pgs(s.exec, s.model, s.rows, {.iterations = 0}), std::invalid_argument);
}
