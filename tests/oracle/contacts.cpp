// The contact list of whole scenes against MuJoCo's: the same pairs, points, depths, frames and mixed parameters, while MuJoCo moves the
// scene.
#include <doctest/doctest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <gsp/collision/contacts.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp_test_execs.hpp>
#include <map>
#include <support/data.hpp>
#include <tuple>
#include <vector>

using namespace gsp;

namespace {
using Host = Kokkos::DefaultHostExecutionSpace;

/// Geom of MuJoCo for each of ours: bodies have the same numbers, and visual meshes are left out.
std::vector<int> geom_map(mjModel const* o, CompiledModel const& m) {
  std::vector<int> map;
  REQUIRE(m.nbody == o->nbody);
  for (int b = 0; b < o->nbody; ++b) {
    int k = 0;
    for (int g = o->body_geomadr[b]; g < o->body_geomadr[b] + o->body_geomnum[b]; ++g) {
      if (o->geom_type[g] == mjGEOM_MESH && o->geom_contype[g] == 0 && o->geom_conaffinity[g] == 0) continue;
      REQUIRE(m.geom_type[m.body_geomadr[b] + k] == o->geom_type[g]);
      map.push_back(g), ++k;
    }
    REQUIRE(m.body_geomnum[b] == k);
  }
  return map;
}

/// MuJoCo's model of a file without its visual meshes, textures and materials, whose files may be missing.
mjModel* load_without_visuals(std::string const& path) {
  char error[1000] = "";
  mjSpec* const spec = mj_parseXML(path.c_str(), nullptr, error, sizeof error);
  REQUIRE_MESSAGE(spec != nullptr, doctest::String(error));
  auto const each = [&](mjtObj type, auto const& f) {
    std::vector<mjsElement*> all;
    for (mjsElement* e = mjs_firstElement(spec, type); e != nullptr; e = mjs_nextElement(spec, e)) all.push_back(e);
    for (mjsElement* e : all) f(e);
  };
  each(mjOBJ_GEOM, [&](mjsElement* e) {
    mjsGeom* const g = mjs_asGeom(e);
    mjs_setString(g->material, "");
    if (g->type == mjGEOM_MESH && g->contype == 0 && g->conaffinity == 0) mjs_delete(spec, e);
  });
  each(mjOBJ_SITE, [&](mjsElement* e) { mjs_setString(mjs_asSite(e)->material, ""); });
  for (mjtObj type : {mjOBJ_MATERIAL, mjOBJ_TEXTURE, mjOBJ_MESH}) each(type, [&](mjsElement* e) { mjs_delete(spec, e); });
  mjModel* const m = mj_compile(spec, nullptr);
  REQUIRE_MESSAGE(m != nullptr, doctest::String(mjs_getError(spec)));
  mj_deleteSpec(spec);
  return m;
}

struct Seen {
  long contacts = 0, pairs = 0, capsule_box = 0;
  double pos = 0, dist = 0, frame = 0, parameters = 0;
};

void compare_scene(std::string const& file, std::vector<int> const& steps, Seen& seen, bool disturb = false) {
  auto const path = gsp_test::data(file);
  if (!path) {
    MESSAGE("skipped: ", file, " is missing from GSP_DATA_DIR");
    return;
  }
  mjModel* const o = load_without_visuals(*path);
  o->opt.enableflags &= ~mjENBL_SLEEP;
  mjData* const d = mj_makeData(o);
  if (disturb)
    for (int i = 0; i < o->nv; ++i) d->qvel[i] = 2 * std::sin(1 + 1.7 * i);
  auto const m = compile(io::read_mjcf(*path, {.skip_visuals = true, .approximate = true}));
  auto const map = geom_map(o, m);
  Host const exec;
  auto const model = make_collision_model<double>(exec, m);
  auto contacts = make_contacts(exec, model, {.worlds = 1});
  auto poses = make_poses<double>(exec, 1, m.nbody, m.njnt);
  std::map<std::array<int, 2>, char> covered;  // pairs of shapes that we leave out are not compared
  for (auto const& p : m.pairs) covered[{map[p[0]], map[p[1]]}] = 1;

  int done = 0;
  for (int const stop : steps) {
    for (; done < stop; ++done) mj_step(o, d);
    mj_kinematics(o, d);
    mj_comPos(o, d);
    mj_collision(o, d);
    for (int b = 0; b < m.nbody; ++b) {
      for (int i = 0; i < 3; ++i) poses.xpos(0, b, i) = d->xpos[3 * b + i];
      for (int i = 0; i < 4; ++i) poses.xquat(0, b, i) = d->xquat[4 * b + i];
    }
    do collide(exec, model, poses, contacts);
    while (grow(exec, contacts));

    using Key = std::array<int, 2>;
    std::map<Key, std::vector<int>> ours, theirs;
    for (int i = contacts.begin_of(0); i < contacts.begin_of(0) + contacts.count_of(0); ++i)
      ours[{map[contacts.geom1(i)], map[contacts.geom2(i)]}].push_back(i);
    for (int i = 0; i < d->ncon; ++i) {
      Key const key{d->contact[i].geom[0], d->contact[i].geom[1]};
      if (covered.count(key)) theirs[key].push_back(i);
    }
    for (auto const& [key, list] : theirs)
      CHECK_MESSAGE(ours.count(key) == 1, file, ": step ", stop, ": geoms ", key[0], " and ", key[1], " touch in MuJoCo alone, dist ",
                    d->contact[list[0]].dist);
    for (auto const& [key, list] : ours) {
      if (!theirs.count(key)) {
        CHECK_MESSAGE(false, file, ": step ", stop, ": geoms ", key[0], " and ", key[1], " touch in gsp alone, dist ",
                      contacts.dist(list[0]));
        continue;
      }
      auto const& other = theirs.at(key);
      ++seen.pairs;
      // parameters
      auto const p = model.parameters_of(0, contacts.pair(list[0]));
      auto const& q = d->contact[other[0]];
      double worst = std::abs(contacts.includemargin(list[0]) - q.includemargin) + (p.condim != std::min(3, q.dim));
      for (int i = 0; i < 5; ++i) worst = std::max({worst, std::abs(p.friction[i] - q.friction[i]), std::abs(p.solimp[i] - q.solimp[i])});
      for (int i = 0; i < 2; ++i) worst = std::max(worst, std::abs(p.solref[i] - q.solref[i]));
      CHECK_MESSAGE(worst < 1e-12, file, ": geoms ", key[0], " and ", key[1], ": parameters");
      seen.parameters = std::max(seen.parameters, worst);

      auto const difference = [&](int i, int j, double& pos, double& dist, double& frame) {
        auto const& c = d->contact[j];
        pos = frame = 0, dist = std::abs(contacts.dist(i) - c.dist);
        for (int k = 0; k < 3; ++k) pos = std::max(pos, std::abs(contacts.pos(i, k) - c.pos[k]));
        for (int k = 0; k < 9; ++k) frame = std::max(frame, std::abs(contacts.frame(i, k) - c.frame[k]));
      };
      auto const kind = pair_kind(ShapeType(o->geom_type[key[0]]), ShapeType(o->geom_type[key[1]]));
      if (kind == PairKind::capsule_box || kind == PairKind::capsule_cylinder) {  // other points are chosen there: the deepest
        double deep = 1, other_deep = 1;
        for (int i : list) deep = std::min(deep, contacts.dist(i));
        for (int j : other) other_deep = std::min(other_deep, d->contact[j].dist);
        ++seen.capsule_box;
        CHECK_MESSAGE(std::abs(deep - other_deep) < 1e-6, file, ": step ", stop, ": geoms ", key[0], " and ", key[1]);
        continue;
      }
      CHECK_MESSAGE(list.size() == other.size(), file, ": step ", stop, ": geoms ", key[0], " and ", key[1], ": number of points");
      for (int i : list) {
        double pos = 1e30, dist = 0, frame = 0;
        for (int j : other) {
          double a, b, c;
          difference(i, j, a, b, c);
          if (a < pos) pos = a, dist = b, frame = c;
        }
        ++seen.contacts;
        CHECK_MESSAGE(std::max({pos, dist, frame}) < 1e-6, file, ": step ", stop, ": geoms ", key[0], " and ", key[1], ": position ", pos,
                      ", depth ", dist, ", frame ", frame);
        seen.pos = std::max(seen.pos, pos), seen.dist = std::max(seen.dist, dist), seen.frame = std::max(seen.frame, frame);
      }
    }
  }
  MESSAGE(doctest::String(file.c_str()), ": ", m.pairs.size(), " pairs, ", model.groups, " groups, ", contacts.count_of(0),
          " contacts at the end");
  mj_deleteData(d);
  mj_deleteModel(o);
}

void report(Seen const& s) {
  MESSAGE(s.pairs, " touching pairs, ", s.contacts, " points, ", s.capsule_box, " pairs by depth; largest difference: position ", s.pos,
          ", depth ", s.dist, ", frame ", s.frame);
}
}  // namespace

TEST_CASE("humanoids: alone, in a heap, and disturbed") {
  Seen seen;
  compare_scene("models/mujoco/humanoid/humanoid.xml", {0, 50, 100, 200, 400}, seen);
  compare_scene("models/mujoco/humanoid/humanoid.xml", {20, 100, 300}, seen, true);
  compare_scene("models/mujoco/humanoid/22_humanoids.xml", {0, 100, 300}, seen);
  report(seen);
}
TEST_CASE("a quadruped") {
  Seen seen;
  compare_scene("models/unitree/go2/scene.xml", {0, 100, 300}, seen);
  report(seen);
}
TEST_CASE("robots of the control suite, disturbed") {
  Seen seen;
  for (char const* name : {"finger", "hopper", "walker", "cheetah", "humanoid_CMU", "humanoid"})
    compare_scene(std::string("models/dm_control/suite/") + name + ".xml", {0, 30, 100, 200}, seen, true);
  report(seen);
}
TEST_CASE("boxes: dominos, stonehenge") {
  Seen seen;
  compare_scene("models/mujoco/sleep/dominos.xml", {0, 20, 100}, seen);
  compare_scene("models/mujoco/replicate/stonehenge.xml", {20, 100}, seen);
  report(seen);
}
