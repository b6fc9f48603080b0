#pragma once
#include <gsp/constraint/contact_forces.hpp>
#include <gsp/constraint/equality.hpp>
#include <gsp/core/region.hpp>
#include <gsp/model/detail/sizes.hpp>
#include <gsp/sensor/detail/accelerations_kernels.hpp>
#include <gsp/solver/solution.hpp>

/// Accelerations of joints and bodies, and what bodies exert on each other through their joints, with the forces of constraints (MuJoCo's
/// qacc and mj_rnePostConstraint).
namespace gsp {

/// Of all worlds. `make_accelerations` allocates it. All in world axes, of or about the origin of the body's frame (Poses::xpos); forces
/// stand before torques, velocities before angular velocities.
template <class R, class Mem>
struct Accelerations {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;
  detail::ModelSizes model{};  // host: of which model
  View<R**> qacc;              // (world, nv) [m/s^2, rad/s^2]
  View<R***> velocity;         // (world, body, 6) [m/s, rad/s]; this and what follows empty without bodies
  View<R***> acceleration;     // (world, body, 6) less gravity, what an accelerometer feels: 0 in free fall [m/s^2, rad/s^2]
  View<R***> outside;  // (world, body, 6) what contacts, connects, welds and, in profile mujoco, spatial tendons exert on it [N, N m]
  View<R***> inside;   // (world, body, 6) what its parent exerts on the body, through joints or as it is fixed to it [N, N m]
  View<R**> push;      // (world, tendon) of constraints on tendons [N]; empty: no spatial tendons, or profile stable
  detail::SharedStamp<detail::Stamp> stamp;  // host: of which state (dynamics/stamps.hpp)
};

struct AccelerationsOptions {
  int worlds = 1;
  bool bodies = true;  // what bodies do and what acts on them, beside qacc
};

namespace detail {
template <class R, class Mem>
bool has_spatial_tendons(Model<R, Mem> const& model) {
  bool any = false;
  for (int k = 0; k < int(model.host_archetypes.extent(0)); ++k) any = any || model.host_archetypes(k).spatial;
  return any;
}
}  // namespace detail

/// Allocates. Errors: std::invalid_argument for worlds < 1.
template <class R, ExecutionSpace Exec, class Mem>
Accelerations<R, Mem> make_accelerations(Exec const& exec, Model<R, Mem> const& model, AccelerationsOptions options = {}) {
  expects(options.worlds > 0, "gsp::make_accelerations: worlds must be positive and is " + std::to_string(options.worlds));
  Accelerations<R, Mem> a;
  a.worlds = options.worlds;
  a.model = detail::sizes_of(model);
  auto const of_bodies = [&](char const* label) {
    return detail::allocate_zero<typename Accelerations<R, Mem>::template View<R***>>(exec, label, options.worlds, model.nbody, 6);
  };
  a.qacc = detail::allocate_zero<decltype(a.qacc)>(exec, "gsp::Accelerations::qacc", options.worlds, model.nv);
  a.stamp = detail::make_stamp<detail::Stamp>("gsp::Accelerations::stamp");
  if (!options.bodies) return a;
  a.velocity = of_bodies("gsp::Accelerations::velocity");
  a.acceleration = of_bodies("gsp::Accelerations::acceleration");
  a.outside = of_bodies("gsp::Accelerations::outside");
  a.inside = of_bodies("gsp::Accelerations::inside");
  if (model.profile == Profile::mujoco && detail::has_spatial_tendons(model))
    a.push = detail::allocate_zero<decltype(a.push)>(exec, "gsp::Accelerations::push", options.worlds, model.ntendon);
  return a;
}

namespace detail {
/// Rows were assembled, and solved for; else the step has none.
template <class R, class Mem>
bool has_solution(Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses) {
  return !rows.stamp.data() || !impulses.stamp.data() || (rows.stamp().made != 0 && impulses.stamp().solved);
}
/// Rows that were solved, if there are any, are of the state as it is now.
template <class R, class Mem>
void expects_forces_of(char const* where, State<R, Mem> const& state, Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses) {
  expects_readable(where, rows, impulses);
  if (!rows.stamp.data() || !rows.stamp().made || rows.stamp().state.is_of(state)) return;
  throw std::invalid_argument(std::string(where) + ": the forces of the constraints " + rows.stamp().state.fault(state.qpos.data()) +
                              ": call forward first");
}
}  // namespace detail

/// Accelerations of the state as it is, with the forces of the constraints that were solved for it:
///   profile mujoco   qacc = M^-1 (f + J^T p / h), f = passive - bias + actuator + applied, at the state (MuJoCo's qacc; not what its
///                    implicit integrators make of the rate)
///   profile stable   qacc = (v+ - v) / h, v+ the new velocity: what springs, dampers, servos and constraints push within the step, as
///                    they are taken there, implicitly; of a tree that is one rigid body with its gyroscopic acceleration at the state,
///                    which its momentum carries
/// then, from each root to its leaves, with (w, v) the velocity of a body,
///   a_b = a_parent + d/dt(S) qvel + S qacc,   a_world = -gravity,   inside_b = I a_b + v_b x* I v_b - outside_b + sum of inside of
///   children
/// Bodies that are fixed to the world, or to a mocap body, are at rest whatever the latter does (MuJoCo). `inside` of the world is the sum
/// over the bodies that are fixed or jointed to it, without what touches it.
/// @param state, poses, dynamics, collision, contacts, rows, impulses, solution  after `forward` (or smooth_dynamics with keep_all,
///        collide, assemble and the solver), before the state moves on; scratch of the dynamics is used
/// @param out       all of it, or qacc alone, as it was made
/// @param sleeping  islands that sleep (step/sleep.hpp): nothing of them accelerates, their contacts push as when they fell asleep
/// Three launches; cost about 300 flop a body and a binary search a contact. qacc alone: one, of a triangular solve. Does not allocate,
/// does not fence. Errors: std::invalid_argument where dynamics, poses, rows or contacts are of another moment or not there.
template <ExecutionSpace Exec, class R, class Mem>
void accelerations(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                   Dynamics<R, Mem>& dynamics, CollisionModel<R, Mem> const& collision, Contacts<R, Mem> const& contacts,
                   Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses, Solution<R, Mem> const& solution, Accelerations<R, Mem>& out,
                   SleepingIslands<Mem> const& sleeping = {}) {
  Region const region("gsp::sensor::accelerations");
  constexpr char const* where = "gsp::accelerations";
  detail::expects_fit(where, model, state, dynamics, poses);
  expects(out.model == detail::sizes_of(model), where, "the accelerations were made for another model: make_accelerations with this");
  detail::expects_as_many(where, "worlds", "make all with the same {.worlds = n}", detail::Count{"state", state.worlds},
                          detail::Count{"rows", rows.worlds}, detail::Count{"solution", solution.worlds},
                          detail::Count{"accelerations", out.worlds});
  auto const needs = detail::set_of(Quantity::motion, Quantity::velocity, Quantity::factor, Quantity::acceleration, Quantity::bias);
  auto const of_tendons = detail::set_of(Quantity::tendon_length, Quantity::tendon_velocity, Quantity::actuator);
  detail::expects_of(where, dynamics, state, out.push.data() ? needs | of_tendons : needs);
  detail::expects_poses_of(where, poses, state);
  detail::expects_contact_forces(where, model, collision, contacts, rows, impulses);
  detail::expects_forces_of(where, state, rows, impulses);
  bool const solved = detail::has_solution(rows, impulses);
  if (out.stamp.data()) out.stamp().set(state);
  typename Solution<R, Mem>::template View<R**> const z = solved ? solution.z : typename Solution<R, Mem>::template View<R**>{};
  if (!out.velocity.data())
    return for_lanes("gsp::sensor::joint_accelerations", exec, model, dynamics,
                     detail::JointAccelerationStage<R, Mem>{z, out.qacc, sleeping.island});
  Kokkos::parallel_for(
      "gsp::sensor::outside_forces", Kokkos::RangePolicy<Exec>(exec, 0, state.worlds),
      detail::OutsideForces<R, Mem>{Equalities<R, Mem>(model, state, poses, dynamics), TendonLimits<R, Mem>(model, dynamics),
                                    TendonFriction<R, Mem>(model, dynamics), impulses_of<Equalities<R, Mem>>(rows, impulses),
                                    impulses_of<TendonLimits<R, Mem>>(rows, impulses), impulses_of<TendonFriction<R, Mem>>(rows, impulses),
                                    detail::contact_force_of(model, collision, contacts, rows, impulses), poses.xpos, out.outside, out.push,
                                    solved});
  for_lanes("gsp::sensor::accelerations", exec, model, dynamics,
            detail::AccelerationStage<R, Mem>{{z, out.qacc, sleeping.island},
                                              state,
                                              poses.xpos,
                                              poses.xquat,
                                              out.velocity,
                                              out.acceleration,
                                              out.outside,
                                              out.inside,
                                              out.push});
  for_world_lanes<R>("gsp::sensor::forces_of_what_stands", exec, state.worlds, 1,
                     detail::StandingForces<R, Mem>{model, poses, out.velocity, out.acceleration, out.outside, out.inside});
}

}  // namespace gsp
