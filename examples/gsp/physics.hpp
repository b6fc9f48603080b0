#pragma once
#include "arguments.hpp"

namespace gsp_cli {

/// The options that `gsp bench physics` takes and the other benches do not.
std::vector<Option> physics_options();
/// The scenes of --scene one after the other, beside MuJoCo with --peers.
int bench_physics(Arguments const& arguments);

}  // namespace gsp_cli
