#pragma once
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <gsp/core/detail/views.hpp>
#include <gsp/core/status.hpp>
#include <gsp/model/model.hpp>

/// What changes from step to step: plain (world, item) views in MuJoCo's order, to be read and written at will.
namespace gsp {

template <class R, class Mem>
struct State {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;
  View<R**> qpos;               // (world, nq) [m, rad]; quaternions w x y z are normalised where they are read
  View<R**> qpos_low;           // (world, nq) what rounding took from the positions of free bodies; the position is qpos + qpos_low
  View<R**> qvel;               // (world, nv) [m/s, rad/s]; free joint: velocity in world axes, then angular velocity in body axes
  View<R**> ctrl;               // (world, nu)
  View<R**> act;                // (world, na) activations of actuators with dynamics
  View<R***> mocap_pos;         // (world, nmocap, 3) [m] of the bodies that the user moves
  View<R***> mocap_quat;        // (world, nmocap, 4) w x y z, normalised where they are read
  View<R**> qfrc_applied;       // (world, nv) [N, N m]
  View<std::int64_t*> steps;    // (world) steps done; time = steps * timestep
  View<std::uint32_t*> status;  // (world) bits of core/status.hpp; 0: all is well. A world that is not finite is no longer stepped
  Kokkos::View<std::uint64_t, Kokkos::HostSpace> moment;  // host: changes whenever a step or reset moves the state on (dynamics/stamps.hpp)
};

namespace detail {
/// A number that no state has had before.
inline std::uint64_t next_moment() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}
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
  fits(s.qfrc_applied, model.nv, "qfrc_applied");
  if (int(s.steps.extent(0)) != s.worlds || int(s.status.extent(0)) != s.worlds)
    throw std::invalid_argument(std::string(where) + ": state.steps and state.status must have " + std::to_string(s.worlds) +
                                " worlds, as the state: call make_state");
}
}  // namespace detail

struct StateOptions {
  int worlds = 1;
};

namespace detail {
struct AllWorlds {
  KOKKOS_INLINE_FUNCTION bool operator()(int) const { return true; }
};
template <class R, class Mem, class Mask>
struct ResetWorlds {
  State<R, Mem> state, from;
  Field<R> qpos0;
  decltype(Model<R, Mem>::mocap_pose0) mocap_pose0;
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
    if (i < int(state.mocap_pos.extent(1))) {
      for (int c = 0; c < 3; ++c) state.mocap_pos(w, i, c) = given ? from.mocap_pos(start, i, c) : mocap_pose0(7 * i + c);
      for (int c = 0; c < 4; ++c) state.mocap_quat(w, i, c) = given ? from.mocap_quat(start, i, c) : mocap_pose0(7 * i + 3 + c);
    }
    if (i > 0) return;
    state.steps(w) = 0;
    state.status(w) = 0;
  }
};
}  // namespace detail

/// Worlds of the mask to the model's initial positions, at rest, without activation, forces or status bits, time 0; or, where `from` is
/// given, to its values (a world of its own each, or one for all), time 0. One launch. A world that is reset starts its next step without
/// the impulses of the last one. Does not allocate, does not fence.
/// Errors: std::invalid_argument for a state of another model, or of more worlds than the model has values for, and a mask or states to
/// start from of another size.
/// @param mask  callable with a world, such as a View<bool*> on the device; the other worlds keep all they have
template <class R, ExecutionSpace Exec, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void reset(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Mask const& mask, State<R, Mem> const& from = {}) {
  detail::expects_fit("gsp::reset", model, state);
  if (from.worlds > 0) detail::expects_fit("gsp::reset, states to start from", model, from);
  expects(from.worlds == 0 || from.worlds == 1 || from.worlds == state.worlds,
          "gsp::reset: the states to start from have " + std::to_string(from.worlds) + " worlds: give one, or one for each of the " +
              std::to_string(state.worlds));
  if constexpr (requires { mask.extent(0); })
    expects(int(mask.extent(0)) == state.worlds, "gsp::reset: the mask has " + std::to_string(mask.extent(0)) + " worlds and the state " +
                                                     std::to_string(state.worlds) + ": make them equal");
  detail::moves_on(state);
  int const items = std::max({model.nq, model.nv, model.na, model.nu, model.nmocap, 1});
  Kokkos::parallel_for("gsp::model::reset",
                       Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(state.worlds) * items),
                       detail::ResetWorlds<R, Mem, Mask>{state, from, model.qpos0, model.mocap_pose0, mask, items});
}

/// All worlds back to the model's initial positions, at rest, without activation, time 0.
template <class R, ExecutionSpace Exec, class Mem>
void reset(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state) {
  reset(exec, model, state, detail::AllWorlds{});
}

/// N worlds at the model's initial positions, at rest. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
State<R, Mem> make_state(Exec const& exec, Model<R, Mem> const& model, StateOptions options = {}) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::make_state: the model is not accessible from this execution space");
  expects(options.worlds > 0, "gsp::make_state: worlds must be positive");
  using S = State<R, Mem>;
  S s;
  s.worlds = options.worlds;
  auto const view = [&](std::string const& label, int items) {
    return detail::allocate<typename S::template View<R**>>(label, options.worlds, items);
  };
  s.qpos = view("gsp::State::qpos", model.nq);
  s.qpos_low = view("gsp::State::qpos_low", model.nq);
  s.qvel = view("gsp::State::qvel", model.nv);
  s.act = view("gsp::State::act", model.na);
  s.mocap_pos = detail::allocate<typename S::template View<R***>>("gsp::State::mocap_pos", options.worlds, model.nmocap, 3);
  s.mocap_quat = detail::allocate<typename S::template View<R***>>("gsp::State::mocap_quat", options.worlds, model.nmocap, 4);
  s.ctrl = view("gsp::State::ctrl", model.nu);
  s.qfrc_applied = view("gsp::State::qfrc_applied", model.nv);
  s.steps = detail::allocate<typename S::template View<std::int64_t*>>("gsp::State::steps", options.worlds);
  s.status = detail::allocate<typename S::template View<std::uint32_t*>>("gsp::State::status", options.worlds);
  s.moment = detail::allocate<Kokkos::View<std::uint64_t, Kokkos::HostSpace>>("gsp::State::moment");
  reset(exec, model, s, detail::AllWorlds{});
  return s;
}

}  // namespace gsp
