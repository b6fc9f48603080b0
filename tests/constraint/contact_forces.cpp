#include <doctest/doctest.h>

#include <cmath>
#include <gsp/constraint/contact_forces.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"

namespace {

using gsp::Double3;

double dot(Double3 const& a, Double3 const& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// The two tangents that belong to a normal, as MuJoCo's mju_makeFrame chooses them: t1 is the y axis made orthogonal to the normal, the
/// z axis where the normal is within 60 degrees of y; t2 = n x t1.
struct Tangents {
  Double3 t1, t2;
};
Tangents tangents_of(Double3 const& n) {
  Double3 t = n[1] > -0.5 && n[1] < 0.5 ? Double3{0, 1, 0} : Double3{0, 0, 1};
  double const along = dot(t, n);
  for (int k = 0; k < 3; ++k) t[k] -= along * n[k];
  double const length = std::sqrt(dot(t, t));
  for (double& x : t) x /= length;
  return {t, {n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]}};
}

/// A box of 2 kg on a plane of normal n, which can be moved and not turned, under gravity along -n. The pair is named and has friction .3
/// along the first tangent, .7 along the second; what the geoms say is another number.
gsp::Description box_on_plane(Double3 const& n) {
  gsp::Description d;
  d.option.gravity = {-9.81 * n[0], -9.81 * n[1], -9.81 * n[2]};
  double const length = std::sqrt(2 + 2 * n[2]);
  gsp::Double4 const up_to_n{(1 + n[2]) / length, -n[1] / length, n[0] / length, 0};
  gsp::GeomDescription floor;
  floor.name = "floor";
  floor.type = gsp::ShapeType::plane;
  floor.size = {0, 0, 1};
  floor.quat = up_to_n;
  d.bodies[0].geoms.push_back(floor);
  gsp::BodyDescription body;
  body.name = "body";
  body.parent = 0;
  body.pos = {0.1 * n[0], 0.1 * n[1], 0.1 * n[2]};
  body.has_inertial = true;
  body.inertial.mass = 2;
  body.inertial.inertia = {0.1, 0.1, 0.1, 0, 0, 0};
  for (Double3 const& axis : {Double3{1, 0, 0}, Double3{0, 1, 0}, Double3{0, 0, 1}}) {
    gsp::JointDescription slide;
    slide.type = gsp::JointType::slide;
    slide.axis = axis;
    body.joints.push_back(slide);
  }
  gsp::GeomDescription box;
  box.name = "box";
  box.type = gsp::ShapeType::box;
  box.size = {0.2, 0.15, 0.1};
  box.quat = up_to_n;
  body.geoms.push_back(box);
  d.bodies.push_back(body);
  gsp::PairDescription pair;
  pair.geom1 = "box";  // the plane is geom 1 of the contact all the same: its type comes first
  pair.geom2 = "floor";
  pair.friction = std::array{0.3, 0.7, 0.005, 0.0001, 0.0001};
  d.pairs.push_back(pair);
  return d;
}

}  // namespace

// The law is a box: |f_i| <= mu_i f_n along each tangent. At rest along the normal the four contacts carry the weight, sum f_n = m g = N.
//   worlds 0-3  slide, 1 m/s along (+-0.6, +-0.8) in (t1, t2): f_i = -mu_i f_n sign(v_i) at each contact, N (-+.3, -+.7) in all
//   worlds 4-5  at rest, pushed by +-N/2 along t1: beyond .3 N, slides, v' = +-h (1/2 - .3) N / m
//   worlds 6-7  at rest, pushed by +-N/2 along t2: below .7 N, sticks, and friction is the push
// Tolerance: 4 s are 200 time constants of a critically damped contact, what is left is rounding of the sweeps, 1e-14 m/s of rate each;
// m / h of that is 1e-11 N. Contacts that stick share a force as the sweeps find it: their sum is what is known.
TEST_CASE_TEMPLATE("friction of its own along each tangent of a named pair", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const worlds = 8;
  double const m = 2, N = m * 9.81, h = 0.002, mu[2] = {0.3, 0.7};
  gsp::PgsOptions const solver{.iterations = 1000, .tolerance = 1e-14f};
  for (Double3 const& n : {Double3{0, 0, 1}, Double3{0.48, 0.6, 0.64}, Double3{-0.48, 0.36, 0.8}}) {
    CAPTURE(n[0]);
    CAPTURE(n[1]);
    auto const [t1, t2] = tangents_of(n);
    auto const compiled = gsp::compile(box_on_plane(n));
    auto const model = gsp::make_model<double>(exec, compiled);
    auto state = gsp::make_state(exec, model, {.worlds = worlds});
    auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
    gsp::step(exec, model, state, sim, {.steps = 2000, .solver = solver});
    auto const qvel = gsp_test::host(state.qvel);
    auto const push = gsp_test::host(state.qfrc_applied);
    double slip[worlds][2] = {}, pushed[worlds][2] = {};
    for (int w = 0; w < worlds; ++w) {
      double const sign = w % 2 == 0 ? 1 : -1;
      if (w < 4) {
        slip[w][0] = 0.6 * sign;
        slip[w][1] = w < 2 ? 0.8 : -0.8;
      } else {
        pushed[w][w < 6 ? 0 : 1] = sign * N / 2;
      }
      for (int k = 0; k < 3; ++k) {
        qvel(w, k) = slip[w][0] * t1[k] + slip[w][1] * t2[k];
        push(w, k) = pushed[w][0] * t1[k] + pushed[w][1] * t2[k];
      }
    }
    Kokkos::deep_copy(state.qvel, qvel);
    auto const before = gsp_test::snapshot(state.qvel);
    Kokkos::deep_copy(state.qfrc_applied, push);
    gsp::step(exec, model, state, sim, {.steps = 1, .solver = solver});
    Kokkos::View<double* [6], Kokkos::LayoutRight, Mem> force("force", sim.contacts.dist.extent(0));
    gsp::contact_forces(exec, model, sim.contacts, sim.rows, sim.impulses, force);
    auto const f = gsp_test::host(force);
    auto const after = gsp_test::host(state.qvel);
    auto const qfrc = gsp_test::host(sim.solution.qfrc_constraint);
    auto const first = gsp_test::host(sim.contacts.first);
    auto const end = gsp_test::host(sim.contacts.end);
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(w);
      double expected[2];  // along t1 and t2, of all contacts together
      for (int t = 0; t < 2; ++t) {
        double const driven = w < 4 ? slip[w][t] : pushed[w][t];
        bool const slides = w < 4 || std::abs(pushed[w][t]) > mu[t] * N;
        expected[t] = slides ? -std::copysign(mu[t] * N, driven) : -pushed[w][t];
      }
      CHECK(end(w) - first(w) == 4);
      double sum[3] = {};
      for (int c = first(w); c < end(w); ++c) {
        for (int r = 0; r < 3; ++r) sum[r] += f(c, r);
        for (int r = 3; r < 6; ++r) CHECK(f(c, r) == 0);
        for (int t = 0; t < 2; ++t) {
          if (std::abs(std::abs(expected[t]) - mu[t] * N) > 1e-6) continue;  // sticks
          CHECK(std::abs(f(c, 1 + t) - std::copysign(mu[t] * f(c, 0), expected[t])) < 1e-9);
        }
      }
      CHECK(std::abs(sum[0] - N) < 1e-9);
      for (int t = 0; t < 2; ++t) CHECK(std::abs(sum[1 + t] - expected[t]) < 1e-9);
      for (int k = 0; k < 3; ++k) {
        double const constraint = N * n[k] + expected[0] * t1[k] + expected[1] * t2[k];
        CHECK(std::abs(qfrc(w, k) - constraint) < 1e-9);
        double const moved = h / m * (constraint + push(w, k) - N * n[k]);
        CHECK(std::abs(after(w, k) - before(w, k) - moved) < 1e-11);
      }
    }
  }
}
