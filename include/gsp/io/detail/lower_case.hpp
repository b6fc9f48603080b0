#pragma once
#include <string>

namespace gsp::io::detail {

/// Of ASCII, as endings of names are compared.
inline std::string lower_case(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

}  // namespace gsp::io::detail
