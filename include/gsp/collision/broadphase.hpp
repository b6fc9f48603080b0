#pragma once
#include <cstdint>
#include <cstring>
#include <gsp/collision/collision_model.hpp>
#include <gsp/core/region.hpp>
#include <gsp/core/status.hpp>
#include <gsp/geometry/shapes.hpp>
#include <gsp/math/pack.hpp>
#include <gsp/model/poses.hpp>
#include <gsp/parallel/detail/for_items.hpp>
#include <string>

/// Where the colliders are, and which of the listed pairs are near. Pairs that are not listed are searched for (detail/pair_search.hpp).
namespace gsp {

/// World poses and axis-aligned boxes of colliders and groups. A plane's box is as good as infinite: its pose serves. Each number of boxes
/// lies beside the same of the next one's, and a host has room beyond the last for a whole span.
template <class R, class Mem>
struct ColliderBounds {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R** [7]> pose;  // (world, collider, 7) position [m], quaternion w x y z
  View<R***> box;      // (world, 6, colliders + box_room) centre, half extents [m]
  View<R***> group;    // (world, 6, groups + box_room)
  static constexpr int box_room = is_device<typename Mem::execution_space> ? 0 : CollisionSpan<R>::most - 1;
};

namespace detail {

template <class R>
KOKKOS_INLINE_FUNCTION Transform<R> load_pose(R const* p) {
  return {{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
}

/// What the boxes of a group's colliders reach.
template <class R>
struct GroupBox {
  static constexpr R most = Kokkos::Experimental::infinity_v<R>;
  Vec3<R> lo{most, most, most}, hi{-most, -most, -most};
  R broken{0};  // NaN where a number is not finite: min and max would lose it, and a plane's box has no orientation in it
};

/// f.place(world, group) for each, and what stands beside it, by several threads of a GPU (place_colliders_cuda.hpp).
template <class Exec, class F>
void launch_groups(std::string const& label, Exec const& exec, std::int64_t items, F const& f);

template <class R, class Mem>
struct PlaceColliders {
  using real_type = R;
  CollisionModel<R, Mem> model;
  Poses<R, Mem> poses;
  ColliderBounds<R, Mem> bounds;
  std::uint32_t* status = nullptr;  // cleared on the way, where given: (worlds)
  std::uint8_t* lost = nullptr;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    begin(item);
    place(int(item / model.groups), int(item % model.groups));
  }
  KOKKOS_FORCEINLINE_FUNCTION void begin(std::int64_t item) const {
    int const w = int(item / model.groups), g = int(item % model.groups);
    if (g == 0 && status != nullptr) status[w] = 0;
    if (g == 0 && lost != nullptr) lost[w] = 0;
  }
  KOKKOS_FORCEINLINE_FUNCTION void place(int w, int g) const {
    GroupBox<R> group;
    for (int c = model.group_first(g); c < model.group_first(g + 1); ++c) place_one(w, c, group);
    leave(w, g, group);
  }
  /// A collider, whose group's box grows by its own.
  KOKKOS_FORCEINLINE_FUNCTION void place_one(int w, int c, GroupBox<R>& group) const {
    std::size_t const stride = bounds.box.extent(2);
    int const b = model.collider_body(c);
    Transform<R> const body{{poses.xpos(w, b, 0), poses.xpos(w, b, 1), poses.xpos(w, b, 2)},
                            {poses.xquat(w, b, 0), poses.xquat(w, b, 1), poses.xquat(w, b, 2), poses.xquat(w, b, 3)}};
    Transform<R> const t = body * load_pose(model.collider_pose.row(w) + 7 * c);
    R* const p = &bounds.pose(w, c, 0);
    p[0] = t.p.x;
    p[1] = t.p.y;
    p[2] = t.p.z;
    p[3] = t.q.w;
    p[4] = t.q.x;
    p[5] = t.q.y;
    p[6] = t.q.z;
    for (int i = 3; i < 7; ++i) group.broken = group.broken + (p[i] - p[i]);
    Vec3<R> e = half_extents(ShapeType(model.collider_type(c)), model.data_of(w, c), to_matrix(t.q));
    R* const box = &bounds.box(w, 0, c);
    for (int i = 0; i < 3; ++i) {
      e[i] = e[i] + R(8) * Kokkos::Experimental::epsilon_v<R> * (abs(t.p[i]) + e[i]);  // rounding must not lose a touch
      box[i * stride] = t.p[i];
      box[(3 + i) * stride] = e[i];
      group.broken = group.broken + ((t.p[i] - t.p[i]) + (e[i] - e[i]));
      group.lo[i] = min(group.lo[i], t.p[i] - e[i]);
      group.hi[i] = max(group.hi[i], t.p[i] + e[i]);
    }
  }
  KOKKOS_FORCEINLINE_FUNCTION void leave(int w, int g, GroupBox<R> const& group) const {
    for (int i = 0; i < 3; ++i) {
      R const centre = R(0.5) * (group.lo[i] + group.hi[i]);
      bounds.group(w, i, g) = centre + group.broken;
      bounds.group(w, 3 + i, g) = max(group.hi[i] - centre, centre - group.lo[i]) + R(2) * Kokkos::Experimental::epsilon_v<R> * abs(centre);
    }
  }
};

/// mask(chunk * worlds + world): bit i set where pair first + i of the chunk is near. Groups first, then the colliders of the groups that
/// are near; a host looks at as many at once as a vector holds.
///   boxes     |c_a - c_b| <= e_a + e_b + reach along each axis
///   a plane   n . (c - p) - |n| . e <= reach: the box is within reach of the half space below
/// False for NaN: a broken world makes no contacts, and has status::not_finite.
/// @tparam by_warp  on a GPU: the threads of a warp find the bits of an item together, all of them the same
template <class R, class Mem, bool by_warp = false>
struct FindNearPairs {
  CollisionModel<R, Mem> model;
  ColliderBounds<R, Mem> bounds;
  Kokkos::View<std::uint64_t*, Mem> mask;
  int worlds;
  std::uint32_t* status;  // (worlds) or null
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    // A device's threads read one chunk of neighbouring worlds; a host's thread all chunks of a world, whose boxes stay in its cache.
    int const c = int(on_host ? item % model.chunks : item / worlds), w = int(on_host ? item / model.chunks : item % worlds);
    CollisionChunk const chunk = model.chunk(c);
    bool const plane = is_among(plane_kinds, PairKind(chunk.kind));
    R const early = model.early(w);
    Boxes const groups{&bounds.group(w, 0, 0), bounds.group.extent(2)}, boxes{&bounds.box(w, 0, 0), bounds.box.extent(2)};
    std::uint64_t bits = 0;
    auto const look_at = [&](CollisionSpan<R> const& span) {
      for_near(span, plane ? near_plane(w, span.fixed, span, boxes, early) : near_boxes(span, boxes, early),
               [&](int pair) { bits |= std::uint64_t(1) << pair; });
    };
    for (int s = chunk.single_first; s < chunk.single_end; ++s) look_at(model.single_spans(s));
    for (int g = chunk.group_first; g < chunk.group_end; ++g) {
      CollisionSpan<R> const of_groups = model.group_spans(g);
      for_near(of_groups,
               plane ? near_plane(w, model.group_first(of_groups.fixed), of_groups, groups, early) : near_boxes(of_groups, groups, early),
               [&](int r) {
                 CollisionRun const run = model.runs(r);
                 for (int s = run.first; s < run.end; ++s) look_at(model.spans(s));
               });
    }
    mask(std::int64_t(c) * worlds + w) = bits;
    if (status == nullptr) return;
    R broken(0);  // each chunk looks at some of the groups
    for (int g = c; g < model.groups; g += model.chunks) broken = broken + groups(0, g);
    if (!(broken - broken == R(0))) Kokkos::atomic_or(&status[w], gsp::status::not_finite);
  }

 private:
  static constexpr bool on_host = !is_device<typename Mem::execution_space>;
  struct Boxes {
    R const* at;
    std::size_t stride;
    KOKKOS_INLINE_FUNCTION R const& operator()(int i, int k) const { return at[i * stride + k]; }
  };
  /// f(number) of each bit of `near`.
  template <class F>
  KOKKOS_INLINE_FUNCTION static void for_near(CollisionSpan<R> const& span, std::uint32_t near, F const& f) {
    for (; near != 0; near &= near - 1) f(span.at + Kokkos::popcount(span.others & ((near & (0 - near)) - 1)));
  }
  KOKKOS_INLINE_FUNCTION static std::uint32_t near_boxes(CollisionSpan<R> const& span, Boxes const& boxes, R early) {
    R own[6];
    for (int i = 0; i < 6; ++i) own[i] = boxes(i, span.fixed) + (i < 3 ? R(0) : span.reach + early);
    return near_of(span, boxes, [&](auto const& other) {
      return abs(other[0] - own[0]) <= other[3] + own[3] && abs(other[1] - own[1]) <= other[4] + own[4] &&
             abs(other[2] - own[2]) <= other[5] + own[5];
    });
  }
  KOKKOS_INLINE_FUNCTION std::uint32_t near_plane(int w, int plane, CollisionSpan<R> const& span, Boxes const& boxes, R early) const {
    Transform<R> const t = load_pose(&bounds.pose(w, plane, 0));
    Vec3<R> const n = rotate(t.q, Vec3<R>{R(0), R(0), R(1)}), size{abs(n.x), abs(n.y), abs(n.z)};
    return near_of(span, boxes, [&](auto const& other) {
      auto const height = n.x * (other[0] - t.p.x) + n.y * (other[1] - t.p.y) + n.z * (other[2] - t.p.z);
      return height - (size.x * other[3] + size.y * other[4] + size.z * other[5]) <= span.reach + early;
    });
  }
  /// The bits of span.others where near(box) holds.
  template <class Near>
  KOKKOS_INLINE_FUNCTION static std::uint32_t near_of(CollisionSpan<R> const& span, Boxes const& boxes, Near const& near) {
    std::uint32_t bits = 0;
    if constexpr (by_warp) {
#ifdef __CUDA_ARCH__
      int const k = int(threadIdx.x) % 32;
      bool own = (span.others >> k) & 1u;
      if (own) {
        R box[6];
        for (int i = 0; i < 6; ++i) box[i] = boxes(i, span.first + k);
        own = near(box);
      }
      return __ballot_sync(0xffffffffu, own);
#endif
    }
    if constexpr (on_host)
      if (Kokkos::popcount(span.others) > 2) {
        using T = Pack<R, native_width<R>>;
        for (int k = 0; k < CollisionSpan<R>::most && span.others >> k != 0; k += T::width) {
          T box[6];
          for (int i = 0; i < 6; ++i) std::memcpy(&box[i], &boxes(i, span.first + k), sizeof(T));
          bits |= lane_bits(near(box)) << k;
        }
        return bits & span.others;
      }
    for (std::uint32_t left = span.others; left != 0; left &= left - 1) {
      int const k = Kokkos::countr_zero(left);
      R box[6];
      for (int i = 0; i < 6; ++i) box[i] = boxes(i, span.first + k);
      bits |= std::uint32_t(near(box)) << k;
    }
    return bits;
  }
};

}  // namespace detail

/// Places colliders and groups: one work item a (world, group). Sets `status` and `lost` (worlds) to 0 on the way, where given.
template <ExecutionSpace Exec, class R, class Mem>
void place_colliders(Exec const& exec, CollisionModel<R, Mem> const& model, Poses<R, Mem> const& poses, ColliderBounds<R, Mem>& bounds,
                     std::uint32_t* status = nullptr, std::uint8_t* lost = nullptr) {
  Region const region("gsp::collision::place_colliders");
  static_assert(can_access<Exec, CollisionModel<R, Mem>>, "gsp::place_colliders: the model is not accessible from this execution space");
  std::int64_t const n = std::int64_t(bounds.pose.extent(0)) * model.groups;
  detail::PlaceColliders<R, Mem> const place{model, poses, bounds, status, lost};
  if constexpr (is_device<Exec>)
    detail::launch_groups("gsp::collision::place_colliders", exec, n, place);
  else
    Kokkos::parallel_for("gsp::collision::place_colliders", Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, n), place);
}

/// Finds the near pairs: one work item a (chunk, world), mask (chunks * worlds) as 64 bits a chunk.
/// @param status  (worlds) or null: gets status::not_finite where a pose or size is not
template <ExecutionSpace Exec, class R, class Mem>
void find_near_pairs(Exec const& exec, CollisionModel<R, Mem> const& model, ColliderBounds<R, Mem> const& bounds,
                     Kokkos::View<std::uint64_t*, Mem>& mask, std::uint32_t* status = nullptr) {
  Region const region("gsp::collision::find_near_pairs");
  static_assert(can_access<Exec, CollisionModel<R, Mem>>, "gsp::find_near_pairs: the model is not accessible from this execution space");
  int const worlds = int(bounds.pose.extent(0));
  expects(mask.extent(0) == std::size_t(model.chunks) * worlds, "gsp::find_near_pairs: the mask must hold chunks x worlds words");
  std::int64_t const items = std::int64_t(mask.extent(0));
  if constexpr (is_device<Exec>)  // where there are few: a warp's threads look at a box of a span each, as one took 50 to 80 us of a crowd
    if (detail::has_warps(exec, items))
      return detail::launch_items<32>("gsp::collision::find_near_pairs", exec, items,
                                      detail::FindNearPairs<R, Mem, true>{model, bounds, mask, worlds, status});
  detail::for_items("gsp::collision::find_near_pairs", exec, items, detail::FindNearPairs<R, Mem>{model, bounds, mask, worlds, status});
}

}  // namespace gsp

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/collision/detail/place_colliders_cuda.hpp>
#endif
