// Where the items of lanes lie: each has a place of its own, and there are as many as the contract says.
#include <doctest/doctest.h>

#include <algorithm>
#include <gsp/dynamics/dynamics.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp_test_execs.hpp>
#include <set>
#include <stdexcept>
#include <vector>

#include "support/kernels.hpp"

namespace {
/// Counts of items, by archetype.
template <class R, class Mem>
std::vector<int> sizes(gsp::Model<R, Mem> const& model) {
  std::vector<int> all;
  for (int k = 0; k < model.narchetype; ++k) all.push_back(gsp::DynamicsLayout(model.host_archetypes(k)).size);
  return all;
}
}  // namespace

TEST_CASE_TEMPLATE("every item of every tree and world has a place of its own", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec exec;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());  // a robot, and boxes and balls: one archetype, many instances
  auto const model = gsp::make_model<float>(exec, compiled);
  REQUIRE(model.ntree > model.narchetype);
  auto const size = sizes(model);
  int const most = *std::max_element(size.begin(), size.end());
  constexpr int W = gsp::block_width<Mem, float>;
  for (int const worlds : {1, 3, W - 1, W, W + 1, 2 * W + 3}) {
    if (worlds == 0) continue;
    auto const dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
    CHECK(dynamics.padded_worlds >= worlds);
    CHECK((dynamics.padded_worlds % W == 0 || dynamics.padded_worlds == worlds));
    // place of item i of tree t of world w, by item(), and by tree()
    Kokkos::View<long* [2], Kokkos::LayoutRight, Mem> const places("places", std::size_t(worlds) * model.ntree * most);
    int const trees = model.ntree;
    Kokkos::parallel_for(
        "gsp::test::places", Kokkos::RangePolicy<Exec>(exec, 0, int(places.extent(0))), KOKKOS_LAMBDA(int at) {
          int const i = at % most, t = at / most % trees, w = at / most / trees;
          auto const tree = dynamics.tree(model, w, t);
          bool const has = i < tree.at.size;
          places(at, 0) = has ? &dynamics.item(model, w, t, i) - dynamics.items.data() : -1;
          places(at, 1) = has ? &tree[i] - dynamics.items.data() : -1;
        });
    auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace(), places);
    std::set<long> seen;
    long expected = 0;
    for (int k = 0; k < model.narchetype; ++k) expected += long(size[k]) * model.host_archetypes(k).ninstance * worlds;
    int outside = 0, apart = 0;
    for (int at = 0; at < int(host.extent(0)); ++at) {
      if (host(at, 0) < 0) continue;
      seen.insert(host(at, 0));
      outside += host(at, 0) >= long(dynamics.items.extent(0));
      apart += host(at, 0) != host(at, 1);
    }
    CHECK(outside == 0);
    CHECK(apart == 0);
    CHECK(long(seen.size()) == expected);
  }
}

TEST_CASE("as many items as the contract says") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  auto const model = gsp::make_model<double>(Exec(), gsp::compile(gsp::samples::double_pendulum()));
  REQUIRE(model.narchetype == 1);
  gsp::Archetype const& a = model.host_archetypes(0);
  REQUIRE(a.nact == 0);
  REQUIRE(a.gyroscopic);                   // nothing damps it
  int const of_its_own = 3 * a.nroot + 2;  // centres of mass; energies. How a rigid body turns: of trees of one joint alone
  CHECK(gsp::DynamicsLayout(a).size == (35 + 12) * a.nbody + (18 + 7) * a.nv + 6 * a.njnt + (2 + 4) * a.nM + of_its_own);
  CHECK_THROWS_AS((void)gsp::make_dynamics(Exec(), model, {.worlds = 0}), std::invalid_argument);
}
