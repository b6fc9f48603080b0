#include <doctest/doctest.h>

#include <cmath>
#include <gsp/solver/impacts.hpp>
#include <gsp_test_execs.hpp>
#include <random>

#include "constraint/loop.hpp"
#include "step/world.hpp"
#include "support/kokkos_tools.hpp"

namespace test_types {
/// Bodies on a line that touch: element k is the gap between bodies k and k + 1, and gives back e of an impact.
template <class R>
struct Touching : gsp::OneFreeRow {
  int n;
  double e;
  int different = 0;  // so many restitutions, from e down
  bool soft = false;
  KOKKOS_FUNCTION int count(int) const { return n; }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int, int k, int, Row&& J) const {
    J.set_dof(k, R(-1));
    J.set_dof(k + 1, R(1));
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int, int k, int, R x, R, R h) const {
    gsp::RowLaw<R> law{soft ? R(1e-3) : R(0), -x / h};
    law.restitution = R(different > 0 ? e * (1 - double(k * 7 % different) / different) : e);
    return law;
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int, int, int) const { return {0, 1e300}; }
};
/// n rows of body 0, each with a body of its own at a lever of 0.3: what the first one gives the others have too.
template <class R>
struct Fan : Touching<R> {
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int, int k, int, Row&& J) const {
    J.set_dof(0, R(1));
    J.set_dof(k + 1, R(0.3));
    return 0;
  }
};
/// Body a and body b move together: a row without bounds, as soft as it is told.
template <class R>
struct Tied : gsp::OneFreeRow {
  int a, b;
  double compliance;
  KOKKOS_FUNCTION int count(int) const { return 1; }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int, int, int, Row&& J) const {
    J.set_dof(a, R(-1));
    J.set_dof(b, R(1));
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int, int, int, R, R, R) const { return {R(compliance), R(0)}; }
};
}  // namespace test_types

namespace {
using gsp_test::geom;
using test_types::Touching;

/// Bodies on slides along x, of these masses, without gravity.
gsp::CompiledModel line(std::vector<double> const& masses, double h) {
  auto d = gsp_test::sliders(int(masses.size()), 1);
  for (std::size_t i = 0; i < masses.size(); ++i) d.bodies[i + 1].inertial.mass = masses[i];
  d.option.timestep = h;
  return gsp::compile(d);
}

template <class R, class Exec>
struct Line : gsp_test::Loop<R, Exec> {
  using Base = gsp_test::Loop<R, Exec>;
  std::vector<double> masses;
  Line(std::vector<double> const& m, double h, int worlds = 1) : Base(line(m, h), worlds), masses(m) {
    this->forget({.worlds = worlds, .impacts = true});
  }
  void impacts(gsp::ImpactOptions const& options = {}) {
    gsp::impacts(this->exec, this->progress, this->rows, this->impulses, this->solution, options);
  }
  /// Rates after a step from these, of world w.
  template <class... Types>
  std::vector<double> hit(std::vector<double> const& rates, gsp::ImpactOptions const& options, Types const&... types) {
    do {
      for (int w = 0; w < this->rows.worlds; ++w) this->set(w, std::vector<double>(rates.size(), 0.), rates);
      this->assemble(types...);
      impacts(options);
    } while (this->finish());
    auto const v = gsp_test::host(this->state.qvel);
    std::vector<double> result;
    for (std::size_t i = 0; i < rates.size(); ++i) result.push_back(double(v(this->rows.worlds - 1, int(i))));
    return result;
  }
};
double momentum(std::vector<double> const& m, std::vector<double> const& v) {
  double sum = 0;
  for (std::size_t i = 0; i < m.size(); ++i) sum += m[i] * v[i];
  return sum;
}
double energy(std::vector<double> const& m, std::vector<double> const& v) {
  double sum = 0;
  for (std::size_t i = 0; i < m.size(); ++i) sum += 0.5 * m[i] * v[i] * v[i];
  return sum;
}
/// Touching bodies that hit each other one pair at a time, by Newton's law, until none approaches faster than `rest`. False where two
/// neighbouring pairs approach at the same time, or it goes on for too long.
bool one_after_the_other(std::vector<double> const& m, std::vector<double>& v, double e, double rest) {
  for (int event = 0; event < 20000; ++event) {
    std::vector<std::size_t> hits;
    for (std::size_t i = 0; i + 1 < m.size(); ++i)
      if (v[i + 1] - v[i] < -rest) hits.push_back(i);
    if (hits.empty()) return true;
    for (std::size_t k = 0; k < hits.size(); ++k) {
      if (k > 0 && hits[k] == hits[k - 1] + 1) return false;
      std::size_t const i = hits[k];
      double const p = (1 + e) * (v[i] - v[i + 1]) * m[i] * m[i + 1] / (m[i] + m[i + 1]);
      v[i] -= p / m[i];
      v[i + 1] += p / m[i + 1];
    }
  }
  return false;
}
}  // namespace

// Equal masses change their rates one pair after the other: as many fly off as were thrown. Each impact is exact, so rounding remains; 1e-5
// (double) is the project's bar, in float 16 epsilon, the least share of a round.
TEST_CASE_TEMPLATE("as many balls fly as were thrown", Exec, GSP_TEST_EXECS) {
  auto const check = [](auto number) {
    using R = decltype(number);
    for (int thrown = 1; thrown <= 4; ++thrown) {
      CAPTURE(thrown);
      Line<R, Exec> balls(std::vector<double>(5, 1.0), 0.001);
      std::vector<double> start(5, 0.);
      for (int i = 0; i < thrown; ++i) start[i] = 1;
      auto const v = balls.hit(start, {}, Touching<R>{{}, 4, 1.0});
      for (int i = 0; i < 5; ++i) CHECK(std::abs(v[i] - (i >= 5 - thrown)) < (sizeof(R) == 4 ? 1e-5 : 1e-12));
    }
  };
  check(1.);
  check(1.f);
}

// Chains of 2 to 6 bodies of masses between 0.2 and 5, against one impact after the other. A step of 1e-8 s, so that all that approaches
// faster than 1e-7 m/s is an impact in both; what is left is at rest in the solver, which changes rates by as much: 1e-6.
TEST_CASE_TEMPLATE("unequal masses hit each other one after the other", Exec, GSP_TEST_EXECS) {
  std::mt19937 random(3);
  double const h = 1e-8;
  int compared = 0;
  for (double const e : {0.3, 0.8, 1.0})
    for (int n = 2; n <= 6; ++n)
      for (int k = 0; k < 8; ++k) {
        std::vector<double> m(n), v(n, 0.);
        for (auto& x : m) x = std::exp(std::uniform_real_distribution<>(std::log(0.2), std::log(5.))(random));
        v[0] = 1;
        auto expected = v;
        if (!one_after_the_other(m, expected, e, 9.81 * h)) continue;
        ++compared;
        CAPTURE(e);
        CAPTURE(n);
        Line<double, Exec> chain(m, h);
        auto const found = chain.hit(v, {}, Touching<double>{{}, n - 1, e});
        for (int i = 0; i < n; ++i) CHECK(std::abs(found[i] - expected[i]) < 1e-6);
        CHECK(std::abs(momentum(m, found) - momentum(m, v)) < 1e-12);
        if (e == 1) CHECK(std::abs(energy(m, found) / energy(m, v) - 1) < 1e-9);
      }
  CHECK(compared == 120);
}

// What holds of any rates, masses and restitutions, several in one chain: no energy comes from nowhere, however few sweeps and rounds are
// done, and momentum is kept; sweeps end at 1e-6 of a rate. Nothing approaches after the step, where masses (e^-1 to e) let the solver's
// 1000 sweeps come to rest; beyond (e^-4 to e^4) they do not.
TEST_CASE_TEMPLATE("impacts add no energy", Exec, GSP_TEST_EXECS) {
  std::mt19937 random(5);
  for (int k = 0; k < 60; ++k) {
    int const n = 3 + k % 12;
    std::vector<double> m(n), v(n);
    bool const alike = k % 2 == 0;
    for (auto& x : m) x = std::exp((alike ? 1 : 4) * std::uniform_real_distribution<>(-1, 1)(random));
    for (auto& x : v) x = std::uniform_real_distribution<>(-1, 1)(random);
    gsp::ImpactOptions options;
    if (k % 3 == 1) options.sweeps = 1 + k % 4;
    if (k % 5 == 2) options.rounds = 1 + k % 3;
    CAPTURE(k);
    Line<double, Exec> chain(m, 0.001);
    auto const found = chain.hit(v, options, Touching<double>{{}, n - 1, 1.0, k % 4});
    CHECK(energy(m, found) < energy(m, v) * (1 + 1e-6));
    double size = 0;
    for (int i = 0; i < n; ++i) size += m[i];
    CHECK(std::abs(momentum(m, found) - momentum(m, v)) < 1e-12 * size);
    for (int i = 0; i + 1 < n && alike; ++i) CHECK(found[i + 1] - found[i] > -1e-9);
  }
}

// Rows that push the same way have too much of each other after few sweeps, which come to rest from above: given back in full, what one
// sweep makes of eight such rows would add 30 % of energy. 200 sweeps, which are slow here, lose 3e-4 of it.
TEST_CASE_TEMPLATE("impacts that are not solved add no energy", Exec, GSP_TEST_EXECS) {
  std::vector<double> const m(9, 1.), v{-1, 0, 0, 0, 0, 0, 0, 0, 0};
  for (int sweeps : {1, 2, 3, 200}) {
    CAPTURE(sweeps);
    Line<double, Exec> fan(m, 0.001);
    double const now = energy(m, fan.hit(v, {.sweeps = sweeps}, test_types::Fan<double>{{{}, 8, 1.0}}));
    CHECK(now < energy(m, v) * (1 + 1e-5));
    if (sweeps == 200) CHECK(now > energy(m, v) * (1 - 1e-3));
  }
}

// Two bodies that are tied are one: a third hits them as it would a body of both masses. Softly tied (C) the one that is hit gives way to
// the other by what the row gives in a step: of a pair of equal masses m, e = 1, what is hit sees 1 / (1/m - (1/m)^2 / (2/m + C)).
TEST_CASE_TEMPLATE("what is tied together is hit as one", Exec, GSP_TEST_EXECS) {
  for (double const C : {0., 0.5}) {
    double const m = 2;
    Line<double, Exec> bodies({m, m, m}, 0.001);
    auto const v = bodies.hit({1, 0, 0}, {.tolerance = 1e-12f}, Touching<double>{{}, 1, 1.0}, test_types::Tied<double>{{}, 1, 2, C});
    double const together = 1 / (1 / m - 1 / (m * m) / (2 / m + C)), p = 2 / (1 / m + 1 / together);
    CHECK(std::abs(v[0] - (1 - p / m)) < 1e-9);
    CHECK(std::abs(v[1] + v[2] - p / m) < 1e-9);
    if (C == 0) CHECK(std::abs(v[1] - v[2]) < 1e-9);
  }
}

// A box that falls flat stays flat: its four corners come back together. Per bounce the sweeps leave 1e-6 of its speed.
TEST_CASE_TEMPLATE("a box that falls flat stays flat", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  d.option.timestep = 0.001;
  d.bodies[0].geoms.push_back(geom(gsp::ShapeType::plane, {0, 0, 1}));
  auto box = geom(gsp::ShapeType::box, {0.2, 0.1, 0.1});
  box.hard = true;
  box.restitution = 0.8;
  box.erp = 0;
  gsp_test::add_free(d, {0, 0, 0.5}, box);
  auto const check = [&](auto number) {
    using R = decltype(number);
    gsp_test::World<R, Exec> w(gsp::compile(d));
    double before = 0;
    for (int i = 0; i < 2000 && w.qvel()(0, 2) <= 0; ++i) {
      before = double(w.qvel()(0, 2));
      w.step(1);
    }
    double const half = 9.81 * 0.001 / 2;  // forces act before and after it
    CHECK(std::abs(double(w.qvel()(0, 2)) - (0.8 * (half - before) - half)) < (sizeof(R) == 4 ? 1e-4 : 1e-5));
    double turned = 0;
    for (int i = 0; i < 20; ++i) {
      w.step(100);
      for (int c = 4; c < 7; ++c) turned = std::fmax(turned, std::abs(double(w.qpos()(0, c))));
    }
    MESSAGE("turned by " << turned);
    CHECK(turned < (sizeof(R) == 4 ? 1e-3 : 1e-4));
    CHECK(std::abs(double(w.qvel()(0, 2))) < 0.1);
  };
  check(1.);
  check(1.f);
}

// What overlaps is parted by erp x / h, a velocity that stays: energy from nowhere, unless erp is 0.
TEST_CASE_TEMPLATE("an overlap is energy where erp takes it back", Exec, GSP_TEST_EXECS) {
  for (double const erp : {0.2, 0.}) {
    gsp::Description d;
    d.option.timestep = 0.001;
    d.option.gravity = {0, 0, 0};
    auto ball = geom(gsp::ShapeType::sphere, {0.1, 0, 0});
    ball.hard = true, ball.restitution = 1, ball.erp = erp;
    gsp_test::add_free(d, {0, 0, 0}, ball);
    gsp_test::add_free(d, {0.199, 0, 0}, ball);
    gsp_test::World<double, Exec> w(gsp::compile(d));
    w.step(1);
    CHECK(w.qvel()(0, 6) - w.qvel()(0, 0) == doctest::Approx(erp * 0.001 / 0.001).epsilon(1e-6));
    w.step(20);
    CHECK((w.qvel()(0, 6) > 0.05) == (erp > 0));
  }
}

// Friction is that of the whole impulse: a sphere that slides through its bounce loses mu (1 + e) v_n along the floor, and turns with it.
TEST_CASE_TEMPLATE("an oblique bounce has its friction", Exec, GSP_TEST_EXECS) {
  double const mu = 0.05, e = 0.5, r = 0.1;
  gsp::Description d;
  d.option.timestep = 0.001;
  d.option.gravity = {0, 0, 0};
  d.bodies[0].geoms.push_back(geom(gsp::ShapeType::plane, {0, 0, 1}));
  auto ball = geom(gsp::ShapeType::sphere, {r, 0, 0});
  ball.hard = true;
  ball.restitution = e;
  ball.friction = {mu, 0, 0};
  d.bodies[0].geoms[0].friction = {mu, 0, 0};
  gsp_test::add_free(d, {0, 0, r}, ball);
  gsp_test::World<double, Exec> w(gsp::compile(d));
  auto const v = w.qvel();
  v(0, 0) = 2, v(0, 2) = -3;
  Kokkos::deep_copy(w.state.qvel, v);
  w.step(1);
  auto const after = w.qvel();
  CHECK(std::abs(after(0, 2) - 3 * e) < 1e-9);
  CHECK(std::abs(after(0, 0) - (2 - mu * (1 + e) * 3)) < 1e-9);
  CHECK(std::abs(after(0, 1)) < 1e-12);
  CHECK(std::abs(after(0, 4) - 2.5 * mu * (1 + e) * 3 / r) < 1e-7);
}

// A ball (e = 1) hits a box that rests on the floor: first the two alone, as in free space; then the floor stops the box, or gives back its
// own share, whereupon it hits the ball no more, as that is faster.
TEST_CASE_TEMPLATE("a ball hits a box on the floor", Exec, GSP_TEST_EXECS) {
  double const h = 0.001, m = 1, M = 3, g = 9.81;
  for (double const floor : {-1.0, 0.0, 0.5}) {  // soft, rigid, and with a restitution
    CAPTURE(floor);
    gsp::Description d;
    d.option.timestep = h;
    auto plane = geom(gsp::ShapeType::plane, {0, 0, 1});
    auto box = geom(gsp::ShapeType::box, {0.2, 0.2, 0.1}, M), ball = geom(gsp::ShapeType::sphere, {0.1, 0, 0}, m);
    plane.hard = box.hard = floor >= 0;
    plane.restitution = box.restitution = std::fmax(floor, 0);
    plane.erp = box.erp = ball.erp = 0;
    ball.hard = true;
    ball.restitution = 1;
    d.bodies[0].geoms.push_back(plane);
    gsp_test::add_free(d, {0, 0, 0.1}, box);
    gsp_test::add_free(d, {0, 0, 0.3}, ball);
    gsp_test::World<double, Exec> w(gsp::compile(d));
    auto const v = w.qvel();
    v(0, 8) = -1;
    Kokkos::deep_copy(w.state.qvel, v);
    w.step(1);
    auto const after = w.qvel();
    CHECK(std::abs(after(0, 8) - ((M - m) / (M + m) - g * h)) < 1e-9);
    double const down = 2 * m / (M + m);
    if (floor == 0) CHECK(std::abs(after(0, 2)) < 1e-5);
    if (floor == 0.5) CHECK(std::abs(after(0, 2) - (0.5 * (down + g * h / 2) - g * h / 2)) < 1e-5);
    for (int c = 3; c < 6; ++c) CHECK(std::abs(after(0, c)) < 1e-5);
  }
}

// The same bits for a world alone and among others.
TEST_CASE_TEMPLATE("a world's impacts depend on its own rows", Exec, GSP_TEST_EXECS) {
  std::vector<double> const m{1, 2, 0.5, 3, 1}, v{1, 0.3, 0.5, -1, 0};
  Touching<double> const touching{{}, 4, 1.0, 3};
  Line<double, Exec> alone(m, 0.001), among(m, 0.001, 37);
  CHECK(alone.hit(v, {}, touching) == among.hit(v, {}, touching));
}

TEST_CASE_TEMPLATE("impacts neither allocates nor waits, does nothing while halted, and is asked for where it is needed", Exec,
                   GSP_TEST_EXECS) {
  std::vector<double> const m{1, 2, 0.5};
  Touching<double> const touching{{}, 2, 0.5};
  Line<double, Exec> s(m, 0.001, 3), two(m, 0.001, 2);
  for (int w = 0; w < 3; ++w) s.set(w, {0, 0, 0}, {1, 0, 0});
  do s.assemble(touching);
  while (s.grow());
  CHECK_THROWS_WITH_AS(s.solve({}), doctest::Contains("call impacts first"), std::invalid_argument);
  Kokkos::deep_copy(s.progress.halt, 1);
  s.impacts();
  CHECK(gsp_test::host(s.rows.row)(0).lower == 0);
  Kokkos::deep_copy(s.progress.halt, 0);
  gsp_test::check_algorithm(s.exec, gsp_test::watch([&] { s.impacts(); }));
  CHECK(gsp_test::host(s.rows.row)(0).lower > 0.9);
  CHECK_THROWS_AS(gsp::impacts(s.exec, s.progress, s.rows, two.impulses, s.solution), std::invalid_argument);
  CHECK_THROWS_AS(s.impacts({.sweeps = 0}), std::invalid_argument);

  // no room for a restitution, more than comes, and of a soft row
  auto const refused = [&](bool room, Touching<double> const& type) {
    s.forget({.worlds = 3, .impacts = room});
    s.assemble(type);
    return (gsp_test::host(s.state.status)(1) & gsp::status::row_refused) != 0;
  };
  CHECK(!refused(true, touching));
  CHECK(refused(false, touching));
  CHECK(refused(true, {{}, 2, 1.5}));
  CHECK(refused(true, {{}, 2, 0.5, 0, true}));
}
