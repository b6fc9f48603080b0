#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/constraint/contact_forces.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "support/data.hpp"
#include "support/skip.hpp"

// One step with limits, dry friction, contacts of condim 1, 3, 4 and 6 in both cones, surfaces that move and adhesion, in four integrators,
// against MuJoCo's Newton solver (tolerance 0, 200 iterations): profile `mujoco`, double. Both solve one strictly convex problem (R > 0).
// Error: max norm of the difference of qvel over max(1, max norm). Two solutions agree to rounding times the condition of
// 1 + M^-1 J^T R^-1 J, whose part of one row is imp / (1 - imp), 10 to 100 here; some ten rows meet in a joint: 1e3 to 1e4 epsilon, 1e-12.
// The humanoid's limbs weigh 1:100: 1e-11.
// Beside it contact_forces and mj_contactForce, contact by contact (same geoms, same place). f = (aref - J a) / R, so an error e of a rate
// is one of e / (h R) in the force, which itself is about |u| / (h A): relative to the largest, e A / R = e imp / (1 - imp), 10 e at an
// impedance of 0.9: the bar is ten times that of the rates, of max(1 N, the largest).
namespace {

using Exec = Kokkos::DefaultHostExecutionSpace;
using Mem = Exec::memory_space;

struct Outcome {
  double worst = 0, worst_force = 0;
  double residual = 0;
  int iterations = 0;
  int contacts = 0, limits = 0, frictions = 0, off = 0, touches = 0, forces = 0;
  int pulling = 0;  // contacts with a normal force below zero
};

/// A contact of MuJoCo's, and its force and torque.
struct Touch {
  int geom1, geom2;
  double pos[3], force[6];
};

/// What a comparison asks of both.
struct Setting {
  int condim = 1;  // of all contacts; 0: as the model says
  mjtCone cone = mjCONE_PYRAMIDAL;
  mjtIntegrator integrator = mjINT_EULER;
  double impratio = 1;
  double bar = 1e-12;  // of the rates
};

Outcome compare(gsp_test::Oracle const& oracle, gsp::CompiledModel compiled, int worlds, double height, Setting setting = {}) {
  mjModel* m = oracle.m();
  mjData* d = oracle.d();
  m->opt.solver = mjSOL_NEWTON, m->opt.iterations = 200, m->opt.tolerance = 0, m->opt.ls_iterations = 200, m->opt.ls_tolerance = 1e-12;
  m->opt.disableflags |= mjDSBL_AUTORESET | mjDSBL_WARMSTART;
  m->opt.enableflags &= ~mjENBL_SLEEP;
  m->opt.cone = setting.cone, m->opt.integrator = setting.integrator, m->opt.impratio = setting.impratio;
  compiled.option.cone = gsp::FrictionCone(setting.cone), compiled.option.impratio = setting.impratio;
  compiled.option.integrator = gsp::Integrator(setting.integrator);
  if (int const condim = setting.condim; condim > 0) {
    for (int g = 0; g < m->ngeom; ++g) m->geom_condim[g] = condim;
    for (int p = 0; p < m->npair; ++p) m->pair_dim[p] = condim;
    for (int& own : compiled.geom_condim) own = condim;
    for (auto& pair : compiled.named_pairs) pair.condim = condim;
  }

  Exec const exec;
  auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  REQUIRE(model.nv == m->nv);
  std::vector<double> next(std::size_t(worlds) * m->nv);
  std::vector<int> rows(worlds);
  std::vector<std::vector<Touch>> touches(worlds);
  gsp_test::Random r;
  Outcome out;
  for (int w = 0; w < worlds; ++w) {
    mj_resetData(m, d);
    for (int j = 0; j < m->njnt; ++j) {
      int const q = m->jnt_qposadr[j];
      if (m->jnt_type[j] == mjJNT_FREE) {
        d->qpos[q + 2] = height * (1 + 0.6 * r());
        auto const quat = gsp_test::random_quat(r);
        for (int c = 0; c < 4; ++c) d->qpos[q + 3 + c] = quat[c];
      } else if (m->jnt_type[j] != mjJNT_BALL) {  // now and then beyond a limit
        double const lo = m->jnt_range[2 * j], hi = m->jnt_range[2 * j + 1];
        d->qpos[q] = m->jnt_limited[j] ? (lo + hi) / 2 + 0.55 * (hi - lo) * r() : 0.5 * r();
      }
    }
    for (int i = 0; i < m->nv; ++i) d->qvel[i] = r();
    for (int i = 0; i < m->nu; ++i) d->ctrl[i] = 0.5 * r();
    for (int i = 0; i < m->nq; ++i) state.qpos(w, i) = d->qpos[i];
    for (int i = 0; i < m->nv; ++i) state.qvel(w, i) = d->qvel[i];
    for (int i = 0; i < m->nu; ++i) state.ctrl(w, i) = d->ctrl[i];
    mj_step(m, d);
    rows[w] = d->nefc;
    for (int i = 0; i < d->nefc; ++i) {
      out.contacts += d->efc_type[i] == mjCNSTR_CONTACT_FRICTIONLESS || d->efc_type[i] == mjCNSTR_CONTACT_PYRAMIDAL ||
                      d->efc_type[i] == mjCNSTR_CONTACT_ELLIPTIC;
      out.limits += d->efc_type[i] == mjCNSTR_LIMIT_JOINT || d->efc_type[i] == mjCNSTR_LIMIT_TENDON;
      out.frictions += d->efc_type[i] == mjCNSTR_FRICTION_DOF;
    }
    std::memcpy(&next[std::size_t(w) * m->nv], d->qvel, sizeof(double) * m->nv);
    for (int c = 0; c < d->ncon; ++c) {
      Touch t{d->contact[c].geom[0], d->contact[c].geom[1], {}, {}};
      std::memcpy(t.pos, d->contact[c].pos, sizeof t.pos);
      mj_contactForce(m, d, c, t.force);
      touches[w].push_back(t);
    }
  }
  gsp::step(exec, model, state, sim, {.steps = 1, .newton = {.residual = true}});
  Kokkos::View<double* [6], Kokkos::LayoutRight, Mem> force("force", sim.contacts.dist.extent(0));
  gsp::contact_forces(exec, model, sim.collision, sim.contacts, sim.rows, sim.impulses, force);
  auto const& found = sim.contacts;
  for (int w = 0; w < worlds; ++w) {
    double difference = 0, norm = 1;
    for (int i = 0; i < m->nv; ++i) {
      double const ref = next[std::size_t(w) * m->nv + i];
      difference = std::fmax(difference, std::isfinite(state.qvel(w, i)) ? std::abs(state.qvel(w, i) - ref) : INFINITY),
      norm = std::fmax(norm, std::abs(ref));
    }
    CHECK(state.status(w) == 0);
    out.iterations = std::max(out.iterations, sim.solution.iterations(w));
    out.residual = std::fmax(out.residual, sim.solution.residual(w));
    int own_rows = 0;  // without those whose impulses are given (ContactAdhesion)
    for (int r = sim.rows.first(w); r < sim.rows.first(w) + sim.rows.count(w); ++r) {
      auto const& row = sim.rows.row(r);
      own_rows += row.friction_of >= 0 || !(row.lower == row.upper && row.lower != 0);
    }
    if (own_rows != rows[w]) {  // contact lists differ: where MuJoCo's are ambiguous (tests/oracle/contacts.cpp)
      ++out.off;
      continue;
    }
    out.worst = std::fmax(out.worst, difference / norm);
    double force_difference = 0, largest = 1;
    for (Touch const& t : touches[w]) {
      int at = -1, matches = 0;
      for (int c = found.first_of(w); c < found.first_of(w) + found.count_of(w); ++c) {
        double apart = 0;
        for (int k = 0; k < 3; ++k) apart = std::fmax(apart, std::abs(found.pos(c, k) - t.pos[k]));
        if (found.geom1(c) != t.geom1 || found.geom2(c) != t.geom2 || apart > 1e-9) continue;
        at = c;
        ++matches;
      }
      ++out.touches;
      if (matches != 1) continue;  // two points in one place, or none there
      ++out.forces;
      for (int r = 0; r < 6; ++r) {
        double const off = std::abs(force(at, r) - t.force[r]);
        force_difference = std::fmax(force_difference, std::isfinite(force(at, r)) ? off : INFINITY);
      }
      largest = std::fmax(largest, t.force[0]);
      out.pulling += t.force[0] < -1e-6;
    }
    out.worst_force = std::fmax(out.worst_force, force_difference / largest);
  }
  MESSAGE(out.contacts << " contact rows, " << out.limits << " limits, " << out.frictions << " of dry friction in " << worlds << " worlds ("
                       << out.off << " with other row counts); worst error " << out.worst << ", of " << out.forces << " contact forces "
                       << out.worst_force << "; at most " << out.iterations << " iterations, residual " << out.residual);
  CHECK(out.worst <= setting.bar);
  CHECK(out.worst_force <= 10 * setting.bar);
  CHECK(out.forces > 0.99 * out.touches);
  return out;
}

}  // namespace

TEST_CASE("humanoid: limits and frictionless contacts" * doctest::test_suite("data")) {
  auto const path = gsp_test::data("models/mujoco/humanoid/humanoid.xml");
  if (!path) {
    gsp_test::skip("models/mujoco/humanoid/humanoid.xml is missing from GSP_DATA_DIR");
    return;
  }
  auto const oracle = gsp_test::load_oracle(*path);
  auto const out = compare(oracle, gsp::compile(gsp::io::read_mjcf(*path)), 200, 0.6, {.condim = 1, .bar = 1e-11});
  CHECK(out.off <= 2);
  CHECK(out.contacts > 400);
  CHECK(out.limits > 400);
}

TEST_CASE("dry friction, limits of hinges, balls and tendons") {
  std::string const text = R"(<mujoco><option timestep="0.004"/><worldbody><geom type="plane" size="5 5 1"/>
    <body pos="0 0 0.5"><freejoint/><geom type="box" size=".1 .2 .05"/>
      <body pos=".15 0 0"><joint name="a" axis="0 1 0" range="-30 40" frictionloss=".4" damping=".1" solreflimit=".03 .8"/><geom type="capsule" size=".03 .1" pos="0 0 .1"/>
        <body pos="0 0 .2"><joint name="b" axis="1 0 0" range="-20 20" frictionloss=".2" armature=".01" solimpfriction=".8 .9 .002"/><geom type="capsule" size=".03 .1" pos="0 0 .1"/></body></body>
      <body pos="-.15 0 0"><joint name="c" type="ball" range="0 25" damping=".05"/><geom type="sphere" size=".06" pos="0 0 .12"/></body>
    </body></worldbody>
    <tendon><fixed name="t" limited="true" range="-.2 .3" frictionloss=".3"><joint joint="a" coef="1"/><joint joint="b" coef="-.7"/></fixed></tendon>
    <actuator><position joint="a" kp="5"/></actuator></mujoco>)";
  auto const oracle = gsp_test::load_oracle("model.xml", text);
  auto const out = compare(oracle, gsp::compile(gsp::io::parse_mjcf(text, "model.xml")), 200, 0.15);
  CHECK(out.off == 0);
  CHECK(out.contacts > 100);
  CHECK(out.limits > 100);
  CHECK(out.frictions > 100);
}

TEST_CASE("named pairs: softness and margins of their own; what stands still or cannot part makes no rows") {
  std::string const text = R"(<mujoco><option timestep="0.004"/><worldbody><geom name="floor" type="plane" size="5 5 1"/>
    <geom name="post" size=".1" pos="0 0 .05"/>
    <body pos="0 0 0.5"><freejoint/><geom name="box" type="box" size=".1 .2 .05" contype="0" conaffinity="0"/><geom name="knob" size=".08" pos="0 0 .05"/>
      <body pos=".1 0 0"><geom name="welded" size=".07"/></body>
      <body pos=".15 0 0"><joint axis="0 1 0" damping=".1"/><geom name="arm" type="capsule" size=".05 .1" pos="0 0 .1"/></body>
    </body></worldbody>
    <contact><pair geom1="floor" geom2="box" solref=".05 .7" solimp=".7 .8 .01" margin=".03" gap=".01"/><pair geom1="floor" geom2="post"/>
      <pair geom1="knob" geom2="box"/><pair geom1="welded" geom2="knob"/><pair geom1="arm" geom2="knob" solref="-300 -10"/></contact></mujoco>)";
  auto const oracle = gsp_test::load_oracle("model.xml", text);
  auto const out = compare(oracle, gsp::compile(gsp::io::parse_mjcf(text, "model.xml")), 200, 0.15);
  CHECK(out.off == 0);
  CHECK(out.contacts > 400);
}

TEST_CASE("cones of friction, condim 3, 4 and 6, and all integrators") {
  std::string const text =
      R"(<mujoco><option timestep="0.004"/><worldbody><geom name="floor" type="plane" size="5 5 1" friction="0.7 0.01 0.002"/>
    <body pos="0 0 0.5"><freejoint/><geom type="box" size=".1 .2 .05" friction="0.4 0.02 0.003"/>
      <body pos=".15 0 0"><joint name="a" axis="0 1 0" range="-30 40" frictionloss=".4" damping=".1"/><geom type="capsule" size=".03 .1" pos="0 0 .1"/>
        <body pos="0 0 .2"><joint name="b" axis="1 0 0" range="-20 20" armature=".01"/><geom type="sphere" size=".05" pos="0 0 .1" solref="-800 -20" friction="1.2 .1 .05"/></body></body>
      <body pos="-.15 0 0"><joint name="c" type="ball" damping=".05"/><geom name="foot" type="sphere" size=".06" pos="0 0 .12" solimp=".8 .99 .01"/></body>
    </body></worldbody>
    <contact><pair geom1="floor" geom2="foot" friction=".5 .9 .02 .004 .001" solreffriction=".03 .9"/></contact>
    <actuator><position joint="a" kp="5"/></actuator></mujoco>)";
  auto const oracle = gsp_test::load_oracle("model.xml", text);
  auto const compiled = gsp::compile(gsp::io::parse_mjcf(text, "model.xml"));
  struct Case {
    char const* name;
    Setting setting;
  };
  for (auto const& [name, setting] :
       {Case{"pyramid 3", {3, mjCONE_PYRAMIDAL}}, Case{"pyramid 4", {4, mjCONE_PYRAMIDAL}},
        Case{"pyramid 6", {6, mjCONE_PYRAMIDAL, mjINT_IMPLICITFAST}},
        Case{"pyramid 3, impratio 5", {3, mjCONE_PYRAMIDAL, mjINT_IMPLICIT, 5}}, Case{"ellipse 3", {3, mjCONE_ELLIPTIC}},
        Case{"ellipse 4", {4, mjCONE_ELLIPTIC, mjINT_IMPLICITFAST}}, Case{"ellipse 6", {6, mjCONE_ELLIPTIC}},
        Case{"ellipse 3, impratio 10", {3, mjCONE_ELLIPTIC, mjINT_IMPLICIT, 10}}, Case{"pyramid 3, RK4", {3, mjCONE_PYRAMIDAL, mjINT_RK4}},
        Case{"ellipse 6, RK4", {6, mjCONE_ELLIPTIC, mjINT_RK4}}}) {
    INFO(std::string(name));
    auto const out = compare(oracle, compiled, 100, 0.15, setting);
    CHECK(out.off == 0);
    CHECK(out.contacts > 100);
  }
}

TEST_CASE("<option o_*> says what all contacts are like; time constants below two timesteps") {
  std::string const text =
      R"(<mujoco><option timestep="0.004" OPTION><flag FLAG/></option><worldbody><geom name="floor" type="plane" size="5 5 1" friction="0.7 0.01 0.002"/>
    <body pos="0 0 0.5"><freejoint/><geom type="box" size=".1 .2 .05" friction="0.4 0.02 0.003" solref=".005 1" margin=".01" gap=".01"/>
      <body pos=".15 0 0"><joint name="a" axis="0 1 0" range="-30 40" damping=".1" solreflimit=".004 .9"/><geom type="capsule" size=".03 .1" pos="0 0 .1" priority="1" condim="4" solref=".006 .7"/></body>
      <body pos="-.15 0 0"><joint name="c" type="ball" damping=".05"/><geom name="foot" type="sphere" size=".06" pos="0 0 .12" solimp=".8 .99 .01"/></body>
    </body></worldbody>
    <contact><pair geom1="floor" geom2="foot" condim="6" friction=".5 .9 .02 .004 .001" solref=".003 1" solreffriction=".005 .9" margin=".02"/></contact></mujoco>)";
  auto const with = [&](std::string all, std::string const& option, std::string const& flag) {
    all.replace(all.find("OPTION"), 6, option);
    return all.replace(all.find("FLAG"), 4, flag);
  };
  std::string const own = R"(o_margin=".015" o_solref=".005 .8" o_solimp=".7 .9 .005" o_friction=".3 .6 .03 .002 .004")";
  for (auto const& [option, flag] : {std::pair<std::string, std::string>{own, R"(override="enable")"},
                                     {own, R"(refsafe="disable")"},
                                     {own, R"(override="enable" refsafe="disable")"},
                                     {R"(o_solref="-900 -20")", R"(override="enable")"}})
    for (mjtCone const cone : {mjCONE_PYRAMIDAL, mjCONE_ELLIPTIC}) {
      INFO(option << " " << flag << " cone " << int(cone));
      auto const model = with(text, option, flag);
      auto const oracle = gsp_test::load_oracle("model.xml", model);
      auto const compiled = gsp::compile(gsp::io::parse_mjcf(model, "model.xml"));
      CHECK(compiled.report.empty());
      auto const out = compare(oracle, compiled, 100, 0.15, {0, cone});
      CHECK(out.off == 0);
      CHECK(out.contacts > 100);
    }
}

// One positive number and one that is not: MuJoCo takes its default, 0 0, as solref says; joints' friction has 0.02 1 there.
TEST_CASE("a pair's solreffriction that is neither form is none") {
  for (char const* given : {"0.02", "0.02 -1", "-500 20", "0.08 0", "0 0.5", "0.08 0.5", "-500 -20", "0 -5", "-5 0"})
    for (std::string const solref : {"0.05 1", "0.05 -1"})
      for (char const* flag : {"disable", "enable"}) {
        std::string const text = R"(<mujoco><option timestep="0.002"><flag override=")" + std::string(flag) +
                                 R"("/></option><worldbody><geom name="p" type="plane" size="5 5 1"/>
            <body pos="0 0 .09"><freejoint/><geom name="s" size=".1"/></body></worldbody>
          <contact><pair geom1="p" geom2="s" condim="6" friction="1 1 .05 .01 .01" solref=")" +
                                 solref + R"(" solreffriction=")" + given + R"("/></contact></mujoco>)";
        INFO(std::string(given) << ", solref " << solref << ", override " << std::string(flag));
        auto const oracle = gsp_test::load_oracle("model.xml", text);
        auto const compiled = gsp::compile(gsp::io::parse_mjcf(text, "model.xml"));
        auto const out = compare(oracle, compiled, 20, 0.08, {0, mjCONE_ELLIPTIC});
        CHECK(out.off == 0);
        CHECK(out.contacts > 10);
      }
}

TEST_CASE("surfaces that move: of the floor, of bodies, against one another, in all cones") {
  std::string const text =
      R"(<mujoco><option timestep="0.004"/><worldbody><geom name="floor" type="plane" size="5 5 1" surfacevel=".7 -.4 .9 .3 -.2 1.5" pos=".1 0 0"/>
    <body pos="0 0 0.5"><freejoint/><geom type="box" size=".1 .2 .05" friction="0.4 0.02 0.003" surfacevel="0 .5 0 0 0 0" pos=".02 0 0" euler="0 10 30"/>
      <body pos=".15 0 0"><joint name="a" axis="0 1 0" range="-30 40" damping=".1"/><geom type="capsule" size=".03 .1" pos="0 0 .1" surfacevel="0 0 0 1 2 -9"/>
        <body pos="0 0 .2"><joint name="b" axis="1 0 0" range="-20 20" armature=".01"/><geom type="sphere" size=".05" pos="0 0 .1"/></body></body>
      <body pos="-.15 0 0"><joint name="c" type="ball" damping=".05"/><geom name="foot" type="sphere" size=".06" pos="0 0 .12" surfacevel="1 0 0 0 0 0"/></body>
    </body></worldbody>
    <contact><pair geom1="floor" geom2="foot" friction=".5 .9 .02 .004 .001" solreffriction=".03 .9"/></contact></mujoco>)";
  auto const oracle = gsp_test::load_oracle("model.xml", text);
  auto const compiled = gsp::compile(gsp::io::parse_mjcf(text, "model.xml"));
  CHECK(compiled.report.empty());
  for (int const condim : {1, 3, 4, 6})
    for (mjtCone const cone : {mjCONE_PYRAMIDAL, mjCONE_ELLIPTIC})
      for (mjtIntegrator const integrator : {mjINT_EULER, mjINT_RK4}) {
        INFO(condim << " cone " << int(cone) << " integrator " << int(integrator));
        auto const out = compare(oracle, compiled, 60, 0.15, {condim, cone, integrator});
        CHECK(out.off == 0);
        CHECK(out.contacts > 60);
      }
}

// The normal moves nothing, and bears friction all the same: what its softness makes of the overlap.
TEST_CASE("what slides on rails is pressed into the floor") {
  std::string const text =
      R"(<mujoco><option timestep="0.004"/><worldbody><geom type="plane" size="5 5 1" friction="0.7 0.01 0.002"/>
    <body pos="0 0 .099"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><geom size=".1" mass="2"/></body>
    <body pos="0 2 .0995"><joint type="slide" axis="1 0 0"/><geom size=".1"/></body>
    <body pos="0 4 .099"><joint axis="0 0 1"/><geom size=".1"/><geom size=".1" pos=".3 0 0"/></body></worldbody></mujoco>)";
  auto const oracle = gsp_test::load_oracle("model.xml", text);
  auto const compiled = gsp::compile(gsp::io::parse_mjcf(text, "model.xml"));
  for (int const condim : {1, 3, 4, 6})
    for (mjtCone const cone : {mjCONE_PYRAMIDAL, mjCONE_ELLIPTIC}) {
      INFO(condim << " cone " << int(cone));
      auto const out = compare(oracle, compiled, 20, 0.15, {condim, cone});
      CHECK(out.off == 0);
      CHECK(out.contacts > 60);
    }
}

// Geoms, a geom of higher priority, a named pair, and actuators on two bodies of one tree and on the world, also over gaps.
TEST_CASE("adhesion of geoms, pairs and actuators") {
  std::string const text = R"(<mujoco><option timestep="0.004"/><worldbody><geom name="floor" type="plane" size="5 5 1" adhesion="3"/>
    <body name="box" pos="0 0 0.5"><freejoint/><geom type="box" size=".1 .2 .05" friction="0.4 0.02 0.003" adhesion="20" gap=".03" margin=".01"/>
      <body name="arm" pos=".15 0 0"><joint name="a" axis="0 1 0" range="-30 40" damping=".1"/><geom type="capsule" size=".03 .1" pos="0 0 .1" priority="1" adhesion="40" gap=".05" condim="4"/>
        <body pos="0 0 .2"><joint name="b" axis="1 0 0" range="-20 20" armature=".01"/><geom type="sphere" size=".05" pos="0 0 .1" condim="1" gap=".04"/></body></body>
      <body pos="-.15 0 0"><joint name="c" type="ball" damping=".05"/><geom name="foot" type="sphere" size=".06" pos="0 0 .12"/></body>
    </body></worldbody>
    <contact><pair geom1="floor" geom2="foot" friction=".5 .9 .02 .004 .001" adhesion="9" gap=".02"/></contact>
    <actuator><adhesion body="box" ctrlrange="0 1" gain="70"/><position joint="a" kp="5"/><adhesion body="arm" ctrlrange="0 1" gain="30" forcerange="0 8"/><adhesion body="world" ctrlrange="0 1" gain="12"/></actuator></mujoco>)";
  auto const oracle = gsp_test::load_oracle("model.xml", text);
  auto const compiled = gsp::compile(gsp::io::parse_mjcf(text, "model.xml"));
  CHECK(compiled.report.empty());
  for (int const condim : {0, 6})
    for (mjtCone const cone : {mjCONE_PYRAMIDAL, mjCONE_ELLIPTIC})
      for (mjtIntegrator const integrator : {mjINT_EULER, mjINT_IMPLICITFAST, mjINT_RK4}) {
        INFO(condim << " cone " << int(cone) << " integrator " << int(integrator));
        auto const out = compare(oracle, compiled, 60, 0.15, {condim, cone, integrator});
        CHECK(out.off == 0);
        CHECK(out.contacts > 60);
        CHECK(out.pulling > 10);
      }
}
