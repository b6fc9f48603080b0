#pragma once
#include <gsp/ray/ray_shapes.hpp>

/// Rays against triangles without gaps: a ray that passes between two triangles with a common edge meets one of them, in any precision.
/// (Woop, Benthin and Wald, Watertight ray/triangle intersection, JCGT 2013.)
namespace gsp::detail {

/// a b - c d, within 1.5 units in the last place, so with the right sign, where nothing underflows and fma rounds once (Kahan's; Jeannerod,
/// Louvet and Muller, Math. Comp. 2013). Of two triangles with a common edge one finds what the other does but for the sign and the last
/// digits; with one product rounded and the other not, as compilers fuse them, both signs could be the same.
template <class T>
GSP_FUNCTION T difference_of_products(T a, T b, T c, T d) {
  T const cd = c * d, lost = fma(-c, d, cd);
  return fma(a, b, -cd) + lost;
}

/// (b - a) x (c - a) as a unit vector, whatever the triangle's size; 0 where it has no area.
template <class T, class V>
GSP_FUNCTION Vec3<T> triangle_normal(Vec3<V> const& a, Vec3<V> const& b, Vec3<V> const& c) {
  auto const edge = [&](Vec3<V> const& to) { return Vec3<T>{T(to.x) - T(a.x), T(to.y) - T(a.y), T(to.z) - T(a.z)}; };
  auto const scaled = [](Vec3<T> const& v) {
    T const most = largest(v);
    return select(most > T(0), (T(1) / most) * v, v);
  };
  Vec3<T> const n = scaled(cross(scaled(edge(b)), scaled(edge(c))));
  T const length = norm(n);
  return select(length > T(0), (T(1) / length) * n, n);
}

/// What all triangles of a mesh need of a scaled ray: axes such that the direction is the third, sheared to (0, 0, 1).
template <class T>
struct TriangleRay {
  using Mask = decltype(T(0) < T(0));
  Vec3<T> origin;
  Mask by_x, by_y;  // the third axis is x, or y
  T sx, sy, sz;
  GSP_FUNCTION explicit TriangleRay(Ray<T> const& ray) : origin(ray.origin) {
    T const x = abs(ray.direction.x), y = abs(ray.direction.y), z = abs(ray.direction.z);
    by_x = x > y && x > z;
    by_y = !(x > y) && y > z;
    Vec3<T> const d = turned(ray.direction);
    sz = T(1) / d.z;
    sx = d.x * sz;
    sy = d.y * sz;
  }
  /// x of the hit, infinity where there is none. Both sides count, and so do edges.
  template <class V>
  GSP_FUNCTION T hit(Vec3<V> const& a, Vec3<V> const& b, Vec3<V> const& c) const {
    Vec3<T> const A = sheared(a), B = sheared(b), C = sheared(c);
    T const u = difference_of_products(C.x, B.y, C.y, B.x), v = difference_of_products(A.x, C.y, A.y, C.x),
            w = difference_of_products(B.x, A.y, B.y, A.x);
    auto const inside = (u >= T(0) && v >= T(0) && w >= T(0)) || (u <= T(0) && v <= T(0) && w <= T(0));
    T const det = u + v + w;
    auto const met = inside && det != T(0);
    if (!any(met)) return no_hit<T>();
    T const x = fma(u, A.z, fma(v, B.z, w * C.z)) / det;
    return select(met && x >= T(0), x, no_hit<T>());
  }

 private:
  template <class V>
  GSP_FUNCTION Vec3<T> sheared(Vec3<V> const& p) const {
    Vec3<T> const r = turned(Vec3<T>{T(p.x), T(p.y), T(p.z)} - origin);
    return {fma(-sx, r.z, r.x), fma(-sy, r.z, r.y), sz * r.z};
  }
  /// Axes in turn, so that the third is the ray's.
  GSP_FUNCTION Vec3<T> turned(Vec3<T> const& r) const {
    return {select(by_x, r.y, select(by_y, r.z, r.x)), select(by_x, r.z, select(by_y, r.x, r.y)),
            select(by_x, r.x, select(by_y, r.y, r.z))};
  }
};

}  // namespace gsp::detail
