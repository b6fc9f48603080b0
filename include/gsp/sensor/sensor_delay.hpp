#pragma once
#include <cmath>
#include <gsp/core/detail/views.hpp>
#include <gsp/core/exec.hpp>
#include <gsp/core/region.hpp>
#include <gsp/model/state.hpp>
#include <gsp/sensor/detail/columns.hpp>
#include <gsp/sensor/detail/sample_ring.hpp>
#include <gsp/sensor/detail/sensor_noise_kernels.hpp>
#include <string>
#include <vector>

/// Latency: what is read now is what was measured before. On any view (worlds, numbers).
namespace gsp {

struct SensorDelayOptions {
  int worlds = 1;
  int numbers = 1;                // of the views that are late: the first, or
  std::vector<int> columns = {};  // these, as many as numbers
  double latency = 0;             // [s]
  double jitter = 0;              // [s] it is longer by a uniform number from 0 to this, another at each reading
  int samples = 2;                // that are kept: (latency + jitter) / dt + 1 at least, one more for cubic
  Interpolation interpolation = Interpolation::hold;
  bool per_world = false;  // each world has a latency and jitter of its own, to be written into the views
  std::uint64_t seed = 0;  // whose jitter it is, as SensorNoiseOptions has them
  std::uint32_t sensor = 0;
  std::uint32_t first_world = 0;
};

/// `make_sensor_delay` allocates it. Rows of latency and jitter: worlds, or 1.
template <class R, class Mem>
struct SensorDelay {
  using real_type = R;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;
  Interpolation interpolation = Interpolation::hold;
  View<int*> column;       // (numbers)
  View<double**> latency;  // (rows, 1) [s]
  View<double**> jitter;   // (rows, 1) [s]
  View<double**> time;     // (worlds, samples) [s]
  View<R***> value;        // (worlds, samples, numbers)
  View<int*> cursor;       // (worlds) the newest sample; -1: none yet
  View<double*> said;      // (worlds) [s] the time of what was read last
  detail::NoiseSource source{};
  int columns = 0;        // host: that views have at least
  double longest = 0;     // host: [s] latency + jitter of the options
  double now = 0;         // host: [s] sum of all dt
  std::int64_t tick = 0;  // host: readings made
  int numbers() const { return int(column.extent(0)); }
  int samples() const { return int(time.extent(1)); }
};

/// Allocates. Errors: std::invalid_argument for worlds, numbers or samples below 1, times that are negative or not finite, another number
/// of columns or one that is named twice, and 2^31 kept numbers of a world or more.
template <class R, ExecutionSpace Exec>
SensorDelay<R, typename Exec::memory_space> make_sensor_delay(Exec const& exec, SensorDelayOptions options) {
  constexpr char const* where = "gsp::make_sensor_delay";
  expects(options.worlds > 0 && options.numbers > 0 && options.samples > 0, where, "worlds, numbers and samples must be positive");
  expects(options.latency >= 0 && options.jitter >= 0 && std::isfinite(options.latency + options.jitter), where,
          "latency and jitter must be numbers, 0 or more");
  expects(options.sensor < (1u << 24), where, "the sensor's number must be below 2^24");
  if (options.columns.empty())
    for (int c = 0; c < options.numbers; ++c) options.columns.push_back(c);
  expects(int(options.columns.size()) == options.numbers, where, "give as many columns as numbers, or none");
  expects(std::int64_t(options.samples) * options.numbers < std::int64_t(1) << 31, where,
          "samples of all numbers are 2^31 or more of each world: keep fewer");
  SensorDelay<R, typename Exec::memory_space> d;
  int const n = options.worlds, rows = options.per_world ? n : 1;
  d.worlds = n;
  d.columns = detail::own_columns_of(where, options.columns);
  d.interpolation = options.interpolation;
  d.source = {options.seed, options.sensor, options.first_world};
  d.longest = options.latency + options.jitter;
  d.column = detail::to_device<decltype(d.column)>(exec, "gsp::SensorDelay::column", options.columns);
  auto const make = [&](auto& view, char const* label, auto... extents) {
    view = detail::allocate_zero<std::decay_t<decltype(view)>>(exec, label, extents...);
  };
  make(d.latency, "gsp::SensorDelay::latency", rows, 1);
  make(d.jitter, "gsp::SensorDelay::jitter", rows, 1);
  make(d.time, "gsp::SensorDelay::time", n, options.samples);
  make(d.value, "gsp::SensorDelay::value", n, options.samples, options.numbers);
  make(d.cursor, "gsp::SensorDelay::cursor", n);
  make(d.said, "gsp::SensorDelay::said", n);
  Kokkos::deep_copy(exec, d.latency, options.latency);
  Kokkos::deep_copy(exec, d.jitter, options.jitter);
  Kokkos::deep_copy(exec, d.cursor, -1);
  return d;
}

namespace detail {
/// Of dt: by how much a time that is a whole number of readings ago may miss that reading, and be its. The clock is a sum of dt, each
/// rounded by 2^-53 of it: m readings of N lie within (m + 2) N 2^-53 dt of m dt, and m dt of a float's dt within m 2^-24 dt of the decimal
/// that was meant. Half of this share each: m up to 128, (m + 2) N up to 7e10.
inline constexpr double same_share = 1. / (1 << 16);

template <class Delay, class From, class To>
struct DelaySensor {
  Delay of;
  From x;
  To y;
  double dt, now;
  std::int64_t tick;
  NoiseSource source;
  KOKKOS_FUNCTION void operator()(int w) const {
    using R = typename Delay::real_type;
    int const n = int(of.column.extent(0)), samples = int(of.time.extent(1));
    SampleRing<R> const ring{&of.time(w, 0), &of.value(w, 0, 0), &of.cursor(w), samples, n, same_share * dt};
    auto const put = [&](R* to) {
      for (int c = 0; c < n; ++c) to[c] = R(x(w, of.column(c)));
    };
    double const latency = value_of(of.latency, w, 0), jitter = value_of(of.jitter, w, 0);
    if (*ring.cursor < 0) {  // as if nothing had changed before
      *ring.cursor = samples - 1;
      for (int j = 0; j < samples; ++j) {
        ring.time[j] = now - (samples - 1 - j) * dt;
        put(ring.value + j * n);
      }
      of.said(w) = now - latency - jitter;
    } else {
      put(ring.insert(now));
    }
    double at = now - latency;
    if (jitter > 0) at -= jitter * uniform_of<double>(source.words(w, 0, tick, NoiseSource::latency).word[0]);
    if (at < of.said(w)) at = of.said(w);
    of.said(w) = at;
    ring.read(at, of.interpolation, [&](int c, R v) { y(w, of.column(c)) = v; });
  }
};
template <class Delay, class Mask>
struct ResetDelay {
  Delay of;
  Mask mask;
  KOKKOS_FUNCTION void operator()(int w) const {
    if (mask(w)) of.cursor(w) = -1;
  }
};
}  // namespace detail

/// y: what is read of x now, dt [s] after the last call: x becomes a sample, and y is that of latency + jitter before, held or
/// interpolated; of a latency of m dt the sample of m calls before, to 1.5e-5 dt. dt may differ from call to call. It never goes back
/// behind what was read before. A world's first sample counts as what was there all the time. Noise that was added to x is the sample's and
/// is read with it. x and y may be the same view. One launch, a thread a world; does not allocate, does not fence. The same bits for any
/// batch. Latencies of worlds' own that are longer than what the samples span are as long as these. Errors: std::invalid_argument for views
/// of another number of worlds or too few columns, a dt that is not positive, and too few samples.
template <ExecutionSpace Exec, class R, class Mem, class From, class To>
void delay_sensor(Exec const& exec, SensorDelay<R, Mem>& of, double dt, From const& x, To const& y) {
  Region const region("gsp::sensor::delay_sensor");
  constexpr char const* where = "gsp::delay_sensor";
  static_assert(can_access<Exec, To>, "gsp::delay_sensor: y is not accessible from this execution space");
  expects(dt > 0 && std::isfinite(dt), where, "dt must be positive");
  detail::expects_as_many(where, "worlds", "make all with the same {.worlds = n}", detail::Count{"delay", of.worlds},
                          detail::Count{"x", int(x.extent(0))}, detail::Count{"y", int(y.extent(0))});
  detail::expects_columns(where, "x", x, of.columns);
  detail::expects_columns(where, "y", y, of.columns);
  double const needed = std::ceil(of.longest / dt - detail::same_share) + (of.interpolation == Interpolation::cubic ? 2 : 1);
  if (of.latency.extent(0) == 1 && of.samples() < needed)
    throw std::invalid_argument(std::string(where) + ": " + std::to_string(of.samples()) +
                                " samples are kept, and latency and jitter need " + std::to_string(std::int64_t(needed)) +
                                ": make_sensor_delay with {.samples = ...}");
  of.now += dt;
  Kokkos::parallel_for("gsp::sensor::delay_sensor", Kokkos::RangePolicy<Exec>(exec, 0, of.worlds),
                       detail::DelaySensor<SensorDelay<R, Mem>, From, To>{of, x, y, dt, of.now, of.tick, of.source});
  ++of.tick;
}

/// Worlds of the mask forget their samples. One launch; does not allocate, does not fence. Errors: std::invalid_argument for a mask of
/// another size.
/// @param mask  callable with a world, such as a View<bool*> on the device
template <ExecutionSpace Exec, class R, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void reset_sensor_delay(Exec const& exec, SensorDelay<R, Mem>& of, Mask const& mask) {
  Region const region("gsp::sensor::reset_sensor_delay");
  detail::expects_mask("gsp::reset_sensor_delay", mask, "delay", of.worlds);
  Kokkos::parallel_for("gsp::sensor::reset_sensor_delay", Kokkos::RangePolicy<Exec>(exec, 0, of.worlds),
                       detail::ResetDelay<SensorDelay<R, Mem>, Mask>{of, mask});
}

/// `to` goes on as `from` would have, to the bit: samples, clock and the number of the reading of all worlds. Latencies and jitters stay.
/// Beside `save` and `restore` of a simulation. Does not allocate, does not fence a device. Errors: std::invalid_argument for delays of
/// other sizes.
template <ExecutionSpace Exec, class R, class Mem>
void copy_sensor_delay(Exec const& exec, SensorDelay<R, Mem> const& from, SensorDelay<R, Mem>& to) {
  Region const region("gsp::sensor::copy_sensor_delay");
  expects(from.worlds == to.worlds && from.samples() == to.samples() && from.numbers() == to.numbers(), "gsp::copy_sensor_delay",
          "the two differ in worlds, samples or numbers: make both with the same options");
  detail::copy_view(exec, from.time, to.time);
  detail::copy_view(exec, from.value, to.value);
  detail::copy_view(exec, from.cursor, to.cursor);
  detail::copy_view(exec, from.said, to.said);
  to.now = from.now;
  to.tick = from.tick;
}

}  // namespace gsp
