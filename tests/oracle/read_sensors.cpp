// All sensors of a model at once beside MuJoCo's sensordata, profile mujoco, double: rangefinders, distances, and sensors that speak late
// or seldom.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/sensor/read_sensors.hpp>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "support/kernels.hpp"

namespace {
/// One model in both.
struct Both {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  Exec exec;
  gsp_test::Oracle oracle;
  mjModel const* m;
  mjData* d;
  gsp::CompiledModel compiled;
  gsp::Model<double, Kokkos::HostSpace> model;
  gsp::State<double, Kokkos::HostSpace> state;
  gsp::Simulation<double, Kokkos::HostSpace> sim;
  gsp::Sensors<double, Kokkos::HostSpace> table;
  Kokkos::View<double**, Kokkos::LayoutRight, Kokkos::HostSpace> values;
  explicit Both(std::string const& text)
      : oracle(gsp_test::load_oracle("ranges.xml", text)),
        m(oracle.m()),
        d(oracle.d()),
        compiled(gsp::compile(gsp::io::parse_mjcf(text, "ranges.xml"))),
        model(gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco})),
        state(gsp::make_state(exec, model)),
        sim(gsp::make_simulation(exec, model, compiled)),
        table(gsp::make_sensors(exec, model, compiled)),
        values("data", 1, compiled.nsensordata) {
    REQUIRE(m->nsensordata == compiled.nsensordata);
  }
  /// Both at random coordinates, sensors read.
  void pose(gsp_test::Random& r) {
    for (int i = 0; i < m->nq; ++i) d->qpos[i] = r();
    mj_normalizeQuat(m, d->qpos);
    for (int i = 0; i < m->nq; ++i) state.qpos(0, i) = d->qpos[i];
    mj_forward(m, d);
    gsp::forward(exec, model, state, sim);
    gsp::read_sensors(exec, model, state, sim, table, values);
  }
};
}  // namespace

// Sites all over a scene that turns and swings, all fields, misses and cutoffs. Within 1e-12 of numbers of the size of the scene, 10: both
// have a ray's closed form, and double rounds at 1e-16.
TEST_CASE("rangefinders say what MuJoCo's do") {
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
  Both both(text);
  CHECK(both.table.left_out.empty());
  mjModel const* const m = both.m;
  int hits = 0, misses = 0;
  double worst = 0;
  for (int k = 0; k < 60; ++k) {
    both.pose(r);
    for (int i = 0; i < m->nsensordata; ++i) worst = std::fmax(worst, std::abs(both.values(0, i) - both.d->sensordata[i]));
    for (int i = 0; i < m->nsensor; ++i)
      if (m->sensor_dim[i] == 1 && m->sensor_cutoff[i] == 0) (both.d->sensordata[m->sensor_adr[i]] < 0 ? misses : hits) += 1;
  }
  CHECK(hits > 50);
  CHECK(misses > 50);
  CHECK(worst < 1e-12);
}

// Cameras of all modes, of fovy and of a sensor, on bodies and on the world; within 1e-12 but for where a ray grazes an edge: there
// rounding decides what it meets. Of 20,000 numbers none did.
TEST_CASE("rangefinders of cameras say what MuJoCo's do, pixel by pixel") {
  gsp_test::Random r{11};
  std::string text =
      "<mujoco><worldbody><geom type='plane' size='3 2 1'/><geom type='box' size='.3 .2 .4' pos='1 1 .6' euler='20 30 0'/>"
      "<camera name='world' pos='0 -4 2' xyaxes='1 0 0 0 .4 .9' resolution='5 4' fovy='70'/>";
  char const* const shapes[] = {"sphere", "capsule", "ellipsoid", "cylinder", "box"};
  char const* const cameras[] = {
      "resolution='7 5' fovy='80'", "mode='track' resolution='3 6'", "mode='trackcom' resolution='9 2' fovy='60'",
      "mode='targetbody' target='b0' resolution='4 3'",
      "mode='targetbodycom' target='b1' resolution='8 3' sensorsize='.004 .003' focal='.003 .0025' principal='.0017 .001'"};
  std::string sensors = "<rangefinder camera='world' data='dist dir origin point normal depth'/>";
  char const* const data[] = {"", "data='dist dir origin point normal depth'", "data='point depth' cutoff='.8'", "data='depth'",
                              "data='dir normal'"};
  for (int k = 0; k < 5; ++k) {
    auto const number = [&] { return std::to_string(r()) + " "; };
    std::string const name = std::to_string(k);
    text += "<body name='b" + name + "' pos='" + number() + number() + std::to_string(1 + 0.5 * r()) +
            "'><joint type='ball'/><geom type='" + shapes[k] + "' size='.2 .15 .1' contype='0' conaffinity='0'/><camera name='c" + name +
            "' pos='.05 0 .02' quat='" + number() + number() + number() + number() + "' " + cameras[k] +
            "/><body pos='.3 .1 .2'><joint axis='1 1 0'/><geom type='" + shapes[(k + 2) % 5] +
            "' size='.1 .12 .1' contype='0' conaffinity='0'/></body></body>";
    sensors += "<rangefinder camera='c" + name + "' " + data[k] + "/>";
  }
  Both both(text + "</worldbody><sensor>" + sensors + "</sensor></mujoco>");
  CHECK(both.table.left_out.empty());
  int hits = 0, off = 0;
  for (int k = 0; k < 25; ++k) {
    both.pose(r);
    for (int i = 0; i < both.m->nsensordata; ++i) off += !(std::abs(both.values(0, i) - both.d->sensordata[i]) < 1e-12);
    for (int i = 0; i < 18; ++i) hits += both.values(0, both.m->sensor_adr[2] + 14 * i) > 0;
  }
  CHECK(hits > 30);
  CHECK(off == 0);
}

// Bodies of several geoms of all types, geoms alone, both orders, cutoffs that see some; ccd_tolerance 1e-12. Distances within 1e-9,
// normals within 1e-4, points within 5e-5: tests/oracle/convex.cpp says which of these are MuJoCo's tolerance. Capsules are not measured
// against boxes, into which their segments go (there, too).
TEST_CASE("sensors of distances say what MuJoCo's do") {
  gsp_test::Random r{5};
  auto const number = [&](double size) { return std::to_string(size * r()) + " "; };
  std::string points;
  for (int i = 0; i < 60; ++i) points += number(i % 3 == 0 ? 0.3 : 0.2);
  auto const place = [&] {
    return "' pos='" + number(.3) + number(.3) + number(.3) + "' quat='" + number(1) + number(1) + number(1) + number(1) + "' ";
  };
  auto const body = [&](std::string const& name, std::initializer_list<char const*> geoms) {
    std::string s = "<body name='" + name + "'><freejoint/>";
    int k = 0;
    for (auto const* g : geoms) s += "<geom name='" + name + std::to_string(k++) + place() + g + " contype='0' conaffinity='0'/>";
    return s + "</body>";
  };
  std::string text = "<mujoco><option ccd_tolerance='1e-12' ccd_iterations='1000'/><asset><mesh name='m' vertex='" + points +
                     "'/></asset><worldbody><geom name='floor' type='plane' size='0 0 1' pos='0 0 -1'/>" +
                     body("a", {"size='.15'", "type='cylinder' size='.1 .2'", "type='capsule' size='.1 .2'"}) +
                     body("b", {"type='ellipsoid' size='.2 .15 .1'", "type='mesh' mesh='m'"}) + body("c", {"type='box' size='.2 .1 .15'"}) +
                     body("d", {"type='mesh' mesh='m'", "size='.1'", "type='cylinder' size='.2 .1'"}) +
                     "<body name='none'/></worldbody><sensor>";
  char const* const pairs[] = {"body1='a' body2='b'",   "body1='b' body2='a'",     "body1='d' geom2='c0'",
                               "geom1='c0' body2='b'",  "geom1='floor' body2='d'", "body1='c' geom2='floor'",
                               "geom1='a2' geom2='d0'", "geom1='a1' geom2='d2'",   "body1='none' body2='a'"};
  for (auto const* const pair : pairs)
    for (char const* const type : {"distance", "normal", "fromto"})
      for (char const* const cutoff : {"", " cutoff='.5'", " cutoff='4'"}) text += std::string("<") + type + " " + pair + cutoff + "/>";
  Both both(text + "</sensor></mujoco>");
  CHECK(both.table.left_out.empty());
  mjModel const* const m = both.m;
  double distance = 0, normal = 0, point = 0;
  int inside = 0, apart = 0, none = 0;
  for (int k = 0; k < 100; ++k) {
    both.pose(r);
    for (int i = 0; i < m->nsensor; ++i) {
      double away = 0, size = 0;
      for (int c = m->sensor_adr[i]; c < m->sensor_adr[i] + m->sensor_dim[i]; ++c) {
        away = std::fmax(away, std::abs(both.values(0, c) - both.d->sensordata[c]));
        size = std::fmax(size, std::abs(both.d->sensordata[c]));
      }
      double& worst = m->sensor_dim[i] == 1 ? distance : m->sensor_dim[i] == 3 ? normal : point;
      worst = std::fmax(worst, away);
      if (m->sensor_dim[i] == 1) (both.d->sensordata[m->sensor_adr[i]] < 0 ? inside : apart) += 1;
      if (m->sensor_dim[i] == 6) none += size == 0;
    }
  }
  MESSAGE("distances ", distance, ", normals ", normal, ", points ", point, "; inside ", inside, ", apart ", apart, ", none ", none);
  CHECK(inside > 100);
  CHECK(apart > 500);
  CHECK(none > 500);
  CHECK(distance < 1e-9);
  CHECK(normal < 1e-4);
  CHECK(point < 5e-5);
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
    return "<mujoco><worldbody><body><joint name='h'/><geom name='g' size='.1'/><geom name='f' size='.1'/><site "
           "name='s'/></body></worldbody><sensor>" +
           attributes + "</sensor></mujoco>";
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
  refused("<user/>", "'dim' is missing; give how many numbers");
  refused("<user dim='1' needstage='foo'/>", "give one of: pos, vel, acc");
  refused("<user dim='1' datatype='foo'/>", "give one of: real, positive, axis, quaternion");
  refused("<insidesite site='s' objtype='joint' objname='h'/>", "is about a body, geom, site or camera");
  refused("<framepos objtype='subtree' objname='world'/>", "is about a body, geom, site or camera");
  refused("<distance body1='world' geom1='g' geom2='f'/>", "attribute 'geom1' names one object too many");
}
