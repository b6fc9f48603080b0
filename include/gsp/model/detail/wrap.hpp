#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/model/detail/host_math.hpp>
#include <optional>

/// How a tendon goes round a sphere or a cylinder (of endless length), on the host. docs/model/compile.md has the equations.
namespace gsp::detail {

struct Wrap {
  double length;          // along the surface; 0 where the tendon passes inside
  Double3 first, second;  // where it meets and leaves the surface, world frame
};

namespace wrap {
using Double2 = std::array<double, 2>;
inline double dot(Double2 const& a, Double2 const& b) { return a[0] * b[0] + a[1] * b[1]; }
inline double cross(Double2 const& a, Double2 const& b) { return a[0] * b[1] - a[1] * b[0]; }
inline double norm(Double2 const& a) { return std::hypot(a[0], a[1]); }
/// Angle from a to b in (-pi, pi].
inline double angle(Double2 const& a, Double2 const& b) { return std::atan2(cross(a, b), dot(a, b)); }
inline Double2 turned(Double2 const& a, double by, double scale) {
  double const c = std::cos(by) * scale, s = std::sin(by) * scale;
  return {c * a[0] - s * a[1], s * a[0] + c * a[1]};
}

struct Arc {
  double length;
  Double2 first, second;
};
/// Round a circle of radius r at the origin: the shortest path from p to q that winds about the centre like the polyline p, side, q (like
/// the segment, without a side). With the angle t of that winding, the points of contact are acos(r / |p|) and acos(r / |q|) from the ends,
/// and the arc is what is left of |t|; nothing left: the segment is free.
inline std::optional<Arc> outside(Double2 const& p, Double2 const& q, Double2 const* side, double r) {
  double const lp = norm(p), lq = norm(q);
  if (lp < r || lq < r || r < 1e-15) return std::nullopt;
  if (Double2 const d{q[0] - p[0], q[1] - p[1]}; dot(d, d) < 1e-15) return std::nullopt;
  double const t = side ? angle(p, *side) + angle(*side, q) : angle(p, q), sign = t < 0 ? -1 : 1;
  double const ap = std::acos(std::min(1., r / lp)), aq = std::acos(std::min(1., r / lq)), arc = std::abs(t) - ap - aq;
  if (arc < 0) return std::nullopt;
  return Arc{r * arc, turned(p, sign * ap, r / lp), turned(q, -sign * aq, r / lq)};
}
/// Through a ring of radius r from within: the tendon bends at one point of the ring, where both parts make the same angle with it. With
/// z the sine of that angle, asin(z) - asin(z r/|p|) + asin(z) - asin(z r/|q|) = the angle between p and q; z falls from 1 by Newton.
inline std::optional<Arc> inside(Double2 const& p, Double2 const& q, double r) {
  double const lp = norm(p), lq = norm(q);
  Double2 const d{q[0] - p[0], q[1] - p[1]};
  double const dd = dot(d, d);
  if (lp <= r || lq <= r || r < 1e-15) return std::nullopt;
  if (dd > 1e-15)
    if (double const a = -dot(d, p) / dd; a > 0 && a < 1 && norm({p[0] + a * d[0], p[1] + a * d[1]}) <= r) return std::nullopt;
  Double2 middle{p[0] + q[0], p[1] + q[1]};
  double const length = norm(middle);
  Double2 const average = length > 1e-15 ? Double2{r / length * middle[0], r / length * middle[1]} : Double2{r, 0};
  Arc const rough{0, average, average};
  double const a = r / lp, b = r / lq, cosine = (lp * lp + lq * lq - dd) / (2 * lp * lq);
  if (cosine < -1 + 1e-15) return std::nullopt;
  if (cosine > 1 - 1e-15) return rough;
  double const gap = std::acos(cosine);
  auto const f = [&](double z) { return std::asin(a * z) + std::asin(b * z) - 2 * std::asin(z) + gap; };
  double z = 1 - 1e-7, value = f(z);
  if (value > 0) return rough;
  for (int i = 0; i < 50 && std::abs(value) > 1e-15; ++i) {
    double const slope = a / std::sqrt(1 - z * z * a * a) + b / std::sqrt(1 - z * z * b * b) - 2 / std::sqrt(1 - z * z);
    if (slope > -1e-15) return rough;
    double const next = z - value / slope;
    if (!(next < z)) break;
    z = next;
    value = f(z);
  }
  bool const left = cross(p, q) > 0;
  auto const point = left ? turned(p, std::asin(z) - std::asin(a * z), r / lp) : turned(q, std::asin(z) - std::asin(b * z), r / lq);
  return Arc{0, point, point};
}
}  // namespace wrap

/// The tendon from x to y round a sphere or cylinder of `radius` at `pose`; nothing where the straight line is free or an end is inside.
/// `side`: a point that it goes round with; one inside the shape: the tendon passes through it.
inline std::optional<Wrap> wrapped(Double3 const& x, Double3 const& y, Pose const& pose, double radius, bool cylinder,
                                   Double3 const* side) {
  auto const local = [&](Double3 const& p) { return rotate_inverse(pose.q, p - pose.p); };
  Double3 const p = local(x), q = local(y);
  if (norm(p) < 1e-15 || norm(q) < 1e-15) return std::nullopt;
  // the plane: across a cylinder's axis; through a sphere's centre and both ends
  Double3 u{1, 0, 0}, v{0, 1, 0};
  if (!cylinder) {
    u = (1 / norm(p)) * p;
    Double3 normal = cross(p, q);
    if (double const n = norm(normal); n < 1e-15) {
      int largest = 0;
      for (int k = 1; k < 3; ++k)
        if (std::abs(u[k]) > std::abs(u[largest])) largest = k;
      Double3 other{1, 1, 1};
      other[largest] = 0;
      normal = cross(u, other);
    }
    normal = (1 / norm(normal)) * normal;
    v = cross(normal, u);
    v = (1 / norm(v)) * v;
  }
  auto const flat = [&](Double3 const& a) { return wrap::Double2{dot(a, u), dot(a, v)}; };
  auto const p2 = flat(p), q2 = flat(q);
  wrap::Double2 s2{};
  bool through = false;
  if (side) {
    Double3 const s = local(*side);
    through = norm(s) < radius;
    s2 = flat(s);
  }
  auto const arc = through ? wrap::inside(p2, q2, radius) : wrap::outside(p2, q2, side ? &s2 : nullptr, radius);
  if (!arc) return std::nullopt;
  auto const raised = [&](wrap::Double2 const& a) { return a[0] * u + a[1] * v; };
  Wrap result{arc->length, raised(arc->first), raised(arc->second)};
  if (cylinder) {  // a helix: height grows evenly along the path
    double const before = std::hypot(p[0] - result.first[0], p[1] - result.first[1]),
                 after = std::hypot(q[0] - result.second[0], q[1] - result.second[1]), all = before + arc->length + after;
    result.first[2] = p[2] + (q[2] - p[2]) * before / all;
    result.second[2] = p[2] + (q[2] - p[2]) * (before + arc->length) / all;
    result.length = std::hypot(arc->length, result.second[2] - result.first[2]);
  }
  result.first = pose * result.first;
  result.second = pose * result.second;
  return result;
}

}  // namespace gsp::detail
