// Islands that rest sleep: what sleeps does not move in one bit, wakes when it is met or pushed, and goes on as if it had been awake.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/collision/geom_values.hpp>
#include <gsp/constraint/contact_forces.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>

#include "step/random_scene.hpp"
#include "step/world.hpp"
#include "support/kokkos_tools.hpp"

namespace {

using gsp_test::add_free;
using gsp_test::geom;

/// On a floor two towers of `height` boxes each, 2 m from each other, and a ball of 0.5 kg, the last tree, at rest 3 m off. More than 21
/// free bodies: islands are solved one by one.
gsp::Description towers(int height) {
  gsp::Description d;
  d.option.timestep = 0.004;
  d.bodies[0].geoms.push_back(geom(gsp::ShapeType::plane, {0, 0, 1}));
  for (double x : {0., 2.})
    for (int i = 0; i < height; ++i) add_free(d, {x, 0.01 * (i % 2), 0.1 + 0.2 * i}, geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 1));
  auto ball = geom(gsp::ShapeType::sphere, {0.1, 0, 0}, 0.5);
  ball.friction = {1, 0.005, 0.005};
  ball.condim = 6;
  add_free(d, {-3, 0, 0.1}, ball);
  return d;
}

template <class R, class Exec>
struct World : gsp_test::World<R, Exec> {
  using Base = gsp_test::World<R, Exec>;
  using Base::compiled, Base::exec, Base::model, Base::sim, Base::state;
  explicit World(gsp::Description const& d, int worlds = 1, bool sleep = true, gsp::ModelOptions options = {})
      : Base(gsp::compile(d), worlds, options) {
    sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds, .sleep = sleep});
  }
  int asleep(int w = 0) const { return gsp_test::host(sim.sleep.asleep)(w); }
  bool sleeps(int tree, int w = 0) const { return gsp_test::host(sim.sleep.state.calm)(w, tree) < 0; }
  int rows(int w = 0) const { return gsp_test::host(sim.rows.count)(w); }
  int kept(int w = 0) const { return gsp_test::host(sim.rows.kept)(w); }
  void set(decltype(state.qvel) const& view, int w, int i, double value) {
    auto const h = gsp_test::snapshot(view);
    h(w, i) = R(value);
    Kokkos::deep_copy(view, h);
  }
  /// Steps until so many trees sleep, at most so many steps; how many it took.
  int until(int trees, int most, int w = 0) {
    for (int i = 1; i <= most; ++i) {
      this->step(1);
      if (asleep(w) == trees) return i;
    }
    return most + 1;
  }
  auto all(int w) const {
    std::vector<R> out;
    std::array const views{state.qpos, state.qpos_low, state.qvel, state.act};  // nvcc takes no braces in a loop's head
    for (auto const& view : views) {
      auto const h = gsp_test::snapshot(view);
      for (int i = 0; i < int(h.extent(1)); ++i) out.push_back(h(w, i));
    }
    return out;
  }
};

}  // namespace

// Until something sleeps the motion is that of a simulation in which nothing may, to the bit; then no bit changes in 1,000 steps, and no
// row is solved for.
TEST_CASE_TEMPLATE("what sleeps stays where it is to the bit", Exec, GSP_TEST_EXECS) {
  for (int const height : {2, 11}) {
    CAPTURE(height);
    auto description = towers(height);
    description.bodies.back().geoms[0].condim = height == 2 ? 3 : 6;
    World<float, Exec> w(description), awake(description), never(description, 1, false);
    awake.sim.sleep.tolerance = 0;
    int const trees = 2 * height + 1;
    int before = 0;
    for (; w.asleep() == 0 && before < 2000; ++before) {
      auto const now = w.all(0);
      CHECK(now == awake.all(0));
      CHECK(now == never.all(0));
      w.step(1);
      awake.step(1);
      never.step(1);
    }
    REQUIRE(before < 2000);
    REQUIRE(w.until(trees, 2000) <= 2000);
    auto const lies = w.all(0);
    w.step(1);
    int const kept = w.kept();
    CHECK(w.rows() == 0);
    CHECK(kept >= 3 * trees);
    for (int i = 0; i < 10; ++i) {
      w.step(100);
      CHECK(w.all(0) == lies);
      CHECK(w.asleep() == trees);
      CHECK(w.kept() == kept);
    }
    CHECK(gsp_test::host(w.state.status)(0) == 0);
    gsp_test::check_algorithm(w.exec, gsp_test::watch([&] { gsp::launch_step(w.exec, w.model, w.state, w.sim); }));
  }
}

namespace {
/// Who lies beside the trees that are watched, behind them in the file. nothing_sleeps: sleep is off for all.
enum class Neighbours { may_sleep, never_sleep, pushed, nothing_sleeps, absent };

/// Numbers of the first trees, nq and nv of them.
template <class W>
auto first_trees(W const& w, int nq, int nv) {
  std::vector<double> out;
  auto const take = [&](auto const& view, int n) {
    auto const h = gsp_test::snapshot(view);
    for (int i = 0; i < n; ++i) out.push_back(std::isnan(double(h(0, i))) ? 1e300 : double(h(0, i)));
  };
  take(w.state.qpos, nq), take(w.state.qpos_low, nq), take(w.state.qvel, nv);
  return out;
}
/// `boxes` in stacks of two on a table of their own 40 m off, or the table alone.
void add_neighbours(gsp::Description& d, int boxes, Neighbours who) {
  auto table = geom(gsp::ShapeType::box, {3, 1, 0.1});
  table.pos = {42.5, 0, -0.1};
  d.bodies[0].geoms.push_back(table);
  for (int i = 0; i < boxes && who != Neighbours::absent; ++i) {
    add_free(d, {40 + 0.25 * (i - i % 2), 0.01 * (i % 2), 0.1 + 0.2 * (i % 2)}, geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 1));
    if (who == Neighbours::never_sleep) d.bodies.back().sleep = gsp::BodySleep::never;
  }
}
/// Steps worlds of `d` with each of several kinds of neighbours and compares the first trees of all, bit for bit. The neighbours of the
/// first kind sleep in the end, and those of the others do not, nor does the stack that is pushed.
template <class R, class Exec>
void compare_neighbours(gsp::Description d, int boxes, int steps, gsp::Profile profile, std::vector<Neighbours> const& kinds,
                        std::vector<double> const& qvel = {}) {
  for (std::size_t b = 1; b < d.bodies.size(); ++b)
    if (d.bodies[b].parent == 0 && !d.bodies[b].joints.empty()) d.bodies[b].sleep = gsp::BodySleep::never;
  int nq = 0, nv = 0;
  std::vector<World<R, Exec>> worlds;
  for (auto const who : kinds) {
    auto with = d;
    add_neighbours(with, boxes, who);
    auto& w = worlds.emplace_back(with, 1, who != Neighbours::nothing_sleeps, gsp::ModelOptions{.profile = profile});
    w.may_stop = true;  // some random scenes do
    nq = w.model.nq - (who == Neighbours::absent ? 0 : 7 * boxes), nv = w.model.nv - (who == Neighbours::absent ? 0 : 6 * boxes);
    for (std::size_t i = 0; i < qvel.size(); ++i) w.set(w.state.qvel, 0, int(i), qvel[i]);
    if (who == Neighbours::pushed) w.set(w.state.qfrc_applied, 0, nv, 1e-9);
  }
  for (int step = 0; step < steps; ++step) {
    for (auto& w : worlds) w.step(1);
    auto const expected = first_trees(worlds[0], nq, nv);
    for (std::size_t i = 1; i < worlds.size(); ++i) {
      CAPTURE(step);
      CAPTURE(int(kinds[i]));
      REQUIRE(first_trees(worlds[i], nq, nv) == expected);
    }
    if (gsp_test::host(worlds[0].state.status)(0) & gsp::status::stopped) return;
  }
  CHECK(worlds[0].asleep() == boxes);
  for (std::size_t i = 1; i < worlds.size(); ++i)
    if (kinds[i] != Neighbours::nothing_sleeps) CHECK(worlds[i].asleep() == (kinds[i] == Neighbours::pushed ? std::max(boxes - 2, 0) : 0));
}
/// Two stacks with much on little, one of them shoved and the other hit by a ball; many sweeps, and leaps.
gsp::Description restless() {
  gsp::Description d;
  d.option.timestep = 0.004;
  d.bodies[0].geoms.push_back(geom(gsp::ShapeType::plane, {0, 0, 1}));
  for (double x : {0., 1.})
    for (int i = 0; i < 2; ++i) add_free(d, {x, 0.02 * i, 0.1 + 0.2 * i}, geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, i == 0 ? 0.2 : 5));
  add_free(d, {2, 0, 0.15}, geom(gsp::ShapeType::sphere, {0.1, 0, 0}, 0.5));
  return d;
}
std::vector<double> const shoves = {1, 0.3, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.2, 0, 0, 0, 1, -6, 0.1, 0, 0, 5, 0};
}  // namespace

// The bits of a tree do not depend on who sleeps beside it, nor on whether anything may: not among 5 trees and 1, nor among
// 5 and 22.
TEST_CASE_TEMPLATE("neighbours that sleep, wake or are not there change no bit", Exec, GSP_TEST_EXECS) {
  using enum Neighbours;
  for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco})
    for (int const boxes : {1, 22})
      for (int const noslip : {0, 300}) {
        if (noslip > 0 && profile == gsp::Profile::stable) continue;
        CAPTURE(int(profile));
        CAPTURE(boxes);
        CAPTURE(noslip);
        auto d = restless();
        d.option.noslip_iterations = noslip;
        std::vector kinds{may_sleep, never_sleep, pushed, nothing_sleeps};
        if (noslip == 0) kinds.push_back(absent);  // noslip stops at a share of the mean inertia of all
        int const steps = boxes == 1 ? 150 : 400;
        compare_neighbours<float, Exec>(d, boxes, steps, profile, kinds, shoves);
        compare_neighbours<double, Exec>(d, boxes, steps, profile, kinds, shoves);
      }
}

// The same beside what files allow.
TEST_CASE_TEMPLATE("neighbours that sleep change no bit of any scene", Exec, GSP_TEST_EXECS) {
  using enum Neighbours;
  for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco})
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      CAPTURE(int(profile));
      CAPTURE(seed);
      auto d = gsp_test::random_scene(seed);
      if (d.option.integrator == gsp::Integrator::rk4) d.option.integrator = gsp::Integrator::implicitfast;
      if (seed % 2) d.option.noslip_iterations = 3;
      compare_neighbours<float, Exec>(d, 1, 200, profile, {may_sleep, never_sleep, nothing_sleeps});
      compare_neighbours<double, Exec>(d, 1, 200, profile, {may_sleep, never_sleep, nothing_sleeps});
    }
}

// Impacts, too, are found island by island: what bounces at the same time elsewhere changes no bit.
TEST_CASE_TEMPLATE("what bounces beside a tree changes no bit of it", Exec, GSP_TEST_EXECS) {
  auto const scene = [](bool both) {
    gsp::Description d;
    d.option.timestep = 0.004;
    d.bodies[0].geoms.push_back(geom(gsp::ShapeType::plane, {0, 0, 1}));
    add_free(d, {0, 0, 0.6}, geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 1));
    add_free(d, {0.01, 0.02, 0.85}, geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 3));
    if (both) {  // two that land at the same time, and whose corners take another number of sweeps
      add_free(d, {3, 0, 0.52}, geom(gsp::ShapeType::box, {0.3, 0.2, 0.02}, 1));
      add_free(d, {6, 0, 1}, geom(gsp::ShapeType::box, {0.05, 0.05, 0.5}, 1));
    }
    for (auto& body : d.bodies)
      for (auto& g : body.geoms) g.hard = true, g.restitution = 0.6;
    return d;
  };
  World<double, Exec> alone(scene(false)), beside(scene(true));
  alone.sim.sleep.tolerance = beside.sim.sleep.tolerance = 0;
  for (int step = 0; step < 300; ++step) {
    CAPTURE(step);
    alone.step(1), beside.step(1);
    REQUIRE(first_trees(alone, 14, 12) == first_trees(beside, 14, 12));
  }
}

// What `collide` takes over from its last call is what the narrow phase finds, bit for bit, and what kept impulses say is what the heap
// weighs: the floor carries m g of everything. Tolerance: the sweeps stop at 1e-4 of what gravity does in a step, a contact each.
TEST_CASE_TEMPLATE("contacts and forces of what sleeps stay to be read", Exec, GSP_TEST_EXECS) {
  World<double, Exec> w(towers(4));
  REQUIRE(w.until(9, 3000) <= 3000);
  w.step(50);
  auto const& kept = w.sim.contacts;
  auto fresh = gsp::make_contacts(w.exec, w.sim.collision, {.worlds = 1, .points_per_box_pair = 4});
  for (bool again = true; again; again = gsp::grow(w.exec, fresh)) gsp::collide(w.exec, w.sim.collision, w.sim.poses, fresh);
  int const n = gsp_test::host(kept.end)(0);
  REQUIRE(n == gsp_test::host(fresh.end)(0));
  REQUIRE(n >= 9);
  auto const same = [&](auto const& a, auto const& b, int size) {
    auto const x = gsp_test::host(a), y = gsp_test::host(b);
    for (int i = 0; i < n * size; ++i) CHECK(x.data()[i] == y.data()[i]);
  };
  same(kept.pair, fresh.pair, 1), same(kept.feature, fresh.feature, 1), same(kept.dist, fresh.dist, 1);
  same(kept.pos, fresh.pos, 3), same(kept.frame, fresh.frame, 9);

  auto const marked = gsp_test::snapshot(kept.dist);
  marked(0) -= 1e-9;
  Kokkos::deep_copy(kept.dist, marked);
  w.step(3);
  CHECK(gsp_test::host(kept.dist)(0) == marked(0));  // it was taken over, not found

  Kokkos::View<double* [6], Kokkos::LayoutRight, typename Exec::memory_space> force("force", kept.dist.extent(0));
  gsp::contact_forces(w.exec, w.model, w.sim.collision, kept, w.sim.rows, w.sim.impulses, force);
  auto const f = gsp_test::host(force);
  auto const body1 = gsp_test::host(kept.body1);
  double carried = 0;
  for (int c = 0; c < n; ++c) carried += body1(c) == 0 ? f(c, 0) : 0;
  CHECK(std::abs(carried - 8.5 * 9.81) < 1e-3 * 8.5 * 9.81);
}

// A ball of 0.5 kg rolls into one of two towers that sleep: that one wakes in the step in which the two touch, whole, and the other stays.
// The blow itself is what it is without sleep. Tolerance: what sleeps has been moving by up to 1e-3 m/s (sleep_tolerance), and so do they
// part.
TEST_CASE_TEMPLATE("a ball wakes the island that it meets, and no other", Exec, GSP_TEST_EXECS) {
  int const height = 4, trees = 2 * height + 1, ball = trees - 1;
  World<double, Exec> w(towers(height)), never(towers(height), 1, false);
  int const settles = w.until(trees, 3000);
  REQUIRE(settles <= 3000);
  auto const lies = w.all(0);
  never.step(settles);
  for (auto* world : {&w, &never}) {
    world->set(world->state.qvel, 0, 6 * ball, 3);       // [m/s] along x
    world->set(world->state.qvel, 0, 6 * ball + 4, 30);  // rolls
  }
  int step = 0;
  for (; step < 1000 && w.sleeps(0); ++step) {
    CHECK(w.asleep() == (step == 0 ? trees : trees - 1));
    w.step(1);
    never.step(1);
  }
  REQUIRE(step < 1000);
  double const x = gsp_test::host(w.state.qpos)(0, 7 * ball);
  CHECK(std::abs(x + 0.2) < 3 * 0.004 * 1.5);  // where they touch, to a step or so
  for (int more = 0; more < 3; ++more) {
    auto const v = gsp_test::host(w.state.qvel), u = gsp_test::host(never.state.qvel);
    double apart = 0;
    for (int t : {0, 1, 2, 3, ball})
      for (int k = 6 * t; k < 6 * t + 6; ++k) apart = std::fmax(apart, std::abs(v(0, k) - u(0, k)));
    CHECK(apart < 1e-2);
    w.step(1);
    never.step(1);
  }
  for (int t = 0; t < height; ++t) CHECK(!w.sleeps(t));
  for (int t = height; t < 2 * height; ++t) CHECK(w.sleeps(t));
  w.step(100);
  auto const after = w.all(0);
  for (int i = 7 * height; i < 7 * 2 * height; ++i) CHECK(after[i] == lies[i]);
}

// An island that is woken goes on from the impulses that it fell asleep with, so that nothing moves it but what moved it before: it stays
// about as slow as it was, below sleep_tolerance (twice that is left to the first steps). Where its impulses are lost, its contacts yield
// to what they carry as if they carried nothing, and a tower of four jumps.
TEST_CASE_TEMPLATE("an island that is woken does not jump", Exec, GSP_TEST_EXECS) {
  int const height = 4, trees = 2 * height + 1;
  double const tolerance = 1e-4;
  for (bool const forgets : {false, true}) {
    World<double, Exec> w(towers(height));
    w.sim.sleep.tolerance = tolerance;
    REQUIRE(w.until(trees, 5000) <= 5000);
    w.step(500);
    w.set(w.state.qvel, 0, 0, 1e-9);  // wakes it
    if (forgets)
      for (int side : {0, 1}) Kokkos::deep_copy(w.sim.impulses.p[side], 0.);
    auto const length = gsp_test::host(w.sim.sleep.dof_length);
    double most = 0;
    for (int i = 0; i < 20; ++i) {
      w.step(1);
      if (i == 0) CHECK(w.asleep() == trees - height);
      auto const v = gsp_test::host(w.state.qvel);
      for (int k = 0; k < 6 * height; ++k) most = std::fmax(most, length(k) * std::abs(v(0, k)));
    }
    CAPTURE(most);
    CHECK(forgets == (most > 5 * tolerance));
    CHECK(forgets != (most < 2 * tolerance));
  }
}

namespace {
/// A box on the floor, a box on a table that is a mocap body, a box welded to the world at 1 m, a box on a slide with a motor, all apart.
gsp::Description zoo() {
  gsp::Description d = towers(0);
  d.bodies.pop_back();
  auto const box = geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 1);
  add_free(d, {0, 0, 0.1}, box);
  gsp::BodyDescription table;
  table.parent = 0;
  table.name = "table";
  table.pos = {2, 0, 0.5};
  table.mocap = true;
  table.geoms.push_back(geom(gsp::ShapeType::box, {0.3, 0.3, 0.1}));
  d.bodies.push_back(table);
  add_free(d, {2, 0, 0.7}, box);
  add_free(d, {4, 0, 1}, box);
  d.bodies.back().name = "hung";
  d.equalities.push_back({.type = gsp::EqualityType::weld, .name1 = "hung", .data = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1}});
  add_free(d, {6, 0, 0.1}, box);
  d.bodies.back().joints[0] = {.name = "slide", .type = gsp::JointType::slide, .axis = {1, 0, 0}, .damping = 1};
  d.bodies.back().sleep = gsp::BodySleep::allowed;
  d.actuators.push_back({.name = "motor", .target_name = "slide"});
  return d;
}
struct Tether : gsp::OneFreeRow {  // of a user: it may change at any time
  KOKKOS_FUNCTION int count(int) const { return 1; }
  template <class T>
  KOKKOS_FUNCTION T lambda(int, int, int, T x, T u) const {
    return -(x + u);
  }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int, int, Row&& J) const {
    J.set_dof(0, 1.);
    return 0.;
  }
};
struct RestingTether : Tether {
  static constexpr bool rests = true;
};
}  // namespace

// Trees: 0 on the floor, 1 on the table, 2 hung, 3 with a motor.
TEST_CASE_TEMPLATE("who sleeps, and what wakes whom", Exec, GSP_TEST_EXECS) {
  World<double, Exec> w(zoo());
  w.step(400);
  CHECK(w.sleeps(0));
  CHECK(!w.sleeps(1));  // the user may move the table at any time
  CHECK(w.sleeps(2));
  CHECK(w.sleeps(3));
  auto const only = [&](std::initializer_list<int> awake) {
    for (int t : {0, 2, 3}) {
      CAPTURE(t);
      CHECK(w.sleeps(t) == (std::find(awake.begin(), awake.end(), t) == awake.end()));
    }
  };
  SUBCASE("nothing") {
    w.step(1);
    only({});
  }
  SUBCASE("a force") {
    w.set(w.state.qfrc_applied, 0, 2, -1);
    w.step(1);
    only({0});
    w.step(100);
    only({0});  // as long as it acts
    w.set(w.state.qfrc_applied, 0, 2, 0);
    w.step(100);
    only({});
  }
  SUBCASE("a velocity") {
    w.set(w.state.qvel, 0, 12, 1e-5);
    w.step(1);
    only({2});
  }
  SUBCASE("a position") {
    w.set(w.state.qpos, 0, 0, 0.01);
    w.step(1);
    only({0});
  }
  SUBCASE("a control") {
    w.set(w.state.ctrl, 0, 0, 2);
    w.step(1);
    only({3});
    CHECK(gsp_test::host(w.state.qvel)(0, 18) > 0);
  }
  SUBCASE("gravity") {
    auto other = w.compiled;
    other.option.gravity = {0, 0, -9};
    w.model = gsp::make_model<double>(w.exec, other);
    w.step(1);
    only({0, 2});  // the slide does not feel it
  }
  SUBCASE("a weld that lets go") {
    auto const h = gsp_test::snapshot(w.state.eq_active);
    h(0, 0) = 0;
    Kokkos::deep_copy(w.state.eq_active, h);
    w.step(1);
    only({0, 2, 3});  // all of the world, which is on the safe side
    w.step(200);
    CHECK(std::abs(gsp_test::host(w.state.qpos)(0, 16) - 0.1) < 0.01);
  }
  SUBCASE("a reset") {
    gsp::reset(w.exec, w.model, w.state);
    w.step(1);
    only({0, 2, 3});
  }
  SUBCASE("a body that comes down on it") {
    w.set(w.state.qpos, 0, 7, 0);  // the box of the table, 1 m above the first
    w.set(w.state.qpos, 0, 9, 1.3);
    w.step(80);
    only({});
    w.step(60);  // sqrt(2 (1) / g) = 0.45 s after its start it is there: 113 steps
    only({0});
  }
  SUBCASE("a constraint of one's own") {
    for (int i = 0; i < 30; ++i) gsp::step(w.exec, w.model, w.state, w.sim, {.steps = 1}, Tether{});
    only({0});
    for (int i = 0; i < 30; ++i) gsp::step(w.exec, w.model, w.state, w.sim, {.steps = 1}, RestingTether{});
    only({});
  }
  SUBCASE("nobody may") {
    auto never = zoo();
    for (auto& body : never.bodies)
      if (!body.joints.empty()) body.sleep = gsp::BodySleep::never;
    World<double, Exec> awake(never);
    awake.step(400);
    CHECK(awake.asleep() == 0);
    auto automatic = zoo();
    automatic.bodies.back().sleep = gsp::BodySleep::automatic;
    World<double, Exec> two(automatic);
    two.step(400);
    CHECK(two.asleep() == 2);
    CHECK(!two.sleeps(3));  // an actuator moves it
  }
}

// Worlds of a batch give the bits that each gives alone, whether its neighbours sleep or not, and whatever the pools hold at first.
TEST_CASE_TEMPLATE("worlds that sleep do not touch their neighbours", Exec, GSP_TEST_EXECS) {
  for (int const height : {2, 11}) {
    int const worlds = 3, ball = 2 * height;
    auto const start = [&](auto& w, int first) {
      for (int i = 0; i < w.state.worlds; ++i)
        if (first + i > 0) w.set(w.state.qvel, i, 6 * ball, 1.5 * (first + i));
    };
    World<float, Exec> all(towers(height), worlds);
    start(all, 0);
    std::vector<World<float, Exec>> each;
    for (int i = 0; i < worlds; ++i) start(each.emplace_back(towers(height)), i);
    World<float, Exec> narrow(towers(height), worlds);
    auto small = gsp::contacts_options(narrow.model, worlds);
    small.candidates_per_world = small.points_per_world = small.contacts_per_world = 1;
    narrow.sim.contacts = gsp::make_contacts(narrow.exec, narrow.sim.collision, small);
    narrow.sim.rows = gsp::make_rows(narrow.exec, narrow.model, {.worlds = worlds, .rows_per_world = 1, .entries_per_world = 1});
    narrow.sim.impulses = gsp::make_impulses(narrow.exec, narrow.sim.rows);
    start(narrow, 0);
    bool slept = false, differed = false;
    for (int k = 0; k < 16; ++k) {
      all.step(40);
      narrow.step(40);
      for (int i = 0; i < worlds; ++i) {
        each[i].step(40);
        CHECK(all.all(i) == each[i].all(0));
        CHECK(all.all(i) == narrow.all(i));
        CHECK(all.asleep(i) == each[i].asleep());
      }
      slept = slept || all.asleep(0) > 0;
      differed = differed || all.asleep(0) != all.asleep(2);
    }
    CHECK(slept);
    CHECK(differed);
  }
}

// Profile mujoco sleeps as well, but not with RK4.
TEST_CASE_TEMPLATE("profile mujoco sleeps, but for RK4", Exec, GSP_TEST_EXECS) {
  World<double, Exec> w(towers(2), 1, true, {.profile = gsp::Profile::mujoco});
  REQUIRE(w.until(5, 2000) <= 2000);
  auto const lies = w.all(0);
  w.step(200);
  CHECK(w.all(0) == lies);
  CHECK(w.rows() == 0);
  auto d = towers(2);
  d.option.integrator = gsp::Integrator::rk4;
  CHECK_THROWS_WITH_AS((World<double, Exec>(d, 1, true, {.profile = gsp::Profile::mujoco})), doctest::Contains("RK4"), gsp::Error);
}

namespace {
/// A body on a slide along x, with a ball that touches nothing.
void add_slide(gsp::Description& d, std::string const& name, double y, int parent = 0) {
  gsp::BodyDescription b;
  b.parent = parent;
  b.name = name;
  b.pos = {0, y, 0};
  b.joints.push_back({.name = name, .type = gsp::JointType::slide, .axis = {1, 0, 0}, .damping = 1});
  b.geoms.push_back(geom(gsp::ShapeType::sphere, {0.1, 0, 0}, 1));
  b.sites.emplace_back().name = name;
  d.bodies.push_back(b);
}
}  // namespace

// What a tendon couples is one tree of the model: it may sleep as the first that may least, and the trees after it as their own bodies say.
TEST_CASE_TEMPLATE("coupled trees sleep by the rules of all of them", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  for (char const* name : {"a", "b", "c", "d"}) add_slide(d, name, double(name[0]));
  d.tendons.push_back({.name = "pair", .terms = {{.joint = "a"}, {.joint = "b"}}});
  d.actuators.push_back({.name = "motor", .target_name = "c"});
  auto const sleepers = [](gsp::Description const& of) {
    World<double, Exec> w(of);
    w.step(20);
    std::vector<bool> sleep;
    for (int t = 0; t < w.model.ntree; ++t) sleep.push_back(w.sleeps(t));
    return sleep;
  };
  CHECK(sleepers(d) == std::vector{true, false, true});  // a with b, c, d
  SUBCASE("an actuator on the tendon moves both") {
    d.actuators.push_back({.name = "pull", .target = gsp::Transmission::tendon, .target_name = "pair"});
    CHECK(sleepers(d) == std::vector{false, false, true});
    for (int b : {1, 2, 3}) d.bodies[b].sleep = gsp::BodySleep::allowed;
    CHECK(sleepers(d) == std::vector{true, true, true});
    World<double, Exec> w(d);
    w.step(20);
    w.set(w.state.ctrl, 0, 1, 1);
    w.step(1);
    CHECK(!w.sleeps(0));
  }
  SUBCASE("one of two never sleeps") {
    d.bodies[2].sleep = gsp::BodySleep::never;
    CHECK(sleepers(d) == std::vector{false, false, true});
  }
}

// A magnet that no tree moves pulls through rows alone. It holds a box of 1 kg with 20 N; when it is switched off, the box falls from rest:
// after n steps of h by g h^2 n (n + 1) / 2, to the softness of the contact that lets go, 1e-3 m.
TEST_CASE_TEMPLATE("a fixed magnet that is switched off lets go of what sleeps", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  d.option.timestep = 0.004;
  gsp::BodyDescription magnet;
  magnet.parent = 0;
  magnet.name = "magnet";
  magnet.pos = {0, 0, 1};
  magnet.geoms.push_back(geom(gsp::ShapeType::box, {0.2, 0.2, 0.1}));
  d.bodies.push_back(magnet);
  add_free(d, {0, 0, 0.8}, geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 1));
  d.actuators.push_back({.name = "hold",
                         .target = gsp::Transmission::body,
                         .target_name = "magnet",
                         .gainprm = {20},
                         .ctrl_limited = true,
                         .ctrl_range = {0, 1}});
  World<double, Exec> w(d);
  w.set(w.state.ctrl, 0, 0, 1);
  REQUIRE(w.until(1, 500) <= 500);
  w.step(100);
  double const z = gsp_test::host(w.state.qpos)(0, 2);
  CHECK(w.sleeps(0));
  CHECK(std::abs(z - 0.8) < 1e-3);
  w.set(w.state.ctrl, 0, 0, 0);
  w.step(50);
  CHECK(std::abs(z - gsp_test::host(w.state.qpos)(0, 2) - 9.81 * 0.004 * 0.004 * 50 * 51 / 2) < 1e-3);
}

// What hangs on a mocap body, or on a tendon with a site there, moves with it though no number of its own changes and no row names it.
TEST_CASE_TEMPLATE("a mocap body that moves wakes what hangs on it", Exec, GSP_TEST_EXECS) {
  gsp::Description d;
  d.option.gravity = {0, 0, 0};
  gsp::BodyDescription mocap;
  mocap.parent = 0;
  mocap.name = "hand";
  mocap.mocap = true;
  mocap.sites.emplace_back().name = "hand";
  d.bodies.push_back(mocap);
  auto const move = [](auto& w, double x) {
    auto const h = gsp_test::snapshot(w.state.mocap_pos);
    h(0, 0, 0) = x;
    Kokkos::deep_copy(w.state.mocap_pos, h);
  };
  SUBCASE("a child, and what lies on it") {  // a table on a slide of the mocap body, a box on it
    d.option.gravity = {0, 0, -9.81};
    add_slide(d, "table", 0, 1);
    d.bodies.back().geoms[0] = geom(gsp::ShapeType::box, {0.3, 0.3, 0.1}, 5);
    add_free(d, {0, 0, 0.2}, geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 1));
    add_slide(d, "apart", 3);
    World<double, Exec> w(d);
    REQUIRE(w.until(3, 1000) <= 1000);
    w.step(5);
    REQUIRE(w.sleeps(0));
    REQUIRE(w.sleeps(1));
    move(w, 5.);
    w.step(50);
    CHECK(!w.sleeps(1));
    CHECK(w.sleeps(2));
    double const z = gsp_test::host(w.state.qpos)(0, 3);  // from rest, in 50 steps of h
    double const h = d.option.timestep;
    CHECK(std::abs(0.2 - z - 9.81 * h * h * 50 * 51 / 2) < 1e-3);
  }
  SUBCASE("a tendon that grows taut") {  // at most 2 m from (0, 1, 0) to the hand
    add_slide(d, "load", 1);
    d.tendons.push_back({.name = "rope", .path = {{.name = "hand"}, {.name = "load"}}, .limited = true, .range = {0, 2}});
    World<double, Exec> w(d);
    REQUIRE(w.until(1, 100) <= 100);
    move(w, 3.);
    w.step(500);
    double const x = gsp_test::host(w.state.qpos)(0, 0);
    CHECK(std::hypot(3 - x, 1.) < 2.01);  // a limit of MJCF's defaults is soft
  }
}

// A world that was reset counts its steps of rest from none, like one that is new.
TEST_CASE_TEMPLATE("a world that is reset falls asleep when a new one does", Exec, GSP_TEST_EXECS) {
  auto d = towers(0);
  d.bodies.pop_back();
  add_slide(d, "at rest", 0);
  World<double, Exec> fresh(d);
  int const steps = fresh.until(1, 100);
  CHECK(steps == 10);
  for (int before : {9, 10, 15}) {
    CAPTURE(before);
    World<double, Exec> w(d);
    w.step(before);
    gsp::reset(w.exec, w.model, w.state);
    CHECK(w.until(1, 100) == steps);
  }
}

// A box on a slope that friction holds. Nothing feels that its friction is less, so it sleeps on, until its world is woken; then it slides
// with a = g_x - mu g_z. The world beside it does not notice. Tolerance: n h a to the overlap that the contact gives back, 1e-3 m/s.
TEST_CASE_TEMPLATE("a world whose values were changed is woken by hand", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  gsp::Description d;
  d.option.timestep = 0.004;
  d.option.gravity = {1, 0, -10};
  d.bodies[0].geoms.push_back(geom(gsp::ShapeType::plane, {0, 0, 1}));
  add_free(d, {0, 0, 0.1}, geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 1));
  World<double, Exec> w(d, 2);
  REQUIRE(w.until(1, 500, 1) <= 500);
  REQUIRE(w.asleep(0) == 1);
  gsp::make_per_world(w.exec, w.sim.collision, {gsp::GeomField::friction}, 2);
  Kokkos::View<double***, Kokkos::LayoutRight, Mem> const friction("friction", 2, 2, 3);
  Kokkos::deep_copy(friction, 0.02);
  gsp::set_world_values(w.exec, w.sim.collision, gsp::GeomField::friction, friction);
  auto const lies = w.all(0);
  w.step(20);
  CHECK(w.asleep(1) == 1);  // it cannot know
  Kokkos::View<bool*, Mem> const mask("mask", 2);
  auto const second = gsp_test::snapshot(mask);
  second(1) = true;
  Kokkos::deep_copy(mask, second);
  gsp_test::check_algorithm(w.exec, gsp_test::watch([&] { gsp::wake(w.exec, w.sim.sleep, mask); }));
  CHECK(w.asleep(0) == 1);
  CHECK(w.asleep(1) == 0);
  w.step(50);
  CHECK(w.asleep(0) == 1);
  CHECK(w.all(0) == lies);
  double const v = gsp_test::host(w.state.qvel)(1, 0);
  CHECK(std::abs(v - (1 - 0.02 * 10) * 50 * 0.004) < 1e-3);
  gsp::wake(w.exec, w.sim.sleep);
  w.step(1);
  CHECK(!w.sleeps(0, 0));
  CHECK(gsp_test::host(w.state.qvel)(0, 0) > 0);
  Kokkos::View<bool*, Mem> const three("mask", 3);
  CHECK_THROWS_WITH_AS(gsp::wake(w.exec, w.sim.sleep, three), doctest::Contains("the mask has 3 worlds"), std::invalid_argument);
}

// A loop of one's own that leaves a stage out is told, where it would have put what sleeps anywhere.
TEST_CASE_TEMPLATE("sleep in a loop of one's own asks for its stages", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  World<float, Exec> w(towers(2));
  auto& s = w.sim;
  auto const stages = [&](bool wakes, bool tells, bool integrates) {
    gsp::smooth_dynamics(w.exec, w.model, w.state, s.poses, s.dynamics);
    if (wakes) gsp::wake_changed(w.exec, w.model, w.state, s.dynamics, s.sleep);
    gsp::collide(w.exec, s.collision, s.poses, s.contacts);
    auto const types = gsp::model_constraints(w.model, w.state, s.poses, s.dynamics, s.collision, s.contacts);
    gsp::assemble(w.exec, w.model, w.state, s.dynamics, types, s.rows, s.impulses, s.progress,
                  tells ? s.sleep.islands : gsp::SleepingIslands<Mem>{});
    gsp::impacts(w.exec, s.progress, s.rows, s.impulses, s.solution);
    gsp::pgs(w.exec, s.rows, s.impulses, s.solution, s.progress);
    if (integrates) gsp::integrate(w.exec, w.model, w.state, s.dynamics, s.progress, s.solution);
    gsp::fall_asleep(w.exec, w.model, s.rows, s.progress, w.state, s.dynamics, s.solution.qfrc_constraint, s.sleep);
  };
  CHECK_THROWS_WITH_AS(stages(false, true, true), doctest::Contains("call wake_changed after smooth_dynamics"), std::invalid_argument);
  stages(true, true, true);
  CHECK_THROWS_WITH_AS(stages(false, true, true), doctest::Contains("another moment than that of the rows"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(stages(true, false, true), doctest::Contains("give it sleep.islands"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(stages(true, true, false), doctest::Contains("call integrate first"), std::invalid_argument);
}
