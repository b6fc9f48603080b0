#pragma once
#include <libqhull_r/libqhull_r.h>

#include <cmath>
#include <cstdio>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/mesh_hull.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <memory>
#include <string>
#include <unordered_set>
#include <vector>

namespace gsp::io {

namespace detail {

/// A hull needs four points that do not lie in one plane; the thresholds are MuJoCo's.
inline void expect_volume(std::vector<double> const& x, std::string const& what) {
  using namespace gsp::detail;
  auto const at = [&](std::size_t i) { return Double3{x[3 * i], x[3 * i + 1], x[3 * i + 2]}; };
  std::size_t const n = x.size() / 3;
  constexpr double tiny = 1e-15;
  std::size_t second = 1;
  while (second < n && !(norm(at(second) - at(0)) > tiny)) ++second;
  if (second >= n) fail(what, "", "has all its vertices in one place, and its convex hull is needed; use a small sphere");
  auto const edge = at(second) - at(0);
  double const length = norm(edge);
  Double3 normal{0, 0, 0};
  bool flat = true;
  for (std::size_t i = 1; i < n && flat; ++i) {
    auto const other = at(i) - at(0);
    if (i == second || norm(other) < tiny) continue;
    normal = cross(edge, other);
    double const size = norm(normal);
    if (size > tiny * length * norm(other)) {
      normal = (1 / size) * normal;
      flat = false;
    }
  }
  if (flat) fail(what, "", "has all its vertices on one line, and its convex hull is needed; use a thin capsule");
  double const offset = dot(normal, at(0));
  for (std::size_t i = 0; i < n; ++i)
    if (std::abs(dot(normal, at(i)) - offset) > tiny * length) return;
  fail(what, "", "has all its vertices in one plane, and its convex hull is needed; use a plane or a thin box");
}

}  // namespace detail

GSP_INLINE void add_hull(MeshDescription& mesh, std::string const& what) {
  if (mesh.vertices.size() < 4)
    detail::fail(what, "", "has " + std::to_string(mesh.vertices.size()) + " vertices, and a convex hull needs 4; add some");
  if (mesh.vertices.size() > 10'000'000)
    detail::fail(what, "", "has more than ten million vertices, and its convex hull is needed; simplify it");
  if (mesh.max_hull_vertices != -1 && mesh.max_hull_vertices < 4)
    detail::fail(what, "", "has a maxhullvert under 4; give 4 or more, or -1");
  std::vector<double> points;
  points.reserve(3 * mesh.vertices.size());
  for (auto const& v : mesh.vertices)
    for (float c : v) {
      if (!std::isfinite(c)) detail::fail(what, "", "has a vertex that is not finite; correct it");
      points.push_back(c);
    }
  detail::expect_volume(points, what);
  std::string command = "qhull Qt";  // triangulated facets
  if (mesh.max_hull_vertices > -1)
    command += " Q9 TA" + std::to_string(mesh.max_hull_vertices - 4);  // farthest first, so many after the first four
  struct Qhull {
    qhT state{};
    std::FILE* out = std::fopen("/dev/null", "w");  // it writes its findings there; ours is one sentence
    ~Qhull() {
      int long_memory = 0, pieces = 0;
      qh_freeqhull(&state, !qh_ALL);
      qh_memfreeshort(&state, &long_memory, &pieces);
      if (out) std::fclose(out);
    }
  };
  auto const hull = std::make_unique<Qhull>();
  qhT* const qh = &hull->state;
  qh_zero(qh, hull->out ? hull->out : stderr);
  int const code = qh_new_qhull(qh, 3, static_cast<int>(mesh.vertices.size()), points.data(), false, command.data(), nullptr,
                                hull->out ? hull->out : stderr);
  if (code != 0)
    detail::fail(
        what, "",
        "has no convex hull that can be computed (qhull's error " + std::to_string(code) + "); merge vertices that nearly coincide");
  mesh.hull.clear();
  for (facetT* facet = qh->facet_list; facet && facet->next; facet = facet->next) {
    std::array<int, 3> face{};
    int corners = 0;
    for (void** entry = &facet->vertices->e[0].p; *entry; ++entry) {
      if (corners == 3) detail::fail(what, "", "has a convex hull with a face that is no triangle; merge vertices that nearly coincide");
      face[static_cast<std::size_t>(corners++)] = qh_pointid(qh, static_cast<vertexT*>(*entry)->point);
    }
    if (facet->toporient) std::swap(face[0], face[1]);
    mesh.hull.push_back(face);
  }
}

GSP_INLINE void add_hulls(Description& description) {
  std::unordered_set<std::string> used, paired;
  for (auto const& pair : description.pairs) {
    paired.insert(pair.geom1);
    paired.insert(pair.geom2);
  }
  for (auto const& body : description.bodies)
    for (auto const& g : body.geoms)
      if (g.type == ShapeType::mesh && (!g.visual() || (!g.name.empty() && paired.count(g.name)))) used.insert(g.mesh);
  for (auto& mesh : description.meshes) {
    if (!mesh.hull.empty() || !(mesh.faces.empty() || mesh.inertia == MeshInertia::convex || used.count(mesh.name))) continue;
    bool const has_file = mesh.place.file >= 0 && mesh.place.file < int(description.files.size());
    auto const place = has_file ? description.files[std::size_t(mesh.place.file)] + ":" + std::to_string(mesh.place.line) + ": "
                       : description.name.empty() ? std::string("model: ")
                                                  : description.name + ": ";
    add_hull(mesh, place + "mesh '" + mesh.name + "'");
  }
}

}  // namespace gsp::io
