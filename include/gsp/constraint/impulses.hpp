#pragma once
#include <algorithm>
#include <gsp/constraint/progress.hpp>
#include <gsp/constraint/rows.hpp>

/// The impulses of the rows of this step and of the last one: warm starts, and what a user reads back.
namespace gsp {

namespace detail {
struct ImpulsesStamp {
  std::uint64_t rows = 0;  // RowsStamp::made of the rows that they are for
  bool solved = false;     // or only what a solver starts from
  bool launched = false;   // by steps that nobody has waited for: the host does not know whether they have fitted (step/step.hpp)
};
}  // namespace detail

/// Impulses of all rows by parity: a step writes its own side while it looks up the last step's on the other one, by identity.
template <class R, class Mem>
struct Impulses {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;
  View<R*> p[2];                           // (capacity) [N s], beside Rows::row
  View<std::uint64_t*> id[2];              // (capacity) place of the type, identity of the element
  View<R*> before;                         // (capacity) scratch of impacts and solvers: impulses before the last sweep
  View<R*> mixing[4];                      // GPUs, (capacity) a solver's own (solver/detail/mixing.hpp): impulses after the last sweep
                                           // that was mixed, and its changes; the same of the sweep after
  View<R* [3]> place[2];                   // (capacity) where an element acts [m], at its first row, and its tangent, at its second; of
                                           // types that say so
  View<int*> first[2], count[2], kept[2];  // (worlds) where a world's lie; after them those of islands that sleep
  View<std::uint32_t* [2]> type_names;     // (types, parity) name of the type at each place; 0 after the last
  View<int> parity, solved;                // side of this step; whether it has been solved for
  detail::SharedStamp<detail::ImpulsesStamp> stamp;  // host: which rows they are for (dynamics/stamps.hpp)

  KOKKOS_INLINE_FUNCTION int capacity() const { return int(p[0].extent(0)); }
};

namespace detail {
template <class R, class Mem, class Exec>
void allocate_impulses(Exec const& exec, Impulses<R, Mem>& i, std::int64_t rows) {
  enlarge(exec, i.before, "gsp::Impulses::before", rows);
  if constexpr (is_device<Exec>)  // hosts remember what they mix in their threads' room
    for (auto& of_mixing : i.mixing) enlarge(exec, of_mixing, "gsp::Impulses::mixing", rows);
  for (int side : {1, 0}) {
    enlarge(exec, i.id[side], "gsp::Impulses::id", rows);
    enlarge(exec, i.place[side], "gsp::Impulses::place", rows);
    enlarge(exec, i.p[side], "gsp::Impulses::p", rows);  // p[0] last: it says how much room there is, and each of these may throw
  }
}

/// A number for the type itself, the same wherever it stands in a list (FNV-1a of its name). Never 0.
template <class Type>
constexpr std::uint32_t type_name() {
  std::uint32_t hash = 2166136261u;
  for (char const* c = __PRETTY_FUNCTION__; *c != 0; ++c) hash = (hash ^ std::uint32_t(static_cast<unsigned char>(*c))) * 16777619u;
  return hash | 1u;
}
/// The name of the n-th of several types of one kind in a list.
constexpr std::uint32_t nth_name(std::uint32_t name, int n) { return (name + 0x9e3779b9u * std::uint32_t(n)) | 1u; }
}  // namespace detail

/// Room for as many impulses as `rows` has rows. Allocates.
template <ExecutionSpace Exec, class R, class Mem>
Impulses<R, Mem> make_impulses(Exec const& exec, Rows<R, Mem> const& rows) {
  Impulses<R, Mem> i;
  auto const make = [&](auto& v, char const* label, auto... items) {
    v = detail::allocate_zero<std::decay_t<decltype(v)>>(exec, label, items...);
  };
  i.worlds = rows.worlds;
  i.stamp = detail::make_stamp<detail::ImpulsesStamp>("gsp::Impulses::stamp");
  for (int side = 0; side < 2; ++side) {
    make(i.first[side], "gsp::Impulses::first", rows.worlds);
    make(i.count[side], "gsp::Impulses::count", rows.worlds);
    make(i.kept[side], "gsp::Impulses::kept", rows.worlds);
  }
  make(i.type_names, "gsp::Impulses::type_names", most_constraint_types + 1);
  make(i.parity, "gsp::Impulses::parity");
  make(i.solved, "gsp::Impulses::solved");
  detail::allocate_impulses(exec, i, rows.capacity());
  return i;
}

/// Says on the host that `impulses` are the solution of `rows`, so that forces may be read. `pgs` does; call it after a solver of your own,
/// whose kernel sets impulses.solved() = 1 besides, so that the next `assemble` starts from them. With a solution: that it is of these
/// rows, so that `integrate` takes it.
template <class R, class Mem>
void set_solved(Rows<R, Mem> const& rows, Impulses<R, Mem>& impulses) {
  if (impulses.stamp.data()) impulses.stamp() = {rows.stamp.data() ? rows.stamp().made : 0, true, impulses.stamp().launched};
}

template <class R, class Mem, class Solution>
void set_solved(Rows<R, Mem> const& rows, Impulses<R, Mem>& impulses, Solution& solution) {
  set_solved(rows, impulses);
  if constexpr (requires { solution.stamp().own; }) {
    if (!solution.stamp.data()) return;
    detail::SolutionStamp& stamp = solution.stamp();
    stamp.own = !rows.stamp.data() || !rows.stamp().made;
    if (!stamp.own) stamp.state = rows.stamp().state;
  }
}

namespace detail {
/// Rows that were written, and have not been solved for.
template <class R, class Mem>
void leaves_rows(Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses, RowsStamp stamp) {
  stamp.made = next_moment();
  stamp.impacts_left = rows.impact.data() != nullptr;
  if (rows.stamp.data()) rows.stamp() = stamp;
  if (impulses.stamp.data()) impulses.stamp() = {rows.stamp.data() ? rows.stamp().made : 0, false, impulses.stamp().launched};
}
/// A step without constraints: rows that were never written are none, and solved for; those of an earlier step are not this step's.
template <class R, class Mem>
void leaves_no_rows(Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses) {
  if (!rows.stamp.data() || !impulses.stamp.data()) return;
  impulses.stamp() = {rows.stamp().made, rows.stamp().made == 0, impulses.stamp().launched};
}
/// The rows were assembled, or are a user's own.
template <class R, class Mem>
void expects_assembled(char const* where, Rows<R, Mem> const& rows) {
  if (rows.stamp.data() && !rows.stamp().made)
    throw std::invalid_argument(std::string(where) +
                                ": the rows have not been written: call assemble first (of rows that you fill yourself: rows.stamp = {})");
}
/// Steps that were launched have been waited for.
template <class R, class Mem>
void expects_settled(char const* where, Impulses<R, Mem> const& impulses) {
  if (impulses.stamp.data() && impulses.stamp().launched)
    throw std::invalid_argument(std::string(where) +
                                ": steps were launched, and whether they have fitted is not known yet: call settle(exec, sim) first, and "
                                "launch again what it says is left");
}
/// The impulses are the solution of these rows, as they are now.
template <class R, class Mem>
void expects_solved(char const* where, Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses) {
  expects_room(where, rows);
  if (!rows.stamp.data() || !impulses.stamp.data()) return;
  if (!impulses.stamp().solved && !rows.stamp().made)
    throw std::invalid_argument(std::string(where) +
                                ": nothing has been solved yet: step first (or collide, assemble, and pgs; profile mujoco: newton)");
  if (!impulses.stamp().solved)
    throw std::invalid_argument(std::string(where) +
                                ": the rows have not been solved for since they were last assembled: step first (or call pgs; profile "
                                "mujoco: newton)");
  if (impulses.stamp().rows != rows.stamp().made)
    throw std::invalid_argument(std::string(where) + ": the impulses are of other rows, or of these before they were assembled again: " +
                                "step first (or call pgs with both; of a tile that shares, in the same call of f)");
}
template <class R, class Mem>
void expects_readable(char const* where, Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses) {
  expects_settled(where, impulses);
  expects_solved(where, rows, impulses);
}
/// The list that was assembled had an nth type of this name. Of a list with none there are no impulses: of many lists one reads.
template <class R, class Mem>
void expects_nth(Rows<R, Mem> const& rows, std::uint32_t name, int nth) {
  TypeNames const* const types = rows.stamp.data() ? &rows.stamp().types : nullptr;
  int there = 0;
  if (types) {
    auto const end = types->name + types->count;
    while (std::find(types->name, end, nth_name(name, there)) != end) ++there;
  }
  bool const known = types && types->count > 0;
  if (nth < 0 || (known && nth > 0 && nth >= there))
    throw std::invalid_argument("gsp::impulses_of: number " + std::to_string(nth) + " of this constraint type is asked for" +
                                (known ? ", and the list that was assembled has " + std::to_string(there) : "") + ": they count from 0");
}
}  // namespace detail

/// Enlarges the pools by half beyond what the last `assemble` needed, where it did not fit, and lets the step be repeated (halt = 0).
/// Impulses for the warm start are kept. Fences `exec`. Returns whether anything grew.
template <ExecutionSpace Exec, class R, class Mem>
bool grow(Exec const& exec, Rows<R, Mem>& rows, Impulses<R, Mem>& impulses, Progress<Mem>& progress) {
  auto const demand = detail::to_host(exec, rows.demand);
  detail::zero(exec, progress.halt);
  if (impulses.stamp.data()) impulses.stamp().launched = false;
  bool const more_rows = demand[0] > rows.capacity() || demand[0] > impulses.capacity();
  bool const more_entries = demand[1] > std::int64_t(rows.Y.extent(0));
  if (!more_rows && !more_entries) return false;
  std::int64_t const room = more_rows ? demand[0] + demand[0] / 2 : 0;
  detail::allocate_impulses(exec, impulses, room);
  detail::allocate_rows(exec, rows, room, more_entries ? demand[1] + demand[1] / 2 : 0);
  if (impulses.stamp.data()) impulses.stamp().solved = false;
  return true;
}

/// Impulses of the elements of one constraint type, to be read on the device after `pgs` (or after `step`) and before the next `assemble`.
template <class R, class Mem>
struct ElementImpulses {
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  std::uint32_t name;

  /// Row::type of the rows of this type, -1 where the list had none.
  KOKKOS_INLINE_FUNCTION int type() const {
    int place = 0;
    int const side = impulses.parity();
    for (; impulses.type_names(place, side) != name; ++place)
      if (impulses.type_names(place, side) == 0) return -1;
    return place;
  }
  /// First row in Rows::row that is not before those of element k of the type at `type`; `kept`: among those of islands that sleep. Cost: a
  /// binary search.
  KOKKOS_INLINE_FUNCTION int lower_row(int world, int type, int k, bool kept = false) const {
    int low = rows.first(world) + (kept ? rows.count(world) : 0);
    for (int high = low + (kept ? rows.kept(world) : rows.count(world)); low < high;) {
      int const middle = low + (high - low) / 2;
      Row<R> const& row = rows.row(middle);
      if (row.type < type || (row.type == type && row.element < k))
        low = middle + 1;
      else
        high = middle;
    }
    return low;
  }
  /// First row of element k in Rows::row, -1 where it had no rows. Cost: a binary search.
  KOKKOS_INLINE_FUNCTION int first_row(int world, int k) const {
    int const type = this->type();
    if (type < 0) return -1;
    int const middle = rows.first(world) + rows.count(world);
    auto const found = [&](int row, int end) { return row < end && rows.row(row).type == type && rows.row(row).element == k; };
    if (int const low = lower_row(world, type, k); found(low, middle)) return low;
    if (rows.kept(world) == 0) return -1;
    int const low = lower_row(world, type, k, true);
    return found(low, middle + rows.kept(world)) ? low : -1;
  }
  /// Impulse of row r of element k [N s, N m s]; 0 where the element was not active or has no such row. Divided by the timestep: the force.
  KOKKOS_INLINE_FUNCTION R operator()(int world, int k, int r = 0) const {
    int const first = first_row(world, k);
    return first < 0 || r >= rows.element_rows(first) ? R(0) : impulses.p[impulses.parity()](first + r);
  }
};

/// The impulses of constraint type `Type`, of the nth of that type in the list that was assembled; 0 throughout where the list had none
/// at all. Errors: std::invalid_argument where nothing has been solved since the rows were last assembled, where steps were launched and
/// not settled, and for an nth below 0 or above what the list had.
template <class Type, class R, class Mem>
ElementImpulses<R, Mem> impulses_of(Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses, int nth = 0) {
  detail::expects_readable("gsp::impulses_of", rows, impulses);
  detail::expects_nth(rows, detail::type_name<Type>(), nth);
  return {rows, impulses, detail::nth_name(detail::type_name<Type>(), nth)};
}

}  // namespace gsp
