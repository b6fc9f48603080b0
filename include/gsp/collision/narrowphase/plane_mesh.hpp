#pragma once
#include <gsp/collision/detail/convex_shape.hpp>

namespace gsp {

/// Plane a, hull of mesh b: its lowest vertex, and up to three more within the margin that spread farthest: the one farthest from it along
/// the plane, the one that spans the largest triangle with both, the one that adds most on the other side. Ties go to the first, and what
/// adds no more than rounding is left; feature = number in the hull's list. Cost: apart one search along the hull's edges, else three
/// passes over its vertices.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void plane_mesh(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  ShapeAsset<T> const& mesh = *b.asset;
  Vec3<T> const n = column(a.R, 2);
  Vec3<T> const up = transpose_times(b.R, n);  // all else in the mesh's frame
  T const height = dot(n, b.p - a.p);
  auto const add = [&](int i) {
    Vec3<T> const q = mesh.vertices[mesh.hull[i]];
    T const dist = height + dot(up, q);
    out.add(b.p + b.R * q - T(0.5) * dist * n, dist, n, i);
  };
  int lowest = 0;
  Vec3<T> const deepest = detail::hull_support(mesh, -up, lowest);
  if (!(height + dot(up, deepest) <= margin)) return;
  add(lowest);
  Vec3<T> corner[3] = {deepest, deepest, deepest};
  int taken[3] = {lowest, lowest, lowest};
  T const least = (sizeof(T) == 4 ? T(2e-6) : T(1e-12)) * dot(b.size, b.size);  // below, what they span is rounding
  for (int k = 1; k < 4; ++k) {
    int best = -1;
    T most(0);
    for (int i = 0; i < mesh.hull_count; ++i) {
      Vec3<T> const q = mesh.vertices[mesh.hull[i]];
      if (!(height + dot(up, q) <= margin) || i == taken[0] || i == taken[1] || i == taken[2]) continue;
      T score;
      if (k == 1) {
        Vec3<T> const d = cross(up, q - corner[0]);
        score = dot(d, d);
      } else if (k == 2) {
        score = abs(dot(up, cross(corner[1] - corner[0], q - corner[0])));
      } else {  // its triangle over the edge that it lies outside of; corners counter-clockwise about the normal
        T const ab = dot(up, cross(corner[1] - corner[0], q - corner[0]));
        T const bc = dot(up, cross(corner[2] - corner[1], q - corner[1]));
        T const ca = dot(up, cross(corner[0] - corner[2], q - corner[2]));
        score = max(max(-ab, -bc), -ca);
      }
      if (score > most) {
        most = score;
        best = i;
      }
    }
    if (best < 0 || !(most > least)) return;
    add(best);
    if (k < 3) taken[k] = best;
    Vec3<T> const q = mesh.vertices[mesh.hull[best]];
    if (k < 3) corner[k] = q;
    if (k == 2 && dot(up, cross(corner[1] - corner[0], corner[2] - corner[0])) < T(0)) {
      corner[2] = corner[1];
      corner[1] = q;
    }
  }
}

}  // namespace gsp
