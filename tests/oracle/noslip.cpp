#include <doctest/doctest.h>

#include <cmath>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "oracle/rows.hpp"
#include "support/data.hpp"
#include "support/skip.hpp"

// noslip beside MuJoCo's, of its own contacts, in both cones. Both solve one convex problem before it, to rounding; each sweep of both
// takes the same blocks in the same order to their least costs, so they agree after three sweeps and, what is least being one point, after
// many. MuJoCo stops within an ellipsoid at |s|^2 - r^2 < 1e-10 N^2: 1e-10 beside forces of 1 N, 1e-7 where one of 0.03 N counts. The bar
// is 1e-6 of max(1, the largest acceleration). Where the block of a contact's friction has a determinant below 1e-10 (in units of mu:
// something that moves in a plane only, say) MuJoCo finds no impulses, and keeps those that slip. Ours stick: where the two are apart, one
// of MuJoCo's contacts is such, and our cost is lower.
namespace {
using Exec = Kokkos::DefaultHostExecutionSpace;
using Mem = Exec::memory_space;
using Numbers = std::vector<double>;
constexpr double bar = 1e-6;

/// What forces of MuJoCo's rows do: accelerations, and the cost |M^-1/2 J^T f|^2 / 2 + b . f that sweeps lower.
struct Effect {
  Numbers qacc;
  double cost = 0;
  Effect(mjModel const* m, mjData* d, Numbers const& force) : qacc(d->qacc_smooth, d->qacc_smooth + m->nv) {
    Numbers joint(qacc.size()), change(qacc.size());
    for (int r = 0; r < d->nefc; ++r) {
      auto const J = gsp_test::row_of(m, d, r);
      double b = -d->efc_aref[r];
      for (std::size_t i = 0; i < J.size(); ++i) joint[i] += J[i] * force[std::size_t(r)], b += J[i] * d->qacc_smooth[i];
      cost += force[std::size_t(r)] * b;
    }
    mj_solveM(m, d, change.data(), joint.data(), 1);
    for (std::size_t i = 0; i < qacc.size(); ++i) qacc[i] += change[i], cost += 0.5 * joint[i] * change[i];
  }
};

/// Forces of MuJoCo's rows in the state that mj_forward has left, solved by us.
Numbers forces(mjModel const* m, mjData const* d, gsp::CompiledModel const& compiled) {
  Exec const exec;
  auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
  REQUIRE(model.nv == m->nv);
  auto state = gsp::make_state(exec, model);
  auto sim = gsp::make_simulation(exec, model, compiled);
  gsp_test::copy_state(m, d, state);
  gsp::smooth_dynamics(exec, model, state, sim.poses, sim.dynamics);
  double parameters = 0;
  auto const contacts = gsp_test::contacts_of(d, sim.collision, parameters);
  CHECK(parameters < 1e-9);
  do {
    gsp::assemble(exec, model, state, sim.dynamics,
                  gsp::model_constraints(model, state, sim.poses, sim.dynamics, sim.collision, contacts, sim.cone), sim.rows, sim.impulses,
                  sim.progress);
  } while (gsp::grow(exec, sim.rows, sim.impulses, sim.progress));
  gsp::grow(exec, sim.rows, sim.newton);
  gsp::newton(exec, sim.rows, sim.impulses, sim.solution, sim.newton, sim.progress);
  gsp::noslip(exec, sim.rows, sim.impulses, sim.solution, sim.progress, sim.noslip);
  CHECK(state.status(0) == 0);
  CHECK(sim.rows.count(0) == d->nefc);
  double const* const p = sim.impulses.p[sim.impulses.parity()].data() + sim.rows.first(0);
  Numbers out(p, p + d->nefc);
  for (double& f : out) f /= model.timestep;
  return out;
}

/// Whether MuJoCo gives up on a contact's ellipsoid.
bool gives_up(mjModel const* m, mjData* d) {
  Numbers root(std::size_t(m->nv));
  for (int i = 0; i < m->nv; ++i) root[std::size_t(i)] = std::sqrt(d->qLDiagInv[i]);
  for (int c = 0; c < d->ncon; ++c) {
    auto const& t = d->contact[c];
    if (t.efc_address < 0 || t.dim == 1 || !(d->efc_force[t.efc_address] > 0)) continue;
    std::vector<Numbers> half;  // orthogonalised one after the other: the determinant is the product of what is left
    double determinant = 1;
    for (int k = 0; k < t.dim - 1; ++k) {
      auto const J = gsp_test::row_of(m, d, t.efc_address + 1 + k);
      Numbers h(J.size());
      mj_solveM2(m, d, h.data(), J.data(), root.data(), 1);
      for (double& x : h) x *= t.friction[k];
      for (auto const& q : half) {
        double const along = mju_dot(h.data(), q.data(), m->nv), square = mju_dot(q.data(), q.data(), m->nv);
        if (square > 0) mju_addToScl(h.data(), q.data(), -along / square, m->nv);
      }
      determinant *= mju_dot(h.data(), h.data(), m->nv);
      half.push_back(h);
    }
    if (determinant < 1e-10) return true;
  }
  return false;
}

struct Outcome {
  int states = 0, given_up = 0;
  double worst = 0, change = 0;  // accelerations, relative: apart, and what noslip changes in MuJoCo's
  double dearer = -INFINITY;     // cost less MuJoCo's, as a share of it
};

Outcome compare(gsp_test::Oracle const& oracle, gsp::CompiledModel compiled, int sweeps) {
  mjModel* m = oracle.m();
  mjData* d = oracle.d();
  m->opt.enableflags &= ~mjENBL_SLEEP;
  m->opt.disableflags |= mjDSBL_WARMSTART;
  mjOption const own = m->opt;
  gsp_test::Random r;
  mj_resetData(m, d);
  if (m->nkey > 0) mj_resetDataKeyframe(m, d, 0);
  for (int i = 0; i < m->nv; ++i) d->qvel[i] += 0.3 * r();
  Outcome out;
  for (int step = 1; step <= 300; ++step) {
    if (step % 20 == 1)
      for (int i = 0; i < m->nu; ++i) {
        double const lo = m->actuator_ctrllimited[i] ? m->actuator_ctrlrange[2 * i] : -1,
                     hi = m->actuator_ctrllimited[i] ? m->actuator_ctrlrange[2 * i + 1] : 1;
        d->ctrl[i] = lo + (hi - lo) * (0.5 + 0.5 * r());
      }
    mj_step(m, d);
    if (step % 100 != 0) continue;
    for (mjtCone const cone : {mjCONE_PYRAMIDAL, mjCONE_ELLIPTIC}) {
      m->opt.cone = cone;
      m->opt.solver = mjSOL_NEWTON, m->opt.iterations = 1000, m->opt.tolerance = 0, m->opt.ls_iterations = 200, m->opt.ls_tolerance = 1e-12;
      mj_forward(m, d);
      Numbers const slipping(d->qacc, d->qacc + m->nv);
      compiled.option.cone = gsp::FrictionCone(cone);
      compiled.option.noslip_iterations = m->opt.noslip_iterations = sweeps;
      compiled.option.noslip_tolerance = m->opt.noslip_tolerance = 0;
      mj_forward(m, d);
      if (d->nefc == 0) continue;
      Effect const mine(m, d, forces(m, d, compiled)), theirs(m, d, Numbers(d->efc_force, d->efc_force + d->nefc));
      double off = 0, change = 0, most = 1;
      for (std::size_t i = 0; i < slipping.size(); ++i) {
        gsp_test::raise(off, std::abs(mine.qacc[i] - d->qacc[i]));
        change = std::fmax(change, std::abs(slipping[i] - d->qacc[i]));
        most = std::fmax(most, std::abs(d->qacc[i]));
      }
      ++out.states;
      out.change = std::fmax(out.change, change / most);
      double const dearer = (mine.cost - theirs.cost) / std::abs(theirs.cost);
      out.dearer = std::fmax(out.dearer, dearer);
      bool const given_up = off > bar * most && dearer < 0 && cone == mjCONE_ELLIPTIC && gives_up(m, d);
      out.given_up += given_up;
      if (!given_up) out.worst = std::fmax(out.worst, off / most);
      m->opt = own;
    }
  }
  return out;
}

}  // namespace

TEST_CASE("real models" * doctest::test_suite("data")) {
  int states = 0, given_up = 0;
  double change = 0;
  for (std::string const name :
       {"dm_control/suite/humanoid.xml", "dm_control/suite/quadruped.xml", "dm_control/suite/hopper.xml", "dm_control/suite/walker.xml",
        "mujoco/humanoid/humanoid.xml", "mujoco/car/car.xml", "mujoco/replicate/cylinder.xml", "mujoco/replicate/bowl.xml",
        "mujoco/mjx/sensor/sensor.xml", "mujoco/shadow_hand/right_hand.xml", "gym_robotics/hand/manipulate_pen.xml",
        "phys_bench/assets/franka_emika_panda/mjx_single_cube.xml", "genesis/three_joint_link/three_joint_link.xml",
        "genesis/rope_ball/rope_ball.xml", "mujoco_warp/kitchen/kitchen.xml"}) {
    auto const path = gsp_test::data("models/" + name);
    if (!path) {
      gsp_test::skip("models/" + name + " is missing from GSP_DATA_DIR");
      return;
    }
    CAPTURE(name);
    auto const compiled = gsp::compile(gsp::io::read_mjcf(*path, {.skip_visuals = true}));
    for (int const sweeps : {3, 1000}) {
      CAPTURE(sweeps);
      auto const out = compare(gsp_test::load_oracle(*path), compiled, sweeps);
      MESSAGE(name << ", " << sweeps << " sweeps: worst " << out.worst << " in " << out.states - out.given_up << " of " << out.states
                   << " states, noslip changes " << out.change << ", cost less MuJoCo's " << out.dearer);
      CHECK(out.worst < bar);
      CHECK(out.dearer < 1e-9);
      states += out.states, given_up += out.given_up;
      change = std::fmax(change, out.change);
    }
  }
  MESSAGE(states << " states, in " << given_up << " of them MuJoCo gives up on a contact; noslip changes " << change);
  CHECK(change > 0.1);
}

// A box on a ramp that holds it four times over, as each pair of edges has its share of the normal alone: it creeps where friction is soft,
// and holds where noslip has come to its end. Steps of both libraries from rest. Edges of a pyramid take many sweeps, and stop early at the
// tolerance that files have: so does MuJoCo. The box rests in four points, whose order may differ: speeds to 1e-7 m/s.
TEST_CASE("a box on a ramp creeps, and holds with noslip") {
  enum { creeps, between, holds };
  struct Case {
    std::string cone, noslip;
    int what;
  };
  for (auto const& [cone, noslip, what] :
       {Case{"pyramidal", "", creeps}, Case{"elliptic", "", creeps}, Case{"elliptic", "noslip_iterations=\"10\"", holds},
        Case{"pyramidal", "noslip_iterations=\"10\"", between},
        Case{"pyramidal", "noslip_iterations=\"1000\" noslip_tolerance=\"0\"", holds}}) {
    INFO(cone << " " << noslip);
    std::string const text = "<mujoco><option gravity=\"2.3792747 0 -9.5170989\" cone=\"" + cone + "\" " + noslip +
                             "/><worldbody><geom type=\"plane\" size=\"5 5 1\"/><body pos=\"0 0 .1\"><freejoint/>"
                             "<geom type=\"box\" size=\".1 .1 .1\"/></body></worldbody></mujoco>";
    auto const oracle = gsp_test::load_oracle("model.xml", text);
    auto const compiled = gsp::compile(gsp::io::parse_mjcf(text, "model.xml"));
    Exec const exec;
    auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
    auto state = gsp::make_state(exec, model);
    auto sim = gsp::make_simulation(exec, model, compiled);
    gsp::step(exec, model, state, sim, {.steps = 500});
    double const start = state.qpos(0, 0);
    gsp::step(exec, model, state, sim, {.steps = 500});
    double const speed = state.qpos(0, 0) - start;  // in a second
    double their_start = 0;
    for (int i = 0; i < 1000; ++i) {
      if (i == 500) their_start = oracle.d()->qpos[0];
      mj_step(oracle.m(), oracle.d());
    }
    double const their_speed = oracle.d()->qpos[0] - their_start;
    MESSAGE(cone << " " << noslip << ": " << speed << " m/s, MuJoCo " << their_speed);
    CHECK(std::abs(speed - their_speed) < 1e-7);
    if (what == creeps) CHECK(speed > 1e-4);
    if (what == holds) CHECK(std::abs(speed) < 1e-8);
  }
}
