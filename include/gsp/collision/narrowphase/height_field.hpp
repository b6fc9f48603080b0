#pragma once
#include <gsp/collision/detail/field_normals.hpp>
#include <gsp/collision/narrowphase/convex.hpp>

namespace gsp {

namespace detail {

/// Keeps the points of a height field that matter: each place once, the deeper; of nine the two that are nearest to each other lose the
/// shallower one.
template <class T>
struct FieldPoints {
  static constexpr int most = 8;
  ContactPoint<T> point[most + 1];
  int count = 0;
  int base = 0;  // feature of the prism's first point
  T same2;       // points nearer than the root of it are one [m^2]
  KOKKOS_INLINE_FUNCTION void add(Vec3<T> const& pos, T dist, Vec3<T> const& n, int) {
    ContactPoint<T> const p{pos, dist, n, base};
    ++base;
    for (int i = 0; i < count; ++i) {
      Vec3<T> const d = point[i].pos - pos;
      if (!(dot(d, d) < same2)) continue;
      if (dist < point[i].dist) point[i] = p;
      return;
    }
    point[count] = p;
    ++count;
    if (count <= most) return;
    int lost = most;
    T least = Kokkos::Experimental::finite_max_v<T>;
    for (int i = 0; i < count; ++i)
      for (int j = i + 1; j < count; ++j) {
        Vec3<T> const d = point[i].pos - point[j].pos;
        T const d2 = dot(d, d);
        if (!(d2 < least)) continue;
        least = d2;
        lost = point[j].dist < point[i].dist ? i : j;
      }
    --count;
    for (int i = lost; i < count; ++i) point[i] = point[i + 1];
  }
};

/// The first and the last cell of a row of `cells` cells of width w, from -half on, that [x - e, x + e] may touch.
template <class T>
KOKKOS_INLINE_FUNCTION void cells_under(T x, T e, T half, T w, int cells, int& first, int& last) {
  T const most = T(cells - 1);
  first = int(clamp((x - e + half) / w, T(0), most));
  last = int(clamp((x + e + half) / w, T(0), most));
}

/// The points of a prism of a height field and b along a normal of the surface. Where the shortest way out is none (`is_surface_normal`),
/// it is the least of those that are, and the deepest point counts only where the triangle is what it is below of: else it is the next
/// one's. A point that is left for that goes to `rest`, if it is the deepest so far.
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION int find_surface_patch(FieldTriangle<T> const& triangle, ConvexShape<T>& prism, ConvexShape<T>& b,
                                                         T margin, Patch<T>& patch, ContactPoint<T>& rest) {
  ConvexDistance<T> d = core_distance(prism, b, margin);
  if (!d.near) return 0;
  bool const kept = is_surface_normal(triangle, d.normal);
  if (!kept) {
    T overlap;
    d.normal = surface_normal(triangle, prism, b, d.normal, overlap);
    d.dist = -overlap - b.radius;
  }
  if (!meet_patch(prism, b, d, margin, patch)) {
    bool own = true;
    if (kept) {
      find_deepest(prism, b, d);
    } else {
      Vec3<T> const low = core_support(b, -d.normal) - b.radius * d.normal;
      d.pos = low - T(0.5) * d.dist * d.normal;
      own = is_in_column(triangle, low - d.dist * d.normal - prism.p);
    }
    ContactPoint<T> const p{d.pos, d.dist, d.normal, 0};
    if (own)
      patch.point[patch.count++] = p;
    else if (d.dist < rest.dist)
      rest = p;
  }
  return reduce_points(patch.point, patch.count);
}

}  // namespace detail

/// Height field a and any convex shape b of type `type_b`: the cells under b's bounds, each as two prisms from the triangle of its surface
/// (the diagonal runs from (row, column) to (row + 1, column + 1)) down to the base, each against b by the convex routine; up to 8 points:
/// of more, the two that lie nearest to each other lose the shallower one. Unless `smooth`, what is deeper in the ground than a prism is
/// wide may be pushed out of its side, as in MuJoCo: make cells wider than things sink. Features: prism and point. Cost: one convex search
/// for each prism that is not below b's bounds.
/// @param smooth  normals are those of the surface alone, not of sides and edges inside of it: what slides does not catch there
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void height_field(Shape<T> const& a, ShapeType type_b, Shape<T> const& b, T margin, Out& out, bool smooth = false) {
  ShapeAsset<T> const& field = *a.asset;
  if (field.rows < 2 || field.columns < 2) return;     // no cell
  Vec3<T> const at = transpose_times(a.R, b.p - a.p);  // b in the field's frame
  Mat3<T> turn;
  for (int j = 0; j < 3; ++j) {
    Vec3<T> const c = transpose_times(a.R, column(b.R, j));
    for (int i = 0; i < 3; ++i) turn(i, j) = c[i];
  }
  Vec3<T> e = half_extents(type_b, ShapeData<T>{b.size, b.asset}, turn);
  T const more = margin + T(16) * Kokkos::Experimental::epsilon_v<T> * (abs(at.x) + abs(at.y) + abs(at.z) + e.x + e.y + e.z);
  for (int i = 0; i < 3; ++i) e[i] = e[i] + more;
  T const half_x = field.extent[0], half_y = field.extent[1], base = field.extent[3];
  bool const above = abs(at.x) <= half_x + e.x && abs(at.y) <= half_y + e.y && at.z - e.z <= field.extent[2] && at.z + e.z >= -base;
  if (!above) return;
  T const dx = T(2) * half_x / T(field.columns - 1);
  T const dy = T(2) * half_y / T(field.rows - 1);
  int first_column, last_column, first_row, last_row;
  detail::cells_under(at.x, e.x, half_x, dx, field.columns - 1, first_column, last_column);
  detail::cells_under(at.y, e.y, half_y, dy, field.rows - 1, first_row, last_row);

  Shape<T> const local{{T(0), T(0), T(0)}, turn, b.size, b.asset};
  detail::ConvexShape<T> shape = detail::make_convex_shape(type_b, local, Vec3<T>{T(0), T(0), T(0)});
  Vec3<T> corner[6];
  detail::ConvexShape<T> prism{ShapeType::hfield, {T(0), T(0), T(0)}, {{T(1), T(0), T(0), T(0), T(1), T(0), T(0), T(0), T(1)}}, {}};
  prism.prism = corner;
  detail::FieldPoints<T> points;
  ContactPoint<T> rest{{T(0), T(0), T(0)}, Kokkos::Experimental::finite_max_v<T>, {T(0), T(0), T(1)}, 0};
  points.same2 = square(T(1e-3) * min(dx, dy));
  for (int r = first_row; r <= last_row; ++r)
    for (int c = first_column; c <= last_column; ++c)
      for (int half = 0; half < 2; ++half) {
        // about the triangle's middle, relative to b: numbers near zero
        Vec3<T> const top[3] = {HfieldShape::point(field, r, c), HfieldShape::point(field, half == 0 ? r + 1 : r, half == 0 ? c : c + 1),
                                HfieldShape::point(field, r + 1, c + 1)};
        if (!(max(max(top[0].z, top[1].z), top[2].z) >= at.z - e.z)) continue;
        Vec3<T> const middle = (T(1) / T(3)) * (top[0] + top[1] + top[2]);
        T const half_depth = T(0.5) * (middle.z + base);
        Vec3<T> const origin{middle.x, middle.y, middle.z - half_depth};
        for (int k = 0; k < 3; ++k) {
          corner[k] = {top[k].x - origin.x, top[k].y - origin.y, -half_depth};
          corner[3 + k] = top[k] - origin;
        }
        prism.p = origin - at;
        prism.extent = max(max(dx, dy), half_depth);
        points.base = ((r * (field.columns - 1) + c) * 2 + half) * 4;
        if (!smooth) {
          detail::add_convex_points(prism, shape, at, margin, points);
          continue;
        }
        auto const triangle = detail::field_triangle(field, r, c, half, origin, corner);
        detail::Patch<T> patch;
        int const count = detail::find_surface_patch(triangle, prism, shape, margin, patch, rest);
        for (int i = 0; i < count; ++i) points.add(at + patch.point[i].pos, patch.point[i].dist, patch.point[i].normal, 0);
      }
  if (points.count == 0 && rest.dist <= margin) {  // no column has the deepest point of its own
    points.base = 0;
    points.add(at + rest.pos, rest.dist, rest.normal, 0);
  }
  for (int i = 0; i < points.count; ++i) {
    auto const& p = points.point[i];
    out.add(a.p + a.R * p.pos, p.dist, a.R * p.normal, p.feature);
  }
}

}  // namespace gsp
