#pragma once
#include <Kokkos_Core.hpp>
#include <gsp/math/scalar.hpp>

/// Anderson acceleration of a fixed-point iteration p -> G(p), here a sweep, with the last two differences (Walker and Ni 2011, type II):
///   f = W (G(p) - p),   df = f - f',   dg = G(p) - G(p')        (' : of the sweep before)
///   gamma = argmin |f - gamma_1 df_1 - gamma_2 df_2|,   p <- G(p) - gamma_1 dg_1 - gamma_2 dg_2
/// W = D^1/2, D the rows' diagonal, makes |f| a length that does not depend on units. What p adds up to, z = Y^T p, is combined likewise;
/// G projects, so that a combination which leaves the bounds is brought back by the next sweep.
namespace gsp::detail {

/// Numbers kept per row between sweeps: W, p before the sweep, f, G(p), and two df and dg.
struct History {
  enum Row { weight, before, f, g, df, dg = df + 2, row_numbers = dg + 2 };
  enum Dof { z, dz, dof_numbers = dz + 2 };
};

/// Inner products of one sweep, and those that are still needed of the one before. T: a number, or a pack with a world a lane.
template <class T>
struct AndersonProducts {
  T ff, df1_f, df2_f;           // 1: the newest difference
  T df1_df1, df1_df2, df2_df2;  // df2_df2: what df1_df1 was a sweep ago
};

/// gamma; 0 where the combination would be a wild one. `two`: where the older difference counts.
template <class R, class T, class M>
KOKKOS_INLINE_FUNCTION void anderson_weights(AndersonProducts<T> const& s, M const& two, T& gamma1, T& gamma2) {
  T const zero(R(0)), one(R(1));
  T const c = select(two, s.df2_df2, zero), b = select(two, s.df1_df2, zero), r2 = select(two, s.df2_f, zero);
  T const least = (s.df1_df1 + c) * T(max(R(1e-10), R(4) * Kokkos::Experimental::epsilon_v<R>));
  T const a1 = s.df1_df1 + least, a2 = select(two, c + least, one), det = a1 * a2 - b * b;
  auto const sound = det > zero;
  T const inverse = one / select(sound, det, one);
  T const g1 = (s.df1_f * a2 - r2 * b) * inverse, g2 = (r2 * a1 - s.df1_f * b) * inverse, most(R(100));
  auto const use = sound && abs(g1) <= most && abs(g2) <= most;
  gamma1 = select(use, g1, zero);
  gamma2 = select(use, g2, zero);
}

}  // namespace gsp::detail
