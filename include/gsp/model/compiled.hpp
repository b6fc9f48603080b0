#pragma once
#include <gsp/model/description.hpp>
#include <string>
#include <vector>

/// The model as flat arrays on the host, in double, in MuJoCo's order and by MuJoCo's rules. `compile` (compile.hpp) makes it from a
/// Description; `make_model` (model.hpp) takes it to the device. Body 0 is the world. A *tree* is a subtree of the world that has at least
/// one degree of freedom.
namespace gsp {

struct CompiledModel {
  std::string name;
  OptionDescription option;
  int nq = 0, nv = 0, nbody = 0, njnt = 0, ngeom = 0, nsite = 0, ncam = 0, nu = 0, ntendon = 0, ntree = 0;
  int na = 0, nmocap = 0, neq = 0, nsensor = 0, nmesh = 0, nhfield = 0;

  // bodies (nbody)
  std::vector<int> body_parent, body_weld;  // weld: the topmost body that it is rigidly fixed to
  std::vector<int> body_tree;               // tree index; -1: fixed to the world
  std::vector<int> body_jntadr, body_jntnum, body_dofadr, body_dofnum, body_geomadr, body_geomnum;
  std::vector<Double3> body_pos, body_ipos, body_inertia;  // inertia: principal moments [kg m^2]
  std::vector<Double4> body_quat, body_iquat;
  std::vector<double> body_mass, body_gravcomp;
  std::vector<std::array<double, 2>> body_invweight0;  // translational, rotational
  std::vector<int> body_mocap;                         // index among the mocap bodies, -1: none
  std::vector<int> body_sleep;                         // BodySleep, of roots of trees
  std::vector<std::string> body_name;

  // joints (njnt)
  std::vector<int> jnt_type, jnt_body, jnt_qposadr, jnt_dofadr, jnt_limited, jnt_actfrclimited;
  std::vector<Double3> jnt_pos, jnt_axis;
  std::vector<int> jnt_actgravcomp;
  std::vector<double> jnt_stiffness, jnt_margin;
  std::vector<std::array<double, 2>> jnt_stiffnesspoly;
  std::vector<std::array<double, 2>> jnt_range, jnt_actfrcrange, jnt_solref;
  std::vector<Double3> jnt_rigid;  // of limits: hard (0, 1), restitution, erp; empty: all are soft
  std::vector<std::array<double, 5>> jnt_solimp;
  std::vector<std::string> jnt_name;

  // degrees of freedom (nv)
  std::vector<int> dof_body, dof_jnt, dof_parent;  // parent dof; -1 at a tree's first
  std::vector<double> dof_armature, dof_damping, dof_frictionloss, dof_invweight0;
  std::vector<double> dof_M0;  // diagonal of M in qpos0
  std::vector<std::array<double, 2>> dof_dampingpoly;
  std::vector<std::array<double, 2>> dof_solref;
  std::vector<std::array<double, 5>> dof_solimp;

  std::vector<double> qpos0, qpos_spring;  // (nq)

  // geoms (ngeom)
  std::vector<int> geom_type, geom_body, geom_contype, geom_conaffinity, geom_condim, geom_priority, geom_group;
  std::vector<Double3> geom_size, geom_pos, geom_friction;
  std::vector<Double4> geom_quat;
  std::vector<double> geom_solmix, geom_margin, geom_gap, geom_rbound;  // rbound: radius of the bounding sphere; 0 for planes
  std::vector<std::array<double, 2>> geom_solref;
  std::vector<int> geom_hard;  // rigid contacts, with
  std::vector<double> geom_restitution, geom_erp;
  std::vector<std::array<double, 5>> geom_solimp;
  std::vector<std::array<float, 4>> geom_rgba;
  std::vector<float> geom_material_alpha;  // -1: no material
  std::vector<int> geom_parts;             // so many geoms behind it touch in its place
  std::vector<std::string> geom_name;
  std::vector<std::array<double, 6>> geom_surfacevel;  // of its surface in its own frame: linear, angular
  std::vector<double> geom_adhesion;                   // with which each contact may pull [N]
  std::vector<int> geom_data;                          // mesh or height field, -1: none
  std::vector<int> geom_fluid;                         // takes part in the ellipsoid fluid model
  std::vector<std::array<double, 5>> geom_fluidcoef;   // blunt drag, slender drag, angular drag, Kutta lift, Magnus lift

  // meshes: vertices about the centre of mass in principal axes (float, as MuJoCo rounds them); the geom's pose takes what was moved
  std::vector<std::vector<std::array<float, 3>>> mesh_vertices;
  std::vector<std::vector<std::array<int, 3>>> mesh_faces;
  std::vector<std::vector<int>> mesh_hull;                       // vertices of its convex hull
  std::vector<std::vector<std::array<int, 3>>> mesh_hull_faces;  // and its triangles, outward
  std::vector<Double3> mesh_pos;
  std::vector<Double4> mesh_quat;
  std::vector<std::string> mesh_name;
  std::vector<HeightFieldDescription> hfields;

  // Pairs of geoms that may touch: after contype/conaffinity, excludes, weld and parent filters; type of first <= type of second. Their
  // parameters are mixed from the geoms. Where there are too many to list (CompileOptions), those of planes and height fields alone:
  // `collide` searches for the others, by the same filters.
  std::vector<std::array<int, 2>> pairs;
  bool pairs_searched = false;
  std::vector<std::array<int, 2>> excluded_bodies;

  // Pairs that were named (<contact><pair>), with parameters of their own: they may touch whatever the filters say, and are not in `pairs`.
  // geom1 is the geom of the earlier body.
  struct NamedPair {
    int geom1, geom2, condim;
    std::array<double, 5> friction, solimp;        // friction: sliding, sliding, torsional [m], rolling [m], rolling [m]
    std::array<double, 2> solref, solreffriction;  // solreffriction 0 0: as solref
    double margin, gap, adhesion = 0;
    RigidDescription rigid{};
  };
  std::vector<NamedPair> named_pairs;
  /// All pairs that may touch: `pairs`, then `named_pairs`.
  int pair_count() const { return int(pairs.size() + named_pairs.size()); }
  /// The geoms of one of them, type of first <= type of second.
  std::array<int, 2> pair_geoms(int pair) const {
    if (pair < int(pairs.size())) return pairs[pair];
    NamedPair const& p = named_pairs[pair - pairs.size()];
    if (geom_type[p.geom1] <= geom_type[p.geom2]) return {p.geom1, p.geom2};
    return {p.geom2, p.geom1};
  }

  // sites (nsite), cameras (ncam)
  std::vector<int> site_body, site_type, cam_body;  // site_type: ShapeType
  std::vector<Double3> site_size;                   // [m] as a geom's
  std::vector<Double3> site_pos, cam_pos;
  std::vector<Double4> site_quat, cam_quat;
  std::vector<double> cam_fovy;                                       // [rad]
  std::vector<std::array<double, 2>> cam_resolution, cam_focal;       // [pixel] width, height; focal lengths along x and y
  std::vector<std::array<double, 2>> cam_sensor_size, cam_principal;  // [m]; size 0 0: fovy says how wide it sees
  std::vector<int> cam_mode, cam_target;                              // CameraMode; body, -1: none
  std::vector<Double3> cam_pos0, cam_poscom0;  // track modes: from the body, its subtree's centre of mass, in qpos0, world axes
  std::vector<std::array<double, 9>> cam_mat0;
  std::vector<std::string> site_name, cam_name;

  // tendons (ntendon): spatial ones have a path of wrap_* in tendon_wrapadr[t] .. + tendon_wrapnum[t] (0: a fixed tendon)
  std::vector<int> tendon_wrapadr, tendon_wrapnum;
  std::vector<int> wrap_type, wrap_id, wrap_side;  // WrapType; site or geom; sidesite of a geom, -1: none
  std::vector<double> wrap_divisor;                // of a pulley
  std::vector<int> tendon_actfrclimited;
  std::vector<std::array<double, 2>> tendon_actfrcrange, tendon_stiffnesspoly, tendon_dampingpoly;

  // fixed tendons, terms in tendon_termadr[t] .. + tendon_termnum[t]
  std::vector<int> tendon_termadr, tendon_termnum, tendon_tree, tendon_limited;
  std::vector<int> term_jnt;
  std::vector<double> term_coef;
  std::vector<double> tendon_stiffness, tendon_damping, tendon_frictionloss, tendon_armature, tendon_margin, tendon_invweight0,
      tendon_length0;
  std::vector<Double3> tendon_rigid;  // as jnt_rigid
  std::vector<std::array<double, 2>> tendon_range, tendon_lengthspring, tendon_solref_limit, tendon_solref_friction;
  std::vector<std::array<double, 5>> tendon_solimp_limit, tendon_solimp_friction;
  std::vector<std::string> tendon_name;

  // actuators (nu)
  std::vector<int> act_target, act_id, act_ref;  // Transmission; joint, tendon, site, body, crank site; refsite or slider site, -1: none
  std::vector<int> act_ctrllimited, act_forcelimited, act_actlimited, act_actearly, act_group;
  std::vector<int> act_dyntype, act_gaintype, act_biastype, act_actadr, act_actnum;  // actadr -1: no activation
  std::vector<std::array<double, 10>> act_dynprm, act_gainprm, act_biasprm;
  std::vector<double> act_cranklength, act_damping, act_armature, act_acc0, act_length0;
  std::vector<std::array<double, 2>> act_actrange, act_lengthrange;
  std::vector<std::array<double, 6>> act_gear;
  std::vector<std::array<double, 2>> act_ctrlrange, act_forcerange;
  std::vector<std::string> act_name;

  // equality constraints (neq)
  std::vector<int> eq_type, eq_id1, eq_id2, eq_sites, eq_active;  // EqualityType; bodies (or sites), joints or tendons, -1: none
  std::vector<std::array<double, 11>> eq_data;                    // as MuJoCo completes it in qpos0
  std::vector<std::array<double, 2>> eq_solref;
  std::vector<Double3> eq_rigid;  // as jnt_rigid
  std::vector<std::array<double, 5>> eq_solimp;
  std::vector<std::string> eq_name;

  // sensors (nsensor) as described, and what they name: indices among the objects of their type, -1: none
  std::vector<SensorDescription> sensors;
  std::vector<int> sensor_id, sensor_refid, sensor_dim, sensor_adr;  // dim numbers from adr on; dim -1 where it is not known here
  int nsensordata = 0;

  // trees (ntree): bodies, joints and dofs of a tree are contiguous
  std::vector<int> tree_bodyadr, tree_bodynum, tree_jntadr, tree_jntnum, tree_dofadr, tree_dofnum, tree_qposadr, tree_qposnum;

  std::vector<KeyframeDescription> keyframes;
  std::vector<ReportLine> report;
};

}  // namespace gsp
