#include <doctest/doctest.h>

#include <cmath>
#include <gsp/dynamics/energy.hpp>
#include <gsp/dynamics/inverse.hpp>
#include <gsp/dynamics/jacobian.hpp>
#include <gsp/dynamics/object_poses.hpp>
#include <gsp/dynamics/runge_kutta.hpp>
#include <gsp/dynamics/subtree.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"

namespace {
using gsp::JointType;

/// Two trees with every joint type, a site on each body, and a spatial tendon from one tree to the other that passes round a geom.
gsp::CompiledModel model_of(gsp::Integrator integrator = gsp::Integrator::euler) {
  auto d = gsp_test::random_model({JointType::free, JointType::hinge}, 6, 5);
  for (auto& body : d.bodies) {
    gsp::SiteDescription site;
    site.name = body.name + "site", site.pos = {0.05, 0.1, -0.05};
    body.sites.push_back(site);
  }
  gsp::GeomDescription ball;
  ball.name = "ball", ball.size = {0.2, 0, 0}, ball.pos = {0.1, 0, 0.2}, ball.contype = ball.conaffinity = 0, ball.has_mass = true,
  ball.mass = 0;
  d.bodies[2].geoms.push_back(ball);
  gsp::TendonDescription t;
  t.name = "string", t.stiffness = 4, t.damping = 0.2;
  t.path = {{gsp::WrapType::site, d.bodies[1].name + "site"},
            {gsp::WrapType::sphere, "ball"},
            {gsp::WrapType::site, d.bodies.back().name + "site"}};
  d.tendons.push_back(t);
  d.option.integrator = integrator;
  return gsp::compile(d);
}

template <class Exec>
struct Set {
  using Mem = typename Exec::memory_space;
  using View2 = Kokkos::View<double**, Kokkos::LayoutRight, Mem>;
  using View3 = Kokkos::View<double***, Kokkos::LayoutRight, Mem>;
  Exec exec;
  gsp::CompiledModel compiled;
  gsp::Model<double, Mem> model;
  gsp::State<double, Mem> state;
  gsp::Dynamics<double, Mem> dynamics;
  gsp::Poses<double, Mem> poses;
  Set(gsp::CompiledModel const& c, int worlds)
      : compiled(c),
        model(gsp::make_model<double>(exec, c, {.profile = gsp::Profile::mujoco})),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        dynamics(gsp::make_dynamics(exec, model, {.worlds = worlds})),
        poses(gsp::make_poses(exec, model, {.worlds = worlds})) {
    gsp_test::randomise(c, state);
  }
  void smooth() { gsp::smooth_dynamics(exec, model, state, dynamics, poses, {.keep_all = true}); }
  std::vector<double> dofs(int gsp::DynamicsLayout::*item) const {
    View2 out("out", state.worlds, model.nv);
    gsp::copy_dofs(exec, model, dynamics, item, out);
    auto const h = gsp_test::host(out);
    return {h.data(), h.data() + h.size()};
  }
  std::vector<double> energy() {
    View2 out("out", state.worlds, 2);
    smooth(), gsp::energies(exec, model, state, poses, dynamics, out);
    auto const h = gsp_test::host(out);
    return {h.data(), h.data() + h.size()};
  }
};
}  // namespace

// Rounding alone: M of condition 10^3, forces below 10^2.
TEST_CASE_TEMPLATE("inverse dynamics inverts forward dynamics", Exec, GSP_TEST_EXECS) {
  Set<Exec> s(model_of(), 19);
  s.smooth();
  int const nv = s.model.nv;
  auto const qacc = s.dofs(&gsp::DynamicsLayout::acceleration), actuator = s.dofs(&gsp::DynamicsLayout::actuator);
  typename Set<Exec>::View2 in("in", 19, nv), out("out", 19, nv);
  auto const h = Kokkos::create_mirror_view(in);
  for (int i = 0; i < 19 * nv; ++i) h(i / nv, i % nv) = qacc[i];
  Kokkos::deep_copy(in, h);
  gsp::inverse_dynamics(s.exec, s.model, s.dynamics, in, out);
  auto const force = gsp_test::host(out);
  double worst = 0;
  for (int i = 0; i < 19 * nv; ++i) worst = std::fmax(worst, std::abs(force(i / nv, i % nv) - actuator[i]));
  CHECK(worst < 1e-10);
}

// The power of all forces but weight and springs is what the energies' sum changes by: checked by a small step of RK4 (order 4: h^4 =
// 1e-16) without dampers.
TEST_CASE_TEMPLATE("energy is conserved without dampers", Exec, GSP_TEST_EXECS) {
  auto c = model_of(gsp::Integrator::rk4);
  for (auto& b : c.dof_damping) b = 0;
  c.tendon_damping[0] = 0, c.option.timestep = 1e-4;
  Set<Exec> s(c, 5);
  auto const before = s.energy();
  auto const rk = gsp::make_runge_kutta(s.exec, s.model, {.worlds = 5});
  for (int i = 0; i < 20; ++i) gsp::runge_kutta(s.exec, s.model, s.state, s.dynamics, s.poses, rk);
  auto const after = s.energy();
  for (int w = 0; w < 5; ++w) {
    double const sum = before[2 * w] + before[2 * w + 1], change = after[2 * w] + after[2 * w + 1] - sum;
    CHECK(std::abs(after[2 * w + 1] - before[2 * w + 1]) > 1e-4);
    CHECK(std::abs(change) < 1e-9 * std::fmax(1, before[2 * w + 1]));
  }
}

// Momentum is M's: p . v summed over bodies is twice the kinetic energy but for armature; here the total linear momentum is mass times the
// velocity of the centre of mass, which is J_com qvel averaged, so that it follows from the Jacobians of all bodies.
TEST_CASE_TEMPLATE("Jacobians, momenta and poses agree", Exec, GSP_TEST_EXECS) {
  int const worlds = 9;
  Set<Exec> s(model_of(), worlds);
  s.smooth();
  auto const subtrees = gsp::make_subtrees(s.exec, s.model, {.worlds = worlds});
  gsp::subtree_com(s.exec, s.model, s.poses, subtrees), gsp::subtree_momentum(s.exec, s.model, s.poses, s.dynamics, subtrees);
  auto const linvel = gsp_test::host(subtrees.linvel), com = gsp_test::host(subtrees.com);
  auto const mass = gsp_test::host(subtrees.mass);
  auto const qvel = gsp_test::host(s.state.qvel);
  std::vector<double> momentum(3 * worlds, 0.);
  typename Set<Exec>::View3 J("J", worlds, 6, s.model.nv);
  for (int b = 1; b < s.model.nbody; ++b) {
    gsp::com_jacobian(s.exec, s.model, s.poses, s.dynamics, b, J);
    auto const j = gsp_test::host(J);
    for (int w = 0; w < worlds; ++w)
      for (int c = 0; c < 3; ++c)
        for (int i = 0; i < s.model.nv; ++i) momentum[3 * w + c] += s.compiled.body_mass[b] * j(w, c, i) * qvel(w, i);
    if constexpr (gsp::is_device<Exec>) Kokkos::fence();
  }
  for (int w = 0; w < worlds; ++w)
    for (int c = 0; c < 3; ++c) CHECK(std::abs(momentum[3 * w + c] - mass(w, 0) * linvel(w, 0, c)) < 1e-11);
  // sites: the Jacobian is the derivative of the pose
  typename Set<Exec>::View3 x("x", worlds, s.model.nsite, 3), q("q", worlds, s.model.nsite, 4);
  int const site = s.model.nsite - 1, dof = s.model.nv - 1, adr = s.compiled.nq - 1;  // the last joint is a hinge or slide
  gsp::site_jacobian(s.exec, s.model, s.poses, s.dynamics, s.compiled.site_body[site], site, J);
  auto const j = gsp_test::snapshot(J);
  gsp::site_poses(s.exec, s.model, s.poses, x, q);
  auto const before = gsp_test::snapshot(x);
  auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, s.state.qpos);
  for (int w = 0; w < worlds; ++w) qpos(w, adr) += 1e-6;
  Kokkos::deep_copy(s.state.qpos, qpos);
  gsp::forward_kinematics(s.exec, s.model, s.state, s.dynamics, s.poses), gsp::site_poses(s.exec, s.model, s.poses, x, q);
  auto const after = gsp_test::snapshot(x);
  for (int w = 0; w < worlds; ++w)
    for (int c = 0; c < 3; ++c) CHECK(std::abs((after(w, site, c) - before(w, site, c)) / 1e-6 - j(w, c, dof)) < 1e-5);
}

// The force of a tendon's spring is minus the slope of its energy: moment arms against central differences of the length (steps of 1e-6:
// 1e-9 from rounding, 1e-10 from the third derivative), also where the string lies on the ball.
TEST_CASE_TEMPLATE("moment arms of a spatial tendon across trees are the slopes of its length", Exec, GSP_TEST_EXECS) {
  int const worlds = 33;
  Set<Exec> s(model_of(), worlds);
  CHECK(s.model.ntree == 1);  // coupled trees are one
  auto const measure = [&] {
    s.smooth();
    std::vector<std::vector<double>> result(2);
    auto const items = gsp_test::host(s.dynamics.items);
    auto const a = s.model.host_archetypes(0);
    gsp::DynamicsLayout const at(a);
    int const width = gsp::Dynamics<double, typename Exec::memory_space>::width;
    auto const ints = gsp_test::host(s.model.ints);
    for (int w = 0; w < worlds; ++w) {
      auto const item = [&](int i) { return items(std::int64_t(w / width) * at.size * width + std::int64_t(i) * width + w % width); };
      result[0].push_back(item(at.tendon_length));
      std::vector<double> J(s.model.nv, 0.);
      for (int e = 0; e < a.ntendonJ; ++e) J[ints(a.tendon_jdof + e)] = item(at.tendon_J + e);
      result[1].insert(result[1].end(), J.begin(), J.end());
    }
    return result;
  };
  auto const arms = measure()[1];
  auto const start = gsp_test::snapshot(s.state.qpos);
  for (int j = 0; j < s.compiled.njnt; ++j) {
    if (s.compiled.jnt_type[j] < int(JointType::slide)) continue;
    auto const moved = [&](double step) {
      auto const q = Kokkos::create_mirror_view(s.state.qpos);
      Kokkos::deep_copy(q, start);
      for (int w = 0; w < worlds; ++w) q(w, s.compiled.jnt_qposadr[j]) += step;
      Kokkos::deep_copy(s.state.qpos, q);
      return measure()[0];
    };
    auto const up = moved(1e-6), down = moved(-1e-6);
    for (int w = 0; w < worlds; ++w) CHECK(std::abs((up[w] - down[w]) / 2e-6 - arms[w * s.model.nv + s.compiled.jnt_dofadr[j]]) < 1e-7);
  }
}
