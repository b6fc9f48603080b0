// Lenses against OpenCV's formulas, written beside (tests/reference/rasterize.hpp), with derivatives by differences.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <gsp/math/pack.hpp>
#include <gsp/splat/id_channel.hpp>
#include <gsp/splat/lens.hpp>
#include <gsp/splat/median_depth.hpp>
#include <gsp/splat/normals.hpp>
#include <gsp/splat/render.hpp>
#include <gsp_test_execs.hpp>
#include <limits>
#include <splat/scenes.hpp>
#include <support/kokkos_tools.hpp>

namespace {

using gsp_reference::Bend;
constexpr double infinity = std::numeric_limits<double>::infinity();

template <class View>
auto on_host(View const& v) {
  return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v);
}

/// A lens and the formula that it is to follow.
struct Case {
  gsp::Lens lens;
  Bend bend;
};
Case opencv(std::vector<double> const& k) {
  auto const lens = gsp::opencv_lens(k);
  return {lens, {gsp_reference::opencv_map(k), lens.valid}};
}
Case fisheye(std::vector<double> const& k) {
  auto const lens = gsp::fisheye_lens(k);
  return {lens, {gsp_reference::fisheye_map(k), lens.valid, true}};
}
/// Barrels, a pincushion, a rational one of a wide angle, one that is turned aside, a fisheye.
std::vector<Case> cases() {
  return {opencv({-0.28, 0.09, 0.001, -0.0005, -0.012}),
          opencv({0.2, 0.05, 0, 0}),
          opencv({5.2, 3.1, -0.0004, 0.0003, 0.15, 5.6, 4.9, 0.9}),
          opencv({-0.1, 0, 0.02, -0.015}),
          fisheye({-0.02, 0.01, -0.004, 0.0005}),
          fisheye({0, 0, 0, 0})};
}

}  // namespace

TEST_CASE("rays come where OpenCV says, derivatives are those of differences, and the way back is one") {
  gsp_test::Random random(5);
  for (auto const& c : cases()) {
    double const most = std::min(c.lens.valid, 2.5);
    CHECK(most > 0.7);
    for (int i = 0; i < 2000; ++i) {
      double const r = 0.999 * most * random.uniform(0, 1), turn = random.uniform(0, 6.3), x = r * std::cos(turn), y = r * std::sin(turn);
      auto const want = c.bend.map(x, y);
      auto const is = gsp::distorted(c.lens, x, y);
      REQUIRE(std::abs(is.x - want[0]) < 1e-14 * (1 + std::abs(want[0])));  // some ten roundings
      REQUIRE(std::abs(is.y - want[1]) < 1e-14 * (1 + std::abs(want[1])));
      auto const slope = gsp_reference::slope_of(c.bend, x, y);
      auto const j = gsp::distortion_slope(c.lens, x, y);
      // h^2/6 of third derivatives of up to 100, and 1e-16 / h
      double const pairs[4][2] = {{j.xx, slope[0]}, {j.xy, slope[1]}, {j.xy, slope[2]}, {j.yy, slope[3]}};
      for (auto const& pair : pairs) REQUIRE(std::abs(pair[0] - pair[1]) < 2e-8 * (1 + std::abs(pair[1])));
      gsp::LensPoint<double> ray;
      REQUIRE(gsp::undistorted(c.lens, is.x, is.y, ray));
      // a rounding of x_d, over the least derivative
      double const least = 0.5 * (j.xx + j.yy - std::hypot(j.xx - j.yy, 2 * j.xy));
      REQUIRE(std::hypot(ray.x - x, ray.y - y) < 1e-14 * (1 + std::hypot(is.x, is.y)) / std::min(1., least) + 1e-14);
      // floats and packs: of x^2 in float, 1e-6 of numbers up to 10
      using P = gsp::Pack<double, 8>;
      auto const packed = gsp::distorted(c.lens, P(x), P(y));
      REQUIRE(std::abs(packed.x[3] - is.x) < 1e-14 * (1 + std::abs(is.x)));
      auto const single = gsp::distortion_slope(c.lens, float(x), float(y));
      REQUIRE(std::abs(single.xx - j.xx) < 2e-5 * (1 + std::abs(j.xx)));
    }
    gsp::LensPoint<double> ray;
    CHECK(gsp::undistorted(c.lens, 0, 0, ray));
    CHECK(ray.x == 0);
  }
}

// Lenses by chance: with poles, with bends behind which Newton's steps come round again, turned aside more than any that is sold.
TEST_CASE("the way back is found in all of the disc of any lens") {
  gsp_test::Random random(11);
  auto const within = [&](double a) { return random.uniform(-a, a); };
  // rays go round between 1.529 and 0.011 by Newton's steps alone
  std::vector<gsp::Lens> lenses{gsp::opencv_lens({.01195, .5822, -.003705, -.002466, .2561, -.06762, -.1739, .2136})};
  // a pole at 1.28, where Newton's steps only double
  lenses.push_back(gsp::opencv_lens({.17, -.0525, -.0932, .0248, .0964, -.1209, -.0323, -.1667}));
  for (int i = 0; i < 300; ++i) {
    double const a = i % 3 == 0 ? 1 : i % 3 == 1 ? 0.3 : 3, p = i % 2 ? 0.01 : 0.1;
    std::vector<double> k;
    for (int j = 0; j < 8; ++j) k.push_back(within(j == 2 || j == 3 ? p : a));
    lenses.push_back(i % 7 == 0 ? gsp::fisheye_lens({0.3 * k[0], 0.3 * k[1], k[2], k[3]}) : gsp::opencv_lens(k));
  }
  int poles = 0, bends = 0, endless = 0;
  for (auto const& lens : lenses) {
    if (lens.valid < 1e-3) continue;
    double const most = std::min(lens.valid, 50.);
    (std::isinf(lens.valid) ? endless : gsp::detail::radial_lens(lens, lens.valid * lens.valid).s > 1e6 ? poles : bends) += 1;
    for (int i = 1; i <= 50; ++i)
      for (int j = 0; j < 12; ++j) {
        double const r = 0.98 * most * i / 50, turn = 6.2832 * (j + (i % 2 ? 0 : 0.3)) / 12, x = r * std::cos(turn), y = r * std::sin(turn);
        auto const at = gsp::distorted(lens, x, y);
        gsp::LensPoint<double> ray;
        CAPTURE(x / lens.valid);
        CAPTURE(y / lens.valid);
        REQUIRE(gsp::undistorted(lens, at.x, at.y, ray));
        // some tens of roundings, of the place and of the ray, by the least eigenvalue of J
        auto const J = gsp::distortion_slope(lens, x, y);
        double const middle = 0.5 * (J.xx + J.yy), aside = std::hypot(0.5 * (J.xx - J.yy), J.xy);
        REQUIRE(std::hypot(ray.x - x, ray.y - y) < 1e-14 * (std::hypot(at.x, at.y) + r * (middle + aside)) / (middle - aside));
      }
  }
  MESSAGE(poles, " lenses with poles, ", bends, " with bends, ", endless, " without end");
  CHECK(poles > 20);
  CHECK(bends > 20);
  CHECK(endless > 10);
}

// x_d = x (1 - 0.5 r^2) is a picture of radius 0.544 about the middle, of rays within 0.816.
TEST_CASE_TEMPLATE("where no ray comes there is no normal, and limits hold all rays of the picture", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const width = 60, height = 40;
  auto const lens = gsp::opencv_lens({-0.5, 0, 0, 0});
  std::vector<float> const view{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, K{50, 0, 20, 0, 50, 16, 0, 0, 1};
  auto const ray_of = [&](double column, double row, gsp::LensPoint<double>& ray) {
    return gsp::undistorted(lens, (column - 20) / 50, (row - 16) / 50, ray);
  };
  gsp::LensPoint<double> ray;
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> const depth("depth", 1, height, width);
  Kokkos::View<float****, Kokkos::LayoutRight, Mem> const normals("normals", 1, height, width, 3);
  Kokkos::deep_copy(depth, 2.f);
  gsp::normals_of_depth(exec, depth, gsp::make_cameras(exec, view, K, {}, {lens}), normals);
  exec.fence();
  auto const is = on_host(normals);
  int none = 0, some = 0;
  for (int y = 1; y + 1 < height; ++y)
    for (int x = 1; x + 1 < width; ++x) {
      bool all = true;
      for (int k = -1; k <= 1; k += 2) all &= ray_of(x + k + 0.5, y + 0.5, ray) && ray_of(x + 0.5, y + k + 0.5, ray);
      (all ? some : none) += 1;
      REQUIRE(std::abs(is(0, y, x, 2) - (all ? -1 : 0)) < 1e-5);
    }
  CHECK(none > 200);
  CHECK(some > 1000);
  // of pictures whose corners alone are beyond, and of this one
  for (double const f : {50., 60., 70., 90., 120.}) {
    gsp::detail::ImageView v{};
    v.fx = v.fy = float(f), v.cx = 30, v.cy = 20;
    CHECK(gsp::detail::look_through(lens, width, height, v));
    for (int y = 0; y <= height; ++y)
      for (int x = 0; x <= width; ++x)
        if (gsp::undistorted(lens, (x - 30) / f, (y - 20) / f, ray)) {
          REQUIRE(std::abs(ray.x) + 0.15 * width / f < std::min(-v.x_low, v.x_high) + 1e-5);
          REQUIRE(std::abs(ray.y) + 0.15 * height / f < std::min(-v.y_low, v.y_high) + 1e-5);
        }
  }
}

TEST_CASE("the disc ends where the derivative is no longer positive definite") {
  CHECK(gsp::opencv_lens({0, 0, 0, 0}).valid == infinity);
  CHECK(gsp::opencv_lens({0.2, 0.05, 0, 0}).valid == infinity);
  CHECK(gsp::fisheye_lens({0, 0, 0, 0}).valid == infinity);
  // d(r - a r^3)/dr = 0
  CHECK(gsp::opencv_lens({-0.3, 0, 0, 0}).valid == doctest::Approx(std::sqrt(1 / 0.9)).epsilon(1e-12));
  // a pole: 1 - r^2 = 0, before it all grows
  CHECK(gsp::opencv_lens({0, 0, 0, 0, 0, -1, 0, 0}).valid == doctest::Approx(1).epsilon(1e-12));
  // 1 - 3 a^2 / 2 = 0, at the angle a
  CHECK(gsp::fisheye_lens({-0.5, 0, 0, 0}).valid == doctest::Approx(std::tan(std::sqrt(2 / 3.))).epsilon(1e-12));
  // along the axis to which it leans 1 - 6 p r = 0, or sooner aside: by eigenvalues round the circle
  for (auto const& c : {opencv({0, 0, 0.01, 0.02}), opencv({-0.1, 0, 0.02, -0.015}), opencv({0.3, -0.05, -0.03, 0.01})})
    for (double const share : {0.999, 1.001}) {
      double least = infinity;
      for (int i = 0; i < 20000; ++i) {
        double const turn = i * 3.14159265358979 / 10000, r = share * c.lens.valid;
        auto const j = gsp_reference::slope_of(c.bend, r * std::cos(turn), r * std::sin(turn));
        least = std::min(least, 0.5 * (j[0] + j[3] - std::hypot(j[0] - j[3], 2 * j[1])));
      }
      CHECK((least > 0) == (share < 1));
    }
}

TEST_CASE("a lens's bounds hold, and are near") {
  for (auto const& c : cases())
    for (int ring = 1; ring < gsp::Lens::rings; ++ring) {
      double const r1 = std::min(std::tan(ring * 3.14159265358979 / 128), c.lens.valid);
      double stretch = 1, reach = 1, grows = infinity;
      for (int i = 1; i <= 40; ++i)
        for (int k = 0; k < 24; ++k) {
          double const r = r1 * i / 40, a = k * 0.2618, x = r * std::cos(a), y = r * std::sin(a);
          auto const j = gsp::distortion_slope(c.lens, x, y);
          double const most = 0.5 * (j.xx + j.yy + std::hypot(j.xx - j.yy, 2 * j.xy));
          stretch = std::max(stretch, most);
          // J (1 0 -x; 0 1 -y) times itself turned
          double const dx = j.xx * x + j.xy * y, dy = j.xy * x + j.yy * y, xx = j.xx * j.xx + j.xy * j.xy + dx * dx,
                       yy = j.xy * j.xy + j.yy * j.yy + dy * dy, xy = j.xy * (j.xx + j.yy) + dx * dy;
          reach = std::max(reach, std::sqrt(0.5 * (xx + yy + std::hypot(xx - yy, 2 * xy))));
          double const far = std::tan(std::atan(r1) + (std::min(std::atan(c.lens.valid), 1.57) - std::atan(r1)) * i / 40);
          auto const f = gsp::distortion_slope(c.lens, far * std::cos(a), far * std::sin(a));
          grows =
              std::min(grows, f.xx * std::cos(a) * std::cos(a) + 2 * f.xy * std::cos(a) * std::sin(a) + f.yy * std::sin(a) * std::sin(a));
        }
      CHECK(c.lens.stretch[ring] >= stretch);
      CHECK(c.lens.reach[ring] >= reach);
      if (r1 < 0.99 * c.lens.valid) CHECK(c.lens.grows[ring] <= grows);
      if (r1 < 2) CHECK(c.lens.stretch[ring] < 1.3 * stretch + 0.1);
    }
}

// The bars of tests/splat/render.cpp, for the reasons that stand there. Cameras stand in the cloud: Gaussians are near, beside and behind.
TEST_CASE_TEMPLATE("pictures through lenses are those of the plain double reference", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  auto const all = cases();
  int const images = int(all.size()), width = 150, height = 110, bodies = 3;
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(images, width, height, 1.1, 5, viewmats, Ks);
  Ks[9 * 1] *= -1;                           // image 1 is mirrored
  Ks[9 * 4] *= 0.5f, Ks[9 * 4 + 4] *= 0.5f;  // fisheyes see wide
  Ks[9 * 5] *= 0.4f, Ks[9 * 5 + 4] *= 0.4f;
  std::vector<gsp::Lens> lenses;
  for (auto const& c : all) lenses.push_back(c.lens);
  auto const set = gsp_test::random_gaussians(4000, 1, bodies, 12);
  std::vector<std::vector<gsp::Transform<double>>> places;
  auto const poses = gsp_test::random_poses<float>(exec, 2, bodies, 9, places);
  auto const cloud = gsp::make_gaussians(exec, set);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks, {}, lenses);
  auto frames = gsp::make_frames(exec, cloud, {.images = images, .width = width, .height = height, .batch = 4});
  gsp::render(exec, cloud, poses, cameras, frames);
  auto const rgb = on_host(frames.rgb);
  auto const depth = on_host(frames.depth), alpha = on_host(frames.alpha);
  for (int c = 0; c < images; ++c) {
    auto const want = gsp_reference::rasterize(set, places[std::size_t(c % 2)], &viewmats[std::size_t(16 * c)], &Ks[std::size_t(9 * c)],
                                               width, height, {}, &all[std::size_t(c)].bend);
    auto const plain =
        gsp_reference::rasterize(set, places[std::size_t(c % 2)], &viewmats[std::size_t(16 * c)], &Ks[std::size_t(9 * c)], width, height);
    int off = 0, depths = 0, depths_off = 0, left_out = 0, other = 0;
    double worst = 0;
    for (int p = 0; p < width * height; ++p) {
      int const y = p / width, x = p % width;
      left_out += want.near_stop[std::size_t(p)];
      if (want.near_stop[std::size_t(p)]) continue;
      for (int k = 0; k < 4; ++k) {
        double const is = k < 3 ? rgb(c, y, x, k) : alpha(c, y, x),
                     e = std::abs(is - (k < 3 ? want.rgb : want.alpha)[k < 3 ? 3 * p + k : p]);
        off += !(e <= 1e-4), worst = std::max(worst, e);
      }
      other += std::abs(want.alpha[std::size_t(p)] - plain.alpha[std::size_t(p)]) > 1e-2;
      if (want.alpha[std::size_t(p)] > 0.5) ++depths, depths_off += !(std::abs(depth(c, y, x) / want.depth[std::size_t(p)] - 1) <= 1e-3);
    }
    MESSAGE("lens ", c, ": beyond 1e-4 ", off, " of ", 4 * width * height, ", worst ", worst, "; depths beyond 1e-3 ", depths_off, " of ",
            depths, "; ", left_out, " left out; a pinhole's are others at ", other);
    CHECK(off <= 4 * width * height / 1000);
    CHECK(worst <= 2e-2);
    CHECK(depths > width * height / 10);
    CHECK(depths_off <= depths / 1000);
    CHECK(left_out <= 1 + width * height / 1000);
    CHECK(other > width * height / 20);
  }
}

// Cameras within a cloud whose clusters are before, beside and behind them: a splat whose box, by the double formulas, holds the centre of
// a pixel is there, whatever cluster it is of. Of large Gaussians, for which clusters are asked wide cones, and of small ones, for which
// every bound counts.
TEST_CASE_TEMPLATE("no Gaussian with a pixel is lost with its cluster", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto all = cases();
  all.push_back(opencv({0, 0, 0, 0}));
  all.push_back(opencv({-0.6, 0.1, 0.01, 0}));
  int const rounds = 6, images = int(all.size()), width = 97, height = 75, n = 24000;
  auto set = gsp_test::random_gaussians(n, 0, 1, 31);
  for (float& x : set.positions) x *= 2;
  auto const large = set.scales;
  std::vector<gsp::Lens> lenses;
  for (auto const& c : all) lenses.push_back(c.lens);
  int kept = 0, lost = 0;
  for (int round = 0; round < 2 * rounds; ++round) {
    float const most = round < rounds ? 1.f : round % 2 ? 0.05f : 0.005f;
    for (std::size_t i = 0; i < large.size(); ++i) set.scales[i] = std::min(large[i], most);
    auto const cloud = gsp::make_gaussians(exec, set);
    std::vector<float> viewmats, Ks;
    gsp_test::random_cameras(images, width, height, 0.7 * (round % rounds), 70 + round, viewmats, Ks);
    for (int c = 0; c < images; ++c)
      for (int const k : {0, 4}) Ks[std::size_t(9 * c + k)] *= std::array<float, 3>{1, 0.5f, 2}[std::size_t(round % 3)];
    auto frames = gsp::make_frames(exec, cloud, {.images = images, .width = width, .height = height, .batch = images, .visible = n});
    gsp::place_gaussians(exec, cloud, gsp::make_poses<float>(exec, 1, 1, 0), gsp::make_cameras(exec, viewmats, Ks, {}, lenses), 0, frames);
    gsp::project(exec, cloud, frames);
    exec.fence();
    auto const visible = on_host(frames.wave.visible);
    auto const origins = on_host(frames.wave.origins);
    std::vector<char> seen(std::size_t(images) * n, 0);
    for (std::int64_t i = 0; i < visible(); ++i) seen[std::size_t(origins(i).image) * n + origins(i).source] = 1;
    auto const views = on_host(frames.wave.image_views);
    for (int c = 0; c < images; ++c) {
      float const *v = &viewmats[std::size_t(16 * c)], *K = &Ks[std::size_t(9 * c)];
      auto const& bend = all[std::size_t(c)].bend;
      for (int i = 0; i < n; ++i) {
        double p[3];
        for (int r = 0; r < 3; ++r)
          p[r] = double(v[4 * r]) * set.positions[3 * i] + double(v[4 * r + 1]) * set.positions[3 * i + 1] +
                 double(v[4 * r + 2]) * set.positions[3 * i + 2] + v[4 * r + 3];
        double const x = p[0] / p[2], y = p[1] / p[2], far = std::hypot(x, y);
        if (float(p[2]) < 0.01f || set.opacities[i] < 1. / 255 || !(far < bend.valid * (1 - 1e-6))) continue;
        double sx = std::clamp(x, double(views(c).x_low), double(views(c).x_high)),
               sy = std::clamp(y, double(views(c).y_low), double(views(c).y_high));
        double const inward = std::min(1., bend.valid / std::hypot(sx, sy));
        sx *= inward, sy *= inward;
        auto const j = gsp_reference::slope_of(bend, sx, sy);
        auto const R = gsp::to_matrix(
            gsp::normalized(gsp::Quat<double>{set.quats[4 * i], set.quats[4 * i + 1], set.quats[4 * i + 2], set.quats[4 * i + 3]}));
        double xx = 0.3, yy = 0.3;
        for (int k = 0; k < 3; ++k) {
          auto const a = double(set.scales[3 * i + k]) * gsp::column(R, k);
          double e[3];
          for (int r = 0; r < 3; ++r) e[r] = v[4 * r] * a.x + v[4 * r + 1] * a.y + v[4 * r + 2] * a.z;
          double const ax = (e[0] - sx * e[2]) / p[2], ay = (e[1] - sy * e[2]) / p[2];
          xx += std::pow(K[0] * (j[0] * ax + j[1] * ay), 2), yy += std::pow(K[4] * (j[2] * ax + j[3] * ay), 2);
        }
        auto const at = bend.map(x, y);
        double const u = K[0] * at[0] + K[2], w = K[4] * at[1] + K[5], cut = 2 * std::log(255. * set.opacities[i]),
                     ex = std::sqrt(cut * xx), ey = std::sqrt(cut * yy);
        bool const touches = u + ex > 0.5 && u - ex < width - 0.5 && w + ey > 0.5 && w - ey < height - 0.5;
        kept += seen[std::size_t(c) * n + i];
        lost += touches && !seen[std::size_t(c) * n + i];
      }
    }
  }
  MESSAGE(kept, " splats, ", lost, " lost");
  CHECK(lost == 0);
  CHECK(kept > 2 * rounds * images * n / 20);
}

// A lens without distortion is a pinhole: every operation behind it is exact. And a lens is one of each image alone.
TEST_CASE_TEMPLATE("a lens that does nothing leaves the bits, in any batch", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const images = 3, width = 120, height = 80;
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(images, width, height, 1.2, 5, viewmats, Ks);
  auto const cloud = gsp::make_gaussians(exec, gsp_test::random_gaussians(4000, 2, 1, 3));
  auto const poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto const drawn = [&](std::vector<gsp::Lens> const& lenses, int batch) {
    auto frames = gsp::make_frames(exec, cloud, {.images = images, .width = width, .height = height, .batch = batch});
    gsp::IdChannel<Mem> const id{{}, Kokkos::View<int***, Kokkos::LayoutRight, Mem>("id", images, height, width)};
    gsp::render(exec, cloud, poses, gsp::make_cameras(exec, viewmats, Ks, {}, lenses), frames, {}, id);
    auto const rgb = on_host(frames.rgb);
    auto const depth = on_host(frames.depth), alpha = on_host(frames.alpha);
    auto const ids = on_host(id.image);
    std::vector<float> out(rgb.data(), rgb.data() + rgb.size());
    out.insert(out.end(), depth.data(), depth.data() + depth.size());
    out.insert(out.end(), alpha.data(), alpha.data() + alpha.size());
    for (std::size_t i = 0; i < ids.size(); ++i) out.push_back(float(ids.data()[i]));
    return out;
  };
  auto const same = [](std::vector<float> const& a, std::vector<float> const& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
  };
  auto const none = gsp::opencv_lens({0, 0, 0, 0, 0, 0, 0, 0}), barrel = cases()[0].lens;
  auto const plain = drawn({}, 0);
  CHECK(same(plain, drawn({none}, 0)));
  auto const mixed = drawn({none, barrel, none}, 0);
  CHECK(same(mixed, drawn({none, barrel, none}, 1)));
  std::size_t const one = std::size_t(3) * width * height;
  CHECK(std::memcmp(mixed.data(), plain.data(), one * sizeof(float)) == 0);
  CHECK(std::memcmp(mixed.data() + one, plain.data() + one, one * sizeof(float)) != 0);
  CHECK(std::memcmp(mixed.data() + 2 * one, plain.data() + 2 * one, one * sizeof(float)) == 0);
}

// One wide Gaussian aside, drawn: its light is symmetric about the pixel of its mean along the axes of the covariance of the differences.
TEST_CASE_TEMPLATE("a Gaussian's middle and its ellipse are those of the full mapping", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const c = cases()[0];
  gsp::GaussianSet set;
  set.positions = {0.9f, -0.5f, 2.f};
  set.quats = {1, 0, 0, 0};
  set.scales = {0.04f, 0.02f, 0.08f};
  set.opacities = {0.9f};
  set.sh = {1, 1, 1};
  set.body = {0};
  int const width = 200, height = 150;
  std::vector<float> const view{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, K{160, 0, 95, 0, 150, 80, 0, 0, 1};
  auto const cloud = gsp::make_gaussians(exec, set);
  auto frames = gsp::make_frames(exec, cloud, {.images = 1, .width = width, .height = height});
  // example-begin lens
  auto const lens =
      gsp::opencv_lens({-0.28, 0.09, 0.001, -0.0005, -0.012});        // k1 k2 p1 p2 k3; of a fisheye: fisheye_lens({k1, k2, k3, k4})
  auto const cameras = gsp::make_cameras(exec, view, K, {}, {lens});  // {}: image c shows world c % worlds
  // example-end lens
  gsp::render(exec, cloud, gsp::make_poses<float>(exec, 1, 1, 0), cameras, frames, {.blur = 0});
  // the derivative of X, Y, Z -> pixel by differences of the whole
  auto const pixel = [&](double X, double Y, double Z) -> std::array<double, 2> {
    auto const at = c.bend.map(X / Z, Y / Z);
    return {160 * at[0] + 95, 150 * at[1] + 80};
  };
  double const X[3] = {double(0.9f), -0.5, 2}, S[3] = {double(0.04f), double(0.02f), double(0.08f)};
  double J[2][3], covariance[3] = {0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    double a[3] = {X[0], X[1], X[2]}, b[3] = {X[0], X[1], X[2]};
    a[k] += 1e-5, b[k] -= 1e-5;
    auto const high = pixel(a[0], a[1], a[2]), low = pixel(b[0], b[1], b[2]);
    for (int r = 0; r < 2; ++r) J[r][k] = (high[std::size_t(r)] - low[std::size_t(r)]) / 2e-5;
    covariance[0] += J[0][k] * S[k] * J[0][k] * S[k];
    covariance[1] += J[0][k] * S[k] * J[1][k] * S[k];
    covariance[2] += J[1][k] * S[k] * J[1][k] * S[k];
  }
  auto const middle = pixel(X[0], X[1], X[2]);
  double const det = covariance[0] * covariance[2] - covariance[1] * covariance[1];
  auto const alpha = on_host(frames.alpha);
  int lit = 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double const dx = x + 0.5 - middle[0], dy = y + 0.5 - middle[1];
      double const want = 0.9 * std::exp(-0.5 * (covariance[2] * dx * dx - 2 * covariance[1] * dx * dy + covariance[0] * dy * dy) / det);
      if (std::abs(want - 1. / 255) < 1e-6) continue;
      lit += want > 1. / 255;
      REQUIRE(std::abs(alpha(0, y, x) - (want < 1. / 255 ? 0 : want)) < 1e-5);  // float: 10 roundings of an exponent up to 5
    }
  CHECK(lit > 100);
}

// Before the camera's plane by a centimetre, and so in a pinhole of a size without bounds: a fisheye sees it at its distance. An ellipse
// beside the picture, and the same of the full mapping where the picture is wide enough.
TEST_CASE_TEMPLATE("what stands beside a fisheye's camera is as large as its distance says", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const lens = gsp::fisheye_lens({0.05, 0.01, 0, 0});
  auto const map = gsp_reference::fisheye_map({0.05, 0.01, 0, 0});
  int const width = 200, height = 150;
  std::vector<float> const view{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  for (float const z : {0.011f, 0.2f}) {
    gsp::GaussianSet set;
    set.positions = {1.5f, 0, z};
    set.quats = {1, 0, 0, 0};
    set.scales = {0.2f, 0.2f, 0.2f};
    set.opacities = {0.9f};
    set.sh = {1, 1, 1};
    set.body = {0};
    auto const cloud = gsp::make_gaussians(exec, set);
    for (float const f : {40.f, 160.f}) {
      std::vector<float> const K{f, 0, 100, 0, f, 75, 0, 0, 1};
      auto frames = gsp::make_frames(exec, cloud, {.images = 1, .width = width, .height = height});
      gsp::render(exec, cloud, gsp::make_poses<float>(exec, 1, 1, 0), gsp::make_cameras(exec, view, K, {}, {lens}), frames, {.blur = 0});
      // round it is: along the radius d(x_d)/da times the angle that a metre is there, across it x_d over the distance to the axis
      double const x = 1.5 / double(z), a = std::atan(x), slope = 1 + 3 * 0.05 * a * a + 5 * 0.01 * a * a * a * a,
                   radial = f * slope * double(0.2f) / std::hypot(1.5, double(z)), middle = f * map(x, 0)[0] + 100,
                   across = f * map(x, 0)[0] / 1.5 * double(0.2f);
      auto const alpha = on_host(frames.alpha);
      int lit = 0;
      for (int py = 0; py < height; ++py)
        for (int px = 0; px < width; ++px) {
          double const dx = (px + 0.5 - middle) / radial, dy = (py + 0.5 - 75) / across, want = 0.9 * std::exp(-0.5 * (dx * dx + dy * dy));
          if (std::abs(want - 1. / 255) < 1e-4) continue;
          lit += want > 1. / 255;
          // of the derivative along the radius, 1 / (1 + r^2), there is left what a / r cancels to: float's rounding, of two numbers, times
          // r; twice that of its square, in an exponent up to 5.5
          REQUIRE(std::abs(alpha(0, py, px) - (want < 1. / 255 ? 0 : want)) < 1e-5 + 5.5 * 6e-8 * 4 * x);
        }
      CHECK((lit > 100) == (f < 100));
    }
  }
}

// A wall before the camera: rays by the reference's own way back, depth n . p = h in closed form; normals of the wall, medians in it.
TEST_CASE_TEMPLATE("medians and normals follow the rays of a lens", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec = gsp_test::other_instance(Exec{});
  auto const all = cases();
  int const images = int(all.size()), width = 40, height = 30;
  // discs without thickness in the plane n . p = 2, close together
  gsp::Vec3<double> const n = gsp::normalized(gsp::Vec3<double>{0.3, -0.2, 1});
  auto const side = gsp::normalized(gsp::cross(n, gsp::Vec3<double>{0, 1, 0})), other = gsp::cross(n, side);
  auto const turn = gsp::normalized(gsp::Quat<double>{1 + n.z, -n.y, n.x, 0});  // z to n
  gsp::GaussianSet set;
  for (int i = -60; i <= 60; ++i)
    for (int j = -60; j <= 60; ++j) {
      auto const p = 2. * n + 0.05 * double(i) * side + 0.05 * double(j) * other;
      for (int k = 0; k < 3; ++k) set.positions.push_back(float(p[k])), set.sh.push_back(0);
      for (double const q : {turn.w, turn.x, turn.y, turn.z}) set.quats.push_back(float(q));
      for (float const s : {0.06f, 0.06f, 0.f}) set.scales.push_back(s);
      set.opacities.push_back(0.95f);
      set.body.push_back(0);
    }
  std::vector<float> viewmats, Ks;
  std::vector<gsp::Lens> lenses;
  for (int c = 0; c < images; ++c) {
    for (int k = 0; k < 16; ++k) viewmats.push_back(k % 5 == 0);
    for (float const k : {30.f, 0.f, 19.f, 0.f, 31.f, 16.f, 0.f, 0.f, 1.f}) Ks.push_back(k);
    lenses.push_back(all[std::size_t(c)].lens);
  }
  auto const cloud = gsp::make_gaussians(exec, set);
  auto cameras = gsp::make_cameras(exec, viewmats, Ks, {}, lenses);
  auto frames = gsp::make_frames(exec, cloud, {.images = images, .width = width, .height = height});
  gsp::MedianDepthChannel<Mem> const median{Kokkos::View<float***, Kokkos::LayoutRight, Mem>("median", images, height, width)};
  // with hardly a blur, which discs of a pixel's size would see
  gsp::render(exec, cloud, gsp::make_poses<float>(exec, 1, 1, 0), cameras, frames, {.blur = 1e-6f}, median);
  Kokkos::View<float****, Kokkos::LayoutRight, Mem> const normals("normals", images, height, width, 3);
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> const exact("exact", images, height, width);
  auto const depth = on_host(median.image), closed = on_host(exact);
  int met = 0;
  for (int c = 0; c < images; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        double a = 0, b = 0;
        REQUIRE(gsp_reference::ray_of(all[std::size_t(c)].bend, (x + 0.5 - 19) / 30, (y + 0.5 - 16) / 31, a, b));
        double const z = 2 / gsp::dot(n, gsp::Vec3<double>{a, b, 1});
        closed(c, y, x) = float(z);
        if (depth(c, y, x) == 0) continue;
        ++met;
        REQUIRE(std::abs(depth(c, y, x) / z - 1) < 1e-4);  // tests/splat/median_depth.cpp's, of float; discs are a millionth thick
      }
  CHECK(met > images * width * height * 9 / 10);
  Kokkos::deep_copy(exact, closed);
  gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::normals_of_depth(exec, exact, cameras, normals); }));
  auto const is = on_host(normals);
  for (int c = 0; c < images; ++c)
    for (int y = 1; y + 1 < height; ++y)
      for (int x = 1; x + 1 < width; ++x)
        for (int k = 0; k < 3; ++k) REQUIRE(std::abs(is(c, y, x, k) + n[k]) < 3e-5);  // as in tests/splat/normals.cpp
  auto const few =
      gsp::make_cameras(exec, std::vector<float>(viewmats.begin(), viewmats.begin() + 16), {Ks.begin(), Ks.begin() + 9}, {}, {lenses[0]});
  cameras.lenses = few.lenses;
  CHECK_THROWS_WITH_AS(gsp::normals_of_depth(exec, exact, cameras, normals), doctest::Contains("1 lenses for 6 cameras"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::render(exec, cloud, gsp::make_poses<float>(exec, 1, 1, 0), cameras, frames),
                       doctest::Contains("1 lenses for 6 cameras"), std::invalid_argument);
}

// A small Gaussian alone, whose place in the picture is the blur's: z of S with the ball that a pixel is there, by the reference's slope.
TEST_CASE_TEMPLATE("a median's blur is as wide as the lens's pixels", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  gsp_test::Random random(17);
  int const width = 80, height = 60;
  double const f = 30, blur = 0.3;
  std::vector<float> const view{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, K{30, 0, 40, 0, 30, 30, 0, 0, 1};
  auto frames = gsp::Frames<Mem>{};
  gsp::MedianDepthChannel<Mem> const median{Kokkos::View<float***, Kokkos::LayoutRight, Mem>("median", 1, height, width)};
  for (auto const& c : cases()) {
    int of_lens = 0;
    for (int round = 0; round < 40; ++round) {
      gsp::Vec3<double> mu{0, 0, 1};
      bool const there = gsp_reference::ray_of(c.bend, random.uniform(-40, 40) / f, random.uniform(-30, 30) / f, mu.x, mu.y);
      if (!there || gsp::norm(mu) > 5) continue;
      mu = 1.5 * mu;
      auto const q = gsp::normalized(gsp::Quat<double>{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1), 0.2});
      gsp::GaussianSet set;
      for (int k = 0; k < 3; ++k) set.positions.push_back(float(mu[k])), set.sh.push_back(0);
      for (double const k : {q.w, q.x, q.y, q.z}) set.quats.push_back(float(k));
      set.scales = {0.02f, 0.004f, 0.001f};
      set.opacities = {0.99f};
      set.body = {0};
      auto const cloud = gsp::make_gaussians(exec, set);
      if (frames.width == 0) frames = gsp::make_frames(exec, cloud, {.images = 1, .width = width, .height = height});
      gsp::render(exec, cloud, gsp::make_poses<float>(exec, 1, 1, 0), gsp::make_cameras(exec, view, K, {}, {c.lens}), frames,
                  {.blur = float(blur)}, median);
      auto const j = gsp_reference::slope_of(c.bend, mu.x / mu.z, mu.y / mu.z);
      double const ball = blur * mu.z * mu.z * mu.z / (gsp::norm(mu) * f * f * (j[0] * j[3] - j[1] * j[2]));
      auto const R = gsp::to_matrix(q);
      auto const depth = on_host(median.image);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
          if (depth(0, y, x) == 0) continue;
          gsp::Vec3<double> d{0, 0, 1};
          REQUIRE(gsp_reference::ray_of(c.bend, (x + 0.5 - 40) / f, (y + 0.5 - 30) / f, d.x, d.y));
          double above = 0, below = 0;
          for (int k = 0; k < 3; ++k) {
            auto const axis = gsp::column(R, k);
            double const s2 = std::pow(double(set.scales[std::size_t(k)]), 2) + ball;
            above += gsp::dot(axis, mu) * gsp::dot(axis, d) / s2, below += gsp::dot(axis, d) * gsp::dot(axis, d) / s2;
          }
          ++of_lens;
          REQUIRE(std::abs(depth(0, y, x) / (above / below) - 1) < 1e-5);  // two sums of nine products in float: 2 x 9 x 6e-8, ten times
        }
    }
    CHECK(of_lens > 20);
  }
}

// x_d = x (1 - r^2) comes back to the axis at r = 1: what stands at r = 0.95 would be drawn at 0.09 without the disc, whose radius is
// 0.577.
TEST_CASE_TEMPLATE("nothing is drawn from where a lens leads back", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  gsp::GaussianSet set;
  for (float const x : {0.3f, 0.95f}) {
    for (float const p : {x, 0.f, 1.f}) set.positions.push_back(p);
    for (float const q : {1.f, 0.f, 0.f, 0.f}) set.quats.push_back(q);
    for (int k = 0; k < 3; ++k) set.scales.push_back(0.02f), set.sh.push_back(1);
    set.opacities.push_back(0.9f);
    set.body.push_back(0);
  }
  auto const cloud = gsp::make_gaussians(exec, set);
  std::vector<float> const view{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, K{60, 0, 30, 0, 60, 20, 0, 0, 1};
  auto const poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto frames = gsp::make_frames(exec, cloud, {.images = 1, .width = 60, .height = 40});
  gsp::render(exec, cloud, poses, gsp::make_cameras(exec, view, K, {}, {gsp::opencv_lens({-1, 0, 0, 0})}), frames);
  auto const alpha = on_host(frames.alpha);
  CHECK(alpha(0, 19, 30 + 16) > 0.5);  // 60 * 0.3 * 0.91
  CHECK(alpha(0, 19, 30 + 5) == 0);    // 60 * 0.95 * 0.0975
}

TEST_CASE("what is no lens is refused in a sentence") {
  double const nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH_AS(gsp::opencv_lens({0.1, 0, 0, nan}), doctest::Contains("coefficient 3 is not finite"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::fisheye_lens({infinity, 0, 0, 0}), doctest::Contains("coefficient 0 is not finite"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::opencv_lens(std::vector<double>(12)), doctest::Contains("12 coefficients: give 4, 5 or 8"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::fisheye_lens({0.1}), doctest::Contains("1 coefficients: give 4"), std::invalid_argument);
  Kokkos::Serial const exec;
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(2, 64, 48, 2, 4, viewmats, Ks);
  CHECK_THROWS_WITH_AS(gsp::make_cameras(exec, viewmats, Ks, {}, std::vector<gsp::Lens>(3)), doctest::Contains("one lens a camera"),
                       std::invalid_argument);
  auto const cloud = gsp::make_gaussians(exec, gsp_test::random_gaussians(20, 0, 1, 2));
  auto const poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto frames = gsp::make_frames(exec, cloud, {.images = 2, .width = 64, .height = 48});
  auto const good = gsp::opencv_lens({-0.2, 0, 0, 0});
  // 58 pixels of focal length: it comes back at 0.058 x 2/3 x 58 = 2 pixels from the middle
  for (auto const& bad : {gsp::opencv_lens({-100, 0, 0, 0}), gsp::Lens{}})
    CHECK_THROWS_WITH_AS(gsp::render(exec, cloud, poses, gsp::make_cameras(exec, viewmats, Ks, {}, {good, bad}), frames),
                         doctest::Contains("camera 1 has a lens that leads back in the middle of the picture"), std::invalid_argument);
  CHECK_NOTHROW(gsp::render(exec, cloud, poses, gsp::make_cameras(exec, viewmats, Ks, {}, {good}), frames));
}
