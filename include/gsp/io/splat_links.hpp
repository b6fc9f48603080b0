#pragma once
#include <filesystem>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/splat_set.hpp>
#include <string>
#include <vector>

namespace gsp::io {

/// `count` Gaussians from `first` on belong to the link `name`.
struct LinkRange {
  std::string name;
  std::size_t first, count;
};

/// The ranges of a JSON sidecar: {"links": [{"name": "FL_foot", "first": 0, "count": 1000}, ...]}. A link may have several ranges. Throws
/// Error for broken JSON (with its line), a missing or unknown key, or a value of the wrong type.
std::vector<LinkRange> parse_links(Bytes bytes, std::string const& name);

std::vector<LinkRange> read_links(std::filesystem::path const& path);

/// The ranges of a set: as many as there are runs of Gaussians of one link.
std::vector<LinkRange> link_ranges(SplatSet const& set);

/// The text of a sidecar with these ranges.
std::string format_links(std::vector<LinkRange> const& ranges);

/// Binds the ranges to their links; Gaussians in no range become static. Replaces what the set had. Throws Error where a range leaves the
/// set or two overlap; `name` is where the ranges come from.
void bind_links(SplatSet& set, std::vector<LinkRange> const& ranges, std::string const& name);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/splat_links_impl.hpp>
#endif
