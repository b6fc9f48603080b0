#include <doctest/doctest.h>

#include <cmath>
#include <gsp/math/pack.hpp>
#include <gsp/math/quat.hpp>
#include <limits>

#if defined(KOKKOS_MACROS_HPP) && !defined(__CUDACC__)
#error "math/ includes Kokkos"
#endif

// Every function of a pack against the same function of the standard library, lane by lane. Tolerances: 2 ulp is what pack.hpp states;
// near a zero of sin the error is bounded by the rounding of the reduced argument instead, hence absolute.
TEST_CASE_TEMPLATE("pack functions equal the scalar ones", Real, float, double) {
  constexpr int W = gsp::native_width<Real>;
  using P = gsp::Pack<Real, W>;
  Real const eps = std::numeric_limits<Real>::epsilon();
  for (int i = 0; i < 4000; ++i) {
    P x, y;
    for (int l = 0; l < W; ++l) {
      x.set(l, Real(std::sin(0.37 * i + l) * std::exp(0.002 * i)));
      y.set(l, Real(std::cos(0.11 * i - l) * 3));
    }
    P s, c;
    sincos(x, s, c);
    P const e = exp(y), f = fma(x, y, x), r = sqrt(abs(x)), m = select(x < y, x, y);
    for (int l = 0; l < W; ++l) {
      CHECK(std::abs(double(s[l]) - std::sin(double(x[l]))) <= 4 * eps);
      CHECK(std::abs(double(c[l]) - std::cos(double(x[l]))) <= 4 * eps);
      CHECK(std::abs(double(e[l]) / std::exp(double(y[l])) - 1) <= 4 * eps);
      CHECK(r[l] == std::sqrt(std::abs(x[l])));
      CHECK(m[l] == std::min(x[l], y[l]));
      CHECK(std::abs(double(f[l]) - (double(x[l]) * y[l] + x[l])) <= 2 * eps * (std::abs(double(x[l]) * y[l]) + std::abs(x[l])));
    }
  }
}

TEST_CASE_TEMPLATE("rotation of packs: exp and log invert, rotate equals the matrix", Real, float, double) {
  constexpr int W = gsp::native_width<Real>;
  using P = gsp::Pack<Real, W>;
  Real const tolerance = 32 * std::numeric_limits<Real>::epsilon();  // about ten roundings of values below 3
  for (int i = 0; i < 200; ++i) {
    gsp::Vec3<P> w, v;
    for (int l = 0; l < W; ++l)
      for (int k = 0; k < 3; ++k) w[k].set(l, Real(std::sin(1.7 * i + l + k))), v[k].set(l, Real(std::cos(0.9 * i - l + 2 * k)));
    auto const q = gsp::exp_rotation(w);
    auto const back = gsp::log_rotation(q), a = gsp::rotate(q, v), b = gsp::to_matrix(q) * v;
    for (int l = 0; l < W; ++l)
      for (int k = 0; k < 3; ++k) {
        CHECK(std::abs(back[k][l] - w[k][l]) < tolerance);
        CHECK(std::abs(a[k][l] - b[k][l]) < tolerance);
      }
  }
}
