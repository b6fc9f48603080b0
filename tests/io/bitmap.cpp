#include <doctest/doctest.h>

#include <gsp/io/bitmap.hpp>
#include <limits>

using namespace gsp::io;

TEST_CASE("floats become bytes: rounded, clamped, NaN is black") {
  float const values[8] = {0, 1, 0.5f, -3, 7, NAN, 1.f / 255, INFINITY};
  auto const b = to_bitmap8(values, 4, 2, 1);
  CHECK(b.pixels == std::vector<std::uint8_t>{0, 255, 128, 0, 255, 0, 1, 255});
}

TEST_CASE("depth becomes millimetres; what does not fit is 0") {
  float const values[8] = {0, 1.2345f, 65.535f, 65.5361f, NAN, -1, 0.0004f, INFINITY};
  auto const b = depth_to_bitmap16(values, 8, 1);
  CHECK(b.pixels == std::vector<std::uint16_t>{0, 1235, 65535, 0, 0, 0, 0, 0});
  CHECK_THROWS_AS(depth_to_bitmap16(values, 8, 1, 0.f), std::invalid_argument);
}

TEST_CASE("contact sheet") {
  std::vector<Bitmap8> tiles;
  for (std::uint8_t t = 1; t <= 5; ++t) tiles.push_back(make_bitmap<std::uint8_t>(4, 3, 3, t));
  auto const sheet = contact_sheet(tiles, 3, 2, std::uint8_t(9));
  CHECK(sheet.width == 3 * 6 + 2);
  CHECK(sheet.height == 2 * 5 + 2);
  auto at = [&](int x, int y) { return int(sheet.pixels[(y * sheet.width + x) * 3]); };
  CHECK(at(0, 0) == 9);
  CHECK(at(2, 2) == 1);
  CHECK(at(5, 4) == 1);
  CHECK(at(6, 4) == 9);
  CHECK(at(8, 2) == 2);
  CHECK(at(2, 7) == 4);
  CHECK(at(11, 9) == 5);
  CHECK(at(14, 7) == 9);  // the empty place
  auto const square = contact_sheet(std::vector<Bitmap8>(16, make_bitmap<std::uint8_t>(64, 64, 1)), 0, 0);
  CHECK(square.width == 256);
  CHECK(square.height == 256);
  auto const named = contact_sheet({tiles[0], tiles[1]}, 2, 0);
  CHECK(named.width == 8);
  CHECK(named.height == 3);
  CHECK(named.pixels == contact_sheet(std::vector<Bitmap8>{tiles[0], tiles[1]}, 2, 0).pixels);
  CHECK_THROWS_AS(contact_sheet(std::vector<Bitmap8>{}), std::invalid_argument);
  tiles.push_back(make_bitmap<std::uint8_t>(4, 4, 3));
  CHECK_THROWS_AS(contact_sheet(tiles), std::invalid_argument);
  CHECK_THROWS_AS(contact_sheet(std::vector<Bitmap8>{{4, 4, 3, {}}}), std::invalid_argument);
}
