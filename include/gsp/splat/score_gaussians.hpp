#pragma once
#include <gsp/splat/detail/sweep_lists.hpp>
#include <gsp/splat/render.hpp>

namespace gsp {

/// What score_gaussians finds, as multiples of 2^-30, so that sums hang on no order; `score_unit` times them is the number. What is beyond
/// 8.5e9 stays there.
template <class Mem>
struct GaussianScores {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<std::int64_t*> loss;   // (Gaussians, in the order of the sets of make_gaussians) what E gains when this one is dropped
  View<std::int64_t*> error;  // (C) E of each image
  View<std::int64_t*> loss_high, error_high;  // (Gaussians + 1), (C + 1) while it sums
};
inline constexpr double score_unit = 0x1p-30;

/// Allocates. images: those of the frames.
template <ExecutionSpace Exec, class Mem>
GaussianScores<Mem> make_gaussian_scores(Exec const& exec, Gaussians<Mem> const& cloud, int images) {
  detail::ExactSums<Mem> loss, error;
  detail::make_sums(exec, loss, "gsp::GaussianScores::loss", cloud.count);
  detail::make_sums(exec, error, "gsp::GaussianScores::error", images);
  return {loss.low, error.low, loss.high, error.high};
}

namespace detail {
template <class Mem>
struct ScoreUse {
  ExactSums<Mem> loss;
  static constexpr int size = 1, passes = 1;
  template <class P>
  KOKKOS_INLINE_FUNCTION void begin(SweptPixel<P>&, int) const {}
  template <class P>
  KOKKOS_FORCEINLINE_FUNCTION void take(int, float const*, Splat const&, SweptPixel<P> const& p, Loss<P> const& l, P* sums) const {
    for (int k = 0; k < 4; ++k) sums[0] = fma(l.light[k], l.light[k] - (p.error[k] + p.error[k]), sums[0]);  // |e - D|^2 - |e|^2
  }
  KOKKOS_INLINE_FUNCTION void give(Frames<Mem> const& frames, int id, float const*, float const* sums, int first, int) const {
    if (first == 0) loss.add(frames.wave.origins(id).source, sums[0]);
  }
};
/// Draws nothing; its pass scores.
template <class Mem>
struct ScoreChannel {
  WantedPictures<Mem> wanted;
  ExactSums<Mem> loss, error;
  static constexpr int size = 1;
  KOKKOS_INLINE_FUNCTION void value(Splat const&, float*) const {}
  template <class P>
  KOKKOS_INLINE_FUNCTION void blend(P*, float const*, Blend<P> const&) const {}
  KOKKOS_INLINE_FUNCTION void store(int, int, int, float const*) const {}
  template <ExecutionSpace Exec>
  void draw(Exec const& exec, Frames<Mem> const& frames, RenderOptions const& options, int first, int of) const {
    sweep_lists("gsp::splat::score_gaussians", exec,
                SweepPass<Mem>{frames, wanted, error, options.alpha_max, options.stop, options.blur, first, of}, ScoreUse<Mem>{loss});
  }
};
}  // namespace detail

/// What the error E of pictures (WantedPictures) gains when one Gaussian is dropped, for each of them, exactly: a picture is affine in each
/// alpha, so without Gaussian i a pixel changes by
///   D = w_i c_i - alpha_i / (1 - alpha_i) (light that comes from behind it),   and E by sum |e - D|^2 - |e|^2,   e: rgb - rgb* and so on.
/// Beside their own picture (e = 0) this is Speedy-Splat's squared gradient (Hanson et al. 2025) made exact. What a pixel no longer stops
/// at, less than RenderOptions::stop of its light, is not in it. One that no camera sees has 0.
/// @param cameras  as many as frames.images
/// @param frames   rgb, depth and alpha; out: the pictures
/// @param scores   out: loss, error
/// Waits and allocates as `render` does. Cost: about three times the pictures. The same bits for any batch and any number of threads.
/// Errors: std::invalid_argument where render has them, for frames without rgb, depth or alpha, and wanted pictures of another size;
/// gsp::Error where squares of pictures are not finite.
template <ExecutionSpace Exec, class R, class PosesMem, class Mem>
void score_gaussians(Exec const& exec, Gaussians<Mem> const& cloud, Poses<R, PosesMem> const& poses, Cameras<Mem> const& cameras,
                     WantedPictures<Mem> const& wanted, Frames<Mem>& frames, GaussianScores<Mem>& scores, RenderOptions options = {}) {
  Region const region("gsp::splat::score_gaussians");
  detail::check_wanted("gsp::score_gaussians", wanted, frames);
  expects(int(scores.loss.extent(0)) == cloud.count && int(scores.error.extent(0)) == frames.images,
          "gsp::score_gaussians: the scores are of " + std::to_string(scores.loss.extent(0)) + " Gaussians and " +
              std::to_string(scores.error.extent(0)) + " images, not of " + std::to_string(cloud.count) + " and " +
              std::to_string(frames.images) + ": make_gaussian_scores with these");
  detail::ExactSums<Mem> const loss{scores.loss, scores.loss_high}, error{scores.error, scores.error_high};
  detail::zero(exec, loss);
  detail::zero(exec, error);
  render(exec, cloud, poses, cameras, frames, options, detail::ScoreChannel<Mem>{wanted, loss, error});
  bool const losses = detail::settle(exec, loss), errors = detail::settle(exec, error);
  if (!losses || !errors) throw Error(detail::not_finite("gsp::score_gaussians"));
}

}  // namespace gsp
