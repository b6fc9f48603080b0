// Reader and compiler against MuJoCo's: the same text through both, all arrays of the model compared.
#include <doctest/doctest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/detail/principal_axes.hpp>
#include <gsp/model/samples.hpp>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <sstream>
#include <support/data.hpp>
#include <support/skip.hpp>

using namespace gsp;

namespace {
using Texts = std::map<std::string, std::string>;  // file name -> text; "main.xml" is the model

std::shared_ptr<mjModel> oracle(Texts const& texts, bool may_refuse = false) {
  mju_user_warning = [](char const*) {};  // no log file
  mjVFS vfs;
  mj_defaultVFS(&vfs);
  for (auto const& [name, text] : texts) REQUIRE(mj_addBufferVFS(&vfs, name.c_str(), text.data(), int(text.size())) == 0);
  char error[1000] = "";
  std::shared_ptr<mjModel> m(mj_loadXML("main.xml", &vfs, error, sizeof error), [](mjModel* p) {
    if (p) mj_deleteModel(p);
  });
  mj_deleteVFS(&vfs);
  if (!may_refuse) REQUIRE_MESSAGE(m, error);
  return m;
}
Description description(Texts const& texts, io::MjcfOptions options = {}) {
  options.read = [&](std::filesystem::path const& path) {
    auto const found = texts.find(path.string());
    if (found == texts.end()) throw Error(path.string() + " is missing");
    auto const bytes = io::detail::as_bytes(found->second);
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  return io::read_mjcf("main.xml", options);
}

// |a - b| <= tolerance * max(1, |b|): the relative error of the issue, element by element.
struct Compare {
  double tolerance = 1e-12;
  int bad = 0;
  void number(char const* what, int i, double a, double b, double t) {
    bool const ok = std::abs(a - b) <= t * std::max(1., std::abs(b));
    if (!ok && ++bad <= 10) MESSAGE(std::string(what) << "[" << i << "]: " << a << " and MuJoCo " << b);
  }
  template <class A, class B>
  void array(char const* what, A const& a, B const* b, double t = -1) {
    int n = 0;
    for (auto const& x : a) {
      if constexpr (requires { x.size(); })
        for (double y : x) number(what, n, y, double(b[n]), t < 0 ? tolerance : t), ++n;
      else
        number(what, n, double(x), double(b[n]), t < 0 ? tolerance : t), ++n;
    }
  }
  // quaternions q and -q are the same rotation
  void quats(char const* what, std::vector<Double4> const& a, mjtNum const* b) {
    for (int i = 0; i < int(a.size()); ++i) {
      double const sign = a[i][0] * b[4 * i] + a[i][1] * b[4 * i + 1] + a[i][2] * b[4 * i + 2] + a[i][3] * b[4 * i + 3] < 0 ? -1 : 1;
      for (int k = 0; k < 4; ++k) number(what, 4 * i + k, sign * a[i][k], b[4 * i + k], tolerance);
    }
  }
};

using Pairs = std::set<std::pair<int, int>>;
// The filters of MuJoCo's broad phase on MuJoCo's own arrays.
Pairs pairs_of(mjModel const* m) {
  Pairs pairs;
  std::set<int> excluded(m->exclude_signature, m->exclude_signature + m->nexclude);
  Pairs named;
  for (int i = 0; i < m->npair; ++i)
    named.emplace(std::min(m->pair_geom1[i], m->pair_geom2[i]), std::max(m->pair_geom1[i], m->pair_geom2[i]));
  for (int a = 0; a < m->ngeom; ++a)
    for (int b = a + 1; b < m->ngeom; ++b) {
      int const b1 = m->geom_bodyid[a], b2 = m->geom_bodyid[b], w1 = m->body_weldid[b1], w2 = m->body_weldid[b2];
      int const p1 = m->body_weldid[m->body_parentid[w1]], p2 = m->body_weldid[m->body_parentid[w2]];
      if (!((m->geom_contype[a] & m->geom_conaffinity[b]) | (m->geom_contype[b] & m->geom_conaffinity[a]))) continue;
      if (w1 == w2 || (!m->body_dofnum[w1] && !m->body_dofnum[w2]) || named.count({a, b})) continue;
      if (!(m->opt.disableflags & mjDSBL_FILTERPARENT) && w1 && w2 && (w1 == p2 || w2 == p1)) continue;
      if (excluded.count((std::min(b1, b2) << 16) + std::max(b1, b2))) continue;
      if (m->geom_type[a] == mjGEOM_PLANE && m->geom_type[b] == mjGEOM_PLANE) continue;
      pairs.emplace(a, b);
    }
  return pairs;
}

// Shapes of primitives by their pose; of meshes by where their vertices stand, as axes are a convention of the eigen solver, to 1e-6 of the
// mesh's size. MuJoCo rounds vertices to float, so that moved ones are good to its last bit.
void poses_of_geoms(Compare& c, CompiledModel const& g, mjModel const* m) {
  for (int i = 0; i < g.ngeom; ++i) {
    if (m->geom_type[i] != mjGEOM_MESH && (g.geom_data[i] < 0 || m->geom_type[i] == mjGEOM_HFIELD)) {
      for (int k = 0; k < 3; ++k) c.number("geom_pos", 3 * i + k, g.geom_pos[i][k], m->geom_pos[3 * i + k], c.tolerance);
      auto const* q = m->geom_quat + 4 * i;
      double const sign =
          g.geom_quat[i][0] * q[0] + g.geom_quat[i][1] * q[1] + g.geom_quat[i][2] * q[2] + g.geom_quat[i][3] * q[3] < 0 ? -1 : 1;
      for (int k = 0; k < 4; ++k) c.number("geom_quat", 4 * i + k, sign * g.geom_quat[i][k], q[k], c.tolerance);
      continue;
    }
    int const mesh = m->geom_dataid[i];
    REQUIRE(g.geom_data[i] == mesh);
    auto const& vertices = g.mesh_vertices[mesh];
    REQUIRE(int(vertices.size()) == m->mesh_vertnum[mesh]);
    gsp::detail::Pose const mine{g.geom_pos[i], g.geom_quat[i]};
    auto const *p = m->geom_pos + 3 * i, *q = m->geom_quat + 4 * i;
    gsp::detail::Pose const theirs{{p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}};
    double size = 0, worst = 0;
    using gsp::detail::operator-;
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      float const* w = m->mesh_vert + 3 * (std::size_t(m->mesh_vertadr[mesh]) + v);
      Double3 const a = mine * Double3{vertices[v][0], vertices[v][1], vertices[v][2]}, b = theirs * Double3{w[0], w[1], w[2]};
      worst = std::max(worst, gsp::detail::norm(a - b)), size = std::max(size, gsp::detail::norm({w[0], w[1], w[2]}));
    }
    c.number("vertices of geom / size", i, worst / size, 0, 1e-6);
  }
}

void compare(CompiledModel const& g, mjModel const* m) {
  REQUIRE(g.nq == m->nq);
  REQUIRE(g.nv == m->nv);
  REQUIRE(g.nbody == m->nbody);
  REQUIRE(g.njnt == m->njnt);
  REQUIRE(g.ngeom == m->ngeom);
  REQUIRE(g.nsite == m->nsite);
  REQUIRE(g.ncam == m->ncam);
  REQUIRE(g.nu == m->nu);
  REQUIRE(g.ntendon == m->ntendon);
  REQUIRE(g.ntree == m->ntree);
  REQUIRE(g.na == m->na);
  REQUIRE(g.nmocap == m->nmocap);
  REQUIRE(g.neq == m->neq);
  REQUIRE(g.nsensor == m->nsensor);
  REQUIRE(g.nmesh == m->nmesh);
  REQUIRE(g.nhfield == m->nhfield);
  REQUIRE(g.keyframes.size() == std::size_t(m->nkey));
  Compare c;
  auto const names = [&](int type, std::vector<std::string> const& all) {
    for (int i = 0; i < int(all.size()); ++i) {
      char const* name = mj_id2name(m, type, i);
      CHECK(all[i] == std::string(name ? name : ""));
    }
  };
  names(mjOBJ_BODY, g.body_name), names(mjOBJ_JOINT, g.jnt_name), names(mjOBJ_GEOM, g.geom_name), names(mjOBJ_SITE, g.site_name);
  names(mjOBJ_CAMERA, g.cam_name), names(mjOBJ_TENDON, g.tendon_name), names(mjOBJ_ACTUATOR, g.act_name);

  c.number("timestep", 0, g.option.timestep, m->opt.timestep, 0);
  c.array("gravity", g.option.gravity, m->opt.gravity, 0);
  c.number("impratio", 0, g.option.impratio, m->opt.impratio, 0);
  CHECK(int(g.option.integrator) == m->opt.integrator);
  CHECK(int(g.option.cone) == m->opt.cone);
  CHECK(g.option.iterations == m->opt.iterations);
  CHECK(g.option.noslip_iterations == m->opt.noslip_iterations);
  CHECK(g.option.noslip_tolerance == m->opt.noslip_tolerance);
  auto const& o = g.option;
  for (auto const& [on, bit] : {std::pair{o.constraint, mjDSBL_CONSTRAINT},
                                {o.frictionloss, mjDSBL_FRICTIONLOSS},
                                {o.limit, mjDSBL_LIMIT},
                                {o.contact, mjDSBL_CONTACT},
                                {o.passive_spring, mjDSBL_SPRING},
                                {o.passive_damper, mjDSBL_DAMPER},
                                {o.gravity_on, mjDSBL_GRAVITY},
                                {o.clampctrl, mjDSBL_CLAMPCTRL},
                                {o.warmstart, mjDSBL_WARMSTART},
                                {o.filterparent, mjDSBL_FILTERPARENT},
                                {o.actuation, mjDSBL_ACTUATION},
                                {o.refsafe, mjDSBL_REFSAFE},
                                {o.equality, mjDSBL_EQUALITY},
                                {o.eulerdamp, mjDSBL_EULERDAMP}})
    CHECK(on == !(m->opt.disableflags & bit));

  CHECK(g.option.override_contacts == bool(m->opt.enableflags & mjENBL_OVERRIDE));
  CHECK(g.option.disabled_actuator_groups == m->opt.disableactuator);
  c.number("density", 0, g.option.density, m->opt.density, 0), c.number("viscosity", 0, g.option.viscosity, m->opt.viscosity, 0);
  c.array("wind", g.option.wind, m->opt.wind, 0), c.array("magnetic", g.option.magnetic, m->opt.magnetic, 0);
  c.number("o_margin", 0, g.option.o_margin, m->opt.o_margin, 0), c.array("o_solref", g.option.o_softness.solref, m->opt.o_solref, 0);
  c.array("o_solimp", g.option.o_softness.solimp, m->opt.o_solimp, 0), c.array("o_friction", g.option.o_friction, m->opt.o_friction, 0);
  c.array("body_parent", g.body_parent, m->body_parentid), c.array("body_weld", g.body_weld, m->body_weldid),
      c.array("body_tree", g.body_tree, m->body_treeid);
  c.array("body_jntadr", g.body_jntadr, m->body_jntadr), c.array("body_jntnum", g.body_jntnum, m->body_jntnum),
      c.array("body_dofadr", g.body_dofadr, m->body_dofadr);
  c.array("body_dofnum", g.body_dofnum, m->body_dofnum), c.array("body_geomadr", g.body_geomadr, m->body_geomadr),
      c.array("body_geomnum", g.body_geomnum, m->body_geomnum);
  c.array("body_pos", g.body_pos, m->body_pos), c.quats("body_quat", g.body_quat, m->body_quat);
  c.array("body_mass", g.body_mass, m->body_mass, 1e-9), c.array("body_gravcomp", g.body_gravcomp, m->body_gravcomp);
  for (int b = 0; b < g.nbody; ++b) {
    bool const moves = g.body_tree[b] >= 0;
    for (int k = 0; k < 3 && (moves || g.body_mass[b] > 0); ++k)
      c.number("body_ipos", 3 * b + k, g.body_ipos[b][k], m->body_ipos[3 * b + k], 1e-9);
    // axes are a convention of the eigen solver, the tensor is not
    mjtNum const *q = m->body_iquat + 4 * b, *i = m->body_inertia + 3 * b;
    auto const mine = gsp::detail::rotated_diagonal(g.body_iquat[b], g.body_inertia[b]),
               theirs = gsp::detail::rotated_diagonal({q[0], q[1], q[2], q[3]}, {i[0], i[1], i[2]});
    // MuJoCo's eigen solver leaves what is below 1e-12 of a mesh of density 1
    double const scale = std::max({mine[0], mine[1], mine[2], m->nmesh ? 1. : 1e-300});
    for (int k = 0; k < 6; ++k) c.number("inertia tensor / its size", 6 * b + k, mine[k] / scale, theirs[k] / scale, 1e-9);
  }
  c.array("body_mocap", g.body_mocap, m->body_mocapid);
  c.array("body_invweight0", g.body_invweight0, m->body_invweight0, 1e-9);

  c.array("jnt_type", g.jnt_type, m->jnt_type), c.array("jnt_body", g.jnt_body, m->jnt_bodyid),
      c.array("jnt_qposadr", g.jnt_qposadr, m->jnt_qposadr);
  c.array("jnt_dofadr", g.jnt_dofadr, m->jnt_dofadr), c.array("jnt_limited", g.jnt_limited, m->jnt_limited),
      c.array("jnt_actfrclimited", g.jnt_actfrclimited, m->jnt_actfrclimited);
  c.array("jnt_pos", g.jnt_pos, m->jnt_pos), c.array("jnt_axis", g.jnt_axis, m->jnt_axis),
      c.array("jnt_stiffness", g.jnt_stiffness, m->jnt_stiffness, 1e-9);
  c.array("jnt_margin", g.jnt_margin, m->jnt_margin), c.array("jnt_range", g.jnt_range, m->jnt_range),
      c.array("jnt_actfrcrange", g.jnt_actfrcrange, m->jnt_actfrcrange);
  c.array("jnt_stiffnesspoly", g.jnt_stiffnesspoly, m->jnt_stiffnesspoly),
      c.array("dof_dampingpoly", g.dof_dampingpoly, m->dof_dampingpoly);
  c.array("jnt_actgravcomp", g.jnt_actgravcomp, m->jnt_actgravcomp), c.array("dof_M0", g.dof_M0, m->dof_M0, 1e-9);
  c.array("jnt_solref", g.jnt_solref, m->jnt_solref), c.array("jnt_solimp", g.jnt_solimp, m->jnt_solimp);

  c.array("dof_body", g.dof_body, m->dof_bodyid), c.array("dof_jnt", g.dof_jnt, m->dof_jntid),
      c.array("dof_parent", g.dof_parent, m->dof_parentid);
  c.array("dof_armature", g.dof_armature, m->dof_armature), c.array("dof_damping", g.dof_damping, m->dof_damping, 1e-9);
  c.array("dof_frictionloss", g.dof_frictionloss, m->dof_frictionloss),
      c.array("dof_invweight0", g.dof_invweight0, m->dof_invweight0, 1e-9);
  c.array("dof_solref", g.dof_solref, m->dof_solref), c.array("dof_solimp", g.dof_solimp, m->dof_solimp);
  c.array("qpos0", g.qpos0, m->qpos0), c.array("qpos_spring", g.qpos_spring, m->qpos_spring);

  c.array("geom_type", g.geom_type, m->geom_type), c.array("geom_body", g.geom_body, m->geom_bodyid),
      c.array("geom_contype", g.geom_contype, m->geom_contype);
  c.array("geom_conaffinity", g.geom_conaffinity, m->geom_conaffinity), c.array("geom_priority", g.geom_priority, m->geom_priority),
      c.array("geom_group", g.geom_group, m->geom_group);
  c.array("geom_condim", g.geom_condim, m->geom_condim);
  for (int i = 0; i < g.ngeom; ++i) {             // MuJoCo clears what a shape does not use
    if (g.geom_type[i] == mjGEOM_MESH) continue;  // its bounds, in axes of its own
    int const used = g.geom_type[i] == mjGEOM_SPHERE ? 1 : g.geom_type[i] == mjGEOM_CAPSULE || g.geom_type[i] == mjGEOM_CYLINDER ? 2 : 3;
    for (int k = 0; k < used; ++k) c.number("geom_size", 3 * i + k, g.geom_size[i][k], m->geom_size[3 * i + k], c.tolerance);
  }
  poses_of_geoms(c, g, m);
  c.array("geom_friction", g.geom_friction, m->geom_friction);
  c.array("geom_solmix", g.geom_solmix, m->geom_solmix), c.array("geom_margin", g.geom_margin, m->geom_margin),
      c.array("geom_gap", g.geom_gap, m->geom_gap);
  c.array("geom_rbound", g.geom_rbound, m->geom_rbound, m->nmesh ? 1e-6 : -1), c.array("geom_solref", g.geom_solref, m->geom_solref),
      c.array("geom_solimp", g.geom_solimp, m->geom_solimp);
  for (int i = 0; i < g.ngeom; ++i)
    if (m->geom_matid[i] < 0)
      for (int k = 0; k < 4; ++k) c.number("geom_rgba", i, g.geom_rgba[i][k], m->geom_rgba[4 * i + k], 1e-7);

  CHECK(std::equal(g.site_type.begin(), g.site_type.end(), m->site_type));
  c.array("site_size", g.site_size, m->site_size);
  c.array("site_body", g.site_body, m->site_bodyid), c.array("site_pos", g.site_pos, m->site_pos),
      c.quats("site_quat", g.site_quat, m->site_quat);
  c.array("geom_surfacevel", g.geom_surfacevel, m->geom_surfacevel), c.array("geom_adhesion", g.geom_adhesion, m->geom_adhesion);
  for (int i = 0; i < g.ngeom; ++i) {
    auto const* fluid = m->geom_fluid + mjNFLUID * i;
    CHECK(bool(g.geom_fluid[i]) == (fluid[0] != 0));
    for (int k = 0; k < 5 && fluid[0] != 0; ++k) c.number("geom_fluidcoef", 5 * i + k, g.geom_fluidcoef[i][k], fluid[k + 1], c.tolerance);
    CHECK(g.geom_data[i] == m->geom_dataid[i]);
  }
  c.array("cam_mode", g.cam_mode, m->cam_mode), c.array("cam_target", g.cam_target, m->cam_targetbodyid);
  c.array("cam_pos0", g.cam_pos0, m->cam_pos0), c.array("cam_poscom0", g.cam_poscom0, m->cam_poscom0, 1e-9),
      c.array("cam_mat0", g.cam_mat0, m->cam_mat0);
  for (int i = 0; i < g.ncam; ++i) {
    c.number("cam_fovy", i, g.cam_fovy[i], m->cam_fovy[i] * M_PI / 180, c.tolerance);
    for (int k = 0; k < 2; ++k) CHECK(g.cam_resolution[i][k] == m->cam_resolution[2 * i + k]);
  }
  c.array("cam_body", g.cam_body, m->cam_bodyid), c.array("cam_pos", g.cam_pos, m->cam_pos), c.quats("cam_quat", g.cam_quat, m->cam_quat);

  for (int t = 0, term = 0, wrap = 0; t < g.ntendon; ++t) {
    int const adr = m->tendon_adr[t];
    bool const fixed = m->tendon_type[t] == mjTENDON_FIXED;
    REQUIRE(g.tendon_termnum[t] == (fixed ? m->tendon_num[t] : 0));
    REQUIRE(g.tendon_wrapnum[t] == (fixed ? 0 : m->tendon_num[t]));
    for (int k = 0; k < g.tendon_termnum[t]; ++k, ++term) {
      CHECK(g.term_jnt[term] == m->wrap_objid[adr + k]);
      c.number("term_coef", term, g.term_coef[term], m->wrap_prm[adr + k], c.tolerance);
    }
    for (int k = 0; k < g.tendon_wrapnum[t]; ++k, ++wrap) {
      CHECK(g.wrap_type[wrap] == m->wrap_type[adr + k]);
      if (m->wrap_type[adr + k] == mjWRAP_PULLEY)
        c.number("wrap_divisor", wrap, g.wrap_divisor[wrap], m->wrap_prm[adr + k], c.tolerance);
      else
        CHECK(g.wrap_id[wrap] == m->wrap_objid[adr + k]);
      if (m->wrap_type[adr + k] == mjWRAP_SPHERE || m->wrap_type[adr + k] == mjWRAP_CYLINDER)
        CHECK(g.wrap_side[wrap] == int(m->wrap_prm[adr + k]));
    }
  }
  c.array("tendon_limited", g.tendon_limited, m->tendon_limited), c.array("tendon_stiffness", g.tendon_stiffness, m->tendon_stiffness),
      c.array("tendon_damping", g.tendon_damping, m->tendon_damping);
  c.array("tendon_stiffnesspoly", g.tendon_stiffnesspoly, m->tendon_stiffnesspoly),
      c.array("tendon_dampingpoly", g.tendon_dampingpoly, m->tendon_dampingpoly);
  c.array("tendon_actfrclimited", g.tendon_actfrclimited, m->tendon_actfrclimited),
      c.array("tendon_actfrcrange", g.tendon_actfrcrange, m->tendon_actfrcrange);
  c.array("tendon_frictionloss", g.tendon_frictionloss, m->tendon_frictionloss),
      c.array("tendon_armature", g.tendon_armature, m->tendon_armature);
  c.array("tendon_margin", g.tendon_margin, m->tendon_margin), c.array("tendon_range", g.tendon_range, m->tendon_range),
      c.array("tendon_length0", g.tendon_length0, m->tendon_length0, 1e-10);
  c.array("tendon_lengthspring", g.tendon_lengthspring, m->tendon_lengthspring, 1e-10),
      c.array("tendon_invweight0", g.tendon_invweight0, m->tendon_invweight0, 1e-9);
  c.array("tendon_solref_limit", g.tendon_solref_limit, m->tendon_solref_lim),
      c.array("tendon_solimp_limit", g.tendon_solimp_limit, m->tendon_solimp_lim);
  c.array("tendon_solref_friction", g.tendon_solref_friction, m->tendon_solref_fri),
      c.array("tendon_solimp_friction", g.tendon_solimp_friction, m->tendon_solimp_fri);

  for (int a = 0; a < g.nu; ++a) {
    int const out = m->actuator_outadr[a], ctrl = m->actuator_ctrladr[a];
    int const target[] = {mjTRN_JOINT, mjTRN_JOINTINPARENT, mjTRN_SLIDERCRANK, mjTRN_TENDON, mjTRN_SITE, mjTRN_BODY};
    CHECK(target[g.act_target[a]] == m->actuator_trntype[a]);
    CHECK(g.act_id[a] == m->actuator_trnid[2 * a]);
    CHECK(g.act_ref[a] == m->actuator_trnid[2 * a + 1]);
    CHECK(g.act_ctrllimited[a] == m->actuator_ctrllimited[ctrl]);
    CHECK(g.act_forcelimited[a] == m->actuator_forcelimited[a]);
    CHECK(g.act_actlimited[a] == m->actuator_actlimited[a]);
    CHECK(g.act_actearly[a] == m->actuator_actearly[a]);
    CHECK(g.act_group[a] == m->actuator_group[a]);
    CHECK(g.act_dyntype[a] == m->actuator_dyntype[a]);
    CHECK(g.act_gaintype[a] == m->actuator_gaintype[a]);
    CHECK(g.act_biastype[a] == m->actuator_biastype[a]);
    CHECK(g.act_actadr[a] == m->actuator_actadr[a]);
    CHECK(g.act_actnum[a] == m->actuator_actnum[a]);
    for (int k = 0; k < 10; ++k) {
      c.number("act_gain", 10 * a + k, g.act_gainprm[a][k], m->actuator_gainprm[mjNGAIN * a + k], c.tolerance);
      c.number("act_bias", 10 * a + k, g.act_biasprm[a][k], m->actuator_biasprm[mjNBIAS * a + k], 1e-9);
      c.number("act_dyn", 10 * a + k, g.act_dynprm[a][k], m->actuator_dynprm[mjNDYN * a + k], c.tolerance);
    }
    for (int k = 0; k < 6; ++k) c.number("act_gear", a, g.act_gear[a][k], m->actuator_gear[6 * out + k], c.tolerance);
    for (int k = 0; k < 2; ++k) {
      c.number("act_ctrlrange", a, g.act_ctrlrange[a][k], m->actuator_ctrlrange[2 * ctrl + k], c.tolerance);
      c.number("act_forcerange", a, g.act_forcerange[a][k], m->actuator_forcerange[2 * a + k], c.tolerance);
      c.number("act_actrange", a, g.act_actrange[a][k], m->actuator_actrange[2 * a + k], c.tolerance);
      c.number("act_lengthrange", a, g.act_lengthrange[a][k], m->actuator_lengthrange[2 * out + k], c.tolerance);
    }
    c.number("act_damping", a, g.act_damping[a], m->actuator_damping[a], c.tolerance);
    c.number("act_armature", a, g.act_armature[a], m->actuator_armature[a], c.tolerance);
    c.number("act_cranklength", a, g.act_cranklength[a], m->actuator_cranklength[out], c.tolerance);
    c.number("act_acc0", a, g.act_acc0[a], m->actuator_acc0[out], 1e-9);
    c.number("act_length0", a, g.act_length0[a], m->actuator_length0[out], 1e-10);
  }
  for (int e = 0; e < g.neq; ++e) {
    CHECK(g.eq_type[e] == m->eq_type[e]);
    CHECK(g.eq_id1[e] == m->eq_obj1id[e]);
    CHECK(g.eq_id2[e] == m->eq_obj2id[e]);
    CHECK(bool(g.eq_sites[e]) == (m->eq_objtype[e] == mjOBJ_SITE));
    CHECK(bool(g.eq_active[e]) == bool(m->eq_active0[e]));
    bool const weld = m->eq_type[e] == mjEQ_WELD;
    auto const* data = m->eq_data + mjNEQDATA * e;
    double sign = 1;
    if (weld && g.eq_data[e][6] * data[6] + g.eq_data[e][7] * data[7] + g.eq_data[e][8] * data[8] + g.eq_data[e][9] * data[9] < 0)
      sign = -1;
    for (int k = 0; k < 11; ++k) c.number("eq_data", 11 * e + k, (weld && k >= 6 && k < 10 ? sign : 1) * g.eq_data[e][k], data[k], 1e-10);
  }
  names(mjOBJ_EQUALITY, g.eq_name);
  c.array("eq_solref", g.eq_solref, m->eq_solref), c.array("eq_solimp", g.eq_solimp, m->eq_solimp);
  c.array("sensor_id", g.sensor_id, m->sensor_objid), c.array("sensor_refid", g.sensor_refid, m->sensor_refid);
  for (int i = 0; i < g.nsensor; ++i) {
    CHECK(g.sensor_dim[i] == m->sensor_dim[i]);
    CHECK(g.sensor_adr[i] == m->sensor_adr[i]);
    c.number("sensor_cutoff", i, g.sensors[i].cutoff, m->sensor_cutoff[i], 0),
        c.number("sensor_noise", i, g.sensors[i].noise, m->sensor_noise[i], 0);
    char const* name = mj_id2name(m, mjOBJ_SENSOR, i);
    CHECK(g.sensors[i].name == std::string(name ? name : ""));
  }
  CHECK(g.nsensordata == m->nsensordata);
  REQUIRE(int(g.named_pairs.size()) == m->npair);
  for (int i = 0; i < m->npair; ++i) {
    auto const p = std::find_if(g.named_pairs.begin(), g.named_pairs.end(),
                                [&](auto const& x) { return x.geom1 == m->pair_geom1[i] && x.geom2 == m->pair_geom2[i]; });
    REQUIRE(p != g.named_pairs.end());
    CHECK(p->condim == m->pair_dim[i]);
    for (int k = 0; k < 5; ++k) {
      c.number("pair_friction", 5 * i + k, p->friction[k], m->pair_friction[5 * i + k], c.tolerance);
      c.number("pair_solimp", 5 * i + k, p->solimp[k], m->pair_solimp[5 * i + k], c.tolerance);
    }
    for (int k = 0; k < 2; ++k) {
      c.number("pair_solref", 2 * i + k, p->solref[k], m->pair_solref[2 * i + k], c.tolerance);
      c.number("pair_solreffriction", 2 * i + k, p->solreffriction[k], m->pair_solreffriction[2 * i + k], c.tolerance);
    }
    c.number("pair_margin", i, p->margin, m->pair_margin[i], c.tolerance), c.number("pair_gap", i, p->gap, m->pair_gap[i], c.tolerance);
    c.number("pair_adhesion", i, p->adhesion, m->pair_adhesion[i], c.tolerance);
  }
  for (int k = 0; k < m->nkey; ++k) {
    CHECK(g.keyframes[k].time == m->key_time[k]);
    char const* name = mj_id2name(m, mjOBJ_KEY, k);
    CHECK(g.keyframes[k].name == std::string(name ? name : ""));
    c.array("key_qpos", g.keyframes[k].qpos, m->key_qpos + k * m->nq), c.array("key_qvel", g.keyframes[k].qvel, m->key_qvel + k * m->nv);
    c.array("key_ctrl", g.keyframes[k].ctrl, m->key_ctrl + k * m->nu), c.array("key_act", g.keyframes[k].act, m->key_act + k * m->na);
    c.array("key_mpos", g.keyframes[k].mpos, m->key_mpos + 3 * k * m->nmocap);
    c.array("key_mquat", g.keyframes[k].mquat, m->key_mquat + 4 * k * m->nmocap);
  }

  Pairs mine;
  bool ordered = true;
  for (auto const& p : g.pairs) {
    ordered = ordered && g.geom_type[p[0]] <= g.geom_type[p[1]];
    mine.emplace(std::min(p[0], p[1]), std::max(p[0], p[1]));
  }
  CHECK(ordered);
  CHECK(mine.size() == g.pairs.size());
  Pairs theirs = pairs_of(m);
  int left_out = 0;
  for (auto const& line : g.report)
    if (line.kind == ReportLine::Kind::left_out && line.text.rfind("pairs of geoms", 0) == 0) left_out = line.count;
  CHECK(theirs.size() == mine.size() + std::size_t(left_out));
  CHECK(std::includes(theirs.begin(), theirs.end(), mine.begin(), mine.end()));
  CHECK(c.bad == 0);
}

void compare(Texts const& texts, io::MjcfOptions const& options = {}) {
  auto const theirs = oracle(texts);
  compare(compile(description(texts, options)), theirs.get());
}
void compare(std::string const& text, io::MjcfOptions const& options = {}) { compare(Texts{{"main.xml", text}}, options); }

/// Read, compiled and compared; then written, loaded by MuJoCo, and compared again with what was read first.
void compare_twice(Texts const& texts, io::MjcfOptions const& options = {}) {
  auto const first = oracle(texts);
  auto const d = description(texts, options);
  compare(compile(d), first.get());
  auto const second = oracle({{"main.xml", io::format_mjcf(d)}});
  compare(compile(d), second.get());
}
void compare_twice(std::string const& text, io::MjcfOptions const& options = {}) { compare_twice(Texts{{"main.xml", text}}, options); }

std::string slurp(std::string const& path) {
  std::ifstream in(path);
  std::stringstream s;
  s << in.rdbuf();
  return s.str();
}
}  // namespace

TEST_CASE("humanoid, go2 and 22 humanoids" * doctest::test_suite("data")) {
  auto const humanoid = gsp_test::data("models/mujoco/humanoid/humanoid.xml"),
             crowd = gsp_test::data("models/mujoco/humanoid/22_humanoids.xml"), go2 = gsp_test::data("models/unitree/go2/go2.xml");
  if (!humanoid || !crowd || !go2) {
    gsp_test::skip("the models are missing from GSP_DATA_DIR");
    return;
  }
  SUBCASE("humanoid") { compare(slurp(*humanoid)); }
  SUBCASE("22 humanoids") { compare({{"main.xml", slurp(*crowd)}, {"humanoid.xml", slurp(*humanoid)}}); }
  SUBCASE("go2") {  // MuJoCo has not the visual meshes: it gets the text without the lines that name them
    std::string const all = slurp(*go2);
    std::string stripped;
    std::istringstream lines(all);
    for (std::string line; std::getline(lines, line);)
      if (line.find("class=\"visual\" ") == std::string::npos && line.find("<mesh file") == std::string::npos &&
          line.find("mesh=\"") == std::string::npos)
        stripped += line + "\n";
    auto const theirs = oracle({{"main.xml", stripped}});
    compare(compile(io::parse_mjcf(all, *go2, {.skip_visuals = true})), theirs.get());
  }
}

TEST_CASE("every file that MuJoCo loads is read to the same numbers or refused in one sentence" * doctest::test_suite("data")) {
  auto const list = gsp_test::data("models/zoo.txt");
  if (!list) {
    gsp_test::skip("models/zoo.txt is missing from GSP_DATA_DIR");
    return;
  }
  std::istringstream lines(slurp(*list));
  int same = 0, refused = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::string const name = line.substr(0, line.find(' '));
    CAPTURE(name);
    auto const path = gsp_test::data("models/" + name);
    REQUIRE(path);
    try {
      auto const mine = compile(io::read_mjcf(*path), {.listed_pairs = 50'000'000});
      char error[1000] = "";
      mju_user_warning = [](char const*) {};
      std::shared_ptr<mjModel> const theirs(mj_loadXML(path->c_str(), nullptr, error, sizeof error), mj_deleteModel);
      REQUIRE_MESSAGE(theirs, error);
      compare(mine, theirs.get());
      ++same;
    } catch (Error const& e) {
      ++refused;
      std::string const text = e.what();
      CHECK(text.find('\n') == std::string::npos);
      CHECK(text.find(".xml:") != std::string::npos);
    }
  }
  MESSAGE(same << " files equal, " << refused << " refused");
  CHECK(same == 95);
  CHECK(refused == 0);
}

TEST_CASE("shapes, masses and inertias") {
  compare(R"(<mujoco><worldbody>
    <geom type="plane" size="1 2 .1"/>
    <body pos="0 0 1"><freejoint/><geom type="sphere" size=".1"/><geom type="capsule" size=".05 .2" pos=".1 .2 .3" euler="10 20 30"/></body>
    <body pos="1 0 1"><freejoint/><geom type="box" size=".1 .2 .3" mass="3"/></body>
    <body pos="2 0 1"><freejoint/><geom type="cylinder" size=".1 .2" density="500" quat="1 2 3 4"/><geom type="box" size=".1 .1 .1" contype="0" conaffinity="0" group="2"/></body>
    <body pos="3 0 1"><freejoint/><geom type="ellipsoid" size=".1 .2 .3" contype="0" conaffinity="0"/></body>
    <body pos="4 0 1"><freejoint/><geom type="sphere" size=".1" shellinertia="true" mass="2"/></body>
    <body pos="5 0 1"><freejoint/><geom type="capsule" size=".1 .3" shellinertia="true"/></body>
    <body pos="6 0 1"><freejoint/><geom type="box" size=".1 .2 .3" shellinertia="true"/></body>
    <body pos="7 0 1"><freejoint/><geom type="cylinder" size=".1 .3" shellinertia="true"/></body>
    <body pos="8 0 1"><freejoint/><geom type="capsule" size=".05" fromto="0 0 0 .3 -.2 .5"/><geom type="box" size=".05" fromto="0 0 0 0 0 .5"/></body>
    <body pos="9 0 1"><freejoint/><inertial pos=".1 0 0" mass="2" fullinertia="1 2 2.5 .1 .2 -.3"/><geom size=".1"/></body>
    <body pos="9 0 2"><freejoint/><inertial pos=".1 0 0" mass="2" diaginertia="1 2 2.5" euler="30 0 10"/><geom size=".1"/></body>
    <body pos="9 0 3"><freejoint/><geom size=".1" mass="0"/><geom size=".2" pos="1 0 0" group="4"/></body>
    <body pos="9 0 5"><geom size=".1" type="capsule" fromto="0 0 0 0 0 -1"/><joint/><geom size=".1" mass="0"/></body>
  </worldbody></mujoco>)");
}

TEST_CASE("compiler settings") {
  std::string const rest = R"(<worldbody>
    <body><joint axis="1 0 0"/><geom size=".1" group="1"/><body pos="1 0 0"><joint axis="0 1 0" type="slide"/><inertial pos="0 0 .1" mass="1" diaginertia=".1 .1 .1"/><geom size=".2" group="3"/></body></body>
    <body pos="3 0 0"><joint type="ball"/><inertial pos="0 0 .1" mass="1" diaginertia=".1 .1 .3"/></body></worldbody></mujoco>)";
  compare("<mujoco><compiler boundmass='5' boundinertia='.2' balanceinertia='true'/>" + rest);
  compare("<mujoco><compiler inertiafromgeom='true' balanceinertia='true' boundmass='.1' boundinertia='.1'/>" + rest);
  compare("<mujoco><compiler balanceinertia='true' inertiagrouprange='0 2' settotalmass='7'/>" + rest);
  compare("<mujoco><compiler inertiafromgeom='false' balanceinertia='true' boundmass='.1' boundinertia='.1'/>" + rest);
  for (char const* angle : {"radian", "degree"})
    for (char const* seq : {"xyz", "zyx", "XYZ", "xZy"})
      compare(std::string("<mujoco><compiler angle='") + angle + "' eulerseq='" + seq +
              R"('/><worldbody><body euler="1 .2 -.4"><joint range="-.3 .9" ref=".1" springref="-.2"/><geom size=".1"/>
        <site axisangle="1 2 3 .7"/><site xyaxes="1 1 0 0 1 1"/><site zaxis="1 2 -3"/><site zaxis="0 0 -1"/><camera zaxis="0 0 2" fovy="30"/>
        <body pos="0 0 1"><joint type="ball" range="0 1.1" limited="true"/><joint type="slide" axis="1 2 3" range="-1 2" ref=".5" springref=".25"/><geom size=".1"/></body></body></worldbody></mujoco>)");
}

TEST_CASE("joints: springdamper, armature, friction loss, softness, several on one body, chains of static bodies") {
  compare(
      R"(<mujoco><option timestep=".004" gravity="0 1 -5" cone="elliptic" impratio="3" integrator="implicitfast" iterations="7" noslip_iterations="5" noslip_tolerance="1e-7"><flag contact="disable" eulerdamp="disable" refsafe="disable" warmstart="disable"/></option>
   <default><joint solreflimit=".05 .9" solimpfriction=".8 .9" damping="1"/></default>
   <worldbody><body><geom size=".1"/><body pos="0 0 1"><joint name="a" springdamper=".1 .7"/><joint type="slide" axis="0 0 2" armature=".3" frictionloss=".2" solreffriction=".1" margin=".01"/>
     <geom size=".1" pos=".3 0 0"/><body pos="1 0 0"><body pos="0 1 0" euler="0 0 20"><joint type="ball" pos=".1 0 0" armature=".1" springdamper=".2 1" actuatorfrcrange="-3 4"/><geom type="box" size=".1 .2 .3"/></body></body></body></body>
     <body pos="0 0 3"><joint type="free" damping="3" armature=".5" stiffness="2"/><geom size=".1"/></body></worldbody></mujoco>)");
}

TEST_CASE("lone bodies on slides have inverse weights of their own") {
  for (char const* body :
       {"<joint type='slide' armature='1'/><geom size='.1'/>",
        "<joint type='slide' axis='0 -1 0'/><joint type='slide' axis='1 0 0' armature='2'/><geom size='.1'/>",
        "<joint type='slide'/><geom size='.1' pos='.1 0 0'/>", "<joint type='slide' axis='1 1 0'/><geom size='.1'/>",
        "<joint type='slide' pos='0 0 1'/><geom size='.1'/>", "<joint type='slide'/><joint axis='0 1 0' armature='2'/><geom size='.1'/>",
        "<joint type='slide'/><geom size='.1'/><body/>"}) {
    compare(std::string("<mujoco><worldbody><body>") + body + "</body></worldbody></mujoco>");
    compare(std::string("<mujoco><worldbody><body><body>") + body + "</body></body></worldbody></mujoco>");
    compare(std::string("<mujoco><worldbody><body><body pos='1 0 0'><body>") + body + "</body></body></body></worldbody></mujoco>");
  }
}

TEST_CASE("default classes: nesting, childclass, element over class over parent, partial lists") {
  compare(R"(<mujoco><default class="main"><geom size=".1 .2" rgba="1 0 0 1" friction=".5 .1 .2" density="100"/>
     <default class="a"><geom type="capsule" friction=".7" solimp=".8"/><joint axis="1 0 0" range="-10 10"/><site size=".3"/>
        <default class="b"><geom size=".15" solref=".1"/><joint armature="1" limited="false"/></default></default>
     <default class="c"><geom type="box" size=".3 .3 .3"/></default></default>
     <default><geom margin=".01"/></default>
   <worldbody><body childclass="a"><joint/><geom/><geom class="b"/><geom class="main"/>
      <body pos="1 0 0"><joint class="b" range="-20 5"/><geom class="c" size=".2"/><frame childclass="b"><geom pos="0 0 1"/></frame><body childclass="c" pos="0 0 2"><geom/><geom class="a" name="last"/></body></body></body></worldbody></mujoco>)");
}

TEST_CASE("frame, replicate and attach") {
  Texts const two{
      {"main.xml",
       R"(<mujoco><option timestep=".01"/><asset><model name="c" file="child.xml"/><model name="c2" file="child.xml"/></asset><default><geom rgba="0 1 0 1"/></default>
     <worldbody><body name="first"><joint name="fj"/><geom size=".1"/></body>
       <frame pos="1 0 0" euler="0 0 90"><attach model="c" body="r" prefix="p_"/><frame pos="0 1 0"><geom size=".1" fromto="0 0 0 0 1 1" type="capsule"/></frame></frame>
       <body name="last" pos="0 0 3"><frame euler="90 0 0"><joint name="lj" axis="0 0 1" pos="0 1 0"/><geom size=".1"/><body pos="1 2 3"><joint type="slide" axis="1 1 0"/><geom size=".1"/></body></frame></body>
       <attach model="c2" prefix="q_"/></worldbody>
     <tendon><fixed name="own"><joint joint="fj" coef="1"/></fixed></tendon><actuator><motor name="mo" joint="lj"/></actuator></mujoco>)"},
      {"child.xml",
       R"(<mujoco model="c"><compiler angle="radian"/><default><geom rgba="1 0 0 1"/><motor gear="3"/><default class="k"><geom size=".3"/></default></default>
     <worldbody><geom name="floor" type="plane" size="1 1 1"/><body name="r"><freejoint name="f"/><geom class="k" name="g"/><body name="s" pos="1 0 0"><joint name="j" range="0 1"/><geom size=".1" name="gs"/></body></body>
     <body name="other"><joint name="jo"/><geom size=".1"/></body></worldbody><contact><exclude body1="r" body2="s"/></contact>
     <tendon><fixed name="t"><joint joint="j" coef="2"/></fixed><fixed name="t2"><joint joint="j" coef="2"/><joint joint="jo" coef="1"/></fixed></tendon>
     <actuator><motor name="m" joint="j"/><motor name="m2" joint="jo"/><motor name="mt" tendon="t"/></actuator>
     <keyframe><key name="k1" qpos="1 2 3 1 0 0 0 .5 .7" ctrl="4 5 6"/><key name="k2" time="3" qvel="1 2 3 4 5 6 7 8"/></keyframe></mujoco>)"}};
  compare(two);
  Texts replicated = two;
  replicated["main.xml"] =
      R"(<mujoco><asset><model name="c" file="child.xml"/></asset><worldbody><replicate count="3" offset="0 0 1" euler="0 30 10" sep="-"><frame pos="1 0 0"><attach model="c" body="r" prefix="p_"/></frame></replicate></worldbody></mujoco>)";
  compare(replicated);
  for (char const* count : {"9", "10", "11"})
    compare(
        std::string(
            R"(<mujoco><worldbody><body name="a"><joint name="ja"/><geom size=".1"/></body><replicate count="2" offset="1 0 0" euler="0 40 0"><body name="x"><joint name="jx"/><geom name="gx" size=".1"/>
      <replicate count=")") +
        count +
        R"(" euler="0 0 10" offset=".1 0 0" sep="_"><geom size=".01" pos="1 0 0"/><site name="si"/><body name="y" pos="0 0 1"><joint name="jy" axis="1 2 3" pos=".1 .2 .3"/><geom size=".1"/></body></replicate></body></replicate></worldbody>
      <contact><exclude body1="a" body2="x"/></contact>
      <tendon><fixed name="ta"><joint joint="ja" coef="1"/><joint joint="jx" coef="1"/></fixed><fixed name="tt"><joint joint="ja" coef="1"/></fixed><fixed name="ty"><joint joint="jy" coef="1"/><joint joint="jx" coef="1"/></fixed></tendon>
      <actuator><motor name="mx" joint="jx"/><motor name="ma" joint="ja"/><motor name="mt" tendon="ty"/></actuator></mujoco>)");
}

TEST_CASE("include") {
  compare({{"main.xml",
            "<mujoco><include file='parts.xml'/><worldbody><include file='body.xml'/><body><joint/><geom "
            "size='.2'/></body></worldbody></mujoco>"},
           {"parts.xml", "<mujocoinclude><default><geom density='10'/></default><option timestep='.02'/></mujocoinclude>"},
           {"body.xml", "<mujoco><body name='in'><joint name='j'/><geom size='.1'/></body></mujoco>"}});
}

TEST_CASE("tendons and actuators") {
  compare(
      R"(<mujoco><default><tendon solreflimit=".03 1" springlength=".2"/><position kp="20"/><general ctrlrange="-2 2"/><motor gear="5 1"/></default>
    <worldbody><body><joint name="a" range="-40 80" ref="10"/><geom size=".1" pos="0 0 .3"/><body pos="0 0 1"><joint name="b" type="slide" axis="1 0 0" springref=".4" range="-1 1"/><geom size=".1"/></body></body>
      <body pos="3 0 0"><joint name="c"/><geom size=".1" pos="0 1 0"/></body></worldbody>
    <tendon><fixed name="t" range="-1 2" stiffness="3" damping=".1" frictionloss=".2" armature=".4" margin=".01"><joint joint="a" coef=".5"/><joint joint="b" coef="-2"/></fixed>
      <fixed name="across" springlength="-1 -1"><joint joint="a" coef="1"/><joint joint="c" coef="2"/></fixed><fixed name="slack" springlength="0 .5" limited="false" range="0 1"><joint joint="b" coef="1"/></fixed></tendon>
    <actuator><motor name="m" joint="a" forcerange="-3 3"/><motor tendon="t" gear="2"/><motor jointinparent="b" ctrllimited="false"/></actuator></mujoco>)");
  std::string const bodies =
      R"(<worldbody><body><joint name="a" axis="0 1 0" range="-40 80"/><geom size=".1" pos="0 0 .3"/><body pos="0 0 1"><joint name="b" type="slide" axis="1 0 0" range="-1 2"/><geom size=".1"/></body></body></worldbody>
    <tendon><fixed name="t" range="-1 2"><joint joint="a" coef=".5"/><joint joint="b" coef="-2"/></fixed></tendon>)";
  compare(
      "<mujoco><default><position kp='20' kv='2'/></default>" + bodies +
      R"(<actuator><position joint="a"/><position joint="b" kp="5" inheritrange="1"/><position tendon="t" kp="5" inheritrange=".5" gear="3"/></actuator></mujoco>)");
  // a class hands its inheritrange to what is no servo, and to a general that is one
  compare("<mujoco><default><default class='A'><position inheritrange='1'/><general/><intvelocity kp='3'/></default></default>" + bodies +
          "<actuator><motor joint='a' class='A'/><motor joint='b' class='A' ctrlrange='-2 2'/><velocity joint='a' class='A'/>"
          "<position joint='b' class='A'/></actuator></mujoco>");
  compare(
      "<mujoco><default><position inheritrange='1'/></default>" + bodies +
      "<actuator><general joint='b' ctrlrange='-.3 .3'/><position joint='b' ctrlrange='-.3 .3'/><motor joint='a'/></actuator></mujoco>");
  // actuators of all types share one default, and each element changes what stands
  compare(
      R"(<mujoco><default><general gainprm="9" biastype="affine" biasprm="1 -2 -3"/><default class="v"><velocity kv="4"/></default><default class="m"><motor gear="2"/></default>
    <default class="p"><position kp="6" dampratio=".8"/><default class="q"><position kv="1" kp="3"/></default></default></default>)" +
      bodies +
      R"(<actuator><position joint="a"/><position joint="a" kp="3"/><general joint="b"/><motor joint="b"/><velocity joint="a"/><general class="v" joint="a"/><position class="v" joint="a"/>
    <general class="m" joint="b"/><position class="p" joint="b"/><general class="p" joint="b"/><position class="q" joint="b" kp="7"/><motor class="q" joint="a"/></actuator></mujoco>)");
  compare(
      "<mujoco>" + bodies +
      R"(<actuator><position joint="a" kp="10" dampratio="1"/><position tendon="t" kp="5" dampratio=".5" gear="3"/><velocity joint="a" kv="3" ctrlrange="-1 1"/>
    <general joint="b" gainprm="7" biastype="affine" biasprm="1 -7 -2"/><general joint="b" gainprm="7" biastype="affine" biasprm="0 -7 1"/><general joint="a" biasprm="4 4 4"/><general joint="a" gaintype="affine" gainprm="3"/></actuator></mujoco>)");
}

// Two arms, sites, shapes to wrap round, a mocap body: what the tests below hang their elements on.
std::string const robot = R"(<worldbody><site name="w" pos=".1 .2 1.5"/><geom name="floor" type="plane" size="1 1 1"/>
    <body name="a" pos="0 0 1"><joint name="j1" axis="0 1 0" range="-50 70"/><geom name="ga" type="capsule" size=".05" fromto="0 0 0 .5 0 0"/><site name="s1" pos=".2 0 .1" euler="10 20 30"/>
      <geom name="cyl" type="cylinder" size=".06 .1" pos=".5 0 0" euler="90 10 0"/><site name="side" pos=".5 .02 .2"/>
      <body name="b" pos=".5 0 0"><joint name="j2" axis="0 1 .1" ref="10"/><joint name="j3" type="slide" axis="1 0 0" range="-.1 .2"/><geom name="gb" size=".07" pos=".3 0 0"/><site name="s2" pos=".4 .05 .1" euler="0 50 10"/></body>
      <body name="c" pos="0 .4 0"><joint name="ball" type="ball"/><geom name="sph" size=".08" pos=".2 0 0"/><site name="s3" pos=".3 .1 .2"/></body></body>
    <body name="f" pos="2 0 1" quat="1 .2 .3 .4"><freejoint name="free"/><geom name="gf" type="box" size=".1 .2 .3"/><site name="s4" pos=".1 0 0" euler="0 30 0"/></body>
    <body name="m" mocap="true" pos="1 2 3" quat="1 1 0 0"><geom name="gm" size=".1"/><site name="sm"/></body></worldbody>)";

TEST_CASE("actuators: every transmission and every law") {
  compare_twice(
      "<mujoco><compiler><lengthrange uselimit='true'/></compiler>" + robot +
      R"(<tendon><fixed name="t"><joint joint="j1" coef="2"/><joint joint="j3" coef="-3"/></fixed><spatial name="sp" range="0 3"><site site="w"/><site site="s1"/><geom geom="cyl" sidesite="side"/><site site="s2"/></spatial></tendon>
    <actuator><motor name="m1" joint="j1" gear="3" armature=".2" damping=".4"/><motor joint="ball" gear="1 2 3"/><motor jointinparent="ball" gear="1 2 3"/><motor joint="free" gear="1 2 3 4 5 6"/><motor jointinparent="free" gear="1 2 3 4 5 6"/>
     <motor tendon="t" gear="2" armature=".3"/><motor tendon="sp" gear="-2" group="3"/><motor site="s1" gear="1 2 3 4 5 6"/><motor site="s2" refsite="s3" gear="1 2 3 0 0 0"/><motor site="s2" refsite="w" gear="1 2 3 4 5 6"/><motor site="s4" refsite="s3" gear="0 0 0 4 5 6"/>
     <motor cranksite="s2" slidersite="s1" cranklength=".5" gear="2"/><motor cranksite="s3" slidersite="w" cranklength=".1"/>
     <adhesion body="a" gain="3" ctrlrange="0 2"/><position joint="j1" kp="5" kv=".3" timeconst=".2"/><position tendon="sp" kp="30" dampratio=".7"/><position site="s2" refsite="s3" kp="3" dampratio="1.2" gear="0 0 1 0 0 0"/>
     <intvelocity joint="j1" kp="4" kv="2" actrange="-1 1" ctrlrange="-2 2"/><intvelocity joint="j1" kp="4" inheritrange=".7"/><position joint="j3" kp="4" inheritrange="1.2" timeconst=".1"/><damper joint="j2" kv="3" ctrlrange="0 1"/><damper joint="j2" ctrlrange="0 1"/>
     <cylinder joint="j3" timeconst=".3" area=".2" bias="1 2 3"/><cylinder joint="j3" diameter=".2"/><muscle tendon="t" lengthrange="-1 2"/><muscle joint="j1" force="30" timeconst=".02 .03" tausmooth=".1" range=".6 1.2" lmin=".4" lmax="1.7" vmax="2" fpmax="1.4" fvmax="1.1" scale="150"/>
     <muscle tendon="sp"/><general joint="j1" dyntype="filter" dynprm=".3" gaintype="affine" gainprm="1 2 3" biastype="affine" biasprm="4 5 6" actearly="true" actlimited="true" actrange="-1 2" forcerange="-3 3"/>
     <general joint="j1" dyntype="muscle" gaintype="muscle" biastype="muscle" dynprm=".01 .04 0" gainprm=".75 1.05 -1 200 .5 1.6 1.5 1.3 1.2" biasprm=".75 1.05 -1 200 .5 1.6 1.5 1.3 1.2"/></actuator>
    <keyframe><key name="k" mpos="3 2 1" mquat="0 0 2 0"/><key time="1" act="1 2 3 4 5 6 7 8 9 10 11"/></keyframe></mujoco>)");
}

TEST_CASE("actuators: shortcuts in default classes change each other as in MuJoCo") {
  for (char const* one :
       {"<general dyntype='filter' dynprm='.3' gainprm='.9' biastype='affine' biasprm='1 -2 -3'/>",
        "<position kp='6' dampratio='.8' timeconst='.1'/>", "<velocity kv='4'/>", "<intvelocity kp='3' actrange='0 1'/>",
        "<damper kv='2' ctrlrange='0 1'/>", "<cylinder area='3' bias='1 2 3'/>", "<muscle force='3' scale='100'/>", "<motor gear='2'/>",
        "<general gaintype='affine' gainprm='2 3 -4' dynprm='4' biasprm='1 2 -3'/>", "<general biasprm='1 2 -3' dynprm='.7'/>",
        "<general gaintype='muscle' gainprm='.7 1.1 5' dyntype='filterexact' dynprm='.4 .5'/>"})
    for (char const* two : {"<motor/>", "<position kp='3'/>", "<velocity kv='7'/>", "<general gear='5'/>", "<muscle vmax='3'/>",
                            "<cylinder timeconst='.7'/>", "<general gaintype='affine'/>", "<general biastype='none' dyntype='muscle'/>"}) {
      CAPTURE(one);
      CAPTURE(two);
      std::string const end = " joint='j1' class='two' lengthrange='0 1' ctrlrange='0 2'/></actuator></mujoco>";
      for (char const* word : {"motor", "position", "velocity", "intvelocity", "damper", "cylinder", "muscle", "general"}) {
        CAPTURE(word);
        Texts const texts{{"main.xml", std::string("<mujoco><default><default class='one'>") + one + "<default class='two'>" + two +
                                           "</default></default></default>" + robot + "<actuator><" + word + end}};
        auto const theirs = oracle(texts, true);
        if (theirs)
          compare(compile(description(texts)), theirs.get());
        else
          CHECK_THROWS_AS(compile(description(texts)), Error);
      }
    }
}

TEST_CASE("equality constraints, pairs, cameras, sensors, keyframes, mocap") {
  compare_twice(
      "<mujoco><option density='1.2' viscosity='1e-3' wind='1 2 3' magnetic='0 1 0' actuatorgroupdisable='1 3' o_margin='.1' o_solref='.1 "
      ".2' o_friction='1 2'><flag override='enable' equality='disable'/></option>"
      "<default><equality solref='.1 .5'/><pair friction='.3 .4' margin='.1'/><default class='e'><equality active='false' "
      "solimp='.5'/></default></default>" +
      robot +
      R"(<tendon><fixed name="t1"><joint joint="j1" coef="2"/></fixed><fixed name="t2" actuatorfrcrange="-1 2" stiffness="1 2 3" damping="3 2 1"><joint joint="j3" coef="1"/></fixed></tendon>
    <equality><connect name="c1" body1="b" body2="f" anchor=".1 .2 .3"/><connect body1="c" anchor="1 2 3" class="e"/><connect site1="s1" site2="s4"/><weld body1="b" body2="f"/><weld body1="b" body2="f" anchor=".1 .2 .3" torquescale="2"/>
      <weld body1="f" body2="m" relpose="1 2 3 2 0 0 1" anchor="1 0 0"/><weld body1="f" relpose="1 2 3 0 0 0 0"/><weld site1="s2" site2="s3" torquescale=".3"/><joint joint1="j1"/><joint joint1="j1" joint2="j3" polycoef="1 2 3 4"/><tendon tendon1="t1" tendon2="t2" polycoef="0 2"/><tendon tendon1="t1" active="false"/></equality>
    <contact><pair name="p" geom1="gb" geom2="gf"/><pair geom1="gf" geom2="ga" condim="6" friction="1 2 3 4 5" solref="-100 -10" solreffriction=".1 2" solimp=".5 .6 .7" margin=".3" gap=".2" adhesion=".7"/><pair geom1="sph" geom2="floor" condim="1"/><exclude body1="b" body2="c"/></contact>
    <sensor><touch site="s1" cutoff="3" noise=".1"/><accelerometer site="s1"/><velocimeter site="s1"/><gyro name="g" site="s1"/><force site="s1"/><torque site="s1"/><magnetometer site="s1"/><rangefinder site="s1"/><rangefinder site="s1" data="dist point normal"/><jointpos joint="j1"/><jointvel joint="j1"/><tendonpos tendon="t1"/><tendonvel tendon="t1"/>
      <jointactuatorfrc joint="j1"/><tendonactuatorfrc tendon="t1"/><ballquat joint="ball"/><ballangvel joint="ball"/><jointlimitpos joint="j1"/><framepos objtype="site" objname="s1" reftype="body" refname="f"/><framequat objtype="xbody" objname="a"/><framexaxis objtype="geom" objname="ga"/>
      <framelinvel objtype="body" objname="a" reftype="site" refname="s4"/><frameangvel objtype="body" objname="a"/><framelinacc objtype="site" objname="s2"/><frameangacc objtype="body" objname="b"/><subtreecom body="a"/><subtreelinvel body="a"/><subtreeangmom body="a"/><insidesite site="s1" objtype="body" objname="f"/>
      <distance geom1="ga" body2="f" cutoff="1"/><normal geom1="ga" geom2="gf" cutoff="1"/><fromto body1="a" geom2="gf" cutoff="1"/><contact geom1="ga" subtree2="f" data="found force dist" num="3" reduce="mindist"/><contact site="s1"/><e_potential/><e_kinetic/><clock/><user dim="4"/><user name="u" objtype="body" objname="a" dim="2"/></sensor>
    <keyframe><key qpos="1 2 3 .5 .5 .5 .5 1 2 3 4 5 6 7" qvel="1 2 3 4 5 6 7 8 9 10 11 12" time="3"/></keyframe></mujoco>)");
  compare_twice(
      R"(<mujoco><worldbody><geom name="a" size=".1" margin=".1" gap=".3" solref=".1 .5" solmix="2" friction="1 2 3" solimp=".1 .2 .3"/><body><joint/><geom name="b" size=".1" margin=".2" gap=".5" solref=".2 .7" friction=".5 3 1"/></body>
     <body><joint/><geom name="c" size=".1" margin=".2" solref="-100 -7" priority="1"/></body></worldbody><contact><pair geom1="a" geom2="b"/><pair geom1="c" geom2="a"/><pair geom1="b" geom2="c" friction="7" solref=".3" solimp=".5"/></contact></mujoco>)");
  compare_twice(
      R"(<mujoco><worldbody><camera name="fix" euler="10 20 30" pos="1 2 3"/><camera mode="targetbody" target="b"/><camera mode="targetbody"/><body name="a" pos="0 0 1"><joint/><geom size=".1"/><camera mode="track" pos="1 0 0"/><camera mode="trackcom" fovy="33" zaxis="1 2 3"/>
     <body name="b" pos="1 0 0" euler="0 10 20"><joint type="ball"/><geom size=".2" pos=".3 0 0"/><camera mode="targetbodycom" target="a" pos="0 1 0"/><camera sensorsize=".02 .01" focal=".03 .04" resolution="640 480"/><camera sensorsize=".02 .01" focalpixel="300 400" resolution="640 480"/></body></body></worldbody></mujoco>)");
  compare_twice(
      R"(<mujoco><worldbody><body gravcomp=".5"><joint stiffness="1 2 3" damping="4 5" actuatorgravcomp="true"/><geom type="ellipsoid" size=".1 .2 .3" fluidshape="ellipsoid" fluidcoef=".1 .2 .3 .4 .5" contype="0" conaffinity="0"/><geom size=".1" pos="1 0 0" adhesion="3" surfacevel="1 2 3 4 5 6"/>
     <body pos="0 0 1"><joint type="slide" stiffness="0 0 4" damping="0 1"/><geom size=".1"/></body></body></worldbody></mujoco>)");
}

TEST_CASE("spatial tendons: 400 paths round spheres and cylinders, with sides outside and inside, with pulleys") {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(-1, 1);
  auto const three = [&](double scale) {
    return std::to_string(scale * u(random)) + " " + std::to_string(scale * u(random)) + " " + std::to_string(scale * u(random));
  };
  for (int model = 0; model < 4; ++model) {
    CAPTURE(model);
    std::string sites, geoms, tendons;
    for (int i = 0; i < 100; ++i) {
      std::string const n = std::to_string(i);
      bool const cylinder = i % 2;
      sites += "<site name='x" + n + "' pos='" + three(1) + "'/>";
      geoms += "<geom name='g" + n + "' contype='0' conaffinity='0' type='" + (cylinder ? "cylinder" : "sphere") + "' size='" +
               std::to_string(0.15 + 0.1 * u(random)) + (cylinder ? " .1'" : "'") + " pos='" + three(0.3) + "' axisangle='" + three(1) +
               " 40'/><site name='y" + n + "' pos='" + three(1) + "'/><site name='s" + n + "' pos='" + three(i % 5 == 0 ? 0.1 : 0.7) +
               "'/>";
      tendons +=
          "<spatial><site site='x" + n + "'/><geom geom='g" + n + "'" + (i % 3 ? " sidesite='s" + n + "'" : "") + "/><site site='y" + n +
          "'/>" +
          (i % 4 == 0 ? "<pulley divisor='2.5'/><site site='s" + n + "'/><site site='x" + std::to_string((i + 1) % 100) + "'/>" : "") +
          "</spatial>";
    }
    compare("<mujoco><worldbody>" + sites +
            "<body name='a'><joint axis='1 2 3'/><joint type='slide' springref='.3'/><geom size='.1' pos='.1 .2 .3'/>" + geoms +
            "</body></worldbody><tendon>" + tendons + "</tendon></mujoco>");
  }
}

TEST_CASE("fusestatic, discardvisual, alignfree, fitaabb and lengthrange as MuJoCo's compiler does them") {
  std::string const rest = R"(<worldbody><body name="base" pos="0 0 1"><joint name="j" type="slide"/><geom name="g0" size=".1"/>
      <body pos=".1 0 0" euler="10 20 30"><geom type="box" size=".1 .2 .3" pos=".1 0 0"/><site name="s1"/><camera name="c" pos="0 0 1"/><body pos="0 1 0" euler="0 0 40"><geom size=".05"/><body name="leaf" pos="1 0 0"><joint axis="1 0 0"/><geom size=".1"/></body></body></body>
      <body name="named" pos=".2 0 0"><geom size=".1"/></body><body name="measured"><inertial pos="0 0 .1" mass="1" diaginertia=".1 .1 .1"/><site name="fs"/></body><body fuse="false" pos=".3 0 0"><geom size=".1"/></body><body gravcomp="1" pos=".4 0 0"><geom size=".1"/></body></body>
    <body pos="3 0 0"><geom name="still" size=".2"/><body pos="0 0 1" euler="30 0 0"><freejoint name="fj"/><geom type="box" size=".1 .2 .3" pos=".1 .2 0" euler="1 2 3"/><geom size=".1" contype="0" conaffinity="0" mass="1" pos="0 0 1"/><site name="s2" pos="1 0 0"/><camera pos="0 1 0"/></body></body></worldbody>
    <contact><exclude body1="named" body2="base"/></contact><sensor><force site="fs"/></sensor></mujoco>)";
  std::string aligned = rest;
  aligned.replace(aligned.find("<freejoint name=\"fj\"/>"), 22, "<freejoint name=\"fj\" align=\"true\"/>");
  // a free body has to stand in the world
  auto const moved = [](std::string text) {
    auto const at = text.find("<body pos=\"3 0 0\"><geom name=\"still\" size=\".2\"/>");
    text.erase(at, std::string("<body pos=\"3 0 0\"><geom name=\"still\" size=\".2\"/>").size());
    auto const end = text.find("</body></body></worldbody>", at);
    return text.erase(end, 7);
  };
  compare("<mujoco>" + moved(rest));
  compare("<mujoco><compiler fusestatic='true'/>" + moved(rest));
  compare("<mujoco><compiler fusestatic='true' inertiafromgeom='true'/>" + moved(rest));
  compare("<mujoco><compiler discardvisual='true'/>" + moved(rest));
  compare("<mujoco><compiler discardvisual='true' fusestatic='true' settotalmass='4'/>" + moved(rest));
  compare("<mujoco><compiler alignfree='true'/>" + moved(rest));
  compare_twice("<mujoco>" + moved(aligned));
}

TEST_CASE("fusestatic: what stands in the world is part of it, whatever a fluid or gravcomp would do to it") {
  for (std::string const option : {"", "density='1000'", "viscosity='1'"})
    for (std::string const compiler : {"", "settotalmass='10'"}) {
      CAPTURE(option);
      CAPTURE(compiler);
      compare("<mujoco><compiler fusestatic='true' " + compiler + "/><option " + option + R"(/><worldbody>
        <body name="s" pos="0 0 1" gravcomp="1"><geom size=".1" mass="1"/><body name="below" pos="0 1 0" euler="10 20 30"><geom type="box" size=".1 .2 .3" fluidshape="ellipsoid"/><body name="hung" pos="1 0 0"><joint/><geom size=".1"/></body></body></body>
        <body name="shaped" pos="0 0 3"><geom type="ellipsoid" size=".1 .2 .3" fluidshape="ellipsoid"/></body>
        <body name="m" pos="1 0 0"><joint name="j" type="slide" axis="0 1 0"/><geom type="box" size=".1 .2 .3" mass="1"/><body name="k" pos="0 0 1"><geom size=".1" mass=".5"/></body></body>
        </worldbody><actuator><motor joint="j"/></actuator></mujoco>)");
    }
}

// The frame is a convention of the eigen solver, and qpos0 shows it. Rounding of the tensor, and MuJoCo's end of its rotations at entries
// of 1e-12, turn an axis by 1e-12 over the distance of two moments: 1e-9 where that is 1e-2 at least.
TEST_CASE("aligned free bodies stand in MuJoCo's principal frame, by its sign too") {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> u(-1, 1);
  auto const digits = [](double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.17g ", x);
    return std::string(text);
  };
  std::vector<std::string> inertials{"fullinertia='.1 .12 .13 -.008 .02 -.015'"};
  for (auto const& moments : {".1 .12 .14", ".1 .14 .12", ".12 .1 .14", ".12 .14 .1", ".14 .1 .12", ".14 .12 .1"}) {
    for (auto const& products :
         {"0 0 0", ".01 0 0", "-.01 0 0", "0 .01 0", "0 -.01 0", "0 0 .01", "0 0 -.01", ".01 .01 .01", "-.01 .01 .01"})
      inertials.push_back(std::string("fullinertia='") + moments + " " + products + "'");
    inertials.push_back(std::string("diaginertia='") + moments + "'");
  }
  for (int i = 0; i < 300; ++i) {
    Double3 const moments{.15 + .02 * u(random), .12 + .01 * u(random), .1 + .009 * u(random)};
    auto const t = gsp::detail::rotated_diagonal(gsp::detail::normalized({u(random), u(random), u(random), u(random)}), moments);
    std::string text = "fullinertia='";
    for (double x : t) text += digits(x);
    inertials.push_back(text + "'");
  }
  std::vector<std::string> bodies;
  for (auto const& i : inertials) bodies.push_back("<inertial pos='.1 .2 .3' mass='2' " + i + "/>");
  for (int i = 0; i < 30; ++i) {
    std::string geoms;
    for (int g = 0; g < 3; ++g) {
      geoms += "<geom type='box' size='.1 .2 .3' contype='0' conaffinity='0' pos='";
      for (int k = 0; k < 3; ++k) geoms += digits(u(random));
      geoms += "' axisangle='";
      for (int k = 0; k < 4; ++k) geoms += digits(u(random));
      geoms += "'/>";
    }
    bodies.push_back(geoms);
  }
  std::string text = "<mujoco><compiler angle='radian'/><worldbody>";
  for (auto const& b : bodies) text += "<body euler='.1 .2 .3'><freejoint align='true'/>" + b + "</body>";
  Texts const texts{{"main.xml", text + "</worldbody></mujoco>"}};
  auto const theirs = oracle(texts);
  auto const ours = compile(description(texts));
  REQUIRE(ours.nq == theirs->nq);
  for (int i = 0; i < ours.nq; ++i) {
    INFO(bodies[std::size_t(i / 7)]);
    CHECK(std::abs(ours.qpos0[std::size_t(i)] - theirs->qpos0[i]) < 1e-9);
  }
}

TEST_CASE("replicating and attaching copy whatever names what is copied") {
  std::string const inside =
      R"(<body name="x" pos=".1 0 0"><joint name="jx" axis="0 1 0"/><geom name="gx" size=".1" pos="0 0 .3"/><site name="sx" pos="0 0 .2"/><camera name="cx" mode="targetbody" target="x"/></body>)";
  std::string const lists =
      R"(<tendon><spatial name="sp"><site site="sw"/><geom geom="gw" sidesite="sx"/><site site="sx"/></spatial><fixed name="fx"><joint joint="jx" coef="2"/></fixed></tendon>
     <contact><pair geom1="gx" geom2="gw"/><exclude body1="x" body2="w"/></contact><equality><weld body1="x" body2="w"/><connect site1="sx" site2="sw"/><joint joint1="jx"/><tendon tendon1="fx"/></equality>
     <actuator><motor name="mx" joint="jx"/><general name="ax" tendon="sp" dyntype="filter"/><motor site="sx" refsite="sw"/></actuator>
     <sensor><gyro name="gy" site="sx"/><framepos objtype="body" objname="x" reftype="site" refname="sw"/><actuatorfrc actuator="mx"/><tendonpos tendon="sp"/></sensor>)";
  std::string const own = R"(<site name="sw" pos="0 0 1"/><body name="w"><joint name="jw"/><geom name="gw" size=".1"/></body>)";
  compare_twice("<mujoco><worldbody>" + own + "<replicate count='3' offset='1 0 0' sep='-'>" + inside + "</replicate></worldbody>" + lists +
                "</mujoco>");
  compare(
      R"(<mujoco><worldbody><site name="sw" pos="0 0 1"/><body name="w"><joint name="jw"/><geom name="gw" size=".1"/></body><replicate count='2' offset='1 0 0' sep='-'><body name="x" pos=".1 0 0"><joint name="jx" axis="0 1 0"/><geom name="gx" size=".1" pos="0 0 .3"/><site name="sx" pos="0 0 .2"/><site name="sy" pos="0 0 .3"/></body></replicate></worldbody>
    <tendon><fixed name="mixed"><joint joint="jw" coef="1"/><joint joint="jx" coef="2"/></fixed><spatial name="in"><site site="sx"/><site site="sy"/></spatial><spatial name="part"><site site="sx"/><site site="sw"/></spatial><spatial name="side"><site site="sx"/><geom geom="gx" sidesite="sw"/><site site="sy"/></spatial><spatial name="geo"><site site="sx"/><geom geom="gw"/><site site="sy"/></spatial></tendon>
    <equality><weld body1="x" body2="w"/><weld body1="x"/><connect body1="w" body2="x" anchor="0 0 0"/><joint joint1="jw" joint2="jx"/></equality>
    <actuator><motor name="ref" site="sx" refsite="sw"/><motor site="sw" refsite="sx"/><motor cranksite="sx" slidersite="sw" cranklength="1"/><motor name="m" joint="jx"/><adhesion body="x" ctrlrange="0 1"/></actuator>
    <sensor><framepos objtype="site" objname="sw" reftype="body" refname="x"/><actuatorfrc actuator="m"/><actuatorfrc actuator="ref"/></sensor></mujoco>)");
  Texts const two{
      {"main.xml",
       "<mujoco><asset><model name='c' file='child.xml'/></asset><worldbody><body name='o'><joint/><geom size='.1'/><frame pos='0 0 "
       "1'><attach model='c' body='r' prefix='p_'/></frame></body><attach model='c' prefix='q_'/></worldbody></mujoco>"},
      {"child.xml", "<mujoco model='c'><worldbody><body name='r'><geom size='.1'/>" + own + inside +
                        "<body name='deep'><joint/><geom size='.1'/></body></body><body name='m' mocap='true' pos='1 2 3'/></worldbody>" +
                        lists + "<keyframe><key name='k' act='3' ctrl='1 2 3' qpos='.1 .2 .3'/></keyframe></mujoco>"}};
  compare_twice(two);
  compare_twice(Texts{{"main.xml",
                       "<mujoco><asset><model name='c' file='child.xml'/></asset><worldbody><body name='o' mocap='true'/><attach model='c' "
                       "prefix='q_'/></worldbody></mujoco>"},
                      {"child.xml",
                       "<mujoco model='c'><worldbody><body name='m' mocap='true' pos='1 2 3'/><body name='r'><joint name='j'/><geom "
                       "size='.1'/></body></worldbody><actuator><motor joint='j'/><general joint='j' dyntype='filter'/></actuator>"
                       "<keyframe><key name='k' act='3' ctrl='1 2' mpos='3 2 1' mquat='0 1 0 0'/></keyframe></mujoco>"}});
}

TEST_CASE("what names the world beside what is replicated or attached stays") {
  std::string const lists =
      R"(<contact><exclude body1="r" body2="world"/><exclude body1="r" body2="o"/></contact>
     <equality><connect body1="r" anchor="0 0 0"/><connect body1="r" body2="world" anchor="0 0 0"/><weld body1="world" body2="r"/><weld body1="r" body2="o"/><connect body1="o" body2="world" anchor="0 0 0"/></equality>
     <sensor><framepos objtype="body" objname="r" reftype="body" refname="world"/><framepos objtype="body" objname="world" reftype="body" refname="r"/><contact body1="r" body2="world"/><insidesite site="s" objtype="body" objname="world"/><framepos objtype="body" objname="r" reftype="body" refname="o"/></sensor>)";
  std::string const r = R"(<body name="r" pos="0 0 .3"><freejoint/><geom name="g" size=".1"/><site name="s"/></body>)";
  std::string const o = R"(<body name="o" pos="2 0 0"><geom name="go" size=".1"/></body>)";
  auto const replicated = [&](std::string const& in, std::string const& beside) {
    return "<mujoco><worldbody>" + beside + "<replicate count='2' offset='1 0 0'>" + in + "</replicate></worldbody>" + lists + "</mujoco>";
  };
  compare_twice(replicated(r, o));
  compare_twice(replicated(r + o, ""));
  for (std::string const what : {"body='r' ", ""}) {
    Texts const attached{
        {"main.xml",
         "<mujoco><asset><model name='c' file='child.xml'/></asset><worldbody><geom type='plane' size='1 1 1'/><frame pos='1 0 "
         "0'><attach model='c' " +
             what + "prefix='p_'/></frame></worldbody></mujoco>"},
        {"child.xml", "<mujoco><worldbody>" + o + r + "</worldbody>" + lists +
                          "<sensor><framepos objtype='body' objname='world'/><framepos objtype='body' objname='r'/></sensor></mujoco>"}};
    compare_twice(attached);
    int dropped = 0;
    for (auto const& line : description(attached).report)
      if (line.kind == ReportLine::Kind::left_out && line.text == "entries that name what is not attached, as MuJoCo does")
        dropped += line.count;
    CHECK(dropped == (what.empty() ? 1 : 5));
  }
}

TEST_CASE("models of the collection written and loaded by MuJoCo have the same numbers" * doctest::test_suite("data")) {
  for (char const* name :
       {"dm_control/suite/quadruped.xml", "dm_control/kinova/jaco_arm.xml", "mujoco/adhesion/active_adhesion.xml",
        "mujoco/mjx/sensor/sensor.xml", "mujoco/mjx/tendon/tendon.xml", "mujoco/slider_crank/slider_crank.xml", "mujoco/car/car.xml",
        "mujoco/balloons/balloons.xml", "mujoco/mjx/actuator/arm21.xml", "gym_robotics/hand/reach.xml",
        "genesis/four_bar_linkage_weld/four_bar_linkage_weld.xml", "mujoco/mjx/pendula.xml", "mujoco/sleep/humanoid.xml"}) {
    CAPTURE(name);
    auto const path = gsp_test::data("models/" + std::string(name));
    if (!path) {
      gsp_test::skip(std::string(name) + " is missing from GSP_DATA_DIR");
      continue;
    }
    auto const d = io::read_mjcf(*path);
    auto const theirs = oracle({{"main.xml", io::format_mjcf(d)}});
    compare(compile(d), theirs.get());
  }
}

TEST_CASE("pairs: bits, priority, filterparent") {
  std::string const rest = R"(<worldbody><geom type="plane" size="1 1 1" conaffinity="2"/><geom size=".1" pos="0 0 3"/>
    <body name="p"><joint/><geom size=".1" contype="2"/><body name="q" pos="1 0 0"><geom size=".1" contype="4" conaffinity="4"/><body pos="1 0 0" name="r"><joint/><geom size=".1"/><body pos="1 0 0"><joint/><geom size=".1" conaffinity="6"/></body></body></body></body>
    <body name="s" pos="0 3 0"><freejoint/><geom size=".2" type="box" contype="7" conaffinity="7"/><geom size=".1"/></body></worldbody><contact><exclude body1="s" body2="r"/></contact></mujoco>)";
  std::string fixed = rest;
  fixed.replace(fixed.find("size=\".2\""), 9, "size=\".2 .2 .2\"");
  compare("<mujoco>" + fixed);
  compare("<mujoco><option><flag filterparent='disable'/></option>" + fixed);
}

TEST_CASE("samples written as MJCF load to the same numbers in MuJoCo, and again here") {
  for (auto const& d : {samples::pendulum(), samples::double_pendulum(), samples::arm(), samples::quadruped(), samples::quadruped_scene(),
                        samples::boxes_and_balls(), samples::stack(3), samples::ramp()}) {
    CAPTURE(d.name);
    std::string const text = io::format_mjcf(d);
    auto const theirs = oracle({{"main.xml", text}});
    compare(compile(d), theirs.get());
    compare(compile(io::parse_mjcf(text, "again.xml")), theirs.get());
  }
}

TEST_CASE("what was read is written so that MuJoCo loads the same") {
  std::string const text =
      R"(<mujoco model="a &amp; b"><compiler settotalmass="3" boundmass=".1"/><option integrator="RK4" cone="elliptic" timestep=".003"><flag limit="disable" gravity="disable"/></option>
    <worldbody><geom type="plane" size="0 0 1"/><camera name="c" pos="1 2 3" zaxis="1 2 3" fovy="70"/>
     <body name="a" pos="1 0 2" euler="10 20 30"><inertial pos="0 0 0" quat="1 2 3 4" mass="2" diaginertia="1 1.5 2"/><joint name="j" range="-30 40" springdamper=".1 1" actuatorfrcrange="-1 2"/><geom size=".1" condim="1" friction=".2" rgba="1 0 0 .5"/>
      <body name="b"><joint name="k" type="slide" ref=".1" damping="2" armature=".1" frictionloss=".3" solimplimit=".5"/><inertial pos="0 .1 0" mass="2" fullinertia="1 1.5 2 .1 .2 .3"/><site name="s" pos="1 0 0"/></body></body>
     <body name="ball" pos="0 0 5"><joint type="ball" range="0 50" name="q"/><geom type="capsule" size=".1" fromto="0 0 0 0 1 0" mass="3"/></body></worldbody>
    <contact><exclude body1="a" body2="ball"/></contact>
    <tendon><fixed name="t" range="-1 1" springlength=".1 .2" stiffness="3"><joint joint="j" coef="0"/><joint joint="k" coef="2"/></fixed></tendon>
    <actuator><motor joint="j" ctrlrange="-1 1"/><position tendon="t" kp="30" dampratio="1.5"/><velocity joint="k" kv="2" gear="3"/></actuator>
    <keyframe><key name="x" time="1" qpos="1 2 .5 .5 .5 .5" ctrl="1 2 3"/></keyframe></mujoco>)";
  auto const first = oracle({{"main.xml", text}});
  auto const d = io::parse_mjcf(text, "main.xml");
  compare(compile(d), first.get());
  auto const second = oracle({{"main.xml", io::format_mjcf(d)}});
  compare(compile(d), second.get());
}

TEST_CASE("rays see through the same geoms once they are written, by the alpha of materials too") {
  std::string geoms, sites, sensors;
  char const* const looks[] = {"material='glass'",
                               "material='glass' rgba='1 1 1 1'",
                               "material='solid' rgba='1 1 1 0'",
                               "material='half' rgba='1 0 0 0'",
                               "material='solid'",
                               "rgba='1 0 0 0'",
                               "",
                               "material='half' rgba='.5 .5 .5 1'",
                               "material='glass' rgba='.5 .5 .5 1'"};
  for (std::string const look : looks) {
    std::string const x = std::to_string(sensors.size());
    geoms += "<geom size='.1' pos='" + x + " 0 .5' " + look + "/>";
    sites += "<site name='s" + x + "' pos='" + x + " 0 2' euler='180 0 0'/>";
    sensors += "<rangefinder site='s" + x + "'/>";
  }
  Texts const texts{{"main.xml",
                     "<mujoco><asset><material name='glass' rgba='1 1 1 0'/><material name='solid' rgba='1 0 0 1'/><material name='half' "
                     "rgba='1 0 0 .5'/></asset>"
                     "<worldbody><geom type='plane' size='0 0 1'/><body>" +
                         geoms + "</body>" + sites + "</worldbody><sensor>" + sensors + "</sensor></mujoco>"}};
  compare_twice(texts);
  auto const ranges = [](Texts const& of) {
    auto const m = oracle(of);
    std::shared_ptr<mjData> const d(mj_makeData(m.get()), mj_deleteData);
    mj_forward(m.get(), d.get());
    return std::vector<double>(d->sensordata, d->sensordata + m->nsensordata);
  };
  auto const read = description(texts);
  Texts const written{{"main.xml", io::format_mjcf(read)}};
  auto const first = ranges(texts);
  CHECK(*std::min_element(first.begin(), first.end()) == -1);
  CHECK(std::abs(*std::max_element(first.begin(), first.end()) - 1.4) < 1e-12);
  CHECK(ranges(written) == first);
  auto const again = description(written);
  for (std::size_t g = 0; g < std::size(looks); ++g) {
    auto const &a = read.bodies[1].geoms[g], &b = again.bodies[1].geoms[g];
    CHECK(a.rgba == b.rgba);
    CHECK(((a.material_alpha < 0 ? a.rgba[3] : a.material_alpha) == 0) == ((b.material_alpha < 0 ? b.rgba[3] : b.material_alpha) == 0));
  }
}

TEST_CASE("the sample quadruped stands in MuJoCo") {
  auto const m = oracle({{"main.xml", io::format_mjcf(samples::quadruped_scene())}});
  std::shared_ptr<mjData> const d(mj_makeData(m.get()), mj_deleteData);
  mj_resetDataKeyframe(m.get(), d.get(), 0);
  double const start = d->qpos[2];
  double lowest = start, highest = start;
  for (int i = 0; i < 2000; ++i) {
    mj_step(m.get(), d.get());
    lowest = std::min(lowest, d->qpos[2]), highest = std::max(highest, d->qpos[2]);
  }
  // 12 kg on four knees bent by 0.8: each carries 29 N at 0.14 m, 4 N m, which the servo of 100 N m/rad gives at 0.04 rad: 12 mm lower
  CHECK(start - lowest < 0.03);
  CHECK(highest - start < 0.01);
  CHECK(d->qpos[3] > 0.999);  // upright
  double speed = 0;
  for (int i = 0; i < 18; ++i) speed = std::max(speed, std::abs(d->qvel[i]));
  CHECK(speed < 1e-2);
}
