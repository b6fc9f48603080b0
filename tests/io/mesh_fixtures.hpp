#pragma once
// Meshes and their files for tests and the fuzzer's first inputs. The encoders are written from the formats' descriptions.
#include <array>
#include <cmath>
#include <cstring>
#include <io/fixtures.hpp>
#include <random>
#include <string>
#include <vector>

namespace gsp_test {

struct Soup {
  std::vector<std::array<float, 3>> vertices;
  std::vector<std::array<int, 3>> faces;
};

inline Soup box_mesh(float a, float b, float c) {
  Soup s;
  for (int i = 0; i < 8; ++i) s.vertices.push_back({i & 1 ? a : -a, i & 2 ? b : -b, i & 4 ? c : -c});
  s.faces = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
             {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return s;
}
inline Soup tetrahedron() { return {{{0, 0, 0}, {1, 0, 0}, {0, .5f, 0}, {0, .1f, .25f}}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}}; }
/// A closed star-shaped surface with dents: no two moments are equal, and its hull is smaller than itself.
inline Soup potato(unsigned seed, int rings = 7, int sectors = 9) {
  std::mt19937 random(seed);
  auto const noise = [&] { return 0.7f + 0.6f * float(random() & 0xffff) / 65536; };
  Soup s;
  auto const add = [&](float r, float z) {
    for (int k = 0; k < sectors; ++k) {
      float const a = 6.2831853f * k / sectors, n = noise();
      s.vertices.push_back({.3f * n * r * std::cos(a) + .1f, .2f * n * r * std::sin(a) - .05f, .13f * n * z + .02f});
    }
  };
  s.vertices.push_back({.1f, -.05f, -.13f});
  for (int i = 1; i < rings; ++i) add(std::sin(3.14159265f * i / rings), -std::cos(3.14159265f * i / rings));
  s.vertices.push_back({.1f, -.05f, .17f});
  int const last = int(s.vertices.size()) - 1;
  for (int k = 0; k < sectors; ++k) {
    int const n = (k + 1) % sectors;
    s.faces.push_back({0, 1 + n, 1 + k});
    for (int i = 0; i + 2 < rings; ++i) {
      int const a = 1 + i * sectors, b = a + sectors;
      s.faces.push_back({a + k, a + n, b + n}), s.faces.push_back({a + k, b + n, b + k});
    }
    s.faces.push_back({last, last - sectors + k, last - sectors + n});
  }
  return s;
}

inline std::vector<std::byte> stl_binary(Soup const& s, std::string const& header = "made for a test") {
  std::vector<std::byte> out(84);
  std::uint32_t const count = std::uint32_t(s.faces.size());
  std::memcpy(out.data(), header.data(), std::min<std::size_t>(80, header.size()));
  std::memcpy(out.data() + 80, &count, 4);
  for (auto const& f : s.faces) {
    for (int k = 0; k < 3; ++k) put(out, 0.f);
    for (int v : f)
      for (float x : s.vertices[v]) put(out, x);
    put(out, std::uint16_t(0));
  }
  return out;
}
inline std::string number(float x) {
  char text[40];
  std::snprintf(text, sizeof text, "%.9g", x);
  return text;
}
inline std::string stl_text(Soup const& s) {
  std::string out = "solid a name\n";
  for (auto const& f : s.faces) {
    out += "  facet normal 0 0 0\n    outer loop\n";
    for (int v : f)
      out += "      vertex " + number(s.vertices[v][0]) + " " + number(s.vertices[v][1]) + " " + number(s.vertices[v][2]) + "\n";
    out += "    endloop\n  endfacet\n";
  }
  return out + "endsolid a name\n";
}
inline std::string obj_vertices(Soup const& s) {
  std::string out;
  for (auto const& v : s.vertices) out += "v " + number(v[0]) + " " + number(v[1]) + " " + number(v[2]) + "\n";
  return out;
}
inline std::string obj_text(Soup const& s) {
  std::string out = "# a comment\nmtllib none.mtl\n" + obj_vertices(s);
  for (auto const& f : s.faces)
    out += "f " + std::to_string(f[0] + 1) + " " + std::to_string(f[1] + 1) + " " + std::to_string(f[2] + 1) + "\n";
  return out;
}
inline std::vector<std::byte> msh_binary(Soup const& s, bool normals = false, bool texcoords = false) {
  std::int32_t const n = std::int32_t(s.vertices.size()), counts[4] = {n, normals ? n : 0, texcoords ? n : 0, std::int32_t(s.faces.size())};
  std::vector<std::byte> out(sizeof counts);
  std::memcpy(out.data(), counts, sizeof counts);
  for (auto const& v : s.vertices)
    for (float x : v) put(out, x);
  for (int i = 0; i < (normals ? n : 0); ++i)
    for (float x : {0.f, 0.f, 1.f}) put(out, x);
  for (int i = 0; i < (texcoords ? 2 * n : 0); ++i) put(out, .5f);
  for (auto const& f : s.faces)
    for (int v : f) put(out, std::int32_t(v));
  return out;
}
inline std::vector<std::byte> hfield_binary(int rows, int columns, std::vector<float> const& data) {
  std::int32_t const counts[2] = {rows, columns};
  std::vector<std::byte> out(sizeof counts);
  std::memcpy(out.data(), counts, sizeof counts);
  for (float x : data) put(out, x);
  return out;
}

}  // namespace gsp_test
