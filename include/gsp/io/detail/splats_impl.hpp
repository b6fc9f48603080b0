#pragma once
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/ply.hpp>
#include <gsp/io/splat_file.hpp>
#include <gsp/io/splat_links.hpp>
#include <gsp/io/splat_set.hpp>
#include <gsp/io/splat_transform.hpp>
#include <gsp/io/splats.hpp>
#include <gsp/io/spz.hpp>

namespace gsp::io {

GSP_INLINE SplatSet parse_splats(Bytes bytes, std::string const& name) {
  if (bytes.empty()) detail::fail(name, "", "the file is empty; fetch it again");
  if (name.ends_with(".splat")) return parse_splat(bytes, name);
  if (detail::starts_with(bytes, "ply")) return parse_ply(bytes, name);
  if (detail::starts_with(bytes, "\x1f\x8b") || detail::starts_with(bytes, "NGSP")) return parse_spz(bytes, name);
  detail::fail(
      name, detail::at_byte(0),
      "is no file of Gaussians that is known here; convert it to .ply (3DGS or SuperSplat compressed), .splat or .spz (version 2 or 3)");
}

GSP_INLINE SplatSet read_splats(std::filesystem::path const& path) {
  SplatSet set = parse_splats(read_file(path), path.string());
  auto sidecar = path;
  sidecar.replace_extension(".links.json");
  std::error_code error;
  if (std::filesystem::exists(sidecar, error)) bind_links(set, read_links(sidecar), sidecar.string());
  return set;
}

}  // namespace gsp::io
