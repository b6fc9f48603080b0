#pragma once
#include <gsp/core/detail/views.hpp>
#include <gsp/model/detail/stamp.hpp>

namespace gsp {

namespace detail {
struct PosesStamp {
  Stamp bodies, joints;  // smooth_dynamics writes joints only where it is asked to
};
}  // namespace detail

/// World poses of bodies and joints, plain views in MuJoCo's order. Written by `forward_kinematics`, read by collision, rendering and
/// sensors. Poses that gsp has written are refused beside a state that has moved on since; poses that you alone write, in views of
/// make_poses or of your own, are taken as they are.
template <class R, class Mem>
struct Poses {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R***> xpos;                                // (world, body, 3) origin of the body frame [m]; body 0 is the world
  View<R***> xquat;                               // (world, body, 4) w x y z: body frame to world
  View<R***> xanchor;                             // (world, joint, 3) [m]
  View<R***> xaxis;                               // (world, joint, 3) unit; of a hinge or slide
  detail::SharedStamp<detail::PosesStamp> stamp;  // host: of which state they are (dynamics/stamps.hpp)
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
  poses.stamp = detail::make_stamp<detail::PosesStamp>("gsp::Poses::stamp");
  auto const xquat = poses.xquat;
  Kokkos::parallel_for(
      "gsp::model::make_poses", Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(worlds) * bodies),
      KOKKOS_LAMBDA(std::int64_t i) { xquat.data()[4 * i] = R(1); });
  return poses;
}

}  // namespace gsp
