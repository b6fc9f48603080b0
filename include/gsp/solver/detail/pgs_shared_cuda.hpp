#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/solver/detail/mixing.hpp>

/// The kernel of pgs_shared.hpp. All threads of a warp stay together: a world whose elements are through, or that has stopped, goes along
/// with `active` false, and writes nothing.
namespace gsp::detail {

inline constexpr int shared_lanes = 8, shared_worlds = 32 / shared_lanes;  // threads a world, worlds a warp
inline constexpr int shared_many_sweeps = 33;                              // worlds that took as many come first

/// What set_law takes of a row.
template <class R>
struct SharedLaw {
  R inverse_diagonal, lower, upper, mu;
  int friction_of;
  bool with_next;
};

/// The world that eight threads have at the time, seen by one of them.
template <class R, class Mem>
struct SharedWorld {
  PgsShared<R, Mem> const& k;
  char* const memory;
  int const lane;
  int world = -1, first = 0, count = 0, entries = 0, nv = 0;
  SharedNumbers<R>* number;  // by row
  R *z, *z_before, *Y;
  SharedRow* row;
  unsigned char *order, *dof;           // first rows of elements, those of one row before others; dofs of entries
  int of_one_row = 0, elements = 0;     // the first so many elements have one row
  int sweeps = 0;                       // done
  bool leaping = false, stale = false;  // stale: z is to be summed anew
  R tolerance = R(0);
  MixingMemory<R> mixing;

  __device__ SharedWorld(PgsShared<R, Mem> const& solver, char* room) : k(solver), memory(room), lane(threadIdx.x % shared_lanes) {}

  /// Goes on to world w, unless that is -1: rows and entries, from the pools. All of a warp call it together.
  __device__ void take(int w) {
    bool const takes = w >= 0;
    if (takes) {
      world = w;
      first = k.rows.first(w);
      count = k.rows.count(w);
      entries = int(k.rows.entries(w)) - k.rows.most_eliminated * count;
      nv = k.rows.nv;
      number = reinterpret_cast<SharedNumbers<R>*>(memory);
      z = reinterpret_cast<R*>(number + count);
      z_before = z + nv;
      Y = z_before + nv;
      row = reinterpret_cast<SharedRow*>(Y + entries + entries % 2);
      order = reinterpret_cast<unsigned char*>(row + count);
      dof = order + count;
      sweeps = of_one_row = elements = 0;
      leaping = stale = true;
      tolerance = R(k.options.tolerance) * k.rows.rate_scale(w);
      mixing = {};
    }
    read(takes);
  }

  /// Sum over the eight threads, the same in all.
  static __device__ R sum(R x) {
#pragma unroll
    for (int stride = shared_lanes / 2; stride > 0; stride /= 2) x += __shfl_xor_sync(0xffffffffu, x, stride);
    return x;
  }

  __device__ void read(bool takes) {
    auto const& rows = k.rows;
    int const count = takes ? this->count : 0, entries = takes ? this->entries : 0;
    std::int64_t const first_entry = count > 0 ? rows.first_entry(world) : 0;
    R const *const y = rows.Y.data() + first_entry, *const p = k.impulses.p[k.impulses.parity()].data() + first;
    for (int i = lane; i < entries; i += shared_lanes) Y[i] = y[i];
#pragma unroll 1
    for (int r = lane; r < count; r += shared_lanes) {
      Row<R> const from = rows.row(first + r);
      R const inverse = from.inverse_diagonal;
      number[r] = {from.bias,
                   from.compliance,
                   inverse,
                   inverse > R(0) ? R(1) / inverse : R(0),
                   from.friction_of < 0 ? from.lower : from.mu,
                   from.upper,
                   p[r],
                   p[r]};
      int const entry = int(from.first_entry - first_entry);
      row[r] = {static_cast<unsigned short>(entry),
                static_cast<unsigned char>(from.segment[0].count + from.segment[1].count),
                from.friction_of,
                static_cast<unsigned char>(rows.element_rows(first + r)),
                from.with_next,
                from.same_segments,
                false};
      unsigned char* d = dof + entry;
      for (int s = 0; s < 2; ++s) {
        RowSegment const& segment = from.segment[s];
        int const* const list = list_of(rows, segment);
#pragma unroll 1
        for (int i = 0; i < segment.count; ++i) d[i] = static_cast<unsigned char>(segment.dof0 + (list ? list[i] : i));
        d += segment.count;
      }
    }
    find_order(count);
    __syncwarp();
#pragma unroll 1
    for (int e = takes ? lane : elements; e < elements; e += shared_lanes) {
      SharedRow* const own = row + order[e];
      bool const contact = own->rows == 3 && own->same_segments && own[1].friction_of == 0 && own[1].with_next && own[2].friction_of == 0;
      own->simple = own->friction_of < 0 && (own->rows == 1 || contact);
    }
    __syncwarp();
  }
  /// Lists the elements of one row, then those of more, each in their order; eliminated ones are left out.
  __device__ void find_order(int count) {
    int const most = warp_max(count), shift = int(threadIdx.x) / shared_lanes * shared_lanes;
#pragma unroll 1
    for (int kind = 0; kind < 2; ++kind) {
#pragma unroll 1
      for (int begin = 0; begin < most; begin += shared_lanes) {
        int const r = begin + lane, n = r < count ? k.rows.element_rows(first + r) : 0;
        bool const want = n > 0 && (n > 1) == kind && !k.rows.row(first + r).eliminated;
        unsigned const all = __ballot_sync(0xffffffffu, want) >> shift & ((1u << shared_lanes) - 1u);
        if (want) order[elements + __popc(all & ((1u << lane) - 1u))] = static_cast<unsigned char>(r);
        elements += __popc(all);
      }
      if (kind == 0 && count > 0) of_one_row = elements;
    }
  }
  static __device__ int warp_max(int x) { return __reduce_max_sync(0xffffffffu, x); }
  static __device__ bool any(bool x) { return __any_sync(0xffffffffu, x); }

  /// z += Y^T d of the rows of an element, whose first is `at`; d by row.
  __device__ void push(bool active, int at, int n, bool same, R const* d) const {
    constexpr int M = shared_rows;
    if (same) {
      SharedRow const from = active ? row[at] : SharedRow{};
      R const* const y = Y + from.entry;
      unsigned char const* const list = dof + from.entry;
#pragma unroll 1
      for (int i = lane; i < from.count; i += shared_lanes) {
        R x = z[list[i]];
#pragma unroll
        for (int b = 0; b < M; ++b) x = fma(y[b * from.count + i], d[b], x);
        z[list[i]] = x;
      }
      __syncwarp();
      return;
    }
#pragma unroll 1
    for (int b = 0; b < M; ++b) {
      if (active && b < n) {
        SharedRow const from = row[at + b];
#pragma unroll 1
        for (int i = lane; i < from.count; i += shared_lanes) z[dof[from.entry + i]] = fma(Y[from.entry + i], d[b], z[dof[from.entry + i]]);
      }
      __syncwarp();  // before the next row adds to z
    }
  }
  /// One pass over the element whose first row is `at`; the largest change of a rate.
  /// @param misses  grows by sum d^2 (|Y|^2 + C)
  /// @param work  grows by what the pass does (leap.hpp), where somebody asks: `tells`
  __device__ R sweep_element(bool active, int at, bool tells, R& misses, SweepWork<R>& work) const {
    constexpr int M = shared_rows;
    int const n = active ? row[at].rows : 0;
    // whether all worlds of the warp can take the short way: it gives the same numbers
    bool const same = __all_sync(0xffffffffu, !active || (n == M && row[at].same_segments));
    R w[M], before[M], p[M], d[M];
    ElementLaw<R, M> law;
#pragma unroll
    for (int b = 0; b < M; ++b) w[b] = R(0);
    int entry = 0;
    if (active) {
      entry = row[at].entry;
      if (same) {
        SharedRow const from = row[at];
        R const* const y = Y + entry;
#pragma unroll 1
        for (int i = lane; i < from.count; i += shared_lanes) {
          R const x = z[dof[entry + i]];
#pragma unroll
          for (int b = 0; b < M; ++b) w[b] = fma(y[b * from.count + i], x, w[b]);
        }
      } else {
#pragma unroll
        for (int b = 0; b < M; ++b) {
          if (b >= n) continue;
          SharedRow const from = row[at + b];
#pragma unroll 1
          for (int i = lane; i < from.count; i += shared_lanes) w[b] = fma(Y[from.entry + i], z[dof[from.entry + i]], w[b]);
        }
      }
    }
#pragma unroll
    for (int b = 0; b < M; ++b) w[b] = sum(w[b]);
    R diagonal[M];
#pragma unroll
    for (int b = 0; b < M; ++b) {
      clear_law(law, b);
      p[b] = diagonal[b] = R(0);
      if (b >= n) continue;
      SharedNumbers<R> const row_of = number[at + b];
      SharedRow const from = row[at + b];
      set_law(law, b,
              SharedLaw<R>{row_of.inverse_diagonal, row_of.lower, row_of.upper, from.friction_of >= 0 ? row_of.lower : R(-1),
                           from.friction_of, from.with_next});
      diagonal[b] = row_of.diagonal;
      p[b] = row_of.p;
      w[b] = fma(row_of.compliance, p[b], row_of.bias) + w[b];
    }
    R const* const couplings = Y + entry - n * (n - 1) / 2;
    auto const coupling = [&](int b, int a) { return b < n ? couplings[b * (b - 1) / 2 + a] : R(0); };
#pragma unroll
    for (int b = 0; b < M; ++b) before[b] = w[b];
    project_element<M>(law, 0, coupling, R(k.options.relaxation), w, p, d);
    __syncwarp();  // all have read p and z
    R change(0);
    bool moves = false;  // also where change underflows, or is not a number
#pragma unroll
    for (int b = 0; b < M; ++b) {
      R const of_row = d[b] == R(0) ? R(0) : d[b] * diagonal[b];
#pragma unroll
      for (int a = 0; a < b; ++a) before[b] = fma(coupling(b, a), d[a], before[b]);
      int const last = b > 0 ? b - 1 : 0;
      bool const with_last = b > 0 && law.with_next[last] > R(0);
      if (tells)
        work.template add_row<R>(p[b], d[b], before[b], of_row, law.inverse_diagonal[b], with_last ? coupling(b, last) * d[last] : R(0));
      if (d[b] == R(0)) continue;
      moves = true;
      change = max(change, abs(of_row));
      misses = fma(d[b], of_row, misses);
      if (lane == b) number[at + b].p = p[b];
    }
    if (any(moves)) push(active, at, n, same, d);
    return change;
  }
  /// The same of an element of one row in each world, or of a contact (SharedRow::simple): the same numbers in half the instructions,
  /// entries once from memory.
  __device__ R sweep_row(bool active, int at, bool tells, R& misses, SweepWork<R>& work) const {
    SharedRow const from = active ? row[at] : SharedRow{};
    SharedNumbers<R> const n = active ? number[at] : SharedNumbers<R>{};
    unsigned char const* const list = dof + from.entry;
    R const* const y = Y + from.entry;
    constexpr int held = 2;  // entries of a thread that stay in registers
    R x[held], y0[held], w(0);
#pragma unroll
    for (int h = 0; h < held; ++h) {
      int const i = lane + h * shared_lanes;
      if (i >= from.count) continue;
      x[h] = z[list[i]];
      y0[h] = y[i];
      w = fma(y0[h], x[h], w);
    }
#pragma unroll 1
    for (int i = lane + held * shared_lanes; i < from.count; i += shared_lanes) w = fma(y[i], z[list[i]], w);
    w = fma(n.compliance, n.p, n.bias) + sum(w);
    __syncwarp();  // all have read p and z
    R const p = clamp(fma(-R(k.options.relaxation) * n.inverse_diagonal, w, n.p), n.lower, n.upper), d = p - n.p, c = d * n.diagonal;
    if (tells) work.template add_row<R>(p, d, w, c, n.inverse_diagonal, R(0));
    if (!active || d == R(0)) return R(0);
    misses = fma(d, c, misses);
    if (lane == 0) number[at].p = p;
#pragma unroll
    for (int h = 0; h < held; ++h)
      if (int const i = lane + h * shared_lanes; i < from.count) z[list[i]] = fma(y0[h], d, x[h]);
#pragma unroll 1
    for (int i = lane + held * shared_lanes; i < from.count; i += shared_lanes) z[list[i]] = fma(y[i], d, z[list[i]]);
    return abs(c);
  }
  __device__ R sweep_contact(bool active, int at, bool tells, R& misses, SweepWork<R>& work) const {
    SharedRow const from = active ? row[at] : SharedRow{};
    SharedNumbers<R> const none{}, n0 = active ? number[at] : none, n1 = active ? number[at + 1] : none,
                                   n2 = active ? number[at + 2] : none;
    unsigned char const* const list = dof + from.entry;
    R const* const y = Y + from.entry;
    constexpr int held = 2;  // entries of a thread that stay in registers
    R x[held], y0[held], y1[held], y2[held], w0(0), w1(0), w2(0);
#pragma unroll
    for (int h = 0; h < held; ++h) {
      int const i = lane + h * shared_lanes;
      if (i >= from.count) continue;
      x[h] = z[list[i]];
      y0[h] = y[i];
      y1[h] = y[from.count + i];
      y2[h] = y[2 * from.count + i];
      w0 = fma(y0[h], x[h], w0);
      w1 = fma(y1[h], x[h], w1);
      w2 = fma(y2[h], x[h], w2);
    }
#pragma unroll 1
    for (int i = lane + held * shared_lanes; i < from.count; i += shared_lanes) {
      R const more = z[list[i]];
      w0 = fma(y[i], more, w0);
      w1 = fma(y[from.count + i], more, w1);
      w2 = fma(y[2 * from.count + i], more, w2);
    }
    w0 = sum(w0);
    w1 = sum(w1);
    w2 = sum(w2);
    __syncwarp();  // all have read p and z
    if (!active) return R(0);
    R const relaxation = R(k.options.relaxation), coupling10 = y[-3], coupling20 = y[-2], coupling21 = y[-1];
    w0 = fma(n0.compliance, n0.p, n0.bias) + w0;
    w1 = fma(n1.compliance, n1.p, n1.bias) + w1;
    w2 = fma(n2.compliance, n2.p, n2.bias) + w2;
    R const p0 = clamp(fma(-relaxation * n0.inverse_diagonal, w0, n0.p), n0.lower, n0.upper), d0 = p0 - n0.p;
    w1 = fma(coupling10, d0, w1);
    w2 = fma(coupling20, d0, w2);
    R p1 = fma(-relaxation * n1.inverse_diagonal, w1, n1.p), p2 = fma(-relaxation * n2.inverse_diagonal, w2, n2.p);
    R const mu1 = n1.lower, mu2 = n2.lower, q1 = p1 * mu2, q2 = p2 * mu1, r2 = fma(q1, q1, q2 * q2), radius = mu1 * mu2 * abs(p0);
    if (r2 > radius * radius) {
      R const scale = radius / sqrt(r2);
      p1 = scale * p1;
      p2 = scale * p2;
    }
    R const d1 = p1 - n1.p, d2 = p2 - n2.p;
    // rates before the row moves, after those before it have: w1 is that already
    w2 = fma(coupling21, d1, w2);
    R const c0 = d0 * n0.diagonal, c1 = d1 * n1.diagonal, c2 = d2 * n2.diagonal;
    if (tells) {
      work.template add_row<R>(p0, d0, w0, c0, n0.inverse_diagonal, R(0));
      work.template add_row<R>(p1, d1, w1, c1, n1.inverse_diagonal, R(0));
      work.template add_row<R>(p2, d2, w2, c2, n2.inverse_diagonal, coupling21 * d1);
    }
    if (d0 == R(0) && d1 == R(0) && d2 == R(0)) return R(0);
    misses = fma(d2, c2, fma(d1, c1, fma(d0, c0, misses)));
    if (lane < 3) number[at + lane].p = lane == 0 ? p0 : lane == 1 ? p1 : p2;
#pragma unroll
    for (int h = 0; h < held; ++h)
      if (int const i = lane + h * shared_lanes; i < from.count) z[list[i]] = fma(y2[h], d2, fma(y1[h], d1, fma(y0[h], d0, x[h])));
#pragma unroll 1
    for (int i = lane + held * shared_lanes; i < from.count; i += shared_lanes)
      z[list[i]] = fma(y[2 * from.count + i], d2, fma(y[from.count + i], d1, fma(y[i], d0, z[list[i]])));
    return max(max(abs(c0), abs(c1)), abs(c2));
  }
  /// z = Y^T p
  __device__ void sum_elements(bool active) const {
#pragma unroll 1
    for (int i = active ? lane : nv; i < nv; i += shared_lanes) z[i] = R(0);
    __syncwarp();
    for (int e = 0, most = warp_max(active ? elements : 0); e < most; ++e) {
      bool const has = active && e < elements;
      int const at = has ? order[e] : 0, n = has ? row[at].rows : 0;
      R d[shared_rows];
#pragma unroll
      for (int b = 0; b < shared_rows; ++b) d[b] = b < n ? number[at + b].p : R(0);
      push(has, at, n, __all_sync(0xffffffffu, !has || (n == shared_rows && row[at].same_segments)), d);
    }
  }
  /// Impulses before a sweep, and z where a leap follows on it.
  __device__ void keep(bool active, bool leaps) const {
#pragma unroll 1
    for (int i = leaps ? lane : nv; i < nv; i += shared_lanes) z_before[i] = z[i];
#pragma unroll 1
    for (int r = active ? lane : count; r < count; r += shared_lanes) number[r].before = number[r].p;
    __syncwarp();
  }
  __device__ LeapSums<R> leap_sums() const {
    LeapSums<R> s{};
#pragma unroll 1
    for (int i = lane; i < nv; i += shared_lanes) s.add_dof(z[i], z[i] - z_before[i]);
#pragma unroll 1
    for (int r = lane; r < count; r += shared_lanes) {
      SharedNumbers<R> const n = number[r];
      s.add_row(n.p, n.p - n.before, n.compliance, n.bias, n.inverse_diagonal);
    }
    return {sum(s.pp), sum(s.pd), sum(s.dd), sum(s.bp), sum(s.yy)};
  }
  /// p of worlds that missed by too much more as it was before it leapt or was mixed (mixing.hpp).
  __device__ void take_back(bool active) const {
#pragma unroll 1
    for (int r = active ? lane : count; r < count; r += shared_lanes) number[r].p = k.impulses.mixing[0](first + r);
    __syncwarp();
  }
  /// Keeps p and d of the last sweep; of worlds that leap or mix, p goes on to where that leads; and p, before the next. The former stay in
  /// the pool: a row's numbers are read once a sweep, by the thread that has written them. Whether it is mixed.
  __device__ bool go_on(bool active, bool leaps, Leap<R> const& leap, bool mixes, R misses) const {
    auto const& known = k.impulses.mixing;
    bool const both = mixing.knows_both();
    int const side = (sweeps - 1) % 2;
    Mixing<R> mixture{R(0), R(0)};
    constexpr int held = 4;  // rows of a thread at a time: what comes from the pool comes together
    if (any(mixes)) {
      MixingSums<R> own{};
#pragma unroll 1
      for (int begin = mixes ? lane : count; begin < count; begin += held * shared_lanes) {
        R f1[held], f2[held];
#pragma unroll
        for (int h = 0; h < held; ++h) {
          int const r = begin + h * shared_lanes < count ? begin + h * shared_lanes : count - 1;
          f1[h] = known[3](first + r);
          f2[h] = known[1](first + r);
        }
#pragma unroll
        for (int h = 0; h < held; ++h)
          if (int const r = begin + h * shared_lanes; r < count)
            own.add_row(number[r].diagonal, number[r].p - number[r].before, f1[h], f2[h], both);
      }
      mixture = best_mixing<R>(MixingSums<R>{sum(own.dd11), sum(own.dd12), sum(own.dd22), sum(own.df1), sum(own.df2)}, misses);
      mixes = mixes && mixture.helps();
    }
#pragma unroll 1
    for (int begin = active ? lane : count; begin < count; begin += held * shared_lanes) {
      R p1[held], p2[held];
#pragma unroll
      for (int h = 0; h < held; ++h) {
        int const r = begin + h * shared_lanes < count ? begin + h * shared_lanes : count - 1;
        p1[h] = mixes ? known[2](first + r) : R(0);
        p2[h] = mixes ? known[0](first + r) : R(0);
      }
#pragma unroll
      for (int h = 0; h < held; ++h) {
        int const r = begin + h * shared_lanes;
        if (r >= count) continue;
        R const now = number[r].p, d = now - number[r].before;
        number[r].p = number[r].before = leaps ? leap.of(now, d) : mixes ? mixture.of(now, p1[h], p2[h], both) : now;
        known[2 * side](first + r) = now;
        known[2 * side + 1](first + r) = d;
      }
    }
    __syncwarp();
    return mixes;
  }
  /// One sweep of the worlds that a warp has, where there is one, and what follows on it. False: this one has ended.
  __device__ bool sweep(bool active) {
    auto const& options = k.options;
    int const before = sweeps;
    bool const leaps = active && leaping && leaps_after(before, options), remembers = active && is_remembered(before, options);
    bool const tells = any(leaps);
    bool const begins = remembers && !is_remembered(before - 1, options);  // else `remember` has kept them
    if (any(stale)) sum_elements(stale);
    stale = false;
    if (any(begins || leaps)) keep(begins, leaps);
    SweepWork<R> work{};
    R change(0), misses(0);
    int const most_of_one = warp_max(active ? of_one_row : 0), most = warp_max(active ? elements - of_one_row : 0);
    for (int e = 0; e < most_of_one || e < most; ++e) {  // elements of one row and of more in turn
      if (e < most_of_one) change = max(change, sweep_one<1>(active && e < of_one_row, e, tells, misses, work));
      if (e < most) change = max(change, sweep_one<shared_rows>(active && of_one_row + e < elements, of_one_row + e, tells, misses, work));
    }
    if (active) ++sweeps;
    bool const again = active && sweeps < options.iterations && (options.tolerance == 0 || sweeps < options.least || change > tolerance);
    if (!any(again)) return false;
    bool const worse = remembers && mixing.is_worse(misses) && again;
    if (any(worse)) take_back(worse);
    if (leaps) leaping = again && leaps_again(work.raised);
    Leap<R> leap{R(0), R(0)};
    if (any(leaps && leaping)) leap = best_leap<R>(leap_sums(), work);
    bool const leapt = leaps && leaping && leap.goes();
    bool mixes = again && mixing.after(before, options, leapt, misses);
    if (any(remembers)) mixes = go_on(remembers, leapt, leap, mixes, misses);
    if (mixes) mixing.mixes();
    stale = again && (worse || leapt || mixes || begins_anew(before, options));
    return again;
  }
  /// The e-th element of the world, of one row or (M > 1) of more.
  template <int M>
  __device__ R sweep_one(bool active, int e, bool tells, R& misses, SweepWork<R>& work) const {
    int const at = active ? order[e] : 0;
    R change;
    if (!__all_sync(0xffffffffu, !active || row[at].simple))
      change = sweep_element(active, at, tells, misses, work);
    else if constexpr (M == 1)
      change = sweep_row(active, at, tells, misses, work);
    else
      change = sweep_contact(active, at, tells, misses, work);
    __syncwarp();
    return change;
  }
  __device__ void write() const {
    R* const p = k.impulses.p[k.impulses.parity()].data() + first;
    R* const out = k.solution.z.data() + std::int64_t(world) * nv;
#pragma unroll 1
    for (int r = lane; r < count; r += shared_lanes) p[r] = number[r].p;
#pragma unroll 1
    for (int i = lane; i < nv; i += shared_lanes) out[i] = z[i];
    if (lane == 0) {
      k.solution.iterations(world) = sweeps;
      k.solution.residual(world) = Kokkos::Experimental::quiet_NaN_v<R>;  // PgsResidual finds it
    }
  }
};

/// Sorts the worlds by the room that they need; those that took many sweeps in the last step stand in front, as they may again: what is
/// long begins first.
template <class R, class Mem>
__global__ void list_shared_kernel(PgsShared<R, Mem> const __grid_constant__ solver) {
  if (solver.halt()) return;
  auto const& solution = solver.solution;
  int const w = blockIdx.x * blockDim.x + threadIdx.x;
  if (w >= solver.rows.worlds || !fits_shared(solver.rows, w)) return;
  int const c = shared_size_of(shared_bytes(solver.rows, w));
  bool const few = solution.iterations(w) < shared_many_sweeps;
  int const at = atomicAdd(&solution.shared_counts(c, int(few)), 1);
  solution.shared_worlds(c, few ? solver.rows.worlds - 1 - at : at) = w;
}
/// The next world of a size for eight threads that want one, or -1.
template <class R, class Mem>
__device__ int next_of(PgsShared<R, Mem> const& solver, int size_class, bool wants) {
  auto const& solution = solver.solution;
  int const front = solution.shared_counts(size_class, 0), all = front + solution.shared_counts(size_class, 1);
  int at = wants && threadIdx.x % shared_lanes == 0 ? atomicAdd(&solution.shared_counts(size_class, 2), 1) : all;
  at = __shfl_sync(0xffffffffu, at, 0, shared_lanes);
  return at >= all ? -1 : solution.shared_worlds(size_class, at < front ? at : solver.rows.worlds - 1 - (at - front));
}

/// @param size_class  of the worlds; -1: a world a block, its number is the block's
template <class R, class Mem>
__global__ void __launch_bounds__(32) pgs_shared_kernel(PgsShared<R, Mem> const __grid_constant__ solver, int size_class) {
  extern __shared__ __align__(32) char shared_memory[];
  if (solver.halt()) return;
  bool const alone = size_class < 0;
  int const group = int(threadIdx.x) / shared_lanes;
  SharedWorld<R, Mem> world(solver, shared_memory + (alone ? 0 : group * shared_size(size_class)));
  bool left = !alone || (group == 0 && fits_shared(solver.rows, blockIdx.x)), busy = false;
  while (world.any(busy || left)) {
    if (world.any(left && !busy)) {
      int const next = !alone ? next_of(solver, size_class, left && !busy) : left ? int(blockIdx.x) : -1;
      left = busy ? left : !alone && next >= 0;
      busy = busy || next >= 0;
      world.take(next);
    }
    bool const again = world.sweep(busy && world.count > 0);
    if (busy && !again) world.write();
    busy = again;
    __syncwarp();
  }
}

template <class Exec, class R, class Mem>
void launch_pgs_shared(Exec const& exec, PgsShared<R, Mem> const& solver) {
  if (solver.rows.nv > lockstep_most_dofs) return;  // none fits, and there are no lists
  auto const& device = exec.cuda_device_prop();
  int const worlds = solver.rows.worlds;
  auto const at_a_time = [&](int bytes) {
    return device.multiProcessorCount *
           std::clamp(int(device.sharedMemPerMultiprocessor) / (bytes + int(device.reservedSharedMemPerBlock)), 1, 32);
  };
  auto const launch = [&](cudaStream_t stream, int size_class, int blocks, int bytes) {
    if (bytes > int(device.sharedMemPerBlock))
      cuda_expects(cudaFuncSetAttribute(pgs_shared_kernel<R, Mem>, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes),
                   "gsp::solver::pgs_shared, shared memory");
    pgs_shared_kernel<<<blocks, 32, bytes, stream>>>(solver, size_class);
  };
  if (worlds <= at_a_time(shared_most_bytes))  // each has a warp of its own, and waits for no other
    return launch_on_cuda("gsp::solver::pgs_shared", exec, [&](cudaStream_t stream) { launch(stream, -1, worlds, shared_most_bytes); });
  launch_on_cuda("gsp::solver::list_shared", exec, [&](cudaStream_t stream) {
    auto const& counts = solver.solution.shared_counts;
    cuda_expects(cudaMemsetAsync(counts.data(), 0, counts.span() * sizeof(int), stream), "gsp::solver::list_shared");
    list_shared_kernel<<<(worlds + 255) / 256, 256, 0, stream>>>(solver);
  });
  launch_side_by_side("gsp::solver::pgs_shared", exec, shared_sizes, [&](int i, cudaStream_t stream) {
    int const c = shared_sizes - 1 - i, bytes = shared_worlds * shared_size(c);  // what is long begins first
    launch(stream, c, std::min((worlds + shared_worlds - 1) / shared_worlds, at_a_time(bytes)), bytes);
  });
}

}  // namespace gsp::detail
