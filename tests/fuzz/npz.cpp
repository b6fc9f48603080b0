// npz: the archive as it is, then with every checksum set right, so that mutations reach what the checksums guard.
#include <gsp/io/npz.hpp>

#include "target.hpp"

namespace {
using namespace gsp::io;
/// Sets the CRC of each stored entry that the directory names.
void repair(std::vector<std::byte>& bytes) {
  for (std::size_t at = 0; at + 46 <= bytes.size(); ++at) {
    if (!detail::starts_with(Bytes(bytes).subspan(at), "PK\1\2") || detail::load<std::uint16_t>(bytes, at + 10) != 0) continue;
    std::size_t const packed = detail::load<std::uint32_t>(bytes, at + 20), local = detail::load<std::uint32_t>(bytes, at + 42);
    if (local > bytes.size() || bytes.size() - local < 30) continue;
    std::size_t const data = local + 30 + detail::load<std::uint16_t>(bytes, local + 26) + detail::load<std::uint16_t>(bytes, local + 28);
    if (data > bytes.size() || packed > bytes.size() - data) continue;
    std::uint32_t const crc = detail::crc32(Bytes(bytes).subspan(data, packed));
    std::memcpy(&bytes[at + 16], &crc, 4);
  }
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  auto const input = std::as_bytes(std::span(data, size));
  gsp_fuzz::survive([&] { parse_npz(input, "fuzz.npz"); });
  std::vector<std::byte> repaired(input.begin(), input.end());
  repair(repaired);
  gsp_fuzz::survive([&] { parse_npz(repaired, "fuzz.npz"); });
  return 0;
}
