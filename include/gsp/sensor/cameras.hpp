#pragma once
#include <gsp/dynamics/object_poses.hpp>
#include <gsp/dynamics/subtree.hpp>
#include <gsp/model/names.hpp>
#include <gsp/splat/cameras.hpp>
#include <optional>

/// Cameras of a model or on its links, in all worlds, as `render` takes them. They follow from poses, on the device.
namespace gsp {

/// One camera: of the model, or on a body.
struct CameraMount {
  std::string camera = "";              // the model's camera of this name, with its mode and intrinsics; or
  int camera_id = -1;                   // by index; or
  std::string body = "";                // a body of this name ("world": what does not move); or
  int body_id = -1;                     // by index, with all below
  Double3 pos{0, 0, 0};                 // in the body's frame [m]
  Double4 quat{1, 0, 0, 0};             // axes as of a camera of MJCF: looks along -z, y up, x right
  std::optional<Double3> look_at = {};  // in place of quat: a point of the body's frame that it looks at, the body's z up
  double fovy = 0.7853981633974483;     // [rad] from the picture's top to its bottom, square pixels
};

struct CameraMountsOptions {
  int worlds = 1, width = 640, height = 480;  // of the pictures
};

namespace detail {
template <class R>
struct MountEntry {
  int camera, body;
  Vec3<R> pos;   // in the body's frame
  Mat3<R> axes;  // columns right, up, backward in the body's frame
  float fx, fy, cx, cy;
};
}  // namespace detail

/// Mounts on the device. `make_camera_mounts` allocates it.
template <class R, class Mem>
struct CameraMounts {
  using memory_space = Mem;
  int worlds = 0;
  int width = 0, height = 0;  // of the pictures [pixel]
  Kokkos::View<detail::MountEntry<R>*, Mem> entries;
  Subtrees<R, Mem> subtrees;  // empty where no camera follows a centre of mass
  int count() const { return int(entries.extent(0)); }
  int images() const { return worlds * count(); }
};

/// `mounts` of the model that was made from `compiled`, for pictures of one size. K of a model's camera: by fovy, f = height / (2
/// tan(fovy/2)) along both axes and the axis through the picture's centre; by its sensor (as mjv_cameraFrustum has it),
///   fx = focal_x width / size_x,   fy = focal_y height / size_y,   cx = width (1/2 - principal_x / size_x),   cy = height (1/2 +
///   principal_y / size_y)
/// Throws Error for a name that is not there, std::invalid_argument for a mount that names nothing, or two things. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
CameraMounts<R, Mem> make_camera_mounts(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled,
                                        std::vector<CameraMount> const& mounts, CameraMountsOptions options = {}) {
  expects(options.worlds > 0 && !mounts.empty(), "gsp::make_camera_mounts: worlds must be positive and a mount be given");
  expects(options.width > 0 && options.height > 0, "gsp::make_camera_mounts: width and height must be positive");
  detail::expects_made_of("gsp::make_camera_mounts", model, compiled);
  CameraMounts<R, Mem> m;
  m.worlds = options.worlds;
  m.width = options.width;
  m.height = options.height;
  bool by_com = false;
  std::vector<detail::MountEntry<R>> entries;
  for (std::size_t k = 0; k < mounts.size(); ++k) {
    CameraMount const& mount = mounts[k];
    std::string const place = "gsp::make_camera_mounts: mount " + std::to_string(k);
    expects(!mount.camera.empty() + (mount.camera_id >= 0) + !mount.body.empty() + (mount.body_id >= 0) == 1,
            place + ": name one camera or one body, by name or by index");
    detail::MountEntry<R> e{};
    e.camera = mount.camera.empty() ? mount.camera_id : camera_id(compiled, mount.camera);
    e.body = mount.body.empty() ? mount.body_id : body_id(compiled, mount.body);
    if (e.camera >= 0) {
      expects(e.camera < compiled.ncam,
              place + ": the model has " + std::to_string(compiled.ncam) + " cameras, not one of index " + std::to_string(e.camera));
      auto const mode = CameraMode(compiled.cam_mode[e.camera]);
      by_com = by_com || mode == CameraMode::track_com || mode == CameraMode::target_body_com;
      auto const& size = compiled.cam_sensor_size[e.camera];
      if (size[0] > 0) {
        auto const& focal = compiled.cam_focal[e.camera];  // of a picture of its own resolution
        auto const& resolution = compiled.cam_resolution[e.camera];
        auto const& principal = compiled.cam_principal[e.camera];
        e.fx = float(focal[0] / resolution[0] * options.width);
        e.fy = float(focal[1] / resolution[1] * options.height);
        e.cx = float(options.width * (0.5 - principal[0] / size[0]));
        e.cy = float(options.height * (0.5 + principal[1] / size[1]));
      }
    } else {
      expects(e.body < compiled.nbody,
              place + ": the model has " + std::to_string(compiled.nbody) + " bodies, not one of index " + std::to_string(e.body));
      expects(mount.fovy > 0 && mount.fovy < 3.141592, place + ": CameraMount::fovy is " + std::to_string(mount.fovy) +
                                                           " and must lie between 0 and pi: it is in radians, degrees times pi / 180");
      auto const& p = mount.pos;
      auto const& q = mount.quat;
      double way = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
      if (mount.look_at) way = norm(Vec3<double>{(*mount.look_at)[0] - p[0], (*mount.look_at)[1] - p[1], (*mount.look_at)[2] - p[2]});
      expects(way > 0 && std::isfinite(way + p[0] + p[1] + p[2]),
              place + ": its place and rotation must be finite, the rotation not 0, and it must not look at itself");
      Mat3<double> axes = to_matrix(normalized(Quat<double>{q[0], q[1], q[2], q[3]}));
      if (mount.look_at) {
        auto const& t = *mount.look_at;
        axes = gsp::look_at<double>({p[0], p[1], p[2]}, {t[0], t[1], t[2]}).r;  // rows right, down, forward
        axes = {{axes(0, 0), -axes(1, 0), -axes(2, 0), axes(0, 1), -axes(1, 1), -axes(2, 1), axes(0, 2), -axes(1, 2), -axes(2, 2)}};
      }
      for (int c = 0; c < 9; ++c) e.axes.m[c] = R(axes.m[c]);
      e.pos = {R(p[0]), R(p[1]), R(p[2])};
    }
    if (e.fx == 0) {
      auto const K = pinhole(options.width, options.height, {.fovy = e.camera >= 0 ? compiled.cam_fovy[e.camera] : mount.fovy});
      e.fx = K[0];
      e.fy = K[4];
      e.cx = K[2];
      e.cy = K[5];
    }
    entries.push_back(e);
  }
  m.entries = detail::to_device<Kokkos::View<detail::MountEntry<R>*, Mem>>(exec, "gsp::CameraMounts::entries", entries);
  if (by_com) m.subtrees = make_subtrees(exec, model, {.worlds = options.worlds});
  return m;
}

namespace detail {
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
}  // namespace detail

/// The cameras of all worlds in their present poses: image world x mounts.count() + k is what mount k of that world sees.
/// @param poses    of `mounts.worlds` worlds, after forward_kinematics or a step
/// @param cameras  out: viewmats, Ks, world, width, height (render refuses frames of another size); of make_cameras(exec, mounts.images())
/// One launch (two where a camera follows a centre of mass). Does not allocate, does not fence. About 100 flop an image.
template <ExecutionSpace Exec, class R, class Mem>
void cameras_of(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, CameraMounts<R, Mem>& mounts,
                Cameras<Mem>& cameras) {
  static_assert(can_access<Exec, Cameras<Mem>>, "gsp::cameras_of: the cameras are not accessible from this execution space");
  expects(int(poses.xpos.extent(0)) == mounts.worlds && int(poses.xpos.extent(1)) == model.nbody,
          "gsp::cameras_of: the mounts are for " + std::to_string(mounts.worlds) + " worlds of " + std::to_string(model.nbody) +
              " bodies, the poses of " + std::to_string(poses.xpos.extent(0)) + " of " + std::to_string(poses.xpos.extent(1)));
  expects(cameras.images() == mounts.images() && int(cameras.Ks.extent(0)) == mounts.images() &&
              int(cameras.world.extent(0)) == mounts.images(),
          "gsp::cameras_of: there is room for " + std::to_string(cameras.images()) + " cameras, and there are " +
              std::to_string(mounts.images()) + ": make_cameras(exec, mounts.images())");
  cameras.width = mounts.width;
  cameras.height = mounts.height;
  if (mounts.subtrees.com.data()) subtree_com(exec, model, poses, mounts.subtrees);
  Kokkos::parallel_for("gsp::sensor::cameras_of", Kokkos::RangePolicy<Exec>(exec, 0, mounts.images()),
                       detail::CamerasOf<R, Mem>{model, poses, mounts.entries, mounts.subtrees.com, cameras, mounts.count()});
}

}  // namespace gsp
