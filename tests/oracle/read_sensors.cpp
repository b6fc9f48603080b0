// All sensors of a model at once beside MuJoCo's sensordata, profile mujoco, double: rangefinders, and sensors that speak late or seldom.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/sensor/read_sensors.hpp>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "support/kernels.hpp"

// Sites all over a scene that turns and swings, all fields,
// misses and cutoffs. Within 1e-12 of numbers of the size of the scene, 10: both have a ray's closed form, and double rounds at 1e-16.
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

namespace {
/// A box that falls onto a plane and slides, an arm that a motor turns, and sensors with each way to be late.
std::string scene(std::string const& option) {
  std::string text = "<mujoco><option " + option + R"(/><worldbody><geom type="plane" size="3 3 1"/>
    <body name="box" pos="0 0 .35" euler="10 20 0"><freejoint/><geom name="g" type="box" size=".1 .15 .2" mass="1"/><site name="s" size=".3"/></body>
    <body name="arm" pos="2 0 1"><joint name="h" axis="0 1 0" damping=".1"/><geom type="capsule" size=".04" fromto="0 0 0 .4 0 0"/><site name="t" pos=".4 0 0" euler="0 30 10"/></body></worldbody>
    <actuator><motor name="m" joint="h" gear="2"/></actuator><sensor>)";
  char const* const types[] = {"<clock ",
                               "<jointpos joint='h' ",
                               "<gyro site='t' ",
                               "<accelerometer site='t' cutoff='12' ",
                               "<framequat objtype='body' objname='box' ",
                               "<touch site='s' ",
                               "<contact geom1='g' data='found force' num='2' ",
                               "<actuatorfrc actuator='m' "};
  // nsample keeps, of steps of 0.01: more than the delay needs, fewer, one
  char const* const ways[] = {"nsample='4' delay='.02'",
                              "nsample='4' delay='.015' interp='linear'",
                              "nsample='6' delay='.033' interp='cubic'",
                              "nsample='3' delay='.004' interp='linear'",
                              "nsample='2' delay='.08' interp='cubic'",
                              "nsample='1' delay='.02'",
                              "nsample='5'",
                              "nsample='3' interval='.05'",
                              "nsample='5' interval='.05 -.02'",
                              "nsample='4' interval='.037 -.011' interp='linear'",
                              "nsample='6' interval='.03' delay='.05'",
                              "nsample='6' interval='.025 -.02' delay='.048' interp='linear'",
                              "nsample='9' interval='.03 -.007' delay='.071' interp='cubic'",
                              "nsample='2' interval='.004'",
                              "interval='.05' delay='0' interp='cubic'",
                              ""};
  for (auto const type : types)
    for (auto const way : ways) text += std::string(type) + way + "/>";
  return text + "</sensor></mujoco>";
}
}  // namespace

// Step by step. Each state is MuJoCo's own, so that
// numbers differ by what one evaluation rounds, 1e-9 relative; forces of contacts by what the solvers leave, 1e-7. A time that is wrong by
// a sample is wrong by what moves in a step, 1e-4 and more.
TEST_CASE("late sensors say what MuJoCo's do, and so after worlds are reset by a mask") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  Exec const exec;
  for (std::string const option : {"timestep='.01' tolerance='1e-14' iterations='100'",
                                   "timestep='.0037' integrator='implicitfast' cone='elliptic' tolerance='1e-14' iterations='100'"}) {
    CAPTURE(option);
    std::string const text = gsp::io::format_mjcf(gsp::io::parse_mjcf(scene(option), "late.xml"));  // the writer keeps them
    auto const oracle = gsp_test::load_oracle("late.xml", scene(option));
    mjModel const* const m = oracle.m();
    std::unique_ptr<mjData, void (*)(mjData*)> const other{mj_makeData(m), mj_deleteData};
    mjData* const d[2] = {oracle.d(), other.get()};
    auto const compiled = gsp::compile(gsp::io::parse_mjcf(text, "written.xml"));
    REQUIRE(m->nsensordata == compiled.nsensordata);
    auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
    auto state = gsp::make_state(exec, model, {.worlds = 2});
    auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = 2});
    auto sensors = gsp::make_sensors(exec, model, compiled, {.worlds = 2});
    CHECK(sensors.left_out.empty());
    auto values =
        gsp::detail::allocate_zero<Kokkos::View<double**, Kokkos::LayoutRight, Kokkos::HostSpace>>(exec, "data", 2, m->nsensordata);
    gsp_test::Random r{3};
    std::vector<double> worst(m->nsensor, 0);
    int read_late = 0;
    for (int k = 0; k < 400; ++k) {
      if (k == 137) {
        auto const second = [](int w) { return w == 1; };
        mj_resetData(m, d[1]);
        gsp::reset(exec, model, state, second);
        gsp::reset_sensor_history(exec, sensors.history, second);
      }
      for (int w = 0; w < 2; ++w) {
        d[w]->ctrl[0] = state.ctrl(w, 0) = 3 * r();
        mj_forward(m, d[w]);
        for (int i = 0; i < m->nq; ++i) state.qpos(w, i) = d[w]->qpos[i];
        for (int i = 0; i < m->nq; ++i) state.qpos_low(w, i) = 0;
        for (int i = 0; i < m->nv; ++i) state.qvel(w, i) = d[w]->qvel[i];
      }
      gsp::forward(exec, model, state, sim, {.newton = {.iterations = 200, .tolerance = 1e-14F}});
      gsp::read_sensors(exec, model, state, sim, sensors, values);
      for (int w = 0; w < 2; ++w)
        for (int i = 0; i < m->nsensor; ++i) {
          double largest = 1, error = 0;
          for (int c = m->sensor_adr[i]; c < m->sensor_adr[i] + m->sensor_dim[i]; ++c) {
            double const x = values(w, c), y = d[w]->sensordata[c];
            largest = std::fmax(largest, std::abs(y));
            error = std::fmax(error, std::abs(x - y));
          }
          worst[i] = std::fmax(worst[i], error / largest);
          read_late += m->sensor_history[2 * i] > 0 && m->sensor_delay[i] > 0;
        }
      gsp::record_sensors(exec, state, sensors.history);
      gsp::advance(exec, model, state, sim);
      for (mjData* const each : d) mj_step(m, each);
    }
    CHECK(read_late > 10000);
    for (int i = 0; i < m->nsensor; ++i) {
      bool const of_contacts = compiled.sensors[i].type == "contact" || compiled.sensors[i].type == "touch";
      CHECK_MESSAGE(worst[i] < (of_contacts ? 1e-7 : 1e-9), "sensor " << i << " (" << compiled.sensors[i].type << "): " << worst[i]);
    }
  }
}

TEST_CASE("settings that MuJoCo refuses are refused with a sentence") {
  auto const with = [](std::string const& attributes) {
    return "<mujoco><worldbody><body><joint name='h'/><geom size='.1'/><site name='s'/></body></worldbody><sensor>" + attributes +
           "</sensor></mujoco>";
  };
  auto const refused = [&](std::string const& attributes, std::string const& words) {
    CAPTURE(attributes);
    CHECK_THROWS(gsp_test::load_oracle("bad.xml", with(attributes)));
    std::string said;
    try {
      (void)gsp::compile(gsp::io::parse_mjcf(with(attributes), "bad.xml"));
    } catch (gsp::Error const& error) { said = error.what(); }
    CHECK_MESSAGE(said.find(words) != said.npos, said);
  };
  refused("<clock delay='.02'/>", "keeps no samples: give nsample");
  refused("<clock delay='.02' interval='.05'/>", "keeps no samples: give nsample");
  refused("<clock interval='.05 .01' nsample='3'/>", "positive phase");
  refused("<clock interval='.05 -.05' nsample='3'/>", "above -period");
  refused("<clock interval='-.05' nsample='3'/>", "negative delay or interval");
  refused("<clock interval='1 -.1 3' nsample='2'/>", "at most 2");
  refused("<clock nsample='20000000'/>", "0 to 16777216");
  refused("<clock nsample='2.5'/>", "whole number");
  refused("<clock nsample='2' interp='spline'/>", "zoh, linear, cubic");
  refused("<user dim='1' nsample='2'/>", "nsample");
  refused("<framexaxis objtype='site' objname='s' cutoff='1'/>", "no cutoff");
  refused("<clock noise='-1'/>", "negative cutoff or noise");
}
