#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/constraint/eliminate.hpp>
#include <gsp/solver/residual.hpp>
#include <gsp_test_execs.hpp>
#include <limits>
#include <memory>

#include "step/world.hpp"
#include "support/kernels.hpp"
#include "support/kokkos_tools.hpp"

namespace {
constexpr int worlds = 3;

/// Capsules of condim 1, 3, 4 and 6 that slide and roll on a floor, two boxes tied to each other, and an arm: dry joints, one beyond its
/// limit, two of them coupled.
gsp::Description scene() {
  gsp::Description d;
  d.bodies[0].geoms.push_back(gsp_test::geom(gsp::ShapeType::plane, {5, 5, 1}));
  d.bodies[0].geoms[0].condim = 1;
  d.bodies[0].geoms[0].friction = {0.1, 0.001, 0.0001};
  int const condims[] = {1, 3, 4, 6};
  for (int i = 0; i < 4; ++i) {
    auto g = gsp_test::geom(gsp::ShapeType::capsule, {0.1, 0.2, 0}, 1 + i);
    g.condim = condims[i];
    g.friction = {0.4, 0.02, 0.003};
    g.quat = {0.7071067811865476, 0, 0.7071067811865476, 0};
    gsp_test::add_free(d, {0, double(i), 0.0995}, g);
  }
  for (int i = 0; i < 2; ++i) {
    auto g = gsp_test::geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 2);
    gsp_test::add_free(d, {-1, 0.5 * i, 0.0995}, g);
    d.bodies.back().name = i ? "right" : "left";
  }
  for (int i = 0; i < 3; ++i) {
    gsp::BodyDescription b;
    b.parent = i == 0 ? 0 : int(d.bodies.size()) - 1;
    b.pos = {i == 0 ? 2 : 0.3, 0, i == 0 ? 2. : 0.};
    auto& j = b.joints.emplace_back();
    j.name = "j" + std::to_string(i);
    j.axis = {0, 1, 0};
    j.frictionloss = 0.2;
    j.limited = i == 1;
    j.range = {0.1, 1};
    auto g = gsp_test::geom(gsp::ShapeType::sphere, {0.05, 0, 0}, 0.5);
    g.pos = {0.3, 0, 0};
    b.geoms.push_back(g);
    d.bodies.push_back(b);
  }
  auto& tie = d.equalities.emplace_back();
  tie.name1 = "left";
  tie.name2 = "right";
  tie.data = {0, 0.25, 0};
  auto& coupled = d.equalities.emplace_back();
  coupled.type = gsp::EqualityType::joint;
  coupled.name1 = "j0";
  coupled.name2 = "j2";
  coupled.data = {0, 1};
  return d;
}

template <class R, class Exec>
struct Scene : gsp_test::World<R, Exec> {
  gsp::Residuals<R, typename Exec::memory_space> left;
  Scene(gsp::Profile profile, gsp::FrictionCone cone, bool eliminate)
      : gsp_test::World<R, Exec>(gsp::compile(scene()), worlds, {.profile = profile}) {
    auto& s = *this;
    s.sim.cone = cone;
    s.sim.rows = gsp::make_rows(s.exec, s.model, {.worlds = worlds, .eliminate = eliminate});
    s.sim.impulses = gsp::make_impulses(s.exec, s.sim.rows);
    left = gsp::make_residuals(s.exec, s.sim.rows);
    auto const v = gsp_test::host(s.state.qvel);
    for (int w = 0; w < worlds; ++w)
      for (int i = 0; i < 24; ++i) v(w, i) = R(i % 6 < 2 || i % 6 > 3 ? std::sin(1 + i + 7 * w) : 0.);
    Kokkos::deep_copy(s.state.qvel, v);
  }
  void find() {
    gsp::residuals(this->exec, this->sim.rows, this->sim.impulses, this->sim.progress, left);
    this->exec.fence();
  }
  auto impulses() const { return this->sim.impulses.p[gsp_test::host(this->sim.impulses.parity)()]; }
};

/// Parts, and what they may differ by in rounding.
struct Parts {
  double equality = 0, complementarity = 0, friction = 0, bounds = 0, cone = 0, energy = 0;
  double rate() const { return std::fmax(equality, std::fmax(complementarity, friction)); }
  double rate_scale = 0, impulse_scale = 0, energy_scale = 0;
  int of_bounds = 0, of_friction = 0, of_equality = 0;
};

/// The nearest point to x of the cone |y_b / mu_b| <= y_0, where distances count as A (y - x)^2. Its conditions are checked: y in the cone,
/// d = A (y - x) in the dual cone |mu_b d_b| <= d_0, y . d = 0.
std::vector<double> nearest_in_cone(std::vector<double> const& x, std::vector<double> const& mu, std::vector<double> const& A) {
  std::size_t const n = x.size();
  auto const on = [&](double lambda) {
    std::vector<double> y(n);
    double sum = 0;
    for (std::size_t b = 1; b < n; ++b) {
      y[b] = x[b] / (1 + lambda / (A[b] * mu[b] * mu[b]));
      sum += y[b] * y[b] / (mu[b] * mu[b]);
    }
    y[0] = std::sqrt(sum);
    return y;
  };
  auto y = on(0);
  if (y[0] <= x[0]) return x;
  double dual = 0, least = 1e-30, most = 1e30;
  for (std::size_t b = 1; b < n; ++b) dual += std::pow(mu[b] * A[b] * x[b], 2);
  if (std::sqrt(dual) <= -A[0] * x[0]) return std::vector<double>(n, 0.);
  for (int i = 0; i < 500; ++i) {
    double const lambda = std::sqrt(least * most);
    y = on(lambda);
    ((A[0] - lambda) * y[0] > A[0] * x[0] ? least : most) = lambda;
  }
  double product = 0, size = 0, d_t = 0;
  for (std::size_t b = 0; b < n; ++b) {
    double const d = A[b] * (y[b] - x[b]);
    product += d * y[b];
    size += A[b] * (x[b] * x[b] + y[b] * y[b]);
    if (b > 0) d_t += std::pow(mu[b] * d, 2);
  }
  CHECK(std::abs(product) <= 1e-10 * size);
  CHECK(std::sqrt(d_t) <= A[0] * (y[0] - x[0]) + 1e-7 * std::sqrt(A[0] * size));
  return y;
}

/// From the definitions, densely, in double.
template <class S>
Parts reference(S const& s, int world) {
  auto const row = gsp_test::host(s.sim.rows.row);
  auto const element_rows = gsp_test::host(s.sim.rows.element_rows);
  auto const Y = gsp_test::host(s.sim.rows.Y);
  auto const ints = gsp_test::host(s.model.ints);
  auto const impulse = gsp_test::host(s.impulses());
  int const first = gsp_test::host(s.sim.rows.first)(world), n = gsp_test::host(s.sim.rows.count)(world);
  std::vector<std::vector<double>> y(std::size_t(n), std::vector<double>(std::size_t(s.model.nv), 0.));
  std::vector<double> p, w, size, A;
  std::vector<double> z(std::size_t(s.model.nv), 0.), z_size(std::size_t(s.model.nv), 0.);
  Parts out;
  for (int i = 0; i < n; ++i) {
    auto const& r = row(first + i);
    REQUIRE(!r.eliminated);
    std::int64_t at = r.first_entry;
    for (auto const& segment : r.segment)
      for (int e = 0; e < segment.count; ++e, ++at)
        y[i][std::size_t(segment.dof0 + (segment.list < 0 ? e : ints(segment.list + e)))] = double(Y(at));
    p.push_back(double(impulse(first + i)));
    A.push_back(r.inverse_diagonal > 0 ? 1 / double(r.inverse_diagonal) : 0);
    out.impulse_scale = std::fmax(out.impulse_scale, std::abs(p[i]) / (r.friction_of >= 0 ? double(r.mu) : 1));
    for (int k = 0; k < s.model.nv; ++k) {
      z[k] += y[i][k] * p[i];
      z_size[k] += std::abs(y[i][k] * p[i]);
    }
  }
  for (int k = 0; k < s.model.nv; ++k) {
    out.energy += z[k] * z[k] / 2;
    out.energy_scale += z_size[k] * z_size[k];
  }
  double least = 1e30, most = 0;
  for (int i = 0; i < n; ++i) {
    double const C = double(row(first + i).compliance), b = double(row(first + i).bias);
    double rate = b + C * p[i], sum = std::abs(b) + std::abs(C * p[i]) + A[i] * std::abs(p[i]);
    for (int k = 0; k < s.model.nv; ++k) {
      rate += y[i][k] * z[k];
      sum += std::abs(y[i][k]) * z_size[k];
    }
    w.push_back(rate);
    size.push_back(sum);
    out.energy += C * p[i] * p[i] / 2 + b * p[i];
    out.energy_scale += C * p[i] * p[i] / 2 + std::abs(b * p[i]);
    out.rate_scale = std::fmax(out.rate_scale, sum);
    if (A[i] > 0) {
      least = std::fmin(least, A[i]);
      most = std::fmax(most, A[i]);
    }
  }
  out.rate_scale *= std::sqrt(most / least);  // by how much a rate's error may change another's
  auto const raise = [](double& to, double x) { to = std::fmax(to, x); };
  for (int e = 0; e < n; e += element_rows(first + e)) {
    int const rows = element_rows(first + e);
    auto const law = [&](int b) -> auto const& { return row(first + e + b); };
    for (int b = 0; b < rows; ++b) {
      int const i = e + b, a = law(b).friction_of;
      double const mu = double(law(b).mu);
      if (a < 0) {
        double const low = double(law(b).lower), high = double(law(b).upper);
        raise(out.bounds, std::fmax(low - p[i], p[i] - high));
        bool const is_free = low < -1e30 && high > 1e30;
        ++(is_free ? out.of_equality : out.of_bounds);
        std::vector<double> x{p[i] - w[i] / A[i]}, mus{0}, weights{A[i]};
        std::vector<int> own{i};
        for (int c = 0; c < rows && s.model.profile == gsp::Profile::mujoco; ++c) {
          if (law(c).friction_of != b) continue;
          own.push_back(e + c);
          mus.push_back(double(law(c).mu));
          weights.push_back(A[e + c]);
          x.push_back(p[e + c] - w[e + c] / A[e + c]);
        }
        if (own.size() == 1) {
          if (A[i] > 0) raise(is_free ? out.equality : out.complementarity, A[i] * std::abs(p[i] - std::clamp(x[0], low, high)));
          continue;
        }
        auto const to = nearest_in_cone(x, mus, weights);
        double slip = 0;
        for (std::size_t c = 0; c < own.size(); ++c) {
          raise(c == 0 ? out.complementarity : out.friction, weights[c] * std::abs(p[own[c]] - to[c]));
          if (c > 0) slip = std::hypot(slip, p[own[c]] / mus[c]);
        }
        raise(out.cone, slip - std::fmax(p[i], 0));
        continue;
      }
      ++out.of_friction;
      if (s.model.profile == gsp::Profile::mujoco || (b > 0 && law(b - 1).with_next)) continue;
      double const normal = std::abs(p[e + a]);
      int const together = law(b).with_next ? 2 : 1;
      double slip = 0, next = 0;
      for (int c = 0; c < together; ++c) {
        slip = std::hypot(slip, p[i + c] / double(law(b + c).mu));
        next = std::hypot(next, (p[i + c] - w[i + c] / A[i + c]) / double(law(b + c).mu));
      }
      raise(out.cone, slip - normal);
      for (int c = 0; c < together; ++c) {
        double const to = (p[i + c] - w[i + c] / A[i + c]) * std::fmin(1, normal / next);
        if (A[i + c] > 0) raise(out.friction, A[i + c] * std::abs(p[i + c] - to));
      }
      CHECK(mu > 0);
    }
  }
  return out;
}

struct Case {
  gsp::Profile profile;
  gsp::FrictionCone cone;
};
constexpr Case cases[] = {{gsp::Profile::stable, gsp::FrictionCone::elliptic},
                          {gsp::Profile::stable, gsp::FrictionCone::box},
                          {gsp::Profile::stable, gsp::FrictionCone::pyramidal},
                          {gsp::Profile::mujoco, gsp::FrictionCone::elliptic},
                          {gsp::Profile::mujoco, gsp::FrictionCone::pyramidal}};

/// The parts of all worlds are those of the reference. Each is a sum of at most n + nv + 30 terms of its scale.
template <class R, class S>
Parts check(S& s) {
  s.find();
  auto const count = gsp_test::host(s.sim.rows.count);
  Parts sum;
  for (int w = 0; w < worlds; ++w) {
    CAPTURE(w);
    auto const r = reference(s, w);
    double const e = (count(w) + s.model.nv + 30) * double(std::numeric_limits<R>::epsilon());
    auto const part = [&](auto const& view) { return double(gsp_test::host(view)(w)); };
    CHECK(std::abs(part(s.left.rate) - r.rate()) <= e * r.rate_scale);
    CHECK(std::abs(part(s.left.equality) - r.equality) <= e * r.rate_scale);
    CHECK(std::abs(part(s.left.complementarity) - r.complementarity) <= e * r.rate_scale);
    CHECK(std::abs(part(s.left.friction) - r.friction) <= e * r.rate_scale);
    CHECK(std::abs(part(s.left.bounds) - r.bounds) <= e * r.impulse_scale);
    CHECK(std::abs(part(s.left.cone) - r.cone) <= e * r.impulse_scale);
    CHECK(std::abs(part(s.left.energy) - r.energy) <= e * r.energy_scale);
    sum.equality += r.equality / worlds;
    sum.complementarity += r.complementarity / worlds;
    sum.friction += r.friction / worlds;
    sum.bounds += r.bounds / worlds;
    sum.cone += r.cone / worlds;
    sum.of_bounds += r.of_bounds;
    sum.of_friction += r.of_friction;
    sum.of_equality += r.of_equality;
  }
  return sum;
}
}  // namespace

TEST_CASE_TEMPLATE("parts are those of their definitions", Exec, GSP_TEST_EXECS) {
  auto const all = [](auto zero) {
    using R = decltype(zero);
    for (auto const& c : cases) {
      CAPTURE(int(c.profile));
      CAPTURE(int(c.cone));
      Scene<R, Exec> s(c.profile, c.cone, false);
      s.step(20, {.iterations = 3});
      auto const solved = check<R>(s);
      CHECK(solved.of_bounds > 30);
      CHECK(solved.of_equality > 9);
      CHECK((c.cone == gsp::FrictionCone::pyramidal) == (solved.of_friction == 0));
      // Any impulses: outside of their bounds and cones.
      auto const p = gsp_test::host(s.impulses());
      for (std::size_t i = 0; i < p.extent(0); ++i) p(i) += R(0.02) * R(std::sin(double(3 * i)));
      Kokkos::deep_copy(s.impulses(), p);
      auto const wrong = check<R>(s);
      CHECK(wrong.bounds > 0.01);
      CHECK((wrong.cone > 0.01) == (c.cone != gsp::FrictionCone::pyramidal));
      CHECK(wrong.equality > 0.01);
      CHECK(wrong.complementarity > 0.01);
    }
  };
  all(0.);
  all(0.f);
}

// Sweeps without end and Newton's method leave rounding, by as much as a part may differ from the reference; one sweep, one iteration
// more. What pgs says of its own sweeps is the same but for rounding.
TEST_CASE_TEMPLATE("converged solves leave rounding alone", Exec, GSP_TEST_EXECS) {
  for (auto const& c : cases) {
    CAPTURE(int(c.profile));
    CAPTURE(int(c.cone));
    auto const solved = [&](int iterations) {
      auto s = std::make_unique<Scene<double, Exec>>(c.profile, c.cone, false);
      s->step(20);
      gsp::step(s->exec, s->model, s->state, s->sim,
                {.steps = 1,
                 .solver = {.iterations = iterations, .tolerance = 0, .residual = true},
                 .newton = {.iterations = iterations > 1 ? 100 : 1, .warm = iterations > 1}});
      s->find();
      return s;
    };
    auto const once = solved(1), whole = solved(20000);
    auto const rate_once = gsp_test::host(once->left.rate), rate = gsp_test::host(whole->left.rate);
    auto const bounds = gsp_test::host(whole->left.bounds), cone = gsp_test::host(whole->left.cone);
    auto const own = gsp_test::host(whole->sim.solution.residual), own_once = gsp_test::host(once->sim.solution.residual);
    auto const energy = gsp_test::host(whole->left.energy);
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(w);
      auto const r = reference(*whole, w);
      double const e = (gsp_test::host(whole->sim.rows.count)(w) + whole->model.nv + 30) * std::numeric_limits<double>::epsilon();
      CHECK(rate(w) <= e * r.rate_scale);
      CHECK(bounds(w) == 0);
      CHECK(cone(w) <= e * r.impulse_scale);
      CHECK(energy(w) < 0);  // of no impulses it is 0
      CHECK(rate_once(w) > 1e-6);
      if (c.profile == gsp::Profile::mujoco) continue;
      CHECK(std::abs(rate(w) - own(w)) <= e * r.rate_scale);
      CHECK(std::abs(rate_once(w) - own_once(w)) <= e * r.rate_scale);
    }
  }
}

// Impulses that are put outside of a bound and of a cone by hand are told by as much. Halves and quarters: exact, but for the float that mu
// was in the file (mu is the row's).
TEST_CASE_TEMPLATE("impulses outside of bounds and cones are told by how much", Exec, GSP_TEST_EXECS) {
  for (auto const& c : {cases[0], cases[1], cases[3]}) {
    CAPTURE(int(c.profile));
    CAPTURE(int(c.cone));
    Scene<double, Exec> s(c.profile, c.cone, true);
    s.step(1);
    auto const row = gsp_test::host(s.sim.rows.row);
    auto const element_rows = gsp_test::host(s.sim.rows.element_rows);
    auto const first = gsp_test::host(s.sim.rows.first), count = gsp_test::host(s.sim.rows.count);
    auto const p = gsp_test::host(s.impulses());
    auto const put = [&](int r, std::initializer_list<double> values) {
      Kokkos::deep_copy(p, 0.);
      int at = first(1) + r;
      for (double x : values) p(at++) = x;
      Kokkos::deep_copy(s.impulses(), p);
      s.find();
    };
    auto const bounds = [&](int w) { return gsp_test::host(s.left.bounds)(w); };
    auto const cone = [&](int w) { return gsp_test::host(s.left.cone)(w); };
    int seen = 0;
    bool dry = false;
    for (int r = 0; r < count(1); r += element_rows(first(1) + r)) {
      int const n = element_rows(first(1) + r);
      auto const mu = [&](int b) { return row(first(1) + r + b).mu; };
      if (n == 1 && row(first(1) + r).lower == -row(first(1) + r).upper && row(first(1) + r).upper < 1 && !dry) {  // of a dry joint
        dry = true;
        put(r, {row(first(1) + r).upper + 0.25});
        CHECK(bounds(1) == doctest::Approx(0.25).epsilon(1e-15));
        CHECK(bounds(0) == 0);
      }
      if (n < 3 || row(first(1) + r + 1).friction_of < 0 || seen >> n & 1) continue;
      seen |= 1 << n;
      CAPTURE(n);
      put(r, {-0.5});
      CHECK(bounds(1) == 0.5);
      CHECK(cone(1) == 0);
      put(r, {1, mu(1) * 0.75, mu(2)});  // |(3/4, 1)| = 5/4
      bool const together = c.cone != gsp::FrictionCone::box;
      CHECK(cone(1) == doctest::Approx(together ? 0.25 : 0).epsilon(1e-14));
      put(r, {1, mu(1) * 1.5});
      CHECK(cone(1) == doctest::Approx(0.5).epsilon(1e-14));
      CHECK(cone(0) == 0);
      CHECK(bounds(1) == 0);
      if (n > 3) {  // torsion beside the tangents: by itself, or in the ellipsoid with them
        put(r, {1, mu(1) * 0.75, 0, mu(3)});
        CHECK(cone(1) == doctest::Approx(c.profile == gsp::Profile::mujoco ? 0.25 : 0).epsilon(1e-14));
        put(r, {1, 0, 0, mu(3) * 2});
        CHECK(cone(1) == doctest::Approx(1).epsilon(1e-14));
      }
      if (n > 4) {  // rolling
        put(r, {2, 0, 0, 0, mu(4) * 3, mu(5) * 4});
        CHECK(cone(1) == doctest::Approx(together ? 3 : 2).epsilon(1e-14));
      }
    }
    CHECK(dry);
    CHECK(seen == (1 << 3 | 1 << 4 | 1 << 6));
  }
}

// With rows eliminated it is the same problem: the energy of any impulses is that of all rows, and where the eliminated ones are what they
// must be, so are rates of rows without bounds. Not restored, they are told.
TEST_CASE_TEMPLATE("eliminated rows have their part", Exec, GSP_TEST_EXECS) {
  Scene<double, Exec> s(gsp::Profile::stable, gsp::FrictionCone::elliptic, true),
      swept(gsp::Profile::stable, gsp::FrictionCone::elliptic, false);
  s.step(1);
  swept.step(1);
  auto const first = gsp_test::host(s.sim.rows.first), count = gsp_test::host(s.sim.rows.count);
  REQUIRE(gsp_test::host(s.sim.rows.eliminated)(0) > 0);
  REQUIRE(gsp_test::host(swept.sim.rows.count)(2) == count(2));
  auto const p = gsp_test::host(s.impulses()), of_swept = gsp_test::host(swept.impulses());
  auto const compare = [&](bool restored) {
    for (int w = 0; w < worlds; ++w)
      for (int r = 0; r < count(w); ++r) of_swept(gsp_test::host(swept.sim.rows.first)(w) + r) = p(first(w) + r);
    Kokkos::deep_copy(swept.impulses(), of_swept);
    s.find();
    swept.find();
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(w);
      auto const r = reference(swept, w);
      double const e = 10 * (count(w) + s.model.nv + 30) * std::numeric_limits<double>::epsilon();
      CHECK(std::abs(gsp_test::host(s.left.energy)(w) - r.energy) <= e * r.energy_scale);
      if (restored) CHECK(std::abs(gsp_test::host(s.left.equality)(w) - r.equality) <= e * r.rate_scale);
    }
  };
  compare(true);
  for (std::size_t i = 0; i < p.extent(0); ++i) p(i) += 0.02 * std::sin(double(3 * i));
  Kokkos::deep_copy(s.impulses(), p);
  compare(false);
  CHECK(gsp_test::host(s.left.equality)(0) > 0.1);
  gsp::restore_rows(s.exec, s.sim.rows, s.sim.progress, s.sim.impulses, s.sim.solution.z);
  s.exec.fence();
  Kokkos::deep_copy(p, s.impulses());
  compare(true);
}

// Rows of islands that sleep lie behind the others, and are not looked at.
TEST_CASE_TEMPLATE("what sleeps leaves nothing", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  d.option.sleep = true;
  d.bodies[0].geoms.push_back(gsp_test::geom(gsp::ShapeType::plane, {5, 5, 1}));
  for (int i = 0; i < 2; ++i) gsp_test::add_free(d, {double(i), 0, 0.0999}, gsp_test::geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 1));
  gsp_test::World<double, Exec> s(gsp::compile(d));
  s.step(2000);
  CHECK(gsp_test::host(s.sim.rows.count)(0) == 0);
  REQUIRE(gsp_test::host(s.sim.rows.kept)(0) > 0);
  auto left = gsp::make_residuals(s.exec, s.sim.rows);
  Kokkos::deep_copy(left.rate, 1.);
  Kokkos::deep_copy(left.energy, 1.);
  gsp::residuals(s.exec, s.sim.rows, s.sim.impulses, s.sim.progress, left);
  s.exec.fence();
  CHECK(gsp_test::host(left.rate)(0) == 0);
  CHECK(gsp_test::host(left.energy)(0) == 0);
}

TEST_CASE_TEMPLATE("residuals keep the promises of an algorithm", Exec, GSP_TEST_EXECS) {
  Scene<double, Exec> s(gsp::Profile::stable, gsp::FrictionCone::elliptic, true);
  CHECK_THROWS_AS(s.find(), std::invalid_argument);  // nothing has been solved
  // example-begin residuals
  s.step(3);
  auto left = gsp::make_residuals(s.exec, s.sim.rows);
  gsp::residuals(s.exec, s.sim.rows, s.sim.impulses, s.sim.progress, left);  // left.rate(w), left.cone(w) ...: on s.exec's device
  // example-end residuals
  s.exec.fence();
  auto const bits = [](auto const& l) {
    std::vector<double> out;
    auto const append = [&](auto const& view) {
      auto const on_host = gsp_test::host(view);
      for (int w = 0; w < worlds; ++w) out.push_back(on_host(w));
    };
    append(l.rate);
    append(l.equality);
    append(l.complementarity);
    append(l.friction);
    append(l.bounds);
    append(l.cone);
    append(l.energy);
    return out;
  };
  auto const expected = bits(left);
  CHECK(expected[0] > 0);
#if defined(KOKKOS_ENABLE_OPENMP)
  if constexpr (std::is_same_v<Exec, Kokkos::OpenMP>)  // the same bits for any number of threads
    for (int threads : {1, 2}) {
      if (threads > s.exec.concurrency()) continue;
      auto again = gsp::make_residuals(s.exec, s.sim.rows);
      gsp::residuals(Kokkos::OpenMP(threads), s.sim.rows, s.sim.impulses, s.sim.progress, again);
      s.exec.fence();
      CHECK(bits(again) == expected);
    }
#endif
  auto const other = gsp_test::other_instance(s.exec);
  gsp_test::check_algorithm(other, gsp_test::watch([&] { gsp::residuals(other, s.sim.rows, s.sim.impulses, s.sim.progress, left); }));
  other.fence();
  CHECK(bits(left) == expected);
  // A step that did not fit: nothing is said of it. A world that has gone wrong says so, alone.
  auto const p = gsp_test::host(s.impulses());
  p(gsp_test::host(s.sim.rows.first)(1)) = std::nan("");
  Kokkos::deep_copy(s.impulses(), p);
  Kokkos::deep_copy(s.sim.progress.halt, 1);
  gsp::residuals(s.exec, s.sim.rows, s.sim.impulses, s.sim.progress, left);
  s.exec.fence();
  CHECK(bits(left) == expected);
  Kokkos::deep_copy(s.sim.progress.halt, 0);
  gsp::residuals(s.exec, s.sim.rows, s.sim.impulses, s.sim.progress, left);
  s.exec.fence();
  auto const wrong = bits(left);
  for (std::size_t i = 0; i < wrong.size(); ++i) {
    if (i % worlds != 1) CHECK(wrong[i] == expected[i]);
  }
  CHECK(std::isnan(wrong[1]));
  CHECK(std::isnan(wrong[6 * worlds + 1]));
  auto few = gsp::make_residuals(s.exec, gsp::make_rows(s.exec, s.model, {.worlds = 1}));
  CHECK_THROWS_AS(gsp::residuals(s.exec, s.sim.rows, s.sim.impulses, s.sim.progress, few), std::invalid_argument);
}
