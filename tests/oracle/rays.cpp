// Rays against MuJoCo's mj_ray: all shapes, in turned frames, from outside and inside, with its filters; and the models of the zoo with
// their visual geoms, meshes and height fields, 10,000 rays each. Distances in double within 1e-9 of what the ray has gone and the scene
// measures (of meshes 1e-7 of their size, as corners are turned into the file's axes and rounded), and normals; in float within 1e-4 m, or
// 1e-4 of the scene. Where a ray grazes it may meet something else: one in ten thousand in both, and these are listed. GSP_ZOO_FULL=1: as
// many in float, where there are 1,000 else; GSP_ZOO_ONLY=part of a name: these models.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/ray/cast_rays.hpp>
#include <set>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "support/data.hpp"
#include "support/skip.hpp"

namespace {
using Exec = Kokkos::DefaultHostExecutionSpace;

struct Options {
  int rays = 1000;
  unsigned groups = 0x3f;
  bool statics = true;
  int body_exclude = -1;
};
struct Compared {
  int rays = 0, hits = 0, others = 0;  // others: a ray that meets another geom, or the same elsewhere
  double worst = 0;                    // of those that meet the same, in lengths of what is compared
};

/// Whether triangles lie on each other, turned round.
bool has_doubled_faces(std::vector<std::array<float, 3>> const& vertices, std::vector<std::array<int, 3>> const& faces) {
  std::set<std::array<std::array<float, 3>, 3>> known;
  for (auto const& f : faces) {
    std::array<std::array<float, 3>, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) corners[k] = vertices[std::size_t(f[k])];
    std::sort(corners.begin(), corners.end());
    if (!known.insert(corners).second) return true;
  }
  return false;
}

template <class R>
Compared compare(gsp::CompiledModel const& compiled, mjModel const* m, mjData* d, Options const& options, bool report = false) {
  Exec const exec;
  auto const model = gsp::make_model<R>(exec, compiled);
  auto state = gsp::make_state(exec, model);
  auto poses = gsp::make_poses(exec, model);
  auto dynamics = gsp::make_dynamics(exec, model);
  for (int i = 0; i < m->nq; ++i) state.qpos(0, i) = R(d->qpos[i]);
  for (int i = 0; i < m->nq; ++i) d->qpos[i] = double(state.qpos(0, i));
  mj_kinematics(m, d);
  gsp::forward_kinematics(exec, model, state, poses, dynamics);
  auto scene = gsp::make_ray_scene<R>(exec, model, compiled, {.groups = options.groups, .statics = options.statics});
  gsp::place_ray_geoms(exec, model, poses, scene);
  auto rays = gsp::make_rays<R>(exec, {.count = options.rays});
  auto hits = gsp::make_ray_hits<R>(exec, {.count = options.rays});
  gsp_test::Random r{0x5eed};
  double const size = m->stat.extent;
  // MuJoCo takes a geom whose frame is nearly the inertial frame of its body for that (geom_sameframe): by how much points of a geom are
  // apart then.
  std::vector<double> apart(std::size_t(m->ngeom));
  for (int i = 0; i < scene.count(); ++i) {
    int const g = scene.geoms(i).geom;
    double turn = 0;
    gsp::Mat3<double> own;
    for (int c = 0; c < 9; ++c) own.m[c] = double(scene.turn(0, i).m[c]);
    bool const mesh = m->geom_type[g] == mjGEOM_MESH;
    if (mesh) {  // which is turned as in its file
      auto const& q = compiled.mesh_quat[std::size_t(m->geom_dataid[g])];
      auto const to_file = gsp::to_matrix(gsp::Quat<double>{q[0], q[1], q[2], q[3]});
      gsp::Mat3<double> turned{};
      for (int c = 0; c < 9; ++c)
        for (int k = 0; k < 3; ++k) turned.m[c] += own.m[c / 3 * 3 + k] * to_file.m[3 * k + c % 3];
      own = turned;
    }
    for (int c = 0; c < 9; ++c) turn += std::fabs(own.m[c] - d->geom_xmat[9 * g + c]);
    apart[std::size_t(g)] = (turn + (mesh ? 1.1e-7 : 0)) * m->geom_rbound[g];  // three numbers of its corners are rounded to float again
    for (int c = 0; c < 3; ++c) apart[std::size_t(g)] += std::fabs(double(scene.place(0, c, i)) - d->geom_xpos[3 * g + c]);
  }
  std::vector<bool> doubled(std::size_t(m->nmesh));
  for (int k = 0; k < m->nmesh; ++k)
    doubled[std::size_t(k)] = has_doubled_faces(compiled.mesh_vertices[std::size_t(k)], compiled.mesh_faces[std::size_t(k)]);
  for (int k = 0; k < options.rays; ++k) {
    double origin[3], target[3];
    int const to = int(k * 7919L % m->ngeom), from = int(k * 104729L % m->ngeom);
    for (int c = 0; c < 3; ++c) {
      target[c] = d->geom_xpos[3 * to + c] + 0.3 * std::fmin(size, m->geom_rbound[to] > 0 ? m->geom_rbound[to] : size) * r();
      // from far, from near, and from within something
      origin[c] = k % 4 == 0 ? d->geom_xpos[3 * from + c] + (0.01 * size + 0.3 * m->geom_rbound[from]) * r()
                             : m->stat.center[c] + size * (k % 4) * r();
    }
    double const scale = std::exp(r());
    for (int c = 0; c < 3; ++c) {
      rays.origin(0, k, c) = R(origin[c]);
      rays.direction(0, k, c) = R(scale * (target[c] - origin[c]));
    }
  }
  gsp::cast_rays(exec, scene, rays, hits, {.body_exclude = options.body_exclude});
  exec.fence();
  mjtByte groups[6];
  for (int g = 0; g < 6; ++g) groups[g] = options.groups >> g & 1;
  Compared out;
  for (int k = 0; k < options.rays; ++k) {
    double p[3], v[3], normal[3] = {0, 0, 0};
    for (int c = 0; c < 3; ++c) {
      p[c] = double(rays.origin(0, k, c));
      v[c] = double(rays.direction(0, k, c));
    }
    double const length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    if (!(length > 1e-6)) continue;
    int geom = -1;
    double const x = mj_ray(m, d, p, v, groups, options.statics, options.body_exclude, &geom, normal);
    ++out.rays;
    out.hits += x >= 0;
    double slope = 0;  // of the surface to the ray, by which its place counts
    for (int c = 0; c < 3; ++c) slope += normal[c] * v[c] / length;
    double const bound = std::is_same_v<R, double> ? 1e-9 * (size + length * std::fmax(x, 0)) +
                                                         (geom < 0 ? 0 : apart[std::size_t(geom)]) / std::fmax(std::fabs(slope), 1e-3)
                                                   : 1e-4 * std::fmax(1, size);
    double const off = (x < 0) != (hits.geom(0, k) < 0) ? INFINITY : x < 0 ? 0 : std::fabs(double(hits.distance(0, k)) - x) * length;
    if (!(off <= bound)) {
      ++out.others;
      if (report)
        MESSAGE("ray " << k << ": " << hits.distance(0, k) << " of geom " << hits.geom(0, k) << ", expected " << x << " of geom " << geom
                       << " (type " << (geom >= 0 ? m->geom_type[geom] : -1) << ")");
      continue;
    }
    out.worst = std::fmax(out.worst, off / bound);
    if (x < 0 || geom != hits.geom(0, k)) continue;  // of two at one place either
    double turned = 0;
    for (int c = 0; c < 3; ++c) turned += normal[c] * double(hits.normal(0, k, c));
    if (m->geom_type[geom] == mjGEOM_MESH && doubled[std::size_t(m->geom_dataid[geom])]) turned = std::fabs(turned);  // either of two
    if (!(turned > 1 - 1e-4)) {
      ++out.others;  // at an edge
      if (report)
        MESSAGE("ray " << k << ": normal of geom " << geom << " (type " << m->geom_type[geom] << "): cosine " << turned << ", at " << x);
    }
  }
  return out;
}

char const* const all_shapes = R"(<mujoco><asset>
    <hfield name="f" nrow="5" ncol="7" size="1 .8 .4 .2" elevation="0 .1 .5 .2 0 .3 .1  .2 .9 .4 .1 .6 .2 0  .1 .3 1 .2 .4 .1 .5  0 .2 .3 .8 .1 .7 .2  .3 0 .1 .4 .2 0 .6"/>
    <mesh name="cup" vertex="0 0 0  1 0 0  1 1 0  0 1 0  0 0 1  1 0 1  1 1 1  0 1 1  .5 .5 .3" face="0 2 1  0 3 2  0 1 5  0 5 4  1 2 6  1 6 5  2 3 7  2 7 6  3 0 4  3 4 7  4 5 8  5 6 8  6 7 8  7 4 8" scale=".4 .5 .6"/></asset>
  <worldbody><geom type="plane" size="3 2 .1" pos="0 0 -1" euler="3 2 0"/><geom type="hfield" hfield="f" pos="-1 1 -.5" euler="4 -7 20"/>
    <body pos="0 0 .5" euler="20 30 10"><freejoint/><geom type="sphere" size=".3" pos=".4 .1 0"/><geom type="capsule" size=".1 .3" pos="-.5 0 .1" euler="30 40 0" group="3"/>
      <geom type="ellipsoid" size=".2 .3 .1" pos="0 .6 0" euler="0 20 60"/><body pos="0 0 .6"><joint/><geom type="cylinder" size=".2 .15" euler="50 10 5"/>
      <geom type="box" size=".1 .2 .3" pos=".6 0 .2" euler="12 13 14" group="1"/><geom type="sphere" size=".2" pos="0 -.5 0" rgba="1 0 0 0"/></body></body>
    <body pos=".8 -.6 .2" euler="10 0 70"><joint type="ball"/><geom type="mesh" mesh="cup"/></body></worldbody></mujoco>)";
}  // namespace

TEST_CASE("rays meet what MuJoCo's meet: every shape, and filters") {
  auto const compiled = gsp::compile(gsp::io::parse_mjcf(all_shapes, "all_shapes.xml"));
  auto const oracle = gsp_test::load_oracle("all_shapes.xml", all_shapes);
  mjModel* const m = oracle.m();
  mjData* const d = oracle.d();
  for (int turn = 0; turn < 5; ++turn) {
    gsp_test::Random r{unsigned(turn) + 1};
    mj_resetData(m, d);
    std::vector<double> move(std::size_t(m->nv));
    for (auto& x : move) x = r();
    mj_integratePos(m, d->qpos, move.data(), 0.4);
    for (auto const& options : {Options{.rays = 4000}, Options{.groups = 0x9}, Options{.statics = false}, Options{.body_exclude = 2}}) {
      CAPTURE(turn);
      CAPTURE(options.groups);
      auto const exact = compare<double>(compiled, m, d, options, true);
      CHECK(exact.hits > exact.rays / 4);
      CHECK(exact.others <= 1);
      auto const single = compare<float>(compiled, m, d, options);
      CHECK(single.others <= 4);
    }
  }
}

TEST_CASE("rays meet what MuJoCo's meet: the zoo" * doctest::test_suite("data")) {
  auto const list = gsp_test::data("models/zoo.txt");
  if (!list) return gsp_test::skip("models/zoo.txt is missing from GSP_DATA_DIR");
  char const* const only = std::getenv("GSP_ZOO_ONLY");
  int const in_float = std::getenv("GSP_ZOO_FULL") ? 10000 : 1000;
  std::ifstream lines(*list);
  int models = 0, rays = 0, hits = 0, others = 0, float_rays = 0, float_others = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::string const name = line.substr(0, line.find(' '));
    if (only && name.find(only) == std::string::npos) continue;
    CAPTURE(name);
    auto const path = gsp_test::data("models/" + name);
    REQUIRE(path);
    auto const compiled = gsp::compile(gsp::io::read_mjcf(*path), {.listed_pairs = 50'000'000});
    auto const oracle = gsp_test::load_oracle(*path);
    if (compiled.geom_type.empty()) continue;
    auto const exact = compare<double>(compiled, oracle.m(), oracle.d(), {.rays = 10000}, true);
    auto const single = compare<float>(compiled, oracle.m(), oracle.d(), {.rays = in_float}, true);
    CHECK(exact.others <= 1);
    CHECK(single.others <= 2);
    ++models;
    rays += exact.rays;
    hits += exact.hits;
    others += exact.others;
    float_rays += single.rays;
    float_others += single.others;
  }
  MESSAGE(models << " models, " << rays << " rays, " << hits << " hits, " << others << " others; in float " << float_others << " of "
                 << float_rays);
  CHECK(others <= rays / 10000);
  CHECK(float_others <= float_rays / 10000);
  if (!only) CHECK(models == 88);  // the other seven have no geoms
}
