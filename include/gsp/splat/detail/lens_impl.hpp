#pragma once
#include <array>
#include <cmath>
#include <gsp/core/check.hpp>
#include <gsp/splat/lens.hpp>
#include <limits>
#include <string>

/// Of gsp/splat/lens.hpp, where the contract stands.
namespace gsp {

namespace detail {

/// s, b and d(s r)/dr of a radius squared.
template <class T>
struct RadialLens {
  T s, bend, along;
};
template <class T>
GSP_FUNCTION RadialLens<T> radial_lens(Lens const& lens, T const& q) {
  using R = real_t<T>;
  auto const k = [&](int i) { return T(R(lens.k[i])); };
  T const one(R(1));
  if (lens.model == Lens::Model::fisheye) {
    T const r = sqrt(q), angle = atan2(r, one), a = angle * angle;
    T const own = angle * (one + a * (k(0) + a * (k(1) + a * (k(2) + a * k(3)))));
    T const slope = (one + a * (T(R(3)) * k(0) + a * (T(R(5)) * k(1) + a * (T(R(7)) * k(2) + a * (T(R(9)) * k(3)))))) / (one + q);
    auto const aside = q > T(R(1e-12));  // on the axis s = 1, and b counts for nothing
    T const s = select(aside, own / r, one);
    return {s, select(aside, (slope - s) / q, T(R(0))), slope};
  }
  T const above = one + q * (k(0) + q * (k(1) + q * k(2))), inverse = one / (one + q * (k(3) + q * (k(4) + q * k(5))));
  T const above_slope = k(0) + q * (T(R(2)) * k(1) + q * (T(R(3)) * k(2))),
          below_slope = k(3) + q * (T(R(2)) * k(4) + q * (T(R(3)) * k(5))), s = above * inverse;
  T const bend = T(R(2)) * (above_slope - s * below_slope) * inverse;
  return {s, bend, s + q * bend};
}

/// Is J positive definite on the circle of radius r? With A = d(s r)/dr, B = s, t = |p| r and the angle c from the direction of (p2, p1),
/// in the axes along and across the radius
///   J = (A + 6 t cos c, 2 t sin c; ., B + 2 t cos c),   det J = A B - 4 t^2 + (2 A + 6 B) t cos c + 16 t^2 cos^2 c,
/// least at cos c = -(A + 3 B) / (16 t), or at -1 where that is below it.
inline bool definite(Lens const& lens, double r) {
  auto const f = radial_lens(lens, r * r);
  double const A = f.along, B = f.s, t = std::hypot(lens.p1, lens.p2) * r, sum = A + 3 * B;
  return A > 6 * t && B > 2 * t && (sum >= 16 * t || A * B - 4 * t * t > sum * sum / 16);
}

/// Bounds of a polynomial in x on 0 <= low <= x <= high.
template <std::size_t n>
double most_of(std::array<double, n> const& c, double low, double high) {
  double sum = 0, a = 1, b = 1;
  for (double const x : c) {
    sum += x * (x > 0 ? b : a);
    a *= low;
    b *= high;
  }
  return sum;
}
template <std::size_t n>
double least_of(std::array<double, n> c, double low, double high) {
  for (double& x : c) x = -x;
  return -most_of(c, low, high);
}

/// Bounds of s and of A = d(s r)/dr where atan r is between two angles.
struct LensBounds {
  double most_s, most, least;
};
inline LensBounds lens_bounds(Lens const& lens, double low, double high) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  double const* const k = lens.k;
  if (lens.model == Lens::Model::fisheye) {
    std::array<double, 5> const own{1, k[0], k[1], k[2], k[3]}, slope{1, 3 * k[0], 5 * k[1], 7 * k[2], 9 * k[3]};
    double const a = low * low, b = high * high, near = std::cos(low), far = std::cos(high);  // dr = da / cos^2 a
    return {most_of(own, a, b) * (low > 0 ? low / std::tan(low) : 1), most_of(slope, a, b) * near * near,
            std::max(0., least_of(slope, a, b)) * far * far};
  }
  // N / D, and P / D^2 with P = N D + 2 r^2 (N' D - N D')
  std::array<double, 4> const N{1, k[0], k[1], k[2]}, D{1, k[3], k[4], k[5]};
  std::array<double, 7> P{};
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < 4; ++j) P[i + j] += (1 + 2 * (double(i) - double(j))) * N[i] * D[j];
  double const r0 = std::tan(low), r1 = std::tan(high), q0 = r0 * r0, q1 = r1 * r1, least_D = least_of(D, q0, q1),
               most_D = most_of(D, q0, q1), s = most_of(N, q0, q1) / least_D, most = most_of(P, q0, q1) / (least_D * least_D),
               least = least_of(P, q0, q1) / (most_D * most_D);
  if (!(least_D > 0) || !std::isfinite(s + most)) return {infinity, infinity, 0};
  return {s, most, least > 0 ? least : 0};
}

/// Fills in where the lens is valid, and its bounds.
inline Lens measured(Lens lens) {
  constexpr double infinity = std::numeric_limits<double>::infinity(), half_turn = 1.57079632679489661923;
  // the radii that are looked at: 0.02 degrees apart, then so far that their squares are the largest floats; then between the last two
  double good = 0, bad = 0;
  auto const look = [&](double r) { (definite(lens, r) ? good : bad) = r; };
  constexpr int angles = 4096;
  for (int i = 1; i < angles && bad == 0; ++i) look(std::tan(half_turn * i / angles));
  while (bad == 0 && good < 1e18) look(1.05 * good);
  for (int i = 0; i < 60 && bad > 0; ++i) look(0.5 * (good + bad));
  lens.valid = bad > 0 ? good : infinity;

  double const p = std::hypot(lens.p1, lens.p2), end = std::atan(lens.valid);
  constexpr int parts = 8;  // of a ring
  double stretch = 1, reach = 1;
  std::array<double, Lens::rings + 1> within{};  // A - 6 |p| r at least, between ring i - 1 and i
  for (int i = 0; i <= Lens::rings; ++i) {
    within[i] = infinity;
    for (int j = 0; i > 0 && j < parts; ++j) {
      double const step = half_turn / Lens::rings / parts, low = ((i - 1) * parts + j) * step, high = std::min(low + step, end);
      if (low >= end) break;
      auto const b = lens_bounds(lens, low, high);
      double const r = high >= half_turn * (1 - 1e-12) ? infinity : std::tan(high), off = p > 0 ? 6 * p * r : 0;
      // A = O(1 / r^2) of a fisheye
      double const far = lens.model == Lens::Model::fisheye ? b.most / std::cos(low) : b.most * std::sqrt(1 + r * r);
      stretch = std::max(stretch, std::max(b.most_s, b.most) + off);
      reach = std::max(reach, std::max(b.most_s, far) + off * std::sqrt(1 + r * r));
      within[i] = std::min(within[i], std::max(0., b.least - off));
    }
    lens.stretch[i] = static_cast<float>(1.001 * stretch);
    lens.reach[i] = static_cast<float>(1.001 * reach);
  }
  double least = infinity;
  for (int i = Lens::rings; i >= 0; --i) {
    lens.grows[i] = static_cast<float>(0.999 * std::min(least, 1e30));
    least = std::min(least, within[i]);
  }
  return lens;
}
inline void check_coefficients(std::string const& function, std::vector<double> const& coefficients) {
  for (std::size_t i = 0; i < coefficients.size(); ++i)
    expects(std::isfinite(coefficients[i]),
            function + ": coefficient " + std::to_string(i) + " is not finite: give those of a calibration");
}

}  // namespace detail

inline Lens opencv_lens(std::vector<double> const& coefficients) {
  std::size_t const n = coefficients.size();
  expects(n == 4 || n == 5 || n == 8, "gsp::opencv_lens: there are " + std::to_string(n) +
                                          " coefficients: give 4, 5 or 8, k1 k2 p1 p2 k3 k4 k5 k6 (thin prisms and a tilted sensor are "
                                          "not drawn)");
  detail::check_coefficients("gsp::opencv_lens", coefficients);
  Lens lens;
  lens.k[0] = coefficients[0];
  lens.k[1] = coefficients[1];
  lens.p1 = coefficients[2];
  lens.p2 = coefficients[3];
  for (std::size_t i = 4; i < n; ++i) lens.k[i - 2] = coefficients[i];
  return detail::measured(lens);
}

inline Lens fisheye_lens(std::vector<double> const& coefficients) {
  expects(coefficients.size() == 4,
          "gsp::fisheye_lens: there are " + std::to_string(coefficients.size()) + " coefficients: give 4, k1 k2 k3 k4");
  detail::check_coefficients("gsp::fisheye_lens", coefficients);
  Lens lens;
  lens.model = Lens::Model::fisheye;
  for (std::size_t i = 0; i < 4; ++i) lens.k[i] = coefficients[i];
  return detail::measured(lens);
}

template <class T>
GSP_FUNCTION LensPoint<T> distorted(Lens const& lens, T const& x, T const& y) {
  using R = real_t<T>;
  T const xx = x * x, yy = y * y, xy = x * y, q = xx + yy, two(R(2)), p1(R(lens.p1)), p2(R(lens.p2));
  T const s = detail::radial_lens(lens, q).s;
  return {x * s + (two * p1 * xy + p2 * (q + two * xx)), y * s + (p1 * (q + two * yy) + two * p2 * xy)};
}

template <class T>
GSP_FUNCTION LensSlope<T> distortion_slope(Lens const& lens, T const& x, T const& y) {
  using R = real_t<T>;
  auto const f = detail::radial_lens(lens, x * x + y * y);
  T const p1(R(2 * lens.p1)), p2(R(2 * lens.p2)), three(R(3));
  return {f.s + (f.bend * x * x + (p1 * y + three * p2 * x)), f.bend * x * y + (p1 * x + p2 * y),
          f.s + (f.bend * y * y + (three * p1 * y + p2 * x))};
}

GSP_FUNCTION bool undistorted(Lens const& lens, double u, double v, LensPoint<double>& ray) {
  double const far = std::sqrt(u * u + v * v), widest = Lens::widest, edge = lens.valid < widest ? lens.valid : widest;
  double low = 0, high = edge, r = far < edge ? far : edge;
  if (detail::radial_lens(lens, edge * edge).s * edge < far) {
    r = edge;
  } else {
    // s r grows with r. Beside poles Newton's steps only double, past bends they come round again: then the bracket is halved
    double before = 1e300;
    for (int i = 0; i < 200; ++i) {
      auto const f = detail::radial_lens(lens, r * r);
      double const off = f.s * r - far, size = std::fabs(off);
      if (size <= 1e-13 * far) break;  // the rest is for both together
      (off < 0 ? low : high) = r;
      double next = r - off / f.along;
      if (!(next > low && next < high && size < 0.25 * before)) next = 0.5 * (low + high);
      if (!(next > low && next < high)) break;
      before = size;
      r = next;
    }
  }
  double const share = far > 0 ? r / far : 0;
  ray = {u * share, v * share};
  if (!(far > 0)) return far == 0;
  auto const error_of = [&](LensPoint<double> const& at, double& ex, double& ey) {
    auto const is = distorted(lens, at.x, at.y);
    ex = u - is.x;
    ey = v - is.y;
    return std::sqrt(ex * ex + ey * ey);
  };
  double ex, ey, error = error_of(ray, ex, ey);
  for (int i = 0; i < 100 && error > 1e-15 * far; ++i) {
    auto const j = distortion_slope(lens, ray.x, ray.y);
    double const det = j.xx * j.yy - j.xy * j.xy, dx = (j.yy * ex - j.xy * ey) / det, dy = (j.xx * ey - j.xy * ex) / det;
    // along the step the error falls at first: a part of it that is short enough does better
    bool better = false;
    for (double part = 1; part > 1e-9 && !better; part *= 0.5) {
      LensPoint<double> next{ray.x + part * dx, ray.y + part * dy};
      double const radius = std::sqrt(next.x * next.x + next.y * next.y);
      if (!(radius < 1e300)) break;  // J has no inverse
      if (radius > edge) next = {next.x * (edge / radius), next.y * (edge / radius)};
      if (next.x == ray.x && next.y == ray.y) break;
      double fx, fy;
      double const now = error_of(next, fx, fy);
      better = now < error;
      if (!better) continue;
      ray = next;
      error = now;
      ex = fx;
      ey = fy;
    }
    if (!better) break;
  }
  return error <= 1e-9 * (1 + far);
}

}  // namespace gsp
