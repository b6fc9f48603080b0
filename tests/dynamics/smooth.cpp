#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <gsp/dynamics/integrate.hpp>
#include <gsp/dynamics/smooth.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"
#include "reference/rigid_bodies.hpp"
#include "support/kernels.hpp"
#include "support/kokkos_tools.hpp"

namespace {
using gsp::JointType;
using gsp_test::servo_model;

template <class R, class Exec>
struct Set {
  using Mem = typename Exec::memory_space;
  Exec exec;
  gsp::Model<R, Mem> model;
  gsp::State<R, Mem> state;
  gsp::Dynamics<R, Mem> dynamics;
  gsp::Poses<R, Mem> poses;
  Set(gsp::CompiledModel const& c, int worlds, gsp::Profile profile = gsp::Profile::mujoco, std::uint64_t seed = 3)
      : model(gsp::make_model<R>(exec, c, {.profile = profile})),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        dynamics(gsp::make_dynamics(exec, model, {.worlds = worlds})),
        poses(gsp::make_poses(exec, model, {.worlds = worlds})) {
    gsp_test::randomise(c, state, seed);
    auto const ctrl = gsp_test::host(state.ctrl);
    for (int w = 0; w < worlds; ++w)
      for (int i = 0; i < model.nu; ++i) ctrl(w, i) = R(std::sin(i + 2.3 * w));
    Kokkos::deep_copy(state.ctrl, ctrl);
  }
  void smooth() { gsp::smooth_dynamics(exec, model, state, poses, dynamics, {.keep_all = true, .joint_poses = true}); }
  void composed() {
    gsp::forward_kinematics(exec, model, state, poses, dynamics);
    gsp::mass_matrix(exec, model, state, poses, dynamics);
    gsp::bias_forces(exec, model, state, poses, dynamics);
    gsp::passive_forces(exec, model, state, poses, dynamics);
    gsp::actuator_forces(exec, model, state, poses, dynamics);
    gsp::factor(exec, model, state, dynamics);
  }
  std::vector<R> dofs(int gsp::DynamicsLayout::*item) const {  // (worlds, nv)
    Kokkos::View<R**, Kokkos::LayoutRight, Mem> out("out", state.worlds, model.nv);
    gsp::copy_dofs(exec, model, dynamics, item, out);
    auto const h = gsp_test::host(out);
    return {h.data(), h.data() + h.size()};
  }
  std::vector<R> mass() const {
    Kokkos::View<R***, Kokkos::LayoutRight, Mem> out("out", state.worlds, model.nv, model.nv);
    gsp::dense_mass_matrix(exec, model, dynamics, out);
    auto const h = gsp_test::host(out);
    return {h.data(), h.data() + h.size()};
  }
  /// Everything that comes out, one number after the other.
  std::vector<R> all() const {
    std::vector<R> result = mass();
    auto const add = [&](auto const& v) { result.insert(result.end(), v.begin(), v.end()); };
    using L = gsp::DynamicsLayout;
    add(dofs(&L::bias)), add(dofs(&L::passive)), add(dofs(&L::actuator)), add(dofs(&L::force));  // nvcc takes no lists of them
    add(dofs(&L::acceleration)), add(dofs(&L::velocity));
    auto const add_view = [&](auto const& v) {
      auto const h = gsp_test::host(v);
      result.insert(result.end(), h.data(), h.data() + h.size());
    };
    add_view(poses.xpos), add_view(poses.xquat), add_view(poses.xanchor), add_view(poses.xaxis);
    return result;
  }
};

template <class R>
bool same_bits(std::vector<R> const& a, std::vector<R> const& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(R)) == 0;
}
}  // namespace

// Numbers of worlds around the width of a pack and of a warp: padding lanes must neither be seen nor disturb others.
// Tolerances: kinematics 8 links of 100 roundings each; M sums 10^3 products below 10; bias: what its reference is good for, times |bias| <
// 10^3.
TEST_CASE_TEMPLATE("poses, mass matrix and forces are those of the plain reference", Exec, GSP_TEST_EXECS) {
  auto const c = servo_model();
  for (int worlds : {1, 3, 15, 16, 17, 40}) {
    Set<double, Exec> s(c, worlds);
    s.smooth();
    auto const M = s.mass(), bias = s.dofs(&gsp::DynamicsLayout::bias), passive = s.dofs(&gsp::DynamicsLayout::passive),
               actuator = s.dofs(&gsp::DynamicsLayout::actuator);
    auto const xpos = gsp_test::host(s.poses.xpos), xquat = gsp_test::host(s.poses.xquat);
    auto const qpos = gsp_test::host(s.state.qpos), qvel = gsp_test::host(s.state.qvel), ctrl = gsp_test::host(s.state.ctrl);
    double pose = 0, mass = 0, forces = 0, springs = 0, servos = 0;
    std::size_t const nv = c.nv;
    for (int w = 0; w < worlds; ++w) {
      std::vector<double> const q(&qpos(w, 0), &qpos(w, 0) + c.nq), v(&qvel(w, 0), &qvel(w, 0) + nv);
      gsp_reference::RigidBodies const at(c, q);
      for (int b = 1; b < c.nbody; ++b) {
        double dot = 0;
        for (int k = 0; k < 3; ++k) pose = std::fmax(pose, std::abs(xpos(w, b, k) - at.x[b][k]));
        double const quat[4] = {at.q[b].w, at.q[b].x, at.q[b].y, at.q[b].z};
        for (int k = 0; k < 4; ++k) dot += quat[k] * xquat(w, b, k);
        for (int k = 0; k < 4; ++k) pose = std::fmax(pose, std::abs((dot < 0 ? -1 : 1) * xquat(w, b, k) - quat[k]));
      }
      auto const M_ref = gsp_reference::mass_matrix(c, at), bias_ref = gsp_reference::bias_forces(c, q, v);
      for (std::size_t i = 0; i < nv * nv; ++i) mass = std::fmax(mass, std::abs(M[w * nv * nv + i] - M_ref[i]));
      for (std::size_t i = 0; i < nv; ++i) forces = std::fmax(forces, std::abs(bias[w * nv + i] - bias_ref[i]));

      std::vector<double> passive_ref(nv), actuator_ref(nv, 0.);
      for (int j = 0; j < c.njnt; ++j) {
        int const a = c.jnt_qposadr[j], d = c.jnt_dofadr[j];
        auto const type = JointType(c.jnt_type[j]);
        if (type == JointType::hinge || type == JointType::slide)
          passive_ref[d] = -c.jnt_stiffness[j] * (q[a] - c.qpos_spring[a]) - c.dof_damping[d] * v[d];
        else {
          for (int k = 0, n = type == JointType::free ? 6 : 3; k < n; ++k) passive_ref[d + k] = -c.dof_damping[d + k] * v[d + k];
          if (type == JointType::ball) {  // at rest at the identity: -k times the rotation vector, 2 acos(w) about the axis
            double const sign = q[a] < 0 ? -1 : 1, sine = std::sqrt(q[a + 1] * q[a + 1] + q[a + 2] * q[a + 2] + q[a + 3] * q[a + 3]);
            for (int k = 0; k < 3; ++k) passive_ref[d + k] -= c.jnt_stiffness[j] * 2 * std::acos(sign * q[a]) * sign * q[a + 1 + k] / sine;
          }
        }
      }
      for (int k = 0; k < c.nu; ++k) {
        int const j = c.act_id[k];
        double const force = 20 * ctrl(w, k) - 20 * q[c.jnt_qposadr[j]] - v[c.jnt_dofadr[j]];
        actuator_ref[c.jnt_dofadr[j]] = k % 2 ? std::clamp(force, -4., 4.) : force;
      }
      double length = 0, rate = 0;
      for (int e = 0; e < 2; ++e)
        length += c.term_coef[e] * q[c.jnt_qposadr[c.term_jnt[e]]], rate += c.term_coef[e] * v[c.jnt_dofadr[c.term_jnt[e]]];
      double const pull = -5 * (length > 0.1 ? length - 0.1 : length < -0.1 ? length + 0.1 : 0) - 0.4 * rate;
      for (int e = 0; e < 2; ++e) passive_ref[c.jnt_dofadr[c.term_jnt[e]]] += c.term_coef[e] * pull;
      for (std::size_t i = 0; i < nv; ++i)
        springs = std::fmax(springs, std::abs(passive[w * nv + i] - passive_ref[i])),
        servos = std::fmax(servos, std::abs(actuator[w * nv + i] - actuator_ref[i]));
    }
    CAPTURE(worlds);
    CHECK(pose < 1e-13);
    CHECK(mass < 1e-12);
    CHECK(forces < 1e-6);
    CHECK(springs < 1e-12);
    CHECK(servos < 1e-12);
  }
}

// Contraction to fused multiply-adds is explicit in the sources and switched off in host compilers that follow the standard, so bits agree
// there; nvcc contracts as it likes, kernel by kernel: on a GPU 1e-4 relative, a thousand roundings.
TEST_CASE_TEMPLATE("the fused kernel gives the numbers of the single functions", Exec, GSP_TEST_EXECS) {
  auto const c = servo_model();
  for (auto profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    Set<float, Exec> a(c, 21, profile), b(c, 21, profile);
    a.smooth(), b.composed();
    auto const x = a.all(), y = b.all();
    if constexpr (!gsp::is_device<Exec>)
      CHECK(same_bits(x, y));
    else
      for (std::size_t i = 0; i < x.size(); ++i) REQUIRE(std::abs(x[i] - y[i]) < 1e-4 * std::max(1.f, std::abs(x[i])));
  }
}

// The same in ten steps; worlds of one tree take another way than worlds of three. One world is not finite and has to stay as it is.
TEST_CASE_TEMPLATE("the fused step gives the state of smooth_dynamics and integrate", Exec, GSP_TEST_EXECS) {
  auto const several = servo_model();
  auto one = gsp_test::random_model({JointType::free}, 9);
  for (auto& body : one.bodies)
    for (auto& joint : body.joints) joint.damping = 0.3;
  auto damped = gsp::compile(one);
  for (auto integrator : {gsp::Integrator::euler, gsp::Integrator::implicitfast, gsp::Integrator::implicit})
    for (auto profile : {gsp::Profile::stable, gsp::Profile::mujoco})
      for (auto* c : {&several, static_cast<gsp::CompiledModel const*>(&damped)}) {
        gsp::CompiledModel model = *c;
        model.option.integrator = integrator;
        Set<double, Exec> a(model, 37, profile), b(model, 37, profile);
        auto const spoil = [](auto const& set) {
          auto const qvel = gsp_test::host(set.state.qvel);
          qvel(5, 1) = std::nan("");
          Kokkos::deep_copy(set.state.qvel, qvel);
        };
        spoil(a), spoil(b);
        for (int i = 0; i < 10; ++i) {
          gsp::smooth_dynamics(a.exec, a.model, a.state, a.poses, a.dynamics), gsp::integrate(a.exec, a.model, a.state, a.dynamics);
          gsp::smooth_step(b.exec, b.model, b.state, b.poses, b.dynamics);
        }
        auto const same = [](auto const& a_view, auto const& b_view) {
          auto const u = gsp_test::host(a_view), v = gsp_test::host(b_view);
          bool all = true;
          for (std::size_t i = 0; i < u.size(); ++i) {  // bits on hosts; 1e3 roundings a step else
            double const x = u.data()[i], y = v.data()[i], bound = gsp::is_device<Exec> ? 1e-9 * std::fmax(1., std::abs(x)) : 0;
            all &= std::isnan(x) ? std::isnan(y) : std::abs(x - y) <= bound;
          }
          return all;
        };
        CHECK(same(a.state.qpos, b.state.qpos));
        CHECK(same(a.state.qvel, b.state.qvel));
        CHECK(same(a.poses.xpos, b.poses.xpos));
        auto const steps = gsp_test::host(b.state.steps);
        auto const status = gsp_test::host(b.state.status);
        for (int w = 0; w < 37; ++w) {
          CHECK(steps(w) == (w == 5 ? 0 : 10));
          CHECK(status(w) == (w == 5 ? gsp::status::not_finite : 0));
        }
      }
}

#if defined(KOKKOS_ENABLE_SERIAL) && defined(KOKKOS_ENABLE_OPENMP)
TEST_CASE("Serial and OpenMP give the same bits") {
  auto const c = servo_model();
  Set<float, Kokkos::Serial> a(c, 40, gsp::Profile::stable);
  Set<float, Kokkos::OpenMP> b(c, 40, gsp::Profile::stable);
  a.smooth(), b.smooth();
  CHECK(same_bits(a.all(), b.all()));
}
#endif

// One program, three widths: on the CPU the same stage runs over single numbers. Packs have their own sin and cos (2 ulp), so not the same
// bits; conditioning of the accelerations below 10^3.
TEST_CASE("packs and single numbers agree") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  auto const c = servo_model();
  Set<double, Exec> a(c, 19), b(c, 19);
  a.smooth();
  using Stage = gsp::detail::SmoothStage<decltype(b.state), decltype(b.poses)>;
  gsp::for_lanes<double>("gsp::test::single_numbers", b.exec, b.model, b.dynamics,
                         Stage{b.state, b.poses, {.keep_all = true, .joint_poses = true}, true});
  gsp::detail::leaves(b.dynamics, b.state, gsp::detail::left_by_smooth(true, true));  // as smooth_dynamics notes
  auto const x = a.all(), y = b.all();
  double worst = 0;
  for (std::size_t i = 0; i < x.size(); ++i) worst = std::fmax(worst, std::abs(x[i] - y[i]) / std::fmax(1, std::abs(y[i])));
  MESSAGE("largest difference " << worst);
  CHECK(worst < 1e-11);
}

// Constants per world (Field::stride): each world must be as if the model had been compiled with its mass, damping and gravity.
TEST_CASE_TEMPLATE("each world can have constants of its own", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  int const worlds = 17;
  auto const c = servo_model();
  Set<float, Exec> s(c, worlds, gsp::Profile::stable);
  auto const spread = [&](gsp::Field<float>& field, int n, auto const& value) {
    Kokkos::View<float**, Kokkos::LayoutRight, Mem> own("own", worlds, n);
    auto const h = Kokkos::create_mirror_view(own);
    for (int w = 0; w < worlds; ++w)
      for (int i = 0; i < n; ++i) h(w, i) = float(value(w, i));
    Kokkos::deep_copy(own, h);
    field.data = own.data(), field.stride = n;
    return own;  // kept alive by the caller
  };
  auto const mass = [&](int w, int b) { return c.body_mass[b] * (1 + 0.1 * w); };
  auto const damping = [&](int w, int i) { return c.dof_damping[i] + 0.02 * w; };
  auto const gravity = [&](int w, int k) { return k == 2 ? -9.81 + 0.3 * w : 0.1 * w; };
  auto const m = spread(s.model.body_mass, c.nbody, mass), b = spread(s.model.dof_damping, c.nv, damping),
             g = spread(s.model.gravity, 3, gravity);
  s.smooth();
  auto const velocity = s.dofs(&gsp::DynamicsLayout::velocity);
  for (int w : {0, 1, 16}) {
    auto changed = c;
    for (int k = 0; k < c.nbody; ++k) changed.body_mass[k] = mass(w, k);
    for (int i = 0; i < c.nv; ++i) changed.dof_damping[i] = damping(w, i);
    for (int k = 0; k < 3; ++k) changed.option.gravity[k] = gravity(w, k);
    Set<float, Exec> one(changed, worlds, gsp::Profile::stable);
    one.smooth();
    auto const expected = one.dofs(&gsp::DynamicsLayout::velocity);
    for (int i = 0; i < c.nv; ++i) CHECK(velocity[w * c.nv + i] == expected[w * c.nv + i]);
  }
}

TEST_CASE_TEMPLATE("the stages neither allocate nor fence", Exec, GSP_TEST_EXECS) {
  auto const c = servo_model();
  Set<float, Exec> s(c, 5);
  s.exec.fence();
  gsp_test::check_algorithm(s.exec, gsp_test::watch([&] {
                              s.smooth(), s.composed(), gsp::integrate(s.exec, s.model, s.state, s.dynamics);
                              gsp::smooth_step(s.exec, s.model, s.state, s.poses, s.dynamics);
                            }));
}
