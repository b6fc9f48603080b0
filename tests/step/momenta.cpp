// Profile stable: what constraints push changes momenta by what they push and no more, while bodies turn. Closed forms.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/io/mjcf.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>

#include "step/world.hpp"

namespace {

using gsp_test::add_free;
using gsp_test::geom;
using V = gsp::Vec3<double>;

/// Of all bodies, each of which is free: momentum, angular momentum about the world's origin, angular momentum of each about its own centre
/// of mass, energy.
struct Momenta {
  V linear{0, 0, 0}, angular{0, 0, 0};
  std::vector<V> center, flow, spin;
  double kinetic = 0, potential = 0;
};
template <class World>
Momenta momenta(World const& world) {
  auto const& c = world.compiled;
  auto const q = world.qpos(), v = world.qvel();
  Momenta m;
  for (int b = 1; b < c.nbody; ++b) {
    int const at = 7 * (b - 1), dof = 6 * (b - 1);
    gsp::Quat<double> const turn = normalized(gsp::Quat<double>{q(0, at + 3), q(0, at + 4), q(0, at + 5), q(0, at + 6)});
    gsp::Quat<double> const axes = turn * gsp::Quat<double>{c.body_iquat[b][0], c.body_iquat[b][1], c.body_iquat[b][2], c.body_iquat[b][3]};
    V const w = rotate(turn, V{v(0, dof + 3), v(0, dof + 4), v(0, dof + 5)});
    V const arm = rotate(turn, V{c.body_ipos[b][0], c.body_ipos[b][1], c.body_ipos[b][2]});
    V const center = V{q(0, at), q(0, at + 1), q(0, at + 2)} + arm, flow = V{v(0, dof), v(0, dof + 1), v(0, dof + 2)} + cross(w, arm);
    V const own = rotate_inverse(axes, w), moments{c.body_inertia[b][0], c.body_inertia[b][1], c.body_inertia[b][2]};
    V const spin = rotate(axes, V{moments.x * own.x, moments.y * own.y, moments.z * own.z});
    double const mass = c.body_mass[b];
    m.center.push_back(center), m.flow.push_back(flow), m.spin.push_back(spin);
    m.linear += mass * flow, m.angular += spin + mass * cross(center, flow);
    m.kinetic += 0.5 * (mass * dot(flow, flow) + dot(w, spin));
    m.potential -= mass * dot(V{c.option.gravity[0], c.option.gravity[1], c.option.gravity[2]}, center);
  }
  return m;
}
template <class World>
void set(World& world, int body, V const& velocity, V const& turning) {
  auto const v = world.qvel();
  int const dof = 6 * (body - 1);
  v(0, dof) = velocity.x, v(0, dof + 1) = velocity.y, v(0, dof + 2) = velocity.z;
  v(0, dof + 3) = turning.x, v(0, dof + 4) = turning.y, v(0, dof + 5) = turning.z;
  Kokkos::deep_copy(world.state.qvel, v);
}
template <class Exec>
using World = gsp_test::World<double, Exec>;

}  // namespace

// Rods that tumble into each other, three of them so that they meet again and again in a box of their own speed: contact and friction act
// on both at one point, so momentum and angular momentum of the whole stay. A step rounds numbers below 10 some 1,000 times: 1e-12 after
// 500.
TEST_CASE_TEMPLATE("what collides keeps momentum and angular momentum", Exec, GSP_TEST_EXECS) {
  for (double h : {0.002, 0.01}) {
    gsp::Description d;
    d.option.gravity = {0, 0, 0};
    d.option.timestep = h;
    for (int i = 0; i < 3; ++i) {
      add_free(d, {0.4 * i, 0.1 * i, 0.05 * i}, geom(gsp::ShapeType::box, {0.05, 0.12, 0.4}, 1 + i));
      d.bodies.back().geoms[0].pos = {0.02, -0.03, 0.1};
    }
    World<Exec> world(gsp::compile(d));
    set(world, 1, {1, 0, 0.1}, {3, -5, 4});
    set(world, 2, {0, 0.1, 0}, {-4, 6, 2});
    set(world, 3, {-0.7, 0, 0.1}, {5, 2, -7});
    auto const start = momenta(world);
    double passed = 0;  // angular momentum that one gave another
    for (int i = 0; i < 100; ++i) {
      world.step(5);
      auto const now = momenta(world);
      passed = std::fmax(passed, norm(now.spin[0] - start.spin[0]));
      CHECK(norm(now.linear - start.linear) < 1e-11);
      CHECK(norm(now.angular - start.angular) < 1e-11);
    }
    CHECK(passed > 0.05);
    CHECK(momenta(world).kinetic < start.kinetic);
  }
}

// A disc that spins and wobbles on a plane without friction: the plane pushes upwards alone, so the angular momentum about the vertical
// stays to rounding, and what the centre has of sideways motion too.
TEST_CASE_TEMPLATE("a disc on a plane without friction keeps its spin", Exec, GSP_TEST_EXECS) {
  for (double h : {0.002, 0.005}) {
    gsp::Description d;
    d.option.timestep = h;
    d.bodies[0].geoms.push_back(geom(gsp::ShapeType::plane, {0, 0, 1}));
    add_free(d, {0, 0, 0.12}, geom(gsp::ShapeType::cylinder, {0.1, 0.01, 0}, 1));
    d.bodies[1].quat = {std::cos(0.5), std::sin(0.5), 0, 0};
    for (auto& b : d.bodies) b.geoms[0].condim = 1;
    World<Exec> world(gsp::compile(d));
    set(world, 1, {0.1, 0.05, 0}, {0.5, 1, 8});
    auto const start = momenta(world);
    double most = 0;
    for (int i = 0; i < 100; ++i) {
      world.step(int(std::lround(0.3 / h)));
      auto const now = momenta(world);
      most = std::fmax(most, now.kinetic + now.potential);
      CHECK(std::abs(now.spin[0].z - start.spin[0].z) < 1e-11 * start.spin[0].z);
      CHECK(std::abs(now.flow[0].x - 0.1) < 1e-12);
    }
    MESSAGE(h << " s: energy " << start.kinetic + start.potential << ", later at most " << most << ", at the end "
              << momenta(world).kinetic + momenta(world).potential);
    CHECK(most <= start.kinetic + start.potential);
  }
}

// Chaplygin's ball: three different moments, centre of mass in the middle. It rolls, and friction acts at the point below the centre, so
// the angular momentum about the vertical stays to rounding. Nothing slips, so its energy stays too: constraints see the middle of a turn,
// and so does the momentum; what is left is of second order in h w (6 rad/s), and does not grow.
TEST_CASE_TEMPLATE("a ball of three moments that rolls keeps its angular momentum about the vertical", Exec, GSP_TEST_EXECS) {
  for (double h : {0.002, 0.005}) {
    gsp::Description d;
    d.option.timestep = h;
    d.bodies[0].geoms.push_back(geom(gsp::ShapeType::plane, {0, 0, 1}));
    add_free(d, {0, 0, 0.1}, geom(gsp::ShapeType::sphere, {0.1, 0, 0}));
    d.bodies[1].has_inertial = true;
    d.bodies[1].inertial.mass = 1, d.bodies[1].inertial.inertia = {2e-3, 4e-3, 5e-3, 0, 0, 0};
    World<Exec> world(gsp::compile(d));
    set(world, 1, {0.3, 0, 0}, {1, 3, 5});
    auto const start = momenta(world);
    world.step(int(std::lround(0.5 / h)));
    auto const rolling = momenta(world);
    world.step(int(std::lround(10 / h)));
    auto const end = momenta(world);
    MESSAGE(h << " s: energy changes by " << end.kinetic / rolling.kinetic - 1);
    CHECK(std::abs(end.kinetic / rolling.kinetic - 1) < 36 * h * h);
    CHECK(std::abs(end.spin[0].z - start.spin[0].z) < 1e-11 * std::abs(start.spin[0].z));
    CHECK(norm(end.spin[0] - start.spin[0]) > 1e-4);
  }
}

// Where a body's frame lies is no matter of physics: its centre of mass flies straight, though the frame is off it.
TEST_CASE_TEMPLATE("a centre of mass off its frame flies straight", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  d.option.gravity = {0, 0, 0};
  d.option.timestep = 0.01;
  add_free(d, {0, 0, 0}, geom(gsp::ShapeType::box, {0.05, 0.12, 0.4}, 2));
  d.bodies[1].geoms[0].pos = {0.3, -0.2, 0.1};
  World<Exec> world(gsp::compile(d));
  set(world, 1, {0.2, 0.3, -0.1}, {4, -7, 9});
  auto const start = momenta(world);
  for (int i = 0; i < 100; ++i) {
    world.step(7);
    auto const now = momenta(world);
    CHECK(norm(now.center[0] - start.center[0] - 0.07 * (i + 1) * start.flow[0]) < 1e-12 * (i + 1));
  }
}
