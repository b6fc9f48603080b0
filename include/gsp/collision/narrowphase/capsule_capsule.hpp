#pragma once
#include <gsp/collision/detail/solids.hpp>

namespace gsp {

/// Two capsules: spheres at the closest points p_a + x d_a, p_b + y d_b of the two segments (|x|, |y| <= 1, d = half length times axis),
/// from the 2 x 2 system
///   [ d_a.d_a  -d_a.d_b ] [x]   [ -d_a.(p_a - p_b) ]
///   [ -d_a.d_b  d_b.d_b ] [y] = [  d_b.(p_a - p_b) ]
/// with clamps. Parallel axes (det below rounding): two points, at the ends of the stretch that they have in common (features 1 to 4: which
/// end of which), or one where they stand end to end. Axes that meet part across both: where they are parallel along the x axis of a, or
/// whichever rounding leaves at right angles to them. (MuJoCo parts them along the world's x axis, or the cross product of their x axes.)
/// @param lies  axes within 6 degrees of each other (sin^2 < 0.01) touch at two points, too: at either side of the closest ones, as far
///              from them along a as it takes to be 1e-4 of the radii less deep, or at the ends. Both move as the capsules do. A capsule
///              that lies on another one keeps both while it rocks; with one at a time, now at this end and now at that, it rocks for ever.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void capsule_capsule(Shape<T> const& a, Shape<T> const& b, T margin, Out& out, bool lies = false) {
  Vec3<T> const axis_a = column(a.R, 2), axis_b = column(b.R, 2);
  Vec3<T> const da = a.size.y * axis_a, db = b.size.y * axis_b, d = a.p - b.p;
  T const aa = dot(da, da), ab = -dot(da, db), bb = dot(db, db), u = -dot(da, d), v = dot(db, d);
  // det = aa bb sin^2: from the cross product, which does not cancel
  Vec3<T> const c = cross(da, db);
  T const det = dot(c, c);
  T const tiny = T(1e-30), inv_aa = aa > tiny ? T(1) / aa : T(0), inv_bb = bb > tiny ? T(1) / bb : T(0);
  T const one(1);
  bool const crossed = det > (sizeof(T) == 4 ? T(1e-7) : T(1e-15)) * aa * bb && det > tiny;
  // across the axes, of which one may be a point
  Mat3<T> const& frame = aa > tiny ? a.R : b.R;
  Vec3<T> const e0 = crossed ? (one / sqrt(det)) * c : column(frame, 0), e1 = crossed ? Vec3<T>{T(0), T(0), T(0)} : column(frame, 1);
  // The stretch [lo, hi] of a beside which b runs; b's ends y = 1 and y = -1 are at x1 and x2.
  T const x1 = (u - ab) * inv_aa, x2 = (u + ab) * inv_aa;
  T const lo = max(-one, min(x1, x2)), hi = min(one, max(x1, x2));
  auto const beside = [&](T x) { return clamp((v - x * ab) * inv_bb, -one, one); };
  // inside: at no end of either, so that the way is across both
  auto const way = [&](T x, T y, bool inside) {
    Vec3<T> const from_a = b.p + y * db - (a.p + x * da);
    return inside ? detail::across_axes(from_a, e0, e1, norm(d) + a.size.y + b.size.y) : from_a;
  };
  auto const add = [&](T x, T y, int feature, bool inside) {
    detail::add_sphere_sphere(a.p + x * da, a.size.x, way(x, y, inside), b.size.x, e0, margin, feature, out);
  };
  if (crossed) {
    T x = (bb * u - ab * v) / det, y = (aa * v - ab * u) / det;
    if (x > one) {
      x = one;
      y = (v - ab) * inv_bb;
    } else if (x < -one) {
      x = -one;
      y = (v + ab) * inv_bb;
    }
    if (y > one) {
      y = one;
      x = clamp((u - ab) * inv_aa, -one, one);
    } else if (y < -one) {
      y = -one;
      x = clamp((u + ab) * inv_aa, -one, one);
    }
    bool const inside = abs(x) < one && abs(y) < one;
    if (!lies || !(det < T(0.01) * aa * bb) || !(hi > lo)) return add(x, y, 0, inside);
    // Beside the closest points, which are D apart, the axes part by (s sin)^2 / (2 D), sin as seen along the line between those.
    Vec3<T> const apart = b.p + y * db - a.p - x * da;
    T const D = norm(apart), part = T(1e-4) * (a.size.x + b.size.x), seen = dot(c, apart);
    T const s = sqrt(T(2) * D * D * D * part * bb) / max(abs(seen), tiny);
    T const first = min(hi, x + s), second = max(lo, x - s);
    add(first, beside(first), 1, inside);
    return add(second, beside(second), 2, inside);
  }
  if (aa <= tiny || bb <= tiny) {  // one of them is a sphere
    T const x = clamp(u * inv_aa, -one, one), y = beside(x);
    return add(x, y, 1, abs(x) < one && abs(y) < one);
  }
  for (int end = 0; end < 2; ++end) {
    T const x = clamp(end == 0 ? hi : lo, -one, one);
    bool const of_a = lies || (end == 0 ? x >= one : x <= -one);
    int const of_b = (end == 0) == (x1 > x2) ? 3 : 4;
    add(x, beside(x), of_a ? 1 + end : of_b, hi > lo);
    if (!(hi > lo)) return;  // end to end
  }
}

}  // namespace gsp
