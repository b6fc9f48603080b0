#pragma once
#include <gsp/constraint/islands.hpp>
#include <gsp/math/pack.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/solver/detail/newton_problem.hpp>
#include <gsp/solver/detail/newton_tiles.hpp>

/// What `newton` does with an island that no near memory holds: its rows stay sparse, where they lie. H lies in tiles (newton_tiles.hpp),
/// in near memory where that holds them, and is made of some rows at a time:
///   Y^T B Y   of rows in full over the fours of dofs that they touch, in near memory. On a GPU a thread sums up a tile over the rows that
///             touch both of its fours; on a host one thread adds all tiles of a row.
///   Y^T p     On a GPU a thread sums up a dof over the rows of its tree, which are listed once an island; on a host one goes through them.
namespace gsp::detail {

/// Numbers in the memory of a thread of a host, or of a block of a GPU, for islands of up to nv dofs.
struct NewtonSparseSizes {
  static constexpr int T = newton_tile, partial = 1024;
  static constexpr int most_dofs = 32768;                // tiles and their numbers are counted by an int
  static constexpr std::int64_t most_numbers = 1 << 24;  // GPUs: of all blocks, where these are more than worlds
  static KOKKOS_FORCEINLINE_FUNCTION int fours(int dofs) { return (dofs + T - 1) / T; }
  static KOKKOS_FORCEINLINE_FUNCTION std::int64_t matrix(int dofs) {
    return (tiled_numbers(fours(dofs), true) + 15) / 16 * 16;  // what comes after it is aligned
  }
  /// Of rows in full, of up to `wide` of so many fours, and of which of them touch each.
  static KOKKOS_FORCEINLINE_FUNCTION std::int64_t staged(int rows, int wide, int fours) {
    return std::int64_t(rows) * (T * wide + 8) + std::int64_t(fours) * words(rows);
  }
  static KOKKOS_FORCEINLINE_FUNCTION int words(int rows) { return (rows + 31) / 32; }
  /// A number of rows that `numbers` are enough for.
  static KOKKOS_FORCEINLINE_FUNCTION std::int64_t rows_in(std::int64_t numbers, int wide, int fours) {
    return (numbers - fours) / (T * wide + 8 + words(fours));
  }
  /// Fours that a row touches, whose trees have up to so many dofs.
  static KOKKOS_FORCEINLINE_FUNCTION int widest(int dofs_of_tree) { return 2 * (dofs_of_tree / T + 2); }
  static KOKKOS_FORCEINLINE_FUNCTION std::int64_t all(int nv) {
    std::int64_t const numbers = matrix(nv) + 2 * T * fours(nv) + partial + 3 * (nv + 1) + staged(most_element_rows, widest(nv), fours(nv));
    return (numbers + 15) / 16 * 16;
  }
};

/// For newton_until_rest. All threads of an island call all members together.
/// @tparam Threads  SerialWorld, or what has its sync, single, one, each, each_warp, sum and list
template <class R, class Mem, class Threads>
class NewtonSparse {
  static constexpr int N = most_element_rows, T = newton_tile;
  using Factor = TiledCholesky<R, Threads>;
  static constexpr bool one_thread = Factor::one_thread;
  using Four = typename Factor::Four;
  using Problem = NewtonProblem<R, Mem>;
  using Sizes = NewtonSparseSizes;

 public:
  /// @param far   Sizes::all(nv) numbers;   @param near, near_count  near memory, and how many numbers it has; both aligned for a Four
  KOKKOS_FORCEINLINE_FUNCTION NewtonSparse(Problem const& problem, Threads const& threads, IslandRows const& island, R* far, R* near,
                                           std::int64_t near_count)
      : k_(problem),
        threads_(threads),
        l_(problem.lists_of(threads.rank, island)),
        m_(island.count),
        n_(T * Sizes::fours(island.dofs)),
        matrix_is_near_(Sizes::matrix(island.dofs) + near_count / least_stage <= near_count),
        H_(threads, n_ / T, matrix_is_near_ ? near : far),
        room_(H_.diagonal()),
        z_(far + (matrix_is_near_ ? 0 : Sizes::matrix(island.dofs))),
        d_(z_ + n_),
        partial_(d_ + n_) {
    R* const far_stage = partial_ + Sizes::partial;
    first_ = reinterpret_cast<int*>(far_stage + Sizes::staged(N, Sizes::widest(island.dofs), n_ / T));
    begin_ = first_ + island.dofs + 1;
    tree_of_ = begin_ + island.dofs + 1;
    by_tree_ = one_thread ? nullptr
                          : k_.by_tree.data() + 2 * (island.rows ? island.rows - k_.rows.islands.elements.data() : std::int64_t(l_.first));
    w_ = k_.rate.data() + l_.first;
    change_ = k_.rate_change.data() + l_.first;
    p_ = k_.impulses.p[k_.impulses.parity()].data() + l_.first;
    find_trees();
    R* const left = near + (matrix_is_near_ ? Sizes::matrix(island.dofs) : 0);
    std::int64_t const fit = Sizes::rows_in(near + near_count - left, wide_, n_ / T);
    stage_ = fit >= N ? left : far_stage;
    rows_at_once_ = fit >= N ? int(Kokkos::min(fit, std::int64_t(most_at_once))) : N;
    curve_ = stage_ + std::int64_t(rows_at_once_) * T * wide_;
    ranges_ = reinterpret_cast<Ranges*>(curve_ + 4 * rows_at_once_);
    touching_ = reinterpret_cast<unsigned*>(ranges_ + rows_at_once_);
    unit_rows_ = reinterpret_cast<signed char*>(touching_ + n_ / T * Sizes::words(rows_at_once_));
  }

  /// z = Y^T p of the impulses given, or 0 where that costs less; w = Y z + b.
  KOKKOS_FORCEINLINE_FUNCTION void begin() {
    set_least();
    threads_.each(n_, [&](int i) { z_[i] = R(0); });
    each_row([&](int r) { w_[r] = l_.row[r].bias; });
    if (!k_.warm) return;
    R const none = cost();
    pull(z_);
    each_row([&](int r) { w_[r] = row_dot(r, z_) + l_.row[r].bias; });
    R const given = cost() + R(0.5) * dot(z_, z_);
    if (given < none) return;
    threads_.each(n_, [&](int i) { z_[i] = R(0); });
    each_row([&](int r) { w_[r] = l_.row[r].bias; });
  }
  KOKKOS_FORCEINLINE_FUNCTION R gradient() {
    set_impulses();
    pull(d_);
    threads_.each(n_, [&](int i) { d_[i] -= z_[i]; });
    return dot(d_, d_);
  }
  KOKKOS_FORCEINLINE_FUNCTION R solve() {
    assemble();
    if (!H_.factor(d_, R(newton_pivot))) {
      gradient();  // d anew
      factor_rows();
      H_.forward(d_);
    }
    R const decrement = dot(d_, d_);
    H_.back(d_);
    return decrement;
  }
  KOKKOS_FORCEINLINE_FUNCTION R size() const { return dot(z_, z_); }
  /// | |Y^T| |p| |^2
  KOKKOS_FORCEINLINE_FUNCTION R summed() const {
    sum_over_rows(room_, [&](R y, int r) { return abs(y * p_[r]); });
    return dot(room_, room_);
  }
  KOKKOS_FORCEINLINE_FUNCTION void look_along() {
    each_row([&](int r) { change_[r] = row_dot(r, d_); });
    zd_ = dot(z_, d_);
    dd_ = dot(d_, d_);
  }
  KOKKOS_FORCEINLINE_FUNCTION R slope(R alpha) const {
    return zd_ + alpha * dd_ - threads_.template sum<R>(m_, [&](int k) {
      int const r = l_.island.row(k), n = l_.element_rows[r];
      return n == 0 ? R(0) : soft_pull(soft_element(l_.row + r, n, l_.least + r), w_ + r, change_ + r, alpha);
    });
  }
  KOKKOS_FORCEINLINE_FUNCTION void go(R alpha) {
    threads_.each(n_, [&](int i) { z_[i] = fma(alpha, d_[i], z_[i]); });
    each_row([&](int r) { w_[r] = fma(alpha, change_[r], w_[r]); });
  }
  /// z and p(w) to where they belong. Returns the largest change of a rate, where it is asked for. z stays what it is: in Y^T p what stiff
  /// rows bear against each other leaves |Y w / C| epsilon, which H has divided by Y^2 / C in z.
  KOKKOS_FORCEINLINE_FUNCTION R write() {
    R* const z = k_.solution.z.data() + std::int64_t(threads_.rank) * k_.rows.nv;
    threads_.each(l_.island.dofs, [&](int i) { z[l_.island.dof(i)] = z_[i]; });
    set_impulses();
    if (!k_.residual) return R(0);
    pull(d_);
    each_row([&](int r) { change_[r] = abs(row_dot(r, d_) + l_.row[r].bias - w_[r]); });
    R worst(0);
    for (int k = 0; k < m_; ++k) worst = max_or_nan(worst, change_[l_.island.row(k)]);
    threads_.sync();
    return worst;
  }

 private:
  /// The fours that a row touches.
  struct alignas(8) Ranges {
    struct Range {
      short begin, count;
      KOKKOS_FORCEINLINE_FUNCTION bool has(int i) const { return unsigned(i - begin) < unsigned(count); }
    } of[2];
  };
  static constexpr int most_at_once = 8192;  // rows
  static constexpr int least_stage = 16;     // what H leaves of near memory is no less than one part of so many

  KOKKOS_FORCEINLINE_FUNCTION R dot(R const* a, R const* b) const {
    return threads_.template sum<R>(n_, [&](int i) { return a[i] * b[i]; });
  }
  /// f(r) for the rows of the island, a row a thread.
  template <class F>
  KOKKOS_FORCEINLINE_FUNCTION void each_row(F const& f) const {
    threads_.each(m_, [&](int k) { f(l_.island.row(k)); });
  }
  /// f(place, entry) of row r.
  template <class F>
  KOKKOS_FORCEINLINE_FUNCTION void each_entry(int r, F const& f) const {
    Row<R> const& row = l_.row[r];
    typename Problem::Shifts const shifts(k_, l_, row);
    R const* y = k_.rows.Y.data() + row.first_entry;
    for (int s = 0; s < 2; ++s) {
      RowSegment const& segment = row.segment[s];
      int const from = segment.dof0 + (s == 0 ? shifts.first : shifts.second);
      int const* const list = list_of(segment);
      for (int e = 0; e < segment.count; ++e) f(from + (list ? list[e] : e), y[e]);
      y += segment.count;
    }
  }
  KOKKOS_FORCEINLINE_FUNCTION int const* list_of(RowSegment const& s) const {
    return s.list < 0 ? nullptr : k_.rows.dof_lists.data() + s.list;
  }
  KOKKOS_FORCEINLINE_FUNCTION R row_dot(int r, R const* x) const {
    R sum(0);
    each_entry(r, [&](int i, R y) { sum = fma(y, x[i], sum); });
    return sum;
  }

  /// first_: where the dofs of each tree begin, in the order of the island; GPUs: its rows are by_tree_[begin_[s]] ... , dof i is of tree
  /// tree_of_[i].
  KOKKOS_FORCEINLINE_FUNCTION void find_trees() {
    int const dofs = l_.island.dofs;
    auto const tree = [&](int i) { return k_.rows.islands.dof_tree(l_.island.dof(i)); };
    trees_ = threads_.list(dofs, first_, [&](int i) { return i == 0 || tree(i) != tree(i - 1); });
    threads_.single([&] { first_[trees_] = dofs; });
    int most = 0;
    for (int s = 0; s < trees_; ++s) most = Kokkos::max(most, first_[s + 1] - first_[s]);
    wide_ = Sizes::widest(most);
    if constexpr (!one_thread) {
      auto const of_tree = [&](int s) {
        return [this, dof0 = l_.island.dof(first_[s])](int k) {
          RowSegment const(&segment)[2] = l_.row[l_.island.row(k)].segment;
          return (segment[0].count > 0 && segment[0].dof0 == dof0) || (segment[1].count > 0 && segment[1].dof0 == dof0);
        };
      };
      threads_.each_warp(trees_, [&](auto const& warp, int s) {
        auto const is = of_tree(s);
        int const count = warp.template sum<int>(m_, [&](int k) { return is(k) ? 1 : 0; });
        warp.single([&] { begin_[s + 1] = count; });
        warp.each(first_[s + 1] - first_[s], [&](int i) { tree_of_[first_[s] + i] = s; });
      });
      threads_.single([&] {
        begin_[0] = 0;
        for (int s = 0; s < trees_; ++s) begin_[s + 1] += begin_[s];
      });
      threads_.each_warp(trees_, [&](auto const& warp, int s) {
        int* const list = by_tree_ + begin_[s];
        int const count = warp.list(m_, list, of_tree(s));
        warp.sync();
        warp.each(count, [&](int i) { list[i] = l_.island.row(list[i]); });
      });
    }
  }
  /// to_i = the sum (or the most) of `of(Y_ri, r)` over the rows.
  template <bool most = false, class Of>
  KOKKOS_FORCEINLINE_FUNCTION void sum_over_rows(R* to, Of const& of) const {
    auto const join = [](R a, R b) { return most ? max(a, b) : a + b; };
    if constexpr (one_thread) {
      for (int i = 0; i < n_; ++i) to[i] = R(0);
      for (int k = 0; k < m_; ++k) {
        int const r = l_.island.row(k);
        each_entry(r, [&](int i, R y) { to[i] = join(to[i], of(y, r)); });
      }
    } else {
      int const dofs = l_.island.dofs, parts = dofs < Sizes::partial ? Sizes::partial / dofs : 1;
      R* const sums = parts > 1 ? partial_ : to;
      threads_.each(parts * dofs, [&](int q) {
        int const i = q % dofs, part = q / dofs, s = tree_of_[i], local = i - first_[s], dof0 = l_.island.dof(first_[s]);
        int const begin = begin_[s], count = begin_[s + 1] - begin, share = (count + parts - 1) / parts;
        int const end = Kokkos::min((part + 1) * share, count);
        R sum(0);
        for (int k = part * share; k < end; ++k) {
          int const r = by_tree_[begin + k];
          sum = join(sum, of(entry_of(l_.row[r], dof0, local), r));
        }
        sums[q] = sum;
      });
      threads_.each(n_, [&](int i) {
        if (i >= dofs)
          to[i] = R(0);
        else if (parts > 1) {
          R sum(0);
          for (int part = 0; part < parts; ++part) sum = join(sum, sums[part * dofs + i]);
          to[i] = sum;
        }
      });
    }
  }
  /// Y of a row on dof number `local` of the tree that begins at dof0.
  KOKKOS_FORCEINLINE_FUNCTION R entry_of(Row<R> const& row, int dof0, int local) const {
    bool const second = !(row.segment[0].count > 0 && row.segment[0].dof0 == dof0);
    RowSegment const& segment = row.segment[second ? 1 : 0];
    int const* const list = list_of(segment);
    int at = local;
    if (list) {  // it ascends
      at = 0;
      for (int end = segment.count; at < end;) {
        int const middle = (at + end) / 2;
        if (list[middle] < local)
          at = middle + 1;
        else
          end = middle;
      }
    }
    if (at >= segment.count || (list && list[at] != local)) return R(0);
    return k_.rows.Y(row.first_entry + (second ? row.segment[0].count : 0) + at);
  }
  KOKKOS_FORCEINLINE_FUNCTION void pull(R* to) const {
    sum_over_rows(to, [&](R y, int r) { return y * p_[r]; });
  }

  /// The least compliance of each row (least_softness).
  KOKKOS_FORCEINLINE_FUNCTION void set_least() {
    sum_over_rows<true>(room_, [&](R y, int) { return square(y); });
    each_row([&](int r) {
      R sum(0), own(0);
      each_entry(r, [&](int i, R y) {
        if (y != R(0)) sum += room_[i];
        own += square(y);
      });
      l_.least[r] = Problem::least_of(l_.row[r].compliance, sum, own);
    });
  }
  KOKKOS_FORCEINLINE_FUNCTION void set_impulses() {
    each_row([&](int r) {
      if (int const n = l_.element_rows[r]; n > 0) soft_impulses(soft_element(l_.row + r, n, l_.least + r), w_ + r, p_ + r);
    });
  }
  KOKKOS_FORCEINLINE_FUNCTION R cost() const {
    return threads_.template sum<R>(m_, [&](int k) {
      int const r = l_.island.row(k), n = l_.element_rows[r];
      if (n == 0) return R(0);
      SoftElement<R> const e = soft_element(l_.row + r, n, l_.least + r);
      R p[N];
      soft_impulses(e, w_ + r, p);
      return soft_cost(e, w_ + r, p);
    });
  }

  /// H = 1 + Y^T B Y
  KOKKOS_FORCEINLINE_FUNCTION void assemble() {
    H_.set_identity();
    for (int from = 0, end; from < m_; from = end) {
      end = Kokkos::min(from + rows_at_once_, m_);
      while (end < m_ && l_.element_rows[l_.island.row(end)] == 0) --end;  // whole elements
      int const count = end - from;
      threads_.each(count, [&](int q) { find_units(l_.island.row(from + q), q); });
      threads_.each_warp(count, [&](auto const& warp, int q) { stage(warp, l_.island.row(from + q), q); });
      if constexpr (one_thread) {
        for (int q = 0; q < count; ++q)
          if (unit_rows_[q] > 0) add_tiles(q);
      } else {
        int const words = Sizes::words(count);
        threads_.each(n_ / T * words, [&](int i) { touching_[i] = 0; });
        threads_.each(count, [&](int q) {
          for (int b = 0; b < unit_rows_[q]; ++b)
            for (auto const& range : ranges_[q + b].of)
              for (int i = range.begin; i < range.begin + range.count; ++i)
                Kokkos::atomic_or(&touching_[i * words + q / 32], 1u << (q % 32));
        });
        threads_.each(H_.tiles(), [&](int t) {
          int const i = Factor::row_of_triangle(t), j = t - i * (i + 1) / 2;
          Columns sum;
          bool any = false;
          for (int word = 0; word < words; ++word)
            for (unsigned both = touching_[i * words + word] & touching_[j * words + word]; both != 0; both &= both - 1) {
              add_unit(32 * word + Kokkos::Experimental::countr_zero_builtin(both), i, j, sum);
              any = true;
            }
          if (any) sum.add_to(H_.tile(i, j));
        });
      }
    }
    H_.keep_diagonal();
  }
  /// Units of Y^T B Y of the element that begins at row r and is staged from the q-th on: its rows one by one where B is diagonal, or all
  /// of them. unit_rows_ of each row: rows of the unit that begins there, 0: none; its B, the lower triangle, is the q-th of the curves.
  KOKKOS_FORCEINLINE_FUNCTION void find_units(int r, int q) const {
    int const n = l_.element_rows[r];
    R B[N][N];
    if (n == 0) return;
    bool const any = soft_curvature(soft_element(l_.row + r, n, l_.least + r), w_ + r, B);
    bool diagonal = true;
    for (int b = 0; b < n; ++b)
      for (int a = 0; a < b; ++a) diagonal = diagonal && B[b][a] == R(0);
    for (int b = 0; b < n; ++b) {
      unit_rows_[q + b] = static_cast<signed char>(!any ? 0 : diagonal ? B[b][b] != R(0) : b == 0 ? n : 0);
      if (diagonal) curve_[4 * (q + b)] = B[b][b];
    }
    if (diagonal) return;
    for (int b = 0; b < n; ++b)
      for (int a = 0; a <= b; ++a) curve_[4 * q + b * (b + 1) / 2 + a] = B[b][a];
  }
  KOKKOS_FORCEINLINE_FUNCTION R curvature(int q, int b, int a) const {
    return curve_[4 * q + (a <= b ? b * (b + 1) / 2 + a : a * (a + 1) / 2 + b)];
  }
  /// Row r in full, as the q-th: two ranges of fours, each with where it begins and how many there are.
  template <class Warp>
  KOKKOS_FORCEINLINE_FUNCTION void stage(Warp const& warp, int r, int q) const {
    Row<R> const& row = l_.row[r];
    typename Problem::Shifts const shifts(k_, l_, row);
    R* to = stage_ + std::int64_t(q) * T * wide_;
    warp.each(wide_, [&](int i) { Factor::four(to + T * i) = Four(R(0)); });
    warp.sync();
    R const* y = k_.rows.Y.data() + row.first_entry;
    for (int s = 0; s < 2; ++s) {
      RowSegment const& segment = row.segment[s];
      int const* const list = list_of(segment);
      int const from = segment.dof0 + (s == 0 ? shifts.first : shifts.second);
      auto const place = [&](int e) { return from + (list ? list[e] : e); };
      int const begin = segment.count > 0 ? place(0) / T : 0, count = segment.count > 0 ? place(segment.count - 1) / T + 1 - begin : 0;
      warp.single([&] { ranges_[q].of[s] = {static_cast<short>(begin), static_cast<short>(count)}; });
      warp.each(segment.count, [&](int e) { to[place(e) - T * begin] = y[e]; });
      to += T * count;
      y += segment.count;
    }
  }
  /// Whether the unit of the q-th row touches four i.
  KOKKOS_FORCEINLINE_FUNCTION bool touches(int q, int i) const {
    bool any = false;
    for (int b = 0; b < unit_rows_[q]; ++b) any = any || ranges_[q + b].of[0].has(i) || ranges_[q + b].of[1].has(i);
    return any;
  }
  /// Four i of the q-th row: where two trees share it, of both.
  KOKKOS_FORCEINLINE_FUNCTION Four four_of(int q, int i) const {
    Ranges const ranges = ranges_[q];
    R* const own = stage_ + std::int64_t(q) * T * wide_;
    Four x(R(0));
    if (ranges.of[0].has(i)) x = Factor::four(own + T * (i - ranges.of[0].begin));
    if (ranges.of[1].has(i)) x = x + Factor::four(own + T * (ranges.of[0].count + i - ranges.of[1].begin));
    return x;
  }
  /// Four columns by name: what is indexed, and handed on, hosts keep in memory.
  struct Columns {
    Four a = Four(R(0)), b = Four(R(0)), c = Four(R(0)), d = Four(R(0));
    KOKKOS_FORCEINLINE_FUNCTION void add(Four const& u, Four const& v) {
      static_assert(T == 4);
      a = fma(u, Four(v[0]), a);
      b = fma(u, Four(v[1]), b);
      c = fma(u, Four(v[2]), c);
      d = fma(u, Four(v[3]), d);
    }
    KOKKOS_FORCEINLINE_FUNCTION void add_to(R* tile) const {
      Factor::four(tile) = Factor::four(tile) + a;
      Factor::four(tile + T) = Factor::four(tile + T) + b;
      Factor::four(tile + 2 * T) = Factor::four(tile + 2 * T) + c;
      Factor::four(tile + 3 * T) = Factor::four(tile + 3 * T) + d;
    }
  };
  /// Tile (i, j) of Y^T B Y of the unit of the q-th row.
  KOKKOS_FORCEINLINE_FUNCTION void add_unit(int q, int i, int j, Columns& to) const {
    int const n = unit_rows_[q];
    if (n == 1) return to.add(Four(curve_[4 * q]) * four_of(q, i), four_of(q, j));
    for (int b = 0; b < n; ++b) {
      Four u(R(0));
      bool any = false;
      for (int a = 0; a < n; ++a) {
        R const B = curvature(q, b, a);
        if (B == R(0)) continue;
        u = fma(Four(B), four_of(q + a, i), u);
        any = true;
      }
      if (any) to.add(u, four_of(q + b, j));
    }
  }
  /// All tiles of it.
  KOKKOS_FORCEINLINE_FUNCTION void add_tiles(int q) const {
    int first = n_ / T, end = 0;
    for (int b = 0; b < unit_rows_[q]; ++b)
      for (auto const& range : ranges_[q + b].of) {
        if (range.count == 0) continue;
        first = Kokkos::min(first, int(range.begin));
        end = Kokkos::max(end, range.begin + range.count);
      }
    for (int i = first; i < end; ++i) {
      if (!touches(q, i)) continue;
      for (int j = first; j <= i; ++j) {
        if (!touches(q, j)) continue;
        Columns sum;
        add_unit(q, i, j, sum);
        sum.add_to(H_.tile(i, j));
      }
    }
  }

  /// L of 1 + Y^T B Y without the sum: from L = 1 each column u of Y^T G, B = G G^T, is turned into it by plane rotations,
  ///   (L u) Q = (L' 0),   L' L'^T = L L^T + u u^T
  /// Rounding is epsilon of |u| then, where the sum has epsilon of |u|^2. Twice the work and more, for the few islands that need it.
  KOKKOS_FORCEINLINE_FUNCTION void factor_rows() {
    threads_.sync();
    H_.set_identity();
    R* const u = room_;
    for (int k = 0, n; k < m_; k += n) {
      int const r = l_.island.row(k);
      n = l_.element_rows[r];
      R G[N][N];
      if (!soft_curvature(soft_element(l_.row + r, n, l_.least + r), w_ + r, G)) continue;
      for (int c = 0; c < n; ++c) {
        if (!Problem::next_column(G, n, c)) continue;
        threads_.each(n_, [&](int i) { u[i] = R(0); });
        for (int b = c; b < n; ++b) {
          Row<R> const& row = l_.row[r + b];
          typename Problem::Shifts const shifts(k_, l_, row);
          threads_.each(row.segment[0].count + row.segment[1].count, [&](int e) {
            R& to = u[k_.place_of(row, e, shifts)];
            to = fma(G[b][c], k_.rows.Y(row.first_entry + e), to);
          });
        }
        H_.add(u);
      }
    }
    threads_.sync();
    H_.invert_diagonal();
  }

  Problem const& k_;
  Threads threads_;
  typename Problem::Lists l_;
  int m_, n_;  // rows; dofs, filled up to fours
  bool matrix_is_near_;
  Factor H_;
  R *room_, *z_, *d_, *partial_;  // room: a number a dof; the diagonal of H until it is factored
  R *w_, *change_, *p_;           // of the world's rows
  int *first_, *begin_, *tree_of_, *by_tree_;
  int trees_, wide_, rows_at_once_;
  R *stage_, *curve_;
  Ranges* ranges_;          // of rows that are staged
  unsigned* touching_;      // GPUs: of each four, which units touch it, a bit each
  signed char* unit_rows_;  // rows of the unit that begins with a row that is staged; 0: none does
  R zd_, dd_;
};

}  // namespace gsp::detail
