#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <gsp/core/check.hpp>
#include <initializer_list>
#include <string>
#include <type_traits>
#include <vector>

namespace gsp::io {

/// A picture on the host as files hold it: rows from the top, `channels` interleaved (1 grey, 2 grey + alpha, 3 r g b, 4 r g b alpha).
template <class T>
struct Bitmap {
  int width = 0, height = 0, channels = 0;
  std::vector<T> pixels;  // (height, width, channels)
};
using Bitmap8 = Bitmap<std::uint8_t>;
using Bitmap16 = Bitmap<std::uint16_t>;

template <class T>
Bitmap<T> make_bitmap(int width, int height, int channels, T value = 0) {
  expects(width > 0 && height > 0 && channels >= 1 && channels <= 4,
          "gsp::io::make_bitmap: width and height must be positive and channels 1..4");
  return {width, height, channels, std::vector<T>(static_cast<std::size_t>(width) * height * channels, value)};
}

/// Throws std::invalid_argument unless the pixels are as many as width, height and channels say.
template <class T>
void expect_bitmap(Bitmap<T> const& b, char const* function) {
  expects(
      b.width > 0 && b.height > 0 && b.channels >= 1 && b.channels <= 4 &&
          b.pixels.size() == static_cast<std::size_t>(b.width) * b.height * b.channels,
      std::string(function) + ": the bitmap is " + std::to_string(b.width) + " x " + std::to_string(b.height) + " x " +
          std::to_string(b.channels) + " and has " + std::to_string(b.pixels.size()) +
          " values: it needs a positive size, 1 to 4 channels and width * height * channels values; make_bitmap and to_bitmap8 give one");
}

/// 0..1 -> 0..255, rounded to nearest, clamped; NaN becomes 0.
inline std::uint8_t to_byte(float x) { return static_cast<std::uint8_t>(x > 0 ? std::min(x, 1.f) * 255 + 0.5f : 0.f); }

/// float (height, width, channels), 0..1, to 8 bits. `values` points at height * width * channels numbers.
inline Bitmap8 to_bitmap8(float const* values, int width, int height, int channels) {
  Bitmap8 out = make_bitmap<std::uint8_t>(width, height, channels);
  std::transform(values, values + out.pixels.size(), out.pixels.begin(), to_byte);
  return out;
}

/// Depth (height, width) [m] to 16-bit grey, `unit` metres a step (default: millimetres), rounded to nearest. What is not finite, not
/// positive, or beyond 65535 units becomes 0, "no depth", as depth cameras write it.
inline Bitmap16 depth_to_bitmap16(float const* depth, int width, int height, float unit = 1e-3f) {
  expects(unit > 0, "gsp::io::depth_to_bitmap16: unit must be positive");
  Bitmap16 out = make_bitmap<std::uint16_t>(width, height, 1);
  for (std::size_t i = 0; i < out.pixels.size(); ++i) {
    float const steps = depth[i] / unit + 0.5f;
    out.pixels[i] = static_cast<std::uint16_t>(steps >= 0.5f && steps < 65536.f ? steps : 0.f);
  }
  return out;
}

/// Columns in which `n` pictures of one size make a sheet as square as it goes.
///   columns * width = rows * height,   rows = n / columns
inline int sheet_columns(int n, int width, int height) {
  return std::clamp(static_cast<int>(std::lround(std::sqrt(double(n) * height / width))), 1, n);
}

/// Pictures of one size in a grid, row by row, `padding` pixels of `background` between and around them. `columns` = 0: sheet_columns.
template <class T>
Bitmap<T> contact_sheet(std::vector<Bitmap<T>> const& tiles, int columns = 0, int padding = 2, std::type_identity_t<T> background = 0) {
  expects(!tiles.empty(), "gsp::io::contact_sheet: there are no pictures");
  expects(columns >= 0 && padding >= 0, "gsp::io::contact_sheet: columns and padding must not be negative");
  auto const& first = tiles.front();
  for (auto const& t : tiles) {
    expect_bitmap(t, "gsp::io::contact_sheet");
    expects(t.width == first.width && t.height == first.height && t.channels == first.channels,
            "gsp::io::contact_sheet: the pictures differ in size or channels");
  }
  int const n = static_cast<int>(tiles.size());
  if (columns == 0) columns = sheet_columns(n, first.width, first.height);
  int const rows = (n + columns - 1) / columns;
  auto sheet =
      make_bitmap<T>(columns * (first.width + padding) + padding, rows * (first.height + padding) + padding, first.channels, background);
  std::size_t const row_values = static_cast<std::size_t>(first.width) * first.channels;
  for (int t = 0; t < n; ++t)
    for (int y = 0; y < first.height; ++y) {
      std::size_t const top = static_cast<std::size_t>(t / columns) * (first.height + padding) + padding + y,
                        left = static_cast<std::size_t>(t % columns) * (first.width + padding) + padding;
      std::copy_n(&tiles[t].pixels[y * row_values], row_values, &sheet.pixels[(top * sheet.width + left) * first.channels]);
    }
  return sheet;
}
/// The same of pictures by name: contact_sheet({before, after}, 2).
template <class T>
Bitmap<T> contact_sheet(std::initializer_list<Bitmap<T>> tiles, int columns = 0, int padding = 2, std::type_identity_t<T> background = 0) {
  return contact_sheet(std::vector<Bitmap<T>>(tiles), columns, padding, background);
}

}  // namespace gsp::io
