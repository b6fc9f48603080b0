#pragma once
#include <algorithm>
#include <array>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/detail/png_chunks.hpp>
#include <gsp/io/detail/png_passes.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/png.hpp>
#include <optional>

namespace gsp::io {

namespace detail {

inline PngInfo parse_png_header(Bytes h, std::string const& name) {
  PngInfo p{get_be(h, 0), get_be(h, 4), int(h[8]), int(h[9]), 0, int(h[12]) == 1};
  static constexpr std::array<int, 7> channels{1, 0, 3, 1, 2, 0, 4};
  if (p.width == 0 || p.height == 0 || p.width > 0x7fffffff || p.height > 0x7fffffff)
    fail(name, at_byte(16), "width or height is 0 or over 2^31; the file is damaged");
  p.channels = p.color < 7 ? channels[static_cast<std::size_t>(p.color)] : 0;
  bool const depth_ok =
      p.depth == 8 || (p.depth == 16 && p.color != 3) || ((p.depth == 1 || p.depth == 2 || p.depth == 4) && (p.color == 0 || p.color == 3));
  if (p.channels == 0 || !depth_ok || int(h[10]) != 0 || int(h[11]) != 0 || int(h[12]) > 1)
    fail(name, at_byte(24),
         "depth " + std::to_string(p.depth) + " with colour type " + std::to_string(p.color) + " is no PNG format; the file is damaged");
  return p;
}

/// Unpacked and filtered rows -> samples of 16 bits, in place of the pass's pixels. Depths under 8 are left as they are (0..2^depth - 1).
inline void read_png_pass(PngInfo const& p, PngPass const& pass, Bytes data, std::vector<std::uint16_t>& samples, std::string const& name) {
  std::size_t const stride = p.row_bytes(pass.columns(p)), pixel = std::max(1, p.channels * p.depth / 8);
  std::vector<std::uint8_t> row(stride), last(stride, 0);
  for (std::size_t j = 0; j < pass.rows(p); ++j) {
    Bytes const in = data.subspan(j * (stride + 1), stride + 1);
    int const filter = int(in[0]);
    if (filter > 4) fail(name, "row " + std::to_string(j), "its filter " + std::to_string(filter) + " does not exist; the file is damaged");
    for (std::size_t x = 0; x < stride; ++x) {
      int const left = x >= pixel ? row[x - pixel] : 0, corner = x >= pixel ? last[x - pixel] : 0;
      row[x] = static_cast<std::uint8_t>(int(in[x + 1]) + png_predict(filter, left, last[x], corner));
    }
    for (std::size_t i = 0; i < pass.columns(p); ++i)
      for (std::size_t c = 0; c < static_cast<std::size_t>(p.channels); ++c) {
        std::size_t const k = i * p.channels + c, bit = k * p.depth;
        std::uint16_t const v = p.depth == 16 ? static_cast<std::uint16_t>(row[2 * k] << 8 | row[2 * k + 1])
                                              : static_cast<std::uint16_t>(row[bit / 8] >> (8 - p.depth - bit % 8) & ((1 << p.depth) - 1));
        samples[((pass.y0 + j * pass.dy) * p.width + pass.x0 + i * pass.dx) * p.channels + c] = v;
      }
    std::swap(row, last);
  }
}

template <class T>
std::vector<std::byte> png_bytes(Bitmap<T> const& bitmap, PngOptions options, char const* where) {
  expect_bitmap(bitmap, where);
  expects(options.level >= 0 && options.level <= 9, std::string(where) + ": level must be 0..9");
  std::size_t const pixel = sizeof(T) * static_cast<std::size_t>(bitmap.channels);
  auto const packed =
      deflate(filter_rows(png_rows(bitmap), pixel * static_cast<std::size_t>(bitmap.width), pixel), Wrapper::zlib, options.level);
  expects(packed.size() < (1u << 31), std::string(where) + ": the picture is too large for one PNG chunk (2 GiB); split it");
  std::vector<std::byte> out;
  for (char c : png_signature) out.push_back(static_cast<std::byte>(c));
  put_chunk(out, "IHDR", png_header(bitmap.width, bitmap.height, bitmap.channels, 8 * sizeof(T)));
  put_chunk(out, "IDAT", packed);
  put_chunk(out, "IEND", {});
  return out;
}
}  // namespace detail

GSP_INLINE std::vector<std::byte> format_png(Bitmap8 const& bitmap, PngOptions options) {
  return detail::png_bytes(bitmap, options, "gsp::io::format_png");
}
GSP_INLINE std::vector<std::byte> format_png(Bitmap16 const& bitmap, PngOptions options) {
  return detail::png_bytes(bitmap, options, "gsp::io::format_png");
}

GSP_INLINE void write_png(std::filesystem::path const& path, Bitmap8 const& bitmap, PngOptions options) {
  write_file(path, detail::png_bytes(bitmap, options, "gsp::io::write_png"));
}
GSP_INLINE void write_png(std::filesystem::path const& path, Bitmap16 const& bitmap, PngOptions options) {
  write_file(path, detail::png_bytes(bitmap, options, "gsp::io::write_png"));
}

GSP_INLINE Bitmap16 parse_png16(Bytes bytes, std::string const& name, int* depth) {
  using namespace detail;
  if (!starts_with(bytes, png_signature)) fail(name, at_byte(0), "does not start as a PNG does; convert it to PNG");
  std::optional<PngInfo> header;
  std::vector<std::byte> packed;
  Bytes palette;
  for (std::size_t at = 8;;) {
    if (bytes.size() - at < 12) fail(name, at_byte(at), "has no IEND chunk; the file is cut short");
    std::size_t const length = get_be(bytes, at);
    std::string_view const type = as_text(bytes.subspan(at + 4, 4));
    if (length > bytes.size() - at - 12) fail(name, at_byte(at), "chunk " + in_quotes(type) + " is cut short; fetch the file again");
    Bytes const data = bytes.subspan(at + 8, length);
    if (crc32(bytes.subspan(at + 4, length + 4)) != get_be(bytes, at + 8 + length))
      fail(name, at_byte(at), "the checksum of chunk " + in_quotes(type) + " is wrong; the file is damaged");
    if (!header) {
      if (type != "IHDR" || length != 13) fail(name, at_byte(at), "does not begin with its header (IHDR); the file is damaged");
      header = parse_png_header(data, name);
    } else if (type == "PLTE") {
      if (length % 3 != 0 || length > 768) fail(name, at_byte(at), "its palette is damaged; export it again");
      palette = data;
    } else if (type == "IDAT") {
      packed.insert(packed.end(), data.begin(), data.end());
    } else if (type == "IEND") {
      break;
    } else if (!(type[0] & 32)) {
      fail(name, at_byte(at), "chunk " + in_quotes(type) + " is not known but critical; convert it to a plain PNG");
    }
    at += 12 + length;
  }
  PngInfo const& p = *header;
  if (depth) *depth = p.depth;
  auto const passes = png_passes(p);
  // Rows fit 64 bits (2^31 * 64 bits) and so do all (2^31 rows of at most 2^34 bytes): 2^65 does not, so divide first.
  if (p.row_bytes(p.width) + 1 > (std::size_t(1) << 40) / p.height)
    fail(name, at_byte(16), std::to_string(p.width) + " x " + std::to_string(p.height) + " pixels are over 1 TB; the file is damaged");
  std::size_t total = 0;
  for (auto const& pass : passes)
    if (pass.columns(p) > 0) total += pass.rows(p) * (p.row_bytes(pass.columns(p)) + 1);
  auto const short_data = [&] {
    fail(name, at_byte(16),
         "the data does not fill the " + std::to_string(p.width) + " x " + std::to_string(p.height) +
             " pixels announced; the file is cut short or damaged");
  };
  if (!can_inflate_to(packed.size(), total)) short_data();
  Inflater inflater(packed, Wrapper::zlib, name);
  auto const rows = inflater.read_up_to(total);
  if (rows.size() < total || !inflater.at_end()) short_data();
  if (p.color == 3 && palette.empty()) fail(name, at_byte(16), "has a palette type but no palette; export it again");

  std::vector<std::uint16_t> samples(std::size_t(p.width) * p.height * p.channels);
  std::size_t begin = 0;
  for (auto const& pass : passes) {
    if (pass.columns(p) == 0) continue;
    std::size_t const size = pass.rows(p) * (p.row_bytes(pass.columns(p)) + 1);
    read_png_pass(p, pass, Bytes(rows).subspan(begin, size), samples, name);
    begin += size;
  }
  Bitmap16 out{static_cast<int>(p.width), static_cast<int>(p.height), p.color == 3 ? 3 : p.channels, {}};
  if (p.color != 3) {
    int const scale = 65535 / ((1 << p.depth) - 1);  // exact for 1, 2, 4, 8, 16 bits
    for (auto& v : samples) v = static_cast<std::uint16_t>(v * scale);
    out.pixels = std::move(samples);
    return out;
  }
  out.pixels.reserve(samples.size() * 3);
  for (std::uint16_t index : samples) {
    if (index >= palette.size() / 3)
      fail(name, "",
           "a pixel has colour " + std::to_string(index) + " of a palette of " + std::to_string(palette.size() / 3) +
               "; the file is damaged");
    for (std::size_t c = 0; c < 3; ++c) out.pixels.push_back(static_cast<std::uint16_t>(257 * int(palette[3 * index + c])));
  }
  return out;
}

GSP_INLINE Bitmap8 parse_png8(Bytes bytes, std::string const& name) {
  auto const wide = parse_png16(bytes, name);
  Bitmap8 out{wide.width, wide.height, wide.channels, std::vector<std::uint8_t>(wide.pixels.size())};
  std::transform(wide.pixels.begin(), wide.pixels.end(), out.pixels.begin(),
                 [](std::uint16_t v) { return static_cast<std::uint8_t>(v >> 8); });
  return out;
}

GSP_INLINE Bitmap16 read_png16(std::filesystem::path const& path) { return parse_png16(read_file(path), path.string()); }

GSP_INLINE Bitmap8 read_png8(std::filesystem::path const& path) { return parse_png8(read_file(path), path.string()); }

}  // namespace gsp::io
