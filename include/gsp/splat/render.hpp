#pragma once
#include <gsp/core/region.hpp>
#include <gsp/splat/bin_tiles.hpp>
#include <gsp/splat/detail/draw_waves.hpp>
#include <gsp/splat/place_gaussians.hpp>
#include <gsp/splat/project.hpp>
#include <gsp/splat/rasterize.hpp>

namespace gsp {

/// Pictures of Gaussians: the four stages, wave by wave. What a loop of one's own would do.
/// @param cloud    Gaussians of the scene and of the robot (make_gaussians)
/// @param poses    world poses of the bodies; image c shows world c % worlds, or cameras.world(c)
/// @param cameras  as many as frames.images
/// @param frames   out: rgb, depth, alpha
/// @param channels further picture channels (channels.hpp); each stores its own picture, of the size of the frames' (checked where it is
///                 the channel's member `image`)
/// Waits for the device once, at its end (the first call of frames a few times more), to learn whether every wave fitted its buffers; those
/// that did not are repeated with larger ones, so that nothing is ever dropped. Allocates only then. Errors: std::invalid_argument also
/// where a camera has no focal length (none has written it), a viewmat that is no rigid motion or a K with a skew, is of a world that the
/// poses do not have, or has a lens whose disc ends within a quarter of the picture's shorter side from its middle. A focal length below 0
/// mirrors the picture. An image depends on nothing but its own input: the same bits for any batch, any number of threads and any other
/// images.
template <ExecutionSpace Exec, class R, class PosesMem, class Mem, class... Channels>
void render(Exec const& exec, Gaussians<Mem> const& cloud, Poses<R, PosesMem> const& poses, Cameras<Mem> const& cameras,
            Frames<Mem>& frames, RenderOptions options = {}, Channels const&... channels) {
  Region const region("gsp::splat::render");
  detail::check_cameras("gsp::render", cameras, frames.images, frames.width, frames.height);
  (detail::check_image("gsp::render", frames, channels), ...);
  constexpr int values = decltype(detail::channel_list(channels...))::stored;
  if (values > frames.wave.values_a_splat) {
    frames.wave.values_a_splat = values;
    reserve(exec, 0, 0, frames.wave);
  }
  detail::draw_waves("gsp::render", exec, frames, poses.xpos.extent(0), [&](int first) {
    place_gaussians(exec, cloud, poses, cameras, first, frames);
    project(exec, cloud, frames, options, channels...);
    bin_tiles(exec, frames);
    rasterize(exec, frames, options, channels...);
  });
}

}  // namespace gsp

#include <gsp/splat/detail/kernels.hpp>
