#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <gsp/io/detail/splat_bounds.hpp>
#include <gsp/io/splat_file.hpp>
#include <gsp/io/spz.hpp>
#include <limits>
#include <string>

/// What of a set a format does not hold, one sentence each, where more is lost than by rounding: gsp/io/splats.hpp.
namespace gsp::io::detail {

enum class SplatFormat { compressed_ply, ply, splat, spz, gltf, sog, usda };

inline std::string gaussians_have(std::size_t n) { return std::to_string(n) + (n == 1 ? " Gaussian has " : " Gaussians have "); }
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
    if (n > 0) note(gaussians_have(n) + what + ", all that the format holds; clipped");
  };
  double const colour = format == splat ? 0.5 / sh_c0 : format == spz ? 0.5 / spz_colour : infinity;
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

/// Of Gaussians whose places come from steps (low + k step, by axis), those that a step costs more than their size.
struct CoarsePlaces {
  std::size_t count = 0;
  double worst = 0;
  void add(SplatSet const& set, std::size_t i, std::array<double, 3> const& low, std::array<double, 3> const& step) {
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k)
      if (step[k] > 0) {
        double const t = (set.positions[3 * i + k] - low[k]) / step[k], off = (t - std::round(t)) * step[k];
        sum += off * off;
      }
    double const off = std::sqrt(sum), size = *std::max_element(&set.scales[3 * i], &set.scales[3 * i] + 3);
    if (off <= size) return;
    ++count;
    worst = std::max(worst, off);
  }
  template <class Note>
  void say(Note const& note, std::string const& why) const {
    if (count > 0)
      note("places of " + std::to_string(count) +
           (count == 1 ? " Gaussian are off by more than its size" : " Gaussians are off by more than their size") + ", up to " +
           in_digits(worst, 3) + ": " + why + "; write another format, or leave out those that are far off");
  }
};

/// Of 256 neighbours of a compressed PLY, which share the bounds of their colours: those that are off by more than a step of 8 bits from
/// black to white.
template <class Note>
void note_coarse_colours(SplatSet const& set, Note const& note) {
  std::size_t const stride = 3 * set.sh_terms();
  std::size_t n = 0;
  double worst = 0;
  for (std::size_t first = 0; first < set.size(); first += 256) {
    std::size_t const end = std::min(set.size(), first + 256);
    std::array<double, 3> low{}, step{};
    for (std::size_t k = 0; k < 3; ++k) {
      double high = low[k] = set.sh[stride * first + k];
      for (std::size_t i = first; i < end; ++i) {
        low[k] = std::min(low[k], double(set.sh[stride * i + k]));
        high = std::max(high, double(set.sh[stride * i + k]));
      }
      step[k] = (high - low[k]) / 255;
    }
    for (std::size_t i = first; i < end; ++i) {
      double off = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        double const t = step[k] > 0 ? (set.sh[stride * i + k] - low[k]) / step[k] : 0;
        off = std::max(off, sh_c0 * std::abs(t - std::round(t)) * step[k]);
      }
      n += off > 1. / 255;
      worst = std::max(worst, off);
    }
  }
  if (n > 0)
    note("colours of " + std::to_string(n) + (n == 1 ? " Gaussian" : " Gaussians") + " are off by more than 1/255, up to " +
         in_digits(worst, 3) + ": 256 neighbours share bounds; write another format, or leave out those that are far brighter");
}

/// Of a set in the order of its file.
template <class Note>
void note_coarse_places(SplatSet const& set, SplatFormat format, Note const& note) {
  CoarsePlaces coarse;
  if (format == SplatFormat::spz) {
    double const step = std::ldexp(1., -spz_fraction_bits(set));
    for (std::size_t i = 0; i < set.size(); ++i) coarse.add(set, i, {0, 0, 0}, {step, step, step});
    coarse.say(note, "24 bits reach as far as the farthest");
  } else if (format == SplatFormat::compressed_ply) {
    for (std::size_t first = 0; first < set.size(); first += 256) {
      std::size_t const end = std::min(set.size(), first + 256);
      std::array<double, 3> low{}, step{};
      for (std::size_t k = 0; k < 3; ++k) {
        double high = low[k] = set.positions[3 * first + k];
        for (std::size_t i = first; i < end; ++i) {
          low[k] = std::min(low[k], double(set.positions[3 * i + k]));
          high = std::max(high, double(set.positions[3 * i + k]));
        }
        step[k] = (high - low[k]) / (k == 1 ? 1023 : 2047);
      }
      for (std::size_t i = first; i < end; ++i) coarse.add(set, i, low, step);
    }
    coarse.say(note, "256 neighbours share bounds");
    note_coarse_colours(set, note);
  }
}

}  // namespace gsp::io::detail
