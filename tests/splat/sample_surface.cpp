#include <doctest/doctest.h>

#include <gsp/model/compile.hpp>
#include <gsp/splat/detail/spherical_harmonics.hpp>
#include <gsp/splat/sample_surface.hpp>

namespace {

gsp::CompiledModel one_geom(gsp::ShapeType type, gsp::Double3 size) {
  gsp::CompiledModel m;
  m.nbody = 2, m.ngeom = 1;
  m.geom_type = {int(type)}, m.geom_body = {1}, m.geom_group = {2};
  m.geom_size = {size}, m.geom_pos = {{0.3, -0.2, 0.5}}, m.geom_quat = {{0.5, 0.5, -0.5, 0.5}};
  m.geom_rgba = {{0.8f, 0.4f, 0.2f, 1.f}}, m.geom_name = {"g"};
  return m;
}

// Signed distance-like function: 0 on the surface.
double off_surface(gsp::ShapeType type, gsp::Double3 const& s, gsp::Vec3<double> const& p) {
  double const r = std::hypot(p.x, p.y);
  switch (type) {
    case gsp::ShapeType::sphere:
      return gsp::norm(p) - s[0];
    case gsp::ShapeType::capsule:
      return std::hypot(r, std::max(0., std::abs(p.z) - s[1])) - s[0];
    case gsp::ShapeType::cylinder:
      return std::max(r - s[0], std::abs(p.z) - s[1]);
    case gsp::ShapeType::box:
      return std::max({std::abs(p.x) - s[0], std::abs(p.y) - s[1], std::abs(p.z) - s[2]});
    case gsp::ShapeType::ellipsoid:
      return std::sqrt(p.x * p.x / s[0] / s[0] + p.y * p.y / s[1] / s[1] + p.z * p.z / s[2] / s[2]) - 1;
    default:
      return p.z;
  }
}

}  // namespace

TEST_CASE("samples lie on the surface, point outward, and are even") {
  using S = gsp::ShapeType;
  for (S type : {S::sphere, S::capsule, S::cylinder, S::box, S::ellipsoid, S::plane}) {
    gsp::Double3 const size{0.2, type == S::plane ? 0.4 : 0.3, type == S::plane ? 0.01 : 0.5};
    auto const model = one_geom(type, size);
    int const n = 4000;
    auto const set = gsp::sample_surface(model, {.count = n});
    REQUIRE(set.size() == std::size_t(n));
    gsp::Transform<double> const frame{{0.3, -0.2, 0.5}, {0.5, 0.5, -0.5, 0.5}};
    double worst = 0;
    int inward = 0, half[3] = {};
    for (int i = 0; i < n; ++i) {
      gsp::Vec3<double> const world{set.positions[3 * i], set.positions[3 * i + 1], set.positions[3 * i + 2]},
          p = gsp::inverse(frame) * world;
      gsp::Quat<double> const q{set.quats[4 * i], set.quats[4 * i + 1], set.quats[4 * i + 2], set.quats[4 * i + 3]};
      gsp::Vec3<double> const normal = gsp::rotate_inverse(frame.q, gsp::rotate(q, gsp::Vec3<double>{0, 0, 1}));
      worst = std::max(worst, std::abs(off_surface(type, size, p)));
      inward += !(off_surface(type, size, p + 1e-3 * normal) > 5e-4);  // a millimetre out is outside (ellipsoid: relative to its size)
      half[0] += p.x > 0, half[1] += p.y > 0, half[2] += p.z > 0;
      CHECK(set.body[i] == 1);
    }
    CHECK(worst < 1e-5);  // float positions
    CHECK(inward == 0);
    // a sequence of low discrepancy: halves agree far better than the 1.6 % of random points (three sigma 2.4 %); an ellipsoid is thinned
    // at random
    for (int k = 0; k < (type == S::plane ? 2 : 3); ++k) CHECK(std::abs(half[k] - n / 2) < n / 50);
  }
}

TEST_CASE("area shares out the count; density, groups, world and shading do what they say") {
  auto model = one_geom(gsp::ShapeType::sphere, {0.1, 0, 0});
  model.ngeom = 2;
  model.geom_type.push_back(int(gsp::ShapeType::sphere)), model.geom_body.push_back(0), model.geom_group.push_back(0);
  model.geom_size.push_back({0.2, 0, 0}), model.geom_pos.push_back({0, 0, 0}), model.geom_quat.push_back({1, 0, 0, 0});
  model.geom_rgba.push_back({0.1f, 0.2f, 0.3f, 1.f}), model.geom_name.push_back("h");
  auto const both = gsp::sample_surface(model, {.count = 5000, .world_share = 1});
  CHECK(std::count(both.body.begin(), both.body.end(), 1) == 1000);  // areas 1 : 4
  CHECK(gsp::sample_surface(model, {.count = 5000, .world = false}).size() == 5000);
  CHECK(gsp::sample_surface(model, {.density = 1e4, .groups = {2}}).size() == 1257);                   // 4 pi 0.01 m^2
  CHECK(both.positions == gsp::sample_surface(model, {.count = 5000, .world_share = 0.8}).positions);  // no more than by area

  // seen along -normal: the geom's colour; edge on: (1 - k) of it
  auto const set = gsp::sample_surface(model, {.count = 400, .shading = 0.4f, .groups = {2}});
  REQUIRE(set.sh_degree == 1);
  Kokkos::View<float**, Kokkos::LayoutRight, Kokkos::HostSpace> const sh("sh", 12, set.size());
  for (std::size_t i = 0; i < set.size(); ++i)
    for (int t = 0; t < 12; ++t) sh(t, i) = set.sh[12 * i + t];
  for (int i : {0, 17, 399}) {
    gsp::Quat<float> const q{set.quats[4 * i], set.quats[4 * i + 1], set.quats[4 * i + 2], set.quats[4 * i + 3]};
    auto const face = gsp::detail::sh_colour(sh, 1, i, -gsp::rotate(q, gsp::Vec3<float>{0, 0, 1})),
               edge = gsp::detail::sh_colour(sh, 1, i, gsp::rotate(q, gsp::Vec3<float>{1, 0, 0}));
    CHECK(face.x == doctest::Approx(0.8).epsilon(1e-5));
    CHECK(face.z == doctest::Approx(0.2).epsilon(1e-5));
    CHECK(edge.x == doctest::Approx(0.48).epsilon(1e-5));
  }
  CHECK_THROWS_AS(gsp::sample_surface(model, {.count = 0}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::sample_surface(model, {.world_share = 1.5}), std::invalid_argument);
}

// A mesh that lies off its origin, in a geom that is turned: compile moves it into its principal axes and the geom with it. Float vertices
// of 3 m: 1e-6.
TEST_CASE("samples lie on meshes and height fields") {
  gsp::Description d;
  d.bodies.resize(1);
  gsp::MeshDescription mesh;
  mesh.name = "box";
  for (float x : {0.9f, 1.1f})
    for (float y : {1.8f, 2.2f})
      for (float z : {2.7f, 3.3f}) mesh.vertices.push_back({x, y, z});
  mesh.faces = {{0, 1, 3}, {0, 3, 2}, {4, 6, 7}, {4, 7, 5}, {0, 4, 5}, {0, 5, 1},
                {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}};
  d.meshes.push_back(mesh);
  gsp::HeightFieldDescription field;
  field.name = "hills", field.rows = 3, field.columns = 4, field.size = {2, 1, 0.5, 0.1};
  for (int i = 0; i < 12; ++i) field.elevation.push_back(float(i * i % 7) / 6);
  d.hfields.push_back(field);
  gsp::BodyDescription body;
  body.parent = 0;
  body.joints.emplace_back();
  gsp::GeomDescription geom;
  geom.type = gsp::ShapeType::mesh, geom.mesh = "box", geom.pos = {0.1, 0.2, 0.3}, geom.quat = {0.5, 0.5, -0.5, 0.5};
  body.geoms.push_back(geom);
  d.bodies.push_back(body);
  gsp::GeomDescription ground;
  ground.type = gsp::ShapeType::hfield, ground.hfield = "hills";
  d.bodies[0].geoms.push_back(ground);
  auto const compiled = gsp::compile(d);
  auto const& elevation = compiled.hfields[0].elevation;  // from 0 to 1
  auto const set = gsp::sample_surface(compiled, {.count = 8000});
  gsp::Transform<double> const frame{{0.1, 0.2, 0.3}, {0.5, 0.5, -0.5, 0.5}};
  int on_mesh = 0, ends = 0, on_field = 0, left = 0;
  for (std::size_t i = 0; i < set.size(); ++i) {
    gsp::Vec3<double> const at{set.positions[3 * i], set.positions[3 * i + 1], set.positions[3 * i + 2]};
    if (set.body[i] == 1) {
      auto const p = gsp::inverse(frame) * at - gsp::Vec3<double>{1, 2, 3};
      double const off[3] = {std::abs(p.x) - 0.1, std::abs(p.y) - 0.2, std::abs(p.z) - 0.3};
      CHECK(std::abs(std::max({off[0], off[1], off[2]})) < 1e-6);
      gsp::Quat<double> const q{set.quats[4 * i], set.quats[4 * i + 1], set.quats[4 * i + 2], set.quats[4 * i + 3]};
      auto const normal = gsp::rotate_inverse(frame.q, gsp::rotate(q, gsp::Vec3<double>{0, 0, 1}));
      CHECK(gsp::dot(normal, p) > 0.09);  // outward
      ++on_mesh;
      ends += off[2] > -1e-6;
    } else {
      double const x = (at.x + 2) / 4 * 3, y = at.y + 1;
      int const c = std::clamp(int(x), 0, 2), r = std::clamp(int(y), 0, 1);
      double const u = x - c, v = y - r;
      auto const e = [&](int row, int column) { return 0.5 * elevation[row * 4 + column]; };
      double const z = u + v < 1 ? e(r, c) + u * (e(r, c + 1) - e(r, c)) + v * (e(r + 1, c) - e(r, c))
                                 : e(r + 1, c + 1) + (1 - u) * (e(r + 1, c) - e(r + 1, c + 1)) + (1 - v) * (e(r, c + 1) - e(r + 1, c + 1));
      CHECK(std::abs(at.z - z) < 1e-6);
      ++on_field;
      left += at.y < 0;
    }
  }
  CHECK(on_mesh == 4000);  // no less than half for what moves: 0.88 m^2 beside more than 8
  CHECK(on_field == 4000);
  CHECK(std::abs(ends / 4000. - 0.16 / 0.88) < 0.01);
  CHECK(std::abs(left - 2000) < 200);  // steeper cells have more
}

TEST_CASE("what a viewer shows is drawn, and all of a body that shows nothing") {
  auto model = one_geom(gsp::ShapeType::sphere, {0.1, 0, 0});
  auto const add = [&](int body, int group, double radius) {
    ++model.ngeom;
    model.geom_type.push_back(int(gsp::ShapeType::sphere)), model.geom_body.push_back(body), model.geom_group.push_back(group);
    model.geom_size.push_back({radius, 0, 0}), model.geom_pos.push_back({0, 0, 0}), model.geom_quat.push_back({1, 0, 0, 0});
    model.geom_rgba.push_back({0.1f, 0.2f, 0.3f, 1.f}), model.geom_name.push_back("h");
  };
  add(1, 3, 0.5);  // a collision geom beside the visual one
  add(2, 3, 0.1);  // and alone
  model.nbody = 3;
  auto const count = [&](gsp::GaussianSet const& set, int body) { return std::count(set.body.begin(), set.body.end(), body); };
  auto const set = gsp::sample_surface(model, {.count = 1000});
  CHECK(count(set, 1) == 500);
  CHECK(count(set, 2) == 500);
  CHECK(count(gsp::sample_surface(model, {.count = 2600, .groups = {3}}), 1) == 2500);
}

TEST_CASE("a large floor leaves links their share") {
  auto model = one_geom(gsp::ShapeType::sphere, {0.1, 0, 0});
  auto const add = [&](gsp::ShapeType type, gsp::Double3 size, int body) {
    ++model.ngeom;
    model.geom_type.push_back(int(type));
    model.geom_body.push_back(body);
    model.geom_group.push_back(0);
    model.geom_size.push_back(size);
    model.geom_pos.push_back({0, 0, 0});
    model.geom_quat.push_back({1, 0, 0, 0});
    model.geom_rgba.push_back({0.1f, 0.2f, 0.3f, 1.f});
    model.geom_name.push_back("g");
  };
  auto const share = [&](int body, gsp::SampleSurfaceOptions options) {
    auto const set = gsp::sample_surface(model, options);
    return std::count(set.body.begin(), set.body.end(), body);
  };
  add(gsp::ShapeType::sphere, {0.2, 0, 0}, 2);  // another link, four times the area
  add(gsp::ShapeType::plane, {0, 0, 1}, 0);     // 100 m^2, 160 times both
  add(gsp::ShapeType::box, {2, 2, 0.1}, 3);     // 35.2 m^2 on a body without joints
  model.nbody = 4;
  model.body_weld = {0, 1, 2, 0};
  CHECK(share(1, {.count = 10000}) == 1000);  // half for links, by area 1 : 4
  CHECK(share(2, {.count = 10000}) == 4000);
  CHECK(share(0, {.count = 10000}) == std::lround(5000 * 100 / 135.2));
  CHECK(share(3, {.count = 10000}) == std::lround(5000 * 35.2 / 135.2));
  CHECK(share(2, {.count = 10000, .world_share = 0.1}) == 7200);
  CHECK(share(1, {.count = 10000, .world_share = 1}) == 16);  // by area alone: 11, and at least 16
}
