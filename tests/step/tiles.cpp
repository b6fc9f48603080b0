// Tiles have the bits of one simulation of all worlds, whatever their size, in loops of a user's own too. (CTest gives 16 threads.)
#include <doctest/doctest.h>

#include <array>
#include <atomic>
#include <gsp/collision/geom_values.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/tiles.hpp>
#include <gsp_test_execs.hpp>
#include <stdexcept>

#include "step/world.hpp"

namespace test_types {
/// Pulls a dof of each world with a force of its own: a view by the worlds of the tile.
template <class Mem>
struct Pull : gsp::OneFreeRow {
  Kokkos::View<double*, Mem> force;
  int dof;
  KOKKOS_FUNCTION int count(int) const { return 1; }
  template <class T>
  KOKKOS_FUNCTION T lambda(int w, int, int, T, T) const {
    return T(force(w));
  }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int, int, Row&& J) const {
    J.set_dof(dof, 1.);
    return 0.;
  }
};
}  // namespace test_types

namespace {

template <class Exec>
Exec several() {
#ifdef KOKKOS_ENABLE_OPENMP
  if constexpr (std::is_same_v<Exec, Kokkos::OpenMP>) return Exec(std::min(3, Exec().concurrency()));
#endif
  return Exec();
}

template <class R, class Exec>
struct Scene {
  using Mem = typename Exec::memory_space;
  static constexpr int worlds = 37;
  Exec exec = several<Exec>();
  gsp::CompiledModel compiled = gsp::compile(gsp::samples::quadruped_scene());
  gsp::Model<R, Mem> model;
  gsp::CollisionModel<R, Mem> collision;
  gsp::State<R, Mem> state;
  explicit Scene(gsp::Profile profile = gsp::Profile::stable) : model(gsp::make_model<R>(exec, compiled, {.profile = profile})) {
    collision = gsp::make_collision_model<R>(exec, compiled);
    gsp::make_per_world(exec, model, {gsp::ModelField::dof_damping}, worlds);
    gsp::make_per_world(exec, collision, {gsp::GeomField::friction}, worlds);
    Kokkos::View<R**, Kokkos::LayoutRight, Mem> damping("damping", worlds, model.nv), friction("friction", worlds, 3 * model.ngeom);
    auto const d = Kokkos::create_mirror_view(damping), f = Kokkos::create_mirror_view(friction);
    for (int w = 0; w < worlds; ++w) {
      for (int i = 0; i < model.nv; ++i) d(w, i) = R(0.01 * (w % 6));
      for (int g = 0; g < model.ngeom; ++g) f(w, 3 * g) = R(0.2 + 0.1 * (w % 9)), f(w, 3 * g + 1) = R(0.005), f(w, 3 * g + 2) = R(1e-4);
    }
    Kokkos::deep_copy(damping, d);
    Kokkos::deep_copy(friction, f);
    gsp::set_world_values(exec, model, gsp::ModelField::dof_damping, damping);
    gsp::set_world_values(exec, collision, gsp::GeomField::friction, friction);
    state = gsp::make_state(exec, model, {.worlds = worlds});
    auto const q = Kokkos::create_mirror_view(state.qpos), v = Kokkos::create_mirror_view(state.qvel);
    for (int w = 0; w < worlds; ++w)
      for (int i = 0; i < model.nq; ++i) {
        q(w, i) = R(compiled.keyframes.at(0).qpos[std::size_t(i)]);
        if (i < 3) v(w, i) = R(0.1 * (w % 5));
      }
    Kokkos::deep_copy(state.qpos, q);
    Kokkos::deep_copy(state.qvel, v);
  }
  auto simulation() const {
    gsp::SimulationOptions options;
    options.worlds = worlds;
    return gsp::make_simulation(exec, model, compiled, options, collision);
  }
  auto pull(int first, int count) const {
    test_types::Pull<Mem> out;
    out.force = Kokkos::View<double*, Mem>("force", count);
    out.dof = 6;
    auto const host = Kokkos::create_mirror_view(out.force);
    for (int w = 0; w < count; ++w) host(w) = 0.05 * ((first + w) % 4);
    Kokkos::deep_copy(out.force, host);
    return out;
  }
  std::vector<R> result() const {
    std::vector<R> out;
    std::array const views{state.qpos, state.qvel};
    for (auto const& view : views) {
      auto const h = gsp_test::host(view);
      for (int w = 0; w < worlds; ++w)
        for (int i = 0; i < int(h.extent(1)); ++i) out.push_back(h(w, i));
    }
    return out;
  }
};

}  // namespace

TEST_CASE_TEMPLATE("tiles of any size have the bits of one simulation", Exec, GSP_TEST_EXECS) {
  for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    Scene<double, Exec> one(profile);
    auto sim = one.simulation();
    gsp::step(one.exec, one.model, one.state, sim, {.steps = 20});
    for (int const each : {0, 1, 8, 36, 37, 1000}) {
      CAPTURE(each);
      Scene<double, Exec> tiled(profile);
      auto tiles = gsp::make_tiles(tiled.exec, tiled.model, tiled.compiled, tiled.collision, tiled.state, {.worlds = each});
      if (each > 0) CHECK(tiles.size() == std::size_t((tiled.worlds + each - 1) / each));
      for (int k = 0; k < 4; ++k) gsp::step(tiled.exec, tiles, {.steps = 5});
      CHECK(tiled.result() == one.result());
      int worlds = 0;
      for (auto const& tile : tiles) {
        CHECK(tile.first == worlds);
        worlds += tile.worlds();
      }
      CHECK(worlds == tiled.worlds);
      auto const& last = tiles.back();  // poses and forces of a tile are those of its worlds
      auto const poses = gsp_test::host(last.simulation.poses.xpos), all = gsp_test::host(sim.poses.xpos);
      for (int w = 0; w < last.worlds(); ++w) CHECK(poses(w, 1, 2) == all(last.first + w, 1, 2));
    }
  }
}

// Tiles that share what a step finds: the same bits, with pools that grow for whoever needs them, and in the memory of a tile a thread.
TEST_CASE_TEMPLATE("tiles that share their room have the bits of one simulation", Exec, GSP_TEST_EXECS) {
  for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    Scene<double, Exec> one(profile);
    auto sim = one.simulation();
    gsp::step(one.exec, one.model, one.state, sim, {.steps = 20});
    auto const result = one.result();
    gsp::step(one.exec, one.model, one.state, sim);
    auto const all = gsp_test::host(sim.poses.xpos);
    for (int const each : {1, 4, 9, 36, 37}) {  // the last tile is smaller but for 1 and 37
      CAPTURE(each);
      Scene<double, Exec> tiled(profile);
      auto tiles = gsp::make_tiles(tiled.exec, tiled.model, tiled.compiled, tiled.collision, tiled.state, {.worlds = each, .share = true});
      for (int k = 0; k < 4; ++k) gsp::step(tiled.exec, tiles, {.steps = 5});
      CHECK(tiled.result() == result);
      int with_room = 0;
      for (auto const& tile : tiles) with_room += tile.simulation.rows.worlds > 0;
      CHECK(with_room == (each == 37 || tiled.worlds % each != 0 ? 1 : 0));  // the others have theirs in for_tiles alone
      gsp::for_tiles(tiled.exec, tiles, [&](auto& tile) {
        gsp::step(tile.exec, tile.model, tile.state, tile.simulation);
        if (tile.simulation.contacts.worlds != tile.worlds()) throw std::runtime_error("contacts are not those of the tile");
      });
      auto const poses = gsp_test::host(tiles.back().simulation.poses.xpos);  // are a tile's own
      for (int w = 0; w < tiles.back().worlds(); ++w) CHECK(poses(w, 1, 2) == all(tiles.back().first + w, 1, 2));
    }
  }
}

TEST_CASE_TEMPLATE("what tiles share is theirs in for_tiles alone", Exec, GSP_TEST_EXECS) {
  Scene<double, Exec> tiled;
  auto tiles = gsp::make_tiles(tiled.exec, tiled.model, tiled.compiled, tiled.collision, tiled.state, {.worlds = 9, .share = true});
  gsp::step(tiled.exec, tiles, {.steps = 5});
  auto& first = tiles.front();
  auto& sim = first.simulation;
  using Friction = gsp::JointFriction<double, typename Exec::memory_space>;
  auto const refuses = [&](auto const& f) { CHECK_THROWS_WITH_AS(f(), doctest::Contains("in for_tiles alone"), std::invalid_argument); };
  refuses([&] { gsp::step(first.exec, first.model, first.state, sim); });
  refuses([&] { gsp::settle(first.exec, sim); });
  refuses([&] { gsp::impulses_of<Friction>(sim.rows, sim.impulses); });
  auto const forgets = [](auto& tile) { gsp::launch_step(tile.exec, tile.model, tile.state, tile.simulation); };
  CHECK_THROWS_WITH_AS(gsp::for_tiles(tiled.exec, tiles, forgets), doctest::Contains("call settle before f returns"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::make_tiles(tiled.exec, tiled.model, tiled.compiled, tiled.collision, tiled.state, {.share = true}),
                       doctest::Contains("give `worlds` too"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::of_worlds(tiles.back().simulation.poses, 0, 2), std::invalid_argument);
  CHECK_THROWS_AS(gsp::of_worlds(tiled.state, std::numeric_limits<int>::max(), 1), std::invalid_argument);
}

TEST_CASE_TEMPLATE("what is a user's own lies by the worlds of a tile, and errors come back", Exec, GSP_TEST_EXECS) {
  using S = Scene<float, Exec>;
  S one;
  auto sim = one.simulation();
  gsp::step(one.exec, one.model, one.state, sim, {.steps = 10}, one.pull(0, one.worlds));
  S tiled;
  auto tiles = gsp::make_tiles(tiled.exec, tiled.model, tiled.compiled, tiled.collision, tiled.state, {.worlds = 10});
  std::vector<decltype(tiled.pull(0, 1))> pulls;
  for (auto const& tile : tiles) pulls.push_back(tiled.pull(tile.first, tile.worlds()));
  gsp::for_tiles(tiled.exec, tiles, [&](auto& tile) {
    auto const& pull = pulls[std::size_t(tile.first / 10)];
    for (int k = 0; k < 10; ++k) {
      gsp::launch_step(tile.exec, tile.model, tile.state, tile.simulation, {}, pull);
      while (gsp::settle(tile.exec, tile.simulation) > 0) gsp::launch_step(tile.exec, tile.model, tile.state, tile.simulation, {}, pull);
    }
  });
  CHECK(tiled.result() == one.result());

  std::atomic<int> done{0};
  auto const fails = [&](auto& tile) {
    ++done;
    if (tile.first > 0) throw std::runtime_error("tile " + std::to_string(tile.first));
  };
  bool const together = tiled.exec.concurrency() > 1 && !gsp::is_device<Exec>;
  CHECK_THROWS_WITH_AS(gsp::for_tiles(tiled.exec, tiles, fails), "tile 10", std::runtime_error);
  if (together) CHECK(done == 4);  // the others are done with
  CHECK_THROWS_WITH_AS(gsp::make_tiles(tiled.exec, tiled.model, tiled.compiled, tiled.collision, tiled.state, {.worlds = -1}),
                       doctest::Contains("and has -1"), std::invalid_argument);
  auto few = gsp::make_collision_model<float>(tiled.exec, tiled.compiled);
  gsp::make_per_world(tiled.exec, few, {gsp::GeomField::friction}, 10);
  CHECK_THROWS_WITH_AS(gsp::make_tiles(tiled.exec, tiled.model, tiled.compiled, few, tiled.state, {.worlds = 10}),
                       doctest::Contains("the model has values for 10 worlds"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::of_worlds(tiled.state, 30, 8), std::invalid_argument);
  CHECK_THROWS_AS(gsp::of_worlds(tiled.model, 30, 8), std::invalid_argument);
}

// In a team of OpenMP that nests others each of these has a thread of number 0. Room for the work of none, and of one for several threads,
// is refused.
TEST_CASE("tiles keep their bits where regions nest, and lend room for work in for_tiles alone") {
#ifdef KOKKOS_ENABLE_OPENMP
  using S = Scene<float, Kokkos::OpenMP>;
  S one;
  auto sim = one.simulation();
  gsp::step(one.exec, one.model, one.state, sim, {.steps = 20});
  S nested, own;
  auto tiles = gsp::make_tiles(nested.exec, nested.model, nested.compiled, nested.collision, nested.state, {.worlds = 5});
  int const levels = omp_get_max_active_levels();
  omp_set_max_active_levels(2);
  gsp::step(nested.exec, tiles, {.steps = 20});
  omp_set_max_active_levels(levels);
  CHECK(nested.result() == one.result());
  auto others = gsp::make_tiles(own.exec, own.model, own.compiled, own.collision, own.state, {.worlds = 10});
  auto& tile = others.front();
  CHECK_THROWS_WITH_AS(gsp::step(tile.exec, tile.model, tile.state, tile.simulation), doctest::Contains("lent to it in for_tiles"),
                       std::invalid_argument);
  if (Kokkos::OpenMP().concurrency() == 1) return;
  Kokkos::OpenMP const alone(1);
  auto single = gsp::make_simulation(alone, one.model, one.compiled, {}, one.collision);
  auto state = gsp::of_worlds(one.state, 0, 1);
  auto const model = gsp::of_worlds(one.model, 0, 1);
  CHECK_THROWS_WITH_AS(gsp::step(Kokkos::OpenMP(), model, state, single), doctest::Contains("there is room for the work of one thread"),
                       std::invalid_argument);
#endif
}

// Worlds that are fewer than packs for all threads are stepped by all of them together; else every thread has two tiles of whole packs.
TEST_CASE("how many worlds a tile has") {
#ifdef KOKKOS_ENABLE_OPENMP
  Kokkos::OpenMP const exec(std::min(4, Kokkos::OpenMP().concurrency()));
  if (exec.concurrency() < 4) return;  // CTest gives 16
  auto const model = gsp::make_model<float>(exec, gsp::compile(gsp::samples::quadruped()));
  constexpr int pack = gsp::native_width<float>;
  REQUIRE(model.ntree == 1);
  CHECK(gsp::detail::worlds_of_a_tile(exec, model, 1) == 1);
  CHECK(gsp::detail::worlds_of_a_tile(exec, model, 3 * pack) == 3 * pack);
  CHECK(gsp::detail::worlds_of_a_tile(exec, model, 3 * pack + 1) == pack);
  CHECK(gsp::detail::worlds_of_a_tile(exec, model, 8 * pack) == pack);
  CHECK(gsp::detail::worlds_of_a_tile(exec, model, 8 * pack + 1) == 2 * pack);
  CHECK(gsp::detail::worlds_of_a_tile(exec, model, 1 << 20) == 128);
  CHECK(gsp::detail::worlds_of_a_tile(Kokkos::OpenMP(1), model, 1000) == 1000);
#endif
}
