#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/splat/refit_gaussians.hpp>
#include <gsp_test_execs.hpp>
#include <limits>
#include <splat/pruned_scenes.hpp>
#include <support/kokkos_tools.hpp>

namespace {

/// The scene's Gaussians with other colours, or other opacities, and pictures of the scene as it is.
template <class Exec>
struct Fit {
  using Mem = typename Exec::memory_space;
  gsp_test::PrunedScene scene;
  gsp::Poses<float, Mem> poses;
  gsp::Cameras<Mem> cameras;
  gsp::Frames<Mem> frames;
  gsp::WantedPictures<Mem> wanted;
  gsp::GaussianSet start;
  gsp::Gaussians<Mem> cloud;
  gsp::RefitScratch<Mem> scratch;

  Fit(Exec const& exec, int n, int degree, double colours, double opacities, double sizes, int batch = 0)
      : scene(n, degree, 0.9), poses(scene.poses(exec)), cameras(gsp::make_cameras(exec, scene.viewmats, scene.Ks)), start(scene.set) {
    frames = gsp::make_frames(exec, gsp::make_gaussians(exec, scene.set),
                              {.images = scene.images, .width = scene.width, .height = scene.height, .batch = batch});
    gsp::render(exec, gsp::make_gaussians(exec, scene.set), poses, cameras, frames);
    wanted = gsp::make_wanted_pictures(exec, frames);
    gsp_test::Random random(5);
    for (float& x : start.sh) x += float(random.uniform(-colours, colours));
    for (std::size_t i = 0; i < start.size(); ++i) {
      start.opacities[i] *= float(random.uniform(1 - opacities, 1));
      float const grown = float(random.uniform(1 - sizes, 1 + sizes));
      for (std::size_t k = 0; k < 3; ++k) start.scales[3 * i + k] *= grown;
    }
    cloud = gsp::make_gaussians(exec, start);
    scratch = gsp::make_refit_scratch(exec, cloud, scene.images);
  }
  gsp::RefitReport run(Exec const& exec, gsp::RefitOptions const& options) {
    return gsp::refit_gaussians(exec, cloud, poses, cameras, wanted, frames, scratch, options);
  }
};

}  // namespace

// dE/dx = 2 J^T e of colours, opacities and sizes against central differences of E in double, whose steps of 1e-6 to 1e-5 are so small that
// hardly a pixel comes to 1/255, which is a jump of E. Sums in float have an error of 1e-5 of what they sum up.
TEST_CASE_TEMPLATE("the gradient is that of differences of E", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  Fit<Exec> fit(exec, 40, 1, 0.1, 0.2, 0.1);
  for (float& x : fit.start.scales) {  // of four digits, so that it can be stretched by little without rounding
    int power = 0;
    float const digits = std::frexp(x, &power);
    x = std::ldexp(std::round(16 * digits) / 16, power);
  }
  fit.cloud = gsp::make_gaussians(exec, fit.start);
  gsp::RenderOptions const options{.stop = 0};
  auto& v = fit.scratch.vectors;
  for (auto* const sums : {&v.gradient, &v.diagonal}) gsp::detail::zero(exec, *sums);
  gsp::detail::zero(exec, fit.scratch.error);
  int const n = fit.cloud.count, colours = 12;
  using Use = gsp::detail::GradientUse<Mem>;
  gsp::render(exec, fit.cloud, fit.poses, fit.cameras, fit.frames, options,
              gsp::detail::RefitChannel<Mem, Use>{fit.wanted, fit.scratch.error, {}, Use{v.gradient, v.diagonal, 1, n}});
  auto const gradient = gsp_test::on_host(v.gradient);
  auto const source = gsp_test::on_host(fit.cloud.source);
  auto const wanted = gsp_test::on_host_wanted(fit.wanted);
  auto const E = [&](gsp::GaussianSet const& s) {
    double sum = 0;
    for (auto const& image : fit.scene.differences(s, wanted, options))
      for (double const x : image) sum += x * x;
    return sum;
  };
  int steep = 0;
  for (int place = 0; place < n; ++place) {
    auto const i = std::size_t(source(place));
    for (int row : {0, 4, 8, colours, colours + 1}) {  // a constant term, two of degree 1, the opacity, the size
      auto up = fit.start, down = fit.start;
      double step = 0;
      if (row <= colours) {
        float &high = row == colours ? up.opacities[i] : up.sh[std::size_t(colours) * i + std::size_t(row)],
              &low = row == colours ? down.opacities[i] : down.sh[std::size_t(colours) * i + std::size_t(row)];
        high += 1e-5f;
        low -= 1e-5f;
        step = double(high) - double(low);
        if (row == colours && !(low > 1.5f / 255)) continue;
      } else {
        for (std::size_t k = 3 * i; k < 3 * i + 3; ++k) {
          up.scales[k] *= 1 + 0x1p-20f;
          down.scales[k] *= 1 - 0x1p-20f;
        }
        step = 0x1p-19;
      }
      double const want = (E(up) - E(down)) / step, is = 2 * gsp::detail::from_exact(gradient(row * n + place));
      CHECK_MESSAGE(std::abs(is - want) <= 2e-4 * std::abs(want) + 2e-3, "unknown ", row, " of Gaussian ", i, ": ", is, ", differences ",
                    want);
      steep += std::abs(want) > 0.1;
    }
  }
  CHECK(steep > 40);
}

// Pictures are linear in colours: one step finds the least E, which is 0, to what floats and so many iterations leave of it.
TEST_CASE_TEMPLATE("colours that were changed are found again in one step", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  Fit<Exec> fit(exec, 60, 1, 0.05, 0, 0);
  auto const report = fit.run(exec, {.opacities = false, .sizes = false, .steps = 1, .iterations = 60, .damping = 0, .floor = 1e-4f});
  MESSAGE("E ", report.before, " -> ", report.after, ", ", report.sweeps, " sweeps");
  CHECK(report.before > 0.05);
  CHECK(report.after < 1e-3 * report.before);
  CHECK(report.steps == 1);
  auto const power = gsp::detail::to_host(exec, fit.cloud.power),
             start = gsp::detail::to_host(exec, gsp::make_gaussians(exec, fit.start).power);
  CHECK(std::memcmp(power.data(), start.data(), power.size() * sizeof(float)) == 0);  // opacities stay
}

TEST_CASE_TEMPLATE("opacities and sizes that were changed are found again, and E never grows", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  Fit<Exec> fit(exec, 60, 0, 0.05, 0.3, 0.05);
  double before = -1, first = 0;
  for (int k = 0; k < 6; ++k) {
    auto const report = fit.run(exec, {.steps = 2, .iterations = 12});
    CHECK(report.sweeps <= 1 + 2 * 13 + 1);
    if (k == 0) first = report.before;
    CHECK(report.after <= report.before);
    if (k > 0) CHECK(report.before == before);  // it goes on where it ended: E is that of what the cloud holds
    before = report.after;
  }
  MESSAGE("E ", first, " -> ", before);
  CHECK(before < 1e-3 * first);
  auto const power = gsp::detail::to_host(exec, fit.cloud.power);
  for (int i = 0; i < fit.cloud.count; ++i) CHECK(power[std::size_t(i)] <= 0);
}

TEST_CASE_TEMPLATE("a fit has the same bits for any batch and on every host backend", Exec, GSP_TEST_EXECS) {
  auto const fitted = [&](auto const& exec, int batch) {
    Fit<std::remove_cvref_t<decltype(exec)>> fit(exec, 300, 2, 0.1, 0.2, 0.1, batch);
    fit.run(exec, {.steps = 2, .iterations = 3});
    auto all = gsp::detail::to_host(exec, fit.cloud.sh);
    for (auto const& more : {gsp::detail::to_host(exec, fit.cloud.power), gsp::detail::to_host(exec, fit.cloud.scales)})
      all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  Exec const exec;
  auto const whole = fitted(exec, 3);
  auto const other = fitted(exec, 1);
  CHECK(other == whole);
  if constexpr (!gsp::is_device<Exec>) CHECK(fitted(Kokkos::Serial{}, 1) == whole);
}

TEST_CASE_TEMPLATE("steps that are undone take a look more each, but the last", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  Fit<Exec> fit(exec, 60, 0, 0, 0, 0);  // E is 0, and so is the gradient: there is nothing to gain, and no iteration
  auto const report = fit.run(exec, {.steps = 3});
  CHECK(report.steps == 0);
  CHECK(report.after == report.before);
  CHECK(report.sweeps == 1 + 3 + 2);
}

TEST_CASE_TEMPLATE("after its first call refit_gaussians allocates nothing, and works on its instance", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  Fit<Exec> fit(exec, 100, 1, 0.1, 0.2, 0.1, 2);
  gsp::RefitOptions const options{.steps = 2, .iterations = 2};
  fit.run(exec, options);
  auto const seen = gsp_test::watch([&] { fit.run(exec, options); });
  CHECK(!seen.kernels.empty());
  gsp_test::check_labels(seen);
  gsp_test::check_no_allocation(seen);
  gsp_test::check_instance(exec, seen);
}

TEST_CASE("fits that cannot be are refused in a sentence") {
  Kokkos::Serial const exec;
  Fit<Kokkos::Serial> fit(exec, 20, 0, 0, 0, 0);
  CHECK_THROWS_WITH_AS(fit.run(exec, {.steps = -1}), doctest::Contains("must not be negative"), std::invalid_argument);
  fit.wanted.rgb(1, 5, 5, 0) = std::numeric_limits<float>::infinity();
  CHECK_THROWS_WITH_AS(fit.run(exec, {}), doctest::Contains("squares of the pictures are not finite"), gsp::Error);
  fit.scratch = gsp::make_refit_scratch(exec, fit.cloud, 1);
  CHECK_THROWS_WITH_AS(fit.run(exec, {}), doctest::Contains("make_refit_scratch with these"), std::invalid_argument);
}
