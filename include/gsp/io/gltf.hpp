#pragma once
#include <filesystem>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/splat_set.hpp>
#include <string>
#include <vector>

namespace gsp::io {

/// Gaussians of a glTF 2.0 file, binary (.glb) or text (.gltf): all mesh primitives with KHR_gaussian_splatting that nodes of its scene
/// show, in the order of nodes, each moved as its node says. Attributes may be floats or normalised whole numbers, or come packed by
/// KHR_gaussian_splatting_compression_spz(_2). Axes left-up-forward become right-down-forward: x and y change sign, and so do the SH terms
/// of odd order. `folder`: where buffers in files of their own lie; empty: such buffers are refused. Throws Error for numbers that leave
/// the file, a node that scales its axes differently, or what is not KHR_gaussian_splatting as ratified.
SplatSet parse_gltf(Bytes bytes, std::string const& name, std::filesystem::path const& folder = {});

SplatSet read_gltf(std::filesystem::path const& path);

/// Bytes of a .glb, and text of a .gltf with its buffer in it (base64): one node, one primitive, float attributes, which come back to the
/// bit (rotations are normalised again). Links and the flag `antialiased` are left out. Throws Error where a .glb would pass 4 GiB.
std::vector<std::byte> format_glb(SplatSet const& set);
std::string format_gltf(SplatSet const& set);

/// Writes text where the path ends in .gltf, else .glb.
void write_gltf(std::filesystem::path const& path, SplatSet const& set);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/gltf_impl.hpp>
#endif
