#pragma once
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/compressed_ply.hpp>
#include <gsp/io/detail/splat_format.hpp>
#include <gsp/io/detail/splat_losses.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/gltf.hpp>
#include <gsp/io/ply.hpp>
#include <gsp/io/sog.hpp>
#include <gsp/io/splat_file.hpp>
#include <gsp/io/splat_links.hpp>
#include <gsp/io/splat_order.hpp>
#include <gsp/io/splat_set.hpp>
#include <gsp/io/splat_transform.hpp>
#include <gsp/io/splats.hpp>
#include <gsp/io/spz.hpp>
#include <gsp/io/usda.hpp>
#include <optional>

namespace gsp::io {

namespace detail {

inline std::filesystem::path links_of(std::filesystem::path path) { return path += ".links.json"; }
/// FILE.links.json beside FILE, of that file alone: a stem would lend it to room.ply beside room.spz, whose order is another. Where FILE is
/// a symbolic link and none stands beside it: beside what it leads to. Empty: there is none.
inline std::filesystem::path links_beside(std::filesystem::path const& path) {
  std::error_code error;
  for (auto const& name : names_of_file(path))
    if (auto const links = links_of(name); std::filesystem::exists(std::filesystem::symlink_status(links, error))) return links;
  return {};
}
/// Throws Error where links stand beside the file under a stem of its name and none under its name: they could be of any file of that stem.
inline void expect_links_of_a_file(std::filesystem::path const& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (!links_beside(path).empty()) return;
  for (auto const& file : names_of_file(path)) {
    auto const* const format = splat_format_of(file.string());
    std::size_t const ending = format && format->first[0] == '.' ? std::string(format->first).size() : 0;
    for (std::size_t const cut : {ending, file.extension().string().size()}) {  // room.compressed.ply: room, room.compressed
      std::string const name = file.string(), stem = name.substr(0, name.size() - cut);
      fs::path const of_stem = stem + ".links.json";
      if (cut > 0 && fs::exists(of_stem, error) && !fs::is_regular_file(stem, error))  // else they are that file's
        fail(of_stem.string(), "",
             "does not say which file its links are of; rename it '" + links_of(file).string() +
                 "' if they are this file's, or after the file that they are of");
    }
  }
}
/// Where the files lie that one names: in its folder; of SOG behind a symbolic link, where its pictures are, beside the link or beside what
/// it leads to.
inline std::filesystem::path folder_of_parts(std::filesystem::path const& path) {
  std::error_code error;
  auto const names = names_of_file(path);
  for (auto const& name : names)
    if (auto const folder = name.has_parent_path() ? name.parent_path() : std::filesystem::path(".");
        std::filesystem::exists(folder / "means_l.webp", error))
      return folder;
  return path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
}

}  // namespace detail

GSP_INLINE SplatSet parse_splats(Bytes bytes, std::string const& name, std::filesystem::path const& folder) {
  using detail::starts_with;
  if (bytes.empty()) detail::fail(name, "", "the file is empty; fetch it again");
  if (has_ending(name, ".splat")) return parse_splat(bytes, name);
  if (starts_with(bytes, "ply")) return parse_ply(bytes, name);
  if (starts_with(bytes, "\x1f\x8b") || starts_with(bytes, "NGSP")) return parse_spz(bytes, name);
  if (starts_with(bytes, "PK") || detail::is_sog_meta(bytes)) return parse_sog(bytes, name, folder);
  if (starts_with(bytes, "#usda")) return parse_usda(bytes, name);
  if (starts_with(bytes, "PXR-USDC"))
    detail::fail(name, detail::at_byte(0), "is binary USD, which is not read; save it as text (usdcat FILE -o FILE.usda)");
  if (starts_with(bytes, "glTF") || starts_with(bytes, "{")) return parse_gltf(bytes, name, folder);
  detail::fail(
      name, detail::at_byte(0),
      "is no file of Gaussians that is known here; convert it to .ply (3DGS or SuperSplat compressed), .splat, .spz, .sog, .usda or .glb");
}

GSP_INLINE SplatSet read_splats(std::filesystem::path const& path) {
  detail::expect_links_of_a_file(path);
  SplatSet set = parse_splats(read_file(path), path.string(), detail::folder_of_parts(path));
  if (auto const sidecar = detail::links_beside(path); !sidecar.empty()) bind_links(set, read_links(sidecar), sidecar.string());
  return set;
}

GSP_INLINE void expect_splats_writable(std::filesystem::path const& path) {
  if (!detail::splat_format_of(path.string()))
    detail::fail(path.string(), "",
                 "its ending names no format of Gaussians that is written here; end it in .ply, .compressed.ply, .splat, .spz, .glb, "
                 ".gltf, .sog or .usda, or call it meta.json");
  detail::expect_links_of_a_file(path);  // it could not be read again
  expect_writable(path);
}

GSP_INLINE std::vector<std::string> write_splats(std::filesystem::path const& path, SplatSet set, WriteSplatsOptions const& options) {
  using enum detail::SplatFormat;
  std::string const name = path.string();
  validate(set, name);
  expect_splats_writable(path);
  auto const format = detail::splat_format_of(name)->second;
  bool const is_ply = format == ply || format == compressed_ply;
  std::vector<std::string> notes;
  auto const note = [&](std::string const& text) { notes.push_back(name + ": " + text); };
  if (set.antialiased && !is_ply && format != spz && format != sog)
    note("the flag 'antialiased' is left out; the format has no place for it");
  if (format == splat && set.sh_degree > 0) note("SH terms above degree 0 are left out; the format has no place for them");
  detail::note_clipped(set, format, options.spz, note);
  if (format == compressed_ply || format == sog) sort_splats(set);
  detail::note_coarse(set, format, note);

  auto const ranges = link_ranges(set);
  auto const target = detail::output_target(path);  // behind symbolic links, as the Gaussians are
  auto const sidecar = detail::links_of(target.path);
  std::optional<AtomicFile> links;  // written before the Gaussians, named after them
  if (!is_ply && !ranges.empty()) links.emplace(sidecar).write(format_links(ranges));
  if (format == ply) write_ply(path, set);
  if (format == compressed_ply) write_compressed_ply(path, set);
  if (format == splat) write_splat(path, set);
  if (format == spz) write_spz(path, set, options.spz);
  if (format == gltf) write_gltf(path, set);
  if (format == sog) write_sog(path, set);
  if (format == usda) write_usda(path, set);
  try {
    if (links) links->commit();
  } catch (...) {
    std::error_code error;
    std::filesystem::remove(sidecar, error);
    throw;
  }
  for (auto const& there : detail::names_of_file(path)) {  // links that were there are of what was there
    auto const old = detail::links_of(there);
    std::error_code error;
    if (!target.direct && !(links && old == sidecar)) std::filesystem::remove(old, error);
    if (error)
      detail::fail(old.string(), "", "is of the Gaussians that were there, and cannot be removed (" + error.message() + "); remove it");
  }
  return notes;
}

}  // namespace gsp::io
