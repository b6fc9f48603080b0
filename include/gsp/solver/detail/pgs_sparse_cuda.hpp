#pragma once
#include <cuda_pipeline.h>

#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/solver/detail/list_islands.hpp>
#include <gsp/solver/detail/pgs_delassus.hpp>
#include <gsp/solver/detail/sweep_until_rest.hpp>

/// Projected Gauss-Seidel on a GPU for islands that are not small (pgs_delassus.hpp): a warp each, over their sparse rows, which are copied
/// to shared memory in the order of the sweeps. An element's rates are sums over its entries, shared by the threads; all project it alike,
/// and each adds what that does to its dofs' z. What a sweep waits for is this way from one element to the next: memory that is near
/// makes it short. Islands that do not fit are left to pgs_islands.hpp.
namespace gsp::detail {

// Of a block: four fit in a multiprocessor of an H100, two in one of a smaller Ampere.
inline constexpr std::int64_t sparse_few_bytes = 48 * 1024;

/// Where the entries of a row stand, in the order of the sweeps.
struct SparseRow {
  int pool, entry;             // its number in the world, counted from Rows::first; of Y
  unsigned short list, count;  // of the numbers of its dofs, and how many
};

/// An island, for sweep_until_rest. All threads of the warp call all members together.
template <class R, class Mem>
class SharedIsland {
 public:
  /// Sizes alone; `take`, where there is room for `bytes`.
  __device__ SharedIsland(PgsDelassus<R, Mem> const& solver, Island const& island)
      : k_(solver), island_(island), first_(island.first_row), lane_(threadIdx.x) {
    int entries = 0, lists = 0, count = 0;
    for (int k = lane_; k < island.elements; k += 32) {
      int const n = island.rows_of(solver.rows, k);
      if (n == 0) continue;
      Sizes const own = sizes_of(island.begin(k), n);
      count += n;
      entries += own.entries;
      lists += own.lists;
    }
    count_ = __reduce_add_sync(all, count);
    entries_ = __reduce_add_sync(all, entries);
    lists_ = __reduce_add_sync(all, lists);
  }
  /// Shared memory that it takes.
  __device__ std::int64_t bytes() const {
    return std::int64_t(count_) * (sizeof(DelassusLaw<R>) + 5 * sizeof(R) + sizeof(SparseRow) + sizeof(DelassusRow)) + sizeof(DelassusRow) +
           (2 * std::int64_t(island_.dofs) + entries_) * sizeof(R) + std::int64_t(lists_) * sizeof(short) + 64;
  }
  /// Rows, entries and impulses, from the pools.
  __device__ void take(char* memory) {
    auto const next = [&](auto*& items, int n) {
      using Item = std::remove_reference_t<decltype(*items)>;
      items = reinterpret_cast<Item*>(memory);
      memory += std::int64_t(n) * std::int64_t(sizeof(Item));
    };
    next(law_, count_);
    for (R** v : {&bias_, &compliance_, &diagonal_, &before_, &d_}) next(*v, count_);
    next(z_, island_.dofs);
    next(z_before_, island_.dofs);
    next(Y_, entries_);
    next(place_, count_);
    next(row_, count_ + 1);
    next(dof_, lists_);
    read();
    sum();
  }

  __device__ SweepOutcome<R> sweep(bool tells) { return tells ? pass<true>() : pass<false>(); }
  __device__ void keep(bool leaps) {
    for (int k = lane_; leaps && k < island_.dofs; k += 32) z_before_[k] = z_[k];
  }
  /// z = Y^T p
  __device__ void sum() {
    __syncwarp();
    for (int k = lane_; k < island_.dofs; k += 32) z_[k] = R(0);
    __syncwarp();
    for (int i = 0; i < count_;) {
      DelassusRow const row = row_[i];
      if (row.contact) {
        SparseRow const place = place_[i];
        R const p0 = law_[i].p, p1 = law_[i + 1].p, p2 = law_[i + 2].p, *const y = Y_ + place.entry;
        for (int e = lane_; e < place.count; e += 32) {
          R& z = z_[dof_[place.list + e]];
          z = fma(y[2 * place.count + e], p2, fma(y[place.count + e], p1, fma(y[e], p0, z)));
        }
        __syncwarp();
      } else {
        for (int b = i; b < i + row.rows; ++b) {
          push(place_[b], law_[b].p);
          __syncwarp();
        }
      }
      i += row.rows;
    }
  }
  /// p as it was before it leapt or was mixed.
  __device__ void take_back() {
    for (int i = lane_; i < count_; i += 32) law_[i].p = before_[i] = k_.impulses.mixing[0](first_ + place_[i].pool);
    sum();
  }
  __device__ LeapSums<R> leap_sums() const {
    LeapSums<R> own{};
    for (int k = lane_; k < island_.dofs; k += 32) own.add_dof(z_[k], z_[k] - z_before_[k]);
    for (int i = lane_; i < count_; i += 32) own.add_row(law_[i].p, d_[i], compliance_[i], bias_[i], inverse(law_[i]));
    return {sum_of(own.pp), sum_of(own.pd), sum_of(own.dd), sum_of(own.bp), sum_of(own.yy)};
  }
  __device__ MixingSums<R> mixing_sums(bool both) const {
    MixingSums<R> own{};
    for (int i = lane_; i < count_; i += 32) {
      int const at = first_ + place_[i].pool;
      own.add_row(diagonal_[i], d_[i], k_.impulses.mixing[3](at), k_.impulses.mixing[1](at), both);
    }
    return {sum_of(own.dd11), sum_of(own.dd12), sum_of(own.dd22), sum_of(own.df1), sum_of(own.df2)};
  }
  /// Keeps p and d of the last sweep; p goes on to where a leap or a mixture leads.
  __device__ void go_on(int side, Leap<R> const& leap, Mixing<R> const& mixing, bool both) {
    for (int i = lane_; i < count_; i += 32) {
      int const at = first_ + place_[i].pool;
      R const now = law_[i].p;
      R p = now;
      if (leap.goes()) p = leap.of(now, d_[i]);
      if (mixing.helps()) p = mixing.of(now, k_.impulses.mixing[2](at), k_.impulses.mixing[0](at), both);
      k_.impulses.mixing[2 * side](at) = now;
      k_.impulses.mixing[2 * side + 1](at) = d_[i];
      law_[i].p = before_[i] = p;
    }
  }
  /// p and z, to the pools.
  __device__ void write(int sweeps) {
    R* const p = k_.impulses.p[k_.impulses.parity()].data() + first_;
    R* const z = k_.solution.z.data() + std::int64_t(island_.world) * k_.rows.nv;
    for (int i = lane_; i < count_; i += 32) p[place_[i].pool] = law_[i].p;
    for (int k = lane_; k < island_.dofs; k += 32) z[island_.dof(k)] = z_[k];
    if (lane_ == 0) tell_sweeps(k_.rows, k_.solution, island_.world, sweeps);
    __syncwarp();
  }

 private:
  static constexpr unsigned all = 0xffffffffu;
  static constexpr int held = 2;  // entries of a thread that stay in registers
  struct Sizes {
    int entries, lists;  // the former with the element's couplings
  };
  static __device__ int smaller(int a, int b) { return a < b ? a : b; }
  static __device__ R sum_of(R x) {
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) x += __shfl_xor_sync(all, x, stride);
    return x;
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
  /// Sum of x over the threads before this one; `total` grows by that of all.
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

  /// Rows in the order of the sweeps: the k-th element of one row behind as many of more, and so the other way round.
  __device__ void read() {
    auto* const behind = reinterpret_cast<unsigned short*>(z_);  // rows of the first k elements of more than one; in z, z_before and Y
    int singles = 0, severals = 0, rows_of_several = 0;
    for (int begin = 0; begin < island_.elements; begin += 32) {
      int const n = begin + lane_ < island_.elements ? island_.rows_of(k_.rows, begin + lane_) : 0;
      before_me(n == 1, singles);
      int const several = before_me(n > 1, severals), row = before_me(n > 1 ? n : 0, rows_of_several);
      if (n > 1) behind[several] = static_cast<unsigned short>(row);
    }
    if (lane_ == 0) behind[severals] = static_cast<unsigned short>(rows_of_several);
    __syncwarp();
    int single = 0, several = 0, row = 0, entry = 0, list = 0;
    for (int begin = 0; begin < island_.elements; begin += 32) {
      int const k = begin + lane_, n = k < island_.elements ? island_.rows_of(k_.rows, k) : 0;
      Sizes const own = n > 0 ? sizes_of(island_.begin(k), n) : Sizes{0, 0};
      int const my_single = before_me(n == 1, single), my_several = before_me(n > 1, several), my_row = before_me(n > 1 ? n : 0, row),
                my_entry = before_me(own.entries, entry), my_list = before_me(own.lists, list);
      if (n > 0)
        read_rows(n == 1 ? my_single + behind[smaller(my_single, severals)] : my_row + smaller(my_several + 1, singles), island_.begin(k),
                  n, my_entry, my_list);
    }
    if (lane_ == 0) row_[count_] = {0, -1, false, false};
    __syncwarp();
    for (int i = 0; i < count_; i += row_[i].rows) read_entries(i);
    __pipeline_commit();
    __pipeline_wait_prior(0);
    __syncwarp();
  }
  /// One thread: an element of n rows, the first being r of the world, to place i of the sweeps.
  __device__ void read_rows(int i, int r, int n, int entry, int list) {
    Row<R> const* const from = &k_.rows.row(first_ + r);
    R const* const p = k_.impulses.p[k_.impulses.parity()].data() + first_ + r;
    bool const same = from->same_segments;
    entry += n * (n - 1) / 2;
    for (int b = 0; b < n; ++b) {
      Row<R> const row = from[b];
      int const has = entries_of(row);
      R const inverse = row.inverse_diagonal;
      law_[i + b] = {-R(k_.options.relaxation) * inverse, row.friction_of < 0 ? row.lower : row.mu, row.upper, p[b]};
      bias_[i + b] = row.bias;
      compliance_[i + b] = row.compliance;
      diagonal_[i + b] = inverse > R(0) ? R(1) / inverse : R(0);
      before_[i + b] = p[b];
      d_[i + b] = R(0);
      place_[i + b] = {r + b, entry, static_cast<unsigned short>(list), static_cast<unsigned short>(has)};
      row_[i + b] = {static_cast<unsigned char>(b == 0 ? n : 0), row.friction_of, row.with_next && b + 1 < n, false};
      entry += has;
      if (!same) list += has;
    }
    row_[i].contact =
        n == 3 && same && from[0].friction_of < 0 && from[1].friction_of == 0 && from[1].with_next && from[2].friction_of == 0;
  }
  /// All threads: entries and numbers of dofs of the element at place i. (The former arrive until __pipeline_wait_prior.)
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
    for (int e = lane_; e < place.count; e += 32) {
      R& z = z_[dof_[place.list + e]];
      z = fma(Y_[place.entry + e], d, z);
    }
  }
  /// w = Y z + C p + b of the row at place i.
  __device__ R rate(int i, R p) const {
    SparseRow const place = place_[i];
    R w(0);
    for (int e = lane_; e < place.count; e += 32) w = fma(Y_[place.entry + e], z_[dof_[place.list + e]], w);
    return fma(compliance_[i], p, bias_[i]) + sum_of(w);
  }
  /// What is known of a contact before those before it have moved z: it is read while they do.
  struct Contact {
    DelassusLaw<R> n0, n1, n2;
    R b0, b1, b2;  // C p + b
    R coupling10, coupling20, coupling21;
    R const* y;
    unsigned short const* list;
    int count, dof[held];
    R y0[held], y1[held], y2[held];
  };
  __device__ void read_contact(int i, Contact& k) const {
    SparseRow const place = place_[i];
    k.n0 = law_[i];
    k.n1 = law_[i + 1];
    k.n2 = law_[i + 2];
    k.y = Y_ + place.entry;
    k.list = dof_ + place.list;
    k.count = place.count;
#pragma unroll
    for (int h = 0; h < held; ++h) {
      int const e = lane_ + 32 * h;
      bool const has = e < k.count;
      k.dof[h] = has ? k.list[e] : 0;
      k.y0[h] = has ? k.y[e] : R(0);
      k.y1[h] = has ? k.y[k.count + e] : R(0);
      k.y2[h] = has ? k.y[2 * k.count + e] : R(0);
    }
    k.coupling10 = k.y[-3];
    k.coupling20 = k.y[-2];
    k.coupling21 = k.y[-1];
    k.b0 = fma(compliance_[i], k.n0.p, bias_[i]);
    k.b1 = fma(compliance_[i + 1], k.n1.p, bias_[i + 1]);
    k.b2 = fma(compliance_[i + 2], k.n2.p, bias_[i + 2]);
  }
  template <bool tells>
  __device__ SweepOutcome<R> pass() {
    SweepOutcome<R> to;
    __syncwarp();
    DelassusRow e = row_[0];
    int i = 0;
    Contact even, odd;  // the one at hand and the next take turns
    if (e.contact) read_contact(0, even);
    auto const one = [&](Contact const& own, Contact& next) {
      int const after = i + e.rows;
      DelassusRow const then = row_[after];
      if (then.contact) read_contact(after, next);
      if (e.contact)
        contact<tells>(i, own, to.work);
      else
        element<tells>(i, e.rows, to.work);
      i = after;
      e = then;
    };
#pragma unroll 1
    while (e.rows > 0) {
      one(even, odd);
      if (e.rows > 0) one(odd, even);
    }
    for (int i = lane_; i < count_; i += 32) {
      R const p = law_[i].p, d = p - before_[i], c = d * diagonal_[i];
      d_[i] = d;
      before_[i] = p;
      to.change = max(to.change, abs(c));
      to.misses = fma(d, c, to.misses);
    }
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) to.change = max(to.change, __shfl_xor_sync(all, to.change, stride));
    to.misses = sum_of(to.misses);
    return to;
  }
  /// What SweepWork asks of a row.
  __device__ void tell(SweepWork<R>& work, DelassusLaw<R> const& law, R p, R d, R rate, R diagonal, R together) const {
    work.template add_row<R>(p, d, rate, d * diagonal, inverse(law), together);
  }
  template <bool tells>
  __device__ void contact(int i, Contact const& k, SweepWork<R>& work) {
    DelassusLaw<R> const &n0 = k.n0, &n1 = k.n1, &n2 = k.n2;
    R x[held], w0(0), w1(0), w2(0);
#pragma unroll
    for (int h = 0; h < held; ++h) {
      x[h] = z_[k.dof[h]];
      w0 = fma(k.y0[h], x[h], w0);
      w1 = fma(k.y1[h], x[h], w1);
      w2 = fma(k.y2[h], x[h], w2);
    }
    for (int e = lane_ + 32 * held; e < k.count; e += 32) {
      R const more = z_[k.list[e]];
      w0 = fma(k.y[e], more, w0);
      w1 = fma(k.y[k.count + e], more, w1);
      w2 = fma(k.y[2 * k.count + e], more, w2);
    }
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) {  // three at a time: each waits for itself alone
      R const s0 = __shfl_xor_sync(all, w0, stride), s1 = __shfl_xor_sync(all, w1, stride), s2 = __shfl_xor_sync(all, w2, stride);
      w0 += s0;
      w1 += s1;
      w2 += s2;
    }
    w0 += k.b0;
    w1 += k.b1;
    w2 += k.b2;
    __syncwarp();  // all have read p and z
    R const p0 = clamp(fma(n0.step, w0, n0.p), n0.lower, n0.upper), d0 = p0 - n0.p;
    w1 = fma(k.coupling10, d0, w1);
    w2 = fma(k.coupling20, d0, w2);
    R p1 = fma(n1.step, w1, n1.p), p2 = fma(n2.step, w2, n2.p);
    into_ellipse(n1.lower, n2.lower, abs(p0), p1, p2);
    R const d1 = p1 - n1.p, d2 = p2 - n2.p;
    if constexpr (tells) {  // of rates after the rows before have moved
      tell(work, n0, p0, d0, w0, diagonal_[i], R(0));
      tell(work, n1, p1, d1, w1, diagonal_[i + 1], R(0));
      tell(work, n2, p2, d2, fma(k.coupling21, d1, w2), diagonal_[i + 2], k.coupling21 * d1);
    }
    if (lane_ < 3) law_[i + lane_].p = lane_ == 0 ? p0 : lane_ == 1 ? p1 : p2;
#pragma unroll
    for (int h = 0; h < held; ++h)
      if (lane_ + 32 * h < k.count) z_[k.dof[h]] = fma(k.y2[h], d2, fma(k.y1[h], d1, fma(k.y0[h], d0, x[h])));
    for (int e = lane_ + 32 * held; e < k.count; e += 32)
      z_[k.list[e]] = fma(k.y[2 * k.count + e], d2, fma(k.y[k.count + e], d1, fma(k.y[e], d0, z_[k.list[e]])));
    __syncwarp();
  }
  /// Any other element, as project_element does it: row by row, or two together.
  template <bool tells>
  __device__ void element(int i, int rows, SweepWork<R>& work) {
#pragma unroll 1
    for (int b = i; b < i + rows; ++b) {
      DelassusRow const row = row_[b];
      DelassusLaw<R> const law = law_[b];
      R const w = rate(b, law.p), normal = row.friction_of < 0 ? R(0) : abs(law_[i + row.friction_of].p);
      if (!row.with_next) {
        R const bound = law.lower * normal, least = row.friction_of < 0 ? law.lower : -bound,
                most = row.friction_of < 0 ? law.upper : bound;
        move<tells>(b, law, w, clamp(fma(law.step, w, law.p), least, most), R(0), work);
        continue;
      }
      DelassusLaw<R> const second = law_[b + 1];
      R const w2 = rate(b + 1, second.p);
      R p1 = fma(law.step, w, law.p), p2 = fma(second.step, w2, second.p);
      into_ellipse(law.lower, second.lower, normal, p1, p2);
      move<tells>(b, law, w, p1, R(0), work);
      ++b;
      R const after = tells ? rate(b, second.p) : w2;
      move<tells>(b, second, after, p2, after - w2, work);
    }
  }
  /// The row at place i, of rate w, goes to impulse p.
  template <bool tells>
  __device__ void move(int i, DelassusLaw<R> const& law, R w, R p, R together, SweepWork<R>& work) {
    R const d = p - law.p;
    if constexpr (tells) tell(work, law, p, d, w, diagonal_[i], together);
    __syncwarp();  // all have read p and z
    if (lane_ == 0) law_[i].p = p;
    push(place_[i], d);
    __syncwarp();
  }

  PgsDelassus<R, Mem> const& k_;
  Island const& island_;
  int const first_, lane_;
  int count_, entries_, lists_;                       // rows that are swept, numbers in Y, in dof
  DelassusLaw<R>* law_;                               // with the impulses
  R *bias_, *compliance_, *diagonal_, *before_, *d_;  // of rows: before_: p before the last sweep; d_: what that has changed
  R *z_, *z_before_, *Y_;
  SparseRow* place_;
  DelassusRow* row_;
  unsigned short* dof_;  // numbers of dofs in the island
};

/// Islands that pgs_delassus_kernel does not take and that need more than `least` and at most `most` bytes. Solution::left says of all
/// whether they are too large for any.
/// @param list  row of Solution::list_counts whose `taken` counts; -1: blocks take islands by their numbers
template <class R, class Mem>
__global__ void __launch_bounds__(32)
    pgs_sparse_kernel(PgsDelassus<R, Mem> const __grid_constant__ solver, int list, std::int64_t least, std::int64_t most) {
  extern __shared__ __align__(32) char shared_memory[];
  if (solver.halt()) return;
  auto const& rows = solver.rows;
  auto const& solution = solver.solution;
  int const of_world = islands_of_world(rows), islands = rows.worlds * of_world;
  auto const solve = [&](int number) {
    Island const own = island_of(rows, number / of_world, number % of_world);
    SharedIsland<R, Mem> island(solver, own);
    std::int64_t const bytes = island.bytes();
    if (threadIdx.x == 0 && least == 0) solution.left(number) = bytes > delassus_most_bytes;
    if (bytes <= least || bytes > most) return;
    island.take(shared_memory);
    island.write(sweep_until_rest<R>(island, solver.options, R(solver.options.tolerance) * rows.rate_scale(own.world), own.rows > 0));
  };
  if (list < 0) {
    for (int number = int(blockIdx.x); number < islands; number += int(gridDim.x))
      if (is_island(rows, number / of_world, number % of_world) &&
          !delassus_takes(rows, island_of(rows, number / of_world, number % of_world)))
        solve(number);
    return;
  }
  int const count = solution.list_counts(large_island, few_sweeps) + solution.list_counts(large_island, many_sweeps);
  for (;;) {
    int at = threadIdx.x == 0 ? atomicAdd(&solution.list_counts(list, taken), 1) : 0;
    at = __shfl_sync(0xffffffffu, at, 0);
    if (at >= count) return;
    solve(solution.listed(0, at));
  }
}

}  // namespace gsp::detail
