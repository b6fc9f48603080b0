#pragma once
#include <gsp/io/detail/mesh_files.hpp>

/// STL: a list of triangles, each with its own three corners, which are merged where they are equal.
namespace gsp::io::detail {

inline void read_stl_binary(Bytes bytes, std::uint32_t count, std::string const& file, MeshDescription& mesh) {
  mesh.faces.reserve(count);
  mesh.vertices.reserve(count / 2 + 4);
  VertexIndex index(mesh.vertices);
  for (std::size_t f = 0; f < count; ++f) {
    Triangle face;
    for (std::size_t k = 0; k < 3; ++k) {
      std::size_t const at = 84 + 50 * f + 12 * (k + 1);  // after the normal
      auto const v = load<Vertex>(bytes, at);
      if (!is_vertex(v)) fail_vertex(file, at_byte(at));
      face[k] = index(v);
    }
    mesh.faces.push_back(face);
  }
}

inline void read_stl_text(std::string_view text, std::string const& file, MeshDescription& mesh) {
  VertexIndex index(mesh.vertices);
  Lines lines(text);
  Triangle face{};
  int corners = 0;
  for (std::string_view line; lines.next(line);) {
    for (auto word = take_word(line); !word.empty(); word = take_word(line)) {
      if (word == "solid" || word == "endsolid") break;  // a name follows
      if (word == "endfacet") {
        if (corners != 3)
          fail(file, at_line(lines.number()), "the facet has " + std::to_string(corners) + " vertices and must have 3; export it again");
        mesh.faces.push_back(face);
        corners = 0;
      } else if (word == "vertex" || word == "normal") {
        Vertex v{};
        for (float& x : v) {
          auto const number = take_word(line);
          auto const value = to_float(number);
          if (!value && word == "vertex") fail(file, at_line(lines.number()), in_quotes(number) + " is not a coordinate; export it again");
          x = value.value_or(0);
        }
        if (word == "normal") continue;
        if (!is_vertex(v)) fail_vertex(file, at_line(lines.number()));
        if (corners == 3) fail(file, at_line(lines.number()), "the facet has more than 3 vertices; export it as triangles");
        face[static_cast<std::size_t>(corners++)] = index(v);
      } else if (word != "facet" && word != "outer" && word != "loop" && word != "endloop") {
        fail(file, at_line(lines.number()), in_quotes(word) + " is no word of STL; the file is damaged");
      }
    }
  }
  if (corners != 0) fail(file, at_line(lines.number()), "the last facet is cut short; fetch the file again");
}

inline MeshDescription parse_stl(Bytes bytes, std::string const& file) {
  MeshDescription mesh;
  std::uint32_t const count = bytes.size() >= 84 ? load<std::uint32_t>(bytes, 80) : 0;
  bool const fits = bytes.size() >= 84 && bytes.size() - 84 == 50 * std::uint64_t(count);
  auto const text = as_text(bytes);
  auto const first = text.find_first_not_of(" \t\r\n");
  bool const is_text = first != text.npos && text.substr(first, 5) == "solid";
  if (fits)
    read_stl_binary(bytes, count, file, mesh);
  else if (is_text)
    read_stl_text(text, file, mesh);
  else if (bytes.size() < 84)
    fail(file, at_byte(bytes.size()), "is too short for an STL file; fetch it again");
  else
    fail(file, at_byte(80),
         "announces " + std::to_string(count) + " triangles, for which it does not have the size; it is damaged or not STL");
  if (mesh.faces.empty()) fail(file, "", "holds no triangle; export it again");
  return mesh;
}

}  // namespace gsp::io::detail
