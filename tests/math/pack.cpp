#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/math/pack.hpp>
#include <gsp/math/quat.hpp>
#include <limits>
#include <random>
#include <vector>

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

// A sum of floats and what rounding takes from it are exact in double; numbers that are far apart, near, and that cancel.
TEST_CASE("two numbers hold the sum of two") {
  using P = gsp::Pack<float, gsp::native_width<float>>;
  for (int i = 0; i < 4000; ++i) {
    float const a = float(std::sin(0.37 * i) * std::exp(0.002 * i)),
                b = i % 3 == 0 ? -a * (1 + 1e-6f * float(i)) : float(std::cos(0.11 * i) * 1e-4);
    auto const sum = gsp::two_sum(a, b);
    CHECK(sum.high == a + b);
    CHECK(double(sum.high) + double(sum.low) == double(a) + double(b));
    auto const sums = gsp::two_sum(P(a), P(b));
    CHECK(sums.high[0] == sum.high);
    CHECK(sums.low[0] == sum.low);
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

// A lane never sees another lane: packs of mixed numbers (ordinary, beyond the range of sincos and exp, infinite, not a number) give in
// each lane the bits of a pack that holds this lane's numbers alone. (Signs of NaN are nobody's promise: all are one.)
TEST_CASE_TEMPLATE("lanes do not see each other", Real, float, double) {
  constexpr int W = gsp::native_width<Real>;
  using P = gsp::Pack<Real, W>;
  using Limits = std::numeric_limits<Real>;
  std::vector<Real> const numbers{Real(0.7),   Real(-2.9),    Real(8000),          Real(8193),      Real(-17000),
                                  Real(2.1e9), Real(-0.),     Limits::infinity(),  Limits::min(),   Real(100),
                                  Real(-800),  Limits::max(), Limits::quiet_NaN(), Real(1.5707963), -Limits::infinity()};
  int const n = int(numbers.size());
  auto const all_functions = [](P const& x, P const& y, P const& z) {
    P s, c;
    sincos(x, s, c);
    P const one(Real(1)), zero(Real(0));
    return std::vector<P>{s,
                          c,
                          sin(x),
                          cos(x),
                          exp(x),
                          log(x),
                          sqrt(x),
                          abs(x),
                          -x,
                          atan2(y, x),
                          fma(x, y, z),
                          min(x, y),
                          max(x, y),
                          clamp(x, y, z),
                          square(x),
                          x + y,
                          x - y,
                          x * y,
                          x / y,
                          select(x < y, x, z),
                          select(x <= y, one, zero),
                          select(x > y, one, zero),
                          select(x >= y, one, zero),
                          select(x == y, one, zero),
                          select(x != y, one, zero),
                          select(!(x < y) && (y < z), one, zero),
                          select((x < y) || (y < z), one, zero)};
  };
  auto const same = [](Real a, Real b) { return std::memcmp(&a, &b, sizeof a) == 0 || (a != a && b != b); };
  for (int i = 0; i < n * n; ++i) {
    P x, y, z;
    for (int l = 0; l < W; ++l) {
      x.set(l, numbers[(i + l) % n]);
      y.set(l, numbers[(i / n + 2 * l) % n]);
      z.set(l, numbers[(i + 7 * l) % n]);
    }
    auto const mixed = all_functions(x, y, z);
    for (int l = 0; l < W; ++l) {
      auto const alone = all_functions(P(x[l]), P(y[l]), P(z[l]));
      for (std::size_t f = 0; f < mixed.size(); ++f) {
        CAPTURE(f);
        CAPTURE(x[l]);
        CAPTURE(y[l]);
        CAPTURE(z[l]);
        CHECK(same(mixed[f][l], alone[f][0]));
      }
    }
  }
}

// A branch on lanes is refused where it is written, and whole numbers stand beside packs as beside numbers.
TEST_CASE_TEMPLATE("a mask is no condition, and packs compare with whole numbers", Real, float, double) {
  constexpr int W = gsp::native_width<Real>;
  static_assert(!std::is_constructible_v<bool, gsp::Mask<Real, W>>);
  gsp::Pack<Real, W> x;
  for (int l = 0; l < W; ++l) x.set(l, Real(l));
  for (int l = 0; l < W; ++l) {
    CHECK((x < 2)[l] == (l < 2));
    CHECK((x <= 2)[l] == (l <= 2));
    CHECK((x > 2)[l] == (l > 2));
    CHECK((x >= 2)[l] == (l >= 2));
    CHECK((x == 2)[l] == (l == 2));
    CHECK((x != 2)[l] == (l != 2));
    CHECK((2 < x)[l] == (2 < l));
    CHECK((2 >= x)[l] == (2 >= l));
  }
}
// Bit i of lane_bits is lane i, of every width that is used; any and all follow from them.
TEST_CASE_TEMPLATE("the bits of a mask are its lanes", T, gsp::Pack<float, 4>, gsp::Pack<float, 8>, gsp::Pack<float, 16>,
                   gsp::Pack<double, 2>, gsp::Pack<double, 4>, gsp::Pack<double, 8>) {
  typename T::mask_type m = T(1) < T(0);
  CHECK(gsp::lane_bits(m) == 0u);
  CHECK(!gsp::any(m));
  std::uint32_t bits = 0;
  std::mt19937 random(1);
  for (int k = 0; k < 200; ++k) {
    int const l = int(random() % T::width);
    bool const on = random() % 2 != 0;
    m.set(l, on);
    bits = (bits & ~(1u << l)) | std::uint32_t(on) << l;
    CHECK(gsp::lane_bits(m) == bits);
    CHECK(gsp::any(m) == (bits != 0));
    CHECK(gsp::all(m) == (bits == (1u << T::width) - 1));
  }
  for (int l = 0; l < T::width; ++l) m.set(l, true);
  CHECK(gsp::all(m));
}
