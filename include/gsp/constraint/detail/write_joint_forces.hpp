#pragma once
#include <gsp/constraint/impulses.hpp>
#include <gsp/parallel/for_worlds.hpp>

/// The kernel of `joint_forces`.
namespace gsp::detail {

template <class R, class Mem>
struct WriteJointForces {
  using View = Kokkos::View<R**, Kokkos::LayoutRight, Mem>;
  typename Model<R, Mem>::template Array<int> limited_joints, friction_dofs;
  ElementImpulses<R, Mem> limits, frictions;
  View limit, friction;
  R inverse_timestep;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank;
    world.each(int(limit.extent(1)), [&](int j) { limit(w, j) = R(0); });
    world.each(int(friction.extent(1)), [&](int i) { friction(w, i) = R(0); });
    world.sync();
    world.each(int(limited_joints.extent(0)),
               [&](int i) { limit(w, limited_joints(i)) = (limits(w, 2 * i) + limits(w, 2 * i + 1)) * inverse_timestep; });
    world.each(int(friction_dofs.extent(0)), [&](int i) { friction(w, friction_dofs(i)) = frictions(w, i) * inverse_timestep; });
  }
};

}  // namespace gsp::detail
