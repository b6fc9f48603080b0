#pragma once
#include <gsp/core/check.hpp>

namespace gsp {

/// How projected Gauss-Seidel sweeps (solver/pgs.hpp).
struct PgsOptions {
  int iterations = 100;  // sweeps at most
  int least = 4;         // and at least: an island that stopped before it swept would keep a velocity below the tolerance for ever
  // An island stops when no row changed its rate in a sweep by more than this times what gravity does in a step (Rows::rate_scale); 0:
  // after all sweeps.
  float tolerance = 1e-4f;
  float relaxation = 1;
  bool accelerate = true;  // leaps and mixtures (docs/solver/pgs.md); false: sweeps alone
  bool residual = false;   // also measure solution.residual after the last sweep, which is NaN otherwise
};

namespace detail {
/// Options that no solver can keep are refused by whoever takes them, also where the model's profile has the other solver.
inline void expects_options(char const* where, PgsOptions const& o) {
  expects(o.iterations > 0, where, "iterations must be positive");
  expects(o.tolerance >= 0, where, "tolerance must be a number, 0 or more");
  expects(o.relaxation > 0 && o.relaxation < 2, where, "relaxation must be above 0 and below 2: 1 is Gauss-Seidel's own");
}
}  // namespace detail

}  // namespace gsp
