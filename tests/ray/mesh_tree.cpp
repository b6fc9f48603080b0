// Trees of triangles: what a ray meets equals a look at all triangles, also where many are alike; nothing slips between triangles; no tree
// is deeper than a traversal has room for.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/ray/mesh_tree.hpp>

#include "dynamics/random_tree.hpp"

namespace {
using Vertices = std::vector<std::array<float, 3>>;
using Faces = std::vector<std::array<int, 3>>;

/// All faces in turn, by the same test: the first of the nearest.
template <class T>
gsp::MeshHit<T> all_faces(Vertices const& v, Faces const& f, gsp::Ray<T> const& ray) {
  gsp::MeshHit<T> best;
  gsp::detail::TriangleRay<T> const through(ray);
  auto const at = [&](int i) { return gsp::Vec3<float>{v[std::size_t(i)][0], v[std::size_t(i)][1], v[std::size_t(i)][2]}; };
  for (std::size_t k = 0; k < f.size(); ++k) {
    T const x = through.hit(at(f[k][0]), at(f[k][1]), at(f[k][2]));
    if (x < best.x) best = {x, int(k), -1};
  }
  return best;
}
int depth_of(gsp::MeshTree const& tree, int node) {
  int deepest = 0;
  for (int const child : tree.nodes[std::size_t(node)].child)
    if (child >= 0) deepest = std::max(deepest, 1 + depth_of(tree, child));
  return deepest;
}
/// Each face is in one leaf.
void check_tree(gsp::MeshTree const& tree, std::size_t faces) {
  std::vector<int> seen(faces);
  for (auto const& n : tree.nodes)
    for (int const child : n.child)
      for (int t = ~child / 8; child < 0 && t < ~child / 8 + ~child % 8; ++t) ++seen[std::size_t(tree.triangles[std::size_t(t)].face)];
  for (int const s : seen) REQUIRE(s == 1);
  CHECK(depth_of(tree, 0) + 1 < gsp::ray_tree_depth);
}
/// A ball of triangles, closed.
void ball(int rings, int columns, Vertices& v, Faces& f) {
  for (int i = 0; i <= rings; ++i)
    for (int j = 0; j < columns; ++j) {
      double const a = M_PI * i / rings, b = 2 * M_PI * j / columns, r = i == rings ? 0 : std::sin(a);  // the poles are points
      v.push_back({float(r * std::cos(b)), float(r * std::sin(b)), float(std::cos(a))});
    }
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < columns; ++j) {
      int const a = i * columns + j, b = i * columns + (j + 1) % columns, c = a + columns, d = b + columns;
      f.push_back({a, c, b});
      f.push_back({b, c, d});
    }
}
}  // namespace

TEST_CASE_TEMPLATE("a soup of triangles: the nearest of all, to the bit", T, double, float) {
  gsp_test::Random r{11};
  for (int const count : {1, 2, 5, 100, 5000}) {
    Vertices v;
    Faces f;
    for (int k = 0; k < count; ++k) {
      gsp::Vec3<double> const at{r(), r(), r()};
      for (int i = 0; i < 3; ++i) v.push_back({float(at.x + 0.1 * r()), float(at.y + 0.1 * r()), float(at.z + 0.1 * r())});
      f.push_back({3 * k, 3 * k + 1, 3 * k + 2});
      if (k % 7 == 0) f.push_back({3 * k, 3 * k + 1, 3 * k + 2});                     // twice the same
      if (k % 11 == 0) f.push_back({3 * k, 3 * k, 3 * k + 1});                        // a line
      if (k % 5 == 0) v.back()[2] = v[v.size() - 2][2] = v[v.size() - 3][2] = 0.25f;  // in a plane with others
    }
    auto const tree = gsp::make_mesh_tree(v, f);
    check_tree(tree, f.size());
    int hits = 0;
    for (int k = 0; k < 3000; ++k) {
      gsp::Vec3<T> const o{T(2 * r()), T(2 * r()), T(2 * r())}, to{T(r()), T(r()), k % 4 == 0 ? o.z : T(r())};
      gsp::Ray<T> ray{o, T(std::exp(3 * r())) * (to - o)};
      if (k % 10 == 0) ray.direction = {T(0), T(0), T(-1)};
      auto const mine = gsp::ray_mesh(tree.nodes.data(), tree.triangles.data(), ray), all = all_faces(v, f, ray);
      REQUIRE(mine.x == all.x);
      REQUIRE(mine.face == all.face);
      hits += all.face >= 0;
    }
    CHECK(hits >= (count >= 100 ? 100 : 0));
  }
}

TEST_CASE_TEMPLATE("nothing slips out of a closed mesh, through its edges and vertices neither", T, double, float) {
  Vertices v;
  Faces f;
  ball(20, 40, v, f);
  auto const tree = gsp::make_mesh_tree(v, f);
  check_tree(tree, f.size());
  gsp_test::Random r{5};
  int lost = 0;
  for (int k = 0; k < 200000; ++k) {
    gsp::Vec3<T> const o{T(0.3 * r()), T(0.3 * r()), T(0.3 * r())};
    auto const& a = v[std::size_t(k) % v.size()];
    auto const& b = v[std::size_t(k + 1) % v.size()];
    T const s = k % 3 == 0 ? T(0) : T(0.5 + 0.5 * r());  // to a vertex, and to a point of an edge
    gsp::Vec3<T> const to{a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])};
    lost += gsp::ray_mesh(tree.nodes.data(), tree.triangles.data(), gsp::Ray<T>{o, to - o}).face < 0;
  }
  CHECK(lost == 0);
}

TEST_CASE("trees of slivers and of equal triangles have a bounded depth") {
  for (int const kind : {0, 1, 2}) {
    Vertices v;
    Faces f;
    int const count = 200000;
    for (int k = 0; k < count; ++k) {
      float const x = kind == 0 ? 0.f : kind == 1 ? std::ldexp(1.f, -(k % 120)) : float(k) * float(k);  // equal; ever closer; ever wider
      v.push_back({x, 0, 0});
      v.push_back({x, 1, 0});
      v.push_back({x, 0, 1});
      f.push_back({3 * k, 3 * k + 1, 3 * k + 2});
    }
    auto const tree = gsp::make_mesh_tree(v, f);
    check_tree(tree, f.size());
    auto const hit = gsp::ray_mesh(tree.nodes.data(), tree.triangles.data(), gsp::Ray<double>{{-1, 0.25, 0.25}, {1, 0, 0}});
    CHECK(hit.x == 1);
    CHECK(hit.face == (kind == 1 ? 53 : 0));  // 1 + 2^-53 is 1
  }
  auto const empty = gsp::make_mesh_tree({}, {});
  CHECK(gsp::ray_mesh(empty.nodes.data(), empty.triangles.data(), gsp::Ray<float>{{0, 0, 0}, {1, 0, 0}}).face == -1);
}

TEST_CASE("directions of 0, NaN and infinity meet nothing, and faces with a number that is none are left out") {
  Vertices v;
  Faces f;
  ball(4, 8, v, f);
  auto const tree = gsp::make_mesh_tree(v, f);
  for (float const bad : {0.f, float(NAN), float(INFINITY)}) {
    auto const hit = gsp::ray_mesh(tree.nodes.data(), tree.triangles.data(), gsp::Ray<float>{{0, 0, 0}, {bad, bad, bad}});
    CHECK(hit.face == -1);
  }
  CHECK(gsp::ray_mesh(tree.nodes.data(), tree.triangles.data(), gsp::Ray<float>{{NAN, 0, 0}, {1, 0, 0}}).face == -1);
  v[9] = {NAN, NAN, NAN};
  v[20] = {0, INFINITY, 0};
  std::size_t whole = 0;
  for (auto const& face : f) whole += face[0] != 9 && face[1] != 9 && face[2] != 9 && face[0] != 20 && face[1] != 20 && face[2] != 20;
  auto const rest = gsp::make_mesh_tree(v, f);
  CHECK(rest.triangles.size() == whole);
  gsp_test::Random r{3};
  for (int k = 0; k < 1000; ++k) {
    gsp::Ray<float> const ray{{0, 0, 0}, {float(r()), float(r()), float(r())}};
    CHECK(gsp::ray_mesh(rest.nodes.data(), rest.triangles.data(), ray).x == all_faces(v, f, ray).x);
  }
  CHECK_THROWS_WITH_AS(gsp::make_mesh_tree({{0, 0, 0}}, {{0, 0, -1}}), doctest::Contains("face 0 has a vertex -1, and there are 1"),
                       std::invalid_argument);
}

TEST_CASE_TEMPLATE("rays along the faces of a cube, in their planes and through its corners", T, double, float) {
  Vertices v;
  for (int k = 0; k < 8; ++k) v.push_back({k & 1 ? 1.f : -1.f, k & 2 ? 1.f : -1.f, k & 4 ? 1.f : -1.f});
  Faces const f{{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  auto const tree = gsp::make_mesh_tree(v, f);
  int met = 0;
  for (int axis = 0; axis < 3; ++axis)
    for (T const a : {T(-1), T(-0.5), T(0), T(0.5), T(1)})
      for (T const b : {T(-1), T(-0.25), T(0), T(0.25), T(1)})
        for (T const way : {T(1), T(-1), T(1e-20), T(3e20)}) {
          gsp::Ray<T> ray{{a, a, a}, {T(0), T(0), T(0)}};
          ray.origin[axis] = way > 0 ? T(-5) : T(5);
          ray.origin[(axis + 1) % 3] = b;
          ray.direction[axis] = way;
          auto const mine = gsp::ray_mesh(tree.nodes.data(), tree.triangles.data(), ray);
          CHECK(double(mine.x) * std::fabs(double(way)) == doctest::Approx(4));
          ++met;
        }
  CHECK(met == 300);
}

// Two walls, a leaf each: the one ray that meets the first needs no second, and the others, which look away, meet none.
TEST_CASE_TEMPLATE("a pack does not look behind what it meets for rays that meet nothing", R, double, float) {
  using T = gsp::Pack<R, gsp::native_width<R>>;
  Vertices v;
  Faces f;
  for (float const x : {1.f, 3.f})
    for (int k = 0; k < 4; ++k) {
      float const y = float(k) - 2;
      for (auto const& p : {std::array{x, y, -1.f}, std::array{x, y + 1, -1.f}, std::array{x, y, 2.f}}) v.push_back(p);
      int const n = int(v.size());
      f.push_back({n - 3, n - 2, n - 1});
    }
  auto const tree = gsp::make_mesh_tree(v, f);
  T const ahead = T::of([](int l) { return R(l == 0 ? 1 : -1); }), zero(R(0));
  gsp::Ray<T> const ray{{zero, T(R(0.1)), zero}, {ahead, zero, zero}};
  T most = gsp::detail::no_hit<T>();
  int leaves = 0;
  auto const take = [&](int first, int end) {
    ++leaves;
    for (int t = first; t < end; ++t) CHECK(tree.triangles[std::size_t(t)].a.x == 1);
    most.set(0, R(1));
  };
  gsp::detail::visit_leaves(
      tree.nodes.data(), gsp::detail::BoxRay<T>(ray), [&] { return most; }, take);
  CHECK(leaves == 1);
}
