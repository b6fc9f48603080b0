// Sensors that are functions of the smooth state against MuJoCo's sensordata, constraints disabled in both, profile `mujoco`, double: a
// model with each of them, in all frames, with and without reference and cutoff; and every model of the zoo that has sensors. 20 random
// states: 1e-10 relative; quaternions up to their sign.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/dynamics/smooth.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/sensor/smooth_sensors.hpp>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "support/data.hpp"
#include "support/kernels.hpp"
#include "support/skip.hpp"

namespace {
using Exec = Kokkos::DefaultHostExecutionSpace;

char const* const every_sensor =
    R"(<mujoco><option timestep="0.004" magnetic="0.3 -0.5 0.2"><flag energy="enable"/></option><worldbody><site name="w" pos=".1 .2 .3" euler="10 20 30"/>
    <body name="a" pos="0 0 1"><freejoint/><geom name="ga" type="box" size=".1 .2 .05" pos=".02 .01 0" euler="5 10 15"/><site name="sa" pos=".1 0 .05" euler="30 0 40"/>
      <camera name="cs" pos=".1 0 .2" euler="90 10 0" sensorsize=".004 .003" focal=".002 .0025" resolution="320 200"/>
      <camera name="cc" mode="trackcom" pos="0 -2 .5" euler="60 0 0" sensorsize=".004 .003" focalpixel="150 170" resolution="320 200"/>
      <body name="b" pos=".2 0 0"><joint name="h" axis="0 1 0" stiffness="2" damping=".1"/><geom name="gb" type="capsule" size=".03 .1" pos="0 .02 .1"/><site name="sb" pos="0 0 .2" euler="0 50 0"/></body>
      <body name="c" pos="-.2 0 0"><joint name="q" type="ball"/><geom type="sphere" size=".06" pos=".01 0 .12"/></body></body>
    <camera name="cf" pos="0 -3 1" xyaxes="1 0 0 0 .3 1" fovy="60" resolution="640 480"/>
    <body name="e" pos="1 0 1"><camera name="ct" mode="targetbody" target="b" pos=".1 2 .3"/><joint name="s" type="slide" axis="0 0 1"/><geom name="ge" type="sphere" size=".1" pos="0 .03 0"/><site name="se" pos="0 .1 0"/></body></worldbody>
    <tendon><fixed name="t"><joint joint="h" coef="2"/></fixed><spatial name="p"><site site="sa"/><site site="sb"/></spatial></tendon>
    <actuator><motor name="m" joint="h" gear="3"/><position name="k" tendon="p" kp="4"/><motor name="n" tendon="p" gear="-2"/><motor name="f" joint="s"/></actuator>
    <sensor><clock/><e_potential/><e_kinetic/><jointpos joint="h"/><jointvel joint="h" cutoff=".4"/><ballquat joint="q"/><ballangvel joint="q" cutoff=".7"/><tendonpos tendon="t"/><tendonvel tendon="p"/>
      <actuatorpos actuator="m"/><actuatorvel actuator="k"/><actuatorfrc actuator="f" cutoff=".2"/><jointactuatorfrc joint="h"/><jointactuatorfrc joint="s"/><tendonactuatorfrc tendon="p"/>
      <framepos objtype="body" objname="b"/><framepos objtype="site" objname="sb" reftype="body" refname="a"/><framepos objtype="geom" objname="gb" reftype="site" refname="se" cutoff=".5"/>
      <framequat objtype="xbody" objname="b"/><framequat objtype="geom" objname="ga" reftype="xbody" refname="b"/><framequat objtype="body" objname="c" reftype="geom" refname="ga"/>
      <framexaxis objtype="site" objname="sa"/><frameyaxis objtype="body" objname="b" reftype="site" refname="sa"/><framezaxis objtype="xbody" objname="e"/>
      <framelinvel objtype="body" objname="a"/><framelinvel objtype="site" objname="sb" reftype="site" refname="se"/><framelinvel objtype="geom" objname="ge" reftype="xbody" refname="b" cutoff="1"/>
      <frameangvel objtype="xbody" objname="c"/><frameangvel objtype="geom" objname="gb" reftype="body" refname="a"/><frameangvel objtype="site" objname="w" reftype="body" refname="a"/>
      <velocimeter site="sa"/><velocimeter site="w"/><gyro site="sb"/><gyro site="sa" cutoff=".3"/><magnetometer site="sb"/><magnetometer site="w"/>
      <camprojection site="sa" camera="cf"/><camprojection site="se" camera="cs"/><camprojection site="sb" camera="cc"/><camprojection site="w" camera="ct" cutoff="90"/>
      <framepos objtype="camera" objname="cc"/><framepos objtype="camera" objname="ct" reftype="site" refname="sa"/><framequat objtype="camera" objname="cs"/><framequat objtype="camera" objname="cc" reftype="camera" refname="ct"/>
      <framexaxis objtype="camera" objname="ct"/><frameyaxis objtype="site" objname="sb" reftype="camera" refname="ct"/><framelinvel objtype="camera" objname="cs" reftype="camera" refname="cc"/>
      <frameangvel objtype="camera" objname="ct"/><framelinvel objtype="site" objname="se" reftype="camera" refname="ct"/><subtreecom body="a"/><subtreelinvel body="a"/><subtreelinvel body="e"/><subtreeangmom body="a"/><subtreeangmom body="b"/><accelerometer site="sa"/><touch site="sa"/></sensor></mujoco>)";

/// Returns how many sensors were compared.
int check(gsp::Description const& description, mjModel* m, mjData* d) {
  m->opt.disableflags = (m->opt.disableflags | mjDSBL_CONSTRAINT | mjDSBL_AUTORESET) & ~mjDSBL_SENSOR;
  auto const compiled = gsp::compile(description);
  REQUIRE(compiled.nsensor == m->nsensor);
  Exec const exec;
  int const worlds = 20;
  auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  auto sensors = gsp::make_sensors(exec, model, compiled, {.worlds = worlds});
  Kokkos::View<double**, Kokkos::LayoutRight, Exec::memory_space> data("data", worlds, compiled.nsensordata);
  gsp_test::Random r;
  std::vector<std::vector<double>> expected;
  for (int w = 0; w < worlds; ++w) {
    mj_resetData(m, d);
    std::vector<double> move(m->nv);
    for (auto& x : move) x = r();
    mj_integratePos(m, d->qpos, move.data(), 0.7);
    for (int i = 0; i < m->nv; ++i) d->qvel[i] = 2 * r();
    for (int i = 0; i < m->nu; ++i) d->ctrl[i] = r();
    for (int i = 0; i < m->na; ++i) d->act[i] = 0.5 + 0.4 * r();
    state.steps(w) = 3 * w, d->time = 3 * w * m->opt.timestep;
    for (int i = 0; i < m->nq; ++i) state.qpos(w, i) = d->qpos[i];
    for (int i = 0; i < m->nv; ++i) state.qvel(w, i) = d->qvel[i];
    for (int i = 0; i < m->nu; ++i) state.ctrl(w, i) = d->ctrl[i];
    for (int i = 0; i < m->na; ++i) state.act(w, i) = d->act[i];
    mj_forward(m, d);
    expected.emplace_back(d->sensordata, d->sensordata + m->nsensordata);
  }
  gsp::smooth_dynamics(exec, model, state, poses, dynamics, {.keep_all = true});
  gsp::smooth_sensors(exec, model, state, poses, dynamics, sensors, data);
  exec.fence();
  int compared = 0;
  for (int i = 0; i < compiled.nsensor; ++i) {
    if (!gsp::detail::is_smooth(gsp::find_sensor_type(compiled.sensors[i].type)->stage)) continue;  // tests/oracle/constraint_sensors.cpp
    ++compared;
    int const adr = m->sensor_adr[i], n = m->sensor_dim[i];
    double worst = 0;
    for (int w = 0; w < worlds; ++w) {
      double largest = 1, same = 0, opposite = 0;
      for (int c = 0; c < n; ++c) {
        double const x = data(w, adr + c), y = expected[w][adr + c];
        largest = std::fmax(largest, std::abs(y)), same = std::fmax(same, std::abs(x - y)), opposite = std::fmax(opposite, std::abs(x + y));
      }
      bool const quat = m->sensor_datatype[i] == mjDATATYPE_QUATERNION;
      worst = std::fmax(worst, (quat ? std::fmin(same, opposite) : same) / largest);
    }
    CHECK_MESSAGE(worst <= 1e-10,
                  "sensor " << i << " (" << compiled.sensors[i].type << " '" << compiled.sensors[i].name << "'): " << worst);
  }
  return compared;
}
}  // namespace

TEST_CASE("each sensor, in all frames, with references and cutoffs") {
  auto const oracle = gsp_test::load_oracle("every_sensor.xml", every_sensor);
  auto const description = gsp::io::parse_mjcf(every_sensor, "every_sensor.xml");
  CHECK(check(description, oracle.m(), oracle.d()) == oracle.m()->nsensor - 2);
  auto const written = gsp_test::load_oracle("written.xml", gsp::io::format_mjcf(description));
  CHECK(check(description, written.m(), written.d()) == written.m()->nsensor - 2);
}

TEST_CASE("every model of the zoo that has sensors" * doctest::test_suite("data")) {
  auto const list = gsp_test::data("models/zoo.txt");
  if (!list) {
    gsp_test::skip("models/zoo.txt is missing from GSP_DATA_DIR");
    return;
  }
  std::ifstream file(*list);
  int models = 0, compared = 0, all = 0;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string name;
    int nq = 0, nv = 0, nbody = 0, ngeom = 0, nu = 0, neq = 0, ntendon = 0, nsensor = 0;
    if (line.empty() || line[0] == '#' || !(words >> name >> nq >> nv >> nbody >> ngeom >> nu >> neq >> ntendon >> nsensor)) continue;
    if (nsensor == 0 || nv == 0) continue;
    CAPTURE(name);
    auto const path = gsp_test::data("models/" + name);
    REQUIRE(path);
    auto const oracle = gsp_test::load_oracle(*path);
    ++models, all += oracle.m()->nsensor;
    compared += check(gsp::io::read_mjcf(*path), oracle.m(), oracle.d());
  }
  MESSAGE(models << " models, " << compared << " of " << all << " sensors");
  CHECK(models > 0);
}

TEST_CASE("the table of types: order, sizes and what a cutoff does are MuJoCo's") {
  std::string sensors;
  for (auto const& info : gsp::sensor_types) {
    using O = gsp::SensorObject;
    std::string about;
    if (info.about == O::joint) about = " joint=\"h\"";
    if (info.about == O::ball) about = " joint=\"q\"";
    if (info.about == O::tendon) about = " tendon=\"t\"";
    if (info.about == O::actuator) about = " actuator=\"m\"";
    if (info.about == O::body) about = " body=\"a\"";
    if (info.about == O::site || info.type == gsp::SensorType::rangefinder) about = " site=\"s\"";
    if (info.about == O::projection) about = " site=\"s\" camera=\"c\"";
    if (info.about == O::frame) about = " objtype=\"site\" objname=\"s\"";
    if (info.about == O::pair) about = " geom1=\"g\" geom2=\"f\"";
    if (info.type == gsp::SensorType::inside_site) about = " site=\"s\" objtype=\"body\" objname=\"a\"";
    if (info.type == gsp::SensorType::user) about = " dim=\"2\"";
    if (info.type == gsp::SensorType::contact) about = " geom1=\"g\"";
    if (info.type != gsp::SensorType::tactile) sensors += "<" + std::string(info.name) + about + "/>";  // it needs a mesh
  }
  std::string const text = R"(<mujoco><worldbody><geom name="f" size=".1"/><camera name="c" resolution="64 48"/><body name="a" pos="0 0 1">
    <joint name="h" limited="true" range="-1 1"/><geom name="g" size=".1"/><site name="s"/><body><joint name="q" type="ball"/><geom size=".1"/></body></body>
    </worldbody><tendon><fixed name="t" limited="true" range="-1 1"><joint joint="h" coef="1"/></fixed></tendon><actuator><motor name="m" joint="h"/></actuator><sensor>)" +
                           sensors + "</sensor></mujoco>";
  auto const oracle = gsp_test::load_oracle("all_types.xml", text);
  auto const compiled = gsp::compile(gsp::io::parse_mjcf(text, "all_types.xml"));
  mjModel const* const m = oracle.m();
  REQUIRE(compiled.nsensor == m->nsensor);
  for (int i = 0; i < m->nsensor; ++i) {
    gsp::SensorInfo const* const info = gsp::find_sensor_type(compiled.sensors[i].type);
    REQUIRE(info);
    CAPTURE(info->name);
    CHECK(int(info->type) + (info->type == gsp::SensorType::user ? 1 : 0) == m->sensor_type[i]);  // MuJoCo counts plug-ins before
    CHECK(compiled.sensor_dim[i] == m->sensor_dim[i]);
    using C = gsp::SensorCutoff;
    bool const axis = m->sensor_datatype[i] == mjDATATYPE_AXIS || m->sensor_datatype[i] == mjDATATYPE_QUATERNION;
    if (info->cutoff != C::ignored) {  // contact and fromto pass it by; a normal's is a distance
      CHECK((info->cutoff == C::refused) == axis);
      CHECK((info->cutoff == C::above) == (m->sensor_datatype[i] == mjDATATYPE_POSITIVE));
    }
  }
}
