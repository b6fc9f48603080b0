// Contact geometry of every covered pair against MuJoCo on 10,000 random placements that touch, in double: the set of points, their depths
// and normals.
#include <doctest/doctest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cstdio>
#include <gsp/collision/detail/segment.hpp>
#include <gsp/collision/narrowphase.hpp>
#include <random>
#include <string>
#include <vector>

using namespace gsp;

namespace {

struct PairCase {
  char const* name;
  ShapeType a, b;
};

char const* shape_xml(ShapeType type) {
  switch (type) {
    case ShapeType::plane:
      return "plane";
    case ShapeType::sphere:
      return "sphere";
    case ShapeType::capsule:
      return "capsule";
    case ShapeType::cylinder:
      return "cylinder";
    default:
      return "box";
  }
}

/// Two shapes on free bodies (a plane on the world) in MuJoCo, with sizes of their own.
struct Oracle {
  mjModel* m = nullptr;
  mjData* d = nullptr;
  Oracle(ShapeType a, ShapeType b, double const (&size)[6], double const (&quat)[4], double margin) {
    char text[2048];
    auto const geom = [&](ShapeType type, double const* s, char* out, std::size_t n) {
      if (type == ShapeType::plane)
        std::snprintf(out, n, "<geom type='plane' size='1 1 1' pos='0.1 -0.2 0.05' quat='%.17g %.17g %.17g %.17g' margin='%.17g'/>",
                      quat[0], quat[1], quat[2], quat[3], margin);
      else
        std::snprintf(out, n, "<body><freejoint/><geom type='%s' size='%.17g %.17g %.17g' margin='%.17g'/></body>", shape_xml(type), s[0],
                      s[1], s[2], margin);
    };
    char first[512], second[512];
    geom(a, size, first, sizeof first), geom(b, size + 3, second, sizeof second);
    // Without multiccd: with it MuJoCo replaces the depth of its iterative pairs by those of a clipped patch, up to several times less than
    // the overlap.
    std::snprintf(text, sizeof text,
                  "<mujoco><option ccd_tolerance='1e-12' ccd_iterations='1000'><flag "
                  "multiccd='disable'/></option><worldbody>%s%s</worldbody></mujoco>",
                  first, second);
    char error[500] = "";
    mjSpec* const spec = mj_parseXMLString(text, nullptr, error, sizeof error);
    REQUIRE_MESSAGE(spec != nullptr, error);
    m = mj_compile(spec, nullptr);
    REQUIRE_MESSAGE(m != nullptr, mjs_getError(spec));
    mj_deleteSpec(spec);
    d = mj_makeData(m);
  }
  Oracle(Oracle const&) = delete;
  ~Oracle() {
    mj_deleteData(d);
    mj_deleteModel(m);
  }
  Shape<double> shape(int g) const {
    Shape<double> s;
    for (int i = 0; i < 3; ++i) s.p[i] = d->geom_xpos[3 * g + i], s.size[i] = m->geom_size[3 * g + i];
    for (int i = 0; i < 9; ++i) s.R.m[i] = d->geom_xmat[9 * g + i];
    return s;
  }
};

struct Tally {
  int placements = 0, touching = 0, points = 0, left_out = 0, entered = 0, bad = 0;
  double pos = 0, dist = 0, normal = 0, excess = 0;
};

/// max n.x over a - min n.y over b
double overlap(PairCase const& pair, Shape<double> const& a, Shape<double> const& b, Vec3<double> const& n) {
  auto const top = [](ShapeType t, Shape<double> const& s, Vec3<double> const& d) {
    return dot(d, s.p) + dot(transpose_times(s.R, d), support(t, ShapeData<double>{s.size, s.asset}, transpose_times(s.R, d)));
  };
  return top(pair.a, a, n) + top(pair.b, b, -n);
}

/// The least overlap over directions, by search alone: 300 of them all round, and from the lowest eight downhill in ever smaller steps.
double least_overlap(PairCase const& pair, Shape<double> const& a, Shape<double> const& b) {
  std::vector<std::pair<double, Vec3<double>>> seen;
  for (int i = 0; i < 300; ++i) {
    double const z = (i + 0.5) / 150 - 1, turn = 2.399963229728653 * i, r = std::sqrt(1 - z * z);
    Vec3<double> const n{r * std::cos(turn), r * std::sin(turn), z};
    seen.push_back({overlap(pair, a, b, n), n});
  }
  std::partial_sort(seen.begin(), seen.begin() + 8, seen.end(), [](auto const& x, auto const& y) { return x.first < y.first; });
  double least = seen[0].first;
  for (int k = 0; k < 8; ++k) {
    auto [depth, n] = seen[k];
    for (double step = 0.1, turn = 0; step > 1e-9; turn += 2.4) {  // other directions each time, or an edge would stop it
      auto const frame = contact_frame(n);
      bool lower = false;
      for (int i = 0; i < 16 && !lower; ++i) {
        double const x = step * std::cos(turn + 0.3926990817 * i), y = step * std::sin(turn + 0.3926990817 * i);
        auto const m = normalized(n + x * Vec3<double>{frame(1, 0), frame(1, 1), frame(1, 2)} +
                                  y * Vec3<double>{frame(2, 0), frame(2, 1), frame(2, 2)});
        double const there = overlap(pair, a, b, m);
        lower = there < depth;
        if (lower) depth = there, n = m;
      }
      if (!lower) step *= 0.7;
    }
    least = std::min(least, depth);
  }
  return least;
}

enum class Rule { set, deepest, depth };

Tally compare(PairCase const& pair, Rule rule, int wanted) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> gauss;
  Tally tally;
  auto const kind = pair_kind(pair.a, pair.b);
  REQUIRE(kind != PairKind::none);
  int const sets = 20;
  for (int set = 0; set < sets; ++set) {
    double size[6], quat[4];
    for (double& s : size) s = 0.1 + 0.15 * (1 + uniform(random));
    for (double& q : quat) q = gauss(random);
    double const margin = set % 2 ? 0.02 : 0;  // of each geom: the pair's is the sum
    Oracle oracle(pair.a, pair.b, size, quat, margin);
    bool const plane = pair.a == ShapeType::plane;
    double const reach = oracle.m->geom_rbound[1] + (plane ? 0 : oracle.m->geom_rbound[0]);
    for (int touching = 0, tries = 0; touching < wanted / sets && tries < 50 * wanted; ++tries) {
      int const bodies = plane ? 1 : 2;
      for (int b = 0; b < bodies; ++b) {
        double* const q = oracle.d->qpos + 7 * b;
        for (int i = 0; i < 3; ++i) q[i] = b == bodies - 1 ? reach * uniform(random) : 0.1 * uniform(random);
        for (int i = 0; i < 4; ++i) q[3 + i] = gauss(random);
        mju_normalize4(q + 3);
      }
      mj_kinematics(oracle.m, oracle.d);
      mj_comPos(oracle.m, oracle.d);
      mj_collision(oracle.m, oracle.d);
      auto const a = oracle.shape(0), b = oracle.shape(1);
      ContactPoints<double, 8> ours;
      narrowphase(kind, a, b, 2 * margin, ours);
      ++tally.placements;
      int const n = oracle.d->ncon;
      mjContact const* const theirs = oracle.d->contact;
      if (n == 0 && ours.count == 0) continue;

      // The segment of a capsule inside the other shape: MuJoCo's answer is another one there. Ours is told by supports: it is the overlap
      // along its normal, and no direction that a search finds overlaps by less.
      if (rule != Rule::set) {
        Vec3<double> const c = transpose_times(b.R, a.p - b.p), u = a.size.y * transpose_times(b.R, column(a.R, 2));
        double const t =
            rule == Rule::deepest ? detail::nearest_to_box(c, u, b.size) : detail::nearest_to_cylinder(c, u, b.size.x, b.size.y);
        auto const s =
            rule == Rule::deepest ? detail::box_distance(c + t * u, b.size) : detail::cylinder_distance(c + t * u, b.size.x, b.size.y);
        if (s.dist < 1e-6) {
          ++tally.entered;
          int deepest = 0;
          for (int i = 1; i < ours.count; ++i)
            if (ours.point[i].dist < ours.point[deepest].dist) deepest = i;
          REQUIRE(ours.count > 0);
          auto const& p = ours.point[deepest];
          double const least = least_overlap(pair, a, b) - a.size.x, depth = -p.dist - a.size.x;  // of the segment
          double const excess = depth - least;
          double const along = overlap(pair, a, b, p.normal) - a.size.x;
          bool const certified = std::abs(along - depth) < 1e-6;
          tally.excess = std::max(tally.excess, excess);
          if ((!certified || !(excess < 1e-6)) && tally.bad++ < 5)
            MESSAGE(doctest::String(pair.name) << ", entered: ours " << depth << " along " << p.normal.x << " " << p.normal.y << " "
                                               << p.normal.z << ", overlap there " << along << ", least " << least);
          continue;
        }
      }
      // On the edge of touching, rounding decides.
      bool edge = false;
      for (int i = 0; i < n; ++i) edge = edge || std::abs(theirs[i].dist - 2 * margin) < 1e-9;
      for (int i = 0; i < ours.count; ++i) edge = edge || std::abs(ours.point[i].dist - 2 * margin) < 1e-9;
      if (edge) {
        ++tally.left_out;
        continue;
      }
      ++touching, ++tally.touching, tally.points += ours.count;
      auto const difference = [&](ContactPoint<double> const& p, mjContact const& q, double& pos, double& dist, double& normal) {
        pos = normal = 0, dist = std::abs(p.dist - q.dist);
        for (int k = 0; k < 3; ++k)
          pos = std::max(pos, std::abs(p.pos[k] - q.pos[k])), normal = std::max(normal, std::abs(p.normal[k] - q.frame[k]));
      };
      bool good = true;
      if (rule == Rule::set) {
        good = n == ours.count;
        std::vector<char> taken(n, 0);
        for (int i = 0; i < ours.count && good; ++i) {
          int best = -1;
          double best_pos = 1e30;
          for (int j = 0; j < n; ++j) {
            double pos, dist, normal;
            difference(ours.point[i], theirs[j], pos, dist, normal);
            if (!taken[j] && pos < best_pos) best = j, best_pos = pos;
          }
          taken[best] = 1;
          double pos, dist, normal;
          difference(ours.point[i], theirs[best], pos, dist, normal);
          good = pos < 1e-6 && dist < 1e-6 && normal < 1e-6;
          if (good)
            tally.pos = std::max(tally.pos, pos), tally.dist = std::max(tally.dist, dist), tally.normal = std::max(tally.normal, normal);
        }
      } else {
        good = n > 0 && ours.count > 0;
        if (good) {
          int i = 0, j = 0;
          for (int k = 1; k < ours.count; ++k)
            if (ours.point[k].dist < ours.point[i].dist) i = k;
          for (int k = 1; k < n; ++k)
            if (theirs[k].dist < theirs[j].dist) j = k;
          double pos, dist, normal;
          difference(ours.point[i], theirs[j], pos, dist, normal);
          good = dist < 1e-6 && (rule == Rule::depth || (pos < 1e-6 && normal < 1e-6));
          if (good) tally.dist = std::max(tally.dist, dist);
          if (good && rule == Rule::deepest) tally.pos = std::max(tally.pos, pos), tally.normal = std::max(tally.normal, normal);
        }
      }
      if (!good && tally.bad++ < 5) {
        std::string text = std::string(pair.name) + ", margin " + std::to_string(2 * margin) + ": ours";
        char line[200];
        for (int i = 0; i < ours.count; ++i) {
          auto const& p = ours.point[i];
          std::snprintf(line, sizeof line, " [%.7f %.7f %.7f | %.9f | %.5f %.5f %.5f]", p.pos.x, p.pos.y, p.pos.z, p.dist, p.normal.x,
                        p.normal.y, p.normal.z);
          text += line;
        }
        text += "\n  theirs";
        for (int i = 0; i < n; ++i) {
          auto const& q = theirs[i];
          std::snprintf(line, sizeof line, " [%.7f %.7f %.7f | %.9f | %.5f %.5f %.5f]", q.pos[0], q.pos[1], q.pos[2], q.dist, q.frame[0],
                        q.frame[1], q.frame[2]);
          text += line;
        }
        MESSAGE(text);
      }
    }
  }
  return tally;
}

void check(PairCase const& pair, Rule rule) {
  int const wanted = 10000;
  auto const t = compare(pair, rule, wanted);
  MESSAGE(doctest::String(pair.name), ": ", t.touching, " of ", t.placements, " placements touch, ", t.points, " points, ", t.left_out,
          " left out, ", t.entered, " entered by a segment, at most ", t.excess, " deeper than the least, ", t.bad,
          " differ; largest difference: position ", t.pos, ", depth ", t.dist, ", normal ", t.normal);
  CHECK(t.touching == wanted);
  CHECK(t.bad == 0);
}

}  // namespace

TEST_CASE("closed forms equal MuJoCo's contacts to 1e-6") {
  using S = ShapeType;
  for (PairCase const& pair : {PairCase{"plane-sphere", S::plane, S::sphere}, PairCase{"plane-capsule", S::plane, S::capsule},
                               PairCase{"plane-cylinder", S::plane, S::cylinder}, PairCase{"plane-box", S::plane, S::box},
                               PairCase{"sphere-sphere", S::sphere, S::sphere}, PairCase{"sphere-capsule", S::sphere, S::capsule},
                               PairCase{"sphere-cylinder", S::sphere, S::cylinder}, PairCase{"sphere-box", S::sphere, S::box},
                               PairCase{"capsule-capsule", S::capsule, S::capsule}})
    check(pair, Rule::set);
}
TEST_CASE("capsule-box: the deepest contact; segments inside the box by supports") {
  check({"capsule-box", ShapeType::capsule, ShapeType::box}, Rule::deepest);
}
TEST_CASE("capsule-cylinder: depth; segments inside the cylinder by supports") {
  check({"capsule-cylinder", ShapeType::capsule, ShapeType::cylinder}, Rule::depth);
}
TEST_CASE("box-box: the unreduced set of points") { check({"box-box", ShapeType::box, ShapeType::box}, Rule::set); }
