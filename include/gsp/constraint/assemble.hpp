#pragma once
#include <gsp/constraint/detail/count_rows.hpp>
#include <gsp/constraint/detail/emit_rows.hpp>
#include <gsp/constraint/detail/keep_rows.hpp>
#include <gsp/constraint/eliminate.hpp>
#include <gsp/core/region.hpp>
#include <gsp/parallel/scan.hpp>

/// All constraint types to one list of rows a world: count -> scan -> emit, in the order of the types, then of the elements. Nothing waits
/// for the host.
namespace gsp {

template <class R, class Mem>
struct ContactRows;  // constraint/contact_rows.hpp
template <class R, class Mem>
struct StiffForces;  // constraint/stiff_forces.hpp

/// Constraint types one after the other, as a list that kernels can walk: `constraints(JointLimits(model, state), Tether{...})`.
template <class... C>
struct ConstraintList {
  KOKKOS_INLINE_FUNCTION int count(int) const { return 0; }
  KOKKOS_INLINE_FUNCTION bool counts_are_valid(int) const { return true; }
  KOKKOS_INLINE_FUNCTION std::uint32_t status(int) const { return 0; }
  template <class World>
  KOKKOS_INLINE_FUNCTION void prepare(World const&) const {}
  template <class F>
  KOKKOS_INLINE_FUNCTION void visit(int, int, int, F const&) const {}
  template <class F>
  KOKKOS_INLINE_FUNCTION void each(int, int, F const&) const {}
  template <class F>
  KOKKOS_INLINE_FUNCTION void visit_type(int, F const&) const {}
};
template <class Head, class... Tail>
struct ConstraintList<Head, Tail...> {
  static constexpr bool like = detail::LikeConstraint<Head>;
  static_assert(like,
                "gsp::constraints: an argument is neither a constraint type (constraint_type.hpp says what one is) "
                "nor, for step and launch_step, an actuator law (dynamics/actuator_law.hpp): copyable, with `X force(gsp::WorldLane<T> "
                "const& world, int actuator, T control, X length, X velocity) const` of any T and X");
  static_assert(!like || std::copyable<Head>,
                "gsp::constraints: a constraint type is copied to the device; give it views and numbers, no references");
  static_assert(!like || detail::ConstraintCount<Head>,
                "gsp::constraints: the constraint type has no `int count(int world) const`: its elements in a world");
  static_assert(!like || detail::ConstraintRows<Head>,
                "gsp::constraints: the constraint type has no `int rows(int world, int k) const`: rows of element k; the base "
                "gsp::OneFreeRow brings rows, bounds and id");
  static_assert(!like || detail::ConstraintJacobian<Head>,
                "gsp::constraints: the constraint type has no `R jacobian(int world, int k, int row, Row&& J) const`, Row any type and R "
                "float or double: writes J, returns the gap");
  static_assert(!like || detail::ConstraintLaw<Head>,
                "gsp::constraints: the constraint type has neither `T lambda(int world, int k, int row, T x, T u) const` of any T, its "
                "force, nor `gsp::RowLaw<R> law(int world, int k, int row, R x, R u, R h) const`");
  static_assert(!like || detail::ConstraintBounds<Head>,
                "gsp::constraints: the constraint type has no `gsp::RowBounds<R> bounds(int world, int k, int row) const`; the base "
                "gsp::OneFreeRow brings rows, bounds and id");
  static_assert(!like || detail::ConstraintId<Head>,
                "gsp::constraints: the constraint type has no `gsp::RowId id(int world, int k) const`: who the element is from step to "
                "step; the base gsp::OneFreeRow brings rows, bounds and id");
  Head head;
  ConstraintList<Tail...> tail;
  KOKKOS_INLINE_FUNCTION int own(int world) const {
    int const n = int(head.count(world));
    return n > 0 ? n : 0;
  }
  KOKKOS_INLINE_FUNCTION int count(int world) const { return own(world) + tail.count(world); }
  /// Whether no type has fewer elements than none.
  KOKKOS_INLINE_FUNCTION bool counts_are_valid(int world) const { return int(head.count(world)) >= 0 && tail.counts_are_valid(world); }
  /// Status bits of the contacts that the types hold: where their pool was too small, elements are missing.
  KOKKOS_INLINE_FUNCTION std::uint32_t status(int world) const {
    if constexpr (requires { std::uint32_t(head.contacts.status(world)); })
      return head.contacts.status(world) | tail.status(world);
    else
      return tail.status(world);
  }
  /// What types find out once for all of their elements of a world.
  template <class World>
  KOKKOS_INLINE_FUNCTION void prepare(World const& world) const {
    if constexpr (requires { head.prepare(world); }) head.prepare(world);
    tail.prepare(world);
  }
  /// f(type, place of the type, element of the type) for element `e` of the world
  template <class F>
  KOKKOS_FORCEINLINE_FUNCTION void visit(int world, int e, int place, F const& f) const {
    int const n = own(world);
    if (e < n)
      f(head, place, e);
    else
      tail.visit(world, e - n, place + 1, f);
  }
  /// f(type, place of the type, element of the type) for all elements of the world, in order
  template <class F>
  KOKKOS_INLINE_FUNCTION void each(int world, int place, F const& f) const {
    for (int k = 0, n = own(world); k < n; ++k) f(head, place, k);
    tail.each(world, place + 1, f);
  }
  /// f(type) for the type at `place`
  template <class F>
  KOKKOS_FORCEINLINE_FUNCTION void visit_type(int place, F const& f) const {
    if (place == 0)
      f(head);
    else
      tail.visit_type(place - 1, f);
  }
};

/// The list of these types.
inline ConstraintList<> constraints() { return {}; }
template <class Head, class... Tail>
ConstraintList<Head, Tail...> constraints(Head const& head, Tail const&... tail) {
  static_assert(sizeof...(Tail) < most_constraint_types, "gsp::constraints: at most 32 constraint types");
  return {head, constraints(tail...)};
}

namespace detail {
/// Names of the types of a list, all different.
template <class... Types>
constexpr TypeNames names_of(ConstraintList<Types...> const&) {
  constexpr TypeNames names = [] {
    TypeNames result;
    std::uint32_t const kind[] = {type_name<Types>()..., 0};
    for (constexpr int n = sizeof...(Types); n > result.count; ++result.count) {
      int before = 0;
      for (int s = 0; s < result.count; ++s) before += kind[s] == kind[result.count];
      result.name[result.count] = nth_name(kind[result.count], before);
    }
    return result;
  }();
  constexpr bool different = [&] {
    for (int t = 0; names.count > t; ++t)
      for (int s = 0; s < t; ++s)
        if (names.name[s] == names.name[t]) return false;
    return true;
  }();
  static_assert(different, "gsp::assemble: two constraint types have the same number by chance: rename one of your own");
  return names;
}

inline void expects_worlds_of_type(char const* member, int worlds, int of_state) {
  if (worlds != of_state)
    throw std::invalid_argument("gsp::assemble: a constraint type's `" + std::string(member) + "` have " + std::to_string(worlds) +
                                " worlds, and the state has " + std::to_string(of_state) + ": make both with the same {.worlds = n}");
}
/// Poses, contacts and quantities of the dynamics that the types hold are of this state, as it is now; of those that are not gsp's, of as
/// many worlds.
template <class State>
void expects_inputs_of(ConstraintList<> const&, State const&) {}
template <class Head, class... Tail, class State>
void expects_inputs_of(ConstraintList<Head, Tail...> const& types, State const& state) {
  if constexpr (requires { types.head.poses.xpos.extent(0); })
    expects_worlds_of_type("poses", int(types.head.poses.xpos.extent(0)), state.worlds);
  if constexpr (requires { types.head.contacts.worlds; }) expects_worlds_of_type("contacts", types.head.contacts.worlds, state.worlds);
  if constexpr (requires { types.head.poses.stamp().bodies; }) expects_poses_of("gsp::assemble", types.head.poses, state);
  if constexpr (requires { types.head.reads().bits; }) expects_of("gsp::assemble", types.head, state, types.head.reads());
  if constexpr (requires { types.head.contacts.stamp().made; })
    if (auto const& contacts = types.head.contacts; contacts.stamp.data()) {
      if (!contacts.stamp().made)
        throw std::invalid_argument(
            "gsp::assemble: the contacts have not been written: call collide first (of contacts that you fill yourself: contacts.stamp = "
            "{})");
      if (contacts.stamp().lost)
        throw std::invalid_argument("gsp::assemble: the contacts were lost when their pools grew: call collide again");
      if (contacts.stamp().pool != contacts.dist.data())
        throw std::invalid_argument(
            "gsp::assemble: the pools of the contacts have grown since a constraint type was made of them, and it has the old ones: make "
            "it anew (ContactRows(...), ContactAdhesion(...)) before each call");
      Stamp const& found = contacts.stamp().poses;
      if (found.qpos && !found.is_of(state))
        throw std::invalid_argument(std::string("gsp::assemble: the contacts ") + found.fault(state.qpos.data()) +
                                    ": call forward_kinematics (or smooth_dynamics) and collide first");
    }
  expects_inputs_of(types.tail, state);
}
/// Whether some law of a list may have a restitution.
inline bool may_bounce(ConstraintList<> const&) { return false; }
template <class Head, class... Tail>
bool may_bounce(ConstraintList<Head, Tail...> const& types) {
  if constexpr (requires { types.head.bounces(); })
    if (types.head.bounces()) return true;
  return may_bounce(types.tail);
}
/// What the rows' stamp says of the first ContactRows of a list.
template <class R, class Mem>
RowsStamp contacts_of(ConstraintList<> const&) {
  return {};
}
template <class R, class Mem, class Head, class... Tail>
RowsStamp contacts_of(ConstraintList<Head, Tail...> const& types) {
  if constexpr (std::is_same_v<Head, ContactRows<R, Mem>>)
    return {.contacts = types.head.contacts.stamp.data() ? types.head.contacts.stamp().made : 0,
            .contact_elements = types.head.elements,
            .pyramids = types.head.pyramid};
  else
    return contacts_of<R, Mem>(types.tail);
}
/// What the types ask of the dynamics for which rows they have, and what these touch.
inline Quantities reads_of(ConstraintList<> const&) { return {}; }
template <class Head, class... Tail>
Quantities reads_of(ConstraintList<Head, Tail...> const& types) {
  if constexpr (requires { types.head.reads().bits; })
    return types.head.reads() | reads_of(types.tail);
  else
    return reads_of(types.tail);
}
/// `assemble`, in two queues.
/// @param laying  where rows are counted and laid out, after what their types read there
/// @param join    what has been launched in `laying` comes before what will be in `exec`
/// @param beside_making  launches in `laying` what reads where rows lie and which elements they have, while they are made
template <class Exec, class Join, class BesideMaking, class R, class Mem, class... Types>
void assemble_in(Exec const& exec, Exec const& laying, Join const& join, BesideMaking const& beside_making, Model<R, Mem> const& model,
                 State<R, Mem>& state, Dynamics<R, Mem> const& dynamics, ConstraintList<Types...> const& types, Rows<R, Mem>& rows,
                 Impulses<R, Mem>& impulses, Progress<Mem>& progress, SleepingIslands<Mem> const& sleeping);
}  // namespace detail

/// Fills `rows` with the active rows of all types of the list, in their order, whitened with the factored matrix, and `impulses` with a
/// start: last step's impulses by identity (type, RowId), for new elements by place where the type has `place`, else 0, as in worlds that
/// were reset. Says which trees these rows make one and what an island weighs (`Rows::islands`, `Rows::tree_mass`). A type is known by its
/// C++ type and by its place among those of the same type: the others may come, go and change places. After factor or smooth_dynamics (and
/// collide). A world whose rows do not fit has status::row_overflow; then no world is stepped (progress.halt), the pools grow at the host's
/// next `settle` or `grow`, and the step is repeated: no result depends on a capacity. Rows of more than two trees, elements of more than
/// six rows, friction of a row that the element does not have, laws that are not finite or of negative compliance at a finite state, a
/// restitution outside of 0 to 1 or of rows that are soft, pull or have no room for it, bounds that are NaN or change places (lower >
/// upper), a negative mu, and in profile mujoco what no cone is (docs/add_a_constraint.md): status::row_refused.
/// @param sleeping  islands that sleep (step/sleep.hpp): those that something awake touches are woken, the others have no rows and keep
///                  their impulses
/// Cost about (entries of the row)^2 flop a row; on a device 12 an entry and body, and of each tree the square of every dof's depth and 12
/// a pair of a dof and one that moves it. Does not allocate, does not fence. Errors: std::invalid_argument where the dynamics, or the
/// members `poses` and `contacts` of a type and what it `reads()` of dynamics of its own, are not of this state as it is now, have not been
/// written (contacts), or are of another number of worlds; on a device gsp::Error for trees of all worlds with more than 2^30 columns.
template <ExecutionSpace Exec, class R, class Mem, class... Types>
void assemble(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Dynamics<R, Mem> const& dynamics,
              ConstraintList<Types...> const& types, Rows<R, Mem>& rows, Impulses<R, Mem>& impulses, Progress<Mem>& progress,
              SleepingIslands<Mem> const& sleeping = {}) {
  detail::assemble_in(
      exec, exec, [] {}, [] {}, model, state, dynamics, types, rows, impulses, progress, sleeping);
}

namespace detail {
template <class Exec, class Join, class BesideMaking, class R, class Mem, class... Types>
void assemble_in(Exec const& exec, Exec const& laying, Join const& join, BesideMaking const& beside_making, Model<R, Mem> const& model,
                 State<R, Mem>& state, Dynamics<R, Mem> const& dynamics, ConstraintList<Types...> const& types, Rows<R, Mem>& rows,
                 Impulses<R, Mem>& impulses, Progress<Mem>& progress, SleepingIslands<Mem> const& sleeping) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::assemble: the rows are not accessible from this execution space");
  expects_as_many("gsp::assemble", "worlds", "make them with the same {.worlds = n}", Count{"state", state.worlds},
                  Count{"dynamics", dynamics.worlds}, Count{"rows", rows.worlds}, Count{"impulses", impulses.worlds});
  expects(rows.nv == model.nv && rows.profile == model.profile,
          "gsp::assemble: the rows were made for another model: call make_rows(exec, model), or make_simulation with it");
  expects_fit("gsp::assemble", model, state, dynamics);
  expects_of("gsp::assemble", dynamics, state, set_of(Quantity::motion, Quantity::velocity, Quantity::factor, Quantity::free_velocity));
  expects_without_impulses("gsp::assemble", dynamics);
  expects_inputs_of(types, state);
  expects(!may_bounce(types) || rows.impact.data(),
          "gsp::assemble: some rows have a restitution, and there is no room for it: make_rows(exec, model, {.impacts = true}) "
          "(make_simulation: the same), and impacts before pgs");
  if (leaves_stiff_forces(dynamics) && !(std::is_same_v<Types, StiffForces<R, Mem>> || ...))
    throw std::invalid_argument(
        "gsp::assemble: stiff springs and servos were left to rows (stiff_rows), and the list has none for them: add "
        "StiffForces(model, state, dynamics)");
  Region const region("gsp::constraint::assemble");
  using List = ConstraintList<Types...>;
  if constexpr (is_device<Exec>) launch_threads("gsp::constraint::whiten_trees", exec, WhitenTrees<R, Mem>(model, dynamics, progress));
  if (sleeping.any())
    for_worlds("gsp::constraint::wake_islands", laying, rows.worlds,
               WakeIslands<R, Mem, List>{model, sleeping, types, (rests<Types>() && ...)});
  PlaceRows<R, Mem> const place{progress.halt, impulses.parity, impulses.solved, std::min(rows.capacity(), impulses.capacity())};
  for_worlds("gsp::constraint::count_rows", laying, rows.worlds, CountRows<R, Mem, List>{model, state, rows, place, types, sleeping});
  if (rows.worlds > 1) scan_items("gsp::constraint::scan_rows", laying, rows.worlds, ScanRows<R, Mem>{rows, state, place});
  EmitRows<R, Mem, List> const emit{model, state, dynamics, rows, impulses, progress.halt, types, names_of(types), sleeping};
  for_worlds("gsp::constraint::emit_rows", laying, rows.worlds, emit);
  join();
  if constexpr (is_device<Exec>) {
    launch_threads("gsp::constraint::start_rows", laying, StartRows<R, Mem, List>{emit});
    beside_making();
    launch_threads("gsp::constraint::make_rows", exec, MakeRows<R, Mem, List>{emit});
    join();  // finish_rows writes whole Rows
    launch_threads("gsp::constraint::finish_rows", exec, FinishRows<R, Mem, List>{emit});
  }
  if (sleeping.any()) for_worlds("gsp::constraint::keep_rows", exec, rows.worlds, KeepRows<R, Mem, List>{emit});
  eliminate_rows(exec, model, progress, rows, impulses);
  RowsStamp stamp = contacts_of<R, Mem>(types);
  stamp.state.set(state);
  stamp.sleeps = sleeping.any();
  stamp.types = names_of(types);
  leaves_rows(rows, impulses, stamp);
}
}  // namespace detail

}  // namespace gsp
