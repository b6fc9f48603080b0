#include <doctest/doctest.h>

#include <cstdlib>
#include <gsp/io/file.hpp>
#include <gsp/io/splat_transform.hpp>
#include <gsp/io/usda.hpp>
#include <io/fixtures.hpp>
#include <support/skip.hpp>

using namespace gsp::io;
using namespace gsp_test;

namespace {

/// Two Gaussians of degree 1 in the body of a prim.
std::string const body = R"(
    point3f[] positions = [(1, 2, 3), (-1.5, 2e-1, +0.25)]
    quatf[] orientations = [(1, 0, 0, 0), (0.5, 0.5, -0.5, 0.5)]
    float3[] scales = [(0.1, 0.2, 0.3), (1, 2, 3),]
    float[] opacities = [0.25, 1]
    uniform int radiance:sphericalHarmonicsDegree = 1
    float3[] radiance:sphericalHarmonicsCoefficients = [(1, 2, 3), (4, 5, 6), (7, 8, 9), (10, 11, 12),
        (-1, -2, -3), (-4, -5, -6), (-7, -8, -9), (-10, -11, -12)]
)";
std::string def(std::string const& inside, std::string const& head = "") {
  return "#usda 1.0\n" + head + "def ParticleField3DGaussianSplat \"g\" {" + inside + "}\n";
}
SplatSet parse(std::string const& text) { return parse_usda(bytes_of(text), "a.usda"); }
std::string refusal(std::string const& text) {
  return error_of([&] { parse(text); });
}
/// `body` as it is in its own axes.
SplatSet plain() {
  SplatSet s = make_splat_set(2, 1);
  s.positions = {1, 2, 3, -1.5f, .2f, .25f};
  s.quats = {1, 0, 0, 0, .5f, .5f, -.5f, .5f};
  s.scales = {.1f, .2f, .3f, 1, 2, 3};
  s.opacities = {.25f, 1};
  for (int k = 0; k < 24; ++k) s.sh[std::size_t(k)] = float(k < 12 ? k + 1 : 11 - k);
  return s;
}
/// Half a turn about x, by `transform`; rotations then differ by a half turn of the Gaussian's own axes, so they are compared elsewhere.
SplatSet turned(SplatSet s) {
  transform(s, {{0, 0, 0}, {0, 1, 0, 0}, 1});
  return s;
}
void check_close(SplatSet const& a, SplatSet const& b) {
  auto const d = apart(a, b);
  CHECK(d.position <= 1e-5);
  CHECK(d.log_scale <= 1e-6);
  CHECK(d.opacity == 0);
  CHECK(d.dc == 0);
  CHECK(d.sh <= 1e-5);
}

}  // namespace

TEST_CASE("usda: a file by hand, axes changed") {
  auto const s = parse(def(body));
  check_close(s, turned(plain()));
  CHECK(s.sh_degree == 1);
  CHECK(s.positions == std::vector<float>{1, -2, -3, -1.5f, -.2f, -.25f});
  CHECK(s.quats == std::vector<float>{1, 0, 0, 0, .5f, .5f, .5f, -.5f});
  CHECK(s.notes.empty());
  // z up: x, forward y, up z -> x, down -z, forward y
  auto const z_up = parse(def(body, "(\n  upAxis = \"Z\"  # comment\n  metersPerUnit = 0.01\n)\n"));
  CHECK(z_up.positions[1] == doctest::Approx(-3));
  CHECK(z_up.positions[2] == doctest::Approx(2));
  REQUIRE(z_up.notes.size() == 1);
  CHECK(says(z_up.notes[0], "its unit of length is 0.010000 m"));
}

TEST_CASE("usda: what is written comes back") {
  Folder folder;
  for (int degree = 0; degree <= 3; ++degree) {
    auto const set = random_set(60, degree, 3);
    write_usda(folder.path / "a.usda", set);
    auto const again = read_usda(folder.path / "a.usda");
    CHECK(again.positions == set.positions);
    CHECK(again.scales == set.scales);
    CHECK(again.opacities == set.opacities);
    CHECK(again.sh == set.sh);
    CHECK(apart(again, set).rotation <= 0x1p-22);
  }
}

TEST_CASE("usda: the OpenUSD library reads ours and we read its" * doctest::test_suite("data")) {
  char const* const given = std::getenv("GSP_PYTHON");
  std::string const python = given ? given : "python3";
  if (std::system((python + " -c 'from pxr import UsdVol; UsdVol.ParticleField3DGaussianSplat' >/dev/null 2>&1").c_str()) != 0) {
    gsp_test::skip("python3 has no OpenUSD >= 26.03 (usd-core from PyPI; GSP_PYTHON names another python)");
    return;
  }
  Folder folder;
  auto const set = random_set(40, 2, 5);
  write_usda(folder.path / "ours.usda", set);
  std::ofstream(folder.path / "check.py") << R"(
import sys
from pxr import Usd, UsdGeom, UsdVol, Vt
folder = sys.argv[1]
stage = Usd.Stage.Open(folder + '/ours.usda')
assert UsdGeom.GetStageUpAxis(stage) == 'Y' and UsdGeom.GetStageMetersPerUnit(stage) == 1
ours = UsdVol.ParticleField3DGaussianSplat(stage.GetDefaultPrim())
assert ours
names = ['positions', 'orientations', 'scales', 'opacities', 'radiance:sphericalHarmonicsDegree', 'radiance:sphericalHarmonicsCoefficients']
values = [ours.GetPrim().GetAttribute(n).Get() for n in names]
assert len(values[0]) == 40 and len(values[5]) == 40 * 9 and values[4] == 2
out = Usd.Stage.CreateNew(folder + '/theirs.usda')
UsdGeom.SetStageUpAxis(out, 'Y')
above = UsdGeom.Xform.Define(out, '/above')
above.AddTranslateOp().Set((1, 2, 3))
above.AddRotateXYZOp().Set((30, 40, 50))
prim = UsdVol.ParticleField3DGaussianSplat.Define(out, '/above/splats')
UsdGeom.Xformable(prim).AddScaleOp().Set((2, 2, 2))
for n, v in zip(names, values):
    prim.GetPrim().GetAttribute(n).Set(v)
out.GetRootLayer().Save()
m = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
with open(folder + '/points.txt', 'w') as f:
    for p in values[0]:
        q = m.Transform(p)
        f.write('%r %r %r\n' % (q[0], q[1], q[2]))
)";
  REQUIRE(std::system((python + " '" + (folder.path / "check.py").string() + "' '" + folder.path.string() + "'").c_str()) == 0);
  auto const theirs = read_usda(folder.path / "theirs.usda");
  REQUIRE(theirs.size() == 40);
  std::ifstream points(folder.path / "points.txt");
  for (std::size_t i = 0; i < 40; ++i) {
    double p[3];
    points >> p[0] >> p[1] >> p[2];
    for (std::size_t k = 0; k < 3; ++k) CHECK(theirs.positions[3 * i + k] == doctest::Approx(k ? -p[k] : p[k]).epsilon(1e-5));
    CHECK(theirs.scales[3 * i] == doctest::Approx(2 * set.scales[3 * i]));
  }
  CHECK(theirs.sh[0] == set.sh[0]);
}

TEST_CASE("usda: prims move what they hold") {
  auto const text = [](std::string const& outer, std::string const& inner) {
    return "#usda 1.0\ndef Xform \"a\" (kind = \"group\") {\n" + outer + "\ndef ParticleField3DGaussianSplat \"g\" {" + inner + body +
           "} def Camera \"c\" { double3 xformOp:translate.timeSamples = { 0: (1, 2, 3) } } }\n";
  };
  auto expected = [](std::vector<SplatPose> const& poses) {
    auto s = plain();
    for (auto const& p : poses) transform(s, p);
    return turned(s);
  };
  double const h = std::sqrt(0.5);
  check_close(parse(text("", "double3 xformOp:translate = (1, 2, 3)\nuniform token[] xformOpOrder = [\"xformOp:translate\"]")),
              expected({{{1, 2, 3}, {1, 0, 0, 0}, 1}}));
  check_close(parse(text("double3 xformOp:translate = (1, 2, 3) float xformOp:rotateZ = 90 float3 xformOp:scale = (2, 2, 2) uniform "
                         "token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:rotateZ\", 'xformOp:scale']",
                         "quatf xformOp:orient = (0.6, 0, 0.8, 0)\nuniform token[] xformOpOrder = [\"xformOp:orient\",]")),
              expected({{{0, 0, 0}, {0.6, 0, 0.8, 0}, 1}, {{1, 2, 3}, {h, 0, 0, h}, 2}}));
  check_close(parse(text("matrix4d xformOp:transform = ( (0, 2, 0, 0), (-2, 0, 0, 0), (0, 0, 2, 0), (1, 2, 3, 1) )\nuniform token[] "
                         "xformOpOrder = [\"xformOp:transform\"]",
                         "")),
              expected({{{1, 2, 3}, {h, 0, 0, h}, 2}}));
  check_close(parse(text("float3 xformOp:rotateXYZ = (90, 0, 90) uniform token[] xformOpOrder = [\"xformOp:rotateXYZ\"]", "")),
              expected({{{0, 0, 0}, {h, h, 0, 0}, 1}, {{0, 0, 0}, {h, 0, 0, h}, 1}}));
  check_close(parse(text("double3 xformOp:translate:pivot = (1, 0, 0) float xformOp:rotateZ = 90 uniform token[] xformOpOrder = "
                         "[\"xformOp:translate:pivot\", \"xformOp:rotateZ\", \"!invert!xformOp:translate:pivot\"]",
                         "")),
              expected({{{-1, 0, 0}, {1, 0, 0, 0}, 1}, {{1, 0, 0}, {h, 0, 0, h}, 1}}));
  check_close(parse(text("double3 xformOp:translate = (1, 2, 3) uniform token[] xformOpOrder = [\"xformOp:translate\"]",
                         "uniform token[] xformOpOrder = [\"!resetXformStack!\"]")),
              expected({}));
  check_close(parse(text("double3 xformOp:translate = (1, 2, 3)", "")), expected({}));  // not in the order
  CHECK(says(refusal(text("float3 xformOp:scale = (1, 1, 2) uniform token[] xformOpOrder = [\"xformOp:scale\"]", "")),
             "prim 'g' (line 4): it or a prim above it scales or shears"));
  CHECK(says(refusal(text("uniform token[] xformOpOrder = [\"xformOp:scale\"]", "")),
             "prim 'a' (line 2): 'xformOp:scale' is in xformOpOrder and has no value"));
  CHECK(says(refusal(text("float3 xformOp:spin = (1, 1, 2) uniform token[] xformOpOrder = [\"xformOp:spin\"]", "")),
             "'xformOp:spin' is no operation that is known here"));
  CHECK(says(refusal(text("float2 xformOp:scale = (1, 2) uniform token[] xformOpOrder = [\"xformOp:scale\"]", "")), "must have 3 numbers"));
  CHECK(says(
      refusal(text("double3 xformOp:translate.timeSamples = { 0: (1, 2, 3) } uniform token[] xformOpOrder = [\"xformOp:translate\"]", "")),
      "line 3: 'xformOp:translate' changes in time"));
}

TEST_CASE("usda: what stands round it, and what is left out") {
  auto const s = parse(R"(#usda 1.0
(
    "a comment"
    doc = """several
lines with a } in them"""
    customLayerData = { string a = "x" ; dictionary b = { int c = 1 } }
    subLayers = [ @other.usda@ ]
)
/* a comment
of two lines */
over "elsewhere" { def ParticleField3DGaussianSplat "x" { point3f[] positions = [(1, 2, 3)] } }
class "c" { }
def Xform "a" ( prepend apiSchemas = ["X"] prepend references = @b.usda@</c> ) {
  custom string note = 'it\'s'
  rel material:binding = </a/b> ( bindMaterialAs = "x" )
  float[] curve.timeSamples = { 0: [1, 2], 10: None, }
  asset f = @@@a@b@@@
  reorder nameChildren = ["g"]
  variantSet "v" = { "one" { def Sphere "s" { } } }
  def ParticleField3DGaussianSplat "off" ( active = false ) { point3f[] positions = [(1, 2)] }
  def ParticleField3DGaussianSplat "g" {)" +
                       body + R"(
    float3[] extent = [(0, 0, 0), (1, 1, 1)] ( doc = "x" )
    token projectionModeHint = "perspective";
    def PointInstancer "p" { point3f[] positions = [(0, 0), 0] }
  } }
)");
  check_close(s, turned(plain()));
  REQUIRE(s.notes.size() == 2);
  CHECK(says(s.notes[0], "other files or prims"));
  CHECK(says(s.notes[1], "variants"));
  // halves, and what the schema says of attributes that are missing or longer
  auto const halves =
      parse(def("point3h[] positionsh = [(1, 2, 3)] half3[] scalesh = [(1, 1, 1), (2, 2, 2)] quath[] orientations = None half[] opacitiesh "
                "= [0.5] float3[] scales = None"));
  CHECK(halves.size() == 1);
  CHECK(halves.scales[0] == 1);
  CHECK(halves.sh == std::vector<float>{0, 0, 0});
  CHECK(halves.notes.size() == 3);
  CHECK(parse(def("point3f[] positions = [(1, 2, 3)]")).opacities[0] == 1);
  CHECK(parse(def(body) + "def ParticleField3DGaussianSplat \"h\" {" + body + "}").size() == 4);
}

TEST_CASE("usda: bad input") {
  CHECK(accepted_truncations(bytes_of(def(body)), [](Bytes b) { parse_usda(b, "cut.usda"); }) <= 1);  // the last line break
  auto with = [](std::string const& what, std::string const& instead) {
    auto text = def(body);
    return refusal(text.replace(text.find(what), what.size(), instead));
  };
  CHECK(with("1, 2, 3", "1, 2, 3").empty());
  CHECK(says(with("#usda", "#sdf"), "line 1: does not start with '#usda'"));
  CHECK(says(with("(1, 2, 3)", "(1, 2)"), "line 3: needs ',' between numbers and has ')'"));
  CHECK(says(with("(1, 2, 3)", "(1, 2, x)"), "line 3: needs a number and has 'x'"));
  CHECK(says(with("(1, 2, 3)", "(1, 2, nan)"), "prim 'g' (line 2): Gaussian 0: position has a value that is not finite"));
  CHECK(says(with("(1, 2, 3)", "(1, 2, 1e99)"), "Gaussian 0: position has a value that is not finite"));
  CHECK(says(with("(1, 2, 3), (-1.5", "(1, 2, 3) (-1.5"), "line 3: needs ',' or ']'"));
  CHECK(says(with("[0.25, 1]", "[0.25]"), "opacities has 1 elements for 2 positions"));
  CHECK(says(with("[0.25, 1]", "[0.25, 1.5]"), "Gaussian 1: opacity is outside 0..1"));
  CHECK(says(with("Degree = 1", "Degree = 2"), "where SH degree 2 of 2 positions needs 18"));
  CHECK(says(with("Degree = 1", "Degree = 4"), "must be 0, 1, 2 or 3"));
  CHECK(says(with("uniform int radiance:sphericalHarmonicsDegree = 1", ""), "where SH degree 3"));  // what the schema says
  CHECK(says(with("(1, 0, 0, 0)", "(0, 0, 0, 0)"), "its rotation has length 0"));
  CHECK(says(with("(0.1, 0.2", "(-0.1, 0.2"), "a scale is negative"));
  CHECK(says(with("positions =", "positions.timeSamples ="), "line 3: 'positions' changes in time"));
  CHECK(says(with("positions", "points"), "has no positions"));
  CHECK(says(with("ParticleField3DGaussianSplat", "Points"), "holds no prim of type ParticleField3DGaussianSplat"));
  CHECK(says(with("def", "class"), "holds no prim of type"));
  CHECK(says(with("}", "}}"), "has a '}' that nothing opens"));
  CHECK(says(with("}", ""), "prim 'g' (line 2) has no end"));
  CHECK(says(with("\"g\"", "g"), "needs the name of a prim in quotes"));
  CHECK(says(with("\"g\"", "\"g"), "a text in quotes has no end"));
  CHECK(says(refusal(def(body, "(upAxis = \"X\")\n")), "upAxis is 'X', and must be Y or Z"));
  CHECK(says(refusal(def(body, "(metersPerUnit = 0)\n")), "metersPerUnit must be a positive number"));
  CHECK(says(refusal("#usda 1.0\n" + std::string(100000, '(')), "line 2"));
  CHECK(says(refusal("#usda 1.0\ndef \"a\" { float x = " + std::string(100000, '(')), "ends inside of a value"));
  std::string deep = "#usda 1.0\n";
  for (int k = 0; k < 20000; ++k) deep += "def \"a\" {";
  CHECK(says(refusal(deep), "has no end"));
}

TEST_CASE("usda: mutated files") {
  std::vector<std::vector<std::byte>> const seeds{
      bytes_of(def(body)), bytes_of(format_usda(random_set(2, 1))),
      bytes_of(def(body + "float3 xformOp:rotateXYZ = (9, 0, 9) uniform token[] xformOpOrder = [\"xformOp:rotateXYZ\"]",
                   "(upAxis = \"Z\" doc = \"a\")\n"))};
  check_mutations(seeds, 4000, [](Bytes b) { return parse_usda(b, "m.usda"); });
}
