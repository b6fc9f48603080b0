#pragma once
#include <algorithm>
#include <gsp/core/check.hpp>
#include <gsp/model/compiled.hpp>
#include <map>
#include <vector>

/// Trees of equal topology, found automatically. Two trees are instances of one archetype when their parent arrays, joint types, tendons
/// and actuators agree index by index: then one branch-free program serves both, and only numbers differ. Host only; `make_model` uses it.
namespace gsp {

struct ArchetypeDescription {
  // local indices: bodies, joints, dofs and qpos of a tree are contiguous and counted from 0; parent -1 is the world
  std::vector<int> body_parent, body_jntadr, body_jntnum, body_dofadr, body_dofnum;
  std::vector<int> jnt_type, jnt_body, jnt_qposadr, jnt_dofadr;
  std::vector<int> dof_body, dof_parent, dof_jnt;
  std::vector<int>
      row_adr;  // (nv + 1) first entry of dof i's row in the lower triangle of M; row i = the ancestors of i from the root down, then i
  std::vector<int> row_col;                   // (nM)
  std::vector<int> tendon_termadr, term_jnt;  // (ntendon + 1), (nterm)
  std::vector<int> act_target, act_id;        // 0 joint, 1 tendon; local index
  int nq = 0;

  struct Instance {
    int tree, bodyadr, jntadr, dofadr, qposadr;
    std::vector<int> tendon, term, act;  // world indices of the tree's tendons, of their terms, and of its actuators
  };
  std::vector<Instance> instances;

  int nbody() const { return int(body_parent.size()); }
  int njnt() const { return int(jnt_type.size()); }
  int nv() const { return int(dof_body.size()); }
};

/// Groups the trees of `m`, in the order in which each topology first occurs. Cost O(size of the model).
/// Errors: a tendon or an actuator that acts on joints of two trees (gsp::Error, with its name).
inline std::vector<ArchetypeDescription> find_archetypes(CompiledModel const& m) {
  std::vector<ArchetypeDescription> result;
  std::map<std::vector<int>, int> known;
  for (int t = 0; t < m.ntree; ++t) {
    ArchetypeDescription a;
    int const b0 = m.tree_bodyadr[t], j0 = m.tree_jntadr[t], d0 = m.tree_dofadr[t], q0 = m.tree_qposadr[t];
    a.nq = m.tree_qposnum[t];
    for (int b = b0; b < b0 + m.tree_bodynum[t]; ++b) {
      int const parent = m.body_parent[b];
      a.body_parent.push_back(m.body_tree[parent] == t ? parent - b0 : -1);
      a.body_jntadr.push_back(m.body_jntnum[b] ? m.body_jntadr[b] - j0 : 0), a.body_jntnum.push_back(m.body_jntnum[b]);
      a.body_dofadr.push_back(m.body_dofnum[b] ? m.body_dofadr[b] - d0 : 0), a.body_dofnum.push_back(m.body_dofnum[b]);
    }
    for (int j = j0; j < j0 + m.tree_jntnum[t]; ++j) {
      a.jnt_type.push_back(m.jnt_type[j]), a.jnt_body.push_back(m.jnt_body[j] - b0);
      a.jnt_qposadr.push_back(m.jnt_qposadr[j] - q0), a.jnt_dofadr.push_back(m.jnt_dofadr[j] - d0);
    }
    for (int i = 0; i < m.tree_dofnum[t]; ++i) {
      a.dof_body.push_back(m.dof_body[d0 + i] - b0), a.dof_jnt.push_back(m.dof_jnt[d0 + i] - j0);
      int const parent = m.dof_parent[d0 + i] < 0 ? -1 : m.dof_parent[d0 + i] - d0;
      a.dof_parent.push_back(parent);
      a.row_adr.push_back(int(a.row_col.size()));
      if (parent >= 0)
        for (int k = a.row_adr[parent], end = a.row_adr[parent + 1]; k < end; ++k)
          a.row_col.push_back(int(a.row_col[k]));  // parent < i, so its row is complete
      a.row_col.push_back(i);
    }
    a.row_adr.push_back(int(a.row_col.size()));

    ArchetypeDescription::Instance instance{t, b0, j0, d0, q0, {}, {}, {}};
    a.tendon_termadr.push_back(0);
    auto const tree_of_joint = [&](int j) { return m.body_tree[m.jnt_body[j]]; };
    for (int k = 0; k < m.ntendon; ++k) {
      int inside = 0;
      for (int e = 0; e < m.tendon_termnum[k]; ++e) inside += tree_of_joint(m.term_jnt[m.tendon_termadr[k] + e]) == t;
      if (inside == 0) continue;
      if (inside != m.tendon_termnum[k])
        throw Error("tendon '" + m.tendon_name[k] +
                    "' couples joints of two kinematic trees, which is not supported: give each tree a tendon of its own");
      instance.tendon.push_back(k);
      for (int e = 0; e < inside; ++e) {
        instance.term.push_back(m.tendon_termadr[k] + e);
        a.term_jnt.push_back(m.term_jnt[m.tendon_termadr[k] + e] - j0);
      }
      a.tendon_termadr.push_back(int(a.term_jnt.size()));
    }
    for (int k = 0; k < m.nu; ++k) {
      if (m.act_target[k] == int(Transmission::joint) && tree_of_joint(m.act_id[k]) == t) {
        instance.act.push_back(k), a.act_target.push_back(0), a.act_id.push_back(m.act_id[k] - j0);
      } else if (m.act_target[k] == int(Transmission::tendon)) {
        auto const found = std::find(instance.tendon.begin(), instance.tendon.end(), m.act_id[k]);
        if (found != instance.tendon.end())
          instance.act.push_back(k), a.act_target.push_back(1), a.act_id.push_back(int(found - instance.tendon.begin()));
      }
    }

    std::vector<int> key{a.nq};
    for (auto const* v :
         {&a.body_parent, &a.body_jntnum, &a.jnt_type, &a.dof_parent, &a.tendon_termadr, &a.term_jnt, &a.act_target, &a.act_id}) {
      key.push_back(int(v->size()));
      key.insert(key.end(), v->begin(), v->end());
    }
    auto const [place, is_new] = known.try_emplace(key, int(result.size()));
    if (is_new) result.push_back(std::move(a));
    result[place->second].instances.push_back(std::move(instance));
  }
  return result;
}

}  // namespace gsp
