#pragma once
#include <filesystem>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/splat_set.hpp>
#include <string>
#include <vector>

namespace gsp::io {

/// Gaussians of PlayCanvas' SOG (Spatially Ordered Gaussians), versions 1 and 2: numbers as pixels of lossless WebP pictures, which
/// meta.json explains. `bytes` are a bundle (.sog, a zip) or the meta.json, whose pictures lie in `folder` (empty: refused). Throws Error
/// where a picture is missing, lossy, too small for the count or far too large for it, or a pixel names an entry that a table does not
/// have; where gsp was compiled without libwebp, for all of them.
SplatSet parse_sog(Bytes bytes, std::string const& name, std::filesystem::path const& folder = {});

/// A .sog, or a meta.json with its pictures beside it.
SplatSet read_sog(std::filesystem::path const& path);

/// Bytes of a bundle of version 2. Neighbours in the set should be near each other (`sort_splats`): the pictures pack better. What comes
/// back differs: positions by half of 1/65535 of the range of sign(x) log(1 + |x|), opacity by 1/510, rotations by 9.6e-3 in the
/// quaternion, log-scales and DC by what 256 values chosen for all of them leave, SH above DC likewise, and of more than 65,536 Gaussians
/// by what 65,536 sets of coefficients chosen for them leave. Links are left out. Cost: some 10 us a Gaussian.
std::vector<std::byte> format_sog(SplatSet const& set);

/// Writes a bundle, or, where the path ends in .json, that as meta.json and the pictures beside it.
void write_sog(std::filesystem::path const& path, SplatSet const& set);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/sog_impl.hpp>
#endif
