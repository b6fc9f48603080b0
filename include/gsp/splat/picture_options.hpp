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
};

namespace detail {
inline void expects_number(char const* where, char const* name, float x, float most, bool below = true) {
  if (x >= 0 && (below ? x < most : x <= most)) return;
  char text[80];
  std::snprintf(text, sizeof text, " is %g: give a number of 0 or more, %s %g", double(x), below ? "below" : "at most", double(most));
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
inline void check_options(DevelopOptions const& o, int images) {
  constexpr char const* where = "gsp::develop";
  expects_number(where, "exposure", o.exposure, 1e6f);
  expects_number(where, "contrast", o.contrast, 1, false);
  expects_number(where, "brightness", o.brightness, 1e6f);
  expects_number(where, "noise", o.noise, 1e6f);
  for (int k = 0; k < 3; ++k) expects_number(where, "background", o.background[k], 1e6f);
  check_chance(where, o, images);
}
inline void check_options(JitterCamerasOptions const& o, int images) {
  constexpr char const* where = "gsp::jitter_cameras";
  expects_number(where, "position", o.position, 1e6f);
  expects_number(where, "rotation", o.rotation, 3.14159274f, false);
  expects_number(where, "focal", o.focal, 1);
  expects_number(where, "principal", o.principal, 1e6f);
  check_chance(where, o, images);
}
}  // namespace detail

}  // namespace gsp
