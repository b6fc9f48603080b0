#pragma once
#include <filesystem>
#include <gsp/io/detail/bytes.hpp>

namespace gsp::io::detail {

/// A file that `name` refers to by `uri`, beside it: a plain path below its folder.
inline std::filesystem::path file_beside(std::filesystem::path const& folder, std::string const& uri, std::string const& name,
                                         std::string const& place) {
  std::string text;
  auto const hex = [](char c) {
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
  };
  for (std::size_t i = 0; i < uri.size(); ++i) {
    bool const escaped = uri[i] == '%' && i + 2 < uri.size() && hex(uri[i + 1]) >= 0 && hex(uri[i + 2]) >= 0;
    text += escaped ? static_cast<char>(16 * hex(uri[i + 1]) + hex(uri[i + 2])) : uri[i];
    if (escaped) i += 2;
  }
  std::filesystem::path const path = text;
  bool plain = !text.empty() && !path.is_absolute() && text.find(':') == text.npos && text.find('\0') == text.npos;
  for (auto const& part : path) plain = plain && part != "..";
  if (!plain) fail(name, place, in_quotes(uri) + " is no path below the file's own folder; put the data there");
  if (folder.empty()) fail(name, place, "names the file " + in_quotes(uri) + ", and only one file was given; use a .glb, or give its path");
  return folder / path;
}

}  // namespace gsp::io::detail
