#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>
#include <limits>
#include <sstream>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "support/data.hpp"
#include "support/skip.hpp"

// Real models as their files are, in contact: one step of profile mujoco beside mj_step from states that MuJoCo has come to.
//
// Both solve one strictly convex problem, so what parts them is rounding: of the accelerations a (also those without constraints) and of
// v / h, from whose differences they are read here, times what the solution makes of it. That is 1e5 at most: H = 1 + Y^T B Y has a
// condition of 1 / (1 - d) <= 1e4 for an impedance d that stays below 0.9999, and ten roundings a row. (Measured: below 1e3, in the kitchen
// and mjx/sensor/model.xml 1e4.)
namespace {
using Exec = Kokkos::DefaultHostExecutionSpace;

constexpr double most_roundings = 1e5;

/// Where both need not agree so far.
struct Apart {
  char const* model;
  int same = 20;         // states with the same contacts at least, elsewhere all
  double roundings = 1;  // as many times most_roundings
};
constexpr Apart apart[] = {
    // of two convex shapes the points of a patch are not unique: tests/oracle/convex.cpp compares depths, and tests/oracle/rows.cpp steps
    // these models, too, with the contacts that MuJoCo finds
    {"dm_control/kinova/jaco_arm.xml", 0},
    {"gym_robotics/hand/manipulate_pen.xml", 6},
    {"gym_robotics/hand/manipulate_pen_touch_sensors.xml", 6},
    {"mujoco/balloons/balloons.xml", 0},
    {"mujoco/humanoid/humanoid100.xml", 12},
    {"mujoco/replicate/bunnies.xml", 0},
    {"mujoco/replicate/leaves.xml", 0},
    {"phys_bench/assets/franka_emika_panda/panda.xml", 0},
    // tendons that pass through a sphere: MuJoCo stops looking for the point where they touch it (tests/oracle/rows.cpp)
    {"mujoco/replicate/tendon.xml", 20, 1e3},
};

struct Outcome {
  int states = 0, same = 0;  // in contact; of them, where both find the same contacts
  double worst = 0;          // of the accelerations, beside max(1, largest)
  double roundings = 0;      // the same in epsilon (|a| + |v| / h)
};

/// Whether each of their points is among ours, to rounding.
template <class Contacts>
bool same_contacts(Contacts const& found, int w, mjData const* d) {
  for (int k = 0; k < d->ncon; ++k) {
    auto const& t = d->contact[k];
    if (t.efc_address < 0) continue;
    int matches = 0;
    for (int c = found.first_of(w); c < found.first_of(w) + found.count_of(w); ++c) {
      double away = std::abs(found.dist(c) - t.dist);
      for (int i = 0; i < 3; ++i) away = std::fmax(away, std::abs(found.pos(c, i) - t.pos[i]));
      for (int i = 0; i < 3; ++i) away = std::fmax(away, 0.1 * std::abs(found.frame(c, i) - t.frame[i]));
      bool const pair =
          (found.geom1(c) == t.geom[0] && found.geom2(c) == t.geom[1]) || (found.geom1(c) == t.geom[1] && found.geom2(c) == t.geom[0]);
      matches += pair && away < 1e-12;
    }
    if (matches == 0) return false;
  }
  return true;
}

Outcome compare(gsp_test::Oracle const& oracle, gsp::CompiledModel const& compiled, int states) {
  mjModel* m = oracle.m();
  mjData* d = oracle.d();
  m->opt.disableflags |= mjDSBL_AUTORESET | mjDSBL_WARMSTART;
  m->opt.enableflags &= ~mjENBL_SLEEP;
  mjOption const own = m->opt;
  Exec const exec;
  auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
  REQUIRE(model.nv == m->nv);
  REQUIRE(model.nq == m->nq);
  std::vector<double> qpos, qvel, act, ctrl, mocap_pos, mocap_quat;
  gsp_test::Random r;
  auto const keep = [](std::vector<double>& to, double const* from, int n) { to.insert(to.end(), from, from + n); };
  int found = 0;
  mj_resetData(m, d);
  if (m->nkey > 0) mj_resetDataKeyframe(m, d, 0);
  for (int step = 0; step < 2000 && found < states; ++step) {
    if (step % 20 == 0)
      for (int i = 0; i < m->nu; ++i) {
        double const lo = m->actuator_ctrllimited[i] ? m->actuator_ctrlrange[2 * i] : -1,
                     hi = m->actuator_ctrllimited[i] ? m->actuator_ctrlrange[2 * i + 1] : 1;
        d->ctrl[i] = lo + (hi - lo) * (0.5 + 0.25 * r());
      }
    mj_step(m, d);
    bool finite = true;
    for (int i = 0; i < m->nv; ++i) finite = finite && std::abs(d->qvel[i]) < 1e3;
    if (!finite) break;
    if (step % 10 != 9 || d->ncon == 0) continue;
    keep(qpos, d->qpos, m->nq), keep(qvel, d->qvel, m->nv), keep(act, d->act, m->na), keep(ctrl, d->ctrl, m->nu);
    keep(mocap_pos, d->mocap_pos, 3 * m->nmocap), keep(mocap_quat, d->mocap_quat, 4 * m->nmocap);
    ++found;
  }
  Outcome out;
  out.states = found;
  if (found == 0) return out;
  auto state = gsp::make_state(exec, model, {.worlds = found});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = found});
  auto const copy = [](auto const& to, std::vector<double> const& from) { std::copy(from.begin(), from.end(), to.data()); };
  copy(state.qpos, qpos), copy(state.qvel, qvel), copy(state.act, act), copy(state.ctrl, ctrl);
  copy(state.mocap_pos, mocap_pos), copy(state.mocap_quat, mocap_quat);
  gsp::step(exec, model, state, sim, {.steps = 1, .poses = false});
  auto const at = [](std::vector<double> const& from, int n, int w) { return from.data() + std::size_t(n) * std::size_t(w); };
  for (int w = 0; w < found; ++w) {
    mj_resetData(m, d);
    auto const put = [&](double* to, std::vector<double> const& from, int n) { std::copy(at(from, n, w), at(from, n, w) + n, to); };
    put(d->qpos, qpos, m->nq), put(d->qvel, qvel, m->nv), put(d->act, act, m->na), put(d->ctrl, ctrl, m->nu);
    put(d->mocap_pos, mocap_pos, 3 * m->nmocap), put(d->mocap_quat, mocap_quat, 4 * m->nmocap);
    m->opt = own;
    m->opt.solver = mjSOL_NEWTON, m->opt.iterations = 1000, m->opt.tolerance = 0, m->opt.ls_iterations = 200, m->opt.ls_tolerance = 1e-12;
    std::vector<double> const before(d->qvel, d->qvel + m->nv);
    mj_step(m, d);
    m->opt = own;
    // With RK4 the contacts of both are those of the last evaluation.
    int rows = 0;  // without those whose impulses are given (ContactAdhesion)
    for (int r = sim.rows.first(w); r < sim.rows.first(w) + sim.rows.count(w); ++r) {
      auto const& row = sim.rows.row(r);
      rows += row.friction_of >= 0 || !(row.lower == row.upper && row.lower != 0);
    }
    if (rows != d->nefc || !same_contacts(sim.contacts, w, d)) continue;
    ++out.same;
    double largest = 1, rounded = 0, worst = 0;
    for (int i = 0; i < m->nv; ++i) {
      double const theirs = (d->qvel[i] - before[std::size_t(i)]) / m->opt.timestep,
                   mine = (state.qvel(w, i) - before[std::size_t(i)]) / m->opt.timestep;
      largest = std::fmax(largest, std::abs(theirs));
      rounded = std::fmax(rounded, std::fmax(std::abs(d->qacc_smooth[i]), std::abs(before[std::size_t(i)]) / m->opt.timestep));
      worst = std::fmax(worst, std::isfinite(mine) ? std::abs(mine - theirs) : INFINITY);
    }
    out.worst = std::fmax(out.worst, worst / largest);
    out.roundings = std::fmax(out.roundings, worst / (std::numeric_limits<double>::epsilon() * (largest + rounded)));
    CHECK(state.status(w) == 0);
  }
  return out;
}

}  // namespace

// Of data/models/zoo.txt the 80 that can move with at most 700 degrees of freedom (20 s); GSP_TEST_ZOO=all: the larger ones too, 85 (two
// minutes, half of them one sand castle of 3,294); GSP_TEST_ZOO=car: those with this in their names. None is refused.
TEST_CASE("one step of real models in contact" * doctest::test_suite("data")) {
  auto const zoo = gsp_test::data("models/zoo.txt");
  if (!zoo) {
    gsp_test::skip("models/zoo.txt is missing from GSP_DATA_DIR");
    return;
  }
  char const* const choice = std::getenv("GSP_TEST_ZOO");
  bool const all = choice && std::string(choice) == "all";
  std::ifstream lines(*zoo);
  int models = 0, states = 0, same = 0;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string name;
    int nq = 0, nv = 0, nbody = 0, ngeom = 0;
    if (line.empty() || line[0] == '#' || !(words >> name >> nq >> nv >> nbody >> ngeom) || nv == 0) continue;
    if (choice && !all && name.find(choice) == std::string::npos) continue;
    if (!choice && nv > 700) continue;
    CAPTURE(name);
    auto const path = gsp_test::data("models/" + name);
    REQUIRE(path);
    auto const compiled = gsp::compile(gsp::io::read_mjcf(*path, {.skip_visuals = true}));
    auto const out = compare(gsp_test::load_oracle(*path), compiled, 20);
    MESSAGE(name << ": " << out.same << " of " << out.states << " states, worst " << out.worst << ", " << out.roundings << " roundings");
    auto const* const other = std::find_if(std::begin(apart), std::end(apart), [&](Apart const& a) { return name == a.model; });
    bool const found = other != std::end(apart);
    CHECK(out.same >= std::min(out.states, found ? other->same : out.states));
    CHECK(out.roundings <= most_roundings * (found ? other->roundings : 1));
    ++models;
    states += out.states;
    same += out.same;
  }
  MESSAGE(models << " models, " << states << " states in contact, " << same << " with the same contacts");
  CHECK(models >= (all ? 85 : choice ? 1 : 80));
  CHECK((choice && !all ? true : states >= (all ? 850 : 750)));  // MuJoCo's own: 890 and 790
}
