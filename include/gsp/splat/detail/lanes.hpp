#pragma once
#include <cstring>
#include <gsp/core/exec.hpp>
#include <gsp/math/pack.hpp>

/// The few things that a stage written over a number type T needs besides arithmetic: T is float on a GPU (a Gaussian a thread) and a pack
/// of Gaussians on a CPU.
namespace gsp::detail {

template <class T>
struct Lanes {  // float
  using Wide = double;
  static constexpr int width = 1;
  template <class View>
  KOKKOS_INLINE_FUNCTION static float load(View const& view, int row, int i) {
    return view(row, i);
  }
  template <class View>
  KOKKOS_INLINE_FUNCTION static float load(View const& view, int i) {
    return view(i);
  }
};
KOKKOS_INLINE_FUNCTION double widen(float x) { return x; }
KOKKOS_INLINE_FUNCTION float narrow(double x) { return static_cast<float>(x); }
KOKKOS_INLINE_FUNCTION bool any_lane(bool m) { return m; }

/// Packs: neighbouring Gaussians, not aligned. The views are padded by a pack, so that the last load stays inside. Host only.
template <int W>
struct Lanes<Pack<float, W>> {
  using Wide = Pack<double, W>;
  static constexpr int width = W;
  KOKKOS_INLINE_FUNCTION static Pack<float, W> load(float const* from) {
    Pack<float, W> p;
    std::memcpy(&p.v, from, sizeof p.v);
    return p;
  }
  template <class View>
  KOKKOS_INLINE_FUNCTION static Pack<float, W> load(View const& view, int row, int i) {
    return load(&view(row, i));
  }
  template <class View>
  KOKKOS_INLINE_FUNCTION static Pack<float, W> load(View const& view, int i) {
    return load(&view(i));
  }
};
template <int W>
KOKKOS_INLINE_FUNCTION Pack<double, W> widen(Pack<float, W> const& x) {
  Pack<double, W> r;
#ifdef __CUDA_ARCH__  // never runs there; the compiler still sees it
  for (int i = 0; i < W; ++i) r.v[i] = static_cast<double>(x.v[i]);
#else
  r.v = __builtin_convertvector(x.v, typename Pack<double, W>::vec);
#endif
  return r;
}
template <int W>
KOKKOS_INLINE_FUNCTION Pack<float, W> narrow(Pack<double, W> const& x) {
  Pack<float, W> r;
#ifdef __CUDA_ARCH__  // never runs there; the compiler still sees it
  for (int i = 0; i < W; ++i) r.v[i] = static_cast<float>(x.v[i]);
#else
  r.v = __builtin_convertvector(x.v, typename Pack<float, W>::vec);
#endif
  return r;
}

/// 1 / sqrt(x), sqrt(x) and 1 / x to 2 ulp or better: what a GPU has instructions for, where exact ones are functions of 10 to 50.
KOKKOS_INLINE_FUNCTION float inverse_sqrt(float x) {
#ifdef __CUDA_ARCH__
  return rsqrtf(x);
#else
  return 1.f / Kokkos::sqrt(x);
#endif
}
KOKKOS_INLINE_FUNCTION float near_sqrt(float x) {
#ifdef __CUDA_ARCH__
  float root;
  asm("sqrt.approx.ftz.f32 %0, %1;" : "=f"(root) : "f"(x));
  return root;
#else
  return Kokkos::sqrt(x);
#endif
}
KOKKOS_INLINE_FUNCTION float reciprocal(float x) {
#ifdef __CUDA_ARCH__
  return __fdividef(1.f, x);
#else
  return 1.f / x;
#endif
}
/// Of a number that float holds: two steps of Newton from float's reciprocal (1e-7) square its error twice.
KOKKOS_INLINE_FUNCTION double reciprocal(double x) {
#ifdef __CUDA_ARCH__
  double const rough = double(__fdividef(1.f, static_cast<float>(x))), better = fma(rough, fma(-x, rough, 1.), rough);
  return fma(better, fma(-x, better, 1.), better);
#else
  return 1. / x;
#endif
}
template <class T, int W>
KOKKOS_INLINE_FUNCTION Pack<T, W> reciprocal(Pack<T, W> const& x) {
  return Pack<T, W>(T(1)) / x;
}
template <int W>
KOKKOS_INLINE_FUNCTION Pack<float, W> inverse_sqrt(Pack<float, W> const& x) {
  return Pack<float, W>(1.f) / sqrt(x);
}
template <int W>
KOKKOS_INLINE_FUNCTION Pack<float, W> near_sqrt(Pack<float, W> const& x) {
  return sqrt(x);
}

/// True if a lane of the mask is set.
template <int W>
KOKKOS_INLINE_FUNCTION bool any_lane(Mask<float, W> const& m) {
#if !defined(__CUDA_ARCH__) && defined(__AVX512F__)
  if constexpr (W == 16) return _mm512_test_epi32_mask((__m512i)m.v, (__m512i)m.v) != 0;
#elif !defined(__CUDA_ARCH__) && defined(__AVX2__)
  if constexpr (W == 8) return _mm256_movemask_ps((__m256)m.v) != 0;
#endif
  return any(m);
}

/// 2^x for the blend loops of a CPU, 1.5 ulp, for -120 < x < 120: x = k + f, |f| <= 1/2; polynomial of degree 6 through the Chebyshev nodes
/// for 2^f (3e-9); k goes into the exponent bits.
template <int W>
KOKKOS_INLINE_FUNCTION Pack<float, W> exp2(Pack<float, W> x) {
  using P = Pack<float, W>;
  P const magic(12582912.f);  // 1.5 * 2^23: adding it rounds to the nearest integer, which then stands in the low bits
  P const shifted = x + magic, f = x - (shifted - magic);
  P p(0.00015461444f);
  p = fma(p, f, P(0.0013400428f));
  p = fma(p, f, P(0.0096180567f));
  p = fma(p, f, P(0.055503272f));
  p = fma(p, f, P(0.24022651f));
  p = fma(p, f, P(0.69314721f));
  p = fma(p, f, P(1.f));
#ifndef __CUDA_ARCH__
  // unsigned: what shifts out at the top is meant to
  typedef unsigned Ints __attribute__((vector_size(sizeof(float) * W)));
  p.v = (typename P::vec)((Ints)p.v + ((Ints)shifted.v << 23));
#endif
  return p;
}

}  // namespace gsp::detail
