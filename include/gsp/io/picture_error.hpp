#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/core/check.hpp>
#include <limits>
#include <string>
#include <vector>

/// How far a picture is from another, in the measures that papers print. Values below 0 and above 1 are cut off, as a screen does.
namespace gsp::io {

namespace detail {
inline void expect_alike(char const* function, std::size_t a, std::size_t b, std::size_t least) {
  expects(a == b && a >= least, std::string(function) + ": the pictures have " + std::to_string(a) + " and " + std::to_string(b) +
                                    " numbers: give two of one size, of " + std::to_string(least) + " or more");
}
inline double on_screen(float x) { return x > 0 ? std::min(double(x), 1.) : 0.; }
}  // namespace detail

/// -10 log10 of the mean square of a - b [dB]; infinity where they are equal. Errors: std::invalid_argument for none, and for other sizes.
inline double psnr(std::vector<float> const& a, std::vector<float> const& b) {
  detail::expect_alike("gsp::io::psnr", a.size(), b.size(), 1);
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    double const d = detail::on_screen(a[i]) - detail::on_screen(b[i]);
    sum += d * d;
  }
  return sum > 0 ? -10 * std::log10(sum / double(a.size())) : std::numeric_limits<double>::infinity();
}

/// Structural similarity (Wang et al. 2004): the mean, over images, channels and the places where the window fits into the picture, of
///   (2 ma mb + c1) (2 sab + c2) / ((ma^2 + mb^2 + c1) (saa + sbb + c2)),   c1 = 0.01^2, c2 = 0.03^2,
/// of means and (co)variances under a Gaussian window of 11 x 11 pixels, deviation 1.5. 1 where they are equal.
/// @param a, b  pictures (images, height, width, channels), one after the other
/// Errors: std::invalid_argument for other sizes and for pictures below 11 x 11.
inline double ssim(std::vector<float> const& a, std::vector<float> const& b, int width, int height, int channels) {
  constexpr int side = 11;
  expects(width >= side && height >= side && channels > 0, "gsp::io::ssim: pictures of " + std::to_string(width) + " x " +
                                                               std::to_string(height) + " with " + std::to_string(channels) +
                                                               " channels; its window needs 11 x 11 pixels, and one channel or more");
  std::size_t const picture = std::size_t(width) * std::size_t(height) * std::size_t(channels);
  detail::expect_alike("gsp::io::ssim", a.size(), b.size(), picture);
  expects(a.size() % picture == 0, "gsp::io::ssim: " + std::to_string(a.size()) + " numbers are no whole number of pictures of " +
                                       std::to_string(picture) + ": give width, height and channels of these");
  std::array<double, side> window;
  double all = 0;
  for (int k = 0; k < side; ++k) {
    window[std::size_t(k)] = std::exp(-(k - 5) * (k - 5) / (2 * 1.5 * 1.5));
    all += window[std::size_t(k)];
  }
  for (double& w : window) w /= all;
  using Moments = std::array<double, 5>;  // a, b, a a, b b, a b
  int const columns = width - side + 1;
  std::vector<Moments> rows(std::size_t(height) * std::size_t(columns));
  double sum = 0;
  for (std::size_t start = 0; start < a.size(); start += picture)
    for (int c = 0; c < channels; ++c) {
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < columns; ++x) {
          Moments m{};
          for (int k = 0; k < side; ++k) {
            std::size_t const at =
                start + (std::size_t(y) * std::size_t(width) + std::size_t(x + k)) * std::size_t(channels) + std::size_t(c);
            double const w = window[std::size_t(k)], p = detail::on_screen(a[at]), q = detail::on_screen(b[at]);
            Moments const of{p, q, p * p, q * q, p * q};
            for (std::size_t n = 0; n < 5; ++n) m[n] += w * of[n];
          }
          rows[std::size_t(y) * std::size_t(columns) + std::size_t(x)] = m;
        }
      for (int y = 0; y + side <= height; ++y)
        for (int x = 0; x < columns; ++x) {
          Moments m{};
          for (int k = 0; k < side; ++k)
            for (std::size_t n = 0; n < 5; ++n)
              m[n] += window[std::size_t(k)] * rows[std::size_t(y + k) * std::size_t(columns) + std::size_t(x)][n];
          double const saa = m[2] - m[0] * m[0], sbb = m[3] - m[1] * m[1], sab = m[4] - m[0] * m[1], c1 = 1e-4, c2 = 9e-4;
          sum += (2 * m[0] * m[1] + c1) * (2 * sab + c2) / ((m[0] * m[0] + m[1] * m[1] + c1) * (saa + sbb + c2));
        }
    }
  return sum / (double(a.size() / picture) * channels * columns * (height - side + 1));
}

/// Median of |a - b| over the places where `counts` is above `above`; 0 where there are none. Errors: std::invalid_argument for other
/// sizes.
inline double median_error(std::vector<float> const& a, std::vector<float> const& b, std::vector<float> const& counts, float above) {
  detail::expect_alike("gsp::io::median_error", a.size(), b.size(), 0);
  detail::expect_alike("gsp::io::median_error", a.size(), counts.size(), 0);
  std::vector<double> errors;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (counts[i] > above) errors.push_back(std::abs(double(a[i]) - double(b[i])));
  if (errors.empty()) return 0;
  auto const middle = errors.begin() + std::ptrdiff_t(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  return *middle;
}

}  // namespace gsp::io
