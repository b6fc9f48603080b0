// Rays against each shape, beside MuJoCo's mju_rayGeom, mj_rayMesh and mj_rayHfield: from outside and inside, directions of any length.
#include <doctest/doctest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <gsp/geometry/shapes.hpp>
#include <memory>
#include <random>
#include <string>
#include <vector>

using namespace gsp;

namespace {
struct Random {
  std::mt19937 engine{11};
  double operator()() { return std::uniform_real_distribution<double>(-1, 1)(engine); }
};
struct Tally {
  int rays = 0, hits = 0, bad = 0;
  double worst = 0;
  /// Both solve the same equations in double: rounding, but for rays that graze (1e-9 of them decide otherwise).
  void add(double ours, double theirs) {
    ++rays, hits += theirs >= 0;
    if ((ours < 0) != (theirs < 0) || (theirs >= 0 && !(std::abs(ours - theirs) <= 1e-9 * (1 + theirs)))) ++bad;
    if (ours >= 0 && theirs >= 0) worst = std::max(worst, std::abs(ours - theirs));
  }
};
using Model = std::unique_ptr<mjModel, void (*)(mjModel*)>;
using Data = std::unique_ptr<mjData, void (*)(mjData*)>;
Model load(std::string const& text) {
  char error[500] = "";
  mjSpec* const spec = mj_parseXMLString(text.c_str(), nullptr, error, sizeof error);
  REQUIRE_MESSAGE(spec != nullptr, error);
  Model m{mj_compile(spec, nullptr), mj_deleteModel};
  REQUIRE_MESSAGE(m != nullptr, mjs_getError(spec));
  mj_deleteSpec(spec);
  return m;
}
}  // namespace

TEST_CASE("rays against primitives") {
  Random random;
  for (ShapeType type :
       {ShapeType::plane, ShapeType::sphere, ShapeType::capsule, ShapeType::ellipsoid, ShapeType::cylinder, ShapeType::box}) {
    Tally tally;
    for (int k = 0; k < 20000; ++k) {
      Vec3<double> size{0.3 + 0.2 * random(), 0.3 + 0.2 * random(), 0.3 + 0.2 * random()};
      if (type == ShapeType::plane && k % 2) size.x = size.y = 0;  // without end
      Quat<double> const q = normalized(Quat<double>{random(), random(), random(), random()});
      Mat3<double> const R = to_matrix(q);
      Vec3<double> const centre{random(), random(), random()};
      double const away = k % 4 == 0 ? 0.2 : 1.5;  // often inside; else mostly outside
      Vec3<double> const p = centre + Vec3<double>{away * random(), away * random(), away * random()};
      Vec3<double> v{random(), random(), random()};
      if (k % 3) v = 2. * (centre + Vec3<double>{0.3 * random(), 0.3 * random(), 0.3 * random()} - p);
      double const pos[3] = {centre.x, centre.y, centre.z}, s[3] = {size.x, size.y, size.z};
      double const from[3] = {p.x, p.y, p.z}, along[3] = {v.x, v.y, v.z};
      double const theirs = mju_rayGeom(pos, R.m, s, from, along, int(type), nullptr);
      tally.add(ray(type, ShapeData<double>{size}, transpose_times(R, p - centre), transpose_times(R, v)), theirs);
    }
    MESSAGE(doctest::String(shape_name(type)), ": ", tally.hits, " of ", tally.rays, " rays meet it; largest difference ", tally.worst);
    CHECK(tally.bad == 0);
    CHECK(tally.hits > 4000);
  }
}

TEST_CASE("rays against a mesh and a height field") {
  Random random;
  std::string elevation;
  for (int i = 0; i < 42; ++i) elevation += std::to_string(random()) + " ";
  std::string const text =
      "<mujoco><asset><mesh name='m' vertex='.4 0 0  -.3 .2 0  -.3 -.3 0  0 0 .5  .1 .1 -.4' inertia='legacy'/><hfield name='h' nrow='6' "
      "ncol='7' size='.8 .5 .4 .1' elevation='" +
      elevation + "'/></asset><worldbody><geom type='mesh' mesh='m'/><geom type='hfield' hfield='h' pos='3 0 0'/></worldbody></mujoco>";
  auto const m = load(text);
  Data const d{mj_makeData(m.get()), mj_deleteData};
  mj_kinematics(m.get(), d.get());
  std::vector<Vec3<double>> vertices;
  for (int i = 0; i < m->mesh_vertnum[0]; ++i) vertices.push_back({m->mesh_vert[3 * i], m->mesh_vert[3 * i + 1], m->mesh_vert[3 * i + 2]});
  std::vector<int> const triangles(m->mesh_face, m->mesh_face + 3 * m->mesh_facenum[0]);
  std::vector<double> const heights(m->hfield_data, m->hfield_data + 42);
  ShapeAsset<double> asset[2];
  asset[0].vertices = vertices.data(), asset[0].triangles = triangles.data(), asset[0].triangle_count = m->mesh_facenum[0];
  asset[1].elevation = heights.data(), asset[1].rows = m->hfield_nrow[0], asset[1].columns = m->hfield_ncol[0];
  for (int k = 0; k < 4; ++k) asset[1].extent[k] = m->hfield_size[k];
  for (int g = 0; g < 2; ++g) {
    Tally tally;
    Vec3<double> const centre{d->geom_xpos[3 * g], d->geom_xpos[3 * g + 1], d->geom_xpos[3 * g + 2]};
    Mat3<double> R;
    std::copy(d->geom_xmat + 9 * g, d->geom_xmat + 9 * g + 9, R.m);
    for (int k = 0; k < 20000; ++k) {
      Vec3<double> p = centre + Vec3<double>{2 * random(), 2 * random(), 2 * random()};
      // a height field is met from outside: a ray that starts in it may end at the top of the base here, which MuJoCo passes
      bool const inside = g == 1 && std::abs(p.x - centre.x) < 0.8 && std::abs(p.y - centre.y) < 0.5 && p.z > -0.1 && p.z < 0.4;
      if (inside) p.z += 1;
      Vec3<double> const v = 2. * (centre + Vec3<double>{0.5 * random(), 0.5 * random(), 0.4 * random()} - p);
      double const from[3] = {p.x, p.y, p.z}, along[3] = {v.x, v.y, v.z};
      double const theirs =
          g == 0 ? mj_rayMesh(m.get(), d.get(), g, from, along, nullptr) : mj_rayHfield(m.get(), d.get(), g, from, along, nullptr);
      ShapeType const type{m->geom_type[g]};
      tally.add(ray(type, ShapeData<double>{{0.3, 0.3, 0.3}, &asset[g]}, transpose_times(R, p - centre), transpose_times(R, v)), theirs);
    }
    MESSAGE(doctest::String(g ? "height field" : "mesh"), ": ", tally.hits, " of ", tally.rays, " rays meet it, ", tally.bad,
            " differ; largest difference ", tally.worst);
    CHECK(tally.bad == 0);
    CHECK(tally.hits > 4000);
  }
}
