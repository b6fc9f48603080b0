#pragma once
#include <gsp/collision/shapes.hpp>

namespace gsp {

/// Moves the (at most) four points that support best to the front of `point` and returns how many there are: the deepest; the one farthest
/// from it; the one that spans the largest triangle with those two; the one that adds most area on the other side. Of points that differ by
/// less than 1e-6 of their spread in depth (float: 3e-6) the outermost is the deepest (edges of two boxes in line cross anywhere along
/// themselves, which is no corner to stand on), and of points that differ by less than 1e-3 in what they span the first is taken, so that
/// rounding does not choose; no point is changed, so that features stay what they are. `count` points with one common normal. Cost 5 passes
/// over the points.
template <class T>
KOKKOS_INLINE_FUNCTION int reduce_points(ContactPoint<T>* point, int count) {
  if (count <= 4) return count;
  auto const take = [&](int place, T share, auto const& score) {
    int best = place;
    T most = score(point[place]);
    for (int i = place + 1; i < count; ++i) {
      T const s = score(point[i]);
      if (s - share * abs(s) > most) {
        most = s;
        best = i;
      }
    }
    ContactPoint<T> const p = point[best];
    point[best] = point[place];
    point[place] = p;
    return most;
  };
  T const equal(1e-3), level = (sizeof(T) == 4 ? T(3e-6) : T(1e-6)) * norm(point[count / 2].pos - point[0].pos);
  T least = point[0].dist;
  Vec3<T> sum = point[0].pos;
  for (int i = 1; i < count; ++i) {
    least = min(least, point[i].dist);
    sum = sum + point[i].pos;
  }
  Vec3<T> const middle = (T(1) / T(count)) * sum;
  take(0, equal, [&](ContactPoint<T> const& p) {
    Vec3<T> const d = p.pos - middle;
    return p.dist > least + level ? T(-1) : dot(d, d);
  });
  Vec3<T> const n = point[0].normal, a = point[0].pos;
  take(1, equal, [&](ContactPoint<T> const& p) {
    Vec3<T> const d = p.pos - a;
    return dot(d, d);
  });
  Vec3<T> const b = point[1].pos;
  auto const area = [&](Vec3<T> const& p, Vec3<T> const& q, Vec3<T> const& r) { return dot(n, cross(q - p, r - p)); };
  take(2, equal, [&](ContactPoint<T> const& p) { return abs(area(a, b, p.pos)); });
  Vec3<T> c = point[2].pos;
  // the triangle a b c counter-clockwise about n: what a point outside an edge adds is its triangle over that edge
  bool const turned = area(a, b, c) < T(0);
  Vec3<T> const p0 = a, p1 = turned ? c : b, p2 = turned ? b : c;
  T const gain =
      take(3, equal, [&](ContactPoint<T> const& p) { return max(max(-area(p0, p1, p.pos), -area(p1, p2, p.pos)), -area(p2, p0, p.pos)); });
  return gain > T(0) ? 4 : 3;
}

}  // namespace gsp
