#pragma once
#include <array>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/detail/deflate.hpp>
#include <gsp/io/detail/half_turn.hpp>
#include <gsp/io/detail/splat_bounds.hpp>
#include <gsp/io/detail/zstd.hpp>
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

/// What the headers of all .spz versions say, and the sizes that follow.
struct SpzHeader {
  std::uint32_t version, count;
  int degree, fraction_bits, flags;
  std::size_t position_bytes() const { return version == 1 ? 6 : 9; }
  std::size_t rotation_bytes() const { return version >= 3 ? 4 : 3; }
  std::size_t sh_bytes() const { return 3u * ((degree + 1) * (degree + 1) - 1); }
  std::size_t stride() const { return position_bytes() + 1 + 3 + 3 + rotation_bytes() + sh_bytes(); }
  std::size_t total() const { return 16 + count * stride(); }
  /// Of the arrays, in their order in the file.
  std::array<std::size_t, 6> sizes() const {
    std::size_t const n = count;
    return {n * position_bytes(), n, 3 * n, 3 * n, n * rotation_bytes(), n * sh_bytes()};
  }
  bool antialiased() const { return flags & 1; }
  bool extended() const { return flags & 2; }  // records of other vendors: behind the arrays, in version 4 before them
};

/// The fields that all versions have in the same place.
inline SpzHeader parse_spz_header(Bytes bytes, std::string const& name) {
  if (bytes.size() < 16) fail(name, at_byte(bytes.size()), "the .spz header of 16 bytes is cut short; fetch the file again");
  if (!starts_with(bytes, "NGSP")) fail(name, at_byte(0), "the unpacked data does not start with 'NGSP'; this is not a .spz file");
  SpzHeader h{load<std::uint32_t>(bytes, 4), load<std::uint32_t>(bytes, 8), int(bytes[12]), int(bytes[13]), int(bytes[14])};
  if (h.version < 1 || h.version > 4)
    fail(name, at_byte(4), ".spz version " + std::to_string(h.version) + " is not supported; save it as version 2, 3 or 4");
  if (h.degree > 3) fail(name, at_byte(12), "SH degree " + std::to_string(h.degree) + " is outside 0..3; save it with a lower degree");
  if (h.fraction_bits > 24)
    fail(name, at_byte(13), std::to_string(h.fraction_bits) + " fractional bits do not fit 24-bit coordinates; the file is damaged");
  if (h.count == 0) fail(name, at_byte(8), "holds no Gaussians; name a file that has some");
  return h;
}

/// Records {u32 type, u32 size, bytes} of other vendors, as far as they are whole. One of them is about what we read: Adobe's, which says
/// that the axes are others than right-up-back.
inline void check_spz_records(Bytes records, std::string const& name) {
  constexpr std::uint32_t axes = 0xADBE0003, right_up_back = 4;
  while (records.size() >= 8) {
    auto const type = load<std::uint32_t>(records, 0), size = load<std::uint32_t>(records, 4);
    if (size > records.size() - 8) return;
    if (type == axes && size >= 4)
      if (auto const value = load<std::uint32_t>(records, 8); value != 0 && value != right_up_back)
        fail(name, "extension SPZ_ADOBE_coordinate_system",
             "its axes have number " + std::to_string(value) + ", and only 4 (right, up, back) is read; save it without the extension");
    records = records.subspan(8 + size);
  }
}

/// A file of version 4: header of 32 bytes, records of vendors, a table of (packed, unpacked) sizes, and a zstd stream for each array that
/// is not empty. Gives what parse_spz_data reads. Streams that unpack to more than 1032 times the file, as deflate may, are refused.
inline std::vector<std::byte> unpack_spz4(Bytes bytes, std::string const& name) {
  if (bytes.size() < 32) fail(name, at_byte(bytes.size()), "the .spz header of 32 bytes is cut short; fetch the file again");
  auto const h = parse_spz_header(bytes, name);
  if (h.version != 4)
    fail(name, at_byte(4), ".spz version " + std::to_string(h.version) + " without gzip is not supported; save it as version 2, 3 or 4");
  auto const sizes = h.sizes();
  std::size_t const streams = std::to_integer<std::size_t>(bytes[15]), table = load<std::uint32_t>(bytes, 16), used = h.degree ? 6 : 5;
  if (streams != used && streams != 6)
    fail(name, at_byte(15),
         "has " + std::to_string(streams) + " streams where SH degree " + std::to_string(h.degree) + " needs " + std::to_string(used) +
             "; the file is damaged");
  if (table < 32 || table > bytes.size() || bytes.size() - table < 16 * streams)
    fail(name, at_byte(16), "its table of streams lies outside of the file; it is cut short or damaged");
  if (!can_inflate_to(bytes.size(), h.total()))
    fail(name, at_byte(8),
         "announces " + std::to_string(h.count) + " Gaussians (" + std::to_string(h.total()) + " bytes unpacked), which a file of " +
             std::to_string(bytes.size()) + " bytes does not hold; it is cut short or its count is wrong");
  if (h.extended()) check_spz_records(bytes.subspan(32, table - 32), name);
  std::size_t at = table + 16 * streams;
  for (std::size_t k = 0; k < streams; ++k) {
    auto const packed = load<std::uint64_t>(bytes, table + 16 * k), unpacked = load<std::uint64_t>(bytes, table + 16 * k + 8);
    if (unpacked != sizes[k])
      fail(name, at_byte(table + 16 * k + 8),
           "stream " + std::to_string(k) + " announces " + std::to_string(unpacked) + " bytes where " + std::to_string(h.count) +
               " Gaussians need " + std::to_string(sizes[k]) + "; the file is damaged");
    if (packed > bytes.size() - at)
      fail(name, at_byte(table + 16 * k),
           "stream " + std::to_string(k) + " of " + std::to_string(packed) + " bytes reaches beyond the end; the file is cut short");
    at += packed;
  }
  if (at != bytes.size()) fail(name, at_byte(at), "bytes follow the last stream; a size in its table is wrong or something was appended");
  std::vector<std::byte> data(h.total());
  std::copy_n(bytes.begin(), 16, data.begin());
  std::span<std::byte> rest = std::span(data).subspan(16);
  at = table + 16 * streams;
  for (std::size_t k = 0; k < streams; ++k) {
    std::size_t const packed = load<std::uint64_t>(bytes, table + 16 * k);
    if (!zstd_unpack(bytes.subspan(at, packed), rest.first(sizes[k]), name))
      fail(name, at_byte(at), "stream " + std::to_string(k) + " is damaged or of another size than announced; fetch the file again");
    at += packed;
    rest = rest.subspan(sizes[k]);
  }
  return data;
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
  std::array<Bytes, 6> arrays;
  for (std::size_t k = 0, at = 16; k < 6; ++k) arrays[k] = bytes.subspan(std::exchange(at, at + h.sizes()[k]), h.sizes()[k]);
  auto const& [positions, alphas, colours, scales, rotations, sh] = arrays;
  std::size_t const terms = set.sh_terms();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      std::size_t const j = 3 * i + k;
      if (h.version == 1) {
        set.positions[j] = static_cast<float>(detail::half_to_double(detail::load<std::uint16_t>(positions, 2 * j)));
      } else {
        std::int32_t const fixed = int(positions[3 * j]) | int(positions[3 * j + 1]) << 8 | int(positions[3 * j + 2]) << 16;
        set.positions[j] = static_cast<float>(std::ldexp(fixed >= 1 << 23 ? fixed - (1 << 24) : fixed, -h.fraction_bits));
      }
      set.scales[j] = static_cast<float>(std::exp(double(scales[j]) / 16 + detail::spz_least_log_scale));
      set.sh[3 * terms * i + k] = static_cast<float>((double(colours[j]) / 255 - 0.5) / detail::spz_colour_slope);
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
    float const w[4] = {float(q[3]), float(q[0]), float(q[1]), float(q[2])};
    std::copy_n(w, 4, &set.quats[4 * i]);
    for (std::size_t k = 0; k < h.sh_bytes(); ++k)  // term-major, as in the set
      set.sh[3 * terms * i + 3 + k] = static_cast<float>((double(sh[h.sh_bytes() * i + k]) - 128) / 128);
  }
  detail::half_turn(set, 0);
  set.antialiased = h.antialiased();
  if (h.antialiased()) set.notes.push_back(name + ": its flag 'antialiased' is kept, but has no effect on pictures");
  if (h.extended() && h.version < 4) detail::check_spz_records(bytes.subspan(h.total()), name);
  if (h.extended()) set.notes.push_back(name + ": the records of other vendors in it are without effect");
  detail::finish(set, name);
  return set;
}

GSP_INLINE SplatSet parse_spz(Bytes bytes, std::string const& name) {
  using namespace detail;
  if (starts_with(bytes, "NGSP")) return parse_spz_data(unpack_spz4(bytes, name), name);
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
    constexpr std::size_t most = std::size_t(1) << 20;
    auto const records = inflater.read_up_to(most);
    data.insert(data.end(), records.begin(), records.end());
    std::array<std::byte, 1> more;
    if (records.size() == most && inflater.read(more) > 0)
      fail(name, "extensions", "are more than 1 MiB, in which one that names other axes could hide; save it without them");
  }
  if (!inflater.at_end())
    fail(name, "unpacked byte " + std::to_string(h.total()),
         "the stream goes on behind its last Gaussian or lacks its end; the count is wrong or the file is cut short");
  return parse_spz_data(data, name);
}

GSP_INLINE SplatSet read_spz(std::filesystem::path const& path) { return parse_spz(read_file(path), path.string()); }

namespace detail {

/// Of w x y z, and then without the largest, which is made positive: x y z w in the order of the file, index of the largest on top, sign
/// and 9 bits of |v| sqrt 2 for each of the others.
inline std::uint32_t pack_spz_rotation(float const* q) {
  std::array<double, 4> const v{q[1], q[2], q[3], q[0]};
  std::size_t largest = 0;
  for (std::size_t k = 1; k < 4; ++k)
    if (std::abs(v[k]) > std::abs(v[largest])) largest = k;
  std::uint32_t packed = static_cast<std::uint32_t>(largest);
  for (std::size_t k = 0; k < 4; ++k) {
    if (k == largest) continue;
    std::uint32_t const sign = (v[k] < 0) != (v[largest] < 0);
    auto const size = static_cast<std::uint32_t>(std::min(511.0, std::round(511 * std::sqrt(2.0) * std::abs(v[k]))));
    packed = packed << 10 | sign << 9 | size;
  }
  return packed;
}

/// What parse_spz_data reads: 16 bytes of header and the arrays.
inline std::vector<std::byte> format_spz_data(SplatSet set, SpzOptions options, std::string const& name) {
  half_turn(set, 0);
  int const fraction_bits = spz_fraction_bits(set);
  if (std::any_of(set.positions.begin(), set.positions.end(), [](float p) { return std::abs(p) > 0x7fffff; }))
    fail(name, "", "a coordinate passes 2^23, the most that .spz holds; scale the set down");
  SpzHeader const h{static_cast<std::uint32_t>(options.version), static_cast<std::uint32_t>(set.size()), set.sh_degree, fraction_bits,
                    set.antialiased ? 1 : 0};
  std::vector<std::byte> out;
  out.reserve(h.total());
  auto const put = [&](std::uint32_t value, int bytes) {
    for (; bytes > 0; --bytes, value >>= 8) out.push_back(static_cast<std::byte>(value & 255));
  };
  auto const put_rounded = [&](double value) { put(static_cast<std::uint32_t>(std::clamp(std::round(value), 0.0, 255.0)), 1); };
  put(0x5053474e, 4);
  put(h.version, 4);
  put(h.count, 4);
  for (int v : {h.degree, h.fraction_bits, h.flags, 0}) put(static_cast<std::uint32_t>(v), 1);
  for (float p : set.positions) put(static_cast<std::uint32_t>(std::lround(std::ldexp(double(p), fraction_bits))), 3);
  for (float o : set.opacities) put_rounded(255.0 * o);
  std::size_t const terms = set.sh_terms();
  for (std::size_t i = 0; i < set.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) put_rounded(255 * (spz_colour_slope * set.sh[3 * terms * i + c] + 0.5));
  for (std::size_t j = 0; j < set.scales.size(); ++j) {
    double const packed = 16 * (std::log(std::max(double(set.scales[j]), 1e-30)) - spz_least_log_scale);
    if (packed > 255.5)
      fail(name, "Gaussian " + std::to_string(j / 3),
           "has the scale " + std::to_string(set.scales[j]) + ", and .spz holds at most 391; scale the set down");
    put_rounded(packed);
  }
  for (std::size_t i = 0; i < set.size(); ++i) {
    float const* const q = &set.quats[4 * i];
    if (options.version >= 3)
      put(pack_spz_rotation(q), 4);
    else
      for (int k = 1; k < 4; ++k) put_rounded(127.5 * (q[0] < 0 ? -q[k] : q[k]) + 127.5);
  }
  for (std::size_t i = 0; i < set.size(); ++i)
    for (std::size_t k = 3; k < 3 * terms; ++k) {
      int const step = 1 << (8 - (k < 12 ? options.sh1_bits : options.sh_bits));
      int const value = static_cast<int>(std::clamp(std::round(128.0 * set.sh[3 * terms * i + k]), -128.0, 127.0)) + 128;
      put(static_cast<std::uint32_t>(std::min(255, (value + step / 2) / step * step)), 1);
    }
  return out;
}

/// What format_spz says; errors begin with `name`.
inline std::vector<std::byte> spz_file(SplatSet const& set, SpzOptions options, std::string const& name) {
  expects(options.version >= 2 && options.version <= 4, "gsp::io::format_spz: version must be 2, 3 or 4");
  expects(options.sh1_bits >= 1 && options.sh1_bits <= 8 && options.sh_bits >= 1 && options.sh_bits <= 8,
          "gsp::io::format_spz: sh1_bits and sh_bits must be 1..8");
  validate(set, name);
  auto const data = format_spz_data(set, options, name);
  if (options.version < 4) return deflate(data, Wrapper::gzip);
  auto const h = parse_spz_header(data, name);
  std::size_t const streams = h.degree ? 6 : 5;
  std::vector<std::byte> out(32 + 16 * streams);
  std::copy_n(data.begin(), 15, out.begin());
  out[15] = static_cast<std::byte>(streams);
  out[16] = std::byte(32);  // where the table of streams is
  for (std::size_t k = 0, at = 16; k < streams; ++k) {
    std::uint64_t const unpacked = h.sizes()[k];
    auto const packed = zstd_pack(Bytes(data).subspan(at, unpacked), 12, name);
    std::array<std::uint64_t, 2> const entry{packed.size(), unpacked};
    std::memcpy(out.data() + 32 + 16 * k, entry.data(), 16);
    out.insert(out.end(), packed.begin(), packed.end());
    at += unpacked;
  }
  return out;
}

}  // namespace detail

GSP_INLINE std::vector<std::byte> format_spz(SplatSet const& set, SpzOptions options) {
  return detail::spz_file(set, options, "gsp::io::format_spz");
}

GSP_INLINE void write_spz(std::filesystem::path const& path, SplatSet const& set, SpzOptions options) {
  write_file(path, detail::spz_file(set, options, path.string()));
}

}  // namespace gsp::io
