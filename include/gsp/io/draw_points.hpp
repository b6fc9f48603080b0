#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <gsp/io/colormap.hpp>
#include <gsp/io/file.hpp>
#include <gsp/math/quat.hpp>
#include <numbers>
#include <string>
#include <vector>

/// Pictures and files of points that rays have met. Host.
namespace gsp::io {

/// Colours of ranges [m]: near red, far blue, evenly in the logarithm from the nearest (from 1 mm on) to the farthest, at most twice as far
/// as 95 of 100 lie; what is farther has the last colour, so that a few far points take nothing from the others.
inline std::vector<std::array<std::uint8_t, 3>> range_colors(std::vector<float> const& range) {
  std::vector<std::array<std::uint8_t, 3>> out;
  if (range.empty()) return out;
  auto sorted = range;
  auto const p95 = sorted.begin() + std::ptrdiff_t((95 * (range.size() - 1) + 99) / 100);
  std::nth_element(sorted.begin(), p95, sorted.end());
  auto const [least, most] = std::minmax_element(range.begin(), range.end());
  float const near = std::log(std::max(*least, 1e-3f)), far = std::log(std::max(std::min(*most, 2 * *p95), 1e-3f));
  for (float const r : range) {
    auto const c = rainbow(far > near ? (far - std::log(std::max(r, 1e-3f))) / (far - near) : 0.5f);
    out.push_back({to_byte(c[0]), to_byte(c[1]), to_byte(c[2])});
  }
  return out;
}

/// A cloud of points as a binary PLY, all or nothing: x y z, red green blue by range, range and geom, as `gsp scan --ply` writes it.
/// @param point  in the world [m], as RayScan::point has them, without the misses
/// @param range  [m] of each
/// @param geom   of each, -1: none; empty: of none
/// Errors: gsp::Error where the file cannot be written; std::invalid_argument for ranges or geoms of another number.
inline void write_points(std::filesystem::path const& path, std::vector<std::array<float, 3>> const& point, std::vector<float> const& range,
                         std::vector<int> const& geom = {}) {
  expects(point.size() == range.size() && (geom.empty() || geom.size() == point.size()),
          "gsp::io::write_points: give a range for each point, and a geom for each or none");
  std::string const text = "ply\nformat binary_little_endian 1.0\ncomment points that rays met, in the world [m]\nelement vertex " +
                           std::to_string(point.size()) +
                           "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty "
                           "uchar blue\nproperty float range\nproperty int geom\nend_header\n";
  auto const colours = range_colors(range);
  constexpr std::size_t row = 23;
  std::vector<std::byte> bytes(text.size() + row * point.size());
  std::memcpy(bytes.data(), text.data(), text.size());
  for (std::size_t k = 0; k < point.size(); ++k) {
    std::byte* const to = bytes.data() + text.size() + row * k;
    int const g = geom.empty() ? -1 : geom[k];
    std::memcpy(to, point[k].data(), 12);
    std::memcpy(to + 12, colours[k].data(), 3);
    std::memcpy(to + 15, &range[k], 4);
    std::memcpy(to + 19, &g, 4);
  }
  write_file(path, bytes);
}

/// Two pictures side by side, each `size` pixels square: from above about the unit, the world's x to the right and its y up, out to where
/// nine of ten points lie; and around the unit, its x axis in the middle, its left to the left, from the lowest point to the highest.
/// @param point  in the world [m], as RayScan::point has them, without the misses
/// @param range  [m] of each
/// @param unit   where the unit stands
/// What is higher, and what is nearer, covers what is not. Errors: std::invalid_argument for a size below 1, and ranges of another number.
inline Bitmap8 draw_points(std::vector<std::array<float, 3>> const& point, std::vector<float> const& range, Transform<double> const& unit,
                           int size = 600) {
  expects(size > 0 && point.size() == range.size(), "gsp::io::draw_points: give a range for each point, and a size of at least 1 pixel");
  int const gap = 8;
  auto out = make_bitmap<std::uint8_t>(2 * size + gap, size, 3, std::uint8_t(20));
  for (int row = 0; row < size; ++row)
    for (int c = 0; c < 3 * gap; ++c) out.pixels[std::size_t(3 * (row * out.width + size) + c)] = 255;
  std::size_t const n = point.size();
  if (n == 0) return out;
  auto const colours = range_colors(range);
  std::vector<double> away(n), turn(n), up(n);
  for (std::size_t k = 0; k < n; ++k) {
    auto const& p = point[k];
    Vec3<double> const v = Vec3<double>{p[0], p[1], p[2]} - unit.p, u = rotate_inverse(unit.q, v);
    away[k] = std::hypot(v.x, v.y);
    turn[k] = std::atan2(u.y, u.x);
    up[k] = std::atan2(u.z, std::hypot(u.x, u.y));
  }
  auto sorted = away;
  std::nth_element(sorted.begin(), sorted.begin() + std::ptrdiff_t(9 * (n - 1) / 10), sorted.end());
  double const far = std::max(1.05 * sorted[9 * (n - 1) / 10], 1e-3);
  auto const [lowest, highest] = std::minmax_element(up.begin(), up.end());
  double const low = *lowest - 0.02, high = *highest + 0.02;
  auto const dot = [&](double x, double y, int left, std::array<std::uint8_t, 3> const& colour) {
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j) {
        double const column = std::floor(x) + j, row = std::floor(y) + i;
        if (!(column >= 0 && column < size && row >= 0 && row < size)) continue;
        for (std::size_t c = 0; c < 3; ++c) out.pixels[3 * (std::size_t(row) * out.width + left + std::size_t(column)) + c] = colour[c];
      }
  };
  // what is drawn last stands before: what is higher, what is nearer
  std::vector<std::size_t> order(n);
  for (std::size_t k = 0; k < n; ++k) order[k] = k;
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return point[a][2] < point[b][2]; });
  for (auto const k : order)
    dot(size / 2. * (1 + (point[k][0] - unit.p.x) / far), size / 2. * (1 - (point[k][1] - unit.p.y) / far), 0, colours[k]);
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return range[a] > range[b]; });
  for (auto const k : order)
    dot(size * (0.5 - turn[k] / (2 * std::numbers::pi)), size * (high - up[k]) / (high - low), size + gap, colours[k]);
  return out;
}

}  // namespace gsp::io
