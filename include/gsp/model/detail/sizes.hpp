#pragma once

namespace gsp::detail {

/// By which two models are told apart where what was made for one meets the other.
struct ModelSizes {
  int nq, nv, nbody, njnt, nu, ntendon, nsite;
  bool operator==(ModelSizes const&) const = default;
};
template <class Model>
ModelSizes sizes_of(Model const& m) {
  return {m.nq, m.nv, m.nbody, m.njnt, m.nu, m.ntendon, m.nsite};
}

}  // namespace gsp::detail
