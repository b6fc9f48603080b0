#pragma once
#include <gsp/math/pack.hpp>

/// 2^x for the blend loops of a CPU, 1.5 ulp, for -120 < x < 120: x = k + f, |f| <= 1/2; polynomial of degree 6 through the Chebyshev nodes for 2^f (2e-9);
/// k goes into the exponent bits. Host only.
namespace gsp::detail {

template <int W>
inline Pack<float, W> exp2(Pack<float, W> x) {
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
  typedef int Ints __attribute__((vector_size(sizeof(float) * W)));
  p.v = (typename P::vec)((Ints)p.v + ((Ints)shifted.v << 23));
#endif
  return p;
}

/// True if a lane of the mask is set.
template <int W>
inline bool any_lane(Mask<float, W> const& m) {
#if !defined(__CUDA_ARCH__) && defined(__AVX512F__)
  if constexpr (W == 16) return _mm512_test_epi32_mask((__m512i)m.v, (__m512i)m.v) != 0;
#elif !defined(__CUDA_ARCH__) && defined(__AVX2__)
  if constexpr (W == 8) return _mm256_movemask_ps((__m256)m.v) != 0;
#endif
  return any(m);
}

}  // namespace gsp::detail
