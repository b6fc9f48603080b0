#pragma once
#include <gsp/constraint/constraint_type.hpp>
#include <gsp/core/status.hpp>
#include <gsp/parallel/for_worlds.hpp>

/// All constraint types to one list of rows a world: count -> scan -> emit, in the order of the types, then of the elements. Nothing waits
/// for the host.
namespace gsp {

namespace detail {

/// The types one after the other, as a list that kernels can walk.
template <class... C>
struct TypeList {
  KOKKOS_INLINE_FUNCTION int count(int) const { return 0; }
  KOKKOS_INLINE_FUNCTION std::uint32_t status(int) const { return 0; }
  template <class F>
  KOKKOS_INLINE_FUNCTION void visit(int, int, int, F const&) const {}
};
template <class Head, class... Tail>
struct TypeList<Head, Tail...> {
  Head head;
  TypeList<Tail...> tail;
  TypeList(Head const& h, Tail const&... t) : head(h), tail(t...) {}
  KOKKOS_INLINE_FUNCTION int count(int world) const { return int(head.count(world)) + tail.count(world); }
  /// Status bits of a world whose elements are incomplete (a pool that was too small): it is not stepped.
  KOKKOS_INLINE_FUNCTION std::uint32_t status(int world) const {
    if constexpr (requires { head.status(world); })
      return head.status(world) | tail.status(world);
    else
      return tail.status(world);
  }
  /// f(type, number of the type, element of the type) for element `e` of the world
  template <class F>
  KOKKOS_INLINE_FUNCTION void visit(int world, int e, int number, F const& f) const {
    int const n = int(head.count(world));
    if (e < n)
      f(head, number, e);
    else
      tail.visit(world, e - n, number + 1, f);
  }
};

KOKKOS_INLINE_FUNCTION std::int64_t pack_sizes(int rows, int entries) { return (std::int64_t(rows) << 40) + entries; }
KOKKOS_INLINE_FUNCTION int rows_of(std::int64_t sizes) { return int(sizes >> 40); }
KOKKOS_INLINE_FUNCTION std::int64_t entries_of(std::int64_t sizes) { return sizes & ((std::int64_t(1) << 40) - 1); }
KOKKOS_INLINE_FUNCTION std::uint64_t row_key(int type, RowId id) {
  return (std::uint64_t(type) << 59) | (std::uint64_t(id.major) << 32) | id.minor;
}

template <class R, class Mem, class Types>
struct CountRows {
  Model<R, Mem> model;
  State<R, Mem> state;
  Rows<R, Mem> rows;
  Types types;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank;
    std::uint32_t const status = types.status(w);
    world.once(
        [&] { state.status(w) = (state.status(w) & ~(status::contact_overflow | status::row_overflow | status::row_refused)) | status; });
    world.sync();
    std::int64_t sizes = world.template sum<std::int64_t>(types.count(w), [&](int e) {
      std::int64_t own = 0;
      types.visit(w, e, 0, [&](auto const& type, int, int k) {
        for (int r = 0, n = type.rows(w, k); r < n; ++r) {
          RowStructure<R, Mem> structure{model};
          type.jacobian(w, k, r, structure);
          if (structure.refused) Kokkos::atomic_or(&state.status(w), std::uint32_t(status::row_refused));
          own += pack_sizes(1, structure.entries());
        }
      });
      return own;
    });
    world.sync();
    if (state.status(w) & status::row_refused) sizes = 0;
    world.once([&] {
      if (status) rows.halt() = 1;  // whoever finds it writes the same
      rows.count(w) = rows_of(sizes), rows.entries(w) = entries_of(sizes);
    });
  }
};

struct RowSizes {
  std::int64_t rows = 0, entries = 0;
  KOKKOS_INLINE_FUNCTION RowSizes& operator+=(RowSizes const& o) {
    rows += o.rows, entries += o.entries;
    return *this;
  }
};
template <class R, class Mem>
struct ScanRows {
  using value_type = RowSizes;
  Rows<R, Mem> rows;
  State<R, Mem> state;
  KOKKOS_FUNCTION void operator()(int w, value_type& sum, bool last) const {
    int const count = rows.count(w);
    std::int64_t const entries = rows.entries(w);
    if (last) {
      rows.first(w) = int(sum.rows), rows.first_entry(w) = sum.entries;
      if (sum.rows + count > rows.capacity() || sum.entries + entries > std::int64_t(rows.Y.extent(0)))
        state.status(w) |= status::row_overflow;
      if (w == rows.worlds - 1) {
        rows.demand(0) = sum.rows + count, rows.demand(1) = sum.entries + entries;
        if (rows.demand(0) > rows.capacity() || rows.demand(1) > std::int64_t(rows.Y.extent(0))) rows.halt() = 1;
        if (rows.solved()) rows.parity() ^= 1, rows.solved() = 0;
      }
    }
    sum.rows += count, sum.entries += entries;
  }
};

/// y <- y L^-1 D^-1/2 on one segment: from the leaves, each entry leaves its share to its ancestors.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION void whiten(Model<R, Mem> const& model, TreeItems<R> const& s, RowSegment const& segment, R* y) {
  Archetype const& a = model.archetypes(model.tree_archetype(segment.tree));
  int const* const ints = model.ints.data();
  for (int i = segment.count - 1; i >= 0; --i) {
    int const dof = segment.list < 0 ? i : ints[segment.list + i], adr = ints[a.row_adr + dof], n = ints[a.row_adr + dof + 1] - adr;
    R const value = y[i];
    for (int p = 0; p < n - 1; ++p) {
      int const at = segment.list < 0 ? ints[a.row_col + adr + p] : p;  // in a chain the ancestors are the entries before
      y[at] = fma(-s[s.at.factor + adr + p], value, y[at]);
    }
    y[i] = value * sqrt(s[s.at.inverse_diagonal + dof]);
  }
}

template <class R, class Mem, class Types>
struct EmitRows {
  Model<R, Mem> model;
  State<R, Mem> state;
  Dynamics<R, Mem> dynamics;
  Rows<R, Mem> rows;
  Types types;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank;
    if (rows.halt()) return;
    int const now = rows.parity();
    world.once([&] { rows.first_of[now](w) = rows.first(w), rows.count_of[now](w) = rows.count(w); });
    if (state.status(w) & status::row_refused) return;
    world.template scan<std::int64_t>(types.count(w), [&](int e, std::int64_t& sum, bool last) {
      types.visit(w, e, 0, [&](auto const& type, int number, int k) {
        int const n = type.rows(w, k);
        std::int64_t sizes = sum;
        int const element = rows.first(w) + rows_of(sizes);
        for (int r = 0; r < n; ++r) {
          RowStructure<R, Mem> structure{model};
          type.jacobian(w, k, r, structure);
          if (last) emit(type, number, w, k, r, element, rows.first_entry(w) + entries_of(sizes), structure);
          sizes += pack_sizes(1, structure.entries());
        }
        sum = sizes;
      });
    });
  }

 private:
  template <class Type>
  KOKKOS_INLINE_FUNCTION void emit(Type const& type, int number, int w, int k, int r, int element, std::int64_t entry,
                                   RowStructure<R, Mem> const& structure) const {
    Row<R> row;
    row.segments = structure.segments, row.Y = entry;
    for (int s = 0; s < structure.segments; ++s) row.segment[s] = structure.segment(s);
    R* const y = rows.Y.data() + entry;
    for (int i = 0, n = structure.entries(); i < n; ++i) y[i] = R(0);
    R const gap = R(type.jacobian(w, k, r, RowWriter<R, Mem>{model, dynamics, row, y, w}));
    R rate(0), free_rate(0), diagonal(0);
    R* part = y;
    for (int s = 0; s < row.segments; ++s) {
      auto const& segment = row.segment[s];
      TreeItems<R> const items = dynamics.tree(model, w, segment.tree);
      for (int i = 0; i < segment.count; ++i) {
        int const dof = segment.list < 0 ? i : model.ints(segment.list + i);
        rate = fma(part[i], items[items.at.qvel + dof], rate);
        free_rate = fma(part[i], items[items.at.velocity + dof], free_rate);
      }
      whiten(model, items, segment, part);
      for (int i = 0; i < segment.count; ++i) diagonal = fma(part[i], part[i], diagonal);
      part += segment.count;
    }
    auto const bounds = type.bounds(w, k, r);
    RowLaw<R> const law = row_law(type, w, k, r, gap, rate, model.timestep);
    row.bias = free_rate - law.zeta, row.compliance = law.compliance;
    row.inverse_diagonal = diagonal > R(0) ? R(1) / (diagonal + law.compliance) : R(0);
    row.friction_of = bounds.friction_of < 0 ? -1 : element - rows.first(w) + bounds.friction_of;
    row.lower = R(bounds.lower), row.upper = bounds.friction_of < 0 ? R(bounds.upper) : R(bounds.mu);
    int const at = element + r, now = rows.parity();
    std::uint64_t const key = row_key(number, type.id(w, k));
    rows.row(at) = row, rows.id[now](at) = key;
    rows.impulse[now](at) = state.steps(w) > 0 ? last_impulse(w, key, r) : R(0);
  }
  /// The r-th impulse of the element with this key in the last step; 0 where there was none. Ids are sorted but for the minor part.
  KOKKOS_INLINE_FUNCTION R last_impulse(int w, std::uint64_t key, int r) const {
    int const before = 1 - rows.parity(), first = rows.first_of[before](w), end = first + rows.count_of[before](w);
    std::uint64_t const major = key >> 32;
    int lo = first, hi = end;
    while (lo < hi) {
      int const mid = (lo + hi) / 2;
      if ((rows.id[before](mid) >> 32) < major)
        lo = mid + 1;
      else
        hi = mid;
    }
    for (; lo < end && (rows.id[before](lo) >> 32) == major; ++lo)
      if (rows.id[before](lo) == key) {
        if (lo + r >= end || rows.id[before](lo + r) != key) return R(0);
        R const p = rows.impulse[before](lo + r);
        return p - p == R(0) ? p : R(0);
      }
    return R(0);
  }
};

}  // namespace detail

/// Fills `rows` with the active rows of all `types`, in that order, whitened with the factored matrix, with last step's impulses as a
/// start. After factor or smooth_dynamics (and collide). A world whose rows do not fit has status::row_overflow; then no world is stepped
/// (rows.halt), the pools grow at the host's next `grow`, and the step is repeated: no result depends on a capacity. Rows of more than two
/// trees: status::row_refused. Cost about (entries of the row)^2 flop a row. Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem, class... Types>
void assemble(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics,
              Rows<R, Mem> const& rows, Types const&... types) {
  static_assert((ConstraintType<Types> && ...),
                "gsp::assemble: an argument is not a constraint type (constraint_type.hpp says what one is)");
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::assemble: the rows are not accessible from this execution space");
  static_assert(sizeof...(Types) <= 32, "gsp::assemble: at most 32 constraint types");
  expects(rows.worlds == state.worlds && dynamics.worlds == state.worlds,
          "gsp::assemble: state, dynamics and rows have different numbers of worlds");
  detail::expects_fit("gsp::assemble", model, state, dynamics);
  detail::expects_of("gsp::assemble", dynamics, state,
                     detail::set_of(Quantity::motion, Quantity::velocity, Quantity::factor, Quantity::free_velocity));
  using List = detail::TypeList<Types...>;
  List const list(types...);
  for_worlds("gsp::constraint::count_rows", exec, rows.worlds, detail::CountRows<R, Mem, List>{model, state, rows, list});
  Kokkos::parallel_scan("gsp::constraint::scan_rows", light(Kokkos::RangePolicy<Exec>(exec, 0, rows.worlds)),
                        detail::ScanRows<R, Mem>{rows, state});
  for_worlds("gsp::constraint::emit_rows", exec, rows.worlds, detail::EmitRows<R, Mem, List>{model, state, dynamics, rows, list});
}

}  // namespace gsp
