// A simulation that is restored goes on as it would have, to the bit, wherever it is restored to.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/snapshot.hpp>
#include <gsp_test_execs.hpp>

#include "step/world.hpp"
#include "support/kokkos_tools.hpp"

namespace test_types {
/// Holds dof `dof` back, of a user's own.
struct Tether : gsp::OneFreeRow {
  int dof;
  KOKKOS_FUNCTION int count(int) const { return 1; }
  template <class T>
  KOKKOS_FUNCTION T lambda(int, int, int, T, T u) const {
    return -T(20) * u;
  }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int, int, Row&& J) const {
    J.set_dof(dof, 1.);
    return 0.;
  }
};
}  // namespace test_types

namespace {

using gsp_test::add_free;
using gsp_test::geom;

template <class R, class Exec>
struct World : gsp_test::World<R, Exec> {
  using Base = gsp_test::World<R, Exec>;
  using Base::compiled, Base::exec, Base::model, Base::sim, Base::state;
  explicit World(gsp::CompiledModel const& c, int worlds, bool sleep, gsp::Profile profile = gsp::Profile::stable)
      : Base(c, worlds, {.profile = profile}) {
    sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds, .sleep = sleep});
  }
  void set(decltype(state.qvel) const& view, int w, int i, double value) {
    auto const h = gsp_test::snapshot(view);
    h(w, i) = R(value);
    Kokkos::deep_copy(view, h);
  }
  auto saved() const { return gsp::make_snapshot(exec, state, sim); }
  void restore(gsp::Snapshot<R, typename Exec::memory_space> const& s) { gsp::restore(exec, s, state, sim); }
  int asleep(int w = 0) const { return gsp_test::host(sim.sleep.asleep)(w); }
  /// All that a world has come to, and what its rows carried.
  auto all(int w) const {
    std::vector<R> out;
    std::array const views{state.qpos, state.qpos_low, state.qvel, state.act, state.ctrl, state.qfrc_applied, sim.solution.qfrc_constraint};
    for (auto const& view : views) {
      auto const h = gsp_test::snapshot(view);
      for (int i = 0; i < int(h.extent(1)); ++i) out.push_back(h(w, i));
    }
    out.push_back(R(gsp_test::host(state.steps)(w)));
    out.push_back(R(gsp_test::host(state.status)(w)));
    if (sim.sleep.worlds > 0) out.push_back(R(asleep(w)));
    return out;
  }
  auto all() const {
    std::vector<std::vector<R>> out;
    for (int w = 0; w < state.worlds; ++w) out.push_back(all(w));
    return out;
  }
};

/// A robot with servos that falls among boxes and balls, a servo with an activation, a ball on a weld, and a body that the user moves.
gsp::CompiledModel everything() {
  auto d = gsp::samples::quadruped_scene({.boxes = 3, .balls = 2});
  d.keyframes.clear();
  d.actuators[0].dynamics = gsp::ActuatorDynamics::filter;
  d.actuators[0].dynprm[0] = 0.05;
  add_free(d, {0, 0, 2}, geom(gsp::ShapeType::sphere, {0.1, 0, 0}, 1));
  d.bodies.back().name = "hung";
  d.equalities.push_back({.type = gsp::EqualityType::weld, .name1 = "hung", .data = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1}});
  gsp::BodyDescription hand;
  hand.parent = 0;
  hand.name = "hand";
  hand.pos = {3, 0, 1};
  hand.mocap = true;
  hand.geoms.push_back(geom(gsp::ShapeType::box, {0.2, 0.2, 0.1}));
  d.bodies.push_back(hand);
  add_free(d, {3, 0, 1.21}, geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 1));
  return gsp::compile(d);
}
/// Worlds that differ, in everything that a user may give.
template <class W>
void start(W& w) {
  for (int i = 0; i < w.state.worlds; ++i) {
    w.set(w.state.qpos, i, 2, 0.6);                                                                      // dropped
    for (int k = 0; k < w.model.nv; ++k) w.set(w.state.qvel, i, k, 2 * std::sin(1. + 1.7 * k + 3 * i));  // what lies there tumbles
    for (int k = 0; k < 12; ++k) w.set(w.state.ctrl, i, k, 0.3 * std::cos(2. * k + i));
    w.set(w.state.qfrc_applied, i, 0, 5 + i);
  }
  auto const mocap = gsp_test::snapshot(w.state.mocap_pos);
  mocap(0, 0, 0) += 0.05;
  Kokkos::deep_copy(w.state.mocap_pos, mocap);
  auto const active = gsp_test::snapshot(w.state.eq_active);
  active(w.state.worlds - 1, 0) = 0;
  Kokkos::deep_copy(w.state.eq_active, active);
}

template <class Exec>
auto mask(std::vector<bool> const& worlds) {
  Kokkos::View<bool*, typename Exec::memory_space> const m("mask", worlds.size());
  auto const h = Kokkos::create_mirror_view(m);
  for (std::size_t w = 0; w < worlds.size(); ++w) h(w) = worlds[w];
  Kokkos::deep_copy(m, h);
  return m;
}

/// What follows a snapshot follows it again: in the same simulation, in one that is new, and in one that is new and whose pools are small.
template <class R, class Exec>
void replays(gsp::CompiledModel const& compiled, gsp::Profile profile, bool sleep) {
  CAPTURE(int(profile));
  CAPTURE(sleep);
  int const worlds = 3, before = 60, after = 60;
  World<R, Exec> w(compiled, worlds, sleep, profile);
  start(w);
  w.step(before);
  auto const snapshot = w.saved();
  auto const there = w.all();
  w.step(after);
  auto const once = w.all();
  CHECK(once != there);
  w.restore(snapshot);
  w.step(after);
  CHECK(w.all() == once);

  World<R, Exec> fresh(compiled, worlds, sleep, profile);
  auto& sim = fresh.sim;
  sim.rows = gsp::make_rows(fresh.exec, fresh.model, {.worlds = worlds, .rows_per_world = 1, .entries_per_world = 1});
  sim.impulses = gsp::make_impulses(fresh.exec, sim.rows);
  if (sim.newton.worlds > 0) sim.newton = gsp::make_newton(fresh.exec, sim.rows);
  fresh.restore(snapshot);
  fresh.step(after / 2);
  fresh.step(after - after / 2);
  CHECK(fresh.all() == once);

  World<R, Exec> without(compiled, worlds, sleep, profile);  // the state alone is not enough
  gsp::reset(without.exec, without.model, without.state, mask<Exec>({true, true, true}), snapshot.state);
  without.step(after);
  CHECK(without.all() != once);
}

}  // namespace

TEST_CASE_TEMPLATE("what follows a snapshot follows it again, to the bit", Exec, GSP_TEST_EXECS) {
  auto const compiled = everything();
  for (int k = 0; k < 4; ++k) {
    auto const profile = k < 2 ? gsp::Profile::stable : gsp::Profile::mujoco;
    replays<float, Exec>(compiled, profile, k % 2 == 1);
    replays<double, Exec>(compiled, profile, k % 2 == 1);
  }
}

namespace {
/// On a floor a tower of `height` boxes, and a ball of 0.5 kg, the last tree, at rest 3 m off. With a restitution all are rigid.
gsp::CompiledModel tower(int height, double restitution = 0) {
  gsp::Description d;
  d.option.timestep = 0.004;
  d.bodies[0].geoms.push_back(geom(gsp::ShapeType::plane, {0, 0, 1}));
  for (int i = 0; i < height; ++i) add_free(d, {0.01 * (i % 2), 0, 0.1 + 0.2 * i}, geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 1));
  auto ball = geom(gsp::ShapeType::sphere, {0.1, 0, 0}, 0.5);
  ball.condim = 6;
  add_free(d, {-3, 0, 0.1}, ball);
  for (auto& body : d.bodies)
    for (auto& g : body.geoms) g.hard = restitution > 0, g.restitution = restitution;
  return gsp::compile(d);
}
}  // namespace

// At each step of a fall among many things, and of a box that turns on another, whose points of contact are others again and again and
// start from those near them.
TEST_CASE_TEMPLATE("every step may be gone on from", Exec, GSP_TEST_EXECS) {
  for (int scene = 0; scene < 2; ++scene) {
    CAPTURE(scene);
    auto const compiled = scene == 0 ? everything() : tower(2);
    World<float, Exec> w(compiled, 2, true), shadow(compiled, 2, true);
    if (scene == 0)
      start(w);
    else
      for (int i = 0; i < 2; ++i) w.set(w.state.qvel, i, 11, 10 + i);
    auto snapshot = w.saved();
    for (int k = 0; k < 300; ++k) {
      gsp::save(w.exec, w.state, w.sim, snapshot);
      shadow.restore(snapshot);
      w.step(1), shadow.step(1);
      REQUIRE(shadow.all() == w.all());
    }
  }
}

// A tower that sleeps is restored asleep, with the impulses that it fell asleep with, and is woken by the ball as it was.
TEST_CASE_TEMPLATE("a snapshot with sleepers is gone on from, to the bit", Exec, GSP_TEST_EXECS) {
  std::array const restitutions{0.0, 0.6};
  for (double const restitution : restitutions) {
    CAPTURE(restitution);
    int const height = 3, ball = height;
    auto const compiled = tower(height, restitution);
    World<float, Exec> w(compiled, 1, true), fresh(compiled, 1, true);
    for (int i = 0; i < 3000 && w.asleep() < height + 1; ++i) w.step(1);
    REQUIRE(w.asleep() == height + 1);
    w.set(w.state.qvel, 0, 6 * ball, 3);
    w.step(60);
    REQUIRE(w.asleep() == height);
    auto const snapshot = w.saved();
    auto const there = w.all();
    w.step(400);
    auto const once = w.all();
    CHECK(once[0][0] != there[0][0]);  // the ball has met the tower
    w.restore(snapshot);
    CHECK(w.asleep() == height);
    w.step(400);
    CHECK(w.all() == once);
    fresh.restore(snapshot);
    CHECK(fresh.asleep() == height);
    fresh.step(1);
    CHECK(fresh.asleep() == height);
    fresh.step(399);
    CHECK(fresh.all() == once);
    World<float, Exec> awake(compiled, 1, false);
    CHECK_THROWS_WITH_AS(awake.restore(snapshot), doctest::Contains("make_simulation with {.sleep = true}"), std::invalid_argument);
  }
}

// Worlds of a mask go on as those of the snapshot did, the others as if nothing had been; one world may be given to all.
TEST_CASE_TEMPLATE("chosen worlds are restored, and the others do not notice", Exec, GSP_TEST_EXECS) {
  auto const compiled = everything();
  for (int sleep = 0; sleep < 2; ++sleep) {
    CAPTURE(sleep);
    World<float, Exec> w(compiled, 4, sleep == 1), alone(compiled, 1, sleep == 1);
    start(w), start(alone);
    w.step(60), alone.step(45);
    auto const snapshot = w.saved();
    auto const one = alone.saved();
    w.step(30), alone.step(30);
    auto const followed = w.all(), followed_one = alone.all();
    auto const later = w.saved();
    w.step(30);
    auto const others = w.all();
    CHECK(others[1] != followed[1]);

    w.restore(later);
    gsp::restore(w.exec, snapshot, w.state, w.sim, mask<Exec>({true, false, true, false}));
    auto const again = w.saved();  // of worlds from two moments
    w.step(30);
    for (int k = 0; k < 4; ++k) CHECK(w.all(k) == (k % 2 == 0 ? followed : others)[k]);
    World<float, Exec> fresh(compiled, 4, sleep == 1);
    gsp::restore(fresh.exec, again, fresh.state, fresh.sim, mask<Exec>({true, true, true, false}));
    auto const untouched = fresh.all(3);
    CHECK(untouched[0] == compiled.qpos0[0]);
    fresh.step(30);
    for (int k = 0; k < 3; ++k) CHECK(fresh.all(k) == (k % 2 == 0 ? followed : others)[k]);

    w.restore(later);
    gsp::restore(w.exec, one, w.state, w.sim, mask<Exec>({false, true, false, true}));
    w.step(30);
    for (int k = 0; k < 4; ++k) CHECK(w.all(k) == (k % 2 == 0 ? others[k] : followed_one[0]));
    w.restore(one);
    w.step(30);
    for (int k = 0; k < 4; ++k) CHECK(w.all(k) == followed_one[0]);
  }
}

// Those that are not chosen keep the impulses that their islands fell asleep with.
TEST_CASE_TEMPLATE("who sleeps in a world that is not chosen is not disturbed", Exec, GSP_TEST_EXECS) {
  int const height = 4, ball = height;
  World<double, Exec> w(tower(height), 2, true);
  auto const begin = w.saved();
  for (int i = 0; i < 3000 && w.asleep(1) < height + 1; ++i) w.step(1);
  REQUIRE(w.asleep(1) == height + 1);
  w.set(w.state.qvel, 1, 6 * ball, 3);
  w.step(20);
  auto const snapshot = w.saved();
  w.step(400);
  auto const once = w.all(1);
  w.restore(snapshot);
  gsp::restore(w.exec, begin, w.state, w.sim, mask<Exec>({true, false}));
  CHECK(w.asleep(0) == 0);
  CHECK(w.asleep(1) == height);
  w.step(400);
  CHECK(w.all(1) == once);
}

// Impulses are known by the place of their type in the list. With the snapshot's list what follows is the same to the bit, a user's type in
// it; where the last step had another list, chosen worlds start without impulses, as after a reset.
TEST_CASE_TEMPLATE("types of one's own, and lists that differ", Exec, GSP_TEST_EXECS) {
  auto const compiled = tower(2);
  using Tether = test_types::Tether;
  World<double, Exec> w(compiled, 2, false), reset(compiled, 2, false);
  w.set(w.state.qvel, 0, 0, 1), w.set(w.state.qvel, 1, 7, 1);
  auto const tied = [&](int steps) { gsp::step(w.exec, w.model, w.state, w.sim, {.steps = steps}, Tether{{}, 0}, Tether{{}, 6}); };
  tied(30);
  auto const snapshot = w.saved();
  tied(10);
  auto const once = w.all();
  w.restore(snapshot);
  tied(10);
  CHECK(w.all() == once);

  w.step(5);
  auto const free = w.saved();
  w.step(10);
  auto const other = w.all(1);
  w.restore(free);
  gsp::restore(w.exec, snapshot, w.state, w.sim, mask<Exec>({true, false}));
  w.step(10);
  CHECK(w.all(1) == other);
  gsp::reset(reset.exec, reset.model, reset.state, mask<Exec>({true, true}), snapshot.state);
  reset.step(10);
  auto const q = gsp_test::host(w.state.qpos), q0 = gsp_test::host(reset.state.qpos);
  for (int i = 0; i < w.model.nq; ++i) CHECK(q(0, i) == q0(0, i));
  w.restore(snapshot);  // without a mask the list is the snapshot's
  tied(10);
  CHECK(w.all() == once);
}

// A snapshot of a simulation without sleep leaves the worlds awake, whoever slept in them. They go on as if they never had, to the bit,
// as do those that may not sleep.
TEST_CASE_TEMPLATE("a snapshot without sleep wakes", Exec, GSP_TEST_EXECS) {
  auto const compiled = tower(2);
  World<double, Exec> w(compiled, 1, false), sleeper(compiled, 1, true), fresh(compiled, 1, true);
  for (int i = 0; i < 3000 && sleeper.asleep() < 3; ++i) sleeper.step(1);
  REQUIRE(sleeper.asleep() == 3);
  w.step(5);
  sleeper.restore(w.saved()), fresh.restore(w.saved());
  CHECK(sleeper.asleep() == 0);
  w.step(5), sleeper.step(5), fresh.step(5);
  CHECK(sleeper.all() == fresh.all());
  auto const q = gsp_test::host(w.state.qpos), q_sleeper = gsp_test::host(sleeper.state.qpos);
  for (int i = 0; i < w.model.nq; ++i) CHECK(q_sleeper(0, i) == q(0, i));
}

// What is saved into again neither allocates nor waits; a restore waits, since the pool of impulses may have to grow.
TEST_CASE_TEMPLATE("a snapshot is saved into again", Exec, GSP_TEST_EXECS) {
  World<float, Exec> w(everything(), 2, true);
  start(w);
  w.step(40);
  auto snapshot = w.saved();
  auto const kept = snapshot;  // another name for the same memory
  w.step(40);
  gsp_test::check_algorithm(w.exec, gsp_test::watch([&] { gsp::save(w.exec, w.state, w.sim, snapshot); }));
  w.step(20);
  auto const once = w.all();
  w.restore(kept);
  w.step(20);
  CHECK(w.all() == once);
  gsp_test::check_no_allocation(gsp_test::watch([&] { w.restore(snapshot); }));

  World<float, Exec> early(everything(), 2, true);  // the pools grow after the snapshot was made
  auto grows = early.saved();
  start(early);
  early.step(60);
  gsp::save(early.exec, early.state, early.sim, grows);
  early.step(20);
  auto const first = early.all();
  early.restore(grows);
  early.step(20);
  CHECK(early.all() == first);
}

TEST_CASE_TEMPLATE("a snapshot that does not fit is refused", Exec, GSP_TEST_EXECS) {
  auto const compiled = tower(2);
  World<double, Exec> w(compiled, 3, false), two(compiled, 2, false), other(tower(3), 3, false);
  auto const before = w.all();
  auto snapshot = w.saved();
  CHECK_THROWS_WITH_AS(w.restore(two.saved()),
                       doctest::Contains("gsp::restore: the snapshot has 2 worlds and the state 3: give one of as many worlds, or of one"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(
      w.restore(other.saved()),
      doctest::Contains("a world of the snapshot has 28 numbers in qpos and one of the state 21: the snapshot is of another model"),
      std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::save(other.exec, other.state, other.sim, snapshot), doctest::Contains("gsp::save: a world of the snapshot"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::save(two.exec, two.state, two.sim, snapshot), doctest::Contains("the snapshot has 3 worlds and the state 2"),
                       std::invalid_argument);
  World<double, Exec> one(compiled, 1, false), sleeps(compiled, 3, true);
  auto single = one.saved();
  CHECK_THROWS_WITH_AS(gsp::save(w.exec, w.state, w.sim, single), doctest::Contains("the numbers of worlds differ: snapshot 1, state 3"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::save(sleeps.exec, sleeps.state, sleeps.sim, snapshot),
                       doctest::Contains("one of snapshot and simulation has sleep"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::restore(w.exec, snapshot, w.state, w.sim, mask<Exec>({true, false})),
                       doctest::Contains("the mask has 2 worlds and the state 3"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::restore(w.exec, snapshot, w.state, two.sim),
                       doctest::Contains("the numbers of worlds differ: state 3, simulation 2"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::make_snapshot(w.exec, w.state, other.sim),
                       doctest::Contains("of different models: the one has 18 degrees of freedom, the other 24"), std::invalid_argument);
  CHECK(w.all() == before);
}

// Of steps that were launched the host knows only after settle whether they have fitted.
TEST_CASE_TEMPLATE("what is not settled is neither saved nor restored", Exec, GSP_TEST_EXECS) {
  World<double, Exec> w(tower(2), 1, false);
  w.step(3);
  auto snapshot = w.saved();
  gsp::launch_step(w.exec, w.model, w.state, w.sim);
  char const* const why = ": steps were launched, and whether they have fitted is not known yet: call settle(exec, sim) first";
  CHECK_THROWS_WITH_AS(w.saved(), doctest::Contains(("gsp::save" + std::string(why)).c_str()), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::save(w.exec, w.state, w.sim, snapshot), doctest::Contains(why), std::invalid_argument);
  CHECK_THROWS_WITH_AS(w.restore(snapshot), doctest::Contains(("gsp::restore" + std::string(why)).c_str()), std::invalid_argument);
  while (gsp::settle(w.exec, w.sim) > 0) gsp::launch_step(w.exec, w.model, w.state, w.sim);
  CHECK_NOTHROW(w.saved());
  CHECK_NOTHROW(w.restore(snapshot));
}

TEST_CASE_TEMPLATE("impulses are not to be read before the step that follows", Exec, GSP_TEST_EXECS) {
  World<double, Exec> w(tower(2), 1, false);
  w.step(20);
  using Contacts = gsp::ContactRows<double, typename Exec::memory_space>;
  CHECK_NOTHROW(gsp::impulses_of<Contacts>(w.sim.rows, w.sim.impulses));
  w.restore(w.saved());
  CHECK_THROWS_AS(gsp::impulses_of<Contacts>(w.sim.rows, w.sim.impulses), std::invalid_argument);
  w.step(1);
  CHECK_NOTHROW(gsp::impulses_of<Contacts>(w.sim.rows, w.sim.impulses));
}
