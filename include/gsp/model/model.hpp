#pragma once
#include <cstdint>
#include <gsp/core/detail/views.hpp>
#include <gsp/math/quat.hpp>
#include <gsp/model/archetypes.hpp>
#include <gsp/model/compiled.hpp>
#include <limits>
#include <utility>

/// The constant model on the device.
namespace gsp {

/// `mujoco`: integrator, softness and friction regularisation exactly as the file says. `stable`, the default: soft normals as the file
/// says, rigid friction, implicit joint terms inside the solve, momentum-conserving rotation of free bodies.
enum class Profile : int { stable, mujoco };

/// One model constant: `stride` 0 means one value for all worlds, else each world has its own row. Layout (world, item, component).
template <class R>
struct Field {
  R const* data = nullptr;
  int stride = 0;
  KOKKOS_INLINE_FUNCTION R operator()(int world, int i) const { return data[std::int64_t(world) * stride + i]; }
};

/// Topology of trees of one kind: sizes, and where its index arrays start in Model::ints. Indices are local to the tree (archetypes.hpp).
struct Archetype {
  int nbody, njnt, nq, nv, nM, ntendon, nterm, nact, ninstance;
  int body_parent, body_jntadr, body_jntnum, body_dofadr, body_dofnum, jnt_type, jnt_body, jnt_qposadr, jnt_dofadr, dof_body, dof_parent,
      dof_jnt, row_adr, row_col, tendon_termadr, term_jnt, act_target, act_id;
  int instance_tree, instance_body, instance_jnt, instance_dof, instance_qpos;  // (ninstance) first world index of each
  int instance_tendon, instance_term, instance_act;                             // (ninstance, n) world indices
};

template <class R, class Mem>
struct Model {
  using real_type = R;
  using memory_space = Mem;
  int nq = 0, nv = 0, nbody = 0, njnt = 0, nu = 0, ntendon = 0, ntree = 0, narchetype = 0;
  Profile profile = Profile::stable;
  R timestep = R(0.002);
  bool damped = false;  // any joint damping
  bool eulerdamp = true, springs = true, dampers = true, actuation = true, clampctrl = true, constraints = true;

  Field<R> gravity;  // (3)
  Field<R> body_pos, body_quat, body_ipos, body_iquat, body_mass,
      body_inertia;                                                // (nbody, 3 | 4 | 3 | 4 | 1 | 3); a tree's root: relative to the world
  Field<R> jnt_pos, jnt_axis, jnt_stiffness, jnt_actfrcrange;      // (njnt, 3 | 3 | 1 | 2); range +-infinity where not limited
  Field<R> dof_armature, dof_damping;                              // (nv)
  Field<R> qpos0, qpos_spring;                                     // (nq)
  Field<R> term_coef;                                              // (nterm)
  Field<R> tendon_stiffness, tendon_damping, tendon_lengthspring;  // (ntendon, 1 | 1 | 2)
  Field<R> body_invweight0;                                        // (nbody, 2) translational, rotational
  Field<R> jnt_range, jnt_margin, jnt_solref, jnt_solimp;          // (njnt, 2 | 1 | 2 | 5) limits
  Field<R> dof_frictionloss, dof_invweight0, dof_solref, dof_solimp;                      // (nv, 1 | 1 | 2 | 5) friction loss
  Field<R> tendon_range, tendon_margin, tendon_invweight0, tendon_solref, tendon_solimp;  // (ntendon, 2 | 1 | 1 | 2 | 5) limits
  Field<R> tendon_frictionloss, tendon_friction_solref, tendon_friction_solimp;           // (ntendon, 1 | 2 | 5)
  Field<R> act_gear, act_gain, act_bias, act_ctrlrange, act_forcerange;  // (nu, 1 | 1 | 3 | 2 | 2); ranges +-infinity where not limited

  Kokkos::View<Archetype*, Mem> archetypes;
  Kokkos::View<Archetype*, Kokkos::HostSpace> host_archetypes;  // what `archetypes` holds, for those who allocate
  Kokkos::View<int*, Mem> ints;                                 // all index arrays: the archetypes' and those below
  Kokkos::View<R*, Mem> reals;                                  // all fields above, and static_pose
  template <class T>
  using Array = Kokkos::View<T const*, Mem, Kokkos::MemoryTraits<Kokkos::Unmanaged>>;
  Array<int> limited_joints, friction_dofs, limited_tendons, friction_tendons;  // world indices
  Array<int> jnt_type, jnt_body, jnt_qposadr, jnt_dofadr;                       // (njnt)
  Array<int> tendon_termadr, term_jnt;                                          // (ntendon + 1), (nterm)
  Array<int> body_last_dof;                                                     // (nbody) the dof that moves it last, -1 static
  Array<int> dof_tree;                                                          // (nv)
  Array<int> body_tree;                                                         // (nbody), -1 static
  Array<int> tree_archetype, tree_instance;                                     // (ntree)
  Array<int> tree_body, tree_dof, tree_dofnum;                                  // (ntree)
  Array<R> static_pose;  // (nbody, 7) world pose of bodies fixed to the world: position, quaternion
};

namespace detail {
/// Host arrays one after the other, and whose they are.
template <class R, class Mem>
struct ModelPools {
  using M = Model<R, Mem>;
  template <class T>
  using ArrayOf = typename M::template Array<T> M::*;
  using FieldOf = Field<R> M::*;
  template <class T>
  struct Part {
    ArrayOf<T> member;
    std::size_t at, size;
  };
  std::vector<int> ints;
  std::vector<R> reals;
  std::vector<Archetype> archetypes;
  std::vector<Part<int>> int_parts;
  std::vector<Part<R>> real_parts;
  std::vector<std::pair<FieldOf, std::size_t>> fields;
  int add(std::vector<int> const& v) {
    int const at = int(ints.size());
    ints.insert(ints.end(), v.begin(), v.end());
    return at;
  }
  void add(ArrayOf<int> member, std::vector<int> const& v) { int_parts.push_back({member, std::size_t(add(v)), v.size()}); }
  void add(FieldOf member, std::vector<double> const& v) {
    fields.emplace_back(member, reals.size());
    reals.insert(reals.end(), v.begin(), v.end());
  }
  template <std::size_t N>
  void add(FieldOf member, std::vector<std::array<double, N>> const& v) {
    fields.emplace_back(member, reals.size());
    for (auto const& item : v) reals.insert(reals.end(), item.begin(), item.end());
  }
};
}  // namespace detail

/// World poses of the bodies that are fixed to the world (others: identity), (nbody, 7). Host, double.
inline std::vector<double> static_poses(CompiledModel const& m) {
  std::vector<double> pose(std::size_t(m.nbody) * 7, 0.);
  for (int b = 0; b < m.nbody; ++b) {
    double* p = &pose[std::size_t(b) * 7];
    p[3] = 1;
    if (b == 0 || m.body_tree[b] >= 0) continue;
    double const* q = &pose[std::size_t(m.body_parent[b]) * 7];
    Transform<double> const parent{{q[0], q[1], q[2]}, {q[3], q[4], q[5], q[6]}};
    auto const& x = m.body_pos[b];
    auto const& r = m.body_quat[b];
    auto const t = parent * Transform<double>{{x[0], x[1], x[2]}, {r[0], r[1], r[2], r[3]}};
    p[0] = t.p.x, p[1] = t.p.y, p[2] = t.p.z, p[3] = t.q.w, p[4] = t.q.x, p[5] = t.q.y, p[6] = t.q.z;
  }
  return pose;
}

struct ModelOptions {
  Profile profile = Profile::stable;
  double timestep = 0;  // [s]; 0: the model's own
};

namespace detail {
/// The sizes and options of `d`; its arrays are returned.
template <class R, class Mem>
ModelPools<R, Mem> fill_model(Model<R, Mem>& d, CompiledModel const& m, ModelOptions const& options) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  auto const trees = find_archetypes(m);
  auto const fixed = static_poses(m);
  for (int k = 0; k < m.nu; ++k)
    if (m.act_target[k] == int(Transmission::joint) && m.jnt_type[m.act_id[k]] < int(JointType::slide))
      throw Error("actuator '" + m.act_name[k] + "' drives a ball or free joint, which is not supported: use hinge or slide joints");
  for (int b = 0; b < m.nbody; ++b)
    if (m.body_gravcomp[b] != 0) throw Error("body '" + m.body_name[b] + "' has gravcomp, which is not supported: remove the attribute");
  for (int t = 0; t < m.ntendon; ++t)
    if (m.tendon_armature[t] != 0)
      throw Error("tendon '" + m.tendon_name[t] + "' has armature, which is not supported: give the armature to its joints");

  d.nq = m.nq, d.nv = m.nv, d.nbody = m.nbody, d.njnt = m.njnt, d.nu = m.nu, d.ntendon = m.ntendon, d.ntree = m.ntree,
  d.narchetype = int(trees.size());
  expects(options.timestep >= 0, "gsp::make_model: timestep must be positive, or 0 for the model's own");
  d.profile = options.profile;
  d.timestep = R(options.timestep > 0 ? options.timestep : m.option.timestep);
  d.eulerdamp = m.option.eulerdamp, d.springs = m.option.passive_spring, d.dampers = m.option.passive_damper,
  d.actuation = m.option.actuation;
  d.clampctrl = m.option.clampctrl, d.constraints = m.option.constraint;

  for (double const b : m.dof_damping) d.damped |= b != 0;

  ModelPools<R, Mem> pool;
  using M = Model<R, Mem>;
  // a root hangs on a static body, whose world pose is folded into the root's own
  auto pos = m.body_pos;
  auto quat = m.body_quat;
  for (int b = 1; b < m.nbody; ++b) {
    if (m.body_tree[b] < 0 || m.body_tree[m.body_parent[b]] >= 0) continue;
    double const* q = &fixed[std::size_t(m.body_parent[b]) * 7];
    auto const& x = m.body_pos[b];
    auto const& r = m.body_quat[b];
    auto const t =
        Transform<double>{{q[0], q[1], q[2]}, {q[3], q[4], q[5], q[6]}} * Transform<double>{{x[0], x[1], x[2]}, {r[0], r[1], r[2], r[3]}};
    pos[b] = {t.p.x, t.p.y, t.p.z}, quat[b] = {t.q.w, t.q.x, t.q.y, t.q.z};
  }
  // ranges that do not limit are infinite
  auto const ranges = [](auto const& range, auto const& limited) {
    std::vector<std::array<double, 2>> result(range.size(), {-infinity, infinity});
    for (std::size_t i = 0; i < range.size(); ++i)
      if (limited[i]) result[i] = {range[i][0], range[i][1]};
    return result;
  };
  std::vector<double> gear, gain;
  std::vector<Double3> bias;
  for (auto const& g : m.act_gear) gear.push_back(g[0]);
  for (auto const& g : m.act_gainprm) gain.push_back(g[0]);
  for (auto const& b : m.act_biasprm) bias.push_back({b[0], b[1], b[2]});
  pool.add(&M::gravity, std::vector<std::array<double, 3>>{m.option.gravity_on ? m.option.gravity : std::array<double, 3>{}});
  pool.add(&M::body_pos, pos), pool.add(&M::body_quat, quat);
  pool.add(&M::body_ipos, m.body_ipos), pool.add(&M::body_iquat, m.body_iquat), pool.add(&M::body_mass, m.body_mass);
  pool.add(&M::body_inertia, m.body_inertia);
  pool.add(&M::jnt_pos, m.jnt_pos), pool.add(&M::jnt_axis, m.jnt_axis), pool.add(&M::jnt_stiffness, m.jnt_stiffness);
  pool.add(&M::jnt_actfrcrange, ranges(m.jnt_actfrcrange, m.jnt_actfrclimited));
  pool.add(&M::dof_armature, m.dof_armature), pool.add(&M::dof_damping, m.dof_damping);
  pool.add(&M::qpos0, m.qpos0), pool.add(&M::qpos_spring, m.qpos_spring);
  pool.add(&M::term_coef, m.term_coef);
  pool.add(&M::tendon_stiffness, m.tendon_stiffness), pool.add(&M::tendon_damping, m.tendon_damping);
  pool.add(&M::tendon_lengthspring, m.tendon_lengthspring);
  pool.add(&M::body_invweight0, m.body_invweight0);
  pool.add(&M::jnt_range, m.jnt_range), pool.add(&M::jnt_margin, m.jnt_margin), pool.add(&M::jnt_solref, m.jnt_solref);
  pool.add(&M::jnt_solimp, m.jnt_solimp);
  pool.add(&M::dof_frictionloss, m.dof_frictionloss), pool.add(&M::dof_invweight0, m.dof_invweight0);
  pool.add(&M::dof_solref, m.dof_solref), pool.add(&M::dof_solimp, m.dof_solimp);
  pool.add(&M::tendon_range, m.tendon_range), pool.add(&M::tendon_margin, m.tendon_margin);
  pool.add(&M::tendon_invweight0, m.tendon_invweight0), pool.add(&M::tendon_solref, m.tendon_solref_limit);
  pool.add(&M::tendon_solimp, m.tendon_solimp_limit), pool.add(&M::tendon_frictionloss, m.tendon_frictionloss);
  pool.add(&M::tendon_friction_solref, m.tendon_solref_friction), pool.add(&M::tendon_friction_solimp, m.tendon_solimp_friction);
  pool.add(&M::act_gear, gear), pool.add(&M::act_gain, gain), pool.add(&M::act_bias, bias);
  pool.add(&M::act_ctrlrange, ranges(m.act_ctrlrange, m.act_ctrllimited));
  pool.add(&M::act_forcerange, ranges(m.act_forcerange, m.act_forcelimited));

  std::vector<int> tree_archetype(m.ntree), tree_instance(m.ntree);
  for (int k = 0; k < int(trees.size()); ++k) {
    auto const& t = trees[k];
    Archetype a{};
    a.nbody = t.nbody(), a.njnt = t.njnt(), a.nq = t.nq, a.nv = t.nv(), a.nM = int(t.row_col.size()), a.nterm = int(t.term_jnt.size());
    a.ntendon = int(t.tendon_termadr.size()) - 1, a.nact = int(t.act_id.size()), a.ninstance = int(t.instances.size());
    a.body_parent = pool.add(t.body_parent), a.body_jntadr = pool.add(t.body_jntadr), a.body_jntnum = pool.add(t.body_jntnum);
    a.body_dofadr = pool.add(t.body_dofadr), a.body_dofnum = pool.add(t.body_dofnum);
    a.jnt_type = pool.add(t.jnt_type), a.jnt_body = pool.add(t.jnt_body), a.jnt_qposadr = pool.add(t.jnt_qposadr),
    a.jnt_dofadr = pool.add(t.jnt_dofadr);
    a.dof_body = pool.add(t.dof_body), a.dof_parent = pool.add(t.dof_parent), a.dof_jnt = pool.add(t.dof_jnt),
    a.row_adr = pool.add(t.row_adr), a.row_col = pool.add(t.row_col);
    a.tendon_termadr = pool.add(t.tendon_termadr), a.term_jnt = pool.add(t.term_jnt), a.act_target = pool.add(t.act_target),
    a.act_id = pool.add(t.act_id);
    std::vector<int> tree, body, jnt, dof, qpos, tendon, term, act;
    for (int i = 0; i < a.ninstance; ++i) {
      auto const& s = t.instances[i];
      tree.push_back(s.tree), body.push_back(s.bodyadr), jnt.push_back(s.jntadr), dof.push_back(s.dofadr), qpos.push_back(s.qposadr);
      tendon.insert(tendon.end(), s.tendon.begin(), s.tendon.end()), term.insert(term.end(), s.term.begin(), s.term.end()),
          act.insert(act.end(), s.act.begin(), s.act.end());
      tree_archetype[s.tree] = k, tree_instance[s.tree] = i;
    }
    a.instance_tree = pool.add(tree), a.instance_body = pool.add(body), a.instance_jnt = pool.add(jnt), a.instance_dof = pool.add(dof),
    a.instance_qpos = pool.add(qpos);
    a.instance_tendon = pool.add(tendon), a.instance_term = pool.add(term), a.instance_act = pool.add(act);
    pool.archetypes.push_back(a);
  }
  std::vector<int> limited_joints, friction_dofs, limited_tendons, friction_tendons, termadr(m.tendon_termadr), last_dof(m.nbody, -1),
      dof_tree(m.nv);
  for (int j = 0; j < m.njnt && m.option.limit; ++j)
    if (m.jnt_limited[j]) limited_joints.push_back(j);
  for (int i = 0; i < m.nv; ++i) {
    dof_tree[i] = m.body_tree[m.dof_body[i]];
    if (m.option.frictionloss && m.dof_frictionloss[i] > 0) friction_dofs.push_back(i);
  }
  for (int t = 0; t < m.ntendon; ++t) {
    if (m.option.limit && m.tendon_limited[t]) limited_tendons.push_back(t);
    if (m.option.frictionloss && m.tendon_frictionloss[t] > 0) friction_tendons.push_back(t);
  }
  termadr.push_back(int(m.term_jnt.size()));
  for (int b = 1; b < m.nbody; ++b)
    last_dof[b] = m.body_dofnum[b] > 0 ? m.body_dofadr[b] + m.body_dofnum[b] - 1 : last_dof[m.body_parent[b]];
  pool.add(&M::limited_joints, limited_joints), pool.add(&M::friction_dofs, friction_dofs);
  pool.add(&M::limited_tendons, limited_tendons), pool.add(&M::friction_tendons, friction_tendons);
  pool.add(&M::jnt_type, m.jnt_type), pool.add(&M::jnt_body, m.jnt_body), pool.add(&M::jnt_qposadr, m.jnt_qposadr);
  pool.add(&M::jnt_dofadr, m.jnt_dofadr), pool.add(&M::tendon_termadr, termadr), pool.add(&M::term_jnt, m.term_jnt);
  pool.add(&M::body_last_dof, last_dof), pool.add(&M::dof_tree, dof_tree), pool.add(&M::body_tree, m.body_tree);
  pool.add(&M::tree_archetype, tree_archetype), pool.add(&M::tree_instance, tree_instance);
  pool.add(&M::tree_body, m.tree_bodyadr), pool.add(&M::tree_dof, m.tree_dofadr), pool.add(&M::tree_dofnum, m.tree_dofnum);
  pool.real_parts.push_back({&M::static_pose, pool.reals.size(), fixed.size()});
  pool.reals.insert(pool.reals.end(), fixed.begin(), fixed.end());
  return pool;
}
}  // namespace detail

/// Takes a compiled model to the memory of `exec`, in precision R. Allocates; fences.
/// Errors: gsp::Error where the model holds what the dynamics do not cover (an actuator on a ball or free joint, gravity compensation).
template <class R, ExecutionSpace Exec>
Model<R, typename Exec::memory_space> make_model(Exec const& exec, CompiledModel const& m, ModelOptions options = {}) {
  using Mem = typename Exec::memory_space;
  Model<R, Mem> d;
  auto const pool = detail::fill_model(d, m, options);
  d.archetypes = detail::to_device<Kokkos::View<Archetype*, Mem>>(exec, "gsp::Model::archetypes", pool.archetypes);
  d.host_archetypes = detail::to_device<Kokkos::View<Archetype*, Kokkos::HostSpace>>(Kokkos::DefaultHostExecutionSpace{},
                                                                                     "gsp::Model::host_archetypes", pool.archetypes);
  d.ints = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Model::ints", pool.ints);
  d.reals = detail::to_device<Kokkos::View<R*, Mem>>(exec, "gsp::Model::reals", pool.reals);
  for (auto const& [member, at] : pool.fields) (d.*member).data = d.reals.data() + at;
  for (auto const& p : pool.int_parts) d.*p.member = {d.ints.data() + p.at, p.size};
  for (auto const& p : pool.real_parts) d.*p.member = {d.reals.data() + p.at, p.size};
  return d;
}

}  // namespace gsp
