#pragma once
#include <gsp/core/region.hpp>
#include <gsp/splat/bin_tiles.hpp>
#include <gsp/splat/place_gaussians.hpp>
#include <gsp/splat/project.hpp>
#include <gsp/splat/rasterize.hpp>

namespace gsp {

namespace detail {
template <class Mem>
struct ResetNeeded {
  Kokkos::View<std::int64_t[3], Kokkos::LayoutRight, Mem> needed;
  KOKKOS_FUNCTION void operator()(int) const { needed(0) = needed(1) = needed(2) = 0; }
};
}  // namespace detail

/// Pictures of Gaussians: the four stages, wave by wave. What a loop of one's own would do.
/// @param cloud    Gaussians of the scene and of the robot (make_gaussians)
/// @param poses    world poses of the bodies; image c shows world c % worlds, or cameras.world(c)
/// @param cameras  as many as frames.images
/// @param frames   out: rgb, depth, alpha
/// @param channels further picture channels (channels.hpp); each stores its own picture, of the size of the frames' (checked where it is
///                 the channel's member `image`)
/// Waits for the device once, at its end (the first call of frames a few times more), to learn whether every wave fitted its buffers; those
/// that did not are repeated with larger ones, so that nothing is ever dropped. Allocates only then. Errors: std::invalid_argument also
/// where a camera has no focal length (none has written it), is of a world that the poses do not have, or has a lens whose disc ends within
/// a quarter of the picture's shorter side from its middle. An image depends on nothing but its own input: the same bits for any batch, any
/// number of threads and any other images.
template <ExecutionSpace Exec, class R, class PosesMem, class Mem, class... Channels>
void render(Exec const& exec, Gaussians<Mem> const& cloud, Poses<R, PosesMem> const& poses, Cameras<Mem> const& cameras,
            Frames<Mem>& frames, RenderOptions options = {}, Channels const&... channels) {
  Region const region("gsp::splat::render");
  expects(cameras.width == 0 || (cameras.width == frames.width && cameras.height == frames.height),
          "gsp::render: the cameras are for pictures of " + std::to_string(cameras.width) + " x " + std::to_string(cameras.height) +
              " pixels, the frames have " + std::to_string(frames.width) + " x " + std::to_string(frames.height) +
              ": make mounts and frames with one size");
  (detail::check_image("gsp::render", frames, channels), ...);
  constexpr int values = decltype(detail::channel_list(channels...))::stored;
  if (values > frames.wave.values_a_splat) {
    frames.wave.values_a_splat = values;
    reserve(exec, 0, 0, frames.wave);
  }
  auto const wave = [&](int first) {
    place_gaussians(exec, cloud, poses, cameras, first, frames);
    project(exec, cloud, frames, options, channels...);
    bin_tiles(exec, frames);
    rasterize(exec, frames, options, channels...);
  };
  auto const room = [](std::int64_t n) { return std::min(n + n / 8, std::max(n, detail::most_of_wave)); };
  // Room for the greatest wave so far; true if there was too little.
  auto const grow = [&] {
    auto const needed = detail::to_host(exec, frames.wave.needed);
    auto const fault = detail::CameraFault(needed[2] % detail::camera_faults);
    expects(needed[2] == 0,
            "gsp::render: camera " + std::to_string(needed[2] / detail::camera_faults - 1) +
                (fault == detail::CameraFault::no_focal_length ? " has no focal length: write its viewmat and K, or call cameras_of"
                 : fault == detail::CameraFault::no_place
                     ? " has a viewmat of zeros, or a number in it or in K that is not finite: write world to camera, or call cameras_of"
                 : fault == detail::CameraFault::lens_folds
                     ? " has a lens that leads back in the middle of the picture: give the coefficients of these pixels' calibration"
                     : " is of a world that the poses do not have (they have " + std::to_string(poses.xpos.extent(0)) +
                           "): write its world, or make poses and mounts with the same {.worlds = n}"));
    bool const small = needed[0] > frames.wave.visible_capacity || needed[1] > frames.wave.pair_capacity;
    if (small)
      reserve(exec, needed[0] > frames.wave.visible_capacity ? room(needed[0]) : 0,
              needed[1] > frames.wave.pair_capacity ? room(needed[1]) : 0, frames.wave);
    return small;
  };
  Kokkos::parallel_for("gsp::splat::render_reset", Kokkos::RangePolicy<Exec>(exec, 0, 1), detail::ResetNeeded<Mem>{frames.wave.needed});
  int first = 0;
  if (frames.wave.visible_capacity == 0 || frames.wave.pair_capacity == 0) reserve(exec, 1, 1, frames.wave);  // there was no room for more
  if (!frames.sized) {
    do wave(0);
    while (grow());
    frames.sized = true;
    first = frames.wave.batch;
  }
  for (int begin = first; begin < frames.images; begin += frames.wave.batch) wave(begin);
  while (first < frames.images && grow()) {  // repeat the waves that did not fit: few, and rarely, so their status is read on the host
    auto const status = detail::to_host(exec, frames.status);
    for (int begin = first; begin < frames.images; begin += frames.wave.batch)
      if (status[begin] & frame_overflow) wave(begin);
  }
}

}  // namespace gsp

#include <gsp/splat/detail/kernels.hpp>
