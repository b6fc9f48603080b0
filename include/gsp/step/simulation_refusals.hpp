#pragma once
#include <gsp/collision/collision_model.hpp>
#include <gsp/model/model.hpp>

namespace gsp {

struct RefusalOptions {
  Profile profile = Profile::stable;
  bool approximate = false;  // SimulationOptions::approximate
};

/// Why make_model or make_simulation would refuse `m`, one sentence each; empty: they take it. make_simulation throws the first of them,
/// and `gsp info` judges by them.
inline std::vector<std::string> simulation_refusals(CompiledModel const& m, RefusalOptions options = {}) {
  auto out = model_refusals(m);
  auto const& o = m.option;
  if (options.approximate) return out;
  if (options.profile != Profile::mujoco) return out;
  if (o.integrator == Integrator::rk4 && o.constraint)
    out.push_back(
        "the model names the integrator RK4, which profile mujoco has without constraints alone: choose profile stable, disable "
        "constraints, or say --approximate (SimulationOptions::approximate)");
  if (!o.constraint || !o.contact) return out;
  for (int k = 0; k < m.pair_count(); ++k) {
    auto const [g1, g2] = m.pair_geoms(k);
    auto const p = contact_parameters(m, k);
    if (p.condim <= 1) continue;
    out.push_back("geoms '" + m.geom_name[g1] + "' and '" + m.geom_name[g2] + "' can touch with condim " + std::to_string(p.condim) +
                  ", and profile mujoco has frictionless contact alone: choose profile stable, or say --approximate "
                  "(SimulationOptions::approximate)");
    break;  // one of them says it
  }
  return out;
}

}  // namespace gsp
