#pragma once
#include <gsp/parallel/detail/thread_room.hpp>
#include <gsp/solver/detail/newton_island.hpp>
#include <gsp/solver/detail/newton_until_rest.hpp>
#include <gsp/solver/detail/row_vectors.hpp>

/// The kernel of `newton` (solver/newton.hpp): a thread or a warp a world, island by island. Islands that no near memory holds
/// (newton_island.hpp) are solved here, where their rows lie.
namespace gsp::detail {

/// Lower triangle by columns, the direction, and room for the diagonal, a row or the direction in the order of the island's dofs.
inline std::int64_t newton_work(int nv) { return std::int64_t(nv) * (nv + 1) / 2 + 2 * nv; }

template <class R, class Mem>
struct NewtonWorld : NewtonProblem<R, Mem> {
  using Problem = NewtonProblem<R, Mem>;
  using Problem::dof_of, Problem::place_of, Problem::least_of, Problem::lists_of, Problem::next_column;
  using Problem::N, Problem::rows, Problem::impulses, Problem::solution, Problem::progress, Problem::rate, Problem::rate_change,
      Problem::least, Problem::work, Problem::stride, Problem::near_bytes, Problem::iterations, Problem::tolerance, Problem::warm,
      Problem::residual, Problem::ends_step;
  using typename Problem::Lists;
  using typename Problem::Shifts;
  NewtonLists<Mem> lists{};  // GPUs

  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    solve(world, work.data() + world.rank * stride, nullptr);
  }
  /// Of one world: what fits into near memory there, on a GPU later (newton_island_cuda.hpp).
  /// @param H, near  room: of the matrix and directions, and hosts: near memory
  template <class World>
  KOKKOS_FUNCTION void solve(World const& world, R* H, void* near) const {
    int const id = world.rank, first = rows.first(id);
    if (progress.halt()) {
      if (id == 0 && ends_step) world.single([&] { ++progress.skipped(); });
      return;
    }
    if (id == 0) world.single([&] { impulses.solved() = 1; });
    R *const z = solution.z.data() + std::int64_t(id) * rows.nv, *const p = impulses.p[impulses.parity()].data() + first;
    world.each(rows.nv, [&](int i) { z[i] = R(0); });
    world.single([&] {
      solution.iterations(id) = 0;
      solution.residual(id) = residual ? R(0) : Kokkos::Experimental::quiet_NaN_v<R>;
    });
    auto const tell = [&](int done, R worst) {
      world.single([&] {
        solution.iterations(id) = done > solution.iterations(id) ? done : solution.iterations(id);
        if (residual) solution.residual(id) = max_or_nan(solution.residual(id), worst);
      });
    };
    int number = -1;
    each_island(world, rows, id, [&](IslandRows const& island) {
      ++number;
      constexpr bool one_thread = std::is_same_v<World, SerialWorld>;
      constexpr int at_once = one_thread ? native_width<R> : 1;
      bool const cones = this->has_cones(world, lists_of(id, island));
      if (NewtonSizes<R, at_once> const size(island.count, island.dofs, cones); size.fits(near_bytes)) {
        if constexpr (one_thread) {
          NewtonIsland<R, Mem, World> own(*this, world, island, cones, near);
          int const done = newton_until_rest<R>(own, iterations, tolerance);
          tell(done, own.write());
        } else {
          world.single([&] { lists.add(size.bytes(), id * islands_of_world(rows) + number, cones); });
        }
        return;
      }
      Global<World> own{*this,
                        world,
                        lists_of(id, island),
                        z,
                        rate.data() + first,
                        p,
                        rate_change.data() + first,
                        H,
                        H + std::int64_t(rows.nv) * (rows.nv + 1) / 2};
      int const done = newton_until_rest<R>(own, iterations, tolerance);
      tell(done, own.finish());
    });
    auto const& islands = rows.islands;
    if (int const count = rows.count(id); islands.ntree > 1 && count > 0 && islands.first_element(id, islands.count(id)) < count)
      set_without_trees(world, lists_of(id, {nullptr, count, nullptr, rows.nv}), rate.data() + first, p);
  }

  /// An island in global memory, for newton_until_rest.
  template <class World>
  struct Global {
    NewtonWorld const& k;
    World const& world;
    Lists l;
    R *z, *w, *p, *change, *H, *d;
    R zd = R(0), dd = R(0);

    KOKKOS_INLINE_FUNCTION R dot(R const* a, R const* b) const {
      return world.template sum<R>(l.island.dofs, [&](int i) { return a[l.island.dof(i)] * b[l.island.dof(i)]; });
    }
    /// z = Y^T p of the impulses given, or 0 where that costs less; w = Y z + b.
    KOKKOS_INLINE_FUNCTION void begin() {
      auto const& e = l.island;
      k.set_least(world, l, d);
      k.each_row(world, l, [&](int r) { w[r] = l.row[r].bias; });
      if (!k.warm) return;
      R const none = k.total_cost(world, l, w);
      k.push(world, l, z, p);
      k.each_row(world, l, [&](int r) { w[r] = dot_row(SerialWorld{0}, k.rows, l.row[r], z) + l.row[r].bias; });
      R const given = k.total_cost(world, l, w) + R(0.5) * dot(z, z);
      if (given < none) return;
      world.sync();
      world.each(e.dofs, [&](int i) { z[e.dof(i)] = R(0); });
      k.each_row(world, l, [&](int r) { w[r] = l.row[r].bias; });
    }
    KOKKOS_INLINE_FUNCTION R gradient() {
      auto const& e = l.island;
      world.each(e.dofs, [&](int i) { d[e.dof(i)] = -z[e.dof(i)]; });
      k.set_impulses(world, l, w, p);
      k.push(world, l, d, p);
      return dot(d, d);
    }
    KOKKOS_INLINE_FUNCTION R solve() {
      auto const& e = l.island;
      int const n = e.dofs;
      R* const place = d + k.rows.nv;  // room
      k.assemble(world, l, w, H);
      if (!k.factor(world, H, place, n)) k.factor_rows(world, l, w, H, place);
      if (e.list) world.each(n, [&](int i) { place[i] = d[e.dof(i)]; });
      world.sync();
      R const decrement = k.solve_factored(world, H, n, e.list ? place : d);
      if (e.list) world.each(n, [&](int i) { d[e.dof(i)] = place[i]; });
      world.sync();
      return decrement;
    }
    KOKKOS_INLINE_FUNCTION R size() const { return dot(z, z); }
    KOKKOS_INLINE_FUNCTION R summed() const {
      auto const& e = l.island;
      R* const room = d + k.rows.nv;
      world.each(e.dofs, [&](int i) { room[e.dof(i)] = R(0); });
      for (int i = 0; i < e.count; ++i) {
        Row<R> const& row = l.row[e.row(i)];
        world.sync();
        world.each(row.segment[0].count + row.segment[1].count,
                   [&](int q) { room[k.dof_of(row, q)] += abs(k.rows.Y(row.first_entry + q) * p[e.row(i)]); });
      }
      world.sync();
      return dot(room, room);
    }
    KOKKOS_INLINE_FUNCTION void look_along() {
      k.each_row(world, l, [&](int r) { change[r] = dot_row(SerialWorld{0}, k.rows, l.row[r], d); });
      zd = dot(z, d);
      dd = dot(d, d);
    }
    /// Of  |z + alpha d|^2 / 2 + sum s(w + alpha Y d).
    KOKKOS_INLINE_FUNCTION R slope(R alpha) const {
      return zd + alpha * dd - world.template sum<R>(l.island.count, [&](int i) {
        int const r = l.island.row(i), n = l.element_rows[r];
        if (n == 0) return R(0);
        return soft_pull(soft_element(l.row + r, n, l.least + r), w + r, change + r, alpha);
      });
    }
    KOKKOS_INLINE_FUNCTION void go(R alpha) {
      auto const& e = l.island;
      world.each(e.dofs, [&](int i) { z[e.dof(i)] = fma(alpha, d[e.dof(i)], z[e.dof(i)]); });
      k.each_row(world, l, [&](int r) { w[r] = fma(alpha, change[r], w[r]); });
    }
    /// p(w); and the largest change of a rate, where it is asked for. z stays what it is: in Y^T p what stiff rows bear against each other
    /// leaves |Y w / C| epsilon, which H has divided by Y^2 / C in z.
    KOKKOS_INLINE_FUNCTION R finish() {
      auto const& e = l.island;
      k.set_impulses(world, l, w, p);
      if (!k.residual) return R(0);
      world.each(e.dofs, [&](int i) { d[e.dof(i)] = R(0); });
      k.push(world, l, d, p);
      R worst(0);
      for (int i = 0; i < e.count; ++i) {
        auto const& row = l.row[e.row(i)];
        worst = max_or_nan(worst, abs(dot_row(SerialWorld{0}, k.rows, row, d) + row.bias - w[e.row(i)]));
      }
      return worst;
    }
  };

  /// f(r) for the rows of the island, a row a thread: dot_row is called with SerialWorld.
  template <class World, class F>
  KOKKOS_INLINE_FUNCTION void each_row(World const& world, Lists const& l, F const& f) const {
    world.each(l.island.count, [&](int k) { f(l.island.row(k)); });
    world.sync();
  }
  /// to += Y^T p of its rows.
  template <class World>
  KOKKOS_INLINE_FUNCTION void push(World const& world, Lists const& l, R* to, R const* p) const {
    for (int k = 0; k < l.island.count; ++k) {
      int const r = l.island.row(k);
      world.sync();
      if (p[r] != R(0)) push_row(world, rows, l.row[r], to, p[r]);
    }
    world.sync();
  }

  /// The least compliance of each row (least_softness). @param most  room: the largest Y^2 on each dof
  template <class World>
  KOKKOS_FUNCTION void set_least(World const& world, Lists const& l, R* most) const {
    auto const& e = l.island;
    world.each(e.dofs, [&](int i) { most[e.dof(i)] = R(0); });
    for (int k = 0; k < e.count; ++k) {
      Row<R> const& row = l.row[e.row(k)];
      world.sync();
      world.each(row.segment[0].count + row.segment[1].count, [&](int i) {
        R& on_dof = most[dof_of(row, i)];
        on_dof = max(on_dof, square(rows.Y(row.first_entry + i)));
      });
    }
    world.sync();
    each_row(world, l, [&](int r) {
      Row<R> const& row = l.row[r];
      R sum(0), own(0);
      for (int i = 0; i < row.segment[0].count + row.segment[1].count; ++i) {
        R const y = rows.Y(row.first_entry + i);
        if (y != R(0)) sum += most[dof_of(row, i)];
        own += square(y);
      }
      l.least[r] = least_of(row.compliance, sum, own);
    });
  }
  /// Rows that touch no tree bear what they are asked for: no one solves for them.
  template <class World>
  KOKKOS_FUNCTION void set_without_trees(World const& world, Lists const& l, R* w, R* p) const {
    each_row(world, l, [&](int r) {
      l.least[r] = R(least_compliance);
      w[r] = l.row[r].bias;
    });
    world.each(l.island.count, [&](int r) {
      if (int const n = l.element_rows[r]; n > 0 && rows.islands.keys(l.first + r) < 0)
        soft_impulses(soft_element(l.row + r, n, l.least + r), w + r, p + r);
    });
  }

  /// The elements one after the other, shared among the threads: f(element, first of its rows).
  template <class World, class F>
  KOKKOS_INLINE_FUNCTION void each_element(World const& world, Lists const& l, F const& f) const {
    each_row(world, l, [&](int r) {
      if (int const n = l.element_rows[r]; n > 0) f(soft_element(l.row + r, n, l.least + r), r);
    });
  }
  template <class World>
  KOKKOS_FUNCTION void set_impulses(World const& world, Lists const& l, R const* w, R* p) const {
    each_element(world, l, [&](SoftElement<R> const& e, int r) { soft_impulses(e, w + r, p + r); });
  }
  template <class World>
  KOKKOS_FUNCTION R total_cost(World const& world, Lists const& l, R const* w) const {
    return world.template sum<R>(l.island.count, [&](int k) {
      int const r = l.island.row(k), n = l.element_rows[r];
      if (n == 0) return R(0);
      SoftElement<R> const e = soft_element(l.row + r, n, l.least + r);
      R p[N];
      soft_impulses(e, w + r, p);
      return soft_cost(e, w + r, p);
    });
  }

  /// H <- 1 + Y^T B Y, of the island's dofs.
  template <class World>
  KOKKOS_FUNCTION void assemble(World const& world, Lists const& l, R const* w, R* H) const {
    int const nv = l.island.dofs;
    world.each(nv, [&](int k) {
      R* const column = column_of(H, nv, k);
      column[k] = R(1);
      for (int i = k + 1; i < nv; ++i) column[i] = R(0);
    });
    world.sync();
    for (int k = 0, n; k < l.island.count; k += n) {
      int const r = l.island.row(k);
      n = l.element_rows[r];
      R B[N][N];
      if (!soft_curvature(soft_element(l.row + r, n, l.least + r), w + r, B)) continue;
      if (n == 1 || l.row[r].same_segments)
        add_element(world, l, l.row + r, n, B, H);
      else
        add_pairs(world, l, l.row + r, n, B, H);
    }
  }
  /// H += sum B_ab Y_a Y_b^T where the rows have the same entries: a column a thread.
  template <class World>
  KOKKOS_INLINE_FUNCTION void add_element(World const& world, Lists const& l, Row<R> const* row, int n, R const (&B)[N][N], R* H) const {
    int const entries = row->segment[0].count + row->segment[1].count, nv = l.island.dofs;
    Shifts const shifts(*this, l, *row);
    world.each(entries, [&](int i) {
      int const k = place_of(*row, i, shifts);
      R u[N];
      for (int b = 0; b < n; ++b) {
        u[b] = R(0);
        for (int a = 0; a < n; ++a) u[b] = fma(B[a][b], rows.Y(row[a].first_entry + i), u[b]);
      }
      R* const column = column_of(H, nv, k);
      for (int j = 0; j < entries; ++j) {
        int const at = place_of(*row, j, shifts);
        if (at < k) continue;
        R sum = column[at];
        for (int b = 0; b < n; ++b) sum = fma(u[b], rows.Y(row[b].first_entry + j), sum);
        column[at] = sum;
      }
    });
    world.sync();
  }
  template <class World>
  KOKKOS_INLINE_FUNCTION void add_pairs(World const& world, Lists const& l, Row<R> const* row, int n, R const (&B)[N][N], R* H) const {
    int const nv = l.island.dofs;
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b) {
        if (B[a][b] == R(0)) continue;
        Shifts const of_a(*this, l, row[a]), of_b(*this, l, row[b]);
        world.each(row[a].segment[0].count + row[a].segment[1].count, [&](int i) {
          int const k = place_of(row[a], i, of_a);
          R const u = B[a][b] * rows.Y(row[a].first_entry + i);
          R* const column = column_of(H, nv, k);
          for (int j = 0; j < row[b].segment[0].count + row[b].segment[1].count; ++j)
            if (int const at = place_of(row[b], j, of_b); at >= k) column[at] = fma(u, rows.Y(row[b].first_entry + j), column[at]);
        });
        world.sync();
      }
  }

  /// H <- L with L L^T = H, columns that do not meet left out. False where rounding is much of a pivot: H is 1 and what is positive
  /// semidefinite, so that no pivot is less than 1, but stiff rows that are nearly parallel, or there twice, leave epsilon H_kk of it and
  /// more, and over a pivot of 1 that would grow by its square from column to column.
  /// @param diagonal  room: that of H
  template <class World>
  KOKKOS_FUNCTION bool factor(World const& world, R* H, R* diagonal, int nv) const {
    world.each(nv, [&](int k) { diagonal[k] = column_of(H, nv, k)[k]; });
    world.sync();
    for (int k = 0; k < nv; ++k) {
      R* const column = column_of(H, nv, k);
      if (!(column[k] > R(newton_pivot) * Kokkos::Experimental::epsilon_v<R> * diagonal[k])) return false;
      R const root = sqrt(max(column[k], R(1))), inverse = R(1) / root;
      world.sync();
      world.each(nv - k, [&](int i) { column[k + i] = i == 0 ? root : column[k + i] * inverse; });
      world.sync();
      for (int j = k + 1; j < nv; ++j) {
        R const x = column[j];
        if (x == R(0)) continue;
        R* const other = column_of(H, nv, j);
        world.each(nv - j, [&](int i) { other[j + i] = fma(-x, column[j + i], other[j + i]); });
      }
      world.sync();
    }
    return true;
  }
  /// L of 1 + Y^T B Y without the sum: from L = 1 each column u of Y^T G, B = G G^T, is turned into it by plane rotations,
  ///   (L u) Q = (L' 0),   L' L'^T = L L^T + u u^T
  /// Rounding is epsilon of |u| then, where the sum has epsilon of |u|^2. Twice the work and more, for the few worlds that need it.
  /// @param u  room
  template <class World>
  KOKKOS_FUNCTION void factor_rows(World const& world, Lists const& l, R const* w, R* L, R* u) const {
    int const nv = l.island.dofs;
    world.sync();
    world.each(nv, [&](int k) {
      R* const column = column_of(L, nv, k);
      column[k] = R(1);
      for (int i = k + 1; i < nv; ++i) column[i] = R(0);
    });
    for (int k = 0, n; k < l.island.count; k += n) {
      int const r = l.island.row(k);
      n = l.element_rows[r];
      R G[N][N];
      if (!soft_curvature(soft_element(l.row + r, n, l.least + r), w + r, G)) continue;
      for (int c = 0; c < n; ++c) {
        if (!next_column(G, n, c)) continue;
        world.sync();
        world.each(nv, [&](int i) { u[i] = R(0); });
        world.sync();
        for (int b = c; b < n; ++b) {
          Row<R> const& row = l.row[r + b];
          Shifts const shifts(*this, l, row);
          world.each(row.segment[0].count + row.segment[1].count, [&](int i) {
            R& to = u[place_of(row, i, shifts)];
            to = fma(G[b][c], rows.Y(row.first_entry + i), to);
          });
          world.sync();
        }
        add_to_factor(world, L, u, nv);
      }
    }
    world.sync();
  }
  /// L L^T <- L L^T + u u^T. Overwrites u.
  template <class World>
  KOKKOS_INLINE_FUNCTION void add_to_factor(World const& world, R* L, R* u, int nv) const {
    for (int k = 0; k < nv; ++k) {
      R const x = u[k];
      if (x == R(0)) continue;
      R* const column = column_of(L, nv, k);
      R const before = column[k], after = sqrt(fma(x, x, before * before)), cosine = before / after, sine = x / after;
      world.sync();
      world.each(nv - k, [&](int i) {
        R const own = column[k + i], other = u[k + i];
        column[k + i] = i == 0 ? after : fma(cosine, own, sine * other);
        u[k + i] = i == 0 ? R(0) : fma(cosine, other, -sine * own);
      });
      world.sync();
    }
  }
  /// d <- (L L^T)^-1 d. Returns d . (L L^T)^-1 d.
  template <class World>
  KOKKOS_FUNCTION R solve_factored(World const& world, R const* H, int nv, R* d) const {
    for (int k = 0; k < nv; ++k) {
      R const* const column = column_of(H, nv, k);
      R const x = d[k] / column[k];
      world.sync();
      world.each(nv - k, [&](int i) { d[k + i] = i == 0 ? x : fma(-column[k + i], x, d[k + i]); });
      world.sync();
    }
    R const decrement = world.template sum<R>(nv, [&](int i) { return d[i] * d[i]; });
    for (int k = nv - 1; k >= 0; --k) {
      R const* const column = column_of(H, nv, k);
      R const sum = world.template sum<R>(nv - 1 - k, [&](int i) { return column[k + 1 + i] * d[k + 1 + i]; });
      R const x = (d[k] - sum) / column[k];
      world.sync();
      world.single([&] { d[k] = x; });
      world.sync();
    }
    return decrement;
  }
  /// Column k of the lower triangle, so that its entries are [k] ... [nv - 1].
  template <class Number>
  KOKKOS_INLINE_FUNCTION static Number* column_of(Number* H, int nv, int k) {
    return H + std::int64_t(k) * nv - std::int64_t(k) * (k + 1) / 2;
  }
};

/// On hosts the work belongs to a thread.
template <class Exec, class R, class Mem>
struct NewtonThread {
  NewtonWorld<R, Mem> solver;
  ThreadRoom<Exec> room;
  void operator()(int w) const {
    room([&](int thread) {
      R* const near = solver.work.data() + thread * solver.stride;
      solver.solve(SerialWorld{w}, near + newton_near_numbers, near);
    });
  }
};

/// GPUs: all islands.
template <class Exec, class R, class Mem>
void launch_newton(Exec const& exec, NewtonWorld<R, Mem> solver);

}  // namespace gsp::detail

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/solver/detail/newton_island_cuda.hpp>
#endif
