#pragma once
#include <filesystem>
#include <gsp/core/check.hpp>
#include <gsp/io/detail/urdf_options.hpp>
#include <gsp/model/description.hpp>
#include <string>
#include <string_view>

namespace gsp::io {

/// URDF text as a description. `name` stands in messages, and meshes are looked for in its folder. Links become bodies (a root link called
/// "world" is the world), joints stand in the body of their child link, mimic joints become equalities, effort a limit of what actuators
/// do to the joint. Masses come from <inertial> alone. Strict: each element and attribute is honoured, refused, or listed in
/// Description::report with the reason. Host; cost O(size of the text).
/// Errors: gsp::Error "FILE:LINE: what is wrong; remedy".
Description parse_urdf(std::string_view text, std::string const& name, UrdfOptions const& options = {});

/// Reads a URDF file and the meshes that it names; see parse_urdf.
Description read_urdf(std::filesystem::path const& path, UrdfOptions const& options = {});

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/urdf_impl.hpp>
#endif
