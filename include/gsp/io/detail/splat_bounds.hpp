#pragma once
#include <algorithm>
#include <cmath>
#include <gsp/io/splat_set.hpp>

/// Bounds of the numbers that splat formats hold: writers clamp to them, and write_splats tells of what lies beyond.
namespace gsp::io::detail {

inline constexpr double ply_least_scale = 1.2e-38;        // its logarithm is finite
inline constexpr double splat_most_colour = 0.5 / sh_c0;  // a byte: 255 (sh_c0 c + 0.5)
inline constexpr double packed_least_log_scale = -20;     // compressed PLY, SOG
inline constexpr double compressed_ply_sh = 4;            // +-, a byte: 256 (c / 8 + 0.5)
inline constexpr double spz_colour_slope = 0.15;          // a byte: 255 (0.15 c + 0.5)
inline constexpr double spz_most_colour = 0.5 / spz_colour_slope;
inline constexpr double spz_least_log_scale = -10;  // a byte: 16 (log s + 10)
inline constexpr int spz_most_fraction_bits = 12;

/// Behind the point of .spz's coordinates, of 24 bits: all, or fewer where one stands far off.
inline int spz_fraction_bits(SplatSet const& set) {
  double most = 0;
  for (float p : set.positions) most = std::max(most, std::abs(double(p)));
  int bits = spz_most_fraction_bits;
  while (bits > 0 && std::ldexp(most, bits) > 0x7fffff) --bits;
  return bits;
}

}  // namespace gsp::io::detail
