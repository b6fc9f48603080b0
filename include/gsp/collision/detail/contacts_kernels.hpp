#pragma once
#include <gsp/collision/broadphase.hpp>
#include <gsp/collision/detail/pair_search.hpp>
#include <gsp/collision/detail/still_contacts.hpp>
#include <gsp/collision/manifold.hpp>
#include <gsp/collision/narrowphase.hpp>
#include <gsp/core/status.hpp>
#include <gsp/fwd.hpp>
#include <gsp/math/spatial.hpp>
#include <gsp/model/detail/stamp.hpp>

/// Kernels of gsp/collision/contacts.hpp, where the contract stands, and what they keep between them.
namespace gsp::detail {

struct Candidate {
  int world, pair, slot;
  short kind;   // PairKind
  short count;  // room for points, then how many there are
  int first;    // devices: the first of its contacts; -1: they do not fit
};
struct CandidateSum {
  std::int64_t candidates = 0, points = 0;
  KOKKOS_INLINE_FUNCTION CandidateSum& operator+=(CandidateSum const& o) {
    candidates += o.candidates;
    points += o.points;
    return *this;
  }
};
template <class R, class Mem>
struct ContactScratch {
  ColliderBounds<R, Mem> bounds;
  Kokkos::View<std::uint64_t*, Mem> mask;  // (chunks * worlds)
  Kokkos::View<std::int64_t*, Mem> first;  // (chunks * worlds + worlds * movers) first candidate of an item
  Kokkos::View<Candidate*, Mem> candidates;
  Kokkos::View<ContactPoint<R>*, Mem> points;
  Kokkos::View<std::uint8_t*, Mem> lost;   // (worlds) candidates did not fit
  Kokkos::View<std::int64_t*, Mem> total;  // (3) candidates, points, contacts that were needed
  Kokkos::View<std::int64_t*, Mem> most;   // (3) the same, the most that did not fit in any call since the pools grew
};
struct ContactsStamp {
  Stamp poses;                  // what they were found at
  std::uint64_t made = 0;       // which call has written them; 0: none of gsp
  bool lost = false;            // their pools have grown since
  void const* pool = nullptr;   // where they were written: Contacts::dist
  void const* model = nullptr;  // of which model: CollisionModel::collider_body
};

/// Counts the candidates of the items before, then writes this item's: of chunks of pairs, then of movers, whose are written later.
template <class R, class Mem>
struct WriteCandidates {
  using value_type = CandidateSum;
  CollisionModel<R, Mem> model;
  ContactScratch<R, Mem> s;
  PairSearch<R, Mem> search;
  int worlds;
  std::int64_t masks, items;
  KOKKOS_FUNCTION void operator()(std::int64_t item, value_type& sum, bool last) const {
    if (item >= masks) return write_mover(item, sum, last);
    std::uint64_t bits = s.mask(item);
    CollisionChunk const chunk = model.chunk(int(item / worlds));
    int const n = Kokkos::popcount(bits), each = chunk.points;
    if (last) {
      int const w = int(item % worlds);
      if (has_room(item, w, sum, n, std::int64_t(n) * each)) {
        int slot = int(sum.points);
        std::int64_t k = sum.candidates;
        for (int i = 0; bits != 0; ++i, bits >>= 1) {
          int const skip = Kokkos::countr_zero(bits);
          i += skip;
          bits >>= skip;
          s.candidates(k++) = {w, chunk.first + i, slot, short(chunk.kind), short(each), -1};
          slot += each;
        }
      }
    }
    sum.candidates += n;
    sum.points += std::int64_t(n) * each;
  }
  KOKKOS_INLINE_FUNCTION void write_mover(std::int64_t item, value_type& sum, bool last) const {
    std::int64_t const mover = item - masks;
    int const n = search.found(mover, 0), points = search.found(mover, 1);
    if (last) {
      search.first_slot(mover) = sum.points;
      if (!has_room(item, int(mover / model.movers), sum, n, points)) search.first_slot(mover) = -1;
    }
    sum.candidates += n;
    sum.points += points;
  }
  /// Notes where the item begins, and if it is the last, what all of them need.
  KOKKOS_INLINE_FUNCTION bool has_room(std::int64_t item, int w, value_type const& sum, int n, std::int64_t points) const {
    s.first(item) = sum.candidates;
    if (item == items - 1) {
      s.total(0) = sum.candidates + n;
      s.total(1) = sum.points + points;
    }
    if (sum.candidates + n <= std::int64_t(s.candidates.extent(0)) && sum.points + points <= std::int64_t(s.points.extent(0))) return true;
    if (n > 0) s.lost(w) = 1;  // whoever finds it writes the same
    // The narrow phase runs over the candidates that fit: leave none of this item undefined.
    for (std::int64_t k = sum.candidates; k < sum.candidates + n && k < std::int64_t(s.candidates.extent(0)); ++k)
      s.candidates(k) = {w, -1, 0, 0, 0, -1};
    return false;
  }
};

/// x(0) ... x(n - 1) ascend: heapsort, which needs no memory.
template <class Numbers>
KOKKOS_INLINE_FUNCTION void sort_in_place(Numbers const& x, int n) {
  auto const sift_down = [&](int root, int end) {
    for (int child = 2 * root + 1; child < end; child = 2 * root + 1) {
      if (child + 1 < end && x(child + 1) > x(child)) ++child;
      if (x(root) >= x(child)) return;
      Kokkos::kokkos_swap(x(root), x(child));
      root = child;
    }
  };
  for (int root = n / 2 - 1; root >= 0; --root) sift_down(root, n);
  for (int end = n - 1; end > 0; --end) {
    Kokkos::kokkos_swap(x(0), x(end));
    sift_down(0, end);
  }
}

/// The candidates of a mover, in the order of their pairs.
template <class R, class Mem>
struct WriteNearPairs {
  NearPairs<R, Mem> near;
  ContactScratch<R, Mem> s;
  std::int64_t masks;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    int const w = int(item / near.model.movers), m = int(item % near.model.movers), n = near.search.found(item, 0);
    std::int64_t slot = near.search.first_slot(item);
    if (n == 0 || slot < 0) return;
    Candidate* const own = &s.candidates(s.first(masks + item));
    auto const other = [&](int k) -> int& { return own[k].pair; };
    if (n <= PairSearch<R, Mem>::kept) {
      for (int k = 0; k < n; ++k) other(k) = near.search.other(item, k);
    } else {
      int k = 0;
      near.each(w, m, [&](int o) { other(k++) = o; });
    }
    sort_in_place(other, n);
    for (int k = 0; k < n; ++k) {
      PairKind const kind = near.kind_of(m, other(k));
      int const points = max_points(kind);
      own[k] = Candidate{w, near.model.searched_pair(m, other(k)), int(slot), short(kind), short(points), -1};
      slot += points;
    }
  }
};

template <class R>
struct PointSlots {
  ContactPoint<R>* slot;
  int room, count;
  KOKKOS_INLINE_FUNCTION void add(Vec3<R> const& pos, R dist, Vec3<R> const& normal, int feature) {
    if (count < room) slot[count++] = {pos, dist, normal, feature};
  }
};

/// The candidates of the kinds that the convex routine serves, or the others: its stack and registers are no burden to these.
template <class R, class Mem, bool convex>
struct CollideCandidates {
  CollisionModel<R, Mem> model;
  ContactScratch<R, Mem> s;
  bool reduce, steady;
  StillContacts<R, Mem> before;
  KOKKOS_FUNCTION void operator()(std::int64_t k) const {
    if (k >= s.total(0)) return;
    Candidate c = s.candidates(k);
    if (c.pair < 0 || is_among(convex_kinds, PairKind(c.kind)) != convex) return;
    auto const [a, b] = model.colliders_of(c.pair);
    if (int const n = before.copy(c.world, c.pair, model.collider_body(a), model.collider_body(b), &s.points(c.slot), c.count); n > 0) {
      s.candidates(k).count = short(n);
      return;
    }
    PairKind const kind{c.kind};
    bool const with_asset = is_among(asset_kinds, kind);
    auto const shape = [&](int i) {
      return make_shape(load_pose(&s.bounds.pose(c.world, i, 0)), model.size_of(c.world, i), with_asset ? model.asset_of(i) : nullptr);
    };
    auto const own = model.parameters_of(c.world, c.pair);
    R const reach = own.margin + own.gap + model.early(c.world);
    PointSlots<R> out{&s.points(c.slot), c.count, 0};
    if constexpr (convex)
      convex_narrowphase(kind, shape(a), shape(b), reach, out, steady);
    else
      closed_narrowphase(kind, shape(a), shape(b), reach, out, steady);
    s.candidates(k).count = short(reduce && is_among(reducing_kinds, kind) ? reduce_points(out.slot, out.count) : out.count);
  }
};

/// Counts the contacts of the items before in world order, then copies this item's to their places: on a device each candidate's are
/// copied by a thread of its own afterwards (CopyContacts), since one may have more than the others together.
template <class R, class Mem>
struct WriteContacts {
  static constexpr bool copies = !is_device<typename Mem::execution_space>;
  using value_type = std::int64_t;
  CollisionModel<R, Mem> model;
  Contacts<R, Mem> contacts;
  KOKKOS_FUNCTION void operator()(std::int64_t index, value_type& sum, bool last) const {
    auto const& s = contacts.scratch;
    int const each = model.chunks + model.movers, w = int(index / each), c = int(index % each);
    bool const lost = s.lost(w) != 0, listed = c < model.chunks;
    std::int64_t const mover = std::int64_t(w) * model.movers + c - model.chunks;
    std::int64_t const item = listed ? std::int64_t(c) * contacts.worlds + w : std::int64_t(s.mask.extent(0)) + mover;
    int const n = lost ? 0 : listed ? Kokkos::popcount(s.mask(item)) : contacts.search.found(mover, 0);
    std::int64_t const begin = s.first(item);
    int count = 0;
    for (int k = 0; k < n; ++k) count += s.candidates(begin + k).count;
    if (last) {
      if (c == 0) contacts.first(w) = int(sum);
      if (c == each - 1) {
        contacts.end(w) = int(sum) + count;
        if (w == contacts.worlds - 1) {
          s.total(2) = sum + count;
          std::size_t const room[3] = {s.candidates.extent(0), s.points.extent(0), contacts.dist.extent(0)};
          for (int i = 0; i < 3; ++i)
            if (s.total(i) > std::int64_t(room[i]) && s.total(i) > s.most(i)) s.most(i) = s.total(i);
        }
      }
      if (lost || sum + count > contacts.capacity()) {
        // a bit that others may set too, with the same result in any order
        if (lost || count > 0) Kokkos::atomic_or(&contacts.status(w), status::contact_overflow);
      } else {
        int at = int(sum);
        for (int k = 0; k < n; ++k) {
          Candidate& candidate = s.candidates(begin + k);
          if constexpr (copies)
            write(at, candidate);
          else
            candidate.first = at;
          at += candidate.count;
        }
      }
    }
    sum += count;
  }
  KOKKOS_INLINE_FUNCTION void write(int first, Candidate const& c) const {
    for (int p = 0; p < c.count; ++p) write(first + p, c, contacts.scratch.points(c.slot + p));
  }
  KOKKOS_INLINE_FUNCTION void write(int i, Candidate const& c, ContactPoint<R> const& p) const {
    auto const [a, b] = model.colliders_of(c.pair);
    contacts.world(i) = c.world;
    contacts.pair(i) = c.pair;
    contacts.feature(i) = p.feature;
    contacts.geom1(i) = model.collider_geom(a);
    contacts.geom2(i) = model.collider_geom(b);
    contacts.body1(i) = model.collider_body(a);
    contacts.body2(i) = model.collider_body(b);
    contacts.dist(i) = p.dist;
    auto const own = model.parameters_of(c.world, c.pair);
    contacts.includemargin(i) = own.margin;
    if (contacts.adhesive) contacts.adhesion(i) = own.adhesion;
    for (int k = 0; k < 3; ++k) contacts.pos(i, k) = p.pos[k];
    // a capsule on a plane slides along and across itself, as in MuJoCo
    Vec3<R> const hint = is_among(along_b_kinds, PairKind(c.kind))
                             ? rotate(load_pose(&contacts.scratch.bounds.pose(c.world, b, 0)).q, Vec3<R>{R(0), R(0), R(1)})
                             : Vec3<R>{R(0), R(0), R(0)};
    Mat3<R> const f = contact_frame(p.normal, hint);
    for (int k = 0; k < 9; ++k) contacts.frame(i, k) = f.m[k];
    if (!contacts.moving) return;
    Spatial<R> const velocity_a = surface_velocity(c.world, a, p.pos), velocity_b = surface_velocity(c.world, b, p.pos);
    Vec3<R> const linear = velocity_b.linear - velocity_a.linear, angular = velocity_b.angular - velocity_a.angular;
    contacts.surfacevel(i, 0) = dot(Vec3<R>{f.m[3], f.m[4], f.m[5]}, linear);
    contacts.surfacevel(i, 1) = dot(Vec3<R>{f.m[6], f.m[7], f.m[8]}, linear);
    contacts.surfacevel(i, 2) = dot(p.normal, angular);
  }
  /// v + w x (point - origin) and w of a collider's surface, world frame.
  KOKKOS_INLINE_FUNCTION Spatial<R> surface_velocity(int world, int collider, Vec3<R> const& point) const {
    Transform<R> const at = load_pose(&contacts.scratch.bounds.pose(world, collider, 0));
    R const* const s = &model.collider_surface(collider, 0);
    Vec3<R> const w = rotate(at.q, Vec3<R>{s[3], s[4], s[5]});
    return {w, rotate(at.q, Vec3<R>{s[0], s[1], s[2]}) + cross(w, point - at.p)};
  }
};

/// The contacts of a candidate to their places, of those that there are.
template <class R, class Mem>
struct CopyContacts {
  WriteContacts<R, Mem> contacts;
  KOKKOS_FUNCTION void operator()(std::int64_t k) const {
    auto const& s = contacts.contacts.scratch;
    if (k >= s.total(0)) return;
    Candidate const c = s.candidates(k);
    if (c.pair >= 0 && c.first >= 0) contacts.write(c.first, c);
  }
};

}  // namespace gsp::detail
