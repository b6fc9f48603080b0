#pragma once
#include <gsp/constraint/detail/emit_rows.hpp>

/// A kernel of `assemble` where islands sleep: they have no rows, but behind those of their world (Rows::kept) stand who their elements are
/// and the impulses that they fell asleep with.
namespace gsp::detail {

template <class R, class Mem, class Types>
struct KeepRows {
  EmitRows<R, Mem, Types> emit;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    auto const& rows = emit.rows;
    auto const& types = emit.types;
    int const w = world.rank;
    if (emit.halt() || rows.kept(w) == 0 || (emit.state.status(w) & status::row_refused)) return;
    auto const kept = [&](auto const& type, int k) {  // rows of an element
      int const n = element_of(type, w, k).rows();
      return n > 0 && lies_still(emit.model, emit.sleeping, type, w, k) ? n : 0;
    };
    int n = 0;
    world.template scan<int>(
        types.count(w),
        [&](int e) {
          types.visit(w, e, 0, [&](auto const& type, int, int k) { n = kept(type, k); });
          return n;
        },
        [&](int e, int before) {
          if (n == 0) return;
          types.visit(w, e, 0, [&](auto const& type, int place, int k) { keep(type, k, place, w, n, rows.count(w) + before); });
        });
  }

 private:
  /// @param at  its first row, counted from the world's
  template <class Type>
  KOKKOS_INLINE_FUNCTION void keep(Type const& type, int k, int place, int w, int n, int at) const {
    auto const& rows = emit.rows;
    auto const& impulses = emit.impulses;
    int const now = impulses.parity(), first = rows.first(w) + at;
    RowId const id = type.id(w, k);
    R start[most_element_rows];
    for (int r = 0; r < n; ++r) start[r] = R(0);
    StartImpulses<R, Mem> const starts{impulses, emit.names};
    starts.find(type, k, place, id, w, at, n, start);
    for (int r = 0; r < n; ++r) {
      Row<R>& row = rows.row(first + r);
      row.type = static_cast<unsigned char>(place);
      row.element = k;
      rows.element_rows(first + r) = static_cast<signed char>(r == 0 ? n : 0);
      impulses.id[now](first + r) = row_key(place, id);
      impulses.p[now](first + r) = start[r];
    }
    starts.mark_place(type, w, k, n, first);
  }
};

}  // namespace gsp::detail
