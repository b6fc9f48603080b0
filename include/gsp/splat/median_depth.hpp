#pragma once
#include <gsp/splat/detail/median_blocks.hpp>
#include <gsp/splat/project.hpp>

namespace gsp {

/// Median depth: the camera z [m] at which half of a pixel's light has been taken, by Gaussians in the order in which the pixel's ray meets
/// them, as a LiDAR's return is (cast_splats.hpp); 0 where more comes through. The ray through the pixel's centre meets Gaussian i where it
/// responds most,
///   z_i = (mu^T S^-1 d) / (d^T S^-1 d),   d = ((x - cx) / fx, (y - cy) / fy, 1),   mu: its centre, of the camera,
///   S: its covariance, and the picture's blur [pixel^2] as a ball, of pixels as large as they are there across the ray,
///      blur mu_z^3 / (|mu| fx fy det J) 1
/// (J = 1; behind a lens its slope at the centre, d is the ray that comes to the pixel, `undistorted`, and 0 stands where none does)
/// with the alpha that the picture gives it there. (Expected depth, and the order in which colours blend, take the z of centres.) However
/// many Gaussians a ray meets, none is lost: what there is no room for is gone through again. A channel of `render`, with a pass of its
/// own; the other pictures stay what they are, bit by bit. Cost: whole lists of tiles, where the picture ends at what is opaque: 6 times
/// the picture and more on a CPU.
template <class Mem>
struct MedianDepthChannel {
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> image;  // (C, H, W)
  static constexpr int size = detail::RayDepth::size;      // kept of a Gaussian
  template <class Seen>
  KOKKOS_INLINE_FUNCTION void value(Seen const& g, float* out) const {
    detail::RayDepth::of(g, out);
  }
  template <class P>
  KOKKOS_INLINE_FUNCTION void blend(P*, float const*, Blend<P> const&) const {}
  KOKKOS_INLINE_FUNCTION void store(int, int, int, float const*) const {}
  template <ExecutionSpace Exec>
  void draw(Exec const& exec, Frames<Mem> const& frames, RenderOptions const& options, int first, int of) const {
    detail::draw_medians(exec, detail::MedianPass<Mem>{frames, image, options.alpha_max, first, of});
  }
};

}  // namespace gsp
