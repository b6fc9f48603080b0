#pragma once
#include <filesystem>
#include <gsp/core/check.hpp>
#include <gsp/model/description.hpp>
#include <string>

namespace gsp::io {

/// A description as MJCF text, which MuJoCo and read_mjcf load to the same numbers: no default classes, angles in radians, every number in
/// the shortest form that reads back the same, meshes and height fields in the text. Joints and bodies that tendons, actuators and excludes
/// name need names. O(size). Not written, as MJCF has no word for it: the report.
std::string format_mjcf(Description const& description);

/// Writes it under `path`, all or nothing.
void write_mjcf(std::filesystem::path const& path, Description const& description);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/write_mjcf_impl.hpp>
#endif
