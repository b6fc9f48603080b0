#pragma once
#include <gsp/core/exec.hpp>

namespace gsp {

/// World poses of bodies and joints, plain views in MuJoCo's order. Written by `forward_kinematics`, read by collision, rendering and
/// sensors.
template <class R, class Mem>
struct Poses {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R***> xpos;     // (world, body, 3) origin of the body frame [m]; body 0 is the world
  View<R***> xquat;    // (world, body, 4) w x y z: body frame to world
  View<R***> xanchor;  // (world, joint, 3) [m]
  View<R***> xaxis;    // (world, joint, 3) unit; of a hinge or slide
};

/// Poses of `worlds` worlds with `bodies` bodies and `joints` joints, identity where not yet computed.
template <class R, ExecutionSpace Exec>
Poses<R, typename Exec::memory_space> make_poses(Exec const& exec, int worlds, int bodies, int joints) {
  using P = Poses<R, typename Exec::memory_space>;
  P poses;
  poses.xpos = typename P::template View<R***>(Kokkos::view_alloc(exec, "gsp::Poses::xpos"), worlds, bodies, 3);
  poses.xquat = typename P::template View<R***>(Kokkos::view_alloc(exec, "gsp::Poses::xquat"), worlds, bodies, 4);
  poses.xanchor = typename P::template View<R***>(Kokkos::view_alloc(exec, "gsp::Poses::xanchor"), worlds, joints, 3);
  poses.xaxis = typename P::template View<R***>(Kokkos::view_alloc(exec, "gsp::Poses::xaxis"), worlds, joints, 3);
  auto const xquat = poses.xquat;
  Kokkos::parallel_for(
      "gsp::model::make_poses", Kokkos::MDRangePolicy<Exec, Kokkos::Rank<2>>(exec, {0, 0}, {worlds, bodies}),
      KOKKOS_LAMBDA(int w, int b) { xquat(w, b, 0) = R(1); });
  return poses;
}

}  // namespace gsp
