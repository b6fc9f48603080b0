#pragma once
#include <filesystem>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/ply.hpp>
#include <gsp/io/splat_file.hpp>
#include <gsp/io/splat_links.hpp>
#include <gsp/io/splat_set.hpp>
#include <gsp/io/splat_transform.hpp>
#include <gsp/io/spz.hpp>
#include <string>

namespace gsp::io {

/// Gaussians from the bytes of any file that we read: told by its first bytes (PLY, .spz), or, since it has no mark, by the ending `.splat`
/// of `name`.
SplatSet parse_splats(Bytes bytes, std::string const& name);

/// Gaussians of a file (.ply, .compressed.ply, .splat, .spz). Where a file of the same name ending in `.links.json` stands beside it
/// (scene.ply -> scene.links.json), its ranges bind Gaussians to links and replace a PLY's own. Throws Error with file, place and remedy.
SplatSet read_splats(std::filesystem::path const& path);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/splats_impl.hpp>
#endif
