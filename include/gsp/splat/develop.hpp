#pragma once
#include <gsp/core/region.hpp>
#include <gsp/splat/detail/picture_chance.hpp>
#include <gsp/splat/frames.hpp>
#include <gsp/splat/picture_options.hpp>

namespace gsp {

namespace detail {
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
  PictureChance<Mem> chance, light;

  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const x = int(i % frames.width), y = int(i / frames.width % frames.height), image = int(i / frames.width / frames.height);
    // of the image: an exact 0 where nothing is drawn
    float gain = 1, contrast = 1, brightness = 0;
    if (options.exposure > 0 || options.contrast > 0 || options.brightness > 0) {
      Philox const drawn = light.words(image, 0, PictureStream::light);
      auto const within = [&](int k, float most) { return most * fma(2.f, uniform_of<float>(drawn.word[k]), -1.f); };
      gain = Kokkos::exp2(within(0, options.exposure));
      contrast = 1.f + within(1, options.contrast);
      brightness = within(2, options.brightness);
    }
    float noise[4] = {};
    if (options.noise > 0) {
      Philox const drawn = chance.words(image, std::uint32_t(i % (std::int64_t(frames.width) * frames.height)), PictureStream::noise);
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

/// What `develop` refuses whatever the frames hold: a caller that draws them first asks before.
template <class Background>
void check_develop(char const* where, DevelopOptions const& options, Background const& background, int images, int height, int width) {
  check_options(where, options, images);
  auto const is = [&](int k, int n) { return int(background.extent(k)) == n; };
  if (!background.data() || ((is(0, 1) || is(0, images)) && is(1, height) && is(2, width) && is(3, 3))) return;
  std::string given, size = ", " + std::to_string(height) + ", " + std::to_string(width) + ", 3)";
  for (int k = 0; k < 4; ++k) given += (k > 0 ? ", " : "(") + std::to_string(background.extent(k));
  throw std::invalid_argument(std::string(where) + ": the background is " + given + ") and must be (1 or " + std::to_string(images) + size);
}
}  // namespace detail

/// Pictures as a camera hands them out: rgb over a background, with what cameras differ by, as float, half or 8-bit numbers.
/// @param frames      in: rgb, and alpha where a background is to show
/// @param out         out: (C, H, W, 3) of float, Kokkos::Experimental::half_t or std::uint8_t; may be frames.rgb
/// @param background  (1 or C, H, W, 3) in place of options.background; empty: that
/// @param chance      (C, 3) seed, step and number that each image's noise is drawn of, in place of the options' (steps below 2^56, numbers
///                    below 2^32, of which upper bits are dropped): of the world that it shows, whatever batch that is in; empty: those
/// @param light       the same of exposure, contrast and brightness: of an episode, say, through which light stays; empty: chance
/// Neither allocates nor fences. Cost: reads and writes the pictures once, and about 150 operations a pixel for noise.
/// Errors: std::invalid_argument without rgb, for a background without alpha, for other sizes, for options that are not from 0 to 1e6, a
/// contrast over 1, a step that is negative or not below 2^56, and images whose numbers are not within 0 to 2^32 - 1.
template <ExecutionSpace Exec, class Mem, class Out>
void develop(Exec const& exec, Frames<Mem> const& frames, Out const& out, DevelopOptions const& options = {},
             std::type_identity_t<Kokkos::View<float const****, Kokkos::LayoutRight, Mem>> const& background = {},
             std::type_identity_t<Kokkos::View<std::int64_t const* [3], Kokkos::LayoutRight, Mem>> const& chance = {},
             std::type_identity_t<Kokkos::View<std::int64_t const* [3], Kokkos::LayoutRight, Mem>> const& light = {}) {
  Region const region("gsp::splat::develop");
  static_assert(can_access<Exec, Frames<Mem>> && can_access<Exec, Out>,
                "gsp::develop: the pictures are not accessible from this execution space");
  expects(frames.rgb.data() != nullptr, "gsp::develop: the frames have no rgb: make_frames with it");
  bool const shows = background.data() || options.background[0] != 0 || options.background[1] != 0 || options.background[2] != 0;
  expects(!shows || frames.alpha.data(), "gsp::develop: a background shows where alpha leaves light: make_frames with alpha");
  expects(int(out.extent(0)) == frames.images && int(out.extent(1)) == frames.height && int(out.extent(2)) == frames.width &&
              out.extent(3) == 3,
          "gsp::develop: `out` must be (images, height, width, 3) as the frames are");
  detail::check_develop("gsp::develop", options, background, frames.images, frames.height, frames.width);
  if (chance.data()) detail::expects_rows("gsp::develop", "chance", chance.extent(0), frames.images);
  if (light.data()) detail::expects_rows("gsp::develop", "light", light.extent(0), frames.images);
  using Chance = detail::PictureChance<Mem>;
  using T = std::remove_const_t<typename Out::value_type>;
  static_assert(std::is_same_v<T, float> || std::is_same_v<T, Kokkos::Experimental::half_t> || std::is_same_v<T, std::uint8_t>,
                "gsp::develop: `out` holds float, Kokkos::Experimental::half_t or std::uint8_t");
  Kokkos::parallel_for("gsp::splat::develop",
                       lightweight(Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(
                           exec, 0, std::int64_t(frames.images) * frames.height * frames.width)),
                       detail::Develop<Mem, Out>{frames, out, background, options, Chance::of(options, chance),
                                                 Chance::of(options, light.data() ? light : chance)});
}

}  // namespace gsp
