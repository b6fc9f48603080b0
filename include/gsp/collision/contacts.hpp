#pragma once
#include <gsp/collision/broadphase.hpp>
#include <gsp/collision/detail/contacts_kernels.hpp>
#include <gsp/collision/detail/level_contacts.hpp>
#include <gsp/core/region.hpp>
#include <gsp/core/status.hpp>
#include <gsp/parallel/detail/for_items.hpp>
#include <gsp/parallel/scan.hpp>

/// Contacts of many worlds in one pool, in the order (world, pair, point). Five kernels (one more with pairs of the convex routine, and
/// for patches), nothing waits for the host:
///   place colliders -> mask of near pairs a (chunk, world) -> scan + candidates, bucketed by (shape, shape) -> narrow phase -> scan +
///   contacts by world -> planes of patches.
/// Where pairs are too many to list (CompiledModel::pairs_searched) most are searched for in trees of boxes before the narrow phase.
/// A world whose candidates or contacts do not fit has status::contact_overflow and no contacts: `grow` enlarges the pools, then the step
/// is repeated. So neither a capacity nor the other worlds change a result.
namespace gsp {

/// Sizes per world that the pools start with; 0: a guess from the model. Hints, never limits.
struct ContactsOptions {
  int worlds = 1;
  int candidates_per_world = 0, points_per_world = 0, contacts_per_world = 0;
  int points_per_box_pair = 8;  // 8: all of them; 4: those that support best (manifold.hpp)
  // Points that move as the bodies do: nearly parallel capsules touch at two (narrowphase/capsule_capsule.hpp), not at one, and height
  // fields push along normals of their surface alone (narrowphase/height_field.hpp), not out of inner sides of their prisms. And points of
  // two bodies with one normal are a patch, which rubs in one plane (Contacts::lift).
  bool steady = false;
};

/// What the last `collide` needed, read by the host.
struct ContactsDemand {
  std::int64_t candidates = 0, points = 0, contacts = 0;  // contacts: of the worlds whose candidates fitted
  int lost_worlds = 0;                                    // worlds with contact_overflow
};

/// The pool and its index, which `collide` fills. `make_contacts` allocates it.
template <class R, class Mem>
struct Contacts {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;
  int points_per_box_pair = 8;
  bool steady = false;
  View<int*> first, end;        // (worlds) the contacts of a world; use first_of and count_of, which know about overflow
  View<std::uint32_t*> status;  // (worlds) status::contact_overflow, status::not_finite (of sizes and poses)
  // (capacity), filled up to size()
  View<int*> world, pair;  // pair: its number, CollisionModel::colliders_of
  View<int*> geom1, geom2, body1, body2;
  View<R* [3]> pos;              // midway between the surfaces [m]
  View<R* [9]> frame;            // rows normal (geom1 to geom2), t1, t2
  View<R*> dist, includemargin;  // [m]; acts as contact_acts says
  View<R*> lift;                 // along the normal, from pos to the plane in which the points of its patch rub [m]; empty unless steady
  View<R*> adhesion;             // with which it may pull [N]; empty where no pair of the model has any
  View<R* [3]> surfacevel;  // velocity of the surface of geom2 less that of geom1: along t1, t2 [m/s], about the normal [rad/s]; or empty
  View<int*> feature;       // unique within (world, pair); survives steps
  bool adhesive = false, moving = false;  // of what model
  detail::ContactScratch<R, Mem> scratch;
  detail::PairSearch<R, Mem> search;                 // empty where pairs are listed
  detail::SharedStamp<detail::ContactsStamp> stamp;  // host: of which state they are (dynamics/stamps.hpp)

  /// Most contacts that the pool holds; loops over all contacts on a device run to here and leave at size().
  KOKKOS_INLINE_FUNCTION int capacity() const { return int(dist.extent(0)); }
  /// Contacts in the pool: on the device, or where the memory is the host's.
  KOKKOS_INLINE_FUNCTION int size() const { return scratch.total(2) < capacity() ? int(scratch.total(2)) : capacity(); }
  KOKKOS_INLINE_FUNCTION bool fits(int w) const { return (status(w) & status::contact_overflow) == 0; }
  KOKKOS_INLINE_FUNCTION int first_of(int w) const { return fits(w) ? first(w) : 0; }
  KOKKOS_INLINE_FUNCTION int count_of(int w) const { return fits(w) ? end(w) - first(w) : 0; }
  /// pos of contact c, and row i of its frame: the normal, then the tangents.
  KOKKOS_INLINE_FUNCTION Vec3<R> point(int c) const { return {pos(c, 0), pos(c, 1), pos(c, 2)}; }
  KOKKOS_INLINE_FUNCTION Vec3<R> axis(int c, int i) const { return {frame(c, 3 * i), frame(c, 3 * i + 1), frame(c, 3 * i + 2)}; }

  /// What the last collide needed. Fences `exec`.
  template <class Exec>
  ContactsDemand demand(Exec const& exec) const {
    auto const total = detail::to_host(exec, scratch.total);
    ContactsDemand d{total[0], total[1], total[2], 0};
    for (std::uint32_t const bits : detail::to_host(exec, status)) d.lost_worlds += (bits & status::contact_overflow) != 0;
    return d;
  }
};

/// Whether contact c of the pool, of this world, acts in full: below its margin, or somewhat before (act_early). Where it does not, and has
/// adhesion, it pulls over the gap along its normal alone.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION bool contact_acts(CollisionModel<R, Mem> const& model, Contacts<R, Mem> const& contacts, int world, int c) {
  return contacts.dist(c) < contacts.includemargin(c) + model.early(world);
}
/// Its parameters as it acts.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION ContactParameters<R> acting_parameters(CollisionModel<R, Mem> const& model, Contacts<R, Mem> const& contacts,
                                                              int world, int c, bool acts) {
  auto p = model.parameters_of(world, contacts.pair(c));
  if (!acts) p.condim = 1;
  return p;
}
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION ContactParameters<R> acting_parameters(CollisionModel<R, Mem> const& model, Contacts<R, Mem> const& contacts,
                                                              int world, int c) {
  return acting_parameters(model, contacts, world, c, contact_acts(model, contacts, world, c));
}

/// Pools for the contacts of `worlds` worlds. Allocates.
/// Errors: std::invalid_argument for worlds < 1 and for points_per_box_pair other than 4 and 8; gsp::Error for pools of 2^31 or more.
template <ExecutionSpace Exec, class R, class Mem>
Contacts<R, Mem> make_contacts(Exec const& exec, CollisionModel<R, Mem> const& model, ContactsOptions options = {});

/// Enlarges the pools by half beyond what the last `collide` needed, where it did not fit; their contents are lost. Returns whether
/// anything changed: then repeat the step. Fences; allocates. The cap of `exec`'s memory is the only limit.
template <ExecutionSpace Exec, class R, class Mem>
bool grow(Exec const& exec, Contacts<R, Mem>& contacts);

/// Finds all contacts with dist <= margin + gap + model.early(world) of all worlds in their present poses.
/// @param poses     of the bodies, (worlds, bodies)
/// @param contacts  overwritten
/// @param still     trees that have not moved since the last call: contacts between them are taken over from it (step/sleep.hpp)
/// Neither allocates nor fences. Cost: 2 us for a humanoid on the floor on one core, 26 ns in a batch of 8,192 on an H200 (docs/collision).
/// The result depends on nothing but the world's own poses. The contacts are of the state that the poses are of, and `assemble` refuses
/// them beside one that has moved on. Errors: std::invalid_argument for poses of other numbers of worlds or bodies, and for contacts that
/// were made for another model.
template <ExecutionSpace Exec, class R, class Mem>
void collide(Exec const& exec, CollisionModel<R, Mem> const& model, Poses<R, Mem> const& poses, Contacts<R, Mem>& contacts,
             StillTrees<R, Mem> const& still = {}) {
  Region const region("gsp::collision::collide");
  static_assert(can_access<Exec, Contacts<R, Mem>>, "gsp::collide: the contacts are not accessible from this execution space");
  if (int(poses.xpos.extent(0)) != contacts.worlds)
    throw std::invalid_argument("gsp::collide: poses have " + std::to_string(poses.xpos.extent(0)) + " worlds and contacts " +
                                std::to_string(contacts.worlds));
  if (int(poses.xpos.extent(1)) != model.bodies)
    throw std::invalid_argument("gsp::collide: poses have " + std::to_string(poses.xpos.extent(1)) + " bodies and the model " +
                                std::to_string(model.bodies));
  detail::expects_values("gsp::collide", model, contacts.worlds);
  auto& s = contacts.scratch;
  expects(s.mask.extent(0) == std::size_t(model.chunks) * contacts.worlds &&
              contacts.search.found.extent(0) == std::size_t(model.movers) * contacts.worlds,
          "gsp::collide: the contacts were made for another model");
  if (contacts.stamp.data()) {
    contacts.stamp().poses.qpos = nullptr;
    if (poses.stamp.data()) contacts.stamp().poses = poses.stamp().bodies;
    contacts.stamp().made = detail::next_moment();
    contacts.stamp().lost = false;
    contacts.stamp().pool = contacts.dist.data();
    contacts.stamp().model = model.collider_body.data();
  }
  if (model.pairs == 0 && model.movers == 0) return;
  if (model.movers == 0)
    place_colliders(exec, model, poses, s.bounds, contacts.status.data(), s.lost.data());
  else
    detail::search_pairs(exec, model, poses, s.bounds, contacts.search, contacts.status.data(), s.lost.data());
  find_near_pairs(exec, model, s.bounds, s.mask, contacts.status.data());
  std::int64_t const masks = std::int64_t(s.mask.extent(0)), movers = std::int64_t(contacts.worlds) * model.movers, items = masks + movers;
  detail::scan_items("gsp::collision::write_candidates", exec, items,
                     detail::WriteCandidates<R, Mem>{model, s, contacts.search, contacts.worlds, masks, items});
  if (movers > 0)
    detail::for_items("gsp::collision::write_near_pairs", exec, movers,
                      detail::WriteNearPairs<R, Mem>{{model, s.bounds, contacts.search}, s, masks});
  detail::StillContacts<R, Mem> const before{still,         contacts.first, contacts.end,  contacts.pair, contacts.feature,
                                             contacts.dist, contacts.pos,   contacts.frame};
  // On a device the grid has the capacity's size and threads leave on the count; on a host the work before is done, so the count can be
  // read.
  std::int64_t candidates = std::int64_t(s.candidates.extent(0));
  if constexpr (!is_device<Exec>) candidates = std::min(candidates, std::int64_t(s.total(0)));
  detail::for_items("gsp::collision::narrowphase", exec, candidates,
                    detail::CollideCandidates<R, Mem, false>{model, s, contacts.points_per_box_pair == 4, contacts.steady, before});
  if (model.has_convex_pairs)
    detail::for_items("gsp::collision::convex_narrowphase", exec, candidates,
                      detail::CollideCandidates<R, Mem, true>{model, s, contacts.points_per_box_pair == 4, contacts.steady, before});
  detail::WriteContacts<R, Mem> const write{model, contacts};
  detail::scan_items("gsp::collision::write_contacts", exec, items, write);
  if constexpr (!detail::WriteContacts<R, Mem>::copies)
    detail::for_items("gsp::collision::copy_contacts", exec, candidates, detail::CopyContacts<R, Mem>{write});
  if (contacts.steady)
    detail::for_items("gsp::collision::level_contacts", exec, is_device<Exec> ? contacts.capacity() : contacts.size(),
                      detail::LevelContacts<Contacts<R, Mem>>{contacts});
}

}  // namespace gsp

#include <gsp/collision/detail/contacts_impl.hpp>
