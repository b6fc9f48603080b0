// Height fields: a level one is a plane, a slope a tilted one, and the points of a rough one are those of its prisms.
#include <doctest/doctest.h>

#include <algorithm>
#include <set>

#include "convex_shapes.hpp"

using namespace gsp_test;

namespace {
using D = Vec3<double>;

struct Field {
  std::vector<double> elevation;
  ShapeAsset<double> asset;
  Field(Field const&) = delete;
  template <class F>
  Field(int rows, int columns, F const& height) {
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < columns; ++c) elevation.push_back(height(r, c));
    asset.elevation = elevation.data();
    asset.rows = rows;
    asset.columns = columns;
    asset.extent[0] = 2;
    asset.extent[1] = 1.5;
    asset.extent[2] = 0.5;
    asset.extent[3] = 0.4;
  }
  Shape<double> at(D p, Quat<double> q = {1, 0, 0, 0}) const {
    auto s = make_shape(Transform<double>{p, q}, D{2, 1.5, 0.3});
    s.asset = &asset;
    return s;
  }
};
Shape<double> still(D p, D size, Quat<double> q = {1, 0, 0, 0}) { return make_shape(Transform<double>{p, q}, size); }
double deepest(ContactPoints<double, 8> const& out) {
  double d = 1e30;
  for (int i = 0; i < out.count; ++i) d = std::min(d, out.point[i].dist);
  return d;
}
}  // namespace

TEST_CASE("a level field is a plane, wherever it stands") {
  Field const level(9, 11, [](int, int) { return 0.4; });
  Random random(1);
  ShapeType const types[] = {ShapeType::sphere, ShapeType::capsule, ShapeType::ellipsoid, ShapeType::cylinder, ShapeType::box};
  double worst = 0, worst_normal = 0;
  for (int trial = 0; trial < 500; ++trial) {
    ShapeType const type = types[trial % 5];
    Transform<double> const frame{{random(), random(), random()}, random.turn()};
    D const size{0.2 + 0.1 * random(), 0.2 + 0.1 * random(), 0.2 + 0.1 * random()};
    Quat<double> const q = random.turn();
    D const d = transpose_times(to_matrix(q), D{0, 0, -1});
    D const low = rotate(q, support(type, ShapeData<double>{size}, d));
    double const depth = 0.01 * (1 + random());  // far less than a cell is wide, and in the middle of a triangle: up is the shortest way
    double const cell[2] = {std::floor(2 * random()), std::floor(2 * random())};
    Transform<double> const local{{0.4 * (cell[0] + 1. / 3) - low.x, 0.375 * (cell[1] + 2. / 3) - low.y, 0.2 - low.z - depth}, q};
    auto const shape = make_shape(frame * local, size);
    ContactPoints<double, 8> out;
    height_field(level.at(frame.p, frame.q), type, shape, 0., out);
    REQUIRE(out.count > 0);
    REQUIRE(out.count <= 8);
    int best = 0;
    for (int i = 1; i < out.count; ++i)
      if (out.point[i].dist < out.point[best].dist) best = i;
    worst = std::max(worst, std::abs(deepest(out) + depth));
    worst_normal = std::max(worst_normal, norm(out.point[best].normal - rotate(frame.q, D{0, 0, 1})));
    std::set<int> features;
    for (int i = 0; i < out.count; ++i) features.insert(out.point[i].feature);
    CHECK(int(features.size()) == out.count);
  }
  CHECK(worst < 1e-6);         // curved shapes end within 4e-7 of the size
  CHECK(worst_normal < 2e-3);  // and their normals within its root
}

TEST_CASE("a slope, its edges, and a box that rests on it") {
  // height 0.5 x, x from -2 to 2: z = 0.25 (x + 2) / 2 ...
  Field const slope(5, 9, [](int, int c) { return c / 8.; });
  double const tan = 0.5 / 4;
  D const n = normalized(D{-tan, 0, 1});
  ContactPoints<double, 8> out;
  D const foot{0.3, 0.1, tan * 2.3};
  height_field(slope.at({0, 0, 0}), ShapeType::sphere, still(foot + 0.19 * n, {0.2, 0, 0}), 0., out);
  REQUIRE(out.count >= 1);
  int best = 0;
  for (int i = 1; i < out.count; ++i)
    if (out.point[i].dist < out.point[best].dist) best = i;
  CHECK(std::abs(out.point[best].dist + 0.01) < 1e-9);
  CHECK(norm(out.point[best].normal - n) < 1e-6);
  CHECK(norm(out.point[best].pos - (foot - 0.005 * n)) < 1e-6);

  out = {};  // a box along the slope: points spread to its corners
  auto const q = axis_angle(D{0, 1, 0}, -std::atan(tan));
  height_field(slope.at({0, 0, 0}), ShapeType::box, still(foot + 0.095 * n, {0.3, 0.2, 0.1}, q), 0., out);
  REQUIRE(out.count >= 4);
  double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
  for (int i = 0; i < out.count; ++i) {
    D const p = out.point[i].pos - foot;
    double const along[2] = {p.x / std::cos(std::atan(tan)), p.y};
    for (int k = 0; k < 2; ++k) {
      low[k] = std::min(low[k], along[k]);
      high[k] = std::max(high[k], along[k]);
    }
  }
  CHECK(high[0] - low[0] > 0.5);
  CHECK(high[1] - low[1] > 0.35);

  for (auto const& p : {D{5, 0, 0}, D{0, 0, 0.8}, D{0, 3, 0.1}, D{1e8, 0, 0}, D{0, 0, -2}}) {  // far, above, beside, below
    out = {};
    height_field(slope.at({0, 0, 0}), ShapeType::sphere, still(p, {0.2, 0, 0}), 0., out);
    CHECK(out.count == 0);
  }
  Field const row(1, 9, [](int, int) { return 0.5; });  // no cells
  height_field(row.at({0, 0, 0}), ShapeType::sphere, still({0, 0, 0}, {0.2, 0, 0}), 0., out);
  CHECK(out.count == 0);
}

TEST_CASE_TEMPLATE("rough fields: the deepest of all prisms is kept, and nothing is not a number", T, float, double) {
  Random random(2);
  Field const rough(13, 17, [&](int, int) { return 0.5 + 0.5 * random(); });
  std::vector<T> elevation(rough.elevation.begin(), rough.elevation.end());
  ShapeAsset<T> asset;
  asset.elevation = elevation.data();
  asset.rows = 13;
  asset.columns = 17;
  for (int i = 0; i < 4; ++i) asset.extent[i] = T(rough.asset.extent[i]);
  double worst = 0;
  for (int trial = 0; trial < 400; ++trial) {
    auto const b =
        still({random(), random(), 0.3 * random()}, {0.3 + 0.2 * random(), 0.3 + 0.2 * random(), 0.3 + 0.2 * random()}, random.turn());
    Shape<T> field = cast<T>(rough.at({0, 0, 0}), &asset);
    ContactPoints<T, 8> out;
    height_field(field, ShapeType::box, cast<T>(b), T(0), out);
    double found = 0;
    for (int i = 0; i < out.count; ++i) {
      auto const& p = out.point[i];
      CHECK(std::isfinite(p.dist + p.pos.x + p.pos.y + p.pos.z + p.normal.x));
      found = std::max(found, -double(p.dist));
    }
    double depth = 0;  // of all prisms, as polyhedra of their own
    for (int r = 0; r < 12; ++r)
      for (int c = 0; c < 16; ++c)
        for (int half = 0; half < 2; ++half) {
          D const corner[3] = {HfieldShape::point(rough.asset, r, c), HfieldShape::point(rough.asset, half ? r : r + 1, half ? c + 1 : c),
                               HfieldShape::point(rough.asset, r + 1, c + 1)};
          std::vector<D> axes{{0, 0, 1}, normalized(cross(corner[1] - corner[0], corner[2] - corner[0]))};
          std::vector<D> edges{{0, 0, 1}};
          for (int k = 0; k < 3; ++k) {
            D const e = corner[(k + 1) % 3] - corner[k];
            axes.push_back(normalized(D{e.y, -e.x, 0}));
            axes.push_back(column(b.R, k));
            edges.push_back(e);
            edges.push_back({e.x, e.y, 0});
          }
          for (int k = 0; k < 3; ++k)
            for (auto const& e : edges)
              if (norm(cross(column(b.R, k), e)) > 1e-9) axes.push_back(normalized(cross(column(b.R, k), e)));
          double least = 1e30;
          for (auto const& axis : axes)
            for (double sign : {1., -1.}) {
              D const n = sign * axis;
              double high = -1e30;
              for (auto const& p : corner) high = std::max({high, dot(n, p), dot(n, D{p.x, p.y, -0.4})});
              least = std::min(least, high - dot(n, b.p) + top(ShapeType::box, still({0, 0, 0}, b.size), transpose_times(b.R, n)));
            }
          depth = std::max(depth, least);
        }
    worst = std::max(worst, std::abs(found - depth));
  }
  CHECK(worst < (sizeof(T) == 4 ? 5e-6 : 1e-9));  // the tolerance of the search in float, rounding in double
}

// A contact lies where the two shapes meet: of the shape within its depth, though internal sides of prisms, wide and flat, have many
// points as deep. What lies on corners and lines of cells meets several of them.
TEST_CASE("contacts of a field lie on what touches it") {
  Field const level(3, 3, [](int, int) { return 0.; });
  Random random(7);
  std::vector<std::array<float, 3>> corners;
  for (int k = 0; k < 8; ++k) corners.push_back({k & 1 ? .05f : -.05f, k & 2 ? .05f : -.05f, k & 4 ? .05f : -.05f});
  Hull<double> const mesh(
      corners,
      {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4}, {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}});
  double const depths[] = {0, 1e-9, 1e-6, 1e-4, 1e-3, -1e-5};
  int met = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    int const kind = trial % 3;
    double const places[] = {0, 0.01, 0.1, -0.1}, turns[] = {0, M_PI / 4, M_PI / 2};
    auto const pick = [&](auto const& list, int n) { return list[std::min(n - 1, int(n * 0.5 * (1 + random())))]; };
    bool const lined = trial % 2 == 0;
    double const x = lined ? pick(places, 4) : 0.2 * random(), y = lined ? pick(places, 4) : 0.2 * random();
    double const yaw = lined ? pick(turns, 3) : 3 * random(), tip = kind == 0 && trial % 4 == 0 ? M_PI / 4 : 0;
    Quat<double> const q = Quat<double>{std::cos(yaw / 2), 0, 0, std::sin(yaw / 2)} * Quat<double>{std::cos(tip), std::sin(tip), 0, 0};
    double const depth = pick(depths, 6);
    auto shape = still({x, y, 0.05 - depth}, {0.05, 0.05, 0.05}, q);
    if (kind == 2) shape.asset = &mesh.asset;
    ShapeType const type = kind == 0 ? ShapeType::cylinder : kind == 1 ? ShapeType::box : ShapeType::mesh;
    ContactPoints<double, 8> out;
    height_field(level.at({0, 0, 0}), type, shape, 2e-5, out);
    for (int i = 0; i < out.count; ++i) {
      D const at = transpose_times(shape.R, out.point[i].pos - shape.p);
      double const beyond = std::max(abs(at.z), kind == 0 ? std::hypot(at.x, at.y) : std::max(abs(at.x), abs(at.y))) - 0.05;
      CAPTURE(trial);
      CAPTURE(out.point[i].normal.z);
      CAPTURE(at.x);
      CAPTURE(at.y);
      CAPTURE(at.z);
      CHECK(beyond <= 0.5 * abs(out.point[i].dist) + 1e-6);
      ++met;
    }
  }
  CHECK(met > 5000);
}

// Along normals of the surface alone. A ball whose center is above the ground touches it where it is nearest: that is a point of the
// surface, so its depth and normal are exact; anything else has a point as deep as the deepest prism says where it is shallow, and no
// normal that leads down or to the side; nothing that is in the ground is without a point.
TEST_CASE_TEMPLATE("points along normals of the surface", T, float, double) {
  Random random(9);
  Field const rough(13, 17, [&](int, int) { return 0.5 + 0.5 * random(); });
  Field const smooth(13, 17, [&](int r, int c) { return 0.5 + 0.2 * std::sin(0.7 * r) * std::cos(0.5 * c); });
  double worst = 0, worst_normal = 0, shallow = 0;
  int balls = 0, lost = 0, inner = 0;
  for (int trial = 0; trial < 6000; ++trial) {
    Field const& ground = trial % 2 == 0 ? rough : smooth;
    std::vector<T> const elevation(ground.elevation.begin(), ground.elevation.end());
    ShapeAsset<T> asset;
    asset.elevation = elevation.data();
    asset.rows = 13;
    asset.columns = 17;
    for (int i = 0; i < 4; ++i) asset.extent[i] = T(ground.asset.extent[i]);
    Shape<T> const field = cast<T>(ground.at({0, 0, 0}), &asset);
    ShapeType const types[] = {ShapeType::sphere, ShapeType::capsule, ShapeType::ellipsoid, ShapeType::cylinder, ShapeType::box};
    ShapeType const type = types[trial / 2 % 5];
    double const r = 0.05 + 0.1 * std::abs(random());
    auto b = still({1.4 * random(), random(), 0}, {r, 0.15 + 0.05 * random(), 0.15 + 0.05 * random()}, random.turn());
    // the surface: its triangles
    std::vector<std::array<D, 3>> tops;
    for (int row = 0; row < 12; ++row)
      for (int c = 0; c < 16; ++c)
        for (int half = 0; half < 2; ++half)
          tops.push_back({HfieldShape::point(ground.asset, row, c),
                          HfieldShape::point(ground.asset, half ? row : row + 1, half ? c + 1 : c),
                          HfieldShape::point(ground.asset, row + 1, c + 1)});
    b.p.z = 0.5 * (1 + random()) * 0.5;
    double nearest = 1e30;
    D foot{0, 0, 0};
    for (auto const& t : tops) {
      double l[3];
      detail::nearest_of_triangle(t[0] - b.p, t[1] - b.p, t[2] - b.p, l[0], l[1], l[2]);
      D const q = l[0] * t[0] + l[1] * t[1] + l[2] * t[2];
      if (norm(q - b.p) < nearest) nearest = norm(q - b.p), foot = q;
    }
    double height = 0;  // of the ground below its center
    for (auto const& t : tops) {
      D const u = t[1] - t[0], v = t[2] - t[0], d = b.p - t[0];
      double const det = u.x * v.y - u.y * v.x, s = (d.x * v.y - d.y * v.x) / det, w = (u.x * d.y - u.y * d.x) / det;
      if (s >= 0 && w >= 0 && s + w <= 1) height = t[0].z + s * u.z + w * v.z;
    }
    if (b.p.z < height) continue;
    ContactPoints<T, 8> out, any;
    height_field(field, type, cast<T>(b), T(0), out, true);
    height_field(field, type, cast<T>(b), T(0), any);
    double least = 0, deep = 0;
    D normal{0, 0, 1};
    for (int i = 0; i < any.count; ++i) least = std::min(least, double(any.point[i].dist));
    for (int i = 0; i < out.count; ++i) {
      auto const& p = out.point[i];
      CHECK(std::isfinite(p.dist + p.pos.x + p.pos.y + p.pos.z + p.normal.x));
      inner += !(p.normal.z > 0);
      if (p.dist < deep) deep = p.dist, normal = {p.normal.x, p.normal.y, p.normal.z};
    }
    CAPTURE(trial);
    bool const missed = least < -1e-5 && out.count == 0;
    CHECK(!missed);
    lost += missed;
    if (least > -0.015) shallow = std::max(shallow, deep - least);  // less than a tenth of the sizes
    if (type == ShapeType::sphere && nearest < r - 1e-5 && nearest > 1e-3) {
      ++balls;
      worst = std::max(worst, std::abs(deep - (nearest - r)));
      worst_normal = std::max(worst_normal, norm(normal - normalized(b.p - foot)));
    }
  }
  CHECK(balls > 200);
  CHECK(lost == 0);
  CHECK(inner == 0);
  CHECK(worst < 5e-6);
  CHECK(worst_normal < 1e-3);
  CHECK(shallow < 5e-6);
}
