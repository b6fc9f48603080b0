#pragma once
// Where a robot can stand in a capture, and from where it can be seen.
#include <array>
#include <gsp/io/splat_set.hpp>
#include <gsp/io/splat_transform.hpp>
#include <vector>

namespace gsp_cli {

/// A pose for a capture that is taken with x right, y down, z forward: z up, its floor at z = 0, and at the origin the middle of its widest
/// free piece of floor.
gsp::io::SplatPose standing_pose(gsp::io::SplatSet const& capture);

/// In 72 directions round `center`, how far one can go at the heights low .. high before something of the set stands in the way, or the set
/// ends [m].
std::vector<double> clear_directions(gsp::io::SplatSet const& set, std::array<double, 3> const& center, double low, double high);

}  // namespace gsp_cli
