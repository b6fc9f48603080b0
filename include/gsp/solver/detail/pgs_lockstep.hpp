#pragma once
#include <gsp/constraint/rows.hpp>

/// Projected Gauss-Seidel for small worlds on a CPU: a pack of worlds in lockstep, row r of all of them at once. A row's entries are
/// widened to the dofs that any of the worlds has in it, so that nothing is gathered inside a sweep. What bounds it is reading Y from the
/// second-level cache. A world takes this path by its own number of rows alone, and its lane never sees another lane.
namespace gsp::detail {

template <class R, class Mem, class Options>
struct PgsLockstep {
  static constexpr int W = native_width<R>;
  using T = Pack<R, W>;
  Model<R, Mem> model;
  Rows<R, Mem> rows;
  Options options;

  [[gnu::noinline]] void operator()(int block, int thread) const {
    int const w0 = block * W, nv = model.nv, parity = rows.parity();
    int count[W], most = 0;
    for (int l = 0; l < W; ++l) {
      count[l] = w0 + l < rows.worlds ? rows.count(w0 + l) : 0;
      if (count[l] > lockstep_most_rows) count[l] = 0;  // that world goes alone
      most = count[l] > most ? count[l] : most;
    }
    T* const z = reinterpret_cast<T*>(rows.thread_items.data() + std::int64_t(thread) * rows.thread_stride);
    T* const bias = z + (nv + 3) / 4 * 4;
    T *const compliance = bias + most, *const inverse = compliance + most, *const lower = inverse + most, *const upper = lower + most,
             *const mu = upper + most, *const p = mu + most;
    T* const Y = p + most;
    for (T* q = z; q != bias; ++q) *q = T(R(0));

    // widen: which groups of four dofs row r has in any world, then its entries, lane by lane. Whole groups, so that the order in which a
    // world's entries are summed does not depend on what the other worlds have.
    struct Place {
      int first, groups;
      short dof[lockstep_most_dofs / 4];  // first of the four
    };
    Place place[lockstep_most_rows];
    std::uint32_t used[lockstep_most_rows] = {};
    for (int r = 0; r < most; ++r)
      for (int l = 0; l < W; ++l) {
        if (r >= count[l]) continue;
        Row<R> const& row = rows.row(rows.first(w0 + l) + r);
        for (int k = 0; k < row.segments; ++k) used[r] |= groups_of(row.segment[k]);
      }
    int size = 0;
    for (int r = 0; r < most; ++r) {
      Place& here = place[r];
      here.first = size, here.groups = 0;
      for (std::uint32_t bits = used[r]; bits != 0; bits &= bits - 1) here.dof[here.groups++] = short(4 * Kokkos::countr_zero(bits));
      for (int e = 0; e < 4 * here.groups; ++e) Y[size++] = T(R(0));
      bias[r] = compliance[r] = inverse[r] = lower[r] = upper[r] = mu[r] = p[r] = T(R(0));
    }
    for (int r = 0; r < most; ++r)  // row by row: what is written to stays in the first-level cache while the lanes take turns
      for (int l = 0; l < W; ++l) {
        if (r >= count[l]) continue;
        Row<R> const& row = rows.row(rows.first(w0 + l) + r);
        auto const lane = [r, l](T* pack) -> R& { return reinterpret_cast<R*>(pack + r)[l]; };
        bool const friction = row.friction_of >= 0;
        lane(bias) = row.bias, lane(compliance) = row.compliance, lane(inverse) = row.inverse_diagonal;
        lane(lower) = friction ? R(0) : row.lower, lane(upper) = friction ? R(0) : row.upper, lane(mu) = friction ? row.upper : R(-1);
        lane(p) = rows.impulse[parity](rows.first(w0 + l) + r);
        R* const entries = reinterpret_cast<R*>(Y + place[r].first) + l;
        R const* y = rows.Y.data() + row.Y;
        auto const entry_of = [&](int dof) {  // after the groups before
          return 4 * Kokkos::popcount(used[r] & ((std::uint32_t(1) << (dof >> 2)) - 1)) + (dof & 3);
        };
        for (int k = 0; k < row.segments; ++k) {
          auto const& segment = row.segment[k];
          if (int const* const list = list_of(segment)) {
            for (int i = 0; i < segment.count; ++i) entries[W * entry_of(segment.dof0 + list[i])] = y[i];
          } else {  // consecutive dofs: all of their groups are there
            R* const e = entries + W * entry_of(segment.dof0);
            for (int i = 0; i < segment.count; ++i) e[W * i] = y[i];
          }
          y += segment.count;
        }
      }
    for (int r = 0; r < most; ++r) push(Y, place[r], z, p[r]);

    // friction follows its normal row: the last row without friction of that world
    R const relaxation(options.relaxation), tolerance(options.tolerance);
    auto const target = [&](int r, T& normal, R relax) {
      T const *const y = Y + place[r].first, zero(R(0));
      T w[4] = {fma(compliance[r], p[r], bias[r]), zero, zero, zero};  // four sums: one would wait for itself
      for (int g = 0; g < place[r].groups; ++g) {
        T const* const part = z + place[r].dof[g];
        for (int k = 0; k < 4; ++k) w[k] = fma(y[4 * g + k], part[k], w[k]);
      }
      auto const friction = mu[r] >= zero;
      T const bound = mu[r] * normal;
      T const next = clamp(fma(T(-relax) * inverse[r], (w[0] + w[1]) + (w[2] + w[3]), p[r]), select(friction, -bound, lower[r]),
                           select(friction, bound, upper[r]));
      return next;
    };
    auto const remember = [&](int r, T& normal) { normal = select(mu[r] >= T(R(0)), normal, p[r]); };
    int sweeps[W] = {};
    Mask<R, W> active;
    for (int l = 0; l < W; ++l) active.set(l, count[l] > 0);
    for (int sweep = 0; sweep < options.iterations && any(active); ++sweep) {
      T normal(R(0)), change(R(0));
      for (int r = 0; r < most; ++r) {
        T const next = target(r, normal, relaxation);
        T const d = select(active && inverse[r] > T(R(0)), next - p[r], T(R(0)));
        p[r] = p[r] + d;
        push(Y, place[r], z, d);
        if (tolerance > 0) change = max(change, abs(d) / select(inverse[r] > T(R(0)), inverse[r], T(R(1))));
        remember(r, normal);
      }
      for (int l = 0; l < W; ++l)
        if (active[l]) {
          ++sweeps[l];
          if (tolerance > 0 && !(change[l] > tolerance)) active.set(l, false);
        }
    }
    T worst(R(0)), normal(R(0));
    if (options.residual)
      for (int r = 0; r < most; ++r) {
        T const miss = abs(target(r, normal, R(1)) - p[r]);
        worst = max(worst, select(inverse[r] > T(R(0)), miss / inverse[r], T(R(0))));
        remember(r, normal);
      }
    for (int l = 0; l < W; ++l) {
      if (w0 + l >= rows.worlds || rows.count(w0 + l) > lockstep_most_rows) continue;
      R* const out = rows.z.data() + std::int64_t(w0 + l) * nv;
      for (int i = 0; i < nv; ++i) out[i] = z[i][l];
      for (int r = 0; r < count[l]; ++r) rows.impulse[parity](rows.first(w0 + l) + r) = p[r][l];
      rows.iterations(w0 + l) = sweeps[l], rows.residual(w0 + l) = worst[l];
    }
  }

 private:
  /// z += Y^T d
  template <class Place>
  static void push(T const* Y, Place const& place, T* z, T const& d) {
    T const* const y = Y + place.first;
    for (int g = 0; g < place.groups; ++g)
      for (int k = 0; k < 4; ++k) z[place.dof[g] + k] = fma(y[4 * g + k], d, z[place.dof[g] + k]);
  }
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
