#pragma once
#include <filesystem>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/splat_set.hpp>
#include <string>

namespace gsp::io {

/// Gaussians of a text file of OpenUSD (.usda): all prims of type ParticleField3DGaussianSplat, in their order, each moved as its
/// xformOps and those of the prims above it say. Axes right-up-back (upAxis "Y") or right-forward-up ("Z") become right-down-forward. What
/// other files, variants and classes hold is left out, with a note. Throws Error with the line for text that is no USD, arrays that are
/// shorter than the positions, values that change in time, or a prim that scales its axes differently.
SplatSet parse_usda(Bytes bytes, std::string const& name);

SplatSet read_usda(std::filesystem::path const& path);

/// Text of such a file: one prim, y up, metersPerUnit 1, float arrays with as many digits as come back to the bit (rotations are normalised
/// again). Links and the flag `antialiased` are left out.
std::string format_usda(SplatSet const& set);

void write_usda(std::filesystem::path const& path, SplatSet const& set);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/usda_impl.hpp>
#endif
