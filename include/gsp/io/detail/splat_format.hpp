#pragma once
#include <array>
#include <filesystem>
#include <gsp/io/file.hpp>
#include <string>
#include <utility>

namespace gsp::io::detail {

/// What write_splats writes.
enum class SplatFormat { compressed_ply, ply, splat, spz, gltf, sog, usda };

/// By endings, longer ones first where one ends in another. Null where `path` has none of them.
inline std::pair<char const*, SplatFormat> const* splat_format_of(std::string const& path) {
  using enum SplatFormat;
  static constexpr std::array<std::pair<char const*, SplatFormat>, 9> formats{{{".compressed.ply", compressed_ply},
                                                                               {".ply", ply},
                                                                               {".splat", splat},
                                                                               {".spz", spz},
                                                                               {".glb", gltf},
                                                                               {".gltf", gltf},
                                                                               {".sog", sog},
                                                                               {"meta.json", sog},
                                                                               {".usda", usda}}};
  for (auto const& format : formats)
    if (format.first[0] == '.' ? has_ending(path, format.first) : std::filesystem::path(path).filename() == format.first) return &format;
  return nullptr;
}

}  // namespace gsp::io::detail
