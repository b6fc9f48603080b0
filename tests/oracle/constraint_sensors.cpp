// Sensors of the forces of constraints and of accelerations against MuJoCo's sensordata after mj_forward, with contacts, limits and
// equalities, profile `mujoco`, double, at states that MuJoCo has come to.
//
// Both solve one strictly convex problem; Newton's methods end where rounding lets them. What parts them is rounding of the accelerations
// without constraints and of v / h, times the condition of H = 1 + Y^T B Y, below 1e5 (tests/oracle/contact_steps.cpp): 1e5 x 2e-16 x
// (|a| + |v| / h) of forces; 1e-9 of what is no force. Scale: the largest number that sensors of the kind have, or 1.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/sensor/read_sensors.hpp>
#include <limits>
#include <map>
#include <sstream>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "support/data.hpp"
#include "support/kernels.hpp"
#include "support/skip.hpp"

namespace {
using Exec = Kokkos::DefaultHostExecutionSpace;

struct Tally {
  int states = 0, same = 0, compared = 0;
  std::map<std::string, double> worst;  // of each type, beside the largest number of its sensors in the state, or 1
  double most() const {
    double all = 0;
    for (auto const& [type, off] : worst) all = std::fmax(all, off);
    return all;
  }
};

/// Each of their contacts is the k-th of ours, or one of ours (`order` says whether all are in their places).
template <class Contacts>
bool same_contacts(Contacts const& found, int w, mjData const* d, bool& order) {
  order = found.count_of(w) == d->ncon;
  if (found.count_of(w) != d->ncon) return false;
  for (int k = 0; k < d->ncon; ++k) {
    auto const& t = d->contact[k];
    int match = -1;
    for (int c = found.first_of(w); c < found.first_of(w) + found.count_of(w); ++c) {
      double away = std::abs(found.dist(c) - t.dist);
      for (int i = 0; i < 3; ++i) away = std::fmax(away, std::abs(found.pos(c, i) - t.pos[i]));
      for (int i = 0; i < 9; ++i) away = std::fmax(away, 0.1 * std::abs(found.frame(c, i) - t.frame[i]));
      if (found.geom1(c) == t.geom[0] && found.geom2(c) == t.geom[1] && away < 1e-12) match = c - found.first_of(w);
    }
    if (match < 0) return false;
    order &= match == k;
  }
  return true;
}

/// Compares all sensors at `states` states, which MuJoCo comes to from where it stands.
/// @param every  steps between them
Tally compare(gsp::Description const& description, mjModel* m, mjData* d, int states, int every = 10, double push = 0.5) {
  m->opt.disableflags = (m->opt.disableflags | mjDSBL_AUTORESET | mjDSBL_WARMSTART) & ~mjDSBL_SENSOR;
  m->opt.enableflags &= ~mjENBL_SLEEP;
  auto const compiled = gsp::compile(description);
  REQUIRE(compiled.nsensor == m->nsensor);
  REQUIRE(compiled.nsensordata == m->nsensordata);
  Exec const exec;
  auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
  gsp_test::Random r;
  std::vector<std::vector<double>> qpos, qvel, act, ctrl, mocap_pos, mocap_quat;
  auto const keep = [](auto& to, double const* from, int n) { to.emplace_back(from, from + n); };
  mj_resetData(m, d);
  if (m->nkey > 0) mj_resetDataKeyframe(m, d, 0);
  for (int step = 0; step < 400 * every && int(qpos.size()) < states; ++step) {
    if (step % 20 == 0)
      for (int i = 0; i < m->nu; ++i) {
        double const lo = m->actuator_ctrllimited[i] ? m->actuator_ctrlrange[2 * i] : -1,
                     hi = m->actuator_ctrllimited[i] ? m->actuator_ctrlrange[2 * i + 1] : 1;
        d->ctrl[i] = lo + (hi - lo) * (0.5 + 0.5 * push * r());
      }
    mj_step(m, d);
    bool finite = true;
    for (int i = 0; i < m->nv; ++i) finite = finite && std::abs(d->qvel[i]) < 1e3;
    if (!finite) break;
    if (step % every != every - 1) continue;
    keep(qpos, d->qpos, m->nq), keep(qvel, d->qvel, m->nv), keep(act, d->act, m->na), keep(ctrl, d->ctrl, m->nu);
    keep(mocap_pos, d->mocap_pos, 3 * m->nmocap), keep(mocap_quat, d->mocap_quat, 4 * m->nmocap);
  }
  m->opt.solver = mjSOL_NEWTON, m->opt.iterations = 1000, m->opt.tolerance = 0, m->opt.ls_iterations = 200, m->opt.ls_tolerance = 1e-12;
  Tally tally;
  int const n = tally.states = int(qpos.size());
  if (n == 0) return tally;
  auto state = gsp::make_state(exec, model, {.worlds = n});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = n});
  auto sensors = gsp::make_sensors(exec, model, compiled, {.worlds = n});
  CHECK(sensors.left_out.size() == sensors.why.size());
  Kokkos::View<double**, Kokkos::LayoutRight, Exec::memory_space> data("data", n, compiled.nsensordata);
  Kokkos::deep_copy(data, 77.);
  for (int w = 0; w < n; ++w) {
    auto const put = [&](auto const& view, std::vector<double> const& from) {
      std::copy(from.begin(), from.end(), view.data() + from.size() * std::size_t(w));
    };
    put(state.qpos, qpos[w]), put(state.qvel, qvel[w]), put(state.act, act[w]), put(state.ctrl, ctrl[w]);
    put(state.mocap_pos, mocap_pos[w]), put(state.mocap_quat, mocap_quat[w]);
  }
  gsp::forward(exec, model, state, sim);
  gsp::read_sensors(exec, model, state, sim, sensors, data);
  exec.fence();
  std::vector<bool> left_out(std::size_t(m->nsensor), false);
  for (int i : sensors.left_out) left_out[std::size_t(i)] = true;
  for (int w = 0; w < n; ++w) {
    mj_resetData(m, d);
    auto const put = [&](double* to, std::vector<double> const& from) { std::copy(from.begin(), from.end(), to); };
    put(d->qpos, qpos[w]), put(d->qvel, qvel[w]), put(d->act, act[w]), put(d->ctrl, ctrl[w]);
    put(d->mocap_pos, mocap_pos[w]), put(d->mocap_quat, mocap_quat[w]);
    mj_forward(m, d);
    CHECK(state.status(w) == 0);
    bool order = false;
    if (!same_contacts(sim.contacts, w, d, order)) continue;
    ++tally.same;
    std::map<std::string, double> largest;
    double rounded = 1;
    for (int i = 0; i < m->nv; ++i)
      rounded = std::fmax(rounded, std::fmax(std::abs(d->qacc_smooth[i]), std::abs(d->qvel[i]) / m->opt.timestep));
    auto const compared = [&](int i) {
      auto const& s = compiled.sensors[std::size_t(i)];
      if (s.type == "clock" || left_out[std::size_t(i)]) return false;
      if (s.type == "torque" && compiled.site_body[std::size_t(compiled.sensor_id[std::size_t(i)])] == 0)
        return false;  // MuJoCo adds up torques about the centres of mass of different trees; ours: tests/sensor/acceleration_sensors.cpp
      // The first of a list, and which of equal forces comes first (those in the gap have none), ask for lists of one order.
      auto const reduce = s.type == "contact" ? gsp::contact_settings(s).reduce : gsp::ContactReduce::netforce;
      return order || (reduce != gsp::ContactReduce::none && reduce != gsp::ContactReduce::maxforce);
    };
    for (int i = 0; i < m->nsensor; ++i)
      for (int c = 0; c < m->sensor_dim[i] && compared(i); ++c) {
        double& most = largest[compiled.sensors[std::size_t(i)].type];
        most = std::fmax(most, std::abs(d->sensordata[m->sensor_adr[i] + c]));
      }
    for (int i = 0; i < m->nsensor; ++i) {
      int const adr = m->sensor_adr[i];
      if (left_out[std::size_t(i)]) {
        for (int c = 0; c < m->sensor_dim[i]; ++c) CHECK(data(w, adr + c) == 77);
        continue;
      }
      if (!compared(i)) continue;
      ++tally.compared;
      auto const& type = compiled.sensors[std::size_t(i)].type;
      double same = 0, opposite = 0;
      for (int c = 0; c < m->sensor_dim[i]; ++c) {
        double const x = data(w, adr + c), y = d->sensordata[adr + c];
        same = std::fmax(same, std::isfinite(x) ? std::abs(x - y) : INFINITY), opposite = std::fmax(opposite, std::abs(x + y));
      }
      double const off = (m->sensor_datatype[i] == mjDATATYPE_QUATERNION ? std::fmin(same, opposite) : same) / std::fmax(1, largest[type]);
      double& worst = tally.worst[type];
      if (off > worst) worst = off;
      auto const stage = gsp::find_sensor_type(type)->stage;
      bool const force = stage == gsp::SensorStage::constraint || stage == gsp::SensorStage::acceleration;
      double const most = force ? std::fmax(1e-9, 1e5 * std::numeric_limits<double>::epsilon() * rounded) : 1e-9;
      if (off > most) {
        std::ostringstream numbers;
        numbers.precision(17);
        for (int c = 0; c < std::min<int>(m->sensor_dim[i], 20); ++c) numbers << " " << data(w, adr + c) << "|" << d->sensordata[adr + c];
        CHECK_MESSAGE(false, "state " << w << ", sensor " << i << " (" << type << " '" << compiled.sensors[std::size_t(i)].name
                                      << "'): " << off << " > " << most << ":" << numbers.str());
      }
    }
  }
  return tally;
}

Tally compare_text(std::string const& text, int states = 20, int every = 10) {
  auto const oracle = gsp_test::load_oracle("model.xml", text);
  auto const tally = compare(gsp::io::parse_mjcf(text, "model.xml"), oracle.m(), oracle.d(), states, every);
  std::ostringstream worst;
  for (auto const& [type, off] : tally.worst) worst << " " << type << " " << off;
  MESSAGE(tally.states << " states, " << tally.same << " with the same contacts, " << tally.compared << " sensors:" << worst.str());
  return tally;
}

char const* const robot =
    R"(<body name="a" pos="0 0 .4"><freejoint/><geom name="ga" type="box" size=".2 .15 .05" mass="2"/><site name="sa" pos=".1 .05 .02" euler="20 30 10"/>
  <site name="za" type="box" size=".25 .2 .1"/><site name="zb" type="sphere" size=".07" pos=".2 .15 -.05"/><site name="zc" type="cylinder" size=".05 .03" pos="-.2 .15 -.2"/>
  <site name="zd" type="capsule" size=".04 .05" pos="-.2 -.15 -.1" euler="0 30 0"/><site name="ze" type="ellipsoid" size=".1 .05 .08" pos=".2 -.15 -.05"/>
  <body name="b" pos=".25 0 0"><joint name="h" axis="0 1 0" range="-60 20" margin=".3" damping=".1"/><geom name="gb" type="capsule" size=".04 .1" pos="0 0 -.15" mass=".7"/><site name="sb" pos="0 .01 -.15" euler="40 0 20"/>
    <body name="c" pos="0 0 -.3"><joint name="s" type="slide" axis="0 0 1" range="-.05 .02"/><geom name="gc" type="sphere" size=".06" mass=".4"/><site name="sc" size=".08"/></body></body>
  <body name="d" pos="-.25 0 0"><joint name="q" type="ball" range="0 40"/><geom name="gd" type="capsule" size=".03 .12" pos="0 .01 -.1" mass=".5"/><site name="sd" pos="0 0 -.2" type="box" size=".05 .05 .1"/><camera name="cam" pos="0 .1 0" euler="30 0 0"/></body></body>)";
char const* const contact_variants = R"(
  <contact name="all" num="6" data="found force torque dist pos normal tangent linvel angvel" reduce="mindist"/>
  <contact num="3" data="found force torque dist pos normal tangent linvel angvel" reduce="maxforce"/>
  <contact num="2" data="found force torque dist pos normal tangent" reduce="netforce"/>
  <contact num="5" data="found force torque dist pos normal tangent linvel angvel" reduce="none"/>
  <contact geom1="ga" num="3" data="found force torque dist pos normal tangent linvel angvel" reduce="mindist"/>
  <contact geom2="ga" num="3" data="found force torque dist pos normal tangent linvel angvel" reduce="mindist"/>
  <contact geom1="ga" geom2="floor" num="3" data="found force torque normal tangent linvel angvel" reduce="mindist"/>
  <contact geom1="floor" geom2="ga" num="3" data="found force torque normal tangent linvel angvel" reduce="mindist"/>
  <contact body1="c" data="found force normal" reduce="maxforce"/><contact body2="c" data="found force normal" reduce="maxforce"/>
  <contact body1="c" body2="world" num="2" data="found force torque pos normal" reduce="netforce"/><contact body1="world" body2="c" data="found force torque pos" reduce="netforce"/>
  <contact subtree1="a" num="4" data="found force pos" reduce="mindist"/><contact subtree2="b" data="force torque" reduce="netforce"/><contact subtree1="a" subtree2="a" num="2" data="found dist" reduce="mindist"/>
  <contact subtree1="b" geom2="floor" data="found force linvel" reduce="maxforce"/><contact site="za" num="8" data="found dist pos" reduce="mindist"/><contact site="sc" body2="c" data="found force normal" reduce="maxforce"/>
  <contact site="zd" data="found"/><contact subtree1="world" data="found"/><contact geom1="gd" data="found force torque dist pos normal tangent" reduce="netforce"/>)";
char const* const others =
    R"(<touch site="za"/><touch site="zb"/><touch site="zc"/><touch site="zd"/><touch site="ze"/><touch site="sc"/><touch site="sd" cutoff="1"/><touch site="wt"/>
  <jointlimitpos joint="h"/><jointlimitvel joint="h"/><jointlimitfrc joint="h"/><jointlimitpos joint="s"/><jointlimitvel joint="s"/><jointlimitfrc joint="s" cutoff="3"/>
  <tendonlimitpos tendon="t"/><tendonlimitvel tendon="t"/><tendonlimitfrc tendon="t"/><tendonlimitpos tendon="p"/><tendonlimitvel tendon="p"/><tendonlimitfrc tendon="p"/>
  <accelerometer site="sa"/><accelerometer site="sb"/><accelerometer site="sc" cutoff="8"/><accelerometer site="sd"/><accelerometer site="wt"/><accelerometer site="st"/><accelerometer site="mc"/>
  <force site="sa"/><torque site="sa"/><force site="sb"/><torque site="sb"/><force site="sc"/><torque site="sc"/><force site="sd"/><torque site="sd"/><force site="wt"/><torque site="wt"/>
  <force site="st"/><torque site="st"/><force site="sv"/><torque site="sv"/><force site="mc"/><torque site="mc"/><force site="md"/><torque site="md"/>
  <framelinacc objtype="body" objname="d"/><framelinacc objtype="xbody" objname="d"/><framelinacc objtype="geom" objname="gd"/><framelinacc objtype="camera" objname="cam"/><framelinacc objtype="site" objname="sb"/>
  <frameangacc objtype="body" objname="b"/><frameangacc objtype="xbody" objname="c" cutoff="2"/><framelinacc objtype="body" objname="stand"/><framelinacc objtype="body" objname="world"/>
  <insidesite site="za" objtype="body" objname="b"/><insidesite site="zb" objtype="site" objname="sb"/><insidesite site="big" objtype="body" objname="a"/><insidesite site="big" objtype="geom" objname="gc"/><insidesite site="big" objtype="body" objname="hollow"/><insidesite site="big" objtype="xbody" objname="hollow"/>
  <insidesite site="big" objtype="body" objname="world"/>)";
char const* const surroundings =
    R"(<site name="wt" pos="1 0 0"/><site name="big" type="ellipsoid" size=".4 .3 .2"/><geom name="floor" type="plane" size="2 2 1"/>
  <body name="stand" pos="0 .8 .3"><geom name="gs" type="box" size=".1 .1 .3" mass="3"/><site name="st" pos=".1 .2 .3" euler="0 20 40"/><body name="shelf" pos="0 0 .4"><geom type="box" size=".1 .1 .02" mass="1"/>
    <body name="swing" pos="0 0 .2"><joint name="sw" axis="1 0 0" range="-30 30"/><geom type="capsule" size=".03 .1" pos="0 .1 .1" mass=".6"/><site name="sv" pos="0 0 .1"/></body></body></body>
  <body name="cart" mocap="true" pos="-1 0 .2"><geom type="box" size=".1 .1 .1" mass="2"/><site name="mc" pos=".1 0 0" euler="10 0 0"/><body name="hang" pos="0 0 .2"><joint axis="0 1 0"/><geom type="box" size=".02 .02 .1" pos=".05 0 .1" mass=".3"/><site name="md"/></body></body>
  <body name="hollow" pos="0 0 .3"><body name="filled" pos=".1 0 0"><joint name="fj" type="slide" axis="1 0 0"/><geom size=".05" mass="1" contype="0" conaffinity="0"/></body></body>)";
std::string scene(std::string const& option, std::string const& equality = "", std::string const& geoms = "") {
  return "<mujoco><option " + option + "</option><default><geom " + geoms + "/></default><worldbody>" + surroundings + robot +
         "</worldbody><tendon><fixed name=\"t\" margin=\".05\" range=\"-.2 .1\"><joint joint=\"h\" coef=\".3\"/><joint joint=\"s\" "
         "coef=\"2\"/></fixed><spatial name=\"p\" range=\"0 "
         ".35\"><site site=\"sa\"/><site site=\"sb\"/></spatial></tendon><actuator><motor joint=\"h\" ctrlrange=\"-3 3\" "
         "ctrllimited=\"true\"/><position joint=\"s\" kp=\"40\"/></actuator><equality>" +
         equality + "</equality><sensor>" + contact_variants + others + "</sensor></mujoco>";
}
}  // namespace

TEST_CASE("each sensor of forces and accelerations, on a robot that falls, lies, and is held") {
  int same = 0;
  for (char const* cone : {"elliptic", "pyramidal"})
    for (char const* geoms : {"", "condim=\"6\" friction=\".7 .02 .01\"", "margin=\".03\" gap=\".02\"", "condim=\"1\""}) {
      CAPTURE(std::string(cone));
      CAPTURE(std::string(geoms));
      auto const tally = compare_text(scene("timestep=\"0.004\" cone=\"" + std::string(cone) + "\">", "", geoms), 30, 7);
      CHECK(tally.same >= 25);
      same += tally.same;
    }
  MESSAGE(same << " states");
}

TEST_CASE("equalities push from outside: connects and welds, of bodies and of sites, and couplings of joints inside") {
  for (char const* equality :
       {"<connect body1=\"b\" body2=\"swing\" anchor=\".1 0 -.1\"/>", "<weld body1=\"d\" body2=\"a\" torquescale=\".3\"/>",
        "<weld body1=\"a\"/>", "<connect site1=\"sb\" site2=\"sd\" solref=\".3 1\"/>",
        "<weld site1=\"sd\" site2=\"st\" torquescale=\"2\"/>",
        "<joint joint1=\"h\" joint2=\"sw\" polycoef=\".1 2 .3 0 0\"/><tendon tendon1=\"t\"/>"}) {
    CAPTURE(std::string(equality));
    auto const tally = compare_text(scene("timestep=\"0.004\">", equality), 20, 5);
    CHECK(tally.same >= 15);
  }
}

// What pushes or pulls a spatial tendon (spring, damper, actuators within their range, limit, friction, equality) is a force on the bodies
// along its path: sites, both sides of what it wraps, pulleys; a fixed tendon's acts inside.
TEST_CASE("spatial tendons pull from outside") {
  std::string const
      before =
          R"(<mujoco><option timestep="0.004"/><worldbody><site name="w" pos="0 0 1"/><geom name="wc" type="cylinder" size=".1 .3" pos=".1 0 .6" euler="90 0 0" contype="0" conaffinity="0"/>
    <body name="st" pos="-.2 0 .8"><geom size=".05" mass="1" contype="0" conaffinity="0"/><site name="ss" pos="0 .05 0"/></body>
    <body name="a" pos=".2 0 .3"><joint type="ball" damping=".1"/><geom name="ga" size=".12" mass="1" contype="0" conaffinity="0"/><site name="sa" pos=".02 .05 .2"/><site name="side" pos=".2 0 0"/>
      <body name="a2" pos=".3 0 0"><joint name="j" axis="0 1 0" damping=".1"/><geom size=".05" mass=".3" contype="0" conaffinity="0"/><site name="s2" pos=".1 0 .1" euler="10 20 30"/></body></body>
    <body name="b" pos=".5 .1 .1"><freejoint/><geom size=".1" mass="2" contype="0" conaffinity="0"/><site name="sb" pos="-.02 .05 .1" euler="0 50 0"/></body></worldbody><tendon><spatial name="t" )",
      path =
          R"(><site site="w"/><geom geom="wc"/><site site="sa"/><geom geom="ga" sidesite="side"/><site site="s2"/><pulley divisor="2"/><site site="ss"/><site site="sb"/></spatial>
    <fixed name="f" stiffness="3"><joint joint="j" coef="2"/></fixed></tendon>)",
      after =
          R"(<sensor><force site="sa"/><torque site="sa"/><force site="s2"/><torque site="s2"/><force site="sb"/><torque site="sb"/><force site="w"/><accelerometer site="s2"/></sensor></mujoco>)";
  for (auto const& [tendon, rest] :
       {std::pair{"stiffness=\"10\" springlength=\".1\"", ""},
        {"damping=\"3\" frictionloss=\".2\"", "<actuator><motor tendon=\"t\" gear=\"-2\"/></actuator>"},
        {"stiffness=\"10\" range=\"0 1.3\"", ""},
        {"actuatorfrcrange=\"-.5 .5\"",
         "<actuator><motor tendon=\"t\" gear=\"2\"/><position tendon=\"t\" kp=\"3\" forcerange=\"-1 1\"/></actuator>"},
        {"", "<equality><tendon tendon1=\"t\"/></equality>"},
        {"stiffness=\"2\"", "<equality><tendon tendon1=\"f\" tendon2=\"t\" polycoef=\".1 .5 .2 0 0\"/></equality>"}}) {
    CAPTURE(std::string(tendon));
    auto const tally = compare_text(before + tendon + path + rest + after, 20, 7);
    CHECK(tally.same == 20);
    CHECK(tally.compared == 20 * 7);  // not that of the world, on which a body hangs that no joint moves
  }
}

TEST_CASE("adhesion actuators move as their contacts do") {
  std::string text = scene("timestep=\"0.004\">", "", "margin=\".03\" gap=\".02\"");
  auto const add = [&](char const* before, char const* what) { text.insert(text.find(before), what); };
  add("</actuator>", "<adhesion name=\"k\" body=\"a\" ctrlrange=\"0 1\" gain=\"3\"/><adhesion name=\"l\" body=\"c\" ctrlrange=\"0 1\"/>");
  add("</sensor>", "<actuatorvel actuator=\"k\"/><actuatorvel actuator=\"l\" cutoff=\".1\"/><actuatorfrc actuator=\"k\"/>");
  auto const tally = compare_text(text, 30, 7);
  CHECK(tally.same >= 25);
  CHECK(tally.worst.count("actuatorvel") == 1);
}

TEST_CASE("what is disabled is not felt, gravity too") {
  for (char const* flag : {"constraint", "contact", "limit", "gravity"}) {
    CAPTURE(std::string(flag));
    auto const tally = compare_text(scene("timestep=\"0.004\"><flag " + std::string(flag) + "=\"disable\"/>"), 10, 7);
    CHECK(tally.same == 10);
  }
  for (char const* integrator : {"RK4", "implicit", "implicitfast"}) {  // the acceleration is of the start, by M itself
    CAPTURE(std::string(integrator));
    CHECK(compare_text(scene("timestep=\"0.004\" integrator=\"" + std::string(integrator) + "\">"), 10, 7).same >= 8);
  }
}

TEST_CASE("all sensors of real models, in contact" * doctest::test_suite("data")) {
  auto const list = gsp_test::data("models/zoo.txt");
  if (!list) {
    gsp_test::skip("models/zoo.txt is missing from GSP_DATA_DIR");
    return;
  }
  std::ifstream file(*list);
  int models = 0, states = 0, same = 0, compared = 0;
  std::map<std::string, double> worst;
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
    auto const tally = compare(gsp::io::read_mjcf(*path), oracle.m(), oracle.d(), 20);
    MESSAGE(name << ": " << tally.same << " of " << tally.states << " states, " << tally.compared << " sensors, worst " << tally.most());
    ++models, states += tally.states, same += tally.same, compared += tally.compared;
    for (auto const& [type, off] : tally.worst) worst[type] = std::fmax(worst[type], off);
  }
  std::ostringstream text;
  for (auto const& [type, off] : worst) text << " " << type << " " << off;
  MESSAGE(models << " models, " << same << " of " << states << " states with the same contacts, " << compared << " sensors:" << text.str());
  CHECK(models > 0);
  CHECK(same > 0);
}
