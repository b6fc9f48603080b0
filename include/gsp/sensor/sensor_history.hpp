#pragma once
#include <cmath>
#include <gsp/core/detail/views.hpp>
#include <gsp/core/region.hpp>
#include <gsp/dynamics/stamps.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/model/state.hpp>
#include <gsp/sensor/detail/sensor_history_kernels.hpp>
#include <string>
#include <vector>

/// MJCF's sensors that speak late or seldom (delay, interval, nsample, interp): what they have measured, and what they say of it. By
/// MuJoCo's rules, to the bit of its times.
namespace gsp {

/// A sensor that keeps samples; time, value, now: where its numbers begin.
struct SensorHistoryEntry {
  int adr = 0, size = 1, samples = 1;
  Interpolation interpolation = Interpolation::hold;
  double delay = 0, period = 0, phase = 0;  // [s] as SensorHistorySettings has them
  int time = 0, value = 0, now = 0;
};

/// Of all sensors of a model that keep samples, in all worlds. `make_sensor_history` allocates it; `Sensors` has one. Times are double in
/// float builds too.
template <class R, class Mem>
struct SensorHistory {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;
  int columns = 0;      // host: that data has at least
  double timestep = 0;  // [s]
  View<SensorHistoryEntry*> entries;
  View<double*> start;                       // (samples) [s] their times at the start
  View<std::int64_t*> seen;                  // (world) steps at which clock stands
  View<double*> clock;                       // (world) [s] timesteps added up one by one, as MuJoCo adds them
  View<double**> due;                        // (world, entry) [s] when a sensor with an interval was due last
  View<int**> cursor;                        // (world, entry) its newest sample
  View<double**> time;                       // (world, samples) [s]
  View<R**> value;                           // (world, numbers of all samples)
  View<R**> now;                             // (world, numbers) what was true when they were asked last
  detail::SharedStamp<detail::Stamp> asked;  // host: of which state that was
  int count() const { return int(entries.extent(0)); }
};

struct SensorHistoryOptions {
  int worlds = 1;
  double timestep = 0;             // [s] of the steps; 0: the compiled model's
  std::vector<int> left_out = {};  // indices of the model's sensors that are not measured
};

/// Worlds of the mask as at the start: samples of zeros, at times before 0, and time 0. With `reset` of the state. One launch; does not
/// allocate, does not fence. Errors: std::invalid_argument for a mask of another size.
/// @param mask  callable with a world, such as a View<bool*> on the device
template <ExecutionSpace Exec, class R, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void reset_sensor_history(Exec const& exec, SensorHistory<R, Mem>& of, Mask const& mask) {
  Region const region("gsp::sensor::reset_sensor_history");
  detail::expects_mask("gsp::reset_sensor_history", mask, "history of sensors", of.worlds);
  if (of.asked.data()) of.asked() = {};
  Kokkos::parallel_for("gsp::sensor::reset_sensor_history", detail::long_range(exec, of.worlds, of.count()),
                       detail::ResetHistory<SensorHistory<R, Mem>, Mask>{of, mask});
}

namespace detail {
/// Times of the samples at the start: at the steps before 0, or at the steps at which the sensor was due before, where a time that misses a
/// step by rounding alone is the step's (MuJoCo 4.0.1).
inline std::vector<double> start_times(SensorHistorySettings const& s, double timestep) {
  std::vector<double> times;
  double const last = s.phase == 0 ? -s.period : s.phase;
  for (int j = s.samples; j-- > 0;)
    times.push_back(s.period > 0 ? std::ceil((last - j * s.period) / timestep - 1e-12) * timestep : -(j + 1) * timestep);
  return times;
}
}  // namespace detail

/// The samples of `compiled`'s sensors with nsample > 0, as at the start. Allocates. Errors: std::invalid_argument for worlds < 1, and a
/// timestep that is not positive; gsp::Error for settings that MJCF does not allow, and 2^31 numbers of a world or more.
template <class R, ExecutionSpace Exec>
SensorHistory<R, typename Exec::memory_space> make_sensor_history(Exec const& exec, CompiledModel const& compiled,
                                                                  SensorHistoryOptions const& options = {}) {
  expects(options.worlds > 0, "gsp::make_sensor_history: worlds must be positive and is " + std::to_string(options.worlds));
  SensorHistory<R, typename Exec::memory_space> h;
  h.worlds = options.worlds;
  h.timestep = options.timestep > 0 ? options.timestep : compiled.option.timestep;
  std::vector<SensorHistoryEntry> entries;
  std::vector<SensorHistorySettings> late;
  std::vector<double> start;
  std::int64_t values = 0, times = 0;  // of a world
  int numbers = 0;
  for (int i = 0; i < compiled.nsensor; ++i) {
    auto const settings = history_settings(compiled.sensors[i]);
    if (!settings.fault.empty())
      throw Error("gsp::make_sensor_history: sensor " + std::to_string(i) + " '" + compiled.sensors[i].name + "' " + settings.fault);
    bool left_out = settings.samples == 0 || compiled.sensor_dim[i] < 1;
    for (int const other : options.left_out) left_out = left_out || other == i;
    if (left_out) continue;
    int const size = compiled.sensor_dim[i], n = settings.samples;
    entries.push_back({compiled.sensor_adr[i], size, n, settings.interpolation, settings.delay, settings.period, settings.phase, int(times),
                       int(values), numbers});
    values += std::int64_t(n) * size;
    times += n;
    numbers += size;
    h.columns = compiled.sensor_adr[i] + size > h.columns ? compiled.sensor_adr[i] + size : h.columns;
    if (values >= std::int64_t(1) << 31)
      throw Error("gsp::make_sensor_history: sensors up to " + std::to_string(i) + " '" + compiled.sensors[i].name +
                  "' keep 2^31 numbers of each world or more: lower nsample");
    late.push_back(settings);
  }
  expects(entries.empty() || h.timestep > 0, "gsp::make_sensor_history: the timestep must be positive: sensors keep samples of steps");
  h.entries = detail::to_device<decltype(h.entries)>(exec, "gsp::SensorHistory::entries", entries);
  if (entries.empty()) return h;
  for (auto const& settings : late)
    for (double const t : detail::start_times(settings, h.timestep)) start.push_back(t);
  auto const make = [&](auto& view, char const* label, auto... items) {
    view = detail::allocate_zero<std::decay_t<decltype(view)>>(exec, label, h.worlds, items...);
  };
  h.start = detail::to_device<decltype(h.start)>(exec, "gsp::SensorHistory::start", start);
  make(h.seen, "gsp::SensorHistory::seen");
  make(h.clock, "gsp::SensorHistory::clock");
  make(h.due, "gsp::SensorHistory::due", h.count());
  make(h.cursor, "gsp::SensorHistory::cursor", h.count());
  make(h.time, "gsp::SensorHistory::time", int(start.size()));
  make(h.value, "gsp::SensorHistory::value", values);
  make(h.now, "gsp::SensorHistory::now", numbers);
  h.asked = detail::make_stamp<detail::Stamp>("gsp::SensorHistory::asked");
  reset_sensor_history(exec, h, detail::AllWorlds{});
  return h;
}

/// What late sensors say: their columns of data hold what is true of the state as it is, which is kept for `record_sensors`; they get
///   delay > 0                        the samples' value at time - delay,
///   an interval, and not due yet     the samples' value at the time,
///   else                             what is true stays.
/// Does nothing where no sensor keeps samples. Two launches; does not allocate, does not fence. `read_sensors` calls it. Errors:
/// std::invalid_argument for a state or data of another number of worlds, and data of too few columns.
template <ExecutionSpace Exec, class R, class Mem, class Data>
void say_late(Exec const& exec, State<R, Mem> const& state, SensorHistory<R, Mem>& of, Data& data) {
  if (of.count() == 0) return;
  Region const region("gsp::sensor::say_late");
  detail::expects_as_many("gsp::say_late", "worlds", "make all with the same {.worlds = n}", detail::Count{"history", of.worlds},
                          detail::Count{"state", state.worlds}, detail::Count{"data", int(data.extent(0))});
  detail::expects_columns("gsp::say_late", "data", data, of.columns);
  Kokkos::parallel_for("gsp::sensor::tell_time", Kokkos::RangePolicy<Exec>(exec, 0, of.worlds),
                       detail::TellTime<SensorHistory<R, Mem>, decltype(state.steps)>{of, state.steps});
  Kokkos::parallel_for("gsp::sensor::say_late", detail::long_range(exec, of.worlds, of.count()),
                       detail::SayLate<SensorHistory<R, Mem>, Data>(of, data));
  if (of.asked.data()) of.asked().set(state);
}

/// Late sensors measure: what was true when they were read becomes a sample, of those with an interval where they are due. Once a step,
/// after `read_sensors` and before the state moves on. Does nothing where no sensor keeps samples. One launch; does not allocate, does not
/// fence. Errors: std::invalid_argument where they have not been read with this state as it is now.
template <ExecutionSpace Exec, class R, class Mem>
void record_sensors(Exec const& exec, State<R, Mem> const& state, SensorHistory<R, Mem>& of) {
  if (of.count() == 0) return;
  Region const region("gsp::sensor::record_sensors");
  if (of.asked.data() && !of.asked().is_of(state))
    throw std::invalid_argument(std::string("gsp::record_sensors: the sensors' numbers ") + of.asked().fault(state.qpos.data()) +
                                ": call read_sensors before it");
  Kokkos::parallel_for("gsp::sensor::record_sensors", detail::long_range(exec, of.worlds, of.count()),
                       detail::RecordSensors<SensorHistory<R, Mem>>(of));
}

/// Worlds of the mask remember what `from` does: beside `save` and `restore` of a simulation. Does not allocate, does not fence. Errors:
/// std::invalid_argument for histories of other sensors or numbers of worlds, and a mask of another size.
/// @param from  of as many worlds, or of one, which is given to all of the mask
template <ExecutionSpace Exec, class R, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void copy_sensor_history(Exec const& exec, SensorHistory<R, Mem> const& from, SensorHistory<R, Mem>& to, Mask const& mask) {
  Region const region("gsp::sensor::copy_sensor_history");
  detail::expects_mask("gsp::copy_sensor_history", mask, "history of sensors", to.worlds);
  expects(from.worlds == 1 || from.worlds == to.worlds, "gsp::copy_sensor_history: there are " + std::to_string(from.worlds) +
                                                            " worlds, and here " + std::to_string(to.worlds) +
                                                            ": give as many, or one for all");
  expects(from.count() == to.count() && from.time.extent(1) == to.time.extent(1) && from.value.extent(1) == to.value.extent(1),
          "gsp::copy_sensor_history: the two are of other sensors: make both of the same model");
  if (to.count() == 0) return;
  if (to.asked.data()) to.asked() = {};
  detail::each_history_view(
      [&](char const*, auto const& source, auto const& view) {
        using View = std::decay_t<decltype(view)>;
        Kokkos::parallel_for("gsp::sensor::copy_sensor_history", Kokkos::RangePolicy<Exec>(exec, 0, to.worlds),
                             detail::CopyHistory<View, Mask>{source, view, mask, from.worlds == 1});
      },
      from, to);
}

}  // namespace gsp
