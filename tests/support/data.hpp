#pragma once
// Test data that is not part of the project: $GSP_DATA_DIR, else the CMake variable of that name.
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

namespace gsp_test {
/// Path of a file or folder below the data folder; empty when it is missing (skip.hpp).
inline std::optional<std::string> data(std::string const& name) {
  char const* const variable = std::getenv("GSP_DATA_DIR");
  std::filesystem::path const root = variable ? variable : GSP_DATA_DIR;
  if (root.empty()) return std::nullopt;
  std::error_code error;
  if (!std::filesystem::exists(root / name, error)) return std::nullopt;
  return (root / name).string();
}
}  // namespace gsp_test
