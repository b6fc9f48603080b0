#include <doctest/doctest.h>

#include <cmath>
#include <gsp/solver/soft_element.hpp>

#include "dynamics/random_tree.hpp"

// The answer of an element against what defines it: p solves its own small problem (feasible, and w + C p in the dual cone and orthogonal
// to p), s has the slope -p, and B is the slope of -p. Random elements and rates, in every zone.

namespace {
constexpr int N = gsp::most_element_rows;
constexpr double no_least[N] = {};

/// Rows of an element: a normal anywhere, friction of it, and single rows between bounds.
struct Case {
  gsp::Row<double> row[N];
  int rows, normal;
};
Case random_case(gsp_test::Random& r) {
  Case c{};
  c.rows = 1 + int(2.999 * (1 + r()));
  c.normal = int(0.4999 * (1 + r()) * c.rows);
  for (int b = 0; b < c.rows; ++b) {
    auto& row = c.row[b];
    row.compliance = 0.1 + 0.05 * r(), row.inverse_diagonal = 1, row.lower = 0, row.upper = 1e300, row.mu = -1, row.friction_of = -1;
    if (b == c.normal) continue;
    if (r() < 0.6)
      row.friction_of = static_cast<signed char>(c.normal), row.mu = 0.6 + 0.5 * r();
    else
      row.lower = -1 + 0.5 * r(), row.upper = 1 + 0.5 * r();
  }
  return c;
}
}  // namespace

TEST_CASE("impulses solve the element's own problem") {
  gsp_test::Random r;
  int zones[3] = {0, 0, 0}, inside = 0;
  for (int n = 0; n < 20000; ++n) {
    Case const c = random_case(r);
    auto const e = gsp::soft_element(c.row, c.rows, no_least);
    double w[N], p[N];
    for (int b = 0; b < c.rows; ++b) w[b] = 2 * r();
    gsp::soft_impulses(e, w, p);
    double length = 0, dual = 0, product = 0, size = 1e-12;  // |p_b / mu_b|, |mu_b v_b|, v . p of the cone, v = w + C p
    int friction = 0;
    for (int b = 0; b < c.rows; ++b) {
      double const v = w[b] + e.compliance[b] * p[b];
      size = std::fmax(size, std::abs(w[b]));
      if (e.normal[b] < 0 && b != c.normal) {
        CHECK(p[b] >= e.lower[b]);
        CHECK(p[b] <= e.upper[b]);
        inside += p[b] > e.lower[b] && p[b] < e.upper[b];
        if (p[b] > e.lower[b]) CHECK(v < 1e-13);
        if (p[b] < e.upper[b]) CHECK(v > -1e-13);
        continue;
      }
      product += v * p[b];
      if (b == c.normal) continue;
      ++friction;
      length = std::hypot(length, p[b] / e.mu[b]);
      dual = std::hypot(dual, e.mu[b] * v);
    }
    double const v = w[c.normal] + e.compliance[c.normal] * p[c.normal];
    // Rounding of a handful of products of numbers below 40 (p) and 2 (w).
    CHECK(length <= p[c.normal] + 1e-12);
    CHECK(v >= dual - 1e-12);
    CHECK(std::abs(product) < 1e-11);
    if (friction > 0) ++zones[p[c.normal] == 0 ? 0 : std::abs(length - p[c.normal]) < 1e-9 ? 2 : 1];
  }
  CHECK(inside > 300);
  for (int zone : zones) CHECK(zone > 1000);
}

TEST_CASE("p is the slope of the cost, B of the impulses") {
  gsp_test::Random r;
  int compared = 0;
  for (int n = 0; n < 5000; ++n) {
    Case const c = random_case(r);
    auto const e = gsp::soft_element(c.row, c.rows, no_least);
    double w[N], p[N], B[N][N];
    for (int b = 0; b < c.rows; ++b) w[b] = 2 * r();
    gsp::soft_impulses(e, w, p);
    gsp::soft_curvature(e, w, B);
    for (int k = 0; k < c.rows; ++k) {
      double const h = 1e-5;
      double cost[2], at[2][N];
      for (int side = 0; side < 2; ++side) {
        double moved[N];
        for (int b = 0; b < c.rows; ++b) moved[b] = w[b] + (b == k ? (side ? h : -h) : 0);
        gsp::soft_impulses(e, moved, at[side]);
        cost[side] = gsp::soft_cost(e, moved, at[side]);
      }
      // The cost has a continuous slope that bends by 1 / C <= 20 at most (a cone's: mu^2 / C more): h / 2 times that.
      CHECK(std::abs((cost[1] - cost[0]) / (2 * h) + p[k]) < 1e-3);
      bool smooth = true;  // the zone does not change within the step: both halves have the same slope
      for (int b = 0; b < c.rows; ++b) smooth = smooth && std::abs(at[1][b] - 2 * p[b] + at[0][b]) < 1e-6;
      for (int b = 0; b < c.rows && smooth; ++b, ++compared) {
        CHECK(std::abs((at[1][b] - at[0][b]) / (2 * h) + B[b][k]) < 1e-3 * (1 + std::abs(B[b][k])));
        CHECK(B[b][k] == doctest::Approx(B[k][b]).epsilon(1e-12));
      }
    }
  }
  CHECK(compared > 20000);
}

TEST_CASE("a row is as soft as it must be at least, a friction of nothing is none") {
  gsp::Row<double> row[2] = {};
  for (auto& one : row) one.inverse_diagonal = 0.5, one.lower = 0, one.upper = 1e300, one.mu = -1, one.friction_of = -1;
  row[1].friction_of = 0, row[1].mu = 0;
  double const least[2] = {2e-10, 2e-10};
  auto const e = gsp::soft_element(row, 2, least);
  CHECK(e.compliance[0] == 2e-10);
  CHECK(e.cone_mu[0] == 0);
  double const w[2] = {-1e-9, 3};
  double p[2], B[N][N];
  gsp::soft_impulses(e, w, p);
  CHECK(p[0] == doctest::Approx(1e-9 / e.compliance[0]));
  CHECK(p[1] == 0);
  CHECK(gsp::soft_curvature(e, w, B));
  CHECK(B[1][1] == 0);
}
