#pragma once
// Scenes of `gsp bench physics`: made in code, or of files below $GSP_DATA_DIR/models, which are read where they are.
#include <gsp/model/description.hpp>
#include <string>
#include <vector>

#include "arguments.hpp"

namespace gsp_cli {

struct PhysicsScene {
  std::string name, what;
  bool needs_files = false;
  gsp::Description (*make)(Arguments const&) = nullptr;
  std::string keyframe = "";     // where all worlds start; empty: the initial pose
  int worlds = 1;                // on a CPU; a GPU gets 8 times as many of scenes of many worlds
  long long from = 0;            // steps before the window
  long long steps = 100;         // of the window
  double noise = 0;              // standard deviation of what is added to each control in each step
  std::string peers = "newton";  // solvers of MuJoCo beside it
};

std::vector<PhysicsScene> physics_scenes();

}  // namespace gsp_cli
