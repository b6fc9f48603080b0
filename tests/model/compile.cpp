#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <gsp/model/compile.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/detail/principal_axes.hpp>

using namespace gsp;

namespace {
BodyDescription body(std::string name, int parent, Double3 pos) {
  BodyDescription b;
  b.name = std::move(name), b.parent = parent, b.pos = pos;
  return b;
}
GeomDescription sphere(double r) {
  GeomDescription g;
  g.size = {r, 0, 0};
  return g;
}
// Two rods of 2 kg and 1 kg that hang on hinges, as boxes of length 1 whose tops are at the hinges.
Description double_pendulum() {
  Description d;
  for (int k = 0; k < 2; ++k) {
    auto b = body(k ? "lower" : "upper", k, {0, 0, k ? -1. : 0.});
    JointDescription j;
    j.name = k ? "elbow" : "shoulder", j.axis = {0, 3, 0};
    GeomDescription g;
    g.type = ShapeType::box, g.size = {0.05, 0.05, 0.5}, g.pos = {0, 0, -0.5}, g.has_mass = true, g.mass = k ? 1 : 2;
    b.joints.push_back(j), b.geoms.push_back(g);
    d.bodies.push_back(b);
  }
  return d;
}
void check_message(Description const& d, char const* part) {
  try {
    compile(d);
    CHECK_MESSAGE(false, "accepted, expected: ", part);
  } catch (Error const& e) { CHECK_MESSAGE(std::string(e.what()).find(part) != std::string::npos, e.what()); }
}
}  // namespace

TEST_CASE("inverse weights of a double pendulum follow from its mass matrix") {
  auto const m = compile(double_pendulum());
  CHECK(m.nq == 2);
  CHECK(m.nv == 2);
  CHECK(m.ntree == 1);
  CHECK(m.dof_parent == std::vector<int>{-1, 0});
  CHECK(m.jnt_axis[0] == Double3{0, 1, 0});
  // moments about the com: m (1 + 0.01) / 12; M = [[a, c], [c, b]] by hand, both rods hanging down
  double const i1 = 2 * 1.01 / 12, i2 = 1.01 / 12;
  double const a = i1 + 2 * 0.25 + i2 + 1 * 2.25, b = i2 + 0.25, c = i2 + 0.5 * 1.5, det = a * b - c * c;
  CHECK(m.dof_invweight0[0] == doctest::Approx(b / det).epsilon(1e-14));
  CHECK(m.dof_invweight0[1] == doctest::Approx(a / det).epsilon(1e-14));
  // the lower com moves by 1.5 and 0.5 along x, so translation is J M^-1 J^T / 3
  CHECK(m.body_invweight0[2][0] == doctest::Approx((1.5 * 1.5 * b - 2 * 1.5 * 0.5 * c + 0.25 * a) / det / 3).epsilon(1e-13));
  CHECK(m.body_invweight0[2][1] == doctest::Approx((b - 2 * c + a) / det / 3).epsilon(1e-13));
  CHECK(m.pairs.empty());  // parent and child
}

TEST_CASE("a tensor is rebuilt from its principal axes") {
  // two spheres off the axes: the tensor about the com by hand against R diag R^T of the result
  Description d;
  auto b = body("b", 0, {0, 0, 0});
  b.joints.emplace_back();
  for (int k = 0; k < 3; ++k) {
    auto g = sphere(0.1 + 0.05 * k);
    g.pos = {0.3 * k, 0.1 * k * k, -0.2 + 0.1 * k};
    b.geoms.push_back(g);
  }
  d.bodies.push_back(b);
  auto const m = compile(d);
  double mass = 0, com[3] = {}, want[6] = {};
  auto const kg = [&](int k) { return 1000 * 4. / 3 * M_PI * std::pow(0.1 + 0.05 * k, 3); };
  for (int k = 0; k < 3; ++k) {
    mass += kg(k);
    for (int i = 0; i < 3; ++i) com[i] += kg(k) * b.geoms[k].pos[i];
  }
  for (double& x : com) x /= mass;
  for (int k = 0; k < 3; ++k) {
    double const x = b.geoms[k].pos[0] - com[0], y = b.geoms[k].pos[1] - com[1], z = b.geoms[k].pos[2] - com[2],
                 own = 0.4 * kg(k) * std::pow(0.1 + 0.05 * k, 2);
    double const part[6] = {own + kg(k) * (y * y + z * z),
                            own + kg(k) * (x * x + z * z),
                            own + kg(k) * (x * x + y * y),
                            -kg(k) * x * y,
                            -kg(k) * x * z,
                            -kg(k) * y * z};
    for (int i = 0; i < 6; ++i) want[i] += part[i];
  }
  CHECK(m.body_mass[1] == doctest::Approx(mass).epsilon(1e-14));
  auto const got = gsp::detail::rotated_diagonal(m.body_iquat[1], m.body_inertia[1]);
  for (int i = 0; i < 6; ++i) CHECK(got[i] == doctest::Approx(want[i]).epsilon(1e-13).scale(want[0]));
  CHECK(m.body_inertia[1][0] >= m.body_inertia[1][1]);
  CHECK(m.body_inertia[1][1] >= m.body_inertia[1][2]);
}

TEST_CASE("trees are contiguous, static bodies belong to none") {
  Description d;
  auto table = body("table", 0, {0, 0, 1}), ball = body("ball", 0, {0, 0, 2}), arm = body("arm", 1, {0, 0, 0}),
       hand = body("hand", 2, {0, 0, 1});
  JointDescription free, hinge;
  free.type = JointType::free;
  ball.joints = {free}, arm.joints = {hinge};
  for (auto* b : {&table, &ball, &arm, &hand}) b->geoms = {sphere(0.1)};
  d.bodies = {BodyDescription::world(), table, arm, hand, ball};
  auto const m = compile(d);
  CHECK(m.ntree == 2);
  CHECK(m.body_tree == std::vector<int>{-1, -1, 0, 0, 1});
  CHECK(m.body_weld == std::vector<int>{0, 0, 2, 2, 4});
  CHECK(m.tree_bodynum == std::vector<int>{2, 1});
  CHECK(m.tree_dofadr == std::vector<int>{0, 1});
  CHECK(m.tree_qposadr == std::vector<int>{0, 1});
  CHECK(m.tree_qposnum == std::vector<int>{1, 7});
  CHECK(m.qpos0[3] == 2);  // the free ball starts where its body stands
  // the arm hangs on a static table, which is the world's weld group: they may touch; the ball meets all
  CHECK(m.pairs == std::vector<std::array<int, 2>>{{0, 1}, {0, 2}, {0, 3}, {1, 3}, {2, 3}});
}

TEST_CASE("pairs: bits, excludes, any shapes and condim") {
  Description d;
  JointDescription free;
  free.type = JointType::free;
  for (int k = 0; k < 3; ++k) {
    auto b = body("b" + std::to_string(k), 0, {double(k), 0, 0});
    auto g = sphere(0.1);
    if (k == 1) g.type = ShapeType::cylinder, g.size = {0.1, 0.1, 0};
    b.joints = {free}, b.geoms = {g};
    d.bodies.push_back(b);
  }
  CHECK(compile(d).pairs == std::vector<std::array<int, 2>>{{0, 1}, {0, 2}, {2, 1}});
  d.excludes.push_back({"b2", "b0", {}});
  CHECK(compile(d).pairs == std::vector<std::array<int, 2>>{{0, 1}, {2, 1}});
  d.bodies[3].geoms[0].contype = 0, d.bodies[3].geoms[0].conaffinity = 2;
  CHECK(compile(d).pairs == std::vector<std::array<int, 2>>{{0, 1}});
  d.bodies[1].geoms[0].condim = 6;
  CHECK(compile(d).geom_condim[0] == 6);
  d.bodies[1].geoms[0].condim = 3, d.bodies[1].geoms[0].type = ShapeType::cylinder, d.bodies[1].geoms[0].size = {1, 1, 0};
  CHECK(compile(d).pairs == std::vector<std::array<int, 2>>{{0, 1}});  // two cylinders: no pair of shapes is refused
  CHECK(compile(d).report.empty());
}

// The list by groups is the list of all pairs, in the same order: each two geoms asked one by one.
TEST_CASE("pairs: which geoms can meet, among many filters, bodies that stand, and bodies that are welded together") {
  std::uint64_t state = 12345;
  auto const draw = [&](int n) { return int((state = state * 6364136223846793005u + 1442695040888963407u) >> 33) % n; };
  for (int trial = 0; trial < 20; ++trial) {
    Description d;
    d.option.filterparent = trial % 2 == 0;
    for (int k = 1; k < 40; ++k) {
      int parent = k - 1;  // depth first: below the body before it, or below one above that
      while (parent > 0 && draw(2)) parent = d.bodies[std::size_t(parent)].parent;
      auto b = body("b" + std::to_string(k), parent, {0, 0, 1});
      if (draw(3) == 0) b.joints.emplace_back().type = parent == 0 && draw(2) ? JointType::free : JointType::hinge;
      for (int g = draw(4); g > 0; --g) {
        b.geoms.push_back(sphere(0.1));
        b.geoms.back().contype = draw(4), b.geoms.back().conaffinity = draw(4);
      }
      d.bodies.push_back(b);
    }
    for (auto& b : d.bodies)
      if (!b.joints.empty() && b.geoms.empty()) b.geoms.push_back(sphere(0.1));
    d.excludes.push_back({"b3", "b17", {}});
    auto const m = compile(d);
    std::vector<std::array<int, 2>> expected;
    for (int a = 0; a < m.ngeom; ++a)
      for (int b = a + 1; b < m.ngeom; ++b) {
        int const wa = m.body_weld[m.geom_body[a]], wb = m.body_weld[m.geom_body[b]];
        bool const masks = (m.geom_contype[a] & m.geom_conaffinity[b]) || (m.geom_contype[b] & m.geom_conaffinity[a]);
        bool const family =
            d.option.filterparent && wa && wb && (wa == m.body_weld[m.body_parent[wb]] || wb == m.body_weld[m.body_parent[wa]]);
        bool const excluded = std::minmax(m.geom_body[a], m.geom_body[b]) == std::minmax(3, 17);
        bool const moves = m.body_dofnum[wa] > 0 || m.body_dofnum[wb] > 0;
        if (wa != wb && moves && masks && !family && !excluded) expected.push_back({a, b});
      }
    CHECK(m.pairs.size() > 20);
    CHECK(m.pairs == expected);
  }
}

TEST_CASE("named pairs: whatever filters say, never an ordinary pair besides, judged as those are") {
  Description d;
  JointDescription free;
  free.type = JointType::free;
  auto still = sphere(0.1), plane = sphere(0);
  still.name = "still", plane.name = "plane", plane.type = ShapeType::plane;
  d.bodies[0].geoms = {still, plane};
  for (int k = 0; k < 2; ++k) {
    auto b = body("b" + std::to_string(k), 0, {double(k), 0, 0});
    auto g = sphere(0.1);
    g.name = "g" + std::to_string(k);
    b.joints = {free}, b.geoms = {g};
    d.bodies.push_back(b);
  }
  auto const ordinary = compile(d);
  CHECK(ordinary.pairs == std::vector<std::array<int, 2>>{{0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}});
  d.files = {"a.xml"};
  auto const pair = [](std::string a, std::string b) {
    PairDescription p;
    p.geom1 = a, p.geom2 = b, p.place = {0, 5};
    return p;
  };
  d.pairs = {pair("g1", "plane"), pair("still", "plane"), pair("g0", "g1"), pair("g1", "g0")};
  d.excludes.push_back({"b0", "b1", {}});
  auto const m = compile(d);
  CHECK(m.pairs == std::vector<std::array<int, 2>>{{0, 2}, {0, 3}, {1, 2}});
  REQUIRE(m.named_pairs.size() == 4);
  CHECK(m.pair_count() == 7);
  CHECK(m.pair_geoms(2) == std::array{1, 2});
  CHECK(m.pair_geoms(3) == std::array{1, 3});  // type of first <= type of second
  CHECK(m.pair_geoms(4) == std::array{1, 0});
  CHECK(m.named_pairs[1].geom1 == 0);  // as MuJoCo has them: of one body as written
  CHECK(m.report.empty());

  d.pairs[0].condim = 4;
  CHECK(compile(d).named_pairs[0].condim == 4);
  d.pairs[0].condim.reset();
  auto& g = d.bodies[2].geoms[0];
  g.type = ShapeType::ellipsoid, g.size = {0.1, 0.1, 0.2}, g.contype = g.conaffinity = 0;
  CHECK(compile(d).named_pairs.size() == 4);
  CHECK(compile(d).report.empty());
}

TEST_CASE("what cannot be compiled is said in one sentence") {
  auto d = double_pendulum();
  d.bodies[2].geoms.clear();
  check_message(d, "body 'lower' moves but has no mass");
  d.compiler.boundmass = 1, d.compiler.boundinertia = 0.1;
  CHECK(compile(d).body_mass[2] == 1);
  d = double_pendulum(), d.bodies[2].name = "upper";
  check_message(d, "name that is taken");
  d = double_pendulum(), d.bodies[1].joints[0].axis = {0, 0, 0};
  check_message(d, "axis of length zero");
  d = double_pendulum(), d.bodies[2].parent = 5;
  check_message(d, "depth first");
  d = double_pendulum(), d.bodies[1].joints.push_back(d.bodies[1].joints[0]), d.bodies[1].joints[1].name = "twin";
  auto const twice = compile(d);  // as MuJoCo: the second of the two equal joints resists nothing, and the report says so
  REQUIRE(twice.report.size() == 1);
  CHECK(twice.report[0].kind == ReportLine::Kind::approximated);
  CHECK(twice.report[0].text.find("singular") != std::string::npos);
  d = double_pendulum(), d.bodies[1].geoms[0].size[1] = 0;
  check_message(d, "size[1] <= 0");
  d = double_pendulum(), d.keyframes.push_back({"k", 0, {1, 2, 3}, {}, {}, {}});
  check_message(d, "has 3 numbers in qpos, and the model needs 2");
  d = double_pendulum(), d.bodies[2].has_inertial = true, d.bodies[2].inertial.mass = 1, d.bodies[2].inertial.inertia = {1, 1, 3, 0, 0, 0};
  check_message(d, "exceeds the sum");
  d.compiler.balanceinertia = true;
  CHECK(compile(d).body_inertia[2][2] == doctest::Approx(5. / 3));
  d = double_pendulum(), d.bodies[1].cameras.emplace_back().resolution = {64, 0};
  check_message(d, "no positive resolution");
  d = double_pendulum(), d.bodies[1].cameras.emplace_back().sensor_size = {0.1, 0};
  check_message(d, "a sensor without area");
  d = double_pendulum(), d.files = {"a.xml"}, d.bodies[1].joints[0].place = {0, 7}, d.bodies[1].joints[0].limited = true;
  check_message(d, "a.xml:7: joint 'shoulder' is limited");
}

TEST_CASE("a sensor of a type that MJCF does not have is refused") {
  auto d = double_pendulum();
  d.sensors.push_back({.name = "s", .type = "jointpose", .object_type = "joint", .object = "elbow"});
  check_message(d, "has the type 'jointpose', which is not one of MJCF's");
}
