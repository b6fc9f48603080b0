#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <gsp/splat/jitter_cameras.hpp>
#include <gsp_test_execs.hpp>
#include <splat/scenes.hpp>
#include <support/kokkos_tools.hpp>

namespace {

template <class View>
auto on_host(View const& v) {
  return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v);
}
template <class View>
std::vector<float> numbers_of(View const& v) {
  auto const host = on_host(v);
  return {host.data(), host.data() + host.size()};
}
bool same_bits(std::vector<float> const& a, std::vector<float> const& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}
template <class Mem>
bool same_bits(gsp::Cameras<Mem> const& a, gsp::Cameras<Mem> const& b) {
  return same_bits(numbers_of(a.viewmats), numbers_of(b.viewmats)) && same_bits(numbers_of(a.Ks), numbers_of(b.Ks));
}

}  // namespace

// The nine numbers are found again from matrices: float's 6e-8 of metres and of 500 pixels, a thousandth of what is drawn.
TEST_CASE_TEMPLATE("each camera has its own place, direction and K, uniform and of nothing else", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  int const images = 6000;
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(images, 640, 480, 2, 5, viewmats, Ks);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  auto jittered = gsp::make_cameras(exec, images);
  // example-begin jitter_cameras
  // a centimetre, half a degree, 2 % of the focal length and three pixels, others in each episode
  gsp::JitterCamerasOptions options{.position = 0.01f, .rotation = 0.0087f, .focal = 0.02f, .principal = 3, .seed = 7};
  options.step = 12;
  gsp::jitter_cameras(exec, cameras, jittered, options);
  // example-end jitter_cameras
  gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::jitter_cameras(exec, cameras, jittered, options); }));
  auto const views = numbers_of(jittered.viewmats), K = numbers_of(jittered.Ks);
  constexpr int kinds = 9;
  double const most[kinds] = {0.01, 0.01, 0.01, 0.0087, 0.0087, 0.0087, 0.02, 3, 3},
               rounding[kinds] = {1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-4, 1e-4};
  std::vector<std::array<double, kinds>> drawn;
  for (int c = 0; c < images; ++c) {
    float const *v = &viewmats[std::size_t(16 * c)], *is = &views[std::size_t(16 * c)], *k = &Ks[std::size_t(9 * c)],
                *k_is = &K[std::size_t(9 * c)];
    double turn[3][3];  // R^T = V' V^T
    for (int r = 0; r < 3; ++r)
      for (int j = 0; j < 3; ++j) {
        turn[r][j] = 0;
        for (int i = 0; i < 3; ++i) turn[r][j] += double(is[4 * r + i]) * v[4 * j + i];
      }
    std::array<double, kinds> x{};
    for (int i = 0; i < 3; ++i) {  // t' = R^T (t - d)
      x[std::size_t(i)] = v[4 * i + 3];
      for (int r = 0; r < 3; ++r) x[std::size_t(i)] -= turn[r][i] * is[4 * r + 3];
    }
    double const skew[3] = {turn[1][2] - turn[2][1], turn[2][0] - turn[0][2], turn[0][1] - turn[1][0]};
    double const s = 0.5 * std::sqrt(skew[0] * skew[0] + skew[1] * skew[1] + skew[2] * skew[2]);
    for (int i = 0; i < 3; ++i) x[std::size_t(3 + i)] = 0.5 * skew[i] * std::asin(s) / s;
    x[6] = double(k_is[0]) / k[0] - 1;
    CHECK(double(k_is[4]) / k[4] - 1 == doctest::Approx(x[6]).epsilon(1e-4));
    x[7] = double(k_is[2]) - k[2];
    x[8] = double(k_is[5]) - k[5];
    for (int i = 0; i < kinds; ++i) REQUIRE(std::abs(x[std::size_t(i)]) <= most[i] + rounding[i]);
    for (int i = 12; i < 16; ++i) REQUIRE(is[i] == v[i]);
    drawn.push_back(x);
  }
  double const root = std::sqrt(double(images));
  for (int i = 0; i < kinds; ++i) {
    double mean = 0, square = 0;
    for (auto const& x : drawn) mean += x[std::size_t(i)] / most[i], square += std::pow(x[std::size_t(i)] / most[i], 2);
    CHECK(std::abs(mean / images) < 5 / std::sqrt(3.) / root);                          // five deviations of the mean
    CHECK(std::abs(square / images - 1 / 3.) < 5 * std::sqrt(1 / 5. - 1 / 9.) / root);  // and of the square's: E u^4 = 1/5
    for (int j = 0; j < kinds; ++j)
      for (int ahead = i < j ? 0 : 1; ahead < 2; ++ahead) {  // of one camera, and of one and the next
        double both = 0;
        for (int c = 0; c + ahead < images; ++c)
          both += drawn[std::size_t(c)][std::size_t(i)] / most[i] * drawn[std::size_t(c + ahead)][std::size_t(j)] / most[j];
        CHECK(std::abs(both / images) < 5 / 3. / root);
      }
  }
  // the first number of the first stream, by hand
  for (int const c : {0, 17, 5999}) {
    auto const word = gsp::philox(7, {{0, std::uint32_t(c), 12, 18u}}).word[0];
    CHECK(drawn[std::size_t(c)][0] == doctest::Approx(0.01 * (2 * (double(word >> 9) + 0.5) / 8388608 - 1)).epsilon(1e-3));
  }
}

TEST_CASE_TEMPLATE("the same bits in any batch, and none are touched that are not asked for", Exec, GSP_TEST_ALL_EXECS) {
  Exec const exec;
  int const images = 40;
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(images, 64, 48, 2, 5, viewmats, Ks);
  std::vector<int> world;
  for (int c = 0; c < images; ++c) world.push_back(c / 2);
  auto cameras = gsp::make_cameras(exec, viewmats, Ks, world, {gsp::opencv_lens({-0.1, 0, 0, 0})});
  cameras.width = 64, cameras.height = 48;
  auto jittered = gsp::make_cameras(exec, images), again = gsp::make_cameras(exec, images);
  gsp::jitter_cameras(exec, cameras, jittered, {.seed = 4, .step = 9});
  CHECK(same_bits(jittered, cameras));
  CHECK(jittered.world.data() == cameras.world.data());
  CHECK(jittered.lenses.data() == cameras.lenses.data());
  CHECK(jittered.width == 64);
  CHECK(jittered.height == 48);
  gsp::jitter_cameras(exec, cameras, jittered, {.focal = 0.1f, .principal = 2, .seed = 4});
  CHECK(same_bits(numbers_of(jittered.viewmats), viewmats));
  CHECK(!same_bits(numbers_of(jittered.Ks), Ks));
  gsp::jitter_cameras(exec, cameras, jittered, {.position = 0.1f, .rotation = 0.1f, .seed = 4});
  CHECK(!same_bits(numbers_of(jittered.viewmats), viewmats));
  CHECK(same_bits(numbers_of(jittered.Ks), Ks));
  gsp::jitter_cameras(exec, cameras, again, {.position = 0.1f, .seed = 4});
  for (int c = 0; c < images; ++c)
    for (int i = 0; i < 16; ++i)
      REQUIRE((i == 3 || i == 7 || i == 11) != (numbers_of(again.viewmats)[std::size_t(16 * c + i)] == viewmats[std::size_t(16 * c + i)]));

  gsp::JitterCamerasOptions options{
      .position = 0.1f, .rotation = 0.2f, .focal = 0.1f, .principal = 2, .seed = 4, .step = std::int64_t(1) << 40};
  gsp::jitter_cameras(exec, cameras, jittered, options);
  gsp::jitter_cameras(exec, cameras, again, options);
  CHECK(same_bits(jittered, again));
  auto const whole_views = numbers_of(jittered.viewmats), whole_Ks = numbers_of(jittered.Ks);
  for (auto const& change : {gsp::JitterCamerasOptions{.seed = 5, .step = options.step}, gsp::JitterCamerasOptions{.seed = 4, .step = 0}}) {
    auto other = options;
    other.seed = change.seed, other.step = change.step;
    gsp::jitter_cameras(exec, cameras, again, other);
    CHECK(!same_bits(jittered, again));
  }
  int const first = 30, count = 10;  // the last ten by themselves
  auto const part = gsp::make_cameras(exec, {viewmats.begin() + 16 * first, viewmats.end()}, {Ks.begin() + 9 * first, Ks.end()});
  auto of_part = gsp::make_cameras(exec, count);
  options.first_image = first;
  gsp::jitter_cameras(exec, part, of_part, options);
  CHECK(same_bits(numbers_of(of_part.viewmats), {whole_views.begin() + 16 * first, whole_views.end()}));
  CHECK(same_bits(numbers_of(of_part.Ks), {whole_Ks.begin() + 9 * first, whole_Ks.end()}));
  options.first_image = 0;
  // of a chance of their own: the last ten as they are in the batch, the first of them last
  using Mem = typename Exec::memory_space;
  Kokkos::View<std::int64_t* [3], Kokkos::LayoutRight, Mem> const chance("chance", count);
  auto const rows = Kokkos::create_mirror_view(chance);
  for (int c = 0; c < count; ++c) rows(c, 0) = 4, rows(c, 1) = options.step, rows(c, 2) = first + c;
  Kokkos::deep_copy(chance, rows);
  gsp::jitter_cameras(exec, part, of_part, {.position = 0.1f, .rotation = 0.2f, .focal = 0.1f, .principal = 2, .seed = 77}, chance);
  CHECK(same_bits(numbers_of(of_part.viewmats), {whole_views.begin() + 16 * first, whole_views.end()}));
  CHECK(same_bits(numbers_of(of_part.Ks), {whole_Ks.begin() + 9 * first, whole_Ks.end()}));
  CHECK_THROWS_WITH_AS(gsp::jitter_cameras(exec, cameras, jittered, options, chance), doctest::Contains("images: give each a seed"),
                       std::invalid_argument);
  gsp::jitter_cameras(exec, cameras, cameras, options);  // in place
  CHECK(same_bits(cameras, jittered));

  auto few = gsp::make_cameras(exec, 3);
  CHECK_THROWS_WITH_AS(gsp::jitter_cameras(exec, cameras, few, options), doctest::Contains("room for 3 cameras, and there are 40"),
                       std::invalid_argument);
  using Options = gsp::JitterCamerasOptions;
  for (auto const& bad :
       {Options{.position = -1}, Options{.rotation = 4}, Options{.focal = 1}, Options{.principal = NAN}, Options{.step = -1},
        Options{.step = std::int64_t(1) << 56}, Options{.first_image = -1}, Options{.first_image = (std::int64_t(1) << 32) - 39}})
    CHECK_THROWS_AS(gsp::jitter_cameras(exec, cameras, jittered, bad), std::invalid_argument);
}
