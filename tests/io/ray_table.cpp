// Tables of rays: what is written comes back as directions and times; what is cut short, no number, out of range or of other columns gets
// one sentence with the line.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/io/ray_table.hpp>
#include <io/fixtures.hpp>
#include <limits>

using namespace gsp::io;
using namespace gsp_test;

namespace {
gsp::RayPattern csv(std::string const& text) { return parse_ray_csv(bytes_of(text), "unit.csv"); }
std::string refusal(std::string const& text) {
  auto const said = error_of([&] { csv(text); });
  CHECK_MESSAGE(said.starts_with("unit.csv: "), said);
  CHECK_MESSAGE(said.find('\n') == said.npos, said);  // one sentence
  return said;
}
template <class T>
std::vector<std::byte> npy(std::vector<std::size_t> const& shape, std::vector<T> const& values) {
  Folder folder;
  write_npy(folder.path / "a.npy", NpyView(shape, values));
  return read_file(folder.path / "a.npy");
}
template <class T>
std::string npy_refusal(std::vector<std::size_t> const& shape, std::vector<T> const& values) {
  auto const bytes = npy(shape, values);
  auto const said = error_of([&] { parse_ray_npy(bytes, "unit.npy"); });
  CHECK_MESSAGE(said.starts_with("unit.npy: "), said);
  CHECK_MESSAGE(said.find('\n') == said.npos, said);
  return said;
}
bool near(gsp::Double3 const& d, double x, double y, double z) { return std::hypot(d[0] - x, d[1] - y, d[2] - z) < 1e-15; }
}  // namespace

TEST_CASE("csv: azimuth to the left, zenith from above, times from the first") {
  for (std::string const head : {"Time/s,Azimuth/deg,Zenith/deg\n", "", " time , azimuth , zenith \r\n\r\n"}) {
    auto const p = csv(head + "1e-05,0,90\n2e-05, 90 ,90\r\n\n3e-05,-270,9e1\n4e-05,123,0\n5e-05,30,60\n");
    REQUIRE(p.direction.size() == 5);
    CHECK(near(p.direction[0], 1, 0, 0));
    CHECK(near(p.direction[1], 0, 1, 0));
    CHECK(near(p.direction[2], 0, 1, 0));
    CHECK(near(p.direction[3], 0, 0, 1));
    CHECK(near(p.direction[4], 0.75, std::sqrt(3) / 4, 0.5));
    REQUIRE(p.time.size() == 5);
    CHECK(p.time[0] == 0);
    CHECK(p.time[4] == doctest::Approx(4e-5));
    CHECK(p.period == doctest::Approx(5e-5));  // five steps of 10 us
  }
  // three shots of two rays: three steps
  auto const shots = csv("0,0,90\n0,0,91\n0.1,0,90\n0.1,0,91\n0.2,0,90\n0.2,0,91\n");
  CHECK(shots.period == doctest::Approx(0.3));
  CHECK(shots.time == std::vector<double>{0, 0, 0.1, 0.1, 0.2, 0.2});
  // all at one time: all at once
  auto const flash = csv("3,0,90\n3,10,90\n");
  CHECK(flash.time.empty());
  CHECK(flash.period == 0);
}

TEST_CASE("csv: bad input") {
  CHECK(says(refusal(""), "unit.csv: holds no rays; each row has time, azimuth and zenith"));
  CHECK(says(refusal("Time/s,Azimuth/deg,Zenith/deg\n"), "holds no rays"));
  CHECK(says(refusal("0,0,90\n0,0\n"), "line 2: has 2 columns; give three"));
  CHECK(says(refusal("0,0,90,1\n"), "line 1: has 4 columns"));
  CHECK(says(refusal("0 0 90\n"), "line 1: has 1 columns"));
  CHECK(says(refusal("0,0,90\n\n1,0,90"), "line 3: has no line end, so the file may be cut short; fetch it again"));
  CHECK(says(refusal("0,0,90\n0,,90\n"), "line 2: azimuth '' is not a number; repair the row"));
  CHECK(says(refusal("0,0,90\n0,1x,90\n"), "line 2: azimuth '1x' is not a number"));
  CHECK(says(refusal("0,0,nan\n"), "line 1: zenith 'nan' is out of range; give degrees from straight up, from 0 to 180"));
  CHECK(says(refusal("0,inf,90\n"), "azimuth 'inf' is out of range"));
  CHECK(says(refusal("0,1e400,90\n"), "azimuth '1e400' is out of range"));
  CHECK(says(refusal("nan,0,90\n"), "time 'nan' is out of range"));
  CHECK(says(refusal("-1,0,90\n"), "time '-1' is out of range; give seconds"));
  CHECK(says(refusal("0,361,90\n"), "azimuth '361' is out of range; give degrees, from -360 to 360"));
  CHECK(says(refusal("0,0,-1\n"), "zenith '-1' is out of range"));
  CHECK(says(refusal("0,0,180.1\n"), "zenith '180.1' is out of range"));
  CHECK(says(refusal("0.2,0,90\n0.1,0,90\n"), "line 2: time '0.1' is before that of the row above; sort the rows by time"));
  CHECK(says(refusal("time,zenith,azimuth\n0,0,90\n"), "line 1: column 2 is called 'zenith', expected azimuth"));
  CHECK(says(refusal("0,0,90\ntime,azimuth,zenith\n"), "line 2: time 'time' is not a number"));
  CHECK(says(refusal(std::string("\0\0\0\0\n", 5)), "line 1: has 1 columns"));
  // cut anywhere but behind a whole row
  auto const whole = bytes_of("Time/s,Azimuth/deg,Zenith/deg\n0,12.5,87.5\n1e-5,13.5,86.5\n2e-5,14.5,85.5\n");
  CHECK(accepted_truncations(whole, [](Bytes b) { parse_ray_csv(b, "cut.csv"); }) == 2);
}

TEST_CASE("npy: azimuth and elevation, at a rate or all at once") {
  auto const bytes = npy<float>({3, 2}, {0, 0, float(M_PI), 0, float(-M_PI / 2), float(M_PI / 6)});
  auto const p = parse_ray_npy(bytes, "unit.npy");
  REQUIRE(p.direction.size() == 3);
  CHECK(near(p.direction[0], 1, 0, 0));
  CHECK(p.direction[1][0] == doctest::Approx(-1));
  CHECK(p.direction[2][1] == doctest::Approx(-std::sqrt(3) / 2));
  CHECK(p.direction[2][2] == doctest::Approx(0.5));
  CHECK(p.time.empty());
  CHECK(p.period == 0);
  auto const timed = parse_ray_npy(bytes, "unit.npy", {.rate = 100000});
  CHECK(timed.time == std::vector<double>{0, 1e-5, 2e-5});
  CHECK(timed.period == doctest::Approx(3e-5));
  CHECK_THROWS_AS(parse_ray_npy(bytes, "unit.npy", {.rate = NAN}), std::invalid_argument);
  CHECK_THROWS_AS(parse_ray_npy(bytes, "unit.npy", {.rate = -1}), std::invalid_argument);
  CHECK(accepted_truncations(bytes, [](Bytes b) { parse_ray_npy(b, "cut.npy"); }) == 0);
}

TEST_CASE("npy: bad input") {
  double const nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  CHECK(says(npy_refusal<double>({2, 3}, {0, 0, 0, 0, 0, 0}), "has shape (2, 3), expected (A, 2)"));
  CHECK(says(npy_refusal<double>({4}, {0, 0, 0, 0}), "has shape (4,), expected (A, 2)"));
  CHECK(says(npy_refusal<double>({0, 2}, {}), "holds no rays"));
  CHECK(says(npy_refusal<std::int32_t>({1, 2}, {0, 0}), "holds integers; save azimuth and elevation in radians"));
  CHECK(says(npy_refusal<double>({2, 2}, {0, 0, nan, 0}), "row 1: (nan, 0.000000) is no azimuth and elevation"));
  CHECK(says(npy_refusal<double>({1, 2}, {0, inf}), "row 0: (0.000000, inf)"));
  CHECK(says(npy_refusal<double>({1, 2}, {35, 0}), "in radians, within 2 pi and pi / 2; convert the angles"));
  CHECK(says(npy_refusal<double>({1, 2}, {0, 1.6}), "row 0: (0.000000, 1.600000)"));
}

TEST_CASE("a table is read by its ending") {
  Folder folder;
  write_file(folder.path / "a.csv", bytes_of("0,0,90\n1,0,90\n"));
  write_npy(folder.path / "a.npy", NpyView({1, 2}, std::vector<double>{0, 0}));
  write_file(folder.path / "a.txt", bytes_of("0,0,90\n"));
  CHECK(read_ray_table(folder.path / "a.csv").direction.size() == 2);
  CHECK(read_ray_table(folder.path / "a.npy", {.rate = 10}).period == doctest::Approx(0.1));
  CHECK(says(error_of([&] { read_ray_table(folder.path / "a.txt"); }), "a.txt: tables of rays end in .csv"));
  CHECK(says(error_of([&] { read_ray_table(folder.path / "b.csv"); }), "there is no such file"));
}
