#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/parallel/detail/worlds_cuda.hpp>

/// `newton` on a CUDA GPU: an island stays in shared memory until it is solved, a warp or some warps each, in a block of as much memory as it
/// needs. Its rows are full there (zeros and all), by fours of dofs; H lies in tiles of 4 x 4, which a thread makes, factors and takes off
/// each other in registers. So what an iteration takes is what it computes:
///   H = 1 + Y^T B Y   a tile a thread, 16 multiply-adds and two loads of four numbers a row that has a curvature
///   H = L L^T         a column of tiles at a time; all threads factor the tile on the diagonal alike, so that none waits for it
/// What does not fit is done in global memory (newton_world.hpp).
namespace gsp::detail {

inline constexpr int newton_kilobytes[] = {4, 6, 8, 10, 12, 14, 16, 20, 24, 32, 48, 72, 112, 227};  // of a block, at most
inline constexpr std::int64_t newton_warp_bytes = 16 * 1024;                                        // of what one warp solves, at most
inline constexpr int newton_many_warps = 4;

/// The element whose laws lie in arrays, as soft_element.hpp takes it.
template <class R>
struct SoftRows {
  int rows;
  R const *compliance, *lower, *upper, *mu, *cone_mu;
  signed char const* normal;
};
template <class R>
struct alignas(16) Four {
  R at[newton_tile];
  __device__ __forceinline__ R operator[](int i) const { return at[i]; }
  __device__ __forceinline__ R& operator[](int i) { return at[i]; }
};
template <class R>
__device__ __forceinline__ Four<R>& four(R* p) {
  return *reinterpret_cast<Four<R>*>(p);
}

/// For newton_until_rest. All threads of the block call all members together.
template <class R, class Mem, int warps>
class NewtonIsland {
  static constexpr int N = most_element_rows, T = newton_tile;
  using Sizes = NewtonSizes<R>;
  using Threads = std::conditional_t<warps == 1, WarpWorld, SomeWarps<warps>>;

 public:
  __device__ NewtonIsland(NewtonWorld<R, Mem> const& solver, int w, IslandRows const& island, char* memory)
      : k_(solver), threads_{w}, l_(solver.lists_of(w, island)), size_(island.count, island.dofs), m_(island.count) {
    auto const take = [&](int count) {
      R* const own = reinterpret_cast<R*>(memory);
      memory += sizeof(R) * std::size_t(count);
      return own;
    };
    int const n = T * size_.fours;
    Y_ = take(m_ * size_.stride);
    H_ = take(size_.tiles * Sizes::of_tile);
    z_ = take(n);
    d_ = take(n);
    room_ = take(n);
    w_ = take(m_);
    p_ = take(m_);
    change_ = take(m_);
    compliance_ = take(m_);
    lower_ = take(m_);
    upper_ = take(m_);
    mu_ = take(m_);
    cone_mu_ = take(m_);
    curve_ = take(4 * m_);
    unit_ = reinterpret_cast<signed char*>(memory);
    curved_ = unit_ + m_;
    normal_ = curved_ + m_;
  }

  /// Rows and laws from the pools; z = Y^T p of the impulses given, or 0 where that costs less; w = Y z + b.
  __device__ void begin() {
    load();
    if (!k_.warm) return;
    R const none = cost();
    R const* const before = k_.impulses.p[k_.impulses.parity()].data() + l_.first;
    threads_.each(m_, [&](int r) { p_[r] = before[l_.island.row(r)]; });
    threads_.each(T * size_.fours, [&](int i) { z_[i] = pull(i); });
    threads_.each(m_, [&](int r) { w_[r] += along(r, z_); });
    R const given = cost() + R(0.5) * dot(z_, z_);
    if (given < none) return;
    threads_.each(T * size_.fours, [&](int i) { z_[i] = R(0); });
    threads_.each(m_, [&](int r) { w_[r] = bias(r); });
  }
  __device__ R gradient() {
    threads_.each(m_, [&](int r) {
      int const n = unit_[r];
      if (n == 0) return;
      if (n == 1) {
        R const free = -w_[r] / compliance_[r];
        p_[r] = clamp(free, lower_[r], upper_[r]);
        bool const inside = free > lower_[r] && free < upper_[r];
        curve_[4 * r] = R(1) / compliance_[r];
        curved_[r] = inside;
        return;
      }
      auto const e = element(r, n);
      soft_impulses(e, w_ + r, p_ + r);
      R B[N][N];
      curved_[r] = static_cast<signed char>(soft_curvature(e, w_ + r, B) ? n : 0);
      for (int b = 0; b < n; ++b)
        for (int a = 0; a <= b; ++a) curve_[4 * r + b * (b + 1) / 2 + a] = B[b][a];
    });
    threads_.each(T * size_.fours, [&](int i) { d_[i] = pull(i) - z_[i]; });
    return dot(d_, d_);
  }
  __device__ R solve() {
    assemble();
    if (!factor()) factor_rows();
    return solve_factored();
  }
  __device__ R size() const { return dot(z_, z_); }
  __device__ void look_along() {
    threads_.each(m_, [&](int r) { change_[r] = along(r, d_); });
    zd_ = dot(z_, d_);
    dd_ = dot(d_, d_);
  }
  __device__ R slope(R alpha) const {
    return zd_ + alpha * dd_ - threads_.template sum<R>(m_, [&](int r) {
      int const n = unit_[r];
      if (n == 0) return R(0);
      if (n == 1) return change_[r] * clamp(-fma(alpha, change_[r], w_[r]) / compliance_[r], lower_[r], upper_[r]);
      return soft_pull(element(r, n), w_ + r, change_ + r, alpha);
    });
  }
  __device__ void go(R alpha) {
    threads_.each(T * size_.fours, [&](int i) { z_[i] = fma(alpha, d_[i], z_[i]); });
    threads_.each(m_, [&](int r) { w_[r] = fma(alpha, change_[r], w_[r]); });
  }
  /// z, p(w) and what is said of the world.
  __device__ void write(int iterations) {
    auto const& e = l_.island;
    int const w = threads_.rank;
    R* const z = k_.solution.z.data() + std::int64_t(w) * k_.rows.nv;
    R* const p = k_.impulses.p[k_.impulses.parity()].data() + l_.first;
    threads_.each(e.dofs, [&](int i) { z[e.dof(i)] = z_[i]; });
    threads_.each(m_, [&](int r) {
      int const n = unit_[r];
      if (n > 0) soft_impulses(element(r, n), w_ + r, p_ + r);
    });
    threads_.each(m_, [&](int r) { p[e.row(r)] = p_[r]; });
    threads_.single([&] { atomicMax(&k_.solution.iterations(w), iterations); });
    if (!k_.residual) return;
    threads_.each(T * size_.fours, [&](int i) { d_[i] = pull(i); });
    threads_.each(m_, [&](int r) {
      using Bits = std::conditional_t<sizeof(R) == 4, unsigned, unsigned long long>;  // grow with what is 0 or more; those of NaN are the most
      R const change = abs(along(r, d_) + bias(r) - w_[r]);
      atomicMax(reinterpret_cast<Bits*>(&k_.solution.residual(w)), *reinterpret_cast<Bits const*>(&change));
    });
  }

 private:
  __device__ R dot(R const* a, R const* b) const {
    return threads_.template sum<R>(T * size_.fours, [&](int i) { return a[i] * b[i]; });
  }
  __device__ R bias(int r) const { return l_.row[l_.island.row(r)].bias; }
  __device__ SoftRows<R> element(int r, int n) const {
    return {n, compliance_ + r, lower_ + r, upper_ + r, mu_ + r, cone_mu_ + r, normal_ + r};
  }
  /// Y^T p of dof i.
  __device__ R pull(int i) const {
    R sum(0);
#pragma unroll 4
    for (int r = 0; r < m_; ++r) sum = fma(Y_[r * size_.stride + i], p_[r], sum);
    return sum;
  }
  /// Y x of row r.
  __device__ R along(int r, R* x) const {
    R sum(0);
    for (int b = 0; b < size_.fours; ++b) {
      Four<R> const y = four(Y_ + r * size_.stride + T * b), of_x = four(x + T * b);
#pragma unroll
      for (int i = 0; i < T; ++i) sum = fma(y[i], of_x[i], sum);
    }
    return sum;
  }
  __device__ R cost() const {
    return threads_.template sum<R>(m_, [&](int r) {
      int const n = unit_[r];
      if (n == 0) return R(0);
      R p[N];
      soft_impulses(element(r, n), w_ + r, p);
      return soft_cost(element(r, n), w_ + r, p);
    });
  }

  __device__ void load() {
    auto const& e = l_.island;
    auto const& rows = k_.rows;
    threads_.each(m_ * size_.stride / T, [&](int i) { four(Y_ + T * i) = {}; });
    threads_.each(T * size_.fours, [&](int i) { z_[i] = d_[i] = R(0); });
    for (int r = int(threadIdx.x) / 32; r < m_; r += warps) {
      Row<R> const& row = l_.row[e.row(r)];
      typename NewtonWorld<R, Mem>::Shifts const shifts(k_, l_, row);
      for (int i = int(threadIdx.x) % 32; i < row.segment[0].count + row.segment[1].count; i += 32)
        Y_[r * size_.stride + k_.place_of(row, i, shifts)] = rows.Y(row.first_entry + i);
    }
    threads_.sync();
    R* const most = room_;
    threads_.each(T * size_.fours, [&](int i) {
      R on_dof(0);
      for (int r = 0; r < m_; ++r) on_dof = max(on_dof, square(Y_[r * size_.stride + i]));
      most[i] = on_dof;
    });
    R* const least = change_;
    threads_.each(m_, [&](int r) {
      Row<R> const& row = l_.row[e.row(r)];
      typename NewtonWorld<R, Mem>::Shifts const shifts(k_, l_, row);
      least[r] = NewtonWorld<R, Mem>::least_of(
          row, [&](int i) { return most[k_.place_of(row, i, shifts)]; },
          [&](int i) { return Y_[r * size_.stride + k_.place_of(row, i, shifts)]; });
      w_[r] = row.bias;
      unit_[r] = curved_[r] = 0;
    });
    threads_.each(m_, [&](int r) { read_element(r, least); });
  }
  /// The laws of the element that row r begins. One without a cone is as many as it has rows.
  __device__ void read_element(int r, R const* least) {
    int const first = l_.island.row(r), n = l_.element_rows[first];
    if (n == 0) return;
    auto const own = soft_element(l_.row + first, n, least + r);
    bool cone = false;
    for (int b = 0; b < n; ++b) cone = cone || own.cone_mu[b] > R(0);
    for (int b = 0; b < n; ++b) {
      bool const none = own.normal[b] >= 0 && !(own.mu[b] > R(0));  // friction that there is none of
      compliance_[r + b] = own.compliance[b];
      lower_[r + b] = none ? R(0) : own.lower[b];
      upper_[r + b] = none ? R(0) : own.upper[b];
      mu_[r + b] = own.mu[b];
      cone_mu_[r + b] = own.cone_mu[b];
      normal_[r + b] = cone ? own.normal[b] : static_cast<signed char>(-1);
      if (!cone) unit_[r + b] = 1;
    }
    if (cone) unit_[r] = static_cast<signed char>(n);
  }

  /// Tile (i, j) of H, i >= j, by rows.
  __device__ R* tile(int i, int j) const { return H_ + (i * (i + 1) / 2 + j) * Sizes::of_tile; }
  __device__ R& at(int i, int j) const { return tile(i / T, j / T)[T * (i % T) + j % T]; }
  /// f(i, j) for the tiles of a triangle of `side`, j <= i, a thread each.
  template <class F>
  __device__ void each_tile(int side, F const& f) const {
    threads_.each(side * (side + 1) / 2, [&](int t) {
      int i = int((sqrt(float(8 * t + 1)) - 1.0f) * 0.5f);
      if (i * (i + 1) / 2 > t) --i;
      if ((i + 1) * (i + 2) / 2 <= t) ++i;
      f(i, t - i * (i + 1) / 2);
    });
  }
  /// Curvature b, a of the unit that begins at row r.
  __device__ R curvature(int r, int b, int a) const { return curve_[4 * r + (a <= b ? b * (b + 1) / 2 + a : a * (a + 1) / 2 + b)]; }

  /// H = 1 + Y^T B Y; its diagonal to room_.
  __device__ void assemble() {
    each_tile(size_.fours, [&](int i, int j) {
      R sum[T][T];
#pragma unroll
      for (int a = 0; a < T; ++a)
#pragma unroll
        for (int b = 0; b < T; ++b) sum[a][b] = i == j && a == b ? R(1) : R(0);
      auto const add = [&](Four<R> const& x, Four<R> const& y) {
#pragma unroll
        for (int a = 0; a < T; ++a)
#pragma unroll
          for (int b = 0; b < T; ++b) sum[a][b] = fma(x[a], y[b], sum[a][b]);
      };
      R *x = Y_ + T * i, *y = Y_ + T * j;
      for (int r = 0; r < m_; ++r, x += size_.stride, y += size_.stride) {
        int const n = curved_[r];
        if (n == 0) continue;
        if (n == 1) {
          R const curve = curve_[4 * r];
          Four<R> u = four(x);
#pragma unroll
          for (int a = 0; a < T; ++a) u[a] *= curve;
          add(u, four(y));
          continue;
        }
        for (int b = 0; b < n; ++b) {
          Four<R> u{};
          for (int c = 0; c < n; ++c) {
            R const curve = curvature(r, b, c);
            Four<R> const own = four(x + c * size_.stride);
#pragma unroll
            for (int a = 0; a < T; ++a) u[a] = fma(curve, own[a], u[a]);
          }
          add(u, four(y + b * size_.stride));
        }
      }
      R* const to = tile(i, j);
#pragma unroll
      for (int a = 0; a < T; ++a) {
        four(to + T * a) = {{sum[a][0], sum[a][1], sum[a][2], sum[a][3]}};
        if (i == j) room_[T * i + a] = sum[a][a];
      }
    });
  }
  /// The tile (k, k) of H or of L, whose diagonal is inverted.
  struct Diagonal {
    Four<R> L[T];
    __device__ Diagonal(R* tile) {
#pragma unroll
      for (int a = 0; a < T; ++a) L[a] = four(tile + T * a);
    }
    /// x <- L^-1 x
    __device__ void forward(Four<R>& x) const {
#pragma unroll
      for (int a = 0; a < T; ++a) {
#pragma unroll
        for (int b = 0; b < a; ++b) x[a] = fma(-L[a][b], x[b], x[a]);
        x[a] *= L[a][a];
      }
    }
    /// x <- L^-T x
    __device__ void back(Four<R>& x) const {
#pragma unroll
      for (int a = T; a-- > 0;) {
#pragma unroll
        for (int b = a + 1; b < T; ++b) x[a] = fma(-L[b][a], x[b], x[a]);
        x[a] *= L[a][a];
      }
    }
  };
  /// H <- L. False where rounding is much of a pivot, as in newton_world.hpp.
  __device__ bool factor() {
    for (int k = 0; k < size_.fours; ++k) {
      Diagonal own(tile(k, k));
      bool sound = true;
#pragma unroll
      for (int c = 0; c < T; ++c) {
        R const pivot = own.L[c][c];
        sound = sound && pivot > R(newton_pivot) * Kokkos::Experimental::epsilon_v<R> * room_[T * k + c];
        R const inverse = R(1) / sqrt(max(pivot, R(1)));
        own.L[c][c] = inverse;
#pragma unroll
        for (int a = c + 1; a < T; ++a) own.L[a][c] *= inverse;
#pragma unroll
        for (int a = c + 1; a < T; ++a)
#pragma unroll
          for (int b = c + 1; b <= a; ++b) own.L[a][b] = fma(-own.L[a][c], own.L[b][c], own.L[a][b]);
      }
      if (!sound) return false;
      int const below = size_.fours - 1 - k;
      threads_.each(T * below, [&](int i) {
        R* const row = tile(k + 1 + i / T, k) + T * (i % T);
        Four<R> x = four(row);
        own.forward(x);
        four(row) = x;
      });
      if (threadIdx.x < unsigned(T)) {
#pragma unroll
        for (int a = 0; a < T; ++a)
          if (threadIdx.x == unsigned(a)) four(tile(k, k) + T * a) = own.L[a];
      }
      each_tile(below, [&](int i, int j) {
        R *const to = tile(k + 1 + i, k + 1 + j), *const left = tile(k + 1 + i, k), *const right = tile(k + 1 + j, k);
        Four<R> y[T];
#pragma unroll
        for (int b = 0; b < T; ++b) y[b] = four(right + T * b);
#pragma unroll
        for (int a = 0; a < T; ++a) {
          Four<R> const x = four(left + T * a);
          Four<R> sum = four(to + T * a);
#pragma unroll
          for (int b = 0; b < T; ++b)
#pragma unroll
            for (int c = 0; c < T; ++c) sum[b] = fma(-x[c], y[b][c], sum[b]);
          four(to + T * a) = sum;
        }
      });
    }
    threads_.sync();
    return true;
  }
  /// L without the sum, row by row, as in newton_world.hpp.
  __device__ void factor_rows() {
    int const n = T * size_.fours;
    threads_.sync();
    threads_.each(size_.tiles * Sizes::of_tile, [&](int i) { H_[i] = R(0); });
    threads_.each(n, [&](int i) { at(i, i) = R(1); });
    for (int r = 0; r < m_; ++r) {
      int const of_unit = curved_[r];
      if (of_unit == 0) continue;
      R G[N][N];
      for (int b = 0; b < of_unit; ++b)
        for (int a = 0; a <= b; ++a) G[b][a] = curvature(r, b, a);
      for (int c = 0; c < of_unit; ++c) {
        if (!NewtonWorld<R, Mem>::next_column(G, of_unit, c)) continue;
        R* const u = room_;
        threads_.each(n, [&](int i) {
          R sum(0);
          for (int b = c; b < of_unit; ++b) sum = fma(G[b][c], Y_[(r + b) * size_.stride + i], sum);
          u[i] = sum;
        });
        for (int k = 0; k < n; ++k) {
          R const x = u[k];
          if (x == R(0)) continue;
          R const before = at(k, k), after = sqrt(fma(x, x, before * before)), cosine = before / after, sine = x / after;
          threads_.sync();
          threads_.each(n - k, [&](int i) {
            R const own = at(k + i, k), other = u[k + i];
            at(k + i, k) = i == 0 ? after : fma(cosine, own, sine * other);
            u[k + i] = i == 0 ? R(0) : fma(cosine, other, -sine * own);
          });
        }
      }
    }
    threads_.each(n, [&](int i) { at(i, i) = R(1) / at(i, i); });
  }
  /// d <- (L L^T)^-1 d. Returns d . (L L^T)^-1 d.
  __device__ R solve_factored() {
    for (int k = 0; k < size_.fours; ++k) {
      Four<R> x = four(d_ + T * k);
      Diagonal(tile(k, k)).forward(x);
      threads_.each(T * (size_.fours - 1 - k), [&](int i) {
        Four<R> const row = four(tile(k + 1 + i / T, k) + T * (i % T));
        R& to = d_[T * (k + 1) + i];
#pragma unroll
        for (int a = 0; a < T; ++a) to = fma(-row[a], x[a], to);
      });
      if (threadIdx.x == 0) four(d_ + T * k) = x;
    }
    threads_.sync();
    R const decrement = dot(d_, d_);
    for (int k = size_.fours; k-- > 0;) {
      Four<R> x = four(d_ + T * k);
      Diagonal(tile(k, k)).back(x);
      threads_.each(T * k, [&](int i) {
        R const* const column = tile(k, i / T) + i % T;
        R& to = d_[i];
#pragma unroll
        for (int a = 0; a < T; ++a) to = fma(-column[T * a], x[a], to);
      });
      if (threadIdx.x == 0) four(d_ + T * k) = x;
    }
    threads_.sync();
    return decrement;
  }

  NewtonWorld<R, Mem> const& k_;
  Threads threads_;
  typename NewtonWorld<R, Mem>::Lists l_;
  Sizes size_;
  int m_;
  R *Y_, *H_, *z_, *d_, *room_, *w_, *p_, *change_, *compliance_, *lower_, *upper_, *mu_, *cone_mu_, *curve_;
  signed char *unit_, *curved_, *normal_;  // rows of the unit that begins here; how many of them have a curvature; normal of a friction row
  R zd_, dd_;
};

/// An island a block, where it needs more than `least` bytes and no more than `most`.
template <class R, class Mem, int warps>
__global__ void __launch_bounds__(32 * warps)
    newton_kernel(NewtonWorld<R, Mem> const __grid_constant__ solver, std::int64_t least, std::int64_t most, bool beside) {
  follow(beside);
  extern __shared__ __align__(16) char shared_memory[];
  auto const& rows = solver.rows;
  int const of_world = islands_of_world(rows), w = int(blockIdx.x) / of_world, i = int(blockIdx.x) % of_world;
  if (!solver.progress.halt() && rows.count(w) > 0 && is_island(rows, w, i)) {
    IslandRows const island = island_rows(rows, w, i);
    std::int64_t const bytes = NewtonSizes<R>(island.count, island.dofs).bytes();
    if (bytes > least && bytes <= most) {
      NewtonIsland<R, Mem, warps> own(solver, w, island, shared_memory);
      own.write(newton_until_rest<R>(own, solver.iterations, solver.tolerance));
    }
  }
  end_beside(beside);
}

template <class Exec>
std::int64_t newton_shared_bytes(Exec const& exec) {
  constexpr std::int64_t of_sums = 1024;  // what the kernel has besides, and more
  return std::int64_t(exec.cuda_device_prop().sharedMemPerBlockOptin) - of_sums;
}
template <class Exec, class R, class Mem>
void launch_newton_islands(Exec const& exec, NewtonWorld<R, Mem> const& solver) {
  int const islands = solver.rows.worlds * islands_of_world(solver.rows);
  constexpr int sizes = int(std::size(newton_kilobytes));
  launch_side_by_side("gsp::solver::newton_islands", exec, sizes, [&](int i, cudaStream_t stream) {
    int const size = sizes - 1 - i;  // what is long begins first
    std::int64_t const least = size > 0 ? newton_kilobytes[size - 1] * 1024 : 0, most = std::min<std::int64_t>(newton_kilobytes[size] * 1024, solver.shared_bytes);
    if (least >= most) return;
    auto const one = [&](auto* kernel, int warps) {
      if (most > std::int64_t(exec.cuda_device_prop().sharedMemPerBlock))
        cuda_expects(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, int(solver.shared_bytes)),
                     "gsp::solver::newton, shared memory");
      launch_kernel(stream, kernel, islands, 32 * warps, std::size_t(most), solver, least, most, false);
    };
    if (most <= newton_warp_bytes)
      one(newton_kernel<R, Mem, 1>, 1);
    else
      one(newton_kernel<R, Mem, newton_many_warps>, newton_many_warps);
  });
}

}  // namespace gsp::detail
