// SOG: a bundle as it is; then the bytes as the meta.json, and as each picture, of a sound bundle, where no checksum stands before them.
// max_len: 20000
#include <gsp/io/sog.hpp>
#include <io/fixtures.hpp>

#include "splat_targets.hpp"

namespace {
using namespace gsp::io;
using Files = std::vector<std::pair<std::string, std::vector<std::byte>>>;

std::vector<std::byte> zip(Files const& files) {
  std::string out;
  std::vector<detail::ZipRecord> records;
  for (auto const& [name, bytes] : files) {
    records.push_back({name, detail::crc32(bytes), bytes.size(), bytes.size(), out.size(), false});
    out += detail::zip_local(records.back()) + std::string(detail::as_text(bytes));
  }
  return gsp_test::bytes_of(out + detail::zip_tail(records, out.size()));
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  auto const bytes = std::as_bytes(std::span(data, size));
  static Files const sound = detail::sog_files(gsp_test::random_set(2, 1)).files;
  gsp_fuzz::survive([&] { gsp_fuzz::check(parse_sog(bytes, "fuzz.sog")); });
  bool const text = detail::starts_with(bytes, "{"), picture = detail::starts_with(bytes, "RIFF");
  for (std::size_t k = 0; k < sound.size(); ++k) {
    if (sound[k].first == "meta.json" ? !text : !picture) continue;
    auto files = sound;
    files[k].second.assign(bytes.begin(), bytes.end());
    gsp_fuzz::survive([&] { gsp_fuzz::check(parse_sog(zip(files), "fuzz.sog")); });
  }
  return 0;
}
