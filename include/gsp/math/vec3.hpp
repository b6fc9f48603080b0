#pragma once
#include <gsp/math/scalar.hpp>

namespace gsp {

/// Three numbers: a position [m], direction, velocity ... T is float, double, Pack or Dual.
template <class T>
struct Vec3 {
  T x, y, z;
  GSP_FUNCTION T& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
  GSP_FUNCTION T const& operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
};

template <class T>
GSP_FUNCTION Vec3<T> operator+(Vec3<T> const& a, Vec3<T> const& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
GSP_FUNCTION Vec3<T> operator-(Vec3<T> const& a, Vec3<T> const& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class T>
GSP_FUNCTION Vec3<T> operator-(Vec3<T> const& a) {
  return {-a.x, -a.y, -a.z};
}
template <class T>
GSP_FUNCTION Vec3<T> operator*(T s, Vec3<T> const& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class T>
GSP_FUNCTION Vec3<T> operator*(Vec3<T> const& a, T s) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class T>
GSP_FUNCTION Vec3<T>& operator+=(Vec3<T>& a, Vec3<T> const& b) {
  return a = a + b;
}
template <class T>
GSP_FUNCTION Vec3<T>& operator-=(Vec3<T>& a, Vec3<T> const& b) {
  return a = a - b;
}
template <class T>
GSP_FUNCTION T dot(Vec3<T> const& a, Vec3<T> const& b) {
  return fma(a.z, b.z, fma(a.y, b.y, a.x * b.x));
}
template <class T>
GSP_FUNCTION Vec3<T> cross(Vec3<T> const& a, Vec3<T> const& b) {
  return {fma(a.y, b.z, -(a.z * b.y)), fma(a.z, b.x, -(a.x * b.z)), fma(a.x, b.y, -(a.y * b.x))};
}
template <class T>
GSP_FUNCTION T norm(Vec3<T> const& a) {
  return sqrt(dot(a, a));
}
/// a + s b
template <class T>
GSP_FUNCTION Vec3<T> fma(T s, Vec3<T> const& b, Vec3<T> const& a) {
  return {fma(s, b.x, a.x), fma(s, b.y, a.y), fma(s, b.z, a.z)};
}
template <class T>
GSP_FUNCTION Vec3<T> select(auto m, Vec3<T> const& a, Vec3<T> const& b) {
  return {select(m, a.x, b.x), select(m, a.y, b.y), select(m, a.z, b.z)};
}

/// a / |a|; the x axis where |a| is below the smallest length that has a direction (1e-15, as MuJoCo's mju_normalize3).
template <class T>
GSP_FUNCTION Vec3<T> normalized(Vec3<T> const& a) {
  T const n = norm(a);
  auto const ok = n >= T(1e-15);
  T const inverse = T(1) / select(ok, n, T(1));
  return {select(ok, a.x * inverse, T(1)), select(ok, a.y * inverse, T(0)), select(ok, a.z * inverse, T(0))};
}

}  // namespace gsp
