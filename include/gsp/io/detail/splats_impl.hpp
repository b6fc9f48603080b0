#pragma once
#include <array>
#include <cstdio>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/compressed_ply.hpp>
#include <gsp/io/detail/lower_case.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/gltf.hpp>
#include <gsp/io/ply.hpp>
#include <gsp/io/sog.hpp>
#include <gsp/io/splat_file.hpp>
#include <gsp/io/splat_links.hpp>
#include <gsp/io/splat_order.hpp>
#include <gsp/io/splat_set.hpp>
#include <gsp/io/splat_transform.hpp>
#include <gsp/io/splats.hpp>
#include <gsp/io/spz.hpp>
#include <gsp/io/usda.hpp>
#include <limits>
#include <optional>
#include <utility>

namespace gsp::io {

namespace detail {

/// Endings, longer ones first where one ends in another.
enum class SplatFormat { compressed_ply, ply, splat, spz, gltf, sog, usda };

inline std::pair<char const*, SplatFormat> const* splat_format_of(std::string const& path) {
  using enum SplatFormat;
  static constexpr std::array<std::pair<char const*, SplatFormat>, 9> formats{{{".compressed.ply", compressed_ply},
                                                                               {".ply", ply},
                                                                               {".splat", splat},
                                                                               {".spz", spz},
                                                                               {".glb", gltf},
                                                                               {".gltf", gltf},
                                                                               {".sog", sog},
                                                                               {"meta.json", sog},
                                                                               {".usda", usda}}};
  std::string const name = lower_case(path);
  for (auto const& format : formats)
    if (format.first[0] == '.' ? name.ends_with(format.first) : std::filesystem::path(path).filename() == format.first) return &format;
  return nullptr;
}

/// NAME.links.json beside NAME.ext, as read_splats looks for it.
inline std::filesystem::path links_beside(std::filesystem::path path) { return path.replace_extension(".links.json"); }

/// Of numbers that a format has no place for, how many Gaussians have some: a line each, where more is lost than by rounding.
template <class Note>
void note_clipped(SplatSet const& set, SplatFormat format, SpzOptions const& options, Note const& note) {
  using enum SplatFormat;
  constexpr double infinity = std::numeric_limits<double>::infinity();
  std::size_t const terms = set.sh_terms();
  auto const count = [&](auto const& is_beyond) {
    std::size_t sum = 0;
    for (std::size_t i = 0; i < set.size(); ++i) sum += is_beyond(i);
    return sum;
  };
  auto const say = [&](std::size_t n, std::string const& what) {
    if (n > 0) note(std::to_string(n) + (n == 1 ? " Gaussian has " : " Gaussians have ") + what + ", all that the format holds; clipped");
  };
  char text[64];
  double const colour = format == splat ? 0.5 / sh_c0 : format == spz ? 0.5 / 0.15 : infinity;
  std::snprintf(text, sizeof text, "colours (f_dc) beyond +-%.4g", colour);
  if (colour < infinity)
    say(count([&](std::size_t i) {
          double most = 0;
          for (std::size_t k = 0; k < 3; ++k) most = std::max(most, std::abs(double(set.sh[3 * terms * i + k])));
          return most > colour * (1 + 1. / 255);
        }),
        text);
  double const sh = format == compressed_ply ? 4 : format == spz ? 1 : infinity;
  std::snprintf(text, sizeof text, "SH terms above degree 0 beyond +-%.4g", sh);
  if (sh < infinity)
    say(count([&](std::size_t i) {
          bool beyond = false;
          for (std::size_t k = 3; k < 3 * terms; ++k)
            beyond |= std::abs(set.sh[3 * terms * i + k]) >
                      sh + (format == compressed_ply ? 1. / 64 : std::ldexp(1., -(k < 12 ? options.sh1_bits : options.sh_bits)));
          return beyond;
        }),
        text);
  double const scale = format == ply                               ? 1.2e-38
                       : format == compressed_ply || format == sog ? std::exp(-20.)
                       : format == spz                             ? std::exp(-10.)
                                                                   : 0;
  std::snprintf(text, sizeof text, "scales below %.3g", scale);
  double const least = scale * (format == spz ? std::exp(-1. / 32) : 1 - 1e-5);
  say(count([&](std::size_t i) { return *std::min_element(&set.scales[3 * i], &set.scales[3 * i] + 3) < least; }), text);
}

/// Of a set in the order of its file: the bounds of a chunk are shared, and one Gaussian far off costs the others their places.
template <class Note>
void note_coarse_chunks(SplatSet const& set, Note const& note) {
  std::size_t const n = set.size();
  std::size_t coarse = 0;
  double worst = 0;
  for (std::size_t first = 0; first < n; first += 256) {
    std::size_t const end = std::min(n, first + 256);
    double low[3], step[3];
    for (std::size_t k = 0; k < 3; ++k) {
      double high = low[k] = set.positions[3 * first + k];
      for (std::size_t i = first; i < end; ++i) {
        low[k] = std::min(low[k], double(set.positions[3 * i + k]));
        high = std::max(high, double(set.positions[3 * i + k]));
      }
      step[k] = (high - low[k]) / (k == 1 ? 1023 : 2047);
    }
    for (std::size_t i = first; i < end; ++i) {
      double sum = 0;
      for (std::size_t k = 0; k < 3; ++k)
        if (step[k] > 0) {
          double const t = (set.positions[3 * i + k] - low[k]) / step[k], off = (t - std::round(t)) * step[k];
          sum += off * off;
        }
      double const off = std::sqrt(sum), size = *std::max_element(&set.scales[3 * i], &set.scales[3 * i] + 3);
      if (off > size) {
        ++coarse;
        worst = std::max(worst, off);
      }
    }
  }
  if (coarse == 0) return;
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", worst);
  note("places of " + std::to_string(coarse) + (coarse == 1 ? " Gaussian" : " Gaussians") + " are off by more than its size, up to " +
       text + ": 256 neighbours share bounds, and some stand far apart; leave those far off out, or write another format");
}

}  // namespace detail

GSP_INLINE SplatSet parse_splats(Bytes bytes, std::string const& name, std::filesystem::path const& folder) {
  using detail::starts_with;
  if (bytes.empty()) detail::fail(name, "", "the file is empty; fetch it again");
  if (detail::lower_case(name).ends_with(".splat")) return parse_splat(bytes, name);
  if (starts_with(bytes, "ply")) return parse_ply(bytes, name);
  if (starts_with(bytes, "\x1f\x8b") || starts_with(bytes, "NGSP")) return parse_spz(bytes, name);
  if (starts_with(bytes, "PK") || detail::is_sog_meta(bytes)) return parse_sog(bytes, name, folder);
  if (starts_with(bytes, "#usda")) return parse_usda(bytes, name);
  if (starts_with(bytes, "PXR-USDC"))
    detail::fail(name, detail::at_byte(0), "is binary USD, which is not read; save it as text (usdcat FILE -o FILE.usda)");
  if (starts_with(bytes, "glTF") || starts_with(bytes, "{")) return parse_gltf(bytes, name, folder);
  detail::fail(
      name, detail::at_byte(0),
      "is no file of Gaussians that is known here; convert it to .ply (3DGS or SuperSplat compressed), .splat, .spz, .sog, .usda or .glb");
}

GSP_INLINE SplatSet read_splats(std::filesystem::path const& path) {
  SplatSet set = parse_splats(read_file(path), path.string(), path.has_parent_path() ? path.parent_path() : ".");
  auto const sidecar = detail::links_beside(path);
  std::error_code error;
  if (std::filesystem::exists(sidecar, error)) bind_links(set, read_links(sidecar), sidecar.string());
  return set;
}

GSP_INLINE void expect_splats_writable(std::filesystem::path const& path) {
  if (!detail::splat_format_of(path.string()))
    detail::fail(path.string(), "",
                 "its ending names no format of Gaussians that is written here; end it in .ply, .compressed.ply, .splat, .spz, .glb, "
                 ".gltf, .sog or .usda");
  expect_writable(path);
}

GSP_INLINE std::vector<std::string> write_splats(std::filesystem::path const& path, SplatSet set, WriteSplatsOptions const& options) {
  using enum detail::SplatFormat;
  std::string const name = path.string();
  validate(set, name);
  expect_splats_writable(path);
  auto const format = detail::splat_format_of(name)->second;
  bool const is_ply = format == ply || format == compressed_ply;
  std::vector<std::string> notes;
  auto const note = [&](std::string const& text) { notes.push_back(name + ": " + text); };
  if (set.antialiased && !is_ply && format != spz && format != sog)
    note("the flag 'antialiased' is left out; the format has no place for it");
  if (format == splat && set.sh_degree > 0) note("SH terms above degree 0 are left out; the format has no place for them");
  detail::note_clipped(set, format, options.spz, note);
  if (format == compressed_ply || format == sog) sort_splats(set);
  if (format == compressed_ply) detail::note_coarse_chunks(set, note);

  auto const ranges = is_ply ? std::vector<LinkRange>{} : link_ranges(set);
  std::string const text = ranges.empty() ? "" : format_links(ranges);
  auto const sidecar = detail::links_beside(path);
  std::error_code error;
  bool const is_there = std::filesystem::exists(sidecar, error);
  if (is_there && (text.empty() || detail::as_text(read_file(sidecar)) != text))
    detail::fail(
        sidecar.string(), "",
        "would bind the Gaussians of " + detail::in_quotes(name) + " to other links than they have; remove it or choose another name");
  std::optional<AtomicFile> links;  // written before the Gaussians, named after them
  if (!text.empty() && !is_there) links.emplace(sidecar).write(text);
  if (format == ply) write_ply(path, set);
  if (format == compressed_ply) write_compressed_ply(path, set);
  if (format == splat) write_splat(path, set);
  if (format == spz) write_spz(path, set, options.spz);
  if (format == gltf) write_gltf(path, set);
  if (format == sog) write_sog(path, set);
  if (format == usda) write_usda(path, set);
  if (links) links->commit();
  return notes;
}

}  // namespace gsp::io
