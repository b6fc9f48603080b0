#pragma once
// A scene for tests of scores, fits and pruning, and E of a set beside wanted pictures, by the plain double reference.
#include <gsp/splat/wanted_pictures.hpp>
#include <splat/scenes.hpp>
#include <support/kokkos_tools.hpp>

namespace gsp_test {

template <class View>
auto on_host(View const& v) {
  return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v);
}
template <class Mem>
gsp::WantedPictures<Kokkos::HostSpace> on_host_wanted(gsp::WantedPictures<Mem> const& w) {
  return {on_host(w.rgb), on_host(w.depth), w.depth_weight};
}

struct PrunedScene {
  int const images = 3, width = 47, height = 39, bodies = 2;
  gsp::GaussianSet set;
  std::vector<float> viewmats, Ks;

  PrunedScene(int n, int sh_degree, double most_opacity) : set(random_gaussians(n, sh_degree, bodies, 31)) {
    for (float& o : set.opacities) o = std::min(o, float(most_opacity));
    random_cameras(images, width, height, 1.8, 4, viewmats, Ks);
  }
  template <class Exec>
  auto poses(Exec const& exec) const {
    std::vector<std::vector<gsp::Transform<double>>> unused;
    return random_poses<float>(exec, 1, bodies, 9, unused);
  }
  template <class Exec>
  auto frames(Exec const& exec) const {
    return gsp::make_frames(exec, gsp::make_gaussians(exec, set), {.images = images, .width = width, .height = height});
  }
  /// For each image, four numbers a pixel whose squares are E: of rgb and of alpha (depth - depth*) / depth*.
  std::vector<std::vector<double>> differences(gsp::GaussianSet const& of, gsp::WantedPictures<Kokkos::HostSpace> const& wanted,
                                               gsp::RenderOptions const& options) const {
    std::vector<std::vector<gsp::Transform<double>>> places;
    random_poses<float>(Kokkos::Serial{}, 1, bodies, 9, places);
    std::vector<std::vector<double>> out;
    for (int c = 0; c < images; ++c) {
      auto const p =
          gsp_reference::rasterize(of, places[0], &viewmats[std::size_t(16 * c)], &Ks[std::size_t(9 * c)], width, height, options);
      std::vector<double> e;
      for (int i = 0; i < width * height; ++i) {
        for (int k = 0; k < 3; ++k) e.push_back(p.rgb[std::size_t(3 * i + k)] - wanted.rgb(c, i / width, i % width, k));
        double const depth = wanted.depth(c, i / width, i % width), alpha = p.alpha[std::size_t(i)];
        double const light = p.depth[std::size_t(i)] * std::max(alpha, 1e-10);
        e.push_back(depth > 0 ? std::sqrt(double(wanted.depth_weight)) * (light - depth * alpha) / depth : 0);
      }
      out.push_back(e);
    }
    return out;
  }
};

}  // namespace gsp_test
