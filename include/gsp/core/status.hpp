#pragma once
#include <cstdint>
#include <string>

/// Status bits of a world, written on the device, read by the user when he likes. A world with a bit set was not stepped: nothing is
/// dropped silently.
namespace gsp::status {

inline constexpr std::uint32_t contact_overflow = 1u << 0;

/// What the bits mean, for people.
inline std::string text(std::uint32_t bits) {
  std::string result;
  if (bits & contact_overflow) result += "the contacts of this world did not fit: call grow(exec, contacts) and repeat the step; ";
  return result.empty() ? "ok" : result;
}

}  // namespace gsp::status
