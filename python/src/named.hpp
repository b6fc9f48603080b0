#pragma once
#include <gsp/core/check.hpp>
#include <string>

namespace gsp::python {

/// What the library says, under the name of what Python called.
template <class F>
auto named(std::string const& where, F const& f) {
  std::string text;
  try {
    return f();
  } catch (Error const& e) { text = e.what(); } catch (std::invalid_argument const& e) {
    text = e.what();
  }
  auto const end = text.find(": ");  // of "gsp::render: camera 3 ..."
  bool const says = text.rfind("gsp::", 0) == 0 && end != text.npos && end < text.find(' ');
  throw Error(where + ": " + (says ? text.substr(end + 2) : text));
}

}  // namespace gsp::python
