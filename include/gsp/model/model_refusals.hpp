#pragma once
#include <gsp/model/compiled.hpp>
#include <string>
#include <vector>

namespace gsp {

/// Why make_model would refuse `m`, one sentence each; empty: it takes it.
inline std::vector<std::string> model_refusals(CompiledModel const& m) {
  std::vector<std::string> out;
  auto const item = [](auto const& values, int i) {
    return i < int(values.size()) ? values[i] : typename std::decay_t<decltype(values)>::value_type{};
  };
  auto armature = m.tendon_armature;
  for (int k = 0; k < m.nu; ++k) {
    if (item(m.act_actnum, k) > 1)
      out.push_back("actuator '" + m.act_name[k] + "' has " + std::to_string(m.act_actnum[k]) +
                    " activation variables, and one is supported: remove actdim");
    if (Transmission(m.act_target[k]) == Transmission::tendon)
      armature[m.act_id[k]] += m.act_gear[k][0] * m.act_gear[k][0] * item(m.act_armature, k);
  }
  for (int k = 0; k < m.ntendon; ++k) {
    bool wraps = false;
    for (int w = item(m.tendon_wrapadr, k), end = w + item(m.tendon_wrapnum, k); w < end; ++w)
      wraps |= m.wrap_type[w] == int(WrapType::sphere) || m.wrap_type[w] == int(WrapType::cylinder);
    if (wraps && armature[k] != 0)
      out.push_back("tendon '" + m.tendon_name[k] +
                    "' has armature and wraps round a geom, which MuJoCo does not support either: give the armature to its joints");
  }
  return out;
}

}  // namespace gsp
