#pragma once
#include <array>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/detail/decimal.hpp>
#include <gsp/io/detail/splat_rotation.hpp>
#include <gsp/io/splat_set.hpp>
#include <gsp/io/splat_transform.hpp>
#include <numbers>

namespace gsp::io {

GSP_INLINE SplatPose parse_splat_pose(std::string_view text) {
  std::array<double, 8> v{};
  std::size_t count = 0;
  bool ok = true;
  for (std::size_t at = 0; ok && (at = text.find_first_not_of(" \t", at)) != std::string_view::npos;) {
    std::size_t const end = std::min(text.find_first_of(" \t", at), text.size());
    ok = count < 8;
    if (!ok) break;
    auto const value = detail::decimal(text.substr(at, end - at));
    ok = value && std::isfinite(*value);
    v[count++] = value.value_or(0);
    at = end;
  }
  if (!ok || count != 8 || !(v[7] > 0) || (v[3] == 0 && v[4] == 0 && v[5] == 0 && v[6] == 0))
    throw Error("pose " + detail::in_quotes(text) +
                ": must be eight numbers 'x y z qw qx qy qz scale' with a quaternion that is not 0 and a positive scale; write it so");
  return {{v[0], v[1], v[2]}, {v[3], v[4], v[5], v[6]}, v[7]};
}

GSP_INLINE std::array<std::array<double, 16>, 16> sh_rotation(std::array<double, 4> const& unit_quat) {
  auto const r = detail::rotation_matrix(unit_quat);
  std::array<double, 4> const height{-0.8611363115940526, -0.3399810435848563, 0.3399810435848563, 0.8611363115940526};
  std::array<double, 4> const weight{0.3478548451374538, 0.6521451548625461, 0.6521451548625461, 0.3478548451374538};
  std::array<std::array<double, 16>, 16> d{};
  for (int i = 0; i < 4; ++i)
    for (int m = 0; m < 7; ++m) {
      double const angle = 2 * std::numbers::pi * m / 7, radius = std::sqrt(1 - height[i] * height[i]);
      double const x = radius * std::cos(angle), y = radius * std::sin(angle), z = height[i];
      auto const from = detail::sh_basis(x, y, z);
      auto const to = detail::sh_basis(r[0] * x + r[1] * y + r[2] * z, r[3] * x + r[4] * y + r[5] * z, r[6] * x + r[7] * y + r[8] * z);
      for (int band = 0; band < 4; ++band)
        for (int j = band * band; j < (band + 1) * (band + 1); ++j)
          for (int k = band * band; k < (band + 1) * (band + 1); ++k) d[j][k] += weight[i] * 2 * std::numbers::pi / 7 * to[j] * from[k];
    }
  return d;
}

GSP_INLINE void transform(SplatSet& set, SplatPose const& pose, SplatTransformOptions options) {
  auto const& q = pose.quat;
  double const norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  expects(std::isfinite(norm) && norm > 1e-12, "gsp::io::transform: the quaternion of the pose (w x y z) must be finite and not 0");
  expects(std::isfinite(pose.scale) && pose.scale > 0, "gsp::io::transform: the scale of the pose must be positive");
  for (double p : pose.position) expects(std::isfinite(p), "gsp::io::transform: the position of the pose must be finite");
  std::array<double, 4> const u{q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm};
  auto const r = detail::rotation_matrix(u);
  auto const d = sh_rotation(u);
  std::size_t const terms = set.sh_terms();
  for (std::size_t i = 0; i < set.size(); ++i) {  // before any moves
    if (set.link[i] >= 0 && !options.links) continue;
    double const* const to = pose.position.data();
    float const* const p = &set.positions[3 * i];
    for (int k = 0; k < 3; ++k) {
      double const x = pose.scale * (r[3 * k] * p[0] + r[3 * k + 1] * p[1] + r[3 * k + 2] * p[2]) + to[k];
      if (!std::isfinite(static_cast<float>(x)) || !std::isfinite(static_cast<float>(set.scales[3 * i + k] * pose.scale)))
        expects(false, "gsp::io::transform: the pose takes Gaussian " + std::to_string(i) +
                           " beyond what a float holds: give a smaller position or scale");
    }
  }
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (set.link[i] >= 0 && !options.links) continue;
    float* const p = &set.positions[3 * i];
    double const x = p[0], y = p[1], z = p[2];
    for (int k = 0; k < 3; ++k)
      p[k] = static_cast<float>(pose.scale * (r[3 * k] * x + r[3 * k + 1] * y + r[3 * k + 2] * z) + pose.position[k]);
    for (int k = 0; k < 3; ++k) set.scales[3 * i + k] = static_cast<float>(set.scales[3 * i + k] * pose.scale);
    float* const g = &set.quats[4 * i];
    double const b[4] = {g[0], g[1], g[2], g[3]};
    g[0] = static_cast<float>(u[0] * b[0] - u[1] * b[1] - u[2] * b[2] - u[3] * b[3]);
    g[1] = static_cast<float>(u[0] * b[1] + u[1] * b[0] + u[2] * b[3] - u[3] * b[2]);
    g[2] = static_cast<float>(u[0] * b[2] - u[1] * b[3] + u[2] * b[0] + u[3] * b[1]);
    g[3] = static_cast<float>(u[0] * b[3] + u[1] * b[2] - u[2] * b[1] + u[3] * b[0]);
    for (int band = 1; band <= set.sh_degree; ++band) {
      int const first = band * band, count = 2 * band + 1;
      for (int c = 0; c < 3; ++c) {
        float* const sh = &set.sh[3 * (terms * i + first) + c];
        double old[7];
        for (int k = 0; k < count; ++k) old[k] = sh[3 * k];
        for (int j = 0; j < count; ++j) {
          double sum = 0;
          for (int k = 0; k < count; ++k) sum += d[first + j][first + k] * old[k];
          sh[3 * j] = static_cast<float>(sum);
        }
      }
    }
  }
}

}  // namespace gsp::io
