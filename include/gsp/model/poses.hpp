#pragma once
#include <gsp/core/detail/views.hpp>

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
  auto const make = [&](std::string const& label, int items, int components) {
    return detail::allocate_zero<typename P::template View<R***>>(exec, label, worlds, items, components);
  };
  poses.xpos = make("gsp::Poses::xpos", bodies, 3);
  poses.xquat = make("gsp::Poses::xquat", bodies, 4);
  poses.xanchor = make("gsp::Poses::xanchor", joints, 3);
  poses.xaxis = make("gsp::Poses::xaxis", joints, 3);
  auto const xquat = poses.xquat;
  Kokkos::parallel_for(
      "gsp::model::make_poses", Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(worlds) * bodies),
      KOKKOS_LAMBDA(std::int64_t i) { xquat.data()[4 * i] = R(1); });
  return poses;
}

}  // namespace gsp
