#pragma once
#include <gsp/geometry/shapes/hfield.hpp>
#include <gsp/ray/detail/ray_triangle.hpp>
#include <gsp/ray/lane_index.hpp>

/// Rays against height fields, in the field's frame: two triangles a cell, parted from (row, column) to (row + 1, column + 1), walls down
/// to z = 0 along the border, and a box from z = 0 down to its base, as MuJoCo's mj_rayHfield has them: a ray that begins inside meets the
/// box's upper face too. No Kokkos.
namespace gsp {

namespace detail {
/// Place of grid line `number` of an axis: 0 is x, across columns. As HfieldShape::point has it.
template <class T, class R = real_t<T>>
GSP_FUNCTION T grid_line(ShapeAsset<R> const& field, int axis, T const& number) {
  int const cells = (axis == 0 ? field.columns : field.rows) - 1;
  return field.extent[axis] * (T(R(2)) * number / T(R(cells)) - T(R(1)));
}
/// A cell's number along an axis, and its two grid lines.
template <class T>
struct GridCell {
  T number, low, high;
};
/// The cell that v lies in: in [low, high), of what is beyond the border the last one.
template <class T, class R = real_t<T>>
GSP_FUNCTION GridCell<T> cell_about(ShapeAsset<R> const& field, int axis, T const& v) {
  int const cells = (axis == 0 ? field.columns : field.rows) - 1;
  T const one(R(1)), last(R(cells - 1)), zero(R(0));
  T const about = (v + field.extent[axis]) / (T(R(2)) * field.extent[axis]) * T(R(cells));
  T const within = select(about > zero, select(about < last, about, last), zero);
  T number = of_lanes<T>([&](int l) { return R(int(lane_of(within, l))); });
  T low = grid_line(field, axis, number), high = grid_line(field, axis, number + one);
  for (auto off = number > zero && v<low; any(off); off = number> zero && v < low) {
    number = select(off, number - one, number);
    low = grid_line(field, axis, number);
    high = grid_line(field, axis, number + one);
  }
  for (auto off = number < last && v >= high; any(off); off = number < last && v >= high) {
    number = select(off, number + one, number);
    low = grid_line(field, axis, number);
    high = grid_line(field, axis, number + one);
  }
  return {number, low, high};
}

/// The way of a scaled ray over the cells, from wall to wall (Amanatides and Woo, A fast voxel traversal algorithm, 1987). Where it meets
/// the next wall follows from the wall's number: nothing adds up.
template <class T>
class HeightFieldRay {
 public:
  GSP_FUNCTION HeightFieldRay(ShapeAsset<T> const& field, Ray<T> const& ray, T most)
      : f_(field), ray_(ray), through_(ray), columns_(field.columns - 1), rows_(field.rows - 1) {
    best_.x = most;
    // what rounding takes from a point of the ray: by its own size, and by how far it has come
    T const size = largest(ray.origin) + max(field.extent[0], max(field.extent[1], max(field.extent[2], field.extent[3])));
    slack_ = roundings<T>(16) * size;
  }

  /// The nearest hit before `most`; x = infinity: none.
  GSP_FUNCTION ShapeHit<T> first() {
    T const most = best_.x;
    box();
    walls();
    T const top = T(0.5) * f_.extent[2];
    Vec3<T> const &o = ray_.origin, &d = ray_.direction;
    walk(ray_slab(o.x, d.x, f_.extent[0] + slack_)
             .intersection(ray_slab(o.y, d.y, f_.extent[1] + slack_))
             .intersection(ray_slab(o.z - top, d.z, top + slack_))
             .intersection({T(0), no_hit<T>()}));
    if (!(best_.x < most)) return {};
    if (met_) best_.normal = triangle_normal<T>(corner_[0], corner_[1], corner_[2]);
    return best_;
  }

 private:
  /// The box below.
  GSP_FUNCTION void box() {
    T const half = T(0.5) * f_.extent[3];
    Vec3<T> const size{f_.extent[0], f_.extent[1], half}, up{T(0), T(0), half};
    Ray<T> const from{ray_.origin + up, ray_.direction};
    T const x = meet_shape(ShapeType::box, size, from);
    if (x < best_.x) best_ = {x, normal_where_met(ShapeType::box, size, from, x)};
  }
  GSP_FUNCTION T line(int axis, int number) const { return grid_line(f_, axis, T(number)); }
  GSP_FUNCTION int cell_of(int axis, T v) const { return int(cell_about(f_, axis, v).number); }
  /// Along the border, from z = 0 up to the heights.
  GSP_FUNCTION void walls() {
    for (int axis = 0; axis < 2; ++axis) {
      if (ray_.direction[axis] == T(0)) continue;
      int const other = 1 - axis, last = axis == 0 ? columns_ : rows_;
      for (int end = 0; end < 2; ++end) {
        T const side = end == 0 ? -f_.extent[axis] : f_.extent[axis], x = (side - ray_.origin[axis]) / ray_.direction[axis];
        if (!(x >= T(0) && x < best_.x)) continue;
        Vec3<T> const p = ray_.at(x);
        if (!(abs(p[other]) <= f_.extent[other] && p.z >= T(0))) continue;
        int const cell = cell_of(other, p[other]), border = end == 0 ? 0 : last;
        Vec3<T> const from = axis == 0 ? HfieldShape::point(f_, cell, border) : HfieldShape::point(f_, border, cell),
                      to = axis == 0 ? HfieldShape::point(f_, cell + 1, border) : HfieldShape::point(f_, border, cell + 1);
        if (!(p.z <= fma((p[other] - from[other]) / (to[other] - from[other]), to.z - from.z, from.z))) continue;
        best_.x = x;
        best_.normal = {T(0), T(0), T(0)};
        best_.normal[axis] = end == 0 ? T(-1) : T(1);
      }
    }
  }
  GSP_FUNCTION void walk(RayInterval<T> const& over) {
    if (!over.any()) return;
    Vec3<T> const &o = ray_.origin, &d = ray_.direction, begin = ray_.at(over.in);
    int column = cell_of(0, begin.x), row = cell_of(1, begin.y);
    // Where it comes in next to a wall, in the cell beyond it too.
    T const near = slack_ + roundings<T>(16) * over.in;
    int const left = column > 0 && begin.x - line(0, column) <= near,
              right = column + 1 < columns_ && line(0, column + 1) - begin.x <= near;
    int const below = row > 0 && begin.y - line(1, row) <= near, above = row + 1 < rows_ && line(1, row + 1) - begin.y <= near;
    for (int r = row - below; r <= row + above; ++r)
      for (int c = column - left; c <= column + right; ++c)
        if (r != row || c != column) cell(r, c, over.in, no_hit<T>());
    int const ahead = d.x > T(0), up = d.y > T(0);
    auto const wall = [&](int axis, int number) { return d[axis] == T(0) ? no_hit<T>() : (line(axis, number) - o[axis]) / d[axis]; };
    for (T in = over.in; in <= over.out && in <= best_.x;) {
      T const x = wall(0, column + ahead), y = wall(1, row + up), out = min(x, y);
      cell(row, column, in, out);
      if (!(out < no_hit<T>())) return;
      bool const both = abs(x - y) <= slack_ + roundings<T>(16) * out;
      int const next_column = column + (ahead ? 1 : -1), next_row = row + (up ? 1 : -1);
      if (both) {  // through a corner: by either side of it
        if (is_column(next_column)) cell(row, next_column, in, no_hit<T>());
        if (is_row(next_row)) cell(next_row, column, in, no_hit<T>());
      }
      if (x <= y) column = next_column;
      if (y <= x) row = next_row;
      if (!is_column(column) || !is_row(row)) return;
      in = out;
    }
  }
  GSP_FUNCTION bool is_column(int column) const { return column >= 0 && column < columns_; }
  GSP_FUNCTION bool is_row(int row) const { return row >= 0 && row < rows_; }
  /// Two triangles, where the ray is not above or below both all along the cell, which it is in from x = in to out.
  GSP_FUNCTION void cell(int row, int column, T in, T out) {
    Vec3<T> const a = HfieldShape::point(f_, row, column), b = HfieldShape::point(f_, row, column + 1),
                  c = HfieldShape::point(f_, row + 1, column), e = HfieldShape::point(f_, row + 1, column + 1);
    if (out < no_hit<T>()) {
      T const z0 = ray_.at(in).z, z1 = ray_.at(out).z, slack = slack_ + roundings<T>(16) * out;
      if (min(z0, z1) - slack > max(max(a.z, b.z), max(c.z, e.z)) || max(z0, z1) + slack < min(min(a.z, b.z), min(c.z, e.z))) return;
    }
    triangle(a, e, c);
    triangle(a, b, e);
  }
  GSP_FUNCTION void triangle(Vec3<T> const& a, Vec3<T> const& b, Vec3<T> const& c) {
    T const x = through_.hit(a, b, c);
    if (!(x < best_.x)) return;
    best_.x = x;
    corner_[0] = a;
    corner_[1] = b;
    corner_[2] = c;
    met_ = true;
  }

  ShapeAsset<T> const& f_;
  Ray<T> const& ray_;
  TriangleRay<T> through_;
  int columns_, rows_;  // cells
  T slack_;
  ShapeHit<T> best_;
  Vec3<T> corner_[3];  // of the triangle that was met last,
  bool met_ = false;   // if any was
};

/// Rays straight up or down: by the cell that each stands over, without a walk, to the bit what HeightFieldRay finds; but where products
/// of how far a ray is beside a grid line underflow (1e-45 beside one at 0) the walk takes it for on the line: the same distance, perhaps
/// the other triangle's normal. T is one ray's number or those of a pack of rays. Height scans.
template <class T>
class UprightRay {
  using R = real_t<T>;
  using Mask = decltype(T(0) < T(0));

 public:
  GSP_FUNCTION UprightRay(ShapeAsset<R> const& field, Ray<T> const& ray, T const& most)
      : f_(field), o_(ray.origin), along_(ray.direction.z), inverse_(T(R(1)) / ray.direction.z), x_(most) {}

  /// The nearest hit before `most`; x = infinity: none.
  GSP_FUNCTION ShapeHit<T> first() {
    T const most = x_, zero(R(0));
    Mask const over = abs(o_.x) <= T(f_.extent[0]) && abs(o_.y) <= T(f_.extent[1]);
    T const half(R(0.5) * f_.extent[3]);
    RayInterval<T> const slab = ray_slab(o_.z + half, along_, half);
    T const box = slab.first();
    x_ = select(over && box < most, box, most);
    GridCell<T> const column = cell_about(f_, 0, o_.x), row = cell_about(f_, 1, o_.y);
    // on a grid line: in the cells on both sides
    Mask const left = over && column.number > zero && o_.x == column.low, below = over && row.number > zero && o_.y == row.low;
    if (any(left || below)) {
      T const one(R(1)), previous_column = max(column.number - one, zero), previous_row = max(row.number - one, zero);
      // where there is none, the cell itself, which `left` and `below` leave out: its heights are read in any case
      GridCell<T> const before{previous_column, grid_line(f_, 0, previous_column), column.low},
          under{previous_row, grid_line(f_, 1, previous_row), row.low};
      cell(left && below, under, before);
      cell(below, under, column);
      cell(left, row, before);
    }
    cell(over, row, column);
    Vec3<T> const of_cell = triangle_normal<T>(corner_[0], corner_[1], corner_[2]);
    Mask const goes_in = abs(slab.in - x_) <= abs(slab.out - x_), up = along_ > zero;
    T const of_box = select((goes_in && up) || (!goes_in && !up), T(R(-1)), T(R(1)));
    Mask const found = over && x_ < most;
    return {select(found, x_, no_hit<T>()), select(found, select(met_, of_cell, Vec3<T>{zero, zero, of_box}), Vec3<T>{zero, zero, zero})};
  }

 private:
  GSP_FUNCTION T height(GridCell<T> const& row, GridCell<T> const& column, int up, int right) const {
    return f_.extent[2] * of_lanes<T>([&](int l) {
             return f_.elevation[(int(lane_of(row.number, l)) + up) * f_.columns + int(lane_of(column.number, l)) + right];
           });
  }
  /// Its two triangles, or that one alone on whose side of the line from a to e the ray is: as the triangles' own tests have it.
  GSP_FUNCTION void cell(Mask here, GridCell<T> const& row, GridCell<T> const& column) {
    Vec3<T> const a{column.low, row.low, height(row, column, 0, 0)}, b{column.high, row.low, height(row, column, 0, 1)},
        c{column.low, row.high, height(row, column, 1, 0)}, e{column.high, row.high, height(row, column, 1, 1)};
    T const side = difference_of_products(e.x - o_.x, a.y - o_.y, e.y - o_.y, a.x - o_.x);
    Mask const first = here && side <= T(R(0)), second = here && side >= T(R(0));
    if (any(first)) triangle(first, a, e, c);
    if (any(second)) triangle(second, a, b, e);
  }
  /// TriangleRay::hit of rays along z.
  GSP_FUNCTION void triangle(Mask here, Vec3<T> const& a, Vec3<T> const& b, Vec3<T> const& c) {
    T const zero(R(0));
    Vec3<T> const A = a - o_, B = b - o_, C = c - o_;
    T const u = difference_of_products(C.x, B.y, C.y, B.x), v = difference_of_products(A.x, C.y, A.y, C.x),
            w = difference_of_products(B.x, A.y, B.y, A.x), det = u + v + w;
    Mask const inside = (u >= zero && v >= zero && w >= zero) || (u <= zero && v <= zero && w <= zero);
    T const x = fma(u, inverse_ * A.z, fma(v, inverse_ * B.z, w * (inverse_ * C.z))) / det;
    Mask const nearer = here && inside && det != zero && x >= zero && x < x_;
    x_ = select(nearer, x, x_);
    corner_[0] = select(nearer, a, corner_[0]);
    corner_[1] = select(nearer, b, corner_[1]);
    corner_[2] = select(nearer, c, corner_[2]);
    met_ = met_ || nearer;
  }

  ShapeAsset<R> const& f_;
  Vec3<T> o_;
  T along_, inverse_, x_;
  Vec3<T> corner_[3]{};
  Mask met_ = T(R(0)) < T(R(0));
};
template <class T>
GSP_FUNCTION auto is_upright(Ray<T> const& ray) {
  return ray.direction.x == T(0) && ray.direction.y == T(0);
}

/// The nearest hit of a scaled ray before `most`.
template <class T>
GSP_FUNCTION ShapeHit<T> meet_height_field(ShapeAsset<T> const& field, Ray<T> const& ray, T most) {
  if (is_upright(ray)) return UprightRay<T>(field, ray, most).first();
  return HeightFieldRay<T>(field, ray, most).first();
}
}  // namespace detail

/// The nearest hit of a height field, and its normal, upward of cells and outward of the rest. NaN, infinity and a direction of 0 miss.
/// Cost of a cell that the ray goes over, about 60 flop; 200 where it comes near. Straight up or down: about 150, whatever the field's
/// size.
template <class T>
GSP_FUNCTION ShapeHit<T> ray_height_field(ShapeAsset<T> const& field, Ray<T> const& ray) {
  if (!detail::is_ray(ray)) return {};
  detail::ScaledRay<T> const scaled(ray);
  ShapeHit<T> hit = detail::meet_height_field(field, scaled.ray, detail::no_hit<T>());
  hit.x = scaled.back(hit.x);
  return hit;
}

}  // namespace gsp
