#pragma once
#include <cmath>
#include <cstring>
#include <gsp/geometry/shape.hpp>
#include <gsp/math/pack.hpp>
#include <limits>

/// Rays against the shapes that have a closed form, in the frame of the shape: sphere, capsule, ellipsoid, cylinder, box and plane. A ray
/// is o + x d, x >= 0; d need not be a unit vector, x counts in its lengths, as in MuJoCo's mj_ray. `detail` takes packs of rays, too.
/// No Kokkos.
namespace gsp {

template <class T>
struct Ray {
  Vec3<T> origin, direction;
  GSP_FUNCTION Vec3<T> at(T x) const { return fma(x, direction, origin); }
};

namespace detail {
// As constants of the host: device code may not call what numeric_limits has.
template <class R>
inline constexpr R infinity_of = std::numeric_limits<R>::infinity();
template <class R>
inline constexpr R epsilon_of = std::numeric_limits<R>::epsilon();
template <class T>
GSP_FUNCTION constexpr T no_hit() {
  return infinity_of<real_t<T>>;
}
/// So many roundings of 1.
template <class T>
GSP_FUNCTION constexpr T roundings(int count) {
  return real_t<T>(count) * epsilon_of<real_t<T>>;
}
template <class T>
GSP_FUNCTION T largest(Vec3<T> const& v) {
  return max(abs(v.x), max(abs(v.y), abs(v.z)));
}
/// Whether all numbers are finite, and the direction is not 0.
template <class T>
GSP_FUNCTION auto is_ray(Ray<T> const& ray) {
  Vec3<T> const &o = ray.origin, &d = ray.direction;
  T const none = (o.x - o.x) + (o.y - o.y) + (o.z - o.z) + (d.x - d.x) + (d.y - d.y) + (d.z - d.z);
  return none == T(0) && largest(d) > T(0);
}
/// The power of two that takes x > 0 to 1/2 to 1; where there is none, near the ends of what numbers there are, as near to it as they go.
template <class T>
GSP_FUNCTION T power_that_scales(T x) {
  constexpr int most = std::numeric_limits<real_t<T>>::max_exponent - 2;
  if constexpr (Scalar<T>) {
    int exponent = 0;
    std::frexp(x, &exponent);
    return std::ldexp(T(1), exponent < -most ? most : exponent > most ? -most : -exponent);
  } else {  // the same by the bits of the exponent, lane by lane
    using Real = real_t<T>;
    using Int = std::conditional_t<sizeof(Real) == 4, std::int32_t, std::int64_t>;
    constexpr int digits = std::numeric_limits<Real>::digits - 1;
    Int bits[T::width];
    std::memcpy(bits, &x, sizeof x);
    for (Int& b : bits) {
      Int const power = 2 * (most + 1) - 1 - (b >> digits);
      b = (power < 1 ? Int(1) : power) << digits;
    }
    std::memcpy(&x, bits, sizeof x);
    return x;
  }
}
/// A ray's direction times a power of two, so that its largest component lies in 1/2 to 1: squares and inverses stay numbers, and what is
/// small is small beside 1. All functions of `detail` take such rays.
template <class T>
struct ScaledRay {
  Ray<T> ray;
  T scale;
  GSP_FUNCTION explicit ScaledRay(Ray<T> const& from) : ray(from), scale(power_that_scales(largest(from.direction))) {
    ray.direction = scale * ray.direction;
  }
  /// x in lengths of the direction that was given.
  GSP_FUNCTION T back(T x) const { return scale * x; }
};

/// The part of a line that is inside of a convex shape: from x = in to out, none where in > out.
template <class T>
struct RayInterval {
  T in = no_hit<T>(), out = -no_hit<T>();
  GSP_FUNCTION static RayInterval all() { return {-no_hit<T>(), no_hit<T>()}; }
  GSP_FUNCTION auto any() const { return in <= out; }
  /// Where a ray first meets the surface: going in, or going out of what it began in.
  GSP_FUNCTION T first() const {
    T const none = no_hit<T>();
    return select(any(), select(in >= T(0), in, select(out >= T(0), out, none)), none);
  }
  template <class Mask>
  GSP_FUNCTION friend RayInterval select(Mask mask, RayInterval const& a, RayInterval const& b) {
    return {gsp::select(mask, a.in, b.in), gsp::select(mask, a.out, b.out)};
  }
  GSP_FUNCTION RayInterval intersection(RayInterval const& o) const { return {max(in, o.in), min(out, o.out)}; }
  /// The least interval that holds both: of a convex shape of two parts.
  GSP_FUNCTION RayInterval hull(RayInterval const& o) const {
    auto const own = any(), other = o.any();
    return {select(other, select(own, min(in, o.in), o.in), in), select(other, select(own, max(out, o.out), o.out), out)};
  }
};
/// abs(o + x d) <= h along one axis.
template <class T>
GSP_FUNCTION RayInterval<T> ray_slab(T o, T d, T h) {
  T const a = (-h - o) / d, b = (h - o) / d;
  auto const still = d == T(0);
  RayInterval<T> const slab = select(a < b, RayInterval<T>{a, b}, RayInterval<T>{b, a});
  return any(still) ? select(still, select(abs(o) <= h, RayInterval<T>::all(), RayInterval<T>{}), slab) : slab;
}
/// Of a ball of radius r about the origin. The line is looked at from its point nearest to the centre, m = o + t d, |m|^2 + s^2 |d|^2 =
/// r^2: of a ball far away b^2 - 4 a c of the usual form would be a difference of large numbers (5 cm off at 100 m in float). t twice: what
/// is left of m along d says by how much the first was off.
template <class T>
GSP_FUNCTION RayInterval<T> ray_ball(Vec3<T> const& o, Vec3<T> const& d, T r) {
  T const dd = dot(d, d), about = -dot(o, d) / dd, t = about - dot(fma(about, d, o), d) / dd;
  Vec3<T> const m = fma(t, d, o);
  T const rest = fma(r, r, -dot(m, m));
  auto const meets = rest >= T(0);
  if (!any(meets)) return {};
  T const s = sqrt(rest / dd);
  return select(meets, RayInterval<T>{t - s, t + s}, RayInterval<T>{});
}
/// Of an endless cylinder about z. Along its axis: 1e-11 m off at 10 km.
template <class T>
GSP_FUNCTION RayInterval<T> ray_tube(Vec3<T> const& o, Vec3<T> const& d, T r) {
  auto const across = max(abs(d.x), abs(d.y)) > T(1e-15);
  RayInterval<T> const tube = ray_ball(Vec3<T>{o.x, o.y, T(0)}, Vec3<T>{d.x, d.y, T(0)}, r);
  return all(across) ? tube : select(across, tube, select(fma(o.x, o.x, o.y * o.y) <= r * r, RayInterval<T>::all(), RayInterval<T>{}));
}

/// ray_shape of a ray that is scaled.
template <class T>
GSP_FUNCTION T meet_shape(ShapeType type, Vec3<T> const& size, Ray<T> const& ray) {
  Vec3<T> const &o = ray.origin, &d = ray.direction;
  switch (type) {
    case ShapeType::plane: {
      T const x = -o.z / d.z;
      Vec3<T> const p = ray.at(x);
      auto const on = (size.x <= T(0) || abs(p.x) <= size.x) && (size.y <= T(0) || abs(p.y) <= size.y);
      return select(d.z < T(0) && x >= T(0) && on, x, no_hit<T>());
    }
    case ShapeType::sphere:
      return ray_ball(o, d, size.x).first();
    case ShapeType::ellipsoid: {
      Vec3<T> const scale{T(1) / size.x, T(1) / size.y, T(1) / size.z};
      return ray_ball(Vec3<T>{o.x * scale.x, o.y * scale.y, o.z * scale.z}, Vec3<T>{d.x * scale.x, d.y * scale.y, d.z * scale.z}, T(1))
          .first();
    }
    case ShapeType::capsule: {
      Vec3<T> const up{T(0), T(0), size.y};
      auto const side = ray_tube(o, d, size.x).intersection(ray_slab(o.z, d.z, size.y));
      return side.hull(ray_ball(o - up, d, size.x)).hull(ray_ball(o + up, d, size.x)).first();
    }
    case ShapeType::cylinder:
      return ray_tube(o, d, size.x).intersection(ray_slab(o.z, d.z, size.y)).first();
    case ShapeType::box:
      return ray_slab(o.x, d.x, size.x).intersection(ray_slab(o.y, d.y, size.y)).intersection(ray_slab(o.z, d.z, size.z)).first();
    case ShapeType::hfield:
    case ShapeType::mesh:
      break;
  }
  return no_hit<T>();
}
/// Outward unit normal where a scaled ray meets such a shape, at x. A face is known by the slab whose end is x, or nearest to it: of a thin
/// plate far away the point says neither which nor whose side.
template <class T>
GSP_FUNCTION Vec3<T> normal_where_met(ShapeType type, Vec3<T> const& size, Ray<T> const& ray, T x) {
  Vec3<T> const p = ray.at(x), &o = ray.origin, &d = ray.direction;
  Vec3<T> n{T(0), T(0), T(1)};
  T apart = no_hit<T>();
  auto const try_faces = [&](int axis, T half) {
    if (d[axis] == T(0)) return;
    auto const slab = ray_slab(o[axis], d[axis], half);
    bool const goes_in = abs(slab.in - x) <= abs(slab.out - x);  // what is thinner than a rounding is seen from outside
    T const off = goes_in ? abs(slab.in - x) : abs(slab.out - x);
    if (!(off < apart)) return;
    apart = off;
    n = {T(0), T(0), T(0)};
    n[axis] = goes_in == (d[axis] > T(0)) ? T(-1) : T(1);
  };
  switch (type) {
    case ShapeType::sphere:
      return normalized(p);
    case ShapeType::ellipsoid:
      return normalized(Vec3<T>{p.x / square(size.x), p.y / square(size.y), p.z / square(size.z)});
    case ShapeType::capsule:
      return normalized(Vec3<T>{p.x, p.y, p.z - clamp(p.z, -size.y, size.y)});
    case ShapeType::cylinder: {
      try_faces(2, size.y);
      auto const side = ray_tube(o, d, size.x);
      return min(abs(side.in - x), abs(side.out - x)) < apart ? normalized(Vec3<T>{p.x, p.y, T(0)}) : n;
    }
    case ShapeType::box:
      for (int axis = 0; axis < 3; ++axis) try_faces(axis, size[axis]);
      return n;
    case ShapeType::plane:
    case ShapeType::hfield:
    case ShapeType::mesh:
      break;
  }
  return n;
}
}  // namespace detail

/// Where a ray meets a shape: x, infinity where it does not, and the outward unit normal there.
template <class T>
struct ShapeHit {
  T x = detail::no_hit<T>();
  Vec3<T> normal{T(0), T(0), T(0)};
};
/// The nearest x >= 0 at which the ray meets the surface of a shape of these sizes (GeomDescription): of a plane its front alone, within
/// its extent where it has one. NaN, infinity and a direction of 0 miss, and so does all of a mesh or a height field, which need their
/// assets (ray/mesh_tree.hpp, ray/ray_height_field.hpp).
template <class T>
GSP_FUNCTION ShapeHit<T> ray_shape(ShapeType type, Vec3<T> const& size, Ray<T> const& ray) {
  if (!detail::is_ray(ray)) return {};
  detail::ScaledRay<T> const scaled(ray);
  T const x = detail::meet_shape(type, size, scaled.ray);
  if (!(x < detail::no_hit<T>())) return {};
  return {scaled.back(x), detail::normal_where_met(type, size, scaled.ray, x)};
}

}  // namespace gsp
