// Pairs of the convex routine against MuJoCo on random placements that touch, in double. What decides is a certificate that needs no
// oracle: along our normal the supports of the two shapes overlap by our depth, and no direction can overlap by less than the true depth;
// so a depth that is not above MuJoCo's by more than 1e-6 of the size is the least, and its normal a right one. GSP_PLACEMENTS=10000: as
// many a pair as that (default 300, the seconds that a test may take).
#include <doctest/doctest.h>
#include <mujoco/mujoco.h>

#include <cstdio>
#include <cstdlib>
#include <gsp/collision/detail/hull_faces.hpp>
#include <gsp/collision/narrowphase.hpp>
#include <gsp/collision/shape_distance.hpp>
#include <random>
#include <string>
#include <vector>

using namespace gsp;

namespace {

int placements() {
  char const* const text = std::getenv("GSP_PLACEMENTS");
  return text ? std::atoi(text) : 300;
}

struct Random {
  std::mt19937 engine{7};
  double operator()() { return std::uniform_real_distribution<double>(-1, 1)(engine); }
  double gauss() { return std::normal_distribution<double>()(engine); }
};

std::string numbers(std::vector<double> const& x) {
  std::string s;
  char text[40];
  for (double v : x) {
    std::snprintf(text, sizeof text, "%.9g ", v);
    s += text;
  }
  return s;
}

/// One of our meshes or height fields, from MuJoCo's own arrays.
struct Asset {
  std::vector<Vec3<double>> vertices, normals;
  std::vector<int> hull;
  std::vector<double> elevation;
  detail::HullFaces faces;
  ShapeAsset<double> asset;
};

void read_mesh(mjModel const* m, int mesh, Asset& a) {
  std::vector<std::array<float, 3>> points;
  for (int i = 0; i < m->mesh_vertnum[mesh]; ++i) {
    float const* const v = m->mesh_vert + 3 * (m->mesh_vertadr[mesh] + i);
    points.push_back({v[0], v[1], v[2]});
    a.vertices.push_back({v[0], v[1], v[2]});
  }
  int const* const graph = m->mesh_graph + m->mesh_graphadr[mesh];
  int const count = graph[0];
  int const triangles = graph[1];
  a.hull.assign(graph + 2 + count, graph + 2 + 2 * count);
  std::sort(a.hull.begin(), a.hull.end());
  int const* const f = graph + 2 + 3 * count + 3 * triangles;
  std::vector<std::array<int, 3>> hull;
  for (int i = 0; i < triangles; ++i) hull.push_back({f[3 * i], f[3 * i + 1], f[3 * i + 2]});
  a.faces = detail::hull_faces(points, a.hull, hull);
  a.normals = a.faces.normal;
  a.asset.vertices = a.vertices.data();
  a.asset.hull = a.hull.data();
  a.asset.vertex_count = int(points.size());
  a.asset.hull_count = count;
  a.asset.face_count = int(a.normals.size());
  a.asset.face_first = a.faces.first.data();
  a.asset.face_corners = a.faces.corners.data();
  a.asset.face_normal = a.normals.data();
  a.asset.neighbor_first = a.faces.neighbor_first.data();
  a.asset.neighbors = a.faces.neighbors.data();
}

/// Two shapes in MuJoCo, the second on a free body; the first, too, unless it is a plane or a height field.
struct Scene {
  mjModel* m = nullptr;
  mjData* d = nullptr;
  ShapeType type[2];
  Asset asset[2];
  Scene(ShapeType a, ShapeType b, Random& random, double margin, int mesh_points) : type{a, b} {
    std::string assets, bodies;
    for (int k = 0; k < 2; ++k) {
      std::string const name = std::string("g") + char('0' + k);
      std::string geom = "<geom margin='" + numbers({margin}) + "' type='" + std::string(shape_name(type[k])) + "' ";
      if (type[k] == ShapeType::mesh) {
        std::vector<double> points;
        for (int i = 0; i < mesh_points; ++i) {
          double const x = random.gauss(), y = random.gauss(), z = random.gauss();
          double const r = 0.3 / std::sqrt(x * x + y * y + z * z);
          for (double v : {r * x, 0.8 * r * y, 0.6 * r * z}) points.push_back(v);
        }
        assets += "<mesh name='" + name + "' vertex='" + numbers(points) + "'/>";
        geom += "mesh='" + name + "'/>";
      } else if (type[k] == ShapeType::hfield) {
        std::vector<double> height;
        for (int i = 0; i < 63; ++i) height.push_back(random());
        assets += "<hfield name='" + name + "' nrow='7' ncol='9' size='1.6 1.2 0.2 0.3' elevation='" + numbers(height) + "'/>";
        geom += "hfield='" + name + "'/>";
      } else {
        geom += "size='" + numbers({0.25 + 0.15 * random(), 0.25 + 0.15 * random(), 0.25 + 0.15 * random()}) + "'/>";
      }
      bool const fixed = type[k] == ShapeType::plane || type[k] == ShapeType::hfield;
      bodies += fixed ? geom : "<body><freejoint/>" + geom + "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body>";
    }
    std::string const text = "<mujoco><option ccd_tolerance='1e-12' ccd_iterations='1000'><flag multiccd='disable'/></option><asset>" +
                             assets + "</asset><worldbody>" + bodies + "</worldbody></mujoco>";
    char error[500] = "";
    mjSpec* const spec = mj_parseXMLString(text.c_str(), nullptr, error, sizeof error);
    REQUIRE_MESSAGE(spec != nullptr, error);
    m = mj_compile(spec, nullptr);
    REQUIRE_MESSAGE(m != nullptr, mjs_getError(spec));
    mj_deleteSpec(spec);
    d = mj_makeData(m);
    for (int k = 0; k < 2; ++k) {
      if (type[k] == ShapeType::mesh) read_mesh(m, m->geom_dataid[k], asset[k]);
      if (type[k] == ShapeType::hfield) {
        for (int i = 0; i < 63; ++i) asset[k].elevation.push_back(m->hfield_data[i]);
        asset[k].asset.elevation = asset[k].elevation.data();
        asset[k].asset.rows = 7;
        asset[k].asset.columns = 9;
        for (int i = 0; i < 4; ++i) asset[k].asset.extent[i] = m->hfield_size[i];
      }
    }
  }
  Scene(Scene const&) = delete;
  ~Scene() {
    mj_deleteData(d);
    mj_deleteModel(m);
  }
  bool has_asset(int k) const { return type[k] == ShapeType::mesh || type[k] == ShapeType::hfield; }
  Shape<double> shape(int g) const {
    Shape<double> s;
    for (int i = 0; i < 3; ++i) {
      s.p[i] = d->geom_xpos[3 * g + i];
      s.size[i] = m->geom_size[3 * g + i];
    }
    for (int i = 0; i < 9; ++i) s.R.m[i] = d->geom_xmat[9 * g + i];
    if (has_asset(g)) s.asset = &asset[g].asset;
    return s;
  }
};

/// max n.x over a - min n.y over b
double overlap(ShapeType ta, Shape<double> const& a, ShapeType tb, Shape<double> const& b, Vec3<double> const& n) {
  auto const top = [](ShapeType t, Shape<double> const& s, Vec3<double> const& d) {
    return dot(d, s.p) + dot(transpose_times(s.R, d), support(t, ShapeData<double>{s.size, s.asset}, transpose_times(s.R, d)));
  };
  return top(ta, a, n) + top(tb, b, -n);
}

/// The overlap along n of the prism that a point of height field a belongs to and b, by its corners.
double prism_overlap(Shape<double> const& a, int feature, ShapeType tb, Shape<double> const& b, Vec3<double> const& n) {
  auto const& field = *a.asset;
  int const prism = feature / 4, half = prism % 2, r = prism / 2 / (field.columns - 1), c = prism / 2 % (field.columns - 1);
  Vec3<double> const tops[3] = {HfieldShape::point(field, r, c), HfieldShape::point(field, half ? r : r + 1, half ? c + 1 : c),
                                HfieldShape::point(field, r + 1, c + 1)};
  double top = -1e30;
  for (auto const& q : tops)
    for (double z : {q.z, -field.extent[3]}) top = std::max(top, dot(n, a.p + a.R * Vec3<double>{q.x, q.y, z}));
  auto const m = transpose_times(b.R, n);
  return top - dot(n, b.p) - dot(m, support(tb, ShapeData<double>{b.size, b.asset}, -m));
}

struct Tally {
  int placements = 0, touching = 0, points = 0, bad = 0, left_out = 0, oracle_deeper = 0, oracle_wrong = 0;
  double depth = 0, normal = 0, certificate = 0;
};

Tally compare(ShapeType ta, ShapeType tb, int wanted) {
  Random random, direction;
  Tally tally;
  bool const field = ta == ShapeType::hfield;
  bool const certified = !field && ta != ShapeType::plane;
  bool const flat = (ta == ShapeType::box || ta == ShapeType::mesh) && tb == ShapeType::mesh;
  int const sets = 10;
  for (int set = 0; set < sets; ++set) {
    double const margin = set % 2 ? 0.01 : 0;
    Scene scene(ta, tb, random, margin, set < 5 ? 12 : 200);
    bool const fixed = ta == ShapeType::plane || field;
    double const reach = fixed ? 0.45 : scene.m->geom_rbound[0] + scene.m->geom_rbound[1];
    int const enough = tally.touching + wanted / sets;
    for (int tries = 0; tally.touching < enough && tries < 20 * wanted; ++tries) {
      int const bodies = fixed ? 1 : 2;
      for (int b = 0; b < bodies; ++b) {
        double* const q = scene.d->qpos + 7 * b;
        for (int i = 0; i < 3; ++i) q[i] = b == bodies - 1 ? reach * random() : 0.1 * random();
        for (int i = 0; i < 4; ++i) q[3 + i] = random.gauss();
        mju_normalize4(q + 3);
      }
      mj_kinematics(scene.m, scene.d);
      mj_comPos(scene.m, scene.d);
      mj_collision(scene.m, scene.d);
      auto const a = scene.shape(0), b = scene.shape(1);
      ContactPoints<double, 16> ours;
      narrowphase(pair_kind(ta, tb), a, b, 2 * margin, ours);
      ++tally.placements;
      REQUIRE(ours.count <= max_points(pair_kind(ta, tb)));
      int const n = scene.d->ncon;
      if (n == 0 && ours.count == 0) continue;
      auto const& c = scene.d->contact;
      int i = 0, j = 0;
      for (int k = 1; k < ours.count; ++k)
        if (ours.point[k].dist < ours.point[i].dist) i = k;
      for (int k = 1; k < n; ++k)
        if (c[k].dist < c[j].dist) j = k;
      double const dist = ours.count ? ours.point[i].dist : 1e30;
      double const other = n ? c[j].dist : 1e30;
      if (std::min(dist, other) > 2 * margin - 1e-6) {  // on the edge of touching, rounding decides
        ++tally.left_out;
        continue;
      }
      ++tally.touching;
      tally.points += ours.count;
      std::string fault;
      if (ours.count == 0) {
        fault = "missed";
      } else {
        auto const& p = ours.point[i];
        if (certified || field) {  // our depth is what the supports say
          double const excess = (field ? prism_overlap(a, p.feature, tb, b, p.normal) : overlap(ta, a, tb, b, p.normal)) + dist;
          tally.certificate = std::max(tally.certificate, std::abs(excess));
          if (!(std::abs(excess) < 1e-6)) fault = "not what the supports say";
        }
        // a distance is less than that along a normal: of two right answers the one with the larger dist is better
        double const worse = other - dist;
        double const theirs = certified && n > 0 ? overlap(ta, a, tb, b, {c[j].frame[0], c[j].frame[1], c[j].frame[2]}) : -other;
        if (field && tb >= ShapeType::box) {
          // MuJoCo's depths of two polyhedra here are those of a clipped patch, less than the overlap: ours is no less, and no direction
          // overlaps by less
          if (worse < -1e-6) fault = "too shallow";
          tally.oracle_wrong += worse > 1e-6;
          for (int k = 0; k < 200; ++k) {
            double const step = k < 100 ? 10 : std::pow(0.5, k % 20);
            auto const d = normalized(p.normal + step * Vec3<double>{direction.gauss(), direction.gauss(), direction.gauss()});
            if (prism_overlap(a, p.feature, tb, b, d) < -dist - 1e-6) fault = "not the least";
          }
        } else if (worse < -1e-6) {
          ++tally.oracle_deeper;
          if (!certified) fault = "too shallow";
        } else if (theirs + other > 1e-6) {  // MuJoCo's is no depth at all: along its own normal the supports overlap by more
          ++tally.oracle_wrong;
          if (-dist > theirs + 1e-6) fault = "deeper than along their normal";
        } else {
          if (!(worse < 1e-6)) fault = "deeper";
          tally.depth = std::max(tally.depth, std::abs(worse));
          double normal = 0;
          for (int k = 0; k < 3; ++k) normal = std::max(normal, std::abs(p.normal[k] - c[j].frame[k]));
          if (flat && !(normal < 1e-5)) {  // another face as deep?
            if (dist < 0 && theirs < overlap(ta, a, tb, b, p.normal) - 1e-9) fault = "normal";
          } else if (flat) {
            tally.normal = std::max(tally.normal, normal);
          }
        }
        for (int k = 0; k < ours.count; ++k)
          for (int l = 0; l < k; ++l)
            if (ours.point[k].feature == ours.point[l].feature) fault = "features repeat";
      }
      if (!fault.empty() && tally.bad++ < 5) {
        char line[300];
        std::string text = std::string(shape_name(ta)) + "-" + shape_name(tb) + " " + fault + ": ours";
        for (int k = 0; k < ours.count; ++k) {
          auto const& p = ours.point[k];
          std::snprintf(line, sizeof line, " [%.6f %.6f %.6f | %.9f | %.6f %.6f %.6f | %d]", p.pos.x, p.pos.y, p.pos.z, p.dist, p.normal.x,
                        p.normal.y, p.normal.z, p.feature);
          text += line;
        }
        text += "\n  theirs";
        for (int k = 0; k < n && k < 4; ++k) {
          std::snprintf(line, sizeof line, " [%.6f %.6f %.6f | %.9f | %.6f %.6f %.6f]", c[k].pos[0], c[k].pos[1], c[k].pos[2], c[k].dist,
                        c[k].frame[0], c[k].frame[1], c[k].frame[2]);
          text += line;
        }
        MESSAGE(text);
      }
    }
  }
  return tally;
}

}  // namespace

TEST_CASE("pairs without a closed form against MuJoCo, certified by supports") {
  using S = ShapeType;
  for (auto const& pair : shape_pairs) {
    bool const closed = !pair.convex && pair.b != S::mesh && pair.b != S::ellipsoid;
    std::string const name = std::string(shape_name(pair.a)) + "-" + shape_name(pair.b);
    char const* const only = std::getenv("GSP_PAIR");
    if (closed || (only && std::string(only) != name)) continue;
    int const wanted = placements();
    auto const t = compare(pair.a, pair.b, wanted);
    MESSAGE(doctest::String(name.c_str()), ": ", t.touching, " of ", t.placements, " touch, ", t.points, " points, ", t.left_out,
            " left out, ", t.bad, " bad, ", t.oracle_deeper, " where MuJoCo's depth is not the least, ", t.oracle_wrong,
            " where it is less than along its own normal; depth ", t.depth, ", normal of polyhedra ", t.normal, ", certificate ",
            t.certificate);
    CHECK(t.touching == wanted);
    CHECK(t.bad == 0);
  }
}

namespace {
/// How far x lies outside of a shape, by its supports along n and many directions round it; 0 inside.
double outside(ShapeType t, Shape<double> const& s, Vec3<double> const& x, Vec3<double> const& n, Random& random) {
  double most = 0;
  for (int k = 0; k < 40; ++k) {
    double const step = std::pow(10., -(k % 5));
    auto const d = normalized(n + step * Vec3<double>{random.gauss(), random.gauss(), random.gauss()});
    auto const l = transpose_times(s.R, d);
    most = std::max(most, dot(d, x - s.p) - dot(l, support(t, ShapeData<double>{s.size, s.asset}, l)));
  }
  return most;
}
}  // namespace

// shape_distance beside mj_geomDistance with ccd_tolerance 1e-12, all pairs of types that have a distance, half of them in any order.
// - Distances: within 1e-9. MuJoCo's are those of its two points, whose error is that of the distance's square root: it ends where a step
//   gains less than the tolerance, and is up to 4e-10 above ours with ellipsoids and cylinders. Ours are certified: along our normal the
//   supports are as far apart, to 1e-12, and no normal can say more (apart) or less (inside) than the distance.
// - A capsule whose segment enters a box: MuJoCo's function gives less than the overlap along its own normal; there the certificate alone
//   decides, and that theirs fails it.
// - Points: as far apart as the distance says, and in their shapes to 3e-6 (a normal is known to the root of 1e-12). Where no core is
//   curved, MuJoCo's to 1e-9; where such cores overlap, it searches as far as its tolerance, and its points are known to the root of it.
TEST_CASE("distances of shapes against MuJoCo, certified by supports") {
  using S = ShapeType;
  S const all[] = {S::plane, S::sphere, S::capsule, S::ellipsoid, S::cylinder, S::box, S::mesh};
  auto const curved = [](S t) { return t == S::ellipsoid || t == S::cylinder; };
  auto const round = [](S t) { return t == S::sphere || t == S::capsule; };
  Random chosen;
  for (S const ta : all)
    for (S const tb : all) {
      if (ta > tb || tb == S::plane) continue;
      Random random;
      double worst = 0, certificate = 0, lies = 0, points = 0, normal = 0;
      int inside = 0, apart = 0, pierced = 0;
      for (int set = 0; set < 10; ++set) {
        Scene scene(ta, tb, random, 0, 20);
        for (int k = 0; k < placements() / 10; ++k) {
          int const bodies = ta == S::plane ? 1 : 2;
          for (int b = 0; b < bodies; ++b) {
            double* const q = scene.d->qpos + 7 * b;
            for (int i = 0; i < 3; ++i) q[i] = b == bodies - 1 ? 0.7 * random() : 0.1 * random();
            for (int i = 0; i < 4; ++i) q[3 + i] = random.gauss();
            mju_normalize4(q + 3);
          }
          mj_kinematics(scene.m, scene.d);
          auto const a = scene.shape(0), b = scene.shape(1);
          double theirs[6];
          double const dist = mj_geomDistance(scene.m, scene.d, 0, 1, 10, theirs);
          auto const ours = shape_distance(ta, a, tb, b, 10.);
          REQUIRE(ours.near);
          auto const turned = shape_distance(tb, b, ta, a, 10.);
          CHECK(std::abs(turned.dist - ours.dist) < 1e-9);
          if (ta != tb) CHECK(norm(turned.from - ours.to) == 0);
          (ours.dist < 0 ? inside : apart) += 1;
          auto const n = (1 / ours.dist) * (ours.to - ours.from);
          CHECK(std::abs(norm(n) - 1) < 1e-9);
          if (ta != S::plane) {
            certificate = std::max(certificate, std::abs(overlap(ta, a, tb, b, n) + ours.dist));
            lies = std::max(lies, outside(ta, a, ours.from, n, chosen));
          }
          lies = std::max(lies, outside(tb, b, ours.to, -n, chosen));
          Vec3<double> const from{theirs[0], theirs[1], theirs[2]}, to{theirs[3], theirs[4], theirs[5]}, m = (1 / dist) * (to - from);
          if (ta == S::capsule && tb == S::box && ours.dist < -a.size.x) {
            if (std::abs(ours.dist - dist) < 1e-9) continue;
            ++pierced;
            CHECK(ours.dist < dist);
            CHECK(overlap(ta, a, tb, b, m) > -dist + 1e-9);
            continue;
          }
          worst = std::max(worst, std::abs(ours.dist - dist));
          if (std::abs(dist) > 1e-3) normal = std::max(normal, norm(n - m));
          bool const exact = !curved(ta) && !curved(tb) && !(tb == S::mesh && round(ta) && ours.dist < 0);
          if (exact) points = std::max({points, norm(ours.from - from), norm(ours.to - to)});
          for (double const cutoff : {0., ours.dist + 1e-9, ours.dist - 1e-9}) {
            auto const some = shape_distance(ta, a, tb, b, cutoff);
            CHECK(some.near == (ours.dist < cutoff));
            CHECK(some.dist == doctest::Approx(std::min(ours.dist, cutoff)).epsilon(1e-12));
            if (!some.near) CHECK(norm(some.from) + norm(some.to) == 0);
          }
        }
      }
      MESSAGE(doctest::String((std::string(shape_name(ta)) + "-" + shape_name(tb)).c_str()), ": ", inside, " inside, ", apart,
              " apart; distance ", worst, ", certificate ", certificate, ", points outside ", lies, ", points of polyhedra ", points,
              ", normal ", normal, "; segments in a box ", pierced);
      CHECK(inside > placements() / 20);
      CHECK(apart > placements() / 20);
      CHECK(worst < 1e-9);
      CHECK(certificate < 1e-12);
      CHECK(lies < 3e-6);
      CHECK(points < 1e-9);
      CHECK(normal < 1e-4);
    }
}
