#pragma once
#include <gsp/runtime/renderer.hpp>
#include <gsp/splat/gaussians.hpp>

namespace gsp::runtime {

struct Scene::Sets {
  std::vector<GaussianSet> list;
};
inline std::vector<GaussianSet> sets_of(Scene const& scene) { return scene.sets ? scene.sets->list : std::vector<GaussianSet>{}; }

}  // namespace gsp::runtime
