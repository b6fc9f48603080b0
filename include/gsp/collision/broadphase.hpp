#pragma once
#include <cstdint>
#include <gsp/collision/collision_model.hpp>
#include <gsp/core/region.hpp>
#include <gsp/core/status.hpp>
#include <gsp/geometry/shapes.hpp>
#include <gsp/model/poses.hpp>

/// Where the colliders are, and which of the listed pairs are near. Pairs that are not listed are searched for (detail/pair_search.hpp).
namespace gsp {

/// World poses and axis-aligned boxes of colliders and groups. A plane's box is as good as infinite: its pose serves.
template <class R, class Mem>
struct ColliderBounds {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R** [7]> pose;   // (world, collider, 7) position [m], quaternion w x y z
  View<R** [6]> box;    // (world, collider, 6) centre, half extents [m]
  View<R** [6]> group;  // (world, group, 6)
};

namespace detail {

template <class R>
KOKKOS_INLINE_FUNCTION Transform<R> load_pose(R const* p) {
  return {{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
}

template <class R, class Mem>
struct PlaceColliders {
  CollisionModel<R, Mem> model;
  Poses<R, Mem> poses;
  ColliderBounds<R, Mem> bounds;
  std::uint32_t* status = nullptr;  // cleared on the way, where given: (worlds)
  std::uint8_t* lost = nullptr;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    int const w = int(item / model.groups), g = int(item % model.groups);
    if (g == 0 && status != nullptr) status[w] = 0;
    if (g == 0 && lost != nullptr) lost[w] = 0;
    place(w, g);
  }
  KOKKOS_FORCEINLINE_FUNCTION void place(int w, int g) const {
    Vec3<R> lo{}, hi{};
    R broken(0);  // NaN where a number is not finite: min and max would lose it, and a plane's box has no orientation in it
    for (int c = model.group_first(g); c < model.group_first(g + 1); ++c) {
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
      for (int i = 3; i < 7; ++i) broken = broken + (p[i] - p[i]);
      Vec3<R> e = half_extents(ShapeType(model.collider_type(c)), model.data_of(w, c), to_matrix(t.q));
      for (int i = 0; i < 3; ++i) {
        e[i] = e[i] + R(8) * Kokkos::Experimental::epsilon_v<R> * (abs(t.p[i]) + e[i]);  // rounding must not lose a touch
        bounds.box(w, c, i) = t.p[i];
        bounds.box(w, c, 3 + i) = e[i];
        broken = broken + ((t.p[i] - t.p[i]) + (e[i] - e[i]));
        bool const first = c == model.group_first(g);
        lo[i] = first ? t.p[i] - e[i] : min(lo[i], t.p[i] - e[i]);
        hi[i] = first ? t.p[i] + e[i] : max(hi[i], t.p[i] + e[i]);
      }
    }
    for (int i = 0; i < 3; ++i) {
      R const centre = R(0.5) * (lo[i] + hi[i]);
      bounds.group(w, g, i) = centre + broken;
      bounds.group(w, g, 3 + i) = max(hi[i] - centre, centre - lo[i]) + R(2) * Kokkos::Experimental::epsilon_v<R> * abs(centre);
    }
  }
};

/// Two boxes (centre, half extents) are within `reach` of each other. False for NaN: a broken world makes no contacts, and has
/// status::not_finite.
template <class R>
KOKKOS_INLINE_FUNCTION bool boxes_near(R const* a, R const* b, R reach) {
  return abs(a[0] - b[0]) <= a[3] + b[3] + reach && abs(a[1] - b[1]) <= a[4] + b[4] + reach && abs(a[2] - b[2]) <= a[5] + b[5] + reach;
}
/// A box is within `reach` of the half space below a plane.
template <class R>
KOKKOS_INLINE_FUNCTION bool plane_near(R const* plane, R const* box, R reach) {
  Transform<R> const t = load_pose(plane);
  Vec3<R> const n = rotate(t.q, Vec3<R>{R(0), R(0), R(1)});
  return dot(n, Vec3<R>{box[0], box[1], box[2]} - t.p) - (abs(n.x) * box[3] + abs(n.y) * box[4] + abs(n.z) * box[5]) <= reach;
}

/// mask(chunk * worlds + world): bit i set where pair first + i of the chunk is near. Groups first, then the pairs of the groups that are
/// near.
template <class R, class Mem>
struct FindNearPairs {
  CollisionModel<R, Mem> model;
  ColliderBounds<R, Mem> bounds;
  Kokkos::View<std::uint64_t*, Mem> mask;
  int worlds;
  std::uint32_t* status;  // (worlds) or null
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    // A device's threads read one chunk of neighbouring worlds; a host's thread all chunks of a world, whose boxes stay in its cache.
    constexpr bool by_world = !is_device<typename Mem::execution_space>;
    int const c = int(by_world ? item % model.chunks : item / worlds), w = int(by_world ? item / model.chunks : item % worlds);
    CollisionChunk const chunk = model.chunk(c);
    bool const plane = is_among(plane_kinds, PairKind(chunk.kind));
    R const early = model.early(w);
    R const* const poses = &bounds.pose(w, 0, 0);  // rows of one world lie one after another
    R const* const boxes = &bounds.box(w, 0, 0);
    R const* const groups = &bounds.group(w, 0, 0);
    std::uint64_t bits = 0;
    R broken(0);
    for (int r = chunk.run_first; r < chunk.run_end; ++r) {
      CollisionRun<R> const& run = model.runs(r);
      R const reach = run.reach + early;
      broken = broken + (groups[6 * run.a] + groups[6 * run.b]);
      if (plane ? !plane_near(poses + 7 * model.group_first(run.a), groups + 6 * run.b, reach)
                : run.a != run.b && !boxes_near(groups + 6 * run.a, groups + 6 * run.b, reach))
        continue;
      for (int p = run.first; p < run.end; ++p) {
        int const a = model.pair_collider(p, 0), b = model.pair_collider(p, 1);
        bool const near = plane ? plane_near(poses + 7 * a, boxes + 6 * b, reach) : boxes_near(boxes + 6 * a, boxes + 6 * b, reach);
        bits |= std::uint64_t(near) << (p - chunk.first);
      }
    }
    if (status != nullptr && !(broken - broken == R(0))) Kokkos::atomic_or(&status[w], gsp::status::not_finite);
    mask(std::int64_t(c) * worlds + w) = bits;
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
  Kokkos::parallel_for("gsp::collision::place_colliders",
                       lightweight(Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, n)),
                       detail::PlaceColliders<R, Mem>{model, poses, bounds, status, lost});
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
  Kokkos::parallel_for("gsp::collision::find_near_pairs",
                       lightweight(Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(mask.extent(0)))),
                       detail::FindNearPairs<R, Mem>{model, bounds, mask, worlds, status});
}

}  // namespace gsp
