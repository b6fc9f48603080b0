#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/detail/mesh_files.hpp>
#include <gsp/io/mesh_builtin.hpp>
#include <initializer_list>
#include <map>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace gsp::io {

namespace detail {

/// The parameters of one mesh, checked one by one. A count is given as a whole number.
class BuiltinParameters {
 public:
  BuiltinParameters(std::span<double const> values, std::string const& what) : values_(values), what_(what) {}
  void require(bool good, std::string const& sentence) const {
    if (!good) fail(what_, "", sentence);
  }
  void require_size(std::initializer_list<std::size_t> sizes, char const* names) const {
    bool const good = std::find(sizes.begin(), sizes.end(), values_.size()) != sizes.end();
    require(good, "has " + std::to_string(values_.size()) + " numbers in params; give " + names);
  }
  double number(std::size_t i) const {
    require(std::isfinite(values_[i]), "has a number in params that is not finite; correct it");
    return values_[i];
  }
  int count(std::size_t i, char const* name, int least, int most = 1'000'000) const {
    double const x = number(i);
    require(x == std::floor(x) && x >= least && x <= most, std::string("has a ") + name + " that is not a whole number from " +
                                                               std::to_string(least) + " to " + std::to_string(most) + "; correct params");
    return static_cast<int>(x);
  }
  double in_range(std::size_t i, char const* name, double low, double high, bool open_below) const {
    double const x = number(i);
    require(x <= high && (open_below ? x > low : x >= low), std::string("has ") + name + " out of its range; correct params");
    return x;
  }
  /// So that no file fills the memory.
  void require_vertices(double count) const { require(count <= 1'000'000, "asks for more than a million vertices; give lower counts"); }

 private:
  std::span<double const> values_;
  std::string const& what_;
};

inline Vertex rounded(Double3 const& x) { return {static_cast<float>(x[0]), static_cast<float>(x[1]), static_cast<float>(x[2])}; }

/// In float, each product rounded by itself on every machine: volatile keeps compilers from a fused multiply-add.
inline float sum_of_squares(Vertex const& x) {
  float const volatile square[3] = {x[0] * x[0], x[1] * x[1], x[2] * x[2]};
  return square[0] + square[1] + square[2];
}

/// An icosahedron, each triangle cut into four, `times` times over, new vertices pushed out to the unit sphere. In float, as MuJoCo has it.
inline void builtin_sphere(MeshDescription& mesh, int times) {
  float const phi = static_cast<float>((1 + std::sqrt(5.)) / 2);
  double const norm = std::sqrt(1. + phi * phi);
  float const a = static_cast<float>(1 / norm), b = static_cast<float>(phi / norm);
  mesh.vertices = {{-a, b, 0},  {a, b, 0},  {-a, -b, 0}, {a, -b, 0}, {0, -a, b},  {0, a, b},
                   {0, -a, -b}, {0, a, -b}, {b, 0, -a},  {b, 0, a},  {-b, 0, -a}, {-b, 0, a}};
  mesh.faces = {{0, 11, 5}, {0, 5, 1}, {0, 1, 7}, {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                {3, 9, 4},  {3, 4, 2}, {3, 2, 6}, {3, 6, 8},  {3, 8, 9},   {4, 9, 5}, {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (int i = 0; i < times; ++i) {
    std::map<std::pair<int, int>, int> halves;  // of the edges, each of which belongs to two faces
    auto const half = [&](int u, int v) {
      auto const [at, is_new] = halves.try_emplace(std::minmax(u, v), static_cast<int>(mesh.vertices.size()));
      if (is_new) {
        Vertex x{};
        for (std::size_t k = 0; k < 3; ++k) x[k] = (mesh.vertices[std::size_t(u)][k] + mesh.vertices[std::size_t(v)][k]) / 2;
        float const length = std::sqrt(sum_of_squares(x));
        for (float& e : x) e /= length;
        mesh.vertices.push_back(x);
      }
      return at->second;
    };
    std::vector<Triangle> finer;
    for (auto const& [u, v, w] : mesh.faces) {
      int const uv = half(u, v);
      int const vw = half(v, w);
      int const wu = half(w, u);
      finer.insert(finer.end(), {{u, uv, wu}, {v, vw, uv}, {w, wu, vw}, {uv, vw, wu}});
    }
    mesh.faces = std::move(finer);
  }
}

/// The upper half of an octahedron, each side cut into (resolution + 1)^2 triangles, pushed out to the unit sphere; row n below the pole
/// has 4 n vertices. Below, a fan about the origin closes it.
inline void builtin_hemisphere(MeshDescription& mesh, int resolution) {
  int const rows = resolution + 1;
  double const equator[5][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}, {1, 0}};
  auto const first = [](int row) { return 2 * row * (row - 1) + 1; };  // vertex of a row, counted from 1
  mesh.vertices = {{0, 0, 1}};
  for (int row = 1; row <= rows; ++row)
    for (int side = 0; side < 4; ++side) {
      double const share = static_cast<double>(row) / rows;
      for (int i = 0; i < row; ++i) {
        Double3 x{0, 0, 1 - share};
        for (std::size_t k = 0; k < 2; ++k) {
          double const from = share * equator[side][k];
          x[k] = from + i * ((share * equator[side + 1][k] - from) / row);
        }
        double const length = std::sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
        mesh.vertices.push_back(rounded({x[0] / length, x[1] / length, x[2] / length}));
      }
    }
  int const center = static_cast<int>(mesh.vertices.size());
  mesh.vertices.push_back({0, 0, 0});
  for (int side = 0; side < 4; ++side) mesh.faces.push_back({0, 1 + side, 1 + (side + 1) % 4});
  for (int row = 1; row < rows; ++row)
    for (int side = 0; side < 4; ++side)
      for (int i = 0; i <= row; ++i) {
        auto const upper = [&](int k) { return first(row) + (k + row * side) % (4 * row); };
        auto const lower = [&](int k) { return first(row + 1) + (k + (row + 1) * side) % (4 * (row + 1)); };
        mesh.faces.push_back({upper(i), lower(i), lower(i + 1)});
        if (i < row) mesh.faces.push_back({upper(i), lower(i + 1), upper(i + 1)});
      }
  for (int i = 0; i < 4 * rows; ++i) mesh.faces.push_back({first(rows) + i, center, first(rows) + (i + 1) % (4 * rows)});
}

/// Regular polygons at z = -1 (of radius 1) and z = 1; the upper one may be a point.
inline void builtin_cone(MeshDescription& mesh, int corners, double radius) {
  for (double const r : {1., radius})
    for (int i = 0; i < (r > 0 ? corners : 1); ++i) {
      double const angle = 2 * i * std::numbers::pi / corners;
      mesh.vertices.push_back(rounded({r * std::cos(angle), r * std::sin(angle), mesh.vertices.size() < std::size_t(corners) ? -1. : 1.}));
    }
}

/// |cos|^e and |sin|^e with the sign of cos and sin: what bends a circle towards a square or a star.
inline double power_cos(double angle, double e) { return std::copysign(std::pow(std::abs(std::cos(angle)), e), std::cos(angle)); }
inline double power_sin(double angle, double e) { return std::copysign(std::pow(std::abs(std::sin(angle)), e), std::sin(angle)); }

/// Two triangles of the quad between rows i, i + 1 and columns k, k + 1 (mod n) of a table of vertices.
inline void builtin_quad(MeshDescription& mesh, int v1, int v2, int v3, int v4) {
  mesh.faces.push_back({v1, v2, v4});
  mesh.faces.push_back({v2, v3, v4});
}

inline void builtin_supersphere(MeshDescription& mesh, int n, double east, double north) {
  double const pi = std::numbers::pi;
  mesh.vertices = {{0, 0, -1}};
  for (int i = 1; i < n; ++i)
    for (int k = 0; k < n; ++k) {
      double const v = -pi / 2 + i * pi / n;
      double const u = -pi + k * 2 * pi / n;
      double const c = power_cos(v, north);
      mesh.vertices.push_back(rounded({c * power_cos(u, east), c * power_sin(u, east), power_sin(v, north)}));
    }
  mesh.vertices.push_back({0, 0, 1});
  auto const at = [&](int ring, int k) { return 1 + ring * n + k % n; };
  for (int k = 0; k < n; ++k) mesh.faces.push_back({0, at(0, k + 1), at(0, k)});
  for (int i = 0; i + 2 < n; ++i)
    for (int k = 0; k < n; ++k) builtin_quad(mesh, at(i, k), at(i, k + 1), at(i + 1, k + 1), at(i + 1, k));
  for (int k = 0; k < n; ++k) mesh.faces.push_back({at(n - 2, k), at(n - 2, k + 1), static_cast<int>(mesh.vertices.size()) - 1});
}

inline void builtin_supertorus(MeshDescription& mesh, int n, double radius, double minor, double major) {
  double const pi = std::numbers::pi;
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k) {
      double const u = 2 * pi * i / n;
      double const v = 2 * pi * k / n;
      double const r = 1 + radius * power_cos(v, minor);
      mesh.vertices.push_back(rounded({r * power_cos(u, major), r * power_sin(u, major), radius * power_sin(v, minor)}));
    }
  auto const at = [&](int i, int k) { return i % n * n + k % n; };
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k) builtin_quad(mesh, at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1));
}

/// Middles of a table of cells on the unit sphere, seen along -z; gamma moves cells towards the middle by x -> gamma x^5 + (1 - gamma) x.
inline void builtin_wedge(MeshDescription& mesh, std::array<int, 2> n, std::array<double, 2> degrees, double gamma) {
  auto const middle = [&](std::size_t axis, int i) {
    auto const edge = [&](int k) {
      double const x = -1 + k * (2. / n[axis]);
      return (gamma * std::pow(x, 5) + (1 - gamma) * x) * (degrees[axis] * std::numbers::pi / 180);
    };
    return 0.5 * (edge(i + 1) + edge(i));
  };
  for (int i = 0; i < n[0]; ++i)
    for (int k = 0; k < n[1]; ++k) {
      double const azimuth = middle(0, i);
      double const elevation = middle(1, k);
      mesh.vertices.push_back(
          rounded({std::cos(elevation) * std::sin(azimuth), std::sin(elevation), -std::cos(elevation) * std::cos(azimuth)}));
    }
}

/// Middles of the cells of the square [-1, 1]^2 at z = -1.
inline void builtin_plate(MeshDescription& mesh, std::array<int, 2> n) {
  for (int i = 0; i < n[0]; ++i)
    for (int k = 0; k < n[1]; ++k) mesh.vertices.push_back(rounded({-1 + (i + .5) * (2. / n[0]), -1 + (k + .5) * (2. / n[1]), -1}));
  for (int i = 1; i < n[0]; ++i)
    for (int k = 1; k < n[1]; ++k) {
      int const v1 = (i - 1) * n[1] + k - 1;
      int const v2 = v1 + n[1];
      mesh.faces.push_back({v1, v2, v1 + 1});
      mesh.faces.push_back({v2 + 1, v1 + 1, v2});
    }
}

/// What grid, square, disc, box, cylinder and ellipsoid share: points of a lattice about the origin.
struct BuiltinLattice {
  std::string_view type;
  std::array<int, 3> count;
  Double3 spacing;

  double grid(std::size_t k, int i) const { return spacing[k] * (i - .5 * (count[k] - 1)); }
  /// A vector made one of length 1 in its first n coordinates; zero stays zero.
  static void normalize(Double3& x, std::size_t n) {
    double length = 0;
    for (std::size_t k = 0; k < n; ++k) length += x[k] * x[k];
    length = std::sqrt(length);
    for (std::size_t k = 0; k < n && length > 0; ++k) x[k] /= length;
  }
  /// A point of the surface of the cube [-1, 1]^3, pushed to the shape.
  Vertex surface(int ix, int iy, int iz) const {
    Double3 x{2. * ix / (count[0] - 1) - 1, 2. * iy / (count[1] - 1) - 1, 2. * iz / (count[2] - 1) - 1};
    if (type == "cylinder") {
      double const ring = std::max(std::abs(x[0]), std::abs(x[1]));
      normalize(x, 2);
      x[0] *= ring;
      x[1] *= ring;
    }
    if (type == "ellipsoid") normalize(x, 3);
    for (std::size_t k = 0; k < 3; ++k) x[k] *= .5 * spacing[k] * (count[k] - 1);
    return rounded(x);
  }
};

inline void builtin_volume_grid(MeshDescription& mesh, BuiltinLattice const& l) {
  for (int ix = 0; ix < l.count[0]; ++ix)
    for (int iy = 0; iy < l.count[1]; ++iy)
      for (int iz = 0; iz < l.count[2]; ++iz) mesh.vertices.push_back(rounded({l.grid(0, ix), l.grid(1, iy), l.grid(2, iz)}));
}

/// A table of vertices in the plane z = 0. The disc: MuJoCo's squares of the side s go to circles of the radius s times half its width, and
/// the diagonals of two of the four quadrants are turned.
inline void builtin_flat(MeshDescription& mesh, BuiltinLattice const& l) {
  bool const disc = l.type == "disc";
  for (int ix = 0; ix < l.count[0]; ++ix)
    for (int iy = 0; iy < l.count[1]; ++iy) {
      double const px = l.grid(0, ix);
      double const py = l.grid(1, iy);
      Double3 x{px, py, 0};
      if (disc) {
        double const ring = std::max(std::abs(px), std::abs(py));
        BuiltinLattice::normalize(x, 2);
        for (std::size_t k = 0; k < 2; ++k) x[k] *= .5 * l.spacing[k] * (l.count[k] - 1) * ring;
      }
      mesh.vertices.push_back(rounded(x));
      if (ix + 1 == l.count[0] || iy + 1 == l.count[1]) continue;
      int const v0 = ix * l.count[1] + iy;
      int const v1 = v0 + l.count[1];
      double const tiny = 1e-14;
      bool const turned = disc && ((px < -tiny && py > -tiny) || (px > -tiny && py < -tiny));
      mesh.faces.push_back({v0, v1, turned ? v0 + 1 : v1 + 1});
      mesh.faces.push_back({turned ? v1 : v0, v1 + 1, v0 + 1});
    }
}

/// The surface of a box, cylinder or ellipsoid: of dim 3 with a point in the middle and no faces; of dim 2 open above.
inline void builtin_surface(MeshDescription& mesh, BuiltinLattice const& l, bool volume) {
  auto const [nx, ny, nz] = l.count;
  std::map<std::array<int, 3>, int> index;
  auto const put = [&](int ix, int iy, int iz) {
    index[{ix, iy, iz}] = static_cast<int>(mesh.vertices.size());
    mesh.vertices.push_back(l.surface(ix, iy, iz));
  };
  int const above = volume ? nz - 1 : nz;  // rows of the sides end here
  if (volume) mesh.vertices.push_back({0, 0, 0});
  for (int iz : {0, nz - 1})
    for (int ix = 0; ix < nx && (volume || iz == 0); ++ix)
      for (int iy = 0; iy < ny; ++iy) put(ix, iy, iz);
  for (int iy : {0, ny - 1})
    for (int ix = 0; ix < nx; ++ix)
      for (int iz = 1; iz < above; ++iz) put(ix, iy, iz);
  for (int ix : {0, nx - 1})
    for (int iy = 1; iy + 1 < ny; ++iy)
      for (int iz = 1; iz < above; ++iz) put(ix, iy, iz);
  if (volume) return;
  auto const at = [&](int ix, int iy, int iz) { return index.at({ix, iy, iz}); };
  for (int ix = 0; ix + 1 < nx; ++ix)
    for (int iy = 0; iy + 1 < ny; ++iy) {
      mesh.faces.push_back({at(ix, iy, 0), at(ix + 1, iy + 1, 0), at(ix + 1, iy, 0)});
      mesh.faces.push_back({at(ix, iy, 0), at(ix, iy + 1, 0), at(ix + 1, iy + 1, 0)});
    }
  auto const side = [&](auto const& vertex, int i, int iz, bool forward) {  // quads that run from i to i + 1, or back
    int const from = forward ? i : i + 1;
    int const to = forward ? i + 1 : i;
    mesh.faces.push_back({vertex(from, iz), vertex(to, iz), vertex(to, iz + 1)});
    mesh.faces.push_back({vertex(from, iz), vertex(to, iz + 1), vertex(from, iz + 1)});
  };
  for (int iy : {0, ny - 1})
    for (int ix = 0; ix + 1 < nx; ++ix)
      for (int iz = 0; iz + 1 < nz; ++iz) side([&](int i, int z) { return at(i, iy, z); }, ix, iz, iy == 0);
  for (int ix : {0, nx - 1})
    for (int iy = 0; iy + 1 < ny; ++iy)
      for (int iz = 0; iz + 1 < nz; ++iz) side([&](int i, int z) { return at(ix, i, z); }, iy, iz, ix != 0);
}

inline void builtin_lattice(MeshDescription& mesh, std::string_view type, BuiltinParameters const& p, std::size_t size,
                            MeshInertia inertia) {
  bool const always_flat = type == "square" || type == "disc";
  if (always_flat)
    p.require_size({6}, "three counts and three spacings");
  else
    p.require_size({6, 7}, "three counts, three spacings and, if it is not 3, the dimension");
  int const dim = always_flat ? 2 : size == 7 ? p.count(6, "dimension", 2, 3) : 3;
  bool const closed = type == "box" || type == "cylinder" || type == "ellipsoid";
  BuiltinLattice l{type, {}, {}};
  for (std::size_t k = 0; k < 3; ++k) {
    bool const one = !closed && dim == 2 && k == 2;
    l.count[k] = p.count(k, "count", one ? 1 : 2, one ? 1 : 1'000'000);
    l.spacing[k] = p.number(3 + k);
  }
  double const x = l.count[0], y = l.count[1], z = l.count[2];
  p.require_vertices(closed ? 2 * (x * y + x * z + y * z) : x * y * z);
  if (closed)
    builtin_surface(mesh, l, dim == 3);
  else if (dim == 2)
    builtin_flat(mesh, l);
  else
    builtin_volume_grid(mesh, l);
  mesh.inertia = dim == 2 && inertia == MeshInertia::legacy ? MeshInertia::shell : inertia;
}

}  // namespace detail

GSP_INLINE MeshDescription make_builtin_mesh(std::string_view type, std::span<double const> params, std::string const& what,
                                             MeshInertia inertia) {
  detail::BuiltinParameters const p(params, what);
  MeshDescription mesh;
  mesh.inertia = inertia;
  if (type == "sphere") {
    p.require_size({1}, "the number of subdivisions");
    detail::builtin_sphere(mesh, p.count(0, "number of subdivisions", 0, 4));
  } else if (type == "hemisphere") {
    p.require_size({1}, "the resolution");
    detail::builtin_hemisphere(mesh, p.count(0, "resolution", 0, 10));
  } else if (type == "cone") {
    p.require_size({2}, "the number of corners and the upper radius");
    detail::builtin_cone(mesh, p.count(0, "number of corners", 3, 500'000), p.in_range(1, "a radius", 0, 1, false));
  } else if (type == "supersphere") {
    p.require_size({3}, "the resolution and two exponents");
    int const n = p.count(0, "resolution", 3);
    p.require_vertices(double(n) * n);
    detail::builtin_supersphere(mesh, n, p.in_range(1, "an exponent", 0, 1e9, false), p.in_range(2, "an exponent", 0, 1e9, false));
  } else if (type == "supertorus") {
    p.require_size({4}, "the resolution, the radius and two exponents");
    int const n = p.count(0, "resolution", 3);
    p.require_vertices(double(n) * n);
    double const radius = p.in_range(1, "a radius", 0, 1, true);
    detail::builtin_supertorus(mesh, n, radius, p.in_range(2, "an exponent", 0, 1e9, true), p.in_range(3, "an exponent", 0, 1e9, true));
  } else if (type == "wedge" || type == "plate") {
    bool const wedge = type == "wedge";
    p.require_size({wedge ? 5u : 2u}, wedge ? "two resolutions, two angles and gamma" : "two resolutions");
    std::array const n{p.count(0, "resolution", 1), p.count(1, "resolution", 1)};
    p.require_vertices(double(n[0]) * n[1]);
    if (wedge)
      detail::builtin_wedge(mesh, n, {p.in_range(2, "a horizontal angle", 0, 180, true), p.in_range(3, "a vertical angle", 0, 90, true)},
                            p.in_range(4, "gamma", 0, 1, false));
    else
      detail::builtin_plate(mesh, n);
    if (!wedge) mesh.inertia = MeshInertia::shell;
  } else if (std::find(builtin_meshes.begin(), builtin_meshes.end(), type) != builtin_meshes.end()) {
    detail::builtin_lattice(mesh, type, p, params.size(), inertia);
  } else {
    std::string all;
    for (auto const& name : builtin_meshes) all += (all.empty() ? "" : ", ") + std::string(name);
    detail::fail(what, "", "is a built-in mesh '" + std::string(type) + "', which does not exist; use one of: " + all);
  }
  if (mesh.vertices.size() < 4)
    detail::fail(what, "", "has " + std::to_string(mesh.vertices.size()) + " vertices and a mesh needs at least 4; give higher counts");
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
    if (!detail::is_vertex(mesh.vertices[i])) detail::fail_vertex(what, "vertex " + std::to_string(i));
  return mesh;
}

}  // namespace gsp::io
