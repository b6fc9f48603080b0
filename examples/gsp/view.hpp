#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "files.hpp"

namespace gsp_cli {

/// A number in [-1, 1] for (world, item).
inline double scatter(int world, int item) {
  std::uint32_t h = static_cast<std::uint32_t>(world) * 0x9e3779b1u + static_cast<std::uint32_t>(item) * 0x85ebca77u + 1u;
  h ^= h >> 15;
  h *= 0x2c1b3c6du;
  h ^= h >> 12;
  h *= 0x297a2d39u;
  h ^= h >> 15;
  return h * (2. / 4294967296.) - 1;
}

/// World to camera, looking from `eye` at `target`, z up; pinhole with a horizontal field of view [rad].
inline void add_camera(CameraFile& cameras, std::array<double, 3> const& eye, std::array<double, 3> const& target, double view, int width,
                       int height) {
  auto const unit = [](std::array<double, 3> v) {
    double const n = std::hypot(v[0], v[1], v[2]);
    return std::array<double, 3>{v[0] / n, v[1] / n, v[2] / n};
  };
  auto const z = unit({target[0] - eye[0], target[1] - eye[1], target[2] - eye[2]});
  auto const x = unit({z[1], -z[0], 0});  // z cross up
  std::array<double, 3> const y{z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]};
  for (auto const& row : {x, y, z}) {
    for (double v : row) cameras.viewmats.push_back(static_cast<float>(v));
    cameras.viewmats.push_back(static_cast<float>(-(row[0] * eye[0] + row[1] * eye[1] + row[2] * eye[2])));
  }
  for (float v : {0.f, 0.f, 0.f, 1.f}) cameras.viewmats.push_back(v);
  ++cameras.count;
  float const f = static_cast<float>(0.5 * width / std::tan(0.5 * view));
  for (float v : {f, 0.f, 0.5f * static_cast<float>(width), 0.f, f, 0.5f * static_cast<float>(height), 0.f, 0.f, 1.f})
    cameras.Ks.push_back(v);
}

/// Where camera `w` stands in the sample room: on a ring that clears the furniture, no two alike.
inline std::array<double, 3> eye_in_room(int w) {
  double turn = std::remainder(-0.9 + 2.399963 * w, 2 * std::numbers::pi);  // golden angle
  if (turn > 1.7 && turn < 2.95) turn -= 1.3;                               // the plant at the window, the chairs
  double const reach = 1 + 0.08 * scatter(w, 78);
  return {1.95 * reach * std::cos(turn), 1.65 * reach * std::sin(turn), 1.12 + 0.2 * scatter(w, 79)};
}

}  // namespace gsp_cli
