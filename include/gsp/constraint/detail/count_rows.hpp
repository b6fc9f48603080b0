#pragma once
#include <gsp/constraint/detail/couple_rows.hpp>
#include <gsp/constraint/detail/element.hpp>
#include <gsp/constraint/detail/row_structure.hpp>
#include <gsp/constraint/detail/wake_islands.hpp>
#include <gsp/constraint/impulses.hpp>
#include <gsp/core/status.hpp>
#include <gsp/parallel/for_worlds.hpp>

/// The first two kernels of `assemble`, count -> scan -> emit: rows, entries and islands of each world, and where they begin.
namespace gsp::detail {

// Rows of a world above, entries below: 134 million of the one and 69 billion of the other, which no memory holds.
inline constexpr int entry_bits = 36;
KOKKOS_INLINE_FUNCTION std::int64_t pack_sizes(int rows, int entries) { return (std::int64_t(rows) << entry_bits) + entries; }
KOKKOS_INLINE_FUNCTION int rows_of(std::int64_t sizes) { return int(sizes >> entry_bits); }
KOKKOS_INLINE_FUNCTION std::int64_t entries_of(std::int64_t sizes) { return sizes & ((std::int64_t(1) << entry_bits) - 1); }
/// Friction beyond it is none that arithmetic bears: its square is still a number of float.
inline constexpr double most_friction = 1e15;
/// None of them is NaN.
template <class... R>
KOKKOS_INLINE_FUNCTION bool are_numbers(R const&... x) {
  return ((x == x) && ...);
}
/// Sum of f(type, k) over the elements of a world.
template <class World, class Types, class F>
KOKKOS_INLINE_FUNCTION std::int64_t sum_elements(World const& world, Types const& types, F const& f) {
  if constexpr (std::is_same_v<World, SerialWorld>) {
    std::int64_t total = 0;
    types.each(world.rank, 0, [&](auto const& type, int, int k) { total += f(type, k); });
    return total;
  } else {
    return world.template sum<std::int64_t>(types.count(world.rank), [&](int e) {
      std::int64_t own = 0;
      types.visit(world.rank, e, 0, [&](auto const& type, int, int k) { own = f(type, k); });
      return own;
    });
  }
}

// Bits that assembling sets, anew in each step.
inline constexpr std::uint32_t status_of_rows = status::contact_overflow | status::row_overflow | status::row_refused | status::causes;
/// What an earlier step's rows were refused for is no more, where a step has none.
template <class Mem>
struct ForgetRows {
  Kokkos::View<std::uint32_t*, Kokkos::LayoutRight, Mem> status_bits;
  KOKKOS_FUNCTION void operator()(int w) const { status_bits(w) &= ~status_of_rows; }
};

struct RowSizes {
  std::int64_t rows = 0, entries = 0;
  KOKKOS_INLINE_FUNCTION RowSizes& operator+=(RowSizes const& o) {
    rows += o.rows;
    entries += o.entries;
    return *this;
  }
};
/// Where the rows of world w begin, which `sum` says; of the last one also what all of them need.
template <class R, class Mem>
struct PlaceRows {
  Kokkos::View<int, Mem> halt, parity, solved;
  int capacity;
  KOKKOS_INLINE_FUNCTION void operator()(Rows<R, Mem> const& rows, State<R, Mem> const& state, int w, RowSizes const& sum) const {
    int const count = rows.count(w) + rows.kept(w);
    std::int64_t const entries = rows.entries(w), room = std::int64_t(rows.Y.extent(0));
    rows.first(w) = int(sum.rows);
    rows.first_entry(w) = sum.entries;
    if (sum.rows + count > capacity || sum.entries + entries > room) state.status(w) |= status::row_overflow;
    if (w < rows.worlds - 1) return;
    if (rows.laid_out_count.data()) rows.laid_out_count() = 0;
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
};
template <class R, class Mem>
struct ScanRows {
  using value_type = RowSizes;
  Rows<R, Mem> rows;
  State<R, Mem> state;
  PlaceRows<R, Mem> place;
  KOKKOS_FUNCTION void operator()(int w, value_type& sum, bool last) const {
    if (last) place(rows, state, w, sum);
    sum.rows += rows.count(w) + rows.kept(w);
    sum.entries += rows.entries(w);
  }
};

template <class R, class Mem, class Types>
struct CountRows {
  static constexpr bool wide = true;  // for_worlds: sums are of whole numbers
  Model<R, Mem> model;
  State<R, Mem> state;
  Rows<R, Mem> rows;
  PlaceRows<R, Mem> place;
  Types types;
  SleepingIslands<Mem> sleeping;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank;
    std::uint32_t const found = types.status(w);
    part_islands(world, rows.islands, w);
    world.single([&] {
      state.status(w) = (state.status(w) & ~status_of_rows) | found;
      rows.kept(w) = 0;
      rows.largest_element(w) = 3;  // the room that solvers make at least
      rows.rate_scale(w) = gravity_rate(model.gravity, w, model.timestep);
    });
    types.prepare(world);
    world.sync();
    world.single([&] {
      if (!types.counts_are_valid(w)) Kokkos::atomic_or(&state.status(w), status::row_refused | status::refused_size);
    });
    std::int64_t sizes = sum_elements(world, types, [&](auto const& type, int k) { return count_element(world, type, k); });
    label_islands(world, rows.islands, w);
    weigh_islands(world);
    bool const refused = (state.status(w) & status::row_refused) != 0;
    if (refused) sizes = 0;
    sizes += std::int64_t(rows.most_eliminated) * rows_of(sizes);
    world.single([&] {
      if (found & status::contact_overflow) place.halt() = 1;  // the same from every world that finds it
      if (refused) rows.kept(w) = 0;
      rows.count(w) = rows_of(sizes);
      rows.entries(w) = entries_of(sizes);
      if (rows.worlds == 1) place(rows, state, 0, {});  // on a GPU a launch of its own would be more than what it does
    });
  }

 private:
  /// The first tree of an island knows what all of its trees weigh, summed in their order.
  template <class World>
  KOKKOS_INLINE_FUNCTION void weigh_islands(World const& world) const {
    int const w = world.rank;
    int const* const label = rows.islands.label(w);
    world.each(model.ntree, [&](int t) {
      Archetype const& a = model.archetypes(model.tree_archetype(t));
      int const body0 = model.ints(a.instance_body + model.tree_instance(t));
      R mass(0);
      for (int b = body0; b < body0 + a.nbody; ++b) mass += model.body_mass(w, b);
      rows.tree_mass(w, t) = mass;
    });
    world.sync();
    if constexpr (std::is_same_v<World, SerialWorld>) {
      for (int t = 1; t < model.ntree; ++t)
        if (label[t] != t) rows.tree_mass(w, label[t]) += rows.tree_mass(w, t);
    } else {  // by the first tree of each that has others: a thread that goes through all waits for each of them
      int* const others = rows.islands.next(w);
      world.each(model.ntree, [&](int t) { others[t] = 0; });
      world.sync();
      world.each(model.ntree, [&](int t) {
        if (label[t] != t) world.add(others[label[t]], 1);
      });
      world.sync();
      world.each(model.ntree, [&](int first) {
        R mass = rows.tree_mass(w, first);
        int left = others[first];
        for (int t = first + 1; left > 0; ++t)
          if (label[t] == first) {
            mass += rows.tree_mass(w, t);
            --left;
          }
        if (others[first] > 0) rows.tree_mass(w, first) = mass;
      });
    }
    world.sync();
  }
  /// Rows and entries of element k where it is awake and well formed; else the world's status says why not.
  template <class World, class Type>
  KOKKOS_INLINE_FUNCTION std::int64_t count_element(World const& world, Type const& type, int k) const {
    int const w = world.rank;
    auto const element = element_of(type, w, k);
    int const n = element.rows();
    if (n == 0) return 0;
    if (n > 0 && n <= most_element_rows && lies_still(model, sleeping, type, w, k)) {
      world.add(rows.kept(w), n);
      return 0;
    }
    std::uint32_t refused = n < 0 || n > most_element_rows ? status::refused_size : 0;
    std::int64_t own = refused ? 0 : couplings_of(n);
    if (n > 0 && type.id(w, k).major >> 27 != 0) refused |= status::refused_identity;
    bool second = false;
    auto const refuse = [&](bool when, std::uint32_t cause) { refused |= when ? cause : 0u; };
    unsigned alone = 0;  // normals that have friction which shares no ellipse
    int entries = 0;     // of a row
    int tree = -1;       // that its rows couple to others
    for (int r = 0; r < n && !refused; ++r) {
      if (r == 0 || !rows_are_alike<Type>()) {
        RowStructure<R, Mem> structure{model};
        element.jacobian(r, structure);
        refuse(structure.refused, status::refused_place);
        entries = structure.entries();
        structure.each_tree([&](int t) {
          if (tree < 0) tree = t;
          if (t != tree) join_islands(rows.islands.label(w), tree, t);
        });
      }
      auto const bounds = element.bounds(r);
      refuse(bounds.friction_of >= n || bounds.friction_of == r, status::refused_friction);
      R const mu = bounds.friction_of < 0 ? R(0) : R(bounds.mu);
      refuse(bounds.lower > bounds.upper || !are_numbers(bounds.lower, bounds.upper) || !(mu >= R(0) && mu <= R(most_friction)),
             status::refused_bounds);
      if (!refused && bounds.friction_of >= 0 && model.profile == Profile::mujoco) {  // newton's cones: normals that push alone
        // Two that are bounded each by itself are a box, which is none.
        unsigned const one = bounds.with_next || second ? 0u : 1u << bounds.friction_of;
        refuse(!element.bounds(bounds.friction_of).pushes_alone() || (alone & one) != 0, status::refused_friction);
        alone |= one;
      }
      second = bounds.with_next;
      if (bounds.with_next) {
        bool const has_next = r + 1 < n && bounds.friction_of >= 0 && bounds.friction_of != r + 1;
        auto const next = element.bounds(has_next ? r + 1 : r);
        refuse(!has_next || next.with_next || next.friction_of != bounds.friction_of, status::refused_friction);
      }
      own += pack_sizes(1, entries);
    }
    if (n > 3 && !refused) Kokkos::atomic_max(&rows.largest_element(w), n);
    if (refused) Kokkos::atomic_or(&state.status(w), status::row_refused | refused);
    return own;
  }
};

}  // namespace gsp::detail
