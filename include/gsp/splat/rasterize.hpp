#pragma once
#include <gsp/core/region.hpp>
#include <gsp/splat/detail/rasterize_rows.hpp>
#include <gsp/splat/project.hpp>
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/splat/detail/rasterize_cuda.hpp>
#endif

namespace gsp {

/// Last stage: blends the splats of each tile front to back, for each pixel with centre (x, y):
///   alpha_i = min(alpha_max, 2^(power - (l11 dx + l21 dy)^2 - (l22 dy)^2)), left out below 1/255;   T_0 = 1, T_{i+1} = T_i (1 - alpha_i);
///   ends before the Gaussian for which T_{i+1} <= stop;   rgb = sum w_i c_i, w_i = alpha_i T_i;   alpha = 1 - T;   depth = sum w_i z_i /
///   max(alpha, 1e-10)
/// CPU: a tile a task, a row of 16 pixels a pack, two rows at a time. GPU: a warp blends 8 x 8 pixels by itself, two a lane, from those
/// splats of its tile that touch them.
/// @param channels  further picture channels (channels.hpp), the same as `project` was given
/// @param frames  in: bin_tiles' lists.   out: rgb, depth, alpha of the images of the wave whose status is 0
/// Errors: std::invalid_argument for a channel whose own `image` is not of the frames' size, and without room for what channels keep.
/// Neither allocates nor fences. Each pixel depends on nothing but its own list.
template <ExecutionSpace Exec, class Mem, class... Channels>
void rasterize(Exec const& exec, Frames<Mem>& frames, RenderOptions options = {}, Channels const&... channels) {
  Region const region("gsp::splat::rasterize");
  static_assert(can_access<Exec, Frames<Mem>>, "gsp::rasterize: the frames are not accessible from this execution space");
  auto const list = detail::picture_channels(frames, channels...);
  using List = std::remove_const_t<decltype(list)>;
  detail::check_values<List>("gsp::rasterize", frames);
  (detail::check_image("gsp::rasterize", frames, channels), ...);
  if constexpr (is_device<Exec>) {
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
    detail::rasterize_on_cuda(exec, frames, detail::BlendBlocks<List>{list, options.alpha_max, options.stop});
#else
    static_assert(!is_device<Exec>, "gsp::rasterize: pictures are drawn on CPUs and on CUDA GPUs; compile with nvcc for CUDA");
#endif
  } else {
    Kokkos::parallel_for("gsp::splat::rasterize",
                         Kokkos::RangePolicy<Exec, Kokkos::Schedule<Kokkos::Dynamic>>(exec, 0, frames.wave.images * frames.wave.tiles(),
                                                                                      Kokkos::ChunkSize(4)),
                         detail::RasterizeRows<Mem, List>{frames, list, options.alpha_max, options.stop});
  }
  detail::draw_passes(exec, frames, options, 0, List::stored, list);
}

}  // namespace gsp
