#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/solver/detail/mixing.hpp>

/// The kernel of pgs_shared.hpp. All threads of a warp stay together: a world whose elements are through, or that has stopped, goes along
/// with `active` false, and writes nothing.
namespace gsp::detail {

inline constexpr int shared_lanes = 8, shared_worlds = 32 / shared_lanes;  // threads a world, worlds a warp

/// What set_law takes of a row.
template <class R>
struct SharedLaw {
  R inverse_diagonal, lower, upper, mu;
  int friction_of;
  bool with_next;
};

/// One world, seen by one of its eight threads.
template <class R, class Mem>
struct SharedWorld {
  PgsShared<R, Mem> const& k;
  int world, first, count, entries, nv, lane;
  SharedNumbers<R>* number;  // by row
  R *z, *z_before, *Y;
  SharedRow* row;
  unsigned char *order, *dof;        // first rows of elements, those of one row before others; dofs of entries
  int of_one_row = 0, elements = 0;  // the first so many elements have one row

  __device__ SharedWorld(PgsShared<R, Mem> const& solver, int w, bool mine, char* memory)
      : k(solver),
        world(w),
        first(mine ? solver.rows.first(w) : 0),
        count(mine ? solver.rows.count(w) : 0),
        entries(mine ? int(solver.rows.entries(w)) - solver.rows.most_eliminated * count : 0),
        nv(mine ? solver.rows.nv : 0),
        lane(threadIdx.x % shared_lanes),
        number(reinterpret_cast<SharedNumbers<R>*>(memory)),
        z(reinterpret_cast<R*>(number + count)),
        z_before(z + nv),
        Y(z_before + nv),
        row(reinterpret_cast<SharedRow*>(Y + entries + entries % 2)),
        order(reinterpret_cast<unsigned char*>(row + count)),
        dof(order + count) {}

  /// Sum over the eight threads, the same in all.
  static __device__ R sum(R x) {
#pragma unroll
    for (int stride = shared_lanes / 2; stride > 0; stride /= 2) x += __shfl_xor_sync(0xffffffffu, x, stride);
    return x;
  }

  /// Rows and entries, from the pools.
  __device__ void read() {
    auto const& rows = k.rows;
    std::int64_t const first_entry = count > 0 ? rows.first_entry(world) : 0;
    R const *const y = rows.Y.data() + first_entry, *const p = k.impulses.p[k.impulses.parity()].data() + first;
    for (int i = lane; i < entries; i += shared_lanes) Y[i] = y[i];
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
        for (int i = 0; i < segment.count; ++i) d[i] = static_cast<unsigned char>(segment.dof0 + (list ? list[i] : i));
        d += segment.count;
      }
    }
    find_order();
    __syncwarp();
    for (int e = of_one_row + lane; e < elements; e += shared_lanes) {
      SharedRow* const own = row + order[e];
      own->contact = own->rows == 3 && own->same_segments && own->friction_of < 0 && own[1].friction_of == 0 && own[1].with_next &&
                     own[2].friction_of == 0;
    }
    __syncwarp();
  }
  /// Lists the elements of one row, then those of more, each in their order; eliminated ones are left out.
  __device__ void find_order() {
    int const most = warp_max(count), shift = int(threadIdx.x) / shared_lanes * shared_lanes;
    for (int kind = 0; kind < 2; ++kind) {
      for (int begin = 0; begin < most; begin += shared_lanes) {
        int const r = begin + lane, n = r < count ? k.rows.element_rows(first + r) : 0;
        bool const want = n > 0 && (n > 1) == kind && !k.rows.row(first + r).eliminated;
        unsigned const all = __ballot_sync(0xffffffffu, want) >> shift & ((1u << shared_lanes) - 1u);
        if (want) order[elements + __popc(all & ((1u << lane) - 1u))] = static_cast<unsigned char>(r);
        elements += __popc(all);
      }
      if (kind == 0) of_one_row = elements;
    }
  }
  static __device__ int warp_max(int x) { return __reduce_max_sync(0xffffffffu, x); }

  /// z += Y^T d of the rows of an element, whose first is `at`; d by row.
  template <int M>
  __device__ void push(bool active, int at, int n, bool same, R const* d) const {
    if (same) {
      SharedRow const from = active ? row[at] : SharedRow{};
      R const* const y = Y + from.entry;
      unsigned char const* const list = dof + from.entry;
      for (int i = lane; i < from.count; i += shared_lanes) {
        R x = z[list[i]];
#pragma unroll
        for (int b = 0; b < M; ++b) x = fma(y[b * from.count + i], d[b], x);
        z[list[i]] = x;
      }
      __syncwarp();
      return;
    }
    for (int b = 0; b < M; ++b) {
      if (active && b < n) {
        SharedRow const from = row[at + b];
        for (int i = lane; i < from.count; i += shared_lanes) z[dof[from.entry + i]] = fma(Y[from.entry + i], d[b], z[dof[from.entry + i]]);
      }
      __syncwarp();  // before the next row adds to z
    }
  }
  /// One pass over the element whose first row is `at`; the largest change of a rate. M = 1: one row; M = 3: two or three.
  /// @param work  grows by what the pass does (leap.hpp), where somebody asks: `tells`
  template <int M>
  __device__ R sweep_element(bool active, int at, bool tells, SweepWork<R>& work) const {
    int const n = !active ? 0 : M == 1 ? 1 : row[at].rows;
    // whether all worlds of the warp can take the short way: it gives the same numbers
    bool const same = M == 1 || __all_sync(0xffffffffu, !active || (n == M && row[at].same_segments));
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
      if (lane == b) number[at + b].p = p[b];
    }
    if (__any_sync(0xffffffffu, moves)) push<M>(active, at, n, same, d);
    return change;
  }
  /// The same of a contact in each world (SharedRow::contact): the same numbers in half the instructions, entries once from memory.
  __device__ R sweep_contact(bool active, int at, bool tells, SweepWork<R>& work) const {
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
    if (lane < 3) number[at + lane].p = lane == 0 ? p0 : lane == 1 ? p1 : p2;
#pragma unroll
    for (int h = 0; h < held; ++h)
      if (int const i = lane + h * shared_lanes; i < from.count) z[list[i]] = fma(y2[h], d2, fma(y1[h], d1, fma(y0[h], d0, x[h])));
    for (int i = lane + held * shared_lanes; i < from.count; i += shared_lanes)
      z[list[i]] = fma(y[2 * from.count + i], d2, fma(y[from.count + i], d1, fma(y[i], d0, z[list[i]])));
    return max(max(abs(c0), abs(c1)), abs(c2));
  }
  /// z = Y^T p
  __device__ void sum_elements(bool active) const {
    for (int i = active ? lane : nv; i < nv; i += shared_lanes) z[i] = R(0);
    __syncwarp();
    for (int e = 0, most = warp_max(active ? elements : 0); e < most; ++e) {
      bool const has = active && e < elements;
      int const at = has ? order[e] : 0, n = has ? row[at].rows : 0;
      R d[shared_rows];
#pragma unroll
      for (int b = 0; b < shared_rows; ++b) d[b] = b < n ? number[at + b].p : R(0);
      push<shared_rows>(has, at, n, __all_sync(0xffffffffu, !has || (n == shared_rows && row[at].same_segments)), d);
    }
  }
  /// Impulses before a sweep, and z where a leap follows on it.
  __device__ void keep(bool leaps) const {
    for (int i = leaps ? lane : nv; i < nv; i += shared_lanes) z_before[i] = z[i];
    for (int r = lane; r < count; r += shared_lanes) number[r].before = number[r].p;
    __syncwarp();
  }
  __device__ LeapSums<R> leap_sums() const {
    LeapSums<R> s{};
    for (int i = lane; i < nv; i += shared_lanes) s.add_dof(z[i], z[i] - z_before[i]);
    for (int r = lane; r < count; r += shared_lanes) {
      SharedNumbers<R> const n = number[r];
      s.add_row(n.p, n.p - n.before, n.compliance, n.bias, n.inverse_diagonal);
    }
    return {sum(s.pp), sum(s.pd), sum(s.dd), sum(s.bp), sum(s.yy)};
  }
  /// Leaves p and z where the energy is least (leap.hpp).
  __device__ void leap(bool active, SweepWork<R> const& work) const {
    Leap<R> const to = best_leap<R>(leap_sums(), work);
    __syncwarp();
    for (int r = active ? lane : count; r < count; r += shared_lanes) {
      R& p = number[r].p;
      p += to.growth * p + to.sweeps * (p - number[r].before);
    }
    __syncwarp();
    sum_elements(active);
  }
  /// sum d^2 (|Y|^2 + C) of the last sweep.
  __device__ R sum_misses() const {
    R own(0);
    for (int r = lane; r < count; r += shared_lanes) {
      R const d = number[r].p - number[r].before;
      own = fma(d, d * number[r].diagonal, own);
    }
    return sum(own);
  }
  /// p of worlds that missed by too much more as it was before it was mixed (mixing.hpp).
  __device__ void take_back(bool active) const {
    for (int r = active ? lane : count; r < count; r += shared_lanes) number[r].p = k.impulses.mixing[0](first + r);
    __syncwarp();
    sum_elements(active);
  }
  /// Keeps p and d of the last sweep; of worlds that mix, p goes on to the mixture. They stay in the pool: a row's numbers are read once a
  /// sweep, by the thread that has written them.
  __device__ void remember(int side, bool mixes, bool both) const {
    auto const& mixing = k.impulses.mixing;
    Mixing<R> to{R(0), R(0)};
    if (__any_sync(0xffffffffu, mixes)) {
      MixingSums<R> own{};
      for (int r = mixes ? lane : count; r < count; r += shared_lanes)
        own.add_row(number[r].diagonal, number[r].p - number[r].before, mixing[3](first + r), mixing[1](first + r), both);
      to = best_mixing<R>(MixingSums<R>{sum(own.dd11), sum(own.dd12), sum(own.dd22), sum(own.df1), sum(own.df2)});
    }
    for (int r = lane; r < count; r += shared_lanes) {
      R const now = number[r].p, d = now - number[r].before;
      if (mixes) number[r].p = now - to.of(now, mixing[2](first + r), mixing[0](first + r), both);
      mixing[2 * side](first + r) = now;
      mixing[2 * side + 1](first + r) = d;
    }
    __syncwarp();
  }
  /// Sweeps until no rate changes by more than the tolerance; their number.
  __device__ int solve() const {
    auto const& options = k.options;
    R const tolerance = count > 0 ? R(options.tolerance) * k.rows.rate_scale(world) : R(0);
    sum_elements(true);
    int sweeps = 0;
    bool again = count > 0, leaping = true;
    MixingMemory<R> memory;
    int const most_of_one = warp_max(of_one_row), most = warp_max(elements - of_one_row);
    for (int sweep = 0; __any_sync(0xffffffffu, again); ++sweep) {
      bool const leaps = leaps_after(sweep, options);
      if (is_remembered(sweep, options)) keep(leaps);
      SweepWork<R> work{};
      R change(0);
      for (int e = 0; e < most_of_one || e < most; ++e) {  // elements of one row and of more in turn
        if (e < most_of_one) {
          bool const active = again && e < of_one_row;
          change = max(change, sweep_element<1>(active, active ? order[e] : 0, leaps, work));
        }
        if (e < most) {
          bool const active = again && of_one_row + e < elements;
          int const at = active ? order[of_one_row + e] : 0;
          bool const contacts = __all_sync(0xffffffffu, !active || row[at].contact);
          change = max(change, contacts ? sweep_contact(active, at, leaps, work) : sweep_element<shared_rows>(active, at, leaps, work));
          __syncwarp();
        }
      }
      if (again) ++sweeps;
      again = again && sweep + 1 < options.iterations && (options.tolerance == 0 || sweep + 1 < options.least || change > tolerance);
      if (!__any_sync(0xffffffffu, again)) break;
      bool const worse = is_remembered(sweep, options) && memory.is_worse(sum_misses()) && again;
      if (__any_sync(0xffffffffu, worse)) take_back(worse);
      if (leaps) {
        leaping = leaping && again && leaps_again(work.raised);
        if (__any_sync(0xffffffffu, leaping)) leap(leaping, work);
      }
      bool const mixes = memory.after(sweep, options, leaps && leaping) && again;
      if (is_remembered(sweep, options)) remember(sweep % 2, mixes, memory.knows_both());
      bool const anew = mixes || (again && begins_anew(sweep, options));
      if (__any_sync(0xffffffffu, anew)) sum_elements(anew);
    }
    return sweeps;
  }
  __device__ void write(int sweeps) const {
    R* const p = k.impulses.p[k.impulses.parity()].data() + first;
    R* const out = k.solution.z.data() + std::int64_t(world) * nv;
    for (int r = lane; r < count; r += shared_lanes) p[r] = number[r].p;
    for (int i = lane; i < nv; i += shared_lanes) out[i] = z[i];
    if (lane == 0) {
      k.solution.iterations(world) = sweeps;
      k.solution.residual(world) = Kokkos::Experimental::quiet_NaN_v<R>;  // PgsResidual finds it
    }
  }
};

/// What four worlds need together, from number w on; mine: of the thread's own, which is `group`, begin: where it begins.
template <class R, class Mem>
__device__ int bytes_of_four(Rows<R, Mem> const& rows, int w, int group, int& begin, bool& mine) {
  int bytes = 0;
  for (int g = 0; g < shared_worlds; ++g) {
    bool const fits = w + g < rows.worlds && fits_shared(rows, w + g);
    if (g == group) {
      begin = bytes;
      mine = fits;
    }
    bytes += fits ? int(shared_bytes(rows, w + g)) : 0;
  }
  return bytes;
}

/// Each block takes every gridDim-th four worlds, of those that need as much memory as it has: its threads look for them, 32 at a time.
template <class R, class Mem>
__global__ void __launch_bounds__(32) pgs_shared_kernel(PgsShared<R, Mem> const __grid_constant__ solver, int least, int most) {
  extern __shared__ __align__(32) char shared_memory[];
  if (solver.halt()) return;
  int const blocks = gridDim.x, worlds = solver.rows.worlds, group = int(threadIdx.x) / shared_lanes;
  int begin;
  bool mine;
  for (int first = blockIdx.x; first * shared_worlds < worlds; first += 32 * blocks) {
    std::int64_t const own = first + std::int64_t(threadIdx.x) * blocks;
    int const bytes = own * shared_worlds < worlds ? bytes_of_four(solver.rows, int(own) * shared_worlds, group, begin, mine) : 0;
    for (unsigned found = __ballot_sync(0xffffffffu, bytes > least && bytes <= most); found != 0; found &= found - 1) {
      int const w = (first + (__ffs(found) - 1) * blocks) * shared_worlds;
      bytes_of_four(solver.rows, w, group, begin, mine);
      SharedWorld<R, Mem> world(solver, w + group, mine, shared_memory + begin);
      world.read();
      int const sweeps = world.solve();
      if (mine) world.write(sweeps);
      __syncwarp();
    }
  }
}

template <class Exec, class R, class Mem>
void launch_pgs_shared(Exec const& exec, PgsShared<R, Mem> const& solver) {
  auto const& device = exec.cuda_device_prop();
  int const fours = (solver.rows.worlds + shared_worlds - 1) / shared_worlds;
  for (int c = 0; c < shared_sizes; ++c) {
    int const bytes = shared_size(c), a_block = bytes + int(device.reservedSharedMemPerBlock);
    int const at_a_time = device.multiProcessorCount * std::clamp(int(device.sharedMemPerMultiprocessor) / a_block, 1, 32);
    launch_on_cuda("gsp::solver::pgs_shared", exec, [&](cudaStream_t stream) {
      if (bytes > int(device.sharedMemPerBlock))
        cuda_expects(cudaFuncSetAttribute(pgs_shared_kernel<R, Mem>, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes),
                     "gsp::solver::pgs_shared, shared memory");
      pgs_shared_kernel<<<std::min(fours, at_a_time), 32, bytes, stream>>>(solver, c > 0 ? shared_size(c - 1) : 0, bytes);
    });
  }
}

}  // namespace gsp::detail
