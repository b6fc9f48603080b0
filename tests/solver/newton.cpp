#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/model/detail/principal_axes.hpp>
#include <gsp/solver/newton.hpp>
#include <gsp_test_execs.hpp>
#include <limits>

#include "constraint/loop.hpp"
#include "support/kokkos_tools.hpp"

using gsp_test::Loop;

namespace test_types {
/// Random soft elements of 1 to 6 rows over random dofs: single rows between bounds, without bounds, and cones whose normal stands
/// anywhere.
template <class R>
struct SoftElements {
  int n, more, dofs;
  double stiffness;                                          // 1: compliances about those of the rows themselves
  KOKKOS_FUNCTION static int normal_of(int kind, int row) {  // -1: bounds
    constexpr int table[6][6] = {{-1, 0, 0, 0, 0, 0}, {1, -1, 0, 0, 0, 0},   {-1, 0, 0, 0, 0, 0},
                                 {2, 2, -1, 2, 0, 0}, {-1, -1, 0, 0, -1, 0}, {-1, 0, 0, 0, 0, 0}};
    return table[kind][row];
  }
  KOKKOS_FUNCTION int count(int world) const { return n + (world % 2 ? more : 0); }
  KOKKOS_FUNCTION int rows(int world, int k) const { return (k + world) % 6 + 1; }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int world, int k, int row, Row&& J) const {
    int const from = k % 2 ? 0 : row % 2;  // rows of other entries now and then
    for (int i = from; i < dofs; ++i) J.set_dof(i, R(gsp_test::hashed(world, k, row, i)));
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int world, int k, int row, R, R, R) const {
    return {R((0.05 + 0.02 * gsp_test::hashed(world, k, 7, row)) / stiffness), R(2 * gsp_test::hashed(world, k, 8, row))};
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int k, int row) const {
    int const kind = rows(world, k) - 1, normal = normal_of(kind, row);
    if (normal >= 0) {
      bool const pair = row < kind && normal_of(kind, row + 1) == normal;
      bool const second = row > 0 && normal_of(kind, row - 1) == normal && !(kind == 5 && row == 3);
      return {0, 0, normal, 0.3 + 0.1 * row, pair && !second};
    }
    if (kind == 4 && row == 4) return {-0.2, 0.1};
    if (kind == 0 && k % 3 == 0) return {-1e300, 1e300};
    return {0, 1e300};
  }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// Springs whose forces cancel, on two trees: nothing moves, and z is rounding alone. World w has w + 2 of them.
template <class R>
struct Against : gsp::OneFreeRow {
  double compliance;
  KOKKOS_FUNCTION static double weight(int k) { return 1 + 0.37 * k; }
  KOKKOS_FUNCTION int count(int world) const { return world + 2; }
  KOKKOS_FUNCTION double impulse(int world, int k) const {
    double sum = 0;
    for (int i = 0; i < world + 1; ++i) sum += weight(i) * (1.5 + 0.1 * i);
    return k < world + 1 ? 1.5 + 0.1 * k : -sum / weight(k);
  }
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int world, int k, int, R, R, R) const { return {R(compliance), R(compliance * impulse(world, k))}; }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int, int k, int, Row&& J) const {
    for (int i = 0; i < 2; ++i) J.set_dof(i, R(i ? weight(k) : -weight(k)));
    return R(0);
  }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// Such elements over dofs 0 ... 5 and 15 ... 19 (an island of two trees), over 10 ... 14 (another one), or over both by turns; those of
/// the second are a thousand times as stiff.
template <class R>
struct ElementsApart {
  int n;
  bool first, second;
  KOKKOS_FUNCTION int count(int) const { return first && second ? 2 * n : n; }
  KOKKOS_FUNCTION bool is_second(int k) const { return first && second ? k % 2 == 1 : second; }
  KOKKOS_FUNCTION int number(int k) const { return (first && second ? k / 2 : k) + (is_second(k) ? 10000 : 0); }
  KOKKOS_FUNCTION SoftElements<R> elements(int k) const { return {n, 0, 0, is_second(k) ? 1000. : 1.}; }
  KOKKOS_FUNCTION int rows(int world, int k) const { return elements(k).rows(world, number(k)); }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int world, int k, int row, Row&& J) const {
    int const skipped = number(k) % 2 ? 0 : row % 2;  // rows of other entries now and then
    for (int i = skipped; i < (is_second(k) ? 5 : 11); ++i)
      J.set_dof(is_second(k) ? 10 + i : i < 6 ? i : 9 + i, R(gsp_test::hashed(world, number(k), row, i)));
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int world, int k, int row, R, R, R) const {
    return elements(k).law(world, number(k), row, R(0), R(0), R(0));
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int k, int row) const { return elements(k).bounds(world, number(k), row); }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(number(k)), 0}; }
};
/// Rigid rows without bounds, `copies` times each of three.
template <class R>
struct RepeatedRows {
  int copies, dofs;
  KOKKOS_FUNCTION int count(int) const { return 3 * copies; }
  KOKKOS_FUNCTION int rows(int, int) const { return 1; }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    for (int i = 0; i < dofs; ++i) J.set_dof(i, R(gsp_test::hashed(world, k % 3, 0, i)));
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int world, int k, int, R, R, R) const { return {R(0), R(gsp_test::hashed(world, k % 3, 1, 0))}; }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int, int, int) const { return {-1e300, 1e300}; }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// Soft rows without bounds, beside one whose leverage on the first dof is 1e5 times theirs, and which is as soft: |Y|^2 / C is the same.
template <class R>
struct LeveragedRows {
  int n, dofs;
  KOKKOS_FUNCTION int count(int) const { return n; }
  KOKKOS_FUNCTION int rows(int, int) const { return 1; }
  KOKKOS_FUNCTION static double leverage(int k) { return k == 0 ? 1e5 : 1; }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    for (int i = 0; i < dofs; ++i) J.set_dof(i, R(leverage(i == 0 ? k : 1) * gsp_test::hashed(world, k, 0, i)));
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int world, int k, int, R, R, R) const {
    return {R(0.1 * leverage(k) * leverage(k)), R(leverage(k) * gsp_test::hashed(world, k, 1, 0))};
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int, int, int) const { return {-1e300, 1e300}; }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// Rigid rows without bounds on the first tree, whose segments on the second hold nothing but zeros; and a soft one there, of so much
/// leverage.
template <class R>
struct TiedRows {
  double leverage;
  KOKKOS_FUNCTION int count(int) const { return 4; }
  KOKKOS_FUNCTION int rows(int, int) const { return 1; }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    for (int i = 0; i < 6 && k > 0; ++i) J.set_dof(i, R(gsp_test::hashed(world, k, 0, i)));
    for (int i = 10; i < 14; ++i) J.set_dof(i, k > 0 ? R(0) : R(leverage * gsp_test::hashed(world, k, 0, i)));
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int world, int k, int, R, R, R) const {
    return {k > 0 ? R(0) : R(0.1 * leverage * leverage), R(gsp_test::hashed(world, k, 1, 0))};
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int, int, int) const { return {-1e300, 1e300}; }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// One element whose rows push on one dof each.
struct UnitRows {
  KOKKOS_FUNCTION int count(int) const { return 1; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int, int row, Row&& J) const {
    J.set_dof(row, 1.);
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<double> law(int, int, int, double, double, double) const { return {1., 0.}; }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// A normal and two rows of friction: in world 0 they share an ellipse, in world 1 they are a box, in world 2 a row without friction stands
/// between them, in world 3 there are three, one of them beside the ellipse.
struct Friction : UnitRows {
  KOKKOS_FUNCTION int rows(int world, int) const { return world < 2 ? 3 : 4; }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int, int row) const {
    if (row == 0 || (world == 2 && row == 2)) return {0, 1e300};
    return {0, 0, 0, 0.5, row == 1 && (world == 0 || world == 3)};
  }
};
/// Friction of a row that pulls too.
struct BoundedNormal : UnitRows {
  KOKKOS_FUNCTION int rows(int, int) const { return 2; }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int, int row) const {
    if (row == 1) return {0, 0, 0, 0.5};
    return {world == 0 ? 0. : -1., world == 2 ? 5. : 1e300};
  }
};
}  // namespace test_types

namespace {
gsp::CompiledModel two_trees() { return gsp::compile(gsp_test::random_model({gsp::JointType::free, gsp::JointType::hinge}, 4)); }

/// By how much the impulses and z of a world miss the conditions of the convex problem, in rates: feasible, w + C p in the dual cone,
/// orthogonal to p, z = Y^T p; beside the largest rate.
template <class S>
double violation(S const& s, int world) {
  auto const row = gsp_test::host(s.rows.row);
  auto const element_rows = gsp_test::host(s.rows.element_rows);
  auto const Y = gsp_test::host(s.rows.Y);
  auto const first = gsp_test::host(s.rows.first), count = gsp_test::host(s.rows.count);
  auto const ints = gsp_test::host(s.model.ints);
  auto const impulse = gsp_test::host(s.impulses.p[gsp_test::host(s.impulses.parity)()]);
  auto const z = gsp_test::host(s.solution.z);
  double worst = 0, largest = 1e-12;
  std::vector<double> sum(std::size_t(s.model.nv), 0.);
  for (int r = first(world), end = r + count(world), n; r < end; r += n) {
    n = element_rows(r);
    double v[6], C[6], p[6];
    int normal = -1, one = -1;
    for (int b = 0; b < n; ++b) {
      auto const& own = row(r + b);
      p[b] = double(impulse(r + b));
      v[b] = double(own.bias);
      std::int64_t at = own.first_entry;
      for (int k = 0; k < 2; ++k)
        for (int e = 0; e < own.segment[k].count; ++e, ++at) {
          int const dof = own.segment[k].dof0 + (own.segment[k].list < 0 ? e : ints(own.segment[k].list + e));
          v[b] += double(Y(at)) * double(z(world, dof));
          sum[std::size_t(dof)] += double(Y(at)) * p[b];
        }
      largest = std::fmax(largest, std::abs(v[b]));
      C[b] = double(own.compliance);
      if (own.friction_of >= 0) normal = own.friction_of, one = one < 0 ? b : one;
    }
    double length = 0, dual = 0, product = 0;
    for (int b = 0; b < n; ++b) {
      auto const& own = row(r + b);
      bool const friction = own.friction_of >= 0;
      if (friction) C[b] = C[one] * std::pow(double(row(r + one).mu) / double(own.mu), 2);  // the first friction row's counts for all
      v[b] += C[b] * p[b];
      if (friction) length = std::hypot(length, p[b] / double(own.mu)), dual = std::hypot(dual, double(own.mu) * v[b]);
      if (friction || b == normal)
        product += v[b] * p[b];
      else {
        worst = std::fmax(worst, C[b] * std::fmax(p[b] - double(own.upper), double(own.lower) - p[b]));
        if (p[b] > double(own.lower)) worst = std::fmax(worst, v[b]);
        if (p[b] < double(own.upper)) worst = std::fmax(worst, -v[b]);
      }
    }
    if (normal < 0) continue;
    worst = std::fmax(worst, C[normal] * (length - p[normal]));
    worst = std::fmax(worst, dual - v[normal]);
    if (p[normal] > 0) worst = std::fmax(worst, std::abs(product) / p[normal]);
  }
  for (int i = 0; i < s.model.nv; ++i) worst = std::fmax(worst, std::abs(sum[std::size_t(i)] - double(z(world, i))));
  return worst / largest;
}
/// 1 + the sum of |Y|^2 / C over the rows of a world.
template <class S>
double condition(S const& s, int world) {
  auto const row = gsp_test::host(s.rows.row);
  auto const Y = gsp_test::host(s.rows.Y);
  auto const first = gsp_test::host(s.rows.first), count = gsp_test::host(s.rows.count);
  double sum = 1;
  for (int r = first(world); r < first(world) + count(world); ++r) {
    std::int64_t at = row(r).first_entry;
    for (auto const& segment : row(r).segment)
      for (int e = 0; e < segment.count; ++e, ++at) sum += double(Y(at)) * double(Y(at)) / double(row(r).compliance);
  }
  return sum;
}
/// Largest over smallest eigenvalue of Y Y^T of a world's first three rows, which lie on the same dofs.
template <class S>
double condition_of_three(S const& s, int world) {
  auto const row = gsp_test::host(s.rows.row);
  auto const Y = gsp_test::host(s.rows.Y);
  int const first = gsp_test::host(s.rows.first)(world);
  auto const dot = [&](int a, int b) {
    double sum = 0;
    for (std::int64_t e = 0; e < row(first + 1).first_entry - row(first).first_entry; ++e)
      sum += double(Y(row(first + a).first_entry + e)) * double(Y(row(first + b).first_entry + e));
    return sum;
  };
  auto const moments = gsp::detail::principal_axes({dot(0, 0), dot(1, 1), dot(2, 2), dot(0, 1), dot(0, 2), dot(1, 2)}).moments;
  return moments[0] / moments[2];
}
}  // namespace

// The rates of the solution are good to rounding times the condition of H = 1 + Y^T B Y, at most 1 + sum |Y|^2 / C, its trace.
TEST_CASE_TEMPLATE("conditions of the convex problem", Exec, GSP_TEST_EXECS) {
  int const worlds = 20;
  auto const c = two_trees();
  for (int const pass : {0, 1, 2, 3}) {
    double const stiffness = pass % 2 ? 100. : 1.;
    bool const near = pass < 2;  // memory, or where the rows lie
    Loop<double, Exec> s(c, worlds, {.profile = gsp::Profile::mujoco});
    Loop<float, Exec> f(c, worlds, {.profile = gsp::Profile::mujoco});
    gsp_test::randomise(c, s.state);
    gsp_test::randomise(c, f.state);
    test_types::SoftElements<double> const type{9, 8, 7, stiffness};
    test_types::SoftElements<float> const rounded{9, 8, 7, stiffness};
    do s.assemble(type);
    while (s.grow());
    do f.assemble(rounded);
    while (f.grow());
    auto newton = gsp::make_newton(s.exec, s.rows);
    auto single = gsp::make_newton(f.exec, f.rows);
    if (!near) newton.near_bytes = single.near_bytes = 0;
    gsp::newton(s.exec, s.rows, s.impulses, s.solution, newton, s.progress, {.residual = true});
    gsp::newton(f.exec, f.rows, f.impulses, f.solution, single, f.progress);
    s.exec.fence(), f.exec.fence();
    auto const iterations = gsp_test::host(s.solution.iterations);
    auto const residual = gsp_test::host(s.solution.residual);
    CHECK(std::isnan(gsp_test::host(f.solution.residual)(0)));  // not asked for
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(stiffness);
      CAPTURE(near);
      CAPTURE(w);
      REQUIRE(gsp_test::host(s.rows.count)(w) > 20);
      double const bound = condition(s, w);
      CHECK(bound < 1e6);
      CHECK(violation(s, w) < std::numeric_limits<double>::epsilon() * bound);
      CHECK(violation(f, w) < double(std::numeric_limits<float>::epsilon()) * bound);
      CHECK(residual(w) < std::numeric_limits<double>::epsilon() * bound);
      CHECK(iterations(w) > 0);
      CHECK(iterations(w) < 40);
    }
    // From the solution there is nothing left to do, and the world before it does not matter.
    auto const z = gsp_test::snapshot(s.solution.z);
    gsp::newton(s.exec, s.rows, s.impulses, s.solution, newton, s.progress);
    for (int w = 0; w < worlds; ++w) CHECK(gsp_test::host(s.solution.iterations)(w) <= 1);
    auto const again = gsp_test::host(s.solution.z);
    for (int w = 0; w < worlds; ++w)
      for (int i = 0; i < s.model.nv; ++i) CHECK(again(w, i) == doctest::Approx(z(w, i)).epsilon(1e-9));
  }
}

// Of rows that are there `copies` times H = 1 + Y^T Y copies / C, C = 1e-7 |Y|^2 in float, of which rounding is `copies` and more: over
// pivots of 1 it grew from column to column, to NaN. What is asked for can be had, so z is that of the rows once, but for what their
// softness gives (1e-7 a row) and the rounding of sums of n = 3 copies terms: n epsilon / 2 of |Y|^T |Y|, at most 3 |Y^T Y|, in H and in
// its gradient, over the least eigenvalue of Y Y^T.
TEST_CASE_TEMPLATE("rigid rows that repeat are solved in float", Exec, GSP_TEST_EXECS) {
  int const worlds = 20;
  auto const c = two_trees();
  struct Case {
    int copies, dofs;         // dofs 10 ... 14 are another tree's
    std::int64_t near_bytes;  // 0: where the rows lie; -1: as make_newton has them
  };
  for (auto const [copies, dofs, near_bytes] : std::array<Case, 9>{{{2, 7, -1},
                                                                    {10, 7, -1},
                                                                    {100, 7, -1},
                                                                    {1000, 7, -1},
                                                                    {100, 14, -1},
                                                                    {2, 7, 0},
                                                                    {100, 7, 0},
                                                                    {100, 14, 0},
                                                                    {100, 14, 16 * 1024}}}) {
    Loop<double, Exec> s(c, worlds, {.profile = gsp::Profile::mujoco});
    Loop<float, Exec> f(c, worlds, {.profile = gsp::Profile::mujoco});
    gsp_test::randomise(c, s.state);
    gsp_test::randomise(c, f.state);
    do s.assemble(test_types::RepeatedRows<double>{1, dofs});
    while (s.grow());
    do f.assemble(test_types::RepeatedRows<float>{copies, dofs});
    while (f.grow());
    auto once = gsp::make_newton(s.exec, s.rows);
    auto often = gsp::make_newton(f.exec, f.rows);
    if (near_bytes >= 0) once.near_bytes = often.near_bytes = near_bytes;
    gsp::newton(s.exec, s.rows, s.impulses, s.solution, once, s.progress);
    gsp::newton(f.exec, f.rows, f.impulses, f.solution, often, f.progress);
    s.exec.fence(), f.exec.fence();
    auto const exact = gsp_test::host(s.solution.z);
    auto const z = gsp_test::host(f.solution.z);
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(copies);
      CAPTURE(dofs);
      CAPTURE(near_bytes);
      CAPTURE(w);
      double difference = 0, size = 0;
      for (int i = 0; i < s.model.nv; ++i) {
        difference += std::pow(double(z(w, i)) - exact(w, i), 2);
        size += exact(w, i) * exact(w, i);
      }
      CHECK(std::sqrt(difference) <
            9 * double(std::numeric_limits<float>::epsilon()) * copies * condition_of_three(s, w) * std::sqrt(size));
    }
  }
}

// What is soft stays so beside a row of great leverage: in float the least compliance of 1e-7 of that row's Y^2 was 1e4 times theirs. The
// two precisions differ by rounding times the condition of H.
TEST_CASE_TEMPLATE("soft rows keep their softness beside one of great leverage", Exec, GSP_TEST_EXECS) {
  int const worlds = 20;
  auto const c = two_trees();
  Loop<double, Exec> s(c, worlds, {.profile = gsp::Profile::mujoco});
  Loop<float, Exec> f(c, worlds, {.profile = gsp::Profile::mujoco});
  gsp_test::randomise(c, s.state);
  gsp_test::randomise(c, f.state);
  do s.assemble(test_types::LeveragedRows<double>{6, 7});
  while (s.grow());
  do f.assemble(test_types::LeveragedRows<float>{6, 7});
  while (f.grow());
  auto exact = gsp::make_newton(s.exec, s.rows);
  auto single = gsp::make_newton(f.exec, f.rows);
  gsp::newton(s.exec, s.rows, s.impulses, s.solution, exact, s.progress);
  gsp::newton(f.exec, f.rows, f.impulses, f.solution, single, f.progress);
  s.exec.fence(), f.exec.fence();
  auto const z = gsp_test::host(s.solution.z);
  auto const rounded = gsp_test::host(f.solution.z);
  for (int w = 0; w < worlds; ++w) {
    CAPTURE(w);
    double difference = 0, size = 0;
    for (int i = 0; i < s.model.nv; ++i) {
      difference += std::pow(double(rounded(w, i)) - z(w, i), 2);
      size += z(w, i) * z(w, i);
    }
    CHECK(condition(s, w) < 1e5);
    CHECK(std::sqrt(difference) < double(std::numeric_limits<float>::epsilon()) * condition(s, w) * std::sqrt(size));
  }
}

// What a row does not move does not soften it, though its segments lead there: trees that a tendon ties are one. The two solutions differ
// by rounding over the least softness, for each of four rows.
TEST_CASE_TEMPLATE("rows are as rigid as what they move lets them be", Exec, GSP_TEST_EXECS) {
  int const worlds = 20;
  auto const c = two_trees();
  for (bool const near : {true, false}) {
    Loop<double, Exec> s(c, worlds, {.profile = gsp::Profile::mujoco}), f(c, worlds, {.profile = gsp::Profile::mujoco});
    gsp_test::randomise(c, s.state);
    gsp_test::randomise(c, f.state);
    do s.assemble(test_types::TiedRows<double>{1});
    while (s.grow());
    do f.assemble(test_types::TiedRows<double>{1e5});
    while (f.grow());
    auto alike = gsp::make_newton(s.exec, s.rows), unlike = gsp::make_newton(f.exec, f.rows);
    if (!near) alike.near_bytes = unlike.near_bytes = 0;
    gsp::newton(s.exec, s.rows, s.impulses, s.solution, alike, s.progress);
    gsp::newton(f.exec, f.rows, f.impulses, f.solution, unlike, f.progress);
    s.exec.fence(), f.exec.fence();
    auto const z = gsp_test::host(s.solution.z), other = gsp_test::host(f.solution.z);
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(near);
      CAPTURE(w);
      double difference = 0, size = 0;
      for (int i = 0; i < 10; ++i) {  // of the first tree
        difference += std::pow(other(w, i) - z(w, i), 2);
        size += z(w, i) * z(w, i);
      }
      CHECK(size > 0);
      CHECK(std::sqrt(difference) < 4 * std::numeric_limits<double>::epsilon() / gsp::least_softness<double> * std::sqrt(size));
    }
  }
}

// An island has the bits that it has without the others, from nothing and from the last impulses, and each iterates for itself: where both
// are in near memory, where one of them is, where none is to be had, and where they are as large as asks a GPU for several warps, or larger
// than near memory.
TEST_CASE_TEMPLATE("an island's result depends on its own rows", Exec, GSP_TEST_EXECS) {
  using gsp::JointType;
  int const worlds = 6;
  struct Case {
    int elements;
    std::int64_t near_bytes;  // 0: where the rows lie; -1: as make_newton has them
  };
  auto const c = gsp::compile(gsp_test::random_model({JointType::free, JointType::hinge, JointType::hinge}, 4));
  REQUIRE(c.nv == 20);
  REQUIRE(c.tree_dofadr == std::vector{0, 10, 15});
  struct Result {
    std::vector<std::vector<double>> z, once;
    std::vector<int> iterations;
  };
  auto const solve = [&](Case const& own, bool first, bool second) {
    Loop<double, Exec> s(c, worlds, {.profile = gsp::Profile::mujoco});
    gsp_test::randomise(c, s.state);
    do s.assemble(test_types::ElementsApart<double>{own.elements, first, second});
    while (s.grow());
    auto newton = gsp::make_newton(s.exec, s.rows);
    if (own.near_bytes >= 0) newton.near_bytes = own.near_bytes;
    Result out;
    auto const z_of = [&](int w) {
      auto const h = gsp_test::host(s.solution.z);
      std::vector<double> z(20);
      for (int i = 0; i < 20; ++i) z[std::size_t(i)] = h(w, i);
      return z;
    };
    gsp::newton(s.exec, s.rows, s.impulses, s.solution, newton, s.progress, {.iterations = 1});
    for (int w = 0; w < worlds; ++w) out.once.push_back(z_of(w));
    gsp::newton(s.exec, s.rows, s.impulses, s.solution, newton, s.progress, {.residual = true});
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(w);
      out.z.push_back(z_of(w));
      out.iterations.push_back(gsp_test::host(s.solution.iterations)(w));
      CHECK(violation(s, w) < std::numeric_limits<double>::epsilon() * condition(s, w));
      CHECK(gsp_test::host(s.solution.residual)(w) < std::numeric_limits<double>::epsilon() * condition(s, w));
    }
    return out;
  };
  // Between what the second island of seven elements takes of near memory and what the first does, in bytes.
  auto const bytes = [](bool second, int w) {
    test_types::ElementsApart<double> const own{7, !second, second};
    int rows = 0;
    for (int k = 0; k < 7; ++k) rows += own.rows(w, k);
    return gsp::detail::NewtonSizes<double, gsp::native_width<double>>(rows, second ? 5 : 15, true).bytes();
  };
  std::int64_t between = 0;
  for (int w = 0; w < worlds; ++w) between = std::max(between, bytes(true, w));
  for (int w = 0; w < worlds; ++w) REQUIRE(between < bytes(false, w) - 1000);  // a GPU does not fill rows up
  bool apart = false;
  for (Case const& own : std::array<Case, 5>{{{7, -1}, {7, between}, {7, 0}, {40, -1}, {700, -1}}}) {
    CAPTURE(own.elements);
    CAPTURE(own.near_bytes);
    auto const both = solve(own, true, true), first = solve(own, true, false), second = solve(own, false, true);
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(w);
      CHECK(both.iterations[w] == std::max(first.iterations[w], second.iterations[w]));
      apart = apart || first.iterations[w] != second.iterations[w];
      for (int i = 0; i < 20; ++i) {
        auto const& alone = i >= 10 && i < 15 ? second : first;
        CAPTURE(i);
        CHECK(both.once[w][i] == alone.once[w][i]);
        CHECK(both.z[w][i] == alone.z[w][i]);
      }
    }
  }
  CHECK(apart);
}

// The same bits for a world alone and among others, and twice.
TEST_CASE_TEMPLATE("a world's result depends on its own rows", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  test_types::SoftElements<double> const type{9, 8, 7, 10.};
  std::vector<double> z[3];
  for (int n = 0; n < 3; ++n) {
    int const worlds = n == 0 ? 1 : 37;
    Loop<double, Exec> s(c, worlds, {.profile = gsp::Profile::mujoco});
    s.set(0, {0.1, 0.2, 0.9, 1, 0, 0, 0, 0.3}, {0.4, 0.5, 0.6, 0.7, 0.1, 0.2, 0.3});
    do s.assemble(type);
    while (s.grow());
    auto newton = gsp::make_newton(s.exec, s.rows);
    gsp::newton(s.exec, s.rows, s.impulses, s.solution, newton, s.progress, {.warm = false});
    auto const h = gsp_test::host(s.solution.z);
    for (int i = 0; i < s.model.nv; ++i) z[n].push_back(h(0, i));
  }
  CHECK(z[0] == z[1]);
  CHECK(z[1] == z[2]);
}

// Impulses that cancel: the gradient is a sum of them and is never less than its rounding, however small z is.
TEST_CASE_TEMPLATE("rows that press against each other are done when rounding is left", Exec, GSP_TEST_EXECS) {
  auto const check = [](auto zero, bool near, double compliance) {
    using R = decltype(zero);
    CAPTURE(near);
    CAPTURE(compliance);
    int const worlds = 6;
    Loop<R, Exec> s(gsp::compile(gsp_test::sliders(2, 0.3)), worlds, {.profile = gsp::Profile::mujoco});
    test_types::Against<R> const against{{}, compliance};
    auto newton = gsp::make_newton(s.exec, s.rows);
    for (int step = 0; step < 4; ++step) {
      do s.assemble(against);
      while (s.grow());
      gsp::grow(s.exec, s.rows, newton);
      if (!near) newton.near_bytes = 0;
      gsp::newton(s.exec, s.rows, s.impulses, s.solution, newton, s.progress, {.iterations = 100});
      auto const iterations = gsp_test::host(s.solution.iterations);
      auto const p = gsp_test::host(s.impulses.p[gsp_test::host(s.impulses.parity)()]);
      auto const first = gsp_test::host(s.rows.first);
      for (int w = 0; w < worlds; ++w) {
        CAPTURE(w);
        CHECK(iterations(w) < 20);
        for (int k = 0; k < w + 2; ++k)
          CHECK(std::abs(double(p(first(w) + k)) - against.impulse(w, k)) < 1000 * double(std::numeric_limits<R>::epsilon()));
      }
    }
  };
  for (double compliance : {0.01, 1., 12.5})
    for (bool near : {true, false}) {
      check(0., near, compliance);
      check(0.f, near, compliance);
    }
}

TEST_CASE_TEMPLATE("what newton refuses", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  Loop<double, Exec> s(c, 3, {.profile = gsp::Profile::mujoco}), two(c, 2, {.profile = gsp::Profile::mujoco});
  auto newton = gsp::make_newton(s.exec, s.rows), fewer = gsp::make_newton(s.exec, two.rows);
  s.assemble(test_types::BoundedNormal{});  // profile mujoco has cones of normals that push alone
  auto const status = gsp_test::host(s.state.status);
  CHECK(status(0) == 0);
  CHECK(status(1) == (gsp::status::row_refused | gsp::status::refused_friction));
  CHECK(status(2) == (gsp::status::row_refused | gsp::status::refused_friction));
  CHECK_THROWS_AS(gsp::newton(s.exec, s.rows, s.impulses, s.solution, fewer, s.progress), std::invalid_argument);
  auto wide = s.rows;
  wide.nv = 32769;
  CHECK_THROWS_WITH_AS(gsp::make_newton(s.exec, wide), doctest::Contains("32769 degrees of freedom"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::newton(s.exec, s.rows, s.impulses, s.solution, newton, s.progress, {.iterations = 0}), std::invalid_argument);
  Loop<double, Exec> stable(c, 3);  // the same rows are none that it could solve
  stable.assemble(test_types::BoundedNormal{});
  auto of_stable = gsp::make_newton(stable.exec, stable.rows);
  CHECK_THROWS_WITH_AS(gsp::newton(stable.exec, stable.rows, stable.impulses, stable.solution, of_stable, stable.progress),
                       doctest::Contains("profile stable"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::assemble(s.exec, s.model, s.state, s.dynamics, gsp::constraints(), stable.rows, s.impulses, s.progress),
                  std::invalid_argument);
  // Launches that do nothing are a step once, however many solves it has.
  Kokkos::deep_copy(s.progress.halt, 1);
  Kokkos::deep_copy(s.solution.z, 7.);
  gsp::newton(s.exec, s.rows, s.impulses, s.solution, newton, s.progress, {.ends_step = false});
  gsp::newton(s.exec, s.rows, s.impulses, s.solution, newton, s.progress);
  CHECK(gsp_test::host(s.solution.z)(0, 0) == 7.);
  CHECK(gsp_test::host(s.progress.skipped)() == 1);
}

// One cone is what profile mujoco has for all friction of a row: a box is refused there, and is one in profile stable.
TEST_CASE_TEMPLATE("friction that is no cone is refused in profile mujoco", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  for (bool const mujoco : {true, false}) {
    Loop<double, Exec> s(c, 4, {.profile = mujoco ? gsp::Profile::mujoco : gsp::Profile::stable});
    s.assemble(test_types::Friction{});
    auto const status = gsp_test::host(s.state.status);
    for (int w = 0; w < 4; ++w) {
      CAPTURE(w);
      CHECK(status(w) == (mujoco && (w == 1 || w == 2) ? gsp::status::row_refused | gsp::status::refused_friction : 0u));
    }
  }
}

// Its buffers are as large as the pool of rows: a pool that grew is refused until they have grown too, and the call itself makes no room.
TEST_CASE_TEMPLATE("newton neither allocates nor waits", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  Loop<double, Exec> s(c, 3, {.profile = gsp::Profile::mujoco});
  s.forget({.worlds = 3, .rows_per_world = 1, .entries_per_world = 1});
  auto newton = gsp::make_newton(s.exec, s.rows);
  test_types::SoftElements<double> const type{9, 8, 7, 1.};
  do s.assemble(type);
  while (s.grow());
  auto const solve = [&] { gsp::newton(s.exec, s.rows, s.impulses, s.solution, newton, s.progress); };
  CHECK_THROWS_WITH_AS(solve(), doctest::Contains("call grow(exec, rows, buffers)"), std::invalid_argument);
  CHECK(gsp::grow(s.exec, s.rows, newton));
  CHECK(!gsp::grow(s.exec, s.rows, newton));
  gsp_test::check_algorithm(s.exec, gsp_test::watch(solve));
  CHECK(gsp_test::host(s.solution.iterations)(0) > 0);
}
