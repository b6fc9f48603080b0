#pragma once
#include <gsp/constraint/detail/row_structure.hpp>
#include <gsp/constraint/detail/whiten_rows.hpp>
#include <gsp/dynamics/lanes.hpp>
#include <gsp/parallel/detail/launch_threads.hpp>

/// What a device finds of each tree before it makes rows, so that a row is a sum of products and nothing of it waits for another:
///   X = L^-1 D^-1/2     x_i = e_i D_i^-1/2 - sum_k L_ik x_k, k the ancestors of dof i
///   W_b = sum_i c_i x_i     6 numbers a dof, i the dofs that move body b, c_i their motions (cdof)
/// so that a force F on body b is the row Y = F . W_b, and a rate v of dof i the row v x_i. Likewise the rates of a body,
///   V_b = sum_i c_i (q_low, v, v^)_i
/// A host makes rows by lanes instead (row_lanes.hpp).
namespace gsp::detail {

/// Six numbers side by side, the first at an even place: a GPU loads and stores them two by two.
template <class R>
struct SixNumbers {
  R* at;
#ifdef __CUDA_ARCH__
  using Pair = std::conditional_t<sizeof(R) == 4, float2, double2>;
  __device__ Pair* pairs() const { return reinterpret_cast<Pair*>(at); }
  __device__ static Spatial<R> of(Pair const& a, Pair const& b, Pair const& c) { return {{a.x, a.y, b.x}, {b.y, c.x, c.y}}; }
  __device__ Spatial<R> get() const { return of(pairs()[0], pairs()[1], pairs()[2]); }
  /// Of what nothing writes while the kernel is at work (read_only).
  __device__ Spatial<R> get_read_only() const { return of(__ldg(pairs()), __ldg(pairs() + 1), __ldg(pairs() + 2)); }
  __device__ void put(Spatial<R> const& v) const {
    pairs()[0] = {v.angular.x, v.angular.y};
    pairs()[1] = {v.angular.z, v.linear.x};
    pairs()[2] = {v.linear.y, v.linear.z};
  }
#else
  Spatial<R> get() const { return {{at[0], at[1], at[2]}, {at[3], at[4], at[5]}}; }
  Spatial<R> get_read_only() const { return get(); }
  void put(Spatial<R> const& v) const {
    for (int c = 0; c < 3; ++c) {
      at[c] = v.angular[c];
      at[3 + c] = v.linear[c];
    }
  }
#endif
};

template <class R, class Mem>
struct WhitenTrees {
  Model<R, Mem> model;
  Dynamics<R, Mem> dynamics;
  int columns;  // of a tree, at most
  static constexpr int near_bytes = 160;  // a column of X, or else it is read again from the items
  WhitenTrees(Model<R, Mem> const& m, Dynamics<R, Mem> const& d) : model(m), dynamics(d), columns(0) {
    for (int k = 0; k < m.narchetype; ++k)
      columns = m.host_archetypes(k).nv + rate_columns > columns ? m.host_archetypes(k).nv + rate_columns : columns;
  }
  /// A thread a column of a tree of a world, 32 worlds side by side. A column hangs on itself alone: x_ij is not 0 where i is moved by j.
  /// The rates are columns whose x are given.
  KOKKOS_FUNCTION int count() const { return dynamics.blocks * columns * device_block; }
  template <class Thread>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(Thread const& thread, int number) const {
    int const lane = number % device_block, block = number / device_block / columns, j = number / device_block % columns;
    int const archetype = dynamics.block_archetype(block);
    Archetype const& a = model.archetypes(archetype);
    DynamicsLayout const& at = dynamics.layout(archetype);
    if (j >= a.nv + rate_columns) return;
    int const* const ints = model.ints.data();
    LaneItems<R> const s{whole(dynamics.items.data() + dynamics.block_offset(block) + lane), device_block};
    R* const body_items = dynamics.body_items(block, lane, at);
    bool const rate = j >= a.nv;
    int const given = j == a.nv ? at.low : j == a.nv + 1 ? at.qvel : at.velocity;
    int const first = rate ? 0 : j, end = rate ? a.nv : ints[a.body_dofend + ints[a.dof_body + j]];
    int const depth = rate ? 0 : ints[a.row_adr + j + 1] - ints[a.row_adr + j] - 1;  // of j in the chains of all that it moves
    auto const X = thread.template near<R>();
    bool const fits = end - first <= Thread::template room<R>;
    auto const of_body = [&](int last) {
      return SixNumbers<R>{body_items + (rate ? at.body_rates + 18 * last + 6 * (j - a.nv) : 6 * (ints[a.row_adr + last] + depth))};
    };
    R const zero(0);
    Spatial<R> sum{{zero, zero, zero}, {zero, zero, zero}};
    for (int i = first; i < end; ++i) {
      int const adr = ints[a.row_adr + i], n = ints[a.row_adr + i + 1] - adr - 1, parent = ints[a.dof_parent + i];
      Spatial<R> axis;  // before x, which waits for what it loads
      for (int c = 0; c < 6; ++c) (c < 3 ? axis.angular[c] : axis.linear[c - 3]) = read_only(s[at.cdof + 6 * i + c]);
      R x = rate ? read_only(s[given + i]) : i == j ? sqrt(read_only(s[at.inverse_diagonal + j])) : zero;
      for (int begin = i == j || rate ? n : depth; begin < n; begin += batch) {
        R factor[batch], above[batch];
        for (int q = 0; q < batch; ++q) {
          int const p = begin + q;
          if (p >= n) continue;
          int const k = ints[a.row_col + adr + p];
          factor[q] = -read_only(s[at.factor + adr + p]);
          above[q] = fits ? X[k - j] : s[at.dof_columns + ints[a.row_adr + k] + depth];
        }
        for (int q = 0; q < batch; ++q)
          if (begin + q < n) x = fma(factor[q], above[q], x);
      }
      if (!rate) {
        if (fits) X[i - j] = x;
        s[at.dof_columns + adr + depth] = x;
      }
      if (parent < first) {
        sum = {{zero, zero, zero}, {zero, zero, zero}};
      } else if (parent != i - 1) {
        sum = of_body(parent).get();  // the last dof of its body
      }
      sum = fma(x, axis, sum);
      if (i + 1 == a.nv || ints[a.dof_body + i + 1] != ints[a.dof_body + i]) of_body(i).put(sum);
    }
  }

 private:
  static constexpr int rate_columns = 3, batch = 8;
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
    each_column(t, i, [&](int at) { return value * read_only(s[s.at.dof_columns + at]); });
  }
  KOKKOS_INLINE_FUNCTION void add_point(int body, Vec3<R> const& point, Vec3<R> const& direction, R scale = R(1)) const {
    add(body, [&](FactorItems<R> const& s) {
      Vec3<R> const arm = point - s.vec3(s.at.com + 3 * model.body_root(body)), f = scale * direction;
      return Spatial<R>{cross(arm, f), f};
    });
  }
  KOKKOS_INLINE_FUNCTION void add_rotation(int body, Vec3<R> const& direction, R scale = R(1)) const {
    add(body, [&](FactorItems<R> const&) { return Spatial<R>{scale * direction, {R(0), R(0), R(0)}}; });
  }

 private:
  template <class Force>
  KOKKOS_INLINE_FUNCTION void add(int body, Force const& force) const {
    int const dof = model.body_last_dof(body);
    if (dof < 0) return;
    int const t = model.dof_tree(dof), last = dof - model.tree_dof(t);
    Spatial<R> const f = force(dynamics.factored(model, world, t));
    R* const items = dynamics.body_items(model, world, t);
    R* const rates = items + dynamics.layout(model.tree_archetype(t)).body_rates + 18 * last;
    sums.gap += dot(f, SixNumbers<R>{rates}.get_read_only());
    sums.rate += dot(f, SixNumbers<R>{rates + 6}.get_read_only());
    sums.free_rate += dot(f, SixNumbers<R>{rates + 12}.get_read_only());
    each_column(t, last, [&](int at) { return dot(f, SixNumbers<R>{items + 6 * at}.get_read_only()); });
  }
  /// Y += of(at) at the dofs of the chain of dof i of tree t, `at` the place of each in the lists of rows (Archetype::row_adr).
  template <class Of>
  KOKKOS_INLINE_FUNCTION void each_column(int t, int i, Of const& of) const {
    Archetype const& a = model.archetypes(model.tree_archetype(t));
    int const* const ints = model.ints.data();
    int const adr = read_only(ints[a.row_adr + i]), n = read_only(ints[a.row_adr + i + 1]) - adr;
    bool const second = row.segment[0].dof0 != model.tree_dof(t);
    bool const all = row.segment[second].list < 0;
    Entries const y = Y + (second ? row.segment[0].count : 0);
    for (int p = 0; p < n; ++p) y[all ? read_only(ints[a.row_col + adr + p]) : p] += of(adr + p);
  }
};

}  // namespace gsp::detail
