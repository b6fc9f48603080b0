// Livox units: the prisms beside a second way to the same rays, in long double; that sequences do not repeat and cover more and more; the
// analytic forms as they are written, at times that are not reduced; what is refused.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <gsp/ray/livox_pattern.hpp>
#include <set>

namespace {
using Long = long double;
constexpr Long pi = 3.141592653589793238462643383279502884L;
struct Vec {
  Long x, y, z;
};
Vec turned(Vec const& v, Long angle) {  // about x
  Long const c = std::cos(angle), s = std::sin(angle);
  return {v.x, c * v.y - s * v.z, s * v.y + c * v.z};
}
Vec tilted(Vec const& v, Long angle) {  // about z
  Long const c = std::cos(angle), s = std::sin(angle);
  return {c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}
/// Through a surface whose normal is x: the angle behind it by bisection of n sin a = n' sin a', then the ray in the plane of both.
Vec through(Vec const& d, Long before, Long behind) {
  Long const across = std::hypot(d.y, d.z), a = std::atan2(across, d.x);
  Long low = 0, high = pi / 2;
  for (int i = 0; i < 80; ++i) {
    Long const middle = (low + high) / 2;
    (behind * std::sin(middle) < before * std::sin(a) ? low : high) = middle;
  }
  Long const s = across > 0 ? std::sin(low) / across : 0;
  return {std::cos(low), s * d.y, s * d.z};
}
/// The same in the frame of a wedge that has turned by `phase`, whose slanted surface is tilted by `tilt`.
Vec through_slant(Vec const& d, Long phase, Long tilt, Long before, Long behind) {
  return turned(tilted(through(tilted(turned(d, -phase), -tilt), before, behind), tilt), phase);
}
Vec prisms(std::int64_t sample, Long index, bool flat_outside) {
  Long const t = Long(sample + 1) * 1e-5L, first = 2 * pi * 7294 / 60 * t, second = -2 * pi * 4664 / 60 * t, tilt = 18 * pi / 180;
  Vec d{1, 0, 0};
  if (flat_outside) {
    d = through_slant(through(d, 1, index), first, -tilt, index, 1);
    return through(through_slant(d, second, tilt, 1, index), index, 1);
  }
  d = through(through_slant(d, first, -tilt, 1, index), index, 1);
  return through_slant(through(d, 1, index), second, tilt, index, 1);
}
double degrees_between(gsp::Double3 const& a, gsp::Double3 const& b) {
  return 180 / M_PI * std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);  // of near directions
}
double up_of(gsp::Double3 const& d) { return std::asin(d[2]) * 180 / M_PI; }
double turn_of(gsp::Double3 const& d) { return std::atan2(d[1], d[0]) * 180 / M_PI; }
/// Cells of 0.1 degrees of azimuth and elevation that the first n rays have met.
std::size_t cells(gsp::RayPattern const& p, std::size_t n) {
  std::set<std::pair<long, long>> seen;
  for (std::size_t k = 0; k < n; ++k) seen.insert({std::lround(10 * turn_of(p.direction[k])), std::lround(10 * up_of(p.direction[k]))});
  return seen.size();
}
}  // namespace

// Bisection in long double, phases 2 pi f t of t up to 4 s, 5e-8 degrees of rounding at most; asked for is 1e-4 (the table has 1.1e-5).
TEST_CASE("two prisms, beside refraction by bisection") {
  for (bool const mid40 : {true, false}) {
    auto const p = mid40 ? gsp::mid40_pattern() : gsp::mid70_pattern();
    REQUIRE(p.direction.size() == 400000);
    CHECK(p.period == doctest::Approx(4));
    double off = 0, widest = 0;
    for (std::size_t k = 0; k < p.direction.size(); k += k < 1000 ? 1 : 37) {
      Vec const v = prisms(std::int64_t(k), mid40 ? 1.5089L : 1.8144L, mid40);
      off = std::max(off, degrees_between(p.direction[k], {double(v.x), double(v.y), double(v.z)}));
      widest = std::max(widest, std::acos(p.direction[k][0]) * 180 / M_PI);
    }
    CHECK(off < 1e-6);
    CHECK(widest == doctest::Approx(mid40 ? 19.2 : 35.2).epsilon(0.01));  // half of the cone, to the data sheet's tenth of a degree
    CHECK(p.time[0] == 0);
    CHECK(p.time[399999] == doctest::Approx(3.99999));
    // a window is a piece of the sequence, and after 30 s all begins anew
    auto const window = mid40 ? gsp::mid40_pattern(100000, 500) : gsp::mid70_pattern(100000, 500);
    auto const later = mid40 ? gsp::mid40_pattern(3000000 * 7000ll + 100000, 500) : gsp::mid70_pattern(3000000 * 7000ll + 100000, 500);
    for (std::size_t k = 0; k < 500; ++k) {
      CHECK(window.direction[k] == p.direction[100000 + k]);
      CHECK(later.direction[k] == p.direction[100000 + k]);
    }
  }
}

TEST_CASE("no ray sequence repeats within 4 s, and more and more is covered") {
  for (bool const mid40 : {true, false}) {
    auto const p = mid40 ? gsp::mid40_pattern() : gsp::mid70_pattern();
    // a repetition after s rays would bring the first three rays back at once
    double nearest = 1e9;
    for (std::size_t s = 1; s + 3 <= p.direction.size(); ++s) {
      double apart = 0;
      for (std::size_t k = 0; k < 3; ++k) apart = std::max(apart, degrees_between(p.direction[k], p.direction[k + s]));
      nearest = std::min(nearest, apart);
    }
    CHECK(nearest > 1e-3);
    // 0.1, 0.2, 0.4 ... s; a pattern that repeats every 0.1 s would stay where it is
    std::size_t before = cells(p, 10000);
    for (std::size_t n : {20000u, 40000u, 100000u, 200000u, 400000u}) {
      std::size_t const now = cells(p, n);
      CHECK(double(now) > 1.1 * double(before));
      before = now;
    }
  }
}

// Without reduced phases, in long double: of 2 pi 2e5 cycles of a minute 1e-13.
TEST_CASE("Avia and Mid-360 as their forms are written") {
  for (std::int64_t const first : {std::int64_t(0), std::int64_t(2400000)}) {
    auto const avia = gsp::avia_pattern(first, 2000);
    REQUIRE(avia.direction.size() == 12000);
    CHECK(avia.period == doctest::Approx(0.05));
    double off = 0;
    for (std::size_t k = 0; k < 12000; ++k) {
      Long const t = Long(first + std::int64_t(k / 6)) * 25e-6L, a = 2 * pi * 7294 / 60 * t, b = -2 * pi * 4664 / 60 * t;
      Long const x = 0.48L * 70.4L / 2 * (std::cos(a) + std::cos(b)), y = 0.43L * 77.2L / 2 * (std::sin(a) + std::sin(b));
      off = std::max(off, std::fabs(turn_of(avia.direction[k]) - double(x)));
      off = std::max(off, std::fabs(up_of(avia.direction[k]) - double(y + 1.4L * (Long(k % 6) - 2))));
      CHECK(avia.time[k] == doctest::Approx(25e-6 * double(k / 6)));
    }
    CHECK(off < 1e-9);
    auto const mid = gsp::mid360_pattern(5 * first, 20000);
    CHECK(mid.period == doctest::Approx(0.1));
    off = 0;
    double low = 90, high = -90;
    for (std::size_t k = 0; k < 20000; ++k) {
      Long const t = Long(5 * first + std::int64_t(k)) * 5e-6L;
      Long const turn = -(-62050.63L * t + 3.11L * std::cos(1e5L * pi * t) * std::sin(400 * pi * t));
      Long const up = 25.5L * std::cos(20 * pi * t) + 4 * std::cos(2 * pi * t / 0.006L) * std::cos(1e4L * pi * t) + 22.5L;
      off = std::max(off, std::fabs(std::remainder(turn_of(mid.direction[k]) - double(std::remainder(turn, 360.L)), 360.)));
      off = std::max(off, std::fabs(up_of(mid.direction[k]) - double(up)));
      low = std::min(low, up_of(mid.direction[k]));
      high = std::max(high, up_of(mid.direction[k]));
    }
    CHECK(off < 1e-9);
    CHECK(low > -7.01);
    CHECK(high < 52.01);
    CHECK(low < -6);
    CHECK(high > 51);
  }
  // frames of Mid-360 lie beside each other
  auto const p = gsp::mid360_pattern();
  CHECK(cells(p, 200000) > 5 * cells(p, 20000));
}

TEST_CASE("windows that there are not") {
  CHECK_THROWS_WITH_AS(gsp::mid40_pattern(-1), doctest::Contains("gsp::mid40_pattern: first must lie in 0 to 2^40"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::mid70_pattern(0, 0), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::avia_pattern(0, 1 << 23), doctest::Contains("more than 16,777,216 rays"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::mid360_pattern((std::int64_t(1) << 40) + 1, 1), std::invalid_argument);
  CHECK(gsp::mid360_pattern(std::int64_t(1) << 40, 1).direction.size() == 1);
}
