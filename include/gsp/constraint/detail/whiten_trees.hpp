#pragma once
#include <cstdint>
#include <gsp/constraint/detail/row_structure.hpp>
#include <gsp/constraint/detail/whiten_rows.hpp>
#include <gsp/constraint/progress.hpp>
#include <gsp/core/check.hpp>
#include <gsp/dynamics/lanes.hpp>
#include <gsp/parallel/detail/launch_threads.hpp>
#include <string>

/// What a device finds of each tree before it makes rows, so that a row is a sum of products and nothing of it waits for another:
///   X = L^-1 D^-1/2     x_i = e_i D_i^-1/2 - sum_k L_ik x_k, k the ancestors of dof i
///   W_b = sum_i c_i x_i     6 numbers a dof, i the dofs that move body b, c_i their motions (cdof)
/// so that a force F on body b is the row Y = F . W_b, and a rate v of dof i the row v x_i. Likewise the rates of a body,
///   V_b = sum_i c_i (q_low, v, v^)_i
/// A host makes rows by lanes instead (row_lanes.hpp).
namespace gsp::detail {

/// x, which nothing writes while a kernel is at work (from `follow` on): a load that need not wait for the stores before it.
template <class T>
KOKKOS_FORCEINLINE_FUNCTION T read_only(T const& x) {
#ifdef __CUDA_ARCH__
  return __ldg(&x);
#else
  return x;
#endif
}

/// Six items, which nothing writes while the kernel is at work.
template <class R>
KOKKOS_FORCEINLINE_FUNCTION Spatial<R> read_only(LaneItems<R> const& s, int i) {
  return {{read_only(s[i]), read_only(s[i + 1]), read_only(s[i + 2])}, {read_only(s[i + 3]), read_only(s[i + 4]), read_only(s[i + 5])}};
}

template <class R, class Mem>
struct WhitenTrees {
  static constexpr int near_bytes = 160;  // a column of X along a chain, or else it is read again from the items
  Model<R, Mem> model;
  Dynamics<R, Mem> dynamics;
  Kokkos::View<int, Mem> halt;
  int columns;  // of a tree, at most
  WhitenTrees(Model<R, Mem> const& m, Dynamics<R, Mem> const& d, Progress<Mem> const& progress)
      : model(m), dynamics(d), halt(progress.halt), columns(0) {
    for (int k = 0; k < m.narchetype; ++k)
      columns = m.host_archetypes(k).nv + rate_columns > columns ? m.host_archetypes(k).nv + rate_columns : columns;
    if (std::int64_t(d.blocks) * columns * device_block > most_threads)
      throw Error("gsp::assemble: " + std::to_string(std::int64_t(d.blocks) * device_block) + " trees of all worlds, of up to " +
                  std::to_string(columns - rate_columns) + " degrees of freedom, are more than 2^30 columns: use fewer worlds a batch");
  }
  /// A thread a column of a tree of a world, 32 worlds side by side. A column hangs on itself alone: x_ij is not 0 where i is moved by j.
  /// The rates are columns whose x are given.
  KOKKOS_FUNCTION int count() const { return halt() ? 0 : dynamics.blocks * columns * device_block; }
  template <class Thread>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(Thread const& thread, int number) const {
    int const lane = number % device_block, block = number / device_block / columns, j = number / device_block % columns;
    int const archetype = dynamics.block_archetype(block);
    Archetype const& a = model.archetypes(archetype);
    int const nv = a.nv;
    if (j >= nv + rate_columns) return;
    // As numbers of its own: what lies in memory would be loaded again after each number that is stored.
    DynamicsLayout const at = dynamics.layouts(archetype);
    int const* const ints = model.ints.data();
    int const *const dof_parent = ints + a.dof_parent, *const dof_body = ints + a.dof_body, *const row_adr = ints + a.row_adr,
                     *const row_col = ints + a.row_col;
    LaneItems<R> const s{whole(dynamics.items.data() + dynamics.block_offset(block) + lane), device_block};
    // Along the dofs from `first` on: x(i) of each, and at place(i) of the last of each body the sum of c x over its chain.
    auto const sum_bodies = [&](int first, int end, auto const& place, auto const& x) {
      R const zero(0);
      Spatial<R> const none{{zero, zero, zero}, {zero, zero, zero}};
      Spatial<R> sum = none;
      for (int i = first; i < end; ++i) {
        Spatial<R> const axis = read_only(s, at.cdof + 6 * i);  // before x, which waits for what it loads
        int const parent = read_only(dof_parent[i]), body = read_only(dof_body[i]);
        if (parent < first)
          sum = none;
        else if (parent != i - 1)
          sum = s.spatial(place(parent));  // the last dof of its body
        sum = fma(x(i), axis, sum);
        if (i + 1 == nv || read_only(dof_body[i + 1]) != body) s.put(place(i), sum);
      }
    };
    if (j >= nv) {
      int const rate = j - nv, given = rate == 0 ? at.low : rate == 1 ? at.qvel : at.velocity;
      return sum_bodies(
          0, nv, [&](int i) { return at.body_rates + 18 * i + 6 * rate; }, [&](int i) { return read_only(s[given + i]); });
    }
    int const depth = row_adr[j + 1] - row_adr[j] - 1;  // of j, in the chains of all that it moves
    auto const X = thread.template near<R>();           // of the last dof at each depth from j's on
    constexpr int room = Thread::template room<R>;
    auto const column_of = [&](int i) {
      int const adr = read_only(row_adr[i]) + depth, n = read_only(row_adr[i + 1]) - 1 - adr;  // ancestors from j on
      LaneItems<R> const factor{whole(&s[at.factor + adr]), device_block};
      R x = i == j ? sqrt(read_only(s[at.inverse_diagonal + j])) : R(0);
      int p = 0;
      for (; p + batch <= n && n < room; p += batch) {
        R f[batch];
        for (int q = 0; q < batch; ++q) f[q] = -read_only(factor[p + q]);
        for (int q = 0; q < batch; ++q) x = fma(f[q], X[p + q], x);  // dofs are numbered depth first: it is of i's chain
      }
      for (; p < n; ++p) x = fma(-read_only(factor[p]), p < room ? X[p] : s[at.dof_columns + row_adr[row_col[adr + p]] + depth], x);
      if (n < room) X[n] = x;
      s[at.dof_columns + adr] = x;
      return x;
    };
    sum_bodies(
        j, ints[a.body_dofend + dof_body[j]], [&](int i) { return at.body_columns + 6 * (read_only(row_adr[i]) + depth); }, column_of);
  }

 private:
  static constexpr int rate_columns = 3, batch = 4, most_threads = 1 << 30;  // so that their numbers are those of an int
};

/// Numbers that stand apart.
template <class R>
struct Strided {
  R* at;
  int stride;
  KOKKOS_INLINE_FUNCTION R& operator[](int i) const { return at[i * stride]; }
  KOKKOS_INLINE_FUNCTION Strided operator+(int i) const { return {at + i * stride, stride}; }
};

/// Writes a row's entries of Y where RowStructure has made room, of trees that WhitenTrees has gone over.
template <class R, class Mem, class Entries>
struct WhitenedWriter {
  Model<R, Mem> const& model;
  Dynamics<R, Mem> const& dynamics;
  Row<R> const& row;
  Entries Y;  // the row's, zero before
  RowSums<R>& sums;
  int world;

  KOKKOS_INLINE_FUNCTION void set_dof(int dof, R value) const {
    int const t = model.dof_tree(dof), i = dof - model.tree_dof(t);
    TreeItems<R> const s = dynamics.tree(model, world, t);
    sums.gap = fma(value, read_only(s[s.at.low + i]), sums.gap);
    sums.rate = fma(value, read_only(s[s.at.qvel + i]), sums.rate);
    sums.free_rate = fma(value, read_only(s[s.at.velocity + i]), sums.free_rate);
    each_column<1>(t, i, s, s.at.dof_columns, [&](LaneItems<R> const& x) { return value * read_only(x[0]); });
  }
  KOKKOS_INLINE_FUNCTION void add_point(int body, Vec3<R> const& point, Vec3<R> const& direction, R scale = R(1)) const {
    add(body, [&](TreeItems<R> const& s) {
      Vec3<R> const arm = point - s.vec3(s.at.com + 3 * model.body_root(body)), f = scale * direction;
      return Spatial<R>{cross(arm, f), f};
    });
  }
  KOKKOS_INLINE_FUNCTION void add_rotation(int body, Vec3<R> const& direction, R scale = R(1)) const {
    add(body, [&](TreeItems<R> const&) { return Spatial<R>{scale * direction, {R(0), R(0), R(0)}}; });
  }

 private:
  template <class Force>
  KOKKOS_INLINE_FUNCTION void add(int body, Force const& force) const {
    int const dof = model.body_last_dof(body);
    if (dof < 0) return;
    int const t = model.dof_tree(dof), last = dof - model.tree_dof(t);
    TreeItems<R> const s = dynamics.tree(model, world, t);
    Spatial<R> const f = force(s);
    int const rates = s.at.body_rates + 18 * last;
    sums.gap += dot(f, read_only(s, rates));
    sums.rate += dot(f, read_only(s, rates + 6));
    sums.free_rate += dot(f, read_only(s, rates + 12));
    each_column<6>(t, last, s, s.at.body_columns, [&](LaneItems<R> const& w) { return dot(f, read_only(w, 0)); });
  }
  /// Y += of(column) for the columns of dof i of tree t, which begin at `columns`, each of so many items.
  template <int items, class Of>
  KOKKOS_INLINE_FUNCTION void each_column(int t, int i, LaneItems<R> const& s, int columns, Of const& of) const {
    Archetype const& a = model.archetypes(model.tree_archetype(t));
    int const* const ints = model.ints.data();
    int const adr = read_only(ints[a.row_adr + i]), n = read_only(ints[a.row_adr + i + 1]) - adr;
    bool const second = row.segment[0].dof0 != model.tree_dof(t);
    bool const all = row.segment[second].list < 0;
    Entries const y = Y + (second ? row.segment[0].count : 0);
    LaneItems<R> column{whole(&s[columns + items * adr]), s.stride};
    for (int p = 0; p < n; ++p, column.base = &column[items]) y[all ? read_only(ints[a.row_col + adr + p]) : p] += of(column);
  }
};

}  // namespace gsp::detail
