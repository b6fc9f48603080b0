#pragma once
#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace gsp::io {

struct UrdfOptions {
  bool floating_base = false;         // the root link moves freely; else it is fixed to the world
  bool skip_visuals = false;          // leave out visual meshes; otherwise a mesh that cannot be read is an error
  bool list_refusals = false;         // what is not supported becomes a line of the report instead of an error, and is left out
  bool convex_decomposition = false;  // meshes that are not convex touch as their convex parts (io/convex_parts.hpp), not as their hull
  std::map<std::string, std::filesystem::path> packages = {};  // folder of package://NAME; else the nearest folder above the file that is
                                                               // called NAME or holds one that is
  std::function<std::vector<std::byte>(std::filesystem::path const&)> read = {};  // where files come from; empty: the disk
};

}  // namespace gsp::io
