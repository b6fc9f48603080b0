#pragma once
#include <cstdint>
#include <cstdio>
#include <gsp/core/check.hpp>
#include <gsp/math/vec3.hpp>

/// Options of develop.hpp and jitter_cameras.hpp, and what they refuse: without Kokkos, for gsp::runtime has them too.
namespace gsp {

/// What becomes of a picture's light c >= 0 (0 to 1 is what a screen shows), number by number:
///   c += (1 - alpha) background;   c *= 2^exposure;   c = (c - 1/2)(1 + contrast) + 1/2 + brightness + noise;   c = min(max(c, 0), 1)
/// Each image draws an exposure, a contrast and a brightness of its own, uniformly from -x to x of the numbers here, and each number a
/// noise: of the seed, the step and the image's number (gsp/math/philox.hpp), so the same comes in any batch (first_image) and on any
/// backend to rounding.
struct DevelopOptions {
  float exposure = 0;               // in powers of two
  float contrast = 0;               // a share, at most 1
  float brightness = 0;             // added
  float noise = 0;                  // deviation of normal noise
  Vec3<float> background{0, 0, 0};  // shows where light comes through
  std::uint64_t seed = 0;
  std::int64_t step = 0;         // 0 to 2^56 - 1
  std::int64_t first_image = 0;  // number of the batch's first image among all of a larger one, 0 to 2^32 - images

  /// Whether nothing is asked for.
  bool is_default() const {
    return exposure == 0 && contrast == 0 && brightness == 0 && noise == 0 && background.x == 0 && background.y == 0 && background.z == 0 &&
           seed == 0 && step == 0 && first_image == 0;
  }
};

/// How far cameras differ from what they are said to be: numbers, each drawn uniformly from -x to x, of an image.
struct JitterCamerasOptions {
  float position = 0;   // along each of the camera's axes [m]
  float rotation = 0;   // of a rotation vector, along each of its axes [rad]
  float focal = 0;      // a share of fx and fy, of both the same
  float principal = 0;  // of cx and of cy [pixel]
  std::uint64_t seed = 0;
  std::int64_t step = 0;         // 0 to 2^56 - 1: of an episode where cameras keep what they have, or of a picture where they shake
  std::int64_t first_image = 0;  // number of the first camera among all of a larger batch, 0 to 2^32 - images

  /// Whether any camera becomes another.
  bool moves_cameras() const { return position != 0 || rotation != 0 || focal != 0 || principal != 0; }
};

namespace detail {
enum class End { below, at };  // whether the end of a range belongs to it
inline void expects_number(char const* where, char const* name, float x, End end, float most) {
  if (x >= 0 && (end == End::below ? x < most : x <= most)) return;
  char text[80];
  std::snprintf(text, sizeof text, " is %g: give a number of 0 or more, %s %g", double(x), end == End::below ? "below" : "at most",
                double(most));
  throw std::invalid_argument(std::string(where) + ": " + name + text);
}
/// What chance is drawn of.
template <class Options>
void check_chance(char const* where, Options const& o, int images) {
  auto const check = [&](char const* name, std::int64_t x, std::int64_t most) {
    if (x < 0 || x > most)
      throw std::invalid_argument(std::string(where) + ": " + name + " is " + std::to_string(x) + ": give a whole number from 0 to " +
                                  std::to_string(most));
  };
  check("step", o.step, (std::int64_t(1) << 56) - 1);
  check("first_image", o.first_image, (std::int64_t(1) << 32) - images);
}
/// For a caller, whom `where` names.
inline void check_options(char const* where, DevelopOptions const& o, int images) {
  expects_number(where, "exposure", o.exposure, End::below, 1e6f);
  expects_number(where, "contrast", o.contrast, End::at, 1);
  expects_number(where, "brightness", o.brightness, End::below, 1e6f);
  expects_number(where, "noise", o.noise, End::below, 1e6f);
  for (int k = 0; k < 3; ++k) expects_number(where, "background", o.background[k], End::below, 1e6f);
  check_chance(where, o, images);
}
inline void check_options(char const* where, JitterCamerasOptions const& o, int images) {
  expects_number(where, "position", o.position, End::below, 1e6f);
  expects_number(where, "rotation", o.rotation, End::at, 3.14159274f);
  expects_number(where, "focal", o.focal, End::below, 1);
  expects_number(where, "principal", o.principal, End::below, 1e6f);
  check_chance(where, o, images);
}
}  // namespace detail

}  // namespace gsp
