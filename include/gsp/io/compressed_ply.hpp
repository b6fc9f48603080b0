#pragma once
#include <filesystem>
#include <gsp/io/detail/ply_links.hpp>
#include <vector>

namespace gsp::io {
namespace detail {

/// The top `bits` of x above `shift` as 0..1.
inline double unorm(std::uint32_t x, int bits, int shift) {
  std::uint32_t const mask = (1u << bits) - 1;
  return double((x >> shift) & mask) / mask;
}

/// SuperSplat's compressed PLY. Element `chunk` holds the bounds of 256 Gaussians each: min/max of position, log-scale and (newer files)
/// colour. Element `vertex` holds four uint32 per Gaussian:
///   position  11 | 10 | 11 bits  x y z, between the chunk's bounds
///   rotation  2 | 10 | 10 | 10   index of the largest of w x y z, then the others in that order, v = (u - 1/2) sqrt 2; the largest is > 0
///   scale     11 | 10 | 11       log-scale between the chunk's bounds
///   colour    8 | 8 | 8 | 8      r g b (between the chunk's bounds where it has some), opacity
/// Element `sh` (optional): uchar f_rest_*, channel-major, v = 8 (b/256 - 1/2).
inline SplatSet parse_compressed_ply(PlyTable const& table) {
  static char const* const what = "SuperSplat compressed PLY";
  std::string const& name = table.name;
  PlyElement const &vertex = *table.find("vertex"), *chunk = table.find("chunk"), *sh = table.find("sh");
  if (!chunk) fail(name, at_line(vertex.line), "packed Gaussians need an element 'chunk' with their bounds; export the file again");
  std::size_t const n = vertex.count;
  if (chunk->count < n / 256 + (n % 256 != 0))
    fail(name, at_line(chunk->line),
         std::to_string(chunk->count) + " chunks of 256 do not hold " + std::to_string(n) + " Gaussians; a count in the header is wrong");

  std::array<std::string_view, 9> const axes{"x", "y", "z", "scale_x", "scale_y", "scale_z", "r", "g", "b"};
  bool const colour_bounds = table.find(*chunk, "min_r") != nullptr;
  std::size_t const bounded = colour_bounds ? 9 : 6;
  std::vector<std::array<double, 9>> low(chunk->count), high(chunk->count);
  for (std::size_t k = 0; k < bounded; ++k) {
    auto const lo = table.column(*chunk, "min_" + std::string(axes[k]), what),
               hi = table.column(*chunk, "max_" + std::string(axes[k]), what);
    for (std::size_t c = 0; c < chunk->count; ++c) {
      low[c][k] = lo(c);
      high[c][k] = hi(c);
      if (!std::isfinite(low[c][k]) || !std::isfinite(high[c][k]))
        fail(name, "chunk " + std::to_string(c),
             "the bounds of '" + std::string(axes[k]) + "' are not finite; repair or export the file again");
    }
  }

  std::size_t const rest = sh ? sh->properties.size() : 0;
  if (sh && sh->count != n)
    fail(name, at_line(sh->line),
         "element 'sh' has " + std::to_string(sh->count) + " rows for " + std::to_string(n) + " Gaussians; a count in the header is wrong");
  SplatSet set = make_splat_set(n, sh_degree_of(rest, name, sh ? sh->line : vertex.line));

  auto const position = table.column(vertex, "packed_position", what), scale = table.column(vertex, "packed_scale", what),
             colour = table.column(vertex, "packed_color", what);
  auto const rotation = table.column(vertex, table.find(vertex, "packed_rot") ? "packed_rot" : "packed_rotation", what);
  std::vector<PlyColumn> rest_columns;
  for (std::size_t k = 0; k < rest; ++k) rest_columns.push_back(table.column(*sh, "f_rest_" + std::to_string(k), what));

  std::size_t const terms = set.sh_terms();
  for (std::size_t i = 0; i < n; ++i) {
    auto const packed = [&](PlyColumn const& c, char const* label) {
      return static_cast<std::uint32_t>(as_integer(c(i), 0, 0xffffffffLL, name, i, label));
    };
    std::uint32_t const p = packed(position, "packed_position"), q = packed(rotation, "packed_rotation"), s = packed(scale, "packed_scale"),
                        c = packed(colour, "packed_color");
    auto const &lo = low[i / 256], &hi = high[i / 256];
    auto const between = [&](std::size_t k, double t) { return lo[k] * (1 - t) + hi[k] * t; };
    std::array<int, 3> const bits{11, 10, 11}, shift{21, 11, 0};
    for (std::size_t k = 0; k < 3; ++k) {
      set.positions[3 * i + k] = static_cast<float>(between(k, unorm(p, bits[k], shift[k])));
      set.scales[3 * i + k] = static_cast<float>(std::exp(between(3 + k, unorm(s, bits[k], shift[k]))));
      double const rgb = unorm(c, 8, 24 - 8 * static_cast<int>(k));
      set.sh[3 * terms * i + k] = static_cast<float>(((colour_bounds ? between(6 + k, rgb) : rgb) - 0.5) / sh_c0);
    }
    set.opacities[i] = static_cast<float>(unorm(c, 8, 0));
    double sum = 0;
    for (int k = 0, largest = static_cast<int>(q >> 30), from = 20; k < 4; ++k)
      if (k != largest) {
        double const v = (unorm(q, 10, from) - 0.5) * std::sqrt(2.0);
        set.quats[4 * i + k] = static_cast<float>(v);
        sum += v * v;
        from -= 10;
      }
    set.quats[4 * i + (q >> 30)] = static_cast<float>(std::sqrt(std::max(0.0, 1 - sum)));
    for (std::size_t k = 0; k < rest; ++k) {  // f_rest_k: channel k / (terms - 1), term 1 + k % (terms - 1)
      double const b = static_cast<double>(as_integer(rest_columns[k](i), 0, 255, name, i, "f_rest_*"));
      set.sh[(i * terms + 1 + k % (terms - 1)) * 3 + k / (terms - 1)] = static_cast<float>((b / 256 - 0.5) * 8);
    }
  }
  read_ply_links(table, vertex, set);
  read_ply_mode(table, set);
  note_unused(table, vertex, set, [](std::string_view p) { return p.starts_with("packed_") || p == "link"; });
  finish(set, name);
  return set;
}

}  // namespace detail

/// Bytes of such a file, with bounds of colours: 256 Gaussians in a row share a chunk, so neighbours should be near each other
/// (`sort_splats`). What comes back is off by at most half a step: positions and log-scales 1/2047 (y: 1/1023) of the chunk's range,
/// colours 1/255 of it, opacity 1/255, rotation sqrt 2 / 1023 a component, SH above DC 1/32, which ends at +-4. Scales below exp(-20)
/// become that. With the property `link` where the set has links.
std::vector<std::byte> format_compressed_ply(SplatSet const& set);

void write_compressed_ply(std::filesystem::path const& path, SplatSet const& set);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/compressed_ply_impl.hpp>
#endif
