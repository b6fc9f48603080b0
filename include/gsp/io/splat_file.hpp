#pragma once
#include <filesystem>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/splat_set.hpp>
#include <string>
#include <vector>

namespace gsp::io {

/// Gaussians of a `.splat` file: 32 bytes each, no header: float32 position[3], float32 scale[3] (linear), uint8 r g b opacity (/255),
/// uint8 rotation w x y z
/// ((b - 128)/128, any length). SH degree 0. Throws Error where the size is no multiple of 32 or a value is not finite; a cut at a multiple
/// of 32 cannot be seen.
SplatSet parse_splat(Bytes bytes, std::string const& name);

SplatSet read_splat(std::filesystem::path const& path);

/// Bytes of a `.splat` file: position and scale to the bit; colour and opacity within 1/510 (colours beyond 0..1 become these), rotation
/// within 1/256 a component before it is normalised. SH terms above degree 0 and links are left out.
std::vector<std::byte> format_splat(SplatSet const& set);

void write_splat(std::filesystem::path const& path, SplatSet const& set);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/splat_file_impl.hpp>
#endif
