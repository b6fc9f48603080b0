#pragma once

namespace gsp {

/// How projected Gauss-Seidel sweeps (solver/pgs.hpp).
struct PgsOptions {
  int iterations = 100;  // sweeps at most
  int least = 4;         // and at least: a world that stopped before it swept would keep a velocity below the tolerance for ever
  // A world stops when no row changed its rate in a sweep by more than this times what gravity does in a step (Rows::rate_scale); 0: after
  // all sweeps.
  float tolerance = 1e-4f;
  float relaxation = 1;
  bool residual = false;  // also measure solution.residual after the last sweep, which is NaN otherwise
};

}  // namespace gsp
