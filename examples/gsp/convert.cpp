// gsp convert: Gaussians from any file that is read to any that is written.
#include <cstdio>
#include <filesystem>
#include <gsp/io/splats.hpp>

#include "commands.hpp"
#include "files.hpp"

namespace gsp_cli {
namespace {

/// Leaves out the SH terms above `degree`.
void lower_degree(gsp::io::SplatSet& set, int degree) {
  if (set.sh_degree <= degree) return;
  std::size_t const old = 3 * set.sh_terms();
  set.sh_degree = degree;
  std::size_t const now = 3 * set.sh_terms();
  for (std::size_t i = 0; i < set.size(); ++i)
    std::copy_n(set.sh.begin() + static_cast<std::ptrdiff_t>(i * old), now, set.sh.begin() + static_cast<std::ptrdiff_t>(i * now));
  set.sh.resize(set.size() * now);
}

std::string megabytes(std::string const& path) {
  std::error_code error;
  auto const size = std::filesystem::file_size(path, error);
  char text[32];
  std::snprintf(text, sizeof text, "%.3g MB", error ? 0. : double(size) / 1e6);
  return text;
}

int run(Arguments const& arguments) {
  std::string const &from = arguments.operands()[0], &to = arguments.operands()[1];
  gsp::io::WriteSplatsOptions options;
  options.spz.version = static_cast<int>(arguments.integer("--spz-version", options.spz.version, 2, 4));
  int const degree = static_cast<int>(arguments.integer("--sh-degree", 3, 0, 3));
  if (arguments.has("--spz-version") && !gsp::io::has_ending(to, ".spz"))
    arguments.fail("--spz-version is for .spz files, and " + in_quotes(to) + " is none; leave it out");
  gsp::io::expect_splats_writable(to);
  expect_apart({{"FROM", from}}, {{"TO", to}});
  auto set = gsp::io::read_splats(from);
  lower_degree(set, degree);
  auto notes = set.notes;
  for (auto const& n : gsp::io::write_splats(to, set, options)) notes.push_back(n);
  if (arguments.has("--quiet")) return 0;
  std::printf("%s (%s) -> %s (%s): %zu Gaussians, SH degree %d\n", from.c_str(), megabytes(from).c_str(), to.c_str(), megabytes(to).c_str(),
              set.size(), set.sh_degree);
  for (auto const& n : notes) std::printf("  %s\n", n.c_str());
  return 0;
}

}  // namespace

Command convert_command() {
  return {"convert",
          "FROM TO",
          "writes Gaussians of a file in the format that the ending of TO names (.ply, .compressed.ply, .splat, .spz, .glb, .gltf, .sog, "
          "meta.json, .usda), and "
          "says what that "
          "format has no place "
          "for; links stand in a PLY itself, else in TO.links.json beside it",
          2,
          2,
          {{"--sh-degree", "D", "leave out SH terms above degree D (0-3)"},
           {"--spz-version", "V", "of a .spz file: 4 (the default; zstd), 3 or 2 (gzip, for older viewers)"},
           {"--quiet", "", "say nothing"}},
          run};
}

}  // namespace gsp_cli
