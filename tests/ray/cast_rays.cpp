// Rays of many worlds: each meets what it meets alone, with the same bits; errors; what is far from the world's origin. (Beside MuJoCo:
// tests/oracle/rays.cpp.)
#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/model/attach.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/ray/cast_rays.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"
#include "support/kernels.hpp"
#include "support/kokkos_tools.hpp"

namespace {
/// A table with a bowl of triangles, a hill, and a ball and a box that move.
gsp::Description room(double x0) {
  gsp::Description d;
  gsp::MeshDescription bowl;
  bowl.name = "bowl";
  int const rings = 6, columns = 12;
  for (int i = 1; i <= rings; ++i)
    for (int j = 0; j < columns; ++j) {
      double const a = M_PI / 2 * i / rings, b = 2 * M_PI * j / columns;
      bowl.vertices.push_back({float(0.3 * std::sin(a) * std::cos(b)), float(0.3 * std::sin(a) * std::sin(b)), float(-0.3 * std::cos(a))});
    }
  bowl.vertices.push_back({0, 0, -0.3f});
  for (int j = 0; j < columns; ++j) {
    int const n = (j + 1) % columns;
    bowl.faces.push_back({rings * columns, n, j});
    for (int i = 0; i + 1 < rings; ++i) {
      bowl.faces.push_back({i * columns + j, i * columns + n, (i + 1) * columns + j});
      bowl.faces.push_back({i * columns + n, (i + 1) * columns + n, (i + 1) * columns + j});
    }
  }
  d.meshes.push_back(bowl);
  gsp::HeightFieldDescription hill;
  hill.name = "hill";
  hill.rows = 4;
  hill.columns = 5;
  hill.size = {0.5, 0.4, 0.3, 0.1};
  for (int i = 0; i < 20; ++i) hill.elevation.push_back(float(i * 7 % 20) / 19);
  d.hfields.push_back(hill);
  d.bodies[0].geoms.push_back({.name = "floor", .type = gsp::ShapeType::plane, .size = {0, 0, 1}});
  d.bodies[0].geoms.push_back({.name = "hill", .type = gsp::ShapeType::hfield, .pos = {x0 + 1, 0.5, 0.2}, .hfield = "hill"});
  d.bodies[0].geoms.push_back({.name = "bowl", .type = gsp::ShapeType::mesh, .pos = {x0 - 1, 0, 0.5}, .mesh = "bowl"});
  int const ball = gsp::add_body(d, 0, "ball", {x0, 0, 0.5});
  d.bodies[ball].joints.push_back({.type = gsp::JointType::free});
  d.bodies[ball].geoms.push_back({.name = "ball", .size = {0.2, 0, 0}});
  int const box = gsp::add_body(d, 0, "box", {x0, 1, 0.5});
  d.bodies[box].joints.push_back({.type = gsp::JointType::free});
  d.bodies[box].geoms.push_back({.name = "box", .type = gsp::ShapeType::box, .size = {0.1, 0.2, 0.3}});
  return d;
}

template <class R, class Exec>
struct Cast {
  Exec exec;
  gsp::CompiledModel compiled;
  gsp::Model<R, typename Exec::memory_space> model;
  gsp::RayScene<R, typename Exec::memory_space> scene;
  gsp::Rays<R, typename Exec::memory_space> rays;
  gsp::RayHits<R, typename Exec::memory_space> hits;
  std::vector<R> distance, normal;
  std::vector<int> geom;

  /// World w is world `first + w` of a batch without end.
  Cast(int worlds, int count, int first = 0, double x0 = 0) : compiled(gsp::compile(room(x0))), model(gsp::make_model<R>(exec, compiled)) {
    auto state = gsp::make_state(exec, model, {.worlds = worlds});
    auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
    auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
    auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
    rays = gsp::make_rays<R>(exec, {.worlds = worlds, .count = count});
    hits = gsp::make_ray_hits<R>(exec, {.worlds = worlds, .count = count});
    auto const origin = Kokkos::create_mirror_view(rays.origin), direction = Kokkos::create_mirror_view(rays.direction);
    for (int w = 0; w < worlds; ++w) {
      gsp_test::Random r{unsigned(first + w) + 1};
      for (int b = 0; b < 2; ++b) {
        double q[4], sum = 0;
        for (double& x : q) {
          x = r();
          sum += x * x;
        }
        for (int c = 0; c < 3; ++c) qpos(w, 7 * b + c) += R(0.3 * r());
        for (int c = 0; c < 4; ++c) qpos(w, 7 * b + 3 + c) = R(q[c] / std::sqrt(sum));
      }
      for (int k = 0; k < count; ++k)
        for (int c = 0; c < 3; ++c) {
          origin(w, k, c) = R(c == 0 ? x0 + 2 * r() : c == 1 ? 2 * r() : 1 + r());
          direction(w, k, c) = R(r());
        }
    }
    Kokkos::deep_copy(state.qpos, qpos);
    Kokkos::deep_copy(rays.origin, origin);
    Kokkos::deep_copy(rays.direction, direction);
    gsp::forward_kinematics(exec, model, state, poses, dynamics);
    scene = gsp::make_ray_scene<R>(exec, model, compiled, {.worlds = worlds});
    gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::place_ray_geoms(exec, model, poses, scene); }));
    gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::cast_rays(exec, scene, rays, hits); }));
    read();
  }
  void read() {
    auto const host = [](auto const& v) { return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v); };
    auto const d = host(hits.distance);
    auto const n = host(hits.normal);
    auto const g = host(hits.geom);
    distance.assign(d.data(), d.data() + d.size());
    normal.assign(n.data(), n.data() + n.size());
    geom.assign(g.data(), g.data() + g.size());
  }
};
}  // namespace

TEST_CASE_TEMPLATE("a world's rays meet what they meet alone, with the same bits", Exec, GSP_TEST_EXECS) {
  int const worlds = 37, count = 129;
  Cast<float, Exec> const all(worlds, count);
  std::vector<int> met(5);
  for (int const g : all.geom) {
    REQUIRE(g >= -1);
    if (g >= 0) ++met[std::size_t(g)];
  }
  for (int const m : met) CHECK(m > 20);
  for (int const w : {0, 17, 36}) {
    Cast<float, Exec> const one(1, count, w);
    CHECK(std::memcmp(one.distance.data(), &all.distance[std::size_t(w * count)], sizeof(float) * count) == 0);
    CHECK(std::memcmp(one.normal.data(), &all.normal[std::size_t(3 * w * count)], sizeof(float) * 3 * count) == 0);
    CHECK(std::memcmp(one.geom.data(), &all.geom[std::size_t(w * count)], sizeof(int) * count) == 0);
  }
  for (std::size_t i = 0; i < all.geom.size(); ++i) {
    CHECK((all.distance[i] >= 0) == (all.geom[i] >= 0));
    double const n = std::hypot(all.normal[3 * i], all.normal[3 * i + 1], all.normal[3 * i + 2]);
    CHECK(n == doctest::Approx(all.geom[i] >= 0 ? 1 : 0).epsilon(1e-5));
  }
}

// A CPU takes rays by packs: in another order, from one point or from many, and beside some that are none, each meets the same to the bit.
TEST_CASE_TEMPLATE("a ray meets what it does, whatever stands beside it", Exec, GSP_TEST_EXECS) {
  int const count = 129;
  for (bool const from_one_point : {false, true}) {
    Cast<float, Exec> cast(1, count);
    auto const origin = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, cast.rays.origin),
               direction = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, cast.rays.direction);
    auto const run = [&] {
      Kokkos::deep_copy(cast.rays.origin, origin);
      Kokkos::deep_copy(cast.rays.direction, direction);
      gsp::cast_rays(cast.exec, cast.scene, cast.rays, cast.hits);
      cast.read();
    };
    for (int k = 0; k < count; ++k)
      for (int c = 0; c < 3; ++c) {
        if (!from_one_point) continue;
        origin(0, k, c) = c == 2 ? 0.8f : 0.1f;  // a fan of narrow bundles
        direction(0, k, c) = c == 0 ? std::cos(0.05f * float(k)) : c == 1 ? std::sin(0.05f * float(k)) : -0.3f + 0.1f * float(k % 5);
      }
    run();
    auto const distance = cast.distance, normal = cast.normal;
    auto const geom = cast.geom;
    int met = 0;
    for (int const g : geom) met += g >= 0;
    CHECK(met > 40);
    // ray k goes to place 37 k mod 129; some become none
    std::vector<float> const o(origin.data(), origin.data() + 3 * count), d(direction.data(), direction.data() + 3 * count);
    for (int k = 0; k < count; ++k)
      for (int c = 0; c < 3; ++c) {
        int const to = 37 * k % count;
        origin(0, to, c) = o[std::size_t(3 * k + c)];
        direction(0, to, c) = k % 7 == 3 ? (k % 2 ? 0 : NAN) : d[std::size_t(3 * k + c)];
      }
    run();
    for (int k = 0; k < count; ++k) {
      std::size_t const to = std::size_t(37 * k % count), from = std::size_t(k);
      CAPTURE(k);
      CHECK(cast.geom[to] == (k % 7 == 3 ? -1 : geom[from]));
      if (k % 7 == 3) continue;
      CHECK(std::memcmp(&cast.distance[to], &distance[from], sizeof(float)) == 0);
      CHECK(std::memcmp(&cast.normal[3 * to], &normal[3 * from], 3 * sizeof(float)) == 0);
    }
  }
}

// 6e-8 of numbers of the scene's size, and what leverage makes of it where a ray grazes.
TEST_CASE_TEMPLATE("float meets what double does", Exec, GSP_TEST_EXECS) {
  Cast<float, Exec> const single(20, 200);
  Cast<double, Exec> const exact(20, 200);
  int others = 0;
  for (std::size_t i = 0; i < exact.geom.size(); ++i)
    if (exact.geom[i] != single.geom[i] || std::fabs(exact.distance[i] - double(single.distance[i])) > 1e-4 * (1 + exact.distance[i]))
      ++others;
  CHECK(others <= 4);  // tangents and edges, one in a thousand
}

// A kilometre away places have 6e-5 m in float, and a hit may lie as much further as the ray is slanted to the surface.
TEST_CASE_TEMPLATE("a scene far from the world's origin costs what its places cost", Exec, GSP_TEST_EXECS) {
  Cast<float, Exec> const far(5, 200, 0, 1024);
  Cast<double, Exec> const exact(5, 200, 0, 1024);
  int others = 0;
  for (std::size_t i = 0; i < exact.geom.size(); ++i) {
    if (exact.geom[i] != far.geom[i]) {
      ++others;
      continue;
    }
    if (std::fabs(exact.distance[i] - double(far.distance[i])) > 2e-3 * (1 + exact.distance[i])) ++others;
  }
  CHECK(others <= 5);
}

TEST_CASE_TEMPLATE("what is not a ray meets nothing, and what does not fit is refused", Exec, GSP_TEST_EXECS) {
  Cast<float, Exec> c(3, 4);
  auto const origin = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, c.rays.origin);
  auto const direction = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, c.rays.direction);
  float const nan = NAN, inf = INFINITY;
  for (int w = 0; w < 3; ++w)
    for (int k = 0; k < 4; ++k)
      for (int i = 0; i < 3; ++i) {
        origin(w, k, i) = k == 3 ? nan : 1.f;
        direction(w, k, i) = k == 0 ? 0.f : k == 1 ? nan : k == 2 ? inf : -1.f;
      }
  Kokkos::deep_copy(c.rays.origin, origin);
  Kokkos::deep_copy(c.rays.direction, direction);
  gsp::cast_rays(c.exec, c.scene, c.rays, c.hits);
  c.read();
  for (int const g : c.geom) CHECK(g == -1);
  for (float const d : c.distance) CHECK(d == -1);
  for (float const n : c.normal) CHECK(n == 0);

  auto few = gsp::make_rays<float>(c.exec, {.worlds = 2, .count = 4});
  CHECK_THROWS_WITH_AS(gsp::cast_rays(c.exec, c.scene, few, c.hits), doctest::Contains("the scene has 3 worlds, the rays have 2"),
                       std::invalid_argument);
  auto other = gsp::make_ray_hits<float>(c.exec, {.worlds = 3, .count = 5});
  CHECK_THROWS_WITH_AS(gsp::cast_rays(c.exec, c.scene, c.rays, other), doctest::Contains("other numbers of worlds or rays"),
                       std::invalid_argument);
  auto poses = gsp::make_poses(c.exec, c.model, {.worlds = 2});
  CHECK_THROWS_WITH_AS(gsp::place_ray_geoms(c.exec, c.model, poses, c.scene),
                       doctest::Contains("the scene has 3 worlds of 3 bodies, the poses 2 of 3"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_ray_scene<float>(c.exec, c.model, c.compiled, {.worlds = 0}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_rays<float>(c.exec, {.worlds = 1, .count = 0}), std::invalid_argument);

  // without normals; and a scene of nothing
  auto bare = gsp::make_ray_hits<float>(c.exec, {.worlds = 3, .count = 4, .normals = false});
  gsp::cast_rays(c.exec, c.scene, c.rays, bare);
  auto nothing = gsp::make_ray_scene<float>(c.exec, c.model, c.compiled, {.worlds = 3, .groups = 0});
  CHECK(nothing.count() == 0);
  gsp::cast_rays(c.exec, nothing, c.rays, bare);
  auto const d = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, bare.distance);
  CHECK(d(2, 3) == -1);
}
