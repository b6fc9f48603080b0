#pragma once
#include <gsp/dynamics/world_lanes.hpp>

/// Kernels of gsp/dynamics/object_poses.hpp, where the contract stands.
namespace gsp::detail {

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
    l.store3(xpos, i, t.p);
    l.store4(xquat, i, t.q);
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

}  // namespace gsp::detail
