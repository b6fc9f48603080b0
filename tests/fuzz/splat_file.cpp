// .splat
#include <gsp/io/splat_file.hpp>

#include "splat_targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  gsp_fuzz::survive([&] { gsp_fuzz::check(gsp::io::parse_splat(std::as_bytes(std::span(data, size)), "fuzz.splat")); });
  return 0;
}
