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
GSP_FUNCTION bool has_range_noise(RayNoise const& noise) { return noise.range_sigma > 0 || noise.relative_sigma > 0 || noise.dropout > 0; }
/// Unit vectors, bent: by a Rayleigh angle in a direction round each that is uniform. T may be a pack of rays.
template <class T>
GSP_FUNCTION Vec3<T> bent(RayNoise const& noise, Spread<T> const& spread, Vec3<T> const& d) {
  // two unit vectors across d (Duff et al., Building an orthonormal basis, revisited, JCGT 2017)
  T const one(real_t<T>(1)), sign = select(d.z < T(real_t<T>(0)), -one, one), a = -one / (sign + d.z), b = d.x * d.y * a;
  Vec3<T> const u{one + sign * d.x * d.x * a, sign * b, -sign * d.x}, v{b, sign + d.y * d.y * a, -d.y};
  T s, c, bend, along;
  sincos(spread.angle, s, c);
  sincos(T(real_t<T>(noise.angle_sigma)) * spread.r, bend, along);
  return along * d + (bend * c) * u + (bend * s) * v;
}
/// Ranges with their noise, infinity where `uniform` says that the ray does not come back. T may be a pack of rays.
template <class T>
GSP_FUNCTION T with_noise(RayNoise const& noise, Spread<T> const& spread, T const& uniform, T const& range) {
  using R = real_t<T>;
  T const sigma(R(noise.range_sigma)), relative = T(R(noise.relative_sigma)) * range;
  T const measured = fma(sqrt(fma(sigma, sigma, relative * relative)), spread.normal(), range);
  return select(uniform < T(R(noise.dropout)), no_hit<T>(), measured);
}
/// To the nearest step.
template <class R>
GSP_FUNCTION R in_steps(RayNoise const& noise, R range) {
  return noise.range_step > 0 && range < no_hit<R>() ? R(noise.range_step) * std::floor(range / R(noise.range_step) + R(0.5)) : range;
}
}  // namespace detail

/// A unit vector, bent by the angle noise: by angle_sigma in each of two directions across it.
template <class R>
GSP_FUNCTION Vec3<R> noisy_direction(RayNoise const& noise, RayNumber const& number, Vec3<R> const& d) {
  if (!(noise.angle_sigma > 0)) return d;
  Philox const words = detail::noise_words(noise, number, 0);
  return detail::bent(noise, Spread<R>::of(words.word[0], words.word[1]), d);
}
/// What the unit says of a range [m]: with noise and rounded, infinity where the ray does not come back. Of infinity and NaN: infinity.
template <class R>
GSP_FUNCTION R noisy_range(RayNoise const& noise, RayNumber const& number, R range) {
  if (!(range < detail::no_hit<R>())) return detail::no_hit<R>();
  if (detail::has_range_noise(noise)) {
    Philox const words = detail::noise_words(noise, number, 1);
    range = detail::with_noise(noise, Spread<R>::of(words.word[0], words.word[1]), uniform_of<R>(words.word[2]), range);
  }
  return detail::in_steps(noise, range);
}

}  // namespace gsp
