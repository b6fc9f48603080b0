#pragma once
#include <gsp/collision/detail/solids.hpp>

/// Point of the segment c + t u, |t| <= 1, that is nearest to a convex solid: the zero of g(t) = u . (q - nearest point), half the slope of
/// the squared distance, which never falls with t. The bracket is narrowed by the t at which the nearest feature can change.
namespace gsp::detail {

template <class T, class Slope>
struct Bracket {
  Slope slope;
  T lo, hi, g_lo, g_hi;
  bool done = false;  // the answer is lo
  KOKKOS_INLINE_FUNCTION explicit Bracket(Slope const& s) : slope(s), lo(-1), hi(1), g_lo(s(T(-1))), g_hi(s(T(1))) {
    if (g_lo >= T(0))
      done = true;
    else if (g_hi <= T(0)) {
      lo = hi;
      done = true;
    }
  }
  KOKKOS_INLINE_FUNCTION void split(T t) {
    if (done || !(t > lo && t < hi)) return;
    T const g = slope(t);
    if (g < T(0)) {
      lo = t;
      g_lo = g;
    } else if (g > T(0)) {
      hi = t;
      g_hi = g;
    } else {
      lo = t;
      done = true;
    }
  }
  /// The zero, by false position with halving of the end that stays (Illinois); one step where g is linear between the ends.
  KOKKOS_INLINE_FUNCTION T zero(int steps) {
    int side = 0;
    for (int i = 0; i < steps && !done; ++i) {
      T const t = lo + (hi - lo) * (-g_lo / (g_hi - g_lo));
      if (!(t > lo && t < hi)) return t <= lo ? lo : hi;
      T const g = slope(t);
      if (g < T(0)) {
        lo = t;
        g_lo = g;
        if (side < 0) g_hi = T(0.5) * g_hi;
        side = -1;
      } else if (g > T(0)) {
        hi = t;
        g_hi = g;
        if (side > 0) g_lo = T(0.5) * g_lo;
        side = 1;
      } else {
        lo = t;
        done = true;
      }
    }
    return done ? lo : -g_lo < g_hi ? lo : hi;
  }
};

template <class T>
struct BoxSlope {
  Vec3<T> c, u, s;
  KOKKOS_INLINE_FUNCTION T operator()(T t) const {
    Vec3<T> const q = c + t * u;
    return dot(u, q - Vec3<T>{clamp(q.x, -s.x, s.x), clamp(q.y, -s.y, s.y), clamp(q.z, -s.z, s.z)});
  }
};
template <class T>
KOKKOS_INLINE_FUNCTION T nearest_to_box(Vec3<T> const& c, Vec3<T> const& u, Vec3<T> const& s) {
  Bracket<T, BoxSlope<T>> b(BoxSlope<T>{c, u, s});
  for (int i = 0; i < 3; ++i) {
    if (abs(u[i]) < T(1e-15)) continue;
    b.split((s[i] - c[i]) / u[i]);
    b.split((-s[i] - c[i]) / u[i]);
  }
  return b.zero(2);  // g is linear between these points
}

template <class T>
struct CylinderSlope {
  Vec3<T> c, u;
  T R, H;
  KOKKOS_INLINE_FUNCTION T operator()(T t) const {
    Vec3<T> const q = c + t * u;
    T const rho = sqrt(q.x * q.x + q.y * q.y), side = rho - R, cap = abs(q.z) - H;
    T g(0);
    if (side > T(0) && rho > T(0)) g = g + side / rho * (q.x * u.x + q.y * u.y);
    if (cap > T(0)) g = g + (q.z < T(0) ? -cap : cap) * u.z;
    return g;
  }
};
template <class T>
KOKKOS_INLINE_FUNCTION T nearest_to_cylinder(Vec3<T> const& c, Vec3<T> const& u, T R, T H) {
  Bracket<T, CylinderSlope<T>> b(CylinderSlope<T>{c, u, R, H});
  if (abs(u.z) >= T(1e-15)) {
    b.split((H - c.z) / u.z);
    b.split((-H - c.z) / u.z);
  }
  T const a = u.x * u.x + u.y * u.y;
  if (a >= T(1e-30)) {
    T const m = -(c.x * u.x + c.y * u.y) / a, q2 = square(c.x + m * u.x) + square(c.y + m * u.y);
    if (q2 < R * R) {
      T const w = sqrt((R * R - q2) / a);
      b.split(m - w);
      b.split(m + w);
    } else {
      b.split(m);
    }
  }
  return b.zero(sizeof(T) == 4 ? 24 : 48);
}

/// Adds the contact of the capsule's sphere at t, and those at the ends [t0, t1] of the stretch along which the capsule follows the solid,
/// where they are at least a twentieth of the radius away: add(t, feature). Features: 0 a point between, 1 the end t0, 2 the end t1.
template <class T, class Add>
KOKKOS_INLINE_FUNCTION void add_stretch(T t, T t0, T t1, T half, T r, Add const& add) {
  T const gap = T(0.05) * r;
  if (!(t0 <= t1)) return add(t, 0);
  bool const at0 = !(abs(t - t0) * half > gap), at1 = !at0 && !(abs(t1 - t) * half > gap);
  add(t, at0 ? 1 : at1 ? 2 : 0);
  if (!at0) add(t0, 1);
  if (!at1 && abs(t1 - t0) * half > gap) add(t1, 2);
}

}  // namespace gsp::detail
