#pragma once
#include <cstddef>
#include <filesystem>
#include <functional>
#include <gsp/core/check.hpp>
#include <gsp/model/description.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace gsp::io {

struct MjcfOptions {
  bool skip_visuals = false;   // leave out visual geoms whose mesh is missing; otherwise that is an error
  bool list_refusals = false;  // what is not supported becomes a line of the report instead of an error, and is left out of the description
  bool convex_decomposition = false;  // meshes that are not convex touch as their convex parts (io/convex_parts.hpp), not as their hull
  std::function<std::vector<std::byte>(std::filesystem::path const&)> read = {};  // where files come from; empty: the disk
};

/// MJCF text as a description. `name` stands in messages, and files that the text names are looked for in its folder.
/// Strict: each element and attribute is honoured, refused, or listed in Description::report with the reason.
/// Errors: gsp::Error "FILE:LINE: what is wrong; remedy".
Description parse_mjcf(std::string_view text, std::string const& name, MjcfOptions const& options = {});

/// Reads an MJCF file and the files that it includes or attaches; see parse_mjcf.
Description read_mjcf(std::filesystem::path const& path, MjcfOptions const& options = {});

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/mjcf_impl.hpp>
#endif
