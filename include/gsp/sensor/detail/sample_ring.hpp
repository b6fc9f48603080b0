#pragma once
#include <Kokkos_Core.hpp>
#include <gsp/model/sensor_history.hpp>

/// Samples by their times, kept in a ring: what sensors that are read late are read from.
namespace gsp::detail {

/// The last n samples of `size` numbers by their times, of which those within `same` [s] are one. MuJoCo's mju_historyInsert and -Read.
template <class R>
struct SampleRing {
  double* time;  // (n) [s], which rise from the one after the cursor on, round to the cursor's
  R* value;      // (n, size)
  int* cursor;   // the newest
  int n, size;
  double same;
  KOKKOS_INLINE_FUNCTION int slot(int i) const { return (*cursor + 1 + i) % n; }  // of the i-th, 0: the oldest
  /// The first that is not before t; n: all are.
  KOKKOS_FUNCTION int find(double t) const {
    if (t <= time[slot(0)]) return 0;
    if (t > time[slot(n - 1)]) return n;
    int before = 0, after = n - 1;
    while (after - before > 1) {
      int const middle = (before + after) / 2;
      (time[slot(middle)] < t ? before : after) = middle;
    }
    return after;
  }
  /// Where the numbers of a sample of time t go. It takes the place of one of that time, else of the oldest.
  KOKKOS_FUNCTION R* insert(double t) const {
    int const i = find(t);
    if (i < n && Kokkos::abs(t - time[slot(i)]) < same) return value + slot(i) * size;
    int to = slot(0);
    if (i == n) {  // newer than all
      *cursor = to;
    } else if (i > 0) {  // among them: those before it move down
      for (int j = 0; j < i - 1; ++j) {
        time[slot(j)] = time[slot(j + 1)];
        for (int c = 0; c < size; ++c) value[slot(j) * size + c] = value[slot(j + 1) * size + c];
      }
      to = slot(i - 1);
    }
    time[to] = t;
    return value + to * size;
  }
  /// put(c, number c at time t). Before the oldest and after the newest: theirs.
  template <class Put>
  KOKKOS_FUNCTION void read(double t, Interpolation how, Put const& put) const {
    int const i = t <= time[slot(0)] + same ? 0 : t >= time[slot(n - 1)] - same ? n - 1 : find(t);
    double const next = time[slot(i)];
    bool const met = i == 0 || t >= next - same;
    R const* const y1 = value + slot(i) * size;
    R const* const y0 = met ? y1 : value + slot(i - 1) * size;
    if (met || how == Interpolation::hold) {
      for (int c = 0; c < size; ++c) put(c, y0[c]);
      return;
    }
    double const last = time[slot(i - 1)], step = next - last, a = (t - last) / step;
    if (how == Interpolation::linear) {
      for (int c = 0; c < size; ++c) put(c, y0[c] + R(a) * (y1[c] - y0[c]));
      return;
    }
    // Hermite's cubic, of slopes by the samples beside; beyond the ends nothing changes
    bool const before = i > 1, after = i < n - 1;
    R const* const y = before ? value + slot(i - 2) * size : y0;
    R const* const z = after ? value + slot(i + 1) * size : y1;
    double const span0 = before ? next - time[slot(i - 2)] : 1, span1 = after ? time[slot(i + 1)] - last : 1;
    double const a2 = a * a, a3 = a2 * a;
    for (int c = 0; c < size; ++c) {
      double const m0 = before ? double(y1[c] - y[c]) / span0 : 0, m1 = after ? double(z[c] - y0[c]) / span1 : 0;
      put(c, R((2 * a3 - 3 * a2 + 1) * double(y0[c]) + (a3 - 2 * a2 + a) * step * m0 + (3 * a2 - 2 * a3) * double(y1[c]) +
               (a3 - a2) * step * m1));
    }
  }
};

}  // namespace gsp::detail
