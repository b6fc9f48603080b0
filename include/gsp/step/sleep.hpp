#pragma once
#include <gsp/collision/contacts.hpp>
#include <gsp/constraint/islands.hpp>
#include <gsp/constraint/progress.hpp>
#include <gsp/constraint/rows.hpp>
#include <gsp/core/region.hpp>
#include <gsp/step/detail/sleep_kernels.hpp>

/// Islands that rest sleep: they stay where they are to the bit, without rows and with the contacts they had, until something wakes them.
/// MuJoCo's rules (docs/step/sleep.md says where they differ).
namespace gsp {

struct SleepOptions {
  int worlds = 1;
  double tolerance = 0;  // [m/s] of max |qvel| dof_length; 0: as the file says (<option sleep_tolerance>)
  int steps = 10;        // below it, before a tree may sleep
};

/// Who sleeps, and what is compared with it to find what wakes. With the impulses and the state (qpos, qpos_low, qvel, act, steps, status,
/// and what is given to it: ctrl, qfrc_applied, eq_active, mocap_pos, mocap_quat) it is all that the next step starts from: save and
/// restore (step/snapshot.hpp) copy it.
template <class R, class Mem>
struct SleepState {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<int**> calm;                                // (worlds, ntree) steps of rest, up to Sleep::steps; below 0: asleep, see island_of
  View<R**> qpos, qpos_low, free_velocity;         // (worlds, nq | nq | nv) of trees that sleep; NaN: not known yet
  View<R**> force;                                 // (worlds, nv) their qfrc_constraint
  View<R**> ctrl_before, act_before;               // (worlds, nu | na) of the last step
  View<int**> eq_before;                           // (worlds, neq)
  View<R***> mocap_pos_before, mocap_quat_before;  // (worlds, nmocap, 3 | 4)

  KOKKOS_INLINE_FUNCTION bool sleeps(int w, int tree) const { return calm(w, tree) < 0; }
  /// First tree of the island in which a tree sleeps, -1: it is awake.
  KOKKOS_INLINE_FUNCTION int island_of(int w, int tree) const { return sleeps(w, tree) ? -1 - calm(w, tree) : -1; }
  KOKKOS_INLINE_FUNCTION void lay_down(int w, int tree, int island) const { calm(w, tree) = -1 - island; }
};

namespace detail {
struct SleepStamp {
  Stamp woken = {};  // wake_changed has looked at this state
};
}  // namespace detail

template <class R, class Mem>
struct Sleep {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;      // 0: nothing sleeps
  R tolerance = R(0);  // [m/s]; of a speed below it steps count as rest. 0: nothing falls asleep
  int steps = 10;      // of rest before a tree may sleep
  SleepState<R, Mem> state;
  SleepingIslands<Mem> islands;                                    // of this step
  View<int**> still;                                               // (worlds, ntree) of this step: 1: sleeps where it was in the last one
  View<R**> qpos_before, qpos_low_before;                          // (worlds, nq) of the start of the last step
  Kokkos::View<int*, Mem> policy;                                  // (ntree) SleepPolicy
  Kokkos::View<int*, Mem> hangs;                                   // (ntree) 1: moves, or its rows do, where a mocap body moves
  Kokkos::View<R*, Mem> dof_length;                                // (nv) what a rotation moves, per radian [m]; of a translation 1
  View<int*> asleep;                                               // (worlds) trees that sleep
  Kokkos::View<std::uint64_t, Kokkos::HostSpace> contacts_before;  // host: ContactsStamp::made of the last step
  detail::SharedStamp<detail::SleepStamp> stamp;                   // host
};

/// Room for the sleep of `options.worlds` worlds: all are awake. Allocates.
/// Errors: gsp::Error for profile mujoco with the integrator RK4; std::invalid_argument for steps < 1.
template <class R, ExecutionSpace Exec, class Mem>
Sleep<R, Mem> make_sleep(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled, SleepOptions options = {}) {
  expects(options.worlds > 0 && options.steps > 0 && options.tolerance >= 0,
          "gsp::make_sleep: worlds and steps must be positive, the tolerance not negative");
  if (model.profile == Profile::mujoco && model.integrator == Integrator::rk4)
    throw Error("gsp::make_sleep: nothing sleeps with the integrator RK4, which evaluates a step four times: choose another, or no sleep");
  Sleep<R, Mem> s;
  int const n = s.worlds = options.worlds;
  s.tolerance = R(options.tolerance > 0 ? options.tolerance : compiled.option.sleep_tolerance);
  s.steps = options.steps;
  auto const make = [&](auto& v, char const* label, int items) {
    v = detail::allocate_zero<std::decay_t<decltype(v)>>(exec, label, n, items);
  };
  make(s.state.calm, "gsp::Sleep::calm", model.ntree);
  make(s.state.qpos, "gsp::Sleep::qpos", model.nq);
  make(s.state.qpos_low, "gsp::Sleep::qpos_low", model.nq);
  make(s.state.free_velocity, "gsp::Sleep::free_velocity", model.nv);
  make(s.state.force, "gsp::Sleep::force", model.nv);
  make(s.state.ctrl_before, "gsp::Sleep::ctrl_before", model.nu);
  make(s.state.act_before, "gsp::Sleep::act_before", model.na);
  make(s.state.eq_before, "gsp::Sleep::eq_before", model.neq);
  s.state.mocap_pos_before =
      detail::allocate_zero<decltype(s.state.mocap_pos_before)>(exec, "gsp::Sleep::mocap_pos_before", n, model.nmocap, 3);
  s.state.mocap_quat_before =
      detail::allocate_zero<decltype(s.state.mocap_quat_before)>(exec, "gsp::Sleep::mocap_quat_before", n, model.nmocap, 4);
  make(s.islands.island, "gsp::Sleep::island", model.ntree);
  make(s.islands.stirred, "gsp::Sleep::stirred", model.ntree);
  make(s.islands.wakes, "gsp::Sleep::wakes", model.ntree);
  s.islands.asleep = detail::allocate_zero<decltype(s.islands.asleep)>(exec, "gsp::Sleep::islands_asleep", n);
  make(s.qpos_before, "gsp::Sleep::qpos_before", model.nq);
  make(s.qpos_low_before, "gsp::Sleep::qpos_low_before", model.nq);
  make(s.still, "gsp::Sleep::still", model.ntree);
  s.contacts_before = decltype(s.contacts_before)(Kokkos::view_alloc("gsp::Sleep::contacts_before", Kokkos::SequentialHostInit));
  s.stamp = detail::make_stamp<detail::SleepStamp>("gsp::Sleep::stamp");
  s.asleep = detail::allocate_zero<decltype(s.asleep)>(exec, "gsp::Sleep::asleep", n);
  s.policy = detail::to_device<decltype(s.policy)>(exec, "gsp::Sleep::policy", detail::sleep_policies(compiled));
  s.hangs = detail::to_device<decltype(s.hangs)>(exec, "gsp::Sleep::hangs", detail::hang_on_mocap(compiled));
  s.dof_length = detail::to_device<decltype(s.dof_length)>(exec, "gsp::Sleep::dof_length", detail::dof_lengths<R>(compiled));
  return s;
}

/// The first half: which islands sleep in this step. Wakes those of worlds that were reset or whose eq_active was changed; of trees whose
/// positions were changed, or to which a velocity, a force or another free velocity was given (gravity, wind, masses); of trees with
/// actuators where any control or activation of the world has changed, and of all trees where a magnet that no tree moves may have; and of
/// trees that hang on a mocap body, or of all where a tendon or an actuator reaches one, where a mocap body of the world has moved. After
/// smooth_dynamics, before collide and assemble, which wakes those that something touches. Does not allocate, does not fence. Errors:
/// std::invalid_argument for a sleep of another number of worlds.
template <ExecutionSpace Exec, class R, class Mem>
void wake_changed(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics,
                  Sleep<R, Mem>& sleep) {
  if (sleep.worlds == 0) return;
  Region const region("gsp::step::wake_changed");
  detail::expects_as_many("gsp::wake_changed", "worlds", "make both with the same {.worlds = n}", detail::Count{"sleep", sleep.worlds},
                          detail::Count{"state", state.worlds});
  for_worlds("gsp::step::wake_changed", exec, state.worlds, detail::WakeChanged<Sleep<R, Mem>, R, Mem>{model, state, dynamics, sleep});
  sleep.stamp().woken.set(state);
}

/// Wakes what sleeps in the worlds of the mask, from the next step on: for changes that no tree can feel, such as other friction, poses or
/// softness of geoms (make_per_world, set_world_values), a collision model or equalities of your own. It counts its steps of rest from none
/// and starts from the impulses with which it fell asleep. The other worlds do not notice. Nothing sleeps: nothing happens. Does not
/// allocate, does not fence. Error: std::invalid_argument for a mask of another number of worlds.
/// @param mask  callable with a world, such as a View<bool*> on the device
template <ExecutionSpace Exec, class R, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void wake(Exec const& exec, Sleep<R, Mem>& sleep, Mask const& mask) {
  if (sleep.worlds == 0) return;
  detail::expects_mask("gsp::wake", mask, "sleep", sleep.worlds);
  Kokkos::parallel_for("gsp::step::wake", Kokkos::RangePolicy<Exec>(exec, 0, sleep.worlds),
                       detail::WakeWorlds<Mem, Mask>{sleep.state.calm, sleep.asleep, mask});
}
/// Wakes all that sleeps.
template <ExecutionSpace Exec, class R, class Mem>
void wake(Exec const& exec, Sleep<R, Mem>& sleep) {
  wake(exec, sleep, detail::AllWorlds{});
}

/// What `collide` may take over from its last call. Empty where somebody else has called it with these contacts since, or their pools have
/// grown. After wake_changed; on the host, for each call anew.
template <class R, class Mem>
StillTrees<R, Mem> still_trees(Model<R, Mem> const& model, Contacts<R, Mem> const& contacts, Sleep<R, Mem> const& sleep) {
  if (sleep.worlds == 0 || !contacts.stamp.data() || contacts.stamp().made != sleep.contacts_before()) return {};
  return {sleep.still, model.body_tree, model.body_mocap};
}

/// The second half, after integrate: what sleeps goes back to where it lay, and islands all of whose trees have rested for so many steps
/// fall asleep: their velocities are zero from here on.
/// @param qfrc_constraint  of the step; of what sleeps it is what it was at first
/// Does not allocate, does not fence. Errors: std::invalid_argument for a sleep of another number of worlds, and where wake_changed,
/// assemble with `sleep.islands` or integrate is missing in this step.
template <ExecutionSpace Exec, class R, class Mem>
void fall_asleep(Exec const& exec, Model<R, Mem> const& model, Rows<R, Mem> const& rows, Progress<Mem> const& progress,
                 State<R, Mem>& state, Dynamics<R, Mem>& dynamics, Kokkos::View<R**, Kokkos::LayoutRight, Mem>& qfrc_constraint,
                 Sleep<R, Mem>& sleep) {
  if (sleep.worlds == 0) return;
  Region const region("gsp::step::fall_asleep");
  detail::expects_as_many("gsp::fall_asleep", "worlds", "make both with the same {.worlds = n}", detail::Count{"sleep", sleep.worlds},
                          detail::Count{"state", state.worlds});
  auto const& woken = sleep.stamp().woken;
  expects(woken.qpos == state.qpos.data(),
          "gsp::fall_asleep: nobody has looked who sleeps in this state: call wake_changed after smooth_dynamics, in each step");
  expects(!woken.is_of(state), "gsp::fall_asleep: the state has not moved on since wake_changed: call integrate first");
  if (rows.stamp.data()) {
    expects(woken.is_same(rows.stamp().state),
            "gsp::fall_asleep: wake_changed has looked at another moment than that of the rows: call it in each step, before assemble");
    expects(rows.stamp().sleeps, "gsp::fall_asleep: assemble was not told who sleeps: give it sleep.islands as its last argument");
    sleep.contacts_before() = rows.stamp().contacts;
  }
  for_worlds("gsp::step::fall_asleep", exec, state.worlds,
             detail::FallAsleep<Sleep<R, Mem>, R, Mem>{model, rows, progress.halt, state, dynamics, qfrc_constraint, sleep});
}

}  // namespace gsp
