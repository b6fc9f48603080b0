// PNG: as it is; with every chunk's checksum set right; and as 13 bytes of header with the rest as rows behind an intact zlib layer.
#include <gsp/io/png.hpp>

#include "target.hpp"

namespace {
using namespace gsp::io;
void try_parse(Bytes bytes) {
  gsp_fuzz::survive([&] {
    auto const b = parse_png16(bytes, "fuzz.png");
    expect_bitmap(b, "fuzz");
    gsp_fuzz::require(parse_png16(format_png(b, {.level = 1}), "again").pixels == b.pixels);
  });
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  auto const input = std::as_bytes(std::span(data, size));
  try_parse(input);

  std::vector<std::byte> repaired(input.begin(), input.end());
  for (std::size_t at = 8; at + 12 <= repaired.size();) {
    std::size_t const length = detail::get_be(repaired, at);
    if (length > repaired.size() - at - 12) break;
    std::vector<std::byte> crc;
    detail::put_be(crc, detail::crc32(Bytes(repaired).subspan(at + 4, length + 4)));
    std::copy(crc.begin(), crc.end(), repaired.begin() + static_cast<std::ptrdiff_t>(at + 8 + length));
    at += 12 + length;
  }
  try_parse(repaired);

  if (size < 13) return 0;
  std::vector<std::byte> made;
  for (char c : detail::png_signature) made.push_back(static_cast<std::byte>(c));
  detail::put_chunk(made, "IHDR", input.first(13));
  detail::put_chunk(made, "PLTE", input.subspan(13, (size - 13) / 6 / 3 * 3 < 768 ? (size - 13) / 6 / 3 * 3 : 768));
  detail::put_chunk(made, "IDAT", detail::deflate(input.subspan(13), detail::Wrapper::zlib, 1));
  detail::put_chunk(made, "IEND", {});
  try_parse(made);
  return 0;
}
