#pragma once
// Scenes that several tests of steps share: what they are, without what is asked of them; those of files: scene_files.hpp.
#include <cmath>

#include "step/world.hpp"

namespace gsp_test {

/// Layers of boxes of 1 m, k x k of them with 2 cm between neighbours.
inline gsp::Description pyramid(int layers) {
  gsp::Description d;
  d.option.timestep = 1 / 60.;
  gsp::GeomDescription g;
  g.type = gsp::ShapeType::plane;
  g.size = {0, 0, 1};
  d.bodies[0].geoms.push_back(g);
  g.type = gsp::ShapeType::box;
  g.size = {0.5, 0.5, 0.5};
  for (int layer = 0; layer < layers; ++layer)
    for (int a = 0, k = layers - layer; a < k * k; ++a) {
      auto& b = d.bodies.emplace_back();
      b.parent = 0;
      b.pos = {1.02 * (a / k - (k - 1) / 2.), 1.02 * (a % k - (k - 1) / 2.), 0.5 + layer};
      b.joints.emplace_back().type = gsp::JointType::free;
      b.geoms.push_back(g);
    }
  return d;
}

/// A top of mass m whose centre is l above its tip, a ball of `radius` on a floor; moments of inertia A, A, C about the tip's axes.
inline gsp::Description gyroscope(int condim, double m, double l, double A, double C, double tilt, double radius) {
  gsp::Description d;
  d.option.gravity = {0, 0, -9.8};
  gsp::GeomDescription geom;
  geom.condim = condim;
  geom.type = gsp::ShapeType::plane;
  geom.size = {0, 0, 1};
  d.bodies[0].geoms.push_back(geom);
  auto& b = d.bodies.emplace_back();
  b.parent = 0;
  b.pos = {0, 0, radius};
  b.quat = {std::cos(tilt / 2), std::sin(tilt / 2), 0, 0};
  b.joints.emplace_back().type = gsp::JointType::free;
  b.has_inertial = true;
  b.inertial.mass = m;
  b.inertial.pos = {0, 0, l};
  b.inertial.inertia = {A, A, C, 0, 0, 0};
  geom.type = gsp::ShapeType::sphere;
  geom.size = {radius, 0, 0};
  b.geoms.push_back(geom);
  return d;
}

/// Newton's cradle (newton_cradle_mt.xml): five touching rigid spheres on arms of 4 m.
inline gsp::Description cradle() {
  gsp::Description d;
  d.option.timestep = 0.001;
  d.option.gravity = {0, 0, -9.8};
  for (int i = 0; i < 5; ++i) {
    gsp::BodyDescription b;
    b.parent = 0;
    b.pos = {double(i), 0, 7};
    auto& joint = b.joints.emplace_back();
    joint.type = gsp::JointType::hinge;
    joint.axis = {0, 1, 0};
    auto ball = geom(gsp::ShapeType::sphere, {0.5, 0, 0});
    ball.pos = {0, 0, -4};
    ball.condim = 1;
    ball.hard = true;
    ball.restitution = 1;
    ball.erp = 0;
    b.geoms.push_back(ball);
    d.bodies.push_back(b);
  }
  return d;
}

/// A capsule between two bars, which touch it from both sides.
inline gsp::Description capsule_in_v(double timestep, double tilt = 0) {
  gsp::Description d;
  d.option.timestep = timestep;
  for (double const x : {-0.09, 0.09}) {
    auto bar = geom(gsp::ShapeType::capsule, {0.1, 1, 0});
    bar.pos = {x, 0, 0};
    bar.quat = {std::sqrt(0.5), std::sqrt(0.5), 0, 0};
    d.bodies[0].geoms.push_back(bar);
  }
  auto capsule = geom(gsp::ShapeType::capsule, {0.1, 0.3, 0});
  capsule.quat = {std::sqrt(0.5), std::sqrt(0.5), 0, 0};
  add_free(d, {0, 0, std::sqrt(0.04 - 0.0081) + 0.3 * tilt}, capsule);
  return d;
}

/// A T of two cylinders with nothing around it: thrown about its middle axis it turns over and over.
inline gsp::Description gyroscope_in_space() {
  gsp::Description d;
  d.option.gravity = {0, 0, 0};
  add_free(d, {0, 0, 0.02}, geom(gsp::ShapeType::cylinder, {0.1, 0.5, 0}));
  auto arm = geom(gsp::ShapeType::cylinder, {0.07, 0.1, 0});
  arm.pos = {0.2, 0, 0};
  arm.quat = {std::sqrt(0.5), 0, std::sqrt(0.5), 0};
  d.bodies[1].geoms.push_back(arm);
  return d;
}

}  // namespace gsp_test
