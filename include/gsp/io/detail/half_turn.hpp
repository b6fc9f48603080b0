#pragma once
#include <array>
#include <cmath>
#include <gsp/io/detail/splat_rotation.hpp>
#include <gsp/io/splat_set.hpp>

namespace gsp::io::detail {

/// Turns all Gaussians by half a turn about x, y or z (axis 0, 1, 2), without rounding: F = diag(+-1), two of them negative.
///   F (R S S R^T) F = (F R F) S S (F R F)^T
/// so that two components of a quaternion change sign, as do the SH terms that are odd under F.
inline void half_turn(SplatSet& set, int axis) {
  std::array<float, 3> sign{-1, -1, -1};
  sign[static_cast<std::size_t>(axis)] = 1;
  double const x = 0.36, y = 0.48, z = 0.8;  // no term is 0 here
  auto const before = sh_basis(x, y, z), after = sh_basis(sign[0] * x, sign[1] * y, sign[2] * z);
  std::size_t const terms = set.sh_terms();
  for (std::size_t i = 0; i < set.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      set.positions[3 * i + k] *= sign[k];
      set.quats[4 * i + 1 + k] *= sign[k];
    }
    for (std::size_t t = 1; t < terms; ++t)
      if (std::signbit(before[t]) != std::signbit(after[t]))
        for (std::size_t c = 0; c < 3; ++c) set.sh[3 * (terms * i + t) + c] *= -1;
  }
}

}  // namespace gsp::io::detail
