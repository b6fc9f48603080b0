#pragma once
#include <Kokkos_Core.hpp>

namespace gsp {

inline constexpr float splat_log2_255 = 7.99435344f;  // log2(255): alpha below 1/255 is left out

/// A Gaussian as one image sees it (48 bytes). Its alpha at the pixel centre (x, y), with dx = x - u and dy = y - v, is
///   alpha = min(alpha_max, 2^(power - (l11 dx + l21 dy)^2 - (l22 dy)^2)),   left out below 1/255,
/// where (l11 0; l21 l22)^T is the Cholesky factor of log2(e)/2 times the inverse 2D covariance: unlike the usual conic form
/// A dx^2 + 2 B dx dy + C dy^2 it has no cancellation for long thin splats.
struct alignas(16) Splat {
  float u, v;           // centre [pixel]
  float l11, l21, l22;  // [1/pixel]
  float power;          // log2(opacity)
  float xe, ye;         // half extents of the region alpha >= 1/255 [pixel]
  float r, g, b;        // colour, >= 0
  float depth;          // camera z of the centre
};

}  // namespace gsp
