#include "oracle/rows.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>
#include <memory>
#include <sstream>
#include <utility>
#include <vector>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "support/data.hpp"
#include "support/skip.hpp"

// All rows of the models of zoo.txt beside MuJoCo's, one by one and in its order: its state after 200 steps, its own contacts in place of
// ours (what of them the pool holds; friction, solref, solimp and condim are our pairs', and compared), in both cones; what `assemble`
// wrote in profile `mujoco` beside efc_*. Nothing of efc_* is left out.
//   J     rows hold Y = J L^-1 D^-1/2. J = Y D^1/2 L is multiplied, not solved for: D cancels, and an entry is off by as many roundings as
//         its row has entries, times |J| |L^-1| |L|, L the unit triangle: lever arms and ratios of masses, 1e3 at most:
//         1e-11 of the largest entry.
//   A     |Y|^2 beside |M^-1/2 J^T|^2 of MuJoCo's own matrix and factor: what J alone would not show. Two factors of one matrix are
//         apart by rounding times its condition, 1e6 at most where a row meets light ends of heavy robots. Of A + R: of rows along
//         which nothing can move (a weld across a flat mechanism) A is rounding alone.
//   aref  b = J (v + h a) - zeta and zeta = J v + h aref: aref = (J (v + h a) - b - J v) / h, to rounding of |J| |v + h a| / h
//   R     the compliance: to rounding
// The bar of all is 1e-9, but for rows of tendons that pass through a sphere or cylinder (a sidesite inside of it): MuJoCo stops looking
// for the place where they touch while the slope of their length along the surface is still up to 5e-8 (measured at its points), ours go on
// to rounding: 1e-6, as in tests/oracle/dynamics.cpp. Bounds, mu and ids are compared besides.
//   a     of these rows, solved by Newton's method and integrated, (v+ - v) / h beside MuJoCo's step from the same state with its own
//         Newton's method (tolerance 0, without noslip): contacts are the same, so nothing but solver and integrator can part them. An
//         error e of aref is one of e in a along a row, and 1 / (1 - d) <= 1e4 of that by the condition of the problem; 1e5 roundings as in
//         tests/oracle/contact_steps.cpp: 1e-6 of max(1, largest |a|). Both cones, Euler and implicitfast; the contacts that RK4 finds
//         within a step are no list that we could be given: constraints.cpp and contact_steps.cpp step with it.
namespace {
using Exec = Kokkos::DefaultHostExecutionSpace;
using Mem = Exec::memory_space;
using gsp_test::apart, gsp_test::raise, gsp_test::row_of;
using Sim = gsp::Simulation<double, Mem>;

constexpr double bar = 1e-9, inside_bar = 1e-6, solved_bar = 1e-6;

struct Outcome {
  int rows[mjCNSTR_CONTACT_ELLIPTIC + 1] = {};  // by kind
  double J = 0, A = 0, aref = 0, R = 0, parameters = 0;
  double inside = 0;  // J, A and aref of tendons that pass inside
  double solved = 0;  // accelerations
  std::string fault;  // the first that is no number
  void blame(std::string const& what) {
    if (fault.empty()) fault = what;
  }
};

/// J of a row of ours, dense, J = Y D^1/2 L from the root on: each entry gives its share back to its ancestors. Besides J (v + h a).
std::vector<double> row_of(gsp::Model<double, Mem> const& model, Sim const& sim, gsp::Row<double> const& row, double& free_rate) {
  std::vector<double> J(std::size_t(model.nv), 0.);
  double const* y = sim.rows.Y.data() + row.first_entry;
  free_rate = 0;
  for (auto const& segment : row.segment) {
    if (segment.count == 0) continue;
    int const tree = model.dof_tree(segment.dof0);
    gsp::Archetype const& a = model.archetypes(model.tree_archetype(tree));
    auto const items = sim.dynamics.tree(model, 0, tree);
    for (int i = 0; i < segment.count; ++i) {
      int const dof = segment.list < 0 ? i : model.ints(segment.list + i), adr = model.ints(a.row_adr + dof);
      double const value = *y++ / std::sqrt(items[items.at.inverse_diagonal + dof]);
      J[std::size_t(segment.dof0 + dof)] += value;
      for (int e = adr; e < model.ints(a.row_adr + dof + 1) - 1; ++e)
        J[std::size_t(segment.dof0 + model.ints(a.row_col + e))] += items[items.at.factor + e] * value;
    }
    for (int i = 0; i < a.nv; ++i) free_rate += J[std::size_t(segment.dof0 + i)] * items[items.at.velocity + i];
  }
  return J;
}

bool passes_inside(mjModel const* m, mjData const* d, int tendon) {
  for (int w = m->tendon_adr[tendon]; w < m->tendon_adr[tendon] + m->tendon_num[tendon]; ++w)
    if ((m->wrap_type[w] == mjWRAP_SPHERE || m->wrap_type[w] == mjWRAP_CYLINDER) && m->wrap_prm[w] >= 0 &&
        mju_dist3(d->site_xpos + 3 * int(m->wrap_prm[w]), d->geom_xpos + 3 * m->wrap_objid[w]) < m->geom_size[3 * m->wrap_objid[w]])
      return true;
  return false;
}

enum { equality, joint_friction, tendon_friction, joint_limit, tendon_limit, adhesion, contact };  // model_constraints
/// Which of their kinds and objects a row of ours is; elements: of a contact.
struct Named {
  int kind, id;
};
Named name_of(gsp::Model<double, Mem> const& model, gsp::Row<double> const& row, mjData const* d, int elements, bool pyramids) {
  int const k = row.element;
  switch (row.type) {
    case equality:
      return {mjCNSTR_EQUALITY, k};
    case joint_friction:
      return {mjCNSTR_FRICTION_DOF, model.friction_dofs(k)};
    case tendon_friction:
      return {mjCNSTR_FRICTION_TENDON, model.friction_tendons(k)};
    case joint_limit:
      return {mjCNSTR_LIMIT_JOINT, model.limited_joints(k / 2)};
    case tendon_limit:
      return {mjCNSTR_LIMIT_TENDON, model.limited_tendons(k / 2)};
    case contact:
      break;
    default:
      return {-1, -1};
  }
  auto const& t = d->contact[k / elements];
  return {t.dim == 1 ? mjCNSTR_CONTACT_FRICTIONLESS : pyramids ? mjCNSTR_CONTACT_PYRAMIDAL : mjCNSTR_CONTACT_ELLIPTIC, k / elements};
}

void compare(mjModel const* m, mjData* d, gsp::Model<double, Mem> const& model, Sim const& sim, Outcome& out) {
  double const h = model.timestep;
  bool const pyramids = sim.cone == gsp::FrictionCone::pyramidal;
  int const elements = pyramids ? (sim.collision.most_edges + gsp::most_element_rows - 1) / gsp::most_element_rows : 1;
  int const first = sim.rows.first(0), count = sim.rows.count(0);
  int at = 0;
  std::vector<double> half(std::size_t(m->nv)), root(std::size_t(m->nv));
  for (int i = 0; i < m->nv; ++i) root[std::size_t(i)] = std::sqrt(d->qLDiagInv[i]);
  for (int r = first; r < first + count; ++r) {
    auto const& row = sim.rows.row(r);
    if (row.type == adhesion) continue;  // a force, none of MuJoCo's rows
    if (at == d->nefc) {
      out.blame("more rows than MuJoCo's " + std::to_string(d->nefc));
      return;
    }
    std::string const place = "row " + std::to_string(at) + " of kind " + std::to_string(d->efc_type[at]);
    auto const [kind, id] = name_of(model, row, d, elements, pyramids);
    if (kind != d->efc_type[at] || id != d->efc_id[at])
      return out.blame(place + ", object " + std::to_string(d->efc_id[at]) + ": ours is of kind " + std::to_string(kind) + ", object " +
                       std::to_string(id));
    ++out.rows[kind];
    double free_rate = 0, rate = 0, J_off = 0, J_most = 1, free_terms = 0, A = 0, A_own = 0;
    auto const J = row_of(model, sim, row, free_rate);
    auto const theirs = gsp_test::row_of(m, d, at);
    for (std::size_t i = 0; i < J.size(); ++i) {
      rate += theirs[i] * d->qvel[i];
      free_terms += std::abs(theirs[i]) * (std::abs(d->qvel[i]) + h * std::abs(d->qacc_smooth[i]));
      raise(J_off, std::abs(J[i] - theirs[i]));
      J_most = std::fmax(J_most, std::abs(theirs[i]));
    }
    bool const of_tendon = kind == mjCNSTR_LIMIT_TENDON || kind == mjCNSTR_FRICTION_TENDON, inside = of_tendon && passes_inside(m, d, id);
    raise(inside ? out.inside : out.J, J_off / J_most);
    for (int e = 0; e < row.segment[0].count + row.segment[1].count; ++e) A_own += std::pow(sim.rows.Y(row.first_entry + e), 2);
    mj_solveM2(m, d, half.data(), theirs.data(), root.data(), 1);
    for (double const x : half) A += x * x;
    raise(inside ? out.inside : out.A, std::abs(A_own - A) / (A + d->efc_R[at]));
    double const aref = (free_rate - row.bias - rate) / h;
    raise(inside ? out.inside : out.aref,
          std::abs(aref - d->efc_aref[at]) / std::fmax(1, std::fmax(std::abs(d->efc_aref[at]), free_terms / h)));
    raise(out.R, apart(row.compliance, d->efc_R[at]));
    bool const friction_loss = kind == mjCNSTR_FRICTION_DOF || kind == mjCNSTR_FRICTION_TENDON;
    bool const tangent = kind == mjCNSTR_CONTACT_ELLIPTIC && row.friction_of >= 0;
    double const most = friction_loss ? h * d->efc_frictionloss[at] : INFINITY;
    double const least = friction_loss ? -most : kind == mjCNSTR_EQUALITY ? -INFINITY : 0;
    if (tangent) {
      int const axis = at - d->contact[id].efc_address - 1;
      if (axis < 0 || apart(row.mu, d->contact[id].friction[axis]) > bar) out.blame(place + ": mu is " + std::to_string(row.mu));
    } else if (!(row.lower == least || apart(row.lower, least) < bar) || !(row.upper == most || apart(row.upper, most) < bar)) {
      out.blame(place + ": bounds are " + std::to_string(row.lower) + ", " + std::to_string(row.upper));
    }
    ++at;
  }
  if (at != d->nefc)
    out.blame(std::to_string(d->nefc - at) + " of MuJoCo's rows are missing, the first of kind " + std::to_string(d->efc_type[at]));
}

/// What the rows that lie there give, beside MuJoCo's step.
void compare_solved(mjModel* m, mjData const* d, gsp::Model<double, Mem> const& model, gsp::State<double, Mem>& state, Sim& sim,
                    Outcome& out) {
  Exec const exec;
  gsp::grow(exec, sim.rows, sim.newton);
  gsp::newton(exec, sim.rows, sim.impulses, sim.solution, sim.newton, sim.progress);
  gsp::integrate(exec, model, state, sim.dynamics, sim.progress, sim.solution);
  mjOption const own = m->opt;
  m->opt.solver = mjSOL_NEWTON, m->opt.iterations = 1000, m->opt.tolerance = 0, m->opt.ls_iterations = 200, m->opt.ls_tolerance = 1e-12;
  m->opt.noslip_iterations = 0;
  m->opt.disableflags |= mjDSBL_AUTORESET | mjDSBL_WARMSTART;
  std::unique_ptr<mjData, void (*)(mjData*)> const next(mj_copyData(nullptr, m, d), mj_deleteData);
  mj_step(m, next.get());
  m->opt = own;
  double largest = 1, worst = 0;
  for (int i = 0; i < m->nv; ++i) {
    largest = std::fmax(largest, std::abs(next->qvel[i] - d->qvel[i]) / model.timestep);
    raise(worst, std::abs(state.qvel(0, i) - next->qvel[i]) / model.timestep);
  }
  if (state.status(0) != 0) out.blame(gsp::status::text(state.status(0)));
  raise(out.solved, worst / largest);
}

/// Each cone with one integrator, or with both.
Outcome compare(gsp_test::Oracle const& oracle, gsp::CompiledModel compiled, bool both) {
  mjModel* m = oracle.m();
  mjData* d = oracle.d();
  m->opt.enableflags &= ~mjENBL_SLEEP;
  gsp_test::Random r;
  if (m->nkey > 0)
    mj_resetDataKeyframe(m, d, 0);
  else
    mj_resetData(m, d);
  for (int i = 0; i < m->nv; ++i) d->qvel[i] += 0.3 * r();
  for (int step = 0; step < 200; ++step) {
    if (step % 20 == 0)
      for (int i = 0; i < m->nu; ++i) {
        double const lo = m->actuator_ctrllimited[i] ? m->actuator_ctrlrange[2 * i] : -1,
                     hi = m->actuator_ctrllimited[i] ? m->actuator_ctrlrange[2 * i + 1] : 1;
        d->ctrl[i] = lo + (hi - lo) * (0.5 + 0.5 * r());
      }
    mj_step(m, d);  // which starts anew where it blows up: two models of mjx do
  }
  Outcome out;
  for (int i = 0; i < m->nv; ++i)
    if (!(std::abs(d->qvel[i]) < 1e10)) out.blame("MuJoCo's velocities are no numbers");
  Exec const exec;
  using Pair = std::pair<mjtCone, mjtIntegrator>;
  std::vector<Pair> pairs{{mjCONE_PYRAMIDAL, mjINT_EULER}, {mjCONE_ELLIPTIC, mjINT_IMPLICITFAST}};
  if (both) pairs.insert(pairs.end(), {{mjCONE_PYRAMIDAL, mjINT_IMPLICITFAST}, {mjCONE_ELLIPTIC, mjINT_EULER}});
  for (auto const& [cone, integrator] : pairs) {
    m->opt.cone = cone, m->opt.integrator = integrator;
    compiled.option.cone = gsp::FrictionCone(cone), compiled.option.integrator = gsp::Integrator(integrator);
    mj_forward(m, d);
    if (d->warning[mjWARN_CONTACTFULL].number || d->warning[mjWARN_CNSTRFULL].number) out.blame("MuJoCo's memory is full");
    auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
    REQUIRE(model.nv == m->nv);
    REQUIRE(model.nq == m->nq);
    auto state = gsp::make_state(exec, model);
    auto sim = gsp::make_simulation(exec, model, compiled);
    gsp_test::copy_state(m, d, state);
    gsp::smooth_dynamics(exec, model, state, sim.poses, sim.dynamics);
    auto const contacts = gsp_test::contacts_of(d, sim.collision, out.parameters);
    do {
      gsp::assemble(exec, model, state, sim.dynamics,
                    gsp::model_constraints(model, state, sim.poses, sim.dynamics, sim.collision, contacts, gsp::FrictionCone(cone)),
                    sim.rows, sim.impulses, sim.progress);
    } while (gsp::grow(exec, sim.rows, sim.impulses, sim.progress));
    if (state.status(0) != 0) out.blame(gsp::status::text(state.status(0)));
    if (out.fault.empty()) compare(m, d, model, sim, out);
    if (out.fault.empty()) compare_solved(m, d, model, state, sim, out);
  }
  return out;
}

}  // namespace

// What the zoo has little of: condim 4 and 6, impratio, friction of tendons, surfaces that move, adhesion over a gap, friction of named
// pairs with a softness of its own, welds of sites, stiffness in place of time constants.
TEST_CASE("rows of all kinds") {
  std::string const text = R"(<mujoco><option timestep=".003" impratio="4"/><default><site size=".01"/></default><worldbody>
    <geom name="floor" type="plane" size="5 5 1" friction=".7 .02 .003" surfacevel=".4 -.2 0 0 0 .5"/>
    <body name="cart" pos="0 0 .06"><freejoint/><geom type="box" size=".1 .2 .05" margin=".002"/>
      <body pos=".15 0 0"><joint name="a" axis="0 1 0" range="-10 10" margin=".3" frictionloss=".4" damping=".1" solreflimit="-400 -9"/><geom type="capsule" size=".03 .1" pos="0 0 .1" condim="6" solref="-800 -20"/>
        <body pos="0 0 .25"><joint name="b" axis="1 0 0" range="-10 10" frictionloss=".2" armature=".01" solreffriction=".03 .9" solimpfriction=".8 .9 .002"/><geom size=".05" condim="4"/><site name="s1"/></body></body>
      <body pos="-.17 0 0"><joint name="c" type="ball" range="0 20" margin=".5"/><geom name="foot" size=".055" solimp=".8 .99 .01 .3 3"/></body></body>
    <body name="ball" pos=".6 0 .09"><freejoint/><geom name="ball" size=".1" condim="6" friction=".5 .05 .01"/><site name="s3" pos=".05 0 0"/></body>
    <body pos="-.6 0 .0795"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><geom size=".08" condim="4" adhesion="3" gap=".05"/></body>
    <body pos="-.6 .5 .11"><joint type="slide" axis="1 0 0"/><geom size=".1" condim="4" adhesion="3" gap=".05"/></body>
    <body pos="-.6 1 .05"><joint type="slide" axis="0 0 1"/><geom type="cylinder" size=".08 .05" condim="1" solref=".001 1"/></body>
    <body name="w1" pos="0 1 .5"><joint name="w1" axis="1 0 0"/><geom size=".05" pos="0 .2 0"/><site name="p1" pos="0 .1 0" euler="10 20 30"/></body>
    <body name="w2" pos="0 1.4 .5"><joint name="w2" axis="1 .1 0" limited="false"/><geom size=".05" pos="0 -.2 0"/><site name="p2" pos="0 -.1 0"/></body>
    <body name="held" pos="1 1 1"><freejoint/><geom type="box" size=".1 .05 .07"/></body>
  </worldbody><contact><pair geom1="floor" geom2="foot" condim="6" friction=".5 .9 .02 .004 .001" solreffriction=".03 .9"/></contact>
  <tendon><fixed name="t" limited="true" range="-.05 .05" frictionloss=".3" margin=".2"><joint joint="a" coef="1"/><joint joint="b" coef="-.7"/></fixed>
    <spatial name="rope" limited="true" range="0 .3" frictionloss=".1"><site site="s1"/><site site="s3"/></spatial></tendon>
  <equality><connect body1="w1" body2="w2" anchor="0 .2 0"/><weld site1="p1" site2="p2" torquescale=".5"/><weld body1="held" solref=".05 .8" relpose="1 1 1 1 0 .1 0"/>
    <joint joint1="w1" joint2="w2" polycoef=".1 1 .5 .2 .1" solimp=".9 .95 .3"/><tendon tendon1="t" tendon2="rope" polycoef="0 .5 .1 0 0"/></equality></mujoco>)";
  auto const out = compare(gsp_test::load_oracle("model.xml", text), gsp::compile(gsp::io::parse_mjcf(text, "model.xml")), true);
  MESSAGE("J " << out.J << ", A " << out.A << ", aref " << out.aref << ", R " << out.R << ", parameters " << out.parameters << ", solved "
               << out.solved);
  CHECK(out.solved <= solved_bar);
  CHECK(out.fault == "");
  for (double const worst : {out.J, out.A, out.aref, out.R, out.parameters}) CHECK(worst <= bar);
  for (int const rows : out.rows) CHECK(rows > 0);
}

// Every model that can move; none is refused, which would end the test. GSP_TEST_ZOO=car: those with this in their names.
TEST_CASE("the rows of real models" * doctest::test_suite("data")) {
  auto const zoo = gsp_test::data("models/zoo.txt");
  if (!zoo) {
    gsp_test::skip("models/zoo.txt is missing from GSP_DATA_DIR");
    return;
  }
  char const* const choice = std::getenv("GSP_TEST_ZOO");
  std::ifstream lines(*zoo);
  Outcome all;
  int models = 0, still = 0;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string name;
    int nq = 0, nv = 0;
    if (line.empty() || line[0] == '#' || !(words >> name >> nq >> nv)) continue;
    if (choice && name.find(choice) == std::string::npos) continue;
    CAPTURE(name);
    auto const path = gsp_test::data("models/" + name);
    REQUIRE(path);
    if (nv == 0) {  // no rows
      ++still;
      continue;
    }
    auto const out = compare(gsp_test::load_oracle(*path),
                             gsp::compile(gsp::io::read_mjcf(*path, {.skip_visuals = true}), {.listed_pairs = 50'000'000}), false);
    int rows = 0;
    for (int k = 0; k <= mjCNSTR_CONTACT_ELLIPTIC; ++k) rows += out.rows[k], all.rows[k] += out.rows[k];
    MESSAGE(name << ": " << rows << " rows, J " << out.J << ", A " << out.A << ", aref " << out.aref << ", R " << out.R << ", parameters "
                 << out.parameters << ", inside " << out.inside << ", solved " << out.solved);
    CHECK(out.fault == "");
    CHECK(out.J <= bar);
    CHECK(out.A <= bar);
    CHECK(out.aref <= bar);
    CHECK(out.R <= bar);
    CHECK(out.parameters <= bar);
    CHECK(out.inside <= inside_bar);
    CHECK(out.solved <= solved_bar);
    ++models;
  }
  CHECK((choice || (models == 85 && still == 10)));
  for (int k = 0; k <= mjCNSTR_CONTACT_ELLIPTIC; ++k)  // no tendon of theirs has friction: tests/oracle/equality.cpp
    CHECK((choice || k == mjCNSTR_FRICTION_TENDON || all.rows[k] > 40));
  MESSAGE(models << " models and " << still << " that cannot move; rows of equalities " << all.rows[mjCNSTR_EQUALITY]
                 << ", friction of joints " << all.rows[mjCNSTR_FRICTION_DOF] << ", of tendons " << all.rows[mjCNSTR_FRICTION_TENDON]
                 << ", limits of joints " << all.rows[mjCNSTR_LIMIT_JOINT] << ", of tendons " << all.rows[mjCNSTR_LIMIT_TENDON]
                 << ", contacts " << all.rows[mjCNSTR_CONTACT_FRICTIONLESS] << ", " << all.rows[mjCNSTR_CONTACT_PYRAMIDAL] << ", "
                 << all.rows[mjCNSTR_CONTACT_ELLIPTIC]);
}
