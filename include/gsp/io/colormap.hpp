#pragma once
#include <array>
#include <gsp/io/bitmap.hpp>

namespace gsp::io {

/// Colour of t in 0..1 on a rainbow whose lightness rises to the middle and falls again, so that near and far are told apart in colour and
/// the middle has contrast: indigo, blue, cyan, green, yellow, orange, dark red. Cubic (Catmull-Rom) through nine colours; t is clamped,
/// NaN counts as 0.
inline std::array<float, 3> rainbow(float t) {
  static constexpr std::array<std::array<float, 3>, 9> stops{{{.20f, .09f, .26f},
                                                              {.26f, .32f, .80f},
                                                              {.20f, .60f, .98f},
                                                              {.11f, .83f, .78f},
                                                              {.40f, .97f, .45f},
                                                              {.77f, .94f, .21f},
                                                              {.98f, .69f, .20f},
                                                              {.89f, .33f, .06f},
                                                              {.48f, .03f, .02f}}};
  float const x = t > 0 ? std::min(t, 1.f) * 8 : 0.f;
  int const i = std::min(static_cast<int>(x), 7);
  float const f = x - static_cast<float>(i);
  std::array<float, 3> out{};
  for (std::size_t c = 0; c < 3; ++c) {
    float const a = stops[std::max(i - 1, 0)][c], b = stops[i][c], d = stops[i + 1][c], e = stops[std::min(i + 2, 8)][c];
    float const value = b + 0.5f * f * (d - a + f * (2 * a - 5 * b + 4 * d - e + f * (3 * (b - d) + e - a)));
    out[c] = std::clamp(value, 0.f, 1.f);
  }
  return out;
}

struct DepthColorOptions {
  float near = 0, far = 0;  // [m]; equal: the least and greatest depth of the picture
};

/// Depth (height, width) [m] to colour: near red, far blue; black where the depth is not finite or not positive (nothing there).
inline Bitmap8 depth_to_color(float const* depth, int width, int height, DepthColorOptions options = {}) {
  Bitmap8 out = make_bitmap<std::uint8_t>(width, height, 3);
  std::size_t const n = out.pixels.size() / 3;
  auto const there = [&](std::size_t i) { return std::isfinite(depth[i]) && depth[i] > 0; };
  float low = options.near, high = options.far;
  if (low == high) {
    low = INFINITY;
    high = 0;
    for (std::size_t i = 0; i < n; ++i)
      if (there(i)) {
        low = std::min(low, depth[i]);
        high = std::max(high, depth[i]);
      }
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (!there(i)) continue;
    auto const rgb = rainbow(high > low ? (high - depth[i]) / (high - low) : 1.f);
    for (std::size_t c = 0; c < 3; ++c) out.pixels[3 * i + c] = to_byte(rgb[c]);
  }
  return out;
}

}  // namespace gsp::io
