#pragma once
#include <algorithm>
#include <exception>
#include <gsp/collision/geom_values.hpp>
#include <gsp/core/region.hpp>
#include <gsp/model/world_values.hpp>
#include <gsp/step/detail/snapshot_kernels.hpp>
#include <gsp/step/step.hpp>
#include <memory>
#include <utility>
#include <vector>
#ifdef KOKKOS_ENABLE_OPENMP
#include <omp.h>
#endif

/// Many worlds on many cores: worlds of a host lie in tiles, and a thread takes a tile through whole steps, in its core's caches, without
/// waiting for the others. Worlds are alone, so the bits are those of one simulation of all.
namespace gsp {

namespace detail {
inline bool has_worlds(int worlds, int first, int count) { return first >= 0 && count > 0 && count <= worlds && first <= worlds - count; }
}  // namespace detail

/// Worlds first ... first + count - 1, whose arrays are rows of the others. What has been computed of one of the two states asks that one
/// alone whether it has moved on. Errors: std::invalid_argument for worlds that there are not.
template <class R, class Mem>
State<R, Mem> of_worlds(State<R, Mem> const& state, int first, int count) {
  expects(detail::has_worlds(state.worlds, first, count), "gsp::of_worlds: there are " + std::to_string(state.worlds) +
                                                              " worlds, and not " + std::to_string(count) + " from " +
                                                              std::to_string(first) + " on");
  State<R, Mem> part;
  part.worlds = count;
  detail::each_state_view([&](char const*, auto const& from, auto& to) { to = detail::rows_of(from, first, count); }, state, part);
  part.moment = detail::allocate<decltype(part.moment)>("gsp::State::moment");
  detail::moves_on(part);
  return part;
}
template <class R, class Mem>
Poses<R, Mem> of_worlds(Poses<R, Mem> const& poses, int first, int count) {
  int const worlds = int(poses.xpos.extent(0));
  expects(detail::has_worlds(worlds, first, count), "gsp::of_worlds: the poses are of " + std::to_string(worlds) + " worlds, and not of " +
                                                        std::to_string(count) + " from " + std::to_string(first) + " on");
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

namespace detail {
/// Room of a thread, which lends it to the simulation of the tile that it has come to: tiles are more than threads.
template <class R, class Mem>
struct ThreadWork {
  Simulation<R, Mem> room;
  /// @param all  what a step finds, or the room for its work alone
  void swap_with(Simulation<R, Mem>& sim, bool all) {
    if (all) {
      std::swap(sim.dynamics, room.dynamics);
      std::swap(sim.contacts, room.contacts);
      std::swap(sim.rows, room.rows);
      std::swap(sim.solution, room.solution);
      std::swap(sim.newton, room.newton);
      std::swap(sim.side, room.side);
      return;
    }
    std::swap(sim.dynamics.thread_items, room.dynamics.thread_items);
    std::swap(sim.dynamics.thread_rooms, room.dynamics.thread_rooms);
    std::swap(sim.solution.thread_items, room.solution.thread_items);
    std::swap(sim.solution.island_items, room.solution.island_items);
    std::swap(sim.solution.island_stride, room.solution.island_stride);
    std::swap(sim.solution.thread_rooms, room.solution.thread_rooms);
    std::swap(sim.newton.work, room.newton.work);
    std::swap(sim.newton.thread_rooms, room.newton.thread_rooms);
  }
};
}  // namespace detail

/// Some of the worlds, with all that a step of them needs, but for what for_tiles lends. Its state, and what its model has for each world,
/// are rows of the whole.
template <class R, ExecutionSpace Exec>
struct Tile {
  using memory_space = typename Exec::memory_space;
  Exec exec;
  int first = 0;  // of its worlds
  Model<R, memory_space> model;
  State<R, memory_space> state;
  Simulation<R, memory_space> simulation;
  std::shared_ptr<std::vector<detail::ThreadWork<R, memory_space>>> work;  // of the threads that take tiles; null: one tile has its own
  bool shares = false;                                                     // TilesOptions::share
  int worlds() const { return state.worlds; }
};

struct TilesOptions {
  SimulationOptions simulation = {};  // its `worlds` are the state's
  int worlds = 0;      // of a tile; 0: two tiles for each thread of `exec`, of whole packs, at most 128 trees where that is a pack or more;
                       // where that are fewer tiles than threads, one
  bool share = false;  // tiles have states, poses and impulses of their own, and share what a step finds: for many worlds in little memory
};

namespace detail {
template <class Exec>
inline constexpr bool has_tiles = false;
#ifdef KOKKOS_ENABLE_OPENMP
template <>
inline constexpr bool has_tiles<Kokkos::OpenMP> = true;
#endif
/// Worlds of a tile where nobody says. A tile smaller than a pack of lanes leaves lanes empty, and the work of large tiles does not stay in
/// caches. Worlds that make fewer tiles than there are threads are stepped by all of them together: one tile.
template <class R, class Exec, class Mem>
int worlds_of_a_tile(Exec const& exec, Model<R, Mem> const& model, int worlds) {
  if (!has_tiles<Exec> || host_threads(exec) == 1) return worlds;
  constexpr int pack = native_width<R>;
  int const threads = host_threads(exec), even = (worlds + 2 * threads - 1) / (2 * threads);
  int const most = std::max(1, 128 / std::max(1, model.ntree) / pack), each = pack * std::min(most, (even + pack - 1) / pack);
  return worlds > each * (threads - 1) ? each : worlds;
}
/// One instance of the execution space for each tile, as an instance runs one kernel at a time.
template <class Exec>
Exec tile_exec([[maybe_unused]] Exec const& exec) {
  if constexpr (has_tiles<Exec>)
    return Exec(1);
  else
    return exec;
}
}  // namespace detail

/// Tiles for all worlds of `state`; on a device, and on a host of one thread, one. Allocates.
/// @param model      what `state` was made from, with values for each world (model/world_values.hpp) or without
/// @param collision  the shapes, with such values or without: make_collision_model
/// Made, and let go of, outside of parallel regions. Errors: those of make_simulation; std::invalid_argument for tiles of fewer than no
/// worlds, and where model or shapes have values for fewer worlds than the state.
template <class R, ExecutionSpace Exec, class Mem>
std::vector<Tile<R, Exec>> make_tiles(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled,
                                      CollisionModel<R, Mem> const& collision, State<R, Mem> const& state,
                                      TilesOptions const& options = {}) {
  expects(options.worlds >= 0, "gsp::make_tiles: a tile must have some worlds, and has " + std::to_string(options.worlds));
  expects(options.worlds > 0 || !options.share, "gsp::make_tiles: tiles that share are of a size that you say: give `worlds` too");
#ifdef KOKKOS_ENABLE_OPENMP
  expects(!detail::has_tiles<Exec> || !omp_in_parallel(), "gsp::make_tiles: within a parallel region (in for_tiles): make tiles before it");
#endif
  detail::expects_fit("gsp::make_tiles", model, state);
  detail::expects_values("gsp::make_tiles", collision, state.worlds);
  int const each = options.worlds > 0 ? options.worlds : detail::worlds_of_a_tile(exec, model, state.worlds);
  std::vector<Tile<R, Exec>> tiles;
  auto const work = std::make_shared<std::vector<detail::ThreadWork<R, Mem>>>();
  int const threads = is_device<Exec> ? 1 : detail::host_threads(exec);  // that take tiles
  for (int first = 0; first < state.worlds; first += each) {
    Tile<R, Exec> tile;
    tile.first = first;
    SimulationOptions own = options.simulation;
    own.worlds = std::min(each, state.worlds - first);
    bool const all = own.worlds == state.worlds;
    tile.exec = all ? exec : detail::tile_exec(exec);
    tile.model = all ? model : of_worlds(model, first, own.worlds);
    tile.state = all ? state : of_worlds(state, first, own.worlds);
    auto& sim = tile.simulation;
    auto const shapes = all ? collision : of_worlds(collision, first, own.worlds);
    tile.shares = options.share && !all && own.worlds == each;  // a smaller one at the end has what it needs
    bool const has_room = int(work->size()) < threads && tile.shares == options.share;
    if (tile.shares && !has_room) {
      detail::expects_can_step(tile.model, compiled, own);
      sim.collision = shapes;
      detail::make_kept(tile.exec, tile.model, compiled, own, work->front().room.rows, sim);
    } else {
      sim = make_simulation(tile.exec, tile.model, compiled, own, shapes);
    }
    if (!all) {
      detail::ThreadWork<R, Mem> lent;
      if (has_room || !tile.shares) lent.swap_with(sim, tile.shares);
      if (has_room) work->push_back(lent);
      tile.work = work;
    }
    tiles.push_back(std::move(tile));
  }
  return tiles;
}

namespace detail {
/// Whether a profiler hears when kernels and regions begin. (One that hears of memory alone may be called by several threads.)
inline bool profiler_listens() {
  if (!Kokkos::Profiling::profileLibraryLoaded()) return false;
  auto const tool = Kokkos::Tools::Experimental::get_callbacks();
  return tool.push_region || tool.begin_parallel_for || tool.begin_parallel_scan || tool.begin_parallel_reduce || tool.begin_fence ||
         tool.begin_deep_copy;
}
/// The tile has the room of this thread for as long as this lives.
template <class R, class Exec>
class WithWork {
 public:
  WithWork(Tile<R, Exec>& tile, int thread) : tile_(tile), thread_(std::size_t(thread)) { swap(); }
  ~WithWork() { swap(); }
  WithWork(WithWork const&) = delete;
  WithWork& operator=(WithWork const&) = delete;

 private:
  void swap() {
    if (tile_.work) (*tile_.work)[thread_].swap_with(tile_.simulation, tile_.shares);
  }
  Tile<R, Exec>& tile_;
  std::size_t thread_;
};
/// What a step did not fit into lies in the room that others get next.
template <class R, class Exec>
void expects_done(Tile<R, Exec> const& tile) {
  if (tile.shares && tile.simulation.impulses.stamp.data() && tile.simulation.impulses.stamp().launched)
    throw std::invalid_argument("gsp::for_tiles: steps of the tile of worlds " + std::to_string(tile.first) +
                                " ... were launched and not settled, and its room goes to another: call settle before f returns");
}
}  // namespace detail

/// f(tile) for each, several at a time, a thread of `exec` each; on the caller's thread, one after the other, where there is one tile, and
/// while a profiler listens that Kokkos Tools has connected, as these hear one thread. Of tiles that share all that f reads of a step is
/// made in the same call of it, and steps are settled there. Kernels that `f` launches with the tile's own exec stay on its thread: of
/// ranges (RangePolicy), since a tile's exec has no teams there. Returns when all are done. Errors: what `f` throws, of several the first
/// tile's; the other tiles have been done with, so worlds of a step that threw for want of memory are a step apart: reset or restore them.
template <ExecutionSpace Exec, class R, class F>
void for_tiles(Exec const& exec, std::vector<Tile<R, Exec>>& tiles, F const& f) {
#ifdef KOKKOS_ENABLE_OPENMP
  std::size_t const count = tiles.size();
  if constexpr (detail::has_tiles<Exec>)
    if (count > 1 && !detail::profiler_listens()) {
      auto const threads = std::min({count, tiles.front().work->size(), std::size_t(detail::host_threads(exec))});
      std::vector<std::exception_ptr> errors(count);
      // Not a kernel of Kokkos: it would hold its instance while f lets go of memory, for which all instances have to rest.
#pragma omp parallel for schedule(dynamic, 1) num_threads(int(threads))
      for (std::size_t k = 0; k < count; ++k) {
        try {
          detail::WithWork const lent(tiles[k], omp_get_thread_num());
          f(tiles[k]);
          detail::expects_done(tiles[k]);
        } catch (...) { errors[k] = std::current_exception(); }
      }
      for (auto const& error : errors)
        if (error) std::rethrow_exception(error);
      return;
    }
#endif
  for (auto& tile : tiles) {
    detail::WithWork const lent(tile, 0);
    f(tile);
    detail::expects_done(tile);
  }
}

/// `step` of all tiles, each as many steps as are asked for before its thread takes the next one.
/// @param more  as for `step`; what has values for each world is by the worlds of a tile, which begin with 0: call step in for_tiles then
template <ExecutionSpace Exec, class R, class... More>
void step(Exec const& exec, std::vector<Tile<R, Exec>>& tiles, StepOptions const& options = {}, More const&... more) {
  for_tiles(exec, tiles, [&](Tile<R, Exec>& tile) { step(tile.exec, tile.model, tile.state, tile.simulation, options, more...); });
}

}  // namespace gsp
