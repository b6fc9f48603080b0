#pragma once
#include <filesystem>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/splat_set.hpp>
#include <string>
#include <vector>

namespace gsp::io {

/// Gaussians of a PLY file: the 3DGS layout (SH 0-3, binary little endian or text) or SuperSplat's compressed one, with the optional
/// property `link` and its names (docs/io/ply.md). `name` is what messages call the file. Throws Error for anything else, a file cut short,
/// a wrong count, or a value that is not finite. Cost: one pass.
SplatSet parse_ply(Bytes bytes, std::string const& name);

SplatSet read_ply(std::filesystem::path const& path);

/// Bytes of a 3DGS PLY: float32, binary little endian, with `link` where any Gaussian is bound. Opacities of 0 and 1 become logits of -104
/// and 20, which are these as floats, scales below 1.2e-38 that number, so that no value is infinite; all else comes back from parse_ply
/// within float rounding (opacity and scale pass through a logarithm).
std::vector<std::byte> format_ply(SplatSet const& set);

void write_ply(std::filesystem::path const& path, SplatSet const& set);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/ply_impl.hpp>
#endif
