#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/core/check.hpp>
#include <gsp/ray/detail/lane_index.hpp>
#include <gsp/ray/detail/ray_triangle.hpp>
#include <string>
#include <utility>
#include <vector>

/// A tree of boxes over the triangles of a mesh, made once on the host: a ray looks at the triangles near its way alone. Binary, each node
/// with the boxes of its two children, split where the surface area heuristic says (binned; Wald, On fast construction of SAH-based
/// bounding volume hierarchies, 2007). No Kokkos.
namespace gsp {

struct alignas(16) RayNode {
  float lo[2][3], hi[2][3];  // of the children
  int child[2];              // a node's number; ~(first * 8 + count): so many triangles, maybe none
  int unused[2];
};
static_assert(sizeof(RayNode) == 64, "a node is four loads of 16 bytes");
struct alignas(16) RayTriangle {
  Vec3<float> a;
  int face;  // of the mesh
  Vec3<float> b;
  int unused_b;
  Vec3<float> c;
  int unused_c;
};
/// Triangles in the order of the leaves. The first node is the root.
struct MeshTree {
  std::vector<RayNode> nodes;
  std::vector<RayTriangle> triangles;
};
// Deeper than this no tree is: below ray_tree_sah_depth nodes are split in halves, and of the most triangles that are taken 28 times at
// most. What a traversal has put aside fits into so many places, whatever the mesh.
inline constexpr int ray_tree_sah_depth = 32, ray_tree_depth = ray_tree_sah_depth + 28, ray_leaf = 4;
inline constexpr std::size_t most_ray_triangles = std::size_t(1) << 28;
static_assert(ray_leaf < 8, "a leaf's count has three bits");

namespace detail {

struct RayBox {
  float lo[3] = {no_hit<float>(), no_hit<float>(), no_hit<float>()}, hi[3] = {-no_hit<float>(), -no_hit<float>(), -no_hit<float>()};
  void add(float const (&p)[3]) {
    for (int k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], p[k]);
      hi[k] = std::max(hi[k], p[k]);
    }
  }
  void add(RayBox const& o) {
    for (int k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], o.lo[k]);
      hi[k] = std::max(hi[k], o.hi[k]);
    }
  }
  /// Half of its surface.
  double area() const {
    double const x = double(hi[0]) - lo[0], y = double(hi[1]) - lo[1], z = double(hi[2]) - lo[2];
    return x < 0 ? 0 : x * y + y * z + z * x;
  }
};

/// Builds a MeshTree. Cost n log n.
class MeshTreeBuilder {
 public:
  MeshTreeBuilder(std::vector<std::array<float, 3>> const& vertices, std::vector<std::array<int, 3>> const& faces) {
    items_.reserve(faces.size());
    for (std::size_t f = 0; f < faces.size(); ++f) {
      Item item;
      item.face = int(f);
      bool finite = true;
      for (int const v : faces[f]) {
        expects(v >= 0 && std::size_t(v) < vertices.size(), "gsp::make_mesh_tree: face " + std::to_string(f) + " has a vertex " +
                                                                std::to_string(v) + ", and there are " + std::to_string(vertices.size()));
        auto const& p = vertices[std::size_t(v)];
        item.box.add({p[0], p[1], p[2]});
        finite = finite && std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
      }
      if (!finite) continue;  // nothing meets it
      for (int k = 0; k < 3; ++k) item.centre[k] = 0.5f * item.box.lo[k] + 0.5f * item.box.hi[k];
      items_.push_back(item);
    }
    tree_.nodes.emplace_back();
    fill(0, 0, int(items_.size()), 0);
    for (auto const& item : items_) {
      auto const corner = [&](int i) {
        auto const& p = vertices[std::size_t(faces[std::size_t(item.face)][std::size_t(i)])];
        return Vec3<float>{p[0], p[1], p[2]};
      };
      tree_.triangles.push_back({corner(0), item.face, corner(1), 0, corner(2), 0});
    }
  }
  MeshTree take() { return std::move(tree_); }

 private:
  struct Item {
    RayBox box;
    float centre[3];
    int face;
  };
  static constexpr int bins = 16;

  /// Items begin ... end - 1 become what hangs on node `at`.
  void fill(int at, int begin, int end, int depth) {
    int const middle = end - begin > ray_leaf ? split(begin, end, depth) : end;
    int const from[2] = {begin, middle}, to[2] = {middle, end};
    for (int side = 0; side < 2; ++side) {
      RayBox box;
      for (int i = from[side]; i < to[side]; ++i) box.add(items_[std::size_t(i)].box);
      int const count = to[side] - from[side];
      bool const leaf = count <= ray_leaf;
      int const child = leaf ? ~(from[side] * 8 + count) : int(tree_.nodes.size());
      if (!leaf) tree_.nodes.emplace_back();
      RayNode& node = tree_.nodes[std::size_t(at)];
      for (int k = 0; k < 3; ++k) {
        node.lo[side][k] = box.lo[k];
        node.hi[side][k] = box.hi[k];
      }
      node.child[side] = child;
      if (!leaf) fill(child, from[side], to[side], depth + 1);
    }
  }
  /// Where the items part, which are put in order for it.
  int split(int begin, int end, int depth) {
    RayBox centres;
    for (int i = begin; i < end; ++i) centres.add(items_[std::size_t(i)].centre);
    int axis = 0;
    for (int k = 1; k < 3; ++k)
      if (centres.hi[k] - centres.lo[k] > centres.hi[axis] - centres.lo[axis]) axis = k;
    auto const first = items_.begin() + begin, last = items_.begin() + end;
    if (depth < ray_tree_sah_depth && centres.hi[axis] > centres.lo[axis]) {
      double const scale = bins / (double(centres.hi[axis]) - centres.lo[axis]);
      auto const bin_of = [&](Item const& item) {
        return std::clamp(int(scale * (double(item.centre[axis]) - centres.lo[axis])), 0, bins - 1);
      };
      RayBox box[bins], right[bins];
      int count[bins] = {};
      for (auto i = first; i != last; ++i) {
        box[bin_of(*i)].add(i->box);
        ++count[bin_of(*i)];
      }
      right[bins - 1] = box[bins - 1];
      for (int b = bins - 1; b-- > 0;) {
        right[b] = box[b];
        right[b].add(right[b + 1]);
      }
      RayBox left;
      double least = no_hit<double>();
      int before = 0, best = 0;
      for (int b = 0; b + 1 < bins; ++b) {
        left.add(box[b]);
        before += count[b];
        double const cost = left.area() * before + right[b + 1].area() * (end - begin - before);
        if (before == 0 || before == end - begin || !(cost < least)) continue;
        least = cost;
        best = b;
      }
      auto const middle = std::stable_partition(first, last, [&](Item const& item) { return bin_of(item) <= best; });
      if (middle != first && middle != last) return int(middle - items_.begin());
    }
    auto const half = first + (end - begin) / 2;
    std::nth_element(first, half, last, [&](Item const& a, Item const& b) {
      return a.centre[axis] != b.centre[axis] ? a.centre[axis] < b.centre[axis] : a.face < b.face;
    });
    return int(half - items_.begin());
  }

  std::vector<Item> items_;
  MeshTree tree_;
};
}  // namespace detail

/// The tree over a mesh's faces, corners in `vertices`. Host. A face with a number that is not finite is left out: nothing meets it.
/// Errors: std::invalid_argument for a vertex that is not there, and for 2^28 faces or more.
inline MeshTree make_mesh_tree(std::vector<std::array<float, 3>> const& vertices, std::vector<std::array<int, 3>> const& faces) {
  expects(faces.size() < most_ray_triangles, "gsp::make_mesh_tree: a mesh of 2^28 faces or more: take it apart");
  return detail::MeshTreeBuilder(vertices, faces).take();
}

/// The nearest hit of a mesh: x, infinity where there is none, and which face; of faces at one x the first of the mesh.
template <class T>
struct MeshHit {
  T x = detail::no_hit<T>();
  int face = -1;
  int triangle = -1;  // its place in the tree
};

namespace detail {
/// Which triangles rays meet, in the order of a tree's leaves: T is one ray's number or those of a pack of rays, which go through the tree
/// together.
template <class T>
struct TrianglesMet {
  T x;
  LaneIndex<T> face{}, triangle{};  // -1: none
};
/// ray_mesh of rays that are scaled, with x < most.
template <class T>
GSP_FUNCTION TrianglesMet<T> meet_triangles(RayNode const* nodes, RayTriangle const* triangles, Ray<T> const& ray, T const& most) {
  T const none = no_hit<T>(), slack = roundings<T>(16);
  Vec3<T> const &o = ray.origin, &d = ray.direction;
  TriangleRay<T> const through(ray);
  // A box is looked at as if it were wider by what rounding may take from a triangle's place beside the ray. Along an axis on which the ray
  // does not move it is in the box all along or not at all: 1 / 0 times 0 would be NaN.
  Vec3<T> inverse, upper, lower;
  decltype(none < none) moves[3];
  bool all_move = true;
  for (int k = 0; k < 3; ++k) {
    moves[k] = abs(d[k]) > T(1e-30);
    all_move = all_move && all(moves[k]);
    inverse[k] = select(moves[k], T(1) / d[k], T(0));
    T const wider = T(0.25) * slack * abs(o[k]);
    upper[k] = o[k] + wider;
    lower[k] = o[k] - wider;
  }
  TrianglesMet<T> best{most};
  auto const take_leaf = [&](int leaf) {
    int const first = ~leaf / 8, end = first + ~leaf % 8;
    for (int t = first; t < end; ++t) {
      RayTriangle const& triangle = triangles[t];
      T const x = through.hit(triangle.a, triangle.b, triangle.c);
      auto const nearer = x < best.x || (x == best.x && best.face.is_above(triangle.face));
      if (!any(nearer)) continue;
      best.x = select(nearer, x, best.x);
      best.face.set(nearer, triangle.face);
      best.triangle.set(nearer, t);
    }
  };
  // Where it comes in, less what rounding may have added to that and to a triangle's x; infinity: never.
  auto const entry = [&](RayNode const& n, int side) {
    T near = T(0), far = none;
    auto never = none < T(0);
    for (int k = 0; k < 3; ++k) {
      T const lo = T(n.lo[side][k]) - upper[k], hi = T(n.hi[side][k]) - lower[k];
      T const a = lo * inverse[k], b = hi * inverse[k];
      if (all_move) {
        near = max(near, min(a, b));
        far = min(far, max(a, b) * (T(1) + slack));
      } else {
        never = never || (!moves[k] && !(lo <= T(0) && hi >= T(0)));
        near = select(moves[k], max(near, min(a, b)), near);
        far = select(moves[k], min(far, max(a, b) * (T(1) + slack)), far);
      }
    }
    return select(near <= far && !never, near - slack * min(far, T(1e30)), none);
  };
  struct Waiting {
    int node;
    T in;
  };
  Waiting stack[ray_tree_depth];
  int waiting = 0;
  for (int node = 0; node >= 0;) {
    RayNode const& n = nodes[node];
    T const in[2] = {entry(n, 0), entry(n, 1)};
    int const nearer = mostly(in[1] < in[0]) ? 1 : 0;
    node = -1;
    for (int i = 0; i < 2; ++i) {
      int const side = i == 0 ? nearer : 1 - nearer;
      if (!any(in[side] < none && in[side] <= best.x)) continue;
      if (n.child[side] < 0)
        take_leaf(n.child[side]);
      else if (node < 0)
        node = n.child[side];
      else
        stack[waiting++] = {n.child[side], in[side]};
    }
    while (node < 0 && waiting > 0) {
      Waiting const& next = stack[--waiting];
      if (any(next.in <= best.x)) node = next.node;
    }
  }
  return best;
}
}  // namespace detail

/// The nearest hit of the ray, in the mesh's frame. NaN, infinity and a direction of 0 miss. Cost: of a mesh of thousands of triangles
/// about 20 nodes and 4 triangles.
template <class T>
GSP_FUNCTION MeshHit<T> ray_mesh(RayNode const* nodes, RayTriangle const* triangles, Ray<T> const& ray) {
  if (!detail::is_ray(ray)) return {};
  detail::ScaledRay<T> const scaled(ray);
  auto const met = detail::meet_triangles(nodes, triangles, scaled.ray, detail::no_hit<T>());
  return {scaled.back(met.x), met.face[0], met.triangle[0]};
}

}  // namespace gsp
