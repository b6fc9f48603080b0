#include <doctest/doctest.h>

#include <cmath>
#include <gsp/io/picture_error.hpp>
#include <random>

namespace {
std::vector<float> noise(std::size_t n, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<float> out(n);
  for (float& x : out) x = float(random() % 10000) / 10000;
  return out;
}
}  // namespace

TEST_CASE("PSNR is that of its mean square, of what a screen shows") {
  std::vector<float> const a{0, 0.5f, 1, 0.25f}, b{0.1f, 0.5f, 1, 0.25f}, bright{0, 0.5f, 7, 0.25f}, dark{-3, 0.5f, 1, 0.25f};
  CHECK(gsp::io::psnr(a, b) == doctest::Approx(-10 * std::log10(0.01 / 4)).epsilon(1e-6));  // of a float's 0.1
  CHECK(std::isinf(gsp::io::psnr(a, a)));
  CHECK(std::isinf(gsp::io::psnr(a, bright)));
  CHECK(std::isinf(gsp::io::psnr(a, dark)));
  CHECK_THROWS_AS(gsp::io::psnr(a, {0.f}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::io::psnr({}, {}), std::invalid_argument);
}

// Constant pictures have no variance: (2 p q + c1) / (p^2 + q^2 + c1). Of a and 1 - a, whose covariance is the negative of the variance,
// and whose window sums are done here in two dimensions at once.
TEST_CASE("SSIM is what its formula gives, window by window") {
  int const width = 17, height = 13, channels = 2;
  std::size_t const n = 2 * width * height * channels;
  std::vector<float> const a = noise(n, 1), p(n, 0.75f), q(n, 0.5f);
  CHECK(gsp::io::ssim(a, a, width, height, channels) == doctest::Approx(1).epsilon(1e-12));
  CHECK(gsp::io::ssim(p, q, width, height, channels) == doctest::Approx((0.75 + 1e-4) / (0.5625 + 0.25 + 1e-4)).epsilon(1e-9));
  std::vector<float> other = a;
  for (float& x : other) x = 1 - x;
  double sum = 0;
  int count = 0;
  for (std::size_t image = 0; image < 2; ++image)
    for (int c = 0; c < channels; ++c)
      for (int y = 5; y + 5 < height; ++y)
        for (int x = 5; x + 5 < width; ++x) {
          double w = 0, m = 0, s = 0;
          for (int dy = -5; dy <= 5; ++dy)
            for (int dx = -5; dx <= 5; ++dx) {
              double const g = std::exp(-(dx * dx + dy * dy) / 4.5);
              double const v = a[((image * height + std::size_t(y + dy)) * width + std::size_t(x + dx)) * channels + std::size_t(c)];
              w += g;
              m += g * v;
              s += g * v * v;
            }
          m /= w;
          s = s / w - m * m;
          sum += (2 * m * (1 - m) + 1e-4) * (-2 * s + 9e-4) / ((m * m + (1 - m) * (1 - m) + 1e-4) * (2 * s + 9e-4));
          ++count;
        }
  CHECK(gsp::io::ssim(a, other, width, height, channels) == doctest::Approx(sum / count).epsilon(1e-6));  // 1 - x rounds
  CHECK_THROWS_AS(gsp::io::ssim(a, p, 10, height, channels), std::invalid_argument);
  CHECK_THROWS_AS(gsp::io::ssim(a, p, 18, height, channels), std::invalid_argument);
  CHECK_THROWS_AS(gsp::io::ssim(a, {}, width, height, channels), std::invalid_argument);
}

TEST_CASE("the median error is that of the places that count") {
  std::vector<float> const a{1, 2, 3, 4, 5, 9}, b{1.5f, 2, 2, 4.25f, 5, 0}, alpha{1, 1, 1, 1, 1, 0.5f};
  CHECK(gsp::io::median_error(a, b, alpha, 0.5f) == 0.25);
  CHECK(gsp::io::median_error(a, b, alpha, 1) == 0);
  CHECK_THROWS_AS(gsp::io::median_error(a, b, {1.f}, 0), std::invalid_argument);
}
