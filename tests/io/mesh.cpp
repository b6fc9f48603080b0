// Mesh files, and what compile makes of meshes, against closed forms. (Against MuJoCo: tests/oracle/mesh.cpp.)
#include <doctest/doctest.h>

#include <gsp/geometry/shapes.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/mesh.hpp>
#include <gsp/io/mesh_hull.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <io/mesh_fixtures.hpp>
#include <set>

using namespace gsp::io;
using namespace gsp_test;
using gsp::Double3;
using gsp::MeshDescription;
using gsp::MeshInertia;

namespace {

MeshDescription of(Soup const& s) {
  MeshDescription mesh;
  mesh.name = "m", mesh.vertices = s.vertices, mesh.faces = s.faces;
  return mesh;
}
gsp::CompiledModel model(MeshDescription mesh, gsp::GeomDescription geom = {}) {
  gsp::Description d;
  geom.mesh = mesh.name;
  if (geom.type == gsp::ShapeType::sphere && geom.size[0] == 0) geom.type = gsp::ShapeType::mesh;
  d.meshes.push_back(std::move(mesh));
  auto body = gsp::BodyDescription{};
  body.parent = 0;
  body.joints.push_back({.type = gsp::JointType::free});
  body.geoms.push_back(geom);
  d.bodies.push_back(body);
  add_hulls(d);
  return gsp::compile(d);
}
double volume_of_hull(MeshDescription const& m) {
  double six = 0;
  for (auto const& f : m.hull) {
    auto const at = [&](int k) { return Double3{m.vertices[f[k]][0], m.vertices[f[k]][1], m.vertices[f[k]][2]}; };
    six += gsp::detail::dot(at(0), gsp::detail::cross(at(1), at(2)));
  }
  return six / 6;
}

}  // namespace

TEST_CASE("STL, OBJ, MSH and lists of numbers hold the same mesh") {
  auto const s = potato(3);
  auto const check = [&](MeshDescription const& m) {
    // the corners of each face, in order; STL numbers vertices as they come
    REQUIRE(m.faces.size() == s.faces.size());
    REQUIRE(m.vertices.size() == s.vertices.size());
    int wrong = 0;
    for (std::size_t f = 0; f < s.faces.size(); ++f)
      for (int k = 0; k < 3; ++k) wrong += m.vertices[m.faces[f][k]] != s.vertices[s.faces[f][k]];
    CHECK(wrong == 0);
  };
  check(parse_mesh(stl_binary(s), "dir/part.stl"));
  check(parse_mesh(stl_binary(s, "solid of words"), "part.STL"));  // some writers begin binary files as if they were text
  check(parse_mesh(bytes_of(stl_text(s)), "part.stl"));
  check(parse_mesh(bytes_of(obj_text(s)), "part.obj"));
  check(parse_mesh(msh_binary(s), "part.msh"));
  check(parse_mesh(msh_binary(s, true, true), "part.bin", "model/vnd.mujoco.msh"));
  std::vector<double> vertices;
  std::vector<int> faces;
  for (auto const& v : s.vertices) vertices.insert(vertices.end(), v.begin(), v.end());
  for (auto const& f : s.faces) faces.insert(faces.end(), f.begin(), f.end());
  check(make_mesh(vertices, faces, "mesh 'part'"));
  CHECK(parse_mesh(stl_binary(s), "dir/part.stl").name == "part");
  Folder folder;
  write_file(folder.path / "a.stl", stl_binary(s));
  check(read_mesh(folder.path / "a.stl"));
}

TEST_CASE("STL: equal vertices are one, 0 and -0 are two") {
  Soup s{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-0.f, 0, 0}}, {{0, 2, 1}, {0, 1, 3}, {4, 3, 2}, {1, 2, 3}}};
  auto const m = parse_mesh(stl_binary(s), "a.stl");
  CHECK(m.vertices.size() == 5);
  CHECK(m.faces[1] == std::array{0, 2, 3});
}

TEST_CASE("OBJ: forms of corners, polygons, what is ignored") {
  std::string const corners = "v 0 0 0\nv 1 0 0 1\nv 1 1 0 .5 .5 .5\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nvt 0 0\n";
  auto const faces = [&](std::string const& rest) { return parse_mesh(bytes_of(corners + rest), "a.obj").faces; };
  using F = std::vector<std::array<int, 3>>;
  CHECK(faces("f 1 2 3\n") == F{{0, 1, 2}});
  CHECK(faces("f 1/1 2/1/1 3//1\n") == F{{0, 1, 2}});
  CHECK(faces("f -5 -4 -3\r\n") == F{{0, 1, 2}});
  CHECK(faces("f 1 2 3 4\n") == F{{0, 1, 3}, {1, 2, 3}});  // the shorter diagonal, here equal
  CHECK(faces("v 3 2 0\nf 1 2 6 4\n") == F{{0, 1, 3}, {1, 5, 3}});
  CHECK(says(error_of([&] { faces("l 1 2\n"); }), "lines but no faces"));
  CHECK(faces("s off\nusemtl x\nf 1 2 3\nusemtl y\nf 1 3 4\nl 1 2\np 3\ng empty") == F{{0, 1, 2}, {0, 2, 3}});
  CHECK(faces("o first\nf 1 2\nf 1 2 3\ng second\nf 1 3 4") == F{{0, 1, 2}});
  CHECK(faces("g first\ng second\nf 1 3 4\ng third\nf 1 2 3") == F{{0, 2, 3}});
  CHECK(parse_mesh(bytes_of(corners), "a.obj").faces.empty());
  std::string note;
  CHECK(parse_mesh(bytes_of(corners + "f 1 2 3\ng x\nf 1 3 4"), "a.obj", "", &note).vertices.size() == 5);
  CHECK(note == "a.obj: line 10: faces from here on (1) belong to further objects or groups and are ignored, as MuJoCo does");
  // an arrow head, dented at its third corner: no triangle may leave it, and together they have its area
  auto const dented = parse_mesh(bytes_of("v 0 0 0\nv 4 0 0\nv 1 1 0\nv 0 4 0\nf 1 2 3 4\n"), "a.obj");
  double area = 0;
  for (auto const& f : dented.faces) {
    auto const &a = dented.vertices[f[0]], &b = dented.vertices[f[1]], &c = dented.vertices[f[2]];
    double const twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    CHECK(twice > 0);
    area += twice / 2;
  }
  CHECK(area == 4);
}

TEST_CASE("what is wrong is said with its place") {
  auto const error = [](std::string const& text, std::string const& file) { return error_of([&] { parse_mesh(bytes_of(text), file); }); };
  auto const binary = [](std::vector<std::byte> const& bytes, std::string const& file) {
    return error_of([&] { parse_mesh(bytes, file); });
  };
  std::string const four = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
  CHECK(says(error("v 1 2\n", "a.obj"), "a.obj: line 1: a vertex has fewer than three coordinates"));
  CHECK(says(error("v 1 2 x\n", "a.obj"), "'x' is not a coordinate"));
  CHECK(says(error("v 1 2 nan\n", "a.obj"), "line 1"));
  CHECK(says(error("v 1 2 1e300\n", "a.obj"), "line 1"));
  for (auto const& number : std::vector<std::string>{"1e400", "1" + std::string(400, '0')}) {
    CHECK(says(error("v 1 2 " + number + "\n", "a.obj"), "line 1: '" + number.substr(0, 5)));
    CHECK(says(error("solid\nfacet\nvertex 0 0 " + number + "\n", "a.stl"), "line 3: '" + number.substr(0, 5)));
  }
  CHECK(parse_mesh(bytes_of("v 0." + std::string(400, '0') + "1 1e-400 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n"), "a.obj").vertices[0] ==
        std::array<float, 3>{});
  CHECK(says(error("v 1 2 3e9\n", "a.obj"), "2^30"));
  CHECK(says(error(four + "f 1 2 0\n", "a.obj"), "line 5: '0' is not a corner"));
  CHECK(says(error(four + "f 1 2 5\n", "a.obj"), "line 5: a face names a vertex that is not among the 4"));
  CHECK(says(error(four + "f -5 1 2\n", "a.obj"), "line 5"));
  CHECK(says(error("v 0 0 0\n", "a.obj"), "needs at least 4"));
  CHECK(says(error(four, "a.dae"), "is not read as a mesh"));
  CHECK(says(error("solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\n", "a.stl"),
             "line 7: the facet has 2 vertices"));
  CHECK(says(error("solid\nfacet\nvertex 0 0 zero\n", "a.stl"), "line 3: 'zero' is not a coordinate"));
  CHECK(says(error("solid\nfacet\nvertex 0 0 0\n", "a.stl"), "cut short"));
  CHECK(says(error("solid empty\nendsolid empty\n", "a.stl"), "holds no triangle"));
  CHECK(says(error("hello", "a.stl"), "too short"));
  auto stl = stl_binary(tetrahedron());
  float const nan = NAN;
  std::memcpy(&stl[84 + 12], &nan, 4);
  CHECK(says(binary(stl, "a.stl"), "byte 96: a vertex is not finite"));
  CHECK(accepted_truncations(stl_binary(tetrahedron()), [](Bytes b) { parse_mesh(b, "a.stl"); }) == 0);
  CHECK(accepted_truncations(msh_binary(tetrahedron(), true, true), [](Bytes b) { parse_mesh(b, "a.msh"); }) == 0);
  auto msh = msh_binary(tetrahedron());
  msh[msh.size() - 1] = std::byte(0x7f);
  CHECK(says(binary(msh, "a.msh"), "a face names vertex"));
  for (std::uint32_t huge : {0x7fffffffu, 0xffffffffu, 0x80000000u}) {
    std::memcpy(msh.data(), &huge, 4);
    CHECK(says(binary(msh, "a.msh"), "byte 0"));
  }
  CHECK(says(error_of([] { make_mesh(std::vector<double>(11), {}, "mesh 'm'"); }), "mesh 'm': has 11 numbers"));
  CHECK(says(error_of([] { make_mesh(std::vector<double>(12), std::vector<int>{0, 1, 4}, "mesh 'm'"); }), "face 0: names vertex 4 of 4"));
}

TEST_CASE("a folded polygon of many corners is refused, not cut for minutes") {
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf";
  for (int i = 0; i < 30000; ++i) text += ' ', text += std::to_string(1 + i * 7 % 4);
  auto const error = error_of([&] { parse_mesh(bytes_of(text), "a.obj"); });
  CHECK((error.empty() || says(error, "too many corners")));
}

TEST_CASE("a box as a mesh weighs what a box does, wherever it lies and however its inertia is taken") {
  for (auto kind : {MeshInertia::legacy, MeshInertia::exact, MeshInertia::convex, MeshInertia::shell}) {
    auto mesh = of(box_mesh(.5f, .25f, .125f));  // exact in float
    mesh.inertia = kind;
    mesh.refpos = {.3, -.2, .1}, mesh.scale = {2, 2, 2}, mesh.refquat = {std::sqrt(.5), 0, 0, std::sqrt(.5)};
    gsp::GeomDescription geom{.pos = {1, 2, 3}, .density = 700};
    auto const m = model(mesh, geom);
    bool const shell = kind == MeshInertia::shell;
    auto const exact = gsp::shape_inertia(gsp::ShapeType::box, {1, .5, .25}, shell);
    CHECK(m.body_mass[1] == doctest::Approx(700 * exact.measure).epsilon(1e-12));
    // longest axis last; the file's x is turned to -y by refquat^-1
    CHECK(m.body_inertia[1][2] == doctest::Approx(700 * exact.measure * exact.moments[0]).epsilon(1e-12));
    CHECK(m.body_inertia[1][1] == doctest::Approx(700 * exact.measure * exact.moments[1]).epsilon(1e-12));
    CHECK(m.body_inertia[1][0] == doctest::Approx(700 * exact.measure * exact.moments[2]).epsilon(1e-12));
    Double3 const center{1 + 2 * .2, 2 + 2 * .3, 3 - 2 * .1};  // -refpos turned by -90 degrees about z, doubled
    for (int k = 0; k < 3; ++k) CHECK(m.geom_pos[0][k] == doctest::Approx(center[k]).epsilon(1e-12));
    CHECK(m.geom_rbound[0] == doctest::Approx(std::sqrt(1 + .25 + .0625)));
    CHECK(m.nmesh == 1);
    CHECK(m.geom_data[0] == 0);
    CHECK(m.mesh_hull[0].size() == 8);
  }
}

TEST_CASE("hulls: all of a box, outward, less than a dented mesh; so many vertices as asked for") {
  auto box = of(box_mesh(1, 2, 3));
  box.vertices.push_back({.1f, .2f, .3f});  // inside
  add_hull(box, "box");
  CHECK(box.hull.size() == 12);
  CHECK(volume_of_hull(box) == doctest::Approx(48));
  auto dented = of(potato(5, 12, 14));
  add_hull(dented, "potato");
  std::set<int> all;
  for (auto const& f : dented.hull) all.insert(f.begin(), f.end());
  CHECK(all.size() < dented.vertices.size());
  CHECK(dented.hull.size() == 2 * all.size() - 4);  // Euler
  double const full = volume_of_hull(dented);
  dented.max_hull_vertices = 12;
  add_hull(dented, "potato");
  all.clear();
  for (auto const& f : dented.hull) all.insert(f.begin(), f.end());
  CHECK(all.size() <= 12);
  CHECK(volume_of_hull(dented) < full);
  CHECK(volume_of_hull(dented) > full / 2);
  auto const error = [](std::vector<std::array<float, 3>> const& v) {
    MeshDescription mesh;
    mesh.vertices = v;
    return error_of([&] { add_hull(mesh, "mesh 'm'"); });
  };
  CHECK(says(error({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}}), "in one place"));
  CHECK(says(error({{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}}), "on one line"));
  CHECK(says(error({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {3, 3, 0}}), "in one plane"));
}

TEST_CASE("compile refuses meshes that weigh nothing, and says why") {
  auto const error = [](MeshDescription const& mesh, gsp::GeomDescription const& geom = {}) {
    return error_of([&] { model(mesh, geom); });
  };
  auto const open = [] {
    auto s = box_mesh(1, 1, 1);
    s.faces.resize(6);
    return s;
  };
  auto turned = of(box_mesh(1, 1, 1));
  for (auto& f : turned.faces) std::swap(f[0], f[1]);
  turned.inertia = MeshInertia::exact;
  CHECK(says(error(turned), "mesh 'm' encloses a negative volume"));
  auto mixed = of(box_mesh(1, 1, 1));
  std::swap(mixed.faces[3][0], mixed.faces[3][1]);
  CHECK(error(mixed).empty());  // legacy takes sizes only
  mixed.inertia = MeshInertia::exact;
  CHECK(says(error(mixed), "orientations disagree"));
  auto flat = of({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, {{0, 1, 2}, {1, 3, 2}}});
  gsp::GeomDescription seen{.contype = 0, .conaffinity = 0};
  CHECK(says(error(flat, seen), "encloses no volume"));
  flat.inertia = MeshInertia::shell;
  CHECK(error(flat, seen).empty());
  CHECK(says(error(flat), "in one plane"));  // it could collide, and needs a hull
  auto nothing = of({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, {{0, 1, 1}}});
  CHECK(says(error(nothing, seen), "has no surface"));
  CHECK(error(of(open()), seen).empty());
  gsp::GeomDescription shell;
  shell.shell_inertia = true;
  CHECK(says(error(of(tetrahedron()), shell), "shellinertia"));
  gsp::GeomDescription plane{.type = gsp::ShapeType::plane, .size = {1, 1, 1}};
  CHECK(says(error(of(tetrahedron()), plane), "cannot be fitted"));
  auto bare = of(tetrahedron());
  bare.faces.clear();
  gsp::Description d;
  d.meshes.push_back(bare);
  CHECK(says(error_of([&] { gsp::compile(d); }), "call gsp::io::add_hulls"));
  d.meshes.push_back(bare);
  add_hulls(d);
  CHECK(says(error_of([&] { gsp::compile(d); }), "taken already"));
}

TEST_CASE("a mesh that could touch something has a hull with faces") {
  gsp::Description d;
  d.meshes.push_back(of(tetrahedron()));
  d.bodies[0].geoms.push_back({.type = gsp::ShapeType::plane, .size = {0, 0, 1}});
  gsp::BodyDescription body;
  body.parent = 0;
  body.joints.push_back({.type = gsp::JointType::free});
  body.geoms.push_back({.name = "g", .type = gsp::ShapeType::mesh, .mesh = "m"});
  d.bodies.push_back(body);
  add_hulls(d);
  auto const m = gsp::compile(d);
  CHECK(m.pairs.size() == 1);
  CHECK(m.report.empty());
  CHECK(m.mesh_hull.at(0).size() == 4);
  CHECK(m.mesh_hull_faces.at(0).size() == 4);
}
