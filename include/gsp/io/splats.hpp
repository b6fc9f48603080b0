#pragma once
#include <filesystem>
#include <gsp/io/compressed_ply.hpp>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/gltf.hpp>
#include <gsp/io/ply.hpp>
#include <gsp/io/sog.hpp>
#include <gsp/io/splat_file.hpp>
#include <gsp/io/splat_links.hpp>
#include <gsp/io/splat_order.hpp>
#include <gsp/io/splat_set.hpp>
#include <gsp/io/splat_transform.hpp>
#include <gsp/io/spz.hpp>
#include <gsp/io/usda.hpp>
#include <string>
#include <vector>

namespace gsp::io {

/// Gaussians from the bytes of any file that we read: told by its first bytes (PLY, .spz, glTF, SOG, USD), or, since it has no mark, by the
/// ending `.splat` (or .SPLAT) of `name`. `folder`: where the files lie that this one names; empty: they are refused.
SplatSet parse_splats(Bytes bytes, std::string const& name, std::filesystem::path const& folder = {});

/// Gaussians of a file: .ply (3DGS or SuperSplat's compressed one), .splat, .spz, .glb, .gltf, .sog or SOG's meta.json, .usda. Where its
/// name with `.links.json` behind stands beside it (scene.spz -> scene.spz.links.json), or, where `path` is a symbolic link, beside the
/// file that it leads to, that file's ranges bind Gaussians to links and replace a PLY's own. Throws Error with file, place and remedy, and
/// for a scene.links.json, which does not say of which file it is.
SplatSet read_splats(std::filesystem::path const& path);

struct WriteSplatsOptions {
  SpzOptions spz;  // of .spz files
};

/// Writes a set in the format that the ending of `path` names: .ply (3DGS), .compressed.ply, .splat, .spz, .glb, .gltf, .sog, meta.json
/// (SOG, with pictures beside it) or .usda. Links stand in PLY files themselves, else in a sidecar FILE.links.json beside the file (behind
/// symbolic links); one that was there goes with what was there. Compressed PLY and SOG order the Gaussians by `sort_splats`. Returns one
/// sentence each: what the format has no place for; how many Gaussians have colours, SH terms or scales beyond those that it holds, which
/// are clipped; and of how many the steps that it rounds to move the place by more than their size (compressed PLY, .spz, SOG), or the
/// colour by more than 1/255 (compressed PLY). Throws Error for another ending, beside a scene.links.json, and as the format's own function
/// does. Nothing that was there is replaced before the new file is complete.
std::vector<std::string> write_splats(std::filesystem::path const& path, SplatSet set, WriteSplatsOptions const& options = {});

/// Throws Error where write_splats would because of the path: for a program to ask before long work.
void expect_splats_writable(std::filesystem::path const& path);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/splats_impl.hpp>
#endif
