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
  refused(model("<geom size='.1'><plugin/></geom>"), "m.xml:3: ", "<geom> <plugin>: plug-ins are not supported");
  refused(model("<composite/>"), "m.xml:3: ", "<composite>: composites are not supported");
  refused(model("<flexcomp/>"), "m.xml:3: ", "<flexcomp>: flexes are not supported");
  refused(model("<geom type='sdf' size='.1'/>"), "m.xml:3: ", "signed distance fields are not supported");
  refused(model("<camera resolution='64 4.5'/>"), "m.xml:3: ", "'resolution' is not two whole numbers");
  refused(model("<camera projection='orthographic'/>"), "m.xml:3: ", "projection='orthographic' is not supported");
  refused(model("<joint springyield='1'/>"), "m.xml:3: ", "springyield='1' is not supported yet; remove the attribute");
  refused(model("<frame scale='2'/>"), "m.xml:3: ", "scale='2' is not supported yet");
  refused(model("", "<equality><flex flex='f'/></equality>"), "m.xml:4: ", "<equality> <flex>: flexes are not supported");
  refused(model("", "<extension/>"), "m.xml:4: ", "plug-ins are not supported");
  refused(model("", "<deformable><flex/></deformable>"), "m.xml:4: ", "<deformable> <flex>: flexes are not supported");
  refused(model("", "<deformable><skin colour='1'/></deformable>"), "m.xml:4: ", "unknown attribute 'colour' of <skin>");
  refused(model("", "<actuator><plugin/></actuator>"), "m.xml:4: ", "<actuator> <plugin>: plug-ins are not supported");
  refused(model("", "<asset><mesh name='m' vertex='0 0 0'><plugin/></mesh></asset>"),
          "m.xml:4: ", "<mesh> <plugin>: plug-ins are not supported");
  refused(model("<plugin/>"), "m.xml:3: ", "<plugin>: plug-ins are not supported");
  refused(model("", "<equality><flexvert flex='f'/></equality>"), "m.xml:4: ", "<equality> <flexvert>: flexes are not supported");
  refused(model("", "<equality><flexstrain flex='f'/></equality>"), "m.xml:4: ", "<equality> <flexstrain>: flexes are not supported");
  refused(model("", "<actuator><pid joint='j'/></actuator>"), "m.xml:4: ", "<actuator> <pid>: actuators with an integral term");
  refused(model("", "<actuator><dcmotor joint='j'/></actuator>"), "m.xml:4: ", "models of electric motors are not supported");
  refused(model("", "<actuator><motor joint='j' delay='.1' nsample='3'/></actuator>"), "m.xml:4: ", "delay='.1' is not supported yet");
  refused(model("", "<actuator><motor joint='j' damping='1 2'/></actuator>"), "m.xml:4: ", "coefficients of higher order");
  refused(model("", "<actuator><general joint='j' dyntype='user'/></actuator>"), "m.xml:4: ", "use one of: none, integrator, filter");
  refused(model("", "<actuator><general joint='j' gaintype='pid'/></actuator>"), "m.xml:4: ", "use one of: fixed, affine, muscle");
  refused(model("", "<actuator><muscle joint='j'/></actuator>"), "m.xml:4: ", "needs the range of its length");
  refused(model("", "<actuator><muscle site='s' lengthrange='0 1'/></actuator>"), "m.xml:4: ", "unknown attribute 'site' of <muscle>");
  refused(model("", "<sensor><plugin/></sensor>"), "m.xml:4: ", "<sensor> <plugin>: plug-ins are not supported");
  refused(model("", "<sensor><clock delay='.1'/></sensor>"), "m.xml:4: ", "keeps no samples");
  refused(model("", "<sensor><clock nsample='4' interp='spline'/></sensor>"), "m.xml:4: ", "zoh, linear, cubic");
  refused(model("", "<sensor><user dim='1' nsample='4'/></sensor>"), "m.xml:4: ", "nsample");
  refused(model("", "<option integrator='discrete'/>"), "m.xml:4: ", "use implicitfast");
  refused(model("", "<option><flag diagexact='enable'/></option>"), "m.xml:4: ", "diagexact='enable'");
  refused("<robot/>", "m.xml:1: ", "an MJCF model is <mujoco>");
}

TEST_CASE("values are checked") {
  refused(model("<geom size='.1 x'/>"), "m.xml:3: ", "holds 'x', which is not a finite number");
  refused(model("<geom size='nan'/>"), "m.xml:3: ", "not a finite number");
  for (auto const& number : std::vector<std::string>{"1e400", "-1e400", "2e308", "+1e99999999999999999999", "1" + std::string(400, '0')})
    refused(model("<body pos='0 " + number + " 0'/>"), "m.xml:3: ", "which is beyond the largest number, 1.8e308; correct it");
  refused(model("<body pos='0 -1e400 0'/>"),
          "m.xml:3: ", "<body>: attribute 'pos' holds '-1e400', which is beyond the largest number, 1.8e308; correct it");
  refused(model("<geom size='1' friction='1e400'/>"),
          "m.xml:3: ", "attribute 'friction' holds '1e400', which is beyond the largest number");
  refused(model("", "<default><joint damping='1e400'/></default>"), "m.xml:", "attribute 'damping' holds '1e400', which is beyond");
  for (auto const* other : {"1e", "1e5x", "+-1", "+", "-", "0x10"})
    refused(model("<geom size='" + std::string(other) + "'/>"), "m.xml:3: ", "not a finite number");
  std::string const small = "0." + std::string(400, '0') + "1";
  auto const tiny = parse_mjcf(model("<body pos='1e-400 -1e-99999999999999999999 " + small + "'/>"), "m.xml", {});
  CHECK(tiny.bodies.back().pos == std::array<double, 3>{0, 0, 0});
  auto const wide = parse_mjcf(model("<body pos='1" + std::string(400, '0') + "e-400 1e-310 0e400'/>"), "m.xml", {});
  CHECK(wide.bodies.back().pos[0] == 1);
  CHECK(wide.bodies.back().pos[1] == 1e-310);
  CHECK(wide.bodies.back().pos[2] == 0);
  refused(model("<geom size='1 2 3 4'/>"), "m.xml:3: ", "has 4 numbers; give at most 3");
  refused(model("<geom size='1' pos='1 2'/>"), "m.xml:3: ", "attribute 'pos' has 2 numbers; give 3");
  refused(model("<geom size='1' condim='2.5'/>"), "m.xml:3: ", "not a whole number");
  refused(model("<geom size='1' condim='2'/>"), "m.xml:3: ", "condim other than 1, 3, 4, 6");
  refused(model("<geom size='1' type='ball'/>"), "m.xml:3: ", "give one of: plane, hfield, sphere");
  refused(model("<geom size='1' quat='1 0 0 0' euler='0 0 0'/>"), "m.xml:3: ", "more than one of quat");
  refused(model("<geom size='1' zaxis='0 0 0'/>"), "m.xml:3: ", "direction of length zero");
  refused(model("<geom type='capsule' size='.1' pos='1 0 0' fromto='0 0 0 0 0 1'/>"), "m.xml:3: ", "fromto' stands beside pos");
  refused(model("<geom size='1' fromto='0 0 0 0 0 1'/>"), "m.xml:3: ", "fromto' is for capsule");
  refused(model("<geom type='capsule' size='1' fromto='0 0 0 0 0 0'/>"), "m.xml:3: ", "two equal points");
  refused(model("<geom size='1' class='c'/>"), "m.xml:3: ", "default class 'c' does not exist");
  refused(model("<geom size='1' material='c'/>"), "m.xml:3: ", "which does not exist; correct the name");
  refused(model("<geom size='0'/>"), "m.xml:3: ", "size[0] <= 0");
  for (char const* size : {"", "size='0 0 0'", "size='1 1'", "size='1 1 -1'"})
    refused(model("<geom type='plane' " + std::string(size) + "/>"), "m.xml:3: ", "no positive third number");
  refused(model("<geom size='1' name='g'/>"), "m.xml:3: ", "name that is taken already");
  refused(model("<joint range='3 -3'/>"), "m.xml:3: ", "not in increasing order");
  refused(model("<freejoint/>"), "m.xml:3: ", "leaves nothing for the other joints");
  refused(model("<body><freejoint/></body>"), "m.xml:3: ", "not a child of the world");
  refused(model("<body name='x'><joint/></body>"), "m.xml:3: ", "body 'x' moves but has no mass");
  refused(model("<inertial pos='0 0 0' mass='1' diaginertia='1 1 3'/>"), "m.xml:2: ", "exceeds the sum of the others");
  refused(model("<inertial mass='1'/>"), "m.xml:3: ", "'pos' is missing");
  refused(model("", "<actuator><motor joint='k'/></actuator>"), "m.xml:4: ", "names the joint 'k', which does not exist");
  refused(model("", "<actuator><motor/></actuator>"), "m.xml:4: ", "needs one of joint, jointinparent, tendon, site");
  refused(model("", "<actuator><motor site='b'/></actuator>"), "m.xml:4: ", "names the site 'b', which does not exist");
  refused(model("", "<actuator><motor joint='j' refsite='b'/></actuator>"), "m.xml:4: ", "refsite' is for a transmission by site");
  refused(model("", "<actuator><motor cranksite='b'/></actuator>"), "m.xml:4: ", "slidersite' is missing");
  refused(model("", "<actuator><general joint='j' actrange='0 1'/></actuator>"),
          "m.xml:4: ", "actrange' is for actuators with an activation");
  refused(model("", "<actuator><adhesion body='b' ctrlrange='-1 1'/></actuator>"), "m.xml:4: ", "ctrlrange' has a negative number");
  refused(model("", "<actuator><damper joint='j'/></actuator>"), "m.xml:4: ", "not below the second");
  refused(model("", "<equality><connect body1='b'/></equality>"), "m.xml:4: ", "anchor' is missing");
  refused(model("", "<equality><connect site1='b'/></equality>"), "m.xml:4: ", "site2' is missing");
  refused(model("", "<equality><weld body1='b' site1='b'/></equality>"), "m.xml:4: ", "stands beside bodies");
  refused(model("", "<equality><weld body1='x'/></equality>"), "m.xml:4: ", "names the body 'x', which does not exist");
  refused(model("", "<equality><joint joint1='j' joint2='j'/></equality>"), "m.xml:4: ", "names 'j' twice");
  refused(model("", "<tendon><spatial/></tendon>"), "m.xml:4: ", "has no path");
  refused(model("<site name='s'/>", "<tendon><spatial><site site='s'/></spatial></tendon>"), "m.xml:4: ", "has a path of one item");
  refused(model("<site name='s'/>", "<tendon><spatial><site site='s'/><geom geom='g'/></spatial></tendon>"),
          "m.xml:4: ", "does not stand between two sites: add them (item 2");
  refused(model("<site name='s'/>", "<tendon><spatial><pulley divisor='0'/><site site='s'/><site site='s'/></spatial></tendon>"),
          "m.xml:4: ", "divisor is not positive");
  refused(model("", "<sensor><gyro site='x'/></sensor>"), "m.xml:4: ", "names the site 'x', which does not exist");
  refused(model("", "<sensor><gyro/></sensor>"), "m.xml:4: ", "does not say what it measures");
  std::string const parts = "<site name='s'/><camera name='c'/><body><joint name='q' type='ball'/><geom size='1'/></body>";
  refused(model(parts, "<sensor><gyro site='s' cutoff='-1'/></sensor>"), "m.xml:4: ", "negative cutoff");
  refused(model(parts, "<sensor><jointpos joint='q'/></sensor>"), "m.xml:4: ", "is about a hinge or slide joint");
  refused(model(parts, "<sensor><ballquat joint='j'/></sensor>"), "m.xml:4: ", "is about a ball joint");
  refused(model(parts, "<sensor><jointlimitpos joint='j'/></sensor>"), "m.xml:4: ", "of a joint that has none");
  refused(model(parts, "<sensor><camprojection site='s'/></sensor>"), "m.xml:4: ", "needs a camera: name one");
  refused(model(parts, "<sensor><distance geom1='g'/></sensor>"), "m.xml:4: ", "needs two objects");
  refused(model(parts, "<sensor><framepos objtype='joint' objname='j'/></sensor>"), "m.xml:4: ", "is about a body, geom, site or camera");
  refused(model(parts, "<sensor><framepos objtype='site' objname='s' reftype='joint' refname='j'/></sensor>"), "m.xml:4: ", "is seen from");
  refused(model(parts, "<sensor><framepos objtype='site' objname='s' refname='c'/></sensor>"), "m.xml:4: ", "'reftype' go together");
  refused(model(parts, "<sensor><framequat objtype='site' objname='s' cutoff='1'/></sensor>"), "m.xml:4: ", "has no cutoff");
  refused(model("<camera fovy='40' sensorsize='1 1' resolution='2 2'/>"), "m.xml:3: ", "stands beside sensorsize");
  refused(model("<camera sensorsize='1 1' resolution='2 2'/>"), "m.xml:3: ", "attribute 'sensorsize' needs a focal length above 0");
  refused(model("", "<contact><pair geom1='g'/></contact>"), "m.xml:4: ", "needs geom1 and geom2");
  refused(model("<camera target='x'/>"), "m.xml:3: ", "names the body 'x', which does not exist");
  refused(model("<body mocap='true'/>"), "m.xml:3: ", "fixed child of the world");
  refused(model("", "<asset><mesh name='m'/></asset>"), "m.xml:4: ", "file' is missing");
  refused(model("", "<asset><hfield name='h' nrow='3' ncol='3'/></asset>"), "m.xml:4: ", "size' is missing");
  refused(model("<geom type='mesh' mesh='x'/>"), "m.xml:3: ", "x");
  refused(model("<attach model='a' frame='b' prefix='c'/>"), "m.xml:3: ", "frame='b' is not supported yet");
  refused(model("", "<actuator><position joint='j' inheritrange='1'/></actuator>"), "m.xml:4: ", "inherits a range that 'j' does not have");
  refused(model("<geom size='1' surfacevel='1e11 0 0'/>"), "m.xml:3: ", "surfacevel' is beyond 1e10");
  refused(model("", "<tendon><fixed><joint joint='x' coef='1'/></fixed></tendon>"), "m.xml:4: ", "names the joint 'x'");
  refused(model("", "<contact><exclude body1='b' body2='x'/></contact>"), "m.xml:4: ", "names the body 'x'");
  refused(model("", "<keyframe><key qpos='1 2'/></keyframe>"), "m.xml:4: ", "has 2 numbers in qpos, and the model needs 1");
  refused(model("", "<compiler angle='grad'/>"), "m.xml:4: ", "give one of: radian, degree");
  refused(model("", "<option timestep='0'/>"), "m.xml:4: ", "timestep' is not positive");
  refused(model("", "<default><default/></default>"), "m.xml:4: ", "needs a class");
  refused(model("<replicate count='0'/>"), "m.xml:3: ", "below 1");
  refused(model("<attach model='x'/>"), "m.xml:3: ", "which no <asset> <model> has");
}

TEST_CASE("built-in meshes: what they may ask for") {
  auto const with = [](std::string const& attributes) {
    return model("<geom type='mesh' mesh='m' contype='0' conaffinity='0'/>", "<asset><mesh name='m' " + attributes + "/></asset>");
  };
  CHECK(message(with("builtin='cone' params='5 .3'")) == "accepted");
  for (auto const& [attributes, part] : std::vector<std::pair<std::string, std::string>>{
           {"builtin='none' params='1'", "is a built-in mesh 'none', which does not exist; use one of: sphere, hemisphere, cone"},
           {"builtin='sphere'", "has 0 numbers in params; give the number of subdivisions"},
           {"builtin='sphere' params='1.5'", "is not a whole number from 0 to 4"},
           {"builtin='hemisphere' params='11'", "is not a whole number from 0 to 10"},
           {"builtin='cone' params='2 1'", "is not a whole number from 3 to"},
           {"builtin='cone' params='3 1.1'", "has a radius out of its range"},
           {"builtin='supersphere' params='3 -1 1'", "has an exponent out of its range"},
           {"builtin='supersphere' params='100000 1 1'", "asks for more than a million vertices"},
           {"builtin='supertorus' params='3 0 1 1'", "has a radius out of its range"},
           {"builtin='wedge' params='3 3 181 40 0'", "has a horizontal angle out of its range"},
           {"builtin='wedge' params='1 3 18 40 0'", "has 3 vertices and a mesh needs at least 4"},
           {"builtin='grid' params='2 2 2 1 1 1 4'", "has a dimension that is not a whole number from 2 to 3"},
           {"builtin='grid' params='2 2 2 1 1 1 2'", "has a count that is not a whole number from 1 to 1"},
           {"builtin='square' params='2 2 1 1 1 1 2'", "has 7 numbers in params; give three counts and three spacings"},
           {"builtin='box' params='1 2 2 1 1 1'", "has a count that is not a whole number from 2 to"},
           {"builtin='box' params='2 2 2 1 1 1e300'", "is not finite or beyond 2^30"},
           {"builtin='sphere' params='1' vertex='0 0 0'", "stands beside file, vertex or face"},
           {"params='1' vertex='0 0 0'", "stands without builtin"}})
    refused(with(attributes), "m.xml:4: ", part);
}

TEST_CASE("the search for a muscle's range of length ends in a sentence, whatever it is asked") {
  auto const search = [](std::string const& settings, std::string const& joint = "") {
    return model("<body><joint name='m' " + joint + "/><geom size='.1' pos='.1 0 0'/></body>",
                 "<compiler><lengthrange " + settings + "/></compiler><actuator><muscle joint='m'/></actuator>");
  };
  refused(search("accel='-1'"), "m.xml:4: ", "'accel' is negative");
  refused(search("timestep='1e-6'"), "m.xml:4: ", "takes more than a million steps");
  refused(search("inttotal='1e300'"), "m.xml:4: ", "takes more than a million steps");
  refused(search(""), "m.xml:4: ", "does not settle");
  refused(search("accel='1e300'"), "m.xml:4: ", "is unstable");
  refused(search("accel='0'"), "m.xml:4: ", "finds no range");
  CHECK(message(search("", "range='-30 50'")) == "accepted");
  CHECK(message(search("mode='none'")) == "accepted");
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

TEST_CASE("visual meshes that are missing are left out when asked, colliding ones never") {
  std::string const visual = "<geom type='mesh' mesh='x' contype='0' conaffinity='0'/>";
  std::string const weighed =
      "<mujoco>\n<asset><mesh name='x' file='x.stl'/></asset><worldbody><body><joint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>";
  std::string const end = "</body></worldbody></mujoco>";
  refused(
      weighed + visual + end, "m.xml:2: ",
      "x.stl: there is no such file; check the path, or leave out geoms that are only seen with MjcfOptions::skip_visuals (--skip-visuals)",
      files({}));
  auto skip = files({});
  skip.skip_visuals = true;
  auto const d = parse_mjcf(weighed + visual + visual + end, "m.xml", skip);
  CHECK(d.bodies[1].geoms.empty());
  CHECK(lines(d, ReportLine::Kind::left_out, "visual geoms whose mesh is missing") == 2);
  CHECK(lines(d, ReportLine::Kind::left_out, "asset 'x': x.stl cannot be read") == 1);
  CHECK(compile(d).body_mass[1] == 1);
  refused(weighed + "<geom type='mesh' mesh='x'/>" + end, "m.xml:2: ", "x.stl", skip);
  refused(weighed + "<geom type='box' mesh='x'/>" + end, "m.xml:2: ", "x.stl", skip);
  // the body's mass would come from the mesh
  std::string const light = "<mujoco><asset><mesh name='x' file='x.stl'/></asset><worldbody><body name='b'><joint/><geom size='.1'/>";
  refused(light + visual + end, "m.xml:1: ", "the mass of body 'b' comes from this visual mesh", skip);
  CHECK(message(light + "<geom type='mesh' mesh='x' contype='0' conaffinity='0' mass='0'/>" + end, skip) == "accepted");
  // with the refusals listed, all of the file is read
  auto listed = files({});
  listed.list_refusals = true;
  CHECK(lines(parse_mjcf(weighed + visual + end, "m.xml", listed), ReportLine::Kind::refused, "") == 2);
}

TEST_CASE("a skin is seen only: one line, whatever it holds, also where its file is missing and no body has its bones' names") {
  std::string const bones = "<bone body='nobody' bindpos='0 0 0' bindquat='1 0 0 0' vertid='0 1' vertweight='1 1'/><bone body='none'/>";
  for (char const* section : {"deformable", "asset"}) {
    CAPTURE(section);
    std::string const open = std::string("<") + section + ">", close = std::string("</") + section + ">";
    auto const d = parse_mjcf(model("", open + "<skin name='s' rgba='1 0 0 1' vertex='0 0 0'>" + bones + "</skin>" + close), "m.xml");
    REQUIRE(d.report.size() == 1);
    CHECK(d.report[0].kind == ReportLine::Kind::visual_only);
    CHECK(d.report[0].text == "<skin>");
    CHECK(d.report[0].line == 4);
    CHECK(d.report[0].count == 1);
    CHECK(compile(d).nbody == 2);
    auto const two =
        parse_mjcf(model("", open + "<skin file='missing.skn'/><skin file='b.skn'>" + bones + "</skin>" + close), "m.xml", files({}));
    REQUIRE(two.report.size() == 1);
    CHECK(two.report[0].count == 2);
  }
}

// A sensor that is read and never computed is not silent; a user's is the user's.
TEST_CASE("sensors that are not computed are told") {
  auto const d = parse_mjcf(model("<site name='s'/><geom name='g' size='1'/>",
                                  "<sensor><gyro site='s'/><tactile geom='g' mesh='m'/><rangefinder site='s'/><touch site='s'/>"
                                  "<distance body1='world' body2='world'/>\n"
                                  "<tactile geom='g' mesh='m'/><accelerometer site='s'/><user dim='1'/></sensor>"),
                            "m.xml");
  REQUIRE(d.report.size() == 1);
  CHECK(d.report[0].kind == ReportLine::Kind::no_effect);
  CHECK(d.report[0].text.find("tactile: ") == 0);
  CHECK(d.report[0].count == 2);
}

TEST_CASE("settings of sensors that do nothing, and distances to height fields, are told; empty data is none") {
  auto const d = parse_mjcf(model("<body name='hills'><geom type='hfield' hfield='h'/></body>",
                                  "<asset><hfield name='h' nrow='2' ncol='2' size='1 1 1 1'/></asset><sensor><clock interp='cubic'/><clock "
                                  "interp='cubic' nsample='4'/>"
                                  "<contact geom1='g' data=''/><distance name='far' geom1='g' body2='hills'/></sensor>"),
                            "m.xml");
  CHECK(lines(d, ReportLine::Kind::no_effect, "clock: interp acts where samples are kept alone; give nsample") == 1);
  auto const m = compile(d);
  CHECK(m.sensor_dim == std::vector<int>{1, 1, 1, 1});
  REQUIRE(m.report.size() == 2);
  CHECK(m.report[1].text ==
        "sensor 'far' of type 'distance': body 'hills' has a height field, which has no distance, and nothing is computed; name geoms");
}

TEST_CASE("every pair of shapes and every condim is taken") {
  std::string const scene =
      "<mujoco><worldbody><geom type='plane' size='1 1 1'/>\n<body><freejoint/><geom type='cylinder' size='.1 .1' condim='6'/></body>\n"
      "<body pos='1 0 0'><freejoint/><geom name='c' type='cylinder' size='.1 .1'/></body></worldbody></mujoco>";
  auto const m = compile(parse_mjcf(scene, "m.xml"));
  CHECK(m.pairs.size() == 3);
  CHECK(m.geom_condim == std::vector<int>{3, 6, 3});
  CHECK(m.report.empty());
}

TEST_CASE("pairs of shapes and condim are not judged where there are no contacts: they stay as the file says") {
  for (char const* flag : {"contact", "constraint"}) {
    CAPTURE(flag);
    auto const m =
        compile(parse_mjcf("<mujoco><option><flag " + std::string(flag) +
                               "='disable'/></option><worldbody><geom type='plane' size='1 1 1'/>"
                               "<body><freejoint/><geom type='ellipsoid' size='.1 .1 .2' condim='6'/></body></worldbody></mujoco>",
                           "m.xml"));
    CHECK(m.pairs == std::vector<std::array<int, 2>>{{0, 1}});
    CHECK(m.geom_condim == std::vector<int>{3, 6});
    CHECK(m.report.empty());
  }
}

TEST_CASE("the report lists what has no effect, with file, line and count") {
  auto const d = parse_mjcf(
      "<mujoco>\n<option solver='CG' cone='elliptic'/><visual><map zfar='3'/></visual>\n<worldbody><light/><light pos='0 0 "
      "1'/>\nstray<camera mode='track'/></worldbody>"
      "<sensor><clock/><clock/></sensor></mujoco>",
      "m.xml");
  CHECK(lines(d, ReportLine::Kind::no_effect, "<option> solver") == 1);
  CHECK(lines(d, ReportLine::Kind::mujoco_only, "<option> cone (profile stable does without)") == 1);
  CHECK(lines(d, ReportLine::Kind::visual_only, "<map> zfar") == 1);
  CHECK(lines(d, ReportLine::Kind::visual_only, "<light>") >= 2);
  CHECK(d.bodies[0].cameras[0].mode == CameraMode::track);
  CHECK(d.sensors.size() == 2);
  CHECK(lines(d, ReportLine::Kind::no_effect, "text between elements") == 1);
  for (auto const& l : d.report) CHECK(l.file == "m.xml");
  CHECK(d.report[0].line == 2);
}

// Of soft contacts neither is asked: what is given without hard is one line, wherever it comes from.
TEST_CASE("a restitution without hard is a line of the report") {
  auto const report = [](std::string const& geom, std::string const& class_of_all = "") {
    return parse_mjcf("<mujoco>\n<default><geom " + class_of_all + "/></default><worldbody>\n<geom size='1' " + geom +
                          "/><geom size='1'/></worldbody></mujoco>",
                      "m.xml")
        .report;
  };
  for (char const* given : {"restitution='.5'", "_bounciness='.5'", "erp='.1'", "_erp='.2'", "erp='.1' restitution='.1'"}) {
    CAPTURE(given);
    auto const lines = report(given);
    REQUIRE(lines.size() == 1);
    CHECK(lines[0].kind == ReportLine::Kind::no_effect);
    CHECK(lines[0].line == 3);
    CHECK(lines[0].text == "<geom> restitution and erp without hard (a soft geom has neither: give hard=\"true\")");
    auto const hard = report(std::string("hard='true' ") + given);  // MuJoCo has none of the three
    REQUIRE(hard.size() == 1);
    CHECK(hard[0].kind == ReportLine::Kind::stable_only);
    CHECK(hard[0].text == "<geom> hard, restitution and erp (profile mujoco does without)");
    CHECK(report(std::string("hard='false' ") + given).size() == 1);
    CHECK(report("", given).at(0).count == 2);
  }
  CHECK(report("restitution='0'").empty());
  CHECK(report("_hard='true'", "restitution='.5' _hard='true'").at(0).count == 2);
}

// Rigid limits, equalities and pairs are read, by classes too, written, and read again the same; without hard the rest is a line each.
TEST_CASE("rigid limits, equalities and pairs") {
  std::string const text =
      R"(<mujoco><default><joint hardlimit="true" erplimit=".3"/><equality erp=".5"/><pair hard="true" restitution=".25"/>
    </default><worldbody><body name="a"><joint name="j" type="slide" range="-1 1" limited="true" restitutionlimit=".5"/>
    <joint name="k" type="hinge" hardlimit="false"/><geom name="g" size="1"/></body><body name="b"><freejoint/><geom name="h" size="1"/>
    </body></worldbody><contact><pair geom1="g" geom2="h" erp=".1"/></contact><equality><weld body1="a" body2="b" hard="true"/>
    <joint joint1="j" joint2="k"/></equality><tendon><fixed name="t" limited="true" range="0 1" hardlimit="true"><joint joint="j" coef="1"/>
    </fixed></tendon></mujoco>)";
  gsp_test::Folder const folder;
  auto const first = parse_mjcf(text, "m.xml");
  io::write_mjcf(folder.path / "out.xml", first);
  for (auto const& d : {first, io::read_mjcf(folder.path / "out.xml")}) {
    auto const is = [](RigidDescription const& r, bool hard, double restitution, double erp) {
      return r.hard == hard && r.restitution == restitution && r.erp == erp;
    };
    CHECK(is(d.bodies[1].joints[0].rigid_limit, true, 0.5, 0.3));
    CHECK(is(d.bodies[1].joints[1].rigid_limit, false, 0, 0.3));
    CHECK(is(d.equalities[0].rigid, true, 0, 0.5));
    CHECK(is(d.equalities[1].rigid, false, 0, 0.5));
    CHECK(is(d.tendons[0].rigid_limit, true, 0, 0.2));
    CHECK(is(d.pairs[0].rigid, true, 0.25, 0.1));
    auto const compiled = gsp::compile(d);
    CHECK(compiled.jnt_rigid[0] == gsp::Double3{1, 0.5, 0.3});
    CHECK(compiled.eq_rigid[0] == gsp::Double3{1, 0, 0.5});
    CHECK(compiled.tendon_rigid[0] == gsp::Double3{1, 0, 0.2});
    CHECK(compiled.named_pairs[0].rigid.hard);
  }
  auto const said = [&](std::string const& what) {
    return lines(first, ReportLine::Kind::no_effect, what) + lines(first, ReportLine::Kind::stable_only, what);
  };
  CHECK(said("<joint> hardlimit, restitutionlimit and erplimit (profile mujoco does without)") == 1);
  CHECK(said("<joint> restitutionlimit and erplimit without hardlimit") == 1);
  CHECK(said("<weld> hard, erp (profile mujoco does without)") == 1);
  CHECK(said("<joint> erp without hard (give hard=\"true\")") == 1);
  CHECK(said("<pair> hard, restitution and erp (profile mujoco does without)") == 1);
  CHECK(said("<fixed> hardlimit, restitutionlimit and erplimit (profile mujoco does without)") == 1);
}

TEST_CASE("faces of an OBJ file that are not taken stand in the report, with the place of the mesh and theirs") {
  auto const d = parse_mjcf("<mujoco>\n<asset>\n<mesh name='two' file='two.obj'/></asset></mujoco>", "m.xml",
                            files({{"two.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\ng second\nf 1 2 4\n"}}));
  REQUIRE(d.report.size() == 1);
  CHECK(d.report[0].kind == ReportLine::Kind::left_out);
  CHECK(d.report[0].file == "m.xml");
  CHECK(d.report[0].line == 3);
  CHECK(d.report[0].text ==
        "mesh 'two': two.obj: line 7: faces from here on (1) belong to further objects or groups and are ignored, as MuJoCo does");
}

TEST_CASE("with list_refusals the whole file is read and every refusal is a line") {
  auto const d = parse_mjcf(model("<geom size='.1' type='sdf' mesh='x'/><composite/>",
                                  "<equality><flex flex='f'/></equality><actuator><pid joint='j'/></actuator>"),
                            "m.xml", {.list_refusals = true});
  CHECK(lines(d, ReportLine::Kind::refused, "") == 4);
  CHECK(d.bodies[1].geoms.size() == 2);
  CHECK(d.actuators.empty());
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
