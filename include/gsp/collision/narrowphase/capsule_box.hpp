#pragma once
#include <gsp/collision/detail/segment.hpp>

namespace gsp {

/// Capsule a, box b. The deepest contact is the sphere at the point of the segment that is nearest to the box (exact: a bracketed piecewise
/// linear equation). Where the normal there lies in a face's or an edge's direction, the ends of the stretch along which the capsule
/// follows that face or edge are contacts too, so that a lying capsule rests on two points. Features: 0 a point between, 1 the end nearer
/// to -axis, 2 the end nearer to +axis. A segment that enters the box leaves it the shortest way: through a face, or across an edge along a
/// direction at right angles to the segment (separating axes).
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void capsule_box(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  T const r = a.size.x, half = a.size.y;
  Vec3<T> const s = b.size, c = transpose_times(b.R, a.p - b.p), axis = transpose_times(b.R, column(a.R, 2)), u = half * axis;
  T const t = detail::nearest_to_box(c, u, s);
  auto const nearest = detail::box_distance(c + t * u, s);
  T const scale = s.x + s.y + s.z + half, rounding = (sizeof(T) == 4 ? T(1e-6) : T(1e-14)) * scale;
  if (nearest.dist > rounding) {
    if (!(nearest.dist - r <= margin)) return;
    T t0(-1), t1(1);
    bool flat = false;
    for (int i = 0; i < 3; ++i)
      if (abs(nearest.n[i]) < T(0.1)) {
        detail::clip_slab(c[i], u[i], s[i], t0, t1);
        flat = true;
      }
    if (!flat) t1 = t0 - T(1);
    detail::add_stretch(t, t0, t1, half, r, [&](T at, int feature) {
      Vec3<T> const q = c + at * u;
      detail::add_sphere_contact(b, q, r, detail::box_distance(q, s), margin, feature, out);
    });
    return;
  }

  // The segment meets the box: the shortest way out over 3 face normals and 3 cross products of the axis with the box's edges.
  int face = 0, edge = -1;
  T depth = s.x + abs(u.x) - abs(c.x);
  for (int i = 1; i < 3; ++i) {
    T const d = s[i] + abs(u[i]) - abs(c[i]);
    if (d < depth) {
      depth = d;
      face = i;
    }
  }
  Vec3<T> way{T(0), T(0), T(0)};
  T const equal = (sizeof(T) == 4 ? T(2e-6) : T(1e-9)) * scale;  // what lies along a face leaves through that
  for (int i = 0; i < 3; ++i) {
    Vec3<T> e{T(0), T(0), T(0)};
    e[i] = T(1);
    Vec3<T> m = cross(axis, e);
    T const sine = norm(m);
    if (sine < T(1e-7)) continue;
    m = (T(1) / sine) * m;
    T const d = s.x * abs(m.x) + s.y * abs(m.y) + s.z * abs(m.z) + abs(dot(m, u)) - abs(dot(m, c));  // m . u: rounding
    if (d < depth - (edge < 0 ? equal : T(0))) {
      depth = d;
      edge = i;
      way = dot(m, c) < T(0) ? -m : m;
    }
  }
  if (edge < 0) {
    T const up = c[face] < T(0) ? T(-1) : T(1);
    Vec3<T> n{T(0), T(0), T(0)};
    n[face] = up;
    T t0(-1), t1(1);
    for (int i = 0; i < 3; ++i)
      if (i != face) detail::clip_slab(c[i], u[i], s[i], t0, t1);
    if (!(t0 <= t1)) t0 = t1 = t;
    T const deepest = up * u[face] > T(0) ? t0 : t1;
    detail::add_stretch(deepest, t0, t1, half, r, [&](T at, int feature) {
      Vec3<T> const q = c + at * u;
      detail::add_sphere_contact(b, q, r, {up * q[face] - s[face], n}, margin, feature, out);
    });
    return;
  }
  // Closest points of the segment and of the box's edge along axis `edge`: minimise over t the distance across that axis, then clamp.
  Vec3<T> corner{way.x < T(0) ? -s.x : s.x, way.y < T(0) ? -s.y : s.y, way.z < T(0) ? -s.z : s.z};
  Vec3<T> d = corner - c, across = u;
  d[edge] = across[edge] = T(0);
  T const at = clamp(dot(d, across) / max(dot(across, across), T(1e-30)), T(-1), T(1));
  // Where the way is nearly a face's normal, the stretch over that face, too.
  T t0(-1), t1(-2);
  int flat = 0;
  for (int i = 1; i < 3; ++i)
    if (abs(way[i]) > abs(way[flat])) flat = i;
  if (abs(way[flat]) > T(0.995)) {
    t1 = T(1);
    for (int i = 0; i < 3; ++i)
      if (i != flat) detail::clip_slab(c[i], u[i], s[i], t0, t1);
  }
  detail::add_stretch(at, t0, t1, half, r, [&](T where, int feature) {
    Vec3<T> const q = c + where * u;
    T dist = -depth;  // beside the edge: along the way from the face
    if (where != at) dist = max(dist, (way[flat] < T(0) ? -q[flat] - s[flat] : q[flat] - s[flat]) / abs(way[flat]));
    detail::add_sphere_contact(b, q, r, {dist, way}, margin, feature, out);
  });
}

}  // namespace gsp
