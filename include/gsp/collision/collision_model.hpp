#pragma once
#include <gsp/collision/shape_assets.hpp>
#include <gsp/collision/shapes.hpp>
#include <gsp/core/check.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/model/model.hpp>

/// What collision needs of a model, constant, on the device. Colliders are the geoms that occur in a pair, sorted by group; a group is a
/// kinematic tree or a single static geom. Pairs are sorted by (kind, groups) and cut into chunks of at most 64 pairs of one kind: a chunk
/// of a world is one work item with a 64-bit mask of the pairs that are near, and since items are numbered chunk by chunk, candidates come
/// out bucketed by (shape, shape) without a sort.
/// Where pairs are too many to list (CompiledModel::pairs_searched), those of planes, height fields and named ones are; the others are
/// searched for in trees of boxes and have numbers behind them, which say who they are (colliders_of).
namespace gsp {

/// Contact parameters of a pair: its own numbers where it was named (CompiledModel::named_pairs); else mixed (MuJoCo's mj_contactParam):
/// the geom with the higher priority wins; else the larger condim and friction, solref and solimp weighted by solmix (solref: the smaller,
/// where one of them is not positive), and adhesion is the sum; margin and gap are sums in any case. Rigid where one of the two is, with
/// its restitution and erp, the larger of both where both are.
template <class R>
struct ContactParameters {
  int condim;
  R margin, gap;  // detected if dist <= margin + gap, acts if dist < margin [m]; with adhesion wherever it is detected
  R friction[5];  // sliding, sliding, torsional [m], rolling [m], rolling [m]
  R solref[2], solimp[5];
  R solreffriction[2];  // of soft friction rows; 0 0, or one above 0 alone: as solref
  R adhesion;           // with which it may pull [N]
  bool hard;            // profile stable: rigid, with
  R restitution, erp;   // GeomDescription
};

/// What a geom brings to a contact.
template <class R>
struct GeomContact {
  int priority, condim;
  R solmix, margin, gap;
  R friction[3];  // sliding, torsional [m], rolling [m]
  R solref[2], solimp[5];
  R adhesion;
  bool hard;
  R restitution, erp;
};

/// Mixes the parameters of two geoms.
template <class R>
KOKKOS_INLINE_FUNCTION ContactParameters<R> mix_contact_parameters(GeomContact<R> const& a, GeomContact<R> const& b);

/// Mixes the parameters of geoms g1 and g2. Host.
inline ContactParameters<double> mix_contact_parameters(CompiledModel const& m, int g1, int g2);

/// The parameters of pair `pair` of the model (CompiledModel::pair_geoms), mixed or its own; with flag override margin, solref, solimp
/// and friction are the option's (o_margin ...). Friction is at least 1e-5 in all cases, as in MuJoCo. Host.
inline ContactParameters<double> contact_parameters(CompiledModel const& m, int pair);

/// What is looked at at once: `fixed` (the plane, where it is one) beside first + k, for each bit k of `others`: of colliders a pair each,
/// from pair `at` of the chunk on; of groups a run each, from run `at` on.
template <class R>
struct CollisionSpan {
  static constexpr int most = 32;
  int fixed, first;
  std::uint32_t others;
  int at;
  R reach;  // largest margin + gap among them
};
/// Pairs of the colliders of two groups: spans first ... end - 1.
struct CollisionRun {
  int first, end;
};
/// At most 64 pairs of one kind: spans of those of groups with one collider each, and spans of the groups of the others.
struct CollisionChunk {
  int kind, first, end, single_first, single_end, group_first, group_end;
  int points;  // the most that a pair gives
};

/// Whom a collider may meet, where pairs are searched for. Lists are parts of CollisionModel::avoided.
struct ColliderFilter {
  int contype, conaffinity;
  int weld, above;             // weld group of its body, and the one that it is filtered against as its parent, or -1
  int body_first, body_end;    // bodies that are excluded
  int named_first, named_end;  // colliders with which it is a named pair
  int set;                     // which of the different sets of contact parameters of geoms is its own
};
/// A tree of boxes over n leaves, eight to a block, eight blocks to one of the level above, up to one: its shape says n alone.
struct BoxTreeShape {
  int leaves = 0, levels = 0, blocks = 0;
  int first[9] = {};  // first block of a level; level 0 holds the boxes of leaves

  KOKKOS_INLINE_FUNCTION int blocks_of(int level) const { return first[level + 1] - first[level]; }
};

/// The colliders of a pair, type of the first <= type of the second.
struct ColliderPair {
  int a, b;
};

/// Colliders, pairs, runs and chunks. `make_collision_model` fills it; copies share its arrays.
template <class R, class Mem>
struct CollisionModel {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using Array = Kokkos::View<D, Kokkos::LayoutRight, Mem, Kokkos::MemoryTraits<Kokkos::Unmanaged>>;
  int bodies = 0, geoms = 0, colliders = 0, groups = 0, pairs = 0, chunks = 0;
  int most_edges = 1;                                             // most edges of a pyramid of friction, 2 (condim - 1)
  long slots = 0;                                                 // most points that all pairs together can give
  Kokkos::View<int*, Mem> ints;                                   // what the arrays of whole numbers lie in
  Kokkos::View<R*, Mem> reals;                                    // and the others
  Array<int const*> collider_geom, collider_body, collider_type;  // (colliders)
  Array<int const*> collider_asset;                               // (colliders) index into assets, -1: none
  ShapeAssets<R, Mem> assets;                                     // meshes and height fields of colliders
  // These may be per world (model/world_values.hpp):
  Field<R> collider_pose;                                        // (colliders, 7) in the body's frame: position, quaternion w x y z
  Field<R> collider_size;                                        // (colliders, 3)
  Field<R> collider_friction, collider_solref, collider_solimp;  // (colliders, 3 | 2 | 5)
  Array<int const*> group_first;                                 // (groups + 1) first collider
  Array<R const* [6]> collider_surface;                          // (colliders) velocity of the surface in its own frame; or none
  Array<int const* [2]> pair_collider;                           // (pairs, 2) colliders, type of the first <= type of the second
  Array<int const*> pair_parameters;                             // (pairs) index into parameters
  Kokkos::View<ContactParameters<R>*, Mem> parameters;           // the different ones
  Kokkos::View<CollisionSpan<R>*, Mem> group_spans, single_spans, spans;  // of groups, and of colliders
  Kokkos::View<CollisionRun*, Mem> runs;
  Kokkos::View<CollisionChunk*, Mem> chunk;           // (chunks)
  Field<R> gravity;                                   // Model::gravity and the timestep, as act_early has set them: contacts are there
  R early_step = R(0);                                // early(world) before margin (+ gap) says; 0: not early
  int mixed_parameters = 0;                           // so many of them are mixed from geoms; the others are those of named pairs
  Kokkos::View<int*, Kokkos::HostSpace> pair_source;  // (pairs) host: index of the pair as CompiledModel::pair_geoms has it
  // Where pairs are searched for, else empty:
  int movers = 0;                             // so many colliders, the first ones, are of trees: one of each pair is among them
  int moving_groups = 0;                      // those of trees, the first ones
  BoxTreeShape moving_tree, still_tree;       // over the movers and over the others
  Kokkos::View<ColliderFilter*, Mem> filter;  // (colliders)
  Kokkos::View<int*, Mem> avoided;            // lists of the filters
  Kokkos::View<int*, Mem> still_order;        // (colliders - movers) colliders by place, in the order of their tree
  Kokkos::View<int*, Mem> still_body;         // the different bodies of colliders that are no movers
  Kokkos::View<int*, Mem> set_parameters;     // (sets, sets) index into parameters; empty where sets are many: pairs are mixed when met
  int sets = 0;
  Kokkos::View<R*, Mem> collider_reach;  // (colliders) its part of margin + gap

  Kokkos::View<GeomContact<R>*, Mem> collider_contact;  // (colliders) what geoms bring to contacts, shared values
  int value_worlds = 0;                                 // of the fields that are per world; 0: none is
  Kokkos::View<R*, Mem> world_reals;                    // what those lie in
  bool adhesive = false;                                // contacts of some pairs pull
  bool bounces = false;                                 // some geoms are rigid with a restitution
  bool has_convex_pairs = false;                        // some pairs are of kinds that the convex routine serves
  bool overridden = false;                              // <option o_*> says what friction, solref and solimp are, in every world
  bool mixes_per_world = false;                         // friction, solref or solimp is per world

  /// How far gravity takes a body from rest in a step, |g| h^2 [m], where contacts act early.
  KOKKOS_INLINE_FUNCTION R early(int world) const {
    return early_step > R(0) ? gravity_rate(gravity, world, early_step) * early_step : R(0);
  }
  /// Who pair `pair` is, listed (below `pairs`) or searched for.
  KOKKOS_INLINE_FUNCTION ColliderPair colliders_of(int pair) const {
    if (pair < pairs) return {pair_collider(pair, 0), pair_collider(pair, 1)};
    int const a = (pair - pairs) / colliders, b = (pair - pairs) % colliders;
    int const type_a = collider_type(a), type_b = collider_type(b);
    bool const in_order = type_a < type_b || (type_a == type_b && collider_geom(a) < collider_geom(b));
    return in_order ? ColliderPair{a, b} : ColliderPair{b, a};
  }
  /// The number of the pair of mover a and collider b > a.
  KOKKOS_INLINE_FUNCTION int searched_pair(int a, int b) const { return pairs + a * colliders + b; }
  /// Whether mover a and another collider, neither of them wide (is_wide), are a pair that is searched for.
  KOKKOS_INLINE_FUNCTION bool may_meet(int a, int b) const {
    ColliderFilter const &f = filter(a), &g = filter(b);
    if ((f.contype & g.conaffinity) == 0 && (g.contype & f.conaffinity) == 0) return false;
    if (f.weld == g.weld || f.above == g.weld || g.above == f.weld) return false;
    for (int k = f.body_first; k < f.body_end; ++k)
      if (avoided(k) == collider_body(b)) return false;
    for (int k = f.named_first; k < f.named_end; ++k)
      if (avoided(k) == b) return false;
    return true;
  }
  /// Contact parameters of a pair in a world: of its own, or mixed from what its geoms have there.
  KOKKOS_INLINE_FUNCTION ContactParameters<R> parameters_of(int world, int pair) const {
    int const own = pair < pairs ? pair_parameters(pair) : parameters_by_sets(pair);
    if (own >= 0 && (!mixes_per_world || own >= mixed_parameters)) return parameters(own);
    ColliderPair const p = colliders_of(pair);
    return mix_contact_parameters(contact_of(world, p.a), contact_of(world, p.b));
  }
  /// Which they are of a pair that is searched for, where worlds have none of their own; -1: to be mixed.
  KOKKOS_INLINE_FUNCTION int parameters_by_sets(int pair) const {
    ColliderPair const p = colliders_of(pair);
    return sets > 0 ? set_parameters(filter(p.a).set * sets + filter(p.b).set) : -1;
  }
  KOKKOS_INLINE_FUNCTION GeomContact<R> contact_of(int world, int collider) const {
    GeomContact<R> c = collider_contact(collider);
    for (int i = 0; i < 3; ++i) c.friction[i] = collider_friction(world, 3 * collider + i);
    for (int i = 0; i < 2; ++i) c.solref[i] = collider_solref(world, 2 * collider + i);
    for (int i = 0; i < 5; ++i) c.solimp[i] = collider_solimp(world, 5 * collider + i);
    return c;
  }
  KOKKOS_INLINE_FUNCTION Vec3<R> size_of(int world, int collider) const {
    return {collider_size(world, 3 * collider), collider_size(world, 3 * collider + 1), collider_size(world, 3 * collider + 2)};
  }
  KOKKOS_INLINE_FUNCTION ShapeAsset<R> const* asset_of(int collider) const { return assets.at(collider_asset(collider)); }
  KOKKOS_INLINE_FUNCTION ShapeData<R> data_of(int world, int collider) const { return {size_of(world, collider), asset_of(collider)}; }
};

/// In profile `stable` contacts are found, and act, as soon as gravity may close them within a step (constraint/contact_rows.hpp): with the
/// gravity that each world has now; in profile `mujoco` not. `launch_step` calls it; in a loop of your own once, and after make_per_world.
template <class R, class Mem>
void act_early(Model<R, Mem> const& model, CollisionModel<R, Mem>& collision) {
  collision.gravity = model.gravity;
  collision.early_step = model.profile == Profile::stable ? model.timestep : R(0);
}

/// Takes what collision needs of `m` to the memory of `exec`. Allocates; fences. Cost O(pairs log pairs), 24 bytes a pair that is listed.
/// Errors: gsp::Error for a pair that cannot collide, such as two planes; `compile` makes none; and where geoms that move times all geoms
/// that collide are 2^27 or more.
template <class R, ExecutionSpace Exec>
CollisionModel<R, typename Exec::memory_space> make_collision_model(Exec const& exec, CompiledModel const& m);

}  // namespace gsp

#include <gsp/collision/detail/collision_model_impl.hpp>
