#pragma once
#include <gsp/dynamics/actuator_forces.hpp>

/// Which springs, dampers and servos profile `stable` leaves to rows (constraint/stiff_forces.hpp), with the law that a row has:
///   f+ = f - h k u+ - b (u+ - u) = intercept - slope u+,   intercept = f + b u,   slope = h k + b,   lower <= f+ <= upper
/// (f: the law's force at the state, u: the rate of its length, k and b: its slopes by length and rate).
namespace gsp::detail {

/// Where it is written which worlds have such rows in this step, and which step that is; null: nothing is left to rows.
struct LeftForces {
  std::int64_t* step = nullptr;
  std::int64_t const* now = nullptr;
};

template <class L, class T>
KOKKOS_INLINE_FUNCTION void lanes_mark_left(L const& l, LeftForces const& left, T const& slope) {
  for (int i = 0; i < l.count; ++i)
    if (get_lane(slope, i) > 0) Kokkos::atomic_store(left.step + l.world[i], left.now[l.world[i]]);  // the same from all of its trees
}

/// Of a moment arm J: J M^-1 J^T by the diagonal of M^-1 in qpos0, and how many of its entries are not zero. row(f) gives f(dof, J) for
/// every entry.
template <class T>
struct ArmWeight {
  T weight, entries;
};
template <class L, class Row>
KOKKOS_INLINE_FUNCTION auto lanes_arm_weight(L const& l, Row const& row) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  ArmWeight<T> sum{T(0), T(0)};
  row([&](int dof, T const& J) {
    sum.weight = fma(J * J, l.constant(l.model.dof_invweight0, l.dof0, dof), sum.weight);
    sum.entries = sum.entries + select(J != T(0), T(1), T(0));
  });
  return sum;
}
/// What acts on one dof goes into the matrix, where `takes` holds.
template <class L, class T, class Takes, class Row>
KOKKOS_INLINE_FUNCTION void lanes_take_slopes(L const& l, Takes const& takes, T const& stiffness, T const& damping, Row const& row) {
  auto const& s = l.items;
  row([&](int dof, T const& J) {
    T const share = select(takes, J * J, T(0));
    s[l.at.stiffness + dof] = fma(share, stiffness, s[l.at.stiffness + dof]);
    s[l.at.damping + dof] = fma(share, damping, s[l.at.damping + dof]);
  });
}

/// The k-th actuator. On one dof it is in the matrix, and asks for a row where it is stiff and its limit acts now, or would at this
/// velocity at the end of the step; on several it asks for one where it is stiff. Where a limit of a sum of several actuators acts, all
/// stay explicit.
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_leave_actuator(L const& l, int k, LeftForces const& left) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  auto const& m = l.model;
  auto const kind = ActuatorKind(l.index(a.act_kind, k));
  int const row = l.at.act_row + 4 * k, law = l.at.act_law + 3 * k, id = l.index(a.act_id, k);
  bool const joint = kind == ActuatorKind::scalar_joint, sole = l.index(a.act_sole, k) != 0;
  s[row] = T(0);
  if (!m.actuation || kind == ActuatorKind::contacts || (joint && !left.step)) return;  // lanes_actuators has the joints' slopes
  if (!joint && l.index(a.act_gain, k) == int(ActuatorGain::muscle)) return;
  T const h(m.timestep), force = s[law], stiffness = max(s[law + 1], T(0)), damping = max(s[law + 2], T(0));
  T const slope = fma(h, stiffness, damping), rate = s[l.at.act_velocity + k];
  if (!any(slope > T(0))) return;
  auto const moment = [&](auto const& f) { lanes_for_moment(l, k, f); };
  auto const arm = lanes_arm_weight(l, moment);
  auto const stiff = h * slope * arm.weight > T(stiff_share), single = arm.entries == T(1);
  if (joint && !any(stiff)) return;
  auto const get = [&](auto const& field, int n, int c) { return l.listed(field, a.instance_act, a.nact, k, n, c); };
  T lower = get(m.act_forcerange, 2, 0), upper = get(m.act_forcerange, 2, 1);
  auto acts_alone = slope > T(0);
  moment([&](int dof, T const& J) {
    int const j = l.index(a.dof_jnt, dof);
    T const lo = l.constant(m.jnt_actfrcrange, l.jnt0, j, 2, 0), hi = l.constant(m.jnt_actfrcrange, l.jnt0, j, 2, 1);
    if (joint && sole) {
      T const x = lo / J, y = hi / J;
      lower = max(lower, min(x, y));
      upper = min(upper, max(x, y));
    } else {
      acts_alone = acts_alone && (s[l.at.actuator + dof] > lo) && (s[l.at.actuator + dof] < hi);
    }
  });
  if (kind == ActuatorKind::tendon) {
    T const lo = l.listed(m.tendon_actfrcrange, a.instance_tendon, a.ntendon, id, 2, 0),
            hi = l.listed(m.tendon_actfrcrange, a.instance_tendon, a.ntendon, id, 2, 1);
    if (sole) {
      lower = max(lower, lo);
      upper = min(upper, hi);
    } else {
      T total(0);
      for (int o = 0; o < a.nact; ++o)
        if (l.index(a.act_kind, o) == int(kind) && l.index(a.act_id, o) == id) total = total + s[l.at.act_force + o];
      acts_alone = acts_alone && (total > lo) && (total < hi);
    }
  }
  T const later = fma(-h * stiffness, rate, force);
  auto const inside = (force >= lower) && (force <= upper), stays = inside && (later >= lower) && (later <= upper);
  auto const leaves = acts_alone && stiff && !(single && stays);
  bool const some = left.step && any(leaves);
  if (!joint) {
    if (some)
      lanes_take_slopes(l, acts_alone && single && inside && !leaves, stiffness, damping, moment);
    else
      lanes_take_slopes(l, acts_alone && single && inside, stiffness, damping, moment);
  }
  if (!some) return;
  s[row] = select(leaves, slope, T(0));
  s[row + 1] = fma(damping, rate, force);
  s[row + 2] = lower;
  s[row + 3] = upper;
  lanes_mark_left(l, left, s[row]);
  if (!joint) return;
  int const dof = l.index(a.jnt_dofadr, id);
  if (sole) {
    s[l.at.stiffness + dof] = select(leaves, T(0), s[l.at.stiffness + dof]);
    s[l.at.damping + dof] = select(leaves, T(0), s[l.at.damping + dof]);
  } else {
    T const had = select(leaves && inside, -square(get(m.act_gear, 6, 0)), T(0));
    s[l.at.stiffness + dof] = fma(had, s[law + 1], s[l.at.stiffness + dof]);
    s[l.at.damping + dof] = fma(had, s[law + 2], s[l.at.damping + dof]);
  }
}

/// The k-th tendon's spring and damper: on one dof in the matrix, on several a row where they are stiff.
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_leave_tendon(L const& l, int k, LeftForces const& left) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  int const row = l.at.tendon_row + 2 * k;
  s[row] = T(0);
  if (!l.a.tendon_passive) return;
  auto const [stiffness, damping] = lanes_tendon_slopes(l, k);
  T const h(l.model.timestep), slope = fma(h, stiffness, damping);
  if (!any(slope > T(0))) return;
  auto const arm = [&](auto const& f) { lanes_for_tendon_arm(l, k, f); };
  auto const [weight, entries] = lanes_arm_weight(l, arm);
  auto const single = entries == T(1);
  if (any(single)) lanes_take_slopes(l, single, stiffness, damping, arm);
  auto const leaves = (h * slope * weight > T(stiff_share)) && !single;
  if (!left.step || !any(leaves)) return;
  s[row] = select(leaves, slope, T(0));
  s[row + 1] = fma(damping, s[l.at.tendon_velocity + k], lanes_tendon_force(l, k));
  lanes_mark_left(l, left, s[row]);
}

/// Chooses what is left to rows, and takes it from what the factored matrix has. After the actuators, before the factor.
template <class L>
KOKKOS_FORCEINLINE_FUNCTION void lanes_leave_forces(L const& l, LeftForces const& left) {
  if (!l.a.stiff) return;
  l.single([&](auto const& one) {  // out of line on a GPU: few models have any
    for (int k = 0; k < one.a.nact; ++k) lanes_leave_actuator(one, k, left);
    for (int k = 0; k < one.a.ntendon; ++k) lanes_leave_tendon(one, k, left);
  });
}

/// True where something is left to rows.
template <class L>
KOKKOS_INLINE_FUNCTION auto lanes_leaves_any(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  T sum(0);
  for (int k = 0; l.a.stiff && k < l.a.nact; ++k) sum = sum + l.items[l.at.act_row + 4 * k];
  for (int k = 0; l.a.stiff && k < l.a.ntendon; ++k) sum = sum + l.items[l.at.tendon_row + 2 * k];
  return sum > T(0);
}

/// to <- to - J^T f of all that is left to rows, f as `actuator` and `passive` hold it.
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_subtract_left(L const& l, int to) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  for (int k = 0; k < a.nact; ++k) {
    auto const leaves = s[l.at.act_row + 4 * k] > T(0);
    if (!any(leaves)) continue;
    bool const joint = l.index(a.act_kind, k) == int(ActuatorKind::scalar_joint), sole = l.index(a.act_sole, k) != 0;
    lanes_for_moment(l, k, [&](int dof, T const& J) {
      T const force = joint && sole ? s[l.at.actuator + dof] : J * s[l.at.act_force + k];
      s[to + dof] = s[to + dof] - select(leaves, force, T(0));
    });
  }
  for (int k = 0; k < a.ntendon; ++k) {
    auto const leaves = s[l.at.tendon_row + 2 * k] > T(0);
    if (!any(leaves)) continue;
    T const force = select(leaves, lanes_tendon_force(l, k), T(0));
    lanes_for_tendon_arm(l, k, [&](int dof, T const& J) { s[to + dof] = fma(-J, force, s[to + dof]); });
  }
}

}  // namespace gsp::detail
