#pragma once
#include <algorithm>
#include <cmath>
#include <gsp/ray/lane_index.hpp>
#include <gsp/ray/ray_shapes.hpp>
#include <utility>
#include <vector>

/// Trees of boxes over what rays may meet (triangles: ray/mesh_tree.hpp; Gaussians: splat/splat_tree.hpp), made once on the host: binary,
/// each node with the boxes of its two children, split where the surface area heuristic says (binned; Wald, On fast construction of
/// SAH-based bounding volume hierarchies, 2007). No Kokkos.
namespace gsp {

struct alignas(16) RayNode {
  float lo[2][3], hi[2][3];  // of the children
  int child[2];              // a node's number; ~(first * 8 + count): so many items of a leaf, maybe none
  int unused[2];
};
static_assert(sizeof(RayNode) == 64, "a node is four loads of 16 bytes");
// Deeper than this no tree is: below ray_tree_sah_depth nodes are split in halves, and of the most items that are taken 28 times at most.
// What a traversal has put aside fits into so many places, whatever the items.
inline constexpr int ray_tree_sah_depth = 32, ray_tree_depth = ray_tree_sah_depth + 28, ray_leaf = 4;
inline constexpr std::size_t most_ray_items = std::size_t(1) << 28;
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

/// Puts numbered boxes into a tree, the first node of which is the root. Cost n log n.
class BoxTreeBuilder {
 public:
  explicit BoxTreeBuilder(std::size_t most) { items_.reserve(most); }
  void add(RayBox const& box, int number) {
    Item item{box, {}, number};
    for (int k = 0; k < 3; ++k) item.centre[k] = 0.5f * box.lo[k] + 0.5f * box.hi[k];
    items_.push_back(item);
  }
  /// The nodes; calls take(number) for each item in the order of the leaves.
  template <class F>
  std::vector<RayNode> build(F const& take) {
    nodes_.assign(1, {});
    fill(0, 0, int(items_.size()), 0);
    for (auto const& item : items_) take(item.number);
    return std::move(nodes_);
  }

 private:
  struct Item {
    RayBox box;
    float centre[3];
    int number;
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
      int const child = leaf ? ~(from[side] * 8 + count) : int(nodes_.size());
      if (!leaf) nodes_.emplace_back();
      RayNode& node = nodes_[std::size_t(at)];
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
    auto const first = items_.begin() + begin, last = items_.begin() + end;
    if (depth < ray_tree_sah_depth) {
      Split best;
      for (int axis = 0; axis < 3; ++axis) best.take(cheapest(begin, end, centres, axis));
      auto const middle =
          std::stable_partition(first, last, [&](Item const& item) { return bin_of(item, centres, best.axis) <= best.bin; });
      if (middle != first && middle != last) return int(middle - items_.begin());
    }
    int axis = 0;
    for (int k = 1; k < 3; ++k)
      if (centres.hi[k] - centres.lo[k] > centres.hi[axis] - centres.lo[axis]) axis = k;
    auto const half = first + (end - begin) / 2;
    std::nth_element(first, half, last, [&](Item const& a, Item const& b) {
      return a.centre[axis] != b.centre[axis] ? a.centre[axis] < b.centre[axis] : a.number < b.number;
    });
    return int(half - items_.begin());
  }
  /// Items of bins up to this one part from the others.
  struct Split {
    double cost = no_hit<double>();
    int axis = 0, bin = bins;
    void take(Split const& o) {
      if (o.cost < cost) *this = o;
    }
  };
  static int bin_of(Item const& item, RayBox const& centres, int axis) {
    double const wide = double(centres.hi[axis]) - centres.lo[axis];
    return wide > 0 ? std::clamp(int(bins / wide * (double(item.centre[axis]) - centres.lo[axis])), 0, bins - 1) : 0;
  }
  Split cheapest(int begin, int end, RayBox const& centres, int axis) const {
    RayBox box[bins], right[bins];
    int count[bins] = {};
    for (int i = begin; i < end; ++i) {
      Item const& item = items_[std::size_t(i)];
      int const bin = bin_of(item, centres, axis);
      box[bin].add(item.box);
      ++count[bin];
    }
    right[bins - 1] = box[bins - 1];
    for (int b = bins - 1; b-- > 0;) {
      right[b] = box[b];
      right[b].add(right[b + 1]);
    }
    Split best;
    RayBox left;
    int before = 0;
    for (int b = 0; b + 1 < bins; ++b) {
      left.add(box[b]);
      before += count[b];
      if (before > 0 && before < end - begin) best.take({left.area() * before + right[b + 1].area() * (end - begin - before), axis, b});
    }
    return best;
  }

  std::vector<Item> items_;
  std::vector<RayNode> nodes_;
};

/// A ray that is scaled, as boxes see it. A box is looked at as if it were wider by what rounding may take from an item's place beside the
/// ray. Along an axis on which the ray does not move it is in the box all along or not at all: 1 / 0 times 0 would be NaN.
template <class T>
struct BoxRay {
  Vec3<T> inverse, upper, lower;
  decltype(T(0) < T(0)) moves[3];
  bool all_move = true;
  T from;  // what it meets before counts no more

  GSP_FUNCTION explicit BoxRay(Ray<T> const& ray, T const& begin = T(0)) : from(begin) {
    for (int k = 0; k < 3; ++k) {
      moves[k] = abs(ray.direction[k]) > T(1e-30);
      all_move = all_move && all(moves[k]);
      inverse[k] = select(moves[k], T(1) / ray.direction[k], T(0));
      T const wider = T(0.25) * slack() * abs(ray.origin[k]);
      upper[k] = ray.origin[k] + wider;
      lower[k] = ray.origin[k] - wider;
    }
  }
  GSP_FUNCTION static constexpr T slack() { return roundings<T>(16); }
  /// Where it comes in, less what rounding may have added to that and to an item's x; infinity: never.
  GSP_FUNCTION T entry(RayNode const& n, int side) const {
    T const none = no_hit<T>();
    T near = from, far = none;
    auto never = none < T(0);
    for (int k = 0; k < 3; ++k) {
      T const lo = T(n.lo[side][k]) - upper[k], hi = T(n.hi[side][k]) - lower[k];
      T const a = lo * inverse[k], b = hi * inverse[k];
      if (all_move) {
        near = max(near, min(a, b));
        far = min(far, max(a, b) * (T(1) + slack()));
      } else {
        never = never || (!moves[k] && !(lo <= T(0) && hi >= T(0)));
        near = select(moves[k], max(near, min(a, b)), near);
        far = select(moves[k], min(far, max(a, b) * (T(1) + slack())), far);
      }
    }
    return select(near <= far && !never, near - slack() * min(far, T(1e30)), none);
  }
};

/// Calls take(first, end) for leaves that the ray comes into before most(), which may become less meanwhile: nearer ones first, as far as
/// boxes tell. A leaf is taken when it is next, as a node would be: threads of a GPU that go on in step then look at leaves together, and
/// at nodes together (Aila and Laine, Understanding the efficiency of ray traversal on GPUs, HPG 2009).
template <class T, class Most, class Take>
GSP_FORCEINLINE_FUNCTION void visit_leaves(RayNode const* nodes, BoxRay<T> const& ray, Most const& most, Take const& take) {
  struct Waiting {
    int node;
    T in;
  };
  Waiting stack[ray_tree_depth];
  int waiting = 0, node = 0;
  constexpr int none = ~(1 << 30);  // a leaf of no items behind others: there is no such
  auto const next = [&] {
    while (waiting > 0) {
      Waiting const& top = stack[--waiting];
      if (any(top.in < no_hit<T>() && top.in <= most())) return top.node;  // where nothing is met, most is infinite
    }
    return none;
  };
  while (node != none) {
    while (node >= 0) {
      RayNode const n = nodes[node];
      T const in[2] = {ray.entry(n, 0), ray.entry(n, 1)};
      auto const comes_into = [&](T const& x) { return any(x < no_hit<T>() && x <= most()); };
      bool const here[2] = {comes_into(in[0]), comes_into(in[1])};
      if (here[0] && here[1]) {
        bool const second = mostly(in[1] < in[0]);
        node = second ? n.child[1] : n.child[0];
        stack[waiting++] = second ? Waiting{n.child[0], in[0]} : Waiting{n.child[1], in[1]};
      } else {
        node = here[0] ? n.child[0] : here[1] ? n.child[1] : next();
      }
    }
    while (node < 0 && node != none) {
      int const first = ~node / 8;
      take(first, first + ~node % 8);
      node = next();
    }
  }
}

}  // namespace detail
}  // namespace gsp
