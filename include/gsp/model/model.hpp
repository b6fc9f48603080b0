#pragma once
#include <cstdint>
#include <gsp/core/check.hpp>
#include <gsp/core/exec.hpp>
#include <gsp/math/vec3.hpp>
#include <gsp/model/archetypes.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/model/field.hpp>
#include <gsp/model/fields.hpp>
#include <string>
#include <string_view>
#include <vector>

/// The constant model on the device.
namespace gsp {

/// `mujoco`: integrator, softness and friction regularisation exactly as the file says. `stable`, the default: soft normals as the file
/// says, rigid friction, implicit joint terms inside the solve, bias forces that keep momentum and energy.
enum class Profile : int { stable, mujoco };

/// Most rows of equality constraints that are eliminated in a world (constraint/eliminate.hpp); the others are swept.
inline constexpr int most_closing_rows = 64;

namespace detail {
/// A spring, damper or servo is stiff where a step h changes its force, per force, by more than this: h (h k + b) J M^-1 J^T. Explicit
/// forces are stable below 2.
inline constexpr double stiff_share = 0.1;
}  // namespace detail

/// Topology of trees of one kind: sizes, and where its index arrays start in Model::ints. Indices are local to the tree (archetypes.hpp).
struct Archetype {
  int nbody, njnt, nq, nv, nM, nroot, ntendon, nterm, npath, nact, nstate, ntendonJ, nmoment, nfluid, ninstance;
  int body_parent, body_root, body_lone, body_jntadr, body_jntnum, body_dofadr, body_dofnum, jnt_type, jnt_body, jnt_qposadr, jnt_dofadr,
      jnt_actgravcomp, dof_body, dof_parent, dof_jnt, row_adr, row_col, body_child, body_sibling, body_dofend, part_adr, part_body,
      tendon_termadr, term_jnt;
  int tendon_kind, tendon_jadr, tendon_jdof, tendon_pathadr, path_type, path_ref, path_last, path_chain, path_side, chain;
  int act_kind, act_id, act_madr, act_mdof, act_ref1, act_last1, act_chain1, act_ref2, act_last2, act_chain2;
  int act_dyn, act_gain, act_bias, act_wrap, act_early, act_state, act_disabled, act_sole, body_fluidadr, fluid_type;
  int instance_tree, instance_body, instance_jnt, instance_dof, instance_qpos;  // (ninstance) first world index of each
  int instance_tendon, instance_term, instance_act;                             // (ninstance, n) world indices
  int instance_path, instance_side, instance_object1, instance_object2, instance_fluid;
  // what the trees of this kind have; all else costs them nothing
  bool spatial, tendon_armature, tendon_passive, tendon_clamped, gravcomp, fluid;
  bool gyroscopic;       // profile stable takes the bias forces of the middle of the step, since nothing damps some joint
  bool plain_actuators;  // each on a hinge or slide of its own, without activation
  bool adhesion;         // actuators on bodies, whose forces contacts ask for
  bool drag;             // profile stable takes what a fluid damps implicitly
  bool stiff;            // profile stable may leave springs and servos to rows (constraint/stiff_forces.hpp)
  int derivative;  // of the forces by velocity, for the integrator: 0 none, 1 the lower triangle, 2 all of it and that of the bias forces
};

/// A compiled model in the memory of a device, in precision R. Arrays are (item, component) in the order of CompiledModel; a Field is
/// shared by all worlds or has values for each (field.hpp). `make_model` fills it; copies share its arrays.
template <class R, class Mem>
struct Model {
  using real_type = R;
  using memory_space = Mem;
  int nq = 0, nv = 0, nbody = 0, njnt = 0, nu = 0, ntendon = 0, ntree = 0, narchetype = 0;
  Profile profile = Profile::stable;
  R timestep = R(0.002);
  Integrator integrator = Integrator::euler;
  int na = 0, ngeom = 0, nsite = 0, ncam = 0, nmocap = 0, neq = 0;
  bool damped = false;  // any joint damping
  bool eulerdamp = true, springs = true, dampers = true, actuation = true, clampctrl = true, constraints = true;
  int closing_rows = 0;                               // rows of those in a world, at most
  R impratio = R(1);                                  // profile mujoco: how much stiffer friction of contacts is than their normals
  bool rigid_limits = false, limits_bounce = false;   // profile stable: some limits are rigid; some of these have a restitution
  bool rigid_equalities = false;                      // and some equalities
  bool equalities = true, refsafe = true;             // equality constraints act; time constants are at least two timesteps
  bool poly_stiffness = false, poly_damping = false;  // any polynomial spring or damper, of joints or tendons
  R density = R(0), viscosity = R(0);                 // of the medium [kg/m^3, Pa s]

  // each has a row in fields.hpp
  Field<R> gravity, wind;  // (3)
  Field<R> body_pos, body_quat, body_ipos, body_iquat, body_mass,
      body_inertia;                                            // (nbody, 3 | 4 | 3 | 4 | 1 | 3); a tree's root: relative to the world
  Field<R> body_gravcomp;                                      // (nbody)
  Field<R> jnt_pos, jnt_axis, jnt_stiffness, jnt_actfrcrange;  // (njnt, 3 | 3 | 1 | 2); range +-infinity where not limited
  Field<R> jnt_stiffnesspoly, dof_dampingpoly;                 // (njnt, 2), (nv, 2): force -x (k + k1 x + k2 x^2), -v (b + b1 |v| + b2 v^2)
  Field<R> dof_armature, dof_damping;                          // (nv) with what actuators add
  Field<R> qpos0, qpos_spring;                                 // (nq)
  Field<R> term_coef;                                          // (nterm)
  Field<R> tendon_stiffness, tendon_damping, tendon_lengthspring;                          // (ntendon, 1 | 1 | 2)
  Field<R> tendon_armature, tendon_stiffnesspoly, tendon_dampingpoly, tendon_actfrcrange;  // (ntendon, 1 | 2 | 2 | 2)
  Field<R> wrap_divisor;                                                                   // (nwrap) of pulleys
  Field<R> site_pos, site_quat, geom_pos, geom_quat, geom_size;                            // (nsite | ngeom, 3 | 4 | 3)
  Field<R> geom_fluidcoef, geom_addedmass;                                                 // (ngeom, 5 | 6) of the ellipsoid fluid model
  Field<R> cam_pos, cam_quat, cam_pos0, cam_poscom0, cam_mat0;                             // (ncam, 3 | 4 | 3 | 3 | 9)
  Field<R> cam_focal, cam_resolution;                                                      // (ncam, 2) [pixel]
  Field<R> body_invweight0;                                                                // (nbody, 2) translational, rotational
  Field<R> jnt_range, jnt_margin, jnt_solref, jnt_solimp, jnt_rigid;                       // (njnt, 2 | 1 | 2 | 5 | 3) limits
  Field<R> dof_frictionloss, dof_invweight0, dof_solref, dof_solimp;                       // (nv, 1 | 1 | 2 | 5) friction loss
  Field<R> tendon_range, tendon_margin, tendon_invweight0, tendon_solref, tendon_solimp;   // (ntendon, 2 | 1 | 1 | 2 | 5) limits
  Field<R> tendon_rigid;                                                                   // (ntendon, 3)
  Field<R> tendon_frictionloss, tendon_friction_solref, tendon_friction_solimp;            // (ntendon, 1 | 2 | 5)
  Field<R> tendon_length0;                                                                 // (ntendon) in qpos0 [m]
  Field<R> eq_data, eq_solref, eq_solimp, eq_rigid;                                        // (neq, 11 | 2 | 5 | 3), equality.hpp
  Field<R> act_gear, act_gain, act_bias, act_dyn;                                          // (nu, 6 | 10 | 10 | 10)
  Field<R> act_ctrlrange, act_forcerange, act_actrange;                                    // (nu, 2) +-infinity where not limited
  Field<R> act_lengthrange, act_acc0, act_cranklength;                                     // (nu, 2 | 1 | 1)
  Field<R> dof_M0;                                                                         // (nv) diagonal of M in qpos0
  Field<R> body_slider;  // (nbody) 1: a lone body on slides, whose inverse weight is 1 / mass

  Kokkos::View<Archetype*, Mem> archetypes;
  Kokkos::View<Archetype*, Kokkos::HostSpace> host_archetypes;  // what `archetypes` holds, for those who allocate
  Kokkos::View<int*, Mem> ints;                                 // all index arrays: the archetypes' and those below
  Kokkos::View<R*, Mem> reals;                                  // all fields above, and static_pose
  template <class T>
  using Array = Kokkos::View<T const*, Mem, Kokkos::MemoryTraits<Kokkos::Unmanaged>>;
  int value_worlds = 0;               // of the fields that are per world (world_values.hpp); 0: none is
  Kokkos::View<R*, Mem> world_reals;  // what those lie in
  Kokkos::View<int*, Mem> all_items;  // 0, 1, 2 ...: friction_dofs and friction_tendons where frictionloss is per world
  bool frictionloss = true;           // dry friction is switched on
  Array<R> mocap_pos0, mocap_quat0;   // (nmocap, 3 | 4) the same as mocap_pose0
  Array<int> limited_joints, friction_dofs, limited_tendons, friction_tendons;  // world indices
  Array<int> jnt_type, jnt_body, jnt_qposadr, jnt_dofadr;                       // (njnt)
  Array<int> tendon_termadr, term_jnt;                                          // (ntendon + 1), (nterm)
  Array<int> adhesion_body, adhesion_tree, adhesion_place;                      // of actuators on bodies: where their forces lie
  Array<int> tendon_tree, tendon_place;                                         // (ntendon) its tree, -1: none; its place there
  Array<int> act_tree, act_place;                                               // (nu) the same
  Array<int> eq_type, eq_id1, eq_id2, eq_sites, eq_active0;                     // (neq) as CompiledModel has them
  Array<int> body_last_dof;                                                     // (nbody) the dof that moves it last, -1 static
  Array<int> dof_tree;                                                          // (nv)
  Array<int> body_tree;                                                         // (nbody), -1 static
  Array<int> body_root;    // (nbody) which root of its tree it hangs on; its reference point is the centre of mass of that root's bodies
  Array<int> body_parent;  // (nbody)
  Array<int> body_mocap;   // (nbody) mocap body that it is fixed to or is, -1: none
  Array<int> mocap_body;   // (nmocap)
  Array<int> geom_body, site_body, cam_body, cam_mode, cam_target;
  Array<int> act_state;                         // (nu) its activation, -1: none
  Array<int> tree_archetype, tree_instance;     // (ntree)
  Array<int> tree_body, tree_dof, tree_dofnum;  // (ntree)
  Array<int> tree_closed;                       // (ntree) 1: equality constraints inside of it are eliminated (constraint/eliminate.hpp)
  Array<R> static_pose;  // (nbody, 7) pose of bodies fixed to the world (or to a mocap body, and then in its frame): position, quaternion
  Array<R> mocap_pose0;  // (nmocap, 7) where mocap bodies begin
};

/// What gravity does to a rate in a step, |g| h [m/s]: the measure of rates that are small. Of standard gravity where there is none.
template <class R>
KOKKOS_INLINE_FUNCTION R gravity_rate(Field<R> const& gravity, int world, R timestep) {
  R const g = norm(Vec3<R>{gravity(world, 0), gravity(world, 1), gravity(world, 2)});
  return timestep * (g > R(0) ? g : R(9.81));
}

/// How `make_model` takes a model.
struct ModelOptions {
  Profile profile = Profile::stable;
  double timestep = 0;  // [s]; 0: the model's own
};

/// Takes a compiled model to the memory of `exec`, in precision R. Allocates; fences.
/// Errors: gsp::Error where the model holds what the dynamics do not cover (model_refusals.hpp), or a number that R cannot hold (float:
/// beyond 3.4e38, and masses, inertias, pulleys' divisors and focal lengths below 1.2e-38), and where an array of `m` has a wrong size;
/// std::invalid_argument for a negative timestep.
template <class R, ExecutionSpace Exec>
Model<R, typename Exec::memory_space> make_model(Exec const& exec, CompiledModel const& m, ModelOptions options = {});

namespace detail {
using AnyModel = Model<double, Kokkos::HostSpace>;  // what the table says of all of them
}
/// What a field is called, has numbers for, and may be used for.
inline ModelFieldInfo info(ModelField field) {
  auto const& row = detail::field_row<detail::AnyModel>(field);
  return {row.field, row.name, row.item, row.components, row.use};
}
/// The field of this name. Errors: gsp::Error where there is none.
inline ModelField find_field(std::string_view name) {
  for (auto const& row : detail::field_table<detail::AnyModel>())
    if (name == row.name) return row.field;
  throw Error("the model has no field '" + std::string(name) + "': gsp/model/fields.hpp lists them");
}
/// All fields, in the order of the documentation.
inline std::vector<ModelField> model_fields() {
  std::vector<ModelField> all;
  for (auto const& row : detail::field_table<detail::AnyModel>()) all.push_back(row.field);
  return all;
}

}  // namespace gsp

#include <gsp/model/detail/model_impl.hpp>
