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
#include <set>
#include <support/data.hpp>
#include <support/skip.hpp>
#include <tuple>
#include <vector>

#include "support/kernels.hpp"

using namespace gsp;

namespace {
using Host = Kokkos::DefaultHostExecutionSpace;

/// Geom of MuJoCo for each of ours: bodies have the same numbers; visual meshes are left out there (ours: -1).
std::vector<int> geom_map(mjModel const* o, CompiledModel const& m) {
  std::vector<int> map;
  REQUIRE(m.nbody == o->nbody);
  for (int b = 0; b < o->nbody; ++b) {
    int g = o->body_geomadr[b];
    for (int k = m.body_geomadr[b]; k < m.body_geomadr[b] + m.body_geomnum[b]; ++k) {
      bool const seen_only = m.geom_type[k] == int(ShapeType::mesh) && m.geom_contype[k] == 0 && m.geom_conaffinity[k] == 0;
      map.push_back(seen_only ? -1 : g);
      if (seen_only) continue;
      REQUIRE(g < o->body_geomadr[b] + o->body_geomnum[b]);
      REQUIRE(m.geom_type[k] == o->geom_type[g]);
      ++g;
    }
    REQUIRE(g == (o->body_geomnum[b] > 0 ? o->body_geomadr[b] + o->body_geomnum[b] : o->body_geomadr[b]));
  }
  return map;
}

/// Pairs whose points are chosen otherwise than in MuJoCo are compared by their deepest one: those of the convex routine (the rest of them:
/// oracle/convex.cpp), and three of closed form.
bool by_depth(int type_a, int type_b, double& tolerance) {
  auto const kind = pair_kind(ShapeType(std::min(type_a, type_b)), ShapeType(std::max(type_a, type_b)));
  bool const convex = is_among(detail::convex_kinds, kind);
  tolerance = convex ? 1e-5 : 1e-6;
  return convex || kind == PairKind::capsule_box || kind == PairKind::capsule_cylinder || kind == PairKind::plane_mesh;
}

/// MuJoCo's model of a file (or of the text of one) without its visual meshes, textures and materials, whose files may be missing.
mjModel* load_without_visuals(std::string const& path, std::string const& text = {}) {
  char error[1000] = "";
  mjSpec* const spec = text.empty() ? mj_parseXML(path.c_str(), nullptr, error, sizeof error)
                                    : mj_parseXMLString(text.c_str(), nullptr, error, sizeof error);
  REQUIRE_MESSAGE(spec != nullptr, doctest::String(error));
  auto const each = [&](mjtObj type, auto const& f) {
    std::vector<mjsElement*> all;
    for (mjsElement* e = mjs_firstElement(spec, type); e != nullptr; e = mjs_nextElement(spec, e)) all.push_back(e);
    for (mjsElement* e : all) f(e);
  };
  std::set<std::string> colliding;
  each(mjOBJ_GEOM, [&](mjsElement* e) {
    mjsGeom* const g = mjs_asGeom(e);
    mjs_setString(g->material, "");
    bool const is_mesh = g->type == mjGEOM_MESH;
    if (is_mesh && g->contype == 0 && g->conaffinity == 0)
      mjs_delete(spec, e);
    else if (is_mesh)
      colliding.insert(mjs_getString(g->meshname));
  });
  each(mjOBJ_SITE, [&](mjsElement* e) { mjs_setString(mjs_asSite(e)->material, ""); });
  for (mjtObj type : {mjOBJ_MATERIAL, mjOBJ_TEXTURE}) each(type, [&](mjsElement* e) { mjs_delete(spec, e); });
  each(mjOBJ_MESH, [&](mjsElement* e) {
    if (colliding.count(mjs_getString(mjs_getName(e))) == 0) mjs_delete(spec, e);
  });
  mjModel* const m = mj_compile(spec, nullptr);
  REQUIRE_MESSAGE(m != nullptr, doctest::String(mjs_getError(spec)));
  mj_deleteSpec(spec);
  return m;
}

struct Seen {
  long contacts = 0, pairs = 0, named = 0, by_depth = 0;
  double pos = 0, dist = 0, frame = 0, parameters = 0;
};

void compare_models(std::string const& file, mjModel* const o, CompiledModel const& m, std::vector<int> const& steps, Seen& seen,
                    bool disturb, bool clench = false) {
  o->opt.enableflags &= ~mjENBL_SLEEP;
  o->opt.ccd_tolerance = 1e-12, o->opt.ccd_iterations = 1000;
  mjData* const d = mj_makeData(o);
  if (disturb)
    for (int i = 0; i < o->nv; ++i) d->qvel[i] = 2 * std::sin(1 + 1.7 * i);
  if (clench)
    for (int i = 0; i < o->nu; ++i) d->ctrl[i] = o->actuator_ctrlrange[2 * i + 1];
  auto const map = geom_map(o, m);
  Host const exec;
  auto const model = make_collision_model<double>(exec, m);
  auto contacts = make_contacts(exec, model, {.worlds = 1});
  auto poses = make_poses<double>(exec, 1, m.nbody, m.njnt);
  std::set<std::array<int, 2>> named;  // MuJoCo's, either order
  for (int i = 0; i < o->npair; ++i) named.insert({o->pair_geom1[i], o->pair_geom2[i]}), named.insert({o->pair_geom2[i], o->pair_geom1[i]});

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
    for (int i = contacts.first_of(0); i < contacts.first_of(0) + contacts.count_of(0); ++i)
      ours[{map[contacts.geom1(i)], map[contacts.geom2(i)]}].push_back(i);
    for (int i = 0; i < d->ncon; ++i) { theirs[{d->contact[i].geom[0], d->contact[i].geom[1]}].push_back(i); }
    double tolerance = 0;
    auto const deepest = [](std::vector<int> const& list, auto const& dist) {
      double least = 1e30;
      for (int i : list) least = std::min(least, double(dist(i)));
      return least;
    };
    auto const our_dist = [&](int i) { return contacts.dist(i); };
    auto const their_dist = [&](int j) { return d->contact[j].dist; };
    // What lies at the end of its margin may be in one list alone.
    auto const barely = [&](Key const& key, double dist, double margin) {
      return by_depth(o->geom_type[key[0]], o->geom_type[key[1]], tolerance) && dist > margin - tolerance;
    };
    for (auto const& [key, list] : theirs)
      CHECK_MESSAGE((ours.count(key) == 1 || barely(key, deepest(list, their_dist), d->contact[list[0]].includemargin)), file, ": step ",
                    stop, ": geoms ", key[0], " and ", key[1], " touch in MuJoCo alone, dist ", d->contact[list[0]].dist);
    for (auto const& [key, list] : ours) {
      if (!theirs.count(key)) {
        CHECK_MESSAGE(barely(key, deepest(list, our_dist), contacts.includemargin(list[0])), file, ": step ", stop, ": geoms ", key[0],
                      " and ", key[1], " touch in gsp alone, dist ", contacts.dist(list[0]));
        continue;
      }
      auto const& other = theirs.at(key);
      ++seen.pairs;
      seen.named += long(named.count(key));
      // parameters; two geoms that are named twice have two sets, in the same order on both sides
      for (std::size_t k = 0; k < std::min(list.size(), other.size()); ++k) {
        auto const p = model.parameters_of(0, contacts.pair(list[k]));
        auto const& q = d->contact[other[k]];
        int const condim = p.adhesion > 0 && q.dist >= q.includemargin ? 1 : p.condim;  // adhesion over a gap: a normal alone
        double worst = std::abs(contacts.includemargin(list[k]) - q.includemargin) + (condim != q.dim) + std::abs(p.adhesion - q.adhesion);
        for (int i = 0; i < 5; ++i) worst = std::max({worst, std::abs(p.friction[i] - q.friction[i]), std::abs(p.solimp[i] - q.solimp[i])});
        bool const overridden = o->opt.enableflags & mjENBL_OVERRIDE;  // solreffriction: o_solref there, 0 0 here, which says the same
        for (int i = 0; i < 2; ++i)
          worst = std::max({worst, std::abs(p.solref[i] - q.solref[i]),
                            std::abs((overridden ? p.solref[i] : p.solreffriction[i]) - q.solreffriction[i])});
        CHECK_MESSAGE(worst < 1e-12, file, ": geoms ", key[0], " and ", key[1], ": parameters");
        seen.parameters = std::max(seen.parameters, worst);
      }

      auto const difference = [&](int i, int j, double& pos, double& dist, double& frame) {
        auto const& c = d->contact[j];
        pos = frame = 0, dist = std::abs(contacts.dist(i) - c.dist);
        for (int k = 0; k < 3; ++k) pos = std::max(pos, std::abs(contacts.pos(i, k) - c.pos[k]));
        for (int k = 0; k < 9; ++k) frame = std::max(frame, std::abs(contacts.frame(i, k) - c.frame[k]));
      };
      if (by_depth(o->geom_type[key[0]], o->geom_type[key[1]], tolerance)) {
        double const deep = deepest(list, our_dist), other_deep = deepest(other, their_dist);
        ++seen.by_depth;
        CHECK_MESSAGE(std::abs(deep - other_deep) < tolerance, file, ": step ", stop, ": geoms ", key[0], " and ", key[1], ": ", deep,
                      " and ", other_deep);
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
  MESSAGE(doctest::String(file.c_str()), ": ", m.pair_count(), " pairs, ", model.groups, " groups, ", contacts.count_of(0),
          " contacts at the end");
  mj_deleteData(d);
  mj_deleteModel(o);
}

void compare_scene(std::string const& file, std::vector<int> const& steps, Seen& seen, bool disturb = false, bool clench = false) {
  auto const path = gsp_test::data(file);
  if (!path) {
    gsp_test::skip(std::string(file) + " is missing from GSP_DATA_DIR");
    return;
  }
  compare_models(file, load_without_visuals(*path), compile(io::read_mjcf(*path, {.skip_visuals = true})), steps, seen, disturb, clench);
}

void report(Seen const& s) {
  MESSAGE(s.pairs, " touching pairs (", s.named, " named), ", s.contacts, " points, ", s.by_depth,
          " pairs by depth; largest difference: position ", s.pos, ", depth ", s.dist, ", frame ", s.frame);
}
}  // namespace

TEST_CASE("humanoids: alone, in a heap, and disturbed" * doctest::test_suite("data")) {
  Seen seen;
  compare_scene("models/mujoco/humanoid/humanoid.xml", {0, 50, 100, 200, 400}, seen);
  compare_scene("models/mujoco/humanoid/humanoid.xml", {20, 100, 300}, seen, true);
  compare_scene("models/mujoco/humanoid/22_humanoids.xml", {0, 100, 300}, seen);
  report(seen);
}
TEST_CASE("a quadruped" * doctest::test_suite("data")) {
  Seen seen;
  compare_scene("models/unitree/go2/scene.xml", {0, 100, 300}, seen);
  report(seen);
}
TEST_CASE("robots of the control suite, disturbed" * doctest::test_suite("data")) {
  Seen seen;
  for (char const* name : {"finger", "hopper", "walker", "cheetah", "humanoid_CMU", "humanoid"})
    compare_scene(std::string("models/dm_control/suite/") + name + ".xml", {0, 30, 100, 200}, seen, true);
  report(seen);
}
TEST_CASE("boxes: dominos, stonehenge" * doctest::test_suite("data")) {
  Seen seen;
  compare_scene("models/mujoco/sleep/dominos.xml", {0, 20, 100}, seen);
  compare_scene("models/mujoco/replicate/stonehenge.xml", {20, 100}, seen);
  report(seen);
}

// Two bodies whose geoms meet nothing by their bits; a geom that would meet the floor with other numbers; parent and child; two geoms of
// one body; two that stand; two that are excluded; two that are named twice. The floor is the second geom of its pair now and then, so that
// MuJoCo turns it. Each pair alone must be there with its own numbers, and every ordinary pair besides.
char const* const named_pairs = R"(<mujoco><option timestep="0.002"/><worldbody>
  <geom name="floor" type="plane" size="1 1 1" friction=".3"/><geom name="post" size=".1" pos="3 0 .05"/><geom name="beam" type="box" size=".1 .1 .1" pos="0 0 -1"/>
  <body name="a" pos="0 0 .08"><freejoint/><geom name="a1" size=".1" contype="0" conaffinity="0"/><geom name="a2" type="box" size=".05 .05 .05" pos="0 .12 .05"/>
    <body name="b" pos="0 0 .15"><joint axis="0 1 0" damping="1"/><geom name="b1" type="capsule" size=".08 .05" pos="0 0 .02"/></body></body>
  <body name="c" pos="1 0 .09"><freejoint/><geom name="c1" size=".1" condim="1"/></body>
  <body name="d" pos="1 0 .27"><freejoint/><geom name="d1" type="capsule" size=".1 .1" euler="0 90 0" contype="0" conaffinity="2"/></body>
  <body name="e" pos="2 0 .15"><freejoint/><geom name="e1" type="cylinder" size=".1 .15" contype="0" conaffinity="0"/></body>
  </worldbody><contact>
  <pair geom1="a1" geom2="floor" condim="3" friction=".5 .7 .01 .02 .03" solref=".03 .9" solimp=".8 .9 .002" solreffriction=".1 .5" margin=".004" gap=".003"/>
  <pair geom1="b1" geom2="a2" condim="1"/><pair geom1="a1" geom2="b1" solref="-500 -20"/><pair geom1="a1" geom2="a2"/>
  <pair geom1="post" geom2="floor"/><pair geom1="beam" geom2="post" margin="5"/>
  <pair geom1="c1" geom2="d1" condim="1" friction="0 0 0 0 0"/><pair geom1="d1" geom2="c1" friction=".4"/>
  <pair geom1="c1" geom2="floor" friction="2"/><pair geom1="floor" geom2="e1" gap=".01"/>
  <exclude body1="world" body2="c"/></contact></mujoco>)";

TEST_CASE("named pairs: their own numbers, whatever filters say") {
  Seen seen;
  compare_models("named pairs", load_without_visuals("", named_pairs), compile(io::parse_mjcf(named_pairs, "named.xml")),
                 {0, 5, 20, 60, 150}, seen, false);
  report(seen);
  CHECK(seen.named > 30);
}
// With override only margins, friction and softness are the option's: gaps stay, and so do contacts within them. (Of two geoms of bodies
// MuJoCo finds some within the gap and others not: the boxes of its broad phase are wider by o_margin alone, and stand along axes that come
// from where all bodies are; of bodies with several geoms, the world too, boxes of the single geoms are asked besides. Such pairs are named
// here, which it does not ask.)
TEST_CASE("<flag override> keeps the gaps") {
  char const* const text = R"(<mujoco><option timestep="0.002" o_margin=".04"><flag override="enable"/></option><worldbody>
    <geom name="floor" type="plane" size="9 9 1" gap=".02"/><geom name="post" size=".1" pos="3 0 .1" gap=".03"/>
    <body pos="0 0 .3"><freejoint/><geom name="a" size=".1" gap=".05"/></body><body pos="1 0 .3"><freejoint/><geom name="b" size=".1" gap=".05" adhesion="10"/></body>
    <body pos="3 0 .5"><freejoint/><geom name="c" size=".1" gap=".06" margin=".2"/></body><body pos="5 0 .24"><freejoint/><geom name="d" size=".1" gap="-.01"/></body>
    <body pos="7 0 .5"><freejoint/><geom name="e" type="box" size=".1 .1 .1" gap=".01"/></body><body pos="7 .05 .85"><freejoint/><geom name="f" type="capsule" size=".1 .1"/></body>
    </worldbody><contact><pair geom1="e" geom2="f" gap=".08" margin=".01"/><pair geom1="post" geom2="c" gap=".09" adhesion="2"/></contact></mujoco>)";
  Seen seen;
  compare_models("override", load_without_visuals("", text), compile(io::parse_mjcf(text, "override.xml")),
                 {0, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 120, 200}, seen, false);
  report(seen);
  CHECK(seen.pairs > 30);
}

TEST_CASE("a hand that makes a fist: its fingers meet by named pairs" * doctest::test_suite("data")) {
  Seen seen;
  for (char const* name : {"reach", "manipulate_block", "manipulate_pen"})
    compare_scene(std::string("models/gym_robotics/hand/") + name + ".xml", {0, 50, 150, 400}, seen, true, true);
  report(seen);
  if (seen.pairs > 0) CHECK(seen.named > 0);
}
