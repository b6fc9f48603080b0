// Three robots against numbers computed by hand, strictness, places, the report, and bad input. MuJoCo's own URDF reader: oracle/urdf.cpp.
#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <gsp/io/urdf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <io/fixtures.hpp>
#include <io/urdf_robots.hpp>

using namespace gsp;
using io::parse_urdf;

namespace {
std::string message(std::string const& text, io::UrdfOptions const& options = {}) {
  try {
    compile(parse_urdf(text, "r.urdf", options));
    return "accepted";
  } catch (Error const& e) {
    std::string const what = e.what();
    CHECK(what.find('\n') == std::string::npos);
    return what;
  }
}
void refused(std::string const& text, std::string const& place, std::string const& part, io::UrdfOptions const& options = {}) {
  std::string const what = message(text, options);
  CHECK_MESSAGE(what.rfind(place, 0) == 0, what);
  CHECK_MESSAGE(what.find(part) != std::string::npos, what);
}
/// A link on line 2 that a joint of line 3 moves.
std::string robot(std::string const& link,
                  std::string const& joint = "<axis xyz='0 0 1'/><limit lower='0' upper='1' effort='1' velocity='1'/>",
                  std::string const& type = "revolute") {
  return "<robot name='r'><link name='a'/>\n<link name='b'>" + link + "</link>\n<joint name='j' type='" + type +
         "'><parent link='a'/><child link='b'/>" + joint + "</joint>\n</robot>";
}
std::string const inertial = "<inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>";
int lines(Description const& d, ReportLine::Kind kind, std::string const& part) {
  int count = 0;
  for (auto const& l : d.report)
    if (l.kind == kind && l.text.find(part) != std::string::npos) count += l.count;
  return count;
}
BodyDescription const& body(Description const& d, std::string const& name) {
  for (auto const& b : d.bodies)
    if (b.name == name) return b;
  throw std::runtime_error("no body " + name);
}
int joint(CompiledModel const& m, std::string const& name) {
  for (int j = 0; j < m.njnt; ++j)
    if (m.jnt_name[j] == name) return j;
  throw std::runtime_error("no joint " + name);
}
double total(CompiledModel const& m) {
  double sum = 0;
  for (double x : m.body_mass) sum += x;
  return sum;
}
void same(std::vector<double> const& value, std::vector<double> const& expected) {
  REQUIRE(value.size() == expected.size());
  for (std::size_t i = 0; i < value.size(); ++i) CHECK(value[i] == doctest::Approx(expected[i]).epsilon(1e-12));
}
template <std::size_t N>
void same(std::array<double, N> const& value, std::vector<double> const& expected) {
  same(std::vector<double>(value.begin(), value.end()), expected);
}
}  // namespace

TEST_CASE("arm with a mimic gripper") {
  auto const d = parse_urdf(gsp_test::urdf_arm(), "arm.urdf");
  auto const m = compile(d);
  CHECK(d.name == "arm");
  CHECK(m.nbody == 7);
  CHECK(m.nq == 4);
  CHECK(m.ntree == 1);
  CHECK(total(m) == doctest::Approx(4 + 2 + 1.5 + 0.2).epsilon(1e-14));
  int const pan = joint(m, "pan"), elbow = joint(m, "elbow"), finger = joint(m, "finger");
  same(m.jnt_axis[pan], {0, 0, 1});
  same(m.jnt_axis[elbow], {0, 0.6, 0.8});
  same(m.jnt_range[pan], {-2.5, 2.5});
  same(m.jnt_actfrcrange[pan], {-40, 40});
  CHECK(m.jnt_type[finger] == int(JointType::slide));
  same(m.jnt_range[finger], {0, 0.04});
  CHECK(m.dof_damping[m.jnt_dofadr[pan]] == 0.5);
  CHECK(m.dof_frictionloss[m.jnt_dofadr[pan]] == 0.2);
  // upper: 0.02 -0.01; -0.01 0.02 has eigenvalues 0.01 and 0.03, along (1, 1) and (1, -1), and the frame is turned by 0.5
  int const upper = m.jnt_body[pan];
  auto moments = m.body_inertia[std::size_t(upper)];
  std::sort(moments.begin(), moments.end());
  same(moments, {0.01, 0.03, 0.035});
  same(m.body_ipos[std::size_t(upper)], {0, 0.01, 0.15});
  auto const& q = m.body_iquat[std::size_t(upper)];
  auto const& i = m.body_inertia[std::size_t(upper)];
  std::size_t const least = std::size_t(std::min_element(i.begin(), i.end()) - i.begin());
  Double3 axis{0, 0, 0};
  axis[least] = 1;
  auto const along = gsp::detail::rotate(q, axis);
  double const angle = 0.7853981633974483 + 0.5;  // of (1, 1), and the frame's turn
  CHECK(std::abs(along[0] * std::cos(angle) + along[1] * std::sin(angle)) == doctest::Approx(1).epsilon(1e-12));
  // pan: turned by a quarter about z; elbow: roll by a quarter first, then pitch by 0.3 about the fixed y
  same(m.body_quat[std::size_t(upper)], {std::sqrt(0.5), 0, 0, std::sqrt(0.5)});
  double const h = std::sqrt(0.5), c = std::cos(0.15), s = std::sin(0.15);
  same(m.body_quat[std::size_t(m.jnt_body[elbow])], {c * h, c * h, s * h, -s * h});
  REQUIRE(d.equalities.size() == 1);
  auto const& e = d.equalities[0];
  CHECK(e.type == EqualityType::joint);
  CHECK(e.name1 == "other_finger");
  CHECK(e.name2 == "finger");
  CHECK(e.data == std::array<double, 11>{0.001, 1.25});
  // shapes: full lengths become halves; visuals cannot be touched
  auto const& base = body(d, "base");
  REQUIRE(base.geoms.size() == 2);
  same(base.geoms[0].size, {0.1, 0.05, 0});
  CHECK(base.geoms[0].visual());
  CHECK(base.geoms[0].rgba == std::array<float, 4>{0.6f, 0.6f, 0.7f, 1});
  CHECK(base.geoms[1].name == "foot");
  CHECK_FALSE(base.geoms[1].visual());
  CHECK(body(d, "upper").geoms[0].type == ShapeType::capsule);
  same(body(d, "upper").geoms[0].size, {0.04, 0.15, 0});
  same(body(d, "fore").geoms[1].size, {0.03, 0.04, 0.1});
  CHECK(body(d, "fore").geoms[0].rgba == std::array<float, 4>{1, 0, 0, 0.5f});
  CHECK(lines(d, ReportLine::Kind::no_effect, "<robot> <transmission>") == 1);
  CHECK(lines(d, ReportLine::Kind::no_effect, "<limit> velocity") == 4);
}

TEST_CASE("quadruped: floating base") {
  auto const d = parse_urdf(gsp_test::urdf_quadruped(), "q.urdf", {.floating_base = true});
  auto const m = compile(d);
  CHECK(m.nbody == 1 + 1 + 16);
  CHECK(m.nq == 7 + 12);
  CHECK(m.nv == 6 + 12);
  CHECK(m.jnt_type[0] == int(JointType::free));
  CHECK(total(m) == doctest::Approx(6 + 4 * (0.5 + 0.9 + 0.2)).epsilon(1e-14));
  for (std::string const leg : {"fl", "fr", "rl", "rr"}) {
    int const hip = joint(m, leg + "_hip_joint"), thigh = joint(m, leg + "_thigh_joint"), shin = joint(m, leg + "_shin_joint");
    same(m.jnt_axis[hip], {1, 0, 0});
    same(m.jnt_axis[thigh], {0, 1, 0});
    same(m.jnt_range[hip], {-0.8, 0.8});
    same(m.jnt_range[thigh], {-1.5, 3.4});
    same(m.jnt_range[shin], {-2.7, -0.8});
    same(m.jnt_actfrcrange[shin], {-23.7, 23.7});
    same(m.body_pos[std::size_t(m.jnt_body[hip])], {leg[0] == 'f' ? 0.2 : -0.2, leg[1] == 'l' ? 0.1 : -0.1, 0});
    CHECK(m.dof_damping[m.jnt_dofadr[thigh]] == 0.01);
  }
  auto const fixed = compile(parse_urdf(gsp_test::urdf_quadruped(), "q.urdf"));
  CHECK(fixed.nv == 12);
  CHECK(fixed.ntree == 4);  // legs of a trunk that does not move
}

TEST_CASE("wheeled base: continuous joints, a massless root that floats with what is fixed to it") {
  auto const d = parse_urdf(gsp_test::urdf_wheels(), "w.urdf", {.floating_base = true});
  auto const m = compile(d);
  CHECK(m.nv == 6 + 3);
  CHECK(total(m) == doctest::Approx(12.8).epsilon(1e-14));
  int const left = joint(m, "left"), lift = joint(m, "lift");
  CHECK(m.jnt_limited[left] == 0);
  CHECK(m.jnt_limited[lift] == 1);
  same(m.jnt_range[lift], {-0.05, 0.3});
  same(m.jnt_actfrcrange[left], {-5, 5});
  // roll by minus a quarter: the wheel's z axis is the base's y axis
  auto const& q = m.body_quat[std::size_t(m.jnt_body[left])];
  auto const axis = gsp::detail::rotate(q, m.jnt_axis[left]);
  CHECK(axis[1] == doctest::Approx(1).epsilon(1e-14));
  CHECK(body(d, "caster").geoms[0].size[0] == 0.05);
  CHECK(lines(d, ReportLine::Kind::no_effect, "ros2_control") == 1);
}

TEST_CASE("planar and floating joints, the world as root") {
  std::string const base = "<robot name='r'><link name='world'/><link name='b'>" + inertial + "</link><link name='c'>" + inertial +
                           "</link><joint name='j' type='floating'><parent link='world'/><child link='b'/><origin xyz='1 2 3'/></joint>";
  auto const planar =
      parse_urdf(base + "<joint name='k' type='planar'><parent link='b'/><child link='c'/><axis xyz='0 1 0'/></joint></robot>", "p.urdf");
  REQUIRE(planar.bodies.size() == 3);
  CHECK(planar.bodies[1].parent == 0);
  CHECK(planar.bodies[1].joints.at(0).type == JointType::free);
  same(planar.bodies[1].pos, {1, 2, 3});
  auto const& joints = planar.bodies[2].joints;
  REQUIRE(joints.size() == 3);
  CHECK(joints[0].type == JointType::slide);
  CHECK(joints[1].type == JointType::slide);
  CHECK(joints[2].type == JointType::hinge);
  same(joints[2].axis, {0, 1, 0});
  for (int k : {0, 1}) CHECK(gsp::detail::dot(joints[std::size_t(k)].axis, joints[2].axis) == doctest::Approx(0).epsilon(1e-14));
  CHECK(compile(planar).nv == 9);
  auto const floating = parse_urdf(base + "<joint name='k' type='floating'><parent link='b'/><child link='c'/></joint></robot>", "f.urdf");
  REQUIRE(floating.bodies[2].joints.size() == 4);
  CHECK(floating.bodies[2].joints[3].type == JointType::ball);
  CHECK(compile(floating).nv == 12);
  refused(base + "</robot>", "r.urdf:1: ", "both without a joint above them");
}

TEST_CASE("what is wrong is said with file, line and remedy") {
  CHECK(message(robot(inertial)) == "accepted");
  refused("<mujoco/>", "r.urdf:1: ", "a URDF model is <robot>");
  refused("<robot name='r'/>", "r.urdf:1: ", "has no <link>");
  refused(robot(""), "r.urdf:2: ", "link 'b' moves and has no <inertial>");
  refused(robot("<inertial><mass value='0'/><inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/></inertial>"),
          "r.urdf:2: ", "moves and has no mass");
  refused(robot("<inertial><mass value='1'/></inertial>"), "r.urdf:2: ", "has no <inertia>");
  refused(robot("<inertial><mass value='1'/><inertia ixx='1'/></inertial>"), "r.urdf:2: ", "'iyy' is missing");
  refused(robot("<inertial><mass value='x'/></inertial>"), "r.urdf:2: ", "has no <inertia>");
  refused(robot("<inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='3'/></inertial>"),
          "r.urdf:2: ", "exceeds the sum of the others");
  refused(robot(inertial, "<limit lower='-1e400' upper='1'/>"), "r.urdf:3: ", "holds '-1e400', which is beyond the largest number");
  refused(robot(inertial, "<limit lower='1' upper='0'/>"), "r.urdf:3: ", "leaves no way between lower and upper");
  refused(robot(inertial, ""), "r.urdf:3: ", "is revolute and has no <limit>");
  refused(robot(inertial, "<axis xyz='0 0 0'/><limit lower='0' upper='1'/>"), "r.urdf:3: ", "direction of length zero");
  refused(robot(inertial, "", "hinge"), "r.urdf:3: ", "give one of: fixed, revolute");
  refused(robot(inertial, "<mimic joint='k'/><limit lower='0' upper='1'/>"), "r.urdf:3: ", "which is no other joint");
  refused(robot(inertial, "<mimic joint='j'/>", "planar"), "r.urdf:3: ", "not revolute, continuous or prismatic");
  refused(robot(inertial, "<origin xyz='1 2'/><limit lower='0' upper='1'/>"), "r.urdf:3: ", "has 2 numbers; give 3");
  refused(robot(inertial, "<origin/><origin/><limit lower='0' upper='1'/>"), "r.urdf:3: ", "a second <origin>");
  refused(robot(inertial + "<colision/>"), "r.urdf:2: ", "unknown element 'colision' in <link>");
  refused(robot(inertial + "<collision nam='x'><geometry><sphere radius='1'/></geometry></collision>"),
          "r.urdf:2: ", "unknown attribute 'nam'");
  refused(robot(inertial + "<collision/>"), "r.urdf:2: ", "needs one <geometry> with one shape");
  refused(robot(inertial + "<collision><geometry><sphere radius='0'/></geometry></collision>"), "r.urdf:2: ", "size[0] <= 0");
  refused(robot(inertial + "<visual><geometry><sphere radius='1'/></geometry><material name='x'/></visual>"),
          "r.urdf:2: ", "neither a color nor the name of a material");
  refused(robot(inertial + "<xacro:wheel/>"), "r.urdf:2: ", "run xacro over the file first");
  refused("<robot name='r'><link name='a'/>\n<link name='a'/></robot>", "r.urdf:2: ", "which another link has");
  refused("<robot name='r'><link name='a'/>\n<joint name='j' type='fixed'><parent link='a'/><child link='z'/></joint></robot>",
          "r.urdf:2: ", "has the child link 'z', which does not exist");
  refused(
      "<robot name='r'><link name='a'/><link name='b'/>\n<joint name='j' type='fixed'><parent link='a'/><child link='b'/></joint><joint "
      "name='k' type='fixed'><parent link='a'/><child link='b'/></joint></robot>",
      "r.urdf:2: ", "URDF knows trees only");
  refused(
      "<robot name='r'><link name='a'/><link name='b'/>\n<joint name='j' type='fixed'><parent link='a'/><child link='b'/></joint><joint "
      "name='k' type='fixed'><parent link='b'/><child link='a'/></joint></robot>",
      "r.urdf:1: ", "the joints go in a circle");
  refused(
      "<robot name='r'><link name='r'/><link name='a'/>\n<link name='b'/><joint name='j' type='fixed'><parent link='a'/><child "
      "link='b'/></joint><joint "
      "name='k' type='fixed'><parent link='b'/><child link='a'/></joint></robot>",
      "r.urdf:1: ", "hangs on a circle of joints");
  refused("<robot name='r'>", "r.urdf:1: ", "is not XML here");
  CHECK_THROWS_WITH_AS(io::read_urdf("/nowhere/r.urdf"), doctest::Contains("there is no such file"), Error);
}

TEST_CASE("a chain of many links is read without recursion") {
  std::string text = "<robot name='r'><link name='l0'/>";
  for (int i = 1; i < 20000; ++i)
    text += "<link name='l" + std::to_string(i) + "'/><joint name='j" + std::to_string(i) + "' type='fixed'><parent link='l" +
            std::to_string(i - 1) + "'/><child link='l" + std::to_string(i) + "'/></joint>";
  CHECK(parse_urdf(text + "</robot>", "r.urdf").bodies.size() == 20001);
}

TEST_CASE("meshes: relative to the file, by package, once for each file and scale") {
  std::string const tetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
  std::vector<std::string> asked;
  io::UrdfOptions options;
  options.read = [&](std::filesystem::path const& path) {
    asked.push_back(path.string());
    if (path.filename() != "t.obj") throw Error(path.string() + ": there is no such file; check the path");
    auto const bytes = io::detail::as_bytes(tetrahedron);
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  options.packages = {{"p", "/else/where"}};
  auto const shape = [](std::string const& what, std::string const& file, std::string const& more = "") {
    return "<" + what + "><geometry><mesh filename='" + file + "'" + more + "/></geometry></" + what + ">";
  };
  auto const text = robot(inertial + shape("visual", "m/t.obj") + shape("collision", "m/t.obj") +
                          shape("collision", "m/t.obj", " scale='1 2 3'") + shape("visual", "package://p/t.obj"));
  auto const d = parse_urdf(text, "/folder/r.urdf", options);
  REQUIRE(d.meshes.size() == 3);
  CHECK(asked == std::vector<std::string>{"/folder/m/t.obj", "/folder/m/t.obj", "/else/where/t.obj"});
  CHECK(d.meshes[0].name == "t");
  CHECK(d.meshes[0].vertices.size() == 4);
  CHECK(d.meshes[1].name == "t_2");
  CHECK(d.meshes[1].scale == Double3{1, 2, 3});
  auto const& geoms = d.bodies[2].geoms;
  REQUIRE(geoms.size() == 4);
  CHECK(geoms[0].mesh == "t");
  CHECK(geoms[1].mesh == "t");
  CHECK(geoms[2].mesh == "t_2");
  CHECK(geoms[3].mesh == "t_3");
  // what cannot be read
  refused(robot(inertial + shape("visual", "x.obj")), "r.urdf:2: ", "no such file", options);
  refused(robot(inertial + shape("visual", "package://other_package_here/x.obj")),
          "r.urdf:2: ", "say where it is with --package (UrdfOptions::packages)", options);
  options.skip_visuals = true;
  auto const left = parse_urdf(robot(inertial + shape("visual", "x.obj")), "r.urdf", options);
  CHECK(left.bodies[2].geoms.empty());
  CHECK(lines(left, ReportLine::Kind::left_out, "visual mesh 'x.obj'") == 1);
  refused(robot(inertial + shape("collision", "x.obj")), "r.urdf:2: ", "no such file", options);
  // faces that are not taken
  options.read = [&](std::filesystem::path const&) {
    std::string const two = tetrahedron + "g second\nf 1 2 3\nf 1 2 4\n";
    auto const bytes = io::detail::as_bytes(two);
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  auto const part = parse_urdf(robot(inertial + shape("collision", "t.obj")), "r.urdf", options);
  CHECK(lines(part, ReportLine::Kind::left_out, "") == 1);
  for (auto const& l : part.report) {
    if (l.kind != ReportLine::Kind::left_out) continue;
    CHECK(l.file == "r.urdf");
    CHECK(l.line == 2);
    CHECK(l.text ==
          "mesh 't.obj': t.obj: line 10: faces from here on (2) belong to further objects or groups and are ignored, as MuJoCo does");
  }
}
