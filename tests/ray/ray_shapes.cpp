// Rays against shapes with a closed form: against a search along the ray for where it goes into the shape and out, by the shape's own
// inequality; and cases by hand. (Beside MuJoCo: tests/oracle/rays.cpp.)
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <gsp/ray/ray_shapes.hpp>

#include "dynamics/random_tree.hpp"

namespace {
using gsp::ShapeType;
template <class T>
using V = gsp::Vec3<T>;

/// How far p is outside: below 0 inside.
double outside(ShapeType type, V<double> const& s, V<double> const& p) {
  switch (type) {
    case ShapeType::sphere:
      return gsp::norm(p) - s.x;
    case ShapeType::ellipsoid:
      return std::hypot(p.x / s.x, p.y / s.y, p.z / s.z) - 1;
    case ShapeType::capsule:
      return std::hypot(p.x, p.y, p.z - std::clamp(p.z, -s.y, s.y)) - s.x;
    case ShapeType::cylinder:
      return std::fmax(std::hypot(p.x, p.y) - s.x, std::fabs(p.z) - s.y);
    default:
      return std::fmax(std::fabs(p.x) - s.x, std::fmax(std::fabs(p.y) - s.y, std::fabs(p.z) - s.z));
  }
}
/// Where a convex shape's surface is first met, by its least point along the ray (golden section) and halving. `least`: how deep the line
/// goes: of what is near 0 the answer hangs on rounding.
double searched(ShapeType type, V<double> const& s, V<double> const& o, V<double> const& d, double& least) {
  auto const f = [&](double x) { return outside(type, s, gsp::fma(x, d, o)); };
  double a = -100 / gsp::norm(d), b = 100 / gsp::norm(d);
  double const far = b;
  for (int i = 0; i < 200; ++i) {
    double const golden = 0.6180339887498949, l = b - golden * (b - a), r = a + golden * (b - a);
    if (f(l) < f(r))
      b = r;
    else
      a = l;
  }
  double const middle = 0.5 * (a + b);
  least = f(middle);
  if (least >= 0) return INFINITY;
  auto const root = [&](double in, double out) {
    for (int i = 0; i < 200; ++i) {
      double const x = 0.5 * (in + out);
      (f(x) < 0 ? in : out) = x;
    }
    return 0.5 * (in + out);
  };
  double const in = root(middle, -far), out = root(middle, far);
  return in >= 0 ? in : out >= 0 ? out : INFINITY;
}
}  // namespace

// What rounding moves is the place along the ray by the place across it over the slope there: epsilon of the size of all numbers, over the
// root of how deep the line goes, as a share of the shape.
TEST_CASE_TEMPLATE("rays meet shapes where a search does", T, double, float) {
  gsp_test::Random r{3};
  int hits = 0, inside = 0, compared = 0;
  for (auto const type : {ShapeType::sphere, ShapeType::ellipsoid, ShapeType::capsule, ShapeType::cylinder, ShapeType::box})
    for (int k = 0; k < 20000; ++k) {
      V<T> const size{T(0.2 + 0.1 * r()), T(0.3 + 0.1 * r()), T(0.25 + 0.1 * r())};
      double const away = k % 3 == 0 ? 0.2 : k % 3 == 1 ? 1 : 5;
      V<T> const o{T(away * r()), T(away * r()), T(away * r())}, target{T(0.4 * r()), T(0.4 * r()), T(0.4 * r())};
      V<T> d = T(std::exp(2 * r())) * (target - o);
      if (k % 50 == 0) d = {T(0), T(0), d.z};  // along an axis
      if (k % 50 == 1) d = {d.x, T(0), T(0)};
      auto const wide = [](V<T> const& v) { return V<double>{double(v.x), double(v.y), double(v.z)}; };
      double least = 0;
      double const expected = searched(type, wide(size), wide(o), wide(d), least), length = gsp::norm(wide(d));
      double const eps = double(std::numeric_limits<T>::epsilon()), scale = 1 + gsp::norm(wide(o));
      if (std::fabs(least) < 100 * eps * scale) continue;                               // a tangent
      if (std::fabs(outside(type, wide(size), wide(o))) < 100 * eps * scale) continue;  // begins on the surface
      ++compared;
      auto const hit = gsp::ray_shape(type, size, gsp::Ray<T>{o, d});
      T const x = hit.x;
      CAPTURE(int(type));
      CAPTURE(k);
      REQUIRE(std::isinf(x) == std::isinf(expected));
      if (std::isinf(x)) continue;
      ++hits;
      inside += outside(type, wide(size), wide(o)) < 0;
      CHECK(std::fabs(double(x) - expected) * length <= 200 * eps * scale / std::sqrt(std::fmin(1., -least)));
      auto const p = gsp::Ray<T>{o, d}.at(x);
      auto const n = wide(hit.normal);
      CHECK(gsp::norm(n) == doctest::Approx(1).epsilon(10 * eps));
      // outward: a step along it leaves the shape
      CHECK(outside(type, wide(size), gsp::fma(1e-3, n, wide(p))) > 0);
    }
  CHECK(compared > 99000);
  CHECK(hits > 20000);
  CHECK(inside > 2000);
}

TEST_CASE("what a ray does not meet") {
  using T = float;
  V<T> const size{1, 1, 1};
  T const nan = NAN;
  for (auto const type :
       {ShapeType::plane, ShapeType::sphere, ShapeType::ellipsoid, ShapeType::capsule, ShapeType::cylinder, ShapeType::box}) {
    CAPTURE(int(type));
    for (auto const& ray : {gsp::Ray<T>{{nan, 0, 3}, {0, 0, -1}}, {{0, 0, 3}, {0, nan, -1}}, {{0, 0, nan}, {0, 0, -1}}})
      CHECK(std::isinf(gsp::ray_shape(type, size, ray).x));
    CHECK(std::isinf(gsp::ray_shape(type, size, gsp::Ray<T>{{0, 0, 3}, {0, 0, 1}}).x));   // away from it
    CHECK(std::isinf(gsp::ray_shape(type, size, gsp::Ray<T>{{5, 5, 3}, {0, 0, -1}}).x));  // beside it
    CHECK(gsp::ray_shape(type, size, gsp::Ray<T>{{0.25f, 0, 3}, {0, 0, -2}}).x > 0.4f);
  }
}

TEST_CASE("a plane is met from its front, within its extent where it has one") {
  using T = double;
  auto const plane = [](V<T> const& size, V<T> const& o, V<T> const& d) {
    return gsp::ray_shape(ShapeType::plane, size, gsp::Ray<T>{o, d}).x;
  };
  CHECK(plane({0, 0, 1}, {100, -50, 2}, {1, 0, -0.5}) == 4);
  CHECK(std::isinf(plane({0, 0, 1}, {0, 0, -2}, {0, 0, 1})));  // from below
  CHECK(plane({0, 0, 1}, {0, 0, 0}, {0, 0, -1}) == 0);         // from on it
  CHECK(std::isinf(plane({0, 0, 1}, {0, 0, 1}, {1, 0, 0})));   // along it
  CHECK(plane({2, 0, 1}, {1, 50, 1}, {0, 0, -1}) == 1);
  CHECK(std::isinf(plane({2, 0, 1}, {2.5, 0, 1}, {0, 0, -1})));
  CHECK(std::isinf(plane({2, 1, 1}, {0, 1.5, 1}, {0, 0, -1})));
}

// A few roundings of 100 m, 6e-6 m each: b^2 - 4 a c in numbers of float would lose all of the radius.
TEST_CASE("a small ball far away keeps its digits in float, in any direction") {
  gsp_test::Random r{9};
  for (int k = 0; k < 1000; ++k) {
    gsp::Vec3<double> const to = gsp::normalized(gsp::Vec3<double>{r(), r(), r()});
    V<float> const o{float(-100 * to.x), float(-100 * to.y), float(-100 * to.z)}, d{float(to.x), float(to.y), float(to.z)};
    double least = 0;
    auto const wide = [](V<float> const& v) { return V<double>{double(v.x), double(v.y), double(v.z)}; };
    double const expected = searched(ShapeType::sphere, {0.05, 0, 0}, wide(o), 2. * wide(d), least) * 2;
    float const x = gsp::ray_shape(ShapeType::sphere, V<float>{0.05f, 0, 0}, gsp::Ray<float>{o, d}).x;
    CHECK(std::fabs(double(x) - expected) < 2e-5);
  }
}

TEST_CASE_TEMPLATE("directions of any length", T, double, float) {
  V<T> const size{1, 1, 1};
  for (auto const type :
       {ShapeType::plane, ShapeType::sphere, ShapeType::ellipsoid, ShapeType::capsule, ShapeType::cylinder, ShapeType::box})
    for (double const length : {1e-37, 1e-20, 1e-8, 1e8, 1e20, 1e38}) {
      CAPTURE(length);
      T const scale = T(length);
      auto const hit = gsp::ray_shape(type, size, gsp::Ray<T>{{T(0.25), T(0.125), 4}, {scale * T(0.01), T(0), -scale}});
      auto const one = gsp::ray_shape(type, size, gsp::Ray<T>{{T(0.25), T(0.125), 4}, {T(0.01), T(0), T(-1)}});
      CHECK(double(hit.x) * length == doctest::Approx(double(one.x)).epsilon(1e-5));
      CHECK(hit.normal.z == doctest::Approx(one.normal.z));
    }
  // nearly along the axis, beside it at the cap
  auto const hit = gsp::ray_shape(ShapeType::cylinder, V<double>{1, 1, 0}, gsp::Ray<double>{{1 + 5e-6, 0, 100}, {-9e-8, 0, -1}});
  CHECK(hit.x == doctest::Approx(99).epsilon(1e-12));
}

TEST_CASE("a thin plate far away shows the side that is seen") {
  for (float const z : {1000.f, -1000.f}) {
    auto const hit = gsp::ray_shape(ShapeType::box, V<float>{1, 1, 1e-6f}, gsp::Ray<float>{{0, 0, z}, {0, 0, z > 0 ? -1.f : 1.f}});
    CHECK(hit.x == 1000);
    CHECK(hit.normal.z == (z > 0 ? 1 : -1));
    auto const disc = gsp::ray_shape(ShapeType::cylinder, V<float>{1, 1e-6f, 0}, gsp::Ray<float>{{0.5f, 0, z}, {0, 0, z > 0 ? -1.f : 1.f}});
    CHECK(disc.normal.z == (z > 0 ? 1 : -1));
  }
}
