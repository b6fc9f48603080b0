#pragma once
#include <gsp/io/detail/mesh_files.hpp>
#include <limits>

/// Wavefront OBJ as MuJoCo takes it: the vertices of all of it, the faces of its first object or group that has any, polygons cut into
/// triangles; everything else (normals, texture coordinates, materials, lines, points) is ignored.
namespace gsp::io::detail {

/// Cuts a polygon into triangles as MuJoCo's reader does, in float, since order and arithmetic decide how bent polygons are cut.
/// Four corners: along the shorter diagonal. More: corner k is cut off with (k, k + 1, k + 2) where it turns the way that k and k + 1 turn
/// about the origin and no other corner lies in it, else the next is tried; they are compared in the coordinate plane that the first
/// real corner faces most. (Ear clipping, but for the origin: dented polygons may be cut badly, as there. Triangles are always safe.)
/// What cannot be cut is dropped, as there. `budget` falls by the corners that were looked at; false when it is used up.
inline bool cut_polygon(std::vector<int> corners, std::vector<Vertex> const& vertices, std::vector<Triangle>& faces, std::int64_t& budget) {
  std::size_t const n = corners.size();
  if (n == 4) {
    auto const distance2 = [&](int i, int j) {
      Vertex const &p = vertices[static_cast<std::size_t>(corners[static_cast<std::size_t>(i)])],
                   &q = vertices[static_cast<std::size_t>(corners[static_cast<std::size_t>(j)])];
      float const x = q[0] - p[0], y = q[1] - p[1], z = q[2] - p[2];
      return x * x + y * y + z * z;
    };
    int const a = corners[0], b = corners[1], c = corners[2], d = corners[3];
    if (distance2(0, 2) < distance2(1, 3)) {
      faces.push_back({a, b, c});
      faces.push_back({a, c, d});
    } else {
      faces.push_back({a, b, d});
      faces.push_back({b, c, d});
    }
    return true;
  }
  std::size_t first = 1, second = 2;  // the plane's axes
  auto const at = [&](std::size_t k) -> Vertex const& { return vertices[static_cast<std::size_t>(corners[k % corners.size()])]; };
  for (std::size_t k = 0; k < n; ++k) {
    Vertex const &a = at(k), &b = at(k + 1), &c = at(k + 2);
    float const u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, w[3] = {c[0] - b[0], c[1] - b[1], c[2] - b[2]};
    float const x = std::abs(u[1] * w[2] - u[2] * w[1]), y = std::abs(u[2] * w[0] - u[0] * w[2]), z = std::abs(u[0] * w[1] - u[1] * w[0]);
    if (std::max({x, y, z}) > std::numeric_limits<float>::epsilon()) {
      if (!(x > y && x > z)) {
        first = 0;
        second = z > x && z > y ? 1 : 2;
      }
      break;
    }
  }
  std::size_t guess = 0, tries = n;  // without a cut
  while (corners.size() > 3 && tries > 0) {
    if (guess >= corners.size()) guess -= corners.size();
    --tries;
    if ((budget -= static_cast<std::int64_t>(corners.size())) < 0) return false;
    float x[3], y[3];
    for (std::size_t k = 0; k < 3; ++k) {
      x[k] = at(guess + k)[first];
      y[k] = at(guess + k)[second];
    }
    float const turn = (x[1] - x[0]) * (y[2] - y[1]) - (y[1] - y[0]) * (x[2] - x[1]), about_origin = (x[0] * y[1] - y[0] * x[1]) * 0.5f;
    bool ear = !(turn * about_origin < 0);
    for (std::size_t other = 3; ear && other < corners.size(); ++other) {  // even-odd rule
      float const px = at(guess + other)[first], py = at(guess + other)[second];
      bool inside = false;
      for (std::size_t i = 0, j = 2; i < 3; j = i++)
        if ((y[i] > py) != (y[j] > py) && px < (x[j] - x[i]) * (py - y[i]) / (y[j] - y[i]) + x[i]) inside = !inside;
      ear = !inside;
    }
    if (!ear) {
      ++guess;
      continue;
    }
    auto const id = [&](std::size_t k) { return corners[k % corners.size()]; };
    faces.push_back({id(guess), id(guess + 1), id(guess + 2)});
    corners.erase(corners.begin() + static_cast<std::ptrdiff_t>((guess + 1) % corners.size()));
    tries = corners.size() + 1;
  }
  if (corners.size() == 3) faces.push_back({corners[0], corners[1], corners[2]});
  return true;
}

inline MeshDescription parse_obj(Bytes bytes, std::string const& file, std::string* note) {
  MeshDescription mesh;
  struct Polygon {
    std::vector<int> corners;
    std::size_t line;
  };
  std::vector<Polygon> polygons;
  std::size_t lines_of_edges = 0;
  bool closed = false;                              // the first object with faces is over
  std::size_t ignored = 0, first_ignored_line = 0;  // faces of later ones
  std::int64_t budget = 4'000'000;                  // cutting is quadratic in the corners, cubic in folded polygons
  Lines lines(as_text(bytes));
  for (std::string_view line; lines.next(line);) {
    auto const word = take_word(line);
    if (word == "v") {
      Vertex v{};
      for (float& x : v) {
        auto const number = take_word(line);
        auto const value = to_float(number);
        if (!value)
          fail(file, at_line(lines.number()),
               (number.empty() ? "a vertex has fewer than three coordinates" : in_quotes(number) + " is not a coordinate") +
                   "; export it again");
        x = *value;
      }
      if (!is_vertex(v)) fail_vertex(file, at_line(lines.number()));
      mesh.vertices.push_back(v);
    } else if (word == "g" || word == "o") {
      closed = closed || !polygons.empty();
    } else if (word == "l") {
      lines_of_edges = lines_of_edges ? lines_of_edges : lines.number();
    } else if (word == "f") {
      if (closed) {
        if (++ignored == 1) first_ignored_line = lines.number();
        continue;
      }
      Polygon polygon{{}, lines.number()};
      for (auto corner = take_word(line); !corner.empty(); corner = take_word(line)) {
        auto const number = corner.substr(0, corner.find('/'));  // v, v/vt, v//vn, v/vt/vn
        int index = 0;
        auto const [end, error] = std::from_chars(number.data(), number.data() + number.size(), index);
        if (error != std::errc() || end != number.data() + number.size() || index == 0)
          fail(file, at_line(lines.number()),
               in_quotes(corner) + " is not a corner of a face: vertices count from 1, or back from -1; export it again");
        polygon.corners.push_back(index > 0 ? index - 1 : static_cast<int>(mesh.vertices.size()) + index);
      }
      budget += 2000 * static_cast<std::int64_t>(polygon.corners.size());
      if (polygon.corners.size() >= 3) polygons.push_back(std::move(polygon));
    }
    if (mesh.vertices.size() > 0x7ffffff0) fail(file, at_line(lines.number()), "has more than 2^31 vertices; simplify it");
  }
  if (polygons.empty() && lines_of_edges)
    fail(file, at_line(lines_of_edges), "the file holds lines but no faces, which encloses nothing; export it with faces");
  mesh.faces.reserve(polygons.size());
  for (auto& p : polygons) {
    for (int v : p.corners)
      if (v < 0 || v >= static_cast<int>(mesh.vertices.size()))
        fail(file, at_line(p.line),
             "a face names a vertex that is not among the " + std::to_string(mesh.vertices.size()) + " of the file; export it again");
    if (p.corners.size() == 3)
      mesh.faces.push_back({p.corners[0], p.corners[1], p.corners[2]});
    else if (!cut_polygon(std::move(p.corners), mesh.vertices, mesh.faces, budget))
      fail(file, at_line(p.line), "a face has too many corners to be cut into triangles; export it as triangles");
  }
  if (note && ignored > 0)
    *note = file + ": " + at_line(first_ignored_line) + ": faces from here on (" + std::to_string(ignored) +
            ") belong to further objects or groups and are ignored, as MuJoCo does";
  return mesh;
}

}  // namespace gsp::io::detail
