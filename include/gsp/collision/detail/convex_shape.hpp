#pragma once
#include <gsp/collision/shapes.hpp>
#include <gsp/geometry/shapes.hpp>

/// Shapes as the convex routine sees them: a core, a ball that it is swept with, and the core's farthest point along a direction.
namespace gsp::detail {

/// A sphere is a point and a capsule a segment, swept with a ball of `radius`; the others are their own core. Type hfield stands for one
/// prism of a height field. The frame is the caller's; numbers are best near its origin.
template <class T>
struct ConvexShape {
  ShapeType type;
  Vec3<T> p;
  Mat3<T> R;
  Vec3<T> size;
  ShapeAsset<T> const* asset = nullptr;
  Vec3<T> const* prism = nullptr;  // 6 corners in the shape's frame: three below, then the three above them
  T radius{};                      // [m]
  T extent{};                      // about the size of the core [m]: tolerances are parts of it
  int vertex = 0;                  // of a mesh: where in its hull the next search begins
};

template <class T>
KOKKOS_INLINE_FUNCTION ConvexShape<T> make_convex_shape(ShapeType type, Shape<T> const& s, Vec3<T> const& origin) {
  ConvexShape<T> c{type, s.p - origin, s.R, s.size, s.asset};
  bool const is_round = type == ShapeType::sphere || type == ShapeType::capsule;
  if (is_round) c.radius = s.size.x;
  if (type == ShapeType::capsule) c.extent = s.size.y;
  if (type == ShapeType::cylinder) c.extent = max(s.size.x, s.size.y);
  if (!is_round && type != ShapeType::cylinder) c.extent = max(max(s.size.x, s.size.y), s.size.z);
  return c;
}

/// No polyhedron, point or segment.
KOKKOS_INLINE_FUNCTION bool is_curved_core(ShapeType type) { return type == ShapeType::ellipsoid || type == ShapeType::cylinder; }

/// The vertex of a mesh's hull that lies farthest along d, uphill along the edges from number `at` of the hull: a convex body has no other
/// top. Cost about sqrt(vertices) steps; without faces all vertices.
template <class T>
KOKKOS_INLINE_FUNCTION Vec3<T> hull_support(ShapeAsset<T> const& a, Vec3<T> const& d, int& at) {
  bool const few = a.hull_count <= 16 || a.face_count == 0;
  T most = dot(a.vertices[a.hull[at]], d);
  for (;;) {
    int best = at;
    int const first = few ? 0 : a.neighbor_first[at];
    int const end = few ? a.hull_count : a.neighbor_first[at + 1];
    for (int k = first; k < end; ++k) {
      int const i = few ? k : a.neighbors[k];
      T const along = dot(a.vertices[a.hull[i]], d);
      if (along > most) {
        most = along;
        best = i;
      }
    }
    bool const top = few || best == at;
    at = best;
    if (top) return a.vertices[a.hull[at]];
  }
}

/// The point of the core that lies farthest along d.
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION Vec3<T> core_support(ConvexShape<T>& s, Vec3<T> const& d) {
  Vec3<T> const l = transpose_times(s.R, d);
  ShapeData<T> const data{s.size, s.asset};
  Vec3<T> q{T(0), T(0), T(0)};
  switch (s.type) {
    case ShapeType::capsule:
      q.z = l.z < T(0) ? -s.size.y : s.size.y;
      break;
    case ShapeType::ellipsoid:
      q = EllipsoidShape::support(data, l);
      break;
    case ShapeType::cylinder:
      q = CylinderShape::support(data, l);
      break;
    case ShapeType::box:
      q = BoxShape::support(data, l);
      break;
    case ShapeType::mesh:
      q = hull_support(*s.asset, l, s.vertex);
      break;
    case ShapeType::hfield: {
      q = s.prism[0];
      T most = dot(q, l);
      for (int i = 1; i < 6; ++i) {
        T const along = dot(s.prism[i], l);
        if (along > most) {
          most = along;
          q = s.prism[i];
        }
      }
      break;
    }
    case ShapeType::plane:
    case ShapeType::sphere:
      break;
  }
  return s.p + s.R * q;
}

/// A point of the difference D = { x - y : x in A, y in B } of two cores, and the x that it comes from. The cores overlap where D holds the
/// origin; h(n) = max n.w over D is how far B must move along the unit vector n until they do not.
template <class T>
struct DifferencePoint {
  Vec3<T> w, a;
};
template <class T>
KOKKOS_INLINE_FUNCTION DifferencePoint<T> difference_support(ConvexShape<T>& a, ConvexShape<T>& b, Vec3<T> const& n) {
  Vec3<T> const x = core_support(a, n);
  Vec3<T> const y = core_support(b, -n);
  return {x - y, x};
}

}  // namespace gsp::detail
