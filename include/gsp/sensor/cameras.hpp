#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/subtree.hpp>
#include <gsp/model/detail/sizes.hpp>
#include <gsp/model/model.hpp>
#include <gsp/model/poses.hpp>
#include <gsp/sensor/detail/cameras_kernels.hpp>
#include <gsp/splat/cameras.hpp>
#include <optional>
#include <string>
#include <vector>

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
  std::optional<Lens> lens = {};        // opencv_lens, fisheye_lens; else a pinhole
};

struct CameraMountsOptions {
  int worlds = 1, width = 640, height = 480;  // of the pictures
};

/// Mounts on the device. `make_camera_mounts` allocates it.
template <class R, class Mem>
struct CameraMounts {
  using memory_space = Mem;
  int worlds = 0;
  int width = 0, height = 0;   // of the pictures [pixel]
  detail::ModelSizes model{};  // host: of which model
  Kokkos::View<detail::MountEntry<R>*, Mem> entries;
  Subtrees<R, Mem> subtrees;                             // empty where no camera follows a centre of mass
  Kokkos::View<Lens*, Kokkos::LayoutRight, Mem> lenses;  // (images()), or empty: pinholes
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
                                        std::vector<CameraMount> const& mounts, CameraMountsOptions options = {});

/// The cameras of all worlds in their present poses: image world x mounts.count() + k is what mount k of that world sees.
/// @param poses    of `mounts.worlds` worlds, after forward_kinematics or a step
/// @param cameras  out: viewmats, Ks, world, width, height (render refuses frames of another size), and lenses, which are the mounts' own;
/// of
///                 make_cameras(exec, mounts.images())
/// One launch (two where a camera follows a centre of mass). Does not allocate, does not fence. About 100 flop an image.
template <ExecutionSpace Exec, class R, class Mem>
void cameras_of(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, CameraMounts<R, Mem>& mounts,
                Cameras<Mem>& cameras) {
  Region const region("gsp::sensor::cameras_of");
  static_assert(can_access<Exec, Cameras<Mem>>, "gsp::cameras_of: the cameras are not accessible from this execution space");
  expects(mounts.model == detail::sizes_of(model), "gsp::cameras_of: the mounts were made for another model: make_camera_mounts with this");
  expects(int(poses.xpos.extent(0)) == mounts.worlds && int(poses.xpos.extent(1)) == model.nbody,
          "gsp::cameras_of: the mounts are for " + std::to_string(mounts.worlds) + " worlds of " + std::to_string(model.nbody) +
              " bodies, the poses of " + std::to_string(poses.xpos.extent(0)) + " of " + std::to_string(poses.xpos.extent(1)));
  expects(cameras.images() == mounts.images() && int(cameras.Ks.extent(0)) == mounts.images() &&
              int(cameras.world.extent(0)) == mounts.images(),
          "gsp::cameras_of: there is room for " + std::to_string(cameras.images()) + " cameras, and there are " +
              std::to_string(mounts.images()) + ": make_cameras(exec, mounts.images())");
  cameras.width = mounts.width;
  cameras.height = mounts.height;
  cameras.lenses = mounts.lenses;
  if (mounts.subtrees.com.data()) subtree_com(exec, model, poses, mounts.subtrees);
  Kokkos::parallel_for("gsp::sensor::cameras_of", Kokkos::RangePolicy<Exec>(exec, 0, mounts.images()),
                       detail::CamerasOf<R, Mem>{model, poses, mounts.entries, mounts.subtrees.com, cameras, mounts.count()});
}

}  // namespace gsp

#include <gsp/sensor/detail/cameras_impl.hpp>
