#pragma once
// Shapes for the tests of the convex routine: hulls of meshes built here, random placements, and overlaps along a direction from supports.
#include <array>
#include <cmath>
#include <gsp/collision/detail/hull_faces.hpp>
#include <gsp/collision/narrowphase.hpp>
#include <random>
#include <vector>

namespace gsp_test {
using namespace gsp;

/// A convex mesh from its vertices and outward triangles.
template <class T>
struct Hull {
  std::vector<Vec3<T>> vertices, normals;
  std::vector<int> hull;
  detail::HullFaces faces;
  ShapeAsset<T> asset;
  Vec3<T> size{0, 0, 0};
  Hull(Hull const&) = delete;
  Hull(std::vector<std::array<float, 3>> const& points, std::vector<std::array<int, 3>> const& triangles) {
    for (int i = 0; i < int(points.size()); ++i) {
      hull.push_back(i);
      vertices.push_back({T(points[i][0]), T(points[i][1]), T(points[i][2])});
      for (int k = 0; k < 3; ++k) size[k] = std::max(size[k], std::abs(T(points[i][k])));
    }
    faces = detail::hull_faces(points, hull, triangles);
    for (auto const& n : faces.normal) normals.push_back({T(n.x), T(n.y), T(n.z)});
    asset.vertices = vertices.data();
    asset.hull = hull.data();
    asset.vertex_count = asset.hull_count = int(hull.size());
    asset.face_count = int(normals.size());
    asset.face_first = faces.first.data();
    asset.face_corners = faces.corners.data();
    asset.face_normal = normals.data();
    asset.neighbor_first = faces.neighbor_first.data();
    asset.neighbors = faces.neighbors.data();
  }
};

struct Solid {
  std::vector<std::array<float, 3>> points;
  std::vector<std::array<int, 3>> triangles;
};
/// A prism over a regular polygon of n corners, half height h; n = 4, r = sqrt(2) s: a cube of half size s, turned so that its sides are
/// along the axes.
inline Solid prism(int n, double r, double h) {
  Solid s;
  for (int up = -1; up <= 1; up += 2)
    for (int i = 0; i < n; ++i) {
      double const angle = 2 * 3.14159265358979323846 * (i + 0.5) / n;
      s.points.push_back({float(r * std::cos(angle)), float(r * std::sin(angle)), float(up * h)});
    }
  for (int i = 1; i + 1 < n; ++i) {
    s.triangles.push_back({0, i + 1, i});
    s.triangles.push_back({n, n + i, n + i + 1});
  }
  for (int i = 0; i < n; ++i) {
    int const j = (i + 1) % n;
    s.triangles.push_back({i, j, n + j});
    s.triangles.push_back({i, n + j, n + i});
  }
  return s;
}
/// Rings of points on an ellipsoid: `rings` times `around`, and two poles.
inline Solid ball(int rings, int around, double a, double b, double c) {
  Solid s;
  double const pi = 3.14159265358979323846;
  s.points.push_back({0, 0, float(-c)});
  for (int r = 1; r <= rings; ++r)
    for (int i = 0; i < around; ++i) {
      double const t = pi * r / (rings + 1), w = 2 * pi * i / around;
      s.points.push_back({float(a * std::sin(t) * std::cos(w)), float(b * std::sin(t) * std::sin(w)), float(-c * std::cos(t))});
    }
  s.points.push_back({0, 0, float(c)});
  int const top = int(s.points.size()) - 1;
  auto const at = [&](int r, int i) { return 1 + r * around + i % around; };
  for (int i = 0; i < around; ++i) {
    s.triangles.push_back({0, at(0, i + 1), at(0, i)});
    s.triangles.push_back({top, at(rings - 1, i), at(rings - 1, i + 1)});
    for (int r = 0; r + 1 < rings; ++r) {
      s.triangles.push_back({at(r, i), at(r, i + 1), at(r + 1, i + 1)});
      s.triangles.push_back({at(r, i), at(r + 1, i + 1), at(r + 1, i)});
    }
  }
  return s;
}

/// The farthest value along d over the shape, in double, from its own support.
template <class T>
double top(ShapeType type, Shape<T> const& s, Vec3<double> const& d) {
  Vec3<T> const f{T(d.x), T(d.y), T(d.z)};
  Vec3<T> const q = s.p + s.R * support(type, ShapeData<T>{s.size, s.asset}, transpose_times(s.R, f));
  return d.x * q.x + d.y * q.y + d.z * q.z;
}
/// max n.x over a - min n.y over b: how far b must move along n to be free of a.
template <class T>
double overlap(ShapeType ta, Shape<T> const& a, ShapeType tb, Shape<T> const& b, Vec3<double> const& n) {
  return top(ta, a, n) + top(tb, b, -n);
}

template <class T>
Shape<T> cast(Shape<double> const& s, ShapeAsset<T> const* asset = nullptr) {
  Shape<T> r;
  for (int i = 0; i < 3; ++i) {
    r.p[i] = T(s.p[i]);
    r.size[i] = T(s.size[i]);
  }
  for (int i = 0; i < 9; ++i) r.R.m[i] = T(s.R.m[i]);
  r.asset = asset;
  return r;
}

struct Random {
  std::mt19937 engine;
  explicit Random(unsigned seed) : engine(seed) {}
  double operator()() { return std::uniform_real_distribution<double>(-1, 1)(engine); }
  double gauss() { return std::normal_distribution<double>()(engine); }
  Vec3<double> direction() { return normalized(Vec3<double>{gauss(), gauss(), gauss()}); }
  Quat<double> turn() { return normalized(Quat<double>{gauss(), gauss(), gauss(), gauss()}); }
};

}  // namespace gsp_test
