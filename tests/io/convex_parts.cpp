// Meshes that are not convex as convex parts: what they cover, what rests in them, what they weigh, and the cache. CoACD is fetched when
// the project is configured; without it what needs it is skipped.
#include <doctest/doctest.h>

#include <cstdlib>
#include <fstream>
#include <gsp/io/convex_parts.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/mesh_hull.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/ray/ray_scene.hpp>
#include <gsp/sensor/read_sensors.hpp>
#include <io/mesh_fixtures.hpp>
#include <support/skip.hpp>

#include "support/kernels.hpp"

using namespace gsp;

namespace {

/// A folder that goes with the test.
struct Folder {
  std::filesystem::path path = std::filesystem::temp_directory_path() / ("gsp_convex_parts_" + std::to_string(std::random_device{}()));
  ~Folder() {
    std::error_code none;
    std::filesystem::remove_all(path, none);
  }
};
/// A U in the plane of x and z, 3 wide, 3 high, walls of 1, from y = -0.5 to 0.5: its notch is x from 1 to 2, z from 1 to 3.
gsp_test::Soup u_mesh() {
  float const at[8][2] = {{0, 0}, {3, 0}, {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}};
  gsp_test::Soup s;
  for (float const y : {0.5f, -0.5f})
    for (auto const& p : at) s.vertices.push_back({p[0], y, p[1]});
  auto const side = [&](int a, int b, int c, int d) {  // at y = -0.5, seen from there; and its like at 0.5
    for (auto const& f : {std::array{a, b, c}, std::array{a, c, d}}) {
      s.faces.push_back({f[0] + 8, f[1] + 8, f[2] + 8});
      s.faces.push_back({f[0], f[2], f[1]});
    }
  };
  side(0, 5, 6, 7), side(0, 1, 4, 5), side(1, 2, 3, 4);
  for (int i = 0; i < 8; ++i) {
    int const j = (i + 1) % 8;
    s.faces.push_back({i, j, j + 8}), s.faces.push_back({i, j + 8, i + 8});
  }
  return s;
}
MeshDescription mesh_of(gsp_test::Soup const& s, std::string const& name) {
  MeshDescription mesh;
  mesh.name = name, mesh.vertices = s.vertices, mesh.faces = s.faces;
  return mesh;
}
std::string text_of(gsp_test::Soup const& s, std::string const& what) {
  std::string vertices, faces;
  for (auto const& v : s.vertices)
    for (float const x : v) vertices += std::to_string(x) + " ";
  for (auto const& f : s.faces)
    for (int const i : f) faces += std::to_string(i) + " ";
  return "<mujoco><asset><mesh name=\"u\" scale=\"0.1 0.1 0.1\" vertex=\"" + vertices + "\" face=\"" + faces + "\"/></asset><worldbody>" +
         what + "</worldbody></mujoco>";
}
/// Whether the machine has CoACD; says what is missing where not.
bool has_coacd(Folder const& folder) {
  try {
    io::convex_parts(mesh_of(u_mesh(), "u"), "mesh 'u'", {.cache = folder.path});
  } catch (Error const& e) {
    if (std::string(e.what()).find("CoACD was not found") == std::string::npos) throw;
    gsp_test::skip(e.what());
    return false;
  }
  return true;
}
/// How far a point is outside of the hull of a part, along the worst of its faces; negative inside.
double outside(MeshDescription part, Vec3<double> const& p) {
  io::add_hull(part, "part");
  double far = -1e300;
  for (auto const& f : part.hull) {
    auto const at = [&](int i) {
      auto const& v = part.vertices[std::size_t(f[std::size_t(i)])];
      return Vec3<double>{v[0], v[1], v[2]};
    };
    auto const n = cross(at(1) - at(0), at(2) - at(0));
    if (norm(n) > 0) far = std::max(far, dot(n, p - at(0)) / norm(n));
  }
  return far;
}
double nearest(std::vector<MeshDescription> const& parts, Vec3<double> const& p) {
  double least = 1e300;
  for (auto const& part : parts) least = std::min(least, outside(part, p));
  return least;
}
/// Height of a ball of 4 cm that is dropped into the notch, after two seconds.
double height_of_ball(CompiledModel const& m) {
  Kokkos::DefaultHostExecutionSpace const exec;  // whose kernels are compiled
  auto const model = make_model<double>(exec, m);
  auto state = make_state(exec, model, {.worlds = 1});
  auto sim = make_simulation<double>(exec, model, m, {.worlds = 1});
  step(exec, model, state, sim, {.steps = 1000});
  return state.qpos(0, 2);
}
char const* const ball = R"(<geom name="u" type="mesh" mesh="u"/>
  <body pos="0.15 0 0.4"><freejoint/><geom type="sphere" size="0.04"/></body>)";

}  // namespace

TEST_CASE("parts cover the mesh and leave its notch open" * doctest::test_suite("data")) {
  Folder const folder;
  if (!has_coacd(folder)) return;
  auto const u = u_mesh();
  auto const parts = io::convex_parts(mesh_of(u, "u"), "mesh 'u'", {.cache = folder.path});
  CHECK(parts.size() >= 3);
  // The threshold bounds what concavity is left, as a share of the mesh's size, 3: what a part may fill or leave open.
  double const tolerance = 0.05 * 3;
  double worst = 0;
  std::mt19937 random(1);
  for (auto const& f : u.faces)
    for (int k = 0; k < 30; ++k) {
      double a = double(random() & 0xffff) / 0x10000, b = double(random() & 0xffff) / 0x10000;
      if (a + b > 1) a = 1 - a, b = 1 - b;
      Vec3<double> p{0, 0, 0};
      double const share[3] = {1 - a - b, a, b};
      for (int i = 0; i < 3; ++i)
        for (int c = 0; c < 3; ++c) p[c] += share[i] * double(u.vertices[std::size_t(f[std::size_t(i)])][std::size_t(c)]);
      worst = std::max(worst, nearest(parts, p));
    }
  CHECK(worst < tolerance);
  for (double const z : {1. + tolerance, 2., 2.9})
    for (double const x : {1. + tolerance, 1.5, 2. - tolerance}) CHECK(nearest(parts, {x, 0, z}) > 0);
  for (auto const& part : parts)  // each is as convex as its hull: no vertex is inside
    for (auto const& v : part.vertices) CHECK(outside(part, {v[0], v[1], v[2]}) > -1e-3);
}

TEST_CASE("a ball rests in the notch, and above it where the mesh is its hull" * doctest::test_suite("data")) {
  Folder const folder;
  if (!has_coacd(folder)) return;
  auto d = io::parse_mjcf(text_of(u_mesh(), ball), "u.xml");
  auto const whole = compile(d);
  io::split_into_convex_parts(d, {.cache = folder.path});
  io::add_hulls(d);
  auto const m = compile(d);
  CHECK(m.ngeom >= 5);
  // Notch: 0.1 + 0.04, hull: 0.3 + 0.04; softness gives way by less than 2 mm.
  CHECK(std::abs(height_of_ball(m) - 0.14) < 0.002);
  CHECK(std::abs(height_of_ball(whole) - 0.34) < 0.002);
}

TEST_CASE("masses and inertia stay those of the mesh; named pairs are of the parts; the reader does the same" *
          doctest::test_suite("data")) {
  Folder const folder;
  if (!has_coacd(folder)) return;
  std::string const moving = R"(<geom name="ground" type="box" size="1 1 0.1"/><body name="b" pos="0 0 1"><freejoint/>
    <geom name="u" type="mesh" mesh="u" contype="2" conaffinity="2" friction="0.3 0.1 0.1" group="1"/></body>)";
  auto text = text_of(u_mesh(), moving);
  text.insert(text.find("</mujoco>"), R"(<contact><pair geom1="ground" geom2="u" condim="1"/></contact>)");
  auto d = io::parse_mjcf(text, "u.xml");
  auto const whole = compile(d);
  io::split_into_convex_parts(d, {.cache = folder.path});
  io::add_hulls(d);
  auto const m = compile(d);
  CHECK(m.body_mass == whole.body_mass);
  CHECK(m.body_inertia == whole.body_inertia);
  CHECK(m.body_ipos == whole.body_ipos);
  int const parts = m.ngeom - whole.ngeom;
  CHECK(parts >= 3);
  CHECK(int(m.named_pairs.size()) == parts);
  for (auto const& pair : m.named_pairs) CHECK(m.geom_name[pair.geom2].rfind("u.part", 0) == 0);
  for (int g = 0; g < m.ngeom; ++g)
    if (m.geom_name[g].rfind("u.part", 0) == 0) {
      CHECK(m.geom_contype[g] == 2);
      CHECK(m.geom_friction[g][0] == 0.3);
      CHECK(m.geom_body[g] == 1);
    } else if (m.geom_name[g] == "u") {
      CHECK(m.geom_contype[g] == 0);
      CHECK(m.geom_conaffinity[g] == 0);
    }
  auto const own = std::getenv("GSP_CACHE_DIR") ? std::string(std::getenv("GSP_CACHE_DIR")) : std::string();
  setenv("GSP_CACHE_DIR", folder.path.c_str(), 1);
  auto const read = compile(io::parse_mjcf(text, "u.xml", {.convex_decomposition = true}));
  own.empty() ? unsetenv("GSP_CACHE_DIR") : setenv("GSP_CACHE_DIR", own.c_str(), 1);
  CHECK(read.geom_name == m.geom_name);
  CHECK(read.geom_pos == m.geom_pos);
  CHECK(std::filesystem::exists(folder.path / "convex_parts"));
}

TEST_CASE("rays meet the mesh, and contact sensors that name its geom feel its parts" * doctest::test_suite("data")) {
  Folder const folder;
  if (!has_coacd(folder)) return;
  auto text = text_of(
      u_mesh(),
      std::string(
          R"(<geom name="other" type="box" size="0.01 0.01 0.01" pos="5 5 5"/><site name="over" pos="0.13 0.01 0.9" euler="180 0 0"/>)") +
          ball);
  text.insert(text.find("</mujoco>"),
              R"(<sensor><contact geom1="u" reduce="netforce" data="found force"/><contact geom2="u" reduce="netforce" data="found force"/>
    <contact geom1="other" data="found"/><rangefinder site="over"/></sensor>)");
  text.insert(text.find("<asset>"), R"(<compiler discardvisual="true"/>)");  // the mesh is no visual one
  auto d = io::parse_mjcf(text, "u.xml");
  io::split_into_convex_parts(d, {.cache = folder.path});
  io::add_hulls(d);
  auto const m = compile(d);
  Kokkos::DefaultHostExecutionSpace const exec;
  auto const model = make_model<double>(exec, m);
  auto const scene = make_ray_scene<double>(exec, model, m);
  std::vector<std::string> seen;
  for (int i = 0; i < scene.count(); ++i) seen.push_back(m.geom_name[std::size_t(scene.geoms(i).geom)]);
  CHECK(seen == std::vector<std::string>{"other", "u", ""});
  auto state = make_state(exec, model, {.worlds = 1});
  auto sim = make_simulation<double>(exec, model, m, {.worlds = 1});
  auto sensors = make_sensors(exec, model, m);
  Kokkos::View<double**, Kokkos::LayoutRight, Kokkos::HostSpace> data("data", 1, m.nsensordata);
  step(exec, model, state, sim, {.steps = 1000});
  forward(exec, model, state, sim);
  read_sensors(exec, model, state, sim, sensors, data);
  double const weight = 9.81 * m.body_mass[1];
  for (int const at : {0, 4}) {
    CHECK(data(0, at) >= 1);
    // the ball rests: on u the force is its weight, downwards and on geom 2 upwards
    CHECK(std::abs(std::hypot(data(0, at + 1), data(0, at + 2), data(0, at + 3)) - weight) < 1e-2 * weight);
  }
  CHECK(data(0, 8) == 0);
  CHECK(std::abs(data(0, 9) - (0.9 - 0.14 - std::sqrt(0.04 * 0.04 - 0.02 * 0.02 - 0.01 * 0.01))) < 0.003);  // the ball, in the notch
}

TEST_CASE("parts come from the cache; what is broken there is found again; who lacks CoACD is told what to install" *
          doctest::test_suite("data")) {
  Folder const folder, empty;
  if (!has_coacd(folder)) return;
  auto const mesh = mesh_of(u_mesh(), "u");
  auto const first = io::convex_parts(mesh, "mesh 'u'", {.cache = folder.path});
  auto const own = std::getenv("GSP_COACD") ? std::string(std::getenv("GSP_COACD")) : std::string();
  auto const equals_first = [&](std::vector<MeshDescription> const& parts) {
    return std::equal(parts.begin(), parts.end(), first.begin(), first.end(),
                      [](auto const& a, auto const& b) { return a.name == b.name && a.vertices == b.vertices && a.faces == b.faces; });
  };
  setenv("GSP_COACD", "/nowhere/lib_coacd.so", 1);
  CHECK(equals_first(io::convex_parts(mesh, "mesh 'u'", {.cache = folder.path})));
  CHECK_THROWS_WITH_AS(io::convex_parts(mesh, "mesh 'u'", {.cache = empty.path}), doctest::Contains("pip install coacd==1.0.14"), Error);
  CHECK_THROWS_AS(io::convex_parts(mesh, "mesh 'u'", {.threshold = 0.06, .cache = folder.path}), Error);  // another key
  own.empty() ? unsetenv("GSP_COACD") : setenv("GSP_COACD", own.c_str(), 1);
  for (auto const& entry : std::filesystem::directory_iterator(folder.path)) {
    auto bytes = io::read_file(entry.path());
    bytes.resize(bytes.size() / 2);
    io::write_file(entry.path(), bytes);
  }
  CHECK(equals_first(io::convex_parts(mesh, "mesh 'u'", {.cache = folder.path})));
}

TEST_CASE("what is convex, only seen, or a primitive is left as it is") {
  Description d;
  d.meshes = {mesh_of(gsp_test::box_mesh(1, 2, 3), "box"), mesh_of(u_mesh(), "u")};
  GeomDescription box, seen, fitted;
  box.type = seen.type = ShapeType::mesh, box.mesh = "box", seen.mesh = fitted.mesh = "u";
  seen.contype = seen.conaffinity = 0;
  fitted.type = ShapeType::box;
  d.bodies[0].geoms = {box, seen, fitted};
  io::split_into_convex_parts(d);
  CHECK(d.meshes.size() == 2);
  CHECK(d.bodies[0].geoms.size() == 3);
  CHECK(d.bodies[0].geoms[0].contype == 1);
  CHECK_THROWS_AS(io::convex_parts(d.meshes[1], "mesh 'u'", {.threshold = 0}), std::invalid_argument);
  CHECK_THROWS_AS(io::convex_parts(d.meshes[1], "mesh 'u'", {.most_parts = 0}), std::invalid_argument);
}

namespace {
/// A library with the C functions of CoACD, the C++ function `version`, and a run that throws. Empty where there is no compiler.
std::filesystem::path false_library(Folder const& folder, std::string const& version) {
  std::filesystem::create_directories(folder.path);
  auto const source = folder.path / "false.cpp", library = folder.path / ("lib" + version + ".so");
  std::ofstream(source) << "#include <stdexcept>\nextern \"C\" {\nvoid " << version
                        << "() {}\nvoid CoACD_setLogLevel(char const*) {}\nvoid CoACD_freeMeshArray() {}\n"
                           "void CoACD_run() { throw std::runtime_error(\"nothing left\"); }\n}\n";
  std::string const command = "c++ -shared -fPIC -o " + library.string() + " " + source.string() + " 2> /dev/null";
  return std::system(command.c_str()) == 0 ? library : "";
}
}  // namespace

TEST_CASE("a library of another version is refused, and what CoACD throws is an error with the mesh's name" * doctest::test_suite("data")) {
  auto const own = std::getenv("GSP_COACD") ? std::string(std::getenv("GSP_COACD")) : std::string();
  Folder const folder;
  // In 1.0.7 the interface had no real_metric.
  for (std::string const version : {"_ZN5coacd5CoACDERKNS_4MeshEdiSsiiiiibbbibdSsj", "_ZN5coacd5CoACDERKNS_4MeshEdiSsiiiiibbbibdSsjb"}) {
    auto const library = false_library(folder, version);
    if (library.empty()) return gsp_test::skip("c++ is missing");
    setenv("GSP_COACD", library.c_str(), 1);
    bool const is_it = version.back() == 'b';
    CHECK_THROWS_WITH_AS(io::convex_parts(mesh_of(u_mesh(), "u"), "mesh 'u'", {.cache = folder.path}),
                         is_it ? doctest::Contains("mesh 'u': cannot be taken apart by CoACD (nothing left)")
                               : doctest::Contains("which is of another version; use that of CoACD 1.0.14"),
                         Error);
  }
  own.empty() ? unsetenv("GSP_COACD") : setenv("GSP_COACD", own.c_str(), 1);
}

// Names of parts are checked against all that there are; what cannot be named twice is said.
TEST_CASE("a geom that is called like a part is asked for another name" * doctest::test_suite("data")) {
  Folder const folder;
  if (!has_coacd(folder)) return;
  auto const text = text_of(u_mesh(), R"(<geom name="u" type="mesh" mesh="u"/><geom name="u.part1" size="0.1"/>)");
  auto d = io::parse_mjcf(text, "u.xml");
  CHECK_THROWS_WITH_AS(io::split_into_convex_parts(d, {.cache = folder.path}),
                       doctest::Contains("geom 'u': is taken apart, and a geom is called 'u.part1' already; rename that one"), Error);
}
