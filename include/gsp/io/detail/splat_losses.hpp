#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <gsp/io/detail/splat_bounds.hpp>
#include <gsp/io/detail/splat_format.hpp>
#include <gsp/io/spz.hpp>
#include <limits>
#include <string>

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

/// How far a number goes that becomes the nearest low + k step.
inline double moved(double x, double low, double step) {
  double const t = step > 0 ? (x - low) / step : 0;
  return std::abs(t - std::round(t)) * step;
}
/// use(i, how far each of its three numbers goes) of n Gaussians of a compressed PLY, in their order: 256 neighbours share the bounds of
/// what number(i, k) says, each cut into so many steps.
template <class Number, class Use>
void for_neighbours(std::size_t n, std::array<int, 3> const& steps, Number const& number, Use const& use) {
  for (std::size_t first = 0; first < n; first += 256) {
    std::size_t const end = std::min(n, first + 256);
    std::array<double, 3> low{}, step{};
    for (std::size_t k = 0; k < 3; ++k) {
      double high = low[k] = number(first, k);
      for (std::size_t i = first; i < end; ++i) {
        low[k] = std::min(low[k], double(number(i, k)));
        high = std::max(high, double(number(i, k)));
      }
      step[k] = (high - low[k]) / steps[k];
    }
    for (std::size_t i = first; i < end; ++i)
      use(i, std::array{moved(number(i, 0), low[0], step[0]), moved(number(i, 1), low[1], step[1]), moved(number(i, 2), low[2], step[2])});
  }
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
  auto const place = [&](std::size_t i, std::size_t k) { return set.positions[3 * i + k]; };
  auto const take_place = [&](std::size_t i, std::array<double, 3> const& off) {
    take(std::sqrt(off[0] * off[0] + off[1] * off[1] + off[2] * off[2]), *std::max_element(&set.scales[3 * i], &set.scales[3 * i] + 3));
  };
  auto const say = [&](std::string const& what, std::string const& than, std::string const& why) {
    if (count > 0)
      note(what + std::to_string(count) + (count == 1 ? " Gaussian" : " Gaussians") + " are off by more than " + than + ", up to " +
           in_digits(worst, 3) + ": " + why + "; write another format, or leave out those that are far off");
    count = 0;
    worst = 0;
  };
  auto const size = [&] { return std::string(count == 1 ? "its size" : "their size"); };
  if (format == SplatFormat::spz) {
    double const step = std::ldexp(1., -spz_fraction_bits(set));
    for (std::size_t i = 0; i < set.size(); ++i)
      take_place(i, {moved(place(i, 0), 0, step), moved(place(i, 1), 0, step), moved(place(i, 2), 0, step)});
    say("places of ", size(), "24 bits reach as far as the farthest");
  } else if (format == SplatFormat::compressed_ply) {
    constexpr char const* why = "256 neighbours share bounds";
    for_neighbours(set.size(), {2047, 1023, 2047}, place, take_place);
    say("places of ", size(), why);
    for_neighbours(
        set.size(), {255, 255, 255}, [&](std::size_t i, std::size_t k) { return set.sh[3 * set.sh_terms() * i + k]; },
        [&](std::size_t, std::array<double, 3> const& off) {
          take(sh_c0 * std::max({off[0], off[1], off[2]}), 1. / 255);
        });
    say("colours of ", "1/255", why);
  }
}

}  // namespace gsp::io::detail
