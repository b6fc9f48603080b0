// glTF, .glb and .gltf.
// max_len: 8192
#include <gsp/io/gltf.hpp>

#include "splat_targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  auto const bytes = std::as_bytes(std::span(data, size));
  gsp_fuzz::survive([&] { gsp_fuzz::check(gsp::io::parse_gltf(bytes, "fuzz.glb")); });
  return 0;
}
