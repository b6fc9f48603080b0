#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <gsp/splat/score_gaussians.hpp>
#include <gsp_test_execs.hpp>
#include <limits>
#include <splat/pruned_scenes.hpp>
#include <support/kokkos_tools.hpp>

namespace {

/// Term i, or the i-th from the end, to sum 1.
template <class Mem>
struct AddTerms {
  Kokkos::View<float*, Mem> terms;
  gsp::detail::ExactSums<Mem> sums;
  bool back;
  KOKKOS_FUNCTION void operator()(int i) const { sums.add(1, terms(back ? int(terms.extent(0)) - 1 - i : i)); }
};

}  // namespace

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

TEST_CASE_TEMPLATE("after its first call score_gaussians allocates nothing, and works on its instance", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  gsp_test::PrunedScene const scene(200, 1, 1);
  auto const cloud = gsp::make_gaussians(exec, scene.set);
  auto const poses = scene.poses(exec);
  auto const cameras = gsp::make_cameras(exec, scene.viewmats, scene.Ks);
  auto frames = gsp::make_frames(exec, cloud, {.images = scene.images, .width = scene.width, .height = scene.height, .batch = 2});
  gsp::render(exec, cloud, poses, cameras, frames);
  auto const wanted = gsp::make_wanted_pictures(exec, frames);
  auto scores = gsp::make_gaussian_scores(exec, cloud, scene.images);
  auto const score = [&] { gsp::score_gaussians(exec, cloud, poses, cameras, wanted, frames, scores); };
  score();
  auto const seen = gsp_test::watch(score);
  CHECK(!seen.kernels.empty());
  gsp_test::check_labels(seen);
  gsp_test::check_no_allocation(seen);
  gsp_test::check_instance(exec, seen);
}

// Powers of two are exact in every step.
TEST_CASE_TEMPLATE("sums do not wrap, in any order, and tell of terms that are not finite", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  float const infinity = std::numeric_limits<float>::infinity(), tiny = 0x1p-30f;
  std::int64_t const one = std::int64_t(1) << 30, most = 9200000000000000000, largest = std::int64_t(4.6e18f);
  struct Case {
    std::vector<float> terms;
    std::int64_t sum;
    bool finite = true;
  };
  for (auto const& [terms, sum, finite] :
       {Case{{}, 0}, Case{{1, -2, tiny}, -one + 1}, Case{{2, 1.99f, -2, -1.99f, tiny}, 1}, Case{{1e30f, 1e30f, 1e30f}, most},
        Case{{-1e30f, -1e30f, -1e30f}, -most}, Case{{1e30f, 1e30f, 1e30f, -1e30f, -1e30f, tiny}, largest + 1},
        Case{{1e30f, 1e30f, 1e30f, -1e30f, -1e30f, -1e30f, 1}, one}, Case{std::vector<float>(100000, 100000.f), most},
        Case{std::vector<float>(100000, -0x1p15f), -100000 * (one << 15)}, Case{{1, std::nanf("")}, one, false},
        Case{{1, infinity}, largest + one, false}, Case{{1, -infinity}, -largest + one, false}}) {
    auto const values = gsp::detail::to_device<Kokkos::View<float*, Mem>>(exec, "terms", terms);
    gsp::detail::ExactSums<Mem> sums;
    gsp::detail::make_sums(exec, sums, "sums", 2);
    for (bool back : {false, true}) {
      gsp::detail::zero(exec, sums);
      Kokkos::parallel_for("gsp::test::add", Kokkos::RangePolicy<Exec>(exec, 0, int(terms.size())), AddTerms<Mem>{values, sums, back});
      CHECK(gsp::detail::settle(exec, sums) == finite);
      auto const is = gsp::detail::to_host(exec, sums.low);
      CAPTURE(terms.size());
      CHECK(is[0] == 0);
      CHECK(is[1] == sum);
    }
  }
}

TEST_CASE_TEMPLATE("what outshines all the others stays the most important", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  gsp_test::PrunedScene scene(60, 0, 0.9);
  auto const poses = scene.poses(exec);
  auto const cameras = gsp::make_cameras(exec, scene.viewmats, scene.Ks);
  auto frames = scene.frames(exec);
  auto const scored = [&](gsp::GaussianSet const& set) {
    auto const cloud = gsp::make_gaussians(exec, set);
    gsp::render(exec, cloud, poses, cameras, frames);
    auto const wanted = gsp::make_wanted_pictures(exec, frames);
    auto scores = gsp::make_gaussian_scores(exec, cloud, scene.images);
    gsp::score_gaussians(exec, cloud, poses, cameras, wanted, frames, scores);
    return gsp::detail::to_host(exec, scores.loss);
  };
  auto const loss = scored(scene.set);
  auto const i = std::size_t(std::max_element(loss.begin(), loss.end()) - loss.begin());
  for (std::size_t k = 0; k < 3; ++k) scene.set.sh[3 * i + k] = 1e7f;
  auto const bright = scored(scene.set);
  CHECK(double(bright[i]) * gsp::score_unit > 8.5e9);
  CHECK(*std::min_element(bright.begin(), bright.end()) >= 0);
  for (std::size_t k = 0; k < 3; ++k) scene.set.sh[3 * i + k] = 1e25f;
  CHECK_THROWS_WITH_AS(scored(scene.set), doctest::Contains("squares of the pictures are not finite"), gsp::Error);
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
