// 3DGS and SuperSplat PLY, binary and text.
#include "splat_targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  gsp_fuzz::survive([&] { gsp_fuzz::check(gsp::io::parse_ply(std::as_bytes(std::span(data, size)), "fuzz.ply")); });
  return 0;
}
