#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/core/detail/views.hpp>
#include <gsp/core/exec.hpp>
#include <gsp/core/region.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/model/sensor_types.hpp>
#include <gsp/model/state.hpp>
#include <gsp/sensor/detail/columns.hpp>
#include <gsp/sensor/detail/sensor_noise_kernels.hpp>
#include <string>
#include <vector>

/// What sensors err by: white noise, biases that wander, scale and misalignment, quantisation, saturation. On any view (worlds, numbers).
namespace gsp {

/// What one number of a sensor errs by. Of zeros: nothing.
struct ChannelNoise {
  double density = 0;    // [unit/sqrt(Hz)] white noise: of samples dt apart the deviation is density / sqrt(dt)
  double deviation = 0;  // [unit] white noise: of each sample, whatever dt is
  double walk = 0;       // [unit/s/sqrt(Hz)] a bias that walks: after t its deviation is walk sqrt(t)
  double bias = 0;       // [unit] deviation of a bias that stays bounded (Gauss and Markov), and
  double bias_time = 0;  // [s] in which it forgets all but 1 / e of what it was
  double turn_on = 0;    // [unit] deviation of a bias that stays from start to start
  double step = 0;       // [unit] numbers are whole multiples of it; 0: any
  double limit = 0;      // [unit] and stay within +-limit; 0: any
};

struct SensorNoiseOptions {
  std::vector<ChannelNoise> channels = {};
  std::vector<int> columns = {};               // of the views: which number is which channel; empty: 0, 1, 2 ...
  std::vector<double> coupling = {};           // (channels, channels), row by row: y = x + coupling x; empty: none
  std::vector<std::array<int, 2>> units = {};  // first column and how many: made a unit vector at last
  int worlds = 1;
  bool per_world = false;         // each world has parameters of its own, to be written into the views
  std::uint64_t seed = 0;         // whose noise it is: of a seed, a sensor and a world, and of the sample's number
  std::uint32_t sensor = 0;       // below 2^24; sensors of one seed that differ have independent noise
  std::uint32_t first_world = 0;  // of a batch that is a part of a larger one
};

/// `make_sensor_noise` allocates it. Rows of parameters: worlds, or 1.
template <class R, class Mem>
struct SensorNoise {
  using real_type = R;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;
  View<int*> column;                                                          // (channels)
  View<R**> density, deviation, walk, bias, bias_time, turn_on, step, limit;  // (rows, channels) as ChannelNoise has them
  View<R***> coupling;                                                        // (rows, channels, channels), or empty
  View<int* [2]> units;                                                       // first column, how many
  View<R***> drift;                                                           // (worlds, channels, 3) turn-on, walking, bounded [unit]
  detail::NoiseSource source{};
  int columns = 0;        // host: that views have at least
  std::int64_t tick = 0;  // host: samples made; goes on when worlds start anew, so that each start has noise of its own
  int channels() const { return int(column.extent(0)); }
};

/// Biases of the worlds of the mask as at a start: a new turn-on bias, no walk, a bounded one of its deviation. One launch; does not
/// allocate, does not fence. Errors: std::invalid_argument for a mask of another size.
/// @param mask  callable with a world, such as a View<bool*> on the device
template <ExecutionSpace Exec, class R, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void reset_sensor_noise(Exec const& exec, SensorNoise<R, Mem>& of, Mask const& mask) {
  Region const region("gsp::sensor::reset_sensor_noise");
  detail::expects_mask("gsp::reset_sensor_noise", mask, "noise", of.worlds);
  Kokkos::parallel_for("gsp::sensor::reset_sensor_noise", Kokkos::RangePolicy<Exec>(exec, 0, of.worlds * of.channels()),
                       detail::StartNoise<SensorNoise<R, Mem>, Mask>{of, mask, of.tick, of.source});
}

/// Noise of these channels, as at a start. Allocates. Errors: std::invalid_argument for worlds < 1, no channels, numbers that are negative
/// or not finite, a bias without a time, and lists of other sizes than the channels'.
template <class R, ExecutionSpace Exec>
SensorNoise<R, typename Exec::memory_space> make_sensor_noise(Exec const& exec, SensorNoiseOptions options) {
  constexpr char const* where = "gsp::make_sensor_noise";
  using Noise = SensorNoise<R, typename Exec::memory_space>;
  int const n = int(options.channels.size()), rows = options.per_world ? options.worlds : 1;
  expects(options.worlds > 0, where, "worlds must be positive");
  expects(n > 0, where, "there are no channels: give what each number errs by");
  expects(options.sensor < (1u << 24), where, "the sensor's number must be below 2^24");
  if (options.columns.empty())
    for (int c = 0; c < n; ++c) options.columns.push_back(c);
  expects(int(options.columns.size()) == n, where, "give as many columns as channels, or none");
  expects(options.coupling.empty() || int(options.coupling.size()) == n * n, where,
          "the coupling has a row of all channels for each of them");
  Noise s;
  s.worlds = options.worlds;
  s.columns = detail::columns_of(where, options.columns);
  for (auto const& [first, size] : options.units) s.columns = std::max(s.columns, first + size);
  s.source = {options.seed, options.sensor, options.first_world};
  s.column = detail::to_device<decltype(s.column)>(exec, "gsp::SensorNoise::column", options.columns);
  auto const upload = [&](auto& view, std::vector<R> const& numbers) {
    detail::upload_bytes(exec, view.data(), numbers.data(), numbers.size() * sizeof(R));
    exec.fence("gsp::make_sensor_noise: the host array may go now");
  };
  auto const make = [&](auto& view, char const* label, double ChannelNoise::*member) {
    view = detail::allocate<typename Noise::template View<R**>>(label, rows, n);
    std::vector<R> numbers;
    for (int row = 0; row < rows; ++row)
      for (auto const& channel : options.channels) {
        double const x = channel.*member;
        expects(x >= 0 && std::isfinite(x), where, "what a channel errs by must be numbers, 0 or more");
        numbers.push_back(R(x));
      }
    upload(view, numbers);
  };
  for (auto const& channel : options.channels)
    expects(!(channel.bias > 0) || channel.bias_time > 0, where, "a bounded bias needs a time in which it changes: bias_time");
  make(s.density, "gsp::SensorNoise::density", &ChannelNoise::density);
  make(s.deviation, "gsp::SensorNoise::deviation", &ChannelNoise::deviation);
  make(s.walk, "gsp::SensorNoise::walk", &ChannelNoise::walk);
  make(s.bias, "gsp::SensorNoise::bias", &ChannelNoise::bias);
  make(s.bias_time, "gsp::SensorNoise::bias_time", &ChannelNoise::bias_time);
  make(s.turn_on, "gsp::SensorNoise::turn_on", &ChannelNoise::turn_on);
  make(s.step, "gsp::SensorNoise::step", &ChannelNoise::step);
  make(s.limit, "gsp::SensorNoise::limit", &ChannelNoise::limit);
  if (!options.coupling.empty()) {
    std::vector<R> numbers;
    for (int row = 0; row < rows; ++row)
      for (double const x : options.coupling) {
        expects(std::isfinite(x), where, "the coupling must be numbers");
        numbers.push_back(R(x));
      }
    s.coupling = detail::allocate<decltype(s.coupling)>("gsp::SensorNoise::coupling", rows, n, n);
    upload(s.coupling, numbers);
  }
  if (!options.units.empty()) {
    s.units = detail::allocate<decltype(s.units)>("gsp::SensorNoise::units", options.units.size());
    detail::upload_bytes(exec, s.units.data(), options.units.data(), options.units.size() * sizeof(options.units[0]));
    exec.fence("gsp::make_sensor_noise: the host array may go now");
  }
  s.drift = detail::allocate_zero<decltype(s.drift)>(exec, "gsp::SensorNoise::drift", options.worlds, n, 3);
  reset_sensor_noise(exec, s, detail::AllWorlds{});
  return s;
}

/// y: what the sensors say of x, the next sample of each world, dt [s] after the one before:
///   y = limit(step round((x + coupling x + turn-on + walking + bounded + n) / step)),   n of deviation sqrt(density^2 / dt + deviation^2)
/// Columns that are no channel's stay as they are in y. x and y may be the same view where there is no coupling. One launch (two with
/// units); does not allocate, does not fence; on a CPU 470 instructions a number with white noise, 710 with all. The same bits for any
/// batch, split or number of threads; between backends numbers differ by what log, sin and cos round. NaN stays NaN. Errors:
/// std::invalid_argument for views of another number of worlds or too few columns, for a dt that is not positive, and for x and y in one
/// place with coupling.
template <ExecutionSpace Exec, class R, class Mem, class From, class To>
void add_sensor_noise(Exec const& exec, SensorNoise<R, Mem>& of, double dt, From const& x, To const& y) {
  Region const region("gsp::sensor::add_sensor_noise");
  constexpr char const* where = "gsp::add_sensor_noise";
  static_assert(can_access<Exec, To>, "gsp::add_sensor_noise: y is not accessible from this execution space");
  expects(dt > 0 && std::isfinite(dt), where, "dt must be positive");
  detail::expects_as_many(where, "worlds", "make all with the same {.worlds = n}", detail::Count{"noise", of.worlds},
                          detail::Count{"x", int(x.extent(0))}, detail::Count{"y", int(y.extent(0))});
  detail::expects_columns(where, "x", x, of.columns);
  detail::expects_columns(where, "y", y, of.columns);
  expects(of.coupling.extent(0) == 0 || static_cast<void const*>(x.data()) != static_cast<void const*>(y.data()), where,
          "with coupling each number is made of all: give y a view of its own");
  Kokkos::parallel_for("gsp::sensor::add_sensor_noise", Kokkos::RangePolicy<Exec>(exec, 0, of.worlds * of.channels()),
                       detail::AddSensorNoise<SensorNoise<R, Mem>, From, To>{of, x, y, dt, of.tick, of.source});
  if (of.units.extent(0) > 0)
    Kokkos::parallel_for("gsp::sensor::normalise_units", Kokkos::RangePolicy<Exec>(exec, 0, of.worlds * int(of.units.extent(0))),
                         detail::NormaliseUnits<decltype(of.units), To>{of.units, y});
  ++of.tick;
}

/// MJCF's attribute noise of the model's sensors as deviations of each sample, which MuJoCo keeps and does not apply: for
/// make_sensor_noise, on a view of sensordata. Directions and rotations are made unit ones again. No channels: no sensor has noise.
inline SensorNoiseOptions mjcf_noise(CompiledModel const& compiled, SensorNoiseOptions options = {}) {
  options.channels.clear();
  options.columns.clear();
  options.units.clear();
  for (int i = 0; i < compiled.nsensor; ++i) {
    auto const& sensor = compiled.sensors[i];
    if (!(sensor.noise > 0)) continue;
    int const adr = compiled.sensor_adr[i], size = compiled.sensor_dim[i];
    SensorInfo const* const info = find_sensor_type(sensor.type);
    for (int c = 0; c < size; ++c) {
      options.channels.push_back({.deviation = sensor.noise});
      options.columns.push_back(adr + c);
    }
    if (info && info->cutoff == SensorCutoff::refused) options.units.push_back({adr, size});
  }
  return options;
}

}  // namespace gsp
