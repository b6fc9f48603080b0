#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <gsp/dynamics/runge_kutta.hpp>
#include <gsp/dynamics/smooth.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"
#include "support/kernels.hpp"

// Laws of a user's own: at namespace scope, as nvcc wants them.
namespace test_laws {

/// What MJCF calls position with kp and kv, a pair for each actuator.
template <class Mem>
struct Servo {
  Kokkos::View<double**, Kokkos::LayoutRight, Mem> gains;  // (world, 2 nu)
  int first;                                               // drives this one and all behind it
  KOKKOS_FUNCTION bool drives(int actuator) const { return actuator >= first; }
  template <class T, class X>
  KOKKOS_FUNCTION X force(gsp::WorldLane<T> const& world, int actuator, T control, X length, X velocity) const {
    T const kp = world.load(gains, 2 * actuator), kv = world.load(gains, 2 * actuator + 1);
    return kp * (control - length) - kv * velocity;
  }
};

/// A damper, with its slope and without.
struct Damper {
  double b;
  template <class T, class X>
  KOKKOS_FUNCTION X force(gsp::WorldLane<T> const&, int, T, X, X velocity) const {
    return -b * velocity;
  }
};
struct ExplicitDamper {
  double b;
  template <class T>
  KOKKOS_FUNCTION T force(gsp::WorldLane<T> const&, int, T, T, T velocity) const {
    return T(-b) * velocity;
  }
};

}  // namespace test_laws

namespace {
using gsp::JointType;

constexpr int servos = 64;  // more than there are actuators
double kp(int i) { return 5 + 1.5 * i; }
double kv(int i) { return 0.3 + 0.1 * (i % 5); }

/// Three trees, two of them of one archetype, with servos on hinges and slides, through a fixed and a spatial tendon, on a site, a
/// slider-crank, and one with an activation. Some have a range of force. Actuators from `bare` on have neither gain nor bias.
gsp::CompiledModel model_of(int bare, gsp::Integrator integrator) {
  auto d = gsp_test::random_model({JointType::free, JointType::hinge, JointType::free}, 6, 5);
  for (auto& body : d.bodies) {
    gsp::SiteDescription site;
    site.name = body.name + "site", site.pos = {0.05, 0.1, -0.05};
    body.sites.push_back(site);
  }
  gsp::TendonDescription tendon;
  tendon.name = "fixed", tendon.terms = {{"t1b1j0", 0.7}, {"t1b2j0", -1.3}};
  d.tendons.push_back(tendon);
  tendon.name = "spatial", tendon.terms.clear();
  tendon.path = {{gsp::WrapType::site, "t1b1site"}, {gsp::WrapType::site, "t1b5site"}};
  d.tendons.push_back(tendon);

  auto const add = [&](gsp::ActuatorDescription a) {
    int const i = int(d.actuators.size());
    a.name = "a" + std::to_string(i);
    a.gainprm[0] = i < bare ? kp(i) : 0;
    if (i < bare) a.bias_type = gsp::ActuatorBias::affine, a.biasprm = {0, -kp(i), -kv(i)};
    a.force_limited = i % 3 == 1, a.force_range = {-4, 4};
    a.ctrl_limited = i % 4 == 2, a.ctrl_range = {-0.3, 0.3};
    d.actuators.push_back(a);
  };
  for (auto const& body : d.bodies)
    for (auto const& joint : body.joints)
      if (joint.type == JointType::hinge || joint.type == JointType::slide) add({.target_name = joint.name, .gear = {1.5, 0, 0, 0, 0, 0}});
  for (char const* name : {"fixed", "spatial"}) add({.target = gsp::Transmission::tendon, .target_name = name});
  add({.target = gsp::Transmission::site, .target_name = "t1b3site", .gear = {1, 0.5, 0, 0, 0.2, 1}});
  add({.target = gsp::Transmission::slider_crank, .target_name = "t1b2site", .reference_name = "t1b4site", .crank_length = 5});
  add({.target_name = "t1b1j0", .dynamics = gsp::ActuatorDynamics::filter, .dynprm = {0.05}});
  d.option.integrator = integrator;
  return gsp::compile(d);
}

template <class Exec>
struct Set {
  using Mem = typename Exec::memory_space;
  using View2 = Kokkos::View<double**, Kokkos::LayoutRight, Mem>;
  Exec exec;
  gsp::Model<double, Mem> model;
  gsp::State<double, Mem> state;
  gsp::Dynamics<double, Mem> dynamics;
  gsp::Poses<double, Mem> poses;
  View2 gains;
  Set(gsp::CompiledModel const& c, int worlds, gsp::Profile profile)
      : model(gsp::make_model<double>(exec, c, {.profile = profile})),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        dynamics(gsp::make_dynamics(exec, model, {.worlds = worlds})),
        poses(gsp::make_poses(exec, model, {.worlds = worlds})),
        gains("gains", worlds, 2 * servos) {
    gsp_test::randomise(c, state);
    auto const ctrl = gsp_test::host(state.ctrl), pairs = gsp_test::host(gains);
    for (int w = 0; w < worlds; ++w) {
      for (int i = 0; i < model.nu; ++i) ctrl(w, i) = std::sin(i + 2.3 * w);
      for (int i = 0; i < servos; ++i) pairs(w, 2 * i) = kp(i), pairs(w, 2 * i + 1) = kv(i);
    }
    Kokkos::deep_copy(state.ctrl, ctrl), Kokkos::deep_copy(gains, pairs), Kokkos::deep_copy(state.act, 0.4);
  }
  std::vector<double> dofs(int gsp::DynamicsLayout::*item) const {
    View2 const out("out", state.worlds, model.nv);
    gsp::copy_dofs(exec, model, dynamics, item, out);
    auto const h = gsp_test::host(out);
    return {h.data(), h.data() + h.size()};
  }
  std::vector<double> velocities() const {
    auto const h = gsp_test::snapshot(state.qvel);
    return {h.data(), h.data() + h.size()};
  }
};

/// Largest difference, over max(1, value).
double difference(std::vector<double> const& a, std::vector<double> const& b) {
  double worst = a.size() == b.size() ? 0 : INFINITY;
  for (std::size_t i = 0; i < a.size() && i < b.size(); ++i) worst = std::fmax(worst, std::abs(a[i] - b[i]) / std::fmax(1, std::abs(b[i])));
  return worst;
}
}  // namespace

// A law that says what MJCF's position servo says is that servo: the same forces through every transmission, within every range, the same
// slopes in the matrix (stable) and for implicitfast, in full packs, packs that are not full, and those that hold two robots of a world.
// Forces of up to 10^3 are summed in another order (1e-13), and M is of condition 10^3 at most, its inverse of norm below 10.
TEST_CASE_TEMPLATE("a law equal to the model's servos gives the same accelerations and steps", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  struct Way {
    gsp::Profile profile;
    gsp::Integrator integrator;
  };
  for (Way const way : {Way{gsp::Profile::stable, gsp::Integrator::euler}, Way{gsp::Profile::mujoco, gsp::Integrator::euler},
                        Way{gsp::Profile::mujoco, gsp::Integrator::implicitfast}})
    for (int worlds : {1, 3, 19})
      for (int first : {0, 7}) {
        Set<Exec> own(model_of(servos, way.integrator), worlds, way.profile), bare(model_of(first, way.integrator), worlds, way.profile);
        CHECK(own.model.nu > 15);
        test_laws::Servo<Mem> const law{bare.gains, first};
        gsp::smooth_dynamics(own.exec, own.model, own.state, own.poses, own.dynamics, {.keep_all = true});
        gsp::smooth_dynamics(bare.exec, bare.model, bare.state, bare.poses, bare.dynamics, {.keep_all = true}, law);
        using L = gsp::DynamicsLayout;
        auto const force = own.dofs(&L::actuator), acceleration = own.dofs(&L::acceleration);
        CHECK(*std::max_element(force.begin(), force.end()) > 3);
        CHECK(difference(bare.dofs(&L::actuator), force) < 1e-12);
        CHECK(difference(bare.dofs(&L::damping), own.dofs(&L::damping)) < 1e-12);
        CHECK(difference(bare.dofs(&L::stiffness), own.dofs(&L::stiffness)) < 1e-12);
        CHECK(difference(bare.dofs(&L::acceleration), acceleration) < 1e-12);
        gsp::integrate(own.exec, own.model, own.state, own.dynamics);
        gsp::integrate(bare.exec, bare.model, bare.state, bare.dynamics);
        CHECK(difference(bare.velocities(), own.velocities()) < 1e-12);

        gsp::forward_kinematics(bare.exec, bare.model, bare.state, bare.poses, bare.dynamics);
        gsp::mass_matrix(bare.exec, bare.model, bare.state, bare.poses, bare.dynamics);
        gsp::bias_forces(bare.exec, bare.model, bare.state, bare.poses, bare.dynamics);
        gsp::passive_forces(bare.exec, bare.model, bare.state, bare.poses, bare.dynamics);
        gsp::actuator_forces(bare.exec, bare.model, bare.state, bare.poses, bare.dynamics, law);
        auto const alone = bare.dofs(&L::actuator);
        gsp::smooth_dynamics(own.exec, own.model, own.state, own.poses, own.dynamics, {.keep_all = true});
        CHECK(difference(alone, own.dofs(&L::actuator)) < 1e-12);
      }
}

// Four evaluations of the law, at states between.
TEST_CASE_TEMPLATE("laws in a step of RK4", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Set<Exec> own(model_of(servos, gsp::Integrator::rk4), 5, gsp::Profile::mujoco),
      bare(model_of(0, gsp::Integrator::rk4), 5, gsp::Profile::mujoco);
  auto rk = gsp::make_runge_kutta(own.exec, own.model, {.worlds = 5});
  auto rk2 = gsp::make_runge_kutta(bare.exec, bare.model, {.worlds = 5});
  gsp::runge_kutta(own.exec, own.model, own.state, own.poses, own.dynamics, rk);
  gsp::runge_kutta(bare.exec, bare.model, bare.state, bare.poses, bare.dynamics, rk2, test_laws::Servo<Mem>{bare.gains, 0});
  CHECK(difference(bare.velocities(), own.velocities()) < 1e-12);
}

// A damper b on a slide of mass m for one step: v / (1 + h b / m) with its slope (stable), v (1 - h b / m) without; the latter grows
// beyond h b / m = 2. A pusher (b < 0) is explicit in both.
TEST_CASE_TEMPLATE("slopes are implicit where the law has them", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  d.option.gravity = {0, 0, 0};
  gsp::BodyDescription body;
  body.name = "cart", body.parent = 0, body.has_inertial = true;
  body.inertial.mass = 2, body.inertial.inertia = {1, 1, 1, 0, 0, 0};
  body.joints.push_back({.name = "cart", .type = JointType::slide});
  d.bodies.push_back(body);
  auto const still = gsp::compile(d);
  d.actuators.push_back({.name = "cart", .target_name = "cart"});
  auto const c = gsp::compile(d);
  double const h = c.option.timestep;
  for (double ratio : {0.5, 1.9, 2.1, -0.3}) {
    double const b = ratio * 2 / h;
    Set<Exec> with(c, 9, gsp::Profile::stable), without(c, 9, gsp::Profile::stable);
    auto const v = with.velocities();
    gsp::smooth_step(with.exec, with.model, with.state, with.poses, with.dynamics, test_laws::Damper{b});
    gsp::smooth_step(without.exec, without.model, without.state, without.poses, without.dynamics, test_laws::ExplicitDamper{b});
    auto const slow = with.velocities(), plain = without.velocities();
    for (int w = 0; w < 9; ++w) {
      CHECK(slow[w] == doctest::Approx(ratio > 0 ? v[w] / (1 + ratio) : v[w] * (1 - ratio)).epsilon(1e-14));
      CHECK(plain[w] == doctest::Approx(v[w] * (1 - ratio)).epsilon(1e-14));
    }
    CHECK((std::abs(plain[0]) > std::abs(v[0])) == (ratio > 2 || ratio < 0));
  }
  Set<Exec> none(still, 1, gsp::Profile::stable);
  CHECK_THROWS_WITH_AS(gsp::smooth_dynamics(none.exec, none.model, none.state, none.poses, none.dynamics, {}, test_laws::Damper{1}),
                       doctest::Contains("the model has no actuators: give it one"), std::invalid_argument);
}
