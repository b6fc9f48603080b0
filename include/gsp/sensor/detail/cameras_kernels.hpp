#pragma once
#include <gsp/dynamics/object_poses.hpp>
#include <gsp/splat/cameras.hpp>

/// Kernel of gsp/sensor/cameras.hpp, where the contract stands.
namespace gsp::detail {

/// A CameraMount as the kernel reads it; camera < 0: on the body.
template <class R>
struct MountEntry {
  int camera, body;
  Vec3<R> pos;   // in the body's frame
  Mat3<R> axes;  // columns right, up, backward in the body's frame
  float fx, fy, cx, cy;
};

template <class R, class Mem>
struct CamerasOf {
  Model<R, Mem> model;
  Poses<R, Mem> poses;
  Kokkos::View<MountEntry<R>*, Mem> entries;
  Kokkos::View<R***, Kokkos::LayoutRight, Mem> com;
  Cameras<Mem> cameras;
  int count;
  KOKKOS_FUNCTION void operator()(int image) const {
    WorldLane<R> const world{image / count, 1};
    MountEntry<R> const& e = entries(image % count);
    Vec3<R> eye, axis[3];  // x right, y up, z backward
    if (e.camera >= 0) {
      Frame<R> const f = camera_frame(world, model, poses, com, e.camera);
      eye = f.p;
      for (int c = 0; c < 3; ++c) axis[c] = column(f.r, c);
    } else {
      Quat<R> const q = world.load4(poses.xquat, e.body);
      eye = world.load3(poses.xpos, e.body) + rotate(q, e.pos);
      for (int c = 0; c < 3; ++c) axis[c] = rotate(q, column(e.axes, c));
    }
    CameraPose<R> const view = camera_pose(eye, axis[0], -axis[1], -axis[2]);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) cameras.viewmats(image, r, c) = float(view.r(r, c));
      cameras.viewmats(image, r, 3) = float(view.t[r]);
    }
    float const last[] = {0, 0, 0, 1}, K[] = {e.fx, 0, e.cx, 0, e.fy, e.cy, 0, 0, 1};
    for (int c = 0; c < 4; ++c) cameras.viewmats(image, 3, c) = last[c];
    for (int c = 0; c < 9; ++c) cameras.Ks(image, c / 3, c % 3) = K[c];
    cameras.world(image) = world.first;
  }
};

}  // namespace gsp::detail
