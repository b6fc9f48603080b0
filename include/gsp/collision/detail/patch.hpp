#pragma once
#include <gsp/collision/detail/clip_polygon.hpp>
#include <gsp/collision/detail/support_face.hpp>

/// The patch in which two shapes meet: the faces that they turn towards each other, seen along the normal, clipped by each other.
namespace gsp::detail {

/// A polygon seen along the normal: x, y across it, z along it. Edges 0 to 7 are its own, 8 to 15 those of the clipping face.
template <class T>
using PatchPolygon = ClipPolygon<T, 16>;

/// A sink for the points of a patch: those within the margin, each place once.
template <class T>
struct Patch {
  static constexpr int most = PatchPolygon<T>::most + 1;
  ContactPoint<T> point[most];
  int count = 0;
  T margin, same2;  // points nearer than the root of same2 are one
  KOKKOS_INLINE_FUNCTION void add(Vec3<T> const& pos, T dist, Vec3<T> const& n, int feature) {
    if (!(dist <= margin) || count == most) return;
    for (int i = 0; i < count; ++i) {
      Vec3<T> const d = point[i].pos - pos;
      if (dot(d, d) < same2) return;
    }
    point[count] = {pos, dist, n, feature};
    ++count;
  }
};

/// Two lines, nearly parallel: the ends of their common stretch. Seen along the normal they may lie beside each other there, and the round
/// sides are as much farther apart.
template <class T>
KOKKOS_INLINE_FUNCTION void meet_lines(SupportFace<T> const& a, SupportFace<T> const& b, Vec3<T> const& n, int faces, Patch<T>& patch) {
  auto const across = [&](Vec3<T> const& d) { return d - dot(d, n) * n; };
  Vec3<T> const da = across(a.corner[1] - a.corner[0]);
  Vec3<T> const db = across(b.corner[1] - b.corner[0]);
  T const aa = dot(da, da), bb = dot(db, db);
  Vec3<T> const c = cross(da, db);
  if (!(dot(c, c) < T(0.01) * aa * bb)) return;  // 6 degrees
  Vec3<T> const begin = across(b.corner[0] - a.corner[0]);
  T const s0 = dot(begin, da) / aa, s1 = dot(begin + db, da) / aa;  // b's ends along a
  if (!(abs(s1 - s0) > T(0))) return;
  T const lo = max(T(0), min(s0, s1)), hi = min(T(1), max(s0, s1));
  if (!(lo <= hi)) return;
  for (int k = 0; k < 2; ++k) {
    T const s = k == 0 ? lo : hi;
    T const t = (s - s0) / (s1 - s0);
    Vec3<T> const p = a.corner[0] + s * (a.corner[1] - a.corner[0]);
    Vec3<T> const q = b.corner[0] + t * (b.corner[1] - b.corner[0]);
    Vec3<T> const beside = across(q - p);
    T const centers = dot(q - p, n) + a.round + b.round;
    T const dist = centers > T(0) ? sqrt(centers * centers + dot(beside, beside)) - a.round - b.round : dot(q - p, n);
    bool const of_a = k == 0 ? !(lo > T(0)) : !(hi < T(1));
    patch.add(T(0.5) * (p + q), dist, n, faces | (of_a ? 1 + k : s0 < s1 ? 3 + k : 4 - k));
  }
}

/// The points of a patch of faces a and b along the normal n (from a to b): corners of the one inside the other, and where edges cross,
/// each midway between the two surfaces with their distance along n there. Lines are faces of two corners. Features: the edges that meet.
template <class T>
KOKKOS_INLINE_FUNCTION void meet_faces(SupportFace<T> const& a, SupportFace<T> const& b, Vec3<T> const& n, Patch<T>& patch) {
  if (a.count < 2 || b.count < 2) return;
  std::uint32_t const mixed = (std::uint32_t(a.id) * 2654435761u) ^ (std::uint32_t(b.id) * 2246822519u + 1u);
  int const faces = int(mixed >> 10) << 8;  // 22 bits above those of the edges
  if (a.count == 2 && b.count == 2) return meet_lines(a, b, n, faces, patch);
  bool const swap = b.count > 2 && a.count == 2;  // the line is clipped by the face
  SupportFace<T> const& subject = swap ? a : b;
  SupportFace<T> const& window = swap ? b : a;
  T const facing = dot(window.normal, n);
  if (!(abs(facing) > T(0.1))) return;
  Mat3<T> const frame = contact_frame(n);
  Vec3<T> const u{frame(1, 0), frame(1, 1), frame(1, 2)}, v{frame(2, 0), frame(2, 1), frame(2, 2)};
  Vec3<T> const o = window.corner[0];
  PatchPolygon<T> p;
  for (int i = 0; i < subject.count; ++i) {
    Vec3<T> const d = subject.corner[i] - o;
    p.push(dot(d, u), dot(d, v), dot(d, n), i);
  }
  T const s = facing > T(0) ? T(1) : T(-1);
  for (int i = 0; i < window.count; ++i) {
    Vec3<T> const c = window.corner[i] - o;
    Vec3<T> const e = window.corner[i + 1 == window.count ? 0 : i + 1] - o;
    T const cx = dot(c, u), cy = dot(c, v), ex = dot(e, u), ey = dot(e, v);
    clip_polygon(
        p, [&](int k) { return -s * ((ex - cx) * (p.y[k] - cy) - (ey - cy) * (p.x[k] - cx)); }, 8 + i);
  }
  T const fx = dot(window.normal, u), fy = dot(window.normal, v);
  for (int i = 0; i < p.count; ++i) {
    T const z = -(fx * p.x[i] + fy * p.y[i]) / facing;  // of the window's plane
    int const before = p.edge[i == 0 ? p.count - 1 : i - 1];
    patch.add(o + p.x[i] * u + p.y[i] * v + (T(0.5) * (z + p.z[i])) * n, swap ? z - p.z[i] : p.z[i] - z, n,
              faces | (before << 4) | p.edge[i]);
  }
}

}  // namespace gsp::detail
