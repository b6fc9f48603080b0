#pragma once
#include <gsp/constraint/constraint_type.hpp>
#include <gsp/constraint/detail/couple_rows.hpp>
#include <gsp/constraint/detail/row_structure.hpp>
#include <gsp/constraint/impulses.hpp>
#include <gsp/core/status.hpp>
#include <gsp/parallel/for_worlds.hpp>

/// The kernels of `assemble`: count -> scan -> emit, in the order of the types, then of the elements.
namespace gsp::detail {

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
  Kokkos::View<int, Mem> halt;
  Types types;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank;
    std::uint32_t const status = types.status(w);
    world.single([&] {
      state.status(w) = (state.status(w) & ~(status::contact_overflow | status::row_overflow | status::row_refused)) | status;
      rows.largest_element(w) = 3;  // what contacts have
      Vec3<R> const gravity{model.gravity(w, 0), model.gravity(w, 1), model.gravity(w, 2)};
      R const g = norm(gravity);
      rows.rate_scale(w) = model.timestep * (g > R(0) ? g : R(9.81));
    });
    world.sync();
    std::int64_t sizes = world.template sum<std::int64_t>(types.count(w), [&](int e) {
      std::int64_t own = 0;
      types.visit(w, e, 0, [&](auto const& type, int, int k) {
        int const n = type.rows(w, k);
        bool refused = n > most_element_rows;
        for (int r = 0; r < n && !refused; ++r) {
          RowStructure<R, Mem> structure{model};
          type.jacobian(w, k, r, structure);
          auto const bounds = type.bounds(w, k, r);
          refused = structure.refused || bounds.friction_of >= n || bounds.friction_of == r;
          if (!refused && bounds.friction_of >= 0 && model.profile == Profile::mujoco) {  // newton's cones: normals that push alone
            auto const normal = type.bounds(w, k, bounds.friction_of);
            refused = normal.friction_of >= 0 || !(normal.lower == 0 && normal.upper >= 1e30);
          }
          if (bounds.with_next) {
            bool const there = r + 1 < n && bounds.friction_of >= 0 && bounds.friction_of != r + 1;
            auto const next = type.bounds(w, k, there ? r + 1 : r);
            refused = refused || !there || next.with_next || next.friction_of != bounds.friction_of;
          }
          own += pack_sizes(1, structure.entries());
        }
        own += couplings_of(n);
        if (n > 3) Kokkos::atomic_max(&rows.largest_element(w), n);
        if (refused) Kokkos::atomic_or(&state.status(w), std::uint32_t(status::row_refused));
      });
      return own;
    });
    world.sync();
    if (state.status(w) & status::row_refused) sizes = 0;
    sizes += std::int64_t(rows.most_eliminated) * rows_of(sizes);
    world.single([&] {
      if (status) halt() = 1;  // the same from every world that finds it
      rows.count(w) = rows_of(sizes);
      rows.entries(w) = entries_of(sizes);
    });
  }
};

struct RowSizes {
  std::int64_t rows = 0, entries = 0;
  KOKKOS_INLINE_FUNCTION RowSizes& operator+=(RowSizes const& o) {
    rows += o.rows;
    entries += o.entries;
    return *this;
  }
};
template <class R, class Mem>
struct ScanRows {
  using value_type = RowSizes;
  Rows<R, Mem> rows;
  State<R, Mem> state;
  Kokkos::View<int, Mem> halt, parity, solved;
  int capacity;
  KOKKOS_FUNCTION void operator()(int w, value_type& sum, bool last) const {
    int const count = rows.count(w);
    std::int64_t const entries = rows.entries(w), room = std::int64_t(rows.Y.extent(0));
    if (last) {
      rows.first(w) = int(sum.rows);
      rows.first_entry(w) = sum.entries;
      if (sum.rows + count > capacity || sum.entries + entries > room) state.status(w) |= status::row_overflow;
      if (w == rows.worlds - 1) {
        // What did not fit is remembered until the pools have grown: a step of several evaluations may need less in the next one.
        std::int64_t const most_rows = sum.rows + count, most_entries = sum.entries + entries;
        if (!(rows.demand(0) > capacity) || most_rows > rows.demand(0)) rows.demand(0) = most_rows;
        if (!(rows.demand(1) > room) || most_entries > rows.demand(1)) rows.demand(1) = most_entries;
        if (most_rows > capacity || most_entries > room) halt() = 1;
        if (solved()) {
          parity() ^= 1;
          solved() = 0;
        }
      }
    }
    sum.rows += count;
    sum.entries += entries;
  }
};

/// y <- y L^-1 D^-1/2 on one segment, of tree `tree`: from the leaves, each entry leaves its share to its ancestors.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION void whiten(Model<R, Mem> const& model, TreeItems<R> const& s, int tree, RowSegment const& segment, R* y) {
  Archetype const& a = model.archetypes(model.tree_archetype(tree));
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

/// Names of the types, in the order of the list.
struct TypeNames {
  std::uint32_t name[most_constraint_types] = {};
  int count = 0;
};

template <class R, class Mem, class Types>
struct EmitRows {
  Model<R, Mem> model;
  State<R, Mem> state;
  Dynamics<R, Mem> dynamics;
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Kokkos::View<int, Mem> halt;
  Types types;
  TypeNames names;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank;
    if (halt()) return;
    int const now = impulses.parity();
    world.single([&] {
      impulses.first[now](w) = rows.first(w);
      impulses.count[now](w) = rows.count(w);
    });
    if (w == 0) world.each(most_constraint_types + 1, [&](int t) { impulses.type_names(t, now) = t < names.count ? names.name[t] : 0; });
    if (state.status(w) & status::row_refused) return;
    world.template scan<std::int64_t>(types.count(w), [&](int e, std::int64_t& sum, bool last) {
      types.visit(w, e, 0, [&](auto const& type, int place, int k) {
        int const n = type.rows(w, k), first = rows.first(w) + rows_of(sum);
        std::int64_t const couplings = rows.first_entry(w) + entries_of(sum), first_entry = couplings + couplings_of(n);
        std::int64_t sizes = 0;
        for (int r = 0; r < n; ++r) {
          RowStructure<R, Mem> structure{model};
          type.jacobian(w, k, r, structure);
          if (last) {
            emit(type, w, k, r, rows.row(first + r), first_entry + entries_of(sizes), structure);
            rows.element_rows(first + r) = static_cast<signed char>(r == 0 ? n : 0);
          }
          sizes += pack_sizes(1, structure.entries());
        }
        if (last && n > 0) finish(place, type.id(w, k), w, n, first, couplings);
        sum += sizes + couplings_of(n);
      });
    });
  }

 private:
  /// Row r of element k: whitened entries, law and bounds.
  template <class Type>
  KOKKOS_INLINE_FUNCTION void emit(Type const& type, int w, int k, int r, Row<R>& out, std::int64_t entry,
                                   RowStructure<R, Mem> const& structure) const {
    Row<R> row;
    row.element = k;
    row.with_next = false;
    row.same_segments = false;
    row.eliminated = false;
    row.first_entry = entry;
    for (int s = 0; s < 2; ++s) row.segment[s] = s < structure.segments ? structure.segment(s) : RowSegment{-1, 0, -1};
    R* const y = rows.Y.data() + entry;
    for (int i = 0, n = structure.entries(); i < n; ++i) y[i] = R(0);
    R const gap = R(type.jacobian(w, k, r, RowWriter<R, Mem>{model, dynamics, structure, row, y, w}));
    R rate(0), free_rate(0), diagonal(0);
    R* part = y;
    for (int s = 0; s < structure.segments; ++s) {
      auto const& segment = row.segment[s];
      TreeItems<R> const items = dynamics.tree(model, w, structure.tree[s]);
      for (int i = 0; i < segment.count; ++i) {
        int const dof = segment.list < 0 ? i : model.ints(segment.list + i);
        rate = fma(part[i], items[items.at.qvel + dof], rate);
        free_rate = fma(part[i], items[items.at.velocity + dof], free_rate);
      }
      whiten(model, items, structure.tree[s], segment, part);
      for (int i = 0; i < segment.count; ++i) diagonal = fma(part[i], part[i], diagonal);
      part += segment.count;
    }
    auto const bounds = type.bounds(w, k, r);
    RowLaw<R> const law = row_law(type, w, k, r, gap, rate, model.timestep);
    row.bias = free_rate - law.zeta;
    row.compliance = law.compliance;
    row.inverse_diagonal = diagonal > R(0) ? R(1) / (diagonal + law.compliance) : R(0);
    row.friction_of = static_cast<signed char>(bounds.friction_of);
    row.lower = R(bounds.lower);
    row.upper = R(bounds.upper);
    row.mu = bounds.friction_of < 0 ? R(-1) : R(bounds.mu);
    row.with_next = bounds.with_next;
    // Nothing that it touches can move. In profile mujoco its softness says what it bears, as there.
    if (row.inverse_diagonal == R(0) && model.profile == Profile::stable) {
      row.friction_of = -1;
      row.mu = R(-1);
      row.lower = row.upper = R(0);
    }
    out = row;
  }
  /// What belongs to the element as a whole: place in the list of types, couplings, identity, and the impulses to start from.
  KOKKOS_INLINE_FUNCTION void finish(int place, RowId id, int w, int n, int first, std::int64_t couplings) const {
    Row<R>* const row = &rows.row(first);
    bool same = true;
    for (int b = 1; b < n; ++b) same = same && has_segments_of(row[b], row[0]);
    row->same_segments = same;
    couple(rows, row, n, couplings);
    int const now = impulses.parity(), last = state.steps(w) > 0 ? last_row(w, place, id) : -1;
    std::uint64_t const key = row_key(place, id), old = last < 0 ? 0 : impulses.id[1 - now](last);
    for (int r = 0; r < n; ++r) {
      row[r].type = static_cast<unsigned char>(place);
      impulses.id[now](first + r) = key;
      bool const known =
          last >= 0 && last + r < impulses.first[1 - now](w) + impulses.count[1 - now](w) && impulses.id[1 - now](last + r) == old;
      R const p = known && row[r].inverse_diagonal > R(0) ? impulses.p[1 - now](last + r) : R(0);
      impulses.p[now](first + r) = p - p == R(0) ? p : R(0);
    }
  }
  /// First row of this element in the last step, -1 where it was not there. The type's place in the list may have been another one;
  /// identities are sorted but for the minor part.
  KOKKOS_INLINE_FUNCTION int last_row(int w, int place, RowId id) const {
    int const before = 1 - impulses.parity();
    int type = 0;
    for (; impulses.type_names(type, before) != names.name[place]; ++type)
      if (impulses.type_names(type, before) == 0) return -1;
    std::uint64_t const key = row_key(type, id), major = key >> 32;
    auto const& ids = impulses.id[before];
    int lo = impulses.first[before](w);
    int const end = lo + impulses.count[before](w);
    for (int hi = end; lo < hi;) {
      int const mid = lo + (hi - lo) / 2;
      if ((ids(mid) >> 32) < major)
        lo = mid + 1;
      else
        hi = mid;
    }
    for (; lo < end && (ids(lo) >> 32) == major; ++lo)
      if (ids(lo) == key) return lo;
    return -1;
  }
};

}  // namespace gsp::detail
