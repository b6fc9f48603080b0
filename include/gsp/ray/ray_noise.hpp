#pragma once
#include <cmath>
#include <gsp/math/philox.hpp>
#include <gsp/ray/ray_shapes.hpp>

/// What a LiDAR unit errs by: angles, ranges, rays that do not come back. Numbers follow from the seed, the unit, the world and the number
/// of the ray (gsp/math/philox.hpp), and from nothing else. No Kokkos.
namespace gsp {

struct RayNoise {
  double range_sigma = 0;     // [m] deviation of ranges, and
  double relative_sigma = 0;  // as a share of the range; both are independent
  double angle_sigma = 0;     // [rad] deviation of a ray's direction in each of two directions across it, before it is cast
  double dropout = 0;         // probability that a ray does not come back
  double range_step = 0;      // [m] ranges are whole multiples of it; 0: any
  std::uint64_t seed = 0;
  std::uint32_t unit = 0;  // below 2^24; units of one seed that differ have independent noise
};
/// Whose noise it is: ray n of all that the unit has sent (ray/ray_clock.hpp), in this world.
struct RayNumber {
  std::uint64_t ray;
  std::uint32_t world;
};

namespace detail {
/// Four numbers; a ray has 256 such streams.
GSP_FUNCTION Philox noise_words(RayNoise const& noise, RayNumber const& number, std::uint32_t stream) {
  return philox(noise.seed, {{std::uint32_t(number.ray), std::uint32_t(number.ray >> 32), number.world, noise.unit << 8 | stream}});
}
}  // namespace detail

/// A unit vector, bent by the angle noise: by a Rayleigh angle in a direction round it that is uniform, so by angle_sigma in each of two
/// directions.
template <class R>
GSP_FUNCTION Vec3<R> noisy_direction(RayNoise const& noise, RayNumber const& number, Vec3<R> const& d) {
  if (!(noise.angle_sigma > 0)) return d;
  Philox const words = detail::noise_words(noise, number, 0);
  auto const spread = Spread<R>::of(words.word[0], words.word[1]);
  // two unit vectors across d (Duff et al., Building an orthonormal basis, revisited, JCGT 2017)
  R const sign = d.z < R(0) ? R(-1) : R(1), a = R(-1) / (sign + d.z), b = d.x * d.y * a;
  Vec3<R> const u{R(1) + sign * d.x * d.x * a, sign * b, -sign * d.x}, v{b, sign + d.y * d.y * a, -d.y};
  R s, c, bend, along;
  sincos(spread.angle, s, c);
  sincos(R(noise.angle_sigma) * spread.r, bend, along);
  return along * d + (bend * c) * u + (bend * s) * v;
}
/// What the unit says of a range [m]: with noise and rounded, infinity where the ray does not come back. Of infinity: infinity.
template <class R>
GSP_FUNCTION R noisy_range(RayNoise const& noise, RayNumber const& number, R range) {
  R const none = detail::no_hit<R>();
  if (!(range < none)) return none;
  R const sigma = R(noise.range_sigma), relative = R(noise.relative_sigma) * range;
  if (noise.range_sigma > 0 || noise.relative_sigma > 0 || noise.dropout > 0) {
    Philox const words = detail::noise_words(noise, number, 1);
    if (uniform_of<R>(words.word[2]) < R(noise.dropout)) return none;
    range = fma(sqrt(fma(sigma, sigma, relative * relative)), Spread<R>::of(words.word[0], words.word[1]).normal(), range);
  }
  if (noise.range_step > 0) range = R(noise.range_step) * std::floor(range / R(noise.range_step) + R(0.5));
  return range;
}

}  // namespace gsp
