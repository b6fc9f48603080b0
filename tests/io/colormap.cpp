#include <doctest/doctest.h>
#include <unistd.h>

#include <filesystem>
#include <gsp/io/detail/ply_table.hpp>
#include <gsp/io/draw_points.hpp>

using namespace gsp::io;

TEST_CASE("rainbow: continuous, within 0..1, each colour once, brightest in the middle") {
  auto light = [](std::array<float, 3> const& c) { return .2126f * c[0] + .7152f * c[1] + .0722f * c[2]; };
  float step = 0;
  for (int i = 0; i < 1000; ++i) {
    auto const a = rainbow(static_cast<float>(i) / 1000), b = rainbow(static_cast<float>(i + 1) / 1000);
    for (int c = 0; c < 3; ++c) {
      CHECK((a[c] >= 0 && a[c] <= 1));
      step = std::max(step, std::abs(a[c] - b[c]));
    }
    for (int j = 0; j < i - 60; ++j) {  // colours further apart than 6 % of the scale are told apart by more than 3 % in some channel
      auto const e = rainbow(static_cast<float>(j) / 1000);
      if (std::max({std::abs(a[0] - e[0]), std::abs(a[1] - e[1]), std::abs(a[2] - e[2])}) < 0.03f)
        FAIL("colours " << i << " and " << j << " are alike");
    }
  }
  CHECK(step < 0.01f);
  CHECK(light(rainbow(0.5f)) > 0.7f);
  CHECK(light(rainbow(0)) < 0.2f);
  CHECK(light(rainbow(1)) < 0.2f);
  CHECK(rainbow(NAN) == rainbow(0));
  CHECK(rainbow(5) == rainbow(1));
}

TEST_CASE("depth in colour: near red, far blue, nothing black") {
  float const depth[5] = {1, 3, 0, NAN, 2};
  auto const b = depth_to_color(depth, 5, 1);
  CHECK(b.pixels[0] > 100);
  CHECK(b.pixels[0] > b.pixels[2]);
  CHECK(b.pixels[5] > b.pixels[3]);
  for (int k = 6; k < 12; ++k) CHECK(b.pixels[k] == 0);
  auto const middle = rainbow(0.5f);
  CHECK(b.pixels[13] == to_byte(middle[1]));
  CHECK(depth_to_color(depth, 5, 1, {.near = 1, .far = 3}).pixels == b.pixels);
}

// Four points a metre and two from a unit at (1, 0, 0) that looks along y: pixels by hand, the colours by range_colors.
TEST_CASE("points from above and around their unit") {
  std::vector<std::array<float, 3>> const point{{1, 1, 0}, {2, 0, 0}, {1, -1, 0}, {-1, 0, 2}};
  std::vector<float> const range{1, 1, 1, 2};
  double const half = std::sqrt(0.5);
  int const size = 100;
  auto const b = draw_points(point, range, {{1, 0, 0}, {half, 0, 0, half}}, size);
  REQUIRE(b.width == 2 * size + 8);
  REQUIRE(b.height == size);
  auto const colours = range_colors(range);
  CHECK(colours[0] == colours[2]);
  CHECK(colours[0][0] > colours[0][2]);  // near: red
  CHECK(colours[3][2] > colours[3][0]);  // far: blue
  auto const at = [&](int row, int column) {
    std::size_t const i = std::size_t(3 * (row * b.width + column));
    return std::array<std::uint8_t, 3>{b.pixels[i], b.pixels[i + 1], b.pixels[i + 2]};
  };
  // from above: nine of ten of four points are the nearest three, 1 m away; the last, 2 m away, is outside
  // one point of a hundred that is far takes no colours from the others
  std::vector<float> many(100);
  for (std::size_t k = 0; k < 100; ++k) many[k] = 1 + 0.01f * float(k);
  many[99] = 2 * many[95];
  auto const near_by = range_colors(many);
  many[99] = 1000;
  auto const one_far = range_colors(many);
  for (std::size_t k = 0; k < 100; ++k) CHECK(one_far[k] == near_by[k]);
  CHECK(range_colors({3}).size() == 1);
  int const reach = int(50 / 1.05);
  CHECK(at(50 - reach - 1, 50) == colours[0]);
  CHECK(at(50, 50 + reach) == colours[1]);
  CHECK(at(50 + reach, 50) == colours[2]);
  // around: ahead in the middle, its right a quarter to the right, what is behind at the border; heights 0 to 45 degrees
  CHECK(at(97, size + 8 + 50) == colours[0]);
  CHECK(at(97, size + 8 + 75) == colours[1]);
  CHECK(at(2, size + 8 + 25) == colours[3]);
  CHECK(at(50, size + 8 + 50) == std::array<std::uint8_t, 3>{20, 20, 20});
  CHECK(at(50, size) == std::array<std::uint8_t, 3>{255, 255, 255});
  CHECK(draw_points({}, {}, {{0, 0, 0}, {1, 0, 0, 0}}, 10).pixels.size() == 840);
  CHECK_THROWS_WITH_AS(draw_points(point, {1}, {{0, 0, 0}, {1, 0, 0, 0}}), doctest::Contains("give a range for each point"),
                       std::invalid_argument);
}

TEST_CASE("a cloud of points as a PLY: each number where its header says") {
  std::vector<std::array<float, 3>> const point{{1, 2, 3}, {-4, 5.5f, 6}};
  std::vector<float> const range{1.5f, 2.5f};
  auto const path = std::filesystem::temp_directory_path() / ("gsp_points_" + std::to_string(getpid()) + ".ply");
  for (bool const geoms : {true, false}) {
    write_points(path, point, range, geoms ? std::vector<int>{7, -1} : std::vector<int>{});
    auto const bytes = read_file(path);
    auto const table = detail::parse_ply_table(bytes, "points.ply");
    auto const& vertex = *table.find("vertex");
    REQUIRE(vertex.count == 2);
    auto const of = [&](char const* property, std::size_t k) { return table.column(vertex, property, "cloud")(k); };
    auto const colours = range_colors(range);
    for (std::size_t k = 0; k < 2; ++k) {
      CHECK(of("x", k) == point[k][0]);
      CHECK(of("y", k) == point[k][1]);
      CHECK(of("z", k) == point[k][2]);
      CHECK(of("red", k) == colours[k][0]);
      CHECK(of("blue", k) == colours[k][2]);
      CHECK(of("range", k) == range[k]);
      CHECK(of("geom", k) == (geoms && k == 0 ? 7 : -1));
    }
  }
  std::filesystem::remove(path);
  CHECK_THROWS_WITH_AS(write_points(path, point, {1}), doctest::Contains("a range for each point"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(write_points(path, point, range, {1}), doctest::Contains("a geom for each or none"), std::invalid_argument);
  CHECK(!std::filesystem::exists(path));
}
