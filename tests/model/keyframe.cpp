// Keyframes in states: the key's numbers, all else as `reset` leaves it (tests/oracle/keyframe.cpp: as MuJoCo has it).
#include <doctest/doctest.h>

#include <gsp/model/compile.hpp>
#include <gsp/model/keyframe.hpp>
#include <gsp/model/samples.hpp>
#include <gsp_test_execs.hpp>
#include <string>

#include "dynamics/random_tree.hpp"
#include "support/disturb.hpp"
#include "support/kernels.hpp"

namespace {
// A quadruped with two keys of its own, one of them without a name, and a body that the user moves.
gsp::Description described() {
  auto d = gsp::samples::quadruped();
  gsp::BodyDescription hand;
  hand.name = "hand";
  hand.parent = 0;
  hand.mocap = true;
  hand.pos = {1, 2, 3};
  d.bodies.push_back(hand);
  gsp::KeyframeDescription key;
  key.qpos = d.keyframes.at(0).qpos;
  key.qpos[0] = 0.1;  // no number of a float
  key.qpos[8] = 0.3;
  key.qvel.assign(key.qpos.size() - 1, 0.25);
  key.mpos = {4, 5, 6};
  key.mquat = {0, 0, 2, 0};
  key.time = 3;
  d.keyframes.push_back(key);
  return d;
}
}  // namespace

TEST_CASE_TEMPLATE("worlds of the mask stand at the keyframe, as a reset leaves them; the others keep all", E, GSP_TEST_EXECS) {
  using Mem = typename E::memory_space;
  E const exec;
  auto const c = gsp::compile(described());
  auto const model = gsp::make_model<float>(exec, c);
  int const worlds = 5;
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto const check = [&](int w, gsp::KeyframeDescription const* key) {
    CAPTURE(w);
    auto const q = gsp_test::host(state.qpos), low = gsp_test::host(state.qpos_low), v = gsp_test::host(state.qvel);
    auto const ctrl = gsp_test::host(state.ctrl), applied = gsp_test::host(state.qfrc_applied);
    auto const pos = gsp_test::host(state.mocap_pos), quat = gsp_test::host(state.mocap_quat);
    for (int i = 0; i < c.nq; ++i) {
      float const wanted = key ? float(key->qpos[i]) : 7.f;
      CHECK(q(w, i) == wanted);
      CHECK(low(w, i) == (key ? float(key->qpos[i] - double(wanted)) : 7.f));
    }
    for (int i = 0; i < c.nv; ++i) {
      CHECK(v(w, i) == (key ? float(key->qvel[i]) : 7.f));
      CHECK(applied(w, i) == (key ? 0.f : 7.f));
    }
    for (int i = 0; i < c.nu; ++i) CHECK(ctrl(w, i) == (key ? float(key->ctrl[i]) : 7.f));
    for (int i = 0; i < 3; ++i) CHECK(pos(w, 0, i) == (key ? float(key->mpos[i]) : 7.f));
    for (int i = 0; i < 4; ++i) CHECK(quat(w, 0, i) == (key ? float(key->mquat[i]) : 7.f));
    CHECK(gsp_test::host(state.steps)(w) == (key ? 0 : 7));
    CHECK(gsp_test::host(state.status)(w) == (key ? 0u : 7u));
  };
  REQUIRE(c.keyframes.size() == 2);
  CHECK(c.keyframes[1].mquat == std::vector<double>{0, 0, 1, 0});
  CHECK(float(c.keyframes[1].qpos[0]) != c.keyframes[1].qpos[0]);

  gsp_test::disturb(state);
  auto const before = state.moment();
  gsp::set_keyframe(exec, model, c, 1, state);
  CHECK(state.moment() != before);  // what was computed of it is of the state before
  for (int w = 0; w < worlds; ++w) check(w, &c.keyframes[1]);

  gsp_test::disturb(state);
  Kokkos::View<bool*, Mem> const mask("mask", worlds);
  auto const chosen = Kokkos::create_mirror_view(mask);
  for (int w = 0; w < worlds; ++w) chosen(w) = w % 2 == 1;
  Kokkos::deep_copy(mask, chosen);
  gsp::set_keyframe(exec, model, c, c.keyframes[0].name, state, mask);
  for (int w = 0; w < worlds; ++w) check(w, w % 2 == 1 ? &c.keyframes[0] : nullptr);
}

TEST_CASE("a keyframe that is not there is refused in one sentence, and the state is as it was") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  Exec const exec;
  auto d = described();
  auto const c = gsp::compile(d);
  auto const model = gsp::make_model<double>(exec, c);
  auto state = gsp::make_state(exec, model, {.worlds = 2});
  auto const before = gsp::detail::to_host(exec, state.qpos);
  CHECK_THROWS_WITH_AS(gsp::set_keyframe(exec, model, c, 2, state),
                       "gsp::set_keyframe: the model has 2 keyframes, and number 2 is asked for: give 0 to 1, or a name",
                       std::invalid_argument);
  CHECK_THROWS_AS(gsp::set_keyframe(exec, model, c, -1, state), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::set_keyframe(exec, model, c, "stant", state),
                       "gsp::keyframe_id: the model has no keyframe 'stant'; nearest: 'stand'", gsp::Error);
  Kokkos::View<bool*, Exec::memory_space> const mask("mask", 3);
  CHECK_THROWS_AS(gsp::set_keyframe(exec, model, c, 0, state, mask), std::invalid_argument);

  d.keyframes[1].qvel[2] = 1e11;
  CHECK_THROWS_WITH_AS(gsp::set_keyframe(exec, model, gsp::compile(d), 1, state),
                       "gsp::set_keyframe: number 2 of the qvel of keyframe 1 is beyond 1e10, where worlds stop: correct it", gsp::Error);
  d.keyframes.clear();
  for (auto const* name : {"stand", ""})
    CHECK_THROWS_WITH_AS(gsp::set_keyframe(exec, model, gsp::compile(d), name, state),
                         "gsp::set_keyframe: the model has no keyframes: give it one, or call reset", std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::set_keyframe(exec, model, gsp::compile(gsp::samples::arm()), 0, state),
                       "gsp::set_keyframe: the model was made of another compiled model: give the one that make_model had",
                       std::invalid_argument);
  CHECK(gsp::detail::to_host(exec, state.qpos) == before);
}
