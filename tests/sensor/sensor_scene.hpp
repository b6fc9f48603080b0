#pragma once
// Worlds with sensors, as tests of sensors take them.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/names.hpp>
#include <gsp/sensor/read_sensors.hpp>
#include <string>
#include <vector>

#include "step/world.hpp"

namespace gsp_test {

/// A world of an MJCF text, whose sensors are read by name.
template <class Exec, class R = double>
struct SensedWorld : World<R, Exec> {
  using Base = World<R, Exec>;
  using Mem = typename Exec::memory_space;
  gsp::Sensors<R, Mem> sensors;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> data;
  explicit SensedWorld(std::string const& text, gsp::Profile profile, int worlds = 1)
      : Base(gsp::compile(gsp::io::parse_mjcf(text, "scene.xml")), worlds, {.profile = profile}),
        sensors(gsp::make_sensors(this->exec, this->model, this->compiled, {.worlds = worlds})),
        data("data", worlds, this->compiled.nsensordata) {}
  void read() {
    gsp::forward(this->exec, this->model, this->state, this->sim, strict());
    gsp::read_sensors(this->exec, this->model, this->state, this->sim, sensors, data);
    this->exec.fence();
  }
  /// What a solver leaves is below a rounding of what gravity does.
  static gsp::LaunchOptions strict() { return {.solver = {.iterations = 20000, .tolerance = R(1e-13)}}; }
  /// Comes to rest, at last as far as the solver goes.
  void settle(int steps) {
    gsp::step(this->exec, this->model, this->state, this->sim, {.steps = steps - 100, .solver = {.tolerance = R(1e-6)}});
    gsp::step(this->exec, this->model, this->state, this->sim, {.steps = 100, .solver = strict().solver});
  }
  std::vector<double> operator()(char const* name, int w = 0) const {
    int const id = gsp::sensor_id(this->compiled, name), adr = this->compiled.sensor_adr[id];
    auto const numbers = host(data);
    std::vector<double> out;
    for (int c = 0; c < this->compiled.sensor_dim[id]; ++c) out.push_back(double(numbers(w, adr + c)));
    return out;
  }
};

/// Largest difference.
inline double away(std::vector<double> const& a, std::vector<double> const& b) {
  REQUIRE(a.size() == b.size());
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::fmax(worst, std::isfinite(a[i]) ? std::abs(a[i] - b[i]) : INFINITY);
  return worst;
}

}  // namespace gsp_test
