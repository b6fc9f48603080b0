#pragma once
#include <cstring>
#include <gsp/dynamics/factor.hpp>

/// Kernels of gsp/dynamics/integrate.hpp, where the contract stands.
namespace gsp::detail {

/// factor <- M - h derivative, factored.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_factor_derivative(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  T const h(l.model.timestep);
  l.each_batched(
      l.a.nM, [&](int e) { return fma(-h, s[l.at.derivative + e], s[l.at.mass + e]); }, [&](int e, T const& m) { s[l.at.factor + e] = m; });
  lanes_factor_in_place(l);
}

/// velocity <- (M - h derivative)^-1 velocity, with both triangles.
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_solve_unsymmetric(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  T const h(l.model.timestep);
  int const lower = l.at.factor, upper = l.at.derivative + l.a.nM;
  l.each_batched(
      l.a.nM, [&](int e) { return fma(-h, s[l.at.derivative + e], s[l.at.mass + e]); }, [&](int e, T const& y) { s[lower + e] = y; });
  l.each_batched(
      l.a.nM, [&](int e) { return fma(-h, s[upper + e], s[l.at.mass + e]); }, [&](int e, T const& y) { s[upper + e] = y; });
  lanes_solve_both_triangles(l, lower, upper, l.at.inverse_diagonal, l.at.velocity);
}

/// Activations to the end of the step. Where actuators are disabled they stay, within their ranges or not.
template <class L, class State>
KOKKOS_INLINE_FUNCTION void lanes_advance_activations(L const& l, State const& state) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  for (int k = 0; k < a.nact && l.model.actuation; ++k) {
    int const own = l.index(a.act_state, k);
    if (own < 0) continue;
    int item[L::W];
    l.listed_items(a.instance_act, a.nact, k, item);
    for (int i = 0; i < L::W; ++i) item[i] = l.model.act_state(item[i]);
    T const act = lanes_wrap_setpoint(l, k, lanes_next_activation(l, k, l.load(state.act, item, 0), l.items[l.at.act_dot + own]));
    for (int i = 0; i < l.count; ++i)
      if (!(state.status(l.world[i]) & status::stopped)) state.act(l.world[i], item[i]) = get_lane(act, i);
  }
}

/// True where the integrator factors a matrix of its own: profile mujoco with implicit integrators or joint damping.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION bool lanes_factors_again(L const& l) {
  auto const& m = l.model;
  return m.profile == Profile::mujoco &&
         (l.a.derivative > 0 || (m.integrator == Integrator::euler && m.eulerdamp && m.dampers && m.damped));
}

/// The same for any of the model's trees, on the host.
template <class R, class Mem>
bool factors_again(Model<R, Mem> const& m) {
  if (m.profile != Profile::mujoco) return false;
  return (m.integrator == Integrator::euler && m.eulerdamp && m.dampers && m.damped) ||
         any_archetype(m, [](Archetype const& a) { return a.derivative > 0; });
}

/// use(i, (J^T p)_i) for all dofs, J^T p = L^T D^1/2 z of the whitened impulses z (world, nv): x = D^1/2 z, then x_i + sum of L_ki x_k over
/// the dofs k that i moves. Overwrites the item `impulse`.
template <class L, class View, class Use>
KOKKOS_FORCEINLINE_FUNCTION void lanes_constraint_impulse(L const& l, View const& z, Use const& use) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  l.each_batched(
      a.nv, [&](int i) { return l.load(z, l.dof0, i) / sqrt(s[l.at.inverse_diagonal + i]); },
      [&](int i, T const& x) { s[l.at.impulse + i] = x; });
  l.each(a.nv, [&](int i) {
    int const place = l.index(a.row_adr, i + 1) - l.index(a.row_adr, i) - 1;
    T sum = s[l.at.impulse + i];
    for (int k = i + 1, end = l.index(a.body_dofend, l.index(a.dof_body, i)); k < end; ++k)
      sum = fma(s[l.at.factor + l.index(a.row_adr, k) + place], s[l.at.impulse + k], sum);
    use(i, sum);
  });
}

/// velocity <- velocity + L^-1 D^-1/2 z, z (world, nv) the whitened impulses. Profile mujoco starts again from the velocity v, the forces f
/// and the impulses J^T p = L^T D^1/2 z, as joint damping enters here; MuJoCo's Euler has it
///   v+ = v + (M + h B)^-1 (h f + J^T p),
/// and the implicit integrators take M - h d(forces)/dv instead: implicitfast its lower triangle, without the bias forces; implicit, and
/// implicitfast for lone free bodies, all of it. qfrc_constraint (world, nv) <- J^T p / h, where it has room.
template <class L, class View>
KOKKOS_FORCEINLINE_FUNCTION void lanes_new_velocity(L const& l, View const& z, View const& qfrc_constraint) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  if (!lanes_factors_again(l)) {
    if (!z.data()) return;
    if (qfrc_constraint.data())
      lanes_constraint_impulse(l, z, [&](int i, T const& impulse) { l.store(qfrc_constraint, l.dof0, i, impulse / T(l.model.timestep)); });
    l.each_batched(
        a.nv, [&](int i) { return l.load(z, l.dof0, i) * sqrt(s[l.at.inverse_diagonal + i]); },
        [&](int i, T const& x) { s[l.at.impulse + i] = x; });
    lanes_solve_lower(l, l.at.impulse);
    l.each_batched(
        a.nv, [&](int i) { return s[l.at.velocity + i] + s[l.at.impulse + i]; }, [&](int i, T const& v) { s[l.at.velocity + i] = v; });
    return;
  }
  T const h(l.model.timestep);
  if (z.data()) {
    lanes_constraint_impulse(l, z, [&](int i, T const& impulse) {
      if (qfrc_constraint.data()) l.store(qfrc_constraint, l.dof0, i, impulse / h);
      s[l.at.velocity + i] = fma(h, s[l.at.force + i], impulse);
    });
  } else {
    l.each_batched(
        a.nv, [&](int i) { return h * s[l.at.force + i]; }, [&](int i, T const& x) { s[l.at.velocity + i] = x; });
  }
  if (a.derivative == 2) {
    l.seldom([](auto const& rare) { lanes_solve_unsymmetric(rare); });
  } else {
    if (a.derivative == 1)
      lanes_factor_derivative(l);
    else
      lanes_factor(l, [&](int i) { return h * lanes_damping(l, i, true); });
    lanes_solve(l, l.at.velocity);
  }
  l.each_batched(
      a.nv, [&](int i) { return s[l.at.velocity + i] + s[l.at.qvel + i]; }, [&](int i, T const& v) { s[l.at.velocity + i] = v; });
}

/// Sets the status bits of the block's k-th world for a velocity, a rate of an activation or a qpos_low that is NaN or infinite (x - x is 0
/// for finite x alone), and for a velocity or a position beyond state_bound: of the numbers `first`, `first + stride`, ...
template <class L, class State>
KOKKOS_INLINE_FUNCTION void lanes_set_status(L const& l, State const& state, int k, int first, int stride) {
  using R = typename L::R;
  R const bound(state_bound), *const qpos = state.qpos.data() + std::int64_t(l.world[k]) * state.qpos.extent(1) + l.qpos0[k];
  int finite = 1, near = 1;
  for (int i = first; i < l.a.nv; i += stride) {
    R const v = get_lane(l.items[l.at.velocity + i], k), low = get_lane(l.items[l.at.low + i], k);
    int const sound = v - v == R(0) && low - low == R(0);
    finite &= sound;
    near &= !sound | (v <= bound && v >= -bound);
  }
  for (int i = first; i < l.a.nstate; i += stride) {
    R const rate = get_lane(l.items[l.at.act_dot + i], k);
    finite &= rate - rate == R(0);
  }
  for (int i = first; i < l.a.nq; i += stride) near &= !(qpos[i] > bound || qpos[i] < -bound);
  std::uint32_t const bits = (finite ? 0u : status::not_finite) | (near ? 0u : status::unbounded);
  if (bits) Kokkos::atomic_or(&state.status(l.world[k]), bits);
}
/// The same of all worlds of the block: packs of numbers first, as all but few are sound.
template <class L, class State>
KOKKOS_FORCEINLINE_FUNCTION void lanes_check_bounded(L const& l, State const& state) {
  if constexpr (L::W == 1) {
    if (l.count > 0) lanes_set_status(l, state, 0, l.worker, L::workers);
  } else {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    using R = typename L::R;
    T const bound(R{state_bound});
    T sum(0), most(0);
    for (int i = 0; i < l.a.nv; ++i) {
      T const v = l.items[l.at.velocity + i], low = l.items[l.at.low + i];
      sum = sum + ((v - v) + (low - low));
      most = max(most, abs(v));
    }
    for (int i = 0; i < l.a.nstate; ++i) sum = sum + (l.items[l.at.act_dot + i] - l.items[l.at.act_dot + i]);
    bool near = true;
    for (int k = 0; k < l.count; ++k) {  // a pack holds numbers of one world here
      R const* const qpos = state.qpos.data() + std::int64_t(l.world[k]) * state.qpos.extent(1) + l.qpos0[k];
      int i = 0;
      for (; i + L::W <= l.a.nq; i += L::W) {
        T part;
        std::memcpy(&part, qpos + i, sizeof part);
        most = max(most, abs(part));
      }
      for (; i < l.a.nq; ++i) near &= !(qpos[i] > R(state_bound) || qpos[i] < -R(state_bound));
    }
    if (near && all(most <= bound) && all(sum == T(0))) return;
    for (int k = 0; k < l.count; ++k) lanes_set_status(l, state, k, 0, 1);
  }
}

/// q <- q + h v; rotations: quat <- quat exp(h w), w in body axes (trees that are one rigid body: lanes_turn). qpos_low carries what
/// rounding took (two-sum), so that nothing creeps, and what moves slowly moves. In profile stable a joint whose rates rest keeps its qpos
/// to the bit while |qpos_low| is below pose_held: all that is computed of its poses stays as it is, and what they lack is in every gap and
/// length; a tree of one body keeps all of it or none, from where steps_held steps take it less far than that
/// (docs/decisions/0031-crowds-in-float-hum-by-rounding-of-poses.md). Not of duals: slopes of poses are those of qpos.
inline constexpr int steps_held = 5;
inline constexpr int pose_held = 16;  // epsilon: of 1 for angles and quaternions, of the largest coordinate for places
template <class R>
KOKKOS_INLINE_FUNCTION bool may_hold_poses(Profile profile) {
  return Scalar<R> && profile == Profile::stable;
}
/// The quaternion that a step turns. One that is a unit one but for rounding, and for what it lacks, stays as it is: normalized anew at
/// each step it would jump by its last digit. (Slopes of a dual are those of the normalized one.)
template <class R, class T>
KOKKOS_INLINE_FUNCTION Quat<T> nearly_unit(Quat<T> const& stored, Quat<T> const& normalized, Profile profile) {
  if constexpr (!Scalar<R>) {
    return normalized;
  } else {
    T const excess = fma(stored.w, stored.w, fma(stored.x, stored.x, fma(stored.y, stored.y, fma(stored.z, stored.z, T(-1)))));
    R const rounding = R(8 + (may_hold_poses<R>(profile) ? 4 * pose_held : 0)) * Kokkos::Experimental::epsilon_v<real_t<R>>;
    auto const unit = abs(excess) <= T(rounding);
    return {select(unit, stored.w, normalized.w), select(unit, stored.x, normalized.x), select(unit, stored.y, normalized.y),
            select(unit, stored.z, normalized.z)};
  }
}
template <class L, class State>
KOKKOS_FORCEINLINE_FUNCTION void lanes_integrate_positions(L const& l, State const& state) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  T const h(l.model.timestep);
  auto const moves = [&](int world) { return !(state.status(world) & status::stopped); };
  bool all_move = true;
  for (int k = 0; k < l.count; ++k) all_move &= moves(l.world[k]);
  auto const write = [&](auto const& view, int const* first, int i, T const& x) {
    if (all_move) return l.store(view, first, i, x);
    for (int k = 0; k < l.count; ++k)
      if (moves(l.world[k])) view(l.world[k], first[k] + i) = get_lane(x, k);
  };
  using R = typename L::R;
  bool const may_hold = may_hold_poses<R>(l.model.profile);
  R const epsilon = R(Kokkos::Experimental::epsilon_v<real_t<R>>);
  T const held(may_hold ? R(pose_held) * epsilon : R(0));
  l.each(a.njnt, [&](int j) {
    int q = l.index(a.jnt_qposadr, j), dof = l.index(a.jnt_dofadr, j), v = l.at.velocity + dof;
    auto const type = JointType(l.index(a.jnt_type, j));
    bool const is_free = type == JointType::free;
    T change(0), goes(0);  // of its rates, and by them, times h
    for (int i = 0, n = is_free ? 6 : type == JointType::ball ? 3 : 1; may_hold && i < n; ++i) {
      change = max(change, abs(h * (s[v + i] - s[l.at.qvel + dof + i])));
      goes = max(goes, abs(h * s[v + i]));
    }
    T rests = select(change < held, held, T(0));
    auto const move = [&](int i, T const& high, T const& by, T const& keep) {
      T const add = by + l.load(state.qpos_low, l.qpos0, i);
      auto const moved = two_sum(high, add);
      auto const stays = abs(add) < keep;
      write(state.qpos, l.qpos0, i, select(stays, high, moved.high));
      write(state.qpos_low, l.qpos0, i, select(stays, add, moved.low));
    };
    if (type == JointType::hinge || type == JointType::slide) {
      T const from = l.load(state.qpos, l.qpos0, q);
      return move(q, from, h * s[v], type == JointType::hinge ? rests : rests * abs(from));
    }
    int const quat = is_free ? q + 3 : q;
    Quat<T> const stored{l.load(state.qpos, l.qpos0, quat), l.load(state.qpos, l.qpos0, quat + 1), l.load(state.qpos, l.qpos0, quat + 2),
                         l.load(state.qpos, l.qpos0, quat + 3)};
    Quat<T> const now = normalized(stored);
    auto const [turn, shift] = carries_momentum(l)  // it may change v
                                   ? lanes_turn(l, now)
                                   : Displacement<T>{exp_rotation(h * s.vec3(is_free ? v + 3 : v)), is_free ? h * s.vec3(v) : Vec3<T>{}};
    Quat<T> const from = nearly_unit<R>(stored, now, l.model.profile), by = now * Quat<T>{turn.w - T(1), turn.x, turn.y, turn.z};
    Vec3<T> place{};
    T size(0);
    if (is_free) {
      place = {l.load(state.qpos, l.qpos0, q), l.load(state.qpos, l.qpos0, q + 1), l.load(state.qpos, l.qpos0, q + 2)};
      size = max(abs(place.x), max(abs(place.y), abs(place.z)));
    }
    if (may_hold && carries_momentum(l)) {  // a body by itself: all seven or none
      T const way[7] = {shift.x, shift.y, shift.z, by.w, by.x, by.y, by.z};
      auto stays = T(R(steps_held)) * goes < held;
      for (int c = is_free ? 0 : 3; c < 7; ++c)  // held already: no rounding lacks so much
        stays = stays || abs(l.load(state.qpos_low, l.qpos0, quat - 3 + c)) > T(epsilon) * (c < 3 ? size : T(1));
      for (int c = is_free ? 0 : 3; c < 7; ++c)
        stays = stays && abs(way[c] + l.load(state.qpos_low, l.qpos0, quat - 3 + c)) < held * (c < 3 ? size : T(1));
      rests = select(stays, rests, T(0));
    }
    if (is_free)
      for (int c = 0; c < 3; ++c) move(q + c, place[c], shift[c], rests * size);
    move(quat, from.w, by.w, rests);
    move(quat + 1, from.x, by.x, rests);
    move(quat + 2, from.y, by.y, rests);
    move(quat + 3, from.z, by.z, rests);
  });
  if (!store_block(l, l.at.velocity, a.nv, state.qvel, l.dof0[0], moves))
    l.each(a.nv, [&](int i) { write(state.qvel, l.dof0, i, s[l.at.velocity + i]); });
  if (a.nstate > 0) l.single([&](auto const& one) { lanes_advance_activations(one, state); });
}

/// Checks the new velocities and ends the step, for worlds of one tree each.
template <class L, class State>
KOKKOS_FORCEINLINE_FUNCTION void lanes_end_step(L const& l, State const& state) {
  lanes_check_bounded(l, state);
  l.sync();
  lanes_integrate_positions(l, state);
  for (int k = 0; k < l.count && l.worker == 0; ++k)
    if (!(state.status(l.world[k]) & status::stopped)) ++state.steps(l.world[k]);
}

/// All of it for worlds of one tree each.
template <class State>
struct OneTreeStage {
  static constexpr int shared_blocks = 8;
  State state;
  typename State::template View<typename State::real_type**> z, qfrc_constraint;
  Kokkos::View<int const, typename State::memory_space> halt;
  template <class L>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(L const& l) const {
    if (halt.data() && halt()) return;
    lanes_new_velocity(l, z, qfrc_constraint);
    lanes_end_step(l, state);
  }
};
template <class Mem>
struct CountStep {
  Kokkos::View<std::int64_t*, Kokkos::LayoutRight, Mem> steps;
  Kokkos::View<std::uint32_t*, Kokkos::LayoutRight, Mem> status_bits;
  Kokkos::View<int const, Mem> halt;
  KOKKOS_FUNCTION void operator()(std::int64_t w) const {
    if (!(halt.data() && halt()) && !(status_bits(w) & status::stopped)) ++steps(w);
  }
};
template <class State>
struct NewVelocityStage {
  static constexpr int shared_blocks = 8;
  State state;
  typename State::template View<typename State::real_type**> z, qfrc_constraint;
  Kokkos::View<int const, typename State::memory_space> halt;
  template <class L>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(L const& l) const {
    if (halt.data() && halt()) return;
    lanes_new_velocity(l, z, qfrc_constraint);
    lanes_check_bounded(l, state);
  }
};
template <class State>
struct IntegrateStage {
  static constexpr int shared_blocks = 8;
  State state;
  Kokkos::View<int const, typename State::memory_space> halt;
  template <class L>
  KOKKOS_FORCEINLINE_FUNCTION void operator()(L const& l) const {
    if (halt.data() && halt()) return;
    lanes_integrate_positions(l, state);
  }
};

}  // namespace gsp::detail
