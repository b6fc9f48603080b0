#pragma once
#include <algorithm>
#include <gsp/io/detail/bytes.hpp>
#include <nlohmann/json.hpp>

namespace gsp::io::detail {

using Json = nlohmann::json;

/// The JSON of `text`, or Error with the line.
inline Json parse_json(std::string_view text, std::string const& name) {
  try {
    return Json::parse(text.begin(), text.end());
  } catch (Json::parse_error const& error) {
    auto const line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(std::min(error.byte, text.size())), '\n');
    fail(name, at_line(static_cast<std::size_t>(line)), "is not valid JSON here; repair it");
  } catch (Json::exception const&) {  // the parser's other refusal
    fail(name, "", "has a number that no double can hold; repair it");
  }
}

}  // namespace gsp::io::detail
