#pragma once
#include <cstddef>
#include <cstdint>
#include <gsp/math/pack.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/solver/detail/newton_sizes.hpp>
#include <type_traits>

/// H = L L^T of H = 1 + S, S positive semidefinite: the lower triangle, in tiles of 4 x 4 by columns, a column of tiles at a time; all
/// threads factor the tile on the diagonal alike, so that none waits for it.
namespace gsp::detail {

template <class Threads>
constexpr int threads_of() {
  if constexpr (std::is_same_v<Threads, SerialWorld>)
    return 1;
  else
    return Threads::threads;
}

/// Numbers that a matrix of so many fours takes: its tiles, its diagonal, and room for what is found of a column.
KOKKOS_FORCEINLINE_FUNCTION std::int64_t tiled_numbers(int fours, bool many_threads) {
  return std::int64_t(fours) * (fours + 1) / 2 * newton_tile_stride + (newton_tile + (many_threads ? 2 : 1)) * fours;
}

/// All threads call all members together.
/// @tparam Threads  SerialWorld, or what has its sync, one, each and list
template <class R, class Threads>
class TiledCholesky {
  static constexpr int T = newton_tile;
  static_assert(T == sizeof(std::int32_t));  // is_nonzero

 public:
  static constexpr bool one_thread = std::is_same_v<Threads, SerialWorld>;  // it takes fours of dofs, where threads take a dof each
  static constexpr bool many_threads = threads_of<Threads>() > 128;
  using Four = Pack<R, T>;
  using Index = std::conditional_t<one_thread || many_threads, std::ptrdiff_t, int>;  // what fits into near memory is counted by an int

  /// @param memory  as far as `end`, aligned for a Four
  KOKKOS_FORCEINLINE_FUNCTION TiledCholesky(Threads const& threads, int fours, R* memory)
      : threads_(threads), fours_(fours), H_(memory), diagonal_(memory + Index(fours) * (fours + 1) / 2 * newton_tile_stride) {}
  KOKKOS_FORCEINLINE_FUNCTION R* end() const { return H_ + tiled_numbers(fours_, many_threads); }
  /// Of H, until the next `factor` has read it.
  KOKKOS_FORCEINLINE_FUNCTION R* diagonal() const { return diagonal_; }

  KOKKOS_FORCEINLINE_FUNCTION static Four& four(R* p) { return *reinterpret_cast<Four*>(p); }
  KOKKOS_FORCEINLINE_FUNCTION int tiles() const { return fours_ * (fours_ + 1) / 2; }
  /// Tile (i, j) of H, i >= j; its column b at T b.
  KOKKOS_FORCEINLINE_FUNCTION R* tile(int i, int j) const { return H_ + (Index(i) * (i + 1) / 2 + j) * newton_tile_stride; }
  /// Of number t in a triangle that is counted by rows.
  KOKKOS_FORCEINLINE_FUNCTION static int row_of_triangle(int t) {
    int i = int((sqrt(float(8 * t + 1)) - 1.0f) * 0.5f);
    if (i * (i + 1) / 2 > t) --i;
    if ((i + 1) * (i + 2) / 2 <= t) ++i;
    return i;
  }
  /// Tile (i, j) of H = 1 + S, i >= j, of those columns of S.
  KOKKOS_FORCEINLINE_FUNCTION void put(int i, int j, Four const (&columns)[T]) const {
    R* const to = tile(i, j);
    if (i != j) {
      for (int b = 0; b < T; ++b) four(to + T * b) = columns[b];
      return;
    }
    for (int b = 0; b < T; ++b) {
      Four const column = columns[b] + Four::of([&](int a) { return R(a == b ? 1 : 0); });
      four(to + T * b) = column;
      diagonal_[T * i + b] = column[b];
    }
  }
  /// H <- L, d <- L^-1 d. False where a pivot is no more than `rounding` epsilon of what it is left of; d is spoilt then.
  KOKKOS_FORCEINLINE_FUNCTION bool factor(R* d, R rounding) const {
    for (int k = 0; k < fours_; ++k) {
      Diagonal own(tile(k, k));
      R const* const diagonal = diagonal_ + T * k;
      if (!own.factor([&](int c, R pivot) { return pivot > rounding * Kokkos::Experimental::epsilon_v<R> * diagonal[c]; })) return false;
      if constexpr (one_thread) {
        update_nonzero_alone(k, own, d);
      } else {
        solve_column(k, own, d);
        if constexpr (many_threads)
          update_nonzero(k);
        else
          update_trailing(k);
      }
    }
    return true;
  }
  /// d <- L^-1 d
  KOKKOS_FORCEINLINE_FUNCTION void forward(R* d) const {
    for (int k = 0; k < fours_; ++k) {
      R x[T];
      read(d + T * k, x);
      Diagonal(tile(k, k)).forward(x);
      threads_.each(T * (fours_ - 1 - k), [&](int i) {
        R const* const row = tile(k + 1 + i / T, k) + i % T;
        R sum = d[T * (k + 1) + i];
        for (int a = 0; a < T; ++a) sum = fma(-row[T * a], x[a], sum);
        d[T * (k + 1) + i] = sum;
      });
      threads_.one([&] { write(x, d + T * k); });
    }
    threads_.sync();
  }
  /// d <- L^-T d
  KOKKOS_FORCEINLINE_FUNCTION void back(R* d) const {
    for (int k = fours_; k-- > 0;) {
      R x[T];
      read(d + T * k, x);
      Diagonal(tile(k, k)).back(x);
      threads_.each(T * k, [&](int i) {
        Four const column = four(tile(k, i / T) + T * (i % T));
        R sum = d[i];
        for (int a = 0; a < T; ++a) sum = fma(-column[a], x[a], sum);
        d[i] = sum;
      });
      threads_.one([&] { write(x, d + T * k); });
    }
    threads_.sync();
  }
  /// After what was added to the identity, tile by tile: what `put` keeps.
  KOKKOS_FORCEINLINE_FUNCTION void keep_diagonal() const {
    threads_.each(T * fours_, [&](int i) { diagonal_[i] = at(i, i); });
  }
  /// H = 1, or L, the diagonal not inverted: what `add` takes.
  KOKKOS_FORCEINLINE_FUNCTION void set_identity() const {
    threads_.each(tiles() * (newton_tile_stride / T), [&](int i) { four(H_ + Index(T) * i) = Four(R(0)); });
    threads_.each(T * fours_, [&](int i) { at(i, i) = R(1); });
  }
  /// L L^T <- L L^T + u u^T, by rotations; u is overwritten.
  KOKKOS_FORCEINLINE_FUNCTION void add(R* u) const {
    int const dofs = T * fours_;
    for (int k = 0; k < dofs; ++k) {
      R const x = u[k];
      if (x == R(0)) continue;
      R const before = at(k, k), after = sqrt(fma(x, x, before * before)), cosine = before / after, sine = x / after;
      threads_.sync();
      threads_.each(dofs - k, [&](int i) {
        R const own = at(k + i, k), other = u[k + i];
        at(k + i, k) = i == 0 ? after : fma(cosine, own, sine * other);
        u[k + i] = i == 0 ? R(0) : fma(cosine, other, -sine * own);
      });
    }
  }
  KOKKOS_FORCEINLINE_FUNCTION void invert_diagonal() const {
    threads_.each(T * fours_, [&](int i) { at(i, i) = R(1) / at(i, i); });
  }

 private:
  /// Room for tiles of a column, and of many threads for whether rows of these are not zero.
  KOKKOS_FORCEINLINE_FUNCTION short* nonzero_tiles() const { return reinterpret_cast<short*>(diagonal_ + T * fours_); }
  KOKKOS_FORCEINLINE_FUNCTION signed char* is_nonzero() const { return reinterpret_cast<signed char*>(diagonal_ + (T + 1) * fours_); }
  KOKKOS_FORCEINLINE_FUNCTION R& at(int i, int j) const { return tile(i / T, j / T)[T * (j % T) + i % T]; }
  /// The tile (k, k) of H or of L, whose diagonal is inverted.
  struct Diagonal {
    R L[T][T];  // row, column
    KOKKOS_FORCEINLINE_FUNCTION Diagonal(R* tile) {
      for (int b = 0; b < T; ++b) {
        Four const column = four(tile + T * b);
        for (int a = 0; a < T; ++a) L[a][b] = column[a];
      }
    }
    /// x <- L^-1 x, of numbers or of packs.
    template <class X>
    KOKKOS_FORCEINLINE_FUNCTION void forward(X (&x)[T]) const {
      for (int a = 0; a < T; ++a) {
        for (int b = 0; b < a; ++b) x[a] = fma(X(-L[a][b]), x[b], x[a]);
        x[a] = x[a] * X(L[a][a]);
      }
    }
    /// x <- L^-T x
    KOKKOS_FORCEINLINE_FUNCTION void back(R (&x)[T]) const {
      for (int a = T; a-- > 0;) {
        for (int b = a + 1; b < T; ++b) x[a] = fma(-L[b][a], x[b], x[a]);
        x[a] *= L[a][a];
      }
    }
    /// H <- L. @param sound  of pivots, which has the diagonal that rounding is measured by
    template <class Sound>
    KOKKOS_FORCEINLINE_FUNCTION bool factor(Sound const& sound) {
      bool all = true;
      for (int c = 0; c < T; ++c) {
        all = all && sound(c, L[c][c]);
        R const inverse = inverse_root(max(L[c][c], R(1)));  // H is 1 and more: no pivot is less
        L[c][c] = inverse;
        for (int a = c + 1; a < T; ++a) L[a][c] *= inverse;
        for (int a = c + 1; a < T; ++a)
          for (int b = c + 1; b <= a; ++b) L[a][b] = fma(-L[a][c], L[b][c], L[a][b]);
      }
      return all;
    }
    KOKKOS_FORCEINLINE_FUNCTION void store(R* tile) const {
      for (int b = 0; b < T; ++b) four(tile + T * b) = Four::of([&](int a) { return L[a][b]; });
    }
    KOKKOS_FORCEINLINE_FUNCTION static R inverse_root(R x) {
#ifdef __CUDA_ARCH__
      return ::rsqrt(x);
#else
      return R(1) / sqrt(x);
#endif
    }
  };
  /// Column k of L, and what it leaves of d.
  KOKKOS_FORCEINLINE_FUNCTION void solve_column(int k, Diagonal const& own, R* d) const {
    R known[T];
    read(d + T * k, known);
    own.forward(known);
    threads_.each(T * (fours_ - 1 - k), [&](int i) {
      R* const to = tile(k + 1 + i / T, k) + i % T;
      R x[T];
      for (int b = 0; b < T; ++b) x[b] = to[T * b];
      own.forward(x);
      R sum = d[T * (k + 1) + i];
      for (int b = 0; b < T; ++b) {
        to[T * b] = x[b];
        sum = fma(-x[b], known[b], sum);
      }
      d[T * (k + 1) + i] = sum;
      if constexpr (many_threads) is_nonzero()[i] = x[0] != R(0) || x[1] != R(0) || x[2] != R(0) || x[3] != R(0);
    });
    threads_.one([&] {  // all have read what these were
      own.store(tile(k, k));
      write(known, d + T * k);
    });
  }
  /// What column k leaves of those after it: all tiles, a column of a tile a thread.
  KOKKOS_FORCEINLINE_FUNCTION void update_trailing(int k) const {
    int const below = fours_ - 1 - k;
    threads_.each(T * (below * (below + 1) / 2), [&](int t) {
      int const i = row_of_triangle(t / T), j = t / T - i * (i + 1) / 2;
      update_tile(k + 1 + i, k + 1 + j, k, t % T, 1);
    });
  }
  /// The same where dofs meet: what tiles of column k that are not zero leave.
  KOKKOS_FORCEINLINE_FUNCTION void update_nonzero(int k) const {
    short* const nonzero = nonzero_tiles();
    int const count =
        threads_.list(fours_ - 1 - k, nonzero, [&](int i) { return reinterpret_cast<std::int32_t const*>(is_nonzero())[i] != 0; });
    int const tiles = count * (count + 1) / 2;
    threads_.sync();
    int const parts = tiles < Threads::threads ? T : 1;  // of a tile
    threads_.each(parts * tiles, [&](int t) {
      int const i = row_of_triangle(t / parts), j = t / parts - i * (i + 1) / 2;
      update_tile(k + 1 + nonzero[i], k + 1 + nonzero[j], k, t % parts, T / parts);
    });
  }
  /// All of that by one thread.
  KOKKOS_FORCEINLINE_FUNCTION void update_nonzero_alone(int k, Diagonal const& own, R* d) const {
    R known[T];
    read(d + T * k, known);
    own.forward(known);
    own.store(tile(k, k));
    write(known, d + T * k);
    short* const nonzero = nonzero_tiles();
    int count = 0;
    for (int i = k + 1; i < fours_; ++i) {
      R* const to = tile(i, k);
      Four x[T];
      bool any = false;
      for (int b = 0; b < T; ++b) {
        x[b] = four(to + T * b);
        any = any || !all(x[b] == Four(R(0)));
      }
      if (!any) continue;
      nonzero[count++] = static_cast<short>(i);
      own.forward(x);
      Four sum = four(d + T * i);
      for (int b = 0; b < T; ++b) {
        four(to + T * b) = x[b];
        sum = fma(x[b], Four(-known[b]), sum);
      }
      four(d + T * i) = sum;
    }
    for (int i = 0; i < count; ++i)
      for (int j = 0; j <= i; ++j) update_tile(nonzero[i], nonzero[j], k, 0, T);
  }
  /// Tile (i, j) -= L_ik L_jk^T, `columns` of it from `first` on.
  KOKKOS_FORCEINLINE_FUNCTION void update_tile(int i, int j, int k, int first, int columns) const {
    R *const to = tile(i, j), *const left = tile(i, k), *const right = tile(j, k);
    Four x[T];
    for (int c = 0; c < T; ++c) x[c] = four(left + T * c);
    for (int b = first; b < first + columns; ++b) {
      Four sum = four(to + T * b);
      for (int c = 0; c < T; ++c) sum = fma(x[c], Four(-right[T * c + b]), sum);
      four(to + T * b) = sum;
    }
  }
  KOKKOS_FORCEINLINE_FUNCTION static void read(R* from, R (&x)[T]) {
    Four const all = four(from);
    for (int a = 0; a < T; ++a) x[a] = all[a];
  }
  KOKKOS_FORCEINLINE_FUNCTION static void write(R const (&x)[T], R* to) {
    four(to) = Four::of([&](int a) { return x[a]; });
  }

  Threads threads_;
  int fours_;
  R *H_, *diagonal_;
};

}  // namespace gsp::detail
