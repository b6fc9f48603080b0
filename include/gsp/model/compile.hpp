#pragma once
#include <gsp/core/check.hpp>
#include <gsp/model/compiled.hpp>

namespace gsp {

/// What the compiler leaves to the step.
struct CompileOptions {
  int listed_pairs = 1'000'000;  // more pairs of geoms that may touch are not listed but searched for (CompiledModel::pairs_searched)
};

/// Turns a description into flat arrays by MuJoCo's rules: masses and principal axes of inertia from geoms, weld groups, initial pose,
/// order of degrees of freedom, trees, pairs of geoms that may touch, named pairs, and what follows from the mass matrix in the initial
/// pose (invweight0, acc0, lengths of tendons and actuators, data of equality constraints, springdamper, dampratio). Host, double. Cost:
/// O(pairs of geoms that are listed) + O(n^3) for each tree of n degrees of freedom. Errors: gsp::Error "FILE:LINE: what is wrong: remedy".
CompiledModel compile(Description const& description, CompileOptions options = {});

}  // namespace gsp

#if !defined(GSP_COMPILED)
#include <gsp/model/detail/compile_impl.hpp>
#endif
