// Noise of ranges and angles: moments and tails, what does not come back, rounding; worlds, rays, units and seeds are independent. (Through
// scans, in batches: tests/ray/ray_scan.cpp.)
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <gsp/ray/ray_noise.hpp>

namespace {
constexpr int n = 400000;
/// A mean of n numbers of variance v lies within 5 sqrt(v / n) of what it should be; once in 2 million it does not.
void check_mean(double sum, double expected, double variance) { CHECK(std::fabs(sum / n - expected) < 5 * std::sqrt(variance / n)); }
gsp::RayNumber number(int i, std::uint32_t world = 0) { return {std::uint64_t(i), world}; }
}  // namespace

// Normal of deviation hypot(0.03, 0.002 * 20 m) = 0.05 m: mean, variance (of variance 2 v^2), fourth power (3 v^2, of variance 96 v^4), and
// the shares beyond one and three deviations. float rounds 20 m to 1e-6.
TEST_CASE_TEMPLATE("ranges err as they are asked to", R, float, double) {
  gsp::RayNoise const noise{.range_sigma = 0.03, .relative_sigma = 0.002, .seed = 5};
  double sum = 0, square = 0, fourth = 0, one = 0, three = 0;
  for (int i = 0; i < n; ++i) {
    double const x = (double(gsp::noisy_range(noise, number(i), R(20))) - 20) / 0.05;
    sum += x;
    square += x * x;
    fourth += x * x * x * x;
    one += std::fabs(x) > 1;
    three += std::fabs(x) > 3;
  }
  check_mean(sum, 0, 1);
  check_mean(square, 1, 2);
  check_mean(fourth, 3, 96);
  check_mean(one, 0.317311, 0.317311 * 0.682689);
  check_mean(three, 0.0026998, 0.0026998);
  // each of the two by itself, at two ranges
  double alone[4] = {};
  for (int i = 0; i < n; ++i) {
    alone[0] += std::pow((double(gsp::noisy_range({.range_sigma = 0.03}, number(i), R(2))) - 2) / 0.03, 2);
    alone[1] += std::pow((double(gsp::noisy_range({.range_sigma = 0.03}, number(i), R(50))) - 50) / 0.03, 2);
    alone[2] += std::pow((double(gsp::noisy_range({.relative_sigma = 0.01}, number(i), R(2))) - 2) / 0.02, 2);
    alone[3] += std::pow((double(gsp::noisy_range({.relative_sigma = 0.01}, number(i), R(50))) - 50) / 0.5, 2);
  }
  for (double const v : alone) check_mean(v, 1, 2);
}

// Components across the ray are sin(bend) cos(angle): normal of 0.0026 rad but for a share of 7e-6.
TEST_CASE("directions err by as much in each direction across them") {
  double const sigma = 0.15 * M_PI / 180;
  gsp::RayNoise const noise{.angle_sigma = sigma, .seed = 6};
  double const a = 1 / std::sqrt(3.), b = std::sqrt(0.5), c = std::sqrt(1 / 6.);
  struct Frame {
    gsp::Vec3<double> d, u, v;
  };
  for (auto const& f : {Frame{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, Frame{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}},
                        Frame{{0, 0, -1}, {1, 0, 0}, {0, 1, 0}}, Frame{{a, -a, -a}, {b, b, 0}, {c, -c, 2 * c}}}) {
    REQUIRE(std::fabs(gsp::dot(f.d, f.u)) + std::fabs(gsp::dot(f.d, f.v)) + std::fabs(gsp::dot(f.u, f.v)) < 1e-15);
    double x = 0, y = 0, xx = 0, yy = 0, xy = 0, tail = 0;
    bool unit = true;
    for (int i = 0; i < n; ++i) {
      auto const bent = gsp::noisy_direction(noise, number(i), f.d);
      unit = unit && std::fabs(gsp::norm(bent) - 1) < 1e-14;
      double const p = gsp::dot(bent, f.u) / sigma, q = gsp::dot(bent, f.v) / sigma;
      x += p;
      y += q;
      xx += p * p;
      yy += q * q;
      xy += p * q;
      tail += p * p + q * q > 9;  // exp(-9 / 2)
    }
    CHECK(unit);
    check_mean(x, 0, 1);
    check_mean(y, 0, 1);
    check_mean(xx, 1, 2);
    check_mean(yy, 1, 2);
    check_mean(xy, 0, 1);
    check_mean(tail, std::exp(-4.5), std::exp(-4.5));
  }
  gsp::Vec3<float> const d{0.6f, 0, 0.8f};
  CHECK(gsp::noisy_direction({}, number(1), d).x == d.x);
  CHECK(gsp::noisy_direction({.range_sigma = 1, .dropout = 0.5}, number(1), d).z == d.z);
}

TEST_CASE("rays that do not come back, and ranges in steps") {
  double lost = 0;
  bool exact = true;
  for (int i = 0; i < n; ++i) {
    float const r = gsp::noisy_range({.dropout = 0.01, .seed = 7}, number(i), 3.25f);
    lost += std::isinf(r);
    exact = exact && (std::isinf(r) || r == 3.25f);
  }
  CHECK(exact);
  check_mean(lost, 0.01, 0.01 * 0.99);
  CHECK(std::isinf(gsp::noisy_range({.dropout = 1}, number(4), 3.f)));
  CHECK(std::isinf(gsp::noisy_range({.range_sigma = 1}, number(4), INFINITY)));
  CHECK(std::isinf(gsp::noisy_range({}, number(4), NAN)));
  CHECK(gsp::noisy_range({}, number(4), 3.3f) == 3.3f);
  for (double const r : {0.0, 0.00125, 1.0, 3.14159, 99.9991}) {
    double const got = gsp::noisy_range({.range_step = 0.0025}, number(1), r);
    CHECK(std::fabs(got / 0.0025 - std::round(got / 0.0025)) < 1e-9);
    CHECK(std::fabs(got - r) <= 0.00125 * (1 + 1e-12));
  }
  // rounded after the noise: errors of 1.4 mm spread over whole steps, to the nearest at least
  double moved = 0;
  for (int i = 0; i < 1000; ++i) {
    double const got = gsp::noisy_range({.range_sigma = 0.01, .range_step = 0.0025}, number(i), 4.0);
    CHECK(std::fabs(got / 0.0025 - std::round(got / 0.0025)) < 1e-9);
    moved += got != 4;
  }
  CHECK(moved > 800);  // 1 - erf(0.125 / sqrt 2) = 0.90 of all
}

// The product of two independent numbers of variance 1 has mean 0 and variance 1.
TEST_CASE("worlds, rays, units and seeds have noise of their own, and each ray always the same") {
  gsp::RayNoise const noise{.range_sigma = 1, .angle_sigma = 0.001, .seed = 8}, unit{.range_sigma = 1, .seed = 8, .unit = 1},
      seed{.range_sigma = 1, .seed = 9}, upper{.range_sigma = 1, .seed = 8 + (1ull << 40)};
  double product[6] = {}, against_angle[2] = {};
  for (int i = 0; i < n; ++i) {
    auto const error = [&](gsp::RayNoise const& of, gsp::RayNumber const& which) { return gsp::noisy_range(of, which, 100.) - 100; };
    double const x = error(noise, number(i));
    double const others[] = {error(noise, number(i, 1)), error(noise, number(i + 1)), error(noise, {std::uint64_t(i) + (1ull << 32), 0}),
                             error(unit, number(i)),     error(seed, number(i)),      error(upper, number(i))};
    for (int k = 0; k < 6; ++k) product[k] += x * others[k];
    auto const bent = gsp::noisy_direction(noise, number(i), gsp::Vec3<double>{1, 0, 0});
    against_angle[0] += x * bent.y / 0.001;
    against_angle[1] += x * bent.z / 0.001;
    if (i % 1000 == 0) CHECK(x == error(noise, number(i)));
  }
  for (double const p : product) check_mean(p, 0, 1);
  for (double const p : against_angle) check_mean(p, 0, 1);
}
