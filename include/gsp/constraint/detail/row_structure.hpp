#pragma once
#include <gsp/constraint/rows.hpp>

/// What a constraint's `jacobian` writes to while rows are assembled: first which trees and chains a row touches, then its entries.
namespace gsp::detail {

/// Deepest ancestor chain, or whole tree, that a row needs on each of the two trees that it may touch.
template <class R, class Mem>
struct RowStructure {
  struct Part {
    int tree = -1, last = -1;  // last: local dof at the end of the chain, -1: all dofs
  };
  Model<R, Mem> const& model;
  Part first = {}, second = {};  // no array: one that is indexed is memory to a GPU, and so is all that lies beside it
  bool refused = false;          // more than two trees, or a body or dof that is not there

  KOKKOS_INLINE_FUNCTION void touch(int dof) {
    int const t = model.dof_tree(dof);
    Part const part{t, dof - model.tree_dof(t)};
    if (first.tree < 0 || first.tree == t)
      join(first, part);
    else if (second.tree < 0 || second.tree == t)
      join(second, part);
    else
      refused = true;
  }
  KOKKOS_INLINE_FUNCTION RowSegment segment(int s) const { return segment(s == 0 ? first : second); }
  KOKKOS_INLINE_FUNCTION int entries() const { return segment(first).count + segment(second).count; }
  /// f(tree) for those that it touches.
  template <class F>
  KOKKOS_INLINE_FUNCTION void each_tree(F const& f) const {
    if (first.tree >= 0) f(first.tree);
    if (second.tree >= 0) f(second.tree);
  }
  // the interface of AnyRow
  KOKKOS_INLINE_FUNCTION void set_dof(int dof, R) {
    if (dof >= 0 && dof < model.nv)
      touch(dof);
    else
      refused = true;
  }
  KOKKOS_INLINE_FUNCTION void add_point(int body, Vec3<R> const&, Vec3<R> const&, R = R(1)) {
    if (body < 0 || body >= model.nbody) {
      refused = true;
      return;
    }
    int const dof = model.body_last_dof(body);
    if (dof >= 0) touch(dof);
  }
  KOKKOS_INLINE_FUNCTION void add_rotation(int body, Vec3<R> const& direction, R = R(1)) { add_point(body, direction, direction); }

 private:
  KOKKOS_INLINE_FUNCTION void join(Part& own, Part const& with) const {
    if (own.tree < 0) own = with;
    if (own.last < 0 || own.last == with.last) return;
    int const deep = with.last > own.last ? with.last : own.last, high = with.last > own.last ? own.last : with.last;
    own.last = is_ancestor(own.tree, high, deep) ? deep : -1;
  }
  KOKKOS_INLINE_FUNCTION bool is_ancestor(int t, int high, int deep) const {
    Archetype const& a = model.archetypes(model.tree_archetype(t));
    int const* const ints = model.ints.data();
    int const depth = ints[a.row_adr + high + 1] - ints[a.row_adr + high], n = ints[a.row_adr + deep + 1] - ints[a.row_adr + deep];
    return depth <= n && ints[a.row_col + ints[a.row_adr + deep] + depth - 1] == high;
  }
  /// Without dofs where no tree is touched.
  KOKKOS_INLINE_FUNCTION RowSegment segment(Part const& part) const {
    if (part.tree < 0) return {-1, 0, -1};
    Archetype const& a = model.archetypes(model.tree_archetype(part.tree));
    if (part.last < 0 || model.tree_closed(part.tree)) return {-1, a.nv, model.tree_dof(part.tree)};
    int const* const ints = model.ints.data();
    int const adr = ints[a.row_adr + part.last], n = ints[a.row_adr + part.last + 1] - adr;
    return {n == a.nv ? -1 : a.row_col + adr, n, model.tree_dof(part.tree)};  // a chain of all dofs lists them in order
  }
};

/// Writes the entries of J where RowStructure has made room, on a host (devices: WhitenedWriter, whiten_trees.hpp).
template <class R, class Mem>
struct RowWriter {
  Model<R, Mem> const& model;
  Dynamics<R, Mem> const& dynamics;
  Row<R> const& row;
  R* J;  // the row's, zero before
  int world;

  KOKKOS_INLINE_FUNCTION int place(int tree, int depth_index, int local) const {  // index of an entry in J
    bool const second = row.segment[0].dof0 != model.tree_dof(tree);
    RowSegment const& segment = row.segment[second];
    return (second ? row.segment[0].count : 0) + (segment.list < 0 ? local : depth_index);
  }
  KOKKOS_INLINE_FUNCTION void set_dof(int dof, R value) const {
    int const t = model.dof_tree(dof), local = dof - model.tree_dof(t);
    Archetype const& a = model.archetypes(model.tree_archetype(t));
    J[place(t, model.ints(a.row_adr + local + 1) - model.ints(a.row_adr + local) - 1, local)] += value;
  }
  /// + scale * direction . (velocity of the point of `body` that is now at `point`, world frame)
  KOKKOS_INLINE_FUNCTION void add_point(int body, Vec3<R> const& point, Vec3<R> const& direction, R scale = R(1)) const {
    add(body, scale, [&](TreeItems<R> const& items) {
      Vec3<R> const arm = point - items.vec3(items.at.com + 3 * model.body_root(body));
      return Spatial<R>{cross(arm, direction), direction};
    });
  }
  /// + scale * direction . (angular velocity of `body`, world frame)
  KOKKOS_INLINE_FUNCTION void add_rotation(int body, Vec3<R> const& direction, R scale = R(1)) const {
    add(body, scale, [&](TreeItems<R> const&) { return Spatial<R>{direction, {R(0), R(0), R(0)}}; });
  }

 private:
  template <class Force>
  KOKKOS_INLINE_FUNCTION void add(int body, R scale, Force const& force) const {
    int const dof = model.body_last_dof(body);
    if (dof < 0) return;
    int const t = model.dof_tree(dof), last = dof - model.tree_dof(t);
    Archetype const& a = model.archetypes(model.tree_archetype(t));
    TreeItems<R> const items = dynamics.tree(model, world, t);
    Spatial<R> const f = force(items);  // J = f . cdof for all dofs that move the body
    int const adr = model.ints(a.row_adr + last), n = model.ints(a.row_adr + last + 1) - adr;
    for (int p = 0; p < n; ++p) {
      int const local = model.ints(a.row_col + adr + p);
      J[place(t, p, local)] += scale * dot(f, items.spatial(items.at.cdof + 6 * local));
    }
  }
};

}  // namespace gsp::detail
