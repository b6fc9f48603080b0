// URDF: the text as it is; meshes that it names are the text again. What is read is compiled.
// link: -lpugixml -lqhull_r
#include <gsp/io/urdf.hpp>
#include <gsp/model/compile.hpp>

#include "target.hpp"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  using namespace gsp;
  auto const input = std::as_bytes(std::span(data, size));
  io::UrdfOptions options{.floating_base = size % 5 == 0, .skip_visuals = size % 2 == 0, .list_refusals = size % 3 == 0};
  options.read = [&](std::filesystem::path const&) { return std::vector<std::byte>(input.begin(), input.end()); };
  gsp_fuzz::survive([&] {
    auto const d = io::parse_urdf(io::detail::as_text(input), "fuzz.urdf", options);
    std::size_t geoms = 0, joints = 0;
    for (auto const& b : d.bodies) geoms += b.geoms.size(), joints += b.joints.size();
    for (std::size_t b = 1; b < d.bodies.size(); ++b) gsp_fuzz::require(d.bodies[b].parent >= 0 && d.bodies[b].parent < int(b));
    if (geoms > 500 || joints > 100) return;  // slow, not wrong
    auto const m = compile(d);
    for (double w : m.dof_invweight0) gsp_fuzz::require(w >= 0);
  });
  return 0;
}
