#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/model/attach.hpp>
#include <gsp/model/description.hpp>
#include <gsp/model/samples.hpp>
#include <string>

namespace gsp::samples {

namespace detail {

using Colour = std::array<float, 4>;

inline GeomDescription shape(ShapeType type, Double3 const& size, Double3 const& pos = {0, 0, 0},
                             Colour const& rgba = {0.5f, 0.5f, 0.5f, 1}) {
  GeomDescription g;
  g.type = type;
  g.size = size;
  g.pos = pos;
  g.rgba = rgba;
  return g;
}

inline GeomDescription weighing(GeomDescription g, double mass) {
  g.has_mass = true;
  g.mass = mass;
  return g;
}

inline GeomDescription named(GeomDescription g, std::string name) {
  g.name = std::move(name);
  return g;
}

inline JointDescription hinge(std::string name, Double3 const& axis, double lower = 0, double upper = 0) {
  JointDescription j;
  j.name = std::move(name);
  j.axis = axis;
  j.range = {lower, upper};
  j.limited = lower < upper;
  return j;
}

inline JointDescription free_joint(std::string name) {
  JointDescription j;
  j.name = std::move(name);
  j.type = JointType::free;
  return j;
}

/// Servo: force = kp (ctrl - q) - kv v, at most `strength` [N m].
inline ActuatorDescription servo(std::string joint, std::array<double, 2> const& range, double kp, double kv, double strength) {
  ActuatorDescription a;
  a.name = joint;
  a.target_name = std::move(joint);
  a.gainprm[0] = kp;
  a.bias_type = ActuatorBias::affine;
  a.biasprm = {0, -kp, -kv};
  a.ctrl_limited = true;
  a.ctrl_range = range;
  a.force_limited = true;
  a.force_range = {-strength, strength};
  return a;
}

inline constexpr double start_gap = 0.0005;

inline GeomDescription floor() { return named(shape(ShapeType::plane, {0, 0, 0.05}, {0, 0, 0}, {0.35f, 0.35f, 0.38f, 1}), "floor"); }

inline void hang_rods(Description& d, int count) {
  int parent = 0;
  for (int k = 0; k < count; ++k) {
    std::string const n = std::to_string(k);
    parent = add_body(d, parent, "rod" + n, {0, 0, k ? -0.5 : 0});
    auto& b = d.bodies[parent];
    b.joints = {hinge("hinge" + n, {0, 1, 0})};
    b.geoms = {shape(ShapeType::capsule, {0.02, 0.25, 0}, {0, 0, -0.25}, {0.3f, 0.5f, 0.8f, 1}),
               shape(ShapeType::sphere, {0.05, 0, 0}, {0, 0, -0.5}, {0.8f, 0.3f, 0.2f, 1})};
    for (auto& g : b.geoms) g.contype = g.conaffinity = 0;
  }
}

}  // namespace detail

GSP_INLINE Description pendulum() {
  Description d;
  d.name = "pendulum";
  detail::hang_rods(d, 1);
  return d;
}

GSP_INLINE Description double_pendulum() {
  Description d;
  d.name = "double_pendulum";
  detail::hang_rods(d, 2);
  return d;
}

GSP_INLINE Description arm() {
  using namespace detail;
  Description d;
  d.name = "arm";
  Colour const grey{0.75f, 0.76f, 0.78f, 1}, orange{0.9f, 0.45f, 0.1f, 1};
  int const base = add_body(d, 0, "pedestal", {0, 0, 0});
  d.bodies[base].geoms = {
      weighing(named(shape(ShapeType::cylinder, {0.09, 0.05, 0}, {0, 0, 0.05}, {0.2f, 0.2f, 0.22f, 1}), "pedestal"), 5)};
  struct Link {
    char const* name;
    Double3 pos, axis;
    double range, half, mass, kp, strength;  // capsule along the link's z from its joint
  };
  Link const links[] = {
      {"turn", {0, 0, 0.12}, {0, 0, 1}, 2.9, 0.04, 2.8, 400, 80},  {"shoulder", {0, 0, 0.1}, {0, 1, 0}, 1.9, 0.16, 3.2, 400, 80},
      {"elbow", {0, 0, 0.34}, {0, 1, 0}, 2.4, 0.13, 2.2, 250, 50}, {"roll", {0, 0, 0.28}, {0, 0, 1}, 2.9, 0.03, 1.2, 100, 20},
      {"pitch", {0, 0, 0.08}, {0, 1, 0}, 1.9, 0.03, 1.0, 60, 15},  {"flange", {0, 0, 0.08}, {0, 0, 1}, 2.9, 0.02, 0.6, 30, 10}};
  int parent = base;
  for (auto const& l : links) {
    parent = add_body(d, parent, l.name, l.pos);
    auto joint = hinge(l.name, l.axis, -l.range, l.range);
    joint.armature = 0.05;
    joint.damping = 0.5;
    d.bodies[parent].joints = {joint};
    d.bodies[parent].geoms = {
        weighing(named(shape(ShapeType::capsule, {0.045, l.half, 0}, {0, 0, l.half}, parent % 2 ? grey : orange), l.name), l.mass)};
    d.actuators.push_back(servo(l.name, joint.range, l.kp, l.kp / 10, l.strength));
  }
  SiteDescription tool;
  tool.name = "tool";
  tool.pos = {0, 0, 0.09};
  CameraDescription wrist;
  wrist.name = "wrist";
  wrist.pos = {0.06, 0, 0.05};
  wrist.quat = {0, 1, 0, 0};
  d.bodies[parent].sites = {tool};
  d.bodies[parent].cameras = {wrist};
  for (int b = base; b < int(d.bodies.size()); ++b)  // links overlap at their joints, and short ones reach past their neighbours
    for (int other = b + 1; other < std::min(b + 4, int(d.bodies.size())); ++other)
      d.excludes.push_back({d.bodies[b].name, d.bodies[other].name, {}});
  std::vector<double> const home{0, 0.4, 1.2, 0, 1.2, 0};
  d.keyframes.push_back({.name = "home", .qpos = home, .ctrl = home});
  return d;
}

GSP_INLINE Description quadruped() {
  using namespace detail;
  Description d;
  d.name = "quadruped";
  Colour const shell{0.85f, 0.86f, 0.88f, 1}, dark{0.16f, 0.17f, 0.2f, 1}, accent{0.95f, 0.55f, 0.1f, 1};
  double const thigh = 0.2, shank = 0.2, foot = 0.022, bend = 0.8;
  double const height = (thigh + shank) * std::cos(bend) + foot;

  int const trunk = add_body(d, 0, "trunk", {0, 0, height});
  auto& body = d.bodies[trunk];
  body.joints = {free_joint("base")};
  body.geoms = {weighing(named(shape(ShapeType::box, {0.19, 0.075, 0.05}, {0, 0, 0}, shell), "trunk"), 5.8),
                weighing(named(shape(ShapeType::box, {0.04, 0.05, 0.035}, {0.23, 0, 0.025}, dark), "head"), 0.6)};
  SiteDescription imu;
  imu.name = "imu";
  CameraDescription head;
  head.name = "head";
  head.pos = {0.28, 0, 0.03};
  head.quat = gsp::detail::quat_of_axes({0, -1, 0}, {0, 0, 1}, {-1, 0, 0});
  head.fovy = 1.2;
  body.sites = {imu};
  body.cameras = {head};

  KeyframeDescription stand{.name = "stand", .qpos = {0, 0, height, 1, 0, 0, 0}};
  for (int leg = 0; leg < 4; ++leg) {
    double const front = leg < 2 ? 1 : -1, left = leg % 2 ? -1 : 1;
    std::string const name = std::string(leg < 2 ? "F" : "R") + (leg % 2 ? "R" : "L");
    auto const joint = [&](std::string const& joint_name, Double3 const& axis, double lower, double upper) {
      auto j = hinge(name + joint_name, axis, lower, upper);
      j.damping = 0.1;
      j.armature = 0.01;
      j.frictionloss = 0.1;
      d.actuators.push_back(servo(j.name, j.range, 100, 2.5, 30));
      return j;
    };
    int const hip = add_body(d, trunk, name + "_hip", {front * 0.18, left * 0.06, 0});
    d.bodies[hip].joints = {joint("_abduction", {1, 0, 0}, -0.7, 0.7)};
    d.bodies[hip].geoms = {weighing(named(shape(ShapeType::sphere, {0.045, 0, 0}, {0, left * 0.04, 0}, dark), name + "_hip"), 0.55)};
    int const upper = add_body(d, hip, name + "_thigh", {0, left * 0.09, 0});
    d.bodies[upper].joints = {joint("_hip", {0, 1, 0}, -0.9, 2.6)};
    d.bodies[upper].geoms = {
        weighing(named(shape(ShapeType::capsule, {0.024, thigh / 2, 0}, {0, 0, -thigh / 2}, shell), name + "_thigh"), 0.65)};
    int const lower = add_body(d, upper, name + "_shank", {0, 0, -thigh});
    d.bodies[lower].joints = {joint("_knee", {0, 1, 0}, -2.6, -0.5)};
    d.bodies[lower].geoms = {
        weighing(named(shape(ShapeType::capsule, {0.014, shank / 2 - 0.01, 0}, {0, 0, -shank / 2 + 0.01}, dark), name + "_shank"), 0.15),
        weighing(named(shape(ShapeType::sphere, {foot, 0, 0}, {0, 0, -shank}, accent), name + "_foot"), 0.05)};
    d.bodies[lower].geoms[1].friction[0] = 0.9;
    for (double q : {0., bend, -2 * bend}) {
      stand.qpos.push_back(q);
      stand.ctrl.push_back(q);
    }
  }
  d.keyframes = {stand};
  return d;
}

GSP_INLINE Description boxes_and_balls(ObjectOptions const& options) {
  using namespace detail;
  Description d;
  d.name = "boxes_and_balls";
  d.bodies[0].geoms = {floor()};
  int const count = options.boxes + options.balls;
  Colour const paints[] = {
      {0.8f, 0.25f, 0.2f, 1}, {0.2f, 0.5f, 0.75f, 1}, {0.9f, 0.75f, 0.25f, 1}, {0.35f, 0.65f, 0.35f, 1}, {0.6f, 0.4f, 0.7f, 1}};
  for (int k = 0, boxes = 0; k < count; ++k) {
    bool const box = (k + 1) * options.boxes / count > boxes;  // spread evenly among the balls
    boxes += box;
    double const turn = 6.283185307179586 * k / count, size = 0.04 + 0.012 * (k * 7 % 5), half = 0.8 * size;
    Double3 const sizes = box ? Double3{size, 0.8 * size, half} : Double3{size, 0, 0};
    std::string const name = box ? "box" + std::to_string(boxes - 1) : "ball" + std::to_string(k - boxes);
    int const b =
        add_body(d, 0, name, {options.radius * std::cos(turn), options.radius * std::sin(turn), (box ? half : size) + detail::start_gap});
    d.bodies[b].quat = {std::cos(turn), 0, 0, std::sin(turn)};
    d.bodies[b].joints = {free_joint(name)};
    d.bodies[b].geoms = {named(shape(box ? ShapeType::box : ShapeType::sphere, sizes, {0, 0, 0}, paints[k % 5]), name)};
    d.bodies[b].geoms[0].density = 400;
  }
  return d;
}

GSP_INLINE Description quadruped_scene(ObjectOptions const& options) {
  Description d = boxes_and_balls({0, 0, options.radius});
  d.name = "quadruped_scene";
  attach(d, quadruped());
  auto objects = boxes_and_balls(options);
  objects.bodies[0].geoms.clear();
  attach(d, objects);
  for (auto& k : d.keyframes) k.qpos.at(2) += detail::start_gap;
  return d;
}

GSP_INLINE Description stack(int count) {
  using namespace detail;
  Description d;
  d.name = "stack";
  d.bodies[0].geoms = {floor()};
  for (int k = 0; k < count; ++k) {
    std::string const name = "box" + std::to_string(k);
    int const b = add_body(d, 0, name, {0, 0, 0.1 + 0.2 * k});
    d.bodies[b].joints = {free_joint(name)};
    d.bodies[b].geoms = {named(shape(ShapeType::box, {0.1, 0.1, 0.1}, {0, 0, 0}, {0.7f, 0.55f, 0.35f, 1}), name)};
  }
  return d;
}

GSP_INLINE Description ramp(double slope, double mu) {
  using namespace detail;
  Description d;
  d.name = "ramp";
  double const angle = std::atan(slope);
  Double4 const tilt = gsp::detail::axis_angle({0, 1, 0}, -angle);
  auto plane = floor();
  plane.quat = tilt;
  plane.friction[0] = mu;
  d.bodies[0].geoms = {plane};
  int const b = add_body(d, 0, "box", gsp::detail::rotate(tilt, {0, 0, 0.05}));
  d.bodies[b].quat = tilt;
  d.bodies[b].joints = {free_joint("box")};
  d.bodies[b].geoms = {named(shape(ShapeType::box, {0.1, 0.1, 0.05}, {0, 0, 0}, {0.7f, 0.55f, 0.35f, 1}), "box")};
  d.bodies[b].geoms[0].friction[0] = mu;
  return d;
}

}  // namespace gsp::samples
