// Text files of USD.
#include <gsp/io/usda.hpp>

#include "splat_targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  auto const bytes = std::as_bytes(std::span(data, size));
  gsp_fuzz::survive([&] { gsp_fuzz::check(gsp::io::parse_usda(bytes, "fuzz.usda")); });
  return 0;
}
