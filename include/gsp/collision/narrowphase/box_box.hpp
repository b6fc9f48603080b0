#pragma once
#include <gsp/collision/detail/clip_polygon.hpp>
#include <gsp/collision/shapes.hpp>

namespace gsp {

/// Boxes a and b: separating axes over 3 + 3 face normals and 9 edge cross products, then
/// - face: the face of the other box that faces it most is clipped by the sides of the reference face; each vertex below the margin is a
/// point, midway between
///   the reference face and the incident one, dist along the reference normal: up to 8 points, `reduce_points` (manifold.hpp) takes 4 of
///   them;
/// - edge: one point, midway between the closest points of the two edges, dist along the axis.
/// A face is preferred to an edge axis within 8 degrees of it unless that is better by 5 % of the gap (as MuJoCo does) or, where that is
/// more, 2e-5 of the smaller box's half sizes, so that resting boxes do not alternate: where equal boxes stand on each other with a tilt t
/// and an offset d, an edge axis is better by d t, and rigid ones at a gap of rounding would lose three of their points for it. The points
/// of a face have the distances that the faces have there. Features: face: axis and sign, incident face, and the two polygon edges that
/// meet; edge: the two edges. Source: S. Gottschalk et al. 1996 (axes); Sutherland and Hodgman 1974 (clipping). Cost about 400 flops when
/// apart, 1,000 with points.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void box_box(Shape<T> const& a, Shape<T> const& b, T margin, Out& out) {
  Mat3<T> C;  // b's axes in a's frame: column j
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) C(i, j) = dot(column(a.R, i), column(b.R, j));
  Vec3<T> const ab = transpose_times(a.R, b.p - a.p), ba = transpose_times(b.R, a.p - b.p);  // centre of the other box in the own frame
  Vec3<T> const A = a.size, B = b.size;
  T const epsilon = Kokkos::Experimental::epsilon_v<T>;
  T const apart = margin + (sizeof(T) == 4 ? T(1e-6) : T(1e-13)) * (A.x + A.y + A.z + B.x + B.y + B.z);  // rounding must not lose a touch

  T best = -Kokkos::Experimental::finite_max_v<T>;
  int code = 0;  // 0-2 face of a, 3-5 face of b, 6 + 3 i + j edge i of a x edge j of b
  for (int i = 0; i < 3; ++i) {
    T const gap = abs(ab[i]) - A[i] - (abs(C(i, 0)) * B.x + abs(C(i, 1)) * B.y + abs(C(i, 2)) * B.z);
    if (gap > apart) return;
    if (gap > best) {
      best = gap;
      code = i;
    }
  }
  for (int j = 0; j < 3; ++j) {
    T const gap = abs(ba[j]) - B[j] - (abs(C(0, j)) * A.x + abs(C(1, j)) * A.y + abs(C(2, j)) * A.z);
    if (gap > apart) return;
    if (gap > best) {
      best = gap;
      code = 3 + j;
    }
  }
  T const face_gap = best;
  int const face_code = code;
  for (int i = 0; i < 3; ++i) {
    int const i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      int const j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      T x = -C(i2, j), y = C(i1, j);  // e_i x column j, components i1 and i2
      T const length2 = x * x + y * y;
      if (length2 < T(0.5) * epsilon) continue;  // parallel edges: the faces cover them
      T const inverse = T(1) / sqrt(length2);
      x = x * inverse;
      y = y * inverse;
      T const radius =
          A[i1] * abs(x) + A[i2] * abs(y) + B[j1] * abs(x * C(i1, j1) + y * C(i2, j1)) + B[j2] * abs(x * C(i1, j2) + y * C(i2, j2));
      T const gap = abs(x * ab[i1] + y * ab[i2]) - radius;
      if (gap > apart) return;
      if (gap - T(1e-6) * abs(gap) > best && gap > face_gap) {
        best = gap;
        code = 6 + 3 * i + j;
      }
    }
  }

  if (code >= 6) {
    int const i = (code - 6) / 3, j = (code - 6) % 3, i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    Vec3<T> n{T(0), T(0), T(0)};
    n[i1] = -C(i2, j);
    n[i2] = C(i1, j);
    n = normalized(n);
    if (dot(n, ab) < T(0)) n = -n;
    Vec3<T> const m = transpose_times(C, n);  // in b's frame
    T const along = abs(face_code < 3 ? n[face_code] : m[face_code - 3]);
    if (along > T(0.99) && best < face_gap + max(T(0.05) * abs(face_gap), T(2e-5) * min(A.x + A.y + A.z, B.x + B.y + B.z))) {
      code = face_code;
    } else {
      // The supporting edges: corners by the signs of n. A component near zero supports both, then the closer pair of edges counts.
      int const j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      T const vague = sizeof(T) == 4 ? T(1e-5) : T(1e-9);
      Vec3<T> const d = column(C, j);
      T const across = d[i], sine2 = T(1) - across * across;
      T nearest = Kokkos::Experimental::finite_max_v<T>, dist(0);
      Vec3<T> middle{T(0), T(0), T(0)};
      int corners = 0;
      for (int variant = 0; variant < 4; ++variant) {
        bool const flip_a = variant & 1, flip_b = variant & 2;
        int const ka = abs(n[i1]) < vague ? i1 : abs(n[i2]) < vague ? i2 : -1, kb = abs(m[j1]) < vague ? j1 : abs(m[j2]) < vague ? j2 : -1;
        if ((flip_a && ka < 0) || (flip_b && kb < 0)) continue;
        Vec3<T> p{T(0), T(0), T(0)}, q{T(0), T(0), T(0)};
        p[i1] = n[i1] < T(0) ? -A[i1] : A[i1];
        p[i2] = n[i2] < T(0) ? -A[i2] : A[i2];
        q[j1] = m[j1] < T(0) ? B[j1] : -B[j1];
        q[j2] = m[j2] < T(0) ? B[j2] : -B[j2];
        if (flip_a) p[ka] = -p[ka];
        if (flip_b) q[kb] = -q[kb];
        int const which = (p[i1] > T(0)) + 2 * (p[i2] > T(0)) + 4 * (q[j1] > T(0)) + 8 * (q[j2] > T(0));
        q = ab + C * q;
        // closest points p + s e_i and q + t d of the two edges
        Vec3<T> const e = q - p;
        T s = clamp((e[i] - across * dot(d, e)) / max(sine2, T(1e-15)), -A[i], A[i]);
        T const t = clamp(across * s - dot(d, e), -B[j], B[j]);
        s = clamp(e[i] + across * t, -A[i], A[i]);
        p[i] = s;
        q = q + t * d;
        Vec3<T> const gap = q - p;
        T const gap2 = dot(gap, gap);
        if (gap2 < nearest) {
          nearest = gap2;
          dist = dot(gap, n);
          middle = T(0.5) * (p + q);
          corners = which;
        }
      }
      if (dist <= apart) out.add(a.p + a.R * middle, dist, a.R * n, (1 << 14) | ((code - 6) << 4) | corners);
      return;
    }
  }

  // Face contact. Reference box r with face axis f, incident box o; everything in r's frame, f as the third axis.
  bool const ref_a = code < 3;
  int const f = ref_a ? code : code - 3, x = (f + 1) % 3, y = (f + 2) % 3;
  Vec3<T> const S = ref_a ? A : B, O = ref_a ? B : A, centre = ref_a ? ab : ba;
  auto const facing = [&](int row, int col) { return ref_a ? C(row, col) : C(col, row); };  // axis col of o in r's frame
  T const up = centre[f] < T(0) ? T(-1) : T(1);
  int g = 0;
  for (int k = 1; k < 3; ++k)
    if (abs(facing(f, k)) > abs(facing(f, g))) g = k;
  T const towards = up * facing(f, g) > T(0) ? T(-1) : T(1);  // sign of o's face that looks at r
  int const gu = (g + 1) % 3, gv = (g + 2) % 3;
  auto const at = [&](int axis, T u, T v) {
    return centre[axis] + towards * O[g] * facing(axis, g) + u * O[gu] * facing(axis, gu) + v * O[gv] * facing(axis, gv);
  };
  // In the reference face: along it, and height above it. Edges 0 to 3 are those of the incident face, 4 to 7 the sides of the reference.
  detail::ClipPolygon<T, 8> polygon;
  for (int k = 0; k < 4; ++k) {
    T const u = k == 0 || k == 3 ? T(1) : T(-1), v = k < 2 ? T(1) : T(-1);
    polygon.push(at(x, u, v), at(y, u, v), up * at(f, u, v) - S[f], k);
  }
  for (int side = 0; side < 4; ++side) {
    T const* const along = side < 2 ? polygon.x : polygon.y;
    T const sign = side % 2 == 0 ? T(1) : T(-1), limit = S[side < 2 ? x : y];
    detail::clip_polygon(
        polygon, [&](int i) { return sign * along[i] - limit; }, 4 + side);
  }

  Mat3<T> const& R = ref_a ? a.R : b.R;
  Vec3<T> const origin = ref_a ? a.p : b.p, n = (ref_a ? up : -up) * column(R, f);
  int const faces = ((((code << 1) | (up > T(0))) * 6 + 2 * g + (towards > T(0))) << 6);  // at most 71 << 6: below bit 14
  T const same = (sizeof(T) == 4 ? T(1e-10) : T(1e-14)) * (S[x] * S[x] + S[y] * S[y]);
  for (int k = 0; k < polygon.count; ++k) {
    if (!(polygon.z[k] <= margin)) continue;
    bool repeated = false;  // clipping through a corner leaves two vertices in one place
    for (int l = 0; l < k; ++l)
      repeated = repeated || (polygon.z[l] <= margin && square(polygon.x[k] - polygon.x[l]) + square(polygon.y[k] - polygon.y[l]) < same);
    if (repeated) continue;
    Vec3<T> p;
    p[x] = polygon.x[k];
    p[y] = polygon.y[k];
    p[f] = up * (S[f] + T(0.5) * polygon.z[k]);
    int const before = polygon.edge[k == 0 ? polygon.count - 1 : k - 1], after = polygon.edge[k];
    out.add(origin + R * p, polygon.z[k], n, faces | (before << 3) | after);
  }
}

}  // namespace gsp
