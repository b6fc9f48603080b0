#pragma once
#include <gsp/core/region.hpp>
#include <gsp/math/quat.hpp>
#include <gsp/model/poses.hpp>
#include <gsp/splat/cameras.hpp>
#include <gsp/splat/detail/lens_view.hpp>
#include <gsp/splat/frames.hpp>
#include <string>

namespace gsp {

namespace detail {

/// Why a camera cannot be drawn; wave.needed(2) = camera_faults (image + 1) + fault, of the last such image.
enum class CameraFault : int { not_rigid, skewed, no_place, no_such_world, lens_folds, no_focal_length };  // the last ones are told first
inline constexpr int camera_faults = 6;
/// What is said behind "camera c". `worlds`: of the poses.
inline std::string fault_text(CameraFault fault, std::size_t worlds) {
  switch (fault) {
    case CameraFault::not_rigid:
      return " has a viewmat that is no rigid motion: give a rotation (no scale, skew or mirror) and an offset, and the last row 0 0 0 1";
    case CameraFault::skewed:
      return " has a K that is not fx 0 cx, 0 fy cy, 0 0 1: give focal lengths and the centre in pixels, without skew";
    case CameraFault::no_place:
      return " has a viewmat of zeros, or a number in it or in K that is not finite: write world to camera, or call cameras_of";
    case CameraFault::no_such_world:
      return " is of a world that the poses do not have (they have " + std::to_string(worlds) +
             "): write its world, or make poses and mounts with the same {.worlds = n}";
    case CameraFault::lens_folds:
      return " has a lens that leads back in the middle of the picture: give the coefficients of these pixels' calibration";
    case CameraFault::no_focal_length:
      return " has no focal length: write its viewmat and K, or call cameras_of";
  }
  return "";
}
/// How far a camera's numbers, which float and the digits of files round, may be from those of a rigid motion and of a K.
inline constexpr double camera_tolerance = 1e-3;

/// camera <- link = (camera <- world) (world <- link), in double: the order of Gaussians and the place of their centres hang on it.
template <class Poses, class Mem>
struct PlaceLinks {
  Cameras<Mem> cameras;
  Poses poses;
  SplatWave<Mem> wave;
  int width, height, bodies, worlds;

  KOKKOS_FUNCTION void operator()(int index) const {
    int const local = index / bodies, body = index % bodies, image = wave.first + local;
    int const named = cameras.world.extent(0) > 0 ? cameras.world(image) : image % worlds;
    int const world = named >= 0 && named < worlds ? named : 0;
    double view[12];
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 4; ++c) view[4 * r + c] = cameras.viewmats(image, r, c);
    Quat<double> const q = normalized(Quat<double>{double(poses.xquat(world, body, 0)), double(poses.xquat(world, body, 1)),
                                                   double(poses.xquat(world, body, 2)), double(poses.xquat(world, body, 3))});
    Mat3<double> const R = to_matrix(q);
    Vec3<double> const p{double(poses.xpos(world, body, 0)), double(poses.xpos(world, body, 1)), double(poses.xpos(world, body, 2))};
    LinkView link;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) link.m[4 * r + c] = view[4 * r] * R(0, c) + view[4 * r + 1] * R(1, c) + view[4 * r + 2] * R(2, c);
      link.m[4 * r + 3] = view[4 * r] * p.x + view[4 * r + 1] * p.y + view[4 * r + 2] * p.z + view[4 * r + 3];
    }
    for (int c = 0; c < 3; ++c)  // the camera's origin, seen from the link: -R^T t
      link.eye[c] = static_cast<float>(-(link.m[c] * link.m[3] + link.m[4 + c] * link.m[7] + link.m[8 + c] * link.m[11]));
    wave.link_views(local, body) = link;
    if (body != 0) return;

    // limits of x/z and y/z where the projection is linearised: 30 % of half the field of view beyond the picture (as gsplat)
    ImageView v;
    v.world = world;
    v.fx = cameras.Ks(image, 0, 0);
    v.fy = cameras.Ks(image, 1, 1);
    v.cx = cameras.Ks(image, 0, 2);
    v.cy = cameras.Ks(image, 1, 2);
    auto const is_length = [](double f) { return f < 0 || f > 0; };  // neither 0, as nobody has written it, nor NaN
    auto const refuse = [&](CameraFault why) { Kokkos::atomic_max(&wave.needed(2), (std::int64_t(image) + 1) * camera_faults + int(why)); };
    if (!is_length(v.fx) || !is_length(v.fy)) refuse(CameraFault::no_focal_length);
    if (world != named) refuse(CameraFault::no_such_world);
    double turn = 0, place = 0 * (v.fx + v.fy + v.cx + v.cy);  // 3, of a rotation; 0, and NaN where a number is not finite
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 4; ++c) c < 3 ? turn += view[4 * r + c] * view[4 * r + c] : place += 0 * view[4 * r + c];
    if (!(turn > 0 && turn + place < 1e30)) refuse(CameraFault::no_place);
    auto const is = [](double number, double wanted) { return Kokkos::fabs(number - wanted) <= camera_tolerance; };
    Vec3<double> const x{view[0], view[1], view[2]}, y{view[4], view[5], view[6]}, z{view[8], view[9], view[10]};
    bool rigid = is(dot(x, x), 1) && is(dot(y, y), 1) && is(dot(z, z), 1) && is(dot(x, y), 0) && is(dot(y, z), 0) && is(dot(z, x), 0) &&
                 dot(cross(x, y), z) > 0;
    for (int c = 0; c < 4; ++c) rigid = rigid && is(cameras.viewmats(image, 3, c), c == 3);
    if (!rigid) refuse(CameraFault::not_rigid);
    bool straight = is(cameras.Ks(image, 0, 1), 0) && is(cameras.Ks(image, 1, 0), 0);
    for (int c = 0; c < 3; ++c) straight = straight && is(cameras.Ks(image, 2, c), c == 2);
    if (!straight) refuse(CameraFault::skewed);
    auto const limits = [](double f, double middle, int size, float& low, float& high) {  // a mirror's picture begins at the other end
      double const beyond = 0.15 * size / Kokkos::fabs(f), a = -middle / f, b = (size - middle) / f;
      low = static_cast<float>(Kokkos::fmin(a, b) - beyond);
      high = static_cast<float>(Kokkos::fmax(a, b) + beyond);
    };
    limits(v.fx, v.cx, width, v.x_low, v.x_high);
    limits(v.fy, v.cy, height, v.y_low, v.y_high);
    v.lens = nullptr;
    if (wave.lenses.extent(0) > 0 && !look_through(wave.lenses(image), width, height, v)) refuse(CameraFault::lens_folds);
    wave.image_views(local) = v;
  }
};

}  // namespace detail

/// First stage: where the links stand before each camera of the wave that starts at image `first`. Gaussians themselves are not moved: they
/// stay in their link's frame, and `project` goes from there to the picture.
/// @param poses    (worlds, >= cloud.bodies), world poses of the bodies; body 0 is the world, where the static scene stands
/// @param cameras  as many as frames.images
/// @param frames   out: wave.first, wave.images, wave.lenses, wave.image_views, wave.link_views
template <ExecutionSpace Exec, class R, class PosesMem, class Mem>
void place_gaussians(Exec const& exec, Gaussians<Mem> const& cloud, Poses<R, PosesMem> const& poses, Cameras<Mem> const& cameras, int first,
                     Frames<Mem>& frames) {
  Region const region("gsp::splat::place_gaussians");
  static_assert(can_access<Exec, Poses<R, PosesMem>> && can_access<Exec, Frames<Mem>>,
                "gsp::place_gaussians: poses or frames are not accessible from this execution space");
  auto& wave = frames.wave;
  detail::check_cameras("gsp::place_gaussians", cameras, frames.images, frames.width, frames.height);
  expects(first >= 0 && first < frames.images, "gsp::place_gaussians: the first image is outside the frames");
  expects(static_cast<int>(poses.xpos.extent(1)) >= cloud.bodies && poses.xpos.extent(0) > 0,
          "gsp::place_gaussians: the Gaussians name " + std::to_string(cloud.bodies) + " bodies but the poses have " +
              std::to_string(poses.xpos.extent(1)) +
              ": give poses of the model that the Gaussians were bound to, or bind them to the model of these poses (sample_surface, "
              "io::to_gaussian_set)");
  expects(static_cast<int>(wave.link_views.extent(1)) >= cloud.bodies &&
              static_cast<int>(wave.cluster_seen.extent(1)) >= cloud.most_clusters && cloud.count <= std::int64_t(32) * wave.words,
          "gsp::place_gaussians: the frames were made for fewer Gaussians or bodies; make_frames again with these");
  expects(cloud.shown.extent(0) == 0 || cloud.shown.extent(0) >= poses.xpos.extent(0),
          "gsp::place_gaussians: the table of shown sets has " + std::to_string(cloud.shown.extent(0)) + " worlds, the poses have " +
              std::to_string(poses.xpos.extent(0)) + ": name the sets of every world in show_sets");
  detail::TileGrid const own = detail::tile_grid<Exec>(frames.width, frames.height);
  expects(wave.grid.x_bits == own.x_bits && wave.grid.y_bits == own.y_bits,
          "gsp::place_gaussians: the frames were made for another backend, whose tiles are of another size: make_frames with this one");
  wave.first = first;
  wave.lenses = cameras.lenses;
  wave.images = std::min(wave.batch, frames.images - first);
  Kokkos::parallel_for("gsp::splat::place_gaussians", lightweight(Kokkos::RangePolicy<Exec>(exec, 0, wave.images * cloud.bodies)),
                       detail::PlaceLinks<Poses<R, PosesMem>, Mem>{cameras, poses, wave, frames.width, frames.height, cloud.bodies,
                                                                   static_cast<int>(poses.xpos.extent(0))});
}

}  // namespace gsp
