#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>
#include <gsp/core/detail/items.hpp>
#include <gsp/math/philox.hpp>

/// Kernels of sensor/sensor_noise.hpp, sensor/sensor_delay.hpp and sensor/encoders.hpp, where the contracts stand.
namespace gsp::detail {

/// Whose random numbers they are. Rays take streams 0 and 1 (ray/ray_noise.hpp).
struct NoiseSource {
  enum Stream : std::uint32_t { sample = 2, start = 3, latency = 4, encoder = 5 };
  static constexpr std::size_t most_channels = 1 << 24;  // of a sensor: words has 24 bits for them
  std::uint64_t seed;
  std::uint32_t sensor, first_world;
  KOKKOS_INLINE_FUNCTION Philox words(int world, int channel, std::int64_t tick, Stream stream) const {
    return philox(seed, {{std::uint32_t(tick), std::uint32_t(channel) << 8 | std::uint32_t(tick >> 32 & 0xff),
                          first_world + std::uint32_t(world), sensor << 8 | stream}});
  }
};

/// Row w of (worlds | 1, items).
template <class View>
KOKKOS_INLINE_FUNCTION auto value_of(View const& v, int w, int i) {
  return v(v.extent(0) == 1 ? 0 : w, i);
}

/// SensorBlank: columns first to first + count - 1 are value.
struct BlankSigns {
  int first, count;
  float value;
};
/// Which sensors say that there is nothing: before any number changes, since x may be y.
template <class Noise, class From>
struct FindBlanks {
  Noise of;
  From x;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    RowColumn const at = row_column(item, int(of.blanks.extent(0)));
    BlankSigns const blank = of.blanks(at.column);
    bool all = true;
    for (int c = blank.first; c < blank.first + blank.count; ++c) all = all && float(x(at.row, c)) == blank.value;
    of.is_blank(at.row, at.column) = all;
  }
};

template <class Noise, class From, class To>
struct AddSensorNoise {
  Noise of;
  From x;
  To y;
  double dt;
  std::int64_t tick;
  NoiseSource source;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    using R = typename Noise::real_type;
    int const n = int(of.column.extent(0));
    RowColumn const place = row_column(item, n);
    int const w = place.row, c = place.column, at = of.column(c);
    R const true_c = R(x(w, at));
    R y_c = true_c;
    int const rows = int(of.coupling.extent(0));
    for (int j = 0; j < n && rows > 0; ++j) y_c += of.coupling(rows == 1 ? 0 : w, c, j) * R(x(w, of.column(j)));
    R const density = value_of(of.density, w, c), deviation = value_of(of.deviation, w, c), walk = value_of(of.walk, w, c),
            bias = value_of(of.bias, w, c), step = value_of(of.step, w, c), limit = value_of(of.limit, w, c), h = R(dt);
    if (density > R(0) || deviation > R(0) || walk > R(0) || bias > R(0)) {
      Philox const words = source.words(w, c, tick, NoiseSource::sample);
      Spread<R> const a = Spread<R>::of(words.word[0], words.word[1]);
      R across, along;
      sincos(a.angle, across, along);
      if (walk > R(0)) of.drift(w, c, 1) += walk * sqrt(h) * a.r * across;
      if (bias > R(0)) {  // b <- e^(-h / t) b + s sqrt(1 - e^(-2 h / t)) w, without the difference of what is almost 1
        R const k = h / value_of(of.bias_time, w, c);
        R const b = of.drift(w, c, 2), fresh = Spread<R>::of(words.word[2], words.word[3]).normal();
        of.drift(w, c, 2) = b + Kokkos::expm1(-k) * b + bias * sqrt(-Kokkos::expm1(-2 * k)) * fresh;
      }
      y_c += sqrt(density * density / h + deviation * deviation) * a.r * along;
    }
    y_c += of.drift(w, c, 0) + of.drift(w, c, 1) + of.drift(w, c, 2);
    if (step > R(0)) y_c = step * Kokkos::floor(y_c / step + R(0.5));
    if (limit > R(0)) y_c = y_c > limit ? limit : y_c < -limit ? -limit : y_c;
    if (of.positive(c)) y_c = y_c < R(0) ? R(0) : y_c;
    if (of.blanks.extent(0) > 0 && of.blank(c) >= 0 && of.is_blank(w, of.blank(c))) y_c = true_c;
    y(w, at) = y_c;
  }
};

/// Biases of a start: turn-on, no walk yet, and one of those among which a bounded bias wanders.
template <class Noise, class Mask>
struct StartNoise {
  Noise of;
  Mask mask;
  std::int64_t tick;
  NoiseSource source;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    using R = typename Noise::real_type;
    RowColumn const at = row_column(item, int(of.column.extent(0)));
    int const w = at.row, c = at.column;
    if (!mask(w)) return;
    Philox const words = source.words(w, c, tick, NoiseSource::start);
    of.drift(w, c, 0) = value_of(of.turn_on, w, c) * Spread<R>::of(words.word[0], words.word[1]).normal();
    of.drift(w, c, 1) = R(0);
    of.drift(w, c, 2) = value_of(of.bias, w, c) * Spread<R>::of(words.word[2], words.word[3]).normal();
  }
};

/// Directions and rotations to unit length.
template <class Units, class To>
struct NormaliseUnits {
  Units units;
  To y;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    using R = typename To::non_const_value_type;
    RowColumn const at = row_column(item, int(units.extent(0)));
    int const w = at.row, i = at.column, first = units(i, 0), end = first + units(i, 1);
    R sum = R(0);
    for (int c = first; c < end; ++c) sum += y(w, c) * y(w, c);
    R const scale = sum > R(0) ? R(1) / sqrt(sum) : R(1);
    for (int c = first; c < end; ++c) y(w, c) *= scale;
  }
};

}  // namespace gsp::detail
