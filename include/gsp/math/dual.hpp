#pragma once
#include <gsp/math/scalar.hpp>

/// Dual number with N derivatives: arithmetic on it carries exact derivatives along (forward differentiation).
namespace gsp {

template <class T, int N = 1>
struct Dual {
  using real_type = T;
  T value;
  T slope[N];
  Dual() = default;
  GSP_FUNCTION Dual(T v) : value(v), slope{} {}
  /// The variable number `i`.
  GSP_FUNCTION static Dual variable(T v, int i) {
    Dual d(v);
    d.slope[i] = T(1);
    return d;
  }
  // by value alone; of packs a mask
  friend GSP_FUNCTION auto operator<(Dual const& a, Dual const& b) { return a.value < b.value; }
  friend GSP_FUNCTION auto operator>(Dual const& a, Dual const& b) { return a.value > b.value; }
  friend GSP_FUNCTION auto operator<=(Dual const& a, Dual const& b) { return a.value <= b.value; }
  friend GSP_FUNCTION auto operator>=(Dual const& a, Dual const& b) { return a.value >= b.value; }
  friend GSP_FUNCTION auto operator==(Dual const& a, Dual const& b) { return a.value == b.value; }
  // beside numbers of any arithmetic type, as in the arithmetic below
  template <class S>
  requires std::is_arithmetic_v<S>
  friend GSP_FUNCTION auto operator<(Dual const& a, S b) { return a.value < T(b); }
  template <class S>
  requires std::is_arithmetic_v<S>
  friend GSP_FUNCTION auto operator<(S a, Dual const& b) { return T(a) < b.value; }
  template <class S>
  requires std::is_arithmetic_v<S>
  friend GSP_FUNCTION auto operator>(Dual const& a, S b) { return a.value > T(b); }
  template <class S>
  requires std::is_arithmetic_v<S>
  friend GSP_FUNCTION auto operator>(S a, Dual const& b) { return T(a) > b.value; }
  template <class S>
  requires std::is_arithmetic_v<S>
  friend GSP_FUNCTION auto operator<=(Dual const& a, S b) { return a.value <= T(b); }
  template <class S>
  requires std::is_arithmetic_v<S>
  friend GSP_FUNCTION auto operator<=(S a, Dual const& b) { return T(a) <= b.value; }
  template <class S>
  requires std::is_arithmetic_v<S>
  friend GSP_FUNCTION auto operator>=(Dual const& a, S b) { return a.value >= T(b); }
  template <class S>
  requires std::is_arithmetic_v<S>
  friend GSP_FUNCTION auto operator>=(S a, Dual const& b) { return T(a) >= b.value; }
};

namespace detail {
/// f with value v and df/da = s
template <class T, int N>
GSP_FUNCTION Dual<T, N> chain(Dual<T, N> a, T v, T s) {
  a.value = v;
  for (int i = 0; i < N; ++i) a.slope[i] = s * a.slope[i];
  return a;
}
}  // namespace detail

template <class T, int N>
GSP_FUNCTION Dual<T, N> operator-(Dual<T, N> const& a) {
  return detail::chain(a, -a.value, T(-1));
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> operator+(Dual<T, N> a, Dual<T, N> const& b) {
  a.value = a.value + b.value;
  for (int i = 0; i < N; ++i) a.slope[i] = a.slope[i] + b.slope[i];
  return a;
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> operator-(Dual<T, N> const& a, Dual<T, N> const& b) {
  return a + (-b);
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> operator*(Dual<T, N> const& a, Dual<T, N> const& b) {
  Dual<T, N> c(a.value * b.value);
  for (int i = 0; i < N; ++i) c.slope[i] = a.slope[i] * b.value + a.value * b.slope[i];
  return c;
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> operator/(Dual<T, N> const& a, Dual<T, N> const& b) {
  T const inverse = T(1) / b.value;
  Dual<T, N> c(a.value * inverse);
  for (int i = 0; i < N; ++i) c.slope[i] = (a.slope[i] - c.value * b.slope[i]) * inverse;
  return c;
}
// numbers on either side, of any arithmetic type
template <class T, int N, class S>
requires std::is_arithmetic_v<S> GSP_FUNCTION Dual<T, N>
operator+(Dual<T, N> const& a, S b) { return a + Dual<T, N>(T(b)); }
template <class T, int N, class S>
requires std::is_arithmetic_v<S> GSP_FUNCTION Dual<T, N>
operator+(S a, Dual<T, N> const& b) { return Dual<T, N>(T(a)) + b; }
template <class T, int N, class S>
requires std::is_arithmetic_v<S> GSP_FUNCTION Dual<T, N>
operator-(Dual<T, N> const& a, S b) { return a - Dual<T, N>(T(b)); }
template <class T, int N, class S>
requires std::is_arithmetic_v<S> GSP_FUNCTION Dual<T, N>
operator-(S a, Dual<T, N> const& b) { return Dual<T, N>(T(a)) - b; }
template <class T, int N, class S>
requires std::is_arithmetic_v<S> GSP_FUNCTION Dual<T, N>
operator*(Dual<T, N> const& a, S b) { return detail::chain(a, a.value * T(b), T(b)); }
template <class T, int N, class S>
requires std::is_arithmetic_v<S> GSP_FUNCTION Dual<T, N>
operator*(S a, Dual<T, N> const& b) { return b * a; }
template <class T, int N, class S>
requires std::is_arithmetic_v<S> GSP_FUNCTION Dual<T, N>
operator/(Dual<T, N> const& a, S b) { return a * (T(1) / T(b)); }
template <class T, int N, class S>
requires std::is_arithmetic_v<S> GSP_FUNCTION Dual<T, N>
operator/(S a, Dual<T, N> const& b) { return Dual<T, N>(T(a)) / b; }
// the number below on either side, where it is a pack or a dual itself
template <class T, int N>
requires(!std::is_arithmetic_v<T>) GSP_FUNCTION Dual<T, N>
operator+(Dual<T, N> const& a, std::type_identity_t<T> const& b) { return a + Dual<T, N>(b); }
template <class T, int N>
requires(!std::is_arithmetic_v<T>) GSP_FUNCTION Dual<T, N>
operator+(std::type_identity_t<T> const& a, Dual<T, N> const& b) { return Dual<T, N>(a) + b; }
template <class T, int N>
requires(!std::is_arithmetic_v<T>) GSP_FUNCTION Dual<T, N>
operator-(Dual<T, N> const& a, std::type_identity_t<T> const& b) { return a - Dual<T, N>(b); }
template <class T, int N>
requires(!std::is_arithmetic_v<T>) GSP_FUNCTION Dual<T, N>
operator-(std::type_identity_t<T> const& a, Dual<T, N> const& b) { return Dual<T, N>(a) - b; }
template <class T, int N>
requires(!std::is_arithmetic_v<T>) GSP_FUNCTION Dual<T, N>
operator*(Dual<T, N> const& a, std::type_identity_t<T> const& b) { return detail::chain(a, a.value * b, b); }
template <class T, int N>
requires(!std::is_arithmetic_v<T>) GSP_FUNCTION Dual<T, N>
operator*(std::type_identity_t<T> const& a, Dual<T, N> const& b) { return b * a; }
template <class T, int N>
requires(!std::is_arithmetic_v<T>) GSP_FUNCTION Dual<T, N>
operator/(Dual<T, N> const& a, std::type_identity_t<T> const& b) { return a * (T(1) / b); }
template <class T, int N>
requires(!std::is_arithmetic_v<T>) GSP_FUNCTION Dual<T, N>
operator/(std::type_identity_t<T> const& a, Dual<T, N> const& b) { return Dual<T, N>(a) / b; }
template <class T, int N, class S>
GSP_FUNCTION Dual<T, N>& operator+=(Dual<T, N>& a, S const& b) {
  return a = a + b;
}
template <class T, int N, class S>
GSP_FUNCTION Dual<T, N>& operator-=(Dual<T, N>& a, S const& b) {
  return a = a - b;
}
template <class T, int N, class S>
GSP_FUNCTION Dual<T, N>& operator*=(Dual<T, N>& a, S const& b) {
  return a = a * b;
}
template <class T, int N, class S>
GSP_FUNCTION Dual<T, N>& operator/=(Dual<T, N>& a, S const& b) {
  return a = a / b;
}

template <class T, int N>
GSP_FUNCTION Dual<T, N> select(bool m, Dual<T, N> const& a, Dual<T, N> const& b) {
  return m ? a : b;
}
template <class M, class T, int N>
requires(!std::is_same_v<M, bool>) GSP_FUNCTION Dual<T, N> select(M const& m, Dual<T, N> a, Dual<T, N> const& b) {
  a.value = select(m, a.value, b.value);
  for (int i = 0; i < N; ++i) a.slope[i] = select(m, a.slope[i], b.slope[i]);
  return a;
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> min(Dual<T, N> const& a, Dual<T, N> const& b) {
  return select(b < a, b, a);
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> max(Dual<T, N> const& a, Dual<T, N> const& b) {
  return select(a < b, b, a);
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> abs(Dual<T, N> const& a) {
  return select(a.value < T(0), -a, a);
}
/// Slope 0 at 0, where norms have their kink: what the norm scales is 0 there.
template <class T, int N>
GSP_FUNCTION Dual<T, N> sqrt(Dual<T, N> const& a) {
  T const root = sqrt(a.value);
  return detail::chain(a, root, select(root == T(0), T(0), T(0.5) / root));
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> exp(Dual<T, N> const& a) {
  T const e = exp(a.value);
  return detail::chain(a, e, e);
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> log(Dual<T, N> const& a) {
  return detail::chain(a, T(log(a.value)), T(1) / a.value);
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> sin(Dual<T, N> const& a) {
  return detail::chain(a, T(sin(a.value)), T(cos(a.value)));
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> cos(Dual<T, N> const& a) {
  return detail::chain(a, T(cos(a.value)), -T(sin(a.value)));
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> fma(Dual<T, N> const& a, Dual<T, N> const& b, Dual<T, N> const& c) {
  return a * b + c;
}
template <class T, int N>
GSP_FUNCTION void sincos(Dual<T, N> const& a, Dual<T, N>& s, Dual<T, N>& c) {
  T vs, vc;
  sincos(a.value, vs, vc);
  s = detail::chain(a, vs, vc);
  c = detail::chain(a, vc, -vs);
}
template <class T, int N>
GSP_FUNCTION Dual<T, N> atan2(Dual<T, N> const& y, Dual<T, N> const& x) {
  T const inverse = T(1) / (x.value * x.value + y.value * y.value);
  Dual<T, N> r(T(atan2(y.value, x.value)));
  for (int i = 0; i < N; ++i) r.slope[i] = (x.value * y.slope[i] - y.value * x.slope[i]) * inverse;
  return r;
}

}  // namespace gsp
