#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>

/// Convex polygons cut by half planes (Sutherland and Hodgman, 1974): faces of boxes, and patches of any two shapes.
namespace gsp::detail {

/// A polygon of at most `most_` corners in the plane x, y; z goes along. A corner carries the number of the edge that starts there, so that
/// (edge before, edge after) names it for as long as it exists.
template <class T, int most_>
struct ClipPolygon {
  static constexpr int most = most_;
  T x[most], y[most], z[most];
  std::uint8_t edge[most];
  int count = 0;
  KOKKOS_INLINE_FUNCTION void push(T px, T py, T pz, int e) {
    if (count == most) return;
    x[count] = px;
    y[count] = py;
    z[count] = pz;
    edge[count] = std::uint8_t(e);
    ++count;
  }
};

/// What is left of `p` where over(corner) <= 0; over is linear in x and y. A convex polygon gains at most one corner.
/// @param plane  number of the new edge
template <class T, int most, class Over>
KOKKOS_INLINE_FUNCTION void clip_polygon(ClipPolygon<T, most>& p, Over const& over, int plane) {
  bool whole = true;
  for (int i = 0; i < p.count; ++i) whole = whole && !(over(i) > T(0));
  if (whole) return;
  ClipPolygon<T, most> r;
  for (int i = 0; i < p.count; ++i) {
    int const j = i + 1 == p.count ? 0 : i + 1;
    T const a = over(i), b = over(j);
    if (a <= T(0)) r.push(p.x[i], p.y[i], p.z[i], a == T(0) && b > T(0) ? plane : p.edge[i]);
    if ((a < T(0) && b > T(0)) || (a > T(0) && b < T(0))) {
      T const t = a / (a - b);
      r.push(p.x[i] + t * (p.x[j] - p.x[i]), p.y[i] + t * (p.y[j] - p.y[i]), p.z[i] + t * (p.z[j] - p.z[i]), a < T(0) ? plane : p.edge[i]);
    }
  }
  p = r;
}

}  // namespace gsp::detail
