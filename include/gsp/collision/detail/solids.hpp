#pragma once
#include <gsp/collision/shapes.hpp>

/// Signed distances of a point to solids in their own frame, and the sphere contact that follows from one.
namespace gsp::detail {

template <class T>
struct SurfaceDistance {
  T dist;     // negative inside
  Vec3<T> n;  // unit gradient: away from the solid
};

/// Box with half sizes s. Inside, the nearest face counts.
template <class T>
KOKKOS_INLINE_FUNCTION SurfaceDistance<T> box_distance(Vec3<T> const& q, Vec3<T> const& s) {
  Vec3<T> const d{q.x - clamp(q.x, -s.x, s.x), q.y - clamp(q.y, -s.y, s.y), q.z - clamp(q.z, -s.z, s.z)};
  T const length = norm(d);
  if (length > T(1e-15)) return {length, (T(1) / length) * d};
  T const x = s.x - abs(q.x), y = s.y - abs(q.y), z = s.z - abs(q.z);
  if (x <= y && x <= z) return {-x, {q.x < T(0) ? T(-1) : T(1), T(0), T(0)}};
  if (y <= z) return {-y, {T(0), q.y < T(0) ? T(-1) : T(1), T(0)}};
  return {-z, {T(0), T(0), q.z < T(0) ? T(-1) : T(1)}};
}

/// Cylinder about z with radius R and half length H. Inside, the nearer of side and cap counts.
template <class T>
KOKKOS_INLINE_FUNCTION SurfaceDistance<T> cylinder_distance(Vec3<T> const& q, T R, T H) {
  T const rho = sqrt(q.x * q.x + q.y * q.y), side = rho - R, cap = abs(q.z) - H, up = q.z < T(0) ? T(-1) : T(1);
  bool const off_axis = rho > T(1e-15);
  Vec3<T> const radial{off_axis ? q.x / rho : T(1), off_axis ? q.y / rho : T(0), T(0)};
  if (side > T(0) && cap > T(0)) {
    T const length = sqrt(side * side + cap * cap);
    if (length > T(1e-15)) return {length, {side / length * radial.x, side / length * radial.y, up * cap / length}};
  }
  if (cap > side) return {cap, {T(0), T(0), up}};
  return {side, radial};
}

/// Adds the contact of a sphere (geom a, centre q in b's frame, radius r) with the solid b whose surface is `s` away from q.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void add_sphere_contact(Shape<T> const& b, Vec3<T> const& q, T r, SurfaceDistance<T> const& s, T margin, int feature,
                                               Out& out) {
  if (!(s.dist - r <= margin)) return;
  out.add(b.p + b.R * (q - T(0.5) * (r + s.dist) * s.n), s.dist - r, -(b.R * s.n), feature);
}

/// Contact of two spheres, of which the second's centre is `d` from the first's; `fallback` is the normal where the centres coincide.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION bool add_sphere_sphere(Vec3<T> const& p1, T r1, Vec3<T> const& d, T r2, Vec3<T> const& fallback, T margin,
                                              int feature, Out& out) {
  T const length = norm(d), dist = length - r1 - r2;
  if (!(dist <= margin)) return false;
  Vec3<T> const n = length > T(1e-15) ? (T(1) / length) * d : normalized(fallback);
  out.add(p1 + (r1 + T(0.5) * dist) * n, dist, n, feature);
  return true;
}

/// Of the way between the nearest points of axes that meet rounding leaves a direction of its own: so short a way counts across the axes
/// alone, along the unit vectors e0 and e1. `size`: of what the way is a difference of.
template <class T>
KOKKOS_INLINE_FUNCTION Vec3<T> across_axes(Vec3<T> const& way, Vec3<T> const& e0, Vec3<T> const& e1, T size) {
  T const root_of_rounding = sizeof(T) == 4 ? T(3e-4) : T(1e-8);
  return norm(way) < root_of_rounding * size ? dot(way, e0) * e0 + dot(way, e1) * e1 : way;
}

/// Narrows [t0, t1] to where |c + t u| <= s.
template <class T>
KOKKOS_INLINE_FUNCTION void clip_slab(T c, T u, T s, T& t0, T& t1) {
  if (abs(u) < T(1e-15) || abs(u) * T(1e7) < abs(c) + s) {  // parallel to the slab, to the accuracy that t has
    if (abs(c) > s + abs(u)) t1 = t0 - T(1);
    return;
  }
  T const a = (-s - c) / u, b = (s - c) / u;
  t0 = max(t0, min(a, b));
  t1 = min(t1, max(a, b));
}

/// Narrows [t0, t1] to where the point (cx, cy) + t (ux, uy) is within the circle of radius R about the origin.
template <class T>
KOKKOS_INLINE_FUNCTION void clip_circle(T cx, T cy, T ux, T uy, T R, T& t0, T& t1) {
  T const a = ux * ux + uy * uy, b = cx * ux + cy * uy, c = cx * cx + cy * cy - R * R;
  if (a < T(1e-30) || a * T(1e14) < R * R) {
    if (c > T(0)) t1 = t0 - T(1);
    return;
  }
  T const disc = b * b - a * c;
  if (disc < T(0)) {
    t1 = t0 - T(1);
    return;
  }
  T const root = sqrt(disc);
  t0 = max(t0, (-b - root) / a);
  t1 = min(t1, (-b + root) / a);
}

template <class T>
struct WayOut {
  T depth;
  Vec3<T> n;
};

/// The shortest way of the line c + t u out of the cylinder at right angles to u (u not along z, c + t u inside for some t). Seen along u
/// the cylinder is the hull of two ellipses with half axes R across and R |u.z| / |u| along its axis; with q the line's place among them,
/// turned so that both coordinates count from the nearer side, the way along (sin x, cos x) is
///   sqrt(R^2 sin^2 x + B^2 cos^2 x) + H' cos x - q . (sin x, cos x)
/// whose least is sought on [0, 90] degrees: 16 steps, then its slope's zero by bisection from each that is lower than its neighbors.
template <class T>
KOKKOS_INLINE_FUNCTION WayOut<T> way_across_rim(Vec3<T> const& c, Vec3<T> const& u, T R, T H) {
  T const length = norm(u);
  Vec3<T> const d = (T(1) / length) * u;
  Vec3<T> up{-d.z * d.x, -d.z * d.y, T(1) - d.z * d.z};  // z seen along u; its length is the sine of the tilt
  T const sine = norm(up);
  up = normalized(up);
  Vec3<T> side = cross(d, up);
  T y = dot(c, up), x = dot(c, side);
  if (y < T(0)) up = -up;
  if (x < T(0)) side = -side;
  y = abs(y);
  x = abs(x);
  T const B = R * abs(d.z);
  T const tall = H * sine;
  auto const way = [&](T angle) {
    T s, k;
    sincos(angle, s, k);
    return sqrt(R * R * s * s + B * B * k * k) + tall * k - x * s - y * k;
  };
  T const step = T(1.5707963267948966 / 16);
  auto const slope = [&](T angle) {
    T s, k;
    sincos(angle, s, k);
    T const outline = sqrt(R * R * s * s + B * B * k * k);
    return (R * R - B * B) * s * k / max(outline, T(1e-30)) - tall * s - x * k + y * s;
  };
  // There may be a way over the cap and one over the side, nearly as short: each is followed to its bottom.
  WayOut<T> least{Kokkos::Experimental::finite_max_v<T>, up};
  T before = Kokkos::Experimental::finite_max_v<T>;
  T here = way(T(0));
  for (int i = 0; i <= 16; ++i) {
    T const next = i == 16 ? Kokkos::Experimental::finite_max_v<T> : way(T(i + 1) * step);
    bool const bottom = here <= before && here <= next;
    before = here;
    here = next;
    if (!bottom) continue;
    T lo = T(i == 0 ? 0 : i - 1) * step, hi = T(i == 16 ? 16 : i + 1) * step;
    for (int j = 0; j < (sizeof(T) == 4 ? 22 : 48); ++j) {
      T const middle = T(0.5) * (lo + hi);
      if (slope(middle) > T(0))
        hi = middle;
      else
        lo = middle;
    }
    T const angle = T(0.5) * (lo + hi);
    T const depth = way(angle);
    if (!(depth < least.depth)) continue;
    T s, k;
    sincos(angle, s, k);
    least = {depth, s * side + k * up};
  }
  return least;
}

}  // namespace gsp::detail
