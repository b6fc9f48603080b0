#include <doctest/doctest.h>

#include <cmath>
#include <gsp/math/spatial.hpp>

#include "dynamics/random_tree.hpp"

// A rigid body as a heap of points: momentum, kinetic energy and power by sums over the points are another route to the same numbers.
// Tolerance: sums of some hundred terms below 10, each with the rounding eps: 1e-13.
namespace {
using V = gsp::Vec3<double>;
using S = gsp::Spatial<double>;
struct Heap {
  gsp_test::Random r;
  V center{r(), r(), r()};
  gsp::Quat<double> q = [this] {
    auto const a = gsp_test::random_quat(r);
    return gsp::Quat<double>{a[0], a[1], a[2], a[3]};
  }();
  double const half[3] = {0.3, 0.5, 0.2};
  // eight equal masses at the corners of a box: its principal moments are m (b^2 + c^2) ...
  double mass = 1.7;
  V principal{mass * (half[1] * half[1] + half[2] * half[2]), mass*(half[2] * half[2] + half[0] * half[0]),
              mass*(half[0] * half[0] + half[1] * half[1])};
  template <class F>
  void each(F const& f) const {
    for (int i = 0; i < 8; ++i)
      f(mass / 8, center + rotate(q, V{i & 1 ? half[0] : -half[0], i & 2 ? half[1] : -half[1], i & 4 ? half[2] : -half[2]}));
  }
};
void same(V const& a, V const& b) {
  for (int k = 0; k < 3; ++k) CHECK(std::abs(a[k] - b[k]) < 1e-13);
}
}  // namespace

TEST_CASE("momentum of a spatial inertia is that of its points") {
  Heap heap;
  auto const inertia = gsp::spatial_inertia(heap.mass, heap.principal, heap.q, heap.center);
  for (int i = 0; i < 20; ++i) {
    S const v{{heap.r(), heap.r(), heap.r()}, {heap.r(), heap.r(), heap.r()}};
    V linear{0, 0, 0}, angular{0, 0, 0};
    double energy = 0;
    heap.each([&](double m, V const& p) {
      V const u = v.linear + cross(v.angular, p);
      linear += m * u, angular += m * cross(p, u), energy += m * dot(u, u) / 2;
    });
    S const h = inertia * v;
    same(h.linear, linear), same(h.angular, angular);
    CHECK(std::abs(dot(v, h) / 2 - energy) < 1e-13);
  }
}

TEST_CASE("inertias add as their bodies do") {
  Heap a, b;
  for (int i = 0; i < 5; ++i) b.r();
  b.center = {b.r(), b.r(), b.r()};
  auto const sum = gsp::spatial_inertia(a.mass, a.principal, a.q, a.center) + gsp::spatial_inertia(b.mass, b.principal, b.q, b.center);
  S const v{{0.3, -0.7, 1.1}, {0.2, 0.5, -0.4}};
  V linear{0, 0, 0};
  for (auto const* heap : {&a, &b}) heap->each([&](double m, V const& p) { linear += m * (v.linear + cross(v.angular, p)); });
  same((sum * v).linear, linear);
}

// v x m is the rate of a motion vector that v carries along; v x* f keeps the power f . m of what both carry: (v x* f) . m + f . (v x m) =
// 0.
TEST_CASE("cross products of motions and forces") {
  gsp_test::Random r;
  for (int i = 0; i < 20; ++i) {
    auto const some = [&] { return S{{r(), r(), r()}, {r(), r(), r()}}; };
    S const v = some(), m = some(), f = some();
    CHECK(std::abs(dot(gsp::cross_force(v, f), m) + dot(f, gsp::cross_motion(v, m))) < 1e-14);
    double const e = 1e-6;
    auto const carried = [&](double t) {
      auto const q = gsp::exp_rotation(t * v.angular);
      V const w = rotate(q, m.angular);
      return S{w, rotate(q, m.linear) +
                      cross(t * v.linear, w)};  // a line through p has the linear part p x w at the origin; shifted by d, (p + d) x w
    };
    S const plus = carried(e), minus = carried(-e), rate = gsp::cross_motion(v, m);
    for (int k = 0; k < 3; ++k) {  // central differences: e^2 + eps / e = 2e-10
      CHECK(std::abs((plus.angular[k] - minus.angular[k]) / (2 * e) - rate.angular[k]) < 1e-9);
      CHECK(std::abs((plus.linear[k] - minus.linear[k]) / (2 * e) - rate.linear[k]) < 1e-9);
    }
  }
}
