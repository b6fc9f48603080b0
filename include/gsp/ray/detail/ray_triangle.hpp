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
    return most > T(0) ? (T(1) / most) * v : v;
  };
  Vec3<T> const n = scaled(cross(scaled(edge(b)), scaled(edge(c))));
  T const length = norm(n);
  return length > T(0) ? (T(1) / length) * n : n;
}

/// What all triangles of a mesh need of a scaled ray: axes such that the direction is the third, sheared to (0, 0, 1).
template <class T>
struct TriangleRay {
  Vec3<T> origin;
  int kx, ky, kz;
  T sx, sy, sz;
  GSP_FUNCTION explicit TriangleRay(Ray<T> const& ray) : origin(ray.origin) {
    Vec3<T> const& d = ray.direction;
    kz = abs(d.x) > abs(d.y) ? (abs(d.x) > abs(d.z) ? 0 : 2) : (abs(d.y) > abs(d.z) ? 1 : 2);
    kx = kz == 2 ? 0 : kz + 1;
    ky = kx == 2 ? 0 : kx + 1;
    sz = T(1) / d[kz];
    sx = d[kx] * sz;
    sy = d[ky] * sz;
  }
  /// x of the hit, infinity where there is none. Both sides count, and so do edges.
  template <class V>
  GSP_FUNCTION T hit(Vec3<V> const& a, Vec3<V> const& b, Vec3<V> const& c) const {
    Vec3<T> const A = sheared(a), B = sheared(b), C = sheared(c);
    T const u = difference_of_products(C.x, B.y, C.y, B.x), v = difference_of_products(A.x, C.y, A.y, C.x),
            w = difference_of_products(B.x, A.y, B.y, A.x);
    bool const inside = (u >= T(0) && v >= T(0) && w >= T(0)) || (u <= T(0) && v <= T(0) && w <= T(0));
    T const det = u + v + w;
    if (!inside || !(det != T(0))) return no_hit<T>();
    T const x = fma(u, A.z, fma(v, B.z, w * C.z)) / det;
    return x >= T(0) ? x : no_hit<T>();
  }

 private:
  template <class V>
  GSP_FUNCTION Vec3<T> sheared(Vec3<V> const& p) const {
    Vec3<T> const r = Vec3<T>{T(p.x), T(p.y), T(p.z)} - origin;
    return {fma(-sx, r[kz], r[kx]), fma(-sy, r[kz], r[ky]), sz * r[kz]};
  }
};

}  // namespace gsp::detail
