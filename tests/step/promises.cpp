#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/collision/geom_values.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/names.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>
#include <limits>

#include "step/world.hpp"
#include "support/kokkos_tools.hpp"

// What gsp::step promises besides the right numbers: it allocates nothing once it is warm, waits at its end alone, and a world that goes
// wrong is alone with it.
namespace test_types {
/// In world `world`, ties the robot and two of the objects beside it: three trees, which is refused.
struct TieThree : gsp::OneFreeRow {
  int world, dof[3];
  KOKKOS_FUNCTION int count(int w) const { return w == world; }
  KOKKOS_FUNCTION gsp::RowLaw<float> law(int, int, int, float, float, float) const { return {0.f, 0.f}; }
  template <class Row>
  KOKKOS_FUNCTION float jacobian(int, int, int, Row&& J) const {
    for (int i = 0; i < 3; ++i) J.set_dof(dof[i], 1.f);
    return 0.f;
  }
};
/// A row on dof 0 whose law or bounds are numbers that none can have, in all worlds but the first; its state is in order.
struct NoLaw : gsp::OneFreeRow {
  static constexpr int kinds = 11;
  KOKKOS_FUNCTION int count(int) const { return 1; }
  KOKKOS_FUNCTION gsp::RowId id(int world, int k) const { return {world == 10 ? 1u << 27 : std::uint32_t(k), 0}; }
  KOKKOS_FUNCTION gsp::RowLaw<double> law(int world, int, int, double, double, double) const {
    double const inf = Kokkos::Experimental::infinity_v<double>, nan = inf - inf;
    return {world == 1 ? nan : world == 2 ? inf : world == 3 ? -1. : 0., world == 4 ? nan : world == 5 ? inf : world == 6 ? -inf : 1.};
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int, int) const {
    double const inf = Kokkos::Experimental::infinity_v<double>, nan = inf - inf;
    return {world == 7 ? nan : world == 9 ? 2. : -inf, world == 8 ? nan : world == 9 ? 1. : inf};
  }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int, int, Row&& J) const {
    J.set_dof(0, 1.);
    return 0.1;
  }
};
/// Elements that touch nothing: no entry, a point of the world, an entry of 0.
struct Nothing : gsp::OneFreeRow {
  double compliance = 0;
  KOKKOS_FUNCTION int count(int) const { return 3; }
  KOKKOS_FUNCTION gsp::RowLaw<double> law(int, int, int, double, double, double) const { return {compliance, 1.}; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int k, int, Row&& J) const {
    if (k == 1) J.add_point(0, {1., 0., 0.}, {0., 0., 1.});
    if (k == 2) J.set_dof(0, 0.);
    return 0.1;
  }
};
/// A row whose Jacobian is no number in worlds 1 and 2, and moves nothing in the others.
struct NoJacobian : gsp::OneFreeRow {
  KOKKOS_FUNCTION int count(int) const { return 1; }
  KOKKOS_FUNCTION gsp::RowLaw<float> law(int, int, int, float, float, float) const { return {0.f, 0.f}; }
  template <class Row>
  KOKKOS_FUNCTION float jacobian(int world, int, int, Row&& J) const {
    float const inf = Kokkos::Experimental::infinity_v<float>;
    if (world == 1 || world == 2) J.set_dof(2, world == 1 ? inf : inf - inf);
    return 0.f;
  }
};
}  // namespace test_types

namespace {
template <class Exec>
struct Scene {
  using Mem = typename Exec::memory_space;
  Exec exec;
  gsp::CompiledModel compiled = gsp::compile(gsp::samples::quadruped_scene());
  gsp::Model<float, Mem> model;
  gsp::State<float, Mem> state;
  gsp::Simulation<float, Mem> sim;
  explicit Scene(int worlds, Exec const& on = Exec{}, gsp::ModelOptions options = {})
      : exec(on),
        model(gsp::make_model<float>(exec, compiled, options)),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        sim(gsp::make_simulation(exec, model, compiled, {.worlds = worlds})) {
    auto const& stand = compiled.keyframes.at(0);
    auto const q = gsp_test::host(state.qpos), v = gsp_test::host(state.qvel), u = gsp_test::host(state.ctrl);
    for (int w = 0; w < worlds; ++w) {
      for (int i = 0; i < model.nq; ++i) q(w, i) = float(stand.qpos[i]);
      for (int i = 0; i < model.nu; ++i) u(w, i) = float(stand.ctrl[i]);
      for (int i = 0; i < model.nv; ++i) v(w, i) = float(0.2 * std::sin(1.3 * i + w));
    }
    Kokkos::deep_copy(state.qpos, q), Kokkos::deep_copy(state.qvel, v), Kokkos::deep_copy(state.ctrl, u);
  }
  template <class... More>
  void step(int n, More const&... more) {
    gsp::step(exec, model, state, sim, {.steps = n}, more...);
  }
};
template <class A, class B>
bool same(A const& a, B const& b, int w) {
  return std::memcmp(&a(w, 0), &b(w, 0), sizeof(float) * a.extent(1)) == 0;
}
}  // namespace

// The host waits for the copies of the two numbers that it reads at the end, once a call however many steps.
TEST_CASE_TEMPLATE("a warm step allocates nothing and waits at its end alone", Exec, GSP_TEST_EXECS) {
  Scene<Exec> s(3, gsp_test::other_instance(Exec{}));
  s.step(60);  // everything has touched the floor: the pools have their size
  auto const one = gsp_test::watch([&] { s.step(1); }), ten = gsp_test::watch([&] { s.step(10); });
  gsp_test::check_no_allocation(ten);
#ifdef KOKKOS_ENABLE_CUDA
  if constexpr (gsp::is_device<Exec>) {  // some beside, in the simulation's own queue
    int beside = 0;
    for (auto const& kernel : ten.kernels) {
      bool const own = kernel.device == Kokkos::Tools::Experimental::device_id(*s.sim.side.queue->exec);
      CHECK_MESSAGE((own || kernel.device == Kokkos::Tools::Experimental::device_id(s.exec)), "on another instance: ", kernel.label);
      beside += own;
    }
    CHECK(beside >= 10);
  } else
#endif
    gsp_test::check_instance(s.exec, ten);
  for (auto const& kernel : ten.kernels)  // Kokkos gives its own label to the kernel that fills a view with a number
    CHECK_MESSAGE((kernel.label.rfind("gsp::", 0) == 0 || kernel.label.rfind("Kokkos::ViewFill", 0) == 0),
                  "kernel without a gsp label: ", kernel.label);
  CHECK(ten.kernels.size() > 8 * one.kernels.size());
  CHECK(ten.fences.size() == one.fences.size());
}

// Pools, and the buffers of the solver beside them, grow where the host settles: never in a launch, behind which others may be at work.
TEST_CASE_TEMPLATE("launches of profile mujoco make no room", Exec, GSP_TEST_EXECS) {
  Scene<Exec> s(3, Exec{}, {.profile = gsp::Profile::mujoco});
  s.sim.rows = gsp::make_rows(s.exec, s.model, {.worlds = 3, .rows_per_world = 1, .entries_per_world = 1});
  s.sim.impulses = gsp::make_impulses(s.exec, s.sim.rows);
  s.sim.newton = gsp::make_newton(s.exec, s.sim.rows);
  int rounds = 0;
  for (int left = 1; left > 0; left = gsp::settle(s.exec, s.sim), ++rounds) {
    auto const seen = gsp_test::watch([&] { gsp::launch_step(s.exec, s.model, s.state, s.sim); });
    CHECK(seen.allocations.empty());
    CHECK(seen.fences.empty());
  }
  CHECK(rounds > 1);
}

// Each profile has its solver, and each solver its options.
TEST_CASE_TEMPLATE("a step's options reach the solver of its profile", Exec, GSP_TEST_EXECS) {
  for (auto const profile : {gsp::Profile::mujoco, gsp::Profile::stable}) {
    Scene<Exec> s(1, Exec{}, {.profile = profile});
    bool const mujoco = profile == gsp::Profile::mujoco;
    s.step(5);
    auto const iterations = [&](gsp::PgsOptions solver, gsp::NewtonOptions newton) {
      auto state = s.state;
      gsp::step(s.exec, s.model, state, s.sim, {.solver = solver, .newton = newton});
      return gsp_test::host(s.sim.solution.iterations)(0);
    };
    // Impulses of 1e-1 are near enough after the first iteration; to a tolerance of 0 it takes more.
    CHECK((iterations({.iterations = 3, .tolerance = 0}, {.iterations = 1, .warm = false}) == (mujoco ? 1 : 3)));
    int const coarse = iterations({.least = 1, .tolerance = 1}, {.tolerance = 1e3f, .warm = false});
    int const fine = iterations({.tolerance = 1e-7f}, {.tolerance = 0, .warm = false});
    CHECK(coarse < fine);
  }
}

// NaN in a control, an infinite velocity, a position that is NaN, and a row over three trees: each stops its own world, which keeps its
// bits and says why; all others have the bits of a batch in which nothing went wrong.
TEST_CASE_TEMPLATE("a world that goes wrong is alone with it", Exec, GSP_TEST_EXECS) {
  int const worlds = 19, n = 10;
  float const nan = std::numeric_limits<float>::quiet_NaN();
  Scene<Exec> good(worlds), bad(worlds);
  good.step(5), bad.step(5);
  auto const u = gsp_test::host(bad.state.ctrl), v = gsp_test::host(bad.state.qvel), q = gsp_test::host(bad.state.qpos);
  u(2, 7) = nan, v(9, 3) = std::numeric_limits<float>::infinity(), q(16, bad.model.nq - 7) = nan;
  Kokkos::deep_copy(bad.state.ctrl, u), Kokkos::deep_copy(bad.state.qvel, v), Kokkos::deep_copy(bad.state.qpos, q);
  auto const q0 = gsp_test::snapshot(bad.state.qpos), v0 = gsp_test::snapshot(bad.state.qvel);
  good.step(n), bad.step(n, test_types::TieThree{{}, 5, {0, 18, 24}});
  auto const qg = gsp_test::host(good.state.qpos), qb = gsp_test::host(bad.state.qpos), vb = gsp_test::host(bad.state.qvel);
  auto const status = gsp_test::host(bad.state.status);
  auto const steps = gsp_test::host(bad.state.steps);
  for (int w = 0; w < worlds; ++w) {
    CAPTURE(w);
    bool const numbers = w == 2 || w == 9 || w == 16, stopped = numbers || w == 5;
    CHECK(status(w) == (numbers ? gsp::status::not_finite : w == 5 ? gsp::status::row_refused | gsp::status::refused_place : 0u));
    CHECK(steps(w) == (stopped ? 5 : 5 + n));
    CHECK(same(qb, stopped ? q0 : gsp_test::snapshot(qg), w));
    if (stopped) CHECK(same(vb, v0, w));
  }
}

// In both profiles: such a world stays and says why, the first goes on to the rate that its row asks for.
TEST_CASE_TEMPLATE("a row whose law or bounds are no numbers, or whose identity is too great, is refused", Exec, GSP_TEST_EXECS) {
  auto const compiled = gsp_test::servo_model();
  for (auto profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    gsp_test::World<double, Exec> world(compiled, test_types::NoLaw::kinds, {.profile = profile});
    gsp::step(world.exec, world.model, world.state, world.sim, {.steps = 2}, test_types::NoLaw{});
    auto const status = gsp_test::host(world.state.status);
    auto const steps = gsp_test::host(world.state.steps);
    auto const q = world.qpos(), v = world.qvel();
    for (int w = 0; w < test_types::NoLaw::kinds; ++w) {
      CAPTURE(w);
      CHECK((status(w) & gsp::status::row_refused) == (w == 0 ? 0u : gsp::status::row_refused));
      CHECK((status(w) & gsp::status::causes) == (w == 0   ? 0u
                                                  : w < 7  ? gsp::status::refused_law
                                                  : w < 10 ? gsp::status::refused_bounds
                                                           : gsp::status::refused_identity));
      CHECK(steps(w) == (w == 0 ? 2 : 0));
      for (int i = 0; w > 0 && i < world.model.nv; ++i) CHECK(v(w, i) == 0);
      for (int i = 0; w > 0 && i < world.model.nq; ++i) CHECK(q(w, i) == compiled.qpos0[i]);
    }
    CHECK(std::abs(v(0, 0) - 1) < 1e-5);  // the tolerance of the sweeps: 1e-4 |g| h = 2e-6
  }
}
// And one that moves nothing bears zeta / C, as its softness says; rigid, it has none.
TEST_CASE_TEMPLATE("a row that touches nothing has no impulse", Exec, GSP_TEST_EXECS) {
  auto const compiled = gsp_test::servo_model();
  for (auto profile : {gsp::Profile::stable, gsp::Profile::mujoco})
    for (double const compliance : {0., 0.5}) {
      gsp_test::World<double, Exec> world(compiled, 2, {.profile = profile});
      gsp::step(world.exec, world.model, world.state, world.sim, {.steps = 3}, test_types::Nothing{{}, compliance});
      auto const impulses = gsp::impulses_of<test_types::Nothing>(world.sim.rows, world.sim.impulses);
      Kokkos::View<double[2][3], typename Exec::memory_space> const found("found");
      Kokkos::parallel_for(
          "gsp::test::found", Kokkos::RangePolicy<Exec>(0, 6), KOKKOS_LAMBDA(int i) { found(i / 3, i % 3) = impulses(i / 3, i % 3); });
      auto const p = gsp_test::host(found);
      for (int i = 0; i < 6; ++i) CHECK(p(i / 3, i % 3) == (i % 3 == 2 && compliance > 0 ? 1 / compliance : 0.));
      CHECK(gsp_test::host(world.state.status)(1) == 0u);
    }
}

// Worlds beside neighbours whose angles are beyond what sincos of a pack reduces (8192 rad in float, 1e9 in double), or not numbers.
TEST_CASE_TEMPLATE("a world has the bits that it has alone, whatever its neighbours do", Exec, GSP_TEST_EXECS) {
  auto const in_precision = [](auto zero) {
    using R = decltype(zero);
    auto const compiled = gsp_test::servo_model();
    int const worlds = 21;
    int const hinge = compiled.jnt_qposadr[gsp::joint_id(compiled, "t1b1j0")];
    for (auto profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
      gsp_test::World<R, Exec> batch(compiled, worlds, {.profile = profile});
      batch.may_stop = true;
      auto const q = gsp_test::host(batch.state.qpos), v = gsp_test::host(batch.state.qvel);
      for (int w = 0; w < worlds; ++w)
        for (int i = 0; i < batch.model.nv; ++i) v(w, i) = R(std::sin(1.3 * i + w));
      double const far[] = {8200, -17000, 2.1e9, std::numeric_limits<double>::quiet_NaN()};
      for (int i = 0; i < 4; ++i) q(5 * i + 1, hinge) = R(far[i]);
      Kokkos::deep_copy(batch.state.qpos, q), Kokkos::deep_copy(batch.state.qvel, v);
      auto const q0 = gsp_test::snapshot(batch.state.qpos), v0 = gsp_test::snapshot(batch.state.qvel);
      batch.step(30);
      auto const qb = batch.qpos(), vb = batch.qvel();
      for (int w = 0; w < worlds; w += 1 + w % 2) {
        CAPTURE(w);
        gsp_test::World<R, Exec> alone(compiled, 1, {.profile = profile});
        alone.may_stop = true;
        auto const q1 = gsp_test::host(alone.state.qpos), v1 = gsp_test::host(alone.state.qvel);
        for (int i = 0; i < batch.model.nq; ++i) q1(0, i) = q0(w, i);
        for (int i = 0; i < batch.model.nv; ++i) v1(0, i) = v0(w, i);
        Kokkos::deep_copy(alone.state.qpos, q1), Kokkos::deep_copy(alone.state.qvel, v1);
        alone.step(30);
        auto const qa = alone.qpos(), va = alone.qvel();
        CHECK(std::memcmp(&qa(0, 0), &qb(w, 0), sizeof(R) * qa.extent(1)) == 0);
        CHECK(std::memcmp(&va(0, 0), &vb(w, 0), sizeof(R) * va.extent(1)) == 0);
      }
    }
  };
  in_precision(0.f), in_precision(0.);
}

#if defined(KOKKOS_ENABLE_SERIAL) && defined(KOKKOS_ENABLE_OPENMP)
TEST_CASE("Serial and OpenMP step to the same bits") {
  Scene<Kokkos::Serial> a(18);
  Scene<Kokkos::OpenMP> b(18);
  a.step(40), b.step(40);
  for (int w = 0; w < 18; ++w) {
    CHECK(same(a.state.qpos, b.state.qpos, w));
    CHECK(same(a.state.qvel, b.state.qvel, w));
  }
}
#endif

// A body on a floor whose constraint has a Jacobian that is no number stays where it is: it neither moves on nor falls through the floor,
// which the same solver holds.
TEST_CASE_TEMPLATE("a Jacobian that is no number stops its world alone", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  gsp::GeomDescription floor, box;
  floor.type = gsp::ShapeType::plane, floor.size = {1, 1, 1};
  box.size = {0.1, 0.1, 0.1}, box.type = gsp::ShapeType::box;
  d.bodies[0].geoms = {floor};
  gsp::BodyDescription body;
  body.parent = 0, body.pos = {0, 0, 0.1}, body.geoms = {box}, body.joints.emplace_back().type = gsp::JointType::free;
  d.bodies.push_back(body);
  auto const compiled = gsp::compile(d);
  for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco})
    for (auto const cone : {gsp::FrictionCone::elliptic, gsp::FrictionCone::pyramidal}) {
      CAPTURE(int(profile));
      CAPTURE(int(cone));
      Exec const exec;
      auto const model = gsp::make_model<float>(exec, compiled, {.profile = profile});
      auto state = gsp::make_state(exec, model, {.worlds = 4});
      auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = 4, .cone = cone});
      gsp::step(exec, model, state, sim, {.steps = 50}, test_types::NoJacobian{});
      auto const q = gsp_test::host(state.qpos);
      auto const status = gsp_test::host(state.status);
      for (int w = 0; w < 4; ++w) {
        bool const stops = w == 1 || w == 2;
        CHECK(bool(status(w) & gsp::status::not_finite) == stops);
        CHECK(std::abs(q(w, 2) - 0.1f) < 1e-3f);
        if (stops) CHECK(q(w, 2) == 0.1f);
        CHECK((w == 0 || stops || same(q, q, w)));
      }
      CHECK(q(0, 2) == q(3, 2));
    }
}

// Sizes, poses and friction of geoms that are no numbers, of the last box and, as a plane has no size, of the floor: the world stops, where
// its contacts were lost in silence. With all pairs listed, and where they are searched for.
TEST_CASE_TEMPLATE("geoms that are no geoms stop their world alone", Exec, GSP_TEST_EXECS) {
  float const inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  for (int const bodies : {1, 400})
    for (auto const& [field, of_floor] :
         {std::pair{gsp::GeomField::size, false}, std::pair{gsp::GeomField::pos, false}, std::pair{gsp::GeomField::pos, true},
          std::pair{gsp::GeomField::quat, false}, std::pair{gsp::GeomField::quat, true}, std::pair{gsp::GeomField::friction, false}})
      for (float const wrong : {nan, inf}) {
        bool const stops = field != gsp::GeomField::friction || wrong == inf;  // NaN acts as 1e-5, as in MuJoCo
        int const components = field == gsp::GeomField::quat ? 4 : 3;
        CAPTURE(bodies);
        CAPTURE(of_floor);
        CAPTURE(int(field));
        CAPTURE(wrong);
        gsp::Description d;
        gsp::GeomDescription floor, box;
        floor.type = gsp::ShapeType::plane, floor.size = {1, 1, 1};
        box.size = {0.1, 0.1, 0.1}, box.type = gsp::ShapeType::box;
        d.bodies[0].geoms = {floor};
        for (int b = 0; b < bodies; ++b) {
          gsp::BodyDescription body;
          body.parent = 0, body.pos = {0.3 * b, 0, 0.1}, body.geoms = {box}, body.joints.emplace_back().type = gsp::JointType::free;
          d.bodies.push_back(body);
        }
        Exec const exec;
        auto const compiled = gsp::compile(d);
        auto const model = gsp::make_model<float>(exec, compiled);
        auto state = gsp::make_state(exec, model, {.worlds = 2});
        auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = 2});
        gsp::make_per_world(exec, sim.collision, {field}, 2);
        using Values = Kokkos::View<float**, Kokkos::LayoutRight, typename Exec::memory_space>;
        Values values("values", 2, components * compiled.ngeom);
        gsp::copy_world_values(exec, sim.collision, field, values);
        auto const numbers = gsp_test::host(values);
        numbers(1, of_floor ? 0 : components * (compiled.ngeom - 1)) = wrong;
        Kokkos::deep_copy(values, numbers);
        gsp::set_world_values(exec, sim.collision, field, values);
        gsp::step(exec, model, state, sim, {.steps = 30});
        auto const q = gsp_test::host(state.qpos);
        auto const status = gsp_test::host(state.status);
        CHECK(status(0) == 0);
        CHECK(std::abs(q(0, 7 * bodies - 5) - 0.1f) < 1e-3f);
        CHECK(((status(1) & gsp::status::stopped) != 0) == stops);
        if (stops)
          CHECK(q(1, 7 * bodies - 5) == 0.1f);
        else
          CHECK(std::abs(q(1, 7 * bodies - 5) - 0.1f) < 1e-3f);
      }
}

// A limit whose range or margin is NaN was no limit, in silence.
TEST_CASE_TEMPLATE("limits that are no limits stop their world alone", Exec, GSP_TEST_EXECS) {
  for (auto const field : {gsp::ModelField::jnt_range, gsp::ModelField::jnt_margin}) {
    CAPTURE(int(field));
    gsp::Description d;
    gsp::BodyDescription body;
    gsp::GeomDescription ball;
    ball.size = {0.1, 0, 0};
    body.parent = 0, body.geoms = {ball};
    auto& joint = body.joints.emplace_back();
    joint.type = gsp::JointType::slide, joint.axis = {0, 0, 1}, joint.limited = true, joint.range = {-0.01, 1};
    d.bodies.push_back(body);
    Exec const exec;
    auto const compiled = gsp::compile(d);
    auto model = gsp::make_model<float>(exec, compiled);
    auto state = gsp::make_state(exec, model, {.worlds = 2});
    auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = 2});
    gsp::make_per_world(exec, model, {field}, 2);
    bool const range = field == gsp::ModelField::jnt_range;
    Kokkos::View<float**, Kokkos::LayoutRight, typename Exec::memory_space> values("values", 2, range ? 2 : 1);
    auto const numbers = Kokkos::create_mirror_view(values);
    for (int w = 0; w < 2 && range; ++w) numbers(w, 0) = -0.01f, numbers(w, 1) = 1;
    numbers(1, 0) = std::numeric_limits<float>::quiet_NaN();
    Kokkos::deep_copy(values, numbers);
    gsp::set_world_values(exec, model, field, values);
    gsp::step(exec, model, state, sim, {.steps = 200});
    auto const q = gsp_test::host(state.qpos);
    auto const status = gsp_test::host(state.status);
    CHECK(status(0) == 0);
    CHECK(std::abs(q(0, 0) + 0.01f) < 1e-2f);
    CHECK((status(1) & (field == gsp::ModelField::jnt_range ? gsp::status::not_finite : gsp::status::refused_law)) != 0);
    CHECK((status(1) & gsp::status::stopped) != 0);
    CHECK(q(1, 0) == 0);
  }
}
