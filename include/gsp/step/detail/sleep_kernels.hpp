#pragma once
#include <gsp/constraint/rows.hpp>
#include <gsp/core/status.hpp>
#include <gsp/dynamics/dynamics.hpp>
#include <gsp/model/state.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/step/detail/sleep_rules.hpp>

/// The kernels of step/sleep.hpp, where the contract stands.
namespace gsp::detail {

/// Where the numbers of a tree lie in qpos and qvel.
template <class R, class Mem>
struct TreeRange {
  int qpos0, nq, dof0, nv;
  KOKKOS_INLINE_FUNCTION TreeRange(Model<R, Mem> const& model, int t) {
    Archetype const& a = model.archetypes(model.tree_archetype(t));
    qpos0 = model.ints(a.instance_qpos + model.tree_instance(t));
    nq = a.nq;
    dof0 = model.tree_dof(t);
    nv = a.nv;
  }
};

template <class Sleep, class R, class Mem>
struct WakeChanged {
  Model<R, Mem> model;
  State<R, Mem> state;
  Dynamics<R, Mem> dynamics;
  Sleep sleep;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank, ntree = model.ntree;
    auto const& islands = sleep.islands;
    bool const begins = state.steps(w) == 0;  // was reset
    int const switched =
        world.template sum<int>(model.neq, [&](int k) { return int(state.eq_active(w, k) != sleep.state.eq_before(w, k)); });
    int const steered = world.template sum<int>(model.nu, [&](int k) { return int(state.ctrl(w, k) != sleep.state.ctrl_before(w, k)); }) +
                        world.template sum<int>(model.na, [&](int k) { return int(state.act(w, k) != sleep.state.act_before(w, k)); });
    int const led = world.template sum<int>(model.nmocap, [&](int m) { return int(moves(w, m)); });
    int const magnets = int(model.adhesion_body.extent(0));  // those that no tree moves hold what they hold by rows alone
    int const fixed =
        world.template sum<int>(steered > 0 ? magnets : 0, [&](int i) { return int(model.body_tree(model.adhesion_body(i)) < 0); });
    bool const all = begins || switched > 0 || fixed > 0;
    world.each(ntree, [&](int t) { islands.wakes(w, t) = 0; });
    world.sync();
    world.each(ntree, [&](int t) {
      sleep.still(w, t) = remember(w, t);
      int const island = sleep.state.island_of(w, t);
      if (begins && island < 0) sleep.state.calm(w, t) = 0;
      if (island < 0) return;
      bool const controls = steered > 0 && SleepPolicy(sleep.policy(t)) == SleepPolicy::with_actuators;
      if (all || controls || (led > 0 && sleep.hangs(t)) || is_changed(w, t)) islands.wakes(w, island) = 1;
    });
    world.sync();
    world.each(ntree, [&](int t) {
      int const island = sleep.state.island_of(w, t);
      bool const sleeps = island >= 0 && !islands.wakes(w, island);
      islands.island(w, t) = sleeps ? island : -1;
      if (!sleeps) sleep.still(w, t) = 0;
    });
  }

 private:
  /// Whether mocap body m is elsewhere than it was in the last step.
  KOKKOS_INLINE_FUNCTION bool moves(int w, int m) const {
    bool same = true;
    for (int i = 0; i < 3; ++i) same = same && state.mocap_pos(w, m, i) == sleep.state.mocap_pos_before(w, m, i);
    for (int i = 0; i < 4; ++i) same = same && state.mocap_quat(w, m, i) == sleep.state.mocap_quat_before(w, m, i);
    return !same;
  }
  /// Positions, for the next step; whether they are what they were.
  KOKKOS_INLINE_FUNCTION bool remember(int w, int t) const {
    TreeRange<R, Mem> const at(model, t);
    bool same = true;
    for (int i = at.qpos0; i < at.qpos0 + at.nq; ++i) {
      same = same && sleep.qpos_before(w, i) == state.qpos(w, i) && sleep.qpos_low_before(w, i) == state.qpos_low(w, i);
      sleep.qpos_before(w, i) = state.qpos(w, i);
      sleep.qpos_low_before(w, i) = state.qpos_low(w, i);
    }
    return same;
  }
  /// Compares, and remembers the free velocity of the first step.
  KOKKOS_INLINE_FUNCTION bool is_changed(int w, int t) const {
    TreeRange<R, Mem> const at(model, t);
    bool changed = false;
    for (int i = at.qpos0; i < at.qpos0 + at.nq; ++i)
      changed = changed || state.qpos(w, i) != sleep.state.qpos(w, i) || state.qpos_low(w, i) != sleep.state.qpos_low(w, i);
    TreeItems<R> const items = dynamics.tree(model, w, t);
    for (int i = 0; i < at.nv; ++i) {
      int const dof = at.dof0 + i;
      R const velocity = items[items.at.velocity + i];
      R& before = sleep.state.free_velocity(w, dof);
      changed = changed || state.qvel(w, dof) != R(0) || state.qfrc_applied(w, dof) != R(0);
      if (before != before) before = velocity;
      changed = changed || velocity != before;
    }
    return changed;
  }
};

template <class Mem, class Mask>
struct WakeWorlds {
  Kokkos::View<int**, Kokkos::LayoutRight, Mem> calm;
  Kokkos::View<int*, Kokkos::LayoutRight, Mem> asleep;
  Mask mask;
  KOKKOS_FUNCTION void operator()(int w) const {
    if (!mask(w)) return;
    for (int t = 0; t < int(calm.extent(1)); ++t) calm(w, t) = 0;
    asleep(w) = 0;
  }
};

template <class Sleep, class R, class Mem>
struct FallAsleep {
  Model<R, Mem> model;
  Rows<R, Mem> rows;
  Kokkos::View<int, Mem> halt;
  State<R, Mem> state;
  Dynamics<R, Mem> dynamics;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> force;
  Sleep sleep;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank, ntree = model.ntree;
    if (halt() || (state.status(w) & status::stopped)) return;
    auto const& islands = sleep.islands;
    world.each(ntree, [&](int t) {
      if (islands.island(w, t) >= 0) return lie_still(w, t);
      int const before = sleep.state.calm(w, t) > 0 ? sleep.state.calm(w, t) : 0;
      sleep.state.calm(w, t) = rests(w, t) ? (before < sleep.steps ? before + 1 : before) : 0;
    });
    world.each(model.nu, [&](int k) { sleep.state.ctrl_before(w, k) = state.ctrl(w, k); });
    world.each(model.na, [&](int k) { sleep.state.act_before(w, k) = state.act(w, k); });
    world.each(model.neq, [&](int k) { sleep.state.eq_before(w, k) = state.eq_active(w, k); });
    world.each(model.nmocap, [&](int m) {
      for (int i = 0; i < 3; ++i) sleep.state.mocap_pos_before(w, m, i) = state.mocap_pos(w, m, i);
      for (int i = 0; i < 4; ++i) sleep.state.mocap_quat_before(w, m, i) = state.mocap_quat(w, m, i);
    });
    world.sync();
    if (world.template sum<int>(ntree, [&](int t) { return int(sleep.state.calm(w, t) >= sleep.steps); }) > 0) {
      int const* const label = rows.islands.label(w);
      world.each(ntree, [&](int t) { islands.wakes(w, t) = 0; });
      world.sync();
      world.each(ntree, [&](int t) {
        if (!sleep.state.sleeps(w, t) && sleep.state.calm(w, t) < sleep.steps) islands.wakes(w, label[t]) = 1;
      });
      world.sync();
      world.each(ntree, [&](int t) {
        if (sleep.state.calm(w, t) >= sleep.steps && !islands.wakes(w, label[t])) lie_down(w, t, label[t]);
      });
      world.sync();
    }
    int const asleep = world.template sum<int>(ntree, [&](int t) { return int(sleep.state.sleeps(w, t)); });
    world.single([&] { sleep.asleep(w) = asleep; });
  }

 private:
  KOKKOS_INLINE_FUNCTION bool rests(int w, int t) const {
    if (SleepPolicy(sleep.policy(t)) == SleepPolicy::never || sleep.islands.stirred(w, t)) return false;
    TreeRange<R, Mem> const at(model, t);
    bool slow = true;
    for (int i = at.dof0; i < at.dof0 + at.nv; ++i)
      slow = slow && abs(state.qvel(w, i)) * sleep.dof_length(i) < sleep.tolerance && state.qfrc_applied(w, i) == R(0);
    return slow;
  }
  KOKKOS_INLINE_FUNCTION void stop(int w, int t, TreeRange<R, Mem> const& at) const {
    TreeItems<R> const items = dynamics.tree(model, w, t);
    for (int i = 0; i < at.nv; ++i) {
      state.qvel(w, at.dof0 + i) = R(0);
      items[items.at.velocity + i] = R(0);
    }
  }
  /// What integrate has moved goes back.
  KOKKOS_INLINE_FUNCTION void lie_still(int w, int t) const {
    TreeRange<R, Mem> const at(model, t);
    for (int i = at.qpos0; i < at.qpos0 + at.nq; ++i) {
      state.qpos(w, i) = sleep.state.qpos(w, i);
      state.qpos_low(w, i) = sleep.state.qpos_low(w, i);
    }
    for (int i = at.dof0; i < at.dof0 + at.nv; ++i) force(w, i) = sleep.state.force(w, i);
    stop(w, t, at);
  }
  KOKKOS_INLINE_FUNCTION void lie_down(int w, int t, int island) const {
    TreeRange<R, Mem> const at(model, t);
    sleep.state.lay_down(w, t, island);
    for (int i = at.qpos0; i < at.qpos0 + at.nq; ++i) {
      sleep.state.qpos(w, i) = state.qpos(w, i);
      sleep.state.qpos_low(w, i) = state.qpos_low(w, i);
    }
    for (int i = at.dof0; i < at.dof0 + at.nv; ++i) {
      sleep.state.free_velocity(w, i) = Kokkos::Experimental::quiet_NaN_v<R>;
      sleep.state.force(w, i) = force(w, i);
    }
    stop(w, t, at);
  }
};

}  // namespace gsp::detail
