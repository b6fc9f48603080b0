#pragma once
#include <gsp/ray/ray_scan.hpp>
#include <gsp/splat/cast_splats.hpp>

/// Gaussians for LiDAR units: scan_rays(exec, scene, poses, scan, step, splat_target(tree)).
namespace gsp {

namespace detail {
/// Gaussians where they are in these poses.
template <class R, class Mem>
struct PlacedSplats {
  SplatCaster<R, Mem> caster;
  template <class T>
  KOKKOS_FUNCTION RayReturn<T> first(Ray<T> const& ray, int w, T const& most) const {
    auto const met = caster.first(ray, w, most);
    return {met.distance, met.gaussian};
  }
};
}  // namespace detail

/// `splat_target` makes it.
template <class Mem>
struct SplatTarget {
  SplatTree<Mem> tree;
  CastSplatsOptions options;
  template <class R>
  detail::PlacedSplats<R, Mem> bind(Poses<R, Mem> const& poses, CastRaysOptions const& hidden) const {
    CastSplatsOptions all = options;
    if (hidden.body_exclude >= 0) {
      expects(all.hidden.body_exclude < 0,
              "gsp::scan_rays: both splat_target's options and the scan's self filter hide bodies: give one of them, hidden or "
              "RayScanOptions::self");
      all.hidden = hidden;
    }
    detail::check_splats_for_rays("gsp::scan_rays", tree, poses, int(poses.xpos.extent(0)), all);
    return {{tree, poses, all}};
  }
};

/// What scan_rays takes beside geoms: Gaussians whose bodies stand as the poses say that it is given. The unit's own body, or its robot, is
/// hidden by the scan's self filter, of Gaussians as of geoms; options.hidden is for a scan without one. Errors, in scan_rays:
/// std::invalid_argument for both, and as cast_splats.
template <class Mem>
SplatTarget<Mem> splat_target(SplatTree<Mem> const& tree, CastSplatsOptions options = {}) {
  return {tree, options};
}

}  // namespace gsp
