// set_keyframe against MuJoCo's mj_resetDataKeyframe, after both were disturbed: all numbers of the state are the same, but the time, which
// is steps here.
#include <doctest/doctest.h>

#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/keyframe.hpp>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "support/disturb.hpp"
#include "support/kernels.hpp"

TEST_CASE("a keyframe leaves the state that mj_resetDataKeyframe leaves") {
  using Exec = Kokkos::DefaultExecutionSpace;
  Exec const exec;
  std::string const text =
      R"(<mujoco><worldbody><body name="m" mocap="true" pos="1 2 3"/><body name="n" mocap="true" euler="0 90 0"/>
      <body pos="0 0 1"><freejoint/><geom size=".1"/><body pos="0 0 .3"><joint name="h" axis="0 1 0"/><geom size=".1" pos=".1 0 0"/></body></body>
      <body pos="1 0 1"><joint type="ball"/><geom size=".1" pos="0 .1 0"/></body></worldbody>
      <equality><connect body1="m" body2="n" anchor="0 0 0" active="false"/></equality>
      <actuator><motor joint="h"/><general joint="h" dyntype="integrator"/></actuator>
      <keyframe><key/><key name="all" time=".5" qpos="1 2 3 2 0 0 0 .7 0 3 0 4" qvel="1 2 3 4 5 6 7 8 9 10" act=".5" ctrl=".1 .2" mpos="3 2 1 6 5 4"
      mquat="0 0 2 0 1 1 0 0"/><key name="some" ctrl="3 4"/></keyframe></mujoco>)";
  auto const oracle = gsp_test::load_oracle("model.xml", text);
  auto const compiled = gsp::compile(gsp::io::parse_mjcf(text, "model.xml"));
  auto const model = gsp::make_model<double>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = 2});
  auto const* m = oracle.m();
  auto* d = oracle.d();
  REQUIRE(m->nkey == 3);
  for (int key = 0; key < m->nkey; ++key) {
    CAPTURE(key);
    gsp_test::disturb(state);
    gsp::set_keyframe(exec, model, compiled, key, state);
    mj_resetDataKeyframe(m, d, key);
    auto const same = [&](char const* what, auto const& view, mjtNum const* wanted, int n) {
      CAPTURE(what);
      auto const got = gsp::detail::to_host(exec, view);
      REQUIRE(int(got.size()) == 2 * n);
      for (int i = 0; i < 2 * n; ++i) CHECK(got[i] == doctest::Approx(wanted[i % n]).epsilon(1e-15));  // quaternions are normalised by both
    };
    same("qpos", state.qpos, d->qpos, m->nq);
    same("qvel", state.qvel, d->qvel, m->nv);
    same("act", state.act, d->act, m->na);
    same("ctrl", state.ctrl, d->ctrl, m->nu);
    same("mocap_pos", state.mocap_pos, d->mocap_pos, 3 * m->nmocap);
    same("mocap_quat", state.mocap_quat, d->mocap_quat, 4 * m->nmocap);
    same("qfrc_applied", state.qfrc_applied, d->qfrc_applied, m->nv);
    for (int w = 0; w < 2; ++w) CHECK(gsp_test::host(state.eq_active)(w, 0) == int(d->eq_active[0]));
  }
}
