#include <doctest/doctest.h>

#include <cmath>
#include <gsp/math/dual.hpp>
#include <gsp/math/pack.hpp>

#if defined(KOKKOS_MACROS_HPP) && !defined(__CUDACC__)
#error "math/ includes Kokkos"
#endif

namespace {
using D = gsp::Dual<double, 2>;

/// Uses every operation that a dual number has; valid for x, y > 0.
template <class T>
T everything(T x, T y) {
  using gsp::abs, gsp::cos, gsp::exp, gsp::log, gsp::max, gsp::min, gsp::select, gsp::sin, gsp::sqrt;
  T const a = x * y - y / x + 2 * x - y * 0.5 + 1 - x / 3 + 2 / y - (1 - x) + (3 + y);
  T const b = sqrt(x + y) * exp(-x) + log(y) * sin(x) - cos(x * y);
  return a + b * abs(x - 4 * y) + max(x, y) * min(x * x, y) + select(x < y, x, -y);
}
}  // namespace

// Central differences of step s have the error s^2 |f'''| / 6 + eps |f| / s: with s = 1e-5, |f| < 100 and |f'''| < 300 (6 y / x^4 is the
// most), below 5e-9 + 3e-9.
TEST_CASE("slopes of duals are those of central differences") {
  double const s = 1e-5;
  for (int i = 0; i < 50; ++i) {
    double const x = 0.8 + 0.05 * i, y = 2.7 - 0.04 * i;
    D const f = everything(D::variable(x, 0), D::variable(y, 1));
    CHECK(f.value == doctest::Approx(everything(x, y)).epsilon(1e-14));
    CHECK(std::abs(f.slope[0] - (everything(x + s, y) - everything(x - s, y)) / (2 * s)) < 1e-8);
    CHECK(std::abs(f.slope[1] - (everything(x, y + s) - everything(x, y - s)) / (2 * s)) < 1e-8);
  }
}

// Lane by lane what numbers give, with the number below on either side; log is not a pack's. Packs have their own sin, cos and exp (2 ulp).
TEST_CASE("duals of packs and duals of duals") {
  using gsp::abs, gsp::cos, gsp::exp, gsp::max, gsp::min, gsp::select, gsp::sin, gsp::sqrt;
  using P = gsp::Pack<double, 4>;
  auto const f = []<class X, class T>(X const& x, X const& y, T const& k) {
    X const a = k * x - y / k + (k - x) * (x + k) + k / y + (y - k) * 2;
    X const b = sqrt(x + y) * exp(-x) - cos(x * y) * sin(y) + abs(x - y);
    return a + b + max(x, y) * min(x * x, y) + select(x < y, x, -y) + select(x >= k, y * y, x * 0.5);
  };
  P x, y, k;
  for (int i = 0; i < 4; ++i) x.set(i, 0.7 + 0.4 * i), y.set(i, 1.9 - 0.3 * i), k.set(i, 1.2 + 0.1 * i);
  using Packs = gsp::Dual<P, 2>;
  using Duals = gsp::Dual<gsp::Dual<double>, 2>;
  Packs const packs = f(Packs::variable(x, 0), Packs::variable(y, 1), k);
  for (int i = 0; i < 4; ++i) {
    D const one = f(D::variable(x[i], 0), D::variable(y[i], 1), k[i]);
    Duals const two = f(Duals::variable(x[i], 0), Duals::variable(y[i], 1), gsp::Dual<double>::variable(k[i], 0));
    double const s = 1e-5, up = f(x[i], y[i], k[i] + s), down = f(x[i], y[i], k[i] - s);
    CHECK(packs.value[i] == doctest::Approx(one.value).epsilon(1e-14));
    CHECK(two.value.value == one.value);
    for (int c = 0; c < 2; ++c) {
      CHECK(packs.slope[c][i] == doctest::Approx(one.slope[c]).epsilon(1e-13));
      CHECK(two.slope[c].value == doctest::Approx(one.slope[c]).epsilon(1e-14));
    }
    CHECK(std::abs(two.value.slope[0] - (up - down) / (2 * s)) < 1e-8);
  }
}

TEST_CASE("comparisons of duals look at values alone") {
  D const a = D::variable(1, 0), b = D::variable(2, 1);
  CHECK(a < b);
  CHECK(b > a);
  CHECK(a < 1.5);
  CHECK(b > 1);
  CHECK(a <= 1);
  CHECK(b >= a);
  CHECK(a == 1.);
  CHECK(gsp::max(a, b).slope[1] == 1);
  CHECK(gsp::min(a, b).slope[0] == 1);
}

// |x| by sqrt has its kink at 0; what a norm scales is 0 there, and its slope must stay finite.
TEST_CASE("duals compare with plain numbers of any type, on either side") {
  auto const check = [](auto three) {
    using X = gsp::Dual<decltype(three), 2>;
    X const x = X::variable(three, 0);
    CHECK(gsp::all(x > 2));
    CHECK(gsp::all(x >= 3));
    CHECK(gsp::all(x < 3.5));
    CHECK(gsp::all(x <= 3.5f));
    CHECK(gsp::all(2 < x));
    CHECK(gsp::all(3. <= x));
    CHECK(gsp::all(4 > x));
    CHECK(gsp::all(3 >= x));
    CHECK(!gsp::any(x > 3));
    auto const chosen = select(x > 2, x * x, X(three));
    CHECK(gsp::all(chosen.slope[0] == three + three));
  };
  check(3.f);
  check(3.);
  check(gsp::Pack<float, gsp::native_width<float>>(3.f));
  check(gsp::Pack<double, gsp::native_width<double>>(3.));
}

TEST_CASE("the slope of a root is 0 at 0") {
  D a = D::variable(0, 0);
  CHECK(gsp::sqrt(a * a).slope[0] == 0);
  a += 2., a *= a, a -= 1, a /= 3;
  CHECK(a.value == 1);
  CHECK(a.slope[0] == doctest::Approx(4. / 3).epsilon(1e-15));
}
