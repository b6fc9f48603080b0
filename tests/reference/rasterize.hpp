#pragma once
// Gaussians to a picture, plainly, in double: no tiles, no packs, no bounds but the one that a pixel's alpha is at least 1/255.
// gsplat 1.5.3's forward pass as its documentation and formulas say, written for reading.
#include <algorithm>
#include <cmath>
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

/// The picture of `set`, its bodies standing at `bodies`, before the camera `viewmat` (4 x 4), `K` (3 x 3), row-major.
inline Picture rasterize(gsp::GaussianSet const& set, std::vector<gsp::Transform<double>> const& bodies, float const* viewmat,
                         float const* K, int width, int height, gsp::RenderOptions options = {}) {
  std::size_t const n = set.size(), pixels = static_cast<std::size_t>(width) * height;
  gsp::Mat3<double> const V{{viewmat[0], viewmat[1], viewmat[2], viewmat[4], viewmat[5], viewmat[6], viewmat[8], viewmat[9], viewmat[10]}};
  V3 const t{viewmat[3], viewmat[7], viewmat[11]}, eye = -gsp::transpose_times(V, t);
  double const fx = K[0], fy = K[4], cx = K[2], cy = K[5];
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
    double const sx = within(x / z, -cx / fx, (width - cx) / fx, mx), sy = within(y / z, -cy / fy, (height - cy) / fy, my);
    double xx = 0, xy = 0, yy = 0;
    for (auto const& a : axis) {
      double const jx = fx / z * (a.x - sx * a.z), jy = fy / z * (a.y - sy * a.z);
      xx += jx * jx, xy += jx * jy, yy += jy * jy;
    }
    xx += options.blur, yy += options.blur;
    double const det = xx * yy - xy * xy, A = yy / det, B = -xy / det, C = xx / det;
    double const u = fx * x / z + cx, v = fy * y / z + cy, cut = std::log(255 * opacity);
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
        double const left = T[p] * (1 - alpha);
        if (std::abs(left / options.stop - 1) < 3e-6) out.near_stop[p] = 1;
        if (left <= options.stop) {
          done[p] = 1;
          continue;
        }
        double const w = alpha * T[p];
        out.rgb[3 * p] += w * c.x, out.rgb[3 * p + 1] += w * c.y, out.rgb[3 * p + 2] += w * c.z, out.depth[p] += w * z;
        T[p] = left;
      }
  }
  for (std::size_t p = 0; p < pixels; ++p) {
    out.alpha[p] = 1 - T[p];
    out.depth[p] /= std::max(out.alpha[p], 1e-10);
  }
  return out;
}

}  // namespace gsp_reference
