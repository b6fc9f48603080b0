#pragma once
#include <array>
#include <gsp/io/splat_set.hpp>
#include <string_view>

namespace gsp::io {

/// x -> scale R x + position: where a set stands in the world. `quat` is w x y z, of any length but 0.
struct SplatPose {
  std::array<double, 3> position{0, 0, 0};
  std::array<double, 4> quat{1, 0, 0, 0};
  double scale = 1;
};

/// A pose written as a user types it: "x y z qw qx qy qz scale". Throws Error unless these are eight finite numbers, with a quaternion that
/// is not 0 and a positive scale.
SplatPose parse_splat_pose(std::string_view text);

struct SplatTransformOptions {
  bool links = false;  // also those bound to a link; they stand in the link's frame, which a move of the scene leaves alone
};

/// The matrix D that turns SH coefficients with a rotated Gaussian: sum_k (D c)_k Y_k(R d) = sum_k c_k Y_k(d) for all d. Block diagonal (1,
/// 3, 5, 7), orthogonal.
///   D_jk = integral over the sphere of Y_j(R d) Y_k(d)
/// The integrand is a polynomial of degree <= 6 on the sphere, for which 4 Gauss-Legendre heights (exact to degree 7) times 7 equal
/// azimuths (exact to order 6) integrate exactly: the 28 points give D to rounding, with no special cases. Within a band only: across bands
/// the integral is 0.
std::array<std::array<double, 16>, 16> sh_rotation(std::array<double, 4> const& unit_quat);

/// Moves Gaussians by x -> scale R x + position: positions, rotations, sizes, and the directions of their colours. In place. Throws
/// std::invalid_argument where the scale is not positive, the quaternion is 0, or a number is not finite or would be beyond a float:
/// nothing has moved then. Cost: 83 products per colour channel at SH 3.
void transform(SplatSet& set, SplatPose const& pose, SplatTransformOptions options = {});

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/splat_transform_impl.hpp>
#endif
