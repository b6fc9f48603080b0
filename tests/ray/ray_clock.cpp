// Which rays leave in which step: each once, whatever the steps; where steps and columns meet, the one that begins; what is refused.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/ray/livox_pattern.hpp>
#include <gsp/ray/ray_clock.hpp>

// Over 3 scans and more every ray comes in its order, in the step that holds its time: known from times by themselves, in long double, and
// to a nanosecond beside a step's ends.
TEST_CASE("each ray of each scan leaves in one step, whatever its length") {
  auto const whole = gsp::rotating_pattern({0, 0.1}, 7, {.rate = 13});
  auto const livox = gsp::mid40_pattern(0, 1001);
  auto const avia = gsp::avia_pattern(0, 50);
  gsp::RayPattern bunched{{}, {}, {0, 0, 0.004, 0.004, 0.0401}, 0.05};
  bunched.direction.assign(5, {1, 0, 0});
  for (auto const& pattern : {whole, livox, avia, bunched})
    for (double const timestep : {0.002, 1. / 240, 1. / 3, 0.0005, 1e-4, 0.0123456789, M_PI / 1000, 0.1, 0.25}) {
      auto const clock = gsp::make_ray_clock(pattern, timestep);
      std::int64_t const n = clock.rays;
      std::int64_t next = 0;
      bool within = true;
      for (std::int64_t step = 0; double(step) * timestep < 3.5 * pattern.period; ++step) {
        auto const phase = gsp::rays_of_step(clock, step);
        REQUIRE(phase.first == next);
        REQUIRE(phase.count >= 0);
        for (std::int64_t k = phase.first; k < phase.first + phase.count; ++k) {
          long double const t = (long double)(k / n) * (long double)(std::llround(1e9 * pattern.period)) * 1e-9L +
                                (long double)(pattern.time[std::size_t(k % n)]);
          long double const begin = (long double)(step)*timestep;
          within = within && t > begin - 1.1e-9L && t < begin + timestep + 1.1e-9L;
        }
        next += phase.count;
      }
      CHECK(within);
      CHECK(next >= 3 * n);
    }
}

TEST_CASE("steps that are whole shares of a scan have their columns, from the first on") {
  auto const clock = gsp::make_ray_clock(gsp::vlp16_pattern(1800, 10), 0.002);  // 36 columns of 16 a step
  for (std::int64_t step : {0, 1, 2, 49, 50, 51, 149, 150, 123456789}) {
    auto const phase = gsp::rays_of_step(clock, step);
    CHECK(phase.first == 576 * step);
    CHECK(phase.count == 576);
  }
  // five scans in one step
  auto const long_steps = gsp::rays_of_step(gsp::make_ray_clock(gsp::vlp16_pattern(1800, 10), 0.5), 3);
  CHECK(long_steps.first == 15 * 28800);
  CHECK(long_steps.count == 5 * 28800);
  // rays at each nanosecond: those of both ends of a step
  gsp::RayPattern dense{{}, {}, {}, 10e-9};
  for (int k = 0; k < 10; ++k) {
    dense.direction.push_back({1, 0, 0});
    dense.time.push_back(1e-9 * k);
  }
  for (std::int64_t step = 0; step < 20; ++step) {
    auto const phase = gsp::rays_of_step(gsp::make_ray_clock(dense, 3e-9), step);
    CHECK(phase.first == 3 * step);
    CHECK(phase.count == 3);
  }
  // of a day with steps of 1/240 s no step is lost: there are as many rays as time has gone by
  auto const day = gsp::make_ray_clock(gsp::mid40_pattern(0, 100), 1. / 240);
  CHECK(gsp::rays_of_step(day, 24 * 3600 * 240).first == 86400 * 100000ll);
}

TEST_CASE("a timestep that went through a float is what it was") {
  float const step = 0.002f;
  CHECK(double(step) > 0.002);
  CHECK(gsp::unrounded_timestep(step, 0.002) == 0.002);
  CHECK(gsp::unrounded_timestep(10 * step, 0.002) == 10 * 0.002);
  CHECK(gsp::unrounded_timestep(float(1. / 240), 1. / 240) == 1. / 240);
  for (double const own : {0.001, 0.005, 0.0123, 0.015625})
    for (double const other : {0.002, 0.002 + 1e-10, double(0.0003f), double(0.0021f)}) {
      double const ratio = other / own;
      if (std::fabs(ratio - std::round(ratio)) > 1e-6) CHECK(gsp::unrounded_timestep(other, own) == other);
    }
  CHECK(gsp::unrounded_timestep(0.002 + 1e-10, 0.002) == 0.002 + 1e-10);  // never was a float
  CHECK(gsp::unrounded_timestep(0.25, 0.25) == 0.25);
  // after 100 ms the turn is complete, and nothing of the next has left
  auto const pattern = gsp::vlp16_pattern(1800, 10);
  auto const left = [&](double timestep) {
    auto const last = gsp::rays_of_step(gsp::make_ray_clock(pattern, timestep), 49);
    return last.first + last.count;
  };
  CHECK(left(step) > 28800);
  CHECK(left(gsp::unrounded_timestep(step, 0.002)) == 28800);
}

TEST_CASE("rays that leave all at once: at the start of each scan, or in each step") {
  auto grid = gsp::grid_pattern(4, 3, 1, 1);
  auto const each = gsp::make_ray_clock(grid, 0.002);
  for (std::int64_t step : {0, 1, 7}) {
    CHECK(gsp::rays_of_step(each, step).first == 12 * step);
    CHECK(gsp::rays_of_step(each, step).count == 12);
  }
  grid.period = 0.01;
  auto const slow = gsp::make_ray_clock(grid, 0.002);
  for (std::int64_t step = 0; step < 23; ++step) {
    auto const phase = gsp::rays_of_step(slow, step);
    CHECK(phase.count == (step % 5 == 0 ? 12 : 0));
    CHECK(phase.first == 12 * ((step + 4) / 5));
  }
}

TEST_CASE("clocks that cannot be") {
  auto const refused = [](gsp::RayPattern const& pattern, double timestep, char const* part) {
    CHECK_THROWS_WITH_AS(gsp::make_ray_clock(pattern, timestep), doctest::Contains(part), std::invalid_argument);
  };
  gsp::RayPattern const two{{{1, 0, 0}, {1, 0, 0}}, {}, {0, 0.1}, 1};
  auto const with = [&](std::vector<double> const& time, double period) {
    auto pattern = two;
    pattern.time = time;
    pattern.period = period;
    return pattern;
  };
  CHECK(gsp::make_ray_clock(two, 0.1).tick == std::vector<std::int64_t>{0, 100000000});
  refused({}, 0.1, "must have 1 to 16,777,216 rays");
  for (double const bad : {0., -0.1, double(NAN), double(INFINITY), 1e-10}) refused(two, bad, "timestep must lie in");
  for (double const bad : {-1., double(NAN), double(INFINITY), 1e7}) refused(with({}, bad), 0.1, "the period must lie in");
  refused(with({0}, 1), 0.1, "a time for each ray, or none");
  refused(with({0, 1}, 1), 0.1, "the time of ray 1, 1.000000 s, must lie in 0 to the pattern's period");
  refused(with({-1e-9, 0.5}, 1), 0.1, "the time of ray 0");
  refused(with({NAN, 0.5}, 1), 0.1, "the time of ray 0");
  refused(with({0, 0}, 0), 0.1, "must lie in 0 to the pattern's period");
  refused(with({0.5, 0.4}, 1), 0.1, "sort them by time");
  refused(with({0, 1 - 1e-12}, 1), 0.1, "make the period longer");
  auto const clock = gsp::make_ray_clock(two, 0.1);
  CHECK_THROWS_WITH_AS(gsp::rays_of_step(clock, -1), doctest::Contains("0 to 104 days"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::tick_of_step(clock, std::int64_t(1) << 60), std::invalid_argument);
}
