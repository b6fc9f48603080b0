#pragma once
#include <cmath>
#include <gsp/core/check.hpp>

namespace gsp::io::detail {

/// `frames` frames in `seconds` seconds; both from 1 to 65535, as files of animations hold them.
struct FrameRate {
  int frames = 25, seconds = 1;
};

/// The fraction nearest to a rate, by its continued fraction: 25 is 25 / 1, 33.333333 is 100 / 3.
inline FrameRate frame_rate(double per_second) {
  expects(per_second >= 0.001 && per_second <= 1000, "gsp::io: frames_per_second must be 0.001 to 1000");
  double p0 = 0, p1 = 1, q0 = 1, q1 = 0;
  for (double rest = per_second;;) {
    double const whole = std::floor(rest), p = whole * p1 + p0, q = whole * q1 + q0;
    if (p > 65535 || q > 65535) break;
    p0 = p1;
    p1 = p;
    q0 = q1;
    q1 = q;
    if (rest - whole < 1e-6) break;
    rest = 1 / (rest - whole);
  }
  return {static_cast<int>(p1), static_cast<int>(q1)};
}

}  // namespace gsp::io::detail
