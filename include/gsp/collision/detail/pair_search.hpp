#pragma once
#include <bit>
#include <gsp/collision/broadphase.hpp>
#include <gsp/collision/detail/box_tree.hpp>
#include <gsp/collision/detail/pair_search_maker.hpp>
#include <gsp/parallel/detail/for_items.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/parallel/sort_by_key.hpp>

/// The search for near pairs where they are too many to list: two trees of boxes a world, over the colliders that move, sorted along a
/// curve in each call, and over the others, which keep their order and are placed again where their bodies have moved. Which pairs are
/// near does not hang on the trees; a mover's are sorted by their number.
namespace gsp::detail {

template <class R, class Mem>
struct PairSearch {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R*> moving_tree, still_tree;        // (worlds, blocks, block_reals)
  View<R** [7]> seen;                      // (worlds, still bodies) the pose for which what is still was placed
  View<std::uint8_t*> moved;               // (worlds) some of them have another now
  View<R** [6]> part;                      // (worlds, parts) low, high of centres of movers
  Kokkos::View<std::uint64_t*, Mem> keys;  // (worlds, movers) the world, and places on the curve
  Kokkos::View<int*, Mem> order;           // (worlds, movers) colliders by place
  SortScratch<std::uint64_t, Mem> sort;
  Kokkos::View<std::int64_t, Mem> items;  // worlds * movers
  static constexpr int kept = 16;
  View<int* [kept]> other;         // (worlds * movers) with whom, where they are no more
  View<int* [2]> found;            // (worlds * movers) pairs of a mover, and the most points that they give
  View<std::int64_t*> first_slot;  // (worlds * movers) of their points
  Kokkos::View<R*, Mem> placed;    // the model's numbers for which `seen` holds: kept, so that no other model's come to lie there
};

/// The groups of movers (first = 0), or of what stands still.
template <class R, class Mem>
struct PlaceGroups {
  PlaceColliders<R, Mem> all;
  int first, count;
  std::uint8_t* moved;  // (worlds) movers: cleared; what stands still: only there
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    int const w = int(item / count), g = first + int(item % count);
    if (g == 0) {
      all.status[w] = 0;
      all.lost[w] = 0;
      moved[w] = 0;
    }
    if (first == 0 || moved[w] != 0) all.place(w, g);
    // What stands still is looked at once its numbers have changed; movers: CountNearPairs, after status is cleared.
    if (first == 0 || moved[w] == 0) return;
    if (R const x = all.bounds.group(w, 0, g); !(x - x == R(0))) Kokkos::atomic_or(&all.status[w], gsp::status::not_finite);
  }
};

/// moved(world) <- 1 where a body is elsewhere than it was seen.
template <class R, class Mem>
struct FindMovedBodies {
  CollisionModel<R, Mem> model;
  Poses<R, Mem> poses;
  PairSearch<R, Mem> search;
  bool always;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    int const bodies = int(model.still_body.extent(0)), w = int(item / bodies), k = int(item % bodies), b = model.still_body(k);
    bool moved = always;
    for (int i = 0; i < 7; ++i) {
      R const now = i < 3 ? poses.xpos(w, b, i) : poses.xquat(w, b, i - 3);
      moved = moved || !(search.seen(w, k, i) == now);
      search.seen(w, k, i) = now;
    }
    if (moved) search.moved(w) = 1;  // whoever finds it writes the same
  }
};

/// The lowest level of a tree: boxes of colliders, as much larger as they reach.
template <class R, class Mem>
struct FillLeaves {
  CollisionModel<R, Mem> model;
  ColliderBounds<R, Mem> bounds;
  BoxTreeShape shape;
  R* trees;
  int const* order;
  int order_stride;           // of a world
  std::uint8_t const* where;  // (worlds) only there, if given
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    int const n = shape.blocks_of(0), w = int(item / n), j = int(item % n);
    if (where != nullptr && where[w] == 0) return;
    R* const block = trees + std::int64_t(block_reals) * (std::int64_t(w) * shape.blocks + j);
    clear_block(block);
    for (int c = 0; c < 8 && 8 * j + c < shape.leaves; ++c) {
      int const collider = order[std::int64_t(w) * order_stride + 8 * j + c];
      if (is_wide(ShapeType(model.collider_type(collider)))) continue;
      R low[3], high[3];
      reached_box(model, bounds, w, collider, R(0), low, high);
      for (int i = 0; i < 3; ++i) {
        block[8 * i + c] = low[i];
        block[24 + 8 * i + c] = high[i];
      }
    }
  }
  /// Rounding must not make it smaller.
  KOKKOS_INLINE_FUNCTION static void reached_box(CollisionModel<R, Mem> const& model, ColliderBounds<R, Mem> const& bounds, int w,
                                                 int collider, R more, R* low, R* high) {
    for (int i = 0; i < 3; ++i) {
      R const centre = bounds.box(w, i, collider), reach = bounds.box(w, 3 + i, collider) + model.collider_reach(collider) + more;
      R const e = reach + R(4) * Kokkos::Experimental::epsilon_v<R> * (abs(centre) + abs(reach));
      low[i] = centre - e;
      high[i] = centre + e;
    }
  }
};

/// The other levels.
template <class R>
struct JoinLevels {
  BoxTreeShape shape;
  R* trees;
  std::uint8_t const* where;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    if (where != nullptr && where[world.rank] == 0) return;
    R* const tree = trees + std::int64_t(block_reals) * world.rank * shape.blocks;
    for (int level = 1; level < shape.levels; ++level) {
      world.each(shape.blocks_of(level), [&](int j) { join_blocks(shape, tree, level, j); });
      world.sync();
    }
  }
};

/// Low and high of the centres of each part of the movers: mover m is in part m mod parts.
template <class R, class Mem>
struct BoundMovers {
  static constexpr int parts = 32;
  CollisionModel<R, Mem> model;
  ColliderBounds<R, Mem> bounds;
  PairSearch<R, Mem> search;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    int const w = int(item / parts), part = int(item % parts);
    R* const range = &search.part(w, part, 0);
    for (int i = 0; i < 3; ++i) {
      range[i] = Kokkos::Experimental::infinity_v<R>;
      range[3 + i] = -Kokkos::Experimental::infinity_v<R>;
    }
    for (int m = part; m < model.movers; m += parts)
      for (int i = 0; i < 3; ++i) {
        R const x = bounds.box(w, i, m);
        range[i] = x < range[i] ? x : range[i];
        range[3 + i] = x > range[3 + i] ? x : range[3 + i];
      }
  }
};
template <class R, class Mem>
struct KeyMovers {
  CollisionModel<R, Mem> model;
  ColliderBounds<R, Mem> bounds;
  PairSearch<R, Mem> search;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    int const w = int(item / model.movers), m = int(item % model.movers);
    R low[3], size(0);
    for (int i = 0; i < 3; ++i) {
      low[i] = search.part(w, 0, i);
      R high = search.part(w, 0, 3 + i);
      for (int part = 1; part < BoundMovers<R, Mem>::parts; ++part) {
        low[i] = min(low[i], search.part(w, part, i));
        high = max(high, search.part(w, part, 3 + i));
      }
      size = max(size, high - low[i]);
    }
    R const centre[3] = {bounds.box(w, 0, m), bounds.box(w, 1, m), bounds.box(w, 2, m)};
    search.keys(item) = std::uint64_t(w) << 30 | place_on_curve(centre, low, size > R(0) ? R(1024) / size : R(0));
    search.order(item) = m;
  }
};

template <class R, class Mem>
struct NearPairs {
  CollisionModel<R, Mem> model;
  ColliderBounds<R, Mem> bounds;
  PairSearch<R, Mem> search;
  /// f(other) for each collider with which mover m is a pair that is near, in any order.
  template <class F>
  KOKKOS_INLINE_FUNCTION void each(int w, int m, F const& f) const {
    if (is_wide(ShapeType(model.collider_type(m)))) return;
    R low[3], high[3];
    FillLeaves<R, Mem>::reached_box(model, bounds, w, m, model.early(w), low, high);
    int const* const order = search.order.data() + std::int64_t(w) * model.movers;
    R const* const moving = search.moving_tree.data() + std::int64_t(block_reals) * w * model.moving_tree.blocks;
    for_leaves_near(model.moving_tree, moving, low, high, [&](int leaf) {
      int const other = order[leaf];
      if (other > m && model.may_meet(m, other)) f(other);
    });
    R const* const still = search.still_tree.data() + std::int64_t(block_reals) * w * model.still_tree.blocks;
    for_leaves_near(model.still_tree, still, low, high, [&](int leaf) {
      int const other = model.still_order(leaf);
      if (model.may_meet(m, other)) f(other);
    });
  }
  KOKKOS_INLINE_FUNCTION PairKind kind_of(int m, int other) const {
    int const a = model.collider_type(m), b = model.collider_type(other);
    return a < b ? pair_kind(ShapeType(a), ShapeType(b)) : pair_kind(ShapeType(b), ShapeType(a));
  }
};

template <class R, class Mem>
struct CountNearPairs {
  NearPairs<R, Mem> near;
  std::uint32_t* status;  // (worlds): not_finite where the box of a mover is not
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    int const w = int(item / near.model.movers), m = int(item % near.model.movers);
    R sum(0);
    for (int i = 0; i < 6; ++i) sum = sum + near.bounds.box(w, i, m);
    if (!(sum - sum == R(0))) Kokkos::atomic_or(&status[w], gsp::status::not_finite);
    int pairs = 0, points = 0;
    near.each(w, m, [&](int other) {
      if (pairs < PairSearch<R, Mem>::kept) near.search.other(item, pairs) = other;
      ++pairs;
      points += max_points(near.kind_of(m, other));
    });
    near.search.found(item, 0) = pairs;
    near.search.found(item, 1) = points;
  }
};

template <class R, class Mem>
PairSearch<R, Mem> make_pair_search(auto const& exec, CollisionModel<R, Mem> const& model, int worlds) {
  PairSearch<R, Mem> s;
  if (model.movers == 0) return s;
  auto const make = [&](auto& v, char const* name, auto... extents) {
    v = allocate_zero<std::decay_t<decltype(v)>>(exec, std::string("gsp::Contacts::") + name, extents...);
  };
  std::size_t const w = worlds, items = w * model.movers;
  make(s.moving_tree, "moving_tree", w * model.moving_tree.blocks * block_reals);
  make(s.still_tree, "still_tree", w * model.still_tree.blocks * block_reals);
  make(s.seen, "seen", w, model.still_body.extent(0));
  make(s.moved, "moved", w);
  make(s.part, "part", w, std::size_t(BoundMovers<R, Mem>::parts));
  make(s.keys, "keys", items);
  make(s.order, "order", items);
  make(s.other, "other", items);
  make(s.found, "found", items);
  make(s.first_slot, "first_slot", items);
  s.sort = make_sort_scratch<std::uint64_t>(exec, std::int64_t(items));
  s.items = allocate<Kokkos::View<std::int64_t, Mem>>("gsp::Contacts::items");
  std::int64_t const count = std::int64_t(items);
  upload_bytes(exec, s.items.data(), &count, sizeof count);
  exec.fence("gsp::make_contacts: the number on the host may go now");
  return s;
}

/// Places colliders and counts the near pairs of each mover.
template <class R, class Mem>
void search_pairs(auto const& exec, CollisionModel<R, Mem> const& model, Poses<R, Mem> const& poses, ColliderBounds<R, Mem>& bounds,
                  PairSearch<R, Mem>& s, std::uint32_t* status, std::uint8_t* lost) {
  std::int64_t const worlds = std::int64_t(bounds.pose.extent(0)), items = worlds * model.movers;
  auto const run = [&](char const* label, std::int64_t n, auto const& functor) { for_items(label, exec, n, functor); };
  auto const build = [&](BoxTreeShape const& shape, R* trees, int const* order, int order_stride, std::uint8_t const* where) {
    run("gsp::collision::fill_leaves", worlds * shape.blocks_of(0),
        FillLeaves<R, Mem>{model, bounds, shape, trees, order, order_stride, where});
    if (shape.levels > 1) for_worlds("gsp::collision::join_levels", exec, int(worlds), JoinLevels<R>{shape, trees, where});
  };
  // Shapes and poses that worlds have of their own may change at any time, and so may those of another model.
  bool const always = model.collider_pose.stride > 0 || model.collider_size.stride > 0 || s.placed.data() != model.reals.data();
  s.placed = model.reals;
  PlaceColliders<R, Mem> const place{model, poses, bounds, status, lost};
  int const still_groups = model.groups - model.moving_groups;
  run("gsp::collision::place_colliders", worlds * model.moving_groups, PlaceGroups<R, Mem>{place, 0, model.moving_groups, s.moved.data()});
  run("gsp::collision::find_moved_bodies", worlds * std::int64_t(model.still_body.extent(0)),
      FindMovedBodies<R, Mem>{model, poses, s, always});
  run("gsp::collision::place_colliders", worlds * still_groups,
      PlaceGroups<R, Mem>{place, model.moving_groups, still_groups, s.moved.data()});
  build(model.still_tree, s.still_tree.data(), model.still_order.data(), 0, s.moved.data());
  run("gsp::collision::bound_movers", worlds * BoundMovers<R, Mem>::parts, BoundMovers<R, Mem>{model, bounds, s});
  run("gsp::collision::key_movers", items, KeyMovers<R, Mem>{model, bounds, s});
  sort_by_key(exec, s.keys, s.order, s.sort, s.items, {.bits = 30 + int(std::bit_width(std::uint64_t(worlds - 1)))});
  build(model.moving_tree, s.moving_tree.data(), s.order.data(), model.movers, nullptr);
  run("gsp::collision::count_near_pairs", items, CountNearPairs<R, Mem>{{model, bounds, s}, status});
}

}  // namespace gsp::detail
