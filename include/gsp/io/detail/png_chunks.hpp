#pragma once
#include <array>
#include <cstdlib>
#include <gsp/io/bitmap.hpp>
#include <gsp/io/detail/deflate.hpp>
#include <type_traits>

// What PNG and APNG writing share: chunks, and filtered rows.

namespace gsp::io::detail {

inline constexpr std::string_view png_signature{"\x89PNG\r\n\x1a\n", 8};

inline void put_be(std::vector<std::byte>& out, std::uint32_t value, int bytes = 4) {
  while (bytes-- > 0) out.push_back(static_cast<std::byte>(value >> (8 * bytes) & 255));
}
inline std::uint32_t get_be(Bytes b, std::size_t at) {
  return std::uint32_t(b[at]) << 24 | std::uint32_t(b[at + 1]) << 16 | std::uint32_t(b[at + 2]) << 8 | std::uint32_t(b[at + 3]);
}

/// length, type, data, CRC of type and data.
inline void put_chunk(std::vector<std::byte>& out, std::string_view type, Bytes data) {
  put_be(out, static_cast<std::uint32_t>(data.size()));
  std::size_t const begin = out.size();
  for (char c : type) out.push_back(static_cast<std::byte>(c));
  out.insert(out.end(), data.begin(), data.end());
  put_be(out, crc32(Bytes(out).subspan(begin)));
}

/// The predictor of filter 4: whichever of left a, up b, upper left c is nearest to a + b - c.
inline int paeth(int a, int b, int c) {
  int const pa = std::abs(b - c), pb = std::abs(a - c), pc = std::abs(a + b - 2 * c);
  return pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
}
inline int png_predict(int filter, int left, int up, int corner) {
  return filter == 0 ? 0 : filter == 1 ? left : filter == 2 ? up : filter == 3 ? (left + up) / 2 : paeth(left, up, corner);
}

/// Rows as PNG stores them, each behind its filter number. Of the five filters the one with the least sum of |residual| is taken, a good
/// guess of what packs best.
inline std::vector<std::byte> filter_rows(Bytes rows, std::size_t stride, std::size_t pixel) {
  std::vector<std::byte> out, trial(stride), best(stride);
  out.reserve(rows.size() + rows.size() / stride);
  for (std::size_t y = 0; y * stride < rows.size(); ++y) {
    Bytes const row = rows.subspan(y * stride, stride);
    long best_sum = -1;
    int best_filter = 0;
    for (int filter = 0; filter < 5; ++filter) {
      long sum = 0;
      for (std::size_t x = 0; x < stride; ++x) {
        int const left = x >= pixel ? int(row[x - pixel]) : 0, up = y ? int(rows[(y - 1) * stride + x]) : 0,
                  corner = y && x >= pixel ? int(rows[(y - 1) * stride + x - pixel]) : 0;
        int const residual = (int(row[x]) - png_predict(filter, left, up, corner)) & 255;
        trial[x] = static_cast<std::byte>(residual);
        sum += residual < 128 ? residual : 256 - residual;
      }
      if (best_sum < 0 || sum < best_sum) {
        best_sum = sum;
        best_filter = filter;
        std::swap(best, trial);
      }
    }
    out.push_back(static_cast<std::byte>(best_filter));
    out.insert(out.end(), best.begin(), best.end());
  }
  return out;
}

/// The pixels as bytes, 16-bit values high byte first.
template <class T>
std::vector<std::byte> png_rows(Bitmap<T> const& b) {
  std::vector<std::byte> rows;
  rows.reserve(b.pixels.size() * sizeof(T));
  for (T v : b.pixels) put_be(rows, v, sizeof(T));
  return rows;
}

inline std::vector<std::byte> png_header(int width, int height, int channels, int depth) {
  std::vector<std::byte> h;
  put_be(h, static_cast<std::uint32_t>(width));
  put_be(h, static_cast<std::uint32_t>(height));
  for (int v : {depth, std::array{0, 4, 2, 6}[static_cast<std::size_t>(channels - 1)], 0, 0, 0}) h.push_back(static_cast<std::byte>(v));
  return h;
}

}  // namespace gsp::io::detail
