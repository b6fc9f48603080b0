#pragma once
#include <filesystem>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/detail/urdf_reader.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/urdf.hpp>
#include <gsp/model/description.hpp>
#include <string>
#include <string_view>

namespace gsp::io {

GSP_INLINE Description parse_urdf(std::string_view text, std::string const& name, UrdfOptions const& options) {
  detail::mjcf::Files files;
  files.read = options.read ? options.read : [](std::filesystem::path const& path) { return read_file(path); };
  int const file = files.add(name);
  auto const root = detail::mjcf::XmlReader(files, false).parse(detail::as_bytes(text), file);
  return detail::urdf::Reader(files, options).run(root);
}

GSP_INLINE Description read_urdf(std::filesystem::path const& path, UrdfOptions const& options) {
  auto const bytes = options.read ? options.read(path) : read_file(path);
  return parse_urdf(detail::as_text(bytes), path.string(), options);
}

}  // namespace gsp::io
