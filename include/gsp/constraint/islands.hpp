#pragma once
#include <gsp/model/model.hpp>
#include <gsp/parallel/for_worlds.hpp>

namespace gsp {

/// The islands of each world: trees that rows couple, directly or through other trees. Nothing passes from one to another, so a solver
/// takes them one by one, each for as long as it needs, or at the same time. `assemble` says anew each step which trees are one, the
/// solvers list what they have; the same in any order of threads.
template <class Mem>
struct Islands {
  int ntree = 0, nv = 0;
  Kokkos::View<int**, Kokkos::LayoutRight, Mem> lists;  // (worlds, 8 ntree + 5): what follows, and room to find it
  Kokkos::View<int**, Kokkos::LayoutRight, Mem> dofs;   // (worlds, nv)
  Kokkos::View<int*, Kokkos::LayoutRight, Mem> elements,
      keys;                                             // (capacity of rows), a world's from Rows::first on; keys: of rows, to sort by
  Kokkos::View<int const*, Mem> dof_tree, tree_dofnum;  // the model's

  /// Islands of a world that have rows.
  KOKKOS_INLINE_FUNCTION int& count(int w) const { return lists(w, 0); }
  /// Island i has the elements first_element(w, i) ... of `elements`, which says where their rows begin, counted from Rows::first: elements
  /// of one row before others, each in the order of the rows; or all rows in their order (IslandItems).
  KOKKOS_INLINE_FUNCTION int& first_element(int w, int i) const { return lists(w, 1 + i); }
  /// And the dofs first_dof(w, i) ... of `dofs`; from that of island count(w) on they are those that no row moves.
  KOKKOS_INLINE_FUNCTION int& first_dof(int w, int i) const { return lists(w, 2 + ntree + i); }
  /// Rows of island i.
  KOKKOS_INLINE_FUNCTION int& row_count(int w, int i) const { return lists(w, 5 + 6 * ntree + i); }
  /// Dof d of tree t is number d + shift(w, t) in the list of its island.
  KOKKOS_INLINE_FUNCTION int& shift(int w, int t) const { return lists(w, 5 + 7 * ntree + t); }
  /// Of each tree the first of its island; made by `assemble`.
  KOKKOS_INLINE_FUNCTION int* label(int w) const { return &lists(w, 4 + 2 * ntree); }  // (ntree)
  /// Scratch.
  KOKKOS_INLINE_FUNCTION int* number(int w) const { return label(w) + ntree; }    // (ntree)
  KOKKOS_INLINE_FUNCTION int* next(int w) const { return label(w) + 2 * ntree; }  // (2 ntree + 1)
};

/// The islands that sleep (step/sleep.hpp), for `assemble`: it wakes those that something awake touches, and leaves out the rows of the
/// others. Empty: nothing sleeps.
template <class Mem>
struct SleepingIslands {
  Kokkos::View<int**, Kokkos::LayoutRight, Mem> island;   // (worlds, ntree) first tree of the island that the tree sleeps in; -1: awake
  Kokkos::View<int**, Kokkos::LayoutRight, Mem> stirred;  // (worlds, ntree) out: 1: what touches the tree may change while it rests
  Kokkos::View<int**, Kokkos::LayoutRight, Mem> wakes;    // (worlds, ntree) scratch: of islands, at their first tree
  Kokkos::View<int*, Kokkos::LayoutRight, Mem> asleep;    // (worlds) out: trees that stay asleep

  KOKKOS_INLINE_FUNCTION bool any() const { return island.data() != nullptr; }
};

namespace detail {

/// What Islands::elements lists: where elements begin, those of one row before others; or all of their rows in order.
enum class IslandItems { elements, rows };

/// Room for the islands of `worlds` worlds. Allocates.
template <class Mem, class Exec, class R>
Islands<Mem> make_islands(Exec const& exec, Model<R, Mem> const& model, int worlds) {
  Islands<Mem> s;
  s.ntree = model.ntree;
  s.nv = model.nv;
  s.dof_tree = model.dof_tree;
  s.tree_dofnum = model.tree_dofnum;
  s.lists = allocate_zero<decltype(s.lists)>(exec, "gsp::Islands::lists", worlds, 8 * s.ntree + 5);
  s.dofs = allocate_zero<decltype(s.dofs)>(exec, "gsp::Islands::dofs", worlds, s.nv);
  return s;
}

/// The tree that row r of a world touches with one of its segments, -1: none.
template <class Rows, class Mem>
KOKKOS_INLINE_FUNCTION int tree_of_row(Rows const& rows, Islands<Mem> const& s, int w, int r, int segment) {
  auto const& t = rows.row(rows.first(w) + r).segment[segment];
  return t.count > 0 ? s.dof_tree(t.dof0) : -1;
}

/// Each tree is an island of its own.
template <class World, class Mem>
KOKKOS_INLINE_FUNCTION void part_islands(World const& world, Islands<Mem> const& s, int w) {
  int* const label = s.label(w);
  world.each(s.ntree, [&](int t) { label[t] = t; });
  world.sync();
}
/// Trees that are coupled find each other by their first one (union-find without locks): label[t] <= t leads to it, in one or more steps.
KOKKOS_INLINE_FUNCTION int first_of_island(int* label, int tree) {
  for (int next; (next = Kokkos::atomic_load(&label[tree])) != tree; tree = next) {}
  return tree;
}
/// Trees a and b are of one island from now on; threads may join others at the same time, and all orders end alike.
KOKKOS_INLINE_FUNCTION void join_islands(int* label, int a, int b) {
  for (;;) {
    a = first_of_island(label, a);
    b = first_of_island(label, b);
    if (a == b) return;
    int const later = a > b ? a : b, first = a > b ? b : a;
    if (Kokkos::atomic_compare_exchange(&label[later], later, first) == later) return;
  }
}

/// Makes label[t] the first tree of t's island, after all are joined.
template <class World, class Mem>
KOKKOS_INLINE_FUNCTION void label_islands(World const& world, Islands<Mem> const& s, int w) {
  int* const label = s.label(w);
  world.sync();
  world.each(s.ntree, [&](int t) { Kokkos::atomic_store(&label[t], first_of_island(label, t)); });
  world.sync();
}

/// The islands of one world from the labels that `assemble` has made: elements and dofs sorted by them (counting sort). Cost: a few passes
/// over rows and trees.
template <IslandItems items = IslandItems::elements, class World, class Rows, class Mem>
KOKKOS_INLINE_FUNCTION void find_islands(World const& world, Rows const& rows, Islands<Mem> const& s, int w) {
  int const first = rows.first(w), count = rows.count(w), ntree = s.ntree;
  int *const label = s.label(w), *const number = s.number(w), *const next = s.next(w), *const keys = s.keys.data() + first;
  int* const row_count = &s.shift(w, 0);  // of islands, at their first tree
  world.each(2 * ntree + 1, [&](int k) { next[k] = 0; });
  world.each(ntree, [&](int t) { row_count[t] = 0; });
  world.sync();
  world.each(count, [&](int r) {  // by island, then elements of one row before others; -1: no element, or one that nothing is solved for
    int const n = rows.element_rows(first + r), listed = items == IslandItems::rows ? n : 1;
    int tree = -1;
    if (!rows.row(first + r).eliminated)
      for (int i = 0; i < 2 * n && tree < 0; ++i) tree = tree_of_row(rows, s, w, r + i / 2, i % 2);
    int const key = tree < 0 ? -1 : 2 * label[tree] + (items == IslandItems::elements && n > 1);
    for (int b = 0; b < listed; ++b) keys[r + b] = key;
    if (tree < 0) return;
    world.add(next[key], listed);
    world.add(row_count[label[tree]], n);
  });
  world.sync();
  world.template scan<int>(
      2 * ntree + 1, [&](int k) { return next[k]; }, [&](int k, int before) { next[k] = before; });
  world.sync();
  auto const has = [&](int t) { return int(next[2 * t + 2] > next[2 * t]); };
  world.template scan<int>(ntree, has, [&](int t, int before) {
    number[t] = has(t) ? before : -1;
    if (has(t)) {
      s.first_element(w, before) = next[2 * t];
      s.row_count(w, before) = row_count[t];
    }
    if (t == ntree - 1) {
      s.count(w) = before + has(t);
      s.first_element(w, before + has(t)) = next[2 * ntree];
    }
  });
  world.sync();
  world.place(
      count, [&](int r) { return keys[r]; }, next, [&](int r, int at) { s.elements(first + at) = r; });

  int const islands = s.count(w);
  auto const number_of = [&](int tree) { return number[label[tree]] < 0 ? islands : number[label[tree]]; };
  world.sync();
  world.each(ntree + 1, [&](int k) { next[k] = 0; });
  world.sync();
  world.each(ntree, [&](int t) { world.add(next[number_of(t)], s.tree_dofnum(t)); });
  world.sync();
  world.template scan<int>(
      ntree + 1, [&](int k) { return next[k]; }, [&](int k, int before) { next[k] = s.first_dof(w, k) = before; });
  world.sync();
  world.place(
      s.nv, [&](int i) { return number_of(s.dof_tree(i)); }, next,
      [&](int i, int at) {
        int const tree = s.dof_tree(i);
        s.dofs(w, at) = i;
        if (i == 0 || s.dof_tree(i - 1) != tree) s.shift(w, tree) = at - s.first_dof(w, number_of(tree)) - i;
      });
  world.sync();
}

/// The elements and dofs of an island, or of a world of one tree, which is one.
struct Island {
  int world, first_row;
  int const* element;  // first rows, counted from first_row; null: all rows of the world, elements being found on the way
  int elements;        // or rows
  int const* list;     // of dofs; null: all
  int dofs;
  int rows;          // those that are eliminated too, where `element` is null
  int const* shift;  // of trees: Islands::shift; null: 0
  KOKKOS_INLINE_FUNCTION int dof(int k) const { return list ? list[k] : k; }
  /// Of entry k of the list: first row, and the row after its last.
  KOKKOS_INLINE_FUNCTION int begin(int k) const { return element ? element[k] : k; }
  template <class Rows>
  KOKKOS_INLINE_FUNCTION int end(Rows const& all, int k) const {
    return element ? element[k] + all.element_rows(first_row + element[k]) : k + 1;
  }
  /// The rows of the element that entry k begins; 0: it begins none, or one that is eliminated.
  template <class Rows>
  KOKKOS_INLINE_FUNCTION int rows_of(Rows const& all, int k) const {
    int const at = first_row + begin(k), n = all.element_rows(at);
    return !element && n > 0 && all.most_eliminated > 0 && all.row(at).eliminated ? 0 : n;
  }
  /// What the first dof of a segment is among those of the island.
  template <class Rows, class Segment>
  KOKKOS_INLINE_FUNCTION int first_dof(Rows const& all, Segment const& s) const {
    return shift ? s.dof0 + shift[all.islands.dof_tree(s.dof0)] : s.dof0;
  }
};
/// Islands are numbered through all worlds: number u is island u % of_world of world u / of_world.
template <class Rows>
KOKKOS_INLINE_FUNCTION int islands_of_world(Rows const& rows) {  // that there may be
  return rows.islands.ntree > 1 ? rows.islands.ntree : 1;
}
/// Whether there is one: after find_islands in worlds of several trees; a world of one tree is an island, with rows or without.
template <class Rows>
KOKKOS_INLINE_FUNCTION bool is_island(Rows const& rows, int w, int i) {
  return rows.islands.ntree > 1 ? i < rows.islands.count(w) : i == 0;
}
template <class Rows>
KOKKOS_INLINE_FUNCTION Island island_of(Rows const& rows, int w, int i) {
  auto const& s = rows.islands;
  int const first = rows.first(w);
  if (s.ntree <= 1) return {w, first, nullptr, rows.count(w), nullptr, rows.nv, rows.count(w), nullptr};
  int const element = s.first_element(w, i), dof = s.first_dof(w, i);
  return {w,
          first,
          s.elements.data() + first + element,
          s.first_element(w, i + 1) - element,
          &s.dofs(w, 0) + dof,
          s.first_dof(w, i + 1) - dof,
          s.row_count(w, i),
          &s.shift(w, 0)};
}

/// Rows and dofs of an island, each in their order, or of a whole world.
struct IslandRows {
  int const* rows;  // counted from Rows::first; null: all
  int count;
  int const* list;  // null: all dofs
  int dofs;
  KOKKOS_INLINE_FUNCTION int row(int k) const { return rows ? rows[k] : k; }
  KOKKOS_INLINE_FUNCTION int dof(int k) const { return list ? list[k] : k; }
};

/// Island i of a world, after find_islands<IslandItems::rows> where it has several trees.
template <class Rows>
KOKKOS_INLINE_FUNCTION IslandRows island_rows(Rows const& rows, int w, int i) {
  auto const& islands = rows.islands;
  int const count = rows.count(w);
  bool const one = islands.ntree <= 1;
  int const row = one ? 0 : islands.first_element(w, i), n = one ? count : islands.first_element(w, i + 1) - row;
  int const dof = one ? 0 : islands.first_dof(w, i), dofs = one ? islands.nv : islands.first_dof(w, i + 1) - dof;
  return {n == count ? nullptr : islands.elements.data() + rows.first(w) + row, n, dofs == islands.nv ? nullptr : &islands.dofs(w, 0) + dof,
          dofs};
}
/// f(island) for the islands of a world, one after the other. What an island is to f hangs on its own rows and dofs alone: the k-th row of
/// it, the k-th dof. Islands::keys are free for f.
template <class World, class Rows, class F>
KOKKOS_INLINE_FUNCTION void each_island(World const& world, Rows const& rows, int w, F const& f) {
  auto const& islands = rows.islands;
  if (rows.count(w) == 0) return;
  bool const one = islands.ntree <= 1;
  if (!one) find_islands<IslandItems::rows>(world, rows, islands, w);
  int const found = one ? 1 : islands.count(w);
  for (int i = 0; i < found; ++i) f(island_rows(rows, w, i));
}

}  // namespace detail
}  // namespace gsp
