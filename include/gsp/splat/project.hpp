#pragma once
#include <gsp/splat/channels.hpp>
#include <gsp/splat/detail/render_options.hpp>
#include <gsp/splat/frames.hpp>

namespace gsp {

/// Second stage: the Gaussians that the wave's cameras see, as splats. Culls clusters against the picture, then projects. Who comes first
/// has the first place in the pool, which nothing hangs on: bits of `seen`, one a Gaussian, say which rank each has by its source.
/// @param channels  further picture channels, the same as `rasterize` is given: what they keep of a Gaussian goes to wave.values
/// @param frames  in: place_gaussians' views.   out: wave.splats, origins, seen, visible; status(c) = frame_overflow where the buffers are
///                too small (then the wave is empty)
/// Neither allocates nor fences.
template <ExecutionSpace Exec, class Mem, class... Channels>
void project(Exec const& exec, Gaussians<Mem> const& cloud, Frames<Mem>& frames, RenderOptions options = {}, Channels const&... channels);

}  // namespace gsp

#include <gsp/splat/detail/project_impl.hpp>
