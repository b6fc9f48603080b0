#pragma once
#include <gsp/constraint/constraint_type.hpp>
#include <gsp/constraint/detail/couple_rows.hpp>
#include <gsp/constraint/detail/row_lanes.hpp>
#include <gsp/constraint/detail/row_structure.hpp>
#include <gsp/constraint/detail/wake_islands.hpp>
#include <gsp/constraint/detail/whiten_rows.hpp>
#include <gsp/constraint/impulses.hpp>
#include <gsp/core/status.hpp>
#include <gsp/parallel/for_worlds.hpp>

/// The kernels of `assemble`: count -> scan -> emit, in the order of the types, then of the elements.
namespace gsp::detail {

KOKKOS_INLINE_FUNCTION std::int64_t pack_sizes(int rows, int entries) { return (std::int64_t(rows) << 40) + entries; }
KOKKOS_INLINE_FUNCTION int rows_of(std::int64_t sizes) { return int(sizes >> 40); }
KOKKOS_INLINE_FUNCTION std::int64_t entries_of(std::int64_t sizes) { return sizes & ((std::int64_t(1) << 40) - 1); }
/// None of them is NaN.
template <class... R>
KOKKOS_INLINE_FUNCTION bool are_numbers(R const&... x) {
  return ((x == x) && ...);
}
template <class R>
KOKKOS_INLINE_FUNCTION bool is_finite(R const& x) {
  return x - x == R(0);
}
KOKKOS_INLINE_FUNCTION std::uint64_t row_key(int type, RowId id) {
  return (std::uint64_t(type) << 59) | (std::uint64_t(id.major) << 32) | id.minor;
}

// A rigid row that pushes bears  p <= |u| / |Y|^2 + m (1e3 |g| h + |zeta|),  m the mass of all bodies: what is jammed asks for zeta /
// |Y|^2, any number, or, between two that do not yield, for more with every sweep, and would be thrown by its overlap or by rounding of its
// load.
inline constexpr double most_weights = 1e3;
// |Y|^2 mass is 1 but for leverage; the square of so many epsilon is what rounding has left of 0.
inline constexpr double jammed_rounding = 32;
// MuJoCo's least compliance, of what nothing moves in the initial pose (soft_law). Such a row bears zeta / C, 1e14 and more, and a rigid
// one zeta / |Y|^2, by which entries that are rounding would throw or hold what they touch (a tendon between bodies that are one: 1e7 m/s
// in float; a door that a rigid connect holds on its own hinge). They are 0 then: of |Y|^2 less than the square of so many epsilon, for
// joints that move the row by 1 a radian or metre.
inline constexpr double no_softness = 2e-15;
// Friction that holds as a spring does (RowsOptions::friction_time), C = s |Y|^2: s as far as a step can follow, the least for what is new.
// What carries more than friction_load times the weight of a mass 1 / |Y|^2 yields as if it carried as much. Friction above strong_friction
// does so in any case, with a time of at least strong_friction_time [s].
inline constexpr double least_friction_yield = 5e-3, most_friction_yield = 0.1, friction_load = 3, strong_friction = 2,
                        strong_friction_time = 1.5e-3;

template <class R, class Mem, class Types>
struct CountRows {
  Model<R, Mem> model;
  State<R, Mem> state;
  Rows<R, Mem> rows;
  Kokkos::View<int, Mem> halt;
  Types types;
  SleepingIslands<Mem> sleeping;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank;
    std::uint32_t const status = types.status(w);
    R const mass = world.template sum<R>(model.nbody - 1, [&](int b) { return model.body_mass(w, b + 1); });
    world.single([&] {
      state.status(w) =
          (state.status(w) & ~(status::contact_overflow | status::row_overflow | status::row_refused | status::causes)) | status;
      rows.kept(w) = 0;
      rows.largest_element(w) = 3;  // what contacts have
      rows.rate_scale(w) = gravity_rate(model.gravity, w, model.timestep);
      rows.weight(w) = mass * rows.rate_scale(w);
    });
    types.prepare(world);
    world.sync();
    world.single([&] {
      if (!types.counts(w)) Kokkos::atomic_or(&state.status(w), status::row_refused | status::refused_size);
    });
    std::int64_t sizes = world.template sum<std::int64_t>(types.count(w), [&](int e) {
      std::int64_t own = 0;
      types.visit(w, e, 0, [&](auto const& type, int, int k) {
        int const n = type.rows(w, k);
        bool const of_one_size = n > 0 && n <= most_element_rows;
        if (of_one_size && lies_still(model, sleeping, type, w, k)) return world.add(rows.kept(w), n);
        std::uint32_t refused = n < 0 || n > most_element_rows ? status::refused_size : 0;
        if (n > 0 && type.id(w, k).major >> 27 != 0) refused |= status::refused_identity;
        bool second = false;
        auto const refuse = [&](bool when, std::uint32_t cause) { refused |= when ? cause : 0u; };
        unsigned alone = 0;  // normals that have friction which shares no ellipse
        for (int r = 0; r < n && !refused; ++r) {
          RowStructure<R, Mem> structure{model};
          type.jacobian(w, k, r, structure);
          auto const bounds = type.bounds(w, k, r);
          refuse(structure.refused, status::refused_place);
          refuse(bounds.friction_of >= n || bounds.friction_of == r, status::refused_friction);
          refuse(bounds.lower > bounds.upper || !are_numbers(bounds.lower, bounds.upper, bounds.friction_of < 0 ? R(0) : R(bounds.mu)),
                 status::refused_bounds);
          if (!refused && bounds.friction_of >= 0 && model.profile == Profile::mujoco) {  // newton's cones: normals that push alone
            // Two that are bounded each by itself are a box, which is none.
            unsigned const one = bounds.with_next || second ? 0u : 1u << bounds.friction_of;
            refuse(!type.bounds(w, k, bounds.friction_of).pushes_alone() || (alone & one) != 0, status::refused_friction);
            alone |= one;
          }
          second = bounds.with_next;
          if (bounds.with_next) {
            bool const has_next = r + 1 < n && bounds.friction_of >= 0 && bounds.friction_of != r + 1;
            auto const next = type.bounds(w, k, has_next ? r + 1 : r);
            refuse(!has_next || next.with_next || next.friction_of != bounds.friction_of, status::refused_friction);
          }
          own += pack_sizes(1, structure.entries());
        }
        own += couplings_of(n);
        if (n > 3) Kokkos::atomic_max(&rows.largest_element(w), n);
        if (refused) Kokkos::atomic_or(&state.status(w), status::row_refused | refused);
      });
      return own;
    });
    world.sync();
    bool const refused = (state.status(w) & status::row_refused) != 0;
    if (refused) sizes = 0;
    sizes += std::int64_t(rows.most_eliminated) * rows_of(sizes);
    world.single([&] {
      if (status) halt() = 1;  // the same from every world that finds it
      if (refused) rows.kept(w) = 0;
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
    int const count = rows.count(w) + rows.kept(w);
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
  SleepingIslands<Mem> sleeping;
  static constexpr int column_bytes = 160;  // a row's entries, or else they are worked on in the pool
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
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
    int const first = rows.first(w), count = rows.count(w);
    world.template scan<std::int64_t>(types.count(w), [&](int e, std::int64_t& sum, bool last) {
      types.visit(w, e, 0, [&](auto const& type, int place, int k) {
        int const n = type.rows(w, k);
        if (n > 0 && lies_still(model, sleeping, type, w, k)) return;
        std::int64_t sizes = couplings_of(n);
        for (int r = 0; r < n; ++r) {
          RowStructure<R, Mem> structure{model};
          type.jacobian(w, k, r, structure);
          if (last) lay_out(rows.row(first + rows_of(sum) + r), place, k, rows.first_entry(w) + entries_of(sum + sizes), structure);
          if (last) rows.element_rows(first + rows_of(sum) + r) = static_cast<signed char>(r == 0 ? n : 0);
          sizes += pack_sizes(1, structure.entries());
        }
        sum += sizes;
      });
    });
    world.sync();
    auto const of_element = [&](int at) {
      int r = 0;
      while (rows.element_rows(at - r) == 0) ++r;
      return r;
    };
    if constexpr (is_device<typename Mem::execution_space>)
      world.each(count, [&](int r) { emit(world, w, of_element(first + r), first + r); });
    else
      emit_together(w, first, count, of_element);
    world.sync();
    world.each(count, [&](int r) {
      int const n = rows.element_rows(first + r);
      if (n > 0) types.visit_type(rows.row(first + r).type, [&](auto const& type) { finish(type, w, n, first + r); });
    });
    if (rows.kept(w) == 0) return;
    world.template scan<int>(types.count(w), [&](int e, int& sum, bool last) {
      types.visit(w, e, 0, [&](auto const& type, int place, int k) {
        int const n = type.rows(w, k);
        if (n == 0 || !lies_still(model, sleeping, type, w, k)) return;
        if (last) keep(type, k, place, w, n, rows.first(w) + rows.count(w) + sum);
        sum += n;
      });
    });
  }

 private:
  /// What a row may yield to its load (RowLaw), until its element is finished: in room that nothing else needs before the solver.
  KOKKOS_INLINE_FUNCTION R& most_yield(int row) const { return impulses.before(row); }
  /// Who a row is and where it lies.
  KOKKOS_INLINE_FUNCTION void lay_out(Row<R>& to, int place, int k, std::int64_t entry, RowStructure<R, Mem> const& structure) const {
    Row<R> row{};  // written as a whole: a single bit would wait for what lies beside it in memory
    row.type = static_cast<unsigned char>(place);
    row.element = k;
    row.first_entry = entry;
    for (int s = 0; s < 2; ++s) row.segment[s] = s < structure.segments ? structure.segment(s) : RowSegment{-1, 0, -1};
    to = row;
  }
  /// Row r of an element, number `at` of the pool: whitened entries, law and bounds. What all types do stands between what each does by
  /// itself: threads with rows of different types go through it together.
  template <class World>
  KOKKOS_INLINE_FUNCTION void emit(World const& world, int w, int r, int at) const {
    Row<R> row = rows.row(at);
    int const entries = row.segment[0].count + row.segment[1].count;
    R* const there = rows.Y.data() + row.first_entry;
    auto const y = world.column(entries, there);
    for (int i = 0; i < entries; ++i) y[i] = R(0);
    R gap(0), rate(0), free_rate(0), diagonal(0);
    types.visit_type(row.type, [&](auto const& type) {
      gap = R(type.jacobian(w, row.element, r, RowWriter<R, Mem, std::decay_t<decltype(y)>>{model, dynamics, row, y, w}));
    });
    for (int s = 0, begin = 0; s < 2 && row.segment[s].count > 0; begin += row.segment[s++].count) {
      auto const& segment = row.segment[s];
      int const tree = model.dof_tree(segment.dof0);
      TreeItems<R> const items = dynamics.tree(model, w, tree);
      gap += low_part(w, tree, segment, y, begin);
      for (int i = 0; i < segment.count; ++i) {
        int const dof = segment.list < 0 ? i : model.ints(segment.list + i);
        rate = fma(y[begin + i], items[items.at.qvel + dof], rate);
        free_rate = fma(y[begin + i], items[items.at.velocity + dof], free_rate);
      }
      whiten(model, items, tree, segment, y, begin);
      for (int i = 0; i < segment.count; ++i) {
        diagonal = fma(y[begin + i], y[begin + i], diagonal);
        there[begin + i] = y[begin + i];
      }
    }
    types.visit_type(row.type, [&](auto const& type) { most_yield(at) = set_law(type, w, r, at, gap, rate, free_rate, diagonal, row); });
    rows.row(at) = row;
  }
  /// All rows of a world, on a host: a pack at a time (row_lanes.hpp), then the laws.
  template <class OfElement>
  KOKKOS_INLINE_FUNCTION void emit_together(int w, int first, int count, OfElement const& of_element) const {
    using Lanes = RowLanes<R, Mem>;
    Lanes lanes(model, state, dynamics, rows.Y.data(), w);
    RowForces<R, Mem> forces[Lanes::W];
    for (int begin = first, end; begin < first + count; begin = end) {
      end = begin + Lanes::W < first + count ? begin + Lanes::W : first + count;
      for (int at = begin; at < end; ++at) {
        Row<R>& row = rows.row(at);
        bool keeps = true;
        for (int s = 0; s < 2 && row.segment[s].count > 0; ++s)
          keeps = keeps && Lanes::takes(model.archetypes(model.tree_archetype(model.dof_tree(row.segment[s].dof0))));
        ForceWriter<R, Mem> const writer(model, dynamics, row, rows.Y.data() + row.first_entry, w, forces[at - begin], keeps);
        types.visit_type(row.type, [&](auto const& type) { row.bias = R(type.jacobian(w, row.element, of_element(at), writer)); });
        row.lower = row.upper = row.mu = R(0);
      }
      for (int s = 0; s < 2; ++s) {
        for (int at = begin; at < end; ++at)
          if (rows.row(at).segment[s].count > 0) lanes.add(rows.row(at), s, forces[at - begin]);
        lanes.finish();
      }
    }
    for (int at = first; at < first + count; ++at) {
      Row<R>& row = rows.row(at);
      types.visit_type(row.type, [&](auto const& type) {
        most_yield(at) = set_law(type, w, of_element(at), at, row.bias, row.lower, row.upper, row.mu, row);
      });
    }
  }
  /// J x of a segment, x what rounding has taken from the place of a body that floats (State::qpos_low). Poses are without it: a gap that
  /// they give jumps by the last digit of a place, and what lies far from the origin would never rest in float.
  template <class Entries>
  KOKKOS_INLINE_FUNCTION R low_part(int w, int tree, RowSegment const& segment, Entries const& J, int begin) const {
    Archetype const& a = model.archetypes(model.tree_archetype(tree));
    int const* const ints = model.ints.data();
    int const joint = ints[a.dof_jnt + (segment.list < 0 ? 0 : ints[segment.list])];  // a chain begins at its root
    if (JointType(ints[a.jnt_type + joint]) != JointType::free) return R(0);
    int const q = ints[a.instance_qpos + model.tree_instance(tree)] + ints[a.jnt_qposadr + joint];
    R sum(0);
    for (int i = 0; i < 3 && i < segment.count; ++i) sum = fma(J[begin + i], state.qpos_low(w, q + i), sum);
    return sum;
  }
  /// Law and bounds of a row. Returns what it may yield to its load (RowLaw).
  template <class Type>
  KOKKOS_INLINE_FUNCTION R set_law(Type const& type, int w, int r, int at, R gap, R rate, R free_rate, R diagonal, Row<R>& row) const {
    int const k = row.element;
    auto const of_type = type.bounds(w, k, r);
    RowBounds<R> bounds{R(of_type.lower), R(of_type.upper), of_type.friction_of, R(of_type.mu), of_type.with_next, of_type.dry};
    RowLaw<R> law = row_law(type, w, k, r, gap, rate, model.timestep, bounds);
    bool const bounces =
        law.restitution > R(0) && law.restitution <= R(1) && law.compliance == R(0) && bounds.pushes_alone() && rows.impact.data();
    bool const is_law = is_finite(law.zeta) && is_finite(law.compliance) && law.compliance >= R(0) && (bounces || law.restitution == R(0));
    if (!is_law && is_finite(gap) && is_finite(rate)) {  // of a state that is none it need not be one
      Kokkos::atomic_or(&state.status(w), status::row_refused | status::refused_law);
      law.compliance = R(0);
      law.zeta = free_rate;
      law.restitution = R(0);
    }
    // Between bounds that meet the impulse is known, whatever the rate. (A cone of profile mujoco goes by its law, not by bounds.)
    if (bounds.lower == bounds.upper && bounds.friction_of < 0 && (model.profile == Profile::stable || !bears_friction(type, w, k, r))) {
      law.compliance = R(0);
      law.zeta = rate;
    }
    if (law.compliance <= R(no_softness) && bounds.friction_of < 0 && diagonal > R(0) &&
        diagonal <= square(R(jammed_rounding) * Kokkos::Experimental::epsilon_v<R>) * inverse_inertia(w, row)) {
      for (int i = 0; i < row.segment[0].count + row.segment[1].count; ++i) rows.Y(row.first_entry + i) = R(0);
      diagonal = R(0);
    }
    row.bias = free_rate - law.zeta;
    row.compliance = law.compliance;
    // What nothing can move bears what its softness makes of its gap, p = -b / C; rigid, or without a dof, it bears nothing.
    bool const jammed = law.compliance == R(0) && diagonal * law.mass <= square(R(jammed_rounding) * Kokkos::Experimental::epsilon_v<R>);
    R const size = row.segment[0].count > 0 && !jammed ? diagonal + law.compliance : R(0);
    row.inverse_diagonal = size > R(0) ? R(1) / size : R(0);
    row.friction_of = static_cast<signed char>(bounds.friction_of);
    row.lower = bounds.lower;
    row.upper = min(bounds.upper, most_push(law, w, max(abs(rate), abs(free_rate)) * row.inverse_diagonal));
    row.mu = bounds.friction_of < 0 ? R(-1) : bounds.mu;
    row.with_next = bounds.with_next;
    row.dry = bounds.dry;
    if (rows.impact.data()) rows.impact(at) = RowImpact<R>{diagonal > R(0) ? law.restitution : R(0), rate, law.zeta, R(0)};
    if (row.inverse_diagonal == R(0)) {
      row.bias = R(0);
      if (model.profile == Profile::stable) {
        row.friction_of = -1;
        row.mu = R(-1);
      }
      if (model.profile == Profile::stable || !(row.lower <= R(0) && row.upper >= R(0))) row.lower = row.upper = R(0);
    }
    // What cannot sink in carries the same however hard it is, or more.
    if (!(diagonal > Kokkos::Experimental::epsilon_v<R> * law.compliance)) return Kokkos::Experimental::infinity_v<R>;
    return law.most_yield;
  }
  /// Whether friction of the element hangs on its row r.
  template <class Type>
  KOKKOS_INLINE_FUNCTION static bool bears_friction(Type const& type, int w, int k, int r) {
    for (int b = 0, n = type.rows(w, k); b < n; ++b)
      if (type.bounds(w, k, b).friction_of == r) return true;
    return false;
  }
  /// Sum of 1 / D over the dofs of a row: |Y|^2 of a row that each of them moves by 1.
  KOKKOS_INLINE_FUNCTION R inverse_inertia(int w, Row<R> const& row) const {
    R sum(0);
    for (int s = 0; s < 2 && row.segment[s].count > 0; ++s) {
      auto const& segment = row.segment[s];
      TreeItems<R> const items = dynamics.tree(model, w, model.dof_tree(segment.dof0));
      for (int i = 0; i < segment.count; ++i)
        sum += items[items.at.inverse_diagonal + (segment.list < 0 ? i : model.ints(segment.list + i))];
    }
    return sum;
  }
  /// What a rigid row that says what it moves may push (RowLaw::mass): what stops it, which makes no energy however little it moves; and
  /// for the overlap and for others no more than all bodies ask for (most_weights).
  KOKKOS_INLINE_FUNCTION R most_push(RowLaw<R> const& law, int w, R stops) const {
    R const mass = max(law.mass, rows.weight(w) / rows.rate_scale(w));
    return stops + mass * (R(most_weights) * rows.rate_scale(w) + abs(law.zeta));
  }
  /// Of an element whose island sleeps: who it is, and the impulses that it fell asleep with.
  template <class Type>
  KOKKOS_INLINE_FUNCTION void keep(Type const& type, int k, int place, int w, int n, int first) const {
    int const now = impulses.parity();
    RowId const id = type.id(w, k);
    R start[most_element_rows];
    for (int r = 0; r < n; ++r) start[r] = R(0);
    find_start(type, k, place, id, w, n, start);
    for (int r = 0; r < n; ++r) {
      Row<R>& row = rows.row(first + r);
      row.type = static_cast<unsigned char>(place);
      row.element = k;
      rows.element_rows(first + r) = static_cast<signed char>(r == 0 ? n : 0);
      impulses.id[now](first + r) = row_key(place, id);
      impulses.p[now](first + r) = start[r];
    }
    mark_place(type, w, k, n, first);
  }
  /// What belongs to an element as a whole: couplings, identity, and the impulses to start from.
  template <class Type>
  KOKKOS_INLINE_FUNCTION void finish(Type const& type, int w, int n, int first) const {
    Row<R>* const row = &rows.row(first);
    int const k = row->element, place = row->type;
    bool same = true;
    for (int b = 1; b < n; ++b) same = same && has_segments_of(row[b], row[0]);
    row->same_segments = same;
    int const now = impulses.parity();
    RowId const id = type.id(w, k);
    R start[most_element_rows];
    for (int r = 0; r < n; ++r) start[r] = R(0);
    R const load = state.steps(w) > 0 ? find_start(type, k, place, id, w, n, start) : R(0);
    for (int r = 0; r < n; ++r) {
      impulses.id[now](first + r) = row_key(place, id);
      R const p = row[r].inverse_diagonal > R(0) ? start[r] : R(0);
      impulses.p[now](first + r) = p - p == R(0) ? p : R(0);
      if (row[r].friction_of >= 0 && model.profile == Profile::stable)
        hold_elastically(row[r], row[row[r].friction_of], impulses.p[now](first + r), start[row[r].friction_of], load, rows.rate_scale(w));
    }
    couple(rows, row, n, row->first_entry - couplings_of(n));
    // What is squeezed carries zeta / C, and hardened for that it would carry more each step: the weight of all is the most that counts.
    for (int r = 0; r < n; ++r) harden(row[r], min(load, rows.weight(w)), most_yield(first + r));
    mark_place(type, w, k, n, first);
  }
  /// Where an element acts and how its friction lies, for the next step.
  template <class Type>
  KOKKOS_INLINE_FUNCTION void mark_place(Type const& type, int w, int k, int n, int first) const {
    auto const mark = [&](int row, Vec3<R> const& v) {
      for (int c = 0; c < 3; ++c) impulses.place[impulses.parity()](row, c) = v[c];
    };
    if constexpr (requires { type.place(w, k); }) mark(first, type.place(w, k));
    if constexpr (requires { type.tangent(w, k, 0); })
      if (n >= 3) mark(first + 1, type.tangent(w, k, 0));
  }
  /// Impulses along and about the first tangent t of the last step and the normal cross t become those of this step's tangents: turned by
  /// the angle from these to t.
  template <class Type>
  KOKKOS_INLINE_FUNCTION static void turn(Type const& type, int w, int k, int n, Vec3<R> const& t, R* p) {
    Vec3<R> const first = type.tangent(w, k, 0);
    if (t.x == first.x && t.y == first.y && t.z == first.z) return;  // the usual case keeps its bits
    R const x = dot(t, first), y = dot(t, type.tangent(w, k, 1)), length = sqrt(fma(x, x, y * y));
    if (!(length > R(0))) return;
    R const c = x / length, s = y / length;
    for (int r = 1; r + 1 < n; r += 3) {
      R const along = p[r];
      p[r] = fma(c, along, -s * p[r + 1]);
      p[r + 1] = fma(s, along, c * p[r + 1]);
    }
  }
  /// Adds the impulses that the element had in the last step to `start`: those of its identity; or, where it had none and the type says
  /// where its elements act, of all elements of the same major identity that are gone and to which it is the nearest of the new ones.
  template <class Type>
  KOKKOS_INLINE_FUNCTION R find_start(Type const& type, int k, int place, RowId id, int w, int n, R* start) const {
    int const before = 1 - impulses.parity();
    int known = 0;
    for (; impulses.type_names(known, before) != names.name[place]; ++known)
      if (impulses.type_names(known, before) == 0) return R(0);
    auto const& ids = impulses.id[before];
    std::uint64_t const key = row_key(known, id), major = key >> 32;
    int low = impulses.first[before](w), end = low + impulses.count[before](w);
    auto const search = [&] {
      for (int high = end; low < high;) {  // identities are sorted but for the minor part
        int const middle = low + (high - low) / 2;
        if ((ids(middle) >> 32) < major)
          low = middle + 1;
        else
          high = middle;
      }
    };
    search();
    if (!(low < end && (ids(low) >> 32) == major) && impulses.kept[before](w) > 0) {  // all of a major identity sleep, or none
      low = end;
      end += impulses.kept[before](w);
      search();
    }
    auto const add = [&](int row) {
      std::uint64_t const old = ids(row);
      R p[most_element_rows];
      int had = 0;
      for (; had < n && row + had < end && ids(row + had) == old; ++had) p[had] = impulses.p[before](row + had);
      if constexpr (requires { type.tangent(w, k, 0); }) {
        auto const& t = impulses.place[before];
        if (had >= 3) turn(type, w, k, had, {t(row + 1, 0), t(row + 1, 1), t(row + 1, 2)}, p);
      }
      for (int r = 0; r < had; ++r) start[r] += p[r];
    };
    R load(0);
    int old = 0, same = -1;  // elements that there were, the row of this one
    for (int row = low; row < end && (ids(row) >> 32) == major; ++row) {
      if (row > low && ids(row) == ids(row - 1)) continue;
      load += abs(impulses.p[before](row));
      ++old;
      if (ids(row) == key) same = row;
    }
    if (old > 0) load = load / R(old);
    if (same >= 0) {
      add(same);
      return load;
    }
    if constexpr (requires { type.place(w, k); }) {
      int from = k, to = k + 1;
      int const elements = int(type.count(w));
      while (from > 0 && type.id(w, from - 1).major == id.major) --from;
      while (to < elements && type.id(w, to).major == id.major) ++to;
      auto const was_there = [&](std::uint32_t minor) {
        for (int row = low; row < end && (ids(row) >> 32) == major; ++row)
          if (std::uint32_t(ids(row)) == minor) return true;
        return false;
      };
      for (int row = low; row < end && (ids(row) >> 32) == major; ++row) {
        if (row > low && ids(row) == ids(row - 1)) continue;
        bool gone = true;
        for (int e = from; e < to; ++e) gone = gone && !(type.rows(w, e) > 0 && type.id(w, e).minor == std::uint32_t(ids(row)));
        if (!gone) continue;
        Vec3<R> const at{impulses.place[before](row, 0), impulses.place[before](row, 1), impulses.place[before](row, 2)};
        R const distance = norm(type.place(w, k) - at);
        bool nearest = true;
        for (int e = from; e < to; ++e) {
          if (e == k || type.rows(w, e) == 0) continue;
          R const other = norm(type.place(w, e) - at);
          if (other < distance || (other == distance && e < k)) nearest = nearest && was_there(type.id(w, e).minor);
        }
        if (nearest) add(row);
      }
    }
    return load;
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

}  // namespace gsp::detail
