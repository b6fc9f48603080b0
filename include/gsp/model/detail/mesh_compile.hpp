#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <gsp/model/detail/mesh_inertia.hpp>
#include <string>
#include <utility>
#include <vector>

namespace gsp::detail {

/// A mesh moved to its centre of mass and principal axes: what CompiledModel keeps of it, and what geoms need.
struct CompiledMesh {
  std::vector<std::array<float, 3>> vertices;
  std::vector<std::array<int, 3>> faces;
  std::vector<int> hull;                       // vertices on the convex hull; empty where it was not needed
  std::vector<std::array<int, 3>> hull_faces;  // its triangles, outward
  Double3 pos{0, 0, 0};                        // pose of its frame in the frame of the file, which geoms take over
  Double4 quat{1, 0, 0, 0};
  double measure = 0;                   // volume, or area of a shell
  Double3 box{0, 0, 0};                 // half sizes of the box with its inertia
  Double3 low{0, 0, 0}, high{0, 0, 0};  // bounds of its vertices
};

/// MuJoCo's steps: minus refpos, rotated by refquat^-1, scaled (a mirroring scale turns the faces over), moved to the centre of mass and
/// principal axes, rounded to float. `fail(sentence)` throws. Cost: O(vertices + faces).
template <class Fail>
CompiledMesh compile_mesh(MeshDescription const& mesh, Fail const& fail) {
  auto const finite = [](auto const& a) { return std::all_of(a.begin(), a.end(), [](auto x) { return std::isfinite(x); }); };
  if (mesh.vertices.size() < 4) fail("has " + std::to_string(mesh.vertices.size()) + " vertices: give at least 4");
  if (mesh.vertices.size() > 100'000'000 || mesh.faces.size() > 100'000'000)
    fail("has more than 100 million vertices or faces: simplify it");
  if (!finite(mesh.scale) || !finite(mesh.refpos) || !finite(mesh.refquat)) fail("holds a number that is not finite: give it a value");
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
    if (!finite(mesh.vertices[i])) fail("has a vertex " + std::to_string(i) + " that is not finite: correct it");
  auto const check = [&](std::vector<std::array<int, 3>> const& faces, char const* what) {
    for (auto const& f : faces)
      for (int v : f)
        if (v < 0 || v >= int(mesh.vertices.size()))
          fail(std::string("has ") + what + " with vertex " + std::to_string(v) + " of " + std::to_string(mesh.vertices.size()) +
               ": correct it");
  };
  check(mesh.faces, "a face");
  check(mesh.hull, "a face of the hull");
  bool const convex = mesh.inertia == MeshInertia::convex, of_hull = mesh.faces.empty();
  if ((of_hull || convex) && mesh.hull.empty())
    fail(std::string(of_hull ? "has no faces" : "takes the inertia of its hull") +
         ", and its convex hull is missing: call gsp::io::add_hulls");

  CompiledMesh out;
  out.faces = of_hull ? mesh.hull : mesh.faces;
  auto const& given = mesh.vertices;
  if (mesh.inertia == MeshInertia::exact) {  // each edge may run once in each direction
    std::vector<std::pair<int, int>> edges;
    for (auto const& f : out.faces) {
      auto const at = [&](int k) { return Double3{given[f[k]][0], given[f[k]][1], given[f[k]][2]}; };
      if (mesh_triangle(at(0), at(1), at(2)).twice_area > 2 * std::sqrt(1e-15))
        for (int k = 0; k < 3; ++k) edges.emplace_back(f[k], f[(k + 1) % 3]);
    }
    std::sort(edges.begin(), edges.end());
    auto const twice = std::adjacent_find(edges.begin(), edges.end());
    if (twice != edges.end())
      fail("has faces whose orientations disagree, at the edge of its vertices " + std::to_string(twice->first) + " and " +
           std::to_string(twice->second) + ": orient them alike, or choose another inertia than \"exact\"");
  }
  bool const mirrors = !(mesh.scale[0] * mesh.scale[1] * mesh.scale[2] > 0);
  auto const turn_over = [](auto& faces) {
    for (auto& f : faces) std::swap(f[1], f[2]);
  };
  auto hull = convex ? mesh.hull : std::vector<std::array<int, 3>>{};
  if (mirrors) {
    turn_over(out.faces);
    turn_over(hull);
  }

  std::vector<Double3> moved(given.size());
  auto const refquat = normalized(mesh.refquat);
  bool const turns = mesh.refquat != Double4{1, 0, 0, 0};
  for (std::size_t i = 0; i < given.size(); ++i) {
    Double3 x = Double3{given[i][0], given[i][1], given[i][2]} - mesh.refpos;
    if (turns) x = rotate_inverse(refquat, x);
    moved[i] = {x[0] * mesh.scale[0], x[1] * mesh.scale[1], x[2] * mesh.scale[2]};
  }
  auto const solid = mesh_solid(moved, out.faces, convex ? hull : out.faces, mesh.inertia);
  if (!(solid.surface >= 1e-15)) fail("has no surface (its area is under 1e-15 m^2): correct its faces or its scale");
  if (solid.measure < 0) fail("encloses a negative volume: its faces look inwards, turn them over");
  if (!(solid.measure >= 1e-15)) fail("encloses no volume (under 1e-15 m^3): close it, or set its inertia to \"shell\"");
  auto const axes = mesh_axes(solid.inertia);
  auto const& i = axes.moments;
  if (!(i[2] > 0)) fail("has no inertia about one of its axes: correct its faces");
  auto const too_large = [](double a, double b, double c) { return a + b < c * (1 - 1e-6) - 1e-9; };
  if (too_large(i[0], i[1], i[2]) || too_large(i[0], i[2], i[1]) || too_large(i[1], i[2], i[0]))
    fail("has a moment of inertia above the sum of the others, which no body has: correct its faces, or choose another inertia");
  // a box of half sizes b has the moments m (b1^2 + b2^2) / 3 ...
  auto const half = [&](double sum) { return 0.5 * std::sqrt(6 * std::max(sum, 0.) / solid.measure); };
  out.box = {half(i[1] + i[2] - i[0]), half(i[0] + i[2] - i[1]), half(i[0] + i[1] - i[2])};
  out.measure = solid.measure;
  out.pos = solid.com;
  out.quat = axes.quat;
  out.low = {1e10, 1e10, 1e10};
  out.high = {-1e10, -1e10, -1e10};
  out.vertices.reserve(given.size());
  for (auto const& v : moved) {
    auto const x = rotate_inverse(out.quat, v - out.pos);
    for (int k = 0; k < 3; ++k) {
      out.low[k] = std::min(out.low[k], x[k]);
      out.high[k] = std::max(out.high[k], x[k]);
    }
    out.vertices.push_back({float(x[0]), float(x[1]), float(x[2])});
    if (!finite(out.vertices.back())) fail("grows beyond what a float can hold: correct its scale");
  }
  for (auto const& f : mesh.hull) out.hull.insert(out.hull.end(), f.begin(), f.end());
  std::sort(out.hull.begin(), out.hull.end());
  out.hull.erase(std::unique(out.hull.begin(), out.hull.end()), out.hull.end());
  out.hull_faces = mesh.hull;
  if (mirrors) turn_over(out.hull_faces);
  return out;
}

/// Elevations as MuJoCo keeps them: the lowest becomes 0, the highest 1; a flat field 0.
inline void normalize_elevation(std::vector<float>& elevation) {
  if (elevation.empty()) return;
  auto const [low, high] = std::minmax_element(elevation.begin(), elevation.end());
  float const from = *low, range = *high - *low;
  for (float& e : elevation) {
    e -= from;
    if (range > 1e-14) e /= range;
  }
}

}  // namespace gsp::detail
