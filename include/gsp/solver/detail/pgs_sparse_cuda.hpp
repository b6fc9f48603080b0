#pragma once
#include <cuda_pipeline.h>

#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/solver/detail/list_islands.hpp>
#include <gsp/solver/detail/pgs_delassus.hpp>
#include <gsp/solver/detail/sweep_until_rest.hpp>

/// Projected Gauss-Seidel on a GPU for islands that are not small (pgs_delassus.hpp): a block each, over their rows, which are copied to
/// shared memory. What is taken at a time, by a warp, is a unit: an element; or a run of rows that stand alone on the same tree (limits),
/// with nothing between them that touches it, whose rates are found at once and then change by each other's impulses:
///   w_b = Y_b z + sum_{a < b} (Y_b . Y_a) d_a + C p_b + bias_b     (z as before the run: row by row but for rounding)
/// Units that share no tree go at the same time. A sweep takes them level by level,
///   level(u) = 1 + the highest level of the units before u that touch a tree of u,
/// which is the sweep in its order. Heaps of humanoids have a third to a tenth as many levels as elements (docs/decisions/0034). What a
/// sweep waits for is the way through a level: memory that is near makes it short. Islands that do not fit are left to pgs_islands.hpp.
namespace gsp::detail {

// Islands of so many bytes have blocks of four warps, three or two of them in a multiprocessor of an H100; larger ones of sixteen, alone.
inline constexpr std::int64_t sparse_few_bytes = 48 * 1024, sparse_some_bytes = delassus_most_bytes;
inline constexpr int sparse_few_warps = 4, sparse_many_warps = 16;

/// Where the entries of a row stand, in the order of the sweeps.
struct SparsePlace {
  int pool, entry;             // its number in the world, counted from Rows::first; of Y
  unsigned short list, count;  // of the numbers of its dofs, and how many
};
/// A row alone in its element, of a tree of few dofs, may be of a run, whose entries are those of all dofs of the tree, row by row. A
/// contact pushes with one row, and two others in an ellipse hang on it.
enum SparseKind : unsigned char { sparse_single, sparse_run, sparse_contact, sparse_other };
struct alignas(16) SparseUnit {
  int entry;                   // of its first row; behind its rows' products Y_b . Y_a, at b (b - 1) / 2 + a
  unsigned short row, rows;    // the first, and how many
  unsigned short list, count;  // as those of the first row; of a run: the tree's first dof and number of dofs
  SparseKind kind;
};

/// An island, for sweep_until_rest. All threads of the block call all members together.
/// @tparam W  warps of the block
template <class R, class Mem, int W>
class SharedIsland {
 public:
  /// Sizes alone; `take`, where there is room for `bytes`.
  /// @param fit  runs have entries that are zero: they are made where there are so many bytes for it
  __device__ SharedIsland(PgsDelassus<R, Mem> const& solver, Island const& island, char* memory, std::int64_t fit)
      : k_(solver),
        island_(island),
        memory_(memory),
        first_(island.first_row),
        thread_(threadIdx.x),
        lane_(thread_ % 32),
        warp_(thread_ / 32) {
    for (int side = 0; side < 4; ++side) remembered_[side] = solver.impulses.mixing[side].data() + first_;
    measure();
    if (bytes() <= fit) return;
    runs_ = false;
    measure();
  }
  /// Shared memory that it takes.
  __device__ std::int64_t bytes() const {
    return sums_bytes + std::int64_t(count_) * (sizeof(DelassusLaw<R>) + 3 * sizeof(R) + sizeof(SparsePlace) + sizeof(DelassusRow)) +
           std::int64_t(island_.dofs) * sizeof(R) + room_of_Y() + std::int64_t(elements_) * (sizeof(SparseUnit) + sizeof(short)) +
           lists_ * std::int64_t(sizeof(short)) + 64;
  }
  /// Rows, entries and impulses, from the pools.
  __device__ void take() {
    char* memory = memory_ + sums_bytes;
    auto const next = [&](auto*& items, std::int64_t n) {
      using Item = std::remove_reference_t<decltype(*items)>;
      items = reinterpret_cast<Item*>(memory);
      memory += n * std::int64_t(sizeof(Item));
    };
    next(law_, count_);
    next(unit_, elements_);
    for (R** v : {&bias_, &compliance_, &d_}) next(*v, count_);
    next(z_, island_.dofs);
    Y_ = reinterpret_cast<R*>(memory);
    memory += room_of_Y();
    next(place_, count_);
    next(row_, count_);
    next(level_, elements_ + 2);
    next(dof_, lists_);
    read();
    sum();
  }

  __device__ SweepOutcome<R> sweep(bool tells) { return tells ? pass<true>() : pass<false>(); }
  __device__ void keep(bool leaps) {
    for (int k = thread_; leaps && k < island_.dofs; k += threads) k_.solution.z_before(island_.world, island_.dof(k)) = z_[k];
  }
  /// z = Y^T p
  __device__ void sum() {
    __syncthreads();
    for (int k = thread_; k < island_.dofs; k += threads) z_[k] = R(0);
    __syncthreads();
    for (int level = 0, k = warp_; level < levels_; ++level) {
      for (int const end = level_[level + 1]; k < end; k += W) {
        SparseUnit const unit = unit_[k];
        if (unit.kind == sparse_single) {
          push(place_[unit.row], law_[unit.row].p);
        } else if (unit.kind == sparse_other) {
          for (int b = 0; b < unit.rows; ++b) {
            push(place_[unit.row + b], law_[unit.row + b].p);
            __syncwarp();  // the next row may have other dofs
          }
        } else if (unit.kind == sparse_run) {
          if (lane_ < unit.count) {
            R z = z_[unit.list + lane_];
            for (int b = 0; b < unit.rows; ++b) z = fma(Y_[unit.entry + b * unit.count + lane_], law_[unit.row + b].p, z);
            z_[unit.list + lane_] = z;
          }
        } else {
          R const p0 = law_[unit.row].p, p1 = law_[unit.row + 1].p, p2 = law_[unit.row + 2].p, *const y = Y_ + unit.entry;
          for (int e = lane_; e < unit.count; e += 32) {
            R& z = z_[dof_[unit.list + e]];
            z = fma(y[2 * unit.count + e], p2, fma(y[unit.count + e], p1, fma(y[e], p0, z)));
          }
        }
      }
      __syncthreads();
    }
  }
  /// p as it was before it leapt or was mixed.
  __device__ void take_back() {
    for (int i = thread_; i < count_; i += threads) law_[i].p = remembered_[0][place_[i].pool];
    sum();
  }
  __device__ LeapSums<R> leap_sums() const {
    LeapSums<R> own{};
    for (int k = thread_; k < island_.dofs; k += threads) own.add_dof(z_[k], z_[k] - k_.solution.z_before(island_.world, island_.dof(k)));
    for (int i = thread_; i < count_; i += threads) own.add_row(law_[i].p, d_[i], compliance_[i], bias_[i], inverse(law_[i]));
    R sums[5] = {own.pp, own.pd, own.dd, own.bp, own.yy};
    sum_all(sums);
    return {sums[0], sums[1], sums[2], sums[3], sums[4]};
  }
  __device__ MixingSums<R> mixing_sums(bool both) const {
    MixingSums<R> own{};
    for (int i = thread_; i < count_; i += threads) {
      int const at = place_[i].pool;
      own.add_row(diagonal(law_[i]), d_[i], remembered_[3][at], remembered_[1][at], both);
    }
    R sums[5] = {own.dd11, own.dd12, own.dd22, own.df1, own.df2};
    sum_all(sums);
    return {sums[0], sums[1], sums[2], sums[3], sums[4]};
  }
  /// Keeps p and d of the last sweep; p goes on to where a leap or a mixture leads.
  __device__ void go_on(int side, Leap<R> const& leap, Mixing<R> const& mixing, bool both) {
    R *const p_before = side == 0 ? remembered_[0] : remembered_[2], *const d_before = side == 0 ? remembered_[1] : remembered_[3];
    for (int i = thread_; i < count_; i += threads) {
      int const at = place_[i].pool;
      R const now = law_[i].p;
      R p = now;
      if (leap.goes()) p = leap.of(now, d_[i]);
      if (mixing.helps()) p = mixing.of(now, remembered_[2][at], remembered_[0][at], both);
      p_before[at] = now;
      d_before[at] = d_[i];
      law_[i].p = p;
    }
  }
  /// p and z, to the pools.
  __device__ void write(int sweeps) {
    __syncthreads();
    R* const p = k_.impulses.p[k_.impulses.parity()].data() + first_;
    R* const z = k_.solution.z.data() + std::int64_t(island_.world) * k_.rows.nv;
    for (int i = thread_; i < count_; i += threads) p[place_[i].pool] = law_[i].p;
    for (int k = thread_; k < island_.dofs; k += threads) z[island_.dof(k)] = z_[k];
    if (thread_ == 0) tell_sweeps(k_.rows, k_.solution, island_.world, sweeps);
    __syncthreads();
  }

 private:
  static constexpr unsigned all = 0xffffffffu;
  static constexpr int threads = 32 * W;
  static constexpr int most_run = 8, most_run_dofs = 32;  // rows of a run; dofs of its tree, one a thread
  static constexpr int most_sums = 5,
                       sums_bytes = most_sums * sparse_many_warps * int(sizeof(double));  // for any W: by `bytes` one kernel takes it
  struct Sizes {
    int entries, lists;  // the former with products of rows; of a row of a run the most that it may have a part in
  };
  /// Entry k of the island's list while all is laid out: its element, and the unit that it comes to.
  struct Begin {
    int entries;
    unsigned short lists, rows, turn;  // turn: which it is in a sweep
    bool runs;
  };
  struct Turn {
    unsigned short first, second;  // trees that it touches, by their first dofs; then the unit that it belongs to, and its place there
    unsigned short k;
  };
  // In place of a tree: there is none; rows differ in theirs.
  static constexpr unsigned short no_tree = 0xffff, various = 0xfffe;
  struct Draft {                              // a unit
    unsigned short level, place, members, k;  // place: in its level; k: its first element
  };
  struct TreeState {
    unsigned short level, run;  // of the next unit that touches it; the run that goes on, or no_tree
  };
  static __device__ int smaller(int a, int b) { return a < b ? a : b; }
  __device__ std::int64_t room_of_Y() const {
    std::int64_t const entries = entries_ * std::int64_t(sizeof(R)),
                       drafts = island_.elements * std::int64_t(sizeof(Begin)) + elements_ * std::int64_t(sizeof(Turn) + sizeof(Draft)) + 8;
    return ((entries > drafts ? entries : drafts) + 7) / 8 * 8;
  }
  /// x of all warps, once they have found theirs.
  template <class T, int N, class Add>
  __device__ void join_warps(T (&x)[N], Add const& add) const {
    static_assert(N <= most_sums && sizeof(T) <= sizeof(double));
    T* const of_warp = reinterpret_cast<T*>(memory_);
    __syncthreads();  // what was there before is read
#pragma unroll
    for (int k = 0; k < N; ++k) {
#pragma unroll
      for (int stride = 16; stride > 0; stride /= 2) x[k] = add(k, x[k], __shfl_xor_sync(all, x[k], stride));
      if (lane_ == 0) of_warp[N * warp_ + k] = x[k];
    }
    __syncthreads();
#pragma unroll
    for (int k = 0; k < N; ++k) {
      x[k] = of_warp[k];
#pragma unroll
      for (int w = 1; w < W; ++w) x[k] = add(k, x[k], of_warp[N * w + k]);
    }
  }
  template <class T, int N>
  __device__ void sum_all(T (&x)[N]) const {
    join_warps(x, [](int, T a, T b) { return a + b; });
  }
  static __device__ int entries_of(Row<R> const& row) { return row.segment[0].count + row.segment[1].count; }
  __device__ R inverse(DelassusLaw<R> const& law) const { return law.step / -R(k_.options.relaxation); }
  __device__ R diagonal(DelassusLaw<R> const& law) const {
    R const of_row = inverse(law);
    return of_row > R(0) ? R(1) / of_row : R(0);
  }
  __device__ int tree_dofs(Row<R> const& row) const {
    auto const& islands = k_.rows.islands;
    return islands.tree_dofnum(islands.dof_tree(row.segment[0].dof0));
  }
  /// Whether the element of n rows that begins with this one may be of a run.
  __device__ bool runs(Row<R> const& row, int n) const {
    return runs_ && n == 1 && row.segment[0].count > 0 && row.segment[1].count == 0 && tree_dofs(row) <= most_run_dofs;
  }
  /// Of the element of n rows that begins at row r of the world.
  __device__ Sizes sizes_of(int r, int n) const {
    Row<R> const* const row = &k_.rows.row(first_ + r);
    int const one = entries_of(row[0]);
    if (runs(row[0], n)) return {tree_dofs(row[0]) + most_run / 2, one};
    int sum = one;
    for (int b = 1; b < n; ++b) sum += entries_of(row[b]);
    return {n * (n - 1) / 2 + sum, row[0].same_segments ? one : sum};
  }
  __device__ void measure() {
    std::int64_t sizes[4] = {0, 0, 0, 0};
    for (int k = thread_; k < island_.elements; k += threads) {
      int const n = island_.rows_of(k_.rows, k);
      if (n == 0) continue;
      Sizes const own = sizes_of(island_.begin(k), n);
      sizes[0] += n;
      sizes[1] += own.entries;
      sizes[2] += own.lists;
      sizes[3] += 1;
    }
    sum_all(sizes);
    count_ = int(sizes[0]);
    entries_ = sizes[1];
    lists_ = sizes[2];
    elements_ = int(sizes[3]);
  }
  /// First warp: sum of x over the threads before this one; `total` grows by that of all.
  __device__ int before_me(int x, int& total) const {
    int sum = x;
#pragma unroll
    for (int stride = 1; stride < 32; stride *= 2) {
      int const other = __shfl_up_sync(all, sum, stride);
      sum += lane_ < stride ? 0 : other;
    }
    int const before = total + sum - x;
    total += __shfl_sync(all, sum, 31);
    return before;
  }

  /// Units by levels, rows in their order, entries.
  __device__ void read() {
    auto* const begin = reinterpret_cast<Begin*>(Y_);
    auto* const draft = reinterpret_cast<Draft*>(begin + island_.elements);
    auto* const turn = reinterpret_cast<Turn*>(draft + elements_);
    for (int k = thread_; k < island_.elements; k += threads) {
      int const n = island_.rows_of(k_.rows, k);
      Begin own{0, 0, 0, 0, false};
      if (n > 0) {
        Sizes const sizes = sizes_of(island_.begin(k), n);
        own = {sizes.entries, static_cast<unsigned short>(sizes.lists), static_cast<unsigned short>(n), 0,
               runs(k_.rows.row(first_ + island_.begin(k)), n)};
      }
      begin[k] = own;
    }
    for (int k = thread_; k < island_.dofs; k += threads) state_of_tree()[k] = {0, no_tree};
    for (int k = thread_; k <= elements_; k += threads) level_[k] = 0;  // how many have a level
    __syncthreads();
    if (warp_ == 0) take_turns(begin);
    __syncthreads();
    for (int k = thread_; k < island_.elements; k += threads)
      if (begin[k].rows > 0) turn[begin[k].turn] = touched_by(k, begin[k].rows);
    __syncthreads();
    if (warp_ == 0) find_levels(begin, turn, draft);
    __syncthreads();
    int const units = reinterpret_cast<int*>(memory_)[0];
    levels_ = reinterpret_cast<int*>(memory_)[1];
    for (int u = thread_; u < units; u += threads) {
      Draft const own = draft[u];
      Begin const first = begin[own.k];
      Row<R> const& row = k_.rows.row(first_ + island_.begin(own.k));
      SparseUnit unit{first.entries, 0, first.rows, first.lists, static_cast<unsigned short>(entries_of(row)), sparse_other};
      if (first.runs && own.members > 1) {
        unit = {own.members * (own.members - 1) / 2 + own.members * tree_dofs(row),
                0,
                own.members,
                0,
                static_cast<unsigned short>(tree_dofs(row)),
                sparse_run};
      } else if (first.rows == 1) {
        if (first.runs) unit = {entries_of(row), 0, 1, static_cast<unsigned short>(entries_of(row)), unit.count, sparse_other};
        unit.kind = sparse_single;
      } else if (is_contact(&row, first.rows)) {
        unit.kind = sparse_contact;
      }
      unit_[level_[own.level] + own.place] = unit;
    }
    __syncthreads();
    if (warp_ == 0) place_units(units);
    __syncthreads();
    for (int k = thread_; k < island_.elements; k += threads)
      if (begin[k].rows > 0) {
        Turn const own = turn[begin[k].turn];
        Draft const of = draft[own.first];
        read_rows(unit_[level_[of.level] + of.place], own.second, begin[k], island_.begin(k));
      }
    __syncthreads();
    for (int u = warp_; u < units; u += W) read_entries(unit_[u]);
    __pipeline_commit();
    __pipeline_wait_prior(0);
    __syncthreads();
    for (int u = warp_; u < units; u += W) multiply_rows(unit_[u]);
    for (int u = thread_; u < units; u += threads)
      if (unit_[u].kind == sparse_run) unit_[u].list = first_dof_of(unit_[u]);
  }
  __device__ TreeState* state_of_tree() const { return reinterpret_cast<TreeState*>(z_); }
  static __device__ bool is_contact(Row<R> const* row, int n) {
    return n == 3 && row->same_segments && row[0].friction_of < 0 && row[1].friction_of == 0 && row[1].with_next && row[2].friction_of == 0;
  }
  __device__ unsigned short first_dof_of(SparseUnit const& run) const {
    Row<R> const& row = k_.rows.row(first_ + place_[run.row].pool);
    return static_cast<unsigned short>(island_.first_dof(k_.rows, row.segment[0]));
  }
  /// First warp: the order of a sweep: the k-th element of one row comes after as many of more, and so the other way round.
  __device__ void take_turns(Begin* begin) const {
    int singles = 0, severals = 0;
    for (int at = 0; at < island_.elements; at += 32) {
      int const n = at + lane_ < island_.elements ? begin[at + lane_].rows : 0;
      before_me(n == 1, singles);
      before_me(n > 1, severals);
    }
    int single = 0, several = 0;
    for (int at = 0; at < island_.elements; at += 32) {
      int const k = at + lane_, n = k < island_.elements ? begin[k].rows : 0, my_single = before_me(n == 1, single),
                my_several = before_me(n > 1, several);
      if (n > 0)
        begin[k].turn =
            static_cast<unsigned short>(n == 1 ? my_single + smaller(my_single, severals) : my_several + smaller(my_several + 1, singles));
    }
  }
  /// Trees of the element that entry k of the list begins.
  __device__ Turn touched_by(int k, int n) const {
    Row<R> const* const row = &k_.rows.row(first_ + island_.begin(k));
    auto const at = static_cast<unsigned short>(k);
    if (!row->same_segments && n > 1) return {various, various, at};
    auto const tree = [&](int s) {
      return row->segment[s].count > 0 ? static_cast<unsigned short>(island_.first_dof(k_.rows, row->segment[s])) : no_tree;
    };
    return {tree(0), tree(1), at};
  }
  /// First warp: units of all elements in their turns, and their levels, which begin at level_[...].
  __device__ void find_levels(Begin const* begin, Turn* turn, Draft* draft) {
    int units = 0, levels = 0;
    for (int from = 0; from < elements_; from += 32) {
      Turn own = from + lane_ < elements_ ? turn[from + lane_] : Turn{no_tree, no_tree, 0};
      for (int j = 0; j < 32 && from + j < elements_; ++j) {
        int const first = __shfl_sync(all, int(own.first), j), second = __shfl_sync(all, int(own.second), j),
                  k = __shfl_sync(all, int(own.k), j);
        auto const each_tree = [&](auto const& f) {
          if (second == various) {
            int const r = island_.begin(k);
            for (int b = 0; b < begin[k].rows; ++b)
              for (int s = 0; s < 2; ++s)
                if (auto const& segment = k_.rows.row(first_ + r + b).segment[s]; segment.count > 0)
                  f(state_of_tree()[island_.first_dof(k_.rows, segment)]);
          } else {
            if (first != no_tree) f(state_of_tree()[first]);
            if (second != no_tree) f(state_of_tree()[second]);
          }
        };
        bool const runs = begin[k].runs;
        int unit = runs ? state_of_tree()[first].run : no_tree, place = 0;
        if (unit != no_tree) place = draft[unit].members;
        if (unit == no_tree || place == most_run) {
          unit = units++;
          place = 0;
          int level = 0;
          each_tree([&](TreeState const& before) { level = level > before.level ? level : before.level; });
          int const in_level = level_[level];
          __syncwarp();
          TreeState const after{static_cast<unsigned short>(level + 1), runs ? static_cast<unsigned short>(unit) : no_tree};
          each_tree([&](TreeState& now) { now = after; });
          level_[level] = static_cast<unsigned short>(in_level + 1);
          draft[unit] = {static_cast<unsigned short>(level), static_cast<unsigned short>(in_level), 1, static_cast<unsigned short>(k)};
          levels = levels > level ? levels : level + 1;
        } else {
          __syncwarp();
          draft[unit].members = static_cast<unsigned short>(place + 1);
        }
        __syncwarp();
        if (lane_ == j) own = {static_cast<unsigned short>(unit), static_cast<unsigned short>(place), own.k};
      }
      if (from + lane_ < elements_) turn[from + lane_] = own;
    }
    int total = 0;
    for (int at = 0; at < levels; at += 32) {
      int const before = before_me(at + lane_ < levels ? level_[at + lane_] : 0, total);
      __syncwarp();
      if (at + lane_ < levels) level_[at + lane_] = static_cast<unsigned short>(before);
    }
    if (lane_ == 0) {
      level_[levels] = level_[levels + 1] = static_cast<unsigned short>(total);
      reinterpret_cast<int*>(memory_)[0] = units;
      reinterpret_cast<int*>(memory_)[1] = levels;
    }
  }
  /// First warp: where rows, entries and lists of units begin; until then `entry` and `list` say how many they have.
  __device__ void place_units(int units) {
    int row = 0, entry = 0, list = 0;
    for (int at = 0; at < units; at += 32) {
      int const u = at + lane_;
      SparseUnit own = u < units ? unit_[u] : SparseUnit{0, 0, 0, 0, 0, sparse_other};
      own.row = static_cast<unsigned short>(before_me(own.rows, row));
      own.entry = before_me(own.entry, entry) + own.rows * (own.rows - 1) / 2;
      own.list = static_cast<unsigned short>(before_me(own.list, list));
      if (u < units) unit_[u] = own;
    }
  }
  /// One thread: the rows of an element, the first being r of the world, from place `at` of the unit on.
  __device__ void read_rows(SparseUnit const& unit, int at, Begin const& own, int r) {
    Row<R> const* const from = &k_.rows.row(first_ + r);
    R const* const p = k_.impulses.p[k_.impulses.parity()].data() + first_ + r;
    bool const same = from->same_segments;
    int const n = own.rows, i = unit.row + at;
    int entry = unit.entry + at * unit.count, list = unit.list;
    for (int b = 0; b < n; ++b) {
      Row<R> const row = from[b];
      int const has = entries_of(row);
      law_[i + b] = {-R(k_.options.relaxation) * row.inverse_diagonal, row.friction_of < 0 ? row.lower : row.mu, row.upper, p[b]};
      bias_[i + b] = row.bias;
      compliance_[i + b] = row.compliance;
      d_[i + b] = R(0);
      place_[i + b] = {r + b, entry, static_cast<unsigned short>(list), static_cast<unsigned short>(has)};
      row_[i + b] = {static_cast<unsigned char>(b == 0 ? n : 0), row.friction_of, row.with_next && b + 1 < n, false};
      entry += has;
      if (!same) list += has;
    }
  }
  /// A warp: entries of a unit, and numbers of dofs. (The former arrive until __pipeline_wait_prior.)
  __device__ void read_entries(SparseUnit const& unit) {
    auto const& rows = k_.rows;
    auto const pool = [&](int b) -> Row<R> const& { return rows.row(first_ + place_[unit.row + b].pool); };
    if (unit.kind == sparse_run) {
      for (int e = lane_; e < unit.rows * unit.count; e += 32) Y_[unit.entry + e] = R(0);
      __syncwarp();
      for (int b = 0; b < unit.rows; ++b) {
        Row<R> const& row = pool(b);
        int const* const list = list_of(rows, row.segment[0]);
        for (int e = lane_; e < row.segment[0].count; e += 32)
          __pipeline_memcpy_async(&Y_[unit.entry + b * unit.count + (list ? list[e] : e)], &rows.Y(row.first_entry + e), sizeof(R));
      }
      return;
    }
    int const n = unit.rows, couplings = n * (n - 1) / 2;
    SparsePlace const last = place_[unit.row + n - 1];
    R const* const from = &rows.Y(pool(0).first_entry) - couplings;
    R* const to = Y_ + unit.entry - couplings;
    for (int e = lane_; e < couplings + last.entry + last.count - unit.entry; e += 32) __pipeline_memcpy_async(to + e, from + e, sizeof(R));
    for (int b = 0, lists = pool(0).same_segments ? 1 : n; b < lists; ++b) {
      SparsePlace const own = place_[unit.row + b];
      Row<R> const& row = pool(b);
      unsigned short* numbers = dof_ + own.list;
      for (int s = 0; s < 2 && row.segment[s].count > 0; ++s) {
        RowSegment const segment = row.segment[s];
        int const* const list = list_of(rows, segment);
        int const first = island_.first_dof(rows, segment);
        for (int e = lane_; e < segment.count; e += 32) numbers[e] = static_cast<unsigned short>(first + (list ? list[e] : e));
        numbers += segment.count;
      }
    }
  }
  /// A warp: what the rows of a run do to each other.
  __device__ void multiply_rows(SparseUnit const& unit) {
    if (unit.kind != sparse_run) return;
    int const pairs = unit.rows * (unit.rows - 1) / 2;
    for (int k = lane_; k < pairs; k += 32) {
      int b = 1;
      while (b * (b + 1) / 2 <= k) ++b;
      R const *const y = Y_ + unit.entry + b * unit.count, *const x = Y_ + unit.entry + (k - b * (b - 1) / 2) * unit.count;
      R sum(0);
      for (int i = 0; i < unit.count; ++i) sum = fma(y[i], x[i], sum);
      Y_[unit.entry - pairs + k] = sum;
    }
  }

  /// z += Y^T d of a row.
  __device__ void push(SparsePlace const& place, R d) {
    for (int e = lane_; e < place.count; e += 32) {
      R& z = z_[dof_[place.list + e]];
      z = fma(Y_[place.entry + e], d, z);
    }
  }
  /// w = Y z + C p + b of the row at place i.
  __device__ R rate(int i, R p) const {
    SparsePlace const place = place_[i];
    R w(0);
    for (int e = lane_; e < place.count; e += 32) w = fma(Y_[place.entry + e], z_[dof_[place.list + e]], w);
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) w += __shfl_xor_sync(all, w, stride);
    return fma(compliance_[i], p, bias_[i]) + w;
  }
  /// What is known of a unit before those of the level before have moved z: it is read while they do.
  struct Held {
    SparseUnit unit;
    DelassusLaw<R> n0, n1, n2;  // of a run: that of row lane % 8
    R b0, b1, b2;               // C p + b
    R y[most_run];              // entries of this thread, row by row
    R coupling[most_run];       // of a run: Y_b . Y_a of row b = lane % 8; of a contact: of rows 1 and 0, 2 and 0, 2 and 1
    int dof;                    // of this thread
  };
  __device__ void hold(int u, Held& k) const {
    SparseUnit const unit = k.unit = unit_[u];
    if (unit.kind == sparse_other) return;
    int const n = unit.rows, i = unit.row;
    R const* const y = Y_ + unit.entry;
    bool const has = lane_ < unit.count;
    if (unit.kind == sparse_run) {
      int const b = lane_ % most_run, own = b < n ? b : 0;
      k.n0 = law_[i + own];
      k.b0 = fma(compliance_[i + own], k.n0.p, bias_[i + own]);
      k.dof = unit.list + lane_;
#pragma unroll
      for (int a = 0; a < most_run; ++a) {
        k.y[a] = has && a < n ? y[a * unit.count + lane_] : R(0);
        k.coupling[a] = a < b && b < n ? y[b * (b - 1) / 2 + a - n * (n - 1) / 2] : R(0);
      }
      return;
    }
    k.n0 = law_[i];
    k.b0 = fma(compliance_[i], k.n0.p, bias_[i]);
    k.dof = has ? dof_[unit.list + lane_] : 0;
    k.y[0] = has ? y[lane_] : R(0);
    if (unit.kind == sparse_single) return;
    k.n1 = law_[i + 1];
    k.n2 = law_[i + 2];
    k.b1 = fma(compliance_[i + 1], k.n1.p, bias_[i + 1]);
    k.b2 = fma(compliance_[i + 2], k.n2.p, bias_[i + 2]);
    k.y[1] = has ? y[unit.count + lane_] : R(0);
    k.y[2] = has ? y[2 * unit.count + lane_] : R(0);
#pragma unroll
    for (int a = 0; a < 3; ++a) k.coupling[a] = y[a - 3];
  }
  /// A sweep. While a warp waits for the level of its next unit it reads what is known of it.
  template <bool tells>
  __device__ SweepOutcome<R> pass() {
    SweepWork<R> work{};  // what this thread tells of the rows
    Held own;
    bool known = false;
    __syncthreads();
    int const units = level_[levels_];
    int k = warp_, end = level_[levels_ > 0];
#pragma unroll 1
    for (int level = 0; level < levels_; ++level) {
      int const after = level_[level + 2];
      if (k < end) {
#pragma unroll 1
        do {
          if (!known) hold(k, own);
          if (own.unit.kind == sparse_single)
            single<tells>(own, work);
          else if (own.unit.kind == sparse_run)
            run<tells>(own, work);
          else if (own.unit.kind == sparse_contact)
            contact<tells>(own, work);
          else
            several<tells>(own.unit, work);
          known = false;
          k += W;
        } while (k < end);
      } else if (!known && k < units) {
        hold(k, own);
        known = true;
      }
      __syncthreads();
      end = after;
    }
    R sums[5] = {R(0), R(0), work.raised, work.held_p, work.held_d};
    for (int i = thread_; i < count_; i += threads) {
      R const d = d_[i];
      if (d == R(0)) continue;
      R const c = d * diagonal(law_[i]);
      sums[0] = max(sums[0], abs(c));
      sums[1] = fma(d, c, sums[1]);
    }
    join_warps(sums, [](int k, R a, R b) { return k == 0 ? max(a, b) : a + b; });
    return {sums[0], sums[1], {sums[2], sums[3], sums[4]}};
  }
  /// A row has moved by d, to p.
  /// @param rate  its rate before, after the rows before it;   @param together  of that, what the row has done that moves with it
  template <bool tells>
  __device__ void tell(SweepWork<R>& work, DelassusLaw<R> const& law, R p, R d, R rate, R together) const {
    if constexpr (tells) work.template add_row<R>(p, d, rate, d * diagonal(law), inverse(law), together);
  }
  template <bool tells>
  __device__ void run(Held const& k, SweepWork<R>& work) {
    int const n = k.unit.rows, own = lane_ % most_run;
    bool const has = lane_ < k.unit.count;
    R const z = has ? z_[k.dof] : R(0);
    // Sums over all threads of eight numbers each, of which a thread ends with that of row lane % 8: it hands on half of what it has.
    R w[most_run];
#pragma unroll
    for (int b = 0; b < most_run; ++b) w[b] = k.y[b] * z;
#pragma unroll
    for (int half = most_run / 2; half > 0; half /= 2) {
      bool const upper = (lane_ & half) != 0;
#pragma unroll
      for (int b = 0; b < half; ++b) {
        R const keeps = upper ? w[b + half] : w[b], gives = upper ? w[b] : w[b + half];
        w[b] = keeps + __shfl_xor_sync(all, gives, half);
      }
    }
    R rate = w[0];
    rate += __shfl_xor_sync(all, rate, 8);
    rate += __shfl_xor_sync(all, rate, 16);
    rate += k.b0;
    R p = k.n0.p, d[most_run];
#pragma unroll
    for (int b = 0; b < most_run; ++b) {
      d[b] = R(0);
      if (b >= n) continue;
      R const to = clamp(fma(k.n0.step, rate, k.n0.p), k.n0.lower, k.n0.upper);
      p = own == b ? to : p;
      d[b] = __shfl_sync(all, to - k.n0.p, b);
      rate = fma(k.coupling[b], d[b], rate);
    }
    if (has) {
      R sum = z;
#pragma unroll
      for (int b = 0; b < most_run; ++b) sum = fma(k.y[b], d[b], sum);
      z_[k.dof] = sum;
    }
    if (lane_ >= n) return;
    law_[k.unit.row + lane_].p = p;
    d_[k.unit.row + lane_] = p - k.n0.p;
    tell<tells>(work, k.n0, p, p - k.n0.p, rate, R(0));
  }
  template <bool tells>
  __device__ void single(Held const& k, SweepWork<R>& work) {
    int const count = k.unit.count;
    R const* const y = Y_ + k.unit.entry;
    unsigned short const* const list = dof_ + k.unit.list;
    bool const has = lane_ < count;
    R const x = has ? z_[k.dof] : R(0);
    R w = k.y[0] * x;
#pragma unroll 1
    for (int e = lane_ + 32; e < count; e += 32) w = fma(y[e], z_[list[e]], w);
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) w += __shfl_xor_sync(all, w, stride);
    w += k.b0;
    R const p = clamp(fma(k.n0.step, w, k.n0.p), k.n0.lower, k.n0.upper), d = p - k.n0.p;
    if (has) z_[k.dof] = fma(k.y[0], d, x);
#pragma unroll 1
    for (int e = lane_ + 32; e < count; e += 32) {
      R& z = z_[list[e]];
      z = fma(y[e], d, z);
    }
    if (lane_ != 0) return;
    law_[k.unit.row].p = p;
    d_[k.unit.row] = d;
    tell<tells>(work, k.n0, p, d, w, R(0));
  }
  template <bool tells>
  __device__ void contact(Held const& k, SweepWork<R>& work) {
    DelassusLaw<R> const &n0 = k.n0, &n1 = k.n1, &n2 = k.n2;
    int const i = k.unit.row, count = k.unit.count;
    R const* const y = Y_ + k.unit.entry;
    unsigned short const* const list = dof_ + k.unit.list;
    bool const has = lane_ < count;
    R const x = has ? z_[k.dof] : R(0);
    R w0 = k.y[0] * x, w1 = k.y[1] * x, w2 = k.y[2] * x;
#pragma unroll 1
    for (int e = lane_ + 32; e < count; e += 32) {
      R const more = z_[list[e]];
      w0 = fma(y[e], more, w0);
      w1 = fma(y[count + e], more, w1);
      w2 = fma(y[2 * count + e], more, w2);
    }
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) {  // three at a time: each waits for itself alone
      R const s0 = __shfl_xor_sync(all, w0, stride), s1 = __shfl_xor_sync(all, w1, stride), s2 = __shfl_xor_sync(all, w2, stride);
      w0 += s0;
      w1 += s1;
      w2 += s2;
    }
    w0 += k.b0;
    R const p0 = clamp(fma(n0.step, w0, n0.p), n0.lower, n0.upper), d0 = p0 - n0.p;
    w1 = fma(k.coupling[0], d0, w1 + k.b1);
    w2 = fma(k.coupling[1], d0, w2 + k.b2);
    R p1 = fma(n1.step, w1, n1.p), p2 = fma(n2.step, w2, n2.p);
    into_ellipse(n1.lower, n2.lower, abs(p0), p1, p2);
    R const d1 = p1 - n1.p, d2 = p2 - n2.p;
    if (has) z_[k.dof] = fma(k.y[2], d2, fma(k.y[1], d1, fma(k.y[0], d0, x)));
#pragma unroll 1
    for (int e = lane_ + 32; e < count; e += 32) {
      R& z = z_[list[e]];
      z = fma(y[2 * count + e], d2, fma(y[count + e], d1, fma(y[e], d0, z)));
    }
    if (lane_ < 3) {
      law_[i + lane_].p = lane_ == 0 ? p0 : lane_ == 1 ? p1 : p2;
      d_[i + lane_] = lane_ == 0 ? d0 : lane_ == 1 ? d1 : d2;
    }
    if (!tells || lane_ != 0) return;
    tell<tells>(work, n0, p0, d0, w0, R(0));
    tell<tells>(work, n1, p1, d1, w1, R(0));
    tell<tells>(work, n2, p2, d2, fma(k.coupling[2], d1, w2), k.coupling[2] * d1);
  }
  /// Any other element, as project_element does it: row by row, or two together.
  template <bool tells>
  __device__ void several(SparseUnit const& unit, SweepWork<R>& work) {
#pragma unroll 1
    for (int i = unit.row; i < unit.row + unit.rows; ++i) {
      DelassusRow const row = row_[i];
      DelassusLaw<R> const law = law_[i];
      R const w = rate(i, law.p), normal = row.friction_of < 0 ? R(0) : abs(law_[unit.row + row.friction_of].p);
      if (!row.with_next) {
        R const bound = law.lower * normal, least = row.friction_of < 0 ? law.lower : -bound,
                most = row.friction_of < 0 ? law.upper : bound;
        move<tells>(i, law, w, clamp(fma(law.step, w, law.p), least, most), R(0), work);
        continue;
      }
      DelassusLaw<R> const second = law_[i + 1];
      R const w2 = rate(i + 1, second.p);
      R p1 = fma(law.step, w, law.p), p2 = fma(second.step, w2, second.p);
      into_ellipse(law.lower, second.lower, normal, p1, p2);
      move<tells>(i, law, w, p1, R(0), work);
      ++i;
      R const after = tells ? rate(i, second.p) : w2;
      move<tells>(i, second, after, p2, after - w2, work);
    }
  }
  /// The row at place i, of rate w, goes to impulse p.
  template <bool tells>
  __device__ void move(int i, DelassusLaw<R> const& law, R w, R p, R together, SweepWork<R>& work) {
    R const d = p - law.p;
    __syncwarp();  // all have read p and z
    push(place_[i], d);
    if (lane_ == 0) {
      law_[i].p = p;
      d_[i] = d;
      tell<tells>(work, law, p, d, w, together);
    }
    __syncwarp();
  }

  PgsDelassus<R, Mem> const& k_;
  Island const& island_;
  char* const memory_;  // of the block: at its begin what sums of all threads take
  int const first_, thread_, lane_, warp_;
  bool runs_ = true;
  int count_, elements_, levels_ = 0;  // rows that are swept
  std::int64_t entries_, lists_;       // numbers in Y, in dof
  R* remembered_[4];                   // pools: p and d of the last sweep of either side (mixing.hpp)
  SparseUnit* unit_;                   // level by level
  DelassusLaw<R>* law_;                // with the impulses
  R *bias_, *compliance_, *d_;         // of rows: d_: what the last sweep has changed p by
  R *z_, *Y_;
  SparsePlace* place_;
  DelassusRow* row_;
  unsigned short* level_;  // where it begins among the units
  unsigned short* dof_;    // numbers of dofs in the island
};

template <class R, class Mem, int W>
__device__ __forceinline__ void take_sparse(PgsDelassus<R, Mem> const& solver, int list, std::int64_t least, std::int64_t most,
                                            std::int64_t fit) {
  extern __shared__ __align__(32) char shared_memory[];
  int& next = *reinterpret_cast<int*>(shared_memory);  // no memory beside it: a block may have all that there is
  if (solver.halt()) return;
  auto const& rows = solver.rows;
  auto const& solution = solver.solution;
  int const of_world = islands_of_world(rows), islands = rows.worlds * of_world;
  int const count = list < 0 ? islands : solution.list_counts(large_island, few_sweeps) + solution.list_counts(large_island, many_sweeps);
  for (int at = int(blockIdx.x);; at += int(gridDim.x)) {
    if (list >= 0) {
      __syncthreads();
      if (threadIdx.x == 0) next = atomicAdd(&solution.list_counts(list, taken), 1);
      __syncthreads();
      at = next;
    }
    if (at >= count) return;
    int const number = list < 0 ? at : solution.listed(0, at);
    if (list < 0 && !is_island(rows, number / of_world, number % of_world)) continue;
    Island const own = island_of(rows, number / of_world, number % of_world);
    if (list < 0 && delassus_takes(rows, own)) continue;
    SharedIsland<R, Mem, W> island(solver, own, shared_memory, fit);
    std::int64_t const bytes = island.bytes();
    if (threadIdx.x == 0 && least == 0) solution.left(number) = bytes > fit;
    if (bytes <= least || bytes > most) continue;
    island.take();
    island.write(sweep_until_rest<R>(island, solver.options, R(solver.options.tolerance) * rows.rate_scale(own.world), own.rows > 0));
  }
}
/// Islands that pgs_delassus_kernel does not take and that need more than `least` and at most `most` bytes. Solution::left says of all
/// whether they need more than `fit`, and are too large for any.
/// @param list    row of Solution::list_counts whose `taken` counts; -1: blocks take islands by their numbers
/// @param beside  begins while the kernel before runs, of which it reads nothing (`follow`)
template <class R, class Mem, int W>
__global__ void __launch_bounds__(32 * W, W == sparse_few_warps ? 3 : 1)
    pgs_sparse_kernel(PgsDelassus<R, Mem> const __grid_constant__ solver, int list, std::int64_t least, std::int64_t most, std::int64_t fit,
                      bool beside) {
  follow(beside);
  take_sparse<R, Mem, W>(solver, list, least, most, fit);
  end_beside(beside);
}

}  // namespace gsp::detail
