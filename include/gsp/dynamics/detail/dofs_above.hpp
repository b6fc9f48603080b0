#pragma once
#include <gsp/dynamics/world_lanes.hpp>

/// The dofs between the root of a tree and one of its bodies, over lanes of worlds.
namespace gsp::detail {

/// Those that move body `body`, as mass_matrix, and for rates the velocity stages, have left them in the dynamics. References: for the time
/// of an expression in a kernel.
template <class T, class R, class Mem>
class DofsAbove {
 public:
  KOKKOS_INLINE_FUNCTION DofsAbove(WorldLane<T> const& lane, Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, int body)
      : lane_(lane), model_(model), dynamics_(dynamics), body_(body), last_(model.body_last_dof(body)) {
    if (none()) return;
    tree_ = model.dof_tree(last_);
    first_ = model.tree_dof(tree_);
    archetype_ = &model.archetypes(model.tree_archetype(tree_));
  }
  /// Nothing moves the body: what follows is not to be asked.
  KOKKOS_INLINE_FUNCTION bool none() const { return last_ < 0; }
  KOKKOS_INLINE_FUNCTION Archetype const& archetype() const { return *archetype_; }
  /// The number in the world of dof i of the tree.
  KOKKOS_INLINE_FUNCTION int in_world(int i) const { return first_ + i; }
  /// The tree's centre of mass, about which motions are [m].
  KOKKOS_INLINE_FUNCTION Vec3<T> center() const { return get3(at().com + 3 * model_.body_root(body_)); }
  KOKKOS_INLINE_FUNCTION T rate(int i) const { return get(at().qvel + i); }
  /// f(i, S_i) for dofs i of the tree, from the root, with their motion vectors.
  template <class F>
  KOKKOS_FORCEINLINE_FUNCTION void each(F const& f) const {
    Archetype const& a = *archetype_;
    for (int e = model_.ints(a.row_adr + last_ - first_), end = model_.ints(a.row_adr + last_ - first_ + 1); e < end; ++e) {
      int const i = model_.ints(a.row_col + e), c = at().cdof + 6 * i;
      f(i, Spatial<T>{get3(c), get3(c + 3)});
    }
  }

 private:
  KOKKOS_INLINE_FUNCTION FactorLayout at() const { return FactorLayout(*archetype_); }
  KOKKOS_INLINE_FUNCTION T get(int i) const { return lane_.item(model_, dynamics_, tree_, i); }
  KOKKOS_INLINE_FUNCTION Vec3<T> get3(int i) const { return {get(i), get(i + 1), get(i + 2)}; }

  WorldLane<T> const& lane_;
  Model<R, Mem> const& model_;
  Dynamics<R, Mem> const& dynamics_;
  int body_, last_, tree_ = -1, first_ = 0;
  Archetype const* archetype_ = nullptr;
};

}  // namespace gsp::detail
