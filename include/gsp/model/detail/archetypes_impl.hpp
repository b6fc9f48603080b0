#pragma once
#include <algorithm>
#include <array>
#include <gsp/core/check.hpp>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/model/archetypes.hpp>
#include <map>
#include <vector>

namespace gsp {

namespace detail {

GSP_INLINE std::vector<int> mocap_roots(CompiledModel const& m) {
  std::vector<int> root(m.nbody, -1);
  for (int b = 1; b < m.nbody; ++b)
    if (m.body_tree[b] < 0) {
      int const own = item_or(m.body_mocap, b, -1);
      root[b] = own >= 0 ? own : root[m.body_parent[b]];
    }
  return root;
}

GSP_INLINE Couplings find_couplings(CompiledModel const& m) {
  Couplings c;
  auto const mocap_root = mocap_roots(m);
  auto const add_body = [&](std::vector<int>& list, int body) {
    if (m.body_tree[body] >= 0) list.push_back(m.body_tree[body]);
    c.on_mocap = c.on_mocap || mocap_root[body] >= 0;
  };
  for (int t = 0; t < m.ntendon; ++t) {
    std::vector<int> list;
    for (int e = 0; e < m.tendon_termnum[t]; ++e) add_body(list, m.jnt_body[m.term_jnt[m.tendon_termadr[t] + e]]);
    for (int w = 0, adr = item_or(m.tendon_wrapadr, t, 0); w < item_or(m.tendon_wrapnum, t, 0); ++w) {
      auto const type = WrapType(m.wrap_type[adr + w]);
      if (type == WrapType::site) add_body(list, m.site_body[m.wrap_id[adr + w]]);
      if (type == WrapType::sphere || type == WrapType::cylinder) {
        add_body(list, m.geom_body[m.wrap_id[adr + w]]);
        if (m.wrap_side[adr + w] >= 0) add_body(list, m.site_body[m.wrap_side[adr + w]]);
      }
    }
    c.tendon.push_back(list);
  }
  for (int k = 0; k < m.nu; ++k) {
    std::vector<int> list;
    int const id = m.act_id[k], ref = item_or(m.act_ref, k, -1);
    switch (Transmission(m.act_target[k])) {
      case Transmission::joint:
      case Transmission::joint_in_parent:
        add_body(list, m.jnt_body[id]);
        break;
      case Transmission::tendon:
        list = c.tendon[id];
        break;
      case Transmission::site:
      case Transmission::slider_crank:
        add_body(list, m.site_body[id]);
        if (ref >= 0) add_body(list, m.site_body[ref]);
        break;
      case Transmission::body:
        add_body(list, id);
        break;
    }
    c.actuator.push_back(list);
  }
  for (int k = 0; k < m.neq; ++k) {
    if (item_or(m.eq_rigid, k, Double3{})[0] == 0) continue;
    std::vector<int> list;
    auto const type = EqualityType(m.eq_type[k]);
    for (int const id : {m.eq_id1[k], m.eq_id2[k]}) {
      if (id < 0) continue;
      if (type == EqualityType::tendon)
        list.insert(list.end(), c.tendon[id].begin(), c.tendon[id].end());
      else if (int const tree = m.body_tree[type == EqualityType::joint ? m.jnt_body[id] : m.eq_sites[k] ? m.site_body[id] : id]; tree >= 0)
        list.push_back(tree);
    }
    c.rigid.push_back(list);
  }
  return c;
}

GSP_INLINE std::vector<TreeGroup> group_trees(CompiledModel const& m, Couplings const& c) {
  std::vector<int> last(m.ntree);
  for (int t = 0; t < m.ntree; ++t) last[t] = t;
  for (auto const* lists : {&c.tendon, &c.actuator})
    for (auto const& list : *lists)
      if (!list.empty()) {
        auto const [lo, hi] = std::minmax_element(list.begin(), list.end());
        last[*lo] = std::max(last[*lo], *hi);
      }
  std::vector<TreeGroup> groups;
  for (int t = 0; t < m.ntree;) {
    int end = last[t];
    for (int k = t; k <= end; ++k) end = std::max(end, last[k]);
    groups.push_back({t, end});
    t = end + 1;
  }
  for (auto const& list : c.rigid) {
    if (list.empty()) continue;
    auto const [lo, hi] = std::minmax_element(list.begin(), list.end());
    auto const group_of = [&](int tree) {
      return std::partition_point(groups.begin(), groups.end(), [&](TreeGroup const& g) { return g.last < tree; });
    };
    auto const one = group_of(*lo), two = group_of(*hi);
    if (m.tree_dofadr[two->last] + m.tree_dofnum[two->last] - m.tree_dofadr[one->first] > most_joined_dofs) continue;
    one->last = two->last;
    groups.erase(one + 1, two + 1);
  }
  if (groups.empty() && m.nu > 0) groups.push_back({0, -1});
  return groups;
}

/// One group as an archetype of its own.
struct ArchetypeBuilder {
  CompiledModel const& m;
  std::vector<int> const& mocap_root;
  TreeGroup group;
  int b0, j0, d0, q0;
  ArchetypeDescription a;
  ArchetypeDescription::Instance instance;

  ArchetypeBuilder(CompiledModel const& m_, std::vector<int> const& mocap_root_, TreeGroup group_, int index)
      : m(m_),
        mocap_root(mocap_root_),
        group(group_),
        b0(first_of(m.tree_bodyadr)),
        j0(first_of(m.tree_jntadr)),
        d0(first_of(m.tree_dofadr)),
        q0(first_of(m.tree_qposadr)),
        instance{index, b0, j0, d0, q0, {}, {}, {}, {}, {}, {}, {}, {}} {}

  bool empty() const { return group.last < group.first; }
  int first_of(std::vector<int> const& adr) const { return empty() ? 0 : adr[group.first]; }
  int end_of(std::vector<int> const& adr, std::vector<int> const& num) const { return empty() ? 0 : adr[group.last] + num[group.last]; }
  bool holds(int body) const { return m.body_tree[body] >= group.first && m.body_tree[body] <= group.last; }
  int attached(int body) const { return holds(body) ? body - b0 : mocap_root[body] >= 0 ? attachment::mocap : attachment::fixed; }
  int last_dof(int ref) const {
    while (ref >= 0 && a.body_dofnum[ref] == 0) ref = a.body_parent[ref];
    return ref < 0 ? -1 : a.body_dofadr[ref] + a.body_dofnum[ref] - 1;
  }
  std::vector<int> chain_of(int last) const {
    return last < 0 ? std::vector<int>{} : std::vector<int>(a.row_col.begin() + a.row_adr[last], a.row_col.begin() + a.row_adr[last + 1]);
  }
  /// The dofs of several chains, sorted.
  static std::vector<int> join(std::vector<std::vector<int>> const& chains) {
    std::vector<int> dofs;
    for (auto const& chain : chains) dofs.insert(dofs.end(), chain.begin(), chain.end());
    std::sort(dofs.begin(), dofs.end());
    dofs.erase(std::unique(dofs.begin(), dofs.end()), dofs.end());
    return dofs;
  }
  /// Where the places of `chain` in the sorted list `dofs` begin in a.chain.
  int places(std::vector<int> const& chain, std::vector<int> const& dofs) {
    int const at = int(a.chain.size());
    for (int dof : chain) {
      auto const found = std::lower_bound(dofs.begin(), dofs.end(), dof);
      a.chain.push_back(found != dofs.end() && *found == dof ? int(found - dofs.begin()) : -1);
    }
    return at;
  }

  void add_bodies() {
    int const end = end_of(m.tree_bodyadr, m.tree_bodynum);
    for (int t = group.first; t <= group.last; ++t) a.nq += m.tree_qposnum[t];
    for (int b = b0; b < end; ++b) {
      int const parent = m.body_parent[b];
      if (!holds(b)) {
        a.body_parent.push_back(parent_of::none);
        a.body_root.push_back(0);
      } else if (holds(parent)) {
        a.body_parent.push_back(parent - b0);
        a.body_root.push_back(a.body_root[parent - b0]);
      } else {
        a.body_parent.push_back(mocap_root[parent] >= 0 ? parent_of::mocap : parent_of::world);
        a.body_root.push_back(a.nroot++);
      }
      bool const own = holds(b);
      bool lone = own && m.body_jntnum[b] == 1 && m.jnt_type[m.body_jntadr[b]] == int(JointType::free);
      for (int below = b + 1; lone && below < m.nbody && m.body_parent[below] >= b; ++below) lone = m.body_jntnum[below] == 0;
      a.body_lone.push_back(lone);
      a.body_jntadr.push_back(own && m.body_jntnum[b] ? m.body_jntadr[b] - j0 : 0);
      a.body_jntnum.push_back(own ? m.body_jntnum[b] : 0);
      a.body_dofadr.push_back(own && m.body_dofnum[b] ? m.body_dofadr[b] - d0 : 0);
      a.body_dofnum.push_back(own ? m.body_dofnum[b] : 0);
      a.body_fluidadr.push_back(int(a.fluid_type.size()));
      for (int g = own ? m.body_geomadr[b] : 0, n = own ? m.body_geomnum[b] : 0; n > 0; ++g, --n)
        if (item_or(m.geom_fluid, g, 0)) {
          a.fluid_type.push_back(m.geom_type[g]);
          instance.fluid_geom.push_back(g);
        }
    }
    a.body_fluidadr.push_back(int(a.fluid_type.size()));
  }
  void add_joints() {
    int const end = end_of(m.tree_jntadr, m.tree_jntnum);
    for (int j = j0; j < end; ++j) {
      a.jnt_type.push_back(m.jnt_type[j]);
      a.jnt_body.push_back(m.jnt_body[j] - b0);
      a.jnt_qposadr.push_back(m.jnt_qposadr[j] - q0);
      a.jnt_dofadr.push_back(m.jnt_dofadr[j] - d0);
      a.jnt_actgravcomp.push_back(item_or(m.jnt_actgravcomp, j, 0));
    }
    int const dofs = end_of(m.tree_dofadr, m.tree_dofnum) - d0;
    for (int i = 0; i < dofs; ++i) {
      a.dof_body.push_back(m.dof_body[d0 + i] - b0);
      a.dof_jnt.push_back(m.dof_jnt[d0 + i] - j0);
      int const parent = m.dof_parent[d0 + i] < 0 ? -1 : m.dof_parent[d0 + i] - d0;
      a.dof_parent.push_back(parent);
      a.row_adr.push_back(int(a.row_col.size()));
      if (parent >= 0)
        for (int k = a.row_adr[parent], last = a.row_adr[parent + 1]; k < last; ++k)
          a.row_col.push_back(int(a.row_col[k]));  // parent < i, so its row is complete
      a.row_col.push_back(i);
    }
    a.row_adr.push_back(int(a.row_col.size()));
    a.tendon_termadr.push_back(0);
    a.tendon_jadr.push_back(0);
    a.tendon_pathadr.push_back(0);
    a.act_madr.push_back(0);
  }
  void add_tendon(int k) {
    instance.tendon.push_back(k);
    for (int e = 0; e < m.tendon_termnum[k]; ++e) {
      instance.term.push_back(m.tendon_termadr[k] + e);
      a.term_jnt.push_back(m.term_jnt[m.tendon_termadr[k] + e] - j0);
    }
    a.tendon_termadr.push_back(int(a.term_jnt.size()));
    auto kind = TendonKind::fixed;
    int const adr = item_or(m.tendon_wrapadr, k, 0), n = item_or(m.tendon_wrapnum, k, 0);
    std::vector<std::vector<int>> chains;
    for (int w = adr; w < adr + n; ++w) {
      auto const type = WrapType(m.wrap_type[w]);
      bool const geom = type == WrapType::sphere || type == WrapType::cylinder;
      kind = geom ? TendonKind::wrapped : std::max(kind, TendonKind::sites);
      int const id = type == WrapType::pulley ? 0 : m.wrap_id[w], side = geom ? m.wrap_side[w] : -1;
      int const ref = type == WrapType::pulley ? attachment::fixed : attached(geom ? m.geom_body[id] : m.site_body[id]);
      a.path_type.push_back(int(type));
      a.path_ref.push_back(ref);
      a.path_last.push_back(last_dof(ref));
      a.path_side.push_back(side < 0 ? ArchetypeDescription::no_side : attached(m.site_body[side]));
      instance.path.push_back(type == WrapType::pulley ? w : id);  // a pulley: the item itself, for its divisor
      instance.side.push_back(std::max(side, 0));
      chains.push_back(chain_of(last_dof(ref)));
    }
    auto const dofs = join(chains);
    for (auto const& chain : chains) a.path_chain.push_back(places(chain, dofs));
    a.tendon_jdof.insert(a.tendon_jdof.end(), dofs.begin(), dofs.end());
    a.tendon_jadr.push_back(int(a.tendon_jdof.size()));
    a.tendon_pathadr.push_back(int(a.path_type.size()));
    a.tendon_kind.push_back(int(kind));
  }
  void add_actuator(int k) {
    int const id = m.act_id[k], ref = item_or(m.act_ref, k, -1);
    auto const target = Transmission(m.act_target[k]);
    auto kind = ActuatorKind::scalar_joint;
    int local = 0, object1 = 0, object2 = 0, ref1 = attachment::fixed, ref2 = attachment::fixed;
    std::vector<int> dofs, chain1, chain2;
    if (target == Transmission::joint || target == Transmission::joint_in_parent) {
      auto const type = JointType(m.jnt_type[id]);
      bool const parent = target == Transmission::joint_in_parent;
      local = id - j0;
      if (type == JointType::ball) kind = parent ? ActuatorKind::ball_in_parent : ActuatorKind::ball;
      if (type == JointType::free) kind = parent ? ActuatorKind::free_in_parent : ActuatorKind::free;
      if (kind != ActuatorKind::scalar_joint)
        for (int i = 0, n = type == JointType::free ? 6 : 3; i < n; ++i) dofs.push_back(a.jnt_dofadr[local] + i);
    } else if (target == Transmission::tendon) {
      kind = ActuatorKind::tendon;
      local = int(std::find(instance.tendon.begin(), instance.tendon.end(), id) - instance.tendon.begin());
    } else if (target == Transmission::body) {
      kind = ActuatorKind::contacts;
    } else {
      object1 = id;
      object2 = std::max(ref, 0);
      ref1 = attached(m.site_body[id]);
      if (ref >= 0) ref2 = attached(m.site_body[ref]);
      kind = target == Transmission::slider_crank ? ActuatorKind::slider_crank
             : ref >= 0                           ? ActuatorKind::site_in_reference
                                                  : ActuatorKind::site;
      chain1 = chain_of(last_dof(ref1));
      chain2 = chain_of(last_dof(ref2));
      dofs = join({chain1, chain2});
      if (kind == ActuatorKind::site_in_reference) {  // what moves both moves neither in the other's frame
        std::vector<int> own;
        for (int dof : dofs)
          if (std::find(chain1.begin(), chain1.end(), dof) == chain1.end() || std::find(chain2.begin(), chain2.end(), dof) == chain2.end())
            own.push_back(dof);
        dofs = own;
      }
    }
    a.act_kind.push_back(int(kind));
    a.act_id.push_back(local);
    a.act_ref1.push_back(ref1);
    a.act_last1.push_back(last_dof(ref1));
    a.act_chain1.push_back(places(chain1, dofs));
    a.act_ref2.push_back(ref2);
    a.act_last2.push_back(last_dof(ref2));
    a.act_chain2.push_back(places(chain2, dofs));
    a.act_mdof.insert(a.act_mdof.end(), dofs.begin(), dofs.end());
    a.act_madr.push_back(int(a.act_mdof.size()));
    instance.act.push_back(k);
    instance.act_object1.push_back(object1);
    instance.act_object2.push_back(object2);

    auto const dyn = ActuatorDynamics(item_or(m.act_dyntype, k, 0));
    auto const gain = ActuatorGain(item_or(m.act_gaintype, k, 0));
    auto const bias = ActuatorBias(item_or(m.act_biastype, k, int(ActuatorBias::affine)));
    // servos of a rotation take the setpoint nearest to the angle (MuJoCo 3.11)
    bool const servo = gain == ActuatorGain::fixed && bias == ActuatorBias::affine && m.act_gainprm[k][0] == -m.act_biasprm[k][1] &&
                       (dyn == ActuatorDynamics::none || dyn == ActuatorDynamics::integrator || dyn == ActuatorDynamics::filter ||
                        dyn == ActuatorDynamics::filter_exact);
    auto const& gear = m.act_gear[k];
    int wrap = 0;
    if (servo && (kind == ActuatorKind::ball || kind == ActuatorKind::ball_in_parent)) wrap = 1;
    if (servo && kind == ActuatorKind::site_in_reference && gear[0] == 0 && gear[1] == 0 && gear[2] == 0) wrap = 2;
    a.act_dyn.push_back(int(dyn));
    a.act_gain.push_back(int(gain));
    a.act_bias.push_back(int(bias));
    a.act_wrap.push_back(wrap);
    a.act_early.push_back(item_or(m.act_actearly, k, 0));
    a.act_state.push_back(item_or(m.act_actadr, k, -1) >= 0 ? a.nstate++ : -1);
    int const own_group = item_or(m.act_group, k, 0);
    a.act_disabled.push_back(own_group >= 0 && own_group < 31 && (m.option.disabled_actuator_groups >> own_group & 1));
  }
  void add_family() {
    a.body_child.assign(a.nbody(), -1);
    a.body_sibling.assign(a.nbody(), -1);
    for (int b = 0; b < a.nbody(); ++b)
      if (int const parent = a.body_parent[b]; parent >= 0) {
        a.body_sibling[b] = a.body_child[parent];
        a.body_child[parent] = b;
      }
    a.body_dofend.assign(a.nbody(), 0);
    for (int b = a.nbody() - 1; b >= 0; --b) {
      if (a.body_dofnum[b] > 0) a.body_dofend[b] = std::max(a.body_dofend[b], a.body_dofadr[b] + a.body_dofnum[b]);
      if (int const parent = a.body_parent[b]; parent >= 0) a.body_dofend[parent] = std::max(a.body_dofend[parent], a.body_dofend[b]);
    }
  }
  /// Cuts the tree: the heaviest limb gives its root to the trunk, again and again; the cut with the shortest way (trunk, then the largest
  /// part) is taken. A body weighs 1 and its dofs.
  void add_parts() {
    int const n = a.nbody();
    std::vector<int> weight(n), part(n, 0), limbs;
    for (int b = n - 1; b >= 0; --b) {
      weight[b] += a.body_parent[b] == parent_of::none ? 0 : 1 + a.body_dofnum[b];
      if (a.body_parent[b] >= 0) weight[a.body_parent[b]] += weight[b];
    }
    auto const heavier = [&](int x, int y) { return weight[x] != weight[y] ? weight[x] > weight[y] : x < y; };
    for (int b = 0; b < n; ++b)
      if (a.body_parent[b] < 0) limbs.push_back(b);
    int shortest = -1;
    for (int trunk = 0; !limbs.empty();) {
      std::sort(limbs.begin(), limbs.end(), heavier);
      std::array<int, tree_parts> load{};
      std::vector<int> assigned(n, 0);
      for (int b : limbs) {
        int const k = int(std::min_element(load.begin(), load.end()) - load.begin());
        load[k] += weight[b];
        assigned[b] = k + 1;
      }
      int const way = trunk + *std::max_element(load.begin(), load.end());
      if (shortest < 0 || way < shortest) {
        shortest = way;
        for (int b = 0; b < n; ++b) part[b] = assigned[b] ? assigned[b] : a.body_parent[b] >= 0 ? part[a.body_parent[b]] : 0;
      }
      int const root = limbs.front();
      limbs.erase(limbs.begin());
      trunk += 1 + a.body_dofnum[root];
      for (int c = a.body_child[root]; c >= 0; c = a.body_sibling[c]) limbs.push_back(c);
    }
    a.part_adr.push_back(0);
    for (int k = 0; k <= tree_parts; ++k) {
      for (int b = 0; b < n; ++b)
        if (part[b] == k) a.part_body.push_back(b);
      a.part_adr.push_back(int(a.part_body.size()));
    }
  }
  /// Everything but numbers; equal for instances of one archetype.
  std::vector<int> key() const {
    std::vector<int> k{a.nq, a.nroot, a.nstate};
    for (auto const* v : {&a.body_parent, &a.body_jntnum, &a.jnt_type,     &a.jnt_actgravcomp, &a.dof_parent,     &a.tendon_termadr,
                          &a.term_jnt,    &a.tendon_kind, &a.tendon_jadr,  &a.tendon_jdof,     &a.tendon_pathadr, &a.path_type,
                          &a.path_ref,    &a.path_side,   &a.act_kind,     &a.act_id,          &a.act_madr,       &a.act_mdof,
                          &a.act_ref1,    &a.act_ref2,    &a.act_dyn,      &a.act_gain,        &a.act_bias,       &a.act_wrap,
                          &a.act_early,   &a.act_state,   &a.act_disabled, &a.body_fluidadr,   &a.fluid_type}) {
      k.push_back(int(v->size()));
      k.insert(k.end(), v->begin(), v->end());
    }
    return k;
  }
};
}  // namespace detail

GSP_INLINE std::vector<ArchetypeDescription> find_archetypes(CompiledModel const& m) {
  std::vector<ArchetypeDescription> result;
  std::map<std::vector<int>, int> known;
  auto const couplings = detail::find_couplings(m);
  auto const mocap_root = detail::mocap_roots(m);
  auto const groups = detail::group_trees(m, couplings);
  std::vector<std::vector<int>> tendons(groups.size()), actuators(groups.size());
  std::vector<int> group_of(m.ntree);
  for (int g = 0; g < int(groups.size()); ++g)
    for (int t = groups[g].first; t <= groups[g].last; ++t) group_of[t] = g;
  for (int k = 0; k < m.ntendon && !groups.empty(); ++k)
    tendons[couplings.tendon[k].empty() ? 0 : group_of[couplings.tendon[k][0]]].push_back(k);
  for (int k = 0; k < m.nu && !groups.empty(); ++k)
    actuators[couplings.actuator[k].empty() ? 0 : group_of[couplings.actuator[k][0]]].push_back(k);
  for (int g = 0; g < int(groups.size()); ++g) {
    detail::ArchetypeBuilder builder(m, mocap_root, groups[g], g);
    builder.add_bodies();
    builder.add_joints();
    builder.add_family();
    for (int k : tendons[g]) builder.add_tendon(k);
    for (int k : actuators[g]) builder.add_actuator(k);
    auto const [place, is_new] = known.try_emplace(builder.key(), int(result.size()));
    if (is_new) {
      builder.add_parts();
      result.push_back(std::move(builder.a));
    }
    result[place->second].instances.push_back(std::move(builder.instance));
  }
  return result;
}

}  // namespace gsp
