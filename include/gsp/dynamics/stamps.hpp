#pragma once
#include <cstdint>
#include <gsp/core/check.hpp>
#include <gsp/core/detail/views.hpp>
#include <gsp/model/detail/stamp.hpp>
#include <gsp/model/poses.hpp>
#include <gsp/model/state.hpp>
#include <string>

/// What the dynamics and the poses hold, and of which state: host-side stamps that each stage sets and each reader checks, so that a number
/// which no stage has left, or which is of another state, is an error on every backend alike. Host integers alone: no allocation, no
/// launch, no wait.
namespace gsp {

/// What the stages leave in Dynamics::items.
enum class Quantity : int {
  motion,           // com, cdof: centres of mass, motions of the dofs
  velocity,         // qvel as it was read
  tendon_length,    // and moment arms
  act_length,       // lengths of actuators
  activation_rate,  // act_dot
  factor,           // factor, inverse_diagonal of the matrix that moves the robot
  free_velocity,    // velocity, push: without constraints; integrate makes the new velocity of it
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

/// The free velocities are without what StiffForces has (stiff_rows).
template <class Dynamics>
void set_leaves_stiff_forces(Dynamics const& dynamics, bool leaves) {
  dynamics.stamps(int(Quantity::free_velocity)).level = leaves;
}
template <class Dynamics>
bool leaves_stiff_forces(Dynamics const& dynamics) {
  return dynamics.stamps(int(Quantity::free_velocity)).level == 1;
}

/// The free velocities have become those of the end (new_velocity): impulses would enter twice.
template <class Dynamics>
void set_has_impulses(Dynamics const& dynamics) {
  dynamics.stamps(int(Quantity::free_velocity)).level = 2;
}
template <class Dynamics>
void expects_without_impulses(char const* where, Dynamics const& dynamics) {
  if (dynamics.stamps(int(Quantity::free_velocity)).level == 2)
    throw std::invalid_argument(std::string(where) +
                                ": new_velocity has made the velocities of the end of those without constraints: call smooth_dynamics (or "
                                "factor) again");
}

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
    refuse_quantity(where, q.quantity, own.fault(state.qpos.data()));
  }
}
/// All stages that add to it have run once, for this state as it is now.
template <class Dynamics, class State>
void expects_complete(char const* where, Dynamics const& dynamics, State const& state, Quantity what, int stages) {
  expects_of(where, dynamics, state, set_of(what));
  if (dynamics.stamps(int(what)).level != stages) refuse_quantity(where, what, "are not complete, or hold a stage twice");
}

/// Poses that were computed of this state.
template <class R, class Mem, class State>
void leaves_poses(Poses<R, Mem> const& poses, State const& state, bool joints) {
  if (!poses.stamp.data()) return;
  poses.stamp().bodies.set(state);
  if (joints) poses.stamp().joints.set(state);
}
/// gsp has written them; else they are a user's own, and taken as they are.
template <class R, class Mem>
bool is_stamped(Poses<R, Mem> const& poses) {
  return poses.stamp.data() && poses.stamp().bodies.qpos;
}
/// Poses of this state, as it is now: of bodies and, where they are read, of joints.
template <class R, class Mem, class State>
void expects_poses_of(char const* where, Poses<R, Mem> const& poses, State const& state, bool joints = false) {
  if (!is_stamped(poses)) return;
  auto const& [of_bodies, of_joints] = poses.stamp();
  auto const refuse = [&](std::string const& what, Stamp const& own, std::string const& call) {
    bool const another = own.qpos && own.qpos != state.qpos.data();
    throw std::invalid_argument(std::string(where) + ": " + what + own.fault(state.qpos.data()) +
                                (another ? " than the one given (their qpos lies elsewhere): give the poses of the simulation that steps "
                                           "this state (simulation.poses), or call "
                                         : ": call ") +
                                call);
  };
  if (!of_bodies.is_of(state)) refuse("the poses (xpos, xquat) ", of_bodies, "forward_kinematics first (or smooth_dynamics)");
  if (joints && !of_joints.is_of(state))
    refuse("the poses of the joints (xanchor, xaxis) ", of_joints,
           "forward_kinematics first (or smooth_dynamics(..., {.joint_poses = true}))");
}
/// Poses of bodies of the state that the motions in the dynamics are of. After expects_together or expects_of.
template <class R, class Mem, class Dynamics>
void expects_poses_with(char const* where, Poses<R, Mem> const& poses, Dynamics const& dynamics) {
  Stamp const& motion = dynamics.stamps(int(Quantity::motion));
  if (!is_stamped(poses) || poses.stamp().bodies.is_same(motion)) return;
  throw std::invalid_argument(std::string(where) + ": the poses and the dynamics are of different states, or of different moments of " +
                              "one: call smooth_dynamics first (or forward_kinematics and mass_matrix) with these poses");
}
}  // namespace detail

}  // namespace gsp
