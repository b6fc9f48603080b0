#pragma once
#include <Kokkos_Core.hpp>
#include <gsp/math/quat.hpp>

/// The shortest way of a string round a sphere or an infinite cylinder, over lanes, without branches.
namespace gsp::detail {

/// A string from x0 to x1: over the points t0 and t1, with `length` between them on the geom, where `wrapped`; else straight.
template <class T, class M>
struct LanesWrap {
  M wrapped;
  Vec3<T> t0, t1;
  T length;
};

/// In the plane, circle of radius r about 0, ends a and b outside. The straight lines from a and b touch the circle at angles
/// acos(r / |a|), acos(r / |b|) from a and b, on the way from a to b by the signed angle `turn`; what is left between them is the arc:
///   arc = |turn| - acos(r / |a|) - acos(r / |b|),   wrapped where it is positive.
template <class T>
KOKKOS_INLINE_FUNCTION T lanes_wrap_outside(T ax, T ay, T bx, T by, T r, T turn, T (&t)[4]) {
  T const aa = fma(ax, ax, ay * ay), bb = fma(bx, bx, by * by);
  T const la = sqrt(max(aa - r * r, T(0))), lb = sqrt(max(bb - r * r, T(0)));  // lengths of the tangents
  T const sign = select(turn < T(0), T(-1), T(1));
  T const ka = r / max(aa, T(1e-30)), kb = r / max(bb, T(1e-30));
  t[0] = ka * fma(r, ax, -(sign * la * ay));
  t[1] = ka * fma(r, ay, sign * la * ax);
  t[2] = kb * fma(r, bx, sign * lb * by);
  t[3] = kb * fma(r, by, -(sign * lb * bx));
  return abs(turn) - atan2(la, r) - atan2(lb, r);
}

/// The string must pass through the circle: it touches it at the angle psi from a, 0 < psi < turn, where |a - p| + |p - b| is least:
///   g(psi) = A r sin(psi) / |a - p| - B r sin(turn - psi) / |b - p| = 0,
/// monotonic where both ends see p. Newton steps, kept inside of a bracket. `turn` is positive.
template <class T>
KOKKOS_INLINE_FUNCTION T lanes_wrap_inside(T A, T B, T r, T turn) {
  T lo = max(T(0), turn - atan2(sqrt(max(B * B - r * r, T(0))), r)), hi = min(turn, atan2(sqrt(max(A * A - r * r, T(0))), r));
  T psi = T(0.5) * (lo + hi);
  auto const side = [&](T length, T angle, T& g, T& slope) {
    T s, c;
    sincos(angle, s, c);
    T const d = sqrt(max(fma(length, length, r * r) - T(2) * length * r * c, T(1e-30))), e = length * r / d;
    g = e * s;
    slope = e * c - square(e * s) / d;
  };
  constexpr int most = sizeof(real_t<T>) == 4 ? 24 : 48;
  auto settled = T(1) < T(0);  // such a lane waits for the others, and keeps its bits
  for (int i = 0; i < most; ++i) {
    T ga, gb, sa, sb;
    side(A, psi, ga, sa);
    side(B, turn - psi, gb, sb);
    T const g = ga - gb, slope = sa + sb;
    auto const right = g > T(0);  // the minimum is on the left
    hi = select(right, psi, hi);
    lo = select(right, lo, psi);
    T const newton = psi - g / select(abs(slope) > T(1e-30), slope, T(1));
    auto const good = (newton >= lo) && (newton <= hi);
    T const next = select(good, newton, T(0.5) * (lo + hi));
    T const change = abs(next - psi);
    psi = select(settled, psi, next);
    settled = settled || (change <= T(sizeof(real_t<T>) == 4 ? 1e-7 : 4e-16));
    if (all(settled)) break;
  }
  return psi;
}

/// x0, x1 and the sidesite `s` in the geom's frame; the results too. Without sidesite the string goes round on the shorter side, and only
/// where its straight line would cross the geom. With one it goes round as the line x0, s, x1 does (MuJoCo 4.0); a sidesite inside of the
/// geom means that it must pass through it.
template <class T>
KOKKOS_INLINE_FUNCTION auto lanes_wrap(Vec3<T> const& x0, Vec3<T> const& x1, T r, bool sphere, bool has_side, Vec3<T> const& s) {
  T const small(1e-15);
  Vec3<T> u{T(1), T(0), T(0)}, v{T(0), T(1), T(0)};  // axes of the plane
  auto usable = (norm(x0) >= small) && (norm(x1) >= small) && (r >= small);
  if (sphere) {
    u = normalized(x0);
    Vec3<T> n = cross(x0, x1);
    auto const parallel = norm(n) < small;
    if (any(parallel)) {  // any plane does: cross u with (1, 1, 1), 0 where u is largest
      auto const y = (abs(u.y) > abs(u.x)) && (abs(u.y) > abs(u.z)), z = (abs(u.z) > abs(u.x)) && (abs(u.z) > abs(u.y));
      Vec3<T> const other{select(y, T(1), select(z, T(1), T(0))), select(y, T(0), T(1)), select(z, T(0), T(1))};
      n = select(parallel, cross(u, other), n);
    }
    v = normalized(cross(normalized(n), u));
  }
  T const ax = dot(x0, u), ay = dot(x0, v), bx = dot(x1, u), by = dot(x1, v);
  T const aa = fma(ax, ax, ay * ay), bb = fma(bx, bx, by * by), dx = bx - ax, dy = by - ay, dd = fma(dx, dx, dy * dy);
  usable = usable && (aa >= r * r) && (bb >= r * r);
  T turn, t[4];
  if (has_side) {
    T sx = dot(s, u), sy = dot(s, v);
    auto const tiny = fma(sx, sx, sy * sy) < small * small;
    sx = select(tiny, T(1), sx);
    sy = select(tiny, T(0), sy);
    turn = atan2(fma(ax, sy, -(ay * sx)), fma(ax, sx, ay * sy)) + atan2(fma(sx, by, -(sy * bx)), fma(sx, bx, sy * by));
  } else {
    turn = atan2(fma(ax, by, -(ay * bx)), fma(ax, bx, ay * by));
  }
  T const arc = lanes_wrap_outside(ax, ay, bx, by, r, turn, t);
  auto wrapped = usable && (arc > T(0)) && (dd >= small);
  T length = r * arc;
  if (has_side) {
    auto const inside = norm(s) < r;
    if (any(inside)) {
      T const A = sqrt(aa), B = sqrt(bb), full = atan2(fma(ax, by, -(ay * bx)), fma(ax, bx, ay * by));
      T const along = clamp(-fma(dx, ax, dy * ay) / max(dd, small), T(0), T(1));
      T const px = fma(along, dx, ax), py = fma(along, dy, ay);
      auto const crosses = (fma(px, px, py * py) <= r * r) && (dd > small);
      T const psi = lanes_wrap_inside(A, B, r, abs(full)) * select(full < T(0), T(-1), T(1));
      T sine, cosine;
      sincos(psi, sine, cosine);
      T const k = r / max(A, small), tx = k * fma(cosine, ax, -(sine * ay)), ty = k * fma(sine, ax, cosine * ay);
      t[0] = select(inside, tx, t[0]);
      t[1] = select(inside, ty, t[1]);
      t[2] = select(inside, tx, t[2]);
      t[3] = select(inside, ty, t[3]);
      length = select(inside, T(0), length);
      auto const inner = inside && usable && !crosses && (A > r) && (B > r), outer = wrapped && !inside;
      wrapped = inner || outer;
    }
  }
  Vec3<T> t0 = t[0] * u + t[1] * v, t1 = t[2] * u + t[3] * v;
  if (!sphere) {  // the string is straight on the unrolled cylinder
    auto const flat = [](T x, T y) { return sqrt(fma(x, x, y * y)); };
    T const l0 = flat(ax - t[0], ay - t[1]), l1 = flat(bx - t[2], by - t[3]), rise = (x1.z - x0.z) / max(l0 + length + l1, small);
    t0.z = fma(rise, l0, x0.z);
    t1.z = fma(rise, l0 + length, x0.z);
    length = flat(length, t1.z - t0.z);
  }
  return LanesWrap<T, decltype(wrapped)>{wrapped, t0, t1, length};
}

}  // namespace gsp::detail
