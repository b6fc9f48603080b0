#pragma once
#include <array>
#include <cmath>
#include <gsp/io/detail/splat_rotation.hpp>
#include <gsp/io/splat_transform.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <optional>

namespace gsp::io::detail {

/// An affine map of column vectors, (row, column): x -> M x + t.
struct AffineMap {
  std::array<double, 9> m{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> t{};

  /// First `b`, then this.
  AffineMap operator*(AffineMap const& b) const {
    AffineMap out;
    for (int i = 0; i < 3; ++i) {
      out.t[i] = t[i];
      for (int k = 0; k < 3; ++k) out.t[i] += m[3 * i + k] * b.t[k];
      for (int j = 0; j < 3; ++j) {
        out.m[3 * i + j] = 0;
        for (int k = 0; k < 3; ++k) out.m[3 * i + j] += m[3 * i + k] * b.m[3 * k + j];
      }
    }
    return out;
  }
  bool identity() const { return m == AffineMap{}.m && t == AffineMap{}.t; }
};

/// `quat` w x y z, of any length but 0; `scale` along the axes before the turn.
inline AffineMap affine_map(std::array<double, 3> const& t, std::array<double, 4> q, std::array<double, 3> const& scale) {
  double const norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& v : q) v /= norm;
  AffineMap out{rotation_matrix(q), t};
  for (int i = 0; i < 9; ++i) out.m[i] *= scale[i % 3];
  return out;
}

/// The map as turn, one scale and offset; nothing where it is none: axes of different length (1e-4), not at right angles, or mirrored.
inline std::optional<SplatPose> rigid(AffineMap const& map) {
  auto const& m = map.m;
  auto const dot = [&](int a, int b) { return m[a] * m[b] + m[3 + a] * m[3 + b] + m[6 + a] * m[6 + b]; };
  double const det = m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
  double const scale = std::cbrt(det), square = scale * scale;
  if (!(std::isfinite(det) && std::isfinite(square) && det > 0 && square > 0)) return std::nullopt;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      if (!(std::abs(dot(a, b) - (a == b ? square : 0)) <= 2e-4 * square)) return std::nullopt;
  for (double v : map.t)
    if (!std::isfinite(v)) return std::nullopt;
  auto const axis = [&](int a) { return Double3{m[a] / scale, m[3 + a] / scale, m[6 + a] / scale}; };
  return SplatPose{map.t, gsp::detail::quat_of_axes(axis(0), axis(1), axis(2)), scale};
}

}  // namespace gsp::io::detail
