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

namespace detail {
/// How many worlds, degrees of freedom ... one of several arguments has.
struct Count {
  char const* argument;
  int count;
};
/// The others have as many `things` as the first; else one sentence with the numbers of the two that differ.
template <class... Counts>
void expects_as_many(char const* where, char const* things, char const* remedy, Count const& first, Counts const&... others) {
  auto const check = [&](Count const& c) {
    if (c.count != first.count)
      throw std::invalid_argument(std::string(where) + ": the numbers of " + things + " differ: " + first.argument + " " +
                                  std::to_string(first.count) + ", " + c.argument + " " + std::to_string(c.count) + ": " + remedy);
  };
  (check(others), ...);
}
/// A mask that has a size has that of the worlds. (Others are functors.)
/// @param what  it is a mask of: "state"
template <class Mask>
void expects_mask(char const* where, Mask const& mask, char const* what, int worlds) {
  if constexpr (requires { mask.extent(0); })
    if (int(mask.extent(0)) != worlds)
      throw std::invalid_argument(std::string(where) + ": the mask has " + std::to_string(mask.extent(0)) + " worlds and the " + what +
                                  " " + std::to_string(worlds) + ": make them equal");
}
}  // namespace detail

}  // namespace gsp
