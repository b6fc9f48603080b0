#pragma once
#include <gsp/core/detail/items.hpp>
#include <gsp/dynamics/lanes.hpp>

/// Lanes of worlds, for kernels that go through a whole world or through independent items of it: poses of geoms, sums over trees, sensors.
namespace gsp {

/// One world on a GPU (T is float or double), or as many neighbouring worlds as a pack has numbers on a CPU (T is a Pack): a kernel is
/// written once over T. Views are (world, item[, components]) without gaps (LayoutRight), of numbers R.
template <class T>
struct WorldLane {
  using R = typename detail::width_of<T>::stored;
  static constexpr int W = detail::width_of<T>::value;
  int first, count;  // worlds first .. first + count - 1; lanes beyond repeat the last and store nothing
  KOKKOS_INLINE_FUNCTION int world(int i) const { return first + (i < count ? i : count - 1); }

  /// Component of item i of a view (world, item[, components]).
  template <class View>
  KOKKOS_INLINE_FUNCTION T load(View const& v, int i, int components = 1, int component = 0) const {
    detail::expects_rows<View>();
    std::int64_t const stride = std::int64_t(v.extent(1)) * components;
    R const* const at = v.data() + std::int64_t(i) * components + component;
    if constexpr (W == 1) {
      return at[first * stride];
    } else {
      if (count == W) return detail::gather_consecutive<T>(at + first * stride, stride);
      return T::of([&](int k) { return at[world(k) * stride]; });
    }
  }
  template <class View>
  KOKKOS_INLINE_FUNCTION void store(View const& v, int i, T const& x, int components = 1, int component = 0) const {
    detail::expects_rows<View>();
    store_at(v.data() + std::int64_t(i) * components + component, std::int64_t(v.extent(1)) * components, x);
  }
  /// Number c of a view (world, c) of any layout, such as some columns of another.
  template <class View>
  KOKKOS_INLINE_FUNCTION void store_column(View const& v, int c, T const& x) const {
    store_at(v.data() + std::int64_t(c) * std::int64_t(v.stride(1)), std::int64_t(v.stride(0)), x);
  }
  template <class View>
  KOKKOS_INLINE_FUNCTION Vec3<T> load3(View const& v, int i) const {
    return {load(v, i, 3, 0), load(v, i, 3, 1), load(v, i, 3, 2)};
  }
  template <class View>
  KOKKOS_INLINE_FUNCTION Quat<T> load4(View const& v, int i) const {
    return {load(v, i, 4, 0), load(v, i, 4, 1), load(v, i, 4, 2), load(v, i, 4, 3)};
  }
  template <class View>
  KOKKOS_INLINE_FUNCTION void store3(View const& v, int i, Vec3<T> const& x) const {
    for (int c = 0; c < 3; ++c) store(v, i, x[c], 3, c);
  }
  template <class View>
  KOKKOS_INLINE_FUNCTION void store4(View const& v, int i, Quat<T> const& q) const {
    store(v, i, q.w, 4, 0);
    store(v, i, q.x, 4, 1);
    store(v, i, q.y, 4, 2);
    store(v, i, q.z, 4, 3);
  }
  KOKKOS_INLINE_FUNCTION T constant(Field<R> const& f, int i, int components = 1, int component = 0) const {
    int const at = i * components + component;
    if constexpr (W == 1) {
      return f(first, at);
    } else {
      if (f.stride == 0) return T(f.data[at]);
      return T::of([&](int k) { return f(world(k), at); });
    }
  }
  KOKKOS_INLINE_FUNCTION Vec3<T> constant3(Field<R> const& f, int i) const {
    return {constant(f, i, 3, 0), constant(f, i, 3, 1), constant(f, i, 3, 2)};
  }
  KOKKOS_INLINE_FUNCTION Quat<T> constant4(Field<R> const& f, int i) const {
    return {constant(f, i, 4, 0), constant(f, i, 4, 1), constant(f, i, 4, 2), constant(f, i, 4, 3)};
  }
  /// Item `at` of tree t's scratch.
  template <class Mem>
  KOKKOS_INLINE_FUNCTION T item(Model<R, Mem> const& m, Dynamics<R, Mem> const& d, int t, int at) const {
    if constexpr (W == 1) {
      return d.tree(m, first, t)[at];
    } else {
      return T::of([&](int k) { return d.item(m, world(k), t, at); });
    }
  }

 private:
  /// at: where world 0 has it; stride: from world to world.
  KOKKOS_INLINE_FUNCTION void store_at(R* at, std::int64_t stride, T const& x) const {
    if constexpr (W == 1)
      at[first * stride] = x;
    else if (count == W)
      detail::scatter_consecutive<T>(at + first * stride, stride, x);
    else
      for (int k = 0; k < count; ++k) at[world(k) * stride] = x[k];
  }
};

namespace detail {
template <class T, class F>
struct WorldKernel {
  F f;
  int worlds, items;
  KOKKOS_INLINE_FUNCTION void operator()(std::int64_t i) const {
    constexpr int W = width_of<T>::value;
    RowColumn const at = row_column(i, (worlds + W - 1) / W);
    int const first = at.column * W;
    f(WorldLane<T>{first, worlds - first < W ? worlds - first : W}, at.row);
  }
};
}  // namespace detail

/// f(lane, item) for items 0 .. items - 1 of all worlds; `lane` is a WorldLane<T> of numbers R. One launch; does not allocate, does not
/// fence.
/// @param label  of the kernel, "area::function"
/// @param f      copyable to the device, with a template <class T> void operator()(WorldLane<T> const& lane, int item) const
template <class R, ExecutionSpace Exec, class F>
void for_world_lanes(char const* label, Exec const& exec, int worlds, int items, F const& f) {
  using T = lane_number<Exec, R>;
  int const blocks = (worlds + detail::width_of<T>::value - 1) / detail::width_of<T>::value;
  Kokkos::parallel_for(label, detail::long_range(exec, items, blocks), detail::WorldKernel<T, F>{f, worlds, items});
}

}  // namespace gsp
