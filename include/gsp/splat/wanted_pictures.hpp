#pragma once
#include <gsp/splat/frames.hpp>

namespace gsp {

/// Pictures that others are to be like, such as those of all Gaussians before some are dropped. The error of a picture beside them is
///   E = sum over pixels of |rgb - rgb*|^2 + depth_weight (alpha (depth - depth*) / depth*)^2,
/// with the depth of pictures (expected camera z) relative to the wanted one; where that is 0 colour alone counts. alpha depth and alpha
/// are sums over Gaussians as light is, so E is of second degree in each colour and in each alpha.
template <class Mem>
struct WantedPictures {
  Kokkos::View<float****, Kokkos::LayoutRight, Mem> rgb;   // (C, H, W, 3)
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> depth;  // (C, H, W) [m]
  float depth_weight = 0.1f;                               // an error of 3 % of the depth counts as one of 0.01 of the light
};

/// What the frames show now, in memory of its own. Allocates. Errors: std::invalid_argument for frames without rgb or depth.
template <ExecutionSpace Exec, class Mem>
WantedPictures<Mem> make_wanted_pictures(Exec const& exec, Frames<Mem> const& frames) {
  expects(frames.rgb.extent(0) > 0 && frames.depth.extent(0) > 0,
          "gsp::make_wanted_pictures: the frames have no rgb or no depth: make_frames with both");
  WantedPictures<Mem> wanted;
  wanted.rgb = detail::allocate<decltype(wanted.rgb)>("gsp::WantedPictures::rgb", frames.images, frames.height, frames.width, 3);
  wanted.depth = detail::allocate<decltype(wanted.depth)>("gsp::WantedPictures::depth", frames.images, frames.height, frames.width);
  detail::copy_view(exec, frames.rgb, wanted.rgb);
  detail::copy_view(exec, frames.depth, wanted.depth);
  return wanted;
}

namespace detail {
template <class Mem>
void check_wanted(std::string const& function, WantedPictures<Mem> const& wanted, Frames<Mem> const& frames) {
  auto const fits = [&](auto const& v) {
    return int(v.extent(0)) == frames.images && int(v.extent(1)) == frames.height && int(v.extent(2)) == frames.width;
  };
  expects(frames.rgb.extent(0) > 0 && frames.depth.extent(0) > 0 && frames.alpha.extent(0) > 0,
          function + ": it needs rgb, depth and alpha of the frames: make_frames with all three");
  expects(fits(wanted.rgb) && fits(wanted.depth), function + ": the wanted pictures are of " + std::to_string(wanted.rgb.extent(0)) +
                                                      " images of " + std::to_string(wanted.rgb.extent(2)) + " x " +
                                                      std::to_string(wanted.rgb.extent(1)) + ", the frames of " +
                                                      std::to_string(frames.images) + " of " + std::to_string(frames.width) + " x " +
                                                      std::to_string(frames.height) + ": make_wanted_pictures of these frames");
  expects(wanted.depth_weight >= 0, function + ": depth_weight must not be negative");
}
inline std::string not_finite(std::string const& function) {
  return function + ": squares of the pictures are not finite: a Gaussian's colour is over 1e19, or a wanted picture is not finite";
}
}  // namespace detail

}  // namespace gsp
