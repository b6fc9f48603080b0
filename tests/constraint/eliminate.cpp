#include <doctest/doctest.h>

#include <cmath>
#include <gsp/constraint/eliminate.hpp>
#include <gsp/constraint/equality.hpp>
#include <gsp/step/snapshot.hpp>
#include <gsp_test_execs.hpp>

#include "constraint/loop.hpp"
#include "step/scene_files.hpp"
#include "step/world.hpp"
#include "support/data.hpp"
#include "support/skip.hpp"

using gsp_test::Loop;

namespace test_types {
/// Random contacts of three rows, a soft normal and rigid friction in a disc, over all dofs; then single rows between bounds.
template <class R>
struct Pushes {
  int contacts, singles, dofs;
  KOKKOS_FUNCTION int count(int) const { return contacts + singles; }
  KOKKOS_FUNCTION int rows(int, int k) const { return k < contacts ? 3 : 1; }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int world, int k, int row, Row&& J) const {
    for (int i = k % 2 ? 6 : 0; i < dofs; ++i)
      J.set_dof(i, R(gsp_test::hashed(world, k, row, i, 7)));  // every second one: the tree of the loops alone
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int world, int k, int row, R, R u, R) const {
    return {row == 0 ? R(0.05 + 0.02 * gsp_test::hashed(world, k, 5, 0, 7)) : R(0),
            row == 0 ? u + R(gsp_test::hashed(world, k, 6, 0, 7)) : R(0)};
  }
  KOKKOS_FUNCTION gsp::RowBounds<R> bounds(int, int k, int row) const {
    if (row > 0) return {0, 0, 0, R(0.6), row == 1};
    return {0, k < contacts ? R(1e35) : R(0.3)};
  }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
}  // namespace test_types

namespace {
constexpr int free_dofs = 6, links = 6;

/// A free box, and a chain of links on hinges that are closed: to the world, to each other, and two joints coupled; one equality joins
/// the two trees.
gsp::CompiledModel closed_chain(bool twice = false) {
  gsp::Description d;
  auto const body = [&](std::string name, int parent, gsp::Double3 pos, gsp::JointType type, gsp::Double3 axis) {
    gsp::BodyDescription b;
    b.parent = parent, b.name = name, b.pos = pos, b.has_inertial = true;
    b.inertial.mass = 1.5, b.inertial.inertia = {0.02, 0.03, 0.04, 0, 0, 0}, b.inertial.pos = {0.05, 0.01, 0.1};
    b.joints.emplace_back().type = type, b.joints[0].name = "j" + name, b.joints[0].axis = axis;
    d.bodies.push_back(b);
  };
  body("box", 0, {2, 0, 0}, gsp::JointType::free, {0, 0, 1});
  gsp::Double3 const axes[] = {{0, 1, 0}, {1, 0, 0}, {0, 0, 1}, {0.6, 0.8, 0}, {0, 1, 0}, {0, 0.6, 0.8}};
  for (int i = 0; i < links; ++i)
    body("l" + std::to_string(i), i == 0 ? 0 : int(d.bodies.size()) - 1, {0, 0.05, 0.3}, gsp::JointType::hinge, axes[i]);
  auto const equality = [&](gsp::EqualityType type, std::string one, std::string two) {
    gsp::EqualityDescription e;
    e.name = "e" + std::to_string(d.equalities.size()), e.type = type, e.name1 = one, e.name2 = two;
    if (type == gsp::EqualityType::joint) e.data = {0.1, 0.7, 0, 0, 0};
    d.equalities.push_back(e);
  };
  equality(gsp::EqualityType::connect, "l5", "");
  equality(gsp::EqualityType::joint, "jl1", "jl3");
  equality(gsp::EqualityType::connect, "box", "l2");  // of two trees: it is swept
  if (twice) equality(gsp::EqualityType::joint, "jl1", "jl3");
  return gsp::compile(d);
}
}  // namespace

// The problem with normals soft and rigid friction has one solution in rates where few rows meet many dofs; impulses of independent rows
// too. Sweeps end at a change of 1e-11 |g| h; to 1e-9 of the largest.
TEST_CASE_TEMPLATE("eliminated rows and swept ones have the same solution", Exec, GSP_TEST_EXECS) {
  int const worlds = 9;
  auto const c = closed_chain();
  for (int contacts : {1, 0}) {
    Loop<double, Exec> a(c, worlds), b(c, worlds);
    gsp_test::randomise(c, a.state);
    gsp_test::randomise(c, b.state);
    gsp::RowsOptions const swept{.worlds = worlds, .eliminate = false};
    b.forget(swept);
    CHECK(a.model.closing_rows == 4);
    CHECK(a.rows.most_eliminated == 4);
    CHECK(b.rows.most_eliminated == 0);
    test_types::Pushes<double> const pushes{contacts, 3, free_dofs + links};
    a.solver = b.solver = gsp::PgsOptions{.iterations = 100000, .tolerance = 1e-11f, .residual = true};
    for (auto* s : {&a, &b}) {
      do { s->assemble(gsp::Equalities(s->model, s->state, s->poses, s->dynamics), pushes); } while (s->grow());
      s->solve(s->solver);
      s->exec.fence();
    }
    auto const eliminated = gsp_test::host(a.rows.eliminated), more = gsp_test::host(a.solution.iterations),
               less = gsp_test::host(b.solution.iterations);
    auto const za = gsp_test::host(a.solution.z), zb = gsp_test::host(b.solution.z);
    auto const pa = gsp_test::host(a.impulses.p[gsp_test::host(a.impulses.parity)()]),
               pb = gsp_test::host(b.impulses.p[gsp_test::host(b.impulses.parity)()]);
    auto const first = gsp_test::host(a.rows.first), count = gsp_test::host(a.rows.count), other = gsp_test::host(b.rows.first);
    int sweeps[2] = {0, 0};
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(contacts);
      CAPTURE(w);
      CHECK(eliminated(w) == 4);
      sweeps[0] += more(w), sweeps[1] += less(w);
      CHECK(gsp_test::host(a.solution.residual)(w) < 1e-11);
      double size = 1, off = 0;
      for (int i = 0; i < a.model.nv; ++i) size = std::fmax(size, std::abs(zb(w, i))), off = std::fmax(off, std::abs(za(w, i) - zb(w, i)));
      CHECK(off < 1e-9 * size);
      off = 0, size = 1;
      for (int r = 0; r < count(w); ++r)
        size = std::fmax(size, std::abs(pb(other(w) + r))), off = std::fmax(off, std::abs(pa(first(w) + r) - pb(other(w) + r)));
      CHECK(off < 1e-8 * size);
    }
    MESSAGE(sweeps[0] << " sweeps with elimination, " << sweeps[1] << " without");
    CHECK(sweeps[0] < sweeps[1]);
    gsp::integrate(a.exec, a.model, a.state, a.dynamics, a.progress, a.solution);
    gsp::integrate(b.exec, b.model, b.state, b.dynamics, b.progress, b.solution);
    auto const va = gsp_test::host(a.state.qvel), vb = gsp_test::host(b.state.qvel);
    for (int w = 0; w < worlds; ++w)
      for (int i = 0; i < a.model.nv; ++i) CHECK(va(w, i) == doctest::Approx(vb(w, i)).epsilon(1e-8));
  }
}

// In float, and with the same joints coupled twice: finite, the same rates to float's rounding times the stiffness of the rows (1 / C |Y|^2
// = 20).
TEST_CASE_TEMPLATE("redundant equalities stay finite", Exec, GSP_TEST_EXECS) {
  int const worlds = 5;
  auto const once = closed_chain(), twice = closed_chain(true);
  Loop<float, Exec> a(twice, worlds);
  Loop<double, Exec> b(twice, worlds);
  gsp_test::randomise(twice, a.state);
  gsp_test::randomise(twice, b.state);
  a.solver = b.solver = gsp::PgsOptions{.iterations = 2000, .tolerance = 1e-6f};
  test_types::Pushes<float> const rounded{1, 2, free_dofs + links};
  test_types::Pushes<double> const pushes{1, 2, free_dofs + links};
  do a.assemble(gsp::Equalities(a.model, a.state, a.poses, a.dynamics), rounded);
  while (a.grow());
  do b.assemble(gsp::Equalities(b.model, b.state, b.poses, b.dynamics), pushes);
  while (b.grow());
  a.solve(a.solver);
  b.solve(b.solver);
  auto const za = gsp_test::host(a.solution.z);
  auto const zb = gsp_test::host(b.solution.z);
  for (int w = 0; w < worlds; ++w) {
    CHECK(gsp_test::host(a.rows.eliminated)(w) == 5);
    for (int i = 0; i < a.model.nv; ++i) CHECK(double(za(w, i)) == doctest::Approx(zb(w, i)).epsilon(1e-3).scale(1));
  }
  CHECK(gsp::make_model<double>(a.exec, once).closing_rows == 4);
  CHECK(gsp::make_model<double>(a.exec, once, {.profile = gsp::Profile::mujoco}).closing_rows == 0);  // Newton's method takes them itself
}

namespace {
using Host = Kokkos::DefaultHostExecutionSpace;
using World = gsp_test::World<double, Host>;

/// Goes `rounds` times 25 steps on, after each of them one step more with rows eliminated and with all rows in the sweeps: the largest
/// difference of the two in rates, over the largest rate (at least 1), less 20 times what the sweeps have left.
double difference(World& w, int rounds, int& contacts, bool accelerate = true) {
  World eliminated(w.compiled, 1, {.timestep = w.model.timestep}), swept(w.compiled, 1, {.timestep = w.model.timestep});
  swept.sim.rows = gsp::make_rows(swept.exec, swept.model, {.eliminate = false});
  swept.sim.impulses = gsp::make_impulses(swept.exec, swept.sim.rows);
  double worst = 0;
  contacts = 0;
  for (int round = 0; round < rounds; ++round) {
    w.step(25);
    REQUIRE(gsp_test::host(w.state.status)(0) == 0);
    auto const snapshot = gsp::make_snapshot(w.exec, w.state, w.sim);
    Kokkos::View<bool*, Kokkos::HostSpace> all("all", 1);
    all(0) = true;
    for (auto* one : {&eliminated, &swept}) {
      gsp::restore(one->exec, snapshot, one->state, one->sim, all);
      one->step(1, {.iterations = 100000, .tolerance = 1e-13f, .accelerate = accelerate, .residual = true});
    }
    CHECK(gsp_test::host(eliminated.sim.rows.eliminated)(0) == eliminated.model.closing_rows);
    CHECK(gsp_test::host(swept.sim.rows.eliminated)(0) == 0);
    contacts = std::max(contacts, swept.sim.contacts.count_of(0));
    auto const a = eliminated.qvel(), b = swept.qvel();
    double size = 1, off = 0;
    for (int i = 0; i < w.model.nv; ++i) {
      size = std::fmax(size, std::abs(b(0, i)));
      off = std::fmax(off, std::abs(a(0, i) - b(0, i)));
    }
    double const unsolved = std::fmax(gsp_test::host(eliminated.sim.solution.residual)(0), gsp_test::host(swept.sim.solution.residual)(0));
    REQUIRE(std::isfinite(unsolved));
    worst = std::fmax(worst, (off - 20 * unsolved) / size);
  }
  return worst;
}
}  // namespace

// The same of robots: a Panda, whose fingers are coupled, closes upon a cube, without friction and with it; an arm whose hand has coupled
// tendons, and a quadruped, whose legs' tendons are held, move freely or fall. Sweeps end at a change of 1e-13 |g| h. Rates agree to 1e-9
// (measured 3e-14), impulses need not. The rubbing grip is slow: 100,000 sweeps leave 3e-10 to 5e-7 m/s of either, and rates differ by 0.1
// to 10 times that. It goes by sweeps alone: friction there has several answers, and mixtures end at others (3e-5 m/s apart).
TEST_CASE("robots with eliminated rows move as with swept ones" * doctest::test_suite("data")) {
  auto const grasp = gsp_test::data("models/phys_bench/grasp_xml/mjx_pick_cube.xml");
  if (!grasp) return gsp_test::skip("models/phys_bench is missing from GSP_DATA_DIR");
  std::vector<double> const pose{-1.0104, 1.5623, 1.3601, -1.6840, -1.5863, 1.7810, 1.4598};
  int contacts = 0;
  for (bool const rough : {false, true}) {
    auto d = gsp_test::grasp(*grasp);
    for (auto& body : d.bodies)
      for (auto& geom : body.geoms)
        if (!rough) geom.friction = {0, 0, 0};
    World panda(gsp::compile(d), 1, {.timestep = 0.002});
    REQUIRE(panda.model.closing_rows == 1);
    for (int j = 0; j < 7; ++j) panda.state.qpos(0, j) = panda.state.ctrl(0, j) = pose[std::size_t(j)];
    panda.state.qpos(0, 7) = panda.state.qpos(0, 8) = 0.04;
    double const off = difference(panda, 20, contacts, !rough);
    MESSAGE("Panda, rough " << rough << ": rates differ by " << off << ", up to " << contacts << " contacts");
    CHECK(contacts > 4);  // more than the cube on the floor
    CHECK(off < 1e-9);
  }
  for (std::string const name : {"manipulator", "quadruped"}) {
    auto const path = gsp_test::data("models/dm_control/suite/" + name + ".xml");
    if (!path) return gsp_test::skip("models/dm_control is missing from GSP_DATA_DIR");
    World robot(gsp::compile(gsp::io::read_mjcf(*path)));
    REQUIRE(robot.model.closing_rows > 0);
    double const rates = difference(robot, 20, contacts);
    MESSAGE(name << ": rates differ by " << rates << ", " << robot.model.closing_rows << " rows, up to " << contacts << " contacts");
    CHECK(rates < 1e-9);
  }
}
