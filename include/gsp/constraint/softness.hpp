#pragma once
#include <gsp/constraint/constraint_type.hpp>

/// MuJoCo's soft constraints (solref, solimp) as a compliance and a target rate of one step.
namespace gsp {

/// What becomes of a time constant shorter than two timesteps, which one step cannot follow (solref > 0; <flag refsafe>).
enum class Refsafe : unsigned char {
  off,         // it is taken as it stands
  two_steps,   // it becomes 2 h: MuJoCo, profile mujoco
  keeps_rest,  // the same, and the compliance shrinks so that what rests lies where the file says, down to least_yield diag
};
// What sweeps bear: a grip of a compliance of 6e-4 diag takes more than 100 of them to close.
inline constexpr double least_yield = 0.01;

template <class R, class Mem>
Refsafe refsafe_of(Model<R, Mem> const& model) {
  if (!model.refsafe) return Refsafe::off;
  return model.profile == Profile::mujoco ? Refsafe::two_steps : Refsafe::keeps_rest;
}

/// solref and solimp of one row.
template <class R>
struct Softness {
  R solref[2];
  R solimp[5];
  Refsafe refsafe = Refsafe::two_steps;
};

/// How much of a row's rate its constraint takes (0 .. 1): solimp = (d0, dw, width, mid, power) go from d0 where |x| = 0 to dw from |x| =
/// width on, by a power on either side of mid.
/// @param x  gap less margin [m, rad]; of elements that pull several rows together (connect, weld): the norm of all of them
template <class R>
KOKKOS_INLINE_FUNCTION R impedance_of(Softness<R> const& s, R x) {
  R const least(1e-4), most(0.9999), tiny(1e-15);
  R const d0 = clamp(s.solimp[0], least, most), dw = clamp(s.solimp[1], least, most), width = max(s.solimp[2], R(0)),
          mid = clamp(s.solimp[3], least, most), power = max(s.solimp[4], R(1));
  if (d0 == dw || width <= tiny) return R(0.5) * (d0 + dw);
  R const r = abs(x) / width;
  if (r >= R(1)) return dw;
  if (power == R(1)) return d0 + r * (dw - d0);
  // r^power / mid^(power - 1), whose parts may both underflow; the default power is 2
  auto const raised = [&](R const& x) { return power == R(2) ? square(x) : Kokkos::pow(x, power); };
  R const y = r <= mid ? mid * raised(r / mid) : R(1) - (R(1) - mid) * raised((R(1) - r) / (R(1) - mid));
  return d0 + y * (dw - d0);
}

/// MuJoCo's reference acceleration a = -B u - K imp x and regularisation R = (1 - imp)/imp diag, taken over one step of length h with the
/// impulse p = h f:
///   u+ = u + h a - R p,   so C = R and zeta = (1 - h B) u - h K imp x.
/// @param impedance  of impedance_of
/// @param x     gap less margin [m, rad]
/// @param u     its rate at the start of the step
/// @param diag  approximate diagonal of J M^-1 J^T (invweight0)
/// @param rate_only  friction: K = 0
/// solref > 0 is a time constant (at least 2 h, but for Refsafe::off) and a damping ratio; both <= 0 are -stiffness and -damping; one of
/// each is taken as (0.02, 1). Source: MuJoCo's documentation, "Computation: parameters".
template <class R>
KOKKOS_INLINE_FUNCTION RowLaw<R> soft_law(Softness<R> const& s, R impedance, R x, R u, R h, R diag, bool rate_only) {
  R const tiny(1e-15), dw = clamp(s.solimp[1], R(1e-4), R(0.9999));
  bool const mixed = (s.solref[0] > R(0)) != (s.solref[1] > R(0));
  R const first = mixed ? R(0.02) : s.solref[0], second = mixed ? R(1) : s.solref[1];
  R K, B, rest(1);
  if (first > R(0)) {
    R const time = s.refsafe == Refsafe::off ? first : max(first, R(2) * h);
    if (s.refsafe == Refsafe::keeps_rest) rest = square(first / time);
    K = R(1) / max(tiny, square(dw * time * second));
    B = R(2) / max(tiny, dw * time);
  } else {
    K = -first / max(tiny, square(dw));
    B = -second / max(tiny, dw);
  }
  if (rate_only) K = R(0);
  R compliance = (R(1) - impedance) / impedance;
  if (rest < R(1)) {
    // At rest R p = -h K d x: R over K shrinks by `rest`. K and B shrink as 1 + R / diag does, m: what is free approaches as it did.
    R const shrink = max(rest * impedance / (R(1) - rest * (R(1) - impedance)), min(R(1), R(least_yield) / compliance));
    R const m = impedance + shrink * (R(1) - impedance);
    compliance *= shrink;
    K *= m;
    B *= m;
  }
  return {max(tiny, compliance * diag), (R(1) - h * B) * u - h * K * impedance * x};
}
/// The same where the row is alone: the impedance is that of its own gap.
template <class R>
KOKKOS_INLINE_FUNCTION RowLaw<R> soft_law(Softness<R> const& s, R x, R u, R h, R diag, bool rate_only = false) {
  return soft_law(s, impedance_of(s, x), x, u, h, diag, rate_only);
}

/// The rate that a rigid row asks for, u+ >= zeta with C = 0: an overlap x < 0 shrinks by the share `erp` a step, a gap x > 0 may close
/// within the step and no further.
template <class R>
KOKKOS_INLINE_FUNCTION R hard_target(R x, R h, R erp) {
  return (x < R(0) ? -erp : R(-1)) * x / h;
}

/// A rigid row that pushes: what closes faster than |g| h comes back with the share `restitution` (solver/impacts.hpp).
/// @param x     gap [m, rad];   @param diag  approximate diagonal of J M^-1 J^T (invweight0)
template <class R>
KOKKOS_INLINE_FUNCTION RowLaw<R> hard_law(R x, R h, R erp, R restitution, R diag) {
  RowLaw<R> law{R(0), hard_target(x, h, erp)};
  law.restitution = restitution;
  if (diag > R(0)) law.mass = R(1) / diag;
  return law;
}

namespace detail {
/// Whether rows may be rigid: some are, or become so in some worlds (per-world values of jnt_rigid ...). Else nobody need look at each.
template <class R>
bool may_be_rigid(Profile profile, bool some_are, Field<R> const& rigid) {
  return profile == Profile::stable && (some_are || rigid.stride > 0);
}
/// Of limits.
template <class R, class Mem>
bool may_be_rigid(Model<R, Mem> const& model, Field<R> const& rigid) {
  return may_be_rigid(model.profile, model.rigid_limits, rigid);
}
/// hard, restitution, erp of item i of jnt_rigid, tendon_rigid or eq_rigid; soft where rows are never rigid.
template <class R>
struct Rigidity {
  bool hard;
  R restitution, erp;
  KOKKOS_INLINE_FUNCTION Rigidity(Field<R> const& rigid, int world, int i, bool rows_may_be)
      : hard(rows_may_be && rigid(world, 3 * i) != R(0)), restitution(rigid(world, 3 * i + 1)), erp(rigid(world, 3 * i + 2)) {}
};
template <class R>
KOKKOS_INLINE_FUNCTION Softness<R> softness(Field<R> const& solref, Field<R> const& solimp, int world, int i, Refsafe refsafe) {
  Softness<R> s;
  s.refsafe = refsafe;
  for (int c = 0; c < 2; ++c) s.solref[c] = solref(world, 2 * i + c);
  for (int c = 0; c < 5; ++c) s.solimp[c] = solimp(world, 5 * i + c);
  return s;
}
}  // namespace detail

}  // namespace gsp
