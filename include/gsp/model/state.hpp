#pragma once
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
  s.qpos = view("gsp::State::qpos", model.nq), s.qpos_low = view("gsp::State::qpos_low", model.nq),
  s.qvel = view("gsp::State::qvel", model.nv);
  s.act = view("gsp::State::act", model.na);
  s.mocap_pos = detail::allocate<typename S::template View<R***>>("gsp::State::mocap_pos", options.worlds, model.nmocap, 3);
  s.mocap_quat = detail::allocate<typename S::template View<R***>>("gsp::State::mocap_quat", options.worlds, model.nmocap, 4);
  s.ctrl = view("gsp::State::ctrl", model.nu), s.qfrc_applied = view("gsp::State::qfrc_applied", model.nv);
  s.steps = detail::allocate<typename S::template View<std::int64_t*>>("gsp::State::steps", options.worlds);
  s.status = detail::allocate<typename S::template View<std::uint32_t*>>("gsp::State::status", options.worlds);
  s.moment = detail::allocate<Kokkos::View<std::uint64_t, Kokkos::HostSpace>>("gsp::State::moment");
  reset(exec, model, s);
  return s;
}

/// All worlds back to the model's initial positions, at rest, without activation, time 0. Errors: std::invalid_argument for a state of
/// another model, or of more worlds than the model has values for.
template <class R, ExecutionSpace Exec, class Mem>
void reset(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& s) {
  detail::expects_fit("gsp::reset", model, s);
  detail::moves_on(s);
  auto const qpos0 = model.qpos0;
  auto const qpos = s.qpos;
  int const nq = model.nq;
  Kokkos::parallel_for(
      "gsp::model::reset", Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(s.worlds) * nq),
      KOKKOS_LAMBDA(std::int64_t i) { qpos(i / nq, i % nq) = qpos0(int(i / nq), int(i % nq)); });
  if (model.nmocap > 0) {
    auto const pose = model.mocap_pose0;
    auto const mocap_pos = s.mocap_pos, mocap_quat = s.mocap_quat;
    int const nmocap = model.nmocap;
    Kokkos::parallel_for(
        "gsp::model::reset_mocap", Kokkos::RangePolicy<Exec>(exec, 0, s.worlds * nmocap), KOKKOS_LAMBDA(int i) {
          for (int c = 0; c < 3; ++c) mocap_pos(i / nmocap, i % nmocap, c) = pose(7 * (i % nmocap) + c);
          for (int c = 0; c < 4; ++c) mocap_quat(i / nmocap, i % nmocap, c) = pose(7 * (i % nmocap) + 3 + c);
        });
  }
  detail::zero(exec, s.act), detail::zero(exec, s.qpos_low), detail::zero(exec, s.qvel), detail::zero(exec, s.ctrl),
      detail::zero(exec, s.qfrc_applied);
  detail::zero(exec, s.steps), detail::zero(exec, s.status);
}

}  // namespace gsp
