#pragma once
#include <gsp/constraint/rows.hpp>

/// Projected Gauss-Seidel for small worlds on a CPU: a pack of worlds in lockstep, and four rows at a time, rows 4 q to 4 q + 3 of all of
/// them. Four dot products read z once, and so does z += sum Y^T d; what the rows of a block do to each other in between goes through their
/// products:
///   w_b = Y_b z + sum_{a < b} (Y_b . Y_a) d_a + C p_b + bias_b     (z as before the block: the same numbers as row by row)
/// A block's entries are widened to the dofs that any of its rows has in any of the worlds, so that nothing is gathered inside a sweep.
/// What bounds a sweep is loading Y, twice a block. A world takes this path by its own number of rows alone, which rows share a block is a
/// matter of their numbers, and a lane never sees another lane.
namespace gsp::detail {

template <class R, class Mem, class Options>
struct PgsLockstep {
  static constexpr int W = native_width<R>, B = lockstep_rows;
  using T = Pack<R, W>;
  Model<R, Mem> model;
  Rows<R, Mem> rows;
  Options options;

  /// What is known of B rows but their entries; `mu` < 0: without friction.
  struct Block {
    T bias[B], compliance[B], inverse[B], lower[B], upper[B], mu[B], p[B], product[B * (B - 1) / 2];
    T const* Y;  // entry e of row b at B e + b
    int groups;  // of four dofs
    short dof[lockstep_most_dofs / 4];
  };

  [[gnu::noinline]] void operator()(int first, int thread) const {
    int const w0 = first * W, nv = model.nv, parity = rows.parity();
    int count[W], most = 0;
    for (int l = 0; l < W; ++l) {
      count[l] = w0 + l < rows.worlds ? rows.count(w0 + l) : 0;
      if (count[l] > lockstep_most_rows) count[l] = 0;  // that world goes alone
      most = count[l] > most ? count[l] : most;
    }
    int const blocks = (most + B - 1) / B;
    T* const z = reinterpret_cast<T*>(rows.thread_items.data() + std::int64_t(thread) * rows.thread_stride);
    T* Y = z + (nv + 3) / 4 * 4;
    for (T* q = z; q != Y; ++q) *q = T(R(0));
    Block block[lockstep_most_rows / B];
    for (int q = 0; q < blocks; ++q) widen(block[q], Y, q, w0, count, parity), push(block[q], z, block[q].p);

    R const relaxation(options.relaxation), tolerance(options.tolerance);
    T const zero(R(0)), one(R(1));
    int sweeps[W] = {};
    Mask<R, W> active;
    for (int l = 0; l < W; ++l) active.set(l, count[l] > 0);
    for (int sweep = 0; sweep < options.iterations && any(active); ++sweep) {
      T normal = zero, change = zero;
      for (int q = 0; q < blocks; ++q) {
        Block& k = block[q];
        T w[B], d[B];
        dot(k, z, w);
        for (int b = 0, at = 0; b < B; ++b) {
          for (int a = 0; a < b; ++a) w[b] = fma(k.product[at++], d[a], w[b]);
          auto const movable = k.inverse[b] > zero;
          d[b] = select(active && movable, target(k, b, w[b], normal, relaxation) - k.p[b], zero);
          k.p[b] = k.p[b] + d[b];
          if (tolerance > 0) change = max(change, abs(d[b]) / select(movable, k.inverse[b], one));
          remember(k, b, normal);
        }
        push(k, z, d);
      }
      for (int l = 0; l < W; ++l)
        if (active[l]) {
          ++sweeps[l];
          if (tolerance > 0 && !(change[l] > tolerance)) active.set(l, false);
        }
    }
    T worst = zero, normal = zero;
    for (int q = 0; options.residual && q < blocks; ++q) {
      Block const& k = block[q];
      T w[B];
      dot(k, z, w);
      for (int b = 0; b < B; ++b) {
        T const miss = abs(target(k, b, w[b], normal, R(1)) - k.p[b]);
        worst = max(worst, select(k.inverse[b] > zero, miss / k.inverse[b], zero));
        remember(k, b, normal);
      }
    }
    for (int l = 0; l < W; ++l) {
      if (w0 + l >= rows.worlds || rows.count(w0 + l) > lockstep_most_rows) continue;
      R* const out = rows.z.data() + std::int64_t(w0 + l) * nv;
      for (int i = 0; i < nv; ++i) out[i] = z[i][l];
      for (int r = 0; r < count[l]; ++r) rows.impulse[parity](rows.first(w0 + l) + r) = block[r / B].p[r % B][l];
      rows.iterations(w0 + l) = sweeps[l], rows.residual(w0 + l) = worst[l];
    }
  }

 private:
  /// Takes rows B q .. of all worlds into `k`; their entries go to Y, which moves on. Entries come by whole groups of four dofs, so that
  /// the order in which a world's are summed does not depend on what the other worlds have.
  void widen(Block& k, T*& Y, int q, int w0, int const (&count)[W], int parity) const {
    std::uint32_t used = 0;
    for (int l = 0; l < W; ++l) {
      if (B * q >= count[l]) continue;
      Row<R> const* const mine = &rows.row(rows.first(w0 + l) + B * q);
      prefetch(mine + B, B * sizeof(Row<R>));  // W worlds are more streams than the processor follows by itself
      for (int b = 0; b < B && B * q + b < count[l]; ++b) {
        int entries = 0;
        for (int s = 0; s < mine[b].segments; ++s) used |= groups_of(mine[b].segment[s]), entries += mine[b].segment[s].count;
        prefetch(rows.Y.data() + mine[b].Y, entries * sizeof(R));
      }
    }
    k.Y = Y, k.groups = 0;
    for (std::uint32_t bits = used; bits != 0; bits &= bits - 1) k.dof[k.groups++] = short(4 * Kokkos::countr_zero(bits));
    T* const end = Y + B * 4 * k.groups;
    for (T* y = Y; y != end; ++y) *y = T(R(0));
    for (int b = 0; b < B; ++b) k.bias[b] = k.compliance[b] = k.inverse[b] = k.lower[b] = k.upper[b] = k.mu[b] = k.p[b] = T(R(0));
    for (int l = 0; l < W; ++l)
      for (int b = 0; b < B && B * q + b < count[l]; ++b) {
        Row<R> const& row = rows.row(rows.first(w0 + l) + B * q + b);
        auto const lane = [b, l](T* pack) -> R& { return reinterpret_cast<R*>(pack + b)[l]; };
        bool const friction = row.friction_of >= 0;
        lane(k.bias) = row.bias, lane(k.compliance) = row.compliance, lane(k.inverse) = row.inverse_diagonal;
        lane(k.lower) = friction ? R(0) : row.lower, lane(k.upper) = friction ? R(0) : row.upper;
        lane(k.mu) = friction ? row.upper : R(-1), lane(k.p) = rows.impulse[parity](rows.first(w0 + l) + B * q + b);
        R* const entries = reinterpret_cast<R*>(Y + b) + l;
        R const* y = rows.Y.data() + row.Y;
        auto const entry_of = [&](int dof) {  // after the groups before
          return B * (4 * Kokkos::popcount(used & ((std::uint32_t(1) << (dof >> 2)) - 1)) + (dof & 3));
        };
        for (int s = 0; s < row.segments; ++s) {
          auto const& segment = row.segment[s];
          if (int const* const list = list_of(segment)) {
            for (int i = 0; i < segment.count; ++i) entries[W * entry_of(segment.dof0 + list[i])] = y[i];
          } else {  // consecutive dofs: all of their groups are there
            R* const e = entries + W * entry_of(segment.dof0);
            for (int i = 0; i < segment.count; ++i) e[B * W * i] = y[i];
          }
          y += segment.count;
        }
      }
    for (int b = 0, at = 0; b < B; ++b)
      for (int a = 0; a < b; ++a) {
        T sum(R(0));
        for (T const* y = Y; y != end; y += B) sum = fma(y[a], y[b], sum);
        k.product[at++] = sum;
      }
    Y = end;
  }
  static void prefetch(void const* at, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; i += 64) __builtin_prefetch(static_cast<char const*>(at) + i);
  }
  /// w = Y z
  static void dot(Block const& k, T const* z, T (&w)[B]) {
    T sum[4][B];  // one sum a row would wait for itself
    for (auto& of_dof : sum)
      for (T& x : of_dof) x = T(R(0));
    T const* y = k.Y;
    for (int g = 0; g < k.groups; ++g)
      for (int i = 0; i < 4; ++i, y += B) {
        T const x = z[k.dof[g] + i];
        for (int b = 0; b < B; ++b) sum[i][b] = fma(y[b], x, sum[i][b]);
      }
    for (int b = 0; b < B; ++b) w[b] = (sum[0][b] + sum[1][b]) + (sum[2][b] + sum[3][b]);
  }
  /// z += Y^T d
  static void push(Block const& k, T* z, T const (&d)[B]) {
    T const* y = k.Y;
    for (int g = 0; g < k.groups; ++g)
      for (int i = 0; i < 4; ++i, y += B) {
        T x = z[k.dof[g] + i];
        for (int b = 0; b < B; ++b) x = fma(y[b], d[b], x);
        z[k.dof[g] + i] = x;
      }
  }
  /// The impulse that takes row b to its bounds or to rest. Friction follows its normal row: the last row without friction of that world.
  static T target(Block const& k, int b, T const& Yz, T const& normal, R relaxation) {
    T const bound = k.mu[b] * normal, w = Yz + fma(k.compliance[b], k.p[b], k.bias[b]);
    auto const friction = k.mu[b] >= T(R(0));
    return clamp(fma(T(-relaxation) * k.inverse[b], w, k.p[b]), select(friction, -bound, k.lower[b]), select(friction, bound, k.upper[b]));
  }
  static void remember(Block const& k, int b, T& normal) { normal = select(k.mu[b] >= T(R(0)), normal, k.p[b]); }

  /// Bits of the groups of four dofs that a segment has entries in.
  std::uint32_t groups_of(RowSegment const& s) const {
    std::uint32_t bits = 0;
    if (int const* const list = list_of(s)) {
      for (int i = 0; i < s.count; ++i) bits |= std::uint32_t(1) << ((s.dof0 + list[i]) >> 2);
    } else if (s.count > 0) {
      int const low = s.dof0 >> 2, high = (s.dof0 + s.count - 1) >> 2;
      bits = std::uint32_t(((std::uint64_t(1) << (high - low + 1)) - 1) << low);
    }
    return bits;
  }
  int const* list_of(RowSegment const& s) const { return s.list < 0 ? nullptr : model.ints.data() + s.list; }
};

template <class Exec, class Solver>
struct LockstepLoop {
  Solver solver;
  void operator()(int block) const {
    if (solver.rows.halt()) return;
    Kokkos::Experimental::UniqueToken<Exec, Kokkos::Experimental::UniqueTokenScope::Global> const token;
    int const thread = token.acquire();
    solver(block, thread);
    token.release(thread);
  }
};

}  // namespace gsp::detail
