#pragma once
#include <gsp/ray/ray_scan.hpp>
#include <gsp/splat/cast_splats.hpp>

/// Gaussians for LiDAR units: scan_rays(exec, scene, poses, scan, step, splat_target(tree, poses)).
namespace gsp {

/// `splat_target` makes it.
template <class R, class Mem>
struct SplatTarget {
  detail::SplatCaster<R, Mem> caster;
  /// The unit's own body, or its robot, is hidden by the scan's filter, of Gaussians as of geoms.
  SplatTarget bind(int worlds, CastRaysOptions const& hidden) const {
    SplatTarget bound = *this;
    if (hidden.body_exclude >= 0) {
      bound.caster.options.body_exclude = hidden.body_exclude;
      bound.caster.options.bodies = hidden.bodies;
    }
    detail::check_splats_for_rays("gsp::scan_rays", bound.caster.tree, bound.caster.poses, worlds, bound.caster.options);
    return bound;
  }
  template <class T>
  KOKKOS_FUNCTION RayReturn<T> first(Ray<T> const& ray, int w, T const& most) const {
    auto const met = caster.first(ray, w, most);
    return {met.distance, met.gaussian};
  }
};

/// What scan_rays takes beside geoms: Gaussians whose bodies stand as `poses` says, those that scan_rays is given. It lasts for the call.
template <class R, class Mem>
SplatTarget<R, Mem> splat_target(SplatTree<Mem> const& tree, Poses<R, Mem> const& poses, CastSplatsOptions options = {}) {
  return {{tree, poses, options}};
}

}  // namespace gsp
