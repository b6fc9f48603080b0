#include "placement.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace gsp_cli {
namespace {

constexpr double cell = 0.05;  // [m]

/// A map of the floor seen from above: which cells have floor, which have something standing on it.
struct FloorMap {
  double x0 = 0, y0 = 0;
  int nx = 0, ny = 0;
  std::vector<float> floor, obstacle;  // (ny, nx) summed opacity
  int at(double x, double y) const {
    int const i = static_cast<int>(std::floor((x - x0) / cell)), j = static_cast<int>(std::floor((y - y0) / cell));
    return i < 0 || j < 0 || i >= nx || j >= ny ? -1 : j * nx + i;
  }
};

/// Limits of the middle 99 % along one axis.
std::array<double, 2> limits(gsp::io::SplatSet const& set, std::size_t axis) {
  std::vector<float> v;
  for (std::size_t i = 0; i < set.size(); ++i)
    if (set.link[i] < 0) v.push_back(set.positions[3 * i + axis]);
  if (v.empty()) return {0, 0};
  std::sort(v.begin(), v.end());
  return {v[v.size() / 200], v[v.size() - 1 - v.size() / 200]};
}

FloorMap map_floor(gsp::io::SplatSet const& set, double low, double high) {
  FloorMap m;
  auto const x = limits(set, 0), y = limits(set, 1);
  m.x0 = x[0];
  m.y0 = y[0];
  m.nx = std::clamp(static_cast<int>((x[1] - x[0]) / cell) + 1, 1, 4000);
  m.ny = std::clamp(static_cast<int>((y[1] - y[0]) / cell) + 1, 1, 4000);
  m.floor.assign(static_cast<std::size_t>(m.nx) * m.ny, 0);
  m.obstacle = m.floor;
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (set.link[i] >= 0) continue;
    float const *p = &set.positions[3 * i], *s = &set.scales[3 * i];
    double const size = std::max({s[0], s[1], s[2]});
    int const reach = std::min(20, static_cast<int>(size / cell));  // wide Gaussians cover cells around them
    bool const ground = std::abs(p[2])<0.06, stands = p[2]> low && p[2] < high;
    if (!ground && !stands) continue;
    for (int dy = -reach; dy <= reach; ++dy)
      for (int dx = -reach; dx <= reach; ++dx) {
        int const k = m.at(p[0] + dx * cell, p[1] + dy * cell);
        if (k >= 0) (ground ? m.floor : m.obstacle)[static_cast<std::size_t>(k)] += set.opacities[i];
      }
  }
  return m;
}

}  // namespace

gsp::io::SplatPose standing_pose(gsp::io::SplatSet const& capture) {
  gsp::io::SplatPose pose{{0, 0, 0}, {std::sqrt(0.5), -std::sqrt(0.5), 0, 0}, 1};  // (x, y, z) -> (x, z, -y)
  gsp::io::SplatSet set = capture;
  set.sh_degree = 0;
  set.sh.assign(3 * set.size(), 0.f);  // colours do not matter here
  gsp::io::transform(set, pose);
  // The floor: of all heights (steps of 1/200) the lowest with a third as much surface as the one with most in the lower half; surface:
  // opacity times the product of the two longer axes.
  auto const z = limits(set, 2);
  double const bin = std::max(1e-9, (z[1] - z[0]) / 200);
  std::vector<double> surface(100, 0.);
  for (std::size_t i = 0; i < set.size(); ++i) {
    double const k = (set.positions[3 * i + 2] - z[0]) / bin;
    float const* s = &set.scales[3 * i];
    if (set.link[i] < 0 && k >= 0 && k < 100)
      surface[static_cast<std::size_t>(k)] +=
          set.opacities[i] * double(s[0]) * s[1] * s[2] / std::max(1e-12f, std::min({s[0], s[1], s[2]}));
  }
  std::size_t k = 0;
  double const most = *std::max_element(surface.begin(), surface.end());
  while (k + 1 < surface.size() && surface[k] < most / 3) ++k;
  double const floor = z[0] + (double(k) + 0.5) * bin;
  for (std::size_t i = 0; i < set.size(); ++i) set.positions[3 * i + 2] -= static_cast<float>(floor);
  pose.position[2] = -floor;

  // The free cell that is farthest from any cell that is not (two sweeps of the chamfer distance 1, sqrt 2).
  auto const map = map_floor(set, 0.10, 1.0);
  int const w = map.nx, h = map.ny;
  std::vector<double> distance(map.floor.size());
  auto const free = [&](int i, int j) {
    std::size_t const c = static_cast<std::size_t>(j) * w + i;
    return map.floor[c] > 0.5f && map.obstacle[c] < 0.5f;
  };
  auto const get = [&](int i, int j) { return i < 0 || j < 0 || i >= w || j >= h ? 0. : distance[static_cast<std::size_t>(j) * w + i]; };
  for (int j = 0; j < h; ++j)
    for (int i = 0; i < w; ++i)
      distance[static_cast<std::size_t>(j) * w + i] =
          free(i, j) ? std::min({get(i - 1, j) + 1, get(i, j - 1) + 1, get(i - 1, j - 1) + 1.414, get(i + 1, j - 1) + 1.414}) : 0;
  std::size_t best = 0;
  for (int j = h - 1; j >= 0; --j)
    for (int i = w - 1; i >= 0; --i) {
      std::size_t const c = static_cast<std::size_t>(j) * w + i;
      distance[c] = std::min({distance[c], get(i + 1, j) + 1, get(i, j + 1) + 1, get(i + 1, j + 1) + 1.414, get(i - 1, j + 1) + 1.414});
      if (distance[c] > distance[best]) best = c;
    }
  if (distance[best] > 0) {
    pose.position[0] = -(map.x0 + (double(best % static_cast<std::size_t>(w)) + 0.5) * cell);
    pose.position[1] = -(map.y0 + (double(best / static_cast<std::size_t>(w)) + 0.5) * cell);
  } else {  // nothing like a floor: the middle of all
    auto const x = limits(set, 0), y = limits(set, 1);
    pose.position[0] = -0.5 * (x[0] + x[1]);
    pose.position[1] = -0.5 * (y[0] + y[1]);
  }
  return pose;
}

std::vector<double> clear_directions(gsp::io::SplatSet const& set, std::array<double, 3> const& center, double low, double high) {
  auto const map = map_floor(set, low, high);
  std::vector<double> reach(72);
  for (std::size_t k = 0; k < reach.size(); ++k) {
    double const a = 2 * std::numbers::pi * double(k) / double(reach.size());
    double& r = reach[k];
    for (r = 0; r < 50; r += 0.5 * cell) {
      int const c = map.at(center[0] + r * std::cos(a), center[1] + r * std::sin(a));
      if (c < 0 || map.obstacle[static_cast<std::size_t>(c)] > 0.5f) break;
    }
  }
  return reach;
}

}  // namespace gsp_cli
