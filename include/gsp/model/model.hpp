#pragma once
#include <cstdint>
#include <gsp/core/exec.hpp>
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
  Kokkos::View<int*, Mem> ints;                                                              // all index arrays
  Kokkos::View<R*, Mem> reals;                                                               // all fields above
  Kokkos::View<int*, Mem> limited_joints, friction_dofs, limited_tendons, friction_tendons;  // world indices
  Kokkos::View<int*, Mem> jnt_type, jnt_body, jnt_qposadr, jnt_dofadr;                       // (njnt)
  Kokkos::View<int*, Mem> tendon_termadr, term_jnt;                                          // (ntendon + 1), (nterm)
  Kokkos::View<int*, Mem> body_last_dof;                        // (nbody) the dof that moves it last, -1 static
  Kokkos::View<int*, Mem> dof_tree;                             // (nv)
  Kokkos::View<int*, Mem> body_tree;                            // (nbody), -1 static
  Kokkos::View<int*, Mem> tree_archetype, tree_instance;        // (ntree)
  Kokkos::View<int*, Mem> tree_body, tree_dof, tree_dofnum;     // (ntree)
  Kokkos::View<R*, Mem> static_pose;                            // (nbody, 7) world pose of bodies fixed to the world: position, quaternion
  Kokkos::View<Archetype*, Kokkos::HostSpace> host_archetypes;  // what `archetypes` holds, for those who allocate
};

namespace detail {
/// Appends host arrays to pools and remembers where they start.
template <class R>
struct ModelPools {
  std::vector<int> ints;
  std::vector<R> reals;
  int add(std::vector<int> const& v) {
    int const at = int(ints.size());
    ints.insert(ints.end(), v.begin(), v.end());
    return at;
  }
  template <class Get>
  std::size_t add(int n, int components, Get get) {
    std::size_t const at = reals.size();
    for (int i = 0; i < n; ++i)
      for (int c = 0; c < components; ++c) reals.push_back(R(get(i, c)));
    return at;
  }
};
template <class View, class T>
View to_device(auto const& exec, std::string const& label, std::vector<T> const& v) {
  View result(Kokkos::view_alloc(exec, Kokkos::WithoutInitializing, label), v.size());
  Kokkos::deep_copy(exec, result, Kokkos::View<T const*, Kokkos::HostSpace, Kokkos::MemoryTraits<Kokkos::Unmanaged>>(v.data(), v.size()));
  exec.fence("gsp::make_model: the host array may go now");
  return result;
}
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

/// Takes a compiled model to the memory of `exec`, in precision R. Allocates; fences.
/// Errors: gsp::Error where the model holds what the dynamics do not cover (an actuator on a ball or free joint, gravity compensation).
template <class R, ExecutionSpace Exec>
Model<R, typename Exec::memory_space> make_model(Exec const& exec, CompiledModel const& m, ModelOptions options = {}) {
  using Mem = typename Exec::memory_space;
  constexpr double infinity = std::numeric_limits<double>::infinity();
  auto const trees = find_archetypes(m);
  auto const fixed = static_poses(m);
  for (int k = 0; k < m.nu; ++k)
    if (m.act_target[k] == 0 && m.jnt_type[m.act_id[k]] < int(JointType::slide))
      throw Error("actuator '" + m.act_name[k] + "' drives a ball or free joint, which is not supported: use hinge or slide joints");
  for (int b = 0; b < m.nbody; ++b)
    if (m.body_gravcomp[b] != 0) throw Error("body '" + m.body_name[b] + "' has gravcomp, which is not supported: remove the attribute");
  for (int t = 0; t < m.ntendon; ++t)
    if (m.tendon_armature[t] != 0)
      throw Error("tendon '" + m.tendon_name[t] + "' has armature, which is not supported: give the armature to its joints");

  Model<R, Mem> d;
  d.nq = m.nq, d.nv = m.nv, d.nbody = m.nbody, d.njnt = m.njnt, d.nu = m.nu, d.ntendon = m.ntendon, d.ntree = m.ntree,
  d.narchetype = int(trees.size());
  expects(options.timestep >= 0, "gsp::make_model: timestep must be positive, or 0 for the model's own");
  d.profile = options.profile;
  d.timestep = R(options.timestep > 0 ? options.timestep : m.option.timestep);
  d.eulerdamp = m.option.eulerdamp, d.springs = m.option.passive_spring, d.dampers = m.option.passive_damper,
  d.actuation = m.option.actuation;
  d.clampctrl = m.option.clampctrl, d.constraints = m.option.constraint;

  for (double const b : m.dof_damping) d.damped |= b != 0;

  detail::ModelPools<R> pool;
  std::vector<std::pair<Field<R>*, std::size_t>> fields;
  auto const field = [&](Field<R>& f, int n, int components, auto get) { fields.emplace_back(&f, pool.add(n, components, get)); };
  // a root hangs on a static body, whose world pose is folded into the root's own
  auto const root_pose = [&](int b) {
    double const* q = &fixed[std::size_t(m.body_parent[b]) * 7];
    auto const& x = m.body_pos[b];
    auto const& r = m.body_quat[b];
    return Transform<double>{{q[0], q[1], q[2]}, {q[3], q[4], q[5], q[6]}} *
           Transform<double>{{x[0], x[1], x[2]}, {r[0], r[1], r[2], r[3]}};
  };
  auto const is_root = [&](int b) { return b > 0 && m.body_tree[b] >= 0 && m.body_tree[m.body_parent[b]] < 0; };
  field(d.gravity, 1, 3, [&](int, int c) { return m.option.gravity_on ? m.option.gravity[c] : 0.; });
  field(d.body_pos, m.nbody, 3, [&](int b, int c) { return is_root(b) ? root_pose(b).p[c] : m.body_pos[b][c]; });
  field(d.body_quat, m.nbody, 4, [&](int b, int c) {
    if (!is_root(b)) return m.body_quat[b][c];
    auto const q = root_pose(b).q;
    return c == 0 ? q.w : c == 1 ? q.x : c == 2 ? q.y : q.z;
  });
  field(d.body_ipos, m.nbody, 3, [&](int b, int c) { return m.body_ipos[b][c]; });
  field(d.body_iquat, m.nbody, 4, [&](int b, int c) { return m.body_iquat[b][c]; });
  field(d.body_mass, m.nbody, 1, [&](int b, int) { return m.body_mass[b]; });
  field(d.body_inertia, m.nbody, 3, [&](int b, int c) { return m.body_inertia[b][c]; });
  field(d.jnt_pos, m.njnt, 3, [&](int j, int c) { return m.jnt_pos[j][c]; });
  field(d.jnt_axis, m.njnt, 3, [&](int j, int c) { return m.jnt_axis[j][c]; });
  field(d.jnt_stiffness, m.njnt, 1, [&](int j, int) { return m.jnt_stiffness[j]; });
  field(d.jnt_actfrcrange, m.njnt, 2,
        [&](int j, int c) { return m.jnt_actfrclimited[j] ? m.jnt_actfrcrange[j][c] : (c ? infinity : -infinity); });
  field(d.dof_armature, m.nv, 1, [&](int i, int) { return m.dof_armature[i]; });
  field(d.dof_damping, m.nv, 1, [&](int i, int) { return m.dof_damping[i]; });
  field(d.qpos0, m.nq, 1, [&](int i, int) { return m.qpos0[i]; });
  field(d.qpos_spring, m.nq, 1, [&](int i, int) { return m.qpos_spring[i]; });
  field(d.term_coef, int(m.term_coef.size()), 1, [&](int i, int) { return m.term_coef[i]; });
  field(d.tendon_stiffness, m.ntendon, 1, [&](int i, int) { return m.tendon_stiffness[i]; });
  field(d.tendon_damping, m.ntendon, 1, [&](int i, int) { return m.tendon_damping[i]; });
  field(d.tendon_lengthspring, m.ntendon, 2, [&](int i, int c) { return m.tendon_lengthspring[i][c]; });
  field(d.body_invweight0, m.nbody, 2, [&](int i, int c) { return m.body_invweight0[i][c]; });
  field(d.jnt_range, m.njnt, 2, [&](int i, int c) { return m.jnt_range[i][c]; });
  field(d.jnt_margin, m.njnt, 1, [&](int i, int) { return m.jnt_margin[i]; });
  field(d.jnt_solref, m.njnt, 2, [&](int i, int c) { return m.jnt_solref[i][c]; });
  field(d.jnt_solimp, m.njnt, 5, [&](int i, int c) { return m.jnt_solimp[i][c]; });
  field(d.dof_frictionloss, m.nv, 1, [&](int i, int) { return m.dof_frictionloss[i]; });
  field(d.dof_invweight0, m.nv, 1, [&](int i, int) { return m.dof_invweight0[i]; });
  field(d.dof_solref, m.nv, 2, [&](int i, int c) { return m.dof_solref[i][c]; });
  field(d.dof_solimp, m.nv, 5, [&](int i, int c) { return m.dof_solimp[i][c]; });
  field(d.tendon_range, m.ntendon, 2, [&](int i, int c) { return m.tendon_range[i][c]; });
  field(d.tendon_margin, m.ntendon, 1, [&](int i, int) { return m.tendon_margin[i]; });
  field(d.tendon_invweight0, m.ntendon, 1, [&](int i, int) { return m.tendon_invweight0[i]; });
  field(d.tendon_solref, m.ntendon, 2, [&](int i, int c) { return m.tendon_solref_limit[i][c]; });
  field(d.tendon_solimp, m.ntendon, 5, [&](int i, int c) { return m.tendon_solimp_limit[i][c]; });
  field(d.tendon_frictionloss, m.ntendon, 1, [&](int i, int) { return m.tendon_frictionloss[i]; });
  field(d.tendon_friction_solref, m.ntendon, 2, [&](int i, int c) { return m.tendon_solref_friction[i][c]; });
  field(d.tendon_friction_solimp, m.ntendon, 5, [&](int i, int c) { return m.tendon_solimp_friction[i][c]; });
  field(d.act_gear, m.nu, 1, [&](int i, int) { return m.act_gear[i][0]; });
  field(d.act_gain, m.nu, 1, [&](int i, int) { return m.act_gain[i]; });
  field(d.act_bias, m.nu, 3, [&](int i, int c) { return m.act_bias[i][c]; });
  field(d.act_ctrlrange, m.nu, 2, [&](int i, int c) { return m.act_ctrllimited[i] ? m.act_ctrlrange[i][c] : (c ? infinity : -infinity); });
  field(d.act_forcerange, m.nu, 2,
        [&](int i, int c) { return m.act_forcelimited[i] ? m.act_forcerange[i][c] : (c ? infinity : -infinity); });

  std::vector<Archetype> archetypes;
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
    archetypes.push_back(a);
  }
  d.archetypes = detail::to_device<Kokkos::View<Archetype*, Mem>>(exec, "gsp::Model::archetypes", archetypes);
  d.host_archetypes = detail::to_device<Kokkos::View<Archetype*, Kokkos::HostSpace>>(Kokkos::DefaultHostExecutionSpace{},
                                                                                     "gsp::Model::host_archetypes", archetypes);
  d.ints = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Model::ints", pool.ints);
  d.reals = detail::to_device<Kokkos::View<R*, Mem>>(exec, "gsp::Model::reals", pool.reals);
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
  auto const ints = [&](auto& view, std::string const& name, std::vector<int> const& v) {
    view = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Model::" + name, v);
  };
  ints(d.limited_joints, "limited_joints", limited_joints), ints(d.friction_dofs, "friction_dofs", friction_dofs);
  ints(d.limited_tendons, "limited_tendons", limited_tendons), ints(d.friction_tendons, "friction_tendons", friction_tendons);
  ints(d.jnt_type, "jnt_type", m.jnt_type), ints(d.jnt_body, "jnt_body", m.jnt_body), ints(d.jnt_qposadr, "jnt_qposadr", m.jnt_qposadr),
      ints(d.jnt_dofadr, "jnt_dofadr", m.jnt_dofadr);
  ints(d.tendon_termadr, "tendon_termadr", termadr), ints(d.term_jnt, "term_jnt", m.term_jnt);
  ints(d.body_last_dof, "body_last_dof", last_dof), ints(d.dof_tree, "dof_tree", dof_tree);
  d.body_tree = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Model::body_tree", m.body_tree);
  d.tree_archetype = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Model::tree_archetype", tree_archetype);
  d.tree_instance = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Model::tree_instance", tree_instance);
  d.tree_body = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Model::tree_body", m.tree_bodyadr);
  d.tree_dof = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Model::tree_dof", m.tree_dofadr);
  d.tree_dofnum = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Model::tree_dofnum", m.tree_dofnum);
  d.static_pose = detail::to_device<Kokkos::View<R*, Mem>>(exec, "gsp::Model::static_pose", std::vector<R>(fixed.begin(), fixed.end()));
  for (auto const& [f, at] : fields) f->data = d.reals.data() + at;
  return d;
}

}  // namespace gsp
