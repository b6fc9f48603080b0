#pragma once
#include <gsp/collision/detail/convex_shape.hpp>

/// What a shape turns towards another one: a flat face, a line of a round side, or nothing but a point.
namespace gsp::detail {

/// Corners of a flat face (3 to 8, counter-clockwise seen from outside) or the ends of a line (2), on the surface; none: a point.
template <class T>
struct SupportFace {
  static constexpr int most = 8;
  Vec3<T> corner[most];
  int count = 0;
  Vec3<T> normal;  // of a face: unit, outward
  T round{};       // of a line: the radius of the side that it lies on [m]
  int id = 0;      // which of the shape's faces it is
};

/// Where the direction of a slope across a cap is rounding, and the pattern of points on its rim follows the cylinder's own x axis instead.
template <class T>
KOKKOS_INLINE_FUNCTION T level_slope() {
  return sizeof(T) == 4 ? T(3e-4) : T(1e-12);
}

/// The face or line of `s` that looks most along the unit vector n.
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION void support_face(ConvexShape<T> const& s, Vec3<T> const& n, SupportFace<T>& f) {
  Vec3<T> const l = transpose_times(s.R, n);
  f.count = 0;
  f.id = 0;
  f.round = T(0);
  f.normal = n;
  auto const put = [&](Vec3<T> const& q) { f.corner[f.count++] = s.p + s.R * q; };
  switch (s.type) {
    case ShapeType::capsule:
      for (int end = -1; end <= 1; end += 2) put(s.radius * l + Vec3<T>{T(0), T(0), T(end) * s.size.y});
      f.round = s.radius;
      break;
    case ShapeType::cylinder: {
      T const up = l.z < T(0) ? T(-1) : T(1);
      T const slope = sqrt(l.x * l.x + l.y * l.y);
      bool const is_level = slope < level_slope<T>();
      Vec3<T> const x{is_level ? T(1) : l.x / slope, is_level ? T(0) : l.y / slope, T(0)};
      f.id = l.z < T(0) ? 1 : 2;
      if (slope > abs(l.z)) {  // a line of the side
        f.id = 0;
        for (int end = -1; end <= 1; end += 2) put(s.size.x * x + Vec3<T>{T(0), T(0), T(end) * s.size.y});
        f.round = s.size.x;
        break;
      }
      // eight points of the rim, from the one that lies farthest along n
      Vec3<T> const y{-up * x.y, up * x.x, T(0)};
      T const half(0.7071067811865476);
      for (int k = 0; k < 8; ++k) {
        T const c = k % 4 == 2 ? T(0) : k % 2 == 1 ? half : T(1);
        T const d = k % 4 == 0 ? T(0) : k % 2 == 1 ? half : T(1);
        T const across = k >= 3 && k <= 5 ? -c : c;
        T const along = k >= 5 ? -d : d;
        put(s.size.x * (across * x + along * y) + Vec3<T>{T(0), T(0), up * s.size.y});
      }
      f.normal = up * column(s.R, 2);
      break;
    }
    case ShapeType::box: {
      int axis = 0;
      for (int k = 1; k < 3; ++k)
        if (abs(l[k]) > abs(l[axis])) axis = k;
      int const i = axis == 2 ? 0 : axis + 1;
      int const j = axis == 0 ? 2 : axis - 1;
      T const up = l[axis] < T(0) ? T(-1) : T(1);
      for (int k = 0; k < 4; ++k) {
        Vec3<T> q;
        q[axis] = up * s.size[axis];
        q[i] = k == 0 || k == 3 ? s.size[i] : -s.size[i];
        q[j] = (k < 2 ? up : -up) * s.size[j];
        put(q);
      }
      f.normal = up * column(s.R, axis);
      f.id = 2 * axis + (l[axis] < T(0) ? 0 : 1);
      break;
    }
    case ShapeType::mesh: {
      ShapeAsset<T> const& a = *s.asset;
      if (a.face_count == 0) break;
      T most = dot(a.face_normal[0], l);
      for (int k = 1; k < a.face_count; ++k) {
        T const along = dot(a.face_normal[k], l);
        if (along > most) {
          most = along;
          f.id = k;
        }
      }
      for (int k = a.face_first[f.id]; k < a.face_first[f.id + 1]; ++k) put(a.vertices[a.face_corners[k]]);
      f.normal = s.R * a.face_normal[f.id];
      break;
    }
    case ShapeType::hfield: {
      // of a prism the top: its sides are inside of the field
      Vec3<T> const up = normalized(cross(s.prism[4] - s.prism[3], s.prism[5] - s.prism[3]));
      bool const turned = up.z < T(0);
      put(s.prism[3]);
      put(s.prism[turned ? 5 : 4]);
      put(s.prism[turned ? 4 : 5]);
      f.normal = s.R * (turned ? -up : up);
      break;
    }
    case ShapeType::plane:
    case ShapeType::sphere:
    case ShapeType::ellipsoid:
      break;
  }
}

}  // namespace gsp::detail
