#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/collision/shapes.hpp>
#include <gsp/core/check.hpp>
#include <gsp/core/exec.hpp>
#include <gsp/model/compiled.hpp>
#include <map>
#include <string>
#include <tuple>
#include <vector>

/// What collision needs of a model, constant, on the device. Colliders are the geoms that occur in a pair, sorted by group; a group is a
/// kinematic tree or a single static geom. Pairs are sorted by (kind, groups) and cut into chunks of at most 64 pairs of one kind: a chunk
/// of a world is one work item with a 64-bit mask of the pairs that are near, and since items are numbered chunk by chunk, candidates come
/// out bucketed by (shape, shape) without a sort.
namespace gsp {

/// Contact parameters of a pair after mixing (MuJoCo's mj_contactParam): the geom with the higher priority wins; else the larger condim and
/// friction, solref and solimp weighted by solmix (solref: the smaller, where one of them is not positive). margin and gap are sums.
template <class R>
struct ContactParameters {
  int condim;
  R margin, gap;  // detected if dist <= margin + gap, acts if dist < margin [m]
  R friction[5];  // sliding, sliding, torsional [m], rolling [m], rolling [m]
  R solref[2], solimp[5];
};

/// Mixes the parameters of geoms g1 and g2. Host.
inline ContactParameters<double> mix_contact_parameters(CompiledModel const& m, int g1, int g2) {
  ContactParameters<double> p{};
  p.margin = m.geom_margin[g1] + m.geom_margin[g2];
  p.gap = m.geom_gap[g1] + m.geom_gap[g2];
  std::array<double, 3> friction;
  if (m.geom_priority[g1] != m.geom_priority[g2]) {
    int const g = m.geom_priority[g1] > m.geom_priority[g2] ? g1 : g2;
    p.condim = m.geom_condim[g];
    friction = {m.geom_friction[g][0], m.geom_friction[g][1], m.geom_friction[g][2]};
    std::copy(m.geom_solref[g].begin(), m.geom_solref[g].end(), p.solref);
    std::copy(m.geom_solimp[g].begin(), m.geom_solimp[g].end(), p.solimp);
  } else {
    constexpr double tiny = 1e-15;
    p.condim = std::max(m.geom_condim[g1], m.geom_condim[g2]);
    for (int i = 0; i < 3; ++i) friction[i] = std::max(m.geom_friction[g1][i], m.geom_friction[g2][i]);
    double const s1 = m.geom_solmix[g1], s2 = m.geom_solmix[g2];
    double const mix = s1 >= tiny && s2 >= tiny ? s1 / (s1 + s2) : s1 < tiny && s2 < tiny ? 0.5 : s1 < tiny ? 0. : 1.;
    auto const &r1 = m.geom_solref[g1], &r2 = m.geom_solref[g2];
    for (int i = 0; i < 2; ++i) p.solref[i] = r1[0] > 0 && r2[0] > 0 ? mix * r1[i] + (1 - mix) * r2[i] : std::min(r1[i], r2[i]);
    for (int i = 0; i < 5; ++i) p.solimp[i] = mix * m.geom_solimp[g1][i] + (1 - mix) * m.geom_solimp[g2][i];
  }
  constexpr int unpack[5] = {0, 0, 1, 2, 2};
  for (int i = 0; i < 5; ++i) p.friction[i] = std::max(1e-5, friction[unpack[i]]);
  return p;
}

/// Pairs first ... end - 1 whose geoms are in groups a and b (a: the plane's, where one of the two is a plane).
template <class R>
struct CollisionRun {
  int a, b, first, end;
  R reach;  // largest margin + gap among them
};
/// At most 64 pairs of one kind, and the runs that they consist of.
struct CollisionChunk {
  int kind, first, end, run_first, run_end;
};

template <class R, class Mem>
struct CollisionModel {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int bodies = 0, colliders = 0, groups = 0, pairs = 0, chunks = 0;
  long slots = 0;                                          // most points that all pairs together can give
  View<int*> collider_geom, collider_body, collider_type;  // (colliders)
  View<R* [7]> collider_pose;                              // (colliders, 7) in the body's frame: position, quaternion w x y z
  View<R* [3]> collider_size;                              // (colliders, 3)
  View<int*> group_first;                                  // (groups + 1) first collider
  View<int* [2]> pair_collider;                            // (pairs, 2) colliders, type of the first <= type of the second
  View<int*> pair_parameters;                              // (pairs) index into parameters
  View<ContactParameters<R>*> parameters;                  // the different ones
  View<CollisionRun<R>*> runs;
  View<CollisionChunk*> chunk;                        // (chunks)
  Kokkos::View<int*, Kokkos::HostSpace> pair_source;  // (pairs) host: index of the pair in CompiledModel::pairs

  KOKKOS_INLINE_FUNCTION ContactParameters<R> const& parameters_of(int pair) const { return parameters(pair_parameters(pair)); }
};

/// Takes what collision needs of `m` to the memory of `exec`. Allocates; fences. Cost O(pairs log pairs), 24 bytes a pair.
/// Errors: a pair of shapes without a narrow-phase function (gsp::Error with the names of the geoms).
template <class R, ExecutionSpace Exec>
CollisionModel<R, typename Exec::memory_space> make_collision_model(Exec const& exec, CompiledModel const& m) {
  using C = CollisionModel<R, typename Exec::memory_space>;
  C c;
  c.bodies = m.nbody;
  bool const on = m.option.contact && m.option.constraint;
  int const npair = on ? int(m.pairs.size()) : 0;

  // colliders by group: trees first, then static geoms one by one
  std::vector<char> used(m.ngeom, 0);
  for (int k = 0; k < npair; ++k) {
    auto const [g1, g2] = m.pairs[k];
    if (pair_kind(ShapeType(m.geom_type[g1]), ShapeType(m.geom_type[g2])) == PairKind::none)
      throw Error("geoms '" + m.geom_name[g1] + "' and '" + m.geom_name[g2] +
                  "' can meet, and contact between their shapes is not supported: keep them apart with contype and conaffinity");
    used[g1] = used[g2] = 1;
  }
  std::vector<int> order;
  for (int g = 0; g < m.ngeom; ++g)
    if (used[g]) order.push_back(g);
  auto const tree = [&](int g) { return m.body_tree[m.geom_body[g]]; };
  auto const group_key = [&](int g) { return tree(g) >= 0 ? tree(g) : m.ntree + g; };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return group_key(a) < group_key(b); });
  std::vector<int> collider(m.ngeom, -1), group(m.ngeom, -1), group_first;
  for (int i = 0; i < int(order.size()); ++i) {
    if (i == 0 || group_key(order[i]) != group_key(order[i - 1])) group_first.push_back(i);
    collider[order[i]] = i, group[order[i]] = int(group_first.size()) - 1;
  }
  group_first.push_back(int(order.size()));
  c.colliders = int(order.size()), c.groups = int(group_first.size()) - 1, c.pairs = npair;

  // pairs by (kind, groups); the groups of a pair in ascending order, except that a plane stays first
  struct Key {
    int kind, a, b, source;
    bool operator<(Key const& o) const { return std::tie(kind, a, b, source) < std::tie(o.kind, o.a, o.b, o.source); }
  };
  std::vector<Key> keys(npair);
  for (int k = 0; k < npair; ++k) {
    auto const [g1, g2] = m.pairs[k];
    bool const plane = m.geom_type[g1] == int(ShapeType::plane);
    int const a = group[g1], b = group[g2];
    keys[k] = {int(pair_kind(ShapeType(m.geom_type[g1]), ShapeType(m.geom_type[g2]))), plane ? a : std::min(a, b),
               plane ? b : std::max(a, b), k};
  }
  std::sort(keys.begin(), keys.end());

  auto const host = [](auto const& view) { return Kokkos::create_mirror_view(Kokkos::HostSpace{}, view); };
  auto const view = [&](auto& v, std::string const& label, int n) {
    v = std::decay_t<decltype(v)>(Kokkos::view_alloc(exec, Kokkos::WithoutInitializing, label), n);
  };
  view(c.collider_geom, "gsp::CollisionModel::collider_geom", c.colliders);
  view(c.collider_body, "gsp::CollisionModel::collider_body", c.colliders);
  view(c.collider_type, "gsp::CollisionModel::collider_type", c.colliders);
  view(c.collider_pose, "gsp::CollisionModel::collider_pose", c.colliders);
  view(c.collider_size, "gsp::CollisionModel::collider_size", c.colliders);
  view(c.group_first, "gsp::CollisionModel::group_first", c.groups + 1);
  view(c.pair_collider, "gsp::CollisionModel::pair_collider", npair);
  view(c.pair_parameters, "gsp::CollisionModel::pair_parameters", npair);
  auto const geom = host(c.collider_geom), body = host(c.collider_body), type = host(c.collider_type), first = host(c.group_first),
             parameters = host(c.pair_parameters);
  auto const pose = host(c.collider_pose);
  auto const size = host(c.collider_size);
  auto const pair = host(c.pair_collider);
  for (int i = 0; i < c.colliders; ++i) {
    int const g = order[i];
    geom(i) = g, body(i) = m.geom_body[g], type(i) = m.geom_type[g];
    for (int k = 0; k < 3; ++k) pose(i, k) = R(m.geom_pos[g][k]), size(i, k) = R(m.geom_size[g][k]);
    for (int k = 0; k < 4; ++k) pose(i, 3 + k) = R(m.geom_quat[g][k]);
  }
  for (int i = 0; i <= c.groups; ++i) first(i) = group_first[i];

  std::vector<ContactParameters<R>> distinct;
  std::vector<CollisionRun<R>> runs;
  std::vector<CollisionChunk> chunks;
  c.pair_source = Kokkos::View<int*, Kokkos::HostSpace>("gsp::CollisionModel::pair_source", npair);
  // pairs of geoms with equal parameters share them: mixing depends on each geom's own set only
  std::map<std::array<double, 15>, int> geom_sets;
  std::vector<int> geom_set(m.ngeom, 0);
  for (int g : order) {
    auto const& f = m.geom_friction[g];
    auto const& r = m.geom_solref[g];
    auto const& s = m.geom_solimp[g];
    std::array<double, 15> const set{double(m.geom_condim[g]),
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
                                     s[4]};
    geom_set[g] = geom_sets.try_emplace(set, int(geom_sets.size())).first->second;
  }
  std::map<std::array<int, 2>, int> mixed;
  for (int k = 0; k < npair; ++k) {
    auto const& key = keys[k];
    auto const [g1, g2] = m.pairs[key.source];
    c.pair_source(k) = key.source;
    pair(k, 0) = collider[g1], pair(k, 1) = collider[g2];
    auto const [at, fresh] = mixed.try_emplace({geom_set[g1], geom_set[g2]}, int(distinct.size()));
    if (fresh) {
      auto const p = mix_contact_parameters(m, g1, g2);
      ContactParameters<R> r{p.condim, R(p.margin), R(p.gap), {}, {}, {}};
      for (int i = 0; i < 5; ++i) r.friction[i] = R(p.friction[i]), r.solimp[i] = R(p.solimp[i]);
      for (int i = 0; i < 2; ++i) r.solref[i] = R(p.solref[i]);
      distinct.push_back(r);
    }
    parameters(k) = at->second;
    c.slots += max_points(PairKind(key.kind));

    bool const new_chunk = chunks.empty() || chunks.back().kind != key.kind || chunks.back().end - chunks.back().first == 64;
    if (new_chunk) chunks.push_back({key.kind, k, k, int(runs.size()), int(runs.size())});
    if (new_chunk || runs.back().a != key.a || runs.back().b != key.b) runs.push_back({key.a, key.b, k, k, R(0)});
    auto const& own = distinct[parameters(k)];
    runs.back().end = chunks.back().end = k + 1, chunks.back().run_end = int(runs.size());
    runs.back().reach = std::max(runs.back().reach, own.margin + own.gap);
  }
  c.chunks = int(chunks.size());
  view(c.parameters, "gsp::CollisionModel::parameters", int(distinct.size()));
  view(c.runs, "gsp::CollisionModel::runs", int(runs.size()));
  view(c.chunk, "gsp::CollisionModel::chunk", c.chunks);
  auto const h_parameters = host(c.parameters);
  auto const h_runs = host(c.runs);
  auto const h_chunk = host(c.chunk);
  for (std::size_t i = 0; i < distinct.size(); ++i) h_parameters(i) = distinct[i];
  for (std::size_t i = 0; i < runs.size(); ++i) h_runs(i) = runs[i];
  for (std::size_t i = 0; i < chunks.size(); ++i) h_chunk(i) = chunks[i];
  auto const copy = [&](auto const& to, auto const& from) { Kokkos::deep_copy(exec, to, from); };
  copy(c.collider_geom, geom), copy(c.collider_body, body), copy(c.collider_type, type), copy(c.collider_pose, pose),
      copy(c.collider_size, size), copy(c.group_first, first);
  copy(c.pair_collider, pair), copy(c.pair_parameters, parameters), copy(c.parameters, h_parameters), copy(c.runs, h_runs),
      copy(c.chunk, h_chunk);
  exec.fence("gsp::make_collision_model: the host copies may go now");
  return c;
}

}  // namespace gsp
