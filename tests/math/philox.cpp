// Philox4x32-10: the known answers of the authors' library (Random123), and what uniform and normal numbers are.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <gsp/math/philox.hpp>

TEST_CASE("known answers") {
  auto const check = [](std::uint64_t seed, gsp::Philox const& counter, gsp::Philox const& expected) {
    auto const got = gsp::philox(seed, counter);
    for (int k = 0; k < 4; ++k) CHECK(got.word[k] == expected.word[k]);
  };
  check(0, {{0, 0, 0, 0}}, {{0x6627e8d5u, 0xe169c58du, 0xbc57ac4cu, 0x9b00dbd8u}});
  check(0xffffffffffffffffull, {{0xffffffffu, 0xffffffffu, 0xffffffffu, 0xffffffffu}},
        {{0x408f276du, 0x41c83b0eu, 0xa20bc7c6u, 0x6d5451fdu}});
  check(0x299f31d0a4093822ull, {{0x243f6a88u, 0x85a308d3u, 0x13198a2eu, 0x03707344u}},
        {{0xd16cfe09u, 0x94fdccebu, 0x5001e420u, 0x24126ea1u}});
}

// A million numbers: the mean within 5 of its own deviations, 1 / sqrt(12 n), and chi^2 of 256 bins within 5 of sqrt(2 * 255).
TEST_CASE("uniform numbers are uniform, and never 0 or 1") {
  CHECK(gsp::uniform_of(0u) > 0);
  CHECK(gsp::uniform_of(0xffffffffu) < 1);
  CHECK(gsp::uniform_of<double>(0xffffffffu) < 1);
  int const n = 1000000;
  double sum = 0, chi2 = 0;
  long bins[256] = {};
  for (int i = 0; i < n / 4; ++i) {
    auto const words = gsp::philox(7, {{std::uint32_t(i), 1, 2, 3}});
    for (std::uint32_t const word : words.word) {
      double const x = gsp::uniform_of<double>(word);
      sum += x;
      ++bins[int(256 * x)];
    }
  }
  CHECK(std::abs(sum / n - 0.5) < 5 / std::sqrt(12. * n));
  for (long const count : bins) chi2 += std::pow(double(count) - n / 256., 2) / (n / 256.);
  CHECK(std::abs(chi2 - 255) < 5 * std::sqrt(2 * 255.));
}

// n = 500,000 points. A moment of n numbers of variance v lies within 5 sqrt(v / n) of its own value: x has variance 1, x^2 2, x^4 96 (105
// - 9), x y 1. Beyond 3 lie 0.0026998 of all, within 5 sqrt(p / n). Nothing beyond sqrt(-2 log 2^-24) = 5.77.
TEST_CASE("spread points are normal in both directions, with their tails") {
  int const n = 500000;
  double sum[2] = {}, square[2] = {}, fourth[2] = {}, product = 0, beyond = 0, most = 0;
  for (int i = 0; i < n; ++i) {
    auto const words = gsp::philox(11, {{std::uint32_t(i), 0, 0, 0}});
    auto const spread = gsp::Spread<float>::of(words.word[0], words.word[1]);
    double const x[] = {double(spread.normal()), double(spread.r) * std::sin(double(spread.angle))};
    for (int c = 0; c < 2; ++c) {
      sum[c] += x[c];
      square[c] += x[c] * x[c];
      fourth[c] += x[c] * x[c] * x[c] * x[c];
    }
    product += x[0] * x[1];
    beyond += std::fabs(x[0]) > 3;
    most = std::max(most, double(spread.r));
  }
  auto const within = [&](double got, double expected, double variance) {
    CHECK(std::fabs(got / n - expected) < 5 * std::sqrt(variance / n));
  };
  for (int c = 0; c < 2; ++c) {
    within(sum[c], 0, 1);
    within(square[c], 1, 2);
    within(fourth[c], 3, 96);
  }
  within(product, 0, 1);
  within(beyond, 0.0026998, 0.0026998);
  CHECK(most < 5.78);
  CHECK(most > 4.5);
  CHECK(gsp::Spread<double>::of(0, 0).r < 5.78);
  CHECK(gsp::Spread<float>::of(0xffffffffu, 0).r >= 0);
}
