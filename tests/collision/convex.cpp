// The convex routine against closed forms, against separating axes, and against what follows from supports alone: a depth is the overlap
// along its normal, and no direction overlaps by less. GSP_PLACEMENTS=1000000: as many random overlaps (default 20,000).
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <gsp/collision/shape_distance.hpp>
#include <set>

#include "convex_shapes.hpp"

using namespace gsp_test;

namespace {
using D = Vec3<double>;
constexpr ShapeType types[] = {ShapeType::sphere,   ShapeType::capsule, ShapeType::ellipsoid,
                               ShapeType::cylinder, ShapeType::box,     ShapeType::mesh};

int placements() {
  char const* const text = std::getenv("GSP_PLACEMENTS");
  return text ? std::atoi(text) : 20000;
}
Shape<double> still(D p, D size, Quat<double> q = {1, 0, 0, 0}) { return make_shape(Transform<double>{p, q}, size); }

/// The least overlap of two polyhedra over all normals of faces and all cross products of edges.
double separating_axes(std::vector<D> const& a, std::vector<D> const& b, std::vector<D> const& normals, std::vector<D> const& edges_a,
                       std::vector<D> const& edges_b, D& n) {
  double least = 1e300;
  auto const attempt = [&](D d) {
    double const length = norm(d);
    if (length < 1e-9) return;
    d = (1 / length) * d;
    double a_low = 1e300, a_high = -1e300, b_low = 1e300, b_high = -1e300;
    for (auto const& p : a) {
      a_low = std::min(a_low, dot(d, p));
      a_high = std::max(a_high, dot(d, p));
    }
    for (auto const& p : b) {
      b_low = std::min(b_low, dot(d, p));
      b_high = std::max(b_high, dot(d, p));
    }
    if (a_high - b_low < least) {
      least = a_high - b_low;
      n = d;
    }
    if (b_high - a_low < least) {
      least = b_high - a_low;
      n = -d;
    }
  };
  for (auto const& d : normals) attempt(d);
  for (auto const& d : edges_a)
    for (auto const& e : edges_b) attempt(cross(d, e));
  return least;
}
}  // namespace

TEST_CASE("triangles of a hull become faces, and edges of its vertices") {
  auto const cube = prism(4, std::sqrt(2.), 1);
  Hull<double> const box(cube.points, cube.triangles);
  REQUIRE(box.asset.face_count == 6);
  for (int f = 0; f < 6; ++f) {
    CHECK(box.faces.first[f + 1] - box.faces.first[f] == 4);
    D const n = box.normals[f];
    CHECK(std::abs(std::abs(n.x) + std::abs(n.y) + std::abs(n.z) - 1) < 1e-6);  // vertices are floats
    for (int k = 0; k < 4; ++k) {
      auto const corner = [&](int i) { return box.vertices[box.faces.corners[box.faces.first[f] + i % 4]]; };
      CHECK(std::abs(dot(n, corner(k)) - 1) < 1e-6);
      CHECK(dot(n, cross(corner(k + 1) - corner(k), corner(k + 2) - corner(k + 1))) > 3);  // counter-clockwise
    }
  }
  auto const round = prism(20, 1, 0.5);
  Hull<double> const drum(round.points, round.triangles);
  CHECK(drum.asset.face_count == 22);
  int most = 0;
  for (int f = 0; f < 22; ++f) most = std::max(most, drum.faces.first[f + 1] - drum.faces.first[f]);
  CHECK(most == 8);  // of the 20 corners of a cap
  // uphill along edges finds the farthest vertex from any start
  auto const many = ball(20, 30, 0.3, 0.2, 0.4);
  Hull<double> const pebble(many.points, many.triangles);
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    D const d = random.direction();
    int at = int(random.engine() % pebble.hull.size());
    double most_along = -1;
    for (auto const& v : pebble.vertices) most_along = std::max(most_along, dot(d, v));
    CHECK(dot(d, detail::hull_support(pebble.asset, d, at)) > most_along - 1e-8);  // vertices are rounded to floats
  }
}

TEST_CASE("the convex routine equals the closed forms") {
  Random random(2);
  using S = ShapeType;
  double worst = 0, worst_normal = 0, worst_pos = 0, worst_axis = 0;
  int touching = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    D const p{0.4 * random(), 0.4 * random(), 0.4 * random()};
    D const size{0.3 + 0.1 * random(), 0.3 + 0.1 * random(), 0.3 + 0.1 * random()};
    D const other{0.2 + 0.1 * random(), 0.2 + 0.1 * random(), 0.2 + 0.1 * random()};
    auto const a = still(p, other, random.turn()), b = still({0, 0, 0}, size, random.turn());
    double const margin = 0.05;
    S const pairs[][2] = {{S::sphere, S::box}, {S::sphere, S::cylinder}, {S::sphere, S::sphere}, {S::sphere, S::capsule}};
    for (auto const& pair : pairs) {
      ContactPoints<double, 8> closed;
      narrowphase(pair_kind(pair[0], pair[1]), a, b, margin, closed);
      auto const d = convex_distance(pair[0], a, pair[1], b, margin);
      CHECK(d.near == (closed.count == 1));
      if (!d.near || closed.count != 1) continue;
      ++touching;
      worst = std::max(worst, std::abs(d.dist - closed.point[0].dist));
      // a center inside a cylinder may be as near to two ways out; where it is on the axis or between, only the depth is one
      if (closed.point[0].dist + other.x < 1e-3) continue;
      worst_normal = std::max(worst_normal, norm(d.normal - closed.point[0].normal));
      worst_pos = std::max(worst_pos, norm(d.pos - closed.point[0].pos));
    }
    // a ball as an ellipsoid
    auto const ball = still(b.p, {size.x, size.x, size.x}, random.turn());
    auto const round = convex_distance(S::sphere, a, S::ellipsoid, ball, 10.);
    CHECK(std::abs(round.dist - (norm(p) - other.x - size.x)) < 1e-9);
    // segments inside a cylinder
    ContactPoints<double, 8> pierced;
    narrowphase(PairKind::capsule_cylinder, a, b, margin, pierced);
    auto const exact = convex_distance(S::capsule, a, S::cylinder, b, margin);
    if (exact.near && exact.dist < -1e-9) {
      double deepest = 0;
      for (int i = 0; i < pierced.count; ++i) deepest = std::min(deepest, pierced.point[i].dist);
      worst_axis = std::max(worst_axis, std::abs(exact.dist - deepest));
    }
  }
  CHECK(touching > 5000);
  CHECK(worst < 1e-6);         // a cylinder's bounds meet within 4e-7 of the size
  CHECK(worst_normal < 2e-5);  // apart: the distance is known to 1e-12, and the square of the normal's error with it
  CHECK(worst_pos < 2e-5);
  CHECK(worst_axis < 1e-6);
}

TEST_CASE("polyhedra equal separating axes") {
  Random random(3);
  auto const cube = prism(4, std::sqrt(2.) * 0.3, 0.2);
  auto const wedge = prism(3, 0.35, 0.3);
  Hull<double> const hull_a(cube.points, cube.triangles), hull_b(wedge.points, wedge.triangles);
  double worst = 0, worst_normal = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    auto a = still({0, 0, 0}, hull_a.size, random.turn()),
         b = still({0.4 * random(), 0.4 * random(), 0.4 * random()}, hull_b.size, random.turn());
    a.asset = &hull_a.asset;
    b.asset = &hull_b.asset;
    std::vector<D> points_a, points_b, normals, edges_a, edges_b;
    for (auto const& v : hull_a.vertices) points_a.push_back(a.p + a.R * v);
    for (auto const& v : hull_b.vertices) points_b.push_back(b.p + b.R * v);
    for (auto const& n : hull_a.normals) normals.push_back(a.R * n);
    for (auto const& n : hull_b.normals) normals.push_back(b.R * n);
    auto const edges = [](Hull<double> const& h, std::vector<D> const& at, std::vector<D>& out) {
      for (int v = 0; v < int(at.size()); ++v)
        for (int k = h.faces.neighbor_first[v]; k < h.faces.neighbor_first[v + 1]; ++k)
          if (h.faces.neighbors[k] > v) out.push_back(at[h.faces.neighbors[k]] - at[v]);
    };
    edges(hull_a, points_a, edges_a);
    edges(hull_b, points_b, edges_b);
    D n{};
    double const depth = separating_axes(points_a, points_b, normals, edges_a, edges_b, n);
    auto const d = convex_distance(ShapeType::mesh, a, ShapeType::mesh, b, 0.);
    CHECK(d.near == (depth > 0));
    if (!d.near || depth < 1e-9) continue;
    worst = std::max(worst, std::abs(d.dist + depth));
    if (norm(d.normal - n) > 1e-6)
      CHECK(std::abs(overlap(ShapeType::mesh, a, ShapeType::mesh, b, n) + d.dist) < 1e-8);  // as good
    else
      worst_normal = std::max(worst_normal, norm(d.normal - n));
  }
  CHECK(worst < 1e-7);  // faces' normals are of vertices that are floats
}

TEST_CASE_TEMPLATE("no overlap is missed, nothing is not a number, and no direction is better", T, float, double) {
  Random random(4);
  auto const small = prism(5, 0.3, 0.2), many = ball(8, 12, 0.3, 0.2, 0.25);
  Hull<double> const few_d(small.points, small.triangles), many_d(many.points, many.triangles);
  Hull<T> const few(small.points, small.triangles), round(many.points, many.triangles);
  double const allowed = sizeof(T) == 4 ? 4e-6 : 1e-6;  // of sizes below 1; in float supports themselves are rounded to 1e-7
  long missed = 0, bad = 0, better = 0, wrong = 0, repeated = 0;
  double worst = 0;
  int const n = placements();
  for (int trial = 0; trial < n; ++trial) {
    ShapeType const ta = types[random.engine() % 6], tb = types[random.engine() % 6];
    if (ta > tb) continue;
    bool const extreme = trial % 4 == 0;  // needles, sheets and lattices
    auto const any = [&](ShapeType t, bool small_one) {
      auto s = still({0, 0, 0}, {0, 0, 0}, extreme && trial % 8 == 0 ? Quat<double>{1, 0, 0, 0} : random.turn());
      for (int i = 0; i < 3; ++i) s.size[i] = extreme ? std::pow(10., -1 - std::abs(random() + random())) : 0.25 + 0.15 * random();
      if (t == ShapeType::mesh) s.size = small_one ? few_d.size : many_d.size;
      if (t == ShapeType::mesh) s.asset = small_one ? &few_d.asset : &many_d.asset;
      return s;
    };
    bool const few_a = random() > 0, few_b = random() > 0;
    auto a = any(ta, few_a), b = any(tb, few_b);
    // a point inside of each, in one place
    auto const inner = [&](ShapeType t, Shape<double> const& s) {
      D const x = support(t, ShapeData<double>{s.size, s.asset}, random.direction()),
              y = support(t, ShapeData<double>{s.size, s.asset}, random.direction());
      double const w = 0.5 + 0.5 * random();
      return s.R * (0.99 * (w * x + (1 - w) * y));
    };
    b.p = inner(ta, a) - inner(tb, b);
    Shape<T> const fa = cast<T>(a, ta == ShapeType::mesh ? (few_a ? &few.asset : &round.asset) : nullptr);
    Shape<T> const fb = cast<T>(b, tb == ShapeType::mesh ? (few_b ? &few.asset : &round.asset) : nullptr);
    auto const d = convex_distance(ta, fa, tb, fb, T(0.01));
    missed += !d.near;
    if (!d.near) continue;
    D const normal{d.normal.x, d.normal.y, d.normal.z};
    bad += !(std::isfinite(d.dist + d.pos.x + d.pos.y + d.pos.z) && std::abs(norm(normal) - 1) < 1e-5);
    double const along = overlap(ta, fa, tb, fb, normal);
    wrong += !(std::abs(along + d.dist) < allowed);
    double least = 1e30;
    for (int k = 0; k < 8; ++k) least = std::min(least, overlap(ta, fa, tb, fb, random.direction()));
    for (int k = 0; k < 3; ++k) {
      least = std::min({least, overlap(ta, fa, tb, fb, column(a.R, k)), overlap(ta, fa, tb, fb, -column(a.R, k))});
      least = std::min({least, overlap(ta, fa, tb, fb, column(b.R, k)), overlap(ta, fa, tb, fb, -column(b.R, k))});
    }
    worst = std::max(worst, along - least);
    better += !(along < least + allowed);
    ContactPoints<T, 16> out;
    convex_convex(ta, fa, tb, fb, T(0.01), out);
    std::set<int> features;
    for (int i = 0; i < std::min(out.count, 16); ++i) {
      auto const& p = out.point[i];
      bad += !std::isfinite(p.dist + p.pos.x + p.pos.y + p.pos.z);
      wrong += !(p.dist >= d.dist && p.dist <= T(0.01));
      repeated += !features.insert(p.feature).second || p.feature < 0;
    }
    bad += out.count < 1 || out.count > 4;
  }
  CAPTURE(worst);
  CHECK(missed == 0);
  CHECK(bad == 0);
  CHECK(wrong == 0);
  CHECK(better == 0);
  CHECK(repeated == 0);
}

TEST_CASE("patches by hand") {
  auto const cube = prism(4, std::sqrt(2.), 1);
  Hull<double> const hull(cube.points, cube.triangles);
  auto mesh = still({0, 0, 1.95}, hull.size);
  mesh.asset = &hull.asset;
  using S = ShapeType;
  auto const box = still({0.2, 0, 0}, {1, 1, 1});
  ContactPoints<double, 8> out;
  convex_convex(S::box, box, S::mesh, mesh, 0., out);  // face on face, shifted: the corners of the common rectangle
  REQUIRE(out.count == 4);
  double x[2] = {1e9, -1e9}, y[2] = {1e9, -1e9};
  for (int i = 0; i < 4; ++i) {
    auto const& p = out.point[i];
    CHECK(std::abs(p.dist + 0.05) < 1e-6);
    CHECK(std::abs(p.pos.z - 0.975) < 1e-6);
    CHECK(norm(p.normal - D{0, 0, 1}) < 1e-6);
    x[0] = std::min(x[0], p.pos.x), x[1] = std::max(x[1], p.pos.x), y[0] = std::min(y[0], p.pos.y), y[1] = std::max(y[1], p.pos.y);
  }
  CHECK(std::abs(x[0] + 0.8) + std::abs(x[1] - 1) + std::abs(y[0] + 1) + std::abs(y[1] - 1) < 1e-6);

  out = {};  // a standing cylinder: four points of its rim, far apart
  convex_convex(S::cylinder, still({0.1, 0, 1.45}, {0.3, 0.5, 0}), S::box, still({0, 0, 0}, {1, 1, 1}), 0., out);
  REQUIRE(out.count == 4);
  for (int i = 0; i < 4; ++i) {
    CHECK(std::abs(out.point[i].dist + 0.05) < 1e-12);
    CHECK(std::abs(std::hypot(out.point[i].pos.x - 0.1, out.point[i].pos.y) - 0.3) < 1e-12);
    CHECK(out.point[i].normal.z == -1);
    for (int j = 0; j < i; ++j) CHECK(norm(out.point[i].pos - out.point[j].pos) > 0.22);
  }
  out = {};  // lying: the ends of its line, or where the box ends
  convex_convex(S::cylinder, still({0.7, 0, 1.25}, {0.3, 0.5, 0}, axis_angle(D{0, 1, 0}, 1.5707963267948966)), S::box,
                still({0, 0, 0}, {1, 1, 1}), 0., out);
  REQUIRE(out.count == 2);
  CHECK(std::abs(std::min(out.point[0].pos.x, out.point[1].pos.x) - 0.2) < 1e-9);
  CHECK(std::abs(std::max(out.point[0].pos.x, out.point[1].pos.x) - 1) < 1e-9);
  out = {};  // two cylinders side by side: the common stretch, twice
  convex_convex(S::cylinder, still({0, 0, 0}, {0.3, 0.5, 0}), S::cylinder, still({0.55, 0, 0.4}, {0.3, 0.5, 0}), 0., out);
  REQUIRE(out.count == 2);
  for (int i = 0; i < 2; ++i) {
    CHECK(std::abs(out.point[i].dist + 0.05) < 1e-6);
    CHECK(norm(out.point[i].normal - D{1, 0, 0}) < 1e-3);
  }
  CHECK(std::abs(std::abs(out.point[0].pos.z - out.point[1].pos.z) - 0.6) < 1e-6);
  out = {};  // a capsule lying on a mesh
  convex_convex(S::capsule, still({0, 0, 3.1}, {0.2, 0.5, 0}, axis_angle(D{0, 1, 0}, 1.5707963267948966)), S::mesh, mesh, 0., out);
  REQUIRE(out.count == 2);
  CHECK(std::abs(std::abs(out.point[0].pos.x - out.point[1].pos.x) - 1) < 1e-6);
  for (int i = 0; i < 2; ++i) CHECK(std::abs(out.point[i].dist + 0.05) < 1e-6);
  out = {};  // an edge of one on an edge of the other
  convex_convex(
      S::box, still({0, 0, 0}, {1, 1, 1}, axis_angle(D{1, 0, 0}, 0.7853981633974483)), S::mesh,
      [&] {
        auto s = still({0, 0, 2 * std::sqrt(2.) - 0.1}, hull.size, axis_angle(D{0, 1, 0}, 0.7853981633974483));
        s.asset = &hull.asset;
        return s;
      }(),
      0., out);
  REQUIRE(out.count == 1);
  CHECK(norm(out.point[0].pos - D{0, 0, std::sqrt(2.) - 0.05}) < 1e-6);
  CHECK(std::abs(out.point[0].dist + 0.1) < 1e-6);
}

// A plane takes each vertex of a mesh once: rounding makes an area of a vertex and itself, which counted as a corner that spans more.
TEST_CASE_TEMPLATE("a mesh lies on a plane on distinct vertices", T, float, double) {
  Random random(11);
  for (int sides : {3, 4, 5}) {
    auto const solid = prism(sides, 0.08, 0.05);
    Hull<T> const hull(solid.points, solid.triangles);
    for (double margin : {0., 0.002, 0.04})
      for (int trial = 0; trial < 500; ++trial) {
        auto mesh = cast<T>(
            make_shape(Transform<double>{{0.4 * random(), 0.4 * random(), 0.05 * (1 + random())}, random.turn()}, {0.08, 0.08, 0.05}),
            &hull.asset);
        ContactPoints<T, 4> out;
        plane_mesh(cast<T>(still({0, 0, 0}, {0, 0, 1})), mesh, T(margin), out);
        int within = 0;  // by more than rounding
        for (auto const& v : hull.vertices) within += (mesh.p + mesh.R * v).z <= T(margin) - T(1e-6) ? 1 : 0;
        CAPTURE(sides);
        CAPTURE(margin);
        CAPTURE(trial);
        CHECK(out.count >= (within < 3 ? within : 3));
        for (int i = 0; i < out.count; ++i)
          for (int j = 0; j < i; ++j) CHECK(norm(out.point[i].pos - out.point[j].pos) > T(0.04));
      }
  }
}

// Closed forms, in both orders; curved pairs to the root of the tolerance (collision/shape_distance.hpp). All pairs at random places:
// tests/oracle/convex.cpp.
TEST_CASE_TEMPLATE("distances of shapes, and their points, in closed form", T, float, double) {
  using S = ShapeType;
  using V = Vec3<T>;
  double const tight = sizeof(T) == 4 ? 3e-6 : 1e-12, loose = sizeof(T) == 4 ? 3e-3 : 3e-6;
  Quat<T> const none = identity_quat<T>(), along_x = axis_angle(V{T(0), T(1), T(0)}, T(1.5707963267948966));
  auto const put = [](V p, V size, Quat<T> q) { return make_shape(Transform<T>{p, q}, size); };
  auto const check = [&](S ta, Shape<T> const& a, S tb, Shape<T> const& b, double dist, V from, V to, double rough) {
    auto const d = shape_distance(ta, a, tb, b, T(10)), turned = shape_distance(tb, b, ta, a, T(10));
    CHECK(d.near);
    CHECK(std::abs(double(d.dist) - dist) < tight);
    CHECK(double(norm(d.from - from) + norm(d.to - to)) < rough);
    CHECK(std::abs(double(turned.dist) - dist) < tight);
    CHECK(double(norm(turned.to - from) + norm(turned.from - to)) < rough);
    CHECK(shape_distance(ta, a, tb, b, T(dist + 1e-4)).near);
    auto const far = shape_distance(ta, a, tb, b, T(dist - 1e-4));
    CHECK(!far.near);
    CHECK(far.dist == T(dist - 1e-4));
    CHECK(double(norm(far.from) + norm(far.to)) == 0);
  };
  V const origin{};
  auto const box = put(origin, {T(1), T(1), T(1)}, none);
  check(S::box, box, S::box, put({T(3), T(3), T(3)}, {T(1), T(1), T(1)}, none), std::sqrt(3.), {T(1), T(1), T(1)}, {T(2), T(2), T(2)},
        tight);
  // two cylinders across each other; an ellipsoid's tip, and beside its middle
  check(S::cylinder, put(origin, {T(0.3), T(1), T(0)}, none), S::cylinder, put({T(0), T(1), T(0)}, {T(0.3), T(1), T(0)}, along_x), 0.4,
        {T(0), T(0.3), T(0)}, {T(0), T(0.7), T(0)}, loose);
  check(S::sphere, put({T(0), T(0), T(2)}, {T(0.5), T(0), T(0)}, none), S::ellipsoid, put(origin, {T(1), T(0.5), T(0.75)}, none), 0.75,
        {T(0), T(0), T(1.5)}, {T(0), T(0), T(0.75)}, loose);
  // a capsule that pierces a box leaves it through the nearest face; planes; a box that stands has one of its corners
  auto const capsule = put({T(0), T(0), T(0.3)}, {T(0.1), T(2), T(0)}, along_x);
  auto const pierced = shape_distance(S::capsule, capsule, S::box, box, T(0));
  CHECK(std::abs(double(pierced.dist) + 0.8) < tight);
  CHECK(std::abs(double(pierced.to.z) - 1) < tight);
  CHECK(std::abs(double(pierced.from.z) - 0.2) < tight);
  auto const plane = put({T(0), T(0), T(-3)}, origin, none);
  check(S::plane, plane, S::box, box, 2, {T(-1), T(-1), T(-3)}, {T(-1), T(-1), T(-1)}, tight);
  T const end = shape_distance(S::plane, plane, S::capsule, capsule, T(10)).to.x < T(0) ? T(-2) : T(2);  // either, as rounding has it
  check(S::plane, plane, S::capsule, capsule, 3.2, {end, T(0), T(-3)}, {end, T(0), T(0.2)}, tight);
  // what has no distance, and what is nowhere
  CHECK(!shape_distance(S::plane, plane, S::plane, plane, T(1)).near);
  CHECK(!shape_distance(S::hfield, box, S::box, box, T(1)).near);
  for (S const other : {S::plane, S::sphere, S::capsule, S::ellipsoid, S::cylinder, S::box})
    CHECK(!shape_distance(S::box, put({T(NAN), T(0), T(0)}, {T(1), T(1), T(1)}, none), other, box, T(1)).near);
}

TEST_CASE("the distance of two shapes, as docs/collision/shape_distance.md has it") {
  // example-begin shape_distance
  gsp::Shape<double> const ball = gsp::make_shape(gsp::Transform<double>{{0, 0, 1}, {1, 0, 0, 0}}, gsp::Vec3<double>{0.25, 0, 0});
  gsp::Shape<double> const box = gsp::make_shape(gsp::Transform<double>{{0, 0, 0}, {1, 0, 0, 0}}, gsp::Vec3<double>{0.5, 0.5, 0.5});
  auto const d = gsp::shape_distance(gsp::ShapeType::sphere, ball, gsp::ShapeType::box, box, 2.);  // 2 m: what is farther is not seen
  // d.dist is 0.25, d.from (0, 0, 0.75) on the ball, d.to (0, 0, 0.5) on the box
  // example-end shape_distance
  CHECK(d.near);
  CHECK(d.dist == 0.25);
  CHECK(d.from.z == 0.75);
  CHECK(d.to.z == 0.5);
}

TEST_CASE("features stay while shapes rock a little") {
  auto const drum = prism(12, 0.3, 0.2);
  Hull<double> const hull(drum.points, drum.triangles);
  Random random(5);
  std::set<int> seen;
  for (int i = 0; i < 200; ++i) {
    auto s = still({0.001 * random(), 0.001 * random(), 0.199}, hull.size,
                   normalized(Quat<double>{1, 1e-4 * random(), 1e-4 * random(), 1e-3 * random()}));
    s.asset = &hull.asset;
    ContactPoints<double, 8> out;
    convex_convex(ShapeType::box, still({0, 0, -1}, {1, 1, 1}), ShapeType::mesh, s, 0., out);
    CHECK(out.count == 4);
    for (int k = 0; k < out.count; ++k) seen.insert(out.point[k].feature);
  }
  CHECK(seen.size() <= 9);  // eight corners of its lower face, which has twelve, and the deepest point where that is another
}

TEST_CASE("parallel capsules push straight however they are shifted, and pierced cylinders give way by the least") {
  for (double shift : {0., 0.01, 0.05, 0.1, 0.2, 0.5, 0.99}) {
    ContactPoints<double, 8> out;
    capsule_capsule(still({0, 0, 0}, {0.1, 0.5, 0}), still({0.19, 0, shift}, {0.1, 0.5, 0}), 0., out);
    CAPTURE(shift);
    REQUIRE(out.count == 2);
    for (int i = 0; i < 2; ++i) {
      CHECK(norm(out.point[i].normal - D{1, 0, 0}) < 1e-15);
      CHECK(std::abs(out.point[i].dist + 0.01) < 1e-15);
    }
    CHECK(std::abs(std::abs(out.point[0].pos.z - out.point[1].pos.z) - (1 - shift)) < 1e-15);
    CHECK(out.point[0].feature != out.point[1].feature);
  }
  ContactPoints<double, 8> out;  // end to end: one
  capsule_capsule(still({0, 0, 0}, {0.1, 0.5, 0}), still({0, 0, 1.15}, {0.1, 0.5, 0}), 0., out);
  REQUIRE(out.count == 1);
  CHECK(norm(out.point[0].normal - D{0, 0, 1}) < 1e-15);
  // Nearly parallel ones that lie (profile stable): two points, the deeper one at most 1e-4 of the radii above the closest points, and not
  // below them; both move as the capsules do: 1e-7 rad or less by less than 1e-3 of their length (their places turn with 1e3 a radian).
  Random random(6);
  for (int trial = 0; trial < 3000; ++trial) {
    Quat<double> const turn = normalized(Quat<double>{1, 0.02 * random(), 0.02 * random() * random() * random(), 0.1 * random()});
    Vec3<double> const p{0.19 + 0.005 * random(), 0.02 * random(), 0.8 * random()};
    auto const bar = still({0, 0, 0}, {0.1, 0.5, 0}), near = still(p, {0.1, 0.5, 0}, turn);
    auto const nearer = still(p, {0.1, 0.5, 0}, normalized(turn * Quat<double>{1, 1e-7 * random(), 1e-7 * random(), 0}));
    ContactPoints<double, 8> closest, lying, moved;
    capsule_capsule(bar, near, 1., closest);
    capsule_capsule(bar, near, 1., lying, true);
    capsule_capsule(bar, nearer, 1., moved, true);
    REQUIRE(lying.count == 2);
    REQUIRE(moved.count == 2);
    double const above =
        std::fmin(lying.point[0].dist, lying.point[1].dist) - std::fmin(closest.point[0].dist, closest.point[closest.count - 1].dist);
    CHECK(above > -1e-15);
    CHECK(above < 1.01e-4 * 0.2);
    CHECK(lying.point[0].feature == 1);
    CHECK(lying.point[1].feature == 2);
    for (int i = 0; i < 2; ++i) {
      CHECK(norm(lying.point[i].pos - moved.point[i].pos) < 1e-3);
      CHECK(std::abs(lying.point[i].dist - moved.point[i].dist) < 1e-6);
    }
  }
  // a flat cylinder pierced near its rim, steeply: out across the rim, not along the axis or the whole radius
  double most = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    auto const b = still({0, 0, 0}, {0.3, 0.1, 0});
    auto const a = still({0.25 * random(), 0.25 * random(), 0.08 * random()}, {0.05, 0.6, 0}, random.turn());
    ContactPoints<double, 8> points;
    capsule_cylinder(a, b, 0., points);
    auto const exact = convex_distance(ShapeType::capsule, a, ShapeType::cylinder, b, 0.);
    REQUIRE(points.count > 0);
    double deepest = 0;
    for (int i = 0; i < points.count; ++i) deepest = std::min(deepest, points.point[i].dist);
    most = std::max(most, std::abs(exact.dist - deepest));
  }
  CHECK(most < 1e-6);
}
