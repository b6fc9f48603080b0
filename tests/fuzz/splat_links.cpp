// JSON sidecar that binds Gaussians to links.
#include <gsp/io/splat_links.hpp>

#include "target.hpp"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  gsp_fuzz::survive([&] {
    auto set = gsp::io::make_splat_set(1000, 0);
    gsp::io::bind_links(set, gsp::io::parse_links(std::as_bytes(std::span(data, size)), "fuzz.json"), "fuzz.json");
  });
  return 0;
}
