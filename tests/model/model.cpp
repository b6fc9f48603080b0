#include <doctest/doctest.h>

#include <gsp/model/compile.hpp>
#include <gsp/model/model.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/model/state.hpp>
#include <gsp_test_execs.hpp>
#include <string>

#include "dynamics/random_tree.hpp"
#include "support/kernels.hpp"

namespace {
using Exec = Kokkos::DefaultHostExecutionSpace;

std::string refusal(gsp::Description const& d) {
  try {
    (void)gsp::make_model<double>(Exec{}, gsp::compile(d));
  } catch (gsp::Error const& e) { return e.what(); }
  return "";
}
bool says(std::string const& text, char const* word) { return text.find(word) != std::string::npos; }
}  // namespace

// Which trees are instances of one archetype: topology decides, numbers do not.
TEST_CASE("archetypes") {
  auto const scene = gsp::compile(gsp::samples::quadruped_scene());
  auto const trees = gsp::find_archetypes(scene);
  REQUIRE(trees.size() == 2);  // the robot; twelve free bodies, boxes and balls alike
  CHECK(trees[0].nv() == 18);
  CHECK(trees[0].instances.size() == 1);
  CHECK(trees[0].act_id.size() == 12);
  CHECK(trees[1].instances.size() == 12);

  auto d = gsp_test::random_model({gsp::JointType::free, gsp::JointType::hinge, gsp::JointType::free, gsp::JointType::free}, 8);
  CHECK(gsp::find_archetypes(gsp::compile(d)).size() == 2);
  gsp::ActuatorDescription a;
  a.name = "motor", a.target_name = "t2b1j0";
  d.actuators.push_back(a);
  auto const split = gsp::find_archetypes(gsp::compile(d));  // one of the three has a motor
  REQUIRE(split.size() == 3);
  CHECK(split[0].instances.size() == 2);
  CHECK(split[2].instances.size() == 1);
}

// Row i of the triangle: the ancestors of i from the root down, then i; an ancestor at place p has exactly the first p + 1 of them.
TEST_CASE("rows of ancestors nest") {
  for (auto const& t : gsp::find_archetypes(gsp::compile(gsp_test::random_model({gsp::JointType::free, gsp::JointType::ball}, 11)))) {
    REQUIRE(int(t.row_adr.size()) == t.nv() + 1);
    for (int i = 0; i < t.nv(); ++i) {
      int const n = t.row_adr[i + 1] - t.row_adr[i];
      int at = i;
      for (int p = n - 1; p >= 0; --p) {
        int const c = t.row_col[t.row_adr[i] + p];
        CHECK(c == at);
        REQUIRE(t.row_adr[c + 1] - t.row_adr[c] == p + 1);
        at = t.dof_parent[at];
      }
      CHECK(at == -1);
    }
  }
}

TEST_CASE("what the dynamics cover is taken, and what they do not is refused by name") {
  auto const base = gsp_test::random_model({gsp::JointType::ball, gsp::JointType::hinge}, 5);
  CHECK(refusal(base).empty());
  auto d = base;
  gsp::ActuatorDescription a;
  a.name = "twist", a.target_name = "t0b0j0";  // a ball joint
  gsp::TendonDescription t;
  t.name = "belt", t.terms = {{"t0b1j0", 1}, {"t1b1j0", -1}}, t.armature = 0.1;  // two kinematic trees
  d.actuators = {a}, d.tendons = {t}, d.bodies[3].gravcomp = 1;
  CHECK(refusal(d).empty());
  auto c = gsp::compile(d);
  c.act_actnum = {2}, c.act_actadr = {0}, c.na = 2;
  try {
    gsp::make_model<double>(Exec{}, c);
    FAIL("two activations were taken");
  } catch (gsp::Error const& e) {
    CHECK(says(e.what(), "'twist'"));
    CHECK(says(e.what(), "actdim"));
    CHECK(gsp::model_refusals(c).front() == e.what());
  }
  CHECK_THROWS_AS(gsp::make_model<double>(Exec{}, gsp::compile(base), {.timestep = -1}), std::invalid_argument);
}

// Beyond 3.4e38 a float is infinite, below 1.2e-38 it loses its digits and at last itself, and what is divided by it is NaN: each number is
// asked for at both sides of the bound, in float and in double.
TEST_CASE("numbers that float cannot hold are refused by name, and taken in double") {
  auto d = gsp_test::random_model({gsp::JointType::ball, gsp::JointType::hinge}, 5);
  d.bodies[0].geoms.emplace_back().size = {1, 1, 1};
  auto const base = gsp::compile(d);
  auto const made = [&]<class R>(R, auto const& change) -> std::string {
    auto c = base;
    change(c);
    try {
      (void)gsp::make_model<R>(Exec{}, c);
      return "";
    } catch (gsp::Error const& e) { return e.what(); }
  };
  auto const refused = [&](char const* place, char const* number, auto const& change) {
    std::string const sentence = made(0.f, change);
    CHECK_MESSAGE(says(sentence, place), sentence);
    CHECK_MESSAGE(says(sentence, number), sentence);
    CHECK_MESSAGE(says(sentence, "take double precision"), sentence);
    CHECK(made(0., change).empty());
  };
  int const b = base.njnt > 0 ? base.jnt_body[0] : 1;
  std::string const body = "body '" + base.body_name[b] + "'", joint = "'" + base.jnt_name[1] + "'";
  refused(body.c_str(), "body_mass 1e-39", [&](auto& c) { c.body_mass[b] = 1e-39; });
  refused(body.c_str(), "body_inertia 1e-60", [&](auto& c) { c.body_inertia[b][1] = 1e-60; });
  refused(body.c_str(), "body_mass 1e+39", [&](auto& c) { c.body_mass[b] = 1e39; });
  refused(joint.c_str(), "jnt_stiffness -3.5e+38", [&](auto& c) { c.jnt_stiffness[1] = -3.5e38; });
  refused("option", "gravity -1e+300", [&](auto& c) { c.option.gravity[2] = -1e300; });
  refused("option", "timestep 1e-40", [&](auto& c) { c.option.timestep = 1e-40; });
  refused("geom 0", "solref 1e+40", [&](auto& c) { c.geom_solref[0][0] = 1e40; });
  for (auto const& fits : {made(0.f, [&](auto& c) { c.body_mass[b] = 1.2e-38; }), made(0.f, [&](auto& c) { c.body_mass[b] = 3.4e38; }),
                           made(0.f, [&](auto& c) { c.jnt_pos[1][0] = 1e-60; }), made(0.f, [&](auto& c) { c.body_mass[b] = 0; })})
    CHECK_MESSAGE(fits.empty(), fits);
}

TEST_CASE_TEMPLATE("a state starts, and starts again, at the model's initial positions", E, GSP_TEST_EXECS) {
  E const exec;
  auto const c = gsp::compile(gsp::samples::quadruped());
  auto const model = gsp::make_model<float>(exec, c, {.timestep = 0.004});
  CHECK(model.timestep == 0.004f);
  auto state = gsp::make_state(exec, model, {.worlds = 5});
  auto const check = [&] {
    auto const q = gsp_test::host(state.qpos), v = gsp_test::host(state.qvel);
    for (int w = 0; w < 5; ++w) {
      for (int i = 0; i < c.nq; ++i) CHECK(q(w, i) == float(c.qpos0[i]));
      for (int i = 0; i < c.nv; ++i) CHECK(v(w, i) == 0);
      CHECK(gsp_test::host(state.steps)(w) == 0);
      CHECK(gsp_test::host(state.status)(w) == 0);
    }
  };
  check();
  Kokkos::deep_copy(state.qpos, 3.f), Kokkos::deep_copy(state.qvel, 4.f), Kokkos::deep_copy(state.steps, 5),
      Kokkos::deep_copy(state.status, 4u);
  gsp::reset(exec, model, state);
  exec.fence();
  check();
  CHECK_THROWS_WITH_AS(gsp::make_state(exec, model, {.worlds = -3}), "gsp::make_state: worlds must be positive and is -3",
                       std::invalid_argument);
}
