#pragma once
#include <gsp/io/ply.hpp>

#include "target.hpp"

namespace gsp_fuzz {
/// What a reader of Gaussians hands on must be valid, and come back from a PLY as it was.
inline void check(gsp::io::SplatSet const& set) {
  gsp::io::validate(set, "fuzz");
  auto const again = gsp::io::parse_ply(gsp::io::format_ply(set), "again");
  require(again.positions == set.positions && again.sh == set.sh && again.link == set.link && again.sh_degree == set.sh_degree);
}
}  // namespace gsp_fuzz
