#pragma once
#include <cstdint>
#include <gsp/core/detail/views.hpp>
#include <gsp/fwd.hpp>
#include <gsp/model/detail/stamp.hpp>
#include <gsp/model/model.hpp>
#include <string>

/// Kernels and arrays of gsp/model/state.hpp, where the contract stands.
namespace gsp::detail {

/// The state moves on: what was computed of it is of the state before.
template <class R, class Mem>
void moves_on(State<R, Mem> const& s) {
  if (s.moment.data()) s.moment() = next_moment();
}
/// Worlds of the state and of the model's own values, and the sizes of the state's arrays. Host integers alone.
template <class R, class Mem>
void expects_fit(char const* where, Model<R, Mem> const& model, State<R, Mem> const& s) {
  expects_values(where, model, s.worlds);
  auto const fits = [&](auto const& view, int items, char const* name) {
    if (int(view.extent(1)) == items && (items == 0 || int(view.extent(0)) == s.worlds)) return;
    throw std::invalid_argument(std::string(where) + ": state." + name + " is (" + std::to_string(view.extent(0)) + ", " +
                                std::to_string(view.extent(1)) + "), and the model and the state's worlds ask for (" +
                                std::to_string(s.worlds) + ", " + std::to_string(items) + "): call make_state with this model");
  };
  fits(s.qpos, model.nq, "qpos");
  fits(s.qpos_low, model.nq, "qpos_low");
  fits(s.qvel, model.nv, "qvel");
  fits(s.ctrl, model.nu, "ctrl");
  fits(s.act, model.na, "act");
  fits(s.mocap_pos, model.nmocap, "mocap_pos");
  fits(s.mocap_quat, model.nmocap, "mocap_quat");
  fits(s.eq_active, model.neq, "eq_active");
  fits(s.qfrc_applied, model.nv, "qfrc_applied");
  if (int(s.steps.extent(0)) != s.worlds || int(s.status.extent(0)) != s.worlds)
    throw std::invalid_argument(std::string(where) + ": state.steps and state.status must have " + std::to_string(s.worlds) +
                                " worlds, as the state: call make_state");
}

struct AllWorlds {
  KOKKOS_INLINE_FUNCTION bool operator()(int) const { return true; }
};
template <class R, class Mem, class Mask>
struct ResetWorlds {
  State<R, Mem> state, from;
  Field<R> qpos0;
  decltype(Model<R, Mem>::mocap_pose0) mocap_pose0;
  typename Model<R, Mem>::template Array<int> eq_active0;
  Mask mask;
  int items;  // of the longest array
  KOKKOS_FUNCTION void operator()(std::int64_t at) const {
    int const w = int(at / items), i = int(at % items), start = from.worlds == 1 ? 0 : w;
    if (!mask(w)) return;
    bool const given = from.worlds > 0;
    if (i < int(state.qpos.extent(1))) {
      state.qpos(w, i) = given ? from.qpos(start, i) : qpos0(w, i);
      state.qpos_low(w, i) = given ? from.qpos_low(start, i) : R(0);
    }
    if (i < int(state.qvel.extent(1))) {
      state.qvel(w, i) = given ? from.qvel(start, i) : R(0);
      state.qfrc_applied(w, i) = given ? from.qfrc_applied(start, i) : R(0);
    }
    if (i < int(state.act.extent(1))) state.act(w, i) = given ? from.act(start, i) : R(0);
    if (i < int(state.ctrl.extent(1))) state.ctrl(w, i) = given ? from.ctrl(start, i) : R(0);
    if (i < int(state.eq_active.extent(1))) state.eq_active(w, i) = given ? from.eq_active(start, i) : eq_active0(i);
    if (i < int(state.mocap_pos.extent(1))) {
      for (int c = 0; c < 3; ++c) state.mocap_pos(w, i, c) = given ? from.mocap_pos(start, i, c) : mocap_pose0(7 * i + c);
      for (int c = 0; c < 4; ++c) state.mocap_quat(w, i, c) = given ? from.mocap_quat(start, i, c) : mocap_pose0(7 * i + 3 + c);
    }
    if (i > 0) return;
    state.steps(w) = 0;
    state.status(w) = 0;
  }
};

/// The arrays of `worlds` worlds, without values.
template <class R, class Mem>
void allocate_state(Model<R, Mem> const& model, int worlds, State<R, Mem>& s) {
  using S = State<R, Mem>;
  s.worlds = worlds;
  auto const view = [&](std::string const& label, int items) { return allocate<typename S::template View<R**>>(label, worlds, items); };
  s.qpos = view("gsp::State::qpos", model.nq);
  s.qpos_low = view("gsp::State::qpos_low", model.nq);
  s.qvel = view("gsp::State::qvel", model.nv);
  s.act = view("gsp::State::act", model.na);
  s.mocap_pos = allocate<typename S::template View<R***>>("gsp::State::mocap_pos", worlds, model.nmocap, 3);
  s.mocap_quat = allocate<typename S::template View<R***>>("gsp::State::mocap_quat", worlds, model.nmocap, 4);
  s.ctrl = view("gsp::State::ctrl", model.nu);
  s.eq_active = allocate<typename S::template View<int**>>("gsp::State::eq_active", worlds, model.neq);
  s.qfrc_applied = view("gsp::State::qfrc_applied", model.nv);
  s.steps = allocate<typename S::template View<std::int64_t*>>("gsp::State::steps", worlds);
  s.status = allocate<typename S::template View<std::uint32_t*>>("gsp::State::status", worlds);
  s.moment = allocate<Kokkos::View<std::uint64_t, Kokkos::HostSpace>>("gsp::State::moment");
}

}  // namespace gsp::detail
