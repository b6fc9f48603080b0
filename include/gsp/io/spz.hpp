#pragma once
#include <filesystem>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/splat_set.hpp>
#include <string>

namespace gsp::io {

/// The unpacked data of a .spz file: header, then whole arrays. Axes right-up-back become right-down-forward, as 3DGS PLY files have them:
/// y and z of positions and rotations change sign, and so do the SH terms that are odd under (y, z) -> (-y, -z).
SplatSet parse_spz_data(Bytes bytes, std::string const& name);

/// Gaussians of a .spz file, versions 1-3 (gzip). Throws Error for version 4 (other container), a damaged or cut stream, or a count that
/// cannot be true. Cost: one inflate and one pass.
SplatSet parse_spz(Bytes bytes, std::string const& name);

SplatSet read_spz(std::filesystem::path const& path);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/spz_impl.hpp>
#endif
