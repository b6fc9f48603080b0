#pragma once
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/detail/decimal.hpp>
#include <optional>
#include <string_view>
#include <vector>

// The part of PLY that all our readers share: a header in text, then one table of scalars per element.

namespace gsp::io::detail {

enum class PlyType { i8, u8, i16, u16, i32, u32, f32, f64 };

inline std::size_t size_of(PlyType t) { return std::array<std::size_t, 8>{1, 1, 2, 2, 4, 4, 4, 8}[static_cast<std::size_t>(t)]; }

inline std::optional<PlyType> ply_type(std::string_view word) {
  static constexpr std::array<std::array<std::string_view, 2>, 8> names{{{"char", "int8"},
                                                                         {"uchar", "uint8"},
                                                                         {"short", "int16"},
                                                                         {"ushort", "uint16"},
                                                                         {"int", "int32"},
                                                                         {"uint", "uint32"},
                                                                         {"float", "float32"},
                                                                         {"double", "float64"}}};
  for (std::size_t t = 0; t < names.size(); ++t)
    if (word == names[t][0] || word == names[t][1]) return static_cast<PlyType>(t);
  return std::nullopt;
}

struct PlyProperty {
  std::string name;
  PlyType type;
  std::size_t offset;  // bytes from the start of a row
  std::size_t line;    // where the header declares it
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::size_t line = 0, stride = 0;
  std::vector<PlyProperty> properties;
  bool has_list = false;            // rows of unknown length: it and all that follows is out of reach
  std::byte const* rows = nullptr;  // set by parse_ply_table
};

struct PlyComment {
  std::string text;
  std::size_t line;
};

/// One property of all rows of an element, read as double (exact for every PLY type).
struct PlyColumn {
  std::byte const* first;
  std::size_t stride;
  PlyType type;
  double operator()(std::size_t row) const {
    std::byte const* p = first + row * stride;
    auto get = [p]<class T>(T value) {
      std::memcpy(&value, p, sizeof(T));
      return static_cast<double>(value);
    };
    switch (type) {
      case PlyType::f32:
        return get(float{});
      case PlyType::f64:
        return get(double{});
      case PlyType::i8:
        return get(std::int8_t{});
      case PlyType::u8:
        return get(std::uint8_t{});
      case PlyType::i16:
        return get(std::int16_t{});
      case PlyType::u16:
        return get(std::uint16_t{});
      case PlyType::i32:
        return get(std::int32_t{});
      default:
        return get(std::uint32_t{});
    }
  }
};

struct PlyTable {
  std::string name;  // of the file, for messages
  bool ascii = false;
  std::vector<PlyElement> elements;
  std::vector<PlyComment> comments;
  std::vector<std::vector<double>> text_rows;  // what the rows of a text file point to

  PlyElement const* find(std::string_view element) const {
    for (auto const& e : elements)
      if (e.name == element) return &e;
    return nullptr;
  }
  PlyProperty const* find(PlyElement const& e, std::string_view property) const {
    for (auto const& p : e.properties)
      if (p.name == property) return &p;
    return nullptr;
  }
  /// Throws Error where the property is missing.
  PlyColumn column(PlyElement const& e, std::string_view property, char const* format) const {
    PlyProperty const* p = find(e, property);
    if (!p)
      fail(name, at_line(e.line),
           "element '" + e.name + "' has no property '" + std::string(property) + "'; this is not a " + format + ", export it as one");
    return column(e, *p);
  }
  PlyColumn column(PlyElement const& e, PlyProperty const& p) const {
    if (!e.rows)
      fail(name, at_line(e.line), "element '" + e.name + "' stands at or behind a list element and cannot be reached; put lists last");
    return {e.rows + (ascii ? 8 * static_cast<std::size_t>(&p - e.properties.data()) : p.offset),
            ascii ? 8 * e.properties.size() : e.stride, ascii ? PlyType::f64 : p.type};
  }
};

inline std::vector<std::string_view> words(std::string_view line) {
  std::vector<std::string_view> out;
  for (std::size_t i = 0; i < line.size();) {
    std::size_t const begin = line.find_first_not_of(" \t", i);
    if (begin == std::string_view::npos) break;
    std::size_t const end = std::min(line.find_first_of(" \t", begin), line.size());
    out.push_back(line.substr(begin, end - begin));
    i = end;
  }
  return out;
}

inline bool is_count(std::string_view word, std::size_t& count) {
  auto const [end, error] = std::from_chars(word.data(), word.data() + word.size(), count);
  return error == std::errc() && end == word.data() + word.size();
}

/// Header lines into `table`; returns the offset of the first byte after it.
inline std::size_t parse_ply_header(Bytes bytes, PlyTable& table) {
  std::string const& name = table.name;
  std::string_view const text = as_text(bytes);
  bool has_format = false;
  std::size_t at = 0;
  for (std::size_t line = 1;; ++line) {
    std::size_t const end = text.find('\n', at);
    if (end == std::string_view::npos) fail(name, at_line(line), "the header has no 'end_header' line; the file is cut short or not a PLY");
    std::string_view row = text.substr(at, end - at);
    if (!row.empty() && row.back() == '\r') row.remove_suffix(1);
    at = end + 1;
    auto const w = words(row);
    if (line == 1) {
      if (row != "ply") fail(name, at_line(1), "the first line is not 'ply'; this is not a PLY file");
      continue;
    }
    if (w.empty()) continue;
    if (w[0] == "end_header") break;
    if (w[0] == "comment" || w[0] == "obj_info") {
      std::size_t const from = static_cast<std::size_t>(w[0].data() - row.data()) + w[0].size();
      if (w[0] == "comment") table.comments.push_back({std::string(row.substr(std::min(row.size(), from + 1))), line});
    } else if (w[0] == "format") {
      if (w.size() != 3 || (w[1] != "binary_little_endian" && w[1] != "ascii"))
        fail(name, at_line(line), "format " + in_quotes(row) + " is not supported; save it as binary_little_endian or ascii");
      table.ascii = w[1] == "ascii";
      has_format = true;
    } else if (w[0] == "element") {
      PlyElement e;
      e.line = line;
      if (w.size() != 3 || !is_count(w[2], e.count))
        fail(name, at_line(line), in_quotes(row) + " is not 'element NAME COUNT'; repair the header");
      e.name = w[1];
      if (table.find(e.name)) fail(name, at_line(line), "element " + in_quotes(e.name) + " is declared twice; repair the header");
      table.elements.push_back(std::move(e));
    } else if (w[0] == "property") {
      if (table.elements.empty()) fail(name, at_line(line), "a property stands before any element; repair the header");
      PlyElement& e = table.elements.back();
      if (w.size() == 5 && w[1] == "list") {
        e.has_list = true;
        continue;
      }
      auto const type = w.size() == 3 ? ply_type(w[1]) : std::nullopt;
      if (!type) fail(name, at_line(line), in_quotes(row) + " is not 'property TYPE NAME' with a known type; repair the header");
      if (table.find(e, w[2])) fail(name, at_line(line), "property " + in_quotes(w[2]) + " is declared twice; repair the header");
      if (e.properties.size() == 1000) fail(name, at_line(line), "more than 1000 properties; this is not a PLY that can be meant");
      e.properties.push_back({std::string(w[2]), *type, e.stride, line});
      e.stride += size_of(*type);
    } else {
      fail(name, at_line(line), "unknown header word " + in_quotes(w[0]) + "; repair the header");
    }
  }
  if (!has_format) fail(name, at_line(2), "the header has no 'format' line; repair it");
  return at;
}

/// The numbers of one text element. A number must be followed by white space, so that a file cut inside one is noticed.
inline std::vector<double> parse_ply_text(PlyTable const& table, PlyElement const& e, std::string_view text, std::size_t& at,
                                          std::size_t& line) {
  std::vector<double> values;
  values.reserve(e.count * e.properties.size());
  auto const space = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; };
  for (std::size_t i = 0; i < e.count * e.properties.size(); ++i) {
    for (; at < text.size() && space(text[at]); ++at) line += text[at] == '\n';
    std::size_t const begin = at;
    while (at < text.size() && !space(text[at])) ++at;
    if (at == text.size())
      fail(table.name, at_line(line),
           "the file ends within element '" + e.name + "' (no white space after its last number); it is cut short, fetch it again");
    auto const word = text.substr(begin, at - begin);
    auto const value = decimal(word);
    if (!value) fail(table.name, at_line(line), in_quotes(word) + " is not a number; repair the file");
    if (std::isinf(*value) && word.find_first_of("0123456789") != word.npos)
      fail(table.name, at_line(line), in_quotes(word) + " is beyond the largest number, 1.8e308; repair the file");
    values.push_back(*value);
  }
  return values;
}

/// Header and row addresses of a PLY file (binary little endian, or text). Every count is held against the size of the file before memory
/// is taken. The bytes must outlive the table. Throws Error. Cost: nothing for binary, one pass for text.
inline PlyTable parse_ply_table(Bytes bytes, std::string const& name) {
  PlyTable table;
  table.name = name;
  std::size_t at = parse_ply_header(bytes, table);
  std::string_view const text = as_text(bytes);
  std::size_t line = 1;
  for (std::size_t i = 0; table.ascii && i < at; ++i) line += text[i] == '\n';
  bool complete = true;
  for (PlyElement& e : table.elements) {
    if (e.has_list) {
      complete = false;
      break;
    }
    if (e.properties.empty()) {
      if (e.count > 0) fail(name, at_line(e.line), "element " + in_quotes(e.name) + " has no properties; repair the header");
      continue;
    }
    std::size_t const least = table.ascii ? 2 * e.properties.size() : e.stride;  // bytes of a row
    if (e.count > (bytes.size() - at) / least)
      fail(name, at_line(e.line),
           "element " + in_quotes(e.name) + " announces " + std::to_string(e.count) + " rows of " + (table.ascii ? "at least " : "") +
               std::to_string(least) + " bytes, but only " + std::to_string(bytes.size() - at) +
               " bytes follow; the file is cut short or its count is wrong");
    if (table.ascii) {
      table.text_rows.push_back(parse_ply_text(table, e, text, at, line));
      e.rows = reinterpret_cast<std::byte const*>(table.text_rows.back().data());
    } else {
      e.rows = bytes.data() + at;
      at += e.count * e.stride;
    }
  }
  if (table.ascii) at = std::min(text.find_first_not_of(" \t\r\n", at), text.size());
  if (complete && at != bytes.size())
    fail(name, at_byte(at),
         std::to_string(bytes.size() - at) +
             " bytes follow the last row that the header announces; a count in the header is wrong, export the file again");
  return table;
}

/// `value` as an integer in [low, high].
inline long long as_integer(double value, long long low, long long high, std::string const& name, std::size_t row,
                            std::string const& what) {
  if (!(value >= static_cast<double>(low) && value <= static_cast<double>(high)) || value != std::floor(value))
    fail(name, "row " + std::to_string(row),
         what + " is not a whole number in " + std::to_string(low) + ".." + std::to_string(high) + "; repair or export the file again");
  return static_cast<long long>(value);
}

}  // namespace gsp::io::detail
