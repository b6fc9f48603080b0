// Patterns: how many rays, which angles, in which order and when; what is refused.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <gsp/ray/ray_pattern.hpp>
#include <set>

namespace {
double up_of(gsp::Double3 const& d) { return std::asin(d[2]) * 180 / M_PI; }
double turn_of(gsp::Double3 const& d) { return std::atan2(d[1], d[0]) * 180 / M_PI; }
void check_unit(gsp::RayPattern const& p) {
  for (auto const& d : p.direction) CHECK(std::hypot(d[0], d[1], d[2]) == doctest::Approx(1).epsilon(1e-15));
}
}  // namespace

TEST_CASE("units that turn") {
  auto const vlp = gsp::vlp16_pattern();
  REQUIRE(vlp.direction.size() == 16 * 1800);
  check_unit(vlp);
  double const firing[] = {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
  for (int c : {0, 1, 900, 1799})
    for (int e = 0; e < 16; ++e) {
      auto const& d = vlp.direction[std::size_t(16 * c + e)];
      CHECK(up_of(d) == doctest::Approx(firing[e]).epsilon(1e-12));
      double const turn = 0.2 * c;
      CHECK(std::fabs(std::remainder(turn_of(d) + turn, 360)) < 1e-9);
    }
  auto const hdl = gsp::hdl64e_pattern();
  REQUIRE(hdl.direction.size() == 110016);
  CHECK(up_of(hdl.direction[0]) == doctest::Approx(-24.8));
  CHECK(up_of(hdl.direction[63]) == doctest::Approx(2));
  CHECK(hdl.direction[0][1] == 0);
  CHECK(turn_of(hdl.direction[64]) == doctest::Approx(-360. / 1719));  // to the right
  CHECK_THROWS_AS(gsp::rotating_pattern({}, 5), std::invalid_argument);
  CHECK_THROWS_AS(gsp::rotating_pattern({0}, 0), std::invalid_argument);
  CHECK_THROWS_AS(gsp::rotating_pattern({0, NAN}, 4), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::rotating_pattern({15}, 4), doctest::Contains("they are in radians"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::rotating_pattern({0, 1}, 4, {.azimuths = {0}}), doctest::Contains("an azimuth for each elevation"),
                       std::invalid_argument);
  CHECK_THROWS_AS(gsp::rotating_pattern({0}, 4, {.azimuths = {NAN}}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::rotating_pattern({0}, 4, {.azimuths = {4}}), std::invalid_argument);
  for (double const rate : {-1., double(NAN), double(INFINITY)})
    CHECK_THROWS_WITH_AS(gsp::rotating_pattern({0}, 4, {.rate = rate}), doctest::Contains("the rate"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::rotating_pattern({0, 0.1}, 1 << 24), doctest::Contains("choose fewer columns"), std::invalid_argument);
}

TEST_CASE("a column leaves after its share of a turn") {
  auto const p = gsp::vlp16_pattern(1800, 20);
  REQUIRE(p.time.size() == p.direction.size());
  CHECK(p.period == 0.05);
  for (int const c : {0, 1, 899, 1799})
    for (int const e : {0, 15}) CHECK(p.time[std::size_t(16 * c + e)] == doctest::Approx(0.05 * c / 1800).epsilon(1e-14));
  auto const still = gsp::hdl64e_pattern(1719, 0);
  CHECK(still.time.empty());
  CHECK(still.period == 0);
}

// Angles come back from unit vectors of double: of an asin at 45 degrees and below 4 roundings of 90 degrees, 4e-14.
TEST_CASE("rings that are ahead of their columns, and units that turn clockwise") {
  double const rad = M_PI / 180;
  auto const check = [&](gsp::RayPattern const& p, std::vector<double> const& up, std::vector<double> const& ahead, int columns,
                         int sense) {
    std::size_t const n = up.size();
    REQUIRE(p.direction.size() == n * std::size_t(columns));
    REQUIRE(p.time.size() == p.direction.size());
    for (int c = 0; c < columns; ++c)
      for (std::size_t e = 0; e < n; ++e) {
        auto const& d = p.direction[n * std::size_t(c) + e];
        CHECK(std::fabs(up_of(d) - up[e]) < 1e-12);
        CHECK(std::fabs(std::remainder(turn_of(d) - sense * (360. * c / columns + ahead[e]), 360)) < 1e-12);
      }
  };
  check(gsp::rotating_pattern({0.1, -0.2}, 7, {.azimuths = {0.05, -0.3}}), {0.1 / rad, -0.2 / rad}, {0.05 / rad, -0.3 / rad}, 7, 1);
  // as in a unit's metadata, where a beam's azimuth adds to the clockwise encoder
  check(gsp::ouster_beams_pattern({16.6, 0.1, -16.3}, {3.1, -0.9, -3}, 512), {16.6, 0.1, -16.3}, {3.1, -0.9, -3}, 512, -1);
  std::vector<double> os1, xt;
  for (int e = 0; e < 64; ++e) os1.push_back(22.5 - 45. * e / 63);
  for (int e = 0; e < 32; ++e) xt.push_back(15 - e);
  check(gsp::ouster_pattern(64, 512, 45 * rad), os1, std::vector<double>(64), 512, -1);
  check(gsp::xt32_pattern(200), xt, std::vector<double>(32), 200, -1);
  CHECK(gsp::ouster_pattern(1, 1, 0).direction[0][0] == 1);

  auto const ultra = gsp::vlp32c_pattern();
  REQUIRE(ultra.direction.size() == 32 * 1800);
  std::set<long> rings, offsets;  // 1/1000 degree
  for (std::size_t e = 0; e < 32; ++e) {
    rings.insert(std::lround(1000 * up_of(ultra.direction[e])));
    offsets.insert(std::lround(1000 * turn_of(ultra.direction[e])));
  }
  CHECK(rings.size() == 32);
  CHECK(*rings.begin() == -25000);
  CHECK(*rings.rbegin() == 15000);
  CHECK(offsets == std::set<long>{-4200, -1400, 1400, 4200});
  // most rings lie at thirds of a degree (to the 0.001 of the manual's table)
  std::vector<long> thirds{-75, -16, -14, 7, 10, 14, 21, 31, 45};
  for (long third = -12; third <= 5; ++third) thirds.push_back(third);
  for (long const third : thirds)
    CHECK(std::any_of(rings.begin(), rings.end(), [&](long r) { return std::fabs(double(r) - 1000. * double(third) / 3) <= 1; }));
  CHECK(turn_of(ultra.direction[0]) == doctest::Approx(-1.4));          // ahead: clockwise is to the right
  CHECK(turn_of(ultra.direction[32 * 450]) == doctest::Approx(-91.4));  // a quarter on

  CHECK_THROWS_WITH_AS(gsp::ouster_beams_pattern({1, 2}, {1}, 4), doctest::Contains("there are 2 altitudes and 1 azimuths"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::ouster_pattern(64, 512, 45), doctest::Contains("it is in radians"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::ouster_pattern(0, 512, 1), std::invalid_argument);
}

TEST_CASE("rays all round") {
  auto const p = gsp::spherical_pattern(8, 5);
  REQUIRE(p.direction.size() == 40);
  check_unit(p);
  CHECK(p.time.empty());
  for (int row = 0; row < 5; ++row)
    for (int c = 0; c < 8; ++c) {
      auto const& d = p.direction[std::size_t(8 * row + c)];
      CHECK(std::fabs(up_of(d) - (90 - 45 * row)) < 1e-6);  // an asin at its end keeps half of the digits
      if (row % 4 != 0) CHECK(std::fabs(std::remainder(turn_of(d) - 45 * c, 360)) < 1e-12);
    }
  auto const dome = gsp::spherical_pattern(900, 96, 0, 89.5 * M_PI / 180);
  CHECK(dome.direction.size() == 86400);
  CHECK(up_of(dome.direction[0]) == doctest::Approx(89.5));
  CHECK(dome.direction[95 * 900][2] == 0);
  CHECK_THROWS_AS(gsp::spherical_pattern(0, 1), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::spherical_pattern(4, 4, -7, 52), doctest::Contains("they are in radians"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::spherical_pattern(4, 4, 0.5, -0.5), std::invalid_argument);
  CHECK_THROWS_AS(gsp::spherical_pattern(1 << 20, 1 << 20), std::invalid_argument);
}

TEST_CASE("a grid of angles, from the upper left") {
  auto const p = gsp::grid_pattern(5, 3, M_PI / 2, M_PI / 6);
  REQUIRE(p.direction.size() == 15);
  check_unit(p);
  CHECK(turn_of(p.direction[0]) == doctest::Approx(45));
  CHECK(up_of(p.direction[0]) == doctest::Approx(15));
  CHECK(turn_of(p.direction[4]) == doctest::Approx(-45));
  CHECK(up_of(p.direction[14]) == doctest::Approx(-15));
  CHECK(p.direction[7][0] == 1);  // the middle
  // all four corners, and an even step in both angles
  for (int const row : {0, 2})
    for (int const column : {0, 4}) {
      auto const& d = p.direction[std::size_t(5 * row + column)];
      CHECK(std::fabs(turn_of(d) - (column == 0 ? 45 : -45)) < 1e-12);
      CHECK(std::fabs(up_of(d) - (row == 0 ? 15 : -15)) < 1e-12);
    }
  for (int k = 0; k < 15; ++k) CHECK(std::fabs(turn_of(p.direction[std::size_t(k)]) - (45 - 22.5 * (k % 5))) < 1e-12);
  CHECK(gsp::grid_pattern(1, 1, 1, 1).direction[0][0] == 1);
  CHECK_THROWS_WITH_AS(gsp::grid_pattern(4, 4, 90, 1), doctest::Contains("they are in radians"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::grid_pattern(0, 4, 1, 1), std::invalid_argument);
}

TEST_CASE("a height scan") {
  auto const p = gsp::height_scan_pattern(1.6, 1.0, 0.1);
  REQUIRE(p.direction.size() == 187);
  REQUIRE(p.origin.size() == 187);
  std::set<std::pair<long, long>> seen;
  for (std::size_t k = 0; k < 187; ++k) {
    CHECK(p.direction[k] == gsp::Double3{0, 0, -1});
    seen.insert({std::lround(10 * p.origin[k][0]), std::lround(10 * p.origin[k][1])});
  }
  CHECK(seen.size() == 187);
  CHECK(*seen.begin() == std::pair<long, long>(-8, -5));
  CHECK(p.origin[1][0] - p.origin[0][0] == doctest::Approx(0.1));
  CHECK(gsp::height_scan_pattern(0, 0, 1).direction.size() == 1);
  for (double const bad : {0., -1., double(NAN)}) CHECK_THROWS_AS(gsp::height_scan_pattern(1, 1, bad), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::height_scan_pattern(100, 100, 0.01), doctest::Contains("larger spacing"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::height_scan_pattern(NAN, 1, 0.1), std::invalid_argument);
  CHECK_THROWS_AS(gsp::height_scan_pattern(INFINITY, 1, 0.1), std::invalid_argument);
}
