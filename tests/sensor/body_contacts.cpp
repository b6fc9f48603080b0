// Contacts of bodies as arrays: forces of a stack and of a box on a ramp in closed form, times of a ball that bounces.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/sensor/body_contacts.hpp>
#include <gsp/step/snapshot.hpp>
#include <gsp_test_execs.hpp>

#include "sensor/sensor_scene.hpp"
#include "support/kokkos_tools.hpp"

namespace test_types {
/// Which bodies have begun to touch, or to fly, within dt.
template <class Mem>
struct Begun {
  gsp::BodyContacts<double, Mem> of;
  double dt;
  Kokkos::View<bool** [2], Mem> begun;
  KOKKOS_FUNCTION void operator()(int w) const {
    for (int i = 0; i < int(begun.extent(1)); ++i) {
      begun(w, i, 0) = gsp::first_contact(of, w, i, dt);
      begun(w, i, 1) = gsp::first_air(of, w, i, dt);
    }
  }
};
}  // namespace test_types

namespace {
using gsp_test::away;
using gsp_test::SensedWorld;
constexpr double g = 9.81;
template <class S, class Of>
void sum(S& s, Of& of) {
  gsp::body_contacts(s.exec, s.model, s.sim.collision, s.sim.contacts, s.sim.rows, s.sim.impulses, of);
  s.exec.fence();
}
}  // namespace

// At rest as in tests/sensor/constraint_sensors.cpp: 1e-7 of the weights.
TEST_CASE_TEMPLATE("net forces, friction, partners and their centre: a stack, and a box on a ramp", Exec, GSP_TEST_EXECS) {
  for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    SensedWorld<Exec> s(
        R"(<mujoco><option timestep="0.002" tolerance="1e-14"/><worldbody><geom type="plane" size="2 2 1"/><body name="ramp" pos="5 0 1" euler="0 15 0"><geom type="box" size="1 1 .1" friction="1"/></body>
      <body name="low" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="2"/></body><body name="high" pos="0 0 .3"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/></body>
      <body name="slope" pos="5.0517638 0 1.1931852" euler="0 15 0"><freejoint/><geom type="box" size=".1 .1 .1" mass="3" friction="1"/></body><body name="air" pos="0 3 9"><freejoint/><geom size=".1"/></body></worldbody></mujoco>)",
        profile, 2);
    auto const id = [&](char const* name) { return gsp::body_id(s.compiled, name); };
    auto of = gsp::make_body_contacts(
        s.exec, s.model, {.worlds = 2, .bodies = {id("low"), id("high"), id("slope"), id("air")}, .partners = {0, id("high"), id("ramp")}});
    s.settle(600);
    gsp::forward(s.exec, s.model, s.state, s.sim, s.strict());
    gsp_test::check_algorithm(s.exec, gsp_test::watch([&] {
                                gsp::body_contacts(s.exec, s.model, s.sim.collision, s.sim.contacts, s.sim.rows, s.sim.impulses, of);
                                gsp::update_contact_times(s.exec, s.state, 0.01, of);
                              }));
    s.exec.fence();
    auto const force = gsp_test::host(of.force), friction = gsp_test::host(of.friction), position = gsp_test::host(of.position);
    auto const matrix = gsp_test::host(of.force_matrix);
    auto const found = gsp_test::host(of.found);
    auto const load = gsp_test::host(of.load);
    auto const at = [&](auto const& v, int i) { return std::vector<double>{v(1, i, 0), v(1, i, 1), v(1, i, 2)}; };
    auto const by = [&](int i, int p) { return std::vector<double>{matrix(1, i, p, 0), matrix(1, i, p, 1), matrix(1, i, p, 2)}; };
    // mujoco's soft friction lets the box creep: what it lacks of its weight is its acceleration, below 1e-6
    double const most = profile == gsp::Profile::stable ? 1e-6 : 1e-5;
    CHECK(away(at(force, 0), {0, 0, 2 * g}) < most);
    CHECK(away(by(0, 0), {0, 0, 3 * g}) < most);
    CHECK(away(by(0, 1), {0, 0, -g}) < most);
    CHECK(away(by(0, 2), {0, 0, 0}) == 0);
    CHECK(away(at(force, 1), {0, 0, g}) < most);
    CHECK(away(at(friction, 1), {0, 0, 0}) < most);
    if (profile == gsp::Profile::mujoco)
      CHECK(std::abs(load(1, 0) - 4 * g) < most);
    else  // rigid friction of several points may push them against each other
      CHECK(load(1, 0) > 4 * g - most);
    double const slope = 15 * M_PI / 180, along = 3 * g * std::sin(slope);  // friction up the ramp, which falls towards x
    CHECK(away(at(force, 2), {0, 0, 3 * g}) < most);
    CHECK(away(at(friction, 2), {-along * std::cos(slope), 0, along * std::sin(slope)}) < most);
    CHECK(away(by(2, 2), {0, 0, 3 * g}) < most);
    CHECK(found(1, 2) == 4);
    CHECK(found(1, 3) == 0);
    CHECK(away(at(force, 3), {0, 0, 0}) == 0);
    CHECK(away(at(position, 3), {0, 0, 0}) == 0);
    CHECK(std::abs(position(1, 1, 2) - 0.2) < 1e-2);
  }
}

// Times are sums of dt: no tolerance but the rounding of a hundred sums.
TEST_CASE_TEMPLATE("times of flight and of contact, of worlds that are reset and of those that stop", Exec, GSP_TEST_EXECS) {
  SensedWorld<Exec> s(
      R"(<mujoco><option timestep="0.01"/><worldbody><geom type="plane" size="2 2 1"/><body name="ball" pos="0 0 .6"><freejoint/><geom size=".1" mass="1" solref="-8000 -2"/></body></worldbody></mujoco>)",
      gsp::Profile::mujoco, 3);
  auto of = gsp::make_body_contacts(s.exec, s.model, {.worlds = 3, .history = 3});
  std::vector<double> pushed(3, 0);  // of world 1, the newest first
  auto all = [&] {
    gsp::step(s.exec, s.model, s.state, s.sim);
    sum(s, of);
    gsp::update_contact_times(s.exec, s.state, 0.01, of);
    s.exec.fence();
  };
  Kokkos::View<bool** [2], typename Exec::memory_space> const begun("begun", 3, 1);
  double air = 0, contact = 0, last_air = 0, last_contact = 0;
  int touches = 0;
  for (int i = 0; i < 200; ++i) {
    all();
    auto const load = gsp_test::host(of.load), a = gsp_test::host(of.air_time), c = gsp_test::host(of.contact_time),
               la = gsp_test::host(of.last_air_time), lc = gsp_test::host(of.last_contact_time);
    Kokkos::parallel_for("begun", Kokkos::RangePolicy<Exec>(s.exec, 0, 3), test_types::Begun<typename Exec::memory_space>{of, 0.01, begun});
    s.exec.fence();
    auto const starts = gsp_test::host(begun);
    if (load(1, 0) > 0) {
      if (contact == 0) {
        last_air = air, ++touches;
        CHECK(starts(1, 0, 0));
      } else {
        CHECK(!starts(1, 0, 0));
      }
      contact += 0.01, air = 0;
    } else {
      if (air == 0 && i > 0) last_contact = contact;
      air += 0.01, contact = 0;
      CHECK(starts(1, 0, 1) == (air < 0.015));
    }
    pushed.insert(pushed.begin(), gsp_test::host(of.force)(1, 0, 2));
    auto const history = gsp_test::host(of.force_history);
    for (int h = 0; h < 3; ++h) CHECK(history(1, h, 0, 2) == pushed[std::size_t(h)]);
    CHECK(std::abs(a(1, 0) - air) < 1e-12);
    CHECK(std::abs(c(1, 0) - contact) < 1e-12);
    CHECK(std::abs(la(1, 0) - last_air) < 1e-12);
    CHECK(std::abs(lc(1, 0) - last_contact) < 1e-12);
  }
  CHECK(touches >= 2);
  CHECK(last_air > 0.1);
  // what is saved goes on as it would have
  auto const snapshot = gsp::make_snapshot(s.exec, s.state, s.sim);
  auto kept = gsp::make_body_contacts(s.exec, s.model, {.worlds = 3, .history = 3});
  gsp::copy_body_contacts(s.exec, of, kept);
  for (int i = 0; i < 30; ++i) all();
  auto const air_then = gsp_test::host(of.air_time), contact_then = gsp_test::host(of.contact_time);
  auto const history_then = gsp_test::host(of.force_history);
  gsp::restore(s.exec, snapshot, s.state, s.sim);
  gsp::copy_body_contacts(s.exec, kept, of);
  for (int i = 0; i < 30; ++i) all();
  for (int w = 0; w < 3; ++w) {
    CHECK(gsp_test::host(of.air_time)(w, 0) == air_then(w, 0));
    CHECK(gsp_test::host(of.contact_time)(w, 0) == contact_then(w, 0));
    for (int h = 0; h < 3; ++h) CHECK(gsp_test::host(of.force_history)(w, h, 0, 2) == history_then(w, h, 0, 2));
  }
  auto other = gsp::make_body_contacts(s.exec, s.model, {.worlds = 3, .history = 2});
  CHECK_THROWS_WITH_AS(gsp::copy_body_contacts(s.exec, of, other), doctest::Contains("make both with the same options"),
                       std::invalid_argument);
  Kokkos::View<bool*, typename Exec::memory_space> mask("mask", 3);
  auto const wanted = Kokkos::create_mirror_view(mask);
  wanted(0) = wanted(1) = false, wanted(2) = true;
  Kokkos::deep_copy(mask, wanted);
  Kokkos::deep_copy(of.force_history, 7);
  gsp::reset_body_contacts(s.exec, of, mask);
  s.exec.fence();
  for (int h = 0; h < 3; ++h) {
    CHECK(gsp_test::host(of.force_history)(2, h, 0, 2) == 0);
    CHECK(gsp_test::host(of.force_history)(1, h, 0, 2) == 7);
  }
  auto const qpos = s.qpos();
  qpos(0, 2) = NAN;
  Kokkos::deep_copy(s.state.qpos, qpos);
  double const before = gsp_test::host(of.air_time)(0, 0) + gsp_test::host(of.contact_time)(0, 0);
  all();
  s.exec.fence();
  auto const a = gsp_test::host(of.air_time), c = gsp_test::host(of.contact_time), la = gsp_test::host(of.last_air_time);
  CHECK(a(0, 0) + c(0, 0) == before);
  CHECK(a(2, 0) + c(2, 0) == 0.01);
  CHECK(la(2, 0) == 0);
  CHECK(la(1, 0) > 0);
  CHECK_THROWS_WITH_AS(gsp::make_body_contacts(s.exec, s.model, {.bodies = {2}}), doctest::Contains("there is no body 2: the model has 2"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::make_body_contacts(s.exec, s.model, {.history = -1}), doctest::Contains("history must be"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::update_contact_times(s.exec, s.state, -1, of), doctest::Contains("dt must not be negative"),
                       std::invalid_argument);
  auto fewer = gsp::make_body_contacts(s.exec, s.model, {.worlds = 2});
  CHECK_THROWS_WITH_AS(sum(s, fewer), doctest::Contains("gsp::body_contacts"), std::invalid_argument);
}

TEST_CASE_TEMPLATE("a body without a geom, which nothing touches, is refused by its number", Exec, GSP_TEST_EXECS) {
  SensedWorld<Exec> s(
      R"(<mujoco><worldbody><body name="shank"><freejoint/><geom size=".1"/><body name="foot" pos="0 0 -.1"><site name="s"/></body></body></worldbody></mujoco>)",
      gsp::Profile::stable);
  CHECK_THROWS_WITH_AS(gsp::make_body_contacts(s.exec, s.model, {.bodies = {1, 2}}),
                       doctest::Contains("body 2 has no geom, so that nothing ever touches it: name the body"), std::invalid_argument);
  CHECK(gsp::make_body_contacts(s.exec, s.model).count() == 2);  // of all
}
