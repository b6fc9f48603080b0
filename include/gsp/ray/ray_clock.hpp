#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <gsp/ray/ray_pattern.hpp>
#include <string>
#include <vector>

/// Which rays of a unit leave in which step. Time is counted in whole nanoseconds and never summed up: whatever the steps' length, each ray
/// of each scan leaves in one step. Host.
namespace gsp {

/// Rays are numbered through all scans: ray n is ray n % rays of the pattern, in scan n / rays.
struct RayClock {
  int rays = 0;                    // of the pattern
  std::int64_t period = 0;         // [ns] of a scan; 0: all rays leave in each step, at its end
  std::vector<std::int64_t> tick;  // [ns] when each leaves, from the start of its scan, rising; empty: all at its start
  double timestep = 0;             // [s] of a step
};
/// Rays first ... first + count - 1 of all.
struct RayPhase {
  std::int64_t first = 0, count = 0;
};

/// When a unit of this pattern sends its rays, beside steps of `timestep` [s]; times and the period are rounded to nanoseconds. Errors:
/// std::invalid_argument for a pattern without rays, times of another number, that fall, are negative, not finite or not below the period,
/// a period that is negative or beyond 1e6 s, times without a period, and a timestep that is not within 1e-9 to 1e6 s.
inline RayClock make_ray_clock(RayPattern const& pattern, double timestep) {
  expects(!pattern.direction.empty() && pattern.direction.size() <= std::size_t(most_rays),
          "gsp::make_ray_clock: the pattern must have 1 to 16,777,216 rays");
  expects(timestep >= 1e-9 && timestep <= 1e6, "gsp::make_ray_clock: timestep must lie in 1e-9 to 1e6: it is in seconds");
  expects(pattern.period >= 0 && pattern.period <= 1e6, "gsp::make_ray_clock: the period must lie in 0 to 1e6: it is in seconds");
  expects(pattern.time.empty() || pattern.time.size() == pattern.direction.size(),
          "gsp::make_ray_clock: the pattern needs a time for each ray, or none");
  RayClock clock;
  clock.rays = int(pattern.direction.size());
  clock.timestep = timestep;
  clock.period = std::llround(1e9 * pattern.period);
  for (std::size_t k = 0; k < pattern.time.size(); ++k) {
    double const time = pattern.time[k];
    auto const ray = [&] { return "gsp::make_ray_clock: the time of ray " + std::to_string(k) + ", " + std::to_string(time) + " s, "; };
    if (!(time >= 0 && time < pattern.period)) throw std::invalid_argument(ray() + "must lie in 0 to the pattern's period, and below it");
    if (k > 0 && time < pattern.time[k - 1]) throw std::invalid_argument(ray() + "is before that of the ray before it: sort them by time");
    clock.tick.push_back(std::llround(1e9 * time));
  }
  expects(clock.tick.empty() || clock.tick.back() < clock.period,
          "gsp::make_ray_clock: the last ray leaves within a nanosecond of the next scan: make the period longer");
  return clock;
}

/// What a timestep [s] that went through a float was before: a model's own one, or a whole multiple of it. Any other stays. 50 steps of
/// 0.002f are 100 ms and 5 ns, in which a column of the next turn leaves.
inline double unrounded_timestep(double timestep, double own) {
  double const times = std::round(timestep / own), exact = times * own;
  bool const was_float = timestep == double(float(timestep)), near = std::abs(timestep - exact) <= 1.2e-7 * timestep;
  return was_float && near && times >= 1 ? exact : timestep;
}

/// [ns] at which a step begins, from step 0. Errors: std::invalid_argument for a negative step, and beyond 9e15 ns (104 days), where a
/// double counts no nanoseconds.
inline std::int64_t tick_of_step(RayClock const& clock, std::int64_t step) {
  double const time = 1e9 * (double(step) * clock.timestep);
  expects(step >= 0 && time <= 9e15, "gsp::tick_of_step: steps must lie in 0 to 104 days");
  return std::llround(time);
}
/// How many rays have left before this time [ns >= 0]; it never falls as time goes on.
inline std::int64_t rays_before(RayClock const& clock, std::int64_t tick) {
  std::int64_t const scan = tick / clock.period, within = tick % clock.period;
  std::int64_t left = within > 0 ? clock.rays : 0;
  if (!clock.tick.empty()) left = std::lower_bound(clock.tick.begin(), clock.tick.end(), within) - clock.tick.begin();
  return scan * clock.rays + left;
}
/// The rays that leave from the beginning of a step until before its end. Steps follow each other without a gap and share nothing. Cost: a
/// search. Errors: as tick_of_step.
inline RayPhase rays_of_step(RayClock const& clock, std::int64_t step) {
  std::int64_t const begin = tick_of_step(clock, step), end = tick_of_step(clock, step + 1);
  if (clock.period == 0) return {step * clock.rays, clock.rays};
  std::int64_t const first = rays_before(clock, begin);
  return {first, rays_before(clock, end) - first};
}

}  // namespace gsp
