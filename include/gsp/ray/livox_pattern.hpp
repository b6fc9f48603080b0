#pragma once
#include <array>
#include <cstdint>
#include <gsp/ray/ray_pattern.hpp>

/// Livox units, whose patterns do not repeat from scan to scan: windows of their sequences of rays. Mid-40 and Mid-70 are two wedge prisms
/// that turn against each other, exactly; Avia and Mid-360 are approximations. Tables of these and others: io/ray_table.hpp. Host.
namespace gsp {

namespace detail {
/// A direction behind a surface of this unit normal (n . d > 0), r the ratio of the refractive indices before and behind it: Snell's law,
///   d' = r d + (sqrt(1 - r^2 (1 - c^2)) - r c) n,  c = d . n
inline Double3 refract(Double3 const& d, Double3 const& n, double r) {
  double const c = d[0] * n[0] + d[1] * n[1] + d[2] * n[2], along = std::sqrt(1 - r * r * (1 - c * c)) - r * c;
  return {r * d[0] + along * n[0], r * d[1] + along * n[1], r * d[2] + along * n[2]};
}
/// 2 pi of what is left of steps * sample turns of `whole` steps each, without rounding: after hours as in the first second.
inline double phase_of(std::int64_t sample, std::int64_t steps, std::int64_t whole) {
  std::int64_t const rest = (sample % whole) * (steps % whole) % whole;
  return 2 * std::numbers::pi * double(rest) / double(whole);
}
/// Two wedges of 18 degrees and this index; the first turns at 7,294 rpm, the second at -4,664. Sample i leaves at (i + 1) 10 us: rpm (i +
/// 1) of 6 million steps of a turn. The flat surface of each wedge is outside (Mid-40) or inside, towards the other (Mid-70).
inline Double3 risley_direction(std::int64_t sample, double index, bool flat_outside) {
  auto const slanted = [](double tilt, double phase) {
    return Double3{std::cos(tilt), std::sin(tilt) * std::cos(phase), std::sin(tilt) * std::sin(phase)};
  };
  Double3 const flat{1, 0, 0}, first = slanted(-18 * radians, phase_of(sample + 1, 7294, 6000000)),
                               second = slanted(18 * radians, phase_of(sample + 1, -4664, 6000000));
  Double3 d{1, 0, 0};
  d = refract(d, flat_outside ? flat : first, 1 / index);
  d = refract(d, flat_outside ? first : flat, index);
  d = refract(d, flat_outside ? second : flat, 1 / index);
  return refract(d, flat_outside ? flat : second, index);
}
/// `count` moments from `first` on, `spacing` [s] apart, at each the rays that rays_at gives.
template <class F>
RayPattern sequence_pattern(char const* where, std::int64_t first, int count, double spacing, F const& rays_at) {
  expects(first >= 0 && first <= std::int64_t(1) << 40 && count > 0, where, "first must lie in 0 to 2^40, and count must be positive");
  expects(std::size_t(count) <= std::size_t(most_rays) / rays_at(first).size(), where, "more than 16,777,216 rays: ask for fewer");
  RayPattern pattern;
  for (int i = 0; i < count; ++i)
    for (Double3 const& d : rays_at(first + i)) {
      pattern.direction.push_back(d);
      pattern.time.push_back(i * spacing);
    }
  pattern.period = count * spacing;
  return pattern;
}
}  // namespace detail

/// Livox Mid-40: rays first ... first + count - 1 of its sequence, 10 us apart, in a cone of 38.4 degrees about ahead. The sequence repeats
/// after 30 s (3 million rays); 400,000 are the 4 s of the maker's table. The form was fitted to that table and is within 1.1e-5 degrees of
/// all of it. Errors: std::invalid_argument for first not in 0 to 2^40, count < 1 or more than most_rays.
inline RayPattern mid40_pattern(std::int64_t first = 0, int count = 400000) {
  auto const at = [](std::int64_t i) { return std::array<Double3, 1>{detail::risley_direction(i, 1.5089, true)}; };
  return detail::sequence_pattern("gsp::mid40_pattern", first, count, 1e-5, at);
}
/// Livox Mid-70: as mid40_pattern, in a cone of 70.4 degrees; within 1.4e-5 degrees of the maker's table.
inline RayPattern mid70_pattern(std::int64_t first = 0, int count = 400000) {
  auto const at = [](std::int64_t i) { return std::array<Double3, 1>{detail::risley_direction(i, 1.8144, false)}; };
  return detail::sequence_pattern("gsp::mid70_pattern", first, count, 1e-5, at);
}
/// Livox Avia, approximately (the form of MARSIM, Kong et al., RA-L 2023): `count` shots from `first` on, 25 us apart, each of six rays
/// above each other at one moment, over about 70 by 77 degrees:
///   azimuth = 0.24 * 70.4 deg (cos a + cos b), elevation = 0.215 * 77.2 deg (sin a + sin b) + 1.4 deg {-2, -1, 0, 1, 2, 3}
/// a and b turn at 7,294 and -4,664 rpm. Ray 6 j + row. Errors: as mid40_pattern.
inline RayPattern avia_pattern(std::int64_t first = 0, int count = 40000) {
  auto const at = [](std::int64_t i) {
    double const a = detail::phase_of(i, 7294, 2400000), b = detail::phase_of(i, -4664, 2400000);
    double const azimuth = 0.24 * 70.4 * (std::cos(a) + std::cos(b)), elevation = 0.215 * 77.2 * (std::sin(a) + std::sin(b));
    std::array<Double3, 6> rays;
    for (int row = 0; row < 6; ++row)
      rays[std::size_t(row)] = ray_direction(azimuth * detail::radians, (elevation + 1.4 * (row - 2)) * detail::radians);
    return rays;
  };
  return detail::sequence_pattern("gsp::avia_pattern", first, count, 2.5e-5, at);
}
/// Livox Mid-360, approximately (the form of MARSIM): rays first ... first + count - 1, 5 us apart, all round, elevations -7 to 52 degrees:
///   azimuth = 62050.63 deg/s t - 3.11 deg cos(10^5 pi t) sin(400 pi t)
///   elevation = 25.5 deg cos(20 pi t) + 4 deg cos(2 pi t / 6 ms) cos(10^4 pi t) + 22.5 deg
/// 20,000 are a frame of 0.1 s; frames differ by their azimuths alone. Errors: as mid40_pattern.
inline RayPattern mid360_pattern(std::int64_t first = 0, int count = 200000) {
  auto const at = [](std::int64_t i) {
    using detail::phase_of;
    // 62050.63 deg/s * 5 us = 0.31025315 deg, in steps of 1e-8 deg
    double const turn = phase_of(i, 31025315, 36000000000), wave = 3.11 * std::cos(phase_of(i, 1, 4)) * std::sin(phase_of(i, 1, 1000));
    double const up = 25.5 * std::cos(phase_of(i, 1, 20000)) + 4 * std::cos(phase_of(i, 1, 1200)) * std::cos(phase_of(i, 1, 40)) + 22.5;
    return std::array<Double3, 1>{ray_direction(turn - wave * detail::radians, up * detail::radians)};
  };
  return detail::sequence_pattern("gsp::mid360_pattern", first, count, 5e-6, at);
}

}  // namespace gsp
