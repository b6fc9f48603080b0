#include <doctest/doctest.h>

#include <cmath>
#include <fstream>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>
#include <sstream>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "oracle/rows.hpp"
#include "support/data.hpp"
#include "support/skip.hpp"

// Equality constraints, and limits and dry friction of tendons, against MuJoCo.
// Rows: built from MuJoCo's own state after 200 steps, J, aref = (zeta - u) / h and R = C beside efc_J, efc_aref, efc_R. Two evaluations of
// the same formulas in double differ by rounding: 1e-13 of the largest entry of J and of aref's terms, h = 1e-3 adds three digits to
// (zeta - u) / h, and solimp's power law multiplies by |x| / width: the bar is 1e-9.
// Steps: profile `mujoco`, no contacts, one step from the same states; both converged (see tests/oracle/constraints.cpp): 1e-8.
namespace {

using Exec = Kokkos::DefaultHostExecutionSpace;
using Mem = Exec::memory_space;

struct Outcome {
  int worlds = 0, equalities = 0, tendon_limits = 0, tendon_frictions = 0;
  double J = 0, aref = 0, R = 0, step = 0, open = 0;  // open: largest gap of a connect, at the end of MuJoCo's steps
};

struct Subject {
  gsp_test::Oracle const& oracle;
  gsp::CompiledModel const& compiled;
};

/// The rows of a type beside MuJoCo's from row `at` on; returns the row after them.
template <class Type>
int compare_rows(Type const& type, gsp::Model<double, Mem> const& model, gsp::Dynamics<double, Mem> const& dynamics, Subject const& s,
                 int at, Outcome& out) {
  mjModel const* m = s.oracle.m();
  mjData const* d = s.oracle.d();
  double const h = model.timestep;
  for (int k = 0; k < type.count(0); ++k)
    for (int r = 0, n = type.rows(0, k); r < n; ++r) {
      gsp::detail::RowStructure<double, Mem> structure{model};
      type.jacobian(0, k, r, structure);
      gsp::Row<double> row;
      for (int g = 0; g < 2; ++g) row.segment[g] = structure.segment(g);
      std::vector<double> entries(std::size_t(structure.entries()) + 1, 0.);
      double const gap = type.jacobian(0, k, r, gsp::detail::RowWriter<double, Mem>{model, dynamics, row, entries.data(), 0});
      std::vector<double> J(std::size_t(m->nv), 0.);
      std::size_t e = 0;
      for (auto const& segment : row.segment)
        for (int i = 0; i < segment.count; ++i)
          J[std::size_t(segment.dof0 + (segment.list < 0 ? i : model.ints(segment.list + i)))] = entries[e++];
      REQUIRE(at < d->nefc);
      double u = 0, J_off = 0, J_most = 1;
      auto const reference = gsp_test::row_of(m, d, at);
      for (std::size_t i = 0; i < J.size(); ++i) {
        u += J[i] * d->qvel[i];
        J_off = std::fmax(J_off, std::abs(J[i] - reference[i]));
        J_most = std::fmax(J_most, std::abs(reference[i]));
      }
      gsp::RowBounds<double> bounds{-INFINITY, INFINITY};
      auto const law = gsp::detail::row_law(type, 0, k, r, gap, u, h, bounds);
      double const aref = (law.zeta - u) / h, terms = std::fmax(1, std::fmax(std::abs(d->efc_aref[at]), std::abs(u) / h));
      out.J = std::fmax(out.J, std::isfinite(J_off) ? J_off / J_most : INFINITY);
      out.aref = std::fmax(out.aref, std::isfinite(aref) ? std::abs(aref - d->efc_aref[at]) / terms : INFINITY);
      out.R = std::fmax(out.R, std::isfinite(law.compliance) ? std::abs(law.compliance - d->efc_R[at]) / d->efc_R[at] : INFINITY);
      ++at;
    }
  return at;
}

int first_of(mjData const* d, int type) {
  int i = 0;
  while (i < d->nefc && d->efc_type[i] != type) ++i;
  return i;
}

/// Starts from a random place near the model's own, and from what MuJoCo makes of it in `steps` steps.
Outcome compare(gsp_test::Oracle const& oracle, gsp::CompiledModel compiled, int starts, int steps, bool one_step, double spread = 0.3) {
  mjModel* m = oracle.m();
  mjData* d = oracle.d();
  m->opt.disableflags |= mjDSBL_AUTORESET | mjDSBL_WARMSTART | mjDSBL_CONTACT;
  m->opt.enableflags &= ~mjENBL_SLEEP;
  if (m->opt.integrator == mjINT_RK4) m->opt.integrator = mjINT_EULER, compiled.option.integrator = gsp::Integrator::euler;
  compiled.option.contact = false;
  compiled.pairs.clear();
  compiled.named_pairs.clear();
  Exec const exec;
  auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
  REQUIRE(model.nv == m->nv);
  REQUIRE(model.neq == m->neq);
  auto state = gsp::make_state(exec, model);
  auto sim = gsp::make_simulation(exec, model, compiled);
  for (int e = 0; e < m->neq; ++e) CHECK(state.eq_active(0, e) == m->eq_active0[e]);
  gsp_test::Random r;
  Subject const subject{oracle, compiled};
  Outcome out;
  for (int w = 0; w < starts; ++w) {
    mj_resetData(m, d);
    for (int j = 0; j < m->njnt; ++j)
      if (m->jnt_type[j] >= mjJNT_SLIDE) d->qpos[m->jnt_qposadr[j]] += spread * (m->jnt_type[j] == mjJNT_SLIDE ? 0.1 : 1) * r();
    for (int i = 0; i < m->nv; ++i) d->qvel[i] = spread * r();
    for (int i = 0; i < m->nu; ++i) d->ctrl[i] = m->actuator_ctrllimited[i] ? 0.3 * r() * m->actuator_ctrlrange[2 * i + 1] : 0.3 * r();
    for (int k = 0; k < m->nmocap; ++k) d->mocap_pos[3 * k] += 0.05 * r();
    for (int t = 0; t < steps; ++t) mj_step(m, d);
    mj_forward(m, d);
    bool finite = true;
    for (int i = 0; i < m->nv; ++i) finite = finite && std::abs(d->qvel[i]) < 1e3;
    if (!finite) continue;  // MuJoCo itself has lost it
    gsp_test::copy_state(m, d, state);
    state.status(0) = 0;
    gsp::smooth_dynamics(exec, model, state, sim.poses, sim.dynamics);
    out.equalities += d->ne;
    for (int i = 0; i < d->nefc; ++i) {
      out.tendon_limits += d->efc_type[i] == mjCNSTR_LIMIT_TENDON;
      out.tendon_frictions += d->efc_type[i] == mjCNSTR_FRICTION_TENDON;
    }
    CHECK(compare_rows(gsp::Equalities(model, state, sim.poses, sim.dynamics), model, sim.dynamics, subject, 0, out) == d->ne);
    int const friction = first_of(d, mjCNSTR_FRICTION_TENDON), limit = first_of(d, mjCNSTR_LIMIT_TENDON);
    compare_rows(gsp::TendonFriction(model, sim.dynamics), model, sim.dynamics, subject, friction, out);
    compare_rows(gsp::TendonLimits(model, sim.dynamics), model, sim.dynamics, subject, limit, out);
    ++out.worlds;
    for (int i = 0; i < d->ne; ++i)
      if (m->eq_type[d->efc_id[i]] == mjEQ_CONNECT) out.open = std::fmax(out.open, std::abs(d->efc_pos[i]));
    if (!one_step) continue;
    auto const solver = m->opt.solver;
    int const iterations = m->opt.iterations, ls = m->opt.ls_iterations;
    double const tolerance = m->opt.tolerance, ls_tolerance = m->opt.ls_tolerance;
    m->opt.solver = mjSOL_NEWTON, m->opt.iterations = 200, m->opt.tolerance = 0, m->opt.ls_iterations = 200, m->opt.ls_tolerance = 1e-12;
    mj_step(m, d);
    m->opt.solver = solver, m->opt.iterations = iterations, m->opt.ls_iterations = ls, m->opt.tolerance = tolerance,
    m->opt.ls_tolerance = ls_tolerance;
    gsp::step(exec, model, state, sim);
    double difference = 0, norm = 1;
    for (int i = 0; i < m->nv; ++i) {
      difference = std::fmax(difference, std::isfinite(state.qvel(0, i)) ? std::abs(state.qvel(0, i) - d->qvel[i]) : INFINITY);
      norm = std::fmax(norm, std::abs(d->qvel[i]));
    }
    CHECK(state.status(0) == 0);
    out.step = std::fmax(out.step, difference / norm);
  }
  MESSAGE(out.worlds << " worlds, " << out.equalities << " rows of equalities, " << out.tendon_limits << " limits and "
                     << out.tendon_frictions << " frictions of tendons; J " << out.J << " aref " << out.aref << " R " << out.R << " step "
                     << out.step);
  CHECK(out.J <= 1e-9);
  CHECK(out.aref <= 1e-9);
  CHECK(out.R <= 1e-9);
  CHECK(out.step <= 1e-8);
  return out;
}

std::string const everything = R"(<mujoco><option timestep="0.002"/><compiler angle="radian"/><worldbody>
  <site name="post" pos=".4 .3 1.2" euler=".3 .2 .1"/>
  <body name="a" pos="0 0 1"><joint name="a1" axis="0 1 0"/><geom type="capsule" size=".03" fromto="0 0 0 .4 0 0"/><site name="sa" pos=".2 .05 .02" euler="0 .4 .3"/>
    <body name="b" pos=".4 0 0"><joint name="b1" axis="0 1 .2"/><joint name="b2" axis="1 0 0" pos="0 0 .1"/><geom type="capsule" size=".03" fromto="0 0 0 .3 .1 0"/><site name="sb" pos=".3 .1 0" euler=".2 .1 0"/></body></body>
  <body name="c" pos=".7 .1 1.1" euler=".2 .1 .5"><freejoint/><geom type="box" size=".1 .06 .04"/><site name="sc" pos=".05 0 .02"/>
    <body name="d" pos=".2 0 0"><joint name="d1" type="ball"/><geom type="capsule" size=".05 .07" pos=".01 0 .02"/><site name="sd" pos="0 0 .1"/></body></body>
  <body name="e" pos="-.4 0 1"><joint name="e1" type="slide" axis="0 0 1"/><joint name="e2" axis="0 1 0" ref=".3"/><geom size=".08" pos=".05 0 0"/><site name="se" pos=".1 0 .05"/></body>
  <body name="f" mocap="true" pos=".9 0 1.3"><geom size=".02" contype="0" conaffinity="0"/></body>
  <body name="g" pos=".9 .1 1.3"><freejoint/><geom type="box" size=".03 .05 .07"/><site name="sg" pos=".01 .02 .03" euler=".1 .2 .3"/></body>
  <geom name="roll" type="cylinder" size=".05 .2" pos="-.2 0 1.4" euler="1.5708 0 0" contype="0" conaffinity="0"/><site name="side" pos="-.2 0 1.5"/>
 </worldbody>
 <tendon><fixed name="fix"><joint joint="a1" coef="1"/><joint joint="b1" coef="-.6"/></fixed>
  <fixed name="other"><joint joint="e1" coef="2"/><joint joint="e2" coef=".5"/></fixed>
  <spatial name="rope" limited="true" range="0 .55" frictionloss=".4" solreflimit=".03 .8" solimpfriction=".8 .9 .01"><site site="post"/><site site="sb"/><site site="sd"/></spatial>
  <spatial name="round" limited="true" range=".62 .9" margin=".02"><site site="se"/><geom geom="roll" sidesite="side"/><site site="sa"/></spatial>
  <spatial name="still"><site site="post"/><site site="side"/></spatial></tendon>
 <equality>
  <connect name="c0" body1="a" body2="c" anchor=".3 .05 -.02" solref=".03 .9"/>
  <connect name="c1" body1="b" anchor=".2 0 .03" solref="-2000 -50" solimp=".8 .95 .01 .3 3"/>
  <connect name="c2" site1="sd" site2="sb" solimp=".7 .9 .2 .5 2"/>
  <weld name="w0" body1="c" body2="g" anchor=".02 .01 .03" torquescale=".7"/>
  <weld name="w1" body1="g" body2="f" relpose=".01 0 .02 1 .1 .2 .05" solref=".05 1"/>
  <weld name="w2" site1="sg" site2="post" torquescale=".2" solimp=".5 .8 .5 .4 2"/>
  <joint name="j0" joint1="b1" joint2="e2" polycoef=".1 .5 .2 -.3 .15"/>
  <joint name="j1" joint1="e1" polycoef=".05 0 0 0 0" solref=".04 1.2"/>
  <tendon name="t0" tendon1="fix" tendon2="other" polycoef="0 .4 .1 0 .05"/>
  <tendon name="t1" tendon1="rope" polycoef="-.05 0 0 0 0"/>
  <tendon name="t2" tendon1="round" tendon2="rope" polycoef="0 -.5 0 .2 0"/>
  <tendon name="t3" tendon1="still" tendon2="fix" polycoef="0 .3 -.2 0 0"/>
  <connect name="off" body1="a" body2="g" anchor="0 0 0" active="false"/></equality></mujoco>)";

}  // namespace

TEST_CASE("every form of equality, limits and dry friction of spatial tendons") {
  auto const oracle = gsp_test::load_oracle("model.xml", everything);
  auto const out = compare(oracle, gsp::compile(gsp::io::parse_mjcf(everything, "model.xml")), 20, 200, true);
  CHECK(out.worlds == 20);
  CHECK(out.equalities == 20 * (9 + 18 + 6));
  CHECK(out.tendon_limits > 5);
  CHECK(out.tendon_frictions == 20);
}

TEST_CASE("models with equalities" * doctest::test_suite("data")) {
  auto const zoo = gsp_test::data("models/zoo.txt");
  if (!zoo) {
    gsp_test::skip("models/zoo.txt is missing from GSP_DATA_DIR");
    return;
  }
  std::ifstream lines(*zoo);
  int models = 0, worlds = 0, rows = 0;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string name;
    int nq = 0, nv = 0, nbody = 0, ngeom = 0, nu = 0, neq = 0;
    if (line.empty() || line[0] == '#' || !(words >> name >> nq >> nv >> nbody >> ngeom >> nu >> neq) || neq == 0) continue;
    CAPTURE(name);
    auto const path = gsp_test::data("models/" + name);
    REQUIRE(path);
    gsp::CompiledModel compiled;
    try {
      compiled = gsp::compile(gsp::io::read_mjcf(*path));
    } catch (gsp::Error const& error) {
      MESSAGE(name << " is refused: " << error.what());  // by the reader, for reasons of its own
      continue;
    }
    MESSAGE(name);
    auto const out = compare(gsp_test::load_oracle(*path), compiled, 3, 200, nv < 60, 0.1);
    ++models;
    worlds += out.worlds;
    rows += out.equalities;
  }
  MESSAGE(models << " models, " << worlds << " worlds, " << rows << " rows");
  CHECK(models >= 9);
  CHECK(worlds > 2 * models);
}
