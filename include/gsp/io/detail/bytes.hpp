#pragma once
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <gsp/core/check.hpp>
#include <span>
#include <string>

namespace gsp::io {

/// What every `parse_*` function reads: the bytes of a file, owned by the caller.
using Bytes = std::span<std::byte const>;

namespace detail {

static_assert(std::endian::native == std::endian::little, "gsp::io: all formats here are little endian, and so must be the machine");

/// Throws Error("name: place: sentence"). The sentence says what is wrong and what to do.
[[noreturn]] inline void fail(std::string const& name, std::string const& place, std::string const& sentence) {
  throw Error(name + ": " + (place.empty() ? "" : place + ": ") + sentence);
}
inline std::string at_byte(std::size_t offset) { return "byte " + std::to_string(offset); }
inline std::string at_line(std::size_t line) { return "line " + std::to_string(line); }

/// A text of the file as it may stand in a message: quoted, at most 40 characters, anything but printable ASCII as '?'.
inline std::string in_quotes(std::string_view text) {
  std::string out = "'";
  for (char c : text.substr(0, 40)) out += c >= 32 && c < 127 ? c : '?';
  return out + (text.size() > 40 ? "...'" : "'");
}

/// The value of type T at `offset`; the caller has checked that it lies inside.
template <class T>
T load(Bytes bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}

inline Bytes as_bytes(std::string_view text) { return std::as_bytes(std::span(text.data(), text.size())); }
inline std::string_view as_text(Bytes bytes) { return {reinterpret_cast<char const*>(bytes.data()), bytes.size()}; }
inline bool starts_with(Bytes bytes, std::string_view magic) { return as_text(bytes).substr(0, magic.size()) == magic; }

}  // namespace detail
}  // namespace gsp::io
