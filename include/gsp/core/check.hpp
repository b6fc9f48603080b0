#pragma once
#include <stdexcept>
#include <string>

namespace gsp {

/// What every function of the library throws when its input is wrong: one sentence with the place and the remedy.
struct Error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Precondition of a public function: throws std::invalid_argument with `message` unless `condition` holds.
inline void expects(bool condition, char const* message) {
  if (!condition) throw std::invalid_argument(message);
}
inline void expects(bool condition, std::string const& message) {
  if (!condition) throw std::invalid_argument(message);
}
/// The same for one of several callers: `where` names it. No text is made while all is well: hot calls check, too.
inline void expects(bool condition, char const* where, char const* message) {
  if (!condition) throw std::invalid_argument(std::string(where) + ": " + message);
}

}  // namespace gsp
