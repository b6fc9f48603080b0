#include <doctest/doctest.h>

#include <gsp/splat/render.hpp>
#include <gsp_test_execs.hpp>
#include <map>
#include <splat/scenes.hpp>
#include <support/kokkos_tools.hpp>

namespace {

// Splats of one image by source index.
template <class Exec>
std::map<int, gsp::Splat> project_all(Exec const& exec, gsp::GaussianSet const& set, std::vector<float> const& viewmat,
                                      std::vector<float> const& K, int width, int height, gsp::RenderOptions options = {}) {
  auto const cloud = gsp::make_gaussians(exec, set);
  auto const cameras = gsp::make_cameras(exec, viewmat, K);
  auto poses = gsp::make_poses<float>(exec, 1, cloud.bodies, 0);
  auto frames = gsp::make_frames(exec, cloud, {.images = 1, .width = width, .height = height, .visible = std::max(1, cloud.count)});
  gsp::place_gaussians(exec, cloud, poses, cameras, 0, frames);
  gsp::project(exec, cloud, frames, options);
  exec.fence();
  auto const& wave = frames.wave;
  Kokkos::HostSpace const host;
  auto const splats = Kokkos::create_mirror_view_and_copy(host, wave.splats);
  auto const origins = Kokkos::create_mirror_view_and_copy(host, wave.origins);
  auto const visible = Kokkos::create_mirror_view_and_copy(host, wave.visible);
  std::map<int, gsp::Splat> out;
  for (std::int64_t i = 0; i < visible(); ++i) out[origins(i).source] = splats(i);
  return out;
}

gsp::GaussianSet round_ones(std::vector<std::array<float, 5>> const& list) {  // x y z, scale, opacity
  gsp::GaussianSet s;
  for (auto const& g : list) {
    s.positions.insert(s.positions.end(), {g[0], g[1], g[2]});
    s.quats.insert(s.quats.end(), {1, 0, 0, 0});
    s.scales.insert(s.scales.end(), {g[3], g[3], g[3]});
    s.opacities.push_back(g[4]);
    s.sh.insert(s.sh.end(), {1, 0, -2});
    s.body.push_back(0);
  }
  return s;
}

std::vector<float> const identity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, K{100, 0, 32, 0, 100, 24, 0, 0, 1};

}  // namespace

TEST_CASE_TEMPLATE("a ball on the axis has the closed form; what cannot be seen is left out", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  auto const seen = project_all(exec,
                                round_ones({{0, 0, 2, 0.1f, 0.5f},       // 0: on the axis
                                            {0, 0, 0.005f, 0.1f, 0.5f},  // 1: nearer than near
                                            {0, 0, -2, 0.1f, 0.5f},      // 2: behind
                                            {0, 0, 2, 0.1f, 0.0039f},    // 3: alpha below 1/255 everywhere
                                            {5, 0, 2, 0.1f, 0.5f},       // 4: beside the picture
                                            {0, 0, 30, 0.1f, 0.5f}}),    // 5: beyond far
                                {identity}, K, 64, 48, {.far = 20});
  REQUIRE(seen.size() == 1);
  gsp::Splat const s = seen.at(0);
  double const variance = 5 * 5 + 0.3, l = std::sqrt(0.5 / std::log(2.) / variance), e = std::sqrt(2 * std::log(127.5) * variance);
  CHECK(s.u == 32);
  CHECK(s.v == 24);
  CHECK(s.depth == 2);
  CHECK(s.power == -1);
  CHECK(s.l21 == 0);
  double const pairs[7][2] = {{s.l11, l}, {s.l22, l}, {s.xe, e}, {s.ye, e}, {s.r, 0.5 + 0.28209479177387814}, {s.g, 0.5}, {s.b, 0}};
  for (auto const& pair : pairs) CHECK(pair[0] == doctest::Approx(pair[1]).epsilon(1e-6));  // ten roundings of float
}

TEST_CASE_TEMPLATE("splats are those of the double formulas, and no Gaussian with a pixel above 1/255 is lost", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  int const width = 203, height = 117, n = 4000;
  auto const set = gsp_test::random_gaussians(n, 2, 1, 77);
  std::vector<float> viewmat, intrinsics;
  gsp_test::random_cameras(1, width, height, 0.6, 4, viewmat, intrinsics);  // inside the cloud: near, beside and behind
  auto const seen = project_all(exec, set, viewmat, intrinsics, width, height);
  gsp::Mat3<double> const V{{viewmat[0], viewmat[1], viewmat[2], viewmat[4], viewmat[5], viewmat[6], viewmat[8], viewmat[9], viewmat[10]}};
  double const fx = intrinsics[0], fy = intrinsics[4], cx = intrinsics[2], cy = intrinsics[5];
  int lost = 0, kept = 0;
  double worst = 0;
  for (int i = 0; i < n; ++i) {
    auto const p = V * gsp::Vec3<double>{set.positions[3 * i], set.positions[3 * i + 1], set.positions[3 * i + 2]} +
                   gsp::Vec3<double>{viewmat[3], viewmat[7], viewmat[11]};
    if (!(float(p.z) >= 0.01f) || set.opacities[i] < 1. / 255) {
      CHECK(seen.count(i) == 0);
      continue;
    }
    auto const R = gsp::to_matrix(
        gsp::normalized(gsp::Quat<double>{set.quats[4 * i], set.quats[4 * i + 1], set.quats[4 * i + 2], set.quats[4 * i + 3]}));
    double const mx = 0.15 * width / fx, my = 0.15 * height / fy;
    double const sx = std::clamp(p.x / p.z, -cx / fx - mx, (width - cx) / fx + mx),
                 sy = std::clamp(p.y / p.z, -cy / fy - my, (height - cy) / fy + my);
    double xx = 0.3, xy = 0, yy = 0.3;
    for (int k = 0; k < 3; ++k) {
      auto const a = double(set.scales[3 * i + k]) * (V * gsp::column(R, k));
      double const jx = fx / p.z * (a.x - sx * a.z), jy = fy / p.z * (a.y - sy * a.z);
      xx += jx * jx, xy += jx * jy, yy += jy * jy;
    }
    double const u = fx * p.x / p.z + cx, v = fy * p.y / p.z + cy, cut = 2 * std::log(255. * set.opacities[i]), ex = std::sqrt(cut * xx),
                 ey = std::sqrt(cut * yy);
    bool const touches = u + ex > 0.5 && u - ex < width - 0.5 && v + ey > 0.5 && v - ey < height - 0.5;
    auto const it = seen.find(i);
    lost += touches && it == seen.end();
    if (it == seen.end()) continue;
    ++kept;
    auto const& s = it->second;
    // the covariance that the factor stands for, compared by its entries, relative to its size; the ill-conditioned inverse is not asked
    // for
    double const h = 0.5 / std::log(2.), l11 = s.l11, l21 = s.l21, l22 = s.l22, d = l11 * l22;
    double const cxx = h * (l21 * l21 + l22 * l22) / (d * d), cxy = -h * l11 * l21 / (d * d), cyy = h / (l22 * l22), size = xx + yy;
    double const errors[] = {(cxx - xx) / size,
                             (cxy - xy) / size,
                             (cyy - yy) / size,
                             (s.u - u) / (std::abs(u) + width),
                             (s.v - v) / (std::abs(v) + height),
                             s.depth / p.z - 1,
                             (s.xe - ex) / (ex + 1),
                             (s.ye - ey) / (ey + 1)};
    for (double e : errors) worst = std::max(worst, std::abs(e));
  }
  MESSAGE(kept, " splats, worst relative error ", worst);
  CHECK(lost == 0);
  CHECK(kept > n / 20);
  CHECK(worst < 2e-5);  // float: about 30 operations, and entries of the rotation taken relative to the largest
}
