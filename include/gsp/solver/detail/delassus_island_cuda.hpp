#pragma once
#include <gsp/solver/detail/list_islands.hpp>
#include <gsp/solver/detail/pgs_delassus.hpp>
#include <gsp/solver/detail/sweep_until_rest.hpp>
#include <gsp/solver/project_element.hpp>

/// What a warp does with an island of pgs_delassus.hpp. The rates w of all rows stay in registers, rows i, i + 32, ... in thread i. An
/// element reads its own, all threads project it alike, and each adds to its rows' rates what that does, columns of A. Rows stand in the
/// order of the sweeps: elements of one row and of more take turns.
namespace gsp::detail {

/// An island, for sweep_until_rest. All threads of the warp call all members together.
/// @tparam S  rows a thread;   @tparam triangle  whether A is its lower triangle
template <class R, class Mem, int S, bool triangle>
class DelassusIsland {
 public:
  /// Rows, entries and impulses, from the pools.
  __device__ DelassusIsland(PgsDelassus<R, Mem> const& solver, Island const& island, char* memory)
      : k_(solver), island_(island), first_(island.first_row), lane_(threadIdx.x) {
    int const count = island.rows, nv = island.dofs;
    stride_ = delassus_stride(count);
    dofs_ = delassus_dofs(count, nv);
    law_ = reinterpret_cast<DelassusLaw<R>*>(memory);
    A_ = reinterpret_cast<R*>(law_ + stride_);
    Y_ = A_ + delassus_matrix(count, triangle);
    row_ = reinterpret_cast<DelassusRow*>(Y_ + dofs_ * stride_);
    find_order();
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
    couple_contacts();
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
    int const nv = island_.dofs;
    R* const z = k_.solution.z.data() + std::int64_t(island_.world) * k_.rows.nv;
#pragma unroll
    for (int s = 0; s < S; ++s)
      if (lane_ + 32 * s < count_) p[pool_[s]] = p_[s];
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
      if (lane_ < dofs_ && begin + lane_ < nv) z[island_.dof(begin + lane_)] = own;
    }
    if (lane_ == 0) tell_sweeps(k_.rows, k_.solution, island_.world, sweeps);
    __syncwarp();
  }

 private:
  struct DofRange {
    unsigned char first[2] = {}, end[2] = {};  // of its segments; empty: first = end
  };
  static constexpr unsigned all = 0xffffffffu;
  static constexpr int any_place = -1;
  static __device__ int smaller(int a, int b) { return a < b ? a : b; }
  static __device__ R sum_of(R x) {
#pragma unroll
    for (int stride = 16; stride > 0; stride /= 2) x += __shfl_xor_sync(all, x, stride);
    return x;
  }
  /// x >= 0
  static __device__ R most_of(R x) {
    if constexpr (std::is_same_v<R, float>) return __uint_as_float(__reduce_max_sync(all, __float_as_uint(x)));  // of such the order is one
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
  /// A of row i and the thread's rows.
  __device__ void take_column(int i, R (&column)[S]) const {
    R const* const line = A_ + (i * stride_ + lane_);
#pragma unroll
    for (int s = 0; s < S; ++s) column[s] = triangle ? entry(s, i) : line[32 * s];
  }
  /// Rate of row i, which one thread has: number i, and the warp counts its threads modulo 32.
  /// @tparam at  its place there, or `any_place`
  template <int at = any_place>
  __device__ R rate(int i) const {
    R own = w_[at == any_place ? 0 : at];
    if constexpr (at == any_place)
#pragma unroll
      for (int s = 1; s < S; ++s) own = i < 32 * s ? own : w_[s];
    return __shfl_sync(all, own, i);
  }

  /// Where rows stand in a sweep: the k-th element of one row behind as many of more, and so the other way round.
  __device__ void find_order() {
    auto const& rows = k_.rows;
    unsigned const below = (1u << lane_) - 1u;
    auto* const behind = reinterpret_cast<unsigned char*>(A_);  // rows of the first k elements of more than one
    auto* const pool = reinterpret_cast<int*>(Y_);              // by place
    int begins[S], rows_of[S], before_single[S], before_several[S], before_row[S];
    int rows_of_several = 0;
#pragma unroll
    for (int s = 0; s < S; ++s) {
      int const entry = lane_ + 32 * s;
      begins[s] = entry < island_.elements ? island_.begin(entry) : 0;
      rows_of[s] = entry < island_.elements ? island_.rows_of(rows, entry) : 0;
      unsigned const single = __ballot_sync(all, rows_of[s] == 1), several = __ballot_sync(all, rows_of[s] > 1);
      int const own = rows_of[s] > 1 ? rows_of[s] : 0;
      int sum = own;
#pragma unroll
      for (int stride = 1; stride < 32; stride *= 2) {
        int const other = __shfl_up_sync(all, sum, stride);
        sum += lane_ < stride ? 0 : other;
      }
      before_single[s] = singles_ + __popc(single & below);
      before_several[s] = severals_ + __popc(several & below);
      before_row[s] = rows_of_several + sum - own;
      if (own > 0) behind[before_several[s]] = static_cast<unsigned char>(before_row[s]);
      singles_ += __popc(single);
      severals_ += __popc(several);
      rows_of_several += __shfl_sync(all, sum, 31);
    }
    if (lane_ == 0) behind[severals_] = static_cast<unsigned char>(rows_of_several);
    __syncwarp();
    count_ = singles_ + rows_of_several;
#pragma unroll
    for (int s = 0; s < S; ++s) {
      int const place = rows_of[s] == 1 ? before_single[s] + behind[smaller(before_single[s], severals_)]
                                        : before_row[s] + smaller(before_several[s] + 1, singles_);
      for (int b = 0; b < rows_of[s]; ++b) {
        pool[place + b] = begins[s] + b;
        row_[place + b].rows = static_cast<unsigned char>(b == 0 ? rows_of[s] : 0);
      }
    }
    if (lane_ == 0) row_[count_] = {0, -1, false, false};
    __syncwarp();
#pragma unroll
    for (int s = 0; s < S; ++s) {
      int const i = lane_ + 32 * s;
      pool_[s] = i < count_ ? pool[i] : 0;
      if (i >= count_) continue;
      Row<R> const& from = rows.row(first_ + pool_[s]);
      row_[i].friction_of = from.friction_of;
      row_[i].with_next = from.with_next && i + 1 < count_ && row_[i + 1].rows == 0;
      row_[i].contact = RowBounds<R>{from.lower, from.upper, from.friction_of}.pushes_alone();
    }
    __syncwarp();
    bool contact[S], others = false;
#pragma unroll
    for (int s = 0; s < S; ++s) {
      DelassusRow const* const own = row_ + smaller(lane_ + 32 * s, count_);  // the last has no rows
      contact[s] = own->rows == 3 && own->contact && own[1].friction_of == 0 && own[1].with_next && own[2].friction_of == 0;
      others = others || (own->rows > 1 && !contact[s]);
    }
    contacts_alone_ = !__any_sync(all, others);
    __syncwarp();  // all have read the bits of the rows beside
#pragma unroll
    for (int s = 0; s < S; ++s)
      if (int const i = lane_ + 32 * s; i < count_) row_[i].contact = contact[s];
    __syncwarp();
  }
  /// Numbers of the thread's row of place s, and which dofs its segments are of.
  __device__ void read_row(int s) {
    bias_[s] = p_[s] = d_[s] = diagonal_[s] = R(0);
    range_[s] = {};
    int const i = lane_ + 32 * s;
    if (i >= count_) return;
    int const of_pool = first_ + pool_[s];
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
      int const first = island_.first_dof(k_.rows, segment);
      range_[s].first[t] = static_cast<unsigned char>(first);
      range_[s].end[t] = static_cast<unsigned char>(first + (list ? list[segment.count - 1] + 1 : segment.count));
    }
  }
  /// Y of the next dofs of the island from `begin` on, dof by dof, from the pool, and which rows have any.
  __device__ void spread(int begin) {
    auto const& rows = k_.rows;
    int const dofs = smaller(dofs_, island_.dofs - begin), end = begin + dofs;
    for (int i = lane_; i < dofs * stride_; i += 32) Y_[i] = R(0);
    __syncwarp();
#pragma unroll
    for (int s = 0; s < S; ++s) {
      int const i = lane_ + 32 * s;
      DofRange const range = range_[s];
      bool const first = range.first[0] < end && range.end[0] > begin, second = range.first[1] < end && range.end[1] > begin;
      touching_[s] = __ballot_sync(all, first || second);
      if (!first && !second) continue;
      Row<R> const& row = rows.row(first_ + pool_[s]);
      R const* y = rows.Y.data() + row.first_entry;
#pragma unroll
      for (int t = 0; t < 2; ++t) {
        RowSegment const segment = row.segment[t];
        int const* const list = list_of(rows, segment);
        int const count = (t == 0 ? first : second) ? segment.count : 0, from = range.first[t] - begin;
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
      if (int const i = lane_ + 32 * s; i < count_) A_[place(i, i)] += k_.rows.row(first_ + pool_[s]).compliance;
    __syncwarp();
  }

  /// What the rows of a contact do to each other stands here, and here alone, in place of DelassusLaw::upper, which its rows do not ask for
  /// (find_order: the normal has none): of the normal A between its tangents, of either tangent between it and the normal.
  __device__ void couple_contacts() const {
#pragma unroll
    for (int s = 0; s < S; ++s) {
      int const i = lane_ + 32 * s;
      if (i >= count_ || !row_[i].contact) continue;
      law_[i].upper = A_[place(i + 1, i + 2)];
      for (int b = 1; b < 3; ++b) law_[i + b].upper = A_[place(i, i + b)];
    }
    __syncwarp();
  }

  template <bool tells>
  __device__ SweepOutcome<R> pass() {
    SweepOutcome<R> to;
    int i = 0, k = 0;
    if (!tells && contacts_alone_) turns_of_contacts(i, k);
#pragma unroll 1
    for (; i < count_; ++k) {  // an element of one row, and the one of more that takes turns with it
      if (k < singles_) single<tells>(i++, to.work);
      if (k >= severals_) continue;
      if (row_[i].contact) {
        contact<tells>(i, to.work);
        i += 3;
      } else {
        int const rows = row_[i].rows;
        element<tells>(i, rows, to.work);
        i += rows;
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
  /// The same where all elements of more than one row are contacts, without a question: four rows a turn, then three, or one. Where rows
  /// have few places, what is done for each knows it.
  /// @param i, k  row and turn, 0 before; all of them after
  __device__ void turns_of_contacts(int& i, int& k) {
    constexpr int places = S <= 2 ? S : 1;
    SweepWork<R> none;  // which no one asks for
    int const turns = smaller(singles_, severals_);
    unrolled<places>([&](auto place) {
      constexpr int at = S == places ? int(place) : any_place;
      int const end = S == places ? 32 * (at + 1) : count_;
#pragma unroll 1
      for (; k < turns && i < end; ++k, i += 4) {
        single<false, at>(i, none);
        contact<false, at>(i + 1, none);
      }
    });
    unrolled<places>([&](auto place) {
      constexpr int at = S == places ? int(place) : any_place;
      int const end = S == places ? 32 * (at + 1) : count_;
#pragma unroll 1
      for (; k < severals_ && i + 2 < end; ++k, i += 3) contact<false, at>(i, none);
      if (S != places || at + 1 == places || k == severals_ || i >= end) return;
      contact<false, any_place>(i, none);  // of two places
      ++k;
      i += 3;
    });
    unrolled<places>([&](auto place) {
      constexpr int at = S == places ? int(place) : any_place;
      int const end = S == places && at + 1 < places ? 32 * (at + 1) : count_;
#pragma unroll 1
      for (; i < count_ && i < end; ++i) single<false, at>(i, none);
    });
  }
  /// What SweepWork asks of a row.
  __device__ void tell(SweepWork<R>& work, R p, R d, R rate, R step, R together) const {
    R const inverse = step / -R(k_.options.relaxation);
    work.template add_row<R>(p, d, rate, inverse > R(0) ? d / inverse : R(0), inverse, together);
  }
  template <bool tells, int at = any_place>
  __device__ void single(int i, SweepWork<R>& work) {
    DelassusLaw<R> const law = law_[i];
    R column[S];
    take_column(i, column);
    R const w = rate<at>(i), p = clamp(fma(law.step, w, law.p), law.lower, law.upper), d = p - law.p;
    __syncwarp();  // all have read p
#pragma unroll
    for (int s = 0; s < S; ++s) w_[s] = fma(column[s], d, w_[s]);
    if (lane_ == 0) law_[i].p = p;
    if constexpr (tells) tell(work, p, d, w, law.step, R(0));
  }
  template <bool tells, int at = any_place>
  __device__ void contact(int i, SweepWork<R>& work) {
    DelassusLaw<R> const n0 = law_[i], n1 = law_[i + 1], n2 = law_[i + 2];
    R const coupling10 = n1.upper, coupling20 = n2.upper, coupling21 = n0.upper;  // couple_contacts
    R column0[S], column1[S], column2[S];
    take_column(i, column0);
    take_column(i + 1, column1);
    take_column(i + 2, column2);
    R const w0 = rate<at>(i);
    R w1 = rate<at>(i + 1), w2 = rate<at>(i + 2);
    __syncwarp();  // all have read p
    R const pushed = fma(n0.step, w0, n0.p), p0 = pushed < R(0) ? R(0) : pushed, d0 = p0 - n0.p;
    w1 = fma(coupling10, d0, w1);
    w2 = fma(coupling20, d0, w2);
    R p1 = fma(n1.step, w1, n1.p), p2 = fma(n2.step, w2, n2.p);
    into_ellipse(n1.lower, n2.lower, abs(p0), p1, p2);
    R const d1 = p1 - n1.p, d2 = p2 - n2.p;
#pragma unroll
    for (int s = 0; s < S; ++s) w_[s] = fma(column2[s], d2, fma(column1[s], d1, fma(column0[s], d0, w_[s])));
    if (lane_ == 0) {
      law_[i].p = p0;
      law_[i + 1].p = p1;
      law_[i + 2].p = p2;
    }
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
      into_ellipse(law.lower, second.lower, normal, p1, p2);
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
  Island const& island_;
  int const first_, lane_;
  int count_ = 0, stride_, dofs_;   // rows that are swept; numbers from one row of A, or dof of Y, to the next; dofs of Y at a time
  int singles_ = 0, severals_ = 0;  // elements of one row, and of more
  bool contacts_alone_ = false;     // whether all of more are contacts (DelassusRow)
  DelassusLaw<R>* law_;             // whose p is that of p_ but for a sweep, and until `sum` has been called
  R *A_, *Y_;
  DelassusRow* row_;
  int own_[triangle ? S : 1];  // the thread's rows, or the line of zeros
  int pool_[S];                // their numbers in the world, counted from Rows::first
  DofRange range_[S];
  unsigned touching_[S];  // bits of the rows that have entries in the dofs of Y that are there
  R w_[S], bias_[S], p_[S], diagonal_[S];
  R d_[S], w_before_[S] = {};                            // of the last sweep
  R p1_[S] = {}, d1_[S] = {}, p2_[S] = {}, d2_[S] = {};  // p after the last sweep that was remembered and the one before, and their d
};

}  // namespace gsp::detail
