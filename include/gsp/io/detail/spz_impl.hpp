#pragma once
#include <array>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/detail/deflate.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/splat_set.hpp>
#include <gsp/io/spz.hpp>
#include <utility>

namespace gsp::io {

namespace detail {

/// IEEE 754 binary16.
inline double half_to_double(std::uint16_t h) {
  int const exponent = (h >> 10) & 31, mantissa = h & 1023;
  double const magnitude = exponent == 31  ? (mantissa ? std::nan("") : INFINITY)
                           : exponent == 0 ? std::ldexp(mantissa, -24)
                                           : std::ldexp(1024 + mantissa, exponent - 25);
  return h & 0x8000 ? -magnitude : magnitude;
}

/// The 16 bytes at the front of the unpacked data of .spz versions 1-3, and the sizes that follow from them.
struct SpzHeader {
  std::uint32_t version, count;
  int degree, fraction_bits, flags;
  std::size_t position_bytes() const { return version == 1 ? 6 : 9; }
  std::size_t rotation_bytes() const { return version == 3 ? 4 : 3; }
  std::size_t sh_bytes() const { return 3u * ((degree + 1) * (degree + 1) - 1); }
  std::size_t stride() const { return position_bytes() + 1 + 3 + 3 + rotation_bytes() + sh_bytes(); }
  std::size_t total() const { return 16 + count * stride(); }
  bool antialiased() const { return flags & 1; }
  bool extended() const { return flags & 2; }  // blocks of other vendors follow the arrays
};

inline SpzHeader parse_spz_header(Bytes bytes, std::string const& name) {
  if (bytes.size() < 16) fail(name, at_byte(bytes.size()), "the .spz header of 16 bytes is cut short; fetch the file again");
  if (!starts_with(bytes, "NGSP")) fail(name, at_byte(0), "the unpacked data does not start with 'NGSP'; this is not a .spz file");
  SpzHeader h{load<std::uint32_t>(bytes, 4), load<std::uint32_t>(bytes, 8), int(bytes[12]), int(bytes[13]), int(bytes[14])};
  if (h.version < 1 || h.version > 3)
    fail(name, at_byte(4), ".spz version " + std::to_string(h.version) + " is not supported; save it as version 2 or 3");
  if (h.degree > 3) fail(name, at_byte(12), "SH degree " + std::to_string(h.degree) + " is outside 0..3; save it with a lower degree");
  if (h.fraction_bits > 24)
    fail(name, at_byte(13), std::to_string(h.fraction_bits) + " fractional bits do not fit 24-bit coordinates; the file is damaged");
  if (h.count == 0) fail(name, at_byte(8), "holds no Gaussians; name a file that has some");
  return h;
}

}  // namespace detail

GSP_INLINE SplatSet parse_spz_data(Bytes bytes, std::string const& name) {
  auto const h = detail::parse_spz_header(bytes, name);
  if (bytes.size() < h.total())
    detail::fail(name, detail::at_byte(8),
                 "announces " + std::to_string(h.count) + " Gaussians of " + std::to_string(h.stride()) + " bytes, but only " +
                     std::to_string(bytes.size() - 16) + " bytes follow; the file is cut short or its count is wrong");
  std::size_t const n = h.count;
  SplatSet set = make_splat_set(n, h.degree);
  std::size_t at = 16;
  auto const take = [&](std::size_t size) { return bytes.subspan(std::exchange(at, at + size), size); };
  Bytes const positions = take(n * h.position_bytes()), alphas = take(n), colours = take(3 * n), scales = take(3 * n),
              rotations = take(n * h.rotation_bytes()), sh = take(n * h.sh_bytes());
  std::array<float, 3> const axis{1, -1, -1};
  // After DC, term by term: -1 where the polynomial of x, y, z is odd in (y, z).
  std::array<float, 15> const odd{-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1};
  std::size_t const terms = set.sh_terms();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      std::size_t const j = 3 * i + k;
      if (h.version == 1) {
        set.positions[j] = axis[k] * static_cast<float>(detail::half_to_double(detail::load<std::uint16_t>(positions, 2 * j)));
      } else {
        std::int32_t const fixed = int(positions[3 * j]) | int(positions[3 * j + 1]) << 8 | int(positions[3 * j + 2]) << 16;
        set.positions[j] = axis[k] * static_cast<float>(std::ldexp(fixed >= 1 << 23 ? fixed - (1 << 24) : fixed, -h.fraction_bits));
      }
      set.scales[j] = static_cast<float>(std::exp(double(scales[j]) / 16 - 10));
      set.sh[3 * terms * i + k] = static_cast<float>((double(colours[j]) / 255 - 0.5) / 0.15);
    }
    set.opacities[i] = static_cast<float>(double(alphas[i]) / 255);
    std::array<double, 4> q{};  // x y z w
    double sum = 0;
    int largest = 3;
    if (h.version < 3) {  // x y z as bytes
      for (int k = 0; k < 3; ++k) {
        q[k] = double(rotations[3 * i + k]) / 127.5 - 1;
        sum += q[k] * q[k];
      }
    } else {  // index of the largest in the top two bits, then the others in order, sign and 9 bits of v sqrt 2 each, the last one lowest
      std::uint32_t const packed = detail::load<std::uint32_t>(rotations, 4 * i);
      largest = static_cast<int>(packed >> 30);
      for (int k = 3, shift = 0; k >= 0; --k)
        if (k != largest) {
          double const v = ((packed >> shift) & 511) / (511 * std::sqrt(2.0));
          q[k] = (packed >> (shift + 9)) & 1 ? -v : v;
          sum += v * v;
          shift += 10;
        }
    }
    q[largest] = std::sqrt(std::max(0.0, 1 - sum));
    float const w[4] = {float(q[3]), float(q[0]), float(-q[1]), float(-q[2])};
    std::copy_n(w, 4, &set.quats[4 * i]);
    for (std::size_t k = 0; k < h.sh_bytes(); ++k)  // term-major, as in the set
      set.sh[3 * terms * i + 3 + k] = odd[k / 3] * static_cast<float>((double(sh[h.sh_bytes() * i + k]) - 128) / 128);
  }
  if (h.antialiased()) set.notes.push_back(name + ": its flag 'antialiased' is without effect");
  if (h.extended()) set.notes.push_back(name + ": the vendor extensions behind its arrays are without effect");
  detail::finish(set, name);
  return set;
}

GSP_INLINE SplatSet parse_spz(Bytes bytes, std::string const& name) {
  using namespace detail;
  if (starts_with(bytes, "NGSP")) fail(name, at_byte(0), ".spz version 4 (not gzip) is not supported; save it as version 2 or 3");
  if (!starts_with(bytes, "\x1f\x8b")) fail(name, at_byte(0), "is not gzip data; this is not a .spz file");
  Inflater inflater(bytes, Wrapper::gzip, name);
  std::vector<std::byte> data = inflater.read_up_to(16);
  auto const h = parse_spz_header(data, name);
  auto const short_by = [&](std::size_t got) {
    fail(name, "unpacked byte " + std::to_string(got),
         "the header announces " + std::to_string(h.count) + " Gaussians (" + std::to_string(h.total()) +
             " bytes unpacked), but the data ends before; the file is cut short or its count is wrong");
  };
  if (!can_inflate_to(bytes.size(), h.total())) short_by(16);
  auto const rest = inflater.read_up_to(h.total() - 16);
  if (rest.size() < h.total() - 16) short_by(16 + rest.size());
  data.insert(data.end(), rest.begin(), rest.end());
  if (h.extended()) {
    std::array<std::byte, 4096> skipped;
    while (inflater.read(skipped) > 0) {}
  }
  if (!inflater.at_end())
    fail(name, "unpacked byte " + std::to_string(h.total()),
         "the stream goes on behind its last Gaussian or lacks its end; the count is wrong or the file is cut short");
  return parse_spz_data(data, name);
}

GSP_INLINE SplatSet read_spz(std::filesystem::path const& path) { return parse_spz(read_file(path), path.string()); }

}  // namespace gsp::io
