#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/splat/develop.hpp>
#include <gsp_test_execs.hpp>
#include <random>
#include <support/kokkos_tools.hpp>

namespace {

template <class View>
auto on_host(View const& v) {
  return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v);
}
/// Light from 0 to 1.4, and how much of it is there, by chance; no picture of Gaussians is needed.
template <class Exec>
auto some_frames(Exec const& exec, int images, int width, int height) {
  auto const cloud = gsp::make_gaussians(exec, gsp::GaussianSet{});
  auto frames = gsp::make_frames(exec, cloud, {.images = images, .width = width, .height = height});
  auto const rgb = on_host(frames.rgb);
  auto const alpha = on_host(frames.alpha);
  std::mt19937 random(4);
  for (std::size_t k = 0; k < rgb.size(); ++k) rgb.data()[k] = float(random() % 1401) / 1000;
  for (std::size_t k = 0; k < alpha.size(); ++k) alpha.data()[k] = float(random() % 1001) / 1000;
  Kokkos::deep_copy(frames.rgb, rgb);
  Kokkos::deep_copy(frames.alpha, alpha);
  return frames;
}
double clamped(double x) { return std::min(std::max(x, 0.), 1.); }

}  // namespace

TEST_CASE_TEMPLATE("pictures over a background, in float, half and eight bits", Exec, GSP_TEST_ALL_EXECS) {
  using Mem = typename Exec::memory_space;
  using half = Kokkos::Experimental::half_t;
  Exec const exec = gsp_test::other_instance(Exec{});
  int const images = 3, width = 19, height = 7;
  auto const frames = some_frames(exec, images, width, height);
  Kokkos::View<float****, Kokkos::LayoutRight, Mem> const out("out", images, height, width, 3), behind("behind", 1, height, width, 3);
  Kokkos::View<half****, Kokkos::LayoutRight, Mem> const halves("halves", images, height, width, 3);
  Kokkos::View<std::uint8_t****, Kokkos::LayoutRight, Mem> const bytes("bytes", images, height, width, 3);
  Kokkos::deep_copy(behind, 0.25f);
  gsp::DevelopOptions options;
  options.background = {0.2f, 0.4f, 0.8f};
  gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::develop(exec, frames, out, options); }));
  gsp::develop(exec, frames, halves, options);
  gsp::develop(exec, frames, bytes, options);
  auto const rgb = on_host(frames.rgb);
  auto const is = on_host(out);
  auto const alpha = on_host(frames.alpha);
  auto const half_is = on_host(halves);
  auto const byte_is = on_host(bytes);
  for (int c = 0; c < images; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        for (int k = 0; k < 3; ++k) {
          double const want = clamped(double(rgb(c, y, x, k)) + (1 - double(alpha(c, y, x))) * double(options.background[k]));
          REQUIRE(std::abs(is(c, y, x, k) - want) < 5e-7);                               // four roundings of numbers up to 1.4
          REQUIRE(std::abs(double(float(half_is(c, y, x, k))) - want) < 2.5e-4 + 5e-7);  // half a unit of half's last place below 1
          REQUIRE(std::abs(byte_is(c, y, x, k) - 255 * want) <= 0.5 + 2e-4);
        }
  gsp::develop(exec, frames, out, {}, behind);
  auto const over = on_host(out);
  CHECK(over(1, 2, 3, 1) == doctest::Approx(clamped(rgb(1, 2, 3, 1) + (1 - alpha(1, 2, 3)) * 0.25)).epsilon(1e-6));
}

TEST_CASE_TEMPLATE("each image has its own exposure, contrast, brightness and noise, of seed and step alone", Exec, GSP_TEST_ALL_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const images = 200, width = 40, height = 30;
  auto const frames = some_frames(exec, images, width, height);
  Kokkos::deep_copy(frames.rgb, 0.5f);
  Kokkos::View<float****, Kokkos::LayoutRight, Mem> const out("out", images, height, width, 3), again("again", images, height, width, 3);
  auto const drawn = [&](gsp::DevelopOptions const& options) {
    gsp::develop(exec, frames, out, options);
    return on_host(out);
  };
  // brightness: 0.5 + b
  auto const bright = drawn({.brightness = 0.3f, .seed = 3});
  double least = 1, most = 0, mean = 0;
  for (int c = 0; c < images; ++c) {
    double const b = bright(c, 0, 0, 0);
    CHECK(bright(c, 29, 39, 2) == bright(c, 0, 0, 0));
    least = std::min(least, b), most = std::max(most, b), mean += b / images;
  }
  CHECK(least > 0.2);
  CHECK(most < 0.8);
  CHECK(most - least > 0.55);                                                // of 200 uniform numbers over 0.6
  CHECK(std::abs(mean - 0.5) < 4 * 0.6 / std::sqrt(12.) / std::sqrt(200.));  // four deviations of the mean
  // exposure: 0.5 x 2^e, as the plain reference has it
  auto const exposed = drawn({.exposure = 0.5f, .seed = 3, .step = (std::int64_t(1) << 40) + 7});
  for (int c = 0; c < images; c += 17) {
    auto const word = gsp::philox(3, {{0, std::uint32_t(c), 7, 256u << 8 | 16u}}).word[0];
    double const e = 0.5 * (2 * (double(word >> 9) + 0.5) / 8388608 - 1);
    CHECK(exposed(c, 3, 4, 1) == doctest::Approx(clamped(0.5 * std::exp2(e))).epsilon(1e-6));
  }
  // contrast leaves the middle, and takes 0.4 to 0.5 - 0.1 (1 + k), the second number of the same four
  auto const middle = drawn({.contrast = 1, .seed = 9});
  CHECK(middle(7, 1, 1, 1) == 0.5f);
  Kokkos::deep_copy(frames.rgb, 0.4f);
  auto const flatter = drawn({.contrast = 0.8f, .seed = 9, .step = 5});
  for (int c = 0; c < images; c += 13) {
    auto const word = gsp::philox(9, {{0, std::uint32_t(c), 5, 16u}}).word[1];
    double const k = 0.8 * (2 * (double(word >> 9) + 0.5) / 8388608 - 1);
    CHECK(flatter(c, 5, 6, 2) == doctest::Approx(0.5 - 0.1 * (1 + k)).epsilon(1e-6));
  }
  Kokkos::deep_copy(frames.rgb, 0.5f);
  // noise: independent normal numbers
  gsp::DevelopOptions const noisy{.noise = 0.05f, .seed = 5, .step = 2};
  auto const noise = drawn(noisy);
  double sum = 0, squares = 0, beside = 0, colours = 0, fourth = 0, third = 0;
  std::int64_t n = 0;
  for (int c = 0; c < images; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x + 1 < width; ++x, ++n) {
        double const a = (noise(c, y, x, 0) - 0.5) / 0.05, b = (noise(c, y, x + 1, 0) - 0.5) / 0.05, g = (noise(c, y, x, 1) - 0.5) / 0.05;
        double const blue = (noise(c, y, x, 2) - 0.5) / 0.05;
        third += blue * blue, sum += a, squares += a * a, fourth += a * a * a * a, beside += a * b, colours += a * g;
      }
  double const root = std::sqrt(double(n));
  CHECK(std::abs(sum / n) < 5 / root);
  CHECK(std::abs(squares / n - 1) < 5 * std::sqrt(2.) / root);
  CHECK(std::abs(fourth / n - 3) < 5 * std::sqrt(96.) / root);
  CHECK(std::abs(beside / n) < 5 / root);
  CHECK(std::abs(colours / n) < 5 / root);
  CHECK(std::abs(third / n - 1) < 5 * std::sqrt(2.) / root);
  gsp::develop(exec, frames, again, noisy);
  CHECK(std::memcmp(on_host(again).data(), noise.data(), noise.span() * sizeof(float)) == 0);
  gsp::DevelopOptions next = noisy;
  next.step = 3;
  gsp::develop(exec, frames, again, next);
  CHECK(on_host(again)(0, 0, 0, 0) != noise(0, 0, 0, 0));
  // images 120 to 122 by themselves, as they are in the batch
  gsp::DevelopOptions part{.exposure = 0.5f, .contrast = 0.3f, .brightness = 0.1f, .noise = 0.05f, .seed = 5, .step = 2};
  gsp::develop(exec, frames, again, part);
  auto const whole = on_host(again);
  auto const three = some_frames(exec, 3, width, height);
  Kokkos::deep_copy(three.rgb, 0.5f);
  Kokkos::View<float****, Kokkos::LayoutRight, Mem> const of_three("of_three", 3, height, width, 3);
  part.first_image = 120;
  gsp::develop(exec, three, of_three, part);
  CHECK(std::memcmp(on_host(of_three).data(), &whole(120, 0, 0, 0), of_three.span() * sizeof(float)) == 0);
  // each image of a chance of its own: those of images 120 to 122 in another order, and light of another step
  using Chance = Kokkos::View<std::int64_t* [3], Kokkos::LayoutRight, Mem>;
  Chance const chance("chance", 3), light("light", 3);
  auto const rows = Kokkos::create_mirror_view(chance), light_rows = Kokkos::create_mirror_view(light);
  std::int64_t const number[] = {122, 120, 121};
  for (int i = 0; i < 3; ++i) {
    rows(i, 0) = light_rows(i, 0) = 5, rows(i, 1) = 2, light_rows(i, 1) = (std::int64_t(1) << 55) + i, rows(i, 2) = number[i];
    light_rows(i, 2) = 7;
  }
  Kokkos::deep_copy(chance, rows);
  Kokkos::deep_copy(light, light_rows);
  part.seed = 99, part.step = 17;  // which nothing looks at
  gsp::develop(exec, three, of_three, part, {}, chance);
  for (int i = 0; i < 3; ++i)
    CHECK(std::memcmp(&on_host(of_three)(i, 0, 0, 0), &whole(int(number[i]), 0, 0, 0), sizeof(float) * 3 * width * height) == 0);
  gsp::develop(exec, three, of_three, {.brightness = 0.3f}, {}, chance, light);
  for (int i = 0; i < 3; ++i) {
    auto const word = gsp::philox(5, {{0, 7, std::uint32_t(i), std::uint32_t(1) << 31 | 16u}}).word[2];
    CHECK(on_host(of_three)(i, 3, 2, 1) == doctest::Approx(0.5 + 0.3 * (2 * (double(word >> 9) + 0.5) / 8388608 - 1)).epsilon(1e-6));
  }
  gsp::develop(exec, three, of_three, {.noise = 0.05f}, {}, chance, light);
  for (int i = 0; i < 3; ++i)
    CHECK(std::memcmp(&on_host(of_three)(i, 0, 0, 0), &noise(int(number[i]), 0, 0, 0), sizeof(float) * 3 * width * height) == 0);
  CHECK_THROWS_WITH_AS(gsp::develop(exec, frames, again, part, {}, chance), doctest::Contains("images: give each a seed"),
                       std::invalid_argument);
  gsp::develop(exec, frames, frames.rgb, noisy);  // in place
  CHECK(std::memcmp(on_host(frames.rgb).data(), noise.data(), noise.span() * sizeof(float)) == 0);
}

TEST_CASE("what does not fit is refused") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  Exec const exec;
  auto frames = some_frames(exec, 2, 8, 6);
  Kokkos::View<float****, Kokkos::LayoutRight, Kokkos::HostSpace> const out("out", 2, 6, 8, 3), small("small", 2, 6, 7, 3);
  CHECK_THROWS_AS(gsp::develop(exec, frames, small), std::invalid_argument);
  CHECK_THROWS_AS(gsp::develop(exec, frames, out, {.noise = -1}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::develop(exec, frames, out, {.contrast = 2}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::develop(exec, frames, out, {.exposure = NAN}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::develop(exec, frames, out, {.step = -1}), std::invalid_argument);
  std::int64_t const steps = std::int64_t(1) << 56, images = std::int64_t(1) << 32;
  gsp::develop(exec, frames, out, {.noise = 0.1f, .step = steps - 1, .first_image = images - 2});
  CHECK_THROWS_WITH_AS(gsp::develop(exec, frames, out, {.step = steps}), doctest::Contains("from 0 to 72057594037927935"),
                       std::invalid_argument);
  for (std::int64_t const first : {std::int64_t(-1), images - 1})
    CHECK_THROWS_WITH_AS(gsp::develop(exec, frames, out, {.first_image = first}), doctest::Contains("first_image"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::develop(exec, frames, out, {}, small), std::invalid_argument);
  frames.alpha = {};
  CHECK_THROWS_AS(gsp::develop(exec, frames, out, {.background = {0, 0, 1}}), std::invalid_argument);
  gsp::develop(exec, frames, out);
  frames.rgb = {};
  CHECK_THROWS_AS(gsp::develop(exec, frames, out), std::invalid_argument);
}
