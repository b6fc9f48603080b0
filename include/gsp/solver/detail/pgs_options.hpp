#pragma once

namespace gsp {

/// How projected Gauss-Seidel sweeps (solver/pgs.hpp).
struct PgsOptions {
  int iterations = 100;     // sweeps at most
  float tolerance = 1e-6f;  // a world stops when no row changed its rate by more than this in a sweep [m/s, rad/s]; 0: after all sweeps
  float relaxation = 1;
  bool residual = false;  // also measure solution.residual after the last sweep
};

}  // namespace gsp
