#pragma once
#include <gsp/dynamics/factor.hpp>

/// Semi-implicit Euler: new velocities from the constraints' impulses, then positions with the new velocities.
namespace gsp {

namespace detail {
/// velocity <- velocity + L^-1 D^-1/2 z, z (world, nv) the whitened impulses. In profile mujoco joint damping enters here, as MuJoCo's
/// Euler has it:
///   v+ = v + (M + h B)^-1 M (v_M - v), v_M the velocity that M gives.
template <class L, class View>
KOKKOS_INLINE_FUNCTION void lanes_new_velocity(L const& l, View const& z) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  if (z.data()) {
    for (int i = 0; i < a.nv; ++i) s[l.at.impulse + i] = l.load(z, l.dof0, i) * sqrt(s[l.at.inverse_diagonal + i]);
    lanes_solve_lower(l, l.at.impulse);
    for (int i = 0; i < a.nv; ++i) s[l.at.velocity + i] = s[l.at.velocity + i] + s[l.at.impulse + i];
  }
  if (l.model.profile != Profile::mujoco || !l.model.eulerdamp || !l.model.dampers || !l.model.damped) return;
  T const h(l.model.timestep);
  for (int i = 0; i < a.nv; ++i) s[l.at.impulse + i] = s[l.at.velocity + i] - s[l.at.qvel + i], s[l.at.velocity + i] = T(0);
  for (int i = 0; i < a.nv; ++i)
    for (int e = l.index(a.row_adr, i), end = l.index(a.row_adr, i + 1); e < end; ++e) {  // velocity <- M (v_M - v)
      int const c = l.index(a.row_col, e);
      T const m = s[l.at.mass + e];
      s[l.at.velocity + i] = fma(m, s[l.at.impulse + c], s[l.at.velocity + i]);
      if (c != i) s[l.at.velocity + c] = fma(m, s[l.at.impulse + i], s[l.at.velocity + c]);
    }
  lanes_factor(l, [&](int i) { return h * l.constant(l.model.dof_damping, l.dof0, i); });
  lanes_solve(l, l.at.velocity);
  for (int i = 0; i < a.nv; ++i) s[l.at.velocity + i] = s[l.at.velocity + i] + s[l.at.qvel + i];
}

/// Sets the status bit of worlds with a velocity that is NaN or infinite (x - x is 0 for finite x alone).
template <class L, class View>
KOKKOS_INLINE_FUNCTION void lanes_check_velocity(L const& l, View const& status) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  T sum(0);
  for (int i = 0; i < l.a.nv; ++i) sum = sum + (l.items[l.at.velocity + i] - l.items[l.at.velocity + i]);
  auto const finite = sum == T(0);
  if (all(finite)) return;
  for (int k = 0; k < l.count; ++k)
    if (!(get_lane(sum, k) == 0)) Kokkos::atomic_or(&status(l.world[k]), std::uint32_t(status::not_finite));
}

/// q <- q + h v; rotations: quat <- quat exp(h w), w in body axes. Positions of free bodies carry what rounding took (two-sum), so that
/// they do not creep.
template <class L, class State>
KOKKOS_INLINE_FUNCTION void lanes_integrate_positions(L const& l, State const& state) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  T const h(l.model.timestep);
  auto const write = [&](auto const& view, int const* first, int i, T const& x) {
    for (int k = 0; k < l.count; ++k)
      if (!(state.status(l.world[k]) & status::stopped)) view(l.world[k], first[k] + i) = get_lane(x, k);
  };
  for (int j = 0; j < a.njnt; ++j) {
    int q = l.index(a.jnt_qposadr, j), v = l.at.velocity + l.index(a.jnt_dofadr, j);
    auto const type = JointType(l.index(a.jnt_type, j));
    if (type == JointType::hinge || type == JointType::slide) {
      write(state.qpos, l.qpos0, q, fma(h, s[v], l.load(state.qpos, l.qpos0, q)));
      continue;
    }
    if (type == JointType::free) {
      for (int c = 0; c < 3; ++c, ++q, ++v) {
        T const high = l.load(state.qpos, l.qpos0, q), add = fma(h, s[v], l.load(state.qpos_low, l.qpos0, q));
        T const sum = high + add, part = sum - high;
        write(state.qpos, l.qpos0, q, sum);
        write(state.qpos_low, l.qpos0, q, (high - (sum - part)) + (add - part));
      }
    }
    Quat<T> const now = normalized(Quat<T>{l.load(state.qpos, l.qpos0, q), l.load(state.qpos, l.qpos0, q + 1),
                                           l.load(state.qpos, l.qpos0, q + 2), l.load(state.qpos, l.qpos0, q + 3)});
    bool const carried = l.model.profile == Profile::stable && is_free_body(l);
    Quat<T> const next = normalized(now * exp_rotation(h * (carried ? s.vec3(v) + s.vec3(l.at.spin) : s.vec3(v))));
    write(state.qpos, l.qpos0, q, next.w), write(state.qpos, l.qpos0, q + 1, next.x), write(state.qpos, l.qpos0, q + 2, next.y),
        write(state.qpos, l.qpos0, q + 3, next.z);
  }
  for (int i = 0; i < a.nv; ++i) write(state.qvel, l.dof0, i, s[l.at.velocity + i]);
}

template <class State>
struct NewVelocityStage {
  State state;
  typename State::template View<typename State::real_type**> z;
  Kokkos::View<int const, typename State::memory_space> halt;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    if (halt.data() && halt()) return;
    lanes_new_velocity(l, z), lanes_check_velocity(l, state.status);
  }
};
template <class State>
struct IntegrateStage {
  State state;
  Kokkos::View<int const, typename State::memory_space> halt;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    if (halt.data() && halt()) return;
    lanes_integrate_positions(l, state);
  }
};
}  // namespace detail

/// Ends the step: state.qvel and state.qpos become those of the end, state.steps goes up by one. A world whose new velocity is not finite
/// stays as it was, and says so in state.status (status::not_finite); clear the bit to try again.
/// @param z     whitened impulses of the constraints (rows.z); empty: none
/// @param halt  nothing happens while it holds non-zero, as the step has to be repeated (rows.halt); empty: never
/// After factor (or smooth_dynamics) and, where there are constraints, pgs. Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem>
void integrate(Exec const& exec, Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, State<R, Mem> const& state,
               typename State<R, Mem>::template View<R**> const& z = {},
               Kokkos::View<int const, std::type_identity_t<Mem>> const& halt = {}) {
  for_lanes("gsp::dynamics::new_velocity", exec, model, dynamics, detail::NewVelocityStage<State<R, Mem>>{state, z, halt});
  for_lanes("gsp::dynamics::integrate", exec, model, dynamics, detail::IntegrateStage<State<R, Mem>>{state, halt});
  auto const steps = state.steps;
  auto const bits = state.status;
  Kokkos::parallel_for(
      "gsp::dynamics::count_step", Kokkos::RangePolicy<Exec>(exec, 0, state.worlds), KOKKOS_LAMBDA(int w) {
        if (!(halt.data() && halt()) && !(bits(w) & status::stopped)) ++steps(w);
      });
}

/// The same with the impulses of `rows` (constraint/rows.hpp).
template <ExecutionSpace Exec, class R, class Mem, class Rows>
requires requires(Rows const& r) { r.z, r.halt; }
void integrate(Exec const& exec, Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, Rows const& rows,
               State<R, Mem> const& state) {
  integrate(exec, model, dynamics, state, rows.z, rows.halt);
}

}  // namespace gsp
