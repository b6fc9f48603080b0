// What slides over a height field, in profile stable: as on a plane where the ground is one, over ridges, and up to steps.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>

#include "step/world.hpp"

namespace {
using gsp::ShapeType;
using D = gsp::Vec3<double>;
using Q = gsp::Quat<double>;

constexpr double mu = 0.5, g = 9.81;

/// Ground and one free body of density 1,000 above it.
struct Scene {
  ShapeType type = ShapeType::box;
  gsp::HeightFieldDescription field = {};  // rows 0: a plane
  D at{0, 0, 0};                           // of the ground
  Q turn{1, 0, 0, 0};
  D body{0, 0, 0};
  Q body_turn{1, 0, 0, 0};
};
/// Half size 1, 17 x 17 points.
template <class F>
gsp::HeightFieldDescription field(double top, F const& height) {
  gsp::HeightFieldDescription f{.name = "field", .rows = 17, .columns = 17, .size = {1, 1, top, 0.5}};
  for (int r = 0; r < 17; ++r)
    for (int c = 0; c < 17; ++c) f.elevation.push_back(float(height(r, c)));
  return f;
}
gsp::CompiledModel make(Scene const& s) {
  gsp::Description d;
  auto ground = gsp_test::geom(ShapeType::plane, {0, 0, 1}), geom = gsp_test::geom(s.type, {0.1, 0.1, 0.05});
  if (s.field.rows > 0) {
    d.hfields.push_back(s.field);
    ground.type = ShapeType::hfield;
    ground.hfield = "field";
  }
  ground.pos = {s.at.x, s.at.y, s.at.z};
  ground.quat = {s.turn.w, s.turn.x, s.turn.y, s.turn.z};
  if (s.type == ShapeType::sphere) geom.size = {0.05, 0, 0};
  if (s.type == ShapeType::capsule) {
    geom.size = {0.05, 0.08, 0};
    geom.quat = {M_SQRT1_2, 0, M_SQRT1_2, 0};  // lies along x
  }
  if (s.type == ShapeType::cylinder) geom.size = {0.1, 0.05, 0};
  if (s.type == ShapeType::mesh) {
    gsp::MeshDescription m{.name = "mesh"};
    for (int k = 0; k < 8; ++k) m.vertices.push_back({k & 1 ? .1f : -.1f, k & 2 ? .1f : -.1f, k & 4 ? .05f : -.05f});
    m.hull = m.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                        {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    d.meshes.push_back(m);
    geom.mesh = "mesh";
  }
  ground.friction = geom.friction = {mu, 0.005, 0.0001};
  d.bodies[0].geoms.push_back(ground);
  gsp_test::add_free(d, {s.body.x, s.body.y, s.body.z}, geom);
  d.bodies[1].quat = {s.body_turn.w, s.body_turn.x, s.body_turn.y, s.body_turn.z};
  return gsp::compile(d);
}

template <class R, class Exec>
struct World : gsp_test::World<R, Exec> {
  using Base = gsp_test::World<R, Exec>;
  explicit World(Scene const& s) : Base(make(s)) {}
  void set(D const& v) {
    auto const h = gsp_test::host(this->state.qvel);
    for (int c = 0; c < 6; ++c) h(0, c) = c < 3 ? R(v[c]) : R(0);
    Kokkos::deep_copy(this->state.qvel, h);
  }
  D position() const {
    auto const h = this->qpos();
    return {double(h(0, 0)), double(h(0, 1)), double(h(0, 2))};
  }
  D velocity() const {
    auto const h = this->qvel();
    return {double(h(0, 0)), double(h(0, 1)), double(h(0, 2))};
  }
};

/// How far it goes, and how fast it is, 0.1 s after it was set going at 2 m/s.
template <class R, class Exec>
std::pair<D, D> slide(Scene const& s, D const& v) {
  World<R, Exec> w(s);
  w.step(150);
  D const begin = w.position();
  w.set(v);
  w.step(50);
  return {w.position() - begin, w.velocity()};
}

template <class R, class Exec>
void check_slides() {
  auto const level = field(0.1, [](int, int) { return 0; });
  auto const ramp = field(0.4, [](int, int c) { return c / 16.; });  // tan 0.2, up along x
  double const slope = std::atan(0.2);
  Q const tilt = gsp::axis_angle(D{0, 1, 0}, -slope);
  for (ShapeType const type : {ShapeType::box, ShapeType::capsule, ShapeType::sphere, ShapeType::cylinder, ShapeType::mesh})
    for (int k = 0; k < 5; ++k)
      for (int ground = 0; ground < 3; ++ground) {  // level, tilted, a ramp
        double const heading = 0.1 + 1.3 * k;
        D const shift{0.031 * k, -0.047 * k, 0};  // against the grid
        Q const turn = ground == 0 ? Q{1, 0, 0, 0} : tilt;
        D const v = rotate(turn, D{2 * std::cos(heading), 2 * std::sin(heading), 0});
        Scene s{.type = type, .turn = turn};
        s.body = rotate(turn, shift + D{0, 0, 0.05});
        // a capsule that slides askew begins to roll and turns off, on a plane too
        bool const along_axis = type == ShapeType::capsule && ground == 0;
        s.body_turn = normalized(turn * gsp::axis_angle(D{0, 0, 1}, along_axis ? heading : 0.4 * k));
        auto const plane = slide<R, Exec>(s, v);
        s.field = ground == 2 ? ramp : level;
        if (ground == 2) {
          s.turn = Q{1, 0, 0, 0};
          s.at = {0, 0, -0.2};
        }
        auto const found = slide<R, Exec>(s, v);
        CAPTURE(int(type));
        CAPTURE(k);
        CAPTURE(ground);
        CHECK(norm(found.first - plane.first) < 0.01 * norm(plane.first));
        CHECK(norm(found.second - plane.second) < 0.01 * norm(plane.second));
        if (ground > 0) continue;
        double const along = found.second.x * std::cos(heading) + found.second.y * std::sin(heading);
        double const across = found.second.y * std::cos(heading) - found.second.x * std::sin(heading);
        CHECK(std::abs((2 - along) / (mu * g * 0.1) - 1) < 0.01);
        CHECK(std::abs(across) < 0.01 * along);
      }
}
}  // namespace

TEST_CASE_TEMPLATE("what slides over a plane field goes as on a plane", Exec, GSP_TEST_EXECS) {
  check_slides<double, Exec>();
  check_slides<float, Exec>();
}

TEST_CASE_TEMPLATE("a roof: what slides goes over the ridge, and a step stops it", Exec, GSP_TEST_EXECS) {
  auto const roof = field(0.2, [](int, int c) { return 1 - std::abs(c - 8) / 8.; });  // tan 0.2, the ridge along y at x = 0
  auto const step = field(0.5, [](int, int c) { return c > 8 ? 1. : 0.; });           // up from x = 0 to 0.125: 76 degrees
  for (ShapeType const type : {ShapeType::box, ShapeType::capsule, ShapeType::cylinder, ShapeType::mesh}) {
    CAPTURE(int(type));
    {
      Scene s{.type = type, .field = roof};
      s.body_turn = gsp::axis_angle(D{0, 1, 0}, -std::atan(0.2));
      s.body = D{-0.3, 0.013, 0.14} + rotate(s.body_turn, D{0, 0, 0.05});
      World<double, Exec> w(s);
      w.step(100);
      w.set(rotate(s.body_turn, D{2.4, 0, 0}));
      w.step(1000);
      auto const p = w.position();
      CHECK(p.x > 0.15);
      CHECK(std::abs(p.y - 0.013) < 0.02);
      if (type == ShapeType::capsule) continue;
      CHECK(std::abs(p.z - (0.2 - 0.2 * p.x + 0.05 / std::cos(std::atan(0.2)))) < 5e-4);  // lies on the other side
      CHECK(norm(w.velocity()) < 1e-3);
    }
    {
      Scene s{.type = type, .field = step};
      s.body = {-0.4, 0.013, 0.05};
      World<double, Exec> w(s);
      w.step(100);
      w.set({3, 0, 0});
      double farthest = -1, highest = 0;
      for (int i = 0; i < 250; ++i) {
        w.step(1);
        farthest = std::max(farthest, w.position().x);
        highest = std::max(highest, w.position().z);
      }
      double const front = type == ShapeType::capsule ? 0.13 : 0.1;
      CHECK(farthest < 0.02 - front);
      CHECK(farthest > -0.02 - front);
      CHECK(highest < 0.1);
      CHECK(norm(w.velocity()) < 0.05);
    }
  }
}
