#pragma once
#include <array>
#include <cmath>

namespace gsp::detail {

/// Mass (3) and inertia (3) of the ideal fluid of density 1 that an ellipsoid of half axes a, b, c takes with it (Newman, Marine
/// Hydrodynamics, 4.17; Tuckerman 1925), from
///   k_a = int_0^inf a b c / ((a^2 + s) sqrt((a^2 + s)(b^2 + s)(c^2 + s))) ds,   s = scale x^3 / (1 - x)^2, scale^5 = (a^3 b c)^2,
/// by Kronrod's 15 points in x; points and weights to the eight digits that MuJoCo has.
inline std::array<double, 6> added_mass(double a, double b, double c) {
  static constexpr double node[8] = {0.00427231, 0.02544604, 0.06756779, 0.12923441, 0.20695638, 0.29707742, 0.39610752, 0.5};
  static constexpr double weight[8] = {0.01146766, 0.03154605, 0.05239501, 0.07032663, 0.08450236, 0.09517529, 0.10221647, 0.10474107};
  auto const kappa = [&](double x, double y, double z) {
    double const scale = std::pow(x * x * x * y * z, 0.4);
    double sum = 0;
    for (int i = 0; i < 15; ++i) {
      int const k = i < 8 ? i : 14 - i;
      double const rest = i < 8 ? 1 - node[k] : node[k], at = 1 - rest;
      double const s = scale * at * at * at / (rest * rest), ds = at * at * (3 - at) / (rest * rest * rest);
      double const px = 1 + s / (x * x), py = 1 + s / (y * y), pz = 1 + s / (z * z);
      sum += scale * ds * weight[k] / (px * std::sqrt(px * py * pz));
    }
    return sum / (x * x);
  };
  constexpr double pi = 3.14159265358979323846, least = 1e-14;
  double const volume = 4. / 3 * pi * a * b * c, ka = kappa(a, b, c), kb = kappa(b, c, a), kc = kappa(c, a, b);
  auto const inertia = [&](double x, double y, double kx, double ky) {  // about the axis across x and y
    double const difference = x * x - y * y;
    return volume / 5 * difference * difference * std::abs(ky - kx) /
           std::max(least, std::abs(2 * difference + (x * x + y * y) * (kx - ky)));
  };
  return {volume * ka / std::max(least, 2 - ka),
          volume * kb / std::max(least, 2 - kb),
          volume * kc / std::max(least, 2 - kc),
          inertia(b, c, kb, kc),
          inertia(c, a, kc, ka),
          inertia(a, b, ka, kb)};
}

}  // namespace gsp::detail
