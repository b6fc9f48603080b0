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
