#pragma once
#include <algorithm>
#include <exception>
#include <gsp/collision/geom_values.hpp>
#include <gsp/core/region.hpp>
#include <gsp/model/world_values.hpp>
#include <gsp/step/detail/snapshot_kernels.hpp>
#include <gsp/step/step.hpp>
#include <vector>

/// Many worlds on many cores: worlds of a host lie in tiles, and a thread takes a tile through whole steps, in its core's caches, without
/// waiting for the others. Worlds are alone, so the bits are those of one simulation of all.
namespace gsp {

/// Worlds first ... first + count - 1, whose arrays are rows of the others; the two are moved on each by itself.
template <class R, class Mem>
State<R, Mem> of_worlds(State<R, Mem> const& state, int first, int count) {
  State<R, Mem> part;
  part.worlds = count;
  detail::each_state_view([&](char const*, auto const& from, auto& to) { to = detail::rows_of(from, first, count); }, state, part);
  part.moment = detail::allocate<decltype(part.moment)>("gsp::State::moment");
  detail::moves_on(part);
  return part;
}
template <class R, class Mem>
Poses<R, Mem> of_worlds(Poses<R, Mem> const& poses, int first, int count) {
  auto const rows = [&](auto const& view) { return detail::rows_of(view, first, count); };
  return {rows(poses.xpos), rows(poses.xquat), rows(poses.xanchor), rows(poses.xaxis),
          detail::make_stamp<detail::PosesStamp>("gsp::Poses::stamp")};
}
/// What is the same for all worlds is shared, what differs are rows of the others.
template <class R, class Mem>
Model<R, Mem> of_worlds(Model<R, Mem> const& model, int first, int count) {
  return detail::with_rows_from(model, detail::field_table<Model<R, Mem>>(), first, count);
}
template <class R, class Mem>
CollisionModel<R, Mem> of_worlds(CollisionModel<R, Mem> const& collision, int first, int count) {
  return detail::with_rows_from(collision, detail::geom_field_table<CollisionModel<R, Mem>>(), first, count);
}

/// Some of the worlds, with all that a step of them needs. Its state, and what its model has for each world, are rows of the whole.
template <class R, ExecutionSpace Exec>
struct Tile {
  using memory_space = typename Exec::memory_space;
  Exec exec;
  int first = 0;  // of its worlds
  Model<R, memory_space> model;
  State<R, memory_space> state;
  Simulation<R, memory_space> simulation;
  int worlds() const { return state.worlds; }
};

struct TilesOptions {
  SimulationOptions simulation = {};  // its `worlds` are the state's
  int worlds = 0;                     // of a tile; 0: two tiles for each thread of `exec`, of whole packs and at most 128 worlds
};

namespace detail {
/// Worlds of a tile where nobody says. A tile smaller than a pack of lanes leaves lanes empty, and the work of large tiles does not stay in
/// caches. Worlds that are large and few have work for many threads in each of them: one tile.
template <class R, class Exec, class Mem>
int worlds_of_a_tile(Exec const& exec, Model<R, Mem> const& model, int worlds) {
  int const threads = is_device<Exec> ? 1 : exec.concurrency();
  if (threads == 1 || (model.nv > lockstep_most_dofs && worlds < 2 * threads)) return worlds;
  int const trees = std::max(1, model.ntree), pack = std::max(1, native_width<R> / trees), most = std::max(pack, 128 / trees);
  int const even = (worlds + 2 * threads - 1) / (2 * threads);
  return std::min(most, (even + pack - 1) / pack * pack);
}
/// One instance of the execution space for each tile, as an instance runs one kernel at a time.
template <class Exec>
Exec tile_exec([[maybe_unused]] Exec const& exec) {
#ifdef KOKKOS_ENABLE_OPENMP
  if constexpr (std::is_same_v<Exec, Kokkos::OpenMP>) return Exec(1);
#endif
  return exec;
}
}  // namespace detail

/// Tiles for all worlds of `state`; on a device, and on a host of one thread, one. Allocates.
/// @param model      what `state` was made from, with values for each world (model/world_values.hpp) or without
/// @param collision  the shapes, with such values or without: make_collision_model
/// Errors: those of make_simulation; std::invalid_argument for tiles of fewer than no worlds.
template <class R, ExecutionSpace Exec, class Mem>
std::vector<Tile<R, Exec>> make_tiles(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled,
                                      CollisionModel<R, Mem> const& collision, State<R, Mem> const& state,
                                      TilesOptions const& options = {}) {
  expects(options.worlds >= 0, "gsp::make_tiles: a tile must have some worlds, and has " + std::to_string(options.worlds));
  detail::expects_fit("gsp::make_tiles", model, state);
  int const each = options.worlds > 0 ? options.worlds : detail::worlds_of_a_tile(exec, model, state.worlds);
  std::vector<Tile<R, Exec>> tiles;
  for (int first = 0; first < state.worlds; first += each) {
    Tile<R, Exec> tile;
    tile.first = first;
    SimulationOptions own = options.simulation;
    own.worlds = std::min(each, state.worlds - first);
    bool const all = own.worlds == state.worlds;
    tile.exec = all ? exec : detail::tile_exec(exec);
    tile.model = all ? model : of_worlds(model, first, own.worlds);
    tile.state = all ? state : of_worlds(state, first, own.worlds);
    tile.simulation = make_simulation(tile.exec, tile.model, compiled, own, all ? collision : of_worlds(collision, first, own.worlds));
    if (first > 0) {  // room that a thread has for its work, in whichever tile
      auto const& with = tiles.front().simulation;
      tile.simulation.dynamics.thread_items = with.dynamics.thread_items;
      tile.simulation.solution.thread_items = with.solution.thread_items;
      if constexpr (!is_device<Exec>) tile.simulation.newton.work = with.newton.work;
    }
    tiles.push_back(std::move(tile));
  }
  return tiles;
}

namespace detail {
/// Whether somebody hears what kernels and regions begin; who counts memory alone does not mind threads.
inline bool profiler_listens() {
  if (!Kokkos::Profiling::profileLibraryLoaded()) return false;
  auto const tool = Kokkos::Tools::Experimental::get_callbacks();
  return tool.push_region || tool.begin_parallel_for || tool.begin_parallel_scan || tool.begin_parallel_reduce || tool.begin_fence ||
         tool.begin_deep_copy;
}
}  // namespace detail

/// f(tile) for each, by the threads of `exec`: one tile is given to the caller's thread, and so are all, one after the other,
/// while a profiler listens that Kokkos Tools has connected, as these hear one thread. What `f` calls with the tile's own exec stays on its
/// thread. Returns when all are done. Errors: what `f` throws; of several the first tile's.
template <ExecutionSpace Exec, class R, class F>
void for_tiles(Exec const& exec, std::vector<Tile<R, Exec>>& tiles, F const& f) {
#ifdef KOKKOS_ENABLE_OPENMP
  if constexpr (std::is_same_v<Exec, Kokkos::OpenMP>) {
    if (tiles.size() > 1 && !detail::profiler_listens()) {
      std::size_t const count = tiles.size();
      std::vector<std::exception_ptr> errors(count);
      // Not a kernel of Kokkos: it would hold its instance while f lets go of memory, for which all instances have to rest.
#pragma omp parallel for schedule(dynamic, 1) num_threads(exec.concurrency())
      for (std::size_t k = 0; k < count; ++k) {
        try {
          f(tiles[k]);
        } catch (...) {
          errors[k] = std::current_exception();
        }
      }
      for (auto const& error : errors)
        if (error) std::rethrow_exception(error);
      return;
    }
  }
#endif
  for (auto& tile : tiles) f(tile);
}

/// `step` of all tiles, each as many steps as are asked for before its thread takes the next one.
/// @param more  as for `step`; what has values for each world is by the worlds of a tile, which begin with 0: call step in for_tiles then
template <ExecutionSpace Exec, class R, class... More>
void step(Exec const& exec, std::vector<Tile<R, Exec>>& tiles, StepOptions const& options = {}, More const&... more) {
  for_tiles(exec, tiles, [&](Tile<R, Exec>& tile) { step(tile.exec, tile.model, tile.state, tile.simulation, options, more...); });
}

}  // namespace gsp
