// MJCF: the text as it is; files that it names are the text again. What is read is compiled, written, and read once more.
// link: -lpugixml -lqhull_r
#include <algorithm>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>

#include "target.hpp"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  using namespace gsp;
  auto const input = std::as_bytes(std::span(data, size));
  bool const lenient = size % 2 == 0;
  io::MjcfOptions options{.skip_visuals = lenient, .list_refusals = size % 3 == 0};
  options.read = [&](std::filesystem::path const&) { return std::vector<std::byte>(input.begin(), input.end()); };
  gsp_fuzz::survive([&] {
    auto d = io::parse_mjcf(io::detail::as_text(input), "fuzz.xml", options);
    std::size_t geoms = 0, joints = 0;
    for (auto const& b : d.bodies) geoms += b.geoms.size(), joints += b.joints.size();
    if (geoms > 500 || joints > 100) return;  // slow, not wrong
    auto& search = d.compiler.length_range;   // a few steps of it
    search.timestep = 0.01;
    search.total = std::min(search.total, 0.2);
    auto const m = compile(d);
    for (auto const& pair : m.pairs) gsp_fuzz::require(pair[0] >= 0 && pair[1] < m.ngeom && m.geom_type[pair[0]] <= m.geom_type[pair[1]]);
    for (double w : m.dof_invweight0) gsp_fuzz::require(w >= 0);
    auto const again = io::parse_mjcf(io::format_mjcf(d), "again.xml");
    gsp_fuzz::require(again.bodies.size() == d.bodies.size() && again.actuators.size() == d.actuators.size());
  });
  return 0;
}
