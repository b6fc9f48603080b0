#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/integrate.hpp>
#include <gsp/dynamics/smooth.hpp>

/// The classical Runge-Kutta step of fourth order (MuJoCo's integrator RK4): four evaluations of velocity, acceleration and rate of
/// activation, at the start, twice in the middle, and at the end.
/// Rotations: q(t) = q0 exp(u), u' = dexp^-1_{-u}(w), w in body axes, so that angular velocities of different orientations are never added
/// (Munthe-Kaas 1998; MuJoCo 4.0):   dexp^-1_{-u}(w) = w + u x w / 2 + c u x (u x w),   c = (1 - (a/2) cot(a/2)) / a^2, a = |u|.
namespace gsp {

/// What a step of four evaluations keeps. `make_runge_kutta` allocates it.
template <class R, class Mem>
struct RungeKutta {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R**> qpos, qvel, act;               // at the start of the step
  View<R**> rate;                          // (world, nv) the last evaluation's u'
  View<R**> velocity, change, change_act;  // (world, nv | nv | na) weighted sums of u', of h times acceleration, of the activations' rate
};

struct RungeKuttaOptions {
  int worlds = 1;
};

/// Buffers for `worlds` worlds: one state and four vectors of dofs. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
RungeKutta<R, Mem> make_runge_kutta(Exec const&, Model<R, Mem> const& model, RungeKuttaOptions options = {}) {
  expects(options.worlds > 0, "gsp::make_runge_kutta: worlds must be positive and is " + std::to_string(options.worlds));
  auto const view = [&](char const* label, int n) {
    return detail::allocate<typename RungeKutta<R, Mem>::template View<R**>>(label, options.worlds, n);
  };
  return {view("gsp::RungeKutta::qpos", model.nq),      view("gsp::RungeKutta::qvel", model.nv),
          view("gsp::RungeKutta::act", model.na),       view("gsp::RungeKutta::rate", model.nv),
          view("gsp::RungeKutta::velocity", model.nv),  view("gsp::RungeKutta::change", model.nv),
          view("gsp::RungeKutta::change_act", model.na)};
}

namespace detail {
/// dexp^-1_{-u}(w)
template <class T>
KOKKOS_INLINE_FUNCTION Vec3<T> rotation_rate(Vec3<T> const& u, Vec3<T> const& w) {
  T const angle2 = dot(u, u), angle = sqrt(angle2);
  T s, c;
  sincos(T(0.5) * angle, s, c);
  auto const small = angle2 < T(sizeof(real_t<T>) == 4 ? 1e-3 : 1e-5);
  T const k = select(small, fma(angle2, T(1. / 720), T(1. / 12)),
                     (T(1) - T(0.5) * angle * c / select(small, T(1), s)) / select(small, T(1), angle2));
  Vec3<T> const uw = cross(u, w);
  return w + T(0.5) * uw + k * cross(u, uw);
}

/// f(first dof, number of dofs, is a rotation), for the parts of every joint.
template <class L, class F>
KOKKOS_INLINE_FUNCTION void lanes_for_joint_parts(L const& l, F const& f) {
  for (int j = 0; j < l.a.njnt; ++j) {
    int const q = l.index(l.a.jnt_qposadr, j), i = l.index(l.a.jnt_dofadr, j);
    auto const type = JointType(l.index(l.a.jnt_type, j));
    if (type == JointType::hinge || type == JointType::slide) f(q, i, 1, false);
    if (type == JointType::free) {
      f(q, i, 3, false);
      f(q + 3, i + 3, 3, true);
    }
    if (type == JointType::ball) f(q, i, 3, true);
  }
}

template <class R, class Mem>
struct RungeKuttaStage {
  State<R, Mem> state;
  RungeKutta<R, Mem> rk;
  int stage;
  Kokkos::View<int const, Mem> halt;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    auto const& a = l.a;
    auto const& s = l.items;
    T const h(l.model.timestep), before(last() ? R(1) : R(0.5));  // of this point
    int const u = l.at.impulse, x = l.at.acceleration;            // rates of the positions; how far they go
    if (stage == 0) {
      for (int i = 0; i < a.nq; ++i) l.store(rk.qpos, l.qpos0, i, l.load(state.qpos, l.qpos0, i));
      for (int i = 0; i < a.nv; ++i) l.store(rk.qvel, l.dof0, i, l.load(state.qvel, l.dof0, i));
      each_state(l, [&](int, int const* item) { l.store(rk.act, item, 0, l.load(state.act, item, 0)); });
    }
    if (halt.data() && halt()) {  // the step is to be repeated, from where it began
      for (int i = 0; i < a.nq; ++i) l.store(state.qpos, l.qpos0, i, l.load(rk.qpos, l.qpos0, i));
      for (int i = 0; i < a.nv; ++i) l.store(state.qvel, l.dof0, i, l.load(rk.qvel, l.dof0, i));
      each_state(l, [&](int, int const* item) { l.store(state.act, item, 0, l.load(rk.act, item, 0)); });
      return;
    }
    for (int i = 0; i < a.nv; ++i) s[u + i] = s[l.at.qvel + i];
    lanes_for_joint_parts(l, [&](int, int i, int, bool rotation) {
      if (!rotation || stage == 0) return;
      T const k = before * h;
      Vec3<T> const turned{k * l.load(rk.rate, l.dof0, i), k * l.load(rk.rate, l.dof0, i + 1), k * l.load(rk.rate, l.dof0, i + 2)};
      s.put(u + i, rotation_rate(turned, s.vec3(u + i)));
    });
    T const weight(this->weight()), reach(this->reach());
    for (int i = 0; i < a.nv; ++i) {
      T const change = s[l.at.velocity + i] - s[l.at.qvel + i];  // h times the acceleration
      T const start = l.load(rk.qvel, l.dof0, i);
      T velocity = weight * s[u + i], sum = weight * change;
      if (stage > 0) {
        velocity = velocity + l.load(rk.velocity, l.dof0, i);
        sum = sum + l.load(rk.change, l.dof0, i);
      }
      l.store(rk.rate, l.dof0, i, s[u + i]);
      l.store(rk.velocity, l.dof0, i, velocity);
      l.store(rk.change, l.dof0, i, sum);
      s[x + i] = h * (last() ? velocity : reach * s[u + i]);
      s[l.at.velocity + i] = start + (last() ? sum : reach * change);
    }
    if (last())
      lanes_check_bounded(l, state);  // of all trees before any is written: RungeKuttaEnd
    else
      write(l);
  }
  /// The state becomes that of the next point. A world that stops stays where the step began.
  template <class L>
  KOKKOS_INLINE_FUNCTION void write(L const& l) const {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    auto const& a = l.a;
    auto const& s = l.items;
    int const x = l.at.acceleration;
    auto const write = [&](auto const& view, int const* first, int i, T const& value, T const& start) {
      for (int k = 0; k < l.count; ++k) {
        bool const stopped = (state.status(l.world[k]) & status::stopped) != 0;
        if (!stopped || last()) view(l.world[k], first[k] + i) = get_lane(stopped ? start : value, k);
      }
    };
    for (int i = 0; i < a.nv; ++i) write(state.qvel, l.dof0, i, s[l.at.velocity + i], l.load(rk.qvel, l.dof0, i));
    lanes_for_joint_parts(l, [&](int q, int i, int n, bool rotation) {
      auto const from = [&](int c) { return l.load(rk.qpos, l.qpos0, q + c); };
      auto const move = [&](int c, T const& high, T const& by) {  // at the end with what rounding takes, as `integrate` does
        T const low = l.load(state.qpos_low, l.qpos0, q + c);
        auto const moved = two_sum(high, last() ? by + low : by);
        write(state.qpos, l.qpos0, q + c, moved.high, from(c));
        if (last()) write(state.qpos_low, l.qpos0, q + c, moved.low, low);
      };
      if (!rotation) {
        for (int c = 0; c < n; ++c) move(c, from(c), s[x + i + c]);
        return;
      }
      Quat<T> const stored{from(0), from(1), from(2), from(3)}, now = normalized(stored), turn = exp_rotation(s.vec3(x + i));
      Quat<T> const start = nearly_unit<R>(stored, now, l.model.profile), by = now * Quat<T>{turn.w - T(1), turn.x, turn.y, turn.z};
      move(0, start.w, by.w);
      move(1, start.x, by.x);
      move(2, start.y, by.y);
      move(3, start.z, by.z);
    });
    T const weight(this->weight()), step = T(l.model.timestep) * T(reach());
    each_state(l, [&](int k, int const* item) {
      T const rate = s[l.at.act_dot + l.index(a.act_state, k)];
      T const start = l.load(rk.act, item, 0), sum = stage == 0 ? weight * rate : fma(weight, rate, l.load(rk.change_act, item, 0));
      l.store(rk.change_act, item, 0, sum);
      T act = fma(step, rate, start);
      bool const ends = last() && l.model.actuation;
      if (ends) act = lanes_wrap_setpoint(l, k, lanes_next_activation(l, k, start, sum));
      write(state.act, item, 0, act, start);
    });
  }

 private:
  KOKKOS_INLINE_FUNCTION bool last() const { return stage == 3; }
  KOKKOS_INLINE_FUNCTION R weight() const { return stage == 0 || last() ? R(1. / 6) : R(1. / 3); }
  KOKKOS_INLINE_FUNCTION R reach() const { return stage == 2 ? R(1) : R(0.5); }  // of the next point
  /// f(actuator, its activations' places in state.act)
  template <class L, class F>
  KOKKOS_INLINE_FUNCTION static void each_state(L const& l, F const& f) {
    auto const& a = l.a;
    for (int k = 0; k < a.nact && a.nstate > 0; ++k) {
      if (l.index(a.act_state, k) < 0) continue;
      int item[L::W];
      l.listed_items(a.instance_act, a.nact, k, item);
      for (int i = 0; i < L::W; ++i) item[i] = l.model.act_state(item[i]);
      f(k, item);
    }
  }
};
/// What the last stage has found becomes the state.
template <class R, class Mem>
struct RungeKuttaEnd {
  RungeKuttaStage<R, Mem> stage;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    if (!stage.halt.data() || !stage.halt()) stage.write(l);
  }
};
}  // namespace detail

/// One step of integrator RK4. `evaluate()` must leave the velocities of a step of the timestep from `state` in dynamics, as
/// smooth_dynamics does (with constraints: new_velocity after the solver); by default smooth_dynamics. A world whose new velocity is
/// not finite has status::not_finite, beyond state_bound status::unbounded. Four evaluations a step; does not allocate, does not fence.
/// Errors: std::invalid_argument for buffers of another model or number of worlds, and where `evaluate` has not left the velocities of this
/// state.
/// @param halt  while it holds non-zero the state goes back to where the step began, which has to be repeated; empty: never
template <ExecutionSpace Exec, class R, class Mem, class Evaluate>
void runge_kutta(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Dynamics<R, Mem>& dynamics, Evaluate const& evaluate,
                 RungeKutta<R, Mem>& rk, Kokkos::View<int const, Mem> halt = {}) {
  Region const region("gsp::dynamics::runge_kutta");
  detail::expects_fit("gsp::runge_kutta", model, state, dynamics);
  detail::expects_rows("gsp::runge_kutta", "rk.qpos", rk.qpos, state.worlds, model.nq);
  detail::expects_rows("gsp::runge_kutta", "rk.qvel", rk.qvel, state.worlds, model.nv);
  detail::expects_rows("gsp::runge_kutta", "rk.act", rk.act, state.worlds, model.na);
  for (int stage = 0; stage < 4; ++stage) {
    evaluate();
    detail::expects_of("gsp::runge_kutta", dynamics, state,
                       detail::set_of(Quantity::velocity, Quantity::free_velocity, Quantity::activation_rate));
    for_lanes("gsp::dynamics::runge_kutta", exec, model, dynamics, detail::RungeKuttaStage<R, Mem>{state, rk, stage, halt});
    detail::moves_on(state);
  }
  for_lanes("gsp::dynamics::runge_kutta_end", exec, model, dynamics,
            detail::RungeKuttaEnd<R, Mem>{detail::RungeKuttaStage<R, Mem>{state, rk, 3, halt}});
  detail::loses(dynamics, detail::all_quantities);  // they would be those of the last evaluation
  detail::for_items("gsp::dynamics::count_step", exec, state.worlds, detail::CountStep<Mem>{state.steps, state.status, halt});
}
/// @param laws  of actuators, of your own (actuator_law.hpp)
template <ExecutionSpace Exec, class R, class Mem, class... Laws>
void runge_kutta(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Poses<R, Mem>& poses, Dynamics<R, Mem>& dynamics,
                 RungeKutta<R, Mem>& rk, Laws const&... laws) {
  runge_kutta(
      exec, model, state, dynamics, [&] { smooth_dynamics(exec, model, state, poses, dynamics, {}, laws...); }, rk);
}

}  // namespace gsp
