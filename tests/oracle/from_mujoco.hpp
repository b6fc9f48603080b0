#pragma once
// A compiled model straight from MuJoCo's own: the kernels can be compared on models whatever our reader and compiler do with them.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <gsp/model/compiled.hpp>
#include <string>

namespace gsp_test {

namespace from_mujoco_detail {
template <std::size_t N, class S>
std::vector<std::array<double, N>> rows(S const* data, int n, int stride = int(N)) {
  std::vector<std::array<double, N>> result(n);
  for (int i = 0; i < n; ++i)
    for (std::size_t c = 0; c < N; ++c) result[i][c] = double(data[std::size_t(i) * stride + c]);
  return result;
}
template <class S>
std::vector<int> ints(S const* data, int n) {
  return {data, data + n};
}
inline std::vector<double> numbers(mjtNum const* data, int n) { return {data, data + n}; }
inline std::vector<std::string> names(mjModel const* m, int const* adr, int n) {
  std::vector<std::string> result;
  for (int i = 0; i < n; ++i) result.emplace_back(m->names + adr[i]);
  return result;
}
}  // namespace from_mujoco_detail

/// Why the kernels are not for this model; empty: they are.
inline std::string out_of_scope(mjModel const* m) {
  if (m->nflex) return "flex";
  if (m->nplugin) return "plug-ins";
  if (m->opt.integrator == mjINT_DISCRETE) return "integrator discrete";
  for (int i = 0; i < m->nactuator; ++i) {
    if (m->actuator_trntype[i] > mjTRN_BODY) return "orientation actuator";
    if (m->actuator_dyntype[i] > mjDYN_MUSCLE || m->actuator_gaintype[i] > mjGAIN_MUSCLE || m->actuator_biastype[i] > mjBIAS_MUSCLE)
      return "actuator laws of users, motors or controllers";
    if (m->actuator_ctrlnum[i] != 1 || m->actuator_delay[i] != 0) return "actuator with several controls, or a delay";
    if (m->actuator_dampingpoly[mjNPOLY * i] != 0) return "actuator with polynomial damping";
  }
  return {};
}

inline gsp::CompiledModel from_mujoco(mjModel const* m) {
  using namespace from_mujoco_detail;
  gsp::CompiledModel c;
  auto& o = c.option;
  auto const on = [&](int flag) { return !(m->opt.disableflags & flag); };
  o.timestep = m->opt.timestep, o.impratio = m->opt.impratio, o.tolerance = m->opt.tolerance, o.iterations = m->opt.iterations;
  o.noslip_tolerance = m->opt.noslip_tolerance, o.noslip_iterations = m->opt.noslip_iterations;
  for (int i = 0; i < 3; ++i) o.gravity[i] = m->opt.gravity[i], o.wind[i] = m->opt.wind[i], o.magnetic[i] = m->opt.magnetic[i];
  o.integrator = gsp::Integrator(m->opt.integrator), o.cone = gsp::FrictionCone(m->opt.cone);
  o.density = m->opt.density, o.viscosity = m->opt.viscosity, o.disabled_actuator_groups = m->opt.disableactuator;
  o.equality = on(mjDSBL_EQUALITY), o.eulerdamp = on(mjDSBL_EULERDAMP), o.contact = on(mjDSBL_CONTACT),
  o.constraint = on(mjDSBL_CONSTRAINT);
  o.limit = on(mjDSBL_LIMIT), o.frictionloss = on(mjDSBL_FRICTIONLOSS), o.passive_spring = on(mjDSBL_SPRING);
  o.passive_damper = on(mjDSBL_DAMPER), o.gravity_on = on(mjDSBL_GRAVITY), o.actuation = on(mjDSBL_ACTUATION);
  o.clampctrl = on(mjDSBL_CLAMPCTRL), o.refsafe = on(mjDSBL_REFSAFE), o.filterparent = on(mjDSBL_FILTERPARENT);

  int const nbody = int(m->nbody), njnt = int(m->njnt), nv = int(m->nv), ngeom = int(m->ngeom), nsite = int(m->nsite), ncam = int(m->ncam),
            nu = int(m->nactuator), nt = int(m->ntendon);
  c.nq = int(m->nq), c.nv = nv, c.nbody = nbody, c.njnt = njnt, c.ngeom = ngeom, c.nsite = nsite, c.ncam = ncam, c.nu = nu, c.ntendon = nt;
  c.ntree = int(m->ntree), c.na = int(m->na), c.nmocap = int(m->nmocap), c.neq = int(m->neq), c.nsensor = int(m->nsensor);
  c.nmesh = int(m->nmesh), c.nhfield = int(m->nhfield);

  c.body_parent = ints(m->body_parentid, nbody), c.body_weld = ints(m->body_weldid, nbody), c.body_tree = ints(m->body_treeid, nbody);
  c.body_jntadr = ints(m->body_jntadr, nbody), c.body_jntnum = ints(m->body_jntnum, nbody), c.body_dofadr = ints(m->body_dofadr, nbody);
  c.body_dofnum = ints(m->body_dofnum, nbody), c.body_geomadr = ints(m->body_geomadr, nbody), c.body_geomnum = ints(m->body_geomnum, nbody);
  c.body_pos = rows<3>(m->body_pos, nbody), c.body_ipos = rows<3>(m->body_ipos, nbody), c.body_inertia = rows<3>(m->body_inertia, nbody);
  c.body_quat = rows<4>(m->body_quat, nbody), c.body_iquat = rows<4>(m->body_iquat, nbody);
  c.body_mass = numbers(m->body_mass, nbody), c.body_gravcomp = numbers(m->body_gravcomp, nbody);
  c.body_invweight0 = rows<2>(m->body_invweight0, nbody), c.body_mocap = ints(m->body_mocapid, nbody);
  c.body_name = names(m, m->name_bodyadr, nbody);

  c.jnt_type = ints(m->jnt_type, njnt), c.jnt_body = ints(m->jnt_bodyid, njnt), c.jnt_qposadr = ints(m->jnt_qposadr, njnt);
  c.jnt_dofadr = ints(m->jnt_dofadr, njnt), c.jnt_limited = ints(m->jnt_limited, njnt),
  c.jnt_actfrclimited = ints(m->jnt_actfrclimited, njnt);
  c.jnt_pos = rows<3>(m->jnt_pos, njnt), c.jnt_axis = rows<3>(m->jnt_axis, njnt), c.jnt_actgravcomp = ints(m->jnt_actgravcomp, njnt);
  c.jnt_stiffness = numbers(m->jnt_stiffness, njnt), c.jnt_margin = numbers(m->jnt_margin, njnt);
  c.jnt_stiffnesspoly = rows<2>(m->jnt_stiffnesspoly, njnt, mjNPOLY), c.jnt_range = rows<2>(m->jnt_range, njnt);
  c.jnt_actfrcrange = rows<2>(m->jnt_actfrcrange, njnt), c.jnt_solref = rows<2>(m->jnt_solref, njnt),
  c.jnt_solimp = rows<5>(m->jnt_solimp, njnt);
  c.jnt_name = names(m, m->name_jntadr, njnt);

  c.dof_body = ints(m->dof_bodyid, nv), c.dof_jnt = ints(m->dof_jntid, nv), c.dof_parent = ints(m->dof_parentid, nv);
  c.dof_armature = numbers(m->dof_armature, nv), c.dof_damping = numbers(m->dof_damping, nv),
  c.dof_frictionloss = numbers(m->dof_frictionloss, nv);
  c.dof_invweight0 = numbers(m->dof_invweight0, nv), c.dof_M0 = numbers(m->dof_M0, nv),
  c.dof_dampingpoly = rows<2>(m->dof_dampingpoly, nv, mjNPOLY);
  c.dof_solref = rows<2>(m->dof_solref, nv), c.dof_solimp = rows<5>(m->dof_solimp, nv);
  c.qpos0 = numbers(m->qpos0, c.nq), c.qpos_spring = numbers(m->qpos_spring, c.nq);

  c.geom_type = ints(m->geom_type, ngeom), c.geom_body = ints(m->geom_bodyid, ngeom), c.geom_contype = ints(m->geom_contype, ngeom);
  c.geom_conaffinity = ints(m->geom_conaffinity, ngeom), c.geom_condim = ints(m->geom_condim, ngeom);
  c.geom_priority = ints(m->geom_priority, ngeom), c.geom_group = ints(m->geom_group, ngeom);
  c.geom_size = rows<3>(m->geom_size, ngeom), c.geom_pos = rows<3>(m->geom_pos, ngeom), c.geom_friction = rows<3>(m->geom_friction, ngeom);
  c.geom_quat = rows<4>(m->geom_quat, ngeom), c.geom_solmix = numbers(m->geom_solmix, ngeom),
  c.geom_margin = numbers(m->geom_margin, ngeom);
  for (int i = 0; i < ngeom; ++i) {  // MuJoCo poses a geom by its body or its inertia where their frames agree to 1e-6
    int const b = m->geom_bodyid[i], same = m->geom_sameframe[i];
    if (same == mjSAMEFRAME_INERTIA) std::copy_n(m->body_ipos + 3 * b, 3, c.geom_pos[i].begin());
    if (same == mjSAMEFRAME_INERTIA || same == mjSAMEFRAME_INERTIAROT) std::copy_n(m->body_iquat + 4 * b, 4, c.geom_quat[i].begin());
    if (same == mjSAMEFRAME_BODY) c.geom_pos[i] = {0, 0, 0};
    if (same == mjSAMEFRAME_BODY || same == mjSAMEFRAME_BODYROT) c.geom_quat[i] = {1, 0, 0, 0};
  }
  c.geom_gap = numbers(m->geom_gap, ngeom), c.geom_rbound = numbers(m->geom_rbound, ngeom);
  c.geom_solref = rows<2>(m->geom_solref, ngeom), c.geom_solimp = rows<5>(m->geom_solimp, ngeom);
  c.geom_rgba.resize(ngeom), c.geom_name = names(m, m->name_geomadr, ngeom), c.geom_data = ints(m->geom_dataid, ngeom);
  c.geom_surfacevel = rows<6>(m->geom_surfacevel, ngeom), c.geom_adhesion = numbers(m->geom_adhesion, ngeom);
  c.geom_fluidcoef = rows<5>(m->geom_fluid + 1, ngeom, mjNFLUID);
  for (int g = 0; g < ngeom; ++g) c.geom_fluid.push_back(m->geom_fluid[mjNFLUID * g] > 0);

  c.site_type = ints(m->site_type, nsite), c.site_size = rows<3>(m->site_size, nsite);
  c.site_body = ints(m->site_bodyid, nsite), c.site_pos = rows<3>(m->site_pos, nsite), c.site_quat = rows<4>(m->site_quat, nsite);
  c.site_name = names(m, m->name_siteadr, nsite);
  c.cam_body = ints(m->cam_bodyid, ncam), c.cam_pos = rows<3>(m->cam_pos, ncam), c.cam_quat = rows<4>(m->cam_quat, ncam);
  c.cam_fovy = numbers(m->cam_fovy, ncam);
  for (double& fovy : c.cam_fovy) fovy *= M_PI / 180;
  c.cam_mode = ints(m->cam_mode, ncam), c.cam_target = ints(m->cam_targetbodyid, ncam);
  for (int i = 0; i < ncam; ++i) {
    float const *sensor = m->cam_sensorsize + 2 * i, *intrinsic = m->cam_intrinsic + 4 * i;
    int const* resolution = m->cam_resolution + 2 * i;
    c.cam_resolution.push_back({double(resolution[0]), double(resolution[1])});
    auto& focal = c.cam_focal.emplace_back();
    for (int k = 0; k < 2; ++k)
      focal[k] = sensor[k] > 0 ? intrinsic[k] / sensor[k] * float(resolution[k]) : 0.5 / std::tan(c.cam_fovy[i] / 2) * resolution[1];
  }
  c.cam_pos0 = rows<3>(m->cam_pos0, ncam), c.cam_poscom0 = rows<3>(m->cam_poscom0, ncam), c.cam_mat0 = rows<9>(m->cam_mat0, ncam);
  c.cam_name = names(m, m->name_camadr, ncam);

  c.tendon_actfrclimited = ints(m->tendon_actfrclimited, nt), c.tendon_limited = ints(m->tendon_limited, nt);
  c.tendon_actfrcrange = rows<2>(m->tendon_actfrcrange, nt), c.tendon_stiffnesspoly = rows<2>(m->tendon_stiffnesspoly, nt, mjNPOLY);
  c.tendon_dampingpoly = rows<2>(m->tendon_dampingpoly, nt, mjNPOLY), c.tendon_stiffness = numbers(m->tendon_stiffness, nt);
  c.tendon_damping = numbers(m->tendon_damping, nt), c.tendon_frictionloss = numbers(m->tendon_frictionloss, nt);
  c.tendon_armature = numbers(m->tendon_armature, nt), c.tendon_margin = numbers(m->tendon_margin, nt);
  c.tendon_invweight0 = numbers(m->tendon_invweight0, nt), c.tendon_length0 = numbers(m->tendon_length0, nt);
  c.tendon_range = rows<2>(m->tendon_range, nt), c.tendon_lengthspring = rows<2>(m->tendon_lengthspring, nt);
  c.tendon_solref_limit = rows<2>(m->tendon_solref_lim, nt), c.tendon_solref_friction = rows<2>(m->tendon_solref_fri, nt);
  c.tendon_solimp_limit = rows<5>(m->tendon_solimp_lim, nt), c.tendon_solimp_friction = rows<5>(m->tendon_solimp_fri, nt);
  c.tendon_name = names(m, m->name_tendonadr, nt);
  for (int t = 0; t < nt; ++t) {
    int const adr = m->tendon_adr[t], n = m->tendon_num[t];
    bool const fixed = m->tendon_type[t] == mjTENDON_FIXED;
    c.tendon_tree.push_back(m->tendon_treeid[2 * t]);
    c.tendon_termadr.push_back(int(c.term_jnt.size())), c.tendon_termnum.push_back(fixed ? n : 0);
    c.tendon_wrapadr.push_back(int(c.wrap_type.size())), c.tendon_wrapnum.push_back(fixed ? 0 : n);
    for (int w = adr; w < adr + n; ++w) {
      if (fixed) {
        c.term_jnt.push_back(m->wrap_objid[w]), c.term_coef.push_back(m->wrap_prm[w]);
        continue;
      }
      int const type = m->wrap_type[w];
      bool const geom = type == mjWRAP_SPHERE || type == mjWRAP_CYLINDER;
      c.wrap_type.push_back(type), c.wrap_id.push_back(m->wrap_objid[w]);
      c.wrap_side.push_back(geom ? int(std::lround(m->wrap_prm[w])) : -1),
          c.wrap_divisor.push_back(type == mjWRAP_PULLEY ? m->wrap_prm[w] : 1);
    }
  }

  for (int k = 0; k < nu; ++k) {
    int const out = m->actuator_outadr[k], ctrl = m->actuator_ctrladr[k];
    auto const row = [&]<std::size_t N>(std::vector<std::array<double, N>>& to, mjtNum const* from) {
      auto& r = to.emplace_back();
      for (std::size_t i = 0; i < N; ++i) r[i] = from[i];
    };
    c.act_target.push_back(m->actuator_trntype[k]), c.act_id.push_back(m->actuator_trnid[2 * k]),
        c.act_ref.push_back(m->actuator_trnid[2 * k + 1]);
    c.act_ctrllimited.push_back(m->actuator_ctrllimited[ctrl]), c.act_forcelimited.push_back(m->actuator_forcelimited[k]);
    c.act_actlimited.push_back(m->actuator_actlimited[k]), c.act_actearly.push_back(m->actuator_actearly[k]);
    c.act_group.push_back(m->actuator_group[k]), c.act_dyntype.push_back(m->actuator_dyntype[k]);
    c.act_gaintype.push_back(m->actuator_gaintype[k]), c.act_biastype.push_back(m->actuator_biastype[k]);
    c.act_actadr.push_back(m->actuator_actadr[k]), c.act_actnum.push_back(m->actuator_actnum[k]);
    row(c.act_dynprm, m->actuator_dynprm + mjNDYN * k), row(c.act_gainprm, m->actuator_gainprm + mjNGAIN * k);
    row(c.act_biasprm, m->actuator_biasprm + mjNBIAS * k), c.act_cranklength.push_back(m->actuator_cranklength[k]);
    c.act_damping.push_back(m->actuator_damping[k]), c.act_armature.push_back(m->actuator_armature[k]);
    c.act_acc0.push_back(m->actuator_acc0[out]), c.act_length0.push_back(m->actuator_length0[out]);
    row(c.act_actrange, m->actuator_actrange + 2 * k), row(c.act_lengthrange, m->actuator_lengthrange + 2 * out);
    row(c.act_gear, m->actuator_gear + 6 * out), row(c.act_ctrlrange, m->actuator_ctrlrange + 2 * ctrl);
    row(c.act_forcerange, m->actuator_forcerange + 2 * k);
  }
  c.act_name = names(m, m->name_actuatoradr, nu);

  int const ntree = c.ntree;
  for (auto* v :
       {&c.tree_bodyadr, &c.tree_bodynum, &c.tree_jntadr, &c.tree_jntnum, &c.tree_dofadr, &c.tree_dofnum, &c.tree_qposadr, &c.tree_qposnum})
    v->assign(ntree, 0);
  for (int b = nbody - 1; b > 0; --b)
    if (int const t = c.body_tree[b]; t >= 0) {
      ++c.tree_bodynum[t], c.tree_bodyadr[t] = b;
      c.tree_dofnum[t] += c.body_dofnum[b], c.tree_jntnum[t] += c.body_jntnum[b];
      if (c.body_jntnum[b] > 0)
        c.tree_jntadr[t] = c.body_jntadr[b], c.tree_dofadr[t] = c.body_dofadr[b], c.tree_qposadr[t] = c.jnt_qposadr[c.body_jntadr[b]];
    }
  for (int t = 0; t < ntree; ++t) c.tree_qposnum[t] = (t + 1 < ntree ? c.tree_qposadr[t + 1] : c.nq) - c.tree_qposadr[t];
  return c;
}

}  // namespace gsp_test
