#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/core/detail/views.hpp>
#include <gsp/core/exec.hpp>
#include <gsp/core/region.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/model/contact_sensor.hpp>
#include <gsp/model/range_sensor.hpp>
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
  double density = 0;     // [unit/sqrt(Hz)] white noise: of samples dt apart the deviation is density / sqrt(dt)
  double deviation = 0;   // [unit] white noise: of each sample, whatever dt is
  double walk = 0;        // [unit/s/sqrt(Hz)] a bias that walks: after t its deviation is walk sqrt(t)
  double bias = 0;        // [unit] deviation of a bias that stays bounded (Gauss and Markov), and
  double bias_time = 0;   // [s] in which it forgets all but 1 / e of what it was
  double turn_on = 0;     // [unit] deviation of a bias that stays from start to start
  double step = 0;        // [unit] numbers are whole multiples of it; 0: any
  double limit = 0;       // [unit] and stay within +-limit; 0: any
  bool positive = false;  // and are not negative: what noise takes below 0 is 0
};

/// Numbers that stay as they are where a sensor says by others, or by themselves, that it has met nothing: all `signs` are `value` there.
struct SensorBlank {
  std::array<int, 2> numbers{0, 1};  // first column and how many
  std::array<int, 2> signs{0, 1};    // first column and how many
  double value = 0;                  // compared as a float, so that it is met in any precision
};

struct SensorNoiseOptions {
  std::vector<ChannelNoise> channels = {};
  std::vector<int> columns = {};               // of the views: which number is which channel; empty: 0, 1, 2 ...
  std::vector<double> coupling = {};           // (channels, channels), row by row: y = x + coupling x; empty: none
  std::vector<std::array<int, 2>> units = {};  // first column and how many: made a unit vector at last
  std::vector<SensorBlank> blanks = {};
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
  View<int*> positive;                                                        // (channels) 1: as ChannelNoise has it
  View<int* [2]> units;                                                       // first column, how many
  View<detail::BlankSigns*> blanks;
  View<int*> blank;       // (channels) to which of them it belongs, -1: none; empty where there are none
  View<bool**> is_blank;  // (worlds, blanks) of the sample
  View<R***> drift;       // (worlds, channels, 3) turn-on, walking, bounded [unit]
  detail::NoiseSource source{};
  int columns = 0;        // host: that views have at least
  std::int64_t tick = 0;  // host: samples made; goes on when worlds start anew, so that each start that a sample follows has its own noise
  int channels() const { return int(column.extent(0)); }
};

/// Biases of the worlds of the mask as at a start: a new turn-on bias, no walk, a bounded one of its deviation. Drawn by the number of the
/// sample that comes next, whatever other worlds do: twice before a sample is one start, with the same biases. One launch; does not
/// allocate, does not fence. Errors: std::invalid_argument for a mask of another size.
/// @param mask  callable with a world, such as a View<bool*> on the device
template <ExecutionSpace Exec, class R, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void reset_sensor_noise(Exec const& exec, SensorNoise<R, Mem>& of, Mask const& mask) {
  Region const region("gsp::sensor::reset_sensor_noise");
  detail::expects_mask("gsp::reset_sensor_noise", mask, "noise", of.worlds);
  Kokkos::parallel_for("gsp::sensor::reset_sensor_noise", detail::long_range(exec, of.worlds, of.channels()),
                       detail::StartNoise<SensorNoise<R, Mem>, Mask>{of, mask, of.tick, of.source});
}

namespace detail {
/// Of which of the groups (first column and how many) each channel is; -1: of none.
/// Errors: columns that are no channel's, and groups that overlap.
inline std::vector<int> groups_of(std::string const& what, std::vector<int> const& columns, std::vector<std::array<int, 2>> const& groups) {
  std::string const where = "gsp::make_sensor_noise: ";
  int const most = columns.empty() ? -1 : *std::max_element(columns.begin(), columns.end());
  std::vector<int> channel(std::size_t(most + 1), -1), of(columns.size(), -1);
  for (std::size_t c = 0; c < columns.size(); ++c) channel[std::size_t(columns[c])] = int(c);
  for (std::size_t k = 0; k < groups.size(); ++k) {
    auto const [first, size] = groups[k];
    expects(first >= 0 && size > 0, where + what + " has a first column below 0 or no columns: give its first column and how many");
    for (std::int64_t i = first; i < std::int64_t(first) + size; ++i) {
      if (i >= std::int64_t(channel.size()) || channel[std::size_t(i)] < 0)
        throw std::invalid_argument(where + what + " has column " + std::to_string(i) + ", which is no channel's: name it in columns");
      int& owner = of[std::size_t(channel[std::size_t(i)])];
      if (owner >= 0) throw std::invalid_argument(where + what + " shares column " + std::to_string(i) + " with another: keep them apart");
      owner = int(k);
    }
  }
  return of;
}
}  // namespace detail

/// Noise of these channels, as at a start; of no channels (mjcf_noise of a model without noise) it adds none. Allocates. Errors:
/// std::invalid_argument for worlds < 1, more than 2^24 channels, numbers that are negative or not finite, a bias without a time, lists of
/// other sizes than the channels', a column that is named twice, and units or blanks whose columns are no channel's or overlap.
template <class R, ExecutionSpace Exec>
SensorNoise<R, typename Exec::memory_space> make_sensor_noise(Exec const& exec, SensorNoiseOptions options) {
  constexpr char const* where = "gsp::make_sensor_noise";
  using Noise = SensorNoise<R, typename Exec::memory_space>;
  int const n = int(options.channels.size()), rows = options.per_world ? options.worlds : 1;
  expects(options.worlds > 0, where, "worlds must be positive");
  expects(options.channels.size() <= detail::NoiseSource::most_channels, where, "there are more than 2^24 channels: make several");
  expects(options.sensor < (1u << 24), where, "the sensor's number must be below 2^24");
  if (options.columns.empty())
    for (int c = 0; c < n; ++c) options.columns.push_back(c);
  if (int(options.columns.size()) != n)
    throw std::invalid_argument(std::string(where) + ": there are " + std::to_string(n) + " channels and " +
                                std::to_string(options.columns.size()) +
                                " columns: give one for each, or none (imu_noise: three of the accelerometer, then three of the gyro)");
  expects(options.coupling.empty() || options.coupling.size() == std::size_t(n) * std::size_t(n), where,
          "the coupling has a row of all channels for each of them");
  Noise s;
  s.worlds = options.worlds;
  s.columns = detail::own_columns_of(where, options.columns);
  detail::groups_of("a unit", options.columns, options.units);
  std::vector<std::array<int, 2>> blanks;
  std::vector<detail::BlankSigns> signs;
  for (auto const& blank : options.blanks) {
    blanks.push_back(blank.numbers);
    auto const [first, size] = blank.signs;
    expects(first >= 0 && size > 0 && size < (1 << 30) - first, where, "signs of a blank are a first column, 0 or more, and how many");
    s.columns = std::max(s.columns, first + size);
    signs.push_back({first, size, float(blank.value)});
  }
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
  std::vector<int> positive;
  for (auto const& channel : options.channels) positive.push_back(channel.positive);
  s.positive = detail::to_device<decltype(s.positive)>(exec, "gsp::SensorNoise::positive", positive);
  if (!blanks.empty()) {
    s.blanks = detail::to_device<decltype(s.blanks)>(exec, "gsp::SensorNoise::blanks", signs);
    s.blank = detail::to_device<decltype(s.blank)>(exec, "gsp::SensorNoise::blank", detail::groups_of("a blank", options.columns, blanks));
    s.is_blank = detail::allocate_zero<decltype(s.is_blank)>(exec, "gsp::SensorNoise::is_blank", options.worlds, blanks.size());
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
/// Columns that are no channel's stay as they are in y. x and y may be the same view where there is no coupling. dt may differ from call to
/// call: density / sqrt(dt) is the deviation of the mean over dt, walk sqrt(dt) that of a step of the bias. One launch, one more with units
/// and one with blanks; does not allocate, does not fence; on a CPU 470 instructions a number with white noise, 710 with all. The same bits
/// for any batch, split or number of threads; between backends numbers differ by what log, sin and cos round. NaN stays NaN. Errors:
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
  if (of.blanks.extent(0) > 0)
    Kokkos::parallel_for("gsp::sensor::find_blanks", detail::long_range(exec, of.worlds, int(of.blanks.extent(0))),
                         detail::FindBlanks<SensorNoise<R, Mem>, From>{of, x});
  Kokkos::parallel_for("gsp::sensor::add_sensor_noise", detail::long_range(exec, of.worlds, of.channels()),
                       detail::AddSensorNoise<SensorNoise<R, Mem>, From, To>{of, x, y, dt, of.tick, of.source});
  if (of.units.extent(0) > 0)
    Kokkos::parallel_for("gsp::sensor::normalise_units", detail::long_range(exec, of.worlds, int(of.units.extent(0))),
                         detail::NormaliseUnits<decltype(of.units), To>{of.units, y});
  ++of.tick;
}

/// `to` goes on as `from` would have, to the bit: biases and the number of the sample of all worlds. What the channels err by stays. Beside
/// `save` and `restore` of a simulation. Does not allocate, does not fence a device. Errors: std::invalid_argument for noise of other
/// sizes.
template <ExecutionSpace Exec, class R, class Mem>
void copy_sensor_noise(Exec const& exec, SensorNoise<R, Mem> const& from, SensorNoise<R, Mem>& to) {
  Region const region("gsp::sensor::copy_sensor_noise");
  expects(from.worlds == to.worlds && from.channels() == to.channels(), "gsp::copy_sensor_noise",
          "the two differ in worlds or channels: make both with the same options");
  detail::copy_view(exec, from.drift, to.drift);
  to.tick = from.tick;
}

namespace detail {
/// Adds a sensor's channels to the options: groups of as many numbers from `adr` on, one after the other up to `end`.
struct MjcfNoise {
  SensorNoiseOptions& options;
  double deviation;
  int adr, end;
  enum Kind : int { any, positive, unit, exact };
  struct Part {
    int size;
    Kind kind = any;
  };
  static int size_of(std::vector<Part> const& parts) {
    int sum = 0;
    for (Part const& part : parts) sum += part.size;
    return sum;
  }
  /// signs: first number of a group and how many say that it is blank; of none: it never is.
  void add(std::vector<Part> const& parts, std::array<int, 2> signs = {0, 0}, double value = 0) const {
    int const size = size_of(parts);
    for (int first = adr; size > 0 && first + size <= end; first += size) {
      int c = first;
      for (auto const& [count, kind] : parts) {
        if (kind == unit) options.units.push_back({c, count});
        for (int k = 0; k < count; ++k) {
          options.channels.push_back({.deviation = kind == exact ? 0 : deviation, .positive = kind == positive});
          options.columns.push_back(c++);
        }
      }
      if (signs[1] > 0) options.blanks.push_back({{first, size}, {first + signs[0], signs[1]}, value});
    }
  }
};
inline void add_range_noise(MjcfNoise const& to, SensorDescription const& sensor) {
  using K = MjcfNoise;
  K::Kind const kinds[] = {K::positive, K::unit, K::any, K::any, K::unit, K::positive};
  double const miss = sensor.cutoff > 0 ? std::max(-1., -sensor.cutoff) : -1;
  unsigned const fields = range_settings(sensor).fields;
  std::vector<K::Part> parts;
  std::array<int, 2> signs{0, 0};
  RangeField of = RangeField::origin;
  for (int k = 0, at = 0; k < 6; ++k) {
    if (!((fields >> k) & 1u)) continue;
    int const size = range_sensor_fields[k].size;
    bool const better = signs[1] == 0 || of == RangeField::point;  // a point that is met may be 0
    if (RangeField(k) != RangeField::origin && better) {
      signs = {at, size};
      of = RangeField(k);
    }
    parts.push_back({size, kinds[k]});
    at += size;
  }
  to.add(parts, signs, signs[1] == 1 ? miss : 0);
}
inline void add_contact_noise(MjcfNoise const& to, SensorDescription const& sensor) {
  using K = MjcfNoise;
  ContactSensorSettings const settings = contact_settings(sensor);
  std::vector<K::Part> parts;
  for (int k = 0; k < int(std::size(contact_sensor_fields)); ++k) {
    ContactField const field = ContactField(k);
    bool const axis = field == ContactField::normal || field == ContactField::tangent;
    if (settings.has(field))
      parts.push_back({contact_sensor_fields[k].size, field == ContactField::found ? K::exact : axis ? K::unit : K::any});
  }
  to.add(parts, {0, K::size_of(parts)});
}
}  // namespace detail

/// MJCF's attribute noise of the model's sensors as deviations of each sample, which MuJoCo keeps and does not apply: for
/// make_sensor_noise, on a view of sensordata. What MuJoCo calls axes and quaternions, and directions and normals of rangefinders, contacts
/// and distances, are made unit again; what it calls positive, and distances of rangefinders, do not fall below 0. Without noise: rays that
/// meet nothing, slots of contacts that are empty, `found`, positive numbers that are 0, and distances that see nothing. No channels: no
/// sensor has noise, and make_sensor_noise takes that too.
inline SensorNoiseOptions mjcf_noise(CompiledModel const& compiled, SensorNoiseOptions options = {}) {
  using K = detail::MjcfNoise;
  options.channels.clear();
  options.columns.clear();
  options.units.clear();
  options.blanks.clear();
  for (int i = 0; i < compiled.nsensor; ++i) {
    auto const& sensor = compiled.sensors[i];
    int const adr = compiled.sensor_adr[i], size = compiled.sensor_dim[i];
    if (!(sensor.noise > 0) || size < 1) continue;
    K const to{options, sensor.noise, adr, adr + size};
    SensorInfo const* const info = find_sensor_type(sensor.type);
    SensorType const type = info ? info->type : SensorType::user;
    std::string data;  // of a user's sensor
    for (auto const& [key, value] : sensor.settings)
      if (key == "datatype") data = value;
    bool const user = type == SensorType::user, above = user ? data == "positive" : info->cutoff == SensorCutoff::above;
    bool const axis = user ? data == "axis" || data == "quaternion" : info->cutoff == SensorCutoff::refused;
    if (type == SensorType::rangefinder)
      detail::add_range_noise(to, sensor);
    else if (type == SensorType::contact)
      detail::add_contact_noise(to, sensor);
    else if (type == SensorType::normal)
      to.add({{3, K::unit}}, {0, 3});
    else if (type == SensorType::from_to)
      to.add({{6}}, {0, 6});
    else if (type == SensorType::distance)
      to.add({{1}}, {0, 1}, sensor.cutoff);
    else if (above)
      to.add({{1, K::positive}}, {0, 1});
    else
      to.add({{size, axis ? K::unit : K::any}});
  }
  return options;
}

}  // namespace gsp
