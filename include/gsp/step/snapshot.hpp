#pragma once
#include <gsp/core/region.hpp>
#include <gsp/step/detail/snapshot_kernels.hpp>
#include <gsp/step/step.hpp>

/// All that the next step starts from: a simulation that is restored goes on as it would have, to the bit.
namespace gsp {

/// The impulses of the last step with their identities: what the next one starts from, world after world.
template <class R, class Mem>
struct SavedImpulses {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R*> p;                       // (capacity), as Impulses has them
  View<std::uint64_t*> id;          // (capacity)
  View<R* [3]> place;               // (capacity)
  View<int*> first, count, kept;    // (worlds)
  View<std::uint32_t*> type_names;  // (types); 0 after the last
};

/// Worlds at one moment, between two steps. `make_snapshot` allocates it; copies share its arrays. Not in it: the model with values of its
/// own per world, and options, which have to be the same for the same bits.
template <class R, class Mem>
struct Snapshot {
  using real_type = R;
  using memory_space = Mem;
  State<R, Mem> state;  // as a state of its own: `reset` may start from it, without impulses
  SavedImpulses<R, Mem> impulses;
  SleepState<R, Mem> sleep;  // empty: of a simulation in which nothing sleeps
};

/// Copies what the next step would start from, after `step` (or launch_step and settle). Waits and allocates only where the pool
/// of impulses has grown since the snapshot was made.
/// Errors: std::invalid_argument for a snapshot of another model, of another number of worlds, or with sleep where the simulation has
/// none, and where steps were launched and not settled.
template <ExecutionSpace Exec, class R, class Mem>
void save(Exec const& exec, State<R, Mem> const& state, Simulation<R, Mem> const& sim, Snapshot<R, Mem>& snapshot) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::save: the state is not accessible from this execution space");
  Region const region("gsp::step::save");
  detail::expects_fit("gsp::save", snapshot, state, sim);
  detail::expects_as_many("gsp::save", "worlds", "make_snapshot(exec, state, sim)", detail::Count{"snapshot", snapshot.state.worlds},
                          detail::Count{"state", state.worlds});
  expects((snapshot.sleep.calm.data() != nullptr) == (sim.sleep.worlds > 0),
          "gsp::save: one of snapshot and simulation has sleep, the other not: make_snapshot(exec, state, sim)");
  detail::moves_on(snapshot.state);
  detail::make_room(exec, sim.impulses.capacity(), snapshot.impulses);
  detail::copy_rows(exec, detail::pair_rows(state, snapshot.state, sim.sleep.state, snapshot.sleep), state.worlds, false,
                    detail::AllWorlds{});
  for_worlds("gsp::step::save_impulses", exec, state.worlds, detail::SaveImpulses<R, Mem>{sim.impulses, snapshot.impulses});
}

/// A snapshot of what the two hold now. Allocates.
template <ExecutionSpace Exec, class R, class Mem>
Snapshot<R, Mem> make_snapshot(Exec const& exec, State<R, Mem> const& state, Simulation<R, Mem> const& sim) {
  Snapshot<R, Mem> s;
  detail::allocate_snapshot(exec, state, sim, state.worlds, sim.impulses.capacity(), s);
  save(exec, state, sim, s);
  return s;
}

/// Worlds of the mask go on from the snapshot: what follows is what would have followed it, to the bit, in the same simulation or in one
/// that was made anew, whatever its pools hold. The other worlds do not notice. Between steps that are settled. Poses, contacts and rows
/// stay those of before until the next step (poses: or forward_kinematics), and impulses are not to be read until then. Fences; allocates
/// where the pool of impulses is too small. A snapshot without sleep leaves its worlds awake. Impulses of constraint types of your own are
/// known by their place in the list: where the list of the simulation's last step is another than the snapshot's, worlds of a mask start
/// without impulses.
/// @param snapshot  of as many worlds, or of one, which is given to all of the mask
/// @param mask      callable with a world, such as a View<bool*> on the device
/// Errors: std::invalid_argument for a snapshot of another model or number of worlds, a mask of another size, a snapshot with sleep
/// where the simulation has no room for it, and where steps were launched and not settled.
template <ExecutionSpace Exec, class R, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void restore(Exec const& exec, Snapshot<R, Mem> const& snapshot, State<R, Mem>& state, Simulation<R, Mem>& sim, Mask const& mask) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::restore: the state is not accessible from this execution space");
  Region const region("gsp::step::restore");
  detail::expects_fit("gsp::restore", snapshot, state, sim);
  expects(snapshot.sleep.calm.data() == nullptr || sim.sleep.worlds > 0,
          "gsp::restore: in the snapshot islands may sleep, and the simulation has no room for that: make_simulation with {.sleep = true}");
  detail::expects_mask("gsp::restore", mask, "state", state.worlds);
  bool const one = snapshot.state.worlds == 1, sleeps = snapshot.sleep.calm.data() != nullptr;
  auto const impulses = [&] { return detail::RestoredImpulses<R, Mem, Mask>{snapshot.impulses, sim.impulses, mask, one}; };
  std::int64_t rows = 0;
  Kokkos::parallel_scan("gsp::step::place_impulses", lightweight(Kokkos::RangePolicy<Exec>(exec, 0, state.worlds)),
                        detail::PlaceImpulses<R, Mem, Mask>{impulses()}, rows);
  exec.fence("gsp::restore: the host reads how many impulses there are");
  detail::make_room(exec, rows, sim.impulses);
  for_worlds("gsp::step::restore_impulses", exec, state.worlds, detail::RestoreImpulses<R, Mem, Mask>{impulses()});
  Kokkos::parallel_for("gsp::step::turn_impulses", Kokkos::RangePolicy<Exec>(exec, 0, 1), detail::TurnImpulses<R, Mem, Mask>{impulses()});
  if (sim.impulses.stamp.data()) sim.impulses.stamp().solved = false;
  detail::moves_on(state);
  if (!sleeps) wake(exec, sim.sleep, mask);
  detail::copy_rows(exec, detail::pair_rows(snapshot.state, state, snapshot.sleep, sleeps ? sim.sleep.state : SleepState<R, Mem>{}),
                    state.worlds, one, mask);
  if (sleeps)
    Kokkos::parallel_for("gsp::step::count_sleepers", Kokkos::RangePolicy<Exec>(exec, 0, state.worlds),
                         detail::CountSleepers<R, Mem>{sim.sleep.state, sim.sleep.asleep});
}

/// All worlds go on from the snapshot.
template <ExecutionSpace Exec, class R, class Mem>
void restore(Exec const& exec, Snapshot<R, Mem> const& snapshot, State<R, Mem>& state, Simulation<R, Mem>& sim) {
  restore(exec, snapshot, state, sim, detail::AllWorlds{});
}

}  // namespace gsp
