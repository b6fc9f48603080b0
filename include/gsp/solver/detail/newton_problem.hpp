#pragma once
#include <Kokkos_Core.hpp>
#include <gsp/constraint/impulses.hpp>
#include <gsp/constraint/islands.hpp>
#include <gsp/constraint/progress.hpp>
#include <gsp/solver/soft_element.hpp>
#include <gsp/solver/solution.hpp>

/// What `newton` solves (solver/newton.hpp): the rows of an island, however they are kept.
namespace gsp::detail {

inline constexpr double least_compliance = 1e-15;  // of a row that nothing can move
// A row is rigid where |Y|^2 / C is more than 1e5, which leaves float two digits beside the 1 of H; and its leverage is rounding where
// |Y|^2 is the square of so many epsilon beside what others have.
inline constexpr double rigid_softness = 1e-5;
inline constexpr double newton_rounding = 32;

// Of a pivot below this times epsilon of the diagonal that it was rounding is a sixteenth and more: L is found row by row then.
inline constexpr double newton_pivot = 16;

template <class R, class Mem>
struct NewtonProblem {
  static constexpr int N = most_element_rows;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Solution<R, Mem> solution;
  Progress<Mem> progress;
  View<R*> rate, rate_change, least, work;
  View<int*> by_tree;               // GPUs: two of each row of the pool (newton_sparse.hpp)
  std::int64_t stride, near_bytes;  // numbers of a thread's or block's work; what an island may take of near memory (newton_island.hpp)
  int iterations;
  R tolerance;
  bool warm, residual, ends_step;

  struct Lists {
    Row<R> const* row;  // of the world, and so on
    signed char const* element_rows;
    R* least;
    int first;
    IslandRows island;
    int const* shift;  // of a tree: place in the island's H less dof (Islands::shift); null: the same
  };
  /// Of the dofs of a row's two segments. Two numbers: an array that is indexed is memory to a GPU.
  struct Shifts {
    int first, second;
    KOKKOS_INLINE_FUNCTION Shifts(NewtonProblem const& k, Lists const& l, Row<R> const& row) {
      auto const of = [&](RowSegment const& s) { return l.shift && s.count > 0 ? l.shift[k.rows.islands.dof_tree(s.dof0)] : 0; };
      first = of(row.segment[0]);
      second = of(row.segment[1]);
    }
  };
  KOKKOS_INLINE_FUNCTION Lists lists_of(int w, IslandRows const& island) const {
    int const first = rows.first(w);
    return {&rows.row(first),
            &rows.element_rows(first),
            least.data() + first,
            first,
            island,
            island.list ? &rows.islands.shift(w, 0) : nullptr};
  }

  /// The least compliance of a row. @param sum, own  over the dofs that it moves, of the largest Y^2 that any row has there, and of its
  /// own: where its Y is 0 (a tree that others are tied to by a tendon, a branch that it does not move) a dof has no say
  KOKKOS_INLINE_FUNCTION static R least_of(R compliance, R sum, R own) {
    bool const is_soft =
        compliance >= R(rigid_softness) * own && own > square(R(newton_rounding) * Kokkos::Experimental::epsilon_v<R>) * sum;
    return max(is_soft ? R(0) : least_softness<R> * sum, R(least_compliance));
  }
  /// Whether some row of an island is friction in a cone.
  template <class World>
  KOKKOS_INLINE_FUNCTION bool has_cones(World const& world, Lists const& l) const {
    auto const rubs = [&](int i) {
      Row<R> const& row = l.row[l.island.row(i)];
      return row.friction_of >= 0 && row.mu > R(0);
    };
    if constexpr (std::is_same_v<World, SerialWorld>) {
      for (int i = 0; i < l.island.count; ++i)
        if (rubs(i)) return true;
      return false;
    } else {
      return world.template sum<int>(l.island.count, [&](int i) { return rubs(i) ? 1 : 0; }) > 0;
    }
  }

  /// Column c of G of B = G G^T, in place, from the columns before it and the lower triangle of B. False: it is zero, but for rounding.
  KOKKOS_INLINE_FUNCTION static bool next_column(R (&B)[N][N], int n, int c) {
    R pivot = B[c][c];
    for (int k = 0; k < c; ++k) pivot = fma(-B[c][k], B[c][k], pivot);
    bool const some = pivot > R(newton_pivot) * Kokkos::Experimental::epsilon_v<R> * B[c][c];
    R const root = some ? sqrt(pivot) : R(0);
    for (int b = c; b < n; ++b) {
      R x = B[b][c];
      for (int k = 0; k < c; ++k) x = fma(-B[b][k], B[c][k], x);
      B[b][c] = some ? b == c ? root : x / root : R(0);
    }
    return some;
  }
  KOKKOS_INLINE_FUNCTION int dof_of(Row<R> const& row, int i) const {
    int const s = i < row.segment[0].count ? 0 : 1;
    RowSegment const& segment = row.segment[s];
    int const at = s == 0 ? i : i - row.segment[0].count;
    return segment.dof0 + (segment.list < 0 ? at : rows.dof_lists(segment.list + at));
  }
  /// Where that is in H.
  KOKKOS_INLINE_FUNCTION int place_of(Row<R> const& row, int i, Shifts const& shifts) const {
    return dof_of(row, i) + (i < row.segment[0].count ? shifts.first : shifts.second);
  }
};

}  // namespace gsp::detail
