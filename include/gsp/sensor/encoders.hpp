#pragma once
#include <cmath>
#include <gsp/core/detail/views.hpp>
#include <gsp/core/exec.hpp>
#include <gsp/core/region.hpp>
#include <gsp/model/state.hpp>
#include <gsp/sensor/detail/columns.hpp>
#include <gsp/sensor/detail/sensor_noise_kernels.hpp>
#include <string>
#include <vector>

/// Encoders: positions in whole counts, and velocities by their difference.
namespace gsp {

struct EncodersOptions {
  int worlds = 1;
  std::vector<int> columns = {0};  // of the view of positions, an encoder each
  double resolution = 0;           // [rad, m] of a count: 2 pi / counts of a turn
  int span = 1;                    // readings over which velocities are taken
  bool per_world = false;          // each world has resolutions of its own, to be written into the view
  std::uint64_t seed = 0;          // whose offsets they are, as SensorNoiseOptions has them
  std::uint32_t sensor = 0;
  std::uint32_t first_world = 0;
};

/// `make_encoders` allocates it.
template <class R, class Mem>
struct Encoders {
  using real_type = R;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;
  View<int*> column;             // (encoders)
  View<R**> resolution;          // (worlds | 1, encoders) [rad, m]
  View<R**> offset;              // (worlds, encoders) where the first count begins, as a share of a count, 0 to 1
  View<std::int64_t***> count;   // (worlds, encoders, span) of the last readings
  View<int**> begun;             // (worlds, encoders) 0: nothing has been read yet
  View<R**> position, velocity;  // (worlds, encoders) [rad, m], [rad/s, m/s]
  int columns = 0;               // host: that views have at least
  std::int64_t tick = 0;         // host: readings made
  double dt = 0;                 // host: [s] between them
  int encoders() const { return int(column.extent(0)); }
  int span() const { return int(count.extent(2)); }
};

namespace detail {
template <class Of>
struct PlaceOffsets {
  Of of;
  NoiseSource source;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    RowColumn const at = row_column(item, int(of.column.extent(0)));
    int const w = at.row, i = at.column;
    of.offset(w, i) = uniform_of<typename Of::real_type>(source.words(w, i, 0, NoiseSource::encoder).word[0]);
  }
};
template <class Of, class From>
struct ReadEncoders {
  Of of;
  From q;
  double dt;
  int slot;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    using R = typename Of::real_type;
    RowColumn const at = row_column(item, int(of.column.extent(0)));
    int const w = at.row, i = at.column;
    int const span = int(of.count.extent(2));
    double const step = double(value_of(of.resolution, w, i));
    double const counts = Kokkos::floor(double(q(w, of.column(i))) / step + double(of.offset(w, i)));
    if (!(Kokkos::abs(counts) < 9e15)) {  // not a number of counts: nor is what it says, and the next good one is a first
      of.begun(w, i) = 0;
      of.position(w, i) = of.velocity(w, i) = R(Kokkos::Experimental::quiet_NaN<double>::value);
      return;
    }
    std::int64_t const now = std::int64_t(counts);
    for (int k = 0; k < span && !of.begun(w, i); ++k) of.count(w, i, k) = now;
    of.begun(w, i) = 1;
    of.position(w, i) = R(step * counts);
    of.velocity(w, i) = R(step * double(now - of.count(w, i, slot)) / (span * dt));
    of.count(w, i, slot) = now;
  }
};
template <class Of, class Mask>
struct ResetEncoders {
  Of of;
  Mask mask;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    RowColumn const at = row_column(item, int(of.column.extent(0)));
    int const w = at.row, i = at.column;
    if (mask(w)) of.begun(w, i) = 0;
  }
};
}  // namespace detail

/// Allocates; offsets are uniform, each world and encoder its own. Errors: std::invalid_argument for worlds or span below 1, no columns
/// or more than 2^24, and a resolution that is not positive.
template <class R, ExecutionSpace Exec>
Encoders<R, typename Exec::memory_space> make_encoders(Exec const& exec, EncodersOptions const& options) {
  constexpr char const* where = "gsp::make_encoders";
  expects(options.worlds > 0 && options.span > 0 && !options.columns.empty(), where, "worlds, span and columns must be positive");
  expects(options.columns.size() <= detail::NoiseSource::most_channels, where, "there are more than 2^24 encoders: make several");
  expects(options.resolution > 0 && std::isfinite(options.resolution), where, "the resolution of a count must be positive");
  expects(options.sensor < (1u << 24), where, "the sensor's number must be below 2^24");
  Encoders<R, typename Exec::memory_space> e;
  int const n = options.worlds, encoders = int(options.columns.size());
  e.worlds = n;
  e.columns = detail::columns_of(where, options.columns);
  e.column = detail::to_device<decltype(e.column)>(exec, "gsp::Encoders::column", options.columns);
  auto const make = [&](auto& view, char const* label, auto... extents) {
    view = detail::allocate_zero<std::decay_t<decltype(view)>>(exec, label, extents...);
  };
  make(e.resolution, "gsp::Encoders::resolution", options.per_world ? n : 1, encoders);
  make(e.offset, "gsp::Encoders::offset", n, encoders);
  make(e.count, "gsp::Encoders::count", n, encoders, options.span);
  make(e.begun, "gsp::Encoders::begun", n, encoders);
  make(e.position, "gsp::Encoders::position", n, encoders);
  make(e.velocity, "gsp::Encoders::velocity", n, encoders);
  Kokkos::deep_copy(exec, e.resolution, R(options.resolution));
  using Of = decltype(e);
  Kokkos::parallel_for("gsp::sensor::make_encoders", detail::long_range(exec, n, encoders),
                       detail::PlaceOffsets<Of>{e, {options.seed, options.sensor, options.first_world}});
  return e;
}

/// position and velocity: what encoders say of the positions q (worlds, numbers), dt [s] after the last reading:
///   count = floor(q / resolution + offset),   position = resolution count,   velocity = resolution (count - count of span readings ago) /
///   (span dt)
/// A world's first reading has velocity 0. NaN stays NaN, and the reading after it is a first one. One launch; does not allocate, does not
/// fence. Errors: std::invalid_argument for a view of another number of worlds or too few columns, a dt that is not positive, and one that
/// differs from the first reading's where the span is more than one.
template <ExecutionSpace Exec, class R, class Mem, class From>
void read_encoders(Exec const& exec, Encoders<R, Mem>& of, double dt, From const& q) {
  Region const region("gsp::sensor::read_encoders");
  constexpr char const* where = "gsp::read_encoders";
  expects(dt > 0 && std::isfinite(dt), where, "dt must be positive");
  detail::expects_as_many(where, "worlds", "make both with the same {.worlds = n}", detail::Count{"encoders", of.worlds},
                          detail::Count{"q", int(q.extent(0))});
  detail::expects_columns(where, "q", q, of.columns);
  if (of.tick == 0) of.dt = dt;
  expects(of.span() == 1 || std::abs(dt - of.dt) <= 1e-6 * of.dt, where,
          "velocities are over readings of one dt, and this is another: call it at one rate, or make the encoders anew");
  Kokkos::parallel_for("gsp::sensor::read_encoders", detail::long_range(exec, of.worlds, of.encoders()),
                       detail::ReadEncoders<Encoders<R, Mem>, From>{of, q, dt, int(of.tick % of.span())});
  ++of.tick;
}

/// Encoders of the worlds of the mask begin anew; their offsets stay. One launch; does not allocate, does not fence. Errors:
/// std::invalid_argument for a mask of another size.
/// @param mask  callable with a world, such as a View<bool*> on the device
template <ExecutionSpace Exec, class R, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void reset_encoders(Exec const& exec, Encoders<R, Mem>& of, Mask const& mask) {
  Region const region("gsp::sensor::reset_encoders");
  detail::expects_mask("gsp::reset_encoders", mask, "encoders", of.worlds);
  Kokkos::parallel_for("gsp::sensor::reset_encoders", detail::long_range(exec, of.worlds, of.encoders()),
                       detail::ResetEncoders<Encoders<R, Mem>, Mask>{of, mask});
}

/// `to` goes on as `from` would have, to the bit: counts and the number of the reading of all worlds. Resolutions and offsets stay. Beside
/// `save` and `restore` of a simulation. Does not allocate, does not fence a device. Errors: std::invalid_argument for encoders of other
/// sizes.
template <ExecutionSpace Exec, class R, class Mem>
void copy_encoders(Exec const& exec, Encoders<R, Mem> const& from, Encoders<R, Mem>& to) {
  Region const region("gsp::sensor::copy_encoders");
  expects(from.worlds == to.worlds && from.encoders() == to.encoders() && from.span() == to.span(), "gsp::copy_encoders",
          "the two differ in worlds, encoders or span: make both with the same options");
  detail::copy_view(exec, from.count, to.count);
  detail::copy_view(exec, from.begun, to.begun);
  detail::copy_view(exec, from.position, to.position);
  detail::copy_view(exec, from.velocity, to.velocity);
  to.tick = from.tick;
  to.dt = from.dt;
}

}  // namespace gsp
