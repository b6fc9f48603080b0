#pragma once
#include <gsp/core/region.hpp>
#include <gsp/math/philox.hpp>
#include <gsp/math/vec3.hpp>
#include <gsp/splat/frames.hpp>

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

namespace detail {
inline constexpr std::uint32_t picture_stream = 16;
/// 0 to 1 as the numbers of a picture: whole ones of 8 bits to the nearest of 255 steps.
template <class T>
KOKKOS_INLINE_FUNCTION T developed_as(float c) {
  if constexpr (std::is_same_v<T, std::uint8_t>)
    return static_cast<std::uint8_t>(fma(c, 255.f, 0.5f));
  else
    return static_cast<T>(c);
}

template <class Mem, class Out>
struct Develop {
  Frames<Mem> frames;
  Out out;
  Kokkos::View<float const****, Kokkos::LayoutRight, Mem> background;
  DevelopOptions options;

  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const x = int(i % frames.width), y = int(i / frames.width % frames.height), image = int(i / frames.width / frames.height);
    auto const words = [&](std::uint32_t pixel, std::uint32_t stream) {
      // 24 bits of the upper half of the step, and a stream that no noise of rays or sensors has
      return philox(options.seed, {{pixel, std::uint32_t(options.first_image + image), std::uint32_t(options.step),
                                    std::uint32_t(std::uint64_t(options.step) >> 32) << 8 | (picture_stream + stream)}});
    };
    // of the image: an exact 0 where nothing is drawn
    float gain = 1, contrast = 1, brightness = 0;
    if (options.exposure > 0 || options.contrast > 0 || options.brightness > 0) {
      Philox const drawn = words(0, 0);
      auto const within = [&](int k, float most) { return most * fma(2.f, uniform_of<float>(drawn.word[k]), -1.f); };
      gain = Kokkos::exp2(within(0, options.exposure));
      contrast = 1.f + within(1, options.contrast);
      brightness = within(2, options.brightness);
    }
    float noise[4] = {};
    if (options.noise > 0) {
      Philox const drawn = words(std::uint32_t(i % (std::int64_t(frames.width) * frames.height)), 1);
      for (int k = 0; k < 4; k += 2) {
        auto const spread = Spread<float>::of(drawn.word[k], drawn.word[k + 1]);
        float s, c;
        sincos(spread.angle, s, c);
        noise[k] = options.noise * spread.r * c;
        noise[k + 1] = options.noise * spread.r * s;
      }
    }
    float const through = frames.alpha.data() ? 1.f - frames.alpha(image, y, x) : 0.f;
    int const behind = background.extent(0) == 1 ? 0 : image;
    for (int k = 0; k < 3; ++k) {
      float const shows = background.data() ? background(behind, y, x, k) : options.background[k];
      float const light = gain * fma(through, shows, frames.rgb(image, y, x, k));
      float const c = fma(light - 0.5f, contrast, 0.5f + brightness + noise[k]);
      out(image, y, x, k) = developed_as<typename Out::value_type>(c > 0.f ? (c < 1.f ? c : 1.f) : 0.f);
    }
  }
};
}  // namespace detail

/// Pictures as a camera hands them out: rgb over a background, with what cameras differ by, as float, half or 8-bit numbers.
/// @param frames      in: rgb, and alpha where a background is to show
/// @param out         out: (C, H, W, 3) of float, Kokkos::Experimental::half_t or std::uint8_t; may be frames.rgb
/// @param background  (1 or C, H, W, 3) in place of options.background; empty: that
/// Neither allocates nor fences. Cost: reads and writes the pictures once, and about 150 operations a pixel for noise.
/// Errors: std::invalid_argument without rgb, for a background without alpha, for other sizes, for options that are not from 0 to 1e6, a
/// contrast over 1, a step that is negative or not below 2^56, and images whose numbers are not within 0 to 2^32 - 1.
template <ExecutionSpace Exec, class Mem, class Out>
void develop(Exec const& exec, Frames<Mem> const& frames, Out const& out, DevelopOptions const& options = {},
             std::type_identity_t<Kokkos::View<float const****, Kokkos::LayoutRight, Mem>> const& background = {}) {
  Region const region("gsp::splat::develop");
  static_assert(can_access<Exec, Frames<Mem>> && can_access<Exec, Out>,
                "gsp::develop: the pictures are not accessible from this execution space");
  expects(frames.rgb.data() != nullptr, "gsp::develop: the frames have no rgb: make_frames with it");
  bool const shows = background.data() || options.background[0] != 0 || options.background[1] != 0 || options.background[2] != 0;
  expects(!shows || frames.alpha.data(), "gsp::develop: a background shows where alpha leaves light: make_frames with alpha");
  auto const fits = [&](auto const& v, bool one) {
    return (int(v.extent(0)) == frames.images || (one && v.extent(0) == 1)) && int(v.extent(1)) == frames.height &&
           int(v.extent(2)) == frames.width && v.extent(3) == 3;
  };
  expects(fits(out, false), "gsp::develop: `out` must be (images, height, width, 3) as the frames are");
  expects(!background.data() || fits(background, true), "gsp::develop: the background must be (1 or images, height, width, 3)");
  using T = std::remove_const_t<typename Out::value_type>;
  static_assert(std::is_same_v<T, float> || std::is_same_v<T, Kokkos::Experimental::half_t> || std::is_same_v<T, std::uint8_t>,
                "gsp::develop: `out` holds float, Kokkos::Experimental::half_t or std::uint8_t");
  bool good = options.contrast <= 1 && options.step >= 0 && options.step >> 56 == 0;
  for (float const x : {options.exposure, options.contrast, options.brightness, options.noise}) good = good && x >= 0 && x < 1e6f;
  for (float const x : {options.background.x, options.background.y, options.background.z}) good = good && x >= 0 && x < 1e6f;
  expects(
      good,
      "gsp::develop: exposure, contrast (at most 1), brightness, noise and background must be from 0 to 1e6, the step from 0 to 2^56 - 1");
  expects(options.first_image >= 0 && options.first_image <= (std::int64_t(1) << 32) - frames.images,
          "gsp::develop: images are numbered from 0 to 2^32 - 1: first_image must not be negative, nor lead beyond");
  Kokkos::parallel_for("gsp::splat::develop",
                       lightweight(Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(
                           exec, 0, std::int64_t(frames.images) * frames.height * frames.width)),
                       detail::Develop<Mem, Out>{frames, out, background, options});
}

}  // namespace gsp
