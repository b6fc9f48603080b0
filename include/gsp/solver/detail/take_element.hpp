#pragma once
#include <gsp/solver/detail/row_vectors.hpp>
#include <gsp/solver/project_element.hpp>

namespace gsp::detail {

/// Laws of an element of n rows (M = n, or the most that an element may have), its impulses, and the rates w = Y z + C p + b of its rows.
template <int M, class World, class R, class Mem>
KOKKOS_INLINE_FUNCTION void take_element(World const& world, Rows<R, Mem> const& rows, Row<R> const* row, int n, R const* z, R const* p,
                                         ElementLaw<R, M>& law, R (&rate)[M], R (&now)[M]) {
  unrolled<M>([&](auto b) {
    if (M < most_element_rows || b < n) {
      set_law(law, b, row[b]);
      now[b] = p[b];
      rate[b] = fma(row[b].compliance, now[b], row[b].bias) + dot_row(world, rows, row[b], z);
    } else {
      clear_law(law, b);
      now[b] = rate[b] = R(0);
    }
  });
}

}  // namespace gsp::detail
