// Patterns: how many rays, which angles, in which order; what is refused.
#include <doctest/doctest.h>

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
      CHECK(std::remainder(turn_of(d) - turn, 360) == doctest::Approx(0).epsilon(1e-9));
    }
  auto const hdl = gsp::hdl64e_pattern();
  REQUIRE(hdl.direction.size() == 110016);
  CHECK(up_of(hdl.direction[0]) == doctest::Approx(-24.8));
  CHECK(up_of(hdl.direction[63]) == doctest::Approx(2));
  CHECK(hdl.direction[0][1] == 0);
  CHECK(hdl.direction[64][1] > 0);  // to the left
  CHECK_THROWS_AS(gsp::rotating_pattern({}, 5), std::invalid_argument);
  CHECK_THROWS_AS(gsp::rotating_pattern({0}, 0), std::invalid_argument);
  CHECK_THROWS_AS(gsp::rotating_pattern({0, NAN}, 4), std::invalid_argument);
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
