#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/compressed_ply.hpp>
#include <gsp/io/detail/shared_bounds.hpp>
#include <gsp/io/file.hpp>
#include <utility>

namespace gsp::io {

namespace detail {

/// Which of w x y z is largest, and 10 bits of (v / sqrt 2 + 1/2) of each of the others.
inline std::uint32_t pack_ply_rotation(float const* q) {
  std::size_t largest = 0;
  for (std::size_t k = 1; k < 4; ++k)
    if (std::abs(q[k]) > std::abs(q[largest])) largest = k;
  double const sign = q[largest] < 0 ? -1 : 1;
  auto packed = static_cast<std::uint32_t>(largest);
  for (std::size_t k = 0; k < 4; ++k)
    if (k != largest)  // lengths differ from 1 by rounding
      packed = packed << 10 | static_cast<std::uint32_t>(std::clamp(std::round((sign * q[k] / std::sqrt(2.0) + 0.5) * 1023), 0., 1023.));
  return packed;
}

}  // namespace detail

GSP_INLINE std::vector<std::byte> format_compressed_ply(SplatSet const& set) {
  validate(set, "gsp::io::format_compressed_ply");
  std::size_t const n = set.size(), chunks = (n + 255) / 256, terms = set.sh_terms(), rest = 3 * (terms - 1);
  bool const links = !set.link_names.empty();
  std::string header =
      "ply\nformat binary_little_endian 1.0\n" + detail::ply_comments(set) + "element chunk " + std::to_string(chunks) + "\n";
  using Axes = std::array<char const*, 3>;
  for (Axes const& axes : {Axes{"x", "y", "z"}, Axes{"scale_x", "scale_y", "scale_z"}, Axes{"r", "g", "b"}})
    for (char const* side : {"min_", "max_"})
      for (char const* axis : axes) header += std::string("property float ") + side + axis + "\n";
  header += "element vertex " + std::to_string(n) + "\n";
  for (char const* label : {"packed_position", "packed_rotation", "packed_scale", "packed_color"})
    header += std::string("property uint ") + label + "\n";
  if (links) header += "property int link\n";
  if (rest > 0) header += "element sh " + std::to_string(n) + "\n";
  for (std::size_t k = 0; k < rest; ++k) header += "property uchar f_rest_" + std::to_string(k) + "\n";
  header += "end_header\n";

  std::vector<std::byte> bytes(header.size() + 72 * chunks + n * (16 + (links ? 4 : 0) + rest));
  std::byte* out = bytes.data();
  auto const put = [&](void const* from, std::size_t size) { std::memcpy(std::exchange(out, out + size), from, size); };
  put(header.data(), header.size());

  std::vector<std::array<detail::SharedBounds, 9>> bounds(chunks);
  for (std::size_t c = 0; c < chunks; ++c) {
    std::array<float, 9> low, high;
    for (std::size_t k = 0; k < 9; ++k) {
      bounds[c][k] = detail::compressed_ply_bounds(set, c, k);
      low[k] = static_cast<float>(bounds[c][k].low);
      high[k] = static_cast<float>(bounds[c][k].high);
    }
    for (std::size_t group = 0; group < 9; group += 3) {
      put(&low[group], 12);
      put(&high[group], 12);
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    auto const packed = [&](std::size_t k) { return bounds[i / 256][k].pack(detail::compressed_ply_value(set, i, k)); };
    std::array<std::uint32_t, 4> const words{
        packed(0) << 21 | packed(1) << 11 | packed(2), detail::pack_ply_rotation(&set.quats[4 * i]),
        packed(3) << 21 | packed(4) << 11 | packed(5),
        packed(6) << 24 | packed(7) << 16 | packed(8) << 8 | static_cast<std::uint32_t>(std::lround(255.0 * set.opacities[i]))};
    put(words.data(), 16);
    if (links) put(&set.link[i], 4);
  }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < rest; ++k) {
      double const v = set.sh[(i * terms + 1 + k % (terms - 1)) * 3 + k / (terms - 1)];
      *out++ = static_cast<std::byte>(std::clamp(std::round((v / (2 * detail::compressed_ply_sh) + 0.5) * 256), 0.0, 255.0));
    }
  return bytes;
}

GSP_INLINE void write_compressed_ply(std::filesystem::path const& path, SplatSet const& set) {
  write_file(path, format_compressed_ply(set));
}

}  // namespace gsp::io
