// The search for pairs where they are too many to list: it finds what all pairs, asked one by one, are, and contacts are those of the list
// to the bit, whatever moves, whatever the capacities and the number of threads.
#include <doctest/doctest.h>

#include <algorithm>
#include <gsp/collision/geom_values.hpp>
#include <gsp/model/samples.hpp>
#include <gsp_test_execs.hpp>
#include <set>
#include <support/kokkos_tools.hpp>

#include "scenes.hpp"
#include "support/kernels.hpp"

using namespace gsp;
using gsp_test::download;
using gsp_test::HostContact;

namespace {

constexpr CompileOptions searched{.listed_pairs = 0};

/// Robots and free bodies of all shapes over planes and a height field, among static geoms of the world and of bodies of their own, and one
/// that a user moves; filters of all sorts.
Description scene(int n, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.04, 0.15), place(-1, 1);
  auto const draw = [&](int k) { return int(random() % unsigned(k)); };
  Description d;
  d.meshes.push_back({.name = "tetrahedron",
                      .vertices = {{0, 0, 0.2f}, {0.2f, 0, -0.1f}, {-0.1f, 0.15f, -0.1f}, {-0.1f, -0.15f, -0.1f}},
                      .faces = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}},
                      .hull = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}}});
  d.hfields.push_back({.name = "field", .rows = 3, .columns = 3, .size = {1, 1, 0.1, 0.1}, .elevation = {0, 1, 0, 0, 1, 1, 0, 0, 0}});
  ShapeType const types[] = {ShapeType::sphere, ShapeType::capsule,  ShapeType::ellipsoid,
                             ShapeType::box,    ShapeType::cylinder, ShapeType::mesh};
  int geoms = 0;
  auto const some_geom = [&] {
    auto g = gsp_test::geom(types[draw(6)], {uniform(random), uniform(random), uniform(random)});
    if (g.type == ShapeType::mesh) g.mesh = "tetrahedron";
    g.name = "geom" + std::to_string(geoms++);
    g.pos = {0.1 * place(random), 0.1 * place(random), 0.1 * place(random)}, g.quat = gsp_test::random_quat(random);
    if (draw(3) == 0) g.margin = 0.03, g.gap = 0.02;
    if (draw(4) == 0) g.contype = draw(4), g.conaffinity = draw(4);
    g.friction[0] = 0.1 * (1 + draw(4)), g.priority = draw(8) == 0, g.condim = draw(5) == 0 ? 4 : 3;
    return g;
  };
  auto floor = gsp_test::geom(ShapeType::plane, {0, 0, 1}), wall = floor, field = gsp_test::geom(ShapeType::hfield, {0, 0, 0});
  wall.pos = {-0.8, 0, 0}, wall.quat = {std::sqrt(0.5), 0, std::sqrt(0.5), 0}, wall.name = "wall", field.hfield = "field";
  d.bodies[0].geoms = {floor, wall, field};
  for (int k = 0; k < n / 3; ++k) {
    d.bodies[0].geoms.push_back(some_geom());
    d.bodies[0].geoms.back().pos = {place(random), place(random), 0.3 * place(random)};
  }
  for (int k = 0; k < n; ++k) {
    BodyDescription b;
    b.name = "body" + std::to_string(k), b.parent = 0, b.pos = {0.6 * place(random), 0.6 * place(random), 0.3};
    int const kind = k % 6;  // 0: stands, 1: moved by a user, 2, 3: a link of the body before, else free
    if (kind == 1) b.mocap = true;
    if (kind > 1) b.joints.push_back({.name = "joint" + std::to_string(k), .type = kind < 4 && k > 3 ? JointType::hinge : JointType::free});
    if (kind == 2 || kind == 3) b.parent = k > 3 ? (kind == 2 ? 0 : k) : 0;
    for (int g = 1 + draw(2); g > 0; --g) b.geoms.push_back(some_geom());
    d.bodies.push_back(b);
  }
  if (n > 5) {
    d.excludes.push_back({.body1 = "world", .body2 = "body5"});
    d.excludes.push_back({.body1 = "body4", .body2 = "body5"});
    d.pairs.push_back({.name = "named", .geom1 = d.bodies[5].geoms[0].name, .geom2 = d.bodies[6].geoms[0].name});
    d.pairs.back().margin = 0.1;
  }
  return d;
}

/// Poses of all bodies: free and mocap bodies anywhere, links and static ones too, which the pipeline need not know.
std::vector<double> anywhere(CompiledModel const& m, int worlds, double spread, unsigned seed = 3) {
  return gsp_test::random_poses(m, worlds, spread, seed, true);
}

template <class Exec, class Mem, class R>
auto contacts_of(Exec const& exec, CollisionModel<R, Mem> const& model, Poses<R, Mem> const& poses, ContactsOptions options) {
  auto contacts = make_contacts(exec, model, options);
  do collide(exec, model, poses, contacts);
  while (grow(exec, contacts));
  return contacts;
}

/// What contacts are without their order and the numbers of their pairs.
template <class R>
auto sorted(std::vector<HostContact<R>> list) {
  for (auto& c : list) c.pair = 0;
  auto const key = [](auto const& c) { return std::array{c.world, c.geom1, c.geom2, c.feature, int(c.includemargin * 1e4f)}; };
  std::stable_sort(list.begin(), list.end(), [&](auto const& a, auto const& b) { return key(a) < key(b); });
  return list;
}

/// Who the candidates are: (world, geom, geom), the lower geom first.
template <class Exec, class R, class Mem>
std::vector<std::array<int, 3>> candidates(Exec const& exec, CompiledModel const& m, CollisionModel<R, Mem> const& model,
                                           Contacts<R, Mem> const& contacts) {
  auto const total = contacts.demand(exec).candidates;
  auto const all = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, contacts.scratch.candidates);
  std::vector<int> geom(std::size_t(model.colliders));
  Kokkos::View<int*, Mem> copy("copy", model.colliders);
  auto const from = model.collider_geom;
  Kokkos::parallel_for(
      "test", Kokkos::RangePolicy<Exec>(exec, 0, model.colliders), KOKKOS_LAMBDA(int i) { copy(i) = from(i); });
  auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, copy);
  std::vector<std::array<int, 3>> result;
  for (std::int64_t k = 0; k < total; ++k) {
    int const pair = all(k).pair;
    int a, b;
    if (pair < model.pairs) {
      auto const [g1, g2] = m.pair_geoms(model.pair_source(pair));
      a = g1, b = g2;
    } else {
      a = host((pair - model.pairs) / model.colliders), b = host((pair - model.pairs) % model.colliders);
    }
    result.push_back({all(k).world, std::min(a, b), std::max(a, b)});
  }
  std::sort(result.begin(), result.end());
  return result;
}

/// Two geoms, asked by MuJoCo's rules (docs/io): named, or bits, welds, parents and excludes.
bool may_touch(Description const& d, CompiledModel const& m, int a, int b) {
  for (auto const& p : m.named_pairs)
    if (std::minmax(p.geom1, p.geom2) == std::minmax(a, b)) return true;
  int const body_a = m.geom_body[a], body_b = m.geom_body[b], wa = m.body_weld[body_a], wb = m.body_weld[body_b];
  bool const bits = (m.geom_contype[a] & m.geom_conaffinity[b]) || (m.geom_contype[b] & m.geom_conaffinity[a]);
  bool const moves = m.body_dofnum[wa] > 0 || m.body_dofnum[wb] > 0;
  bool const family = d.option.filterparent && wa && wb && (wa == m.body_weld[m.body_parent[wb]] || wb == m.body_weld[m.body_parent[wa]]);
  for (auto const& e : d.excludes) {
    auto const name = [&](int body) { return body == 0 ? std::string("world") : m.body_name[body]; };
    if (std::set{e.body1, e.body2} == std::set{name(body_a), name(body_b)}) return false;
  }
  return bits && wa != wb && moves && !family && can_collide(ShapeType(m.geom_type[a]), ShapeType(m.geom_type[b]));
}
/// How far the boxes of two geoms are apart, less what they reach; from supports, which the library's boxes are not made of.
double box_distance(CompiledModel const& m, std::vector<double> const& poses, int w, int a, int b) {
  auto const side = [&](int g, int axis, double sign) {
    double const* p = &poses[(std::size_t(w) * m.nbody + m.geom_body[g]) * 7];
    auto const &x = m.geom_pos[g], &s = m.geom_size[g];
    auto const& q = m.geom_quat[g];
    Transform<double> const t =
        Transform<double>{{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}} * Transform<double>{{x[0], x[1], x[2]}, {q[0], q[1], q[2], q[3]}};
    Vec3<double> n{0, 0, 0};
    n[axis] = sign;
    Vec3<double> const local = transpose_times(to_matrix(t.q), n);
    // a mesh is as large as the box of its sizes
    ShapeType const type = m.geom_type[g] == int(ShapeType::mesh) ? ShapeType::box : ShapeType(m.geom_type[g]);
    return (t * support(type, ShapeData<double>{{s[0], s[1], s[2]}}, local))[axis];
  };
  double apart = -1e300;
  for (int i = 0; i < 3; ++i) apart = std::max({apart, side(a, i, -1) - side(b, i, 1), side(b, i, -1) - side(a, i, 1)});
  return apart - (m.geom_margin[a] + m.geom_margin[b] + m.geom_gap[a] + m.geom_gap[b]);
}

}  // namespace

TEST_CASE_TEMPLATE("the search finds the pairs that all pairs asked one by one are", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 5;
  for (int trial = 0; trial < 6; ++trial) {
    auto d = scene(trial == 0 ? 4 : 60, unsigned(trial) + 1);
    d.option.filterparent = trial % 2 == 0;
    auto const m = compile(d, searched);
    REQUIRE(m.pairs_searched);
    auto const host_poses = anywhere(m, worlds, 0.6, unsigned(trial));
    auto const model = make_collision_model<double>(exec, m);
    auto const contacts =
        contacts_of(exec, model, gsp_test::upload_poses<double>(exec, m, host_poses, 0, worlds), ContactsOptions{.worlds = worlds});
    auto const found = candidates(exec, m, model, contacts);
    CHECK(std::adjacent_find(found.begin(), found.end()) == found.end());  // none twice
    std::size_t near = 0, wrong = 0, missing = 0;
    std::set<std::array<int, 2>> named;
    for (auto const& p : m.named_pairs) named.insert({std::min(p.geom1, p.geom2), std::max(p.geom1, p.geom2)});
    for (int w = 0; w < worlds; ++w)
      for (int a = 0; a < m.ngeom; ++a)
        for (int b = a + 1; b < m.ngeom; ++b) {
          bool const wide = is_wide(ShapeType(m.geom_type[a])) || is_wide(ShapeType(m.geom_type[b]));
          if (wide || named.count({a, b})) continue;  // listed, and so tested by contacts.cpp
          bool const is_found = std::binary_search(found.begin(), found.end(), std::array{w, a, b});
          // Boxes of the library are wider by roundings, a few 1e-15 m: nobody is in between.
          bool const is_near = may_touch(d, m, a, b) && box_distance(m, host_poses, w, a, b) <= 0;
          near += is_near;
          missing += is_near && !is_found;
          wrong += is_found && !(may_touch(d, m, a, b) && box_distance(m, host_poses, w, a, b) <= 1e-12);
        }
    CHECK(missing == 0);
    CHECK(wrong == 0);
    if (trial > 0) CHECK(near > 500);
  }
}

TEST_CASE_TEMPLATE("contacts are those of the list, to the bit", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 4;
  for (int trial = 0; trial < 4; ++trial) {
    auto d = scene(50, unsigned(trial) + 20);
    d.option.override_contacts = trial == 3;
    d.option.o_margin = 0.02;
    auto const listed = compile(d), m = compile(d, searched);
    REQUIRE(!listed.pairs_searched);
    auto const poses = gsp_test::upload_poses<float>(exec, m, anywhere(m, worlds, 0.5, unsigned(trial)), 0, worlds);
    auto model = make_collision_model<float>(exec, m), reference = make_collision_model<float>(exec, listed);
    CHECK(model.movers > 40);
    CHECK(model.pairs < reference.pairs / 2);
    CHECK(model.most_edges == reference.most_edges);
    auto const a = download(exec, contacts_of(exec, model, poses, ContactsOptions{.worlds = worlds}));
    auto const b = download(exec, contacts_of(exec, reference, poses, ContactsOptions{.worlds = worlds}));
    CHECK(a.size() > 500);
    CHECK((sorted(a) == sorted(b)));
    CHECK(std::is_sorted(a.begin(), a.end(), [](auto const& x, auto const& y) {
      return std::array{x.world, x.pair} < std::array{y.world, y.pair};
    }));
  }
}

// On a GPU a warp finds the near pairs of a chunk where worlds are few, a thread where they are many: the same bits of the mask.
TEST_CASE_TEMPLATE("near pairs are the same by threads alone", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const worlds = 3;
  auto const m = compile(scene(50));  // listed
  REQUIRE(!m.pairs_searched);
  auto const model = make_collision_model<float>(exec, m);
  auto poses = gsp_test::upload_poses<float>(exec, m, anywhere(m, worlds, 0.5), 0, worlds);
  auto bounds = contacts_of(exec, model, poses, ContactsOptions{.worlds = worlds}).scratch.bounds;
  Kokkos::View<std::uint64_t*, Mem> mask("mask", std::size_t(model.chunks) * worlds), alone("alone", mask.extent(0));
  Kokkos::View<std::uint32_t*, Mem> const status("status", worlds);
  for (bool broken : {false, true}) {
    if (broken) {
      auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, bounds.group);
      host(1, 0, model.groups - 1) = std::numeric_limits<float>::quiet_NaN();
      Kokkos::deep_copy(bounds.group, host);
    }
    Kokkos::deep_copy(status, 0u);
    find_near_pairs(exec, model, bounds, mask, status.data());
    exec.fence();
    auto const by_warps = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, status);
    Kokkos::deep_copy(status, 0u);
    Kokkos::parallel_for(
        "gsp::test::near_pairs",
        gsp::lightweight(Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(mask.extent(0)))),
        detail::FindNearPairs<float, Mem>{model, bounds, alone, worlds, status.data()});
    exec.fence();
    auto const by_threads = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, status);
    auto const a = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, mask);
    auto const b = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, alone);
    int near = 0, differ = 0;
    for (std::size_t k = 0; k < a.extent(0); ++k) near += Kokkos::popcount(a(k)), differ += a(k) != b(k);
    CHECK(near > 500);
    CHECK(differ == 0);
    for (int w = 0; w < worlds; ++w) {
      CHECK(by_warps(w) == by_threads(w));
      CHECK((by_warps(w) & status::not_finite) == (broken && w == 1 ? status::not_finite : 0u));
    }
  }
}

TEST_CASE_TEMPLATE("contact parameters are those of the list, also where geoms have many sets or worlds their own", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  for (int trial = 0; trial < 4; ++trial) {
    auto d = scene(60, 7);
    int k = 0;
    if (trial % 2 == 1)  // more sets than have a table
      for (auto& b : d.bodies)
        for (auto& g : b.geoms) g.friction[0] = 0.2 + 0.001 * (k++ * 7 % 500), g.softness.solref = {0.01 + 1e-4 * (k % 97), 1};
    for (int more = 0; more < 100 && trial % 2 == 1; ++more) {
      d.bodies[0].geoms.push_back(gsp_test::geom(ShapeType::sphere, {0.1, 0, 0}));
      d.bodies[0].geoms.back().solmix = 1 + 0.1 * more;
    }
    d.option.override_contacts = trial == 3;
    d.option.o_friction = {0.3, 0.4, 0.01, 0.02, 0.03};
    auto const listed = compile(d), m = compile(d, searched);
    auto model = make_collision_model<double>(exec, m), reference = make_collision_model<double>(exec, listed);
    CHECK((model.sets > 0) == (trial != 1));
    if (trial == 2)
      for (auto* c : {&model, &reference}) make_per_world(exec, *c, {GeomField::friction, GeomField::solref}, 1);
    auto const poses = gsp_test::upload_poses<double>(exec, m, anywhere(m, 1, 0.5), 0, 1);
    auto const ours = contacts_of(exec, model, poses, ContactsOptions{}), theirs = contacts_of(exec, reference, poses, ContactsOptions{});
    using Mem = typename Exec::memory_space;
    auto const parameters = [&](CollisionModel<double, Mem> const& c, Contacts<double, Mem> const& contacts) {
      int const n = int(contacts.demand(exec).contacts);
      Kokkos::View<ContactParameters<double>*, Mem> found("found", n);
      Kokkos::parallel_for(
          "test", Kokkos::RangePolicy<Exec>(exec, 0, n), KOKKOS_LAMBDA(int i) { found(i) = c.parameters_of(0, contacts.pair(i)); });
      auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, found);
      auto const list = download(exec, contacts);
      std::vector<std::pair<std::array<int, 4>, ContactParameters<double>>> result;
      for (int i = 0; i < n; ++i) {
        auto const& h = list[std::size_t(i)];
        result.push_back({{h.geom1, h.geom2, h.feature, int(h.includemargin * 1e4)}, host(i)});
      }
      std::stable_sort(result.begin(), result.end(), [](auto const& x, auto const& y) { return x.first < y.first; });
      return result;
    };
    auto const a = parameters(model, ours), b = parameters(reference, theirs);
    REQUIRE(a.size() == b.size());
    CHECK(a.size() > 100);
    double worst = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      auto const &p = a[i].second, &q = b[i].second;
      CHECK(p.condim == q.condim);
      for (int j = 0; j < 5; ++j) worst = std::max({worst, std::abs(p.friction[j] - q.friction[j]), std::abs(p.solimp[j] - q.solimp[j])});
      for (int j = 0; j < 2; ++j) worst = std::max(worst, std::abs(p.solref[j] - q.solref[j]));
      worst = std::max({worst, std::abs(p.margin - q.margin), std::abs(p.gap - q.gap)});
    }
    CHECK(worst == 0);  // the same formula in the same precision
  }
}

TEST_CASE_TEMPLATE("the same bits for any capacity, batch and number of threads", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 6;
  auto const m = compile(scene(60, 5), searched);
  auto const host_poses = anywhere(m, worlds, 0.5);
  auto const model = make_collision_model<float>(exec, m);
  auto const poses = gsp_test::upload_poses<float>(exec, m, host_poses, 0, worlds);
  auto contacts = contacts_of(exec, model, poses, ContactsOptions{.worlds = worlds});
  auto const whole = download(exec, contacts);
  REQUIRE(whole.size() > 500);

  SUBCASE("again, into the same pools") {
    collide(exec, model, poses, contacts);
    CHECK((download(exec, contacts) == whole));
  }
  SUBCASE("from pools that are too small") {
    auto small = make_contacts(exec, model, {.worlds = worlds, .candidates_per_world = 2, .points_per_world = 4, .contacts_per_world = 2});
    collide(exec, model, poses, small);
    CHECK(small.demand(exec).lost_worlds > 0);
    int rounds = 0;
    for (; grow(exec, small); ++rounds) collide(exec, model, poses, small);
    CHECK(rounds <= 3);
    CHECK((download(exec, small) == whole));
  }
  SUBCASE("room for some: others have no contacts and say so, these have theirs") {
    auto const need = contacts.demand(exec);
    auto some = make_contacts(exec, model,
                              {.worlds = worlds,
                               .candidates_per_world = int(need.candidates / worlds) - 3,
                               .points_per_world = int(need.points / worlds),
                               .contacts_per_world = int(need.contacts / worlds) + 1});
    collide(exec, model, poses, some);
    int const lost = some.demand(exec).lost_worlds;
    CHECK(lost > 0);
    CHECK(lost < worlds);
    auto const status = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, some.status);
    std::vector<HostContact<float>> expected;
    for (auto const& c : whole)
      if ((status(c.world) & status::contact_overflow) == 0) expected.push_back(c);
    CHECK((download(exec, some) == expected));
  }
  SUBCASE("one by one") {
    std::vector<HostContact<float>> joined;
    for (int w = 0; w < worlds; ++w)
      for (auto c : download(exec, contacts_of(exec, model, gsp_test::upload_poses<float>(exec, m, host_poses, w, 1), ContactsOptions{})))
        c.world = w, joined.push_back(c);
    CHECK((joined == whole));
  }
#if defined(KOKKOS_ENABLE_OPENMP)
  if constexpr (std::is_same_v<Exec, Kokkos::OpenMP>)
    for (int threads : {1, 2, 16}) {
      Kokkos::OpenMP const some(threads);
      CHECK((download(some, contacts_of(some, model, poses, ContactsOptions{.worlds = worlds})) == whole));
    }
#endif
}

TEST_CASE_TEMPLATE("the search allocates nothing, does not fence and stays on the given instance", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  auto const m = compile(scene(30), searched);
  auto const model = make_collision_model<float>(exec, m);
  auto const poses = gsp_test::upload_poses<float>(exec, m, anywhere(m, 3, 0.5), 0, 3);
  auto contacts = contacts_of(exec, model, poses, ContactsOptions{.worlds = 3});
  auto const seen = gsp_test::watch([&] { collide(exec, model, poses, contacts); });
  gsp_test::check_algorithm(exec, seen);
}

// What no tree moves is placed again where its body has another pose, or where worlds have their own shapes.
TEST_CASE_TEMPLATE("what stands still and is moved nevertheless is where it is", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 3;
  auto const d = scene(40, 9);
  auto const m = compile(d, searched);
  auto model = make_collision_model<float>(exec, m);
  auto contacts = make_contacts(exec, model, {.worlds = worlds});
  auto host_poses = anywhere(m, worlds, 0.5);
  auto const compare = [&] {
    auto const poses = gsp_test::upload_poses<float>(exec, m, host_poses, 0, worlds);
    do collide(exec, model, poses, contacts);
    while (grow(exec, contacts));
    auto const found = download(exec, contacts);
    CHECK(found.size() > 100);
    CHECK((found == download(exec, contacts_of(exec, model, poses, ContactsOptions{.worlds = worlds}))));
    return found;
  };
  auto const before = compare();
  for (int b = 1; b < m.nbody; ++b)
    if (m.body_tree[b] < 0) host_poses[7 * std::size_t(m.nbody + b)] += 0.3;  // in the second world
  auto const after = compare();
  auto const of = [](auto const& list, int w) {
    std::vector<HostContact<float>> result;
    std::copy_if(list.begin(), list.end(), std::back_inserter(result), [w](auto const& c) { return c.world == w; });
    return result;
  };
  CHECK((of(after, 0) == of(before, 0)));
  CHECK((of(after, 1) != of(before, 1)));
  make_per_world(exec, model, {GeomField::pos}, worlds);
  CHECK((compare() == after));
  Kokkos::View<float***, Kokkos::LayoutRight, Kokkos::HostSpace> pos("pos", worlds, m.ngeom, 3);
  for (int w = 0; w < worlds; ++w)
    for (int g = 0; g < m.ngeom; ++g)
      for (int i = 0; i < 3; ++i) pos(w, g, i) = float(m.geom_pos[g][i]) + (w == 2 ? 0.2f : 0.f);
  auto const values = Kokkos::create_mirror_view_and_copy(typename Exec::memory_space{}, pos);
  set_world_values(exec, model, GeomField::pos, values);
  auto const shifted = compare();
  CHECK((of(shifted, 1) == of(after, 1)));
  CHECK((of(shifted, 2) != of(after, 2)));
}

TEST_CASE_TEMPLATE("a world of NaN makes no contacts and does not touch the others", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const m = compile(scene(40, 9), searched);
  auto const model = make_collision_model<float>(exec, m);
  auto contacts = make_contacts(exec, model, {.worlds = 2});
  auto host_poses = anywhere(m, 2, 0.5);
  auto const run = [&] {
    auto const poses = gsp_test::upload_poses<float>(exec, m, host_poses, 0, 2);
    do collide(exec, model, poses, contacts);
    while (grow(exec, contacts));
    return download(exec, contacts);
  };
  auto const before = run();
  auto broken = host_poses;
  for (int i = 0; i < 7 * m.nbody; ++i) broken[i] = std::nan("");
  std::swap(host_poses, broken);
  auto const after = run();
  std::swap(host_poses, broken);
  CHECK(after.size() > 100);
  CHECK(after.size() < before.size());
  CHECK(std::all_of(after.begin(), after.end(), [](auto const& c) { return c.world == 1; }));
  CHECK((run() == before));  // and it is whole again
}

namespace {
/// Boxes of 0.2 m in a lattice of 0.199 m over a floor.
CompiledModel lattice(int side, CompileOptions options = {}) {
  Description d;
  d.bodies[0].geoms.push_back(gsp_test::geom(ShapeType::plane, {0, 0, 1}));
  for (int k = 0; k < side * side * side; ++k) {
    BodyDescription b;
    b.parent = 0, b.pos = {0.199 * (k % side), 0.199 * (k / side % side), 0.0995 + 0.199 * (k / side / side)};
    b.joints.push_back({.type = JointType::free});
    b.geoms.push_back(gsp_test::geom(ShapeType::box, {0.1, 0.1, 0.1}));
    d.bodies.push_back(b);
  }
  return compile(d, options);
}
}  // namespace

// A lattice of s^3 boxes that overlap their neighbours: along an axis s have one and s - 1 two of them, so there are ((3 s - 2)^3 - s^3) /
// 2 pairs, and s^2 boxes touch the floor.
TEST_CASE("a heap of 4,913 boxes lists the floor's pairs alone, and as many are near as touch") {
  Kokkos::DefaultHostExecutionSpace const exec;
  for (int side : {12, 17}) {
    auto const m = lattice(side);
    int const n = side * side * side, line = 3 * side - 2;
    CHECK(m.pairs_searched);  // more than a million pairs
    CHECK(int(m.pairs.size()) == n);
    auto const model = make_collision_model<float>(exec, m);
    CHECK(model.ints.extent(0) + model.reals.extent(0) < std::size_t(40) * n);
    auto const poses = make_poses<float>(exec, 1, m.nbody, m.njnt);
    for (int b = 0; b < m.nbody; ++b) {
      for (int i = 0; i < 3; ++i) poses.xpos(0, b, i) = float(m.body_pos[b][i]);
      poses.xquat(0, b, 0) = 1;
    }
    auto const demand = contacts_of(exec, model, poses, ContactsOptions{}).demand(exec);
    CHECK(demand.candidates == (line * line * line - n) / 2 + side * side);
  }
}

TEST_CASE("steps are those of the list, to the bit, where contacts come in the same order") {
  Kokkos::DefaultHostExecutionSpace const exec;  // whose kernels are compiled
  auto const run = [&](CompileOptions options) {
    auto const m = lattice(3, options);  // one plane and boxes: plane's contacts first, then by box
    auto const model = make_model<float>(exec, m);
    auto state = make_state(exec, model, {.worlds = 2});
    auto sim = make_simulation<float>(exec, model, m, {.worlds = 2});
    step(exec, model, state, sim, {.steps = 60});
    return std::vector<float>(state.qpos.data(), state.qpos.data() + 2 * m.nq);
  };
  CHECK(run({}) == run(searched));
}

TEST_CASE("more geoms than pairs can be numbered are refused") {
  Description d;
  for (int k = 0; k < 12000; ++k) {  // 1.44e8 > 2^27
    BodyDescription b;
    b.parent = 0;
    b.joints.push_back({.type = JointType::free});
    b.geoms.push_back(gsp_test::geom(ShapeType::sphere, {0.1, 0, 0}));
    d.bodies.push_back(b);
  }
  auto const m = compile(d);
  CHECK_THROWS_WITH_AS(make_collision_model<float>(Kokkos::DefaultHostExecutionSpace{}, m), doctest::Contains("12000 geoms that move"),
                       Error);
}

// Models of the same counts, one after the other: the second is likely to lie where the first has lain. Its geoms have other sizes.
TEST_CASE_TEMPLATE("what stands still is placed again for another model", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto d = scene(30);
  auto const first = compile(d, searched);
  for (auto& g : d.bodies[0].geoms)
    for (double& size : g.size) size *= g.type == ShapeType::plane || g.type == ShapeType::hfield ? 1 : 1.5;
  auto const second = compile(d, searched);
  auto const poses = gsp_test::upload_poses<double>(exec, first, anywhere(first, 1, 0.4), 0, 1);
  std::vector<HostContact<double>> expected[2];
  for (int k : {0, 1})
    expected[k] = download(exec, contacts_of(exec, make_collision_model<double>(exec, k ? second : first), poses, ContactsOptions{}));
  REQUIRE(expected[0] != expected[1]);
  auto model = make_collision_model<double>(exec, first);
  auto contacts = contacts_of(exec, model, poses, ContactsOptions{});
  for (int k = 1; k < 20; ++k) {
    model = {};
    model = make_collision_model<double>(exec, k % 2 ? second : first);
    do collide(exec, model, poses, contacts);
    while (grow(exec, contacts));
    CHECK((download(exec, contacts) == expected[k % 2]));
  }
}
