// The contact pipeline against brute force over all pairs, and what it promises: order, independence of capacities and of the other worlds,
// equal bits.
#include <doctest/doctest.h>

#include <gsp/collision/geom_values.hpp>
#include <gsp_test_execs.hpp>
#include <map>
#include <support/kokkos_tools.hpp>

#include "scenes.hpp"
#include "support/kernels.hpp"

using namespace gsp;
using gsp_test::download;
using gsp_test::HostContact;

namespace {

/// Every pair of every world through the narrow phase, no culling, on the host.
template <class R>
std::vector<HostContact<R>> brute_force(CompiledModel const& m, Kokkos::View<int*, Kokkos::HostSpace> const& order,
                                        std::vector<double> const& poses, int worlds) {
  std::vector<HostContact<R>> result;
  for (int w = 0; w < worlds; ++w)
    for (int k = 0; k < int(order.extent(0)); ++k) {
      auto const [g1, g2] = m.pair_geoms(order(k));
      auto const shape = [&](int g) {
        double const* p = &poses[(std::size_t(w) * m.nbody + m.geom_body[g]) * 7];
        auto const &x = m.geom_pos[g], &s = m.geom_size[g];
        auto const& q = m.geom_quat[g];
        Transform<R> const body{{R(p[0]), R(p[1]), R(p[2])}, {R(p[3]), R(p[4]), R(p[5]), R(p[6])}};
        Transform<R> const local{{R(x[0]), R(x[1]), R(x[2])}, {R(q[0]), R(q[1]), R(q[2]), R(q[3])}};
        return make_shape(body * local, Vec3<R>{R(s[0]), R(s[1]), R(s[2])});
      };
      ContactPoints<R, 8> out;
      int const named = order(k) - int(m.pairs.size());  // index among the named pairs
      double const margin = named < 0 ? m.geom_margin[g1] + m.geom_margin[g2] : m.named_pairs[named].margin;
      double const gap = named < 0 ? m.geom_gap[g1] + m.geom_gap[g2] : m.named_pairs[named].gap;
      narrowphase(pair_kind(ShapeType(m.geom_type[g1]), ShapeType(m.geom_type[g2])), shape(g1), shape(g2), R(margin) + R(gap), out);
      for (int i = 0; i < out.count; ++i) {
        auto const& p = out.point[i];
        HostContact<R> h{w,
                         k,
                         g1,
                         g2,
                         m.geom_body[g1],
                         m.geom_body[g2],
                         p.feature,
                         {p.pos.x, p.pos.y, p.pos.z},
                         {p.normal.x, p.normal.y, p.normal.z},
                         p.dist,
                         R(margin)};
        result.push_back(h);
      }
    }
  return result;
}

/// Names some pairs that filters leave out: the floor and the wall, geoms of one body, and one pair twice.
void name_pairs(CompiledModel& m) {
  auto const name = [&](int a, int b, double margin, double gap) {
    // not those of the convex routine: its normals hang on rounding, and with them the points
    auto const kind = pair_kind(ShapeType(std::min(m.geom_type[a], m.geom_type[b])), ShapeType(std::max(m.geom_type[a], m.geom_type[b])));
    if (kind != PairKind::none && !is_among(detail::convex_kinds, kind))
      m.named_pairs.push_back({a, b, 3, {0.5, 0.6, 0.01, 0.02, 0.03}, {0.8, 0.9, 0.002, 0.5, 2}, {0.03, 0.9}, {0.1, 0.5}, margin, gap});
  };
  name(0, 1, 0, 0), name(0, 1, 0.1, 0);
  for (int b = 1; b < m.nbody; ++b)
    if (m.body_geomnum[b] == 2) name(m.body_geomadr[b], m.body_geomadr[b] + 1, 0.02 * (b % 3), 0.01);
}

template <class R>
void check_equal(std::vector<HostContact<R>> const& a, std::vector<HostContact<R>> const& b, R tolerance) {
  REQUIRE(a.size() == b.size());
  R worst = 0;
  bool names = true;
  for (std::size_t i = 0; i < a.size(); ++i) {
    names = names && a[i].world == b[i].world && a[i].pair == b[i].pair && a[i].geom1 == b[i].geom1 && a[i].geom2 == b[i].geom2 &&
            a[i].body1 == b[i].body1 && a[i].body2 == b[i].body2 && a[i].feature == b[i].feature &&
            a[i].includemargin == b[i].includemargin;
    worst = std::max(worst, std::abs(a[i].dist - b[i].dist));
    for (int k = 0; k < 3; ++k) worst = std::max({worst, std::abs(a[i].pos[k] - b[i].pos[k]), std::abs(a[i].frame[k] - b[i].frame[k])});
  }
  CHECK(names);
  CHECK(worst <= tolerance);
}

template <class Mem>
struct ParametersOf {
  CollisionModel<float, Mem> model;
  Kokkos::View<ContactParameters<float>*, Mem> found;
  KOKKOS_FUNCTION void operator()(int k) const { found(k) = model.parameters_of(1, k); }
};

/// Parameters of all pairs in the second of two worlds, whose geoms have a friction of 0.25 of their own.
template <class Exec, class Mem>
auto parameters_per_world(Exec const& exec, CompiledModel const& m, CollisionModel<float, Mem>& model) {
  make_per_world(exec, model, {GeomField::friction}, 2);
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> friction("friction", 2, m.ngeom, 3);
  Kokkos::deep_copy(friction, 0.25f);
  set_world_values(exec, model, GeomField::friction, friction);
  Kokkos::View<ContactParameters<float>*, Mem> found("found", model.pairs);
  Kokkos::parallel_for("test", Kokkos::RangePolicy<Exec>(exec, 0, model.pairs), ParametersOf<Mem>{model, found});
  return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, found);
}

template <class Exec, class R>
void against_brute_force() {
  Exec const exec;
  int const worlds = 7;
  for (int n : {1, 6, 40}) {
    auto m = gsp_test::heap(n);
    name_pairs(m);
    auto const host_poses = gsp_test::random_poses(m, worlds, 0.6);
    auto const model = make_collision_model<R>(exec, m);
    auto const poses = gsp_test::upload_poses<R>(exec, m, host_poses, 0, worlds);
    auto contacts = make_contacts(exec, model, {.worlds = worlds});
    do collide(exec, model, poses, contacts);
    while (grow(exec, contacts));
    auto const found = download(exec, contacts);
    auto const expected = brute_force<R>(m, model.pair_source, host_poses, worlds);
    // Equal up to rounding of the same formulas (fused or not): a few dozen operations on lengths about 1.
    check_equal(found, expected, R(256) * std::numeric_limits<R>::epsilon());
    if (n == 40) {
      MESSAGE(doctest::String(Exec::name()), ": ", expected.size(), " contacts of ", m.pair_count(), " pairs in ", worlds, " worlds");
      CHECK(expected.size() > 300);
    }
    // frames are right-handed and orthonormal
    R worst = 0;
    for (auto const& c : found) {
      auto const row = [&](int i) { return Vec3<R>{c.frame[3 * i], c.frame[3 * i + 1], c.frame[3 * i + 2]}; };
      auto const z = cross(row(0), row(1)) - row(2);
      worst = std::max({worst, norm(z), std::abs(norm(row(0)) - 1), std::abs(norm(row(1)) - 1), std::abs(dot(row(0), row(1)))});
    }
    CHECK(worst < R(64) * std::numeric_limits<R>::epsilon());
  }
}

}  // namespace

TEST_CASE_TEMPLATE("contacts equal those of all pairs, in the order (world, pair, point)", Exec, GSP_TEST_EXECS) {
  SUBCASE("double") { against_brute_force<Exec, double>(); }
  SUBCASE("float") { against_brute_force<Exec, float>(); }
}

TEST_CASE_TEMPLATE("a world's contacts do not depend on capacities, on other worlds, or on the split of the batch", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 9;
  auto const m = gsp_test::heap(30);
  auto const host_poses = gsp_test::random_poses(m, worlds, 0.5);
  auto const model = make_collision_model<float>(exec, m);
  auto const poses = gsp_test::upload_poses<float>(exec, m, host_poses, 0, worlds);
  auto contacts =
      make_contacts(exec, model, {.worlds = worlds, .candidates_per_world = 1000, .points_per_world = 8000, .contacts_per_world = 1000});
  collide(exec, model, poses, contacts);
  auto const whole = download(exec, contacts);
  auto const demand = contacts.demand(exec);
  CHECK(demand.lost_worlds == 0);
  CHECK(demand.contacts == std::int64_t(whole.size()));
  REQUIRE(whole.size() > 100);

  SUBCASE("a pool that is too small marks worlds, and growing gives the same bits") {
    auto small = make_contacts(exec, model, {.worlds = worlds, .candidates_per_world = 2, .points_per_world = 4, .contacts_per_world = 2});
    collide(exec, model, poses, small);
    CHECK(small.demand(exec).lost_worlds > 0);
    CHECK(status::text(status::contact_overflow).find("grow") != std::string::npos);
    std::string const both = status::text(status::contact_overflow | status::not_finite);
    CHECK(both.find("impulses); the new velocity") != std::string::npos);
    CHECK(both.find("ctrl and qfrc_applied") != std::string::npos);
    CHECK(both.ends_with("then reset the world or clear the bit (state.status(w))"));
    int rounds = 0;
    for (; grow(exec, small); ++rounds) collide(exec, model, poses, small);
    CHECK(rounds >= 1);
    CHECK(rounds <= 3);
    CHECK((download(exec, small) == whole));
  }
  SUBCASE("only the pool of contacts is too small: the worlds before the end are right") {
    auto small = make_contacts(
        exec, model,
        {.worlds = worlds, .candidates_per_world = 1000, .points_per_world = 8000, .contacts_per_world = int(whole.size()) / worlds - 1});
    collide(exec, model, poses, small);
    CHECK(small.demand(exec).lost_worlds >= 1);
    CHECK(small.demand(exec).contacts == demand.contacts);
    auto const some = download(exec, small);
    CHECK(some.size() > 0);
    CHECK(std::equal(some.begin(), some.end(), whole.begin()));
    CHECK(grow(exec, small));
    collide(exec, model, poses, small);
    CHECK((download(exec, small) == whole));
    CHECK(!grow(exec, small));
  }
  SUBCASE("batches of 1, 2 and 4 worlds") {
    for (int size : {1, 2, 4}) {
      std::vector<HostContact<float>> joined;
      for (int first = 0; first < worlds; first += size) {
        int const n = std::min(size, worlds - first);
        auto part = make_contacts(exec, model, {.worlds = n});
        auto const part_poses = gsp_test::upload_poses<float>(exec, m, host_poses, first, n);
        do collide(exec, model, part_poses, part);
        while (grow(exec, part));
        for (auto c : download(exec, part)) c.world += first, joined.push_back(c);
      }
      CHECK((joined == whole));
    }
  }
  SUBCASE("again, into the same pools") {
    collide(exec, model, poses, contacts);
    CHECK((download(exec, contacts) == whole));
  }
#if defined(KOKKOS_ENABLE_SERIAL)
  if constexpr (!is_device<Exec>) {
    Kokkos::Serial const serial;
    auto const serial_model = make_collision_model<float>(serial, m);
    auto const serial_poses = gsp_test::upload_poses<float>(serial, m, host_poses, 0, worlds);
    auto other = make_contacts(serial, serial_model, {.worlds = worlds});
    do collide(serial, serial_model, serial_poses, other);
    while (grow(serial, other));
    CHECK((download(serial, other) == whole));
  }
#endif
}

TEST_CASE_TEMPLATE("collide works on the given instance, allocates nothing and does not fence", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  auto const m = gsp_test::heap(12);
  auto const model = make_collision_model<float>(exec, m);
  auto const poses = gsp_test::upload_poses<float>(exec, m, gsp_test::random_poses(m, 3, 0.5), 0, 3);
  auto contacts =
      make_contacts(exec, model, {.worlds = 3, .candidates_per_world = 200, .points_per_world = 800, .contacts_per_world = 300});
  collide(exec, model, poses, contacts);  // Kokkos' own scratch grows once
  auto const seen = gsp_test::watch([&] { collide(exec, model, poses, contacts); });
  gsp_test::check_algorithm(exec, seen);
  CHECK(seen.kernels.size() == (gsp::is_device<Exec> ? 6 : 5));  // a device copies contacts in a kernel of its own
}

TEST_CASE_TEMPLATE("with four points a box pair the deepest stays, and every other pair keeps its points", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const m = gsp_test::heap(30);
  auto const model = make_collision_model<double>(exec, m);
  auto const poses = gsp_test::upload_poses<double>(exec, m, gsp_test::random_poses(m, 4, 0.4), 0, 4);
  auto all = make_contacts(exec, model, {.worlds = 4}), four = make_contacts(exec, model, {.worlds = 4, .points_per_box_pair = 4});
  do collide(exec, model, poses, all);
  while (grow(exec, all));
  do collide(exec, model, poses, four);
  while (grow(exec, four));
  using Key = std::array<int, 2>;
  auto const by_pair = [](auto const& list) {
    std::map<Key, std::vector<HostContact<double>>> result;
    for (auto const& c : list) result[{c.world, c.pair}].push_back(c);
    return result;
  };
  auto const a = by_pair(download(exec, all)), b = by_pair(download(exec, four));
  REQUIRE(a.size() == b.size());
  int reduced = 0;
  for (auto const& [key, points] : a) {
    auto const& kept = b.at(key);
    CHECK(kept.size() == std::min<std::size_t>(4, points.size()));
    reduced += points.size() > 4;
    auto const less = [](auto const& p, auto const& q) { return p.dist < q.dist; };
    CHECK(std::min_element(kept.begin(), kept.end(), less)->dist == std::min_element(points.begin(), points.end(), less)->dist);
    for (auto const& k : kept) CHECK(std::find(points.begin(), points.end(), k) != points.end());
  }
  CHECK(reduced >= 3);
}

// A body of two boxes, tilted a little, with one on the floor and one on a step: each step's points rub in a plane of their own.
TEST_CASE_TEMPLATE("points of a patch rub in one plane", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  Description d;
  auto step = gsp_test::geom(ShapeType::box, {0.5, 0.5, 0.1}), foot = gsp_test::geom(ShapeType::box, {0.2, 0.2, 0.1});
  step.pos = {0.7, 0, 0.1};
  d.bodies[0].geoms = {gsp_test::geom(ShapeType::plane, {0, 0, 1}), step};
  BodyDescription b;
  b.parent = 0;
  b.joints.emplace_back().type = JointType::free;
  b.geoms = {foot, foot};
  b.geoms[1].pos = {0.7, 0, 0.2};
  d.bodies.push_back(b);
  auto const m = compile(d);
  auto const model = make_collision_model<double>(exec, m);
  constexpr int worlds = 40;
  std::vector<double> at(std::size_t(worlds) * m.nbody * 7, 0);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int w = 0; w < worlds; ++w) {
    double* const p = &at[std::size_t(w) * m.nbody * 7];
    p[3] = p[7 + 3] = 1;
    p[7 + 2] = 0.1 - 2e-3;
    for (int c = 0; c < 3; ++c) p[7 + 4 + c] = 1e-3 * uniform(random);  // half the angle
  }
  auto const poses = gsp_test::upload_poses<double>(exec, m, at, 0, worlds);
  auto contacts = make_contacts(exec, model, {.worlds = worlds, .steady = true});
  do collide(exec, model, poses, contacts);
  while (grow(exec, contacts));
  auto const lift = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, contacts.lift);
  auto const found = download(exec, contacts);
  double moved = 0, deepest = 0;
  int in_plane = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    auto const& c = found[i];
    moved = std::max(moved, std::abs(lift(i)));
    deepest = std::min(deepest, c.dist);
    if (i + 1 == found.size() || found[i + 1].world != c.world || found[i + 1].pair != c.pair) continue;
    auto const& next = found[i + 1];
    double between = 0;  // along the normal, from this point's plane to the next one's
    for (int k = 0; k < 3; ++k) between += c.frame[k] * (next.pos[k] + lift(i + 1) * next.frame[k] - c.pos[k] - lift(i) * c.frame[k]);
    CHECK(std::abs(between) < 1e-15);
    ++in_plane;
  }
  CHECK(in_plane > 4 * worlds);
  CHECK(moved > 1e-4);
  CHECK(moved < -deepest);  // between surfaces; the steps are 0.2 m apart
}

TEST_CASE_TEMPLATE("NaN poses make no contacts and do not touch other worlds", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const m = gsp_test::heap(12);
  auto host_poses = gsp_test::random_poses(m, 2, 0.4);
  auto const model = make_collision_model<float>(exec, m);
  auto contacts = make_contacts(exec, model, {.worlds = 2});
  auto poses = gsp_test::upload_poses<float>(exec, m, host_poses, 0, 2);
  do collide(exec, model, poses, contacts);
  while (grow(exec, contacts));
  auto const before = download(exec, contacts);
  for (int i = 0; i < 7 * m.nbody; ++i) host_poses[i] = std::nan("");
  poses = gsp_test::upload_poses<float>(exec, m, host_poses, 0, 2);
  collide(exec, model, poses, contacts);
  auto const after = download(exec, contacts);
  std::vector<HostContact<float>> second;
  for (auto const& c : before)
    if (c.world == 1) second.push_back(c);
  CHECK(second.size() > 0);
  CHECK((after == second));
}

TEST_CASE("parameters are mixed as MuJoCo mixes them") {
  auto m = gsp_test::heap(2);
  int const a = 2, b = 3;
  m.geom_solmix[a] = 3, m.geom_solmix[b] = 1;
  m.geom_solref[a] = {0.02, 1}, m.geom_solref[b] = {0.04, 0.6};
  m.geom_friction[a] = {0.5, 0.01, 0}, m.geom_friction[b] = {0.7, 0.005, 0.0002};
  m.geom_margin[a] = 0.01, m.geom_margin[b] = 0.02, m.geom_gap[a] = 0.003, m.geom_gap[b] = 0;
  m.geom_condim[a] = 1, m.geom_condim[b] = 3;
  m.geom_adhesion.assign(std::size_t(m.ngeom), 0.);
  m.geom_adhesion[a] = 2, m.geom_adhesion[b] = 5;
  auto p = mix_contact_parameters(m, a, b);
  CHECK(p.condim == 3);
  CHECK(p.adhesion == 7);
  CHECK(p.margin == doctest::Approx(0.03));
  CHECK(p.gap == doctest::Approx(0.003));
  CHECK(p.solref[0] == doctest::Approx(0.75 * 0.02 + 0.25 * 0.04));
  CHECK(p.solref[1] == doctest::Approx(0.9));
  CHECK(p.friction[0] == 0.7);
  CHECK(p.friction[1] == 0.7);
  CHECK(p.friction[2] == 0.01);
  CHECK(p.friction[4] == 0.0002);
  m.geom_solref[b] = m.geom_solref[a];  // what both say stays, to the bit: profile stable knows the default by it
  for (int mix = 1; mix < 11; ++mix) {
    m.geom_solmix[b] = mix;
    CHECK(mix_contact_parameters(m, a, b).solref[0] == 0.02);
  }
  m.geom_solref[b] = {-100, -5};
  p = mix_contact_parameters(m, a, b);
  CHECK(p.solref[0] == -100);
  CHECK(p.solref[1] == -5);
  m.geom_priority[a] = 1;
  p = mix_contact_parameters(m, a, b);
  CHECK(p.condim == 1);
  CHECK(p.friction[0] == 0.5);
  CHECK(p.friction[3] == 1e-5);  // at least mjMINMU
  CHECK(p.adhesion == 2);
  CHECK(p.solref[1] == 1);
}

TEST_CASE_TEMPLATE("a named pair keeps its own numbers, also where those of geoms differ from world to world", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto m = gsp_test::heap(12);
  name_pairs(m);
  m.named_pairs[0].friction = {0, 0, 0, 0, 0};
  auto model = make_collision_model<float>(exec, m);
  CHECK(model.pairs == m.pair_count());
  auto const host = parameters_per_world(exec, m, model);
  for (int k = 0; k < model.pairs; ++k) {
    auto const& p = host(k);
    int const named = model.pair_source(k) - int(m.pairs.size());
    if (named < 0) {
      CHECK(p.friction[0] == 0.25f);
      CHECK(p.solreffriction[0] == 0);
      continue;
    }
    auto const& own = m.named_pairs[named];
    CHECK(p.condim == own.condim);
    CHECK(p.margin == float(own.margin));
    CHECK(p.gap == float(own.gap));
    for (int i = 0; i < 5; ++i) CHECK(p.friction[i] == float(std::max(1e-5, own.friction[i])));  // mjMINMU, as for mixed ones
    for (int i = 0; i < 5; ++i) CHECK(p.solimp[i] == float(own.solimp[i]));
    for (int i = 0; i < 2; ++i) CHECK(p.solref[i] == float(own.solref[i]));
    for (int i = 0; i < 2; ++i) CHECK(p.solreffriction[i] == float(own.solreffriction[i]));
  }
}

TEST_CASE_TEMPLATE("<option o_*> says what all pairs are like, also where geoms differ from world to world", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto m = gsp_test::heap(12);
  name_pairs(m);
  m.option.override_contacts = true;
  m.option.o_margin = 0.02;
  m.option.o_friction = {0.3, 0.4, 0, 0.02, 0.03};
  auto model = make_collision_model<float>(exec, m);
  auto const host = parameters_per_world(exec, m, model);
  for (int k = 0; k < model.pairs; ++k) {
    auto const& p = host(k);
    CHECK(p.margin == 0.02f);
    for (int i = 0; i < 5; ++i) CHECK(p.friction[i] == float(std::max(1e-5, m.option.o_friction[i])));
    for (int i = 0; i < 2; ++i) CHECK(p.solref[i] == float(m.option.o_softness.solref[i]));
    for (int i = 0; i < 2; ++i) CHECK(p.solreffriction[i] == 0);
  }
}

TEST_CASE("bad input is refused") {
  Kokkos::DefaultHostExecutionSpace const exec;
  auto m = gsp_test::heap(4);
  auto const model = make_collision_model<double>(exec, m);
  CHECK_THROWS_AS(make_contacts(exec, model, {.worlds = 0}), std::invalid_argument);
  auto contacts = make_contacts(exec, model, {.worlds = 2});
  CHECK_THROWS_AS(collide(exec, model, make_poses<double>(exec, 3, m.nbody, m.njnt), contacts), std::invalid_argument);
  CHECK_THROWS_AS(collide(exec, model, make_poses<double>(exec, 2, m.nbody + 1, m.njnt), contacts), std::invalid_argument);
  m.pairs.push_back({0, 0});  // two planes
  CHECK_THROWS_AS(make_collision_model<double>(exec, m), Error);
  // a model without pairs
  m.pairs.clear(), m.named_pairs.clear();
  auto const empty = make_collision_model<double>(exec, m);
  auto none = make_contacts(exec, empty, {.worlds = 2});
  collide(exec, empty, make_poses<double>(exec, 2, m.nbody, m.njnt), none);
  CHECK(none.count_of(1) == 0);
  CHECK(none.size() == 0);
}
