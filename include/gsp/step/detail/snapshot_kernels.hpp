#pragma once
#include <cstring>
#include <gsp/constraint/impulses.hpp>
#include <gsp/core/detail/views.hpp>
#include <gsp/fwd.hpp>
#include <gsp/model/state.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/step/sleep.hpp>
#include <limits>

/// Arrays and kernels of step/snapshot.hpp, where the contract stands.
namespace gsp {
template <class R, class Mem>
struct SavedImpulses;
template <class R, class Mem>
struct Snapshot;
}  // namespace gsp

namespace gsp::detail {

/// f(name, the view of each of these) for all that steps leave of a world: rows are worlds.
template <class F, class... States>
void each_state_view(F const& f, States&... s) {
  f("qpos", s.qpos...);
  f("qpos_low", s.qpos_low...);
  f("qvel", s.qvel...);
  f("ctrl", s.ctrl...);
  f("act", s.act...);
  f("mocap_pos", s.mocap_pos...);
  f("mocap_quat", s.mocap_quat...);
  f("eq_active", s.eq_active...);
  f("qfrc_applied", s.qfrc_applied...);
  f("steps", s.steps...);
  f("status", s.status...);
}
template <class F, class... Sleeps>
void each_sleep_view(F const& f, Sleeps&... s) {
  f("calm", s.calm...);
  f("qpos", s.qpos...);
  f("qpos_low", s.qpos_low...);
  f("free_velocity", s.free_velocity...);
  f("force", s.force...);
  f("ctrl_before", s.ctrl_before...);
  f("act_before", s.act_before...);
  f("eq_before", s.eq_before...);
  f("mocap_pos_before", s.mocap_pos_before...);
  f("mocap_quat_before", s.mocap_quat_before...);
}

template <class View>
int items_of_row(View const& v) {
  std::size_t n = 1;
  for (unsigned k = 1; k < View::rank(); ++k) n *= v.extent(k);
  return int(n);
}
template <class View>
void allocate_rows_like(View const& like, int worlds, View& v) {
  if constexpr (View::rank() == 1)
    v = allocate<View>(like.label(), worlds);
  else if constexpr (View::rank_dynamic() == 2)
    v = allocate<View>(like.label(), worlds, like.extent(1));
  else
    v = allocate<View>(like.label(), worlds, like.extent(1), like.extent(2));
}

/// Room for `worlds` worlds of such a state and simulation, and so many impulses.
template <class Exec, class R, class Mem>
void allocate_snapshot(Exec const& exec, State<R, Mem> const& state, Simulation<R, Mem> const& sim, int worlds, std::int64_t rows,
                       Snapshot<R, Mem>& s) {
  auto const like = [&](char const*, auto const& from, auto& to) { allocate_rows_like(from, worlds, to); };
  s.state.worlds = worlds;
  each_state_view(like, state, s.state);
  s.state.moment = allocate<decltype(s.state.moment)>("gsp::State::moment");
  moves_on(s.state);
  if (sim.sleep.worlds > 0) each_sleep_view(like, sim.sleep.state, s.sleep);
  auto& i = s.impulses;
  auto const make = [&](auto& v, char const* label, auto items) { v = allocate_zero<std::decay_t<decltype(v)>>(exec, label, items); };
  make(i.p, "gsp::Snapshot::p", rows);
  make(i.id, "gsp::Snapshot::id", rows);
  make(i.place, "gsp::Snapshot::place", rows);
  make(i.first, "gsp::Snapshot::first", worlds);
  make(i.count, "gsp::Snapshot::count", worlds);
  make(i.kept, "gsp::Snapshot::kept", worlds);
  make(i.type_names, "gsp::Snapshot::type_names", sim.impulses.type_names.extent(0));
}
/// Room for so many impulses in a pool; what there was is kept.
template <class Exec, class R, class Mem>
void make_room(Exec const& exec, std::int64_t rows, SavedImpulses<R, Mem>& i) {
  if (std::int64_t(i.p.extent(0)) >= rows) return;
  exec.fence("gsp::save: what was launched uses the pool as it was");
  enlarge(exec, i.p, "gsp::Snapshot::p", rows);
  enlarge(exec, i.id, "gsp::Snapshot::id", rows);
  enlarge(exec, i.place, "gsp::Snapshot::place", rows);
  exec.fence("gsp::save: the old pool may go");
}
template <class Exec, class R, class Mem>
void make_room(Exec const& exec, std::int64_t rows, Impulses<R, Mem>& i) {
  if (i.capacity() >= rows) return;
  if (rows > std::numeric_limits<int>::max())
    throw Error("gsp::restore: the worlds have more than 2147483647 impulses together: use fewer worlds a batch");
  allocate_impulses(exec, i, rows);
  exec.fence("gsp::restore: the old pool may go");
}

/// Snapshot and state are of one model, the snapshot of as many worlds or of one.
template <class R, class Mem>
void expects_fit(char const* where, Snapshot<R, Mem> const& snapshot, State<R, Mem> const& state, Simulation<R, Mem> const& sim) {
  expects_as_many(where, "worlds", "make them with the same {.worlds = n}", Count{"state", state.worlds},
                  Count{"simulation", sim.rows.worlds});
  if (sim.rows.nv != int(state.qvel.extent(1)))
    throw std::invalid_argument(std::string(where) + ": state and simulation are of different models: the one has " +
                                std::to_string(state.qvel.extent(1)) + " degrees of freedom, the other " + std::to_string(sim.rows.nv));
  expects_settled(where, sim.impulses);
  int const worlds = snapshot.state.worlds;
  if (worlds != state.worlds && worlds != 1)
    throw std::invalid_argument(std::string(where) + ": the snapshot has " + std::to_string(worlds) + " worlds and the state " +
                                std::to_string(state.worlds) + ": give one of as many worlds, or of one, which is given to all");
  auto const fits = [&](char const* name, auto const& from, auto const& to) {
    if (items_of_row(from) != items_of_row(to))
      throw std::invalid_argument(std::string(where) + ": a world of the snapshot has " + std::to_string(items_of_row(from)) +
                                  " numbers in " + name + " and one of the state " + std::to_string(items_of_row(to)) +
                                  ": the snapshot is of another model: make_snapshot(exec, state, sim)");
  };
  each_state_view(fits, snapshot.state, state);
  if (snapshot.sleep.calm.data() && sim.sleep.worlds > 0) each_sleep_view(fits, snapshot.sleep, sim.sleep.state);
}

/// Rows of several pairs of views, by words of four bytes.
struct RowPairs {
  static constexpr int most = 24;
  std::uint32_t const* from[most];
  std::uint32_t* to[most];
  int end[most];  // words of a world up to the end of this pair
  int count = 0;
  int words() const { return count > 0 ? end[count - 1] : 0; }
};
template <class States, class Sleeps>
RowPairs pair_rows(States const& from, States const& to, Sleeps const& sleep_from, Sleeps const& sleep_to) {
  RowPairs pairs;
  auto const add = [&](char const*, auto const& a, auto const& b) {
    int const words = items_of_row(b) * int(sizeof(*b.data()) / 4);
    if (words == 0 || !b.data()) return;
    int const before = pairs.words();
    pairs.from[pairs.count] = reinterpret_cast<std::uint32_t const*>(a.data());
    pairs.to[pairs.count] = reinterpret_cast<std::uint32_t*>(b.data());
    pairs.end[pairs.count++] = before + words;
  };
  each_state_view(add, from, to);
  each_sleep_view(add, sleep_from, sleep_to);
  return pairs;
}
template <class Mask>
struct CopyRows {
  RowPairs pairs;
  Mask mask;
  bool one;  // row 0 is given to all
  KOKKOS_FUNCTION void operator()(std::int64_t at) const {
    int const words = pairs.end[pairs.count - 1], w = int(at / words), word = int(at % words);
    if (!mask(w)) return;
    int k = 0, begin = 0;
    for (; pairs.end[k] <= word; ++k) begin = pairs.end[k];
    std::int64_t const size = pairs.end[k] - begin, row = one ? 0 : w;
    memcpy(pairs.to[k] + w * size + (word - begin), pairs.from[k] + row * size + (word - begin), 4);
  }
};
/// to = from for worlds of the mask. One launch.
template <class Exec, class Mask>
void copy_rows(Exec const& exec, RowPairs const& pairs, int worlds, bool one, Mask const& mask) {
  Kokkos::parallel_for("gsp::step::copy_worlds",
                       Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(worlds) * pairs.words()),
                       CopyRows<Mask>{pairs, mask, one});
}

/// The side of the impulses that the next step starts from.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION int last_side(Impulses<R, Mem> const& i) {
  return i.solved() ? i.parity() : 1 - i.parity();
}
template <class R, class Mem>
struct SaveImpulses {
  Impulses<R, Mem> from;
  SavedImpulses<R, Mem> to;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank, side = last_side(from), first = from.first[side](w), count = from.count[side](w), kept = from.kept[side](w);
    world.single([&] {
      to.first(w) = first;
      to.count(w) = count;
      to.kept(w) = kept;
    });
    world.each(count + kept, [&](int r) {
      to.p(first + r) = from.p[side](first + r);
      to.id(first + r) = from.id[side](first + r);
      for (int c = 0; c < 3; ++c) to.place(first + r, c) = from.place[side](first + r, c);
    });
    if (w == 0) world.each(int(to.type_names.extent(0)), [&](int t) { to.type_names(t) = from.type_names(t, side); });
  }
};

/// Where the impulses of each world come from: of worlds of the mask from the snapshot, of the others from the side that the next step
/// would have started from. They go to the other side, one world after the other.
template <class R, class Mem, class Mask>
struct RestoredImpulses {
  SavedImpulses<R, Mem> saved;
  Impulses<R, Mem> impulses;
  Mask mask;
  bool one;  // world 0 of the snapshot is given to all
  static constexpr bool all = std::is_same_v<Mask, AllWorlds>;

  KOKKOS_INLINE_FUNCTION int world_of(int w) const { return one ? 0 : w; }
  /// Whether the types are those of the snapshot: nothing else is there.
  KOKKOS_INLINE_FUNCTION bool takes_types(int side) const { return all || impulses.type_names(0, side) == 0; }
  /// Whether a row's identity, which has the place of its type, says the same in both.
  KOKKOS_INLINE_FUNCTION bool has_types(int side) const {
    if (takes_types(side)) return true;
    int const n = int(saved.type_names.extent(0));
    for (int t = 0; t < n && saved.type_names(t) == impulses.type_names(t, side); ++t)
      if (saved.type_names(t) == 0) return true;
    return false;
  }
};
template <class R, class Mem, class Mask>
struct PlaceImpulses : RestoredImpulses<R, Mem, Mask> {
  using value_type = std::int64_t;
  KOKKOS_FUNCTION void operator()(int w, value_type& sum, bool last) const {
    auto const& to = this->impulses;
    auto const& saved = this->saved;
    int const side = last_side(to), from = this->world_of(w);
    bool const chosen = this->mask(w), known = !chosen || this->has_types(side);
    int const count = !known ? 0 : chosen ? saved.count(from) : to.count[side](w);
    int const kept = !known ? 0 : chosen ? saved.kept(from) : to.kept[side](w);
    if (last) {
      to.first[1 - side](w) = int(sum);
      to.count[1 - side](w) = count;
      to.kept[1 - side](w) = kept;
    }
    sum += count + kept;
  }
};
template <class R, class Mem, class Mask>
struct RestoreImpulses : RestoredImpulses<R, Mem, Mask> {
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    auto const& i = this->impulses;
    auto const& saved = this->saved;
    int const w = world.rank, side = last_side(i), other = 1 - side, to = i.first[other](w), rows = i.count[other](w) + i.kept[other](w);
    bool const chosen = this->mask(w);
    int const from = chosen ? saved.first(this->world_of(w)) : i.first[side](w);
    world.each(rows, [&](int r) {
      i.p[other](to + r) = chosen ? saved.p(from + r) : i.p[side](from + r);
      i.id[other](to + r) = chosen ? saved.id(from + r) : i.id[side](from + r);
      for (int c = 0; c < 3; ++c) i.place[other](to + r, c) = chosen ? saved.place(from + r, c) : i.place[side](from + r, c);
    });
  }
};
/// The other side is that of the last step from here on.
template <class R, class Mem, class Mask>
struct TurnImpulses : RestoredImpulses<R, Mem, Mask> {
  KOKKOS_FUNCTION void operator()(int) const {
    auto const& i = this->impulses;
    int const side = last_side(i), n = int(this->saved.type_names.extent(0));
    bool const takes = this->takes_types(side);
    for (int t = 0; t < n; ++t) i.type_names(t, 1 - side) = takes ? this->saved.type_names(t) : i.type_names(t, side);
    i.parity() = 1 - side;
    i.solved() = 1;
  }
};

template <class R, class Mem>
struct CountSleepers {
  SleepState<R, Mem> state;
  Kokkos::View<int*, Kokkos::LayoutRight, Mem> asleep;
  KOKKOS_FUNCTION void operator()(int w) const {
    int n = 0;
    for (int t = 0; t < int(state.calm.extent(1)); ++t) n += state.sleeps(w, t);
    asleep(w) = n;
  }
};

}  // namespace gsp::detail
