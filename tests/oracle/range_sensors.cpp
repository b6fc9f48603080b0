// Rangefinders of sites beside MuJoCo's sensordata, profile mujoco, double: sites all over a scene that turns and swings, all fields,
// misses and cutoffs. Within 1e-12 of numbers of the size of the scene, 10: both have a ray's closed form, and double rounds at 1e-16.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/sensor/read_sensors.hpp>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "support/kernels.hpp"

TEST_CASE("rangefinders say what MuJoCo's do") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  Exec const exec;
  gsp_test::Random r{7};
  std::string text = "<mujoco><worldbody><geom type='plane' size='3 2 1'/><geom type='box' size='.3 .2 .4' pos='1 1 .6' euler='20 30 0'/>",
              sensors;
  char const* const shapes[] = {"sphere", "capsule", "ellipsoid", "cylinder", "box"};
  char const* const data[] = {"",
                              " data='dist dir origin point normal depth'",
                              " data='dir point'",
                              " cutoff='.5'",
                              " data='dist normal' cutoff='.3'",
                              " data='origin depth'"};
  for (int k = 0; k < 8; ++k) {
    auto const number = [&] { return std::to_string(r()) + " "; };
    text += "<body pos='" + number() + number() + std::to_string(1 + 0.5 * r()) + "'><joint type='ball'/><geom type='" + shapes[k % 5] +
            "' size='.2 .15 .1' contype='0' conaffinity='0'/><site name='a" + std::to_string(k) + "' pos='.05 0 .02' quat='" + number() +
            number() + number() + number() + "'/><body pos='.3 .1 .2'><joint axis='1 1 0'/><geom type='" + shapes[(k + 2) % 5] +
            "' size='.1 .12 .1' contype='0' conaffinity='0'/><site name='b" + std::to_string(k) + "' quat='" + number() + number() +
            number() + number() + "'/></body></body>";
    for (char const site : {'a', 'b'})
      sensors += std::string("<rangefinder site='") + site + std::to_string(k) + "'" + data[(k + (site == 'b' ? 3 : 0)) % 6] + "/>";
  }
  text += "</worldbody><sensor>" + sensors + "</sensor></mujoco>";
  auto const oracle = gsp_test::load_oracle("ranges.xml", text);
  mjModel const* const m = oracle.m();
  mjData* const d = oracle.d();
  auto const compiled = gsp::compile(gsp::io::parse_mjcf(text, "ranges.xml"));
  auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
  auto state = gsp::make_state(exec, model);
  auto sim = gsp::make_simulation(exec, model, compiled);
  auto table = gsp::make_sensors(exec, model, compiled);
  CHECK(table.left_out.empty());
  REQUIRE(m->nsensordata == compiled.nsensordata);
  auto values = gsp::detail::allocate_zero<Kokkos::View<double**, Kokkos::LayoutRight, Kokkos::HostSpace>>(exec, "data", 1, m->nsensordata);
  int hits = 0, misses = 0;
  double worst = 0;
  for (int k = 0; k < 60; ++k) {
    for (int i = 0; i < m->nq; ++i) d->qpos[i] = r();
    mj_normalizeQuat(m, d->qpos);
    for (int i = 0; i < m->nq; ++i) state.qpos(0, i) = d->qpos[i];
    mj_forward(m, d);
    gsp::forward(exec, model, state, sim);
    gsp::read_sensors(exec, model, state, sim, table, values);
    for (int i = 0; i < m->nsensordata; ++i) worst = std::fmax(worst, std::abs(values(0, i) - d->sensordata[i]));
    for (int i = 0; i < m->nsensor; ++i)
      if (m->sensor_dim[i] == 1 && m->sensor_cutoff[i] == 0) (d->sensordata[m->sensor_adr[i]] < 0 ? misses : hits) += 1;
  }
  CHECK(hits > 50);
  CHECK(misses > 50);
  CHECK(worst < 1e-12);
}
