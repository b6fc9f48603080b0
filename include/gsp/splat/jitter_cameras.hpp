#pragma once
#include <gsp/core/region.hpp>
#include <gsp/math/quat.hpp>
#include <gsp/splat/cameras.hpp>
#include <gsp/splat/detail/picture_chance.hpp>
#include <gsp/splat/picture_options.hpp>

namespace gsp {

namespace detail {
template <class Mem>
struct JitterCameras {
  Cameras<Mem> from, to;
  JitterCamerasOptions options;
  PictureChance<Mem> chance;

  KOKKOS_FUNCTION void operator()(int image) const {
    auto const within = [&](PictureStream stream, int k, float most) {
      return double(most) * (2 * uniform_of<double>(chance.words(image, 0, stream).word[k]) - 1);
    };
    double view[3][4];
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 4; ++c) view[r][c] = from.viewmats(image, r, c);
    if (options.position > 0)
      for (int r = 0; r < 3; ++r) view[r][3] -= within(PictureStream::position, r, options.position);
    if (options.rotation > 0) {
      auto const axis = [&](int k) { return within(PictureStream::rotation, k, options.rotation); };
      Vec3<double> const turn{axis(0), axis(1), axis(2)};
      Mat3<double> const R = to_matrix(exp_rotation(turn));
      for (int c = 0; c < 4; ++c) {
        Vec3<double> const column = transpose_times(R, Vec3<double>{view[0][c], view[1][c], view[2][c]});
        for (int r = 0; r < 3; ++r) view[r][c] = column[r];
      }
    }
    for (int r = 0; r < 4; ++r)
      for (int c = 0; c < 4; ++c) to.viewmats(image, r, c) = r < 3 ? static_cast<float>(view[r][c]) : from.viewmats(image, r, c);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) to.Ks(image, r, c) = from.Ks(image, r, c);
    if (options.focal > 0)
      for (int k = 0; k < 2; ++k)
        to.Ks(image, k, k) = static_cast<float>(to.Ks(image, k, k) * (1 + within(PictureStream::intrinsics, 0, options.focal)));
    if (options.principal > 0)
      for (int k = 0; k < 2; ++k)
        to.Ks(image, k, 2) = static_cast<float>(to.Ks(image, k, 2) + within(PictureStream::intrinsics, 1 + k, options.principal));
  }
};
}  // namespace detail

/// Cameras that are not quite where, and as, they are said to be: of each image its own place, direction, focal length and principal point.
///   x_camera' = R^T (x_camera - d),   f' = f (1 + a),   c' = c + b,   R = exp [w]:  d, w along the camera's axes
/// Of the seed, the step and the image's number (gsp/math/philox.hpp), so the same come in any batch (first_image) and on any backend to
/// rounding; what an option of 0 leaves alone keeps its bits.
/// @param cameras   as they are meant
/// @param jittered  out: viewmats, Ks of as many cameras; world, lenses, width, height become those of `cameras`, whose views they share
///                  (may be `cameras` itself: then calls add up)
/// @param chance    (C, 3) seed, step and number that each image's numbers are drawn of, in place of the options', as of `develop`
/// One launch. Neither allocates nor fences. Errors: std::invalid_argument for another number of cameras, for options that are not from 0
/// to 1e6, a rotation over pi, a share that is not below 1, a step that is negative or not below 2^56, and images whose numbers are not
/// within 0 to 2^32 - 1.
template <ExecutionSpace Exec, class Mem>
void jitter_cameras(Exec const& exec, Cameras<Mem> const& cameras, Cameras<Mem>& jittered, JitterCamerasOptions const& options,
                    std::type_identity_t<Kokkos::View<std::int64_t const* [3], Kokkos::LayoutRight, Mem>> const& chance = {}) {
  Region const region("gsp::splat::jitter_cameras");
  static_assert(can_access<Exec, Cameras<Mem>>, "gsp::jitter_cameras: the cameras are not accessible from this execution space");
  detail::check_cameras("gsp::jitter_cameras", cameras);
  int const images = cameras.images();
  expects(jittered.images() == images && int(jittered.Ks.extent(0)) == images,
          "gsp::jitter_cameras: there is room for " + std::to_string(jittered.images()) + " cameras, and there are " +
              std::to_string(images) + ": make_cameras(exec, " + std::to_string(images) + ")");
  detail::check_options("gsp::jitter_cameras", options, images);
  if (chance.data()) detail::expects_rows("gsp::jitter_cameras", "chance", chance.extent(0), images);
  jittered.world = cameras.world;
  jittered.lenses = cameras.lenses;
  jittered.width = cameras.width;
  jittered.height = cameras.height;
  Kokkos::parallel_for("gsp::splat::jitter_cameras", lightweight(Kokkos::RangePolicy<Exec>(exec, 0, images)),
                       detail::JitterCameras<Mem>{cameras, jittered, options, detail::PictureChance<Mem>::of(options, chance)});
}

}  // namespace gsp
