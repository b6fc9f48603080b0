#pragma once
#include <cstdint>
#include <gsp/core/check.hpp>
#include <gsp/core/detail/views.hpp>
#include <gsp/model/state.hpp>
#include <string>

/// What the dynamics hold, and of which state: host-side stamps that each stage sets and each reader checks, so that a number which no
/// stage has left, or which is of another state, is an error on every backend alike. Host integers alone: no allocation, no launch, no
/// wait.
namespace gsp {

/// What the stages leave in Dynamics::items.
enum class Quantity : int {
  motion,           // com, cdof: centres of mass, motions of the dofs
  velocity,         // qvel as it was read
  tendon_length,    // and moment arms
  act_length,       // lengths of actuators
  activation_rate,  // act_dot
  factor,           // factor, inverse_diagonal of the matrix that moves the robot
  free_velocity,    // velocity, spin: without constraints; integrate makes the new velocity of it
  mass,             // M
  force,            // passive - bias + actuator + applied
  derivative,       // of the forces by velocity, for implicit integrators
  bias,
  passive,
  actuator,  // forces, velocities and moments of actuators
  implicit,  // stiffness and damping that the factored matrix takes implicitly
  acceleration,
  tendon_velocity
};

namespace detail {
inline constexpr int quantities = 16;
inline constexpr int derivative_stages = 3;  // bias_forces, passive_forces, actuator_forces
inline constexpr int implicit_stages = 2;    // actuator_forces, factor
struct QuantityInfo {
  Quantity quantity;
  char const* name;
  char const* stage;  // the single function that leaves it
  bool always;        // smooth_dynamics leaves it without keep_all
};
inline constexpr QuantityInfo quantity_table[quantities] = {
    {Quantity::motion, "the centres of mass and the motions of the dofs", "mass_matrix", true},
    {Quantity::velocity, "the velocities", "bias_forces", true},
    {Quantity::tendon_length, "the lengths of the tendons", "passive_forces", true},
    {Quantity::act_length, "the lengths of the actuators", "actuator_forces", true},
    {Quantity::activation_rate, "the rates of the activations", "actuator_forces", true},
    {Quantity::factor, "the entries of the factored matrix", "factor", true},
    {Quantity::free_velocity, "the velocities without constraints", "factor", true},
    {Quantity::mass, "the entries of M", "mass_matrix", false},
    {Quantity::force, "the total forces", "factor", false},
    {Quantity::derivative, "the derivatives of the forces by velocity", "bias_forces, passive_forces and actuator_forces, in this order",
     false},
    {Quantity::bias, "the bias forces", "bias_forces", false},
    {Quantity::passive, "the passive forces", "passive_forces", false},
    {Quantity::actuator, "the actuator forces", "actuator_forces", false},
    {Quantity::implicit, "the implicit stiffness and damping", "actuator_forces and factor", false},
    {Quantity::acceleration, "the accelerations without constraints", "factor", false},
    {Quantity::tendon_velocity, "the velocities of the tendons", "passive_forces", false},
};
constexpr bool quantity_table_is_complete() {
  for (int i = 0; i < quantities; ++i)
    if (quantity_table[i].quantity != Quantity(i)) return false;
  return true;
}
static_assert(quantity_table_is_complete());

/// A set of quantities.
struct Quantities {
  std::uint32_t bits = 0;
  constexpr bool has(Quantity q) const { return (bits >> int(q)) & 1u; }
};
constexpr Quantities set_of(auto... quantity) { return {((1u << int(quantity)) | ... | 0u)}; }
constexpr Quantities operator|(Quantities a, Quantities b) { return {a.bits | b.bits}; }

/// What smooth_dynamics leaves: without keep_all, what constraints and integrate need; profile mujoco's integrator takes M again.
constexpr Quantities left_by_smooth(bool keep_all, bool keep_mass) {
  Quantities left;
  for (auto const& q : quantity_table)
    if (q.always || keep_all) left = left | set_of(q.quantity);
  if (keep_mass) left = left | set_of(Quantity::mass, Quantity::derivative, Quantity::force);
  return left;
}

/// A state at a moment, which changes whenever gsp moves the state on. A state without a counter has moment 0.
struct Stamp {
  void const* qpos = nullptr;  // null: nothing there
  std::uint64_t moment = 0;
  int level = 0;                                           // of what several stages add to: how many have
  Kokkos::View<std::uint64_t, Kokkos::HostSpace> counter;  // the state's
  bool is_same(Stamp const& o) const { return qpos == o.qpos && moment == o.moment; }
  bool is_past() const { return counter.data() && counter() != moment; }
  template <class State>
  bool is_of(State const& state) const {
    return qpos == state.qpos.data() && moment == (state.moment.data() ? state.moment() : 0);
  }
  template <class State>
  void set(State const& state) {
    qpos = state.qpos.data();
    moment = state.moment.data() ? state.moment() : 0;
    level = 0;
    if (counter.data() != state.moment.data()) counter = state.moment;
  }
};
using Stamps = Kokkos::View<Stamp*, Kokkos::HostSpace>;  // (quantities)
inline Stamps make_stamps() { return Stamps(Kokkos::view_alloc("gsp::Dynamics::stamps", Kokkos::SequentialHostInit), quantities); }

template <class Dynamics, class State>
void leaves(Dynamics const& dynamics, State const& state, Quantities what) {
  for (int i = 0; i < quantities; ++i)
    if (what.has(Quantity(i))) dynamics.stamps(i).set(state);
}
template <class Dynamics>
void loses(Dynamics const& dynamics, Quantities what) {
  for (int i = 0; i < quantities; ++i)
    if (what.has(Quantity(i))) dynamics.stamps(i).qpos = nullptr;
}
/// What a stage writes for some trees and not for others stays valid where it is of this state already.
template <class Dynamics, class State>
void writes_some(Dynamics const& dynamics, State const& state, Quantities what) {
  for (int i = 0; i < quantities; ++i)
    if (what.has(Quantity(i)) && !dynamics.stamps(i).is_of(state)) dynamics.stamps(i).qpos = nullptr;
}
/// What several stages add to, one after the other: the first of them writes it.
template <class Dynamics, class State>
void begins(Dynamics const& dynamics, State const& state, Quantity what) {
  leaves(dynamics, state, set_of(what));
  dynamics.stamps(int(what)).level = 1;
}
/// ... the next ones add, after `before` others.
template <class Dynamics, class State>
void continues(Dynamics const& dynamics, State const& state, Quantity what, int before) {
  Stamp& own = dynamics.stamps(int(what));
  if (own.is_of(state) && own.level == before)
    ++own.level;
  else
    own.level = 0;
}
/// All stages at once.
template <class Dynamics>
void completes(Dynamics const& dynamics) {
  dynamics.stamps(int(Quantity::derivative)).level = derivative_stages;
  dynamics.stamps(int(Quantity::implicit)).level = implicit_stages;
}
inline constexpr Quantities all_quantities{(1u << quantities) - 1};

[[noreturn]] inline void refuse_quantity(char const* where, Quantity what, std::string const& why) {
  QuantityInfo const& q = quantity_table[int(what)];
  throw std::invalid_argument(std::string(where) + ": " + q.name + " " + why + ": call smooth_dynamics" +
                              (q.always ? "" : "(..., {.keep_all = true})") + " first (or " + q.stage + ")");
}
/// The dynamics hold these quantities, of whatever state.
template <class Dynamics>
void expects_held(char const* where, Dynamics const& dynamics, Quantities what) {
  for (auto const& q : quantity_table)
    if (what.has(q.quantity) && !dynamics.stamps(int(q.quantity)).qpos)
      refuse_quantity(where, q.quantity, "are not in the dynamics, as the last stage did not keep them");
}
/// ... and all of one state.
template <class Dynamics>
void expects_together(char const* where, Dynamics const& dynamics, Quantities what) {
  expects_held(where, dynamics, what);
  Stamp const* first = nullptr;
  for (auto const& q : quantity_table) {
    if (!what.has(q.quantity)) continue;
    Stamp const& own = dynamics.stamps(int(q.quantity));
    if (own.is_past()) refuse_quantity(where, q.quantity, "are of the state before its last step or reset");
    if (first && !first->is_same(own)) refuse_quantity(where, q.quantity, "are of another state than the rest of the dynamics");
    first = &own;
  }
}
/// ... and of this state, as it is now.
template <class Dynamics, class State>
void expects_of(char const* where, Dynamics const& dynamics, State const& state, Quantities what) {
  expects_held(where, dynamics, what);
  for (auto const& q : quantity_table) {
    if (!what.has(q.quantity)) continue;
    Stamp const& own = dynamics.stamps(int(q.quantity));
    if (own.is_of(state)) continue;
    bool const before = own.qpos == state.qpos.data();
    refuse_quantity(where, q.quantity, before ? "are of the state before its last step or reset" : "are of another state");
  }
}
/// All stages that add to it have run once, for this state as it is now.
template <class Dynamics, class State>
void expects_complete(char const* where, Dynamics const& dynamics, State const& state, Quantity what, int stages) {
  expects_of(where, dynamics, state, set_of(what));
  if (dynamics.stamps(int(what)).level != stages) refuse_quantity(where, what, "are not complete, or hold a stage twice");
}
}  // namespace detail

}  // namespace gsp
