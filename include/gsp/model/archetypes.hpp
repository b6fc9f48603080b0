#pragma once
#include <gsp/model/compiled.hpp>
#include <vector>

/// Trees of equal topology, found automatically. Two trees are instances of one archetype when their parent arrays, joint types, tendons
/// and actuators agree index by index: then one branch-free program serves both, and only numbers differ. Trees that a tendon or an
/// actuator couples are taken as one (with all trees between them): a "tree" of the device model may have several roots, and its matrices
/// keep the sparsity of the single trees. So are trees that a rigid equality joins, up to `most_joined_dofs`: its rows are eliminated then
/// (constraint/eliminate.hpp). Host only; `make_model` uses it.
namespace gsp {

/// What moves a point that a tendon or an actuator is attached to: a body of the tree (its local index), or one of these.
namespace attachment {
inline constexpr int fixed = -1, mocap = -2;
}
/// Parents of a tree's bodies: a body of the tree, or the world; a mocap body (or a body fixed to one); or the body is no part of the tree,
/// but lies between its bodies.
namespace parent_of {
inline constexpr int world = -1, mocap = -3, none = -2;
}
/// How an actuator acts: on one dof, on a tendon, on the dofs of a ball or free joint (in the child's or the parent's frame), on sites, or
/// on contacts.
enum class ActuatorKind : int {
  scalar_joint,
  tendon,
  ball,
  ball_in_parent,
  free,
  free_in_parent,
  site,
  site_in_reference,
  slider_crank,
  contacts
};
enum class TendonKind : int { fixed, sites, wrapped };  // sites: no geom on its path

/// Degrees of freedom of what rigid equalities join to one tree: each row of it has as many entries.
inline constexpr int most_joined_dofs = 64;

/// Where several workers share a tree, it is cut into a trunk (part 0) and so many parts, each a set of subtrees that hang on the trunk (or
/// on the world): limbs of about equal size, which know nothing of each other.
inline constexpr int tree_parts = 4;

struct ArchetypeDescription {
  // lone: a free body below which no joint is. Local indices: bodies, joints, dofs and qpos of a tree are contiguous and counted from 0;
  // parents: see parent_of
  std::vector<int> body_parent, body_root, body_lone, body_jntadr, body_jntnum, body_dofadr, body_dofnum;
  std::vector<int> jnt_type, jnt_body, jnt_qposadr, jnt_dofadr, jnt_actgravcomp;
  std::vector<int> dof_body, dof_parent, dof_jnt;
  std::vector<int>
      row_adr;  // (nv + 1) first entry of dof i's row in the lower triangle of M; row i = the ancestors of i from the root down, then i
  std::vector<int> row_col;                   // (nM)
  std::vector<int> body_child, body_sibling;  // a body's last child, the sibling before it; -1: none
  std::vector<int> body_dofend;               // one past the last dof of its subtree
  std::vector<int> part_adr, part_body;       // part k: part_adr[k] .. of part_body, see tree_parts
  std::vector<int> tendon_termadr, term_jnt;  // (ntendon + 1), (nterm)
  // spatial tendons: dofs that move them, tendon_jadr[k] .. of tendon_jdof; their path, tendon_pathadr[k] .. of path_*
  std::vector<int> tendon_kind, tendon_jadr, tendon_jdof, tendon_pathadr;
  std::vector<int> path_type, path_ref, path_last, path_chain, path_side;  // side: attachment of the sidesite; no_side where there is none
  static constexpr int no_side = -9;
  // place in tendon_jdof (or act_mdof) of the dofs that move an attachment: the row of its last dof, *_chain .. of chain; -1: not counted
  std::vector<int> chain;
  std::vector<int> act_kind, act_id;    // ActuatorKind; local joint or tendon
  std::vector<int> act_madr, act_mdof;  // (nact + 1) dofs on which the others act
  std::vector<int> act_ref1, act_last1, act_chain1, act_ref2, act_last2, act_chain2;
  std::vector<int> act_dyn, act_gain, act_bias, act_wrap, act_early, act_state, act_disabled;  // state: local activation, -1: none
  std::vector<int> body_fluidadr, fluid_type;  // (nbody + 1) geoms that take part in the ellipsoid fluid model, and their types
  int nq = 0, nroot = 0, nstate = 0;

  struct Instance {
    int tree, bodyadr, jntadr, dofadr, qposadr;
    std::vector<int> tendon, term, act;  // world indices of the tree's tendons, of their terms, and of its actuators
    std::vector<int> path, side;         // of the path's sites and geoms, and of their sidesites
    std::vector<int> act_object1, act_object2, fluid_geom;
  };
  std::vector<Instance> instances;

  int nbody() const { return int(body_parent.size()); }
  int njnt() const { return int(jnt_type.size()); }
  int nv() const { return int(dof_body.size()); }
};

namespace detail {
/// v[i], or `otherwise` where the model's maker has left the field empty.
template <class V, class T>
T item_or(V const& v, int i, T otherwise) {
  return std::size_t(i) < v.size() ? T(v[i]) : otherwise;
}

/// Which static body's mocap ancestor moves it (itself included): index among the mocap bodies, -1: none. Bodies of trees: -1.
std::vector<int> mocap_roots(CompiledModel const& m);

/// Trees that each tendon, actuator and rigid equality reaches.
struct Couplings {
  std::vector<std::vector<int>> tendon, actuator, rigid;
  bool on_mocap = false;  // one of them reaches a mocap body
};
Couplings find_couplings(CompiledModel const& m);

/// Trees that are taken as one, a tree of the Model: consecutive, first .. last. A model with actuators and without trees has one of none,
/// 0 .. -1, in which their activations live.
struct TreeGroup {
  int first, last;
};
std::vector<TreeGroup> group_trees(CompiledModel const& m, Couplings const& c);
}  // namespace detail

/// Groups the trees of `m`, in the order in which each topology first occurs. Tendons and actuators that reach no tree are the first
/// tree's. Cost O(size of the model).
std::vector<ArchetypeDescription> find_archetypes(CompiledModel const& m);

}  // namespace gsp

#if !defined(GSP_COMPILED)
#include <gsp/model/detail/archetypes_impl.hpp>
#endif
