#pragma once
#include <Kokkos_Core.hpp>
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
KOKKOS_INLINE_FUNCTION T sqrt(T x) {
  return Kokkos::sqrt(x);
}
template <Scalar T>
KOKKOS_INLINE_FUNCTION T exp(T x) {
  return Kokkos::exp(x);
}
template <Scalar T>
KOKKOS_INLINE_FUNCTION T log(T x) {
  return Kokkos::log(x);
}
template <Scalar T>
KOKKOS_INLINE_FUNCTION T sin(T x) {
  return Kokkos::sin(x);
}
template <Scalar T>
KOKKOS_INLINE_FUNCTION T cos(T x) {
  return Kokkos::cos(x);
}
template <Scalar T>
KOKKOS_INLINE_FUNCTION T atan2(T y, T x) {
  return Kokkos::atan2(y, x);
}
template <Scalar T>
KOKKOS_INLINE_FUNCTION T abs(T x) {
  return Kokkos::abs(x);
}
template <Scalar T>
KOKKOS_INLINE_FUNCTION T min(T a, T b) {
  return b < a ? b : a;
}
template <Scalar T>
KOKKOS_INLINE_FUNCTION T max(T a, T b) {
  return a < b ? b : a;
}
template <Scalar T>
KOKKOS_INLINE_FUNCTION T select(bool m, T a, T b) {
  return m ? a : b;
}
KOKKOS_INLINE_FUNCTION constexpr bool any(bool m) { return m; }
KOKKOS_INLINE_FUNCTION constexpr bool all(bool m) { return m; }

template <Scalar T>
KOKKOS_INLINE_FUNCTION void sincos(T x, T& s, T& c) {
#ifdef __CUDA_ARCH__
  if constexpr (sizeof(T) == 4)
    ::sincosf(x, &s, &c);
  else
    ::sincos(x, &s, &c);
#else
  s = Kokkos::sin(x), c = Kokkos::cos(x);
#endif
}

/// a b + c, in one rounding where the hardware has it.
template <Scalar T>
KOKKOS_INLINE_FUNCTION T fma(T a, T b, T c) {
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
KOKKOS_INLINE_FUNCTION T clamp(T x, T lo, T hi) {
  return min(max(x, lo), hi);
}
template <class T>
KOKKOS_INLINE_FUNCTION T square(T x) {
  return x * x;
}

}  // namespace gsp
