#pragma once
#include <cstdint>
#include <gsp/core/detail/items.hpp>
#include <gsp/sensor/detail/columns.hpp>
#include <gsp/sensor/detail/sample_ring.hpp>

/// Kernels of sensor/sensor_history.hpp, where the contract stands.
namespace gsp::detail {

inline constexpr double mujoco_same_time = 1e-15;  // [s] MuJoCo's mjMINVAL: due times and samples are compared as there

template <class History>
struct HistoryBase {
  History of;
  KOKKOS_INLINE_FUNCTION auto ring(int w, int i) const {
    auto const& e = of.entries(i);
    using R = typename decltype(of.value)::value_type;
    return SampleRing<R>{&of.time(w, e.time), &of.value(w, e.value), &of.cursor(w, i), e.samples, e.size, mujoco_same_time};
  }
  KOKKOS_INLINE_FUNCTION bool is_due(int w, int i) const { return of.due(w, i) + of.entries(i).period <= of.clock(w); }
};

/// t + h + h ... of n additions, h > 0 and t >= 0, each rounded as it is. Between two powers of two sums are whole multiples of one unit in
/// the last place, and so is what an addition adds: the same each time (where h falls in the middle of two of them, from the second on,
/// since the first one is then even). So they go at once up to the next power: a few additions for each.
KOKKOS_INLINE_FUNCTION double add_often(double t, double h, std::int64_t n) {
  while (n > 2) {
    double const once = t + h;
    t = once + h;
    n -= 2;
    double const more = (t + h) - t;
    double const top = Kokkos::bit_cast<double>((Kokkos::bit_cast<std::uint64_t>(t) | 0xfffffffffffff) + 1);  // the next power of two
    if (once < top / 2) continue;
    if (!(more > 0)) return t;  // too small to change it
    std::int64_t const left = std::int64_t((top - t) / more) - 2, k = left < n ? left : n;
    if (k < 1) continue;
    t += double(k) * more;
    n -= k;
  }
  for (; n > 0; --n) t += h;
  return t;
}

/// The clock as MuJoCo has it: a timestep is added at each step.
template <class History, class Steps>
struct TellTime {
  History of;
  Steps steps;
  KOKKOS_FUNCTION void operator()(int w) const {
    std::int64_t const now = steps(w);
    std::int64_t seen = of.seen(w);
    double t = of.clock(w);
    if (now < seen) {
      seen = 0;
      t = 0;
    }
    of.seen(w) = now;
    of.clock(w) = add_often(t, of.timestep, now - seen);
  }
};

/// What is true now is kept, and what the sensor says takes its place.
template <class History, class Data>
struct SayLate : HistoryBase<History> {
  Data data;
  using HistoryBase<History>::of;
  SayLate(History const& history, Data const& numbers) : HistoryBase<History>{history}, data(numbers) {}
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    RowColumn const at = row_column(item, int(of.entries.extent(0)));
    int const w = at.row, i = at.column;
    auto const& e = of.entries(i);
    for (int c = 0; c < e.size; ++c) of.now(w, e.now + c) = data(w, e.adr + c);
    if (!(e.delay > 0) && (!(e.period > 0) || this->is_due(w, i))) return;
    this->ring(w, i).read(of.clock(w) - e.delay, e.interpolation, [&](int c, auto x) { data(w, e.adr + c) = x; });
  }
};

template <class History>
struct RecordSensors : HistoryBase<History> {
  using HistoryBase<History>::of;
  explicit RecordSensors(History const& history) : HistoryBase<History>{history} {}
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    RowColumn const at = row_column(item, int(of.entries.extent(0)));
    int const w = at.row, i = at.column;
    auto const& e = of.entries(i);
    if (e.period > 0) {
      if (!this->is_due(w, i)) return;
      of.due(w, i) += e.period;
    }
    auto* const to = this->ring(w, i).insert(of.clock(w));
    for (int c = 0; c < e.size; ++c) to[c] = of.now(w, e.now + c);
  }
};

/// The times of the start, and zeros.
template <class History, class Mask>
struct ResetHistory {
  History of;
  Mask mask;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    RowColumn const at = row_column(item, int(of.entries.extent(0)));
    int const w = at.row, i = at.column;
    if (!mask(w)) return;
    auto const& e = of.entries(i);
    for (int j = 0; j < e.samples; ++j) of.time(w, e.time + j) = of.start(e.time + j);
    for (int j = 0; j < e.samples * e.size; ++j) of.value(w, e.value + j) = 0;
    for (int c = 0; c < e.size; ++c) of.now(w, e.now + c) = 0;
    of.cursor(w, i) = e.samples - 1;
    of.due(w, i) = e.phase == 0 ? -e.period : e.phase;
    if (i > 0) return;
    of.seen(w) = 0;
    of.clock(w) = 0;
  }
};

/// f(name, the view of each of these) for all that sensors remember of a world: rows are worlds.
template <class F, class... Histories>
void each_history_view(F const& f, Histories&... h) {
  f("seen", h.seen...);
  f("clock", h.clock...);
  f("due", h.due...);
  f("cursor", h.cursor...);
  f("time", h.time...);
  f("value", h.value...);
  f("now", h.now...);
}
template <class View, class Mask>
struct CopyHistory {
  View from, to;
  Mask mask;
  bool one;  // from: of one world, for all
  KOKKOS_FUNCTION void operator()(int w) const {
    if (!mask(w)) return;
    int const source = one ? 0 : w;
    if constexpr (View::rank() == 1)
      to(w) = from(source);
    else
      for (int j = 0; j < int(to.extent(1)); ++j) to(w, j) = from(source, j);
  }
};

}  // namespace gsp::detail
