#pragma once
#include <gsp/constraint/constraint_type.hpp>
#include <gsp/constraint/islands.hpp>
#include <gsp/core/status.hpp>
#include <gsp/model/state.hpp>

/// Which elements lie still as long as the trees that they touch do, and which wake an island.
namespace gsp::detail {

/// Its rows are the same as long as nothing moves that they touch, and nothing that a sleeping tree is woken for changes.
template <class Type>
KOKKOS_INLINE_FUNCTION constexpr bool rests() {
  if constexpr (requires { Type::rests; })
    return Type::rests;
  else
    return false;
}

/// What a `jacobian` writes to, for the trees that a row touches alone.
template <class R, class Mem, class F>
struct TreeVisitor {
  Model<R, Mem> const& model;
  F const& visit;  // (tree); -1: a mocap body
  KOKKOS_INLINE_FUNCTION void set_dof(int dof, R) const {
    if (dof >= 0 && dof < model.nv) visit(model.dof_tree(dof));
  }
  KOKKOS_INLINE_FUNCTION void add_point(int body, Vec3<R> const&, Vec3<R> const&, R = R(1)) const {
    if (body < 0 || body >= model.nbody) return;
    if (model.body_tree(body) >= 0)
      visit(model.body_tree(body));
    else if (model.body_mocap(body) >= 0)
      visit(-1);
  }
  KOKKOS_INLINE_FUNCTION void add_rotation(int body, Vec3<R> const& direction, R = R(1)) const { add_point(body, direction, direction); }
};
/// visit(tree) for the trees that element k touches, -1 for a mocap body; those of one more than once. All rows of what rests touch the
/// same.
template <class R, class Mem, class Type, class F>
KOKKOS_INLINE_FUNCTION void visit_trees(Model<R, Mem> const& model, Type const& type, int w, int k, F const& visit) {
  TreeVisitor<R, Mem, F> visitor{model, visit};
  int const n = rests<Type>() ? 1 : type.rows(w, k);
  for (int r = 0; r < n; ++r) type.jacobian(w, k, r, visitor);
}

/// Whether element k, which has rows, is of an island that sleeps. After WakeIslands, which counts who does.
template <class R, class Mem, class Type>
KOKKOS_INLINE_FUNCTION bool lies_still(Model<R, Mem> const& model, SleepingIslands<Mem> const& sleeping, Type const& type, int w, int k) {
  if (!rests<Type>() || !sleeping.any() || sleeping.asleep(w) == 0) return false;
  bool still = false;
  visit_trees(model, type, w, k, [&](int t) { still = still || (t >= 0 && sleeping.island(w, t) >= 0); });
  return still;
}

/// Wakes the islands that an element couples to something awake: a tree, a mocap body, or a constraint that does not rest; and those that
/// it couples to each other. Again until none is left, so that the order of the elements is of no account.
template <class R, class Mem, class Types>
struct WakeIslands {
  Model<R, Mem> model;
  SleepingIslands<Mem> sleeping;
  Types types;
  bool all_rest;  // of the types
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank, ntree = model.ntree;
    world.each(ntree, [&](int t) { sleeping.stirred(w, t) = 0; });
    int const asleep = count_sleepers(world);
    if (asleep == 0 && all_rest && model.nmocap == 0) return;
    types.prepare(world);
    world.sync();
    for (bool again = true; again;) {
      world.each(ntree, [&](int t) { sleeping.wakes(w, t) = 0; });
      world.sync();
      int const found = world.template sum<int>(types.count(w), [&](int e) {
        int wakes_some = 0;
        types.visit(w, e, 0, [&](auto const& type, int, int k) {
          if (type.rows(w, k) <= 0) return;
          using Type = std::remove_cvref_t<decltype(type)>;
          bool moves = !rests<Type>(), awake = moves;
          int first = -1, last = -1;  // islands
          visit_trees(model, type, w, k, [&](int t) {
            int const i = t < 0 ? -1 : sleeping.island(w, t);
            moves = moves || t < 0;
            awake = awake || i < 0;
            first = first < 0 || (i >= 0 && i < first) ? i : first;
            last = i > last ? i : last;
          });
          if (moves)
            visit_trees(model, type, w, k, [&](int t) {
              if (t >= 0) sleeping.stirred(w, t) = 1;
            });
          if (last < 0 || (!awake && first == last)) return;
          wakes_some = 1;
          visit_trees(model, type, w, k, [&](int t) {
            if (t >= 0 && sleeping.island(w, t) >= 0) sleeping.wakes(w, sleeping.island(w, t)) = 1;
          });
        });
        return wakes_some;
      });
      world.sync();
      again = found > 0;
      world.each(again ? ntree : 0, [&](int t) {
        if (int const i = sleeping.island(w, t); i >= 0 && sleeping.wakes(w, i)) sleeping.island(w, t) = -1;
      });
      world.sync();
    }
    if (asleep > 0) count_sleepers(world);
  }

 private:
  template <class World>
  KOKKOS_INLINE_FUNCTION int count_sleepers(World const& world) const {
    int const w = world.rank;
    int const asleep = world.template sum<int>(model.ntree, [&](int t) { return int(sleeping.island(w, t) >= 0); });
    world.single([&] { sleeping.asleep(w) = asleep; });
    return asleep;
  }
};

}  // namespace gsp::detail
