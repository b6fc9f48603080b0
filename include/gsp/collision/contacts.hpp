#pragma once
#include <gsp/collision/broadphase.hpp>
#include <gsp/collision/manifold.hpp>
#include <gsp/collision/narrowphase.hpp>
#include <gsp/core/region.hpp>
#include <gsp/core/status.hpp>

/// Contacts of many worlds in one pool, in the order (world, pair, point). Five kernels, nothing waits for the host:
///   place colliders -> mask of near pairs a (chunk, world) -> scan + candidates, bucketed by (shape, shape) -> narrow phase -> scan +
///   contacts by world.
/// A world whose candidates or contacts do not fit has status::contact_overflow and no contacts: `grow` enlarges the pools, then the step
/// is repeated. So neither a capacity nor the other worlds change a result.
namespace gsp {

/// Sizes per world that the pools start with; 0: a guess from the model. Hints, never limits.
struct ContactsOptions {
  int worlds = 1;
  int candidates_per_world = 0, points_per_world = 0, contacts_per_world = 0;
  int points_per_box_pair = 8;  // 8: all of them; 4: those that support best (manifold.hpp)
};

/// What the last `collide` needed, read by the host.
struct ContactsDemand {
  std::int64_t candidates = 0, points = 0, contacts = 0;  // contacts: of the worlds whose candidates fitted
  int lost_worlds = 0;                                    // worlds with contact_overflow
};

namespace detail {
struct Candidate {
  int world, pair, slot;
  short kind;   // PairKind
  short count;  // room for points, then how many there are
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
  Kokkos::View<std::int64_t*, Mem> first;  // (chunks * worlds) first candidate of an item
  Kokkos::View<Candidate*, Mem> candidates;
  Kokkos::View<ContactPoint<R>*, Mem> points;
  Kokkos::View<std::uint8_t*, Mem> lost;   // (worlds) candidates did not fit
  Kokkos::View<std::int64_t*, Mem> total;  // (3) candidates, points, contacts that were needed
};
}  // namespace detail

template <class R, class Mem>
struct Contacts {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;
  int points_per_box_pair = 8;
  View<int*> first, end;        // (worlds) the contacts of a world; use first_of and count_of, which know about overflow
  View<std::uint32_t*> status;  // (worlds) status::contact_overflow
  // (capacity), filled up to size()
  View<int*> world, pair;  // pair: index into CollisionModel's pairs
  View<int*> geom1, geom2, body1, body2;
  View<R* [3]> pos;              // midway between the surfaces [m]
  View<R* [9]> frame;            // rows normal (geom1 to geom2), t1, t2
  View<R*> dist, includemargin;  // [m]; acts if dist < includemargin
  View<int*> feature;            // unique within (world, pair); survives steps
  detail::ContactScratch<R, Mem> scratch;

  /// Most contacts that the pool holds; loops over all contacts on a device run to here and leave at size().
  KOKKOS_INLINE_FUNCTION int capacity() const { return int(dist.extent(0)); }
  /// Contacts in the pool: on the device, or where the memory is the host's.
  KOKKOS_INLINE_FUNCTION int size() const { return scratch.total(2) < capacity() ? int(scratch.total(2)) : capacity(); }
  KOKKOS_INLINE_FUNCTION bool fits(int w) const { return (status(w) & status::contact_overflow) == 0; }
  KOKKOS_INLINE_FUNCTION int first_of(int w) const { return fits(w) ? first(w) : 0; }
  KOKKOS_INLINE_FUNCTION int count_of(int w) const { return fits(w) ? end(w) - first(w) : 0; }

  /// What the last collide needed. Fences `exec`.
  template <class Exec>
  ContactsDemand demand(Exec const& exec) const {
    auto const total = detail::to_host(exec, scratch.total);
    ContactsDemand d{total[0], total[1], total[2], 0};
    for (std::uint32_t const bits : detail::to_host(exec, status)) d.lost_worlds += (bits & status::contact_overflow) != 0;
    return d;
  }
};

namespace detail {

template <class R, class Mem>
void allocate_contacts(Contacts<R, Mem>& c, std::int64_t candidates, std::int64_t points, std::int64_t contacts) {
  constexpr std::int64_t most = 2147483647;  // contacts are counted in 32 bits
  if (candidates > most || points > most || contacts > most)
    throw Error("gsp::Contacts: more than " + std::to_string(most) + " contact points are asked for: use fewer worlds a batch");
  auto const make = [&](auto& v, std::string const& label, std::int64_t n) {
    if (std::int64_t(v.extent(0)) < n) v = allocate<std::decay_t<decltype(v)>>(label, n);
  };
  make(c.scratch.candidates, "gsp::Contacts::candidates", candidates);
  make(c.scratch.points, "gsp::Contacts::points", points);
  make(c.world, "gsp::Contacts::world", contacts);
  make(c.pair, "gsp::Contacts::pair", contacts);
  make(c.geom1, "gsp::Contacts::geom1", contacts);
  make(c.geom2, "gsp::Contacts::geom2", contacts);
  make(c.body1, "gsp::Contacts::body1", contacts);
  make(c.body2, "gsp::Contacts::body2", contacts);
  make(c.pos, "gsp::Contacts::pos", contacts);
  make(c.frame, "gsp::Contacts::frame", contacts);
  make(c.dist, "gsp::Contacts::dist", contacts);
  make(c.includemargin, "gsp::Contacts::includemargin", contacts);
  make(c.feature, "gsp::Contacts::feature", contacts);
}

/// Counts the candidates of the items before, then writes this item's.
template <class R, class Mem>
struct WriteCandidates {
  using value_type = CandidateSum;
  CollisionModel<R, Mem> model;
  ContactScratch<R, Mem> s;
  int worlds;
  std::int64_t items;
  KOKKOS_FUNCTION void operator()(std::int64_t item, value_type& sum, bool last) const {
    std::uint64_t bits = s.mask(item);
    CollisionChunk const chunk = model.chunk(int(item / worlds));
    int const n = Kokkos::popcount(bits), each = chunk.points;
    if (last) {
      int const w = int(item % worlds);
      s.first(item) = sum.candidates;
      if (sum.candidates + n > std::int64_t(s.candidates.extent(0)) ||
          sum.points + std::int64_t(n) * each > std::int64_t(s.points.extent(0))) {
        if (n > 0) s.lost(w) = 1;  // whoever finds it writes the same
        // The narrow phase runs over the candidates that fit: leave none of this item undefined.
        for (std::int64_t k = sum.candidates; k < sum.candidates + n && k < std::int64_t(s.candidates.extent(0)); ++k)
          s.candidates(k) = {w, -1, 0, 0, 0};
      } else {
        int slot = int(sum.points);
        std::int64_t k = sum.candidates;
        for (int i = 0; bits != 0; ++i, bits >>= 1) {
          int const skip = Kokkos::countr_zero(bits);
          i += skip;
          bits >>= skip;
          s.candidates(k++) = {w, chunk.first + i, slot, short(chunk.kind), short(each)};
          slot += each;
        }
      }
      if (item == items - 1) {
        s.total(0) = sum.candidates + n;
        s.total(1) = sum.points + std::int64_t(n) * each;
      }
    }
    sum.candidates += n;
    sum.points += std::int64_t(n) * each;
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

template <class R, class Mem>
struct CollideCandidates {
  CollisionModel<R, Mem> model;
  ContactScratch<R, Mem> s;
  bool reduce;
  KOKKOS_FUNCTION void operator()(std::int64_t k) const {
    if (k >= s.total(0)) return;
    Candidate c = s.candidates(k);
    if (c.pair < 0) return;
    int const a = model.pair_collider(c.pair, 0), b = model.pair_collider(c.pair, 1);
    PairKind const kind{c.kind};
    bool const with_asset = is_among(asset_kinds, kind);
    auto const shape = [&](int i) {
      return make_shape(load_pose(&s.bounds.pose(c.world, i, 0)), model.size_of(c.world, i), with_asset ? model.asset_of(i) : nullptr);
    };
    auto const own = model.parameters_of(c.world, c.pair);
    PointSlots<R> out{&s.points(c.slot), c.count, 0};
    narrowphase(kind, shape(a), shape(b), own.margin + own.gap, out);
    s.candidates(k).count = short(reduce && is_among(reducing_kinds, kind) ? reduce_points(out.slot, out.count) : out.count);
  }
};

/// Counts the contacts of the items before in world order, then copies this item's to their places.
template <class R, class Mem>
struct WriteContacts {
  using value_type = std::int64_t;
  CollisionModel<R, Mem> model;
  Contacts<R, Mem> contacts;
  KOKKOS_FUNCTION void operator()(std::int64_t index, value_type& sum, bool last) const {
    auto const& s = contacts.scratch;
    int const w = int(index / model.chunks), c = int(index % model.chunks);
    std::int64_t const item = std::int64_t(c) * contacts.worlds + w;
    bool const lost = s.lost(w) != 0;
    int const n = lost ? 0 : Kokkos::popcount(s.mask(item));
    std::int64_t const begin = s.first(item);
    int count = 0;
    for (int k = 0; k < n; ++k) count += s.candidates(begin + k).count;
    if (last) {
      if (c == 0) contacts.first(w) = int(sum);
      if (c == model.chunks - 1) {
        contacts.end(w) = int(sum) + count;
        if (w == contacts.worlds - 1) s.total(2) = sum + count;
      }
      if (lost || sum + count > contacts.capacity()) {
        // a bit that others may set too, with the same result in any order
        if (lost || count > 0) Kokkos::atomic_or(&contacts.status(w), status::contact_overflow);
      } else {
        int at = int(sum);
        for (int k = 0; k < n; ++k) {
          Candidate const candidate = s.candidates(begin + k);
          for (int p = 0; p < candidate.count; ++p) write(at++, candidate, s.points(candidate.slot + p));
        }
      }
    }
    sum += count;
  }
  KOKKOS_INLINE_FUNCTION void write(int i, Candidate const& c, ContactPoint<R> const& p) const {
    int const a = model.pair_collider(c.pair, 0), b = model.pair_collider(c.pair, 1);
    contacts.world(i) = c.world;
    contacts.pair(i) = c.pair;
    contacts.feature(i) = p.feature;
    contacts.geom1(i) = model.collider_geom(a);
    contacts.geom2(i) = model.collider_geom(b);
    contacts.body1(i) = model.collider_body(a);
    contacts.body2(i) = model.collider_body(b);
    contacts.dist(i) = p.dist;
    contacts.includemargin(i) = model.parameters_of(c.world, c.pair).margin;
    for (int k = 0; k < 3; ++k) contacts.pos(i, k) = p.pos[k];
    // a capsule on a plane slides along and across itself, as in MuJoCo
    Vec3<R> const hint = is_among(along_b_kinds, PairKind(c.kind))
                             ? rotate(load_pose(&contacts.scratch.bounds.pose(c.world, b, 0)).q, Vec3<R>{R(0), R(0), R(1)})
                             : Vec3<R>{R(0), R(0), R(0)};
    Mat3<R> const f = contact_frame(p.normal, hint);
    for (int k = 0; k < 9; ++k) contacts.frame(i, k) = f.m[k];
  }
};

}  // namespace detail

/// Pools for the contacts of `worlds` worlds. Allocates. Errors: std::invalid_argument for worlds < 1.
template <ExecutionSpace Exec, class R, class Mem>
Contacts<R, Mem> make_contacts(Exec const& exec, CollisionModel<R, Mem> const& model, ContactsOptions options = {}) {
  expects(options.worlds > 0, "gsp::make_contacts: worlds must be positive and is " + std::to_string(options.worlds));
  expects(options.points_per_box_pair == 4 || options.points_per_box_pair == 8, "gsp::make_contacts: points_per_box_pair must be 4 or 8");
  Contacts<R, Mem> c;
  c.points_per_box_pair = options.points_per_box_pair;
  int const worlds = c.worlds = options.worlds;
  auto const make = [&](auto& v, std::string const& label, std::size_t n) {
    v = detail::allocate_zero<std::decay_t<decltype(v)>>(exec, label, n);
  };
  auto const make2 = [&](auto& v, std::string const& label, int n) {
    v = detail::allocate_zero<std::decay_t<decltype(v)>>(exec, label, worlds, n);
  };
  make(c.first, "gsp::Contacts::first", worlds);
  make(c.end, "gsp::Contacts::end", worlds);
  make(c.status, "gsp::Contacts::status", worlds);
  make2(c.scratch.bounds.pose, "gsp::Contacts::collider_pose", model.colliders);
  make2(c.scratch.bounds.box, "gsp::Contacts::collider_box", model.colliders);
  make2(c.scratch.bounds.group, "gsp::Contacts::group_box", model.groups);
  std::size_t const items = std::size_t(model.chunks) * worlds;
  make(c.scratch.mask, "gsp::Contacts::mask", items);
  make(c.scratch.first, "gsp::Contacts::item_first", items);
  make(c.scratch.lost, "gsp::Contacts::lost", worlds);
  make(c.scratch.total, "gsp::Contacts::total", 3);
  // Guess: a collider is near two others, half of a candidate's room is used.
  std::int64_t const near = std::min<std::int64_t>(model.pairs, 2 * model.colliders + 8);
  std::int64_t const room = model.pairs > 0 ? (near * model.slots + model.pairs - 1) / model.pairs : 0;
  std::int64_t const w = worlds;
  std::int64_t const candidates = w * (options.candidates_per_world > 0 ? options.candidates_per_world : near);
  std::int64_t const points = w * (options.points_per_world > 0 ? options.points_per_world : room);
  detail::allocate_contacts(c, candidates, points, w * (options.contacts_per_world > 0 ? options.contacts_per_world : (room + 1) / 2));
  return c;
}

/// Enlarges the pools by half beyond what the last `collide` needed, where it did not fit; their contents are lost. Returns whether
/// anything changed: then repeat the step. Fences; allocates. The cap of `exec`'s memory is the only limit.
template <ExecutionSpace Exec, class R, class Mem>
bool grow(Exec const& exec, Contacts<R, Mem>& contacts) {
  auto const d = contacts.demand(exec);
  if (d.lost_worlds == 0) return false;
  auto const more = [](std::int64_t need, std::size_t have) { return need > std::int64_t(have) ? need + need / 2 : std::int64_t(have); };
  std::int64_t const candidates = more(d.candidates, contacts.scratch.candidates.extent(0)),
                     points = more(d.points, contacts.scratch.points.extent(0));
  detail::allocate_contacts(contacts, candidates, points, more(d.contacts, contacts.dist.extent(0)));
  return true;
}

/// Finds all contacts with dist <= margin + gap of all worlds in their present poses.
/// @param poses     of the bodies, (worlds, bodies)
/// @param contacts  overwritten
/// Neither allocates nor fences. Cost: 2 us for a humanoid on the floor on one core, 26 ns in a batch of 8,192 on an H200 (docs/collision).
/// The result depends on nothing but the world's own poses.
template <ExecutionSpace Exec, class R, class Mem>
void collide(Exec const& exec, CollisionModel<R, Mem> const& model, Poses<R, Mem> const& poses, Contacts<R, Mem>& contacts) {
  Region const region("gsp::collision::collide");
  static_assert(can_access<Exec, Contacts<R, Mem>>, "gsp::collide: the contacts are not accessible from this execution space");
  expects(int(poses.xpos.extent(0)) == contacts.worlds,
          "gsp::collide: poses have " + std::to_string(poses.xpos.extent(0)) + " worlds and contacts " + std::to_string(contacts.worlds));
  expects(int(poses.xpos.extent(1)) == model.bodies,
          "gsp::collide: poses have " + std::to_string(poses.xpos.extent(1)) + " bodies and the model " + std::to_string(model.bodies));
  detail::expects_values("gsp::collide", model, contacts.worlds);
  auto& s = contacts.scratch;
  expects(s.mask.extent(0) == std::size_t(model.chunks) * contacts.worlds, "gsp::collide: the contacts were made for another model");
  if (model.pairs == 0) return;
  place_colliders(exec, model, poses, s.bounds, contacts.status.data(), s.lost.data());
  find_near_pairs(exec, model, s.bounds, s.mask);
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  std::int64_t const items = std::int64_t(s.mask.extent(0));
  Kokkos::parallel_scan("gsp::collision::write_candidates", lightweight(Range(exec, 0, items)),
                        detail::WriteCandidates<R, Mem>{model, s, contacts.worlds, items});
  // On a device the grid has the capacity's size and threads leave on the count; on a host the work before is done, so the count can be
  // read.
  std::int64_t candidates = std::int64_t(s.candidates.extent(0));
  if constexpr (!is_device<Exec>) candidates = std::min(candidates, std::int64_t(s.total(0)));
  Kokkos::parallel_for("gsp::collision::narrowphase", lightweight(Range(exec, 0, candidates)),
                       detail::CollideCandidates<R, Mem>{model, s, contacts.points_per_box_pair == 4});
  Kokkos::parallel_scan("gsp::collision::write_contacts", lightweight(Range(exec, 0, items)),
                        detail::WriteContacts<R, Mem>{model, contacts});
}

}  // namespace gsp
