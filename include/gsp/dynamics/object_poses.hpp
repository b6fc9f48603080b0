#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/detail/object_poses_lanes.hpp>
#include <gsp/dynamics/world_lanes.hpp>

/// World poses of geoms, sites and cameras from those of bodies (MuJoCo's mj_kinematics and mj_camlight). Of the poses that are given,
/// whatever state they are of. Errors: std::invalid_argument for poses of another model and for outputs of other sizes.
namespace gsp {

/// World poses of all geoms: xpos (world, ngeom, 3) [m], xquat (world, ngeom, 4). After forward_kinematics. Cost about 50 flop a geom.
/// Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem, class Pos, class Quats>
void geom_poses(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Pos& xpos, Quats& xquat) {
  Region const region("gsp::dynamics::geom_poses");
  int const worlds = int(poses.xpos.extent(0));
  detail::expects_fit("gsp::geom_poses", model, poses, worlds);
  detail::expects_rows("gsp::geom_poses", "xpos", xpos, worlds, model.ngeom, 3);
  detail::expects_rows("gsp::geom_poses", "xquat", xquat, worlds, model.ngeom, 4);
  for_world_lanes<R>("gsp::dynamics::geom_poses", exec, worlds, model.ngeom,
                     detail::ObjectPoses<R, Mem, Pos, Quats>{poses, model.geom_body, model.geom_pos, model.geom_quat, xpos, xquat});
}
/// World poses of all sites: xpos (world, nsite, 3) [m], xquat (world, nsite, 4). After forward_kinematics. Does not allocate, does not
/// fence.
template <ExecutionSpace Exec, class R, class Mem, class Pos, class Quats>
void site_poses(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Pos& xpos, Quats& xquat) {
  Region const region("gsp::dynamics::site_poses");
  int const worlds = int(poses.xpos.extent(0));
  detail::expects_fit("gsp::site_poses", model, poses, worlds);
  detail::expects_rows("gsp::site_poses", "xpos", xpos, worlds, model.nsite, 3);
  detail::expects_rows("gsp::site_poses", "xquat", xquat, worlds, model.nsite, 4);
  for_world_lanes<R>("gsp::dynamics::site_poses", exec, worlds, model.nsite,
                     detail::ObjectPoses<R, Mem, Pos, Quats>{poses, model.site_body, model.site_pos, model.site_quat, xpos, xquat});
}
/// World poses of all cameras, whatever their mode: xpos (world, ncam, 3) [m], xmat (world, ncam, 9) row-major, columns x right, y up,
/// z backward. `com` (world, body, 3): centres of mass of subtrees (subtree_com). Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem, class Com, class Pos, class Mats>
void camera_poses(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Com const& com, Pos& xpos, Mats& xmat) {
  Region const region("gsp::dynamics::camera_poses");
  int const worlds = int(poses.xpos.extent(0));
  detail::expects_fit("gsp::camera_poses", model, poses, worlds);
  detail::expects_rows("gsp::camera_poses", "xpos", xpos, worlds, model.ncam, 3);
  detail::expects_rows("gsp::camera_poses", "xmat", xmat, worlds, model.ncam, 9);
  detail::expects_rows("gsp::camera_poses", "com", com, worlds, model.nbody, 3);
  for_world_lanes<R>("gsp::dynamics::camera_poses", exec, worlds, model.ncam,
                     detail::CameraPoses<R, Mem, Com, Pos, Mats>{model, poses, com, xpos, xmat});
}

}  // namespace gsp
