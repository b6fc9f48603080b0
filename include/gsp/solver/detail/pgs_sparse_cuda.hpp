#pragma once
#include <cuda_pipeline.h>

#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/solver/detail/list_islands.hpp>
#include <gsp/solver/detail/pgs_delassus.hpp>
#include <gsp/solver/detail/sweep_until_rest.hpp>

/// Projected Gauss-Seidel on a GPU for islands that are not small (pgs_delassus.hpp): a block each, over their sparse rows, which are
/// copied to shared memory. Elements that share no tree go at the same time, sixteen threads each: a sweep takes them level by level,
///   level(e) = 1 + the highest level of the elements before e that touch a tree of e,
/// which is the sweep in its order, one after the other, to the bit. Heaps of humanoids have a third to a tenth as many levels as elements
/// (docs/decisions/0034). What a sweep waits for is the way through a level: memory that is near makes it short. Islands that do not fit
/// are left to pgs_islands.hpp.
namespace gsp::detail {

// Islands of so many bytes have blocks of four warps, four or two of them in a multiprocessor of an H100; larger ones of eight, alone.
inline constexpr std::int64_t sparse_few_bytes = 48 * 1024, sparse_some_bytes = delassus_most_bytes;
inline constexpr int sparse_few_warps = 4, sparse_many_warps = 8;

/// Where the entries of a row stand, in the order of the sweeps.
struct SparseRow {
  int pool, entry;             // its number in the world, counted from Rows::first; of Y
  unsigned short list, count;  // of the numbers of its dofs, and how many
};

/// An island, for sweep_until_rest. All threads of the block call all members together.
/// @tparam W  warps of the block
template <class R, class Mem, int W>
class SharedIsland {
 public:
  /// Sizes alone; `take`, where there is room for `bytes`.
  __device__ SharedIsland(PgsDelassus<R, Mem> const& solver, Island const& island, char* memory)
      : k_(solver),
        island_(island),
        memory_(memory),
        first_(island.first_row),
        thread_(threadIdx.x),
        lane_(thread_ % 32),
        sub_(thread_ % G),
        group_(thread_ / 32 + W * (lane_ / G)) {
    int sizes[4] = {0, 0, 0, 0};
    for (int k = thread_; k < island.elements; k += threads) {
      int const n = island.rows_of(solver.rows, k);
      if (n == 0) continue;
      Sizes const own = sizes_of(island.begin(k), n);
      sizes[0] += n;
      sizes[1] += own.entries;
      sizes[2] += own.lists;
      sizes[3] += 1;
    }
    sum_all(sizes);
    count_ = sizes[0];
    entries_ = sizes[1];
    lists_ = sizes[2];
    elements_ = sizes[3];
  }
  /// Shared memory that it takes.
  __device__ std::int64_t bytes() const {
    return sums_bytes + std::int64_t(count_) * (sizeof(DelassusLaw<R>) + 8 * sizeof(R) + sizeof(SparseRow) + sizeof(DelassusRow)) +
           2 * std::int64_t(island_.dofs) * sizeof(R) + room_of_Y() + std::int64_t(elements_) * (sizeof(Touched) + 2 * sizeof(short)) +
           std::int64_t(lists_) * sizeof(short) + 64;
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
    for (R** v : {&bias_, &compliance_, &diagonal_, &d_}) next(*v, count_);
    for (R*& v : remembered_) next(v, count_);
    next(z_, island_.dofs);
    next(z_before_, island_.dofs);
    Y_ = reinterpret_cast<R*>(memory);
    memory += room_of_Y();
    next(touched_, elements_);
    next(place_, count_);
    next(row_, count_);
    next(order_, elements_);
    next(level_, elements_ + 2);
    next(dof_, lists_);
    read();
    sum();
  }

  __device__ SweepOutcome<R> sweep(bool tells) { return tells ? pass<true>() : pass<false>(); }
  __device__ void keep(bool leaps) {
    for (int k = thread_; leaps && k < island_.dofs; k += threads) z_before_[k] = z_[k];
  }
  /// z = Y^T p
  __device__ void sum() {
    __syncthreads();
    for (int k = thread_; k < island_.dofs; k += threads) z_[k] = R(0);
    __syncthreads();
    int k = group_;
    for (int level = 0; level < levels_; ++level) {
      for (int const end = level_[level + 1]; __any_sync(all, k < end); k += k < end ? groups : 0) {
        int const i = k < end ? order_[k] : 0;
        DelassusRow const row = row_[i];
        int const n = k < end ? row.rows : 0;
        if (n == 3 && row.contact) {
          SparseRow const place = place_[i];
          R const p0 = law_[i].p, p1 = law_[i + 1].p, p2 = law_[i + 2].p, *const y = Y_ + place.entry;
          for (int e = sub_; e < place.count; e += G) {
            R& z = z_[dof_[place.list + e]];
            z = fma(y[2 * place.count + e], p2, fma(y[place.count + e], p1, fma(y[e], p0, z)));
          }
        } else if (n == 1) {
          push(place_[i], law_[i].p);
        }
        bool const several = n > 1 && !row.contact;
        for (int b = 0; __any_sync(all, several && b < n); ++b) {
          if (several && b < n) push(place_[i + b], law_[i + b].p);
          __syncwarp();  // the next row may have other dofs
        }
      }
      __syncthreads();
    }
  }
  /// p as it was before it leapt or was mixed.
  __device__ void take_back() {
    for (int i = thread_; i < count_; i += threads) law_[i].p = remembered_[0][i];
    sum();
  }
  __device__ LeapSums<R> leap_sums() const {
    LeapSums<R> own{};
    for (int k = thread_; k < island_.dofs; k += threads) own.add_dof(z_[k], z_[k] - z_before_[k]);
    for (int i = thread_; i < count_; i += threads) own.add_row(law_[i].p, d_[i], compliance_[i], bias_[i], inverse(law_[i]));
    R sums[5] = {own.pp, own.pd, own.dd, own.bp, own.yy};
    sum_all(sums);
    return {sums[0], sums[1], sums[2], sums[3], sums[4]};
  }
  __device__ MixingSums<R> mixing_sums(bool both) const {
    MixingSums<R> own{};
    for (int i = thread_; i < count_; i += threads) own.add_row(diagonal_[i], d_[i], remembered_[3][i], remembered_[1][i], both);
    R sums[5] = {own.dd11, own.dd12, own.dd22, own.df1, own.df2};
    sum_all(sums);
    return {sums[0], sums[1], sums[2], sums[3], sums[4]};
  }
  /// Keeps p and d of the last sweep; p goes on to where a leap or a mixture leads.
  __device__ void go_on(int side, Leap<R> const& leap, Mixing<R> const& mixing, bool both) {
    R *const p_before = side == 0 ? remembered_[0] : remembered_[2], *const d_before = side == 0 ? remembered_[1] : remembered_[3];
    for (int i = thread_; i < count_; i += threads) {
      R const now = law_[i].p;
      R p = now;
      if (leap.goes()) p = leap.of(now, d_[i]);
      if (mixing.helps()) p = mixing.of(now, remembered_[2][i], remembered_[0][i], both);
      p_before[i] = now;
      d_before[i] = d_[i];
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
  static constexpr int G = 16, groups = threads / G;  // threads of an element, elements at a time
  static constexpr int held = 2;                      // entries of a thread that stay in registers
  static constexpr int most_sums = 5, sums_bytes = (most_sums * W * int(sizeof(R)) + 31) / 32 * 32;
  struct Sizes {
    int entries, lists;  // the former with the element's couplings
  };
  /// The trees that an element touches, by their first dofs; once it has one, its level and its place there.
  struct Touched {
    unsigned short first, second;
  };
  // In place of a tree: there is none; rows differ in theirs, and the element is number `first` of the list.
  static constexpr unsigned short no_tree = 0xffff, various = 0xfffe;
  /// Entry k of the island's list while all is laid out: where its element's rows, entries and lists begin; which it is in a sweep.
  struct Begin {
    int entry;
    unsigned short row, list, turn, rows;
  };
  static __device__ int smaller(int a, int b) { return a < b ? a : b; }
  __device__ std::int64_t room_of_Y() const {
    std::int64_t const entries = std::int64_t(entries_) * sizeof(R), begins = std::int64_t(island_.elements) * sizeof(Begin);
    return ((entries > begins ? entries : begins) + 7) / 8 * 8;
  }
  /// x of all warps, once they have found theirs.
  template <class T, int N, class Add>
  __device__ void join_warps(T (&x)[N], Add const& add) const {
    static_assert(N <= most_sums && sizeof(T) <= sizeof(R));
    T* const of_warp = reinterpret_cast<T*>(memory_);
    __syncthreads();  // what was there before is read
#pragma unroll
    for (int k = 0; k < N; ++k) {
#pragma unroll
      for (int stride = 16; stride > 0; stride /= 2) x[k] = add(k, x[k], __shfl_xor_sync(all, x[k], stride));
      if (lane_ == 0) of_warp[N * (thread_ / 32) + k] = x[k];
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
  /// Of the element of n rows that begins at row r of the world.
  __device__ Sizes sizes_of(int r, int n) const {
    Row<R> const* const row = &k_.rows.row(first_ + r);
    int const one = entries_of(row[0]);
    int sum = one;
    for (int b = 1; b < n; ++b) sum += entries_of(row[b]);
    return {n * (n - 1) / 2 + sum, row[0].same_segments ? one : sum};
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

  /// Rows in the order of the sweeps, elements by levels, entries.
  __device__ void read() {
    auto* const begin = reinterpret_cast<Begin*>(Y_);
    for (int k = thread_; k < island_.elements; k += threads) {
      int const n = island_.rows_of(k_.rows, k);
      Sizes const own = n > 0 ? sizes_of(island_.begin(k), n) : Sizes{0, 0};
      begin[k] = {own.entries, 0, static_cast<unsigned short>(own.lists), 0, static_cast<unsigned short>(n)};
    }
    for (int k = thread_; k < island_.dofs; k += threads) level_of_tree()[k] = 0;
    __syncthreads();
    if (thread_ < 32) lay_out(begin);
    __syncthreads();
    for (int k = thread_; k < elements_; k += threads) order_[k] = 0;  // how many have a level
    for (int k = thread_; k < island_.elements; k += threads)
      if (Begin const own = begin[k]; own.rows > 0) {
        read_rows(own, island_.begin(k));
        touched_[own.turn] = touched_by(k, own.rows);
      }
    __syncthreads();
    if (thread_ < 32) find_levels(begin);
    __syncthreads();
    levels_ = reinterpret_cast<int*>(memory_)[0];
    for (int k = thread_; k < island_.elements; k += threads)
      if (Begin const own = begin[k]; own.rows > 0) {
        Touched const at = touched_[own.turn];
        order_[level_[at.first] + at.second] = own.row;
      }
    __syncthreads();
    for (int k = thread_ / 32; k < elements_; k += W) read_entries(order_[k]);
    __pipeline_commit();
    __pipeline_wait_prior(0);
    __syncthreads();
  }
  __device__ unsigned short* level_of_tree() const { return reinterpret_cast<unsigned short*>(z_); }
  /// First warp: where rows and entries go, in the order of the sweeps: the k-th element of one row behind as many of more, and so the
  /// other way round.
  __device__ void lay_out(Begin* begin) {
    auto* const behind = level_;  // rows of the first k elements of more than one
    int singles = 0, severals = 0, rows_of_several = 0;
    for (int at = 0; at < island_.elements; at += 32) {
      int const n = at + lane_ < island_.elements ? begin[at + lane_].rows : 0;
      before_me(n == 1, singles);
      int const several = before_me(n > 1, severals), row = before_me(n > 1 ? n : 0, rows_of_several);
      if (n > 1) behind[several] = static_cast<unsigned short>(row);
    }
    if (lane_ == 0) behind[severals] = static_cast<unsigned short>(rows_of_several);
    __syncwarp();
    int single = 0, several = 0, row = 0, entry = 0, list = 0;
    for (int at = 0; at < island_.elements; at += 32) {
      int const k = at + lane_;
      Begin own = k < island_.elements ? begin[k] : Begin{0, 0, 0, 0, 0};
      int const n = own.rows, my_single = before_me(n == 1, single), my_several = before_me(n > 1, several),
                my_row = before_me(n > 1 ? n : 0, row);
      own.entry = before_me(own.entry, entry);
      own.list = static_cast<unsigned short>(before_me(own.list, list));
      own.row = static_cast<unsigned short>(n == 1 ? my_single + behind[smaller(my_single, severals)]
                                                   : my_row + smaller(my_several + 1, singles));
      own.turn =
          static_cast<unsigned short>(n == 1 ? my_single + smaller(my_single, severals) : my_several + smaller(my_several + 1, singles));
      if (n > 0) begin[k] = own;
    }
  }
  /// Trees of the element that entry k of the list begins.
  __device__ Touched touched_by(int k, int n) const {
    Row<R> const* const row = &k_.rows.row(first_ + island_.begin(k));
    if (!row->same_segments && n > 1) return {static_cast<unsigned short>(k), various};
    auto const tree = [&](int s) {
      return row->segment[s].count > 0 ? static_cast<unsigned short>(island_.first_dof(k_.rows, row->segment[s])) : no_tree;
    };
    return {tree(0), tree(1)};
  }
  /// First warp: levels of all elements in their turns, and where each begins in `order_`.
  __device__ void find_levels(Begin const* begin) {
    unsigned short *const level_of = level_of_tree(), *const count = order_;
    int levels = 0;
    for (int turn = 0; turn < elements_; turn += 32) {
      Touched own = turn + lane_ < elements_ ? touched_[turn + lane_] : Touched{no_tree, no_tree};
      for (int j = 0; j < 32 && turn + j < elements_; ++j) {
        int const first = __shfl_sync(all, int(own.first), j), second = __shfl_sync(all, int(own.second), j);
        auto const each_tree = [&](auto const& f) {
          if (second == various) {
            int const r = island_.begin(first);
            for (int b = 0; b < begin[first].rows; ++b)
              for (int s = 0; s < 2; ++s)
                if (auto const& segment = k_.rows.row(first_ + r + b).segment[s]; segment.count > 0)
                  f(level_of[island_.first_dof(k_.rows, segment)]);
          } else {
            if (first != no_tree) f(level_of[first]);
            if (second != no_tree) f(level_of[second]);
          }
        };
        int level = 0;
        each_tree([&](unsigned short const& before) { level = level > before ? level : before; });
        int const place = count[level];
        __syncwarp();
        each_tree([&](unsigned short& now) { now = static_cast<unsigned short>(level + 1); });
        count[level] = static_cast<unsigned short>(place + 1);
        __syncwarp();
        levels = levels > level ? levels : level + 1;
        if (lane_ == j) own = {static_cast<unsigned short>(level), static_cast<unsigned short>(place)};
      }
      if (turn + lane_ < elements_) touched_[turn + lane_] = own;
    }
    int total = 0;
    for (int at = 0; at < levels; at += 32) {
      int const before = before_me(at + lane_ < levels ? count[at + lane_] : 0, total);
      if (at + lane_ < levels) level_[at + lane_] = static_cast<unsigned short>(before);
    }
    if (lane_ == 0) {
      level_[levels] = level_[levels + 1] = static_cast<unsigned short>(total);
      reinterpret_cast<int*>(memory_)[0] = levels;
    }
  }
  /// One thread: an element, the first row being r of the world.
  __device__ void read_rows(Begin const& own, int r) {
    Row<R> const* const from = &k_.rows.row(first_ + r);
    R const* const p = k_.impulses.p[k_.impulses.parity()].data() + first_ + r;
    bool const same = from->same_segments;
    int const n = own.rows, i = own.row;
    int entry = own.entry + n * (n - 1) / 2, list = own.list;
    for (int b = 0; b < n; ++b) {
      Row<R> const row = from[b];
      int const has = entries_of(row);
      R const inverse = row.inverse_diagonal;
      law_[i + b] = {-R(k_.options.relaxation) * inverse, row.friction_of < 0 ? row.lower : row.mu, row.upper, p[b]};
      bias_[i + b] = row.bias;
      compliance_[i + b] = row.compliance;
      diagonal_[i + b] = inverse > R(0) ? R(1) / inverse : R(0);
      d_[i + b] = R(0);
      place_[i + b] = {r + b, entry, static_cast<unsigned short>(list), static_cast<unsigned short>(has)};
      row_[i + b] = {static_cast<unsigned char>(b == 0 ? n : 0), row.friction_of, row.with_next && b + 1 < n, false};
      entry += has;
      if (!same) list += has;
    }
    row_[i].contact =
        n == 3 && same && from[0].friction_of < 0 && from[1].friction_of == 0 && from[1].with_next && from[2].friction_of == 0;
  }
  /// A warp: entries and numbers of dofs of the element at place i. (The former arrive until __pipeline_wait_prior.)
  __device__ void read_entries(int i) {
    auto const& rows = k_.rows;
    int const n = row_[i].rows;
    SparseRow const place = place_[i], last = place_[i + n - 1];
    int const couplings = n * (n - 1) / 2, entries = couplings + last.entry + last.count - place.entry;
    R const* const from = rows.Y.data() + rows.row(first_ + place.pool).first_entry - couplings;
    R* const to = Y_ + place.entry - couplings;
    for (int e = lane_; e < entries; e += 32) __pipeline_memcpy_async(to + e, from + e, sizeof(R));
    for (int b = 0; b < n; ++b) {
      SparseRow const own = place_[i + b];
      if (b > 0 && own.list == place.list) break;  // the same segments
      Row<R> const& row = rows.row(first_ + own.pool);
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

  /// z += Y^T d of a row.
  __device__ void push(SparseRow const& place, R d) {
    for (int e = sub_; e < place.count; e += G) {
      R& z = z_[dof_[place.list + e]];
      z = fma(Y_[place.entry + e], d, z);
    }
  }
  /// w = Y z + C p + b of the row at place i; with all threads of a warp, whether they have one or not: shuffles of some of them are slow.
  __device__ R rate(bool has, int i, R p) const {
    R w(0), constant(0);
    if (has) {
      SparseRow const place = place_[i];
#pragma unroll 1
      for (int e = sub_; e < place.count; e += G) w = fma(Y_[place.entry + e], z_[dof_[place.list + e]], w);
      constant = fma(compliance_[i], p, bias_[i]);
    }
#pragma unroll
    for (int stride = G / 2; stride > 0; stride /= 2) w += __shfl_xor_sync(all, w, stride);
    return constant + w;
  }
  /// What is known of a contact, or of a row alone, before those of the level before have moved z: it is read while they do.
  struct Element {
    int i, rows, count, dof[held];  // i: its place
    bool contact;
    DelassusLaw<R> n0, n1, n2;
    R b0, b1, b2;  // C p + b
    R coupling10, coupling20, coupling21;
    R const* y;
    unsigned short const* list;
    R y0[held], y1[held], y2[held];
  };
  __device__ void read_element(int i, Element& k) const {
    DelassusRow const row = row_[i];
    SparseRow const place = place_[i];
    k.i = i;
    k.rows = row.rows;
    k.contact = row.contact;
    if (!row.contact && row.rows > 1) return;
    k.n0 = law_[i];
    k.b0 = fma(compliance_[i], k.n0.p, bias_[i]);
    k.y = Y_ + place.entry;
    k.list = dof_ + place.list;
    k.count = place.count;
    if (row.contact) {
      k.n1 = law_[i + 1];
      k.n2 = law_[i + 2];
      k.coupling10 = k.y[-3];
      k.coupling20 = k.y[-2];
      k.coupling21 = k.y[-1];
      k.b1 = fma(compliance_[i + 1], k.n1.p, bias_[i + 1]);
      k.b2 = fma(compliance_[i + 2], k.n2.p, bias_[i + 2]);
    }
#pragma unroll
    for (int h = 0; h < held; ++h) {
      int const e = sub_ + G * h;
      bool const has = e < k.count;
      k.dof[h] = has ? k.list[e] : 0;
      k.y0[h] = has ? k.y[e] : R(0);
      k.y1[h] = has && k.contact ? k.y[k.count + e] : R(0);
      k.y2[h] = has && k.contact ? k.y[2 * k.count + e] : R(0);
    }
  }
  /// A sweep. While threads wait for their next element's level they read what is known of it.
  template <bool tells>
  __device__ SweepOutcome<R> pass() {
    SweepWork<R> work{};  // of the elements whose first thread this is
    Element own;
    bool known = false;
    __syncthreads();
    int k = group_, end = level_[levels_ > 0];
#pragma unroll 1
    for (int level = 0; level < levels_; ++level) {
      int const after = level_[level + 2];
      if (__any_sync(all, k < end)) {  // all threads of a warp go together: shuffles of some of them are slow
        do {
          bool const moves = k < end;
          if (moves && !known) read_element(order_[k], own);
          move<tells>(moves, own, work);
          if (!moves) continue;
          known = false;
          k += groups;
        } while (__any_sync(all, k < end));
      } else if (!known && k < elements_) {
        read_element(order_[k], own);
        known = true;
      }
      __syncthreads();
      end = after;
    }
    R sums[5] = {R(0), R(0), work.raised, work.held_p, work.held_d};
    for (int i = thread_; i < count_; i += threads) {
      R const d = d_[i], c = d * diagonal_[i];
      sums[0] = max(sums[0], abs(c));
      sums[1] = fma(d, c, sums[1]);
    }
    join_warps(sums, [](int k, R a, R b) { return k == 0 ? max(a, b) : a + b; });
    return {sums[0], sums[1], {sums[2], sums[3], sums[4]}};
  }
  /// The row at place i has moved by d, to p.
  /// @param rate  its rate before, after the rows before it;   @param together  of that, what the row has done that moves with it
  template <bool tells>
  __device__ void tell(SweepWork<R>& work, int i, DelassusLaw<R> const& law, R p, R d, R rate, R together) const {
    if constexpr (tells) work.template add_row<R>(p, d, rate, d * diagonal_[i], inverse(law), together);
  }
  /// @param moves  whether this thread's element does; all threads of a warp take part
  template <bool tells>
  __device__ void move(bool moves, Element const& k, SweepWork<R>& work) {
    bool const general = moves && !k.contact && k.rows > 1, contact = moves && k.contact;
    if (__any_sync(all, general)) several<tells>(general, k.i, k.rows, work);
    moves = moves && !general;
    int const count = moves ? k.count : 0;
    DelassusLaw<R> const &n0 = k.n0, &n1 = k.n1, &n2 = k.n2;
    R x[held], w0(0), w1(0), w2(0);
#pragma unroll
    for (int h = 0; h < held; ++h) {
      x[h] = sub_ + G * h < count ? z_[k.dof[h]] : R(0);
      w0 = fma(k.y0[h], x[h], w0);
    }
#pragma unroll 1
    for (int e = sub_ + G * held; e < count; e += G) w0 = fma(k.y[e], z_[k.list[e]], w0);
    if (__any_sync(all, contact)) {
#pragma unroll
      for (int h = 0; h < held; ++h) {
        w1 = fma(k.y1[h], x[h], w1);
        w2 = fma(k.y2[h], x[h], w2);
      }
#pragma unroll 1
      for (int e = sub_ + G * held; e < (contact ? count : 0); e += G) {
        w1 = fma(k.y[count + e], z_[k.list[e]], w1);
        w2 = fma(k.y[2 * count + e], z_[k.list[e]], w2);
      }
#pragma unroll
      for (int stride = G / 2; stride > 0; stride /= 2) {  // three at a time: each waits for itself alone
        R const s0 = __shfl_xor_sync(all, w0, stride), s1 = __shfl_xor_sync(all, w1, stride), s2 = __shfl_xor_sync(all, w2, stride);
        w0 += s0;
        w1 += s1;
        w2 += s2;
      }
    } else {
#pragma unroll
      for (int stride = G / 2; stride > 0; stride /= 2) w0 += __shfl_xor_sync(all, w0, stride);
    }
    if (!moves) return;
    w0 += k.b0;
    R const p0 = clamp(fma(n0.step, w0, n0.p), n0.lower, n0.upper), d0 = p0 - n0.p;
    R p1(0), p2(0), d1(0), d2(0);
    if (contact) {
      w1 = fma(k.coupling10, d0, w1 + k.b1);
      w2 = fma(k.coupling20, d0, w2 + k.b2);
      p1 = fma(n1.step, w1, n1.p);
      p2 = fma(n2.step, w2, n2.p);
      into_ellipse(n1.lower, n2.lower, abs(p0), p1, p2);
      d1 = p1 - n1.p;
      d2 = p2 - n2.p;
    }
#pragma unroll
    for (int h = 0; h < held; ++h)
      if (sub_ + G * h < count) z_[k.dof[h]] = fma(k.y2[h], d2, fma(k.y1[h], d1, fma(k.y0[h], d0, x[h])));
#pragma unroll 1
    for (int e = sub_ + G * held; e < count; e += G) {
      R& z = z_[k.list[e]];
      R to = fma(k.y[e], d0, z);
      if (contact) to = fma(k.y[2 * count + e], d2, fma(k.y[count + e], d1, to));
      z = to;
    }
    if (sub_ != 0) return;
    law_[k.i].p = p0;
    d_[k.i] = d0;
    tell<tells>(work, k.i, n0, p0, d0, w0, R(0));
    if (!contact) return;
    law_[k.i + 1].p = p1;
    law_[k.i + 2].p = p2;
    d_[k.i + 1] = d1;
    d_[k.i + 2] = d2;
    tell<tells>(work, k.i + 1, n1, p1, d1, w1, R(0));
    tell<tells>(work, k.i + 2, n2, p2, d2, fma(k.coupling21, d1, w2), k.coupling21 * d1);
  }
  /// Any other element of n rows, the first at place i, as project_element does it: row by row, or two together.
  template <bool tells>
  __device__ void several(bool moves, int i, int n, SweepWork<R>& work) {
    bool moved = false;  // with the row before
#pragma unroll 1
    for (int b = 0; __any_sync(all, moves && b < n); ++b) {
      bool const one = moves && b < n && !moved;
      int const at = one ? i + b : 0;
      DelassusRow const row = row_[at];
      bool const two = one && row.with_next;
      DelassusLaw<R> const law = law_[at], second = law_[two ? at + 1 : 0];
      R const w = rate(one, at, law.p), w2 = rate(two, at + 1, second.p);
      R const normal = one && row.friction_of >= 0 ? abs(law_[i + row.friction_of].p) : R(0), bound = law.lower * normal;
      R p1 = fma(law.step, w, law.p), p2 = fma(second.step, w2, second.p);
      if (two)
        into_ellipse(law.lower, second.lower, normal, p1, p2);
      else
        p1 = clamp(p1, row.friction_of < 0 ? law.lower : -bound, row.friction_of < 0 ? law.upper : bound);
      __syncwarp();  // all have read p and z
      if (one) move_row<tells>(at, law, w, p1, R(0), work);
      __syncwarp();
      R const after = tells ? rate(two, at + 1, second.p) : w2;
      __syncwarp();
      if (two) move_row<tells>(at + 1, second, after, p2, after - w2, work);
      __syncwarp();
      moved = two;
    }
  }
  /// The row at place i, of rate w, goes to impulse p.
  template <bool tells>
  __device__ void move_row(int i, DelassusLaw<R> const& law, R w, R p, R together, SweepWork<R>& work) {
    R const d = p - law.p;
    push(place_[i], d);
    if (sub_ != 0) return;
    law_[i].p = p;
    d_[i] = d;
    tell<tells>(work, i, law, p, d, w, together);
  }

  PgsDelassus<R, Mem> const& k_;
  Island const& island_;
  char* const memory_;                                   // of the block: at its begin what sums of all threads take
  int const first_, thread_, lane_, sub_, group_;        // group_: those beside each other are in different warps
  int count_, entries_, lists_, elements_, levels_ = 0;  // rows that are swept, numbers in Y, in dof
  DelassusLaw<R>* law_;                                  // with the impulses
  R *bias_, *compliance_, *diagonal_, *d_;               // of rows: d_: what the last sweep has changed p by
  R* remembered_[4];                                     // p and d of the last sweep of either side (mixing.hpp)
  R *z_, *z_before_, *Y_;
  Touched* touched_;
  SparseRow* place_;
  DelassusRow* row_;
  unsigned short *order_, *level_;  // where elements begin, level by level; where a level begins there
  unsigned short* dof_;             // numbers of dofs in the island
};

/// Islands that pgs_delassus_kernel does not take and that need more than `least` and at most `most` bytes. Solution::left says of all
/// whether they need more than `fit`, and are too large for any.
/// @param list  row of Solution::list_counts whose `taken` counts; -1: blocks take islands by their numbers
template <class R, class Mem, int W>
__global__ void __launch_bounds__(32 * W, W == sparse_few_warps ? 3 : 1)
    pgs_sparse_kernel(PgsDelassus<R, Mem> const __grid_constant__ solver, int list, std::int64_t least, std::int64_t most,
                      std::int64_t fit) {
  extern __shared__ __align__(32) char shared_memory[];
  __shared__ int next;
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
    SharedIsland<R, Mem, W> island(solver, own, shared_memory);
    std::int64_t const bytes = island.bytes();
    if (threadIdx.x == 0 && least == 0) solution.left(number) = bytes > fit;
    if (bytes <= least || bytes > most) continue;
    island.take();
    island.write(sweep_until_rest<R>(island, solver.options, R(solver.options.tolerance) * rows.rate_scale(own.world), own.rows > 0));
  }
}

}  // namespace gsp::detail
