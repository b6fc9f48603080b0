#pragma once
#include <algorithm>
#include <gsp/core/detail/views.hpp>
#include <gsp/dynamics/dynamics.hpp>
#include <gsp/parallel/detail/thread_room.hpp>
#include <string>
#include <vector>

/// How gsp/dynamics/dynamics.hpp, where the contract stands, allocates; and what meets in a call of the stages.
namespace gsp {

template <class R, ExecutionSpace Exec, class Mem>
Dynamics<R, Mem> make_dynamics(Exec const& exec, Model<R, Mem> const& model, DynamicsOptions options) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::make_dynamics: the model is not accessible from this execution space");
  expects(options.worlds > 0, "gsp::make_dynamics: worlds must be positive and is " + std::to_string(options.worlds));
  detail::expects_values("gsp::make_dynamics", model, options.worlds);
  Dynamics<R, Mem> d;
  constexpr int W = Dynamics<R, Mem>::width;
  d.worlds = options.worlds;
  d.archetypes = model.host_archetypes;
  d.stamps = detail::make_stamps();
  d.padded_worlds = d.worlds < W ? d.worlds : (d.worlds + W - 1) / W * W;
  std::vector<int> archetype, first;
  std::vector<std::int64_t> offset;
  std::vector<DynamicsLayout> layout;
  std::int64_t size = 0;
  for (int k = 0; k < model.narchetype; ++k) {
    Archetype const& a = model.host_archetypes(k);
    int const blocks = int((std::int64_t(a.ninstance) * d.padded_worlds + W - 1) / W);
    first.push_back(int(archetype.size()));
    layout.push_back(DynamicsLayout(a));
    for (int b = 0; b < blocks; ++b) {
      archetype.push_back(k);
      offset.push_back(size);
      size += std::int64_t(is_device<Exec> ? layout.back().device_size : layout.back().size) * W;
    }
  }
  d.blocks = int(archetype.size());
  if constexpr (!is_device<Exec>) {
    int most = 0;
    for (int k = 0; k < model.narchetype; ++k) most = std::max(most, DynamicsLayout(model.host_archetypes(k)).size);
    d.thread_stride = most * W;
    d.thread_rooms = detail::thread_rooms(exec);
    d.thread_items = detail::allocate_zero<Kokkos::View<R*, Mem>>(exec, "gsp::Dynamics::thread_items",
                                                                  std::size_t(d.thread_stride) * std::size_t(d.thread_rooms));
  }
  d.items = detail::allocate_zero<Kokkos::View<R*, Mem>>(exec, "gsp::Dynamics::items", size);
  d.block_archetype = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Dynamics::block_archetype", archetype);
  d.block_offset = detail::to_device<Kokkos::View<std::int64_t*, Mem>>(exec, "gsp::Dynamics::block_offset", offset);
  d.left_step = detail::to_device<Kokkos::View<std::int64_t*, Mem>>(exec, "gsp::Dynamics::left_step",
                                                                    std::vector<std::int64_t>(std::size_t(d.worlds), -1));
  d.layouts = detail::to_device<Kokkos::View<DynamicsLayout*, Mem>>(exec, "gsp::Dynamics::layouts", layout);
  d.archetype_block = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Dynamics::archetype_block", first);
  return d;
}

namespace detail {
/// True where want(archetype) for any of the model's.
template <class R, class Mem, class Want>
bool any_archetype(Model<R, Mem> const& model, Want const& want) {
  for (int k = 0; k < model.narchetype; ++k)
    if (want(model.host_archetypes(k))) return true;
  return false;
}
// What meets in a call belongs together. Host integers alone: no allocation, no launch, no wait.

/// The dynamics have the layout that the model asks for, and the model values for all of their worlds.
template <class R, class Mem>
void expects_fit(char const* where, Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics) {
  expects_values(where, model, dynamics.worlds);
  if (dynamics.archetypes.data() == model.host_archetypes.data()) return;
  bool fits = int(dynamics.archetypes.extent(0)) == model.narchetype;
  for (int k = 0; k < model.narchetype && fits; ++k) {
    Archetype const& then = dynamics.archetypes(k);
    Archetype const& now = model.host_archetypes(k);
    fits = then.ninstance == now.ninstance && DynamicsLayout(then).size == DynamicsLayout(now).size;
  }
  if (!fits)
    throw std::invalid_argument(std::string(where) +
                                ": the dynamics were made for another model, for the other profile, or before make_per_world gave this "
                                "one more terms: call make_dynamics (or make_simulation) after make_per_world");
}
template <class R, class Mem>
void expects_fit(char const* where, Model<R, Mem> const& model, Poses<R, Mem> const& poses, int worlds) {
  expects_values(where, model, worlds);
  auto const fits = [&](auto const& view, int items, char const* name) {
    if (int(view.extent(1)) == items && (items == 0 || int(view.extent(0)) == worlds)) return;
    throw std::invalid_argument(std::string(where) + ": poses." + name + " are (" + std::to_string(view.extent(0)) + ", " +
                                std::to_string(view.extent(1)) + "), and the model and the worlds ask for (" + std::to_string(worlds) +
                                ", " + std::to_string(items) + "): call make_poses with this model and as many worlds");
  };
  fits(poses.xpos, model.nbody, "xpos");
  fits(poses.xquat, model.nbody, "xquat");
  fits(poses.xanchor, model.njnt, "xanchor");
  fits(poses.xaxis, model.njnt, "xaxis");
}
template <class R, class Mem>
void expects_fit(char const* where, Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, Poses<R, Mem> const& poses) {
  expects_fit(where, model, dynamics);
  expects_fit(where, model, poses, dynamics.worlds);
}
template <class R, class Mem>
void expects_fit(char const* where, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics) {
  if (state.worlds != dynamics.worlds)
    throw std::invalid_argument(std::string(where) + ": the state has " + std::to_string(state.worlds) + " worlds and the dynamics " +
                                std::to_string(dynamics.worlds) + ": make both for the same number");
  expects_fit(where, model, state);
  expects_fit(where, model, dynamics);
}
template <class R, class Mem>
void expects_fit(char const* where, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics,
                 Poses<R, Mem> const& poses) {
  expects_fit(where, model, state, dynamics);
  expects_fit(where, model, poses, dynamics.worlds);
}
/// Buffers (world, items) that a call takes besides.
template <class View>
void expects_rows(char const* where, char const* what, View const& view, int worlds, int items) {
  if (int(view.extent(1)) == items && (items == 0 || int(view.extent(0)) == worlds)) return;
  throw std::invalid_argument(std::string(where) + ": " + what + " is (" + std::to_string(view.extent(0)) + ", " +
                              std::to_string(view.extent(1)) + ") and must be (" + std::to_string(worlds) + ", " + std::to_string(items) +
                              ")");
}
/// Buffers (world, items, components).
template <class View>
void expects_rows(char const* where, char const* what, View const& view, int worlds, int items, int components) {
  if (int(view.extent(1)) == items && (items == 0 || (int(view.extent(0)) == worlds && int(view.extent(2)) == components))) return;
  auto const text = [](std::size_t a, std::size_t b, std::size_t c) {
    return "(" + std::to_string(a) + ", " + std::to_string(b) + ", " + std::to_string(c) + ")";
  };
  throw std::invalid_argument(std::string(where) + ": " + what + " is " + text(view.extent(0), view.extent(1), view.extent(2)) +
                              " and must be " + text(worlds, items, components));
}
}  // namespace detail

}  // namespace gsp
