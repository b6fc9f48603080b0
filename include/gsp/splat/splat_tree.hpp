#pragma once
#include <gsp/math/quat.hpp>
#include <gsp/ray/detail/box_tree.hpp>
#include <gsp/splat/gaussians.hpp>

/// Gaussians as rays find them: a tree of boxes a body, in its frame. Made once on the host, one copy for all worlds.
namespace gsp {

/// A Gaussian for rays (64 bytes). With u = axes (point - centre) and w = axes direction, its response along the ray is greatest at
///   x = -u.w / w.w,   where it is   2^(power - sharpness |u x w|^2 / w.w).
/// Lengths in `axes` are counted in its own standard deviations, times the greatest of them, so that no number becomes large.
struct alignas(16) RaySplat {
  Vec3<float> centre;  // [m] in the frame of its body
  int source;          // index in the sets that make_splat_tree was given
  float axes[9];       // rows: its axes, over their standard deviations
  float power;         // log2 of its opacity
  float sharpness;     // log2(e) / 2 / the greatest variance [1/m^2]
  int unused;
};
static_assert(sizeof(RaySplat) == 64, "a Gaussian is four loads of 16 bytes");

/// The Gaussians of a body.
struct SplatTreeBody {
  int body;
  int node, splat;  // the first of its nodes, of its Gaussians
  float radius;     // of a ball about the body's frame that all responses >= 1/255 lie in [m]
};
template <class Mem>
struct SplatTree {
  using memory_space = Mem;
  Kokkos::View<RayNode*, Mem> nodes;
  Kokkos::View<RaySplat*, Mem> splats;  // in the order of the leaves
  Kokkos::View<SplatTreeBody*, Mem> bodies;
  int named = 1;          // one more than the greatest body index that the sets name
  std::int64_t left_out;  // of the sets: those that nothing can meet
};

namespace detail {
/// False where nothing can meet it: an opacity below 1/255, or no width.
inline bool make_ray_splat(GaussianSet const& s, std::size_t i, int source, RaySplat& splat, RayBox& box, double& reach) {
  double const opacity = s.opacities[i];
  float const* const q = &s.quats[4 * i];
  double const norm = std::sqrt(double(q[0]) * q[0] + double(q[1]) * q[1] + double(q[2]) * q[2] + double(q[3]) * q[3]);
  Mat3<double> const turn = to_matrix(Quat<double>{q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm});
  double sigma[3], most = 0;
  for (int k = 0; k < 3; ++k) {
    sigma[k] = std::abs(double(s.scales[3 * i + std::size_t(k)]));
    most = std::max(most, sigma[k]);
  }
  if (!(opacity * 255 >= 1) || !(most >= 1e-15)) return false;
  splat = {};
  splat.source = source;
  splat.power = float(std::log2(opacity));
  splat.sharpness = float(0.5 / std::log(2.) / (most * most));
  for (int k = 0; k < 3; ++k) {
    splat.centre[k] = s.positions[3 * i + std::size_t(k)];
    sigma[k] = std::max(sigma[k], 1e-6 * most);  // a disc or a needle without thickness
  }
  double const k = std::sqrt(2 * std::log(255 * opacity)) * (1 + 1e-5);
  reach = 0;
  float low[3], high[3];
  for (int r = 0; r < 3; ++r) {
    double sum = 0;
    for (int c = 0; c < 3; ++c) {
      splat.axes[3 * c + r] = float(turn(r, c) * (most / sigma[c]));
      sum += turn(r, c) * sigma[c] * turn(r, c) * sigma[c];
    }
    double const half = k * std::sqrt(sum) + 1e-12, at = splat.centre[r];
    low[r] = std::nextafter(float(std::max(at - half, -3e38)), -no_hit<float>());
    high[r] = std::nextafter(float(std::min(at + half, 3e38)), no_hit<float>());
    reach += at * at;
  }
  box.add(low);
  box.add(high);
  reach = std::sqrt(reach) + k * most;
  return true;
}
}  // namespace detail

/// Sets of Gaussians for rays, as make_gaussians takes them for pictures. Allocates; fences. A Gaussian that nothing can meet, as its
/// opacity is below 1/255 or its width below 1e-15 m, is left out; one that is thinner than a millionth of its width counts as that thick.
/// Cost: n log n, about half a second a million. Errors: std::invalid_argument as make_gaussians, and for 2^28 Gaussians or more.
template <ExecutionSpace Exec>
SplatTree<typename Exec::memory_space> make_splat_tree(Exec const& exec, std::vector<GaussianSet> const& sets) {
  SplatTree<typename Exec::memory_space> tree;
  std::size_t total = 0;
  for (std::size_t s = 0; s < sets.size(); ++s) {
    detail::check_gaussian_set("gsp::make_splat_tree", sets[s], s);
    total += sets[s].size();
    for (int const b : sets[s].body) tree.named = std::max(tree.named, b + 1);
  }
  expects(total < most_ray_items, "gsp::make_splat_tree: 2^28 Gaussians or more: take them apart");
  std::vector<RaySplat> all, splats;
  std::vector<detail::RayBox> boxes;
  std::vector<std::vector<int>> of_body(std::size_t(tree.named));
  std::vector<double> radius(std::size_t(tree.named), 0.);
  int source = 0;
  for (auto const& set : sets)
    for (std::size_t i = 0; i < set.size(); ++i, ++source) {
      RaySplat splat;
      detail::RayBox box;
      double reach = 0;
      if (!detail::make_ray_splat(set, i, source, splat, box, reach)) continue;
      std::size_t const body = std::size_t(set.body[i]);
      of_body[body].push_back(int(all.size()));
      radius[body] = std::max(radius[body], reach);
      all.push_back(splat);
      boxes.push_back(box);
    }
  tree.left_out = std::int64_t(total - all.size());
  std::vector<RayNode> nodes;
  std::vector<SplatTreeBody> bodies;
  for (std::size_t b = 0; b < of_body.size(); ++b) {
    if (of_body[b].empty()) continue;
    bodies.push_back({int(b), int(nodes.size()), int(splats.size()), float(radius[b] * (1 + 1e-6))});
    detail::BoxTreeBuilder builder(of_body[b].size());
    for (int const i : of_body[b]) builder.add(boxes[std::size_t(i)], i);
    auto const own = builder.build([&](int i) { splats.push_back(all[std::size_t(i)]); });
    nodes.insert(nodes.end(), own.begin(), own.end());
  }
  tree.nodes = detail::to_device<decltype(tree.nodes)>(exec, "gsp::SplatTree::nodes", nodes);
  tree.splats = detail::to_device<decltype(tree.splats)>(exec, "gsp::SplatTree::splats", splats);
  tree.bodies = detail::to_device<decltype(tree.bodies)>(exec, "gsp::SplatTree::bodies", bodies);
  return tree;
}
template <ExecutionSpace Exec>
SplatTree<typename Exec::memory_space> make_splat_tree(Exec const& exec, GaussianSet const& set) {
  return make_splat_tree(exec, std::vector<GaussianSet>{set});
}

}  // namespace gsp
