// Height fields: against all of their triangles in turn (HfieldShape::ray), for rays from anywhere, along grid lines, in and beside them,
// to grid points and along the border; what rounding must not lose.
#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/ray/ray_height_field.hpp>
#include <vector>

#include "dynamics/random_tree.hpp"
#include "guarded.hpp"

namespace {
template <class T>
struct Field {
  gsp_test::Guarded<T> heights;
  gsp::ShapeAsset<T> asset;
  Field(int rows, int columns, T x, T y, T top, T base, unsigned seed, bool guard_after = false)
      : heights(std::size_t(rows * columns), guard_after) {
    gsp_test::Random r{seed};
    for (int i = 0; i < rows * columns; ++i) heights[std::size_t(i)] = seed == 0 ? T(0.5) : T(0.5 + 0.5 * r());
    asset.elevation = heights.data();
    asset.rows = rows;
    asset.columns = columns;
    asset.extent[0] = x;
    asset.extent[1] = y;
    asset.extent[2] = top;
    asset.extent[3] = base;
  }
};
}  // namespace

TEST_CASE("what a look at all triangles finds") {
  gsp_test::Random r{21};
  int hits = 0, others = 0, rays = 0;
  for (int const rows : {2, 3, 8, 26}) {
    Field<double> const f(rows, rows + 3, 1.5, 1, 0.4, 0.2, unsigned(rows));
    for (int k = 0; k < 20000; ++k) {
      gsp::Vec3<double> o{2 * r(), 2 * r(), 0.6 + 0.7 * r()}, to{1.5 * r(), r(), 0.4 * r()};
      if (k % 5 == 0) o = {40 * r(), 40 * r(), 3 * r()};  // grazing, from far
      gsp::Vec3<double> d = std::exp(3 * r()) * (to - o);
      if (k % 7 == 0) d = {0, 0, -1};
      auto const hit = gsp::ray_height_field(f.asset, gsp::Ray<double>{o, d});
      double const all = gsp::HfieldShape::ray(gsp::ShapeData<double>{{}, &f.asset}, o, d), length = gsp::norm(d);
      ++rays;
      hits += all >= 0;
      double const x = hit.x < INFINITY ? hit.x : -1;
      if ((x < 0) != (all < 0) || std::fabs(x - all) * length > 1e-9 * (1 + gsp::norm(o))) ++others;  // through a border's edge
    }
  }
  CHECK(hits > rays / 3);
  CHECK(others <= 2);
}

// A level field at 0.25: a ray that comes down on it at a slope meets it where arithmetic says, wherever it crosses the grid.
TEST_CASE_TEMPLATE("rays along grid lines and beside them do not fall through", T, double, float) {
  double const eps = double(std::numeric_limits<T>::epsilon());
  int lost = 0;
  for (int const rows : {4, 26, 101}) {
    Field<T> const f(rows, rows + 3, 1, 1, T(0.5), T(0.1), 0);
    for (int axis = 0; axis < 2; ++axis)
      for (int number = 0; number < (axis == 0 ? rows : rows + 3); ++number)
        for (int ulp = -2; ulp <= 2; ++ulp)
          for (T const slope : {T(0.05), T(0.3), T(2)}) {
            auto const p = axis == 0 ? gsp::HfieldShape::point(f.asset, number, 0) : gsp::HfieldShape::point(f.asset, 0, number);
            T beside = p[1 - axis];
            for (int k = 0; k < std::abs(ulp); ++k) beside = std::nextafter(beside, T(2 * ulp));
            if (!(std::fabs(double(beside)) <= 1)) continue;
            gsp::Ray<T> ray{{beside, beside, T(0.25) + slope * T(1.3)}, {T(0), T(0), -slope}};
            ray.origin[axis] = T(-1.3);
            ray.direction[axis] = T(1);
            auto const hit = gsp::ray_height_field(f.asset, ray);
            lost += !(std::fabs(double(hit.x) - 1.3) < 100 * eps / double(slope) + 4 * eps && hit.normal.z > T(0.999));
          }
    for (int row = 0; row < rows; ++row)  // straight down on each grid point, the border's too, and slanted to them
      for (int column = 0; column < rows + 3; ++column) {
        auto const p = gsp::HfieldShape::point(f.asset, row, column);
        auto const down = gsp::ray_height_field(f.asset, gsp::Ray<T>{{p.x, p.y, T(2)}, {T(0), T(0), T(-1)}});
        lost += !(std::fabs(double(down.x) - 1.75) <= 4 * eps);
        if (row == 0 || column == 0 || row == rows - 1 || column == rows + 2) continue;
        gsp::Vec3<T> const o{T(0.3), T(-0.7), T(1000)};
        auto const slanted = gsp::ray_height_field(f.asset, gsp::Ray<T>{o, p - o});
        lost += !(std::fabs(double(slanted.x) - 1) < 100 * eps);
      }
  }
  CHECK(lost == 0);
}

TEST_CASE("walls, base, and what is none") {
  Field<double> const f(3, 3, 1, 1, 1, 0.5, 0);
  auto const cast = [&](gsp::Vec3<double> const& o, gsp::Vec3<double> const& d) {
    return gsp::ray_height_field(f.asset, gsp::Ray<double>{o, d});
  };
  auto const wall = cast({-3, 0.2, 0.25}, {1, 0, 0});
  CHECK(wall.x == 2);
  CHECK(wall.normal.x == -1);
  auto const base = cast({0.1, 3, -0.25}, {0, -2, 0});
  CHECK(base.x == 1);
  CHECK(base.normal.y == 1);
  CHECK(cast({0.1, 0.1, -2}, {0, 0, 1}).x == 1.5);  // from below
  CHECK(cast({0.1, 0.1, -2}, {0, 0, 1}).normal.z == -1);
  CHECK(std::isinf(cast({-3, 0.2, 0.75}, {1, 0, 0}).x));  // above it
  CHECK(std::isinf(cast({0, 0, 2}, {0, 0, 0}).x));
  CHECK(std::isinf(cast({0, NAN, 2}, {0, 0, -1}).x));
  CHECK(std::isinf(cast({0, 0, 2}, {0, INFINITY, -1}).x));
}

// Straight down and up: the cell by its number, beside the walk from cell to cell, to the bit: from above, from within, from the base and
// from below, on grid points, grid lines and diagonals, an ulp beside them, along the border and beyond it. (1e-45 beside a line at 0 the
// walk takes for on it, as products underflow: the same distance, perhaps the other triangle's normal.)
TEST_CASE_TEMPLATE("rays straight up and down meet what others do, to the bit", T, double, float) {
  gsp_test::Random r{77};
  int hits = 0, others = 0, rays = 0, on_a_line = 0;
  for (int const rows : {2, 3, 8, 26}) {
    Field<T> const f(rows, rows + 3, T(1.5), T(1), T(0.4), T(0.2), unsigned(rows));
    Field<T> level(rows, rows + 3, T(1.5), T(1), T(0.4), T(0.2), unsigned(rows), true);
    for (int i = 0; i < rows * (rows + 3); ++i)
      if (i % 3) level.heights[std::size_t(i)] = T(0);  // z = 0: the base box's face too
    for (int k = 0; k < 30000; ++k) {
      gsp::ShapeAsset<T> const& asset = k % 2 ? level.asset : f.asset;
      int const row = int(std::uint32_t(k) * 7919u % std::uint32_t(rows)),
                column = int(std::uint32_t(k) * 104729u % std::uint32_t(rows + 3));
      auto const p = gsp::HfieldShape::point(asset, row, column);
      gsp::Vec3<T> o{T(1.55 * r()), T(1.03 * r()), T(0.1 + 0.6 * r())};
      if (k % 5 == 1) o.z = T(0);
      if (k % 5 == 2) o.z = p.z;
      if (k % 7 > 2) o.x = p.x;
      if (k % 7 > 4 || k % 7 == 1) o.y = p.y;
      if (k % 7 == 0 && row + 1 < rows && column + 4 < rows + 3) {  // on a diagonal
        auto const q = gsp::HfieldShape::point(asset, row + 1, column + 1);
        T const way = T(0.5 + 0.5 * r());
        o.x = p.x + way * (q.x - p.x);
        o.y = p.y + way * (q.y - p.y);
      }
      if (k % 11 == 3 && o.x != 0) o.x = std::nextafter(o.x, T(k % 2 ? 9 : -9));
      if (k % 11 == 4 && o.y != 0) o.y = std::nextafter(o.y, T(k % 2 ? 9 : -9));
      gsp::Ray<T> const ray{o, {T(0), T(0), T(k % 3 == 0 ? 0.7 : -0.7)}};
      T const most = k % 13 == 0 ? T(0.3) : gsp::detail::no_hit<T>();
      auto const straight = gsp::detail::UprightRay<T>(asset, ray, most).first(),
                 slanted = gsp::detail::HeightFieldRay<T>(asset, ray, most).first();
      ++rays;
      hits += slanted.x < most;
      on_a_line += o.x == p.x;
      others += std::memcmp(&straight, &slanted, sizeof straight) != 0;
    }
  }
  CHECK(hits > rays / 3);
  CHECK(on_a_line > rays / 3);
  CHECK(others == 0);
}
