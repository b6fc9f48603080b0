#pragma once
#include <gsp/constraint/constraint_type.hpp>

/// MuJoCo's soft constraints (solref, solimp) as a compliance and a target rate of one step.
namespace gsp {

/// solref and solimp of one row.
template <class R>
struct Softness {
  R solref[2];
  R solimp[5];
};

/// MuJoCo's reference acceleration a = -B u - K imp x and regularisation R = (1 - imp)/imp diag, taken over one step of length h with the
/// impulse p = h f:
///   u+ = u + h a - R p,   so C = R and zeta = (1 - h B) u - h K imp x.
/// @param x     gap less margin [m, rad]
/// @param u     its rate at the start of the step
/// @param diag  approximate diagonal of J M^-1 J^T (invweight0)
/// @param rate_only  friction: K = 0
/// solref > 0 is a time constant (at least 2 h) and a damping ratio; both <= 0 are -stiffness and -damping. Source: MuJoCo's documentation,
/// "Computation: parameters".
template <class R>
KOKKOS_INLINE_FUNCTION RowLaw<R> soft_law(Softness<R> const& s, R x, R u, R h, R diag, bool rate_only = false) {
  R const least(1e-4), most(0.9999), tiny(1e-15);
  R const d0 = clamp(s.solimp[0], least, most), dw = clamp(s.solimp[1], least, most), width = max(s.solimp[2], R(0)),
          mid = clamp(s.solimp[3], least, most), power = max(s.solimp[4], R(1));
  R impedance;
  if (d0 == dw || width <= tiny) {
    impedance = R(0.5) * (d0 + dw);
  } else {
    R const r = abs(x) / width;
    if (r >= R(1))
      impedance = dw;
    else if (power == R(1))
      impedance = d0 + r * (dw - d0);
    else {
      R const y = r <= mid ? Kokkos::pow(r, power) / Kokkos::pow(mid, power - R(1))
                           : R(1) - Kokkos::pow(R(1) - r, power) / Kokkos::pow(R(1) - mid, power - R(1));
      impedance = d0 + y * (dw - d0);
    }
  }
  R K, B;
  if (s.solref[0] > R(0)) {
    R const time = max(s.solref[0], R(2) * h), ratio = s.solref[1];
    K = R(1) / max(tiny, square(dw * time * ratio));
    B = R(2) / max(tiny, dw * time);
  } else {
    K = -s.solref[0] / max(tiny, square(dw));
    B = -s.solref[1] / max(tiny, dw);
  }
  if (rate_only) K = R(0);
  return {max(tiny, (R(1) - impedance) / impedance * diag), (R(1) - h * B) * u - h * K * impedance * x};
}

namespace detail {
template <class R>
KOKKOS_INLINE_FUNCTION Softness<R> softness(Field<R> const& solref, Field<R> const& solimp, int world, int i) {
  Softness<R> s;
  for (int c = 0; c < 2; ++c) s.solref[c] = solref(world, 2 * i + c);
  for (int c = 0; c < 5; ++c) s.solimp[c] = solimp(world, 5 * i + c);
  return s;
}
}  // namespace detail

}  // namespace gsp
