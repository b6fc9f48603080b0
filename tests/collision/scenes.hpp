#pragma once
// Scenes for the collision tests: free bodies of every covered shape over a floor, and random poses for them.
#include <gsp/collision/contacts.hpp>
#include <gsp/model/compile.hpp>
#include <random>
#include <vector>

namespace gsp_test {
using namespace gsp;

inline GeomDescription geom(ShapeType type, Double3 size) {
  GeomDescription g;
  g.type = type, g.size = size;
  return g;
}
inline Double4 random_quat(std::mt19937& random) {
  std::normal_distribution<double> normal;
  Quat<double> const q = normalized(Quat<double>{normal(random), normal(random), normal(random), normal(random)});
  return {q.w, q.x, q.y, q.z};
}

/// `n` free bodies over a floor plane and beside a static box; body k carries one or two of the shapes. Cylinders leave boxes and cylinders
/// alone.
inline CompiledModel heap(int n, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.05, 0.2);
  Description d;
  auto floor = geom(ShapeType::plane, {0, 0, 1});
  auto wall = geom(ShapeType::box, {0.1, 2, 0.5});
  wall.pos = {-1, 0, 0.5}, wall.friction = {0.4, 0.005, 0.0001};
  floor.contype = floor.conaffinity = wall.contype = wall.conaffinity = 3;
  wall.conaffinity = wall.contype = 1;
  d.bodies[0].geoms = {floor, wall};
  ShapeType const types[] = {ShapeType::sphere, ShapeType::capsule, ShapeType::box, ShapeType::cylinder};
  for (int k = 0; k < n; ++k) {
    BodyDescription b;
    b.name = "body" + std::to_string(k), b.parent = 0, b.pos = {0, 0, 1};
    JointDescription j;
    j.name = "free" + std::to_string(k), j.type = JointType::free;
    b.joints = {j};
    for (int i = 0; i < 1 + k % 2; ++i) {
      auto g = geom(types[(k + i) % 4], {uniform(random), uniform(random), uniform(random)});
      g.pos = {0.1 * i, 0, 0.05 * i}, g.quat = random_quat(random);
      if (k % 5 == 0) g.margin = 0.02, g.gap = 0.01;
      g.friction[0] = k % 3 ? 0.8 : 0.3;
      // bit 0: spheres, capsules, boxes and what they meet; cylinders (bit 1) meet the floor, spheres and capsules
      if (g.type == ShapeType::cylinder) g.contype = 2, g.conaffinity = 0;
      if (g.type == ShapeType::sphere || g.type == ShapeType::capsule) g.contype = 1, g.conaffinity = 3;
      if (g.type == ShapeType::box) g.contype = 1, g.conaffinity = 1;
      b.geoms.push_back(g);
    }
    d.bodies.push_back(b);
  }
  return compile(d);
}

/// Random poses of all bodies of `worlds` worlds (world, body, 7), the same for every precision and backend: above the floor, those fixed
/// to the world at the origin; or `anywhere`, whatever the body.
inline std::vector<double> random_poses(CompiledModel const& m, int worlds, double spread, unsigned seed = 2, bool anywhere = false) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<double> poses(std::size_t(worlds) * m.nbody * 7, 0);
  for (int w = 0; w < worlds; ++w)
    for (int b = 0; b < m.nbody; ++b) {
      double* p = &poses[(std::size_t(w) * m.nbody + b) * 7];
      p[3] = 1;
      if (anywhere ? b == 0 : m.body_tree[b] < 0) continue;
      for (int i = 0; i < 3; ++i) p[i] = spread * uniform(random);
      if (!anywhere) p[2] = 0.1 + 0.5 * std::abs(p[2]);
      auto const q = random_quat(random);
      for (int i = 0; i < 4; ++i) p[3 + i] = q[i];
    }
  return poses;
}

template <class R, class Exec>
auto upload_poses(Exec const& exec, CompiledModel const& m, std::vector<double> const& from, int first, int worlds) {
  auto poses = make_poses<R>(exec, worlds, m.nbody, m.njnt);
  auto const x = Kokkos::create_mirror_view(Kokkos::HostSpace{}, poses.xpos);
  auto const q = Kokkos::create_mirror_view(Kokkos::HostSpace{}, poses.xquat);
  for (int w = 0; w < worlds; ++w)
    for (int b = 0; b < m.nbody; ++b) {
      double const* p = &from[(std::size_t(first + w) * m.nbody + b) * 7];
      for (int i = 0; i < 3; ++i) x(w, b, i) = R(p[i]);
      for (int i = 0; i < 4; ++i) q(w, b, i) = R(p[3 + i]);
    }
  Kokkos::deep_copy(exec, poses.xpos, x);
  Kokkos::deep_copy(exec, poses.xquat, q);
  exec.fence();
  return poses;
}

/// One contact on the host.
template <class R>
struct HostContact {
  int world, pair, geom1, geom2, body1, body2, feature;
  R pos[3], frame[9], dist, includemargin;
  bool operator==(HostContact const& o) const = default;
};
template <class R, class Mem, class Exec>
std::vector<HostContact<R>> download(Exec const& exec, Contacts<R, Mem> const& c) {
  exec.fence();
  auto const host = [](auto const& v) { return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v); };
  auto const first = host(c.first), end = host(c.end), pair = host(c.pair), geom1 = host(c.geom1), geom2 = host(c.geom2),
             body1 = host(c.body1), body2 = host(c.body2), feature = host(c.feature), world = host(c.world);
  auto const status = host(c.status);
  auto const pos = host(c.pos);
  auto const frame = host(c.frame);
  auto const dist = host(c.dist), margin = host(c.includemargin);
  std::vector<HostContact<R>> result;
  for (int w = 0; w < c.worlds; ++w)
    for (int i = first(w); i < end(w) && !(status(w) & status::contact_overflow); ++i) {
      HostContact<R> h{world(i), pair(i), geom1(i), geom2(i), body1(i), body2(i), feature(i), {}, {}, dist(i), margin(i)};
      for (int k = 0; k < 3; ++k) h.pos[k] = pos(i, k);
      for (int k = 0; k < 9; ++k) h.frame[k] = frame(i, k);
      result.push_back(h);
    }
  return result;
}

}  // namespace gsp_test
