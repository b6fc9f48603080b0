#pragma once
// Scenes and cameras for the tests of splat/: made by a generator with a fixed seed.
#include <cmath>
#include <gsp/model/poses.hpp>
#include <gsp/splat/cameras.hpp>
#include <gsp/splat/gaussians.hpp>
#include <random>
#include <reference/rasterize.hpp>

namespace gsp_test {

struct Random {
  std::mt19937 generator;
  explicit Random(unsigned seed) : generator(seed) {}
  double uniform(double a, double b) { return a + (b - a) * (generator() / 4294967296.); }
  gsp::Quat<double> rotation() {
    for (;;) {
      gsp::Quat<double> const q{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
      double const n = q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z;
      if (n > 0.1 && n < 1) return gsp::normalized(q);
    }
  }
};

/// n Gaussians in a box of side 2 around each body's origin: needles, discs and blobs from 1 mm to 0.5 m, opacities 0..1 (some below
/// 1/255).
inline gsp::GaussianSet random_gaussians(int n, int sh_degree, int bodies, unsigned seed) {
  Random random(seed);
  gsp::GaussianSet s;
  s.sh_degree = sh_degree;
  int const terms = (sh_degree + 1) * (sh_degree + 1);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) s.positions.push_back(float(random.uniform(-1, 1)));
    auto const q = random.rotation();
    for (double x : {q.w, q.x, q.y, q.z}) s.quats.push_back(float(x));
    for (int k = 0; k < 3; ++k) s.scales.push_back(float(std::exp(random.uniform(std::log(1e-3), std::log(i % 10 ? 0.1 : 0.5)))));
    s.opacities.push_back(float(i % 7 ? random.uniform(0, 1) : i % 2 ? 1. : 0.003));
    for (int t = 0; t < terms; ++t)
      for (int k = 0; k < 3; ++k) s.sh.push_back(float(t ? random.uniform(-.3, .3) : random.uniform(-1.5, 2.5)));
    s.body.push_back(static_cast<int>(random.uniform(0, bodies)));
  }
  return s;
}

/// Cameras around the origin that look at it from `distance`, turned at random about their axis.
inline void random_cameras(int count, int width, int height, double distance, unsigned seed, std::vector<float>& viewmats,
                           std::vector<float>& Ks) {
  Random random(seed);
  for (int c = 0; c < count; ++c) {
    auto const R = gsp::to_matrix(random.rotation());  // rows: camera axes in the world
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 3; ++k) viewmats.push_back(float(R(r, k)));
      viewmats.push_back(float(r == 2 ? distance : random.uniform(-.2, .2)));
    }
    for (float x : {0.f, 0.f, 0.f, 1.f}) viewmats.push_back(x);
    for (double x : {0.9 * width, 0., 0.47 * width, 0., 0.95 * width, 0.55 * height, 0., 0., 1.}) Ks.push_back(float(x));
  }
}

/// A camera in a y-down room, yaw about the vertical, pitch > 0 looks down.
inline void room_camera(gsp::Vec3<double> const& eye, double yaw, double pitch, std::vector<float>& viewmats) {
  gsp::Vec3<double> const forward{std::cos(yaw) * std::cos(pitch), std::sin(pitch), std::sin(yaw) * std::cos(pitch)};
  gsp::Vec3<double> const right = gsp::normalized(gsp::cross(gsp::Vec3<double>{0, 1, 0}, forward));
  gsp::Vec3<double> const axes[3] = {right, gsp::cross(forward, right), forward};
  for (auto const& a : axes) {
    double const row[4] = {a.x, a.y, a.z, -gsp::dot(a, eye)};
    for (double x : row) viewmats.push_back(static_cast<float>(x));
  }
  for (int k = 0; k < 4; ++k) viewmats.push_back(k == 3);
}

/// Poses of `worlds` worlds, body 0 at rest and the others anywhere near the origin.
template <class R, class Exec>
auto random_poses(Exec const& exec, int worlds, int bodies, unsigned seed, std::vector<std::vector<gsp::Transform<double>>>& host) {
  auto poses = gsp::make_poses<R>(exec, worlds, bodies, 0);
  exec.fence();
  auto const x = Kokkos::create_mirror_view(poses.xpos);
  auto const q = Kokkos::create_mirror_view(poses.xquat);
  Random random(seed);
  host.assign(worlds, {});
  for (int w = 0; w < worlds; ++w)
    for (int b = 0; b < bodies; ++b) {
      auto const r = b ? random.rotation() : gsp::identity_quat<double>();
      double const p[3] = {b ? random.uniform(-.7, .7) : 0, b ? random.uniform(-.7, .7) : 0, b ? random.uniform(-.7, .7) : 0};
      for (int k = 0; k < 3; ++k) x(w, b, k) = R(p[k]);
      q(w, b, 0) = R(r.w), q(w, b, 1) = R(r.x), q(w, b, 2) = R(r.y), q(w, b, 3) = R(r.z);
      // the reference stands where the views say, rounded
      host[w].push_back(
          {{double(x(w, b, 0)), double(x(w, b, 1)), double(x(w, b, 2))},
           gsp::normalized(gsp::Quat<double>{double(q(w, b, 0)), double(q(w, b, 1)), double(q(w, b, 2)), double(q(w, b, 3))})});
    }
  Kokkos::deep_copy(poses.xpos, x);
  Kokkos::deep_copy(poses.xquat, q);
  return poses;
}

}  // namespace gsp_test
