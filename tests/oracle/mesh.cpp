// Meshes and height fields against MuJoCo's compiler: the same file through both, vertices in the body's frame, masses, inertia, bounds,
// hulls, fitted primitives. Where MuJoCo refuses, so must we.
#include <doctest/doctest.h>

#include <algorithm>
#include <gsp/io/bitmap.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/hfield.hpp>
#include <gsp/io/mesh.hpp>
#include <gsp/io/mesh_builtin.hpp>
#include <gsp/io/mesh_hull.hpp>
#include <gsp/io/png.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/detail/principal_axes.hpp>
#include <io/mesh_fixtures.hpp>
#include <map>
#include <optional>
#include <oracle/load.hpp>
#include <set>
#include <sstream>
#include <support/data.hpp>
#include <support/skip.hpp>

using namespace gsp;
using namespace gsp_test;
using gsp::detail::operator+;
using gsp::detail::operator-;

namespace {

struct Case {
  std::string file;  // name in the model; its extension tells the format; empty: inline data in `attributes`
  std::vector<std::byte> bytes;
  std::string attributes;  // of <mesh>, beside name and file
  std::string geom = "type='mesh'", compiler;
  MeshDescription mesh;  // the same, for us: all but what the file holds
  GeomDescription shape;
  bool fit_aabb = false;
  bool ballast = false;  // a ball in the same body: of a flat mesh alone A + B = C, which rounding makes good or bad
};

// MuJoCo's model, or what it says
std::pair<Oracle, std::string> theirs(Case const& c) {
  static int counter = 0;  // MuJoCo caches assets by name
  std::string const file = c.file.empty() ? "" : std::to_string(counter++) + c.file;
  std::string const text = "<mujoco><compiler " + c.compiler + "/><asset><mesh name='m' " + (file.empty() ? "" : "file='" + file + "' ") +
                           c.attributes + "/></asset><worldbody><body pos='1 2 3'><freejoint/><geom " + c.geom +
                           " mesh='m' pos='.3 -.2 .1' quat='1 -.5 .2 .3' density='700'/>" + (c.ballast ? "<geom size='.2'/>" : "") +
                           "</body></worldbody></mujoco>";
  auto const vfs = std::make_unique<mjVFS>();
  mj_defaultVFS(vfs.get());
  mju_user_warning = [](char const*) {};
  REQUIRE(mj_addBufferVFS(vfs.get(), "model.xml", text.data(), int(text.size())) == 0);
  if (!file.empty()) REQUIRE(mj_addBufferVFS(vfs.get(), file.c_str(), c.bytes.data(), int(c.bytes.size())) == 0);
  char error[1000] = "";
  Oracle o;
  o.model.reset(mj_loadXML("model.xml", vfs.get(), error, sizeof error));
  mj_deleteVFS(vfs.get());
  return {std::move(o), error};
}
std::pair<std::optional<CompiledModel>, std::string> ours(Case const& c) {
  try {
    Description d;
    auto mesh = c.mesh;
    if (!c.file.empty()) {
      auto read = io::parse_mesh(c.bytes, c.file);
      mesh.vertices = std::move(read.vertices), mesh.faces = std::move(read.faces);
    }
    mesh.name = "m";
    d.meshes.push_back(std::move(mesh));
    BodyDescription body;
    body.parent = 0, body.pos = {1, 2, 3};
    body.joints.push_back({.type = JointType::free});
    auto geom = c.shape;
    geom.mesh = "m", geom.pos = {.3, -.2, .1}, geom.quat = {1, -.5, .2, .3}, geom.density = 700;
    body.geoms.push_back(geom);
    if (c.ballast) body.geoms.push_back({.type = ShapeType::sphere, .size = {.2, 0, 0}});
    d.bodies.push_back(body);
    d.compiler.fit_aabb = c.fit_aabb;
    io::add_hulls(d);
    return {compile(d), ""};
  } catch (Error const& e) { return {std::nullopt, e.what()}; }
}

std::string compare(Case const& c, bool may_be_lenient = false) {
  auto const both = theirs(c);
  auto const mine_too = ours(c);
  auto const& o = both.first;
  auto const& g = mine_too.first;
  std::string const &their_error = both.second, &our_error = mine_too.second;
  auto const* m = o.m();
  CAPTURE(their_error);
  CAPTURE(our_error);
  if (!m || !g) {
    if (!may_be_lenient) CHECK(bool(m) == g.has_value());
    return m ? our_error : their_error;
  }
  REQUIRE(g->nmesh == m->nmesh);
  REQUIRE(int(g->mesh_vertices[0].size()) == m->mesh_vertnum[0]);
  REQUIRE(int(g->mesh_faces[0].size()) == m->mesh_facenum[0]);
  CHECK(g->geom_type[0] == m->geom_type[0]);
  CHECK(g->geom_data[0] == m->geom_dataid[0]);
  double size = 0, worst = 0;
  auto const quat = [](mjtNum const* q) { return Double4{q[0], q[1], q[2], q[3]}; };
  auto const vec = [](auto const* p) { return Double3{double(p[0]), double(p[1]), double(p[2])}; };
  // the mesh's pose is the same whether or not the geom keeps the mesh
  for (int i = 0; i < m->mesh_vertnum[0]; ++i) {
    auto const& v = g->mesh_vertices[0][i];
    auto const mine = g->mesh_pos[0] + detail::rotate(g->mesh_quat[0], {v[0], v[1], v[2]});
    auto const other = vec(m->mesh_pos) + detail::rotate(quat(m->mesh_quat), vec(m->mesh_vert + 3 * i));
    worst = std::max(worst, detail::norm(mine - other)), size = std::max(size, std::abs(double(v[0])));
    for (float x : v) size = std::max(size, std::abs(double(x)));
  }
  CHECK(worst < 1e-6 * size);
  if (m->geom_type[0] == mjGEOM_MESH) {
    worst = 0;
    for (int i = 0; i < m->mesh_vertnum[0]; ++i) {
      auto const& v = g->mesh_vertices[0][i];
      auto const mine = g->geom_pos[0] + detail::rotate(g->geom_quat[0], {v[0], v[1], v[2]});
      worst = std::max(worst, detail::norm(mine - (vec(m->geom_pos) + detail::rotate(quat(m->geom_quat), vec(m->mesh_vert + 3 * i)))));
    }
    CHECK(worst < 1e-6 * size);
  } else {
    int const sizes[] = {3, 0, 1, 2, 3, 2, 3};
    for (int k = 0; k < sizes[m->geom_type[0]]; ++k) CHECK(g->geom_size[0][k] == doctest::Approx(m->geom_size[k]).epsilon(1e-9));
    CHECK(detail::norm(g->geom_pos[0] - vec(m->geom_pos)) < 1e-9 * (1 + size));
    // the frame of a body of revolution or a sphere is free; of a box it is not, up to its symmetry
    auto const &a = g->geom_quat[0], b = quat(m->geom_quat);
    CHECK(std::abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]) == doctest::Approx(1).epsilon(1e-9));
  }
  for (int f = 0, bad = 0; f < m->mesh_facenum[0] && !bad; ++f)
    for (int k = 0; k < 3; ++k)
      if (g->mesh_faces[0][f][k] != m->mesh_face[3 * f + k]) {
        bad = 1;
        // a mesh without faces takes those of the hull, whose order is qhull's
        CHECK_MESSAGE((c.mesh.faces.empty() && !c.mesh.vertices.empty()), "face " << f << " differs");
      }
  CHECK(g->geom_rbound[0] == doctest::Approx(m->geom_rbound[0]).epsilon(1e-6));
  CHECK(g->body_mass[1] == doctest::Approx(m->body_mass[1]).epsilon(1e-9));
  auto const mine = detail::rotated_diagonal(g->body_iquat[1], g->body_inertia[1]),
             other = detail::rotated_diagonal(quat(m->body_iquat + 4), vec(m->body_inertia + 3));
  for (int k = 0; k < 6; ++k) CHECK(std::abs(mine[k] - other[k]) <= 1e-9 * std::max({other[0], other[1], other[2]}));
  CHECK(detail::norm(g->body_ipos[1] - vec(m->body_ipos + 3)) < 1e-9 * (1 + size));
  std::set<int> hull;
  if (m->mesh_graphadr[0] >= 0) {
    int const* graph = m->mesh_graph + m->mesh_graphadr[0];
    hull.insert(graph + 2 + graph[0], graph + 2 + 2 * graph[0]);
  }
  CHECK(std::set<int>(g->mesh_hull[0].begin(), g->mesh_hull[0].end()) == hull);
  return "";
}

MeshDescription inline_mesh(Soup const& s, bool faces = true) {
  MeshDescription mesh;
  mesh.vertices = s.vertices;
  if (faces) mesh.faces = s.faces;
  return mesh;
}
std::string inline_text(Soup const& s, bool faces = true) {
  std::string v, f;
  for (auto const& p : s.vertices)
    for (float x : p) v += number(x) + " ";
  for (auto const& t : s.faces)
    for (int i : t) f += std::to_string(i) + " ";
  return " vertex='" + v + "'" + (faces ? " face='" + f + "'" : "");
}
template <class A>
std::string joined(A const& a) {
  std::ostringstream out;
  out.precision(17);
  for (double x : a) out << x << ' ';
  return out.str();
}
char const* const kinds[] = {"legacy", "exact", "convex", "shell"};

}  // namespace

TEST_CASE("inertia modes, scales, reference poses, formats") {
  auto const open = [] {
    auto s = box_mesh(.3f, .2f, .1f);
    s.faces.pop_back();
    return s;
  };
  auto const turned = [](Soup s) {
    std::swap(s.faces[2][0], s.faces[2][1]);
    return s;
  };
  Soup const soups[] = {box_mesh(.3f, .2f, .1f), tetrahedron(), open(), potato(1), potato(2, 9, 12), turned(potato(1))};
  std::map<std::string, int> refused;
  int n = 0;
  for (auto const& soup : soups)
    for (int kind = 0; kind < 4; ++kind)
      for (Double3 scale : {Double3{1, 1, 1}, {2, .5, 3}, {-1, 1, 1}, {-1, -2, .5}, {-.1, -.1, -.1}})
        for (int reference = 0; reference < 2; ++reference)
          for (int format = 0; format < 5; ++format) {
            Case c;
            c.mesh.scale = scale, c.mesh.inertia = MeshInertia(kind);
            c.attributes = " inertia='" + std::string(kinds[kind]) + "' scale='" + joined(scale) + "'";
            if (reference) {
              c.mesh.refpos = {.1, -.3, .2}, c.mesh.refquat = {1, .2, -.3, .4};
              c.attributes += " refpos='.1 -.3 .2' refquat='1 .2 -.3 .4'";
            }
            if (n % 2) c.geom += " contype='0' conaffinity='0'", c.shape.contype = c.shape.conaffinity = 0;
            c.shape.type = ShapeType::mesh;
            if (format == 0) c.file = "a.stl", c.bytes = stl_binary(soup);
            if (format == 1) c.file = "a.obj", c.bytes = bytes_of(obj_text(soup));
            if (format == 2) c.file = "a.msh", c.bytes = msh_binary(soup, n % 3 == 0, n % 5 == 0);
            if (format > 2) {
              auto const m = inline_mesh(soup, format == 3);
              c.mesh.vertices = m.vertices, c.mesh.faces = m.faces;
              c.attributes += inline_text(soup, format == 3);
            }
            CAPTURE(kind);
            CAPTURE(format);
            CAPTURE(reference);
            CAPTURE(joined(scale));
            CAPTURE(&soup - soups);
            auto const error = compare(c);
            if (!error.empty()) ++refused[error];
            ++n;
          }
  for (auto const& [what, count] : refused) MESSAGE(what << ": " << count << " of " << n);
}

TEST_CASE("primitives fitted to meshes, by inertia and by bounds") {
  std::string const names[] = {"", "", "sphere", "capsule", "ellipsoid", "cylinder", "box"};
  for (auto const& soup : {potato(4), potato(6, 8, 10), box_mesh(.1f, .2f, .5f), tetrahedron()})
    for (int type = 2; type < 7; ++type)
      for (int kind = 0; kind < 4; ++kind)
        for (bool aabb : {false, true}) {
          Case c;
          c.file = "a.stl", c.bytes = stl_binary(soup), c.mesh.inertia = MeshInertia(kind), c.fit_aabb = aabb;
          c.attributes = std::string("inertia='") + kinds[kind] + "' scale='1 1.1 -.9'", c.mesh.scale = {1, 1.1, -.9};
          c.compiler = aabb ? "fitaabb='true'" : "";
          c.geom = "type='" + names[type] + "' fitscale='1.3'";
          c.shape.type = ShapeType(type), c.shape.fitscale = 1.3;
          CAPTURE(type);
          CAPTURE(kind);
          CAPTURE(aabb);
          compare(c);
        }
}

TEST_CASE("hulls of at most so many vertices") {
  for (int most : {4, 5, 8, 20, 1000}) {
    auto const soup = potato(8, 12, 16);
    Case c;
    c.file = "a.obj", c.bytes = bytes_of(obj_text(soup)), c.attributes = "maxhullvert='" + std::to_string(most) + "'";
    c.mesh.max_hull_vertices = most, c.shape.type = ShapeType::mesh;
    CAPTURE(most);
    auto const error = compare(c);
    CHECK(error == "");
  }
}

TEST_CASE("built-in meshes: vertices, faces and inertia as MuJoCo makes them") {
  struct Builtin {
    std::string type;
    std::vector<double> params;
  };
  std::vector<Builtin> all;
  for (double n : {0, 1, 2, 4}) all.push_back({"sphere", {n}});
  for (double n : {0, 1, 2, 5, 10}) all.push_back({"hemisphere", {n}});
  for (double n : {3, 4, 5, 12})
    for (double r : {0., .3, 1.}) all.push_back({"cone", {n, r}});
  for (double n : {3, 4, 9})
    for (double e : {0., .5, 1., 2.}) all.push_back({"supersphere", {n, e, e == .5 ? 1.7 : e}});
  for (double n : {3, 4, 9})
    for (double r : {.25, 1.}) all.push_back({"supertorus", {n, r, .6, 1.3}});
  all.insert(all.end(), {{"wedge", {3, 4, 30, 40, .5}}, {"wedge", {6, 5, 180, 90, 0}}, {"wedge", {7, 3, 60, 12, 1}}});
  all.insert(all.end(), {{"plate", {3, 4}}, {"plate", {5, 2}}, {"square", {3, 4, 1, .1, .2, .3}}, {"grid", {2, 3, 1, .1, .2, .3, 2}}});
  all.insert(all.end(), {{"disc", {5, 5, 1, .4, .4, .1}}, {"disc", {4, 7, 1, .3, .4, .1}}, {"disc", {2, 2, 1, 1, 1, 1}}});
  all.insert(all.end(), {{"grid", {2, 3, 4, .1, .2, .3}}, {"grid", {2, 2, 2, .1, .2, -.3, 3}}, {"grid", {3, 3, 3, .2, .2, .2}}});
  for (std::string type : {"box", "cylinder", "ellipsoid"})
    for (double dim : {2, 3})
      for (auto const& n : {Double3{2, 2, 2}, {3, 3, 3}, {2, 4, 3}, {5, 3, 6}}) all.push_back({type, {n[0], n[1], n[2], .1, .2, .25, dim}});
  int refused = 0, n = 0;
  for (auto const& [type, params] : all) {  // before any compiling: the same floats
    CAPTURE(type);
    CAPTURE(joined(params));
    auto const mine = io::make_builtin_mesh(type, params, "mesh");
    std::unique_ptr<mjSpec, void (*)(mjSpec*)> const spec(mj_makeSpec(), mj_deleteSpec);
    auto* mesh = mjs_addMesh(spec.get(), nullptr);
    auto const names = io::builtin_meshes;
    int const id = int(std::find(names.begin(), names.end(), type) - names.begin()) + 1;
    auto numbers = params;
    REQUIRE(mjs_makeMesh(mesh, mjtMeshBuiltin(id), numbers.data(), int(numbers.size())) == 0);
    REQUIRE(mesh->uservert->size() == 3 * mine.vertices.size());
    double worst = 0;
    for (std::size_t i = 0; i < mesh->uservert->size(); ++i)
      worst = std::max(worst, std::abs(double((*mesh->uservert)[i]) - mine.vertices[i / 3][i % 3]));
    CHECK(worst <= 1e-9);
    REQUIRE(mesh->userface->size() == 3 * mine.faces.size());
    int bad = 0;
    for (std::size_t i = 0; i < mesh->userface->size(); ++i) bad += (*mesh->userface)[i] != mine.faces[i / 3][i % 3];
    CHECK(bad == 0);
  }
  for (auto const& [type, params] : all)
    for (int kind = 0; kind < 4; ++kind)
      for (bool visual : {false, true}) {
        Case c;
        c.mesh = io::make_builtin_mesh(type, params, "mesh", MeshInertia(kind));
        c.mesh.scale = {1, 2, .5};
        c.attributes = "scale='1 2 .5' builtin='" + type + "' params='" + joined(params) + "' inertia='" + kinds[kind] + "'";
        c.ballast = true;
        if (visual) c.geom += " contype='0' conaffinity='0'", c.shape.contype = c.shape.conaffinity = 0;
        c.shape.type = ShapeType::mesh;
        CAPTURE(c.attributes);
        CAPTURE(visual);
        refused += !compare(c).empty();
        ++n;
      }
  MESSAGE(n << " built-in meshes, " << refused << " refused by MuJoCo and here");
  CHECK(refused < n / 4);
}

TEST_CASE("OBJ: polygons, groups, corners, as MuJoCo takes them") {
  Soup const p = potato(9);
  std::string const four = "v 0 0 0\nv 1 0 0.1\nv 1.2 1 -.2\nv -.1 1 .3\nv .2 .3 1\nv .6 .4 .3\n";
  std::string const cases[] = {
      four + "f 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n",  // a quad that is not flat
      four + "f 1 4 3 2\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n",
      four + "f 2 1 4 3\nf 5 1 2\nf 5 2 3\nf 5 3 4\nf 5 4 1\n",
      four + "f 3 2 6 1 4\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n",  // five corners, dented
      four + "f 4 3 6 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n",
      four + "f -3 -4 -5 -6\nf -6 -5 -2\nf -5 -4 -2\nf -4 -3 -2\nf -3 -6 -2\n",  // counted back
      "g nothing\n" + obj_text(p) + "g more\nf 1 2 3\n",                         // the first group that has faces
      obj_text(p) + "o more\nv 9 9 9\nf 1 2 3\n",                                // vertices of all objects count for bounds and hull
      "vn 0 0 1\n" + four +
          "f 4//1 3//1 2//1 1//1\nf 1//1 2//1 5//1\nusemtl a\nf 2//1 3//1 5//1\nusemtl b\nf 3//1 4//1 5//1\ns 1\nf 4//1 1//1 5//1\n",
      "vn 0 0 1\nvt 0 1\n" + four + "f 4/1/1 3/1/1 2/1/1\nf 1/1/1 2/1/1 5/1/1\n",
      four,  // no faces: the hull
      four + "l 1 2\np 3\n",
      four + "f 1 2\n",
      four + "f 1 2 99\n",
      four + "f 1 2 0\n",
  };
  for (auto const& text : cases) {
    Case c;
    c.file = "a.obj", c.bytes = bytes_of(text), c.shape.type = ShapeType::mesh;
    CAPTURE(text);
    compare(c);
  }
}

TEST_CASE("many polygons, flat and not, are cut into the same triangles") {
  std::mt19937 random(5);
  auto const uniform = [&] { return float(random() % 2000) / 1000 - 1; };
  for (int i = 0; i < 60; ++i) {
    int const corners = 4 + i % 7;
    std::string text, face = "f";
    for (int k = 0; k < corners; ++k) {
      float const a = 6.2831853f * k / corners, r = .3f + .7f * std::abs(uniform());
      float x = r * std::cos(a), y = r * std::sin(a), z = i % 2 ? .1f * uniform() : 0.f;
      if (i % 3 == 1) std::swap(x, z);
      if (i % 3 == 2) std::swap(y, z);
      text += "v " + number(x) + " " + number(y) + " " + number(z) + "\n", face += ' ', face += std::to_string(k + 1);
    }
    text += "v .1 .2 .3\nv .5 .2 -.7\n" + face + "\nf 1 2 " + std::to_string(corners + 1) + "\n";
    Case c;
    c.file = "a.obj", c.bytes = bytes_of(text), c.shape.type = ShapeType::mesh;
    CAPTURE(text);
    auto const error = compare(c);
    CHECK(error == "");
  }
}

TEST_CASE("flat, straight and single points where a hull is needed; too few vertices") {
  for (auto const& v : {std::vector<std::array<float, 3>>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}},
                        {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}},
                        {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}},
                        {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}) {
    Soup const s{v, {{0, 1, 2}, {0, 2, 1}}};
    for (bool visual : {false, true})
      for (bool faces : {false, true})
        for (int kind : {0, 3}) {
          Case c;
          c.mesh = inline_mesh(s, faces), c.attributes = inline_text(s, faces) + " inertia='" + kinds[kind] + "'",
          c.shape.type = ShapeType::mesh;
          c.mesh.inertia = MeshInertia(kind);
          if (visual) c.geom += " contype='0' conaffinity='0'", c.shape.contype = c.shape.conaffinity = 0;
          CAPTURE(c.attributes);
          CAPTURE(visual);
          CAPTURE(faces);
          compare(c);
        }
  }
}

TEST_CASE("every mesh file of the collection" * doctest::test_suite("data")) {
  auto const root = gsp_test::data("models");
  if (!root) {
    gsp_test::skip("models are missing from GSP_DATA_DIR");
    return;
  }
  std::vector<std::filesystem::path> files;
  for (auto const& entry : std::filesystem::recursive_directory_iterator(*root)) {
    std::string e = entry.path().extension().string();
    for (char& x : e) x = char(std::tolower(x));
    if (e == ".stl" || e == ".obj" || e == ".msh") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  CHECK(files.size() > 300);
  int refused = 0, n = 0;
  std::set<std::uint64_t> seen;  // the same file stands in several folders
  for (auto const& path : files) {
    Case c;
    c.bytes = io::read_file(path);
    std::uint64_t hash = c.bytes.size();
    for (auto b : c.bytes) hash = (hash ^ std::uint64_t(b)) * 1099511628211u;
    if (!seen.insert(hash).second) continue;
    c.file = path.filename().string();
    c.shape.type = ShapeType::mesh;
    if (n % 3 == 1) c.mesh.scale = {.1, .2, .1}, c.attributes = "scale='.1 .2 .1'";
    if (n % 3 == 2) c.mesh.scale = {1, -1, 1}, c.attributes = "scale='1 -1 1'";
    if (n % 4 == 3) c.geom += " contype='0' conaffinity='0'", c.shape.contype = c.shape.conaffinity = 0;
    ++n;
    CAPTURE(path.string());
    CAPTURE(c.attributes);
    auto const error = compare(c);
    if (error.empty()) continue;
    ++refused;
    MESSAGE(path.string() << ": " << error);
  }
  MESSAGE(n << " different mesh files, " << refused << " refused by MuJoCo and here");
}

namespace {
void compare_field(std::string const& attributes, std::string const& file, std::vector<std::byte> const& bytes,
                   HeightFieldDescription field) {
  static int counter = 0;
  std::string const name = "h" + std::to_string(counter++) + file;
  std::string const text =
      "<mujoco><asset><hfield name='h' size='2 3 .7 .4' " + (file.empty() ? "" : "file='" + name + "' ") + attributes +
      "/></asset><worldbody><geom type='hfield' hfield='h' pos='1 2 3' quat='1 0 0 .3'/><body name='b'><freejoint/><geom type='hfield' "
      "hfield='h' pos='.1 0 0'/></body></worldbody></mujoco>";
  auto const vfs = std::make_unique<mjVFS>();
  mj_defaultVFS(vfs.get());
  REQUIRE(mj_addBufferVFS(vfs.get(), "model.xml", text.data(), int(text.size())) == 0);
  if (!file.empty()) REQUIRE(mj_addBufferVFS(vfs.get(), name.c_str(), bytes.data(), int(bytes.size())) == 0);
  char error[1000] = "";
  Oracle o;
  o.model.reset(mj_loadXML("model.xml", vfs.get(), error, sizeof error));
  mj_deleteVFS(vfs.get());
  REQUIRE_MESSAGE(o.model, error);
  auto const* m = o.m();
  Description d;
  field.name = "h", field.size = {2, 3, .7, .4};
  d.hfields.push_back(field);
  d.bodies[0].geoms.push_back({.type = ShapeType::hfield, .pos = {1, 2, 3}, .quat = {1, 0, 0, .3}, .hfield = "h"});
  BodyDescription body;
  body.parent = 0;
  body.joints.push_back({.type = JointType::free});
  body.geoms.push_back({.type = ShapeType::hfield, .pos = {.1, 0, 0}, .hfield = "h"});
  d.bodies.push_back(body);
  auto const g = compile(d);
  REQUIRE(g.nhfield == 1);
  CHECK(g.hfields[0].rows == m->hfield_nrow[0]);
  CHECK(g.hfields[0].columns == m->hfield_ncol[0]);
  REQUIRE(g.hfields[0].elevation.size() == std::size_t(m->nhfielddata));
  int bad = 0;
  for (int i = 0; i < m->nhfielddata; ++i) bad += g.hfields[0].elevation[i] != m->hfield_data[i];
  CHECK(bad == 0);
  for (int k = 0; k < 4; ++k) CHECK(g.hfields[0].size[k] == m->hfield_size[k]);
  for (int i = 0; i < 2; ++i) {
    CHECK(g.geom_rbound[i] == doctest::Approx(m->geom_rbound[i]).epsilon(1e-12));
    CHECK(g.geom_data[i] == m->geom_dataid[i]);
    for (int k = 0; k < 3; ++k) CHECK(g.geom_size[i][k] == doctest::Approx(m->geom_size[3 * i + k]).epsilon(1e-12));
    for (int k = 0; k < 3; ++k) CHECK(g.geom_pos[i][k] == doctest::Approx(m->geom_pos[3 * i + k]).epsilon(1e-12));
  }
  CHECK(g.body_mass[1] == doctest::Approx(m->body_mass[1]).epsilon(1e-12));
  for (int k = 0; k < 3; ++k) CHECK(g.body_inertia[1][k] == doctest::Approx(m->body_inertia[3 + k]).epsilon(1e-12));
}
}  // namespace

TEST_CASE("height fields: pictures of all kinds, binary, inline" * doctest::test_suite("data")) {
  std::mt19937 random(7);
  for (int channels = 1; channels <= 4; ++channels) {
    auto bytes = io::make_bitmap<std::uint8_t>(5, 4, channels);
    auto words = io::make_bitmap<std::uint16_t>(4, 7, channels);
    for (auto& p : bytes.pixels) p = std::uint8_t(random());
    for (auto& p : words.pixels) p = std::uint16_t(random());
    CAPTURE(channels);
    auto const a = io::format_png(bytes), b = io::format_png(words);
    compare_field("", "a.png", a, io::parse_hfield(a, "a.png"));
    compare_field("", "b.png", b, io::parse_hfield(b, "b.png"));
  }
  auto const binary = hfield_binary(3, 4, {1, 2, 3, 4, -5, 6, 7, 8, 9, 2, 1, 0});
  compare_field("", "c.bin", binary, io::parse_hfield(binary, "c.bin"));
  compare_field("nrow='2' ncol='3' elevation='1 2 3 4 5 7'", "", {}, io::make_hfield(2, 3, std::vector<double>{1, 2, 3, 4, 5, 7}, "h"));
  compare_field("nrow='2' ncol='3'", "", {}, io::make_hfield(2, 3, {}, "h"));
  compare_field("nrow='2' ncol='2' elevation='7 7 7 7'", "", {}, io::make_hfield(2, 2, std::vector<double>(4, 7.), "h"));
  for (std::string const path : {"models/mujoco_playground/go1/assets/hfield.png", "models/mujoco_warp/unitree_g1/assets/hfield.png"}) {
    auto const file = gsp_test::data(path);
    if (!file) {
      gsp_test::skip(std::string(path) + " is missing from GSP_DATA_DIR");
      continue;
    }
    auto const bytes = io::read_file(*file);
    compare_field("", "real.png", bytes, io::read_hfield(*file));
  }
}
