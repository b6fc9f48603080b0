#include <doctest/doctest.h>

#include <algorithm>
#include <cstring>
#include <gsp/splat/median_depth.hpp>
#include <gsp/splat/render.hpp>
#include <gsp_test_execs.hpp>
#include <splat/scenes.hpp>
#include <vector>

namespace {

using V3 = gsp::Vec3<double>;

template <class View>
auto on_host(View const& v) {
  return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v);
}

struct Median {
  double depth = 0;   // 0: none
  double margin = 1;  // how near, relative, a product came to the half
};
/// All Gaussians at every pixel, sorted by where the ray through its centre meets them, in double: projection as
/// tests/reference/rasterize.hpp has it, z = mu^T S^-1 d / d^T S^-1 d, S with the blur as a ball.
std::vector<Median> medians(gsp::GaussianSet const& set, std::vector<gsp::Transform<double>> const& bodies, float const* viewmat,
                            float const* K, int width, int height) {
  gsp::RenderOptions const options;
  gsp::Mat3<double> const V{{viewmat[0], viewmat[1], viewmat[2], viewmat[4], viewmat[5], viewmat[6], viewmat[8], viewmat[9], viewmat[10]}};
  V3 const t{viewmat[3], viewmat[7], viewmat[11]};
  double const fx = K[0], fy = K[4], cx = K[2], cy = K[5];
  struct Met {
    double z;
    int source;
    double alpha;
  };
  std::vector<std::vector<Met>> met(static_cast<std::size_t>(width) * height);
  for (int i = 0; i < int(set.size()); ++i) {
    auto const& body = bodies[std::size_t(set.body[i])];
    V3 const mu = V * (body * V3{set.positions[3 * i], set.positions[3 * i + 1], set.positions[3 * i + 2]}) + t;
    double const opacity = set.opacities[i];
    if (float(mu.z) < options.near || opacity < 1. / 255) continue;
    auto const R = gsp::to_matrix(
        gsp::normalized(gsp::Quat<double>{set.quats[4 * i], set.quats[4 * i + 1], set.quats[4 * i + 2], set.quats[4 * i + 3]}));
    V3 axis[3];
    for (int k = 0; k < 3; ++k) axis[k] = V * gsp::rotate(body.q, gsp::column(R, k));
    double const mx = 0.15 * width / fx, my = 0.15 * height / fy;
    double const sx = std::clamp(mu.x / mu.z, -(cx / fx + mx), (width - cx) / fx + mx),
                 sy = std::clamp(mu.y / mu.z, -(cy / fy + my), (height - cy) / fy + my);
    double xx = options.blur, xy = 0, yy = options.blur;
    for (int k = 0; k < 3; ++k) {
      double const s = set.scales[3 * i + k], jx = s * fx / mu.z * (axis[k].x - sx * axis[k].z),
                   jy = s * fy / mu.z * (axis[k].y - sy * axis[k].z);
      xx += jx * jx, xy += jx * jy, yy += jy * jy;
    }
    double const det = xx * yy - xy * xy, u = fx * mu.x / mu.z + cx, v = fy * mu.y / mu.z + cy;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        double const dx = x + 0.5 - u, dy = y + 0.5 - v;
        double const sigma = 0.5 * (yy * dx * dx + xx * dy * dy) / det - xy * dx * dy / det;
        double const alpha = std::min(double(options.alpha_max), opacity * std::exp(-sigma));
        if (alpha < 1. / 255) continue;
        V3 const d{(x + 0.5 - cx) / fx, (y + 0.5 - cy) / fy, 1};
        double up = 0, down = 0;
        for (int k = 0; k < 3; ++k) {
          double const s = std::sqrt(double(set.scales[3 * i + k]) * set.scales[3 * i + k] +
                                     options.blur * mu.z * mu.z * mu.z / (gsp::norm(mu) * fx * fy)),
                       m = dot(axis[k], mu) / s, w = dot(axis[k], d) / s;
          up += m * w, down += w * w;
        }
        if (up / down > 0) met[std::size_t(y) * width + x].push_back({up / down, i, alpha});
      }
  }
  std::vector<Median> out(met.size());
  for (std::size_t p = 0; p < met.size(); ++p) {
    std::sort(met[p].begin(), met[p].end(), [](Met const& a, Met const& b) { return a.z < b.z || (a.z == b.z && a.source < b.source); });
    double left = 1;
    for (auto const& m : met[p]) {
      left *= 1 - m.alpha;
      out[p].margin = std::min(out[p].margin, std::abs(left / 0.5 - 1));
      if (left > 0.5 || out[p].depth > 0) continue;
      out[p].depth = m.z;
    }
  }
  return out;
}

/// Balls of haze along z, `count` of opacity 0.006 each, three and three at one place, so that a pass of eight ends among equals: (1 -
/// 0.006)^116 is the first power below 1/2.
gsp::GaussianSet haze(int count) {
  gsp::GaussianSet set;
  for (int k = 0; k < count; ++k) {
    for (float const x : {0.f, 0.f, 2 + 0.01f * float((k * 7 % count) / 3)}) set.positions.push_back(x);
    for (int c = 0; c < 3; ++c) set.scales.push_back(0.3f), set.sh.push_back(0);
    for (float const x : {1.f, 0.f, 0.f, 0.f}) set.quats.push_back(x);
    set.opacities.push_back(0.006f);
    set.body.push_back(0);
  }
  return set;
}

}  // namespace

// In float the alphas have errors of some 1e-6, so products come out at another Gaussian where one is within 1e-4 of the half: those pixels
// are left out, and counted.
TEST_CASE_TEMPLATE("median depth is where half of the light is taken, all Gaussians sorted along the ray", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const images = 3, width = 83, height = 61, bodies = 3;
  auto const set = gsp_test::random_gaussians(3000, 1, bodies, 21);
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(images, width, height, 1.2, 4, viewmats, Ks);
  std::vector<std::vector<gsp::Transform<double>>> places;
  auto const poses = gsp_test::random_poses<float>(exec, 2, bodies, 4, places);
  auto const cloud = gsp::make_gaussians(exec, set);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  auto plain = gsp::make_frames(exec, cloud, {.images = images, .width = width, .height = height, .batch = 2});
  auto frames = gsp::make_frames(exec, cloud, {.images = images, .width = width, .height = height, .batch = 2});
  gsp::MedianDepthChannel<Mem> const median{Kokkos::View<float***, Kokkos::LayoutRight, Mem>("median", images, height, width)};
  gsp::render(exec, cloud, poses, cameras, plain);
  gsp::render(exec, cloud, poses, cameras, frames, {}, median);
  auto const rgb = on_host(frames.rgb), without = on_host(plain.rgb);
  CHECK(std::memcmp(rgb.data(), without.data(), rgb.span() * sizeof(float)) == 0);
  auto const depth = on_host(median.image);
  int met = 0, doubtful = 0, wrong = 0;
  for (int c = 0; c < images; ++c) {
    auto const want = medians(set, places[std::size_t(c % 2)], &viewmats[std::size_t(16 * c)], &Ks[std::size_t(9 * c)], width, height);
    for (int p = 0; p < width * height; ++p) {
      met += want[std::size_t(p)].depth > 0;
      if (want[std::size_t(p)].margin < 1e-4) {
        ++doubtful;
        continue;
      }
      double const is = depth(c, p / width, p % width);
      wrong += !(std::abs(is - want[std::size_t(p)].depth) <= 1e-4 * want[std::size_t(p)].depth);
    }
  }
  MESSAGE(met, " of ", images * width * height, " pixels have one, ", doubtful, " left out, ", wrong, " other");
  CHECK(met > images * width * height / 10);
  CHECK(met < images * width * height);
  CHECK(doubtful < images * width * height / 100);
  CHECK(wrong <= images * width * height / 5000);  // of thin Gaussians seen along their edge, whose z float knows to 1e-3
}

TEST_CASE_TEMPLATE("however many a ray meets, none is lost, and ties go by source", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  auto const set = haze(400);
  auto const cloud = gsp::make_gaussians(exec, set);
  auto const cameras = gsp::make_cameras(exec, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, {60, 0, 8.5f, 0, 60, 8.5f, 0, 0, 1});
  auto const poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto frames = gsp::make_frames(exec, cloud, {.images = 1, .width = 17, .height = 17});
  gsp::MedianDepthChannel<Mem> const median{Kokkos::View<float***, Kokkos::LayoutRight, Mem>("median", 1, 17, 17)};
  gsp::render(exec, cloud, poses, cameras, frames, {}, median);
  auto const depth = on_host(median.image);
  CHECK(depth(0, 8, 8) == doctest::Approx(2 + 0.38).epsilon(1e-6));  // the 116th, the second of the 39th place
  auto few = haze(100);                                              // all of them leave more than half
  auto const thin = gsp::make_gaussians(exec, few);
  gsp::render(exec, thin, poses, cameras, frames, {}, median);
  CHECK(on_host(median.image)(0, 8, 8) == 0);
  gsp::GaussianSet disc = haze(1);  // without thickness, seen from the front: met in its plane
  disc.scales = {0.3f, 0.3f, 0};
  disc.opacities = {0.9f};
  gsp::render(exec, gsp::make_gaussians(exec, disc), poses, cameras, frames, {}, median);
  CHECK(on_host(median.image)(0, 8, 8) == doctest::Approx(2).epsilon(1e-6));
  for (float const size : {0.f, 1e-40f}) {  // a point, which pictures blur
    disc.scales = {size, 0, size};
    gsp::render(exec, gsp::make_gaussians(exec, disc), poses, cameras, frames, {}, median);
    CHECK(on_host(median.image)(0, 8, 8) == doctest::Approx(2).epsilon(1e-6));
  }
  gsp::MedianDepthChannel<Mem> const small{Kokkos::View<float***, Kokkos::LayoutRight, Mem>("median", 1, 17, 16)};
  CHECK_THROWS_AS(gsp::render(exec, thin, poses, cameras, frames, {}, small), std::invalid_argument);
}

// Discs of a fifth of a pixel in all directions, in a layer of two pixels' thickness: what is seen of one is at most 3.4 deviations of its
// blur, 1.9 pixels, from its centre across, and so is its depth, as blur and disc together are hardly flat.
TEST_CASE_TEMPLATE("discs that are smaller than a pixel are met where they are", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const side = 24;
  float const f = 40, z = 1, pixel = z / f;
  gsp_test::Random random(3);
  gsp::GaussianSet set;
  for (int i = 0; i < 6000; ++i) {
    for (int k = 0; k < 2; ++k) set.positions.push_back(float(random.uniform(-0.3, 0.3)));
    set.positions.push_back(z + pixel * float(random.uniform(-1, 1)));
    for (float const s : {0.2f * pixel, 0.2f * pixel, 1e-6f}) set.scales.push_back(s);
    for (int k = 0; k < 4; ++k) set.quats.push_back(float(random.uniform(-1, 1)));
    for (int c = 0; c < 3; ++c) set.sh.push_back(0);
    set.opacities.push_back(0.9f);
    set.body.push_back(0);
  }
  auto const cameras = gsp::make_cameras(exec, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, {f, 0, 12, 0, f, 12, 0, 0, 1});
  auto const poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto const cloud = gsp::make_gaussians(exec, set);
  auto frames = gsp::make_frames(exec, cloud, {.images = 1, .width = side, .height = side});
  gsp::MedianDepthChannel<Mem> const median{Kokkos::View<float***, Kokkos::LayoutRight, Mem>("median", 1, side, side)};
  gsp::render(exec, cloud, poses, cameras, frames, {}, median);
  auto const depth = on_host(median.image);
  float nearest = 2 * z, farthest = 0;
  for (int p = 2 * side + 2; p < side * side - 2 * side - 2; ++p) {
    if (p % side < 2 || p % side >= side - 2) continue;
    nearest = std::min(nearest, depth(0, p / side, p % side));
    farthest = std::max(farthest, depth(0, p / side, p % side));
  }
  MESSAGE("from ", (nearest - z) / pixel, " to ", (farthest - z) / pixel, " pixels of depth");
  CHECK(nearest > z - 3 * pixel);
  CHECK(farthest < z + 3 * pixel);
}
