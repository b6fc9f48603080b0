#pragma once
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/detail/decimal.hpp>
#include <gsp/model/description.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// What the readers of STL, OBJ and MSH share.
namespace gsp::io::detail {

using Vertex = std::array<float, 3>;
using Triangle = std::array<int, 3>;

/// Largest coordinate that is taken, MuJoCo's bound for STL files.
inline constexpr float largest_coordinate = 1073741824.f;

inline bool is_coordinate(float x) { return std::abs(x) <= largest_coordinate; }  // false for what is not a number
inline bool is_vertex(Vertex const& v) { return is_coordinate(v[0]) && is_coordinate(v[1]) && is_coordinate(v[2]); }
[[noreturn]] inline void fail_vertex(std::string const& file, std::string const& place) {
  fail(file, place, "a vertex is not finite or beyond 2^30; export the mesh again, in metres");
}

/// A number as a float, as written in text files; empty where `word` is none or too large.
inline std::optional<float> to_float(std::string_view word) {
  auto const value = decimal(word);
  return value && std::abs(*value) <= 3e38 ? std::optional(static_cast<float>(*value)) : std::nullopt;
}

/// The lines of a text, numbered from 1; ends of lines are \n, \r\n or \r.
class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text) {}
  bool next(std::string_view& line) {
    if (at_ >= text_.size()) return false;
    std::size_t const end = std::min(text_.find_first_of("\r\n", at_), text_.size());
    line = text_.substr(at_, end - at_);
    at_ = end + (text_.substr(end, 2) == "\r\n" ? 2 : 1);
    ++number_;
    return true;
  }
  std::size_t number() const { return number_; }

 private:
  std::string_view text_;
  std::size_t at_ = 0, number_ = 0;
};

/// Takes the next word off the front; empty at the end.
inline std::string_view take_word(std::string_view& line) {
  std::size_t const begin = std::min(line.find_first_not_of(" \t"), line.size());
  std::size_t const end = std::min(line.find_first_of(" \t", begin), line.size());
  auto const word = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return word;
}

/// Gives equal vertices (bit by bit, as MuJoCo's reader of STL does: 0 and -0 differ) one number, in the order in which they first come.
/// An open hash table that is at most half full and starts small: most corners are repeats, and a small table stays in the cache.
class VertexIndex {
 public:
  explicit VertexIndex(std::vector<Vertex>& vertices) : vertices_(vertices), slots_(1024, -1) {}
  int operator()(Vertex const& v) {
    for (std::size_t slot = first(v);; slot = (slot + 1) & (slots_.size() - 1)) {
      int const id = slots_[slot];
      if (id < 0) {
        slots_[slot] = static_cast<int>(vertices_.size());
        vertices_.push_back(v);
        if (2 * vertices_.size() > slots_.size()) grow();
        return static_cast<int>(vertices_.size()) - 1;
      }
      if (std::memcmp(vertices_[static_cast<std::size_t>(id)].data(), v.data(), sizeof(Vertex)) == 0) return id;
    }
  }

 private:
  std::size_t first(Vertex const& v) const {
    std::uint32_t bits[3];
    std::memcpy(bits, v.data(), sizeof bits);
    std::uint64_t hash = (bits[0] | std::uint64_t(bits[1]) << 32) * 0x9E3779B97F4A7C15ull;
    hash = (hash ^ hash >> 32 ^ bits[2]) * 0xD6E8FEB86659FD93ull;
    return (hash ^ hash >> 32) & (slots_.size() - 1);
  }
  void grow() {
    slots_.assign(4 * slots_.size(), -1);
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      std::size_t slot = first(vertices_[i]);
      while (slots_[slot] >= 0) slot = (slot + 1) & (slots_.size() - 1);
      slots_[slot] = static_cast<int>(i);
    }
  }

  std::vector<Vertex>& vertices_;
  std::vector<int> slots_;
};

}  // namespace gsp::io::detail
