#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <gsp/io/detail/shared_bounds.hpp>
#include <gsp/io/detail/splat_bounds.hpp>
#include <gsp/io/detail/splat_format.hpp>
#include <gsp/io/spz.hpp>
#include <limits>
#include <string>
#include <vector>

/// What of a set a format does not hold, one sentence each, where more is lost than by rounding: gsp/io/splats.hpp.
namespace gsp::io::detail {

inline std::string in_digits(double x, int digits) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, x);
  return text;
}

/// Numbers that the format has no place for.
template <class Note>
void note_clipped(SplatSet const& set, SplatFormat format, SpzOptions const& options, Note const& note) {
  using enum SplatFormat;
  constexpr double infinity = std::numeric_limits<double>::infinity();
  std::size_t const terms = set.sh_terms();
  auto const say = [&](auto const& is_beyond, std::string const& what) {
    std::size_t n = 0;
    for (std::size_t i = 0; i < set.size(); ++i) n += is_beyond(i);
    if (n > 0) note(std::to_string(n) + (n == 1 ? " Gaussian has " : " Gaussians have ") + what + ", all that the format holds; clipped");
  };
  double const colour = format == splat ? splat_most_colour : format == spz ? spz_most_colour : infinity;
  say(
      [&](std::size_t i) {
        float const* const c = &set.sh[3 * terms * i];
        return std::any_of(c, c + 3, [&](float x) { return std::abs(double(x)) > colour * (1 + 1. / 255); });
      },
      "colours (f_dc) beyond +-" + in_digits(colour, 4));
  double const sh = format == compressed_ply ? compressed_ply_sh : format == spz ? 1 : infinity;
  say(
      [&](std::size_t i) {
        bool beyond = false;
        for (std::size_t k = 3; k < 3 * terms; ++k)
          beyond |= std::abs(double(set.sh[3 * terms * i + k])) >
                    sh + (format == compressed_ply ? 1. / 64 : std::ldexp(1., -(k < 12 ? options.sh1_bits : options.sh_bits)));
        return beyond;
      },
      "SH terms above degree 0 beyond +-" + in_digits(sh, 4));
  double const scale = format == ply                               ? ply_least_scale
                       : format == compressed_ply || format == sog ? std::exp(packed_least_log_scale)
                       : format == spz                             ? std::exp(spz_least_log_scale)
                                                                   : 0,
               least = scale * (format == spz ? std::exp(-1. / 32) : 1 - 1e-5);
  say([&](std::size_t i) { return *std::min_element(&set.scales[3 * i], &set.scales[3 * i] + 3) < least; },
      "scales below " + in_digits(scale, 3));
}

/// Places and colours that go further than they may, of a set in the order of its file: places by the Gaussian's size, colours by a step of
/// 8 bits from black to white.
template <class Note>
void note_coarse(SplatSet const& set, SplatFormat format, Note const& note) {
  std::size_t count = 0;
  double worst = 0;
  auto const take = [&](double off, double most) {
    if (!(off > most)) return;
    ++count;
    worst = std::max(worst, off);
  };
  auto const say = [&](std::string const& what, std::string const& than, std::string const& why) {
    if (count > 0)
      note(what + " of " + std::to_string(count) + (count == 1 ? " Gaussian" : " Gaussians") + " are off by more than " + than +
           ", up to " + in_digits(worst, 3) + ": " + why);
    count = 0;
    worst = 0;
  };
  /// back(i, k): where a reader finds the coordinate k of Gaussian i
  auto const note_places = [&](auto const& back, std::string const& why) {
    for (std::size_t i = 0; i < set.size(); ++i) {
      double square = 0;
      for (std::size_t k = 0; k < 3; ++k) square += std::pow(double(static_cast<float>(back(i, k))) - set.positions[3 * i + k], 2);
      take(std::sqrt(square), *std::max_element(&set.scales[3 * i], &set.scales[3 * i] + 3));
    }
    say("places", count == 1 ? "its size" : "their size", why);
  };
  std::string const far = "; write another format, or leave out those that are far off";
  if (format == SplatFormat::spz) {
    int const bits = spz_fraction_bits(set);
    note_places(
        [&](std::size_t i, std::size_t k) { return std::ldexp(std::round(std::ldexp(double(set.positions[3 * i + k]), bits)), -bits); },
        bits < spz_most_fraction_bits ? "24 bits reach as far as the farthest" + far
                                      : "a step is 1/4096 of a unit; scale the set up, or write another format");
  } else if (format == SplatFormat::compressed_ply) {
    std::string const why = "256 neighbours share bounds" + far + ", if any are";
    std::vector<SharedBounds> bounds;  // of each chunk and number
    for (std::size_t c = 0; 256 * c < set.size(); ++c)
      for (std::size_t k = 0; k < 9; ++k) bounds.push_back(k / 3 == 1 ? SharedBounds{} : compressed_ply_bounds(set, c, k));  // no scales
    auto const back = [&](std::size_t i, std::size_t k) {
      SharedBounds const& b = bounds[i / 256 * 9 + k];
      return b.unpack(b.pack(compressed_ply_value(set, i, k)));
    };
    note_places(back, why);
    for (std::size_t i = 0; i < set.size(); ++i) {
      double off = 0;
      for (std::size_t k = 6; k < 9; ++k) off = std::max(off, std::abs(back(i, k) - compressed_ply_value(set, i, k)));
      take(off, 1. / 255);
    }
    say("colours", "1/255", why);
  } else if (format == SplatFormat::sog) {
    std::array const bounds{sog_bounds(set, 0), sog_bounds(set, 1), sog_bounds(set, 2)};
    note_places([&](std::size_t i, std::size_t k) { return symexp(bounds[k].unpack(bounds[k].pack(symlog(set.positions[3 * i + k])))); },
                "16 bits reach as far as the farthest" + far + ", if any are");
  }
}

}  // namespace gsp::io::detail
