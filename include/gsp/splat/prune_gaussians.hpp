#pragma once
#include <gsp/splat/refit_gaussians.hpp>
#include <gsp/splat/score_gaussians.hpp>

namespace gsp {

struct PruneOptions {
  double keep = 0.3;                                          // of the Gaussians, above 0 and up to 1
  double drop = 0.15;                                         // of those that are left, at most, between two scores
  float depth_weight = 0.1f;                                  // WantedPictures
  RefitOptions between{.steps = 1, .iterations = 4}, last{};  // fits behind each round, and at the end; 0 steps: none
  RenderOptions render{};                                     // of all pictures, those of the fits too
};
struct PruneReport {
  int kept = 0, rounds = 0, sweeps = 0;  // sweeps: how often all pictures were drawn
  double dropped = 0, after = 0;         // E (WantedPictures), a sum over all images: before the last fit, and at the end
};

namespace detail {
template <class Mem>
struct DropGaussians {
  Kokkos::View<int*, Kokkos::LayoutRight, Mem> places;
  Gaussians<Mem> cloud;
  KOKKOS_FUNCTION void operator()(int i) const { cloud.power(places(i)) = -Kokkos::Experimental::infinity_v<float>; }
};

/// Which of the `live` (places in the cloud, in order) go, at least `target` stay: those of the least loss, but at most one of three that
/// follow each other along the curve, since a loss is that of one alone: two that stand for each other have little each. All that costs
/// nothing goes at once in the first round, where every loss is of the whole.
inline std::vector<int> choose_dropped(std::vector<int>& live, std::vector<std::int64_t> const& loss, std::size_t target, double drop,
                                       bool first) {
  auto const loss_of = [&](int place) { return loss[std::size_t(place)]; };
  auto const less = [&](int a, int b) { return loss_of(a) != loss_of(b) ? loss_of(a) < loss_of(b) : a < b; };
  std::size_t const most = live.size() - target;
  std::vector<int> gone;
  if (first) std::copy_if(live.begin(), live.end(), std::back_inserter(gone), [&](int i) { return loss_of(i) <= 0; });
  if (gone.empty()) {
    constexpr std::size_t group = 3;
    for (std::size_t i = 0; i < live.size(); i += group)
      gone.push_back(
          *std::min_element(live.begin() + std::ptrdiff_t(i), live.begin() + std::ptrdiff_t(std::min(i + group, live.size())), less));
    std::sort(gone.begin(), gone.end(), less);
    gone.resize(std::min(gone.size(), std::max<std::size_t>(1, static_cast<std::size_t>(drop * double(live.size())))));
  }
  gone.resize(std::min(gone.size(), most));
  std::sort(gone.begin(), gone.end());
  std::vector<int> rest;
  std::set_difference(live.begin(), live.end(), gone.begin(), gone.end(), std::back_inserter(rest));
  live = std::move(rest);
  return gone;
}
}  // namespace detail

/// Drops Gaussians until `keep` of them is left, so that the pictures that these cameras take change as little as can be: rounds that drop
/// those of the least loss (score_gaussians) beside the first pictures and fit the others to them (refit_gaussians), then a longer fit.
/// What no camera sees goes first: give cameras as they will be.
/// @param cloud    in, out: those that are dropped have the power -infinity, which no picture shows; colours and opacities of the others
/// are
///                 fitted (of all that share its views). `pruned_set` gives the rest as a set
/// @param cameras  as many as frames.images
/// @param frames   rgb, depth and alpha of the images; out: pictures of some step. As much again is allocated for the first ones
/// Waits for the device. Cost with the defaults: about four times the pictures, 7 x rounds + 67 times at most (8 rounds to 30 %), of which
/// 5 where steps of the last fit are undone; 73 times at most where keep = 1. The same bits for any batch and any number of threads.
/// Errors: gsp::Error where there are no Gaussians, no camera sees any, or squares of pictures are not finite; std::invalid_argument for
/// keep outside (0, 1], drop outside (0, 1), and where refit_gaussians has them.
template <ExecutionSpace Exec, class R, class PosesMem, class Mem>
PruneReport prune_gaussians(Exec const& exec, Gaussians<Mem>& cloud, Poses<R, PosesMem> const& poses, Cameras<Mem> const& cameras,
                            Frames<Mem>& frames, PruneOptions options = {}) {
  Region const region("gsp::splat::prune_gaussians");
  expects(options.keep > 0 && options.keep <= 1, "gsp::prune_gaussians: keep is " + std::to_string(options.keep) +
                                                     ", a share of the Gaussians: give a number above 0 and up to 1");
  expects(options.drop > 0 && options.drop < 1,
          "gsp::prune_gaussians: drop is " + std::to_string(options.drop) + ": give a number above 0 and below 1");
  if (cloud.count == 0) throw Error("gsp::prune_gaussians: there are no Gaussians; give a set that has some");
  options.between.render = options.render;
  options.last.render = options.render;
  render(exec, cloud, poses, cameras, frames, options.render);
  auto wanted = make_wanted_pictures(exec, frames);
  wanted.depth_weight = options.depth_weight;
  auto scores = make_gaussian_scores(exec, cloud, frames.images);
  auto scratch = make_refit_scratch(exec, cloud, frames.images);
  auto const source = detail::to_host(exec, cloud.source);

  PruneReport report;
  report.sweeps = 1;
  std::vector<int> live(std::size_t(cloud.count));
  std::iota(live.begin(), live.end(), 0);  // places in the cloud
  auto const target = std::max<std::size_t>(1, static_cast<std::size_t>(options.keep * cloud.count + 0.5));
  while (live.size() > target) {
    score_gaussians(exec, cloud, poses, cameras, wanted, frames, scores, options.render);
    auto const by_source = detail::to_host(exec, scores.loss);
    std::vector<std::int64_t> loss;
    for (int const i : source) loss.push_back(by_source[std::size_t(i)]);
    if (report.rounds == 0 && std::all_of(loss.begin(), loss.end(), [](auto x) { return x == 0; }))
      throw Error("gsp::prune_gaussians: no camera sees any Gaussian; give cameras that look at them (world to camera, z forward)");
    auto const gone = detail::choose_dropped(live, loss, target, options.drop, report.rounds == 0);
    auto const places = detail::to_device<Kokkos::View<int*, Kokkos::LayoutRight, Mem>>(exec, "gsp::prune_gaussians::places", gone);
    Kokkos::parallel_for("gsp::splat::prune_gaussians", lightweight(Kokkos::RangePolicy<Exec>(exec, 0, int(gone.size()))),
                         detail::DropGaussians<Mem>{places, cloud});
    exec.fence("gsp::prune_gaussians: the places go away");
    ++report.rounds;
    ++report.sweeps;
    if (live.size() > target && options.between.steps > 0)
      report.sweeps += refit_gaussians(exec, cloud, poses, cameras, wanted, frames, scratch, options.between).sweeps;
  }
  auto const fit = refit_gaussians(exec, cloud, poses, cameras, wanted, frames, scratch, options.last);
  report.kept = int(live.size());
  report.dropped = fit.before;
  report.after = fit.after;
  report.sweeps += fit.sweeps;
  return report;
}

/// The Gaussians of `set` that `cloud` has not dropped, with the colours, opacities and sizes that it has, and where they stood in `set`.
struct PrunedSet {
  GaussianSet set;
  std::vector<int> index;  // in the set that was given
};
/// @param set    one of the sets that make_gaussians was given; first: how many Gaussians stood in those before it
/// Waits for the device; costs host time alone. Errors: std::invalid_argument where the cloud was made of fewer Gaussians.
template <ExecutionSpace Exec, class Mem>
PrunedSet pruned_set(Exec const& exec, GaussianSet const& set, Gaussians<Mem> const& cloud, std::size_t first = 0) {
  expects(first + set.size() <= std::size_t(cloud.count),
          "gsp::pruned_set: the set ends at Gaussian " + std::to_string(first + set.size()) + ", and the cloud has " +
              std::to_string(cloud.count) + ": give a set that make_gaussians was given, and how many stood before it");
  auto const source = detail::to_host(exec, cloud.source);
  auto const power = detail::to_host(exec, cloud.power), sh = detail::to_host(exec, cloud.sh), scales = detail::to_host(exec, cloud.scales);
  std::vector<int> place(source.size());
  for (std::size_t i = 0; i < source.size(); ++i) place[std::size_t(source[i])] = int(i);
  std::size_t const row = cloud.sh.extent(1), numbers = 3 * std::size_t((set.sh_degree + 1) * (set.sh_degree + 1));
  PrunedSet out;
  out.set.sh_degree = set.sh_degree;
  auto const take = [](std::vector<float>& to, std::vector<float> const& from, std::size_t i, std::size_t n) {
    to.insert(to.end(), from.begin() + std::ptrdiff_t(i * n), from.begin() + std::ptrdiff_t((i + 1) * n));
  };
  for (std::size_t i = 0; i < set.size(); ++i) {
    auto const at = std::size_t(place[first + i]);
    if (power[at] == -std::numeric_limits<float>::infinity()) continue;
    out.index.push_back(int(i));
    take(out.set.positions, set.positions, i, 3);
    take(out.set.quats, set.quats, i, 4);
    for (std::size_t k = 0; k < 3; ++k) out.set.scales.push_back(scales[k * row + at]);
    out.set.body.push_back(set.body[i]);
    out.set.opacities.push_back(std::min(1.f, std::exp2(power[at])));
    for (std::size_t k = 0; k < numbers; ++k) out.set.sh.push_back(sh[k * row + at]);
  }
  return out;
}

}  // namespace gsp
