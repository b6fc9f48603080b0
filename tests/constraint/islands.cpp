// Islands of random rows beside a plain search: parts, order and what is left out, on every backend.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <gsp/constraint/rows.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp_test_execs.hpp>
#include <random>
#include <set>

#include "step/world.hpp"

namespace {

template <class Mem>
struct Find {
  gsp::Rows<double, Mem> rows;
  bool each_row;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank, first = rows.first(w);
    gsp::detail::part_islands(world, rows.islands, w);
    world.each(rows.count(w), [&](int r) {  // as `assemble` does while it counts
      int tree = -1;
      for (int i = 0; i < 2 * rows.element_rows(first + r); ++i) {
        int const other = gsp::detail::tree_of_row(rows, rows.islands, w, r + i / 2, i % 2);
        if (other < 0) continue;
        if (tree < 0) tree = other;
        gsp::detail::join_islands(rows.islands.label(w), tree, other);
      }
    });
    gsp::detail::label_islands(world, rows.islands, w);
    if (each_row)
      gsp::detail::find_islands<gsp::detail::IslandItems::rows>(world, rows, rows.islands, world.rank);
    else
      gsp::detail::find_islands(world, rows, rows.islands, world.rank);
  }
};

/// `trees` chains of 1, 2, 3, 1, ... hinges.
gsp::CompiledModel chains(int trees) {
  gsp::Description d;
  for (int t = 0; t < trees; ++t)
    for (int b = 0; b <= t % 3; ++b) {
      gsp::BodyDescription body;
      body.parent = b == 0 ? 0 : int(d.bodies.size()) - 1;
      body.has_inertial = true;
      body.inertial.mass = 1;
      body.inertial.inertia = {1, 1, 1, 0, 0, 0};
      body.joints.emplace_back();
      d.bodies.push_back(body);
    }
  return gsp::compile(d);
}

struct Element {
  int first, rows;
  std::set<int> trees;
  bool eliminated;
};

}  // namespace

TEST_CASE_TEMPLATE("islands are what rows couple, each with its elements and dofs in order", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  for (int const shape : {1, 2, 40, -1, -2, -40}) {  // below 0: all rows are listed
    bool const each_row = shape < 0;
    int const trees = std::abs(shape);
    int const worlds = 7, capacity = 130;
    auto const compiled = chains(trees);
    auto const model = gsp::make_model<double>(exec, compiled);
    std::vector<int> tree_of;  // of each dof
    for (int t = 0; t < trees; ++t) tree_of.insert(tree_of.end(), compiled.tree_dofnum[t], t);
    auto rows = gsp::make_rows(exec, model, {.worlds = worlds, .rows_per_world = capacity});
    auto const row = Kokkos::create_mirror_view(rows.row);
    auto const element_rows = Kokkos::create_mirror_view(rows.element_rows);
    auto const first = Kokkos::create_mirror_view(rows.first), count = Kokkos::create_mirror_view(rows.count);
    std::mt19937 random(trees);
    auto const pick = [&](int n) { return int(random() % unsigned(n)); };
    std::vector<std::vector<Element>> elements(worlds);
    for (int w = 0; w < worlds; ++w) {
      first(w) = w * capacity;
      int const wanted = w == 0 ? 0 : w == 1 ? 1 : w * capacity / 8, reach = w % 2 ? trees : std::max(1, trees / 8);
      int n = 0;
      while (n < wanted) {
        Element e{n, 1 + pick(6), {}, pick(10) == 0};
        int const home = pick(trees);
        for (int b = 0; b < e.rows; ++b) {
          gsp::Row<double> r{};
          for (int s = 0; s < 2; ++s) {  // a row may touch one tree, or none, in the second place alone
            r.segment[s] = {-1, 0, 0};
            if (pick(3) == 0) continue;
            int const t = (home + pick(std::max(1, reach / 4))) % trees;
            r.segment[s] = {-1, compiled.tree_dofnum[t], compiled.tree_dofadr[t]};
            e.trees.insert(t);
          }
          r.eliminated = e.eliminated;
          row(first(w) + n + b) = r;
          element_rows(first(w) + n + b) = b == 0 ? e.rows : 0;
        }
        n += e.rows;
        elements[w].push_back(e);
      }
      count(w) = n;
    }
    Kokkos::deep_copy(exec, rows.row, row);
    Kokkos::deep_copy(exec, rows.element_rows, element_rows);
    Kokkos::deep_copy(exec, rows.first, first);
    Kokkos::deep_copy(exec, rows.count, count);
    gsp::for_worlds("test", exec, worlds, Find<typename Exec::memory_space>{rows, each_row});
    exec.fence();
    auto const lists = gsp_test::host(rows.islands.lists), dofs = gsp_test::host(rows.islands.dofs);
    auto const order = gsp_test::host(rows.islands.elements);
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(shape);
      CAPTURE(w);
      std::vector<int> label(trees);  // the least tree that can be reached
      for (int t = 0; t < trees; ++t) label[t] = t;
      for (bool again = true; again;) {
        again = false;
        for (auto const& e : elements[w]) {
          int least = trees;
          for (int t : e.trees) least = std::min(least, label[t]);
          for (int t : e.trees) again |= label[t] != least, label[t] = least;
        }
      }
      std::vector<std::vector<int>> expected;  // by island: elements of one row, then others; or all rows
      std::vector<int> moved;
      for (int t = 0; t < trees; ++t) {
        std::vector<int> list;
        for (int several = 0; several < 2; ++several)
          for (auto const& e : elements[w])
            if (!e.eliminated && !e.trees.empty() && label[*e.trees.begin()] == t && (each_row ? several == 0 : (e.rows > 1) == several))
              for (int b = 0; b < (each_row ? e.rows : 1); ++b) list.push_back(e.first + b);
        if (list.empty()) continue;
        expected.push_back(list);
        moved.push_back(t);
      }
      auto const at = [&](int i) { return lists(w, i); };
      int const islands = at(0);
      REQUIRE(islands == int(expected.size()));
      int place = 0, dof = 0;
      for (int i = 0; i <= islands; ++i) {
        CHECK(at(1 + i) == place);
        CHECK(at(2 + trees + i) == dof);
        for (int d = 0; d < compiled.nv; ++d) {
          auto const found = std::find(moved.begin(), moved.end(), label[tree_of[d]]) - moved.begin();
          if (found == i) CHECK(dofs(w, dof++) == d);
        }
        if (i < islands)
          for (int e : expected[i]) CHECK(order(first(w) + place++) == e);
      }
      CHECK(dof == compiled.nv);
      for (int i = 0; i < islands; ++i) {
        int rows_of = 0;
        for (auto const& e : elements[w])
          if (!e.eliminated && !e.trees.empty() && label[*e.trees.begin()] == moved[i]) rows_of += e.rows;
        CHECK(at(5 + 6 * trees + i) == rows_of);
        for (int k = at(2 + trees + i); k < at(3 + trees + i); ++k) {  // shift: the number of a dof in its island
          int const d = dofs(w, k), t = tree_of[d];
          CHECK(d + at(5 + 7 * trees + t) == k - at(2 + trees + i));
        }
      }
    }
  }
}

// What `assemble` says of islands that are known: a stack of boxes, three trees that a weld and a connect hold together, apart from
// it, and one body that nothing touches.
TEST_CASE_TEMPLATE("assemble finds islands and what they weigh", Exec, GSP_TEST_EXECS) {
  auto const text = R"(<mujoco><option timestep="0.002"/><worldbody><geom type="plane" size="9 9 1"/>
    <body pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/></body>
    <body pos="5 0 3"><freejoint/><geom type="sphere" size=".1" mass="64"/></body>
    <body name="a" pos="2 0 2"><freejoint/><geom type="sphere" size=".1" mass="2"/></body>
    <body pos="0 0 .3"><freejoint/><geom type="box" size=".1 .1 .1" mass="4"/></body>
    <body name="b" pos="3 0 2"><freejoint/><geom type="sphere" size=".1" mass="8"/></body>
    <body name="c" pos="4 0 2"><freejoint/><geom type="sphere" size=".1" mass="16"/><body pos=".5 0 0"><joint/><geom type="sphere" size=".1" mass="32"/></body></body>
    </worldbody><equality><weld body1="c" body2="b"/><connect body1="a" body2="c" anchor="1 0 0"/></equality></mujoco>)";
  gsp_test::World<double, Exec> w(gsp::compile(gsp::io::parse_mjcf(text, "islands.xml")), 3);
  w.step(2);
  auto const lists = gsp_test::host(w.sim.rows.islands.lists);
  auto const mass = gsp_test::host(w.sim.rows.tree_mass);
  int const trees = w.model.ntree;
  REQUIRE(trees == 6);
  int const first[] = {0, 1, 2, 0, 2, 2};
  double const weighs[] = {5, 64, 58};
  for (int world = 0; world < 3; ++world)
    for (int t = 0; t < trees; ++t) {
      CHECK(lists(world, 4 + 2 * trees + t) == first[t]);
      CHECK(mass(world, first[t]) == doctest::Approx(weighs[first[t]]).epsilon(1e-12));
    }
}
