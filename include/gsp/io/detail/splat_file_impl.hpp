#pragma once
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/splat_file.hpp>
#include <gsp/io/splat_set.hpp>

namespace gsp::io {

GSP_INLINE SplatSet parse_splat(Bytes bytes, std::string const& name) {
  if (bytes.empty() || bytes.size() % 32 != 0)
    detail::fail(name, detail::at_byte(bytes.size() - bytes.size() % 32),
                 "a .splat file holds 32 bytes per Gaussian, this one has " + std::to_string(bytes.size()) +
                     " bytes; it is cut short or not a .splat");
  std::size_t const n = bytes.size() / 32;
  SplatSet set = make_splat_set(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    std::memcpy(&set.positions[3 * i], bytes.data() + 32 * i, 12);
    std::memcpy(&set.scales[3 * i], bytes.data() + 32 * i + 12, 12);
    auto const byte = [&](std::size_t k) { return static_cast<double>(bytes[32 * i + 24 + k]); };
    for (std::size_t k = 0; k < 3; ++k) set.sh[3 * i + k] = static_cast<float>((byte(k) / 255 - 0.5) / sh_c0);
    set.opacities[i] = static_cast<float>(byte(3) / 255);
    for (std::size_t k = 0; k < 4; ++k) set.quats[4 * i + k] = static_cast<float>((byte(4 + k) - 128) / 128);
  }
  detail::finish(set, name);
  return set;
}

GSP_INLINE SplatSet read_splat(std::filesystem::path const& path) { return parse_splat(read_file(path), path.string()); }

GSP_INLINE std::vector<std::byte> format_splat(SplatSet const& set) {
  validate(set, "gsp::io::format_splat");
  std::size_t const terms = set.sh_terms();
  std::vector<std::byte> bytes(32 * set.size());
  auto const rounded = [](double value) { return static_cast<std::byte>(std::clamp(std::round(value), 0.0, 255.0)); };
  for (std::size_t i = 0; i < set.size(); ++i) {
    std::byte* const to = bytes.data() + 32 * i;
    std::memcpy(to, &set.positions[3 * i], 12);
    std::memcpy(to + 12, &set.scales[3 * i], 12);
    for (std::size_t k = 0; k < 3; ++k) to[24 + k] = rounded(255 * (sh_c0 * set.sh[3 * terms * i + k] + 0.5));
    to[27] = rounded(255.0 * set.opacities[i]);
    float const* const q = &set.quats[4 * i];
    auto const largest = std::max_element(q, q + 4, [](float a, float b) { return std::abs(a) < std::abs(b); });
    double const sign = *largest < 0 ? 1 : -1;  // of q and -q the one without a component near 1, which 255 falls short of
    for (std::size_t k = 0; k < 4; ++k) to[28 + k] = rounded(128 + 128 * sign * q[k]);
  }
  return bytes;
}

GSP_INLINE void write_splat(std::filesystem::path const& path, SplatSet const& set) { write_file(path, format_splat(set)); }

}  // namespace gsp::io
