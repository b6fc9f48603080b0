// Height fields from pictures, binary files and numbers. (Against MuJoCo: tests/oracle/mesh.cpp.)
#include <doctest/doctest.h>

#include <gsp/io/file.hpp>
#include <gsp/io/hfield.hpp>
#include <gsp/io/png.hpp>
#include <gsp/model/compile.hpp>
#include <io/mesh_fixtures.hpp>

using namespace gsp::io;
using namespace gsp_test;

TEST_CASE("the row at -y comes first, the lowest is 0, the highest 1") {
  std::vector<float> const expected{0, .5f, 1, .25f, .75f, .5f};  // two rows of three
  auto const check = [&](gsp::HeightFieldDescription const& f) {
    CHECK(f.rows == 2);
    CHECK(f.columns == 3);
    CHECK(f.elevation == expected);
  };
  check(parse_hfield(hfield_binary(2, 3, {-4, -2, 0, -3, -1, -2}), "ground"));
  check(make_hfield(2, 3, std::vector<double>{11, 13, 12, 10, 12, 14}, "hfield 'g'"));
  auto grey = make_bitmap<std::uint8_t>(3, 2, 1);
  grey.pixels = {90, 130, 110, 70, 110, 150};
  check(parse_hfield(format_png(grey), "dir/ground.PNG"));
  auto wide = make_bitmap<std::uint16_t>(3, 2, 1);
  for (int i = 0; i < 6; ++i) wide.pixels[i] = std::uint16_t(grey.pixels[i] << 8 | 0x7f * (i % 3));  // MuJoCo takes the high byte
  check(parse_hfield(format_png(wide), "a", "image/png"));
  auto color = make_bitmap<std::uint8_t>(3, 2, 3, 5);
  for (int i = 0; i < 6; ++i) color.pixels[3 * i] = grey.pixels[i];
  check(parse_hfield(format_png(color), "a.png"));
  CHECK(parse_hfield(format_png(grey), "dir/ground.png").name == "ground");
  CHECK(make_hfield(3, 4, {}, "h").elevation == std::vector<float>(12, 0.f));
  CHECK(make_hfield(2, 2, std::vector<double>(4, 7.), "h").elevation == std::vector<float>(4, 0.f));
  Folder folder;
  write_file(folder.path / "a.png", format_png(grey));
  check(read_hfield(folder.path / "a.png"));
}

TEST_CASE("what is wrong is said") {
  CHECK(accepted_truncations(hfield_binary(2, 2, {1, 2, 3, 4}), [](Bytes b) { parse_hfield(b, "a"); }) == 0);
  for (auto [rows, columns] : {std::pair{0, 4}, {-1, -4}, {1 << 30, 1 << 30}, {0x7fffffff, 2}, {65536, 65536}})
    CHECK(says(error_of([&, r = rows, c = columns] {
                 parse_hfield(hfield_binary(r, c, {1, 2, 3, 4}), "a.bin");
               }),
               "a.bin: byte 0: announces"));
  CHECK(says(error_of([] { parse_hfield(hfield_binary(1, 2, {1, NAN}), "a"); }), "byte 12: an elevation is not finite"));
  CHECK(says(error_of([] { parse_hfield(bytes_of("hello"), "a.png"); }), "a.png: byte 0"));
  CHECK(says(error_of([] { parse_hfield(bytes_of("hello"), "a.jpg", "image/jpeg"); }), "content type"));
  CHECK(says(error_of([] { make_hfield(2, 2, std::vector<double>(3), "hfield 'h'"); }), "has 3 elevations for 2 rows of 2"));
  CHECK(says(error_of([] { make_hfield(1, 2, {}, "h"); }), "2 or more"));
}

TEST_CASE("compile: size, bounds, what it refuses") {
  gsp::Description d;
  auto field = make_hfield(2, 2, std::vector<double>{0, 1, 2, 4}, "h");
  field.name = "h", field.size = {2, 3, 1, .5};
  d.hfields.push_back(field);
  d.bodies[0].geoms.push_back({.type = gsp::ShapeType::hfield, .pos = {1, 2, 3}, .hfield = "h"});
  auto const m = gsp::compile(d);
  CHECK(m.nhfield == 1);
  CHECK(m.geom_data[0] == 0);
  CHECK(m.geom_pos[0] == gsp::Double3{1, 2, 3});
  CHECK(m.geom_size[0] == gsp::Double3{2, 3, .5});
  CHECK(m.geom_rbound[0] == doctest::Approx(std::sqrt(14.)));
  CHECK(m.hfields[0].elevation == std::vector<float>{.5f, 1, 0, .25f});
  auto const error = [&](auto change) {
    auto copy = d;
    change(copy);
    return error_of([&] { gsp::compile(copy); });
  };
  CHECK(says(error([](auto& x) { x.hfields[0].size[3] = 0; }), "hfield 'h' has a size that is not positive"));
  CHECK(says(error([](auto& x) { x.hfields[0].rows = 3; }), "has 4 elevations for 3 rows of 2"));
  for (auto [rows, columns] : {std::pair{1, 4}, {4, 1}, {1, 1}, {0, 4}})  // no triangle: nothing could touch it
    CHECK(says(error([&, r = rows, c = columns](auto& x) {
                 x.hfields[0].rows = r, x.hfields[0].columns = c, x.hfields[0].elevation.assign(std::size_t(r * c), 0.f);
               }),
               "hfield 'h' has " + std::to_string(rows) + " rows of " + std::to_string(columns) + ": give 2 or more of each"));
  CHECK(says(error([](auto& x) { x.hfields[0].name = "i"; }), "which does not exist"));
  CHECK(says(error([](auto& x) { x.bodies[0].geoms[0].hfield = ""; }), "names none"));
  CHECK(says(error([](auto& x) { x.bodies[0].geoms[0].type = gsp::ShapeType::box; }), "has another type"));
}
