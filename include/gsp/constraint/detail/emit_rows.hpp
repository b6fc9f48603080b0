#pragma once
#include <gsp/constraint/detail/count_rows.hpp>
#include <gsp/constraint/detail/row_lanes.hpp>
#include <gsp/constraint/detail/row_laws.hpp>
#include <gsp/constraint/detail/start_impulses.hpp>
#include <gsp/constraint/detail/whiten_trees.hpp>
#include <gsp/parallel/detail/launch_threads.hpp>

/// The last kernels of `assemble`: entries, laws and first impulses of all rows, in the order of the types, then of the elements. A host
/// makes them world by world; a device lays them out so, then makes them by a thread each, all worlds' together, and finishes elements.
namespace gsp::detail {

// Friction that holds as a spring does (RowsOptions::friction_time), C = s |Y|^2: s as far as a step can follow, the least for what is new.
// What carries more than friction_load times the weight of a mass 1 / |Y|^2 yields as if it carried as much. Friction above strong_friction
// does so in any case, with a time of at least strong_friction_time [s].
inline constexpr double least_friction_yield = 5e-3, most_friction_yield = 0.1, friction_load = 3, strong_friction = 2,
                        strong_friction_time = 1.5e-3;

template <class R, class Mem, class Types>
struct EmitRows {
  static constexpr bool wide = true;  // for_worlds: sums are of whole numbers
  Model<R, Mem> model;
  State<R, Mem> state;
  Dynamics<R, Mem> dynamics;
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Kokkos::View<int, Mem> halt;
  Types types;
  TypeNames names;
  SleepingIslands<Mem> sleeping;
  template <class World>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(World const& world) const {
    int const w = world.rank;
    if (halt()) return;
    int const now = impulses.parity();
    world.single([&] {
      impulses.first[now](w) = rows.first(w);
      impulses.count[now](w) = rows.count(w);
      impulses.kept[now](w) = rows.kept(w);
    });
    if (w == 0) world.each(most_constraint_types + 1, [&](int t) { impulses.type_names(t, now) = t < names.count ? names.name[t] : 0; });
    if (state.status(w) & status::row_refused) return;
    if constexpr (is_device<typename Mem::execution_space>)
      lay_out(world);
    else
      emit_together(w);
  }

  /// On a device: entries of row `at` of the pool, which has been laid out, and sums over them. What all types do stands after what each
  /// does by itself: threads with rows of different types go through it together.
  template <class Thread>
  KOKKOS_FORCEINLINE_FUNCTION void make(Thread const& thread, int at) const {
    int const w = rows.world_of(at);
    if (at >= rows.first(w) + rows.count(w)) return;  // one that is kept
    int r = 0;
    while (rows.element_rows(at - r) == 0) ++r;
    Row<R> const row = rows.row(at);
    R* const there = rows.Y.data() + row.first_entry;
    auto const near = thread.template near<R>();
    if (entries_in(row) <= Thread::template room<R>)
      make_row(Strided<R>{near.at, near.stride}, row, w, r, at);
    else
      make_row(there, row, w, r, at);
  }
  /// On a device: the impulses that the element which was listed as number `number` starts from, and what it carried, in its first row,
  /// until it is finished.
  KOKKOS_FORCEINLINE_FUNCTION void start(int number) const {
    int const first = rows.laid_out(number), n = rows.element_rows(first), now = impulses.parity();
    R impulse[most_element_rows];
    rows.row(first).compliance = find_start(rows.world_of(first), n, first, impulse);
    for (int r = 0; r < n; ++r) impulses.p[now](first + r) = impulse[r];
  }
  /// On a device: what hangs on the entries of that element.
  KOKKOS_FORCEINLINE_FUNCTION void finish(int number) const {
    int const first = rows.laid_out(number), n = rows.element_rows(first), now = impulses.parity();
    R impulse[most_element_rows];
    for (int r = 0; r < n; ++r) impulse[r] = impulses.p[now](first + r);
    finish(laws(Kokkos::Experimental::infinity_v<R>), rows.world_of(first), n, first, impulse, rows.row(first).compliance);
  }
  /// Rows of the pool, with those that are kept; elements that are listed.
  KOKKOS_INLINE_FUNCTION int row_count() const {
    int const last = rows.worlds - 1;
    return halt() ? 0 : rows.first(last) + rows.count(last) + rows.kept(last);
  }
  KOKKOS_INLINE_FUNCTION int element_count() const { return halt() ? 0 : rows.laid_out_count(); }

 private:
  KOKKOS_INLINE_FUNCTION RowLaws<R, Mem> laws(R most_inverse_inertia) const { return {model, state, dynamics, rows, most_inverse_inertia}; }
  KOKKOS_INLINE_FUNCTION StartImpulses<R, Mem> starts() const { return {impulses, names}; }
  /// Who a row is and where it lies.
  KOKKOS_INLINE_FUNCTION static void lay_out(Row<R>& row, int place, int k, std::int64_t entry, RowSegment const (&segment)[2]) {
    row.type = static_cast<unsigned char>(place);
    row.element = k;
    row.first_entry = entry;
    for (int s = 0; s < 2; ++s) row.segment[s] = segment[s];
  }
  /// The same as a whole, on a device: a single bit would wait for what lies beside it in memory.
  KOKKOS_INLINE_FUNCTION static Row<R> laid_out(int place, int k, std::int64_t entry, RowStructure<R, Mem> const& structure) {
    Row<R> row{};
    lay_out(row, place, k, entry, {structure.segment(0), structure.segment(1)});
    return row;
  }
  KOKKOS_INLINE_FUNCTION static int entries_in(Row<R> const& row) { return row.segment[0].count + row.segment[1].count; }

  /// What a thread of a device keeps of an element until it knows where it begins.
  struct Measured {
    Row<R> row;          // its first one
    int n = 0;           // its rows
    bool alike = false;  // whether the others have the segments of the first
  };
  /// Rows and entries of element e. (No lambda: what is not inlined into a kernel has its loads by generic addresses, two instructions more
  /// each.)
  struct Measure {
    EmitRows const& emit;
    int w;
    Measured& own;
    KOKKOS_FORCEINLINE_FUNCTION std::int64_t operator()(int e) const {
      own.n = 0;
      std::int64_t sizes = 0;
      emit.types.visit(w, e, 0, [&](auto const& type, int place, int k) {
        auto const element = element_of(type, w, k);
        int const n = element.rows();
        if (n == 0 || lies_still(emit.model, emit.sleeping, type, w, k)) return;
        own.n = n;
        own.alike = n == 1 || rows_are_alike<std::decay_t<decltype(type)>>();
        sizes = couplings_of(n);
        for (int r = 0; r < (own.alike ? 1 : n); ++r) {
          RowStructure<R, Mem> structure{emit.model};
          element.jacobian(r, structure);
          if (r == 0) own.row = laid_out(place, k, 0, structure);
          sizes += pack_sizes(1, structure.entries());
        }
        if (own.alike) sizes += (n - 1) * pack_sizes(1, entries_in(own.row));
      });
      return sizes;
    }
  };
  /// Where all rows of a world lie, on a device.
  template <class World>
  KOKKOS_FORCEINLINE_FUNCTION void lay_out(World const& world) const {
    int const w = world.rank, first = rows.first(w);
    world.each(rows.count(w) + rows.kept(w), [&](int r) { rows.world_of(first + r) = w; });
    Measured own;
    world.template scan<std::int64_t>(types.count(w), Measure{*this, w, own}, [&](int, std::int64_t before) {
      if (own.n == 0) return;
      int const at = first + rows_of(before);
      std::int64_t entry = rows.first_entry(w) + entries_of(before) + couplings_of(own.n);
      for (int r = 0; r < own.n; ++r) {
        Row<R> row = own.row;
        if (r > 0 && !own.alike)
          types.visit_type(row.type, [&](auto const& type) {
            RowStructure<R, Mem> structure{model};
            element_of(type, w, row.element).jacobian(r, structure);
            row = laid_out(row.type, row.element, 0, structure);
          });
        row.first_entry = entry;
        rows.row(at + r) = row;
        rows.element_rows(at + r) = static_cast<signed char>(r == 0 ? own.n : 0);
        entry += entries_in(row);
      }
      rows.laid_out(Kokkos::atomic_fetch_add(&rows.laid_out_count(), 1)) = at;  // in any order
    });
  }
  /// Entries of row r of an element, number `at` of the pool, in y and in the pool, and its RowSums.
  template <class Entries>
  KOKKOS_FORCEINLINE_FUNCTION void make_row(Entries const y, Row<R> const& row, int w, int r, int at) const {
    int const n = entries_in(row);
    for (int i = 0; i < n; ++i) y[i] = R(0);
    RowSums<R> sums;
    types.visit_type(row.type, [&](auto const& type) {
      R const gap = R(element_of(type, w, row.element).jacobian(r, WhitenedWriter<R, Mem, Entries>{model, dynamics, row, y, sums, w}));
      sums.gap += gap;
    });
    for (int i = 0; i < n; ++i) {
      R const entry = y[i];
      sums.diagonal = fma(entry, entry, sums.diagonal);
      if constexpr (!std::is_pointer_v<Entries>) rows.Y(row.first_entry + i) = entry;
    }
    sums.leave_in(rows.row(at));
  }
  /// The impulses that an element of n rows starts from, and what it carried; marks who and where it is.
  KOKKOS_FORCEINLINE_FUNCTION R find_start(int w, int n, int first, R* start) const {
    Row<R> const& row = rows.row(first);
    int const k = row.element, place = row.type, now = impulses.parity();
    R load(0);
    for (int r = 0; r < n; ++r) start[r] = R(0);
    types.visit_type(place, [&](auto const& type) {
      RowId const id = type.id(w, k);
      for (int r = 0; r < n; ++r) impulses.id[now](first + r) = row_key(place, id);
      if (state.steps(w) > 0) load = starts().find(type, k, place, id, w, first - rows.first(w), n, start);
      starts().mark_place(type, w, k, n, first);
    });
    return load;
  }
  /// Laws of the rows of an element, whose entries and RowSums are known, couplings, and the impulses to start from.
  KOKKOS_FORCEINLINE_FUNCTION void finish(RowLaws<R, Mem> const& laws, int w, int n, int first, R const* start, R load) const {
    Row<R>* const row = &rows.row(first);
    int const k = row->element, place = row->type, now = impulses.parity();
    constexpr bool apart = is_device<typename Mem::execution_space>;  // threads with elements of different types part in `visit_type` alone
    using Asked = typename RowLaws<R, Mem>::Asked;
    Asked asked[apart ? most_element_rows : 1];
    R most_yield[most_element_rows];
    auto const set = [&](int r, auto const& what) {
      if constexpr (apart) {  // read and written as a whole
        Row<R> own = row[r];
        most_yield[r] = laws.set(what, w, first + r, RowSums<R>::of(own), own);
        row[r] = own;
      } else {
        most_yield[r] = laws.set(what, w, first + r, RowSums<R>::of(row[r]), row[r]);
      }
    };
    types.visit_type(place, [&](auto const& type) {
      auto const element = element_of(type, w, k);
      for (int r = 0; r < n; ++r)
        if constexpr (apart)
          asked[r] = {laws, element, r, row[r].bias, row[r].lower};
        else
          set(r, Asked{laws, element, r, row[r].bias, row[r].lower});
    });
    if constexpr (apart)
      for (int r = 0; r < n; ++r) set(r, asked[r]);
    bool same = true;
    for (int r = 1; r < n; ++r) same = same && has_segments_of(row[r], row[0]);
    row->same_segments = same;
    for (int r = 0; r < n; ++r) {
      R const p = row[r].inverse_diagonal > R(0) ? start[r] : R(0);
      impulses.p[now](first + r) = p - p == R(0) ? p : R(0);
      if (row[r].friction_of >= 0 && model.profile == Profile::stable)
        hold_elastically(row[r], row[row[r].friction_of], impulses.p[now](first + r), start[row[r].friction_of], load, rows.rate_scale(w));
    }
    couple(rows, row, n, row->first_entry - couplings_of(n));
    // What is squeezed carries zeta / C, and hardened for that it would carry more each step: the weight of its island is the most that
    // counts.
    for (int r = 0; r < n; ++r) harden(row[r], min(load, rows.island_mass(w, row[r]) * rows.rate_scale(w)), most_yield[r]);
  }
  /// All rows of a world, on a host, element by element: some rows are laid out, a pack at a time gets its entries (row_lanes.hpp), then
  /// laws and impulses.
  KOKKOS_INLINE_FUNCTION void emit_together(int w) const {
    if (rows.count(w) == 0) return;
    using Lanes = RowLanes<R, Mem>;
    constexpr int most = 2 * Lanes::W > most_element_rows ? 2 * Lanes::W : most_element_rows;
    Lanes lanes(model, dynamics, rows.Y.data(), w);
    RowForces<R, Mem> forces[most];
    R inverse_inertia(0);  // 1 / D of all dofs
    for (int t = 0; t < model.ntree; ++t) {
      TreeItems<R> const items = dynamics.tree(model, w, t);
      for (int d = 0, n = model.archetypes(model.tree_archetype(t)).nv; d < n; ++d) inverse_inertia += items[items.at.inverse_diagonal + d];
    }
    int begin = rows.first(w), end = begin;
    std::int64_t entry = rows.first_entry(w);
    auto const finish_rows = [&] {
      for (int s = 0; s < 2; ++s) {
        for (int at = begin; at < end; ++at)
          if (rows.row(at).segment[s].count > 0) lanes.add(rows.row(at), s, forces[at - begin]);
        lanes.finish();
      }
      for (int n; begin < end; begin += n) {
        n = rows.element_rows(begin);
        R start[most_element_rows];
        R const load = find_start(w, n, begin, start);
        finish(laws(inverse_inertia), w, n, begin, start, load);
      }
    };
    types.each(w, 0, [&](auto const& type, int place, int k) {
      auto const element = element_of(type, w, k);
      int const n = element.rows();
      if (n == 0 || lies_still(model, sleeping, type, w, k)) return;
      if (end + n > begin + most) finish_rows();
      entry += couplings_of(n);
      RowSegment segment[2];
      bool keeps = true;
      for (int r = 0; r < n; ++r, ++end) {
        if (r == 0 || !rows_are_alike<std::decay_t<decltype(type)>>()) {
          RowStructure<R, Mem> structure{model};
          element.jacobian(r, structure);
          keeps = true;
          for (int s = 0; s < 2; ++s) segment[s] = structure.segment(s);
          structure.each_tree([&](int t) { keeps = keeps && Lanes::takes(model.archetypes(model.tree_archetype(t))); });
        }
        Row<R>& row = rows.row(end);  // written where it stands, number by number: a copy would wait for what it copies (Asked)
        row = {};
        lay_out(row, place, k, entry, segment);
        row.bias = R(element.jacobian(r, ForceWriter<R, Mem>(model, dynamics, row, rows.Y.data() + entry, w, forces[end - begin], keeps)));
        rows.element_rows(end) = static_cast<signed char>(r == 0 ? n : 0);
        entry += entries_in(row);
      }
    });
    finish_rows();
  }
  /// Rigid friction yields to what it changes by,   w + C (p - p_last) = 0:   it creeps under no load, and since it took hold it has
  /// slipped by -h C p, as on a spring 1 / (h^2 C). Without, friction of points that move alike is not unique, and where they move nearly
  /// alike it takes impulses beyond all measure to stop what is rounding: sweeps stall, and what has a strong friction is thrown (decision
  /// 25).
  /// @param normal  row that it hangs on;   @param p_last, normal_last  impulses of the two in the last step
  /// @param load  what the element carries, as for `harden`
  KOKKOS_INLINE_FUNCTION void hold_elastically(Row<R>& row, Row<R> const& normal, R p_last, R normal_last, R load, R rate_scale) const {
    bool const fresh = normal_last == R(0);
    R const time(row.mu > R(strong_friction) ? max(rows.friction_time, strong_friction_time) : rows.friction_time);
    if (time == R(0) || row.compliance != R(0) || row.inverse_diagonal == R(0)) return;
    if (fresh && normal.compliance == R(0)) return;  // a blow: no later step would stop what is left
    R const size = R(1) / row.inverse_diagonal, most = R(friction_load) * rate_scale, least(least_friction_yield);
    R const share = fresh ? least : clamp(square(time / model.timestep), least, R(most_friction_yield));
    row.compliance = share * (size * load > most ? most / load : size);
    row.bias = fma(-row.compliance, p_last, row.bias);
    row.inverse_diagonal = R(1) / (size + row.compliance);
  }
  /// A row that carries much yields C p <= most to it.
  KOKKOS_INLINE_FUNCTION static void harden(Row<R>& row, R p, R most) {
    R const compliance = row.compliance;
    if (!(compliance * abs(p) > most) || row.with_next) return;
    row.compliance = most / abs(p);
    row.inverse_diagonal = R(1) / (R(1) / row.inverse_diagonal + (row.compliance - compliance));
  }
};

/// EmitRows::make, of all rows.
template <class R, class Mem, class Types>
struct MakeRows {
  EmitRows<R, Mem, Types> emit;
  static constexpr int near_bytes = 160;  // a row's entries, or else they are worked on in the pool
  KOKKOS_FUNCTION int count() const { return emit.row_count(); }
  template <class Thread>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(Thread const& thread, int at) const {
    emit.make(thread, at);
  }
};
/// EmitRows::start, of all elements.
template <class R, class Mem, class Types>
struct StartRows {
  EmitRows<R, Mem, Types> emit;
  KOKKOS_FUNCTION int count() const { return emit.element_count(); }
  template <class Thread>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(Thread const&, int number) const {
    emit.start(number);
  }
};
/// EmitRows::finish, of all elements.
template <class R, class Mem, class Types>
struct FinishRows {
  EmitRows<R, Mem, Types> emit;
  KOKKOS_FUNCTION int count() const { return emit.element_count(); }
  template <class Thread>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(Thread const&, int number) const {
    emit.finish(number);
  }
};

}  // namespace gsp::detail
