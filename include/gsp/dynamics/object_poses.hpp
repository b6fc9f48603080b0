#pragma once
#include <gsp/dynamics/world_lanes.hpp>

/// World poses of geoms, sites and cameras from those of bodies (MuJoCo's mj_kinematics and mj_camlight).
namespace gsp {

namespace detail {
template <class R, class Mem, class Pos, class Quats>
struct ObjectPoses {
  Poses<R, Mem> poses;
  typename Model<R, Mem>::template Array<int> body;
  Field<R> pos, quat;
  Pos xpos;
  Quats xquat;
  template <class T>
  KOKKOS_FUNCTION void operator()(WorldLane<T> const& l, int i) const {
    int const b = body(i);
    Transform<T> const t =
        Transform<T>{l.load3(poses.xpos, b), l.load4(poses.xquat, b)} * Transform<T>{l.constant3(pos, i), l.constant4(quat, i)};
    l.store3(xpos, i, t.p), l.store4(xquat, i, t.q);
  }
};
/// Where something is in the world, and its axes as columns.
template <class T>
struct Frame {
  Vec3<T> p;
  Mat3<T> r;
};
/// Frame of camera i, whatever its mode. com (world, body, 3): centres of mass of subtrees, read in the modes that name them.
template <class T, class R, class Mem, class Com>
KOKKOS_INLINE_FUNCTION Frame<T> camera_frame(WorldLane<T> const& l, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Com const& com,
                                             int i) {
  int const b = model.cam_body(i), target = model.cam_target(i);
  auto const mode = CameraMode(model.cam_mode(i));
  Transform<T> const own = Transform<T>{l.load3(poses.xpos, b), l.load4(poses.xquat, b)} *
                           Transform<T>{l.constant3(model.cam_pos, i), l.constant4(model.cam_quat, i)};
  Frame<T> f{own.p, to_matrix(own.q)};
  if (mode == CameraMode::track || mode == CameraMode::track_com) {  // turned as in qpos0
    f.p = mode == CameraMode::track ? l.load3(poses.xpos, b) + l.constant3(model.cam_pos0, i)
                                    : l.load3(com, b) + l.constant3(model.cam_poscom0, i);
    for (int c = 0; c < 9; ++c) f.r.m[c] = l.constant(model.cam_mat0, i, 9, c);
  } else if (mode != CameraMode::fixed && target >= 0) {  // looks along -z at the target; x level
    Vec3<T> const at = mode == CameraMode::target_body ? l.load3(poses.xpos, target) : l.load3(com, target);
    Vec3<T> const z = normalized(f.p - at), side = normalized(cross(Vec3<T>{T(0), T(0), T(1)}, z)), up = normalized(cross(z, side));
    f.r = {{side.x, up.x, z.x, side.y, up.y, z.y, side.z, up.z, z.z}};
  }
  return f;
}

template <class R, class Mem, class Com, class Pos, class Mats>
struct CameraPoses {
  Model<R, Mem> model;
  Poses<R, Mem> poses;
  Com com;
  Pos xpos;
  Mats xmat;
  template <class T>
  KOKKOS_FUNCTION void operator()(WorldLane<T> const& l, int i) const {
    Frame<T> const f = camera_frame(l, model, poses, com, i);
    l.store3(xpos, i, f.p);
    for (int c = 0; c < 9; ++c) l.store(xmat, i, f.r.m[c], 9, c);
  }
};
}  // namespace detail

/// World poses of all geoms: xpos (world, ngeom, 3) [m], xquat (world, ngeom, 4). After forward_kinematics. Cost about 50 flop a geom.
/// Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem, class Pos, class Quats>
void geom_poses(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Pos& xpos, Quats& xquat) {
  expects(int(xpos.extent(1)) == model.ngeom && int(xquat.extent(1)) == model.ngeom,
          "gsp::geom_poses: outputs must be (worlds, ngeom, 3 | 4)");
  detail::expects_fit("gsp::geom_poses", model, poses, int(xpos.extent(0)));
  for_world_lanes<R>("gsp::dynamics::geom_poses", exec, int(xpos.extent(0)), model.ngeom,
                     detail::ObjectPoses<R, Mem, Pos, Quats>{poses, model.geom_body, model.geom_pos, model.geom_quat, xpos, xquat});
}
/// World poses of all sites: xpos (world, nsite, 3) [m], xquat (world, nsite, 4). After forward_kinematics. Does not allocate, does not
/// fence.
template <ExecutionSpace Exec, class R, class Mem, class Pos, class Quats>
void site_poses(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Pos& xpos, Quats& xquat) {
  expects(int(xpos.extent(1)) == model.nsite && int(xquat.extent(1)) == model.nsite,
          "gsp::site_poses: outputs must be (worlds, nsite, 3 | 4)");
  detail::expects_fit("gsp::site_poses", model, poses, int(xpos.extent(0)));
  for_world_lanes<R>("gsp::dynamics::site_poses", exec, int(xpos.extent(0)), model.nsite,
                     detail::ObjectPoses<R, Mem, Pos, Quats>{poses, model.site_body, model.site_pos, model.site_quat, xpos, xquat});
}
/// World poses of all cameras, whatever their mode: xpos (world, ncam, 3) [m], xmat (world, ncam, 9) row-major, columns x right, y up,
/// z backward. `com` (world, body, 3): centres of mass of subtrees (subtree_com). Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem, class Com, class Pos, class Mats>
void camera_poses(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Com const& com, Pos& xpos, Mats& xmat) {
  expects(int(xpos.extent(1)) == model.ncam && int(xmat.extent(1)) == model.ncam,
          "gsp::camera_poses: outputs must be (worlds, ncam, 3 | 9)");
  detail::expects_fit("gsp::camera_poses", model, poses, int(xpos.extent(0)));
  for_world_lanes<R>("gsp::dynamics::camera_poses", exec, int(xpos.extent(0)), model.ncam,
                     detail::CameraPoses<R, Mem, Com, Pos, Mats>{model, poses, com, xpos, xmat});
}

}  // namespace gsp
