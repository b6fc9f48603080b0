#pragma once
#include <gsp/ray/ray_shapes.hpp>

/// Rays go alone on a device, and in packs on a host: T is one ray's number, or a pack with a ray a lane. What code for both needs of
/// lanes. No Kokkos.
namespace gsp {

/// A whole number a ray of T, -1 at first: which geom it has met, which triangle.
template <class T>
struct LaneIndex {
  int value = -1;
  GSP_FUNCTION int operator[](int) const { return value; }
  GSP_FUNCTION void set(bool where, int to) { value = where ? to : value; }
  GSP_FUNCTION void set_lane(int, int to) { value = to; }
  GSP_FUNCTION void take(bool where, LaneIndex const& from) { set(where, from.value); }
  GSP_FUNCTION bool is_above(int other) const { return value > other; }
  GSP_FUNCTION bool is_there() const { return value >= 0; }
};
template <class R, int W>
struct LaneIndex<Pack<R, W>> {
  using Mask = gsp::Mask<R, W>;
  Mask value;  // a number a lane, as wide as the lane's number is
  GSP_FUNCTION LaneIndex() {
    for (int l = 0; l < W; ++l) value.v[l] = -1;
  }
  GSP_FUNCTION int operator[](int lane) const { return int(value.v[lane]); }
  GSP_FUNCTION void set_lane(int lane, int to) { value.v[lane] = to; }
  GSP_FUNCTION void take(Mask where, LaneIndex const& from) {
    for (int l = 0; l < W; ++l) value.v[l] = where[l] ? from.value.v[l] : value.v[l];
  }
#ifdef __CUDA_ARCH__
  GSP_FUNCTION void set(Mask where, int to) {
    for (int l = 0; l < W; ++l) value.v[l] = where[l] ? to : value.v[l];
  }
  GSP_FUNCTION Mask is_above(int other) const {
    Mask m;
    for (int l = 0; l < W; ++l) m.set(l, value.v[l] > other);
    return m;
  }
#else
  GSP_FUNCTION void set(Mask where, int to) { value.v = where.v ? to - typename Mask::vec{} : value.v; }
  GSP_FUNCTION Mask is_above(int other) const {
    Mask m;
    m.v = value.v > other - typename Mask::vec{};
    return m;
  }
#endif
  GSP_FUNCTION Mask is_there() const { return is_above(-1); }
};

/// How many rays a T holds, and the number of one of them: read, written, or all by f(lane).
template <class T>
inline constexpr int lanes_of = 1;
template <class R, int W>
inline constexpr int lanes_of<Pack<R, W>> = W;
template <Scalar T>
GSP_FUNCTION T lane_of(T x, int) {
  return x;
}
template <class R, int W>
GSP_FUNCTION R lane_of(Pack<R, W> const& x, int lane) {
  return x[lane];
}
template <Scalar T>
GSP_FUNCTION Vec3<T> lane_of(Vec3<T> const& v, int) {
  return v;
}
template <class R, int W>
GSP_FUNCTION Vec3<R> lane_of(Vec3<Pack<R, W>> const& v, int lane) {
  return {v.x[lane], v.y[lane], v.z[lane]};
}
template <Scalar T>
GSP_FUNCTION Ray<T> lane_of(Ray<T> const& ray, int) {
  return ray;
}
template <class R, int W>
GSP_FUNCTION Ray<R> lane_of(Ray<Pack<R, W>> const& ray, int lane) {
  return {lane_of(ray.origin, lane), lane_of(ray.direction, lane)};
}
template <class T, class F>
GSP_FUNCTION T of_lanes(F const& f) {
  if constexpr (Scalar<T>)
    return f(0);
  else
    return T::of(f);
}
template <Scalar T>
GSP_FUNCTION void set_lane_of(T& x, int, T value) {
  x = value;
}
template <class R, int W>
GSP_FUNCTION void set_lane_of(Pack<R, W>& x, int lane, R value) {
  x.set(lane, value);
}

namespace detail {
/// Bit l: it holds in lane l.
GSP_FUNCTION std::uint32_t bits_of(bool mask) { return mask; }
template <class R, int W>
GSP_FUNCTION std::uint32_t bits_of(Mask<R, W> mask) {
  return lane_bits(mask);
}

/// Whether it holds in most lanes.
GSP_FUNCTION bool mostly(bool mask) { return mask; }
template <class R, int W>
GSP_FUNCTION bool mostly(Mask<R, W> mask) {
#ifdef __CUDA_ARCH__
  return any(mask);  // device code never runs packs
#else
  return 2 * __builtin_popcount(lane_bits(mask)) > W;
#endif
}

}  // namespace detail

}  // namespace gsp
