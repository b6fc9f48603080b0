// .spz as it stands in a file (gzip and version 4), then the same bytes as unpacked data behind an intact gzip layer, which mutations would
// rarely leave whole.
#include <gsp/io/spz.hpp>

#include "splat_targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  auto const bytes = std::as_bytes(std::span(data, size));
  gsp_fuzz::survive([&] { gsp_fuzz::check(gsp::io::parse_spz(bytes, "fuzz.spz")); });
  gsp_fuzz::survive([&] { gsp_fuzz::check(gsp::io::parse_spz_data(bytes, "fuzz.spz")); });
  gsp_fuzz::survive(
      [&] { gsp_fuzz::check(gsp::io::parse_spz(gsp::io::detail::deflate(bytes, gsp::io::detail::Wrapper::gzip, 1), "fuzz.spz")); });
  return 0;
}
