#pragma once
#include <gsp/io/splats.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/splat/gaussians.hpp>

namespace gsp::io {

/// A set as readers deliver it, with links named, to one with body indices: link names are matched with those of the model's bodies; what
/// is bound to no link is static (body 0). Throws Error where the model has no body of a name. `name` is what the message calls the set.
inline GaussianSet to_gaussian_set(SplatSet const& set, CompiledModel const& model, std::string const& name) {
  std::vector<int> body_of(set.link_names.size(), -1);
  for (std::size_t l = 0; l < set.link_names.size(); ++l)
    for (std::size_t b = 0; b < model.body_name.size(); ++b)
      if (model.body_name[b] == set.link_names[l]) body_of[l] = static_cast<int>(b);
  GaussianSet out{set.sh_degree, set.positions, set.quats, set.scales, set.opacities, set.sh, std::vector<int>(set.size(), 0)};
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (set.link[i] < 0) continue;
    out.body[i] = body_of[static_cast<std::size_t>(set.link[i])];
    if (out.body[i] < 0)
      throw Error(name + ": Gaussian " + std::to_string(i) + " is bound to the link '" +
                  set.link_names[static_cast<std::size_t>(set.link[i])] + "', but " +
                  (model.nbody == 0 ? std::string("no model is given") : "the model '" + model.name + "' has no body of that name") +
                  "; name the model that it belongs to, or bind it to another link");
  }
  return out;
}

/// The same for a scene without a robot: throws Error if anything is bound to a link.
inline GaussianSet to_gaussian_set(SplatSet const& set, std::string const& name) { return to_gaussian_set(set, CompiledModel{}, name); }

}  // namespace gsp::io
