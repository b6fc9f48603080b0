#pragma once
#include <cstddef>
#include <filesystem>
#include <gsp/io/bitmap.hpp>
#include <gsp/io/detail/bytes.hpp>
#include <string>
#include <vector>

namespace gsp::io {

struct PngOptions {
  int level = 6;  // zlib's, 0..9
};

/// Bytes of a PNG: 8 or 16 bits, 1-4 channels. No time stamps: the same picture gives the same bytes.
std::vector<std::byte> format_png(Bitmap8 const& bitmap, PngOptions options = {});
std::vector<std::byte> format_png(Bitmap16 const& bitmap, PngOptions options = {});

/// Writes a PNG, all or nothing.
void write_png(std::filesystem::path const& path, Bitmap8 const& bitmap, PngOptions options = {});
void write_png(std::filesystem::path const& path, Bitmap16 const& bitmap, PngOptions options = {});

/// A picture of a PNG file as 16-bit values: all colour types, depths 1-16, interlaced or not. 8-bit values v become 257 v, smaller depths
/// likewise span 0..65535; a palette becomes r g b (its transparency is left out). `depth`, where given, takes the file's bits per sample.
/// Throws Error where the file is cut short, damaged (CRC), or its size cannot be true.
Bitmap16 parse_png16(Bytes bytes, std::string const& name, int* depth = nullptr);

/// The same in 8 bits: the high byte.
Bitmap8 parse_png8(Bytes bytes, std::string const& name);

Bitmap16 read_png16(std::filesystem::path const& path);

Bitmap8 read_png8(std::filesystem::path const& path);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/png_impl.hpp>
#endif
