// Sleep beside MuJoCo 4.0.1: which trees may, how long a radian is, and on one scene in profile mujoco who falls asleep and wakes when.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>

#include "oracle/load.hpp"
#include "support/data.hpp"
#include "support/skip.hpp"

namespace {
using Exec = Kokkos::DefaultHostExecutionSpace;

void compare_rules(gsp::CompiledModel const& g, mjModel const* m) {
  auto const length = gsp::detail::dof_lengths<double>(g);
  auto const policy = gsp::detail::file_policies(g);
  REQUIRE(g.nv == m->nv);
  REQUIRE(g.ntree == m->ntree);
  for (int i = 0; i < g.nv; ++i) CHECK(std::abs(length[i] - m->dof_length[i]) < 1e-6 * m->dof_length[i]);  // meshes are in float
  for (int t = 0; t < g.ntree; ++t)
    CHECK((policy[t] == gsp::SleepPolicy::never) ==
          (m->tree_sleep_policy[t] == mjSLEEP_NEVER || m->tree_sleep_policy[t] == mjSLEEP_AUTO_NEVER));
}

}  // namespace

TEST_CASE("what a file says of sleep, and its defaults") {
  mjOption standard;
  mj_defaultOption(&standard);
  CHECK(gsp::OptionDescription{}.sleep_tolerance == standard.sleep_tolerance);
  CHECK(!gsp::OptionDescription{}.sleep);
  std::string const text = R"(<mujoco><option sleep_tolerance=".02"><flag sleep="enable"/></option><worldbody>
    <body pos="0 0 1"><freejoint/><geom type="box" size=".1 .2 .3" pos=".1 0 0"/><geom size=".2"/>
      <body pos="0 0 .4"><joint name="j" pos=".05 0 0"/><geom type="capsule" size=".05 .2"/></body></body>
    <body sleep="never"><joint type="ball" pos="0 .3 0"/><geom size=".1"/></body>
    <body sleep="allowed"><joint name="k" type="slide"/><geom size=".1"/></body>
    <body><joint name="l" type="slide"/><geom size=".1"/></body>
    </worldbody><actuator><motor joint="k"/><motor joint="l"/></actuator></mujoco>)";
  auto const oracle = gsp_test::load_oracle("model.xml", text);
  auto const d = gsp::io::parse_mjcf(text, "model.xml");
  auto const again = gsp::io::parse_mjcf(gsp::io::format_mjcf(d), "again.xml");
  for (auto const& description : {d, again}) {
    auto const g = gsp::compile(description);
    compare_rules(g, oracle.m());
    CHECK(g.option.sleep);
    CHECK(g.option.sleep_tolerance == 0.02);
  }
}

TEST_CASE("rules of sleep on real models" * doctest::test_suite("data")) {
  for (char const* name : {"mujoco/humanoid/humanoid.xml", "mujoco/sleep/dominos.xml", "mujoco/car/car.xml",
                           "dm_control/suite/quadruped.xml", "mujoco/slider_crank/slider_crank.xml", "mujoco/replicate/leaves.xml"}) {
    CAPTURE(name);
    auto const path = gsp_test::data("models/" + std::string(name));
    if (!path) {
      gsp_test::skip(std::string(name) + " is missing from GSP_DATA_DIR");
      continue;
    }
    compare_rules(gsp::compile(gsp::io::read_mjcf(*path)), gsp_test::load_oracle(*path).m());
  }
}

// Boxes that fall flat from several heights, two of them on each other, and a ball that rolls into one at 2 s. Both solve one problem to
// rounding, so the motion is the same until something sleeps: MuJoCo judges the velocity before a step and stops it there, gsp that after
// it, a step ahead. Which step a box comes below the tolerance in is the same as long as rounding does not decide it: one more step is left
// to it.
TEST_CASE("the same trees sleep and wake when MuJoCo's do") {
  std::string const box = R"(<freejoint/><geom type="box" size=".1 .1 .1" mass="1"/>)";
  std::string const text =
      R"(<mujoco><option timestep=".004" cone="elliptic" iterations="200" tolerance="1e-14"><flag sleep="enable"/></option>
    <worldbody><geom type="plane" size="9 9 1"/>
    <body pos="0 0 .1">)" +
      box + R"(</body><body pos="1 0 .12">)" + box + R"(</body><body pos="2 0 .15">)" + box + R"(</body><body pos="2 .02 .36">)" + box +
      R"(</body><body pos="3 0 .2">)" + box +
      R"(</body><body pos="-1 0 .1"><freejoint/><geom size=".1" mass=".5"/></body></worldbody></mujoco>)";
  auto const oracle = gsp_test::load_oracle("model.xml", text);
  mjModel* const m = oracle.m();
  mjData* const d = oracle.d();
  auto const compiled = gsp::compile(gsp::io::parse_mjcf(text, "model.xml"));
  Exec const exec;
  auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
  auto state = gsp::make_state(exec, model);
  auto sim = gsp::make_simulation(exec, model, compiled);  // the file says that it sleeps
  REQUIRE(sim.sleep.worlds == 1);
  int const ntree = model.ntree, ball = ntree - 1;
  struct Change {
    int step;
    bool asleep;
  };
  std::vector<std::vector<Change>> ours(ntree), theirs(ntree);
  auto const note = [](std::vector<Change>& to, int step, bool asleep) {
    if (asleep != (!to.empty() && to.back().asleep)) to.push_back({step, asleep});
  };
  for (int step = 0; step < 1500; ++step) {
    if (step == 500) state.qvel(0, 6 * ball) = d->qvel[6 * ball] = 2, state.qvel(0, 6 * ball + 4) = d->qvel[6 * ball + 4] = 20;
    mj_step(m, d);
    gsp::step(exec, model, state, sim);
    for (int t = 0; t < ntree; ++t) {
      note(ours[t], step, sim.sleep.state.sleeps(0, t));
      note(theirs[t], step, d->tree_asleep[t] >= 0);
    }
  }
  for (int t = 0; t < ntree; ++t) {
    CAPTURE(t);
    REQUIRE(ours[t].size() == theirs[t].size());
    for (std::size_t i = 0; i < ours[t].size(); ++i) {
      CAPTURE(ours[t][i].step);
      CHECK(std::abs(ours[t][i].step - theirs[t][i].step) <= 2);
    }
  }
  CHECK(ours[0].size() == 3);  // sleeps, is woken, sleeps
  CHECK(ours[1].size() <= 3);
  CHECK(ours[4].size() == 1);  // is not met
}
