// Rays of many worlds: each meets what it meets alone, with the same bits; errors; what is far from the world's origin. (Beside MuJoCo:
// tests/oracle/rays.cpp.)
#include <doctest/doctest.h>

#include <algorithm>
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
  auto another = c.compiled;  // as many bodies and geoms
  ++another.nv;
  CHECK_THROWS_WITH_AS(gsp::make_ray_scene<float>(c.exec, c.model, another), doctest::Contains("give the one that the model was made from"),
                       std::invalid_argument);

  // without normals; and a scene of nothing
  auto bare = gsp::make_ray_hits<float>(c.exec, {.worlds = 3, .count = 4, .normals = false});
  gsp::cast_rays(c.exec, c.scene, c.rays, bare);
  auto nothing = gsp::make_ray_scene<float>(c.exec, c.model, c.compiled, {.worlds = 3, .groups = 0});
  CHECK(nothing.count() == 0);  // and so nothing to place
  auto unplaced = gsp::make_ray_scene<float>(c.exec, c.model, c.compiled, {.worlds = 3});
  CHECK_THROWS_WITH_AS(gsp::cast_rays(c.exec, unplaced, c.rays, bare),
                       doctest::Contains("call place_ray_geoms(exec, model, poses, scene) first"), std::invalid_argument);
  gsp::cast_rays(c.exec, nothing, c.rays, bare);
  auto const d = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, bare.distance);
  CHECK(d(2, 3) == -1);
}

// A height scan of a hill, packs of rays straight down, beside each ray alone (ray_height_field): the same bits, also where some rays of a
// pack pass the hill by, lie on its grid lines or are none.
TEST_CASE_TEMPLATE("height scans meet what each ray meets alone", Exec, GSP_TEST_EXECS) {
  int const count = 1000;
  Cast<float, Exec> cast(1, count);
  auto const& field = cast.compiled.hfields[0];
  gsp::ShapeAsset<float> hill;
  hill.elevation = field.elevation.data();
  hill.rows = field.rows;
  hill.columns = field.columns;
  for (int c = 0; c < 4; ++c) hill.extent[c] = float(field.size[std::size_t(c)]);
  auto const origin = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, cast.rays.origin),
             direction = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, cast.rays.direction);
  gsp_test::Random r{5};
  for (int k = 0; k < count; ++k) {
    origin(0, k, 0) = k % 3 == 0 ? 0.5f + 0.25f * float(k % 5) : float(1 + 0.6 * r());
    origin(0, k, 1) = float(0.5 + 0.5 * r());
    origin(0, k, 2) = k % 10 == 9 ? 0.15f : 0.8f;
    for (int c = 0; c < 3; ++c) direction(0, k, c) = c == 2 ? (k % 10 == 9 ? 1 : -1) : 0;
    if (k % 50 == 17) direction(0, k, 2) = NAN;
    if (k >= 800 && k % 8 == 3) direction(0, k, 0) = 0.01f;  // then the pack goes ray by ray
  }
  Kokkos::deep_copy(cast.rays.origin, origin);
  Kokkos::deep_copy(cast.rays.direction, direction);
  gsp::cast_rays(cast.exec, cast.scene, cast.rays, cast.hits);
  cast.read();
  int compared = 0;
  for (int k = 0; k < count; ++k) {
    gsp::Vec3<float> const d{direction(0, k, 0), direction(0, k, 1), direction(0, k, 2)};
    gsp::Ray<float> const ray{{origin(0, k, 0) - 1, origin(0, k, 1) - 0.5f, origin(0, k, 2) - 0.2f}, d};
    auto const hit = gsp::ray_height_field(hill, ray);
    CAPTURE(k);
    int const g = cast.geom[std::size_t(k)];
    if (g > 1) continue;  // the ball or the box is above it
    CHECK((g == 1) == (hit.x < INFINITY));
    if (g != 1) continue;
    ++compared;
    CHECK(cast.distance[std::size_t(k)] == hit.x);
    for (int c = 0; c < 3; ++c) CHECK(cast.normal[std::size_t(3 * k + c)] == hit.normal[c]);
  }
  CHECK(compared > 500);
}

// A million rays of every bad sort, against a room with needles, flat and doubled triangles, a vertex of NaN and a mesh without faces, in
// worlds whose bodies stand anywhere, or nowhere: each meets something at a finite distance with a unit normal, or nothing. That it ends at
// all is a part of it.
TEST_CASE_TEMPLATE("a million rays of any sort end: at a finite distance, or nowhere", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 100, count = 10000, sorts = 20;
  auto description = room(0);
  for (char const* const name : {"shards", "nothing"}) {
    auto mesh = description.meshes[0];
    mesh.name = name;
    description.meshes.push_back(mesh);
    description.bodies[0].geoms.push_back({.name = name, .type = gsp::ShapeType::mesh, .pos = {0, -1, 0.5}, .mesh = name});
  }
  auto compiled = gsp::compile(description);
  gsp_test::Random r{99};
  std::size_t const shards = std::size_t(compiled.geom_data[3]), nothing = std::size_t(compiled.geom_data[4]),
                    bowl = std::size_t(compiled.geom_data[2]);
  REQUIRE(compiled.mesh_faces.size() == 3);
  compiled.mesh_faces[nothing].clear();
  auto& vertices = compiled.mesh_vertices[shards];
  auto& faces = compiled.mesh_faces[shards];
  vertices.push_back({NAN, 0, 0});
  vertices.push_back({1e30f, 0, 0});
  int const n = int(vertices.size());
  for (int k = 0; k < 300; ++k) {
    int const a = int(std::uint32_t(k) * 7919u % std::uint32_t(n)), b = int(std::uint32_t(k) * 104729u % std::uint32_t(n));
    faces.push_back({a, b, k % 3 == 0 ? a : k % 3 == 1 ? b : (a + b) / 2});  // lines, points, needles
    faces.push_back(faces[std::size_t(k)]);                                  // once more
  }
  auto const model = gsp::make_model<float>(exec, compiled);
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  auto const xpos = Kokkos::create_mirror_view(poses.xpos), xquat = Kokkos::create_mirror_view(poses.xquat);
  auto rays = gsp::make_rays<float>(exec, {.worlds = worlds, .count = count});
  auto hits = gsp::make_ray_hits<float>(exec, {.worlds = worlds, .count = count});
  auto const origin = Kokkos::create_mirror_view(rays.origin), direction = Kokkos::create_mirror_view(rays.direction);
  float const inf = INFINITY, odd[] = {0, inf, -inf, NAN, 1e38f, -1e38f, 1e-44f, 1e-30f};
  for (int w = 0; w < worlds; ++w) {
    for (int b = 0; b < 3; ++b) {
      float q[4] = {1, 0, 0, 0}, length = 0;
      for (float& x : q) {
        if (b > 0) x = float(r());
        length = std::hypot(length, x);
      }
      for (int c = 0; c < 4; ++c) xquat(w, b, c) = q[c] / length;
      for (int c = 0; c < 3; ++c) xpos(w, b, c) = b == 0 ? 0 : float(r());
      if (w % 10 == 9 && b == 1) xpos(w, b, w / 10 % 3) = odd[w / 10 % 8];
      if (w % 10 == 8 && b == 2) xquat(w, b, w / 10 % 4) = odd[1 + w / 10 % 3];  // a rotation is of unit length, or none
    }
    for (int k = 0; k < count; ++k) {
      float o[3], d[3];
      for (int c = 0; c < 3; ++c) {
        o[c] = float(2 * r());
        d[c] = float(r());
      }
      auto const vertex = [&](std::size_t mesh, int c) {
        auto const& v = compiled.mesh_vertices[mesh];
        return v[std::size_t(k) % v.size()][std::size_t(c)] + float(compiled.geom_pos[mesh == bowl ? 2 : 3][c]);
      };
      int const body = 1 + k % 2, axis = k / 7 % 3;
      for (int c = 0; c < 3; ++c) switch (k % sorts) {
          case 0:
            d[c] = odd[(k / sorts + c) % 8];
            break;
          case 1:
            d[c] = c == axis ? odd[k / sorts % 8] : d[c];
            break;
          case 2:
            o[c] = odd[(k / sorts + c) % 8];
            break;
          case 3:
            o[c] = c == axis ? odd[k / sorts % 8] : o[c];
            break;
          case 4:
            d[c] = c == axis ? d[c] : 0;
            break;  // along an axis
          case 5:
            d[c] = c == axis ? 0 : d[c];
            break;  // in its plane
          case 6:
            o[c] = xpos(w, body, c);
            break;  // from within
          case 7:
            o[c] = xpos(w, body, c) + (c == 0 ? 0.2f : 0);
            break;  // from on the ball
          case 8:
            o[c] = vertex(bowl, c);
            break;  // from a corner
          case 9:
            d[c] = vertex(bowl, c) - o[c];
            break;  // to one
          case 10:
            o[c] = vertex(shards, c), d[c] = vertex(bowl, c) - o[c];
            break;
          case 11:
            d[c] *= 1e-40f;
            break;
          case 12:
            d[c] *= 1e38f;
            break;
          case 13:
            o[c] *= 1e6f, d[c] = -o[c] + d[c];
            break;  // from far
          case 14:
            o[c] *= 1e30f, d[c] = -o[c];
            break;
          case 15:
            o[c] = c == 2 ? 0.f : o[c];
            break;  // from on the floor
          case 16:
            o[c] = c == 2 ? 1.f : c == 0 ? 0.75f + 0.25f * float(k / sorts % 3) : 0.5f, d[c] = c == 2 ? -1.f : 0.f;
            break;  // the hill's grid lines
          case 17:
            o[c] = c == 2 ? 0.2f : o[c], d[c] = c == 2 ? 0 : d[c];
            break;  // along the hill's base
          case 18:
            o[c] = c == 0 ? 0.5f : o[c], d[c] = c == 0 ? 0 : d[c];
            break;  // along its wall
          default:
            break;
        }
      for (int c = 0; c < 3; ++c) {
        origin(w, k, c) = o[c];
        direction(w, k, c) = d[c];
      }
    }
  }
  Kokkos::deep_copy(poses.xpos, xpos);
  Kokkos::deep_copy(poses.xquat, xquat);
  Kokkos::deep_copy(rays.origin, origin);
  Kokkos::deep_copy(rays.direction, direction);
  auto scene = gsp::make_ray_scene<float>(exec, model, compiled, {.worlds = worlds});
  REQUIRE(scene.count() == 7);
  gsp::place_ray_geoms(exec, model, poses, scene);
  gsp::cast_rays(exec, scene, rays, hits);
  auto const host = [](auto const& v) { return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v); };
  auto const distance = host(hits.distance);
  auto const normal = host(hits.normal);
  auto const geom = host(hits.geom);
  std::vector<int> met(8);
  int wrong = 0;
  for (int w = 0; w < worlds; ++w)
    for (int k = 0; k < count; ++k) {
      int const g = geom(w, k);
      float const x = distance(w, k), length = std::hypot(normal(w, k, 0), normal(w, k, 1), normal(w, k, 2));
      float most = 0;
      bool is_ray = true;
      for (int c = 0; c < 3; ++c) {
        most = std::max(most, std::abs(direction(w, k, c)));
        is_ray = is_ray && std::isfinite(direction(w, k, c)) && std::isfinite(origin(w, k, c));
      }
      is_ray = is_ray && most > 0;
      ++met[std::size_t(std::clamp(g, -1, 6) + 1)];
      bool const nothing_met = g == -1 && x == -1 && length == 0;
      bool const something = is_ray && g >= 0 && g < 7 && x >= 0 && std::isfinite(x) && std::abs(length - 1) < 1e-5f;
      if (!nothing_met && !something && ++wrong < 10)
        MESSAGE("sort " << k % sorts << ", world " << w << ", ray " << k << ": geom " << g << " at " << x << ", normal " << normal(w, k, 0)
                        << " " << normal(w, k, 1) << " " << normal(w, k, 2) << "; from " << origin(w, k, 0) << " " << origin(w, k, 1) << " "
                        << origin(w, k, 2) << " along " << direction(w, k, 0) << " " << direction(w, k, 1) << " " << direction(w, k, 2));
    }
  CHECK(wrong == 0);
  for (int g = -1; g < 7; ++g)
    if (g != 4) CHECK(met[std::size_t(g + 1)] > 1000);
  CHECK(met[5] == 0);  // the mesh without faces
}
