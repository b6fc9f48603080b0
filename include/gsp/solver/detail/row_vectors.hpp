#pragma once
#include <gsp/constraint/rows.hpp>

/// Products of sparse rows and whitened vectors (nv) of one world, whose threads share the entries of a row.
namespace gsp::detail {

template <class R, class Mem>
KOKKOS_INLINE_FUNCTION int const* list_of(Rows<R, Mem> const& rows, RowSegment const& s) {
  return s.list < 0 ? nullptr : rows.dof_lists.data() + s.list;
}
/// Y z of one row.
template <class World, class R, class Mem>
KOKKOS_INLINE_FUNCTION R dot_row(World const& world, Rows<R, Mem> const& rows, Row<R> const& row, R const* z) {
  R const* y = rows.Y.data() + row.first_entry;
  R total(0);
  for (int s = 0; s < 2 && row.segment[s].count > 0; ++s) {
    auto const& segment = row.segment[s];
    int const* const list = list_of(rows, segment);
    R const* const part = z + segment.dof0;
    total += world.template sum<R>(segment.count, [&](int i) { return y[i] * part[list ? list[i] : i]; });
    y += segment.count;
  }
  return total;
}
/// z += Y^T d of one row. Other threads see it after a sync.
template <class World, class R, class Mem>
KOKKOS_INLINE_FUNCTION void push_row(World const& world, Rows<R, Mem> const& rows, Row<R> const& row, R* z, R d) {
  R const* y = rows.Y.data() + row.first_entry;
  for (int s = 0; s < 2 && row.segment[s].count > 0; ++s) {
    auto const& segment = row.segment[s];
    int const* const list = list_of(rows, segment);
    R* const part = z + segment.dof0;
    world.each(segment.count, [&](int i) { part[list ? list[i] : i] = fma(y[i], d, part[list ? list[i] : i]); });
    y += segment.count;
  }
}
/// z += Y^T p of `count` rows from `first` on, p by row of the world.
template <class World, class R, class Mem>
KOKKOS_INLINE_FUNCTION void push_rows(World const& world, Rows<R, Mem> const& rows, int first, int count, R* z, R const* p) {
  for (int r = 0; r < count; ++r) {
    world.sync();
    if (p[r] != R(0)) push_row(world, rows, rows.row(first + r), z, p[r]);
  }
  world.sync();
}

}  // namespace gsp::detail
