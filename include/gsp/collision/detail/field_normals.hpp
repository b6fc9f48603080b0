#pragma once
#include <gsp/collision/detail/convex_shape.hpp>

/// Which normals are those of a height field's surface. A prism has sides inside of the field and edges between tops that are level or
/// hollow: nothing touches these. What is left are normals of tops and, where the surface bulges, those between them.
namespace gsp::detail {

/// One triangle of the surface: corners (row, column) and places, relative to the middle of its prism.
template <class T>
struct FieldTriangle {
  ShapeAsset<T> const& field;
  Vec3<T> origin;         // the middle of the prism in the field's frame
  Vec3<T> const* corner;  // 6, relative to it: below, then above
  int row[3], column[3];  // of the corners
  Vec3<T> normal;         // unit, upward
  T length;               // about a cell's diagonal [m]

  KOKKOS_INLINE_FUNCTION bool has(int r, int c) const { return r >= 0 && c >= 0 && r < field.rows && c < field.columns; }
  KOKKOS_INLINE_FUNCTION Vec3<T> point(int r, int c) const { return HfieldShape::point(field, r, c) - origin; }

  /// Whether nothing around the corner k lies farther along n than it does. Upward: of the six corners about it that edges lead to, else of
  /// those below them.
  KOKKOS_INLINE_FUNCTION bool is_top(int k, Vec3<T> const& n, T rounding) const {
    Vec3<T> const at = corner[3 + k];
    T const up = n.z > T(0) ? n.z : T(0);
    for (int dr = -1; dr <= 1; ++dr)
      for (int dc = -1; dc <= 1; ++dc) {
        int const r = row[k] + dr, c = column[k] + dc;
        if (dr * dc < 0 || !has(r, c)) continue;
        Vec3<T> const d = point(r, c) - at;
        if (n.x * d.x + n.y * d.y + up * d.z > rounding) return false;
      }
    return true;
  }
};

template <class T>
KOKKOS_INLINE_FUNCTION FieldTriangle<T> field_triangle(ShapeAsset<T> const& field, int r, int c, int half, Vec3<T> const& origin,
                                                       Vec3<T> const* corner) {
  Vec3<T> const u = corner[4] - corner[3], v = corner[5] - corner[3];
  Vec3<T> const n = normalized(cross(u, v));
  return {field, origin, corner, {r, half == 0 ? r + 1 : r, r + 1}, {c, half == 0 ? c : c + 1, c + 1}, n.z < T(0) ? -n : n, norm(v)};
}

/// Whether n is a normal of the surface at this triangle: its own, one between it and the next one across an edge that bulges (at the
/// field's border: its outer side), or of a corner that is the farthest along n of all around it.
template <class T>
KOKKOS_INLINE_FUNCTION bool is_surface_normal(FieldTriangle<T> const& t, Vec3<T> const& n) {
  bool const single = sizeof(T) == 4;
  T const rounding = (single ? T(1e-5) : T(1e-9)) * t.length;
  if (dot(n, t.normal) > T(1) - (single ? T(1e-7) : T(1e-14))) return true;
  int top = 0;
  for (int k = 1; k < 3; ++k)
    if (dot(n, t.corner[3 + k]) > dot(n, t.corner[3 + top])) top = k;
  if (t.is_top(top, n, rounding)) return true;
  // an edge across n: what lies at its ends beyond the two triangles is no matter
  for (int k = 0; k < 3; ++k) {
    if (k == top) continue;
    int const third = 3 - k - top;
    Vec3<T> const edge = t.corner[3 + k] - t.corner[3 + top];
    if (!(abs(dot(n, edge)) < T(1e-3) * norm(edge)) || !(n.z > T(0))) continue;
    int const r = t.row[k] + t.row[top] - t.row[third], c = t.column[k] + t.column[top] - t.column[third];
    if (!t.has(r, c) || !(dot(n, t.point(r, c) - t.corner[3 + top]) > rounding)) return true;
  }
  return false;
}

/// The normal of the surface along which the prism and b overlap least: the triangle's own, or where an edge bulges the one nearest to n of
/// those between it and the next one's. `overlap` becomes that along it.
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION Vec3<T> surface_normal(FieldTriangle<T> const& t, ConvexShape<T>& prism, ConvexShape<T>& b,
                                                         Vec3<T> const& n, T& overlap) {
  Vec3<T> best = t.normal;
  overlap = dot(best, difference_support(prism, b, best).w);
  for (int k = 0; k < 3; ++k) {
    int const i = k == 2 ? 0 : k + 1, third = 3 - k - i;
    Vec3<T> const at = t.corner[3 + k];
    Vec3<T> const edge = normalized(t.corner[3 + i] - at);
    Vec3<T> side = cross(edge, t.normal);  // along the triangle, out over the edge
    if (dot(side, t.corner[3 + third] - at) > T(0)) side = -side;
    int const r = t.row[k] + t.row[i] - t.row[third], c = t.column[k] + t.column[i] - t.column[third];
    Vec3<T> next = normalized(Vec3<T>{side.x, side.y, T(0)});  // the outer side of the border
    if (t.has(r, c)) {
      next = normalized(cross(edge, t.point(r, c) - at));
      if (next.z < T(0)) next = -next;
    }
    T const far = dot(next, side);
    if (!(far > T(16) * Kokkos::Experimental::epsilon_v<T>)) continue;  // level or hollow
    Vec3<T> const across = n - dot(n, edge) * edge;
    T const out = dot(across, side);
    if (!(out > T(0))) continue;
    Vec3<T> const m = dot(across, t.normal) * far > out * dot(next, t.normal) ? normalized(across) : next;
    T const h = dot(m, difference_support(prism, b, m).w);
    if (!(h < overlap)) continue;
    overlap = h;
    best = m;
  }
  return best;
}

/// Whether p lies in, above or below the triangle; what is beyond the field's border counts as at it.
template <class T>
KOKKOS_INLINE_FUNCTION bool is_in_column(FieldTriangle<T> const& t, Vec3<T> const& p) {
  T const half_x = t.field.extent[0], half_y = t.field.extent[1];
  T const x = clamp(p.x + t.origin.x, -half_x, half_x) - t.origin.x, y = clamp(p.y + t.origin.y, -half_y, half_y) - t.origin.y;
  for (int k = 0; k < 3; ++k) {
    Vec3<T> const a = t.corner[k], b = t.corner[k == 2 ? 0 : k + 1], c = t.corner[k == 0 ? 2 : k - 1];
    T const inside = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    T const here = (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x);
    if (here * (inside > T(0) ? T(1) : T(-1)) < T(-1e-4) * abs(inside)) return false;
  }
  return true;
}

}  // namespace gsp::detail
