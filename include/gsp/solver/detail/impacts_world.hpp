#pragma once
#include <gsp/constraint/impulses.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/solver/detail/row_vectors.hpp>
#include <gsp/solver/solution.hpp>

/// The kernel of `impacts` (solver/impacts.hpp, where the equations stand): a thread or a warp a world, island by island.
namespace gsp::detail {

template <class R, class Mem>
struct ImpactsWorld {
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Solution<R, Mem> solution;
  Kokkos::View<int, Mem> halt;
  int rounds, sweeps;
  R tolerance;

  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank;
    if (halt()) return;
    int const first = rows.first(w);
    if (world.template sum<int>(rows.count(w), [&](int r) { return int(strikes(w, first + r)); }) == 0) return;
    each_island(world, rows, w, [&](IslandRows const& e) { reflect(world, e); });
  }

 private:
  KOKKOS_INLINE_FUNCTION bool bounces(int at) const { return rows.impact(at).restitution > R(0) && rows.row(at).inverse_diagonal > R(0); }
  KOKKOS_INLINE_FUNCTION bool strikes(int w, int at) const {
    return bounces(at) && rows.impact(at).rate < -rows.rate_scale(w) && rows.row(at).bias < R(0);
  }
  /// All rounds of an island.
  template <class World>
  KOKKOS_INLINE_FUNCTION void reflect(World const& world, IslandRows const& e) const {
    int const w = world.rank;
    std::int64_t const first = rows.first(w), dof = std::int64_t(w) * rows.nv;
    Row<R>* const row = rows.row.data() + first;
    RowImpact<R>* const impact = rows.impact.data() + first;
    auto const bounces = [&](int r) { return this->bounces(int(first) + r); };
    if (world.template sum<int>(e.count, [&](int k) { return int(strikes(w, int(first) + e.row(k))); }) == 0) return;
    world.each(e.count, [&](int k) {
      int const r = e.row(k);
      impact[r].forces = R(0.5) * (row[r].bias + impact[r].target - impact[r].rate);
    });
    world.sync();
    auto const joins = [&](int r) {  // rates of rows without bounds stay as they are
      return RowBounds<R>{row[r].lower, row[r].upper, row[r].friction_of}.is_free() && !row[r].eliminated && row[r].inverse_diagonal > R(0);
    };
    Problem const q{e,
                    row,
                    impact,
                    impulses.before.data() + first,
                    solution.z.data() + dof,
                    solution.z_before.data() + dof,
                    rows.islands.keys.data() + first,
                    world.template sum<int>(e.count, [&](int k) { return int(joins(e.row(k))); }) > 0,
                    rows.rate_scale(w)};
    int const with = world.template sum<int>(e.count, [&](int k) { return int(bounces(e.row(k))); });
    int const most = rounds > 0 ? rounds : 50 + 2 * with;
    for (int round = 0; round < most; ++round) {
      int const chosen = choose(world, q, bounces, joins);
      if (chosen == 0) break;
      bool const solved = compress(world, q, chosen);
      give_back(world, q, chosen, solved);
    }
    R* const p = impulses.p[impulses.parity()].data() + first;
    world.each(e.count, [&](int k) {
      int const r = e.row(k);
      if (bounces(r)) p[r] = max(p[r], row[r].lower);
    });
  }
  struct Problem {
    IslandRows island;
    Row<R>* row;  // of the world, and so on
    RowImpact<R>* impact;
    R* p;         // of a round
    R* z;         // Y^T p
    R* greatest;  // restitution of the rows that approach, at the first dof of each tree
    int* list;    // rows of a round
    bool joined;  // there are rows without bounds: trees are not alone, and all rows have the greatest of all, at the first dof
    R rest;
    KOKKOS_INLINE_FUNCTION R middle(int r) const { return impact[r].rate + impact[r].forces; }
    KOKKOS_INLINE_FUNCTION bool approaches(int r) const {
      return impact[r].rate < -rest && impact[r].rate + R(2) * impact[r].forces < impact[r].target;
    }
    /// f(greatest) of what row r shares with others.
    template <class F>
    KOKKOS_INLINE_FUNCTION void each_tree(int r, F const& f) const {
      if (joined) return f(greatest[island.dof(0)]);
      for (int s = 0; s < 2; ++s)
        if (row[r].segment[s].count > 0) f(greatest[row[r].segment[s].dof0]);
    }
  };
  /// The rows of a round, in their order, to q.list: those that approach, unless another on one of their trees has a greater restitution,
  /// and those without bounds. Their number; 0 where nothing approaches.
  template <class World, class Bounces, class Joins>
  KOKKOS_INLINE_FUNCTION int choose(World const& world, Problem const& q, Bounces const& bounces, Joins const& joins) const {
    auto const hits = [&](int r) { return bounces(r) && q.approaches(r); };
    auto const each_hit = [&](auto const& f) {
      world.each(q.island.count, [&](int k) {
        int const r = q.island.row(k);
        if (hits(r)) q.each_tree(r, [&](R& greatest) { f(greatest, q.impact[r].restitution); });
      });
      world.sync();
    };
    each_hit([](R& greatest, R) { greatest = R(0); });
    each_hit([](R& greatest, R e) { Kokkos::atomic_max(&greatest, e); });
    auto const leads = [&](int r) {
      bool first = hits(r);
      if (first) q.each_tree(r, [&](R const& greatest) { first = first && !(greatest > q.impact[r].restitution); });
      return first;
    };
    int const count = q.island.count, hit = world.template sum<int>(count, [&](int k) { return int(leads(q.island.row(k))); });
    if (hit == 0) return 0;
    auto const chosen = [&](int k) { return int(leads(q.island.row(k)) || joins(q.island.row(k))); };
    world.template scan<int>(count, chosen, [&](int k, int at) {
      if (chosen(k)) q.list[at] = q.island.row(k);
    });
    world.sync();
    return world.template sum<int>(count, chosen);
  }
  /// q.p: what brings the rows of the list to no approach. Whether sweeps have come to rest.
  template <class World>
  KOKKOS_INLINE_FUNCTION bool compress(World const& world, Problem const& q, int chosen) const {
    world.each(q.island.dofs, [&](int i) { q.z[q.island.dof(i)] = R(0); });
    world.each(chosen, [&](int k) { q.p[q.list[k]] = R(0); });
    world.sync();
    R const share = max(tolerance, R(16) * Kokkos::Experimental::epsilon_v<R>);
    R fastest(0);
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      R change(0);
      for (int k = 0; k < chosen; ++k) {
        int const r = q.list[k];
        Row<R> const& row = q.row[r];
        bool const hit = q.impact[r].restitution > R(0);
        R const before = q.p[r];
        R const rate = dot_row(world, rows, row, q.z) + (hit ? q.middle(r) : row.compliance * before);
        R const next = before - rate * row.inverse_diagonal, p = hit ? clamp(next, R(0), row.upper) : next;
        fastest = max(fastest, hit && sweep == 0 ? -q.middle(r) : R(0));
        world.sync();  // all have read p and z
        if (p == before) continue;
        world.single([&] { q.p[r] = p; });
        push_row(world, rows, row, q.z, p - before);
        world.sync();
        change = max(change, abs(p - before) / row.inverse_diagonal);
      }
      if (change <= share * fastest) return true;
    }
    return false;
  }
  /// Each row its share more, to rates and to `lower`.
  template <class World>
  KOKKOS_INLINE_FUNCTION void give_back(World const& world, Problem const& q, int chosen, bool solved) const {
    R part(1);
    if (!solved) {  // no more than where the energy along p is least, u.p + p.A p = 0: energy does not grow whatever sweeps have left
      R const up = world.template sum<R>(chosen, [&](int k) {
        int const r = q.list[k];
        return q.impact[r].restitution > R(0) ? q.p[r] * q.middle(r) : R(0);
      });
      R const pAp = world.template sum<R>(q.island.dofs, [&](int i) { return square(q.z[q.island.dof(i)]); }) +
                    world.template sum<R>(chosen, [&](int k) {
                      int const r = q.list[k];
                      return q.impact[r].restitution > R(0) ? R(0) : q.row[r].compliance * square(q.p[r]);
                    });
      part = pAp > R(0) ? clamp(-up / pAp, R(0), R(1)) : R(0);
    }
    world.sync();
    world.each(chosen, [&](int k) {
      int const r = q.list[k];
      R const e = q.impact[r].restitution;
      q.p[r] *= part * (R(1) + (e > R(0) ? e : q.greatest[q.island.dof(0)]));
      if (e > R(0)) {
        q.row[r].lower += q.p[r];
        q.row[r].upper += q.p[r];
      }
    });
    world.each(q.island.dofs, [&](int i) { q.z[q.island.dof(i)] = R(0); });
    for (int k = 0; k < chosen; ++k) {
      world.sync();
      push_row(world, rows, q.row[q.list[k]], q.z, q.p[q.list[k]]);
    }
    world.sync();
    world.each(q.island.count, [&](int k) {
      int const r = q.island.row(k);
      if (q.impact[r].restitution > R(0)) q.impact[r].rate += dot_row(SerialWorld{0}, rows, q.row[r], q.z);
    });
    world.sync();
  }
};

}  // namespace gsp::detail
