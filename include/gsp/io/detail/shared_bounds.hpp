#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <gsp/io/detail/splat_bounds.hpp>
#include <gsp/io/splat_set.hpp>

namespace gsp::io::detail {

/// Bounds that Gaussians share in a file, and the numbers between them in whole steps. For writers, and for write_splats, which says what
/// the steps cost.
struct SharedBounds {
  double low, high, most;  // most: steps from low to high

  std::uint32_t pack(double x) const {
    double const range = high - low;
    return static_cast<std::uint32_t>(range > 0 ? std::clamp(std::round((x - low) / range * most), 0., most) : 0);
  }
  double unpack(std::uint32_t steps) const {
    double const t = steps / most;
    return low * (1 - t) + high * t;
  }
};

/// Of value(i), first <= i < last.
template <class Value>
SharedBounds shared_bounds(std::size_t first, std::size_t last, double most, Value const& value) {
  SharedBounds bounds{double(value(first)), double(value(first)), most};
  for (std::size_t i = first; i < last; ++i) {
    bounds.low = std::min(bounds.low, double(value(i)));
    bounds.high = std::max(bounds.high, double(value(i)));
  }
  return bounds;
}

/// What a compressed PLY has of a Gaussian between bounds: x y z, log-scales, r g b.
inline constexpr std::array<int, 9> compressed_ply_bits{11, 10, 11, 11, 10, 11, 8, 8, 8};

inline float compressed_ply_value(SplatSet const& set, std::size_t i, std::size_t k) {
  if (k < 3) return set.positions[3 * i + k];
  if (k < 6) return static_cast<float>(std::log(std::max(double(set.scales[3 * i + k - 3]), std::exp(packed_least_log_scale))));
  return static_cast<float>(0.5 + sh_c0 * set.sh[3 * set.sh_terms() * i + k - 6]);
}

/// Of the number k of its chunk c: 256 neighbours.
inline SharedBounds compressed_ply_bounds(SplatSet const& set, std::size_t c, std::size_t k) {
  return shared_bounds(256 * c, std::min(set.size(), 256 * c + 256), (1 << compressed_ply_bits[k]) - 1,
                       [&](std::size_t i) { return compressed_ply_value(set, i, k); });
}

/// SOG's places lie between bounds of all as v = sign(x) log(1 + |x|), with 16 bits.
inline double symlog(double x) { return std::copysign(std::log1p(std::abs(x)), x); }
inline double symexp(double v) { return std::copysign(std::expm1(std::abs(v)), v); }
inline SharedBounds sog_bounds(SplatSet const& set, std::size_t k) {
  return shared_bounds(0, set.size(), 65535, [&](std::size_t i) { return symlog(set.positions[3 * i + k]); });
}

}  // namespace gsp::io::detail
