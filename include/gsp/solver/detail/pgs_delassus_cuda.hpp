#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/solver/detail/pgs_delassus.hpp>
#include <gsp/solver/detail/sweep_until_rest.hpp>

/// The kernel of pgs_delassus.hpp. The rates w of all rows stay in registers, rows i, i + 32, ... in thread i. An element reads its own,
/// all threads project it alike, and each adds to its rows' rates what that does, columns of A. Rows stand in the order of the sweeps:
/// elements of one row and of more take turns.
namespace gsp::detail {

/// A world, for sweep_until_rest. All threads of the warp call all members together.
/// @tparam S  rows a thread;   @tparam triangle  whether A is its lower triangle
template <class R, class Mem, int S, bool triangle>
class DelassusWorld {
 public:
  /// Rows, entries and impulses, from the pools.
  __device__ DelassusWorld(PgsDelassus<R, Mem> const& solver, int w, char* memory)
      : k_(solver), world_(w), first_(solver.rows.first(w)), lane_(threadIdx.x) {
    int const count = k_.rows.count(w), nv = k_.rows.nv;
    stride_ = delassus_stride(count);
    dofs_ = delassus_dofs(count, nv);
    law_ = reinterpret_cast<DelassusLaw<R>*>(memory);
    A_ = reinterpret_cast<R*>(law_ + stride_);
    Y_ = A_ + delassus_matrix(count, triangle);
    row_ = reinterpret_cast<DelassusRow*>(Y_ + dofs_ * stride_);
    find_order(count);
#pragma unroll
    for (int s = 0; s < S; ++s) {
      if constexpr (triangle) own_[s] = smaller(lane_ + 32 * s, count_);
      read_row(s);
    }
    for (int i = lane_; i < delassus_matrix(count, triangle); i += 32) A_[i] = R(0);
    __syncwarp();
    for (int dof = 0; dof < nv; dof += dofs_) {
      spread(dof);
      multiply(smaller(dofs_, nv - dof));
    }
    add_compliance();
    sum();
  }

  /// w = A p + b
  __device__ void sum() {
#pragma unroll
    for (int s = 0; s < S; ++s) {
      if (int const i = lane_ + 32 * s; i < count_) law_[i].p = p_[s];
      w_[s] = bias_[s];
    }
    __syncwarp();
#pragma unroll 4
    for (int i = 0; i < count_; ++i) {
      R const p = law_[i].p;
#pragma unroll
      for (int s = 0; s < S; ++s) w_[s] = fma(entry(s, i), p, w_[s]);
    }
    __syncwarp();
  }
  __device__ SweepOutcome<R> sweep(bool tells) { return tells ? pass<true>() : pass<false>(); }
  __device__ void keep(bool leaps) {
    if (!leaps) return;
#pragma unroll
    for (int s = 0; s < S; ++s) w_before_[s] = w_[s];
  }
  /// p as it was before it leapt or was mixed.
  __device__ void take_back() {
#pragma unroll
    for (int s = 0; s < S; ++s) p_[s] = p1_[s];
    sum();
  }
  /// With Y^T p as a sum over rows:   p.Ap = sum p (w - b)
  __device__ LeapSums<R> leap_sums() const {
    LeapSums<R> own{};
#pragma unroll
    for (int s = 0; s < S; ++s) {
      if (lane_ + 32 * s >= count_) continue;
      R const forced = w_[s] - bias_[s];
      own.pp = fma(p_[s], forced, own.pp);
      own.pd = fma(d_[s], forced, own.pd);
      own.dd = fma(d_[s], w_[s] - w_before_[s], own.dd);
      own.bp = fma(bias_[s], p_[s], own.bp);
      own.yy = fma(p_[s], p_[s] * diagonal_[s], own.yy);
    }
    return {sum_of(own.pp), sum_of(own.pd), sum_of(own.dd), sum_of(own.bp), sum_of(own.yy)};
  }
  __device__ MixingSums<R> mixing_sums(bool both) const {
    MixingSums<R> own{};
#pragma unroll
    for (int s = 0; s < S; ++s)
      if (lane_ + 32 * s < count_) own.add_row(diagonal_[s], d_[s], d1_[s], d2_[s], both);
    return {sum_of(own.dd11), sum_of(own.dd12), sum_of(own.dd22), sum_of(own.df1), sum_of(own.df2)};
  }
  /// Keeps p and d of the last sweep, and of the one before; p goes on to where a leap or a mixture leads.
  __device__ void go_on(int, Leap<R> const& leap, Mixing<R> const& mixing, bool both) {
#pragma unroll
    for (int s = 0; s < S; ++s) {
      R const now = p_[s];
      if (leap.goes()) p_[s] = leap.of(now, d_[s]);
      if (mixing.helps()) p_[s] = mixing.of(now, p1_[s], p2_[s], both);
      p2_[s] = p1_[s];
      d2_[s] = d1_[s];
      p1_[s] = now;
      d1_[s] = d_[s];
    }
  }
  /// p, and z = Y^T p, to the pools.
  __device__ void write(int sweeps) {
    R* const p = k_.impulses.p[k_.impulses.parity()].data() + first_;
    int const nv = k_.rows.nv;
    R* const z = k_.solution.z.data() + std::int64_t(world_) * nv;
#pragma unroll
    for (int s = 0; s < S; ++s)
      if (int const i = lane_ + 32 * s; i < count_) p[row_[i].pool] = p_[s];
    for (int begin = 0; begin < nv; begin += dofs_) {
      __syncwarp();                   // all have read those before
      if (nv > dofs_) spread(begin);  // else it is there
      R own(0);
#pragma unroll 4
      for (int k = 0; k < dofs_ && begin + k < nv; ++k) {
        R part(0);
#pragma unroll
        for (int s = 0; s < S; ++s)
          if (int const i = lane_ + 32 * s; i < count_) part = fma(Y_[k * stride_ + i], p_[s], part);
        part = sum_of(part);
        if (lane_ == k) own = part;
      }
      if (lane_ < dofs_ && begin + lane_ < nv) z[begin + lane_] = own;
    }
    if (lane_ == 0) {
      k_.solution.iterations(world_) = sweeps;
      k_.solution.residual(world_) = Kokkos::Experimental::quiet_NaN_v<R>;  // PgsResidual finds it
    }
    __syncwarp();
  }

 private:
  struct DofRange {
    unsigned char first[2] = {}, end[2] = {};  // of its segments; empty: first = end
  };
  static constexpr unsigned all = 0xffffffffu;
  static __device__ int smaller(int a, int b) { return a < b ? a : b; }
  static __device__ R sum_of(R x) {
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) x += __shfl_xor_sync(all, x, stride);
    return x;
  }
  static __device__ R most_of(R x) {
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) x = max(x, __shfl_xor_sync(all, x, stride));
    return x;
  }
  /// Where A of rows i <= j stands.
  __device__ int place(int i, int j) const { return triangle ? triangle_line(j) + i : i * stride_ + j; }
  /// A of row i and the thread's row of place s; any number, of all but many rows, where it has none.
  __device__ R entry(int s, int i) const {
    if constexpr (!triangle)
      return A_[i * stride_ + lane_ + 32 * s];
    else
      return A_[i <= own_[s] ? place(i, own_[s]) : place(own_[s], i)];
  }
  /// Rate of row i, which one thread has.
  __device__ R rate(int i) const {
    R own = w_[0];
#pragma unroll
    for (int s = 1; s < S; ++s) own = i < 32 * s ? own : w_[s];
    return __shfl_sync(all, own, i % 32);
  }

  /// Where the rows of the pool stand in a sweep; eliminated ones are left out. The k-th element of one row stands behind as many of more.
  __device__ void find_order(int count) {
    auto const& rows = k_.rows;
    unsigned single[S], several[S], of_several[S];
    unsigned const below = (1u << lane_) - 1u;
    int rows_of[S];
#pragma unroll
    for (int s = 0; s < S; ++s) {
      int const r = lane_ + 32 * s;
      bool const is = r < count && !rows.row(first_ + r).eliminated;
      rows_of[s] = is ? rows.element_rows(first_ + r) : -1;
      single[s] = __ballot_sync(all, rows_of[s] == 1);
      several[s] = __ballot_sync(all, rows_of[s] > 1);
      of_several[s] = __ballot_sync(all, rows_of[s] > 1 || rows_of[s] == 0);
    }
    auto* const behind = reinterpret_cast<unsigned char*>(A_);  // rows of the first k elements of more than one
    int singles = 0, severals = 0, rows_of_several = 0;
    int before_single[S], before_several[S], before_row[S];
#pragma unroll
    for (int s = 0; s < S; ++s) {
      before_single[s] = singles + __popc(single[s] & below);
      before_several[s] = severals + __popc(several[s] & below);
      before_row[s] = rows_of_several + __popc(of_several[s] & below);
      if (rows_of[s] > 1) behind[before_several[s]] = static_cast<unsigned char>(before_row[s]);
      singles += __popc(single[s]);
      severals += __popc(several[s]);
      rows_of_several += __popc(of_several[s]);
    }
    if (lane_ == 0) behind[severals] = static_cast<unsigned char>(rows_of_several);
    __syncwarp();
    count_ = singles + rows_of_several;
    int place[S];
#pragma unroll
    for (int s = 0; s < S; ++s) {
      if (rows_of[s] < 0) continue;
      int const r = lane_ + 32 * s, own = before_several[s] + (rows_of[s] > 1);  // elements of more, up to this one
      place[s] = rows_of[s] == 1 ? before_single[s] + behind[smaller(before_single[s], severals)] : before_row[s] + smaller(own, singles);
      Row<R> const& from = rows.row(first_ + r);
      bool const with_next = from.with_next && r + 1 < count && rows.element_rows(first_ + r + 1) == 0;
      row_[place[s]] = {static_cast<unsigned char>(r), static_cast<unsigned char>(rows_of[s]), from.friction_of, with_next, false};
    }
    if (lane_ == 0) row_[count_] = {0, 0, -1, false, false};
    __syncwarp();
#pragma unroll
    for (int s = 0; s < S; ++s)
      if (rows_of[s] == 3) {
        DelassusRow* const own = row_ + place[s];
        own->contact = own[0].friction_of < 0 && own[1].friction_of == 0 && own[1].with_next && own[2].friction_of == 0;
      }
    __syncwarp();
  }
  /// Numbers of the thread's row of place s, and which dofs its segments are of.
  __device__ void read_row(int s) {
    bias_[s] = p_[s] = d_[s] = diagonal_[s] = R(0);
    range_[s] = {};
    int const i = lane_ + 32 * s;
    if (i >= count_) return;
    int const of_pool = first_ + row_[i].pool;
    Row<R> const from = k_.rows.row(of_pool);
    R const inverse = from.inverse_diagonal;
    diagonal_[s] = inverse > R(0) ? R(1) / inverse : R(0);
    bias_[s] = from.bias;
    p_[s] = k_.impulses.p[k_.impulses.parity()](of_pool);
    law_[i] = {-R(k_.options.relaxation) * inverse, from.friction_of < 0 ? from.lower : from.mu, from.upper, p_[s]};
#pragma unroll
    for (int t = 0; t < 2; ++t) {
      RowSegment const segment = from.segment[t];
      if (segment.count == 0) continue;
      int const* const list = list_of(k_.rows, segment);
      range_[s].first[t] = static_cast<unsigned char>(segment.dof0);
      range_[s].end[t] = static_cast<unsigned char>(segment.dof0 + (list ? list[segment.count - 1] + 1 : segment.count));
    }
  }
  /// Y of the next dofs from `begin` on, dof by dof, from the pool, and which rows have any.
  __device__ void spread(int begin) {
    auto const& rows = k_.rows;
    int const dofs = smaller(dofs_, rows.nv - begin), end = begin + dofs;
    for (int i = lane_; i < dofs * stride_; i += 32) Y_[i] = R(0);
    __syncwarp();
#pragma unroll
    for (int s = 0; s < S; ++s) {
      int const i = lane_ + 32 * s;
      DofRange const range = range_[s];
      bool const first = range.first[0] < end && range.end[0] > begin, second = range.first[1] < end && range.end[1] > begin;
      touching_[s] = __ballot_sync(all, first || second);
      if (!first && !second) continue;
      Row<R> const& row = rows.row(first_ + row_[i].pool);
      R const* y = rows.Y.data() + row.first_entry;
#pragma unroll
      for (int t = 0; t < 2; ++t) {
        RowSegment const segment = row.segment[t];
        int const* const list = list_of(rows, segment);
        int const count = (t == 0 ? first : second) ? segment.count : 0, from = segment.dof0 - begin;
#pragma unroll 4
        for (int e = 0; e < count; ++e) {
          int const k = from + (list ? list[e] : e);
          if (k >= 0 && k < dofs) Y_[k * stride_ + i] = y[e];
        }
        y += segment.count;
      }
    }
    __syncwarp();
  }
  /// A += Y Y^T of these dofs, four columns at a time.
  __device__ void multiply(int dofs) const {
    struct alignas(4 * sizeof(R)) Four {
      R of[4];
    };
#pragma unroll 1
    for (int column = 0; column < count_; column += 4) {
      unsigned touching = touching_[0];
#pragma unroll
      for (int s = 1; s < S; ++s) touching = column < 32 * s ? touching : touching_[s];
      if ((touching >> column % 32 & 0xfu) == 0) continue;
      R sum[4][S];
#pragma unroll
      for (int c = 0; c < 4; ++c)
#pragma unroll
        for (int s = 0; s < S; ++s) sum[c][s] = R(0);
#pragma unroll 4
      for (int k = 0; k < dofs; ++k) {
        Four const other = *reinterpret_cast<Four const*>(Y_ + k * stride_ + column);
#pragma unroll
        for (int s = 0; s < S; ++s) {
          if (triangle && 32 * s + 31 < column) continue;  // of no row behind
          R const own = Y_[k * stride_ + smaller(lane_ + 32 * s, stride_ - 1)];
#pragma unroll
          for (int c = 0; c < 4; ++c) sum[c][s] = fma(other.of[c], own, sum[c][s]);
        }
      }
#pragma unroll
      for (int c = 0; c < 4; ++c)
#pragma unroll
        for (int s = 0; s < S; ++s)
          if (int const i = lane_ + 32 * s; i < count_ && column + c < (triangle ? i + 1 : count_)) A_[place(column + c, i)] += sum[c][s];
    }
    __syncwarp();
  }
  /// A += C
  __device__ void add_compliance() const {
#pragma unroll
    for (int s = 0; s < S; ++s)
      if (int const i = lane_ + 32 * s; i < count_) A_[place(i, i)] += k_.rows.row(first_ + row_[i].pool).compliance;
    __syncwarp();
  }

  template <bool tells>
  __device__ SweepOutcome<R> pass() {
    SweepOutcome<R> to;
    DelassusRow e = row_[0];
#pragma unroll 1
    for (int i = 0; e.rows > 0;) {  // one row, and the element that takes turns with it
      if (e.rows == 1) {
        single<tells>(i, to.work);
        e = row_[++i];
      }
      if (e.contact) {
        contact<tells>(i, to.work);
        e = row_[i += 3];
      } else if (e.rows > 1) {
        element<tells>(i, e.rows, to.work);
        e = row_[i += e.rows];
      }
    }
    __syncwarp();
#pragma unroll
    for (int s = 0; s < S; ++s) {
      int const i = lane_ + 32 * s;
      if (i >= count_) continue;
      R const p = law_[i].p;
      d_[s] = p - p_[s];
      p_[s] = p;
      R const c = d_[s] * diagonal_[s];
      to.change = max(to.change, abs(c));
      to.misses = fma(d_[s], c, to.misses);
    }
    to.change = most_of(to.change);
    to.misses = sum_of(to.misses);
    return to;
  }
  /// What SweepWork asks of a row.
  __device__ void tell(SweepWork<R>& work, R p, R d, R rate, R step, R together) const {
    R const inverse = step / -R(k_.options.relaxation);
    work.template add_row<R>(p, d, rate, inverse > R(0) ? d / inverse : R(0), inverse, together);
  }
  template <bool tells>
  __device__ void single(int i, SweepWork<R>& work) {
    DelassusLaw<R> const law = law_[i];
    R column[S];
#pragma unroll
    for (int s = 0; s < S; ++s) column[s] = entry(s, i);
    R const w = rate(i), p = clamp(fma(law.step, w, law.p), law.lower, law.upper), d = p - law.p;
    __syncwarp();  // all have read p
#pragma unroll
    for (int s = 0; s < S; ++s) w_[s] = fma(column[s], d, w_[s]);
    if (lane_ == 0) law_[i].p = p;
    if constexpr (tells) tell(work, p, d, w, law.step, R(0));
  }
  template <bool tells>
  __device__ void contact(int i, SweepWork<R>& work) {
    DelassusLaw<R> const n0 = law_[i], n1 = law_[i + 1], n2 = law_[i + 2];
    R const coupling10 = A_[place(i, i + 1)], coupling20 = A_[place(i, i + 2)], coupling21 = A_[place(i + 1, i + 2)];
    R column0[S], column1[S], column2[S];
#pragma unroll
    for (int s = 0; s < S; ++s) {
      column0[s] = entry(s, i);
      column1[s] = entry(s, i + 1);
      column2[s] = entry(s, i + 2);
    }
    R const w0 = rate(i);
    R w1 = rate(i + 1), w2 = rate(i + 2);
    __syncwarp();  // all have read p
    R const p0 = clamp(fma(n0.step, w0, n0.p), n0.lower, n0.upper), d0 = p0 - n0.p;
    w1 = fma(coupling10, d0, w1);
    w2 = fma(coupling20, d0, w2);
    R p1 = fma(n1.step, w1, n1.p), p2 = fma(n2.step, w2, n2.p);
    R const mu1 = n1.lower, mu2 = n2.lower, q1 = p1 * mu2, q2 = p2 * mu1, r2 = fma(q1, q1, q2 * q2), radius = mu1 * mu2 * abs(p0);
    if (r2 > radius * radius) {
      R const scale = radius * Kokkos::rsqrt(r2);
      p1 = scale * p1;
      p2 = scale * p2;
    }
    R const d1 = p1 - n1.p, d2 = p2 - n2.p;
#pragma unroll
    for (int s = 0; s < S; ++s) w_[s] = fma(column2[s], d2, fma(column1[s], d1, fma(column0[s], d0, w_[s])));
    if (lane_ < 3) law_[i + lane_].p = lane_ == 0 ? p0 : lane_ == 1 ? p1 : p2;
    if constexpr (tells) {  // of rates after the rows before have moved
      tell(work, p0, d0, w0, n0.step, R(0));
      tell(work, p1, d1, w1, n1.step, R(0));
      tell(work, p2, d2, fma(coupling21, d1, w2), n2.step, coupling21 * d1);
    }
  }
  /// Any other element of several rows, as project_element does it: row by row, or two together.
  template <bool tells>
  __device__ void element(int i, int rows, SweepWork<R>& work) {
#pragma unroll 1
    for (int b = i; b < i + rows; ++b) {
      __syncwarp();  // p of the rows before
      DelassusRow const row = row_[b];
      DelassusLaw<R> const law = law_[b];
      R const w = rate(b), normal = row.friction_of < 0 ? R(0) : abs(law_[i + row.friction_of].p);
      if (!row.with_next) {
        R const bound = law.lower * normal, least = row.friction_of < 0 ? law.lower : -bound,
                most = row.friction_of < 0 ? law.upper : bound;
        move<tells>(b, law, w, clamp(fma(law.step, w, law.p), least, most), R(0), work);
        continue;
      }
      DelassusLaw<R> const second = law_[b + 1];
      R p1 = fma(law.step, w, law.p), p2 = fma(second.step, rate(b + 1), second.p);
      R const q1 = p1 * second.lower, q2 = p2 * law.lower, r2 = fma(q1, q1, q2 * q2), radius = law.lower * second.lower * normal;
      if (r2 > radius * radius) {
        R const scale = radius * Kokkos::rsqrt(r2);
        p1 = scale * p1;
        p2 = scale * p2;
      }
      R const together = A_[place(b, b + 1)] * (p1 - law.p);
      move<tells>(b, law, w, p1, R(0), work);
      ++b;
      move<tells>(b, second, rate(b), p2, together, work);
    }
  }
  /// Row i, of rate w, goes to impulse p.
  template <bool tells>
  __device__ void move(int i, DelassusLaw<R> const& law, R w, R p, R together, SweepWork<R>& work) {
    R const d = p - law.p;
    __syncwarp();  // all have read p
#pragma unroll
    for (int s = 0; s < S; ++s) w_[s] = fma(entry(s, i), d, w_[s]);
    if (lane_ == 0) law_[i].p = p;
    if constexpr (tells) tell(work, p, d, w, law.step, together);
  }

  PgsDelassus<R, Mem> const& k_;
  int const world_, first_, lane_;
  int count_ = 0, stride_, dofs_;  // rows that are swept; numbers from one row of A, or dof of Y, to the next; dofs of Y at a time
  DelassusLaw<R>* law_;            // whose p is that of p_ but for a sweep, and until `sum` has been called
  R *A_, *Y_;
  DelassusRow* row_;
  int own_[triangle ? S : 1];  // the thread's rows, or the line of zeros
  DofRange range_[S];
  unsigned touching_[S];  // bits of the rows that have entries in the dofs of Y that are there
  R w_[S], bias_[S], p_[S], diagonal_[S];
  R d_[S], w_before_[S] = {};                            // of the last sweep
  R p1_[S] = {}, d1_[S] = {}, p2_[S] = {}, d2_[S] = {};  // p after the last sweep that was remembered and the one before, and their d
};

/// Lists the worlds; those that took many sweeps in the last step stand in front, as they may again: what is long begins first.
template <class R, class Mem>
__global__ void list_delassus_kernel(PgsDelassus<R, Mem> const __grid_constant__ solver) {
  constexpr int many = 33;  // sweeps: about the mean of humanoids that lie
  if (solver.halt()) return;
  auto const& solution = solver.solution;
  int const w = blockIdx.x * blockDim.x + threadIdx.x, list = w < solver.rows.worlds ? delassus_list(solver.rows, w) : -1;
  if (list < 0) return;
  bool const few = solution.iterations(w) < many;
  int const at = atomicAdd(&solution.list_counts(list, int(few)), 1);
  solution.listed_worlds(list, few ? solver.rows.worlds - 1 - at : at) = w;
}

/// @param list  of worlds; -1: a world a block, its number is the block's, where it has as many rows a thread
template <class R, class Mem, int S, bool triangle>
__global__ void __launch_bounds__(32) pgs_delassus_kernel(PgsDelassus<R, Mem> const __grid_constant__ solver, int list) {
  extern __shared__ __align__(32) char shared_memory[];
  if (solver.halt()) return;
  auto const& solution = solver.solution;
  auto const solve = [&](int w) {
    DelassusWorld<R, Mem, S, triangle> world(solver, w, shared_memory);
    R const tolerance = R(solver.options.tolerance) * solver.rows.rate_scale(w);
    world.write(sweep_until_rest<R>(world, solver.options, tolerance, solver.rows.count(w) > 0));
  };
  if (list < 0) {
    int const own = delassus_list(solver.rows, blockIdx.x);
    if (own >= 0 && (delassus_rows(own) + 31) / 32 == S) solve(blockIdx.x);
    return;
  }
  int const front = solution.list_counts(list, 0), worlds = front + solution.list_counts(list, 1);
  for (;;) {
    int at = threadIdx.x == 0 ? atomicAdd(&solution.list_counts(list, 2), 1) : 0;
    at = __shfl_sync(0xffffffffu, at, 0);
    if (at >= worlds) return;
    solve(solution.listed_worlds(list, at < front ? at : solver.rows.worlds - 1 - (at - front)));
  }
}

template <class Exec, class R, class Mem>
void launch_pgs_delassus(Exec const& exec, PgsDelassus<R, Mem> const& solver) {
  int const nv = solver.rows.nv, worlds = solver.rows.worlds;
  if (nv > lockstep_most_dofs) return;  // no world belongs to a list, and there are none
  auto const& device = exec.cuda_device_prop();
  auto const at_a_time = [&](int bytes) {
    return device.multiProcessorCount *
           std::clamp(int(device.sharedMemPerMultiprocessor) / (bytes + int(device.reservedSharedMemPerBlock)), 1, 32);
  };
  auto const launch = [&](cudaStream_t stream, int rows, int list) {
    int const full = int(delassus_bytes<R>(rows, nv));
    if (full > delassus_most_bytes) return;
    bool const triangle = rows > 64 && worlds > 2 * at_a_time(full);
    int const bytes = int(delassus_bytes<R>(rows, nv, triangle)), grid = list < 0 ? worlds : std::min(worlds, at_a_time(bytes));
    auto const one = [&](auto* kernel) {
      if (bytes > int(device.sharedMemPerBlock))
        // a limit of the kernel, not of this launch: another thread's launch may need all
        cuda_expects(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, int(delassus_most_bytes)),
                     "gsp::solver::pgs_delassus, shared memory");
      kernel<<<grid, 32, bytes, stream>>>(solver, list);
    };
    if (rows <= 32)
      one(pgs_delassus_kernel<R, Mem, 1, false>);
    else if (rows <= 64)
      one(pgs_delassus_kernel<R, Mem, 2, false>);
    else if (rows <= 96)
      one(triangle ? pgs_delassus_kernel<R, Mem, 3, true> : pgs_delassus_kernel<R, Mem, 3, false>);
    else
      one(triangle ? pgs_delassus_kernel<R, Mem, 4, true> : pgs_delassus_kernel<R, Mem, 4, false>);
  };
  if (worlds <= at_a_time(int(delassus_most_bytes))) {  // each has a warp of its own, and waits for no other
    constexpr int most[] = {32, 64, 96, lockstep_most_rows};
    return launch_side_by_side("gsp::solver::pgs_delassus", exec, 4, [&](int i, cudaStream_t stream) { launch(stream, most[i], -1); });
  }
  launch_on_cuda("gsp::solver::list_delassus", exec, [&](cudaStream_t stream) {
    auto const& counts = solver.solution.list_counts;
    cuda_expects(cudaMemsetAsync(counts.data(), 0, counts.span() * sizeof(int), stream), "gsp::solver::list_delassus");
    list_delassus_kernel<<<(worlds + 255) / 256, 256, 0, stream>>>(solver);
  });
  launch_side_by_side("gsp::solver::pgs_delassus", exec, delassus_lists, [&](int i, cudaStream_t stream) {
    int const list = delassus_lists - 1 - i;  // what is long begins first
    launch(stream, delassus_rows(list), list);
  });
}

}  // namespace gsp::detail
