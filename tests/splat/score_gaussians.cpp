#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <gsp/splat/score_gaussians.hpp>
#include <gsp_test_execs.hpp>
#include <splat/pruned_scenes.hpp>

// E of each set in double, by drawing it again without the Gaussian, all else alike. In float a pixel's light has errors of some 1e-6, of
// what comes from behind an opacity of 0.9 ten times that; so sum |D|^2 - 2 e D has those times sum |D| + |e|.
TEST_CASE_TEMPLATE("a score is what E gains when the Gaussian is dropped and all is drawn again", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  gsp_test::PrunedScene const scene(60, 1, 0.9);
  gsp::RenderOptions const options{.stop = 0};  // else a pixel without the Gaussian may end further behind
  auto const poses = scene.poses(exec);
  auto const cameras = gsp::make_cameras(exec, scene.viewmats, scene.Ks);
  auto other = scene.set;  // what is wanted is not what is drawn
  gsp_test::Random random(3);
  for (float& x : other.sh) x += float(random.uniform(-0.1, 0.1));
  for (float& x : other.opacities) x *= float(random.uniform(0.8, 1));
  auto frames = scene.frames(exec);
  auto const cloud = gsp::make_gaussians(exec, scene.set);
  gsp::render(exec, gsp::make_gaussians(exec, other), poses, cameras, frames, options);
  auto const wanted = gsp::make_wanted_pictures(exec, frames);
  auto scores = gsp::make_gaussian_scores(exec, cloud, scene.images);
  gsp::score_gaussians(exec, cloud, poses, cameras, wanted, frames, scores, options);
  auto const loss = gsp_test::on_host(scores.loss), error = gsp_test::on_host(scores.error);

  auto const want = gsp_test::on_host_wanted(wanted);
  auto const all = scene.differences(scene.set, want, options);
  for (int c = 0; c < scene.images; ++c) {
    double e = 0;
    for (double const x : all[std::size_t(c)]) e += x * x;
    CHECK(error(c) * gsp::score_unit == doctest::Approx(e).epsilon(1e-5));
  }
  int seen = 0;
  for (std::size_t i = 0; i < scene.set.size(); ++i) {
    auto without = scene.set;
    without.opacities[i] = 0;
    auto const rest = scene.differences(without, want, options);
    double gain = 0, size = 0;
    for (std::size_t c = 0; c < rest.size(); ++c)
      for (std::size_t k = 0; k < rest[c].size(); ++k) {
        double const e = all[c][k], d = rest[c][k];
        if (d == e) continue;  // d * d - e * e, with a product fused, is the other's rounding
        gain += d * d - e * e;
        size += std::abs(d - e) + std::abs(e);
      }
    double const is = double(loss(i)) * gsp::score_unit;
    CHECK_MESSAGE(std::abs(is - gain) <= 2e-5 * size, "Gaussian ", i, ": ", is, ", drawn again ", gain);
    seen += size > 0;
    if (size == 0) CHECK(loss(i) == 0);
  }
  CHECK(seen > 40);
  CHECK(seen < 60);  // some are fainter than 1/255, or outside
}

TEST_CASE_TEMPLATE("scores have the same bits for any batch and on every host backend", Exec, GSP_TEST_EXECS) {
  gsp_test::PrunedScene const scene(800, 2, 1);
  auto const scored = [&](auto const& exec, int batch) {
    auto const cloud = gsp::make_gaussians(exec, scene.set);
    auto const poses = scene.poses(exec);
    auto const cameras = gsp::make_cameras(exec, scene.viewmats, scene.Ks);
    auto frames = gsp::make_frames(exec, cloud,
                                   {.images = scene.images,
                                    .width = scene.width,
                                    .height = scene.height,
                                    .batch = batch,
                                    .visible = 1,
                                    .pairs = 1});  // waves overflow and are repeated: they must not count twice
    gsp::render(exec, cloud, poses, cameras, frames);
    auto wanted = gsp::make_wanted_pictures(exec, frames);
    gsp::detail::zero(exec, wanted.rgb);
    auto again = gsp::make_frames(
        exec, cloud, {.images = scene.images, .width = scene.width, .height = scene.height, .batch = batch, .visible = 1, .pairs = 1});
    auto scores = gsp::make_gaussian_scores(exec, cloud, scene.images);
    gsp::score_gaussians(exec, cloud, poses, cameras, wanted, again, scores);
    return gsp::detail::to_host(exec, scores.loss);
  };
  Exec const exec;
  auto const whole = scored(exec, scene.images);
  CHECK(std::count(whole.begin(), whole.end(), 0) < 600);
  for (int batch : {1, 2}) CHECK(scored(exec, batch) == whole);
  if constexpr (!gsp::is_device<Exec>) CHECK(scored(Kokkos::Serial{}, 1) == whole);
}

TEST_CASE("scores of other pictures are refused in a sentence") {
  Kokkos::Serial const exec;
  gsp_test::PrunedScene const scene(20, 0, 1);
  auto const cloud = gsp::make_gaussians(exec, scene.set);
  auto const poses = scene.poses(exec);
  auto const cameras = gsp::make_cameras(exec, scene.viewmats, scene.Ks);
  auto frames = scene.frames(exec), small = gsp::make_frames(exec, cloud, {.images = scene.images, .width = 10, .height = 10});
  auto without = gsp::make_frames(exec, cloud, {.images = scene.images, .width = 10, .height = 10, .depth = false});
  gsp::render(exec, cloud, poses, cameras, frames);
  auto wanted = gsp::make_wanted_pictures(exec, frames);
  auto scores = gsp::make_gaussian_scores(exec, cloud, scene.images), few = gsp::make_gaussian_scores(exec, cloud, 1);
  CHECK_NOTHROW(gsp::score_gaussians(exec, cloud, poses, cameras, wanted, frames, scores));
  CHECK_THROWS_WITH_AS(gsp::score_gaussians(exec, cloud, poses, cameras, wanted, small, scores),
                       doctest::Contains("make_wanted_pictures of these frames"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::score_gaussians(exec, cloud, poses, cameras, wanted, without, scores),
                       doctest::Contains("make_frames with all three"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::score_gaussians(exec, cloud, poses, cameras, wanted, frames, few),
                       doctest::Contains("make_gaussian_scores with these"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::make_wanted_pictures(exec, without), doctest::Contains("no rgb or no depth"), std::invalid_argument);
  wanted.depth_weight = -1;
  CHECK_THROWS_AS(gsp::score_gaussians(exec, cloud, poses, cameras, wanted, frames, scores), std::invalid_argument);
}
