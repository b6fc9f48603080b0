#pragma once

namespace gsp::detail {

/// By which models are told apart where what was made for one meets another: all that is indexed. Models of the same sizes are not.
struct ModelSizes {
  int nq, nv, nbody, njnt, nu, ntendon, nsite, ngeom, ncam, ntree;
  bool operator==(ModelSizes const&) const = default;
};
template <class Model>
ModelSizes sizes_of(Model const& m) {
  return {m.nq, m.nv, m.nbody, m.njnt, m.nu, m.ntendon, m.nsite, m.ngeom, m.ncam, m.ntree};
}

}  // namespace gsp::detail
