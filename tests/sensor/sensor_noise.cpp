// Noise of sensors: Allan deviations beside closed forms, what is added, rounded and cut by hand, batches, starts, encoders.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <gsp/core/detail/items.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/sensor/encoders.hpp>
#include <gsp/sensor/imu_noise.hpp>
#include <gsp/sensor/sensor_delay.hpp>
#include <gsp/sensor/sensor_noise.hpp>
#include <gsp_test_execs.hpp>

#include "support/kokkos_tools.hpp"

namespace {
template <class Exec, class R = double>
using Rows = Kokkos::View<R**, Kokkos::LayoutRight, typename Exec::memory_space>;

/// Allan variance of a series that comes number by number: half the mean square of the difference of neighbouring means of m.
struct Allan {
  int m;
  double sum = 0, last = 0, total = 0;
  long long count = 0, clusters = 0;
  void operator()(double x) {
    sum += x;
    if (++count % m != 0) return;
    double const mean = sum / m;
    if (clusters++ > 0) total += (mean - last) * (mean - last);
    last = mean;
    sum = 0;
  }
};
template <class View>
std::vector<double> numbers(View const& v) {
  auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace(), v);
  std::vector<double> out;
  for (int w = 0; w < int(host.extent(0)); ++w)
    for (int c = 0; c < int(host.extent(1)); ++c) out.push_back(double(host(w, c)));
  return out;
}
}  // namespace

// 8 worlds of 2^20 samples. Of M clusters a variance is found within sqrt(3 / M), its root within half of that: 0.7 % at the longest, so
// that 3 % are more than four deviations.
TEST_CASE("Allan deviations of white noise, a bias that walks and a bounded one are the closed forms") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  Exec const exec;
  double const dt = .005, N = .02, K = .3, s = .5, T = .5;
  int const worlds = 8;
  gsp::ChannelNoise white{.density = N}, walking{.walk = K}, bounded{.bias = s, .bias_time = T};
  auto noise = gsp::make_sensor_noise<double>(exec, {.channels = {white, walking, bounded}, .worlds = worlds, .seed = 1});
  Rows<Exec> const zero("zero", worlds, 3), y("y", worlds, 3);
  std::vector<int> const lengths{1, 4, 16, 64, 256};
  std::vector<Allan> all;
  for (int k = 0; k < worlds * 3; ++k)
    for (int const m : lengths) all.push_back({m});
  double mean = 0, square = 0;
  int const samples = 1 << 20;
  for (int k = 0; k < samples; ++k) {
    gsp::add_sensor_noise(exec, noise, dt, zero, y);
    exec.fence();
    for (int i = 0; i < worlds * 3; ++i) {
      double const x = y(i / 3, i % 3);
      for (int j = 0; j < 5; ++j) all[std::size_t(5 * i + j)](x);
    }
    for (int w = 0; w < worlds; ++w) {
      mean += y(w, 0);
      square += y(w, 2) * y(w, 2);
    }
  }
  // white: mean 0 within 4 deviations of the mean; bounded: its deviation, of samples that are independent over 2 T
  CHECK(std::abs(mean / (double(samples) * worlds)) < 4 * N / std::sqrt(dt) / std::sqrt(double(samples) * worlds));
  CHECK(std::abs(std::sqrt(square / (double(samples) * worlds)) / s - 1) < 0.02);
  for (int j = 0; j < 5; ++j) {
    int const m = lengths[std::size_t(j)];
    double const tau = m * dt, e = std::exp(-dt / T);
    // bounded: variance minus covariance of neighbouring means, of the covariance s^2 e^|k|
    double difference = 0;
    for (int k = -m + 1; k < 2 * m; ++k) {
      double const variance = std::fmax(0, m - std::abs(k)), covariance = std::fmax(0, m - std::abs(k - m));
      difference += (variance - covariance) * std::pow(e, std::abs(k));
    }
    double const expected[3] = {N * N / tau, K * K * tau / 3 * (1 + .5 / (double(m) * m)), s * s * difference / (double(m) * m)};
    if (m >= 16) {  // what the page says of means that are not sums
      double const x = tau / T, said = 2 * s * s / x * (1 - (3 - 4 * std::exp(-x) + std::exp(-2 * x)) / (2 * x));
      CHECK(std::abs(said / expected[2] - 1) < 0.02);
    }
    for (int c = 0; c < 3; ++c) {
      double total = 0, count = 0;
      for (int w = 0; w < worlds; ++w) {
        auto const& a = all[std::size_t(5 * (3 * w + c) + j)];
        total += a.total / 2;
        count += double(a.clusters - 1);
      }
      double const ratio = std::sqrt(total / count / expected[c]);
      CHECK_MESSAGE(std::abs(ratio - 1) < 0.03, "channel " << c << " at " << tau << " s: " << ratio);
    }
  }
  CHECK(std::abs(gsp::bias_of_instability(std::sqrt(2 / 1.8926 * (1 - (3 - 4 * std::exp(-1.8926) + std::exp(-3.7852)) / 3.7852))) - 1) <
        1e-6);
}

TEST_CASE_TEMPLATE("what is coupled, rounded and cut; parameters of worlds' own; columns", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  gsp::ImuNoise imu{.accelerometer = {.step = .25, .limit = 2}, .gyro = {}};
  imu.accelerometer_matrix = {.1, 0, 0, .01, 0, 0, 0, 0, 0};
  imu.gyro_matrix = {0, .02, 0, 0, 0, 0, 0, 0, -.5};
  imu.g_sensitivity = {0, 0, .001, 0, 0, 0, 0, 0, 0};
  gsp::SensorNoiseOptions options{.worlds = 2, .per_world = true};
  options.columns = {1, 2, 3, 4, 5, 6};
  auto noise = gsp::make_sensor_noise<double>(exec, gsp::imu_noise(imu, options));
  Kokkos::deep_copy(Kokkos::subview(noise.coupling, 1, Kokkos::ALL, Kokkos::ALL), 0.);
  Kokkos::deep_copy(Kokkos::subview(noise.step, 1, Kokkos::ALL), 0.);
  Rows<Exec> const x("x", 2, 7), y("y", 2, 7);
  auto const host = Kokkos::create_mirror_view(x);
  double const given[7] = {9, 1, -.12, 7, 1, 2, 4};
  for (int c = 0; c < 7; ++c) host(0, c) = host(1, c) = given[c];
  Kokkos::deep_copy(x, host);
  gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::add_sensor_noise(exec, noise, .01, x, y); }));
  exec.fence();
  // by hand: 1.1, -0.11 and 7 to quarters, within 2; then 1 + .02 * 2 + .001 * 7, 2, 4 - .5 * 4. World 1: neither rounded nor coupled
  std::vector<double> const expected{0, 1, 0, 2, 1.047, 2, 2, 0, 1, -.12, 2, 1, 2, 4};
  auto const said = numbers(y);
  for (std::size_t k = 0; k < expected.size(); ++k) CHECK_MESSAGE(std::abs(said[k] - expected[k]) < 1e-15, k << ": " << said[k]);

  CHECK_THROWS_AS(gsp::add_sensor_noise(exec, noise, .01, x, x), std::invalid_argument);
  CHECK_THROWS_AS(gsp::add_sensor_noise(exec, noise, 0, x, y), std::invalid_argument);
  CHECK_THROWS_AS(gsp::add_sensor_noise(exec, noise, .01, Rows<Exec>("z", 1, 7), y), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::add_sensor_noise(exec, noise, .01, x, Rows<Exec>("z", 2, 6)),
                       "gsp::add_sensor_noise: y has 6 columns, and 7 are read: give the view that the columns were chosen for",
                       std::invalid_argument);
  auto const refused = [&](gsp::SensorNoiseOptions const& bad) {
    CHECK_THROWS_AS((void)gsp::make_sensor_noise<double>(exec, bad), std::invalid_argument);
  };
  refused({.coupling = {1}});  // of no channels
  refused({.channels = {{.density = -1}}});
  refused({.channels = {{.step = NAN}}});
  refused({.channels = {{.bias = 1}}});
  refused({.channels = {{}}, .columns = {0, 1}});
  refused({.channels = {{}}, .coupling = {1, 2}});
  refused({.channels = {{}}, .columns = {-1}});
  refused({.channels = {{}}, .worlds = 0});
  refused({.channels = {{}, {}}, .columns = {1, 1}});
  refused({.channels = {{}}, .blanks = {{.numbers = {1, 1}}}});
  refused({.channels = {{}}, .blanks = {{.signs = {-1, 1}}}});
  refused({.channels = {{}}, .blanks = {{.signs = {0, 0}}}});
  auto const unit = [&](std::vector<std::array<int, 2>> units, char const* why) {
    CHECK_THROWS_WITH_AS((void)gsp::make_sensor_noise<double>(exec, {.channels = {{}, {}, {}}, .columns = {2, 3, 5}, .units = units}),
                         (std::string("gsp::make_sensor_noise: a unit ") + why).c_str(), std::invalid_argument);
  };
  unit({{-1, 2}}, "has a first column below 0 or no columns: give its first column and how many");
  unit({{2, 0}}, "has a first column below 0 or no columns: give its first column and how many");
  unit({{2, 3}}, "has column 4, which is no channel's: name it in columns");
  unit({{5, 2147483647}}, "has column 6, which is no channel's: name it in columns");
  unit({{2, 2}, {3, 1}}, "shares column 3 with another: keep them apart");
  CHECK_THROWS_AS((void)gsp::make_encoders<double>(exec, {.columns = std::vector<int>((1 << 24) + 1), .resolution = 1}),
                  std::invalid_argument);
}

TEST_CASE_TEMPLATE("a world's noise is its own: any batch, other worlds, sensors and seeds; starts by a mask", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  gsp::ChannelNoise const all{.density = .1, .walk = .2, .bias = 1, .bias_time = 3, .turn_on = 2};
  int const worlds = 300, samples = 100;
  auto const series = [&](gsp::SensorNoiseOptions options) {
    options.channels = {all, all};
    auto noise = gsp::make_sensor_noise<float>(exec, options);
    Rows<Exec, float> const zero("zero", options.worlds, 2), y("y", options.worlds, 2);
    std::vector<std::vector<double>> out;
    for (int k = 0; k < samples; ++k) {
      gsp::add_sensor_noise(exec, noise, .01, zero, y);
      exec.fence();
      out.push_back(numbers(y));
    }
    return out;
  };
  auto const whole = series({.worlds = worlds, .seed = 3}), part = series({.worlds = 7, .seed = 3, .first_world = 40}),
             sensor = series({.worlds = worlds, .seed = 3, .sensor = 1}), seed = series({.worlds = worlds, .seed = 4});
  for (int k = 0; k < samples; ++k) CHECK(part[k] == std::vector<double>(whole[k].begin() + 80, whole[k].begin() + 94));
  // differences of samples next to each other are white but for 1e-2: of pairs that should be independent, the correlation is below four
  // of its deviations, 4 / sqrt(pairs), and neighbours in the list are neither
  auto const rate = [&](auto const& of, int k, std::size_t i) { return of[k][i] - of[k - 1][i]; };
  auto const correlation = [&](auto const& pair) {
    double ab = 0, aa = 0, bb = 0;
    int count = 0;
    for (int k = 1; k < samples; k += 2)
      for (std::size_t i = 0; i + 2 < std::size_t(2 * worlds); i += 2) {
        auto const [a, b] = pair(k, i);
        ab += a * b;
        aa += a * a;
        bb += b * b;
        ++count;
      }
    return std::abs(ab) / std::sqrt(aa * bb) * std::sqrt(double(count));
  };
  CHECK(correlation([&](int k, std::size_t i) { return std::pair(rate(whole, k, i), rate(whole, k, i + 1)); }) < 4);  // channels
  CHECK(correlation([&](int k, std::size_t i) { return std::pair(rate(whole, k, i), rate(whole, k, i + 2)); }) < 4);  // worlds
  CHECK(correlation([&](int k, std::size_t i) { return std::pair(rate(whole, k, i), rate(sensor, k, i)); }) < 4);
  CHECK(correlation([&](int k, std::size_t i) { return std::pair(rate(whole, k, i), rate(seed, k, i)); }) < 4);
  // a twentieth of it shows
  CHECK(correlation([&](int k, std::size_t i) { return std::pair(rate(whole, k, i), rate(sensor, k, i) + .05 * rate(whole, k, i)); }) > 4);

  // starts: of 2,000 biases the deviation is found within 4 / sqrt(2 * 2000) of itself
  auto noise = gsp::make_sensor_noise<double>(exec, {.channels = {all}, .worlds = 2000, .seed = 9});
  auto const biases = [&] {
    auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace(), noise.drift);
    std::vector<std::vector<double>> out(3);
    for (int w = 0; w < 2000; ++w)
      for (int k = 0; k < 3; ++k) out[std::size_t(k)].push_back(host(w, 0, k));
    return out;
  };
  auto const deviation = [](std::vector<double> const& v) {
    double sum = 0;
    for (double const x : v) sum += x * x;
    return std::sqrt(sum / double(v.size()));
  };
  auto const before = biases();
  CHECK(std::abs(deviation(before[0]) / 2 - 1) < 0.064);
  CHECK(deviation(before[1]) == 0);
  CHECK(std::abs(deviation(before[2]) - 1) < 0.064);
  Rows<Exec> const y("y", 2000, 1);
  for (int k = 0; k < 50; ++k) gsp::add_sensor_noise(exec, noise, .01, y, y);
  auto const during = biases();
  CHECK(during[0] == before[0]);
  CHECK(std::abs(deviation(during[1]) / (.2 * std::sqrt(.5)) - 1) < 0.064);
  Kokkos::View<bool*, typename Exec::memory_space> const mask("mask", 2000);
  Kokkos::deep_copy(Kokkos::subview(mask, std::pair(0, 1000)), true);
  gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::reset_sensor_noise(exec, noise, mask); }));
  exec.fence();
  auto const after = biases();
  for (std::size_t w = 0; w < 2000; ++w)
    for (std::size_t k = 0; k < 3; ++k) CHECK((after[k][w] == during[k][w]) == (w >= 1000));
  for (std::size_t w = 0; w < 1000; ++w) CHECK(after[0][w] != before[0][w]);  // each start has its own
  gsp::reset_sensor_noise(exec, noise, mask);                                 // before a sample it is the same start
  CHECK(biases() == after);
  CHECK(std::abs(deviation({after[0].begin(), after[0].begin() + 1000}) / 2 - 1) < 0.09);

  // save, and go on from there: the same again
  auto saved = gsp::make_sensor_noise<double>(exec, {.channels = {all}, .worlds = 2000, .seed = 9});
  gsp::copy_sensor_noise(exec, noise, saved);
  auto const later = [&] {
    Kokkos::deep_copy(y, 0.);
    for (int k = 0; k < 5; ++k) gsp::add_sensor_noise(exec, noise, .01, y, y);
    exec.fence();
    return numbers(y);
  };
  auto const first = later();
  gsp::copy_sensor_noise(exec, saved, noise);
  CHECK(later() == first);
  CHECK(later() != first);
  auto other = gsp::make_sensor_noise<double>(exec, {.channels = {all}});
  CHECK_THROWS_AS(gsp::copy_sensor_noise(exec, noise, other), std::invalid_argument);
}

TEST_CASE_TEMPLATE("an IMU of a data sheet, whose numbers come late", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 100;
  double const dt = .002;
  Rows<Exec, float> const data("data", worlds, 9), measured("measured", worlds, 9);
  Kokkos::View<bool*, typename Exec::memory_space> const done("done", worlds);
  Kokkos::deep_copy(data, 1.F);
  // example-begin imu
  gsp::ImuNoise const imu{.accelerometer = {.density = 1.4e-3, .walk = 8e-5, .turn_on = .05, .limit = 156},
                          .gyro = {.density = 8.7e-5, .bias = gsp::bias_of_instability(5e-5), .bias_time = 300, .step = 1.3e-4}};
  std::vector<int> const columns{0, 1, 2, 6, 7, 8};  // of the accelerometer and the gyro: sensor_adr ...
  auto noise = gsp::make_sensor_noise<float>(exec, gsp::imu_noise(imu, {.columns = columns, .worlds = worlds, .seed = 1}));
  auto delay = gsp::make_sensor_delay<float>(
      exec, {.worlds = worlds, .numbers = 6, .columns = columns, .latency = .004, .jitter = .002, .samples = 4, .seed = 1});

  gsp::add_sensor_noise(exec, noise, dt, data, measured);  // each dt seconds, after read_sensors
  gsp::delay_sensor(exec, delay, dt, measured, measured);
  gsp::reset_sensor_noise(exec, noise, done);  // with reset(exec, model, state, done)
  gsp::reset_sensor_delay(exec, delay, done);
  // example-end imu
  exec.fence();
  auto const said = numbers(measured);
  double square = 0;
  for (std::size_t k = 0; k < said.size(); ++k) {
    int const c = int(k % 9);
    if (c >= 3 && c < 6)
      CHECK(said[k] == 0);
    else
      CHECK(std::abs(said[k] - 1) < (c < 3 ? .5 : .02));
    if (c < 3) square += (said[k] - 1) * (said[k] - 1) / (3. * worlds);
  }
  // 300 numbers: within four of 1 / sqrt(600)
  CHECK(std::abs(std::sqrt(square / (.05 * .05 + 1.4e-3 * 1.4e-3 / dt)) - 1) < .17);

  // a ramp of 2 a sample, from the 1 of the first on: 4 to 6 ms late are two samples and a part, so the third before is held; what comes
  // after a reset counts as what was there all the time
  for (int k = 1; k < 15; ++k) {
    Kokkos::deep_copy(data, float(1 + 2 * k));
    if (k == 10) {
      Kokkos::deep_copy(Kokkos::subview(done, std::pair(0, 40)), true);
      gsp::reset_sensor_noise(exec, noise, done);
      gsp::reset_sensor_delay(exec, delay, done);
    }
    gsp::add_sensor_noise(exec, noise, dt, data, measured);
    gsp::delay_sensor(exec, delay, dt, measured, measured);
    exec.fence();
    auto const late = numbers(measured);
    for (int w = 0; w < worlds; ++w)
      for (int const c : columns) {
        int const start = k >= 10 && w < 40 ? 10 : 0, sample = std::max(start, k - 3);
        CHECK(std::abs(late[std::size_t(9 * w + c)] - (1 + 2 * sample)) < (c < 3 ? .5 : .02));
      }
  }
}

TEST_CASE("the noise that MJCF's sensors have, where it is asked for") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  Exec const exec;
  auto robot = gsp::samples::quadruped_scene();
  robot.sensors.push_back({.name = "still", .type = "gyro", .object_type = "site", .object = "imu"});
  robot.sensors.push_back({.name = "turn", .type = "framequat", .object_type = "site", .object = "imu", .noise = .01});
  robot.sensors.push_back({.name = "acc", .type = "accelerometer", .object_type = "site", .object = "imu", .noise = .5});
  auto const compiled = gsp::compile(robot);
  int const adr = compiled.sensor_adr[std::size_t(compiled.nsensor - 3)], worlds = 4000;
  auto noise = gsp::make_sensor_noise<double>(exec, gsp::mjcf_noise(compiled, {.worlds = worlds}));
  Rows<Exec> const data("data", worlds, compiled.nsensordata);
  for (int w = 0; w < worlds; ++w) data(w, adr + 3) = 1;  // no turn
  gsp::add_sensor_noise(exec, noise, .01, data, data);
  exec.fence();
  double turn = 0, acc = 0;
  for (int w = 0; w < worlds; ++w) {
    for (int c = 0; c < 3; ++c) CHECK(data(w, adr + c) == 0);
    double unit = 0;
    for (int c = 0; c < 4; ++c) unit += data(w, adr + 3 + c) * data(w, adr + 3 + c);
    CHECK(std::abs(unit - 1) < 1e-14);
    for (int c = 0; c < 3; ++c) {
      turn += data(w, adr + 4 + c) * data(w, adr + 4 + c) / (3. * worlds);
      acc += data(w, adr + 7 + c) * data(w, adr + 7 + c) / (3. * worlds);
    }
  }
  // of 12,000 numbers: within four of 1 / sqrt(24000)
  CHECK(std::abs(std::sqrt(turn) / .01 - 1) < 0.026);
  CHECK(std::abs(std::sqrt(acc) / .5 - 1) < 0.026);
  // a model without noise: its sensors say what they say
  auto const still = gsp::compile(gsp::samples::quadruped_scene());
  auto none = gsp::make_sensor_noise<double>(exec, gsp::mjcf_noise(still, {.worlds = 2}));
  CHECK(none.channels() == 0);
  auto saved = gsp::make_sensor_noise<double>(exec, gsp::mjcf_noise(still, {.worlds = 2, .per_world = true}));
  Rows<Exec> const quiet("quiet", 2, still.nsensordata + 1), said("said", 2, still.nsensordata + 1);
  Kokkos::deep_copy(quiet, 3.);
  gsp::add_sensor_noise(exec, none, .01, quiet, quiet);
  gsp::add_sensor_noise(exec, none, .01, quiet, said);
  gsp::reset_sensor_noise(exec, none, gsp::detail::AllWorlds{});
  gsp::copy_sensor_noise(exec, none, saved);
  exec.fence();
  for (double const x : numbers(quiet)) CHECK(x == 3);
  for (double const x : numbers(said)) CHECK(x == 0);
}

// 187 points of a scan with 2 cm of noise each: the deviation of 74,800 numbers within four of 1 / sqrt(149600).
TEST_CASE_TEMPLATE("a height scan whose points err by themselves", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 400, points = 187;
  Rows<Exec, float> const heights("heights", worlds, points);
  Kokkos::deep_copy(heights, -0.5f);
  double const dt = 0.02;
  // example-begin height_noise
  std::vector<gsp::ChannelNoise> const each(points, {.deviation = 0.02});  // [m] of each sample, whatever dt is
  auto noise = gsp::make_sensor_noise<float>(exec, {.channels = each, .worlds = worlds, .seed = 1});
  gsp::add_sensor_noise(exec, noise, dt, heights, heights);  // (worlds, points): without .columns channel k is column k
  // example-end height_noise
  exec.fence();
  double sum = 0, squares = 0, n = double(worlds) * points;
  for (double const x : numbers(heights)) {
    sum += (x + 0.5) / 0.02;
    squares += (x + 0.5) * (x + 0.5) / 4e-4;
  }
  CHECK(std::abs(sum / n) < 4 / std::sqrt(n));
  CHECK(std::abs(std::sqrt(squares / n) - 1) < 4 / std::sqrt(2 * n));
}

// Of each sensor two rows of numbers: one that is measured, one where nothing is met. Noise of 0.1, in 500 worlds of each.
TEST_CASE_TEMPLATE("MJCF's noise of rays, contacts and distances: unit vectors, nothing where nothing is met", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  struct Case {
    gsp::SensorDescription sensor;
    int size;
    std::vector<double> met, nothing;
    std::vector<int> units;  // first of three
    std::vector<int> still;  // numbers without noise
  };
  auto const sensor = [](std::string type, std::string data, double cutoff = 0) {
    gsp::SensorDescription s{.type = std::move(type), .noise = .1};
    if (!data.empty()) s.settings = {{s.type == "user" ? "datatype" : "data", data}};
    s.cutoff = cutoff;
    return s;
  };
  std::vector<Case> const cases{
      {sensor("normal", ""), 3, {0, .6, .8}, {0, 0, 0}, {0}, {}},
      {sensor("fromto", ""), 6, {1, 2, 3, 4, 5, 6}, {0, 0, 0, 0, 0, 0}, {}, {}},
      {sensor("distance", "", .3), 1, {.2}, {.3}, {}, {}},
      {sensor("distance", ""), 1, {-.2}, {0}, {}, {}},
      {sensor("rangefinder", ""), 1, {1e-3}, {-1}, {}, {}},
      {sensor("rangefinder", "", .3), 1, {1e-3}, {-.3}, {}, {}},
      {sensor("rangefinder", "dist dir origin normal depth"),
       11,
       {2, 0, 0, 1, 5, 5, 5, 0, 1, 0, 2},
       {-1, 0, 0, 0, 5, 5, 5, 0, 0, 0, -1},
       {1, 7},
       {}},
      {sensor("rangefinder", "point normal"), 6, {0, 0, 0, 1, 0, 0}, {0, 0, 0, 0, 0, 0}, {3}, {}},
      {sensor("rangefinder", "origin"), 3, {1, 1, 1}, {}, {}, {}},
      {sensor("contact", "found force normal tangent"), 10, {2, 0, 0, 9, 0, 0, 1, 0, 1, 0}, std::vector<double>(10, 0), {4, 7}, {0}},
      {sensor("contact", "dist pos"), 4, {-.1, 1, 1, 1}, {0, 0, 0, 0}, {}, {}},
      {sensor("touch", ""), 1, {1e-3}, {0}, {}, {}},
      {sensor("framexaxis", ""), 3, {1, 0, 0}, {}, {0}, {}},
      {sensor("user", "axis"), 3, {0, 1, 0}, {}, {0}, {}},
      {sensor("user", "positive"), 2, {1, 1e-3}, {0, 0}, {}, {}},
      {sensor("user", ""), 2, {0, 1}, {}, {}, {}},
  };
  for (auto const& c : cases) {
    CAPTURE(c.sensor.type);
    CAPTURE(c.size);
    gsp::CompiledModel compiled;
    compiled.nsensor = 1;
    compiled.nsensordata = 3 * c.size;
    compiled.sensors = {c.sensor};
    if (c.sensor.type == "contact") compiled.sensors[0].settings.push_back({"num", "3"});
    bool const groups = c.sensor.type == "contact" || c.sensor.type == "rangefinder";  // slots, pixels
    compiled.sensor_adr = {0};
    compiled.sensor_dim = {groups ? 3 * c.size : c.size};
    int const worlds = 1000, width = 3 * c.size;
    Rows<Exec> const data("data", worlds, width), said("said", worlds, width);
    auto const host = Kokkos::create_mirror_view(data);
    for (int w = 0; w < worlds; ++w)
      for (int k = 0; k < width; ++k) {  // met, nothing, met; every other world the other way round
        bool const nothing = !c.nothing.empty() && (k / c.size + w) % 2 == 1;
        host(w, k) = (nothing ? c.nothing : c.met)[std::size_t(k % c.size)];
      }
    Kokkos::deep_copy(data, host);
    auto const given = numbers(data);
    auto const options = gsp::mjcf_noise(compiled, {.worlds = worlds, .seed = 4});
    auto noise = gsp::make_sensor_noise<double>(exec, options), same = gsp::make_sensor_noise<double>(exec, options);
    gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::add_sensor_noise(exec, noise, .01, data, said); }));
    gsp::add_sensor_noise(exec, same, .01, data, data);  // in place
    exec.fence();
    auto const y = numbers(said), in_place = numbers(data);
    int const written = groups ? width : c.size;
    bool const positive = c.sensor.type == "touch" || c.sensor.type == "rangefinder" || c.size == 2;
    int moved = 0, still = 0, lengths = 0, negative = 0, differ = 0;
    for (int w = 0; w < worlds; ++w)
      for (int k = 0; k < written; ++k) {
        bool const nothing = !c.nothing.empty() && (k / c.size + w) % 2 == 1;
        std::size_t const at = std::size_t(w) * std::size_t(width) + std::size_t(k);
        differ += y[at] != in_place[at];
        bool const exact = std::find(c.still.begin(), c.still.end(), k % c.size) != c.still.end();
        (nothing || exact ? still : moved) += y[at] != given[at];
        if (positive && !nothing && c.size < 3) negative += y[at] < 0;
        if (nothing || std::find(c.units.begin(), c.units.end(), k % c.size) == c.units.end()) continue;
        lengths += std::abs(y[at] * y[at] + y[at + 1] * y[at + 1] + y[at + 2] * y[at + 2] - 1) < 1e-14;
      }
    CHECK(differ == 0);
    CHECK(still == 0);
    if (c.sensor.type != "user" || c.sensor.settings.size() > 0) CHECK(negative == 0);
    int const share = c.nothing.empty() ? worlds : worlds / 2, rows = written / c.size;
    CHECK(moved == share * rows * (c.size - int(c.still.size())));
    CHECK(lengths == share * rows * int(c.units.size()));
  }
  CHECK(gsp::range_settings(sensor("rangefinder", "dist depth")).fields == 0b100001);
  CHECK(gsp::range_settings(sensor("rangefinder", "")).fields == 1);
}

// Beside 64-bit division; the largest number of items is worlds x channels, of ints.
TEST_CASE("rows and columns of items beyond 32 bits") {
  for (std::int64_t const n : {1, 3, 7, 1 << 20, 2147483647})
    for (std::int64_t const row : {std::int64_t(0), std::int64_t(5), std::int64_t(4294967296) / n, std::int64_t(2147483646)})
      for (std::int64_t const column : {std::int64_t(0), n / 2, n - 1}) {
        if (row > 2147483647) continue;
        auto const found = gsp::detail::row_column(row * n + column, int(n));
        CHECK(found.row == row);
        CHECK(found.column == column);
      }
}

// A joint that turns by 1 rad/s: 4 readings span 40 ms, and an encoder of 4,096 counts a turn sees that rate to a count over the span.
TEST_CASE_TEMPLATE("encoders of positions as a page has them", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 2;
  double const dt = .01, turn = 6.283185307179586;
  Rows<Exec> const qpos("qpos", worlds, 3);
  Kokkos::View<bool*, typename Exec::memory_space> const done("done", worlds);
  std::vector<int> const columns{2};
  // example-begin encoders
  // columns: of qpos, compiled.jnt_qposadr has them; or of sensordata, sensor_adr
  auto encoders = gsp::make_encoders<double>(exec, {.worlds = worlds, .columns = columns, .resolution = turn / 4096, .span = 4, .seed = 3});
  for (int k = 0; k < 10; ++k) {
    Kokkos::deep_copy(qpos, k * dt);
    gsp::read_encoders(exec, encoders, dt, qpos);  // each dt seconds: encoders.position, encoders.velocity (worlds, encoders)
  }
  gsp::reset_encoders(exec, encoders, done);  // with reset(exec, model, state, done)
  // example-end encoders
  for (double const v : numbers(encoders.velocity)) CHECK(std::abs(v - 1) <= turn / 4096 / (4 * dt));
}

TEST_CASE_TEMPLATE("encoders: whole counts, velocities over a span, starts, NaN", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  double const step = .25, dt = .01, rate = 3.7;
  gsp::EncodersOptions options{.worlds = 3, .columns = {1}, .resolution = step, .span = 10, .seed = 2};
  auto encoders = gsp::make_encoders<double>(exec, options);
  options.worlds = 1;
  options.first_world = 2;
  auto alone = gsp::make_encoders<double>(exec, options);
  Rows<Exec> const q("q", 3, 2), one("one", 1, 2);
  auto const offset = numbers(encoders.offset);
  CHECK(offset[2] == numbers(alone.offset)[0]);
  CHECK(offset[0] != offset[1]);
  auto const count = [&](double x, int w) { return std::floor(x / step + offset[std::size_t(w)]); };
  for (int k = 0; k < 60; ++k) {
    double const x = -1 + rate * k * dt;
    Kokkos::deep_copy(q, x);
    Kokkos::deep_copy(one, x);
    gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::read_encoders(exec, encoders, dt, q); }));
    gsp::read_encoders(exec, alone, dt, one);
    exec.fence();
    auto const position = numbers(encoders.position), velocity = numbers(encoders.velocity);
    CHECK(numbers(alone.velocity)[0] == velocity[2]);
    for (int w = 0; w < 3; ++w) {
      double const before = -1 + rate * std::max(k - 10, 0) * dt;
      CHECK(position[std::size_t(w)] == step * count(x, w));
      CHECK(std::abs(velocity[std::size_t(w)] - step * (count(x, w) - count(before, w)) / (10 * dt)) < 1e-12);
      if (k >= 10) CHECK(std::abs(velocity[std::size_t(w)] - rate) <= step / (10 * dt));
    }
  }
  Kokkos::View<bool*, typename Exec::memory_space> const mask("mask", 3);
  Kokkos::deep_copy(Kokkos::subview(mask, 1), true);
  gsp::reset_encoders(exec, encoders, mask);
  Kokkos::deep_copy(q, 40.);
  gsp::read_encoders(exec, encoders, dt, q);
  exec.fence();
  CHECK(numbers(encoders.velocity)[1] == 0);
  CHECK(numbers(encoders.velocity)[0] > 100);
  Kokkos::deep_copy(q, NAN);
  gsp::read_encoders(exec, encoders, dt, q);
  exec.fence();
  CHECK(std::isnan(numbers(encoders.position)[0]));
  CHECK(std::isnan(numbers(encoders.velocity)[2]));
  // what comes after NaN has nothing before it: a first reading, and then a span that begins there
  for (int k = 0; k < 12; ++k) {
    double const x = 7 + k * step;
    Kokkos::deep_copy(q, x);
    gsp::read_encoders(exec, encoders, dt, q);
    exec.fence();
    for (int w = 0; w < 3; ++w) {
      CHECK(numbers(encoders.position)[std::size_t(w)] == step * count(x, w));
      CHECK(std::abs(numbers(encoders.velocity)[std::size_t(w)] - step * std::min(k, 10) / (10 * dt)) < 1e-12);
    }
  }
  // save, and go on from there: the same again
  options.worlds = 3;
  options.first_world = 0;
  auto saved = gsp::make_encoders<double>(exec, options);
  gsp::copy_encoders(exec, encoders, saved);
  auto const later = [&] {
    std::vector<std::vector<double>> out;
    for (int k = 0; k < 13; ++k) {
      Kokkos::deep_copy(q, .1 * k * k);
      gsp::read_encoders(exec, encoders, dt, q);
      exec.fence();
      out.push_back(numbers(encoders.velocity));
    }
    return out;
  };
  auto const first = later();
  gsp::copy_encoders(exec, saved, encoders);
  CHECK(later() == first);
  CHECK_THROWS_AS(gsp::copy_encoders(exec, alone, encoders), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::read_encoders(exec, encoders, 2 * dt, q),
                       "gsp::read_encoders: velocities are over readings of one dt, and this is another: call it at one rate, or make the "
                       "encoders anew",
                       std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_encoders<double>(exec, {.resolution = 0}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_encoders<double>(exec, {.resolution = 1, .span = 0}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::read_encoders(exec, encoders, 0, q), std::invalid_argument);
  CHECK_THROWS_AS(gsp::read_encoders(exec, encoders, dt, Rows<Exec>("z", 3, 1)), std::invalid_argument);
}
