#pragma once
#include <algorithm>
#include <cstdint>
#include <gsp/core/status.hpp>
#include <gsp/model/detail/state_kernels.hpp>
#include <gsp/model/model.hpp>

/// What changes from step to step: plain (world, item) views in MuJoCo's order, to be read and written at will.
namespace gsp {

/// The state of `worlds` worlds. `make_state` allocates it; copies share its arrays.
template <class R, class Mem>
struct State {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;
  View<R**> qpos;               // (world, nq) [m, rad]; quaternions w x y z are normalised where they are read
  View<R**> qpos_low;           // (world, nq) what rounding took from the positions, which are qpos + qpos_low
  View<R**> qvel;               // (world, nv) [m/s, rad/s]; free joint: velocity in world axes, then angular velocity in body axes
  View<R**> ctrl;               // (world, nu)
  View<R**> act;                // (world, na) activations of actuators with dynamics
  View<R***> mocap_pos;         // (world, nmocap, 3) [m] of the bodies that the user moves
  View<R***> mocap_quat;        // (world, nmocap, 4) w x y z, normalised where they are read
  View<int**> eq_active;        // (world, neq) not 0: this equality constraint acts
  View<R**> qfrc_applied;       // (world, nv) [N, N m]
  View<std::int64_t*> steps;    // (world) steps done; time = steps * timestep
  View<std::uint32_t*> status;  // (world) bits of core/status.hpp; 0: all is well. A world that is stopped stays as it was
  Kokkos::View<std::uint64_t, Kokkos::HostSpace> moment;  // host: changes whenever a step or reset moves the state on (dynamics/stamps.hpp)
};

struct StateOptions {
  int worlds = 1;
};

/// Worlds of the mask to the model's initial positions, at rest, without activation, forces or status bits, time 0; or, where `from` is
/// given, to its values (a world of its own each, or one for all), time 0. One launch. A world that is reset starts its next step without
/// the impulses of the last one. After launch_step call settle first: steps that did not fit would be repeated from here. Does not
/// allocate, does not fence.
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
  detail::expects_mask("gsp::reset", mask, "state", state.worlds);
  detail::moves_on(state);
  int const items = std::max({model.nq, model.nv, model.na, model.nu, model.nmocap, model.neq, 1});
  Kokkos::parallel_for("gsp::model::reset",
                       Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(state.worlds) * items),
                       detail::ResetWorlds<R, Mem, Mask>{state, from, model.qpos0, model.mocap_pose0, model.eq_active0, mask, items});
}

/// All worlds back to the model's initial positions, at rest, without activation, time 0.
template <class R, ExecutionSpace Exec, class Mem>
void reset(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state) {
  reset(exec, model, state, detail::AllWorlds{});
}

/// `options.worlds` worlds at the model's initial positions, at rest. Allocates.
/// Errors: std::invalid_argument for worlds < 1, and for more than the model has values for.
template <class R, ExecutionSpace Exec, class Mem>
State<R, Mem> make_state(Exec const& exec, Model<R, Mem> const& model, StateOptions options = {}) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::make_state: the model is not accessible from this execution space");
  expects(options.worlds > 0, "gsp::make_state: worlds must be positive and is " + std::to_string(options.worlds));
  State<R, Mem> s;
  detail::allocate_state(model, options.worlds, s);
  reset(exec, model, s, detail::AllWorlds{});
  return s;
}

}  // namespace gsp
