// STL meshes, their hulls, and what compile makes of them.
// link: -lqhull_r
#include "mesh_targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  gsp_fuzz::try_mesh(std::as_bytes(std::span(data, size)), "fuzz.stl");
  return 0;
}
