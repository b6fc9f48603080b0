#pragma once
#include <algorithm>
#include <gsp/core/detail/views.hpp>
#include <gsp/model/detail/held_numbers.hpp>
#include <gsp/model/model.hpp>
#include <gsp/model/model_refusals.hpp>
#include <limits>
#include <string>
#include <utility>
#include <vector>

/// How a Model's arrays are filled from a CompiledModel: gsp/model/model.hpp, where the contract stands.
namespace gsp {

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
};

/// The sizes and options of `d`.
template <class R, class Mem>
void fill_options(Model<R, Mem>& d, FieldSource const& source, ModelOptions const& options) {
  CompiledModel const& m = source.m;
  d.nq = m.nq;
  d.nv = m.nv;
  d.nbody = m.nbody;
  d.njnt = m.njnt;
  d.nu = m.nu;
  d.ntendon = m.ntendon;
  d.na = m.na;
  d.ngeom = m.ngeom;
  d.nsite = m.nsite;
  d.ncam = m.ncam;
  d.nmocap = m.nmocap;
  d.neq = m.neq;
  expects(options.timestep >= 0, "gsp::make_model: timestep must be positive, or 0 for the model's own");
  d.profile = options.profile;
  d.timestep = R(options.timestep > 0 ? options.timestep : m.option.timestep);
  d.eulerdamp = m.option.eulerdamp;
  d.springs = m.option.passive_spring;
  d.dampers = m.option.passive_damper;
  d.actuation = m.option.actuation;
  d.clampctrl = m.option.clampctrl;
  d.constraints = m.option.constraint;
  d.equalities = m.option.constraint && m.option.equality;
  d.refsafe = m.option.refsafe;
  for (auto const* const rigid : {&m.jnt_rigid, &m.tendon_rigid})
    for (auto const& [hard, restitution, erp] : *rigid) {
      bool const counts = hard != 0 && d.profile == Profile::stable;
      d.rigid_limits = d.rigid_limits || counts;
      d.limits_bounce = d.limits_bounce || (counts && restitution > 0);
    }
  for (auto const& rigid : m.eq_rigid) d.rigid_equalities = d.rigid_equalities || (rigid[0] != 0 && d.profile == Profile::stable);
  d.impratio = R(m.option.impratio);

  d.integrator = m.option.integrator;
  d.density = R(m.option.density);
  d.viscosity = R(m.option.viscosity);

  auto const any_of = [](auto const& polynomials) {
    for (auto const& p : polynomials)
      if (p[0] != 0 || p[1] != 0) return true;
    return false;
  };
  d.poly_stiffness = any_of(m.jnt_stiffnesspoly) || any_of(m.tendon_stiffnesspoly);
  d.poly_damping = any_of(m.dof_dampingpoly) || any_of(m.tendon_dampingpoly);
  for (double const b : source.dof_damping) d.damped |= b > 0;  // as MuJoCo: where nothing damps, what drives stays explicit
  d.damped |= any_of(m.dof_dampingpoly);
}

template <class R, class Mem>
void fill_fields(ModelPools<R, Mem>& pool, Model<R, Mem> const& d, FieldSource const& source) {
  for (auto const& row : field_table<Model<R, Mem>>()) {
    auto values = row.values(source);
    int const items = count(d, row.item);
    std::size_t const size = items < 0 ? values.size() : std::size_t(items) * row.components;
    if (values.empty()) values.resize(size, 0.);  // what the model's maker has left empty
    if (values.size() != size)
      throw Error(std::string("gsp::make_model: the compiled model has ") + std::to_string(values.size()) + " numbers for " + row.name +
                  ", and " + std::to_string(items) + " items of " + std::to_string(row.components) + " are needed");
    expects_held<R>(source.m, {row.field, row.name, row.item, row.components, row.use}, values);
    pool.add(row.member, values);
  }
}

/// World indices of what is in trees.
struct TreeLists {
  std::vector<int> tree_archetype, tree_instance, tree_body, tree_dof, tree_dofnum, body_tree, body_root, dof_tree, tendon_tree,
      tendon_place, adhesion_body, adhesion_tree, adhesion_place, act_tree, act_place;
};
/// Trees that equality constraints close on themselves or hold to what stands still; how many rows those have goes to d.closing_rows.
template <class M>
std::vector<int> closed_trees(CompiledModel const& m, TreeLists const& trees, M& d) {
  std::vector<int> closed(trees.tree_dof.size(), 0);
  d.closing_rows = 0;
  for (int k = 0; k < m.neq && d.profile == Profile::stable && d.equalities; ++k) {
    auto const type = EqualityType(m.eq_type[k]);
    auto const tree_of = [&](int id) {
      if (id < 0) return -1;
      if (type == EqualityType::joint) return trees.body_tree[m.jnt_body[id]];
      if (type == EqualityType::tendon) return trees.tendon_tree[id];
      return trees.body_tree[m.eq_sites[k] ? m.site_body[id] : id];
    };
    int const one = tree_of(m.eq_id1[k]), two = tree_of(m.eq_id2[k]), tree = one < 0 ? two : one;
    int const rows = type == EqualityType::weld ? 6 : type == EqualityType::connect ? 3 : 1;
    bool const inside = tree >= 0 && (one < 0 || two < 0 || one == two);
    if (!inside || d.closing_rows + rows > most_closing_rows) continue;
    closed[tree] = 1;
    d.closing_rows += rows;
  }
  return closed;
}
/// True where joints move one another in the tree and nothing damps one of them: no damping, no servo. (Dry friction takes no more
/// the faster it is.) Explicit bias forces make energy at the rate h w^2, which nothing would take there. A question of what is zero, so
/// that worlds with values of their own get what a model with these values gets.
inline bool moves_undamped(FieldSource const& source, ArchetypeDescription const& t) {
  CompiledModel const& m = source.m;
  bool turns = false;
  for (int type : t.jnt_type) turns |= type != int(JointType::slide);
  if (t.njnt() < 2 || !turns) return false;
  bool const dampers = m.option.passive_damper, servos = m.option.actuation && !m.act_biasprm.empty();
  for (auto const& s : t.instances) {
    std::vector<bool> damped(std::size_t(t.nv()), false);
    for (int i = 0; i < t.nv(); ++i)
      damped[std::size_t(i)] = t.jnt_type[std::size_t(t.dof_jnt[std::size_t(i)])] == int(JointType::free) ||
                               (dampers && source.dof_damping[std::size_t(s.dofadr + i)] > 0);
    for (std::size_t k = 0; k < s.act.size() && servos; ++k)
      if (t.act_kind[k] == int(ActuatorKind::scalar_joint) && m.act_biasprm[std::size_t(s.act[k])][2] < 0)
        damped[std::size_t(t.jnt_dofadr[std::size_t(t.act_id[k])])] = true;
    if (std::find(damped.begin(), damped.end(), false) != damped.end()) return true;
  }
  return false;
}

/// 1 for actuators that alone act on their joint, or on their tendon: what limits the sum there limits them.
inline std::vector<int> sole_actuators(ArchetypeDescription const& t) {
  int const n = int(t.act_id.size());
  std::vector<int> acting(std::size_t(t.nv()), 0), sole(std::size_t(n), 0);
  auto const each_dof = [&](int k, auto const& f) {
    int const id = t.act_id[std::size_t(k)];
    if (t.act_kind[std::size_t(k)] == int(ActuatorKind::scalar_joint)) return f(t.jnt_dofadr[std::size_t(id)]);
    if (t.act_kind[std::size_t(k)] == int(ActuatorKind::tendon)) {
      for (int e = t.tendon_termadr[std::size_t(id)]; e < t.tendon_termadr[std::size_t(id) + 1]; ++e)
        f(t.jnt_dofadr[std::size_t(t.term_jnt[std::size_t(e)])]);
      for (int e = t.tendon_jadr[std::size_t(id)]; e < t.tendon_jadr[std::size_t(id) + 1]; ++e) f(t.tendon_jdof[std::size_t(e)]);
    } else {
      for (int e = t.act_madr[std::size_t(k)]; e < t.act_madr[std::size_t(k) + 1]; ++e) f(t.act_mdof[std::size_t(e)]);
    }
  };
  for (int k = 0; k < n; ++k) each_dof(k, [&](int dof) { ++acting[std::size_t(dof)]; });
  for (int k = 0; k < n; ++k) {
    auto const kind = ActuatorKind(t.act_kind[std::size_t(k)]);
    int const id = t.act_id[std::size_t(k)];
    if (kind == ActuatorKind::scalar_joint)
      sole[std::size_t(k)] = acting[std::size_t(t.jnt_dofadr[std::size_t(id)])] == 1 && !t.jnt_actgravcomp[std::size_t(id)];
    if (kind != ActuatorKind::tendon) continue;
    int others = 0;
    for (int o = 0; o < n; ++o) others += o != k && t.act_kind[std::size_t(o)] == int(kind) && t.act_id[std::size_t(o)] == id;
    sole[std::size_t(k)] = others == 0;
  }
  return sole;
}

/// True where a spring, damper or servo of the tree may ask for a row (constraint/stiff_forces.hpp): a servo on a joint where its force has
/// a limit and h times its slopes weigh against the inertia; any other, and any tendon's spring or damper, as it is. Decided by the
/// model's own numbers, a quarter of what asks for a row: worlds with values of their own get what a model with these values gets.
inline bool may_be_stiff(FieldSource const& source, ArchetypeDescription const& t, double h) {
  CompiledModel const& m = source.m;
  constexpr double infinity = std::numeric_limits<double>::infinity();
  auto const bends = [](auto const& poly, int i) {
    return std::size_t(i) < poly.size() && poly[std::size_t(i)] != std::array<double, 2>{};
  };
  auto const stiff = [&](double k, double b, double weight) { return (k > 0 || b > 0) && h * (h * k + b) * weight > 0.25 * stiff_share; };
  for (auto const& s : t.instances) {
    for (std::size_t k = 0; k < s.tendon.size(); ++k) {
      int const e = s.tendon[k];
      double const stiffness = m.option.passive_spring ? m.tendon_stiffness[std::size_t(e)] : 0,
                   damping = m.option.passive_damper ? source.tendon_damping[std::size_t(e)] : 0;
      bool const spatial = t.tendon_kind[k] != int(TendonKind::fixed);  // its moment arms may be larger than those in qpos0
      if (stiff(stiffness, damping, spatial ? infinity : item_or(m.tendon_invweight0, e, infinity)) || bends(m.tendon_stiffnesspoly, e) ||
          bends(m.tendon_dampingpoly, e))
        return true;
    }
    for (std::size_t k = 0; k < s.act.size() && m.option.actuation; ++k) {
      std::size_t const act = std::size_t(s.act[k]), id = std::size_t(t.act_id[k]);
      auto const kind = ActuatorKind(t.act_kind[k]);
      bool const affine_gain = t.act_gain[k] == int(ActuatorGain::affine) && (m.act_gainprm[act][1] != 0 || m.act_gainprm[act][2] != 0);
      bool const affine_bias = t.act_bias[k] == int(ActuatorBias::affine);
      double const stiffness = affine_bias ? -m.act_biasprm[act][1] : 0, damping = affine_bias ? -m.act_biasprm[act][2] : 0;
      if (kind == ActuatorKind::contacts || (!affine_gain && stiffness <= 0 && damping <= 0)) continue;
      if (kind != ActuatorKind::scalar_joint || affine_gain) return true;
      bool const limited = item_or(m.act_forcelimited, int(act), 0) || item_or(m.jnt_actfrclimited, s.jntadr + int(id), 0);
      double const gear = m.act_gear[act][0], weight = item_or(m.dof_invweight0, s.dofadr + t.jnt_dofadr[id], infinity);
      if (limited && stiff(std::max(stiffness, 0.), std::max(damping, 0.), gear * gear * weight)) return true;
    }
  }
  return false;
}

template <class R, class Mem>
TreeLists fill_archetypes(ModelPools<R, Mem>& pool, Model<R, Mem>& d, FieldSource const& source, double timestep) {
  CompiledModel const& m = source.m;
  auto const trees = find_archetypes(m);
  d.narchetype = int(trees.size());
  for (auto const& t : trees) d.ntree += int(t.instances.size());
  std::vector<int> const of_trees(d.ntree);
  TreeLists lists{of_trees,
                  of_trees,
                  of_trees,
                  of_trees,
                  of_trees,
                  std::vector<int>(m.nbody, -1),
                  std::vector<int>(m.nbody, 0),
                  std::vector<int>(m.nv),
                  std::vector<int>(m.ntendon, -1),
                  std::vector<int>(m.ntendon, -1),
                  {},
                  {},
                  {},
                  std::vector<int>(m.nu, -1),
                  std::vector<int>(m.nu, -1)};
  bool const gravity = m.option.gravity_on && (m.option.gravity != Double3{}), passive = d.springs || d.dampers;
  for (int k = 0; k < int(trees.size()); ++k) {
    auto const& t = trees[k];
    Archetype a{};
    a.nbody = t.nbody();
    a.njnt = t.njnt();
    a.nq = t.nq;
    a.nv = t.nv();
    a.nM = int(t.row_col.size());
    a.nterm = int(t.term_jnt.size());
    a.ntendon = int(t.tendon_kind.size());
    a.nact = int(t.act_id.size());
    a.ninstance = int(t.instances.size());
    a.nroot = t.nroot;
    a.npath = int(t.path_type.size());
    a.nstate = t.nstate;
    a.ntendonJ = int(t.tendon_jdof.size());
    a.nmoment = int(t.act_mdof.size());
    a.nfluid = int(t.fluid_type.size());
    auto const add = [&](auto... parts) { ((a.*parts.first = pool.add(t.*parts.second)), ...); };
    using A = Archetype;
    using D = ArchetypeDescription;
    auto const p = [](int A::*to, std::vector<int> D::*from) { return std::pair(to, from); };
    add(p(&A::body_parent, &D::body_parent), p(&A::body_root, &D::body_root), p(&A::body_lone, &D::body_lone),
        p(&A::body_jntadr, &D::body_jntadr), p(&A::body_jntnum, &D::body_jntnum), p(&A::body_dofadr, &D::body_dofadr),
        p(&A::body_dofnum, &D::body_dofnum), p(&A::jnt_type, &D::jnt_type), p(&A::jnt_body, &D::jnt_body),
        p(&A::jnt_qposadr, &D::jnt_qposadr), p(&A::jnt_dofadr, &D::jnt_dofadr), p(&A::jnt_actgravcomp, &D::jnt_actgravcomp),
        p(&A::dof_body, &D::dof_body), p(&A::dof_parent, &D::dof_parent), p(&A::dof_jnt, &D::dof_jnt), p(&A::row_adr, &D::row_adr),
        p(&A::row_col, &D::row_col), p(&A::body_child, &D::body_child), p(&A::body_sibling, &D::body_sibling),
        p(&A::body_dofend, &D::body_dofend), p(&A::part_adr, &D::part_adr), p(&A::part_body, &D::part_body),
        p(&A::tendon_termadr, &D::tendon_termadr), p(&A::term_jnt, &D::term_jnt), p(&A::tendon_kind, &D::tendon_kind),
        p(&A::tendon_jadr, &D::tendon_jadr), p(&A::tendon_jdof, &D::tendon_jdof), p(&A::tendon_pathadr, &D::tendon_pathadr),
        p(&A::path_type, &D::path_type), p(&A::path_ref, &D::path_ref), p(&A::path_last, &D::path_last), p(&A::path_chain, &D::path_chain),
        p(&A::path_side, &D::path_side), p(&A::chain, &D::chain), p(&A::act_kind, &D::act_kind), p(&A::act_id, &D::act_id),
        p(&A::act_madr, &D::act_madr), p(&A::act_mdof, &D::act_mdof), p(&A::act_ref1, &D::act_ref1), p(&A::act_last1, &D::act_last1),
        p(&A::act_chain1, &D::act_chain1), p(&A::act_ref2, &D::act_ref2), p(&A::act_last2, &D::act_last2),
        p(&A::act_chain2, &D::act_chain2), p(&A::act_dyn, &D::act_dyn), p(&A::act_gain, &D::act_gain), p(&A::act_bias, &D::act_bias),
        p(&A::act_wrap, &D::act_wrap), p(&A::act_early, &D::act_early), p(&A::act_state, &D::act_state),
        p(&A::act_disabled, &D::act_disabled), p(&A::body_fluidadr, &D::body_fluidadr), p(&A::fluid_type, &D::fluid_type));
    std::vector<int> tree, body, jnt, dof, qpos, tendon, term, act, path, side, object1, object2, fluid;
    auto const append = [](std::vector<int>& to, std::vector<int> const& from) { to.insert(to.end(), from.begin(), from.end()); };
    for (int kind : t.tendon_kind) a.spatial |= kind != int(TendonKind::fixed);
    a.fluid = passive && (m.option.density != 0 || m.option.viscosity != 0);
    for (int i = 0; i < a.ninstance; ++i) {
      auto const& s = t.instances[i];
      tree.push_back(s.tree);
      body.push_back(s.bodyadr);
      jnt.push_back(s.jntadr);
      dof.push_back(s.dofadr);
      qpos.push_back(s.qposadr);
      append(tendon, s.tendon);
      append(term, s.term);
      append(act, s.act);
      append(path, s.path);
      append(side, s.side);
      append(object1, s.act_object1);
      append(object2, s.act_object2);
      append(fluid, s.fluid_geom);
      lists.tree_archetype[s.tree] = k;
      lists.tree_instance[s.tree] = i;
      lists.tree_body[s.tree] = s.bodyadr;
      lists.tree_dof[s.tree] = s.dofadr;
      lists.tree_dofnum[s.tree] = a.nv;
      for (int b = 0; b < a.nbody; ++b)
        if (t.body_parent[b] != parent_of::none) {
          lists.body_tree[s.bodyadr + b] = s.tree;
          lists.body_root[s.bodyadr + b] = t.body_root[b];
          a.gravcomp |= passive && gravity && item_or(m.body_gravcomp, s.bodyadr + b, 0.) != 0;
        }
      for (int j = 0; j < a.nv; ++j) lists.dof_tree[s.dofadr + j] = s.tree;
      for (int e = 0; e < a.ntendon; ++e) {
        lists.tendon_tree[s.tendon[e]] = s.tree;
        lists.tendon_place[s.tendon[e]] = e;
      }
      for (int e = 0; e < a.nact; ++e) {
        lists.act_tree[s.act[e]] = s.tree;
        lists.act_place[s.act[e]] = e;
        if (t.act_kind[e] != int(ActuatorKind::contacts)) continue;
        a.adhesion = true;
        lists.adhesion_body.push_back(m.act_id[s.act[e]]);
        lists.adhesion_tree.push_back(s.tree);
        lists.adhesion_place.push_back(e);
      }
      for (int e : s.tendon) {
        a.tendon_armature |= source.tendon_armature[e] != 0;
        a.tendon_clamped |= item_or(m.tendon_actfrclimited, e, 0) != 0;
        a.tendon_passive |= m.tendon_stiffness[e] != 0 || source.tendon_damping[e] != 0 || d.poly_stiffness || d.poly_damping;
      }
    }
    a.plain_actuators = t.nstate == 0;
    for (int k = 0; k < a.nact; ++k)
      a.plain_actuators &= t.act_kind[k] == int(ActuatorKind::scalar_joint) && t.act_gain[k] != int(ActuatorGain::muscle) &&
                           t.act_bias[k] != int(ActuatorBias::muscle) && std::count(t.act_id.begin(), t.act_id.end(), t.act_id[k]) == 1;
    a.gyroscopic = d.profile == Profile::stable && moves_undamped(source, t);
    a.drag = d.profile == Profile::stable && a.fluid;
    a.stiff = d.profile == Profile::stable && may_be_stiff(source, t, timestep);
    a.act_sole = pool.add(sole_actuators(t));
    bool const free_body = std::find(t.body_lone.begin(), t.body_lone.end(), 1) != t.body_lone.end();
    if (d.profile == Profile::mujoco && m.option.integrator == Integrator::implicit) a.derivative = 2;
    if (d.profile == Profile::mujoco && m.option.integrator == Integrator::implicitfast) a.derivative = free_body ? 2 : 1;
    a.instance_tree = pool.add(tree);
    a.instance_body = pool.add(body);
    a.instance_jnt = pool.add(jnt);
    a.instance_dof = pool.add(dof);
    a.instance_qpos = pool.add(qpos);
    a.instance_tendon = pool.add(tendon);
    a.instance_term = pool.add(term);
    a.instance_act = pool.add(act);
    a.instance_path = pool.add(path);
    a.instance_side = pool.add(side);
    a.instance_object1 = pool.add(object1);
    a.instance_object2 = pool.add(object2);
    a.instance_fluid = pool.add(fluid);
    pool.archetypes.push_back(a);
  }
  return lists;
}

/// Index arrays in world indices, and poses that are given.
template <class R, class Mem>
void fill_lists(ModelPools<R, Mem>& pool, Model<R, Mem>& d, FieldSource const& source, TreeLists const& trees) {
  using M = Model<R, Mem>;
  CompiledModel const& m = source.m;
  auto const filled = [](std::vector<int> const& values, int n, int otherwise) {
    return int(values.size()) == n ? values : std::vector<int>(n, otherwise);
  };
  bool const limit = m.option.limit && m.option.constraint, frictionloss = m.option.frictionloss && m.option.constraint;
  d.frictionloss = frictionloss;
  std::vector<int> limited_joints, friction_dofs, limited_tendons, friction_tendons, termadr(m.tendon_termadr), last_dof(m.nbody, -1);
  for (int j = 0; j < m.njnt && limit; ++j)
    if (m.jnt_limited[j]) limited_joints.push_back(j);
  for (int i = 0; i < m.nv; ++i) {
    if (frictionloss && m.dof_frictionloss[i] > 0) friction_dofs.push_back(i);
  }
  for (int t = 0; t < m.ntendon; ++t) {
    if (limit && m.tendon_limited[t]) limited_tendons.push_back(t);
    if (frictionloss && m.tendon_frictionloss[t] > 0) friction_tendons.push_back(t);
  }
  termadr.push_back(int(m.term_jnt.size()));
  for (int b = 1; b < m.nbody; ++b)
    last_dof[b] = m.body_dofnum[b] > 0 ? m.body_dofadr[b] + m.body_dofnum[b] - 1 : last_dof[m.body_parent[b]];
  pool.add(&M::limited_joints, limited_joints);
  pool.add(&M::friction_dofs, friction_dofs);
  pool.add(&M::limited_tendons, limited_tendons);
  pool.add(&M::friction_tendons, friction_tendons);
  pool.add(&M::jnt_type, m.jnt_type);
  pool.add(&M::jnt_body, m.jnt_body);
  pool.add(&M::jnt_qposadr, m.jnt_qposadr);
  pool.add(&M::jnt_dofadr, m.jnt_dofadr);
  pool.add(&M::tendon_termadr, termadr);
  pool.add(&M::term_jnt, m.term_jnt);
  pool.add(&M::tendon_tree, trees.tendon_tree);
  pool.add(&M::tendon_place, trees.tendon_place);
  pool.add(&M::adhesion_body, trees.adhesion_body);
  pool.add(&M::adhesion_tree, trees.adhesion_tree);
  pool.add(&M::adhesion_place, trees.adhesion_place);
  pool.add(&M::act_tree, trees.act_tree);
  pool.add(&M::act_place, trees.act_place);
  pool.add(&M::eq_type, m.eq_type);
  pool.add(&M::eq_id1, m.eq_id1);
  pool.add(&M::eq_id2, m.eq_id2);
  pool.add(&M::eq_sites, m.eq_sites);
  pool.add(&M::eq_active0, m.eq_active);
  pool.add(&M::body_last_dof, last_dof);
  pool.add(&M::dof_tree, trees.dof_tree);
  pool.add(&M::body_tree, trees.body_tree);
  auto const mocap_root = mocap_roots(m);
  std::vector<int> mocap_body(m.nmocap, 0);
  std::vector<R> mocap_pose;
  for (int b = 0; b < m.nbody && m.nmocap > 0; ++b)
    if (item_or(m.body_mocap, b, -1) >= 0) mocap_body[m.body_mocap[b]] = b;
  for (int b : mocap_body) {
    for (double x : m.body_pos[b]) mocap_pose.push_back(R(x));
    for (double x : m.body_quat[b]) mocap_pose.push_back(R(x));
  }
  pool.add(&M::body_root, trees.body_root);
  pool.add(&M::body_parent, m.body_parent);
  pool.add(&M::body_mocap, mocap_root);
  pool.add(&M::mocap_body, mocap_body);
  pool.add(&M::geom_body, m.geom_body);
  pool.add(&M::site_body, m.site_body);
  pool.add(&M::cam_body, m.cam_body);
  pool.add(&M::cam_mode, filled(m.cam_mode, m.ncam, 0));
  pool.add(&M::cam_target, filled(m.cam_target, m.ncam, -1));
  pool.add(&M::act_state, filled(m.act_actadr, m.nu, -1));
  pool.add(&M::tree_archetype, trees.tree_archetype);
  pool.add(&M::tree_instance, trees.tree_instance);
  pool.add(&M::tree_body, trees.tree_body);
  pool.add(&M::tree_dof, trees.tree_dof);
  pool.add(&M::tree_dofnum, trees.tree_dofnum);
  pool.add(&M::tree_closed, closed_trees(m, trees, d));
  pool.real_parts.push_back({&M::static_pose, pool.reals.size(), source.fixed.size()});
  pool.reals.insert(pool.reals.end(), source.fixed.begin(), source.fixed.end());
  pool.real_parts.push_back({&M::mocap_pose0, pool.reals.size(), mocap_pose.size()});
  pool.reals.insert(pool.reals.end(), mocap_pose.begin(), mocap_pose.end());
  for (int part = 0; part < 2; ++part) {
    int const from = part == 0 ? 0 : 3, n = part == 0 ? 3 : 4;
    pool.real_parts.push_back({part == 0 ? &M::mocap_pos0 : &M::mocap_quat0, pool.reals.size(), std::size_t(n * m.nmocap)});
    for (int k = 0; k < m.nmocap; ++k)
      for (int c = 0; c < n; ++c) pool.reals.push_back(mocap_pose[7 * k + from + c]);
  }
}

/// The sizes and options of `d`; its arrays are returned.
template <class R, class Mem>
ModelPools<R, Mem> fill_model(Model<R, Mem>& d, CompiledModel const& m, ModelOptions const& options) {
  auto const source = field_source(m);
  if (auto const refusals = model_refusals(m); !refusals.empty()) throw Error(refusals.front());
  expects_held<R>(m, options.timestep > 0 ? options.timestep : m.option.timestep);
  fill_options(d, source, options);
  ModelPools<R, Mem> pool;
  fill_fields(pool, d, source);
  auto const trees = fill_archetypes(pool, d, source, options.timestep > 0 ? options.timestep : m.option.timestep);
  fill_lists(pool, d, source, trees);
  return pool;
}

/// Both are of one model, or the sentence that says so.
template <class R, class Mem>
void expects_made_of(char const* where, Model<R, Mem> const& model, CompiledModel const& compiled) {
  expects(model.nbody == compiled.nbody && model.nq == compiled.nq && model.nv == compiled.nv && model.nu == compiled.nu,
          std::string(where) + ": the model has " + std::to_string(model.nbody) + " bodies and " + std::to_string(model.nv) +
              " degrees of freedom, the compiled model " + std::to_string(compiled.nbody) + " and " + std::to_string(compiled.nv) +
              ": give the one that the model was made from");
  expects(model.ngeom == compiled.ngeom && model.nsite == compiled.nsite && model.ncam == compiled.ncam,
          std::string(where) + ": the model has " + std::to_string(model.ngeom) + " geoms, " + std::to_string(model.nsite) + " sites and " +
              std::to_string(model.ncam) + " cameras, the compiled model " + std::to_string(compiled.ngeom) + ", " +
              std::to_string(compiled.nsite) + " and " + std::to_string(compiled.ncam) + ": give the one that the model was made from");
}
}  // namespace detail

template <class R, ExecutionSpace Exec>
Model<R, typename Exec::memory_space> make_model(Exec const& exec, CompiledModel const& m, ModelOptions options) {
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
