#pragma once
#include <gsp/collision/detail/segment.hpp>

namespace gsp {

/// Capsule a, cylinder b. The deepest contact is the sphere at the point of the segment that is nearest to the cylinder (side, cap or rim:
/// a bracketed monotone equation, solved to rounding). Along the side or on a cap the ends of the common stretch are contacts too, so that
/// a lying capsule rests on two points. Features: 0 a point between, 1 the end nearer to -axis, 2 the end nearer to +axis. A segment that
/// enters the cylinder leaves it the shortest way: through cap or side, or across the rim along a direction at right angles to the segment.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void capsule_cylinder(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  T const r = a.size.x, half = a.size.y, R = b.size.x, H = b.size.y;
  Vec3<T> const c = transpose_times(b.R, a.p - b.p), u = half * transpose_times(b.R, column(a.R, 2));
  T const t = detail::nearest_to_cylinder(c, u, R, H);
  auto const nearest = detail::cylinder_distance(c + t * u, R, H);
  T const rounding = (sizeof(T) == 4 ? T(1e-6) : T(1e-14)) * (R + H + half);
  T t0(-1), t1(1);
  if (nearest.dist > rounding) {
    if (!(nearest.dist - r <= margin)) return;
    if (abs(nearest.n.z) < T(0.1))
      detail::clip_slab(c.z, u.z, H, t0, t1);
    else if (abs(nearest.n.z) > T(0.995))
      detail::clip_circle(c.x, c.y, u.x, u.y, R, t0, t1);
    else
      t1 = t0 - T(1);
    detail::add_stretch(t, t0, t1, half, r, [&](T at, int feature) {
      Vec3<T> const q = c + at * u;
      detail::add_sphere_contact(b, q, r, detail::cylinder_distance(q, R, H), margin, feature, out);
    });
    return;
  }
  // The segment meets the cylinder: out along the axis, or sideways, away from the cylinder's axis where the segment is nearest to it.
  T const a2 = u.x * u.x + u.y * u.y;
  T const ts = a2 > T(1e-30) ? clamp(-(c.x * u.x + c.y * u.y) / a2, T(-1), T(1)) : T(0);
  T const x = c.x + ts * u.x, y = c.y + ts * u.y, rho = sqrt(x * x + y * y);
  T const out_cap = H + abs(u.z) - abs(c.z), out_side = R - rho;
  if (a2 > T(1e-30)) {
    auto const rim = detail::way_across_rim(c, u, R, H);
    // less by more than what the routes differ by where they are one: a capsule that lies along cap or side leaves over that
    if (rim.depth < min(out_cap, out_side) - (sizeof(T) == 4 ? T(3e-6) : T(5e-7)) * (R + H + half)) {
      T const half2 = dot(u, u);
      T const radial = sqrt(rim.n.x * rim.n.x + rim.n.y * rim.n.y);
      T const k = radial > T(0) ? R / radial : T(0);
      T const steep = abs(rim.n.z), up = rim.n.z < T(0) ? T(-1) : T(1);
      Vec3<T> const p{k * rim.n.x, k * rim.n.y, up * H};
      T const at = clamp(dot(p - c, u) / half2, T(-1), T(1));
      if (steep < T(0.1))
        detail::clip_slab(c.z, u.z, H, t0, t1);
      else if (steep > T(0.995))
        detail::clip_circle(c.x, c.y, u.x, u.y, R, t0, t1);
      else
        t1 = t0 - T(1);
      detail::add_stretch(at, t0, t1, half, r, [&](T where, int feature) {
        Vec3<T> const q = c + where * u;
        T dist = -rim.depth;  // beside the rim: along its normal from the cap or the side
        if (where != at && steep < T(0.1)) dist = max(dist, ((rim.n.x * q.x + rim.n.y * q.y) / radial - R) / radial);
        if (where != at && steep > T(0.995)) dist = max(dist, (up * q.z - H) / steep);
        detail::add_sphere_contact(b, q, r, {dist, rim.n}, margin, feature, out);
      });
      return;
    }
  }
  Vec3<T> n;
  T deepest, offset;
  if (out_cap < out_side) {
    T const up = c.z < T(0) ? T(-1) : T(1);
    n = {T(0), T(0), up};
    offset = H;
    detail::clip_circle(c.x, c.y, u.x, u.y, R, t0, t1);
    deepest = up * u.z > T(0) ? t0 : t1;
  } else {
    offset = R;
    if (rho > T(1e-6) * R)
      n = {x / rho, y / rho, T(0)};
    else
      n = a2 > T(1e-30) ? normalized(Vec3<T>{-u.y, u.x, T(0)}) : Vec3<T>{T(1), T(0), T(0)};
    detail::clip_slab(c.z, u.z, H, t0, t1);
    deepest = clamp(ts, t0, t1);
  }
  if (!(t0 <= t1)) t0 = t1 = deepest = t;
  detail::add_stretch(deepest, t0, t1, half, r, [&](T at, int feature) {
    Vec3<T> const q = c + at * u;
    detail::add_sphere_contact(b, q, r, {dot(n, q) - offset, n}, margin, feature, out);
  });
}

}  // namespace gsp
