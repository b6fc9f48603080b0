#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace gsp::io::detail {

struct PngInfo {
  std::uint32_t width, height;
  int depth, color, channels;  // channels as stored: 1 for a palette
  bool interlaced;
  std::size_t row_bytes(std::size_t w) const { return (w * static_cast<std::size_t>(channels * depth) + 7) / 8; }
};

/// One of the seven passes of an interlaced picture (or all of a plain one): pixels x0 + i dx, y0 + j dy.
struct PngPass {
  std::uint32_t x0, y0, dx, dy;
  std::size_t columns(PngInfo const& p) const { return p.width > x0 ? (p.width - x0 + dx - 1) / dx : 0; }
  std::size_t rows(PngInfo const& p) const { return p.height > y0 ? (p.height - y0 + dy - 1) / dy : 0; }
};
inline std::vector<PngPass> png_passes(PngInfo const& p) {
  if (!p.interlaced) return {{0, 0, 1, 1}};
  return {{0, 0, 8, 8}, {4, 0, 8, 8}, {0, 4, 4, 8}, {2, 0, 4, 4}, {0, 2, 2, 4}, {1, 0, 2, 2}, {0, 1, 1, 2}};
}

}  // namespace gsp::io::detail
