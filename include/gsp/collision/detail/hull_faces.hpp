#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/math/vec3.hpp>
#include <numeric>
#include <utility>
#include <vector>

/// The flat faces of a convex hull and the edges between its vertices, from its triangles. Host.
namespace gsp::detail {

struct HullFaces {
  std::vector<int> first{0};           // (faces + 1) where a face's corners begin
  std::vector<int> corners;            // vertices, 3 to 8 a face, counter-clockwise seen from outside
  std::vector<Vec3<double>> normal;    // unit, outward
  std::vector<int> neighbor_first{0};  // (vertices of the hull + 1)
  std::vector<int> neighbors;          // numbers in the list of the hull's vertices
};

/// Corners of the convex polygon of these points (x, y, number), counter-clockwise, without those on its sides (Andrew's monotone chain);
/// above eight those that add least area are left out.
inline std::vector<int> face_outline(std::vector<std::pair<std::array<double, 2>, int>> points, double least_area) {
  auto const area = [&](auto const& a, auto const& b, auto const& c) {
    return (b.first[0] - a.first[0]) * (c.first[1] - a.first[1]) - (b.first[1] - a.first[1]) * (c.first[0] - a.first[0]);
  };
  std::sort(points.begin(), points.end());
  std::vector<std::pair<std::array<double, 2>, int>> outline;
  for (int half = 0; half < 2; ++half) {
    std::size_t const begin = outline.size();
    for (auto const& p : points) {
      while (outline.size() >= begin + 2 && area(outline[outline.size() - 2], outline.back(), p) <= least_area) outline.pop_back();
      outline.push_back(p);
    }
    outline.pop_back();  // it begins the other half
    std::reverse(points.begin(), points.end());
  }
  while (outline.size() > 8) {
    std::size_t least = 0;
    double smallest = 0;
    for (std::size_t i = 0; i < outline.size(); ++i) {
      auto const& before = outline[(i + outline.size() - 1) % outline.size()];
      double const lost = area(before, outline[i], outline[(i + 1) % outline.size()]);
      if (i == 0 || lost < smallest) {
        smallest = lost;
        least = i;
      }
    }
    outline.erase(outline.begin() + std::ptrdiff_t(least));
  }
  std::vector<int> numbers;
  for (auto const& p : outline) numbers.push_back(p.second);
  return numbers;
}

/// Triangles that lie in one plane to within 1e-6 of the hull's size and half a degree become one face: the largest triangle that is left
/// takes its neighbors, theirs, and so on. `hull` lists the vertices of the hull in ascending order. Cost O(n log n) for n triangles.
inline HullFaces hull_faces(std::vector<std::array<float, 3>> const& vertices, std::vector<int> const& hull,
                            std::vector<std::array<int, 3>> const& triangles) {
  HullFaces out;
  auto const at = [&](int v) { return Vec3<double>{vertices[v][0], vertices[v][1], vertices[v][2]}; };
  std::size_t const n = triangles.size();
  std::vector<Vec3<double>> across(n);  // normals of twice the triangles' areas
  double size = 0;
  for (std::size_t t = 0; t < n; ++t) {
    Vec3<double> const a = at(triangles[t][0]);
    across[t] = cross(at(triangles[t][1]) - a, at(triangles[t][2]) - a);
    for (int v : triangles[t]) size = std::max(size, norm(at(v) - at(triangles[0][0])));
  }
  std::vector<std::array<int, 3>> edges;  // from, to, triangle
  for (std::size_t t = 0; t < n; ++t)
    for (int k = 0; k < 3; ++k) edges.push_back({triangles[t][k], triangles[t][(k + 1) % 3], int(t)});
  std::sort(edges.begin(), edges.end());
  auto const beyond = [&](int from, int to) {  // the triangle on the other side of an edge, -1: none
    auto const found = std::lower_bound(edges.begin(), edges.end(), std::array<int, 3>{to, from, 0});
    return found != edges.end() && (*found)[0] == to && (*found)[1] == from ? (*found)[2] : -1;
  };

  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int s, int t) { return norm(across[s]) > norm(across[t]); });
  std::vector<char> taken(n, 0);
  for (int const seed : order) {
    if (taken[seed] || !(norm(across[seed]) > 1e-14 * size * size)) continue;
    Vec3<double> const up = normalized(across[seed]);
    Vec3<double> const o = at(triangles[seed][0]);
    auto const flat = [&](int t) {
      for (int v : triangles[t])
        if (std::abs(dot(up, at(v) - o)) > 1e-6 * size) return false;
      return dot(up, across[t]) >= 0.99996 * norm(across[t]);
    };
    std::vector<int> patch{seed};
    taken[seed] = 1;
    Vec3<double> sum{0, 0, 0};
    for (std::size_t i = 0; i < patch.size(); ++i) {
      auto const& t = triangles[patch[i]];
      sum += across[patch[i]];
      for (int k = 0; k < 3; ++k) {
        int const other = beyond(t[k], t[(k + 1) % 3]);
        if (other < 0 || taken[other] || !flat(other)) continue;
        taken[other] = 1;
        patch.push_back(other);
      }
    }
    Vec3<double> const normal = normalized(sum);
    Vec3<double> const u = normalized(cross(normal, std::abs(normal.x) < 0.6 ? Vec3<double>{1, 0, 0} : Vec3<double>{0, 1, 0}));
    Vec3<double> const w = cross(normal, u);
    std::vector<int> members;
    for (int t : patch) members.insert(members.end(), triangles[t].begin(), triangles[t].end());
    std::sort(members.begin(), members.end());
    members.erase(std::unique(members.begin(), members.end()), members.end());
    std::vector<std::pair<std::array<double, 2>, int>> points;
    for (int v : members) points.push_back({{dot(u, at(v) - o), dot(w, at(v) - o)}, v});
    auto const outline = face_outline(points, 1e-12 * size * size);
    if (outline.size() < 3) continue;
    out.corners.insert(out.corners.end(), outline.begin(), outline.end());
    out.first.push_back(int(out.corners.size()));
    out.normal.push_back(normal);
  }

  auto const number = [&](int v) { return int(std::lower_bound(hull.begin(), hull.end(), v) - hull.begin()); };
  std::vector<std::pair<int, int>> links;
  for (auto const& e : edges) {
    links.emplace_back(number(e[0]), number(e[1]));
    links.emplace_back(number(e[1]), number(e[0]));
  }
  std::sort(links.begin(), links.end());
  links.erase(std::unique(links.begin(), links.end()), links.end());
  std::size_t k = 0;
  for (int v = 0; v < int(hull.size()); ++v) {
    for (; k < links.size() && links[k].first == v; ++k) out.neighbors.push_back(links[k].second);
    out.neighbor_first.push_back(int(out.neighbors.size()));
  }
  return out;
}

}  // namespace gsp::detail
