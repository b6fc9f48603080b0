#include <doctest/doctest.h>

#include <cmath>
#include <gsp/solver/newton.hpp>
#include <gsp/solver/noslip.hpp>
#include <gsp_test_execs.hpp>
#include <limits>

#include "constraint/loop.hpp"
#include "support/kokkos_tools.hpp"

using gsp_test::Loop;

namespace test_types {
/// Soft rows without friction, dry rows, pairs of edges, and cones of 2 to 5 rows of friction whose normal stands anywhere; of every other
/// cone two rows push along one line, so that a combination of them moves nothing.
template <class R>
struct Grips {
  enum Kind { spring, dry, edge, opposite, cone };
  int n;
  KOKKOS_FUNCTION static Kind kind(int k) { return Kind(k % 5); }
  KOKKOS_FUNCTION int count(int world) const { return n + 5 * (world % 2); }
  KOKKOS_FUNCTION int rows(int world, int k) const { return kind(k) == cone ? 3 + (k / 5 + world) % 4 : 1; }
  KOKKOS_FUNCTION int normal(int world, int k) const { return k % 2 ? 0 : rows(world, k) - 1; }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int world, int k, int row, Row&& J) const {
    bool const double_row = kind(k) == cone && k % 10 == 9 && row == 2;
    for (int i = 0; i < 7; ++i) {
      R const x = R(gsp_test::hashed(world, kind(k) == opposite ? k - 1 : k, double_row ? 1 : row, i));
      J.set_dof(i, kind(k) == opposite ? R(0.3) * x - R(gsp_test::hashed(world, k, 9, i)) : x);
    }
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int world, int k, int row, R, R, R) const {
    return {R(0.05 + 0.02 * gsp_test::hashed(world, k, 7, row)), R(kind(k) == cone ? 2 : 0.5 * gsp_test::hashed(world, k, 8, row))};
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int k, int row) const {
    if (kind(k) == spring) return {-1e300, 1e300};
    if (kind(k) == dry) return {-0.2, 0.1, -1, 0, false, true};
    if (kind(k) != cone) return {0, 1e300, -1, 0, false, true};
    int const a = normal(world, k), end = rows(world, k);
    if (row == a) return {0, 1e300};
    int const place = row - (row > a), friction = end - 1;
    return {0, 0, a, 0.2 + 0.3 * row, place % 2 == 0 && place + 1 < friction && row + 1 != a};
  }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// Such elements over 7 dofs of the first tree, over the 5 of the second, 10 ... 14, or over both, five of each by turns.
template <class R>
struct GripsApart : Grips<R> {
  using Base = Grips<R>;
  bool first, second;
  KOKKOS_FUNCTION bool is_second(int k) const { return first && second ? k / 5 % 2 == 1 : second; }
  KOKKOS_FUNCTION int number(int k) const { return (first && second ? k / 10 * 5 + k % 5 : k) + (is_second(k) ? 100 : 0); }
  KOKKOS_FUNCTION int count(int world) const { return (first && second ? 2 : 1) * Base::count(world); }
  KOKKOS_FUNCTION int rows(int world, int k) const { return Base::rows(world, number(k)); }
  template <class Row>
  struct Shifted {
    Row& row;
    bool is_second;
    KOKKOS_FUNCTION void set_dof(int i, R x) const {
      if (!is_second)
        row.set_dof(i, x);
      else if (i < 5)
        row.set_dof(10 + i, x);
    }
  };
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int world, int k, int row, Row&& J) const {
    return Base::jacobian(world, number(k), row, Shifted<std::remove_reference_t<Row>>{J, is_second(k)});
  }
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int world, int k, int row, R, R, R) const {
    return Base::law(world, number(k), row, R(0), R(0), R(0));
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int k, int row) const { return Base::bounds(world, number(k), row); }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(number(k)), 0}; }
};
}  // namespace test_types

namespace {
gsp::CompiledModel two_trees() { return gsp::compile(gsp_test::random_model({gsp::JointType::free, gsp::JointType::hinge}, 4)); }

template <class S>
auto impulses_of(S const& s) {
  return gsp_test::snapshot(s.impulses.p[gsp_test::host(s.impulses.parity)()]);
}

/// By how much friction of a world misses its conditions, in rates beside the largest: feasible, and where the rate of a block is not zero,
/// against it at the bound. Rows that are no friction are as they were, and z is Y^T p.
template <class S, class Before>
double violation(S const& s, Before const& before, int world) {
  auto const row = gsp_test::host(s.rows.row);
  auto const element_rows = gsp_test::host(s.rows.element_rows);
  auto const Y = gsp_test::host(s.rows.Y);
  auto const ints = gsp_test::host(s.model.ints);
  auto const p = impulses_of(s);
  auto const z = gsp_test::host(s.solution.z);
  int const first = gsp_test::host(s.rows.first)(world), end = first + gsp_test::host(s.rows.count)(world);
  std::vector<double> sum(std::size_t(s.model.nv), 0.);
  auto const each_entry = [&](int r, auto const& f) {
    std::int64_t at = row(r).first_entry;
    for (auto const& segment : row(r).segment)
      for (int e = 0; e < segment.count; ++e, ++at)
        f(std::size_t(segment.dof0 + (segment.list < 0 ? e : ints(segment.list + e))), double(Y(at)));
  };
  for (int r = first; r < end; ++r) each_entry(r, [&](std::size_t dof, double y) { sum[dof] += y * double(p(r)); });
  double worst = 0, largest = 1e-12;
  auto const rate = [&](int r) {
    double w = double(row(r).bias);
    each_entry(r, [&](std::size_t dof, double y) { w += y * sum[dof]; });
    largest = std::fmax(largest, std::abs(double(row(r).bias)));
    return w;
  };
  auto const raise = [&](double x) { worst = std::fmax(worst, std::isfinite(x) ? x : INFINITY); };
  for (std::size_t i = 0; i < sum.size(); ++i) raise(std::abs(sum[i] - double(z(world, int(i)))));
  /// x between low and high, at the bound that its rate w pushes it to, in steps of x.
  auto const between = [&](double x, double low, double high, double w, double rounding) {
    raise(std::fmax(low - x, x - high));
    if (x > low + rounding) raise(w);
    if (x < high - rounding) raise(-w);
  };
  double const rounding = 1e3 * double(std::numeric_limits<typename decltype(s.rows)::real_type>::epsilon());
  for (int r = first, n; r < end; r += n) {
    n = element_rows(r);
    if (row(r).dry && double(row(r).upper) < 1e30) {
      between(double(p(r)), double(row(r).lower), double(row(r).upper), rate(r), rounding);
    } else if (row(r).dry) {
      double const half = (double(p(r)) + double(p(r + 1))) / 2;
      CHECK(half == doctest::Approx((double(before(r)) + double(before(r + 1))) / 2).epsilon(rounding));
      between((double(p(r)) - double(p(r + 1))) / 2, -half, half, rate(r) - rate(r + 1), rounding);
      n = 2;
    } else if (n == 1) {
      CHECK(p(r) == before(r));
    } else {
      int const a = row(r).friction_of < 0 ? r : r + n - 1;
      CHECK(p(a) == before(a));
      double length = 0, against = 0;  // |s|, w . s of s = p / mu, w in the same units
      for (int b = r; b < r + n; ++b)
        if (b != a) length = std::hypot(length, double(p(b)) / double(row(b).mu)), against += rate(b) * double(p(b));
      raise(length - double(p(a)));
      if (length > 0) against /= length * length;
      bool const slides = length > double(p(a)) * (1 - rounding);
      if (slides) raise(against * length);
      for (int b = r; b < r + n; ++b) {
        if (b == a) continue;
        double const s = double(p(b)) / double(row(b).mu), w = double(row(b).mu) * rate(b);
        raise(std::abs(p(a) > 0 ? w - (slides ? against * s : 0) : s));
      }
    }
  }
  return worst / largest;
}
}  // namespace

// Sweeps come nearer by a share each time, here until rounding is left: of z, which sums some 50 rows and is pushed a thousand times, times
// |Y|, up to 10: 1e4 epsilon (measured: 400). Near a bound, within 1e3 epsilon, a rate may be of either side.
TEST_CASE_TEMPLATE("conditions of rigid friction", Exec, GSP_TEST_EXECS) {
  int const worlds = 20;
  auto const c = two_trees();
  auto const check = [&](auto number) {
    using R = decltype(number);
    Loop<R, Exec> s(c, worlds, {.profile = gsp::Profile::mujoco});
    gsp_test::randomise(c, s.state);
    do s.assemble(test_types::Grips<R>{15});
    while (s.grow());
    auto buffers = gsp::make_newton(s.exec, s.rows);
    gsp::newton(s.exec, s.rows, s.impulses, s.solution, buffers, s.progress);
    auto const before = impulses_of(s);
    gsp::noslip(s.exec, s.rows, s.impulses, s.solution, s.progress, {.iterations = 1500, .least_gain = -1});
    s.exec.fence();
    double soft = 0, worst = 0;
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(w);
      REQUIRE(gsp_test::host(s.state.status)(w) == 0);
      worst = std::fmax(worst, violation(s, before, w));
    }
    auto const now = impulses_of(s);
    for (int r = 0; r < int(gsp_test::host(s.rows.first)(worlds - 1)); ++r) soft = std::fmax(soft, std::abs(double(now(r) - before(r))));
    CHECK(worst < 1e4 * double(std::numeric_limits<R>::epsilon()));
    CHECK(soft > 0.01);  // it had slipped
  };
  check(1.);
  check(1.f);
}

// The same bits for a world alone and among others.
TEST_CASE_TEMPLATE("a world's friction depends on its own rows", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  std::vector<double> z[2];
  for (int n = 0; n < 2; ++n) {
    Loop<double, Exec> s(c, n == 0 ? 1 : 37, {.profile = gsp::Profile::mujoco});
    s.set(0, {0.1, 0.2, 0.9, 1, 0, 0, 0, 0.3}, {0.4, 0.5, 0.6, 0.7, 0.1, 0.2, 0.3});
    do s.assemble(test_types::Grips<double>{15});
    while (s.grow());
    auto buffers = gsp::make_newton(s.exec, s.rows);
    gsp::newton(s.exec, s.rows, s.impulses, s.solution, buffers, s.progress, {.warm = false});
    gsp::noslip(s.exec, s.rows, s.impulses, s.solution, s.progress, {.iterations = 7});
    auto const h = gsp_test::host(s.solution.z);
    for (int i = 0; i < s.model.nv; ++i) z[n].push_back(h(0, i));
  }
  CHECK(z[0] == z[1]);
}

// An island has the bits that it has without the others, whenever these stop.
TEST_CASE_TEMPLATE("an island's friction depends on its own rows", Exec, GSP_TEST_EXECS) {
  int const worlds = 6;
  auto const c = two_trees();
  REQUIRE(c.tree_dofadr == std::vector{0, 10});
  for (double const least_gain : {1e-3, 1e-5, 1e-7}) {
    CAPTURE(least_gain);
    auto const solve = [&](bool first, bool second) {
      Loop<double, Exec> s(c, worlds, {.profile = gsp::Profile::mujoco});
      gsp_test::randomise(c, s.state);
      do s.assemble(test_types::GripsApart<double>{{15}, first, second});
      while (s.grow());
      auto buffers = gsp::make_newton(s.exec, s.rows);
      gsp::newton(s.exec, s.rows, s.impulses, s.solution, buffers, s.progress);
      gsp::noslip(s.exec, s.rows, s.impulses, s.solution, s.progress, {.iterations = 500, .least_gain = least_gain});
      return gsp_test::host(s.solution.z);
    };
    auto const both = solve(true, true), first = solve(true, false), second = solve(false, true);
    for (int w = 0; w < worlds; ++w)
      for (int i = 0; i < 15; ++i) {
        CAPTURE(w);
        CAPTURE(i);
        CHECK(both(w, i) == (i < 10 ? first : second)(w, i));
      }
  }
}

TEST_CASE_TEMPLATE("noslip neither allocates nor waits, does nothing while halted, and refuses rows that do not slip", Exec,
                   GSP_TEST_EXECS) {
  auto const c = two_trees();
  Loop<double, Exec> s(c, 3, {.profile = gsp::Profile::mujoco}), stable(c, 3), two(c, 2, {.profile = gsp::Profile::mujoco});
  do s.assemble(test_types::Grips<double>{15});
  while (s.grow());
  auto const call = [&] { gsp::noslip(s.exec, s.rows, s.impulses, s.solution, s.progress, {.iterations = 3}); };
  CHECK_THROWS_WITH_AS(call(), doctest::Contains("have not been solved for"), std::invalid_argument);
  auto buffers = gsp::make_newton(s.exec, s.rows);
  gsp::newton(s.exec, s.rows, s.impulses, s.solution, buffers, s.progress);
  gsp_test::check_algorithm(s.exec, gsp_test::watch(call));
  auto const z = gsp_test::snapshot(s.solution.z);
  Kokkos::deep_copy(s.progress.halt, 1);
  call();
  for (int i = 0; i < s.model.nv; ++i) CHECK(gsp_test::host(s.solution.z)(0, i) == z(0, i));
  CHECK(gsp_test::host(s.progress.skipped)() == 0);  // newton counts the step
  CHECK_THROWS_WITH_AS(gsp::noslip(stable.exec, stable.rows, stable.impulses, stable.solution, stable.progress, {.iterations = 3}),
                       doctest::Contains("profile stable"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::noslip(s.exec, s.rows, two.impulses, s.solution, s.progress, {.iterations = 3}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::noslip(s.exec, s.rows, s.impulses, s.solution, s.progress, {.iterations = -1}), std::invalid_argument);
}
