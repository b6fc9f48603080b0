#pragma once
// A model with every joint type, two trees of one archetype and one of another, from a fixed pseudo-random stream; and host copies of
// views.
#include <cmath>
#include <cstdint>
#include <gsp/model/compile.hpp>
#include <gsp/model/description.hpp>
#include <gsp/model/state.hpp>

namespace gsp_test {

struct Random {
  std::uint64_t s = 0x9e3779b97f4a7c15u;
  double operator()() {  // uniform in [-1, 1)
    s ^= s << 13, s ^= s >> 7, s ^= s << 17;
    return double(s >> 11) / double(1ull << 52) - 1;
  }
};

inline gsp::Double4 random_quat(Random& r) {
  gsp::Double4 q{r(), r(), r(), r()};
  double const n = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& x : q) x /= n;
  return q;
}

/// Trees of `bodies` bodies each; the first joint of tree t is types[t], later ones hinge, slide, ball in turn, two hinges on every fourth
/// body.
inline gsp::Description random_model(std::vector<gsp::JointType> const& types, int bodies, std::uint64_t seed = 1) {
  gsp::Description d;
  for (int t = 0; t < int(types.size()); ++t) {
    Random r{seed * 77777 + 13 * std::uint64_t(types[t])};  // trees of one type are equal but for where they stand
    int const root = int(d.bodies.size());
    for (int b = 0; b < bodies; ++b) {
      gsp::BodyDescription body;
      body.name = "t" + std::to_string(t) + "b" + std::to_string(b);
      body.parent = b == 0 ? 0 : root + b - 1;  // depth first order: a chain, with a branch at every third body
      if (b % 3 == 2) body.parent = root + b - 2;
      body.pos = {r(), r(), r() + 2 * t * (b == 0)};
      body.quat = random_quat(r);
      body.has_inertial = true;
      body.inertial.mass = 1.5 + r();
      body.inertial.pos = {0.1 * r(), 0.1 * r(), 0.1 * r()};
      body.inertial.quat = random_quat(r);
      double const x = 0.3 + 0.1 * r(), y = 0.3 + 0.1 * r(), z = 0.3 + 0.1 * r();
      body.inertial.inertia = {x, y, z, 0, 0, 0};
      for (int j = 0, n = b % 4 == 3 ? 2 : 1; j < n; ++j) {
        gsp::JointDescription joint;
        joint.name = body.name + "j" + std::to_string(j);
        joint.type = b == 0                 ? types[t]
                     : n == 2 || b % 3 == 1 ? gsp::JointType::hinge
                     : b % 3 == 2           ? gsp::JointType::slide
                                            : gsp::JointType::ball;
        if (joint.type != gsp::JointType::free) joint.pos = {0.2 * r(), 0.2 * r(), 0.2 * r()}, joint.axis = {r(), r(), r() + 1.5};
        joint.damping = 0.5 + 0.5 * r(), joint.armature = 0.05 + 0.05 * r(),
        joint.stiffness = joint.type == gsp::JointType::free ? 0 : 3 + r();
        body.joints.push_back(joint);
      }
      d.bodies.push_back(body);
    }
  }
  return d;
}

/// A model of three trees (two archetypes) with every joint type, servos and a tendon.
inline gsp::CompiledModel servo_model(std::uint64_t seed = 1) {
  auto d = random_model({gsp::JointType::free, gsp::JointType::hinge, gsp::JointType::free}, 8, seed);
  for (auto const& body : d.bodies)
    for (auto const& joint : body.joints)
      if (joint.type == gsp::JointType::hinge || joint.type == gsp::JointType::slide) {
        gsp::ActuatorDescription a;
        a.name = a.target_name = joint.name, a.gainprm[0] = 20, a.bias_type = gsp::ActuatorBias::affine, a.biasprm = {0, -20, -1};
        a.force_limited = d.actuators.size() % 2, a.force_range = {-4, 4};
        d.actuators.push_back(a);
      }
  gsp::TendonDescription t;
  t.name = "t", t.terms = {{"t1b1j0", 0.7}, {"t1b2j0", -1.3}}, t.stiffness = 5, t.damping = 0.4, t.springlength = {-0.1, 0.1};
  d.tendons.push_back(t);
  return gsp::compile(d);
}

/// The view as the host reads it: itself where it already can.
template <class View>
auto host(View const& v) {
  return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v);
}
/// What it holds now, whatever happens to it later.
template <class View>
auto snapshot(View const& v) {
  auto const copy = Kokkos::create_mirror(Kokkos::HostSpace{}, v);
  Kokkos::deep_copy(copy, v);
  return copy;
}

/// Random positions (unit quaternions) and velocities in every world.
template <class State>
void randomise(gsp::CompiledModel const& m, State const& s, std::uint64_t seed = 3) {
  Random r{seed * 1234567};
  auto const qpos = host(s.qpos), qvel = host(s.qvel);
  for (int w = 0; w < s.worlds; ++w) {
    for (int i = 0; i < m.nq; ++i) qpos(w, i) = r();
    for (int i = 0; i < m.nv; ++i) qvel(w, i) = r();
    for (int j = 0; j < m.njnt; ++j) {
      auto const type = gsp::JointType(m.jnt_type[j]);
      if (type == gsp::JointType::hinge || type == gsp::JointType::slide) continue;
      int const q = m.jnt_qposadr[j] + (type == gsp::JointType::free ? 3 : 0);
      auto const quat = random_quat(r);
      for (int c = 0; c < 4; ++c) qpos(w, q + c) = quat[c];
    }
  }
  Kokkos::deep_copy(s.qpos, qpos), Kokkos::deep_copy(s.qvel, qvel);
}

}  // namespace gsp_test
