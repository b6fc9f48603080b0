#pragma once
#include <cmath>
#include <gsp/splat/detail/refit_kernels.hpp>
#include <gsp/splat/render.hpp>
#include <limits>

namespace gsp {

struct RefitOptions {
  bool colours = true, opacities = true, sizes = true;  // what is fitted
  int steps = 6;                                        // of Gauss and Newton, at most
  int iterations = 10;                                  // of conjugate gradients in each, at most
  float damping = 0.02f;                                // share of the diagonal that is added to it (Levenberg and Marquardt), at first
  float floor = 0.1f;  // in pixels: an unknown that all pictures together show less is left nearly as it is
  RenderOptions render{};
};

/// Sums, vectors and copies of `refit_gaussians`.
template <class Mem>
struct RefitScratch {
  detail::RefitVectors<Mem> vectors;
  detail::ExactSums<Mem> error;  // (C)
  Kokkos::View<double*, Kokkos::LayoutRight, Mem> sums;
  Kokkos::View<float**, Kokkos::LayoutRight, Mem> sh, scales;  // of the Gaussians before a step
  Kokkos::View<float*, Kokkos::LayoutRight, Mem> power;        // as above
};
struct RefitReport {
  double before = 0, after = 0;  // E
  int steps = 0;                 // that were taken
  int sweeps = 0;                // how often all pictures were drawn
};

/// Allocates. images: those of the frames.
template <ExecutionSpace Exec, class Mem>
RefitScratch<Mem> make_refit_scratch(Exec const& exec, Gaussians<Mem> const& cloud, int images) {
  using Scratch = RefitScratch<Mem>;
  std::int64_t const unknowns = std::int64_t(detail::unknowns_of(cloud.sh_degree)) * cloud.count;
  Scratch s;
  for (auto* const v : {&s.vectors.gradient, &s.vectors.diagonal, &s.vectors.product})
    *v = detail::allocate<Kokkos::View<std::int64_t*, Kokkos::LayoutRight, Mem>>("gsp::RefitScratch::exact", unknowns);
  for (auto* const v : {&s.vectors.change, &s.vectors.left, &s.vectors.direction, &s.vectors.inverse})
    *v = detail::allocate<Kokkos::View<float*, Kokkos::LayoutRight, Mem>>("gsp::RefitScratch::vector", unknowns);
  detail::make_sums(exec, s.error, "gsp::RefitScratch::error", images);
  s.sums = detail::allocate<decltype(s.sums)>("gsp::RefitScratch::sums", (unknowns + 255) / 256);
  s.sh = detail::allocate<decltype(s.sh)>("gsp::RefitScratch::sh", cloud.sh.extent(0), cloud.sh.extent(1));
  s.scales = detail::allocate<decltype(s.scales)>("gsp::RefitScratch::scales", cloud.scales.extent(0), cloud.scales.extent(1));
  s.power = detail::allocate<decltype(s.power)>("gsp::RefitScratch::power", cloud.power.extent(0));
  return s;
}

namespace detail {
/// Numbers on the host's way through a refit.
template <class Exec, class Poses, class Mem>
struct Refit {
  Exec const& exec;
  Gaussians<Mem>& cloud;
  Poses const& poses;
  Cameras<Mem> const& cameras;
  WantedPictures<Mem> const& wanted;
  Frames<Mem>& frames;
  RefitScratch<Mem>& scratch;
  RefitOptions options;
  int sweeps = 0;
  double damping = options.damping;
  static constexpr float least = 1.f / 255;  // opacity

  std::int64_t unknowns() const { return std::int64_t(scratch.vectors.change.extent(0)); }

  template <class F>
  void each_unknown(char const* label, F const& f) const {
    Kokkos::parallel_for(label, lightweight(Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, unknowns())), f);
  }
  template <class Term>
  double sum(Term const& term) const {
    Kokkos::parallel_for("gsp::splat::refit_sum",
                         Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(scratch.sums.extent(0))),
                         PartialSums<Mem, Term>{term, scratch.sums, unknowns()});
    double s = 0;
    for (double const part : to_host(exec, scratch.sums)) s += part;
    return s;
  }
  /// E, its gradient and the diagonal, where the Gaussians stand; infinity where E is not finite.
  double look() {
    auto& v = scratch.vectors;
    zero(exec, v.gradient);
    zero(exec, v.diagonal);
    zero(exec, scratch.error);
    GradientUse<Mem> const use{v.gradient, v.diagonal, cloud.sh_degree, cloud.count};
    render(exec, cloud, poses, cameras, frames, options.render, RefitChannel<Mem, GradientUse<Mem>>{wanted, scratch.error, {}, use});
    ++sweeps;
    if (!settle(exec, scratch.error)) return std::numeric_limits<double>::infinity();
    double e = 0;
    for (auto const one : to_host(exec, scratch.error.low)) e += from_exact(one);
    return e;
  }
  void solve() {
    auto& v = scratch.vectors;
    each_unknown("gsp::splat::refit_begin",
                 BeginRefit<Mem>{v, cloud, options.colours, options.opacities, options.sizes, damping, double(options.floor), least});
    CurvatureTerm<Mem> const curvature{v, damping, double(options.floor)};
    double left = sum(LeftTerm<Mem>{v});
    double const enough = 1e-6 * left;
    for (int k = 0; k < options.iterations && left > enough; ++k) {
      zero(exec, v.product);
      ProductUse<Mem> const use{v.product, cloud.sh_degree, cloud.count};
      render(exec, cloud, poses, cameras, frames, options.render, RefitChannel<Mem, ProductUse<Mem>>{wanted, {}, {v.direction}, use});
      ++sweeps;
      double const bend = sum(curvature);
      if (!(bend > 0)) break;
      each_unknown("gsp::splat::refit_go", GoAlong<Mem>{curvature, left / bend});
      double const next = sum(LeftTerm<Mem>{v});
      each_unknown("gsp::splat::refit_turn", TurnDirection<Mem>{v, static_cast<float>(next / left)});
      left = next;
    }
  }
  void save() const {
    copy_view(exec, cloud.sh, scratch.sh);
    copy_view(exec, cloud.scales, scratch.scales);
    copy_view(exec, cloud.power, scratch.power);
  }
  void restore() const {
    copy_view(exec, scratch.sh, cloud.sh);
    copy_view(exec, scratch.scales, cloud.scales);
    copy_view(exec, scratch.power, cloud.power);
    measure();
  }
  void measure() const {
    Kokkos::parallel_for("gsp::splat::refit_measure", lightweight(Kokkos::RangePolicy<Exec>(exec, 0, int(cloud.clusters.extent(0)))),
                         MeasureClusters<Mem>{cloud});
  }
  RefitReport run() {
    RefitReport report;
    double now = report.before = look();
    if (!std::isfinite(now)) throw Error(not_finite("gsp::refit_gaussians"));
    for (int s = 0; s < options.steps; ++s) {
      save();
      solve();
      each_unknown("gsp::splat::refit_step", TakeStep<Mem>{scratch.vectors, cloud, least});
      measure();
      double const then = look();
      if (then < now) {
        ++report.steps;
        damping = std::max(damping / 3, 1e-3);
        bool const little = now - then < 1e-3 * now;
        now = then;
        if (little) break;
      } else {
        restore();
        damping *= 8;
        if (damping > 1e3 || s + 1 == options.steps) break;
        now = look();
      }
    }
    report.after = now;
    report.sweeps = sweeps;
    return report;
  }
};
}  // namespace detail

/// Fits colours (all SH terms) and opacities of Gaussians to pictures: the least E (WantedPictures), from where they stand; places, shapes
/// and turns stay. Steps of Gauss and Newton, damped so that E never grows: with J, how the pictures follow the unknowns,
///   (J^T J + damping D + floor) x = -J^T e,   D: the diagonal of J^T J,
/// by conjugate gradients, for which J x and J^T y are sweeps over the lists of bin_tiles; J is never stored. Pictures are linear in
/// colours, so of those alone a single step is all; a colour that a view clamps at 0 stands still there. Opacities stay within 1/255 to 1.
/// @param cloud    in, out: sh, power, scales, clusters (of all that share its views)
/// @param cameras  as many as frames.images
/// @param frames   rgb, depth and alpha; out: the pictures of some step
/// Returns E before and after, sums over all images. Waits for the device, also between iterations; allocates as `render` does. Cost: about
/// four times the pictures for each of 1 + steps x (iterations + 1) sweeps at most, and one more behind each step that is undone but the
/// last. The same bits for any batch and any number of threads. Errors: gsp::Error where squares of pictures are not finite;
/// std::invalid_argument where render has them, for frames without rgb, depth or alpha, pictures or scratch of another size, and steps,
/// iterations, damping or floor below 0.
/// Source: Levenberg-Marquardt for 3DGS as in 3DGS-LM (Hoellein et al. 2025), on closed forms of D (score_gaussians.hpp).
template <ExecutionSpace Exec, class R, class PosesMem, class Mem>
RefitReport refit_gaussians(Exec const& exec, Gaussians<Mem>& cloud, Poses<R, PosesMem> const& poses, Cameras<Mem> const& cameras,
                            WantedPictures<Mem> const& wanted, Frames<Mem>& frames, RefitScratch<Mem>& scratch, RefitOptions options = {}) {
  Region const region("gsp::splat::refit_gaussians");
  detail::check_wanted("gsp::refit_gaussians", wanted, frames);
  std::int64_t const unknowns = std::int64_t(detail::unknowns_of(cloud.sh_degree)) * cloud.count;
  expects(std::int64_t(scratch.vectors.change.extent(0)) == unknowns && int(scratch.error.low.extent(0)) == frames.images,
          "gsp::refit_gaussians: the scratch is for " + std::to_string(scratch.vectors.change.extent(0)) + " unknowns and " +
              std::to_string(scratch.error.low.extent(0)) + " images, not for " + std::to_string(unknowns) + " and " +
              std::to_string(frames.images) + ": make_refit_scratch with these");
  expects(options.steps >= 0 && options.iterations >= 0 && options.damping >= 0 && options.floor >= 0,
          "gsp::refit_gaussians: steps, iterations, damping and floor must not be negative");
  return detail::Refit<Exec, Poses<R, PosesMem>, Mem>{exec, cloud, poses, cameras, wanted, frames, scratch, options}.run();
}

}  // namespace gsp
