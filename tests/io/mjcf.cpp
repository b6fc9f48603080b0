// Strictness, places, the report, and bad input. Numbers are compared with MuJoCo's in tests/oracle/compile.cpp.
#include <doctest/doctest.h>

#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <io/fixtures.hpp>

using namespace gsp;
using io::parse_mjcf;

namespace {
/// One element in a body that is otherwise fine, on line 3.
std::string model(std::string const& inside, std::string const& after = "") {
  return "<mujoco>\n<worldbody><body name='b'><joint name='j'/><geom name='g' size='.1'/>\n" + inside + "\n</body></worldbody>" + after +
         "</mujoco>";
}
std::string message(std::string const& text, io::MjcfOptions const& options = {}) {
  try {
    compile(parse_mjcf(text, "m.xml", options));
    return "accepted";
  } catch (Error const& e) {
    std::string const what = e.what();
    CHECK(what.find('\n') == std::string::npos);
    return what;
  }
}
void refused(std::string const& text, std::string const& place, std::string const& part, io::MjcfOptions const& options = {}) {
  std::string const what = message(text, options);
  CHECK_MESSAGE(what.rfind(place, 0) == 0, what);
  CHECK_MESSAGE(what.find(part) != std::string::npos, what);
}
io::MjcfOptions files(std::map<std::string, std::string> texts) {
  io::MjcfOptions options;
  options.read = [texts](std::filesystem::path const& path) {
    auto const found = texts.find(path.string());
    if (found == texts.end()) throw Error(path.string() + ": there is no such file; check the path");
    auto const bytes = io::detail::as_bytes(found->second);
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  return options;
}
int lines(Description const& d, ReportLine::Kind kind, std::string const& part) {
  int count = 0;
  for (auto const& l : d.report)
    if (l.kind == kind && l.text.find(part) != std::string::npos) count += l.count;
  return count;
}
}  // namespace

TEST_CASE("unknown and unsupported words name file, line and remedy") {
  CHECK(message(model("")) == "accepted");
  refused(model("<geom sise='1'/>"), "m.xml:3: ", "unknown attribute 'sise' of <geom>; correct or remove it");
  refused(model("<gom/>"), "m.xml:3: ", "unknown element 'gom' in <body>");
  refused(model("", "<default><geom colour='1'/></default>"), "m.xml:4: ", "unknown attribute 'colour'");
  refused(model("", "<sensor><nose/></sensor>"), "m.xml:4: ", "unknown element 'nose'");
  refused(model("<geom size='.1' adhesion='3'/>"), "m.xml:3: ", "adhesion='3' is not supported yet; remove the attribute");
  CHECK(message(model("<geom size='.1' adhesion='0'/>")) == "accepted");  // asks for nothing
  refused(model("<composite/>"), "m.xml:3: ", "<composite> is not supported");
  refused(model("", "<equality><weld body1='b'/></equality>"), "m.xml:4: ", "equality constraints are not supported yet");
  refused(model("", "<tendon><spatial/></tendon>"), "m.xml:4: ", "use <fixed> tendons");
  refused(model("", "<actuator><muscle joint='j'/></actuator>"), "m.xml:4: ", "<muscle> is not supported yet");
  refused(model("", "<actuator><position joint='j' timeconst='.1'/></actuator>"), "m.xml:4: ", "timeconst");
  refused(model("", "<actuator><general joint='j' dyntype='filter'/></actuator>"), "m.xml:4: ", "actuators with a state");
  refused(model("", "<contact><pair geom1='g' geom2='g'/></contact>"), "m.xml:4: ", "<pair> is not supported yet");
  refused(model("", "<option density='1'/>"), "m.xml:4: ", "density='1'");
  refused(model("", "<option><flag override='enable'/></option>"), "m.xml:4: ", "override='enable'");
  refused("<robot/>", "m.xml:1: ", "an MJCF model is <mujoco>");
}

TEST_CASE("values are checked") {
  refused(model("<geom size='.1 x'/>"), "m.xml:3: ", "holds 'x', which is not a finite number");
  refused(model("<geom size='nan'/>"), "m.xml:3: ", "not a finite number");
  refused(model("<geom size='1 2 3 4'/>"), "m.xml:3: ", "has 4 numbers; give at most 3");
  refused(model("<geom size='1' pos='1 2'/>"), "m.xml:3: ", "attribute 'pos' has 2 numbers; give 3");
  refused(model("<geom size='1' condim='2.5'/>"), "m.xml:3: ", "not a whole number");
  refused(model("<geom size='1' condim='2'/>"), "m.xml:3: ", "condim other than 1, 3, 4, 6");
  refused(model("<geom size='1' type='ball'/>"), "m.xml:3: ", "give one of: plane, hfield, sphere");
  refused(model("<geom size='1' quat='1 0 0 0' euler='0 0 0'/>"), "m.xml:3: ", "more than one of quat");
  refused(model("<geom size='1' zaxis='0 0 0'/>"), "m.xml:3: ", "direction of length zero");
  refused(model("<geom size='1' fromto='0 0 0 0 0 1'/>"), "m.xml:3: ", "fromto' is for capsule");
  refused(model("<geom type='capsule' size='1' fromto='0 0 0 0 0 0'/>"), "m.xml:3: ", "two equal points");
  refused(model("<geom size='1' class='c'/>"), "m.xml:3: ", "default class 'c' does not exist");
  refused(model("<geom size='1' material='c'/>"), "m.xml:3: ", "which does not exist; correct the name");
  refused(model("<geom size='0'/>"), "m.xml:3: ", "size[0] <= 0");
  refused(model("<geom size='1' name='g'/>"), "m.xml:3: ", "name that is taken already");
  refused(model("<joint range='3 -3'/>"), "m.xml:3: ", "not in increasing order");
  refused(model("<freejoint/>"), "m.xml:3: ", "leaves nothing for the other joints");
  refused(model("<body><freejoint/></body>"), "m.xml:3: ", "not a child of the world");
  refused(model("<body name='x'><joint/></body>"), "m.xml:3: ", "body 'x' moves but has no mass");
  refused(model("<inertial pos='0 0 0' mass='1' diaginertia='1 1 3'/>"), "m.xml:2: ", "exceeds the sum of the others");
  refused(model("<inertial mass='1'/>"), "m.xml:3: ", "'pos' is missing");
  refused(model("", "<actuator><motor joint='k'/></actuator>"), "m.xml:4: ", "joint 'k', which does not exist");
  refused(model("", "<actuator><motor/></actuator>"), "m.xml:4: ", "needs one of joint, jointinparent and tendon");
  refused(model("", "<actuator><position joint='j' inheritrange='1'/></actuator>"), "m.xml:4: ", "inherits a range that 'j' does not have");
  refused(model("", "<tendon><fixed><joint joint='x' coef='1'/></fixed></tendon>"), "m.xml:4: ", "names the joint 'x'");
  refused(model("", "<contact><exclude body1='b' body2='x'/></contact>"), "m.xml:4: ", "names the body 'x'");
  refused(model("", "<keyframe><key qpos='1 2'/></keyframe>"), "m.xml:4: ", "has 2 numbers in qpos, and the model needs 1");
  refused(model("", "<compiler angle='grad'/>"), "m.xml:4: ", "give one of: radian, degree");
  refused(model("", "<option timestep='0'/>"), "m.xml:4: ", "timestep' is not positive");
  refused(model("", "<default><default/></default>"), "m.xml:4: ", "needs a class");
  refused(model("<replicate count='0'/>"), "m.xml:3: ", "below 1");
  refused(model("<attach model='x'/>"), "m.xml:3: ", "which no <asset> <model> has");
}

TEST_CASE("broken XML and missing files") {
  refused("", "m.xml:1: ", "");
  refused("<mujoco>\n<worldbody>\n</mujoco>", "m.xml:3: ", "is not XML here");
  refused("<mujoco/><mujoco/>", "m.xml:1: ", "second root");
  refused("<mujoco model='a' model='b'/>", "m.xml:1: ", "given twice");
  CHECK_THROWS_WITH_AS(io::read_mjcf("/nowhere/m.xml"), doctest::Contains("there is no such file"), Error);
  refused("<mujoco>\n<include file='x.xml'/></mujoco>", "m.xml:2: x.xml: there is no such file", "", files({}));
  refused("<mujoco>\n<include/></mujoco>", "m.xml:2: ", "takes the one attribute");
  refused("<mujoco>\n<include file='x.xml'/></mujoco>", "x.xml:2: ", "unknown element 'foo'",
          files({{"x.xml", "<mujocoinclude>\n<foo/></mujocoinclude>"}}));
  refused("<mujoco>\n<include file='x.xml'/></mujoco>", "x.xml:1: ", "included a second time",
          files({{"x.xml", "<mujocoinclude><include file='x.xml'/></mujocoinclude>"}}));
  std::string deep = "<mujoco><worldbody>";
  for (int i = 0; i < 200; ++i) deep += "<body>";
  for (int i = 0; i < 200; ++i) deep += "</body>";
  refused(deep + "</worldbody></mujoco>", "m.xml:1: ", "nested more than 100 deep");
  // circles of models, and replicates of replicates, end in a sentence soon
  std::string const circle =
      "<mujoco><asset><model name='a' file='m.xml'/></asset><worldbody><body name='x'/><attach model='a' prefix='p'/></worldbody></mujoco>";
  refused(circle, "m.xml:1: ", "is there a circle?", files({{"m.xml", circle}}));
  refused(model("<replicate count='1000'><replicate count='1000'><site/></replicate></replicate>"), "m.xml:3: ", "more than 200,000");
}

TEST_CASE("visual meshes are left out when asked, colliding ones never") {
  std::string const visual = "<geom type='mesh' mesh='x' contype='0' conaffinity='0'/>";
  std::string const weighed =
      "<mujoco><asset><mesh name='x' file='x.stl'/></asset><worldbody><body><joint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>";
  refused(weighed + visual + "</body></worldbody></mujoco>", "m.xml:1: ", "leave them out with --skip-visuals");
  auto const d = parse_mjcf(weighed + visual + visual + "</body></worldbody></mujoco>", "m.xml", {.skip_visuals = true});
  CHECK(d.bodies[1].geoms.empty());
  CHECK(lines(d, ReportLine::Kind::left_out, "visual mesh geoms") == 2);
  CHECK(compile(d).body_mass[1] == 1);
  refused(weighed + "<geom type='mesh' mesh='x'/></body></worldbody></mujoco>", "m.xml:1: ", "collides with a mesh",
          {.skip_visuals = true});
  refused(weighed + "<geom type='box' mesh='x'/></body></worldbody></mujoco>", "m.xml:1: ", "collides with a mesh", {.skip_visuals = true});
  // the body's mass would come from the mesh
  refused(model(visual), "m.xml:3: ", "the mass of body 'b' comes from this visual mesh", {.skip_visuals = true});
  CHECK(message(model("<geom type='mesh' mesh='x' contype='0' conaffinity='0' mass='0'/>"), {.skip_visuals = true}) == "accepted");
}

TEST_CASE("approximations are refused unless asked for, and counted") {
  std::string const scene =
      "<mujoco><worldbody><geom type='plane' size='1 1 1'/>\n<body><freejoint/><geom type='cylinder' size='.1 .1' condim='6'/></body>\n"
      "<body pos='1 0 0'><freejoint/><geom name='c' type='cylinder' size='.1 .1'/></body></worldbody></mujoco>";
  refused(scene, "m.xml:2: ", "condim 6");
  refused(std::string(scene).replace(scene.find("condim='6'"), 10, ""), "m.xml:2: ", "contact between these two shapes is not supported");
  auto const m = compile(parse_mjcf(scene, "m.xml", {.approximate = true}));
  CHECK(m.pairs.size() == 2);
  CHECK(m.geom_condim == std::vector<int>{3, 3, 3});
  int approximated = 0, left_out = 0;
  for (auto const& l : m.report) {
    if (l.kind == ReportLine::Kind::approximated) {
      approximated += l.count;
      CHECK(l.line == 2);
    }
    if (l.kind == ReportLine::Kind::left_out) left_out += l.count;
  }
  CHECK(approximated == 1);
  CHECK(left_out == 1);
}

TEST_CASE("the report lists what has no effect, with file, line and count") {
  auto const d = parse_mjcf(
      "<mujoco>\n<option solver='CG' cone='elliptic'/><visual><map zfar='3'/></visual>\n<worldbody><light/><light pos='0 0 "
      "1'/>\nstray<camera mode='track'/></worldbody>"
      "<sensor><clock/><clock/></sensor></mujoco>",
      "m.xml");
  CHECK(lines(d, ReportLine::Kind::no_effect, "<option> solver") == 1);
  CHECK(lines(d, ReportLine::Kind::no_effect, "cone (in profile stable)") == 1);
  CHECK(lines(d, ReportLine::Kind::visual_only, "<map> zfar") == 1);
  CHECK(lines(d, ReportLine::Kind::visual_only, "<light>") >= 2);
  CHECK(lines(d, ReportLine::Kind::approximated, "cameras are fixed") == 1);
  CHECK(lines(d, ReportLine::Kind::left_out, "<clock>: not evaluated yet") == 2);
  CHECK(lines(d, ReportLine::Kind::no_effect, "text between elements") == 1);
  for (auto const& l : d.report) CHECK(l.file == "m.xml");
  CHECK(d.report[0].line == 2);
}

TEST_CASE("with list_refusals the whole file is read and every refusal is a line") {
  auto const d =
      parse_mjcf(model("<geom size='.1' adhesion='3'/><composite/>", "<equality><weld body1='b'/></equality><tendon><spatial/></tendon>"),
                 "m.xml", {.list_refusals = true});
  CHECK(lines(d, ReportLine::Kind::refused, "") == 4);
  CHECK(d.bodies[1].geoms.size() == 2);
  CHECK(compile(d).nv == 1);
}

TEST_CASE("an item remembers its place, across files") {
  auto const d = parse_mjcf("<mujoco><worldbody>\n<include file='x.xml'/></worldbody></mujoco>", "m.xml",
                            files({{"x.xml", "<mujocoinclude>\n\n<body name='in'/></mujocoinclude>"}}));
  CHECK(d.files == std::vector<std::string>{"m.xml", "x.xml"});
  CHECK(d.bodies[1].place.file == 1);
  CHECK(d.bodies[1].place.line == 3);
}

TEST_CASE("writing to a file and reading it back; names that XML must escape") {
  gsp_test::Folder const folder;
  auto d = parse_mjcf(model("<site name='a&amp;&lt;&quot;b'/>"), "m.xml");
  io::write_mjcf(folder.path / "out.xml", d);
  CHECK(io::read_mjcf(folder.path / "out.xml").bodies[1].sites[0].name == "a&<\"b");
}
