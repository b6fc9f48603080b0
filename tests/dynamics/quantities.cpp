#include <doctest/doctest.h>

#include <cmath>
#include <gsp/dynamics/energy.hpp>
#include <gsp/dynamics/integrate.hpp>
#include <gsp/dynamics/inverse.hpp>
#include <gsp/dynamics/jacobian.hpp>
#include <gsp/dynamics/object_poses.hpp>
#include <gsp/dynamics/runge_kutta.hpp>
#include <gsp/dynamics/subtree.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/derivatives.hpp"
#include "dynamics/random_tree.hpp"
#include "support/kernels.hpp"

namespace {
using gsp::JointType;

/// Two trees with every joint type, a site on each body, and a spatial tendon from one tree to the other that passes round a geom, or, with
/// a sidesite in its centre, through it; a motor on a hinge and one with an activation on the tendon.
gsp::CompiledModel model_of(gsp::Integrator integrator = gsp::Integrator::euler, bool through = false) {
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
  if (through) {
    gsp::SiteDescription center;
    center.name = t.path[1].sidesite = "center", center.pos = ball.pos;
    d.bodies[2].sites.push_back(center);
  }
  d.tendons.push_back(t);
  gsp::ActuatorDescription motor;
  motor.name = "motor", motor.target_name = "t1b1j0", motor.gear[0] = 3;
  d.actuators.push_back(motor);
  motor.name = "winch", motor.target = gsp::Transmission::tendon, motor.target_name = "string";
  motor.dynamics = gsp::ActuatorDynamics::filter, motor.dynprm[0] = 0.05;
  d.actuators.push_back(motor);
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
  Set(gsp::CompiledModel const& c, int worlds, gsp::Profile profile = gsp::Profile::mujoco)
      : compiled(c),
        model(gsp::make_model<double>(exec, c, {.profile = profile})),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        dynamics(gsp::make_dynamics(exec, model, {.worlds = worlds})),
        poses(gsp::make_poses(exec, model, {.worlds = worlds})) {
    gsp_test::randomise(c, state);
  }
  void smooth() { gsp::smooth_dynamics(exec, model, state, poses, dynamics, {.keep_all = true}); }
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
  Kokkos::deep_copy(s.state.ctrl, 0.7), Kokkos::deep_copy(s.state.act, -0.4);
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

// Profile stable carries the angular momentum of what is one rigid body, and its step takes no gyroscopic force: who asks for the bias, or
// for the forces of accelerations, gets them all the same, from the fused stage and from the single ones. Forces of 10^2: rounding.
TEST_CASE_TEMPLATE("bias forces and inverse dynamics are those of the state in both profiles", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  for (auto [type, parent] : {std::pair{JointType::free, 0}, std::pair{JointType::ball, 0}, std::pair{JointType::hinge, 0}}) {
    gsp::BodyDescription body;
    body.parent = parent, body.has_inertial = true;
    body.inertial = {{0.1, -0.2, 0.3}, {0.8, 0.6, 0, 0}, 2, {0.3, 0.2, 0.4, 0.01, 0.02, -0.03}};
    gsp::JointDescription joint;
    joint.type = type, joint.pos = type == JointType::ball ? gsp::Double3{-0.1, 0.2, 0} : gsp::Double3{0, 0, 0}, joint.armature = 0.05;
    body.joints.push_back(joint);
    d.bodies.push_back(body);
    body.joints.clear(), body.parent = int(d.bodies.size()) - 1, body.pos = {0.2, 0, 0.1};  // welded to it
    d.bodies.push_back(body);
  }
  gsp::TendonDescription string;  // whose armature has a bias of its own
  string.name = "string", string.armature = 0.4;
  for (int b : {0, 1}) {
    gsp::SiteDescription site;
    site.name = "end" + std::to_string(b), site.pos = {0.3, 0.2, 1. - b};
    d.bodies[std::size_t(b)].sites.push_back(site);
    string.path.push_back({gsp::WrapType::site, site.name});
  }
  d.tendons.push_back(string);
  auto const c = gsp::compile(d);
  int const worlds = 19;
  Set<Exec> s(c, worlds, gsp::Profile::stable), other(c, worlds, gsp::Profile::mujoco);
  typename Set<Exec>::View2 qacc("qacc", worlds, s.model.nv);
  Kokkos::deep_copy(qacc, 1.5);
  auto const numbers = [&](Set<Exec>& at, bool single) {
    at.smooth();
    if (single) {
      gsp::forward_kinematics(at.exec, at.model, at.state, at.poses, at.dynamics);
      gsp::bias_forces(at.exec, at.model, at.state, at.poses, at.dynamics);
      return std::array{at.dofs(&gsp::DynamicsLayout::bias), std::vector<double>()};
    }
    typename Set<Exec>::View2 out("out", worlds, at.model.nv);
    gsp::inverse_dynamics(at.exec, at.model, at.dynamics, qacc, out);
    auto const h = gsp_test::host(out);
    return std::array{at.dofs(&gsp::DynamicsLayout::bias), std::vector<double>(h.data(), h.data() + h.size())};
  };
  auto const reference = numbers(other, false);
  double turning = 0;
  for (bool single : {false, true}) {
    auto const ours = numbers(s, single);
    for (int k = 0; k < (single ? 1 : 2); ++k) {
      double worst = 0;
      REQUIRE(ours[k].size() == reference[k].size());
      for (std::size_t i = 0; i < ours[k].size(); ++i) worst = std::fmax(worst, std::abs(ours[k][i] - reference[k][i]));
      CHECK(worst < 1e-12);
    }
  }
  Kokkos::deep_copy(s.state.qvel, 0.);
  auto const still = numbers(s, false);
  for (std::size_t i = 0; i < still[0].size(); ++i)
    if (int const dof = int(i) % s.model.nv; dof < 9) turning = std::fmax(turning, std::abs(still[0][i] - reference[0][i]));
  CHECK(turning > 0.1);
}

// The power of all forces but weight and springs is what the energies' sum changes by: checked by a small step of RK4 (order 4: h^4 =
// 1e-16) without dampers.
TEST_CASE_TEMPLATE("energy is conserved without dampers", Exec, GSP_TEST_EXECS) {
  auto c = model_of(gsp::Integrator::rk4);
  for (auto& b : c.dof_damping) b = 0;
  c.tendon_damping[0] = 0, c.option.timestep = 1e-4;
  Set<Exec> s(c, 5);
  auto const before = s.energy();
  auto rk = gsp::make_runge_kutta(s.exec, s.model, {.worlds = 5});
  for (int i = 0; i < 20; ++i) gsp::runge_kutta(s.exec, s.model, s.state, s.poses, s.dynamics, rk);
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
  auto subtrees = gsp::make_subtrees(s.exec, s.model, {.worlds = worlds});
  gsp::subtree_com(s.exec, s.model, s.poses, subtrees), gsp::subtree_momentum(s.exec, s.model, s.poses, s.dynamics, subtrees);
  auto const linvel = gsp_test::host(subtrees.linvel), com = gsp_test::host(subtrees.com);
  auto const mass = gsp_test::host(subtrees.mass);
  auto const qvel = gsp_test::host(s.state.qvel);
  std::vector<double> momentum(3 * worlds, 0.);
  typename Set<Exec>::View3 J("J", worlds, 6, s.model.nv), flat("flat", worlds, 3, s.model.nv);
  std::string const nv = std::to_string(s.model.nv);
  CHECK_THROWS_WITH_AS(gsp::com_jacobian(s.exec, s.model, s.poses, s.dynamics, 1, flat),
                       doctest::Contains(("J is (9, 3, " + nv + ") and must be (worlds, 6, nv), here (9, 6, " + nv + ")").c_str()),
                       std::invalid_argument);
  std::string const has = "the model has " + std::to_string(s.model.nbody) + ", numbered from 0; body_id(compiled, name) finds one";
  CHECK_THROWS_WITH_AS(gsp::com_jacobian(s.exec, s.model, s.poses, s.dynamics, 99, J),
                       ("gsp::com_jacobian: there is no body 99: " + has).c_str(), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::body_jacobian(s.exec, s.model, s.poses, s.dynamics, -1, {}, J),
                       ("gsp::body_jacobian: there is no body -1: " + has).c_str(), std::invalid_argument);
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
  gsp::site_jacobian(s.exec, s.model, s.poses, s.dynamics, site, J);
  auto const j = gsp_test::snapshot(J);
  gsp::site_poses(s.exec, s.model, s.poses, x, q);
  auto const before = gsp_test::snapshot(x);
  auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, s.state.qpos);
  for (int w = 0; w < worlds; ++w) qpos(w, adr) += 1e-6;
  Kokkos::deep_copy(s.state.qpos, qpos);
  gsp::forward_kinematics(s.exec, s.model, s.state, s.poses, s.dynamics), gsp::site_poses(s.exec, s.model, s.poses, x, q);
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

// At rest the angle of a step has its kink.
TEST_CASE("derivatives of a step by position, velocity and control are central differences") {
  auto c = gsp_test::servo_model();
  for (auto const& [profile, integrator, rest] :
       {std::tuple{gsp::Profile::stable, gsp::Integrator::euler, false}, std::tuple{gsp::Profile::mujoco, gsp::Integrator::euler, true},
        std::tuple{gsp::Profile::mujoco, gsp::Integrator::implicitfast, false},
        std::tuple{gsp::Profile::mujoco, gsp::Integrator::implicit, false}}) {
    c.option.integrator = integrator;
    Set<Kokkos::DefaultHostExecutionSpace> const from(c, 1, profile);
    for (int i = 0; i < c.nu; ++i) from.state.ctrl(0, i) = std::sin(i);
    if (rest) Kokkos::deep_copy(from.state.qvel, 0.);
    double const error = gsp_test::derivative_error(c, profile, from.state, 0, [](auto& at) {
      gsp::smooth_dynamics(at.exec, at.model, at.state, at.poses, at.dynamics, {.keep_all = true});
      gsp::copy_dofs(at.exec, at.model, at.dynamics, &gsp::DynamicsLayout::acceleration, at.acceleration);
      gsp::integrate(at.exec, at.model, at.state, at.dynamics);
      return std::tuple{at.acceleration, at.state.qpos, at.state.qvel};
    });
    CAPTURE(int(profile));
    CAPTURE(int(integrator));
    CHECK(error <= 1e-6);
  }
}

#ifdef KOKKOS_ENABLE_CUDA
namespace {
/// Positions and velocities after a step of the duals that differentiate it by all of both: values and slopes, one after the other.
template <class Exec>
std::vector<double> step_of_duals(gsp::CompiledModel const& c) {
  using Real = gsp::Dual<double, 4>;
  Exec const exec;
  int const variables = c.nq + c.nv, worlds = (variables + 3) / 4;
  auto const model = gsp::make_model<Real>(exec, c, {.profile = gsp::Profile::mujoco});
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  Set<Kokkos::DefaultHostExecutionSpace> const from(c, 1);
  auto const qpos = Kokkos::create_mirror_view(state.qpos), qvel = Kokkos::create_mirror_view(state.qvel);
  for (int w = 0; w < worlds; ++w) {
    for (int i = 0; i < c.nq; ++i) qpos(w, i) = from.state.qpos(0, i);
    for (int i = 0; i < c.nv; ++i) qvel(w, i) = from.state.qvel(0, i);
    for (int k = 0; k < 4 && 4 * w + k < variables; ++k) {
      int const i = 4 * w + k;
      (i < c.nq ? qpos(w, i) : qvel(w, i - c.nq)).slope[k] = 1;
    }
  }
  Kokkos::deep_copy(state.qpos, qpos), Kokkos::deep_copy(state.qvel, qvel);
  gsp::smooth_dynamics(exec, model, state, poses, dynamics), gsp::integrate(exec, model, state, dynamics);
  exec.fence();
  Kokkos::deep_copy(qpos, state.qpos), Kokkos::deep_copy(qvel, state.qvel);
  std::vector<double> out;
  auto const add = [&](Real const& x) {
    out.push_back(x.value);
    for (double slope : x.slope) out.push_back(slope);
  };
  for (int i = 0; i < worlds * c.nq; ++i) add(qpos.data()[i]);
  for (int i = 0; i < worlds * c.nv; ++i) add(qvel.data()[i]);
  return out;
}
}  // namespace

// A thousand roundings of numbers below 10^3.
TEST_CASE("a GPU's derivatives are the host's") {
  for (auto const& c : {gsp_test::servo_model(), model_of(gsp::Integrator::implicitfast)}) {
    auto const host = step_of_duals<Kokkos::DefaultHostExecutionSpace>(c), device = step_of_duals<Kokkos::Cuda>(c);
    REQUIRE(host.size() == device.size());
    double worst = 0, largest = 0;
    for (std::size_t i = 0; i < host.size(); ++i) {
      worst = std::fmax(worst, std::isfinite(device[i]) ? std::abs(host[i] - device[i]) / std::fmax(1, std::abs(host[i])) : INFINITY);
      largest = std::fmax(largest, std::abs(host[i]));
    }
    CHECK(largest > 1);
    CHECK(worst < 1e-9);
  }
}
#endif

// In two worlds: where the string is straight, and where it bends so much (longer by 1e-3) that a step of the differences does not free it.
TEST_CASE("derivatives of quantities by position, velocity, control and acceleration are central differences") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  int const worlds = 100;
  for (bool through : {false, true}) {
    auto const c = model_of(gsp::Integrator::rk4, through);
    Set<Exec> from(c, worlds);
    Kokkos::deep_copy(from.state.ctrl, 0.7), Kokkos::deep_copy(from.state.act, -0.4);
    from.smooth();
    Set<Exec>::View3 x("x", worlds, c.nsite, 3), q("q", worlds, c.nsite, 4);
    gsp::site_poses(from.exec, from.model, from.poses, x, q);
    auto const items = [](auto const& at, int w, int i) {  // length, moment arms
      gsp::DynamicsLayout const layout(at.model.archetypes(0));
      return at.dynamics.item(at.model, w, 0, i == 0 ? layout.tendon_length : layout.tendon_J + i - 1);
    };
    int chosen[2] = {-1, -1};
    for (int w = worlds - 1; w >= 0; --w) {
      double square = 0;
      for (int k = 0; k < 3; ++k) square += std::pow(x(w, c.nsite - 1, k) - x(w, 1, k), 2);
      double const bend = items(from, w, 0) - std::sqrt(square);
      if (std::abs(bend) < 1e-12 || bend > 1e-3) chosen[bend > 1e-3] = w;
    }
    for (int w : chosen) {
      REQUIRE(w >= 0);
      auto const check = [&](std::string const& what, auto const& evaluate) {
        double const error = gsp_test::derivative_error(c, gsp::Profile::mujoco, from.state, w, evaluate);
        CAPTURE(what);
        CAPTURE(through);
        CAPTURE(w);
        CHECK(error <= 1e-6);
      };
      auto const smooth = [](auto& at) { gsp::smooth_dynamics(at.exec, at.model, at.state, at.poses, at.dynamics, {.keep_all = true}); };
      check("step of Runge-Kutta", [](auto& at) {
        auto rk = gsp::make_runge_kutta(at.exec, at.model, {.worlds = at.state.worlds});
        gsp::runge_kutta(at.exec, at.model, at.state, at.poses, at.dynamics, rk);
        return std::tuple{at.state.qpos, at.state.qvel, at.state.act};
      });
      check("inverse dynamics", [&](auto& at) {
        auto const force = Kokkos::create_mirror(at.acceleration);
        smooth(at), gsp::inverse_dynamics(at.exec, at.model, at.dynamics, at.acceleration, force);
        return std::tuple{force};
      });
      check("energies", [&](auto& at) {
        typename std::remove_cvref_t<decltype(at)>::View2 const energy("energy", at.state.worlds, 2);
        smooth(at), gsp::energies(at.exec, at.model, at.state, at.poses, at.dynamics, energy);
        return std::tuple{energy};
      });
      check("Jacobian of a site", [&](auto& at) {
        using R = typename std::remove_cvref_t<decltype(at)>::real_type;
        Kokkos::View<R***, Kokkos::LayoutRight, Kokkos::HostSpace> const J("J", at.state.worlds, 6, at.model.nv);
        smooth(at), gsp::site_jacobian(at.exec, at.model, at.poses, at.dynamics, c.nsite - 1, J);
        return std::tuple{J};
      });
      check("momentum of subtrees", [&](auto& at) {
        auto subtrees = gsp::make_subtrees(at.exec, at.model, {.worlds = at.state.worlds});
        smooth(at), gsp::subtree_com(at.exec, at.model, at.poses, subtrees);
        gsp::subtree_momentum(at.exec, at.model, at.poses, at.dynamics, subtrees);
        return std::tuple{subtrees.com, subtrees.linvel, subtrees.angmom};
      });
      check("length and moment arms of the tendon", [&](auto& at) {
        typename std::remove_cvref_t<decltype(at)>::View2 const tendon("tendon", at.state.worlds, 1 + at.model.archetypes(0).ntendonJ);
        smooth(at);
        for (int world = 0; world < at.state.worlds; ++world)
          for (int i = 0; i < int(tendon.extent(1)); ++i) tendon(world, i) = items(at, world, i);
        return std::tuple{tendon};
      });
    }
  }
}

namespace {
/// One instance for both sides of a comparison: inlined twice, sums and products may be contracted in two ways.
template <class P>
[[gnu::noinline]] P way_inside(P const& A, P const& B, P const& radius, P const& turn) {
  return gsp::detail::lanes_wrap_inside(A, B, radius, turn);
}
}  // namespace

// Newton's steps end lane by lane: a string's way has the bits that it has alone, whatever the ways beside it take.
TEST_CASE_TEMPLATE("strings through a ball do not see each other", Real, float, double) {
  constexpr int W = gsp::native_width<Real>;
  using P = gsp::Pack<Real, W>;
  gsp_test::Random r;
  for (int i = 0; i < 200; ++i) {
    P A, B, turn, radius;
    for (int l = 0; l < W; ++l) {
      radius.set(l, Real(0.12 + 0.1 * r()));
      A.set(l, radius[l] * Real(1 + std::exp(3 * r() - 2)));
      B.set(l, radius[l] * Real(1 + std::exp(3 * r() - 2)));
      turn.set(l, (std::acos(radius[l] / A[l]) + std::acos(radius[l] / B[l])) * Real(0.5 + 0.49 * r()));
    }
    P const mixed = way_inside(A, B, radius, turn);
    for (int l = 0; l < W; ++l) CHECK(mixed[l] == way_inside(P(A[l]), P(B[l]), P(radius[l]), P(turn[l]))[0]);
  }
}

// Where both ends are equally far, the first guess is the answer, whose derivatives still have to come. Ends that see the point: angles
// below acos(r / A) + acos(r / B). Steps of 1e-6: 1e-9 from rounding to 1e-15, 2e-10 from third derivatives below 1e3; bar 1e-6.
TEST_CASE("derivatives of a string's way through a ball are central differences") {
  using Real = gsp::Dual<double, 4>;
  double const s = 1e-6;
  double worst = 0;
  for (double A : {0.3, 1., 4.})
    for (double B : {0.3, 1., 4.})
      for (double r : {0.05, 0.2})
        for (double turn : {0.25, 1., 1.5}) {
          double const x[4] = {A, B, r, turn};
          Real const psi =
              gsp::detail::lanes_wrap_inside(Real::variable(A, 0), Real::variable(B, 1), Real::variable(r, 2), Real::variable(turn, 3));
          for (int k = 0; k < 4; ++k) {
            auto const moved = [&](double step) {
              double y[4] = {x[0], x[1], x[2], x[3]};
              y[k] += step;
              return gsp::detail::lanes_wrap_inside(y[0], y[1], y[2], y[3]);
            };
            worst = std::fmax(worst, std::abs(psi.slope[k] - (moved(s) - moved(-s)) / (2 * s)));
          }
        }
  CHECK(worst < 1e-6);
}
