#pragma once
#include <cmath>
#include <gsp/core/function.hpp>
#include <type_traits>

/// The number vocabulary that kernels are written in. Each function exists for float and double (here), for `Pack` (pack.hpp: one SIMD lane
/// per world or instance) and for `Dual` (dual.hpp), so that one source serves the CPU's vectors, the GPU's threads, references and
/// derivatives. Comparisons give a mask (bool here), and `select(mask, a, b)` takes the place of a branch.
namespace gsp {

template <class T>
concept Scalar = std::is_floating_point_v<T>;

/// Real type below a number type: float for float, Pack<float, 16>, Dual<float>.
template <class T>
struct real_of {
  using type = typename T::real_type;
};
template <Scalar T>
struct real_of<T> {
  using type = T;
};
template <class T>
using real_t = typename real_of<T>::type;

template <Scalar T>
GSP_FUNCTION T sqrt(T x) {
  return std::sqrt(x);
}
template <Scalar T>
GSP_FUNCTION T exp(T x) {
  return std::exp(x);
}
template <Scalar T>
GSP_FUNCTION T log(T x) {
  return std::log(x);
}
template <Scalar T>
GSP_FUNCTION T sin(T x) {
  return std::sin(x);
}
template <Scalar T>
GSP_FUNCTION T cos(T x) {
  return std::cos(x);
}
template <Scalar T>
GSP_FUNCTION T atan2(T y, T x) {
  return std::atan2(y, x);
}
template <Scalar T>
GSP_FUNCTION T abs(T x) {
  return std::abs(x);
}
template <Scalar T>
GSP_FUNCTION T min(T a, T b) {
  return b < a ? b : a;
}
template <Scalar T>
GSP_FUNCTION T max(T a, T b) {
  return a < b ? b : a;
}
template <Scalar T>
GSP_FUNCTION T select(bool m, T a, T b) {
  return m ? a : b;
}
/// The greater one; NaN where one of them is.
template <class T>
GSP_FUNCTION T max_or_nan(T const& a, T const& b) {
  return select(a >= b, a, select(a == a, b, a));
}
GSP_FUNCTION constexpr bool any(bool m) { return m; }
GSP_FUNCTION constexpr bool all(bool m) { return m; }

template <Scalar T>
GSP_FUNCTION void sincos(T x, T& s, T& c) {
#ifdef __CUDA_ARCH__
  if constexpr (sizeof(T) == 4)
    ::sincosf(x, &s, &c);
  else
    ::sincos(x, &s, &c);
#else
  s = std::sin(x);
  c = std::cos(x);
#endif
}

/// a b + c, in one rounding where the hardware has it.
template <Scalar T>
GSP_FUNCTION T fma(T a, T b, T c) {
#if defined(__CUDA_ARCH__) || defined(__FMA__) || defined(__ARM_FEATURE_FMA)
  if constexpr (sizeof(T) == 4)
    return __builtin_fmaf(a, b, c);
  else
    return __builtin_fma(a, b, c);
#else
  return a * b + c;
#endif
}

template <class T>
GSP_FUNCTION T clamp(T x, T lo, T hi) {
  return min(max(x, lo), hi);
}
template <class T>
GSP_FUNCTION T square(T x) {
  return x * x;
}

/// high + low = a + b to the last bit, high the rounded sum (Knuth 1969, two-sum; where nothing overflows).
template <class T>
struct TwoSum {
  T high, low;
};
template <class T>
GSP_FUNCTION TwoSum<T> two_sum(T const& a, T const& b) {
  T const sum = a + b, part = sum - a;
  return {sum, (a - (sum - part)) + (b - part)};
}

}  // namespace gsp
