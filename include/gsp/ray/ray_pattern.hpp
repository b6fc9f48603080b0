#pragma once
#include <cmath>
#include <gsp/core/check.hpp>
#include <gsp/model/description.hpp>
#include <numbers>
#include <string>
#include <vector>

/// Which rays a unit sends, in its own frame: x ahead, y left, z up. Host. `mount_rays` (ray/ray_mount.hpp) takes them to a body.
namespace gsp {

struct RayPattern {
  std::vector<Double3> direction;  // unit
  std::vector<Double3> origin{};   // [m]; empty: all begin at the unit's origin
};

/// A unit that turns: `columns` azimuths 2 pi c / columns from ahead to the left, and at each a ray of every elevation, in their order: ray
/// c * elevations + e. Elevations [rad] upward. Errors: std::invalid_argument for none, columns < 1, and what is not finite.
inline RayPattern rotating_pattern(std::vector<double> const& elevations, int columns) {
  expects(!elevations.empty() && columns > 0, "gsp::rotating_pattern: give at least one elevation and one column");
  RayPattern pattern;
  for (int c = 0; c < columns; ++c)
    for (double const up : elevations) {
      expects(std::isfinite(up), "gsp::rotating_pattern: an elevation is not finite");
      double const turn = 2 * std::numbers::pi * c / columns;
      pattern.direction.push_back({std::cos(up) * std::cos(turn), std::cos(up) * std::sin(turn), std::sin(up)});
    }
  return pattern;
}
/// Velodyne VLP-16: 16 rings from -15 to 15 degrees, in the order in which they fire.
inline RayPattern vlp16_pattern(int columns = 1800) {
  std::vector<double> elevations;
  for (int const degrees : {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15})
    elevations.push_back(degrees * std::numbers::pi / 180);
  return rotating_pattern(elevations, columns);
}
/// Velodyne HDL-64E: 64 rings from -24.8 to 2 degrees, here evenly; 1,719 columns at 10 turns and 1.1 million rays a second.
inline RayPattern hdl64e_pattern(int columns = 1719) {
  std::vector<double> elevations;
  for (int e = 0; e < 64; ++e) elevations.push_back((-24.8 + 26.8 * e / 63) * std::numbers::pi / 180);
  return rotating_pattern(elevations, columns);
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
      pattern.direction.push_back({std::cos(up) * std::cos(turn), std::cos(up) * std::sin(turn), std::sin(up)});
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
