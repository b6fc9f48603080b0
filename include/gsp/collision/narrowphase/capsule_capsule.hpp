#pragma once
#include <gsp/collision/detail/solids.hpp>

namespace gsp {

/// Two capsules: spheres at the closest points p_a + x d_a, p_b + y d_b of the two segments (|x|, |y| <= 1, d = half length times axis),
/// from the 2 x 2 system
///   [ d_a.d_a  -d_a.d_b ] [x]   [ -d_a.(p_a - p_b) ]
///   [ -d_a.d_b  d_b.d_b ] [y] = [  d_b.(p_a - p_b) ]
/// with clamps. Parallel axes (det below rounding): two points, at the ends of the stretch that they have in common (features 1 to 4: which
/// end of which), or one where they stand end to end.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void capsule_capsule(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  Vec3<T> const axis_a = column(a.R, 2), axis_b = column(b.R, 2);
  Vec3<T> const da = a.size.y * axis_a, db = b.size.y * axis_b, d = a.p - b.p;
  T const aa = dot(da, da), ab = -dot(da, db), bb = dot(db, db), u = -dot(da, d), v = dot(db, d);
  // det = aa bb sin^2: from the cross product, which does not cancel
  Vec3<T> const c = cross(da, db);
  T const det = dot(c, c);
  T const tiny = T(1e-30), inv_aa = aa > tiny ? T(1) / aa : T(0), inv_bb = bb > tiny ? T(1) / bb : T(0);
  Vec3<T> const fallback = cross(axis_a, axis_b);
  T const one(1);
  if (det > (sizeof(T) == 4 ? T(1e-7) : T(1e-15)) * aa * bb && det > tiny) {
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
    detail::add_sphere_sphere(a.p + x * da, a.size.x, b.p + y * db, b.size.x, fallback, margin, 0, out);
    return;
  }
  // Parallel: the stretch [lo, hi] of a beside which b runs has both its ends in common.
  if (aa <= tiny || bb <= tiny) {  // one of them is a sphere
    T const x = clamp(u * inv_aa, -one, one);
    T const y = clamp((v - x * ab) * inv_bb, -one, one);
    detail::add_sphere_sphere(a.p + x * da, a.size.x, b.p + y * db, b.size.x, fallback, margin, 1, out);
    return;
  }
  T const x1 = (u - ab) * inv_aa, x2 = (u + ab) * inv_aa;  // b's ends y = 1 and y = -1
  T const lo = max(-one, min(x1, x2)), hi = min(one, max(x1, x2));
  for (int end = 0; end < 2; ++end) {
    T const x = clamp(end == 0 ? hi : lo, -one, one);
    T const y = clamp((v - x * ab) * inv_bb, -one, one);
    bool const of_a = end == 0 ? x >= one : x <= -one;
    int const of_b = (end == 0) == (x1 > x2) ? 3 : 4;
    detail::add_sphere_sphere(a.p + x * da, a.size.x, b.p + y * db, b.size.x, fallback, margin, of_a ? 1 + end : of_b, out);
    if (!(hi > lo)) return;  // end to end
  }
}

}  // namespace gsp
