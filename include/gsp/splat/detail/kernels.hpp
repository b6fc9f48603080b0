#pragma once
#include <gsp/parallel/detail/kernels.hpp>
#include <gsp/splat/render.hpp>

/// What gsp::kernels holds of the renderer: render.hpp declares it, kernels/pictures.cpp instantiates it. R is the poses' number.
// clang-format off
#define GSP_PICTURE_KERNELS(word, Exec, Mem) \
  namespace gsp { \
  word Gaussians<Mem> make_gaussians(Exec const&, std::vector<GaussianSet> const&); \
  word Frames<Mem> make_frames(Exec const&, Gaussians<Mem> const&, FrameOptions); \
  word void project(Exec const&, Gaussians<Mem> const&, Frames<Mem>&, RenderOptions); \
  word void bin_tiles(Exec const&, Frames<Mem>&); \
  word void rasterize(Exec const&, Frames<Mem>&, RenderOptions); \
  }
#define GSP_PICTURE_KERNELS_OF_POSES(word, Exec, Mem, R) \
  namespace gsp { \
  word void place_gaussians(Exec const&, Gaussians<Mem> const&, Poses<R, Mem> const&, Cameras<Mem> const&, int, Frames<Mem>&); \
  word void render(Exec const&, Gaussians<Mem> const&, Poses<R, Mem> const&, Cameras<Mem> const&, Frames<Mem>&, RenderOptions); \
  }
// clang-format on

GSP_EXTERN_KERNELS(GSP_PICTURE_KERNELS)
GSP_EXTERN_KERNELS(GSP_PICTURE_KERNELS_OF_POSES, float)
GSP_EXTERN_KERNELS(GSP_PICTURE_KERNELS_OF_POSES, double)
