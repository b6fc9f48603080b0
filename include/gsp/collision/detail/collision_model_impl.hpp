#pragma once
#include <algorithm>
#include <array>
#include <gsp/collision/collision_model.hpp>
#include <gsp/collision/detail/pair_search_maker.hpp>
#include <gsp/core/detail/views.hpp>
#include <gsp/model/archetypes.hpp>
#include <map>
#include <string>
#include <tuple>
#include <vector>

/// Contact parameters, colliders, pairs and chunks of gsp/collision/collision_model.hpp, where the contract stands.
namespace gsp {

template <class R>
KOKKOS_INLINE_FUNCTION ContactParameters<R> mix_contact_parameters(GeomContact<R> const& a, GeomContact<R> const& b) {
  ContactParameters<R> p{};
  p.margin = a.margin + b.margin;
  p.gap = a.gap + b.gap;
  R friction[3];
  if (a.priority != b.priority) {
    GeomContact<R> const& g = a.priority > b.priority ? a : b;
    p.condim = g.condim;
    for (int i = 0; i < 3; ++i) friction[i] = g.friction[i];
    for (int i = 0; i < 2; ++i) p.solref[i] = g.solref[i];
    for (int i = 0; i < 5; ++i) p.solimp[i] = g.solimp[i];
    p.adhesion = g.adhesion;
    p.hard = g.hard;
    p.restitution = g.restitution;
    p.erp = g.erp;
  } else {
    R const tiny(1e-15);
    p.condim = a.condim > b.condim ? a.condim : b.condim;
    GeomContact<R> const& rigid = a.hard ? a : b;
    bool const both = a.hard && b.hard;
    p.hard = a.hard || b.hard;
    p.restitution = both && b.restitution > rigid.restitution ? b.restitution : rigid.restitution;
    p.erp = both && b.erp > rigid.erp ? b.erp : rigid.erp;
    for (int i = 0; i < 3; ++i) friction[i] = a.friction[i] > b.friction[i] ? a.friction[i] : b.friction[i];
    R const s1 = a.solmix, s2 = b.solmix;
    R const mix = s1 >= tiny && s2 >= tiny ? s1 / (s1 + s2) : s1 < tiny && s2 < tiny ? R(0.5) : s1 < tiny ? R(0) : R(1);
    bool const standard = a.solref[0] > R(0) && b.solref[0] > R(0);
    auto const between = [mix](R x, R y) { return x == y ? x : mix * x + (R(1) - mix) * y; };  // what both say stays, to the bit
    for (int i = 0; i < 2; ++i) {
      R const least = a.solref[i] < b.solref[i] ? a.solref[i] : b.solref[i];
      p.solref[i] = standard ? between(a.solref[i], b.solref[i]) : least;
    }
    for (int i = 0; i < 5; ++i) p.solimp[i] = between(a.solimp[i], b.solimp[i]);
    p.adhesion = a.adhesion + b.adhesion;
  }
  for (int i = 0; i < 5; ++i) {
    R const f = friction[i < 2 ? 0 : i == 2 ? 1 : 2];
    p.friction[i] = f > R(1e-5) ? f : R(1e-5);
  }
  return p;
}

namespace detail {
template <class R>
class PairSearchMaker;  // its header may be included first, and includes this one

template <class R>
GeomContact<R> geom_contact(CompiledModel const& m, int g) {
  GeomContact<R> c{
      m.geom_priority[g],  m.geom_condim[g],         R(m.geom_solmix[g]), R(m.geom_margin[g]), R(m.geom_gap[g]), {}, {}, {}, R(0),
      m.geom_hard[g] != 0, R(m.geom_restitution[g]), R(m.geom_erp[g])};
  for (int i = 0; i < 3; ++i) c.friction[i] = R(m.geom_friction[g][i]);
  for (int i = 0; i < 2; ++i) c.solref[i] = R(m.geom_solref[g][i]);
  for (int i = 0; i < 5; ++i) c.solimp[i] = R(m.geom_solimp[g][i]);
  c.adhesion = R(item_or(m.geom_adhesion, g, 0.));
  return c;
}
}  // namespace detail

inline ContactParameters<double> mix_contact_parameters(CompiledModel const& m, int g1, int g2) {
  return mix_contact_parameters(detail::geom_contact<double>(m, g1), detail::geom_contact<double>(m, g2));
}

namespace detail {
/// As they are, or with flag override as the option says.
inline ContactParameters<double> with_override(OptionDescription const& o, ContactParameters<double> p) {
  if (!o.override_contacts) return p;
  p.margin = o.o_margin;
  for (int i = 0; i < 5; ++i) p.friction[i] = std::max(o.o_friction[i], 1e-5);
  for (int i = 0; i < 5; ++i) p.solimp[i] = o.o_softness.solimp[i];
  for (int i = 0; i < 2; ++i) p.solref[i] = o.o_softness.solref[i];
  for (int i = 0; i < 2; ++i) p.solreffriction[i] = 0;  // as solref
  return p;
}
template <class R>
ContactParameters<R> in_precision(ContactParameters<double> const& p) {
  ContactParameters<R> r{p.condim, R(p.margin), R(p.gap), {}, {}, {}, {}, R(p.adhesion), p.hard, R(p.restitution), R(p.erp)};
  for (int i = 0; i < 5; ++i) r.friction[i] = R(p.friction[i]);
  for (int i = 0; i < 5; ++i) r.solimp[i] = R(p.solimp[i]);
  for (int i = 0; i < 2; ++i) r.solref[i] = R(p.solref[i]);
  for (int i = 0; i < 2; ++i) r.solreffriction[i] = R(p.solreffriction[i]);
  return r;
}
/// Adds number `at`, which is `fixed` beside `other`, to the last of the spans, where it belongs there, or to a new one.
/// @param apart  the last is another's
/// @param next   or else it is in the last already
template <class R>
void add_to_spans(std::vector<CollisionSpan<R>>& spans, bool apart, int fixed, int other, int at, bool next, R reach) {
  bool const fits = !apart && spans.back().fixed == fixed && other >= spans.back().first &&
                    other - spans.back().first < CollisionSpan<R>::most &&
                    (!next || spans.back().others >> (other - spans.back().first) == 0);
  if (!fits) spans.push_back({fixed, other, 0, at, reach});
  auto& span = spans.back();
  span.others |= std::uint32_t(1) << (other - span.first);
  span.reach = std::max(span.reach, reach);
}
}  // namespace detail

inline ContactParameters<double> contact_parameters(CompiledModel const& m, int pair) {
  if (pair < int(m.pairs.size())) {
    auto const [g1, g2] = m.pair_geoms(pair);
    return detail::with_override(m.option, mix_contact_parameters(m, g1, g2));
  }
  auto const& own = m.named_pairs[pair - m.pairs.size()];
  ContactParameters<double> p{};
  p.condim = own.condim;
  p.margin = own.margin;
  p.gap = own.gap;
  for (int i = 0; i < 5; ++i) p.friction[i] = std::max(own.friction[i], 1e-5);
  for (int i = 0; i < 5; ++i) p.solimp[i] = own.solimp[i];
  for (int i = 0; i < 2; ++i) p.solref[i] = own.solref[i];
  for (int i = 0; i < 2; ++i) p.solreffriction[i] = own.solreffriction[i];
  p.adhesion = own.adhesion;
  p.hard = own.rigid.hard;
  p.restitution = own.rigid.restitution;
  p.erp = own.rigid.erp;
  return detail::with_override(m.option, p);
}

template <class R, ExecutionSpace Exec>
CollisionModel<R, typename Exec::memory_space> make_collision_model(Exec const& exec, CompiledModel const& m) {
  using C = CollisionModel<R, typename Exec::memory_space>;
  C c;
  c.bodies = m.nbody;
  c.geoms = m.ngeom;
  c.overridden = m.option.override_contacts;
  bool const on = m.option.contact && m.option.constraint;
  int const npair = on ? m.pair_count() : 0;
  detail::PairSearchMaker<R> const search(m, on);

  // colliders by group: trees first, then static geoms one by one
  std::vector<char> used(m.ngeom, 0);
  for (int k = 0; k < npair; ++k) {
    auto const [g1, g2] = m.pair_geoms(k);
    if (std::min(g1, g2) < 0 || std::max(g1, g2) >= m.ngeom)
      throw Error("pair " + std::to_string(k) + " is of geoms " + std::to_string(g1) + " and " + std::to_string(g2) +
                  ", and the model has " + std::to_string(m.ngeom) + ": correct CompiledModel::pairs");
    if (pair_kind(ShapeType(m.geom_type[g1]), ShapeType(m.geom_type[g2])) == PairKind::none)
      throw Error("geoms '" + m.geom_name[g1] + "' and '" + m.geom_name[g2] +
                  "' are a pair, but shapes such as theirs never touch, or stand in the other order: see gsp/geometry/shape_pairs.hpp");
    used[g1] = used[g2] = 1;
  }
  search.add_used(used);
  std::vector<int> order;
  for (int g = 0; g < m.ngeom; ++g)
    if (used[g]) order.push_back(g);
  auto const tree = [&](int g) { return m.body_tree[m.geom_body[g]]; };
  auto const group_key = [&](int g) { return tree(g) >= 0 ? tree(g) : m.ntree + g; };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return group_key(a) < group_key(b); });
  std::vector<int> collider(m.ngeom, -1), group(m.ngeom, -1), group_first;
  for (int i = 0; i < int(order.size()); ++i) {
    if (i == 0 || group_key(order[i]) != group_key(order[i - 1])) group_first.push_back(i);
    collider[order[i]] = i;
    group[order[i]] = int(group_first.size()) - 1;
  }
  group_first.push_back(int(order.size()));
  c.colliders = int(order.size());
  c.groups = int(group_first.size()) - 1;
  c.pairs = npair;

  // pairs by (kind, groups, colliders); the groups of a pair in ascending order and then the colliders, except that a plane stays first
  struct Key {
    int kind, a, b, fixed, other, source;
    auto operator<=>(Key const&) const = default;
  };
  std::vector<Key> keys(npair);
  for (int k = 0; k < npair; ++k) {
    auto const [g1, g2] = m.pair_geoms(k);
    bool const plane = m.geom_type[g1] == int(ShapeType::plane);
    bool const swapped = !plane && std::pair(group[g1], collider[g1]) > std::pair(group[g2], collider[g2]);
    int const first = swapped ? g2 : g1, second = swapped ? g1 : g2;
    keys[k] = {int(pair_kind(ShapeType(m.geom_type[g1]), ShapeType(m.geom_type[g2]))),
               group[first],
               group[second],
               collider[first],
               collider[second],
               k};
  }
  std::sort(keys.begin(), keys.end());

  std::vector<int> geom, body, type, pair, parameters, source;
  for (auto const& p : m.named_pairs) c.bounces = c.bounces || (p.rigid.hard && p.rigid.restitution > 0);
  std::vector<R> pose, size, friction, solref, solimp, surface;
  bool moving = false;
  std::vector<GeomContact<R>> contact;
  for (int i = 0; i < c.colliders; ++i) {
    int const g = order[i];
    c.bounces = c.bounces || (m.geom_hard[g] != 0 && m.geom_restitution[g] > 0);
    geom.push_back(g);
    body.push_back(m.geom_body[g]);
    type.push_back(m.geom_type[g]);
    pose.insert(pose.end(), m.geom_pos[g].begin(), m.geom_pos[g].end());
    pose.insert(pose.end(), m.geom_quat[g].begin(), m.geom_quat[g].end());
    size.insert(size.end(), m.geom_size[g].begin(), m.geom_size[g].end());
    contact.push_back(detail::geom_contact<R>(m, g));
    auto const& own = contact.back();
    friction.insert(friction.end(), own.friction, own.friction + 3);
    solref.insert(solref.end(), own.solref, own.solref + 2);
    solimp.insert(solimp.end(), own.solimp, own.solimp + 5);
    auto const velocity = detail::item_or(m.geom_surfacevel, g, std::array<double, 6>{});
    surface.insert(surface.end(), velocity.begin(), velocity.end());
    moving = moving || velocity != std::array<double, 6>{};
  }

  if (!moving) surface.clear();

  std::vector<int> asset;
  c.assets = make_shape_assets<R>(exec, m, order, asset);
  std::vector<ContactParameters<R>> distinct;
  std::vector<CollisionRun> runs;
  std::vector<CollisionSpan<R>> group_spans, single_spans, spans;
  int run_a = -1, run_b = -1;  // the groups of the last run
  bool among_singles = false;  // the last pair is of groups with one collider each
  auto const single = [&](int g) { return group_first[g + 1] - group_first[g] == 1; };
  std::vector<CollisionChunk> chunks;
  // pairs of geoms with equal parameters share them: mixing depends on each geom's own set only
  std::map<std::array<double, 19>, int> geom_sets;
  std::vector<int> geom_set(m.ngeom, 0);
  for (int g : order) {
    auto const& f = m.geom_friction[g];
    auto const& r = m.geom_solref[g];
    auto const& s = m.geom_solimp[g];
    std::array<double, 19> const set{double(m.geom_hard[g]),
                                     m.geom_restitution[g],
                                     m.geom_erp[g],
                                     double(m.geom_condim[g]),
                                     double(m.geom_priority[g]),
                                     f[0],
                                     f[1],
                                     f[2],
                                     m.geom_solmix[g],
                                     m.geom_margin[g],
                                     m.geom_gap[g],
                                     r[0],
                                     r[1],
                                     s[0],
                                     s[1],
                                     s[2],
                                     s[3],
                                     s[4],
                                     detail::item_or(m.geom_adhesion, g, 0.)};
    geom_set[g] = geom_sets.try_emplace(set, int(geom_sets.size())).first->second;
  }
  auto const add_parameters = [&](ContactParameters<double> const& p) {
    distinct.push_back(detail::in_precision<R>(p));
    return int(distinct.size()) - 1;
  };
  std::vector<int> parameters_of(npair);  // by source: the mixed ones first
  std::map<std::array<int, 2>, int> mixed;
  auto const mix = [&](int g1, int g2) {
    auto const [at, fresh] = mixed.try_emplace({geom_set[g1], geom_set[g2]}, int(distinct.size()));
    if (fresh) add_parameters(detail::with_override(m.option, mix_contact_parameters(m, g1, g2)));
    return at->second;
  };
  int const listed = std::min(npair, int(m.pairs.size()));
  for (int k = 0; k < listed; ++k) parameters_of[k] = mix(m.pairs[k][0], m.pairs[k][1]);
  search.make(exec, order, collider, geom_set, int(geom_sets.size()), mix, c);
  for (int k = listed; k < npair; ++k) parameters_of[k] = add_parameters(contact_parameters(m, k));
  c.mixed_parameters = int(mixed.size());
  for (int k = 0; k < npair; ++k) {
    auto const& key = keys[k];
    auto const [g1, g2] = m.pair_geoms(key.source);
    source.push_back(key.source);
    pair.push_back(collider[g1]);
    pair.push_back(collider[g2]);
    parameters.push_back(parameters_of[key.source]);
    c.slots += max_points(PairKind(key.kind));
    c.has_convex_pairs |= is_among(detail::convex_kinds, PairKind(key.kind));

    bool const new_chunk = chunks.empty() || chunks.back().kind != key.kind || chunks.back().end - chunks.back().first == 64;
    auto const& own = distinct[parameters.back()];
    R const reach = own.margin + own.gap;
    if (new_chunk) {
      int const singles = int(single_spans.size()), group_pairs = int(group_spans.size());
      chunks.push_back({key.kind, k, k, singles, singles, group_pairs, group_pairs, max_points(PairKind(key.kind))});
      run_a = run_b = -1;
      among_singles = false;
    }
    int const at = k - chunks.back().first;
    if (key.a != key.b && single(key.a) && single(key.b)) {
      detail::add_to_spans(single_spans, !among_singles, key.fixed, key.other, at, true, reach);
      among_singles = true;
    } else {
      bool const first = int(group_spans.size()) == chunks.back().group_first, new_run = key.a != run_a || key.b != run_b;
      among_singles = false;
      if (new_run) runs.push_back({int(spans.size()), int(spans.size())});
      run_a = key.a;
      run_b = key.b;
      detail::add_to_spans(group_spans, first, key.a, key.b, int(runs.size()) - 1, new_run, reach);
      detail::add_to_spans(spans, new_run, key.fixed, key.other, at, true, reach);
      runs.back().end = int(spans.size());
    }
    c.most_edges = std::max(c.most_edges, 2 * (own.condim - 1));
    c.adhesive |= own.adhesion != R(0);
    chunks.back().end = k + 1;
    chunks.back().single_end = int(single_spans.size());
    chunks.back().group_end = int(group_spans.size());
  }
  c.chunks = int(chunks.size());

  std::vector<int> ints;
  std::vector<R> reals;
  auto const begin = [](auto& all, auto const& part) {  // appends a part and says where it begins
    auto const at = all.size();
    all.insert(all.end(), part.begin(), part.end());
    return at;
  };
  std::size_t const at_geom = begin(ints, geom), at_body = begin(ints, body), at_type = begin(ints, type), at_asset = begin(ints, asset),
                    at_pair = begin(ints, pair), at_group = begin(ints, group_first), at_parameters = begin(ints, parameters),
                    at_pose = begin(reals, pose), at_size = begin(reals, size), at_friction = begin(reals, friction),
                    at_solref = begin(reals, solref), at_solimp = begin(reals, solimp), at_surface = begin(reals, surface);
  c.ints = detail::to_device<decltype(c.ints)>(exec, "gsp::CollisionModel::ints", ints);
  c.reals = detail::to_device<decltype(c.reals)>(exec, "gsp::CollisionModel::reals", reals);
  c.parameters = detail::to_device<decltype(c.parameters)>(exec, "gsp::CollisionModel::parameters", distinct);
  c.collider_contact = detail::to_device<decltype(c.collider_contact)>(exec, "gsp::CollisionModel::collider_contact", contact);
  c.runs = detail::to_device<decltype(c.runs)>(exec, "gsp::CollisionModel::runs", runs);
  c.group_spans = detail::to_device<decltype(c.group_spans)>(exec, "gsp::CollisionModel::group_spans", group_spans);
  c.single_spans = detail::to_device<decltype(c.single_spans)>(exec, "gsp::CollisionModel::single_spans", single_spans);
  c.spans = detail::to_device<decltype(c.spans)>(exec, "gsp::CollisionModel::spans", spans);
  c.chunk = detail::to_device<decltype(c.chunk)>(exec, "gsp::CollisionModel::chunk", chunks);
  c.pair_source =
      detail::to_device<decltype(c.pair_source)>(Kokkos::DefaultHostExecutionSpace{}, "gsp::CollisionModel::pair_source", source);
  int const* const i = c.ints.data();
  R const* const r = c.reals.data();
  c.collider_geom = {i + at_geom, geom.size()};
  c.collider_body = {i + at_body, body.size()};
  c.collider_type = {i + at_type, type.size()};
  c.collider_asset = {i + at_asset, asset.size()};
  c.collider_pose = {r + at_pose};
  c.collider_size = {r + at_size};
  c.collider_friction = {r + at_friction};
  c.collider_solref = {r + at_solref};
  c.collider_solimp = {r + at_solimp};
  if (moving) c.collider_surface = {r + at_surface, geom.size()};
  c.group_first = {i + at_group, group_first.size()};
  c.pair_collider = {i + at_pair, source.size()};
  c.pair_parameters = {i + at_parameters, source.size()};
  return c;
}

}  // namespace gsp
