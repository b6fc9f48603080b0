#include <doctest/doctest.h>

#include <gsp/io/splat_file.hpp>
#include <io/fixtures.hpp>

using namespace gsp::io;
using namespace gsp_test;

namespace {
std::vector<std::byte> one(std::array<float, 6> numbers, std::array<std::uint8_t, 8> bytes) {
  std::vector<std::byte> out;
  for (float v : numbers) put(out, v);
  for (auto b : bytes) put(out, b);
  return out;
}
}  // namespace

TEST_CASE(".splat: 32 bytes a Gaussian") {
  auto bytes = one({1, 2, 3, .1f, .2f, .3f}, {255, 0, 51, 102, 128, 128, 0, 128});
  auto const second = one({-1, -2, -3, 1, 2, 3}, {0, 0, 0, 255, 255, 128, 128, 128});
  bytes.insert(bytes.end(), second.begin(), second.end());
  SplatSet const s = parse_splat(bytes, "two.splat");
  REQUIRE(s.size() == 2);
  CHECK(s.positions == std::vector<float>{1, 2, 3, -1, -2, -3});
  CHECK(s.scales == std::vector<float>{.1f, .2f, .3f, 1, 2, 3});
  CHECK(s.opacities == std::vector<float>{0.4f, 1});
  CHECK(s.quats == std::vector<float>{0, 0, -1, 0, 1, 0, 0, 0});
  CHECK(0.5 + sh_c0 * s.sh[0] == doctest::Approx(1));
  CHECK(0.5 + sh_c0 * s.sh[1] == doctest::Approx(0));
  CHECK(0.5 + sh_c0 * s.sh[2] == doctest::Approx(0.2));
}

TEST_CASE(".splat: bad input") {
  auto const good = one({1, 2, 3, .1f, .2f, .3f}, {255, 0, 51, 102, 128, 128, 0, 128});
  CHECK(accepted_truncations(good, [](Bytes b) { parse_splat(b, "cut.splat"); }) == 0);
  auto bad = [](std::array<float, 6> n, std::array<std::uint8_t, 8> b) { return error_of([&] { parse_splat(one(n, b), "bad.splat"); }); };
  CHECK(says(bad({1, NAN, 3, 1, 1, 1}, {0, 0, 0, 0, 255, 0, 0, 0}), "Gaussian 0: position"));
  CHECK(says(bad({1, 2, 3, 1, INFINITY, 1}, {0, 0, 0, 0, 255, 0, 0, 0}), "Gaussian 0: scale"));
  CHECK(says(bad({1, 2, 3, 1, -1, 1}, {0, 0, 0, 0, 255, 0, 0, 0}), "negative"));
  CHECK(says(bad({1, 2, 3, 1, 1, 1}, {0, 0, 0, 0, 128, 128, 128, 128}), "rotation has length 0"));
}

// Positions and scales are floats on both sides; colours and opacities are off by half of 1/255, rotations by half of 1/128 in each of four
// components, and by as much again where they are normalised.
TEST_CASE(".splat: what is written comes back within its steps") {
  auto set = random_set(400, 0, 9);
  for (float& v : set.sh) v = std::clamp(v, -1.7f, 1.7f);  // colours 0.02 .. 0.98
  auto const a = apart(parse_splat(format_splat(set), "again.splat"), set);
  CHECK(a.position == 0);
  CHECK(a.log_scale == 0);
  CHECK(a.opacity <= 1. / 510 + 1e-6);
  CHECK(a.dc <= 1 / (510 * sh_c0) + 1e-6);
  CHECK(a.rotation <= 2 * 2 / 256. + 1e-6);
  auto one_turn = random_set(1, 0);
  one_turn.quats = {1, 0, 0, 0};
  CHECK(parse_splat(format_splat(one_turn), "again.splat").quats == std::vector<float>{-1, 0, 0, 0});  // to the bit
  Folder folder;
  write_splat(folder.path / "a.splat", set);
  CHECK(apart(read_splat(folder.path / "a.splat"), set).position == 0);
}
