#pragma once
// Scenes that nobody would build: what files allow, in any combination, from a seed.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "dynamics/random_tree.hpp"

namespace gsp_test {

/// Uniform, by words.
struct Dice : Random {
  explicit Dice(std::uint64_t seed) : Random{seed * 0x9e3779b97f4a7c15u + 0x2545f4914f6cdd1du} {
    for (int i = 0; i < 8; ++i) (*this)();  // neighbouring seeds part
  }
  double between(double low, double high) { return low + (high - low) * 0.5 * ((*this)() + 1); }
  double power(double low, double high) { return std::pow(10., between(low, high)); }  // 10^low to 10^high, evenly in the exponent
  int below(int n) { return std::min(n - 1, int(n * 0.5 * ((*this)() + 1))); }
  bool one_in(int n) { return below(n) == 0; }
  gsp::Double3 within(double r) { return {r * (*this)(), r * (*this)(), r * (*this)()}; }
};

/// Softness as files may have it: mostly the default, else anywhere in what MuJoCo takes, and outside of it.
inline gsp::SoftnessDescription random_softness(Dice& r, bool wild) {
  gsp::SoftnessDescription s;
  if (!wild || r.one_in(2)) return s;
  switch (r.below(4)) {
    case 0:
      s.solref = {r.power(-4, 1), r.power(-2, 1)};
      break;
    case 1:
      s.solref = {-r.power(0, 7), -r.power(-1, 4)};
      break;
    case 2:
      s.solref = {r.one_in(2) ? 0. : 1e-9, r.one_in(2) ? 0. : 1.};
      break;
    default:
      break;
  }
  if (r.one_in(2)) s.solimp = {r.between(-0.5, 1.5), r.between(-0.5, 1.5), r.one_in(4) ? 0. : r.power(-6, 0), r(), r.between(-1, 8)};
  return s;
}

/// An octahedron, stretched; its faces are its hull.
inline gsp::MeshDescription random_mesh(Dice& r, std::string const& name) {
  gsp::MeshDescription mesh;
  mesh.name = name;
  for (int k = 0; k < 6; ++k) {
    std::array<float, 3> v{float(0.02 * r()), float(0.02 * r()), float(0.02 * r())};
    v[std::size_t(k / 2)] = float((k % 2 ? -1 : 1) * r.between(0.05, 0.25));
    mesh.vertices.push_back(v);
  }
  for (int k = 0; k < 8; ++k) {
    int const x = k & 1, y = 2 + (k >> 1 & 1), z = 4 + (k >> 2 & 1);
    bool const even = ((k & 1) + (k >> 1 & 1) + (k >> 2 & 1)) % 2 == 0;
    mesh.faces.push_back(even ? std::array{x, y, z} : std::array{x, z, y});
  }
  mesh.hull = mesh.faces;
  return mesh;
}

/// One to four trees of all joint types over a floor: all shapes, masses from 1 g to 1 t, limits, friction, equalities that may contradict
/// each other, tendons, actuators, softness from rigid to loose and beyond, steps of 1 to 20 ms. Names tell the kind and the number.
inline gsp::Description random_scene(std::uint64_t seed) {
  using gsp::JointType;
  using gsp::ShapeType;
  Dice r(seed);
  gsp::Description d;
  d.name = "scene " + std::to_string(seed);
  d.option.timestep = r.power(-3, std::log10(0.02));
  d.option.integrator = gsp::Integrator(r.below(4));
  d.option.cone = r.one_in(2) ? gsp::FrictionCone::pyramidal : gsp::FrictionCone::elliptic;
  if (r.one_in(8)) d.option.density = r.power(0, 3), d.option.viscosity = r.power(-5, 0);
  if (r.one_in(6)) d.option.impratio = r.power(0, 3);
  d.meshes.push_back(random_mesh(r, "m0"));
  bool const wild = r.one_in(3), hard = r.one_in(4);  // most scenes are extreme in a few things, so that not all of them fly apart at once
  double const stiffest = r.one_in(3) ? 6 : 2;

  gsp::GeomDescription floor;
  floor.name = "floor";
  floor.type = r.one_in(4) ? ShapeType::hfield : ShapeType::plane;
  if (floor.type == ShapeType::hfield) {
    gsp::HeightFieldDescription h;
    h.name = floor.hfield = "h0", h.rows = 2 + r.below(9), h.columns = 2 + r.below(9);
    h.size = {2, 2, r.power(-2, 0), 0.2};
    for (int i = 0; i < h.rows * h.columns; ++i) h.elevation.push_back(float(r.between(0, 1)));
    d.hfields.push_back(h);
  }
  floor.softness = random_softness(r, wild);
  d.bodies[0].geoms.push_back(floor);

  std::vector<std::string> joints, sites{"s0"};  // those of one coordinate; a point each
  d.bodies[0].sites.push_back({.name = "s0", .pos = r.within(1)});
  int const trees = 1 + r.below(4);
  double const mass_low = r.one_in(2) ? -0.5 : -3, mass_high = r.one_in(2) ? 0.5 : 3;
  for (int t = 0; t < trees; ++t) {
    int const root = int(d.bodies.size()), bodies = 1 + r.below(6);
    for (int b = 0; b < bodies; ++b) {
      auto const id = std::to_string(d.bodies.size());
      gsp::BodyDescription body;
      body.name = "b" + id;
      body.parent = b == 0        ? 0
                    : r.one_in(3) ? root
                                  : int(d.bodies.size()) - 1;  // depth first: the chain goes on, or starts at the root again
      body.pos = b == 0 ? gsp::Double3{0.5 * r(), 0.5 * r(), 0.4 + 0.4 * r()} : r.within(0.3);
      body.quat = random_quat(r);
      double const mass = r.power(mass_low, mass_high);
      if (r.one_in(3)) {
        double const k = mass * std::pow(r.power(-2, 0), 2);  // of a radius of gyration of 1 cm to 1 m
        body.has_inertial = true, body.inertial.mass = mass, body.inertial.pos = r.within(r.one_in(8) ? 1. : 0.1);
        body.inertial.quat = random_quat(r);
        body.inertial.inertia = {k, k * r.between(0.5, 1.4), k * r.between(0.6, 1.4), 0, 0, 0};
      }
      int const geoms = body.has_inertial ? r.below(3) : 1 + r.below(2);
      for (int g = 0; g < geoms; ++g) {
        gsp::GeomDescription geom;
        geom.name = "g" + id + "_" + std::to_string(g);
        geom.type = std::array{ShapeType::sphere,   ShapeType::capsule, ShapeType::ellipsoid,
                               ShapeType::cylinder, ShapeType::box,     ShapeType::mesh}[std::size_t(r.below(6))];
        double const size = r.power(-2, -0.5);
        geom.size = {size, size * r.power(-1, 0.5), size * r.power(-1, 0.5)};
        if (geom.type == ShapeType::mesh) geom.mesh = "m0";
        geom.pos = r.within(0.1), geom.quat = random_quat(r);
        geom.has_mass = true, geom.mass = mass;
        geom.condim = std::array{1, 3, 4, 6}[std::size_t(r.below(4))];
        geom.friction = {r.one_in(6) ? 0. : r.power(-2, 1), r.power(-4, 0), r.power(-5, -1)};
        if (r.one_in(4)) geom.margin = r.between(0, 0.1), geom.gap = r.one_in(2) ? 0. : geom.margin;
        geom.softness = random_softness(r, wild);
        if (hard && r.one_in(3)) geom.hard = true, geom.restitution = r.between(0, 1), geom.erp = r.between(0, 1);
        body.geoms.push_back(geom);
      }
      int const count = b > 0 && r.one_in(8) ? 0 : r.one_in(4) ? 2 : 1;
      for (int j = 0; j < count; ++j) {
        gsp::JointDescription joint;
        joint.name = "j" + id + "_" + std::to_string(j);
        joint.type = b == 0 && count == 1 && r.one_in(2) ? JointType::free
                     : count == 1 && r.one_in(3)         ? JointType::ball
                     : r.one_in(2) && j == 0             ? JointType::slide
                                                         : JointType::hinge;
        if (joint.type != JointType::free) {
          joint.pos = r.within(0.2), joint.axis = {r(), r(), r() + 1.5};
          if (r.one_in(3)) joint.stiffness = r.power(-2, stiffest);
          joint.limited = r.one_in(3);
          joint.range = {joint.type == JointType::ball ? 0. : -r.power(-3, 0.4), r.power(-3, 0.4)};
        }
        if (r.one_in(3)) joint.damping = r.power(-3, 4);
        if (r.one_in(3)) joint.armature = r.power(-4, 1);
        if (r.one_in(5)) joint.frictionloss = r.power(-2, 2);
        joint.limit = random_softness(r, wild), joint.friction = random_softness(r, wild);
        if (joint.type >= JointType::slide) joints.push_back(joint.name);
        body.joints.push_back(joint);
      }
      body.sites.push_back({.name = "s" + id, .pos = r.within(0.2)});
      sites.push_back("s" + id);
      d.bodies.push_back(body);
    }
  }

  auto const any = [&](std::vector<std::string> const& names) { return names[std::size_t(r.below(int(names.size())))]; };
  for (int k = 0, n = r.one_in(2) ? 0 : 1 + r.below(4); k < n; ++k) {
    gsp::EqualityDescription e;
    e.name = "e" + std::to_string(k), e.softness = random_softness(r, wild);
    if (!joints.empty() && r.one_in(3)) {
      e.type = gsp::EqualityType::joint, e.name1 = any(joints), e.name2 = r.one_in(2) ? "" : any(joints);
      e.data = {r(), 2 * r(), r.one_in(3) ? r() : 0, 0, 0, 0, 0, 0, 0, 0, 1};
    } else if (r.one_in(2)) {  // of sites: open at the start, and perhaps for ever
      e.type = r.one_in(2) ? gsp::EqualityType::weld : gsp::EqualityType::connect, e.sites = true;
      e.name1 = any(sites), e.name2 = any(sites);
    } else {
      e.type = gsp::EqualityType::connect, e.data = {0.2 * r(), 0.2 * r(), 0.2 * r(), 0, 0, 0, 0, 0, 0, 0, 1};
      e.name1 = d.bodies[1 + std::size_t(r.below(int(d.bodies.size()) - 1))].name;
      if (r.one_in(2)) e.name2 = d.bodies[1 + std::size_t(r.below(int(d.bodies.size()) - 1))].name;
    }
    if (e.name1 != e.name2) d.equalities.push_back(e);
  }
  for (int k = 0, n = r.one_in(2) ? 0 : 1 + r.below(3); k < n; ++k) {
    gsp::TendonDescription t;
    t.name = "t" + std::to_string(k);
    if (!joints.empty() && r.one_in(2)) {
      for (auto const& name : joints)
        if (r.one_in(2)) t.terms.push_back({name, 2 * r()});
    } else {
      for (auto const& name : sites)
        if (r.one_in(2)) t.path.push_back({gsp::WrapType::site, name});
    }
    if (t.terms.empty() && t.path.size() < 2) continue;
    if (r.one_in(2)) t.stiffness = r.power(-1, stiffest);
    if (r.one_in(2)) t.damping = r.power(-2, 3);
    if (r.one_in(4)) t.frictionloss = r.power(-2, 2);
    t.limited = r.one_in(3), t.range = {-r.power(-2, 0), r.power(-2, 0)};
    t.limit = random_softness(r, wild), t.friction = random_softness(r, wild);
    d.tendons.push_back(t);
  }
  for (auto const& name : joints) {
    if (!r.one_in(3)) continue;
    gsp::ActuatorDescription a;
    a.name = "a_" + name, a.target_name = name, a.gear[0] = r.one_in(3) ? r.power(-1, 2) : 1;
    if (r.one_in(2)) {
      double const kp = r.power(-1, stiffest);
      a.gain_type = gsp::ActuatorGain::fixed, a.gainprm[0] = kp, a.bias_type = gsp::ActuatorBias::affine;
      a.biasprm = {0, -kp, r.one_in(2) ? 0. : -r.power(-2, 3)};
    } else {
      a.gainprm[0] = r.power(-1, 0.5 * stiffest);
    }
    if (r.one_in(3)) {  // a filter's time constant is half of the longest step or more: below it MuJoCo's grows without bound
      a.dynamics = std::array{gsp::ActuatorDynamics::integrator, gsp::ActuatorDynamics::filter,
                              gsp::ActuatorDynamics::filter_exact}[std::size_t(r.below(3))];
      a.dynprm[0] = r.power(a.dynamics == gsp::ActuatorDynamics::filter ? -2 : -4, 0);
    }
    a.force_limited = r.one_in(2), a.force_range = {-r.power(0, 3), r.power(0, 3)};
    d.actuators.push_back(a);
  }
  return d;
}

}  // namespace gsp_test
