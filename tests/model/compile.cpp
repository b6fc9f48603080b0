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
  } catch (Error const& e) { CHECK_MESSAGE(std::string(e.what()).find(part) != std::string::npos, std::string(e.what())); }
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
  check_message(d, "has size[1] <= 0, and a box needs 3 positive sizes: give them");
  d.bodies[1].geoms[0].type = ShapeType::sphere, d.bodies[1].geoms[0].size[0] = 0;
  check_message(d, "has size[0] <= 0, and a sphere needs 1 positive size: give it");
  d = double_pendulum(), d.keyframes.push_back({"k", 0, {1, 2, 3}, {}, {}, {}});
  check_message(d, "has 3 numbers in qpos, and the model needs 2");
  d = double_pendulum(), d.bodies[2].has_inertial = true, d.bodies[2].inertial.mass = 1, d.bodies[2].inertial.inertia = {1, 1, 3, 0, 0, 0};
  check_message(d, "exceeds the sum");
  d.compiler.balanceinertia = true;
  CHECK(compile(d).body_inertia[2][2] == doctest::Approx(5. / 3));
  d = double_pendulum(), d.bodies[1].geoms[0].name = "g", d.bodies[1].geoms[0].friction = {1, 0, -1e-4};
  check_message(d, "geom 'g' has a negative friction: give zero or more");
  d = double_pendulum(), d.bodies[1].geoms[0].name = "g", d.bodies[2].geoms[0].name = "h";
  d.pairs.push_back({.name = "p", .geom1 = "g", .geom2 = "h", .friction = std::array<double, 5>{1, -1, 0, 0, 0}});
  check_message(d, "pair 'p' has a negative friction");
  d = double_pendulum(), d.option.override_contacts = true, d.option.o_friction[0] = -1;
  check_message(d, "option o_friction is negative");
  d = double_pendulum(), d.bodies[2].joints[0].frictionloss = -1;
  check_message(d, "joint 'elbow' has a negative frictionloss");
  d = double_pendulum(), d.tendons.push_back({.name = "t", .terms = {{"elbow", 1}}, .frictionloss = -1});
  check_message(d, "tendon 't' has a negative frictionloss");
  for (double OptionDescription::*of : {&OptionDescription::density, &OptionDescription::viscosity}) {
    d = double_pendulum(), d.option.*of = -1;
    check_message(d, "option density and viscosity are not both zero or more");
  }
  d = double_pendulum(), d.option.density = NAN;
  check_message(d, "option density and viscosity");
  d = double_pendulum(), d.bodies[1].cameras.emplace_back().resolution = {64, 0};
  check_message(d, "no positive resolution");
  d = double_pendulum(), d.bodies[1].geoms[0].has_mass = false, d.bodies[1].geoms[0].mass = 1;
  check_message(d, "has a mass, and has_mass is false");
  d = double_pendulum(), d.bodies[1].has_inertial = false, d.bodies[1].inertial.mass = 1;
  check_message(d, "body 'upper' has an inertial, and has_inertial is false");
  d = double_pendulum(), d.actuators.push_back({.name = "suck", .target = Transmission::body, .target_name = "upper"});
  d.actuators[0].bias_type = ActuatorBias::affine, d.actuators[0].biasprm[2] = -1;
  check_message(d, "actuator 'suck' acts at the contacts of a body and depends on their velocity");
  for (auto const& wrong : {std::array{-1., 1.}, {1., 0.}}) {
    d = double_pendulum(), d.bodies[1].joints[0].springdamper = wrong;
    check_message(d, "joint 'shoulder' has a springdamper that is not two positive numbers");
  }
  d = double_pendulum(), d.bodies[1].cameras.emplace_back().fovy = 60;
  check_message(d, "body 'upper': camera has a fovy of pi or more: give less, in radians");
  d = double_pendulum(), d.bodies[1].cameras.emplace_back().sensor_size = {0.1, 0};
  check_message(d, "a sensor without area");
  d = double_pendulum(), d.files = {"a.xml"}, d.bodies[1].joints[0].place = {0, 7}, d.bodies[1].joints[0].limited = true;
  check_message(d, "a.xml:7: joint 'shoulder' is limited");
}

namespace {
/// Whether the report has a line with this in it, and how many it has.
bool notes(Description const& d, std::string const& part, std::size_t lines = 1) {
  auto const m = compile(d);
  bool found = false;
  for (auto const& line : m.report) found |= line.text.find(part) != std::string::npos;
  return found && m.report.size() == lines;
}
/// A connect or weld of two points, as sites "one" and "two".
EqualityDescription of_sites(EqualityType type, std::string one, std::string two) {
  EqualityDescription e;
  e.name = one + two, e.type = type, e.sites = true, e.name1 = std::move(one), e.name2 = std::move(two);
  return e;
}
}  // namespace

// The pendulum's tip is 2 m from the shoulder at most, and comes to it. A hook at x can be reached where
// |x| <= 2 alone; one on a rail with 3 m of play where |x| <= 5; a tip at 0.25 m of the lower rod not below |x| = 0.75.
TEST_CASE("a loop that cannot close is said, and how far it stays open") {
  auto const open = [](double hook, double tip, double play = 0) {
    auto d = double_pendulum();
    d.bodies[2].sites.push_back({.name = "tip", .pos = {0, 0, -tip}});
    if (play > 0) {
      auto cart = body("cart", 0, {0, 0, 0});
      JointDescription rail;
      rail.name = "rail", rail.type = JointType::slide, rail.axis = {1, 0, 0}, rail.limited = true, rail.range = {-play, 1};
      cart.joints.push_back(rail), cart.geoms.push_back(sphere(0.1));
      d.bodies.push_back(cart);
    }
    d.bodies[play > 0 ? 3 : 0].sites.push_back({.name = "hook", .pos = {hook, 0, 0}});
    d.equalities = {of_sites(EqualityType::connect, "tip", "hook")};
    return d;
  };
  CHECK(compile(open(1.999, 1)).report.empty());
  CHECK(notes(open(2.25, 1), "'tiphook' cannot close: the joints between them leave its two points at least 0.25 m apart"));
  CHECK(compile(open(0.7501, 0.25)).report.empty());
  CHECK(notes(open(0.5, 0.25), "at least 0.25 m apart"));
  CHECK(compile(open(4.99, 1, 3)).report.empty());
  CHECK(notes(open(5.5, 1, 3), "at least 0.5 m apart"));
  auto d = open(9, 1);
  d.bodies[2].joints[0].type = JointType::slide;  // without limits: anywhere
  CHECK(compile(d).report.empty());
  d = open(9, 1), d.equalities[0].active = false;
  CHECK(compile(d).report.empty());
  d = open(9, 1), d.bodies[0].sites.clear();
  d.equalities[0] = {.name = "w", .type = EqualityType::weld, .name1 = "world", .name2 = "lower"};
  d.equalities[0].data = {0, 0, -1, 3, 0, 0, 1, 0, 0, 0, 1};  // the tip 3 m off the world's origin
  CHECK(notes(d, "'w' cannot close: the joints between them leave its two points at least 1 m apart"));
}

// What the user moves may come to where it closes; two that he moves are moved by no joint.
TEST_CASE("what a mocap body holds may close, and two of them are moved by nothing") {
  auto d = double_pendulum();
  d.bodies[2].sites.push_back({.name = "tip", .pos = {0, 0, -1}});
  d.bodies[2].sites.push_back({.name = "elbow", .pos = {0, 0, 0}});
  for (double x : {5., 6.}) {
    auto hand = body(x < 6 ? "left" : "right", 0, {x, 0, 0});
    hand.mocap = true;
    hand.sites.push_back({.name = hand.name});
    d.bodies.push_back(hand);
  }
  for (auto const type : {EqualityType::connect, EqualityType::weld}) {
    d.equalities = {of_sites(type, "tip", "left")};
    CHECK(compile(d).report.empty());
    d.equalities = {of_sites(type, "tip", "left"), of_sites(type, "elbow", "right")};
    CHECK(compile(d).report.empty());
    d.equalities = {of_sites(type, "left", "right")};
    CHECK(notes(d, "'leftright' joins 'left' and 'right', which no joint moves"));
  }
}

TEST_CASE("points and poses that two equalities ask for at once are compared") {
  Description d;
  for (int k = 0; k < 2; ++k) {
    auto b = body(k ? "b" : "a", 0, {double(k), 0, 1});
    b.joints.emplace_back().type = JointType::free;
    b.geoms.push_back(sphere(0.1));
    for (int s = 0; s < 3; ++s) b.sites.push_back({.name = b.name + std::to_string(s), .pos = {0.1 * s, k * 0.2 * (s == 2), 0}});
    d.bodies.push_back(b);
  }
  auto const connect = EqualityType::connect, weld = EqualityType::weld;
  auto const with = [&](EqualityDescription one, EqualityDescription two) {
    auto copy = d;
    copy.equalities = {std::move(one), std::move(two)};
    return copy;
  };
  char const* const said = "ask different things";
  CHECK(compile(with(of_sites(connect, "a0", "b0"), of_sites(connect, "a1", "b1"))).report.empty());  // 0.1 m apart on both bodies
  CHECK(notes(with(of_sites(connect, "a0", "b0"), of_sites(connect, "a2", "b1")), said));             // 0.2 m, 0.1 m
  CHECK(notes(with(of_sites(connect, "a0", "b0"), of_sites(connect, "b1", "a2")), said));             // whichever is named first
  CHECK(compile(with(of_sites(weld, "a0", "b0"), of_sites(weld, "a1", "b1"))).report.empty());
  CHECK(notes(with(of_sites(weld, "a0", "b0"), of_sites(weld, "a1", "b0")), said));
  CHECK(notes(with(of_sites(weld, "a0", "b0"), of_sites(connect, "a2", "b2")), said));  // (0.2, 0) of a, (0.2, 0.2) of b
  d.bodies[1].sites[1].quat = {std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
  CHECK(notes(with(of_sites(weld, "a0", "b0"), of_sites(weld, "a1", "b1")), said));  // the same place, another turn
}

TEST_CASE("what is taken for another, grows without bound or is lost in float is said") {
  auto d = double_pendulum();
  d.bodies[1].joints[0].limited = true, d.bodies[1].joints[0].range = {-1, 0.5};
  d.equalities = {{.name = "e", .type = EqualityType::joint, .name1 = "shoulder"}};
  d.equalities[0].data[0] = 0.5;
  CHECK(compile(d).report.empty());
  d.equalities[0].data[0] = 2;
  CHECK(notes(d, "'e' asks joint 'shoulder' for 2, outside of its range -1 to 0.5"));

  d = double_pendulum();
  for (int k : {1, 2}) d.bodies[k].geoms[0].name = "g" + std::to_string(k), d.bodies[k].geoms[0].softness.solimp = {0, 1, 0, 1, 1};
  CHECK(compile(d).report.empty());  // the ends of what has a meaning
  for (int k : {1, 2}) d.bodies[k].geoms[0].softness.solimp = {0.9, 2, 0.001, 0.5, 2};
  CHECK(notes(d, "geom 'g1' has solimp 0.9 2 0.001 0.5 2, which is taken at the nearest"));
  CHECK(compile(d).report[0].count == 2);
  for (int k : {1, 2}) d.bodies[k].geoms[0].contype = d.bodies[k].geoms[0].conaffinity = 0;  // asked by nobody
  CHECK(compile(d).report.empty());
  d = double_pendulum(), d.bodies[1].geoms[0].softness.solref = {0.02, -1};
  CHECK(notes(d, "solref 0.02 -1, neither"));
  d.bodies[1].geoms[0].softness.solref = {0, 0};
  CHECK(compile(d).report.empty());
  for (int k : {1, 2}) d.bodies[k].geoms[0].name = "g" + std::to_string(k);
  d.pairs = {{.name = "p", .geom1 = "g1", .geom2 = "g2"}};
  for (auto const& valid : {std::array{0., 0.}, {0.02, 1.}, {-500., -20.}, {0., -5.}}) {
    d.pairs[0].solreffriction = valid;
    CHECK(compile(d).report.empty());
  }
  d.pairs[0].solreffriction = {0.02, 0};
  CHECK(notes(d,
              "pair 'p' has solreffriction 0.02 0, neither a time constant and a damping ratio nor -stiffness and -damping: its friction "
              "is as soft as solref says: correct it"));

  d = double_pendulum(), d.actuators.push_back({.name = "slow", .target_name = "elbow", .dynamics = ActuatorDynamics::filter});
  d.actuators[0].dynprm[0] = 0.5 * d.option.timestep;
  CHECK(compile(d).report.empty());
  d.actuators[0].dynprm[0] *= 0.99;
  CHECK(notes(d, "actuator 'slow' filters with a time constant of 0.00099 s"));
  d.actuators[0].dynamics = ActuatorDynamics::filter_exact;
  CHECK(compile(d).report.empty());
  d.option.integrator = Integrator::rk4,
  d.actuators[0].dynprm[0] = d.option.timestep / 2.78;  // 1 + x + x^2/2 + x^3/6 + x^4/24 at -2.78: 0.99
  CHECK(compile(d).report.empty());
  d.actuators[0].dynprm[0] = d.option.timestep / 2.79;
  CHECK(notes(d, "of RK4: its activation grows without bound"));

  d = double_pendulum(), d.bodies[2].gravcomp = -1;
  CHECK(notes(d, "body 'lower' has gravcomp -1, which does nothing"));
  CHECK(compile(d).body_gravcomp[2] == 0);
  d.bodies[1].gravcomp = 0.5;
  CHECK(compile(d).report.empty());
  CHECK(compile(d).body_gravcomp[2] == -1);

  d = double_pendulum(), d.bodies[1].joints[0].range = {-1, 1};
  CHECK(notes(d, "joint 'shoulder' has a range of -1 to 1, and limited is false: set it"));
  d.files = {"a.xml"}, d.bodies[1].joints[0].place = {0, 7};  // a file says limited="false" where it means it
  CHECK(compile(d).report.empty());
  d = double_pendulum(), d.actuators.push_back({.name = "m", .target_name = "elbow", .ctrl_range = {-1, 1}});
  CHECK(notes(d, "actuator 'm' has a range of -1 to 1, and ctrl_limited is false"));

  // A sphere of 1 kg and 0.1 m (I = 0.004 kg m^2) at 25 m has m r^2 / I = 156,250, at 15 m 56,250.
  for (double r : {15., 25.}) {
    d = {}, d.bodies.push_back(body("far", 0, {0, 0, 0}));
    d.bodies[1].joints.emplace_back().type = JointType::free;
    auto g = sphere(0.1);
    g.pos[0] = r, g.has_mass = true, g.mass = 1;
    d.bodies[1].geoms.push_back(g);
    CHECK((r < 20 ? compile(d).report.empty() : notes(d, "body 'far' has its centre of mass 25 m from its frame")));
    d.bodies[1].joints[0].align = true;
    CHECK(compile(d).report.empty());
  }
}

// Bodies as MuJoCo 4.0.1 takes and refuses them: negative numbers count as 0, and what moves must have both mass and moments above 1e-15.
// Of a description made in code nobody else sees them; hardlimit of a file comes from classes too, so it is looked for here.
TEST_CASE("what is rigid without a limit, and what bounces and is soft, are lines of the report") {
  auto const lines = [](Description const& d) {
    std::vector<std::string> all;
    for (auto const& line : compile(d).report) {
      CHECK(line.kind == ReportLine::Kind::no_effect);
      all.push_back(line.text + " " + std::to_string(line.count));
    }
    return all;
  };
  auto const rigid = [](RigidDescription r, bool limited) {
    auto d = double_pendulum();
    for (int b = 1; b <= 2; ++b) {
      auto& joint = d.bodies[std::size_t(b)].joints[0];
      joint.rigid_limit = r;
      joint.limited = limited;
      joint.range = {limited ? -1. : 0., limited ? 1. : 0.};
    }
    return d;
  };
  CHECK(lines(rigid({}, false)).empty());
  CHECK(lines(rigid({.hard = true, .restitution = 0.5}, true)).empty());
  auto d = rigid({.hard = true}, false);
  std::string const name = d.bodies[1].joints[0].name;
  std::string const vain = "joint '" + name + "' has a rigid limit (hardlimit) and no range that limits it: give it a range ";
  CHECK(lines(d) == std::vector<std::string>{vain + "2"});
  d.files = {"a.xml"};
  d.bodies[1].joints[0].place = d.bodies[2].joints[0].place = {0, 7};  // of a file too
  CHECK(lines(d) == std::vector<std::string>{vain + "2"});
  CHECK(compile(d).report[0].line == 7);

  std::string const soft = " has a restitution or an erp, and only what is rigid asks for them: set ";
  CHECK(lines(rigid({.restitution = 0.5}, true)) == std::vector<std::string>{"joint '" + name + "'" + soft + "rigid_limit.hard 2"});
  d = double_pendulum();
  d.bodies[2].geoms[0].name = "ball";
  d.bodies[2].geoms[0].restitution = 0.5;
  CHECK(lines(d) == std::vector<std::string>{"geom 'ball'" + soft + "hard 1"});
  d.bodies[2].geoms[0].hard = true;
  CHECK(lines(d).empty());
  d.bodies[2].geoms[0].hard = false;
  d.files = {"a.xml"};
  d.bodies[2].geoms[0].place = {0, 7};  // its reader has said it
  CHECK(lines(d).empty());
  d = double_pendulum();
  EqualityDescription weld;
  weld.name = "held";
  weld.type = EqualityType::weld;
  weld.name1 = d.bodies[1].name;
  weld.name2 = d.bodies[2].name;
  d.equalities.push_back(weld);
  CHECK(lines(d).empty());
  d.equalities[0].rigid.erp = 0.5;
  CHECK(lines(d) == std::vector<std::string>{"equality 'held'" + soft + "rigid.hard 1"});
}

TEST_CASE("masses of 0 and below are refused where they move, and said where they stand") {
  auto const weighed = [](bool moves, double mass, Double3 moments = {1, 1, 1}) {
    Description d;
    auto b = body("lump", 0, {0, 0, 0});
    b.has_inertial = true, b.inertial.mass = mass, b.inertial.inertia = {moments[0], moments[1], moments[2], 0, 0, 0};
    if (moves) b.joints.emplace_back().type = JointType::free;
    d.bodies.push_back(b);
    return d;
  };
  char const* const each = ", and each has to be above 1e-15): correct them, or set compiler boundmass and boundinertia";
  check_message(
      weighed(true, 0),
      ("body 'lump' moves but has no mass or inertia (its inertial gives it mass 0 and moments 1 1 1" + std::string(each)).c_str());
  check_message(weighed(true, -1), "body 'lump' moves but has no mass or inertia (its inertial gives it mass -1 and moments 1 1 1");
  check_message(weighed(true, 1, {-1, 1, 1}), "its inertial gives it mass 1 and moments -1 1 1");
  CHECK(compile(weighed(true, 1e-14)).report.empty());
  auto bounded = weighed(true, -1);
  bounded.compiler.boundmass = 0.1;
  CHECK(compile(bounded).body_mass[1] == 0.1);
  CHECK(notes(bounded, "body 'lump' has a negative mass or moment of inertia, which is taken as 0, or as boundmass and boundinertia say"));
  CHECK(compile(weighed(false, 0)).report.empty());
  CHECK(notes(weighed(false, -1), "body 'lump' has a negative mass or moment of inertia, which is taken as 0"));
  CHECK(compile(weighed(false, -1)).body_mass[1] == 0);
  auto empty = weighed(true, 1);
  empty.bodies[1].has_inertial = false, empty.bodies[1].inertial = {};
  check_message(empty, "body 'lump' moves but has no mass or inertia: give it a geom with density or mass, an inertial, or set compiler");
  empty.bodies[1].geoms = {sphere(0.1)}, empty.bodies[1].geoms[0].has_mass = true, empty.bodies[1].geoms[0].mass = 1e-14;
  empty.bodies[1].geoms[0].mass = 2e-14;
  check_message(empty, "its geoms give it mass 2e-14 and moments 8e-17");
  empty.bodies[1].geoms[0].mass = -1;
  check_message(empty, "has a negative mass or density: give zero or more");
  Description world;
  world.bodies[0].geoms = {sphere(1)}, world.bodies[0].geoms[0].name = "rock", world.bodies[0].geoms[0].density = -1;
  CHECK(notes(world, "geom 'rock' of the world has a negative mass or density, and the world weighs nothing"));
}

TEST_CASE("equalities without a name are named by what they join") {
  auto d = double_pendulum();
  EqualityDescription e{.type = EqualityType::joint, .name1 = "shoulder", .name2 = "elbow"};
  d.equalities = {e, e};
  d.equalities[1].data[0] = 1;
  CHECK(notes(
      d, "joint equality of joint 'shoulder' and joint 'elbow' and joint equality of joint 'shoulder' and joint 'elbow' ask different"));
  d.equalities = {{.type = EqualityType::weld, .name1 = "lower"}};
  d.equalities[0].softness.solref = {0.02, -1};
  CHECK(notes(d, "weld of body 'lower' and the world has solref 0.02 -1"));
  d.bodies[1].name = "", d.bodies[1].sites = {{.name = "hook"}}, d.bodies[2].sites = {{.name = "eye"}};
  d.equalities[0] = {.type = EqualityType::connect, .name1 = "hook", .name2 = "eye", .sites = true};
  d.equalities[0].softness.solref = {0.02, -1};
  CHECK(notes(d, "connect of site 'hook' and site 'eye' has solref", 2));
  CHECK(notes(d, "connect of site 'hook' and site 'eye' cannot close", 2));
}

// Four faces, of which MuJoCo's volume is the sum of pyramids by their absolute values, whatever they bound.
TEST_CASE("meshes that are open or inside out are said where they weigh") {
  MeshDescription solid{
      .name = "m", .vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, .faces = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
  auto open = solid, inside_out = solid, seamed = solid;
  open.faces.pop_back();
  for (auto& f : inside_out.faces) std::swap(f[1], f[2]);
  auto both = inside_out;
  both.faces.erase(both.faces.begin());
  seamed.vertices.push_back({0, 0, 1}), seamed.faces[3][2] = 4;  // one place twice
  auto const with = [](MeshDescription const& mesh, bool weighs) {
    Description d;
    d.meshes = {mesh};
    auto b = body("b", 0, {0, 0, 0});
    b.joints.emplace_back().type = JointType::free;
    if (!weighs) b.has_inertial = true, b.inertial.mass = 1, b.inertial.inertia = {1, 1, 1, 0, 0, 0};
    b.geoms = {{}};
    b.geoms[0].type = ShapeType::mesh, b.geoms[0].mesh = "m", b.geoms[0].contype = b.geoms[0].conaffinity = 0;
    d.bodies.push_back(b);
    return d;
  };
  CHECK(compile(with(solid, true)).report.empty());
  CHECK(compile(with(seamed, true)).report.empty());
  CHECK(notes(with(open, true),
              "mesh 'm' is open (3 of its 6 edges lack a face): what its faces span with their middle is taken for its volume, as in "
              "MuJoCo: close it"));
  CHECK(notes(
      with(inside_out, true),
      "mesh 'm' is inside out (its faces look inwards): the absolute value of its volumes is taken, as in MuJoCo: turn its faces over"));
  CHECK(notes(with(both, true), "lack a face): what its faces span with their middle is taken for its volume; it is inside out"));
  CHECK(compile(with(inside_out, true)).body_mass[1] == doctest::Approx(compile(with(solid, true)).body_mass[1]));
  CHECK(compile(with(open, true)).body_mass[1] == doctest::Approx(1000. / 9));                         // MuJoCo's
  for (auto const& mesh : {open, inside_out, both}) CHECK(compile(with(mesh, false)).report.empty());  // seen alone
  auto still = with(open, true);
  still.bodies[1].joints.clear();
  CHECK(compile(still).report.empty());
  open.inertia = MeshInertia::shell;
  CHECK(compile(with(open, true)).report.empty());
}

TEST_CASE("a sensor of a type that MJCF does not have is refused") {
  auto d = double_pendulum();
  d.sensors.push_back({.name = "s", .type = "jointpose", .object_type = "joint", .object = "elbow"});
  check_message(d, "has the type 'jointpose', which is not one of MJCF's");
}

// What MuJoCo refuses too, but for dims of datatypes that it refuses at another place.
TEST_CASE("settings of sensors are whole numbers and words in their order") {
  auto const with = [](char const* type, std::vector<std::array<std::string, 2>> settings, bool site = false) {
    auto d = double_pendulum();
    d.bodies[1].sites.emplace_back().name = "s";
    SensorDescription sensor{.name = "x", .type = type};
    if (site) sensor.object_type = "site", sensor.object = "s";
    sensor.settings = std::move(settings);
    d.sensors.push_back(sensor);
    return d;
  };
  check_message(with("user", {{"dim", "-1"}}), "has dim '-1', which must be a whole number, 0 or more");
  check_message(with("user", {{"dim", "2.5"}}), "has dim '2.5'");
  check_message(with("user", {{"dim", "6"}, {"datatype", "axis"}}), "an axis has 3 numbers, a quaternion 4");
  check_message(with("user", {{"dim", "3"}, {"datatype", "quaternion"}}), "an axis has 3 numbers, a quaternion 4");
  check_message(with("user", {{"dim", "2000000000"}}), "makes 1e9 numbers or more of all sensors: lower its dim");
  check_message(with("contact", {{"num", "2.5"}}), "has num '2.5', which must be a whole number, 1 or more");
  check_message(with("contact", {{"num", "2000000000"}, {"data", "force"}}), "ask for fewer slots");
  for (char const* const data : {"foo", "dist dist", "dir dist"})
    check_message(with("rangefinder", {{"data", data}}, true), "name each once, in the order dist dir origin point normal depth");
  CHECK(compile(with("user", {{"dim", "0"}})).nsensordata == 0);
  CHECK(compile(with("rangefinder", {{"data", ""}}, true)).nsensordata == 1);
  CHECK(compile(with("rangefinder", {{"data", " dist\n\tdir "}}, true)).nsensordata == 4);
  CHECK(compile(with("contact", {{"data", "found\nforce"}, {"num", " 2 "}})).nsensordata == 8);
}
