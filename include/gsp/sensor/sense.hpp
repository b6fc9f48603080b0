#pragma once
#include <concepts>
#include <gsp/core/region.hpp>
#include <gsp/dynamics/world_lanes.hpp>

/// What a sensor is: so many of a kind in a world, so many numbers each, and how they follow from what is on the device (states, poses,
/// contacts, forces, pictures: views that the sensor holds). Where the numbers go, and how worlds are walked, is not its business.
namespace gsp {

/// What a sensor hands its numbers to: put(c, x) for its numbers c = 0 .. size() - 1.
struct AnyPut {
  template <class T>
  KOKKOS_INLINE_FUNCTION void operator()(int /*c*/, T const& /*x*/) const {}
};

namespace detail {
template <class S>
concept SensorCount = requires(S const s) {
  { s.count() } -> std::convertible_to<int>;
};
template <class S>
concept SensorSize = requires(S const s) {
  { s.size() } -> std::convertible_to<int>;
};
template <class S>
concept SensorOfLanes = requires(S const s, WorldLane<float> const lane, int i, AnyPut put) {
  s(lane, i, put);
};
template <class S>
concept SensorOfWorlds = requires(S const s, int world, int i, AnyPut put) {
  s(world, i, put);
};
}  // namespace detail

/// A kind of sensor: copyable to the device, with
///   count()                  sensors of this kind in each world
///   size()                   numbers that each of them gives
///   operator()(world, i, put) const   for sensor i: put(c, x) for c = 0 .. size() - 1, where `world` is
///                            a WorldLane<T> const& (the operator a template on T: a pack of worlds on a CPU), or
///                            an int (one world at a time: for loops whose length differs from world to world, such as over contacts)
/// and, where its numbers do not stand one after the other,
///   adr(i), columns()        the column of sensor i's first number; one beyond the last column of all
///   limit(i, x)              what becomes of each of its numbers on their way (cutoffs)
template <class S>
concept SensorKind = std::copyable<S> && detail::SensorCount<S> && detail::SensorSize<S> &&
    (detail::SensorOfLanes<S> || detail::SensorOfWorlds<S>);

struct SenseOptions {
  int adr = 0;                               // column of the first number
  char const* label = "gsp::sensor::sense";  // of the kernel, for profilers
};

namespace detail {
template <class S, class Data>
struct Sense {
  S sensor;
  Data data;
  int adr;
  template <class T>
  KOKKOS_FUNCTION void operator()(WorldLane<T> const& lane, int i) const {
    int first = adr;
    if constexpr (requires { sensor.adr(i); })
      first += sensor.adr(i);
    else
      first += i * sensor.size();
    if constexpr (SensorOfLanes<S>) {
      sensor(lane, i, [&](int c, T const& x) { lane.store_column(data, first + c, limited(i, x)); });
    } else {
      using R = typename WorldLane<T>::R;
      for (int k = 0; k < lane.count; ++k) {
        int const world = lane.first + k;
        sensor(world, i, [&](int c, R x) { data(world, first + c) = limited(i, x); });
      }
    }
  }
  template <class X>
  KOKKOS_INLINE_FUNCTION X limited(int i, X const& x) const {
    if constexpr (requires { sensor.limit(i, x); })
      return sensor.limit(i, x);
    else
      return x;
  }
};

/// What a sensor holds of gsp's is of as many worlds as data has rows.
template <class S>
void expects_worlds_of(S const& sensor, int rows) {
  auto const check = [&](char const* member, int worlds) {
    if (worlds != rows)
      throw std::invalid_argument("gsp::sense: data has " + std::to_string(rows) + " rows, and the sensor's `" + member + "` " +
                                  std::to_string(worlds) + " worlds: make both with the same number of worlds");
  };
  if constexpr (requires { sensor.state.worlds; }) check("state", int(sensor.state.worlds));
  if constexpr (requires { sensor.poses.xpos.extent(0); }) check("poses", int(sensor.poses.xpos.extent(0)));
  if constexpr (requires { sensor.dynamics.worlds; }) check("dynamics", int(sensor.dynamics.worlds));
  if constexpr (requires { sensor.contacts.worlds; }) check("contacts", int(sensor.contacts.worlds));
}
}  // namespace detail

/// data (world, columns): the numbers of all sensors of a kind, those of sensor i from column options.adr + i size() on; other columns stay
/// as they are. MJCF's sensors (`smooth_sensors`) go through the same function. A `user` sensor of MJCF: {.adr = compiled.sensor_adr[id]}.
/// One launch of worlds x count() items; does not allocate, does not fence; a world's numbers depend on that world alone.
/// Errors: std::invalid_argument for columns that data does not have, and where data's rows are not the worlds of the sensor's members
/// `state`, `poses`, `dynamics`, `contacts`; views of other names are taken as they are.
/// @param sensor  a SensorKind; its views hold the worlds of `data`
/// @param data    of any layout: columns of a wider view, too
template <ExecutionSpace Exec, class S, class Data>
void sense(Exec const& exec, S const& sensor, Data& data, SenseOptions options = {}) {
  Region const region("gsp::sensor::sense");
  static_assert(std::copyable<S>, "gsp::sense: a sensor is copied to the device; give it views and numbers, no references");
  static_assert(detail::SensorCount<S>, "gsp::sense: the sensor has no `int count() const`: how many of its kind each world has");
  static_assert(detail::SensorSize<S>, "gsp::sense: the sensor has no `int size() const`: how many numbers each gives");
  static_assert(
      detail::SensorOfLanes<S> || detail::SensorOfWorlds<S>,
      "gsp::sense: the sensor has no `operator()(world, i, put) const`, `world` an int or a WorldLane<T> const& of any T, `put` of any "
      "type");
  static_assert(can_access<Exec, Data>, "gsp::sense: data is not accessible from this execution space");
  using R = typename Data::non_const_value_type;
  expects(options.adr >= 0, "gsp::sense: adr must not be negative");
  expects(sensor.count() >= 0 && sensor.size() >= 0, "gsp::sense: count() and size() must not be negative");
  detail::expects_worlds_of(sensor, int(data.extent(0)));
  if constexpr (requires { sensor.adr(0); }) {
    static_assert(
        requires { sensor.columns(); }, "gsp::sense: a sensor with adr(i) also has `int columns() const`: the end of the last");
    expects(std::int64_t(options.adr) + sensor.columns() <= std::int64_t(data.extent(1)),
            "gsp::sense: the sensors write to column " + std::to_string(std::int64_t(options.adr) + sensor.columns() - 1) +
                ", and data has " + std::to_string(data.extent(1)) + " columns");
  } else
    expects(options.adr + std::int64_t(sensor.count()) * sensor.size() <= std::int64_t(data.extent(1)),
            "gsp::sense: " + std::to_string(sensor.count()) + " sensors of " + std::to_string(sensor.size()) + " numbers from column " +
                std::to_string(options.adr) + " on do not fit into data with " + std::to_string(data.extent(1)) + " columns");
  for_world_lanes<R>(options.label, exec, int(data.extent(0)), sensor.count(), detail::Sense<S, Data>{sensor, data, options.adr});
}

}  // namespace gsp
