#pragma once
#if !defined(__CUDA_ARCH__) && (defined(__AVX2__) || defined(__AVX512F__))
#include <immintrin.h>
#endif
#include <cmath>
#include <cstdint>
#include <gsp/math/scalar.hpp>
#include <initializer_list>
#include <utility>

/// `Pack<Real, W>`: W numbers that go through a kernel together on a CPU, one lane per world or instance (GPU: a lane is a thread, and T =
/// Real). It brings its own sin, cos, exp and sqrt, so that no compiler flag beyond the target's instruction set is needed, and W is fixed
/// once per binary by that instruction set: 16 float or 8 double lanes with AVX-512, 8/4 with AVX2, else 4/2. The width stands in an inline
/// namespace, so that packs of files compiled for different instruction sets do not mix (nor may whole kernels:
/// dynamics/detail/one_width.hpp).
#if defined(__AVX512F__)
#define GSP_PACK_BYTES 64
#define GSP_PACK_NAMESPACE pack512
#elif defined(__AVX2__)
#define GSP_PACK_BYTES 32
#define GSP_PACK_NAMESPACE pack256
#else
#define GSP_PACK_BYTES 16
#define GSP_PACK_NAMESPACE pack128
#endif

namespace gsp {
inline namespace GSP_PACK_NAMESPACE {

template <class Real>
inline constexpr int native_width = GSP_PACK_BYTES / int(sizeof(Real));

namespace pack_detail {
template <class Real>
struct pack_int {
  using type = int;
};
template <>
struct pack_int<double> {
  using type = long long;
};
}  // namespace pack_detail

/// Result of comparing packs: all bits of a lane set where it holds.
template <class Real, int W>
struct alignas(sizeof(Real) * W) Mask {
  using Int = typename pack_detail::pack_int<Real>::type;
#ifdef __CUDA_ARCH__
  Int v[W];  // a thread of a GPU has no vectors: numbers one by one
#else
  typedef Int vec __attribute__((vector_size(sizeof(Real) * W)));
  vec v;
#endif
  GSP_FUNCTION bool operator[](int i) const { return v[i] != 0; }
  GSP_FUNCTION void set(int i, bool b) { v[i] = b ? Int(-1) : Int(0); }
  // Lanes go different ways. A compiler that refuses a branch prints the line below, so it says what to write.
  explicit operator bool() const = delete;  // no `if`, `?:`, `&&` of numbers here: select(mask, a, b); any(mask), all(mask)
};

template <class Real, int W>
struct alignas(sizeof(Real) * W) Pack {
  using real_type = Real;
  using mask_type = Mask<Real, W>;
  static constexpr int width = W;
#ifdef __CUDA_ARCH__
  Real v[W];
#else
  typedef Real vec __attribute__((vector_size(sizeof(Real) * W)));
  vec v;
#endif
  Pack() = default;
  GSP_FUNCTION Pack(Real x) {
#ifdef __CUDA_ARCH__
    for (int i = 0; i < W; ++i) v[i] = x;
#else
    v = x - vec{};
#endif
  }
  template <class S>
  requires(std::is_arithmetic_v<S> && !std::is_same_v<S, Real>) GSP_FUNCTION Pack(S x) : Pack(Real(x)) {}
  GSP_FUNCTION Real operator[](int i) const { return v[i]; }
  GSP_FUNCTION void set(int i, Real x) { v[i] = x; }
  /// Lane i is f(i). Put together in registers: a pack that is loaded right after its lanes were stored waits until they are in the cache.
  template <class F>
  GSP_FUNCTION static Pack of(F const& f) {
    return of(f, std::make_integer_sequence<int, W>{});
  }

 private:
  template <class F, int... i>
  GSP_FUNCTION static Pack of(F const& f, std::integer_sequence<int, i...>) {
    Pack p;
#ifdef __CUDA_ARCH__
    ((p.v[i] = f(i)), ...);
#else
    p.v = vec{Real(f(i))...};
#endif
    return p;
  }
};

// One macro a kind of operator, undefined below: on the host the compiler's vector types do the work.
#ifdef __CUDA_ARCH__
#define GSP_PACK_OP(op)                                             \
  template <class R, int W>                                         \
  GSP_FUNCTION Pack<R, W> operator op(Pack<R, W> a, Pack<R, W> b) { \
    for (int i = 0; i < W; ++i) a.v[i] = a.v[i] op b.v[i];          \
    return a;                                                       \
  }
#define GSP_PACK_CMP(op)                                            \
  template <class R, int W>                                         \
  GSP_FUNCTION Mask<R, W> operator op(Pack<R, W> a, Pack<R, W> b) { \
    Mask<R, W> m;                                                   \
    for (int i = 0; i < W; ++i) m.set(i, a.v[i] op b.v[i]);         \
    return m;                                                       \
  }
#define GSP_MASK_OP(op)                                                 \
  template <class R, int W>                                             \
  GSP_FUNCTION Mask<R, W> operator op##op(Mask<R, W> a, Mask<R, W> b) { \
    for (int i = 0; i < W; ++i) a.v[i] = a.v[i] op b.v[i];              \
    return a;                                                           \
  }
#else
#define GSP_PACK_OP(op)                                             \
  template <class R, int W>                                         \
  GSP_FUNCTION Pack<R, W> operator op(Pack<R, W> a, Pack<R, W> b) { \
    a.v = a.v op b.v;                                               \
    return a;                                                       \
  }
#define GSP_PACK_CMP(op)                                            \
  template <class R, int W>                                         \
  GSP_FUNCTION Mask<R, W> operator op(Pack<R, W> a, Pack<R, W> b) { \
    Mask<R, W> m;                                                   \
    m.v = a.v op b.v;                                               \
    return m;                                                       \
  }
#define GSP_MASK_OP(op)                                                 \
  template <class R, int W>                                             \
  GSP_FUNCTION Mask<R, W> operator op##op(Mask<R, W> a, Mask<R, W> b) { \
    a.v = a.v op b.v;                                                   \
    return a;                                                           \
  }
#endif
#define GSP_PACK_MIXED(op, Result)                           \
  template <class R, int W>                                  \
  GSP_FUNCTION Result<R, W> operator op(Pack<R, W> a, R b) { \
    return a op Pack<R, W>(b);                               \
  }                                                          \
  template <class R, int W>                                  \
  GSP_FUNCTION Result<R, W> operator op(R a, Pack<R, W> b) { \
    return Pack<R, W>(a) op b;                               \
  }
// whole numbers, as of a number on a GPU: `x > 0`; others are rounded to R by the one and not by the other, so they are said with R or T
#define GSP_PACK_WHOLE(op)                                                                            \
  template <class R, int W, class S>                                                                  \
  requires std::is_integral_v<S> GSP_FUNCTION Mask<R, W> operator op(Pack<R, W> a, S b) {             \
    return a op Pack<R, W>(R(b));                                                                     \
  }                                                                                                   \
  template <class R, int W, class S>                                                                  \
  requires std::is_integral_v<S> GSP_FUNCTION Mask<R, W> operator op(S a, Pack<R, W> b) {             \
    return Pack<R, W>(R(a)) op b;                                                                     \
  }
GSP_PACK_OP(+)
GSP_PACK_OP(-)
GSP_PACK_OP(*)
GSP_PACK_OP(/)
GSP_PACK_CMP(<)
GSP_PACK_CMP(<=)
GSP_PACK_CMP(>)
GSP_PACK_CMP(>=)
GSP_PACK_CMP(==) GSP_PACK_CMP(!=) GSP_MASK_OP(&) GSP_MASK_OP(|) GSP_PACK_MIXED(+, Pack) GSP_PACK_MIXED(-, Pack) GSP_PACK_MIXED(*, Pack)
    GSP_PACK_MIXED(/, Pack) GSP_PACK_MIXED(<, Mask) GSP_PACK_MIXED(<=, Mask) GSP_PACK_MIXED(>, Mask) GSP_PACK_MIXED(>=, Mask)
        GSP_PACK_MIXED(==, Mask) GSP_PACK_MIXED(!=, Mask)
GSP_PACK_WHOLE(<) GSP_PACK_WHOLE(<=) GSP_PACK_WHOLE(>) GSP_PACK_WHOLE(>=) GSP_PACK_WHOLE(==) GSP_PACK_WHOLE(!=)
#undef GSP_PACK_WHOLE
#undef GSP_PACK_OP
#undef GSP_PACK_CMP
#undef GSP_MASK_OP
#undef GSP_PACK_MIXED

            template <class R, int W>
            GSP_FUNCTION Pack<R, W> operator-(Pack<R, W> a) {
#ifdef __CUDA_ARCH__
  for (int i = 0; i < W; ++i) a.v[i] = -a.v[i];
#else
  a.v = -a.v;
#endif
  return a;
}
template <class R, int W>
GSP_FUNCTION Mask<R, W> operator!(Mask<R, W> a) {
  for (int i = 0; i < W; ++i) a.v[i] = ~a.v[i];
  return a;
}
template <class R, int W, class S>
GSP_FUNCTION Pack<R, W>& operator+=(Pack<R, W>& a, S b) {
  return a = a + b;
}
template <class R, int W, class S>
GSP_FUNCTION Pack<R, W>& operator-=(Pack<R, W>& a, S b) {
  return a = a - b;
}
template <class R, int W, class S>
GSP_FUNCTION Pack<R, W>& operator*=(Pack<R, W>& a, S b) {
  return a = a * b;
}
template <class R, int W, class S>
GSP_FUNCTION Pack<R, W>& operator/=(Pack<R, W>& a, S b) {
  return a = a / b;
}

template <class R, int W>
GSP_FUNCTION Pack<R, W> select(Mask<R, W> m, Pack<R, W> a, Pack<R, W> b) {
#ifdef __CUDA_ARCH__
  for (int i = 0; i < W; ++i) a.v[i] = m[i] ? a.v[i] : b.v[i];
#else
  a.v = m.v ? a.v : b.v;
#endif
  return a;
}
template <class R, int W>
GSP_FUNCTION Pack<R, W> select(Mask<R, W> m, R a, Pack<R, W> b) {
  return select(m, Pack<R, W>(a), b);
}
template <class R, int W>
GSP_FUNCTION Pack<R, W> select(Mask<R, W> m, Pack<R, W> a, R b) {
  return select(m, a, Pack<R, W>(b));
}
/// Bit i: whether lane i holds.
template <class R, int W>
GSP_FUNCTION std::uint32_t lane_bits(Mask<R, W> m) {
#if !defined(__CUDA_ARCH__) && defined(__AVX512DQ__)
  using V = typename Mask<R, W>::vec;
  if constexpr (sizeof(V) == 64 && sizeof(R) == 4) return _mm512_movepi32_mask((__m512i)m.v);
  if constexpr (sizeof(V) == 64 && sizeof(R) == 8) return _mm512_movepi64_mask((__m512i)m.v);
#elif !defined(__CUDA_ARCH__) && defined(__AVX2__)
  using V = typename Mask<R, W>::vec;
  if constexpr (sizeof(V) == 32 && sizeof(R) == 4) return std::uint32_t(_mm256_movemask_ps((__m256)m.v));
  if constexpr (sizeof(V) == 32 && sizeof(R) == 8) return std::uint32_t(_mm256_movemask_pd((__m256d)m.v));
#endif
  std::uint32_t bits = 0;
  for (int i = 0; i < W; ++i) bits |= std::uint32_t(m[i]) << i;
  return bits;
}
template <class R, int W>
GSP_FUNCTION bool any(Mask<R, W> m) {
  return lane_bits(m) != 0;
}
template <class R, int W>
GSP_FUNCTION bool all(Mask<R, W> m) {
  return lane_bits(m) == std::uint32_t((std::uint64_t(1) << W) - 1);
}
template <class R, int W>
GSP_FUNCTION Pack<R, W> min(Pack<R, W> a, Pack<R, W> b) {
  return select(b < a, b, a);
}
template <class R, int W>
GSP_FUNCTION Pack<R, W> max(Pack<R, W> a, Pack<R, W> b) {
  return select(a < b, b, a);
}
template <class R, int W>
GSP_FUNCTION Pack<R, W> abs(Pack<R, W> a) {
  return select(a < R(0), -a, a);
}

template <class R, int W>
GSP_FUNCTION Pack<R, W> fma(Pack<R, W> a, Pack<R, W> b, Pack<R, W> c) {
#if !defined(__CUDA_ARCH__) && defined(__AVX512F__)
  using V = typename Pack<R, W>::vec;
  if constexpr (sizeof(V) == 64 && sizeof(R) == 4)
    a.v = (V)_mm512_fmadd_ps((__m512)a.v, (__m512)b.v, (__m512)c.v);
  else if constexpr (sizeof(V) == 64)
    a.v = (V)_mm512_fmadd_pd((__m512d)a.v, (__m512d)b.v, (__m512d)c.v);
  else if constexpr (sizeof(V) == 32 && sizeof(R) == 4)  // groups of eight (solver/detail/pgs_grouped.hpp)
    a.v = (V)_mm256_fmadd_ps((__m256)a.v, (__m256)b.v, (__m256)c.v);
  else if constexpr (sizeof(V) == 32)  // tiles of four (solver/detail/newton_tiles.hpp)
    a.v = (V)_mm256_fmadd_pd((__m256d)a.v, (__m256d)b.v, (__m256d)c.v);
  else if constexpr (sizeof(V) == 16 && sizeof(R) == 4)
    a.v = (V)_mm_fmadd_ps((__m128)a.v, (__m128)b.v, (__m128)c.v);
  else
    for (int i = 0; i < W; ++i) a.v[i] = gsp::fma(R(a.v[i]), R(b.v[i]), R(c.v[i]));
#elif !defined(__CUDA_ARCH__) && defined(__AVX2__) && defined(__FMA__)
  using V = typename Pack<R, W>::vec;
  if constexpr (sizeof(V) == 32 && sizeof(R) == 4)
    a.v = (V)_mm256_fmadd_ps((__m256)a.v, (__m256)b.v, (__m256)c.v);
  else if constexpr (sizeof(V) == 32)
    a.v = (V)_mm256_fmadd_pd((__m256d)a.v, (__m256d)b.v, (__m256d)c.v);
  else if constexpr (sizeof(V) == 16 && sizeof(R) == 4)
    a.v = (V)_mm_fmadd_ps((__m128)a.v, (__m128)b.v, (__m128)c.v);
  else
    for (int i = 0; i < W; ++i) a.v[i] = gsp::fma(R(a.v[i]), R(b.v[i]), R(c.v[i]));
#else
  for (int i = 0; i < W; ++i) a.v[i] = gsp::fma(R(a.v[i]), R(b.v[i]), R(c.v[i]));
#endif
  return a;
}

template <class R, int W>
GSP_FUNCTION Pack<R, W> sqrt(Pack<R, W> a) {
#if !defined(__CUDA_ARCH__) && defined(__AVX512F__)
  using V = typename Pack<R, W>::vec;
  if constexpr (sizeof(V) == 64 && sizeof(R) == 4)
    a.v = (V)_mm512_maskz_sqrt_ps(0xffff, (__m512)a.v);
  else if constexpr (sizeof(V) == 64)
    a.v = (V)_mm512_maskz_sqrt_pd(0xff, (__m512d)a.v);
  else
    for (int i = 0; i < W; ++i) a.v[i] = gsp::sqrt(R(a.v[i]));
#elif !defined(__CUDA_ARCH__) && defined(__AVX2__)
  using V = typename Pack<R, W>::vec;
  if constexpr (sizeof(V) == 32 && sizeof(R) == 4)
    a.v = (V)_mm256_sqrt_ps((__m256)a.v);
  else if constexpr (sizeof(V) == 32)
    a.v = (V)_mm256_sqrt_pd((__m256d)a.v);
  else
    for (int i = 0; i < W; ++i) a.v[i] = gsp::sqrt(R(a.v[i]));
#else
  for (int i = 0; i < W; ++i) a.v[i] = gsp::sqrt(R(a.v[i]));
#endif
  return a;
}

/// sin and cos together. Range reduction by pi/2 in three parts (Cody and Waite), then the minimax polynomials of the Cephes library:
/// within 2 ulp for |x| < 8192 (float) and 1e9 (double); a lane beyond is evaluated by itself.
template <class R, int W>
GSP_FUNCTION void sincos(Pack<R, W> x, Pack<R, W>& s, Pack<R, W>& c) {
  using P = Pack<R, W>;
  constexpr bool single = sizeof(R) == 4;
  R const magic = single ? R(12582912) : R(6755399441055744.);  // 1.5 * 2^23 or 2^52: adding it rounds to the nearest integer
  P const shifted = fma(x, P(R(0.63661977236758134308)), P(magic));
  P const k = shifted - magic;
  P r = fma(k, P(single ? R(-1.5703125) : R(-1.57079625129699707031e+0)), x);
  r = fma(k, P(single ? R(-4.837512969970703125e-4) : R(-7.54978941586159635336e-8)), r);
  r = fma(k, P(single ? R(-7.549789948768648e-8) : R(-5.39030285815811905290e-15)), r);
  P const z = r * r;
  P ps, pc;
  if constexpr (single) {
    ps = fma(fma(fma(P(R(-1.9515295891e-4)), z, P(R(8.3321608736e-3))), z, P(R(-1.6666654611e-1))), z * r, r);
    pc = fma(fma(fma(P(R(2.443315711809948e-5)), z, P(R(-1.388731625493765e-3))), z, P(R(4.166664568298827e-2))), z * z,
             fma(P(R(-0.5)), z, P(R(1))));
  } else {
    P a(R(1.58962301576546568060e-10));
    for (R coefficient : {R(-2.50507477628578072866e-8), R(2.75573136213857245213e-6), R(-1.98412698295895385996e-4),
                          R(8.33333333332211858878e-3), R(-1.66666666666666307295e-1)})
      a = fma(a, z, P(coefficient));
    ps = fma(a, z * r, r);
    P b(R(-1.13585365213876817300e-11));
    for (R coefficient : {R(2.08757008419747316778e-9), R(-2.75573141792967388112e-7), R(2.48015872888517045348e-5),
                          R(-1.38888888888730564116e-3), R(4.16666666666665929218e-2)})
      b = fma(b, z, P(coefficient));
    pc = fma(b, z * z, fma(P(R(-0.5)), z, P(R(1))));
  }
  P const half = k * R(0.5), odd = k - R(2) * ((half + magic) - magic);          // k mod 2 in {-1, 0, 1}
  P const quarter = k * R(0.25), mod4 = k - R(4) * ((quarter + magic) - magic);  // k mod 4 in {-2 .. 2}
  auto const swap = odd != P(R(0));
  auto const negative_s = (mod4 == P(R(2))) || (mod4 == P(R(-2))) || (mod4 == P(R(-1)));
  auto const negative_c = (mod4 == P(R(2))) || (mod4 == P(R(-2))) || (mod4 == P(R(1)));
  P const sv = select(swap, pc, ps), cv = select(swap, ps, pc);
  s = select(negative_s, -sv, sv);
  c = select(negative_c, -cv, cv);
  R const limit = single ? R(8192) : R(1e9);
  if (all(abs(x) <= P(limit))) return;
  for (int i = 0; i < W; ++i) {
    if (gsp::abs(x[i]) <= limit) continue;
    R si, ci;
    gsp::sincos(x[i], si, ci);
    s.set(i, si);
    c.set(i, ci);
  }
}
template <class R, int W>
GSP_FUNCTION Pack<R, W> sin(Pack<R, W> x) {
  Pack<R, W> s, c;
  sincos(x, s, c);
  return s;
}
template <class R, int W>
GSP_FUNCTION Pack<R, W> cos(Pack<R, W> x) {
  Pack<R, W> s, c;
  sincos(x, s, c);
  return c;
}

/// e^x = 2^k e^r with |r| <= ln2/2; Taylor polynomial of degree 7 (float) or 13 (double), 2 ulp; 0 below and infinity above the range.
template <class R, int W>
GSP_FUNCTION Pack<R, W> exp(Pack<R, W> x) {
  using P = Pack<R, W>;
  constexpr bool single = sizeof(R) == 4;
  R const lowest = single ? R(-87.) : R(-708.), highest = single ? R(88.) : R(709.);
  R const magic = single ? R(12582912) : R(6755399441055744.);
  P const y = min(max(x, P(lowest)), P(highest));
  P const k = fma(y, P(R(1.44269504088896340736)), P(magic)) - magic;
  P r = fma(k, P(single ? R(-0.693359375) : R(-6.93145751953125e-1)), y);
  r = fma(k, P(single ? R(2.12194440e-4) : R(-1.42860682030941723212e-6)), r);
  constexpr int degree = single ? 7 : 13;
  P p(R(1));
  for (int i = degree; i > 0; --i) p = fma(p * r, P(R(1) / R(i)), P(R(1)));
  for (int i = 0; i < W; ++i) p.set(i, x[i] < lowest ? R(0) : x[i] > highest ? gsp::exp(x[i]) : p[i] * std::exp2(k[i]));
  return p;
}
template <class R, int W>
GSP_FUNCTION Pack<R, W> log(Pack<R, W> x) {
  for (int i = 0; i < W; ++i) x.set(i, gsp::log(x[i]));
  return x;
}
template <class R, int W>
GSP_FUNCTION Pack<R, W> atan2(Pack<R, W> y, Pack<R, W> x) {
  for (int i = 0; i < W; ++i) y.set(i, gsp::atan2(y[i], x[i]));
  return y;
}

}  // namespace GSP_PACK_NAMESPACE
}  // namespace gsp
