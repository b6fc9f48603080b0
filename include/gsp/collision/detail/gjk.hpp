#pragma once
#include <gsp/collision/detail/convex_shape.hpp>

/// The distance of two convex cores that do not overlap: the algorithm of Gilbert, Johnson and Keerthi (1988) on their difference D.
namespace gsp::detail {

/// Up to four points of D, and the weights of the point of their hull that is nearest to the origin.
template <class T>
struct Simplex {
  DifferencePoint<T> point[4];
  T weight[4];
  int count;
};

/// Weights of the point of the segment a b that is nearest to the origin.
template <class T>
KOKKOS_INLINE_FUNCTION void nearest_of_segment(Vec3<T> const& a, Vec3<T> const& b, T& la, T& lb) {
  Vec3<T> const d = b - a;
  T const length2 = dot(d, d);
  lb = length2 > T(0) ? clamp(-dot(a, d) / length2, T(0), T(1)) : T(0);
  la = T(1) - lb;
}

/// Weights of the point of the triangle a b c that is nearest to the origin: by the region of corners, edges and face that it lies in
/// (Ericson, Real-Time Collision Detection, 5.1.5).
template <class T>
KOKKOS_INLINE_FUNCTION void nearest_of_triangle(Vec3<T> const& a, Vec3<T> const& b, Vec3<T> const& c, T& la, T& lb, T& lc) {
  Vec3<T> const ab = b - a;
  Vec3<T> const ac = c - a;
  T const a1 = -dot(ab, a), a2 = -dot(ac, a);
  T const b1 = -dot(ab, b), b2 = -dot(ac, b);
  T const c1 = -dot(ab, c), c2 = -dot(ac, c);
  Vec3<T> const n = cross(ab, ac);
  T const va = dot(n, cross(b, c)), vb = dot(n, cross(c, a)), vc = dot(n, cross(a, b));
  la = T(0);
  lb = T(0);
  lc = T(0);
  if (a1 <= T(0) && a2 <= T(0)) {
    la = T(1);
  } else if (b1 >= T(0) && b2 <= b1) {
    lb = T(1);
  } else if (c2 >= T(0) && c1 <= c2) {
    lc = T(1);
  } else if (vc <= T(0) && a1 >= T(0) && b1 <= T(0)) {
    nearest_of_segment(a, b, la, lb);
  } else if (vb <= T(0) && a2 >= T(0) && c2 <= T(0)) {
    nearest_of_segment(a, c, la, lc);
  } else if (va <= T(0)) {
    nearest_of_segment(b, c, lb, lc);
  } else {
    T const sum = va + vb + vc;
    if (sum > T(0)) {
      la = va / sum;
      lb = vb / sum;
      lc = vc / sum;
    } else {  // no area
      nearest_of_segment(a, b, la, lb);
    }
  }
}

/// Reduces the simplex to its smallest face that holds the point v nearest to the origin. False where a tetrahedron holds the origin.
template <class T>
KOKKOS_INLINE_FUNCTION bool reduce_simplex(Simplex<T>& s, Vec3<T>& v) {
  T l[4] = {T(1), T(0), T(0), T(0)};
  if (s.count == 2) nearest_of_segment(s.point[0].w, s.point[1].w, l[0], l[1]);
  if (s.count == 3) nearest_of_triangle(s.point[0].w, s.point[1].w, s.point[2].w, l[0], l[1], l[2]);
  if (s.count == 4) {
    T nearest = Kokkos::Experimental::finite_max_v<T>;
    bool inside = true;
    for (int k = 0; k < 4; ++k) {  // the face without point k, where the origin is not on the side of point k
      int const i0 = k == 0 ? 1 : 0;
      int const i1 = k <= 1 ? 2 : 1;
      int const i2 = k <= 2 ? 3 : 2;
      Vec3<T> const a = s.point[i0].w, b = s.point[i1].w, c = s.point[i2].w;
      Vec3<T> const n = cross(b - a, c - a);
      T const here = -dot(n, a);
      T const there = dot(n, s.point[k].w - a);
      T const vague = T(16) * Kokkos::Experimental::epsilon_v<T> * norm(n) * norm(s.point[k].w - a);  // a tetrahedron without volume
      if (here * there > T(0) && abs(there) > vague) continue;
      inside = false;
      T m[3];
      nearest_of_triangle(a, b, c, m[0], m[1], m[2]);
      Vec3<T> const q = m[0] * a + m[1] * b + m[2] * c;
      T const q2 = dot(q, q);
      if (q2 < nearest) {
        nearest = q2;
        l[i0] = m[0];
        l[i1] = m[1];
        l[i2] = m[2];
        l[k] = T(0);
      }
    }
    if (inside) return false;
  }
  int kept = 0;
  v = {T(0), T(0), T(0)};
  for (int i = 0; i < s.count; ++i)
    if (l[i] > T(0)) {
      v = v + l[i] * s.point[i].w;
      s.point[kept] = s.point[i];
      s.weight[kept] = l[i];
      ++kept;
    }
  s.count = kept;
  return true;
}

template <class T>
struct CoreDistance {
  enum Answer { apart, beyond, near_or_inside };
  Answer answer;  // beyond: farther than `reach`; near_or_inside: `penetration` must tell
  Vec3<T> n;      // unit, from A to B
  T dist;         // of the planes across n that part the cores: at most the distance
  T length;       // of two points of the cores: at least the distance
  Vec3<T> a;      // the point of A's core
};

/// The nearest points of the two cores, if these are farther apart than `touch` and not farther than `reach`. The distance lies between
/// that of two planes which part the cores and |v|; ends where the two agree within `tolerance`, or can no more. The normal is that of the
/// best planes: v itself is a difference of numbers far larger than it is.
template <class T>
KOKKOS_INLINE_FUNCTION CoreDistance<T> gjk(ConvexShape<T>& a, ConvexShape<T>& b, T reach, T touch, T tolerance) {
  CoreDistance<T> result{CoreDistance<T>::near_or_inside, {T(1), T(0), T(0)}, T(0), T(0), {T(0), T(0), T(0)}};
  Simplex<T> s;
  s.count = 0;
  Vec3<T> v = a.p - b.p;
  T length = norm(v);
  if (!(length > T(0))) v = {T(1), T(0), T(0)};
  T below = -Kokkos::Experimental::finite_max_v<T>;  // the best separating plane
  int restarts = 0;
  for (int step = 0; step < 64; ++step) {
    Vec3<T> const n = -normalized(v);
    DifferencePoint<T> const p = difference_support(a, b, n);
    T const parts = -dot(n, p.w);
    if (parts > below) {
      below = parts;
      result.n = n;
    }
    if (below > reach) {
      result.answer = CoreDistance<T>::beyond;
      return result;
    }
    if (s.count > 0 && length - below <= tolerance) break;
    Simplex<T> const before = s;
    Vec3<T> const v_before = v;
    s.point[s.count] = p;
    ++s.count;
    bool const outside = reduce_simplex(s, v);
    if (!outside && !(below > T(0))) return result;
    T const shorter = norm(v);
    if (outside && shorter <= touch) return result;
    if (!outside || (before.count > 0 && !(shorter < length))) {  // rounding: a plane parts them, but no step leads nearer
      if (restarts == 2 || step >= 48 || length - below <= T(4) * tolerance) {
        s = before;
        v = v_before;
        break;
      }
      ++restarts;  // once more, from the best plane: another way there
      s.count = 0;
      v = -length * result.n;
      continue;
    }
    length = shorter;
  }
  if (!(below > T(0))) return result;
  if (s.count == 3 && length - below > tolerance) {  // the triangle's own normal, from points far apart
    Vec3<T> n = normalized(cross(s.point[1].w - s.point[0].w, s.point[2].w - s.point[0].w));
    if (dot(n, v) > T(0)) n = -n;
    T const parts = -dot(n, difference_support(a, b, n).w);
    if (parts > below) {
      below = parts;
      result.n = n;
    }
  }
  result.answer = CoreDistance<T>::apart;
  result.dist = below;
  result.length = length;
  for (int i = 0; i < s.count; ++i) result.a = result.a + s.weight[i] * s.point[i].a;
  return result;
}

}  // namespace gsp::detail
