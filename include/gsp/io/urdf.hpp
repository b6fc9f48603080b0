#pragma once
#include <filesystem>
#include <gsp/io/detail/urdf_reader.hpp>
#include <gsp/io/file.hpp>
#include <gsp/model/description.hpp>
#include <string>
#include <string_view>

namespace gsp::io {

/// URDF text as a description. `name` stands in messages, and meshes are looked for in its folder. Links become bodies (a root link called
/// "world" is the world), joints stand in the body of their child link, mimic joints become equalities, effort a limit of what actuators
/// do to the joint. Masses come from <inertial> alone. Strict: each element and attribute is honoured, refused, or listed in
/// Description::report with the reason. Host; cost O(size of the text).
/// Errors: gsp::Error "FILE:LINE: what is wrong; remedy".
inline Description parse_urdf(std::string_view text, std::string const& name, UrdfOptions const& options = {}) {
  detail::mjcf::Files files;
  files.read = options.read ? options.read : [](std::filesystem::path const& path) { return read_file(path); };
  int const file = files.add(name);
  auto const root = detail::mjcf::XmlReader(files, false).parse(detail::as_bytes(text), file);
  return detail::urdf::Reader(files, options).run(root);
}

/// Reads a URDF file and the meshes that it names; see parse_urdf.
inline Description read_urdf(std::filesystem::path const& path, UrdfOptions const& options = {}) {
  auto const bytes = options.read ? options.read(path) : read_file(path);
  return parse_urdf(detail::as_text(bytes), path.string(), options);
}

}  // namespace gsp::io
