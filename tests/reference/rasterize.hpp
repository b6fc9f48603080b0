#pragma once
// Gaussians to a picture, plainly, in double: no tiles, no packs, no bounds but the one that a pixel's alpha is at least 1/255.
// gsplat 1.5.3's forward pass as its documentation and formulas say, written for reading.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <gsp/math/quat.hpp>
#include <gsp/splat/gaussians.hpp>
#include <gsp/splat/project.hpp>
#include <numeric>
#include <vector>

namespace gsp_reference {

using V3 = gsp::Vec3<double>;

struct Picture {
  int width = 0, height = 0;
  std::vector<double> rgb, depth, alpha;  // (H, W, 3), (H, W), (H, W)
  std::vector<char>
      near_stop;  // (H, W) a factor came within 3e-6, relative (50 roundings of float), of the stop: float may decide otherwise
};

/// max(0, 1/2 + sum c_k Y_k(d)): the polynomials of degree 0-3, one by one.
inline V3 colour(gsp::GaussianSet const& s, std::size_t i, V3 const& d) {
  double const x = d.x, y = d.y, z = d.z;
  double const Y[16] = {0.28209479177387814,
                        -0.48860251190291992 * y,
                        0.48860251190291992 * z,
                        -0.48860251190291992 * x,
                        1.0925484305920792 * x * y,
                        -1.0925484305920792 * y * z,
                        0.94617469575756 * z * z - 0.31539156525252,
                        -1.0925484305920792 * x * z,
                        0.5462742152960396 * (x * x - y * y),
                        -0.5900435899266435 * y * (3 * x * x - y * y),
                        2.890611442640554 * x * y * z,
                        -0.4570457994644658 * y * (5 * z * z - 1),
                        0.3731763325901154 * z * (5 * z * z - 3),
                        -0.4570457994644658 * x * (5 * z * z - 1),
                        1.445305721320277 * z * (x * x - y * y),
                        -0.5900435899266435 * x * (x * x - 3 * y * y)};
  int const terms = (s.sh_degree + 1) * (s.sh_degree + 1);
  double c[3];
  for (int k = 0; k < 3; ++k) {
    c[k] = 0.5;
    for (int t = 0; t < terms; ++t) c[k] += s.sh[(i * terms + t) * 3 + k] * Y[t];
    c[k] = std::max(0., c[k]);
  }
  return {c[0], c[1], c[2]};
}

/// A lens as OpenCV's documentation writes it: where (x, y) of the plane z = 1 comes, and how far from the axis it is meant for.
struct Bend {
  std::function<std::array<double, 2>(double, double)> map;
  double valid;
  bool anywhere = false;  // its derivative is taken at every ray, and not within limits about the picture alone
};
inline std::function<std::array<double, 2>(double, double)> opencv_map(std::vector<double> k) {
  k.resize(8);
  return [k](double x, double y) -> std::array<double, 2> {
    double const r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
    double const radial = (1 + k[0] * r2 + k[1] * r4 + k[4] * r6) / (1 + k[5] * r2 + k[6] * r4 + k[7] * r6);
    return {x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x), y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y};
  };
}
inline std::function<std::array<double, 2>(double, double)> fisheye_map(std::vector<double> const& k) {
  return [k](double a, double b) -> std::array<double, 2> {
    double const r = std::hypot(a, b), t = std::atan(r);
    if (r == 0) return {0, 0};
    double const d = t * (1 + k[0] * std::pow(t, 2) + k[1] * std::pow(t, 4) + k[2] * std::pow(t, 6) + k[3] * std::pow(t, 8));
    return {d / r * a, d / r * b};
  };
}
/// Central differences: d(x_d, y_d)/d(x, y), row by row; their error is about 1e-10 of curvatures of 1.
inline std::array<double, 4> slope_of(Bend const& bend, double x, double y) {
  double const h = 1e-5 * (1 + std::hypot(x, y));
  auto const r = bend.map(x + h, y), l = bend.map(x - h, y), u = bend.map(x, y + h), d = bend.map(x, y - h);
  return {(r[0] - l[0]) / (2 * h), (u[0] - d[0]) / (2 * h), (r[1] - l[1]) / (2 * h), (u[1] - d[1]) / (2 * h)};
}
/// What comes to (u, v): from the axis outwards in a hundred steps of Newton's iteration, so that it stays on the branch of the axis. True
/// where it is within the lens.
inline bool ray_of(Bend const& bend, double u, double v, double& x, double& y) {
  x = y = 0;
  for (int i = 1; i <= 100; ++i)
    for (int again = 0; again < (i < 100 ? 2 : 10); ++again) {
      auto const at = bend.map(x, y);
      auto const j = slope_of(bend, x, y);
      double const ex = u * i / 100 - at[0], ey = v * i / 100 - at[1], det = j[0] * j[3] - j[1] * j[2];
      x += (j[3] * ex - j[1] * ey) / det;
      y += (j[0] * ey - j[2] * ex) / det;
      if (!(std::hypot(x, y) < bend.valid)) return false;
    }
  return true;
}

/// The picture of `set`, its bodies standing at `bodies`, before the camera `viewmat` (4 x 4), `K` (3 x 3), row-major.
inline Picture rasterize(gsp::GaussianSet const& set, std::vector<gsp::Transform<double>> const& bodies, float const* viewmat,
                         float const* K, int width, int height, gsp::RenderOptions options = {}, Bend const* bend = nullptr) {
  std::size_t const n = set.size(), pixels = static_cast<std::size_t>(width) * height;
  gsp::Mat3<double> const V{{viewmat[0], viewmat[1], viewmat[2], viewmat[4], viewmat[5], viewmat[6], viewmat[8], viewmat[9], viewmat[10]}};
  V3 const t{viewmat[3], viewmat[7], viewmat[11]}, eye = -gsp::transpose_times(V, t);
  double const fx = K[0], fy = K[4], cx = K[2], cy = K[5];
  double left = -cx / fx, right = (width - cx) / fx, top = -cy / fy, bottom = (height - cy) / fy;  // of the plane z = 1
  if (bend) {                                                                                      // corners and middles of edges
    double rays[4] = {1e9, -1e9, 1e9, -1e9};
    for (int i = 0; i < 9; ++i) {
      if (i == 4) continue;
      double const u = (i % 3 * width / 2. - cx) / fx, v = (i / 3 * height / 2. - cy) / fy;
      double x = 0, y = 0;
      if (!ray_of(*bend, u, v, x, y)) x = u / std::hypot(u, v) * bend->valid, y = v / std::hypot(u, v) * bend->valid;  // its edge
      rays[0] = std::min(rays[0], x), rays[1] = std::max(rays[1], x), rays[2] = std::min(rays[2], y), rays[3] = std::max(rays[3], y);
    }
    left = rays[0], right = rays[1], top = rays[2], bottom = rays[3];
  }
  std::vector<V3> camera(n);
  for (std::size_t i = 0; i < n; ++i)
    camera[i] = V * (bodies[set.body[i]] * V3{set.positions[3 * i], set.positions[3 * i + 1], set.positions[3 * i + 2]}) + t;
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);  // by depth as a float, as the sort key is; equal ones by index
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return float(camera[a].z) < float(camera[b].z); });

  Picture out{
      width, height, std::vector<double>(3 * pixels), std::vector<double>(pixels), std::vector<double>(pixels), std::vector<char>(pixels)};
  std::vector<double> T(pixels, 1.);
  std::vector<char> done(pixels, 0);
  for (int i : order) {
    auto const [x, y, z] = camera[i];
    double const opacity = set.opacities[i];
    if (float(z) < options.near || float(z) > options.far || opacity < 1. / 255) continue;
    auto const& body = bodies[set.body[i]];
    // covariance in camera axes
    auto const R = gsp::to_matrix(
        gsp::normalized(gsp::Quat<double>{set.quats[4 * i], set.quats[4 * i + 1], set.quats[4 * i + 2], set.quats[4 * i + 3]}));
    V3 axis[3];
    for (int k = 0; k < 3; ++k) axis[k] = double(set.scales[3 * i + k]) * (V * gsp::rotate(body.q, gsp::column(R, k)));
    double const mx = 0.3 * 0.5 * width / std::abs(fx), my = 0.3 * 0.5 * height / std::abs(fy);
    auto const within = [](double s, double a, double b, double beyond) {  // a > b of a mirror
      return std::clamp(s, std::min(a, b) - beyond, std::max(a, b) + beyond);
    };
    bool const limited = !bend || !bend->anywhere;
    double sx = limited ? within(x / z, left, right, mx) : x / z, sy = limited ? within(y / z, top, bottom, my) : y / z;
    if (double const far = std::hypot(sx, sy); bend && far > bend->valid) sx *= bend->valid / far, sy *= bend->valid / far;
    if (bend && !(std::hypot(x / z, y / z) <= bend->valid)) continue;
    auto const j = bend ? slope_of(*bend, sx, sy) : std::array<double, 4>{1, 0, 0, 1};
    auto const at = bend ? bend->map(x / z, y / z) : std::array<double, 2>{x / z, y / z};
    double xx = 0, xy = 0, yy = 0;
    for (auto const& a : axis) {
      double const ax = (a.x - sx * a.z) / z, ay = (a.y - sy * a.z) / z, jx = fx * (j[0] * ax + j[1] * ay),
                   jy = fy * (j[2] * ax + j[3] * ay);
      xx += jx * jx, xy += jx * jy, yy += jy * jy;
    }
    xx += options.blur, yy += options.blur;
    double const det = xx * yy - xy * xy, A = yy / det, B = -xy / det, C = xx / det;
    double const u = fx * at[0] + cx, v = fy * at[1] + cy, cut = std::log(255 * opacity);
    double const rx = std::sqrt(2 * cut * xx), ry = std::sqrt(2 * cut * yy);
    if (u + rx < 0 || u - rx > width || v + ry < 0 || v - ry > height) continue;
    V3 const mean = body * V3{set.positions[3 * i], set.positions[3 * i + 1], set.positions[3 * i + 2]};
    V3 const c = colour(set, static_cast<std::size_t>(i), gsp::rotate_inverse(body.q, gsp::normalized(mean - eye)));
    for (int row = std::max(0, int(std::floor(v - ry - 0.5))); row <= std::min(height - 1., std::ceil(v + ry - 0.5)); ++row)
      for (int column = std::max(0, int(std::floor(u - rx - 0.5))); column <= std::min(width - 1., std::ceil(u + rx - 0.5)); ++column) {
        std::size_t const p = static_cast<std::size_t>(row) * width + column;
        if (done[p]) continue;
        double const dx = column + 0.5 - u, dy = row + 0.5 - v;
        double const sigma = 0.5 * (A * dx * dx + C * dy * dy) + B * dx * dy;
        double const alpha = std::min(double(options.alpha_max), opacity * std::exp(-sigma));
        if (sigma < 0 || alpha < 1. / 255) continue;
        double const remains = T[p] * (1 - alpha);
        if (std::abs(remains / options.stop - 1) < 3e-6) out.near_stop[p] = 1;
        if (remains <= options.stop) {
          done[p] = 1;
          continue;
        }
        double const w = alpha * T[p];
        out.rgb[3 * p] += w * c.x, out.rgb[3 * p + 1] += w * c.y, out.rgb[3 * p + 2] += w * c.z, out.depth[p] += w * z;
        T[p] = remains;
      }
  }
  for (std::size_t p = 0; p < pixels; ++p) {
    out.alpha[p] = 1 - T[p];
    out.depth[p] /= std::max(out.alpha[p], 1e-10);
  }
  return out;
}

}  // namespace gsp_reference
