#include <doctest/doctest.h>

#include <cmath>
#include <gsp/math/dual.hpp>

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
TEST_CASE("the slope of a root is 0 at 0") {
  D a = D::variable(0, 0);
  CHECK(gsp::sqrt(a * a).slope[0] == 0);
  a += 2., a *= a, a -= 1, a /= 3;
  CHECK(a.value == 1);
  CHECK(a.slope[0] == doctest::Approx(4. / 3).epsilon(1e-15));
}
