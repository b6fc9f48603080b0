#pragma once
#include <cmath>
#include <gsp/core/check.hpp>
#include <gsp/model/description.hpp>
#include <numbers>
#include <string>
#include <vector>

/// Which rays a unit sends, in its own frame: x ahead, y left, z up, and when. Host. `mount_rays` (ray/ray_mount.hpp) takes them to a body
/// all at once, `scan_rays` (ray/ray_scan.hpp) as they leave.
namespace gsp {

struct RayPattern {
  std::vector<Double3> direction;  // of any length > 0: make_ray_mount makes them unit
  std::vector<Double3> origin{};   // [m]; empty: all begin at the unit's origin
  std::vector<double> time{};      // [s] when each leaves, from the start of a scan, rising; empty: all at its start
  double period = 0;               // [s] of a scan, after which the next begins; 0: all leave whenever they are asked for
};
inline constexpr int most_rays = 1 << 24;  // of a pattern

/// The unit vector of an azimuth from ahead to the left and an elevation upward [rad].
inline Double3 ray_direction(double azimuth, double elevation) {
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), std::sin(elevation)};
}

namespace detail {
inline constexpr double radians = std::numbers::pi / 180;
inline double evenly(double first, double last, int i, int count) { return count == 1 ? first : first + (last - first) * i / (count - 1); }
}  // namespace detail

struct RotatingOptions {
  std::vector<double> azimuths{};  // [rad] by which the ray of each elevation is ahead of its column, in the sense of turning; empty: 0
  double rate = 10;                // [turns/s]: column c leaves at c / columns of a turn; 0: all at once, whenever they are asked for
  bool clockwise = false;          // seen from above; else from ahead to the left
};
/// A unit that turns: `columns` azimuths 2 pi c / columns from ahead, and at each a ray of every elevation, in their order: ray c *
/// elevations + e. Elevations [rad] upward. Errors: std::invalid_argument for none, columns < 1, what is not finite, elevations beyond the
/// vertical, another number of azimuths than of elevations, a negative rate, more than most_rays.
inline RayPattern rotating_pattern(std::vector<double> const& elevations, int columns, RotatingOptions const& options = {}) {
  expects(!elevations.empty() && columns > 0, "gsp::rotating_pattern: give at least one elevation and one column");
  expects(elevations.size() <= std::size_t(most_rays / columns), "gsp::rotating_pattern: more than 16,777,216 rays: choose fewer columns");
  expects(options.azimuths.empty() || options.azimuths.size() == elevations.size(),
          "gsp::rotating_pattern: give an azimuth for each elevation, or none");
  expects(std::isfinite(options.rate) && options.rate >= 0, "gsp::rotating_pattern: the rate must be finite and not negative");
  for (double const up : elevations)
    expects(std::abs(up) <= 0.5 * std::numbers::pi + 1e-9,
            "gsp::rotating_pattern: an elevation is not finite, or beyond the vertical: they are in radians");
  for (double const by : options.azimuths)
    expects(std::abs(by) <= std::numbers::pi + 1e-9,
            "gsp::rotating_pattern: an azimuth is not finite, or beyond half a turn: they are in radians");
  RayPattern pattern;
  for (int c = 0; c < columns; ++c)
    for (std::size_t e = 0; e < elevations.size(); ++e) {
      double const turn = 2 * std::numbers::pi * c / columns + (options.azimuths.empty() ? 0 : options.azimuths[e]);
      pattern.direction.push_back(ray_direction(options.clockwise ? -turn : turn, elevations[e]));
      if (options.rate > 0) pattern.time.push_back(c / (columns * options.rate));
    }
  pattern.period = options.rate > 0 ? 1 / options.rate : 0;
  return pattern;
}
/// Velodyne VLP-16: 16 rings from -15 to 15 degrees, in the order in which they fire; clockwise.
inline RayPattern vlp16_pattern(int columns = 1800, double rate = 10) {
  std::vector<double> elevations;
  for (int const degrees : {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15}) elevations.push_back(degrees * detail::radians);
  return rotating_pattern(elevations, columns, {.rate = rate, .clockwise = true});
}
/// Velodyne HDL-64E: 64 rings from -24.8 to 2 degrees, here evenly; 1,719 columns at 10 turns and 1.1 million rays a second; clockwise.
inline RayPattern hdl64e_pattern(int columns = 1719, double rate = 10) {
  std::vector<double> elevations;
  for (int e = 0; e < 64; ++e) elevations.push_back((-24.8 + 26.8 * e / 63) * detail::radians);
  return rotating_pattern(elevations, columns, {.rate = rate, .clockwise = true});
}
/// Velodyne VLP-32C (Ultra Puck), turning clockwise: 32 rings from -25 to 15 degrees, close to each other about the horizon, each 1.4
/// or 4.2 degrees ahead of its column or behind it; the unit's own order (its manual's table of lasers).
inline RayPattern vlp32c_pattern(int columns = 1800, double rate = 10) {
  double const lasers[][2] = {
      {-25, 1.4},    {-1, -4.2},    {-1.667, 1.4}, {-15.639, -1.4}, {-11.31, 1.4}, {0, -1.4},     {-0.667, 4.2}, {-8.843, -1.4},
      {-7.254, 1.4}, {0.333, -4.2}, {-0.333, 1.4}, {-6.148, -1.4},  {-5.333, 4.2}, {1.333, -1.4}, {0.667, 4.2},  {-4, -1.4},
      {-4.667, 1.4}, {1.667, -4.2}, {1, 1.4},      {-3.667, -4.2},  {-3.333, 4.2}, {3.333, -1.4}, {2.333, 1.4},  {-2.667, -1.4},
      {-3, 1.4},     {7, -1.4},     {4.667, 1.4},  {-2.333, -4.2},  {-2, 4.2},     {15, -1.4},    {10.333, 1.4}, {-1.333, -1.4}};
  std::vector<double> elevations, azimuths;
  for (auto const& laser : lasers) {
    elevations.push_back(laser[0] * detail::radians);
    azimuths.push_back(laser[1] * detail::radians);
  }
  return rotating_pattern(elevations, columns, {.azimuths = azimuths, .rate = rate, .clockwise = true});
}
/// Hesai XT32, nominal: 32 rings from 15 to -16 degrees, a degree apart; clockwise.
inline RayPattern xt32_pattern(int columns = 2000, double rate = 10) {
  std::vector<double> elevations;
  for (int e = 0; e < 32; ++e) elevations.push_back((15 - e) * detail::radians);
  return rotating_pattern(elevations, columns, {.rate = rate, .clockwise = true});
}
/// Ouster OS0, OS1, OS2, nominal: `rows` rings (32, 64, 128) from the upper end of `vertical` [rad] down, evenly (90, 45 and 22.5 degrees:
/// OS0, OS1, OS2), and 512, 1,024 or 2,048 columns; clockwise. Errors: as rotating_pattern, and rows < 1, angles that are not in 0 to pi.
inline RayPattern ouster_pattern(int rows, int columns, double vertical, double rate = 10) {
  expects(rows > 0, "gsp::ouster_pattern: rows must be positive");
  expects(vertical >= 0 && vertical <= std::numbers::pi, "gsp::ouster_pattern: vertical must lie in 0 to pi: it is in radians");
  std::vector<double> elevations;
  for (int e = 0; e < rows; ++e) elevations.push_back(detail::evenly(0.5 * vertical, -0.5 * vertical, e, rows));
  return rotating_pattern(elevations, columns, {.rate = rate, .clockwise = true});
}
/// An Ouster unit as it was measured: `beam_altitude_angles` and `beam_azimuth_angles` of its metadata, in degrees, as they stand there.
/// That beams begin 1 to 3 cm off the unit's axis is left out. Errors: as rotating_pattern.
inline RayPattern ouster_beams_pattern(std::vector<double> const& altitudes, std::vector<double> const& azimuths, int columns,
                                       double rate = 10) {
  expects(altitudes.size() == azimuths.size(), "gsp::ouster_beams_pattern: there are " + std::to_string(altitudes.size()) +
                                                   " altitudes and " + std::to_string(azimuths.size()) +
                                                   " azimuths: give one of each a beam");
  auto const in_radians = [](std::vector<double> angles) {
    for (double& angle : angles) angle *= detail::radians;
    return angles;
  };
  return rotating_pattern(in_radians(altitudes), columns, {.azimuths = in_radians(azimuths), .rate = rate, .clockwise = true});
}
/// Rays all round, all at once: `rows` elevations from `high` down to `low` [rad], evenly, row after row, in each `columns` azimuths 2 pi c
/// / columns from ahead to the left. Errors: std::invalid_argument for columns or rows < 1, more than most_rays, and angles that do not
/// rise from low to high within -pi/2 to pi/2.
inline RayPattern spherical_pattern(int columns, int rows, double low = -0.5 * std::numbers::pi, double high = 0.5 * std::numbers::pi) {
  expects(columns > 0 && rows > 0, "gsp::spherical_pattern: columns and rows must be positive");
  expects(rows <= most_rays / columns, "gsp::spherical_pattern: more than 16,777,216 rays: choose fewer");
  constexpr double up = 0.5 * std::numbers::pi + 1e-9;
  expects(low >= -up && low <= high && high <= up,
          "gsp::spherical_pattern: low and high must rise within -pi/2 to pi/2: they are in radians");
  RayPattern pattern;
  for (int row = 0; row < rows; ++row)
    for (int c = 0; c < columns; ++c)
      pattern.direction.push_back(ray_direction(2 * std::numbers::pi * c / columns, detail::evenly(high, low, row, rows)));
  return pattern;
}
/// A solid-state unit or a depth camera: width x height rays over these angles [rad], evenly in angle, row after row from the upper left:
/// the first and the last of a row are `horizontal` apart. Errors: std::invalid_argument for width or height < 1, or angles that are not in
/// 0 to 2 pi (horizontal) and 0 to pi (vertical).
inline RayPattern grid_pattern(int width, int height, double horizontal, double vertical) {
  expects(width > 0 && height > 0, "gsp::grid_pattern: width and height must be positive");
  expects(horizontal >= 0 && horizontal <= 2 * std::numbers::pi && vertical >= 0 && vertical <= std::numbers::pi,
          "gsp::grid_pattern: the angles must lie in 0 to 2 pi and 0 to pi: they are in radians");
  RayPattern pattern;
  auto const at = [](int i, int n, double angle) { return n == 1 ? 0 : angle * (0.5 - double(i) / (n - 1)); };
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      double const turn = at(column, width, horizontal), up = at(row, height, vertical);
      pattern.direction.push_back(ray_direction(turn, up));
    }
  return pattern;
}
/// A height scan: rays straight down from a grid of points `spacing` apart over length (x) times width (y) [m], centred, x fastest. 1.6 by
/// 1 m at 0.1 m are 187 rays. Mount it above all that it may see, with RayAlignment::yaw. Errors: std::invalid_argument for a spacing that
/// is not positive, negative sizes, and more than a million rays.
inline RayPattern height_scan_pattern(double length, double width, double spacing) {
  expects(spacing > 0 && length >= 0 && width >= 0, "gsp::height_scan_pattern: the spacing must be positive, and no size negative");
  double const most = (length / spacing + 1) * (width / spacing + 1);
  expects(most <= 1e6, "gsp::height_scan_pattern: more than a million rays: choose a larger spacing");
  int const nx = int(std::floor(length / spacing + 1e-9)) + 1, ny = int(std::floor(width / spacing + 1e-9)) + 1;
  RayPattern pattern;
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i) {
      pattern.direction.push_back({0, 0, -1});
      pattern.origin.push_back({spacing * (i - 0.5 * (nx - 1)), spacing * (j - 0.5 * (ny - 1)), 0});
    }
  return pattern;
}

}  // namespace gsp
