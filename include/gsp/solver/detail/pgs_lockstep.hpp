#pragma once
#include <algorithm>
#include <cstring>
#include <gsp/constraint/detail/couple_rows.hpp>
#include <gsp/constraint/impulses.hpp>
#include <gsp/core/detail/prefetch.hpp>
#include <gsp/math/detail/transpose.hpp>
#include <gsp/parallel/detail/thread_room.hpp>
#include <gsp/solver/detail/leap.hpp>
#include <gsp/solver/detail/list_islands.hpp>
#include <gsp/solver/detail/mixing.hpp>
#include <gsp/solver/detail/pgs_options.hpp>
#include <gsp/solver/detail/row_vectors.hpp>
#include <gsp/solver/project_element.hpp>
#include <gsp/solver/solution.hpp>

/// Projected Gauss-Seidel for small islands on a CPU: a pack of them in lockstep, of one world or of several, and two elements at a time:
/// one of one row and one of more, which take turns in a sweep, then what is left of either kind. The dot products of a block read z once,
/// and so does z += sum Y^T d; what its rows do to each other in between goes through their products:
///   w_b = Y_b z + sum_{a < b} (Y_b . Y_a) d_a + C p_b + bias_b     (z as before the block: row by row but for rounding)
/// A block's entries are widened to the dofs that any of its rows has in any of the islands, each by its own count, so that nothing is
/// gathered inside a sweep. What bounds a sweep is loading Y, twice a block. An island takes this path by its own rows and dofs alone
/// (is_small), which of them share a block is a matter of its own elements, and a lane of finite numbers never sees another lane. Most
/// packs have no element of more than three rows, and blocks without room for more; it changes no bit either.
namespace gsp::detail {

/// What Solution::goes_on says of an island after a round of sweeps.
enum GoesOn : signed char { is_done, only_sweeps, still_leaps };
/// @tparam N  rows of an element, at most
template <class R, class Mem, int N>
struct LockstepPack {
  static constexpr int W = native_width<R>;
  using T = Pack<R, W>;
  static constexpr int sums = sizeof(T) == 64 ? 4 : 2;  // partial sums of a dot product, as many as there are registers for
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Solution<R, Mem> solution;
  PgsOptions options;

  /// An island's elements: those of one row that have one of more rows to take turns with; those of more; those of one row that are left.
  enum List { turn, several, rest };
  static constexpr int places_of(int list) { return list == several ? N : 1; }
  /// Kinds of blocks, in the order of the sweeps: an element of one row and one of more; one of more; four of one row. Which of an island's
  /// elements share a block hangs on it alone; whether an empty place stands beside one of more rows, on the pack: it changes no
  /// bit.
  enum Kind { in_turn, alone, by_fours };
  static constexpr int elements_of(int kind) { return kind == in_turn ? 2 : kind == alone ? 1 : 4; }
  /// The list that element e of a block is from. It begins at place e.
  static constexpr int list_at(int kind, int e) { return kind == by_fours ? rest : kind == alone ? several : e == 0 ? turn : several; }
  static constexpr int rows_of(int kind) { return kind == in_turn ? 1 + N : kind == alone ? N : 4; }
  static constexpr int most_rows = 1 + N;

  /// What is known of a block's rows but their entries.
  struct Block {
    ElementLaw<T, most_rows> law;
    T bias[most_rows], compliance[most_rows], diagonal[most_rows], p[most_rows];
    T d[most_rows];                                  // what the last sweep has changed p by
    T before[2][most_rows], d_before[2][most_rows];  // p after the last sweep that was mixed, and after the one after that; their d
    T product[couplings_of(most_rows)];              // Y_b . Y_a at couplings_of(b) + a
    T const* Y;                                      // entry e of row b of B at B e + b
    int groups;                                      // of four dofs
    short dof[lockstep_most_dofs / 4];
  };
  struct Blocks {
    Block* first;
    int count[3];  // of a kind
    int dofs;      // of the largest island
    /// f(kind, block) of all of them in the order of the sweeps, the kind known to the compiler.
    template <class F>
    void each(F const& f) const {
      Block* k = first;
      for (int q = 0; q < count[in_turn]; ++q) f(Index<in_turn>{}, *k++);
      for (int q = 0; q < count[alone]; ++q) f(Index<alone>{}, *k++);
      for (int q = 0; q < count[by_fours]; ++q) f(Index<by_fours>{}, *k++);
    }
  };
  /// The elements of an island, list by list.
  struct Element {
    int row, rows;  // the first, counted from Rows::first, and their number; 0: none
  };
  struct Elements {
    int count[3] = {};
    int single[lockstep_most_rows], first[lockstep_most_rows / 2];  // those of one row, and the first rows of the others
    signed char rows[lockstep_most_rows / 2];
    Element operator()(int list, int at) const {
      if (at >= count[list]) return {-1, 0};
      return list == several ? Element{first[at], rows[at]} : Element{single[list == turn ? at : count[turn] + at], 1};
    }
  };

  /// @param numbers  of the islands of the lanes, -1: none
  /// @param begin    sweeps that they have behind them
  [[gnu::noinline]] void operator()(int const (&numbers)[W], int begin, int thread) const {
    int const parity = impulses.parity(), of_world = islands_of_world(rows);
    int nv = 0, most[3] = {};
    Island islands[W];
    Elements elements[W];
    for (int l = 0; l < W; ++l) {
      islands[l] = numbers[l] < 0 ? Island{-1, 0, nullptr, 0, nullptr, 0, 0, nullptr}
                                  : detail::island_of(rows, numbers[l] / of_world, numbers[l] % of_world);
      nv = std::max(nv, islands[l].dofs);
      find_elements(elements[l], islands[l], most);
    }
    T* const z = reinterpret_cast<T*>(solution.thread_items.data() + std::int64_t(thread) * solution.thread_stride);
    T* const z_before = z + (nv + 3) / 4 * 4;
    T* const behind = z_before + (nv + 3) / 4 * 4;
    for (T* q = z; q != behind; ++q) *q = T(R(0));
    constexpr int block_packs = lockstep_block_packs(most_rows);
    static_assert(sizeof(Block) <= block_packs * sizeof(T));
    Blocks const blocks{reinterpret_cast<Block*>(behind), {most[turn], most[several] - most[turn], (most[rest] + 3) / 4}, nv};
    T* Y = behind + lockstep_most_blocks * block_packs;
    int taken[3] = {};
    blocks.each([&](auto kind, Block& k) {
      widen<kind>(k, Y, taken, islands, elements, parity);
      for (int e = 0; e < elements_of(kind); ++e) ++taken[list_at(kind, e)];
      push<kind>(k, z, k.p);
    });

    T const relaxation(R(options.relaxation)), zero(R(0));
    T tolerance(R(0));
    int sweeps[W];
    Mask<R, W> active, leaping;
    for (int l = 0; l < W; ++l) {
      sweeps[l] = begin;
      active.set(l, islands[l].rows > 0);
      leaping.set(l, islands[l].rows > 0 && (begin == 0 || solution.goes_on(numbers[l]) == still_leaps));
      if (numbers[l] >= 0) tolerance.set(l, R(options.tolerance) * rows.rate_scale(islands[l].world));
    }
    SweepWork<T> const none{zero, zero, zero};
    MixingMemory<R> memory[W];
    bool more = false;
    for (int sweep = begin; sweep < options.iterations && any(active) && !more; ++sweep) {
      bool const leaps = leaps_after(sweep, options) && any(leaping);
      if (leaps)
        for (int i = 0; i < nv; ++i) z_before[i] = z[i];
      SweepWork<T> work = none;
      T change = zero, misses = zero;
      blocks.each([&](auto kind, Block& k) { pass<kind>(k, z, active, relaxation, change, misses, leaps ? &work : nullptr); });
      for (int l = 0; l < W; ++l)
        if (active[l]) {
          ++sweeps[l];
          if (options.tolerance > 0 && sweep + 1 >= options.least && !(change[l] > tolerance[l])) active.set(l, false);
        }
      Mask<R, W> worse;
      for (int l = 0; l < W; ++l) worse.set(l, active[l] && is_remembered(sweep, options) && memory[l].is_worse(misses[l]));
      if (any(worse)) take_back(blocks, z, z_before, worse);
      Leap<T> leap{zero, zero};
      if (leaps) {
        for (int l = 0; l < W; ++l) leaping.set(l, leaping[l] && active[l] && leaps_again(work.raised[l]));
        if (any(leaping)) leap = best_leap<R>(leap_sums(blocks, z, z_before), work);
      }
      Mask<R, W> const leapt = leaping && leap.goes();
      Mask<R, W> mixed, both;
      for (int l = 0; l < W; ++l) {
        mixed.set(l, memory[l].after(sweep, options, leapt[l], misses[l]) && active[l]);
        both.set(l, memory[l].knows_both());
      }
      Mixing<T> mixing{zero, zero};
      if (any(mixed)) {
        mixing = best_mixing<R>(mixing_sums(blocks, both), misses);
        mixed = mixed && mixing.helps();
        for (int l = 0; l < W; ++l)
          if (mixed[l]) memory[l].mixes();
      }
      if (is_remembered(sweep, options)) go_on(blocks, sweep % 2, leapt, leap, mixed, mixing, both);
      if (any(leapt) || any(mixed)) sum_impulses(blocks, z, z_before, leapt || mixed);
      more = begins_anew(sweep, options);
    }
    for (int l = 0; l < W; ++l) {
      if (numbers[l] < 0) continue;
      int const w = islands[l].world;
      R* const out = solution.z.data() + std::int64_t(w) * rows.nv;
      for (int i = 0; i < islands[l].dofs; ++i) out[islands[l].dof(i)] = z[i][l];
      R* const p = impulses.p[parity].data() + islands[l].first_row;
      int written[3] = {};
      blocks.each([&](auto kind, Block const& k) {
        for (int e = 0; e < elements_of(kind); ++e) {
          Element const of = elements[l](list_at(kind, e), written[list_at(kind, e)]++);
          for (int b = 0; b < of.rows; ++b) p[of.row + b] = k.p[e + b][l];
        }
      });
      tell_sweeps(rows, solution, w, sweeps[l]);
      solution.goes_on(numbers[l]) = !(more && active[l]) ? is_done : leaping[l] ? still_leaps : only_sweeps;
    }
  }

 private:
  LeapSums<T> leap_sums(Blocks const& blocks, T const* z, T const* z_before) const {
    T const zero(R(0));
    LeapSums<T> s{zero, zero, zero, zero, zero};
    for (int i = 0; i < blocks.dofs; ++i) s.add_dof(z[i], z[i] - z_before[i]);
    blocks.each([&](auto kind, Block const& k) {
      for (int b = 0; b < rows_of(kind); ++b) s.add_row(k.p[b], k.d[b], k.compliance[b], k.bias[b], k.law.inverse_diagonal[b]);
    });
    return s;
  }
  MixingSums<T> mixing_sums(Blocks const& blocks, Mask<R, W> const& both) const {
    T const zero(R(0));
    MixingSums<T> s{zero, zero, zero, zero, zero};
    blocks.each([&](auto kind, Block const& k) {
      for (int b = 0; b < rows_of(kind); ++b) s.add_row(k.diagonal[b], k.d[b], k.d_before[1][b], k.d_before[0][b], both);
    });
    return s;
  }
  /// Keeps p and d of the last sweep; p of some islands goes on to where a leap or a mixture leads.
  void go_on(Blocks const& blocks, int side, Mask<R, W> const& leapt, Leap<T> const& leap, Mask<R, W> const& mixed, Mixing<T> const& mixing,
             Mask<R, W> const& both) const {
    bool const leaps = any(leapt), mixes = any(mixed);
    blocks.each([&](auto kind, Block& k) {
      for (int b = 0; b < rows_of(kind); ++b) {
        T const p = k.p[b];
        if (leaps) k.p[b] = select(leapt, leap.of(p, k.d[b]), p);
        if (mixes) k.p[b] = select(mixed, mixing.of(p, k.before[1][b], k.before[0][b], both), k.p[b]);
        k.before[side][b] = p;
        k.d_before[side][b] = k.d[b];
      }
    });
  }
  /// Leaves p of some islands where it was before it leapt or was mixed.
  void take_back(Blocks const& blocks, T* z, T* z_before, Mask<R, W> const& some) const {
    blocks.each([&](auto kind, Block& k) {
      for (int b = 0; b < rows_of(kind); ++b) k.p[b] = select(some, k.before[0][b], k.p[b]);
    });
    sum_impulses(blocks, z, z_before, some);
  }
  /// z = Y^T p of some islands. z_before is lost.
  void sum_impulses(Blocks const& blocks, T* z, T* z_before, Mask<R, W> const& some) const {
    for (int i = 0; i < (blocks.dofs + 3) / 4 * 4; ++i) z_before[i] = T(R(0));
    blocks.each([&](auto kind, Block const& k) { push<kind>(k, z_before, k.p); });
    for (int i = 0; i < blocks.dofs; ++i) z[i] = select(some, z_before[i], z[i]);
  }

  void find_elements(Elements& found, Island const& island, int (&most)[3]) const {
    int singles = 0, others = 0;
    for (int k = 0; k < island.elements; ++k) {
      int const n = island.rows_of(rows, k), r = island.begin(k);
      if (n == 0) continue;
      if (n == 1) {
        found.single[singles++] = r;
      } else {
        found.first[others] = r;
        found.rows[others++] = static_cast<signed char>(n);
      }
    }
    found.count[turn] = std::min(singles, others);
    found.count[several] = others;
    found.count[rest] = singles - found.count[turn];
    for (int list : {turn, several, rest}) most[list] = std::max(most[list], found.count[list]);
  }

  /// Takes the next elements of all islands into `k`, after those that are `taken`; their entries go to Y, which moves on. Entries come by
  /// whole groups of four dofs, so that the order in which an island's are summed does not depend on what the others have.
  template <int kind>
  void widen(Block& k, T*& Y, int const (&taken)[3], Island const (&islands)[W], Elements const (&elements)[W], int parity) const {
    constexpr int B = rows_of(kind), E = elements_of(kind), each = kind == by_fours ? E : 1;
    int row_of[W][B];  // in the pool, -1: none
    std::uint32_t used = 0;
    for (int l = 0; l < W; ++l) {
      int const start = islands[l].first_row;
      unrolled<E>([&](auto e) {
        constexpr int list = list_at(kind, e), places = places_of(list);
        int const at = taken[list] + (kind == by_fours ? int(e) : 0);
        Element const own = elements[l](list, at), next = elements[l](list, at + each);
        if (next.rows > 0) prefetch(&rows.row(start + next.row), places * sizeof(Row<R>));  // more streams than the processor follows
        for (int b = 0; b < places; ++b) {
          row_of[l][e + b] = b < own.rows ? start + own.row + b : -1;
          if (b >= own.rows) continue;
          Row<R> const& row = rows.row(start + own.row + b);
          int entries = 0;
          for (int s = 0; s < 2 && row.segment[s].count > 0; ++s) {
            used |= groups_of(row.segment[s], islands[l].first_dof(rows, row.segment[s]));
            entries += row.segment[s].count;
          }
          prefetch(rows.Y.data() + row.first_entry, entries * sizeof(R));
        }
      });
    }
    k.Y = Y;
    k.groups = 0;
    for (std::uint32_t bits = used; bits != 0; bits &= bits - 1) k.dof[k.groups++] = short(4 * Kokkos::countr_zero(bits));
    T* const end = Y + B * 4 * k.groups;
    for (T* y = Y; y != end; ++y) *y = T(R(0));
    for (int b = 0; b < B; ++b) {
      int of_lane[W];
      for (int l = 0; l < W; ++l) of_lane[l] = row_of[l][b];
      take_law(k, b, of_lane, parity);
    }
    for (int b = 0; b < B; ++b)
      for (int l = 0; l < W; ++l) {
        if constexpr (W % 4 == 0)
          if (l % 4 == 0 && alike(islands, row_of, l, b)) {
            place_entries<4>(islands, row_of, l, b, used, Y);
            l += 3;
            continue;
          }
        if (row_of[l][b] >= 0) place_entries<1>(islands, row_of, l, b, used, Y);
      }
    for (int b = 0, at = 0; b < B; ++b)
      for (int a = 0; a < b; ++a) {
        T sum(R(0));
        for (T const* y = Y; y != end; y += B) sum = fma(y[a], y[b], sum);
        k.product[at++] = sum;
      }
    Y = end;
  }
  /// Whether rows b of four islands, from number l of the pack on, have the same dofs.
  template <int B>
  bool alike(Island const (&islands)[W], int const (&row_of)[W][B], int l, int b) const {
    for (int i = 0; i < 4; ++i)
      if (row_of[l + i][b] < 0) return false;
    auto const& segment = rows.row(row_of[l][b]).segment;
    for (int i = 1; i < 4; ++i) {
      auto const& other = rows.row(row_of[l + i][b]).segment;
      for (int s = 0; s < 2; ++s) {
        if (other[s].count != segment[s].count || other[s].list != segment[s].list) return false;
        if (segment[s].count > 0 && islands[l + i].first_dof(rows, other[s]) != islands[l].first_dof(rows, segment[s])) return false;
      }
    }
    return true;
  }
  /// Entries of rows b of one island, or of four that are alike.
  template <int count, int B>
  void place_entries(Island const (&islands)[W], int const (&row_of)[W][B], int l, int b, std::uint32_t used, T* Y) const {
    R const* y[count];
    for (int k = 0; k < count; ++k) y[k] = rows.Y.data() + rows.row(row_of[l + k][b]).first_entry;
    R* const entries = reinterpret_cast<R*>(Y + b) + l;
    auto const place_of = [&](int dof) {  // after the groups before
      return entries + B * W * (4 * Kokkos::popcount(used & ((std::uint32_t(1) << (dof >> 2)) - 1)) + (dof & 3));
    };
    Row<R> const& row = rows.row(row_of[l][b]);
    for (int s = 0; s < 2 && row.segment[s].count > 0; ++s) {
      RowSegment const& segment = row.segment[s];
      int const* const list = list_of(rows, segment);
      int const first = islands[l].first_dof(rows, segment);
      if (list)
        each_entry<count>(segment.count, y, [&](int i) { return place_of(first + list[i]); });
      else  // consecutive dofs: all of their groups are there
        each_entry<count>(segment.count, y, [to = place_of(first)](int i) { return to + B * W * i; });
    }
  }
  /// The next n entries of each island to place_of(0), place_of(1), ...
  template <int count, class F>
  static void each_entry(int n, R const* (&y)[count], F const& place_of) {
    int i = 0;
    if constexpr (count == 4)
      for (; i + 4 <= n; i += 4) {
        transpose4(y, {place_of(i), place_of(i + 1), place_of(i + 2), place_of(i + 3)});
        for (R const*& from : y) from += 4;
      }
    for (; i < n; ++i) {
      R* const to = place_of(i);
      for (int k = 0; k < count; ++k) to[k] = *y[k]++;
    }
  }
  /// What is known of row b of all islands, but its entries. The numbers of a row lie side by side: they come at once, and are transposed.
  void take_law(Block& k, int b, int const (&row_of)[W], int parity) const {
    constexpr int has = 8;  // six numbers of the row, its impulse, and the row that its friction names
    alignas(T) R numbers[W][has];
    unsigned normals = 0, ellipses = 0, lines = 0;
    T with_next(R(0));
    for (int l = 0; l < W; ++l) {
      if (row_of[l] < 0) {
        R const none[has] = {R(0), R(0), R(0), R(0), R(0), R(-1), R(0), R(0)};
        std::memcpy(numbers[l], none, sizeof none);
        continue;
      }
      Row<R> const& row = rows.row(row_of[l]);
      static_assert(offsetof(Row<R>, mu) == offsetof(Row<R>, bias) + 5 * sizeof(R), "bias to mu lie side by side");
      std::memcpy(numbers[l], reinterpret_cast<char const*>(&row) + offsetof(Row<R>, bias), 6 * sizeof(R));
      numbers[l][6] = impulses.p[parity](row_of[l]);
      numbers[l][7] = R(row.friction_of);
      normals |= row.friction_of < 0 ? 0u : 1u << row.friction_of;
      (row.with_next ? ellipses : lines) += 1;
      with_next.set(l, R(row.with_next));
    }
    T out[has];
    for (int l = 0; l < W; ++l)
      for (int i = 0; i < has; ++i) reinterpret_cast<R*>(out)[i * W + l] = numbers[l][i];
    k.bias[b] = out[0];
    k.compliance[b] = out[1];
    k.law.inverse_diagonal[b] = out[2];
    auto const movable = out[2] > T(R(0));
    k.diagonal[b] = select(movable, T(R(1)) / select(movable, out[2], T(R(1))), T(R(0)));
    k.law.lower[b] = out[3];
    k.law.upper[b] = out[4];
    k.law.mu[b] = out[5];
    k.p[b] = out[6];
    k.law.normal[b] = out[7];
    k.law.normals[b] = static_cast<unsigned char>(normals);
    k.law.with_next[b] = with_next;
    k.law.ellipse[b] = ellipses == 0 ? InLanes::none : lines > 0 ? InLanes::some : InLanes::all;
  }
  /// One pass over a block: rates, projections, z.
  /// @param change  in, out: largest change of a rate;   @param misses  in, out: sum d^2 (|Y|^2 + C)
  /// @param work    in, out, or null: what the pass has done (leap.hpp)
  template <int kind>
  static void pass(Block& k, T* z, Mask<R, W> const& active, T const& relaxation, T& change, T& misses, SweepWork<T>* work) {
    constexpr int B = rows_of(kind);
    T w[B], p[B], d[B], before[B];
    rates<kind>(k, z, w);
    unrolled<B>([&](auto b) {
      p[b] = k.p[b];
      before[b] = w[b];
    });
    project<kind>(k, relaxation, w, p, d, std::make_integer_sequence<int, elements_of(kind)>{});
    unrolled<B>([&](auto b) {
      d[b] = select(active, d[b], T(R(0)));
      k.p[b] = select(active, p[b], k.p[b]);  // not p + d, which rounding may take beyond its bound
      T const of_row = d[b] * k.diagonal[b];
      k.d[b] = d[b];
      change = max(change, abs(of_row));
      misses = fma(d[b], of_row, misses);
      if (work == nullptr) return;
      unrolled<b>([&](auto a) { before[b] = fma(k.product[couplings_of(b) + a], d[a], before[b]); });
      T together(R(0));
      if constexpr (b > 0) together = k.law.with_next[b - 1] * (k.product[couplings_of(b) + b - 1] * d[b - 1]);
      work->template add_row<R>(p[b], d[b], before[b], of_row, k.law.inverse_diagonal[b], together);
    });
    push<kind>(k, z, d);
  }
  /// w = Y z + C p + b
  template <int kind>
  static void rates(Block const& k, T const* z, T* w) {
    constexpr int B = rows_of(kind);
    T sum[sums * B];  // one sum a row would wait for itself
    unrolled<sums * B>([&](auto i) { sum[i] = T(R(0)); });
    T const* y = k.Y;
    for (int g = 0; g < k.groups; ++g, y += 4 * B) {
      T const* const of_dof = z + k.dof[g];
      unrolled<4>([&](auto i) {
        T const x = of_dof[i];
        unrolled<B>([&](auto b) {
          constexpr int at = i % sums * B + b;
          sum[at] = fma(y[B * i + b], x, sum[at]);
        });
      });
    }
    unrolled<B>([&](auto b) {
      T total = sum[b] + sum[B + b];
      if constexpr (sums == 4) total = total + (sum[2 * B + b] + sum[3 * B + b]);
      w[b] = total + fma(k.compliance[b], k.p[b], k.bias[b]);
    });
  }
  /// Y_b . Y_a of the element that begins at place `first`.
  struct Coupling {
    Block const& k;
    int first;
    KOKKOS_FORCEINLINE_FUNCTION T operator()(int b, int a) const { return k.product[couplings_of(first + b) + first + a]; }
  };
  /// Elements e... one after the other.
  template <int kind, int... e>
  KOKKOS_FORCEINLINE_FUNCTION static void project(Block const& k, T const& relaxation, T* w, T* p, T* d, std::integer_sequence<int, e...>) {
    (project_one<places_of(list_at(kind, e)), e>(k, relaxation, w, p, d, std::make_integer_sequence<int, e>{}), ...);
  }
  /// That at place `first`, after the rows a... before it.
  template <int places, int first, int... a>
  KOKKOS_FORCEINLINE_FUNCTION static void project_one(Block const& k, T const& relaxation, T* w, T* p, T* d,
                                                      std::integer_sequence<int, a...>) {
    unrolled<places>([&](auto at) {
      [[maybe_unused]] constexpr int b = first + at;
      ((w[b] = fma(k.product[couplings_of(b) + a], d[a], w[b])), ...);
    });
    project_element<places>(k.law, first, Coupling{k, first}, relaxation, w, p, d);
  }
  /// z += Y^T d
  template <int kind>
  static void push(Block const& k, T* z, T const* d) {
    constexpr int B = rows_of(kind);
    T const* y = k.Y;
    for (int g = 0; g < k.groups; ++g)
      for (int i = 0; i < 4; ++i, y += B) {
        T x = z[k.dof[g] + i];
        unrolled<B>([&](auto b) { x = fma(y[b], d[b], x); });
        z[k.dof[g] + i] = x;
      }
  }
  /// Bits of the groups of four dofs that a segment has entries in, whose first dof is number `first`.
  std::uint32_t groups_of(RowSegment const& s, int first) const {
    std::uint32_t bits = 0;
    if (int const* const list = list_of(rows, s)) {
      for (int i = 0; i < s.count; ++i) bits |= std::uint32_t(1) << ((first + list[i]) >> 2);
    } else if (s.count > 0) {
      int const low = first >> 2, high = (first + s.count - 1) >> 2;
      bits = std::uint32_t(((std::uint64_t(1) << (high - low + 1)) - 1) << low);
    }
    return bits;
  }
};

/// Islands that several rounds of sweeps take, in packs: those that are listed for a round.
template <class R, class Mem>
struct PgsLockstep {
  static constexpr int W = native_width<R>;
  using memory_space = Mem;
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Solution<R, Mem> solution;
  PgsOptions options;
  int begin, side, count;  // sweeps of the rounds before; which list, and how many stand there
  void operator()(int pack, int thread) const {
    int numbers[W], most = 0;
    for (int l = 0; l < W; ++l) {
      int const at = pack * W + l;
      numbers[l] = at < count ? solution.listed(side, at) : -1;
      if (numbers[l] >= 0) most = std::max(most, rows.largest_element(numbers[l] / islands_of_world(rows)));
    }
    if (most <= lockstep_few_rows)
      LockstepPack<R, Mem, lockstep_few_rows>{rows, impulses, solution, options}(numbers, begin, thread);
    else
      LockstepPack<R, Mem, lockstep_rows>{rows, impulses, solution, options}(numbers, begin, thread);
  }
};

template <class Exec, class Solver>
struct LockstepLoop {
  Solver solver;
  ThreadRoom<Exec> room;
  void operator()(int pack) const {
    room([&](int thread) { solver(pack, thread); });
  }
};

/// Sweeps islands that are listed. A pack goes on until the slowest of its islands rests, so after a round those that still move
/// are packed together, and taken from the pool anew: what that costs is as much as ten sweeps. An island's z is summed anew then, Y^T p,
/// whatever its neighbours do.
template <class Exec, class R, class Mem>
void launch_lockstep(Exec const& exec, Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses, Solution<R, Mem> const& solution,
                     PgsOptions const& options, int count) {
  using Solver = PgsLockstep<R, Mem>;
  ThreadRoom<Exec> const room("gsp::pgs", exec, solution.thread_rooms);
  int side = 0;
  for (int begin = 0, sweep = 0; sweep < options.iterations && count > 0; ++sweep) {
    bool const last = sweep + 1 == options.iterations;
    if (!last && !begins_anew(sweep, options)) continue;
    if (begin > 0) {
      count = list_going(exec, solution, side, count);
      side = 1 - side;
    }
    // Packs of few rows come last: who has done with one takes the next.
    using Packs = Kokkos::RangePolicy<Exec, Kokkos::Schedule<Kokkos::Dynamic>>;
    Kokkos::parallel_for("gsp::solver::pgs_lockstep", Packs(exec, 0, (count + Solver::W - 1) / Solver::W, Kokkos::ChunkSize(1)),
                         LockstepLoop<Exec, Solver>{{rows, impulses, solution, options, begin, side, count}, room});
    begin = sweep + 1;
  }
}

}  // namespace gsp::detail
