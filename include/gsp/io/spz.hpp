#pragma once
#include <filesystem>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/splat_set.hpp>
#include <string>
#include <vector>

namespace gsp::io {

/// The unpacked data of a .spz file: a header of 16 bytes, then whole arrays, as in the gzip of versions 1-3. Axes right-up-back become
/// right-down-forward, as 3DGS PLY files have them: y and z of positions and rotations change sign, and so do the SH terms that are odd
/// under (y, z) -> (-y, -z). Throws Error where an extension says that the axes are others.
SplatSet parse_spz_data(Bytes bytes, std::string const& name);

/// Gaussians of a .spz file: versions 1-3 (gzip) and 4 (a stream of zstd for each array, where gsp was compiled with zstd). Throws Error
/// for a damaged or cut stream, or a count that cannot be true. Cost: unpacking and one pass.
SplatSet parse_spz(Bytes bytes, std::string const& name);

SplatSet read_spz(std::filesystem::path const& path);

struct SpzOptions {
  int version = 4;   // 2 or 3 (gzip), or 4 (zstd); 2 keeps rotations with 8 bits a component, 3 and 4 with 10
  int sh1_bits = 5;  // of SH terms of degree 1, and of the others: 1-8. Fewer make smaller files
  int sh_bits = 4;
};

/// Bytes of a .spz file. What comes back differs by at most: positions 2^-(f+1) with f = 12 fraction bits, or as many as the largest
/// coordinate leaves; opacity 1/510; dc 0.0131 (1 / (2 255 0.15)); scale a factor of exp(1/32); SH (2^(8-bits) + 1) / 256; rotation as
/// docs/io/spz.md has it. dc beyond +-3.33, SH terms beyond +-1 and scales below exp(-10) become these bounds. Throws Error where a
/// coordinate reaches 2^23 or a scale passes 391, std::invalid_argument for options out of range. Links are not written.
std::vector<std::byte> format_spz(SplatSet const& set, SpzOptions options = {});

void write_spz(std::filesystem::path const& path, SplatSet const& set, SpzOptions options = {});

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/spz_impl.hpp>
#endif
