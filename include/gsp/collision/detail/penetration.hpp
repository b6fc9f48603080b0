#pragma once
#include <cstdint>
#include <gsp/collision/detail/gjk.hpp>

/// The least displacement that parts two overlapping cores: the expanding polytope algorithm (van den Bergen, 2001) with a polytope of
/// fixed size that forgets what can no more be the answer.
namespace gsp::detail {

/// A set of small numbers, by bits.
template <int words>
struct SmallSet {
  std::uint64_t word[words] = {};
  KOKKOS_INLINE_FUNCTION bool has(int i) const { return (word[i >> 6] >> (i & 63) & 1) != 0; }
  KOKKOS_INLINE_FUNCTION void add(int i) { word[i >> 6] |= std::uint64_t(1) << (i & 63); }
  KOKKOS_INLINE_FUNCTION void remove(int i) { word[i >> 6] &= ~(std::uint64_t(1) << (i & 63)); }
  KOKKOS_INLINE_FUNCTION int size() const {
    int n = 0;
    for (int w = 0; w < words; ++w) n += Kokkos::popcount(word[w]);
    return n;
  }
  /// The first number of the set from i on, 64 * words: there is none. For loops: it may change on the way.
  KOKKOS_INLINE_FUNCTION int from(int i) const {
    for (int w = i >> 6; w < words; ++w) {
      std::uint64_t const rest = w == i >> 6 ? word[w] >> (i & 63) << (i & 63) : word[w];
      if (rest != 0) return 64 * w + Kokkos::countr_zero(rest);
    }
    return 64 * words;
  }
};

/// Triangles with corners in D, whose outward normals and distances from the origin bound it from inside. 4.4 kB in float, 7.9 kB in
/// double.
template <class T>
struct Polytope {
  static constexpr int vertices = 64, faces = 124;  // a closed one has 2 v - 4 faces
  static constexpr std::uint8_t none = 255;
  DifferencePoint<T> vertex[vertices];
  Vec3<T> normal[faces];
  T bound[faces];                   // no point of the face is nearer to the origin
  std::uint8_t corner[faces][3];    // counter-clockwise seen from outside
  std::uint8_t neighbor[faces][3];  // across the edge from corner k to corner k + 1
  SmallSet<2> alive;                // faces
  SmallSet<1> used;                 // vertices
  bool has_holes = false;           // faces were forgotten

  /// The distance of a face's plane from the origin, by one of its corners.
  KOKKOS_INLINE_FUNCTION T offset(int f, int a) const { return dot(normal[f], vertex[a].w); }
  KOKKOS_INLINE_FUNCTION void find_bound(int f) {
    bound[f] = offset(f, corner[f][0]);
    if (!has_holes || !(bound[f] > T(0))) return;
    // what is left of its neighbors no longer tells where its plane is the nearest
    Vec3<T> const a = vertex[corner[f][0]].w, b = vertex[corner[f][1]].w, c = vertex[corner[f][2]].w;
    T la, lb, lc;
    nearest_of_triangle(a, b, c, la, lb, lc);
    bound[f] = max(bound[f], norm(la * a + lb * b + lc * c));
  }
  /// A new face a b c; none where it has no area or there is no room.
  KOKKOS_INLINE_FUNCTION int add_face(int a, int b, int c, T least_area) {
    int f = 0;
    while (f < faces && alive.has(f)) ++f;
    if (f == faces) return none;
    Vec3<T> const n = cross(vertex[b].w - vertex[a].w, vertex[c].w - vertex[a].w);
    T const length = norm(n);
    if (!(length > least_area)) return none;
    normal[f] = (T(1) / length) * n;
    corner[f][0] = std::uint8_t(a);
    corner[f][1] = std::uint8_t(b);
    corner[f][2] = std::uint8_t(c);
    find_bound(f);
    for (int k = 0; k < 3; ++k) neighbor[f][k] = none;
    alive.add(f);
    return f;
  }
  /// Faces f and g become neighbors across the edge of f that begins at corner a.
  KOKKOS_INLINE_FUNCTION void join(int f, int g, int a) {
    if (f == none || g == none) return;
    for (int k = 0; k < 3; ++k)
      if (corner[f][k] == a) {
        neighbor[f][k] = std::uint8_t(g);
        int const b = corner[f][k == 2 ? 0 : k + 1];
        for (int l = 0; l < 3; ++l)
          if (corner[g][l] == b) neighbor[g][l] = std::uint8_t(f);
      }
  }
  /// The square of a face's least height.
  KOKKOS_INLINE_FUNCTION T width2(int f) const {
    Vec3<T> const a = vertex[corner[f][0]].w, b = vertex[corner[f][1]].w, c = vertex[corner[f][2]].w;
    Vec3<T> const ab = b - a, ac = c - a, bc = c - b;
    Vec3<T> const twice = cross(ab, ac);
    return dot(twice, twice) / max(max(dot(ab, ab), dot(ac, ac)), dot(bc, bc));
  }
  /// A new face whose plane is that of its neighbor g, which is wider, to the rounding of its corners: its own normal is rounding where it
  /// is a sliver, and what lies far off would seem to be beyond it. It takes g's.
  KOKKOS_INLINE_FUNCTION void straighten(int f, int g, T rounding) {
    if (f == none || g == none) return;
    Vec3<T> const turn = normal[f] - normal[g];
    T const turn2 = dot(turn, turn);
    if (!(turn2 < T(1e-4))) return;
    T const own = width2(f);
    if (!(turn2 * own <= square(rounding)) || !(own < width2(g))) return;
    normal[f] = normal[g];
    find_bound(f);
  }
  KOKKOS_INLINE_FUNCTION void remove_face(int f) {
    alive.remove(f);
    for (int k = 0; k < 3; ++k) {
      int const g = neighbor[f][k];
      if (g == none) continue;
      for (int l = 0; l < 3; ++l)
        if (neighbor[g][l] == f) neighbor[g][l] = none;
    }
  }
  KOKKOS_INLINE_FUNCTION int nearest_face() const {
    int best = none;
    for (int f = alive.from(0); f < faces; f = alive.from(f + 1))
      if (best == none || bound[f] < bound[best]) best = f;
    return best;
  }
  /// The room of vertices that no face needs is free again.
  KOKKOS_INLINE_FUNCTION void release_vertices() {
    used = {};
    for (int f = alive.from(0); f < faces; f = alive.from(f + 1))
      for (int k = 0; k < 3; ++k) used.add(corner[f][k]);
  }
  /// Forgets the faces of which fewer than `least` corners belong to near faces, those below `limit` and `keep`. What borders on near faces
  /// stays: over a hole right beside them new faces would fold back, and the search go in circles.
  KOKKOS_INLINE_FUNCTION void forget(T limit, int keep, int least) {
    SmallSet<1> near;
    for (int f = alive.from(0); f < faces; f = alive.from(f + 1))
      for (int k = 0; k < 3; ++k)
        if (f == keep || bound[f] < limit) near.add(corner[f][k]);
    for (int f = alive.from(0); f < faces; f = alive.from(f + 1)) {
      int count = 0;
      for (int k = 0; k < 3; ++k) count += near.has(corner[f][k]) ? 1 : 0;
      if (count >= least) continue;
      has_holes = true;
      remove_face(f);
    }
    release_vertices();
  }
  KOKKOS_INLINE_FUNCTION bool has_room() const { return used.size() < vertices && alive.size() + 2 <= faces; }
  /// Takes point p, which lies beyond face f: the faces that it sees, a patch round f, give way to a fan from the patch's rim to p.
  KOKKOS_INLINE_FUNCTION void insert(DifferencePoint<T> const& p, int f, T rounding, T least_area) {
    int v = 0;
    while (used.has(v)) ++v;
    vertex[v] = p;
    used.add(v);
    SmallSet<2> seen, open;
    seen.add(f);
    open.add(f);
    for (int g = f; g < faces; g = open.from(0)) {
      open.remove(g);
      for (int k = 0; k < 3; ++k) {
        int const h = neighbor[g][k];
        if (h == none || seen.has(h) || !alive.has(h)) continue;
        if (!(dot(normal[h], p.w) - offset(h, corner[h][0]) > rounding)) continue;
        seen.add(h);
        open.add(h);
      }
    }
    std::uint8_t rim[faces][3];  // from, to, the face beyond
    int count = 0;
    for (int g = seen.from(0); g < faces; g = seen.from(g + 1))
      for (int k = 0; k < 3; ++k) {
        int const h = neighbor[g][k];
        bool const inner = h != none && seen.has(h);
        if (inner || count == faces) continue;
        rim[count][0] = corner[g][k];
        rim[count][1] = corner[g][k == 2 ? 0 : k + 1];
        rim[count][2] = std::uint8_t(h);
        ++count;
      }
    for (int g = seen.from(0); g < faces; g = seen.from(g + 1)) remove_face(g);
    std::uint8_t from[vertices];  // the new face whose rim edge begins at a vertex
    for (int i = 0; i < vertices; ++i) from[i] = none;
    for (int i = 0; i < count; ++i) {
      int const g = add_face(rim[i][0], rim[i][1], v, least_area);
      from[rim[i][0]] = std::uint8_t(g);
      join(g, rim[i][2], rim[i][0]);
      straighten(g, rim[i][2], rounding);
    }
    for (int i = 0; i < count; ++i) join(from[rim[i][0]], from[rim[i][1]], rim[i][1]);
  }
};

template <class T>
struct CorePenetration {
  T depth;    // h(n): how far B must move along n. Negative: the cores are that far apart
  Vec3<T> n;  // unit, from A to B
  Vec3<T> a;  // a point of A's core there
};

/// Newton's method on the unit sphere from best.n towards the least h(n) near it, where D is smooth. In the plane of E = (u, v) at right
/// angles to n, with m = n + E s,
///   f(s) = h(m) / |m|,   f'(s) = E^T (w - f m / |m|) / |m|   at the farthest point w along m,
/// and f'' is the difference of f' over steps `reach`. Only steps that lessen h are taken.
template <class T>
KOKKOS_INLINE_FUNCTION void polish(ConvexShape<T>& a, ConvexShape<T>& b, CorePenetration<T>& best, T tolerance) {
  T const reach = sizeof(T) == 4 ? T(2e-3) : T(1e-5);
  for (int step = 0; step < 6; ++step) {
    Mat3<T> const frame = contact_frame(best.n);
    Vec3<T> const u{frame(1, 0), frame(1, 1), frame(1, 2)}, v{frame(2, 0), frame(2, 1), frame(2, 2)};
    T g[3][2];  // f' at s = 0, along u, along v
    for (int i = 0; i < 3; ++i) {
      Vec3<T> const m = best.n + (i == 1 ? reach : T(0)) * u + (i == 2 ? reach : T(0)) * v;
      T const length = norm(m);
      Vec3<T> const n = (T(1) / length) * m;
      DifferencePoint<T> const p = difference_support(a, b, n);
      Vec3<T> const across = (T(1) / length) * (p.w - dot(p.w, n) * n);
      g[i][0] = dot(across, u);
      g[i][1] = dot(across, v);
    }
    T const xx = (g[1][0] - g[0][0]) / reach, yy = (g[2][1] - g[0][1]) / reach;
    T const xy = T(0.5) * (g[1][1] - g[0][1] + g[2][0] - g[0][0]) / reach;
    T const determinant = xx * yy - xy * xy;
    if (!(xx > T(0)) || !(determinant > T(0))) return;
    T s = (xy * g[0][1] - yy * g[0][0]) / determinant;
    T t = (xy * g[0][0] - xx * g[0][1]) / determinant;
    T const far = sqrt(s * s + t * t);
    if (far > T(0.3)) {
      s = s * T(0.3) / far;
      t = t * T(0.3) / far;
    }
    Vec3<T> const n = normalized(best.n + s * u + t * v);
    DifferencePoint<T> const p = difference_support(a, b, n);
    T const h = dot(n, p.w);
    T const gain = best.depth - h;
    if (!(gain >= T(0))) return;
    best = {h, n, p.a};
    if (gain <= tolerance) return;
  }
}

/// The unit vector n with the least h(n), to within `tolerance`: the faces' distances bound the depth from below and every h(n) from above,
/// and the face nearest to the origin is pushed outward until the two meet. Whatever ends the search, the answer is an n whose h(n) was
/// computed. The origin may lie a little outside of D. Curved cores take many faces: there the bounds need meet only within 4e-7 of the
/// size, and Newton's method finds the depth to `tolerance` between them, where D is smooth; with `fine` they meet within `tolerance`, too.
template <class T>
KOKKOS_INLINE_FUNCTION CorePenetration<T> penetration(ConvexShape<T>& a, ConvexShape<T>& b, T size, T tolerance, int steps,
                                                      bool fine = false) {
  bool const is_curved = is_curved_core(a.type) || is_curved_core(b.type);
  T const vague = is_curved && !fine ? max(tolerance, T(4e-7) * size) : tolerance;
  T polish_below = is_curved ? Kokkos::Experimental::finite_max_v<T> : -Kokkos::Experimental::finite_max_v<T>;
  using P = Polytope<T>;
  P polytope;
  CorePenetration<T> best{Kokkos::Experimental::finite_max_v<T>, {T(1), T(0), T(0)}, {T(0), T(0), T(0)}};
  T const epsilon = Kokkos::Experimental::epsilon_v<T>;

  // A tetrahedron: two points along the line of centers, the farthest from that line, the farther from the plane of these three.
  Vec3<T> axis = normalized(b.p - a.p);
  auto* const v = polytope.vertex;
  for (int i = 0; i < 8; ++i) {
    Vec3<T> const e = abs(axis.x) < T(0.6) ? Vec3<T>{T(1), T(0), T(0)} : Vec3<T>{T(0), T(1), T(0)};
    Vec3<T> const u = normalized(cross(axis, e));
    Vec3<T> n = axis;
    if (i == 2 || i == 3) n = u;
    if (i == 4 || i == 5) n = cross(axis, u);
    if (i % 2 == 1) n = -n;
    DifferencePoint<T> const p = difference_support(a, b, n);
    T const h = dot(n, p.w);
    if (h < best.depth) best = {h, n, p.a};
    if (i < 3) v[i] = p;
    if (i == 1) axis = normalized(v[1].w - v[0].w);
    if (i >= 3 && i < 6) {  // farther from the line
      Vec3<T> const old = cross(axis, v[2].w - v[0].w);
      Vec3<T> const now = cross(axis, p.w - v[0].w);
      if (dot(now, now) > dot(old, old)) v[2] = p;
    }
    if (i == 5) axis = normalized(cross(v[1].w - v[0].w, v[2].w - v[0].w));
    if (i == 6) v[3] = p;
    if (i == 7 && -dot(axis, p.w - v[0].w) > dot(axis, v[3].w - v[0].w)) v[3] = p;
  }
  if (a.type ==
      ShapeType::hfield) {  // the ground's own normal: what the search finds beside it is no better but by rounding of a wide prism
    Vec3<T> const up = normalized(cross(a.prism[4] - a.prism[3], a.prism[5] - a.prism[3]));
    Vec3<T> const n = a.R * (up.z < T(0) ? -up : up);
    DifferencePoint<T> const p = difference_support(a, b, n);
    T const h = dot(n, p.w);
    if (h <= best.depth + vague) best = {h, n, p.a};
  }
  T const thick = dot(axis, v[3].w - v[0].w);
  T const wide = norm(cross(v[1].w - v[0].w, v[2].w - v[0].w));
  if (!(abs(thick) > T(64) * epsilon * size) || !(wide > T(64) * epsilon * size * size)) return best;  // D is flat: the best that was seen
  if (thick > T(0)) {
    DifferencePoint<T> const p = v[0];
    v[0] = v[1];
    v[1] = p;
  }
  T const least_area = T(4) * epsilon * epsilon * size * size;
  for (int i = 0; i < 4; ++i) polytope.used.add(i);
  int const f0 = polytope.add_face(0, 1, 2, least_area);
  int const f1 = polytope.add_face(0, 3, 1, least_area);
  int const f2 = polytope.add_face(1, 3, 2, least_area);
  int const f3 = polytope.add_face(2, 3, 0, least_area);
  polytope.join(f0, f1, 0);
  polytope.join(f0, f2, 1);
  polytope.join(f0, f3, 2);
  polytope.join(f1, f2, 3);
  polytope.join(f2, f3, 3);
  polytope.join(f3, f1, 3);

  for (int step = 0; step < steps; ++step) {
    int const f = polytope.nearest_face();
    if (f == P::none || polytope.bound[f] >= best.depth - vague) break;
    Vec3<T> const n = polytope.normal[f];
    DifferencePoint<T> const p = difference_support(a, b, n);
    T const h = dot(n, p.w);
    if (h < best.depth - (a.type == ShapeType::hfield ? vague : T(0))) {
      DifferencePoint<T> const& i = v[polytope.corner[f][0]];
      DifferencePoint<T> const& j = v[polytope.corner[f][1]];
      DifferencePoint<T> const& k = v[polytope.corner[f][2]];
      T li, lj, lk;
      nearest_of_triangle(i.w, j.w, k.w, li, lj, lk);
      best = {h, n, li * i.a + lj * j.a + lk * k.a};
    }
    T const gap = h - polytope.offset(f, polytope.corner[f][0]);
    if (gap < T(1e-2) * size && best.depth < polish_below) {
      polish(a, b, best, tolerance);
      polish_below = best.depth - tolerance;
    }
    if (gap <= tolerance) {  // a face of D
      if (!polytope.has_holes) break;
      polytope.remove_face(f);
      continue;
    }
    // Room: vertices inside, then what is farther than the answer; if that is not enough, what is farther than most.
    if (!polytope.has_room()) polytope.release_vertices();
    T limit = best.depth - vague;
    for (int k = 0; k < 16 && !polytope.has_room(); ++k) {
      polytope.forget(limit, f, k == 0 ? 1 : 2);
      if (k > 0) limit = T(0.8) * limit + T(0.2) * polytope.bound[f];
    }
    if (!polytope.has_room()) break;
    polytope.insert(p, f, T(4) * epsilon * size, least_area);
  }
  return best;
}

}  // namespace gsp::detail
